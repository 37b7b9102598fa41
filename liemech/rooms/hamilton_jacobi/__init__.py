"""Methods from the Hamilton-Jacobi equation: a step is the canonical map of an approximate generating function.

    hamilton_jacobi.py                  in R^2n, of any order
    lie_poisson_hj.py                   on the dual of a Lie algebra, S(mu) beside the identity
    lie_poisson_first_kind.py           generating functions of the displacement, which begin as class functions
    class_functions.py                  S_0(h g h^-1) = S_0(g)
    derivability.py                     can a Hamiltonian be differentiated as often as a method wants it?

The series of the motion that they are read off is `integrators/motion_series.py`.
"""
