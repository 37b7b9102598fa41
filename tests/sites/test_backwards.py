"""Runs of many sites gone through backwards: J^T w and derivatives by parameters of terms, against the
tangent map, differences, and SciPy.
"""

from __future__ import annotations

from math import comb
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from terms_of_spins import Chiral, Exchange, Twist, Zeeman
from test_runs_by_sites import chain, directions, native, spins

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, NotCompilable
from liemech.rooms.derivatives.of_sites import adjoint as sites_adjoint
from liemech.rooms.derivatives.of_sites.adjoint import BackwardRun
from liemech.rooms.derivatives.reversal import go_back, repetitions

edges = lm.neighbours.edges


@lm.record
class Swinging(lm.Term):
    """A field that swings, on the charge of a site."""

    B: lm.Vec
    rate: float

    def energy(self, a: Any, t: float) -> float:
        return -a.charge * lm.formulas.cos(self.rate * t) * lm.dot(self.B, a.mu)


@lm.record
class Spring(lm.Term):
    """A spring between two bodies, which also turns them."""

    stiffness: float
    length: float

    def energy(self, a: Any, b: Any) -> float:
        stretch = lm.norm(a.g[:3, 3] - b.g[:3, 3]) - self.length
        return 0.5 * self.stiffness * stretch**2 + 0.1 * lm.dot(a.g[0, :3], b.g[0, :3])


@lm.record
class Weight(lm.Term):
    """The weight of a body."""

    gravity: float

    def energy(self, a: Any) -> float:
        return a.mass * self.gravity * a.g[2, 3]


@lm.record
class Easy(lm.Term):
    """An easy axis."""

    D: float

    def energy(self, a: Any) -> float:
        return -self.D * a.mu[2] ** 2


@pytest.fixture(autouse=True)
def by_sites(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lm.System, "small", 0)


def back(plan: Any, start: Any, given: Any, names: tuple[str, ...] = ()) -> Any:
    return BackwardRun(plan._sites, plan._sites.started(plan, start), max(given), 0.0, names).back(given)


def require_transposed(plan: Any, start: Any, steps: int) -> None:
    """<w, J v> = <J^T w, v>, with w at the end and half of it after two steps."""
    rng = np.random.default_rng(5)
    first = plan._sites.started(plan, start)
    run = sites_adjoint.BackwardRun(plan._sites, first, steps, 0.0)
    v, w = rng.normal(size=(2, run.components))
    forwards = plan.replace(every=1).tangent(start, steps=steps, along=v).tangent["along"]
    backwards, _ = run.back({steps: w, 2: 0.5 * w})
    size = np.linalg.norm(backwards) * np.linalg.norm(v)
    assert abs(w @ forwards[-1] + 0.5 * w @ forwards[2] - backwards @ v) < 1e-14 * size


CHARGES = [1.0, -0.5, 2.0, 0.0, 0.3]


def magnet(J: Any, B: Any = (0.1, 0.2, 0.3), rate: float = 2.0, D: Any = None, charge: Any = tuple(CHARGES)) -> Any:
    """Five spins in a field that swings, with one of them held; with D all kinds of terms."""
    twist = Twist([0.3, 0.1, -0.2] if D is None else D).over(edges([(1, 0), (1, 2)], sites=5))
    terms = lm.Terms(
        Exchange(lm.each(J)).over(lm.neighbours.ring(5)),
        Swinging(B, rate),
        *([] if D is None else [twist, Chiral(0.7).over(edges([(0, 1, 2)], sites=5))]),
        charge=lm.each(charge),
        held=[4],
    )
    return lm.DrivenLiePoissonSystem(lm.SO3() ** 5, terms)


COUPLINGS = [1.0, 0.7, 1.3, -0.4, 0.9]
FEW: dict[str, Any] = {"J": COUPLINGS, "rate": 2.0, "charge": CHARGES}
ALL: dict[str, Any] = FEW | {"B": [0.1, 0.2, 0.3], "D": [0.3, 0.1, -0.2]}


def differences(function: Any, x: Any) -> np.ndarray:
    """The derivative of a number by the numbers of x, by differences of order 8."""
    x, found = np.asarray(x, dtype=float), []
    for i in range(x.size):
        e = np.zeros(x.size)
        e[i] = 2.0**-7
        e = e.reshape(x.shape)
        weights = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
        found.append(sum(c * (function(x + k * e) - function(x - k * e)) for k, c in weights) / 2.0**-7)
    return np.reshape(found, x.shape)


@pytest.mark.parametrize("kept", [1, 2, 3, 7])
def test_few_states_are_kept(kept: int) -> None:
    """Every step is made at most as often as the binomial says, from states that are there."""
    for steps in (1, 2, 5, 21, 120):
        made, order = np.zeros(steps, dtype=int), []

        def advance(state: int, first: int, end: int, made: Any = made) -> int:
            assert state == first < end
            made[first:end] += 1
            return end

        def back(state: int, step: int, order: Any = order) -> None:
            assert state == step
            order.append(step)

        go_back(steps, kept, 0, advance, back)
        assert order == [*range(steps)][::-1]
        r = repetitions(steps, kept)
        assert made.max() <= r
        assert comb(kept + r, r) >= steps > (comb(kept + r - 1, kept) if r else 0)


