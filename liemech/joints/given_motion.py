"""Joints that move in a given way: a support that is shaken or carried along, and joints whose angles
follow a plan.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType, undefined
from ..formulas import Mat, Record, Vec, cross, derivative, dot, identity_matrix, mat, record, sin, vec
from ..formulas.classes.records import with_fields
from ..groups.rigid.se3 import join
from ..systems.in_time.tabulated import PiecewisePolynomial
from .joints import FixedJoint, Joint
from .points_and_axes import GROUND, turned


@record
class MovingSupport(Record):
    """A motion of what holds a joint, the ground or its second body's place for it; abstract.

    1. A subclass writes `pose`, as a formula.  Its fields are the parameters.

    Source: Nikravesh, Computer-Aided Analysis of Mechanical Systems (1988), section 4.2.7 (driving
    links).
    """

    def pose(self, t: float) -> Mat:
        """[[R, p], [0, 1]], (4, 4), at time t: where the place is, seen from the body that carries it,
        or from space.
        """
        raise undefined(self, "pose")


@record
class Shaking(MovingSupport):
    """A support that swings to and fro, p = amplitude sin(frequency t + phase).

    amplitude : (3,), in m.  frequency : in rad/s.  phase : in rad.

    Source: Landau and Lifshitz, Mechanics, 3rd ed., section 30 (Kapitza's pendulum).
    """

    amplitude: Vec
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.amplitude) != 3 or not np.isfinite(np.array(self.amplitude)).all():
            raise InvalidInput(f"Shaking: amplitude must be a vector in space, (3,), in m; got {self.amplitude}")

    def pose(self, t: float) -> Mat:
        """The pose of the support at time t, a shift without a turn."""
        p = sin(self.frequency * t + self.phase) * self.amplitude
        return mat(*[vec(*GROUND[i][:3], p[i]) for i in range(3)], GROUND[3])


@record
class JointPath(Record):
    """The coordinates that a joint follows; abstract.

    1. A subclass writes `coordinates`, as a formula.  Its fields are the parameters.

    Source: Nikravesh (1988), section 4.2.7.
    """

    def coordinates(self, t: float) -> Any:
        """The angle in rad, or the shift in m, at time t; of joints that leave several motions free a
        vec of all, as `angle` of `run.joint` has them.
        """
        raise undefined(self, "coordinates")


@record
class TablePath(JointPath):
    """A table that a joint follows.  table : a PiecewisePolynomial of the time."""

    table: PiecewisePolynomial

    def coordinates(self, t: float) -> Any:
        return self.table(t)


@record
class MovedJoint(Joint):
    """A joint in a given motion: held by a place that moves, on a path that it follows, or both.

        c(g, k m(t)) = 0,   hence   G xi + dc/dt = 0

    Source: Nikravesh (1988), section 4.2.7; Hairer and Wanner, Solving Ordinary Differential Equations
    II, section VII.1 (constraints that depend on time).
    """

    joint: Any
    held: Any  # the joint whose conditions count: all six directions of a joint that follows a path
    support: tuple[Any, ...]  # the motion of its support; () if there is none
    path: tuple[Any, ...]  # the motion along its path; () if there is none
    time: float = 0.0  # t, in s

    @property
    def conditions(self) -> int:  # type: ignore[override]
        """The number of conditions of `held`."""
        return int(self.held.conditions)

    @property
    def freedoms(self) -> int:  # type: ignore[override]
        """Coordinates of the joint, whether it follows a path or not."""
        return int(self.joint.freedoms)

    @property
    def turns(self) -> bool | tuple[bool, ...]:  # type: ignore[override]
        """Whether the coordinates of the joint are angles."""
        return self.joint.turns

    @property
    def rotation_vector(self) -> tuple[int, ...]:  # type: ignore[override]
        """The coordinates of the joint that are one."""
        return tuple(self.joint.rotation_vector)

    @property
    def at_first(self) -> Vec:
        """The point in the first body."""
        return self.joint.at_first

    def at_time(self, t: float) -> MovedJoint:
        return with_fields(self, time=t)

    # ---------------------------------------------------------------- what moves

    def place(self, t: float, whole: bool) -> Mat:
        """m(t): what carries the joint, seen from the second body; the whole of it where it ends on the
        path.
        """
        m = GROUND
        for part in self.support:
            m = m @ part.pose(t)
        if whole:
            for part in self.path:
                q = part.coordinates(t)
                m = m @ self.joint.relative(q if self.joint.freedoms > 1 else vec(q))
        return m

    def pace(self, whole: bool) -> Vec:
        """The velocity m^-1 m', (6,)."""
        m = self.place(self.time, whole)
        slope = derivative(lambda s: vec(*[x for row in self.place(s, whole)[:3] for x in row]), self.time)
        R = [vec(m[0, j], m[1, j], m[2, j]) for j in range(3)]  # by columns
        S = [vec(slope[j], slope[4 + j], slope[8 + j]) for j in range(4)]
        parts = [dot(R[2], S[1]), dot(R[0], S[2]), dot(R[1], S[0])]
        return vec(*parts, *[dot(column, S[3]) for column in R])

    # ---------------------------------------------------------------- as a joint

    def value(self, g: Mat, k: Mat) -> Vec:
        """The conditions, of what carries the joint."""
        return self.held.value(g, k @ self.place(self.time, True))

    def askew(self, g: Mat, k: Mat) -> float:
        """The angle by which what carries the joint holds it otherwise."""
        return self.held.askew(g, k @ self.place(self.time, True))

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        m = self.place(self.time, True)
        return tuple([(first, carried_by(m, second)) for first, second in self.held.rows(g, k @ m)])

    def paces(self, g: Mat, k: Mat) -> list[Any]:
        """dc/dt of the conditions, by the given motion alone."""
        m, u = self.place(self.time, True), self.pace(True)
        return [dot(two, u) for _, two in self.held.rows(g, k @ m)]

    def paces_by_coordinates(self, g: Mat, k: Mat) -> list[Any]:
        """dc/dq of the conditions, for each coordinate of the path."""
        at = self.path[0].coordinates(self.time)
        q = vec(*at) if self.joint.freedoms > 1 else vec(at)
        m, n = k @ self.place(self.time, False), self.joint.freedoms
        units = identity_matrix(n)
        return [derivative(lambda x: self.held.value(g, m @ self.joint.relative(x)), q, unit) for unit in units]

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The coordinates of the joint, against what carries it."""
        return self.joint.coordinates(g, k @ self.place(self.time, False))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        m = self.place(self.time, False)
        return tuple([(first, carried_by(m, second)) for first, second in self.joint.motions(g, k @ m)])

    def paces_of_motions(self, g: Mat, k: Mat) -> list[Any]:
        """The rates of the motions by the given motion of the support alone."""
        m, u = self.place(self.time, False), self.pace(False)
        return [dot(two, u) for _, two in self.joint.motions(g, k @ m)]

    def relative(self, q: Vec) -> Mat:
        """The pose of the first body; on a path that of the time, whatever q is."""
        if len(self.path) > 0:
            return self.place(self.time, True)
        return self.place(self.time, False) @ self.joint.relative(q)

    def slopes(self, q: Vec, slope: Vec) -> Vec:
        """The slopes along the motions of the joint, from those by its coordinates."""
        return self.joint.slopes(q, slope)


def carried_by(m: Mat, row: Vec) -> Vec:
    """A row by the velocity of k m, as one by that of k: (R a + p x R b, R b)."""
    b = turned(m, row[3:])
    p = vec(m[0, 3], m[1, 3], m[2, 3])
    return join(turned(m, row[:3]) + cross(p, b), b)


def moved(joint: Any, support: Any, path: Any, label: str) -> Any:
    """A joint of a linkage in its given motion."""
    if joint.geared and joint.armature > 0.0:
        raise InvalidInput(
            f"Linkage: {label} has an armature and is in a given motion, which do not go together; give "
            "its rotor as a link of its own, or leave armature= out there"
        )
    joint_alone = replace(joint, first=0, second=1, name=None)
    at: Any = getattr(joint, "at_first", vec(0.0, 0.0, 0.0))
    held: Any = joint_alone
    if path is not None:
        if joint.freedoms == 0 or not joint.places:
            raise InvalidInput(
                f"Linkage: {label}, a {type(joint).__name__}, has no coordinates that could follow a path"
            )
        path = TablePath(path) if isinstance(path, PiecewisePolynomial) else path
        if isinstance(path, TablePath):
            require_smooth(label, path.table)
        shape = np.shape(np.asarray(path.coordinates(0.0)))
        if shape != (() if joint.freedoms == 1 else (joint.freedoms,)):
            raise InvalidInput(
                f"Linkage: the path of {label} has coordinates of shape {shape}; a "
                f"{type(joint).__name__} leaves {joint.freedoms} free"
            )
        held = FixedJoint(0, 1, at, at)
    kind: Any = MovedJoint
    return kind(
        joint.first,
        joint.second,
        joint_alone,
        held,
        () if support is None else (support,),
        () if path is None else (path,),
        name=joint.name,
    )


def require_smooth(label: str, table: PiecewisePolynomial) -> None:
    """Raise InvalidInput for a table whose value or slope jumps at a knot, along which a joint could not be led by forces."""
    inside = table if table.outside != "hold" else PiecewisePolynomial(np.asarray(table.knots), table._terms())
    for name, curve in (("value", inside), ("slope", inside.derivative())):
        if curve.jumping > 0.0:
            raise InvalidInput(
                f"Linkage: the {name} of the table that {label} follows jumps at t = {float(np.asarray(curve.jumps)[0]):g}, which "
                "no force can do; PiecewisePolynomial.cubic(t, values) is smooth there"
            )


def require_motion(label: str, motion: Any) -> None:
    """Raise InvalidType for a value that is no motion."""
    if not isinstance(motion, (MovingSupport, JointPath, PiecewisePolynomial)):
        raise InvalidType(
            f"Linkage: motions[{label!r}] is a MovingSupport such as Shaking([0.0, 0.0, 0.1], 50.0), a "
            f"JointPath, or a PiecewisePolynomial of the time; got {motion!r}"
        )
