"""What a review of runs found: warnings, errors, shapes and clocks that were lost on the way."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, StepWarning

BODY = lm.RigidBody([1.0, 1.5, 2.0])
STARTS = BODY.state(np.array([[0.3, 0.4, 0.5], [0.1, 0.5, 0.9]]))
KEPLER = lm.Kepler()
ORBITS = KEPLER.state(q=[[0.5, 0.0], [0.7, 0.0]], p=[[0.0, 1.2]] * 2)


@pytest.mark.parametrize("how", [{"steps": 1}, {"t_end": None}, {"steps": 1, "events": True}])
def test_bodies_that_go_each_its_own_way_are_warned_of_large_steps(how: dict[str, Any]) -> None:
    method = lm.CovariantVariational()
    h = 1.5 * method.largest_step(BODY, STARTS)
    events = [lambda t, state: state.mu[0] - 10.0] if how.pop("events", False) else []
    if "t_end" in how:
        how = {"t_end": np.array([h, 2.0 * h])}
    plan = lm.Plan(BODY, method, h, events=events, compiled=False)
    with pytest.warns(StepWarning):
        plan.run(STARTS, **how)


def test_a_mistake_in_an_event_is_raised_as_it_is() -> None:
    def mistaken(t: float, state: Any) -> float:
        return no_such_name * state.mu[0]  # type: ignore[name-defined]  # noqa: F821

    plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6, events=mistaken, compiled=False)
    with pytest.raises(NameError, match="no_such_name"):
        plan.run(STARTS, t_end=1.0)


def test_an_event_is_looked_at_in_every_run() -> None:
    def crossing(t: float, state: Any) -> float:
        return state.mu[0]

    def run() -> lm.Trajectory:
        return lm.integrate(
            BODY, lm.RKMK(order=4), STARTS, h=0.1, steps=2, events=crossing, compiled=False
        )

    run()
    crossing.terminal = "yes"  # type: ignore[attr-defined]
    with pytest.raises((InvalidInput, TypeError), match="terminal"):
        run()


def test_steps_and_clocks_of_ensembles_in_fictive_time() -> None:
    method = lm.ReversibleController(lm.StormerVerlet(), lm.DistancePower(1.5))
    run = lm.Plan(KEPLER, method, [0.05, 0.1], compiled=False).run(ORBITS, steps=4)
    assert np.array_equal(run.h, [0.05, 0.1])
    system = lm.TimeTransformed(KEPLER, lm.DistancePower(1.5))
    plan = lm.Plan(system, lm.RKMK(order=4), [0.05, 0.1], compiled=False)
    many = plan.tangent(ORBITS, steps=3)
    assert np.allclose(many.tau[-1], [0.15, 0.3], rtol=1e-15)
    assert many.energy.shape == (4, 2)


@pytest.mark.compiled
def test_a_step_sees_what_has_changed_outside() -> None:
    results = []
    for compiled in (False, True):
        OUTSIDE[0] = 1.0
        system = Pulled()
        plan = lm.Plan(system, lm.StormerVerlet(), 0.1, compiled=compiled, progress=False)
        carry = plan.step(plan.begin(system.state(1.0, 0.0)), 2)
        OUTSIDE[0] = 3.0
        results.append(np.array(plan.step(carry, 5).state.q))
    assert np.array_equal(*results)


OUTSIDE = [1.0]


@lm.record
class Pulled(lm.SeparableSystem):
    """A spring whose stiffness lies outside."""

    degrees = 1

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0]

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * OUTSIDE[0] * q[0] * q[0]


def test_matrices_of_another_shape_are_refused() -> None:
    wide = lm.mat([1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0])
    for call in (lm.SO3().log, lm.SO3().inverse):
        with pytest.raises(InvalidInput, match=r"\(3, 4\)"):
            call(wide)
    with pytest.raises(InvalidInput, match="g has shape"):
        lm.SO3().Ad(lm.vec(1.0, 2.0, 3.0), lm.vec(1.0, 2.0, 3.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert lm.SO3().log(lm.SO3().identity()) == lm.vec(0.0, 0.0, 0.0)