@pytest.mark.slow
@native
@pytest.mark.parametrize("given", [FEW, pytest.param(ALL, marks=pytest.mark.slow)], ids=["few", "all"])
def test_parameters_of_terms(given: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """By those of edges, of all edges, of terms in time, beside a site that is held: as differences of
    runs, in plain Python and natively with the same bits, whatever is kept.
    """
    steps, names, magnet_of = 25, tuple(given), lambda x: magnet(**{**given, **x})
    system = magnet_of({})
    start, w = system.state(mu=directions(5)), np.random.default_rng(2).normal(size=15)
    plan = lm.Plan(system, lm.RKMK(order=2), h=0.1, progress=False)
    slope, found = back(plan, start, {steps: w}, names)
    whole = plan.replace(every=steps).tangent(start, steps=steps).tangent["start"]
    assert np.abs(slope - w @ whole[-1]).max() < 1e-14 * np.abs(whole).max()
    assert np.abs(slope[12:] - w[12:]).max() > 0.1  # others feel the one that is held
    for name, value in given.items():

        def end(x: Any, name: str = name) -> Any:
            system = magnet_of({name: x if x.ndim else float(x)})
            short = lm.Plan(system, plan.method, h=0.1, every=steps, progress=False)
            return w @ short.run(start, steps=steps).mu[-1].ravel()

        assert np.abs(found[name] - differences(end, value)).max() < 1e-11
    for name, few in (("ROOM", 1), ("NEAR", 1), ("LEAST", 2)):
        monkeypatch.setattr(sites_adjoint, name, few)
    again = back(plan, start, {steps: w}, names)
    assert np.array_equal(again[0], slope)
    plain = back(plan.replace(compiled=False), start, {steps: w}, names)
    assert np.array_equal(plain[0], slope)
    assert all(np.array_equal(plain[1][name], again[1][name]) for name in names)


@pytest.mark.slow
def test_the_order_of_the_gradient() -> None:
    """That of RKMK4 tends to that of the exact motion, found by SciPy, with the fourth power of h."""
    n, T = 4, 0.8
    J, s = np.array([1.0, 0.6, 1.4, 0.8]), directions(n)
    w = np.random.default_rng(0).normal(size=3 * n)

    def exact(J: np.ndarray) -> Any:
        def rate(t: float, y: np.ndarray) -> np.ndarray:
            m = y.reshape(n, 3)
            J_before = np.roll(J, 1)
            field = -J[:, None] * np.roll(m, -1, axis=0) - J_before[:, None] * np.roll(m, 1, axis=0)
            return np.cross(m, field).ravel()

        return w @ solve_ivp(rate, (0, T), s.ravel(), "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]

    wanted, errors = differences(exact, J), []
    bonds = edges([(0, 1), (1, 2), (2, 3), (3, 0)])
    for steps in (4, 8, 16):
        system = lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(Exchange(lm.each(J)).over(bonds)))
        plan = lm.Plan(system, lm.RKMK(order=4), h=T / steps, compiled=False)
        found = back(plan, system.state(mu=s), {steps: w}, ("J",))[1]["J"]
        errors.append(np.abs(found - wanted).max())
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.abs(slopes - 4.0).max() < 0.3


METHODS_OF_SPINS = [
    lm.SublatticeSplitting(),
    lm.RKMK(order=3, retraction=lm.Cayley()),
    lm.RKMK(order=2),
    lm.SublatticeSplitting(order=4),
    lm.RKMK(order=6),
    lm.RKMK(order=5, truncation="closed"),
    lm.CommutatorFree(order=3),
    lm.CommutatorFree(),
    lm.CrouchGrossman(order=3),
    lm.SphericalMidpoint(),
    lm.Composition(lm.ImplicitMidpoint(), order=4),
    lm.RKMK(tableau=lm.tableaus.gauss(1)),
    lm.RKMK(tableau=lm.tableaus.gauss(2), retraction=lm.Cayley()),
]


@native
@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS_OF_SPINS, ids=repr)
def test_methods_of_spins(method: Any) -> None:
    """On rings of an odd number of spins, with elements and without, and of two spins."""
    for n, graph in ((7, lm.neighbours.ring(7)), (2, lm.neighbours.chain(2))):
        terms = lm.Terms(Exchange(1.0).over(graph), Zeeman([0.1, 0.2, 0.3]), held=[0])
        system = lm.LiePoissonSystem(lm.SO3() ** n, terms)
        plan = lm.Plan(system, method, h=0.1, progress=False)
        require_transposed(plan, system.state(mu=directions(n)), 20)
    g = np.asarray(lm.SO3().exp(np.random.default_rng(3).normal(size=(2, 3))))
    require_transposed(plan, system.state(mu=directions(2), g=g), 20)


