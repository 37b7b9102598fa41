"""Directions of group elements are left-trivialised, whatever numbers an element is made of."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm

SO3, SE3 = lm.SO3(), lm.SE3()


@pytest.mark.parametrize(
    "compiled", [False, pytest.param(True, marks=[pytest.mark.compiled, pytest.mark.slow])]
)
def test_unit_quaternions_have_the_tangent_map_of_matrices(compiled: bool) -> None:
    quaternions = lm.UnitQuaternions()
    maps = []
    for group in (SO3, quaternions):
        body = lm.RigidBody([1.0, 1.6, 2.3], group=group)
        start = body.state([0.5, -0.3, 0.75], group.exp([0.1, 0.2, 0.3]))
        run = lm.Plan(body, lm.RKMK(order=4), 0.1, compiled=compiled).tangent(
            start, steps=8, by=["start", "inertia"]
        )
        maps.append(run.tangent)
    assert maps[1]["start"].shape == (9, 6, 6) and maps[1]["inertia"].shape == (9, 6, 3)
    for by in ("start", "inertia"):
        assert np.abs(maps[0][by] - maps[1][by]).max() < 1e-13
    assert np.abs(maps[1]["start"][0] - np.eye(6)).max() < 1e-15


def test_places_and_attitudes_of_se3() -> None:
    """Against central differences of order four of log(g^-1 g')."""
    body = lm.KirchhoffBody([1.0, 1.5, 0.7, 1.0, 1.4, 2.0])
    g = SE3.exp([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    mu = np.array([0.2, -0.1, 0.4, 0.3, 0.5, -0.2])
    plan = lm.Plan(body, lm.RKMK(order=4), 0.1, compiled=False)
    run = plan.tangent(body.state(mu, g), steps=3)
    assert run.tangent["start"].shape == (4, 12, 12)
    last = plan.run(body.state(mu, g), steps=3).g[-1]
    for i in (0, 4, 7, 11):
        change = np.zeros(12)
        for k, weight in ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
            for sign in (k, -k):
                x = sign * 1e-3 * np.eye(12)[i]
                moved = plan.run(body.state(mu + x[:6], SE3.compose(g, SE3.exp(x[6:]))), steps=3)
                eta = SE3.log(SE3.compose(SE3.inverse(last), moved.g[-1]))
                change += np.sign(sign) * weight / 1e-3 * np.concatenate([moved.mu[-1], eta])
        assert np.abs(run.tangent["start"][-1][:, i] - change).max() < 1e-9
