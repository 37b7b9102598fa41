"""Darboux charts: coordinates in which a Poisson structure is canonical, and a system in them."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar, final

import numpy as np

from ...errors import InvalidInput, OutsideChart, require, undefined
from ...formulas import Mat, Record, Vec, atan2, cos, exp, jacobian, log, norm, record, sin, sqrt, vec
from ...groups.matrices.skew_matrices import pairs
from ...groups.poisson_structure import ConstantStructure, LiePoissonStructure, LogCanonical, PoissonStructure
from ...groups.rigid.so3 import SO3
from ...systems.canonical import CanonicalState, HamiltonianSystem
from .poisson import PoissonState, PoissonSystem


@record
class DarbouxChart(Record):
    """Coordinates z = (q, p, c) of a Poisson structure with {q_i, p_j} = delta_ij and all other
    brackets zero: c are Casimirs.

    structure : the Poisson structure.  A subclass writes `coordinates(y)`, z, and its inverse
    `point(z)`, which raises OutsideChart where there is no such point; it has `degrees`, the number
    of q.

    In the chart a system is p' = -dK/dq, q' = dK/dp, c' = 0: `system` makes it.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.3.
    """

    structure: PoissonStructure

    @property
    def degrees(self) -> int:
        """Half the rank of the structure: by default the one that it names."""
        if self.structure.rank is None:
            raise undefined(self, "degrees")
        return self.structure.rank // 2

    def coordinates(self, y: Vec) -> Vec:
        """z = (q, p, c), (n,).  y : (n,)."""
        raise undefined(self, "coordinates")

    def point(self, z: Vec) -> Vec:
        """The point y with these coordinates, (n,).  z : (n,)."""
        raise undefined(self, "point")

    # ---------------------------------------------------------------- what follows

    @final
    def defect(self, y: Any) -> float:
        """The largest deviation of the brackets of the coordinates at y from those of (q, p, c).
        y : (n,).
        """
        at = vec(*map(float, y))
        D, B = (
            np.array(m, dtype=float) for m in (jacobian(lambda x: self.coordinates(x), at), self.structure.matrix(at))
        )
        n = self.degrees
        canonical = np.zeros(B.shape)
        canonical[:n, n : 2 * n], canonical[n : 2 * n, :n] = np.eye(n), -np.eye(n)
        return float(np.abs(D @ B @ D.T - canonical).max())

    @final
    def system(self, system: Any, state: Any) -> tuple[InDarbouxChart, CanonicalState]:
        """A Poisson system in this chart, on the symplectic leaf of a state, and the state there.

        Raises InvalidInput for ensembles and systems with another structure; OutsideChart.
        """
        if not isinstance(system, PoissonSystem) or system.structure != self.structure:
            raise InvalidInput(
                f"{type(self).__name__}.system: a PoissonSystem with {self.structure!r} is needed; got {system!r}"
            )
        if not isinstance(state, PoissonState) or state.bodies is not None:
            raise InvalidInput(
                f"{type(self).__name__}.system: state must be one state, system.state(...); got {state!r}"
            )
        z, n = [float(x) for x in self.coordinates(vec(*map(float, state.y)))], self.degrees
        local_system = InDarbouxChart(chart=self, original=system, leaf=vec(*z[2 * n :]))
        return local_system, local_system.state(z[:n], z[n : 2 * n])

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.structure.dim,) if kind == "Vec" else None


@record
class InDarbouxChart(HamiltonianSystem):
    """A Poisson system in a Darboux chart: Hamilton's equations for K(q, p) = H(point(q, p, c)), c
    fixed.

    chart : a DarbouxChart.  original : the Poisson system.  leaf : the values c of the Casimirs.
    Every method for canonical systems steps it, the symplectic ones as Poisson integrators;
    `points` leads back.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.4.3.
    """

    chart: DarbouxChart
    original: PoissonSystem
    leaf: Vec

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The degrees of freedom of the chart."""
        return self.chart.degrees

    def energy(self, q: Vec, p: Vec) -> float:
        """K(q, p).  q, p : (degrees,)."""
        return self.original.energy(self.chart.point(vec(*q, *p, *self.leaf)))

    def points(self, q: Any, p: Any) -> np.ndarray:
        """Where (q, p) are, as points y of the Poisson system.  q, p : (..., degrees), returns
        (..., n).
        """
        q, p = np.asarray(q, dtype=float), np.asarray(p, dtype=float)
        c = np.broadcast_to(np.array(self.leaf), (*q.shape[:-1], len(self.leaf)))
        return np.asarray(self.chart.point(np.concatenate([q, p, c], axis=-1)))


# ---------------------------------------------------------------- closed forms


