"""Methods: data, claims, and one pure step each.

In the order in which one reads:

    method.py, memory.py                 what a method is, and what it carries from step to step; implicit.py: steps by an equation
    rkmk.py, commutator_free.py          Runge-Kutta methods in the algebra, products of flows; magnus.py: linear equations
    taylor.py, motion_series.py          power series in time
    variational.py                       Algorithm 1: a discrete action principle; discrete_lagrangian.py: its action
    symplectic_rkmk.py                   Gauss' methods on T*G, in the chart at the middle of a step
    galerkin.py, solvability.py          polynomials in a chart; how long a variational step may be
    kicks/                               bodies in fields: Lie-Verlet, splittings, multiple time steps
    free_body/                           exact steps, rotations, midpoint rules, Moser and Veselov
    separable.py, composition.py         splittings of energies; substeps that cancel their errors
    ending_at_jumps.py                   steps that end where an input jumps

RATTLE, Hamilton-Jacobi, Poisson, stochastic and fictive-time methods are in `liemech/rooms`, beside their systems.
"""
