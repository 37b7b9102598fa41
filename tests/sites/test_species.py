"""Sites of several species: products of powers, beside the same system written out and by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange, Zeeman

import liemech as lm
from liemech.compiler import kernel
from liemech.errors import IncompatibleSystem, InvalidInput, NotFinite

native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
SPINS, BODIES = 5, 3
J = [1.0, 2.0, 3.0, 1.0, 1.0, 1.0]


@lm.record
class Cross(lm.Term):
    """A spin and the angular momentum of a body."""

    k: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.k * a.share * lm.dot(a.mu, b.mu[:3])


@lm.record
class Volume(lm.Term):
    def energy(self, a: Any, b: Any, c: Any) -> float:
        return lm.dot(lm.cross(a.mu, b.mu), c.mu[:3])


def place(a: Any) -> Any:
    return lm.vec(a.g[0, 3], a.g[1, 3], a.g[2, 3]) if isinstance(a.g, lm.Mat) else a.g


def arm(a: Any) -> Any:
    """A point of a body, not in its centre."""
    if not isinstance(a.g, lm.Mat):
        return a.g
    return place(a) + 0.2 * lm.vec(a.g[0, 0], a.g[1, 0], a.g[2, 0])


@lm.record
class Soft(lm.Term):
    k: float

    def energy(self, a: Any, b: Any) -> float:
        d = arm(a) - arm(b)
        return self.k / (lm.dot(d, d) + 0.3)


@lm.record
class Coulomb(lm.Term):
    k: float

    def energy(self, a: Any, b: Any) -> float:
        return self.k * b.charge / lm.norm(place(a) - place(b))


@lm.record
class Trap(lm.Term):
    k: float

    def energy(self, a: Any) -> float:
        return 0.5 * self.k * lm.dot(place(a), place(a))


PAIRS = np.array([(i, (2 * i) % BODIES) for i in range(SPINS)])


def magnet() -> Any:
    share = np.linspace(0.5, 1.5, SPINS)
    terms = lm.Terms(
        Exchange(1.0).over(lm.neighbours.ring(SPINS), of=0),
        Zeeman([0.0, 0.0, 0.1]).over(of=0),
        lm.PerSite(lm.KineticEnergy(J)).over(of=1),
        Cross(lm.each(np.linspace(0.2, 0.4, SPINS))).over(lm.neighbours.between(PAIRS), of=(0, 1)),
        share={0: lm.each(share)},
    )
    return lm.LiePoissonSystem(lm.SO3() ** SPINS * lm.SE3() ** BODIES, terms)


def momenta() -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    return [rng.normal(size=(SPINS, 3)), rng.normal(size=(BODIES, 6))]


def by_hand(t: float, y: np.ndarray) -> np.ndarray:
    """The equations of the magnet, in NumPy."""
    s, m = y[: 3 * SPINS].reshape(-1, 3), y[3 * SPINS :].reshape(-1, 6)
    w = -(np.roll(s, 1, 0) + np.roll(s, -1, 0)) - [0.0, 0.0, 0.1]
    xi = m / J
    k = np.linspace(0.2, 0.4, SPINS) * np.linspace(0.5, 1.5, SPINS)
    for (i, j), c in zip(PAIRS, k):
        w[i] -= c * m[j, :3]
        xi[j, :3] -= c * s[i]
    turn = np.cross(m[:, :3], xi[:, :3]) + np.cross(m[:, 3:], xi[:, 3:])
    move = np.cross(m[:, 3:], xi[:, :3])
    return np.concatenate([np.cross(s, w).ravel(), np.hstack([turn, move]).ravel()])


def drop(n: int, m: int, graph: Any, held: Any = ()) -> tuple[Any, Any]:
    """Bodies and ions: each body has an inertia of its own, each ion a charge."""
    rng = np.random.default_rng(4)
    inertia = rng.uniform(1.0, 2.0, size=(n, 6))
    inertia[:, 3:] = 1.0
    kinetic = lm.Terms(
        lm.PerSite(lm.KineticEnergy(lm.each(inertia))).over(of=0),
        lm.PerSite(lm.KineticEnergy([2.0, 2.0, 2.0])).over(of=1),
    )
    bodies = lm.LiePoissonSystem(lm.SE3() ** n * lm.VectorSpace(3) ** m, kinetic)
    field = lm.Terms(
        Soft(1.0).over(graph, of=0),
        Soft(0.5).over(graph, of=1),
        Coulomb(0.3).over(graph, of=(0, 1)),
        Trap(1.0).over(of=0),
        Trap(lm.each(np.linspace(1.0, 2.0, m))).over(of=1),
        charge={1: lm.each(np.linspace(-1.0, 1.0, m))},
        held=held,
    )
    system = lm.MechanicalSystem(bodies, field)
    g = lm.SE3().random(rng, n)
    g[:, :3, 3] = 2.0 * rng.normal(size=(n, 3))
    mu = [0.3 * rng.normal(size=(n, 6)), 0.3 * rng.normal(size=(m, 3))]
    for k, sites in dict(held or {}).items():
        mu[k][sites] = 0.0
    return system, system.state(mu=mu, g=[g, 2.0 * rng.normal(size=(m, 3))])


def runs(system: Any, method: Any, start: Any, **options: Any) -> list[np.ndarray]:
    run = lm.integrate(system, method, start, **options)
    return [*run.mu, *(run.g or [])]


def same(a: list[np.ndarray], b: list[np.ndarray]) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


@pytest.mark.slow
def test_against_numpy() -> None:
    system = magnet()
    start = system.state(mu=momenta())
    run = lm.integrate(system, lm.RKMK(order=8), start, h=0.1, steps=10, compiled=False)
    y = np.concatenate([x.ravel() for x in momenta()])
    ours = np.asarray(system.group.ad_star(system.velocity(y), y))
    assert np.allclose(ours, by_hand(0.0, y), rtol=0.0, atol=1e-13)
    found = solve_ivp(by_hand, (0.0, 1.0), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    last = np.concatenate([x[-1].ravel() for x in run.mu])
    assert np.abs(last - found).max() < 1e-10
    assert [x.shape for x in run.mu] == [(11, SPINS, 3), (11, BODIES, 6)]
    names = {kept.name for kept in run.drift().kept}
    assert names >= {"energy"}


@pytest.mark.slow
@native
def test_by_sites_as_written_out(monkeypatch: pytest.MonkeyPatch) -> None:
    start = magnet().state(mu=momenta())
    options: dict[str, Any] = {"h": 0.05, "steps": 3}
    few = runs(magnet(), lm.RKMK(order=3), start, compiled=False, **options)
    monkeypatch.setattr(lm.System, "small", 0)
    start = magnet().state(mu=momenta())
    assert same(few, runs(magnet(), lm.RKMK(order=3), start, compiled=False, **options))
    found = lm.integrate(magnet(), lm.RKMK(order=3), start, compiled=True, **options)
    assert found.compiled
    assert same(few, [*found.mu])
    named = {kept.name for kept in found.drift().kept}
    assert named == {
        "energy", "Casimir 1 of species 0", "Casimir 1 of species 1", "Casimir 2 of species 1",
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("graph", [lm.neighbours.all_pairs(), lm.neighbours.within(2.0)], ids=repr)
@pytest.mark.parametrize("method", [lm.KickDrift(), lm.LieVerlet(), lm.RKMK(order=2)], ids=repr)
def test_fields_as_written_out(graph: Any, method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    options: dict[str, Any] = {"h": 0.02, "steps": 2, "compiled": False}
    few = runs(*_with(method, drop(3, 4, graph, {0: [1]})), **options)
    monkeypatch.setattr(lm.System, "small", 0)
    assert same(few, runs(*_with(method, drop(3, 4, graph, {0: [1]})), **options))
    assert np.array_equal(few[2][0, 1], few[2][-1, 1])


def _with(method: Any, given: tuple[Any, Any]) -> tuple[Any, Any, Any]:
    return given[0], method, given[1]


@native
@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.KickDrift(), lm.RKMK(order=3)], ids=repr)
def test_native_bits(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lm.System, "small", 0)
    given = _with(method, drop(3, 4, lm.neighbours.all_pairs(), {0: [1]}))
    plain, fast = (runs(*given, h=0.02, steps=3, compiled=c) for c in (False, True))
    assert same(plain, fast)


@native
@pytest.mark.slow
def test_lists_saving_and_going_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With lists of neighbours, and without them."""
    system, start = drop(130, 60, lm.neighbours.within(1.5), {1: [3]})
    plan = lm.Plan(system, lm.KickDrift(), h=0.004, every=3)
    run = plan.run(start, steps=10)
    assert run.energy[0] == pytest.approx(system.energy(np.array(start.mu), np.array(start.g)), rel=1e-12)
    assert np.ptp(run.energy) < 1e-5 * abs(run.energy[0])
    first = plan.run(start, steps=4)
    first.save(tmp_path / "run.npz")
    for before in (first, lm.Trajectory.load(tmp_path / "run.npz")):
        rest = plan.resume(before, steps=6)
        assert same([x[-1] for x in (*run.mu, *run.g)], [x[-1] for x in (*rest.mu, *rest.g)])
    few = lm.Plan(system, lm.KickDrift(), h=0.004, every=3, record=("energy",)).run(start, steps=10)
    assert np.array_equal(few.energy, run.energy)
    monkeypatch.setattr("liemech.rooms.sites.runs.lists.LEAST", 10**9)
    again = lm.Plan(system, lm.KickDrift(), h=0.004, every=3).run(start, steps=10)
    assert same([*run.mu, *run.g], [*again.mu, *again.g])


