"""Constrained and other systems in local coordinates: an embedding makes a Poisson system of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType, NotDefined, require, undefined
from ...formulas import Mat, Record, Vec, derivative, dot, mat, record, solve, transpose, vec
from ...formulas.derivatives import axes
from ...formulas.vectors import Vec as SmallVec
from ...groups.poisson_structure import PoissonStructure
from ...systems.hamiltonian import Hamiltonian
from .poisson import PoissonSystem


@record
class LocalChart(Record):
    """Local coordinates y of a symplectic submanifold of R^2N, such as that of a constrained
    system: (q, p) = embedding(y).

    A subclass writes `embedding(y)`, the vector (q, p), as a formula, and says its even dimension
    `dim`; it may write `coordinates`, the inverse.  A constrained system with g(q) = 0 has p with
    g'(q) dH/dp(q, p) = 0 on it, too.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.3 and VII.1.
    """

    @property
    def dim(self) -> int:
        """The number of local coordinates, which a subclass says."""
        raise NotDefined(f"{type(self).__name__} must say its dimension, dim: ClassVar[int] = 4")

    def embedding(self, y: Vec) -> Vec:
        """(q, p), (2N,).  y : (dim,)."""
        raise undefined(self, "embedding")

    def coordinates(self, x: Vec) -> Vec:
        """The coordinates of (q, p) on the submanifold, (dim,).  x : (2N,)."""
        raise undefined(self, "coordinates")


@record
class InducedStructure(PoissonStructure):
    """The structure of a symplectic submanifold in local coordinates, B(y) = (X'^T J X')^-1, X the
    embedding, J^-1 canonical.

    chart : a LocalChart.

    Source: Hairer, Lubich, Wanner, VII.2.3.
    """

    chart: LocalChart

    @property
    def dim(self) -> int:
        return self.chart.dim

    @property
    def rank(self) -> int:  # type: ignore[override]
        """The full dimension: the form is regular."""
        return self.chart.dim

    def form(self, y: Vec) -> Mat:
        """X'^T J X': what the symplectic form is for velocities y'.  y : (dim,)."""
        columns = [derivative(lambda x: self.chart.embedding(x), y, unit) for unit in axes(y)]
        n = len(columns[0]) // 2
        halves = [(c[:n], c[n : 2 * n]) for c in columns]
        return mat(*[vec(*[dot(a[1], b[0]) - dot(a[0], b[1]) for b in halves]) for a in halves])

    def matrix(self, y: Vec) -> Mat:
        """The inverse of the form, B(y), (dim, dim).  y : (dim,)."""
        form, n = self.form(y), self.dim
        return transpose(mat(*[solve(form, vec(*[float(i == j) for i in range(n)])) for j in range(n)]))

    def sharp(self, y: Vec, a: Vec) -> Vec:
        """The solution of X'^T J X' v = a.  y, a : (dim,)."""
        return solve(self.form(y), a)


@record
class InducedEnergy(Hamiltonian):
    """K(y) = H(X(y)).

    system : with `energy(q, p)`.  chart : a LocalChart.
    """

    system: Any
    chart: LocalChart

    def energy(self, mu: Vec) -> float:
        """H at the point of the coordinates.  mu : (dim,), the coordinates."""
        x = self.chart.embedding(mu)
        n = len(x) // 2
        return self.system.energy(x[:n], x[n : 2 * n])


def in_coordinates(system: Any, chart: LocalChart) -> PoissonSystem:
    """A system in local coordinates of the submanifold on which it moves: y' = B(y) dK(y),
    B = (X'^T J X')^-1, K = H o X.

    system : with `energy(q, p)`, constrained to the submanifold of the chart or not.  chart : a
    LocalChart.  `chart.embedding(run.y)` leads back, `chart.coordinates` there if it is written.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.2.3.
    """
    require("in_coordinates: chart", chart, LocalChart)
    if not callable(getattr(system, "energy", None)):
        raise InvalidType(f"in_coordinates: system must have an energy(q, p); got {system!r}")
    dim: Any = chart.dim
    if type(dim) is not int or dim < 2 or dim % 2:
        raise InvalidType(f"in_coordinates: {type(chart).__name__} must say its dimension, an even number; got {dim!r}")
    _require_lengths(system, chart)
    return PoissonSystem(structure=InducedStructure(chart), hamiltonian=InducedEnergy(system, chart))


def _require_lengths(system: Any, chart: LocalChart) -> None:
    """Raise InvalidInput where the embedding does not give the positions and momenta of the system."""
    y = SmallVec.of(np.random.default_rng(3).uniform(0.5, 1.0, chart.dim).tolist())
    try:
        x = chart.embedding(y)
    except (ArithmeticError, ValueError):  # no value there: not judged
        return
    degrees = getattr(system, "degrees", None)
    count = len(x)
    if count % 2 or (degrees is not None and count != 2 * degrees):
        expected = (
            "an even number"
            if degrees is None
            else f"{2 * degrees}, {degrees} positions and {degrees} momenta of {system!r}"
        )
        raise InvalidInput(
            f"in_coordinates: {type(chart).__name__}.embedding gives {count} components; needed are {expected}"
        )
