"""Energies and inputs that change with time: given by formulas, and by tables."""
