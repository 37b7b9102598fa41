"""Linear equations of small matrices, by elimination: formulas like any other."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidType
from .functions import where
from .numbers.bases import InMemory
from .numbers.complex_numbers import Complex
from .numbers.conversions import plain
from .numbers.double_double import DoubleDouble, is_long
from .numbers.dual import constant, value_of
from .sums import abs2
from .vectors import Mat, Vec, cross, dot, mat, vec

INFINITE = float("inf")

DEPENDENT = 1e-12
"""A pivot below this part of its diagonal entry says that an equation follows from those before it."""

_SEQUENCES = (tuple, list, np.ndarray)


def solve(m: Mat, rhs: Any) -> Any:
    """The solution x of m x = rhs by Gaussian elimination with partial pivoting; a singular matrix
    is a division by zero, or gives inf or nan if the right side is a matrix.

    m : (n, n), rhs : (n,), or (n, k) for k right sides.  Raises InvalidType if m is not square or
    rhs has another length.
    """
    n = _square("solve", m, rhs)
    if not isinstance(rhs, Vec) and n and isinstance(rhs[0], _SEQUENCES):
        return solve_matrix(m, rhs)
    rows = _of_one_kind([vec(*m[i], rhs[i]) for i in range(n)])
    for k in range(n):
        # a compare-and-swap network brings the largest entry of the column to row k
        for i in range(k + 1, n):
            larger = abs(rows[i][k]) > abs(rows[k][k])
            rows[k], rows[i] = _exchange(larger, rows[k], rows[i])
        for i in range(k + 1, n):
            rows[i] = rows[i] - (rows[i][k] / rows[k][k]) * rows[k]
    x = [0.0] * n
    for k in range(n - 1, -1, -1):
        remainder = rows[k][n]
        for j in range(k + 1, n):
            remainder = remainder - rows[k][j] * x[j]
        x[k] = remainder / rows[k][k]
    return vec(*x)


def _of_one_kind(rows: list[Vec]) -> list[Vec]:
    """The rows in numbers that round alike, as they may change places: of two doubles if one is,
    and without what they remember of rounding.
    """
    if any(is_long(value_of(x)) for row in rows for x in row):
        return [vec(*[x if is_long(value_of(x)) else DoubleDouble(1.0) * x for x in row]) for row in rows]
    return [plain(row) for row in rows]


def _exchange(condition: Any, a: Vec, b: Vec) -> tuple[Vec, Vec]:
    """(b, a) where the condition holds, else (a, b): a choice number by number, which power series know too."""
    above = vec(*[where(condition, y, x) for x, y in zip(a, b)])
    return above, vec(*[where(condition, x, y) for x, y in zip(a, b)])


def solve3(m: Mat, rhs: Any) -> Vec:
    """The solution of a 3 by 3 system by Cramer's rule: one division, no branch; for
    well-conditioned Newton steps.

    x_i = det(m with column i replaced by rhs) / det m.  Raises InvalidType if m is not of three
    columns of length 3.
    """
    if len(m) != 3 or _columns("solve3", m) != 3:
        raise InvalidType(f"solve3: a matrix of {len(m)} rows and {len(m[0])} columns")
    a, b, c = m.T
    bc = cross(b, c)
    scale = 1.0 / dot(a, bc)
    return vec(scale * dot(rhs, bc), scale * dot(rhs, cross(c, a)), scale * dot(rhs, cross(a, b)))


def solve_matrix(m: Mat, rhs: Mat) -> Mat:
    """The solution X of m X = rhs by Gaussian elimination with partial pivoting; a singular matrix
    gives inf or nan.

    m : (n, n), rhs : (n, k).  Raises InvalidType if m is not square or rhs has another length.
    """
    if isinstance(m, InMemory):
        stored: Any = m, rhs
        return stored[1].T.over(stored[0].T).T
    n = _square("solve", m, rhs)
    rows = _of_one_kind([vec(*m[i], *rhs[i]) for i in range(n)])
    for k in range(n):
        # a compare-and-swap network brings the largest entry of the column to row k
        for i in range(k + 1, n):
            rows[k], rows[i] = _exchange(_size(rows[i][k]) > _size(rows[k][k]), rows[k], rows[i])
        head = _reciprocal(rows[k][k])
        rows[k] = vec(*[x * head for x in rows[k]])
        for i in range(n):
            if i != k:
                rows[i] = rows[i] - rows[k] * rows[i][k]
    return mat(*[row[n:] for row in rows])


def _square(what: str, m: Mat, rhs: Any) -> int:
    """n, of a matrix (n, n) and a right side of length n."""
    n = len(m)
    columns = _columns(what, m)
    if columns != n or len(rhs) != n:
        side = "" if rhs is m else f", and a right side of {len(rhs)}"
        raise InvalidType(f"{what}: a matrix of {n} rows and {columns} columns{side}")
    return n


def _columns(what: str, m: Any) -> int:
    """The number of columns of a matrix."""
    if not isinstance(m[0], _SEQUENCES):
        raise InvalidType(f"{what}: of a matrix; got a vector of {len(m)} components")
    return len(m[0])


def _size(x: Any) -> Any:
    """The size by which pivots are compared: |x|, or |re x| + |im x|."""
    return abs(x.re) + abs(x.im) if isinstance(x, Complex) else abs(x)


def _reciprocal(x: Any) -> Any:
    """The reciprocal 1/x, infinite for zero."""
    if isinstance(x, Complex):
        return x.conjugate() * _reciprocal(abs2(x))
    nonzero = constant(x) != 0.0
    return where(nonzero, 1.0 / where(nonzero, x, 1.0), INFINITE + 0.0 * x)


def unit(m: Mat) -> Mat:
    """The unit matrix of the shape of m, its entries of the kind of m's."""
    zero = 0.0 if isinstance(m[0, 0], float) else 0.0 * m[0, 0]
    return mat(*[vec(*[zero + 1.0 if i == j else zero for j in range(len(m))]) for i in range(len(m))])


