"""Situations in which users of other packages met wrong runs, maps and files: repository and number of each report, the
value by a closed form, by DOP853 or by what is conserved.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.special import ellipk

import liemech as lm
from liemech.joints import FixedJoint, Link, Linkage, PlanarJoint

ROTATIONS = lm.SO3()
BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=np.eye(3))
ADAPTIVE = [lm.RKMK(order=5), lm.Taylor(order=12)]


@lm.record
class Straight(lm.SeparableSystem):
    """A mass that nothing pulls."""

    degrees: ClassVar[int] = 1

    def kinetic(self, p: Any) -> Any:
        return lm.dot(p, p) / 2.0

    def potential(self, q: Any) -> Any:
        return 0.0 * q[0]


FREE = Straight()


def level(place: float, terminal: Any = False, direction: float = 0.0) -> Any:
    """The event of a mass at a place."""

    def event(t: float, state: Any) -> float:
        return state.q[0] - place

    event.terminal, event.direction = terminal, direction  # type: ignore[attr-defined]
    return event


# ------------------------------------------------------------------ backwards


@pytest.mark.parametrize("h", [None, -0.3, -2.0])
def test_events_next_to_each_other_backwards(h: float | None) -> None:
    """SciML/DifferentialEquations.jl#1087: an endless loop between successive events of a run backwards."""
    places = [0.9, 0.9 - 1e-8, 0.5, 0.5 - 1e-8, -0.25]
    method, how = (lm.RKMK(order=5), {}) if h is None else (lm.StormerVerlet(), {"h": h})
    start = FREE.state(q=[1.0], p=[1.0])
    events = [level(place) for place in places]
    run = lm.integrate(FREE, method, start, t0=1.0, t_end=-1.0 if h != -0.3 else -0.5, events=events, **how)
    for place, (times, _) in zip(places, run.events, strict=True):
        assert times == pytest.approx([place], abs=1e-12)


@pytest.mark.parametrize("h", [None, -4.0])
def test_the_first_event_backwards_ends_the_run(h: float | None) -> None:
    """SciML/DiffEqBase.jl#1231, #1184, SciML/OrdinaryDiffEq.jl#2691: of several events in one step backwards the last was
    taken, one at the end of a step was an exception, and so was one that ends the run.
    """
    method, how = (lm.RKMK(order=5), {}) if h is None else (lm.StormerVerlet(), {"h": h})
    start = FREE.state(q=[2.0], p=[1.0])
    events = [level(x, True) for x in (0.0, 1e-8, 2e-8)]
    run = lm.integrate(FREE, method, start, t0=2.0, t_end=-2.0, events=events, **how)
    assert run.ended == 2 and run.t[-1] == pytest.approx(2e-8, abs=1e-15)
    assert [len(times) for times, _ in run.events] == [0, 0, 1]
    run = lm.integrate(FREE, method, start, t0=2.0, t_end=-2.0, breaks=[1.0], events=level(1.0, True), **how)
    assert run.ended == 0 and run.t[-1] == pytest.approx(1.0, abs=1e-14)


# ------------------------------------------------------------------ times


@pytest.mark.parametrize("method", ADAPTIVE)
def test_short_steps_dense_and_events_where_they_end(method: Any) -> None:
    """scipy/scipy#19418: with a small max_step, dense output and events a time stood twice."""
    events = [level(0.1 * k) for k in range(1, 10)] + [level(0.95, True)]
    start = FREE.state(q=[0.0], p=[1.0])
    run = lm.integrate(FREE, method, start, t_end=1.0, max_step=0.05, dense=True, events=events)
    assert (np.diff(run.t) > 0.0).all() and run.t[-1] == pytest.approx(0.95, abs=1e-14)
    assert [len(times) for times, _ in run.events] == [1] * 10
    times = np.linspace(0.0, run.t[-1], 50)
    assert np.allclose(run.at(times).q[:, 0], times, rtol=0.0, atol=1e-14)


