"""Many sites on T*G, momenta and places in one term: rates by hand, DOP853, one body written out, plain and native runs."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput
from liemech.formulas import cos

J, CHARGE, WEIGHT, FIELD, COUPLING = (
    np.array([1.0, 1.6, 2.3]),
    np.array([1.1, 0.7, 1.3]),
    np.array([0.3, 0.0, 0.8]),
    1.2,
    0.1,
)
SO3 = lm.SO3()


@lm.record
class ChargedTop(lm.Term):
    """A heavy top whose charges are in a vertical field."""

    inertia: lm.Vec
    charge: lm.Vec
    weight: lm.Vec

    def energy(self, a: Any) -> float:
        v = a.mu - (0.5 * a.field) * (self.charge * a.g[2])
        return 0.5 * lm.dot(v, v / self.inertia) + lm.dot(self.weight, a.g[2])


@lm.record
class Moments(lm.Term):
    """Two moments along the momenta in space, K_g mu."""

    strength: float

    def energy(self, a: Any, b: Any) -> float:
        return self.strength * lm.dot(SO3.K(a.g, a.mu), SO3.K(b.g, b.mu))


TOP = ChargedTop(J, CHARGE, WEIGHT)


class Ring(lm.CotangentSites):
    """Such tops in a ring; the field is vertical, so that a turn of all about the vertical changes nothing."""

    def symmetry(self, mu: Any, g: Any) -> dict[str, Any]:
        return {"vertical momentum": np.einsum("...ij,...ij->...", g[..., 2, :], mu)}


def ring(n: int, **options: Any) -> Ring:
    return Ring(SO3**n, lm.Terms(TOP, Moments(COUPLING).over(lm.neighbours.ring(n)), field=FIELD, **options))


def started(system: Any, n: int) -> Any:
    rng = np.random.default_rng(5)
    return system.state(mu=rng.normal(size=(n, 3)), g=SO3.random(rng, n))


def by_hand(mu: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """xi = J^-1 (mu - A) + g^T B, f = -(M v/2) x (g^T b) + g^T e3 x w + (g^T B) x mu, B the sum of the moments beside."""
    moments = np.einsum("nij,nj->ni", g, mu)
    beside = COUPLING * (np.roll(moments, 1, axis=0) + np.roll(moments, -1, axis=0))
    felt, vertical = np.einsum("nij,ni->nj", g, beside), g[:, 2]
    v = (mu - 0.5 * FIELD * CHARGE * vertical) / J
    pull = WEIGHT - 0.5 * FIELD * CHARGE * v
    return v + felt, np.cross(vertical, pull) + np.cross(felt, mu)


@pytest.mark.parametrize("n", [3, 200])
def test_velocities_and_forces_are_those_by_hand(n: int) -> None:
    """Of few sites by formulas that are written out, of many by arrays."""
    system = ring(n)
    start = started(system, n)
    mu, g = np.asarray(start.mu), np.asarray(start.g)
    xi, f = by_hand(mu, g)
    np.testing.assert_allclose(np.reshape(system.velocity(mu, g), (n, 3)), xi, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(np.reshape(system.force(mu, g), (n, 3)), f, rtol=0.0, atol=1e-14)
    moments = np.einsum("nij,nj->ni", g, mu)
    v = mu - 0.5 * FIELD * CHARGE * g[:, 2]
    energy = 0.5 * (v * v / J).sum() + (g[:, 2] @ WEIGHT).sum() + COUPLING * (moments * np.roll(moments, 1, 0)).sum()
    np.testing.assert_allclose(system.energy(mu, g), energy, rtol=1e-13)


def exact(start: Any, t: float) -> np.ndarray:
    """Momenta and elements at time t, (sites, 12), by DOP853."""

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        rows = y.reshape(-1, 12)
        mu, g = rows[:, :3], rows[:, 3:].reshape(-1, 3, 3)
        xi, f = by_hand(mu, g)
        turned = np.cross(g, xi[:, None, :])  # the rows of g hat(xi)
        return np.concatenate([np.cross(mu, xi) + f, turned.reshape(-1, 9)], axis=1).ravel()

    y = np.concatenate([start.mu, np.reshape(start.g, (-1, 9))], axis=1).ravel()
    return solve_ivp(rate, (0.0, t), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1].reshape(-1, 12)


@pytest.mark.slow
@pytest.mark.parametrize("method", [*map(lm.SymplecticRKMK, (2, 4, 6)), lm.RKMK(order=4)], ids=lambda m: m.name)
def test_orders_beside_dop853(method: Any) -> None:
    system = ring(5)
    start = started(system, 5)
    end, errors = exact(start, 1.0), []
    for n in (8, 16):
        run = lm.integrate(system, method, start, h=1.0 / n, steps=n, every=n, compiled=True, progress=False)
        errors.append(np.abs(np.concatenate([run.mu[-1], run.g[-1].reshape(-1, 9)], axis=1) - end).max())
    assert abs(np.log2(errors[0] / errors[1]) - method.order) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.SymplecticRKMK(2), lm.RKMK(order=4)], ids=lambda m: m.name)
def test_plain_and_native_steps_have_the_same_bits(method: Any) -> None:
    system = ring(7)
    start = started(system, 7)
    runs = [lm.integrate(system, method, start, h=0.1, steps=1, compiled=c, progress=False) for c in (False, True)]
    assert np.array_equal(runs[0].mu, runs[1].mu) and np.array_equal(runs[0].g, runs[1].g)


@pytest.mark.slow
def test_many_sites() -> None:
    """Of 10^4 sites the vertical momentum stays, to the rounding of its terms, and the energy is that to the order."""
    system, errors = ring(10_000), []
    start = started(system, 10_000)
    for h in (0.1, 0.05):
        run = lm.integrate(system, lm.SymplecticRKMK(2), start, h=h, t_end=0.5, every=10**6, progress=False)
        drift = run.drift()
        assert drift["vertical momentum"].verdict == "exact"
        errors.append(abs(np.diff(run.energy)[-1]))
    assert abs(np.log2(errors[0] / errors[1]) - 2.0) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_the_two_form_of_all_sites(order: int) -> None:
    pair = lm.CotangentSites(
        SO3**2, lm.Terms(TOP, Moments(COUPLING).over(lm.neighbours.edges([(0, 1)])), field=lm.each([1.2, 0.4]))
    )
    lm.check_method(lm.SymplecticRKMK(order), pair, started(pair, 2))


# ---------------------------------------------------------------- one body written out


@lm.record
class InFieldOfMoments(lm.CotangentSystem):
    """One of the tops, beside moments that rest."""

    configurations: ClassVar[lm.LieGroup] = SO3

    beside: lm.Vec

    def energy(self, mu: lm.Vec, g: Any) -> float:
        v = mu - (0.5 * FIELD) * (lm.Vec.of(CHARGE) * g[2])
        own = 0.5 * lm.dot(v, v / lm.Vec.of(J)) + lm.dot(lm.Vec.of(WEIGHT), g[2])
        return own + lm.dot(self.beside, SO3.K(g, mu))


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.SymplecticRKMK(2), lm.SymplecticRKMK(4)], ids=lambda m: m.name)
def test_a_site_among_held_ones_is_one_body_written_out(method: Any) -> None:
    """Sites that are held keep momenta and places, and others feel them."""
    system = ring(4, held=[0, 2, 3])
    start = started(system, 4)
    run = lm.integrate(system, method, start, h=0.1, steps=3, compiled=True, progress=False)
    mu, g = np.asarray(start.mu), np.asarray(start.g)
    for i in (0, 2, 3):
        assert np.array_equal(run.mu[-1, i], mu[i]) and np.array_equal(run.g[-1, i], g[i])
    alone = InFieldOfMoments(COUPLING * (g[0] @ mu[0] + g[2] @ mu[2]))
    wanted = lm.integrate(alone, method, alone.state(mu[1], g[1]), h=0.1, steps=3, compiled=False)
    np.testing.assert_allclose(run.mu[-1, 1], wanted.mu[-1], rtol=0.0, atol=4e-15)
    np.testing.assert_allclose(run.g[-1, 1], wanted.g[-1], rtol=0.0, atol=4e-15)


# ---------------------------------------------------------------- frames that move, species, refusals


@lm.record
class OnRockingBase(lm.Term):
    """A free body, its place told from a base that turns about a horizontal axis, to the angle sin t."""

    inertia: lm.Vec

    def energy(self, a: Any, t: float) -> float:
        return 0.5 * lm.dot(a.mu, a.mu / self.inertia) - cos(t) * lm.dot(a.g[0], a.mu)


@pytest.mark.slow
def test_bodies_on_a_rocking_base() -> None:
    """Each is a free body, turned back; energies that change with time are not among what is kept."""
    system = lm.DrivenCotangentSites(SO3**4, lm.Terms(OnRockingBase(J)))
    start = started(system, 4)
    run = lm.integrate(system, lm.SymplecticRKMK(4), start, h=0.02, steps=50, every=50, compiled=True, progress=False)
    base, body = np.asarray(SO3.exp([np.sin(1.0), 0.0, 0.0])), lm.RigidBody(J)
    for i in range(4):
        end = body.exact(body.state(mu=start.mu[i], g=start.g[i]), 1.0)
        np.testing.assert_allclose(run.mu[-1, i], end.mu, atol=1e-6)
        np.testing.assert_allclose(base @ run.g[-1, i], end.g, atol=1e-6)
    assert "energy" not in [quantity.name for quantity in run.drift().kept]


def test_sites_of_several_species() -> None:
    """Charged tops, and bodies in space that meet nobody, which move as they do alone."""
    space = lm.KineticEnergy([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    both = lm.CotangentSites(
        SO3**2 * lm.SE3() ** 2, lm.Terms(TOP.over(of=0), lm.PerSite(space).over(of=1), field=FIELD)
    )
    rng = np.random.default_rng(4)
    mu, g = (rng.normal(size=(2, 3)), rng.normal(size=(2, 6))), (SO3.random(rng, 2), lm.SE3().random(rng, 2))
    run = lm.integrate(both, lm.RKMK(order=4), both.state(mu=mu, g=g), h=0.05, steps=2, compiled=False)
    tops = lm.CotangentSites(SO3**2, lm.Terms(TOP, field=FIELD))
    wanted = lm.integrate(tops, lm.RKMK(order=4), tops.state(mu[0], g[0]), h=0.05, steps=2, compiled=False)
    free = lm.LiePoissonSystem(lm.SE3(), space)
    alone = lm.integrate(free, lm.RKMK(order=8), free.state(mu[1][1], g[1][1]), h=0.05, steps=2, compiled=False)
    np.testing.assert_allclose(run.mu[0][-1], wanted.mu[-1], atol=1e-14)
    np.testing.assert_allclose(run.mu[1][-1, 1], alone.mu[-1], atol=1e-6)


def test_what_does_not_fit_is_named() -> None:
    mixed = lm.Terms(TOP, field=FIELD)
    with pytest.raises(InvalidInput, match="terms in both to CotangentSites"):
        lm.MechanicalSystem(lm.LiePoissonSystem(SO3**3, lm.PerSite(lm.KineticEnergy(J))), mixed)
    with pytest.raises(InvalidInput, match="changes with time: make it DrivenCotangentSites"):
        lm.CotangentSites(SO3**3, lm.Terms(OnRockingBase(J)))
    with pytest.raises(InvalidInput, match="pinned"):
        lm.CotangentSites(lm.SE3() ** 3, lm.Terms(lm.PerSite(lm.KineticEnergy([1.0] * 6)), pinned=[1]))
    with pytest.raises(InvalidInput, match=r"terms, such as Terms\("):
        lm.CotangentSites(SO3**3, 3.0)
    with pytest.raises(IncompatibleSystem, match=r"write SO3\(\) \*\* sites"):
        lm.CotangentSites(SO3, mixed)
    for method in (lm.LieVerlet(), lm.KickDrift(), lm.GalerkinVariational(order=2)):
        with pytest.raises(IncompatibleSystem, match="MechanicalSystem"):
            lm.integrate(ring(5), method, started(ring(5), 5), h=0.1, steps=1)
