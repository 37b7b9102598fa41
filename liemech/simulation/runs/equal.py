"""Runs with fixed steps: of bodies that all make the same steps, and of bodies with ends, times or events of their own."""

from __future__ import annotations

import functools
import os
import time
from typing import Any, ClassVar

import numpy as np

from ...compiler import kernel
from ...compiler.driver import Rejected, attempt, read, reason
from ...errors import IntegrationFailure, InvalidInput, InvalidType, failure, is_mistake
from ...formulas.classes.layouts import Layout, build, layout_of, leaves
from ...formulas.numbers.conversions import double_double, fitted
from ...formulas.sites import in_lines
from ...systems.system import State, member
from .. import arguments
from ..between.dense import MotionBetween, ShortSteps, lay_out
from ..compiled.control import (
    ASKED,
    GOAL,
    LAST_TIME,
    LIMIT,
    MARK,
    ORIGIN,
    STEP,
    STRAIGHT,
    STUCK,
    TAKEN,
    TIME,
    Equal,
    begun,
    sample,
)
from ..compiled.driver import begin
from ..compiled.execution import LOOK, like
from ..compiled.lanes import Lanes, share_out
from ..compiled.prepared import RunShape, shown_step, times
from ..keep import AtTimes, Straight
from ..result import of_start
from ..trajectory import Trajectory
from .carry import Carry, one_or_all
from .course import told
from .run import PATIENCE, Run

NEAR = 4 * np.finfo(float).eps
"""Times that differ by this part of them are one."""

PLAIN, NATIVE = 16, 2**17
"""Steps of all bodies together in the first piece of a run."""

SWEEP = 2**26
"""Steps of all bodies together, in native code, after which all bodies have come to the same time."""

WORTH = 2**15
"""Steps of all bodies together that are worth a thread."""

SAMPLES, STEPS = 2**16, 2**22
"""Samples and steps of all bodies together between two looks at functions of the state."""


