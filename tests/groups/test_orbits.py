"""Coadjoint orbits: which momenta share one, how many dimensions it has, its tangents, its
brackets; Casimirs of generators.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import liemech as lm

SO3, SE3, SO4 = lm.SO3(), lm.SE3(), lm.SO(4)


def from_generators(group: lm.MatrixLieGroup) -> lm.MatrixLieGroup:
    return lm.MatrixLieGroup.of(group.generators)


# (group, dimension of a generic orbit, number of independent Casimirs)
GENERIC = (
    (SO3, 2, 1), (SE3, 4, 2), (lm.SE2(), 2, 1), (SO4, 4, 2), (lm.SO(5), 8, 2), (lm.SU(3), 6, 2), (lm.U(2), 2, 2), (lm.SL(2), 2, 1),
    (lm.Sp(4), 8, 2), (lm.Heisenberg(2), 4, 1), (lm.VectorSpace(3), 0, 3), (lm.SemidirectProduct(SO3), 4, 2),
    (lm.ProductGroup(SO3, lm.SE2()), 4, 2), (from_generators(lm.SO(3)), 2, 1), (from_generators(SO4), 4, 2),
    (from_generators(lm.SU(3)), 6, 2), (from_generators(lm.GL(3)), 6, 3), (from_generators(lm.Heisenberg()), 2, 1),
)  # fmt: skip
each = partial(pytest.mark.parametrize, "group, orbit, casimirs", GENERIC, ids=lambda x: repr(x)[:40])()


@each
def test_generic_orbits(group: lm.LieGroup, orbit: int, casimirs: int) -> None:
    """dim = orbit + isotropy; Casimirs are constant on it, independent, and their differentials span the isotropy."""
    action, rng = lm.coadjoint(group), np.random.default_rng(5)
    mu = rng.normal(size=group.dim)
    tangent, isotropy = action.tangent(mu), action.isotropy(mu)
    assert action.orbit_dimension(mu) == len(tangent) == orbit
    assert len(isotropy) == group.dim - orbit == casimirs
    size = np.abs(np.array(group.algebra.structure_constants)).max() * np.abs(mu).max()
    for xi in isotropy:
        assert np.abs(group.ad_star(xi, mu)).max() <= 64 * 2.0**-52 * size
    for xi in np.eye(group.dim):  # tangent vectors ad*_xi mu have no part outside the span
        moved = group.ad_star(xi, mu)
        rest = moved - np.linalg.lstsq(tangent.T, moved, rcond=None)[0] @ tangent if orbit else moved
        assert np.abs(rest).max() <= 1e-13 * size
    slopes = np.array(lm.jacobian(group.casimirs, mu))
    assert len(slopes) == casimirs
    assert (
        np.linalg.matrix_rank(np.vstack([slopes, isotropy]), tol=1e-10)
        == np.linalg.matrix_rank(slopes, tol=1e-10)
        == casimirs
    )


@pytest.mark.sample(3)
@each
def test_random_momenta_of_one_orbit(group: lm.LieGroup, orbit: int, casimirs: int) -> None:
    action, rng = lm.coadjoint(group), np.random.default_rng(6)
    mu = rng.normal(size=group.dim)
    for nu in action.random_on_orbit(mu, rng, size=4):
        assert action.on_same_orbit(mu, nu)
        assert action.on_same_orbit(2.0**-700 * mu, 2.0**-700 * nu)
    # a differential of Casimirs leads off the orbit where it does not vanish on itself
    off = action.isotropy(mu)[0]
    away = mu + 1e-6 * (np.array(lm.jacobian(group.casimirs, mu))[0] if abs(off @ off) else off)
    assert not action.on_same_orbit(mu, away)
    assert not action.on_same_orbit(mu, 0.0 * mu)
    assert action.orbit_dimension(0.0 * mu) == 0


def test_wrench_without_pitch_in_all_units() -> None:
    """Pi . P = 0: the Casimir is zero up to rounding, which is measured by |Pi| |P|; units of Pi and P are any."""
    action, rng = lm.coadjoint(SE3), np.random.default_rng(1)
    for _ in range(15):
        Pi, P = rng.normal(size=(2, 3))
        Pi -= (Pi @ P) / (P @ P) * P
        mu = np.concatenate([10.0 ** rng.integers(-9, 9) * Pi, 10.0 ** rng.integers(-9, 9) * P])
        nu = action.K(SE3.random(rng), mu)
        assert action.on_same_orbit(mu, nu)
        assert not action.on_same_orbit(mu, nu * [1, 1, 1, 1 + 1e-6, 1 + 1e-6, 1 + 1e-6])
        assert action.orbit_dimension(mu) == 4


def test_orbits_of_less_dimension() -> None:
    """se(3)* with P = 0: spheres of Pi, two dimensions.  so(4)* has 2-spheres too.  se(2)* and Heisenberg: points."""
    action = lm.coadjoint(SE3)
    assert not action.on_same_orbit([1.0, 0, 0, 0, 0, 0], [5.0, 0, 0, 0, 0, 0])
    assert action.on_same_orbit([1.0, 0, 0, 0, 0, 0], [0.0, 0, -1.0, 0, 0, 0])
    assert not action.on_same_orbit([1.0, 0, 0, 0, 0, 0], [1.0, 0, 0, 0, 1e-30, 0])
    assert action.orbit_dimension([1.0, 0, 0, 0, 0, 0]) == 2
    assert action.orbit_dimension([1.0, 0, 0, 0, 1e-30, 0]) == 4
    assert lm.coadjoint(SO4).orbit_dimension([1.0, 0, 0, 0, 0, 1.0]) == 2
    assert not lm.coadjoint(lm.SE2()).on_same_orbit([1.0, 0, 0], [2.0, 0, 0])
    assert not lm.coadjoint(lm.Heisenberg()).on_same_orbit([1.0, 0, 0], [1.0, 1e-3, 0])


@pytest.mark.sample(2)
@pytest.mark.parametrize("n", [2, 4, 6, 8])
def test_mirror_images_of_even_rotations(n: int) -> None:
    """K by a reflection keeps all traces of powers and changes the sign of the Pfaffian, whose
    square is the determinant.
    """
    group, rng = lm.SO(n), np.random.default_rng(n)
    mu = rng.normal(size=group.dim)
    m = group.algebra.hat(mu)
    mirror = np.diag([-1.0, *np.ones(n - 1)])
    nu = group.algebra.vee(mirror @ m @ mirror)
    assert group.casimirs(mu)[-1] == pytest.approx(-group.casimirs(nu)[-1], rel=1e-12)
    assert group.casimirs(mu)[-1] ** 2 == pytest.approx(np.linalg.det(m), rel=1e-10)
    assert not lm.coadjoint(group).on_same_orbit(mu, nu)
    if n == 4:
        assert group.casimirs(mu)[-1] == pytest.approx(mu[0] * mu[5] - mu[1] * mu[4] + mu[2] * mu[3], rel=1e-13)
        assert not lm.coadjoint(from_generators(group)).on_same_orbit(mu, nu)


def test_spheres_of_generators() -> None:
    action = lm.coadjoint(from_generators(lm.SO(3)))
    assert not action.on_same_orbit([1.0, 0, 0], [5.0, 0, 0])
    assert action.on_same_orbit([1.0, 0, 0], [0.0, -1.0, 0])
    assert action.casimirs([1.0, 2.0, 3.0]) == pytest.approx([14.0], rel=1e-15)


@pytest.mark.slow
def test_refused_where_it_is_not_known() -> None:
    """sp(2)*: mu and -mu on the two sheets of a hyperboloid have one Casimir, and no element leads
    from one to the other.
    """
    group = lm.Sp(2)
    m = np.array([[0.0, 1.0], [-1.0, 0.0]])
    mu = group.algebra.pairing(m)
    with pytest.raises(lm.errors.NotDefined, match="is not known"):
        lm.coadjoint(group).on_same_orbit(mu, -mu)
    assert lm.coadjoint(group).on_same_orbit(mu, group.algebra.pairing(m * [[1, 4.0], [0.25, 1]]))


def test_brackets_of_functions() -> None:
    """{mu_1, mu_2} = -mu_3; {F, H} is the rate of F along a motion; Jacobi; Casimirs commute with all."""
    bracket, rng = lm.coadjoint(SO3).poisson_bracket, np.random.default_rng(2)
    mu = rng.normal(size=3)
    first, second, third = (lambda m, i=i: m[i] * m[(i + 1) % 3] ** 2 + np.pi * m[i] for i in range(3))
    assert bracket(lambda m: m[0], lambda m: m[1])(mu) == -mu[2]
    body = lm.RigidBody([1.0, 1.5, 2.0])
    rate = np.dot(lm.gradient(first, mu), np.cross(mu, mu / [1.0, 1.5, 2.0]))
    assert bracket(first, body.hamiltonian.energy)(mu) == pytest.approx(rate, rel=1e-14)
    cyclic = [
        bracket(a, bracket(b, c))(mu)
        for a, b, c in ((first, second, third), (second, third, first), (third, first, second))
    ]
    assert abs(sum(cyclic)) <= 1e-14 * max(map(abs, cyclic))
    assert abs(bracket(first, lambda m: SO3.casimirs(m)[0])(mu)) <= 1e-15
    with pytest.raises(lm.errors.InvalidType, match="F must be a formula of momenta"):
        bracket(3.0, first)


def test_bad_momenta_are_named() -> None:
    action = lm.coadjoint(SE3)
    for ask in (action.orbit_dimension, action.tangent, action.isotropy, action.random_on_orbit):
        with pytest.raises(lm.errors.InvalidInput, match=r"mu must have shape \(6,\)"):
            ask([1.0, 2.0, 3.0])
    with pytest.raises(lm.errors.InvalidInput, match="every entry must be finite"):
        action.isotropy([1.0, 2.0, 3.0, np.nan, 0.0, 0.0])


@pytest.mark.parametrize(
    "mu, why", [((), "shape"), ([1.0, 2.0], "shape"), (len, "real numbers"), ([np.nan] * 6, "finite")]
)
def test_further_invariants_are_of_one_momentum(mu: object, why: str) -> None:
    with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=f"SE3.further_invariants: mu.*{why}"):
        lm.SE3().further_invariants(mu)


def test_further_invariants_take_a_momentum_as_a_list() -> None:
    assert lm.SE3().further_invariants([3.0, 0.0, 4.0, 0.0, 0.0, 0.0]) == (5.0,)
    assert lm.Heisenberg().further_invariants((1.0, 2.0, 0.0)) == (1.0, 2.0, 0.0)


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_an_orbit_has_the_dimension_of_the_orbit_of_a_multiple(size: float) -> None:
    for group in (lm.SO3(), lm.SE3(), lm.SO(4)):
        action, mu = lm.coadjoint(group), np.linspace(0.3, 1.0, group.dim)
        assert action.orbit_dimension(size * mu) == action.orbit_dimension(mu) > 0
        assert len(action.tangent(size * mu)) == action.orbit_dimension(mu)
