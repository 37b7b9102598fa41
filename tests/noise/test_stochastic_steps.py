"""Noise on coadjoint orbits: exact mean values, strong and weak orders, equilibrium, and the same bits everywhere."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

import liemech as lm

MOMENTS = [1.0, 1.5, 2.0]
START = [0.6, 0.1, math.sqrt(1.0 - 0.37)]


def noisy(*fields: Any, seed: int = 0, body: Any = None) -> lm.Stochastic:
    return lm.Stochastic(body or lm.RigidBody(MOMENTS), fields, seed)


# ------------------------------------------------------------------ exact mean values, by enumeration

Polynomial = dict[tuple[int, int, int], float]


def times(p: Polynomial, q: Polynomial) -> Polynomial:
    found: Polynomial = {}
    for (a, x), (b, y) in itertools.product(p.items(), q.items()):
        key = a[0] + b[0], a[1] + b[1], a[2] + b[2]
        found[key] = found.get(key, 0.0) + x * y
    return found


def plus(*parts: Polynomial) -> Polynomial:
    found: Polynomial = {}
    for part in parts:
        for key, x in part.items():
            found[key] = found.get(key, 0.0) + x
    return found


def by(p: Polynomial, i: int) -> Polynomial:
    return {
        tuple(n - (j == i) for j, n in enumerate(key)): key[i] * x  # type: ignore[misc]
        for key, x in p.items()
        if key[i]
    }


COORDINATES: list[Polynomial] = [{(1, 0, 0): 1.0}, {(0, 1, 0): 1.0}, {(0, 0, 1): 1.0}]


def along(xi: list[Polynomial], f: Polynomial) -> Polynomial:
    """The derivative of f along mu x xi."""
    parts = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rate = plus(times(COORDINATES[j], xi[k]), times({(0, 0, 0): -1.0}, times(COORDINATES[k], xi[j])))
        parts.append(times(rate, by(f, i)))
    return plus(*parts)


def exact_mean(fields: list[list[float]], f: Polynomial, start: list[float], t: float) -> float:
    """The mean of f at time t: exp(t L) f, L = drift + 1/2 sum of the squares of the noise fields."""
    drift = [{key: 1.0 / m} for key, m in zip([(1, 0, 0), (0, 1, 0), (0, 0, 1)], MOMENTS)]
    total, factor = 0.0, 1.0
    for n in range(16):
        total += factor * sum(x * math.prod(m**k for m, k in zip(start, key)) for key, x in f.items())
        noise = []
        for field in fields:
            xi = [{(0, 0, 0): x} for x in field]
            noise.append(times({(0, 0, 0): 0.5}, along(xi, along(xi, f))))
        f, factor = plus(along(drift, f), *noise), factor * t / (n + 1)  # type: ignore[arg-type]
    return total


@lm.record
class Enumerated(lm.WongZakai):
    """All outcomes of increments +-1 for two fields, by the number of the path, in the base 4."""

    def random(self, system: Any, path: float, number: float) -> Any:
        digit = (path // 4.0**number) % 4.0
        z = lm.vec(2.0 * (digit % 2.0) - 1.0, 2.0 * (digit // 2.0) - 1.0)
        return z, 0.25


@lm.record
class EnumeratedFields(lm.NinomiyaVictoir):
    """All outcomes of the three-point increments for two fields and of the coin, in the base 18."""

    def random(self, system: Any, path: float, number: float) -> Any:
        digit = (path // 18.0**number) % 18.0
        z = lm.vec(digit % 3.0 - 1.0, (digit // 3.0) % 3.0 - 1.0)
        return 3.0**0.5 * z, 0.25 + 0.5 * (digit // 9.0)


def weak_error(method: Any, base: int, steps: int, t: float) -> float:
    """The error of the mean of mu_1 + mu_2 mu_3, without statistics."""
    fields = [[0.7, 0.0, 0.0], [0.3, 0.6, 0.2]]
    f = {(1, 0, 0): 1.0, (0, 1, 1): 1.0}
    system = noisy(*fields)
    paths = np.arange(base**steps)
    start = system.state(np.tile(START, (len(paths), 1)), path=paths)
    run = lm.integrate(system, method, start, h=t / steps, steps=steps, every=steps)
    mu = run.mu[-1]
    weights = np.ones(len(paths))
    if base == 18:
        for k in range(steps):
            digit = (paths // 18**k) % 18
            for which in (digit % 3, (digit // 3) % 3):
                weights *= np.where(which == 1, 2.0 / 3.0, 1.0 / 6.0)
            weights *= 0.5
    else:
        weights /= len(paths)
    assert weights.sum() == pytest.approx(1.0)
    return float((weights * (mu[:, 0] + mu[:, 1] * mu[:, 2])).sum() - exact_mean(fields, f, START, t))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "base", "steps", "order"),
    [
        (Enumerated(), 4, (3, 6), 1),
        (Enumerated(lm.ImplicitMidpoint()), 4, (3, 6), 1),
        (EnumeratedFields(), 18, (2, 4), 2),
    ],
    ids=["Wong-Zakai", "bounded increments, midpoint", "Ninomiya-Victoir"],
)
def test_weak_order(method: Any, base: int, steps: tuple[int, int], order: int) -> None:
    errors = [abs(weak_error(method, base, n, 0.4)) for n in steps]
    slope = math.log2(errors[0] / errors[1])
    assert slope == pytest.approx(order, abs=0.25) and errors[1] < 2e-3


@pytest.mark.slow
def test_the_mean_under_isotropic_noise_is_known() -> None:
    """Without energy the mean of mu is exp(-sigma^2 t) mu: sum_i ad_e_i^2 = -2."""
    system = noisy(*(0.5 * np.eye(3)).tolist(), body=lm.LiePoissonSystem(lm.SO3(), Still()))
    n = 40_000
    run = lm.integrate(system, lm.WongZakai(), system.state(np.tile(START, (n, 1))), h=0.1, steps=20, every=20)
    mean, spread = run.mu[-1].mean(axis=0), run.mu[-1].std(axis=0) / n**0.5
    assert (np.abs(mean - math.exp(-0.25 * 2.0) * np.array(START)) < 4.5 * spread).all()


@lm.record
class Still(lm.Hamiltonian):
    """No energy."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.0 * mu[0]


