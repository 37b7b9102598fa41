"""Ideal flow on the sphere as matrices: harmonics, Laplacian, energies, and a wave that moves exactly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import sph_harm_y

import liemech as lm
from liemech.formulas.large import Large

GIVEN = {(1, 0): 0.3, (2, 1): 0.5, (3, -2): -0.4, (3, 3): 0.2, (1, 1): 0.2, (1, -1): -0.1, (4, 2): 0.3}


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
        assert np.allclose(sphere.matrix(sphere.from_harmonics({lm_: unit}).mu), sphere.hbar * s, atol=1e-14)
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


def wave(sphere: lm.models.ZeitlinSphere, omega: float, turned: float = 0.0) -> dict[tuple[int, int], float]:
    """A Rossby-Haurwitz wave: solid rotation and harmonics of degree 3, turned to the east."""
    unit, a = np.sqrt(4.0 * np.pi / 3.0), turned
    return {(1, 0): 2.0 * omega * unit, (3, 2): 0.5 * np.cos(2 * a), (3, -2): 0.5 * np.sin(2 * a),
            (3, 1): -0.3 * np.sin(a), (3, -1): 0.3 * np.cos(a)}  # fmt: skip


@pytest.mark.slow
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
            run = lm.integrate(sphere, lm.Isospectral(order), start, h=h, steps=round(t / h), compiled=False)
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
            sphere, lm.Isospectral(order), sphere.from_harmonics(eddies), h=0.1, steps=30, compiled=False
        )
        assert np.abs(run.mu[-1] - run.mu[0]).max() > 0.01
        assert np.abs(sphere.angular_momentum(run.mu)).max() < 1e-13


def test_native_flow_has_the_same_bits() -> None:
    sphere = lm.models.ZeitlinSphere(13, rotation=0.2)
    start = sphere.from_harmonics(GIVEN)
    plain, native = (lm.integrate(sphere, lm.Isospectral(2), start, h=0.05, steps=5, compiled=c) for c in (False, True))
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


# ---------------------------------------------------------------- beside SymPy and quflow


def polarization(n: int, l: int, m: int) -> np.ndarray:
    """T_lm of spin s = (n - 1)/2 by Wigner's 3j symbols, of trace norm one, by SymPy: the elements
    (-1)^(s - m1) sqrt(2 l + 1) (s l s; -m1 m m2), rows m1 and columns m2 from s down.

    Source: Varshalovich, Moskalev, Khersonskii, Quantum Theory of Angular Momentum, 2.4.
    """
    from sympy import Rational
    from sympy.physics.wigner import wigner_3j

    s, found = Rational(n - 1, 2), np.zeros((n, n))
    for j in range(n):
        if 0 <= j + m < n:
            symbol = wigner_3j(s, l, s, -(s - j), m, s - j - m)
            found[j, j + m] = (-1) ** j * np.sqrt(2 * l + 1) * float(symbol)
    return found


def ours(sphere: lm.models.ZeitlinSphere, l: int, m: int) -> np.ndarray:
    """Our matrix of the complex harmonic Y_lm, of trace norm one."""
    up = sphere.matrix(np.array(sphere.from_harmonics({(l, abs(m)): 1.0}).mu))
    if m == 0:
        found = up
    else:
        down = sphere.matrix(np.array(sphere.from_harmonics({(l, -abs(m)): 1.0}).mu))
        found = (up + np.sign(m) * 1j * down) / np.sqrt(2.0)
        found = (-1) ** m * found if m > 0 else found
    return found * np.sqrt(4.0 * np.pi / sphere.n)


DEGREES = [(1, 0), (1, -1), (2, 1), (3, 3), (5, -4), (12, 7), (12, 0), (12, -12)]


@pytest.mark.parametrize("n", [13, pytest.param(24, marks=pytest.mark.slow)])
def test_harmonics_are_wigners_3j_symbols(n: int) -> None:
    """And eigenvectors of -sum_k [S_k, [S_k, .]], by products of spin matrices: Hoppe and Yau."""
    sphere = lm.models.ZeitlinSphere(n)
    for l, m in DEGREES:
        t = polarization(n, l, m)
        assert np.abs(ours(sphere, l, m) - t).max() < 5e-15, (l, m)
        turned = sum(commutator(s, commutator(s, t)) for s in spins(n))
        assert np.abs(turned - l * (l + 1) * t).max() < 1e-13 * l * (l + 1)
        assert abs(sphere.hamiltonian.solver(Large(t.astype(complex))).array * l * (l + 1) - t).max() < 1e-14


def test_brackets_have_the_published_structure_constants() -> None:
    """T_1 T_2 = sum_l (-1)^(2 s + l) sqrt((2 l1 + 1)(2 l2 + 1)) {l1 l2 l; s s s} C^lm_l1m1l2m2 T_lm: the 6j
    symbols of SymPy; commutators have the terms of l1 + l2 + l odd twice.
    """
    from sympy import Rational
    from sympy.physics.quantum.cg import CG
    from sympy.physics.wigner import wigner_6j

    n = 13
    sphere, s = lm.models.ZeitlinSphere(n), Rational(n - 1, 2)
    for (l1, m1), (l2, m2) in (((2, 1), (3, -2)), ((1, 0), (4, 3)), ((5, -4), (12, 7))):
        found = commutator(ours(sphere, l1, m1), ours(sphere, l2, m2))
        expected, m = np.zeros((n, n), dtype=complex), m1 + m2
        for l in range(max(abs(l1 - l2), abs(m)), min(l1 + l2, n - 1) + 1):
            if (l1 + l2 + l) % 2:
                c = wigner_6j(l1, l2, l, s, s, s) * CG(l1, m1, l2, m2, l, m).doit()
                size = (-1) ** (n - 1 + l) * np.sqrt((2 * l1 + 1) * (2 * l2 + 1)) * float(c)
                expected += 2.0 * size * ours(sphere, l, m)
        assert np.abs(found).max() > 0.05 and np.abs(found - expected).max() < 1e-14


QUFLOW = {
    (1, 0): 0.30000000000000016, (1, 1): 0.2000000000000002, (2, 0): 0.014612999273520423,
    (2, 1): 0.49884762859843207, (2, -2): -0.016866236308696766, (3, 3): 0.1495789523028848,
    (3, -2): -0.39893845985319065, (5, 1): 0.0076408839727857775, (6, -5): 0.1628543600591445,
    (9, 4): 0.0003993242713289716,
}  # fmt: skip
"""Coefficients of quflow 0.1.0 (github.com/klasmodin/quflow, `isomp_fixedpoint` with compensated sums) after 40 steps
of h = 0.05, N = 16, from the harmonics below; its matrices are longer by -sqrt(4 pi), which h is divided by.
"""


def test_energy_and_motion_are_those_of_quflow() -> None:
    """The same method, by another program of other people."""
    sphere = lm.models.ZeitlinSphere(16)
    given = {(1, 0): 0.3, (1, 1): 0.2, (2, 1): 0.5, (3, -2): -0.4, (3, 3): 0.2, (4, 2): 0.3, (6, -5): 0.25}  # fmt: skip
    start = sphere.from_harmonics(given)
    assert sphere.energy(np.array(start.mu)) == pytest.approx(0.06466071428571442, rel=1e-14)
    assert sphere.enstrophy(np.array(start.mu)) == pytest.approx(0.3662500000000001, rel=1e-14)
    run = lm.integrate(sphere, lm.Isospectral(2), start, h=0.05, steps=40, every=40)
    found = sphere.harmonics(run.mu[-1])
    for (l, m), value in QUFLOW.items():
        assert found[l, 15 + m] == pytest.approx(value, abs=2e-15)


def test_a_matrix_and_its_state() -> None:
    sphere = lm.models.ZeitlinSphere(13)
    mu = np.array(sphere.from_harmonics(GIVEN).mu)
    assert np.abs(np.array(sphere.from_matrix(sphere.matrix(mu)).mu) - mu).max() < 1e-16


F = np.diag([1.0, -1.0, *[0.0] * 11])
BAD: list[tuple[str, Any, str]] = [
    ("from_matrix", (np.eye(12),), r"shape \(12, 12\)"),
    ("from_matrix", (np.eye(13),), "trace 13"),
    ("from_matrix", (F + 1e-6 * np.eye(13),), "trace 1.3e-05.*subtract 1e-06"),
    ("from_matrix", (1j * F,), r"not hermitian, as that of a real field is: \[0, 0\]"),
    ("from_matrix", (np.triu(np.ones((13, 13)), 1),), r"not hermitian.*\[0, 1\] is 1"),
    ("from_matrix", (np.full((13, 13), np.nan),), "finite"),
    ("from_harmonics", ({(2, 1): 1.0 + 1.0j},), "real numbers"),
    ("from_harmonics", ({(2, 1): np.nan},), "finite real number"),
    ("from_harmonics", ({(2, 1): np.ones(2)},), "finite real number"),
    ("from_harmonics", ({2: 1.0},), "two integers"),
    ("from_harmonics", ({(2.5, 1): 1.0},), "two integers"),
    ("from_harmonics", (1j * np.ones((3, 5)),), "real numbers"),
    ("matrix", (np.ones(5),), r"shape \(5,\); its last axis must be 168"),
    ("levels", (np.ones(167),), "168"),
    ("harmonics", (np.ones(168), -1), "degrees"),
    ("vorticity", (np.ones(168), [[0.1]], [0.2]), "latitude has shape"),
    ("vorticity", (np.ones(168), [0.1], 0.2), "longitude has shape"),
    ("state", (np.ones(169),), r"mu has shape \(169,\)"),
]


@pytest.mark.parametrize(("method", "given", "words"), BAD, ids=lambda x: x if isinstance(x, str) else "")
def test_a_field_that_is_none_is_named(method: str, given: Any, words: str) -> None:
    with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=words):
        getattr(lm.models.ZeitlinSphere(13), method)(*given)
