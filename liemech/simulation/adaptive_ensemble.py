"""Ensembles with adaptive steps: bodies side by side in the lanes of native code, each with its own
step and its own end.  Lanes whose bodies have come to their end take the next ones.
"""

from __future__ import annotations

import functools
import os
import time
from contextlib import nullcontext
from typing import Any

import numpy as np

from ..compiler import kernel
from ..compiler.driver import accepted, itself
from ..compiler.interrupts import in_threads
from ..errors import IntegrationFailure, IntegrationInterrupted, NotCompilable, is_mistake
from ..formulas.pytree import build, layout_of
from ..integrators.ending_at_jumps import jumps_between
from ..systems.system import State
from ..systems.tabulated import has_inputs
from . import arguments
from .adaptive import (
    ANEW,
    ASKED,
    CLOCK,
    FRESH,
    MARK,
    REJECTED,
    STEP,
    STUCK,
    TAKEN,
    TIME,
    adaptive_lanes,
    adaptive_steps,
    go_on,
)
from .adaptive_run import AdaptiveRun, Laid, cut, stretches, velocity, watched
from .carry import AdaptiveCarry, Carries, Ended, Waiting
from .dense import DenseOutput, flat, packed, unpacked
from .events import NativeEvents, Unseen, Watch, Watches, unseen
from .execution import Execution, numbers_of
from .fixed_run import PATIENCE, pool
from .one_by_one import OneByOne, of_bodies
from .progress import Bar
from .stopped import Stopped
from .systems import OfBodies
from .trajectory import Trajectory

ROOM = 1024
"""Bodies of a thread whose numbers stay in the cache."""

TURNS, LONGEST, WORK = 8, 256, 2**13
"""Trials of a body between two looks at who has come to the end: at least and at most, and of all
bodies together.
"""

ROWS = 2**17
"""Samples inside of steps whose states are found at once."""

FEW = 8
"""Times that are compared one after another, and not looked for body after body."""

TRIALS = 2**10
"""Trials of all bodies together that are worth a thread."""


class Lanes(Laid):
    """The layouts of bodies side by side, and the code that makes their steps.

    own : numbers of systems and methods of which every body has its own.  Others as in `Shape`.
    """

    def __init__(self, plan: Any, example: State, xi: Any, curves: bool) -> None:
        method, system = plan.method, plan.system
        self.lay_out(method, example, xi, curves)
        self.own: list[np.ndarray] = []
        self.constants, things = b"", []
        for thing in (method, system):
            if isinstance(thing, OfBodies):
                things.append(kernel.Several.of(thing.members, len(thing)))
                self.own.append(things[-1].columns)
            else:
                things.append(thing)
                self.constants += numbers_of(thing)
        self.arguments = things[0], things[1], self.layout, self.row
        none = np.empty(0)
        call = adaptive_lanes, *self.arguments, curves, 1, none, none, none, none
        asked, progress = plan._given["compiled"], plan._given["progress"]
        self.stepping = Execution(asked, progress, *call, lanes=kernel.width(), silent=True)


