"""A million steps and more: what is promised to rounding stays there, what is bounded stays bounded."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import CAYLEY, EXP, METHODS, asymmetric_body, named, seed_body

import liemech as lm

pytestmark = [pytest.mark.slow, pytest.mark.compiled]
ALL = pytest.mark.parametrize("method", METHODS, ids=named)


@ALL
@pytest.mark.parametrize("h", [0.1, 0.5])
def test_casimirs_over_ten_million_steps(method: lm.Method, h: float) -> None:
    """Rounding errors add up like a random walk, 0.3 eps sqrt(1e7) = 2e-13; its excursions reach
    4.5e-13.
    """
    body, start = asymmetric_body()
    run = lm.integrate(body, method, body.state(start.mu), h=h, steps=10**7, every=10**5)
    assert np.abs(run.casimirs / run.casimirs[0] - 1).max() < 6e-13


@ALL
def test_spatial_momentum_over_a_million_steps(method: lm.Method) -> None:
    body, start = asymmetric_body()
    run = lm.integrate(body, method, start, h=0.1, steps=10**6, every=10**4)
    size = np.linalg.norm(run.mu[0])
    assert np.abs(run.spatial_momentum - run.spatial_momentum[0]).max() < 3e-13 * size
    assert np.abs(np.swapaxes(run.g, 1, 2) @ run.g - np.eye(3)).max() < 1e-12


@pytest.mark.parametrize("method", [EXP, CAYLEY], ids=named)
def test_energy_of_a_symplectic_method_has_no_slope(method: lm.Method) -> None:
    """10^7 steps of the article's size: the windowed maxima of the energy error do not grow."""
    body, start = seed_body()
    run = lm.integrate(body, method, body.state(start.mu), h=0.5, steps=10**7, every=97)
    error = np.abs(run.energy - run.energy[0])
    windows = np.array([w.max() for w in np.array_split(error, 10)])
    assert np.ptp(windows) < 1e-3 * windows.mean()


def test_rkmk_turns_the_body_to_its_axis_of_least_energy() -> None:
    """-20 % after 10^4 steps, and by 10^6 the body spins about its largest moment:
    H = |mu|^2/(2 J_3), with |mu| exact.
    """
    body, start = seed_body()
    run = lm.integrate(body, METHODS[0], start, h=0.5, steps=10**6, every=10**4)
    assert run.energy[1] / run.energy[0] - 1 == pytest.approx(-0.20, abs=0.01)
    assert run.energy[-1] == pytest.approx(0.25, rel=1e-3)
    assert np.abs(run.casimirs - 1.0).max() < 1e-12


@ALL
def test_times_after_very_many_steps(method: lm.Method) -> None:
    """t = n h to the last bit; a running sum of 10^7 steps would be off by a ten-thousandth."""
    body, start = asymmetric_body()
    run = lm.integrate(body, method, body.state(start.mu), h=0.1, steps=10**7, every=10**6)
    assert np.array_equal(run.t, 0.1 * np.arange(0, 10**7 + 1, 10**6))


@ALL
def test_ensemble_member_is_the_body_alone_for_long(method: lm.Method) -> None:
    body, start = asymmetric_body()
    rng = np.random.default_rng(6)
    mu = rng.normal(size=(37, 3))
    together = lm.integrate(body, method, body.state(mu, start.g), h=0.3, steps=20_000, every=1000, workers=2)
    for i in range(37):
        alone = lm.integrate(body, method, body.state(mu[i], start.g), h=0.3, steps=20_000, every=1000)
        assert np.array_equal(together.mu[:, i], alone.mu)
        assert np.array_equal(together.g[:, i], alone.g)


@ALL
def test_plain_and_compiled_agree_for_long(method: lm.Method) -> None:
    body, start = asymmetric_body()
    plain, compiled = (
        lm.integrate(body, method, start, h=0.3, steps=4000, every=200, compiled=c) for c in (False, True)
    )
    assert np.array_equal(plain.mu, compiled.mu)
    assert np.array_equal(plain.g, compiled.g)
