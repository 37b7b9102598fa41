"""Unit quaternions: the laws of a group, and the covering of SO(3) that turns all its formulas into theirs."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from bare import map_of
from scipy.spatial.transform import Rotation

import liemech as lm

EPS = 2.0**-52
Q, R = lm.UnitQuaternions(), lm.SO3()

LIMIT_ANGLE = 2.0 * math.sqrt(0.4)
"""Where the polynomials of the half angle end."""

ANGLES = [
    *(0.0, 1e-290, 1e-160, 1e-12, 1e-8, 1e-4, 0.1, 0.9999 * LIMIT_ANGLE, 1.0001 * LIMIT_ANGLE, 1.5, 2.0, 3.0),
    *(
        math.pi - 1e-3,
        math.pi - 1e-9,
        math.pi,
        math.pi + 1e-9,
        4.0,
        6.0,
        2 * math.pi - 1e-6,
        2 * math.pi,
        9.0,
        31.4,
        1e4,
    ),
]


def directions(angle: float) -> np.ndarray:
    """Rotation vectors of this length: along the axes, and in no special direction."""
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.6, 0.0, 0.8], [0.48, -0.6, 0.64], [1e-9, 1.0, -1e-5]])
    return angle * axes


def mp_quaternion(xi: np.ndarray) -> list[mp.mpf]:
    x = [mp.mpf(float(a)) for a in xi]
    angle = mp.sqrt(sum(a * a for a in x))
    if not angle:
        return [mp.mpf(0)] * 3 + [mp.mpf(1)]
    return [mp.sin(angle / 2) / angle * a for a in x] + [mp.cos(angle / 2)]


@pytest.mark.parametrize("group", [Q, lm.VectorSpace(3)], ids=repr)
def test_the_cayley_map_of_the_adjoint_representation_is_the_same(group: lm.LieGroup) -> None:
    assert lm.check_retraction(lm.CayleyAdjoint(), group)
    xi = np.array([0.4, -1.0, 2.0])
    ad = np.stack([group.ad(xi, unit) for unit in np.eye(3)], axis=1)
    by_ad = np.linalg.solve(np.eye(3) - ad / 2, np.eye(3) + ad / 2)
    assert np.abs(np.stack([group.Ad(group.cayley(xi), unit) for unit in np.eye(3)], axis=1) - by_ad).max() <= 8 * EPS


# ---------------------------------------------------------------- accuracy


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_to_4_eps_in_every_component(angle: float) -> None:
    with mp.workdps(60):
        for xi in directions(angle):
            for ours, exact in zip(Q.exp(xi), mp_quaternion(xi), strict=True):
                assert abs(mp.mpf(float(ours)) - exact) <= 4 * EPS * abs(exact)


@pytest.mark.parametrize("angle", [a for a in ANGLES if 1e-160 < a < 2 * math.pi])
def test_logarithm_inverts_the_exponential_up_to_two_half_turns(angle: float) -> None:
    for xi in directions(angle):
        assert np.abs(Q.log(Q.exp(xi)) - xi).max() <= 8 * EPS * angle


def test_logarithm_far_beyond_half_a_turn_differs_from_that_of_rotations() -> None:
    xi = np.array([0.0, 0.0, 5.0])
    assert np.allclose(Q.log(Q.exp(xi)), xi, rtol=8 * EPS)
    assert np.allclose(R.log(R.exp(xi)), [0.0, 0.0, 5.0 - 2 * math.pi], rtol=8 * EPS)


def test_logarithm_at_both_poles() -> None:
    assert np.array_equal(Q.log([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
    around = Q.log([0.0, 0.0, 0.0, -1.0])
    assert np.linalg.norm(around) == 2 * math.pi
    assert np.abs(Q.exp(around) - [0.0, 0.0, 0.0, -1.0]).max() <= 2 * EPS
    assert np.array_equal(Q.log([1e-200, 0.0, 0.0, 1.0]), [2e-200, 0.0, 0.0])


def test_cayley_by_its_definition() -> None:
    with mp.workdps(60):
        for size in (1e-290, 1e-9, 0.1, 1.0, 30.0, 1e9, 1e200):
            for xi in directions(size):
                half = [mp.mpf(float(a)) / 2 for a in xi]
                length = mp.sqrt(1 + sum(a * a for a in half))
                for ours, exact in zip(Q.cayley(xi), [*half, 1], strict=True):
                    assert abs(mp.mpf(float(ours)) - exact / length) <= 4 * EPS * abs(exact / length)


@pytest.mark.parametrize("name", ["exp", "cayley"])
def test_a_step_is_rounded_by_what_it_adds(name: str) -> None:
    """A step from e ends at exp(xi) exactly where 1 + small is exact, and its increment keeps its
    own relative accuracy.
    """
    for size in (1e-12, 1e-5, 0.3, 1.2, 1.3, 5.0):
        for xi in directions(size):
            ours, product = getattr(Q, "compose_" + name)(Q.identity(), xi), map_of(Q, name)(xi)
            assert np.abs(ours[:3] - product[:3]).max() <= 4 * EPS * np.abs(product[:3]).max()
            assert abs(ours[3] - product[3]) <= 4 * EPS


def test_huge_steps_of_the_cayley_map_are_half_turns() -> None:
    for size in (1e20, 1e160, 1e300):
        xi = size * np.array([0.6, 0.0, 0.8])
        assert np.abs(Q.cayley(xi) - [0.6, 0.0, 0.8, 0.0]).max() <= 1e-19 + 4 * EPS
        g = Q.random(1)
        assert np.abs(Q.compose_cayley(g, xi) - Q.compose(g, Q.cayley(xi))).max() <= 4 * EPS


# ---------------------------------------------------------------- the covering of SO(3)


def test_covering_is_a_homomorphism(rng: np.random.Generator) -> None:
    p, q = Q.random(rng, (2, 50))
    xi, mu = rng.normal(size=(2, 50, 3))
    assert np.abs(Q.matrix(Q.compose(p, q)) - Q.matrix(p) @ Q.matrix(q)).max() <= 8 * EPS
    assert np.abs(Q.matrix(Q.inverse(p)) - Q.matrix(p).swapaxes(-1, -2)).max() == 0.0
    assert np.array_equal(Q.matrix(Q.identity()), np.eye(3))
    assert np.array_equal(Q.matrix(-q), Q.matrix(q))
    for name in ("exp", "cayley"):
        assert np.abs(Q.matrix(map_of(Q, name)(xi)) - getattr(R, name)(xi)).max() <= 8 * EPS
    assert np.abs(Q.Ad(q, xi) - R.Ad(Q.matrix(q), xi)).max() <= 16 * EPS
    assert np.abs(Q.Ad_star(q, mu) - R.Ad_star(Q.matrix(q), mu)).max() <= 16 * EPS
    assert np.abs(Q.K(q, mu) - R.K(Q.matrix(q), mu)).max() <= 16 * EPS


def test_products_are_hamiltons() -> None:
    i, j, k, one = np.eye(4)
    assert np.array_equal(Q.compose(i, j), k)
    assert np.array_equal(Q.compose(j, k), i)
    assert np.array_equal(Q.compose(k, i), j)
    assert np.array_equal(Q.compose(j, i), -k)
    assert np.array_equal(Q.compose(i, i), -one)


def test_products_and_matrices_are_those_of_scipy(rng: np.random.Generator) -> None:
    p, q = Q.random(rng, (2, 20))
    assert np.abs(Q.matrix(q) - Rotation.from_quat(q).as_matrix()).max() <= 4 * EPS
    assert np.abs(Q.compose(p, q) - (Rotation.from_quat(p) * Rotation.from_quat(q)).as_quat()).max() <= 4 * EPS
    assert np.abs(Q.rotation(q).as_matrix() - Q.matrix(q)).max() <= 4 * EPS


def test_back_from_matrices(rng: np.random.Generator) -> None:
    q = Q.random(rng, 100)
    back = Q.from_matrix(Q.matrix(q))
    assert (back[:, 3] >= 0.0).all()
    assert np.abs(np.where(q[:, 3:] >= 0.0, q, -q) - back).max() <= 8 * EPS
    assert np.abs(Q.from_matrix(Rotation.from_quat(q)) - back).max() <= 8 * EPS
    with pytest.raises(lm.errors.InvalidInput, match="off the rotations"):
        Q.from_matrix(np.diag([1.0, 1.0, -1.0]))


# ---------------------------------------------------------------- membership, batches


def test_membership() -> None:
    assert Q.contains([0.0, 0.6, 0.0, 0.8])
    assert not Q.contains([0.0, 0.6, 0.0, 0.9])
    with pytest.raises(lm.errors.InvalidInput, match=r"its length is 1\.41421, not 1"):
        Q.inverse([1.0, 1.0, 0.0, 0.0])
    drifted = 1.3 * Q.random(1, 5)
    assert np.abs(Q.nearest(drifted) - drifted / 1.3).max() <= 4 * EPS
    with pytest.raises(lm.errors.InvalidInput, match="zero quaternion"):
        Q.nearest(np.zeros(4))
    with pytest.raises(lm.errors.OutsideChart, match="half a turn"):
        Q.cayley_inv([1.0, 0.0, 0.0, 0.0])
    with pytest.raises(lm.errors.OutsideChart, match="half a turn"):
        Q.cayley_inv([0.6, 0.0, 0.0, -0.8])


def test_random_quaternions_are_uniform() -> None:
    """Haar measure: mean zero and second moments 1/4; the scatter of 4000 samples is 0.016 and
    0.005.
    """
    q = Q.random(7, 4000)
    assert np.abs(Q.defect(q)).max() <= 4 * EPS
    assert np.abs(q.mean(axis=0)).max() < 0.03
    assert np.abs(q.T @ q / len(q) - np.eye(4) / 4).max() < 0.02
