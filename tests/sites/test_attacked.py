"""Faults that random systems beside DOP853 have found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Spring
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange, Twist

import liemech as lm
from liemech.compiler import kernel

N = 5


def moved(t: float, held: list[int], neighbours: Any) -> tuple[np.ndarray, np.ndarray]:
    """Spins, and where they are at a time: a' = -(sum of the neighbours) x a turned about."""
    s = np.random.default_rng(3).normal(size=(N, 3))
    s /= np.linalg.norm(s, axis=1)[:, None]

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(N, 3)
        slope = -neighbours(m)
        slope[held] = 0.0
        return np.cross(m, slope).ravel()

    end = solve_ivp(motion, (0.0, t), s.ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return s, end.reshape(N, 3)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, True])
def test_sublattices_where_every_two_are_tied(compiled: bool) -> None:
    """Places that are filled by the last site of a colour are no partners."""
    if compiled and kernel.available() is not None:
        pytest.skip("needs llvmlite")
    system = lm.LiePoissonSystem(lm.SO3() ** N, lm.Terms(Exchange(1.0).over(lm.neighbours.all_pairs())))
    s, wanted = moved(0.4, [], lambda m: m.sum(axis=0) - m)
    errors = []
    for steps in (4, 8):
        run = lm.integrate(
            system, lm.SublatticeSplitting(), system.state(mu=s), h=0.4 / steps, steps=steps,
            compiled=compiled,
        )  # fmt: skip
        errors.append(np.abs(run.mu[-1] - wanted).max())
    assert errors[0] < 0.05 and 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.slow
def test_hamilton_jacobi_where_a_site_is_held() -> None:
    """The gradient of an energy is zero at sites that are held; its other parts are those of it."""
    system = lm.LiePoissonSystem(lm.SO3() ** N, lm.Terms(Exchange(1.0).over(lm.neighbours.ring(N)), held=[1]))
    s, wanted = moved(0.4, [1], lambda m: np.roll(m, 1, 0) + np.roll(m, -1, 0))
    errors = []
    for steps in (4, 8):
        run = lm.integrate(
            system, lm.LiePoissonHamiltonJacobi(order=2), system.state(mu=s), h=0.4 / steps,
            steps=steps,
        )  # fmt: skip
        errors.append(np.abs(run.mu[-1] - wanted).max())
        assert np.array_equal(run.mu[-1, 1], s[1])
    assert errors[0] < 0.05 and 3.5 < errors[0] / errors[1] < 4.5


@lm.record
class Turning(lm.Term):
    """A field along x that turns its sign."""

    def energy(self, a: Any, t: float) -> float:
        return lm.formulas.cos(t) * a.mu[0]


def test_bonds_of_a_driven_system_are_refused_by_name() -> None:
    twist = Twist([0.1, 0.2, 0.3]).over(lm.neighbours.edges([[0, 1], [1, 2]]))
    system = lm.DrivenLiePoissonSystem(lm.SO3() ** 3, lm.Terms(twist, Turning()))
    with pytest.raises(lm.errors.IncompatibleSystem, match="SublatticeSplitting"):
        lm.Plan(system, lm.BondSplitting(), h=0.1)


# ------------------------------------------------------------------ what formulas read, pairs, boxes, units

strength = 2.0


