"""Lyapunov exponents and MEGNO: of linear maps, of integrable and of chaotic motions."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import liemech as lm


@lm.record
class Saddles(lm.HamiltonianSystem):
    """H = (p_1^2 - a^2 q_1^2 + p_2^2 - b^2 q_2^2)/2: exponents +-a, +-b."""

    degrees = 2
    a: float
    b: float

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * (p[0] * p[0] + p[1] * p[1] - (self.a * q[0]) ** 2 - (self.b * q[1]) ** 2)


def test_saddles_have_the_exponents_of_their_map() -> None:
    saddles = Saddles(0.7, 0.3)
    plan = lm.Plan(saddles, lm.RKMK(order=8), h=0.1, record=["energy"])  # what runs of the plan keep, it does not need
    start = saddles.state(q=[1e-9, 2e-9], p=[0.0, 0.0])
    half, whole = (lm.lyapunov(plan, start, steps=n, exponents=4) for n in (500, 1000))
    # what the first directions add is gone in the difference of the sums, once the largest have been found
    later = 2.0 * whole.exponents - half.exponents
    np.testing.assert_allclose(later, [0.7, 0.3, -0.3, -0.7], atol=1e-8)
    assert abs(whole.exponents.sum()) < 1e-11
    assert whole.verdict == "chaotic"
    # without the mixing term: Y -> lambda t + constant
    assert whole.megno[-1] == pytest.approx(0.7 * 100.0, rel=0.05)


def test_an_equilibrium_has_the_exponents_of_its_saddle() -> None:
    """An upright pendulum at rest, whose momentum is rounding: 2 asinh(w h/2)/h of the steps, w = sqrt(g/l)."""
    pendulum, h = lm.models.Pendulum(), 0.02
    plan, upright = lm.Plan(pendulum, lm.StormerVerlet(), h=h, compiled=False), pendulum.state([np.pi], [0.0])
    half, whole = (lm.lyapunov(plan, upright, steps=n, exponents=2) for n in (50, 100))
    rate = 2.0 / h * np.arcsinh(0.5 * h * np.sqrt(pendulum.gravity / pendulum.length))
    np.testing.assert_allclose(2.0 * whole.exponents - half.exponents, [rate, -rate], rtol=1e-4)
    assert whole.exponents == pytest.approx([rate, -rate], rel=0.05)


G = np.asarray(lm.SO3().exp([0.3, -0.4, 0.5]))


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.LieVerlet()], ids=repr)
def test_a_lagrange_top_is_regular_and_a_heavy_one_is_not(method: lm.Method) -> None:
    """Mean MEGNO tends to 2, or grows as lambda t/2."""
    regular = lm.models.LagrangeTop(transverse=1.0, axial=0.6, weight=0.8, length=1.0)
    found = lm.lyapunov(lm.Plan(regular, method, h=0.1), regular.state(mu=[0.5, 1.1, -0.4], g=G), steps=2000)
    assert found.verdict == "regular" and found.mean_megno[-1] == pytest.approx(2.0, abs=0.25)
    assert found.exponents[0] < 3.0 * math.log(200.0) / 200.0
    chaotic = lm.models.HeavyTop([1.0, 1.6, 2.3], 4.0, [0.9, 0.3, 0.8])
    plan = lm.Plan(chaotic, method, h=0.1)
    found = lm.lyapunov(plan, chaotic.state(mu=[0.2, 0.3, 0.1], g=G), steps=2000, exponents=6)
    assert found.verdict == "chaotic" and found.exponents[0] > 0.1
    assert found.mean_megno[-1] == pytest.approx(0.5 * found.exponents[0] * 200.0, rel=0.4)
    assert abs(found.exponents.sum()) < (1e-10 if isinstance(method, lm.LieVerlet) else 1e-4)
    np.testing.assert_allclose(found.exponents, -found.exponents[::-1], atol=0.02)


@pytest.mark.parametrize("time", [4.0, 5.5, 7.0])
def test_a_short_run_of_a_chaotic_motion_is_not_called_regular(time: float) -> None:
    """<Y> = lambda t/2 passes 2, where that of regular motion stays."""
    saddles, rate = Saddles(0.7, 0.3), 0.7
    plan, start = lm.Plan(saddles, lm.RKMK(order=4), h=0.05), saddles.state(q=[1.0, 0.0], p=[rate, 0.0])
    found = lm.lyapunov(plan, start, steps=round(time / rate / 0.05))
    along = dataclasses.replace(found, megno=rate * found.t, mean_megno=0.5 * rate * found.t)
    assert along.mean_megno[-1] == pytest.approx(0.5 * time, rel=0.01) and along.verdict == "undecided"


def test_backwards_exponents_tell_how_disturbances_grow() -> None:
    """Exponents of a reversible motion are those of the way back."""
    saddles = Saddles(0.7, 0.3)
    start = saddles.state(q=[1e-9, 2e-9], p=[0.0, 0.0])
    there, back = (
        lm.lyapunov(lm.Plan(saddles, lm.RKMK(order=8), h=h), start, steps=500, exponents=4) for h in (0.1, -0.1)
    )
    np.testing.assert_allclose(back.exponents, [0.7, 0.3, -0.3, -0.7], atol=0.1)
    np.testing.assert_allclose(back.history[-1], 0.7, atol=0.1)
    assert there.verdict == back.verdict == "chaotic"


@pytest.mark.slow
def test_the_first_disturbance_and_units_do_not_matter() -> None:
    found = []
    for length, seed in ((1.0, 0), (2.0**20, 1), (2.0**-20, 2)):
        top = lm.models.HeavyTop(
            [length**2, 1.6 * length**2, 2.3 * length**2], 4.0 * length, [0.9 * length, 0.3 * length, 0.8 * length]
        )
        start = top.state(mu=(length**2 * np.array([0.2, 0.3, 0.1])).tolist(), g=G)
        found.append(lm.lyapunov(lm.Plan(top, lm.LieVerlet(), h=0.05), start, steps=8000, seed=seed).exponents[0])
    assert max(found) - min(found) < 0.2 * max(found)


@pytest.mark.slow
def test_adaptive_steps_see_it_too() -> None:
    top = lm.models.HeavyTop([1.0, 1.6, 2.3], 4.0, [0.9, 0.3, 0.8])
    start = top.state(mu=[0.2, 0.3, 0.1], g=G)
    adaptive = lm.lyapunov(lm.Plan(top, lm.RKMK(order=5), rtol=1e-8), start, t_end=200.0)
    fixed = lm.lyapunov(lm.Plan(top, lm.RKMK(order=8), h=0.1), start, steps=2000)
    assert adaptive.verdict == "chaotic" and adaptive.exponents[0] == pytest.approx(fixed.exponents[0], rel=0.3)
    assert adaptive.t[-1] == pytest.approx(200.0)


@lm.record
class Exchange(lm.Term):
    """Heisenberg's exchange of two neighbours, uneven in x."""

    def energy(self, a: Any, b: Any) -> float:
        return -lm.dot(a.mu, b.mu) - 0.7 * a.mu[0] * b.mu[0]


