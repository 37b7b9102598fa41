"""A particle on an ellipsoid, free: geodesics, which are integrable."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, dot, mat, record, vec
from ...rooms.constraints.constrained import SeparableConstrainedSystem
from ..input_checks import check_positive


@record
class ParticleOnEllipsoid(SeparableConstrainedSystem):
    """A free particle on an ellipsoid, H(q, p) = |p|^2/(2 m) with sum q_i^2/a_i^2 = 1: it follows
    geodesics.

    axes : the half axes a_i, (n,), in m.  mass : m, in kg.
    q : the position, (n,), in m.  p : the momentum, in kg m/s.
    Conserved: the energy and the integral of Joachimsthal, (sum q_i^2/a_i^4) (sum p_i^2/a_i^2).

    Source: Jacobi, Vorlesungen ueber Dynamik, lecture 28; Moser, Various aspects of integrable
    Hamiltonian systems (1980), 3.
    """

    linear_velocity: ClassVar[bool] = True

    axes: Vec = vec(1.0, 1.5, 2.0)
    mass: float = 1.0

    def __post_init__(self) -> None:
        if len(self.axes) < 2:
            raise InvalidInput(f"ParticleOnEllipsoid: axes are two or more, (n,); got {self.axes}")
        super().__post_init__()
        check_positive(self, "axes", "mass")

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The number of coordinates, one of each axis."""
        return len(self.axes)

    def kinetic(self, p: Vec) -> float:
        """|p|^2/(2 m), in J.  p : (n,)."""
        return dot(p, p) / (2.0 * self.mass)

    def potential(self, q: Vec) -> float:
        """The potential of a free particle, zero.  q : (n,)."""
        return 0.0 * q[0]

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """p/m.  q, p : (n,)."""
        return (1.0 / self.mass) * p

    def force(self, q: Vec, p: Vec) -> Vec:
        """The force on a free particle, zeros.  q, p : (n,)."""
        return 0.0 * q

    def constraint(self, q: Vec) -> Vec:
        """(sum q_i^2/a_i^2 - 1)/2, (1,).  q : (n,)."""
        x = q / self.axes
        return vec(0.5 * (dot(x, x) - 1.0))

    def constraint_jacobian(self, q: Vec) -> Mat:
        """q_i/a_i^2 as a row, (1, n).  q : (n,)."""
        return mat(q / (self.axes * self.axes))

    def joachimsthal(self, q: Vec, p: Vec) -> float:
        """(sum q_i^2/a_i^4) (sum p_i^2/a_i^2), in kg^2/(m^2 s^2).  q, p : (n,)."""
        x, y = q / (self.axes * self.axes), p / self.axes
        return dot(x, x) * dot(y, y)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, the constraints, and the integral of Joachimsthal."""
        return super().constants(states) | {"Joachimsthal": np.asarray(self.joachimsthal(states["q"], states["p"]))}
