"""Toda's flow, the equations of Bloch and Iserles, and von Neumann's: beside closed forms, SciPy, and the
lattice of particles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import liemech as lm
from liemech.groups.matrices import matrix_basis

SIZES = [4, 10]

METHODS = [(lm.Isospectral(2), 2), (lm.Isospectral(4), 4), (lm.RKMK(order=4), 4)]


def symmetric(n: int, seed: int = 1) -> np.ndarray:
    a = np.random.default_rng(seed).normal(size=(n, n))
    return (a + a.T) / (2.0 * np.sqrt(n))


def skew(n: int) -> np.ndarray:
    a = np.random.default_rng(5).normal(size=(n, n))
    return (a - a.T) / np.sqrt(n)


def errors(flow: Any, start: Any, exact: np.ndarray, method: Any, t: float) -> list[float]:
    """Of two steps, the second half as long."""
    found = []
    for h in (t / 8.0, t / 16.0):
        run = lm.integrate(flow, method, start, h=h, steps=round(t / h), compiled=False)
        found.append(float(np.abs(run.mu[-1] - exact).max()))
        assert np.ptp(flow.eigenvalues(run.mu), axis=0).max() < 5e-15
    return found


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize(("method", "order"), METHODS, ids=repr)
def test_the_full_toda_flow_is_that_of_qr_factors(n: int, method: Any, order: int) -> None:
    flow = lm.models.TodaFlow(n)
    start = flow.state(symmetric(n))
    exact = flow.exact(start, 1.0)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        l = y.reshape(n, n)
        b = np.triu(l, 1) - np.tril(l, -1)
        return (b @ l - l @ b).ravel()

    other = solve_ivp(rate, (0.0, 1.0), symmetric(n).ravel(), "DOP853", rtol=1e-12, atol=1e-14)
    assert np.abs(other.y[:, -1] - exact).max() < 1e-11
    coarse, fine = errors(flow, start, exact, method, 1.0)
    assert order - 0.4 < np.log2(coarse / fine) < order + 0.7


@pytest.mark.slow
@pytest.mark.parametrize("small", [9, 3])
def test_a_tridiagonal_matrix_is_todas_lattice(small: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written out, and in memory."""
    monkeypatch.setattr(matrix_basis, "SMALL", small)
    q, p = np.array([0.0, 0.3, 0.1, 0.5]), np.array([0.4, -0.2, 0.1, -0.3])
    lattice, flow = lm.models.TodaLattice(4), lm.models.TodaFlow(4)
    start = flow.lattice(q, p)
    run = lm.integrate(flow, lm.Isospectral(6), start, h=0.05, steps=20)
    other = solve_ivp(
        lambda t, y: of_lattice(y), (0.0, 1.0), np.asarray(lattice.state_of(q, p).y), rtol=1e-12, atol=1e-14
    ).y[:, -1]
    assert np.abs(flow.of_flaschka(run.mu[-1]) - other).max() < 1e-9
    long = lm.integrate(flow, lm.Isospectral(4), start, h=0.2, steps=300)
    turned = flow.matrix(long.mu[-1])  # symmetric still: what rounding left does not grow
    assert np.abs(turned - turned.T).max() < 1e-13
    assert np.abs(long.mu[-1] - flow.exact(start, 60.0)).max() < 1e-5
    l = flow.matrix(run.mu[-1])
    assert np.abs(np.triu(l, 2)).max() < 1e-12  # it stays tridiagonal
    in_the_end = flow.matrix(flow.exact(start, 200.0))
    assert np.abs(in_the_end - np.diag(flow.eigenvalues(run.mu[0])[::-1])).max() < 1e-9