def bodies(held: Any = (), stiffness: Any = (10.0, 20.0, 30.0), gravity: float = 9.81) -> tuple[Any, Any]:
    """Four bodies in space on springs."""
    inertia = [0.1, 0.15, 0.2, 1.0, 1.0, 1.0]
    free = lm.LiePoissonSystem(lm.SE3() ** 4, lm.PerSite(lm.KineticEnergy(inertia)))
    spring = Spring(lm.each(stiffness), 1.0).over(lm.neighbours.chain(4))
    terms = lm.Terms(spring, Weight(gravity), mass=lm.each([1.0, 2.0, 3.0, 0.5]), held=held)
    system = lm.MechanicalSystem(free, terms)
    rng = np.random.default_rng(4)
    g = np.asarray(lm.SE3().exp(0.4 * rng.normal(size=(4, 6))))
    g[:, 0, 3] += 1.1 * np.arange(4)
    mu = rng.normal(size=(4, 6))
    mu[list(held)] = 0.0
    return system, system.state(mu=mu, g=g)


METHODS_OF_BODIES = [
    lm.KickDrift(),
    lm.LieVerlet(),
    lm.KickDrift(order=4),
    lm.RKMK(order=2),
    lm.KickDrift(lm.RKMK(order=4)),
    lm.CommutatorFree(order=3),
]


@native
@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS_OF_BODIES, ids=repr)
def test_methods_of_bodies(method: Any) -> None:
    """Bodies in a field, with the bits of plain Python."""
    system, start = bodies(held=[1])
    plan = lm.Plan(system, method, h=0.02, compiled=True, progress=False)
    require_transposed(plan, start, 12)
    names, w = ("stiffness", "gravity"), np.random.default_rng(1).normal(size=48)
    natively = back(plan, start, {2: w}, names)
    plain = back(plan.replace(compiled=False), start, {2: w}, names)
    assert np.array_equal(natively[0], plain[0])
    assert all(np.array_equal(natively[1][name], plain[1][name]) for name in names)


@lm.record
class Friction(lm.Term):
    """Friction on the first of two bodies, by how it moves beside the other, rougher where they are far."""

    c: float

    def covector(self, t: float, a: Any, b: Any) -> Any:
        far = lm.dot(a.g[:3, 3], b.g[:3, 3])
        return -self.c * a.rough * (a.xi - 0.5 * b.xi) * (1.0 + 0.3 * far)


@lm.record
class Drive(lm.Term):
    """A drag with the square of the velocity that comes and goes, and a push along an axis of space."""

    c: float

    def covector(self, t: float, a: Any) -> Any:
        push = lm.vec(0.0, 0.0, 0.0, a.g[0, 0], a.g[0, 1], a.g[0, 2])
        return push - self.c * lm.formulas.cos(t) * lm.norm(a.xi) * a.xi


ROUGH = lm.each([1.0, 2.0, 0.5, 0.7])
LOADS = {
    "of each": lm.Terms(Drive(lm.each([0.1, 0.2, 0.3, 0.4])), held=[2]),
    "pairs alike": lm.Terms(Friction(0.2).over(lm.neighbours.ring(4)), Drive(0.1), rough=ROUGH, held=[1]),
    "ordered pairs": lm.Terms(
        Friction(lm.each([0.1, 0.2, 0.3])).over(edges([(0, 1), (2, 1), (3, 0)], ordered=True)), rough=ROUGH
    ),
    "all pairs": lm.Terms(Friction(0.2).over(lm.neighbours.all_pairs()), rough=ROUGH),
}
UNDER_LOADS = [lm.RKMK(order=2), lm.KickDrift(), lm.LieVerlet(), lm.CommutatorFree(order=2)]


@pytest.mark.slow
@pytest.mark.parametrize("method", UNDER_LOADS, ids=repr)
@pytest.mark.parametrize("load", LOADS)
def test_loads(load: str, method: Any) -> None:
    """Forces without an energy are gone back through as the forces of the field are."""
    system, start = bodies(stiffness=(1.0, 2.0, 3.0))
    loaded = lm.MechanicalSystem(system.body, system.potential, load=LOADS[load])
    plan = lm.Plan(loaded, method, h=0.02, progress=False, compiled=False)
    require_transposed(plan, start, 3)


@lm.record
class Pulsed(lm.Term):
    """A field by a table."""

    B: lm.Vec
    pulse: lm.PiecewisePolynomial

    def energy(self, a: Any, t: float) -> float:
        return -self.pulse(t) * lm.dot(self.B, a.mu)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("method", [lm.RKMK(order=2), lm.SublatticeSplitting(), lm.CommutatorFree(order=2)], ids=repr)
def test_steps_that_are_cut(method: Any, compiled: bool) -> None:
    """At jumps of a table, one of them at the end of a step, and at breaks."""
    table = lm.PiecewisePolynomial.constant([0.0, 0.1, 0.25, 0.27, 2.0], [1.0, -2.0, 0.5, 3.0])
    terms = [Exchange(1.0).over(lm.neighbours.ring(5)), Pulsed([0.3, 0.2, 0.1], table)]
    system = lm.DrivenLiePoissonSystem(lm.SO3() ** 5, lm.Terms(*terms, held=[0]))
    for breaks in ([], [0.05, 0.3]):
        plan = lm.Plan(system, method, h=0.1, breaks=breaks, progress=False, compiled=compiled and None)
        require_transposed(plan, system.state(mu=directions(5)), 4)


