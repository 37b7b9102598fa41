"""Derivatives of runs, of the discrete motion and exact up to rounding.

frames.py             directions in which states move, and components of changes along them
directions.py         directions of a start and of parameters of system and method
tangent.py            forwards: the tangent map, by steps in numbers that carry derivatives
tangent_runs.py       `plan.tangent`: of one body, of an ensemble, of many sites
through_events.py     both through jumps and other events: saltation matrices, derivatives of times
gradient.py           `plan.gradient` and `plan.pullback`
losses.py             what is differentiated, a loss or a cotangent, and its derivatives by the states of a run
through_blocks.py     backwards, of bodies: J^T w of a run by the Jacobians of blocks of its steps
blocks.py             these blocks as bodies of one ensemble
varied.py             systems and methods whose numbers carry derivatives; varied_input.py: tables of inputs
differences.py        by parameters of which others are made, by differences
of_sites/             backwards, of many sites: J^T w of a run step by step
steps_backwards.py    J^T w of one step; reversal.py: which states are kept on the way
bridges.py            runs as functions of JAX and PyTorch
"""
