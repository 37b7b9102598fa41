"""Angles of joints, seen modulo a turn: events at a level alone, and shifts that are none."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech import errors
from liemech.formulas import Mat, Vec, atan2, dot, record, vec
from liemech.joints import (
    BallJoint,
    FloatingJoint,
    Link,
    Linkage,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    Spring,
    UniversalJoint,
    chain,
)
from liemech.joints import joints as own
from liemech.joints.joints import Joint

O, X, Y, Z = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
SPUN: dict[str, tuple[Any, Any, int]] = {
    "hinge": (RevoluteJoint(0, None, O, O, Z, Z, name="w"), [1.0], 0),
    "Cardan joint, its cross": (UniversalJoint(0, None, O, O, X, Y, name="w"), [1.0, 0.0], 0),
    "Cardan joint, the body": (UniversalJoint(0, None, O, O, X, Y, name="w"), [0.0, 1.0], 1),
    "plane": (PlanarJoint(0, None, O, O, Z, Z, name="w"), [0.0, 0.0, 1.0], 2),
}


def alone(joint, **more):
    """One body, as heavy about every axis, without gravity: it turns evenly."""
    return Linkage([Link(1.0, [0.1] * 3)], [joint], gravity=0.0, **more)


def passed(rate, level, duration):
    """The angles level + 2 pi k between 0 and rate duration, in the order in which they are met."""
    end = rate * duration
    k = np.arange(-40, 41)
    found = level + 2.0 * np.pi * k
    found = found[(found * np.sign(rate) > 0.0) & (np.abs(found) < abs(end))]
    return found[np.argsort(np.abs(found))]


@pytest.mark.parametrize("rate", [10.0, -10.0])
@pytest.mark.parametrize("level", [0.5, 7.0])
@pytest.mark.parametrize("kind", SPUN)
def test_an_angle_passes_a_level_once_in_a_turn(kind, rate, level):
    joint, along, freedom = SPUN[kind]
    body = alone(joint)
    start = body.state(angles={}, rates={"w": (rate * np.array(along)).tolist()})
    event = body.angle("w", level, freedom=freedom)
    run = lm.integrate(body, lm.LieRATTLE(), start, h=0.02, steps=75, events=[event], compiled=False, progress=False)
    # LieRATTLE turns evenly, at its own rate
    whole = float(np.reshape(run.joint("w").angle[-1], -1)[freedom])
    assert len(run.events[0][0]) == len(passed(whole / 1.5, level, 1.5))
    assert np.allclose(run.events[0][0] * whole / 1.5, passed(whole / 1.5, level, 1.5), rtol=0.0, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, True])
def test_a_terminal_angle_of_a_chain_ends_where_it_says(compiled):
    rods = chain(3, axis=Y)
    start = rods.state(angles={0: 1.0}, rates={0: 20.0})
    events = [rods.angle(0, 0.2, terminal=2)]
    run = lm.integrate(rods, lm.LieRATTLE(), start, h=5e-3, steps=120, events=events, compiled=compiled, progress=False)
    assert len(run.events[0][0]) == 2
    ends = [float(rods.poses(g)[0, 0, 0]) for g in run.events[0][1].g]
    assert np.allclose(ends, np.cos(0.2), rtol=0.0, atol=1e-9)
    assert run.t[-1] == run.events[0][0][-1]


def test_a_shift_is_no_angle():
    """A slider at 3 m/s passes 5 m after 5/3 s, and nothing a turn away from it."""
    body = alone(PrismaticJoint(0, None, axis=X, name="s"))
    start = body.state(angles={}, rates={"s": 3.0})
    events = [body.angle("s", 5.0)]
    run = lm.integrate(body, lm.LieRATTLE(), start, h=0.1, steps=60, events=events, compiled=False, progress=False)
    assert np.allclose(run.events[0][0], [5.0 / 3.0], rtol=1e-12)


@record
class CylindricalJoint(Joint):
    """A turn about e3 and a shift along it, of the first body against the second."""

    conditions: ClassVar[int] = 4
    freedoms: ClassVar[int] = 2
    turns: ClassVar[Any] = (True, False)

    def value(self, g: Mat, k: Mat) -> Vec:
        """The components of x_1 - x_2 across e3, and of the axis of the second body."""
        d, axis = own.place(g, own.ORIGIN) - own.place(k, own.ORIGIN), own.turned(k, own.AXES[2])
        return vec(
            *[dot(own.turned(k, e), d) for e in own.AXES[:2]], *[dot(own.turned(g, e), axis) for e in own.AXES[:2]]
        )

    def rows(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Of the shifts, and of the axis."""
        return (
            *[own.shift(g, own.ORIGIN, k, own.ORIGIN, e) for e in own.AXES[:2]],
            *[own.crossed(g, e, k, own.AXES[2]) for e in own.AXES[:2]],
        )

    def coordinates(self, g: Mat, k: Mat) -> Vec:
        """The angle, and the shift."""
        u, d = own.turned(g, own.AXES[0]), own.place(g, own.ORIGIN) - own.place(k, own.ORIGIN)
        one, two, axis = [own.turned(k, e) for e in own.AXES]
        return vec(atan2(dot(u, two), dot(u, one)), dot(axis, d))

    def motions(self, g: Mat, k: Mat) -> tuple[tuple[Vec, Vec], ...]:
        """Turning about the axis, and moving along it."""
        turn = (own.join(own.AXES[2], own.REST), own.join(-own.AXES[2], own.REST))
        return turn, own.shift(g, own.ORIGIN, k, own.ORIGIN, own.AXES[2])

    def relative(self, q: Vec) -> Mat:
        """The turn, and the shift."""
        return own.hung(lm.SO3().exp(q[0] * own.AXES[2]), own.ORIGIN, q[1] * own.AXES[2])


