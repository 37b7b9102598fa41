"""Masses and rigid bodies that attract each other: against Kepler's motion, SciPy and NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput
from liemech.models import GravitatingBodies, MutualGravity, NBody

SPLITTINGS = lm.StormerVerlet(), lm.Splitting(order=4), lm.Splitting(order=6)


def cloud(n: int, dimension: int = 3) -> tuple[Any, Any]:
    """Masses and their start: far enough from each other, and bound."""
    rng = np.random.default_rng(n)
    system = NBody(rng.uniform(0.5, 1.5, n) / n, gravity=1.3, dimension=dimension)
    q = rng.normal(size=(n, dimension)) + 2.0 * np.linspace(-1.0, 1.0, n)[:, None]
    v = 0.2 * rng.normal(size=(n, dimension))
    return system, system.state(q.ravel(), (np.array(system.masses)[:, None] * v).ravel())


def pulls(m: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Of all on each, G = 1.3."""
    apart = q[None] - q[:, None]
    cubes = np.sum(apart**2, axis=-1) ** 1.5 + np.eye(len(m))
    return np.asarray(1.3 * m[:, None] * np.einsum("j,ijk->ik", m, apart / cubes[..., None]))


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_leapfrog_is_the_one_written_in_numpy(dimension: int) -> None:
    system, start = cloud(40, dimension)
    h, m = 0.01, np.array(system.masses)
    run = lm.integrate(system, lm.StormerVerlet(), start, h=h, steps=10, every=5)
    q, p = (np.array(x).reshape(-1, dimension) for x in (start.q, start.p))
    for _ in range(10):
        p = p + 0.5 * h * pulls(m, q)
        q = q + h * p / m[:, None]
        p = p + 0.5 * h * pulls(m, q)
    assert run.q.shape == (3, 40 * dimension)
    assert np.abs(run.q[-1] - q.ravel()).max() < 1e-13
    assert np.abs(run.p[-1] - p.ravel()).max() < 1e-13


