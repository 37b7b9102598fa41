"""Functions of small matrices, as formulas: exponential, logarithm, square root.

Entries are numbers, complex numbers or numbers that carry a derivative.  Sizes are measured by the
Frobenius norm.
"""

from __future__ import annotations

import math
from typing import Any

from ...formulas import Mat, mat, vec
from ...formulas.elimination import INFINITE, inverse
from ...formulas.large import Large, inner
from ...formulas.numbers.bases import InMemory
from ...formulas.numbers.double_double import DoubleDouble, is_long
from ...formulas.numbers.dual import value_of
from ...formulas.sums import abs2, total

TINY = 2.0**-112
"""(2^-56)^2: the square of what a sum of size one does not feel."""


def digits(size2: Any) -> tuple[float, Any]:
    """The bound in place of TINY beside numbers of this kind, and the 1 that fractions are made
    of.
    """
    return (TINY * TINY, DoubleDouble(1.0)) if is_long(value_of(size2)) else (TINY, 1.0)


LOST = 52.0
"""Doublings after which no digit of exp(x) would be left: nan instead."""


def frobenius2(m: Mat) -> float:
    """The sum of the squared absolute values of all entries."""
    if isinstance(m, Large):
        return inner(m, m)
    return total([abs2(x) for row in m for x in row])


def plus(m: Mat, s: float) -> Mat:
    """The matrix m + s 1, for a number s."""
    if isinstance(m, InMemory):
        return m.plus(s)
    return mat(*[vec(*[m[i, j] + s if i == j else m[i, j] for j in range(len(m))]) for i in range(len(m))])


def expm1(x: Mat) -> Mat:
    """exp(x) - 1, to rounding relative to x where x is small: cosh(x) - 1 + x (sinh(x)/x), both
    series in x^2, with x halved until its norm is at most 1, and exp(2x) - 1 = 2 E + E^2 with
    E = exp(x) - 1 thereafter.  Of matrices of many rows, where products cost more than all else, Pade's
    approximation in place of the series.  Norms above 2^52 give nan.

    x : (n, n).  Source: Higham, Functions of Matrices (2008), section 10.3 (scaling and squaring).
    """
    size2, halvings = frobenius2(x), 0.0
    by_pade = isinstance(x, Large) and len(x) >= MANY_ROWS
    largest = PADE_13 * PADE_13 if by_pade else 1.0
    while size2 > largest and halvings <= LOST:
        x = 0.5 * x
        size2, halvings = frobenius2(x), halvings + 1.0
    if halvings > LOST:
        x, halvings = x * (INFINITE - INFINITE), 0.0
    if by_pade:
        e = _pade(x, size2)
    else:
        e = _series_by_characteristic(x, size2) if len(x) == 3 else _series(x, size2)
    while halvings > 0.0:
        e = 2.0 * e + e @ e
        halvings = halvings - 1.0
    return e


PADE_7, PADE_13 = 0.9504178996162932, 5.371920351148152
"""Norms up to which Pade's approximations of these degrees are exp to rounding.

Source: Higham, Functions of Matrices (2008), table 10.2.
"""


MANY_ROWS = 48
"""From so many rows on Pade's approximation is faster: six products and an elimination, not eleven products.
Measured: RKMK4 on SO(32) 112 us by it and 110 by the series, SO(64) 640 and 740, SO(128) 4400 and 5600.
"""


def pade_coefficients(m: int) -> tuple[float, ...]:
    """b_0, ..., b_m of Pade's approximation p(x)/p(-x) of exp, p = sum b_j x^j, b_0 = 1.

    Source: Higham, Functions of Matrices (2008), equation (10.23).
    """
    f = math.factorial
    return tuple([f(2 * m - j) * f(m) / (f(2 * m) * f(m - j) * f(j)) for j in range(m + 1)])


SEVEN, THIRTEEN = pade_coefficients(7), pade_coefficients(13)


def _pade(x: Large, size2: float) -> Large:
    """exp(x) - 1 = 2 U (V - U)^-1 with p(x) = V + U, U its odd part, to rounding relative to x.

    x : of norm PADE_13 at most.  Source: Higham, Functions of Matrices (2008), algorithm 10.20.
    """
    square = x @ x
    fourth = square @ square
    sixth = fourth @ square
    b = THIRTEEN if size2 > PADE_7 * PADE_7 else (*SEVEN, *[0.0] * 6)
    odd = b[7] * sixth + b[5] * fourth + b[3] * square
    even = b[6] * sixth + b[4] * fourth + b[2] * square
    if size2 > PADE_7 * PADE_7:
        odd = odd + sixth @ (b[13] * sixth + b[11] * fourth + b[9] * square)
        even = even + sixth @ (b[12] * sixth + b[10] * fourth + b[8] * square)
    u = x @ odd.plus(b[1])
    return (2.0 * u).over((even - u).plus(1.0))


def _series(x: Mat, size2: float) -> Mat:
    """x + x^2/2 + x^3/6 + ..., as cosh(x) - 1 + x (sinh(x)/x), for a matrix of norm 1 at most."""
    tiny, unit = digits(size2)
    square = x @ x
    term = 0.5 * square
    even, odd = term, (unit / 3.0) * term
    bound, k = 0.5 * size2, 2.0
    while bound * bound > tiny * size2 and k < 64.0:
        bound = bound * (size2 / ((k + 1.0) * (k + 2.0)))
        term = (unit / ((k + 1.0) * (k + 2.0))) * (term @ square)
        k = k + 2.0
        even, odd = even + term, odd + (unit / (k + 1.0)) * term
    return x + (even + x @ odd)


