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

from ..errors import InvalidInput, InvalidType
from ..formulas import Vec, derivative, dot, gradient, jacobian, real_array
from ..formulas.broadcasting import check_finite
from ..groups.poisson_structure import PoissonStructure
from .casimir_laws import independence
from .law import Law, Same, axiom, verdicts
from .report import Finding, Report
from .sample_points import flat, size
from .sample_states import SIZES, components, named

CLOSE = 256.0
"""Roundings per dimension of entries and their derivatives."""

NO_RANK = 1e-9
"""Singular values below this part of the largest one are zero."""

POISSON: list[Law] = []


@dataclass(frozen=True)
class AtPoint:
    """A point, and the rank that the structure has almost everywhere."""

    name: str
    B: Any
    y: Vec
    generic: int
    others: tuple[Vec, ...]  # all the points, with this one

    @property
    def dim(self) -> int:
        return len(self.y)

    @cached_property
    def matrix(self) -> np.ndarray:
        """B(y)."""
        return np.array(self.B.matrix(self.y), dtype=float)

    @cached_property
    def slopes(self) -> np.ndarray:
        """d_l b_ij, with l first."""
        n = self.dim
        return np.array(
            [
                np.array(
                    derivative(
                        lambda x: self.B.matrix(x), self.y, [float(i == l) for i in range(n)]
                    ),
                    dtype=float,
                )
                for l in range(n)
            ]
        )

    def __str__(self) -> str:
        return f"{self.name}, y = ({', '.join(f'{c:.3g}' for c in self.y[:8])})"


@dataclass(frozen=True)
class Entry(Same):
    """A comparison about certain entries of the matrix, which a report names."""

    entries: str = ""

    def slips(self, allowed: float) -> str:
        """The entries."""
        return f"a slip in {self.entries}"


@axiom(POISSON, "matrix", "B(y) is an n by n matrix of finite numbers")
def matrix(B: Any, at: AtPoint) -> Iterator[Same]:
    yield Same(np.array(at.matrix.shape), np.array([at.dim, at.dim]))
    yield Same(at.matrix - at.matrix, 0.0 * at.matrix)


@axiom(POISSON, "skew symmetry", "b_ij = -b_ji")
def skew_symmetry(B: Any, at: AtPoint) -> Iterator[Same]:
    b, scale = at.matrix, float(np.abs(at.matrix).max(initial=0.0))
    for i, j in itertools.combinations_with_replacement(range(at.dim), 2):
        yield Entry(
            b[i, j],
            -b[j, i],
            scale,
            entries=f"b_{i + 1},{j + 1} = {b[i, j]:.3g} or b_{j + 1},{i + 1} = {b[j, i]:.3g}",
        )


@axiom(
    POISSON,
    "Jacobi identity",
    "sum_l (d_l b_ij b_lk + d_l b_jk b_li + d_l b_ki b_lj) = 0 for i < j < k",
    slack=CLOSE,
)
def jacobi(B: Any, at: AtPoint) -> Iterator[Same]:
    b, d = at.matrix, at.slopes
    nested = np.einsum("lij,lk->ijk", d, b)
    total = nested + nested.transpose(2, 0, 1) + nested.transpose(1, 2, 0)  # cyclic: ijk, jki, kij
    terms = np.einsum("lij,lk->ijk", np.abs(d), np.abs(b))
    # rounding of the slopes
    scale = float(terms.max(initial=0.0)) + float(np.abs(b).max(initial=0.0)) ** 2 / (
        size(at.y) or 1.0
    )
    for i, j, k in itertools.combinations(range(at.dim), 3):
        at_fault = f"b_{i + 1},{j + 1}, b_{j + 1},{k + 1}, b_{k + 1},{i + 1}, or what these are multiplied by"
        yield Entry(total[i, j, k], 0.0, scale, entries=at_fault)


