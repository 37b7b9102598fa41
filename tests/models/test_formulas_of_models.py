"""Formulas of single models against their definitions."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.models.poses import attitude, places


@pytest.mark.parametrize("rests", [0, 1, 2])
def test_two_components_of_the_momentum_drive_the_third(rests: int) -> None:
    """mu' = mu x J^-1 mu, of the exact motion of a free body at a start without one component."""
    body, mu = lm.RigidBody([1.0, 1.5, 2.2]), np.array([0.4, -0.7, 0.9])
    mu[rests] = 0.0
    start, h = body.state(mu, np.eye(3)), 1e-3
    rate = (np.array(body.exact(start, h).mu) - np.array(body.exact(start, -h).mu)) / (2.0 * h)
    assert np.abs(rate - np.cross(mu, mu / [1.0, 1.5, 2.2])).max() < 1e-6
    assert abs(rate[rests]) > 0.05


def test_an_upright_top_sleeps_above_its_momentum() -> None:
    """A small deflection z obeys A z'' - i mu z' - w l z = 0, bounded where mu^2 > 4 A w l."""
    top = lm.LagrangeTop(transverse=1.3, axial=0.7, weight=2.0, length=0.4)
    mu = top.sleeping_momentum
    for factor, sleeps in ((1.0 + 1e-6, True), (1.0 - 1e-6, False)):
        roots = np.roots([1.3, -1j * factor * mu, -2.0 * 0.4])
        assert (np.abs(roots.real).max() < 1e-9) == sleeps


def test_the_vertical_momentum_of_a_chain_is_that_of_its_points() -> None:
    chain, rng = lm.ChainPendulum([1.0, 0.5, 0.8], [1.0, 0.7, 0.4]), np.random.default_rng(2)
    q, p = rng.normal(size=(2, 3 * 3))
    wanted = np.cross(q.reshape(3, 3), p.reshape(3, 3))[:, 2].sum()
    assert chain.vertical_momentum(lm.vec(*q), lm.vec(*p)) == pytest.approx(wanted, rel=1e-14)


def test_where_the_bobs_of_a_double_pendulum_are_drawn() -> None:
    q = np.array([[0.3, -1.1], [2.0, 0.4]])
    arms = np.stack([np.sin(q), -np.cos(q)], axis=-1) * np.array([1.0, 0.6])[:, None]
    drawn = places(lm.DoublePendulum([1.0, 1.0], [1.0, 0.6], 9.81), q, 0.0 * q)
    assert np.allclose(drawn, np.cumsum(arms, axis=1), rtol=0.0, atol=1e-15)


def test_a_body_in_the_plane_turns_about_the_normal() -> None:
    plane = lm.SE2()
    body = lm.LiePoissonSystem(plane, lm.KineticEnergy([1.0, 2.0, 2.0]))
    g = np.array([plane.exp([angle, 0.3, 0.2]) for angle in (0.4, -2.0)])
    wanted = [[0.0, 0.0, np.sin(a / 2), np.cos(a / 2)] for a in (0.4, -2.0)]
    assert np.allclose(attitude(body, g), wanted, rtol=0.0, atol=1e-15)
