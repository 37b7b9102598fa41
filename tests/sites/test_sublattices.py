"""Splittings of coupled spins by sublattices and by bonds: colours, exact identities, orders, other
people's integrators, and one bit for all ways to run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import slope
from scipy.integrate import solve_ivp
from terms_of_spins import Biquadratic, Chiral, Exchange, Twist, Zeeman

import liemech as lm
from liemech.compiler.sites.site_calls import shares
from liemech.errors import IncompatibleSystem, IntegrationFailure, InvalidInput, InvalidType
from liemech.rooms.sites.colouring import PlacesByColour, colours_of, colours_of_bonds, colours_of_edges
from liemech.simulation.runs.carry import SiteCarry
from liemech.tableaus.splittings import BLANES_MOAN4, STRANG, SYMPLECTIC_EULER

near = lm.neighbours


@lm.record
class Unequal(lm.Term):
    """Of the product of two spins, and of parameters of theirs that tell them apart."""

    K: float

    def energy(self, a: Any, b: Any) -> float:
        return self.K * (a.size - 2.0 * b.size) * lm.dot(a.mu, b.mu)


@lm.record
class EasyAxis(lm.Term):
    D: float
    n: lm.Vec

    def energy(self, a: Any) -> float:
        return -self.D * lm.dot(self.n, a.mu) ** 2


def directions(sites: int, seed: int = 1) -> np.ndarray:
    found = np.random.default_rng(seed).normal(size=(sites, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def spins(sites: int, *terms: Any, **own: Any) -> Any:
    return lm.LiePoissonSystem(lm.SO3() ** sites, lm.Terms(*terms, **own))


FIELD = np.array([0.3, -0.2, 0.5])
AXIS = np.array([0.0, 0.6, 0.8])


def triangle() -> Any:
    """An odd ring with everything that sublattices take: three colours and a part of single sites."""
    pairs = near.edges([(0, 1), (1, 2), (2, 0), (2, 3)], ordered=True)
    return spins(
        4,
        Exchange(lm.each([1.0, 0.7, -0.4, 0.9])).over(pairs),
        Twist([0.2, 0.1, -0.3]).over(pairs),
        Chiral(0.3).over(near.edges([(0, 1, 2)], sites=4)),
        Zeeman(FIELD),
        EasyAxis(0.4, AXIS),
    )


# ------------------------------------------------------------------ colours


def triples(n: int) -> Any:
    i = np.arange(n)
    return near.edges(np.stack([i, (i + 1) % n, (i + 2) % n], axis=1))


def random_graph() -> Any:
    pairs = np.random.default_rng(0).integers(0, 300, (900, 2))
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    return near.edges(pairs, sites=300)


@pytest.mark.parametrize(
    ("graph", "fewest"),
    [
        (near.ring(10), 2),
        (near.ring(11), 3),
        (near.chain(7), 2),
        (near.square(5, 6), 3),
        (near.square(5, 7, periodic=False), 2),
        (near.cubic(4, 6, 4), 2),
        (near.cubic(5, 5, 5), 3),
        (near.edges([(0, 5), (5, 2), (2, 7), (7, 0)], sites=9), 2),
        (triples(12), 3),
        (triples(13), 4),
        (triples(5), 5),
        (near.all_pairs(6), 6),
    ],
    ids=repr,
)
def test_no_edge_ties_two_sites_of_one_colour_and_colours_are_few(graph: Any, fewest: int) -> None:
    found = colours_of([graph], graph.sites)
    for edge in graph.edges.tolist():
        assert len({int(found.colours[i]) for i in edge}) == len(edge)
    assert found.count == fewest


def test_colours_of_any_graph_and_of_several() -> None:
    graph = random_graph()
    found = colours_of([graph, near.ring(300)], 300)
    assert found.fits(graph.edges) and found.fits(near.ring(300).edges)
    assert found.count <= 7
    assert colours_of([], 5).count == 1


@pytest.mark.parametrize(
    ("graph", "most"),
    [(near.ring(10), 2), (near.ring(9), 3), (near.cubic(4, 5, 3), 8), (random_graph(), 24), (triples(9), 5)],
    ids=repr,
)
def test_edges_of_one_colour_share_no_site(graph: Any, most: int) -> None:
    edges = graph.edges
    colours = colours_of_bonds(graph) if graph.arity == 2 else colours_of_edges(edges)
    assert len(colours) == len(edges)
    for colour in range(int(colours.max()) + 1):
        ends = edges[colours == colour].ravel()
        assert len({*ends.tolist()}) == len(ends)
    assert colours.max() < most


def test_places_are_whole_groups_and_lead_back() -> None:
    found = colours_of([near.ring(35)], 35)
    places = PlacesByColour.of_colouring(found)
    assert np.array_equal(places.sites[places.places], np.arange(35))
    for (begin, end), group in zip(places.ranges, found.groups, strict=True):
        assert begin % 16 == end % 16 == 0
        assert {*places.sites[begin:end].tolist()} == {*group.tolist()}


# ------------------------------------------------------------------ the motion


def turned(s: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Rodrigues' formula: rows of s turned by -w."""
    angle = np.linalg.norm(w, axis=1, keepdims=True)
    n = -w / angle
    return (
        np.cos(angle) * s
        + np.sin(angle) * np.cross(n, s)
        + (1.0 - np.cos(angle)) * np.sum(n * s, axis=1, keepdims=True) * n
    )


