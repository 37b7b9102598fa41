"""Spacecraft: orbits and attitude, and what acts on them."""