def test_species_of_one_group() -> None:
    """Two species of spins are one power, of which an edge tells the parts."""
    n, m = 3, 4
    pairs = [(i, j) for i in range(n) for j in range(m)]
    two = lm.LiePoissonSystem(lm.SO3() ** n * lm.SO3() ** m, Exchange(1.0).over(lm.neighbours.all_pairs(), of=(0, 1)))
    one = lm.LiePoissonSystem(
        lm.SO3() ** (n + m), Exchange(1.0).over(lm.neighbours.edges([(i, n + j) for i, j in pairs], sites=n + m))
    )
    mu = np.random.default_rng(1).normal(size=(n + m, 3))
    split = lm.integrate(two, lm.RKMK(), two.state(mu=[mu[:n], mu[n:]]), h=0.1, steps=3, compiled=False).mu
    whole = lm.integrate(one, lm.RKMK(), one.state(mu=mu), h=0.1, steps=3, compiled=False).mu
    assert np.abs(np.concatenate(split, axis=1) - whole).max() < 1e-15


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 2), (2, 1)])
def test_one_site_of_a_species(n: int, m: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lm.System, "small", 0)
    system, start = drop(n, m, lm.neighbours.all_pairs())
    run = lm.integrate(system, lm.KickDrift(), start, h=0.01, steps=2, compiled=False)
    assert run.mu[0].shape == (3, n, 6)
    assert np.ptp(run.energy) < 1e-4


