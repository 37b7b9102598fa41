"""Forces at joints: springs, stops, dampers, motors, dry friction, and formulas of one's own."""

from __future__ import annotations

from dataclasses import field, replace
from math import pi
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType, undefined
from ..formulas import Element, Mat, Record, Vec, cross, derivative, dot, real_array, record, tanh, vec, vectors
from ..formulas.classes.derived import derived, derived_from
from ..formulas.classes.overriding import asked
from ..groups.lie_group import LieGroup
from ..groups.rigid.se3 import join
from ..systems.in_time.tabulated import PiecewisePolynomial
from ..systems.potential import Force, Potential
from .joints import Joint, both
from .points_and_axes import REST, REST6, turned


@record
class JointForce(Record):
    """A torque about the axis of a hinge, or a force along that of a slider, as a formula; abstract.

    joint : the name of a joint, or its number.  freedom : of joints that leave several motions free
    the number of one of them; None: every one of them alike.
    It acts on the first body of the joint, and with the opposite sign on the second.

    1. A subclass writes `effort`, as a formula.  Its fields are the parameters.
    2. It may say `about` which angle it looks: angles are then seen from half a turn below it to
    half a turn above it.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5 (active joint forces).
    """

    joint: Any
    freedom: int | None = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        name = type(self).__name__
        if type(self.joint) not in (str, int):
            raise InvalidType(f"{name}: joint is the name or the number of a joint; got {self.joint!r}")

    def effort(self, t: float, q: float, rate: float) -> float:
        """The torque in N m, or the force in N, at time t.  q : the angle in rad, or the shift in m;
        rate : q'.
        """
        raise undefined(self, "effort")

    @asked
    @derived_from("effort")
    def resistance(self, t: float, q: float, rate: float) -> float:
        """The damping -d effort/dq', in N m s/rad or N s/m, that an explicit kick has to resolve: half a step
        of it stays below the inertia.  For a torque that is bounded, such as friction of one's own, a
        subclass may say zero.
        """
        return -derivative(lambda r: self.effort(t, q, r), rate)

    def about(self, t: float) -> float:
        """The angle in the middle of the turn in which angles are seen; 0 by default."""
        return 0.0


@record
class JointPotential(JointForce):
    """A torque or force at a joint that comes from an energy of its angle or shift; abstract.

    1. A subclass writes `energy`, as a formula; `effort` is -dV/dq.

    Source: Goldstein, Classical Mechanics, 3rd ed., section 1.5.
    """

    def energy(self, q: float) -> float:
        """V(q), in J.  q : the angle in rad, or the shift in m."""
        raise undefined(self, "energy")

    @derived
    def effort(self, t: float, q: float, rate: float) -> float:
        """-dV/dq.  q : the angle in rad, or the shift in m."""
        return -derivative(lambda x: self.energy(x), q)


@record
class Spring(JointPotential):
    """A linear spring at a joint: V = k (q - rest)^2/2.

    stiffness : k, in N m/rad or N/m.  rest : where it is at ease, in rad or m.  Angles are seen
    within half a turn of the rest, where the torque jumps.  On a ball joint at rest 0 it is
    isotropic, V = k |rotation vector|^2/2.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
    """

    stiffness: float
    rest: float = 0.0

    def energy(self, q: float) -> float:
        """The energy k (q - rest)^2/2 of the spring."""
        return 0.5 * self.stiffness * (q - self.rest) * (q - self.rest)

    def about(self, t: float) -> float:
        """The coordinate at rest, in the middle of the turn in which angles are seen."""
        return self.rest


