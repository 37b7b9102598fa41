"""Rotations and rigid motions, with closed forms of all their maps."""
