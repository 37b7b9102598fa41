"""Derivatives of runs, of the discrete motion and exact up to rounding.

tangent.py: how the end depends on the start and on parameters, in numbers that carry derivatives along.
gradient.py: how a function of the end does, backwards through blocks.py (steps of one run as an ensemble),
with reversal.py (which states are kept) and varied.py (systems whose numbers carry derivatives);
losses.py: the function.  bridges.py: the same for JAX and PyTorch.  of_sites/: of runs of many sites.
"""