@lm.record
class AlongZ(lm.Term):
    """A field along z whose strength is a constant outside of the formula."""

    def energy(self, a: Any) -> float:
        return -strength * a.mu[2]


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.SublatticeSplitting()], ids=repr)
def test_constants_may_change_between_runs(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Native code of a system that has run says what its formulas say now."""
    if kernel.available() is not None:
        pytest.skip("needs llvmlite")
    spins = lm.LiePoissonSystem(lm.SO3() ** 20, lm.Terms(AlongZ()))
    start = spins.state(mu=np.tile([1.0, 0.0, 0.5], (20, 1)))
    for value in (2.0, 3.0, -1.0):
        monkeypatch.setitem(globals(), "strength", value)
        run = lm.integrate(spins, method, start, h=0.05, steps=20, compiled=True)
        angle = np.arctan2(run.mu[-1, :, 1], run.mu[-1, :, 0])
        assert np.abs(angle - value).max() < 1e-14


@lm.record
class Rubbing(lm.Term):
    """Friction between two masses, more where both are far away."""

    c: float

    def covector(self, t: float, a: Any, b: Any) -> Any:
        return -self.c * (a.xi - b.xi) * (1.0 + 0.3 * lm.dot(a.g, b.g))


MASS = np.array([1.0, 2.0, 1.5])


def masses_in_space(n: int, terms: Any, load: Any = None) -> Any:
    free = lm.LiePoissonSystem(lm.VectorSpace(3) ** n, lm.PerSite(lm.KineticEnergy(MASS.tolist())))
    return lm.MechanicalSystem(free, lm.Terms(terms), load=load)


@pytest.mark.slow
def test_friction_between_sites(monkeypatch: pytest.MonkeyPatch) -> None:
    """The momenta of all sites at the end of a kick belong together."""
    monkeypatch.setattr(lm.System, "small", 0)
    n, ring = 5, lm.neighbours.ring(5)
    system = masses_in_space(n, Spring(1.0).over(ring), lm.Terms(Rubbing(0.4).over(ring)))
    p, q = np.random.default_rng(0).normal(size=(2, n, 3))

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        p, q = y.reshape(2, n, 3)
        xi, force = p / MASS, np.zeros((n, 3))
        for i, j in [(i, (i + s) % n) for i in range(n) for s in (1, -1)]:
            force[i] += q[j] - q[i] - 0.4 * (xi[i] - xi[j]) * (1.0 + 0.3 * q[i] @ q[j])
        return np.stack([force, xi]).ravel()

    y = solve_ivp(motion, (0.0, 0.5), np.stack([p, q]).ravel(), "DOP853", rtol=1e-12, atol=1e-12)
    wanted, errors = y.y[:, -1].reshape(2, n, 3), []
    for steps in (5, 10):
        run = lm.integrate(
            system, lm.KickDrift(), system.state(mu=p, g=q), h=0.5 / steps, steps=steps,
            compiled=False,
        )  # fmt: skip
        errors.append(max(np.abs(run.mu[-1] - wanted[0]).max(), np.abs(run.g[-1] - wanted[1]).max()))
        assert np.abs(run.mu[-1].sum(axis=0) - p.sum(axis=0)).max() < 1e-13
    assert errors[0] < 0.02 and 3.6 < errors[0] / errors[1] < 4.4


@lm.record
class Slowing(lm.Term):
    """Friction between two masses."""

    c: float

    def covector(self, t: float, a: Any, b: Any) -> Any:
        return -self.c * (a.xi - b.xi)


def rubbing_ring(n: int, c: Any) -> tuple[Any, Any]:
    """Masses of 1 on a ring, each against the next with the velocities 1 and -1, and the start."""
    free = lm.LiePoissonSystem(lm.VectorSpace(1) ** n, lm.PerSite(lm.KineticEnergy([1.0])))
    ring = lm.neighbours.ring(n)
    system = lm.MechanicalSystem(free, lm.Terms(Spring(0.0).over(ring)), load=lm.Terms(Slowing(c).over(ring)))
    return system, system.state(mu=np.resize([1.0, -1.0], (n, 1)), g=np.zeros((n, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.KickDrift(), lm.LieVerlet()], ids=repr)
def test_friction_between_more_sites_than_are_written_out(method: Any) -> None:
    """xi' = -4 c xi in this mode: a half kick at the start has the factor 1 - 2 c h, one at the end 1/(1 + 2 c h)."""
    if kernel.available() is not None:
        pytest.skip("needs llvmlite")
    c, h, n = 0.5, 0.1, 400
    system, start = rubbing_ring(n, c)
    run = lm.integrate(system, method, start, h=h, steps=5, compiled=True)
    wanted = ((1.0 - 2.0 * c * h) / (1.0 + 2.0 * c * h)) ** np.arange(6.0)
    assert np.allclose(run.mu[:, ::2, 0], wanted[:, None], rtol=1e-12, atol=0.0)
    assert np.array_equal(run.mu[:, 1::2], -run.mu[:, ::2])


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, True])
def test_a_site_that_others_rub_too_strongly_is_refused(compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each site is slowed by 2 c, whatever the others do: c h is 1.5 with c = 15, and 0.9 with c = 9."""
    if compiled and kernel.available() is not None:
        pytest.skip("needs llvmlite")
    monkeypatch.setattr(lm.System, "small", 0)
    for c in (15.0, lm.each([15.0] * 6)):
        system, start = rubbing_ring(6, c)
        with pytest.raises(
            lm.errors.NoConvergence, match=r"Slowing\(c=\S+\)\): c h/\(2 I\) is 1\.5,.* 0\.0667 long"
        ) as told:
            lm.integrate(system, lm.KickDrift(), start, h=0.1, steps=2, compiled=compiled)
        assert "AtSite" not in str(told.value)
    system, start = rubbing_ring(6, 9.0)
    assert len(lm.integrate(system, lm.KickDrift(), start, h=0.1, steps=2, compiled=compiled)) == 3


@lm.record
class Attraction(lm.Term):
    """One that has no limit."""

    e: float

    def energy(self, a: Any, b: Any) -> float:
        d = a.g - b.g
        return -self.e / lm.dot(d, d)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, True])
def test_masses_that_meet_are_both_named(compiled: bool) -> None:
    """With every sample before the step."""
    if compiled and kernel.available() is not None:
        pytest.skip("needs llvmlite")
    n = 8
    q, p = np.zeros((2, n, 3))
    q[:, 0], q[5, 0] = 10.0 * np.arange(n), 32.0
    p[3, 0], p[5, 0] = 4.0, -4.0
    for graph in (lm.neighbours.all_pairs(), lm.neighbours.edges([[1, 2], [3, 5], [5, 7]], sites=n)):
        system = masses_in_space(n, Attraction(2.0**-70).over(graph))
        start = system.state(mu=MASS * p, g=q)
        with pytest.raises(lm.errors.LiemechError, match=r"sites (3 and 5|5 and 3), step 4 of 9") as told:
            lm.integrate(system, lm.KickDrift(), start, h=2.0**-4, steps=9, compiled=compiled)
        assert told.value.trajectory.t.tolist() == [0.0, 2.0**-4, 2.0**-3, 3 * 2.0**-4]


@lm.record
class Repulsion(lm.Term):
    """A soft one."""

    e: float

    def energy(self, a: Any, b: Any) -> float:
        d = a.g - b.g
        return self.e * lm.formulas.exp(-lm.dot(d, d))


@pytest.mark.slow
def test_atoms_that_cross_their_box_many_times() -> None:
    n, box = 8, 5.0
    system = masses_in_space(n, Repulsion(1.0).over(lm.neighbours.within(2.4, box=[box] * 3)))
    rng = np.random.default_rng(0)
    q, p = rng.uniform(0.0, box, (n, 3)), 3.0 * rng.normal(size=(n, 3))
    method = lm.KickDrift(order=4)
    run = lm.integrate(system, method, system.state(mu=p, g=q), h=0.01, steps=2000, every=100)
    assert np.abs(run.g[-1] - q).max() > 10.0 * box
    assert np.ptp(run.energy) < 1e-6 * run.energy[0]
    assert np.abs(run.mu.sum(axis=1) - p.sum(axis=0)).max() < 1e-13
    there = system.state(mu=p, g=q + box * rng.integers(-50, 50, (n, 3)))
    other = lm.integrate(system, method, there, h=0.01, steps=100, every=100)
    assert np.abs(other.mu[-1] - run.mu[1]).max() < 1e-12


@pytest.mark.slow
def test_mixed_units() -> None:
    """Masses, lengths and times in other powers of two each: the same numbers."""
    rng, n, found = np.random.default_rng(0), 6, []
    q, v = 3.0 * rng.normal(size=(n, 3)), 0.3 * rng.normal(size=(n, 3))
    for M, L, T in ((1.0, 1.0, 1.0), (2.0**100, 2.0**40, 2.0**-30), (2.0**-90, 2.0**-33, 2.0**45)):
        inertia = (MASS * M).tolist()
        free = lm.LiePoissonSystem(lm.VectorSpace(3) ** n, lm.PerSite(lm.KineticEnergy(inertia)))
        pairs = Attraction(M * L**4 / T**2).over(lm.neighbours.all_pairs())
        system = lm.MechanicalSystem(free, lm.Terms(pairs))
        start = system.state(mu=MASS * M * v * L / T, g=q * L)
        run = lm.integrate(system, lm.KickDrift(order=4), start, h=0.02 * T, steps=50, every=50)
        found.append(run.g[-1] / L)
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


@lm.record
class Tethered(lm.models.SPC):
    """Water whose centres are drawn together besides, which no point of a molecule feels."""

    k: float = 0.0

    def energy(self, a: Any, b: Any) -> float:
        d = [a.g[i][3] - b.g[i][3] for i in range(3)]
        return super().energy(a, b) + 0.5 * self.k * lm.sum([x * x for x in d])


@pytest.mark.parametrize("graph", [lm.neighbours.all_pairs(), lm.neighbours.ring(3), lm.neighbours.within(9.0)])
def test_an_energy_that_a_subclass_of_points_writes_moves_them(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside water alone each molecule is pushed by -k times its distance from the others, and is turned by nothing."""
    monkeypatch.setattr(lm.System, "small", 0)
    places, k, h = np.array([[0.0, 0.0, 0.0], [3.0, 0.5, 0.2], [0.4, 3.1, 1.0]]), 1e4, 2.0**-24
    g = np.tile(np.eye(4), (3, 1, 1))
    g[:, :3, :3], g[:, :3, 3] = turned_poses(3), places
    ends = []
    for water in (lm.models.SPC(), Tethered(k=k)):
        free = lm.LiePoissonSystem(lm.SE3() ** 3, lm.PerSite(water.kinetic_energy))
        system = lm.MechanicalSystem(free, lm.Terms(water.over(graph)))
        run = lm.integrate(system, lm.KickDrift(), system.state(mu=np.zeros((3, 6)), g=g), h=h, steps=1, compiled=False)
        ends.append(run.mu[-1] / h)
    pull = -k * (3.0 * places - places.sum(axis=0))
    wanted = np.concatenate([np.zeros((3, 3)), np.einsum("nji,nj->ni", g[:, :3, :3], pull)], axis=1)
    assert np.allclose(ends[1] - ends[0], wanted, rtol=1e-6, atol=1e-6 * np.abs(ends[0]).max())


def turned_poses(n: int) -> np.ndarray:
    return np.asarray(lm.SO3().exp(np.random.default_rng(3).normal(size=(n, 3))))
