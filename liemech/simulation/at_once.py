"""Short runs of one body: one call of native code, and a few microseconds of Python around it."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from ..compiler.kernel import address
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
    every, step = plan.every, 0
    if steps <= 0 or steps % every or plan.progress or start.bodies is not None:
        return None
    shape = start.shape if isinstance(start, Carry) else plan.shapes.get((layout_of(start), False))
    if shape is None or not plan.owns(shape):
        return None
    shape.stepping.again()
    carried, shown, samples = shape.carried, shape.sampled, steps // every
    if (
        shape.stepping.native is None
        or steps * carried * carried > LONGEST
        or samples * shown > LARGEST
    ):
        return None
    memory = np.empty(carried + (samples + 1) * shown)  # what is carried along, and the samples
    if isinstance(start, Carry):
        t0, step = start.t0, start.step
        memory[:carried], memory[carried : carried + shown] = start.numbers, start.last
    elif not shape.begin(start, memory):
        return None
    reached, place = step + steps, address(memory)
    shape.native_steps(t0, plan.h, step, every, samples, place, place + 8 * (carried + shown))
    if step % every or memory.item(carried - 1) != reached:
        return None
    return Trajectory.promised(
        functools.partial(_fields, plan, shape, memory, t0, step, steps), compiled=True
    )


def advanced(plan: Steps, carry: Carry, steps: int) -> Carry:
    """Where a run stands some steps later, without samples between."""
    shape: Any = carry.shape
    short = (
        plan.owns(shape)
        and carry.bodies is None
        and steps * shape.carried * shape.carried <= LONGEST
    )
    if short and shape.stepping.native is not None:
        carried, reached = shape.carried, carry.step + steps
        memory = np.empty(carried + shape.sampled)
        memory[:carried] = carry.numbers
        place = address(memory)
        shape.native_steps(carry.t0, carry.h, carry.step, steps, 1, place, place + 8 * carried)
        if memory.item(carried - 1) == reached:
            return Carry(
                shape, carry.t0, carry.h, reached, None, memory[:carried], memory[carried:]
            )
    # of a failing step it says why
    return FixedRun(dataclasses.replace(plan, every=steps), carry, steps).trajectory().carry


def _fields(
    plan: Steps, shape: Shape, memory: np.ndarray, t0: float, step: int, steps: int
) -> dict[str, Any]:
    """Of a run from some step on, what its memory tells; times and states are views of what the
    steps have written.
    """
    carried, shown, h = shape.carried, shape.sampled, plan.h
    return {
        "system": plan.system,
        "method": plan.method,
        "h": h,
        "t": t0 + np.arange(step, step + steps + 1, plan.every) * h,
        "states": unpacked(shape.shown, memory[carried:].reshape(-1, shown)),
        "bodies": None,
        "steps": steps,
        "stopped": NONE,
        "carry": Carry(shape, t0, h, step + steps, None, memory[:carried], memory[-shown:].copy()),
    }