def of_lattice(y: np.ndarray) -> np.ndarray:
    """a' and b' of Flaschka's variables."""
    a, b = y[:3], y[3:]
    square = np.concatenate([[0.0], a * a, [0.0]])
    return np.concatenate([a * (b[1:] - b[:-1]), 2.0 * (square[1:] - square[:-1])])


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("order", [2, 4])
def test_bloch_and_iserles_beside_scipy(n: int, order: int) -> None:
    flow, l0, s = lm.models.BlochIserles(skew(n)), symmetric(n), skew(n)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        square = y.reshape(n, n) @ y.reshape(n, n)
        return (s @ square - square @ s).ravel()

    exact = solve_ivp(rate, (0.0, 1.0), l0.ravel(), "DOP853", rtol=1e-12, atol=1e-14).y
    start = flow.state(l0)
    coarse, fine = errors(flow, start, exact[:, -1], lm.Isospectral(order), 1.0)
    assert order - 0.4 < np.log2(coarse / fine) < order + 0.7
    integrals = flow.integrals(exact.T)
    assert integrals.shape[1] == sum(len(range(2, k, 2)) for k in range(2, n + 1))
    assert np.ptp(integrals, axis=0).max() < 1e-10 and np.abs(integrals).max() > 0.1
    turned = lm.integrate(flow, lm.RKMK(order=4), flow.state(l0, np.eye(n)), h=0.05, steps=4)
    assert turned.drift()["spatial momentum"].verdict == "exact"


@pytest.mark.parametrize("n", [3, 10])
def test_density_matrices_beside_the_exponential(n: int) -> None:
    rng = np.random.default_rng(3)
    a = rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n))
    h = (a + a.conj().T) / n
    b = rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n))
    rho = b @ b.conj().T / np.trace(b @ b.conj().T)
    levels = lm.models.VonNeumann(h, hbar=0.7)
    start = levels.of_density(rho, np.eye(n))
    assert levels.energy(start.mu) == pytest.approx(np.trace(rho @ h).real / 0.7, rel=1e-13)
    u = expm(-1j * h / 0.7)
    exact = u @ rho @ u.conj().T
    assert np.abs(levels.exact(start, 1.0) - exact).max() < 1e-13
    run = lm.integrate(levels, lm.RKMK(order=4), start, h=0.1, steps=10, compiled=False)
    assert np.abs(levels.density(run.mu[-1]) - exact).max() < 1e-13  # whose velocity is constant
    assert np.abs(run.g[-1] - u.conj().T).max() < 1e-13
    found = []
    for steps in (8, 16):
        run = lm.integrate(levels, lm.Isospectral(4), start, h=1.0 / steps, steps=steps, compiled=False)
        found.append(np.abs(levels.density(run.mu[-1]) - exact).max())
        assert np.ptp(levels.populations(run.mu), axis=0).max() < 5e-15
    assert 3.6 < np.log2(found[0] / found[1]) < 4.6
    assert run.drift()["energy"].verdict == "exact"  # linear


NAMED: list[tuple[Any, str]] = [
    (lambda: lm.models.TodaFlow(1), r"smallest is TodaFlow\(2\)"),
    (lambda: lm.models.TodaFlow(3).state(np.eye(2)), r"shape \(2, 2\).*\(3, 3\)"),
    (lambda: lm.models.TodaFlow(2).state([[1.0, 2.0], [0.0, 1.0]]), r"not symmetric: entry \(0, 1\)"),
    (lambda: lm.models.TodaFlow(2).state([[1.0, np.nan], [np.nan, 1.0]]), "nan|finite"),
    (lambda: lm.models.BlochIserles(np.eye(3)), r"N\^T = -N; \[0, 0\] is 1"),
    (lambda: lm.models.BlochIserles(np.zeros((2, 3))), r"shape \(2, 3\)"),
    (lambda: lm.models.VonNeumann([[1.0, 1j], [1j, 1.0]]), "energies must be hermitian"),
    (lambda: lm.models.VonNeumann([1.0, 2.0], hbar=0.0), "hbar must be a positive number; got 0.0"),
    (lambda: lm.models.VonNeumann([1.0, 2.0]).of_density(np.eye(2)), "trace of rho is 2"),
    (lambda: lm.models.VonNeumann([1.0, 2.0]).of_density([[0.5, 1.0], [0.0, 0.5]]), "hermitian"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "words"), NAMED, ids=range(len(NAMED)))
def test_wrong_input_is_named(make: Any, words: str) -> None:
    with pytest.raises(lm.errors.LiemechError, match=words):
        make()