# ------------------------------------------------------------------ strong orders


@lm.record
class Bent(lm.Hamiltonian):
    """A noise field that depends on the momentum."""

    strength: float

    def energy(self, mu: lm.Vec) -> float:
        return self.strength * (mu[0] * mu[0] + mu[1] * mu[2])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fields", "order"),
    [((Bent(0.4),), 1.0), (([0.5, 0.0, 0.0], [0.0, 0.5, 0.0]), 0.5)],
    ids=["one field", "two that do not commute"],
)
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.ImplicitMidpoint()], ids=["RKMK", "midpoint"])
def test_strong_order(fields: Any, order: float, method: Any) -> None:
    system, finest = noisy(*fields, seed=11), 256
    start = system.state(np.tile(START, (400, 1)))

    def end(fine: int) -> np.ndarray:
        run = lm.integrate(
            system, lm.WongZakai(method, fine=fine), start, h=fine / finest, steps=finest // fine,
            every=finest // fine,
        )  # fmt: skip
        found: np.ndarray = run.mu[-1]
        return found

    exact = end(1)
    errors = [math.sqrt(((end(fine) - exact) ** 2).sum(axis=1).mean()) for fine in (32, 8)]
    assert 0.5 * math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.12)


# ------------------------------------------------------------------ what paths keep


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    "method",
    [
        lm.WongZakai(),
        lm.NinomiyaVictoir(),
        lm.WongZakai(lm.RKMK(order=4, retraction=lm.Cayley())),
        lm.WongZakai(lm.SphericalMidpoint(), increments="three-point"),
        lm.WongZakai(lm.LiePoissonHamiltonJacobi(order=2), increments="two-point"),
    ],
    ids=lambda method: method.name,
)
def test_paths_keep_casimirs_and_spatial_momentum_with_the_same_bits_everywhere(method: Any) -> None:
    system = noisy([0.2, 0.0, 0.1], Bent(0.1), [0.0, 0.1, 0.0], seed=3)
    mu = np.tile(START, (5, 1))
    start = system.state(mu, np.eye(3), path=[4, 0, 2, 9, 2**40])
    runs = [lm.integrate(system, method, start, h=0.1, steps=30, compiled=native) for native in (False, True)]
    assert np.array_equal(runs[0].mu, runs[1].mu) and np.array_equal(runs[0].g, runs[1].g)
    alone = lm.integrate(system, method, system.state(START, np.eye(3), path=9), h=0.1, steps=30, compiled=False)
    assert np.array_equal(alone.mu, runs[0].mu[:, 3])
    assert np.abs(np.linalg.norm(runs[0].mu, axis=-1) - 1.0).max() < 1e-14
    moved = runs[0].spatial_momentum - runs[0].spatial_momentum[0]
    assert np.abs(moved).max() < 5e-14
    assert np.abs(runs[0].mu[-1, 0] - runs[0].mu[-1, 1]).max() > 1e-3  # paths are different


