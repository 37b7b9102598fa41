"""Loops over the sites of one system, in native code and on threads."""
