"""Joints between rigid bodies, and between a body and the ground: conditions on two poses, with
their derivatives.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from ..errors import InvalidInput, InvalidType, NotDefined, undefined
from ..formulas import Mat, Record, Vec, atan2, cross, dot, jacobian, mat, record, sqrt, transpose, vec, vectors
from ..formulas.classes.derived import derived, derived_from
from ..formulas.classes.records import with_fields
from ..groups.lie_group import LieGroup
from ..groups.rigid.se3 import SE3, join
from ..groups.rigid.so3 import SO3
from ..rooms.constraints.constraint import Constraint, Rows
from .points_and_axes import (
    GROUND,
    REST,
    REST6,
    across,
    along,
    beside,
    between,
    carrying,
    crossed,
    hung,
    place,
    pose,
    rotation,
    seen,
    shift,
    turned,
    turned_by,
    turning,
)

AXES = vec(1.0, 0.0, 0.0), vec(0.0, 1.0, 0.0), vec(0.0, 0.0, 1.0)
ORIGIN = Vec(0.0, 0.0, 0.0)


@record
class Joint(Record):
    """A joint, which holds two rigid bodies together; abstract.

    first : the number of a body.  second : that of another one, or None for the ground.
    Points and axes are given in the axes of the body that they belong to, points from its centre of
    mass; those of the ground in space.

    name : what it is called in messages, and by `Linkage.joint` and forces; None: its number.

    1. A subclass writes `value` of two poses, and says how many `conditions` there are; `rows` follow, or are written
    in closed form.
    2. With `freedoms` it writes their `coordinates`, which tell where the first body is against the second; where there
    are six conditions and freedoms, for starts from coordinates, `relative`; and how they move, `motions`, if not as
    coordinates do or in closed form.  Of several coordinates `turns` says of each whether it is the angle about an axis,
    which is seen modulo a turn, (True, False), and `rotation_vector` which ones are that of a rotation, (0, 1, 2), which
    jumps by a turn about its axis.  A coordinate whose rate is no motion has `slopes`.
    3. Where its conditions vanish with its bodies turned over too, it says by how much, `askew`.

    Source: Nikravesh, Computer-Aided Analysis of Mechanical Systems (1988), chapter 7;
    Featherstone, Rigid Body Dynamics Algorithms (2008), section 4.4.
    """

    conditions: ClassVar[int]
    freedoms: ClassVar[int] = 0
    turns: ClassVar[bool | tuple[bool, ...]] = True  # are its coordinates angles about axes?
    rotation_vector: ClassVar[tuple[int, ...]] = ()
    geared: ClassVar[bool] = False  # may a rotor turn with its coordinate?

    first: int
    second: int | None
    name: str | None = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        name = type(self).__name__
        if self.name is not None and (type(self.name) is not str or not self.name):
            raise InvalidType(f"{name}: name must be a text; got {self.name!r}")
        for what, number in (("first", self.first), ("second", 0 if self.second is None else self.second)):
            if type(number) is not int or number < 0:
                raise InvalidType(
                    f"{name}: {what} is the number of a body, 0 or more (second: None is the ground); got {number!r}"
                )
        if self.freedoms > 1 and np.shape(self.turns) != (self.freedoms,):
            raise InvalidType(
                f"{name}: turns says of each of its {self.freedoms} coordinates whether it is the angle about an axis, "
                f"such as {(True, *[False] * (self.freedoms - 1))}; got {self.turns!r}"
            )
        if type(self).at_time is not Joint.at_time and type(self).paces is Joint.paces:
            raise undefined(self, "paces")
        armature = getattr(self, "armature", 0.0)
        if not 0.0 <= armature < np.inf:
            raise InvalidInput(f"{name}: armature must be 0 or more; got {armature!r}")
        if self.first == self.second:
            raise InvalidInput(f"{name}: a joint holds two bodies together; first and second are both {self.first}")
        for attribute, value in vars(self).items():
            if attribute.startswith(("at_", "axis")) and (len(value) != 3 or not np.isfinite(np.array(value)).all()):
                raise InvalidInput(f"{name}: {attribute} must be a vector in space, (3,), and finite; got {value}")
            if attribute.startswith("axis"):
                if not any(value):
                    raise InvalidInput(f"{name}: {attribute} must have a direction; got {value}")
                object.__setattr__(self, attribute, value / sqrt(dot(value, value)))

    @property
    def places(self) -> bool:
        """Do its coordinates determine the pose of the first body, seen from the second?"""
        return self.conditions + self.freedoms >= 6

    @property
    def angles(self) -> tuple[int, ...]:
        """The numbers of the coordinates that are angles about axes, seen modulo a turn."""
        each = self.turns if isinstance(self.turns, tuple) else (self.turns,) * self.freedoms
        return tuple([i for i, turns in enumerate(each) if turns])

    def value(self, g: Mat, k: Mat) -> Vec:
        """The conditions, (m,), of the poses g of the first and k of the second body; (0,) without any."""
        if self.conditions == 0:
            return vec()
        raise NotDefined(f"{type(self).__name__} must define `value`")

    @derived
    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Their left-trivialised derivatives, for each condition by the first and by the second
        pose, (6,) each.
        """
        return by_poses(lambda p, q: self.value(p, q), g, k)

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The angles in rad, from -pi to pi, and shifts in m that the joint leaves free, (freedoms,)."""
        raise NotDefined(f"{type(self).__name__} has no coordinates")

    @derived
    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Their rates as rows, for each by the velocity of the first and of the second body, (6,)
        each; a torque or force along one acts on the bodies by these rows.
        """
        if self.rotation_vector:
            raise NotDefined(f"{type(self).__name__} must define `motions`: rates of rotation vectors are none")
        return by_poses(lambda p, q: self.coordinates(p, q), g, k)

    @derived_from("coordinates")
    def relative(self, q: Vec) -> Mat:
        """The pose of the first body, seen from the second, at these coordinates.  q : (freedoms,)."""
        raise NotDefined(f"{type(self).__name__} must define `relative`, the pose at its coordinates")

    def slopes(self, q: Vec, slope: Vec) -> Vec:
        """The derivative of a function of the coordinates along `motions`, from that by the coordinates: along
        rotation vectors, whose motions are angular velocities in the axes of the first body, by the derivative of
        the logarithm.  q, slope : (freedoms,).
        """
        turn = self.rotation_vector
        if not turn:
            return slope
        seen_by_body = SO3().algebra.dexp_inv_dual(vec(*[q[i] for i in turn]), vec(*[slope[i] for i in turn]))
        return vec(*[seen_by_body[turn.index(i)] if i in turn else slope[i] for i in range(len(slope))])

    def askew(self, g: Mat, k: Mat) -> float:
        """The angle in rad between directions that the joint holds parallel: 0 where it is closed, half a
        turn or a third of one where its conditions, cosines, vanish too; 0 by default.
        """
        return 0.0

    def at_time(self, t: float) -> Any:
        """The joint at time t: of one in no given motion the joint itself."""
        return self

    def paces(self, g: Mat, k: Mat) -> list[Any]:
        """The rates of the conditions by a given motion alone; none where there is no such motion."""
        return []

    def paces_of_motions(self, g: Mat, k: Mat) -> list[Any]:
        """The rates of `motions` by a given motion alone; none where there is no such motion."""
        return []


