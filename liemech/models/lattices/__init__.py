"""Lattices, populations, light, quantum levels, vorticity: Poisson and isospectral systems."""
