"""A pendulum that no gravity holds: a turn takes 2 pi m l^2/|p|."""

from __future__ import annotations

import math

import numpy as np
import pytest

import liemech as lm
from liemech.models.poses import rods


def test_the_period_without_gravity_is_that_of_a_turn() -> None:
    pendulum = lm.Pendulum(mass=1.3, length=0.7, gravity=0.0)
    start = pendulum.state(0.4, -0.9)
    end = pendulum.exact(start, pendulum.period(start))
    assert float(end.q[0]) == pytest.approx(0.4 - 2.0 * math.pi, rel=1e-14) and float(
        end.p[0]
    ) == pytest.approx(-0.9, rel=1e-14)


def test_rods_of_a_pendulum_join_each_mass_to_the_one_before() -> None:
    """The first hangs on the pivot, whose number follows those of the masses."""
    pivots, joined = rods(lm.ChainPendulum(masses=[1.0, 1.0, 1.0], lengths=[1.0, 1.0, 1.0]))
    assert np.array_equal(pivots, np.zeros((1, 3))) or np.array_equal(pivots, np.zeros((1, 2)))
    assert joined == [(3, 0), (0, 1), (1, 2)]