def by_poses(function: Any, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
    """The left-trivialised derivatives of a vector of two poses, for each component by both of them, (6,) each."""
    slopes = [jacobian(lambda x: function(SE3().compose_exp(g, x), k), REST6),
              jacobian(lambda x: function(g, SE3().compose_exp(k, x)), REST6)]  # fmt: skip
    return tuple([(vec(*by_first), vec(*by_second)) for by_first, by_second in zip(*slopes)])


@record
class BallJoint(Joint):
    """A point of one body stays on a point of the other one: x_1 = x_2, three conditions, in m.

    at_first, at_second : the point in each body, (3,), in m.  `BallJoint(body, None, at, point)` holds
    a point of a body at a point of space.

    Source: Nikravesh (1988), section 7.2 (spherical joint).
    """

    conditions: ClassVar[int] = 3
    freedoms: ClassVar[int] = 3
    turns: ClassVar[bool | tuple[bool, ...]] = (False, False, False)
    rotation_vector: ClassVar[tuple[int, ...]] = (0, 1, 2)

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN

    def value(self, g: Mat, k: Mat) -> Vec:
        """The difference x_1 - x_2 of the points, in space."""
        return place(g, self.at_first) - place(k, self.at_second)

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The rows of the difference along each axis of space."""
        return tuple([(along(g, self.at_first, n), -along(k, self.at_second, n)) for n in AXES])

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The rotation vector of the first body, seen from the second."""
        return SO3().log(transpose(rotation(k)) @ rotation(g))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The relative angular velocity, in the axes of the first body."""
        return tuple([(join(e, REST), join(-seen(k, turned(g, e)), REST)) for e in AXES])

    def relative(self, q: Vec) -> Mat:
        """The rotation by q about the point."""
        return hung(SO3().exp(q), self.at_first, self.at_second)


@record
class RevoluteJoint(Joint):
    """A hinge: a BallJoint whose axis has the same direction in both bodies; five conditions.

    at_first, at_second : a point on the axis, (3,), in m.  axis_first, axis_second : its direction,
    (3,), of any length.
    Its angle is 0 where the vectors `across` the axes are parallel: if both axes have the same
    numbers, where both frames are parallel.
    armature : A, in kg m^2, the inertia of a motor's rotor as the joint feels it, that about its own
    axis times the gear ratio squared; the kinetic energy has A q'^2/2 more.

    Source: Nikravesh (1988), section 7.2; Featherstone, Rigid Body Dynamics Algorithms (2008),
    section 9.6 (rotors behind gears).
    """

    conditions: ClassVar[int] = 5
    freedoms: ClassVar[int] = 1
    geared: ClassVar[bool] = True

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    axis_first: Vec = AXES[2]
    axis_second: Vec = AXES[2]
    armature: float = field(default=0.0, kw_only=True, repr=False)

    def value(self, g: Mat, k: Mat) -> Vec:
        """x_1 - x_2, and the components of axis 2 across axis 1."""
        x, axis = place(g, self.at_first) - place(k, self.at_second), turned(k, self.axis_second)
        return vec(*x, *[dot(turned(g, u), axis) for u in across(self.axis_first)])

    def askew(self, g: Mat, k: Mat) -> float:
        """The angle between the axes."""
        return between(turned(g, self.axis_first), turned(k, self.axis_second))

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        points = [(along(g, self.at_first, n), -along(k, self.at_second, n)) for n in AXES]
        axes = [crossed(g, u, k, self.axis_second) for u in across(self.axis_first)]
        return (*points, *axes)

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The angle by which the first body is turned about the axis."""
        u = turned(g, across(self.axis_first)[0])
        e1, e2 = across(self.axis_second)
        return vec(atan2(dot(u, turned(k, e2)), dot(u, turned(k, e1))))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The motion that turns about the axis, by both bodies."""
        return ((join(self.axis_first, REST), join(-self.axis_second, REST)),)

    def relative(self, q: Vec) -> Mat:
        """The turn by q about the axis."""
        first, second = across(self.axis_first), across(self.axis_second)
        mounted = carrying((*first, self.axis_first), (*second, self.axis_second))
        return hung(SO3().exp(q[0] * self.axis_second) @ mounted, self.at_first, self.at_second)


@record
class UniversalJoint(Joint):
    """A Cardan joint: a BallJoint with an axis in each body, at right angles; four conditions.

    at_first, at_second : where the axes meet, (3,), in m.  axis_first, axis_second : their
    directions, (3,), of any length.
    Its coordinates are the angle of the cross about the axis of the second body, and that of the
    first body about its own axis; both are 0 where the frames are parallel, if the numbers of the
    axes are at right angles.

    Source: Nikravesh (1988), section 7.2.
    """

    conditions: ClassVar[int] = 4
    freedoms: ClassVar[int] = 2
    turns: ClassVar[bool | tuple[bool, ...]] = (True, True)

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    axis_first: Vec = AXES[0]
    axis_second: Vec = AXES[1]

    def value(self, g: Mat, k: Mat) -> Vec:
        """x_1 - x_2, and the cosine of the angle between the axes."""
        x = place(g, self.at_first) - place(k, self.at_second)
        return vec(*x, dot(turned(g, self.axis_first), turned(k, self.axis_second)))

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The rows of the points, and of the angle between the axes."""
        points = [(along(g, self.at_first, n), -along(k, self.at_second, n)) for n in AXES]
        return (*points, crossed(g, self.axis_first, k, self.axis_second))

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The angle of the cross about axis 2, and that of the first body about axis 1."""
        a, b = turned(g, self.axis_first), turned(k, self.axis_second)
        u, w = (
            turned(g, beside(self.axis_first, self.axis_second)),
            turned(k, beside(self.axis_second, self.axis_first)),
        )
        return vec(atan2(dot(a, cross(b, w)), dot(a, w)), -atan2(dot(b, cross(a, u)), dot(b, u)))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The motions that turn about each of both axes."""
        a, b = turned(g, self.axis_first), turned(k, self.axis_second)
        return (
            (join(seen(g, b), REST), join(-self.axis_second, REST)),
            (join(self.axis_first, REST), join(-seen(k, a), REST)),
        )

    def relative(self, q: Vec) -> Mat:
        """The pose after both turns, one after the other."""
        a, b = self.axis_first, self.axis_second
        u, w = beside(a, b), beside(b, a)
        mounted = carrying((a, u, cross(a, u)), (w, b, cross(w, b)))
        turn = SO3().exp(q[0] * b) @ mounted @ SO3().exp(q[1] * a)
        return hung(turn, self.at_first, self.at_second)


@record
class PrismaticJoint(Joint):
    """A slider: the second body moves along an axis of the first one and does not turn against it;
    five conditions.

    at_first, at_second : points whose connection stays along the axis, (3,), in m.  axis : in the
    first body, (3,).  Both bodies have parallel axes when they are mounted; `attitude` is the
    rotation from the second body to the first, (3, 3), if they have not.  Its coordinate is the
    shift of the first body's point along the axis.
    armature : A, in kg, the inertia of a motor's rotor as the slider feels it.

    Source: Nikravesh (1988), section 7.2 (translational joint).
    """

    conditions: ClassVar[int] = 5
    freedoms: ClassVar[int] = 1
    turns: ClassVar[bool | tuple[bool, ...]] = False
    geared: ClassVar[bool] = True

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    axis: Vec = AXES[2]
    attitude: Mat = mat(*AXES)
    armature: float = field(default=0.0, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_attitude(self)

    def value(self, g: Mat, k: Mat) -> Vec:
        """The components of x_2 - x_1 across the axis, and three cosines of axes that stay at right
        angles.
        """
        d = place(k, self.at_second) - place(g, self.at_first)
        axes, others = (turned(g, e) for e in AXES), self._others(k)
        e, o = [*axes], [*others]
        return vec(*[dot(turned(g, u), d) for u in across(self.axis)], *[dot(e[i], o[j]) for i, j in TURNS])

    def askew(self, g: Mat, k: Mat) -> float:
        """The angle by which the bodies are turned against each other."""
        return turned_by(g, k, self.attitude)

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        d = place(k, self.at_second) - place(g, self.at_first)
        slides: list[Any] = []
        for u in across(self.axis):
            n = turned(g, u)
            slides = [*slides, (turning(g, u, d) - along(g, self.at_first, n), along(k, self.at_second, n))]
        return (*slides, *[crossed(g, AXES[i], k, self.attitude[j]) for i, j in TURNS])

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """x_1 - x_2 along the axis."""
        d = place(g, self.at_first) - place(k, self.at_second)
        return vec(dot(turned(g, self.axis), d))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The motion along the axis, by both bodies."""
        n = turned(g, self.axis)
        return ((along(g, self.at_first, n), -along(k, self.at_second, n)),)

    def relative(self, q: Vec) -> Mat:
        """The shift by q along the axis."""
        turn = transpose(self.attitude)
        return hung(turn, self.at_first, self.at_second + q[0] * (turn @ self.axis))

    def _others(self, k: Mat) -> tuple[Vec, ...]:
        """The axes of the first body as the second one carries them."""
        return tuple([turned(k, row) for row in self.attitude])


def require_attitude(joint: Any) -> None:
    """Refuse an attitude that is no rotation."""
    attitude = np.array(joint.attitude)
    if attitude.shape != (3, 3) or not SO3().contains(joint.attitude):
        raise InvalidInput(
            f"{type(joint).__name__}: attitude must be a rotation from the second body to the first, "
            f"(3, 3), R^T R = 1 and det R = 1; got {attitude.tolist()}. SO3().exp(rotation vector) "
            "gives one"
        )


TURNS = (0, 1), (1, 2), (2, 0)
"""Pairs of axes whose cosines vanish, to first order independently, where two bodies are parallel."""


@record
class PlanarJoint(Joint):
    """A point of the first body stays in a plane of the second one, and an axis of it across the
    plane; three conditions.

    at_first, at_second : the point, and one of the plane, (3,), in m.  axis_first, axis_second : the
    normal of the plane in each body, (3,), of any length.
    Its coordinates are the shifts along the two vectors `across` the normal of the second body, in
    m, and the angle about the normal, from -pi to pi, 0 as that of a RevoluteJoint.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), table 4.1 (planar joint).
    """

    conditions: ClassVar[int] = 3
    freedoms: ClassVar[int] = 3
    turns: ClassVar[bool | tuple[bool, ...]] = (False, False, True)

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    axis_first: Vec = AXES[2]
    axis_second: Vec = AXES[2]

    def value(self, g: Mat, k: Mat) -> Vec:
        """The height of x_1 over the plane, and the components of axis 2 across axis 1."""
        d, axis = place(g, self.at_first) - place(k, self.at_second), turned(k, self.axis_second)
        return vec(dot(axis, d), *[dot(turned(g, u), axis) for u in across(self.axis_first)])

    def askew(self, g: Mat, k: Mat) -> float:
        """The angle between the normals."""
        return between(turned(g, self.axis_first), turned(k, self.axis_second))

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        axes = [crossed(g, u, k, self.axis_second) for u in across(self.axis_first)]
        return (shift(g, self.at_first, k, self.at_second, self.axis_second), *axes)

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The components of x_1 - x_2 in the plane, and the angle."""
        d = place(g, self.at_first) - place(k, self.at_second)
        e1, e2 = across(self.axis_second)
        u = turned(g, across(self.axis_first)[0])
        angle = atan2(dot(u, turned(k, e2)), dot(u, turned(k, e1)))
        return vec(dot(turned(k, e1), d), dot(turned(k, e2), d), angle)

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Moving in the plane, and turning about its normal."""
        e1, e2 = across(self.axis_second)
        return (
            shift(g, self.at_first, k, self.at_second, e1),
            shift(g, self.at_first, k, self.at_second, e2),
            (join(self.axis_first, REST), join(-self.axis_second, REST)),
        )

    def relative(self, q: Vec) -> Mat:
        """The turn by q[2] about the normal, and the shifts."""
        first, second = across(self.axis_first), across(self.axis_second)
        mounted = carrying((*first, self.axis_first), (*second, self.axis_second))
        moved = self.at_second + q[0] * second[0] + q[1] * second[1]
        return hung(SO3().exp(q[2] * self.axis_second) @ mounted, self.at_first, moved)


@record
class FloatingJoint(Joint):
    """A joint that leaves all motions free, no conditions: it names where a body begins, and carries
    springs and dampers between two bodies.

    at_first, at_second : a point in each body, (3,), in m.
    Its coordinates are the rotation vector of the first body, and x_1 - x_2 in the axes of the
    second, (6,).

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), table 4.1 (6-DoF joint).
    """

    conditions: ClassVar[int] = 0
    freedoms: ClassVar[int] = 6
    turns: ClassVar[bool | tuple[bool, ...]] = (False,) * 6
    rotation_vector: ClassVar[tuple[int, ...]] = (0, 1, 2)

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        d = place(g, self.at_first) - place(k, self.at_second)
        return join(SO3().log(transpose(rotation(k)) @ rotation(g)), seen(k, d))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The relative angular velocity in the axes of the first body, and the rates of the shift."""
        turns = [(join(e, REST), join(-seen(k, turned(g, e)), REST)) for e in AXES]
        return (*turns, *[shift(g, self.at_first, k, self.at_second, e) for e in AXES])

    def relative(self, q: Vec) -> Mat:
        return hung(SO3().exp(q[:3]), self.at_first, self.at_second + q[3:])