def test_a_run_begins_at_a_zero_where_an_input_jumps() -> None:
    """patrick-kidger/diffrax#713: it went backwards, and found the zero at which it had begun once more."""
    kink, start = level(0.98, direction=1.0), FREE.state(q=[0.0], p=[1.0])
    ending = level(0.98, True)
    first = lm.integrate(FREE, lm.RKMK(order=5), start, t_end=2.0, events=ending, breaks=[0.98])
    assert first.t[-1] == pytest.approx(0.98, abs=1e-14)
    rest = lm.integrate(
        FREE, lm.RKMK(order=5), first.last, t0=float(first.t[-1]), t_end=2.0, events=kink, breaks=[0.98]
    )
    assert (np.diff(rest.t) > 0.0).all() and not len(rest.events[0][0])


def test_a_step_that_is_not_taken_meets_no_event() -> None:
    """patrick-kidger/diffrax#464: an event went off on a rejected step. |q| of a circular orbit stays 1; a first step of
    half a turn and more ends far from it.
    """
    planet = lm.Kepler()

    def far(t: float, state: Any) -> float:
        return lm.norm(state.q) - 1.01

    run = lm.integrate(planet, lm.RKMK(order=5), planet.pericentre(0.0), h=3.0, rtol=1e-8, t_end=7.0, events=far)
    assert run.rejected > 0 and not len(run.events[0][0])


@pytest.mark.parametrize(
    "h", [0.1, 60.0 / 599.0, np.nextafter(60.0 / 599.0, 0.0), 2.0 * np.pi * 0.64108339**1.5 / 31.0]
)
def test_samples_that_are_almost_a_step_apart(h: float) -> None:
    """hannorein/rebound#246, #94: a run to the next time of output stalled where that was nearly a step away."""
    times = np.linspace(0.0, 60.0, 600)
    run = lm.integrate(
        FREE, lm.StormerVerlet(), FREE.state(q=[0.0], p=[1.0]), h=h, steps=int(60.0 / h) + 1, t_eval=times
    )
    assert run.t.tolist() == times.tolist()
    assert np.allclose(run.q[:, 0], times, rtol=1e-12, atol=1e-13)


# ------------------------------------------------------------------ maps


def test_motion_between_samples_does_not_depend_on_the_frame() -> None:
    """bdaiinstitute/spatialmath-python#122, petercorke/spatialmath-matlab#21: interpolated poses depended on the attitude of
    the start.
    """
    turn = np.asarray(ROTATIONS.exp([2.0, -1.0, 0.5]))
    other = BODY.state(mu=START.mu, g=turn)
    for method, how in ((lm.RKMK(order=5), {"t_end": 5.0, "rtol": 1e-6}), (lm.RKMK(order=4), {"h": 1.0, "steps": 5})):
        one, two = [lm.integrate(BODY, method, start, **how) for start in (START, other)]
        times = np.linspace(0.0, 5.0, 41)
        assert np.allclose(turn @ one.at(times).g, two.at(times).g, rtol=0.0, atol=1e-6 if "rtol" in how else 1e-13)


# ------------------------------------------------------------------ bodies and robots


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, 26.0])
def test_a_body_welded_to_a_light_one_turns_as_one_body(ratio: float) -> None:
    """google-deepmind/mujoco#3553: a free body whose inertia sat on a fixed child blew up after 4294 steps. Its angular
    momentum and energy are those of the whole.
    """
    thin = np.array([0.00017231, 0.00000658 * ratio, 0.00017243])
    weld = FixedJoint(1, 0, [0.0] * 3, [0.0] * 3)
    pair = Linkage([Link(1e-9, [1e-12] * 3), Link(0.12, thin)], [weld], 0.0)
    spin = np.array([0.0, 20.0, 3.0])
    momenta = np.concatenate([1e-12 * spin, np.zeros(3), thin * spin, np.zeros(3)])
    start = pair.state(mu=momenta, g=np.tile(np.eye(4), (2, 1, 1)).ravel())
    run = lm.integrate(pair, lm.LieRATTLE(), start, h=1e-3, steps=500, compiled=False, progress=False)
    assert abs(run.energy[-1] / run.energy[0] - 1.0) < 1e-4
    momentum = (
        np.asarray(run.g).reshape(-1, 2, 4, 4)[:, 1, :3, :3] @ np.asarray(run.mu).reshape(-1, 2, 6)[:, 1, :3, None]
    )
    assert np.allclose(momentum[-1], momentum[0], rtol=0.0, atol=1e-7 * np.abs(momentum).max())


