"""Short runs with adaptive steps of one body: one call of native code, and a few microseconds of
Python around it.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from ..compiler.kernel import address
from ..formulas.pytree import build, gatherer, known_layout
from .carry import AdaptiveCarry
from .control import CLOCK, FRESH, GOAL, TAKEN, TIME
from .dense import DenseOutput, unpacked
from .driver import SAMPLES, sampled_steps
from .execution import COLUMNS, SHARED, Execution
from .lanes import Lanes
from .stopped import NONE
from .trajectory import Trajectory

LONGEST = 2**20
"""Steps times width^2 of one call of native code, width of the numbers carried along."""

ROWS = 2**14
"""Numbers of the rows that there is room for."""

CLOCKS = struct.Struct(f"{CLOCK.width}d")


class Prepared:
    """Places in the memory of short runs of one body, which they share.

    clock, goal : how many bytes lie before them.  kept : numbers before what is kept; before : of
    what is kept those before the states at times.
    """

    def __init__(self, lanes: Lanes, sampled: bool) -> None:
        carried, width, row = lanes.layout.width, lanes.state.width, lanes.row.width
        self.lanes, self.gather = lanes, gatherer(lanes.state)
        self.carried, self.row, self.sampled = carried, row, sampled
        self.constants, self.curves = lanes.constants, lanes.arguments[2].curves
        self.rest, self.no_curve = (0.0,) * (carried - width), (0.0,) * (row - 1 - width)
        self.clock, self.goal = 8 * carried, 8 * (carried + CLOCK.width)
        self.kept = carried + CLOCK.width + GOAL.width
        self.before = SAMPLES.width + row
        self.begun = struct.Struct(f"{self.kept + (0 if sampled else row)}d").pack_into
        self.call = struct.Struct(f"{12 if sampled else 9}q{len(lanes.constants)}s").pack
        self.stepping = lanes.stepping
        if sampled:
            stepping, shared = lanes.stepping, (SHARED, COLUMNS, COLUMNS)
            call = sampled_steps, *lanes.arguments, 1, 1, *[COLUMNS] * 4, *shared, None
            self.stepping = Execution(None, stepping.progress, *call, silent=True)

    def ready(self) -> bool:
        """Is there native code?  That for states at times is made if they are asked for often."""
        if self.stepping is self.lanes.stepping:
            self.stepping.refresh()
        else:
            self.stepping.used(self.lanes.stepping.native is not None)
        return self.stepping.native is not None


def short(
    plan: Any, start: Any, t0: float, t_end: float, times: np.ndarray | None, limit: int
) -> Trajectory | None:
    """The run, if it is one of a few native steps; None if there is no native code yet, or more to
    do.
    """
    known = known_layout(start) if t0 != t_end else None
    if known is None:
        return None
    if times is None:
        curves = plan.dense is not False
    else:
        if not len(times):
            return None
        curves = between(times, t0, t_end)
    key = known, curves, times is not None, "short"
    prepared = plan.shapes.get(key)
    if prepared is None:
        lanes = plan.shapes.get((known, curves, False))
        if lanes is None:
            return None
        prepared = plan.shapes[key] = Prepared(lanes, times is not None)
    if not prepared.ready():
        return None
    limit = min(limit, max(1, LONGEST // prepared.carried**2))
    if times is None:
        made: Short = EveryStep(plan, prepared, start, t0, t_end, limit)
    else:
        made = AtTimes(plan, prepared, start, t0, t_end, limit, times)
    return made.trajectory() if made.complete else None


class Short:
    """Steps from a start; what is kept of them, subclasses know.

    memory : what is carried along, the clock, the goal, and what is kept.
    """

    __slots__ = ("clock", "memory", "plan", "shape", "t0", "t_end")

    memory: Any

    def __init__(
        self, plan: Any, shape: Prepared, start: Any, t0: float, t_end: float, size: int,
        limit: int, *begun: float,
    ) -> None:  # fmt: skip
        self.plan, self.shape, self.t0, self.t_end = plan, shape, t0, t_end
        self.memory = np.empty(shape.kept + size)
        numbers, goal = shape.gather(start), (t_end, plan.rtol, plan.atol, plan.longest, limit, 0.0)
        clock = t0, plan.first(t0, t_end), *FRESH
        row = () if shape.sampled else (t0, *numbers, *begun)
        shape.begun(self.memory, 0, *numbers, *shape.rest, *clock, *goal, *row)

    def _run(self, integers: tuple[int, ...], *buffers: tuple[int, int]) -> None:
        """Run native code.  buffers : the addresses of its other arrays, and how many numbers they
        hold.
        """
        shape, place = self.shape, address(self.memory)
        own = (
            (place + shape.goal, GOAL.width),
            (place, shape.carried),
            (place + shape.clock, CLOCK.width),
        )
        buffers = *own, *buffers
        words = *integers, *[where for where, _ in buffers]
        block = shape.call(1, 0, 1, *words, shape.constants)
        shape.stepping.on_memory(block, buffers)
        self.clock = CLOCKS.unpack_from(self.memory, shape.clock)

    @property
    def complete(self) -> bool:
        """Is it all of the run?"""
        return bool(self.clock[TIME] == self.t_end)

    def trajectory(self, dense: DenseOutput | None = None) -> Trajectory:
        """The run, if this was all of it."""
        t, _, _, steps, rejected, _, _ = self.clock
        return Trajectory.promised(
            self,
            system=self.plan.system,
            method=self.plan.method,
            h=(t - self.t0) / max(1.0, steps),
            bodies=None,
            steps=int(steps),
            compiled=True,
            rejected=int(rejected),
            stopped=NONE,
            dense=dense,
        )

    def carry(self) -> AdaptiveCarry:
        """Where the run stands."""
        numbers = self.memory[: self.shape.lanes.layout.width].copy()
        state = build(self.shape.lanes.state, iter(numbers.tolist()))
        return AdaptiveCarry(numbers, np.array(self.clock), state, self.t_end)


class EveryStep(Short):
    """With a row of numbers for the start and the end of every step."""

    __slots__ = ("rows",)

    def __init__(
        self, plan: Any, shape: Prepared, start: Any, t0: float, t_end: float, limit: int
    ) -> None:
        width = shape.row
        room = min(limit, max(1, ROWS // width))
        super().__init__(plan, shape, start, t0, t_end, (1 + room) * width, limit, *shape.no_curve)
        self._run((room, 1), (address(self.memory) + 8 * (shape.kept + width), room * width))

    def trajectory(self, dense: DenseOutput | None = None) -> Trajectory:
        """With the motion between the steps."""
        plan, shape = self.plan, self.shape
        width, begin = shape.row, shape.kept
        end = begin + width * (1 + int(self.clock[TAKEN]))
        self.memory.resize((end,), refcheck=False)  # nobody else has seen it
        rows = self.rows = self.memory[begin:].reshape(-1, width)
        if shape.curves:
            method = plan.method
            way = rows, method.dense_order, plan.compiled
            dense = DenseOutput(plan.system, method.retraction, shape.lanes.example, *way)
        return super().trajectory(dense)

    def t(self) -> np.ndarray:
        """The times of the samples."""
        return self.rows[:, 0]

    def states(self) -> dict[str, np.ndarray]:
        """The samples, views of the rows."""
        state = self.shape.lanes.state
        return unpacked(state, self.rows[:, 1 : 1 + state.width])


class AtTimes(Short):
    """With the states at given times, which lie behind the row of the last step."""

    __slots__ = ("times",)

    def __init__(
        self, plan: Any, shape: Prepared, start: Any, t0: float, t_end: float, limit: int,
        times: np.ndarray,
    ) -> None:  # fmt: skip
        self.times = times
        width, count = shape.lanes.state.width, len(times)
        super().__init__(plan, shape, start, t0, t_end, shape.before + count * width, limit)
        place = address(self.memory)
        done = place + 8 * shape.kept
        self._run(
            (limit, count),
            (done + 8 * SAMPLES.width, shape.before - SAMPLES.width),
            (address(times), count),
            (done + 8 * shape.before, count * width),
            (done, SAMPLES.width),
        )

    @property
    def complete(self) -> bool:
        return self.clock[TIME] == self.t_end and int(self.memory.item(self.shape.kept)) == len(
            self.times
        )

    @property
    def samples(self) -> np.ndarray:
        """The numbers of the states at the times, (n, width)."""
        begin = self.shape.kept + self.shape.before
        return self.memory[begin:].reshape(len(self.times), -1)

    def t(self) -> np.ndarray:
        """The times of the samples."""
        return self.times

    def states(self) -> dict[str, np.ndarray]:
        """The samples, views of what the steps have written."""
        return unpacked(self.shape.lanes.state, self.samples)


def between(times: np.ndarray, t0: float, t_end: float) -> bool:
    """Are there others among sorted times than the start and the end?"""
    count, n = len(times), 0
    while n < count and times.item(n) == t0:
        n += 1
    return n < count and times.item(n) != t_end
