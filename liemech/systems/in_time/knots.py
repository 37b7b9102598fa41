"""Knots of a table beside the ends of steps, which may miss them by rounding."""

from __future__ import annotations

from typing import Any

from ...formulas import where
from ...formulas.tables import entry, last_up_to

NEAR = 2.0**-49
"""Part of the times of a step by which its ends may miss a knot and still be there: some units in
the last place, for the rounding of t0 + n h, of h and of the knot.
"""


def slack_of(t: Any, end: Any) -> Any:
    """The distance by which the ends of a step may miss a knot."""
    return NEAR * max(abs(t), abs(end))


def just_inside(t: Any, h: Any) -> tuple[Any, Any]:
    """Times just inside the ends of a step, the earlier one first."""
    slack, middle = slack_of(t, t + h), t + 0.5 * h
    return min(min(t, t + h) + slack, middle), max(max(t, t + h) - slack, middle)


def jump_ahead(table: Any, begin: Any, count: Any, t: Any, end: Any) -> Any:
    """The first entry of a rising table after t on the way to `end`; `end` if there is none before
    it.  begin, count : the entries from number `begin` to number count - 1 count.
    """
    slack, forward = slack_of(t, end), end > t
    none = max(count - 1, 0)
    after = last_up_to(table, begin, none, t + slack)
    after = where(t + slack >= entry(table, min(begin, none)), after + 1, begin)
    before = last_up_to(table, begin, none, t - slack, below=True)
    before = where(t - slack > entry(table, min(begin, none)), before, begin - 1)
    at = where(forward, after, before)
    outside = where(forward, at >= count, at < begin)
    jump = entry(table, min(max(at, 0), none))
    beyond = where(forward, jump >= end - slack, jump <= end + slack)
    return where(outside, end, where(beyond, end, jump))