@pytest.mark.slow
def test_driven_and_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    @lm.record
    class Pulse(lm.Term):
        B: lm.Vec

        def energy(self, a: Any, t: float) -> float:
            return -lm.formulas.exp(-t * t) * lm.dot(self.B, a.mu)

    @lm.record
    class Drag(lm.Term):
        rate: float

        def covector(self, t: float, a: Any) -> Any:
            return -self.rate * a.xi

    group = lm.SO3() ** 2 * lm.SE3() ** 2
    terms = lm.Terms(Pulse([1.0, 0.0, 0.0]).over(of=0), lm.PerSite(lm.KineticEnergy(J)).over(of=1))
    driven = lm.DrivenLiePoissonSystem(group, terms)
    mu = [momenta()[0][:2], momenta()[1][:2]]
    found = []
    for small in (48, 0):
        monkeypatch.setattr(lm.System, "small", small)
        found.append(runs(driven, lm.RKMK(), driven.state(mu=mu), h=0.1, steps=2, compiled=False))
    assert same(*found)
    system, start = drop(2, 2, lm.neighbours.all_pairs())
    load: Any = lm.Terms(Drag(0.5).over(of=1))
    slowed = lm.MechanicalSystem(system.body, system.potential, load=load)
    found = []
    for small in (48, 0):
        monkeypatch.setattr(lm.System, "small", small)
        found.append(runs(slowed, lm.KickDrift(), start, h=0.1, steps=2, compiled=False))
    assert same(*found)


