"""Short runs: one call of native code, and a few microseconds of Python around it.

Where the numbers of such a run lie in memory is the same for all starts of one layout: what is carried along,
the clock, the goal, and behind these what is kept.  A run writes its start there and lets native code go on; of
what that has written arrays are made when they are asked for.
"""

from __future__ import annotations

import math
import operator
import struct
from typing import Any

import numpy as np

from ...compiler.kernel import Kernel, address
from ...formulas.classes.layouts import build, gatherer, restricted
from ...formulas.sites import in_lines
from ...systems.system import State
from .. import arguments
from ..between.dense import DenseOutput, lay_out, unpacked
from ..compiled.control import CLOCK, FRESH, GOAL, MARK, STRAIGHT, TAKEN, TIME
from ..compiled.driver import SAMPLES, sampled_steps
from ..compiled.execution import COLUMNS, SHARED, Execution, like
from ..compiled.lanes import Lanes
from ..compiled.prepared import RunShape, Steps
from ..result import of_short
from ..trajectory import Trajectory
from .carry import Carry
from .starts import known

LONGEST, LARGEST = 2**23, 2**24
"""Steps of a run with fixed steps, each counted as the square of the numbers it carries along, and numbers
of its samples at most.

A step costs about as many nanoseconds as that square: native code comes back in milliseconds, and
then Ctrl-C is heard.
"""

TRIALS, ROOM = 2**20, 2**14
"""These limits for adaptive steps, of which a trial costs as much as several fixed ones."""

ENDLESS = 2.0**53
"""More steps than any run has."""

CLOCKS = struct.Struct(f"{CLOCK.width}d")


class ShortPlaces:
    """Offsets in the memory of short runs of one body: of the clock, the goal, and the samples.

    words : of a call, before its constants.  gather : the numbers of a start.  write_start : writes those of a memory.
    """

    def __init__(self, lanes: Lanes, words: int, layout: Any) -> None:
        self.lanes, self.stepping, self.gather = lanes, lanes.stepping, gatherer(layout)
        self.carried, self.constants = lanes.layout.width, lanes.constants
        self.clock, self.goal = self.carried, self.carried + CLOCK.width
        self.kept, self.taken = self.goal + GOAL.width, self.clock + TAKEN
        self.call = struct.Struct(f"{3 + words}q{len(self.constants)}s").pack

    def where(self, memory: Any) -> tuple[Any, ...]:
        """Address and length of goal, numbers and clock, and the address of the memory."""
        place = address(memory)
        goal, clock = place + 8 * self.goal, place + 8 * self.clock
        return (goal, GOAL.width), (place, self.carried), (clock, CLOCK.width), place


# ------------------------------------------------------------------ fixed steps


