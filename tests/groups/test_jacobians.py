"""Jacobian matrices of the maps, as estimators use them."""

from __future__ import annotations

import numpy as np
import pytest
import shipped
from bare import phi1
from scipy.linalg import expm

import liemech as lm

EPS = 2.0**-52
GROUPS = shipped.GROUPS
names = pytest.mark.parametrize("group", GROUPS, ids=repr)
small_first = [pytest.param(G, marks=pytest.mark.slow) if G.dim > 5 else G for G in GROUPS]


@pytest.mark.sample(4)
@names
def test_against_the_exponential_of_a_block(group: lm.LieGroup) -> None:
    """dexp = phi1(ad) (right) and phi1(-ad) (left), each with its inverse; Ad_exp(xi) = exp(ad_xi)."""
    algebra = group.algebra
    for xi in 0.8 * np.random.default_rng(1).normal(size=(5, group.dim)):
        a = algebra.ad_matrix(xi)
        units = np.eye(group.dim)
        assert np.array_equal(a, np.stack([group.ad(xi, e) for e in units], axis=1))
        bound = 100.0 * EPS * np.exp(np.linalg.norm(a))
        assert np.abs(group.Ad_matrix(group.exp(xi)) - expm(a)).max() < bound
        for side, sign in (("right", 1.0), ("left", -1.0)):
            D = algebra.dexp_matrix(xi, side)
            assert np.abs(D - phi1(sign * a)).max() < bound
            assert np.abs(algebra.dexp_inv_matrix(xi, side) @ D - units).max() < bound * np.linalg.cond(D)


@pytest.mark.sample(len(GROUPS))  # every group, some milliseconds each
@pytest.mark.parametrize("group", small_first, ids=repr)
def test_what_they_are_for(group: lm.LieGroup) -> None:
    """exp(xi + d) = exp(J_l d) exp(xi) = exp(xi) exp(J_r d), log(g exp(d)) = xi + J_r^-1 d, g exp(d) = exp(Ad d) g."""
    algebra, rng = group.algebra, np.random.default_rng(2)
    xi, d = 0.5 * rng.normal(size=(2, group.dim))
    d *= 1e-5
    g, back = group.exp(xi), group.exp(-xi)
    bound = 50.0 * float(d @ d)  # what is left is of second order
    of_robotics = algebra.dexp_matrix(xi, "right"), algebra.dexp_matrix(xi, "left")
    assert np.abs(group.log(group.compose(group.exp(xi + d), back)) - of_robotics[0] @ d).max() < bound
    assert np.abs(group.log(group.compose(back, group.exp(xi + d))) - of_robotics[1] @ d).max() < bound
    right = group.log(group.compose(g, group.exp(d)))
    left = group.log(group.compose(group.exp(d), g))
    assert np.abs(right - xi - algebra.dexp_inv_matrix(xi, "left") @ d).max() < bound
    assert np.abs(left - xi - algebra.dexp_inv_matrix(xi, "right") @ d).max() < bound
    moved = group.compose(group.compose(g, group.exp(d)), back)
    assert np.abs(group.log(moved) - group.Ad_matrix(g) @ d).max() < bound


@names
def test_batches_equal_their_rows(group: lm.LieGroup) -> None:
    xi = np.random.default_rng(4).normal(size=(2, 3, group.dim))
    for formula in (group.algebra.ad_matrix, group.algebra.dexp_matrix, group.algebra.dexp_inv_matrix):
        many = formula(xi)
        assert many.shape == (2, 3, group.dim, group.dim)
        assert np.array_equal(many[1, 2], formula(xi[1, 2]))
    g = group.exp(xi)
    assert np.array_equal(group.Ad_matrix(g)[0, 1], group.Ad_matrix(g[0, 1]))


@pytest.mark.parametrize("group", [lm.SO3(), lm.SE3(), lm.SE23(), lm.SL(2)], ids=repr)
def test_the_cayley_map(group: lm.LieGroup) -> None:
    """dcayley on matrices: (1 + x/2)^-1 y (1 - x/2)^-1, column by column."""
    hat, one = group.algebra.hat, np.eye(group.element_shape[0])
    xi = 0.4 * np.random.default_rng(5).normal(size=group.dim)
    x = np.array(hat(xi))
    J = group.algebra.dcayley_matrix(xi)
    for unit, column in zip(np.eye(group.dim), J.T, strict=True):
        wanted = np.linalg.inv(one + x / 2) @ hat(unit) @ np.linalg.inv(one - x / 2)
        assert np.abs(hat(column) - wanted).max() < 50 * EPS


def test_a_side_that_is_none_is_refused() -> None:
    with pytest.raises(lm.errors.InvalidInput, match='side is "right" or "left"'):
        lm.SE3().algebra.dexp_matrix(np.zeros(6), "body")
