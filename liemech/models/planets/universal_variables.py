"""Kepler's equation in universal variables: one for ellipses, parabolas and hyperbolas.

    t = r_0 G_1 + e_0 G_2 + k G_3,   G_n = s^n c_n(b s^2),   b = 2 k/r_0 - |v|^2,   e_0 = q . v

r_0 is the distance at t = 0, c_n are Stumpff's functions.

Source: Danby, Fundamentals of Celestial Mechanics, 2nd ed., section 6.9; Conway, Celest. Mech. 39
(1986).
"""

from __future__ import annotations

from ...formulas import sqrt, where

LIMIT = 60
"""Iterations; a good start takes three to six."""
MOST = 520
"""Halvings of the root of the largest number there is."""


def solved(r0: float, e0: float, k: float, b: float, t: float, s: float) -> tuple[float, float, float, bool]:
    """G_1, G_2, G_3 at the time t, from a guess s, and whether the iteration has ended.

    Laguerre's iteration, for which the derivative of t by s is the distance r.  It ends when the
    next error, of third order in the correction, is below rounding; that correction is made to the
    G_n, by their series.

    Source: Conway, Celest. Mech. 39 (1986).
    """
    z, last, turns, searching = k - b * r0, float("inf"), 0, True
    G0 = G1 = G2 = G3 = d = 0.0
    while searching and turns <= LIMIT:
        G0, c1, c2, c3 = stumpff(b * (s * s))
        G1, G2, G3 = s * c1, s * s * c2, s * s * s * c3
        excess = s * (r0 * c1 + s * (e0 * c2 + s * (k * c3))) - t
        r = r0 * G0 + s * (e0 * c1 + s * (k * c2))
        bend, turn = e0 * G0 + z * G1, z * G0 - b * e0 * G1  # r', r''
        d = -5.0 * excess / (r + sqrt(abs(16.0 * r * r - 20.0 * excess * bend)))
        size, turns = abs(d), turns + 1
        next_error = size * size * size * (bend * bend + abs(r * turn))
        near = size <= 2.0**-18 * abs(s) and next_error <= 2.0**-54 * abs(s) * (r * r)
        searching = not near and (size < last or size > 2.0**-30 * abs(s))
        s, last = where(searching, s + d, s), size
    half = 0.5 * d
    return (G1 + d * (G0 - half * (b * G1)), G2 + d * (G1 + half * G0), G3 + d * (G2 + half * G1), turns <= LIMIT)


def stumpff(z: float) -> tuple[float, float, float, float]:
    """c_n(z) = sum (-z)^j/(n + 2j)!, n = 0, 1, 2, 3: the series of z/4^m, and quadruplings.

    Source: Danby, Fundamentals of Celestial Mechanics, 2nd ed., section 6.9.
    """
    halvings = 0
    while abs(z) > 0.1 and halvings < MOST:
        z, halvings = 0.25 * z, halvings + 1
    c3, c2 = 1.0, 1.0
    for j in range(6, 0, -1):
        c3 = 1.0 - c3 * (z * (1.0 / ((2.0 * j + 2.0) * (2.0 * j + 3.0))))
        c2 = 1.0 - c2 * (z * (1.0 / ((2.0 * j + 1.0) * (2.0 * j + 2.0))))
    c3, c2 = (1.0 / 6.0) * c3, 0.5 * c2
    c1, c0 = 1.0 - z * c3, 1.0 - z * c2
    while halvings > 0:
        c3, c2, z = 0.25 * (c2 + c0 * c3), 0.5 * (c1 * c1), 4.0 * z
        c1, c0 = c0 * c1, 1.0 - z * c2  # not 2 c_0^2 - 1, which quadruples the error
        halvings = halvings - 1
    return c0, c1, c2, c3
