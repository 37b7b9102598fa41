"""Every map of every group, beside matrices of ad and beside its own derivative: within a series,
beyond it, and far away.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shipped
from groups.bare import BareAlgebra, BareGroup, phi1
from scenes import PlaneMotions
from scipy.linalg import expm

import liemech as lm
from liemech.formulas import Vec, derivative, plain
from liemech.groups.lie_algebra import sided
from liemech.groups.matrices.matrix_group import MatrixLieGroup
from liemech.groups.representations import AdjointAction

EPS = 2.0**-52


@lm.record
class WithMatrices(BareAlgebra):
    """so(3) from what an algebra must write, and matrices for a Cayley map."""

    def hat(self, xi: lm.Vec) -> lm.Mat:
        return lm.SO3().algebra.hat(xi)

    def vee(self, matrix: lm.Mat) -> lm.Vec:
        return lm.SO3().algebra.vee(matrix)


@lm.record
class OnlyWhatItMust(BareGroup):
    """SO(3) from what a group must write, with Cayley map and logarithm."""

    @property
    def algebra(self) -> lm.LieAlgebra:
        return WithMatrices()

    def log(self, g: lm.Element) -> lm.Vec:
        return lm.SO3().log(g)

    def cayley(self, xi: lm.Vec) -> lm.Element:
        return lm.SO3().cayley(xi)

    def cayley_inv(self, g: lm.Element) -> lm.Vec:
        return lm.SO3().cayley_inv(g)


@lm.record
class WithoutMatrices(BareAlgebra):
    """so(3) as a bracket alone, with a differential of one's own."""

    def dexp_dual(self, xi: lm.Vec, mu: lm.Vec) -> lm.Vec:
        return lm.SO3().algebra.dexp_dual(xi, mu)


@lm.record
class Abstract(OnlyWhatItMust):
    """SO(3) whose adjoint action and velocities come from differentiation."""

    @property
    def algebra(self) -> lm.LieAlgebra:
        return WithoutMatrices()

    def why_no_cayley(self) -> str:
        return "there are no matrices"


TRIANGULAR = [[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]]
ROTATIONS = np.array([np.array(lm.SO3().algebra.hat(e)) for e in np.eye(3)])
GROUPS: tuple[lm.LieGroup, ...] = (
    *shipped.GROUPS, lm.SE3().by_adjoint, OnlyWhatItMust(), Abstract(), PlaneMotions(),
    *map(MatrixLieGroup.of, (TRIANGULAR, TRIANGULAR[:2], ROTATIONS, 0.5**0.5 * ROTATIONS)),
    lm.SemidirectProduct(lm.SL(2)), lm.SemidirectProduct(lm.SE2(), AdjointAction(lm.SE2())),
)  # fmt: skip
LONG = [
    G for G in GROUPS if G.dim > 6 or (G in shipped.CLASSICAL and G.dim > 4)
]  # by default not, as others have all their formulas
BY_DEFAULT = [G if G not in LONG else pytest.param(G, marks=pytest.mark.slow) for G in GROUPS]
SIZES = [0.12, pytest.param(0.9, marks=pytest.mark.slow), 3.3, pytest.param(5.4, marks=pytest.mark.slow)]


def array(x: Any) -> np.ndarray:
    return np.array(plain(x))


