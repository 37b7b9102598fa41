"""The rotation group against reference numbers made without closed forms, and against its conventions written out."""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scenes import hat, quiet_body, rotation
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.errors import InvalidInput

G = lm.SO3()
EPS = np.finfo(float).eps
MAPS = json.loads((Path(__file__).parent.parent / "reference" / "lie_maps.json").read_text())["SO3"]
UNITS = np.eye(3)


def exact(value: object) -> np.ndarray:
    """Strings of 36 digits, rounded to double."""
    return np.array(value, dtype=object).astype(float)


def columns(f: object, xi: np.ndarray) -> np.ndarray:
    """The matrix of a linear map eta -> f(xi, eta)."""
    return np.stack([f(xi, unit) for unit in UNITS], axis=-1)  # type: ignore[operator]


@pytest.fixture(params=MAPS, ids=[m["label"] for m in MAPS])
def reference(request: pytest.FixtureRequest) -> dict:
    return request.param


def scaled(value: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.abs(value - wanted).max() / max(1.0, np.abs(wanted).max()))


# ---------------------------------------------------------------- reference numbers


def test_maps_and_differentials_have_the_reference_values(reference: dict) -> None:
    w = exact(reference["omega"])
    algebra = G.algebra
    left = {"dexpR": algebra.dexp, "dexpinvR": algebra.dexp_inv, "dcayinvR": algebra.dcayley_inv}
    assert scaled(G.exp(w), exact(reference["exp"])) < 1e-15 * max(1.0, float(reference["theta"]))
    assert scaled(G.cayley(w), exact(reference["cay"])) < 1e-15
    for name, f in left.items():
        matrix = exact(reference[name])
        # next to 2 pi the rounding of w itself is magnified by 1/(2 pi - theta)
        assert scaled(columns(f, -w), matrix) < 1e-14  # right-trivialised


def test_duals_are_the_transposes_of_the_reference(reference: dict) -> None:
    w = exact(reference["omega"])
    assert scaled(columns(G.algebra.dexp_inv_dual, -w), exact(reference["dexpinvR"]).T) < 1e-14
    assert scaled(columns(G.algebra.dcayley_inv_dual, -w), exact(reference["dcayinvR"]).T) < 1e-14


def test_logarithm_of_the_reference_exponential(reference: dict) -> None:
    wanted = exact(reference["log_of_exp"])
    if float(reference["theta"]) > math.pi - 1e-9:
        R = G.exp(exact(reference["omega"]))
        assert np.abs(G.exp(G.log(R)) - R).max() < 8 * EPS
    else:
        assert np.abs(G.log(exact(reference["exp"])) - wanted).max() < 4 * EPS * max(1.0, np.abs(wanted).max())


# ---------------------------------------------------------------- conventions


def test_hat_is_the_vector_product(rng: np.random.Generator) -> None:
    w, x = rng.normal(size=(2, 3))
    assert np.array_equal(G.algebra.hat(w), hat(w))
    assert np.allclose(G.algebra.hat(w) @ x, np.cross(w, x), atol=4 * EPS)
    assert np.array_equal(G.algebra.vee(G.algebra.hat(w)), w)


def test_exponential_turns_counterclockwise() -> None:
    """A quarter turn about e3 takes e1 to e2: g maps body to space."""
    g = G.exp(np.array([0.0, 0.0, np.pi / 2]))
    assert np.allclose(g @ UNITS[0], UNITS[1], atol=EPS)


def test_actions_of_a_rotation(rng: np.random.Generator) -> None:
    R, w, mu = rotation(rng), *rng.normal(size=(2, 3))
    assert np.allclose(G.Ad(R, w), R @ w, atol=8 * EPS)
    assert np.allclose(G.Ad_star(R, mu), R.T @ mu, atol=8 * EPS)
    assert np.allclose(G.K(R, mu), R @ mu, atol=8 * EPS)
    assert np.allclose(G.ad_star(w, mu), np.cross(mu, w), atol=8 * EPS)
    assert np.array_equal(G.algebra.poisson_structure(mu), hat(mu))
    assert G.casimirs(mu)[0] == pytest.approx(mu @ mu, rel=4 * EPS)


def test_the_matrix_of_the_articles_momentum_equation(rng: np.random.Generator) -> None:
    """(3) as printed, entry by entry: it is -hat(J^-1 pi), and its product with pi the velocity of a free body."""
    J, pi = np.array([2 / 3, 1.0, 2.0]), rng.normal(size=3)
    x, y, z = pi / J
    A = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    body = quiet_body(J)
    assert np.allclose(A, -hat(np.array(body.velocity(pi))), rtol=1e-15, atol=0.0)
    assert np.allclose(A @ pi, G.ad_star(body.velocity(pi), pi), atol=8 * EPS)


