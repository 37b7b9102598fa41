"""A bath for each of many sites: the noise of each is that of its path, and pairs find Boltzmann's distribution."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange, Zeeman

import liemech as lm


@lm.record
class InField(lm.Hamiltonian):
    """One of them alone."""

    B: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        return -lm.dot(self.B, mu)


def directions(n: int) -> np.ndarray:
    mu = np.random.default_rng(4).normal(size=(n, 3))
    return mu / np.linalg.norm(mu, axis=1)[:, None]


def ring(n: int) -> lm.LiePoissonSystem:
    terms = lm.Terms(Exchange(1.0).over(lm.neighbours.ring(n)), Zeeman([0.0, 0.1, 0.3]))
    return lm.LiePoissonSystem(lm.SO3() ** n, terms)


@pytest.mark.slow
@pytest.mark.parametrize("native", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_uncoupled_sites_are_bodies_with_their_paths(native: bool) -> None:
    field, mu, paths = [0.0, 0.1, 0.3], directions(5), [3, 0, 8, 2**40, 1]
    sites = lm.LiePoissonSystem(lm.SO3() ** 5, lm.Terms(Zeeman(field)))
    body = lm.LiePoissonSystem(lm.SO3(), InField(field))
    runs = []
    for system in (sites, body):
        bath = lm.thermal_bath(system, damping=0.3, temperature=0.5, seed=6)
        start = bath.state(mu=mu, path=paths)
        runs.append(lm.integrate(bath, lm.WongZakai(), start, h=0.1, steps=20, compiled=native).mu)
    assert runs[0].shape == (21, 5, 3)
    assert np.abs(runs[0] - runs[1]).max() < 1e-14


@pytest.mark.slow
@pytest.mark.compiled
def test_same_bits_plain_native_in_threads_and_resumed() -> None:
    bath = lm.thermal_bath(ring(40), damping=0.3, temperature=0.5, seed=6)
    start, method = bath.state(mu=directions(40)), lm.WongZakai(increments="two-point")
    options: list[dict[str, Any]] = [{"compiled": False}, {"compiled": True}, {"workers": 2}]
    runs = [lm.integrate(bath, method, start, h=0.05, steps=20, every=10, **how).mu for how in options]
    assert np.array_equal(runs[0], runs[1]) and np.array_equal(runs[0], runs[2])
    plan = lm.Plan(bath, method, h=0.05)
    resumed = plan.resume(plan.run(start, steps=7), steps=13)
    assert np.array_equal(resumed.mu[-1], runs[0][-1])
    assert np.abs(np.linalg.norm(runs[0], axis=-1) - 1.0).max() < 1e-14


def test_damped_sites_lose_the_energy_of_the_formula() -> None:
    system, mu = ring(24), directions(24)
    damped = lm.DoubleBracket(system, 0.2)
    run = lm.integrate(damped, lm.RKMK(order=4), damped.state(mu=mu), h=1e-3, steps=2)
    field = np.roll(mu, 1, axis=0) + np.roll(mu, -1, axis=0) + [0.0, 0.1, 0.3]
    rate = -0.2 * (np.cross(mu, field) ** 2).sum()
    slope = (-3.0 * run.energy[0] + 4.0 * run.energy[1] - run.energy[2]) / 2e-3
    assert slope == pytest.approx(rate, rel=1e-4)


@pytest.mark.slow
def test_coupled_pairs_are_as_parallel_as_boltzmann_says() -> None:
    """Of two spins -J mu_1 . mu_2 has the mean of Langevin's function: mu_1 . mu_2 = coth x - 1/x, x = J/T."""
    pair = lm.LiePoissonSystem(lm.SO3() ** 2, lm.Terms(Exchange(1.0).over(lm.neighbours.edges([(0, 1)]))))
    bath = lm.thermal_bath(pair, damping=1.0, temperature=0.5, seed=3)
    n = 1000
    start = bath.state(mu=np.broadcast_to(directions(2), (n, 2, 3)))
    run = lm.integrate(bath, lm.WongZakai(), start, h=0.02, steps=3000, every=30)
    along = (run.mu[20:, :, 0] * run.mu[20:, :, 1]).sum(axis=-1).mean(axis=0)
    wanted = 1.0 / math.tanh(2.0) - 0.5
    assert abs(along.mean() - wanted) < 4.0 * along.std() / n**0.5 + 2e-3


def test_what_cannot_be_meant_is_named() -> None:
    system = ring(20)
    with pytest.raises(lm.errors.InvalidInput, match="3 finite components"):
        lm.Stochastic(system, np.eye(60).tolist())
    for several in [0.1, 0.2], np.array([0.1, 0.2]), lm.each([0.1, 0.2]), np.inf:
        with pytest.raises(lm.errors.InvalidInput, match="temperature is a finite number, not negative"):
            lm.thermal_bath(system, 0.3, several)  # type: ignore[arg-type]
    bath = lm.thermal_bath(system, damping=0.3, temperature=0.5)
    with pytest.raises(lm.errors.InvalidInput, match="sites have shape"):
        bath.state(mu=directions(20), path=[1, 2, 3])
    whole = lm.LiePoissonSystem(lm.SO3() ** 2, lm.KineticEnergy(np.linspace(1.0, 2.0, 6)))
    with pytest.raises(lm.errors.InvalidInput, match="Terms on a power"):
        lm.thermal_bath(whole, 0.1, 0.1)
    with pytest.raises(lm.errors.InvalidInput, match="leave metric out"):
        lm.DoubleBracket(system, 0.1, np.eye(60).tolist())
    species = lm.SO3() ** 3 * lm.SO3() ** 2
    two = lm.LiePoissonSystem(species, lm.Terms(Exchange(1.0).over(lm.neighbours.all_pairs(), of=(0, 1))))
    with pytest.raises(lm.errors.InvalidInput, match="leave metric out"):
        lm.DoubleBracket(two, 0.1, np.diag(np.arange(1.0, 16.0)).tolist())