class EqualRun(Run):
    """A run of fixed steps, in which each body goes to an end of its own, or to an event.

    h, zero : the step of every body, and the time of step 0.  aims : the goals, a column each.  unbegun : the bodies whose
    steps could not begin.
    """

    control: Any = Equal(True)
    shape: RunShape
    extra: Any = ()
    straight: ClassVar[bool] = False
    unbegun: Any = ()

    def aim(self, ends: list[Any], steps: Any) -> None:
        steps_of_plan, before = self.way, self.before
        self.h = np.array([steps_of_plan.h_of(i) for i in range(self.count)])
        self.zero = self.t0 if before is None else np.array(np.broadcast_to(before.t0, self.count))
        if before is not None:
            self.first = before.clock[TAKEN].reshape(-1).copy()
        self.aims = np.zeros((GOAL.width, self.count))
        self.aims[LAST_TIME], self.aims[ORIGIN] = np.copysign(np.inf, self.h), self.zero
        self.aims[LIMIT] = self.first
        for i in np.flatnonzero(~self.over).tolist():
            origin = float(self.zero[i]), int(self.first[i])
            try:
                self.aims[LIMIT, i] += arguments.fixed_steps(steps, ends[i], *origin, self.h.item(i))
            except Exception as error:
                if self.bodies:
                    error.add_note(f"[integrate: body {i}]")
                raise
        self.t_end, self.sign = self.aims[LAST_TIME], np.copysign(1.0, self.h)

    def last_times(self) -> np.ndarray:
        return self.zero + self.aims[LIMIT] * self.h

    # ---------------------------------------------------------------- the start

    def begin(self) -> None:
        count, before, shape = self.count, self.before, self._shape()
        self.shape, lanes = shape, self._lanes(shape)
        self.lanes, columns = lanes, shape.columns(count)
        self.table = in_lines(lanes.height, columns)
        numbers, clocks, goals, *parameters = lanes.parts(self.table[:, :count])
        for rows, values in zip(parameters, lanes.own, strict=True):
            rows[:] = values
        clocks[:], clocks[STEP], clocks[TAKEN] = 0.0, self.h, self.first
        clocks[TIME], goals[:] = self.zero + self.first * self.h, self.aims
        heads = self._heads(shape.shown.width, columns)
        if before is None:
            self.table[:, count:] = self.table[:, count - 1 : count]  # lanes that are left over
            self._begin(heads)
        else:
            before.put_down(numbers, heads[:, :count])
        clocks[MARK][self.over] = STUCK
        self._stand_at_start(clocks, heads[:, :count])

    def _heads(self, width: int, columns: int) -> np.ndarray:
        """Zeros for the first samples, (width, columns)."""
        return np.zeros((width, columns))

    def _stand_at_start(self, clocks: np.ndarray, heads: np.ndarray) -> None:
        """Set `here` to times and samples at the start."""
        self.here = np.concatenate([clocks[TIME, None], heads])
        self.here[0, self.over] = self.t0[self.over]

    @functools.cached_property
    def stepped(self) -> Any:
        """The states in which steps begin, as the method takes them."""
        return self.start if self.before is None else self.before.state

    def _member(self, i: int) -> Any:
        """The state in which the steps of one body begin."""
        return member(self.stepped, i)

    def _shape(self) -> RunShape:
        """The layouts of this run, from other runs of the plan if their starts were like this one."""
        steps, shape = self.way, getattr(self.before, "shape", None)
        if shape is not None and steps.owns(shape):
            return shape
        first_start = self._member(0)
        layout, side = layout_of(first_start), kernel.side_by_side(self.bodies)
        shape = steps.shapes.get((layout, side))
        if shape is None:
            remembering = steps.remembering(first_start)
            started = layout_of(remembering)
            first, example = self._first(remembering, started)
            shape = steps.shapes[layout, side] = RunShape(steps, layout, started, first, example, side)
        return shape

    def _lanes(self, shape: RunShape) -> Lanes:
        """Layouts and native code of steps."""
        native = self.compiled_asked is not False and kernel.available() is None
        side = shape.side if self.straight else kernel.width() if self.bodies and native else 1
        return shape.lanes_of(self.way, self.control, self.extra, side)

    def _first(self, first_start: State, started: Layout) -> tuple[Any, Any]:
        """The first memory of the method for the first body that can begin, and the sample that shows it."""
        for i in range(self.count):
            start = fitted(self._member(i), started) if i else first_start
            trial = attempt(begun, self.way.way_of(i), self.way.system_of(i), start, self.h.item(i))
            if not isinstance(trial, Rejected):
                carry, example = trial
                if not isinstance(example, State):
                    shown = type(self.plan.method).__name__
                    raise InvalidType(
                        f"{shown}.observe must return the state in what is carried along, as "
                        f"{shown}.start gives it; got {example!r:.90}"
                    )
                return double_double(carry) if started.has_double_doubles else carry, example
            self.failures[i] = [reason(trial)]
            if is_mistake(reason(trial)):
                break
        raise self._nobody()

    def _nobody(self) -> Any:
        """The error of a run in which no body can begin: a mistake in a formula, or a failure."""
        raised: list[Any] = [errors[-1] for errors in self.failures.values() if errors]
        error: Any = next((e for e in raised if is_mistake(e)), raised[0] if raised else None)
        none = f"none of the {self.count} bodies can begin; body 0: " if self.bodies else ""
        if not is_mistake(error):
            what = none + repr(self.plan.method)
            error = failure(error, what, f"at the start, {self.way.clock} = {self.zero[0]:g}")
        error.trajectory = of_start(self)
        return error

    def first_sample(self) -> dict[str, Any]:
        """The fields of a trajectory that has the start only."""
        t = times(self.zero.item(0), np.zeros(1), self.way.h)
        parts = self.stepped.parts.items()
        states = {name: np.array(x)[None] for name, x in parts if x is not None}
        return {"system": self.plan.system, "t": t, "states": states, "h": shown_step(self.way.h)}

    def _begin(self, heads: np.ndarray) -> None:
        """Compute the carry of the method at the start, for every body."""
        shape, lanes, count = self.shape, self.lanes, self.count
        numbers, clocks, *_ = lanes.parts(self.table)
        shown_as_given = shape.given == shape.shown
        starts = heads if shown_as_given else np.empty((shape.given.width, heads.shape[1]))
        self._lay_down(starts)
        if shape.order is not None:
            for number, place in zip(numbers, shape.order, strict=True):
                number[:] = starts[place] if place >= 0 else 0.0
            return
        execution = shape.beginning(self.way, lanes)
        native = execution.refresh() if self.bodies else execution.used(self.compiled_asked)
        execution = like(execution, native=native)
        stepping, stays = lanes.stepping, not (self.aims[LIMIT] > self.first).any()
        if not stays and stepping.native is not None and self.bodies:
            execution.compile()
        arrays = starts, clocks, numbers, heads

        def plainly(i: int) -> None:
            views, raised = [np.ascontiguousarray(x[:, i]) for x in arrays], []  # type: Any, list[Any]
            views[1][MARK] = 0.0
            with execution.plain():
                driver: Any = begin
                driver(*shape.beginner(lanes.of_body(i)), *views, raised)
            for rows, x in zip(arrays, views, strict=True):
                rows[:, i] = x
            if raised:
                self.failures[i] = raised

        column, side = 0, execution.lanes
        in_memory = shape.layout.in_memory and bool(self.bodies)
        while column < count and (in_memory or not execution.ready(column / count)):
            for i in range(column, min(column + side, count)):
                plainly(i)
            column += side
        if column < count:
            all_of_them = (*lanes.parts(self.table)[3:], *arrays)
            call = functools.partial(execution.run, lanes.constants, (), all_of_them, heads.shape[1])
            size, workers = NATIVE // side * side, self.plan.options.workers
            share_out(call, range(column, shape.whole(count)), side, size, (1, WORTH), workers)
            for i in np.flatnonzero(clocks[MARK, :count] == ASKED).tolist():
                plainly(i)
        stuck = clocks[MARK, :count] == STUCK
        self.unbegun = {*np.flatnonzero(stuck).tolist()}
        if stuck.all() or self._mistaken():
            raise self._nobody()
        numbers[:, :count][:, stuck] = 0.0
        if not stays and execution.native is not None and self.bodies:
            stepping.compile()

    def _mistaken(self) -> bool:
        """Whether a body has shown a mistake in a formula."""
        return any(is_mistake(e) for raised in self.failures.values() for e in raised)

    def _lay_down(self, columns: np.ndarray) -> None:
        """Write the numbers of the start, a column for each body; lanes that are left over repeat the last body."""
        if not self.bodies:
            columns[:, 0] = leaves(self.stepped, self.shape.given)
            return
        lay_out(self.stepped.arrays, columns)

    def observe(self) -> list[Any]:
        if self.asked is None or self.plan.events:
            return super().observe()
        return [AtTimes(self, at_steps(self.asked, self.zero, self.h), self.asked)]

    # ---------------------------------------------------------------- between steps

    @functools.cached_property
    def between(self) -> MotionBetween:
        method, system = self.lanes.arguments[:2]
        return ShortSteps(system, method, self.lanes.example, None, self.compiled_asked)

    def rest_of_step(self, body: int, column: np.ndarray, row: np.ndarray, end: float) -> np.ndarray | None:
        at, later = row.item(0), row
        if at != end:
            start = np.concatenate([row[None, 1:], [[at, end - at]]], axis=1)
            later = np.append(end, self.moved(start, np.array([end]), np.array([body]))[0])
        state = fitted(build(self.lanes.state, iter(later[1:].tolist())), self.shape.started)
        carry, _ = begun(self.way.way_of(body), self.way.system_of(body), state, self.h.item(body))
        column[: self.lanes.layout.width] = leaves(fitted(carry, self.lanes.layout), self.lanes.layout)
        return None if at == end else later

    # ---------------------------------------------------------------- what came of it

    def _stand_here(self) -> None:
        """Update `here`, where every body stands."""

    def known(self, i: int | None) -> dict[str, Any]:
        h = shown_step(self.way.h) if i is None else self.h.item(i)
        return {"h": h, "breaks": self.way.breaks}

    def standing(self, some: Any) -> Any:
        self._stand_here()
        zero, shape = (self.zero[some], self.shape if some == slice(None) or not self.bodies else None)
        zero = zero.item() if zero.ndim == 0 else one_or_all(zero)
        numbers, clock, last = (x[:, some].copy() for x in (self.numbers, self.clocks, self.here[1:]))
        clock[MARK] = 0.0
        bodies = None if isinstance(some, int) else self.count
        carry = Carry.made(shape, zero, numbers, clock, last, bodies, self.met(some))
        if bodies is None:
            vars(carry)["state"] = build(self.lanes.state, iter(last.tolist()))
        return carry

    def error(self, i: int) -> Any:
        error = (self.failures.get(i) or [None])[-1]
        count_samples = None if self.bodies else lambda: len(self.samples(i)[0])
        return self.explained(told(error, self.system_and_method(i)[1], self.place(i), count_samples), i, goes_on=False)

    def place(self, i: int) -> str:
        """The step that a body did not make, and the time from which."""
        step, clock = int(self.clocks[TAKEN, i]), self.way.clock
        if i in self.unbegun:
            return f"at the start, {clock} = {self.here[0, i]:g}"
        return f"step {step + 1} of {int(self.limit[i])}, {clock} = {self.here[0, i]:g}"