def test_a_step_is_that_of_numpy_written_by_hand() -> None:
    n, h = 20, 0.2
    system, s = spins(n, Exchange(1.3).over(near.ring(n)), Zeeman(FIELD)), directions(n)
    run = lm.integrate(system, lm.SublatticeSplitting(), system.state(mu=s), h=h, steps=5, progress=False)
    even, odd = np.arange(n) % 2 == 0, np.arange(n) % 2 == 1
    # Strang's splitting begins and ends with the last colour
    for _ in range(5):
        for some, time in ((odd, 0.5 * h), (even, h), (odd, 0.5 * h)):
            field = -1.3 * (np.roll(s, 1, axis=0) + np.roll(s, -1, axis=0)) - FIELD
            s = np.where(some[:, None], turned(s, time * field), s)
    assert np.abs(run.mu[-1] - s).max() < 4e-15


def rate(s: np.ndarray) -> np.ndarray:
    """s' = s x dH/ds of `triangle`."""
    xi = -FIELD - 2.0 * 0.4 * (s @ AXIS)[:, None] * AXIS
    for (i, j), J in zip([(0, 1), (1, 2), (2, 0), (2, 3)], [1.0, 0.7, -0.4, 0.9], strict=True):
        D = np.array([0.2, 0.1, -0.3])
        xi[i] += -J * s[j] + np.cross(s[j], D)
        xi[j] += -J * s[i] + np.cross(D, s[i])
    for i, j, k in [(0, 1, 2), (1, 2, 0), (2, 0, 1)]:
        xi[i] += 0.3 * np.cross(s[j], s[k])
    return np.cross(s, xi)


def exact(rate: Any, s: np.ndarray, t_end: float) -> np.ndarray:
    """Where SciPy finds the spins."""
    found = solve_ivp(
        lambda t, y: rate(y.reshape(s.shape)).ravel(), (0.0, t_end), s.ravel(), method="DOP853", rtol=1e-13, atol=1e-13
    )
    end: np.ndarray = found.y[:, -1].reshape(s.shape)
    return end


def bond_rate(s: np.ndarray) -> np.ndarray:
    """s' = s x dH/ds of `pairs`."""
    xi = -2.0 * 0.5 * (s @ AXIS)[:, None] * AXIS
    for i, j in [(0, 1), (1, 2), (2, 0)]:
        c = -1.0 + 2.0 * 0.3 * (s[i] @ s[j])
        xi[i] += c * s[j]
        xi[j] += c * s[i]
    return np.cross(s, xi)


def pairs() -> Any:
    """An odd ring with everything that bonds take."""
    ring = near.ring(3)
    return spins(3, Exchange(1.0).over(ring), Biquadratic(0.3).over(ring), EasyAxis(0.5, AXIS))


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4, 6, 8])
@pytest.mark.parametrize("method", [lm.SublatticeSplitting, lm.BondSplitting])
def test_errors_fall_with_the_order(method: Any, order: int) -> None:
    bonds = method is lm.BondSplitting
    system, s = (pairs(), directions(3)) if bonds else (triangle(), directions(4))
    end = exact(bond_rate if bonds else rate, s, 1.5)
    counts = {2: (16, 32, 64), 4: (6, 12, 24), 6: (4, 6, 9), 8: (6, 7, 9)}[order]
    errors = []
    for n in counts:
        run = lm.integrate(system, method(order), system.state(mu=s), h=1.5 / n, steps=n, every=n, progress=False)
        errors.append(np.abs(run.mu[-1] - end).max())
    assert errors[-1] > 3e-12
    assert abs(slope([1.5 / n for n in counts], errors) - order) < (0.15 if order < 6 else 0.6)


