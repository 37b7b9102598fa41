"""States of adaptive runs at given times: found in one piece with the steps, the bits of the
continuous motion between them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body

import liemech as lm
from liemech.errors import IntegrationFailure, StepTooSmall
from liemech.simulation import short

BODY, START = asymmetric_body()
METHOD = lm.RKMK(order=5)
BOTH = pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
TIMES = {
    "forwards": (2.0, [0.0, 0.0, 0.1, 0.1, 0.7, 1.9, 2.0, 2.0]),
    "backwards": (-2.0, [0.0, -0.3, -1.1, -1.1, -2.0]),
    "inside": (2.0, [0.2, 1.3]),
    "the end": (2.0, [2.0]),
    "the start": (2.0, [0.0]),
    "both ends": (2.0, [0.0, 2.0]),
    "none": (2.0, []),
}


def same(run: lm.Trajectory, other: Any) -> None:
    assert np.array_equal(run.mu, other.mu) and np.array_equal(run.g, other.g)


@BOTH
def test_they_are_those_of_the_continuous_motion_to_the_bit(compiled: bool) -> None:
    """A plan that has run before makes short runs at once: that changes nothing."""
    plan = lm.Plan(BODY, METHOD, rtol=1e-5, compiled=compiled)
    for t_end, times in TIMES.values():
        whole = plan.run(START, t_end=t_end)
        for _ in range(2):
            run = plan.run(START, t_end=t_end, t_eval=times)
            assert (run.steps, run.rejected, run.h) == (whole.steps, whole.rejected, whole.h)
            assert np.array_equal(run.t, times) and run.dense is None
            if times:
                same(run, whole.at(times))
            for name in ("numbers", "clock"):
                mine, theirs = (getattr(r.carry, name)[:5] for r in (run, whole))
                assert np.array_equal(mine, theirs)


@pytest.mark.compiled
def test_a_run_longer_than_its_first_piece_goes_on_with_the_same_bits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan, times = lm.Plan(BODY, METHOD, rtol=1e-5, compiled=True), np.linspace(0.0, 9.0, 61)
    whole = plan.run(START, t_end=9.0, t_eval=times)
    monkeypatch.setattr(short, "LONGEST", 1)  # a single step
    run = plan.run(START, t_end=9.0, t_eval=times)
    same(run, whole)
    assert run.steps == whole.steps > 20
    rest = plan.resume(plan.run(START, t_end=4.0, t_eval=[4.0]), t_end=9.0, t_eval=[9.0])
    direct = plan.resume(plan.run(START, t_end=4.0), t_end=9.0)
    assert np.array_equal(rest.mu[-1], direct.mu[-1])


@BOTH
def test_samples_can_be_written_to_and_the_run_goes_on_as_if_they_had_not_been(
    compiled: bool,
) -> None:
    plan = lm.Plan(BODY, METHOD, rtol=1e-5, compiled=compiled)
    for _ in range(2):
        run, times = plan.run(START, t_end=1.0, t_eval=[0.5, 1.0]), np.array([0.5, 1.0])
        kept = run.mu.copy()
        run.mu[:] = 0.0
        other = plan.run(START, t_end=1.0, t_eval=times)
        times[:] = 0.0
        assert np.array_equal(other.mu, kept) and other.t[0] == 0.5
        assert np.array_equal(np.array(run.carry.state.mu), kept[-1])


@BOTH
def test_too_few_steps_leave_the_samples_before(compiled: bool) -> None:
    plan, times = lm.Plan(BODY, METHOD, rtol=1e-5, compiled=compiled), np.linspace(0.0, 9.0, 61)
    whole = plan.run(START, t_end=9.0, t_eval=times)
    for _ in range(2):
        with pytest.raises(StepTooSmall, match="7 steps led to") as caught:
            plan.run(START, t_end=9.0, t_eval=times, steps=7)
        found = caught.value.trajectory
        assert 0 < len(found) < len(times) and found.steps == 7
        assert np.array_equal(found.mu, whole.mu[: len(found)])


@lm.record
class Picky(lm.Exponential):
    """A retraction that has no value at tiny displacements, which no step makes."""

    def tau_Ad_star(self, group, omega, mu):
        size = abs(omega[0]) + abs(omega[1]) + abs(omega[2])
        if 0.0 < size < 1e-7:
            raise ValueError("too near")
        return group.algebra.exp_Ad_star(omega, mu)


@BOTH
def test_a_state_between_two_steps_that_fails_is_named(compiled: bool) -> None:
    start = BODY.state(START.mu)
    plan = lm.Plan(BODY, lm.RKMK(order=5, retraction=Picky()), rtol=1e-5, compiled=compiled)
    plan.run(start, t_end=1.0, t_eval=[0.5])
    with pytest.raises(IntegrationFailure, match=r"too near \[between two steps, t = 1e-09"):
        plan.run(start, t_end=1.0, t_eval=[1e-9, 0.5])


@BOTH
def test_at_a_jump_of_the_velocity_they_are_those_of_both_sides(compiled: bool) -> None:
    """The motion is continuous there: the sample at the jump is that of a run to it."""
    times = [0.5, 1.0, 1.5, 2.0]
    plan = lm.Plan(BODY, METHOD, rtol=1e-5, breaks=(1.0,), compiled=compiled)
    run = plan.run(START, t_end=2.0, t_eval=times)
    to_it = plan.run(START, t_end=1.0, t_eval=[0.5])
    assert np.array_equal(run.mu[0], to_it.mu[0])
    assert np.abs(run.mu - BODY.exact(START, times).mu).max() < 1e-4
    assert np.array_equal(run.t, times)


@BOTH
def test_at_a_jump_of_the_velocity_they_have_one_value(compiled: bool) -> None:
    """Whatever else is asked for, and beside other bodies, to the bit."""
    body = lm.RigidBody([1.0, 1.6, 2.3])
    mu, times = [0.20212572, -0.44147812, -0.77740195], [0.0, 0.3, 0.30000001, 0.6, 0.62, 1.7]
    plan = lm.Plan(body, METHOD, rtol=1.1e-6, breaks=[0.3, 0.6], compiled=compiled)
    wanted = plan.run(body.state(mu=mu), t_end=1.7).at(times).mu
    plans = [plan.replace(**how) for how in (
        {}, {"record": ["mu", "energy"]}, {"dense": True}, {"events": lambda t, s: s.mu[0] - 9.0},
    )]  # fmt: skip
    for each in plans:
        run = each.run(body.state(mu=mu), t_end=1.7, t_eval=times)
        assert np.array_equal(run.mu, wanted)
    for each in (plans[0], *[plans[3]] * 4):  # native code has the events from the third run on
        runs = each.run(body.state(mu=[mu, mu]), t_end=1.7, t_eval=times)
        assert np.array_equal(runs.mu[:, 1], wanted)