class StraightRun(EqualRun):
    """A run of fixed steps of all bodies to one end, without events: native code writes samples where they
    stay.

    done, steps : before this run, and of it.  reached : how many steps all bodies have come, if they did not stop.
    latest : the last samples.  stay : by body, the state in which it stays.  after, exact : of times that are asked for,
    the steps before each, and do they lead there?
    """

    control = STRAIGHT
    straight = True
    streams = property(lambda run: run.asked is None)

    def aim(self, ends: list[Any], steps: Any) -> None:
        before, count = self.before, self.count
        zero, steps_before = (self.t0.item(0), 0) if before is None else (before.t0, before.step)
        self.h = np.broadcast_to(np.array(self.way.h, dtype=float), count)
        self.steps = arguments.fixed_steps(steps, ends[0], zero, steps_before, self.way.h)
        self.done, self.reached, self.stood = steps_before, steps_before, (-1, -1.0)
        self.zero = np.broadcast_to(zero, count)
        if before is not None:
            self.first = before.clock[TAKEN].reshape(-1).copy()
        aims = np.inf, 0.0, 0.0, 0.0, float(steps_before + self.steps), zero
        self.aims = np.array(aims)[:, None]
        self.t_end, self.sign = np.broadcast_to(np.inf, count), np.copysign(1.0, self.h)

    def _times(self, t_eval: Any) -> np.ndarray | None:
        grid = super()._times(t_eval)
        return None if grid is None else grid[:, 0]

    def _heads(self, width: int, columns: int) -> np.ndarray:
        before, end, every = self.done, self.done + self.steps, self.way.every
        rows = len(self.asked) if self.asked is not None else self.steps // every
        room = rows + 2 if not (self.recorded and self.streams) else max(2, SAMPLES // columns)
        affordable(max(min(room, rows + 2) * width * columns, rows) * 8, self.steps, every)
        if self.asked is None:
            numbers = np.arange(before // every * every, end + every, every)
            numbers[0] = before
            numbers = np.minimum(numbers[: 1 + np.searchsorted(numbers, end)], end)
        else:
            self.after, self.exact = steps_before(self.asked, self.zero.item(0), self.h.item(0))
            numbers = np.unique(np.concatenate([[before], self.after, [end]]))
        room = min(room, len(numbers))
        self.kept_samples = Straight(self, numbers, in_lines(room, width, columns))
        self.latest = self.kept_samples.array[0]
        return self.latest

    def _stand_at_start(self, clocks: np.ndarray, heads: np.ndarray) -> None:
        stay = {*np.flatnonzero(self.over).tolist(), *self.unbegun}
        self.stay = {i: heads[:, i].copy() for i in stay}

    def observe(self) -> list[Any]:
        return [self.kept_samples]

    # ---------------------------------------------------------------- stepping

    @property
    def measure(self) -> tuple[int, str]:
        return self.steps * self.count, "step"

    @property
    def shown(self) -> int:
        return (self.reached - self.done) * self.count

    worth_saving = True
    settled = False  # is it known which code makes the steps?
    pace, looked = PLAIN, -1  # steps of all bodies in a piece; where functions were looked at

    def piece(self) -> int | None:
        """Make a sweep of all bodies, as long as there is something to show and somebody to interrupt."""
        samples, stepping = self.observers[0], self.lanes.stepping
        columns = self.shape.whole(self.count)
        if self.looked < 0:
            self._look()
        stands = not (self.bodies or self.reached == self.done or self.open.any())
        if stands or self.reached == self.done + self.steps or self._mistaken():
            self._look()
            return None
        native = stepping.native is not None
        if not self.settled and (native or stepping.wanted is False):
            self.settled, self.pace = True, NATIVE if native else PLAIN
        since = time.perf_counter()
        sweep = max(1, self.pace // columns)
        if native:  # whole lanes in turn, each through the whole sweep
            sweep = max(sweep, min(SWEEP // columns, self.pace // self.shape.side))
        if self.checkpoint is not None:
            sweep = self.checkpoint.within(sweep)
        turns, every = samples.ahead(self.reached, sweep)
        calls = self._sweep(turns, every, self.pace)
        seconds = (time.perf_counter() - since) / calls
        if seconds < (PATIENCE if self.settled else LOOK) / 2:
            self.pace *= 2
        elif seconds > 2 * PATIENCE:
            self.pace = max(1, self.pace // 2)
        if samples.full or (self.reached - self.looked) * columns >= STEPS:
            self._look()
        return turns * every

    def _look(self) -> None:
        """Compute the functions of the samples so far."""
        self.looked = self.reached
        if self.quantities:
            self.quantities.flush()

    def save(self) -> None:
        """Write the run so far, with functions of all samples that are there."""
        self._look()
        super().save()

    def _sweep(self, turns: int, every: int, pace: int) -> int:
        """Take all bodies through `turns` samples; returns the number of native calls in turn."""
        lanes, count, before, steps = self.lanes, self.count, self.reached, turns * every
        out, side = self.observers[0].target(before, turns, every), lanes.stepping.lanes
        column, calls = 0, 1
        done = before - self.done

        def plainly(i: int) -> None:
            clock, raised = self.clocks[:, i], self.failures.setdefault(i, [])
            while clock[MARK] != STUCK and clock[TAKEN] < before + steps:
                clock[MARK] = 0.0
                row, part = divmod(int(clock[TAKEN]) - before, every)
                rows = (out[row : row + 1], 1) if part else (out[row:], turns - row)
                lanes.plainly(i, self.table[:, i], rows[0][..., i], rows[1], raised, every - part)

        while column < count and not lanes.stepping.ready((done + steps * column / count) / self.steps):
            for i in range(column, min(column + side, count)):
                plainly(i)
            column += side
        if column < count:
            self.compiled = True
            whole = self.shape.whole(count)
            self.table[:, count:whole] = self.table[:, count - 1 : count]  # lanes that are left over
            workers = self.plan.options.workers
            size = pace // steps if self.bodies else 1
            calls = lanes.natively(self.table, out, turns, workers, every, range(column, whole), size, WORTH)
            for i in np.flatnonzero(self.clocks[MARK] == ASKED).tolist():
                plainly(i)
        self.reached, self.latest = before + steps, out[-1]
        return calls

    # ---------------------------------------------------------------- what came of it

    def _stand_here(self) -> None:
        """Update `here`: the last sample, or the state in which a body stopped."""
        taken, count = self.clocks[TAKEN], self.count
        if self.stood == (self.reached, taken.sum()):
            return
        self.stood = self.reached, taken.sum()
        self.here = np.empty((1 + len(self.latest), count))
        self.here[0], self.here[1:] = self.clocks[TIME], self.latest[:, :count]
        for i in np.flatnonzero((taken != self.reached) | self.over).tolist():
            if i in self.stay:
                self.here[1:, i] = self.stay[i]
                continue
            memory = read(self.numbers[:, i].copy(), 0, self.lanes.layout)
            self.here[1:, i] = leaves(sample(self.way.way_of(i), memory), self.lanes.state)
        self.here[0, self.over] = self.t0[self.over]

    def why(self, i: int) -> Any:
        self._stand_here()
        return super().why(i)

    @property
    def lazy(self) -> bool:  # type: ignore[override]
        return self.asked is None

    def together(self) -> tuple[np.ndarray, np.ndarray]:
        t, numbers, _ = self._gathered()
        return t, numbers

    @property
    def furthest(self) -> int:
        """The step to which some body has come, which Ctrl-C may have stopped before the others."""
        return int(max(self.reached, self.clocks[TAKEN, ~self.over].max(initial=0.0)))

    def so_far(self) -> str:
        t = f"{self.way.clock} = {self.zero[0] + self.furthest * self.h[0]:g}"
        text = f"after {self.furthest} of {self.done + self.steps} steps, {t}"
        return f"{text}; {len(self._gathered()[0])} samples are in `.trajectory`"

    def _stopped_stay(self, samples: Straight) -> int:
        """Repeat the last state of bodies that stopped in later samples; returns the number of samples."""
        taken = self.clocks[TAKEN]
        count = int(samples.samples_after(self.furthest))
        for i in np.flatnonzero((taken < taken.max()) | (taken < self.reached) | self.over).tolist():
            k = max(0, int(samples.samples_after(taken[i])) - samples.first) if not self.over[i] else 0
            samples.array[k : count - samples.first, :, i] = self.here[1:, i]
        return count

    def _gathered(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Times, (n,) or of bodies with steps of their own (n, bodies), and numbers of samples, (n, bodies, width)."""
        samples = self.observers[0]
        self._stand_here()
        count = self._stopped_stay(samples)
        numbers = np.moveaxis(samples.array[: count - samples.first, :, : self.count], 1, -1)
        if self.asked is None:
            t = times(self.zero.item(0), samples.numbers[samples.first : count], self.way.h)
            return self._as_far(t, samples), numbers, count
        reached = self.reached if self.bodies else self.clocks.item(TAKEN, 0)
        reached_times = self.after + ~self.exact <= max(reached, self.done)
        return self._between(samples, numbers, reached_times)

    def _as_far(self, t: np.ndarray, samples: Straight) -> np.ndarray:
        """The times of samples, (n, bodies) if the run was interrupted before all had come to them; of a
        body that failed its own, unless all share theirs.
        """
        taken = self.clocks[TAKEN]
        late = (taken < max(taken.max(), self.reached)) & ~self.over
        late = np.flatnonzero(late & ~self.failed if t.ndim == 1 else late)
        if not len(late):
            return t
        t = np.repeat(t[:, None], self.count, axis=1) if t.ndim == 1 else t
        for i in late.tolist():
            t[int(samples.samples_after(taken[i])) - samples.first :, i] = self.here[0, i]
        return t

    asked: Any

    def _between(self, samples: Straight, numbers: np.ndarray, wanted: np.ndarray) -> Any:
        """The samples at times that were asked for: after the last whole step before each a shorter one."""
        t, after, exact = self.asked[wanted], self.after[wanted], self.exact[wanted]
        states = numbers[np.searchsorted(samples.numbers, after)]
        moving = ~exact[:, None] & (after[:, None] < np.where(self.over, 0, np.where(
            self.clocks[MARK] == STUCK, self.clocks[TAKEN], np.inf)))  # fmt: skip
        row, body = np.nonzero(moving)
        if len(row):
            starts = self.zero.item(0) + after[row] * self.h.item(0)
            inputs = [states[row, body], starts[:, None], (t[row] - starts)[:, None]]
            try:
                states[row, body] = self.moved(np.concatenate(inputs, axis=1), t[row], body)
            except IntegrationFailure as error:  # there are those before it
                n = int(row[getattr(error, "row", 0)])
                self.asked, self.after, self.exact = t[:n], after[:n], exact[:n]
                raise
        return t, states, len(t)

    def samples(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        t, numbers, count = self._gathered()
        if self.asked is None:
            samples = self.observers[0]
            count = max(1, int(samples.samples_after(self.clocks[TAKEN, i]))) - samples.first
        return (t if t.ndim == 1 else t[:, i])[:count], numbers[:count, i]

    def flush(self) -> tuple[np.ndarray, np.ndarray]:
        samples = self.observers[0]
        begin = samples.given
        t, numbers, count = self._gathered()
        if not self.bodies:
            count = max(1, int(samples.samples_after(self.clocks.item(TAKEN, 0))))
        rows = slice(begin - samples.first, count - samples.first)
        samples.given = max(begin, count)
        return t[rows], numbers[rows].copy() if self.bodies else numbers[rows, 0].copy()

    @property
    def most(self) -> int:
        return self.furthest - self.done

    def ended(self) -> dict[int, Any]:
        """Bodies that go no further, with errors that have no trajectories, which would be many."""
        self._stand_here()
        errors = {}
        for i in np.flatnonzero(self.failed).tolist():
            at = f"step {int(self.clocks[TAKEN, i]) + 1}, t = {self.here[0, i]:g}"
            errors[i] = failure((self.failures.get(i) or [None])[-1], f"body {i}", at)
        return errors


class Advance(StraightRun):
    """Steps that warn of a body only when it stops, and of which an interrupt leaves all bodies at the same one."""

    def _sweep(self, turns: int, every: int, pace: int) -> int:
        before = self.table.copy()
        try:
            return super()._sweep(turns, every, pace)
        except KeyboardInterrupt:
            self.table[:] = before
            raise

    def tell(self, made: Trajectory) -> None:
        if any(not self.over[i] for i in made.stopped):
            super().tell(made)


def at_steps(times: Any, t0: Any, h: Any) -> np.ndarray:
    """Times, those of ends of steps, but for rounding, exactly."""
    ends = t0 + np.rint((times - t0) / h) * h
    near = NEAR * np.maximum(np.abs(times), np.abs(t0))
    return np.where(np.abs(times - ends) <= near, ends, times)


def steps_before(times: np.ndarray, t0: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """For each time the number of whole steps that lead up to it, and whether they lead there exactly, but for
    rounding.
    """
    near = np.rint((times - t0) / h)
    exact = np.abs(times - (t0 + near * h)) <= NEAR * np.maximum(np.abs(times), abs(t0))
    return np.where(exact, near, np.floor((times - t0) / h)).astype(np.int64), exact


def affordable(size: int, steps: int, every: int) -> None:
    """Refuse more samples than memory holds, before anything is allocated."""
    if size < 2**28:
        return
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        memory = 2**36
    if size > 0.8 * memory:
        raise InvalidInput(
            f"integrate: {steps} steps, every {every}, need {size / 2**30:.3g} GiB for the samples "
            f"and this machine has {memory / 2**30:.3g}; keep fewer with a larger `every`"
        )
