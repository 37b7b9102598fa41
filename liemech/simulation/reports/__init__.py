"""Reports of a run to its user.

progress.py: a bar for a run, a line for a compilation.  drift.py: how well the constants of the motion were
kept.  written_tables.py: tables as LaTeX and CSV.
"""
