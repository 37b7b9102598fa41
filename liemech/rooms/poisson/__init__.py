"""Poisson systems, y' = B(y) dH(y), where B is not that of a Lie algebra; the structures are in `groups/poisson_structure.py`.

poisson.py                      a structure and an energy
darboux.py, darboux_lie.py      charts in which B is canonical: given ones, and those of Lie's construction
local_coordinates.py            submanifolds by an embedding
canonical_transformation.py     changes of variables by a generating function
metriplectic.py                 energy that stays and entropy that grows; discrete_gradient.py steps it
poisson_euler.py, boris.py      methods: planar systems; charged particles; poisson_hamilton_jacobi.py: every structure
"""
