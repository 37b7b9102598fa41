"""Runs in fictive time that go on from a t_end inside of a step: the motion of a run that never
stopped, between its samples too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm

KEPLER = lm.Kepler()
START = KEPLER.state(q=[0.4, 0.0], p=[0.0, 2.0])
CONTROLLED = lm.ReversibleController(lm.StormerVerlet(), lm.DistancePower(1.5))
EXTENDED = lm.TimeTransformed(KEPLER, lm.DistancePower(1.5))
PLANS = [
    lm.Plan(KEPLER, CONTROLLED, h=0.2, compiled=False),
    lm.Plan(KEPLER, CONTROLLED, h=0.2, every=3, compiled=False),
    lm.Plan(EXTENDED, lm.AdaptiveVerlet(), h=0.2, compiled=False),
]


@pytest.mark.sample(2)
@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_steps_from_the_last_whole_step(plan: Any, sign: float, tmp_path: Any) -> None:
    """To the bit; between samples that lie several steps apart up to rounding, for sums of steps
    are compensated and samples are not.
    """
    every, plan = plan.replace(every=1, h=sign * 0.2), plan.replace(h=sign * 0.2)
    whole, steps = plan.run(START, t_end=sign), every.run(START, t_end=sign).t
    cut = 0.3 * steps[1] + 0.7 * steps[2]
    after = cut + (steps[2] - cut) * np.array([0.2, 0.5, 0.9])
    first = plan.run(START, t_end=cut)
    rest = plan.resume(first, t_end=sign)
    twice = plan.resume(plan.resume(first, t_end=after[0]), t_end=sign)
    sampled = plan.resume(first, t_end=sign, t_eval=after)
    rest.save(tmp_path / "run.npz")
    loaded = lm.Trajectory.load(tmp_path / "run.npz")
    none = plan.resume(first, steps=0)
    rounding = 0.0 if whole.t[1] == steps[1] else 1e-14
    for run, times in (
        (rest, after),
        (loaded, after),
        (twice, after[1:]),
        (first.then(rest), np.linspace(0.0, sign, 40)),
        (first.then(none).then(rest), np.linspace(0.0, sign, 40)),
        (none.then(rest), after),
    ):
        assert np.abs(run.at(times).q - whole.at(times).q).max() <= rounding
    assert np.array_equal(sampled.q, rest.at(after).q)
    assert sampled.tau == pytest.approx(plan.run(START, t_end=sign, t_eval=after).tau, rel=1e-13)


def test_an_event_inside_of_the_step_is_that_of_the_whole_run() -> None:
    def crossed(t: float, state: Any) -> float:
        return state.q[1] - 0.5

    plan = PLANS[0].replace(events=crossed)
    whole = plan.run(START, t_end=1.0)
    times, states = whole.events[0]
    k = int(np.searchsorted(whole.t, times[0]))
    cut = 0.5 * (whole.t[k - 1] + times[0])
    found, then = plan.resume(plan.run(START, t_end=cut), t_end=1.0).events[0]
    assert found[0] == pytest.approx(times[0], rel=1e-14)
    assert then.q[0] == pytest.approx(states.q[0], rel=1e-14)


def test_a_step_that_fails_tells_the_fictive_time() -> None:
    method = lm.ReversibleController(lm.StormerVerlet(), lm.DistancePower(2.0))
    plan = lm.Plan(KEPLER, method, h=5.0, compiled=False)
    carry = plan.begin(KEPLER.state(q=[0.1, 0.0], p=[0.0, 4.0]), t0=3.0)
    with pytest.raises(lm.errors.InvalidTimeScale, match=r"step 2 of 30, tau = 5;"):
        plan.step(carry, 30)
