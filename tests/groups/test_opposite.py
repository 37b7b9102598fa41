"""Right-invariant systems: the same equations in the other trivialisation, beside g -> g^-1 and Ad."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm

EPS = 2.0**-52

METHODS = (
    lm.RKMK(order=4),
    lm.CommutatorFree(order=4),
    lm.CovariantVariational(lm.Exponential()),
    lm.CovariantVariational(lm.Cayley()),
    lm.LiePoissonHamiltonJacobi(order=4),
    lm.Taylor(order=6),
)
INERTIAS = {lm.SO3(): [1.0, 1.6, 2.3], lm.SE3(): [1.0, 1.5, 2.0, 1.2, 1.6, 2.1], lm.SU(2): [1.0, 1.6, 2.3]}


@pytest.mark.sample(4)
@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("group", INERTIAS, ids=repr)
def test_inversion_makes_a_left_invariant_system_of_it(group: lm.LieGroup, method: lm.Method) -> None:
    """h = g^-1 has the body velocity -xi and, for an even energy, the momentum -mu."""
    energy, rng = lm.KineticEnergy(INERTIAS[group]), np.random.default_rng(1)
    mu, g = 0.7 * rng.normal(size=group.dim), group.random(rng)
    right = lm.LiePoissonSystem(lm.OppositeGroup(group), energy)
    left = lm.LiePoissonSystem(group, energy)
    options = dict(h=0.1, steps=10, compiled=False)
    ours = lm.integrate(right, method, right.state(mu=mu, g=g), **options)  # type: ignore[arg-type]
    theirs = lm.integrate(left, method, left.state(mu=-mu, g=group.inverse(g)), **options)  # type: ignore[arg-type]
    assert np.abs(ours.mu + theirs.mu).max() < 200 * EPS
    assert np.abs(ours.g - group.inverse(theirs.g)).max() < 400 * EPS * np.abs(ours.g).max()
    assert np.abs(ours.mu - ours.mu[0]).max() > 0.01


@pytest.mark.parametrize("group", [lm.SO3(), pytest.param(lm.SU(2), marks=pytest.mark.slow)], ids=repr)
def test_tangent_maps_on_both_sides_are_one(group: lm.LieGroup) -> None:
    """By h = g^-1 the direction g * exp(eta) = exp(eta) g is h exp(-eta), and -mu goes with -eta."""
    energy, mu = lm.KineticEnergy(INERTIAS[group]), np.array([0.4, -0.5, 0.9])
    g, maps = group.exp([0.3, -0.2, 0.5]), []
    for side, sign, element in (lm.OppositeGroup(group), 1.0, g), (group, -1.0, group.inverse(g)):
        system = lm.LiePoissonSystem(side, energy)
        plan = lm.Plan(system, lm.RKMK(order=4), 0.1, compiled=False)
        maps.append(plan.tangent(system.state(mu=sign * mu, g=element), steps=5).tangent["start"])
    assert np.abs(maps[0] - maps[1]).max() < 200 * EPS
    assert np.abs(maps[0][-1] - np.eye(6)).max() > 0.1


def test_the_equations() -> None:
    """g' = hat(xi) g and mu' = -ad*_xi mu, by differences; the momentum in the body is constant."""
    group, mu, h = lm.SE3(), np.array([0.4, -0.5, 0.9, 0.3, 0.7, -0.2]), 1e-3
    system = lm.LiePoissonSystem(lm.OppositeGroup(group), lm.KineticEnergy(INERTIAS[group]))
    g = group.exp([0.3, -0.2, 0.5, 1.0, 2.0, 3.0])
    xi = system.velocity(mu)
    there, back = (
        lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu, g=g), h=s, steps=1, compiled=False) for s in (h, -h)
    )
    rate_g, rate_mu = (there.g[-1] - back.g[-1]) / (2 * h), (there.mu[-1] - back.mu[-1]) / (2 * h)
    assert np.abs(rate_g - group.algebra.hat(xi) @ g).max() < 1e-5
    assert np.abs(rate_mu + group.ad_star(xi, mu)).max() < 1e-5
    run = lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu, g=g), h=0.05, steps=50, compiled=False)
    in_body = group.Ad_star(run.g, run.mu)
    assert np.abs(in_body - in_body[0]).max() < 1e-13
    assert np.abs(run.spatial_momentum - in_body).max() < 1e-13


def test_the_energy_that_both_sides_see() -> None:
    """With equal moments body and spatial angular velocity obey the same equation: g is the same."""
    group, mu = lm.SO3(), np.array([0.3, -0.4, 0.5])
    g = group.exp([0.1, 0.2, 0.3])
    sphere = lm.KineticEnergy([2.0, 2.0, 2.0])
    body = lm.LiePoissonSystem(group, sphere)
    space = lm.LiePoissonSystem(lm.OppositeGroup(group), sphere)
    options = dict(h=0.2, steps=10, compiled=False)
    method = lm.RKMK(order=4)
    one = lm.integrate(body, method, body.state(mu=mu, g=g), **options)  # type: ignore[arg-type]
    other = lm.integrate(space, method, space.state(mu=group.K(g, mu), g=g), **options)  # type: ignore[arg-type]
    assert np.abs(one.g - other.g).max() < 20 * EPS


def test_what_is_no_group_is_refused() -> None:
    with pytest.raises(lm.errors.InvalidType, match="group must be a LieGroup; got 3"):
        lm.OppositeGroup(3)
