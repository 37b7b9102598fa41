"""Every method on every carrier: one body, spins and bodies that meet each other (by sites), linkages in memory.

One table says which pairs step, and in which form; all others are refused.  A pair that steps keeps the laws of its
method on every carrier alike: the order, beside RKMK of order 8 written out; the step of the equation written out for
all bodies; the way back, if it is symmetric; momenta on their orbits, elements on their groups and, by methods for
constraints, the conditions; an energy without trend, if it is symplectic; and the bits of plain Python.
"""

from __future__ import annotations

import functools
import re
from typing import Any

import numpy as np
import pytest
from orders import slope
from shipped import METHODS

import liemech as lm
from liemech.compiler import kernel
from liemech.errors import IncompatibleSystem
from liemech.joints import Linkage, Spring
from liemech.joints import chain as rods_of
from liemech.rooms.derivatives.of_sites.adjoint import BackwardRun
from liemech.simulation.runs.carry import SiteCarry

TURNED = np.asarray(lm.SO3().exp(np.random.default_rng(3).normal(size=(3, 3))))
MOMENTA = 0.8 * np.random.default_rng(1).normal(size=(3, 3)) + [0.0, 0.0, 1.0]


# ---------------------------------------------------------------- carriers


@lm.record
class Exchange(lm.Term):
    def energy(self, a: Any, b: Any) -> Any:
        return -lm.dot(a.mu, b.mu)


@lm.record
class Level(lm.Term):
    def energy(self, a: Any) -> Any:
        return -0.6 * a.mu[2]


@lm.record
class Tie(lm.Term):
    def energy(self, a: Any, b: Any) -> Any:
        return -0.7 * lm.sum([lm.dot(x, y) for x, y in zip(a.g, b.g)])


@lm.record
class Weight(lm.Term):
    def energy(self, a: Any) -> Any:
        return 0.9 * a.g[2, 2] + 0.2 * a.g[2, 0]


@lm.record
class Tether(lm.Potential):
    def energy(self, g: Any) -> Any:
        x, y, z = g[0, 3] - 1.0, g[1, 3], g[2, 3] + 0.5
        return 0.5 * (x * x + y * y + z * z)


@lm.record
class WrittenOut(Linkage):
    small = 10**9


def body(whole: bool) -> tuple[Any, Any]:
    heavy = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.2]), lm.models.FixedPointGravity(1.3, [0.2, 0.1, 0.9]))
    return heavy, heavy.state(mu=MOMENTA[0], g=TURNED[0])


def spins(whole: bool) -> tuple[Any, Any]:
    terms = lm.Terms(Exchange().over(lm.neighbours.ring(3)), Level())
    system = lm.LiePoissonSystem(lm.SO3() ** 3, terms)
    return system, system.state(mu=MOMENTA)


def bodies(whole: bool) -> tuple[Any, Any]:
    free = lm.LiePoissonSystem(lm.SO3() ** 3, lm.PerSite(lm.KineticEnergy([1.0, 1.5, 2.2])))
    system = lm.MechanicalSystem(free, lm.Terms(Tie().over(lm.neighbours.ring(3)), Weight()))
    return system, system.state(mu=MOMENTA, g=TURNED)


def links(whole: bool) -> tuple[Any, Any]:
    rods = rods_of(3, radius=0.3)
    kind: Any = WrittenOut if whole else Linkage
    made = kind(rods.links, rods.joints, forces=[Spring(2, 2.0)], potential={0: Tether(), 2: Tether()})
    return made, made.state(angles={0: [0.5, 0.1, 0.0], 1: [0.0, 0.3, 0.0]}, rates={2: [1.0, 0.0, 2.0]})


def two_links(whole: bool) -> tuple[Any, Any]:
    rods = rods_of(2, axis=[0.0, 1.0, 0.0])
    return rods, rods.state(angles={0: 0.7, 1: 0.2}, rates={1: 0.5})


CARRIERS: dict[str, Any] = {"body": body, "spins": spins, "bodies": bodies, "two links": two_links, "links": links}

# ---------------------------------------------------------------- the table

