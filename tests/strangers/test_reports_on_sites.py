"""Situations in which users of other packages met wrong spins, masses or molecules: repository and number of each
report, the value by a closed form, by DOP853 or by what is conserved.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Spring
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from terms_of_spins import Exchange, Twist, Zeeman

import liemech as lm


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


def reference(slope: Any, mu: Any, t: float) -> Any:
    """Spins at t by DOP853, mu' = mu x dH/dmu; slope : dH/dmu of all spins, (n, 3)."""
    law = lambda _, y: np.cross(m := y.reshape(-1, 3), slope(m)).ravel()  # noqa: E731
    return solve_ivp(law, (0.0, t), np.ravel(mu), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1].reshape(-1, 3)


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
def test_an_antisymmetric_bond_pushes_its_spins_as_its_energy_says() -> None:
    """SunnySuite/Sunny.jl#57, #56: local fields of antisymmetric exchange had a wrong sign for one of the spins."""
    n, D = 6, np.array([0.3, -0.2, 0.9])
    system = spins(n, Twist(D).over(lm.neighbours.edges([(0, 1), (2, 1), (4, 3)], n, ordered=True)))

    def slope(m: Any) -> Any:
        fields = np.zeros_like(m)
        for a, b in ((0, 1), (2, 1), (4, 3)):
            fields[a] += np.cross(m[b], D)
            fields[b] += np.cross(D, m[a])
        return fields

    mu = directions(n, 1)
    run = lm.integrate(system, lm.RKMK(order=8), system.state(mu=mu), h=0.05, steps=40)
    assert np.allclose(run.mu[-1], reference(slope, mu, 2.0), rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_pairs_of_one_kind_given_twice_add_up() -> None:
    """lammps/lammps#1355: values were wrong when several similar pairs were declared."""
    n, mu = 8, directions(8, 2)
    ring = [(k, (k + 1) % n) for k in range(n)]
    far = [(k, (k + 3) % n) for k in range(n)]
    J, K = np.linspace(0.5, 1.5, n), -0.4
    system = spins(
        n,
        Exchange(lm.each(J)).over(lm.neighbours.edges(ring, n)),
        Exchange(K).over(lm.neighbours.edges(far, n)),
        Exchange(0.25).over(lm.neighbours.edges(ring, n)),
    )

    def slope(m: Any) -> Any:
        fields = np.zeros_like(m)
        for strengths, pairs in ((J + 0.25, ring), (np.full(n, K), far)):
            for s, (a, b) in zip(strengths, pairs, strict=True):
                fields[a] -= s * m[b]
                fields[b] -= s * m[a]
        return fields

    run = lm.integrate(system, lm.RKMK(order=8), system.state(mu=mu), h=0.05, steps=40)
    assert np.allclose(run.mu[-1], reference(slope, mu, 2.0), rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_a_second_run_of_one_plan_begins_as_the_first() -> None:
    """lammps/lammps#2817: counters were not set back between two runs."""
    system = spins(9, Exchange(1.0).over(lm.neighbours.square(3, 3)), Zeeman([0.0, 0.0, 1.0]))
    plan, start = (
        lm.Plan(system, lm.SublatticeSplitting(order=2), h=0.05, progress=False),
        system.state(mu=directions(9)),
    )
    assert np.array_equal(plan.run(start, steps=7).mu, plan.run(start, steps=7).mu)


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


@pytest.mark.slow
@pytest.mark.parametrize("laps", [0.0, 7.0])
def test_a_pair_that_crosses_its_box_again_and_again_moves_as_in_open_space(laps: float) -> None:
    """lammps/lammps#1577: a molecule exploded when it crossed the border of the box for the second time.
    The centre goes straight on, the distance swings with omega^2 = 2 k/m.
    """
    box, k, speed = 4.0, 3.0, laps * 4.0
    system = masses(2, Spring(k).over(lm.neighbours.within(1.9, box=[box] * 3)))
    p = np.array([[0.3, 0.0, speed], [-0.3, 0.0, speed]])
    start = system.state(mu=p, g=[[0.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    run = lm.integrate(system, lm.KickDrift(order=4), start, h=0.005, steps=200)
    x, omega = run.g[-1], np.sqrt(2.0 * k)
    assert np.allclose(x.sum(axis=0), [0.5, 0.0, 2.0 * speed], rtol=0.0, atol=1e-11)
    apart = np.array([0.5 * np.cos(omega) + 0.6 / omega * np.sin(omega), 0.0, 0.0])
    assert np.allclose(x[0] - x[1], apart, rtol=0.0, atol=1e-8)


def test_a_box_smaller_than_twice_the_cutoff_is_refused() -> None:
    """openmm/openmm#5347, jax-md/jax-md#200: only the nearest image is seen, so that a pair would meet itself twice."""
    with pytest.raises(lm.errors.InvalidInput, match="box"):
        masses(2, Spring(1.0).over(lm.neighbours.within(1.0, box=[1.9, 5.0, 5.0])))


def test_a_mass_of_zero_is_named() -> None:
    """hannorein/rebound#253: bodies without mass were moved wrongly by some integrators."""
    with pytest.raises(lm.errors.InvalidInput, match="mass"):
        lm.models.NBody([1.0, 0.0])
    with pytest.raises(lm.errors.InvalidInput):
        masses(2, Spring(1.0).over(lm.neighbours.chain(2)), mass=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_backward_steps_lead_back(order: int) -> None:
    """ben-cassese/jorbit#85, adrn/gala#255: steps backwards went forwards."""
    pull = lm.Terms(lm.models.Gravity().over(lm.neighbours.all_pairs()), mass=1.0)
    free = lm.LiePoissonSystem(lm.VectorSpace(3) ** 6, lm.PerSite(lm.KineticEnergy([1.0] * 3)))
    system = lm.MechanicalSystem(free, pull)
    start = system.state(mu=0.3 * directions(6, 5), g=2.0 * directions(6, 6))
    there = lm.integrate(system, lm.KickDrift(order=order), start, h=0.01, steps=50).last
    back = lm.integrate(system, lm.KickDrift(order=order), there, h=-0.01, steps=50)
    assert np.allclose(back.g[-1], start.g, rtol=0.0, atol=1e-12) and back.t[-1] == pytest.approx(-0.5)


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
def test_an_antisymmetric_exchange_that_fades_along_a_ring() -> None:
    """fidimag#155: an antisymmetric exchange that varies in space was not taken.  Here it is some bonds of 200."""

    @lm.record
    class Fading(lm.Term):
        x: float

        def energy(self, a: Any, b: Any) -> float:
            D = lm.formulas.exp(-((self.x - 151.0) ** 2))
            return -lm.dot(a.mu, b.mu) + D * (a.mu[0] * b.mu[1] - a.mu[1] * b.mu[0])

    n = 200
    pairs = [(i, (i + 1) % n) for i in range(n)]
    system = spins(n, Fading(lm.each(1.0 * np.arange(n))).over(lm.neighbours.edges(pairs)))
    D = np.exp(-((np.arange(n) - 151.0) ** 2))[:, None] * [0.0, 0.0, 1.0]

    def slope(m: Any) -> Any:
        after = np.roll(m, -1, axis=0)
        return -after - np.roll(m, 1, axis=0) + np.cross(after, D) + np.roll(np.cross(D, m), 1, axis=0)

    mu = directions(n, 4)
    run = lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu), h=0.02, steps=20)
    assert np.allclose(run.mu[-1], reference(slope, mu, 0.4), rtol=0.0, atol=1e-6)


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
