"""Drag, the pressure of sunlight, and magnetic torquers."""

from __future__ import annotations

import math
from typing import Any

from ...errors import InvalidInput
from ...formulas import Record, Vec, acos, asin, cos, cross, dot, exp, norm, record, sin, sqrt, vec, where
from ..input_checks import check_positive
from .effectors import Effector

SUN_RADIUS = 6.957e8
"""In m, the nominal solar radius.  Source: IAU 2015 Resolution B3."""
ASTRONOMICAL_UNIT = 1.495978707e11
"""In m.  Source: IAU 2012 Resolution B2."""


@record
class Drag(Effector):
    """The drag of a thin atmosphere that turns with its planet,

        F = -rho/2 C A |v_r| v_r,   v_r = v - spin e3 x x,   rho = density exp(-(r - radius)/height).

    area : C A, coefficient times cross-section, in m^2.  density : in kg/m^3, at this `radius` from
    the origin, in m.  height : over which it falls by e, in m.  spin : of the atmosphere about e3,
    in rad/s.  centre : where the force acts, from the centre of mass in body axes, (3,), in m.
    Another atmosphere is a subclass with its own `density_at`.

    Source: Montenbruck and Gill, Satellite Orbits (2000), section 3.5.
    """

    area: float
    density: float
    radius: float
    height: float
    spin: float = 0.0
    centre: Vec | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "radius", "height")
        _check_centre(self)

    def density_at(self, here: Any) -> float:
        """rho, in kg/m^3.  here : the flight."""
        return self.density * exp(-(norm(here.position) - self.radius) / self.height)

    def force(self, here: Any) -> Vec:
        """-rho/2 C A |v_r| v_r."""
        x, v = here.position, here.velocity
        wind = v - self.spin * vec(-x[1], x[0], 0.0)
        return (-0.5 * self.area * self.density_at(here) * norm(wind)) * wind

    def torque(self, here: Any) -> Vec:
        """The torque centre x R^T F about the centre of mass."""
        return _lever(self.centre, here, self.force(here))


@record
class SolarPressure(Effector):
    """The pressure of sunlight on a sphere or a plate that faces the Sun,

        F = -p A C (1 AU/d)^2 s/d,   s from the spacecraft to the Sun, d = |s|.

    area : C A, coefficient times cross-section, in m^2; C = 1 absorbs, 2 mirrors.  sun : where the
    Sun is, (3,), in m.  pressure : at 1 AU, in N/m^2.  centre : where the force acts, from the
    centre of mass in body axes, (3,), in m.  shade : the radius of the planet in the origin, in m,
    in whose shadow and penumbra the light fades; None for no shadow.
    A Sun that moves is a subclass with its own `sun_at`.

    Source: Montenbruck and Gill, Satellite Orbits (2000), sections 3.4, 3.4.2.
    """

    area: float
    sun: Vec
    pressure: float = 4.56e-6
    centre: Vec | None = None
    shade: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.sun) != 3 or not math.hypot(*self.sun) > 0.0:
            raise InvalidInput(
                f"SolarPressure: sun is the place of the Sun, (3,), in m, not the origin; got {[*self.sun]}"
            )
        if self.shade is not None:
            check_positive(self, "shade")
        _check_centre(self)

    def sun_at(self, t: Any) -> Vec:
        """The place of the Sun at time t, (3,), in m."""
        return self.sun

    def light(self, here: Any) -> float:
        """The part of the Sun's disc that is seen, 0 to 1.  here : the flight."""
        if self.shade is None:
            return 1.0
        return sunlight(here.position, self.sun_at(here.t), self.shade)

    def force(self, here: Any) -> Vec:
        """-p A C (1 AU/d)^2 s/d, less in the shadow."""
        s = self.sun_at(here.t) - here.position
        square = dot(s, s)
        whole = self.pressure * self.area * ASTRONOMICAL_UNIT * ASTRONOMICAL_UNIT
        return -(whole * self.light(here) / (square * sqrt(square))) * s

    def torque(self, here: Any) -> Vec:
        """The torque centre x R^T F about the centre of mass."""
        return _lever(self.centre, here, self.force(here))


