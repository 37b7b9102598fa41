"""Rigid bodies: free, under gravity, in fluids, in closed form."""
