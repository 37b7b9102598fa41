"""Exact steps of a free body, just below the length at which they are made in parts."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm


@pytest.mark.parametrize("moments", [(1.0, 1.6, 2.3), (0.3, 1.0, 1.1), (1.0, 50.0, 50.5)])
@pytest.mark.parametrize("turn", [0.5, 1.2])
def test_every_term_of_the_series_is_there(moments: tuple[float, ...], turn: float) -> None:
    body, rng = lm.RigidBody(moments), np.random.default_rng(0)
    for mu in rng.normal(size=(12, 3)):
        start = body.state(mu, np.eye(3))
        h = turn / float(np.linalg.norm(body.velocity(mu)))
        run = lm.integrate(body, lm.ExactFreeBody(), start, h=h, steps=1, compiled=False)
        error = np.abs(run.mu[-1] - np.array(body.exact(start, h).mu)).max()
        assert error < 8 * np.finfo(float).eps * np.linalg.norm(mu)
