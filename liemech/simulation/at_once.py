"""Short runs of one body: one call of native code, and a few microseconds of Python around it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..compiler.kernel import Kernel, address
from ..formulas.pytree import layout_of
from ..systems.system import State
from .carry import Carry
from .dense import unpacked
from .fixed_run import FixedRun
from .prepared import Shape, Steps
from .stopped import NONE
from .trajectory import Trajectory

LONGEST, LARGEST = 2**23, 2**24
"""Steps of such a run, each counted as the square of the numbers it carries along, and numbers of
its samples at most.

A step costs about as many nanoseconds as that square: native code comes back in milliseconds, and
then Ctrl-C is heard.
"""


def at_once(plan: Steps, start: State | Carry, steps: int, t0: float) -> Trajectory | None:
    """The run from a start at t0, or from where another one stands; None if there is more to do
    than to step.

    That is `FixedRun`'s: what is not prepared yet, ensembles, samples in the middle of `every`,
    progress bars, steps that fail.
    """
    if start.bodies is not None:
        return None
    shape = start.shape if isinstance(start, Carry) else plan.shapes.get((layout_of(start), False))
    if shape is None or not plan.owns(shape):
        return None
    return of_shape(plan, shape, start, steps, t0)


def of_shape(
    plan: Steps, shape: Shape, start: State | Carry, steps: int, t0: float
) -> Trajectory | None:
    """The same for a start of this shape, or of one that has more parts."""
    every, step = plan.every, 0
    carried, shown, samples = shape.carried, shape.sampled, steps // every
    if steps <= 0 or steps % every or plan.progress or samples * shown > LARGEST:
        return None
    native = in_one_call(shape, steps)
    if native is None:
        return None
    memory = np.empty(carried + (samples + 1) * shown)  # what is carried along, and the samples
    if isinstance(start, Carry):
        t0, step = start.t0, start.step
        memory[:carried], memory[carried : carried + shown] = start.numbers, start.last
    elif not shape.begin(start, memory):
        return None
    reached, place = step + steps, address(memory)
    out = place + 8 * (carried + shown)
    shape.native_steps(native, t0, plan.h, step, every, samples, place, out)
    if step % every or memory.item(carried - 1) != reached:
        return None
    return Trajectory.promised(
        _Found(shape, memory, t0, plan.h, every, step, reached),
        system=plan.system,
        method=plan.method,
        breaks=plan.breaks,
        h=plan.h,
        bodies=None,
        steps=steps,
        stopped=NONE,
        compiled=True,
    )


def advanced(plan: Steps, carry: Carry, steps: int) -> Carry:
    """Where a run stands some steps later, without samples between."""
    shape: Any = carry.shape
    alone = plan.owns(shape) and carry.bodies is None
    native = in_one_call(shape, steps) if alone else None
    if native is not None:
        carried, reached = shape.carried, carry.step + steps
        memory = np.empty(carried + shape.sampled)
        memory[:carried] = carry.numbers
        place = address(memory)
        out = place + 8 * carried
        shape.native_steps(native, carry.t0, carry.h, carry.step, steps, 1, place, out)
        if memory.item(carried - 1) == reached:
            given = shape, carry.t0, carry.h, reached, memory[:carried], memory[carried:]
            return Carry.quickly(*given, carry.met)
    # of a failing step it says why
    run = Advance(dataclasses.replace(plan, every=steps), carry, steps).trajectory()
    if run.carry is None:  # all bodies have stopped
        raise run.stopped[min(run.stopped)].error
    return dataclasses.replace(run.carry, met=carry.met)


class Advance(FixedRun):
    """Steps that warn of a body only when it stops."""

    def _result(self, steps: int) -> Trajectory:
        now = (self.taken >= self.before) & (self.taken < self.before + steps)
        return super()._result(steps) if now.any() else self._so_far(steps)


def in_one_call(shape: Shape | None, steps: int) -> Kernel | None:
    """The native code for so many steps at once, in milliseconds, if it is there and says what the
    formulas say now.
    """
    if shape is None or steps * shape.carried * shape.carried > LONGEST:
        return None
    shape.stepping.refresh()
    return shape.stepping.native


class _Found:
    """What the memory of a run tells: times, and states, which are views of what the steps have
    written.
    """

    __slots__ = ("every", "h", "last", "memory", "reached", "shape", "step", "t0")

    def __init__(
        self,
        shape: Shape,
        memory: np.ndarray,
        t0: float,
        h: float,
        every: int,
        step: int,
        reached: int,
    ) -> None:
        self.shape, self.memory = shape, memory
        self.last: np.ndarray | None = None
        self.t0, self.h, self.every, self.step, self.reached = t0, h, every, step, reached

    def t(self) -> np.ndarray:
        """The times of the samples."""
        return self.t0 + np.arange(self.step, self.reached + 1, self.every) * self.h

    def states(self) -> dict[str, np.ndarray]:
        """The samples; as they may be written to, the last one is kept for the carry."""
        shape = self.shape
        self.last = self.memory[-shape.sampled :].copy()
        return unpacked(shape.shown, self.memory[shape.carried :].reshape(-1, shape.sampled))

    def carry(self) -> Carry:
        """Where the run stands."""
        shape = self.shape
        last = self.memory[-shape.sampled :].copy() if self.last is None else self.last
        return Carry(shape, self.t0, self.h, self.reached, None, self.memory[: shape.carried], last)
