"""Balls that roll: the point of contact is at rest, and the momentum about it is kept."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput

library: Any = lm
RADIUS, MASS, J = 0.7, 1.3, np.array([0.3, 0.5, 0.7])
GROUP = lm.ProductGroup(lm.SO3(), lm.VectorSpace(3))
BALL = library.NonholonomicBody(
    library.LiePoissonSystem(GROUP, library.KineticEnergy([*J, MASS, MASS, MASS])), lm.joints.Rolling(RADIUS)
)
START = BALL.consistent([0.1, 1.0, 0.3, 0.0, 0.0, 0.2], GROUP.join(lm.SO3().exp([0.4, -0.3, 0.5]), np.zeros(3)))


def test_the_point_of_contact_is_at_rest() -> None:
    R, mu = np.array(START.g)[:9].reshape(3, 3), np.array(START.mu)
    w = R @ (mu[:3] / J)
    assert np.abs(mu[3:] / MASS + np.cross(w, [0.0, 0.0, -RADIUS])).max() < 1e-15
    assert mu[5] == 0.0  # it stays on the plane, whatever was asked for


def test_the_momentum_about_the_contact_is_kept() -> None:
    """d/dt of R J w + r e3 x m v vanishes: of the forces only those in the contact are there. Source: Chaplygin (1903)."""
    run = lm.integrate(BALL, lm.RKMK(order=6), START, h=0.05, steps=10, compiled=False, progress=False)
    R = run.g[:, :9].reshape(-1, 3, 3)
    turning = np.einsum("nij,nj->ni", R, run.mu[:, :3])
    about = turning + np.cross([0.0, 0.0, RADIUS], run.mu[:, 3:])
    assert np.abs(about - about[0]).max() < 1e-9 and np.abs(turning - turning[0]).max() > 1e-3


def test_directions_and_radii_that_are_none_are_refused() -> None:
    with pytest.raises(InvalidInput, match="Rolling: radius must be positive"):
        lm.joints.Rolling(0.0)
    with pytest.raises(InvalidInput, match="Suslov: axis is a direction"):
        lm.joints.Suslov([0.0, 0.0, 0.0])
