"""Tangent maps of many sites, and products with them, whose runs go site by site."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_runs_by_sites import directions, native, spins

import liemech as lm

H = 0.05


def start(n: int) -> Any:
    return spins(n).state(mu=directions(n))


def differences(plan: Any, first: Any, v: np.ndarray, steps: int) -> np.ndarray:
    """J v by central differences of runs, of fourth order."""
    found = 0.0
    for k, weight in ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
        e = k * 2.0**-10
        ends = [plan.run(type(first)(np.asarray(first.mu) + s * e * v), steps=steps).mu[-1] for s in (1.0, -1.0)]
        found = found + weight * (ends[0] - ends[1]) / 2.0**-10
    return found


@pytest.mark.slow
@native
@pytest.mark.parametrize(
    "method", [lm.RKMK(order=4), lm.SphericalMidpoint(), lm.SublatticeSplitting(), lm.BondSplitting()], ids=repr
)
def test_products_of_many_sites(method: Any) -> None:
    """J v is the derivative of the run, and <w, J v> = <J^T w, v>."""
    n, steps = 120, 4
    rng = np.random.default_rng(1)
    v, w = rng.normal(size=(2, n, 3))
    plan = lm.Plan(spins(n), method, h=H, every=2, progress=False)
    run = plan.tangent(start(n), steps=steps, along=v.ravel())
    product = run.tangent["along"]
    assert product.shape == (3, 3 * n)
    assert run.compiled
    assert np.array_equal(run.mu, plan.run(start(n), steps=steps).mu)
    assert np.array_equal(product[0], v.ravel())
    wanted = differences(plan, start(n), v, steps).ravel()
    assert np.abs(product[-1] - wanted).max() < 1e-9
    back = plan.tangent(start(n), steps=steps, against=w.ravel()).tangent["against"][-1]
    assert abs(back @ v.ravel() - product[-1] @ w.ravel()) < 1e-12


@pytest.mark.slow
def test_plain_python_has_the_map_that_is_written_out(monkeypatch: pytest.MonkeyPatch) -> None:
    n = 3
    plan = lm.Plan(spins(n), lm.RKMK(order=2), h=H, compiled=False)
    whole = plan.tangent(start(n), steps=2).tangent["start"]
    monkeypatch.setattr(lm.System, "small", 0)
    by_sites = plan.tangent(start(n), steps=2).tangent["start"]
    assert by_sites.shape == whole.shape == (3, 9, 9)
    assert np.abs(by_sites - whole).max() < 1e-15
    some = np.random.default_rng(0).normal(size=(9, 2))
    for small in (0, 48):
        monkeypatch.setattr(lm.System, "small", small)
        for name, wanted in (("along", whole @ some), ("against", whole.swapaxes(1, 2) @ some)):
            found = plan.tangent(start(n), steps=2, **{name: some}).tangent[name]
            assert np.abs(found - wanted).max() < 1e-14


@native
@pytest.mark.slow
def test_molecules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Momenta of all, then displacements of all elements, as written out; sums over all pairs."""
    water = lm.models.SPC()
    bodies = lm.LiePoissonSystem(lm.SE3() ** 3, lm.PerSite(water.kinetic_energy))
    drop = lm.MechanicalSystem(bodies, lm.Terms(water.over(lm.neighbours.all_pairs())))
    g = np.stack([np.eye(4)] * 3)
    g[1, :3, 3], g[2, :3, 3] = [0.0, 0.5, 3.1], [2.9, 0.3, 0.0]
    first = drop.state(mu=np.zeros((3, 6)), g=g)
    plan = lm.Plan(drop, lm.KickDrift(), h=1e-3, progress=False)
    by_sites = plan.tangent(first, steps=3).tangent["start"]
    monkeypatch.setattr(lm.System, "small", 48)
    whole = lm.Plan(drop, lm.KickDrift(), h=1e-3, compiled=False).tangent(first, steps=3)
    assert np.abs(by_sites - whole.tangent["start"]).max() < 1e-13 * np.abs(by_sites).max()


def test_what_is_no_direction_is_refused() -> None:
    plan = lm.Plan(spins(10), lm.RKMK(order=4), h=H)
    with pytest.raises(lm.errors.InvalidInput, match=r"N = 30 components.*got shape \(3,\)"):
        plan.tangent(start(10), steps=1, along=[1.0, 0.0, 0.0])
    with pytest.raises(lm.errors.InvalidInput, match="one of along and against"):
        plan.tangent(start(10), steps=1, along=np.ones(30), against=np.ones(30))
    with pytest.raises(lm.errors.InvalidInput, match="finite"):
        plan.tangent(start(10), steps=1, along=np.full(30, np.nan))


@pytest.mark.slow
@native
def test_members() -> None:
    """One after the other; what has no map by sites is told by name."""
    n = 110
    plan = lm.Plan(spins(n), lm.RKMK(order=2), h=H, progress=False)
    v, many = np.ones(3 * n), np.stack([directions(n), directions(n)[::-1]])
    both = plan.tangent(spins(n).state(mu=many), steps=2, along=v).tangent["along"]
    alone = plan.tangent(spins(n).state(mu=many[1]), steps=2, along=v).tangent["along"]
    assert both.shape == (3, 2, 3 * n)
    assert np.array_equal(both[:, 1], alone)
    adaptive = lm.Plan(spins(n), lm.RKMK(order=5), rtol=1e-5)
    with pytest.raises(lm.errors.IncompatibleSystem, match="no derivative by h"):
        adaptive.tangent(start(n), t_end=0.1, by="h")


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [lm.ImplicitMidpoint(), pytest.param(lm.SphericalMidpoint(), marks=pytest.mark.slow)], ids=repr
)
def test_waves_of_spins_that_stand_still(method: Any) -> None:
    """Aligned spins do not move, and their equations are solved at once: small waves u = x + i y about them, of
    u' = i (2.1 u - u_left - u_right) in a field of 0.1, are turned by steps of the midpoint rule, (1 - h A/2)^-1 (1 + h A/2).
    """
    n, h, steps = 5, 0.05, 2
    u = np.random.default_rng(1).normal(size=(n, 2)) @ [1.0, 1.0j]
    v = np.column_stack([u.real, u.imag, np.zeros(n)])
    coupled = 2.1 * np.eye(n) - np.roll(np.eye(n), 1, axis=0) - np.roll(np.eye(n), -1, axis=0)
    A = 1.0j * coupled
    step = np.linalg.solve(np.eye(n) - 0.5 * h * A, np.eye(n) + 0.5 * h * A)
    plan = lm.Plan(spins(n), method, h=h, compiled=False)
    up = spins(n).state(mu=np.tile([0.0, 0.0, 1.0], (n, 1)))
    run = plan.tangent(up, steps=steps, along=v.ravel())
    x, y, z = run.tangent["along"][-1].reshape(n, 3).T
    assert np.abs(x + 1.0j * y - np.linalg.matrix_power(step, steps) @ u).max() < 1e-13
    assert np.abs(z).max() < 1e-15 and np.array_equal(run.mu, plan.run(up, steps=steps).mu)
