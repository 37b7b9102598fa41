"""Orbits of very small and very large momenta."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_an_orbit_has_the_dimension_of_the_orbit_of_a_multiple(size: float) -> None:
    for group in (lm.SO3(), lm.SE3(), lm.SO(4)):
        action, mu = lm.coadjoint(group), np.linspace(0.3, 1.0, group.dim)
        assert action.orbit_dimension(size * mu) == action.orbit_dimension(mu) > 0
        assert len(action.tangent(size * mu)) == action.orbit_dimension(mu)
