"""Runge-Kutta methods whose stages are solved one after the other, each for itself.

Sources: [HW] Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed.; [HNW] the same
with Norsett, I; [HLW] Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed.
"""

from __future__ import annotations

from math import sqrt

from .tableau import ButcherTableau, printed

IMPLICIT_EULER = printed("""
    implicit Euler, order 1: Euler 1768; HW IV.3
    1 | 1
    b | 1
""")
IMPLICIT_MIDPOINT = printed("""
    implicit midpoint, order 2: HLW I.1.2
    1/2 | 1/2
      b | 1
""")
TRAPEZOIDAL = printed("""
    trapezoidal, order 2: HLW II.1.1
    0 | 0 0
    1 | 1/2 1/2
    b | 1/2 1/2
""")

_g = (3 + sqrt(3)) / 6
CROUZEIX3 = ButcherTableau.shipped(
    "Crouzeix 3", 3, ((_g, 0), (-1 / sqrt(3), _g)), (1 / 2, 1 / 2), (_g, (3 - sqrt(3)) / 6),
    "Crouzeix 1975, Norsett 1974; HNW II.7, table 7.2 with gamma = (3 + sqrt 3)/6: A-stable",
)  # fmt: skip

SDIRK4 = printed("""
    SDIRK 4(3), order 4(3): Hairer and Wanner; HW IV.6, table 6.5: L-stable
      1/4 | 1/4 0 0 0 0
      3/4 | 1/2 1/4 0 0 0
    11/20 | 17/50 -1/25 1/4 0 0
      1/2 | 371/1360 -137/2720 15/544 1/4 0
        1 | 25/24 -49/48 125/16 -85/12 1/4
        b | 25/24 -49/48 125/16 -85/12 1/4
    b_hat | 59/48 -17/96 225/32 -85/12 0
""")
