"""Metriplectic systems: energy stays, entropy grows, by the numbers of their brackets."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.integrate

import liemech as lm


@lm.record
class HalfSquare(lm.Hamiltonian):
    """|mu|^2/2, a function of the Casimir of so(3)."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu, mu)


@lm.record
class Heat(lm.PoissonStructure):
    """The canonical bracket of q and p; s commutes with all."""

    dim = 3

    def matrix(self, y: lm.Vec) -> lm.Mat:
        return lm.mat(lm.vec(0.0, 1.0, 0.0), lm.vec(-1.0, 0.0, 0.0), lm.vec(0.0, 0.0, 0.0))

    def casimirs(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(y[2])


@lm.record
class PendulumAndHeat(lm.Hamiltonian):
    """A pendulum, and a heat capacity c whose energy is c exp(s/c)."""

    capacity: float

    def energy(self, y: lm.Vec) -> float:
        heat = self.capacity * lm.formulas.exp(y[2] / self.capacity)
        return 0.5 * y[1] * y[1] - lm.formulas.cos(y[0]) + heat


@lm.record
class Entropy(lm.Hamiltonian):
    """s itself."""

    def energy(self, y: lm.Vec) -> float:
        return y[2]


@lm.record
class Drag(lm.Friction):
    """Friction gamma T p on the momentum, whose work is heat."""

    gamma: float

    def pairing(self, mu: lm.Vec, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        return lm.vec(lm.formulas.sqrt(self.gamma) * (xi[2] * eta[1] - xi[1] * eta[2]))


def relaxing() -> tuple[lm.Metriplectic, object]:
    system = lm.Metriplectic(lm.RigidBody([1.0, 1.5, 2.0]), HalfSquare(), 0.2)
    return system, system.state([0.6, 0.1, 0.75])


def heating() -> tuple[lm.Metriplectic, object]:
    pendulum = lm.PoissonSystem(Heat(), PendulumAndHeat(0.7))
    system = lm.Metriplectic(pendulum, Entropy(), Drag(0.3))
    return system, system.state([1.2, 0.3, 0.1])


def test_the_relaxing_body_moves_as_morrison_writes_it() -> None:
    system, start = relaxing()
    mu = np.array([0.6, 0.1, 0.75])
    omega = mu / [1.0, 1.5, 2.0]
    # mu x omega + k (|omega|^2 - omega omega^T) mu
    expected = np.cross(mu, omega) + 0.2 * (omega @ omega * mu - omega * (omega @ mu))
    assert np.allclose(system.rate(0.0, start), expected, rtol=0, atol=1e-15)


def test_the_damped_pendulum_moves_as_mechanics_writes_it() -> None:
    system, start = heating()
    q, p, temperature = 1.2, 0.3, np.exp(0.1 / 0.7)
    expected = [p, -np.sin(q) - 0.3 * temperature * p, 0.3 * p * p]
    assert np.allclose(system.rate(0.0, start), expected, rtol=0, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("of", [relaxing, heating])
def test_energy_to_rounding_and_entropy_in_every_step(of: object) -> None:
    system, start = of()
    run = lm.integrate(system, lm.DiscreteGradient(), start, h=0.2, steps=500)
    states = run.states[system.part]
    energy = np.asarray(system.energy(states))
    entropy = np.asarray(system.entropy.energy(states))
    assert np.abs(energy - energy[0]).max() < 20 * np.finfo(float).eps * max(1.0, abs(energy[0]))
    assert np.diff(entropy).min() > -4 * np.finfo(float).eps and entropy[-1] > entropy[0] + 0.05
    explicit = lm.integrate(system, lm.RKMK(order=4), start, h=0.2, steps=500)
    lost = np.asarray(system.energy(explicit.states[system.part]))
    assert np.abs(lost - lost[0]).max() > 1e-8  # what the discrete gradient is for


def test_the_entropy_grows_by_the_sum_of_squares() -> None:
    system, start = relaxing()
    run = lm.integrate(system, lm.DiscreteGradient(), start, h=0.2, steps=20)
    m = 0.5 * (run.mu[1:] + run.mu[:-1])
    forms = np.sqrt(0.2) * np.cross(m / [1.0, 1.5, 2.0], m)  # dH and dS at the mean
    growth = 0.2 * (forms**2).sum(axis=1)
    assert np.abs(np.diff(0.5 * (run.mu**2).sum(axis=1)) - growth).max() < 1e-15


@pytest.mark.slow
@pytest.mark.parametrize("of", [relaxing, heating])
def test_order_two_beside_scipy(of: object) -> None:
    system, start = of()
    y0 = np.array(getattr(start, system.part))

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.array(system.change(y, system.gradient(y), system.entropy.gradient(y)))

    exact = scipy.integrate.solve_ivp(rate, (0.0, 3.0), y0, method="DOP853", rtol=1e-12, atol=1e-13)
    errors = [
        np.abs(
            lm.integrate(system, lm.DiscreteGradient(), start, h=3.0 / n, steps=n).states[system.part][-1]
            - exact.y[:, -1]
        ).max()
        for n in (30, 60)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_its_end_is_a_rest_axis() -> None:
    system, start = relaxing()
    run = lm.integrate(system, lm.DiscreteGradient(), start, h=0.5, steps=2000, every=2000)
    mu = run.mu[-1] / np.linalg.norm(run.mu[-1])
    assert np.abs(mu - [0.0, 0.0, 1.0]).max() < 1e-10  # most entropy at this energy: the largest moment


@lm.record
class Symmetric(lm.Friction):
    """A form that is not skew."""

    def pairing(self, mu: lm.Vec, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        return lm.vec(lm.dot(xi, eta))


def test_what_breaks_the_laws_is_named() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    with pytest.raises(lm.errors.InvalidInput, match="no Casimir function"):
        lm.Metriplectic(body, lm.KineticEnergy([1.0, 2.0, 3.0]), 0.2)
    with pytest.raises(lm.errors.InvalidInput, match="must be skew"):
        lm.Metriplectic(body, HalfSquare(), Symmetric())
    with pytest.raises(lm.errors.InvalidInput, match="not negative"):
        lm.Metriplectic(body, HalfSquare(), -0.1)
    with pytest.raises(lm.errors.InvalidInput, match="leave g out"):
        lm.Metriplectic(body, HalfSquare(), 0.1).state([1.0, 0.0, 0.0], np.eye(3))
    with pytest.raises(lm.errors.IncompatibleSystem, match="Metriplectic"):
        lm.integrate(body, lm.DiscreteGradient(), body.state([1.0, 0.0, 0.0]), h=0.1, steps=1)
