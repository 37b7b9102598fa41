"""Situations in which users of other packages met wrong mechanisms: repository and number of each report, the value by
a closed form, by DOP853 or by what is conserved.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import liemech as lm
from liemech.joints import BallJoint, Link, Linkage, Motor, RevoluteJoint, Spring, Stops

UP, ACROSS = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]


def robot(inertial: str, joints: str = "", links: str = "", axis: str = "1 0 0") -> str:
    return f"""<robot name="one"><link name="wall"/><link name="arm"><inertial>{inertial}</inertial></link>{links}
    <joint name="hinge" type="continuous"><parent link="wall"/><child link="arm"/><axis xyz="{axis}"/></joint>
    {joints}</robot>"""


def ran(linkage: Any, h: float, steps: int, angles: Any = None, rates: Any = None, order: int = 2, **more: Any) -> Any:
    method: Any = lm.LieRATTLE() if order == 2 else lm.Composition(lm.LieRATTLE(), order=order)
    start = linkage.state(angles=angles or {}, rates=rates)
    return lm.integrate(linkage, method, start, h=h, steps=steps, compiled=False, progress=False, **more)


def swinging(length: float, angle: float, gravity: float = 9.8) -> float:
    """The period of a pendulum let go at an angle, 4 sqrt(l/g) K(sin^2(angle/2))."""
    return 4.0 * np.sqrt(length / gravity) * ellipk(np.sin(angle / 2.0) ** 2)


@pytest.mark.slow
def test_the_frame_of_an_inertia_in_a_file_may_be_turned() -> None:
    """google-deepmind/mujoco#3559, dartsim/dart#47: the rotation of the inertial frame was lost.
    diag(1, 2, 2.5) in a frame turned by 90 degrees about z resists a torque about x by 2 kg m^2.
    """
    turned = '<origin rpy="0 0 1.5707963267948966"/><mass value="3"/><inertia ixx="1" iyy="2" izz="2.5"/>'
    arm = Linkage.from_urdf(robot(turned), gravity=0.0, forces=[Motor("hinge", 1.0)])
    assert np.allclose(ran(arm, 0.01, 100).joint("hinge").rate[-1], 0.5, rtol=1e-12)


@pytest.mark.slow
def test_a_link_welded_on_weighs_about_the_hinge_as_steiner_says() -> None:
    """osrf/drcsim#308, gazebosim/sdformat#22: moments of lumped links were taken about the wrong point.
    Two rods with their centres at 0.5 and 1.5 m below the hinge: I = sum of J + m d^2, M d = sum of m d.
    """
    rod = '<origin xyz="0 0 -0.5"/><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.01"/>'
    below = f'<link name="lower"><inertial>{rod}</inertial></link>'
    weld = '<joint name="weld" type="fixed"><parent link="arm"/><child link="lower"/><origin xyz="0 0 -1"/></joint>'
    arm = Linkage.from_urdf(robot(rod, weld, below), gravity=9.8)
    inertia, lever = 2 * 0.1 + 2.0 * (0.25 + 2.25), 2.0 * (0.5 + 1.5)
    period = swinging(inertia / lever, 0.8)
    motion = ran(arm, period / 80, 80, {"hinge": 0.8}, order=4).joint("hinge")
    assert np.isclose(motion.angle[-1], 0.8, rtol=0.0, atol=1e-6) and abs(motion.angle[40] + 0.8) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("mass", [1e-7, 1.0, 1e7])
def test_a_light_link_swings_as_a_heavy_one(mass: float) -> None:
    """gazebosim/sdformat#199: a link of 1e-6 kg was left out without a word."""
    arm = Linkage(
        [Link(mass, mass * np.array([0.1, 0.1, 0.01]))],
        [RevoluteJoint(0, None, [0.0, 0.0, 0.5], [0.0] * 3, ACROSS, ACROSS)],
        9.8,
    )
    period = swinging((0.1 + 0.25) / 0.5, 0.5)
    assert np.isclose(ran(arm, period / 60, 60, {0: 0.5}, order=4).joint(0).angle[-1], 0.5, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("rate", [9.0, -9.0])
def test_an_angle_goes_on_over_whole_turns(rate: float) -> None:
    """gazebosim/gazebo-classic#724, #2430, osrf/drcsim#58: angles wrapped, here or there."""
    wheel = Linkage([Link(1.0, [0.1] * 3)], [RevoluteJoint(0, None, name="axle")], 0.0)
    motion = ran(wheel, 0.02, 200, rates={"axle": rate}).joint("axle")
    assert np.allclose(motion.angle, rate * 0.02 * np.arange(201), rtol=1e-12, atol=1e-12)


@lm.record
class Servo(lm.joints.JointForce):
    target: float

    def effort(self, t, q, rate):
        return 40.0 * (self.target - q) - 8.0 * rate

    def about(self, t):
        return self.target


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [45.0, 90.0, 135.0, 179.0, -100.0])
def test_a_servo_reaches_its_angle(degrees: float) -> None:
    """dimforge/rapier#378: targets at and beyond 90 degrees were missed, or turned for ever."""
    target = np.radians(degrees)
    axle = RevoluteJoint(0, None, name="axle")
    wheel = Linkage([Link(1.0, [0.4] * 3)], [axle], 0.0, forces=[Servo("axle", target)])
    motion = ran(wheel, 0.02, 75, order=4).joint("axle")  # critically damped: (1 + 10 t) exp(-10 t) of the way is left
    left = 1.0 - motion.angle / target
    t = 0.02 * np.arange(76)
    assert np.allclose(left, (1.0 + 10.0 * t) * np.exp(-10.0 * t), rtol=0.0, atol=1e-3) and abs(left[-1]) < 1e-5