class AdaptiveEnsemble(OneByOne):
    """A run of an ensemble with adaptive steps: one body after another in plain Python until native
    code pays, the others side by side.

    first : the body from which on they are.
    table : a column for each body: state and velocity, `numbers`; below these what the controller
    carries along, `clocks`; where they are to go, `goals`; parameters of their own.  parts : where
    these begin.
    samples : (n, bodies, width) the states at the times that are asked for.  told : how many of
    these each has reached.
    """

    first: int | None = None
    watches: Watches | None = None
    alone = False
    """Must every body run alone, because native code cannot look at the events?"""

    @staticmethod
    def fits(plan: Any) -> bool:
        """May there be native code?"""
        return plan._given["compiled"] is not False and kernel.available() is None

    def _check(self) -> None:
        """Refuse what a body cannot be asked for; plans of single bodies are made if needed."""
        own, given = self.plan.of_each, self.plan._given
        tolerance, count = arguments.tolerance, self.count
        checked = {
            "rtol": lambda x: tolerance(x, "rtol", arguments.RTOL),
            "atol": lambda x: tolerance(x, "atol", arguments.ATOL),
            "max_step": arguments.longest,
            "h": lambda h: 0.0 if h is None else arguments.step(h),
        }
        numbers = {}
        for name, check in checked.items():
            values = of_bodies(check, own[name]) if name in own else check(given[name])
            numbers[name] = np.broadcast_to(np.array(values, dtype=float), count)
        limit = self._steps
        limit = arguments.MOST if limit is None else arguments.count(limit, "steps", 1)
        self.limit = limit
        self.t0 = self._times_of_starts()
        end = self.t_end = np.array(self.ends, dtype=float)
        self.goals = np.array(
            [end, numbers["rtol"], numbers["atol"], numbers["max_step"], np.full(count, limit)]
        )
        self.first_steps = np.copysign(numbers["h"], end - self.t0)
        self.asked = self._all_times(end)

    def _times_of_starts(self) -> np.ndarray:
        if isinstance(self._start, Carries):
            return np.array([one.t for one in self._start.members])
        return np.full(self.count, self._t0)

    def _all_times(self, end: np.ndarray) -> np.ndarray:
        """When samples are asked for, (n, bodies)."""
        if self._t_eval is None:
            return np.array([self.t0, end])
        shared = arguments.axes(self._t_eval, "t_eval") == 1
        if shared and (self.t0 == self.t0[0]).all() and (end == end[0]).all():
            times: Any = self.times_of(0)
            return np.broadcast_to(times[:, None], (len(times), self.count))
        return np.stack([self.times_of(i) for i in range(self.count)], axis=1)  # type: ignore[misc]

    # ---------------------------------------------------------------- one body, as far as needed

    @functools.cached_property
    def lanes(self) -> Lanes | None:
        """The code for bodies side by side; None if no body can begin, or if it is refused."""
        inside = (self.asked != self.t0) & (self.asked != self.t_end)
        dense, steps = bool(inside.any() or self.plan.events), self.plan._steps
        for i in range(self.count):
            begun = self.begun(i)
            system, _ = self._of_body(i)
            xi = velocity(system, begun.t, begun.state)
            if isinstance(begun, Ended) or not accepted(xi, itself):
                continue
            key = "side by side", layout_of(begun.state), dense
            shape = None if self.plan.of_each else steps.shapes.get(key)
            try:
                if shape is None:
                    shape = Lanes(self.plan, begun.state, xi, dense)
                    if not self.plan.of_each:
                        steps.shapes[key] = shape
                else:
                    shape.stepping.refresh()
            except NotCompilable:
                return None
            return shape
        return None

    def _of_body(self, i: int) -> tuple[Any, Any]:
        system, method = self.plan.system, self.plan.method
        return (
            system[i] if isinstance(system, OfBodies) else system,
            method[i] if isinstance(method, OfBodies) else method,
        )

    def _run(self, i: int) -> Trajectory:
        with nullcontext() if self.lanes is None else self.lanes.stepping.plain():
            return super()._run(i)

    # ---------------------------------------------------------------- side by side

    def _side_by_side(self, first: int, bar: Bar) -> bool:
        try:
            if self.alone or self.lanes is None or not self._ready(first / self.count):
                return False
            self._begin()
            self._watch()
        except KeyboardInterrupt:
            raise self._interrupted(first) from None
        except Unseen:
            self.alone = True
            return False
        self.first = first
        try:
            self._march(bar)
            self._move()
        except Unseen:
            self.first, self.alone = None, True
            return False
        except KeyboardInterrupt:
            left = int((self._unfinished & ~self._failed).sum())
            told = f"integrate: interrupted before {left} of {self.count} bodies came to the end"
            self._move()
            for i, watch in ({} if self.watches is None else self.watches.each).items():
                end, goal = float(self.clocks[TIME, i]), float(self.goals[0, i])
                watch.forget(end, self.t_end[i] - self.t0[i], end == goal)
            stopped = IntegrationInterrupted(f"{told}; the samples are in `.trajectory`")
            stopped.trajectory = self.joined()
            raise stopped from None
        if self.mistaken:
            error = self._error(min(self.mistaken))
            error.add_note(f"[integrate: body {min(self.mistaken)}]")
            error.trajectory = self.joined()
            raise error
        return True

    def _ready(self, done: float) -> bool:
        """Is there native code, of the steps and of all events?"""
        lanes: Any = self.lanes
        ready = lanes.stepping.ready(done)
        return (not self.plan.events or self._native_events().ready()) and ready

    def _native_events(self) -> NativeEvents:
        lanes: Any = self.lanes
        system, method = self._of_body(0)
        rows, wanted = np.zeros((1, lanes.row.width)), self.plan._given["compiled"]
        return NativeEvents(
            self.plan.events,
            DenseOutput(system, method.retraction, lanes.example, rows, method.dense_order, wanted),
        )

    def _watch(self) -> None:
        """Begin to watch the events of all bodies."""
        if self.plan.events:
            self.watches = Watches(self._native_events(), self.count)
            for i in np.flatnonzero(~self.over).tolist():
                begun = self.begun(i)
                watch = watched(self.plan.events, unseen, begun.t, begun, begun.state)
                self.watches.add(i, watch)

    def _begin(self) -> None:
        """Lay down where all bodies stand."""
        lanes: Any = self.lanes
        count, width = self.count, lanes.state.width
        parts = [np.zeros((lanes.layout.width, count)), np.zeros((CLOCK.width, count))]
        parts += [self.goals, *lanes.own]
        self.table = np.concatenate(parts)
        self.parts = np.cumsum([len(part) for part in parts[:-1]])
        self.numbers, self.clocks, self.goals, *_ = np.split(self.table, self.parts)
        self.over = np.zeros(count, dtype=bool)  # bodies that had ended before
        self.mistaken: list[int] = []  # bodies that a mistake in a formula has ended
        # rows of samples inside of steps, of which the states are still to be found
        self.within: list[Any] = []
        self.rows = 0
        if isinstance(self._start, State):
            at = 0
            for part in self._start.arrays.values():
                rows = flat({"": part}, count)
                self.numbers[at : at + rows.shape[1]] = rows.T
                at += rows.shape[1]
            self._fresh(slice(None))
        else:
            for i in range(count):
                self._take_up(i, self.begun(i))
        self.rows_at = self.t0.copy()  # when the last row of each was
        self.left: dict[
            int, list[tuple[float, float]]
        ] = {}  # where each is to go on, last ones first
        if self.plan._steps.breaks or has_inputs(self._of_body(0)[0]):
            for i in range(count):
                start, ways = stretches(self._jumps(i), self.t0[i], self.ends[i])
                self.left[i] = ways[::-1]
                if ways:
                    self.goals[0, i] = ways[0][0]
                if start != self.t0[i]:
                    go_on(self.clocks[:, i], start)
        for i in np.flatnonzero((self.t_end == self.t0) & ~self.over).tolist():  # no steps to make
            begun, (system, _) = self.begun(i), self._of_body(i)
            if not accepted(velocity(system, begun.t, begun.state), itself):
                self.clocks[MARK, i] = STUCK
        self.samples = np.empty((len(self.asked), count, width))
        at_start = self.asked == self.t0
        self.told = np.logical_and.accumulate(at_start, axis=0).sum(axis=0)  # the first ones
        self.samples[:] = np.where(at_start[..., None], self.numbers[:width].T, 0.0)

    def _jumps(self, i: int) -> tuple[float, ...]:
        """The times at which the velocity of a body jumps."""
        system, method = self._of_body(i)
        end = float(self.ends[i])
        return jumps_between(method, system, self.plan._steps.breaks, float(self.t0[i]), end)

    def _fresh(self, some: Any) -> None:
        """Bodies at their starts."""
        self.clocks[:, some] = np.array([0.0, 0.0, *FRESH])[:, None]
        self.clocks[TIME, some], self.clocks[STEP, some] = self.t0[some], self.first_steps[some]

    def _take_up(self, i: int, begun: Any) -> None:
        """A body where another run left it."""
        if isinstance(begun, AdaptiveCarry):
            self.numbers[:, i], self.clocks[:, i] = begun.taken_up(
                float(self.t_end[i]), len(self.numbers)
            )
            return
        lanes: Any = self.lanes
        self.numbers[: lanes.state.width, i] = packed(begun.state)
        self._fresh(slice(i, i + 1))
        self.over[i] = isinstance(begun, Ended)

    @property
    def _unfinished(self) -> np.ndarray:
        """Which bodies are not at the end?"""
        alone: Any = self.first
        left = ((self.clocks[TIME] != self.goals[0]) | (self.clocks[MARK] == STUCK)) & ~self.over
        left[:alone] = False
        return left

    @property
    def _failed(self) -> np.ndarray:
        """Which bodies go no further, though they are not at the end?"""
        return self._unfinished & self._ended(self.table[self.parts[0] :])

    def _march(self, bar: Bar) -> None:
        """Trials of as many bodies as the lanes hold, again and again, until all have ended."""
        lanes: Any = self.lanes
        side, workers, kept = lanes.stepping.lanes, self.plan._given["workers"], self.kept
        width, clock = lanes.state.width, lanes.layout.width
        changed = clock + CLOCK.width + 1  # with the time to which they go
        room, least, work = ROOM * workers, TURNS, WORK * workers
        queue = np.flatnonzero(self._unfinished)
        bodies, queue = queue[:room], queue[room:]
        columns = self.table.take(_padded(bodies, side), axis=1)
        while len(bodies):
            m, padded = len(bodies), columns.shape[1]
            turns = max(least, min(LONGEST, work // padded))
            if kept is not None:
                turns = max(1, min(turns, kept.within(turns * m) // m))
            out = np.empty((turns + 1 if lanes.curves else 0, lanes.row.width, padded))
            if lanes.curves:
                out[:, 0] = columns[clock + TIME]
                out[0, 1 : 1 + width] = columns[:width]
            begun, taken = time.perf_counter(), columns[clock + TAKEN, :m].sum()
            self._piece(columns, out[1:], turns)
            for k in np.flatnonzero(columns[clock + MARK, :m] == ASKED).tolist():
                self._by_python(int(bodies[k]), columns[:, k], out[-2:, :, k])
            if time.perf_counter() - begun > PATIENCE:  # somebody may want to interrupt it
                room, least, work = max(side, room // 4), max(1, least // 2), work // 4
            if self.left and lanes.curves:
                self._rows_begin(bodies, out[:, 0, :m])
            if self.watches:
                self._look(bodies, columns, out[:, :, :m])
            if lanes.curves:
                self._sample(bodies, out[:, :, :m])
            if self.left:
                self._go_on(bodies, columns)
            # only now: of what an interrupt leaves out, the samples would be missing
            self.table[:changed, bodies] = columns[:changed, :m]
            if self.rows > ROWS:
                self._move()
            if kept is not None and kept.due(int(columns[clock + TAKEN, :m].sum() - taken)):
                self._move()
                kept.save(self.joined())
            going = ~self._ended(columns[clock:, :m])
            ended = m - int(going.sum())
            at_once = len(queue) or self.watches or self.left  # what stands at a jump is to stay so
            if (ended and (at_once or 4 * ended >= m)) or m > room:
                bodies = bodies[going]
                queue = np.concatenate([bodies[room:], queue]) if len(bodies) > room else queue
                free = max(0, room - len(bodies))
                bodies, queue = np.concatenate([bodies[:room], queue[:free]]), queue[free:]
                columns = self.table.take(_padded(bodies, side), axis=1)
                bar.advance(ended)

    def _signs(self, bodies: np.ndarray) -> np.ndarray:
        """1 of bodies that go forwards in time, -1 of others."""
        return np.where(self.t_end[bodies] >= self.t0[bodies], 1.0, -1.0)

    def _times_after(self, bodies: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The times that were reached after each trial, of which only those of steps are written."""
        sign = self._signs(bodies)
        return sign * np.maximum.accumulate(sign * t, axis=0)

    def _rows_begin(self, bodies: np.ndarray, t: np.ndarray) -> None:
        """Let rows begin where the last ones ended, before a jump, as in a run of one body.

        t : (turns + 1, bodies) the times of the last trials, of which not all are written.
        """
        reached = self._times_after(bodies, t)
        for k in np.flatnonzero(reached[0] != self.rows_at[bodies]).tolist():
            t[t[:, k] == t[0, k], k] = self.rows_at[bodies[k]]
        moved = reached[-1] != reached[0]
        self.rows_at[bodies[moved]] = reached[-1, moved]

    def _go_on(self, bodies: np.ndarray, columns: np.ndarray) -> None:
        """Of bodies that have come to a jump of the velocity: on beyond it, to the next one."""
        lanes: Any = self.lanes
        clock = lanes.layout.width
        goal = clock + CLOCK.width
        for k in np.flatnonzero(
            columns[clock + TIME, : len(bodies)] == columns[goal, : len(bodies)]
        ).tolist():
            body = int(bodies[k])
            ways = self.left[body]
            if not ways or self._watch_of(body).ended is not None:
                continue
            end, beyond = ways.pop()
            if end != beyond:
                go_on(columns[clock:goal, k], beyond)
                columns[goal, k] = ways[-1][0] if ways else self.t_end[body]
                if beyond == self.t_end[body]:
                    self.rows_at[body] = beyond

    # ---------------------------------------------------------------- events

    def _watch_of(self, i: int) -> Any:
        return UNWATCHED if self.watches is None else self.watches.each.get(i, UNWATCHED)

    def _look(self, bodies: np.ndarray, columns: np.ndarray, out: np.ndarray) -> None:
        """Look for events in the last trials; a terminal one ends the run of its body there, and
        what came after it does not count.  out : as of `_sample`.
        """
        width, watches = self.lanes.state.width, self.watches  # type: ignore[union-attr]
        t = self._times_after(bodies, out[:, 0])
        column, turn = np.nonzero((t[1:] != t[:-1]).T)  # the steps, body after body
        if watches is None or not len(turn):
            return
        a, b, body = t[turn, column], t[turn + 1, column], bodies[column]

        def where(step: np.ndarray, times: np.ndarray) -> np.ndarray:
            found = out[turn[step] + 1, 1 : 1 + width, column[step]]
            before = times == a[step]
            found[before] = out[turn[step[before]], 1 : 1 + width, column[step[before]]]
            inside = np.flatnonzero((times != b[step]) & ~before)
            some = step[inside]
            given = np.empty((len(some), out.shape[1]))
            given[:, :width] = out[turn[some], 1 : 1 + width, column[some]]
            given[:, width:-1] = out[turn[some] + 1, 1 + width :, column[some]]
            given[:, -1] = (times[inside] - a[some]) / (b[some] - a[some])
            if len(some):
                found[inside] = self._moved(given, times[inside], body[some])
            return found

        points = out[turn + 1, 1 : 1 + width, column]
        for step, at, numbers in watches.look(body, points, a, b, where).values():
            k = int(column[step])
            taken = int((column[: step + 1] == k).sum())
            own = int(body[step]), columns[:, k], out[:, :, k]
            self._end_at(*own, int(turn[step]), taken, at, numbers)

    def _end_at(
        self, body: int, column: np.ndarray, rows: np.ndarray, turn: int, taken: int, at: float,
        numbers: np.ndarray,
    ) -> None:  # fmt: skip
        """End the run of a body inside of a step: the one of this trial, after so many in these
        trials.
        """
        lanes: Any = self.lanes
        width, clock = lanes.state.width, lanes.layout.width
        cut(rows[turn + 1], rows.item(turn, 0), at, numbers, self._of_body(0)[0].group.dim)
        rows[turn + 1 :, 0], column[:width] = at, numbers
        steps, rejected = self.clocks[[TAKEN, REJECTED], body]
        rejected = min(column[clock + REJECTED], rejected + turn + 1 - taken)
        column[clock : clock + CLOCK.width] = at, 0.0, 0.0, steps + taken, rejected, 0.0, 1.0
        column[clock + CLOCK.width] = self.rows_at[body] = at

    def _ended(self, rows: np.ndarray) -> np.ndarray:
        """Which bodies have come to the end, or fail?  rows : clocks, and goals below them."""
        return (
            (rows[TIME] == rows[CLOCK.width])  # the time is the last one
            | (rows[MARK] > 0.0)
            | (rows[TAKEN] >= self.limit)
        )

    def _piece(self, columns: np.ndarray, out: np.ndarray, turns: int) -> None:
        """So many trials of the bodies in these columns, perhaps in threads."""
        lanes: Any = self.lanes
        side, workers = lanes.stepping.lanes, self.plan._given["workers"]
        padded = columns.shape[1]
        numbers, clocks, goals, *own = np.split(columns, self.parts)
        arrays = *own, goals, numbers, clocks, out
        run = lanes.stepping.native.run
        call = functools.partial(run, lanes.constants, (turns,), arrays, padded)
        threads = max(1, min(workers, padded * turns // TRIALS, padded // side))
        share = -(-padded // (threads * side)) * side
        # native code does not hold the interpreter's lock
        works = [
            functools.partial(call, i, min(i + share, padded)) for i in range(0, padded, share)
        ]
        in_threads(works, pool(workers, os.getpid()) if len(works) > 1 else None)

    def _by_python(self, i: int, column: np.ndarray, rows: np.ndarray) -> None:
        """A step of one body of which native code could not make a trial.  rows : before and after
        it.
        """
        lanes: Any = self.lanes
        system, method = self._of_body(i)
        width, changed = lanes.layout.width, lanes.layout.width + CLOCK.width
        numbers, clock, row = column[:width].copy(), column[width:changed].copy(), lanes.row.width
        taken, before, after = (
            clock[TAKEN],
            (clock[TIME], *numbers[: lanes.state.width]),
            np.empty(row),
        )
        t_end, rtol, atol, longest, _ = self.goals[:, i].tolist()
        failures: list[Exception] = []
        with lanes.stepping.plain():
            adaptive_steps(
                method, system, lanes.layout, lanes.row, t_end, rtol, atol, longest, lanes.curves, 1,
                numbers, clock, after, failures,
            )  # fmt: skip
        if any(map(is_mistake, failures)):
            self.mistaken.append(i)
        column[:width], column[width:changed] = numbers, clock
        if lanes.curves and clock[TAKEN] > taken:
            rows[0, : len(before)], rows[1] = before, after

    # ---------------------------------------------------------------- samples

    def _sample(self, bodies: np.ndarray, out: np.ndarray) -> None:
        """Keep the states that are asked for in the last trials: rows of time, state, and the way
        there, (turns + 1, width, bodies); the first is that before.
        """
        lanes: Any = self.lanes
        width, before = lanes.state.width, self.told[bodies]
        reached = self._passed(bodies, out[1:, 0])
        reached = np.maximum.accumulate(np.concatenate([before[None], reached]), axis=0)
        new = np.diff(reached, axis=0)
        turn, column = new.nonzero()
        if not len(turn):
            return
        many = new[turn, column]
        place = np.arange(many.sum()) - np.repeat(many.cumsum() - many, many)
        turn, column = turn.repeat(many), column.repeat(many)
        sample, body = reached[turn, column] + place, bodies[column]
        times, t = self.asked[sample, body], out[turn + 1, 0, column]
        numbers = out[turn + 1, 1 : 1 + width, column]
        inside = np.flatnonzero(times != t)
        if len(inside):
            turn, column = turn[inside], column[inside]
            self.rows += len(inside)
            begun = out[turn, 0, column]
            given = np.empty((len(inside), lanes.row.width))
            given[:, :width] = out[turn, 1 : 1 + width, column]
            given[:, width:-1] = out[turn + 1, 1 + width :, column]
            given[:, -1] = (times[inside] - begun) / (t[inside] - begun)
            self.within.append((given, times[inside], sample[inside], body[inside]))
        self.samples[sample, body] = numbers
        self.told[bodies] = reached[-1]

    def _move(self) -> None:
        """Find the states inside of steps that were asked for."""
        if self.within:
            given, times, sample, body = map(np.concatenate, zip(*self.within, strict=True))
            self.samples[sample, body] = self._moved(given, times, body)
            self.within, self.rows = [], 0

    def _passed(self, bodies: np.ndarray, t: np.ndarray) -> np.ndarray:
        """How many of the times that are asked for lie before these, (turns, bodies)?"""
        sign = self._signs(bodies)
        if self.asked.strides[1] == 0:  # all are asked for at the same
            return np.searchsorted(sign[0] * self.asked[:, 0], sign[0] * t, "right")
        found = np.zeros(t.shape, dtype=np.intp)
        if len(self.asked) <= FEW:
            for asked in self.asked:
                found += sign * asked[bodies] <= sign * t
            return found
        for i, body in enumerate(bodies):
            found[:, i] = np.searchsorted(sign[i] * self.asked[:, body], sign[i] * t[:, i], "right")
        return found

    def _moved(self, given: np.ndarray, times: np.ndarray, body: np.ndarray) -> np.ndarray:
        """States inside of steps, from the rows of the dense output."""
        lanes: Any = self.lanes
        compiled = self.plan._given["compiled"]
        several = isinstance(self.plan.system, OfBodies) or isinstance(self.plan.method, OfBodies)
        if not several:
            groups: list[Any] = [slice(None)]
        else:
            order = np.argsort(body, kind="stable")
            groups = np.split(order, np.flatnonzero(np.diff(body[order])) + 1)
        found = np.empty((len(given), lanes.state.width))
        for some in groups:
            system, method = self._of_body(int(body[some][0]))
            dense = DenseOutput(
                system, method.retraction, lanes.example, given[:0], method.dense_order, compiled
            )
            found[some] = dense.along(given[some], times[some])
        return found

    # ---------------------------------------------------------------- all of them as one

    def _error(self, i: int) -> Any:
        """Why a body stopped: what its next step fails of in plain Python."""
        if i in self.errors:
            return self.errors[i]
        begun, t0 = self.begun(i), float(self.t0[i])
        start = begun.state if isinstance(begun, Waiting) else begun
        try:
            run = AdaptiveRun(
                self.plan_of(i)._steps, start, t0, self.ends[i], self.limit, self.times_of(i), ()
            )
        except Exception as error:  # it has no velocity at the start
            if isinstance(error, IntegrationFailure) or is_mistake(error):
                return error
            raise
        return run.failed(
            self.numbers[:, i].copy(), self.clocks[:, i].copy(), self.samples[: self.told[i], i]
        )

    def _all_runs(self, unfinished: Trajectory | None) -> list[Trajectory]:
        if self.first is None:
            return super()._all_runs(unfinished)
        return [*self.runs, *map(self._run_of, range(self.first, self.count))]

    def _run_of(self, i: int) -> Trajectory:
        """The run of one of those that step side by side, as it would be alone."""
        lanes: Any = self.lanes
        told, carry, reached = self.told[i], self._member(i), float(self.clocks[TIME, i])
        if isinstance(carry, Waiting) or self.over[i]:
            return self._still(i, self.begun(i))
        steps, rejected = self.clocks[[TAKEN, REJECTED], i].astype(int).tolist()
        if isinstance(carry, Ended) and carry.error is not None:
            self.errors[i] = carry.error
        system, method = self._of_body(i)
        return Trajectory(
            system, method, (reached - float(self.t0[i])) / max(1, steps), self.asked[:told, i].copy(),
            unpacked(lanes.state, self.samples[:told, i].copy()), None, steps, True,
            rejected=rejected, events=self._watch_of(i).shown(lanes.example, lanes.state),
            carry=None if isinstance(carry, Ended) else carry,
        )  # fmt: skip

    def joined(self, unfinished: Trajectory | None = None) -> Trajectory:
        if self.first is None or self.watches is not None:
            return super().joined(unfinished)
        lanes: Any = self.lanes
        alone, width = self.first, lanes.state.width
        final, t = self.numbers[:width].T, np.array(self.asked)
        left = np.arange(len(t))[:, None] >= self.told
        np.copyto(self.samples, final, where=left[..., None])
        failed, unfinished_ones = self._failed, self._unfinished
        standing = unfinished_ones & ~failed  # it was interrupted
        np.copyto(t, self.clocks[TIME], where=left & standing)
        for i in np.flatnonzero(self.over).tolist():
            self.samples[:, i] = final[i]
            begun: Ended = self.begun(i)
            if begun.error is None or (len(t) and begun.t != t[0, i]):
                t[:, i] = begun.t
            if begun.error is not None:
                self.errors[i] = begun.error
        for i, run in enumerate(self.runs):
            way = self._filled(i, run, len(t), self._carried(i, run))
            t[:, i] = way.pop("")
            self.samples[:, i] = flat(way, len(t))
        steps, rejected = self.clocks[TAKEN].astype(int), self.clocks[REJECTED].astype(int)
        reached = self.clocks[TIME].copy()
        steps[self.over], rejected[self.over], reached[self.over] = 0, 0, self.t0[self.over]
        h = (reached - self.t0) / np.maximum(1, steps)
        for i, run in enumerate(self.runs):
            steps[i], rejected[i], h[i] = run.steps, run.rejected or 0, run.h
        stopped = {int(i): int(steps[i]) for i in np.flatnonzero(failed)}
        stopped |= {i: self._taken(i, self.runs[i]) for i in self.errors if i < alone}
        stopped |= {i: self.begun(i).steps for i in self.errors if i >= alone and self.over[i]}
        return self._shown(
            t,
            unpacked(lanes.state, self.samples),
            self._carries,
            h=float(np.mean(h)),
            steps=int(steps.max()),
            compiled=all(run.compiled for run in self.runs),
            stopped=Stopped(dict(sorted(stopped.items())), self._error),
            rejected=int(rejected.sum()),
        )

    def _carries(self) -> tuple[Any, ...]:
        """Where all bodies stand."""
        members: list[Any] = [self._carried(i, run) for i, run in enumerate(self.runs)]
        members += map(self._member, range(len(members), self.count))
        return tuple(members)

    def _member(self, i: int) -> Any:
        """Where one of those stands that step side by side."""
        lanes: Any = self.lanes
        begun, numbers, clock = self.begun(i), self.numbers[:, i].copy(), self.clocks[:, i].copy()
        t, steps = float(clock[TIME]), int(clock[TAKEN])
        fresh = clock[ANEW] > 0.0 and not steps and clock[MARK] == 0.0
        if self.over[i] or (isinstance(begun, Waiting) and fresh and t != self.t_end[i]):
            return begun
        state = build(lanes.state, iter(numbers[: lanes.state.width].tolist()))
        if self._failed[i]:
            return Ended(state, self.ends[i], steps, self._error(i))
        watch = self._watch_of(i)
        return AdaptiveCarry(numbers, clock, state, t, watch.ended, watch.met)


UNWATCHED = Watch((), lambda error: error, 0.0, None)
"""Of a body without events."""


def _padded(places: np.ndarray, side: int) -> np.ndarray:
    """Numbers of columns, the last one repeated for the lanes that are left over."""
    return np.concatenate([places, places[-1:].repeat(-len(places) % side)])