class FixedPlaces(ShortPlaces):
    """Places of runs with fixed steps: samples are kept, the start first."""

    def __init__(self, steps: Steps, shape: RunShape) -> None:
        super().__init__(shape.lanes_of(steps, STRAIGHT, (), shape.side), 6, shape.given)
        self.shape, self.sampled = shape, shape.shown.width
        self.write_start = struct.Struct(f"{self.kept + self.sampled}d").pack_into
        self.asked = steps.compiled
        self.beginning = shape.beginning(steps, self.lanes) if shape.order is None else None
        if shape.order is not None:
            self.picked = operator.itemgetter(*shape.order, -1)
            self.copied = np.flatnonzero(np.array(shape.order) >= 0)
            self.source = np.array(shape.order)[self.copied]

    def of_system(self, shape: RunShape) -> Any:
        """A copy for another system of the same layout, whose shape is given."""
        lanes = shape.lanes[STRAIGHT, shape.side]
        code = {"lanes": lanes, "stepping": lanes.stepping, "constants": lanes.constants}
        return like(self, shape=shape, beginning=shape._beginning, **code)

    def native(self, steps: int) -> Kernel | None:
        """The native code for so many steps at once, in milliseconds, that says what the formulas say now;
        None if there is none.
        """
        return None if steps * self.carried * self.carried > LONGEST else self.stepping.refresh()

    def begin(self, start: Any, t0: float, h: float, memory: Any) -> bool:
        """Write what one body carries along, its clock and goal, and the first sample; False if the
        method cannot begin so.
        """
        numbers, beginning = self.gather(start), self.beginning
        clock = t0, h, *FRESH, math.inf, 0.0, 0.0, 0.0, ENDLESS, t0  # and goal
        if beginning is None:
            numbers.append(0.0)
            self.write_start(memory, 0, *self.picked(numbers)[:-1], *clock, *numbers[:-1])
            return True
        native = beginning.used(self.asked) or beginning.ready(0.0)
        if native is None:
            return False
        sample = numbers if self.shape.given == self.shape.shown else (0.0,) * self.sampled
        self.write_start(memory, 0, *(0.0,) * self.carried, *clock, *sample)
        parts = memory[self.clock : self.goal], memory[: self.clock], memory[self.kept :]
        native.run(self.constants, (), (np.array(numbers), *parts))
        return memory.item(self.clock + MARK) == 0.0

    def go_on(self, carry: Carry, memory: Any) -> None:
        """Write where a run of one body stands."""
        goal = math.inf, 0.0, 0.0, 0.0, ENDLESS, carry.t0
        numbers, clock, last = carry.numbers.tolist(), carry.clock.tolist(), carry.last.tolist()
        self.write_start(memory, 0, *numbers, *clock, *goal, *last)

    def standing(self, memory: Any, t0: float, last: Any, met: Any = None) -> Carry:
        """The carry of one body that stands in memory, a view."""
        numbers, clock = memory[: self.carried], memory[self.clock : self.goal]
        return Carry.made(self.shape, t0, numbers, clock, last, None, met)

    def buffers(self, memory: Any, turns: int, out: int) -> Any:
        """Address and length of goal, numbers, clock and `turns` samples, the first at index `out` of the memory."""
        *parts, place = self.where(memory)
        return *parts, (place + 8 * out, turns * self.sampled)

    def advance(self, native: Kernel, buffers: Any, turns: int, every: int) -> None:
        """Make `turns` samples, each after `every` steps, by this code."""
        native.on_memory(self.block(buffers, turns, every), buffers)

    def block(self, buffers: Any, turns: int, every: int) -> bytes:
        """The arguments of native code; number 4 of the words is `every`, the constants are at
        `words`.
        """
        (goal, _), (states, _), (clock, _), (rows, _) = buffers
        return self.call(1, 0, 1, turns, every, goal, states, clock, rows, self.constants)

    words = 8 * 9


def place_of(steps: Steps, shape: RunShape) -> FixedPlaces:
    """The places of the runs of a shape, made once."""
    if shape.place is None:
        shape.place = FixedPlaces(steps, shape)
    return shape.place


def short_steps(way: Steps, shape: RunShape, start: Any, steps: int, t0: float) -> Trajectory | None:
    """The run of one body, from a start at t0 or from where another one stands; None if there
    is more to do than to step: samples in the middle of `every`, steps that fail, what is not compiled yet.
    """
    every, place = way.every, shape.place or place_of(way, shape)
    samples = steps // every
    if steps <= 0 or steps % every:
        return None
    native = place.native(steps) if samples * place.sampled <= LARGEST else None
    if native is None:
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
    place.advance(native, place.buffers(memory, samples, place.kept + place.sampled), samples, every)
    if memory.item(place.taken) != reached:
        return None
    promises = _FixedRun(place, memory, way, t0, step, reached)
    return of_short(promises, way, way.h, None, steps, {"breaks": way.breaks, "dense": None})


def advanced(way: Steps, carry: Carry, steps: int) -> Carry | None:
    """The carry of one body `steps` steps later, without samples; None if one native call is not enough."""
    shape: Any = carry.shape
    if carry.bodies is not None or not way.owns(shape):
        return None
    place = place_of(way, shape)
    native = place.native(steps)
    if native is None:
        return None
    memory = np.empty(place.kept + place.sampled)
    place.go_on(carry, memory)
    place.advance(native, place.buffers(memory, 1, place.kept), 1, steps)
    reached = carry.step + steps
    if memory.item(place.taken) != reached:
        return None
    return place.standing(memory, carry.t0, memory[place.kept :], carry.met)


