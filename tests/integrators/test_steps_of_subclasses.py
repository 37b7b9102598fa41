"""A user's subclass of a method of the library writes its own step: it is the one that is made, wherever the library has
another way to make the step of its base.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm


def resting(kind: Any) -> Any:
    """A subclass whose step leaves all as it is."""

    class Resting(kind):
        def step(self, system: Any, t: float, state: Any, h: float) -> Any:
            return state

    return lm.record(Resting)


@lm.record
class Exchange(lm.Term):
    def energy(self, a: Any, b: Any) -> float:
        return -lm.dot(a.mu, b.mu)


def spins() -> tuple[Any, Any]:
    system = lm.LiePoissonSystem(lm.SO3() ** 102, lm.Terms(Exchange().over(lm.neighbours.ring(102))))
    return system, system.state(mu=np.random.default_rng(0).normal(size=(102, 3)))


def pendulums() -> tuple[Any, Any]:
    turn = [0.0, 1.0, 0.0]
    hinges: Any = [
        lm.joints.RevoluteJoint(k, k - 1 if k else None, [0.0, 0.0, 0.2], [0.0, 0.0, -0.2 if k else 0.0], turn, turn)
        for k in range(3)
    ]
    links: Any = [lm.joints.Link(1.0, [0.1, 0.1, 0.1])] * 3
    system = lm.joints.Linkage(links, hinges)
    return system, system.state(angles={0: 0.5, 1: 0.2, 2: 0.1})


def rod() -> tuple[Any, Any]:
    section = lm.models.RodSection([1.0, 1.2, 0.8, 30.0, 30.0, 40.0], [0.1, 0.12, 0.2, 1.0, 1.0, 1.0])
    system = lm.models.CosseratRod(section, 1.0, 4, gravity=1.0)
    return system, system.at_rest()


@pytest.mark.parametrize(
    ("made", "method"),
    [
        (spins, lambda: resting(lm.SublatticeSplitting)()),
        (spins, lambda: resting(lm.BondSplitting)()),
        (pendulums, lambda: resting(lm.LieRATTLE)()),
        (pendulums, lambda: lm.Composition(resting(lm.LieRATTLE)(), order=4)),
        (pendulums, lambda: resting(lm.Composition)(lm.LieRATTLE(), order=4)),
        (rod, lambda: resting(lm.GalerkinVariational)(order=2)),
        (rod, lambda: resting(lm.KickDrift)()),
    ],
)
def test_a_step_of_its_own_is_made_of_many_bodies(made: Any, method: Any) -> None:
    """Sublattices, chains and linkages have steps of all sites together, which were taken instead."""
    system, start = made()
    run = lm.integrate(system, method(), start, h=0.02, steps=2, compiled=False)
    assert all(np.array_equal(x[-1], x[0]) for x in run.states.values())


def test_a_step_of_its_own_is_transposed() -> None:
    """J = 1; the way back was that of kicks and drifts."""
    system = lm.LiePoissonSystem(lm.SO3() ** 40, lm.PerSite(lm.KineticEnergy([1.0, 1.5, 2.0])))
    top = lm.MechanicalSystem(system, lm.Terms(Upright().over()))
    rng = np.random.default_rng(1)
    start = top.state(mu=rng.normal(size=(40, 3)), g=lm.SO3().exp(rng.normal(size=(40, 3))))
    plan, w = lm.Plan(top, resting(lm.KickDrift)(), h=0.1, compiled=False), rng.normal(size=(40, 3))
    assert np.array_equal(plan.pullback({"mu": w}, start, steps=1)["start"][:120], w.ravel())


@lm.record
class Upright(lm.Term):
    def energy(self, a: Any) -> float:
        return a.g[2, 2]


@pytest.mark.parametrize("kind", [lm.RKMK, lm.Taylor])
def test_adaptive_steps_are_those_of_a_trial_of_its_own(kind: Any) -> None:
    """They were those of the base."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start, method = body.state(mu=[0.3, 0.2, 0.1]), resting(kind)(5)
    with pytest.raises(lm.errors.IncompatibleSystem, match=rf"the `trial` of {kind.__name__}.*Write `trial` too"):
        lm.integrate(body, method, start, t_end=0.5)
    run = lm.integrate(body, method, start, h=0.1, t_end=0.5, compiled=False)
    assert np.array_equal(run.mu[-1], run.mu[0])

    class Trying(resting(kind)):  # type: ignore[misc]
        def trial(self, *args: Any) -> Any:
            return super().trial(*args)

    assert lm.integrate(body, lm.record(Trying)(5), start, t_end=0.5, compiled=False).t[-1] == 0.5


@lm.record
class Height(lm.NoPotential):
    def energy(self, g: Any) -> float:
        return g[2, 2]


@lm.record
class HeightOfItsOwn(lm.Potential):
    def energy(self, g: Any) -> float:
        return g[2, 2]


def test_an_energy_of_its_own_has_a_force() -> None:
    """SymplecticRKMK left it out, as of a body without a potential."""
    ends = []
    for potential in (Height(), HeightOfItsOwn()):
        body = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), potential)
        start = body.state(mu=[0.3, 0.2, 0.9], g=lm.SO3().exp([0.3, 0.2, 0.1]))
        ends.append(lm.integrate(body, lm.SymplecticRKMK(2), start, h=0.1, steps=3, compiled=False).mu[-1])
    assert np.array_equal(*ends)
