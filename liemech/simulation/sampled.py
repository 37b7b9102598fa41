"""Adaptive steps of one body whose states are asked for at given times: the steps and the states
between them, all in native code.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiler.driver import accepted, attempt, itself, read, write
from ..formulas import Record, record
from ..formulas.pytree import NUMBER, layout_of
from .adaptive import CLOCK, adaptive_steps
from .dense import on_the_way


@record
class Samples(Record):
    """What a piece of a run has done: how many states it has written, and whether one failed."""

    written: float
    failed: float


SAMPLES = layout_of(Samples(0.0, 0.0))


def sampled_steps(
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
    count: int,
    states: Any,
    clocks: Any,
    out: Any,
    times: Any,
    samples: Any,
    done: Any,
    failures: Any,
) -> None:
    """The driver: `adaptive_steps`, whose arguments are these, one by one, and the states at those of
    `count` times, sorted in their direction, that they have passed.

    out : the row of the last step, and behind it time and state before that step.  At a jump of the
    velocity that time, given for the first step, is the one before the jump.
    done : `Samples`; a state that fails ends the piece, before it.
    """
    point = layout.parts[0]  # of state and velocity
    n, k, going, failed = 0, 0, True, 0.0
    clock, (start, _) = read(clocks, 0, CLOCK), read(states, 0, layout)
    before = read(out, row.width, NUMBER)
    while k < count and read(times, k, NUMBER) == clock.t:
        write(samples, k * point.width, start, point)
        k = k + 1
    while n < room and going:
        begun, (state, _) = read(clocks, 0, CLOCK), read(states, 0, layout)
        write(out, row.width, before, NUMBER)
        write(out, row.width + 1, state, point)
        adaptive_steps(
            method, system, layout, row, t_end, rtol, atol, longest, dense, 1,
            states, clocks, out, failures,
        )  # fmt: skip
        clock, (after, _) = read(clocks, 0, CLOCK), read(states, 0, layout)
        sign = 1.0 if t_end >= begun.t else -1.0
        n = n + 1
        going = clock.t != t_end and clock.stuck == 0.0
        while k < count and failed == 0.0 and sign * read(times, k, NUMBER) <= sign * clock.t:
            at, sample = read(times, k, NUMBER), after
            if dense and at != clock.t:
                curve, theta = read(out, 0, row)[2], (at - before) / (clock.t - before)
                moved = attempt(on_the_way, method.retraction, system, state, curve, theta)
                if accepted(moved, itself, point):
                    sample = moved
                else:
                    failed, going = 1.0, False
            if failed == 0.0:
                write(samples, k * point.width, sample, point)
                k = k + 1
        before = clock.t
    write(done, 0, Samples(float(k), failed), SAMPLES)


def at_start(times: np.ndarray, t0: float) -> int:
    """How many of these times, sorted from there on, are the start."""
    count, n = len(times), 0
    while n < count and times.item(n) == t0:
        n += 1
    return n


def between(times: np.ndarray, t0: float, t_end: float) -> bool:
    """Are there others among them than the start and the end?"""
    before = at_start(times, t0)
    return before < len(times) and times.item(before) != t_end
