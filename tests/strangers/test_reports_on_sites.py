"""Situations in which users of other packages met wrong spins, masses or molecules: repository and number of each
report, the value by a closed form, by DOP853 or by what is conserved.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from terms_of_spins import Exchange, Twist, Zeeman

import liemech as lm


@lm.record
class Spring(lm.Term):
    """Two masses that are held together, without a length of rest."""

    k: float

    def energy(self, a, b):
        d = a.g - b.g
        return 0.5 * self.k * lm.dot(d, d)


@lm.record
class Tie(lm.Term):
    """Points of two bodies beside their centres, held together."""

    k: float

    def energy(self, a, b):
        d = a.g[:3, 3] - b.g[:3, 3] + 0.1 * (a.g[:3, 0] - b.g[:3, 0])
        return 0.5 * self.k * lm.dot(d, d)


def spins(n: int, *terms: Any, **more: Any) -> Any:
    return lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(*terms, **more))


def masses(n: int, *terms: Any, mass: float = 1.0, **more: Any) -> Any:
    free = lm.LiePoissonSystem(lm.VectorSpace(3) ** n, lm.PerSite(lm.KineticEnergy([mass] * 3)))
    return lm.MechanicalSystem(free, lm.Terms(*terms, **more))


def directions(n: int, seed: int = 0) -> Any:
    rows = np.random.default_rng(seed).normal(size=(n, 3))
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def test_a_spin_turns_about_its_field_in_the_sense_of_the_bracket() -> None:
    """SunnySuite/Sunny.jl#190, #247: the sign of the moment and the direction of time were wrong together.
    mu' = mu x dH/dmu with H = -B . mu: a spin along x in a field along z turns towards y, at the rate B.
    """
    system = spins(6, Zeeman([0.0, 0.0, 2.0]))
    run = lm.integrate(system, lm.RKMK(order=4), system.state(mu=[[1.0, 0.0, 0.0]] * 6), h=0.05, steps=10)
    assert np.allclose(run.mu[-1], [np.cos(1.0), np.sin(1.0), 0.0], rtol=0.0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("pair", [(0, 1), (1, 0)])
@pytest.mark.parametrize("n", [2, 8])
def test_a_bond_turns_both_of_its_spins(n: int, pair: tuple[int, int]) -> None:
    """SunnySuite/Sunny.jl#106: the reverse of a bond was missing.  Two spins turn about their sum S at the rate J |S|."""
    mu = directions(n)
    system = spins(n, Exchange(1.5).over(lm.neighbours.edges([pair], sites=n)))
    run = lm.integrate(system, lm.RKMK(order=8), system.state(mu=mu), h=0.05, steps=20)
    together = mu[0] + mu[1]
    turn = Rotation.from_rotvec(1.5 * together * 1.0).as_matrix()
    for k in (0, 1):
        assert np.allclose(run.mu[-1, k], turn @ mu[k], rtol=0.0, atol=1e-9)
    assert np.array_equal(run.mu[-1, 2:], mu[2:])


@pytest.mark.slow
def test_workers_come_to_an_end_where_many_spins_are_held() -> None:
    """lammps/lammps#4903: threads hung when some atoms did not take part."""
    n = 2**15
    mu, held = directions(n, 3), np.arange(0, n, 3)
    system = spins(n, Exchange(1.0).over(lm.neighbours.ring(n)), held=held)
    ends = [
        lm.integrate(
            system, lm.RKMK(order=4), system.state(mu=mu), h=0.1, steps=2, every=2, workers=k, progress=False
        ).mu[-1]
        for k in (1, 2)
    ]
    assert np.array_equal(*ends) and np.array_equal(ends[0][held], mu[held])
    assert (ends[0][1::3] != mu[1::3]).any(axis=1).all()


def test_a_mass_of_zero_is_named() -> None:
    """hannorein/rebound#253: bodies without mass were moved wrongly by some integrators."""
    with pytest.raises(lm.errors.InvalidInput, match="mass"):
        lm.models.NBody([1.0, 0.0])
    with pytest.raises(lm.errors.InvalidInput):
        masses(2, Spring(1.0).over(lm.neighbours.chain(2)), mass=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 1e-15])
def test_bodies_with_tiny_moments_of_inertia_turn(scale: float) -> None:
    """lammps/lammps#1657, #2105: moments below 1e-6 counted as zero, and the attitude stayed.
    A symmetric top's axis turns about its momentum at |mu|/J_1.
    """
    moments = scale * np.array([2.0, 2.0, 1.0, 1.0, 1.0, 1.0])
    free = lm.LiePoissonSystem(lm.SE3() ** 3, lm.PerSite(lm.KineticEnergy(moments)))
    system = lm.MechanicalSystem(free, lm.Terms(Tie(0.0).over(lm.neighbours.chain(3))))
    mu = scale * np.tile([0.6, 0.0, 0.8, 0.0, 0.0, 0.0], (3, 1))
    run = lm.integrate(
        system, lm.KickDrift(order=4), system.state(mu=mu, g=np.tile(np.eye(4), (3, 1, 1))), h=0.01, steps=100
    )
    turn = Rotation.from_rotvec(np.array([0.6, 0.0, 0.8]) / 2.0).as_matrix()
    for g in run.g[-1]:
        assert np.allclose(g[:3, 2], turn[:, 2], rtol=0.0, atol=1e-8)


