"""Sizes of numbers and vectors beside rounding."""

from __future__ import annotations

from typing import Any

from ..large import sum_of
from ..vectors import Vec, vec
from .bases import InMemory
from .dual import size_of

EPSILON = 2.0**-52
"""The distance from 1 to the next double."""


def one_norm(x: Vec) -> float:
    """|x_1| + |x_2| + ..., derivatives included that the components carry."""
    total = size_of(x[0])
    for i in range(1, len(x)):
        total = total + size_of(x[i])
    return total


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