def test_resumed_and_saved_runs_go_on_with_their_noise(tmp_path: Any) -> None:
    system, method = noisy([0.2, 0.0, 0.1], Bent(0.1), seed=3), lm.WongZakai()
    whole = lm.integrate(system, method, system.state(START), h=0.1, steps=50)
    plan = lm.Plan(system, method, h=0.1)
    half = plan.run(system.state(START), steps=20)
    assert np.array_equal(plan.resume(half, steps=30).mu[-1], whole.mu[-1])
    half.save(tmp_path / "half.npz")
    loaded = lm.Trajectory.load(tmp_path / "half.npz")
    resumed = lm.Plan(loaded.system, loaded.method, h=0.1).resume(loaded, steps=30)
    assert np.array_equal(resumed.mu[-1], whole.mu[-1])


@pytest.mark.slow
@pytest.mark.compiled
def test_workers_do_not_change_the_noise() -> None:
    system = noisy([0.2, 0.0, 0.1], seed=3)
    start = system.state(np.tile(START, (257, 1)))
    runs = [lm.integrate(system, lm.WongZakai(), start, h=0.1, steps=300, workers=k, compiled=True) for k in (1, 2)]
    assert np.array_equal(runs[0].mu, runs[1].mu)


def test_bodies_of_one_path_have_one_noise() -> None:
    system = noisy([0.2, 0.0, 0.1], seed=3)
    run = lm.integrate(system, lm.WongZakai(), system.state([START, START], path=7), h=0.1, steps=20)
    assert np.array_equal(run.mu[:, 0], run.mu[:, 1]) and (run.states["path"] == 7.0).all()


@pytest.mark.parametrize("inner", [lm.RKMK(order=4), lm.ImplicitMidpoint()], ids=repr)
def test_without_noise_the_bits_are_those_of_the_method(inner: Any) -> None:
    body, system = lm.RigidBody(MOMENTS), noisy()
    runs = [
        lm.integrate(one, method, one.state(START, np.eye(3)), h=0.1, steps=40, compensated=True)
        for one, method in ((body, inner), (system, lm.WongZakai(inner)))
    ]
    assert np.array_equal(runs[0].mu, runs[1].mu) and np.array_equal(runs[0].g, runs[1].g)


@pytest.mark.slow
def test_casimirs_over_a_million_noisy_steps() -> None:
    system = noisy(*(0.3 * np.eye(3)).tolist(), seed=5)
    run = lm.integrate(system, lm.WongZakai(), system.state(START), h=0.05, steps=10**6, every=1000)
    off = np.linalg.norm(run.mu, axis=1) ** 2 - 1.0
    assert math.sqrt((off**2).mean()) < 1e-13