@axiom(POISSON, "closed product", "sharp(y, a) = B(y) a", "sharp", slack=CLOSE)
def closed_product(B: Any, at: AtPoint) -> Iterator[Same]:
    terms = float(np.abs(at.matrix).max(initial=0.0))
    for j, unit in enumerate(np.eye(at.dim)):
        given = flat(B.sharp(at.y, Vec.of(unit.tolist())))
        yield Entry(given, at.matrix[:, j], terms, entries=f"the component a_{j + 1}")


@axiom(POISSON, "Leibniz' rule", "{F G, H} = F {G, H} + G {F, H}", slack=CLOSE)
def leibniz(B: Any, at: AtPoint) -> Iterator[Same]:
    F, G, H = (_polynomial(at.dim, k) for k in range(3))
    f, g = float(F(at.y)), float(G(at.y))
    first, second = float(B.bracket(G, H)(at.y)), float(B.bracket(F, H)(at.y))
    whole = float(B.bracket(lambda y: F(y) * G(y), H)(at.y))
    a, b, c = (np.abs(flat(gradient(x, at.y))) for x in (F, G, H))
    terms = (abs(f) * b + abs(g) * a) @ np.abs(at.matrix) @ c
    yield Same(whole, f * first + g * second, float(terms))


@axiom(POISSON, "Casimirs", "B dC = 0", "casimirs", slack=CLOSE)
def casimirs(B: Any, at: AtPoint) -> Iterator[Same]:
    slopes = np.array(jacobian(lambda y: B.casimirs(y), at.y), dtype=float).reshape(-1, at.dim)
    for i, row in enumerate(slopes):
        terms = float((np.abs(at.matrix) @ np.abs(row)).max(initial=0.0))
        yield Entry(
            at.matrix @ row, np.zeros(at.dim), terms + size(row), entries=f"Casimir {i + 1}"
        )


@axiom(
    POISSON,
    "independent Casimirs",
    "the gradients of the Casimirs are independent almost everywhere",
    "casimirs",
    once=True,
)
def independent_casimirs(B: Any, at: AtPoint) -> Iterator[Same]:
    def slopes(y: Any) -> np.ndarray:
        return np.array(jacobian(lambda x: B.casimirs(x), y), dtype=float).reshape(-1, at.dim)

    yield independence(B.casimirs, slopes, at.others)


@axiom(
    POISSON,
    "motion of coordinates",
    "d/ds coordinate_flow(y, i, s) = B e_i, at two s",
    "coordinate_flow",
    slack=CLOSE,
)
def coordinate_flow(B: Any, at: AtPoint) -> Iterator[Same]:
    for i in range(at.dim):
        for s in (0.0, 0.25):
            there = B.coordinate_flow(at.y, i, s)
            rate = flat(derivative(partial(B.coordinate_flow, at.y, i), s))
            b = np.array(B.matrix(there), dtype=float)
            scale = float(np.abs(b).max(initial=0.0)) + size(rate)
            yield Entry(rate, b[:, i], scale, entries=f"the motion of y_{i + 1}")


@axiom(
    POISSON,
    "rank",
    "B has one rank almost everywhere, even, the one named; Casimirs are no more than what is left",
)
def rank(B: Any, at: AtPoint) -> Iterator[Same]:
    found = _rank(at.matrix)
    yield Entry(
        found, at.generic, entries=f"the point: B has rank {found} here, {at.generic} elsewhere"
    )
    yield Entry(found % 2, 0, entries="the skew symmetry")
    if B.rank is not None:
        yield Entry(B.rank, at.generic, entries=f"`rank`, which is {B.rank}")
    number = len(flat(B.casimirs(at.y)))
    yield Entry(
        max(number, at.dim - at.generic),
        at.dim - at.generic,
        entries=f"`casimirs`, which are {number}",
    )


def _rank(b: np.ndarray) -> int:
    sizes = np.linalg.svd(b, compute_uv=False)
    return int((sizes > NO_RANK * sizes[0]).sum()) if sizes.size and sizes[0] > 0.0 else 0


