"""Situations in which users of other packages met wrong turns of bodies, observers that disturbed what they observed, and
noise in the wrong place: repository and number of each report, the value by a closed form or by what is conserved.
"""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest

import liemech as lm
from liemech.joints import Link, Linkage, RevoluteJoint

es, ROTATIONS = lm.estimation, lm.SO3()
ORIGIN, UP = [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]
METHODS = [lm.RKMK(order=4), lm.CovariantVariational(), lm.MoserVeselov(), lm.ExactFreeBody()]


def turn(axis: int, angle: float) -> np.ndarray:
    """A rotation about a coordinate axis, entry by entry."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(angle)
    R[j, i], R[i, j] = np.sin(angle), -np.sin(angle)
    return R


# ------------------------------------------------------------------ how far a body turns


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_radian_a_second_is_a_radian_after_a_second(method: Any) -> None:
    """google/brax#62: it turned twice as fast; mit-aera/FlightGoggles#67: half of it; sofa-framework/sofa#172: less in
    long steps.  About a principal axis, on which all are exact but for Moser and Veselov's, of order 2.
    """
    body = lm.RigidBody([1.0, 1.6, 2.3])
    start = body.state(mu=[0.0, 0.0, 2.3], g=np.eye(3))
    for h in (0.01, 0.5):
        run = lm.integrate(body, method, start, h=h, steps=round(1.0 / h), compiled=False)
        seen = float(np.arctan2(run.g[-1][1, 0], run.g[-1][0, 0]))
        error = h * h / 5.0 if isinstance(method, lm.MoserVeselov) else 1e-13
        assert abs(seen - 1.0) < error


def test_steps_of_more_than_half_a_turn() -> None:
    """sofa-framework/sofa#172: a chart that holds less than half a turn.  7 rad about a slanted axis in one step."""
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    sphere = lm.RigidBody([2.0, 2.0, 2.0])
    run = lm.integrate(
        sphere, lm.RKMK(order=4), sphere.state(mu=14.0 * axis, g=np.eye(3)), h=1.0, steps=1, compiled=False
    )
    assert np.allclose(run.g[-1], ROTATIONS.exp(7.0 * axis), rtol=0.0, atol=1e-14)
    assert np.trace(run.g[-1]) == pytest.approx(1.0 + 2.0 * np.cos(7.0), rel=1e-13)


def test_rates_of_the_body_turn_about_the_axes_of_the_body() -> None:
    """KieranWynn/pyquaternion#53, IMRCLab/crazyswarm2#383: rates in the body were taken for rates in space.  A pitch of
    80 degrees and then a roll of 30 about the body's own axis, and the other way round.
    """
    gyroscope = es.Turning(ROTATIONS, [0.0, 0.0, 0.0])
    still = np.zeros(3)
    for first, then in ((1, 0), (0, 1)):
        begun = turn(first, np.deg2rad(80.0))
        rate = np.deg2rad(30.0) * np.eye(3)[then]
        assert np.allclose(gyroscope.move(begun, rate, still, 1.0), begun @ turn(then, np.deg2rad(30.0)), atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.CovariantVariational(), lm.MoserVeselov(), lm.KickDrift()], ids=repr)
def test_a_body_that_tumbles_does_not_creep_to_its_middle_axis(method: Any) -> None:
    """avianphysics/avian#993, #420: the energy went to L^2/(2 I_2), so that spins about stable axes turned over.  Near
    the axis of the largest moment the momentum stays within the cone of its first period.
    """
    body = lm.RigidBody([1.0, 2.0, 3.0])
    system = lm.MechanicalSystem(body, lm.NoPotential()) if isinstance(method, lm.KickDrift) else body
    start = system.state(mu=[0.3, 0.1, 3.0], g=np.eye(3))
    run = lm.integrate(system, method, start, h=0.4, steps=1500, compiled=False)
    sides = np.hypot(run.mu[:, 0], run.mu[:, 1])
    assert sides.max() < 1.001 * sides[:150].max()
    assert np.linalg.norm(run.mu, axis=1) == pytest.approx(np.sqrt(9.1), rel=1e-12)