@pytest.mark.slow
def test_a_turn_and_a_shift_are_told_apart():
    """A spring that pulls from 5 m: x'' = -(k/m) x; a turn beside it that goes on over whole turns."""
    joint = CylindricalJoint(0, None, name="c")
    body = alone(joint, forces=[Spring("c", 4.0, freedom=1)])
    start = body.state(angles={"c": [0.0, 5.0]}, rates={"c": [8.0, 0.0]})
    run = lm.integrate(
        body, lm.LieRATTLE(), start, h=5e-3, steps=300, compiled=False, progress=False,
        events=[body.angle("c", 4.0, freedom=1)],
    )  # fmt: skip
    motion = run.joint("c").angle
    assert np.allclose(motion[:, 1], 5.0 * np.cos(2.0 * run.t), rtol=0.0, atol=1e-4)
    assert np.allclose(motion[:, 0], 8.0 * run.t, rtol=0.0, atol=2e-3)
    assert np.allclose(run.events[0][0], [0.5 * np.arccos(0.8)], rtol=0.0, atol=1e-4)


def test_a_joint_with_several_coordinates_says_which_are_angles():
    @record
    class Silent(CylindricalJoint):
        """It does not say."""

        turns: ClassVar[Any] = True

    with pytest.raises(errors.InvalidType, match=r"Silent: turns says of each of its 2 coordinates .* \(True, False\)"):
        Silent(0, None)


def test_springs_see_the_angle_of_a_plane_about_their_rest():
    """At rest half a turn away a body stays, from either side of the jump of atan2."""
    for rest in (np.pi - 0.01, 4.0):
        body = alone(PlanarJoint(0, None, O, O, Z, Z, name="p"), forces=[Spring("p", 1.0, rest, freedom=2)])
        for away in (0.1, -0.1):
            start = body.state(angles={"p": [0.0, 0.0, rest + away]})
            energy = float(body.energy(lm.vec(*np.array(start.mu)), lm.vec(*np.array(start.g))))
            assert np.isclose(energy, 0.5 * 0.1 * 0.1, rtol=1e-9)


@lm.record
class Socket(Joint):
    """A ball joint of one's own, which is none to the library."""

    conditions: ClassVar[int] = 3
    freedoms: ClassVar[int] = 3
    turns: ClassVar[bool | tuple[bool, ...]] = (False, False, False)
    rotation_vector: ClassVar[tuple[int, ...]] = (0, 1, 2)

    def value(self, g: Any, k: Any) -> Any:
        return BallJoint(0, None, O, O).value(g, k)

    def rows(self, g: Any, k: Any) -> Any:
        return BallJoint(0, None, O, O).rows(g, k)

    def coordinates(self, g: Any, k: Any) -> Any:
        return BallJoint(0, None, O, O).coordinates(g, k)

    def motions(self, g: Any, k: Any) -> Any:
        return BallJoint(0, None, O, O).motions(g, k)

    def relative(self, q: Any) -> Any:
        return BallJoint(0, None, O, O).relative(q)


@pytest.mark.parametrize(
    ("joint", "rate"),
    [
        (BallJoint(0, None, O, O, name="b"), [0.0, 10.0, 0.0]),
        (FloatingJoint(0, None, name="b"), [0.0, 10.0, 0.0] + O),
        (Socket(0, None, name="b"), [0.0, 10.0, 0.0]),
    ],
    ids=["ball", "free", "one's own"],
)
def test_a_rotation_vector_is_met_at_its_level_not_where_it_jumps(joint, rate):
    """Of a turn about e2 the second component rises through the level once in a turn."""
    more = [] if joint.conditions else [BallJoint(1, None, O, O)]
    body = Linkage([Link(1.0, [0.1] * 3)] * (1 + len(more)), [joint, *more], gravity=0.0)
    start = body.state(angles={}, rates={"b": rate})
    run = lm.integrate(
        body, lm.LieRATTLE(), start, h=0.01, steps=150, events=[body.angle("b", 0.5, freedom=1)],
        compiled=False, progress=False,
    )  # fmt: skip
    angles = [float(np.arctan2(body.poses(g)[0, 0, 2], body.poses(g)[0, 0, 0])) for g in run.events[0][1].g]
    assert np.allclose(angles, [0.5] * 3, rtol=0.0, atol=1e-9)


