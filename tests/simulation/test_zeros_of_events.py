"""Zeros of events: none is missed in long steps, none is met twice, and a jump is none."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Ball

import liemech as lm
from liemech.compiler import kernel
from liemech.formulas import cos, sin

BODY = lm.RigidBody([1.0, 1.5, 2.0])
STEADY = BODY.state(xi=[0.0, 0.0, 10.0], g=np.eye(3))
NATIVE = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
WORLDS = pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=NATIVE)])


def turned(t: float, state: Any) -> float:
    """sin 10 t, of a steady spin."""
    return state.g[1, 0]


@lm.record
class Zeeman(lm.Hamiltonian):
    """A momentum in a field."""

    B: float

    def energy(self, mu: Any) -> Any:
        return -self.B * mu[2]


def require_zeros(times: np.ndarray, frequency: float, end: float, error: float = 1e-9) -> None:
    """The zeros of sin(frequency t), but for that at the start."""
    right = np.pi / frequency * np.arange(1, int(frequency * end / np.pi) + 1)
    assert times.shape == right.shape
    assert np.abs(times - right).max() < error * end


# ------------------------------------------------------------------ steps of several turns


@pytest.mark.slow
@WORLDS
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.RKMK(order=8), lm.Taylor(order=12)])
def test_no_zero_of_a_steady_spin_is_missed(method: Any, tolerance: float, compiled: bool) -> None:
    """diffrax#507, scipy#9228"""
    plan = lm.Plan(BODY, method, rtol=tolerance, atol=tolerance, events=turned, compiled=compiled)
    require_zeros(plan.run(STEADY, t_end=10.0).events[0][0], 10.0, 10.0, 10.0 * tolerance + 1e-12)


@pytest.mark.slow
@WORLDS
@pytest.mark.parametrize("method", [lm.ExactFreeBody(), lm.ReversibleController(lm.ExactFreeBody(), lambda mu: 1.0)])
def test_no_zero_is_missed_by_exact_steps(method: Any, compiled: bool) -> None:
    run = lm.integrate(BODY, method, STEADY, h=1.0, t_end=10.0, events=turned, compiled=compiled)
    require_zeros(run.events[0][0], 10.0, 10.0)


@WORLDS
def test_no_zero_is_missed_by_momenta_alone(compiled: bool) -> None:
    spin = lm.LiePoissonSystem(lm.SO3(), Zeeman(50.0))
    start = spin.state(mu=[1.0, 0.0, 0.0])
    for how in ({"t_end": 2.0}, {"t_end": 2.0, "h": 0.5}):
        run = lm.integrate(spin, lm.RKMK(order=5), start, events=lambda t, state: state.mu[1], compiled=compiled, **how)
        require_zeros(run.events[0][0], 50.0, 2.0)


@WORLDS
@pytest.mark.parametrize("group", [lm.SE2(), lm.SO(2)])
def test_no_zero_is_missed_on_other_groups(group: Any, compiled: bool) -> None:
    class Turns(lm.GroupEquation):
        def velocity(self, t: float, g: Any) -> Any:
            return lm.vec(20.0, 1.0, 0.0) if group.dim == 3 else lm.vec(20.0)

    car = Turns(group)
    start = car.state(np.eye(len(group.identity())))
    for how in ({"t_end": 5.0}, {"t_end": 5.0, "h": 2.5}):
        run = lm.integrate(car, lm.RKMK(order=5), start, events=turned, compiled=compiled, **how)
        require_zeros(run.events[0][0], 20.0, 5.0)


@pytest.mark.slow
@WORLDS
def test_no_body_of_an_ensemble_misses_a_zero(compiled: bool) -> None:
    rates = np.array([10.0, 0.1, 4.0])
    starts = BODY.state(xi=[[0.0, 0.0, rate] for rate in rates], g=np.stack([np.eye(3)] * 3))
    for how in ({"h": 1.0}, {"rtol": 1e-6}):
        method = lm.ExactFreeBody() if "h" in how else lm.RKMK(order=5)
        run = lm.integrate(BODY, method, starts, t_end=10.0, events=turned, compiled=compiled, **how)
        for rate, (times, _) in zip(rates, run.events[0], strict=True):
            if rate * 10.0 > np.pi:
                require_zeros(times, rate, 10.0)
            else:
                assert not len(times)


@pytest.mark.slow
def test_plain_and_native_steps_meet_the_same_zeros() -> None:
    start = BODY.state(mu=[3.0, 0.2, 25.0], g=np.eye(3))
    plan = lm.Plan(BODY, lm.ExactFreeBody(), h=0.7, events=turned, compiled=False)
    one, two = (p.run(start, steps=40).events[0] for p in (plan, plan.replace(compiled=None)))
    assert len(one[0]) > 100
    assert np.array_equal(one[0], two[0])
    assert np.array_equal(one[1].g, two[1].g)