@pytest.mark.slow
def test_the_energy_and_every_length_are_kept_to_rounding() -> None:
    lattice = near.cubic(3, 4, 5)
    system = spins(60, Exchange(1.0).over(lattice), Zeeman(FIELD))
    for order in (2, 8):
        run = lm.integrate(
            system, lm.SublatticeSplitting(order), system.state(mu=directions(60)), h=0.3, steps=200, progress=False
        )
        size = np.abs(run.energy[0]) + 60.0
        assert np.abs(run.energy - run.energy[0]).max() < 1e-14 * size
        assert np.abs(np.linalg.norm(run.mu, axis=-1) - 1.0).max() < 1e-14


@pytest.mark.slow
def test_the_energy_wanders_as_rounding_does() -> None:
    lattice = near.cubic(10, 10, 10)
    system = spins(1000, Exchange(1.0).over(lattice))
    run = lm.integrate(
        system,
        lm.SublatticeSplitting(),
        system.state(mu=directions(1000)),
        h=0.1,
        steps=100_000,
        every=500,
        progress=False,
    )
    assert np.sqrt(np.mean((run.energy - run.energy[0]) ** 2)) < 1e-13 * 3000.0
    assert np.abs(np.linalg.norm(run.mu[-1], axis=-1) - 1.0).max() < 1e-13


