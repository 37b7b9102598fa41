"""Where an ensemble stands is not what its samples say: whoever writes to samples changes nothing."""

from __future__ import annotations

import numpy as np

import liemech as lm

BODY = lm.RigidBody([1.0, 1.5, 2.0])


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
