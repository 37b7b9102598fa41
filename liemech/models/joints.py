"""Joints between rigid bodies, and between a body and the ground: conditions on two poses, with
their derivatives.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ..errors import InvalidInput, InvalidType, NotDefined
from ..formulas import Mat, Record, Vec, cross, dot, mat, record, sqrt, vec
from ..groups.lie_group import LieGroup
from ..groups.se3 import join
from ..groups.so3 import SO3
from ..systems.constraint import Constraint, Rows

GROUND = mat(
    vec(1.0, 0.0, 0.0, 0.0),
    vec(0.0, 1.0, 0.0, 0.0),
    vec(0.0, 0.0, 1.0, 0.0),
    vec(0.0, 0.0, 0.0, 1.0),
)
AXES = vec(1.0, 0.0, 0.0), vec(0.0, 1.0, 0.0), vec(0.0, 0.0, 1.0)
ORIGIN = Vec(0.0, 0.0, 0.0)
REST = vec(0.0, 0.0, 0.0)


@record
class Joint(Record):
    """A joint, which holds two rigid bodies together; abstract.

    first : the number of a body.  second : that of another one, or None for the ground.
    Points and axes are given in the axes of the body that they belong to, points from its centre of
    mass; those of the ground in space.

    1. A subclass writes `value` and `rows` of two poses, and says how many `conditions` there are.

    Source: Nikravesh, Computer-Aided Analysis of Mechanical Systems (1988), chapter 7;
    Featherstone, Rigid Body Dynamics Algorithms (2008), section 4.4.
    """

    conditions: ClassVar[int]

    first: int
    second: int | None

    def __post_init__(self) -> None:
        super().__post_init__()
        name = type(self).__name__
        for what, number in (
            ("first", self.first),
            ("second", 0 if self.second is None else self.second),
        ):
            if type(number) is not int or number < 0:
                raise InvalidType(
                    f"{name}: {what} is the number of a body, 0 or more "
                    f"(second: None is the ground); got {number!r}"
                )
        if self.first == self.second:
            raise InvalidInput(
                f"{name}: a joint holds two bodies together; first and second are both {self.first}"
            )
        for field, value in vars(self).items():
            if field.startswith(("at_", "axis")) and (
                len(value) != 3 or not np.isfinite(np.array(value)).all()
            ):
                raise InvalidInput(
                    f"{name}: {field} must be a vector in space, (3,), and finite; got {value}"
                )
            if field.startswith("axis"):
                if not any(value):
                    raise InvalidInput(f"{name}: {field} must have a direction; got {value}")
                object.__setattr__(self, field, value / sqrt(dot(value, value)))

    def value(self, g: Mat, k: Mat) -> Vec:
        """The conditions, (m,), of the poses g of the first and k of the second body."""
        raise NotDefined(f"{type(self).__name__} must define `value`")

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Their left-trivialised derivatives, for each condition by the first and by the second
        pose, (6,) each.
        """
        raise NotDefined(f"{type(self).__name__} must define `rows`")


@record
class BallJoint(Joint):
    """A point of one body stays on a point of the other one: x_1 = x_2, three conditions, in m.

    at_first, at_second : the point in each body, (3,), in m.  `BallJoint(body, None, at, point)` holds
    a point of a body at a point of space.

    Source: Nikravesh (1988), section 7.2 (spherical joint).
    """

    conditions: ClassVar[int] = 3

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN

    def value(self, g: Mat, k: Mat) -> Vec:
        """x_1 - x_2."""
        return place(g, self.at_first) - place(k, self.at_second)

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Of the points."""
        return tuple([(along(g, self.at_first, n), -along(k, self.at_second, n)) for n in AXES])


@record
class RevoluteJoint(Joint):
    """A hinge: a BallJoint whose axis has the same direction in both bodies; five conditions.

    at_first, at_second : a point on the axis, (3,), in m.  axis_first, axis_second : its direction,
    (3,), of any length.

    Source: Nikravesh (1988), section 7.2.
    """

    conditions: ClassVar[int] = 5

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    axis_first: Vec = AXES[2]
    axis_second: Vec = AXES[2]

    def value(self, g: Mat, k: Mat) -> Vec:
        """x_1 - x_2, and the components of axis 2 across axis 1."""
        x, axis = place(g, self.at_first) - place(k, self.at_second), turned(k, self.axis_second)
        return vec(*x, *[dot(turned(g, u), axis) for u in across(self.axis_first)])

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Of the points, and of the axes."""
        points = [(along(g, self.at_first, n), -along(k, self.at_second, n)) for n in AXES]
        axes = [crossed(g, u, k, self.axis_second) for u in across(self.axis_first)]
        return (*points, *axes)


