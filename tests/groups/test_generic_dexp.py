"""The differential of the exponential that every group inherits: accurate however far xi leads."""

from __future__ import annotations

import math

import numpy as np
import pytest
from groups.bare import BareGroup, phi1

import liemech as lm
from liemech.errors import InvalidInput
from liemech.formulas import Vec, derivative, vec
from liemech.groups.ad_series import mean, mean_slope
from liemech.groups.lie_algebra import sided
from liemech.groups.representations import averaged

EPS = 2.0**-52


@lm.record
class Rotations(BareGroup):
    """SO(3) with an adjoint action."""

    def Ad(self, g: lm.Element, xi: lm.Vec) -> lm.Vec:
        return lm.SO3().Ad(g, xi)


@pytest.mark.parametrize("size", [0.0, 1e-8, 0.5, 2.8, 3.0, 10.0, 40.0, 1000.0])
@pytest.mark.parametrize("side", ["right", "left"])
def test_mean_of_exp(size: float, side: str) -> None:
    """dexp_xi = phi1(ad_xi) and its dual, beside a block exponential and the closed form of SO(3)."""
    group, rng = Rotations(), np.random.default_rng(3)
    xi, eta = rng.normal(size=(2, 3))
    xi *= size / np.linalg.norm(xi)
    sign = 1.0 if side == "right" else -1.0
    matrix = phi1(sign * np.array(lm.SO3().algebra.hat(xi))) if size <= 40.0 else None
    for found, closed, expected in (
        (group.dexp(xi, eta, side), lm.SO3().dexp(xi, eta, side), matrix),
        (
            group.algebra.dexp_dual(sided(xi, side), eta),
            lm.SO3().algebra.dexp_dual(sided(xi, side), eta),
            None if matrix is None else matrix.T,
        ),
    ):
        assert np.abs(found - closed).max() <= (16 + 4 * size) * EPS * np.abs(eta).max()
        if expected is not None:
            assert np.abs(found - expected @ eta).max() <= 200 * EPS * np.abs(eta).max()


def test_derivatives_of_it() -> None:
    """Along xi, far from zero, against differences."""
    group, rng = Rotations(), np.random.default_rng(4)
    xi, eta, d = rng.normal(size=(3, 3))
    xi *= 20.0
    slope = lm.derivative(
        lambda x: group.dexp(x, lm.Vec.of(eta.tolist())), lm.Vec.of(xi.tolist()), lm.Vec.of(d.tolist())
    )
    h = 1e-5
    expected = (lm.SO3().dexp(xi + h * d, eta) - lm.SO3().dexp(xi - h * d, eta)) / (2 * h)
    assert np.abs(np.array(slope) - expected).max() <= 1e-9


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_does_the_same() -> None:
    """A variational step of 2.5 rad, whose equation is dexp's dual: the same bits."""
    body = lm.LiePoissonSystem(Rotations(), lm.KineticEnergy([1.0, 1.0, 1.1]))
    start = body.state([0.1, 2.0, 1.4], np.eye(3))
    plain, native = (
        lm.integrate(body, lm.CovariantVariational(), start, h=1.0, steps=3, compiled=c) for c in (False, True)
    )
    assert np.array_equal(plain.mu, native.mu)


@pytest.mark.parametrize("size", [1e19, 1e160, 1e308])
def test_a_sum_of_which_no_digit_is_known_is_nan_after_few_products(size: float) -> None:
    """Squares of 1e160 are infinite: halving went on 1100 times, and a call took half a minute."""
    products = 0

    def grown(xi: float, x: Vec) -> Vec:
        nonlocal products
        products += 1
        return math.exp(min(xi, 9.0)) * x

    def by(xi: float, x: Vec) -> Vec:
        return xi * x

    assert math.isnan(averaged(by, grown, size * size, size, vec(1.0))[0])
    assert products == 0
    mean = averaged(by, grown, 9.0, 3.0, vec(1.0))[0]
    assert mean == pytest.approx((math.exp(3.0) - 1.0) / 3.0, rel=1e-14)
    assert products == 2  # from 3/4


def test_the_slope_of_the_mean_is_its_derivative() -> None:
    group, rng = lm.SE3(), np.random.default_rng(2)
    x, v = 0.7 * rng.normal(size=6), rng.normal(size=6)
    slope = mean_slope(group.ad_star, vec(*x), vec(*v), 12.0)
    for i, unit in enumerate(np.eye(6)):
        column = derivative(lambda s, e=unit: mean(group.ad_star, vec(*x) + s * vec(*e), vec(*v)), 0.0)
        assert np.allclose(np.array(slope)[:, i], np.array(column), rtol=0.0, atol=1e-10)


def test_the_mean_of_a_long_motion_is_halved_until_its_series_is_short() -> None:
    """Of rotations by twelve turns: the part along the axis stays, what is across is (sin, 1 - cos)/angle of itself."""
    group, angle = lm.SO3(), 75.0
    xi = vec(0.0, 0.0, angle)
    x, _, z = averaged(group.ad, lambda w, x: group.Ad(group.exp(w), x), angle * angle, xi, vec(1.0, 0.0, 1.0))
    assert x == pytest.approx(np.sin(angle) / angle, abs=1e-14) and z == pytest.approx(1.0, rel=1e-14)


def test_numbers_of_terms_that_series_have_not() -> None:
    algebra, x = lm.SO(4).algebra, [0.1] * 6
    for terms, told in ((-1, "got -1"), (99, "got 99"), (10**30, "got a huge number")):
        with pytest.raises(InvalidInput, match=rf"terms must be from 0 to .*; {told}"):
            algebra.dexp_inv_series(x, x, terms)
