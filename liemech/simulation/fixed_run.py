"""One run with fixed steps, of one body or many: its arrays, its pieces, its failures."""

from __future__ import annotations

import collections
import functools
import os
import time
from array import array
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..compiler import kernel
from ..compiler.driver import Rejected, attempt, read, reason
from ..compiler.interrupts import in_threads
from ..compiler.kernel import Several
from ..errors import (
    IntegrationFailure,
    IntegrationInterrupted,
    InvalidInput,
    InvalidType,
    failure,
    is_mistake,
    warn,
)
from ..formulas.pytree import Layout, double_double, fitted, layout_of, leaves
from ..systems.system import State, member
from .carry import Carry
from .checkpoint import Checkpoint
from .control import begun, sample
from .dense import flat, unpacked
from .driver import begin, fixed_steps
from .execution import LOOK, Execution
from .lanes import pool
from .prepared import Shape, Steps, shown_step, times
from .progress import Bar
from .stopped import Stopped
from .trajectory import Trajectory

PATIENCE = 0.25
"""Seconds of a settled run between two looks at the progress bar and the keyboard."""

PLAIN, NATIVE = 16, 2**17
"""Steps of all bodies together in the first piece of a run."""

SWEEP = 2**26
"""Steps of all bodies together, in native code, after which all bodies have come to the same time."""

NEAR = 2**10
"""Bodies whose numbers stay in the cache while they are written from rows into columns."""

WORTH = 2**15
"""Steps of all bodies together that are worth a thread."""