def sunlight(x: Vec, sun: Vec, radius: float) -> float:
    """The part of the Sun's disc that is seen from x beside a sphere about the origin: overlapping
    discs of apparent radii a and b, c apart.  x, sun : (3,), radius : in m.

    Source: Montenbruck and Gill, Satellite Orbits (2000), equations 3.85 to 3.87, 3.92 to 3.94.
    """
    s = sun - x
    far, near = norm(s), norm(x)
    a, b = asin(SUN_RADIUS / far), asin(min(radius / near, 1.0))
    c = acos(max(-1.0, min(1.0, -dot(x, s) / (near * far))))
    partly = where(c < a + b, where(c > abs(a - b), 1.0, 0.0), 0.0) > 0.0
    apart = where(partly, c, a + b)
    along = max(-a, min(a, (apart * apart + a * a - b * b) / (2.0 * apart)))
    beyond = max(-b, min(b, apart - along))
    across = sqrt(max(a * a - along * along, 0.0))
    hidden = a * a * acos(along / a) + b * b * acos(beyond / b) - apart * across
    smaller = min(a, b)
    whole = where(c >= a + b, 0.0, math.pi * smaller * smaller)
    return 1.0 - where(partly, hidden, whole) / (math.pi * a * a)


@record
class DipoleField(Record):
    """The magnetic field of a dipole in the origin, B = strength/r^3 (3 (a . u) u - a), u = x/r.

    strength : mu0 |M|/(4 pi), in T m^3; of the Earth 7.7e15.  axis : a, the direction of the dipole
    at t = 0, a unit vector, (3,); that of the Earth points south.  spin : with which it turns about
    e3, in rad/s.

    Source: Jackson, Classical Electrodynamics, 3rd ed., equation 5.56; Wertz, Spacecraft Attitude
    Determination and Control, appendix H.
    """

    strength: float
    axis: Vec = Vec(0.0, 0.0, -1.0)
    spin: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_directions("DipoleField: axis", [self.axis])

    def at(self, t: Any, x: Vec) -> Vec:
        """B in space, (3,), in T.  x : (3,), in m."""
        a, angle = self.axis, self.spin * t
        c, s = cos(angle), sin(angle)
        a = vec(c * a[0] - s * a[1], s * a[0] + c * a[1], a[2])
        square = dot(x, x)
        return (self.strength / (square * sqrt(square))) * ((3.0 * dot(a, x) / square) * x - a)


@record
class MagneticTorquers(Effector):
    """Coils in a magnetic field: the torque m x B, B in body axes.

    field : a record with `at(t, x)`, the field in space, such as DipoleField.  moment : m, (3,), in
    A m^2.  limit : of each component, in A m^2.
    A law of control is a subclass with its own `moment_at`.

    Source: Wertz, Spacecraft Attitude Determination and Control, section 18.3.
    """

    field: Any
    moment: Vec = Vec(0.0, 0.0, 0.0)
    limit: float | None = None

    def moment_at(self, here: Any, B: Vec) -> Vec:
        """The moment that is asked for, (3,), in A m^2.  here : the flight.  B : the field in body axes, (3,), in T."""
        return self.moment

    def torque(self, here: Any) -> Vec:
        """m x B, m within the limit."""
        B = here.attitude.T @ self.field.at(here.t, here.position)
        m = self.moment_at(here, B)
        if self.limit is not None:
            m = vec(*[max(-self.limit, min(self.limit, x)) for x in m])
        return cross(m, B)


def _lever(centre: Any, here: Any, force: Vec) -> Vec:
    """The torque of a force in space that acts at a place in the body."""
    if centre is None:
        return vec(0.0, 0.0, 0.0)
    return cross(centre, here.attitude.T @ force)


def _check_centre(owner: Any) -> None:
    if owner.centre is not None and len(owner.centre) != 3:
        raise InvalidInput(f"{type(owner).__name__}: centre is a place in body axes, (3,); got {[*owner.centre]}")


def require_directions(name: str, rows: Any) -> None:
    """Raise InvalidInput for vectors that are no unit vectors in space."""
    for a in rows:
        length = math.hypot(*a) if len(a) == 3 else 0.0
        if not abs(length - 1.0) <= 1e-9:
            raise InvalidInput(f"{name} must be of length 1 in space; got {[*a]}: divide it by its length")