@pytest.mark.parametrize("n", [101, 130, 600])
def test_workers_share_all_pairs(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    if lm.compiler.kernel.available() is not None:
        pytest.skip("needs llvmlite")
    monkeypatch.setattr("liemech.compiler.sites.site_calls.PAIRS", 64)  # blocks of one, two or three eights
    system, start = cloud(n)
    one, *more = [
        lm.integrate(system, lm.StormerVerlet(), start, h=0.01, steps=3, compiled=True, workers=w) for w in (1, 2, 3, 8)
    ]
    assert all(np.array_equal(x.q, one.q) and np.array_equal(x.p, one.p) for x in more)


@pytest.mark.parametrize("method", SPLITTINGS, ids=repr)
def test_by_sites_is_as_written_out(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    system, start = cloud(9)
    found = []
    for small in (0, 100):
        monkeypatch.setattr(NBody, "small", small)
        plan = lm.Plan(NBody(system.masses, 1.3), method, h=0.02, compiled=False)
        found.append(plan.run(start, steps=5))
    a, b = found
    assert np.abs(a.q - b.q).max() < 1e-13 and np.abs(a.energy - b.energy).max() < 1e-14


@pytest.mark.slow
def test_runs_have_the_bits_of_plain_python_and_go_on(tmp_path: Path) -> None:
    system, start = cloud(9)
    plan = lm.Plan(system, lm.Splitting(order=4), h=0.02)
    whole = plan.run(start, steps=6)
    plain = lm.integrate(system, lm.Splitting(order=4), start, h=0.02, steps=6, compiled=False)
    assert np.array_equal(whole.q, plain.q) and np.array_equal(whole.p, plain.p)
    plan.run(start, steps=2).save(tmp_path / "first.npz")
    rest = plan.resume(lm.Trajectory.load(tmp_path / "first.npz"), steps=4)
    assert np.array_equal(rest.q[-1], whole.q[-1])
    again = lm.integrate(system, lm.Splitting(order=4), whole.last, h=0.02, steps=1)
    assert np.array_equal(again.q[0], whole.q[-1])


def test_momentum_and_angular_momentum_stay_to_rounding() -> None:
    system, start = cloud(50)
    run = lm.integrate(system, lm.StormerVerlet(), start, h=0.005, steps=1000, every=100)
    q, p = (x.reshape(len(x), 50, 3) for x in (run.q, run.p))
    for kept in (p.sum(axis=1), np.cross(q, p).sum(axis=1)):
        assert np.abs(kept - kept[0]).max() < 1e-13
    assert np.allclose(run.energy, system.energy(run.q, run.p), rtol=1e-13)
    assert {line.name for line in run.drift().kept} == {"energy", "momentum", "angular momentum"}


@pytest.mark.slow
def test_nine_masses_move_as_scipy_says() -> None:
    from scipy.integrate import solve_ivp

    system, m = NBody(np.linspace(0.5, 1.5, 9), 1.3), np.linspace(0.5, 1.5, 9)
    grid = np.stack(np.meshgrid([-1.5, 0.0, 1.5], [-1.5, 0.0, 1.5]), axis=-1).reshape(9, 2)
    q = np.column_stack([grid, 0.3 * np.arange(9)])
    start = system.state(q.ravel(), 0.3 * np.roll(q, 1, axis=1).ravel())

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q, p = y.reshape(2, 9, 3)
        return np.concatenate([(p / m[:, None]).ravel(), pulls(m, q).ravel()])

    y = np.concatenate([start.q, start.p])
    exact = solve_ivp(rate, (0.0, 1.0), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:27, -1]
    errors = [
        np.abs(lm.integrate(system, lm.Splitting(order=4), start, h=1.0 / n, steps=n, every=n).q[-1] - exact).max()
        for n in (60, 120)
    ]
    assert errors[1] < 1e-8 and errors[0] > 12.0 * errors[1]


def test_a_chain_of_springs_is_as_written_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """For both ends of an asymmetric spring, and both walls."""
    found = []
    for small in (0, 100):
        monkeypatch.setattr(lm.models.FermiPastaUlam, "small", small)
        chain = lm.models.FermiPastaUlam(9, alpha=0.25, beta=0.1)
        start = chain.state(np.sin(np.arange(9.0)), np.cos(np.arange(9.0) ** 2))
        plan = lm.Plan(chain, lm.StormerVerlet(), h=0.1, compiled=False)
        found.append(plan.run(start, steps=20))
    a, b = found
    assert np.abs(a.q - b.q).max() < 1e-14 and np.allclose(a.energy, b.energy, rtol=1e-14)


# ------------------------------------------------------------------ rigid bodies


@pytest.mark.slow
def test_spheres_go_round_as_kepler_says() -> None:
    a, m = 2.0, np.array([1.0, 0.3])
    system = GravitatingBodies(m, 0.01 * np.ones((2, 3)), gravity=1.0)
    share = np.array([[-m[1]], [m[0]]]) / m.sum()
    speed, period = np.sqrt(m.sum() / a * 1.3 / 0.7), 2.0 * np.pi * np.sqrt(a**3 / m.sum())
    start = system.state_of(  # e = 0.3, nearest
        share * [0.7 * a, 0.0, 0.0], share * [0.0, speed, 0.0], [np.eye(3)] * 2, np.zeros((2, 3))
    )
    # spheres add a term (tr J - 3 J) = 0: the orbit closes
    run = lm.integrate(system, lm.KickDrift(order=4), start, h=period / 800, steps=800, every=200)
    places = run.g[..., 9:]
    assert np.abs(places[-1] - places[0]).max() < 1e-9
    assert np.abs(places[2] - share * [-1.3 * a, 0.0, 0.0]).max() < 1e-9


def some_bodies() -> tuple[Any, np.ndarray]:
    rng = np.random.default_rng(4)
    J = np.array([[1.0, 1.5, 2.0], [0.3, 0.4, 0.5], [0.2, 0.2, 0.3]])
    system = GravitatingBodies([2.0, 0.7, 0.4], J, gravity=0.9)
    x = np.array([[0.0, 0.0, 0.0], [4.0, 1.0, 0.5], [-2.0, 3.0, 4.0]])
    return system, np.column_stack([lm.SO3().random(rng, 3).reshape(3, 9), x])


def test_the_mutual_potential_is_that_of_masses_that_are_small_beside_their_distance() -> None:
    """Bodies of six masses on their axes, with the moments that they have: the rest falls with the
    fifth power of the distance, that is with the fourth of size over distance.
    """
    rng = np.random.default_rng(2)
    R = lm.SO3().random(rng, 2)
    sizes = np.array([[0.3, 0.2, 0.1], [0.15, 0.25, 0.2]])
    arms = np.stack([s[:, None] * np.eye(3) for s in sizes])
    points = np.concatenate([arms, -arms], axis=1)  # six of a sixth of the mass each
    squares = sizes**2 / 3.0
    J = squares.sum(axis=1, keepdims=True) - squares
    m, u = np.array([1.2, 0.8]), np.array([0.6, 0.0, 0.8])
    system, left = GravitatingBodies(m, m[:, None] * J, gravity=1.0), []
    for r in (4.0, 8.0):
        x = np.array([0.0 * u, r * u])
        masses = np.einsum("nij,nkj->nki", R, points) + x[:, None]
        apart = np.linalg.norm(masses[0][:, None] - masses[1][None], axis=-1)
        exact = -(m.prod() / 36.0 / apart).sum()
        g = np.column_stack([R.reshape(2, 9), x])
        left.append(abs(system.energy(np.zeros((2, 6)), g) - exact))
    assert 25.0 < left[0] / left[1] < 40.0 and left[0] < 1e-4


def test_force_and_torque_are_the_slope_of_the_energy() -> None:
    system, g = some_bodies()
    one, rest = lm.ProductGroup(lm.SO3(), lm.VectorSpace(3)), np.zeros((3, 6))
    found = np.asarray(system.force(g)).reshape(3, 6)
    h = 1e-4
    for i in range(3):
        for k in range(6):
            energies = []
            for s in (-h, h):
                moved = g.copy()
                moved[i] = one.compose_exp(g[i], s * np.eye(6)[k])
                energies.append(system.energy(rest, moved))
            assert abs((energies[0] - energies[1]) / (2.0 * h) - found[i, k]) < 1e-7


def test_on_se3_it_is_the_same() -> None:
    system, g = some_bodies()
    R, x = g[:, :9].reshape(3, 3, 3), g[:, 9:]
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = R, x
    m, J = np.array(system.masses), np.array(system.inertias)
    one = lm.KineticEnergy(lm.each(np.column_stack([J, m, m, m])))
    terms = lm.Terms(MutualGravity(0.9).over(lm.neighbours.all_pairs()), mass=lm.each(m), inertia=lm.each(J))
    same = lm.MechanicalSystem(lm.LiePoissonSystem(lm.SE3() ** 3, lm.PerSite(one)), terms)
    assert np.isclose(same.energy(np.zeros((3, 6)), poses), system.energy(np.zeros((3, 6)), g))
    a = np.asarray(same.force(poses)).reshape(3, 6)
    b = np.asarray(system.force(g)).reshape(3, 6)
    assert np.allclose(a[:, :3], b[:, :3], rtol=1e-12, atol=1e-14)
    assert np.allclose(np.einsum("nij,nj->ni", R, a[:, 3:]), b[:, 3:], rtol=1e-12, atol=1e-14)
    assert np.abs(b[:, 3:].sum(axis=0)).max() < 1e-15


@pytest.mark.slow
def test_the_binary_asteroid_keeps_what_it_should() -> None:
    system, start = GravitatingBodies.asteroid_1999_kw4(tilt=0.05, libration=0.1)
    run = lm.integrate(system, lm.KickDrift(order=4), start, h=600.0, steps=600, every=20)
    kept = system.constants(run.states)
    assert np.abs(kept["energy"] / kept["energy"][0] - 1.0).max() < 1e-9
    spin = kept["angular momentum"]
    assert np.abs(spin - spin[0]).max() < 1e-14 * np.abs(spin).max()
    assert np.abs(kept["momentum"]).max() < 1e-14 * np.abs(run.mu[..., 3:]).max()
    line = run.g[:, 1, 9:] - run.g[:, 0, 9:]
    assert np.abs(np.linalg.norm(line, axis=1) / 2548.0 - 1.0).max() < 0.02
    # 17.4 hours: the first time that it is back, by the angle of the line
    turned = np.unwrap(np.arctan2(line[:, 1], line[:, 0]))
    assert abs(2.0 * np.pi * run.t[-1] / turned[-1] / 3600.0 - 17.42) < 0.3


def test_what_is_no_body_is_named() -> None:
    with pytest.raises(InvalidInput, match=r"inertias\[1\]"):
        GravitatingBodies([1.0, 1.0], [[1.0, 1.0, 1.0], [1.0, 1.0, 3.0]])
    with pytest.raises(InvalidInput, match="positive"):
        GravitatingBodies([1.0, 0.0], np.ones((2, 3)))
    with pytest.raises(InvalidInput, match="shapes"):
        GravitatingBodies([1.0, 2.0], np.ones((3, 3)))
    system, _ = some_bodies()
    with pytest.raises(InvalidInput, match="velocities"):
        system.state_of(np.zeros((3, 3)), np.zeros(3), [np.eye(3)] * 3, np.zeros((3, 3)))