def test_products_of_inertia_have_their_sign_and_place() -> None:
    """mahaarbo/urdf2casadi#2, newton-physics/urdf-usd-converter#118, isaac-sim/urdf-importer-extension#2,
    bulletphysics/bullet3#783: wrong with products of inertia.  A link that hangs on a hinge through its centre, off its
    principal axes, about which the moment is n . J n; the bearing carries the rest of the rate of J w.
    """
    text = """<robot name="r"><link name="wall"/><link name="rod"><inertial><mass value="2"/>
        <inertia ixx="0.268209" ixy="0.011284" ixz="0.0635697" iyy="0.359486" iyz="-0.00106685" izz="0.225659"/></inertial></link>
        <joint name="h" type="continuous"><parent link="wall"/><child link="rod"/><axis xyz="0.36 0.48 0.8"/></joint></robot>"""
    J = np.array(
        [[0.268209, 0.011284, 0.0635697], [0.011284, 0.359486, -0.00106685], [0.0635697, -0.00106685, 0.225659]]
    )
    n = np.array([0.36, 0.48, 0.8])
    robot = Linkage.from_urdf(text, forces=[lm.joints.Motor("h", 0.5)])
    run = lm.integrate(robot, lm.LieRATTLE(), robot.state(angles={}), h=0.01, steps=20, compiled=False)
    assert run.joint("h").angle[-1] == pytest.approx(0.5 * 0.5 / (n @ J @ n) * 0.2**2, rel=1e-9)
    free = Linkage.from_urdf(text)
    spun = lm.integrate(free, lm.LieRATTLE(), free.state(angles={}, rates={"h": 3.0}), h=1e-3, steps=2, compiled=False)
    # the torque of the bearing on the rod is w x J w, seen in space
    wanted = spun.link("rod").pose[1][:3, :3] @ np.cross(3.0 * n, J @ (3.0 * n))
    assert spun.joint("h").moment[1] == pytest.approx(wanted, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize(
    "moments",
    [
        'ixx="16616.493" ixy="-2240.0581" ixz="0" iyy="-2240.0581" iyz="16616.324" izz="0"',
        'ixx="-0.0012" ixy="0" ixz="0" iyy="-0.0012" iyz="0" izz="0.0003"',
    ],
)
def test_moments_of_no_body_are_refused(moments: str) -> None:
    """fiveages-sim/robot_descriptions#29, AlphaDogDeveloper/dev_robot_control_sdk#30: one program took the file and
    went on without the moments.
    """
    text = f"""<robot name="r"><link name="a"/><link name="b"><inertial><mass value="51"/><inertia {moments}/></inertial></link>
        <joint name="h" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>"""
    with pytest.raises(lm.errors.InvalidInput, match="b"):
        Linkage.from_urdf(text)


# ------------------------------------------------------------------ small angles


@pytest.mark.parametrize("angle", [1e-9, 1e-5, 6e-4, 2e-3, 8e-3, 0.03])
def test_series_for_small_angles_have_their_factors(angle: float) -> None:
    """strasdat/Sophus#117, #238, #108: a term of the series of half angles lacked its power of two."""
    axis = [mpmath.mpf(1) / 3, mpmath.mpf(2) / 3, mpmath.mpf(2) / 3]
    with mpmath.workdps(50):
        hat = mpmath.matrix([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        w = mpmath.mpf(angle)
        exact = mpmath.eye(3) + mpmath.sin(w) * hat + (1 - mpmath.cos(w)) * hat * hat
        wanted = np.array(exact.tolist(), dtype=float)
        vector = np.array([float(w * x) for x in axis])
        q = np.array([*[float(mpmath.sin(w / 2) * x) for x in axis], float(mpmath.cos(w / 2))])
    eps = 2.0**-52
    assert np.abs(np.array(ROTATIONS.exp(vector)) - wanted).max() < 2.0 * eps
    assert np.abs(np.array(ROTATIONS.log(wanted)) - vector).max() < 4.0 * eps
    assert np.abs(np.array(lm.UnitQuaternions().exp(vector)) - q).max() < 2.0 * eps
    assert np.abs(np.array(lm.UnitQuaternions().log(q)) - vector).max() < 4.0 * eps * max(angle, 2.0**-20)


def test_the_logarithm_has_a_derivative_at_the_identity() -> None:
    """brentyi/jaxlie#9, #10: it was nan.  Along a turn it is the rate of the turn."""

    def along(t: float) -> Any:
        return ROTATIONS.log(ROTATIONS.exp(t * lm.vec(0.2, -0.5, 0.3)))

    for t in (0.0, 1e-12, 1e-5):
        assert np.allclose(lm.formulas.derivative(along, t, 1.0), [0.2, -0.5, 0.3], rtol=1e-12)


# ------------------------------------------------------------------ observers that disturb nothing


def rising(t: float, state: Any) -> Any:
    """Where the momentum along the first axis grows through zero."""
    return state.mu[0]


def falling(t: float, state: Any) -> Any:
    """Where it shrinks through zero."""
    return state.mu[0]


rising.direction, falling.direction = 1, -1  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"h": 0.05}, {"rtol": 1e-10, "atol": 1e-12}], ids=["fixed", "adaptive"])
def test_two_events_of_one_condition_are_both_met(how: dict[str, Any]) -> None:
    """SciML/ModelingToolkit.jl#4870: of two one-sided events with the same condition one was never called.  About a body
    with two equal moments mu_1 = cos(w t) with w = mu_3 (1/J_3 - 1/J_1) = -1 here.
    """
    body = lm.RigidBody([1.0, 1.0, 2.0])
    start = body.state(mu=[1.0, 0.0, 2.0])
    run = lm.integrate(body, lm.RKMK(order=5), start, t_end=12.0, events=[rising, falling], compiled=False, **how)
    assert run.events[0][0] == pytest.approx([1.5 * np.pi, 3.5 * np.pi], rel=1e-6)
    assert run.events[1][0] == pytest.approx([0.5 * np.pi, 2.5 * np.pi], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"h": 0.1}, {"rtol": 1e-8, "atol": 1e-10}], ids=["fixed", "adaptive"])