@WORLDS
def test_long_steps_along_a_power_series(compiled: bool) -> None:
    """Every zero of q of a harmonic oscillator, which Taylor steps of order 20 take in parts of turns."""
    oscillator = Oscillator()
    for tolerance in (1e-3, 1e-6, 1e-12):
        run = lm.integrate(
            oscillator,
            lm.Taylor(order=20),
            oscillator.state(q=[0.0], p=[1.0]),
            t_end=100.0,
            rtol=tolerance,
            atol=tolerance,
            events=lambda t, state: state.q[0],
            compiled=compiled,
        )
        require_zeros(run.events[0][0], 1.0, 100.0, 10.0 * tolerance + 1e-12)


@lm.record
class Oscillator(lm.SeparableSystem):
    """Of frequency 1."""

    degrees: ClassVar[int] = 1

    def kinetic(self, p: Any) -> Any:
        return lm.dot(p, p) / 2.0

    def potential(self, q: Any) -> Any:
        return lm.dot(q, q) / 2.0


def test_a_step_of_a_million_turns_is_refused_if_events_are_asked_for() -> None:
    class Fast(lm.GroupEquation):
        def velocity(self, t: float, g: Any) -> Any:
            return lm.vec(1e7)

    fast = Fast(lm.SO(2))
    with pytest.raises(lm.errors.InvalidInput, match="turns is too long for `events`"):
        lm.integrate(fast, lm.RKMK(order=4), fast.state(np.eye(2)), h=1.0, steps=1, events=turned, compiled=False)


# ------------------------------------------------------------------ a zero at the start


@WORLDS
@pytest.mark.parametrize("height", [0.0, 100.0, -1e4])
@pytest.mark.parametrize(
    ("method", "how"),
    [
        (lm.RKMK(order=5), {"rtol": 1e-9}),
        (lm.Taylor(order=12), {"rtol": 1e-9}),
        (lm.StormerVerlet(), {"h": 0.01}),
        (lm.StormerVerlet(), {"h": 2.0}),
    ],
)
def test_a_ball_bounces(method: Any, how: Any, height: float, compiled: bool) -> None:
    """Bounces at t/T = 1, 3, 5, ..., T = sqrt(2 h/g), of runs that begin where a terminal event has ended the last one:
    DifferentialEquations.jl#353, DiffEqBase.jl#266."""

    def floor(t: float, state: Any) -> float:
        return state.q[0] - height

    floor.terminal = True  # type: ignore[attr-defined]
    ball, T = Ball(9.81), np.sqrt(2.0 / 9.81)
    plan = lm.Plan(ball, method, events=floor, compiled=compiled, **how)
    state, t, times = ball.state(q=[height + 1.0], p=[0.0]), 0.0, []
    for _ in range(8):
        run = plan.run(state, t0=t, t_end=t + 10.0)
        t = float(run.t[-1])
        times.append(t / T)
        state = ball.state(q=np.array(run.last.q), p=-np.array(run.last.p))
    assert np.abs(np.array(times) - np.arange(1.0, 16.0, 2.0)).max() < 1e-9 * max(1.0, abs(height))


@WORLDS
def test_a_start_at_zero_exactly_is_seen_to_return(compiled: bool) -> None:
    """The first step leads up and down again."""
    ball = Ball(2.0)
    for method, how in ((lm.Taylor(order=12), {"rtol": 1e-9}), (lm.StormerVerlet(), {"h": 2.0})):
        run = lm.integrate(
            ball,
            method,
            ball.state(q=[0.0], p=[1.0]),
            t_end=2.0,
            events=lambda t, state: state.q[0],
            compiled=compiled,
            **how,
        )
        assert np.abs(run.events[0][0] - 1.0).max() < 1e-12
        assert len(run.events[0][0]) == 1


@WORLDS
def test_a_zero_shortly_after_the_start_counts(compiled: bool) -> None:
    ball = Ball(2.0)
    run = lm.integrate(
        ball,
        lm.RKMK(order=5),
        ball.state(q=[1e-9], p=[-1.0]),
        t_end=1.0,
        events=lambda t, state: state.q[0],
        compiled=compiled,
    )
    assert run.events[0][0] == pytest.approx([1e-9], rel=1e-6)


