"""Retractions: what makes them so, their differentials, and the mismatch that the variational method solves."""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from scenes import hat, slope

import liemech as lm
from liemech.formulas import Vec
from liemech.formulas.numbers.conversions import double_double, rounded

G = lm.SO3()
EPS = np.finfo(float).eps
RETRACTIONS = (lm.Exponential(), lm.Cayley())
SIZES = (1e-8, 0.1, 1.0, 1.58, 1.6, 3.0)


@pytest.fixture(params=RETRACTIONS, ids=lambda r: type(r).__name__)
def tau(request: pytest.FixtureRequest) -> lm.Retraction:
    return request.param


@pytest.fixture(params=SIZES)
def vectors(request: pytest.FixtureRequest) -> tuple[np.ndarray, ...]:
    """xi of the given size, eta and mu of size one."""
    xi, eta, mu = np.random.default_rng(7).normal(size=(3, 3))
    return xi * (request.param / np.linalg.norm(xi)), eta, mu


def close(a: object, b: object, ulps: float = 32) -> bool:
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return bool(np.abs(a - b).max() <= ulps * EPS * max(1.0, np.abs(b).max()))


def test_cayley_agrees_with_the_exponential_to_third_order() -> None:
    sizes = [0.4, 0.2, 0.1, 0.05]
    w = np.array([0.6, -0.64, 0.48])
    apart = [np.abs(G.cayley(s * w) - G.exp(s * w)).max() for s in sizes]
    assert slope(sizes, apart) == pytest.approx(3.0, abs=0.05)
    # 2 atan(s/2) = s - s^3/12: the size of the difference is that of the angle
    angle = np.linalg.norm(G.log(G.exp(0.05 * w).T @ G.cayley(0.05 * w)))
    assert angle == pytest.approx(0.05**3 / 12, rel=1e-2)


# ---------------------------------------------------------------- the mismatch


def definition(retraction: lm.Retraction, xi: mp.matrix, p: mp.matrix, mu: mp.matrix) -> mp.matrix:
    """p - (dtau_xi)* mu, from matrices; for the Cayley map times 1 + |xi|^2/4, which frees it of its division."""
    W = mp.matrix([[0, -xi[2], xi[1]], [xi[2], 0, -xi[0]], [-xi[1], xi[0], 0]])
    one = mp.eye(3)
    if isinstance(retraction, lm.Exponential):
        D, term = one.copy(), one.copy()
        for k in range(2, 60):
            term = term * W / k
            D = D + term
        return p - D.T * mu
    # the matrix eta -> (1 - W/2)^-1 eta (1 + W/2)^-1 of algebra elements, column by column
    left, right = (one - W / 2) ** -1, (one + W / 2) ** -1
    D = mp.zeros(3)
    for j, unit in enumerate(np.eye(3)):
        m = left * mp.matrix(hat(unit).tolist()) * right
        D[0, j], D[1, j], D[2, j] = m[2, 1], m[0, 2], m[1, 0]
    return (1 + (xi.T * xi)[0] / 4) * (p - D.T * mu)


def derivative(f: Callable[[mp.matrix], mp.matrix], x: mp.matrix) -> np.ndarray:
    columns = []
    for j in range(3):
        e = mp.zeros(3, 1)
        e[j] = mp.mpf(10) ** -25
        columns.append([float(v) for v in (f(x + e) - f(x - e)) / (2 * e[j])])
    return np.array(columns).T


@pytest.mark.sample(3)
def test_mismatch_and_its_derivatives(tau: lm.Retraction, vectors: tuple[np.ndarray, ...]) -> None:
    xi, p, mu = vectors
    r, by_p, by_xi = tau.residual(G, *(lm.Vec.of(v) for v in (xi, p, mu)))
    # a number of the author's choice
    multiple = tau.residual(G, *(lm.Vec.of(v) for v in (0 * xi, p, mu)))[1]
    r, by_p, by_xi = np.array(r) / multiple, by_p / multiple, np.array(by_xi) / multiple
    with mp.workdps(60):
        x, q, m = (mp.matrix(v.tolist()) for v in (xi, p, mu))
        wanted = np.array([float(v) for v in definition(tau, x, q, m)])
        wanted_by_xi = derivative(lambda y: definition(tau, y, q, m), x)
        wanted_by_p = derivative(lambda y: definition(tau, x, y, m), q)
    assert close(r, wanted, 16)
    assert close(by_xi, wanted_by_xi, 16)
    assert close(by_p * np.eye(3), wanted_by_p, 4)


def test_mismatch_vanishes_at_the_discrete_legendre_transform(
    tau: lm.Retraction, vectors: tuple[np.ndarray, ...]
) -> None:
    xi, p, _ = vectors
    mu = tau.dtau_inv_dual(G, -xi, p)
    r, by_p, _ = tau.residual(G, *(lm.Vec.of(v) for v in (xi, p, mu)))
    assert np.abs(np.array(r)).max() < 32 * EPS * by_p * max(np.abs(mu).max(), np.abs(p).max())


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
