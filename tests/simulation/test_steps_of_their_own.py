"""Ensembles whose bodies have steps of their own: bit for bit the single runs, at times of their own."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, InvalidType, StepWarning

BODY = lm.RigidBody([1.0, 1.5, 2.0])
H = (0.1, 0.05, -0.1, 0.025, 0.2)
MU = np.random.default_rng(3).normal(size=(5, 3))
G = np.broadcast_to(np.eye(3), (5, 3, 3))
METHODS = [lm.RKMK(order=4), lm.CovariantVariational(lm.Cayley())]  # without and with a memory


def assert_single_runs(runs: lm.Trajectory, method: lm.Method, systems: list[lm.RigidBody], **how: object) -> None:
    for i, (system, h) in enumerate(zip(systems, H, strict=True)):
        alone = lm.integrate(system, method, system.state(MU[i], np.eye(3)), h=h, steps=7, compiled=False, **how)  # type: ignore[arg-type]
        assert np.array_equal(runs.mu[:, i], alone.mu) and np.array_equal(runs.g[:, i], alone.g)
        assert np.array_equal(runs.t[:, i], alone.t)


@pytest.mark.parametrize("method", METHODS)
def test_every_body_makes_its_own_steps(method: lm.Method) -> None:
    runs = lm.integrate(BODY, method, BODY.state(MU, G), h=H, steps=7, every=3, t0=1.0, compiled=False)
    assert runs.t.shape == (4, 5) and np.array_equal(runs.h, H)
    assert_single_runs(runs, method, [BODY] * 5, every=3, t0=1.0)
    bodies = [lm.RigidBody([1.0, 1.5, 2.0 + 0.1 * i]) for i in range(5)]
    assert_single_runs(
        lm.integrate(bodies, method, BODY.state(MU, G), h=np.array(H), steps=7, compiled=False), method, bodies
    )


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", [pytest.param(METHODS[0], marks=pytest.mark.slow), METHODS[1]])
def test_native_code_takes_steps_of_many_lengths_side_by_side(method: lm.Method) -> None:
    bodies = [lm.RigidBody([1.0, 1.5, 2.0 + 0.1 * i]) for i in range(5)]
    runs = lm.integrate(bodies, method, BODY.state(MU, G), h=H, steps=7, compiled=True)
    assert runs.compiled
    assert_single_runs(runs, method, bodies)


def test_what_a_run_can_do_it_can_with_many_steps(tmp_path: Path) -> None:
    starts, plan = BODY.state(MU, G), lm.Plan(BODY, METHODS[1], H, compiled=False)
    whole, first = plan.run(starts, steps=7), plan.run(starts, steps=4)
    first.save(tmp_path / "runs.npz")
    with ThreadPoolExecutor(2) as executor:
        spread = plan.run(starts, steps=4, executor=executor)
    for begun in (first, lm.Trajectory.load(tmp_path / "runs.npz"), spread):
        joined = begun.then(plan.resume(begun, steps=3))
        assert np.array_equal(joined.mu, whole.mu) and np.array_equal(joined.t, whole.t) and np.array_equal(joined.h, H)
        assert np.array_equal(begun.carry.t, first.t[-1]) and np.array_equal(begun.last.mu, first.mu[-1])
    assert "to t = -0.7 ... 1.4, h = -0.1 ... 0.2" in repr(whole) and repr(whole.drift())
    energies = lm.integrate(BODY, METHODS[0], starts, h=H, steps=7, record=["energy", clock], compiled=False)
    assert np.array_equal(
        energies.energy, BODY.energy(lm.integrate(BODY, METHODS[0], starts, h=H, steps=7, compiled=False).mu)
    )
    assert np.array_equal(energies.clock, whole.t)
    # the velocity of an interval carries the attitude along it: g_(i+1) = g_i cay(h xi_i)
    moved = lm.Cayley().tau(lm.SO3(), (np.array(H)[:, None] * whole.xi[:-1]).reshape(-1, 3)).reshape(7, 5, 3, 3)
    assert np.abs(whole.g[:-1] @ moved - whole.g[1:]).max() < 1e-14


def clock(t: float, state: lm.BodyState) -> float:
    return 1.0 * t


def test_trends_are_those_of_the_times_of_each_body() -> None:
    """The energy of explicit Runge-Kutta steps drifts: most in the body of the longest steps, at its own rate."""
    bodies = lm.integrate(
        BODY, lm.RKMK(order=2), BODY.state(MU[:1].repeat(2, axis=0)), h=[0.1, 0.2], steps=60, compiled=False
    )
    alone = lm.integrate(BODY, lm.RKMK(order=2), BODY.state(MU[0]), h=0.2, steps=60, compiled=False)
    assert bodies.drift()["energy"] == alone.drift()["energy"]


def test_what_one_step_is_needed_for() -> None:
    starts = BODY.state(MU)
    for how, words in (
        ({"h": H, "steps": 3, "t_eval": [0.1]}, "t = 0.1, which is not between -0.3 and 0"),
        ({"h": H[:4], "steps": 3}, "h has 4 steps for 5 bodies"),
        ({"h": [H], "steps": 3}, r"h has shape \(1, 5\)"),
        ({"h": [0.1, 0.0, 0.1, 0.1, 0.1], "steps": 3}, "h = 0 is no step"),
        ({"h": [0.1, np.nan, 0.1, 0.1, 0.1], "steps": 3}, "finite"),
    ):
        with pytest.raises(InvalidInput, match=words):
            lm.integrate(BODY, METHODS[1], starts, compiled=False, **how)  # type: ignore[arg-type]
    with pytest.raises(InvalidType, match="h must be a number for a start of one body"):
        lm.integrate(BODY, METHODS[1], BODY.state(MU[0]), h=H, steps=3, compiled=False)
    with pytest.raises(InvalidInput, match=r"h = 0\.1 instead of \(0\.1, 0\.05"):
        lm.Plan(BODY, METHODS[1], H).resume(
            lm.integrate(BODY, METHODS[1], starts, h=0.1, steps=3, compiled=False), steps=2
        )


def test_adaptive_bodies_have_ends_and_times_of_their_own() -> None:
    starts, ends = BODY.state(MU[:3], G[:3]), [1.0, -0.5, 2.5]
    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6, compiled=False)
    bare, times = plan.run(starts, t_end=ends), np.linspace(0.0, ends, 4)
    asked = plan.run(starts, t_end=ends, t_eval=times)
    with ThreadPoolExecutor(2) as executor:
        spread = plan.run(starts, t_end=ends, t_eval=times, executor=executor)
    assert (
        np.array_equal(bare.t, [[0.0] * 3, ends])
        and np.array_equal(asked.t, times)
        and np.array_equal(spread.mu, asked.mu)
    )
    for i, end in enumerate(ends):
        alone = plan.run(BODY.state(MU[i], G[i]), t_end=end, t_eval=times[:, i])
        assert np.array_equal(asked.mu[:, i], alone.mu) and np.array_equal(asked.g[:, i], alone.g)
        assert np.array_equal(bare.mu[-1, i], plan.run(BODY.state(MU[i], G[i]), t_end=end, t_eval=[end]).mu[-1])
    shared = plan.run(starts, t_end=[1.0, 2.0, 1.5], t_eval=[0.0, 0.5, 1.0])
    assert shared.t.shape == (3,) and np.array_equal(shared.mu[-1, 0], bare.mu[-1, 0])
    for how, words in (
        ({"t_end": [1.0, 2.0]}, r"shape \(2,\); it is one time, or one for each of 3"),
        ({"t_end": 1.0, "t_eval": np.zeros((4, 2))}, r"\(4, 2\); it is \(n,\), or \(n, 3\)"),
        ({"t_end": [1.0, 0.4, 1.0], "t_eval": [0.0, 0.5]}, "t = 0.5, which is not between 0 and 0.4"),
        ({"t_end": [1.0, np.inf, 1.0]}, "t_end must be finite"),
    ):
        with pytest.raises(InvalidInput, match=words):
            plan.run(starts, **how)  # type: ignore[arg-type]


STARTS = BODY.state(np.array([[0.3, 0.4, 0.5], [0.1, 0.5, 0.9]]))


@pytest.mark.parametrize("how", [{"steps": 1}, {"t_end": None}, {"steps": 1, "events": True}])
def test_bodies_that_go_each_its_own_way_are_warned_of_large_steps(how: dict[str, Any]) -> None:
    method = lm.CovariantVariational()
    h = 1.5 * method.largest_step(BODY, STARTS)
    events = [lambda t, state: state.mu[0] - 10.0] if how.pop("events", False) else []
    if "t_end" in how:
        how = {"t_end": np.array([h, 2.0 * h])}
    plan = lm.Plan(BODY, method, h, events=events, compiled=False)
    with pytest.warns(StepWarning):
        plan.run(STARTS, **how)


@pytest.mark.compiled
def test_columns_of_large_ensembles_lie_apart() -> None:
    """2^13 bodies would have all their numbers a multiple of a page apart, where few of them find
    room in the cache: more columns are laid out, of which nothing is seen.
    """
    body, method, n = lm.RigidBody([1.0, 1.5, 2.0]), lm.RKMK(order=4), 2**13
    mu, h = np.random.default_rng(5).normal(size=(n, 3)), np.linspace(0.05, 0.1, 2**13)
    plan = lm.Plan(body, method, h, every=2, compiled=True)
    run = plan.run(body.state(mu=mu), steps=2)
    assert run.carry.shape.columns(n) % 2**8 and run.mu.shape == (2, n, 3)
    whole = plan.resume(run, steps=2)
    for i in (0, 4095, n - 1):
        alone = lm.integrate(body, method, body.state(mu=mu[i]), h=h[i], steps=4, compiled=True)
        assert np.array_equal(alone.mu[-1], whole.mu[-1, i])
