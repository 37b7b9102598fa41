"""Is a vector field locally that of an energy, y' = B(y) dH(y)?"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType, require
from ..formulas import derivative, jacobian
from ..groups.matrices.skew_matrices import null_vectors
from ..groups.poisson_structure import PoissonStructure
from ..systems.vector_field import VectorField
from .laws.law import Law, Same, Told, axiom, shaped, verdicts
from .points.poisson_points import AtPoint, given_points, own_formulas, random_points
from .points.sample_points import flat
from .report import Report, finished

PLACES = 6
"""How many points are drawn."""

CLOSE = 256.0
"""Roundings per dimension of entries and their derivatives."""

FIELD: list[Law] = []


Field = Callable[[Any], Any]


@dataclass(frozen=True)
class AtField(AtPoint):
    """A point, with the matrix and the field there."""

    f: Field

    @cached_property
    def velocity(self) -> np.ndarray:
        """The velocity f(y) as an array, (n,)."""
        return flat(self.f(self.y))


@axiom(FIELD, "velocity", "f(y) is a vector of n finite numbers")
def velocity(f: Field, at: AtField) -> Iterator[Same]:
    yield from shaped(at.velocity, (at.dim,))


@axiom(FIELD, "flow of Poisson maps", "sum_l (f_l d_l b_ij - b_lj d_l f_i - b_il d_l f_j) = 0 for i < j", slack=CLOSE)
def poisson_maps(f: Field, at: AtField) -> Iterator[Same]:
    v, b = at.velocity, at.matrix
    along = np.array(derivative(lambda y: at.B.matrix(y), at.y, v.tolist()), dtype=float)
    D = np.array(jacobian(lambda y: at.f(y), at.y), dtype=float)
    terms = np.abs(D) @ np.abs(b)
    terms = terms + terms.T + sum(abs(x) * np.abs(s) for x, s in zip(v, at.slopes, strict=True))
    total, scale = along - D @ b - b @ D.T, terms + _largest(terms)
    for i, j in itertools.combinations(range(at.dim), 2):
        remark = f"the field does not keep {{y_{i + 1}, y_{j + 1}}}: it changes at the rate {total[i, j]:.3g} too much"
        yield Told(total[i, j], 0.0, float(scale[i, j]), told=remark)


@axiom(FIELD, "leaves", "f(y) = B(y) a for some a: k . f = 0 wherever B k = 0", slack=CLOSE)
def leaves(f: Field, at: AtField) -> Iterator[Same]:
    for k in null_vectors(at.matrix):
        row = flat(k)
        terms = float(np.abs(row) @ np.abs(at.velocity))
        remark = "the field leaves the symplectic leaf of the point, across " + ", ".join(f"{x:.3g}" for x in row)
        yield Told(row @ at.velocity, 0.0, terms, told=remark)


@axiom(FIELD, "Casimirs", "f . dC = 0", "casimirs", slack=CLOSE)
def casimirs(f: Field, at: AtField) -> Iterator[Same]:
    slopes = np.array(jacobian(lambda y: at.B.casimirs(y), at.y), dtype=float)
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
    raises : False returns the report on other fields, too.  seed : of the random points.

    Returns a Report, which prints as a table.  Raises LawViolation with the entries at fault, where
    and by how much; InvalidType, InvalidInput.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.2 (integrability)
    and VII.4 (Poisson integrators).
    """
    me = "check_poisson_field"
    require(f"{me}: structure", structure, PoissonStructure)
    motion: Any = field
    if isinstance(motion, VectorField):
        if motion.dim != structure.dim:
            raise InvalidInput(f"{me}: {field!r} is of dimension {motion.dim}, {structure!r} of {structure.dim}")
        motion = motion.velocity
    elif not callable(motion) or isinstance(motion, type):
        raise InvalidType(
            f"{me}: field must be a VectorField or a formula of y such as lambda y: lm.vec(y[1], -y[0]); got {field!r}"
        )
    if points is not None:
        named_points = given_points(me, structure.dim, points)
    else:
        named_points = random_points(
            me,
            f"the field or {structure!r}",
            ["random"] * PLACES,
            np.random.default_rng(seed).normal(size=(PLACES, structure.dim)),
            [1.0] * PLACES,
            lambda y: (structure.matrix(y), motion(y)),
        )
    where = [AtField(name, structure, y, motion) for name, y in named_points]
    findings = verdicts(FIELD, motion, where, own_formulas(structure))
    return finished(f"{field!r} with {structure!r}", findings, raises)
