"""The numerical construction of Darboux and Lie: canonical coordinates around a point, for any
structure of constant rank.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput, OutsideChart
from ...formulas import Mat, Record, Vec, dot, outer, record, vec
from ...groups.matrices.matrix_group import whole_number
from ...groups.matrices.skew_matrices import pairs
from ...integrators.rkmk import combination
from ...tableaus import BY_ORDER
from .darboux import DarbouxChart

NEXT = 2.0**-10
"""How far beside the centre the rank is looked at, relative to the coordinates."""


@record
class Level(Record):
    """One step of the recursion: a pair of functions in the space that is left, and what lies in
    both of their levels.

    centre : y_0 in the coordinates of this level, (m,).  a, b : p = a . (y - y_0), and q = 0 where
    b . (y - y_0) = 0.
    basis : of the rest, (m, m - 2), orthonormal, with a and b across; None if there is no rest.
    """

    centre: Vec
    a: Vec
    b: Vec
    basis: Mat | None


@record
class DarbouxLieChart(DarbouxChart):
    """Canonical coordinates around a point, by the construction of Darboux and Lie, with numerical
    motions.

    One takes a linear function p and its motion, y' = B a.  Where b . (y - y_0) = 0 is crossed,
    q = 0, and q is the time since: then {q, p} = 1.  The motions of q and p commute, and lead every
    point to a point of the plane q = p = 0, where functions are left that commute with both; there
    the structure is B - (B a (B b)^T - B b (B a)^T)/(a . B b), and one goes on with it.  At last
    B = 0: what is left are Casimirs.

    structure : of constant rank near the point.  centre : the point y_0, (n,).  steps : of order 8,
    for each motion.  `defect(y)` tells how canonical the coordinates are: rounding near y_0.

    Raises InvalidInput where the rank at y_0 is zero, or less than beside it; OutsideChart where a
    motion no longer crosses.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.3.
    """

    centre: Vec
    steps: int = 4
    levels: tuple[Level, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole_number("DarbouxLieChart.steps", self.steps, 1)
        if len(self.centre) != self.structure.dim:
            raise InvalidInput(
                f"DarbouxLieChart: centre must have {self.structure.dim} components; got {self.centre!r}"
            )
        B = np.array(self.structure.matrix(self.centre), dtype=float)
        conjugate = pairs(B, self.structure.terms(self.centre)) if np.isfinite(B).all() else []
        if not conjugate:
            centre = list(self.centre)
            raise InvalidInput(
                f"DarbouxLieChart: the structure has rank zero or no value at {centre}; take another centre"
            )
        beside = self._rank_beside()
        if beside > 2 * len(conjugate):
            raise InvalidInput(
                f"DarbouxLieChart: the rank at the centre {list(self.centre)} is "
                f"{2 * len(conjugate)}, beside it {beside}, so that there are no such coordinates "
                "around it; take another centre"
            )
        levels: list[Level] = []
        left, y = np.arange(len(B)), np.array(self.centre)
        for i, j in conjugate:
            a, b = (left == j).astype(float), (left == i).astype(float)
            a = a / (b @ B @ a)  # {q, p} is one at the centre by itself
            basis = np.eye(len(B))[:, (left != i) & (left != j)]
            levels.append(Level(Vec.of(y), Vec.of(a), Vec.of(b), Mat.of(basis.tolist()) if basis.size else None))
            B, y = (basis.T @ np.asarray(_restricted(Mat.of(B.tolist()), levels[-1])) @ basis, basis.T @ y)
            left = left[(left != i) & (left != j)]
        object.__setattr__(self, "levels", tuple(levels))

    def _rank_beside(self) -> int:
        """The rank at a point next to the centre; 0 where the structure has no value."""
        y = np.array(self.centre)
        sizes = np.where(y != 0.0, np.abs(y), np.abs(y[y != 0.0]).min(initial=np.inf))
        sizes[sizes == np.inf] = 1.0
        moved = y + NEXT * sizes * np.random.default_rng(1).uniform(0.5, 1.0, len(y))
        try:
            return self.structure.rank_at(Vec.of(moved.tolist()))
        except (ArithmeticError, ValueError):
            return 0

    @property
    def degrees(self) -> int:
        """Half the rank at the centre."""
        return len(self.levels)

    def coordinates(self, y: Vec) -> Vec:
        """(q, p, c).  y : (n,)."""
        q: list[Any] = []
        p: list[Any] = []
        for k, level in enumerate(self.levels):
            y, time = self._to_section(k, y)
            q.append(time)
            p.append(dot(level.a, y - level.centre))
            y = self._along(k, y, -p[k])
            y = _inside(level, y)
        return vec(*q, *p, *y)

    def point(self, z: Vec) -> Vec:
        """The point y with the coordinates z, built from the last level up.  z : (n,)."""
        n = len(self.levels)
        y = z[2 * n :]
        for k in range(n - 1, -1, -1):
            y = self._along(k, _embedded(self.levels[k], y), z[n + k])
            y = self._flow(k, y, z[k])
        return y

    # ---------------------------------------------------------------- the motions of a level

    def _matrix(self, k: int, y: Vec) -> Mat:
        """The structure in the coordinates of a level."""
        points = [y]
        for level in self.levels[:k][::-1]:
            points.append(_embedded(level, points[-1]))
        B = self.structure.matrix(points[-1])
        for level in self.levels[:k]:
            rows = level.basis.T  # type: ignore[union-attr]
            B = rows @ _restricted(B, level) @ level.basis
        return B

    def _to_section(self, k: int, y: Vec) -> tuple[Vec, Any]:
        """Follow the motion of p until b . (y - y_0) = 0; return the point, and the time with its
        sign changed.
        """
        level = self.levels[k]
        m, whole = len(y), dot(level.b, y - level.centre)

        def rate(x: Vec) -> Vec:
            velocity = self._matrix(k, x[:m]) @ level.a
            crossing = dot(level.b, velocity)
            if not crossing > 0.0:
                raise OutsideChart(
                    f"DarbouxLieChart: the motion of p_{k + 1} does not cross its section here; stay nearer to the centre"
                )
            return vec(*(velocity / crossing), 1.0 / crossing)

        end = self._integrated(rate, vec(*y, 0.0), -whole)
        return end[:m], -end[m]

    def _along(self, k: int, y: Vec, change: Any) -> Vec:
        """Follow the motion of q, on the section, until p has changed by so much."""
        level = self.levels[k]

        def rate(x: Vec) -> Vec:
            velocity = self._matrix(k, x) @ level.b
            return velocity / dot(level.a, velocity)

        return self._integrated(rate, y, change)

    def _flow(self, k: int, y: Vec, time: Any) -> Vec:
        """The motion of the momentum p of a level over a time, y' = B(y) a."""
        return self._integrated(lambda x: self._matrix(k, x) @ self.levels[k].a, y, time)

    def _integrated(self, rate: Any, y: Vec, time: Any) -> Vec:
        """The solution of y' = rate(y) after a time, by equal steps of order 8."""
        tableau = BY_ORDER[8]
        h = time / self.steps
        for _ in range(self.steps):
            slopes: list[Any] = []
            for row in tableau.A:
                shift = combination(row, slopes)
                slopes.append(rate(y if shift is None else y + h * shift))
            y = y + h * combination(tableau.b, slopes)
        return y


def _restricted(B: Mat, level: Level) -> Mat:
    """Dirac's bracket for the pair of the level: B - (B a (B b)^T - B b (B a)^T)/(a . B b)."""
    x, y = B @ level.a, B @ level.b
    return B - (outer(x, y) - outer(y, x)) / dot(level.a, y)


def _inside(level: Level, y: Vec) -> Vec:
    """The coordinates that are left."""
    return vec() if level.basis is None else level.basis.T @ y


def _embedded(level: Level, x: Vec) -> Vec:
    """The point with these, at q = p = 0."""
    across = level.centre if level.basis is None else level.centre - level.basis @ (level.basis.T @ level.centre)
    return across if level.basis is None else across + level.basis @ x