@record
class Stops(JointPotential):
    """Limits of a joint, as a smooth potential: V = k d^3/3, d the depth beyond a limit.

    low, high : the limits, in rad or m.  stiffness : k, in N m/rad^2 or N/m^2; a deeper stop is a
    softer one.  They lose no energy, and steps have to resolve the push.

    Source: Hunt and Crossley, J. Appl. Mech. 42 (1975), 440 (power laws of contact).
    """

    low: float
    high: float
    stiffness: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.low < self.high:
            raise InvalidInput(f"Stops: low must be below high; got {self.low} and {self.high}")

    def energy(self, q: float) -> float:
        """The energy k d^3/3 at the depth d behind a stop."""
        depth = max(q - self.high, 0.0) + max(self.low - q, 0.0)
        return self.stiffness * depth * depth * depth / 3.0

    def about(self, t: float) -> float:
        """Half way between the limits."""
        return 0.5 * (self.low + self.high)


@record
class Damper(JointForce):
    """Viscous friction in a joint: -c q'.

    damping : c, in N m s/rad or N s/m.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
    """

    damping: float

    def effort(self, t: float, q: float, rate: float) -> float:
        """The torque or force -c q' against the rate."""
        return -(self.damping * rate)


@record
class DryFriction(JointForce):
    """Dry friction in a joint, regularised: -T tanh(q'/speed).

    torque : T, in N m, or the force in N.  speed : in rad/s or m/s; far above it the friction is
    Coulomb's, below it is viscous, so that nothing sticks: it creeps.

    Source: Marques, Flores, Pimenta Claro and Lankarani, Nonlinear Dynamics 86 (2016), section 2.
    """

    torque: float
    speed: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.speed > 0.0:
            raise InvalidInput(f"DryFriction: speed must be positive; got {self.speed}")

    def effort(self, t: float, q: float, rate: float) -> float:
        """The torque or force -T tanh(q'/speed) against the rate."""
        return -(self.torque * tanh(rate / self.speed))

    def resistance(self, t: float, q: float, rate: float) -> float:
        """Zero: no kick is larger than that of T."""
        return 0.0


@record
class Motor(JointForce):
    """A motor at a joint, with a torque that does not ask how the joint moves; a controller is a
    JointForce of one's own.

    torque : in N m, or the force in N: a number, or a PiecewisePolynomial of the time.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
    """

    torque: Any

    def __post_init__(self) -> None:
        if not isinstance(self.torque, PiecewisePolynomial):
            number = real_array(self.torque, "Motor: torque")
            if number.ndim or not np.isfinite(number):
                raise InvalidInput(
                    f"Motor: torque is a number or a PiecewisePolynomial of the time; got {self.torque!r}"
                )
            object.__setattr__(self, "torque", float(number))
        elif self.torque.size:
            raise InvalidInput(f"Motor: the torque is one number at each time; got {self.torque!r}")
        super().__post_init__()

    def effort(self, t: float, q: float, rate: float) -> float:
        return self.torque(t) if isinstance(self.torque, PiecewisePolynomial) else self.torque


@record
class Limited(JointForce):
    """A motor or a controller that gives no more than it can: torques are cut at a limit, and fall to zero
    along the motion where it is as fast as the motor turns.

    given : the Motor, or a JointForce of one's own, at this joint.  limit : in N m or N, to either side.
    speed : in rad/s or m/s; None: any.  From nine tenths of it on, what drives the motion on
    fades; what brakes it does not.

    Source: Hughes and Drury, Electric Motors and Drives, 5th ed. (2019), section 4.3 (the region of torque
    and speed of a drive).
    """

    given: Any
    limit: float
    speed: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        force: Any = self.given
        if not isinstance(force, JointForce) or force.freedom != self.freedom or force.joint not in (self.joint, 0):
            raise InvalidType(
                "Limited: given is a JointForce such as Motor(0, 2.0), at the same joint and along the same "
                f"freedom; got {force!r} at joint {self.joint!r}"
            )
        for name in ("limit", "speed"):
            value = getattr(self, name)
            if not (value is None if name == "speed" else False) and not 0.0 < value < np.inf:
                raise InvalidInput(f"Limited: {name} must be positive; got {value!r}")
        object.__setattr__(self, "given", replace(self.given, joint=0))

    def effort(self, t: float, q: float, rate: float) -> float:
        """The effort of the motor, cut at its limits."""
        low, high = -self.limit, self.limit
        if self.speed is not None:
            forth = min(1.0, max(0.0, 10.0 * (1.0 - rate / self.speed)))
            back = min(1.0, max(0.0, 10.0 * (1.0 + rate / self.speed)))
            low, high = back * low, forth * high
        return max(low, min(high, self.given.effort(t, q, rate)))

    def resistance(self, t: float, q: float, rate: float) -> float:
        """The damping of the motor; zero where the torque is cut."""
        damping = self.given.resistance(t, q, rate)
        return damping if self.effort(t, q, rate) == self.given.effort(t, q, rate) else 0.0

    def about(self, t: float) -> float:
        """The middle of the turn in which the motor sees angles."""
        return self.given.about(t)


