"""Gradients of driven linkages beside differences of their runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import sin

jt = lm.joints
BARE = jt.chain(1, mass=0.5, length=0.3, axis=[0.0, 1.0, 0.0])
H, STEPS = 0.02, 4


@lm.record
class Push(jt.JointForce):
    """A torque c sin 3t."""

    c: float

    def effort(self, t, q, rate):
        return self.c * sin(3.0 * t)


def arm(force: Any) -> Any:
    return jt.Linkage(BARE.links, BARE.joints, forces=[force])


def table(values: Any, t0: float = 0.0) -> lm.PiecewisePolynomial:
    return lm.PiecewisePolynomial.constant(t0 + H * np.arange(STEPS + 1), values)


def run(system: Any, moving: bool, t0: float = 0.0) -> Any:
    start = system.state(angles={0: 0.1 * moving}, rates={0: 0.2 * moving})
    plan = lm.Plan(system, lm.LieRATTLE(), h=H, compiled=False)
    return plan, start, lambda: float(plan.run(start, steps=STEPS, t0=t0).g[-1][2])


def slope(value: Any, e: float) -> float:
    """The derivative at zero, by differences of order 4."""
    return (8.0 * (value(e) - value(-e)) - (value(2.0 * e) - value(-2.0 * e))) / (12.0 * e)


@pytest.mark.slow
@pytest.mark.parametrize("moving", [True, False])
def test_by_a_force(moving: bool) -> None:
    """From rest too, where the hinge has no rate."""
    plan, start, _ = run(arm(Push(0, 0.3)), moving)
    found = plan.gradient(lambda s: s.g[2], start, steps=STEPS, by="c")["c"]
    right = slope(lambda e: run(arm(Push(0, 0.3 + e)), moving)[2](), 1e-2)
    assert found == pytest.approx(right, rel=1e-8, abs=0.0)


@pytest.mark.slow
def test_by_a_table_of_torques() -> None:
    """It is asked at the times of its steps alone."""
    values = np.array([0.3, -0.2, 0.5, 0.1])
    plan, start, _ = run(arm(jt.Motor(0, table(values))), True)
    found = plan.gradient(lambda s: s.g[2], start, steps=STEPS, by="torque.values")["torque.values"]
    for k, unit in enumerate(np.eye(STEPS)):
        right = slope(lambda e, unit=unit: run(arm(jt.Motor(0, table(values + e * unit))), True)[2](), 1e-2)
        assert found[k] == pytest.approx(right, rel=1e-7, abs=1e-12), k


@pytest.mark.slow
@pytest.mark.parametrize("links", [3, 4])
def test_of_long_chains(links: int) -> None:
    """Along a direction of the start in which momenta and poses change, off the conditions too."""
    system, rng, group = jt.chain(links), np.random.default_rng(links), lm.SE3()
    start = system.state(angles={0: [0.1, 0.6, 0.0], links - 1: [0.5, 0.0, 0.2]}, rates={0: [0.3, -0.2, 0.4]})
    plan = lm.Plan(system, lm.LieRATTLE(), h=H)
    mu, g = np.array(start.mu), np.array(start.g).reshape(links, 4, 4)
    by_mu, by_g, w, eta = (rng.normal(size=n * links) for n in (6, 16, 6, 6))

    def value(e: float) -> float:
        turned = [g[k] @ group.exp(e * eta[6 * k : 6 * k + 6]) for k in range(links)]
        moved = type(start)(lm.vec(*(mu + e * w)), lm.vec(*np.ravel(turned)))
        last = plan.run(system.vouched(moved), steps=2)
        return float(by_mu @ last.mu[-1] + by_g @ last.g[-1])

    found = plan.gradient(lambda s: lm.dot(lm.vec(*by_mu), s.mu) + lm.dot(lm.vec(*by_g), s.g), start, steps=2)
    assert found["start"] @ np.concatenate([w, eta]) == pytest.approx(slope(value, 1e-4), rel=1e-8)


@pytest.mark.parametrize("t0", [5.0, -3.0])
def test_a_table_of_later_times_is_not_asked_before(t0: float) -> None:
    values = np.array([0.3, -0.2, 0.5, 0.1])
    first = run(arm(jt.Motor(0, table(values))), True)[2]()
    assert run(arm(jt.Motor(0, table(values, t0))), True, t0)[2]() == pytest.approx(first, rel=1e-13)
