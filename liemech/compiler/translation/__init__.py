"""The syntax tree of a formula, walked with numbers of the run in place of floats."""