def hinged(axis: str, more: str = "", inertial: str = "") -> str:
    inertial = inertial or '<origin xyz="0 0 -0.5"/><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/>'
    return f"""<robot name="r"><link name="wall"/><link name="arm"><inertial>{inertial}</inertial></link>
    <joint name="hinge" type="continuous"><parent link="wall"/><child link="arm"/>{more}<axis xyz="{axis}"/></joint></robot>"""


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["0.638404 -0.769701 0.0", "0 1.5 0", "3 4 0", "0 -1e-3 0"])
def test_an_axis_of_any_direction_and_length(axis: str) -> None:
    """petercorke/robotics-toolbox-python#441, ros/kdl_parser#31: axes that are no coordinate axes were turned onto one. A
    pendulum below any horizontal axis has the period 4 sqrt(I/(M g d)) K.
    """
    robot = Linkage.from_urdf(hinged(axis), gravity=9.8)
    period = 4.0 * np.sqrt((0.1 + 2.0 * 0.25) / (2.0 * 9.8 * 0.5)) * ellipk(np.sin(0.35) ** 2)
    run = lm.integrate(
        robot, lm.Composition(lm.LieRATTLE(), order=4), robot.state(angles={"hinge": 0.7}), h=period / 60, steps=60,
        compiled=False, progress=False,
    )  # fmt: skip
    assert run.joint("hinge").angle[-1] == pytest.approx(0.7, abs=1e-5)
    assert run.joint("hinge").angle[30] == pytest.approx(-0.7, abs=1e-5)


