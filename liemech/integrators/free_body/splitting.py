"""Splitting of the free rigid body into three rotations."""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import IncompatibleSystem
from ...formulas import Vec, cos, mat, record, sin, vec, vectors
from ...groups.rigid.so3 import SO3
from ...systems.lie_poisson import BodyState
from ..method import Method
from .moser_veselov import require_free_body

TURNS = ((0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5))
"""Strang's order: axes, and how much of the step each of them takes."""


@record
class ThreeRotations(Method):
    """The free rigid body as turns about its principal axes:
    H = mu_1^2/2J_1 + mu_2^2/2J_2 + mu_3^2/2J_3, term by term.

    Each term turns the body about its axis by the angle h mu_i/J_i, exactly; half of 1, half of 2,
    all of 3, half of 2, half of 1. Explicit, order 2, symmetric, Poisson; spatial momentum kept to
    rounding, energy bounded.

    Free rigid bodies given by principal moments only.
    Source: McLachlan, Phys. Rev. Lett. 71 (1993); Reich, Physica D 76 (1994); Hairer, Lubich,
    Wanner, VII.5.
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    name = "Three rotations"

    def require(self, system: Any) -> None:
        """A free rigid body in its principal axes."""
        super().require(system)
        require_free_body(self, system)
        if not isinstance(system.hamiltonian.inertia, vectors.Vec):
            raise IncompatibleSystem(
                f"{self!r} turns about principal axes and needs three principal moments; got "
                f"{system!r}. Take the axes from numpy.linalg.eigh of the inertia matrix, or use "
                "CovariantVariational(Cayley()), which takes the matrix as it is"
            )

    def step(self, system: Any, t: float, state: BodyState, h: float) -> BodyState:
        """Five turns; momentum and the rows of g change alike."""
        mu, g = state.mu, state.g
        matrices = isinstance(system.group, SO3)
        for axis, share in TURNS:
            half = 0.5 * (share * h) * (system.hamiltonian.inverse[axis] * mu[axis])
            s, c = sin(half), cos(half)
            sine, versine = 2.0 * (s * c), 2.0 * (s * s)
            mu = _turned(mu, axis, sine, versine)
            if g is not None and matrices:
                g = mat(*[_turned(row, axis, sine, versine) for row in g])
            elif g is not None:
                g = system.group.compose_exp(g, vec(*[2.0 * half if i == axis else 0.0 for i in range(3)]))
        return BodyState(mu, g)


def _turned(row: Vec, axis: int, sine: float, versine: float) -> Vec:
    """A row times the rotation about an axis, given by sin and 1 - cos of its angle: row + what the rotation adds."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    b, c = row[j], row[k]
    new_b, new_c = b + (sine * c - versine * b), c - (sine * b + versine * c)
    return vec(*[row[i] if i == axis else new_b if i == j else new_c for i in range(3)])