LONG = pytest.mark.xfail(strict=True, raises=NotCompilable, reason="their native code exceeds what is compiled")
"""Loads between sites, by `KickDrift` and with derivatives."""


@native
@pytest.mark.slow
@pytest.mark.parametrize("load", [x if x == "of each" else pytest.param(x, marks=LONG) for x in LOADS])
def test_loads_natively(load: str) -> None:
    """With the bits of plain Python."""
    system, start = bodies()
    loaded = lm.MechanicalSystem(system.body, system.potential, load=LOADS[load])
    plan = lm.Plan(loaded, lm.KickDrift(), h=0.02, compiled=True, progress=False)
    require_transposed(plan, start, 12)
    w = np.random.default_rng(1).normal(size=48)
    natively = back(plan, start, {2: w}, ("stiffness",))
    plain = back(plan.replace(compiled=False), start, {2: w}, ("stiffness",))
    assert np.array_equal(natively[0], plain[0])
    assert np.array_equal(natively[1]["stiffness"], plain[1]["stiffness"])


@native
@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [lm.CommutatorFree(), lm.SphericalMidpoint(), lm.RKMK(tableau=lm.tableaus.gauss(2))], ids=repr
)
def test_parameters_by_flows_and_equations(method: Any) -> None:
    """As differences of runs."""
    w, J = np.random.default_rng(1).normal(size=15), [1.0, 0.7, 1.3, -0.4, 0.9]
    ring = lm.neighbours.ring(5)

    def plan_of(J: Any) -> Any:
        terms = lm.Terms(Exchange(lm.each(J)).over(ring), Zeeman([0.1, 0.2, 0.3]), held=[4])
        system = lm.LiePoissonSystem(lm.SO3() ** 5, terms)
        return lm.Plan(system, method, h=0.1, every=20, compiled=True, progress=False)

    start = plan_of(J).system.state(mu=directions(5))
    found = back(plan_of(J), start, {20: w}, ("J",))[1]["J"]
    wanted = differences(lambda x: w @ plan_of(x).run(start, steps=20).mu[-1].ravel(), J)
    assert np.abs(found - wanted).max() < 1e-10


@native
@pytest.mark.slow
def test_compositions() -> None:
    """Substeps, some of them backwards; kicks in between are one."""
    system, start = chain(5)
    method = lm.Composition(lm.LieVerlet(), order=4)
    require_transposed(lm.Plan(system, method, h=0.1, progress=False), start, 12)


@native
@pytest.mark.slow
def test_parameters_of_potentials() -> None:
    """As differences of runs."""
    w = np.append(np.random.default_rng(1).normal(size=24), np.zeros(24))
    system, start = bodies()
    plan = lm.Plan(system, lm.KickDrift(order=4), h=0.02, every=12, compiled=True, progress=False)
    found = back(plan, start, {12: w}, ("stiffness", "gravity"))[1]

    def end(stiffness: Any = (10.0, 20.0, 30.0), gravity: Any = 9.81) -> Any:
        other, _ = bodies(stiffness=stiffness, gravity=float(gravity))
        run = lm.Plan(other, plan.method, h=0.02, every=12, compiled=True, progress=False)
        return w[:24] @ run.run(start, steps=12).mu[-1].ravel()

    wanted = differences(end, [10.0, 20.0, 30.0])
    assert np.abs(found["stiffness"] - wanted).max() < 1e-11
    assert abs(found["gravity"] - differences(lambda x: end(gravity=x), 9.81)) < 1e-11


@native
@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.StormerVerlet(), lm.Splitting(order=6)], ids=repr)
def test_masses(method: Any) -> None:
    """Canonical coordinates; pairs within a cutoff, whose lists are made anew."""
    rng = np.random.default_rng(0)
    system = lm.models.NBody(np.linspace(1.0, 2.0, 20))
    start = system.state(q=3.0 * rng.normal(size=60), p=rng.normal(size=60))
    require_transposed(lm.Plan(system, method, h=0.01, progress=False), start, 12)


@native
@pytest.mark.slow
def test_lists_of_neighbours() -> None:
    water, k, spacing = lm.models.SPC(), 6, 3.1
    free = lm.LiePoissonSystem(lm.SE3() ** k**3, lm.PerSite(water.kinetic_energy))
    near = lm.neighbours.within(5.0, box=[k * spacing] * 3)
    system = lm.MechanicalSystem(free, lm.Terms(water.over(near)))
    g = np.stack([np.eye(4)] * k**3)
    g[:, :3, 3] = spacing * np.stack(np.meshgrid(*[np.arange(k)] * 3), -1).reshape(-1, 3)
    g[:, :3, :3] = lm.SO3().exp(np.random.default_rng(0).normal(size=(k**3, 3)))
    plan = lm.Plan(system, lm.KickDrift(), h=1e-3, progress=False)
    require_transposed(plan, system.state(mu=np.zeros((k**3, 6)), g=g), 4)


