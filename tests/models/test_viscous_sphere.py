"""Viscous flow on the sphere: decay of harmonics, what stays and what falls, order, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.formulas.large import Large

EDDIES = {(2, 1): 0.5, (3, -2): -0.4, (3, 3): 0.2, (4, 2): 0.3, (1, 0): 0.3, (1, -1): 0.1}


def viscous(viscosity: float, rotation: float = 0.0, n: int = 13) -> Any:
    return lm.models.ViscousSphere(lm.models.ZeitlinSphere(n, rotation=rotation), viscosity)


@pytest.mark.parametrize("t", [1e-8, 0.1, 3.0, 30.0])
def test_every_harmonic_decays_as_the_formula_says(t: float) -> None:
    """exp(-nu (l (l + 1) - 2) t), from 1e-10 of a decay to ninety of them."""
    sphere = viscous(0.02)
    for l, m in ((1, 1), (2, 0), (5, -3), (12, 12), (12, -1)):
        mu = np.array(sphere.from_harmonics({(l, m): 0.7}).mu)
        lost = np.asarray(sphere.damped(Large(mu), t)) - mu
        expected = np.expm1(-0.02 * (l * (l + 1) - 2) * t) * mu
        assert np.abs(lost - expected).max() < 1e-15 * np.abs(mu).max()


def test_a_zonal_flow_decays_exactly_in_a_run() -> None:
    """Harmonics of m = 0 alone move nothing: a run has their decay to rounding."""
    sphere = viscous(0.05, rotation=0.4)
    start = sphere.from_harmonics({(1, 0): 0.3, (2, 0): 0.5, (6, 0): -0.2})
    run = lm.integrate(sphere, lm.DissipativeSplitting(), start, h=0.1, steps=20, compiled=False)
    found = sphere.system.harmonics(run.mu[-1])[:, 12]
    for l, a in ((1, 0.3), (2, 0.5), (6, -0.2)):
        assert found[l] == pytest.approx(a * np.exp(-0.05 * (l * (l + 1) - 2) * 2.0), rel=1e-13)


@pytest.mark.parametrize("rotation", [0.0, 0.6])
def test_what_stays_and_what_falls(rotation: float) -> None:
    sphere = viscous(0.01, rotation)
    run = lm.integrate(sphere, lm.DissipativeSplitting(), sphere.from_harmonics(EDDIES), h=0.1, steps=40)
    assert run.drift()["angular momentum"].verdict == "exact"
    enstrophy, turning = sphere.system.enstrophy(run.mu), sphere.system.angular_momentum(run.mu)
    assert (np.diff(enstrophy) < 0.0).all() and (np.diff(run.energy) < 0.0).all()
    assert np.abs(turning[:, 2] - turning[0, 2]).max() < 1e-14
    size = np.linalg.norm(turning, axis=1)  # of a rotating sphere it precesses
    assert np.abs(size - size[0]).max() < (1e-14 if rotation == 0.0 else 1.0)
    # d/dt enstrophy = -nu sum (l (l + 1) - 2) a_l^2
    a = sphere.system.harmonics(run.mu[20])
    l = np.arange(len(a))[:, None]
    slope = -0.01 * np.sum((l * (l + 1) - 2) * a**2)
    assert (enstrophy[21] - enstrophy[19]) / 0.2 == pytest.approx(slope, rel=1e-3)


def test_no_angular_momentum_stays_none() -> None:
    """Where it is zero, the size of its terms says what rounding is."""
    sphere = viscous(0.01)
    run = lm.integrate(
        sphere, lm.DissipativeSplitting(), sphere.from_harmonics({(2, 1): 0.5, (3, -2): 0.4}), h=0.1, steps=40
    )  # fmt: skip
    assert run.drift()["angular momentum"].verdict == "exact"


@pytest.mark.slow
def test_order_beside_scipy() -> None:
    """The matrix equation F' = [F, Psi]/(i hbar) + nu (Delta + 2) F, with spin matrices, by SciPy."""
    sphere, n = viscous(0.3, rotation=0.5), 13
    j = np.arange(1, n)
    up = np.diag(np.sqrt(j * (n - j)).astype(complex), 1)
    spins = (up + up.T) / 2, (up - up.T) / 2j, np.diag((n - 1) / 2 - np.arange(n)).astype(complex)
    adjoint = [np.kron(s, np.eye(n)) - np.kron(np.eye(n), s.T) for s in spins]
    delta = -sum(a @ a for a in adjoint)
    inverse, hbar = np.linalg.pinv(delta, rcond=1e-10), 2.0 / np.sqrt(n**2 - 1.0)
    start = sphere.from_harmonics(EDDIES)
    beta = (2.0 * 0.5 * hbar * spins[2]).ravel()

    def rate(_: float, f: np.ndarray) -> np.ndarray:
        psi, m = (inverse @ (f - beta)).reshape(n, n), f.reshape(n, n)
        return ((m @ psi - psi @ m) / (1j * hbar)).ravel() + 0.3 * (delta @ f + 2.0 * f)

    first = sphere.system.matrix(np.array(start.mu)).astype(complex).ravel()
    exact = solve_ivp(rate, (0.0, 1.6), first, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    for method in (lm.Isospectral(2), lm.Isospectral(4), lm.RKMK(order=4)):
        errors = []
        for h in (0.05, 0.025):
            run = lm.integrate(sphere, lm.DissipativeSplitting(method), start, h=h, steps=round(1.6 / h))
            errors.append(np.abs(sphere.system.matrix(run.mu[-1]).ravel() - exact).max())
        assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1, (method, errors)


@pytest.mark.slow
def test_native_code_has_the_bits_of_plain_python_and_goes_on() -> None:
    sphere = viscous(0.4)  # so viscous that a step is damped in several pieces
    assert sphere.fastest * 0.05 > 2.0
    plan = lm.Plan(sphere, lm.DissipativeSplitting(), h=0.1, compiled=True, progress=False)
    start = sphere.from_harmonics(EDDIES)
    plain = lm.integrate(sphere, lm.DissipativeSplitting(), start, h=0.1, steps=6, compiled=False)
    whole, half = plan.run(start, steps=6), plan.run(start, steps=3)
    assert whole.compiled and np.array_equal(plain.mu, whole.mu)
    assert np.array_equal(plan.resume(half, steps=3).mu[-1], whole.mu[-1])


def test_without_viscosity_it_is_the_ideal_flow() -> None:
    sphere = viscous(0.0, rotation=0.2)
    start = sphere.from_harmonics(EDDIES)
    damped = lm.integrate(sphere, lm.DissipativeSplitting(), start, h=0.1, steps=5, compiled=False)
    ideal = lm.integrate(
        sphere.system, lm.Isospectral(2), sphere.system.from_harmonics(EDDIES), h=0.1, steps=5,
        compiled=False,
    )  # fmt: skip
    assert np.array_equal(damped.mu, ideal.mu)


@lm.record
class Friction(lm.Dissipative):
    """A body in a medium that takes its momentum, on a small group."""

    rate_of_loss: float

    def damped(self, mu: lm.Vec, t: float) -> lm.Vec:
        return lm.formulas.exp(-self.rate_of_loss * t) * mu


def test_dissipation_of_ones_own_on_a_small_group() -> None:
    """mu' = mu x xi - c mu: time runs slower, mu(t) = e^-ct mu_0((1 - e^-ct)/c) with mu_0 the free body's."""
    body = lm.RigidBody([1.0, 1.5, 2.2])
    system, mu = Friction(body, 0.3), [0.5, 0.1, 0.8]
    inner = (1.0 - np.exp(-0.3 * 2.0)) / 0.3
    exact = np.exp(-0.3 * 2.0) * np.asarray(body.exact(body.state(mu=mu), t=[inner]).mu[-1])
    errors = []
    for h in (0.1, 0.05):
        run = lm.integrate(system, lm.DissipativeSplitting(), system.state(mu=mu), h=h, steps=round(2.0 / h))
        errors.append(np.abs(run.mu[-1] - exact).max())
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1 and errors[1] < 1e-3


def test_what_cannot_be_says_why() -> None:
    sphere = viscous(0.01)
    start = sphere.from_harmonics(EDDIES)
    for method in (lm.Isospectral(2), lm.RKMK(order=4), lm.LiePoissonHamiltonJacobi(order=2)):
        with pytest.raises(lm.errors.IncompatibleSystem, match=r"damped\. DissipativeSplitting"):
            lm.integrate(sphere, method, start, h=0.1, steps=1)
    split = lm.DissipativeSplitting()
    ideal = sphere.system
    with pytest.raises(lm.errors.IncompatibleSystem, match="for systems with dissipation"):
        lm.integrate(ideal, split, ideal.from_harmonics(EDDIES), h=0.1, steps=1)
    with pytest.raises(lm.errors.InvalidInput, match="forwards in time"):
        lm.integrate(sphere, split, start, h=-0.1, steps=1)
    with pytest.raises(lm.errors.InvalidInput, match="not symmetric"):
        lm.Composition(split)
    for bad in (-0.1, np.nan, np.inf):
        with pytest.raises(lm.errors.InvalidInput, match=r"viscosity .*(not negative|finite)"):
            lm.models.ViscousSphere(ideal, bad)
    with pytest.raises(lm.errors.InvalidType, match="must be a ZeitlinSphere"):
        lm.models.ViscousSphere(lm.RigidBody([1.0, 1.5, 2.0]), 0.1)
    with pytest.raises(lm.errors.InvalidType, match="LiePoissonSystem"):
        lm.models.ViscousSphere(3.0, 0.1)
