"""Runs in fictive time, whose fixed steps have many lengths in physical time.

run.py: the runs, with physical time as part of the state.  arrival.py: the last step, as long as a given
physical time asks.  (origin.py of simulation/ has where such runs began and stand.)
"""
