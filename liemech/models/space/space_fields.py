"""Gravity of a planet in the origin, on the mass of a spacecraft and on its shape."""

from __future__ import annotations

from typing import Any, ClassVar

from ...formulas import Vec, cross, dot, record, sqrt, vec
from ...systems.kinetic_energy import times, trace
from ..input_checks import check_positive
from .effectors import ConservativeEffector


@record
class PointGravity(ConservativeEffector):
    """The attraction by a point mass in the origin, V = -k m/r.

    attraction : k = G M, in m^3/s^2; of the Earth 3.986004418e14.

    Source: Montenbruck and Gill, Satellite Orbits (2000), section 3.1.
    """

    central: ClassVar[bool] = True
    axial: ClassVar[bool] = True

    attraction: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "attraction")

    def energy(self, here: Any) -> float:
        """The potential energy -k m/r in the field."""
        x = here.position
        return -self.attraction * here.mass / sqrt(dot(x, x))

    def force(self, here: Any) -> Vec:
        """The force -k m x/r^3 in space."""
        x = here.position
        square = dot(x, x)
        return -(self.attraction * here.mass / (square * sqrt(square))) * x

    def torque(self, here: Any) -> Vec:
        return vec(0.0, 0.0, 0.0)


@record
class GravityGradient(ConservativeEffector):
    """The attraction of the shape of a body by a point mass in the origin, to second order in size
    over distance:

        V = -k/(2 r^3) (tr J - 3 u . J u),   u = R^T x/r;   its torque is 3 k/r^3 u x J u.

    The orbit feels the reaction.  With `PointGravity` it is `CentralGravity`.
    attraction : k = G M, in m^3/s^2.

    Source: MacCullagh's formula; Hughes, Spacecraft Attitude Dynamics, section 8.1.
    """

    central: ClassVar[bool] = True
    axial: ClassVar[bool] = True

    attraction: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "attraction")

    def energy(self, here: Any) -> float:
        """-k/(2 r^3) (tr J - 3 u . J u)."""
        x = here.position
        square, y = dot(x, x), here.attitude.T @ x
        shape = trace(here.inertia) - 3.0 * dot(y, times(here.inertia, y)) / square
        return -0.5 * self.attraction / (square * sqrt(square)) * shape

    def force(self, here: Any) -> Vec:
        """-3 k/r^4 ((tr J - 5 u . J u)/2 u + J u), turned into space."""
        x, R = here.position, here.attitude
        square, y = dot(x, x), R.T @ x
        turned = times(here.inertia, y)
        far = 3.0 * self.attraction / (square * square * sqrt(square))
        radial = 0.5 * trace(here.inertia) - 2.5 * dot(y, turned) / square
        return -far * (radial * x + R @ turned)

    def torque(self, here: Any) -> Vec:
        """3 k/r^3 u x J u."""
        x = here.position
        square, y = dot(x, x), here.attitude.T @ x
        far = 3.0 * self.attraction / (square * square * sqrt(square))
        return far * cross(y, times(here.inertia, y))


@record
class Oblateness(ConservativeEffector):
    """The attraction by the flattening of a planet, whose axis is e3:

        V = k m J2 a^2/(2 r^3) (3 z^2/r^2 - 1).

    attraction : k = G M, in m^3/s^2.  j2 : the coefficient, of the Earth 1.08262668e-3.
    radius : a, the equatorial radius that belongs to it, in m; of the Earth 6.3781363e6.

    Source: Montenbruck and Gill, Satellite Orbits (2000), section 3.2; the numbers are those of
    JGM-3, table 3.2.
    """

    axial: ClassVar[bool] = True

    attraction: float
    j2: float
    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "attraction", "radius")

    def energy(self, here: Any) -> float:
        """k m J2 a^2/(2 r^3) (3 z^2/r^2 - 1)."""
        x = here.position
        square = dot(x, x)
        whole = 0.5 * self.attraction * here.mass * self.j2 * self.radius * self.radius
        return whole / (square * sqrt(square)) * (3.0 * x[2] * x[2] / square - 1.0)

    def force(self, here: Any) -> Vec:
        """-(3/2) k m J2 a^2/r^5 (x (1 - 5 z^2/r^2), y (1 - 5 z^2/r^2), z (3 - 5 z^2/r^2))."""
        x = here.position
        square = dot(x, x)
        whole = 1.5 * self.attraction * here.mass * self.j2 * self.radius * self.radius
        part, s = whole / (square * square * sqrt(square)), 5.0 * x[2] * x[2] / square
        return part * vec((s - 1.0) * x[0], (s - 1.0) * x[1], (s - 3.0) * x[2])

    def torque(self, here: Any) -> Vec:
        """The torque, zero: the body counts as a point."""
        return vec(0.0, 0.0, 0.0)