@record
class FixedJoint(Joint):
    """A weld: a BallJoint between bodies that do not turn against each other; six conditions.

    at_first, at_second : the same point in each body, (3,), in m.  Both bodies have parallel axes;
    `attitude` is the rotation from the second body to the first, (3, 3), if they have not.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 4.4.
    """

    conditions: ClassVar[int] = 6

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    attitude: Mat = mat(*AXES)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_attitude(self)

    def value(self, g: Mat, k: Mat) -> Vec:
        """x_1 - x_2, and three cosines of axes that stay at right angles."""
        x = place(g, self.at_first) - place(k, self.at_second)
        e, o = [turned(g, axis) for axis in AXES], [turned(k, row) for row in self.attitude]
        return vec(*x, *[dot(e[i], o[j]) for i, j in TURNS])

    def askew(self, g: Mat, k: Mat) -> float:
        """The angle by which the bodies are turned against each other."""
        return turned_by(g, k, self.attitude)

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        points = [(along(g, self.at_first, n), -along(k, self.at_second, n)) for n in AXES]
        return (*points, *[crossed(g, AXES[i], k, self.attitude[j]) for i, j in TURNS])

    def relative(self, q: Vec) -> Mat:
        """The pose that is held.  q : (0,)."""
        return hung(transpose(self.attitude), self.at_first, self.at_second)


