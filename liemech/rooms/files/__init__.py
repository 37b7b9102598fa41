"""Runs in files.

archive.py writes a run and reads it: its records by encoding.py as JSON, its numbers by arrays.py as NumPy's
or HDF5 arrays.  fingerprints.py: have the formulas changed since?  labelled.py: samples for xarray and pandas.
sources.py: of the formulas of a run, for a paper.
"""