def test_what_is_observed_does_not_move_what_happens(how: dict[str, Any]) -> None:
    """SciML/OrdinaryDiffEq.jl#1191, SciML/DiffEqCallbacks.jl#126: times of events changed when values were saved beside
    them.  Times to the last bit, whatever is kept, with whatever else is looked for.
    """
    body = lm.RigidBody([1.0, 1.6, 2.3])
    start = body.state(mu=[2.5, -1.5, 4.5])  # alone: what is not recorded is not computed
    ways: list[dict[str, Any]] = [
        {}, {"record": ["energy"]}, {"t_eval": [0.0, 0.3, 7.7]}, {"events": [falling, rising]},
        {"record": ["mu", ("when", float_of)]},
    ]  # fmt: skip
    met = []
    for way in ways:
        options = {"events": [rising, falling]} | how | way
        method = lm.RKMK(order=4) if "h" in how else lm.RKMK(order=5)
        run = lm.integrate(body, method, start, t_end=12.0, compiled=False, **options)
        of = 1 if way.get("events") else 0
        met.append(run.events[of][0])
    assert len(met[0]) > 1 and all(np.array_equal(met[0], times) for times in met)


def float_of(t: float, state: Any) -> float:
    """The time."""
    return t


@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.RKMK(order=8)], ids=repr)
def test_dense_motion_backwards_at_many_times(method: Any) -> None:
    """SciML/DifferentialEquations.jl#142, #196: of a run backwards the motion at many times at once was wrong, at each
    alone right; scipy/scipy#9282: times of samples and the motion between were at odds.
    """
    body = lm.RigidBody([1.0, 1.0, 2.0])
    start = body.state(mu=[1.0, 0.0, 2.0])
    times = [0.0, 1.0, 1.9, 5.0, 5.0]
    options: Any = {"t0": 5.0, "t_end": -3.0, "rtol": 1e-10, "atol": 1e-12, "dense": True, "compiled": False}
    run = lm.integrate(body, method, start, t_eval=[5.0, 2.5, -3.0], **options)
    assert np.array_equal(run.t, [5.0, 2.5, -3.0])
    together = run.at(times).mu
    assert np.array_equal(together, [run.at(t).mu for t in times])
    # mu_1 + i mu_2 turns by mu_3 (1/J_1 - 1/J_3) = 1 a second
    since = np.array(times) - 5.0
    turned = np.column_stack([np.cos(since), np.sin(since)])
    assert np.allclose(np.abs(together[:, :2]), np.abs(turned), rtol=0.0, atol=1e-7)


