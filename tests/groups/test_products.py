"""Vector spaces, direct and semidirect products: the laws of groups, each part as it is on its own,
and rigid motions twice.
"""

from __future__ import annotations

import json
import pickle
from functools import partial
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from bare import map_of
from scenes import hat, slope

import liemech as lm
from liemech.groups.representations import AdjointAction, Representation, RotationAction

EPS = 2.0**-52
HEAVY_TOP = json.loads((Path(__file__).parent.parent / "reference" / "heavy_top.json").read_text())

SO3, SE3, Q, SL2 = lm.SO3(), lm.SE3(), lm.UnitQuaternions(), lm.SL(2)
RIGID = lm.SemidirectProduct(SO3)

PRODUCTS = (
    lm.ProductGroup(SO3, lm.VectorSpace(3)),
    lm.ProductGroup(lm.ProductGroup(SO3, lm.VectorSpace(1)), Q),
    lm.ProductGroup(lm.SU(2), lm.VectorSpace(2)),
    lm.ProductGroup(RIGID, lm.VectorSpace(1)),
)
SEMIDIRECT = (
    RIGID,
    lm.SemidirectProduct(SO3, lm.actions.LinearAction(SO3)),
    lm.SemidirectProduct(Q),
    lm.SemidirectProduct(SL2),
    lm.SemidirectProduct(lm.Heisenberg()),
    lm.SemidirectProduct(SO3, lm.actions.CoadjointAction(SO3)),
    lm.SemidirectProduct(SL2, AdjointAction(SL2)),
)

each = partial(pytest.mark.parametrize, "group", ids=repr)


"""Series and iterations in plain Python: some seconds each."""


# ---------------------------------------------------------------- vector spaces


def test_a_vector_space_adds_no_operation(rng: np.random.Generator) -> None:
    """Nothing but sums, bit for bit."""
    G, (g, xi, eta, mu) = lm.VectorSpace(3), rng.normal(size=(4, 3))
    for name in ("dexp", "dexp_inv", "dcayley", "dcayley_inv"):
        assert np.array_equal(map_of(G, name)(xi, eta), eta)
        assert np.array_equal(map_of(G, name + "_dual")(xi, mu), mu)
    for terms in range(6):
        assert np.array_equal(G.algebra.dexp_inv_series(xi, eta, terms), eta)
    for name in ("exp", "log", "cayley", "cayley_inv", "casimirs"):
        assert np.array_equal(map_of(G, name)(xi), xi)
    for name in ("compose", "compose_exp", "compose_cayley"):
        assert np.array_equal(map_of(G, name)(g, xi), g + xi)
    for name in ("Ad_star", "exp_Ad_star", "cayley_Ad_star", "K"):
        assert np.array_equal(map_of(G, name)(g, mu), mu)
    assert np.array_equal(G.inverse(g), -g)
    assert G.distance(g, eta) == pytest.approx(np.linalg.norm(g - eta), rel=4 * EPS)


def test_every_retraction_serves_a_vector_space() -> None:
    for retraction in (lm.Exponential(), lm.Cayley()):
        retraction.require(lm.VectorSpace(2))
    with pytest.raises(lm.errors.InvalidInput, match="integer"):
        lm.VectorSpace(2.5)
    with pytest.raises(lm.errors.InvalidInput, match="smallest"):
        lm.VectorSpace(0)


# ---------------------------------------------------------------- direct products


def parts_of(group: lm.ProductGroup, x: np.ndarray) -> list[np.ndarray]:
    """Coordinates of the factors."""
    return np.split(x, np.cumsum([f.dim for f in group.factors])[:-1], axis=-1)


