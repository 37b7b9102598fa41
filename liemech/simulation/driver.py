"""The compiled loops: `advance` takes bodies forwards under any control; `fixed_steps` is the
shorter one for bodies that all make the same fixed steps; `begin` starts a method.
"""

from __future__ import annotations

from typing import Any

from ..compiler.driver import accepted, any_body, attempt, itself, read, reason, write
from ..formulas import Record, record, where
from ..formulas.pytree import NUMBER, fitted, layout_of
from .control import CLOCK, GOAL, begun, going, observed, sample, stepped
from .dense import on_the_way


def advance(
    method: Any,
    system: Any,
    control: Any,
    layout: Any,
    row: Any,
    turns: int,
    goals: Any,
    states: Any,
    clocks: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver: `turns` trials of steps, with a row of numbers for each in which a step was made, of one body
    or of many side by side, every body with its own step and its own goal.

    A body that has reached its goal, or is stuck, stays where it is.
    layout, row : of what is carried along, and of a row: time, state, and what the control adds.
    goals, states, clocks, out : `Goal`; what is carried along, and `Clock`, before and after; the
    rows, as many as there were trials in which a step was made.
    failures : None in native code; in plain Python a list for what failing steps raised.
    """
    goal = read(goals, 0, GOAL)
    clock, carry = control.begun(
        method, system, read(clocks, 0, CLOCK), read(states, 0, layout), goal, failures
    )
    made = 0
    for _ in range(turns):
        if not any_body(going(clock, goal)):
            break
        clock, carry, good = control.turn(
            method, system, layout, row, clock, carry, goal, made * row.width, out, failures
        )
        if any_body(good):
            made = made + 1
    write(states, 0, carry, layout)
    write(clocks, 0, clock, CLOCK)


def fixed_steps(
    method: Any,
    system: Any,
    layout: Any,
    shown: Any,
    t0: float,
    h: float,
    first: int,
    every: int,
    samples: int,
    states: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver: `samples` times `every` steps from step number `first`, in plain Python or
    compiled, for one or many.

    states holds, before and after, what the method carries along, in this layout, and behind it the
    number of steps that went through; out the samples, laid out as `shown`.  A body whose step
    fails stays where it is, for good.
    failures : None in native code; in plain Python, which has one body, a list for what the failing
    step raised.
    """
    carry = read(states, 0, layout)
    count = read(states, layout.width, NUMBER)
    running = count == first
    turns = every if any_body(running) else 0
    for k in range(samples):
        for j in range(turns):
            t = t0 + (first + (k * every + j)) * h
            trial = attempt(stepped, method, system, t, carry, h, layout)
            good = running and accepted(trial, observed, shown)
            if any_body(not good):
                if failures is not None:
                    failures.append(reason(trial))
                running = good
                if not any_body(running):
                    break
                carry = where(good, trial[0], carry)
                count = where(good, count + 1.0, count)
            else:
                carry = trial[0]
                count = count + 1.0
        write(out, k * shown.width, attempt(sample, method, carry), shown)
        if not any_body(running):
            break
    write(states, 0, carry, layout)
    write(states, layout.width, count, NUMBER)


def begin(
    method: Any,
    system: Any,
    given: Any,
    started: Any,
    layout: Any,
    shown: Any,
    h: float,
    starts: Any,
    states: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver before the first step: from a start, given in one layout and to be used in
    another, what the method carries along, in a third, and the first sample.  A body that cannot
    begin keeps what is in `out` and a negative number of steps.
    """
    trial = attempt(begun, method, system, fitted(read(starts, 0, given), started), h)
    good = accepted(trial, observed, shown)
    if any_body(good):
        write(states, 0, fitted(trial[0], layout), layout)
        write(out, 0, where(good, trial[1], read(out, 0, shown)), shown)
    write(states, layout.width, where(good, 0.0, -1.0), NUMBER)
    if failures is not None and not good:
        failures.append(reason(trial))


@record
class Samples(Record):
    """Count of the states at given times that were written, and whether one failed."""

    written: float
    failed: float


SAMPLES = layout_of(Samples(0.0, 0.0))


def sampled_steps(
    method: Any,
    system: Any,
    control: Any,
    layout: Any,
    row: Any,
    room: int,
    count: int,
    goals: Any,
    states: Any,
    clocks: Any,
    out: Any,
    times: Any,
    samples: Any,
    done: Any,
    failures: Any,
) -> None:
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
        write(samples, k * point.width, start, point)
        k = k + 1
    while n < room and onward:
        before, (state, _) = clock.t, read(states, 0, layout)
        advance(method, system, control, layout, row, 1, goals, states, clocks, out, failures)
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
                write(samples, k * point.width, sample, point)
                k = k + 1
    write(done, 0, Samples(float(k), failed), SAMPLES)
