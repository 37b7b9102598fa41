"""Sizes of numbers and vectors beside rounding."""

from __future__ import annotations

from typing import Any

from ..large import sum_of
from ..vectors import Mat, Vec, mat, vec
from .bases import InMemory
from .complex_numbers import Complex
from .dual import size_of

EPSILON = 2.0**-52
"""The distance from 1 to the next double."""


def magnitudes(x: Any) -> Any:
    """The absolute values of the numbers in a vector or matrix, derivatives included that they carry; what lies in
    memory carries none, and stays.  Sweeps have settled when these have: derivatives settle later than values, and
    a root of squares has none at zero.
    """
    if isinstance(x, InMemory):
        return x
    if isinstance(x, Mat):
        return mat(*[magnitudes(row) for row in x])
    return vec(*[Complex(size_of(c.re), size_of(c.im)) if isinstance(c, Complex) else size_of(c) for c in x])


def one_norm(x: Vec) -> float:
    """|x_1| + |x_2| + ..., derivatives included that the components carry."""
    return size_of(x)


def one_norms(x: Vec, blocks: tuple[int, ...]) -> Vec:
    """`one_norm` of each of the blocks into which the components fall, told by their lengths; of
    a vector in memory that of all of it.
    """
    if isinstance(x, InMemory):
        stored: Any = x
        return vec(*[sum_of(abs(stored)) for _ in blocks])
    norms: list[float] = []
    first = 0
    for n in blocks:
        norms = [*norms, one_norm(vec(*[x[first + i] for i in range(n)]))]
        first = first + n
    return vec(*norms)
