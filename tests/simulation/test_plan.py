"""Prepared runs: the same bits as one call of `integrate`, whole, resumed, step by step, in both worlds."""

from __future__ import annotations

import copy
import pickle
import threading
from typing import Any

import numpy as np
import pytest
from scenes import CAYLEY, asymmetric_body, same_bits

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
WORLDS = pytest.mark.parametrize(
    "compiled", [False, pytest.param(True, marks=pytest.mark.compiled)], ids=["plain", "compiled"]
)
CASES = pytest.mark.parametrize("case", METHODS)


def same(a: lm.Trajectory, b: lm.Trajectory, rows: Any = slice(None)) -> bool:
    """Bit for bit, and the same times."""
    parts = [np.array_equal(x, b.states[name][rows]) for name, x in a.states.items()]
    return all(parts) and np.array_equal(a.t, b.t[rows])


@pytest.mark.sample(2)
@CASES
@WORLDS
def test_a_resumed_run_has_the_bits_of_one_that_never_stopped(case: str, compiled: bool) -> None:
    method, system, start = METHODS[case]
    plan = lm.Plan(system, method, 0.05, compiled=compiled)
    whole = plan.run(start, steps=60, t0=0.3)
    assert same(whole, lm.integrate(system, method, start, h=0.05, steps=60, t0=0.3, compiled=compiled))
    part = plan.run(start, steps=17, t0=0.3)
    for n in (1, 0, 42):
        last, part = part, plan.resume(part, steps=n)
        assert np.array_equal(part.t[0], last.t[-1])
    assert same(part, whole, slice(18, None))


@pytest.mark.sample(3)
@CASES
@WORLDS
def test_single_steps_are_those_of_a_run(case: str, compiled: bool) -> None:
    method, system, start = METHODS[case]
    plan = lm.Plan(system, method, 0.05, compiled=compiled)
    run = plan.run(start, steps=9)
    first = carry = plan.begin(start)
    for k in range(1, 6):
        carry = plan.step(carry)
        assert carry.t == run.t[k]
        assert all(np.array_equal(np.array(x), run.states[name][k]) for name, x in carry.state.parts.items())
    carry = plan.step(carry, 4)
    assert carry.t == run.t[9]
    # what was carried before is as it was
    assert np.array_equal(carry.last, plan.step(first, 9).last)


@pytest.mark.slow
@pytest.mark.compiled
def test_ensembles_resume_too() -> None:
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.05)
    starts = BODY.state(mu=np.random.default_rng(1).normal(size=(21, 3)), g=np.eye(3))
    whole = plan.run(starts, steps=40)
    assert same(plan.resume(plan.run(starts, steps=13), steps=27), whole, slice(13, None))
    carry = plan.step(plan.begin(starts), 40)
    assert np.array_equal(carry.state.mu, whole.mu[-1])
    plain = plan.replace(compiled=False)
    assert same(plain.resume(plan.run(starts, steps=30), steps=10), whole, slice(30, None))


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


def test_a_plan_and_its_runs_can_be_copied() -> None:
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.05, compiled=False)
    part, whole = plan.run(START, steps=20), plan.run(START, steps=30)
    for again in (pickle.loads(pickle.dumps(part)), copy.deepcopy(part)):
        assert same(again, part)
        assert same(plan.resume(again, steps=10), whole, slice(20, None))
    assert same(pickle.loads(pickle.dumps(plan)).run(START, steps=30), whole)


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


@pytest.mark.compiled
def test_threads_share_a_plan() -> None:
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.01, compiled=True)
    starts = [BODY.state(mu=mu, g=np.eye(3)) for mu in np.random.default_rng(5).normal(size=(8, 3))]
    alone = [plan.run(start, steps=4000) for start in starts]
    found: dict[int, lm.Trajectory] = {}
    threads = [
        threading.Thread(target=lambda i=i: found.update({i: plan.run(starts[i], steps=4000)})) for i in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(same(found[i], alone[i]) for i in range(8))


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


@WORLDS
def test_samples_at_any_time(compiled: bool) -> None:
    """At the ends of steps their bits; between them the accuracy of the method."""
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, compiled=compiled)
    whole = plan.run(START, steps=50)
    times = np.array([0.0, 0.0, 0.05, 0.3, 0.31, 0.39, 4.99, 5.0])
    run = plan.run(START, steps=50, t_eval=times)
    assert np.array_equal(run.t, times)
    assert np.array_equal(run.mu[[0, 1, 3, 7]], whole.mu[[0, 0, 3, 50]])
    exact = BODY.exact(START, times)
    worst = np.abs(whole.mu - BODY.exact(START, whole.t).mu).max()
    assert np.abs(run.mu - exact.mu).max() <= 2.0 * worst
    assert np.abs(run.g - exact.g).max() <= 4.0 * worst
    assert np.array_equal(whole.at(times[2:3]).mu, run.mu[2:3])
    assert same(plan.resume(run, steps=5), plan.run(START, steps=55), slice(50, None))


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


