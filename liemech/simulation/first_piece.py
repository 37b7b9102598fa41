"""The first steps of an adaptive run of one body, in one call of native code: of a short run all of
them, with a few microseconds of Python around it.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from ..compiler.kernel import address
from ..formulas.pytree import build, known_layout
from .adaptive import CLOCK, FRESH, TAKEN, TIME
from .carry import AdaptiveCarry
from .dense import DenseOutput, unpacked
from .sampled import SAMPLES, between
from .stopped import NONE
from .trajectory import Trajectory

LONGEST = 2**20
"""Steps times width^2 of one call of native code, width of the numbers carried along."""

ROWS = 2**14
"""Numbers of the rows that there is room for."""

CLOCKS = struct.Struct(f"{CLOCK.width}d")


def first_piece(
    plan: Any, start: Any, t0: float, t_end: float, times: np.ndarray | None, limit: int
) -> FirstPiece | None:
    """Such steps; None if there is no native code yet, or nothing to do."""
    known = known_layout(start) if t0 != t_end else None
    if known is None:
        return None
    if times is None:
        shape = plan.shapes.get((known, plan.dense is not False, False))
    else:
        shape = plan.shapes.get((known, between(times, t0, t_end), True)) if len(times) else None
    if shape is None:
        return None
    shape.stepping.refresh()
    if shape.stepping.native is None:
        return None
    limit = min(limit, max(1, LONGEST // shape.layout.width**2))
    if times is None:
        return EveryStep(plan, shape, start, t0, t_end, limit)
    return AtTimes(plan, shape, start, t0, t_end, limit, times)


class FirstPiece:
    """Steps from a start; what is kept of them, subclasses know.

    memory : what is carried along, the clock, and what is kept.
    """

    __slots__ = ("clock", "memory", "plan", "shape", "t0", "t_end")

    memory: Any

    def __init__(
        self, plan: Any, shape: Any, t0: float, t_end: float, size: int, *begun: float
    ) -> None:
        self.plan, self.shape, self.t0, self.t_end = plan, shape, t0, t_end
        self.memory = np.empty(shape.kept + size)
        shape.begun.pack_into(self.memory, 0, *begun)

    def _run(self, integers: tuple[int, ...], *buffers: tuple[int, int]) -> None:
        """Run native code.  buffers : the addresses of its arrays, and how many numbers they hold."""
        plan, shape = self.plan, self.shape
        numbers = shape.constants, self.t_end, plan.rtol, plan.atol, plan.longest
        words = *integers, *[place for place, _ in buffers]
        shape.stepping.native.on_memory(shape.call(1, 0, 1, *words, *numbers), buffers)
        self.clock = CLOCKS.unpack_from(self.memory, 8 * shape.layout.width)

    @property
    def carried(self) -> np.ndarray:
        """State and velocity at the end of the piece."""
        return self.memory[: self.shape.layout.width]

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
        state = build(self.shape.state, iter(self.carried.tolist()))
        return AdaptiveCarry(self.carried.copy(), np.array(self.clock), state, self.t_end)

    def handed_over(self, run: Any) -> None:
        """Let a run go on from here."""
        run.states, run.clock, run.compiled = self.carried.copy(), np.array(self.clock), True


class EveryStep(FirstPiece):
    """With a row of numbers for the start and the end of every step."""

    __slots__ = ()

    def __init__(
        self, plan: Any, shape: Any, start: Any, t0: float, t_end: float, limit: int
    ) -> None:
        width, numbers = shape.row.width, shape.gather(start)
        room = min(limit, max(1, ROWS // width))
        row = t0, *numbers, *shape.no_curve
        begun = *numbers, *shape.rest, t0, plan.first(t0, t_end), *FRESH
        super().__init__(plan, shape, t0, t_end, (1 + room) * width, *begun, *row)
        place = address(self.memory)
        self._run(
            (room,),
            (place, shape.layout.width),
            (place + shape.clock, CLOCK.width),
            (place + 8 * (shape.kept + width), room * width),
        )

    @property
    def rows(self) -> np.ndarray:
        """Of the start and every end of a step the time, the state and the way there."""
        width, begin = self.shape.row.width, self.shape.kept
        return self.memory[begin : begin + width * (1 + int(self.clock[TAKEN]))].reshape(-1, width)

    def trajectory(self, dense: DenseOutput | None = None) -> Trajectory:
        """With the motion between the steps."""
        plan, shape = self.plan, self.shape
        used = shape.kept + shape.row.width * (1 + int(self.clock[TAKEN]))
        self.memory.resize((used,), refcheck=False)  # nobody else has seen it
        if shape.curves:
            method = plan.method
            way = self.rows, method.dense_order, plan.compiled
            dense = DenseOutput(plan.system, method.retraction, shape.example, *way)
        return super().trajectory(dense)

    def t(self) -> np.ndarray:
        """The times of the samples."""
        return self.rows[:, 0]

    def states(self) -> dict[str, np.ndarray]:
        """The samples, views of the rows."""
        return unpacked(self.shape.state, self.rows[:, 1 : 1 + self.shape.state.width])

    def handed_over(self, run: Any) -> None:
        super().handed_over(run)
        run.rows = self.rows.copy()
        run.filled = len(run.rows)


class AtTimes(FirstPiece):
    """With the states at given times.  The row of the last step and the state before it lie
    before them.
    """

    __slots__ = ("times",)

    def __init__(
        self, plan: Any, shape: Any, start: Any, t0: float, t_end: float, limit: int,
        times: np.ndarray,
    ) -> None:  # fmt: skip
        self.times = times
        width, count = shape.state.width, len(times)
        begun = *shape.gather(start), *shape.rest, t0, plan.first(t0, t_end), *FRESH
        super().__init__(plan, shape, t0, t_end, shape.before + count * width, *begun)
        place = address(self.memory)
        done = place + 8 * shape.kept
        out, samples = done + 8 * SAMPLES.width, done + 8 * shape.before
        self.memory[shape.kept + SAMPLES.width + shape.row.width] = t0
        self._run(
            (limit, count),
            (place, shape.layout.width),
            (place + shape.clock, CLOCK.width),
            (out, shape.before - SAMPLES.width),
            (address(times), count),
            (samples, count * width),
            (done, SAMPLES.width),
        )

    @property
    def written(self) -> int:
        """How many states there are."""
        return int(self.memory.item(self.shape.kept))

    @property
    def complete(self) -> bool:
        return self.clock[TIME] == self.t_end and self.written == len(self.times)

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
        return unpacked(self.shape.state, self.samples)

    def handed_over(self, run: Any) -> None:
        if self.memory.item(self.shape.kept + 1):  # a state failed: plain Python says why
            return
        super().handed_over(run)
        run.found, run.asked = self.samples, self.written
        run.sampled.append(run.found[: run.asked])
        run.rows[0, : 1 + run.width] = run.clock[TIME], *run.states[: run.width]
