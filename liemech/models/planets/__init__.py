"""Planets and stars as points."""
