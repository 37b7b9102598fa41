"""The driver of adaptive steps: as long as the error estimate allows."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from ..compiler.driver import Rejected, accepted, any_body, attempt, itself, read, write
from ..errors import is_mistake
from ..formulas import Record, Vec, record, sqrt, where
from ..formulas.pytree import layout_of

SAFETY, SLOWEST, FASTEST = 0.9, 0.2, 10.0
"""The controller aims at 0.9 of the step that would just be accepted, and changes steps by factors
between these two.
"""

LEAST, UNUSABLE = 1e-4, 1e3
"""The smallest error that the controller knows, and that of a step that failed."""

STUCK, ASKED = 1.0, 2.0
"""Marks of a clock: the step became too small to go on; native code failed in a trial, and plain
Python is to make the next step: it may be able to (integers without end), or knows what failed.
"""

EPSILON = sys.float_info.epsilon


@record
class Clock(Record):
    """What the controller carries along: time, the step to try, the error of the last one, counts,
    and marks.

    h : zero if the first step is to be found.  error : as `following` gives it.  stuck : 0, `STUCK`
    or `ASKED`.  fresh : is the velocity to be computed, at a start or after a jump?
    """

    t: float
    h: float
    error: float
    steps: float
    rejected: float
    stuck: float
    fresh: float


FRESH = 1.0, 0.0, 0.0, 0.0, 1.0
"""What a clock has at a start, behind time and step."""

CLOCK = layout_of(Clock(0.0, 0.0, *FRESH))

TIME, STEP, ERROR, TAKEN, REJECTED, MARK, ANEW = range(CLOCK.width)
"""The places of these numbers among those of a clock."""


def go_on(clock: np.ndarray, t: float) -> None:
    """Go on at another time from the same state: velocity and step are found anew."""
    clock[TIME], clock[STEP], clock[ANEW] = t, 0.0, 1.0


def adaptive_steps(
    method: Any,
    system: Any,
    layout: Any,
    row: Any,
    t_end: float,
    rtol: float,
    atol: float,
    longest: float,
    dense: bool,
    room: int,
    states: Any,
    clocks: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver: accepted steps, a row of numbers for each, until t_end is reached, the room is
    full or the step underflows.

    layout, row : of what is carried along, state and velocity, and of a row: time, state and the
    way there, if it is wanted (`dense`).  longest : the longest step.  room : steps at most.
    states, clocks, out : what is carried along, before and after; the clock of it; the rows.
    failures : None in native code; in plain Python a list for what rejected steps raised, which a
    mistake in a formula ends.
    """
    state, xi = read(states, 0, layout)
    clock = read(clocks, 0, CLOCK)
    t, h, before, rejected, stuck = clock.t, clock.h, clock.error, clock.rejected, 0.0
    power, fresh = 1.0 / method.error_order, 0.0
    if clock.fresh > 0.0:
        first = attempt(started, method, system, t, state, h, t_end, rtol, atol)
        if failures is not None and noted(failures, first):
            stuck = STUCK
        elif accepted(first, itself):
            xi, h, before = first[0], first[1], 1.0
        elif failures is None:
            stuck, fresh = ASKED, 1.0
        else:
            stuck = STUCK
    n = 0
    while n < room and t != t_end and stuck == 0.0:
        step, last, small = to_try(t, h, t_end, longest)
        if small:
            h, stuck = step, STUCK
            break
        trial = attempt(method.trial, system, t, state, xi, step, rtol, atol, dense)
        if failures is not None and noted(failures, trial):
            stuck = STUCK
            break
        if failures is None and not accepted(trial, itself):
            stuck = ASKED
            break
        error, made = UNUSABLE, step
        if accepted(trial, itself):
            error, made = judged(method, trial, t, step)
        h, root = following(method, made, error, before, power)
        if error <= 1.0:
            t = t_end if last and made == step else t + made
            state, xi = trial.state, trial.velocity
            write(out, n * row.width, (t, state, trial.curve), row)
            n = n + 1
            before = root
        else:
            rejected = rejected + 1.0
    write(states, 0, (state, xi), layout)
    write(clocks, 0, Clock(t, h, before, clock.steps + n, rejected, stuck, fresh), CLOCK)


@record
class Goal(Record):
    """Where one of many bodies is to go, and how: the last time, the tolerances, the longest step,
    and how many steps there may be.
    """

    t_end: float
    rtol: float
    atol: float
    longest: float
    limit: float


GOAL = layout_of(Goal(0.0, 0.0, 0.0, 0.0, 0.0))


