"""Geometry: Lie groups, their algebras and their coadjoint actions.

In the order in which one reads:

    lie_algebra.py, lie_group.py        velocities and their bracket; elements, exp, log, Ad
    rigid/, matrices/, vector_space.py  rotations and rigid motions in closed form; groups given by generators; R^n
    composed/                           products, powers, semidirect products, sites of several species
    retractions.py                      maps from the algebra to the group: exponential, Cayley
    ad_series.py, bernoulli.py          series of ad_xi, for algebras without closed forms
    coadjoint.py, orbits.py             the group on momenta; dimensions of orbits, momenta on one orbit
    group_action.py, actions.py         groups that move points; representations.py: linear actions and their duals
    poisson_structure.py                brackets of functions that need not come from a group
"""
