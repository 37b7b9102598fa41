"""Ideal flow on the sphere as matrices: harmonics, Laplacian, energies, and a wave that moves exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import sph_harm_y

import liemech as lm
from liemech.formulas.large import Large

GIVEN = {
    (1, 0): 0.3,
    (2, 1): 0.5,
    (3, -2): -0.4,
    (3, 3): 0.2,
    (1, 1): 0.2,
    (1, -1): -0.1,
    (4, 2): 0.3,
}


def spins(n: int) -> tuple[np.ndarray, ...]:
    """S_x, S_y, S_z of spin (n - 1)/2."""
    j = np.arange(1, n)
    up = np.diag(np.sqrt(j * (n - j)).astype(complex), 1)
    return (up + up.T) / 2, (up - up.T) / 2j, np.diag((n - 1) / 2 - np.arange(n)).astype(complex)


def commutator(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a @ b - b @ a


def harmonic(l: int, m: int, latitude: float, longitude: float) -> float:
    """The real orthonormal harmonic, without the sign (-1)^m of Condon and Shortley, from SciPy."""
    y = complex(sph_harm_y(l, abs(m), np.pi / 2 - latitude, longitude)) * (-1) ** m
    return y.real if m == 0 else np.sqrt(2.0) * (y.real if m > 0 else y.imag)


@pytest.mark.parametrize("n", [13, 20])
def test_matrices_stand_for_functions(n: int) -> None:
    sphere = lm.models.ZeitlinSphere(n)
    unit = np.sqrt(4.0 * np.pi / 3.0)
    for lm_, s in zip(((1, 1), (1, -1), (1, 0)), spins(n), strict=True):
        assert np.allclose(
            sphere.matrix(sphere.from_harmonics({lm_: unit}).mu), sphere.hbar * s, atol=1e-14
        )
    mu = np.array(sphere.from_harmonics(GIVEN).mu)
    found = sphere.harmonics(mu)
    expected = np.zeros_like(found)
    for (l, m), a in GIVEN.items():
        expected[l, n - 1 + m] = a
    assert np.abs(found - expected).max() < 1e-14
    value = sum(a * harmonic(l, m, 0.3, 0.7) for (l, m), a in GIVEN.items())
    assert sphere.vorticity(mu, [0.3], [0.7])[0, 0] == pytest.approx(value, rel=1e-13)
    energy = sum(a * a / (2.0 * l * (l + 1)) for (l, _), a in GIVEN.items())
    assert sphere.energy(mu) == pytest.approx(energy, rel=1e-13)
    assert sphere.enstrophy(mu) == pytest.approx(sum(a * a for a in GIVEN.values()) / 2, rel=1e-13)
    assert np.allclose(sphere.angular_momentum(mu), unit * np.array([0.2, -0.1, 0.3]), atol=1e-14)


def test_poisson_equation_and_gradient() -> None:
    n, rng = 17, np.random.default_rng(3)
    sphere = lm.models.ZeitlinSphere(n, rotation=0.4)
    f = rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n))
    f = f + f.conj().T - 2.0 * np.trace(f).real / n * np.eye(n)
    x = sphere.hamiltonian.solver(Large(f)).array
    assert np.allclose(sum(commutator(s, commutator(s, x)) for s in spins(n)), f, atol=1e-12)
    assert abs(np.trace(x)) < 1e-13
    shifted = sphere.hamiltonian.solver(Large(f + 3.0 * np.eye(n))).array  # outside of the algebra
    assert np.allclose(shifted, x, atol=1e-13)
    mu, d = rng.normal(size=(2, sphere.group.dim))
    slope = (sphere.energy(mu + d) - sphere.energy(mu - d)) / 2.0  # of a quadratic function
    assert slope == pytest.approx(np.array(sphere.velocity(mu)) @ d, rel=1e-11)


def wave(
    sphere: lm.models.ZeitlinSphere, omega: float, turned: float = 0.0
) -> dict[tuple[int, int], float]:
    """A Rossby-Haurwitz wave: solid rotation and harmonics of degree 3, turned to the east."""
    unit, a = np.sqrt(4.0 * np.pi / 3.0), turned
    return {(1, 0): 2.0 * omega * unit, (3, 2): 0.5 * np.cos(2 * a), (3, -2): 0.5 * np.sin(2 * a),
            (3, 1): -0.3 * np.sin(a), (3, -1): 0.3 * np.cos(a)}  # fmt: skip


@pytest.mark.parametrize("rotation", [0.0, 0.6])
def test_a_rossby_haurwitz_wave_moves_exactly(rotation: float) -> None:
    """It turns with omega - (omega + Omega) 2/(l (l + 1)) where omega + Omega is the absolute
    rotation, seen from space; order 2, and 4 beside it.
    """
    n, absolute, t = 14, 0.7, 0.8
    sphere = lm.models.ZeitlinSphere(n, rotation=rotation)
    rate = (absolute - rotation) - 2.0 * absolute / 12.0
    errors: dict[int, list[float]] = {2: [], 4: []}
    start = sphere.from_harmonics(wave(sphere, absolute))
    exact = np.array(sphere.from_harmonics(wave(sphere, absolute, rate * t)).mu)
    for order, found in errors.items():
        for h in (0.1, 0.05):
            run = lm.integrate(
                sphere, lm.Isospectral(order), start, h=h, steps=round(t / h), compiled=False
            )
            found.append(float(np.abs(run.mu[-1] - exact).max() / np.abs(exact).max()))
            kept = run.drift()
            assert all(kept[k].verdict == "exact" for k in ("enstrophy", "moment 3", "moment 4"))
    for order, (coarse, fine) in errors.items():
        assert order - 0.4 < np.log2(coarse / fine) < order + 0.6
    assert errors[4][1] < 1e-4


def test_angular_momentum_is_kept_to_rounding() -> None:
    """It is quadratic in the lift of the flow to pairs of matrices, which Gauss' methods keep."""
    sphere, rng = lm.models.ZeitlinSphere(14), np.random.default_rng(5)
    eddies = {(l, m): rng.normal() / l for l in range(2, 8) for m in range(-l, l + 1)}
    for order in (2, 4):
        run = lm.integrate(
            sphere,
            lm.Isospectral(order),
            sphere.from_harmonics(eddies),
            h=0.1,
            steps=30,
            compiled=False,
        )
        assert np.abs(run.mu[-1] - run.mu[0]).max() > 0.01
        assert np.abs(sphere.angular_momentum(run.mu)).max() < 1e-13


def test_native_flow_has_the_same_bits() -> None:
    sphere = lm.models.ZeitlinSphere(13, rotation=0.2)
    start = sphere.from_harmonics(GIVEN)
    plain, native = (
        lm.integrate(sphere, lm.Isospectral(2), start, h=0.05, steps=5, compiled=c)
        for c in (False, True)
    )
    assert native.compiled and np.array_equal(plain.mu, native.mu)


def test_wrong_input_is_named() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"ZeitlinSphere\(5\).*13"):
        lm.models.ZeitlinSphere(5)
    with pytest.raises(lm.errors.InvalidInput, match="finite"):
        lm.models.ZeitlinSphere(13, rotation=np.nan)
    sphere = lm.models.ZeitlinSphere(13)
    for bad in ({(0, 0): 1.0}, {(13, 0): 1.0}, {(2, 3): 1.0}):
        with pytest.raises(lm.errors.InvalidInput, match=r"l goes from 1 to N - 1 = 12"):
            sphere.from_harmonics(bad)
    with pytest.raises(lm.errors.InvalidInput, match=r"shape \(3, 4\)"):
        sphere.from_harmonics(np.ones((3, 4)))
