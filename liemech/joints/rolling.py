"""Blades that glide and balls that roll: conditions on velocities, for a `NonholonomicBody`."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInput
from ..formulas import Mat, Vec, mat, record, vec
from ..rooms.constraints.constraint import VelocityConstraint


@record
class Blade(VelocityConstraint):
    """A knife edge under a body on a plane, SE(2) with velocities (w, v1, v2): it does not glide to
    its side, v2 - behind w = 0.

    behind : how far the blade is behind the centre of mass, along e1 of the body, in m.

    With a free body it is Chaplygin's sleigh; its condition is that of a velocity, in m/s.
    Source: Neimark and Fufaev, Dynamics of Nonholonomic Systems (1972), III.2; Bloch, Nonholonomic
    Mechanics and Control, 2nd ed., section 1.7.
    """

    behind: float = 0.0

    def matrix(self, g: Mat) -> Mat:
        """(-behind, 0, 1), (1, 3).  g : (3, 3)."""
        return mat(vec(-self.behind, 0.0, 1.0))


@record
class Rolling(VelocityConstraint):
    """A ball rolls on the plane x3 = 0 without gliding, on SO(3) x R^3 with velocities (w, v):
    v = (R w) x r e3, seen from space.

    radius : r, in m.  The third condition keeps the centre at its height.
    A ball whose centre of mass is its centre may be uneven otherwise: Chaplygin's ball.

    Source: Chaplygin, On a ball's rolling on a horizontal plane (1903), Regul. Chaotic Dyn. 7
    (2002).
    """

    radius: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.radius < np.inf:
            raise InvalidInput(f"Rolling: radius must be positive; got {self.radius!r}")

    def matrix(self, g: Vec) -> Mat:
        """v1 - r (R w)_2, v2 + r (R w)_1, v3, (3, 6).  g : the rows of R and the place, (12,)."""
        r = self.radius
        return mat(
            vec(-r * g[3], -r * g[4], -r * g[5], 1.0, 0.0, 0.0),
            vec(r * g[0], r * g[1], r * g[2], 0.0, 1.0, 0.0),
            vec(0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        )


@record
class Suslov(VelocityConstraint):
    """A body about a fixed point, on SO(3), whose angular velocity stays across an axis of the
    body, a . w = 0.

    axis : a, in the axes of the body, (3,), of any length.

    Source: Suslov, Theoretical Mechanics (1946), section 53; Fedorov and Kozlov, AMS Translations
    168 (1995).
    """

    axis: Vec = vec(0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.axis) != 3 or not any(self.axis):
            raise InvalidInput(f"Suslov: axis is a direction in the body, (3,); got {self.axis}")

    def matrix(self, g: Mat) -> Mat:
        """a as a row, (1, 3).  g : (3, 3)."""
        return mat(self.axis)
