"""States of adaptive runs at given times, where something happens between the steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body

import liemech as lm
from liemech.errors import IntegrationFailure

BODY, START = asymmetric_body()
METHOD = lm.RKMK(order=5)
BOTH = pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])


@lm.record
class Picky(lm.Exponential):
    """A retraction that has no value at tiny displacements, which no step makes."""

    def tau_Ad_star(self, group, omega, mu):
        size = abs(omega[0]) + abs(omega[1]) + abs(omega[2])
        if 0.0 < size < 1e-7:
            raise ValueError("too near")
        return group.algebra.exp_Ad_star(omega, mu)


@BOTH
def test_a_state_between_two_steps_that_fails_is_named(compiled: bool) -> None:
    start = BODY.state(START.mu)
    plan = lm.Plan(BODY, lm.RKMK(order=5, retraction=Picky()), rtol=1e-5, compiled=compiled)
    plan.run(start, t_end=1.0, t_eval=[0.5])
    with pytest.raises(IntegrationFailure, match=r"too near \[between two steps, t = 1e-09"):
        plan.run(start, t_end=1.0, t_eval=[1e-9, 0.5])


@BOTH
def test_at_a_jump_of_the_velocity_they_are_those_of_both_sides(compiled: bool) -> None:
    """The motion is continuous there: the sample at the jump is that of a run to it."""
    times = [0.5, 1.0, 1.5, 2.0]
    plan = lm.Plan(BODY, METHOD, rtol=1e-5, breaks=(1.0,), compiled=compiled)
    run = plan.run(START, t_end=2.0, t_eval=times)
    to_it = plan.run(START, t_end=1.0, t_eval=[0.5])
    assert np.array_equal(run.mu[0], to_it.mu[0])
    assert np.abs(run.mu - BODY.exact(START, times).mu).max() < 1e-4
    assert np.array_equal(run.t, times)


@BOTH
def test_at_a_jump_of_the_velocity_they_have_one_value(compiled: bool) -> None:
    """Whatever else is asked for, and beside other bodies, to the bit."""
    body = lm.RigidBody([1.0, 1.6, 2.3])
    mu, times = [0.20212572, -0.44147812, -0.77740195], [0.0, 0.3, 0.30000001, 0.6, 0.62, 1.7]
    plan = lm.Plan(body, METHOD, rtol=1.1e-6, breaks=[0.3, 0.6], compiled=compiled)
    wanted = plan.run(body.state(mu=mu), t_end=1.7).at(times).mu
    plans = [plan.replace(**how) for how in (
        {}, {"record": ["mu", "energy"]}, {"dense": True}, {"events": lambda t, s: s.mu[0] - 9.0},
    )]  # fmt: skip
    for each in plans:
        run = each.run(body.state(mu=mu), t_end=1.7, t_eval=times)
        assert np.array_equal(run.mu, wanted)
    for each in (plans[0], *[plans[3]] * 4):  # native code has the events from the third run on
        runs = each.run(body.state(mu=[mu, mu]), t_end=1.7, t_eval=times)
        assert np.array_equal(runs.mu[:, 1], wanted)


@BOTH
def test_at_a_jump_of_the_velocity_where_the_run_ends(compiled: bool) -> None:
    """The last step has one length, for samples at times as for those that `at` finds later."""
    plan = lm.Plan(BODY, METHOD, rtol=1e-5, breaks=(2.0,), compiled=compiled)
    whole = plan.run(START, t_end=2.0)
    times = sorted([*np.linspace(whole.t[-2], 2.0, 20), np.nextafter(2.0, 0.0)])
    run = plan.run(START, t_end=2.0, t_eval=times)
    assert np.array_equal(whole.at(times).mu, run.mu) and run.t[-1] == whole.t[-1] == 2.0
    assert np.array_equal(whole.mu[-1], run.mu[-1])


def test_of_fixed_steps_long_after_zero() -> None:
    """Steps of 0.04 s at t = 1e9 s differ by the rounding of the time, 1.2e-7 s."""
    plan = lm.Plan(BODY, lm.RKMK(order=4), h=0.04, compiled=False)
    later = plan.run(START, steps=5, t0=1e9).at(1e9 + 0.1).mu
    np.testing.assert_allclose(later, plan.run(START, steps=5).at(0.1).mu, rtol=1e-6)


@pytest.mark.parametrize("h", [0.1, [0.1, 0.05, 0.125]])
@pytest.mark.parametrize("ended", [False, True])
def test_between_fixed_steps_a_body_of_an_ensemble_moves_as_alone(h: Any, ended: bool) -> None:
    """With an inertia and a step of its own; where an event has ended it, it stays."""

    def stop(t: float, state: Any) -> float:
        return t - 0.2 - 0.1 * state.mu[0] ** 2

    stop.terminal = 1  # type: ignore[attr-defined]
    bodies = [lm.RigidBody(inertia) for inertia in ([1.0, 2.0, 3.0], [2.0, 2.5, 3.0], [1.0, 1.5, 2.0])]
    mu, g = np.array([[0.1, 1.0, 0.2], [0.9, -0.5, 0.3], [1.2, 0.1, 0.5]]), np.stack([np.eye(3)] * 3)
    given: Any = {"compiled": False, "progress": False, "events": [stop] if ended else []}
    run = lm.Plan(bodies, lm.RKMK(order=4), h=h, **given).run(bodies[0].state(mu=mu, g=g), steps=5)
    times = np.array([0.0, 0.13, 0.24, 0.25])
    seen = run.at(times)
    for i, (body, step) in enumerate(zip(bodies, np.broadcast_to(h, 3).tolist())):
        alone = lm.Plan(body, lm.RKMK(order=4), h=step, **given).run(body.state(mu=mu[i], g=g[i]), steps=5)
        own = alone.at(np.minimum(times, alone.t[-1]))
        assert np.array_equal(seen.mu[:, i], own.mu) and np.array_equal(seen.g[:, i], own.g)
