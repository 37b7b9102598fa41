"""The differential of the exponential that every group inherits: accurate however far xi leads."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import liemech as lm

EPS = 2.0**-52


@lm.record
class BareAlgebra(lm.LieAlgebra):
    """so(3) from what an algebra of one's own must write, and nothing else."""

    @property
    def dim(self) -> int:
        return 3

    def bracket(self, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        return lm.cross(xi, eta)


@lm.record
class Rotations(lm.LieGroup):
    """SO(3) from what a group of one's own must write, and nothing else."""

    @property
    def algebra(self) -> lm.LieAlgebra:
        return BareAlgebra()

    def identity(self) -> lm.Element:
        return lm.SO3().identity()

    def inverse(self, g: lm.Element) -> lm.Element:
        return lm.SO3().inverse(g)

    def exp(self, xi: lm.Vec) -> lm.Element:
        return lm.SO3().exp(xi)

    def Ad(self, g: lm.Element, xi: lm.Vec) -> lm.Vec:
        return lm.SO3().Ad(g, xi)


def phi1(a: np.ndarray) -> np.ndarray:
    n = len(a)
    return np.asarray(expm(np.block([[a, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:])


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
            group.algebra.dexp_dual(xi, eta, side),
            lm.SO3().algebra.dexp_dual(xi, eta, side),
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
        lambda x: group.dexp(x, lm.Vec.of(eta.tolist())),
        lm.Vec.of(xi.tolist()),
        lm.Vec.of(d.tolist()),
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
        lm.integrate(body, lm.CovariantVariational(), start, h=1.0, steps=3, compiled=c)
        for c in (False, True)
    )
    assert np.array_equal(plain.mu, native.mu)
