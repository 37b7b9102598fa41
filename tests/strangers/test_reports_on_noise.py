"""Situations in which users of other packages met wrong noise: repository and number of each report, the value by a
closed form or by an identity.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import liemech as lm

BOUND = 4.5
"""Standard errors that a mean may be off: one in 150,000, and seeds are fixed."""


@lm.record
class Zeeman(lm.Hamiltonian):
    """A spin in a field along the third axis."""

    field: float

    def energy(self, mu):
        return -self.field * mu[2]


@lm.record
class EasyAxis(lm.Hamiltonian):
    """A spin that likes to stand along the third axis, up or down."""

    strength: float

    def energy(self, mu):
        return -self.strength * mu[2] * mu[2]


def spin(hamiltonian: Any) -> Any:
    return lm.LiePoissonSystem(lm.SO3(), hamiltonian)


def turning(seed: int, sigma: float = 0.1) -> Any:
    """A spin that noise turns about the third axis, and nothing else: its angle is sigma W(t), exactly."""
    return lm.Stochastic(spin(Zeeman(0.0)), fields=[[0.0, 0.0, sigma]], seed=seed)


def angles(run: Any) -> Any:
    return np.unwrap(np.arctan2(run.mu[..., 1], run.mu[..., 0]), axis=0)


def increments(seed: int, steps: int, paths: int = 1) -> Any:
    """The noise of each step and path, which has unit variance."""
    system = turning(seed)
    start = system.state(mu=[[1.0, 0.0, 0.0]] * paths)
    run = lm.integrate(system, lm.WongZakai(), start, h=0.04, steps=steps, progress=False)
    return np.diff(angles(run), axis=0) / (0.1 * np.sqrt(0.04))


def langevin(ratio: float) -> float:
    """Mean of cos theta on a sphere by exp(ratio cos theta)."""
    return 1.0 / np.tanh(ratio) - 1.0 / ratio


def assert_mean(values: Any, mean: float) -> None:
    error = values.std() / np.sqrt(values.size)
    assert abs(values.mean() - mean) < BOUND * error, (values.mean(), mean, error)


@pytest.mark.slow
def test_spins_of_different_size_reach_one_temperature() -> None:
    """lammps/lammps#5097: the larger of two kinds of moments came to a third of the temperature of the bath."""
    sizes, field, temperature, n = np.array([1.0, 4.0]), 0.5, 0.7, 3000
    bath = lm.thermal_bath(spin(Zeeman(field)), damping=0.5, temperature=temperature, seed=4)
    start = bath.state(mu=np.repeat(sizes, n)[:, None] * [1.0, 0.0, 0.0])
    run = lm.integrate(bath, lm.NinomiyaVictoir(), start, h=0.05, steps=120, every=120, progress=False)
    for size, up in zip(sizes, run.mu[-1, :, 2].reshape(2, n), strict=True):
        assert_mean(up / size, langevin(field * size / temperature))


@pytest.mark.parametrize("other", [43, 44, 42 + 2**32])
def test_the_noise_of_another_seed_is_no_shifted_copy(other: int) -> None:
    """espressomd/espresso#3585, #4848: seeds only shifted the sequence of random numbers."""
    n = 1000
    one, two = increments(42, n)[:, 0], increments(other, n)[:, 0]
    assert np.abs(np.correlate(one, two, mode="full")).max() < BOUND * 1.3 * np.sqrt(n)  # of 2 n lags
    assert abs(one.var() - 1.0) < BOUND * np.sqrt(2.0 / n)


def test_the_noise_of_many_seeds_is_spread_as_that_of_many_paths() -> None:
    """SciML/StochasticDiffEq.jl#532: with a seed given, results were far from those expected."""
    ends = np.array([increments(seed, 20)[:, 0].sum() for seed in range(300)]) / np.sqrt(20.0)
    assert_mean(ends, 0.0)
    assert abs(ends.var() - 1.0) < BOUND * np.sqrt(2.0 / 300)


@pytest.mark.slow
def test_a_run_with_steps_of_another_length_takes_another_seed() -> None:
    """espressomd/espresso#3840: counters by time / time_step repeated the noise when the step or the time was set anew.
    Noise here is counted by the steps of a run, so that a plan does not go on with another step, and says why.
    """
    system, paths, n = turning(3), 20, 200
    first = lm.Plan(system, lm.WongZakai(), h=0.04, progress=False).run(
        system.state(mu=[[1.0, 0.0, 0.0]] * paths), steps=n
    )
    with pytest.raises(lm.errors.InvalidInput, match="with another seed: with this one its noise repeats"):
        lm.Plan(system, lm.WongZakai(), h=0.01).resume(first, steps=n)
    finer = lm.Plan(turning(4), lm.WongZakai(), h=0.01, progress=False).run(first.last, steps=n)
    one = np.diff(angles(first), axis=0).ravel() / (0.1 * 0.2)
    two = np.diff(angles(finer), axis=0).ravel() / (0.1 * 0.1)
    assert len(two) == n * paths and abs(two.var() - 1.0) < BOUND * np.sqrt(2.0 / (n * paths))
    assert abs((one * two).mean()) < BOUND / np.sqrt(n * paths)