@record
class UniversalJoint(Joint):
    """A Cardan joint: a BallJoint with an axis in each body, at right angles; four conditions.

    at_first, at_second : where the axes meet, (3,), in m.  axis_first, axis_second : their
    directions, (3,), of any length.

    Source: Nikravesh (1988), section 7.2.
    """

    conditions: ClassVar[int] = 4

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    axis_first: Vec = AXES[0]
    axis_second: Vec = AXES[1]

    def value(self, g: Mat, k: Mat) -> Vec:
        """x_1 - x_2, and the cosine of the angle between the axes."""
        x = place(g, self.at_first) - place(k, self.at_second)
        return vec(*x, dot(turned(g, self.axis_first), turned(k, self.axis_second)))

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Of the points, and of the axes."""
        points = [(along(g, self.at_first, n), -along(k, self.at_second, n)) for n in AXES]
        return (*points, crossed(g, self.axis_first, k, self.axis_second))


@record
class PrismaticJoint(Joint):
    """A slider: the second body moves along an axis of the first one and does not turn against it;
    five conditions.

    at_first, at_second : points whose connection stays along the axis, (3,), in m.  axis : in the
    first body, (3,).  Both bodies have parallel axes when they are mounted; `attitude` is the
    rotation from the second body to the first, (3, 3), if they have not.

    Source: Nikravesh (1988), section 7.2 (translational joint).
    """

    conditions: ClassVar[int] = 5

    at_first: Vec = ORIGIN
    at_second: Vec = ORIGIN
    axis: Vec = AXES[2]
    attitude: Mat = mat(*AXES)

    def __post_init__(self) -> None:
        super().__post_init__()
        attitude = np.array(self.attitude)
        if attitude.shape != (3, 3) or not SO3().contains(self.attitude):
            raise InvalidInput(
                "PrismaticJoint: attitude must be a rotation from the second body to the first, "
                "(3, 3), R^T R = 1 and det R = 1; got "
                f"{attitude.tolist()}. SO3().exp(rotation vector) gives one"
            )

    def value(self, g: Mat, k: Mat) -> Vec:
        """The components of x_2 - x_1 across the axis, and three cosines of axes that stay at right
        angles.
        """
        d = place(k, self.at_second) - place(g, self.at_first)
        axes, others = (turned(g, e) for e in AXES), self._others(k)
        e, o = [*axes], [*others]
        return vec(
            *[dot(turned(g, u), d) for u in across(self.axis)], *[dot(e[i], o[j]) for i, j in TURNS]
        )

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Of the connection, and of the axes."""
        d = place(k, self.at_second) - place(g, self.at_first)
        slides: list[Any] = []
        for u in across(self.axis):
            n = turned(g, u)
            slides = [
                *slides,
                (turning(g, u, d) - along(g, self.at_first, n), along(k, self.at_second, n)),
            ]
        return (*slides, *[crossed(g, AXES[i], k, self.attitude[j]) for i, j in TURNS])

    def _others(self, k: Mat) -> tuple[Vec, ...]:
        """The axes of the first body as the second one carries them."""
        return tuple([turned(k, row) for row in self.attitude])