class _FixedRun:
    """Times and states of a run with fixed steps, found when they are asked for: views of what the steps
    have written.

    memory : of one body; of an ensemble all numbers but the samples, (height, columns), and these in `out`.
    """

    __slots__ = ("bodies", "last", "memory", "out", "place", "reached", "step", "t0", "way")

    def __init__(
        self, place: FixedPlaces, memory: Any, way: Steps, t0: float, step: int, reached: int,
        bodies: int | None = None, out: Any = None,
    ) -> None:  # fmt: skip
        self.place, self.memory, self.bodies, self.out = place, memory, bodies, out
        self.last: np.ndarray | None = None
        self.way, self.t0, self.step, self.reached = way, t0, step, reached

    def t(self) -> np.ndarray:
        """Times of the samples, t0 + n h, (n,)."""
        times = np.arange(float(self.step), self.reached + 1.0, float(self.way.every))
        times *= self.way.h
        times += self.t0
        return times

    @property
    def rows(self) -> np.ndarray:
        """Numbers of the samples, (n, width), of an ensemble (n, bodies, width): a view."""
        if self.bodies is None:
            return self.memory[self.place.kept :].reshape(-1, self.place.sampled)
        return self.out[:, :, : self.bodies].swapaxes(1, 2)

    def states(self) -> dict[str, np.ndarray]:
        """The samples; as they may be written to, the last one is kept for the carry."""
        rows = self.rows
        self.last = rows[-1].T.copy()
        return unpacked(self.place.shape.shown, rows)

    def carry(self) -> Carry:
        """The carry at the last sample."""
        place, last = self.place, self.rows[-1].T.copy() if self.last is None else self.last
        if self.bodies is None:
            return place.standing(self.memory, self.t0, last)
        numbers, clock, *_ = place.lanes.parts(self.memory[:, : self.bodies])
        return Carry.made(place.shape, self.t0, numbers, clock, last, self.bodies)


def short_steps_of_many(way: Steps, shape: RunShape, start: State, steps: int, t0: float) -> Trajectory | None:
    """Run some bodies side by side; None as for one body."""
    arrays, place = start.arrays, place_of(way, shape)
    count = len(next(iter(arrays.values())))
    columns, samples = shape.columns(count), steps // way.every
    if steps <= 0 or steps % way.every:
        return None
    native = place.native(steps * count) if samples * place.sampled * columns <= LARGEST else None
    if native is None:
        return None
    table = in_lines(place.lanes.height, columns)
    out = in_lines(samples + 1, place.sampled, columns)
    shown_as_given = shape.given == shape.shown
    starts = out[0] if shown_as_given else np.empty((shape.given.width, columns))
    lay_out(arrays, starts)
    numbers, clocks, goals, *parameters = place.lanes.parts(table)
    clocks[:], goals[:] = _column(t0, way.h, *FRESH), _column(math.inf, 0.0, 0.0, 0.0, ENDLESS, t0)
    for own_rows, numbers_of_bodies in zip(parameters, place.lanes.own, strict=True):
        own_rows[:, :count], own_rows[:, count:] = numbers_of_bodies, numbers_of_bodies[:, -1:]
    whole = shape.whole(count)
    if place.beginning is None:
        numbers[:] = 0.0
        numbers[place.copied] = starts[place.source]
    else:
        beginning = place.beginning.used(place.asked) or place.beginning.ready(0.0)
        if beginning is None:
            return None
        buffers = *parameters, starts, clocks, numbers, out[0]
        beginning.run(place.constants, (), buffers, columns, 0, whole)
    rows = *parameters, goals, numbers, clocks, out[1:]
    native.run(place.constants, (samples, way.every), rows, columns, 0, whole)
    if (table[place.taken, :whole] != steps).any():
        return None
    promises = _FixedRun(place, table, way, t0, 0, steps, count, out)
    return of_short(promises, way, way.h, count, steps, {"breaks": way.breaks, "dense": None})


def _column(*numbers: float) -> np.ndarray:
    return np.array(numbers)[:, None]


# ------------------------------------------------------------------ adaptive steps