@pytest.mark.slow
def test_no_step_is_shortened_and_the_advised_ones_have_the_variance_of_their_time() -> None:
    """SciML/OrdinaryDiffEq.jl#4095, #4097: a shortened step took the increment of the whole one."""
    system, paths = turning(5, sigma=0.3), 4000
    start = system.state(mu=[[1.0, 0.0, 0.0]] * paths)
    with pytest.raises(lm.errors.InvalidInput, match=r"fixed steps end there with h = 0\.625, 2 of them"):
        lm.integrate(system, lm.WongZakai(), start, h=1.0, t_end=1.25, progress=False)
    run = lm.integrate(system, lm.WongZakai(), start, h=0.625, t_end=1.25, progress=False)
    assert run.t[-1] == 1.25
    variance = angles(run)[-1].var() / 0.3**2
    assert abs(variance / 1.25 - 1.0) < BOUND * np.sqrt(2.0 / paths)


@pytest.mark.slow
def test_members_of_an_ensemble_have_noise_of_their_own_wherever_they_run() -> None:
    """SciML/OrdinaryDiffEq.jl#3737, SciML/DifferentialEquations.jl#1034, #498: members ran along one path, in threads
    sometimes.
    """
    system = turning(7)
    start = system.state(mu=[[1.0, 0.0, 0.0]] * 12)
    alone = lm.integrate(system, lm.WongZakai(), start, h=0.04, steps=30, progress=False)
    with ThreadPoolExecutor(4) as pool:
        shared = lm.integrate(system, lm.WongZakai(), start, h=0.04, steps=30, progress=False, executor=pool)
    assert np.array_equal(alone.mu, shared.mu)
    ends = angles(alone)[-1]
    assert np.abs(np.subtract.outer(ends, ends))[~np.eye(12, dtype=bool)].min() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.25, 1.0])
def test_the_temperature_does_not_depend_on_the_damping(damping: float) -> None:
    """MolarVerse/PQ#273: the amplitude of the noise stayed where it was when the friction was changed."""
    bath = lm.thermal_bath(spin(Zeeman(1.0)), damping=damping, temperature=0.8, seed=8)
    start = bath.state(mu=[[0.0, 1.0, 0.0]] * 4000)
    steps = round(8.0 / (damping * 0.05))
    run = lm.integrate(bath, lm.NinomiyaVictoir(), start, h=0.05, steps=steps, every=steps, progress=False)
    assert_mean(run.mu[-1, :, 2], langevin(1.0 / 0.8))


@pytest.mark.slow
def test_a_bath_begun_again_in_pieces_is_the_bath_in_one() -> None:
    """espressomd/espresso#3341, AMReX-Microelectronics/artemis#84: a start anew heated or cooled for a step."""
    bath = lm.thermal_bath(spin(Zeeman(1.0)), damping=0.3, temperature=0.8, seed=9)
    start = bath.state(mu=[[0.0, 0.6, 0.8]] * 5)
    plan = lm.Plan(bath, lm.NinomiyaVictoir(), h=0.1, progress=False)
    run = plan.run(start, steps=1)
    for _ in range(11):
        run = plan.resume(run, steps=1)
    assert np.array_equal(run.mu[-1], plan.run(start, steps=12).mu[-1])


@pytest.mark.parametrize("size", [0.5, 3.0])
def test_a_cold_bath_is_damping_alone_at_the_rate_of_landau_and_lifshitz(size: float) -> None:
    """spirit-code/spirit#643, #363: noise was seen at temperature zero, and moments of another size turned at another
    rate.  mu' = mu x (xi + lambda mu x xi) with xi = -B e_3 gives z = s tanh(lambda B s t + artanh(z_0/s)), angle B t.
    """
    field, damping, z = 1.3, 0.2, 0.1
    bath = lm.thermal_bath(spin(Zeeman(field)), damping=damping, temperature=0.0, seed=1)
    start = bath.state(mu=[[size * np.sqrt(1.0 - z * z), 0.0, size * z]])
    run = lm.integrate(bath, lm.WongZakai(), start, h=0.01, steps=200, progress=False)
    heights = size * np.tanh(damping * field * size * run.t + np.arctanh(z))
    assert np.allclose(run.mu[:, 0, 2], heights, rtol=0.0, atol=1e-7 * size)
    assert np.allclose(np.abs(angles(run)[:, 0]), field * run.t, atol=1e-7)


@pytest.mark.slow
def test_a_deep_well_with_two_bottoms_is_filled_as_boltzmann_says() -> None:
    """jax-md/jax-md#124: a Langevin step gave a density with peaks that the potential does not have."""
    bath = lm.thermal_bath(spin(EasyAxis(3.0)), damping=0.5, temperature=0.5, seed=11)
    up = np.random.default_rng(0).normal(size=(4000, 3))
    start = bath.state(mu=up / np.linalg.norm(up, axis=1)[:, None])
    run = lm.integrate(bath, lm.NinomiyaVictoir(), start, h=0.02, steps=250, every=250, progress=False)
    heights = run.mu[-1, :, 2]
    total, second = (quad(lambda z, k=k: z**k * np.exp(3.0 * z * z / 0.5), -1.0, 1.0)[0] for k in (0, 2))
    assert_mean(heights, 0.0)
    assert_mean(heights**2, second / total)
