"""Sums of terms over graphs: against NumPy written by hand, and their exact identities."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Spring
from scipy.integrate import solve_ivp
from terms_of_spins import Chiral, Exchange, Twist

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput
from liemech.formulas.sites import each_site, present_site, total
from liemech.rooms.sites.terms.near_pairs import NearPairs
from liemech.rooms.sites.terms.terms import Site

RNG = np.random.default_rng(3)


@lm.record
class Zeeman(lm.Term):
    B: lm.Vec

    def energy(self, a: Any) -> float:
        return -a.moment * lm.dot(self.B, a.mu)


@lm.record
class Gravity(lm.Term):
    G: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.G * a.mass * b.mass / lm.norm(a.g - b.g)


def spins(lattice: Any) -> Any:
    return lm.LiePoissonSystem(lm.SO3() ** lattice.sites, lm.Terms(Exchange(1.3).over(lattice)))


def rich() -> tuple[Any, np.ndarray, np.ndarray]:
    """A system with everything, its pairs and momenta."""
    pairs = np.array([(0, 1), (3, 2), (1, 2), (4, 0)])
    J, D = RNG.normal(size=4), RNG.normal(size=(4, 3))
    terms = lm.Terms(
        Exchange(lm.each(J)).over(lm.neighbours.edges(pairs)),
        Twist(lm.each(D)).over(lm.neighbours.edges(pairs)),
        Chiral(0.7).over(lm.neighbours.edges([(0, 2, 4), (1, 2, 3)])),
        Zeeman([0.1, 0.2, 0.3]),
        moment=lm.each([1.0, 2.0, 3.0, 4.0, 5.0]),
    )
    return lm.LiePoissonSystem(lm.SO3() ** 5, terms), J, D


def by_hand(J: np.ndarray, D: np.ndarray, mu: np.ndarray) -> tuple[float, np.ndarray]:
    energy, slope = 0.0, np.zeros((5, 3))
    for k, (i, j) in enumerate([(0, 1), (3, 2), (1, 2), (4, 0)]):
        energy += -J[k] * mu[i] @ mu[j] + D[k] @ np.cross(mu[i], mu[j])
        slope[i] += -J[k] * mu[j] + np.cross(mu[j], D[k])
        slope[j] += -J[k] * mu[i] + np.cross(D[k], mu[i])
    for i, j, k in [(0, 2, 4), (1, 2, 3)]:
        energy += 0.7 * mu[i] @ np.cross(mu[j], mu[k])
        for a, b, c in [(i, j, k), (j, k, i), (k, i, j)]:
            slope[a] += 0.7 * np.cross(mu[b], mu[c])
    field, moments = np.array([0.1, 0.2, 0.3]), np.arange(1.0, 6.0)
    return energy - moments @ (mu @ field), slope - np.outer(moments, field)


def test_energy_and_velocity_are_those_written_by_hand() -> None:
    system, J, D = rich()
    for mu in RNG.normal(size=(3, 5, 3)):
        energy, slope = by_hand(J, D, mu)
        assert np.isclose(system.energy(mu), energy, rtol=1e-13)
        assert np.allclose(system.velocity(mu), slope, rtol=1e-13, atol=1e-13)
        assert np.array_equal(system.velocity(mu.ravel()), system.velocity(mu).ravel())


def forms(system: Any, mu: np.ndarray) -> tuple[np.ndarray, float]:
    """Velocities and energy by the site form."""
    site, found, shares = system.site_form, np.empty(mu.shape), []

    def at_site() -> None:
        here = lm.formulas.vec(*mu[present_site()])
        found[present_site()] = site.velocity(here)
        energy = total(site.energy(here))
        if present_site() == 0:
            shares.append(energy)

    each_site(len(mu), at_site)
    return found, shares[-1]


def test_the_site_form_has_the_same_bits() -> None:
    everyone = lm.Terms(
        Exchange(0.7).over(lm.neighbours.all_pairs()),
        Zeeman([0.1, 0.2, 0.3]),
        moment=lm.each([1.0, 2.0, 3.0, 4.0, 5.0]),
        held=[2],
    )
    for system in (
        rich()[0],
        spins(lm.neighbours.ring(5)),
        spins(lm.neighbours.chain(5)),
        lm.LiePoissonSystem(lm.SO3() ** 5, everyone),
    ):
        mu = RNG.normal(size=(5, 3))
        velocities, energy = forms(system, mu)
        assert np.array_equal(velocities, system.velocity(mu))
        assert energy == system.energy(mu)


@pytest.mark.parametrize("count", [9, 10, 12, 13])
def test_all_pairs_written_out_are_added_by_halves_as_sites_add_them(count: int) -> None:
    system, mu = spins(lm.neighbours.all_pairs(count)), np.random.default_rng(count).normal(size=(count, 3))
    velocities, energy = forms(system, mu)
    assert np.array_equal(velocities, system.velocity(mu))
    assert energy == system.energy(mu)


def test_a_pair_term_that_turns_with_its_sites_keeps_the_total_momentum() -> None:
    system = spins(lm.neighbours.square(4, 3))
    mu = RNG.normal(size=(12, 3))
    rates = np.cross(mu, system.velocity(mu))
    assert np.abs(rates.sum(axis=0)).max() < 1e-14 * np.abs(rates).sum()


@pytest.mark.slow
def test_runs_site_by_site_are_those_written_out() -> None:
    masses, q, v = RNG.uniform(1.0, 2.0, 17), RNG.normal(size=(17, 3)), RNG.normal(size=(17, 3))
    J = lm.each(np.outer(masses, np.ones(3)))
    bodies = lm.LiePoissonSystem(lm.VectorSpace(3) ** 17, lm.PerSite(lm.KineticEnergy(J)))
    pull = lm.models.Gravity(0.1).over(lm.neighbours.all_pairs())
    system = lm.MechanicalSystem(bodies, lm.Terms(pull, mass=lm.each(masses)))
    start = system.state(xi=v, g=q)
    run = lm.integrate(system, lm.KickDrift(order=4), start, h=0.01, steps=3, compiled=True)
    plain = lm.integrate(system, lm.KickDrift(order=4), start, h=0.01, steps=3, compiled=False)
    assert np.array_equal(run.mu, plain.mu) and np.array_equal(run.g, plain.g)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        at, velocity = y.reshape(2, 17, 3)
        d = at - at[:, None]
        cubes = (d**2).sum(axis=2) ** 1.5 + np.eye(17)
        return np.concatenate([velocity.ravel(), (0.1 * masses[:, None] * d / cubes[..., None]).sum(axis=1).ravel()])

    begun = np.concatenate([q.ravel(), v.ravel()])
    known = solve_ivp(rates, (0.0, 0.03), begun, rtol=1e-12, atol=1e-12, method="DOP853")
    assert np.allclose(run.g[-1].ravel(), known.y[:51, -1], rtol=0.0, atol=1e-8)
    momentum = run.mu.sum(axis=1)
    assert np.abs(momentum - momentum[0]).max() < 1e-13 * np.abs(run.mu).max()


def test_an_ensemble_has_an_axis_of_members_before_that_of_sites() -> None:
    system = spins(lm.neighbours.chain(3))
    mu = RNG.normal(size=(4, 3, 3))
    run = lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu), h=0.1, steps=5)
    assert run.mu.shape == (6, 4, 3, 3) and run.bodies == 4
    one = lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu[2]), h=0.1, steps=5)
    assert np.array_equal(run.mu[:, 2], one.mu)
    assert np.array_equal(run.last.mu, run.mu[-1])


def test_forces_of_masses_are_newtons() -> None:
    masses, q = np.array([1.0, 2.0, 5.0]), RNG.normal(size=(3, 3))
    bodies = lm.LiePoissonSystem(
        lm.VectorSpace(3) ** 3, lm.PerSite(lm.KineticEnergy(lm.each(np.outer(masses, np.ones(3)))))
    )
    field = lm.Terms(Gravity(0.5).over(lm.neighbours.all_pairs()), mass=lm.each(masses))
    system = lm.MechanicalSystem(bodies, field)
    force = np.zeros((3, 3))
    for i in range(3):
        for j in {0, 1, 2} - {i}:
            d = q[j] - q[i]
            force[i] += 0.5 * masses[i] * masses[j] * d / np.linalg.norm(d) ** 3
    assert np.allclose(system.force(q), force, rtol=1e-13)
    assert np.allclose(system.velocity(q), q / masses[:, None], rtol=1e-15)
    assert np.allclose(system.force(q).sum(axis=0), 0.0, atol=1e-14 * np.abs(force).max())


# ------------------------------------------------------------------ graphs


def test_lattices_are_those_of_numpy() -> None:
    place = np.arange(24).reshape(2, 3, 4)
    lattice = lm.neighbours.cubic(2, 3, 4, periodic=(False, True, True))
    wanted = {
        frozenset((int(a), int(b)))
        for axis in range(3)
        for a, b in zip(place.ravel(), np.roll(place, -1, axis).ravel(), strict=True)
    }
    assert {frozenset(map(int, e)) for e in lattice.edges} == wanted
    assert len(lattice.edges) == len(wanted)
    assert len(lm.neighbours.square(3, 5, periodic=False).edges) == 2 * 5 + 3 * 4
    assert lm.neighbours.all_pairs(4).edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]


def test_tables_name_every_edge_at_its_ends() -> None:
    graph = lm.neighbours.edges(RNG.permuted(np.array([(i, j) for i in range(9) for j in range(i)])[::3], axis=1))
    others, edges, counts = graph.incidence()
    seen = set()
    for i in range(graph.sites):
        column = edges[: counts[i], i]
        assert (np.diff(column) > 0).all()
        for d, e in enumerate(column):
            assert {i, int(others[0, d, i])} == {*map(int, graph.edges[e])}
            seen.add((i, int(e)))
    assert len(seen) == 2 * len(graph.edges)
    for role in (0, 1):
        others, edges, counts = graph.incidence(role)
        assert counts.sum() == len(graph.edges)
        for i in range(graph.sites):
            assert all(graph.edges[e][role] == i for e in edges[: counts[i], i])


def test_what_is_wrong_is_named_with_the_edge() -> None:
    near = lm.neighbours
    for make, words in (
        (lambda: near.edges([(0, 1), (2, 2)]), r"edge 1, \(2, 2\), ties a site to itself"),
        (lambda: near.edges([(0, 1), (1, 7)], sites=5), r"edge 1, \(1, 7\).*0 to 4"),
        (lambda: near.edges([(0, 1), (0, -1)]), r"edge 1, \(0, -1\)"),
        (lambda: near.edges([(0, 1), (2, 1), (0, 1)]), r"edges 0, \(0, 1\), and 2, \(0, 1\), are the same"),
        (lambda: near.edges([(0, 1), (1, 0)], ordered=False), r"\(0, 1\).*\(1, 0\)"),
        (lambda: near.ring(1), "site 0 to itself"),
        (lambda: near.ring(2), r"\(0, 1\) and \(1, 0\)"),
        (lambda: near.cubic(3, 2, 3), "periodic="),
        (lambda: spins(near.edges([(0, 1), (1, 0)])), r"are the same"),
        (lambda: lm.Terms(Exchange(1.0)), "over"),
        (lambda: lm.Terms(Zeeman([0.0, 0.0, 1.0]).over(near.ring(3))), "one site"),
        (lambda: lm.LiePoissonSystem(lm.SO3() ** 4, lm.Terms(Exchange(1.0).over(near.ring(3)))), "3 sites, and the system 4"),
        (lambda: lm.LiePoissonSystem(lm.SO3() ** 3, lm.Terms(Exchange(lm.each([1.0])).over(near.ring(3)))), "1 values.*3 edges"),
        (lambda: lm.LiePoissonSystem(lm.SO3() ** 3, lm.Terms(Zeeman([0.0, 0.0, 1.0]))), "'moment'"),
        (lambda: lm.LiePoissonSystem(lm.SO3() ** 3, lm.Terms(Gravity(1.0).over(near.ring(3)), mass=1.0)), "a.g"),
    ):  # fmt: skip
        with pytest.raises(InvalidInput, match=words):
            make()
    body = lm.RigidBody([1.0, 1.5, 2.0])
    for make, words in (
        (lambda: Exchange(np.array([1.0, 2.0])), r"J is a number; got .*; a number for each is lm\.each\(values\)"),
        (lambda: lm.DoubleBracket(body, lm.each([0.1, 0.2])), "stands where one value is needed: .*a list of systems"),
        (lambda: lm.models.FixedPointGravity(lm.each([1.0, 2.0]), [0.0, 0.0, 1.0]), "stands where one value is needed"),
    ):
        with pytest.raises(lm.errors.InvalidType, match=words):
            make()
    with pytest.raises(IncompatibleSystem, match=r"SO3\(\) \*\* 100"):
        lm.LiePoissonSystem(lm.SO3(), lm.Terms(Exchange(1.0).over(near.ring(3))))


def test_a_term_that_is_not_symmetric_needs_ordered_edges() -> None:
    term = Twist([0.0, 0.0, 1.0])
    with pytest.raises(InvalidInput, match=r"Twist.*\(0, 1\).*ordered=True"):
        lm.LiePoissonSystem(lm.SO3() ** 3, lm.Terms(term.over(lm.neighbours.ring(3))))
    both = lm.neighbours.edges([(0, 1), (1, 0)])
    system = lm.LiePoissonSystem(lm.SO3() ** 2, lm.Terms(term.over(both)))
    assert system.energy(RNG.normal(size=(2, 3))) == 0.0


def test_starts_are_checked() -> None:
    system = spins(lm.neighbours.ring(4))
    with pytest.raises(InvalidInput, match=r"\(4, 3\).*members, 4, 3"):
        system.state(mu=np.ones((3, 3)))
    with pytest.raises(InvalidInput, match=r"mu\[2, 1\] is nan"):
        system.state(mu=np.where(np.arange(12).reshape(4, 3) == 7, np.nan, 1.0))
    with pytest.raises(InvalidInput, match=r"g\[3\]"):
        system.state(mu=np.ones((4, 3)), g=np.stack([np.eye(3)] * 3 + [2.0 * np.eye(3)]))


@lm.record
class Repulsion(lm.Term):
    """A soft sphere, 1/r^6."""

    strength: float

    def energy(self, a: Any, b: Any) -> float:
        d = a.g - b.g
        square = lm.dot(d, d)
        return self.strength / (square * square * square)


def gas(per_side: int, cutoff: float, box: float) -> tuple[Any, Any]:
    """Soft spheres in a box, and a start."""
    rng = np.random.default_rng(5)
    n = per_side**3
    axes = np.meshgrid(*[np.arange(per_side) * box / per_side] * 3)
    places = np.reshape(axes, (3, -1)).T + 0.05 * rng.normal(size=(n, 3))
    bodies = lm.LiePoissonSystem(lm.VectorSpace(3) ** n, lm.PerSite(lm.KineticEnergy([1.0, 1.0, 1.0])))
    near = lm.neighbours.within(cutoff, box=[box] * 3)
    system = lm.MechanicalSystem(bodies, lm.Terms(Repulsion(1.0).over(near)))
    return system, system.state(mu=0.5 * rng.normal(size=(n, 3)), g=places)


def test_pairs_within_a_cutoff_are_those_of_numpy() -> None:
    system, start = gas(3, 1.2, 2.5)
    d = start.g[:, None] - start.g
    d -= 2.5 * np.round(d / 2.5)
    r2 = (d**2).sum(axis=2)
    np.fill_diagonal(r2, np.inf)
    x = np.clip((r2 - 1.08**2) / (1.2**2 - 1.08**2), 0.0, 1.0)
    switch = 1.0 - x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    energy = 0.5 * (switch / r2**3).sum()
    assert np.isclose(system.potential.energy(start.g), energy, rtol=1e-12)
    moved = start.g + 2.5 * RNG.integers(-3, 4, size=start.g.shape)
    assert np.isclose(system.potential.energy(moved), energy, rtol=1e-11)
    force = system.force(start.g)
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).sum()
    h = 1e-5
    for i, k in ((0, 0), (13, 2)):
        step = np.zeros_like(start.g)
        step[i, k] = h
        slope = system.potential.energy(start.g + step) - system.potential.energy(start.g - step)
        assert np.isclose(force[i, k], -slope / (2.0 * h), rtol=1e-6)


@pytest.mark.slow
def test_lists_of_neighbours_leave_the_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    from liemech.rooms.sites.runs import lists as sites_lists

    made: list[Any] = []
    listed = sites_lists._listed
    monkeypatch.setattr(sites_lists, "_listed", lambda *x: made.append(x) or listed(*x))
    system, start = gas(5, 1.2, 6.0)
    method = lm.KickDrift(order=2)
    run = lm.integrate(system, method, start, h=0.004, steps=60, every=20)
    assert len(made) > 3
    half = lm.integrate(system, method, start, h=0.004, steps=30, every=20)
    rest = lm.Plan(system, method, h=0.004, every=20).resume(half, steps=30)
    assert np.array_equal(rest.g[-1], run.g[-1])
    monkeypatch.setattr(sites_lists, "LEAST", 10**9)
    other = lm.integrate(system, method, start, h=0.004, steps=60, every=20)
    assert np.array_equal(run.g, other.g) and np.array_equal(run.mu, other.mu)
    assert np.ptp(run.energy) < 1e-3 * abs(run.energy[0])


def test_a_cutoff_beyond_half_the_box_is_named() -> None:
    with pytest.raises(InvalidInput, match=r"cutoff 9\.5 is beyond half the box, 9\.3"):
        lm.neighbours.within(9.5, box=[18.6] * 3)
    with pytest.raises(IncompatibleSystem, match="places"):
        lm.LiePoissonSystem(lm.SO3() ** 3, lm.Terms(Exchange(1.0).over(lm.neighbours.within(1.0))))


def test_masses_in_one_place_are_named() -> None:
    bodies = lm.LiePoissonSystem(lm.VectorSpace(3) ** 4, lm.PerSite(lm.KineticEnergy([1.0, 1.0, 1.0])))
    system = lm.MechanicalSystem(bodies, lm.Terms(lm.models.Gravity().over(lm.neighbours.all_pairs()), mass=1.0))
    g = RNG.normal(size=(4, 3))
    g[3] = g[1]
    with pytest.raises(InvalidInput, match=r"sites 1 and 3 are in one place.*\(1, 3\)"):
        system.state(mu=np.zeros((4, 3)), g=g)
    free = lm.MechanicalSystem(bodies, lm.Terms(Spring(1.0).over(lm.neighbours.all_pairs())))
    assert free.force(free.state(mu=np.zeros((4, 3)), g=g).g).shape == (4, 3)


# ------------------------------------------------------------------ sites held, time, loads


@lm.record
class Pump(lm.Term):
    B: lm.Vec

    def energy(self, a: Any, t: float) -> float:
        return -lm.dot(self.B, a.mu) * lm.formulas.cos(2.0 * t)


@lm.record
class Drag(lm.Term):
    c: float

    def covector(self, t: float, a: Any) -> Any:
        return -self.c * a.xi


@lm.record
class Damper(lm.Term):
    c: float

    def covector(self, t: float, a: Any, b: Any) -> Any:
        return -self.c * (a.xi - b.xi)


def test_sites_that_are_held_stay_and_are_felt() -> None:
    lattice = lm.neighbours.ring(4)
    system = lm.LiePoissonSystem(lm.SO3() ** 4, lm.Terms(Exchange(1.3).over(lattice), held=[1, 3]))
    mu = RNG.normal(size=(4, 3))
    run = lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu), h=0.05, steps=20)
    assert np.array_equal(run.mu[:, [1, 3]], np.broadcast_to(mu[[1, 3]], (21, 2, 3)))
    assert np.array_equal(system.velocity(mu)[[0, 2]], spins(lattice).velocity(mu)[[0, 2]])
    turn = lm.SO3().exp(-1.3 * (mu[1] + mu[3]))  # about the field of the two, -J mu
    assert np.allclose(run.mu[-1, 0], np.asarray(turn).T @ mu[0], atol=1e-6)


def test_terms_may_know_the_time() -> None:
    lattice = lm.neighbours.ring(3)
    terms = lm.Terms(Exchange(1.0).over(lattice), Pump([1.0, 0.0, 0.0]))
    with pytest.raises(IncompatibleSystem, match="DrivenLiePoissonSystem"):
        lm.LiePoissonSystem(lm.SO3() ** 3, terms)
    system = lm.DrivenLiePoissonSystem(lm.SO3() ** 3, terms)
    mu = RNG.normal(size=(3, 3))
    field = np.array([np.cos(1.4), 0.0, 0.0])
    assert np.allclose(system.velocity(0.7, mu), spins(lattice).velocity(mu) / 1.3 - field)


def damped() -> Any:
    """A chain of masses on springs, with friction, the first of which is held."""
    bodies = lm.LiePoissonSystem(lm.VectorSpace(3) ** 2, lm.PerSite(lm.KineticEnergy([2.0, 2.0, 2.0])))
    chain = lm.neighbours.chain(2)
    return lm.MechanicalSystem(
        bodies,
        lm.Terms(Spring(lm.each([1.0])).over(chain), held=[0]),
        load=lm.Terms(Drag(0.1), Damper(0.5).over(chain)),
    )


def test_loads_are_sums_of_forces() -> None:
    system = damped()
    xi, g = RNG.normal(size=(2, 2, 3))
    load = np.asarray(system.load.covector(0.0, xi.ravel(), g.ravel())).reshape(2, 3)
    wanted = -0.1 * xi
    for i, j in ((0, 1), (1, 0)):
        wanted[i] -= 0.5 * (xi[i] - xi[j])
    wanted[0] = 0.0  # the potential says that it is held
    assert np.allclose(load, wanted, rtol=1e-14)
    with pytest.raises(InvalidInput, match="site 0 is held"):
        system.state(mu=np.ones((2, 3)), g=g)


@pytest.mark.slow
def test_water_attracts_as_its_authors_say() -> None:
    """The dimer of SPC has its least energy, -6.59 kcal/mol, at 2.75 A between the oxygens.

    Source: Jorgensen et al., J. Chem. Phys. 79 (1983), 926, table II.
    """
    from scipy.optimize import minimize
    from scipy.spatial.transform import Rotation

    water = lm.models.SPC()
    bodies = lm.LiePoissonSystem(lm.SE3() ** 2, lm.PerSite(water.kinetic_energy))
    system = lm.MechanicalSystem(bodies, lm.Terms(water.over(lm.neighbours.all_pairs())))
    atoms = np.array(water.atoms)

    def poses(x: np.ndarray) -> np.ndarray:
        g = np.stack([np.eye(4)] * 2)
        g[1, :3, :3], g[1, :3, 3] = Rotation.from_rotvec(x[:3]).as_matrix(), x[3:]
        return g

    found = min(
        (
            minimize(lambda x: system.potential.energy(poses(x)), start, method="Nelder-Mead",
                     options={"maxiter": 900, "fatol": 1e-3})
            for start in ([2.2, 0.0, 0.0, 0.0, 0.5, 3.0], [0.0, 2.0, 0.0, 2.5, 0.0, -1.5])
        ),
        key=lambda one: one.fun,
    )  # fmt: skip
    g = poses(found.x)
    apart = (g[1, :3, :3] @ atoms[0] + g[1, :3, 3]) - atoms[0]
    assert abs(found.fun / 100.0 / 4.184 + 6.59) < 0.06
    assert abs(np.linalg.norm(apart) - 2.75) < 0.02


def test_forces_on_both_molecules_are_derivatives_of_the_energy_and_those_on_one() -> None:
    water, group = lm.models.SPC(), lm.SE3()
    near = NearPairs(water, group, group, 4.0, 2.0, lm.vec(9.0, 9.0, 9.0))
    g = group.random(RNG, 2)
    g[:, :3, 3] = [[0.2, 0.1, -0.3], [0.4, 8.6, 2.5]]  # across a face of the box
    sites = [Site(g=lm.formulas.mat(*one.tolist())) for one in g]
    for term, ends in ((water, sites), (near, sites)):
        both = term.forces(group, *ends)
        for k in (0, 1):
            derived = np.array(lm.Term.force(term, group, k, *ends))
            assert np.abs(derived).max() > 1.0
            assert np.allclose(both[k], derived, rtol=1e-11, atol=1e-11 * np.abs(derived).max())
            assert np.array_equal(both[k], term.force(group, k, *ends))


@lm.record
class Gyrostat(lm.Hamiltonian):
    inertia: lm.Vec

    def energy(self, mu: Any) -> float:
        return 0.5 * lm.dot(mu - 0.7, (mu - 0.7) / self.inertia)


def test_members_of_an_ensemble_have_parameters_of_their_own_by_the_same_word() -> None:
    J, mu = RNG.uniform(1.0, 2.0, (5, 3)), RNG.normal(size=(5, 3))
    system = lm.LiePoissonSystem(lm.SO3(), Gyrostat(lm.each(J)))
    several = [lm.LiePoissonSystem(lm.SO3(), Gyrostat(one)) for one in J]
    start = system.state(mu=mu)
    run, other = (
        lm.integrate(each, lm.RKMK(order=4), start, h=0.1, steps=4, compiled=False) for each in (system, several)
    )
    assert np.array_equal(run.mu, other.mu) and np.array_equal(run.energy, other.energy)
    with pytest.raises(InvalidInput, match="5 systems for a start of one"):
        lm.integrate(system, lm.RKMK(order=4), system.state(mu=mu[0]), h=0.1, steps=4)


@pytest.mark.slow
def test_laws_hold() -> None:
    driven = lm.Terms(Exchange(1.0).over(lm.neighbours.chain(2)), Pump([1.0, 0.0, 0.0]))
    for system in (rich()[0], damped(), lm.DrivenLiePoissonSystem(lm.SO3() ** 2, driven), gas(1, 1.2, 2.5)[0]):
        lm.check_system(system)
    system = spins(lm.neighbours.chain(2))
    start = system.state(mu=RNG.normal(size=(2, 3)), g=lm.SO3().random(RNG, 2))
    report = lm.check_method(lm.RKMK(order=4), system, start)
    assert "holds" in str(report)


@pytest.mark.parametrize("slip", ["helds", "hled", "hel", "Held"])
def test_a_slip_in_held_is_no_parameter_of_sites(slip: str) -> None:
    """Before, the sites that were to be held moved without a word."""
    with pytest.raises(InvalidInput, match="did you mean held"):
        lm.Terms(Exchange(1.0).over(lm.neighbours.ring(5)), **{slip: [0]})
    lm.Terms(Exchange(1.0).over(lm.neighbours.ring(5)), field=1.0, shell=2.0)