# ------------------------------------------------------------------ noise in its place


@lm.record
class Wheels(es.Process):
    """Two wheels a width apart: their speeds give the turn and the way."""

    group: lm.SE2
    width: float
    noise: float
    side: float

    @property
    def inputs(self) -> int:
        return 2

    def move(self, g: Any, u: Any, w: Any, h: Any) -> Any:
        left, right = u[0] + w[0], u[1] + w[1]
        return self.group.compose_exp(g, h * lm.vec((right - left) / self.width, 0.5 * (right + left), w[2]))

    def deviations(self, h: float) -> Any:
        return lm.vec(self.noise, self.noise, self.side)


@pytest.mark.parametrize("filter_of", [es.ErrorStateFilter, es.UnscentedFilter])
def test_the_noise_of_two_wheels_is_that_of_turn_and_way(filter_of: Any) -> None:
    """rpng/MINS#85: noises of turn and of slip were exchanged, and a factor of two was lost.  var(turn) = 2 s^2/b^2,
    var(way) = s^2/2, and they do not correlate, straight ahead; PX4/PX4-ECL#83: a noise was not squared.
    """
    b, s, slip, h = 0.4, 0.03, 0.002, 0.5
    filtered = filter_of(Wheels(lm.SE2(), b, s, slip))
    after = filtered.predict(filtered.belief(np.eye(3), [0.0, 0.0, 0.0]), [1.0, 1.0], h)
    P = np.array(after.covariance)
    # a turn on the way moves the end to the side by half the way, seen from the end against the heading
    assert P[0, 0] == pytest.approx(2.0 * (h * s / b) ** 2, rel=1e-3)
    assert P[1, 1] == pytest.approx(0.5 * (h * s) ** 2, rel=1e-2)
    assert P[2, 2] == pytest.approx((h * slip) ** 2 + (0.5 * h) ** 2 * P[0, 0], rel=1e-2)
    assert abs(P[0, 1]) < 1e-6 * P[0, 0]


def test_a_hinge_turns_as_the_rate_of_its_body_says() -> None:
    """RobotLocomotion/drake#4532: rates of attitudes and angular velocities were converted wrongly, and back.  On a
    turned frame both are one number, as is the body's angular velocity along the axis.
    """
    slanted = [0.36, 0.48, 0.8]
    hinge = Linkage([Link(1.0, [0.1, 0.2, 0.3])], [RevoluteJoint(0, None, ORIGIN, ORIGIN, UP, slanted, name="h")])
    start = hinge.state(angles={"h": 2.0}, rates={"h": 1.5})
    run = lm.integrate(hinge, lm.LieRATTLE(), start, h=0.01, steps=50, compiled=False)
    assert run.joint("h").rate == pytest.approx(np.full(51, 1.5), rel=1e-12)
    assert run.joint("h").angle[-1] - 2.0 == pytest.approx(0.75, rel=1e-4)
    w = np.array(run.link(0).velocity)[:, :3]
    poses = np.array([hinge.poses(g)[0, :3, :3] for g in run.g])
    assert np.allclose(np.einsum("nij,nj->ni", poses, w), 1.5 * np.array(slanted), rtol=0.0, atol=1e-13)
