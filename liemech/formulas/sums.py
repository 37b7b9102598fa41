"""Sums of products with constant coefficients, given by tables: what linear and bilinear maps of
large groups are made of.

A term is a coefficient and the indices of what it multiplies; the terms of a sum are added by
halves.  The compiler lets Python run these formulas as they stand, and makes loops over constant
tables of large ones; the bits are the same.
"""

from __future__ import annotations

from typing import Any

from .numbers.complex_numbers import Complex
from .vectors import Vec

Terms = tuple[tuple[Any, ...], ...]
"""A sum written out: of each term the coefficient, and the indices of what it multiplies."""


def total(items: list[Any]) -> Any:
    """The sum of a list, by halves: short chains of additions, small errors."""
    if len(items) == 1:
        return items[0]
    half = (len(items) + 1) // 2
    return total(items[:half]) + total(items[half:])


def halves(sums: list[Any]) -> Any:
    """The sum of a list of 2^n: of the first half and the second, number by number, and so on."""
    while len(sums) > 1:
        half = len(sums) // 2
        sums = [a + b for a, b in zip(sums[:half], sums[half:])]
    return sums[0]


def scaled(c: float, x: Any) -> Any:
    """c x without the multiplications by 1 and -1."""
    if c == 1.0:
        return x
    return -x if c == -1.0 else c * x


def linear(terms: Terms, v: Vec) -> Any:
    """The sum of c v_i over the terms (c, i)."""
    return total([scaled(c, v[i]) for c, i in terms]) if len(terms) else 0.0


def bilinear(terms: Terms, x: Vec, y: Vec) -> Any:
    """The sum of c x_i y_j over the terms (c, i, j)."""
    return total([scaled(c, x[i] * y[j]) for c, i, j in terms]) if len(terms) else 0.0


def antisymmetric(terms: Terms, x: Vec, y: Vec) -> Any:
    """The sum of c (x_i y_j - x_j y_i) over the terms (c, i, j)."""
    return total([scaled(c, x[i] * y[j] - x[j] * y[i]) for c, i, j in terms]) if len(terms) else 0.0


def entries(terms: Terms, m: Any) -> Any:
    """The sum of c times the real (0) or imaginary (1) part of m_ij over the terms (c, i, j, part)."""
    return total([scaled(c, _part(m[i, j], part)) for c, i, j, part in terms]) if len(terms) else 0.0


def bilinear_map(table: tuple[Terms, ...], x: Vec, y: Vec) -> Vec:
    """The vector of bilinear sums, one of each row of the table."""
    return Vec(*[bilinear(terms, x, y) for terms in table])


def antisymmetric_map(table: tuple[Terms, ...], x: Vec, y: Vec) -> Vec:
    """The vector of antisymmetric sums, one of each row of the table."""
    return Vec(*[antisymmetric(terms, x, y) for terms in table])


def abs2(x: Any) -> Any:
    """The squared absolute value |x|^2."""
    return x.re * x.re + x.im * x.im if isinstance(x, Complex) else x * x


def _part(x: Any, part: int) -> Any:
    if isinstance(x, Complex):
        return x.im if part else x.re
    return x