@pytest.mark.slow
def test_a_pendulum_that_goes_over_the_top_does_so_smoothly() -> None:
    """louis-langholtz/PlayRho#331, NVIDIAGameWorks/PhysX#531: rates jumped where an angle passed pi."""
    arm = Linkage([Link(1.0, [0.01] * 3)], [RevoluteJoint(0, None, [0.0, 0.0, 0.5], [0.0] * 3, ACROSS, ACROSS)], 9.8)
    inertia = 0.01 + 0.25
    motion = ran(arm, 0.016, 100, rates={0: 10.0}, order=4).joint(0)
    law = lambda t, y: [y[1], -9.8 * 0.5 / inertia * np.sin(y[0])]  # noqa: E731
    at = 0.016 * np.arange(101)
    exact = solve_ivp(law, (0.0, at[-1]), [0.0, 10.0], "DOP853", t_eval=at, rtol=1e-12, atol=1e-12).y
    assert motion.angle[-1] > 3.0 * np.pi
    assert np.allclose(motion.angle, exact[0], rtol=0.0, atol=1e-3) and np.allclose(motion.rate, exact[1], atol=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_closed_loop_does_not_drift_apart(steps: int) -> None:
    """JuliaRobotics/RigidBodyDynamics.jl#480, google-deepmind/mujoco#172, #2698: loops came apart after seconds."""
    rods = [Link.rod(1.0, x, 0.02) for x in (1.0, 1.0, 1.0)]
    low, high = [0.0, 0.0, -0.5], [0.0, 0.0, 0.5]
    joints = [
        RevoluteJoint(0, None, low, [0.0] * 3, ACROSS, ACROSS, name="crank"),
        BallJoint(1, 0, low, high),
        BallJoint(2, 1, low, high),
        RevoluteJoint(2, None, high, [1.0, 0.0, 0.0], ACROSS, ACROSS, name="rocker"),
    ]
    loop = Linkage(rods, joints, 9.8)
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[0, :3, 3], poses[1, :3, 3], poses[2, :3, 3] = [0.0, 0.0, 0.5], [0.5, 0.0, 1.0], [1.0, 0.0, 0.5]
    poses[1, :3, :3] = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    poses[2, :3, :3] = np.diag([-1.0, 1.0, -1.0])
    start = loop.assembled(poses, np.zeros((3, 6)))
    run = lm.integrate(loop, lm.LieRATTLE(), start, h=0.01, steps=steps, every=steps // 20, progress=False)
    apart = np.abs([loop.conditions_at(mu, g)[0] for mu, g in zip(run.mu, run.g, strict=True)]).max()
    assert apart < 1e-13
    assert np.ptp(run.energy) < 5e-3 * abs(run.energy[0])


@pytest.mark.slow
def test_a_gear_hands_on_all_power() -> None:
    """ros-controls/ros2_control#1837, modelica/ModelicaStandardLibrary#951: efforts through a transmission did not keep
    the power.  A wheel that turns at twice the rate of the driven one weighs four times its inertia.
    """
    wheels = [Link(1.0, [0.3] * 3), Link(1.0, [0.1] * 3)]
    axles = [
        RevoluteJoint(0, None, [0.0] * 3, [0.0, 0.0, 0.0], UP, UP, name="slow", armature=0.05),
        RevoluteJoint(1, None, [0.0] * 3, [1.0, 0.0, 0.0], UP, UP, name="fast"),
    ]
    box = Linkage(wheels, axles, 0.0, forces=[Motor("slow", 1.5)], mimics=[lm.joints.Mimic("fast", "slow", ratio=2.0)])
    run = ran(box, 0.02, 50)
    slow, fast = run.joint("slow"), run.joint("fast")
    assert np.allclose(slow.rate[-1], 1.5 / (0.3 + 0.05 + 4.0 * 0.1), rtol=1e-10)
    assert np.allclose(fast.angle, 2.0 * slow.angle, atol=1e-12)
    assert np.isclose(run.energy[-1] - run.energy[0], slow.work[-1], rtol=1e-4)


@pytest.mark.slow
def test_a_joint_at_its_stop_leaves_another_body_alone() -> None:
    """google-deepmind/mujoco#1130: a limit changed the motion of a joint that it is not at."""
    axles = [
        RevoluteJoint(0, None, [0.0] * 3, [0.5, 0.0, 0.7], UP, UP, name="wheel"),
        RevoluteJoint(1, None, [0.0] * 3, [-0.5, 0.0, 0.7], UP, UP, name="block"),
    ]
    two = Linkage([Link(0.5, [0.01, 0.01, 0.02])] * 2, axles, 0.0, forces=[Stops("block", -0.5, 0.5, 1e3)])
    run = ran(two, 0.004, 300, rates={"wheel": 100.0, "block": 3.0})
    assert np.allclose(run.joint("wheel").rate, 100.0, rtol=1e-13)
    block = run.joint("block").angle
    assert -0.7 < block.min() < -0.5 and 0.5 < block.max() < 0.7


@pytest.mark.slow
def test_gravity_points_down_in_space_however_a_mount_is_turned() -> None:
    """tud-phi/soromox#209: gravity was turned with the mount of the robot.  A hinge whose axis leans by 60 degrees swings
    with g cos 60.
    """
    lean = np.radians(60.0)
    axis = np.array([np.sin(lean), 0.0, np.cos(lean)])  # from the vertical, so that the plane of swing leans by 60
    down = np.array([np.cos(lean), 0.0, -np.sin(lean)])  # steepest in that plane, across the axis
    arm = Linkage([Link(1.0, [0.2] * 3)], [RevoluteJoint(0, None, -0.5 * down, [0.0] * 3, axis, axis)], 9.8)
    period = swinging((0.2 + 0.25) / 0.5, 0.6, 9.8 * np.sin(lean))
    assert np.isclose(ran(arm, period / 60, 60, {0: 0.6}, order=4).joint(0).angle[-1], 0.6, rtol=0.0, atol=1e-6)


@pytest.mark.slow
def test_the_centre_of_mass_of_a_free_chain_falls_as_a_stone() -> None:
    """stack-of-tasks/pinocchio#2531, #1230: the velocity of the centre of mass had the wrong sign, masses were left out."""
    rods = [Link.rod(m, 0.4, 0.02) for m in (1.0, 2.0, 3.0)]
    low, high = [0.0, 0.0, -0.2], [0.0, 0.0, 0.2]
    free = Linkage(rods, [BallJoint(0, 1, low, high), BallJoint(1, 2, low, high)], 9.8)
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 2, 3] = [0.8, 0.4, 0.0]
    twists = np.zeros((3, 6))
    twists[:, 3] = 0.5
    twists[0, 0] = 1.0
    start = free.assembled(poses, twists)
    method: Any = lm.Composition(lm.LieRATTLE(), order=4)  # poses go by screws, so that a step is not exact here
    run = lm.integrate(free, method, start, h=0.02, steps=25, compiled=False, progress=False)
    weights = np.array([1.0, 2.0, 3.0]) / 6.0
    centre = np.einsum("k,nki->ni", weights, np.asarray(run.g).reshape(-1, 3, 4, 4)[:, :, :3, 3])
    pushes = np.array([free.total_momentum(mu, g)[3:] for mu, g in zip(run.mu, run.g, strict=True)])
    assert np.allclose(pushes, pushes[0] - 6.0 * 9.8 * np.outer(run.t, UP), rtol=0.0, atol=1e-12)
    exact = centre[0] + np.outer(run.t, pushes[0] / 6.0) - 0.5 * 9.8 * np.outer(run.t**2, UP)
    assert np.allclose(centre, exact, rtol=0.0, atol=1e-7)


def test_a_spring_that_is_wound_twice_is_refused_and_not_unwound() -> None:
    """saharan/OimoPhysics#19, ros-controls/ros_controllers#264: a torsion spring took the shortest way."""
    axle = RevoluteJoint(0, None, name="axle")
    wheel = Linkage([Link(1.0, [0.4] * 3)], [axle], 0.0, forces=[Spring("axle", 2.0)])
    with pytest.raises(lm.errors.InvalidInput, match="axle"):
        wheel.state(angles={"axle": 5.0})