LINKS, FIELD = ("two links", "links"), ("body", "bodies")
RATTLE = lm.LieRATTLE()
STEPS: dict[lm.Method, tuple[str, ...]] = {
    **dict.fromkeys((lm.RKMK(order=4), lm.CommutatorFree(order=4), lm.CrouchGrossman(order=3)), tuple(CARRIERS)),
    lm.Taylor(4, lm.Exponential()): tuple(CARRIERS),
    **dict.fromkeys((lm.RKMK(order=2, retraction=lm.Cayley()), lm.Taylor(4)), ("spins",)),
    **dict.fromkeys((lm.LiePoissonHamiltonJacobi(2), lm.LiePoissonHamiltonJacobi(4)), ("spins",)),
    **dict.fromkeys((lm.SublatticeSplitting(), lm.BondSplitting()), ("spins",)),
    **dict.fromkeys((lm.GalerkinVariational(order=2), lm.LieVerlet(), lm.KickDrift(), lm.KickDrift(order=4)), FIELD),
    lm.SymplecticRKMK(order=4): FIELD,
    **dict.fromkeys((lm.KickDrift(lm.ThreeRotations()), lm.KickDrift(lm.SphericalMidpoint())), ("body",)),
    lm.MultipleTimeSteps([2]): ("bodies", "links"),
    **dict.fromkeys((RATTLE, lm.LieRATTLE(lm.Cayley()), lm.Composition(RATTLE, order=4)), LINKS),
}
"""Of each method the carriers on which it steps: many sites by sites, links beyond two in memory, a body and two links
written out.
"""

TIMED = next(x for x in METHODS if isinstance(x, lm.ReversibleController) and isinstance(x.method, lm.LieVerlet))
AS_ONE_BODY: dict[lm.Method, tuple[str, ...]] = {TIMED: FIELD}
"""What steps as one body, whatever carries it: equal steps of another time."""

IN_MEMORY_ALONE = ("links", lm.MultipleTimeSteps([2])), ("links", lm.Taylor(4, lm.Exponential()))
"""Steps of links in memory that are none of the equation written out: the slow force is that of the potential there, and
momenta have series of their own beside a chart of poses, where all numbers are in one chart if they are written out.
"""


def run(carrier: str, method: Any, whole: bool = False, compiled: bool = False, start: Any = None, **way: Any) -> Any:
    """A run of a carrier in its own form, or as a whole, written out."""
    system, begun = CARRIERS[carrier](whole)
    times = {name: way.pop(name) for name in ("steps", "t_end", "t_eval") if name in way}
    with pytest.MonkeyPatch.context() as patch:
        if carrier in ("spins", "bodies"):
            patch.setattr(lm.System, "small", 1000 if whole else 0)
        plan = lm.Plan(system, method, compiled=compiled, progress=False, **way)
        return plan.run(start or begun, **times)


def state(seen: Any) -> np.ndarray:
    """The numbers of the last state."""
    return np.concatenate([np.ravel(x) for x in (seen.mu[-1], None if seen.g is None else seen.g[-1]) if x is not None])


@functools.cache
def motion(carrier: str) -> np.ndarray:
    """Where it leads, by RKMK of order 8."""
    return state(run(carrier, lm.RKMK(order=8), whole=True, h=END / 24, steps=24))


@pytest.mark.parametrize("carrier", CARRIERS)
def test_which_pairs_step(carrier: str) -> None:
    for method in dict.fromkeys((*METHODS, *STEPS)):
        system, _ = CARRIERS[carrier](False)
        try:
            method.require(system)
            refusal = None
        except IncompatibleSystem as error:
            refusal = str(error)
        if carrier in (*STEPS.get(method, ()), *AS_ONE_BODY.get(method, ())):
            assert refusal is None, refusal
            by_sites = carrier not in ("body", "two links") and method is not TIMED
            assert isinstance(run(carrier, method, h=0.01, steps=1).carry, SiteCarry) is by_sites, method
        else:
            assert refusal is not None, method
            assert re.match(r"\w+", refusal)[0] in repr(method), refusal  # the part of the method that does not fit


KEEP_CONDITIONS = lm.LieRATTLE, lm.Composition, lm.MultipleTimeSteps
PAIRS = [(carrier, method) for method, carriers in STEPS.items() for carrier in carriers]
END = 0.24


CASES = [pytest.param(*pair, marks=pytest.mark.slow, id=f"{pair[0]}-{pair[1]!r}") for pair in PAIRS]
"""Every pair that steps."""


def missed(carrier: str, seen: Any) -> float:
    """How far orbits, groups and conditions are missed."""
    system, start = CARRIERS[carrier](False)
    if carrier in LINKS:
        return max(float(np.abs(x).max()) for x in system.conditions_at(seen.mu[-1], seen.g[-1]))
    if carrier == "spins":
        lengths = [np.linalg.norm(np.asarray(x), axis=-1) for x in (seen.mu[-1], start.mu)]
        return float(np.abs(lengths[0] - lengths[1]).max())
    return float(np.abs(seen.g[-1] @ np.swapaxes(seen.g[-1], -1, -2) - np.eye(3)).max())


