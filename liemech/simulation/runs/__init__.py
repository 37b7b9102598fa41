"""Runs of bodies written out, from where they start to where they stand."""
