"""Rooms: what stands on the core and can be read, changed and owned alone.

    constraints/        bodies and points that stay on g(q) = 0: RATTLE, Lobatto's pairs, rolling
    sites/              many sites of one system: terms over graphs, and runs site by site
    fields/             fields g(s, t) on a group, in cells along a line
    hamilton_jacobi/    generating functions, in R^2n and on the dual of a Lie algebra
    poisson/            Poisson structures that are no Lie algebra's, their charts and methods
    fictive_time/       time transformations, and runs whose steps are equal in a fictive time
    noise/              white noise and damping on coadjoint orbits
    derivatives/        tangent maps and gradients of runs
    stability/          steady motions and their stability, Lyapunov exponents
    at_work/            plans outside of `run`: steppers, commands, C code, many machines, orders
    files/              runs in files
    published/          results of others, computed again

Mechanisms are in `liemech/joints`, ready systems in `liemech/models`; estimation, checks, plots, viewer and the
command line are rooms too.  `tests/test_architecture.py` says which room may import which, and by which doors the core
opens them; the core is all the rest: formulas, compiler, groups, tableaus, systems, integrators, simulation.
"""
