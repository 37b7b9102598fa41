"""Jumps of the velocity: adaptive steps end before them, and go on behind them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...integrators.ending_at_jumps import MARGIN, is_one_time
from ..compiled.control import LAST_TIME, go_on

Ways = list[tuple[float, float]]
"""To which times steps lead, and where they go on."""


def stretches(breaks: tuple[float, ...], t0: float, t_end: float) -> tuple[float, Ways]:
    """The time where steps begin, beyond a jump at t0; and for each later jump and the end, the time up to which
    steps lead and the one where they go on.
    """
    if t0 == t_end:
        return t0, []
    sign = math.copysign(MARGIN, t_end - t0)
    start, ways, before = t0, [], t0  # type: float, Ways, float
    inside = [b for b in breaks if min(t0, t_end) <= b <= max(t0, t_end)]
    for b in inside if t_end > t0 else inside[::-1]:
        if is_one_time(b, t0):  # there is nothing between them
            start = b + sign * float(np.spacing(abs(b)))
            continue
        # times of stages are rounded as those of the step are
        ahead = sign * float(np.spacing(max(abs(b), abs(before))))
        last = is_one_time(b, t_end)
        ways.append((b - ahead, t_end if last else b + sign * float(np.spacing(abs(b)))))
        before = b
    if not ways or ways[-1][1] != t_end:
        ways.append((t_end, t_end))
    return start, ways


def until_jumps(clock: Any, goal: Any, t0: float, left: tuple[float, Ways]) -> Ways:
    """Set a clock and a goal for a motion from t0 that has these `stretches`; the ways that are left,
    the last one first.
    """
    start, ways = left
    if ways:
        goal[LAST_TIME] = ways[0][0]
    if start != t0:
        go_on(clock, start)
    return ways[::-1]


def beyond_jump(clock: Any, goal: Any, left: Ways, t_end: float) -> float:
    """Let a motion that has come to a jump go on behind it, to the next one; returns the time behind it."""
    end, beyond = left.pop()
    if end != beyond:
        go_on(clock, beyond)
        goal[LAST_TIME] = left[-1][0] if left else t_end
    return beyond
