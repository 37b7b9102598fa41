"""A particle that only its surface holds has no energy but |p|^2/(2 m)."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm


def test_the_energy_of_a_free_particle_is_kinetic() -> None:
    system = lm.ParticleOnEllipsoid(axes=[1.0, 1.5, 2.0], mass=1.7)
    q, p = np.array([0.6, -0.9, 1.058]), np.array([0.3, 0.2, -0.4])
    assert system.energy(q, p) == pytest.approx(p @ p / 3.4, rel=1e-15)
    assert not np.any(np.array(system.force(q, p))) and np.allclose(
        system.velocity(q, p), p / 1.7, rtol=1e-15
    )
