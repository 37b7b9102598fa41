"""Derivatives of runs of many sites.

tangent.py: forwards.  adjoint.py: backwards, by the drivers of backward.py; parameters.py: by parameters of
the terms and of the sites.  pullback.py: the gradients that a user asks for.  adaptive.py: of runs by an error estimate, as
runs of the steps that were accepted.
"""