def test_a_run_that_goes_on_from_a_terminal_zero_meets_the_next() -> None:
    """Within one step, for it is as long as that: the other zero of the parabola at t = 3."""
    ball = Ball(2.0)

    def level(t: float, state: Any) -> float:
        return state.q[0] - 3.0

    level.terminal = True  # type: ignore[attr-defined]
    plan = lm.Plan(ball, lm.Taylor(order=12), rtol=1e-9, events=level, compiled=False)
    run = plan.run(ball.state(q=[0.0], p=[4.0]), t_end=10.0)
    assert run.t[-1] == pytest.approx(1.0, abs=1e-12)
    rest = plan.resume(run, t_end=10.0)
    assert rest.t[-1] == pytest.approx(3.0, abs=1e-12)


# ------------------------------------------------------------------ two zeros in a step


@WORLDS
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_zeros_in_a_step_come_in_the_order_of_the_motion(sign: float, compiled: bool) -> None:
    """The earlier of two ends the run, whichever is named first; the later is not met."""
    ball = Ball(0.0)  # q = t

    def late(t: float, state: Any) -> float:
        return state.q[0] - sign * 0.7

    def early(t: float, state: Any) -> float:
        return state.q[0] - sign * 0.3

    for method, how in ((lm.RKMK(order=5), {"rtol": 1e-6}), (lm.StormerVerlet(), {"h": sign})):
        for terminal in (True, False):
            early.terminal = terminal  # type: ignore[attr-defined]
            late.terminal = True  # type: ignore[attr-defined]
            for events in ([late, early], [early, late]):
                run = lm.integrate(
                    ball,
                    method,
                    ball.state(q=[0.0], p=[1.0]),
                    t_end=2.0 * sign,
                    events=events,
                    compiled=compiled,
                    **how,
                )
                met = dict(zip([event.__name__ for event in events], [times for times, _ in run.events]))
                end = 0.3 if terminal else 0.7
                assert run.t[-1] == pytest.approx(sign * end, abs=1e-12)
                assert met["early"] == pytest.approx([sign * 0.3], abs=1e-12)
                assert len(met["late"]) == (0 if terminal else 1)


@WORLDS
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_zero_where_a_step_ends_hides_no_other(sign: float, compiled: bool) -> None:
    """Steps of a quarter, which are exact: the next zero is inside of the next step, or at its end."""
    ball = Ball(0.0)  # q = t

    def inside(t: float, state: Any) -> float:
        return (state.q[0] - sign * 0.5) * (state.q[0] - sign * 0.6)

    def at_end(t: float, state: Any) -> float:
        return (state.q[0] - sign * 0.5) * (state.q[0] - sign * 0.75)

    def twice(t: float, state: Any) -> float:
        return (state.q[0] - sign * 0.5) ** 2

    for start in (ball.state(q=[0.0], p=[1.0]), ball.state(q=[[0.0], [0.25 * sign]], p=[[1.0], [1.0]])):
        run = lm.integrate(
            ball,
            lm.StormerVerlet(),
            start,
            h=0.25 * sign,
            t_end=sign,
            events=[inside, at_end, twice],
            compiled=compiled,
        )
        for of_event, right in zip(run.events, ([0.5, 0.6], [0.5, 0.75], [0.5])):
            for body, (times, _) in enumerate([of_event] if np.ndim(start.q) == 1 else of_event):
                assert times == pytest.approx(sign * (np.array(right) - 0.25 * body), abs=1e-12)


# ------------------------------------------------------------------ jumps


@WORLDS
def test_a_jump_is_no_zero(compiled: bool) -> None:
    """anise#577: an angle that begins anew at pi, a pole, a sign."""
    ball = Ball(0.0)  # q = t

    def wrapped(t: float, state: Any) -> float:
        return (state.q[0] + 3.0) % 6.0 - 3.0 - 0.5  # zero at 0.5 and 6.5; jumps at 3

    def pole(t: float, state: Any) -> float:
        return sin(state.q[0] - 0.2) / cos(state.q[0] - 0.2)

    def sign(t: float, state: Any) -> float:
        return 1.0 if state.q[0] > 1.3 else -1.0

    events = [wrapped, pole, sign]
    for method, how in ((lm.RKMK(order=5), {"rtol": 1e-6, "max_step": 0.3}), (lm.StormerVerlet(), {"h": 0.3})):
        with pytest.warns(RuntimeWarning, match="jumps over zero") as told:
            run = lm.integrate(
                ball, method, ball.state(q=[0.0], p=[1.0]), t_end=7.5, events=events, compiled=compiled, **how
            )
        messages = [str(one.message) for one in told]
        assert [
            sum(f"{name} jumps over zero at t = {t}" in m for m in messages)
            for name, t in (("wrapped", 3), ("pole", "1.77079"), ("sign", 1.3))
        ] == [1, 1, 1]
        assert run.events[0][0] == pytest.approx([0.5, 6.5], abs=1e-12)
        assert run.events[1][0] == pytest.approx([0.2, 0.2 + np.pi, 0.2 + 2.0 * np.pi], abs=1e-12)
        assert not len(run.events[2][0])


