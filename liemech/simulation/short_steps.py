"""Short runs with fixed steps: one call of native code, and some microseconds of Python around it."""

from __future__ import annotations

import math
import operator
import struct
from typing import Any

import numpy as np

from ..compiler.kernel import address
from ..formulas.pytree import gatherer
from ..systems.system import State
from .carry import Carry
from .control import CLOCK, FRESH, GOAL, MARK, STRAIGHT, TAKEN
from .dense import flat, unpacked
from .execution import like
from .prepared import Shape, Steps
from .stopped import NONE
from .trajectory import Trajectory

LONGEST, LARGEST = 2**23, 2**24
"""Steps of such a run, each counted as the square of the numbers it carries along, and numbers of
its samples at most.

A step costs about as many nanoseconds as that square: native code comes back in milliseconds, and
then Ctrl-C is heard.
"""

ENDLESS = 2.0**53
"""More steps than any run has."""


class Place:
    """Places in the memory of short runs whose starts are alike: what is carried along, the clock, the
    goal, the samples.
    """

    def __init__(self, steps: Steps, shape: Shape) -> None:
        self.shape, self.lanes = shape, shape.lanes_of(steps, STRAIGHT, (), shape.side)
        self.carried, self.sampled = shape.layout.width, shape.shown.width
        self.clock, self.kept = self.carried, self.carried + CLOCK.width + GOAL.width
        self.taken = self.clock + TAKEN
        self.gather, self.constants = gatherer(shape.given), self.lanes.constants
        self.call = struct.Struct(f"9q{len(self.constants)}s").pack
        self.begun = struct.Struct(f"{self.kept + self.sampled}d").pack_into
        self.asked = steps.compiled
        self.beginning = shape.beginning(steps, self.lanes) if shape.order is None else None
        if shape.order is not None:
            self.picked = operator.itemgetter(*shape.order, -1)
            self.copied = np.flatnonzero(np.array(shape.order) >= 0)
            self.source = np.array(shape.order)[self.copied]

    def of_system(self, shape: Shape) -> Any:
        """These places for another system of the same layout."""
        lanes, beginning = shape.lanes[STRAIGHT, shape.side], shape._beginning
        return like(self, shape=shape, lanes=lanes, constants=lanes.constants, beginning=beginning)

    def native(self, steps: int) -> bool:
        """Is there native code for so many steps at once, in milliseconds, that says what the formulas
        say now?
        """
        if steps * self.carried * self.carried > LONGEST:
            return False
        stepping = self.lanes.stepping
        stepping.refresh()
        return stepping.native is not None

    def begin(self, start: Any, t0: float, h: float, memory: Any) -> bool:
        """Write what one body carries along, its clock and goal, and the first sample; False if the
        method cannot begin so.
        """
        numbers = self.gather(start)
        beginning, clock = self.beginning, (t0, h, *FRESH)
        goal = math.inf, 0.0, 0.0, 0.0, ENDLESS, t0
        if beginning is None:
            numbers.append(0.0)
            picked = self.picked(numbers)[:-1]
            self.begun(memory, 0, *picked, *clock, *goal, *numbers[:-1])
            return True
        beginning.used(self.asked)
        if not beginning.ready(0.0):
            return False
        rest = numbers if self.shape.given == self.shape.shown else (0.0,) * self.sampled
        self.begun(memory, 0, *(0.0,) * self.carried, *clock, *goal, *rest)
        end, kept = self.carried + CLOCK.width, self.kept
        parts = memory[self.carried : end], memory[: self.carried], memory[kept:][: self.sampled]
        beginning.run(self.constants, (), (np.array(numbers), *parts))
        return memory.item(self.clock + MARK) == 0.0

    def go_on(self, carry: Carry, memory: Any) -> None:
        """Write where a run of one body stands."""
        h: Any = carry.h
        clock = carry.t, h, 0.0, float(carry.step), 0.0, 0.0, 0.0
        goal = math.inf, 0.0, 0.0, 0.0, ENDLESS, carry.t0
        self.begun(memory, 0, *carry.numbers, *clock, *goal, *carry.last)

    def advance(self, memory: Any, turns: int, every: int, out: int) -> None:
        """Make `turns` samples, each after `every` steps; out : where the first one is in memory."""
        goal, states, clocks, rows = buffers = self.buffers(memory, turns, out)
        where = goal[0], states[0], clocks[0], rows[0]
        block = self.call(1, 0, 1, turns, every, *where, self.constants)
        self.lanes.stepping.on_memory(block, buffers)

    def buffers(self, memory: Any, turns: int, out: int) -> Any:
        """Where goal, numbers, clock and rows are, and how many numbers each has."""
        place, width = address(memory), self.carried
        clock = place + 8 * width
        goal, rows = clock + 8 * CLOCK.width, place + 8 * out
        written = rows, turns * self.sampled
        return (goal, GOAL.width), (place, width), (clock, CLOCK.width), written


def place_of(steps: Steps, shape: Shape) -> Place:
    """That of a shape."""
    if shape.place is None:
        shape.place = Place(steps, shape)
    return shape.place


