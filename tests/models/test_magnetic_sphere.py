"""Flow and magnetic field on the sphere as pairs of matrices: the equations, waves that move exactly, Casimirs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import liemech as lm

EDDIES = {(2, 1): 0.5, (3, -2): -0.4, (3, 3): 0.2, (4, 2): 0.3, (1, 0): 0.3, (1, -1): 0.1}
FIELD = {(1, 1): 0.2, (2, 1): 0.15, (2, 2): -0.1, (3, 0): 0.12, (4, -3): 0.1}
UNIT = np.sqrt(4.0 * np.pi / 3.0)
"""The coefficient of z, harmonic (1, 0)."""


def spins(n: int) -> tuple[np.ndarray, ...]:
    """S_x, S_y, S_z of spin (n - 1)/2."""
    j = np.arange(1, n)
    up = np.diag(np.sqrt(j * (n - j)).astype(complex), 1)
    return (up + up.T) / 2, (up - up.T) / 2j, np.diag((n - 1) / 2 - np.arange(n)).astype(complex)


def commutator(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a @ b - b @ a


def laplacian(f: np.ndarray) -> np.ndarray:
    """-sum_k [S_k, [S_k, F]]."""
    return -sum(commutator(s, commutator(s, f)) for s in spins(len(f)))


def fields(sphere: Any, mu: Any) -> np.ndarray:
    """The matrices F and A.  (..., 2, N, N)"""
    matrices = [sphere.sphere.matrix(x) for x in sphere.fields(mu)]
    return np.stack(matrices, axis=-3)


class Equations:
    """F' = ([F, Psi] + [A, J])/(i hbar), A' = [A, Psi]/(i hbar), by products of spin matrices."""

    def __init__(self, n: int) -> None:
        units = np.eye(n * n).reshape(-1, n, n)
        self.inverse = np.linalg.pinv(np.array([laplacian(e).ravel() for e in units]).T, rcond=1e-10)
        self.n, self.hbar = n, 2.0 / np.sqrt(n**2 - 1.0)

    def __call__(self, _: float, y: np.ndarray) -> np.ndarray:
        f, a = y.reshape(2, self.n, self.n)
        psi = (self.inverse @ f.ravel()).reshape(f.shape)
        rates = commutator(f, psi) + commutator(a, laplacian(a)), commutator(a, psi)
        return np.array(rates).ravel() / (1j * self.hbar)


def test_the_equations_are_those_of_the_brackets() -> None:
    sphere = lm.models.MagneticSphere(13)
    mu = np.array(sphere.from_harmonics(EDDIES, FIELD).mu)
    rate = sphere.group.ad_star(np.array(sphere.velocity(mu)), mu)
    expected = Equations(13)(0.0, fields(sphere, mu)).reshape(2, 13, 13)
    assert np.abs(expected).max(axis=(1, 2)).min() > 1e-3
    assert np.abs(fields(sphere, np.array(rate)) - expected).max() < 1e-13


def test_energy_and_helicity_by_harmonics() -> None:
    """int |grad psi|^2/2 = a^2/(2 l (l + 1)), int |grad A|^2/2 = l (l + 1) b^2/2 of each harmonic, int omega A = a b."""
    sphere = lm.models.MagneticSphere(14)
    mu = np.array(sphere.from_harmonics(EDDIES, FIELD).mu)
    energy = sum(a * a / (2.0 * l * (l + 1)) for (l, _), a in EDDIES.items())
    energy += sum(0.5 * l * (l + 1) * b * b for (l, _), b in FIELD.items())
    assert sphere.energy(mu) == pytest.approx(energy, rel=1e-13)
    helicity = sum(EDDIES.get(at, 0.0) * b for at, b in FIELD.items())
    assert sphere.cross_moments(mu)[0] == pytest.approx(helicity, rel=1e-13)
    potential = sphere.sphere.harmonics(sphere.fields(mu)[1])
    assert potential[2, 13 + 1] == pytest.approx(0.15, rel=1e-13) and potential[4, 13 - 3] == pytest.approx(
        0.1, rel=1e-13
    )


def test_a_flow_along_its_field_rests() -> None:
    """psi = A, whatever A, is an equilibrium: the field pulls as much as the flow carries away."""
    sphere = lm.models.MagneticSphere(13)
    mu = np.array(sphere.from_harmonics({(l, m): -l * (l + 1) * b for (l, m), b in FIELD.items()}, FIELD).mu)
    xi = np.array(sphere.velocity(mu))
    assert np.abs(sphere.group.ad_star(xi, mu)).max() < 1e-14 * np.abs(xi).max() * np.abs(mu).max()


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_an_alfven_wave_moves_exactly(order: int) -> None:
    """On the field of A = b z, waves a of one degree with psi = c a, c^2 = 1 - 2/(l (l + 1)), move to the east with
    b c, however high: {A, psi} = b c {z, a}, {z, a} = -da/dphi.
    """
    sphere, b, t, l = lm.models.MagneticSphere(13), 0.6, 0.8, 3
    c = np.sqrt(1.0 - 2.0 / (l * (l + 1)))

    def wave(turned: float) -> np.ndarray:
        a = {(l, m): s * np.cos(abs(m) * turned - at) for m, s, at in ((2, 0.5, 0.0), (1, 0.3, np.pi / 2))}
        a |= {(l, -m): s * np.sin(m * turned - at) for m, s, at in ((2, 0.5, 0.0), (1, 0.3, np.pi / 2))}
        vorticity = {at: -l * (l + 1) * c * x for at, x in a.items()}
        return np.array(sphere.from_harmonics(vorticity, a | {(1, 0): b * UNIT}).mu)

    errors = []
    for h in (0.1, 0.05):
        start = sphere.state(mu=wave(0.0))
        run = lm.integrate(sphere, lm.Isospectral(order), start, h=h, steps=round(t / h), compiled=False)
        errors.append(np.abs(run.mu[-1] - wave(b * c * t)).max())
    assert order - 0.3 < np.log2(errors[0] / errors[1]) < order + 0.3
    assert errors[1] < {2: 0.02, 4: 1e-3}[order] * np.abs(wave(b * c * t) - wave(0.0)).max()


@pytest.mark.slow
def test_order_beside_scipy() -> None:
    sphere, equations = lm.models.MagneticSphere(13), Equations(13)
    start = sphere.from_harmonics(EDDIES, FIELD)
    first = fields(sphere, np.array(start.mu)).astype(complex).ravel()
    exact = solve_ivp(equations, (0.0, 1.0), first, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    errors = []
    for h in (0.05, 0.025):
        run = lm.integrate(sphere, lm.Isospectral(2), start, h=h, steps=round(1.0 / h))
        errors.append(np.abs(fields(sphere, run.mu[-1]).ravel() - exact).max())
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1 and errors[1] < 0.01 * np.abs(exact - first).max()


@pytest.mark.slow
def test_all_casimirs_are_kept_to_rounding() -> None:
    """The spectrum of A, and tr F A^k; energy is bounded, angular momentum kept."""
    sphere = lm.models.MagneticSphere(16)
    start = sphere.from_harmonics(EDDIES, FIELD)
    run = lm.integrate(sphere, lm.Isospectral(2), start, h=0.05, steps=1000, every=10)
    assert np.abs(run.mu[-1] - run.mu[0]).max() > 0.1 * np.abs(run.mu[0]).max()
    a = fields(sphere, run.mu)[:, 1]
    levels = np.linalg.eigvalsh(a)
    assert np.abs(levels - levels[0]).max() < 1e-13 * np.abs(levels[0]).max()
    powers = tuple(range(1, 16))
    cross = sphere.cross_moments(run.mu, powers)
    size = np.abs(sphere.sphere.levels(sphere.fields(run.mu[0])[0])).max() * np.abs(levels).max() ** np.array(powers)
    assert (np.abs(cross - cross[0]) < 1e-13 * 4.0 * np.pi * size).all()
    assert np.abs(cross[0, :3]).min() > 1e-3
    turning = sphere.sphere.angular_momentum(sphere.fields(run.mu)[0])
    assert np.abs(turning - turning[0]).max() < 1e-13 * np.abs(turning[0]).max()
    energy = run.energy
    assert np.abs(energy - energy[0]).max() < 1e-3 * energy[0]
    drift = np.abs(energy[:50].mean() - energy[51:].mean())
    assert drift < 0.5 * np.ptp(energy)


@pytest.mark.slow
def test_without_a_field_it_is_the_ideal_flow() -> None:
    sphere = lm.models.MagneticSphere(13)
    ideal, start = sphere.sphere, sphere.from_harmonics(EDDIES, {})
    run = lm.integrate(sphere, lm.Isospectral(2), start, h=0.1, steps=5, compiled=False)
    flow = lm.integrate(ideal, lm.Isospectral(2), ideal.from_harmonics(EDDIES), h=0.1, steps=5, compiled=False)
    assert np.abs(sphere.fields(run.mu)[0] - flow.mu).max() < 2e-14 * np.abs(flow.mu).max()
    assert not sphere.fields(run.mu)[1].any()


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_a_step_is_a_poisson_map(order: int) -> None:
    """It keeps <mu, [xi, eta]> of the directions ad*_xi mu and ad*_eta mu along an orbit, by central differences."""
    sphere, rng, e = lm.models.MagneticSphere(13), np.random.default_rng(4), 1e-5
    group, mu = sphere.group, np.array(sphere.from_harmonics(EDDIES, FIELD).mu)
    bracket = lambda m, x, y: float(m @ np.array(group.algebra.bracket(x, y)))  # noqa: E731
    size = np.linalg.norm(mu)
    pair = rng.normal(size=(2, group.dim))
    moved = np.array([group.ad_star(x, mu) for x in pair])
    scale = size / np.linalg.norm(moved, axis=1)[:, None]
    pair, moved = scale * pair, scale * moved
    starts = [mu, *[mu + s * e * d for d in moved for s in (1.0, -1.0)]]
    ends = [lm.integrate(sphere, lm.Isospectral(order), sphere.state(mu=x), h=0.3, steps=1, compiled=False).mu[-1]
            for x in starts]  # fmt: skip
    end, images = ends[0], [(ends[1] - ends[2]) / (2.0 * e), (ends[3] - ends[4]) / (2.0 * e)]
    columns = np.array([group.ad_star(x, end) for x in np.eye(group.dim)]).T
    velocities = [np.linalg.lstsq(columns, x, rcond=1e-10)[0] for x in images]
    assert np.abs(columns @ np.array(velocities).T - np.array(images).T).max() < 1e-6 * size
    assert bracket(end, *velocities) == pytest.approx(bracket(mu, *pair), rel=1e-5)


@pytest.mark.slow
def test_elements_stay_on_the_group_and_native_code_has_the_same_bits() -> None:
    sphere, rng = lm.models.MagneticSphere(13), np.random.default_rng(2)
    g = sphere.group.exp(0.3 * rng.normal(size=sphere.group.dim))
    start = sphere.state(mu=sphere.from_harmonics(EDDIES, FIELD).mu, g=np.array(g))
    plain, native = (lm.integrate(sphere, lm.Isospectral(2), start, h=0.05, steps=5, compiled=c) for c in (False, True))
    assert native.compiled and np.array_equal(plain.mu, native.mu) and np.array_equal(plain.g, native.g)
    assert sphere.group.contains(native.g).all()
    spatial = np.array([sphere.spatial_momentum(m, x) for m, x in zip(native.mu, native.g)])
    assert np.abs(spatial - spatial[0]).max() < 1e-13 * np.abs(spatial[0]).max()


def test_casimirs_are_traces_over_the_dual_numbers() -> None:
    """tr (L + eps K)^k = tr L^k + eps k tr K L^(k-1), L = -i Theta, K = -i W; the neighbours of elements."""
    sphere, rng = lm.models.MagneticSphere(13), np.random.default_rng(3)
    mu = rng.normal(size=sphere.group.dim)
    m = sphere.group.generated.covector(mu)
    l, k = -1j * m[:13, 13:], -1j * (m[:13, :13] + m[13:, 13:])
    powers = [np.linalg.matrix_power(l, j) for j in range(14)]
    expected = [np.trace(p).real for p in powers[1:]] + [np.trace(k @ p).real for p in powers[:13]]
    assert np.abs(np.array(sphere.casimirs(mu)) / expected - 1.0).max() < 1e-10
    g = np.array(sphere.group.exp(0.1 * mu))
    assert sphere.group.contains(g) and np.abs(np.array(sphere.group.nearest(g)) - g).max() < 1e-13
    assert not sphere.group.contains(g + 1e-6 * np.eye(26))


def test_wrong_input_is_named() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"Sphere\(5\).*13"):
        lm.models.MagneticSphere(5)
    sphere = lm.models.MagneticSphere(13)
    with pytest.raises(lm.errors.InvalidInput, match=r"l goes from 1 to N - 1 = 12"):
        sphere.from_harmonics(EDDIES, {(13, 0): 1.0})
    with pytest.raises(lm.errors.InvalidInput, match="168"):
        sphere.fields(np.ones(168))