def test_splittings_of_spins_take_one_species() -> None:
    group = lm.SO3() ** 2 * lm.SO3() ** 2
    system = lm.LiePoissonSystem(group, Exchange(1.0).over(lm.neighbours.chain(2), of=0))
    start = system.state(mu=np.ones(12))
    for method in (lm.SublatticeSplitting(), lm.BondSplitting()):
        with pytest.raises(IncompatibleSystem, match="one species"):
            lm.integrate(system, method, start, h=0.1, steps=1)


@pytest.mark.slow
def test_laws_of_the_group() -> None:
    group = lm.SO3() ** 2 * lm.VectorSpace(2) ** 1
    lm.check_group(group)
    assert repr(group) == "SO3() ** 2 * VectorSpace(2) ** 1"
    g = [lm.SO3().random(1, (4, 2)), np.zeros((4, 1, 2))]
    back = group.compose(g, [np.stack([np.eye(3)] * 2), np.zeros((1, 2))])
    assert all(np.array_equal(x, y) for x, y in zip(g, back))
    assert lm.SO3() * lm.VectorSpace(3) == lm.ProductGroup(lm.SO3(), lm.VectorSpace(3))


def test_what_is_wrong_is_named() -> None:
    group, ring = lm.SO3() ** 5 * lm.SE3() ** 3, lm.neighbours.ring(5)
    between, free = lm.neighbours.between, lm.PerSite(lm.KineticEnergy(J)).over(of=1)
    wrong: list[tuple[str, Any]] = [
        ("SE3.. .. 1", lambda: lm.SO3() ** 5 * lm.SE3()),
        ("which species", lambda: lm.LiePoissonSystem(group, Exchange(1.0).over(ring))),
        ("which species", lambda: lm.LiePoissonSystem(group, lm.Terms(Zeeman([0.0, 0.0, 1.0])))),
        ("species 2", lambda: lm.LiePoissonSystem(group, Exchange(1.0).over(ring, of=2))),
        ("of is the number", lambda: Exchange(1.0).over(ring, of=-1)),
        ("of is the number", lambda: Exchange(1.0).over(ring, of=(0, 1, 0))),
        ("5 sites, and the system 3", lambda: lm.LiePoissonSystem(group, Exchange(1.0).over(ring, of=1))),
        ("between sites of one", lambda: lm.LiePoissonSystem(group, Exchange(1.0).over(ring, of=(0, 1)))),
        (r"edge 1, \(4, 3\)", lambda: lm.LiePoissonSystem(
            group, Exchange(1.0).over(between([(0, 0), (4, 3)]), of=(0, 1)))),
        (r"edges 0, \(1, 2\), and 1", lambda: between([(1, 2), (1, 2)])),
        (r"edge 0, \(1, 1, 0\), ties a site to itself", lambda: lm.LiePoissonSystem(
            group, Volume().over(between([(1, 1, 0)]), of=(0, 0, 1)))),
        ("between which species", lambda: lm.LiePoissonSystem(
            lm.SO3() ** 2, Exchange(1.0).over(between([(0, 1)])))),
        ("of one; write", lambda: lm.LiePoissonSystem(lm.SO3() ** 5, Exchange(1.0).over(ring, of=0))),
        ("no 'share'", lambda: lm.LiePoissonSystem(group, lm.Terms(
            Cross(1.0).over(between(PAIRS), of=(0, 1)), share={1: 2.0}))),
        ("species 4", lambda: lm.LiePoissonSystem(group, lm.Terms(free, share={4: 1.0}))),
        ("2 values for 5 sites", lambda: lm.LiePoissonSystem(
            group, lm.Terms(free, share={0: lm.each([1.0, 2.0])}))),
        ("site 5 of species 0", lambda: lm.LiePoissonSystem(group, lm.Terms(free, held={0: [5]}))),
        ("held is told", lambda: lm.LiePoissonSystem(group, lm.Terms(free, held=[5]))),
        ("held is told", lambda: lm.LiePoissonSystem(
            lm.SO3() ** 5, lm.Terms(Zeeman([0.0, 0.0, 1.0]), held={0: [1]}))),
        (r"mu\[1\] has shape", lambda: magnet().state(mu=[np.zeros((SPINS, 3)), np.zeros((2, 6))])),
        ("each of the 2 species", lambda: magnet().state(mu=np.zeros((SPINS, 3)))),
        ("has 1 parts", lambda: magnet().state(mu=[np.zeros((SPINS, 3))])),
    ]  # fmt: skip
    for words, made in wrong:
        with pytest.raises(InvalidInput, match=words):
            made()
    start = momenta()
    start[1][2, 4] = np.nan
    with pytest.raises(InvalidInput, match=r"mu\[1\]"):
        magnet().state(mu=start)