def poisson(system: Any, method: Any, s: np.ndarray, h: float) -> float:
    """By how much Phi' B(mu) Phi'^T = B(Phi(mu)) is missed, B the cross products of every site."""

    def step(mu: np.ndarray) -> np.ndarray:
        run = lm.integrate(system, method, system.state(mu=mu), h=h, steps=1, compiled=False, compensated=False)
        found: np.ndarray = run.mu[-1]
        return found

    def structure(mu: np.ndarray) -> np.ndarray:
        found = np.zeros((s.size, s.size))
        for i, x in enumerate(mu):
            found[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = np.cross(np.eye(3), x)
        return found

    eps = 2.0**-17
    units = np.eye(s.size).reshape(-1, *s.shape)
    slopes = [(step(s + eps * u) - step(s - eps * u)).ravel() / (2.0 * eps) for u in units]
    phi = np.array(slopes).T
    return float(np.abs(phi @ structure(s) @ phi.T - structure(step(s))).max())


def test_bonds_are_symplectic_and_sublattices_are_not() -> None:
    chain, s = near.chain(3), directions(3)
    system = spins(3, Exchange(1.0).over(chain), Zeeman(FIELD))
    assert poisson(system, lm.BondSplitting(), s, 0.4) < 1e-8
    assert poisson(system, lm.SublatticeSplitting(), s, 0.4) > 1e-3


@pytest.mark.slow
def test_claims_are_observed() -> None:
    ring = near.ring(4)
    system = spins(4, Exchange(1.0).over(ring), Zeeman(FIELD))
    report = lm.check_method(
        lm.SublatticeSplitting(), system, system.state(mu=directions(4)), keeps=("Casimir", "energy")
    )
    assert report["Poisson"].verdict == "not seen"
    chain = near.chain(3)
    system = spins(3, Exchange(1.0).over(chain), Biquadratic(0.3).over(chain), Zeeman(FIELD))
    start = system.state(mu=directions(3), g=lm.SO3().random(np.random.default_rng(4), 3))
    report = lm.check_method(lm.BondSplitting(), system, start, keeps=("spatial momentum",))
    assert report["Poisson"].verdict == "holds"
    assert report["symplectic"].verdict in ("holds", "seen")


def test_a_turn_on_any_group_is_that_of_its_exponential() -> None:
    group, h = lm.SE3(), 0.3
    system = lm.LiePoissonSystem(group**2, lm.Terms(Exchange(0.8).over(near.chain(2))))
    rng = np.random.default_rng(5)
    mu, g = rng.normal(size=(2, 6)), group.random(rng, 2)
    run = lm.integrate(system, lm.SublatticeSplitting(), system.state(mu=mu, g=g), h=h, steps=1, compiled=False)
    for site, time in ((1, 0.5 * h), (0, h), (1, 0.5 * h)):
        step = group.exp(-0.8 * time * mu[1 - site])
        mu[site], g[site] = group.Ad_star(step, mu[site]), g[site] @ step
    assert np.abs(run.mu[-1] - mu).max() < 1e-14
    assert np.abs(run.g[-1] - g).max() < 1e-14


def test_bonds_of_unitary_groups() -> None:
    group = lm.SU(2)
    system = lm.LiePoissonSystem(group**3, lm.Terms(Exchange(0.8).over(near.ring(3))))
    mu = np.random.default_rng(5).normal(size=(3, 3))
    there = lm.integrate(system, lm.BondSplitting(), system.state(mu=mu), h=0.2, steps=6, compiled=False)
    back = lm.integrate(system, lm.BondSplitting(), system.state(mu=there.mu[-1]), h=-0.2, steps=6, compiled=False)
    assert np.abs(back.mu[-1] - mu).max() < 1e-13
    assert np.abs(there.mu.sum(axis=1) - mu.sum(axis=0)).max() < 1e-13
    assert np.abs(there.mu[-1] - mu).max() > 0.1


# ------------------------------------------------------------------ magnons


def test_waves_have_the_frequencies_of_the_closed_form() -> None:
    """Small waves on a ferromagnetic ring, m = s_x + i s_y: with phi = 2 J h, a step is a matrix on the
    amplitudes on the two sublattices of determinant exp(2 i phi) and trace 2 exp(i phi) cos psi,
    sin(psi/2) = cos(k) sin(phi/2): frequencies (phi -+ psi)/h, which is 2 J (1 -+ cos k) for h -> 0.
    """
    n, J, h, size = 60, 1.1, 0.35, 1e-7
    system = spins(n, Exchange(J).over(near.ring(n)))
    for number in (1, 7, 14, 22):
        k = 2.0 * np.pi * number / n
        m = size * np.exp(1j * k * np.arange(n))
        s = np.stack([m.real, m.imag, np.ones(n)], axis=1)
        run = lm.integrate(system, lm.SublatticeSplitting(), system.state(mu=s), h=h, steps=12, progress=False)
        wave = (run.mu[..., 0] + 1j * run.mu[..., 1]) * np.exp(-1j * k * np.arange(n))
        phi = 2.0 * J * h
        psi = 2.0 * np.arcsin(np.cos(k) * np.sin(0.5 * phi))
        for some in (wave[:, ::2].mean(axis=1), wave[:, 1::2].mean(axis=1)):
            rest = some[2:] - 2.0 * np.exp(1j * phi) * np.cos(psi) * some[1:-1] + np.exp(2j * phi) * some[:-2]
            assert np.abs(rest).max() < 1e-8 * size


# ------------------------------------------------------------------ one bit for all


@pytest.mark.slow
@pytest.mark.parametrize(("order", "compensated", "attitudes"), [(2, True, True), (4, None, False)])
def test_loops_have_the_bits_of_what_is_written_out(
    order: int, compensated: Any, attitudes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring = near.ring(4)
    system = triangle() if order == 2 else spins(4, Exchange(lm.each([1.0, 0.5, -0.3, 0.8])).over(ring))
    method = lm.SublatticeSplitting(order)
    g = lm.SO3().random(np.random.default_rng(4), 4) if attitudes else None
    start = system.state(mu=directions(4), g=g)

    def run(small: int, compiled: bool, **options: Any) -> Any:
        monkeypatch.setattr(type(system), "small", small)
        plan = lm.Plan(
            system, method, h=0.1, compensated=compensated, compiled=compiled, progress=False,
            **options,
        )  # fmt: skip
        return plan.resume(plan.run(start, steps=1), steps=2) if options else plan.run(start, steps=3)

    found = run(10**6, False)
    others = [run(0, False)]
    if lm.compiler.kernel.available() is None:
        others += [run(0, True), run(0, True, every=2)]
    for other in others:
        assert isinstance(other.carry, SiteCarry) and not isinstance(found.carry, SiteCarry)
        assert np.array_equal(other.mu[-1], found.mu[-1])
        assert not attitudes or np.array_equal(other.g[-1], found.g[-1])


def test_held_sites_rest() -> None:
    ring = near.ring(20)
    system = spins(20, Exchange(1.0).over(ring), held=[0, 7])
    run = lm.integrate(
        system,
        lm.SublatticeSplitting(),
        system.state(mu=directions(20)),
        h=0.1,
        steps=3,
        compiled=False,
        progress=False,
    )
    assert np.array_equal(run.mu[-1][[0, 7]], run.mu[0][[0, 7]])
    assert (run.mu[-1][1] != run.mu[0][1]).all()
    with pytest.raises(IncompatibleSystem, match="site 0 is held"):
        lm.BondSplitting().require(system)


SPIN = {"every": 100, "record": [("spin", lambda t, site: site.mu)]}


def of_finite_totals(t: float, total: Any) -> float:
    assert np.isfinite(total.spin[0])
    return 1.0


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.SublatticeSplitting(4), lm.BondSplitting()], ids=repr)
@pytest.mark.parametrize("saved", [{"every": 1}, {"every": 100}, SPIN, SPIN | {"events": [of_finite_totals]}])
def test_the_site_that_overflows_is_named(method: Any, saved: dict[str, Any]) -> None:
    fields = np.outer(np.arange(40) == 23, [0.0, 0.0, 1e200])
    system = spins(40, Exchange(1.0).over(near.ring(40)), Zeeman(lm.each(fields)))
    start = system.state(mu=directions(40))
    with pytest.raises(IntegrationFailure, match=r"overflowed.*site 23, after step 0") as caught:
        lm.integrate(system, method, start, h=0.1, steps=100, progress=False, **saved)
    assert caught.value.trajectory.t[-1] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.SphericalMidpoint(), lm.ImplicitMidpoint()], ids=repr)
