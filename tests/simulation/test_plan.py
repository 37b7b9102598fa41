"""Prepared runs: the same bits as one call of `integrate`, whole, resumed, step by step, in both worlds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.compiler import kernel
from liemech.errors import InvalidInput
from liemech.formulas import where

BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=np.eye(3))
TOP = lm.models.HeavyTop(inertia=[1.0, 1.5, 0.7], weight=1.3, centre=[0.6, 0.0, 0.8])
METHODS = {
    "explicit": (lm.RKMK(order=4), BODY, START),
    "compensated": (lm.CovariantVariational(lm.Cayley()), BODY, START),
    "first guesses from the past": (lm.CovariantVariational(lm.Exponential()), BODY, START),
    "stages with pasts": (lm.Composition(lm.CovariantVariational(lm.Cayley()), order=4), BODY, START),
    "kept force": (lm.StormerVerlet(), lm.Kepler(), lm.Kepler().state(q=[0.4, 0.0], p=[0.0, 2.0])),
    "field": (lm.LieVerlet(), TOP, TOP.state(mu=[0.1, 0.2, 5.0], g=np.eye(3))),
}
CASES = pytest.mark.parametrize("case", METHODS)


def same(a: lm.Trajectory, b: lm.Trajectory, rows: Any = slice(None)) -> bool:
    """Bit for bit, and the same times."""
    parts = [np.array_equal(x, b.states[name][rows]) for name, x in a.states.items()]
    return all(parts) and np.array_equal(a.t, b.t[rows])


@lm.record
class Limited(lm.Method):
    """Counts in the first component, and fails where it would pass ten."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        if state.mu[0] > 9.5:
            raise ValueError("no further")
        return lm.BodyState(state.mu + lm.vec(1.0, 0.0, 0.0), state.g)


def test_a_body_that_stopped_stays_so_when_the_others_go_on() -> None:
    plan = lm.Plan(BODY, Limited(), 1.0, compiled=False)
    starts = BODY.state(mu=[[0.0, 0.0, 0.0], [7.0, 0.0, 0.0]])
    with pytest.warns(RuntimeWarning, match="body 1 after 3 steps"):
        run = plan.run(starts, steps=5)
    with pytest.warns(RuntimeWarning, match="body 1 after 3 steps"):
        rest = plan.resume(run, steps=4)
    assert rest.mu[:, :, 0].T.tolist() == [[5.0, 6.0, 7.0, 8.0, 9.0], [10.0] * 5]
    assert "no further" in str(rest.stopped[1].error)