@native
@pytest.mark.slow
def test_terms_of_one_site_that_turn_by_themselves() -> None:
    ring, n = lm.neighbours.ring(6), 6
    triples = Chiral(0.4).over(edges([(0, 1, 2), (3, 4, 5)]))
    terms = lm.Terms(Exchange(1.0).over(ring), Zeeman([0.1, 0.2, 0.3]), Easy(0.3), triples)
    system = lm.LiePoissonSystem(lm.SO3() ** n, terms)
    plan = lm.Plan(system, lm.SublatticeSplitting(), h=0.1, progress=False)
    require_transposed(plan, system.state(mu=directions(n)), 20)
    with pytest.raises(IncompatibleSystem, match="parts of their own; RKMK has one"):
        back(plan, system.state(mu=directions(n)), {2: np.ones(18)}, ("J",))


@pytest.mark.slow
def test_gradient_and_pullback(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loss and a running cost of one site, and cotangents by samples, as the written-out sums of them."""
    plan = lm.Plan(spins(4), lm.RKMK(order=2), h=0.1, compiled=False)
    start = spins(4).state(mu=directions(4))
    found = plan.gradient(
        lambda site: site.mu[2] ** 2, start, steps=4, by=["start", "J"], along=lambda t, site: t * site.mu[0], every=2
    )
    run = plan.replace(every=2).run(start, steps=4)
    z = run.mu[-1, :, 2]
    assert abs(found.value - (z @ z + (run.t[:, None] * run.mu[..., 0]).sum())) < 1e-14
    given = np.zeros((3, 4, 3))
    given[-1, :, 2] = 2.0 * z
    given[..., 0] += run.t[:, None]
    back = plan.pullback({"mu": given}, start, steps=4, by=["start", "J"], every=2)
    flat = plan.pullback(given.reshape(3, 12), start, steps=4, every=2)
    whole = plan.replace(every=2).tangent(start, steps=4).tangent["start"]
    wanted = np.einsum("ki,kij->j", given.reshape(3, 12), whole)
    for other in (found, back, flat):
        assert np.abs(other["start"] - wanted).max() < 1e-14
    assert np.array_equal(found["J"], back["J"])
    monkeypatch.setattr(lm.System, "small", 12)  # a system of any size has this meaning of a site
    few = plan.replace().gradient(lambda site: site.mu[2] ** 2, start, steps=4)
    assert abs(few.value - z @ z) < 1e-14
    monkeypatch.setattr(lm.System, "small", 0)
    with pytest.raises(IncompatibleSystem, match="lambda site"):
        plan.gradient(lambda state: state.mu[0], start, steps=4)
    with pytest.raises(InvalidInput, match=r"\(4, 3\), as the samples are; got \(3,\)"):
        plan.pullback({"mu": [1.0, 2.0, 3.0]}, start, steps=4)
    system, first = chain(3)
    bodies = lm.Plan(system, lm.KickDrift(), h=0.05, compiled=False)
    w = np.random.default_rng(1).normal(size=(3, 3, 3))
    whole = bodies.tangent(first, steps=2).tangent["start"][-1]
    end = bodies.run(first, steps=2).g[-1]
    e = np.asarray([lm.SO3().algebra.hat(x) for x in np.eye(3)])
    components = np.einsum("sij,sik,ckj->sc", w, end, e)
    found = bodies.pullback({"g": w}, first, steps=2)["start"]
    assert np.abs(found - components.ravel() @ whole[9:]).max() < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize("adaptive", [False, True])
def test_gradients_of_systems_that_are_written_out(adaptive: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A loss of all numbers of few sites in a row, and cotangents by sites, as the tangent map says."""
    monkeypatch.setattr(lm.System, "small", 12)
    way, far = ({"rtol": 1e-7}, {"t_end": 0.3}) if adaptive else ({"h": 0.1}, {"steps": 3})
    plan = lm.Plan(spins(3), lm.RKMK(order=5), compiled=False, **way)
    start = spins(3).state(mu=directions(3))
    run = plan.tangent(start, **far)
    whole, end = run.tangent["start"][-1], run.mu[-1].ravel()
    found = plan.gradient(lambda state: state.mu[0] ** 2 + state.mu[4] * state.mu[8], start, **far)
    slope = np.zeros(9)
    slope[[0, 4, 8]] = 2.0 * end[0], end[8], end[4]
    assert abs(found.value - end[0] ** 2 - end[4] * end[8]) < 1e-14
    assert np.abs(found["start"] - slope @ whole).max() < 1e-14
    for w in (end, end.reshape(3, 3)):
        assert np.abs(plan.pullback({"mu": w}, start, **far)["start"] - end @ whole).max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True], ids=["momenta", "elements"])
