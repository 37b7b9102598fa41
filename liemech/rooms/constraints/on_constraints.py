"""Symplectic methods on the constraints: which systems they take, and which steps they
refuse.
"""

from __future__ import annotations

import itertools
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InconsistentState, InvalidInput, NoConvergence
from ...formulas import Mat, Vec, dot, norm, record
from ...formulas.numbers.sizes import EPSILON
from ...formulas.vectors import small
from ...integrators.method import Method, alternatives
from .constrained import CONSISTENT, ConstrainedSystem, cross_products, eliminated, pushed

NEARLY = 1e-2
"""The part of the largest singular value of G H_pp G^T below which a failing step is blamed on
dependent constraints; and what a kink changes in G at least, beside the length of its rows.
"""

FOLD = 2.0**-4
"""A pivot that falls below this part of what it was: the last correction, quadratic, may err by
more than rounding.
"""

LOST = 2.0**-20
"""A derivative that falls below this part of what it was: the step happens to end where a
constraint has none, with no direction to go on in.
"""


@record
class OnConstraints(Method):
    """A symplectic method on the manifold of a constrained system; abstract.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.
    """

    symplectic: ClassVar[bool] = True

    def require(self, system: Any) -> None:
        if not isinstance(system, ConstrainedSystem):
            raise IncompatibleSystem(
                f"{self!r} needs a ConstrainedSystem, an energy and equations g(q) = 0; got "
                f"{system!r}. {alternatives(system)}"
            )
        super().require(system)

    def step_warning(self, system: Any, start: Any, h: float) -> str | None:
        """Refuse a step that the positions would not notice.

        Positions are on the constraints up to eps |q|, and impulses that put them there are the
        larger the shorter the step is: where |h v| < eps |q| they are rounding.  At rest the step
        counts from which those impulses are larger than the kick of the force.
        """
        v = system.velocity(start.q, start.p)
        size = norm if start.bodies is None else lengths
        speed, least = size(v), EPSILON * size(start.q)
        if np.all(abs(h) * speed >= least):
            return None
        kicked = system.velocity(start.q, start.p + h * system.force(start.q, start.p))
        moved = abs(h) * (speed + size(kicked - v) / EPSILON)
        lost = np.flatnonzero((moved > 0.0) & (moved < least))
        if len(lost):
            i, is_ensemble = int(lost[0]), start.bodies is not None
            raise InvalidInput(
                f"{self!r}: in a step of h = {h:g} the positions move by "
                f"{abs(h) * np.ravel(speed)[i]:.1e}, which is below the rounding of q, "
                f"{np.ravel(least)[i]:.1e}{f' (body {i})' if is_ensemble else ''}; give a larger h"
            )
        return None

    def check_branch(self, system: Any, h: float, q: Vec, there: Vec, p: Vec, G: Mat, pivots: Vec) -> None:
        """Refuse a step to positions that cannot be reached from q, with G there, on the branch
        that begins at h = 0.

        On it G(there) H_pp G^T is invertible, with pivots of the signs that those of G H_pp G^T
        have.  Where it is nearly singular, the last correction may leave g(there) too large; so g
        is looked at once more, and what is left of its derivative.
        """
        G_there = system.constraint_jacobian(there)
        normals = pushed(system, q, p, G)
        products = cross_products(G_there, normals)
        _, turned = eliminated(products, pivots)
        folding = False
        for before, after in zip(pivots, turned):
            if not before * after > 0.0:
                raise self._unsolved(system, h, q, p, "the positions found are on another branch of the constraints")
            folding = folding or abs(after) < FOLD * abs(before) or abs(before) < FOLD * abs(after)
        if folding:
            for row, row_at_q, normal in zip(G_there, G, normals):
                if not dot(abs(row), abs(normal)) > LOST * dot(abs(row_at_q), abs(normal)):
                    raise self._ended(there)
            for value, row in zip(system.constraint(there), G_there):
                if not abs(value) <= CONSISTENT * dot(abs(row), abs(q) + abs(there)):
                    raise self._unsolved(
                        system, h, q, p, f"g(q) = {value:.1e} is left; its derivative is nearly singular there"
                    )

    def _ended(self, there: Vec) -> InconsistentState:
        """The error of a step that has met a dead point."""
        return InconsistentState(
            f"{self!r}: the step ends where the constraints are nearly dependent at q = "
            f"{shown(there)}: a dead point, beyond which the motion is not determined"
        )

    def _unsolved(self, system: Any, h: float, q: Vec, p: Vec, what: str) -> NoConvergence | InconsistentState:
        """The error of a step that could not be made: what lies on the straight line ahead, or just
        behind, tells why.
        """
        try:
            ahead = Ahead(system, q, p)
            where, left = ahead.weakest(BEYOND * h)
            kink = ahead.kink(BEYOND * h)
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            left, kink = 1.0, None
        if left < NEARLY:
            return InconsistentState(
                f"{self!r}: {what}. The constraints are nearly dependent at q = {shown(where)}: of "
                f"the least singular value of G H_pp G^T, its rows now at length one, {left:.1e} "
                "of the largest is left there: a dead point, beyond "
                "which the motion is not determined"
            )
        if kink is not None:
            return NoConvergence(
                f"{self!r}: {what}. The derivative of the constraints jumps at q = {shown(kink)}: "
                "they have a kink there. Constraints must be smooth"
            )
        return NoConvergence(
            f"{self!r}: {what}. The step h = {h:g} is too large for this motion and these constraints; try {0.25 * h:g}"
        )


