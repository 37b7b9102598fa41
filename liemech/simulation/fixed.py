"""Steps of one length: the loop over steps and samples, in plain Python or native code, for one body or many."""

from __future__ import annotations

import functools
import os
import time
from typing import Any

import numpy as np

from ..compiler import kernel
from ..compiler.driver import Rejected, accepted, any_body, attempt, read, reason, write
from ..errors import IntegrationFailure, IntegrationInterrupted, InvalidInput, InvalidType, failure, is_mistake, warn
from ..formulas import where
from ..formulas.broadcasting import small
from ..formulas.pytree import NUMBER, compensated, fitted, layout_of, leaves, plain
from ..integrators.method import Method
from ..systems.system import State, System
from .dense import unpacked
from .execution import LOOK, Execution
from .progress import Bar
from .trajectory import Stopped, Trajectory

PATIENCE = 0.25
"""Seconds of a settled run between two looks at the progress bar and the keyboard."""


def fixed_steps(
    method: Any,
    system: Any,
    layout: Any,
    shown: Any,
    t0: float,
    h: float,
    first: int,
    every: int,
    samples: int,
    states: Any,
    out: Any,
    taken: Any,
    failures: Any,
) -> None:
    """The driver: `samples` times `every` steps from step number `first`, in plain Python or compiled, for one or many.

    states holds what the method carries along, in this layout, before and after; out the samples, laid out as `shown`; taken
    the number of steps that went through.  A body whose step fails stays where it is, for good.
    failures : None in native code; in plain Python, which has one body, a list for what the failing step raised.
    """
    carry = read(states, 0, layout)
    count = read(taken, 0, NUMBER)
    running = count == first
    turns = every if any_body(running) else 0
    for k in range(samples):
        for j in range(turns):
            checked = failures is not None and k + j == 0
            trial = attempt(stepped, method, system, t0 + (first + (k * every + j)) * h, carry, h, layout, checked)
            good = running and accepted(trial, observed, shown)
            if any_body(not good):
                if failures is not None:
                    failures.append(reason(trial))
                running = good
                if not any_body(running):
                    break
                carry = where(good, trial[0], carry)
                count = where(good, count + 1.0, count)
            else:
                carry = trial[0]
                count = count + 1.0
        write(out, k * shown.width, attempt(sample, method, carry), shown)
        if not any_body(running):
            break
    write(states, 0, carry, layout)
    write(taken, 0, count)


def begin(
    method: Any,
    system: Any,
    given: Any,
    started: Any,
    layout: Any,
    shown: Any,
    h: float,
    starts: Any,
    states: Any,
    out: Any,
    taken: Any,
    failures: Any,
) -> None:
    """The driver before the first step: from a start, given in one layout and to be used in another, what the method carries
    along, in a third, and the first sample.  A body that cannot begin keeps what is in `out` and a negative number of steps."""
    trial = attempt(begun, method, system, fitted(read(starts, 0, given), started), h)
    good = accepted(trial, observed, shown)
    if any_body(good):
        write(states, 0, fitted(trial[0], layout), layout)
        write(out, 0, where(good, trial[1], read(out, 0, shown)), shown)
        write(taken, 0, where(good, 0.0, -1.0))
    if failures is not None and not good:
        failures.append(reason(trial))


def stepped(method: Any, system: Any, t: float, carry: Any, h: float, layout: Any, checked: bool) -> Any:
    """What the method carries along after one step, and the sample that shows it."""
    new = method.step(system, t, carry, h)
    if layout.remembers:
        new = fitted(new, layout)
    if checked:
        _require(layout, new, method, system)
    return new, plain(method.observe(new))


def begun(method: Any, system: Any, state: Any, h: float) -> Any:
    """What the method carries along from a start, and the sample that shows it."""
    carry = method.start(system, state, h)
    return carry, plain(method.observe(carry))


def sample(method: Any, carry: Any) -> Any:
    """The sample that shows what the method carries along."""
    return plain(method.observe(carry))


def observed(trial: Any) -> Any:
    """The sample in what `stepped` and `begun` return."""
    return trial[1]


def _require(layout: Any, new: Any, method: Any, system: Any) -> None:
    """Refuse a step that returns something else than it was given.  (The compiler sees for itself what comes back.)"""
    if layout_of(new) != layout:
        raise InvalidType(
            f"integrate: one step of {method!r} on {system!r} turns {layout!r} into {layout_of(new)!r}. "
            "Formulas return numbers, liemech.vec(...), liemech.mat(...) and records, not arrays or lists"
        )


