"""The group of rigid motions of space against reference numbers made without closed forms, and bodies that move on it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scenes import hat, kirchhoff_body, rotation

import liemech as lm
from liemech.groups.rigid.se3 import SE3
from liemech.systems.kinetic_energy import KineticEnergy

G, R3 = SE3(), lm.SO3()
EPS = np.finfo(float).eps
REFERENCE = Path(__file__).parent.parent / "reference"
MAPS = json.loads((REFERENCE / "lie_maps_se3.json").read_text())["SE3"]
KIRCHHOFF = json.loads((REFERENCE / "kirchhoff_se3.json").read_text())
UNITS = np.eye(6)


def exact(value: object) -> np.ndarray:
    """Strings of 20 digits, rounded to double."""
    return np.array(value, dtype=object).astype(float)


def columns(f: object, *first: np.ndarray) -> np.ndarray:
    return np.stack([f(*first, unit) for unit in UNITS], axis=-1)  # type: ignore[operator]


def scaled(value: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.abs(value - wanted).max() / max(1.0, np.abs(wanted).max()))


def motion(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    g = np.eye(4)
    g[:3, :3], g[:3, 3] = R, p
    return g


# ---------------------------------------------------------------- reference numbers


@pytest.mark.parametrize("reference", MAPS, ids=[m["label"] for m in MAPS])
def test_maps_and_differentials_have_the_reference_values(reference: dict) -> None:
    xi = exact(reference["xi_omega_v"])
    assert scaled(G.exp(xi), exact(reference["exp"])) < 4 * EPS
    assert scaled(G.cayley(xi), exact(reference["cay4x4"])) < 4 * EPS
    assert scaled(G.by_adjoint.cayley(xi), exact(reference["cay6x6_as_4x4"])) < 4 * EPS
    assert scaled(columns(G.Ad, G.exp(xi)), exact(reference["Ad_of_exp"])) < 8 * EPS
    for name, f, dual in (
        ("dexpR", G.algebra.dexp, G.algebra.dexp_dual),
        ("dexpinvR", G.algebra.dexp_inv, G.algebra.dexp_inv_dual),
        ("dcayinvR_4x4", G.algebra.dcayley_inv, G.algebra.dcayley_inv_dual),
    ):
        matrix = exact(reference[name])
        # next to 2 pi the rounding of xi itself is magnified by 1/(2 pi - theta)
        for value in columns(f, -xi), columns(dual, -xi).T:  # right-trivialised
            assert scaled(value, matrix) < 32 * EPS


def test_pure_translations_are_vectors(rng: np.random.Generator) -> None:
    for v, u in rng.normal(size=(10, 2, 3)):
        xi = np.r_[np.zeros(3), v]
        for tau in (G.exp, G.cayley, G.by_adjoint.cayley):
            assert np.array_equal(tau(xi), motion(np.eye(3), v))
        assert np.array_equal(G.log(motion(np.eye(3), v)), xi)
        assert np.array_equal(G.compose_exp(motion(np.eye(3), u), xi), motion(np.eye(3), u + v))


def test_a_point_is_turned_then_displaced(rng: np.random.Generator) -> None:
    """x_space = R x_body + p, and a body velocity (w, v) moves it by R (w x x + v)."""
    g, xi, x = G.random(rng), rng.normal(size=6), rng.normal(size=3)
    rate = (G.compose_exp(g, 1e-6 * xi) - G.compose_exp(g, -1e-6 * xi)) / 2e-6 @ np.r_[x, 1.0]
    assert np.abs(rate[:3] - g[:3, :3] @ (np.cross(xi[:3], x) + xi[3:])).max() < 1e-9


def test_the_two_cayley_maps_agree_to_third_order(rng: np.random.Generator) -> None:
    """The displacements differ by w (w.v)/(4 + |w|^2)."""
    xi = rng.normal(size=6)
    w, v = xi[:3], xi[3:]
    difference = G.cayley(xi)[:3, 3] - G.by_adjoint.cayley(xi)[:3, 3]
    assert np.abs(difference - w * (w @ v) / (4 + w @ w)).max() < 4 * EPS


# ---------------------------------------------------------------- accuracy, against many digits


def mp_motion(w: list, v: list) -> tuple[mp.matrix, mp.matrix]:
    """exp(w) and dexp_w v; call with twice as many digits as |w| has."""
    x = mp.fsum(c * c for c in w)
    t, W = mp.sqrt(x), mp.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    R = mp.eye(3) + mp.sin(t) / t * W + (1 - mp.cos(t)) / x * W * W
    return R, (mp.eye(3) + (1 - mp.cos(t)) / x * W + (t - mp.sin(t)) / (x * t) * W * W) * mp.matrix(v)


def off(values: np.ndarray, wanted: mp.matrix) -> float:
    return float(max(abs(mp.mpf(float(a)) - b) for a, b in zip(values.ravel(), wanted, strict=True))) / EPS


@pytest.mark.sample(4)
@pytest.mark.parametrize("size", [1e-8, 0.3, 0.63, 0.64, 2.0, math.pi, 6.28, 1e2, 1e5, 1e8])
def test_accuracy_of_the_exponential(size: float) -> None:
    """Every entry of the rotation to 4 eps, the displacement to 4 eps of |v|."""
    rng = np.random.default_rng(int(1000 * size) if size < 1e3 else 1)
    for w, v in rng.normal(size=(20, 2, 3)):
        w = w * (size / np.linalg.norm(w))
        with mp.workdps(60):
            R, p = mp_motion([mp.mpf(c) for c in w.tolist()], [mp.mpf(c) for c in v.tolist()])
            g = G.exp(np.r_[w, v])
            assert off(g[:3, :3], R) < 4.0
            assert off(g[:3, 3], p) < 4.0 * np.linalg.norm(v)


@pytest.mark.sample(3)
@pytest.mark.parametrize("gap", [math.pi - 1e-9, math.pi - 0.5, 1.0, 0.1, 1e-4, 1e-9, 1e-13])
def test_accuracy_of_the_logarithm(gap: float) -> None:
    """3 eps of |w| and of |v| for every angle up to pi - 1e-13: the matrix is rounded from the exact one."""
    rng = np.random.default_rng(7)
    for n, v in rng.normal(size=(30, 2, 3)):
        with mp.workdps(60):
            length = mp.norm(mp.matrix(n.tolist()))
            w = [mp.mpf(c) * (mp.pi - mp.mpf(gap)) / length for c in n.tolist()]
            R, p = mp_motion(w, [mp.mpf(c) for c in v.tolist()])
            xi = G.log(motion(np.array(R.tolist(), dtype=float), np.array(p.tolist(), dtype=float).ravel()))
            assert off(xi[:3], mp.matrix(w)) < 3.0 * (math.pi - gap)
            assert off(xi[3:], mp.matrix(v.tolist())) < 3.0 * np.linalg.norm(v)


@pytest.mark.parametrize("size", [1e-8, 3.0, 1e3, 1e8, 1e100, 1e150])
def test_cayley_of_any_size(size: float) -> None:
    rng = np.random.default_rng(8)
    for w, v in rng.normal(size=(10, 2, 3)):
        w = w * (size / np.linalg.norm(w))
        with mp.workdps(700):
            W, one = mp.matrix(hat(w).tolist()) / 2, mp.eye(3)
            f = 4 / (4 + mp.fsum(mp.mpf(c) ** 2 for c in w.tolist()))
            v_ = mp.matrix(v.tolist())
            # of 1 - W
            inverse = f * (one + W + mp.matrix(w.tolist()) * mp.matrix(w.tolist()).T / 4)
            g, h = G.cayley(np.r_[w, v]), G.by_adjoint.cayley(np.r_[w, v])
            assert off(g[:3, :3], inverse * (one + W)) < 4.0
            assert off(g[:3, 3], inverse * v_) < 4.0 * np.linalg.norm(v)
            assert off(h[:3, 3], f * (v_ + W * v_)) < 4.0 * np.linalg.norm(v)


def test_identity_and_tiny_screws() -> None:
    assert np.array_equal(G.log(np.eye(4)), np.zeros(6))
    for size in (0.0, 5e-324, 1e-320, 1e-200, 1e-20):
        xi = size * np.array([1.0, -2.0, 3.0, 1.0, 1.0, -1.0])
        assert np.array_equal(G.exp(xi), np.eye(4) + G.algebra.hat(xi))


# ---------------------------------------------------------------- membership, SciPy


def test_membership_names_the_law(rng: np.random.Generator) -> None:
    g = motion(rotation(rng), 1e300 * rng.normal(size=3))
    assert G.contains(g)
    for broken, words in (
        (motion(np.diag([1.0, 1.0, -1.0]), np.zeros(3)), "reflection"),
        (motion(2 * np.eye(3), np.zeros(3)), r"g\^T g differs from the unit matrix by 3"),
        (g + np.diag([0, 0, 0, 1e-3]), "last row is .*, not 0 0 0 1"),
        (np.vstack([g[:3], [0, 0, 1e-3, 1]]), "last row"),
        (g.T, "last row"),
    ):
        assert not G.contains(broken)
        with pytest.raises(lm.errors.InvalidInput, match=words):
            G.inverse(broken)


def test_nearest_and_random(rng: np.random.Generator) -> None:
    many = G.random(rng, (200,))
    assert many.shape == (200, 4, 4)
    assert G.contains(many).all()
    assert np.abs(many[:, :3].mean(axis=0)).max() < 0.3
    assert np.array_equal(G.random(5), G.random(5))
    noisy = many[0] + 1e-3 * rng.normal(size=(4, 4))
    near = G.nearest(noisy)
    assert G.contains(near)
    assert np.abs(near - many[0]).max() < 1e-2
    assert np.array_equal(near[:3, 3], noisy[:3, 3])


def test_rigid_transforms_of_scipy(rng: np.random.Generator) -> None:
    transform = pytest.importorskip("scipy.spatial.transform")
    if not hasattr(transform, "RigidTransform"):
        with pytest.raises(ImportError, match=r"1\.16"):
            G.rigid_transform(np.eye(4))
        pytest.skip("SciPy before 1.16")
    g, xi = G.random(rng, 3), rng.normal(size=6)
    assert np.allclose(G.rigid_transform(g).as_matrix(), g, atol=4 * EPS)
    ours = transform.RigidTransform.from_exp_coords(xi)  # (omega, v), as here
    assert np.abs(ours.as_matrix() - G.exp(xi)).max() < 16 * EPS
    assert np.abs(G.Ad(ours, xi) - xi).max() < 16 * EPS


# ---------------------------------------------------------------- bodies that move


def test_energy_casimirs_and_spatial_momentum_of_the_reference() -> None:
    system, start, _ = kirchhoff_body()
    mu, g = np.array(start.mu), np.array(start.g)
    assert system.energy(mu) == pytest.approx(float(KIRCHHOFF["energy"]), rel=8 * EPS)
    assert scaled(system.casimirs(mu), exact([KIRCHHOFF["casimir_P_dot_P"], KIRCHHOFF["casimir_Pi_dot_P"]])) < 4 * EPS
    spatial = np.r_[exact(KIRCHHOFF["spatial_angular_momentum"]), exact(KIRCHHOFF["spatial_linear_momentum"])]
    assert scaled(system.spatial_momentum(mu, g), spatial) < 4 * EPS


@pytest.mark.compiled
@pytest.mark.parametrize("group", [R3, G], ids=lambda g: type(g).__name__)
def test_a_stage_beyond_a_whole_turn_ends_the_run_in_both_worlds(group: lm.LieGroup) -> None:
    """The closed dexp^-1 says so instead of returning 1e16; what was reached before is kept."""
    system = lm.LiePoissonSystem(group, KineticEnergy(np.linspace(1.0, 3.0, group.dim)))
    start = system.state(3.0 * np.ones(group.dim), np.array(group.identity()))
    for compiled in (False, True):
        with pytest.raises(lm.errors.OutsideChart, match="singular at a full turn") as caught:
            lm.integrate(system, lm.RKMK(order=4, truncation="closed"), start, h=5.0, steps=100, compiled=compiled)
        assert caught.value.trajectory is not None
        assert np.isfinite(caught.value.trajectory.mu).all()


@pytest.mark.parametrize("size", [0.0, 1e-6, 0.3, 2.0, 5.0])
def test_blocks_of_dexp_are_those_of_its_matrix_and_of_its_dual(size: float) -> None:
    """dexp_xi = [[a, 0], [b, a]] and (dexp_-xi)* = [[a, b], [0, a]]."""
    xi = np.array([0.3, -0.7, 0.6, 1.0, 2.0, -0.7]) * size
    a, b = (np.array(m) for m in G.algebra.dexp_blocks(lm.formulas.vec(*xi.tolist())))
    whole = np.transpose([G.algebra.dexp(xi, unit) for unit in UNITS])
    dual = np.transpose([G.algebra.dexp_dual(-xi, unit) for unit in UNITS])
    scale = 1.0 + size
    assert np.abs(whole - np.block([[a, np.zeros((3, 3))], [b, a]])).max() < 4e-15 * scale
    assert np.abs(dual - np.block([[a, b], [np.zeros((3, 3)), a]])).max() < 4e-15 * scale
