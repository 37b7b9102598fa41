"""Bounds on the step of Algorithm 1 and signs of determinants, against definitions written once more."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import liemech as lm
from liemech.integrators.solvability import (
    first_fold,
    is_always_solvable,
    is_upright,
    largest_impulse,
    principal_moments,
    surely_solvable,
)
from liemech.solvers import beyond_fold

EXP, CAY = lm.Exponential(), lm.Cayley()
ORDERS = [*itertools.permutations(range(3))]


def least_on_the_octant(J: np.ndarray) -> float:
    """The least value, over its largest entry, of sum_ij k_ij y_i y_j/2 on the triangle y_i >= 0,
    sum y_i = 1: inside, on the edges, at the corners.
    """
    k = np.zeros((3, 3))
    for i, j, l in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        k[i, i] = 2.0 * J[i] * (4.0 * J[i] ** 2 + 3.0 * J[j] * J[l])
        k[i, j] = k[j, i] = 4.0 * J[i] * J[j] * (J[i] + J[j]) + 8.0 * J.prod() - J[l] * (J[i] ** 2 + J[j] ** 2)
    values = []
    for size in (1, 2, 3):
        for some in itertools.combinations(range(3), size):
            part = k[np.ix_(some, some)]
            y = np.linalg.lstsq(part, np.ones(size), rcond=None)[0]
            if (y * y.sum() > 0.0).all():
                values.append(0.5 / y.sum())
    return min(values) / np.abs(k).max()


@pytest.mark.parametrize("order", ORDERS, ids=str)
@pytest.mark.parametrize("shape", [(1.0, 0.0), (1.0, 0.5), (0.9, 0.2)])
def test_which_bodies_have_a_step_for_every_h(shape: tuple[float, float], order: list[int]) -> None:
    """The border, along rays of bodies with moments 1, x^a, x (1 + b), is where the form stops
    being positive on the octant; in any order and unit.
    """

    def body(x: float) -> np.ndarray:
        return np.array([1.0, x ** shape[0], x * (1.0 + shape[1])])[list(order)]

    low, high = 1.0, 1e4
    assert least_on_the_octant(body(low)) > 0.0 > least_on_the_octant(body(high))
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if least_on_the_octant(body(middle)) >= 0.0 else (low, middle)
    for unit in (1e-90, 1.0, 1e90):
        for part, wanted in ((0.2, True), (0.9999, True), (1.0001, False), (5.0, False)):
            J = unit * body(1.0 + part * (low - 1.0))
            assert is_always_solvable(lm.vec(*J)) == wanted


@pytest.mark.parametrize("order", ORDERS, ids=str)
def test_bounds_in_any_order(order: list[int]) -> None:
    """pi max(J1, (J1 J2 min(1, (J1 + J2)/J3))^(1/2)), and not above 2 pi J1 for the exponential."""
    for J1, J2, J3 in ((1.0, 2.0, 2.5), (1.0, 3.0, 5.0), (1.0, 1.5, 20.0), (1.0, 30.0, 40.0)):
        J = np.array([J1, J2, J3])[list(order)]
        fold = math.pi * max(J1, math.sqrt(J1 * J2 * min(1.0, (J1 + J2) / J3)))
        R = lm.SO3().exp([0.3, -0.5, 0.2])
        full = lm.Mat.of((R @ np.diag(J) @ R.T).tolist())
        for inertia, close in ((lm.vec(*J), 1e-14), (full, 1e-9)):
            assert first_fold(inertia, EXP) == pytest.approx(fold, rel=close)
            assert largest_impulse(inertia, EXP) == pytest.approx(min(fold, 2.0 * math.pi * J1), rel=close)
            whole = math.inf if least_on_the_octant(J) >= 0.0 else fold
            assert first_fold(inertia, CAY) == pytest.approx(whole, rel=close)
            assert largest_impulse(inertia, CAY) == pytest.approx(whole, rel=close)
        bound = math.pi**2 / (1.0 / J**2).sum()
        inverse = lm.Mat.of(np.linalg.inv(np.array(full)).tolist())
        assert surely_solvable(lm.vec(*(1.0 / J))) == pytest.approx(bound, rel=1e-14)
        assert surely_solvable(inverse) == pytest.approx(bound, rel=1e-12)


def test_principal_moments_are_eigenvalues() -> None:
    rng = np.random.default_rng(1)
    for values in ([1.0, 2.0, 3.5], [2.0, 2.0, 5.0], [1.0, 4.0, 4.0], [0.0, 1.0, 1.0], [3.0] * 3):
        for _ in range(3):
            R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            m = R @ np.diag(values) @ R.T
            found = principal_moments(lm.Mat.of((0.5 * (m + m.T)).tolist()))
            assert np.abs(np.array(found) - values).max() < 1e-7
    assert tuple(principal_moments(lm.Mat.of(np.diag([3.0, 3.0, 3.0]).tolist()))) == (3.0,) * 3
    m = lm.Mat.of(np.diag([0.0, 0.0, 1.0]).tolist())
    assert np.abs(np.array(principal_moments(m)) - [0.0, 0.0, 1.0]).max() < 1e-7
    assert min(principal_moments(m)) >= 0.0


@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_signs_of_determinants(n: int) -> None:
    """Upright: det m has the sign of rate^n.  Beyond a fold, told in three dimensions: it has not."""
    rng = np.random.default_rng(n)
    for rate in (0.3, -0.3):
        seen = set()
        for _ in range(30):
            m = rng.normal(size=(n, n))
            same = np.linalg.det(m) * rate**n > 0.0
            seen.add(same)
            assert is_upright(lm.Mat.of(m.tolist()), rate) == same
            assert beyond_fold(lm.Mat.of(m.tolist()), rate) == (n == 3 and not same)
        assert seen == {True, False}
    half = np.eye(n)
    half[0, 0] = 0.0  # a pivot that is zero has no sign
    assert not is_upright(lm.Mat.of(half.tolist()), 1.0)
