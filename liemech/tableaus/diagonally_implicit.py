"""Runge-Kutta methods whose stages are solved one after the other, each for itself.

Sources: [HW] Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed.; [HNW] the same
with Norsett, I; [HLW] Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed.
"""

from __future__ import annotations

from math import sqrt

from .tableau import shipped

IMPLICIT_EULER = shipped("implicit Euler", 1, ((1,),), (1,), (1,), "Euler 1768; HW IV.3")
IMPLICIT_MIDPOINT = shipped("implicit midpoint", 2, ((1 / 2,),), (1,), (1 / 2,), "HLW I.1.2")
TRAPEZOIDAL = shipped(
    "trapezoidal", 2, ((0, 0), (1 / 2, 1 / 2)), (1 / 2, 1 / 2), (0, 1), "HLW II.1.1"
)

_g = (3 + sqrt(3)) / 6
CROUZEIX3 = shipped(
    "Crouzeix 3", 3, ((_g, 0), (-1 / sqrt(3), _g)), (1 / 2, 1 / 2), (_g, (3 - sqrt(3)) / 6),
    "Crouzeix 1975, Norsett 1974; HNW II.7, table 7.2 with gamma = (3 + sqrt 3)/6: A-stable",
)  # fmt: skip

SDIRK4 = shipped(
    "SDIRK 4(3)", 4,
    (
        (1 / 4, 0, 0, 0, 0),
        (1 / 2, 1 / 4, 0, 0, 0),
        (17 / 50, -1 / 25, 1 / 4, 0, 0),
        (371 / 1360, -137 / 2720, 15 / 544, 1 / 4, 0),
        (25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4),
    ),
    (25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4),
    (1 / 4, 3 / 4, 11 / 20, 1 / 2, 1),
    "Hairer and Wanner; HW IV.6, table 6.5: L-stable",
    b_hat=(59 / 48, -17 / 96, 225 / 32, -85 / 12, 0), embedded_order=3,
)  # fmt: skip
