"""Is a vector field locally that of an energy, y' = B(y) dH(y)?"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from ..formulas import Vec, derivative, jacobian, real_array
from ..formulas.arrays import check_finite
from ..groups.poisson_structure import PoissonStructure
from ..groups.skew_matrices import null_vectors
from ..systems.vector_field import VectorField
from .law import Law, Same, axiom, verdicts
from .report import Report
from .sample_points import flat

PLACES = 6
"""How many points are drawn."""

CLOSE = 256.0
"""Roundings per dimension of entries and their derivatives."""

FIELD: list[Law] = []


@dataclass(frozen=True)
class Pair:
    """A field and a structure."""

    f: Callable[[Any], Any]
    B: PoissonStructure


@dataclass(frozen=True)
class AtPoint:
    """A point, with the matrix and the field there."""

    name: str
    pair: Pair
    y: Vec

    @property
    def dim(self) -> int:
        return len(self.y)

    @cached_property
    def matrix(self) -> np.ndarray:
        """B(y)."""
        return np.array(self.pair.B.matrix(self.y), dtype=float)

    @cached_property
    def velocity(self) -> np.ndarray:
        """f(y)."""
        return flat(self.pair.f(self.y))

    def __str__(self) -> str:
        return f"{self.name}, y = ({', '.join(f'{c:.3g}' for c in self.y[:8])})"


@dataclass(frozen=True)
class Told(Same):
    """A comparison with a remark of its own."""

    told: str = ""

    def slips(self, allowed: float) -> str:
        """The remark."""
        return self.told


@axiom(FIELD, "velocity", "f(y) is a vector of n finite numbers")
def velocity(pair: Pair, at: AtPoint) -> Iterator[Same]:
    yield Same(np.array(at.velocity.shape), np.array([at.dim]))
    yield Same(at.velocity - at.velocity, 0.0 * at.velocity)


@axiom(
    FIELD,
    "flow of Poisson maps",
    "sum_l (f_l d_l b_ij - b_lj d_l f_i - b_il d_l f_j) = 0 for i < j",
    slack=CLOSE,
)
def poisson_maps(pair: Pair, at: AtPoint) -> Iterator[Same]:
    f, b = at.velocity, at.matrix
    along = np.array(derivative(lambda y: pair.B.matrix(y), at.y, f.tolist()), dtype=float)
    D = np.array(jacobian(lambda y: pair.f(y), at.y), dtype=float)
    slopes = [
        np.array(derivative(lambda y: pair.B.matrix(y), at.y, e), dtype=float)
        for e in np.eye(at.dim).tolist()
    ]
    terms = np.abs(D) @ np.abs(b)
    terms = terms + terms.T + sum(abs(x) * np.abs(s) for x, s in zip(f, slopes, strict=True))
    total, scale = along - D @ b - b @ D.T, terms + _largest(terms)
    for i, j in itertools.combinations(range(at.dim), 2):
        told = f"the field does not keep {{y_{i + 1}, y_{j + 1}}}: it changes at the rate {total[i, j]:.3g} too much"
        yield Told(total[i, j], 0.0, float(scale[i, j]), told=told)


@axiom(FIELD, "leaves", "f(y) = B(y) a for some a: k . f = 0 wherever B k = 0", slack=CLOSE)
def leaves(pair: Pair, at: AtPoint) -> Iterator[Same]:
    for k in null_vectors(at.matrix):
        row = flat(k)
        terms = float(np.abs(row) @ np.abs(at.velocity))
        told = "the field leaves the symplectic leaf of the point, across " + ", ".join(
            f"{x:.3g}" for x in row
        )
        yield Told(row @ at.velocity, 0.0, terms, told=told)


@axiom(FIELD, "Casimirs", "f . dC = 0", "casimirs", slack=CLOSE)
def casimirs(pair: Pair, at: AtPoint) -> Iterator[Same]:
    slopes = np.array(jacobian(lambda y: pair.B.casimirs(y), at.y), dtype=float)
    for i, row in enumerate(slopes.reshape(-1, at.dim)):
        terms = float(np.abs(row) @ np.abs(at.velocity))
        yield Told(row @ at.velocity, 0.0, terms, told=f"Casimir {i + 1} is not constant")


def _largest(terms: np.ndarray) -> np.ndarray:
    """The largest term, entry by entry in the units that these have: d_i d_j with d_i^2 the largest
    of its row and of its column.
    """
    rows = np.sqrt(terms.max(axis=1, initial=0.0))
    units = np.where(rows > 0.0, rows, 1.0)
    whole = np.outer(units, units)
    return np.asarray((terms / whole).max(initial=0.0) * whole)


def check_poisson_field(
    field: VectorField | Callable[[Any], Any],
    structure: PoissonStructure,
    points: Any = None,
    *,
    raises: bool = True,
    seed: int = 0,
) -> Report:
    """Is an equation y' = f(y) locally a Poisson system, f = B dH with some energy H?

    It is if and only if the motion consists of Poisson maps and respects the Casimirs.  Both are
    told from f and its derivative: the Lie derivative of B along f must vanish, and f be tangent to
    the symplectic leaves.  With Canonical(n) it is the question whether f is locally Hamiltonian,
    df/dy J^-1 symmetric.  H itself need not exist beyond a neighbourhood of each point.

    field : a VectorField, or a formula of y.  structure : B.
    points : (m, n), where to look; left out, random points of size one, with positive coordinates
    if f or B need them.
    raises : False returns the report on a field that is none as well.  seed : of the random points.

    Returns a Report, which prints as a table.  Raises LawViolation with the entries at fault, where
    and by how much; InvalidType, InvalidInput.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.2 (integrability)
    and VII.4 (Poisson integrators).
    """
    given: Any = structure
    if not isinstance(given, PoissonStructure):
        cure = f"; write {given.__name__}(), with the brackets" if isinstance(given, type) else ""
        raise InvalidType(
            f"check_poisson_field: structure must be a PoissonStructure; got {given!r}{cure}"
        )
    motion: Any = field
    if isinstance(motion, VectorField):
        if motion.dim != structure.dim:
            raise InvalidInput(
                f"check_poisson_field: {field!r} is of dimension {motion.dim}, {structure!r} of "
                f"{structure.dim}"
            )
        pair = Pair(motion.velocity, structure)
    elif callable(motion) and not isinstance(motion, type):
        pair = Pair(motion, structure)
    else:
        raise InvalidType(
            "check_poisson_field: field must be a VectorField or a formula of y such as "
            f"lambda y: lm.vec(y[1], -y[0]); got {field!r}"
        )
    where = _places(pair, points, seed)

    def own(name: str) -> bool:
        return getattr(type(structure), name) is not getattr(PoissonStructure, name)

    report = Report(f"{field!r} with {structure!r}", tuple(verdicts(FIELD, pair, where, own)))
    if report.broken and raises:
        raise report.violation()
    return report


def _places(pair: Pair, points: Any, seed: int) -> list[AtPoint]:
    n, me = pair.B.dim, "check_poisson_field"
    if points is not None:
        array = np.atleast_2d(real_array(points, f"{me}: points"))
        if array.shape[1:] != (n,):
            raise InvalidInput(f"{me}: points must have shape (m, {n}); got {array.shape}")
        check_finite(array, f"{me}: points")
        return [AtPoint(f"point {i}", pair, Vec.of(y)) for i, y in enumerate(array.tolist())]
    drawn = np.random.default_rng(seed).normal(size=(PLACES, n))
    where = [AtPoint("random", pair, Vec.of(y)) for y in drawn.tolist()]
    if not all(map(_defined, where)):
        where = [AtPoint("random", pair, Vec.of(y)) for y in (0.5 + abs(drawn)).tolist()]
    where = list(filter(_defined, where))
    if not where:
        raise InvalidInput(
            f"{me}: the field or {pair.B!r} is not defined at random points; give some, "
            "points=[[...], ...]"
        )
    return where


def _defined(at: AtPoint) -> bool:
    """Have the matrix and the field values here?  What raises an error of another kind is for the
    laws to tell.
    """
    try:
        return bool(np.isfinite(at.matrix).all() and np.isfinite(at.velocity).all())
    except (ArithmeticError, ValueError):
        return False
    except Exception:
        return True
