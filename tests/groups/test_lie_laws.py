"""The laws of groups, algebras and coadjoint actions: once, for every group, at the identity, close to it, anywhere,
near pi.

Two more groups write only what a group must write: rotations again, to compare the formulas that follow from the laws
with the closed forms, and the motions of the plane, where no closed form hides a wrong general one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import shipped
from scenes import PlaneMotions, hat, rotation

import liemech as lm
from liemech.formulas import derivative, dot, vec
from liemech.groups.lie_algebra import sided
from liemech.groups.representations import AdjointAction
from liemech.groups.rigid.so3 import SO3Algebra

EPS = np.finfo(float).eps
pytestmark = pytest.mark.sample(12)  # all laws in a quarter of a second


# ---------------------------------------------------------------- groups that write only what they must


@lm.record
class BareRotationAlgebra(lm.LieAlgebra):
    """so(3) by its structure constants."""

    @property
    def dim(self) -> int:
        return 3

    @property
    def structure_constants(self) -> tuple:
        return SO3Algebra().structure_constants

    def dcayley_inv(self, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        return SO3Algebra().dcayley_inv(xi, eta)


@lm.record
class BareRotations(lm.LieGroup):
    """SO(3) without closed forms; for the Cayley family, only its smallest part."""

    @property
    def algebra(self) -> BareRotationAlgebra:
        return BareRotationAlgebra()

    def identity(self) -> lm.Mat:
        return lm.SO3().identity()

    def inverse(self, g: lm.Mat) -> lm.Mat:
        return g.T

    def exp(self, xi: lm.Vec) -> lm.Mat:
        return lm.SO3().exp(xi)

    def Ad(self, g: lm.Mat, xi: lm.Vec) -> lm.Vec:
        return g @ xi

    def cayley(self, xi: lm.Vec) -> lm.Mat:
        return lm.SO3().cayley(xi)


def plane_hat(xi: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -xi[0], xi[1]], [xi[0], 0.0, xi[2]], [0.0, 0.0, 0.0]])


HATS: dict[type, Callable[[np.ndarray], np.ndarray]] = {lm.SO3: hat, BareRotations: hat, PlaneMotions: plane_hat}
GROUPS = (lm.SO3(), BareRotations(), PlaneMotions())
SIZES = {"identity": 0.0, "1e-8": 1e-8, "random": 1.3, "near pi": math.pi - 1e-6}


@dataclass
class Case:
    """A group, three of its velocities of one size, and momenta and velocities of size one."""

    group: lm.LieGroup
    size: float
    xi: np.ndarray
    eta: np.ndarray
    mu: np.ndarray

    @property
    def hat(self) -> Callable[[np.ndarray], np.ndarray]:
        return HATS[type(self.group)]

    def vee(self, matrix: np.ndarray) -> np.ndarray:
        """Coordinates, by least squares over the basis."""
        basis = np.stack([self.hat(e).ravel() for e in np.eye(3)], axis=1)
        found, *_ = np.linalg.lstsq(basis, matrix.ravel(), rcond=None)
        assert np.abs(basis @ found - matrix.ravel()).max() < 1e-12
        return found


@pytest.fixture(params=[(g, s) for g in GROUPS for s in SIZES], ids=lambda p: f"{type(p[0]).__name__}-{p[1]}")
def case(request: pytest.FixtureRequest) -> Case:
    group, label = request.param
    rng = np.random.default_rng([3, len(label)])
    xi = rng.normal(size=(3, 3))
    xi *= SIZES[label] / np.linalg.norm(xi, axis=1, keepdims=True)
    return Case(group, SIZES[label], xi, *rng.normal(size=(2, 3)))


def close(a: object, b: object, ulps: float = 32) -> bool:
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return bool(np.abs(a - b).max() <= ulps * EPS * max(1.0, np.abs(b).max()))


# ---------------------------------------------------------------- coadjoint action


def test_order_of_the_actions_matters(rng: np.random.Generator) -> None:
    """The two laws above are not the same law: on SO(3), at random, the wrong order fails by far."""
    G, (a, b), mu = lm.coadjoint(lm.SO3()), (rotation(rng), rotation(rng)), rng.normal(size=3)
    assert np.abs(G.Ad_star(a @ b, mu) - G.Ad_star(a, G.Ad_star(b, mu))).max() > 0.1


def test_poisson_structure(case: Case) -> None:
    """B is antisymmetric, B grad H = ad*_{grad H} mu, and the bracket {F, H} = grad F . B grad H is
    -<mu, [dF, dH]>.
    """
    G, dF, dH = lm.coadjoint(case.group), case.xi[0] + 0.3, case.eta
    B = G.poisson_structure(case.mu)
    assert np.array_equal(B, -B.T)
    assert close(B @ dH, G.ad_star(dH, case.mu))
    assert dF @ B @ dH == pytest.approx(-np.dot(case.mu, case.group.ad(dF, dH)), abs=32 * EPS)
    for gradient in np.eye(3) * 2 * case.mu if isinstance(case.group, lm.SO3) else []:
        assert np.abs(B @ (2 * case.mu)).max() <= 8 * EPS * np.abs(gradient).max()


def test_poisson_bracket_obeys_jacobi(case: Case) -> None:
    """sum_l dB_ij/dmu_l B_lk + cyclic = 0; B is linear in mu, so its derivative is B itself at the basis."""
    structure = case.group.algebra.poisson_structure
    B, dB = structure(case.mu), np.stack([structure(e) for e in np.eye(3)], axis=-1)
    first = np.einsum("ijl,lk->ijk", dB, B)
    assert np.abs(first + first.transpose(2, 0, 1) + first.transpose(1, 2, 0)).max() < 8 * EPS


def test_symplectic_form_of_the_orbit(case: Case) -> None:
    """It pairs with the Poisson bracket, is antisymmetric and the group leaves it alone."""
    G, g, xi = lm.coadjoint(case.group), case.group.exp(case.xi[0]), case.xi[1] + 0.4
    value = G.symplectic_form(case.mu, xi, case.eta)
    assert value == pytest.approx(np.dot(xi, G.poisson_structure(case.mu) @ case.eta), abs=32 * EPS)
    assert value == pytest.approx(-G.symplectic_form(case.mu, case.eta, xi), abs=32 * EPS)
    moved = [case.group.Ad(g, v) for v in (xi, case.eta)]
    assert value == pytest.approx(G.symplectic_form(G.K(g, case.mu), *moved), abs=64 * EPS * (1 + case.size**2))


def test_orbits_of_rotations() -> None:
    G = lm.coadjoint(lm.SO3())
    mu = np.array([0.3, -0.2, 0.9])
    assert G.on_same_orbit(mu, lm.SO3().K(lm.SO3().exp(np.array([1.0, 2.0, 3.0])), mu))
    assert G.on_same_orbit(1e-40 * mu, -1e-40 * mu)
    assert not G.on_same_orbit(mu, 1.0001 * mu)
    assert not G.on_same_orbit(1e-40 * mu, 1.0001e-40 * mu)


# ---------------------------------------------------------------- algebra


@pytest.mark.parametrize("group", GROUPS, ids=lambda g: type(g).__name__)
def test_algebras_obey_their_laws(group: lm.LieGroup) -> None:
    algebra, c = group.algebra, np.array(group.algebra.structure_constants)
    algebra.check()
    assert np.array_equal(c, -c.transpose(0, 2, 1))
    e = np.eye(3)
    for i in range(3):
        for j in range(3):
            assert np.array_equal(algebra.bracket(e[i], e[j]), c[:, i, j])


@lm.record
class Broken(lm.LieAlgebra):
    """so(3) with one structure constant changed."""

    constants: tuple = ()

    @property
    def dim(self) -> int:
        return 3

    @property
    def structure_constants(self) -> tuple:
        return self.constants


@pytest.mark.parametrize("scale", [1e-40, 1.0, 1e40])
@pytest.mark.parametrize("what", ["antisymmetry", "Jacobi"])
def test_check_finds_a_broken_algebra(what: str, scale: float) -> None:
    c = scale * np.array(SO3Algebra().structure_constants)
    if what == "antisymmetry":
        c[2, 0, 1] *= 1 + 1e-12
    else:  # [E1, E2] gets a part along E1: antisymmetric, but no Lie algebra
        c[0, 0, 1] += 1e-12 * scale
        c[0, 1, 0] -= 1e-12 * scale
    constants = tuple(tuple(map(tuple, plane)) for plane in c.tolist())
    with pytest.raises(lm.errors.LawViolation, match=what):
        Broken(constants).check()


def test_check_accepts_an_abelian_algebra() -> None:
    zero = ((0.0,) * 3,) * 3
    Broken((zero,) * 3).check()


# ---------------------------------------------------------------- differentials, from their definition in 50 digits


def test_series_of_the_inverse_differential(case: Case) -> None:
    """Cut after ad^q, the error is the first Bernoulli term left out; with enough terms it is the closed form."""
    G, xi, eta = case.group, 0.2 * case.xi[0], case.eta
    ad = np.stack([G.ad(xi, e) for e in np.eye(3)], axis=1)
    bernoulli = (1, -1 / 2, 1 / 6, 0, -1 / 30, 0, 1 / 42, 0, -1 / 30, 0, 5 / 66, 0, -691 / 2730)
    total = np.zeros(3)
    for q, b in enumerate(bernoulli):
        total = total + b / math.factorial(q) * (np.linalg.matrix_power(ad, q) @ eta)
        assert close(G.algebra.dexp_inv_series(-xi, eta, q), total)
    assert np.abs(total - G.dexp_inv(-xi, eta)).max() < 1e-12 + (case.size / 5 / 2 / math.pi) ** 14 * 4


# ---------------------------------------------------------------- closed forms against what follows from the laws


@pytest.mark.sample(4)
@pytest.mark.parametrize("size", [0.0, 1e-8, 0.3, 1.58, 1.6, 3.0, 5.0])
def test_closed_forms_equal_the_general_ones(size: float) -> None:
    rng = np.random.default_rng(11)
    closed, bare = lm.SO3(), BareRotations()
    for xi, eta, mu in rng.normal(size=(5, 3, 3)):
        xi = xi * (size / np.linalg.norm(xi))
        g = closed.exp(eta)
        assert close(closed.ad(xi, eta), bare.ad(xi, eta), 4)
        assert close(closed.ad_star(xi, mu), bare.ad_star(xi, mu), 4)
        assert close(closed.Ad_star(g, mu), bare.Ad_star(g, mu), 4)
        assert close(closed.K(g, mu), bare.K(g, mu), 4)
        assert close(closed.exp_Ad_star(xi, mu), bare.exp_Ad_star(xi, mu), 16)
        assert close(closed.algebra.poisson_structure(mu), bare.algebra.poisson_structure(mu), 4)
        for side in ("right", "left"):
            x, ours, theirs = sided(xi, side), closed.algebra, bare.algebra
            assert close(closed.dexp(xi, eta, side), bare.dexp(xi, eta, side))
            assert close(closed.dexp_inv(xi, eta, side), bare.dexp_inv(xi, eta, side), 64)
            assert close(ours.dexp_inv_dual(x, mu), theirs.dexp_inv_dual(x, mu), 64)
            assert close(ours.dcayley(x, eta), theirs.dcayley(x, eta))
            assert close(ours.dcayley_inv_dual(x, mu), theirs.dcayley_inv_dual(x, mu))
            for terms in range(13):
                series = ours.dexp_inv_series(x, eta, terms)
                assert close(series, theirs.dexp_inv_series(x, eta, terms), 64)


def test_a_bare_group_moves_a_body_as_the_closed_one_does() -> None:
    """The same RKMK step on SO3 and on the group that writes only what it must."""
    energy = lm.RigidBody([1.0, 1.6, 2.3]).hamiltonian
    starts = dict(mu=[0.4, -0.5, 0.7], g=np.eye(3))
    runs = []
    for group in (lm.SO3(), BareRotations()):
        system = lm.LiePoissonSystem(group, energy)
        for method in (lm.RKMK(order=4), lm.RKMK(order=4, truncation="closed")):
            runs.append(lm.integrate(system, method, system.state(**starts), h=0.1, steps=20, compiled=False))
    for a, b in ((0, 2), (1, 3)):
        assert np.abs(runs[a].mu - runs[b].mu).max() < 1e-14
        assert np.abs(runs[a].g - runs[b].g).max() < 1e-14


def test_what_a_bare_group_lacks_says_so() -> None:
    bare, xi = PlaneMotions(), np.ones(3)
    with pytest.raises(NotImplementedError, match="PlaneMotions has no logarithm"):
        bare.log(np.eye(3))
    with pytest.raises(lm.errors.IncompatibleSystem, match="PlaneMotions has no Cayley map"):
        bare.cayley(xi)
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"cannot be used on PlaneMotions.*Exponential"):
        lm.Cayley().require(bare)
    assert bare.casimirs(xi).shape == (0,)
    assert dot(lm.vec(1.0, 2.0), lm.vec(3.0, 4.0)) == 11.0


MOVING = (lm.SO3(), lm.SE2(), lm.UnitQuaternions(), lm.ProductGroup(lm.SO3(), lm.SE2()), lm.Heisenberg(2))


@pytest.mark.parametrize("group", MOVING, ids=repr)
def test_the_velocity_of_a_moving_element(group: Any) -> None:
    """Of g exp(s xi) it is xi."""
    rng = np.random.default_rng(1)
    g, xi = group.exp(vec(*rng.normal(size=group.dim))), vec(*rng.normal(size=group.dim))
    rate = derivative(lambda s: group.compose(g, group.exp(s * xi)), 0.0)
    found = np.array(group.body_velocity(g, rate))
    assert np.allclose(found, np.array(xi), rtol=0.0, atol=1e-14 * np.abs(np.array(g)).max() ** 2)


@pytest.mark.parametrize("group", [lm.UnitQuaternions(), lm.ProductGroup(lm.SO3(), lm.SE2())], ids=repr)
def test_the_velocity_of_elements_that_are_no_matrices(group: Any) -> None:
    """The formula for every group, where these have closed forms."""
    rng = np.random.default_rng(3)
    g, xi = group.exp(vec(*rng.normal(size=group.dim))), vec(*rng.normal(size=group.dim))
    rate = derivative(lambda s: group.compose(g, group.exp(s * xi)), 0.0)
    found = np.array(lm.LieGroup.body_velocity(group, g, rate))
    assert np.allclose(found, np.array(xi), rtol=0.0, atol=1e-13)


# ---------------------------------------------------------------- every group there is


SO3, Q, SL2 = lm.SO3(), lm.UnitQuaternions(), lm.SL(2)
EVERY = (
    *shipped.GROUPS, BareRotations(), PlaneMotions(), lm.VectorSpace(1),
    lm.ProductGroup(lm.ProductGroup(SO3, lm.VectorSpace(1)), Q),
    lm.ProductGroup(lm.SemidirectProduct(SO3), lm.VectorSpace(1)),
    lm.SemidirectProduct(SL2), lm.SemidirectProduct(lm.Heisenberg()), lm.SemidirectProduct(SL2, AdjointAction(SL2)),
    *(lm.SemidirectProduct(SO3, action(SO3)) for action in (lm.actions.LinearAction, lm.actions.CoadjointAction)),
    lm.OppositeGroup(SO3), lm.OppositeGroup(lm.SE23()),
)  # fmt: skip
"""The groups of the library, and others made of them."""

QUICK = (SO3, Q, lm.SE2(), lm.VectorSpace(1), lm.VectorSpace(3), lm.OppositeGroup(SO3))
"""Groups whose laws take less than a second in plain Python."""


def every_group(native: bool) -> list[Any]:
    return [
        pytest.param(
            group, native, marks=[] if group in QUICK and not native else [pytest.mark.slow], id=f"{group!r}-{native}"
        )
        for group in EVERY
    ]


@pytest.mark.compiled
@pytest.mark.sample(1)
@pytest.mark.parametrize(("group", "native"), [*every_group(False), *every_group(True)])
def test_every_group_obeys_all_laws(group: lm.LieGroup, native: bool) -> None:
    report = lm.check_group(group, native=native)
    assert not report.broken
    assert not native or report["native code"].verdict == "holds"
