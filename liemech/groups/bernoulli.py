"""The Bernoulli numbers, as the series of dexp^-1 needs them."""

from __future__ import annotations

BERNOULLI = (
    1.0,
    -1 / 2,
    1 / 12,
    0.0,
    -1 / 720,
    0.0,
    1 / 30240,
    0.0,
    -1 / 1209600,
    0.0,
    1 / 47900160,
    0.0,
    -691 / 1307674368000,
    0.0,
    1 / 74724249600,
    0.0,
    -3617 / 10670622842880000,
    0.0,
    43867 / 5109094217170944000,
    0.0,
    -174611 / 802857662698291200000,
)
"""B_k/k!, k = 0, 1, 2, ... (B_1 = -1/2): the series of z/(e^z - 1).

Source: Abramowitz and Stegun, table 23.2; Hairer, Lubich, Wanner, Geometric Numerical Integration,
2nd ed., III.4, equation (4.4).
"""

TERMS = 12
"""The highest power of ad in a truncated series of dexp^-1: enough for order 14."""