@pytest.mark.parametrize("group", BY_DEFAULT, ids=repr)
@pytest.mark.parametrize("size", SIZES)
def test_the_exponential(group: lm.LieGroup, size: float) -> None:
    """Of ad, its means, their duals and inverses; residuals; and what they say of the group."""
    algebra, units = group.algebra, np.eye(group.dim)
    rng = np.random.default_rng([group.dim, int(10 * size)])
    xi, eta, mu, p = map(Vec.of, (rng.normal(size=(4, group.dim)) / group.dim**0.5).tolist())
    xi = size * xi / lm.norm(xi)
    ad = np.stack([array(group.ad(xi, Vec.of(e))) for e in units.tolist()], axis=1)
    grown, phi, back = expm(ad), phi1(ad), phi1(-ad)
    scale = max(np.abs(m).max() for m in (grown, expm(-ad), phi, back))
    bound = 4000.0 * EPS * scale**2

    def close(found: Any, wanted: Any, factor: float = 1.0) -> bool:
        return bool(np.abs(array(found) - array(wanted)).max() <= factor * bound)

    assert np.array_equal(array(algebra.ad_matrix(xi)), ad)
    assert close(algebra.ad_star(xi, mu), ad.T @ mu)
    assert close(group.exp_Ad_star(xi, mu), grown.T @ mu)
    assert float(algebra.ad_size(xi)) >= np.linalg.norm(ad, 2) * (1.0 - 1e-12)
    for side, mean in (("right", phi), ("left", back)):
        assert close(group.dexp(xi, eta, side), mean @ eta)
        assert close(algebra.dexp_dual(sided(xi, side), mu), mean.T @ mu)
        condition = float(np.linalg.cond(mean))
        if algebra.is_exp_chart(xi) and condition < 1e6:
            assert close(group.dexp_inv(xi, eta, side), np.linalg.solve(mean, eta), condition)
            assert close(algebra.dexp_inv_dual(sided(xi, side), mu), np.linalg.solve(mean.T, mu), condition)
    r, by_p, by_xi = algebra.exp_residual(xi, p, mu)
    by_p = by_p * units if isinstance(by_p, float) else array(by_p)
    assert close(r, by_p @ (array(p) - phi.T @ mu))
    slope = derivative(lambda s: algebra.exp_residual(xi + s * eta, p, mu)[0], 0.0)
    assert np.abs(array(by_xi @ eta) - array(slope)).max() < 1e-8 * scale**2

    g = group.exp(xi)
    assert close(group.Ad_matrix(g), grown)
    assert close(group.Ad_star(g, mu), grown.T @ mu)
    assert close(group.K(g, mu), expm(-ad).T @ mu)
    assert close(group.compose(g, group.exp(-xi)), array(group.identity()))
    assert close(group.inverse(g), array(group.exp(-xi)))
    assert close(group.compose_exp(g, eta), array(group.compose(g, group.exp(eta))))
    rate = derivative(lambda s: group.exp(xi + s * eta), 0.0)
    assert close(group.body_velocity(g, rate), back @ eta)
    if not isinstance(group, PlaneMotions):
        assert group.defect(g) <= bound and group.contains(g)
    if not isinstance(group, OnlyWhatItMust | PlaneMotions):
        assert close(group.nearest(g), g)
    if size < 2.0 and not isinstance(group, PlaneMotions):
        assert close(group.log(g), xi)
    here, there = array(group.casimirs(mu)), array(group.casimirs(group.Ad_star(g, mu)))
    assert np.abs(here - there).max(initial=0.0) <= 10.0 * bound * scale**2


@pytest.mark.parametrize("group", [G for G in GROUPS if G.why_no_cayley() is None], ids=repr)
@pytest.mark.parametrize("size", [pytest.param(0.12, marks=pytest.mark.slow), 1.6])
def test_the_cayley_map(group: lm.LieGroup, size: float) -> None:
    """It agrees with exp to the second order; its differential is its derivative; all else follows."""
    algebra, units = group.algebra, identity(group.dim)
    rng = np.random.default_rng([group.dim, int(10 * size)])
    xi, eta, mu, p = map(Vec.of, (rng.normal(size=(4, group.dim)) / group.dim**0.5).tolist())
    xi = size * xi / lm.norm(xi)
    g = group.cayley(xi)

    def close(found: Any, wanted: Any) -> bool:
        return bool(np.abs(array(found) - array(wanted)).max() <= 1e-12)

    small = group.log(group.cayley(1e-3 * xi))
    assert np.abs(array(small) - 1e-3 * array(xi)).max() < 1e-8
    assert close(group.cayley_inv(g), xi)
    assert close(group.compose(g, group.cayley(-xi)), group.identity())
    assert close(group.compose_cayley(g, eta), group.compose(g, group.cayley(eta)))
    for side in ("right", "left"):
        mean = np.stack([array(algebra.dcayley(sided(xi, side), e)) for e in units], axis=1)
        inverse = np.stack([array(algebra.dcayley_inv(sided(xi, side), e)) for e in units], axis=1)
        assert close(inverse @ mean, np.eye(group.dim))
        assert close(algebra.dcayley_dual(sided(xi, side), mu), mean.T @ mu)
        assert close(algebra.dcayley_inv_dual(sided(xi, side), mu), inverse.T @ mu)
        if side == "left":
            rate = derivative(lambda s: group.cayley(xi + s * eta), 0.0)
            assert close(group.body_velocity(g, rate), mean @ eta)
        else:
            r, by_p, by_xi = algebra.cayley_residual(xi, p, mu)
            by_p = by_p * np.eye(group.dim) if isinstance(by_p, float) else array(by_p)
            assert close(r, by_p @ (array(p) - mean.T @ mu))
            slope = derivative(lambda s: algebra.cayley_residual(xi + s * eta, p, mu)[0], 0.0)
            assert close(by_xi @ eta, slope)
    assert close(algebra.cayley_Ad_star(xi, mu), group.Ad_star(g, mu))
    assert group.contains(g)


def identity(n: int) -> list[Vec]:
    return [Vec.of(row) for row in np.eye(n).tolist()]
