"""Carlson's symmetric elliptic integrals R_F and R_J for real arguments, vectorised; SciPy has them too, and 0.2 s of import.

Both are sums that the duplication theorem shortens: x, y, z (and p) move to (x + lam)/4, ..., lam = sqrt(xy) + sqrt(yz) + sqrt(zx),
which brings them together by a factor of 4 each time; then a Taylor series about their mean takes over.  Each element stops by
itself, so that its bits do not depend on its neighbours in an array.

Source: Carlson, Numer. Algorithms 10 (1995) 13, algorithms of sections 2 and 3; DLMF 19.36.1 and 19.36.2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# With terms up to the degree 7 in the deviations from the mean, which are below this, the remainder is below rounding.
_CLOSE = 1e-2


def elliprf(x: Any, y: Any, z: Any) -> np.ndarray:
    """R_F = (1/2) integral from 0 to infinity of dt/sqrt((t + x)(t + y)(t + z)).  x, y, z >= 0, at most one of them zero."""
    x, y, z = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, z)))
    while True:
        mean = (x + y + z) / 3.0
        X, Y = 1.0 - x / mean, 1.0 - y / mean
        Z = -X - Y
        apart = _apart(X, Y, Z)
        if not apart.any():
            break
        x, y, z = _duplicate(apart, x, y, z)
    E2, E3 = X * Y - Z * Z, X * Y * Z
    series = 1.0 - E2 / 10.0 + E3 / 14.0 + E2 * E2 / 24.0 - 3.0 * E2 * E3 / 44.0
    series = series - 5.0 * E2**3 / 208.0 + 3.0 * E3 * E3 / 104.0 + E2 * E2 * E3 / 16.0
    return series / np.sqrt(mean)


def elliprj(x: Any, y: Any, z: Any, p: Any) -> np.ndarray:
    """R_J = (3/2) integral from 0 to infinity of dt/((t + p) sqrt((t + x)(t + y)(t + z))).  0 <= x, y, z <= p, one zero at most."""
    x, y, z, p = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, z, p)))
    terms, weight = [], np.ones_like(x)
    while True:
        mean = (x + y + z + 2.0 * p) / 5.0
        X, Y, Z = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean
        P = -(X + Y + Z) / 2.0
        apart = _apart(X, Y, Z, P)
        if not apart.any():
            break
        root = np.sqrt(p)
        d = (root + np.sqrt(x)) * (root + np.sqrt(y)) * (root + np.sqrt(z))
        e = np.sqrt((p - x) * (p - y) * (p - z)) / d
        term = weight / d * np.where(e > 0.0, np.arctan(e) / np.where(e > 0.0, e, 1.0), 1.0)
        terms.append(np.where(apart, term, 0.0))
        weight = np.where(apart, 0.25 * weight, weight)
        x, y, z, p = _duplicate(apart, x, y, z, p)
    E2 = X * Y + Y * Z + Z * X - 3.0 * P * P
    E3 = X * Y * Z + 2.0 * E2 * P + 4.0 * P**3
    E4 = (2.0 * X * Y * Z + E2 * P + 3.0 * P**3) * P
    E5 = X * Y * Z * P * P
    series = 1.0 - 3.0 * E2 / 14.0 + E3 / 6.0 + 9.0 * E2 * E2 / 88.0 - 3.0 * E4 / 22.0 - 9.0 * E2 * E3 / 52.0 + 3.0 * E5 / 26.0
    series = series - E2**3 / 16.0 + 3.0 * E3 * E3 / 40.0 + 3.0 * E2 * E4 / 20.0 + 45.0 * E2 * E2 * E3 / 272.0
    series = series - 9.0 * (E3 * E4 + E2 * E5) / 68.0
    total = weight * series / (6.0 * mean * np.sqrt(mean))
    for term in reversed(terms):  # from the smallest on, for the least rounding
        total = total + term
    return 6.0 * total


def _apart(*deviations: Any) -> np.ndarray:
    """Where some deviation from the mean is still too large for the series."""
    return np.max(np.abs(deviations), axis=0) >= _CLOSE


def _duplicate(where: Any, x: Any, y: Any, z: Any, *p: Any) -> tuple[Any, ...]:
    a, b, c = np.sqrt(x), np.sqrt(y), np.sqrt(z)
    lam = a * b + b * c + c * a
    return tuple(np.where(where, (v + lam) / 4.0, v) for v in (x, y, z, *p))
