"""Adaptive runs that keep every step: short ones in one call of native code, with the bits, the
errors and the promises of those that are made in many.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body

import liemech as lm
from liemech.errors import StepTooSmall
from liemech.simulation import short

pytestmark = pytest.mark.compiled

BODY, START = asymmetric_body()
METHOD = lm.RKMK(order=5)


def plans(**options: Any) -> list[lm.Plan]:
    """In plain Python, and in native code, of which the second run begins with such a piece."""
    given = {"rtol": 1e-5} | options
    return [lm.Plan(BODY, METHOD, compiled=compiled, **given) for compiled in (False, True)]


def alike(run: lm.Trajectory, other: lm.Trajectory) -> None:
    assert run == other and (run.rejected, run.h) == (other.rejected, other.h)
    assert np.array_equal(run.carry.numbers, other.carry.numbers)
    assert np.array_equal(run.carry.clock, other.carry.clock)


@pytest.mark.parametrize("t_end", [3.0, -3.0])
@pytest.mark.parametrize("options", [{}, {"dense": False}, {"h": 0.01, "max_step": 0.1}])
def test_it_has_the_bits_of_the_whole_run(t_end: float, options: dict[str, Any]) -> None:
    plain, native = plans(**options)
    wanted, first = plain.run(START, t_end=t_end), native.run(START, t_end=t_end)
    known = native._steps, START, 0.0, t_end, None, 2**53
    assert short.short(*known) is not None  # so is the next run
    again = native.run(START, t_end=t_end)
    alike(first, wanted)
    alike(again, wanted)
    assert (again.dense is None) == (options.get("dense") is False)
    if again.dense is not None:
        assert np.array_equal(again.at(0.3 * t_end).mu, wanted.at(0.3 * t_end).mu)
    alike(native.resume(again, t_end=2.0 * t_end), plain.resume(wanted, t_end=2.0 * t_end))


@pytest.mark.parametrize("name", ["LONGEST", "ROWS"])
def test_a_longer_run_goes_on_from_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plain, native = plans()
    wanted = plain.run(START, t_end=9.0)
    native.run(START, t_end=1.0)
    monkeypatch.setattr(short, name, 1)  # a single step
    alike(native.run(START, t_end=9.0), wanted)


def test_too_few_steps_leave_their_samples() -> None:
    for plan in plans():
        whole = plan.run(START, t_end=9.0)
        with pytest.raises(StepTooSmall, match="7 steps led to") as caught:
            plan.run(START, t_end=9.0, steps=7)
        found = caught.value.trajectory
        assert len(found) == 8 and np.array_equal(found.mu, whole.mu[:8])


def test_a_singularity_is_told_as_in_plain_python() -> None:
    kepler = lm.Kepler()
    falling = kepler.state([0.5, 0.0], [0.0, 0.0])
    said = []
    for compiled in (False, True):
        plan = lm.Plan(kepler, METHOD, rtol=1e-6, compiled=compiled)
        plan.run(falling, t_end=0.1)
        with pytest.raises(StepTooSmall) as caught:
            plan.run(falling, t_end=2.0)
        said.append((str(caught.value), caught.value.trajectory.q.tobytes()))
    assert said[0] == said[1]


def test_samples_may_be_written_to() -> None:
    _, native = plans()
    for _ in range(2):
        run = native.run(START, t_end=1.0)
        last = run.mu[-1].copy()
        run.mu[:] = 0.0
        assert np.array_equal(np.array(run.carry.state.mu), last)
