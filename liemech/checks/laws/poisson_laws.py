"""The laws of a Poisson structure: skew symmetry, the identity of Jacobi, Leibniz' rule, Casimirs,
the rank.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...errors import require
from ...formulas import Vec, derivative, dot, gradient, jacobian
from ...groups.matrices.skew_matrices import like_sizes
from ...groups.poisson_structure import PoissonStructure, jacobi_sums
from ..points.poisson_points import AtPoint, given_points, own_formulas, random_points
from ..points.sample_points import flat
from ..points.sample_states import SIZES, components, named
from ..points.seeds import generator
from ..report import Report, finished
from .casimir_laws import INDEPENDENCE, independence
from .law import Law, Same, Told, axiom, shaped, verdicts

CLOSE = 256.0
"""Roundings per dimension of entries and their derivatives."""

POISSON: list[Law] = []


@dataclass(frozen=True)
class AtStructure(AtPoint):
    """A point, the rank that the structure has almost everywhere, and how far the coordinates of
    all points reach, (n,).
    """

    generic: int
    reach: np.ndarray
    others: tuple[Vec, ...]  # all the points, with this one

    @cached_property
    def terms(self) -> np.ndarray:
        """The sizes to which rounding of B(y) is relative, entry by entry, so that units do not
        matter: the terms of an entry, and the largest entry in units in which rows are of like
        size, or those of the points.
        """
        terms = self.B.terms(self.y)
        terms = np.maximum(terms, terms.T)
        floors = []
        for units in (1.0 / like_sizes(terms), self.reach):
            whole = np.outer(units, units)
            if whole.all():
                floors.append((terms / whole).max() * whole)
        return terms + np.minimum.reduce(floors)

    @cached_property
    def terms_of_slopes(self) -> np.ndarray:
        """The sizes to which rounding of d_l b_ij is relative, with l first: where it is not zero,
        b_ij over the reach of y_l.
        """
        with np.errstate(all="ignore"):
            along = self.terms / self.reach[:, None, None]
        slopes = np.abs(self.slopes)
        return slopes + np.where((slopes > 0.0) & np.isfinite(along), along, 0.0)

    def duration(self, index: int) -> float:
        """A time in which the motion of a coordinate changes others by up to a quarter."""
        moved, reach = self.reach > 0.0, self.reach
        rates = np.abs(self.matrix[moved, index]) / reach[moved]
        bends = np.abs(self.slopes[:, moved, index]) * reach[:, None] / reach[moved]
        fastest = max(rates.max(initial=0.0), bends.max(initial=0.0))
        return 0.25 / fastest if fastest > 0.0 else 0.25


def entry(left: Any, right: Any, size: float, entries: str) -> Told:
    """A comparison about certain entries of the matrix, which a report names."""
    return Told(left, right, size, told=f"a slip in {entries}")


@axiom(POISSON, "matrix", "B(y) is an n by n matrix of finite numbers")
def matrix(B: Any, at: AtStructure) -> Iterator[Same]:
    yield from shaped(at.matrix, (at.dim, at.dim))


@axiom(POISSON, "skew symmetry", "b_ij = -b_ji")
def skew_symmetry(B: Any, at: AtStructure) -> Iterator[Same]:
    b, terms = at.matrix, at.terms
    for i, j in itertools.combinations_with_replacement(range(at.dim), 2):
        at_fault = f"b_{i + 1},{j + 1} = {b[i, j]:.3g} or b_{j + 1},{i + 1} = {b[j, i]:.3g}"
        yield entry(b[i, j], -b[j, i], float(terms[i, j]), at_fault)


@axiom(
    POISSON, "Jacobi identity", "sum_l (d_l b_ij b_lk + d_l b_jk b_li + d_l b_ki b_lj) = 0 for i < j < k", slack=CLOSE
)
def jacobi(B: Any, at: AtStructure) -> Iterator[Same]:
    total, terms = jacobi_sums(at.slopes, at.matrix), jacobi_sums(at.terms_of_slopes, at.terms)
    for i, j, k in itertools.combinations(range(at.dim), 3):
        at_fault = f"b_{i + 1},{j + 1}, b_{j + 1},{k + 1}, b_{k + 1},{i + 1}, or what these are multiplied by"
        yield entry(total[i, j, k], 0.0, terms[i, j, k], at_fault)


@axiom(POISSON, "closed product", "sharp(y, a) = B(y) a", "sharp", slack=CLOSE)
def closed_product(B: Any, at: AtStructure) -> Iterator[Same]:
    for j, unit in enumerate(np.eye(at.dim)):
        column = flat(B.sharp(at.y, Vec.of(unit.tolist())))
        yield from _entries(column, at.matrix[:, j], at.terms[:, j], f"the component a_{j + 1}")


@axiom(POISSON, "Leibniz' rule", "{F G, H} = F {G, H} + G {F, H}", slack=CLOSE)
def leibniz(B: Any, at: AtStructure) -> Iterator[Same]:
    F, G, H = (_polynomial(at.dim, k) for k in range(3))
    f, g = float(F(at.y)), float(G(at.y))
    first, second = float(B.bracket(G, H)(at.y)), float(B.bracket(F, H)(at.y))
    whole = float(B.bracket(lambda y: F(y) * G(y), H)(at.y))
    a, b, c = (np.abs(flat(gradient(x, at.y))) for x in (F, G, H))
    terms = (abs(f) * b + abs(g) * a) @ at.terms @ c
    yield Same(whole, f * first + g * second, float(terms))


@axiom(POISSON, "Casimirs", "B dC = 0", "casimirs", slack=CLOSE)
def casimirs(B: Any, at: AtStructure) -> Iterator[Same]:
    y, n = np.abs(flat(at.y)), at.dim
    for i, _ in enumerate(flat(B.casimirs(at.y))):

        def slope(x: Vec, i: int = i) -> Any:
            return gradient(lambda z: B.casimirs(z)[i], x)

        row = flat(slope(at.y))
        sizes = np.abs(row) + np.abs(flat(jacobian(slope, at.y)).reshape(n, n)) @ y
        yield from _entries(at.matrix @ row, np.zeros(n), at.terms @ sizes, f"Casimir {i + 1}")


@axiom(POISSON, *INDEPENDENCE, "casimirs", once=True)
def independent_casimirs(B: Any, at: AtStructure) -> Iterator[Same]:
    def slopes(y: Any) -> np.ndarray:
        return np.array(jacobian(lambda x: B.casimirs(x), y), dtype=float).reshape(-1, at.dim)

    yield independence(B.casimirs, slopes, at.others)


@axiom(
    POISSON, "motion of coordinates", "d/ds coordinate_flow(y, i, s) = B e_i, at two s", "coordinate_flow", slack=CLOSE
)
def coordinate_flow(B: Any, at: AtStructure) -> Iterator[Same]:
    y, n = np.abs(flat(at.y)), at.dim
    for i in range(n):
        for s in (0.0, at.duration(i)):

            def rate(x: Vec, i: int = i, s: float = s) -> Any:
                return derivative(partial(B.coordinate_flow, x, i), s)

            point, speed = B.coordinate_flow(at.y, i, s), flat(rate(at.y))
            terms = B.terms(point)[:, i] + np.abs(speed)
            terms = terms + np.abs(flat(jacobian(rate, at.y)).reshape(n, n)) @ y
            b = np.array(B.matrix(point), dtype=float)
            yield from _entries(speed, b[:, i], terms, f"the motion of y_{i + 1}")


def _entries(left: np.ndarray, right: np.ndarray, sizes: np.ndarray, entries: str) -> Iterator[Told]:
    """Components, each with the size of its rounding."""
    for a, b, size in zip(left, right, sizes, strict=True):
        yield entry(a, b, float(size), entries)


@axiom(POISSON, "rank", "B has one rank almost everywhere, even, the one named; Casimirs are no more than what is left")
def rank(B: Any, at: AtStructure) -> Iterator[Same]:
    rank_here = B.rank_at(at.y)
    yield entry(rank_here, at.generic, 1.0, f"the point: B has rank {rank_here} here, {at.generic} elsewhere")
    yield entry(rank_here % 2, 0, 1.0, "the skew symmetry")
    if B.rank is not None:
        yield entry(B.rank, at.generic, 1.0, f"`rank`, which is {B.rank}")
    number = len(flat(B.casimirs(at.y)))
    yield entry(max(number, at.dim - at.generic), at.dim - at.generic, 1.0, f"`casimirs`, which are {number}")


def _polynomial(n: int, seed: int) -> Any:
    """A quadratic function of nothing special."""
    rng = np.random.default_rng(seed + 10)
    a, b = Vec.of(rng.normal(size=n).tolist()), Vec.of(rng.normal(size=n).tolist())
    return lambda y: dot(a, y) + dot(b, y) * dot(a, y) + y[seed % n] ** 2


def check_poisson(structure: PoissonStructure, points: Any = None, *, raises: bool = True, seed: int = 0) -> Report:
    """Does a matrix B(y) make a Poisson bracket, and do the closed forms of its class belong to it?

    Checked are skew symmetry, the identity of Jacobi for all i < j < k, Leibniz' rule, Casimirs,
    `sharp`, `coordinate_flow`, and that the rank is the same at all points.

    points : (m, n), where to look; left out, random points of several sizes, with positive
    coordinates if B or the Casimirs need them. raises : False returns the report on a broken
    structure as well.  seed : of the random points.

    Returns a Report, which prints as a table.  Raises LawViolation: the first law broken, the
    entries, where and by how much.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.2; the slides,
    (2.9) and (2.10).
    """
    require("check_poisson: structure", structure, PoissonStructure)
    where = _places(structure, points, seed)
    return finished(repr(structure), verdicts(POISSON, structure, where, own_formulas(structure)), raises)


def _places(structure: PoissonStructure, points: Any, seed: int) -> list[AtStructure]:
    me, n = "check_poisson", structure.dim
    if points is not None:
        named_points = given_points(me, n, points)
    else:
        rng = generator(me, seed)
        drawn: list[np.ndarray] = []
        for large in SIZES:  # a negative one is the mirror image of the point before
            drawn.append(components(rng, n, large) if large > 0.0 else -drawn[-1])
        named_points = random_points(
            me,
            repr(structure),
            [*map(named, SIZES)],
            drawn,
            SIZES,
            lambda y: (structure.matrix(y), structure.casimirs(y)),
        )
    ranks = []
    for _, y in named_points:
        try:
            ranks.append(structure.rank_at(y))
        except Exception:  # for the laws to tell
            ranks.append(0)
    reach = np.abs([flat(y) for _, y in named_points]).max(axis=0)
    everywhere = tuple(y for _, y in named_points)
    return [AtStructure(name, structure, y, max(ranks), reach, everywhere) for name, y in named_points]