BEYOND = 1.5
"""A step that fails met its obstacle within this many steps, by the straight line."""


class Ahead:
    """The constraints on the straight line q + s v from where a step has failed; for messages.
    system, q, p : as of the step.
    """

    def __init__(self, system: Any, q: Vec, p: Vec) -> None:
        self.system, self.p = system, p
        self.q, self.v = np.array(q), np.array(system.velocity(q, p))
        across = self._products(0.0)
        self.unit = np.sqrt(np.abs(np.diag(across)))
        self.most = np.linalg.svd(across / np.outer(self.unit, self.unit), compute_uv=False)[0]
        self.lengths = np.linalg.norm(np.array(system.constraint_jacobian(q)), axis=1)

    def at(self, s: float) -> Vec:
        """The position q + s v on the straight line."""
        return small(self.q + s * self.v)

    def weakest(self, end: float) -> tuple[Vec, float]:
        """The s from -end to end at which the least singular value of G H_pp G^T, rows measured at s = 0, is least; and
        that value.
        """
        s, step = np.linspace(-end, end, 129), end / 64
        best = float(s[np.argmin([self._least(x) for x in s])])
        for _ in range(40):
            step *= 0.5
            best = min((best - step, best, best + step), key=self._least)
        return self.at(best), self._least(best)

    def kink(self, end: float) -> Vec | None:
        """The s up to end at which the derivative G jumps; None where it changes in proportion to s."""
        begin, width = 0.0, end
        whole = jump = 0.0
        for halvings in range(40):
            parts = 64 if halvings == 0 else 2
            width /= parts
            rows = [self._rows(begin + i * width) for i in range(parts + 1)]
            jumps = [np.abs(b - a).max() for a, b in itertools.pairwise(rows)]
            begin, jump = begin + int(np.argmax(jumps)) * width, max(jumps)
            whole = whole or jump
        return self.at(begin) if jump > 0.5 * whole > NEARLY else None

    def _rows(self, s: float) -> np.ndarray:
        G = np.array(self.system.constraint_jacobian(self.at(s)))
        return G / self.lengths[:, None]

    def _products(self, s: float) -> np.ndarray:
        position = self.at(s)
        return np.array(self.system.constraint_jacobian(position)) @ np.array(self.system.normals(position, self.p)).T

    def _least(self, s: float) -> float:
        values = np.linalg.svd(self._products(s) / np.outer(self.unit, self.unit), compute_uv=False)
        return float(values[-1] / self.most)


def lengths(vectors: np.ndarray) -> np.ndarray:
    """The Euclidean length of each vector, (bodies,)."""
    return np.linalg.norm(vectors, axis=-1)


def shown(q: Vec) -> tuple[float, ...]:
    """Coordinates to six digits, for a message."""
    return tuple(float(f"{x:.6g}") for x in q)