@pytest.mark.parametrize(
    "method",
    [lm.BondSplitting(), lm.LiePoissonHamiltonJacobi(order=2), lm.BondSplitting(order=4),
     lm.LiePoissonHamiltonJacobi(), lm.LiePoissonHamiltonJacobi(order=2, retraction=lm.Cayley())],
    ids=repr,
)  # fmt: skip
@native
def test_steps_that_are_symplectic(method: Any, turned: bool) -> None:
    """Those of which the way back is the step backwards."""
    n, terms = 5, [Exchange(1.0).over(lm.neighbours.ring(5)), Zeeman([0.1, 0.2, 0.3])]
    system = lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(*terms))
    g = lm.SO3().random(np.random.default_rng(4), n) if turned else None
    start = system.state(mu=directions(n), g=g)
    plan = lm.Plan(system, method, h=0.1, progress=False)
    require_transposed(plan, start, 20)
    large = 30.0 * np.arange(30.0 if turned else 15.0)  # a derivative is linear, whatever its size
    small = plan.replace(every=5).tangent(start, steps=5, against=1e-8 * large)
    found = plan.replace(every=5).tangent(start, steps=5, against=large).tangent["against"]
    assert np.abs(1e8 * small.tangent["against"] - found).max() < 1e-13 * np.abs(found).max()


@pytest.mark.slow
def test_a_symplectic_step_in_plain_python() -> None:
    """Of derivatives inside of sweeps that a derivative goes through, none is taken for another."""
    start, w = spins(3).state(mu=directions(3)), np.random.default_rng(5).normal(size=9)
    plan = lm.Plan(spins(3), lm.LiePoissonHamiltonJacobi(order=2), h=0.1, compiled=False)
    wanted = w @ plan.tangent(start, steps=1).tangent["start"][-1]
    assert np.abs(back(plan, start, {1: w})[0] - wanted).max() < 1e-14


@native
@pytest.mark.slow
def test_adaptive_taylor_steps() -> None:
    """Without a way back: the derivative of the end, from that along every component of the start."""
    system, v = spins(9), np.random.default_rng(3).normal(size=(9, 3))
    m = directions(9)
    plan = lm.Plan(system, lm.Taylor(8), rtol=1e-9, atol=1e-9, progress=False)
    loss = lambda site: site.mu[0] ** 2 * site.mu[1]  # noqa: E731
    by_start = plan.gradient(loss, system.state(mu=m), t_end=1.0, by=["start"])["start"]

    def value(e: float) -> float:
        accurate = plan.replace(rtol=1e-12, atol=1e-12)
        end = accurate.run(system.state(mu=m + e * v), t_end=1.0).mu[-1]
        return float(np.sum(end[:, 0] ** 2 * end[:, 1]))

    slope = (value(1e-4) - value(-1e-4)) / 2e-4
    assert by_start @ v.ravel() == pytest.approx(slope, rel=1e-6)
    with pytest.raises(IncompatibleSystem, match="the end alone"):
        plan.gradient(loss, system.state(mu=m), t_end=1.0, by=["start"], every=1, along=loss)


@pytest.mark.slow
def test_few_adaptive_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The map of the steps that were accepted, as where the system is written out."""
    start, w = spins(3).state(mu=directions(3)), np.arange(9.0)
    options: Any = {"rtol": 1e-5, "compiled": False}
    plan = lm.Plan(spins(3), lm.RKMK(order=5), **options)
    forwards = plan.tangent(start, t_end=0.5, along=w)
    backwards = plan.tangent(start, t_end=0.5, against=w)
    monkeypatch.setattr(lm.System, "small", 1000)
    whole = lm.Plan(spins(3), lm.RKMK(order=5), **options).tangent(start, t_end=0.5)
    assert forwards.steps == whole.steps > 1
    j = whole.tangent["start"][-1]
    assert np.abs(forwards.tangent["along"][-1] - j @ w).max() < 1e-13
    assert np.abs(backwards.tangent["against"][-1] - j.T @ w).max() < 1e-13


@native
@pytest.mark.slow
def test_adaptive_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the steps that were accepted: the map of the system as it is written out, and differences of accurate runs."""
    system, rng = magnet(**FEW), np.random.default_rng(2)
    start = system.state(mu=directions(5))
    plan = lm.Plan(system, lm.RKMK(order=5), rtol=1e-6, progress=False)
    v, w = rng.normal(size=(2, 15))
    forwards = plan.tangent(start, t_end=1.0, along=v)
    backwards = plan.tangent(start, t_end=1.0, against=w)
    monkeypatch.setattr(lm.System, "small", 1000)
    written_out = lm.Plan(system, lm.RKMK(order=5), rtol=1e-6, progress=False)
    whole = written_out.tangent(start, t_end=1.0)
    monkeypatch.setattr(lm.System, "small", 0)
    assert (forwards.steps, forwards.rejected) == (whole.steps, whole.rejected)
    assert np.array_equal(backwards.t, [0.0, 1.0])
    j = whole.tangent["start"][-1]
    assert np.abs(forwards.tangent["along"][-1] - j @ v).max() < 1e-13
    assert np.abs(backwards.tangent["against"][-1] - j.T @ w).max() < 1e-13
    costs: Any = {"along": lambda t, site: t * site.mu[0], "every": 3}
    found = plan.gradient(lambda site: site.mu[2] ** 2, start, t_end=1.0, **costs)
    run = found.run
    z = run.mu[-1, :, 2]
    assert abs(found.value - (z @ z + (run.t[:, None] * run.mu[..., 0]).sum())) < 1e-14
    assert run.t[-1] == 1.0

    def loss(J: Any) -> float:
        other = magnet(**(FEW | {"J": J}))
        accurate = lm.Plan(other, lm.RKMK(order=8), h=1.0 / 64.0, progress=False)
        return float((accurate.run(start, steps=64).mu[-1, :, 2] ** 2).sum())

    plan = lm.Plan(system, lm.RKMK(order=5), rtol=1e-10, atol=1e-11, progress=False)
    by_couplings = plan.gradient(lambda site: site.mu[2] ** 2, start, t_end=1.0, by="J")["J"]
    assert np.abs(by_couplings - differences(loss, COUPLINGS)).max() < 1e-9


