"""Energies that are sums of terms over the edges of graphs.

terms.py                         what a user writes: a term, its graph, `Terms`
sums_of_terms.py                 what a system makes of it: a Hamiltonian, a potential, a load on a power of a group
terms_on_groups.py               how it is made, and what terms a system refuses
bound_terms.py, among.py         a term with the numbers of its edges; graphs between species
terms_at_site.py                 the energy as one site has it, in memory or written out
terms_in_arrays.py               the energy of samples, on whole arrays
kinds_of_terms.py                which terms are symmetric, or move in closed form; trials_of_terms.py what is wrong with them
point_terms.py, near_pairs.py    terms through points that bodies carry; cutoffs and periodic boxes
"""

from . import terms_on_groups  # noqa: F401 (systems learn what terms are on a group)
