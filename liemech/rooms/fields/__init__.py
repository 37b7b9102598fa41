"""Fields g(s, t) on a group, in cells along a line: systems of many sites, which march in time or in space.

    density.py     l(eta, xi) = T(xi) - Phi(eta), and quadratic energies of strain
    cell.py        the energy of a cell, a term of the nodes at its ends
    in_cells.py    nodes and cells as a system of many sites; currents, balances, the largest stable step
    field.py       `Field`: its ends, and what acts on it

A Cosserat rod is such a field on SE(3).
"""
