"""Methods whose step is an equation, by sites: sweeps over all of them, each with its own derivative."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from hand_made import run
from terms_of_spins import Exchange
from test_sublattices import directions, exact, poisson

import liemech as lm
from liemech.compiler import kernel
from liemech.errors import NoConvergence
from liemech.formulas.sites import meet, one_site

near = lm.neighbours
native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
N = 17
"""Sites beyond which nothing is written out."""


@lm.record
class Axis(lm.Term):
    """Not quadratic, so that a site's own derivative counts."""

    D: float

    def energy(self, a: Any) -> float:
        return -self.D * a.mu[2] ** 4


def spins(n: int = N, D: float = 0.4) -> Any:
    ring = near.ring(n) if n > 2 else near.chain(n)
    terms = [Exchange(1.0).over(ring)] if n > 1 else []
    return lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(*terms, Axis(D)))


def rate(s: np.ndarray) -> np.ndarray:
    """s' = s x dH/ds of `spins`."""
    xi = -np.roll(s, 1, axis=0) - np.roll(s, -1, axis=0)
    xi[:, 2] -= 4.0 * 0.4 * s[:, 2] ** 3
    return np.cross(s, xi)


METHODS: tuple[Any, ...] = (
    lm.SphericalMidpoint(),
    lm.LiePoissonHamiltonJacobi(order=2),
    pytest.param(lm.ImplicitMidpoint(), marks=pytest.mark.slow),
    pytest.param(lm.LiePoissonHamiltonJacobi(order=4), marks=pytest.mark.slow),
    pytest.param(lm.LiePoissonHamiltonJacobi(order=2, retraction=lm.Cayley()), marks=pytest.mark.slow),
)


@pytest.mark.slow
@native
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_bits(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of plain Python, of 1, 8 and 16 lanes, and of two workers."""
    monkeypatch.setattr("liemech.compiler.sites.site_calls.SHARE", 8)
    system, s = spins(), directions(N)
    site = system.site_form
    plain = run(method, site, s, None, 0.1, 2, 0)
    for lanes in (1, 8, 16) if method == METHODS[0] else (8,):
        assert np.array_equal(run(method, site, s, None, 0.1, 2, lanes), plain), lanes
    found = lm.integrate(system, method, system.state(mu=s), h=0.1, steps=2, workers=2)
    assert np.array_equal(found.mu[-1], plain[-1][:3].T)


@pytest.mark.slow
@native
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_order(method: Any) -> None:
    system, s = spins(), directions(N)
    end = exact(rate, s, 0.8)
    errors = []
    for h in (0.1, 0.05):
        found = lm.integrate(system, method, system.state(mu=s), h=h, steps=round(0.8 / h))
        errors.append(np.abs(found.mu[-1] - end).max())
        assert np.abs(np.linalg.norm(found.mu, axis=-1) - 1.0).max() < 1e-14
    assert abs(np.log2(errors[0] / errors[1]) - method.order) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_the_structure_is_kept(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two spins by sites; the plain midpoint, which claims nothing, misses it."""
    monkeypatch.setattr(lm.System, "small", 0)
    off = poisson(spins(2), method, directions(2), 0.2)
    assert off < 1e-8 if method.symplectic else off > 1e-4


@pytest.mark.slow
@native
@pytest.mark.parametrize("method", [lm.SphericalMidpoint(), lm.ImplicitMidpoint()], ids=repr)
def test_the_total_spin_is_kept_and_by_the_plain_midpoint_the_energy(method: Any) -> None:
    system = spins(64, D=0.0)
    found = lm.integrate(system, method, system.state(mu=directions(64)), h=0.1, steps=300, every=100)
    total = found.mu.sum(axis=1)
    assert np.abs(total - total[0]).max() < 1e-12
    assert np.ptp(found.energy) < 1e-12 if not method.symplectic else np.ptp(found.energy) > 1e-4


@pytest.mark.slow
@native
@pytest.mark.parametrize("n", [1, 2, 3, 33])
def test_any_number_of_sites(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lm.System, "small", 0)
    system = spins(n)
    start = system.state(mu=directions(n))
    plain, fast = [
        lm.integrate(system, lm.SphericalMidpoint(), start, h=0.1, steps=2, compiled=c, progress=False).mu
        for c in (False, True)
    ]
    assert np.array_equal(plain, fast)


@native
@pytest.mark.parametrize("unit", [1e-12, 1e15])
def test_units(unit: float) -> None:
    """Momenta in another unit move alike, if the energy is one of their directions."""
    s = directions(N)
    ring = near.ring(N)
    ends = []
    for size in (1.0, unit):
        system = lm.LiePoissonSystem(lm.SO3() ** N, lm.Terms(Exchange(1.0 / size).over(ring)))
        found = lm.integrate(system, lm.SphericalMidpoint(), system.state(mu=size * s), h=0.1, steps=10)
        ends.append(found.mu[-1] / size)
    assert np.abs(ends[0] - ends[1]).max() < 1e-14


@native
def test_a_spin_that_is_zero_rests() -> None:
    s = directions(N)
    s[4] = 0.0
    system = spins()
    found = lm.integrate(system, lm.SphericalMidpoint(), system.state(mu=s), h=0.1, steps=3, compiled=True)
    assert not found.mu[:, 4].any()
    assert np.isfinite(found.mu).all()


@pytest.mark.slow
@native
@pytest.mark.parametrize("method", [lm.SphericalMidpoint(), lm.Isospectral(order=2)], ids=repr)
def test_a_step_for_which_sweeps_do_not_settle_is_told_at_once(method: Any) -> None:
    system = spins()
    start = system.state(mu=directions(N))
    lm.integrate(system, method, start, h=0.1, steps=20)  # which compiles
    begun = time.process_time()
    with pytest.raises(NoConvergence, match=r"h = 2\.5"):
        lm.integrate(system, method, start, h=2.5, steps=20)
    assert time.process_time() - begun < 2.0


def test_in_a_derivative_of_its_own_a_site_moves_alone() -> None:
    """Along a direction all sites have, all of them move."""

    def both() -> Any:
        from liemech.formulas.sites import present_site

        x = lm.vec(1.0 + present_site(), 2.0)
        direction = lm.vec(1.0, 0.5)
        product = lambda y: lm.vec(y[0] * meet(y).at(1)[0], y[1])  # noqa: E731
        return lm.jacobian(product, x), lm.derivative(product, x, direction)

    own, along = one_site(2, 0, both)
    assert np.array_equal(np.array(own), [[2.0, 0.0], [0.0, 1.0]])  # x_0 = 1 beside 2
    assert np.array_equal(np.array(along), [2.0 + 1.0, 0.5])