def short_steps(way: Steps, shape: Shape, start: Any, steps: int, t0: float) -> Trajectory | None:
    """The run of one body, from a start at t0 or from where another one stands; None if there
    is more to do than to step: samples in the middle of `every`, progress bars, steps that fail, what is
    not compiled yet.
    """
    every, place = way.every, shape.place or place_of(way, shape)
    samples = steps // every
    if steps <= 0 or steps % every or way.progress:
        return None
    if samples * place.sampled > LARGEST or not place.native(steps):
        return None
    memory, step = np.empty(place.kept + (samples + 1) * place.sampled), 0
    if isinstance(start, Carry):
        t0, step = start.t0, start.step
        place.go_on(start, memory)
    elif not place.begin(start, t0, way.h, memory):
        return None
    reached = step + steps
    if step % every:
        return None
    place.advance(memory, samples, every, place.kept + place.sampled)
    if memory.item(place.taken) != reached:
        return None
    return _made(way, steps, _Found(place, memory, t0, way.h, every, step, reached), None)


def _made(way: Steps, steps: int, found: Any, bodies: int | None) -> Trajectory:
    return Trajectory.promised(
        found, system=way.system, method=way.method, breaks=way.breaks, h=way.h, bodies=bodies,
        steps=steps, stopped=NONE, compiled=True,
    )  # fmt: skip


def advanced(way: Steps, carry: Carry, steps: int) -> Carry | None:
    """Where a run of one body stands some steps later, without samples between; None if native code
    does not come there.
    """
    shape: Any = carry.shape
    if carry.bodies is not None or not way.owns(shape):
        return None
    place = place_of(way, shape)
    if not place.native(steps):
        return None
    memory = np.empty(place.kept + place.sampled)
    place.go_on(carry, memory)
    place.advance(memory, 1, steps, place.kept)
    reached = carry.step + steps
    if memory.item(place.taken) != reached:
        return None
    given = shape, carry.t0, carry.h, reached, memory[: place.carried], memory[place.kept :]
    return Carry.quickly(*given, carry.met)


class _Found:
    """Times and states of a short run, found when they are asked for: views of what the steps have
    written.
    """

    __slots__ = ("every", "h", "last", "memory", "place", "reached", "step", "t0")

    def __init__(
        self,
        place: Place,
        memory: Any,
        t0: float,
        h: Any,
        every: int,
        step: int,
        reached: int,
    ) -> None:
        self.place, self.memory = place, memory
        self.last: np.ndarray | None = None
        self.t0, self.h, self.every, self.step, self.reached = t0, h, every, step, reached

    def t(self) -> np.ndarray:
        """The times of the samples."""
        return self.t0 + np.arange(self.step, self.reached + 1, self.every) * self.h

    def states(self) -> dict[str, np.ndarray]:
        """The samples; as they may be written to, the last one is kept for the carry."""
        place = self.place
        self.last = self.memory[-place.sampled :].copy()
        return unpacked(place.shape.shown, self.memory[place.kept :].reshape(-1, place.sampled))

    def carry(self) -> Carry:
        """Where the run stands."""
        place = self.place
        last = self.memory[-place.sampled :].copy() if self.last is None else self.last
        numbers = self.memory[: place.carried]
        return Carry.quickly(place.shape, self.t0, self.h, self.reached, numbers, last)


class _FoundOfBodies(_Found):
    """Times and states of a short run of an ensemble.  memory : (height, columns) of all numbers."""

    __slots__ = ("bodies", "out")

    bodies: int
    out: np.ndarray

    def states(self) -> dict[str, np.ndarray]:
        """The samples, views of what the steps have written."""
        self.last = self.out[-1, :, : self.bodies].copy()
        return unpacked(self.place.shape.shown, self.out[:, :, : self.bodies].swapaxes(1, 2))

    def carry(self) -> Carry:
        """Where the run stands."""
        last = self.out[-1, :, : self.bodies].copy() if self.last is None else self.last
        numbers = self.memory[: self.place.carried, : self.bodies]
        given = self.place.shape, self.t0, self.h, self.reached, numbers, last
        return Carry.quickly(*given, bodies=self.bodies)


def short_steps_of_many(
    way: Steps, shape: Shape, start: State, steps: int, t0: float
) -> Trajectory | None:
    """Run some bodies side by side; None as for one body."""
    arrays, place = start.arrays, place_of(way, shape)
    count = len(next(iter(arrays.values())))
    columns, samples = shape.columns(count), steps // way.every
    if steps <= 0 or steps % way.every or way.progress:
        return None
    if samples * place.sampled * columns > LARGEST or not place.native(steps * count):
        return None
    table = np.empty((place.lanes.height, columns))
    out = np.empty((samples + 1, place.sampled, columns))
    alike = shape.given == shape.shown
    starts = out[0] if alike else np.empty((shape.given.width, columns))
    starts[:, :count] = flat(arrays, count).T
    starts[:, count:] = starts[:, count - 1 : count]
    goal = math.inf, 0.0, 0.0, 0.0, ENDLESS, t0
    table[place.clock :] = np.array((t0, way.h, *FRESH, *goal))[:, None]
    if place.beginning is None:
        table[: place.clock] = 0.0
        table[place.copied] = starts[place.source]
    else:
        place.beginning.used(place.asked)
        if not place.beginning.ready(0.0):
            return None
        numbers, clocks, *_ = place.lanes.parts(table)
        given = starts, clocks, numbers, out[0]
        place.beginning.run(place.constants, (), given, columns, 0, shape.whole(count))
    whole, (carried, clock, goals, *_) = shape.whole(count), place.lanes.parts(table)
    rows = goals, carried, clock, out[1:]
    place.lanes.stepping.run(place.constants, (samples, way.every), rows, columns, 0, whole)
    if (table[place.taken, :whole] != steps).any():
        return None
    found = _FoundOfBodies(place, table, t0, way.h, way.every, 0, steps)
    found.bodies, found.out = count, out
    return _made(way, steps, found, count)