@pytest.mark.parametrize(("carrier", "method"), CASES)
def test_laws_of_a_method(carrier: str, method: Any) -> None:
    counts, exact = (4, 8, 16), motion(carrier)
    runs = [run(carrier, method, h=END / n, steps=n) for n in counts]
    errors = [np.abs(state(x) - exact).max() for x in runs]
    assert slope(counts, errors) == pytest.approx(-method.order, abs=0.5)
    if (carrier, method) not in IN_MEMORY_ALONE:
        whole = state(run(carrier, method, whole=True, h=END / 4, steps=4))
        assert np.abs(whole - state(runs[0])).max() < 1e-13 * np.abs(exact).max()
    keeps = carrier not in LINKS or isinstance(method, KEEP_CONDITIONS)
    assert missed(carrier, runs[1]) < (2e-14 if keeps else 10.0 * errors[1])
    if method.symmetric_on(CARRIERS[carrier](False)[0]):
        back = state(run(carrier, method, start=runs[1].last, h=-END / 8, steps=8))
        there = state(run(carrier, method, h=END, steps=0))
        assert np.abs(back - there).max() < 1e-13 * np.abs(there).max()


COMPONENTS = {"body": 6, "spins": 9, "bodies": 18}


@pytest.mark.parametrize(("carrier", "method"), [x for x in CASES if x.values[0] in COMPONENTS])
def test_gradients_go_backwards_through_what_goes_forwards(carrier: str, method: Any) -> None:
    """<w, J v> = <J^T w, v> of a method on a carrier, J v forwards."""
    system, start = CARRIERS[carrier](False)
    v, w = np.random.default_rng(2).normal(size=(2, COMPONENTS[carrier]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lm.System, "small", 0 if carrier != "body" else 10**9)
        plan = lm.Plan(system, method, h=0.05, every=2, compiled=False, progress=False)
        if carrier != "body" and isinstance(method, lm.Taylor):  # power series go forwards alone
            assert not goes_back(plan, start)
            return
        assert carrier == "body" or goes_back(plan, start)
        forwards = plan.tangent(start, steps=2, along=v).tangent["along"][-1]
        backwards = plan.pullback(w, start, steps=2)["start"]
    assert abs(w @ forwards - backwards @ v) < 1e-14 * np.linalg.norm(backwards) * np.linalg.norm(v)


def goes_back(plan: Any, start: Any) -> bool:
    try:
        BackwardRun(plan._sites, plan._sites.started(plan, start), 2, 0.0)
    except IncompatibleSystem:
        return False
    return True


@pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")
@pytest.mark.parametrize(("carrier", "method"), CASES)
def test_bits_of_plain_python_and_an_energy_without_trend(carrier: str, method: Any) -> None:
    plain, native = (run(carrier, method, compiled=c, h=0.05, steps=3) for c in (False, True))
    assert native.compiled and np.array_equal(state(plain), state(native))
    if method.symplectic:
        energy = run(carrier, method, compiled=True, h=0.05, steps=4000, record=["energy"]).energy
        early, late = np.split(energy[1:], 2)
        assert np.ptp(late) < 1.5 * np.ptp(early)
        assert abs(early.mean() - late.mean()) < 0.2 * np.ptp(early)


@pytest.mark.slow
@pytest.mark.parametrize("carrier", ["spins", "bodies"])
@pytest.mark.parametrize("order", [5, 8])
def test_adaptive_steps_are_those_of_the_equation_written_out(carrier: str, order: int) -> None:
    """As many of them, rejected ones as well, by one control and one norm; and one way between them."""
    way: Any = {"h": 0.4, "rtol": 10.0 ** (-order - 1), "atol": 1e-9, "t_end": 0.4, "t_eval": [0.0, 0.17, 0.4]}
    a, b = (run(carrier, lm.RKMK(order=order), whole=whole, **way) for whole in (False, True))
    assert isinstance(a.carry, SiteCarry) and not isinstance(b.carry, SiteCarry)
    assert (a.steps, a.rejected) == (b.steps, b.rejected) and a.steps > 1
    # errors are differences, with rounding of eps over the tolerance
    assert np.abs(a.mu - b.mu).max() < 1e-9 * np.abs(a.mu).max()