def inverse(m: Mat) -> Mat:
    """The inverse of a matrix; a singular one gives inf or nan.

    m : (n, n).  Raises InvalidType if it is not square.
    """
    if isinstance(m, InMemory):
        stored: Any = m
        return (0.0 * stored).plus(1.0).over(stored)
    _square("inverse", m, m)
    return solve_matrix(m, unit(m))


def determinant(m: Mat) -> Any:
    """The determinant, by elimination with partial pivoting.

    m : (n, n).  Raises InvalidType if it is not square.
    """
    if isinstance(m, InMemory):
        return m.determinant()
    n = _square("determinant", m, m)
    rows, product = _of_one_kind([*m]), 1.0
    for k in range(n):
        for i in range(k + 1, n):
            larger = _size(rows[i][k]) > _size(rows[k][k])
            rows[k], rows[i] = _exchange(larger, rows[k], rows[i])
            product = where(larger, -product, product)
        pivot = rows[k][k]
        product = product * pivot
        # below zero there is nothing to eliminate
        head = _reciprocal(where(_size(pivot) > 0.0, pivot, pivot + 1.0))
        for i in range(k + 1, n):
            rows[i] = rows[i] - rows[k] * (rows[i][k] * head)
    return product


def triangular(rows: list[Vec]) -> tuple[list[Vec], list[Any]]:
    """Rows of equations, (n, n + k), each without the unknowns of those before it, and the pivots: without exchange, as
    matrices allow whose symmetric part is positive.  A pivot that is zero is not divided by.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., sections 3.2 and 4.1.
    """
    for k in range(len(rows)):
        share = 1.0 / rows[k][k] if rows[k][k] != 0.0 else 1.0
        rows = [row if i <= k else row - (share * row[k]) * rows[k] for i, row in enumerate(rows)]
    return rows, [row[k] for k, row in enumerate(rows)]


def keep_sign(pivots: Any, sign: float) -> bool:
    """Whether a determinant, by its pivots, has the sign of that of `sign` times a positive matrix."""
    factor = 1.0
    for pivot in pivots:
        factor = where(sign * pivot > 0.0, factor, -factor)
    return factor > 0.0


def inverted(m: Mat, before: Vec, sign: float) -> tuple[Mat, float, bool]:
    """m^-1, by cofactors of three rows at a time; 1 if its determinant has the sign of that of `sign` times a positive
    matrix, else -1; and whether all pivots are above DEPENDENT times their former values.
    """
    n = len(m)
    if n > 3:
        A, B, C, D = quarters(m)
        first, sign_kept, independent = inverted(A, before[:3], sign)
        left, right = C @ first, first @ B
        last, turned, rest_independent = inverted(D - C @ right, before[3:], sign)
        corner = right @ last
        whole = of_quarters(first + corner @ left, -corner, -(last @ left), last)
        return whole, sign_kept * turned, independent and rest_independent
    minors, cofactors = of_three(m)
    independent = abs(m[0][0]) > DEPENDENT * before[0]
    for k in range(1, n):
        independent = independent and abs(minors[k]) > DEPENDENT * before[k] * abs(minors[k - 1])
    det = minors[n - 1]
    sign_kept = where((sign * det if n % 2 == 1 else det) > 0.0, 1.0, -1.0)
    return mat(*[(1.0 / det) * row for row in cofactors]), sign_kept, independent


def of_three(m: Mat) -> tuple[list[float], list[Vec]]:
    """The leading minors of up to three rows, and the transposed cofactors."""
    if len(m) == 1:
        return [m[0][0]], [vec(1.0)]
    (a, b), (d, e) = m[0][:2], m[1][:2]
    minor = a * e - b * d
    if len(m) == 2:
        return [a, minor], [vec(e, -b), vec(-d, a)]
    c, f, (g, h, i) = m[0][2], m[1][2], m[2]
    x, y, z = e * i - f * h, f * g - d * i, d * h - e * g
    rows = vec(x, c * h - b * i, b * f - c * e), vec(y, a * i - c * g, c * d - a * f)
    return [a, minor, a * x + b * y + c * z], [*rows, vec(z, b * g - a * h, minor)]


def quarters(m: Mat) -> tuple[Mat, Mat, Mat, Mat]:
    """The blocks A, B, C, D of [[A, B], [C, D]], of which A is of three rows and columns."""
    return (
        mat(*[row[:3] for row in m[:3]]), mat(*[row[3:] for row in m[:3]]),
        mat(*[row[:3] for row in m[3:]]), mat(*[row[3:] for row in m[3:]]),
    )  # fmt: skip


def of_quarters(A: Mat, B: Mat, C: Mat, D: Mat) -> Mat:
    """The matrix [[A, B], [C, D]] of four blocks."""
    return mat(*[vec(*a, *b) for a, b in zip(A, B)], *[vec(*c, *d) for c, d in zip(C, D)])
