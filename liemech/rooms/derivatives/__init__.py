"""Derivatives of runs, of the discrete motion and exact up to rounding.

tangent.py            the tangent map: steps in numbers that carry derivatives; frames.py: its components
differences.py        by parameters of which others are made, by differences
tangent_runs.py       `plan.tangent`: of one body, of an ensemble, of many sites
gradient.py           `plan.gradient`, backwards through a run in bounded memory
blocks.py             steps of one run as bodies of one ensemble; reversal.py: which states are kept
varied.py             systems and methods whose numbers carry derivatives; varied_input.py: tables of inputs
losses.py             the function that is differentiated
bridges.py            runs as functions of JAX and PyTorch
steps_backwards.py    steps of methods, backwards
of_sites/             all this of runs of many sites
"""