def test_a_damping_of_ones_own_is_refused_where_sites_would_not_have_it() -> None:
    @lm.record
    class Growing(lm.DoubleBracket):
        def velocity(self, mu: lm.Vec) -> lm.Vec:
            xi = self.system.velocity(mu)
            return xi - self.damping * self.group.ad_star(xi, mu)

    with pytest.raises(lm.errors.InvalidType, match=r"Growing replaces DoubleBracket\.velocity"):
        Growing(ring(20), 0.1)


@pytest.mark.slow
def test_systems_that_leave_their_orbits_begin_with_all_sites_in_a_row() -> None:
    """Beside DOP853: damping of all momenta at the rate c, and friction A(xi, eta) = root(c) [xi, eta]."""

    @lm.record
    class Fading(lm.Dissipative):
        c: float

        def damped(self, mu: lm.Vec, t: float) -> lm.Vec:
            return math.exp(-self.c * t) * mu

    @lm.record
    class HalfSquare(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return 0.5 * lm.dot(mu, mu)

    n, c, mu = 3, 0.4, directions(3)
    system = ring(n)
    slope = lambda m: -np.roll(m, 1, 0) - np.roll(m, -1, 0) - [0.0, 0.1, 0.3]  # noqa: E731

    def fading(_: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(n, 3)
        return (np.cross(m, slope(m)) - c * m).ravel()

    def rubbed(_: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(n, 3)
        xi = slope(m)
        return (np.cross(m, xi) - c * np.cross(xi, np.cross(xi, m))).ravel()

    for made, method, law in (
        (Fading(system, c), lm.DissipativeSplitting(lm.RKMK(order=4)), fading),
        (lm.Metriplectic(system, HalfSquare(), c), lm.RKMK(order=4), rubbed),
        (lm.Metriplectic(system, HalfSquare(), c), lm.DiscreteGradient(), rubbed),
    ):
        end = solve_ivp(law, (0.0, 0.2), mu.ravel(), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        run = lm.integrate(made, method, made.state(mu=mu), h=0.05, steps=4, compiled=False)
        assert np.allclose(np.ravel(run.mu[-1]), end, rtol=0.0, atol=2e-3)


def test_states_inside_of_steps_are_refused(tmp_path: object) -> None:
    for n in (4, 200):
        bath = lm.thermal_bath(ring(n), damping=0.3, temperature=0.5)
        start = bath.state(mu=directions(n))
        with pytest.raises(lm.errors.IncompatibleSystem, match="noise"):
            lm.integrate(bath, lm.WongZakai(), start, h=0.1, t_end=1.0, t_eval=[0.35])


@pytest.mark.slow
def test_saved_runs_go_on(tmp_path: object) -> None:
    bath = lm.thermal_bath(ring(20), damping=0.3, temperature=0.5)
    run = lm.integrate(bath, lm.WongZakai(), bath.state(mu=directions(20)), h=0.1, steps=4)
    run.save(f"{tmp_path}/run.npz")
    loaded = lm.Trajectory.load(f"{tmp_path}/run.npz")
    plans = [lm.Plan(one.system, lm.WongZakai(), h=0.1) for one in (run, loaded)]
    ends = [plan.resume(one, steps=3).mu[-1] for plan, one in zip(plans, (run, loaded), strict=True)]
    assert np.array_equal(*ends)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("inner", [lm.ImplicitMidpoint(), lm.SphericalMidpoint()], ids=repr)
def test_midpoint_rules_follow_the_same_noise_without_damping(inner: lm.Method) -> None:
    """Their equations are those of coupled sites, swept for all: beside RKMK4 on the same paths the
    difference is of second order.
    """
    system = lm.Stochastic(ring(24), [[0.1, 0.0, 0.0]], seed=2)
    start, apart = system.state(mu=directions(24)), []
    for fine in (2, 1):  # the same increments, 40 of them
        steps = 40 // fine
        ends = [
            lm.integrate(
                system, lm.WongZakai(method, fine=fine), start, h=1.0 / steps, steps=steps,
                every=steps, compiled=True,
            ).mu[-1]
            for method in (inner, lm.RKMK(order=4))
        ]  # fmt: skip
        apart.append(np.abs(ends[0] - ends[1]).max())
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.25)


def test_products_with_the_transposed_tangent_map_are_those_with_the_map() -> None:
    """w . (J v) = (J^T w) . v, which ended in an error of Python."""
    graph = lm.neighbours.ring(3)
    spins = lm.LiePoissonSystem(lm.SO3() ** 3, lm.Terms(Exchange(1.0).over(graph)))
    bath = lm.thermal_bath(spins, damping=0.2, temperature=0.1, seed=3)
    plan, start = lm.Plan(bath, lm.WongZakai(), h=0.05, compiled=False), bath.state(mu=directions(3))
    v, w = np.random.default_rng(5).normal(size=(2, 12))
    forwards = plan.tangent(start, steps=2, along=v).tangent["along"][-1]
    backwards = plan.tangent(start, steps=2, against=w).tangent["against"][-1]
    assert w @ forwards == pytest.approx(backwards @ v, rel=1e-12)
