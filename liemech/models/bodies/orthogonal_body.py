"""The free rigid body as nine numbers with six constraints: matrices that are kept orthogonal."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Vec, dot, record, sum, vec
from ...rooms.constraints.constrained import SeparableConstrainedSystem
from ...systems.canonical import CanonicalState

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The columns whose products are constrained."""


@record
class OrthogonalBody(SeparableConstrainedSystem):
    """The free rigid body in the entries of its rotation matrix, H(Q, P) = tr(P D^-1 P^T)/2 with
    Q^T Q = 1.

    inertia : the principal moments J, (3,), in kg m^2.  D = tr(J)/2 - J, the mass moments, may have
    a negative entry, not a zero.
    q : Q by rows, (9,).  p : P = Q' D by rows.  RATTLE makes of it the method of Moser and Veselov.
    Conserved: the energy, the constraints and the spatial momentum.

    Source: Hairer, Lubich, Wanner, VII.5.2 (Moser-Veselov by RATTLE); McLachlan and Scovel, J.
    Nonlinear Sci. 5 (1995).
    """

    degrees: ClassVar[int] = 9
    linear_velocity: ClassVar[bool] = True

    inertia: Vec = vec(1.0, 1.5, 2.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        J = np.array(self.inertia)
        if J.shape != (3,) or not (np.isfinite(J) & (J > 0.0)).all():
            raise InvalidInput(f"OrthogonalBody: inertia is three positive moments; got {self.inertia}")
        D = 0.5 * J.sum() - J
        if not (np.abs(D) > 1e-12 * J.sum()).all():
            raise InvalidInput(
                "OrthogonalBody: a body without extent along an axis, tr(J)/2 - J = "
                f"{tuple(D.tolist())}, has no mass there; RigidBody takes it"
            )

    def _mass_moments(self) -> Vec:
        """The second moments of mass D = tr(J)/2 - J."""
        J = self.inertia
        return vec(*[0.5 * (J[0] + J[1] + J[2]) - J[i] for i in range(3)])

    def _over(self, p: Vec) -> Vec:
        """The velocity P D^-1 of a momentum P, row by row."""
        D = self._mass_moments()
        return vec(*[p[3 * i + j] / D[j] for i in range(3) for j in range(3)])

    def kinetic(self, p: Vec) -> float:
        """tr(P D^-1 P^T)/2, in J.  p : (9,)."""
        return 0.5 * dot(p, self._over(p))

    def potential(self, q: Vec) -> float:
        """The potential of a free body, zero.  q : (9,)."""
        return 0.0 * q[0]

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """P D^-1.  q, p : (9,)."""
        return self._over(p)

    def force(self, q: Vec, p: Vec) -> Vec:
        """The force on a free body, zeros.  q, p : (9,)."""
        return 0.0 * q

    def constraint(self, q: Vec) -> Vec:
        """(Q^T Q - 1)/2 on the diagonal, Q^T Q above it, (6,).  q : (9,)."""
        products = [sum([q[3 * k + i] * q[3 * k + j] for k in range(3)]) for i, j in PAIRS]
        return vec(*[0.5 * (x - 1.0) if i == j else x for x, (i, j) in zip(products, PAIRS)])

    def body_momentum(self, q: Vec, p: Vec) -> Vec:
        """mu, (3,): hat(mu) = Q^T P - P^T Q, in kg m^2/s.  q, p : (9,)."""
        return vec(*[self._turning(q, p, j, i) for i, j in ((1, 2), (2, 0), (0, 1))])

    def _turning(self, q: Vec, p: Vec, i: int, j: int) -> float:
        """(Q^T P - P^T Q)_ij."""
        return sum([q[3 * k + i] * p[3 * k + j] - p[3 * k + i] * q[3 * k + j] for k in range(3)])

    def spatial_momentum(self, q: Vec, p: Vec) -> Vec:
        """Q mu, (3,), in kg m^2/s.  q, p : (9,)."""
        mu = self.body_momentum(q, p)
        return vec(*[sum([q[3 * i + j] * mu[j] for j in range(3)]) for i in range(3)])

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, the constraints, and the spatial momentum."""
        return super().constants(states) | {
            "spatial momentum": np.asarray(self.spatial_momentum(states["q"], states["p"]))
        }

    def at(self, mu: Any, g: Any) -> CanonicalState:
        """The state of a body with momentum mu, (3,), in the attitude g, (3, 3): P = g hat(J^-1 mu) D."""
        w = np.array(mu, dtype=float) / np.array(self.inertia)
        hat = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        g = np.array(g, dtype=float)
        return self.state(g.ravel(), (g @ hat * np.array(self._mass_moments())).ravel())