TURNS = (0, 1), (1, 2), (2, 0)
"""Pairs of axes whose cosines vanish, to first order independently, where two bodies are parallel."""


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
                f"RigidRod: length must be positive; got {self.length!r} "
                "(two points in one place are a BallJoint)"
            )

    def value(self, g: Mat, k: Mat) -> Vec:
        """(|d|^2 - L^2)/(2 L), by factors."""
        d = place(g, self.at_first) - place(k, self.at_second)
        return vec((dot(d, d) - self.length * self.length) / (2.0 * self.length))

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Along the rod."""
        n = (place(g, self.at_first) - place(k, self.at_second)) / self.length
        return ((along(g, self.at_first, n), -along(k, self.at_second, n)),)


@record
class Joints(Constraint):
    """The conditions of several joints, on a product of SE(3)s: a pose [[R, p], [0, 1]], p the
    centre of mass, for each body.

    joints : of bodies numbered as the factors of the group.

    Source: Nikravesh (1988), chapter 7.
    """

    joints: tuple[Any, ...]

    def value(self, g: Vec) -> Vec:
        """Those of the joints, one after another.  g : an element of the product, (16 N,)."""
        return vec(*[c for joint in self.joints for c in joint.value(*both(joint, g))])

    def rows(self, group: LieGroup, g: Vec) -> Rows:
        """Those of the joints; of the ground none."""
        rows = [row for joint in self.joints for row in _rows(joint, g)]
        return tuple(rows)

    def touches(self, group: LieGroup, conditions: int) -> tuple[tuple[int, ...], ...]:
        """The two bodies of each joint, or the one."""
        return tuple(
            (joint.first,) if joint.second is None else (joint.first, joint.second)
            for joint in self.joints
            for _ in range(joint.conditions)
        )

    def jacobian(self, group: LieGroup, g: Any) -> Mat:
        """The rows, with zeros for the other bodies."""
        made: list[Any] = []
        for parts, bodies in zip(self.rows(group, g), self.touches(group, 0)):
            row = [REST6 for _ in range(group.dim // 6)]
            for body, part in zip(bodies, parts):
                row[body] = part
            made = [*made, vec(*[x for part in row for x in part])]
        return mat(*made)


REST6 = vec(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _rows(joint: Joint, g: Vec) -> list[Any]:
    rows = joint.rows(*both(joint, g))
    return (
        [(row[0],) for row in rows] if joint.second is None else [(row[0], row[1]) for row in rows]
    )


def both(joint: Joint, g: Vec) -> tuple[Mat, Mat]:
    """The poses of a joint's bodies."""
    return pose(g, joint.first), GROUND if joint.second is None else pose(g, joint.second)


def pose(g: Vec, body: int) -> Mat:
    """The pose of a body, from the entries of all, row by row."""
    return mat(*[vec(*[g[16 * body + 4 * i + j] for j in range(4)]) for i in range(4)])


# ------------------------------------------------------------------ points and axes


def turned(g: Mat, e: Vec) -> Vec:
    """R e: a direction of the body, seen from space."""
    return vec(*[g[i, 0] * e[0] + g[i, 1] * e[1] + g[i, 2] * e[2] for i in range(3)])


def place(g: Mat, a: Vec) -> Vec:
    """p + R a: a point of the body, in space."""
    return vec(g[0, 3], g[1, 3], g[2, 3]) + turned(g, a)


def seen(g: Mat, n: Vec) -> Vec:
    """R^T n: a direction of space, seen from the body."""
    return vec(*[g[0, i] * n[0] + g[1, i] * n[1] + g[2, i] * n[2] for i in range(3)])


def along(g: Mat, a: Vec, n: Vec) -> Vec:
    """The derivative of n . (p + R a), (a x R^T n, R^T n).  n : fixed in space."""
    f = seen(g, n)
    return join(cross(a, f), f)


def turning(g: Mat, e: Vec, n: Vec) -> Vec:
    """The derivative of n . R e, (e x R^T n, 0)."""
    return join(cross(e, seen(g, n)), REST)


def crossed(g: Mat, u: Vec, k: Mat, e: Vec) -> tuple[Vec, Vec]:
    """The derivatives of R u . S e by both poses."""
    return turning(g, u, turned(k, e)), turning(k, e, turned(g, u))


def across(axis: Vec) -> tuple[Vec, Vec]:
    """Two unit vectors at right angles to a unit vector and to each other.

    Source: Duff et al., Building an orthonormal basis, revisited, J. Comput. Graph. Tech. 6 (2017).
    """
    x, y, z = axis
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return vec(1.0 + sign * x * x * a, sign * b, -sign * x), vec(b, sign + y * y * a, -y)
