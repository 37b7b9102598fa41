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


def test_a_state_that_was_looked_at_before_the_samples_were_written_to() -> None:
    _, run = started()
    before = np.array(run.carry.state.mu)
    run.mu[:] = 0.0
    assert np.array_equal(run.carry.state.mu, before)
    assert before.any()
