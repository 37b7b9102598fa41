"""Differential equations without an energy: on groups, on spaces that a group moves, on matrices."""