# ------------------------------------------------------------------ equilibrium


def boltzmann(energy: Any, temperature: float) -> tuple[float, np.ndarray]:
    """Means of the energy and of mu_i^2 under exp(-H/T) on the unit sphere, by quadrature."""
    z, w = np.polynomial.legendre.leggauss(60)
    phi = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    r = np.sqrt(1.0 - z**2)
    mu = np.stack([r[:, None] * np.cos(phi), r[:, None] * np.sin(phi), np.broadcast_to(z[:, None], (60, 120))])
    h = energy(mu)
    weight = w[:, None] * np.exp(-(h - h.min()) / temperature)
    weight /= weight.sum()
    return float((weight * h).sum()), (weight * mu**2).sum(axis=(1, 2))


@lm.record
class InField(lm.Hamiltonian):
    """A spin in a field along z: Langevin's paramagnet."""

    field: float

    def energy(self, mu: lm.Vec) -> float:
        return -self.field * mu[2]


@pytest.mark.slow
@pytest.mark.parametrize("of", ["spin", "rotor"])
def test_equilibrium_is_boltzmanns(of: str) -> None:
    temperature = 0.15
    if of == "spin":
        body: Any = lm.LiePoissonSystem(lm.SO3(), InField(0.3))
        wanted, squares = boltzmann(lambda mu: -0.3 * mu[2], temperature)
        x = 0.3 / temperature
        assert wanted == pytest.approx(-0.3 * (1.0 / math.tanh(x) - 1.0 / x), rel=1e-10)
    else:
        body = lm.RigidBody(MOMENTS)
        wanted, squares = boltzmann(
            lambda mu: 0.5 * (mu[0] ** 2 / 1.0 + mu[1] ** 2 / 1.5 + mu[2] ** 2 / 2.0), temperature
        )
    system = lm.thermal_bath(body, damping=1.0, temperature=temperature, seed=9)
    n = 4000
    start = system.state(np.tile(START, (n, 1)))
    run = lm.integrate(system, lm.NinomiyaVictoir(), start, h=0.05, steps=2000, every=8)
    mu = run.mu[50:]  # 20 relaxation times
    energy = run.energy[50:]
    of_each = energy.mean(axis=0)
    assert abs(of_each.mean() - wanted) < 4.0 * of_each.std() / n**0.5
    each = (mu**2).mean(axis=0)
    assert (np.abs(each.mean(axis=0) - squares) < 4.0 * each.std(axis=0) / n**0.5).all()


# ------------------------------------------------------------------ check_method


@lm.record
class OnlyForwards(lm.NinomiyaVictoir):
    """The fields always in one order."""

    def moved(self, system: Any, t: float, memory: Any, h: float, z: Any, coin: float) -> Any:
        return lm.NinomiyaVictoir.moved(self, system, t, memory, h, z, 0.25)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "broken"),
    [
        (lm.NinomiyaVictoir(), ()),
        (OnlyForwards(), ("weak order",)),
        (lm.WongZakai(), ()),
        (lm.WongZakai(lm.SphericalMidpoint()), ()),
    ],
    ids=lambda x: getattr(x, "name", ""),
)
def test_check_method_observes_strong_and_weak_orders(method: Any, broken: tuple[str, ...]) -> None:
    system = noisy([0.9, 0.0, 0.2], [0.6, 0.8, 0.0], seed=5)
    report = lm.check_method(method, system, system.state(START), raises=False)
    assert {x.law for x in report.broken} == set(broken)
    assert {"strong order", "weak order", "Casimir 1"} <= {x.law for x in report.findings}