# ------------------------------------------------------------------ all of a linkage


def effort_of(force: Any, t: float, q: float, rate: float) -> float:
    """The torque or force of a JointForce."""
    return force.effort(t, q, rate)


def resistance_of(force: Any, t: float, q: float, rate: float) -> float:
    """The damping of a JointForce, by the rate of its effort."""
    return force.resistance(t, q, rate)


@record
class AtJoint(Record):
    """The forces at one joint."""

    joint: Any
    forces: tuple[Any, ...]

    def coordinates(self, force: Any, t: float, g: Vec) -> Vec:
        """The coordinates of the joint, in the turn about which a force looks."""
        q = self.angles(t, g)
        return seen_about(q, force.about(t), self.joint.angles) if len(self.joint.angles) > 0 else q

    def angles(self, t: float, g: Vec) -> Vec:
        """The coordinates, as the joint sees them at time t."""
        return self.joint.at_time(t).coordinates(*both(self.joint, g))

    def rates(self, t: float, g: Vec, xi: Vec) -> Vec:
        """The rates of the motions.  xi : of all bodies, (6 N,)."""
        return rates_of(self.joint.at_time(t), g, xi)

    def led(self, t: float, g: Vec, xi: Vec, multipliers: Vec) -> float:
        """The power that a given motion of the joint brings in: by conditions, lam . dc/dt, and by the forces at the
        joint, against which its support moves.
        """
        joint = self.joint.at_time(t)
        first, second = both(joint, g)
        efforts = self.efforts(t, g, self.rates(t, g, xi)) if len(self.forces) > 0 else ()
        by_conditions = [lam * pace for lam, pace in zip(multipliers, joint.paces(first, second))]
        by_forces = [-(effort * pace) for effort, pace in zip(efforts, joint.paces_of_motions(first, second))]
        return vectors.sum([*by_conditions, *by_forces])

    def drive(self, t: float, g: Vec, multipliers: Vec) -> Vec:
        """The torques or forces along the coordinates of a path, lam . dc/dq."""
        joint = self.joint.at_time(t)
        first, second = both(joint, g)
        return vec(*[dot(multipliers, vec(*row)) for row in joint.paces_by_coordinates(first, second)])

    def rotor(self, g: Vec, xi: Vec) -> Vec:
        """The momentum of the joint's rotor, as a part of that of the bodies, A q' along its motion."""
        push = self.joint.armature * rates_of(self.joint, g, xi)
        return pushed([(self.joint, self.joint.motions(*both(self.joint, g)), push)], len(xi))

    def missed(self, t: float, g: Mat, k: Mat) -> Vec:
        """The conditions of the joint, which are zero, at the poses of its bodies."""
        return self.joint.at_time(t).value(g, k)

    def slips(self, t: float, g: Mat, k: Mat, xi: Vec, eta: Vec) -> Vec:
        """The rates of the conditions, which are zero, at the velocities of the joint's bodies."""
        joint = self.joint.at_time(t)
        slips = vec(*[dot(first, xi) + dot(second, eta) for first, second in joint.rows(g, k)])
        paces = joint.paces(g, k)
        return slips + vec(*paces) if len(paces) > 0 else slips

    def wrench(self, t: float, g: Vec, multipliers: Vec) -> Vec:
        """The force of the conditions on the first body and their torque about its point, seen from
        space, (6,).  multipliers : of all conditions of the joint.
        """
        first, second = both(self.joint, g)
        total = REST6
        for lam, (row, _) in zip(multipliers, self.joint.at_time(t).rows(first, second)):
            total = total - lam * row
        at = getattr(self.joint, "at_first", REST)
        torque, force = total[:3], total[3:]
        return join(turned(first, force), turned(first, torque - cross(at, force)))

    def energy(self, g: Vec) -> float:
        """The sum of V, of JointPotentials."""
        at = [(force, self.coordinates(force, 0.0, g)) for force in self.forces]
        return vectors.sum([force.energy(q[i]) for force, q in at for i in acting(force, self.joint)])

    def efforts(self, t: float, g: Vec, rates: Vec, formula: Any = effort_of) -> Vec:
        """The torques or forces along all motions of the joint.  rates : (freedoms,).  formula : what is summed of the
        forces, `effort_of`, or `resistance_of` for the damping of each motion.
        """
        total = vec(*[0.0 for _ in range(self.joint.freedoms)])
        for force in self.forces:
            total = total + self.effort_at(force, t, self.coordinates(force, t, g), rates, formula)
        return total

    def effort_at(self, force: Any, t: float, q: Vec, rates: Vec, formula: Any = effort_of) -> Vec:
        """The efforts of one force along each motion, at the coordinates that it sees."""
        axes = acting(force, self.joint)
        efforts = vec(*[formula(force, t, q[i], rates[i]) if i in axes else 0.0 for i in range(self.joint.freedoms)])
        return self.joint.slopes(q, efforts) if isinstance(force, JointPotential) else efforts

    def push(self, t: float, g: Vec, rates: Vec) -> Any:
        """The joint, the rows of its motions, and the efforts along them."""
        motions = self.joint.at_time(t).motions(*both(self.joint, g))
        return self.joint, motions, self.efforts(t, g, rates)