def test_midpoints_name_a_site_beside_the_one_that_is_huge(method: Any) -> None:
    if lm.compiler.kernel.available() is not None:
        pytest.skip("needs llvmlite")
    system, mu = spins(200, Exchange(1.0).over(near.ring(200))), directions(200)
    mu[77] *= 1e200
    with pytest.raises((IntegrationFailure, InvalidInput), match=r"site 7[678], (step 1 |at the start)"):
        lm.integrate(system, method, system.state(mu=mu), h=0.1, steps=5, progress=False)


# ------------------------------------------------------------------ refusals


def test_terms_without_a_known_motion_are_named() -> None:
    ring, body = near.ring(4), lm.PerSite(lm.KineticEnergy([1.0, 2.0, 3.0]))
    for method, terms, match in [
        (lm.SublatticeSplitting(), [Biquadratic(0.3).over(ring)], "Biquadratic.*not affine"),
        (lm.SublatticeSplitting(), [Exchange(1.0).over(ring), body], "PerSite.*changes as the site"),
        (lm.BondSplitting(), [Exchange(1.0).over(ring), body], "PerSite.*changes as the site"),
        (lm.BondSplitting(), [Chiral(1.0).over(near.edges([(0, 1, 2)], sites=4))], "Chiral"),
        (
            lm.BondSplitting(),
            [Twist([1.0, 0.0, 0.0]).over(near.edges([(0, 1)], sites=4, ordered=True))],
            r"Twist.*SublatticeSplitting\(order=2\) accepts it",
        ),
    ]:
        with pytest.raises(IncompatibleSystem, match=match):
            method.require(spins(4, *terms))
    system = lm.LiePoissonSystem(lm.SE3() ** 2, lm.Terms(Exchange(0.8).over(near.chain(2))))
    with pytest.raises(IncompatibleSystem, match="no coordinates in which the sum"):
        lm.BondSplitting().require(system)
    with pytest.raises(IncompatibleSystem, match="many coupled sites"):
        lm.SublatticeSplitting().require(lm.RigidBody([1.0, 2.0, 3.0]))


def test_tableaus_are_looked_at() -> None:
    assert lm.SublatticeSplitting(tableau=STRANG) == lm.SublatticeSplitting()
    assert eval(repr(lm.BondSplitting(6)), {"BondSplitting": lm.BondSplitting}).order == 6
    with pytest.raises(InvalidInput, match=r"one of \[2, 4, 6, 8\]"):
        lm.SublatticeSplitting(3)
    with pytest.raises(InvalidInput, match="quadratic in a momentum"):
        lm.SublatticeSplitting(tableau=BLANES_MOAN4)
    with pytest.raises(InvalidInput, match="symmetric"):
        lm.BondSplitting(tableau=SYMPLECTIC_EULER)
    with pytest.raises(InvalidType, match="SplittingTableau"):
        lm.BondSplitting(tableau="Strang")  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("attitudes", [False, True])