def adaptive_lanes(
    method: Any,
    system: Any,
    layout: Any,
    row: Any,
    dense: bool,
    turns: int,
    goals: Any,
    states: Any,
    clocks: Any,
    out: Any,
) -> None:
    """The driver of many bodies side by side, in native code: so many trials of each, every body
    with its own step and its own goal.

    A body that has reached its goal, whose step underflows, or of which a trial failed, stays where
    it is.
    out : if `dense`, a row of numbers after every trial; the time in it tells whether that was
    accepted.  The last ones are not written if no body of those that run together goes on.
    """
    goal = read(goals, 0, GOAL)
    t_end, rtol, atol = goal.t_end, goal.rtol, goal.atol
    state, xi = read(states, 0, layout)
    clock = read(clocks, 0, CLOCK)
    t, h, before, stuck = clock.t, clock.h, clock.error, clock.stuck
    n, rejected, power = clock.steps, clock.rejected, 1.0 / method.error_order
    fresh = clock.fresh > 0.0
    if any_body(fresh):
        first = attempt(started, method, system, t, state, h, t_end, rtol, atol)
        begun = accepted(first, itself)
        fresh, begun = fresh and not begun, fresh and begun
        stuck = where(fresh, ASKED, stuck)
        xi, h, before = (
            where(begun, first[0], xi),
            where(begun, first[1], h),
            where(begun, 1.0, before),
        )
    for k in range(turns):
        running = t != t_end and stuck == 0.0 and n < goal.limit
        if not any_body(running):
            break
        step, last, small = to_try(t, h, t_end, goal.longest)
        trial = attempt(method.trial, system, t, state, xi, step, rtol, atol, dense)
        done, small = accepted(trial, itself), running and small
        found = judged(method, trial, t, step)
        error, made = where(done, found[0], UNUSABLE), where(done, found[1], step)
        failed, tried = running and not small and not done, running and not small and done
        good = tried and error <= 1.0
        new, root = following(method, made, error, before, power)
        h = where(tried, new, where(small, step, h))
        stuck = where(small, STUCK, where(failed, ASKED, stuck))
        t = where(good, where(last and made == step, t_end, t + made), t)
        state, xi = where(good, trial.state, state), where(good, trial.velocity, xi)
        before = where(good, root, before)
        n = n + where(good, 1.0, 0.0)
        rejected = rejected + where(tried and not good, 1.0, 0.0)
        if dense:
            write(out, k * row.width, (t, state, trial.curve), row)
    write(states, 0, (state, xi), layout)
    write(clocks, 0, Clock(t, h, before, n, rejected, stuck, where(fresh, 1.0, 0.0)), CLOCK)


def to_try(t: float, h: float, t_end: float, longest: float) -> tuple[float, bool, bool]:
    """The step to try, and whether it leads to the end, and is too small to advance the time."""
    h = min(max(h, -longest), longest)
    last = abs(h) >= 0.999 * abs(t_end - t)
    step = where(last, t_end - t, h)
    return step, last, t + 0.125 * step == t


def judged(method: Any, trial: Any, t: float, step: float) -> tuple[float, float]:
    """The error over the tolerance of the step that a trial has made, and its length."""
    if not method.shortens:
        return max(trial.error, LEAST), step
    made = trial.share * step
    return where(t + made == t, UNUSABLE, LEAST), made


def following(
    method: Any, step: float, error: float, before: float, power: float
) -> tuple[float, float]:
    """The step after one with this error over the tolerance, and r = err^(1/(10 q)), which controls
    it; `before` is that of the last step.  A method that shortens its steps may try any.

    A proportional-integral controller, h <- 0.9 h err_n^(-0.7/q) err_(n-1)^(0.4/q), that is
    0.9 h r_(n-1)^4 / r_n^7; after a step that was rejected h <- 0.9 h err^(-1/q).  A power in lanes
    takes as long as twenty products, so one must do.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.2, equation
    (2.43c).
    """
    if method.shortens:
        return step * where(error <= 1.0, FASTEST, SLOWEST), before
    root = error ** (0.1 * power)
    cube, old = root * root * root, before * before
    if error <= 1.0:
        factor = min(FASTEST, SAFETY * (old * old) / (cube * cube * root))
    else:
        factor = SAFETY / (cube * cube * cube * root)
    return step * max(SLOWEST, factor), root


def noted(failures: list[Exception], trial: Any) -> bool:
    """Keep what a rejected step raised, the last one of them; is it a mistake in a formula?"""
    if isinstance(trial, Rejected):
        failures[:] = [trial.error]
    return isinstance(trial, Rejected) and is_mistake(trial.error)


def started(
    method: Any, system: Any, t: float, state: Any, h: float, t_end: float, rtol: float, atol: float
) -> tuple[Vec, float]:
    """The velocity at the start, and the first step if h is zero: from the size of the velocity and
    of its change.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4,
    "Starting step size".
    """
    start = system.essential_part(state)
    xi = system.rate(t, start)
    if h == 0.0:
        span = t_end - t
        speed, size = sizes(system, state, xi, rtol, atol)
        least = 8.0 * EPSILON * max(abs(t), abs(t_end))
        h = abs(span)
        if speed > 0.0:
            h = min(max(0.01 * size / speed, least), abs(span))
        if span < 0.0:
            h = -h
        later = attempt(probed, method, system, t, start, xi, h)
        if accepted(later, itself):
            largest = max(speed, sizes(system, state, later - xi, rtol, atol)[0] / abs(h))
            second = abs(span)
            if largest > 0.0:
                second = (0.01 / largest) ** (1.0 / method.error_order)
            second = max(min(100.0 * abs(h), second, abs(span)), least)
            h = second if span > 0.0 else -second
        else:
            h = 1e-3 * h
    return xi, h


def probed(method: Any, system: Any, t: float, start: Any, xi: Vec, h: float) -> Vec:
    """The velocity after an Euler step."""
    return system.rate(t + h, system.displaced(method.retraction, start, h * xi))


def sizes(system: Any, state: Any, omega: Vec, rtol: float, atol: float) -> tuple[float, float]:
    """The root mean squares of what a displacement changes, and of what is there, over the
    tolerances.
    """
    change, scale = system.variation(state, omega)
    total = [0.0, 0.0]
    for c, s in zip(change, scale):
        weight = 0.0
        if atol + rtol * s > 0.0:
            weight = 1.0 / (atol + rtol * s)
        total = [total[0] + (weight * c) ** 2, total[1] + (weight * s) ** 2]
    return sqrt(total[0] / len(change)), sqrt(total[1] / len(change))