def acting(force: Any, joint: Any) -> tuple[int, ...]:
    """The motions of a joint along which a force acts."""
    return tuple(range(joint.freedoms)) if force.freedom is None else (force.freedom,)


def seen_about(q: Vec, middle: float, angles: tuple[int, ...]) -> Vec:
    """Coordinates, angles modulo a turn to within half a turn of `middle`.

    angles : their numbers.
    """
    turns = [(x - middle + pi) // (2.0 * pi) if i in angles else 0.0 for i, x in enumerate(q)]
    return vec(*[x - 2.0 * pi * n if i in angles else x for i, (x, n) in enumerate(zip(q, turns))])


def rates_of(joint: Joint, g: Vec, xi: Vec) -> Vec:
    """The rates of a joint's motions.  xi : of all bodies, (6 N,)."""
    rates = vec(
        *[
            dot(by_first, body(xi, joint.first))
            if joint.second is None
            else dot(by_first, body(xi, joint.first)) + dot(by_second, body(xi, joint.second))
            for by_first, by_second in joint.motions(*both(joint, g))
        ]
    )
    paces = joint.paces_of_motions(*both(joint, g))
    return rates + vec(*paces) if len(paces) > 0 else rates


def body(xi: Vec, number: int) -> Vec:
    """The velocity of one body."""
    return xi[6 * number : 6 * number + 6]


def pushed(pushes: Any, dim: int) -> Vec:
    """The forces on all bodies, (dim,), of torques or forces along the motions of joints.

    pushes : of each the joint, the rows of its motions and the efforts.
    """
    parts = [REST6 for _ in range(dim // 6)]
    for joint, rows, efforts in pushes:
        for (by_first, by_second), effort in zip(rows, efforts):
            parts[joint.first] = parts[joint.first] + effort * by_first
            if joint.second is not None:
                parts[joint.second] = parts[joint.second] + effort * by_second
    return vec(*[x for part in parts for x in part])


@record
class LinkagePotential(Potential):
    """The energy of a linkage: weights, potentials at joints, and perhaps one of the user's.

    Source: Goldstein, Classical Mechanics, 3rd ed., section 1.3.
    """

    weights: Potential
    at_joints: tuple[Any, ...]
    other: Potential | None = None

    def energy(self, g: Vec) -> float:
        """The sum of the energies of weights, springs and the user's field."""
        total = vectors.sum([self.weights.energy(g), *[at_joint.energy(g) for at_joint in self.at_joints]])
        return total if self.other is None else total + self.other.energy(g)

    def force(self, group: LieGroup, g: Element) -> Vec:
        pushes = [at_joint.push(0.0, g, REST6) for at_joint in self.at_joints]
        total = self.weights.force(group, g) + pushed(pushes, group.dim)
        return total if self.other is None else total + self.other.force(group, g)


@record
class LinkageForce(Force):
    """Forces at joints that come from no energy, and perhaps a load of the user's."""

    at_joints: tuple[Any, ...]
    other: Force | None = None

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        """The sum of the forces of joints and of the user's load."""
        total = self.spread(t, self.efforts(t, self.rates_at(t, xi, g), g), g)
        return total if self.other is None else total + self.other.covector(t, xi, g)

    def rates(self, xi: Vec, g: Any) -> Vec:
        """The rates of the joints; all velocities if there is a load of the user's."""
        if self.other is not None:
            return xi
        return self.rates_at(0.0, xi, g)

    def rates_at(self, t: float, xi: Vec, g: Any) -> Vec:
        """The rates of the joints, as those in a given motion are at time t."""
        return vec(*[rate for at_joint in self.at_joints for rate in at_joint.rates(t, g, xi)])

    @property
    def by_rate(self) -> bool:
        """Whether all forces are of joints, none a load of the user's."""
        return self.other is None

    def efforts(self, t: float, rates: Vec, g: Any, formula: Any = effort_of) -> Vec:
        """The torques or forces along all motions of the joints, or of another `formula`."""
        efforts: list[Any] = []
        for at_joint in self.at_joints:
            begin = len(efforts)
            efforts = [*efforts, *at_joint.efforts(t, g, rates[begin : begin + at_joint.joint.freedoms], formula)]
        return vec(*efforts)

    def resistances(self, t: float, rates: Vec, g: Any) -> Vec:
        return self.efforts(t, rates, g, resistance_of)

    def resistance(self, t: float, xi: Vec, g: Any, along: Vec) -> Vec:
        rates = self.rates_at(t, xi, g)
        turned = self.rates_at(t, along, g) - self.rates_at(t, 0.0 * along, g)
        total = self.spread(t, self.resistances(t, rates, g) * turned, g)
        return total if self.other is None else total + self.other.resistance(t, xi, g, along)

    def spread(self, t: float, efforts: Vec, g: Any) -> Vec:
        """The forces on all bodies by these efforts along the motions of joints."""
        pushes: list[Any] = []
        begin = 0
        for at_joint in self.at_joints:
            end = begin + at_joint.joint.freedoms
            motions = at_joint.joint.at_time(t).motions(*both(at_joint.joint, g))
            pushes, begin = [*pushes, (at_joint.joint, motions, efforts[begin:end])], end
        return pushed(pushes, len(g) // 16 * 6)

    def at_rates(self, t: float, rates: Vec, g: Any) -> Vec:
        if self.other is None:
            return self.spread(t, self.efforts(t, rates, g), g)
        return self.covector(t, rates, g)
