"""Springs along rotation vectors: their torque is the slope of their energy along the turns of the first body."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.joints import BallJoint, FloatingJoint, Link, Linkage, Motor, Spring
from liemech.joints.joints import Joint

POINT, PLACE = (0.1, 0.2, 0.3), (0.3, -0.1, 0.2)


@lm.record
class OwnBall(Joint):
    """A ball joint that a user has written, who says that its coordinates are a rotation vector."""

    conditions: ClassVar[int] = 3
    freedoms: ClassVar[int] = 3
    turns: ClassVar[Any] = (False, False, False)
    rotation_vector: ClassVar[Any] = (0, 1, 2)

    at_first: lm.Vec
    at_second: lm.Vec

    def ball(self):
        return BallJoint(self.first, self.second, self.at_first, self.at_second)

    def value(self, g, k):
        return self.ball().value(g, k)

    def rows(self, g, k):
        return self.ball().rows(g, k)

    def coordinates(self, g, k):
        return self.ball().coordinates(g, k)

    def motions(self, g, k):
        return self.ball().motions(g, k)

    def relative(self, q):
        return self.ball().relative(q)


def body(kind, freedom):
    """One body on a spring that is at ease turned by 0.2 rad about each axis, or about one."""
    links, joints = [Link(1.0, [0.1, 0.13, 0.17])], [kind(0, None, POINT, PLACE, name="j")]
    forces = [Spring("j", 3.0, 0.2, freedom=freedom)]
    if kind is FloatingJoint:  # what floats is a linkage beside a body that is held
        links, joints = [*links, Link(1.0, [0.1] * 3)], [*joints, BallJoint(1, None, name="held")]
    return Linkage(links, joints, gravity=0.0, forces=forces)


@pytest.mark.parametrize("freedom", [None, 0, 2])
@pytest.mark.parametrize("kind", [BallJoint, FloatingJoint, OwnBall])
def test_the_torque_is_the_slope_of_the_energy(kind, freedom):
    system = body(kind, freedom)
    free = 6 if kind is FloatingJoint else 3
    q = [0.9, -0.7, 0.5, 0.3, -0.2, 0.4][:free]
    start = system.state(angles={"j": q})
    run = lm.integrate(system, lm.LieRATTLE(), start, h=1e-3, steps=1, compiled=False, progress=False)
    told, pose = np.array(run.joint("j").torque[0]), system.poses(start.g)[0]
    for axis in range(3):  # turned about the point that is held, about its own axes

        def energy(angle, axis=axis):
            turn = lm.SO3().exp((angle * np.eye(3)[axis]).tolist())
            turned = system.poses(start.g)
            turned[0, :3, :3] = pose[:3, :3] @ turn
            turned[0, :3, 3] = pose[:3, 3] + (pose[:3, :3] - turned[0, :3, :3]) @ POINT
            return system.energy(np.zeros_like(start.mu), turned.ravel())

        slope = (8.0 * (energy(1e-3) - energy(-1e-3)) - (energy(2e-3) - energy(-2e-3))) / 12e-3
        assert told[axis] == pytest.approx(-slope, rel=1e-9)


@pytest.mark.parametrize("freedom", [None, 1])
def test_the_energy_of_a_ball_on_a_bent_spring_is_kept(freedom):
    system = body(BallJoint, freedom)
    start = system.state(angles={"j": [0.9, -0.7, 0.5]}, rates={"j": [0.3, 0.5, -0.4]})
    change = []
    for h in (0.04, 0.02):
        run = lm.integrate(system, lm.LieRATTLE(), start, h=h, steps=round(0.6 / h), compiled=False, progress=False)
        change.append(np.ptp(run.energy))
    assert change[0] < 5e-3 * start_energy(system, start)
    assert change[0] / change[1] == pytest.approx(4.0, rel=0.2)


def start_energy(system, start):
    return system.energy(start.mu, start.g)


def test_motors_push_along_angular_velocities():
    """A motor of 2 N m along the second axis of the first body, whatever the rotation vector is."""
    joints = [BallJoint(0, None, name="j")]
    system = Linkage([Link(1.0, [0.1] * 3)], joints, gravity=0.0, forces=[Motor("j", 2.0, freedom=1)])
    start = system.state(angles={"j": [0.9, -0.7, 0.5]})
    run = lm.integrate(system, lm.LieRATTLE(), start, h=1e-3, steps=4, compiled=False, progress=False)
    assert run.joint("j").rate[-1] == pytest.approx([0.0, 2.0 * 4e-3 / 0.1, 0.0], rel=1e-12, abs=1e-14)
