"""Pendulums and points on surfaces."""
