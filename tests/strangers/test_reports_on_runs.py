"""Situations in which users of other packages met wrong runs, maps and files: repository and number of each report, the
value by a closed form, by DOP853 or by what is conserved.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.integrate import solve_ivp
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


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("h", [None, -0.02])
def test_a_function_that_is_recorded_backwards_sees_the_time_of_its_sample(method: Any, h: float | None) -> None:
    """patrick-kidger/diffrax#425, #382: it saw minus the time, and times in a falling order were refused."""

    def clock(t: float, state: Any) -> float:
        return t + 0.0 * state.mu[0]

    times = np.linspace(1.0, 0.0, 5)
    how = {"h": h, "steps": 50} if h else {"t_end": 0.0}
    run = lm.integrate(BODY, method, START, t0=1.0, t_eval=times, record=[clock], **how)
    assert run.t.tolist() == times.tolist() == run.clock.tolist()


@pytest.mark.parametrize(
    "method", [lm.StormerVerlet(), lm.Splitting(order=4), lm.Composition(lm.StormerVerlet(), order=6)]
)
def test_with_the_sign_of_the_step_turned_a_run_comes_back(method: Any) -> None:
    """hannorein/rebound#615: after the sign of dt had been turned the error in the energy did not return to rounding."""
    planet = lm.Kepler()
    start = planet.pericentre(0.3)
    there = lm.integrate(planet, method, start, h=0.01, steps=1000)
    back = lm.integrate(planet, method, there.last, h=-0.01, steps=1000, t0=10.0)
    assert np.abs(back.q[-1] - np.asarray(start.q)).max() < 1e-12
    assert np.abs(back.energy[-1] - there.energy[0]) < 1e-13 * abs(there.energy[0])


@pytest.mark.parametrize("speed", [1.9, 2.0**0.5, 1.0])
@pytest.mark.parametrize("h", [-0.7, 0.7])
def test_unbound_orbits_both_ways(speed: float, h: float) -> None:
    """hannorein/rebound#932, #467, #127: hyperbolas with negative steps, parabolas. From a pericentre at 1 with this speed,
    Barker's equation and those of Kepler.
    """
    planet = lm.Kepler()
    start = planet.state(q=[1.0, 0.0], p=[0.0, speed])
    run = lm.integrate(planet, lm.RKMK(order=8), start, h=h / 40, steps=400)
    exact = solve_ivp(
        lambda t, y: [y[2], y[3], *(-y[:2] / np.hypot(*y[:2]) ** 3)],
        (0.0, 10.0 * h),
        [1.0, 0.0, 0.0, speed],
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    ).y[:, -1]
    assert np.abs(np.concatenate([run.q[-1], run.p[-1]]) - exact).max() < 1e-9


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


@pytest.mark.parametrize("end", [1.0, 1e3, 1e6])
def test_the_end_is_a_sample_where_an_input_jumps_there(end: float) -> None:
    """patrick-kidger/diffrax#663: where a jump lay at the end, the sample there was lost for large times."""
    start = FREE.state(q=[0.0], p=[1.0])
    for times in ([end], [0.0, end], [end, end]):
        run = lm.integrate(FREE, lm.RKMK(order=5), start, t_end=end, t_eval=times, breaks=[0.0, end])
        assert run.t.tolist() == times and run.q[-1, 0] == pytest.approx(end, rel=1e-12)


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


@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.RKMK(order=8)])
def test_a_longer_run_begins_as_a_shorter_one(method: Any) -> None:
    """hannorein/rebound#485: results at a time depended on how far the run went beyond it."""
    short, long = [lm.integrate(BODY, method, START, rtol=1e-9, t_end=end) for end in (10.0, 30.0)]
    count = len(short) - 1  # the last step of the shorter run is cut
    assert np.array_equal(short.t[:count], long.t[:count]) and np.array_equal(short.mu[:count], long.mu[:count])
    times = np.linspace(0.0, 9.0, 10)
    assert np.array_equal(*[lm.integrate(BODY, method, START, h=0.1, steps=n).mu[:90] for n in (90, 300)])
    for one in times:
        assert np.allclose(short.at(one).mu, long.at(one).mu, rtol=0.0, atol=1e-8)