class FixedRun:
    """Some steps from a start, or from where another run stands.

    marks : the numbers of the steps after which a sample is kept, rising, up to `steps`; default:
    by the plan's `every`.
    """

    def __init__(
        self,
        plan: Steps,
        start: State | Carry,
        steps: int,
        t0: float = 0.0,
        marks: np.ndarray | None = None,
        checkpoint: Checkpoint | None = None,
    ) -> None:
        carry = start if isinstance(start, Carry) else None
        self.plan, self.every, self.steps, self.marks = plan, plan.every, steps, marks
        self.t0, self.before = (t0, 0) if carry is None else (carry.t0, carry.step)
        self.checkpoint, self.bodies = checkpoint, start.bodies
        self.count = self.bodies or 1
        # of the run that this one is a part of: its steps, and the samples before this one's
        self.whole, self.earlier = steps, 0
        self.failures: dict[int, Exception | None] = {}  # what plain Python saw failing steps raise
        shape = carry.shape if carry is not None and plan.owns(carry.shape) else None
        if shape is None:
            self.start: State = start.state if isinstance(start, Carry) else start
            shape = self._shape()
        elif steps:
            shape.stepping.refresh()
        self.shape = shape
        self.columns = shape.columns(self.count)
        rows = self._rows(steps)
        _affordable(rows * shape.shown.width * self.columns * 8, steps, self.every)
        self.out = np.empty((rows, shape.shown.width, self.columns))
        self.states = np.empty((shape.layout.width + 1, self.columns))
        self.taken = self.states[-1]
        if carry is not None:
            self._continue(carry)
        else:
            self._begin()
        # a sample, and after how many steps it was taken
        self.latest, self.held = self.out[:1], self.before

    @property
    def compiled(self) -> bool:
        """Has native code taken over?"""
        return "stepping" in vars(self.shape) and self.shape.stepping.native is not None

    # ---------------------------------------------------------------- the start

    def _member(self, i: int) -> State:
        """The start of one body."""
        return member(self.start, i)

    def _shape(self) -> Shape:
        """The layouts of this run, from other runs of the plan if their starts were like this one."""
        one = self._member(0)
        given, side = layout_of(one), kernel.side_by_side(self.bodies)
        shape = self.plan.shapes.get((given, side))
        if shape is None:
            remembering = self.plan.remembering(one)
            started = layout_of(remembering)
            first, example = self._first(remembering, started)
            shape = self.plan.shapes[given, side] = Shape(
                self.plan, given, started, first, example, side
            )
        elif self.steps:
            shape.stepping.refresh()
        return shape

    def _first(self, one: State, started: Layout) -> tuple[Any, Any]:
        """What the method carries along from the start of the first body that can begin, and the
        sample that shows it.
        """
        for i in range(self.count):
            start = fitted(self._member(i), started) if i else one
            own = self.plan.way_of(i), self.plan.of(i), start, self.plan.h_of(i)
            trial = attempt(begun, *own)
            if not isinstance(trial, Rejected):
                carry, example = trial
                if not isinstance(example, State):
                    shown = type(self.plan.method_of(i)).__name__
                    raise InvalidType(
                        f"{shown}.observe must return the state in what is carried along, as "
                        f"{shown}.start gives it; got {example!r:.90}"
                    )
                return double_double(carry) if started.long else carry, example
            self.failures[i] = reason(trial)
            if is_mistake(self.failures[i]):
                break
        raise self._nobody()

    def _nobody(self) -> Any:
        """The error of a run in which no body can begin: a mistake in a formula, or a failure."""
        last = self.failures.get(max(self.failures, default=0))
        error = last if is_mistake(last) else self.failures.get(0)
        none = "" if self.bodies is None else f"none of the {self.count} bodies can begin; body 0: "
        what = none + repr(self.plan.method)
        raised = error if is_mistake(error) else failure(error, what, self._at_start())
        return self._with_trajectory(raised, self._only_start())

    def _clock_at(self, steps: int) -> str:
        """The time after so many steps; of bodies with steps of their own that of the first."""
        return f"{self.plan.clock} = {self.t0 + steps * self.plan.h_of(0):g}"

    def _at_start(self) -> str:
        return f"at the start, {self.plan.clock} = {self.t0:g}"

    def _only_start(self) -> Trajectory:
        """The start as the only sample."""
        states = {name: np.array(x)[None] for name, x in self.start.parts.items() if x is not None}
        h, t = self.plan.h, times(self.t0, np.zeros(1), self.plan.h)
        return Trajectory(
            self.plan.system, self.plan.method, shown_step(h), t, states, self.bodies, 0
        )

    def _begin(self) -> None:
        """Let the method begin with every body."""
        shape, plan = self.shape, self.plan
        starts = (
            self.out[0]
            if shape.given == shape.shown
            else np.empty((shape.given.width, self.columns))
        )
        self._lay_down(starts)
        if shape.order is not None:
            for number, place in zip(self.states, [*shape.order, -1], strict=True):
                number[:] = starts[place] if place >= 0 else 0.0
            return
        beginning = shape.beginning(plan)
        beginning.refresh()
        if self.steps and shape.stepping.native is not None and self.bodies is not None:
            beginning.compile()
        if shape.given != shape.shown:
            self.out[0] = 0.0
        self.taken[:] = -1.0
        arrays = starts, self.states, self.out[0]
        self._run(beginning, shape.beginner, *arrays)
        for i in np.flatnonzero(self.taken[: self.count] < 0.0):
            if i not in self.failures:
                self._plain(begin, shape.beginner, arrays, int(i))
        if (self.taken[: self.count] < 0.0).all():
            raise self._nobody()
        if self.bodies is not None:
            self.states[:-1, self.taken < 0.0] = 0.0
        if self.steps and beginning.native is not None and self.bodies is not None:
            shape.stepping.compile()

    def _lay_down(self, columns: np.ndarray) -> None:
        """Write the numbers of the start, a column for each body; lanes that are left over repeat
        the last body.
        """
        if self.bodies is None:
            columns[:, 0] = leaves(self.start, self.shape.given)
            return
        at = 0
        for part in self.start.arrays.values():
            rows = flat({"": part}, self.count)
            numbers = columns[at : at + rows.shape[1], : self.count]
            for i in range(0, self.count, NEAR):  # one pass over memory, not one for each number
                numbers[:, i : i + NEAR] = rows[i : i + NEAR].T
            at += len(numbers)
        columns[:, self.count :] = columns[:, self.count - 1 : self.count]

    def _padded(self, columns: np.ndarray) -> np.ndarray:
        """Columns of all bodies, the last one repeated for the lanes that are left over."""
        return np.ascontiguousarray(columns[:, np.minimum(np.arange(self.columns), self.count - 1)])

    def _continue(self, carry: Carry) -> None:
        """Take up what another run carried along."""
        if len(carry.numbers) != len(self.states):
            raise InvalidInput(
                "Plan.resume: the run had another `compensated` or `precision` than the plan has"
            )
        self.states[:] = self._padded(carry.numbers.reshape(-1, self.count))
        self.out[0] = self._padded(carry.last.reshape(-1, self.count))
        self.failures = dict(carry.failures)

    # ---------------------------------------------------------------- stepping

    def _rows(self, steps: int) -> int:
        """How many samples there are after this many steps: the start, one for each `every`, and
        the very last.
        """
        if self.marks is not None:
            return 1 + int(np.searchsorted(self.marks, steps, "right"))
        reached = self.before + steps
        return (
            reached // self.every
            - self.before // self.every
            + 1
            + (steps == self.steps and steps and reached % self.every > 0)
        )

    def _kept(self, steps: int) -> int:
        """How many of them the run has then."""
        return self.earlier + self._rows(steps)

    def _pending(self, done: int) -> int:
        """How many steps there are to the next sample."""
        if self.marks is not None:
            return int(self.marks[self._rows(done) - 1]) - done
        return min(self.every - (self.before + done) % self.every, self.steps - done)

    def trajectory(self) -> Trajectory:
        """Step to the end, in pieces short enough to show progress and to be interrupted."""
        done, settled, pace = 0, False, PLAIN
        stepping = self.shape.stepping
        try:
            with Bar(self.plan.progress, self.steps * self.count) as bar:
                while done < self.steps:
                    if not settled and (self.compiled or stepping.wanted is False):
                        settled, pace = True, NATIVE if self.compiled else PLAIN
                    begun = time.perf_counter()
                    sweep = max(1, pace // self.columns)
                    if self.compiled:  # whole lanes in turn, each through the whole sweep
                        sweep = max(sweep, min(SWEEP // self.columns, pace // self.shape.lanes))
                    if self.checkpoint is not None:
                        sweep = self.checkpoint.within(sweep)
                    pending = self._pending(done)
                    # part of one sample
                    if self.marks is not None or pending < self.every or sweep < self.every:
                        every, samples = min(pending, sweep), 1
                    else:
                        every, samples = self.every, min(sweep, self.steps - done) // self.every
                    calls = self._piece(done, every, samples, pace)
                    done += every * samples
                    used = (time.perf_counter() - begun) / calls
                    bar.advance(every * samples * self.count)
                    if self.checkpoint is not None and self.checkpoint.due(every * samples):
                        self.checkpoint.save(self._so_far(done))
                    if used < (PATIENCE if settled else LOOK) / 2:
                        pace *= 2
                    elif used > 2 * PATIENCE:
                        pace = max(1, pace // 2)
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(
                f"integrate: interrupted after {self.before + done} of {self.before + self.whole} "
                f"steps, {self._clock_at(self.before + done)}; {self._kept(done)} samples are in "
                "`.trajectory`"
            )
            raise self._with_trajectory(stopped, self._result(done)) from None
        return self._result(self.steps)

    def _piece(self, done: int, every: int, samples: int, pace: int) -> int:
        """Step all bodies this far; in how many calls, if in native code?"""
        first, last, after = (
            self._rows(done),
            self._rows(done + every * samples),
            self.before + done + every * samples,
        )
        target = self.out[first:last] if first < last else np.empty((1, *self.out.shape[1:]))
        values = *self.shape.arguments, self.t0, self.shape.h, self.before + done, every, samples
        running = None if self.bodies is None else self.taken[: self.count] == self.before + done
        more = every * samples
        calls = self._run(
            self.shape.stepping,
            values,
            self.states,
            target,
            done=done,
            more=more,
            of=self.steps,
            pace=pace,
        )
        if running is None:
            if self.taken[0] < after:
                self._once_more(0, self.before + done, every, after, target)
                if self.taken[0] < after:
                    raise self._ended(0)
        else:
            for i in np.flatnonzero(running & (self.taken[: self.count] < after)):
                self._once_more(int(i), self.before + done, every, after, target)
        self.latest, self.held = target[-1:], after
        return calls

    def _run(
        self,
        execution: Execution,
        values: tuple[Any, ...],
        *arrays: np.ndarray,
        done: int = 0,
        more: int = 1,
        of: int = 1,
        pace: int = NATIVE,
    ) -> int:
        """Run a driver on all bodies: one after the other in plain Python, the rest in native code
        as soon as there is some.

        done, more, of : steps before this call, in it, and in all.  pace : steps of a call.
        Returns the number of native calls.
        """
        column, lanes = 0, self.shape.lanes
        while column < self.count and not execution.ready((done + more * column / self.count) / of):
            end = min(column + lanes, self.count)
            with execution.plain():
                for i in range(column, end):
                    self._plain(execution.call[0], values, arrays, i)
            column = end
        return (
            self._native(execution, values, arrays, column, more, pace)
            if column < self.count
            else 1
        )

    def _plain(
        self, driver: Any, values: tuple[Any, ...], arrays: tuple[np.ndarray, ...], i: int
    ) -> None:
        """Run a driver in plain Python on one body."""
        stepping = driver is fixed_steps
        if stepping and self.taken[i] < 0.0:  # it could not even begin
            return
        failures: list[Exception | None] = []
        columns = [np.ascontiguousarray(a[..., i]).ravel() for a in arrays]
        driver(*(x.values[i] if isinstance(x, Several) else x for x in values), *columns, failures)
        for a, column in zip(arrays, columns, strict=True):
            a[..., i] = column.reshape(a.shape[:-1])
        if failures:
            self.failures.setdefault(i, failures[0])
            error: Any = failures[0]
            if self.bodies is not None and is_mistake(error):
                at = f"body {i}, {self._place(i)}"
                error.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
                raise self._with_trajectory(
                    error, self._result(values[6] - self.before) if stepping else self._only_start()
                )

    def _once_more(self, i: int, first: int, every: int, after: int, target: np.ndarray) -> None:
        """A step that native code has marked is plain Python's, and so are the next ones of this
        piece.

        It knows what the step raises, and goes on where native code cannot: with integers beyond
        2^63, for example.
        """
        while self.taken[i] < after and i not in self.failures:
            step = int(self.taken[i])
            row, part = divmod(step - first, every)
            values = *self.shape.arguments, self.t0, self.shape.h, step, every - part, 1
            self._plain(fixed_steps, values, (self.states, target[row : row + 1]), i)

    def _native(
        self,
        execution: Execution,
        values: tuple[Any, ...],
        arrays: tuple[np.ndarray, ...],
        start: int,
        more: int,
        pace: int,
    ) -> int:
        """Run a driver in native code on the bodies from `start`, in blocks, perhaps in threads;
        how many blocks in turn?
        """
        native: Any = execution.native
        arrays = *self.shape.own, *arrays
        stepping = execution.call[0] is fixed_steps
        floats = [
            x for x in (values[4:6] if stepping else values[6:]) if not isinstance(x, Several)
        ]
        numbers = self.shape.constants + array("d", floats).tobytes()
        integers: tuple[int, ...] = values[6:] if stepping else ()
        if self.bodies is None:
            native.run(numbers, integers, arrays)
            return 1
        if self.columns > self.count:  # the lanes that are left over follow the last body
            self.states[:, self.count :] = self.states[:, self.count - 1 : self.count]
        lanes, columns, workers = self.shape.lanes, self.columns, self.plan.workers
        threads = max(1, min(workers, (columns - start) * more // WORTH))
        share = -(-(columns - start) // (threads * lanes)) * lanes
        size = min(share, max(lanes, pace // more // lanes * lanes))
        call = functools.partial(native.run, numbers, integers, arrays, columns)
        blocks = range(start, columns, size)
        waiting = iter(blocks)  # each thread takes the next block as soon as it has done one

        def work() -> None:
            try:
                for first in waiting:
                    call(first, min(first + size, columns))  # without the interpreter's lock
            finally:
                collections.deque(waiting, 0)  # interrupted, nobody begins another block

        in_threads([work] * threads, pool(workers, os.getpid()) if threads > 1 else None)
        return -(-len(blocks) // threads)

    # ---------------------------------------------------------------- results

    def _so_far(self, steps: int) -> Trajectory:
        """The samples of the first `steps` steps."""
        rows, reached = self._rows(steps), self.before + steps
        stopped = {}
        if self.bodies is not None or self.taken[0] < reached:
            stopped = {
                int(i): max(0, int(self.taken[i]))
                for i in np.flatnonzero(self.taken[: self.count] < reached)
            }
        # the first sample after the failure holds the last state; some later ones nothing
        for i in stopped:
            last = (
                self._rows(int(self.taken[i]) - self.before) if self.taken[i] >= self.before else 0
            )
            self.out[last + 1 : rows, :, i] = self.out[last : last + 1, :, i]
        carry, ahead = None, self.taken[0] if self.bodies is None else self.taken.max()
        # not in the middle of a piece that was interrupted or failed
        if ahead == reached == self.held:
            columns: Any = 0 if self.bodies is None else slice(self.count)
            memory, shown = self.states[:, columns], self.latest[0, :, columns]
            carry = Carry(
                self.shape, self.t0, self.plan.h, reached, self.bodies, memory, shown, self.failures
            )

        @functools.cache
        def made() -> tuple[np.ndarray, dict[str, Any]]:
            if carry is not None:
                carry.keep()
            return self._samples(self.out[:rows], steps)

        return Trajectory.promised(
            SimpleNamespace(t=lambda: made()[0], states=lambda: made()[1]),
            system=self.plan.system,
            method=self.plan.method,
            breaks=self.plan.breaks,
            h=shown_step(self.plan.h),
            bodies=self.bodies,
            steps=steps,
            compiled=self.compiled,
            stopped=Stopped(stopped, self._failure),
            carry=carry,
        )

    def _result(self, steps: int) -> Trajectory:
        """The run, with a warning of bodies of an ensemble that stopped."""
        run = self._so_far(steps)
        stopped: Any = run.stopped
        if stopped and self.bodies is not None:
            first = self._failure(min(stopped))
            mistake: Any = first.__cause__
            if is_mistake(mistake):
                at = f"body {min(stopped)}, {self._place(min(stopped))}"
                mistake.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
                raise self._with_trajectory(mistake, run)
            some = ", ".join(
                f"body {i} after {n} steps" for i, n in list(stopped.steps.items())[:5]
            )
            warn(
                f"integrate: {len(stopped)} of {self.count} bodies stopped early: {some}. {first}",
                RuntimeWarning,
            )
        return run

    def _samples(self, out: np.ndarray, steps: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Times and parts of the state, (n, ...) each, as views of what the steps have written."""
        flat = out[..., 0] if self.bodies is None else np.moveaxis(out[..., : self.bodies], 1, -1)
        return self.times(len(out), steps), unpacked(self.shape.shown, flat)

    def times(self, rows: int, steps: int) -> np.ndarray:
        """The times of so many samples."""
        if self.marks is not None:
            numbers = self.before + np.concatenate([[0], self.marks[: rows - 1]])
        else:
            numbers = np.minimum(
                (np.arange(rows) + self.before // self.every) * self.every, self.before + steps
            )
            numbers[0] = self.before
        return times(self.t0, numbers, self.plan.h)

    def _failure(self, body: int) -> IntegrationFailure:
        """Why a body stopped: what plain Python saw its step raise."""
        at = self._place(body)
        if self.bodies is None:
            kept = self._kept(int(self.taken[body]) - self.before)
            at += f"; {kept} samples are in `.trajectory`"
        return failure(self.failures.get(body), repr(self.plan.method_of(body)), at)

    def _place(self, body: int) -> str:
        """The step that a body did not make, and the time from which."""
        step = int(self.taken[body])
        t = self.t0 + step * self.plan.h_of(body)
        if step < 0:
            return self._at_start()
        return f"step {step + 1} of {self.before + self.whole}, {self.plan.clock} = {t:g}"

    def _ended(self, body: int) -> Exception:
        """The error of a single body that stopped: its failure, or the mistake in a formula itself."""
        error: Any = self._failure(body)
        if is_mistake(error.__cause__):
            error = error.__cause__
            at = self._place(body)
            error.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
        else:
            carry = read(self.states[:, body], 0, self.shape.layout)
            error.reached = sample(self.plan.method_of(body), carry)
        return self._with_trajectory(error, self._result(int(self.taken[body]) - self.before))

    @staticmethod
    def _with_trajectory(error: Any, run: Trajectory) -> Any:
        error.trajectory = run
        return error


def _affordable(size: int, steps: int, every: int) -> None:
    """Refuse before anything is allocated."""
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
