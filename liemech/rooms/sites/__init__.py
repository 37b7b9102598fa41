"""Many sites of one system: spins, bodies, points, whose energy is a sum of terms over graphs.

The words in which a formula of one site speaks are in `formulas/sites.py`; here is who makes such formulas, and who
runs them.  In the order in which one reads:

    graphs.py                 which sites are neighbours; colouring.py: sites that can move at the same time
    terms/                    energies over edges: given, bound to a group, as one site has them
    energy_of_species.py      kinetic energies of sites of several kinds
    separable_sites.py        masses in R^n; cotangent_sites.py: momenta and places in one term
    parts_of_spins.py         parts of an energy of spins that move in closed form; spin_splittings.py composes them
    steps_together.py         methods that step all sites at once; galerkin_of_chain.py: the midpoint method of chains and rings
    block_elimination.py      elimination of what ties sites or joints, in an order that is found before the run
    runs/                     runs step by step over the sites
"""
