"""What symplectic methods on the constraints share: which systems they take, and which steps they refuse."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ..errors import IncompatibleSystem, InconsistentState, NoConvergence
from ..formulas import Mat, Vec, derivative, dot, mat, record
from ..systems.constrained import CONSISTENT, ConstrainedSystem, cross_products, eliminated
from .method import Method, alternatives

NEARLY = 1e-2
"""The reciprocal of a condition number below which a failing step is blamed on constraints that become dependent."""

FOLD = 2.0**-4
"""A pivot that falls below this part of what it was: the last correction, quadratic, may err by more than rounding."""


@record
class OnConstraints(Method):
    """A symplectic method on the manifold of a constrained system; abstract.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.
    """

    symplectic: ClassVar[bool] = True

    def require(self, system: Any) -> None:
        """A constrained system."""
        if not isinstance(system, ConstrainedSystem):
            raise IncompatibleSystem(
                f"{self!r} needs a ConstrainedSystem, an energy and equations g(q) = 0; got {system!r}. "
                f"{alternatives(system)}"
            )
        super().require(system)

    def check_branch(self, system: Any, h: float, q: Vec, there: Vec, p: Vec, G: Mat, pivots: Vec) -> None:
        """Refuse a step to positions that cannot be reached from q, with G there, on the branch that begins at h = 0.

        On it G(there) H_pp G^T is invertible, with pivots of the signs that those of G H_pp G^T have.  Where it is nearly
        singular, the last correction may leave g(there) too large; so g is looked at once more.
        """
        G_there = system.constraint_jacobian(there)
        products = cross_products(G_there, pushed(system, q, p, G))
        _, turned = eliminated(products, pivots)
        folding = False
        for now, then in zip(pivots, turned):
            if not now * then > 0.0:
                raise self._unsolved(system, h, q, p, "the positions found are on another branch of the constraints")
            folding = folding or abs(then) < FOLD * abs(now)
        if folding:
            for value, row in zip(system.constraint(there), G_there):
                if not abs(value) <= CONSISTENT * dot(abs(row), abs(q) + abs(there)):
                    raise self._unsolved(system, h, q, p, f"g(q) = {value:.1e} is left; its derivative is nearly singular there")

    def _unsolved(self, system: Any, h: float, q: Vec, p: Vec, what: str) -> NoConvergence | InconsistentState:
        """The error of a step that could not be made."""
        try:
            normals, G = np.array(system.normals(q, p)), np.array(system.constraint_jacobian(q))
            values = np.linalg.svd(G @ normals.T / np.outer(*[np.sqrt(np.abs(np.sum(G * normals, axis=1)))] * 2), compute_uv=False)
            near = values[-1] < NEARLY * values[0]
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            near = False
        if near:
            return InconsistentState(
                f"{self!r}: {what}. The constraints are nearly dependent here, |G H_pp G^T| has the condition "
                f"{values[0] / values[-1]:.1e} with its rows at length one: a dead point, beyond which the motion is not determined"
            )
        return NoConvergence(
            f"{self!r}: {what}. The step h = {h:g} is too large for this motion and these constraints; try {0.25 * h:g}"
        )


def pushed(system: Any, q: Vec, p: Vec, G: Mat) -> Mat:
    """H_pp G^T as rows, (m, n), for the momentum in the middle of the step."""
    return mat(*[derivative(lambda x: system.velocity(q, x), p, row) for row in G])
