"""Systems: what moves, by which energy, under which forces.

In the order in which one reads:

    system.py                                 a state that a group carries along, and its velocity
    hamiltonian.py, lagrangian.py             energies of a momentum, of a velocity; kinetic_energy.py: quadratic ones
    lie_poisson.py                            motion on the dual of a Lie algebra
    cotangent.py                              motion on T*G, by energies and Lagrangians that mix velocity and place
    potential.py, mechanical.py               fields and loads; a body in them
    canonical.py, separable.py                positions and momenta in R^n, fast and slow parts of a potential
    parts.py                                  energies in parts whose motion is solved
    vector_field.py, equations/               equations without an energy: in R^n, on groups, on spaces, on matrices
    in_time/                                  energies that change with time; tables (tabulated, knots), inputs
    many/                                     states of many sites, the words by which their energies are asked
    agreement.py, trial.py, inertia.py        checks where a system is made: do energy, gradient and Lagrangian agree?
    input_checks.py                           checks of the starts that users give

Systems with constraints, Poisson structures, noise, time transformations and terms over graphs are in `liemech/rooms`.
"""