@each(PRODUCTS)
def test_every_map_is_that_of_the_factors(group: lm.ProductGroup, rng: np.random.Generator) -> None:
    """To the last bit: a product delegates, and computes nothing."""
    xi, eta, mu = 0.7 * rng.normal(size=(3, group.dim))
    g, h = group.random(rng, 2)
    tests = {
        "exp": (xi,), "log": (g,), "inverse": (g,), "compose": (g, h), "Ad": (g, xi), "Ad_star": (g, mu), "K": (g, mu),
        "exp_Ad_star": (xi, mu), "compose_exp": (g, xi), "dexp": (xi, eta), "dexp_inv": (xi, eta), "dexp_dual": (xi, mu),
        "dexp_inv_dual": (xi, mu), "ad": (xi, eta), "ad_star": (xi, mu), "casimirs": (mu,),
        "cayley": (xi,), "cayley_Ad_star": (xi, mu), "compose_cayley": (g, xi), "dcayley": (xi, eta), "dcayley_inv": (xi, eta),
        "dcayley_dual": (xi, mu), "dcayley_inv_dual": (xi, mu),
    }  # fmt: skip
    elements = [id(g), id(h)]
    for name, args in tests.items():
        shares = [group.split(a) if id(a) in elements else parts_of(group, a) for a in args]
        whole = map_of(group, name)(*args)
        found = [map_of(f, name)(*share) for f, *share in zip(group.factors, *shares, strict=True)]
        if name in ("exp", "inverse", "compose", "compose_exp", "cayley", "compose_cayley"):
            assert np.array_equal(whole, group.join(*found)), name
        else:
            assert np.array_equal(whole, np.concatenate(found)), name


@each([*PRODUCTS, *SEMIDIRECT])
def test_join_and_split(group: lm.ProductGroup) -> None:
    g = group.random(3, (4, 2))
    split = group.split(g)
    assert np.array_equal(group.join(*split), g)
    assert all(part.shape[:2] == (4, 2) for part in split)
    one = group.split(g[1, 1])
    assert all(np.array_equal(a, b[1, 1]) for a, b in zip(one, split, strict=True))
    stretched = group.join(split[0][0, 0], split[1])  # leading axes broadcast
    assert np.array_equal(stretched[3, 1], group.join(split[0][0, 0], split[1][3, 1]))
    assert pickle.loads(pickle.dumps(group)) == group


def test_complex_factors_are_real_numbers_in_the_product() -> None:
    group = lm.ProductGroup(lm.SU(2), lm.VectorSpace(1))
    u = lm.SU(2).random(1)
    g = group.join(u, [5.0])
    assert g.shape == (9,)
    assert g.dtype == float
    assert np.array_equal(g[:8].view(complex).reshape(2, 2), u)
    assert g[8] == 5.0


def test_products_name_the_factor_at_fault() -> None:
    group = PRODUCTS[0]
    off = group.join(np.diag([1.0, 1.0, -1.0]), np.zeros(3))
    with pytest.raises(lm.errors.InvalidInput, match=r"in factor 1, SO3\(\), its determinant is -1"):
        group.inverse(off)
    assert not group.contains(off)
    assert group.contains(group.nearest(group.join(np.diag([1.0, 1.0, -0.9]), np.zeros(3))))
    with pytest.raises(lm.errors.InvalidInput, match="as close to one rotation as to others"):
        group.nearest(off)
    with pytest.raises(lm.errors.InvalidInput, match="element 2 has shape"):
        group.join(np.eye(3), np.zeros(2))
    with pytest.raises(lm.errors.InvalidInput, match="do not broadcast"):
        group.join(np.ones((2, 3, 3)), np.zeros((4, 3)))
    with pytest.raises(lm.errors.InvalidType, match="must be real"):
        group.join(1j * np.eye(3), np.zeros(3))
    assert group.join(np.empty((0, 3, 3)), np.zeros(3)).shape == (0, 12)
    assert group.algebra.parts(np.arange(6.0))[1].tolist() == [3.0, 4.0, 5.0]
    with pytest.raises(lm.errors.InvalidInput, match="3 elements for 2 factors"):
        group.join(np.eye(3), np.zeros(3), np.zeros(3))
    with pytest.raises(lm.errors.InvalidType, match=r"factor 2 must be a LieGroup.*brackets"):
        lm.ProductGroup(SO3, lm.SO3)
    with pytest.raises(lm.errors.InvalidInput, match="at least one"):
        lm.ProductGroup()
    without = lm.ProductGroup(SO3, lm.SL(3))
    assert "its factor SL(3) has none" in str(without.why_no_cayley())
    with pytest.raises(lm.errors.IncompatibleSystem, match="SL"):
        lm.Cayley().require(without)