class Run:
    """One call of `integrate`: its arrays and its progress."""

    def __init__(
        self,
        system: System,
        method: Method,
        start: State,
        h: float,
        steps: int,
        every: int,
        t0: float,
        compensate: bool | None,
        compiled: bool | None,
        progress: bool | None,
        workers: int,
    ) -> None:
        self.system, self.method, self.start, self.h, self.t0 = system, method, start, h, t0
        self.steps, self.every, self.progress, self.workers = steps, every, progress, workers
        self.bodies = start.bodies
        self.count = self.bodies or 1
        self.failures: dict[int, Exception | None] = {}  # what plain Python saw failing steps raise
        one = _member(start, 0)
        self.given, one = layout_of(one), self._remembering(one, compensate)
        self.started = layout_of(one)
        first, self.example = self._first(one)
        self.layout, self.shown = layout_of(first), layout_of(self.example)
        native = compiled is not False and self.bodies is not None and kernel.available() is None
        self.lanes = kernel.lanes() if native else 1
        self.columns = -(-self.count // self.lanes) * self.lanes
        rows = self._rows(steps)
        _affordable(rows * self.shown.width * self.columns * 8, steps, every)
        array = np.empty(0)
        stepping = fixed_steps, *self._arguments(0, 1, 1), array, array, array, None
        self.stepping = Execution(compiled, progress, *stepping, lanes=self.lanes)
        self.out = np.empty((rows, self.shown.width, self.columns))
        self.states = np.zeros((self.layout.width, self.columns))
        self.taken = np.zeros(self.columns)
        if self.bodies is None:
            self.states[:, 0] = [*leaves(first, self.layout)]
            self.out[0, :, 0] = [*leaves(self.example, self.shown)]
            if not np.isfinite(self.out[0]).all():
                raise self._not_begun(None, repr(method))
        else:
            self._begin(compiled)

    @property
    def compiled(self) -> bool:
        """Has native code taken over?"""
        return self.stepping.native is not None

    def _first(self, one: State) -> tuple[Any, Any]:
        """What the method carries along from the start of the first body that can begin, and the sample that shows it."""
        for i in range(self.count):
            trial = attempt(begun, self.method, self.system, self._beginning(i) if i else one, self.h)
            if not isinstance(trial, Rejected):
                return trial
            self.failures[i] = reason(trial)
            if is_mistake(self.failures[i]):
                break
        none = "" if self.bodies is None else f"none of the {self.count} bodies can begin; body 0: "
        raise self._not_begun(reason(trial), none + repr(self.method))

    def _not_begun(self, error: Exception | None, what: str) -> Any:
        """The error of a run that has no first state: a mistake in a formula, or a failure."""
        raised = error if is_mistake(error) else failure(error, what, f"at the start, t = {self.t0:g}")
        return self._with_trajectory(raised, self._only_start())

    def _beginning(self, body: int) -> State:
        """The start of a body, in the numbers that the run is to be in."""
        return fitted(_member(self.start, body), self.started)

    def _only_start(self) -> Trajectory:
        """The start as the only sample."""
        states = {name: np.array(x)[None] for name, x in self.start.parts.items() if x is not None}
        return Trajectory(self.system, self.method, self.h, np.array([self.t0]), states, self.bodies, 0)

    def _begin(self, compiled: bool | None) -> None:
        """Begin with every body of an ensemble."""
        starts = self._columns_of(self.start)
        values, array = (self.method, self.system, self.given, self.started, self.layout, self.shown, self.h), np.empty(0)
        beginning = Execution(compiled, self.progress, begin, *values, array, array, array, array, None, lanes=self.lanes)
        if self.stepping.native is not None:
            beginning.compile()
        if self.given == self.shown:
            self.out[0] = starts
        self.taken[:] = -1.0
        arrays = starts, self.states, self.out[0], self.taken
        self._run(beginning, values, *arrays)
        for i in np.flatnonzero(self.taken[: self.count] < 0.0):
            if i not in self.failures:
                self._plain(begin, values, arrays, int(i), 0)
        if beginning.native is not None:
            self.stepping.compile()

    def _remembering(self, start: State, compensate: bool | None) -> State:
        """The start, in compensated numbers what is to be summed up so: all, nothing, or what the motion depends on."""
        if compensate is None and (self.method.symmetric or self.method.symplectic):
            motion = self.system.essential(start).parts
            return type(start)(*(compensated(x) if motion[name] is not None else x for name, x in start.parts.items()))
        return compensated(start) if compensate else start

    def _columns_of(self, start: State) -> np.ndarray:
        """The start with a column for each body; the last lanes, if there are too many, repeat the last body."""
        count = len(next(iter(start.parts.values())))
        parts = [_numbers(x).reshape(count, -1) for x in start.parts.values() if x is not None]
        columns = np.concatenate(parts, axis=1).T
        return np.ascontiguousarray(columns[:, np.minimum(np.arange(self.columns), count - 1)])

    def _arguments(self, first: int, every: int, samples: int) -> tuple[Any, ...]:
        return self.method, self.system, self.layout, self.shown, self.t0, self.h, first, every, samples

    # ---------------------------------------------------------------- stepping

    def _rows(self, steps: int) -> int:
        """How many samples there are after this many steps: the start, one for each `every`, and the very last."""
        return steps // self.every + 1 + (steps == self.steps and steps % self.every > 0)

    def trajectory(self) -> Trajectory:
        """Step to the end, in pieces short enough to show progress and to be interrupted."""
        done, settled, per_call = 0, False, max(1, 16 // self.columns)
        try:
            with Bar(self.progress, self.steps * self.count) as bar:
                while done < self.steps:
                    if not settled and (self.compiled or self.stepping.wanted is False):
                        settled, per_call = True, max(1, (16384 if self.compiled else 16) // self.columns)
                    begun = time.perf_counter()
                    pending = min(self.every - done % self.every, self.steps - done)
                    if pending < self.every or per_call < self.every:  # part of one sample
                        every, samples = min(pending, per_call), 1
                    else:
                        every, samples = self.every, min(per_call, self.steps - done) // self.every
                    after = done + every * samples
                    first = self._rows(done)
                    target = self.out[first : self._rows(after)]
                    if not len(target):
                        target = np.empty((1, *self.out.shape[1:]))
                    values, arrays = self._arguments(done, every, samples), (self.states, target, self.taken)
                    running = self.taken[: self.count] == done
                    self._run(self.stepping, values, *arrays, done=done, more=every * samples, of=self.steps)
                    for i in np.flatnonzero(running & (self.taken[: self.count] < after)):
                        self._once_more(int(i), done, every, after, target)
                    if self.bodies is None and self.taken[0] < after:
                        raise self._ended(0)
                    done = after
                    used = time.perf_counter() - begun
                    bar.advance(every * samples * self.count)
                    if used < (PATIENCE if settled else LOOK) / 2:
                        per_call *= 2
                    elif used > 2 * PATIENCE:
                        per_call = max(1, per_call // 2)
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(
                f"integrate: interrupted after {done} of {self.steps} steps; "
                f"{self._rows(done)} samples are in `.trajectory`"
            )
            raise self._with_trajectory(stopped, self._result(done)) from None
        return self._result(self.steps)

    def _run(
        self, execution: Execution, values: tuple[Any, ...], *arrays: np.ndarray, done: int = 0, more: int = 1, of: int = 1
    ) -> None:
        """Run a driver on all bodies: one after the other in plain Python, the rest in native code as soon as there is some.

        done, more, of : steps before this call, in it, and in all.
        """
        column = 0
        while column < self.count and not execution.ready((done + more * column / self.count) / of):
            end = min(column + self.lanes, self.count)
            with execution.plain():
                for i in range(column, end):
                    self._plain(execution.call[0], values, arrays, i, done)
            column = end
        if column < self.count:
            self._native(execution, values, arrays, column)

    def _plain(self, driver: Any, values: tuple[Any, ...], arrays: tuple[np.ndarray, ...], i: int, done: int) -> None:
        """Run a driver in plain Python on one body."""
        if self.taken[i] < 0.0 and driver is fixed_steps:  # it could not even begin
            return
        failures: list[Exception | None] = []
        columns = [np.ascontiguousarray(a[..., i]).ravel() for a in arrays]
        driver(*values, *columns, failures)
        for a, column in zip(arrays, columns, strict=True):
            a[..., i] = column.reshape(a.shape[:-1])
        if failures:
            self.failures.setdefault(i, failures[0])
            error: Any = failures[0]
            if self.bodies is not None and is_mistake(error):
                error.add_note(f"[integrate: body {i}; the samples before it are in `.trajectory`]")
                raise self._with_trajectory(error, self._result(done) if driver is fixed_steps else self._only_start())

    def _once_more(self, i: int, done: int, every: int, after: int, target: np.ndarray) -> None:
        """A step that native code has marked is plain Python's, and so are the next ones of this piece.

        It knows what the step raises, and goes on where native code cannot: with integers beyond 2^63, for example.
        """
        while self.taken[i] < after and i not in self.failures:
            step = int(self.taken[i])
            row, part = divmod(step - done, every)
            arrays = self.states, target[row : row + 1], self.taken
            self._plain(fixed_steps, self._arguments(step, every - part, 1), arrays, i, step)

    def _native(self, execution: Execution, values: tuple[Any, ...], arrays: tuple[np.ndarray, ...], start: int) -> None:
        """Run a driver in native code on the bodies from `start`, perhaps in threads."""
        if self.columns > self.count:  # the lanes that are left over follow the last body
            for a in (self.states, self.taken):
                a[..., self.count :] = a[..., self.count - 1 : self.count]
        run: Any = execution.native
        share = -(-(self.columns - start) // (self.workers * self.lanes)) * self.lanes
        parts = [(i, min(i + share, self.columns)) for i in range(start, self.columns, share)]
        calls = [functools.partial(run, *values, *arrays, None, bodies=self.columns, begin=a, end=b) for a, b in parts]
        if len(calls) == 1:
            calls[0]()
            return
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(len(calls)) as pool:  # native code does not hold the interpreter's lock
            for running in [pool.submit(call) for call in calls]:
                running.result()

    # ---------------------------------------------------------------- results

    def _result(self, steps: int) -> Trajectory:
        """The samples of the first `steps` steps."""
        rows = self._rows(steps)
        stopped = {int(i): max(0, int(self.taken[i])) for i in np.flatnonzero(self.taken[: self.count] < steps)}
        for i in stopped:  # the first sample after the failure holds the last state; some later ones nothing
            last = int(self.taken[i]) // self.every + 1
            self.out[last + 1 : rows, :, i] = self.out[last, :, i]
        parts = self.out[:rows, :, : self.count]
        flat = parts[..., 0] if self.bodies is None else np.moveaxis(parts, 1, -1)
        t = self.t0 + np.minimum(np.arange(rows) * self.every, steps) * self.h
        states = unpacked(self.example, self.shown, flat)
        ended = Stopped(stopped, self._failure)
        run = Trajectory(self.system, self.method, self.h, t, states, self.bodies, steps, self.compiled, ended)
        if stopped and self.bodies is not None:
            first = self._failure(min(stopped))
            mistake: Any = first.__cause__
            if is_mistake(mistake):
                mistake.add_note(f"[integrate: body {min(stopped)}; the samples before it are in `.trajectory`]")
                raise self._with_trajectory(mistake, run)
            some = ", ".join(f"body {i} after {n} steps" for i, n in list(stopped.items())[:5])
            warn(f"integrate: {len(stopped)} of {self.count} bodies stopped early: {some}. {first}", RuntimeWarning)
        return run

    def _failure(self, body: int) -> IntegrationFailure:
        """Why a body stopped: what plain Python saw its step raise."""
        step = int(self.taken[body])
        t = self.t0 + step * self.h
        at = f"step {step + 1} of {self.steps}, t = {t:g}" if step >= 0 else f"at the start, t = {self.t0:g}"
        if self.bodies is None:
            at += f"; {self._rows(step)} samples are in `.trajectory`"
        return failure(self.failures[body], repr(self.method), at)

    def _ended(self, body: int) -> Exception:
        """The error of a single body that stopped: its failure, or the mistake in a formula itself."""
        error: Any = self._failure(body)
        if is_mistake(error.__cause__):
            error = error.__cause__
            at = f"step {int(self.taken[body]) + 1} of {self.steps}"
            error.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
        return self._with_trajectory(error, self._result(int(self.taken[body])))

    @staticmethod
    def _with_trajectory(error: Any, run: Trajectory) -> Any:
        error.trajectory = run
        return error


def _member(start: State, i: int) -> State:
    if start.bodies is None:
        return start
    return type(start)(*(None if x is None else small(x[i]) for x in start.parts.values()))


def _numbers(value: Any) -> np.ndarray:
    """The numbers of small vectors and matrices or of arrays of them, a complex one as two."""
    array = np.ascontiguousarray(value)
    return array.view(float) if np.iscomplexobj(array) else array.astype(float)


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
            f"integrate: {steps} steps, every {every}, need {size / 2**30:.3g} GiB for the samples and this machine "
            f"has {memory / 2**30:.3g}; keep fewer with a larger `every`"
        )
