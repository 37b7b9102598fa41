"""Gravity as a potential: on a body with a fixed point, on a free one, and on one in orbit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Element, Mat, Vec, cross, dot, record, sqrt, vec
from ...groups.lie_group import LieGroup
from ...groups.rigid.se3 import join
from ...systems.kinetic_energy import times, trace
from ...systems.potential import Potential


@record
class FixedPointGravity(Potential):
    """The weight of a body with a fixed point, on SO(3): V(g) = w Gamma . c, with Gamma = g^T e3
    the vertical seen from the body.

    weight : w = m g, in N.  centre : c, the centre of mass seen from the fixed point in body axes,
    (3,), in m.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 15.10.
    """

    weight: float
    centre: Vec

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_load(self)

    def energy(self, g: Mat) -> float:
        """The potential energy w Gamma . c, Gamma the vertical in the body."""
        return self.weight * dot(g[2], self.centre)

    def force(self, group: LieGroup, g: Element) -> Vec:
        """The torque w Gamma x c."""
        return self.weight * cross(g[2], self.centre)

    def _shape(self, argument: str, kind: str) -> tuple[int, ...]:
        return (3, 3)

    def symmetry(self, group: LieGroup, mu: Any, g: Any) -> dict[str, Any]:
        """Turning about the vertical: the vertical momentum mu . Gamma."""
        return {"vertical momentum": group.K(g, mu)[..., 2]}


@record
class UniformGravity(Potential):
    """The weight of a body that moves freely, on SE(3): V(R, p) = w e3 . (p + R c).

    weight : w = m g, in N; of a body in water less its buoyancy.  centre : c, (3,), in m, where it
    acts in body axes.

    Source: Leonard, Stability of a bottom-heavy underwater vehicle, Automatica 33 (1997), section
    2.
    """

    weight: float
    centre: Vec = Vec(0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_load(self)

    def energy(self, g: Mat) -> float:
        """w times the height of the centre."""
        return self.weight * (g[2, 3] + dot(_vertical(g), self.centre))

    def force(self, group: LieGroup, g: Element) -> Vec:
        """(w Gamma x c, -w Gamma) with Gamma = R^T e3."""
        gamma = _vertical(g)
        return self.weight * join(cross(gamma, self.centre), -gamma)

    def _shape(self, argument: str, kind: str) -> tuple[int, ...]:
        return (4, 4)

    def symmetry(self, group: LieGroup, mu: Any, g: Any) -> dict[str, Any]:
        """Turning about the vertical, and moving horizontally."""
        m = group.K(g, mu)
        return {"vertical Pi": m[..., 2], "horizontal P": m[..., 3:5]}


@record
class CentralGravity(Potential):
    """The attraction of a rigid body by a point mass in the origin, up to second order in size over
    distance:

        V(R, x) = -k m/r - k/(2 r^3) (tr J - 3 u . J u),   r = |x|,   u = R^T x/r,   on ProductGroup(SO3(), VectorSpace(3)).

    attraction : k = G M of the point mass, in m^3/s^2.  mass : in kg.
    inertia : J about the body's centre of mass, (3,) or (3, 3), in kg m^2.

    The force follows from the energy; its torque is 3 k/r^3 u x J u.

    Source: MacCullagh's formula; Hughes, Spacecraft Attitude Dynamics, section 8.1; Lee, Leok,
    McClamroch, Comput. Methods Appl.  Mech. Eng. 196 (2007).
    """

    attraction: float
    mass: float
    inertia: Vec | Mat

    def energy(self, g: Vec) -> float:
        """The potential energy of the mass and of its distribution."""
        x = vec(g[9], g[10], g[11])
        r = sqrt(dot(x, x))
        u = vec(*[dot(vec(g[i], g[3 + i], g[6 + i]), x) for i in range(3)]) / r
        J = self.inertia
        return -(self.attraction / r) * (self.mass + (trace(J) - 3.0 * dot(u, times(J, u))) / (2.0 * r * r))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...]:
        return (12,)

    def symmetry(self, group: LieGroup, mu: Any, g: Any) -> dict[str, Any]:
        """Turning about the origin: the angular momenta of spin and orbit together, R Pi + x x p."""
        spin = np.einsum("...ij,...j->...i", g[..., :9].reshape(*g.shape[:-1], 3, 3), mu[..., :3])
        return {"angular momentum": spin + np.cross(g[..., 9:], mu[..., 3:])}


def _vertical(g: Any) -> Vec:
    """R^T e3, the vertical seen from the body."""
    return vec(g[2, 0], g[2, 1], g[2, 2])


def _check_load(owner: Any) -> None:
    """Refuse a weight or a centre that is not finite, or not a vector in space."""
    name = type(owner).__name__
    if len(owner.centre) != 3:
        raise InvalidInput(f"{name}: centre is a vector in space, (3,); got {len(owner.centre)} components")
    for what in ("weight", "centre"):
        value = getattr(owner, what)
        if not all(map(math.isfinite, value if what == "centre" else (value,))):
            raise InvalidInput(f"{name}: {what} must be finite; got {value}")