@native
@pytest.mark.slow
def test_units() -> None:
    """J^T w scales with momenta and times, whatever their units."""
    found = []
    for unit, second in ((1.0, 1.0), (2.0**-60, 2.0**40), (2.0**50, 2.0**-70)):
        terms = Exchange(1.0 / (unit * second)).over(lm.neighbours.ring(6))
        system = lm.LiePoissonSystem(lm.SO3() ** 6, lm.Terms(terms))
        plan = lm.Plan(system, lm.RKMK(order=4), h=0.1 * second, progress=False)
        start = system.state(mu=unit * directions(6))
        found.append(back(plan, start, {20: np.arange(18.0)})[0])
    assert np.abs(found[1] - found[0]).max() < 1e-13
    assert np.abs(found[2] - found[0]).max() < 1e-13


@pytest.mark.parametrize(
    "inertia",
    [
        np.array([0.6, 1.1, 1.9, 18.0, 18.0, 18.0]),
        np.array([1e-3, 2e-3, 3e-3, 1.0, 1.0, 1.0]),
        np.array([[2e-4, 1e-2, 20.0], [1e-4, 1e-2, 10.0], [3e-4, 2e-2, 30.0]]).repeat(2, axis=1),
    ],
    ids=["water", "small", "each"],
)
def test_inertias_of_any_sizes(inertia: np.ndarray) -> None:
    """Molecules have moments and masses: the derivative by one was found by steps of the size of the other.  Beside one
    step of Lie and Euler, written with SciPy's exponential.
    """
    shape, unit = inertia.shape[1:], np.broadcast_to(inertia, (3, 6))
    given = lm.KineticEnergy(lm.each(inertia) if shape else inertia)
    system, h = lm.LiePoissonSystem(lm.SE3() ** 3, lm.Terms(lm.PerSite(given))), 0.01
    mu = np.random.default_rng(1).normal(size=(3, 6)) * unit

    def ends(factors: np.ndarray) -> np.ndarray:
        moved = []
        for m, J in zip(mu, unit * factors):
            ad = np.column_stack([lm.SE3().algebra.bracket(m / J, e) for e in np.eye(6)])
            moved.append(expm(h * ad).T @ m)
        return np.array(moved)

    def loss(factors: np.ndarray) -> float:
        return float((ends(factors)[:, :3] / unit[:, :3]).prod(axis=1).sum())

    plan = lm.Plan(system, lm.RKMK(order=1), h=h, compiled=False)
    by, size = "hamiltonian.parts.0.term.energy_of_one.inertia", mu.shape
    cotangent = np.zeros(size)
    rates = ends(np.ones(size))[:, :3] / unit[:, :3]
    cotangent[:, :3] = np.column_stack([rates[:, [1, 2]].prod(1), rates[:, [0, 2]].prod(1), rates[:, [0, 1]].prod(1)])
    found = plan.pullback({"mu": cotangent / unit}, system.state(mu=mu), steps=1, by=by)[by] * inertia
    wanted = differences(lambda x: loss(x * np.ones(size)), np.ones(inertia.shape))
    assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()


@lm.record
class Asks(lm.Method):
    """A step by the derivative of the energy, past the system."""

    order: ClassVar[int] = 1

    def step(self, system: Any, t: Any, state: Any, h: Any) -> Any:
        return system.displaced(lm.Exponential(), state, h * system.hamiltonian.gradient(state.mu))


@lm.record
class Turn(lm.Method):
    """Euler's step, of a velocity that is shortened where it is fast, by a root that it iterates."""

    order: ClassVar[int] = 1

    def step(self, system: Any, t: Any, state: Any, h: Any) -> Any:
        xi = system.rate(t, system.essential_part(state))
        square = 1.0 + lm.dot(xi, xi)
        root = square
        for _ in range(60):
            if abs(root * root - square) < 1e-14 * square:
                break
            root = 0.5 * (root + square / root)
        if xi[0] > 0.0:
            xi = (1.0 - 0.1 * h * root) * xi
        elif xi[1] > 0.0:
            xi = xi - h * xi[1] * xi
        return system.displaced(lm.Exponential(), state, h * xi)