def test_sites_of_two_species_in_one_place() -> None:
    system, start = drop(2, 3, lm.neighbours.all_pairs())
    g = system.body.group.by_species(np.array(start.g), "Element")
    g[1][2] = g[0][1][:3, 3]
    with pytest.raises(InvalidInput, match="1 of species 0 and 2 of species 1 are in one place"):
        system.state(mu=np.zeros(system.body.group.dim), g=g)


def test_a_site_that_fails_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lm.System, "small", 0)
    free = lm.PerSite(lm.KineticEnergy(J)).over(of=1)
    system = lm.LiePoissonSystem(
        lm.SO3() ** SPINS * lm.SE3() ** BODIES, lm.Terms(Zeeman([0.0, 0.0, 1.0]).over(of=0), free)
    )
    mu = momenta()
    mu[1][1] = 1e200
    with pytest.raises(NotFinite, match="site 1 of species 1"):
        lm.integrate(system, lm.RKMK(), system.state(mu=mu), h=0.1, steps=2, compiled=False)


def test_three_sites_of_two_species(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = lm.neighbours.between([(0, 1, 0), (1, 2, 0), (2, 0, 1), (4, 3, 2)])
    system = lm.LiePoissonSystem(lm.SO3() ** SPINS * lm.SE3() ** BODIES, Volume().over(ends, of=(0, 0, 1)))
    start = system.state(mu=momenta())
    found = []
    for small in (48, 0):
        monkeypatch.setattr(lm.System, "small", small)
        found.append(runs(system, lm.RKMK(order=2), start, h=0.05, steps=2, compiled=False))
    assert same(*found)
    mu = momenta()
    by_hand = sum(
        float(np.cross(mu[0][i], mu[0][j]) @ mu[1][k, :3]) for i, j, k in [(0, 1, 0), (1, 2, 0), (2, 0, 1), (4, 3, 2)]
    )
    assert float(system.energy(start.mu)) == pytest.approx(by_hand, rel=1e-14)


def test_derivatives_of_more_than_is_written_out_are_refused() -> None:
    """Of several species there is no tangent map site by site, and the error says how many sites there are."""
    terms = lm.Terms(Zeeman([0.0, 0.0, 0.1]).over(of=0), Zeeman([0.1, 0.0, 0.0]).over(of=1))
    system = lm.LiePoissonSystem(lm.SO3() ** 60 * lm.SO3() ** 50, terms)
    begin = system.state(mu=[np.ones((60, 3)), np.ones((50, 3))])
    with pytest.raises(IncompatibleSystem, match=r"a run site by site has no tangent map of .*, and this one has 110"):
        lm.Plan(system, lm.RKMK(order=4), h=0.1).tangent(begin, steps=1, along=np.ones(330))


@pytest.mark.parametrize("record", [[("mu", {1: [0]})], [["mu", [0]]], [("mu", {0})]], ids=repr)
def test_what_names_no_sites_to_record_is_refused(record: Any) -> None:
    """Sites to record are numbers in a list, and what else is given is refused as such."""
    system = magnet()
    with pytest.raises(InvalidInput, match=r"record.* is "):
        lm.integrate(system, lm.RKMK(order=4), system.state(mu=momenta()), h=0.1, steps=1, record=record)


@pytest.mark.parametrize("held", [{0.5: [0]}, {"spins": [0]}, {-1: [0]}, {None: [0]}], ids=repr)
def test_species_whose_sites_are_held_have_whole_numbers(held: Any) -> None:
    """Of 0.5 the whole part held a site of species 0."""
    with pytest.raises(InvalidInput, match="held: its values are told by the numbers of species, from 0"):
        lm.Terms(Trap(1.0).over(of=0), held=held)
