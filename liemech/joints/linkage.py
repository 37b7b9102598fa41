"""Rigid bodies held together by joints: chains, linkages, mechanisms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..errors import InconsistentState, InvalidInput, InvalidType, NoConvergence
from ..formulas import Element, Vec, check_finite, dot, real_array, record, vec, vectors
from ..formulas.calls.arguments import ordinary
from ..formulas.classes.derived import is_derived
from ..formulas.classes.records import with_fields
from ..formulas.numbers.anything import indices_in, traced
from ..formulas.vectors import small
from ..groups.composed.product import ProductGroup
from ..groups.lie_group import LieGroup
from ..groups.rigid.se3 import SE3
from ..names import meant
from ..rooms.constraints.constrained_body import CONSISTENT, ConstrainedBody
from ..simulation.compiled.systems import Systems
from ..systems.kinetic_energy import KineticEnergy
from ..systems.lie_poisson import BodyState, LiePoissonSystem
from ..systems.mechanical import MechanicalSystem
from ..systems.potential import Potential
from .body_forces import of_bodies
from .given_motion import MovedJoint, MovingSupport, moved, require_motion
from .in_memory.links import LinkedBodies
from .joint_forces import (
    AtJoint,
    JointForce,
    JointPotential,
    Limited,
    LinkageForce,
    LinkagePotential,
    Stops,
    acting,
    rates_of,
)
from .joint_motion import JointAngle, JointMotion, LinkMotion, OfMembers
from .joint_space import JointSpace, joint_space_of
from .joints import BallJoint, Joint, Joints, Mimic, RevoluteJoint, WithRotors, both
from .link import Frame, Link, LinkShape, number_of
from .linked_joints import LinkedForm, linked
from .mounting import (
    MISSED,
    closed,
    hangs,
    hung_from_each_other,
    hung_velocities,
    independent_rows,
    rows_of_motions,
    velocity_with,
)
from .urdf import linkage_of

SURVIVES = 1e-9
"""A motion of space that changes conditions and energy by no more than this part of what others do
is a symmetry.
"""


ASKEW = 1.0
"""Joints whose bodies are turned farther from where it holds them, in rad, are turned over: conditions vanish
again at a third of a turn.
"""

SHOWN = 12
"""Joints whose conditions have lines of their own in the structure report."""


@record
class Weights(Potential):
    """The weight of several bodies, V = sum w_b e3 . p_b, on a product of SE(3)s.

    weights : w_b = m_b g, (N,), in N.
    Source: Goldstein, Classical Mechanics, 3rd ed., section 1.3.
    """

    weights: Vec

    def energy(self, g: Vec) -> float:
        """The sum of the weights times the heights of the bodies."""
        return vectors.sum([self.weights[b] * g[16 * b + 11] for b in range(len(self.weights))])

    def force(self, group: LieGroup, g: Element) -> Vec:
        """(0, -w R^T e3) of each body."""
        return vec(
            *[
                x
                for b, w in enumerate(self.weights)
                for x in (0.0, 0.0, 0.0, *[-(w * g[16 * b + 8 + j]) for j in range(3)])
            ]
        )


AT_REST = 2.0**-40
"""Velocities below this part of what forces give are rounding."""


@record
class Linkage(ConstrainedBody):
    """Rigid bodies held together by joints, under gravity; they may form closed loops.

    links : the bodies, numbered from 0 on.  joints : such as BallJoint(0, 1, at_first, at_second);
    None is the ground.
    gravity : in m/s^2, downwards along e3.
    forces : at joints: springs, dampers, motors, such as Spring("elbow", 3.0).  potential, load :
    a Potential and a Force on SE(3) of single bodies, by names or numbers, {"hand": Drag(0.1)}; or
    one of all bodies together, a formula of all g and xi.
    motions : that are given: {"hinge": Shaking([0.0, 0.0, 0.1], 50.0)}, a MovingSupport, moves the place
    that holds a joint; {"crank": plan}, a JointPath or a PiecewisePolynomial of the time, is followed by its
    coordinates; {None: ...} moves the ground, with all joints at it.
    mimics : joints that follow others by gears, Mimic("left", "right", -1.0); the rotor of their motor, the
    armature of the one that leads, ties them.
    kept : the conditions of each joint that count, as `independent` finds them; None: all.
    frames : that are fixed in links, such as that of a tool; `frame` tells where they are.  shapes :
    by which links are shown; without them they are boxes.
    g, (16 N,), are the poses [[R, p], [0, 1]] of the centres of mass, row by row; `assembled` makes
    a start of poses, and `poses` poses of g.  mu, (6 N,), are the angular and linear momenta of
    each body in its own axes.

    Each motion of space that leaves joints and gravity as they are keeps its momentum: `constants`
    finds them.
    Raises InvalidInput for joints of bodies that are not there.

    Source: Leyendecker, Ober-Bloebaum, Marsden and Ortiz, Optim. Control Appl. Methods 31 (2010);
    Lee, Leok and McClamroch, Global Formulations of Lagrangian and Hamiltonian Dynamics on
    Manifolds (2018), chapter 9.
    """

    small: ClassVar[int] = 12  # of two bodies: more step by loops over bodies and joints

    _cure: ClassVar[str] = ", as `linkage.independent(poses)` does"

    body: Any = field(init=False, repr=False)
    constraint: Joints = field(init=False, repr=False)
    rotors: tuple[int, ...] = field(init=False, repr=False)
    links: tuple[Any, ...]
    joints: tuple[Any, ...]
    gravity: float = 9.80665
    forces: tuple[Any, ...] = ()
    potential: Any = field(default=None, kw_only=True, repr=False)
    load: Any = field(default=None, kw_only=True, repr=False)
    motions: Any = field(default=(), kw_only=True, repr=False)
    mimics: tuple[Any, ...] = field(default=(), kw_only=True, repr=False)
    kept: tuple[tuple[int, ...], ...] | None = field(default=None, kw_only=True, repr=False)
    frames: tuple[Frame, ...] = field(default=(), kw_only=True, repr=False)
    shapes: tuple[LinkShape, ...] = field(default=(), kw_only=True, repr=False)

    def __post_init__(self) -> None:
        linkage: Any = self
        for name, items, kind in (("links", linkage.links, Link), ("joints", linkage.joints, Joint)):
            if not isinstance(items, (list, tuple)) or not items or not all(isinstance(x, kind) for x in items):
                raise InvalidType(f"Linkage: {name} is a list of one or more {kind.__name__}s; got {items!r}")
        links, joints = tuple(self.links), tuple(self.joints)
        for what, fixed in (("frames", Frame), ("shapes", LinkShape)):
            value = getattr(self, what)
            if not isinstance(value, (list, tuple)) or not all(isinstance(x, fixed) for x in value):
                raise InvalidType(f"Linkage: {what} is a list of {fixed.__name__}s; got {value!r}")
            if not all(x.body is None or 0 <= x.body < len(links) for x in value):
                raise InvalidInput(
                    f"Linkage: {what} name bodies that are not there; there are {len(links)}, numbered from 0"
                )
            object.__setattr__(self, what, tuple(value))
        if not any(joint.conditions for joint in joints):
            raise InvalidInput(
                "Linkage: no joint takes away a freedom; a body that moves freely is no linkage: the first is "
                f"lm.models.FallingBody({np.array(links[0].inertia).tolist()}, {links[0].mass!r})"
            )
        for joint in joints:
            for number in (joint.first, joint.second):
                if number is not None and not (type(number) is int and 0 <= number < len(links)):
                    raise InvalidInput(
                        f"Linkage: {joint!r} holds body {number}; there are {len(links)}, numbered from 0"
                    )
        _require_unlike("links", links)
        _require_unlike("joints", joints)
        object.__setattr__(self, "links", links)
        object.__setattr__(self, "joints", joints)
        joints = self._moved()
        object.__setattr__(self, "joints", joints)
        self._mesh()
        springs, others = self._at_joints()
        group = ProductGroup(*[SE3()] * len(links))
        free = LiePoissonSystem(group, KineticEnergy(_inertia(links)))
        energy: Any = Weights([link.mass * self.gravity for link in links])
        for name in ("potential", "load"):
            value = of_bodies(name, getattr(linkage, name), lambda x: number_of(links, x, "link"))
            object.__setattr__(self, name, value)
        potential, load = linkage.potential, linkage.load
        if springs or potential is not None:
            energy = LinkagePotential(energy, springs, potential)
        if others:
            load = LinkageForce(others, load)
        object.__setattr__(self, "body", MechanicalSystem(free, energy, load=load))
        object.__setattr__(self, "constraint", Joints(joints, self.kept))
        super().__post_init__()

    def _moved(self) -> tuple[Any, ...]:
        """The joints in their given motions."""
        motions: Any = self.motions
        if isinstance(motions, Mapping):
            motions = tuple(motions.items())
        if not isinstance(motions, tuple) or not all(isinstance(pair, tuple) and len(pair) == 2 for pair in motions):
            raise InvalidType(f'Linkage: motions are given by joint, such as {{"crank": plan}}; got {self.motions!r}')
        object.__setattr__(self, "motions", motions)
        if any(isinstance(joint, MovedJoint) for joint in self.joints):  # of another linkage
            return self.joints
        supports: dict[int, Any] = {}
        paths: dict[int, Any] = {}
        for name, motion in motions:
            require_motion("None" if name is None else name, motion)
            support = isinstance(motion, MovingSupport)
            numbers = [number_of(self.joints, name)] if name is not None else [
                j for j, joint in enumerate(self.joints) if joint.second is None
            ]  # fmt: skip
            if name is None and not support:
                raise InvalidType(f"Linkage: the ground moves by a MovingSupport; got {motion!r}")
            for j in numbers:
                if j in (supports if support else paths):
                    raise InvalidInput(f"Linkage: two motions are given for {self.label(j)}")
                (supports if support else paths)[j] = motion
        return tuple(
            moved(joint, supports.get(j), paths.get(j), self.label(j)) if j in supports or j in paths else joint
            for j, joint in enumerate(self.joints)
        )

    @property
    def geared(self) -> bool:
        """Whether rotors turn with joints."""
        return len(self.rotors) > 0

    @property
    def _rotors(self) -> tuple[Any, ...]:
        """The joints that have an armature."""
        return tuple([self.joints[i] for i in self.rotors])

    @cached_property
    def _with_rotors(self) -> ConstrainedBody:
        """The bodies with the conditions by which rotors turn with joints, for accelerations."""
        with_rotors: Any = WithRotors
        rotors: list[Any] = [((self.joints[j], 1.0),) for j in self.rotors]
        light = [self.lightness[j] for j in self.rotors]
        for place, j in enumerate(self.rotors):
            for follower, leader, ratio, _ in self._meshed:
                if j == follower:
                    rotors[place] = ((self.joints[j], 1.0), (self.joints[leader], -ratio))
                    light[place] = 0.0
        return ConstrainedBody(self.body, with_rotors(self.constraint, tuple(rotors), light))

    @property
    def _meshed(self) -> list[tuple[int, int, float, float]]:
        """The numbers of each Mimic's joint and of its leader, ratio and offset."""
        return [(self.number(m.joint), self.number(m.leader), m.ratio, m.offset) for m in self.mimics]

    @property
    def _turns(self) -> dict[int, tuple[int, float]]:
        """The rotor of each joint that has one, by the number of the joint that leads, and its ratio."""
        led = {j: (leader, ratio) for j, leader, ratio, _ in self._meshed}
        return {j: led.get(j, (j, 1.0)) for j in self.rotors}

    @property
    def _heavy(self) -> dict[int, float]:
        """The armature of each rotor as the leading joint feels it."""
        total: dict[int, float] = {}
        for j, (leader, ratio) in self._turns.items():
            total[leader] = total.get(leader, 0.0) + ratio * ratio * self.joints[j].armature
        return total

    @property
    def lightness(self) -> dict[int, float]:
        """The rate that each joint with a rotor gains by a unit impulse along it."""
        heavy = self._heavy
        return {j: ratio * ratio / heavy[leader] for j, (leader, ratio) in self._turns.items()}

    @property
    def meshes(self) -> dict[tuple[int, int], float]:
        """The rate that a joint gains by a unit impulse along another one that shares its rotor."""
        turns, heavy = self._turns, self._heavy
        return {
            (j, k): a * b / heavy[leader]
            for j, (leader, a) in turns.items()
            for k, (other, b) in turns.items()
            if j != k and leader == other
        }

    def energy(self, mu: Vec, g: Element) -> float:
        """H(mu) + V(g), and A q'^2/2 of rotors.  mu : (6 N,), g : (16 N,)."""
        total, xi = self.body.energy(mu, g), self.velocity(mu)
        for joint in self._rotors:
            rate = rates_of(joint, g, xi)[0]
            total = total + 0.5 * joint.armature * rate * rate
        return total

    def multipliers(self, mu: Vec, g: Element, t: float = 0.0) -> Vec:
        """The multipliers of the conditions, as of a ConstrainedBody, with rotors that are sped up too."""
        if not self.geared:
            return super().multipliers(mu, g, t)
        return self._with_rotors.multipliers(mu, g, t)[: self.conditions]

    def rate(self, t: float, state: BodyState) -> Vec:
        """The velocity on T*G, by index reduction, with rotors that are sped up too."""
        return self._with_rotors.rate(t, state) if self.geared else super().rate(t, state)

    def at_time(self, t: float) -> Linkage:
        """The linkage with its given motions frozen at time t."""
        frozen = super().at_time(t)
        return with_fields(frozen, joints=frozen.constraint.joints) if self.rheonomic else self

    @classmethod
    def from_urdf(
        cls,
        path: Any,
        *,
        floating: bool = False,
        at: Any = None,
        gravity: float = 9.80665,
        forces: Any = (),
        stops: float | None = None,
        speed: float = 0.01,
        packages: Mapping[str, Any] | None = None,
        limits: bool = False,
        armature: Any = None,
    ) -> Linkage:
        """The robot of a URDF file.  Its joints have the names of the file; links that are fixed to
        each other are one body, with the name of the one that moves; all links are `frames`, and their
        visual geometry `shapes`.

        path : of the file, or its text.  floating : the root moves freely, by a FloatingJoint of its
        name, or "name root" where a joint has it; else it is the ground.  at : the pose of the root, (4, 4).
        forces : more of them, such as motors.  Damping of the file is a Damper, friction a DryFriction
        regularised at `speed`, in rad/s or m/s; limits are Stops of the stiffness `stops`, in N m/rad^2
        or N/m^2, or left out.
        packages : folders of package://name by their names; others are looked for above the file and
        in ROS_PACKAGE_PATH.
        limits : motors and controllers in `forces` are `Limited` by the efforts and velocities of the file.
        armature : of the joints, in kg m^2 or kg, {"elbow": 0.8}, or one number for all; else that of
        Drake's rotor_inertia and gear_ratio in the transmissions of the file, if they are there.
        Angles are those of the file: frames of all bodies are parallel to space where they are zero.
        Raises InvalidInput, with the line, for what is wrong in the file, and for mimic joints
        without a rotor that drives them.
        Warns of meshes that are not there, of shapes and colours that are wrong, which are left out, and of
        inertias that no body has.

        Source: the URDF specification of ROS, wiki, "urdf/XML".
        """
        arguments = linkage_of(
            path, floating=floating, at=at, stops=stops, speed=speed, packages=packages,
            forces=forces, limits=limits, armature=armature,
        )  # fmt: skip
        return cls(**arguments, gravity=gravity)

    def _mesh(self) -> None:
        """Set `rotors`, the joints with rotors.  Raises InvalidInput for Mimics that cannot be."""
        heavy = {j for j, part in enumerate(self.joints) if part.geared and part.armature > 0.0}
        if not all(isinstance(part, Mimic) for part in self.mimics):
            raise InvalidType(
                f'Linkage: mimics is a list of Mimics such as Mimic("left", "right", -1.0); got {self.mimics!r}'
            )
        object.__setattr__(self, "mimics", tuple(self.mimics))
        followers = [j for j, *_ in self._meshed]
        for j, leader, ratio, _ in self._meshed:
            for number in (j, leader):
                if isinstance(self.joints[number], MovedJoint):
                    raise InvalidInput(
                        f"Linkage: {self.label(number)} is in a given motion, and can neither follow another joint nor lead it"
                    )
                if not self.joints[number].geared:
                    raise InvalidInput(
                        f"Linkage: {self.label(number)} is no hinge or slider, which alone may follow another "
                        "joint, or lead it"
                    )
            if leader in followers or j == leader or followers.count(j) > 1 or ratio == 0.0:
                raise InvalidInput(
                    f"Linkage: {self.label(j)} follows {self.label(leader)}, which follows another joint or "
                    "itself, or it follows two of them, or does not move; let all follow one that leads"
                )
            of_leader = [k for k, other, *_ in self._meshed if other == leader]
            if not heavy & {leader, *of_leader}:
                raise InvalidInput(
                    f"Linkage: {self.label(j)} follows {self.label(leader)} by gears, and their motor has no "
                    f"rotor: give {self.label(leader)} an armature, in kg m^2 or kg; of a URDF file, "
                    f"from_urdf(armature={{{self.joints[leader].name!r}: ...}})"
                )
            heavy |= {leader, j}
        object.__setattr__(self, "rotors", tuple(sorted(heavy)))

    def _at_joints(self) -> tuple[tuple[AtJoint, ...], tuple[AtJoint, ...]]:
        """The forces joint by joint: those with a potential, and the others."""
        forces: Any = self.forces
        if not isinstance(forces, (list, tuple)):
            raise InvalidType(f"Linkage: forces is a list of JointForces; got {forces!r}")
        kinds: tuple[dict[int, list[Any]], dict[int, list[Any]]] = {}, {}
        for force in forces:
            if not isinstance(force, JointForce):
                raise InvalidType(
                    "Linkage: forces are JointForces such as Damper(0, 0.1), and a Force on the "
                    f"bodies is load=; got {force!r}"
                )
            number = number_of(self.joints, force.joint)
            joint, freedom = self.joints[number], force.freedom
            if joint.freedoms == 0:
                raise InvalidInput(
                    f"Linkage: {force!r} acts at {self.label(number)}, a "
                    f"{type(joint).__name__}, which has no coordinates to act along"
                )
            if freedom is not None and not 0 <= freedom < joint.freedoms:
                raise InvalidInput(
                    f"Linkage: {force!r} acts along freedom {freedom} of {self.label(number)}; "
                    f"a {type(joint).__name__} has {joint.freedoms}, numbered from 0"
                )
            _require_of_place(force)
            _require_angles_told_apart(force, joint, self.label(number))
            kinds[not self._has_potential(force)].setdefault(number, []).append(force)
        springs, others = (tuple(AtJoint(self.joints[j], tuple(kind[j])) for j in sorted(kind)) for kind in kinds)
        return springs, others

    def _has_potential(self, force: JointForce) -> bool:
        """Whether the energy of a force is part of that of the linkage, as it is not at joints in a given motion, nor of a
        force that looks about an angle that moves.
        """
        joint = self.joints[number_of(self.joints, force.joint)]
        if not isinstance(force, JointPotential) or isinstance(joint, MovedJoint):
            return False
        middle, why = traced(lambda t: force.about(t[0]), [1])
        return not why and not indices_in(middle)

    def number(self, joint: str | int) -> int:
        """The number of a joint that is given by its name, or by its number."""
        return number_of(self.joints, joint)

    def parameter_of_joint(self, name: str) -> list[str]:
        """The full names of parameters of the forces at a joint, such as "forces.0.torque", that a
        name as "elbow.torque" may mean.
        """
        joint, _, field = name.partition(".")
        numbers = [i for i, other in enumerate(self.joints) if other.name == joint]
        return [
            f"forces.{k}.{field}"
            for k, force in enumerate(self.forces)
            if number_of(self.joints, force.joint) in numbers and hasattr(force, field)
        ]

    def label(self, joint: int) -> str:
        """A joint, in messages: by its name if it has one."""
        name = self.joints[joint].name
        return f"joint {joint}" if name is None else f"joint {name!r}"

    def strongest_damper(self, t: float, xi: Any, g: Any, mode: Any) -> str:
        """The joint whose forces damp a motion most, or the load, in words.  xi, mode : (6 N,)."""
        load = self.body.load
        if not isinstance(load, LinkageForce):
            return super().strongest_damper(t, xi, g, mode)
        largest, damper = 0.0, "the load on the bodies"
        if load.other is not None:
            largest = dot(mode, load.other.resistance(t, xi, g, mode))
        for at_joint in load.at_joints:
            alone = dot(mode, LinkageForce((at_joint,)).resistance(t, xi, g, mode))
            if alone > largest:
                number = next(j for j, (joint, _) in enumerate(self.constraint.counted) if joint is at_joint.joint)
                largest, damper = alone, self.label(number)
        return damper

    # ---------------------------------------------------------------- many bodies

    @cached_property
    def linked(self) -> LinkedForm:
        """The form in which any number of bodies steps, joint by joint."""
        return linked(self)

    @property
    def has_loops(self) -> bool:
        """Whether joints, the ground among what they hold, close loops."""
        return self.linked.has_loops

    @property
    def site_form(self) -> LinkedBodies | None:
        """The site form of many bodies, or of those in a given motion; None for few."""
        is_large = 6 * len(self.links) > self.small or self.rheonomic or self.geared
        return self.linked.links if is_large else None

    def by_site(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """Parts of states with an axis of places, of which some have no body."""
        if self.site_form is None or arrays["g"].shape[-2:] == (4, 4):
            return arrays
        places, count = self.linked.places, len(self.links)
        lead = np.shape(arrays["mu"])[:-1]
        mu, g = np.zeros((*lead, places, 6)), np.zeros((*lead, places, 4, 4))
        g[:] = np.eye(4)
        mu[..., :count, :] = np.reshape(arrays["mu"], (*lead, count, 6))
        g[..., :count, :, :] = np.reshape(arrays["g"], (*lead, count, 4, 4))
        return {"mu": mu, "g": g}

    def as_users_see(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """The inverse of `by_site`: bodies in a row, without spare places."""
        in_a_row, count = {}, len(self.links)
        for name, x in arrays.items():
            if name == "mu" and x.shape[-1:] == (6,) and x.ndim > 1:
                x = x[..., :count, :].reshape(*x.shape[:-2], 6 * count)
            elif name == "g" and x.shape[-2:] == (4, 4):
                x = x[..., :count, :, :].reshape(*x.shape[:-3], 16 * count)
            in_a_row[name] = x
        return in_a_row

    # ---------------------------------------------------------------- poses

    def assembled(self, poses: Any, velocities: Any = None, *, t: float = 0.0) -> BodyState:
        """The consistent start nearest to the poses and velocities of the bodies.

        poses : (N, 4, 4).  velocities : body velocities (w, v), (N, 6), in rad/s and m/s; at rest
        if left out.  t : when, for motions that are given.
        """
        if self.rheonomic and t != 0.0:
            return self.at_time(t).assembled(poses, velocities)
        count = len(self.links)
        g = real_array(poses, "Linkage.assembled: poses")
        xi = np.zeros((count, 6)) if velocities is None else real_array(velocities, "Linkage.assembled: velocities")
        for name, array, shape in (("poses", g, (count, 4, 4)), ("velocities", xi, (count, 6))):
            if array.shape != shape:
                raise InvalidInput(f"Linkage.assembled: {name} has shape {array.shape}; {count} bodies have {shape}")
        mu = np.array(self.body.body.lagrangian.momentum(xi.reshape(6 * count)))
        return self.consistent(mu, g.reshape(16 * count))

    def _nearest(self, start: Any) -> Any:
        """The poses on the constraint nearest to these, joint by joint as its bodies are to be held; where
        they are not reached from here, looked for from poses of which each hangs from another one.
        """
        at_rest = np.zeros(self.configurations.dim)
        nearest = self._reached_from(start, at_rest)
        if nearest is None or self.turned_over(nearest):
            q = {
                j: np.array(joint.coordinates(*both(joint, start)))
                for j, joint in enumerate(self.joints)
                if joint.freedoms
            }
            hung = small(hung_from_each_other(self, q, self.poses(start)).ravel())
            away = self.configurations.log(self.configurations.compose(self.configurations.inverse(start), hung))
            nearest = self._reached_from(start, np.array(away))
            if nearest is None or self.turned_over(nearest):
                nearest = self._reached_from(hung, at_rest)
        if nearest is None:
            self._refuse_far(start)
        if complaint := self.turned_over(nearest):
            raise NoConvergence(
                f"{type(self).__name__}: only poses were found near by at which {complaint}; give poses that are closer"
            )
        return nearest

    def turned_over(self, g: Any) -> str:
        """Which joint is closed with its bodies turned over, in words; empty if none is.  g : (16 N,)."""
        for number, joint in enumerate(self.constraint.joints):
            angle = float(joint.askew(*both(joint, g)))
            if angle > ASKEW:
                return (
                    f"{self.label(number)}, a {type(getattr(joint, 'joint', joint)).__name__}, has its bodies turned over, "
                    f"by {np.degrees(angle):.0f} degrees from where it holds them"
                )
        return ""

    def _require_consistent(self, mu: Any, g: Any) -> None:
        """Raise InconsistentState as of a ConstrainedBody, and for bodies that are turned over."""
        super()._require_consistent(mu, g)
        if complaint := self.turned_over(g):
            raise InconsistentState(
                f"{type(self).__name__}.state: {complaint}, where its conditions vanish too. `assembled(poses)` gives a start"
            )
        missed = self._gears(g) @ np.array(self.velocity(mu))
        for miss, reach, (j, leader, ratio, _) in zip(missed, self._reach_of(self._gears(g), mu, g), self._meshed):
            if abs(miss) > CONSISTENT * reach:
                raise InconsistentState(
                    f"{type(self).__name__}.state: {self.label(j)} moves {ratio:g} times as fast as {self.label(leader)}, and "
                    f"these velocities miss it by {miss:.3g}. `assembled(poses, velocities)` gives a start"
                )

    def _gears(self, g: Any) -> np.ndarray:
        """The rows of joints that follow others, (k, 6 N): velocities at which they follow are zeros of them."""
        followers, leaders, ratios = ([mesh[i] for mesh in self._meshed] for i in range(3))  # type: Any, Any, Any
        return rows_of_motions(self, g, followers) - np.reshape(ratios, (-1, 1)) * rows_of_motions(self, g, leaders)

    def _projected(self, momentum: np.ndarray, g: Any) -> np.ndarray:
        """The nearest momentum at which gears turn as they must, too."""
        momentum = super()._projected(momentum, g)
        if not self.mimics:
            return momentum
        rows, inverse = (
            x.toarray() if hasattr(x, "toarray") else x for x in (self._matrix(self.rows(g)), self._inverse)
        )
        rows = np.concatenate([rows, self._gears(g)]) @ (root := np.linalg.cholesky(inverse))
        rates_off = np.concatenate([np.zeros(len(rows) - len(self.mimics)), self._gears(g) @ inverse @ momentum])
        return momentum - np.linalg.solve(root.T, np.linalg.lstsq(rows, rates_off, rcond=None)[0])

    def state(
        self,
        mu: Any = None,
        g: Any = None,
        *,
        xi: Any = None,
        angles: Any = None,
        rates: Any = None,
        near: Any = None,
        t: float = 0.0,
    ) -> BodyState:
        """A start for `integrate`: of momenta and poses as `ConstrainedBody.state` takes them, or of
        the angles and rates of joints.

        angles, rates : by the names or numbers of joints, such as {"elbow": 0.3}: angles in rad and
        shifts in m, and their rates; a vector where a joint leaves several free.  Those left out are
        zero; in loops, and where a strut has a length, they are what these ask for, of rates those of the least kinetic
        energy.
        near : poses, (N, 4, 4), from which those of loops are looked for.  t : when, for motions that are
        given; joints that follow a path have its angles and rates.
        Raises NoConvergence where a loop cannot be closed, InvalidInput for rates that the joints do
        not allow.
        """
        if self.rheonomic and t != 0.0:
            at_start = self.at_time(t)
            return at_start.state(mu, g, xi=xi, angles=angles, rates=rates, near=near)
        if angles is None and rates is None:
            if near is not None:
                raise InvalidInput("Linkage.state: near goes with angles or rates")
            return super().state(mu, g, xi=xi)
        if mu is not None or g is not None or xi is not None:
            raise InvalidInput("Linkage.state: give angles and rates, or momenta and poses, not both")
        q, speeds = self._by_number("angles", angles), self._by_number("rates", rates)
        for j, leader, ratio, offset in self._meshed:
            q[j] = ratio * q.get(leader, np.zeros(1)) + offset
            speeds[j] = ratio * speeds.get(leader, np.zeros(1))
        self._require_within_a_turn(q, t)
        free = [joint.freedoms if joint.places and not _follows(joint) else 0 for joint in self.joints]
        start = hung_from_each_other(self, q) if near is None else self._near("state: near", near)
        tree = sum(joint.conditions for joint in self.joints) + sum(free)
        placing = all(self.joints[j].places for j in (*q, *speeds))
        if tree <= 6 * len(self.links) and placing:  # no loops: what is not given is zero
            speeds = {j: speeds.get(j, np.zeros(n)) for j, n in enumerate(free) if n}
        if near is None and placing and hangs(self):
            poses = start
            xi = hung_velocities(self, small(poses.ravel()), speeds)
        else:
            poses = closed(self, start, q)
            xi = velocity_with(self, small(poses.ravel()), speeds)
        momentum = np.array(self.body.body.lagrangian.momentum(xi))
        at_start = small(poses.ravel())
        self._require_independent(at_start, "Linkage.state")
        return super().state(self._projected(momentum, at_start), poses.ravel())

    def _require_within_a_turn(self, q: dict[int, np.ndarray], t: float) -> None:
        """Refuse angles at which a spring would be wound: it sees them within half a turn."""
        for force in self.forces:
            number = self.number(force.joint)
            joint = self.joints[number]
            if not isinstance(force, JointPotential):
                continue
            middle = force.about(t)
            for i in {*acting(force, joint)} & {*joint.angles}:
                angle = q.get(number, np.full(joint.freedoms, middle))[i]
                if abs(angle - middle) > np.pi:
                    turns = 2.0 * np.pi * np.round((angle - middle) / (2.0 * np.pi))
                    raise InvalidInput(
                        f"Linkage.state: at {self.label(number)} the angle {angle:g} rad is more than half a "
                        f"turn from {middle:g}, about which {force!r} sees it: poses do not tell how often a "
                        f"joint has turned, so that nothing is wound. Give {angle - turns:g} rad, or a "
                        "drive that counts turns by itself"
                    )

    def _near(self, name: str, poses: Any) -> np.ndarray:
        """Poses of all bodies, that are on the group."""
        array = real_array(poses, f"Linkage.{name}")
        if array.shape != (len(self.links), 4, 4):
            raise InvalidInput(
                f"Linkage.{name} has shape {array.shape}; {len(self.links)} bodies have {(len(self.links), 4, 4)}"
            )
        for b, pose in enumerate(array):
            if not SE3().contains(pose):
                raise InvalidInput(f"Linkage.{name}[{b}] is no pose, [[R, p], [0, 1]]; got {pose.tolist()}")
        return array

    def _by_number(self, what: str, values: Any) -> dict[int, np.ndarray]:
        """Coordinates or rates by the numbers of joints."""
        if values is not None and not isinstance(values, Mapping):
            raise InvalidType(f'Linkage.state: {what} are given by joint, such as {{"elbow": 0.3}}; got {values!r}')
        by_number = {}
        for joint, value in (values or {}).items():
            number = self.number(joint)
            x = np.atleast_1d(real_array(value, f"Linkage.state: {what}[{joint!r}]"))
            check_finite(x, f"Linkage.state: {what}[{joint!r}]")
            free = self.joints[number].freedoms
            if number in [j for j, *_ in self._meshed]:
                raise InvalidInput(
                    f"Linkage.state: {what}[{joint!r}]: {self.label(number)} follows another joint; leave it out"
                )
            if _follows(self.joints[number]):
                raise InvalidInput(
                    f"Linkage.state: {what}[{joint!r}]: {self.label(number)} follows a path, which says "
                    "where it begins; leave it out"
                )
            if x.shape != (free,):
                raise InvalidInput(
                    f"Linkage.state: {what}[{joint!r}] has shape {x.shape}; a "
                    f"{type(self.joints[number]).__name__} leaves {free} free"
                )
            by_number[number] = x
        return by_number

    def independent(self, poses: Any) -> Linkage:
        """This linkage without the conditions that follow from others at these poses, as they do in
        loops of hinges; `dropped` names them.

        poses : (N, 4, 4), at which loops are closed or nearly so.  The conditions of later joints
        are left out.
        Raises InvalidInput at a dead point, where conditions depend on each other for once only,
        NoConvergence where the loops cannot be closed.
        """
        g = small(closed(self, self._near("independent: poses", poses), {}).ravel())
        conditions = independent_rows(self, g)
        reduced = replace(self, kept=conditions)
        for seed in range(2):  # close by they have to follow too
            near = closed(reduced, self._shaken(reduced, g, seed), {})
            at, whole = small(near.ravel()), Joints(self.joints)
            off, G = np.abs(np.array(whole.value(at))), np.array(whole.jacobian(self.configurations, at))
            if (off > MISSED * np.linalg.norm(G * self.displacements, axis=1)).any():
                raise InvalidInput(
                    "Linkage.independent: these poses are a dead point: of "
                    f"{', '.join(reduced.dropped)}, some follow from others here, but not close by "
                    f"(they miss by {off.max():.2g}); give other poses"
                )
        return reduced

    def _shaken(self, reduced: Linkage, g: Any, seed: int) -> np.ndarray:
        """Poses close by, displaced along what the joints allow."""
        move = np.random.default_rng(seed).normal(size=self.configurations.dim)
        xi = np.array(reduced.velocity(vec(*reduced._projected(move, g))))
        xi = xi * (0.03 / np.abs(xi / self.displacements).max()) if xi.any() else xi
        return np.array(self.configurations.compose_exp(g, vec(*xi.tolist()))).reshape(-1, 4, 4)

    @cached_property
    def displacements(self) -> np.ndarray:
        """Displacements that change a mechanism as much as a turn by 1 rad, whatever the unit of length, (6 N,): of
        positions the radius of gyration of the body.
        """
        lightness = self._inverse.diagonal().reshape(-1, 2, 3)
        radii = np.sqrt(lightness[:, 1].max(axis=1) / lightness[:, 0].min(axis=1))
        return np.repeat(np.column_stack([np.ones(len(radii)), radii]), 3)

    def _reach(self, G: Any) -> np.ndarray:
        """How much conditions with these derivatives change over such displacements, (m,)."""
        squares = G.multiply(G) if self._sparse else G * G
        return np.asarray(np.sqrt(squares @ self.displacements**2))

    @property
    def dropped(self) -> tuple[str, ...]:
        """The conditions that are left out since they follow from others, such as "joint 'rocker':
        condition 4".
        """
        return tuple(
            f"{self.label(j)}: condition {i}"
            for j, (joint, indices) in enumerate(self.constraint.counted)
            for i in range(joint.conditions)
            if i not in indices
        )

    def _named(self, conditions: Any) -> str:
        """The joints of these conditions, in words."""
        owner = [j for j, (_, indices) in enumerate(self.constraint.counted) for _ in indices]
        names = [self.label(j) for j in sorted({owner[i] for i in conditions})]
        return f"those of {', '.join(names)}"

    def motion_at(self, run: Any, joint: str | int) -> Any:
        """A joint along a run; `run.joint(name)` asks for it."""
        if isinstance(getattr(run, "system", self), Systems):
            return OfMembers.along(run, "motion_at", joint)
        number = self.number(joint)
        forces = tuple(force for force in self.forces if self.number(force.joint) == number)
        return JointMotion(run, self, number, AtJoint(self.joints[number], forces))

    def link_at(self, run: Any, link: str | int) -> Any:
        """A body along a run; `run.link(name)` asks for it."""
        if isinstance(getattr(run, "system", self), Systems):
            return OfMembers.along(run, "link_at", link)
        return LinkMotion(run, self, number_of(self.links, link, "link"))

    def angle(
        self, joint: str | int, level: float = 0.0, *, freedom: int = 0, terminal: int = 0,
        direction: float = 0.0,
    ) -> JointAngle:  # fmt: skip
        """The angle of a joint less `level`, in rad, of a slider the shift in m, as a function of time
        and state: an event, `events=[arm.angle("elbow", 0.5)]`.

        Angles are seen within half a turn of the level.  freedom : of joints that leave several
        motions free, which.  terminal : end the run at this zero; direction : 1.0 counts rising ones only,
        -1.0 falling ones.
        """
        member = self.joints[number := self.number(joint)]
        if not 0 <= freedom < member.freedoms:
            raise InvalidInput(
                f"Linkage.angle: {self.label(number)}, a {type(member).__name__}, has {member.freedoms} "
                f"coordinates, numbered from 0; got freedom {freedom}"
            )
        return JointAngle(AtJoint(member, ()), freedom, float(level), terminal, float(direction))

    def angles_of(self, g: Element, t: float = 0.0) -> Vec:
        """The coordinates q of all joints, in their order, (freedoms of all,): angles in rad within half a turn of zero,
        shifts in m.

        g : poses of the bodies, (16 N,).  t : the time, which joints in a given motion ask for.

        Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
        """
        return vec(*[q for joint in self.joints if joint.freedoms > 0 for q in AtJoint(joint, ()).angles(t, g)])

    def rates_of(self, mu: Vec, g: Element, t: float = 0.0) -> Vec:
        """The rates of all joints, in their order, in rad/s and m/s, (freedoms of all,); of a ball joint the angular
        velocity of the first body against the second, in the axes of the first.

        Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
        """
        xi = self.velocity(mu)
        return vec(
            *[pace for joint in self.joints if joint.freedoms > 0 for pace in AtJoint(joint, ()).rates(t, g, xi)]
        )

    @cached_property
    def joint_space(self) -> JointSpace:
        """The mechanics in the rates of the joints: mass matrix, bias, inverse and forward dynamics, Jacobians of links.

        Raises InvalidInput for loops, given motions and Mimics.
        """
        return joint_space_of(self)

    def poses(self, g: Any) -> np.ndarray:
        """The poses of the bodies.  g : (..., 16 N);  returns (..., N, 4, 4)."""
        array = real_array(g, "Linkage.poses: g")
        return array.reshape(*array.shape[:-1], len(self.links), 4, 4)

    def frame(self, name: str, g: Any) -> np.ndarray:
        """The pose of one of the `frames` in space.  g : (..., 16 N);  returns (..., 4, 4)."""
        for frame in self.frames:
            if frame.name == name:
                poses, pose = self.poses(g), np.array(frame.pose)
                if frame.body is None:
                    return np.broadcast_to(pose, (*poses.shape[:-3], 4, 4)).copy()
                return np.asarray(poses[..., frame.body, :, :] @ pose)
        names = [frame.name for frame in self.frames]
        raise InvalidInput(f"Linkage.frame: there is no frame {name!r}{meant(name, names)}; there are {names}")

    def total_momentum(self, mu: Any, g: Any) -> np.ndarray:
        """Angular momentum about the origin and linear momentum of all bodies together, seen from
        space, (..., 6).
        """
        momentum = np.asarray(mu)
        for joint in self._rotors:
            momentum = momentum + np.asarray(AtJoint(joint, ()).rotor(g, self.velocity(mu)))
        m = np.asarray(self.spatial_momentum(momentum, g))
        return m.reshape(*m.shape[:-1], len(self.links), 6).sum(axis=-2)

    def centroidal_momentum(self, mu: Any, g: Any) -> np.ndarray:
        """Angular momentum about the centre of mass of all bodies, and their linear momentum, seen from space, (..., 6)."""
        momentum, masses = self.total_momentum(mu, g), np.array([link.mass for link in self.links])
        centre = np.einsum("b,...bi->...i", masses / masses.sum(), self.poses(g)[..., :3, 3])
        momentum[..., :3] -= np.cross(centre, momentum[..., 3:])
        return momentum

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy, and the momenta of the motions of space that are symmetries of joints and
        gravity; of each joint its conditions and their rates, which are zero, of more than
        `SHOWN` joints those of all together.
        """
        return self._conserved(states) | self._closed(states)

    def _closed(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Conditions and their rates, joint by joint; beside them stand the largest entry of
        all poses and of all velocities, constants that their changes are measured by.  Velocities at rest in a field
        are rounding, and measured by what the field gives on a way of that size.
        """
        misses: dict[str, np.ndarray] = {}
        lead, J = np.shape(states["g"])[:-1], _inertia(self.links)
        inverse = np.diag(1.0 / J) if J.ndim == 1 else np.linalg.inv(J)
        xi = (states["mu"] @ inverse).reshape(*lead, len(self.links), 6)
        g, size = self.poses(states["g"]), np.full((*lead, 1), np.abs(states["g"]).max())
        fastest, first = np.abs(xi).max(), np.reshape(states["g"], (-1, states["g"].shape[-1]))[0]
        falling = np.sqrt(np.abs(inverse @ np.array(self.force(small(first)))).max() * size.max(initial=0.0))
        speed = np.full((*lead, 1), fastest if fastest > AT_REST * falling else falling)
        ground = np.broadcast_to(np.eye(4), (*lead, 4, 4)), np.zeros((*lead, 6))
        t: Any = np.broadcast_to(states.get("t", 0.0), lead)
        for number, (joint, indices) in enumerate(self.constraint.counted):
            at, name = AtJoint(joint, ()), joint.name or f"joint {number}"
            if indices:
                of_first = g[..., joint.first, :, :], xi[..., joint.first, :]
                of_second = ground
                if joint.second is not None:
                    of_second = g[..., joint.second, :, :], xi[..., joint.second, :]
                missed = np.asarray(at.missed(t, of_first[0], of_second[0]))[..., list(indices)]
                slips = np.asarray(at.slips(t, of_first[0], of_second[0], of_first[1], of_second[1]))
                misses[f"{name}: position"] = np.concatenate([missed, size], axis=-1)
                slips = slips[..., list(indices)]
                misses[f"{name}: rate"] = np.concatenate([slips, speed], axis=-1)
        if len(misses) <= 2 * SHOWN:
            return misses
        defects = [*misses.values()]
        return {
            "joints: positions": np.concatenate(defects[::2], axis=-1),
            "joints: rates": np.concatenate(defects[1::2], axis=-1),
        }

    def _conserved(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy and the momenta that symmetries keep."""
        constants = super().constants(states)
        if self.load is not None or self.rheonomic:
            return {}
        directions = self._symmetries(states["g"])
        if len(directions):
            constants["spatial momentum"] = self.total_momentum(states["mu"], states["g"]) @ directions.T
        return constants

    def _symmetries(self, g: np.ndarray) -> np.ndarray:
        """The velocities of space, (k, 6), that change no condition and no energy, at the first, a
        middle and the last sample.
        """
        changes, flat = [], g.reshape(-1, g.shape[-1])
        for at in flat[[0, len(flat) // 2, -1]]:
            turns = np.concatenate([np.array(SE3().Ad(SE3().inverse(pose), np.eye(6))).T for pose in self.poses(at)])
            forced = [self.number(force.joint) for force in self.forces]
            for rows in (
                self._matrix(self.rows(at)),
                np.array(self.force(at))[None],
                rows_of_motions(self, small(at), forced),
            ):
                if not rows.shape[0]:
                    continue
                sizes = (abs(rows) @ np.abs(turns)).max(axis=1, keepdims=True)
                changes.append(rows @ turns / np.where(sizes > 0.0, sizes, 1.0))
        _, sizes, directions = np.linalg.svd(np.concatenate(changes))
        return directions[np.r_[sizes, np.zeros(6)][:6] <= SURVIVES]


def _require_of_place(force: Any) -> None:
    """Raise InvalidInput for a JointPotential whose own effort asks for time or rate, or may."""
    if isinstance(force, JointPotential) and not is_derived(type(force).effort):
        effort, why = traced(lambda x: force.effort(x[0], x[1], x[2]), [1, 1, 1])
        if why or indices_in(effort) & {0, 2}:
            name = type(force).__name__
            raise InvalidInput(
                f"Linkage: {name}.effort may depend on more than the place, and is -dV/dq: leave it out, and it follows from "
                f"{name}.energy; what depends on time or rate is a JointForce of its own"
            )


def _require_angles_told_apart(force: Any, joint: Any, label: str) -> None:
    """Raise InvalidInput for stops that angles, seen within a turn, never reach, and for a potential of a rotation vector that
    is limited: limits are of torques along motions, which are not its slopes.
    """
    if isinstance(force, Stops) and force.high - force.low >= 2.0 * np.pi and {*acting(force, joint)} & {*joint.angles}:
        raise InvalidInput(
            f"Linkage: {force!r} at {label}: its limits are a whole turn and more apart, and poses do not tell how often a "
            "joint has turned; leave it out, or give the freedom= of a shift"
        )
    if isinstance(force, Limited) and isinstance(force.given, JointPotential) and joint.rotation_vector:
        raise InvalidInput(
            f"Linkage: {force!r} at {label}, a {type(joint).__name__}: the torque of a {type(force.given).__name__} is no "
            "function of one coordinate there; a controller in its place is a JointForce with an effort"
        )


def _follows(joint: Any) -> bool:
    """Whether a joint follows a path."""
    return isinstance(joint, MovedJoint) and len(joint.path) > 0


def _require_unlike(what: str, items: tuple[Any, ...]) -> None:
    """Raise InvalidInput for two items of one name."""
    names = [item.name for item in items if item.name is not None]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InvalidInput(f"Linkage: two of the {what} have the name {name!r}")


def _inertia(links: tuple[Link, ...]) -> np.ndarray:
    """The inertia of all bodies, diagonal if it can be."""
    if all(np.ndim(np.array(link.inertia)) == 1 for link in links):
        return np.concatenate([[*link.inertia, *[link.mass] * 3] for link in links])
    matrix = np.zeros((6 * len(links),) * 2)
    for b, link in enumerate(links):
        J = np.array(link.inertia)
        matrix[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = J if J.ndim == 2 else np.diag(J)
        matrix[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = link.mass * np.eye(3)
    return matrix


def chain(
    count: int, mass: float = 1.0, length: float = 1.0, radius: float = 0.05, axis: Any = None, gravity: float = 9.80665
) -> Linkage:
    """Equal rods that hang one from another, the first from the origin, by ball joints or, given an
    axis, by hinges.

    mass : of a rod, in kg.  length, radius : in m.  axis : of all hinges, across e3, (3,).  Frames
    have e3 along the rod, upwards.
    Source: Lee, Leok and McClamroch, Global Formulations of Lagrangian and Hamiltonian Dynamics on
    Manifolds (2018), section 9.4.
    """
    count = ordinary(count)
    if type(count) is not int or count < 1:
        raise InvalidInput(f"chain: count is a whole number of rods, at least 1; got {count!r}")
    top, bottom = vec(0.0, 0.0, 0.5 * length), vec(0.0, 0.0, -0.5 * length)
    ends = [(b, None, top, vec(0.0, 0.0, 0.0)) if b == 0 else (b, b - 1, top, bottom) for b in range(count)]
    linkage, hinge = Linkage, RevoluteJoint  # type: Any, Any
    joints: list[Any] = [BallJoint(*end) for end in ends]
    if axis is not None:
        joints = [hinge(*end, axis, axis) for end in ends]
    return linkage([Link.rod(mass, length, radius)] * count, joints, gravity)