@lm.record
class Memory(lm.Record):
    state: Any
    xi: Any


@lm.record
class LastVelocity(lm.Method):
    """The velocity of this step and the last one, which no state tells."""

    order: ClassVar[int] = 2

    def start(self, system: Any, state: Any, h: Any) -> Any:
        return Memory(state, system.rate(0.0, system.essential_part(state)))

    def observe(self, memory: Any) -> Any:
        return memory.state

    def step(self, system: Any, t: Any, memory: Any, h: Any) -> Any:
        xi = system.rate(t, system.essential_part(memory.state))
        return Memory(system.displaced(lm.Exponential(), memory.state, 0.5 * h * (3.0 * xi - memory.xi)), xi)


@native
@pytest.mark.slow
def test_a_method_of_ones_own() -> None:
    """With branches and a loop, nothing of which is written backwards: of spins and of bodies, plain and native."""
    terms = lm.Terms(Exchange(1.0).over(lm.neighbours.ring(5)), Zeeman([0.1, 0.2, 0.3]), held=[0])
    system, (others, start) = lm.LiePoissonSystem(lm.SO3() ** 5, terms), chain(3)
    for whole, begun in ((system, system.state(mu=directions(5))), (others, start)):
        for compiled in (False, True):
            require_transposed(lm.Plan(whole, Turn(), h=0.1, compiled=compiled, progress=False), begun, 6)


@pytest.mark.slow
def test_what_has_no_way_back() -> None:
    """Is told by name, with the cure; J^T w is found as before, direction by direction."""
    ring, start = spins(6), spins(6).state(mu=directions(6))
    w = np.arange(18.0)
    few, first = lm.Plan(spins(3), lm.Taylor(2), h=0.05, compiled=False), spins(3).state(mu=directions(3))
    for method, why in ((lm.Taylor(2), "power series"), (Asks(), "ask the system"), (LastVelocity(), "in memory")):
        with pytest.raises(IncompatibleSystem, match=why):
            back(few.replace(method=method), first, {2: w[:9]})
    wanted = w[:9] @ few.tangent(first, steps=1).tangent["start"][-1]
    found = few.tangent(first, steps=1, against=w[:9]).tangent["against"][-1]
    assert np.allclose(found, wanted, atol=1e-14)
    assert np.allclose(few.pullback(w[:9], first, steps=1)["start"], wanted, atol=1e-14)
    with pytest.raises(IncompatibleSystem, match="no derivative by J for many sites; RKMK"):
        back(lm.Plan(ring, lm.BondSplitting(), h=0.05, compiled=False), start, {1: w}, ("J",))
    with pytest.raises(IncompatibleSystem, match="may depend on J by more than the velocity"):
        back(lm.Plan(ring, Turn(), h=0.05, compiled=False), start, {1: w}, ("J",))
    plan = lm.Plan(ring, lm.RKMK(order=2), h=0.05, compiled=False)
    with pytest.raises(InvalidInput, match="K is no parameter"):
        back(plan, start, {1: w}, ("K",))
    system, first = chain(6)
    plan = lm.Plan(system, lm.KickDrift(), h=0.05, compiled=False)
    with pytest.raises(IncompatibleSystem, match=r"no derivative by .*inertia for many sites; RKMK"):
        back(plan, first, {1: np.ones(36)}, ("body.hamiltonian.parts.0.term.energy_of_one.inertia",))


A = np.random.default_rng(0).normal(size=(3, 3))
INERTIAS = {
    "axes": np.array([1.0, 1.5, 2.0]),
    "each": np.array([1.0, 1.5, 2.0]) + 0.1 * A,
    "matrix": np.diag([1.0, 1.5, 2.0]) + 0.05 * (A + A.T),
}


@native
@pytest.mark.slow
@pytest.mark.parametrize("kind", INERTIAS)
def test_inertias(kind: str) -> None:
    """An inertia is told, and its inverse used: the derivative follows by the chain rule."""
    shape = INERTIAS[kind].shape if kind == "each" else None

    def of(J: Any) -> Any:
        given = lm.each(J) if shape else J if J.ndim == 1 else 0.5 * (J + J.T)
        bond = Exchange(0.5).over(lm.neighbours.ring(3))
        terms = lm.Terms(lm.PerSite(lm.KineticEnergy(given)), bond)
        return lm.LiePoissonSystem(lm.SO3() ** 3, terms)

    def loss(J: Any) -> float:
        plan = lm.Plan(of(J), lm.RKMK(order=4), h=0.1, progress=False)
        return float((plan.run(start, steps=5).mu[-1, :, 2] ** 2).sum())

    J = INERTIAS[kind]
    system = of(J)
    start = system.state(mu=directions(3))
    plan = lm.Plan(system, lm.RKMK(order=4), h=0.1, progress=False)
    found = plan.gradient(lambda site: site.mu[2] ** 2, start, steps=5, by="inertia")["inertia"]
    assert found.shape == J.shape
    assert np.abs(found - differences(loss, J)).max() < 1e-11
