"""Events, runs and files as strangers met them elsewhere: the situations of public reports about other libraries, with values
by closed form.  Beside each test stands the report, repository#number.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import Ball

import liemech as lm


def ended_at(level: float, direction: float = 0.0) -> Any:
    """A terminal event at a height."""

    def event(t: float, state: Any) -> float:
        return state.q[0] - level

    event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
    return event


def test_events_at_one_time_are_all_met() -> None:
    """SciML/DifferentialEquations.jl#516, SciML/ModelingToolkit.jl#3819: only the first of them was."""
    ball = Ball(0.0)
    events = [lambda t, state: state.q[0] - 0.3, lambda t, state: 2.0 * (0.3 - state.q[0]), lambda t, state: t - 0.3]
    run = lm.integrate(ball, lm.RKMK(order=5), ball.state(q=[0.0], p=[1.0]), t_end=1.0, events=events)
    assert [times.tolist() for times, _ in run.events] == [[pytest.approx(0.3, abs=1e-14)]] * 3


@pytest.mark.parametrize("last", [1, 2, 3])
def test_a_cannon_by_times_that_are_asked_for(last: int) -> None:
    """scipy/scipy#12100: a terminal event between two times of t_eval, with one time or none before it.  The shell lands at
    2 v/g = 40."""
    shell = Ball(0.5)
    for times in ([33.0 * last], [], [0.0, 33.0, 66.0, 99.0]):
        run = lm.integrate(
            shell,
            lm.RKMK(order=5),
            shell.state(q=[0.0], p=[10.0]),
            t_end=100.0,
            t_eval=times,
            events=ended_at(0.0, -1.0),
        )
        assert run.events[0][0] == pytest.approx([40.0], abs=1e-10)
        assert run.ended == 0
        assert [t for t in run.t if t < 40.0 - 1e-9] == [t for t in times if t < 40.0]


@pytest.mark.parametrize(
    "way", [{"h": 0.125}, {"h": 0.125, "max_step": 0.125, "rtol": 1e-3}], ids=["fixed", "adaptive"]
)
@pytest.mark.parametrize("method", [lm.StormerVerlet(), lm.RKMK(order=5), lm.RKMK(order=4), lm.Taylor(4)], ids=repr)
def test_a_terminal_zero_where_a_step_ends(method: Any, way: Any) -> None:
    """scipy/scipy#17066: the time of the event was that of the step's end, and stood twice in the samples; here where
    rounding leaves the zero behind that end.
    """
    if len(way) > 1 and not method.error_order:
        return
    ball = Ball(0.0)
    fixed = {"steps": 16} if len(way) == 1 else {"t_end": 2.0}
    run = lm.integrate(ball, method, ball.state(q=[0.0], p=[1.0]), events=ended_at(0.5), compiled=False, **way, **fixed)
    assert run.t[:4].tolist() == [0.0, 0.125, 0.25, 0.375]
    assert run.t[-1] == pytest.approx(0.5, rel=1e-15, abs=0.0)
    assert (np.diff(run.t) > 0.0).all()