def _polynomial(n: int, seed: int) -> Any:
    """A quadratic function of nothing special."""
    rng = np.random.default_rng(seed + 10)
    a, b = Vec.of(rng.normal(size=n).tolist()), Vec.of(rng.normal(size=n).tolist())
    return lambda y: dot(a, y) + dot(b, y) * dot(a, y) + y[seed % n] ** 2


def check_poisson(
    structure: PoissonStructure, points: Any = None, *, raises: bool = True, seed: int = 0
) -> Report:
    """Does a matrix B(y) make a Poisson bracket, and do the closed forms of its class belong to it?

    Checked are skew symmetry, the identity of Jacobi for all i < j < k, Leibniz' rule, Casimirs,
    `sharp`, `coordinate_flow`, and that the rank is the same at all points.

    points : (m, n), where to look; left out, random points of several sizes, with positive coordinates
    if B or the Casimirs need them.
    raises : False returns the report on a broken structure as well.  seed : of the random points.

    Returns a Report, which prints as a table.  Raises LawViolation: the first law broken, the
    entries, where and by how much.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.2, the identity
    (2.10).
    """
    given: Any = structure
    if not isinstance(given, PoissonStructure):
        cure = f"; write {given.__name__}(), with the brackets" if isinstance(given, type) else ""
        raise InvalidType(
            f"check_poisson: structure must be a PoissonStructure; got {given!r}{cure}"
        )
    where = _places(structure, points, seed)
    report = Report(repr(structure), tuple(_findings(structure, where)))
    if report.broken and raises:
        raise report.violation()
    return report


def _findings(structure: PoissonStructure, where: list[AtPoint]) -> Iterator[Finding]:
    def own(name: str) -> bool:
        return getattr(type(structure), name) is not getattr(PoissonStructure, name)

    yield from verdicts(POISSON, structure, where, own)


def _places(structure: PoissonStructure, points: Any, seed: int) -> list[AtPoint]:
    n = structure.dim
    if points is not None:
        array = np.atleast_2d(real_array(points, "check_poisson: points"))
        if array.shape[1:] != (n,):
            raise InvalidInput(f"check_poisson: points must have shape (m, {n}); got {array.shape}")
        check_finite(array, "check_poisson: points")
        found = [(f"point {i}", Vec.of(row)) for i, row in enumerate(array.tolist())]
    else:
        rng = np.random.default_rng(seed)
        names = [named(large) for large in SIZES]
        drawn: list[np.ndarray] = []
        for large in SIZES:  # a negative one is the mirror image of the point before
            drawn.append(components(rng, n, large) if large > 0.0 else -drawn[-1])
        found = [(name, Vec.of(y.tolist())) for name, y in zip(names, drawn, strict=True)]
        if not all(_defined(structure, y) for _, y in found):
            drawn = [0.5 * abs(k) + np.abs(y) for k, y in zip(SIZES, drawn, strict=True)]
            found = [(name, Vec.of(y.tolist())) for name, y in zip(names, drawn, strict=True)]
        found = [(name, y) for name, y in found if _defined(structure, y)]
        if not found:
            raise InvalidInput(
                f"check_poisson: {structure!r} is not defined at random "
                "points; give some, points=[[...], ...]"
            )
    ranks = []
    for _, y in found:
        try:
            ranks.append(_rank(np.array(structure.matrix(y), dtype=float)))
        except Exception:  # for the laws to tell
            ranks.append(0)
    everywhere = tuple(y for _, y in found)
    return [AtPoint(name, structure, y, max(ranks), everywhere) for name, y in found]


def _defined(structure: PoissonStructure, y: Vec) -> bool:
    """Have the matrix and the Casimirs values here?  What raises an error of another kind is for
    the laws to tell.
    """
    try:
        return bool(
            np.isfinite(flat(structure.matrix(y))).all()
            and np.isfinite(flat(structure.casimirs(y))).all()
        )
    except (ArithmeticError, ValueError):
        return False
    except Exception:
        return True