@record
class RigidRod(Joint):
    """A point of one body stays at a distance of a point of the other:
    (|x_1 - x_2|^2 - L^2)/(2 L) = 0, one condition, in m.

    at_first, at_second : the points, (3,), in m.  length : L > 0, in m.

    Source: Nikravesh (1988), section 7.2 (spherical-spherical joint).
    """

    conditions: ClassVar[int] = 1

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    length: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.length < np.inf:
            raise InvalidInput(
                f"RigidRod: length must be positive; got {self.length!r} (two points in one place are a BallJoint)"
            )

    def value(self, g: Mat, k: Mat) -> Vec:
        """(|d|^2 - L^2)/(2 L), by factors."""
        d = place(g, self.at_first) - place(k, self.at_second)
        return vec((dot(d, d) - self.length * self.length) / (2.0 * self.length))

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The row of the rod's length, along the rod."""
        n = (place(g, self.at_first) - place(k, self.at_second)) / self.length
        return ((along(g, self.at_first, n), -along(k, self.at_second, n)),)


@record
class Strut(Joint):
    """The line between a point of one body and a point of the other, which leaves all motions free, no conditions: a
    Spring, a Damper or a Motor there, by its name, pushes both points along it.  Its coordinate is the distance
    |x_1 - x_2|, in m.  Where the points meet the line has no direction, and nothing pushes.

    at_first, at_second : the points, (3,), in m.

    Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), chapter 11 (translational
    spring-damper-actuator).
    """

    conditions: ClassVar[int] = 0
    freedoms: ClassVar[int] = 1
    turns: ClassVar[bool | tuple[bool, ...]] = False

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The distance of the points."""
        d = place(g, self.at_first) - place(k, self.at_second)
        return vec(sqrt(dot(d, d)))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """The rate of the distance: n . (x_1 - x_2)', n the direction of the line."""
        d = place(g, self.at_first) - place(k, self.at_second)
        length = sqrt(dot(d, d))
        n = d / (length if length > 0.0 else 1.0)
        return ((along(g, self.at_first, n), -along(k, self.at_second, n)),)


