"""Velocities of moving elements, traces of powers and means of the exponential, each against its
definition.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import derivative, vec
from liemech.groups.ad_series import mean, mean_slope
from liemech.groups.representations import averaged

GROUPS = (
    lm.SO3(),
    lm.SE2(),
    lm.UnitQuaternions(),
    lm.ProductGroup(lm.SO3(), lm.SE2()),
    lm.Heisenberg(2),
)


@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_the_velocity_of_a_moving_element(group: Any) -> None:
    """Of g exp(s xi) it is xi."""
    rng = np.random.default_rng(1)
    g, xi = group.exp(vec(*rng.normal(size=group.dim))), vec(*rng.normal(size=group.dim))
    rate = derivative(lambda s: group.compose(g, group.exp(s * xi)), 0.0)
    found = np.array(group.body_velocity(g, rate))
    assert np.allclose(found, np.array(xi), rtol=0.0, atol=1e-14 * np.abs(np.array(g)).max() ** 2)


@pytest.mark.parametrize("n", [5, 6, 7])
def test_casimirs_of_rotations_have_the_signs_they_say(n: int) -> None:
    """(-1)^k/2 tr hat(mu)^2k, in terms of the rates a_i of rotation in planes: the sum of a_i^2k,
    never negative.
    """
    group = lm.SO(n)
    mu = np.random.default_rng(n).normal(size=group.dim)
    rates = np.linalg.eigvals(np.array(group.algebra.hat(mu))).imag
    traces = group.casimirs(mu)
    for k in range(1, (n + 1) // 2):
        assert traces[k - 1] == pytest.approx(0.5 * (rates ** (2 * k)).sum(), rel=1e-13)


@pytest.mark.parametrize("n", [3, 4, 5])
def test_casimirs_of_unitary_matrices_have_the_signs_they_say(n: int) -> None:
    """i^-k tr M^k of an antihermitian matrix is the sum of the powers of its eigenvalues over i."""
    group = lm.SU(n)
    mu = np.random.default_rng(n).normal(size=group.dim)
    eigenvalues = np.linalg.eigvals(np.array(group.algebra.covector(mu))).imag
    for k, found in enumerate(group.casimirs(mu), start=2):
        assert found == pytest.approx((eigenvalues**k).sum(), rel=1e-13, abs=1e-13)


def test_the_slope_of_the_mean_is_its_derivative() -> None:
    group, rng = lm.SE3(), np.random.default_rng(2)
    x, v = 0.7 * rng.normal(size=6), rng.normal(size=6)
    slope = mean_slope(group.ad_star, vec(*x), vec(*v), 12.0)
    for i, unit in enumerate(np.eye(6)):
        column = derivative(
            lambda s, e=unit: mean(group.ad_star, vec(*x) + s * vec(*e), vec(*v)), 0.0
        )
        assert np.allclose(np.array(slope)[:, i], np.array(column), rtol=0.0, atol=1e-10)


def test_the_mean_of_a_long_motion_is_halved_until_its_series_is_short() -> None:
    """Of rotations by twelve turns: the part along the axis stays, what is across is
    (sin, 1 - cos)/angle of itself.
    """
    group, angle = lm.SO3(), 75.0
    xi = vec(0.0, 0.0, angle)
    x, _, z = averaged(
        group.ad, lambda w, x: group.Ad(group.exp(w), x), angle * angle, xi, vec(1.0, 0.0, 1.0)
    )
    assert x == pytest.approx(np.sin(angle) / angle, abs=1e-14) and z == pytest.approx(
        1.0, rel=1e-14
    )


@pytest.mark.parametrize(
    "group", [lm.UnitQuaternions(), lm.ProductGroup(lm.SO3(), lm.SE2())], ids=repr
)
def test_the_velocity_of_elements_that_are_no_matrices(group: Any) -> None:
    """The formula for every group, where these have closed forms."""
    rng = np.random.default_rng(3)
    g, xi = group.exp(vec(*rng.normal(size=group.dim))), vec(*rng.normal(size=group.dim))
    rate = derivative(lambda s: group.compose(g, group.exp(s * xi)), 0.0)
    found = np.array(lm.LieGroup.body_velocity(group, g, rate))
    assert np.allclose(found, np.array(xi), rtol=0.0, atol=1e-13)
