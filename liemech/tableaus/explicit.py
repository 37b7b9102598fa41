"""Explicit Runge-Kutta methods without an error estimate, orders 1 to 6.

Sources: [HNW] Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed.; [HLW]
Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed.
"""

from __future__ import annotations

from .tableau import printed

EULER = printed("""
    Euler, order 1: Euler 1768; HLW I.1.2
    0 |
    b | 1
""")

MIDPOINT = printed("""
    midpoint, order 2: Runge 1895; HNW II.1
      0 |
    1/2 | 1/2
      b | 0 1
""")
HEUN2 = printed("""
    Heun 2, order 2: Heun 1900; HLW II.1.1
    0 |
    1 | 1
    b | 1/2 1/2
""")
RALSTON2 = printed("""
    Ralston 2, order 2: Ralston, Math. Comp. 16 (1962): least error bound
      0 |
    2/3 | 2/3
      b | 1/4 3/4
""")

KUTTA3 = printed("""
    Kutta 3, order 3: Kutta 1901
      0 |
    1/2 | 1/2
      1 | -1 2
      b | 1/6 2/3 1/6
""")
HEUN3 = printed("""
    Heun 3, order 3: Heun 1900; HNW II.1, table 1.1
      0 |
    1/3 | 1/3
    2/3 | 0 2/3
      b | 1/4 0 3/4
""")
RALSTON3 = printed("""
    Ralston 3, order 3: Ralston, Math. Comp. 16 (1962): least error bound
      0 |
    1/2 | 1/2
    3/4 | 0 3/4
      b | 2/9 1/3 4/9
""")
SSP3 = printed("""
    SSP 3, order 3: Shu and Osher, J. Comput. Phys. 77 (1988): convex combinations of Euler steps
      0 |
      1 | 1
    1/2 | 1/4 1/4
      b | 1/6 1/6 2/3
""")

RK4 = printed("""
    classical, order 4: Kutta 1901; HLW II.1, table 1.1
      0 |
    1/2 | 1/2
    1/2 | 0 1/2
      1 | 0 0 1
      b | 1/6 1/3 1/3 1/6
""")
KUTTA38 = printed("""
    3/8 rule, order 4: Kutta 1901; HLW II.1, table 1.1
      0 |
    1/3 | 1/3
    2/3 | -1/3 1
      1 | 1 -1 1
      b | 1/8 3/8 3/8 1/8
""")

BUTCHER6 = printed("""
    Butcher 6, order 6: Butcher, J. Austral. Math. Soc. 4 (1964)
      0 |
    1/3 | 1/3
    2/3 | 0 2/3
    1/3 | 1/12 1/3 -1/12
    1/2 | -1/16 9/8 -3/16 -3/8
    1/2 | 0 9/8 -3/8 -3/4 1/2
      1 | 9/44 -9/11 63/44 18/11 0 -16/11
      b | 11/120 0 27/40 27/40 -4/15 -4/15 11/120
""")
