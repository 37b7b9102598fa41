"""Carlson's symmetric elliptic integrals R_F and R_J as formulas: of numbers, of arrays, and in
native code.

Both are sums that the duplication theorem shortens: x, y, z (and p) move to (x + lam)/4, ...,
lam = sqrt(xy) + sqrt(yz) + sqrt(zx), which brings them together by a factor of 4 each time; then a
Taylor series about their mean takes over.  How many duplications it takes is found out once, for
the arguments that are farthest apart: then there are roots and arithmetic, and nothing else.

Source: Carlson, Numer. Algorithms 10 (1995) 13, algorithms of sections 2 and 3; DLMF 19.36.1 and
19.36.2.
"""

from __future__ import annotations

from ...formulas import horner, sqrt

CLOSE = 1e-2
"""With terms up to the degree 7 in the deviations from the mean, which are below this, the
remainder is below rounding.
"""

ARCTANGENT = (
    1.0,
    -0.33333333333333115,
    0.1999999999993953,
    -0.14285714279117775,
    0.11111110738335805,
    -0.09090896618937074,
    0.07692041920251542,
    -0.06662912646275077,
    0.058465901815892805,
    -0.05033789825619219,
    0.0379315408163702,
    -0.01776807748000551,
)
"""atan(r)/r as a polynomial in r^2 <= 0.172, to 2e-18.  Computed by docs/derivations/arctangent_polynomial.py."""


def elliprf(x: float, y: float, z: float) -> float:
    """R_F = (1/2) integral from 0 to infinity of dt/sqrt((t + x)(t + y)(t + z)).  x, y, z >= 0, at
    most one of them zero.
    """
    while True:
        mean = (x + y + z) / 3.0
        X, Y = 1.0 - x / mean, 1.0 - y / mean
        Z = -X - Y
        if max(abs(X), abs(Y), abs(Z)) < CLOSE:
            break
        a, b, c = sqrt(x), sqrt(y), sqrt(z)
        lam = a * b + b * c + c * a
        x, y, z = 0.25 * (x + lam), 0.25 * (y + lam), 0.25 * (z + lam)
    E2, E3 = X * Y - Z * Z, X * Y * Z
    series = 1.0 - E2 / 10.0 + E3 / 14.0 + E2 * E2 / 24.0 - 3.0 * E2 * E3 / 44.0
    series = series - 5.0 * (E2 * E2 * E2) / 208.0 + 3.0 * E3 * E3 / 104.0 + E2 * E2 * E3 / 16.0
    return series / sqrt(mean)


def duplications(x: float, y: float, z: float, p: float) -> float:
    """How many duplications R_J takes here, and wherever the arguments are closer to each other."""
    count = 0.0
    while True:
        mean = (x + y + z + 2.0 * p) / 5.0
        if max(abs(1.0 - x / mean), abs(1.0 - y / mean), abs(1.0 - z / mean), abs(1.0 - p / mean)) < CLOSE:
            return count
        a, b, c = sqrt(x), sqrt(y), sqrt(z)
        lam = a * b + b * c + c * a
        x, y, z, p = 0.25 * (x + lam), 0.25 * (y + lam), 0.25 * (z + lam), 0.25 * (p + lam)
        count = count + 1.0


def elliprj(x: float, y: float, z: float, p: float, count: float) -> float:
    """R_J = (3/2) integral from 0 to infinity of dt/((t + p) sqrt((t + x)(t + y)(t + z))), after
    `count` duplications.

    0 <= x, y <= z <= p <= 2 z, at most one of them zero: what the exact motion of a body asks for.
    """
    total, lost, weight, done = 0.0, 0.0, 1.0, 0.0
    while done < count:
        a, b, c, root = sqrt(x), sqrt(y), sqrt(z), sqrt(p)
        d = (root + a) * (root + b) * (root + c)
        w = ((p - x) * (p - y) * (p - z)) / (d * d)
        term = (weight / d) * horner(ARCTANGENT, w)
        longer = total + term
        lost = lost + (term - (longer - total))
        lam = a * b + b * c + c * a
        x, y, z, p = 0.25 * (x + lam), 0.25 * (y + lam), 0.25 * (z + lam), 0.25 * (p + lam)
        total, weight, done = longer, 0.25 * weight, done + 1.0
    mean = (x + y + z + 2.0 * p) / 5.0
    X, Y, Z = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean
    P = -0.5 * (X + Y + Z)
    E2 = X * Y + Y * Z + Z * X - 3.0 * P * P
    E3 = X * Y * Z + 2.0 * E2 * P + 4.0 * (P * P * P)
    E4 = (2.0 * X * Y * Z + E2 * P + 3.0 * (P * P * P)) * P
    E5 = X * Y * Z * P * P
    series = (
        (3.0 / 14.0) * E2 - (1.0 / 6.0) * E3 - (9.0 / 88.0) * (E2 * E2) + (3.0 / 22.0) * E4 + (9.0 / 52.0) * (E2 * E3)
    )
    series = (
        series - (3.0 / 26.0) * E5 + (1.0 / 16.0) * (E2 * E2 * E2) - (3.0 / 40.0) * (E3 * E3) - (3.0 / 20.0) * (E2 * E4)
    )
    series = series - (45.0 / 272.0) * (E2 * E2 * E3) + (9.0 / 68.0) * (E3 * E4 + E2 * E5)
    tail = (weight - weight * series) / (mean * sqrt(mean))
    return 6.0 * (total + lost) + tail
