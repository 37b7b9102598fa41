"""The compiled loops: `begin` starts a method, `advance` takes bodies forwards under any control."""

from __future__ import annotations

from typing import Any

from ...compiler.driver import accepted, any_body, attempt, itself, read, reason, write
from ...formulas import Record, horner, record, where
from ...formulas.classes.layouts import NUMBER, layout_of
from ...formulas.classes.records import with_fields
from ...formulas.numbers.conversions import fitted
from .control import ASKED, CLOCK, GOAL, STUCK, begun, observed


def on_the_way(retraction: Any, system: Any, state: Any, coefficients: Any, theta: float) -> Any:
    """The state after a part theta of a step, 0 <= theta <= 1."""
    return system.displaced(retraction, state, theta * horner(coefficients, theta))


def advance(
    method: Any, system: Any, control: Any, layout: Any, row: Any, turns: int, every: int, goals: Any,
    states: Any, clocks: Any, out: Any, failures: Any,
) -> None:  # fmt: skip
    """The driver: `turns` turns of a control, with a row of numbers for each in which a step was made, of one
    body or of many side by side, every body with its own step and its own goal.

    A body that has reached its goal, or is stuck, stays where it is.
    layout, row : of what is carried along, and of a row.  every : steps of a turn of fixed steps; of
    others it is one.
    goals, states, clocks, out : `Goal`; what is carried along, and `Clock`, before and after; the
    rows, as many as there were turns in which a step was made.
    failures : None in native code; in plain Python a list for what failing steps raised.
    """
    goal = read(goals, 0, GOAL)
    clock, carry = read(clocks, 0, CLOCK), read(states, 0, layout)
    clock, carry = control.begun(method, system, clock, carry, goal, failures)
    clock, carry = control.march((method, system, layout, row), clock, carry, goal, turns, every, out, failures)
    write(states, 0, carry, layout)
    write(clocks, 0, clock, CLOCK)


def begin(
    method: Any, system: Any, given: Any, started: Any, layout: Any, shown: Any, starts: Any, clocks: Any,
    states: Any, out: Any, failures: Any,
) -> None:  # fmt: skip
    """The driver before the first step: from a start, given in one layout and to be used in
    another, what the method carries along, in a third, and the first sample.  A body that cannot
    begin keeps what is in `out`, and is stuck.
    """
    clock = read(clocks, 0, CLOCK)
    trial = attempt(begun, method, system, fitted(read(starts, 0, given), started), clock.h)
    good = accepted(trial, observed, shown)
    if any_body(good):
        write(states, 0, fitted(trial[0], layout), layout)
        write(out, 0, where(good, trial[1], read(out, 0, shown)), shown)
    stuck = where(good, clock.stuck, ASKED if failures is None else STUCK)
    write(clocks, 0, with_fields(clock, stuck=stuck), CLOCK)
    if failures is not None and not good:
        failures.append(reason(trial))


@record
class Samples(Record):
    """Count of the states at given times that were written, and whether one failed."""

    written: float
    failed: float


SAMPLES = layout_of(Samples(0.0, 0.0))


def sampled_steps(
    method: Any, system: Any, control: Any, layout: Any, row: Any, room: int, count: int, goals: Any,
    states: Any, clocks: Any, out: Any, times: Any, samples: Any, done: Any, failures: Any,
) -> None:  # fmt: skip
    """The driver: trials of one body, one by one, and the states at those of `count` times, sorted in
    their direction, that it has passed.

    done : `Samples`; a state that fails ends the piece, before it.
    """
    point = layout.parts[0]  # of state and velocity
    n, k, onward, failed = 0, 0, True, 0.0
    clock, (start, _) = read(clocks, 0, CLOCK), read(states, 0, layout)
    t_end = read(goals, 0, GOAL).t_end
    sign = 1.0 if t_end >= clock.t else -1.0
    while k < count and read(times, k, NUMBER) == clock.t:
        write(samples, k, start, point)
        k = k + 1
    while n < room and onward:
        before, (state, _) = clock.t, read(states, 0, layout)
        advance(method, system, control, layout, row, 1, 1, goals, states, clocks, out, failures)
        clock, (after, _) = read(clocks, 0, CLOCK), read(states, 0, layout)
        n = n + 1
        onward = clock.t != t_end and clock.stuck == 0.0
        while k < count and failed == 0.0 and sign * read(times, k, NUMBER) <= sign * clock.t:
            at, sample = read(times, k, NUMBER), after
            if control.curves and at != clock.t:
                curve, theta = read(out, 0, row)[2], (at - before) / (clock.t - before)
                moved = attempt(on_the_way, method.retraction, system, state, curve, theta)
                if accepted(moved, itself, point):
                    sample = moved
                else:
                    failed, onward = 1.0, False
            if failed == 0.0:
                write(samples, k, sample, point)
                k = k + 1
    write(done, 0, Samples(float(k), failed), SAMPLES)