def test_origins_that_say_half_or_nothing() -> None:
    """compas-dev/compas#171, SemRoCo/giskardpy#13, Genesis-Embodied-AI/genesis-world#2499: origins without rpy, without xyz,
    or none at all failed to parse.
    """
    inertia = '<mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.3"/>'
    for more in ("", '<origin xyz="0 0 0"/>', '<origin rpy="0 0 0"/>', "<origin/>"):
        robot = Linkage.from_urdf(hinged("0 0 1", more, more + inertia), gravity=0.0)
        start = robot.state(angles={"hinge": 0.3}, rates={"hinge": 2.0})
        run = lm.integrate(robot, lm.LieRATTLE(), start, h=0.01, steps=10, compiled=False, progress=False)
        assert run.joint("hinge").angle[-1] == pytest.approx(0.5, rel=1e-12)
        assert run.energy[0] == pytest.approx(0.5 * 0.3 * 4.0, rel=1e-12)


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
def test_a_plane_is_that_of_its_axis(normal: Any) -> None:
    """RobotLocomotion/drake#19314, #20107: a planar joint moved in the plane of z, whatever its axis. A thrown block stays in
    the plane through the origin, and falls along it by the part of gravity that lies in it.
    """
    text = hinged(" ".join(map(str, normal)), inertial='<mass value="2"/><inertia ixx="1" iyy="1" izz="1"/>')
    robot = Linkage.from_urdf(text.replace("continuous", "planar"), gravity=9.8)
    assert isinstance(robot.joints[0], PlanarJoint)
    run = lm.integrate(robot, lm.LieRATTLE(), robot.state(angles={}), h=0.01, steps=50, compiled=False, progress=False)
    place, n = np.asarray(run.g).reshape(-1, 4, 4)[-1, :3, 3], np.asarray(normal)
    pull = np.array([0.0, 0.0, -9.8])
    assert np.allclose(place, 0.125 * (pull - (pull @ n) * n), rtol=0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("ratio, offset", [(-1.0, 0.0), (0.5, 0.02), (2.0, -0.01)])
def test_a_joint_that_mimics_has_ratio_and_offset(ratio: float, offset: float) -> None:
    """google-deepmind/mujoco#3527, stack-of-tasks/pinocchio#2753, clemense/yourdfpy#1: mimic was dropped without a word, or
    only right for revolute joints. The angle is ratio times that of the leader, and the offset.
    """
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    links = "".join(f'<link name="{x}">{inertial}</link>' for x in "bc")
    text = f"""<robot name="r"><link name="a"/>{links}
    <joint name="one" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
    <joint name="two" type="continuous"><parent link="a"/><child link="c"/><axis xyz="0 0 1"/>
    <mimic joint="one" multiplier="{ratio}" offset="{offset}"/></joint></robot>"""
    robot = Linkage.from_urdf(text, gravity=0.0, armature=0.1)
    start = robot.state(angles={"one": 0.3}, rates={"one": 1.5})
    run = lm.integrate(robot, lm.LieRATTLE(), start, h=0.01, steps=100, compiled=False, progress=False)
    assert run.joint("one").angle[-1] == pytest.approx(1.8, rel=1e-9)
    assert np.allclose(run.joint("two").angle, ratio * run.joint("one").angle + offset, rtol=0.0, atol=1e-12)


# ------------------------------------------------------------------ estimates

es = lm.estimation


@pytest.mark.parametrize("width", [np.pi / 1.999, np.pi / 2.0, 3.0, 8.0])
def test_a_mean_of_wide_headings_is_where_they_lie_about(width: float) -> None:
    """cra-ros-pkg/robot_localization#672: the mean of angles by sines and cosines jumped to the other side from beliefs wider
    than a quarter of a turn.
    """
    plane = lm.SE2()
    filter = es.UnscentedFilter(es.Turning(plane, [0.5, 1e-3, 1e-3]))
    for heading in (0.0, np.pi / 3.0, -3.0):
        belief = filter.belief(plane.exp([heading, 0.0, 0.0]), [width, 0.1, 0.1])
        belief = filter.predict(belief, np.zeros(3), 1.0)
        there = np.asarray(plane.log(plane.compose(plane.inverse(plane.exp([heading, 0.0, 0.0])), belief.g)))
        assert np.abs(there).max() < 1e-9
        assert belief.covariance[0, 0] == pytest.approx(width**2 + 0.25, rel=1e-9)


@pytest.mark.parametrize("deviation", [1e-6, 1e-3, 1.0])
def test_a_covariance_stays_one_after_a_precise_measurement(deviation: float) -> None:
    """rlabbe/filterpy#218, #62, rlabbe/Kalman-and-Bayesian-Filters-in-Python#377: after the first update the covariance of an
    unscented filter was not positive.
    """
    line = lm.VectorSpace(4)

    @lm.record
    class Moving(es.Process):
        """Constant velocity in a plane."""

        group: lm.VectorSpace

        @property
        def inputs(self) -> int:
            return 0

        def move(self, g: Any, u: Any, w: Any, h: float) -> Any:
            return lm.vec(g[0] + h * g[2], g[1] + h * g[3], g[2] + h * w[0], g[3] + h * w[1])

        def deviations(self, h: float) -> Any:
            return lm.vec(0.1, 0.1) / h**0.5

    @lm.record
    class Seen(es.Sensor):
        """The place alone."""

        group: lm.VectorSpace
        deviation: lm.Vec

        def value(self, g: Any) -> Any:
            return lm.vec(g[0], g[1])

    filter = es.UnscentedFilter(Moving(line))
    belief = filter.belief(np.zeros(4), [1e3, 1e3, 10.0, 10.0])
    for k in range(30):
        belief = filter.predict(belief, [], 0.1)
        belief = filter.update(belief, Seen(line, [deviation] * 2), [0.1 * k, -0.2 * k])
        P = belief.covariance
        correlations = P / np.sqrt(np.outer(np.diag(P), np.diag(P)))
        assert (np.diag(P) > 0.0).all() and np.linalg.eigvalsh(correlations).min() > -1e-9
    assert np.allclose(belief.g[2:], [1.0, -2.0], rtol=0.0, atol=0.2 + deviation)