class AdaptivePlaces(ShortPlaces):
    """Places of runs with adaptive steps: of every step a row of time, state and way is kept, behind that of the
    start; or, if `sampled`, the states at given times, behind their count and the row of the last step.
    """

    def __init__(self, lanes: Lanes, sampled: bool) -> None:
        super().__init__(lanes, 9 if sampled else 6, lanes.state)
        self.row, width = lanes.row.width, lanes.state.width
        self.unknown, self.no_way = (0.0,) * (self.carried - width), (0.0,) * (self.row - 1 - width)
        self.write_start = struct.Struct(f"{self.kept + (0 if sampled else self.row)}d").pack_into
        self.turns, self.limit = max(1, ROOM // self.row), max(1, TRIALS // self.carried**2)
        self.free: list[Any] = []  # memory for rows of steps that no run needs any more
        self.sampled, self.out = sampled, self.kept + (SAMPLES.width if sampled else self.row)
        self.samples = self.out + self.row
        if sampled:
            call = sampled_steps, *lanes.arguments, 1, 1, *[COLUMNS] * 4, SHARED, COLUMNS, COLUMNS, None
            self.stepping = Execution(None, lanes.stepping.progress, *call, silent=True)

    def of_lanes(self, lanes: Lanes) -> Any:
        """A copy with the lanes of another system of the same layout, and free memory of its own."""
        stepping = self.stepping.of_system(lanes.arguments[1]) if self.sampled else lanes.stepping
        return like(self, free=[], lanes=lanes, stepping=stepping, constants=lanes.constants)

    def native(self) -> Kernel | None:
        """The native code that says what the formulas say now, made for samples if asked for often; or None."""
        return self.stepping.used(self.lanes.stepping.native is not None) if self.sampled else self.stepping.refresh()

    def room(self, times: np.ndarray | None, limit: int) -> Any:
        """Memory, and the call that fills it with the rows of steps, or with samples at these times."""
        count = 1 if times is None else len(times)
        size = self.turns * self.row if times is None else count * self.lanes.state.width
        memory = np.empty((self.out if times is None else self.samples) + size)
        *parts, place = self.where(memory)
        if times is None:
            turns, buffers = self.turns, (*parts, (place + 8 * self.out, size))
        else:
            turns, samples = limit, ((address(times), count), (place + 8 * self.samples, size))
            buffers = *parts, (place + 8 * self.out, self.row), *samples, (place + 8 * self.kept, SAMPLES.width)
        at = [begin for begin, _ in buffers]
        return memory, self.call(1, 0, 1, turns, count, *at, self.constants), buffers

    def run(
        self, native: Kernel, way: Any, start: Any, t0: float, t_end: float, limit: int, times: np.ndarray | None
    ) -> _AdaptiveRun | None:
        """Run from a start to t_end in one native call; None if that did not come to its end."""
        limit = min(limit, self.limit)
        try:
            room = self.free.pop() if self.free else self.room(times, limit)
        except IndexError:  # another thread has taken it
            room = self.room(times, limit)
        memory, block, buffers = room
        numbers = self.gather(start)
        clock = t0, way.first(t0, t_end), *FRESH
        goal = t_end, way.rtol, way.atol, way.longest, limit, 0.0
        first = (t0, *numbers, *self.no_way) if times is None else ()
        self.write_start(memory, 0, *numbers, *self.unknown, *clock, *goal, *first)
        native.on_memory(block, buffers)
        end_clock = CLOCKS.unpack_from(memory, 8 * self.clock)
        arrived = end_clock[TIME] == t_end and (times is None or memory.item(self.kept) == len(times))
        if times is None:
            memory = memory[: self.out + self.row * int(end_clock[TAKEN])].copy() if arrived else memory
            self.free.append(room)
        return _AdaptiveRun(self, way, end_clock, memory, times) if arrived else None


class _AdaptiveRun:
    """The memory that a run with adaptive steps has written: what is carried along, the clock, the goal, and what is
    kept.  times : of samples that were asked for.
    """

    __slots__ = ("clock", "memory", "places", "times", "way")

    def __init__(self, places: Any, way: Any, clock: Any, memory: np.ndarray, times: np.ndarray | None) -> None:
        self.places, self.way, self.clock, self.memory, self.times = places, way, clock, memory, times

    @property
    def rows(self) -> np.ndarray:
        """Rows of the start and of every step, (n, width), views of the memory."""
        return self.memory[self.places.kept :].reshape(-1, self.places.row)

    def t(self) -> np.ndarray:
        """Times of the samples as they were asked for, or of the ends of the steps, (n,)."""
        return self.rows[:, 0] if self.times is None else self.times

    def states(self) -> dict[str, np.ndarray]:
        """The samples, views of what the steps have written."""
        places, state = self.places, self.places.lanes.state
        if self.times is None:
            return unpacked(state, self.rows[:, 1 : 1 + state.width])
        return unpacked(state, self.memory[places.samples :].reshape(len(self.times), -1))

    def dense(self) -> DenseOutput | None:
        """The dense output, if rows have the coefficients between the steps; else None."""
        steps, lanes = self.way, self.places.lanes
        if self.times is not None or not lanes.arguments[2].curves:
            return None
        method = steps.method
        motion = self.rows, method.dense_order, steps.compiled
        return DenseOutput(steps.system, method.retraction, lanes.example, *motion)

    def carry(self) -> Carry:
        """The carry at the end of the last step."""
        numbers = self.memory[: self.places.carried].copy()
        last = numbers[: self.places.lanes.state.width]
        carry = Carry.made(None, None, numbers, np.array(self.clock), last)
        vars(carry)["state"] = build(self.places.lanes.state, iter(last.tolist()))
        return carry


def short(
    way: Any, layout: Any, start: Any, t0: float, t_end: float, times: np.ndarray | None, limit: int
) -> Trajectory | None:
    """The run with adaptive steps of one body, if it is one of a few native steps; None if there is no
    native code yet, or more to do.

    layout : of the start, as it is given.
    """
    if t0 == t_end or (times is not None and not len(times)):
        return None
    curves = way.dense is not False if times is None else between(times, t0, t_end)
    key = layout, curves, times is not None, "short"
    places = way.shapes.get(key)
    if places is None:
        lanes = way.shapes.get((layout, curves, False))
        if lanes is None:
            return None
        places = way.shapes[key] = AdaptivePlaces(lanes, times is not None)
    native = places.native()
    if native is None:
        return None
    promises = places.run(native, way, start, t0, t_end, limit, times)
    if promises is None:
        return None
    t, _, _, steps, rejected, _, _ = promises.clock
    h = (t - t0) / max(1.0, steps)
    return of_short(promises, way, h, None, int(steps), {"rejected": int(rejected)})


def between(times: np.ndarray, t0: float, t_end: float) -> bool:
    """Whether sorted times have others among them than t0 and t_end."""
    count, n = len(times), 0
    while n < count and times.item(n) == t0:
        n += 1
    return n < count and times.item(n) != t_end


# ------------------------------------------------------------------ which runs are short


def short_run(plan: Any, start: Any, steps: Any, t_end: Any, t0: Any, t_eval: Any) -> Trajectory | None:
    """A run that has nothing to do but to step, of a start that is laid out as one before;
    None for all others, and for what is to be refused.
    """
    key, prepared = known(plan, start), plan._steps
    if key is None:
        written = plan._one._written_out(start)
        key = None if written is start else known(plan, written)
        start = written
    if key is None or type(t0) is not float or not math.isfinite(t0):
        return None
    layout, side = key
    if plan.adaptive:
        if side or t_end is None:
            return None
        limit = arguments.MOST if steps is None else arguments.count(steps, "steps", 1)
        end = arguments.real(t_end, "t_end")
        times = arguments.times(t_eval, t0, end)
        if not (prepared.smooth or not prepared.jumps(t0, end)) or (prepared.dense and times is not None):
            return None
        run = short(prepared, layout, start, t0, end, times, limit)
        if run is not None and plan.options.atol is None:
            arguments.large_enough(restricted(start, layout))
        return run
    shape, of_each = prepared.shapes.get(key), side and t_end is not None
    if shape is None or t_eval is not None or (of_each and arguments.axes(t_end, "t_end")):
        return None
    count = plan._count(steps, t_end, t0)
    if plan._doubt(start if side else restricted(start, layout)):
        return None
    if side:
        return short_steps_of_many(prepared, shape, start, count, t0)
    return short_steps(prepared, shape, start, count, t0)