@pytest.mark.parametrize("order", [2, 4])
def test_bonds_by_sites_have_the_bits_of_what_is_written_out(
    order: int, attitudes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An odd ring, a chain with an end, parameters of edges and of sites, several terms."""
    rng = np.random.default_rng(6)
    ring, n = near.ring(5), 5
    some = spins(
        n,
        Exchange(lm.each(rng.normal(size=5))).over(ring),
        Unequal(0.7).over(near.edges([(0, 1), (3, 2), (2, 4)], ordered=True)),
        EasyAxis(0.5, AXIS),
        size=lm.each(rng.normal(size=n)),
    )
    g = lm.SO3().random(np.random.default_rng(4), n) if attitudes else None
    start = some.state(mu=directions(n), g=g)
    ends = []
    for small, compiled in ((48, False), (0, False), (0, None)):
        monkeypatch.setattr(type(some), "small", small)
        plan = lm.Plan(some, lm.BondSplitting(order), h=0.1, every=2, compiled=compiled, progress=False)
        run = plan.resume(plan.run(start, steps=3), steps=2)
        assert isinstance(run.carry, SiteCarry) == (small == 0)
        ends.append(run)
    for run in ends[1:]:
        assert np.array_equal(run.mu[-1], ends[0].mu[-1])
        assert not attitudes or np.array_equal(run.g[-1], ends[0].g[-1])


@pytest.mark.slow
def test_many_bonds_keep_the_total_spin_and_their_lengths() -> None:
    lattice = near.cubic(6, 5, 4)
    system = spins(lattice.sites, Exchange(1.0).over(lattice), Biquadratic(0.3).over(lattice))
    start = system.state(mu=directions(lattice.sites))
    run = lm.integrate(system, lm.BondSplitting(order=4), start, h=0.1, steps=200, every=50)
    total = run.mu.sum(axis=1)
    assert np.abs(total - total[0]).max() < 1e-13 * lattice.sites
    assert np.abs(np.linalg.norm(run.mu, axis=-1) - 1.0).max() < 1e-13
    assert np.ptp(run.energy) < 1e-3 * abs(run.energy[0])


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.SublatticeSplitting(), lm.BondSplitting()], ids=repr)
@pytest.mark.parametrize(
    "lattice",
    [
        near.cubic(7, 5, 4),  # of three colours
        near.ring(101),  # of three, of which one has a single site
        near.square(9, 12, periodic=False),  # of two
        near.edges([(0, i) for i in range(1, 70)]),  # of two, of which one has a single site
        near.chain(1),
        near.chain(2),
        near.ring(3),
    ],
    ids=["cubic", "odd ring", "open", "star", "1", "2", "3"],
)
def test_workers_share_the_sites_of_every_colour(method: Any, lattice: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    if lm.compiler.kernel.available() is not None:
        pytest.skip("needs llvmlite")
    monkeypatch.setattr("liemech.compiler.sites.site_calls.SHARE", 1)
    sites = lattice.sites or 70
    system = spins(sites, Exchange(1.0).over(lattice), EasyAxis(0.5, AXIS))
    start = system.state(mu=directions(sites))
    one, *more = [
        lm.integrate(system, method, start, h=0.1, steps=7, every=3, compiled=True, workers=w).mu for w in (1, 2, 3)
    ]
    assert all(np.array_equal(x, one) for x in more)


@pytest.mark.parametrize("count", [1, 2, 15, 16, 17, 97, 96, 10_001])
@pytest.mark.parametrize("workers", [1, 2, 3, 5])
def test_shares_of_workers_differ_by_one_group_at_most(count: int, workers: int) -> None:
    end = -(-count // 8) * 8
    found = shares(count, end, workers)
    assert [b for b, _ in found] == [0, *(e for _, e in found[:-1])] and found[-1][1] == end
    groups = [-(-(e - b) // 16) for b, e in found]
    assert min(groups) > 0 and max(groups) - min(groups) <= 1
    assert len(found) == min(workers, -(-count // 16))