def test_a_product_moves_as_its_factors_do_on_their_own() -> None:
    group = lm.ProductGroup(SO3, SO3)
    mu, moments = (np.array([0.4, -0.5, 0.7, 1.0, 0.2, -0.3]), np.array([1.0, 1.6, 2.3, 0.5, 0.8, 1.1]))
    for method in (lm.RKMK(order=4), lm.CovariantVariational(lm.Exponential()), lm.CovariantVariational(lm.Cayley())):
        both = lm.LiePoissonSystem(group, lm.KineticEnergy(moments))
        run = lm.integrate(both, method, both.state(mu, group.identity()), h=0.1, steps=20, compiled=False)
        for half in (slice(0, 3), slice(3, 6)):
            one = lm.LiePoissonSystem(SO3, lm.KineticEnergy(moments[half]))
            alone = lm.integrate(one, method, one.state(mu[half], np.eye(3)), h=0.1, steps=20, compiled=False)
            assert np.abs(alone.mu - run.mu[:, half]).max() <= 64 * EPS
            assert np.abs(alone.g - group.split(run.g)[half.start // 3]).max() <= 64 * EPS


# ---------------------------------------------------------------- semidirect products


def close(a: object, b: object, ulps: float = 32.0) -> bool:
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return bool(np.abs(a - b).max() <= ulps * EPS * max(1.0, np.abs(b).max()))


SIZES = [0.0, 1e-8, 0.3, 1.0, 3.1, 6.2]


def screws(size: float, n: int = 4) -> np.ndarray:
    """Velocities of SE(3) with an angular part of this length."""
    xi = np.random.default_rng(7).normal(size=(n, 6))
    xi[:, :3] *= size / np.linalg.norm(xi[:, :3], axis=1, keepdims=True)
    return xi


def as_matrix(g: np.ndarray) -> np.ndarray:
    R, p = RIGID.split(g)
    return np.block([[R, p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


@pytest.mark.parametrize("size", SIZES)
@each([SEMIDIRECT[0], SEMIDIRECT[1]])
def test_rigid_motions_once_more(group: lm.SemidirectProduct, size: float, rng: np.random.Generator) -> None:
    """In the coordinates of SE3: one algebra, one exponential and one product make all else."""
    assert close(group.algebra.structure_constants, SE3.algebra.structure_constants)
    for xi in screws(size):
        g = group.random(rng)
        assert close(group.matrix(g), as_matrix(g))
        assert close(as_matrix(group.exp(xi)), SE3.exp(xi)) and close(as_matrix(group.cayley(xi)), SE3.cayley(xi))
        assert close(as_matrix(group.compose_exp(g, xi)), SE3.compose_exp(as_matrix(g), xi))
        assert close(group.log(g), SE3.log(as_matrix(g)), 128)


def test_casimirs_of_rigid_motions(rng: np.random.Generator) -> None:
    mu = rng.normal(size=6)
    for group in (RIGID, lm.SemidirectProduct(Q)):
        assert close(group.casimirs(mu), SE3.casimirs(mu))
    # of C = |p|^2: dC(p) . mu = 2 p . mu
    tangent = lm.SemidirectProduct(SO3, AdjointAction(SO3)).casimirs(mu)
    assert close(tangent, [1.0, 2.0] * SE3.casimirs(mu))


def test_quaternions_with_displacements_cover_rigid_motions(rng: np.random.Generator) -> None:
    group = lm.SemidirectProduct(Q)
    g, h = group.random(rng, 2)
    xi = rng.normal(size=6)
    assert close(group.matrix(group.compose(g, h)), group.matrix(g) @ group.matrix(h))
    assert close(group.matrix(group.exp(xi)), SE3.exp(xi))
    assert close(group.matrix(group.cayley(xi)), SE3.cayley(xi))
    assert close(group.Ad(g, xi), SE3.Ad(group.matrix(g), xi))


@pytest.mark.parametrize("size", [0.0, 1e-8, 0.5, 3.0])
def test_affine_maps_by_matrices(size: float, rng: np.random.Generator) -> None:
    """SL(2) with the plane: exponentials of 3 by 3 matrices, in 40 digits, for SciPy's lose thousands of eps."""
    group = lm.SemidirectProduct(SL2)
    xi = rng.normal(size=5)
    xi[:3] *= size / np.linalg.norm(xi[:3])
    generator = np.zeros((3, 3))
    generator[:2, :2], generator[:2, 2] = SL2.algebra.hat(xi[:3]), xi[3:]
    with mp.workdps(40):
        exact = mp.expm(mp.matrix(generator.tolist()), method="taylor").tolist()
    assert close(group.matrix(group.exp(xi)), exact, 8)
    half = 0.5 * generator
    assert close(
        group.matrix(group.cayley(0.3 * xi)), np.linalg.solve(np.eye(3) - 0.3 * half, np.eye(3) + 0.3 * half), 64
    )
    g, h = group.random(rng, 2)
    assert close(group.matrix(group.compose(g, h)), group.matrix(g) @ group.matrix(h))
    assert close(group.matrix(group.inverse(g)) @ group.matrix(g), np.eye(3), 4 * np.linalg.cond(group.matrix(g)))


@lm.record
class OnThePlane(Representation):
    """2 by 2 matrices on the plane, by a user who writes what he must."""

    @property
    def space_dim(self) -> int:
        return 2

    def act(self, g: lm.Element, x: lm.Vec) -> lm.Vec:
        return lm.vec(g[0, 0] * x[0] + g[0, 1] * x[1], g[1, 0] * x[0] + g[1, 1] * x[1])


def test_a_representation_of_ones_own() -> None:
    """What follows from `act` alone agrees with the closed forms."""
    own, closed = lm.SemidirectProduct(SL2, OnThePlane(SL2)), lm.SemidirectProduct(SL2)
    rng = np.random.default_rng(8)
    g, xi, mu = own.random(rng), rng.normal(size=5), rng.normal(size=5)
    assert "does not act as" in str(own.why_no_cayley())
    for name, args in {
        "Ad": (g, xi),
        "Ad_star": (g, mu),
        "exp": (xi,),
        "dexp_dual": (xi, mu),
        "ad_star": (xi, mu),
    }.items():
        assert close(map_of(own, name)(*args), map_of(closed, name)(*args), 128), name


@lm.record
class Squeezed(RotationAction):
    """Rotations in coordinates in which spheres are ellipsoids."""

    def act(self, g: lm.Element, x: lm.Vec) -> lm.Vec:
        y = self.group.Ad(g, lm.vec(0.5 * x[0], x[1], x[2]))
        return lm.vec(2.0 * y[0], y[1], y[2])


def test_rotations_in_other_coordinates_have_no_casimirs_of_rotations() -> None:
    """p.p changes along an orbit, and does not tell it from others."""
    group = lm.SemidirectProduct(SO3, Squeezed(SO3))
    mu = np.array([0.3, -0.2, 0.5, 0.7, 0.4, -0.6])
    orbits = lm.coadjoint(group)
    moved = orbits.K(group.exp([0.4, 0.3, -0.5, 0.2, 0.6, 0.1]), mu)
    assert abs(moved[3:] @ moved[3:] - mu[3:] @ mu[3:]) > 0.05
    assert not len(group.casimirs(mu)) and group.further_invariants(mu) is None
    assert orbits.on_same_orbit(mu, moved)


def test_wrong_semidirect_products() -> None:
    with pytest.raises(lm.errors.InvalidType, match="acting must be a LieGroup"):
        lm.SemidirectProduct(lm.SO3)
    with pytest.raises(lm.errors.InvalidType, match="action must be a Representation"):
        lm.SemidirectProduct(SO3, lm.actions.SphereAction(3))
    with pytest.raises(lm.errors.InvalidInput, match="is no action of SO3"):
        lm.SemidirectProduct(SO3, RotationAction(Q))
    with pytest.raises(lm.errors.InvalidInput, match="complex, not real matrices"):
        lm.SemidirectProduct(lm.SU(2))
    with pytest.raises(lm.errors.InvalidInput, match=r"of its part in SO3\(\)"):
        RIGID.inverse(np.ones(12))
    with pytest.raises(lm.errors.IncompatibleSystem, match="does not act as"):
        SEMIDIRECT[5].cayley(np.ones(6))


# ---------------------------------------------------------------- the heavy top


@lm.record
class HeavyTop(lm.Hamiltonian):
    """pi . J^-1 pi/2 + chi . Gamma, on the dual of the rigid motions; chi holds weight and lever arm."""

    moments: lm.Vec
    chi: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        xi = self.gradient(mu)
        return 0.5 * (mu[0] * xi[0] + mu[1] * xi[1] + mu[2] * xi[2]) + (mu[3] * xi[3] + mu[4] * xi[4] + mu[5] * xi[5])

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return lm.vec(*[mu[i] / self.moments[i] for i in range(3)], *self.chi)


def heavy_top(group: lm.LieGroup) -> tuple[lm.LiePoissonSystem, np.ndarray, np.ndarray]:
    """The system, its start, and the exact state after two units of time."""
    J, mgl, chi, pi, R = (np.array(HEAVY_TOP[k], dtype=float) for k in ("J", "mgl", "chi", "pi0", "R0"))
    at_two = next(s for s in HEAVY_TOP["samples"] if float(s["t"]) == 2.0)
    exact = np.array(at_two["pi"] + at_two["Gamma"], dtype=float)
    return lm.LiePoissonSystem(group, HeavyTop(J, mgl * chi)), np.concatenate([pi, R[2]]), exact


@each([RIGID, lm.SemidirectProduct(Q)])
def test_heavy_top_converges_with_order_4_to_the_exact_motion(group: lm.SemidirectProduct) -> None:
    system, start, exact = heavy_top(group)
    errors, steps = [], [20, 40, 80]
    for n in steps:
        run = lm.integrate(system, lm.RKMK(order=4), system.state(start), h=2.0 / n, steps=n, compiled=False)
        errors.append(np.abs(run.mu[-1] - exact).max())
        kept = group.casimirs(run.mu)
        assert np.abs(kept - kept[0]).max() <= 64 * EPS
    assert slope([2.0 / n for n in steps], errors) == pytest.approx(4.0, abs=0.15)
    assert errors[-1] < 1e-5


def test_energy_and_casimirs_of_the_heavy_top() -> None:
    system, start, exact = heavy_top(RIGID)
    for mu in (start, exact):
        assert system.energy(mu) == pytest.approx(float(HEAVY_TOP["energy"]), rel=16 * EPS)
        length, vertical = RIGID.casimirs(mu)
        assert length == pytest.approx(1.0, abs=16 * EPS)
        assert vertical == pytest.approx(float(HEAVY_TOP["vertical_momentum_pi_dot_Gamma"]), rel=16 * EPS)


def test_equations_of_the_heavy_top(rng: np.random.Generator) -> None:
    """pi' = pi x w + Gamma x chi, Gamma' = Gamma x w."""
    system, _, _ = heavy_top(RIGID)
    mu = rng.normal(size=6)
    xi = system.velocity(mu)
    w, chi = xi[:3], xi[3:]
    expected = np.concatenate([np.cross(mu[:3], w) + np.cross(mu[3:], chi), np.cross(mu[3:], w)])
    assert np.abs(RIGID.ad_star(xi, mu) - expected).max() <= 8 * EPS
    assert np.abs(hat(w) @ mu[3:] + RIGID.ad_star(xi, mu)[3:]).max() <= 8 * EPS
