"""A call like one before is shorter, and says, refuses and computes the same."""

import pickle
from typing import Any

import numpy as np
import pytest

import liemech as lm

pytestmark = pytest.mark.compiled

BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))
KEPLER = lm.Kepler()


def once_more(plan: lm.Plan, start: Any, **run: Any) -> lm.Trajectory:
    """A run of a plan that has made such runs before."""
    for _ in range(5):
        plan.run(start, **run)
    return plan.run(start, **run)


@pytest.mark.parametrize("record", [None, "mu", ("mu",), ("mu", "g"), ("g", "mu")])
def test_what_is_recorded_is_the_same_again(record: Any) -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, record=record, compiled=True)
    first, again = plan.run(START, steps=20), once_more(plan, START, steps=20)
    assert first.states.keys() == again.states.keys()
    for name, x in first.states.items():
        np.testing.assert_array_equal(again.states[name], x)
    np.testing.assert_array_equal(again.t, first.t)
    assert (again.g is None) == (record in ("mu", ("mu",)))


def test_what_was_refused_is_refused_again() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, record=("mu", "g"), compiled=True)
    once_more(plan, START, steps=4)
    refused: list[tuple[Any, dict[str, Any], str]] = [
        (START, {"steps": -1}, "at least 0"),
        (START, {"steps": True}, "whole number"),
        (START, {"steps": 2**54}, r"2\*\*53"),
        (START, {"steps": 4, "t0": float("nan")}, "t0 must be finite"),
        (START, {"steps": 4, "t0": 1e30}, "lost beside"),
        (START, {"steps": 4, "t_end": 1.0}, "not both"),
        (BODY.state(mu=[1.0, 0.0, 0.0]), {"steps": 4}, "asks for g"),
        (KEPLER.state([1.0, 0.0], [0.0, 1.0]), {"steps": 4}, "another kind"),
        ([1.0, 0.0, 0.0], {"steps": 4}, "system.state"),
    ]
    for start, run, message in refused:
        for _ in range(2):
            with pytest.raises(lm.errors.LiemechError, match=message):
                plan.run(start, **run)


def test_another_body_of_the_same_kind_is_not_the_one_before() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, record=("mu",), compiled=True)
    once_more(plan, START, steps=20)
    other = lm.RigidBody([1.0, 1.2, 2.0])
    start = other.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))
    found = once_more(plan.replace(system=other), start, steps=20)
    plain = lm.Plan(other, lm.RKMK(order=4), 0.1, record=("mu",), compiled=False)
    np.testing.assert_array_equal(found.mu, plain.run(start, steps=20).mu)


def test_beginnings_of_a_method_with_a_memory() -> None:
    system, method = lm.SphericalPendulum(), lm.RATTLE()
    plan = lm.Plan(system, method, 0.05, compiled=True)
    plain = lm.Plan(system, method, 0.05, compiled=False)
    for speed in np.linspace(0.1, 1.0, 7):
        start = system.state([1.0, 0.0, 0.0], [0.0, speed, 0.3])
        np.testing.assert_array_equal(plan.run(start, steps=6).q, plain.run(start, steps=6).q)


@pytest.mark.parametrize("end", [2.0, -2.0])
def test_times_between_adaptive_steps(end: float) -> None:
    times = end * np.array([0.0, 0.0, 0.1, 0.35, 0.35, 0.8, 1.0, 1.0])
    plan, plain = [lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-8, compiled=compiled) for compiled in (True, False)]
    expected = plain.run(START, t_end=end, t_eval=times)
    for _ in range(6):
        found = plan.run(START, t_end=end, t_eval=times)
        np.testing.assert_array_equal(found.t, times)
        np.testing.assert_array_equal(found.mu, expected.mu)
        np.testing.assert_array_equal(found.g, expected.g)
    found.mu[:] = np.nan
    np.testing.assert_array_equal(plan.resume(found, t_end=1.5 * end).mu, plain.resume(expected, t_end=1.5 * end).mu)


@pytest.mark.slow
def test_starts_of_one_plan_in_fictive_time() -> None:
    method = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))
    plan = lm.Plan(KEPLER, method, 0.05, compiled=True)
    times = np.linspace(0.0, 3.0, 7)
    for speed in (1.3, 1.1, 0.9, 0.8, 0.7):
        start = KEPLER.state([0.8, 0.0], [0.0, speed])
        plain = lm.Plan(KEPLER, method, 0.05, compiled=False)
        found = plan.run(start, t_end=3.0, t_eval=times)
        expected = plain.run(start, t_end=3.0, t_eval=times)
        for name in ("t", "tau", "q", "p", "z"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        kept = pickle.loads(pickle.dumps(found))
        np.testing.assert_array_equal(kept.q, found.q)
        np.testing.assert_array_equal(kept.at(1.7).q, found.at(1.7).q)
        np.testing.assert_array_equal(plan.resume(kept, t_end=4.0).q[-1], plain.resume(expected, t_end=4.0).q[-1])