def test_exponential_of_tiny_vectors_is_one_plus_hat() -> None:
    for size in (5e-324, 1e-320, 1e-200, 1e-20):
        w = size * np.array([1.0, -2.0, 3.0])
        assert np.array_equal(G.exp(w), np.eye(3) + hat(w))
    assert np.array_equal(G.exp(np.zeros(3)), np.eye(3))
    assert np.array_equal(G.log(np.eye(3)), np.zeros(3))


@pytest.mark.parametrize("size", [0.62, 0.64, 3.0, 1e2, 1e4, 1e6, 1e8, 1e12])
def test_exponential_of_many_turns(size: float, rng: np.random.Generator) -> None:
    """|w|^2 is rounded, which would turn by up to eps |w|; what is lost is put back."""
    for w in size * rng.normal(size=(5, 3)):
        with mp.workdps(60):
            theta = mp.sqrt(mp.fsum(mp.mpf(float(x)) ** 2 for x in w))
            W = mp.matrix(hat(w).tolist())
            R = mp.eye(3) + mp.sin(theta) / theta * W + (1 - mp.cos(theta)) / theta**2 * W * W
            wanted = np.array(R.tolist(), dtype=float)
        assert np.abs(G.exp(w) - wanted).max() < 4 * EPS
        mu = rng.normal(size=3)
        assert np.abs(G.exp_Ad_star(w, mu) - wanted.T @ mu).max() < 12 * EPS


@pytest.mark.parametrize("size", [1e50, 1e150])
def test_exponential_of_more_than_a_double_can_tell_is_a_rotation(size: float, rng: np.random.Generator) -> None:
    assert G.contains(G.exp(size * rng.normal(size=(20, 3)))).all()
    with pytest.raises(lm.errors.InvalidInput, match="no finite value"):
        G.exp(np.array([1e200, 0.0, 0.0]))


@pytest.mark.parametrize("size", [1e100, 1e150, 1e160, 1e300])
def test_cayley_of_anything_finite_is_a_rotation(size: float, rng: np.random.Generator) -> None:
    """Squares overflow, the map does not: far out it is half a turn, 2 n n^T - 1."""
    for w in size * rng.normal(size=(10, 3)):
        n = w / np.abs(w).max()
        n = n / np.linalg.norm(n)
        assert np.abs(G.cayley(w) - (2 * np.outer(n, n) - np.eye(3))).max() < 8 * EPS
        assert np.abs(G.compose_cayley(np.eye(3), w) - G.cayley(w)).max() < 2 * EPS


@pytest.mark.parametrize("size", [1e-12, 1e-6, 0.3, 2.0, 10.0, 1e3, 1e8])
def test_cayley_and_its_inverse(size: float, rng: np.random.Generator) -> None:
    """A rotation about w by 2 atan(|w|/2); (1 - W/2) cay(w) = 1 + W/2."""
    for w in rng.normal(size=(10, 3)):
        w = w * (size / np.linalg.norm(w))
        R = G.cayley(w)
        assert np.abs(R - Rotation.from_rotvec(w * (2 * math.atan(size / 2) / size)).as_matrix()).max() < 8 * EPS
        half = hat(w) / 2
        assert np.abs((np.eye(3) - half) @ R - (np.eye(3) + half)).max() < 8 * EPS * max(1.0, size)
        # the tangent of half the angle magnifies the rounding of R by 1 + size^2/4
        assert np.abs(G.cayley_inv(R) - w).max() < 8 * EPS * (min(size, 1.0) + size**2 * (1 + size)) or size > 1e5


def test_arrays_broadcast_and_give_the_bits_of_single_calls(rng: np.random.Generator) -> None:
    w, eta = rng.normal(size=(2, 5, 1, 3)), rng.normal(size=(4, 3))
    many = G.dexp(w, eta)
    assert many.shape == (2, 5, 4, 3)
    assert np.array_equal(many[1, 2, 3], G.dexp(w[1, 2, 0], eta[3]))
    assert G.exp(w).shape == (2, 5, 1, 3, 3)
    assert G.exp(np.empty((0, 3))).shape == (0, 3, 3)
    assert G.log(np.empty((0, 3, 3))).shape == (0, 3)
    assert G.casimirs(eta).shape == (4, 1)


def test_membership(rng: np.random.Generator) -> None:
    R = rotation(rng)
    assert G.contains(R)
    assert G.contains(np.stack([R, -R, R.T])).tolist() == [True, False, True]
    assert not G.contains(-R)
    assert not G.contains(R + 1e-5)


def test_matrices_of_another_shape_are_refused() -> None:
    wide = lm.mat([1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0])
    for call in (lm.SO3().log, lm.SO3().inverse):
        with pytest.raises(InvalidInput, match=r"\(3, 4\)"):
            call(wide)
    with pytest.raises(InvalidInput, match="g has shape"):
        lm.SO3().Ad(lm.vec(1.0, 2.0, 3.0), lm.vec(1.0, 2.0, 3.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert lm.SO3().log(lm.SO3().identity()) == lm.vec(0.0, 0.0, 0.0)
