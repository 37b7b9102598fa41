"""Retractions: what makes them so, their differentials, and the mismatch that the variational method solves."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import slope

import liemech as lm
from liemech.formulas import Vec
from liemech.formulas.numbers.conversions import double_double, rounded

G = lm.SO3()
EPS = np.finfo(float).eps


def test_cayley_agrees_with_the_exponential_to_third_order() -> None:
    sizes = [0.4, 0.2, 0.1, 0.05]
    w = np.array([0.6, -0.64, 0.48])
    apart = [np.abs(G.cayley(s * w) - G.exp(s * w)).max() for s in sizes]
    assert slope(sizes, apart) == pytest.approx(3.0, abs=0.05)
    # 2 atan(s/2) = s - s^3/12: the size of the difference is that of the angle
    angle = np.linalg.norm(G.log(G.exp(0.05 * w).T @ G.cayley(0.05 * w)))
    assert angle == pytest.approx(0.05**3 / 12, rel=1e-2)


# ---------------------------------------------------------------- the mismatch


def test_a_retraction_of_ones_own_must_say_what_it_is() -> None:
    @lm.record
    class Nothing(lm.Retraction):
        """No map at all."""

    xi = lm.vec(0.1, 0.2, 0.3)
    for call in (
        lambda r: r.tau(G, xi),
        lambda r: r.tau_inv(G, G.identity()),
        lambda r: r.dtau(G, xi, xi),
        lambda r: r.dtau_inv(G, xi, xi),
        lambda r: r.dtau_inv_dual(G, xi, xi),
        lambda r: r.residual(G, xi, xi, xi),
    ):
        with pytest.raises(NotImplementedError, match="Nothing"):
            call(Nothing())


CASES = {
    "SO3": (lm.SO3(), lm.Cayley()),
    "quaternions": (lm.UnitQuaternions(), lm.Cayley()),
    "SE2": (lm.SE2(), lm.Cayley()),
    "SE3": (lm.SE3(), lm.Cayley()),
    "SE3, adjoint": (lm.SE3(), lm.CayleyAdjoint()),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", CASES)
def test_residuals_near_the_root_round_by_the_size_of_the_displacement(name: str) -> None:
    """With terms of the size of mu the residual is a multiple of 4 ulp(p), and steps are wrong to
    one side: 5e-20 a step.
    """
    group, tau = CASES[name]
    rng = np.random.default_rng(5)
    for size in (1e-1, 1e-3, 1e-6):
        for _ in range(20):
            mu = Vec.of(rng.uniform(-1.0, 1.0, group.dim).tolist())
            xi = Vec.of((size * rng.uniform(-1.0, 1.0, group.dim)).tolist())
            p = mu + size * Vec.of(rng.uniform(-0.1, 0.1, group.dim).tolist())
            r = tau.residual(group, xi, p, mu)[0]
            exact = rounded(tau.residual(group, *map(double_double, (xi, p, mu)))[0])
            assert max(abs(a - b) for a, b in zip(r, exact)) <= 8.0 * EPS * size


def test_where_the_cayley_map_is_the_exponential_it_is_that_of_a_group_of_ones_own() -> None:
    class Angles(lm.VectorSpace):
        """Angles within half a turn."""

        def exp(self, xi: Vec) -> Vec:
            return xi - 2.0 * np.pi * Vec(*[float(np.round(x / (2.0 * np.pi))) for x in xi])

    np.testing.assert_allclose(Angles(2).cayley([4.0, 1.0]), [4.0 - 2.0 * np.pi, 1.0], rtol=1e-15)


def test_another_map_is_no_exponential():
    """RKMK of order 4 took the series of dexp for the differential of a Cayley map, and was of order 2."""
    with pytest.raises(lm.errors.InvalidType, match="another map is a Retraction"):

        @lm.record
        class Other(lm.Exponential):
            def tau(self, group, xi):
                return group.cayley(xi)

        Other()

    @lm.record
    class Own(lm.Retraction):
        def tau(self, group, xi):
            return group.cayley(xi)

    body = lm.RigidBody([1.0, 1.5, 2.0])
    start, errors = body.state(mu=[0.3, 0.2, 0.9]), []
    exact = body.exact(start, 0.8).mu
    for steps in (4, 8):
        run = lm.integrate(body, lm.RKMK(retraction=Own()), start, h=0.8 / steps, steps=steps, compiled=False)
        errors.append(np.abs(run.mu[-1] - exact).max())
    assert 3.5 < np.log2(errors[0] / errors[1]) < 4.6
