"""Multiple time steps of bodies in a field of terms: orders, identities, and one bit for all ways to run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_runs_by_sites import native

import liemech as lm
from liemech.errors import IncompatibleSystem


@lm.record
class Stiff(lm.Term):
    k: float

    def energy(self, a: Any, b: Any) -> float:
        stretch = lm.norm(a.g[:3, 3] - b.g[:3, 3]) - 1.0
        return 0.5 * self.k * stretch * stretch


@lm.record
class Soft(lm.Term):
    """Pulls at a place that is not the centre, so that bodies turn."""

    k: float

    def energy(self, a: Any) -> float:
        place = a.g[:3, 3] + 0.3 * a.g[:3, 0]
        return 0.5 * self.k * lm.dot(place, place)


def chain(n: int, *more: Any) -> tuple[Any, Any]:
    kinetic = lm.PerSite(lm.KineticEnergy([0.1, 0.15, 0.2, 1.0, 1.0, 1.0]))
    bodies = lm.LiePoissonSystem(lm.SE3() ** n, kinetic)
    field = lm.Terms(Stiff(400.0).over(lm.neighbours.chain(n)), Soft(0.5), *more)
    g = np.stack([np.eye(4)] * n)
    g[:, 0, 3], g[:, 1, 3] = 1.02 * np.arange(n), 0.1 * np.sin(np.arange(n))
    system = lm.MechanicalSystem(bodies, field)
    return system, system.state(mu=0.1 * np.random.default_rng(1).normal(size=(n, 6)), g=g)


def end(system: Any, start: Any, method: Any, h: float, **way: Any) -> Any:
    steps = way.pop("steps", round(0.5 / h))
    return lm.integrate(system, method, start, h=h, steps=steps, every=steps, progress=False, **way)


@pytest.mark.slow
def test_one_fast_step_is_one_of_kicks_and_drifts() -> None:
    """And of four fast ones in a slow one the errors are smaller."""
    system, start = chain(2)
    exact, plain = (end(system, start, *way).g[-1] for way in ((lm.RKMK(8), 0.0025), (lm.KickDrift(), 0.0125)))
    one, four = (end(system, start, lm.MultipleTimeSteps(ratios=(n,)), 0.0125).g[-1] for n in (1, 4))
    assert np.abs(plain - one).max() < 1e-13
    assert np.abs(four - exact).max() < 0.2 * np.abs(plain - exact).max()


def test_slow_steps_are_kicks_around_fast_ones() -> None:
    """By hand: half a kick by the soft term, two steps of KickDrift with the stiff one, half a kick."""
    system, start = chain(3)
    both = system.potential
    stiff, soft = [lm.MechanicalSystem(system.body, lm.Terms(t)) for t in _each_term(both)]
    way = {"compiled": False, "compensated": False}
    found = end(system, start, lm.MultipleTimeSteps(ratios=(2,)), 0.05, steps=1, **way)
    mu, g = np.array(start.mu), np.array(start.g)
    mu = mu + 0.025 * np.asarray(soft.force(g)).reshape(3, 6)
    inner = end(stiff, stiff.state(mu=mu, g=g), lm.KickDrift(), 0.025, steps=2, **way)
    mu, g = inner.mu[-1], inner.g[-1]
    mu = mu + 0.025 * np.asarray(soft.force(g)).reshape(3, 6)
    assert np.abs(found.mu[-1] - mu).max() < 1e-14
    assert np.abs(found.g[-1] - g).max() < 1e-14


@pytest.mark.slow
@native
def test_few_bodies_go_native() -> None:
    """Terms alone were made in the formula, and could not be compiled."""
    system, start = chain(2)
    plain, quick = (end(system, start, lm.MultipleTimeSteps(ratios=(2,)), 0.05, compiled=c) for c in (False, True))
    assert quick.compiled
    assert np.array_equal(plain.mu, quick.mu) and np.array_equal(plain.g, quick.g)


def _each_term(field: Any) -> Any:
    return [part.term.over(part.graph) if part.graph.arity == 2 else part.term for part in field.parts]


@pytest.mark.slow
def test_claims_are_observed() -> None:
    system, start = chain(2)
    report = lm.check_method(lm.MultipleTimeSteps(ratios=(3,)), system, start, h=0.02)
    assert report["symplectic"].verdict in ("holds", "seen")


@pytest.mark.slow
def test_many_bodies_at_three_rates_keep_the_energy() -> None:
    system, start = chain(300, Stiff(20.0).over(lm.neighbours.edges([(0, 2), (1, 3)], sites=300)))
    run = end(system, start, lm.MultipleTimeSteps(ratios=(4, 2)), 0.02, steps=200)
    assert np.ptp(run.energy) < 1e-5 * abs(run.energy[0])


def test_what_does_not_fit_is_named() -> None:
    system, start = chain(3)
    with pytest.raises(IncompatibleSystem, match="2 ratios, for 3 terms"):
        lm.integrate(system, lm.MultipleTimeSteps(ratios=(2, 2)), start, h=0.01, steps=1)
    with pytest.raises(IncompatibleSystem, match="ratios alone"):
        lm.integrate(system, lm.MultipleTimeSteps(mollified=True), start, h=0.01, steps=1)