@pytest.mark.slow
def test_molecules_keep_their_total_angular_momentum() -> None:
    """brucefan1983/GPUMD#309, glotzerlab/hoomd-blue#265: angular momentum of free molecules drifted."""
    free = lm.LiePoissonSystem(lm.SE3() ** 5, lm.PerSite(lm.KineticEnergy([1.0, 1.5, 2.0, 1.0, 1.0, 1.0])))
    system = lm.MechanicalSystem(free, lm.Terms(Tie(2.0).over(lm.neighbours.ring(5))))
    poses = np.array(
        [np.asarray(lm.SE3().exp([*a, *b])) for a, b in zip(directions(5, 7), directions(5, 8), strict=True)]
    )
    start = system.state(mu=np.random.default_rng(9).normal(size=(5, 6)), g=poses)
    run = lm.integrate(system, lm.KickDrift(), start, h=0.02, steps=300)

    def total(mu: Any, g: Any) -> Any:
        R, x = g[..., :3, :3], g[..., :3, 3]
        spin, push = np.einsum("...ij,...j->...i", R, mu[..., :3]), np.einsum("...ij,...j->...i", R, mu[..., 3:])
        return np.concatenate([(spin + np.cross(x, push)).sum(axis=1), push.sum(axis=1)], axis=-1)

    momenta = total(run.mu, run.g)
    assert np.abs(momenta - momenta[0]).max() < 1e-12 * np.abs(momenta).max()


@pytest.mark.slow
def test_motion_in_a_plane_stays_in_it_exactly() -> None:
    """lammps/lammps#2459: bodies of a plane drifted out of it."""
    free = lm.LiePoissonSystem(lm.VectorSpace(3) ** 7, lm.PerSite(lm.KineticEnergy([1.0] * 3)))
    system = lm.MechanicalSystem(free, lm.Terms(lm.models.Gravity().over(lm.neighbours.all_pairs()), mass=1.0))
    flat = np.array([1.0, 1.0, 0.0])
    start = system.state(mu=directions(7, 10) * flat, g=3.0 * directions(7, 11) * flat)
    run = lm.integrate(system, lm.KickDrift(order=4), start, h=0.005, steps=200)
    assert not run.g[:, :, 2].any() and not run.mu[:, :, 2].any() and run.mu[:, :, :2].all()


@lm.record
class Coulomb(lm.Term):
    def energy(self, a, b):
        d = a.g - b.g
        return a.q * b.q / lm.formulas.sqrt(lm.dot(d, d))


@pytest.mark.slow
def test_an_antisymmetric_bond_between_one_pair_of_atoms() -> None:
    """tsdev/spinw#28: one pair has a known D; (a, b) with D is (b, a) with -D."""
    D, mu, ends = np.array([0.3, -0.2, 0.9]), directions(8, 5), []
    for pair, sign in (((2, 6), 1.0), ((6, 2), -1.0)):
        system = spins(8, Twist(sign * D).over(lm.neighbours.edges([pair], sites=8, ordered=True)))
        ends.append(lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu), h=0.05, steps=20).mu[-1])
    assert np.allclose(*ends, rtol=0.0, atol=1e-14)
    assert np.abs(ends[0][[2, 6]] - mu[[2, 6]]).min() > 1e-3


def test_spins_of_different_size() -> None:
    """lammps#5097: the rate of a spin with a larger moment.  Two of 7.63 and 2.2 turn about their sum at J |S|."""
    mu = directions(6, 6) * np.array([7.63, 2.2, 7.63, 2.2, 7.63, 2.2])[:, None]
    system = spins(6, Exchange(-0.2).over(lm.neighbours.edges([(0, 1), (2, 3), (4, 5)], sites=6)))
    run = lm.integrate(system, lm.BondSplitting(order=2), system.state(mu=mu), h=0.5, steps=4)
    for k in (0, 2, 4):
        turn = Rotation.from_rotvec(-0.2 * (mu[k] + mu[k + 1]) * 2.0).as_matrix()
        assert np.allclose(run.mu[-1, k : k + 2], mu[k : k + 2] @ turn.T, rtol=0.0, atol=1e-13)


@pytest.mark.slow
def test_charges_of_other_signs_attract() -> None:
    """espressomd/espresso#870: opposite charges repelled each other; Mjolnir#13: and one without a charge goes
    straight on, among all pairs.
    """
    q, g = np.array([1.0, -1.0, 0.0, 2.0, 0.0]), np.random.default_rng(7).normal(size=(5, 3)) * 3.0
    system = masses(5, Coulomb().over(lm.neighbours.all_pairs()), q=lm.each(q))
    mu = np.zeros((5, 3))
    mu[2] = [1.0, 2.0, 3.0]
    run = lm.integrate(system, lm.LieVerlet(), system.state(mu=mu, g=g), h=0.01, steps=100)

    def law(_: float, y: Any) -> Any:
        x, p = y.reshape(2, 5, 3)
        d = x[:, None] - x
        r = np.sqrt((d**2).sum(-1)) + np.eye(5)
        return np.concatenate([p, ((np.outer(q, q) / r**3)[..., None] * d).sum(axis=1)]).ravel()

    wanted = solve_ivp(law, (0.0, 1.0), np.ravel([g, mu]), "DOP853", rtol=1e-11, atol=1e-12).y[:, -1].reshape(2, 5, 3)
    assert np.allclose(run.g[-1], wanted[0], rtol=0.0, atol=1e-4)
    assert np.allclose(run.g[-1, 2], g[2] + mu[2], rtol=0.0, atol=1e-12)
    assert np.array_equal(run.mu[-1, 4], np.zeros(3))
