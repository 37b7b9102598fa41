"""Long runs: a million steps on the constraints, ten million beside the reduced equation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from constrained_scenes import CHAIN, HANGING, MOVING, PENDULUM, STRETCHING, SWINGING

import liemech as lm

pytestmark = [pytest.mark.slow, pytest.mark.compiled]

EPS = 2.0**-52
SCENES: dict[str, Any] = {"sphere": (PENDULUM, SWINGING), "chain": (CHAIN, HANGING), "stretching": (STRETCHING, MOVING)}


@pytest.mark.parametrize("scene", SCENES)
def test_both_constraints_hold_to_four_eps_after_a_million_steps(scene: str) -> None:
    """g beside its own terms; G H_p beside the largest speeds of the run, for bodies turn round on the way."""
    system, start = SCENES[scene]
    run = lm.integrate(system, lm.RATTLE(), start, h=0.01, steps=1_000_000, every=100, compiled=True, progress=False)
    m = len(system.constraint(start.q))
    assert np.asarray(system.defects(run.q, run.p))[:, :m].max() <= 4.0 * EPS
    v, G = np.asarray(system.velocity(run.q, run.p)), np.asarray(system.constraint_jacobian(run.q))
    speeds = np.einsum("nki,ni->nk", np.abs(G), np.abs(v)).max(axis=0)
    assert (np.abs(np.asarray(system.hidden_constraint(run.q, run.p))).max(axis=0) <= 4.0 * EPS * speeds).all()


def test_the_energy_of_the_reduced_equation_grows_in_proportion_to_time_and_that_of_rattle_does_not() -> None:
    """Ten million steps: means over tenths.  Projected, so that the reduced one stays on the sphere at least."""
    means = []
    for method in (lm.IndexReduction(lm.RKMK(order=4), project=True), lm.RATTLE()):
        run = lm.integrate(
            PENDULUM, method, SWINGING, h=0.01, steps=10_000_000, every=500, compiled=True, progress=False
        )
        means.append((run.energy - run.energy[0])[1:].reshape(10, -1).mean(axis=1))
    grown, walked = (np.diff(x) for x in means)
    assert np.ptp(grown) < 0.01 * abs(grown.mean())
    assert abs(walked.mean()) < 1e-4 * abs(grown.mean())
    run = lm.integrate(CHAIN, lm.RATTLE(), HANGING, h=0.01, steps=10_000_000, every=500, compiled=True, progress=False)
    errors = np.abs(run.energy - run.energy[0])[1:].reshape(10, -1).max(axis=1)
    assert np.ptp(errors) < 0.05 * errors.mean()
