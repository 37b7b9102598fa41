"""The scale that FirstKindHamiltonJacobi chooses: an angle decides, so that it works on every
group, in every unit, and again.
"""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech import FirstKindHamiltonJacobi

RNG = np.random.default_rng(7)


@pytest.mark.slow
@pytest.mark.parametrize("retraction", [lm.Cayley(), lm.Exponential()], ids=["cay", "exp"])
@pytest.mark.parametrize("group", [lm.SL(2), lm.SU(2), lm.Sp(2)], ids=repr)
def test_trace_of_ad_reaches_every_start(group: lm.LieGroup, retraction: lm.Retraction) -> None:
    """Elliptic, hyperbolic and nilpotent momenta, large and small; the Casimir is kept."""
    body = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 1.5, 2.0]))
    method = FirstKindHamiltonJacobi(2, retraction, lm.class_functions.TraceOfAd())
    starts = [10.0**k * RNG.normal(size=3) for k in (-3, 0, 0, 3)]
    for mu in [*starts, *np.eye(3)]:
        size = np.linalg.norm(mu)
        run = lm.integrate(body, method, body.state(mu), h=0.01 / size, steps=1, compiled=False)
        change = np.abs(run.casimirs - run.casimirs[0]).max()
        assert change <= 1e-13 * size**2


def test_on_groups_of_rotations_alike() -> None:
    """SU(2) with the generators of SO(3) in another basis, [E_1, E_2] = 2 E_3: the same turn, by an angle of 1/2."""
    factor = [
        lm.class_functions.TraceOfAd().size(group, lm.Exponential(), lm.vec(0.3, -0.4, 0.0))
        for group in (lm.SO3(), lm.SU(2))
    ]
    # the momenta of one motion are twice as large in that basis
    assert factor == pytest.approx([1.0, 2.0], rel=1e-15)


@pytest.mark.parametrize("length", [2.0**-3, 2.0**20])
def test_screws_in_other_units(length: float) -> None:
    """(Pi, P) in a unit of length to the power (2, 1), J, D, M to (2, 1, 0): the same motion to rounding."""
    J, D, M = np.diag([1.0, 1.5, 2.0]), 0.1 * np.eye(3) + 0.05, np.diag([1.0, 1.2, 1.4])
    mu = np.array([0.5, 0.1, 0.8, 1.0, -0.3, 0.2])

    def moved(unit: float) -> np.ndarray:
        body = lm.models.KirchhoffBody.of_blocks(unit**2 * J, M, unit * D)
        scaled = np.repeat([unit**2, unit], 3)
        start = body.state(scaled * mu, np.eye(4))
        run = lm.integrate(body, FirstKindHamiltonJacobi(2), start, h=0.05, steps=1, compiled=False)
        return np.concatenate([run.mu[-1] / scaled, run.g[-1, :3, :3].ravel(), run.g[-1, :3, 3] / unit])

    assert np.abs(moved(length) - moved(1.0)).max() <= 1e-13


@pytest.mark.slow
def test_continued_it_is_the_same_method() -> None:
    """|Pi| changes on the way, |P| does not: the scale of the second half is that of the first."""
    body = lm.models.KirchhoffBody([1.0, 1.5, 2.0, 1.0, 1.2, 1.4])
    start = body.state([0.5, 0.1, 0.8, 1.0, -0.3, 0.2], np.eye(4))
    method = FirstKindHamiltonJacobi(2)
    whole = lm.integrate(body, method, start, h=0.1, steps=6, compiled=False)
    half = lm.integrate(body, method, start, h=0.1, steps=3, compiled=False)
    rest = lm.integrate(body, method, half.last, h=0.1, steps=3, compiled=False)
    assert np.abs(rest.mu[-1] - whole.mu[-1]).max() <= 1e-13
    assert np.abs(rest.g[-1] - whole.g[-1]).max() <= 1e-13