@record
class Wound(lm.joints.JointPotential):
    """A spring that counts the turns of what turns near w t."""

    k: float
    w: float

    def energy(self, q: float) -> float:
        return 0.5 * self.k * q * q

    def about(self, t: float) -> float:
        return self.w * t


@pytest.mark.parametrize("in_memory", [False, True])
@pytest.mark.parametrize("t0", [0.0, 6.0])
def test_a_spring_looks_about_an_angle_that_moves(t0: float, in_memory: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """q'' = -(k/J) q with all turns of q, where the pose tells them but for whole ones."""
    if in_memory:
        monkeypatch.setattr(lm.System, "small", 0)
    body = alone(RevoluteJoint(0, None, O, O, Z, Z, name="w"), forces=[Wound("w", 0.02, 1.5)])
    start = body.state(angles={"w": 1.5 * t0 + 0.2}, rates={"w": 1.5}, t=t0)
    run = lm.integrate(body, lm.LieRATTLE(), start, h=0.01, steps=100, t0=t0, compiled=False, progress=False)
    s, pace = run.t - t0, np.sqrt(0.2)
    exact = (1.5 * t0 + 0.2) * np.cos(pace * s) + 1.5 / pace * np.sin(pace * s)
    seen = run.joint("w").angle
    assert np.abs(np.sin(0.5 * (seen - exact))).max() < 1e-5


@lm.record
class Screw(RevoluteJoint):
    """A hinge along whose axis the body moves by `pitch` for each radian: another condition, and nothing else."""

    pitch: float = 0.15

    def value(self, g: Any, k: Any) -> Vec:
        x, y, z, *axes = super().value(g, k)
        return vec(x, y, z - self.pitch * self.coordinates(g, k)[0], *axes)


def test_a_joint_moves_by_its_own_conditions_and_not_by_derivatives_of_those_of_its_base():
    """A body that falls along a screw of the pitch p: (J + m p^2) q'' = -m g p."""
    m, J, p, gravity = 1.3, 0.2, 0.15, 9.81
    body = Linkage([Link(m, [0.1, 0.15, J])], [Screw(0, None, O, O, Z, Z, pitch=p, name="s")], gravity)
    start = body.state(xi=[0.0, 0.0, 1.0, 0.0, 0.0, p], g=np.eye(4).ravel())
    run = lm.integrate(body, lm.LieRATTLE(), start, h=0.01, steps=20, compiled=False, progress=False)
    exact = run.t - 0.5 * m * gravity * p / (J + m * p * p) * run.t**2
    assert np.allclose(run.joint("s").angle, exact, rtol=0.0, atol=1e-12)


@lm.record
class InDegrees(RevoluteJoint):
    """A hinge whose coordinate is in degrees."""

    turns: ClassVar[Any] = False

    def coordinates(self, g: Any, k: Any) -> Vec:
        return 180.0 / np.pi * super().coordinates(g, k)


def test_rates_and_poses_follow_from_coordinates_that_are_written_anew():
    body = alone(InDegrees(0, None, O, O, Z, Z, name="w"))
    run = lm.integrate(
        body, lm.LieRATTLE(), body.state(xi=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0], g=np.eye(4).ravel()), h=0.01, steps=4,
        compiled=False, progress=False,
    )  # fmt: skip
    assert run.joint("w").rate == pytest.approx(np.full(5, 180.0 / np.pi), rel=1e-12)
    assert run.joint("w").angle == pytest.approx(180.0 / np.pi * run.t, rel=1e-12)
    with pytest.raises(errors.NotDefined, match="InDegrees must define `relative`"):
        body.state(angles={"w": 30.0})


def test_a_potential_whose_effort_asks_for_more_than_the_place_is_refused():
    """It was asked for its effort at t = 0 and at rest."""

    @lm.record
    class Swelling(Spring):
        def effort(self, t: float, q: float, rate: float) -> float:
            return -self.stiffness * (1.0 + t) * q

    @lm.record
    class Braked(Spring):
        def effort(self, t: float, q: float, rate: float) -> float:
            return -self.stiffness * q - 0.3 * rate

    @lm.record
    class Abbreviated(Spring):
        def effort(self, t: float, q: float, rate: float) -> float:
            return self.stiffness * (self.rest - q)

    joint = RevoluteJoint(0, None, O, O, Z, Z, name="w")
    for kind in (Swelling, Braked):
        with pytest.raises(errors.InvalidInput, match=f"{kind.__name__}.effort may depend on more than the place"):
            alone(joint, forces=[kind("w", 2.0)])
    assert alone(joint, forces=[Abbreviated("w", 2.0)]).body.load is None
