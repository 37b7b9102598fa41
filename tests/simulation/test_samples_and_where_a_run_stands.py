"""Where an ensemble stands is not what its samples say: whoever writes to samples changes nothing."""

from __future__ import annotations

import numpy as np

import liemech as lm

BODY = lm.RigidBody([1.0, 1.5, 2.0])


def started() -> tuple[lm.Plan, lm.Trajectory]:
    """Seven steps of three bodies."""
    mu = np.random.default_rng(0).normal(size=(3, 3))
    start = BODY.state(mu, np.broadcast_to(np.eye(3), (3, 3, 3)))
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, compiled=False, progress=False)
    return plan, plan.run(start, steps=7)


def test_writing_to_the_samples_of_an_ensemble_does_not_change_how_it_goes_on() -> None:
    plan, run = started()
    wanted = plan.resume(run, steps=3)
    assert np.array_equal(wanted.mu[0], run.mu[-1])
    mu, g = wanted.mu.copy(), wanted.g.copy()
    run.mu[:] = 0.0
    run.g[:] = np.nan
    again = plan.resume(run, steps=3)
    assert np.array_equal(again.mu, mu)
    assert np.array_equal(again.g, g)


def test_another_plan_takes_the_state_where_the_first_one_stood() -> None:
    """A state that was looked at before the samples were written to."""
    _, run = started()
    other = lm.Plan(BODY, lm.RKMK(order=4), 0.1, compiled=False, progress=False)
    first = other.resume(run, steps=2).mu.copy()
    run.mu[:] = 0.0
    run.g[:] = 0.0
    assert np.array_equal(other.resume(run, steps=2).mu, first)
