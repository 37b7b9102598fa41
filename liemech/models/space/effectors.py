"""Effectors of a spacecraft: formulas of force and torque, with and without an energy."""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import undefined
from ...formulas import Mat, Record, Vec, gradient, record, vec
from ...formulas.classes.derived import derived
from ...formulas.classes.records import with_fields
from ...groups.rigid.so3 import SO3


@record
class Flight(Record):
    """Where a spacecraft is and how it moves, which a formula of force or torque may ask for.

    t : in s.  position, velocity : of the centre of mass in space, (3,), in m and m/s.
    attitude : R from body to space, (3, 3).  rate : the angular velocity in body axes, (3,), in
    rad/s.  speeds : of the wheels beside the body, (n,), in rad/s; None without wheels.
    mass : in kg.  inertia : of the whole about the centre of mass, (3,) or (3, 3), in kg m^2.
    """

    t: float
    position: Vec
    velocity: Vec
    attitude: Mat
    rate: Vec
    speeds: Vec | None
    mass: float
    inertia: Vec | Mat


@record
class PoseInSpace(Record):
    """Where a spacecraft is, which an energy may ask for, with mass and inertia as in a Flight."""

    position: Vec
    attitude: Mat
    mass: float
    inertia: Vec | Mat


@record
class Effector(Record):
    """A force and a torque on a spacecraft, as formulas of its flight.

    1. A subclass writes `force`, in space, or `torque`, about the centre of mass in body axes, or
    both; what is left out is zero.  Its fields are the parameters.

    Source: Schaub and Junkins, Analytical Mechanics of Space Systems, 4th ed., section 4.4.
    """

    def force(self, here: Any) -> Vec:
        """The force in space, (3,), in N.  here : the flight, with `t`, `position`, `velocity`,
        `attitude`, `rate`, `speeds`, `mass`, `inertia`.
        """
        return vec(0.0, 0.0, 0.0)

    def torque(self, here: Any) -> Vec:
        """The torque about the centre of mass in body axes, (3,), in N m.  here : the flight."""
        return vec(0.0, 0.0, 0.0)


@record
class ConservativeEffector(Record):
    """A force and a torque that follow from an energy of place and attitude, V(x, R).

    1. A subclass writes `energy`, as a formula.
    2. It may write `force` and `torque` in closed form; left out, they follow by differentiation,
    exact to rounding.
    3. It may say that turning spacecraft and orbit together about the origin (`central`), or about
    e3 (`axial`), leaves the energy alone: then their angular momentum is kept.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.7; for
    the symmetries Noether's theorem, section 11.4.
    """

    central: ClassVar[bool] = False
    axial: ClassVar[bool] = False

    def is_kept(self, symmetry: str) -> bool:
        """Whether `central` or `axial` holds: a class that writes another energy says it anew."""
        bases = type(self).__mro__
        says, writes = (next(k for k, base in enumerate(bases) if name in vars(base)) for name in (symmetry, "energy"))
        return says <= writes and bool(getattr(self, symmetry))

    def energy(self, here: Any) -> float:
        """V, in J.  here : the place, with `position`, `attitude`, `mass` and `inertia`."""
        raise undefined(self, "energy")

    @derived
    def force(self, here: Any) -> Vec:
        """The force in space, -dV/dx, (3,), in N.  here : the place."""
        return -gradient(lambda x: self.energy(with_fields(here, position=x)), here.position)

    @derived
    def torque(self, here: Any) -> Vec:
        """The torque in body axes, <torque, eta> = -d/ds V(x, R exp(s eta)), (3,), in N m.
        here : the place.
        """
        return -gradient(
            lambda eta: self.energy(with_fields(here, attitude=SO3().compose_exp(here.attitude, eta))),
            vec(0.0, 0.0, 0.0),
        )
