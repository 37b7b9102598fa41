"""Events, runs and files as strangers met them elsewhere: the situations of public reports about other libraries, with values
by closed form.  Beside each test stands the report, repository#number.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import Ball

import liemech as lm


class Cubic(lm.GroupEquation):
    """y' = 3 t^2 + 12 t - 4."""

    def velocity(self, t: float, g: Any) -> Any:
        return lm.vec(3.0 * t * t + 12.0 * t - 4.0)


def ended_at(level: float, direction: float = 0.0) -> Any:
    """A terminal event at a height."""

    def event(t: float, state: Any) -> float:
        return state.q[0] - level

    event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
    return event


@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.RKMK(order=8), lm.Taylor(order=12)])
@pytest.mark.parametrize("compiled", [False, None])
def test_three_zeros_of_a_cubic_in_a_few_steps(method: Any, compiled: Any) -> None:
    """scipy/scipy#9228: one of three was found.  y = (t + 6)(t + 2)(t - 2)."""
    line = Cubic(lm.VectorSpace(1))
    run = lm.integrate(
        line, method, line.state([-120.0]), t0=-8.0, t_end=4.0, events=lambda t, state: state.g[0], compiled=compiled
    )
    assert run.events[0][0] == pytest.approx([-6.0, -2.0, 2.0], abs=1e-9)


def test_a_fast_oscillation_of_an_event_that_the_motion_itself_makes() -> None:
    """patrick-kidger/diffrax#507: large steps miss pairs of zeros.  sin 30 t has 95 in 10."""
    body = lm.RigidBody([1.0, 2.0, 3.0])
    start = body.state(xi=[0.0, 0.0, 30.0], g=np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=5), start, t_end=10.0, events=lambda t, state: state.g[1, 0])
    assert run.events[0][0] == pytest.approx(np.pi / 30.0 * np.arange(1, 96), abs=1e-9)


def test_the_first_of_two_events_in_one_step_ends_the_run() -> None:
    """patrick-kidger/diffrax#639: the one that was named last was taken for the first."""
    ball, early, late = Ball(0.0), ended_at(0.5), ended_at(1.0)
    for number, events in ((1, [late, early]), (0, [early, late])):
        run = lm.integrate(ball, lm.StormerVerlet(), ball.state(q=[0.0], p=[1.0]), h=2.0, t_end=10.0, events=events)
        assert run.ended == number
        assert run.t[-1] == pytest.approx(0.5, abs=1e-14)
        assert not len(run.events[1 - number][0])


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 3, 50])
def test_a_ball_does_not_fall_through_the_floor(steps: int) -> None:
    """SciML/DifferentialEquations.jl#353 and #138, SciML/DiffEqBase.jl#266: after some bounces a zero is missed.  With a
    restitution of 0.9 bounce k lies 0.9^k of the time 2 v_0/g behind the one before."""
    ball, g, v, t = Ball(9.81), 9.81, 9.81, 0.0
    state, right = ball.state(q=[0.0], p=[v]), 0.0
    for k in range(20):
        h = {} if steps == 1 else {"h": 2.0 / steps * 0.9**k}
        method = lm.RKMK(order=5) if steps == 1 else lm.StormerVerlet()
        run = lm.integrate(ball, method, state, t0=t, t_end=t + 100.0 * 0.9**k, events=ended_at(0.0), **h)
        t, right = float(run.t[-1]), right + 2.0 * v / g
        assert t == pytest.approx(right, rel=1e-9)
        v *= 0.9
        state = ball.state(q=np.array(run.last.q), p=-0.9 * np.array(run.last.p))


def test_levels_next_to_each_other_are_all_met_with_short_steps() -> None:
    """SciML/DifferentialEquations.jl#258: a level that lay on the end of a step was not."""
    ball = Ball(0.0)
    events = [lambda t, state, k=k: state.q[0] - 0.001 * k for k in (1, 2, 3)]
    for h in (1e-3, 5e-4, 1e-3 / 3.0):
        run = lm.integrate(ball, lm.StormerVerlet(), ball.state(q=[0.0], p=[1.0]), h=h, t_end=0.005, events=events)
        assert [times.tolist() for times, _ in run.events] == [[pytest.approx(1e-3 * k, rel=1e-12)] for k in (1, 2, 3)]


def test_events_at_one_time_are_all_met() -> None:
    """SciML/DifferentialEquations.jl#516, SciML/ModelingToolkit.jl#3819: only the first of them was."""
    ball = Ball(0.0)
    events = [lambda t, state: state.q[0] - 0.3, lambda t, state: 2.0 * (0.3 - state.q[0]), lambda t, state: t - 0.3]
    run = lm.integrate(ball, lm.RKMK(order=5), ball.state(q=[0.0], p=[1.0]), t_end=1.0, events=events)
    assert [times.tolist() for times, _ in run.events] == [[pytest.approx(0.3, abs=1e-14)]] * 3


