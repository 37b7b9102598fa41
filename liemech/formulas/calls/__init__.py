"""Formulas called with arrays: which rows, which axes, and when one row is worth a preparation."""
