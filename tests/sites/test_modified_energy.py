"""Rigid molecules over many steps: what splittings keep is a modified energy, to rounding."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shadow

import liemech as lm

SPC = lm.models.SPC()


def cluster(side: int) -> tuple[Any, Any]:
    """Molecules on a cubic lattice, turned at random and at rest: they fall together."""
    rng, sites = np.random.default_rng(side), side**3
    axis = 3.1 * np.arange(side)
    g = np.zeros((sites, 4, 4))
    g[:, :3, :3] = lm.SO3().random(rng, sites)
    g[:, :3, 3] = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    g[:, 3, 3] = 1.0
    bodies = lm.LiePoissonSystem(lm.SE3() ** sites, lm.PerSite(SPC.kinetic_energy))
    system = lm.MechanicalSystem(bodies, lm.Terms(SPC.over(lm.neighbours.all_pairs())))
    return system, system.state(mu=np.zeros((sites, 6)), g=g)


def ranges(method: Any, h: float, side: int, steps: int) -> tuple[float, float]:
    """Of the energy in a run and of the modified one, over the kinetic energy at the end."""
    system, start = cluster(side)
    run = lm.integrate(system, method, start, h=h, steps=steps, every=max(1, steps // 40))
    mu, g, energy = np.asarray(run.mu), np.asarray(run.g), np.asarray(run.energy)
    scale = 0.5 * float((mu[-1] ** 2 / np.array(SPC.moments)).sum())
    modified = energy + shadow.Shadow(system, method, h, SPC.moments)(mu, g)
    return float(np.ptp(energy)) / scale, float(np.ptp(modified)) / scale


@pytest.mark.slow
@pytest.mark.parametrize("side", [2, 3])
def test_the_energy_moves_with_the_state_and_the_modified_energy_stays(side: int) -> None:
    moved, stays = ranges(lm.KickDrift(), 0.0005, side, 2000)
    assert moved > 1e-5
    assert stays < 1e-8 * moved
    moved, stays = ranges(lm.KickDrift(order=4), 0.0005, side, 4000)
    assert stays < 1e-3 * moved


@pytest.mark.slow
def test_steps_that_are_not_symplectic_keep_no_modified_energy() -> None:
    moved, stays = ranges(lm.KickDrift(lm.RKMK(4), order=4), 0.001, 3, 2000)
    assert stays > 0.3 * moved