def test_a_parameter_of_the_drift_is_one() -> None:
    """The motion along a step, made of the drift, offered its own damping and inertia, whose derivatives were zero."""
    system = noisy([0.3, 0.0, 0.1], body=lm.DoubleBracket(lm.RigidBody(MOMENTS), 0.3))
    plan, start = lm.Plan(system, lm.WongZakai(), h=0.1, compiled=False), system.state(START)
    for name in ("motion.drift.damping", "motion.drift.system.inertia"):
        with pytest.raises(lm.errors.InvalidInput, match=r"motion.* is no parameter"):
            plan.tangent(start, steps=2, by=[name])
    with pytest.raises(TypeError, match="motion"):
        lm.Stochastic(system.system, [], motion=system.motion)


def test_noise_takes_no_commands() -> None:
    """It began anew with each: a step between two had the numbers of the step before."""
    system = noisy([0.3, 0.0, 0.1], body=lm.DoubleBracket(lm.RigidBody(MOMENTS), 0.3))
    plan, start = lm.Plan(system, lm.WongZakai(), h=0.1), system.state(START)
    stepper = plan.stepper(start)
    for _ in range(3):
        stepper.step(2)
    assert np.array_equal(stepper.mu, plan.run(start, steps=6).mu[-1])
    with pytest.raises(lm.errors.InvalidInput, match="damping of a system with noise is no input"):
        stepper.step(1, damping=0.3)


# ------------------------------------------------------------------ what is refused


def test_what_cannot_be_meant_is_named() -> None:
    body = lm.RigidBody(MOMENTS)
    system = noisy([0.2, 0.0, 0.1])
    start = system.state(START)
    with pytest.raises(lm.errors.InvalidInput, match="leave the"):
        lm.Stochastic(body, [[0.1, 0.0, 0.0]], calculus="ito")
    with pytest.raises(lm.errors.InvalidInput, match="3 finite components"):
        lm.Stochastic(body, [[0.1, 0.0]])
    with pytest.raises(lm.errors.InvalidType, match="stays on the coadjoint orbits"):
        lm.Stochastic(body, [lambda mu: mu])
    with pytest.raises(lm.errors.InvalidType, match="LiePoissonSystem"):
        lm.Stochastic(lm.models.HeavyTop([1.0, 1.0, 2.0], 1.0, [0.0, 0.0, 1.0]), [])  # type: ignore[call-arg]
    for path in (-1, 0.5, 2**53, float("nan")):
        with pytest.raises(lm.errors.InvalidInput, match="path is a whole number"):
            system.state(START, path=path)
    with pytest.raises(lm.errors.InvalidInput, match="shape"):
        system.state([START, START], path=[1, 2, 3])
    with pytest.raises(lm.errors.IncompatibleSystem, match="WongZakai"):
        lm.integrate(system, lm.RKMK(order=4), start, h=0.1, steps=1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="Stochastic"):
        lm.integrate(body, lm.WongZakai(), body.state(START), h=0.1, steps=1)
    with pytest.raises(lm.errors.InvalidInput, match="forwards in time"):
        lm.integrate(system, lm.WongZakai(), start, h=-0.1, steps=1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="ends of steps only"):
        lm.integrate(system, lm.WongZakai(), start, h=0.1, t_end=1.0, t_eval=[0.35])
    with pytest.raises(lm.errors.IncompatibleSystem, match="ends of steps only"):
        lm.integrate(system, lm.WongZakai(), start, h=0.1, steps=10, breaks=[0.35])
    with pytest.raises(lm.errors.InvalidInput, match="order 4"):
        lm.NinomiyaVictoir(lm.ImplicitMidpoint())
    # the mean of cos(sqrt(h) z) is 1 - h/2 + h^2/8 by the fourth moment 3, which +-1 has not: 1 - h/2 + h^2/24
    with pytest.raises(lm.errors.InvalidInput, match="for order 2; got 'two-point'"):
        lm.NinomiyaVictoir(increments="two-point")
    with pytest.raises(lm.errors.InvalidInput, match="another sense"):
        lm.WongZakai(lm.RKMK(order=1))
    with pytest.raises(lm.errors.InvalidInput, match="increments"):
        lm.WongZakai(increments="uniform")
