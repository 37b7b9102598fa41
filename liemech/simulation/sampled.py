"""Adaptive steps of one body whose states are asked for at given times: the steps and the states
between them, all in native code.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..compiler.driver import accepted, attempt, itself, read, write
from ..compiler.kernel import address
from ..formulas import Record, record
from ..formulas.pytree import NUMBER, build, known_layout, layout_of
from ..systems.system import State
from .adaptive import CLOCK, FRESH, adaptive_steps
from .carry import AdaptiveCarry
from .dense import on_the_way, unpacked
from .stopped import NONE
from .trajectory import Trajectory


@record
class Samples(Record):
    """What a piece of a run has done: how many states it has written, and whether one failed."""

    written: float
    failed: float


SAMPLES = layout_of(Samples(0.0, 0.0))

LONGEST = 2**20
"""Steps times width^2 of one call of native code, width of the numbers carried along."""


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

    out : the row of the last step, and behind it time and state before that step.
    done : `Samples`; a state that fails ends the piece, before it.
    """
    point = layout.parts[0]  # of state and velocity
    n, k, going, failed = 0, 0, True, 0.0
    while n < room and going:
        begun, (state, _) = read(clocks, 0, CLOCK), read(states, 0, layout)
        write(out, row.width, (begun.t, state))
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
                curve, theta = read(out, 0, row)[2], (at - begun.t) / (clock.t - begun.t)
                moved = attempt(on_the_way, method.retraction, system, state, curve, theta)
                if accepted(moved, itself, point):
                    sample = moved
                else:
                    failed, going = 1.0, False
            if failed == 0.0:
                write(samples, k * point.width, sample, point)
                k = k + 1
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


class FirstPiece:
    """The first steps of a run, in one call of native code; of a short run all of them.

    memory : what is carried along, the clock, what was done, the last row with the state before,
    and the samples.  before : how many samples are of the start.
    """

    __slots__ = ("before", "end", "memory", "shape", "t0", "t_end", "times")

    def __init__(
        self, shape: Any, plan: Any, start: State, t0: float, t_end: float, times: np.ndarray,
        limit: int,
    ) -> None:  # fmt: skip
        self.shape, self.t0, self.t_end, self.times = shape, t0, t_end, times
        carried, width, count = shape.layout.width, shape.state.width, len(times)
        before = at_start(times, t0)
        done = carried + CLOCK.width
        out = done + SAMPLES.width
        self.before, self.end = before, out + shape.row.width + 1 + width
        self.memory = memory = np.empty(self.end + count * width)
        h = 0.0 if plan.h is None else math.copysign(plan.h, t_end - t0)
        shape.begun.pack_into(memory, 0, *shape.gather(start), *shape.rest, t0, h, *FRESH)
        samples = self.end + before * width
        if before:
            memory[self.end : samples].reshape(before, width)[:] = memory[:width]
        room = min(limit, max(1, LONGEST // carried**2))
        place = address(memory)
        shape.stepping.native.call(
            shape.call(
                1, 0, 1, room, count - before, place, place + 8 * carried, place + 8 * out,
                address(times) + 8 * before, place + 8 * samples, place + 8 * done,
                shape.constants, t_end, plan.rtol, plan.atol, plan.longest,
            )
        )  # fmt: skip

    @classmethod
    def of(
        cls, plan: Any, start: Any, t0: float, t_end: float, times: np.ndarray, limit: int
    ) -> FirstPiece | None:
        """Such a piece; None if there is no native code yet, or nothing to do."""
        known = known_layout(start) if len(times) and t0 != t_end else None
        shape = plan.shapes.get((known, between(times, t0, t_end), True)) if known else None
        if shape is None:
            return None
        shape.stepping.refresh()
        if shape.stepping.native is None:
            return None
        return cls(shape, plan, start, t0, t_end, times, limit)

    @property
    def clock(self) -> np.ndarray:
        """What the controller carries along: the numbers of a `Clock`."""
        return self.memory[self.shape.layout.width :][: CLOCK.width]

    @property
    def carried(self) -> np.ndarray:
        """State and velocity at the end of the piece."""
        return self.memory[: self.shape.layout.width]

    @property
    def written(self) -> int | None:
        """How many samples there are; None if a state of them failed."""
        done = self.shape.layout.width + CLOCK.width
        written, failed = self.memory.item(done), self.memory.item(done + 1)
        return None if failed else self.before + int(written)

    def trajectory(self, plan: Any) -> Trajectory | None:
        """The run, if this was all of it."""
        t, _, _, steps, rejected, _, _ = self.clock.tolist()
        if t != self.t_end or self.written != len(self.times):
            return None
        return Trajectory.promised(
            self,
            system=plan.system,
            method=plan.method,
            h=(t - self.t0) / max(1.0, steps),
            bodies=None,
            steps=int(steps),
            compiled=True,
            rejected=int(rejected),
            stopped=NONE,
        )

    @property
    def samples(self) -> np.ndarray:
        """The numbers of the states at the times, (n, width)."""
        return self.memory[self.end :].reshape(len(self.times), -1)

    def t(self) -> np.ndarray:
        """The times of the samples."""
        return self.times

    def states(self) -> dict[str, np.ndarray]:
        """The samples, views of what the steps have written."""
        return unpacked(self.shape.state, self.samples)

    def carry(self) -> AdaptiveCarry:
        """Where the run stands."""
        state = build(self.shape.state, iter(self.carried.tolist()))
        return AdaptiveCarry(self.carried.copy(), self.clock.copy(), state, self.t_end)
