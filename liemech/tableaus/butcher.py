"""Butcher tableaus: the coefficients of Runge-Kutta methods, with a name, a source and a self-check."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable

from ..errors import LawViolation
from ..native import Record, record

Row = tuple[float, ...]

# The order conditions: sum_i b_i phi_i = 1/gamma for every rooted tree.  A tree is the tuple of its branches.
_LEAF: tuple = ()


@record
class ButcherTableau(Record):
    """Coefficients of an explicit Runge-Kutta method, c | A over b.

    Building one checks it: shapes, c_i = sum_j a_ij, and the order conditions of all rooted trees up to `order`.
    Raises LawViolation with the condition that fails.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.1 and III.1.
    """

    name: str
    order: int
    A: tuple[Row, ...]
    b: Row
    c: Row
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "A", tuple(tuple(map(float, row)) for row in self.A))
        object.__setattr__(self, "b", tuple(map(float, self.b)))
        object.__setattr__(self, "c", tuple(map(float, self.c)))
        s = self.stages
        if len(self.A) != s or len(self.c) != s or any(len(row) != i for i, row in enumerate(self.A)):
            raise LawViolation(f"{self.name}: {s} weights need A with rows of 0, 1, ..., {s - 1} entries and {s} nodes")
        for i, row in enumerate(self.A):
            if not _agree(row, self.c[i]):
                raise LawViolation(f"{self.name}: row {i + 1} of A sums to {sum(row)}, but c is {self.c[i]}")
        for tree in _trees(self.order):
            terms = [w * f for w, f in zip(self.b, self._elementary_weights(tree), strict=True)]
            if not _agree(terms, 1.0 / _density(tree)):
                raise LawViolation(
                    f"{self.name} is not of order {self.order}: the tree {tree} gives {math.fsum(terms)}, not 1/{_density(tree)}"
                )

    @property
    def explicit(self) -> bool:
        """Does every stage need earlier ones only?"""
        return all(not any(row[i:]) for i, row in enumerate(self.A))

    @property
    def stages(self) -> int:
        """How many slopes a step evaluates."""
        return len(self.b)

    def _elementary_weights(self, tree: tuple) -> list[float]:
        """phi_i(tree) = prod over branches of sum_j a_ij phi_j(branch)."""
        phi = [1.0] * self.stages
        for branch in tree:
            inner = self._elementary_weights(branch)
            for i, row in enumerate(self.A):
                phi[i] *= sum(a * f for a, f in zip(row, inner, strict=False))
        return phi

    def __repr__(self) -> str:
        return f"ButcherTableau({self.name}: order {self.order}, {self.stages} stages)"


def _agree(terms: Iterable[float], wanted: float) -> bool:
    """Is the sum what is wanted, up to the rounding of terms of this size?"""
    terms = list(terms)
    return abs(math.fsum(terms) - wanted) <= 64 * sys.float_info.epsilon * (abs(wanted) + math.fsum(map(abs, terms)))


def _trees(order: int) -> list[tuple]:
    """All rooted trees with at most this many nodes."""
    by_size: dict[int, list[tuple]] = {1: [_LEAF]}
    for n in range(2, order + 1):
        found: set[tuple] = set()
        for k in range(1, n):
            for smaller in by_size[n - k]:
                found |= {tuple(sorted((*smaller, branch))) for branch in by_size[k]}
        by_size[n] = sorted(found)
    return [tree for n in range(1, order + 1) for tree in by_size[n]]


def _size(tree: tuple) -> int:
    return 1 + sum(map(_size, tree))


def _density(tree: tuple) -> int:
    """gamma(tree): the number of nodes times the densities of the branches."""
    return _size(tree) * math.prod(map(_density, tree))


EULER = ButcherTableau("Euler", 1, ((),), (1.0,), (0.0,), "Euler 1768")
MIDPOINT = ButcherTableau("midpoint", 2, ((), (0.5,)), (0.0, 1.0), (0.0, 0.5), "Runge 1895")
KUTTA3 = ButcherTableau("Kutta 3", 3, ((), (0.5,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6), (0.0, 0.5, 1.0), "Kutta 1901")
RK4 = ButcherTableau(
    "classical",
    4,
    ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    (1 / 6, 1 / 3, 1 / 3, 1 / 6),
    (0.0, 0.5, 0.5, 1.0),
    "Kutta 1901; Hairer, Lubich, Wanner, II.1, table 1.1",
)

BY_ORDER = {tableau.order: tableau for tableau in (EULER, MIDPOINT, KUTTA3, RK4)}
"""The method that `RKMK(order=...)` stands for."""