@WORLDS
@pytest.mark.parametrize(("t0", "h"), [(1.7e9, 1e-5), (1e12, 2.0**-6), (-1e15, 2.0)])
@pytest.mark.filterwarnings("error")
def test_steps_of_few_units_of_the_time_have_zeros_and_no_jumps(t0: float, h: float, compiled: bool) -> None:
    """As in seconds since 1970.  Between two looks there are a few dozen numbers only."""
    ball = Ball(0.0)  # q = t - t0

    def line(t: float, state: Any) -> float:
        return state.q[0] - 2.4 * h

    def swing(t: float, state: Any) -> float:
        return sin(2.0 * state.q[0] / h - 1.0)

    run = lm.integrate(
        ball, lm.StormerVerlet(), ball.state(q=[0.0], p=[1.0]), t0=t0, h=h, steps=4, events=[line, swing],
        compiled=compiled,
    )  # fmt: skip
    for (times, _), right in zip(run.events, ([2.4 * h], h * (0.5 + 0.5 * np.pi * np.arange(3)))):
        assert times - t0 == pytest.approx(right, abs=4.0 * np.spacing(abs(t0)))


@pytest.mark.filterwarnings("error")
def test_an_event_may_be_infinite() -> None:
    ball = Ball(0.0)
    run = lm.integrate(
        ball,
        lm.StormerVerlet(),
        ball.state(q=[0.0], p=[1.0]),
        h=0.125,
        steps=8,
        events=lambda t, state: float("inf") if state.q[0] > 0.4 else state.q[0] - 0.3,
    )
    assert run.events[0][0] == pytest.approx([0.3], abs=1e-12)


@pytest.mark.filterwarnings("error")
def test_a_steep_zero_is_one() -> None:
    """A root with an infinite slope, and a step function that is smooth."""
    ball = Ball(0.0)

    def steep(t: float, state: Any) -> float:
        x = state.q[0] - 0.3
        return x**0.5 if x > 0.0 else -((-x) ** 0.5)

    def stairs(t: float, state: Any) -> float:
        return np.tanh(1e6 * (float(state.q[0]) - 0.3))

    run = lm.integrate(
        ball, lm.StormerVerlet(), ball.state(q=[0.0], p=[1.0]), h=0.25, steps=4, events=[steep, stairs], compiled=False
    )
    for times, _ in run.events:
        assert times == pytest.approx([0.3], abs=1e-12)


@pytest.mark.parametrize("how", [{"h": 0.1, "steps": 10}, {"rtol": 1e-8, "t_end": 1.0}])
def test_an_event_of_a_part_that_is_not_moved_says_what_moves_it(how: Any) -> None:
    """`record` names the momentum alone, and the event is one of the attitude."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start, method = body.state(mu=[0.5, -0.3, 0.75], g=np.eye(3)), lm.RKMK(order=5)
    for record in ("mu", ["energy"], ["energy", "mu"]):
        with pytest.raises(TypeError) as caught:
            lm.integrate(body, method, start, record=record, events=lambda t, state: state.g[2, 2] - 0.5, **how)
        assert any("moves without g" in note and "`record`" in note for note in caught.value.__notes__)
    run = lm.integrate(body, method, start, record=["mu", "g"], events=lambda t, state: state.g[2, 2] - 0.9, **how)
    assert np.allclose(run.events[0][1].g[:, 2, 2], 0.9, rtol=1e-12)


@pytest.mark.xfail(strict=True, reason="two zeros that are less than a fifth of a turn apart may lie between two looks")
@pytest.mark.parametrize("level", [0.9, 0.99])
def test_an_attitude_is_met_near_its_largest_value(level: float) -> None:
    """cos t = level, twice a turn, in steps of many turns."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(xi=[0.0, 0.0, 1.0], g=np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=5), start, t_end=30.0 * np.pi, events=lambda t, state: state.g[0, 0] - level)
    turns, angle = 2.0 * np.pi * np.arange(1, 16), np.arccos(level)
    assert run.events[0][0] == pytest.approx(np.sort(np.append(turns - angle, turns - 2.0 * np.pi + angle)), abs=1e-9)