def test_a_terminal_event_ends_steps_of_one_length() -> None:
    start = BODY.state(mu=[0.4, 1.0, 0.1], g=np.eye(3))
    method = lm.RKMK(order=4)
    free = lm.integrate(BODY, method, start, h=0.1, steps=200, events=crossing(), compiled=False)
    ended = lm.integrate(BODY, method, start, h=0.1, steps=200, every=10, events=crossing(terminal=2), compiled=False)
    assert ended.t[-1] == free.events[0][0][1] == ended.events[0][0][-1]
    assert np.array_equal(ended.t[:-1], free.t[: 10 * (len(ended) - 1) : 10])
    assert np.array_equal(ended.mu[-1], free.events[0][1].mu[1])


class Even(Limited):
    """Of a motion that is as even between the ends of the steps."""

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        return lm.BodyState(state.mu + h * (super().step(system, t, state, h).mu - state.mu), state.g)


def test_a_failing_run_with_events_keeps_its_samples() -> None:
    start = BODY.state(mu=[-3.0, 0.0, 0.0])
    with pytest.raises(lm.errors.IntegrationFailure, match="no further") as caught:
        lm.integrate(BODY, Even(), start, h=1.0, steps=40, events=lambda t, state: state.mu[0] - 0.5, compiled=False)
    run = caught.value.trajectory
    assert run.mu[:, 0].tolist() == [*np.arange(-3.0, 11.0)]
    assert len(run.events[0][0]) == 1


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


OUTSIDE = [1.0]


@lm.record
class Pulled(lm.SeparableSystem):
    """A spring whose stiffness lies outside."""

    degrees = 1

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0]

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * OUTSIDE[0] * q[0] * q[0]


@pytest.mark.compiled
def test_a_step_sees_what_has_changed_outside() -> None:
    results = []
    for compiled in (False, True):
        OUTSIDE[0] = 1.0
        system = Pulled()
        plan = lm.Plan(system, lm.StormerVerlet(), 0.1, compiled=compiled, progress=False)
        carry = plan.step(plan.begin(system.state(1.0, 0.0)), 2)
        OUTSIDE[0] = 3.0
        results.append(np.array(plan.step(carry, 5).state.q))
    assert np.array_equal(*results)


def test_writing_to_the_samples_of_an_ensemble_does_not_change_how_it_goes_on() -> None:
    mu = np.random.default_rng(0).normal(size=(3, 3))
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, compiled=False, progress=False)
    run = plan.run(BODY.state(mu, np.broadcast_to(np.eye(3), (3, 3, 3))), steps=7)
    wanted = plan.resume(run, steps=3)
    assert np.array_equal(wanted.mu[0], run.mu[-1])
    mu, g = wanted.mu.copy(), wanted.g.copy()
    run.mu[:] = 0.0
    run.g[:] = np.nan
    again = plan.resume(run, steps=3)
    assert np.array_equal(again.mu, mu)
    assert np.array_equal(again.g, g)


@pytest.mark.parametrize("compiled", [False, pytest.param(None, marks=pytest.mark.compiled)])
def test_a_run_goes_on_from_where_it_stood(compiled: Any) -> None:
    body, start = asymmetric_body()
    plan = lm.Plan(body, CAYLEY, 0.1, compiled=compiled)
    for _ in range(2):  # prepared, and then at once
        whole, half = plan.run(start, steps=8), plan.run(start, steps=4)
        half.mu[:] *= 1000.0
        rest = plan.resume(half, steps=4)
        rest.g[:] *= 1000.0
        assert same_bits(rest.mu, whole.mu[4:])
        assert same_bits(plan.resume(half, steps=4).g, whole.g[4:])