def _series_by_characteristic(x: Mat, size2: float) -> Mat:
    """exp(x) - 1 of a 3 by 3 matrix: with x^3 = s x^2 + t x + d every power is a x^2 + b x + c, and only
    numbers are summed.

    Source: the theorem of Cayley and Hamilton; Gantmacher, The Theory of Matrices, volume 1,
    chapter 4.
    """
    tiny, unit = digits(size2)
    square = x @ x
    s = x[0, 0] + x[1, 1] + x[2, 2]
    t = 0.5 * (square[0, 0] + square[1, 1] + square[2, 2] - s * s)
    d = _determinant3(x)
    b = c = 0.0 * (s + t + d)
    a = 0.5 + b
    of_square, of_x, of_one = a, b, c
    bound, k = 0.25 * size2 * size2, 2.0
    while bound > tiny * size2 and k < 64.0:
        k = k + 1.0
        part = unit / k
        a, b, c = part * (s * a + b), part * (t * a + c), part * (d * a)
        of_square, of_x, of_one, bound = (of_square + a, of_x + b, of_one + c, bound * (size2 * (part * part)))
    return x + plus(square * of_square + x * of_x, of_one)


def _determinant3(m: Mat) -> Any:
    minors = (
        m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1],
        m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2],
        m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0],
    )
    return m[0, 0] * minors[0] + m[0, 1] * minors[1] + m[0, 2] * minors[2]


def expm(x: Mat) -> Mat:
    """exp(x).  x : (n, n).  Source: Higham, Functions of Matrices (2008), chapter 10."""
    return plus(expm1(x), 1.0)


def phi1m(a: Mat) -> Mat:
    """(exp(a) - 1)/a = 1 + a/2 + a^2/6 + ..., for large a from its half.  a : (n, n).

    phi_1(2a) = phi_1(a) + E phi_1(a)/2 and exp(2a) - 1 = 2 E + E^2, with E = exp(a) - 1.
    Source: Higham, Functions of Matrices (2008), section 10.7.4.
    """
    size2, halvings = frobenius2(a), 0.0
    while size2 > 1.0 and halvings <= LOST:
        a = 0.5 * a
        size2, halvings = frobenius2(a), halvings + 1.0
    if halvings > LOST:
        a, halvings = a * (INFINITE - INFINITE), 0.0
    tiny, unit = digits(size2)
    term, k, bound = 0.5 * a, 2.0, 0.25 * size2
    phi = plus(term, 1.0)
    while bound > tiny and k < 64.0:
        k = k + 1.0
        term, bound = (unit / k) * (term @ a), bound * (size2 / (k * k))
        phi = phi + term
    e = a @ phi
    while halvings > 0.0:
        phi = phi + 0.5 * (e @ phi)
        e, halvings = 2.0 * e + e @ e, halvings - 1.0
    return phi


def sqrtm(a: Mat) -> Mat:
    """The principal square root, by the product form of Denman and Beavers' iteration; inf or nan
    if there is none.

    M' = (2 + M + M^-1)/4,  Y' = Y (1 + M^-1)/2,  from M = Y = a;  M -> 1, Y -> a^1/2.  a : (n, n).
    Source: Higham, Functions of Matrices (2008), equation (6.29).
    """
    m, y, turns = a, a, 0.0
    error2 = frobenius2(plus(m, -1.0))
    enough = 1e-33 if is_long(value_of(error2)) else 1e-18  # the last line squares the error
    while error2 > enough and turns < 60.0:
        back = inverse(m)
        y = 0.5 * (y + y @ back)
        m = plus(0.25 * (m + back), 0.5)
        error2, turns = frobenius2(plus(m, -1.0)), turns + 1.0
    return 0.5 * (y @ plus(-m, 3.0))


def logm(a: Mat) -> Mat:
    """The principal logarithm, by square roots and log y = 2 atanh((y - 1)(y + 1)^-1); inf or nan
    if there is none.

    a : (n, n).  Source: Higham, Functions of Matrices (2008), chapter 11 (inverse scaling and
    squaring).
    """
    y, roots, scale = a, 0.0, 2.0
    size2 = frobenius2(plus(y, -1.0))
    while size2 > 0.25 and roots < 40.0:
        y = sqrtm(y)
        size2, roots, scale = frobenius2(plus(y, -1.0)), roots + 1.0, 2.0 * scale
    return scale * atanhm(plus(y, -1.0) @ inverse(plus(y, 1.0)))


def log1pm(x: Mat) -> Mat:
    """log(1 + x) for a small matrix, to rounding relative to x.  x : (n, n), of norm below 1/2."""
    return 2.0 * atanhm(x @ inverse(plus(x, 2.0)))


def atanhm(z: Mat) -> Mat:
    """The series z + z^3/3 + z^5/5 + ..., for norms well below 1.  z : (n, n)."""
    square = z @ z
    size2 = frobenius2(z)
    tiny, unit = digits(size2)
    power, sum_, k, bound = z, z, 1.0, 1.0
    while bound * bound > tiny and k < 200.0:
        power = power @ square
        k, bound = k + 2.0, bound * size2
        sum_ = sum_ + (unit / k) * power
    return sum_