def test_a_run_from_a_file_goes_on_with_the_step_that_it_had(tmp_path: Path) -> None:
    """CliMA/Oceananigans.jl#3845, openmm/openmm#2650, espressomd/espresso#1938, hannorein/rebound#514: a checkpoint did not
    hold the step, or what the method remembers.
    """
    for plan in (lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-9), lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-9, h=1e-5)):
        plan.run(START, t_end=3.0).save(tmp_path / "run.npz")
        part = lm.Trajectory.load(tmp_path / "run.npz")
        here = plan.resume(plan.run(START, t_end=3.0), t_end=9.0)
        there = plan.resume(part, t_end=9.0)
        assert np.array_equal(here.t, there.t) and np.array_equal(here.mu, there.mu)
        assert there.t[1] - there.t[0] > 1e-3  # no small first step


# ------------------------------------------------------------------ maps


@pytest.mark.parametrize("axis", [[1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [2 / 3, -1 / 3, 2 / 3], [-1e-9, 1.0, 1e-5]])
def test_rotations_near_half_a_turn_keep_their_digits(axis: Any) -> None:
    """borglab/gtsam#1233, #2723, strasdat/Sophus#316, tussedrotten/pylie#4, facebookresearch/pytorch3d#188: logarithms were
    off by 1e-4, by a factor of a thousand, or not a number.
    """
    axis = np.asarray(axis) / np.linalg.norm(axis)
    for below in [10.0**-k for k in range(17)]:
        angle = np.pi - below
        found = np.asarray(ROTATIONS.log(ROTATIONS.exp(angle * axis)))
        assert abs(np.linalg.norm(found) - angle) < 4e-15
        assert np.abs(found - angle * axis * np.sign(found @ axis)).max() < 1e-14
        assert below < 1e-14 or found @ axis > 0.0


@pytest.mark.parametrize("turns", [1, -1, 3])
@pytest.mark.parametrize("more", [1e-3, 1e-6, 1e-9, 0.0])
def test_a_whole_turn_and_a_little_is_a_little(turns: int, more: float) -> None:
    """borglab/gtsam#746, #780: the logarithm near multiples of whole turns had a wrong series."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    found = np.asarray(ROTATIONS.log(ROTATIONS.exp((2.0 * np.pi * turns + more) * axis)))
    assert np.abs(found - more * axis).max() < 1e-14


def test_rounding_of_a_rotation_is_no_reason_for_nan() -> None:
    """OliverWu515/ommpc_controller#5, hmgoforth/PointNetLK#21: the arc cosine of a little more than one, and zero for half a
    turn.
    """
    near = np.eye(3)
    near[0, 0] += 1e-15
    assert np.abs(np.asarray(ROTATIONS.log(near))).max() < 1e-14
    for i in range(3):
        half = -np.eye(3)
        half[i, i] = 1.0
        found = np.abs(np.asarray(ROTATIONS.log(half)))
        assert np.allclose(found, np.pi * np.eye(3)[i], rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("group", [lm.SO3(), lm.SE3(), lm.SE2(), lm.SE23()])
@pytest.mark.parametrize("angle", [1e-9, 1e-4, 1.0, 3.1, np.pi - 1e-6])
def test_the_derivative_of_a_logarithm_is_that_of_its_differences(group: Any, angle: float) -> None:
    """strasdat/Sophus#269, #316, borglab/gtsam#2099: derivatives of the logarithm near half a turn were zero."""
    rng = np.random.default_rng(1)
    turn = 1 if isinstance(group, lm.SE2) else 3
    xi = rng.normal(size=group.dim)
    xi[:turn] *= angle / np.linalg.norm(xi[:turn])
    eta, h = rng.normal(size=group.dim), 1e-4 * min(1.0, np.pi - angle)
    g = group.exp(xi)
    sides = [np.asarray(group.log(group.compose(g, group.exp(x * eta)))) for x in (h, -h, 2 * h, -2 * h)]
    difference = (8.0 * (sides[0] - sides[1]) - (sides[2] - sides[3])) / (12.0 * h)
    found = np.asarray(group.dexp_inv(xi, eta))
    rounding = 1e-14 * np.abs(xi).max() / h
    assert np.allclose(found, difference, rtol=1e-6, atol=1e-6 + rounding)


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


# ------------------------------------------------------------------ derivatives


@lm.record
class Pulsed(lm.GroupEquation):
    """A velocity about one axis by a table that jumps."""

    rates: lm.PiecewisePolynomial

    def velocity(self, t: float, g: Any) -> Any:
        return lm.vec(self.rates(t))


@pytest.mark.parametrize("how", [{"h": 0.125, "steps": 32}, {"rtol": 1e-9, "t_end": 4.0}])
def test_the_gradient_by_values_that_hold_for_a_while(how: Any) -> None:
    """SciML/SciMLSensitivity.jl#273, #245: the gradient by parameters that hold one after the other was that of the last.
    Of y(4) = sum of the rates it is 1 by each.
    """
    rates = lm.PiecewisePolynomial.constant([0.0, 1.0, 2.0, 3.0, 4.0], [0.3, -0.2, 0.5, 1.0])
    system = Pulsed(lm.VectorSpace(1), rates)
    options = {name: x for name, x in how.items() if name in ("h", "rtol")}
    plan = lm.Plan(system, lm.RKMK(order=5), compiled=False, progress=False, **options)
    ends = {name: x for name, x in how.items() if name not in options}
    found = plan.gradient(lambda s: s.g[0] * s.g[0], system.state(np.zeros(1)), by=("rates.values",), **ends)
    assert found.value == pytest.approx(1.6**2, rel=1e-12)
    assert np.allclose(np.ravel(found["rates.values"]), 2.0 * 1.6, rtol=1e-9)


# ------------------------------------------------------------------ estimates

es = lm.estimation


@pytest.mark.slow
def test_a_device_that_accelerates_moves() -> None:
    """borglab/gtsam#2241: the predicted velocity and attitude changed, and the place did not. At a constant acceleration a in
    its own axes, without turning, p = v t + a t^2/2.
    """
    for kind in (es.ErrorStateFilter, es.UnscentedFilter):
        filter = kind(es.Imu([1e-6] * 3, [1e-6] * 3))
        belief = filter.belief(np.eye(5), [1e-6] * 9)
        for _ in range(20):
            belief = filter.predict(belief, [0.0, 0.0, 0.0, 2.0, -1.0, 9.80665 + 0.5], 0.1)
        columns = np.asarray(belief.g)[:3, 3:].T
        wanted = [[4.0, -2.0, 1.0], [4.0, -2.0, 1.0]]
        assert np.allclose(sorted(map(tuple, columns)), sorted(map(tuple, wanted)), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_the_covariance_of_the_inverse_of_a_pose() -> None:
    """colmap/colmap#3155, microsoft/lamar-benchmark#84, artivis/manif#154: it was carried over by the adjoint of the wrong
    pose. x = m exp(e): x^-1 = exp(-e) m^-1, so that an error on the left of m is one on the right of its inverse.
    """
    poses, rng = lm.SE3(), np.random.default_rng(3)
    m = poses.exp([0.5, -1.0, 0.3, 2.0, 5.0, -1.0])
    a = rng.normal(size=(6, 6))
    P = 1e-6 * (a @ a.T + np.eye(6))
    left = es.ErrorStateFilter(es.Turning(poses, [1e-3] * 6)).belief(m, P)
    drawn = poses.compose_exp(m, rng.multivariate_normal(np.zeros(6), P, 20000))
    back = poses.inverse(m)
    errors = np.asarray(poses.log(poses.compose(m, poses.inverse(drawn))))  # of the inverse, on its left
    wanted = np.cov(errors.T)
    found = es.Belief(poses, back, P, "right").seen_from("left").covariance
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert np.abs((found - wanted) / scale).max() < 0.05
    assert np.allclose(left.seen_from("right").seen_from("left").covariance, P, rtol=1e-9, atol=1e-18)


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