@pytest.mark.slow
@pytest.mark.compiled
def test_plans_travel_to_other_processes() -> None:
    """With `concurrent.futures` or anything else that pickles; bit for bit."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.05, compiled=True)
    here = plan.run(START, steps=30)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(plan.run, START, steps=30).result()
        assert same(there, here)
        assert same(pool.submit(plan.resume, there, steps=5).result(), plan.resume(here, steps=5))


def test_only_runs_of_an_equal_plan_are_resumed() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, compiled=False)
    run = plan.run(START, steps=3)
    equal = lm.Plan(lm.RigidBody([1.0, 1.6, 2.3]), lm.RKMK(order=4), 0.1, compiled=False)
    assert same(equal.resume(run, steps=2), plan.resume(run, steps=2))
    refused = [
        (dict(system=lm.RigidBody([1.0, 1.6, 2.4])), r"another system: inertia = Vec\(1.0, 1.6, 2.3\) instead"),
        (dict(method=lm.RKMK(order=3)), "another method: order = 4 instead of 3"),
        (dict(h=0.2), "h = 0.1 instead of 0.2"),
        (dict(h=None, method=lm.RKMK(order=5), rtol=1e-6), "another method"),
    ]
    for changed, message in refused:
        with pytest.raises(lm.errors.InvalidInput, match=message):
            plan.replace(**changed).resume(run, steps=2)
    with pytest.raises(lm.errors.InvalidInput, match="there is no inertia"):
        plan.replace(inertia=[1.0, 2.0, 3.0])


@pytest.mark.compiled
def test_another_inertia_costs_no_compilation() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=3), 0.1, compiled=True)
    plan.run(START, steps=2)
    before = len(kernel.alive())
    other = plan.replace(system=lm.RigidBody([0.9, 1.1, 1.3]), h=0.07)
    assert other.run(START, steps=2).compiled
    assert len(kernel.alive()) == before
    assert same(
        other.run(START, steps=30),
        lm.integrate(other.system, lm.RKMK(order=3), START, h=0.07, steps=30, compiled=False),
    )


def test_formulas_count_as_they_are_when_a_run_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Stretched())
    plan = lm.Plan(system, lm.RKMK(order=2), 0.1)
    start = system.state(mu=[1.0, 2.0, 3.0])
    before = plan.run(start, steps=5)
    monkeypatch.setitem(globals(), "FACTOR", 2.0)
    after = plan.run(start, steps=5)
    assert not np.array_equal(before.mu, after.mu)
    assert same(after, lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=5, compiled=False))


FACTOR = 1.0


@lm.record
class Stretched(lm.Hamiltonian):
    def energy(self, mu: lm.Vec) -> float:
        return FACTOR * (mu[0] * mu[0] + 2.0 * mu[1] * mu[1])


# ------------------------------------------------------------------ to a last time


def test_steps_of_one_length_end_at_t_end() -> None:
    method = lm.CovariantVariational(lm.Cayley())
    run = lm.integrate(BODY, method, START, h=0.1, t_end=2.0, compiled=False)
    assert same(run, lm.integrate(BODY, method, START, h=0.1, steps=20, compiled=False))
    assert lm.integrate(BODY, method, START, h=-0.1, t_end=0.7, t0=1.0, compiled=False).t[-1] == 1.0 - 3 * 0.1
    with pytest.raises(lm.errors.InvalidInput, match=r"20.5 steps .* h = 0.0976\d*, 21 of them"):
        lm.integrate(BODY, method, START, h=0.1, t_end=2.05)
    with pytest.raises(lm.errors.InvalidInput, match="not both"):
        lm.integrate(BODY, method, START, h=0.1, t_end=2.0, steps=20)


def test_adaptive_runs_resume_with_their_controller() -> None:
    """The step and the error before it are remembered: no first step is looked for."""
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-9, compiled=False)
    first = plan.run(START, t_end=3.0)
    rest = plan.resume(first, t_end=6.0)
    assert rest.t[0] == 3.0
    assert rest.t[-1] == 6.0
    steps = np.diff(first.t)
    assert np.diff(rest.t)[0] > 0.5 * steps[:-1].min()
    exact = BODY.exact(START, rest.t)
    assert np.abs(rest.mu - exact.mu).max() < 1e-7
    back = plan.resume(rest, t_end=0.0)
    assert np.abs(back.mu[-1] - np.array(START.mu)).max() < 1e-7


# ------------------------------------------------------------------ samples at any time


def test_samples_between_steps_have_the_order_of_the_method() -> None:
    """And lie on the orbit, where the method keeps it."""
    method, times, errors = lm.CovariantVariational(lm.Cayley()), np.array([1.037, 2.711]), []
    for n in (20, 40, 80):
        run = lm.integrate(BODY, method, START, h=3.0 / n, steps=n, t_eval=times, compiled=False)
        errors.append(np.abs(run.mu - BODY.exact(START, times).mu).max())
        assert np.abs(np.linalg.norm(run.mu, axis=1) - np.linalg.norm(START.mu)).max() < 1e-14
    assert 1.8 < np.log2(errors[0] / errors[2]) / 2.0 < 2.3


def test_ensembles_are_sampled_like_their_members() -> None:
    plan = lm.Plan(BODY, Limited(), 1.0, compiled=False)
    starts, times = BODY.state(mu=[[0.0, 0.0, 0.0], [7.0, 0.0, 0.0]]), [0.5, 3.0, 3.5, 4.5]
    with pytest.warns(RuntimeWarning, match="body 1 after 3 steps"):
        run = plan.run(starts, steps=5, t_eval=times)
    # a short step counts as one
    assert run.mu[:, :, 0].T.tolist() == [[1.0, 3.0, 4.0, 5.0], [8.0, 10.0, 10.0, 10.0]]


# ------------------------------------------------------------------ events


def crossing(direction: float = 0.0, terminal: Any = None) -> Any:
    def event(t: float, state: Any) -> float:
        return float(state.mu[1])

    event.direction, event.terminal = direction, terminal  # type: ignore[attr-defined]
    return event


@pytest.mark.slow
@pytest.mark.compiled
def test_a_symplectic_method_finds_events() -> None:
    """Zeros of one component of the momentum, against those of the exact motion: as accurate as the method, of order 4."""
    from scipy.optimize import brentq

    start = BODY.state(mu=[0.4, 1.0, 0.1], g=np.eye(3))
    method, errors = lm.Composition(lm.CovariantVariational(lm.Cayley()), order=4), []
    for n in (600, 1200):
        run = lm.integrate(BODY, method, start, h=48.0 / n, steps=n, events=(crossing(), crossing(1.0)), compiled=True)
        times, states = run.events[0]
        exact = [brentq(lambda t: BODY.exact(start, [t]).mu[0, 1], t - 0.1, t + 0.1, xtol=1e-13) for t in times]
        assert len(times) == 4
        assert np.abs(states.mu[:, 1]).max() < 1e-13
        errors.append(np.abs(times - exact).max())
    assert 12.0 < errors[0] / errors[1] < 20.0
    rising = [t for t in times if BODY.exact(start, [t + 1e-3]).mu[0, 1] > 0.0]
    assert np.array_equal(run.events[1][0], rising)
    alone = lm.integrate(BODY, method, start, h=0.04, steps=40, compiled=False)
    assert np.array_equal(run.mu[:41], alone.mu) and np.array_equal(run.g[:41], alone.g)


# ------------------------------------------------------------------ jumps and longest steps


@lm.record
class Push(lm.Force):
    """A moment about the first axis from t = 5 to t = 5.01."""

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(where(t > 5.0, where(t < 5.01, 10.0, 0.0), 0.0), 0.0, 0.0)


def test_a_short_pulse_is_met() -> None:
    """A body at rest gets the impulse of the pulse, 0.1, about a principal axis; without `breaks`
    the steps go across it.
    """
    system = lm.MechanicalSystem(lm.RigidBody([1.0, 2.0, 3.0]), lm.NoPotential(), load=Push())
    start, method = system.state(mu=[0.0, 0.0, 0.0], g=np.eye(3)), lm.RKMK(order=5)
    missed = lm.integrate(system, method, start, t_end=10.0, compiled=False)
    assert missed.mu[-1, 0] == 0.0
    run = lm.integrate(system, method, start, t_end=10.0, breaks=[5.01, 5.0], compiled=False)
    assert abs(run.mu[-1, 0] - 0.1) < 1e-13
    longest = lm.integrate(system, method, start, t0=4.98, t_end=5.04, max_step=0.004, compiled=False)
    assert abs(longest.mu[-1, 0] - 0.1) < 0.03
    assert np.diff(longest.t).max() <= 0.004 * (1 + 1e-12)
    there = lm.integrate(system, method, run.last, t0=10.0, t_end=0.0, breaks=[5.0, 5.01], compiled=False)
    assert abs(there.mu[-1, 0]) < 1e-13
    with pytest.raises(lm.errors.InvalidInput, match="max_step must be positive"):
        lm.integrate(system, method, start, t_end=10.0, max_step=0.0)


@pytest.mark.slow
def test_two_samples_of_many_steps_take_no_memory() -> None:
    import tracemalloc

    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-10, compiled=False, progress=False)
    plan.run(START, t_end=1.0, t_eval=[1.0])
    tracemalloc.start()
    run = plan.run(START, t_end=60.0, t_eval=[30.0, 60.0])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert run.steps > 400
    assert len(run) == 2
    assert peak < 200_000


STARTS = BODY.state(np.array([[0.3, 0.4, 0.5], [0.1, 0.5, 0.9]]))


def test_an_event_is_looked_at_in_every_run() -> None:
    def crossing(t: float, state: Any) -> float:
        return state.mu[0]

    def run() -> lm.Trajectory:
        return lm.integrate(BODY, lm.RKMK(order=4), STARTS, h=0.1, steps=2, events=crossing, compiled=False)

    run()
    crossing.terminal = "yes"  # type: ignore[attr-defined]
    with pytest.raises((InvalidInput, TypeError), match="terminal"):
        run()