@lm.record
class WrittenOut(lm.LiePoissonSystem):
    """A system of sites that is stepped as one body."""

    small = 100


@pytest.mark.slow
def test_many_sites_are_chaotic_as_one_body_of_all() -> None:
    """The first exponent by sites and written out, along the same disturbance: to rounding, which grows with it."""
    graph = lm.neighbours.ring(5)
    spins = lm.LiePoissonSystem(lm.SO3() ** graph.sites, lm.Terms(Exchange().over(graph)))
    mu = np.random.default_rng(3).normal(size=(5, 3))
    found = [
        lm.lyapunov(lm.Plan(system, lm.RKMK(order=4), h=0.02), system.state(mu=mu), steps=500, exponents=2)
        for system in (spins, WrittenOut(spins.group, spins.hamiltonian))
    ]
    np.testing.assert_allclose(found[1].exponents, found[0].exponents, rtol=1e-8)


def test_bad_input_is_told() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    plan, start = lm.Plan(body, lm.RKMK(order=4), h=0.1), body.state(mu=[0.1, 0.2, 0.9])
    for arguments, words in (
        ({"t_end": 3.0}, "give steps with fixed steps, alone"),
        ({"steps": 0}, "steps"),
        ({"steps": 10, "exponents": 4}, "exponents is from 1 to 3, the components of the state; got 4"),
    ):
        with pytest.raises(lm.errors.InvalidInput, match=words):
            lm.lyapunov(plan, start, **arguments)
    with pytest.raises(lm.errors.InvalidInput, match="one body; got an ensemble of 2"):
        lm.lyapunov(plan, body.state(mu=np.ones((2, 3))), steps=10)
    # pieces of 100 steps would all have the noise of the first
    noisy = lm.Stochastic(body, [[0.3, 0.0, 0.0]], seed=1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="without noise, which would repeat"):
        lm.lyapunov(lm.Plan(noisy, lm.WongZakai(), h=0.1), noisy.state(mu=[0.1, 0.2, 0.9]), steps=200)