@record
class Andoyer(DarbouxChart):
    """Andoyer's variables (l, L; G) of momenta of rotations: mu = ((G^2 - L^2)^(1/2) sin l,
    (G^2 - L^2)^(1/2) cos l, L), G = |mu|.

    {l, L} = 1 for the minus structure.  Singular where |L| = G, on the third axis.

    Source: Andoyer, Cours de mecanique celeste (1923); Deprit, Am. J. Phys. 35 (1967), 424.
    """

    structure: LiePoissonStructure = LiePoissonStructure(SO3())
    degrees: ClassVar[int] = 1

    def __post_init__(self) -> None:
        if self.structure != LiePoissonStructure(SO3()):
            expected = "that of so(3)*, coadjoint(SO3()).poisson_structure"
            raise InvalidInput(f"Andoyer: the structure is {expected}; got {self.structure!r}")

    def coordinates(self, y: Vec) -> Vec:
        """(l, L, G).  y : (3,).  Raises OutsideChart on the third axis, where l has no value."""
        if not abs(y[0]) + abs(y[1]) > 0.0:
            raise OutsideChart(f"Andoyer: y = ({y[0]}, {y[1]}, {y[2]}) is on the third axis, where l has no value")
        return vec(atan2(y[0], y[1]), y[2], norm(y))

    def point(self, z: Vec) -> Vec:
        """The momentum mu = (sqrt(G^2 - L^2) sin l, sqrt(G^2 - L^2) cos l, L).  z : (3,), l, L, G."""
        l, L, G = z
        square = G * G - L * L
        if not square > 0.0:
            raise OutsideChart(
                f"Andoyer: |L| = {abs(L)} is not less than G = {G}: the motion left the chart, over the third axis"
            )
        across = sqrt(square)
        return vec(across * sin(l), across * cos(l), L)


@record
class LinearDarboux(DarbouxChart):
    """The chart of a constant structure, by linear algebra: z = T y with T B T^T canonical.

    structure : a ConstantStructure of any rank.

    Source: Hairer, Lubich, Wanner, VII.3; the skew-symmetric form of the method of Gram and
    Schmidt.
    """

    structure: ConstantStructure
    forwards: Mat = field(init=False, repr=False)
    backwards: Mat = field(init=False, repr=False)

    def __post_init__(self) -> None:
        require("LinearDarboux: structure", self.structure, ConstantStructure)
        T = canonical_basis(np.array(self.structure.values))
        object.__setattr__(self, "forwards", T)
        object.__setattr__(self, "backwards", np.linalg.inv(T))
        super().__post_init__()

    def coordinates(self, y: Vec) -> Vec:
        """T y.  y : (n,)."""
        return self.forwards @ y

    def point(self, z: Vec) -> Vec:
        """T^-1 z.  z : (n,)."""
        return self.backwards @ z


@record
class LogarithmicDarboux(DarbouxChart):
    """The chart of Lotka and Volterra's structure: ln y has the constant structure c, and a linear
    chart of that follows.

    structure : a LogCanonical.  Of two species q = ln u, p = ln v up to a factor.  For y_i > 0.

    Source: Hairer, Lubich, Wanner, VII.2.2 and VII.4.3.
    """

    structure: LogCanonical
    linear: LinearDarboux = field(init=False, repr=False)

    def __post_init__(self) -> None:
        require("LogarithmicDarboux: structure", self.structure, LogCanonical)
        in_logarithms = self.structure.of_logarithms
        if in_logarithms is None:
            raise InvalidInput(
                f"LogarithmicDarboux: {self.structure!r} has a matrix of its own; the chart is that of B_ij = c_ij y_i y_j"
            )
        object.__setattr__(self, "linear", LinearDarboux(in_logarithms))
        super().__post_init__()

    def coordinates(self, y: Vec) -> Vec:
        """T ln y.  y : (n,), positive."""
        return self.linear.coordinates(vec(*[log(x) for x in y]))

    def point(self, z: Vec) -> Vec:
        """exp(T^-1 z).  z : (n,)."""
        return vec(*[exp(x) for x in self.linear.point(z)])


def canonical_basis(B: np.ndarray) -> np.ndarray:
    """Rows (q_1, ..., p_1, ..., c_1, ...) with q_i B p_j = delta_ij and all other products zero:
    Gram and Schmidt with pairs of conjugate rows.
    """
    rows = dict(enumerate(np.eye(len(B))))
    first: list[np.ndarray] = []
    second: list[np.ndarray] = []
    for i, j in pairs(B):
        a, b = rows.pop(i), rows.pop(j)
        product = a @ B @ b
        scale = np.sqrt(abs(product))
        a, b = a / scale, b / product * scale
        rows = {k: r - (r @ B @ b) * a + (r @ B @ a) * b for k, r in rows.items()}
        first.append(a)
        second.append(b)
    return np.array([*first, *second, *rows.values()])
