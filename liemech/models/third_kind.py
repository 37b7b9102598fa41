"""Carlson's R_J for any arguments, on arrays: what integrals of the third kind need whose pole may be close to the path.

`carlson.elliprj` is the formula for native code, for arguments that do not lie far apart.

Source: Carlson, Numer. Algorithms 10 (1995) 13, algorithms of sections 2 and 3; DLMF 19.36(i).
"""

from __future__ import annotations

from typing import Any

import numpy as np

CLOSE = 1e-3
"""With terms up to the fifth degree in the deviations from the mean, which are below this, the remainder is below rounding."""


def elliprj(x: Any, y: Any, z: Any, p: Any) -> Any:
    """R_J(x, y, z, p) = (3/2) integral from 0 to infinity of dt/((t + p) sqrt((t + x)(t + y)(t + z))).

    x, y, z >= 0, at most one of them 0;  p > 0.  Arrays of one shape, or numbers.
    """
    x, y, z, p = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, z, p)))
    found, weight = np.zeros(x.shape), 1.0
    for _ in range(200):
        mean = (x + y + z + 2.0 * p) / 5.0
        X, Y, Z, P = (1.0 - v / mean for v in (x, y, z, p))
        if np.max([np.abs(v).max(initial=0.0) for v in (X, Y, Z, P)]) < CLOSE:
            break
        a, b, c = np.sqrt(x), np.sqrt(y), np.sqrt(z)
        lam = a * (b + c) + b * c
        found = found + weight * _elliprc((p * (a + b + c) + a * b * c) ** 2, p * (p + lam) ** 2)
        x, y, z, p, weight = 0.25 * (x + lam), 0.25 * (y + lam), 0.25 * (z + lam), 0.25 * (p + lam), 0.25 * weight
    P = -0.5 * (X + Y + Z)
    E2 = X * Y + Y * Z + Z * X - 3.0 * P * P
    E3 = X * Y * Z + 2.0 * E2 * P + 4.0 * P**3
    E4 = (2.0 * X * Y * Z + E2 * P + 3.0 * P**3) * P
    E5 = X * Y * Z * P * P
    series = 1.0 - 3.0 / 14.0 * E2 + E3 / 6.0 + 9.0 / 88.0 * E2 * E2 - 3.0 / 22.0 * E4 - 9.0 / 52.0 * E2 * E3 + 3.0 / 26.0 * E5
    return 3.0 * found + weight * series / (mean * np.sqrt(mean))


def _elliprc(x: Any, y: Any) -> Any:
    """R_C(x, y) = R_F(x, y, y), x >= 0, y > 0."""
    for _ in range(200):
        mean = (x + 2.0 * y) / 3.0
        s = (y - mean) / mean
        if np.abs(s).max(initial=0.0) < CLOSE:
            break
        lam = 2.0 * np.sqrt(x) * np.sqrt(y) + y
        x, y = 0.25 * (x + lam), 0.25 * (y + lam)
    return (1.0 + s * s * (0.3 + s * (1.0 / 7.0 + s * (0.375 + s * 9.0 / 22.0)))) / np.sqrt(mean)
