"""Explicit Runge-Kutta methods without an error estimate, orders 1 to 6.

Sources: [HNW] Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed.; [HLW]
Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed.
"""

from __future__ import annotations

from .tableau import shipped

EULER = shipped("Euler", 1, ((),), (1,), (0,), "Euler 1768; HLW I.1.2")

MIDPOINT = shipped("midpoint", 2, ((), (1 / 2,)), (0, 1), (0, 1 / 2), "Runge 1895; HNW II.1")
HEUN2 = shipped("Heun 2", 2, ((), (1,)), (1 / 2, 1 / 2), (0, 1), "Heun 1900; HLW II.1.1")
RALSTON2 = shipped(
    "Ralston 2",
    2,
    ((), (2 / 3,)),
    (1 / 4, 3 / 4),
    (0, 2 / 3),
    "Ralston, Math. Comp. 16 (1962): least error bound",
)

KUTTA3 = shipped(
    "Kutta 3", 3, ((), (1 / 2,), (-1, 2)), (1 / 6, 2 / 3, 1 / 6), (0, 1 / 2, 1), "Kutta 1901"
)
HEUN3 = shipped(
    "Heun 3",
    3,
    ((), (1 / 3,), (0, 2 / 3)),
    (1 / 4, 0, 3 / 4),
    (0, 1 / 3, 2 / 3),
    "Heun 1900; HNW II.1, table 1.1",
)
RALSTON3 = shipped(
    "Ralston 3", 3, ((), (1 / 2,), (0, 3 / 4)), (2 / 9, 1 / 3, 4 / 9), (0, 1 / 2, 3 / 4),
    "Ralston, Math. Comp. 16 (1962): least error bound",
)  # fmt: skip
SSP3 = shipped(
    "SSP 3", 3, ((), (1,), (1 / 4, 1 / 4)), (1 / 6, 1 / 6, 2 / 3), (0, 1, 1 / 2),
    "Shu and Osher, J. Comput. Phys. 77 (1988): convex combinations of Euler steps",
)  # fmt: skip

RK4 = shipped(
    "classical", 4,
    ((), (1 / 2,), (0, 1 / 2), (0, 0, 1)),
    (1 / 6, 1 / 3, 1 / 3, 1 / 6),
    (0, 1 / 2, 1 / 2, 1),
    "Kutta 1901; HLW II.1, table 1.1",
)  # fmt: skip
KUTTA38 = shipped(
    "3/8 rule", 4,
    ((), (1 / 3,), (-1 / 3, 1), (1, -1, 1)),
    (1 / 8, 3 / 8, 3 / 8, 1 / 8),
    (0, 1 / 3, 2 / 3, 1),
    "Kutta 1901; HLW II.1, table 1.1",
)  # fmt: skip

BUTCHER6 = shipped(
    "Butcher 6", 6,
    (
        (),
        (1 / 3,),
        (0, 2 / 3),
        (1 / 12, 1 / 3, -1 / 12),
        (-1 / 16, 9 / 8, -3 / 16, -3 / 8),
        (0, 9 / 8, -3 / 8, -3 / 4, 1 / 2),
        (9 / 44, -9 / 11, 63 / 44, 18 / 11, 0, -16 / 11),
    ),
    (11 / 120, 0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120),
    (0, 1 / 3, 2 / 3, 1 / 3, 1 / 2, 1 / 2, 1),
    "Butcher, J. Austral. Math. Soc. 4 (1964)",
)  # fmt: skip