@record
class Mimic(Record):
    """A hinge or slider that follows another one by gears: q = ratio q_leader + offset.

    joint, leader : the names or numbers of joints.  ratio : in rad/rad, m/rad, rad/m or m/m.
    offset : in rad or m.  One rotor drives both: the armature of the leader.

    Source: the URDF specification of ROS, wiki, "urdf/XML/joint", mimic.
    """

    joint: Any
    leader: Any
    ratio: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.isfinite([self.ratio, self.offset]).all():
            raise InvalidInput(f"Mimic: ratio and offset are finite numbers; got {self.ratio!r} and {self.offset!r}")


@record
class Joints(Constraint):
    """The conditions of several joints, on a product of SE(3)s: a pose [[R, p], [0, 1]], p the
    centre of mass, for each body.

    joints : of bodies numbered as the factors of the group.  kept : for each joint the numbers of
    the conditions that count, where others follow from them; None: all of all joints.

    Source: Nikravesh (1988), chapter 7.
    """

    joints: tuple[Any, ...]
    kept: tuple[tuple[int, ...], ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.kept is None:
            return
        if len(self.kept) != len(self.joints):
            raise InvalidInput(f"Joints: kept is of {len(self.kept)} joints, and there are {len(self.joints)}")
        for joint, indices in self.counted:
            if not {*indices} <= {*range(joint.conditions)} or len({*indices}) < len(indices):
                raise InvalidInput(
                    f"Joints: kept names conditions {indices} of {joint!r}, which has {joint.conditions}, numbered from 0"
                )

    def at_time(self, t: float) -> Joints:
        return with_fields(self, joints=tuple([joint.at_time(t) for joint in self.joints]))

    @property
    def rheonomic(self) -> bool:
        return any(joint.at_time(1.0) is not joint for joint in self.joints)

    def paces(self, g: Vec) -> list[Any]:
        """dc/dt, (m,)."""
        paces: list[Any] = []
        for joint, indices in self.counted:
            of_joint = joint.paces(*both(joint, g))
            paces = [*paces, *[of_joint[i] if len(of_joint) > 0 else 0.0 for i in indices]]
        return paces

    @property
    def counted(self) -> list[tuple[Any, Any]]:
        """Each joint with the numbers of its conditions that count."""
        if self.kept is None:
            return [(joint, range(joint.conditions)) for joint in self.joints]
        return [*zip(self.joints, self.kept)]

    def value(self, g: Vec) -> Vec:
        """The conditions of the joints, one after another.  g : an element of the product, (16 N,)."""
        return vec(*[value for joint, indices in self.counted for value in some(joint.value(*both(joint, g)), indices)])

    def rows(self, group: LieGroup, g: Vec) -> Rows:
        """The rows of the joints' conditions; the ground has none."""
        rows = [row for joint, indices in self.counted for row in some(_rows(joint, g), indices)]
        return tuple(rows)

    def touches(self, group: LieGroup, conditions: int) -> tuple[tuple[int, ...], ...]:
        """The bodies of each condition: two, or one and the ground."""
        return tuple(
            (joint.first,) if joint.second is None else (joint.first, joint.second)
            for joint, indices in self.counted
            for _ in indices
        )

    def jacobian(self, group: LieGroup, g: Any) -> Mat:
        """The rows, with zeros for the other bodies."""
        matrix_rows: list[Any] = []
        for parts, bodies in zip(self.rows(group, g), self.touches(group, 0)):
            row = [REST6 for _ in range(group.dim // 6)]
            for body, part in zip(bodies, parts):
                row[body] = part
            matrix_rows = [*matrix_rows, vec(*[x for part in row for x in part])]
        return mat(*matrix_rows)


@record
class WithRotors(Constraint):
    """The conditions of joints and, behind them, the coordinates along which rotors turn with joints: by their
    impulses momentum goes to the rotors, A q'' = lam.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 9.6.
    """

    held: Joints
    rotors: tuple[tuple[Any, ...], ...]
    lightness: Vec

    def at_time(self, t: float) -> WithRotors:
        """These conditions at time t; joints with rotors follow no path."""
        return with_fields(self, held=self.held.at_time(t))

    @property
    def rheonomic(self) -> bool:
        return self.held.rheonomic

    def paces(self, g: Vec) -> list[Any]:
        """The rates dc/dt of the joints; zero for the rotors."""
        return [*self.held.paces(g), *[0.0 for _ in self.rotors]]

    @property
    def yields(self) -> tuple[Any, ...]:
        """1/A of each rotor; 0 for the conditions of joints, and for a joint that follows another one."""
        hard = sum([len(indices) for _, indices in self.held.counted])
        return (*[0.0] * hard, *self.lightness)

    def value(self, g: Vec) -> Vec:
        """The conditions, and for each rotor the sum of ratio times coordinate over its joints."""
        angle = lambda joint: joint.coordinates(*both(joint, g))[0]  # noqa: E731
        coordinates = [vectors.sum([ratio * angle(joint) for joint, ratio in rotor]) for rotor in self.rotors]
        return vec(*self.held.value(g), *coordinates)

    def rows(self, group: LieGroup, g: Vec) -> Rows:
        return (*self.held.rows(group, g), *[_motions(rotor, g) for rotor in self.rotors])

    def touches(self, group: LieGroup, conditions: int) -> tuple[tuple[int, ...], ...]:
        """The bodies of each joint, and of the one that it follows."""
        of_rotors = tuple([_held_by(rotor) for rotor in self.rotors])
        return (*self.held.touches(group, conditions), *of_rotors)


def _held_by(rotors: Any) -> tuple[int, ...]:
    """The bodies of joints, each of them once."""
    bodies: list[int] = []
    for joint, _ in rotors:
        for b in (joint.first, joint.second):
            bodies = bodies if b is None or b in bodies else [*bodies, b]
    return tuple(bodies)


def _motions(rotors: Any, g: Vec) -> tuple[Any, ...]:
    """The row of the motions of joints, times their ratios, body by body."""
    parts = [REST6 for _ in _held_by(rotors)]
    for joint, ratio in rotors:
        (row,) = joint.motions(*both(joint, g))
        for b, part in zip((joint.first, joint.second), row):
            parts = [x + ratio * part if b == body else x for body, x in zip(_held_by(rotors), parts)]
    return tuple(parts)


def some(items: Any, numbers: Any) -> list[Any]:
    """The items with these numbers, in their order."""
    return [items[i] for i in numbers]


def _rows(joint: Joint, g: Vec) -> list[Any]:
    rows = joint.rows(*both(joint, g))
    return [(row[0],) for row in rows] if joint.second is None else [(row[0], row[1]) for row in rows]


def both(joint: Joint, g: Vec) -> tuple[Mat, Mat]:
    """The poses of a joint's bodies."""
    return pose(g, joint.first), GROUND if joint.second is None else pose(g, joint.second)