def test_two_zeros_with_one_before_the_next_step_begins() -> None:
    """SciML/DiffEqBase.jl#271: of (t - 0.5)(t - 0.6), with steps of 0.1, one zero was lost."""
    ball = Ball(0.0)
    run = lm.integrate(
        ball,
        lm.StormerVerlet(),
        ball.state(q=[0.0], p=[1.0]),
        h=0.1,
        t_end=1.0,
        events=lambda t, state: (state.q[0] - 0.5) * (state.q[0] - 0.6),
    )
    assert run.events[0][0] == pytest.approx([0.5, 0.6], abs=1e-12)


@pytest.mark.parametrize("last", [1, 2, 3])
def test_a_cannon_by_times_that_are_asked_for(last: int) -> None:
    """scipy/scipy#12100: a terminal event between two times of t_eval, with one time or none before it.  The shell lands at
    2 v/g = 40."""
    shell = Ball(0.5)
    for times in ([33.0 * last], [], [0.0, 33.0, 66.0, 99.0]):
        run = lm.integrate(
            shell,
            lm.RKMK(order=5),
            shell.state(q=[0.0], p=[10.0]),
            t_end=100.0,
            t_eval=times,
            events=ended_at(0.0, -1.0),
        )
        assert run.events[0][0] == pytest.approx([40.0], abs=1e-10)
        assert run.ended == 0
        assert [t for t in run.t if t < 40.0 - 1e-9] == [t for t in times if t < 40.0]


def test_an_angle_that_begins_anew_is_met_only_where_it_is_asked_for() -> None:
    """nyx-space/anise#577: the jump of an angle by a turn was an event."""
    body = lm.RigidBody([1.0, 2.0, 3.0])
    start = body.state(xi=[0.0, 0.0, 1.0], g=np.eye(3))

    def angle(t: float, state: Any) -> float:
        return float(np.arctan2(float(state.g[1, 0]), float(state.g[0, 0]))) - 0.5

    with pytest.warns(RuntimeWarning, match=r"angle jumps over zero at t = 3\.14159"):
        run = lm.integrate(body, lm.RKMK(order=5), start, t_end=20.0, events=angle)
    assert run.events[0][0] == pytest.approx(0.5 + 2.0 * np.pi * np.arange(4), abs=1e-9)


@pytest.mark.parametrize(
    "way", [{"h": 0.125}, {"h": 0.125, "max_step": 0.125, "rtol": 1e-3}], ids=["fixed", "adaptive"]
)
@pytest.mark.parametrize("method", [lm.StormerVerlet(), lm.RKMK(order=5), lm.RKMK(order=4), lm.Taylor(4)], ids=repr)
def test_a_terminal_zero_where_a_step_ends(method: Any, way: Any) -> None:
    """scipy/scipy#17066: the time of the event was that of the step's end, and stood twice in the samples; here where
    rounding leaves the zero behind that end.
    """
    if len(way) > 1 and not method.error_order:
        return
    ball = Ball(0.0)
    fixed = {"steps": 16} if len(way) == 1 else {"t_end": 2.0}
    run = lm.integrate(ball, method, ball.state(q=[0.0], p=[1.0]), events=ended_at(0.5), compiled=False, **way, **fixed)
    assert run.t[:4].tolist() == [0.0, 0.125, 0.25, 0.375]
    assert run.t[-1] == pytest.approx(0.5, rel=1e-15, abs=0.0)
    assert (np.diff(run.t) > 0.0).all()


@pytest.mark.parametrize("terminal", [1, 2, 5])
def test_a_run_that_ends_at_the_nth_zero(terminal: int, tmp_path: Path) -> None:
    """scipy/scipy#14176: the n-th zero counts over a file too.  sin t has them at pi k."""
    body = lm.RigidBody([1.0, 2.0, 3.0])
    start = body.state(xi=[0.0, 0.0, 1.0], g=np.eye(3))

    def sine(t: float, state: Any) -> float:
        return state.g[1, 0]

    sine.terminal = terminal  # type: ignore[attr-defined]
    plan = lm.Plan(body, lm.RKMK(order=5), rtol=1e-9, events=sine)
    plan.run(start, t_end=3.5).save(tmp_path / "run.npz")  # beyond the first zero
    run = plan.run(start, t_end=100.0)
    assert run.t[-1] == pytest.approx(np.pi * terminal, abs=1e-9)
    if terminal > 1:
        rest = plan.resume(lm.Trajectory.load(tmp_path / "run.npz"), t_end=100.0)
        assert rest.t[-1] == pytest.approx(np.pi * terminal, abs=1e-9)
