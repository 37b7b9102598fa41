"""Marching: the loop over steps and samples, in plain Python or native code, for one body or many."""

from __future__ import annotations

import os
import time
import warnings
from typing import Any

import numpy as np

from .compiler import kernel
from .compiler.driver import REJECTED, accepted, any_body, attempt, read, write
from .dense import unpacked
from .errors import (
    IntegrationFailure,
    IntegrationInterrupted,
    InvalidInput,
    InvalidType,
    NotCompilable,
    NotCompiledWarning,
    NotFinite,
)
from .formulas import where
from .formulas.broadcasting import small
from .formulas.pytree import NUMBER, build, compensated, fitted, layout_of, leaves, plain
from .integrators.method import Method
from .systems.system import State, System
from .trajectory import Trajectory

COMPILE_FROM = 3000
"""Steps times bodies from which native code pays, although it may have to be compiled first."""

PATIENCE = 0.25
"""Seconds of native code between two looks at the progress bar and the keyboard."""


def march(
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
) -> None:
    """The driver: `samples` times `every` steps from step number `first`, in plain Python or compiled, for one or many.

    states holds what the method carries along, in this layout, before and after; out the samples, laid out as `shown`; taken
    the number of steps that went through.  A body whose step fails stays where it is, for good.
    """
    memory = read(states, 0, layout)
    count = read(taken, 0, NUMBER)
    running = count == first
    for k in range(samples):
        for j in range(every):
            new = attempt(method.step, system, t0 + (first + (k * every + j)) * h, memory, h)
            if layout.remembers:
                new = fitted(new, layout)
            good = running and accepted(new, method.observe, shown)
            if any_body(not good):
                running = good
                if not any_body(running):
                    break
                memory = where(good, new, memory)
                count = where(good, count + 1.0, count)
            else:
                memory = new
                count = count + 1.0
        write(out, k * shown.width, plain(method.observe(memory)), shown)
        if not any_body(running):
            break
    write(states, 0, memory, layout)
    write(taken, 0, count)


def begin(method: Any, system: Any, given: Any, started: Any, layout: Any, h: float, starts: Any, states: Any, out: Any) -> None:
    """The driver before the first step: from a start, given in one layout and to be used in another, what the method carries
    along, in a third, and the first sample."""
    memory = method.start(system, fitted(read(starts, 0, given), started), h)
    write(states, 0, fitted(memory, layout), layout)
    write(out, 0, plain(method.observe(memory)))


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
        self.system, self.method, self.h, self.t0 = system, method, h, t0
        self.steps, self.every, self.progress, self.workers = steps, every, progress, workers
        self.bodies = start.bodies
        count = self.bodies or 1
        one = _member(start, 0)
        self.given, one = layout_of(one), self._remembering(one, compensate)
        self.started, first = layout_of(one), method.start(system, one, h)
        self.example = plain(method.observe(first))
        self.layout, self.shown = layout_of(first), layout_of(self.example)
        self.kernels: dict[Any, kernel.Kernel] = {}
        self.compiled = self._decide(compiled, count)
        if not self.compiled:
            self._try(first)
        self.lanes = kernel.lanes() if self.compiled and self.bodies is not None else 1
        self.columns = -(-count // self.lanes) * self.lanes
        rows = self._rows(steps)
        _affordable(rows * self.shown.width * self.columns * 8, steps, every)
        self.out = np.empty((rows, self.shown.width, self.columns))
        self.states = np.empty((self.layout.width, self.columns))
        self.taken = np.zeros(self.columns)
        if self.bodies is None:
            self.states[:, 0] = [*leaves(first, self.layout)]
            self.out[0, :, 0] = [*leaves(self.example, self.shown)]
        else:
            beginning = method, system, self.given, self.started, self.layout, h
            self._run(begin, beginning, self._columns_of(start), self.states, self.out[0])

    def _remembering(self, start: State, compensate: bool | None) -> State:
        """The start, in compensated numbers what is to be summed up so: all, nothing, or what the motion depends on."""
        if compensate is None and (self.method.symmetric or self.method.symplectic):
            motion = self.system.essential(start).parts
            return type(start)(*(compensated(x) if motion[name] is not None else x for name, x in start.parts.items()))
        return compensated(start) if compensate else start

    def _try(self, memory: Any) -> None:
        """Make the first step once for trial: a formula that returns what it should not is told before the run.

        The compiler needs no trial, it sees what comes back."""
        new = attempt(self.method.step, self.system, self.t0, memory, self.h) if self.steps else memory
        if new is not REJECTED and layout_of(fitted(new, self.layout)) != self.layout:
            raise InvalidType(
                f"integrate: one step of {self.method!r} on {self.system!r} turns {self.layout!r} into {layout_of(new)!r}. "
                "Formulas return numbers, liemech.vec(...), liemech.mat(...) and records, not arrays or lists"
            )

    def _columns_of(self, start: State) -> np.ndarray:
        """The start with a column for each body; the last lanes, if there are too many, repeat the last body."""
        count = len(next(iter(start.parts.values())))
        parts = [_numbers(x).reshape(count, -1) for x in start.parts.values() if x is not None]
        columns = np.concatenate(parts, axis=1).T
        return np.ascontiguousarray(columns[:, np.minimum(np.arange(self.columns), count - 1)])

    def _decide(self, compiled: bool | None, bodies: int) -> bool:
        if compiled is False:
            return False
        why_not = kernel.available()
        if why_not is not None:
            if compiled:
                raise NotCompilable(f"integrate: compiled=True, but {why_not}")
            return False
        array, lanes = np.empty(0), kernel.lanes() if self.bodies is not None else 1
        marching = march, *self._arguments(0, 1, 1), array, array, array
        found = kernel.known(*marching, lanes=lanes)
        if found is None and not compiled and self.steps * bodies < COMPILE_FROM:
            return False
        try:
            self.kernels[march] = found or kernel.kernel(*marching, lanes=lanes)
            if self.bodies is not None:
                beginning = begin, self.method, self.system, self.given, self.started, self.layout, self.h, array, array, array
                self.kernels[begin] = kernel.kernel(*beginning, lanes=lanes)
        except NotCompilable as error:
            if compiled:
                raise
            slower = f"{error}. Running in plain Python instead, much slower"
            warnings.warn(slower, NotCompiledWarning, stacklevel=4)
            return False
        return True

    def _arguments(self, first: int, every: int, samples: int) -> tuple[Any, ...]:
        return self.method, self.system, self.layout, self.shown, self.t0, self.h, first, every, samples

    # ---------------------------------------------------------------- marching

    def _rows(self, steps: int) -> int:
        """How many samples there are after this many steps: the start, one for each `every`, and the very last."""
        return steps // self.every + 1 + (steps == self.steps and steps % self.every > 0)

    def trajectory(self) -> Trajectory:
        """March to the end, in pieces short enough to show progress and to be interrupted."""
        done, per_call = 0, max(1, (16384 if self.compiled else 256) // self.columns)
        try:
            with Bar(self.progress, self.steps * (self.bodies or 1)) as bar:
                while done < self.steps:
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
                    self._run(march, self._arguments(done, every, samples), self.states, target, self.taken)
                    if self.bodies is None and self.taken[0] < after:
                        raise self._failure(0)
                    done = after
                    used = time.perf_counter() - begun
                    bar.advance(every * samples * (self.bodies or 1))
                    if used < PATIENCE / 2:
                        per_call *= 2
                    elif used > 2 * PATIENCE:
                        per_call = max(1, per_call // 2)
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(
                f"integrate: interrupted after {done} of {self.steps} steps; "
                f"{self._rows(done)} samples are in `.trajectory`"
            )
            stopped.trajectory = self._result(done)
            raise stopped from None
        return self._result(self.steps)

    def _run(self, driver: Any, values: tuple[Any, ...], *arrays: np.ndarray) -> None:
        """Run a driver on all bodies: one after the other in plain Python, or in native code, perhaps in threads."""
        if not self.compiled:
            for i in range(self.columns):
                columns = [np.ascontiguousarray(a[..., i]).ravel() for a in arrays]
                driver(*values, *columns)
                for a, column in zip(arrays, columns, strict=True):
                    a[..., i] = column.reshape(a.shape[:-1])
            return
        run = self.kernels[driver]
        share = -(-self.columns // (self.workers * self.lanes)) * self.lanes
        parts = [(i, min(i + share, self.columns)) for i in range(0, self.columns, share)]
        if len(parts) == 1:
            run(*values, *arrays, bodies=self.columns, end=self.columns)
            return
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(len(parts)) as pool:  # native code does not hold the interpreter's lock
            for part in [pool.submit(run, *values, *arrays, bodies=self.columns, begin=a, end=b) for a, b in parts]:
                part.result()

    # ---------------------------------------------------------------- results

    def _result(self, steps: int) -> Trajectory:
        """The samples of the first `steps` steps."""
        count, rows = self.bodies or 1, self._rows(steps)
        stopped = {int(i): int(self.taken[i]) for i in np.flatnonzero(self.taken[:count] < steps)}
        for i, n in stopped.items():  # the first sample after the failure holds the last state; some later ones nothing
            self.out[n // self.every + 2 : rows, :, i] = self.out[n // self.every + 1, :, i]
        parts = self.out[:rows, :, :count]
        flat = parts[..., 0] if self.bodies is None else np.moveaxis(parts, 1, -1)
        t = self.t0 + np.minimum(np.arange(rows) * self.every, steps) * self.h
        if stopped:
            some = ", ".join(f"body {i} after {n} steps" for i, n in list(stopped.items())[:5])
            warnings.warn(
                f"integrate: {len(stopped)} of {count} bodies stopped early: {some}. {self._failure(min(stopped))}",
                RuntimeWarning,
                stacklevel=4,
            )
        states = unpacked(self.example, self.shown, flat)
        return Trajectory(self.system, self.method, self.h, t, states, self.bodies, steps, self.compiled, stopped)

    def _failure(self, body: int) -> IntegrationFailure:
        """Why a body stopped: its failing step, run again in plain Python."""
        step = int(self.taken[body])
        t = self.t0 + step * self.h
        memory = build(self.layout, iter(self.states[:, body].tolist()))
        cause: Exception | None = None
        try:
            self.method.step(self.system, t, memory, self.h)
            error: IntegrationFailure = NotFinite(
                f"{self.method!r}: the step overflowed or left the domain of a formula; a smaller h may help"
            )
        except IntegrationFailure as raised:
            error = cause = raised
        except ArithmeticError as raised:
            error, cause = NotFinite(f"{self.method!r}: {raised}"), raised
        except Exception as raised:
            error, cause = IntegrationFailure(f"{self.method!r}: {type(raised).__name__}: {raised}"), raised
        at = f"step {step + 1} of {self.steps}, t = {t:g}"
        if self.bodies is None:
            at += f"; {self._rows(step)} samples are in `.trajectory`"
        failure = type(error)(f"{error} [{at}]")
        failure.__cause__ = cause
        if self.bodies is None:
            failure.trajectory = self._result(step)
        return failure


class Bar:
    """A progress bar that appears when the run takes longer than a second."""

    def __init__(self, wanted: bool | None, total: int) -> None:
        self.wanted, self.total, self.done, self.begun = wanted, total, 0, time.perf_counter()
        self.bar: Any = None

    def __enter__(self) -> Bar:
        return self

    def advance(self, steps: int) -> None:
        self.done += steps
        if self.bar is None and self.wanted is not False and self.done < self.total:
            if self.wanted or time.perf_counter() - self.begun > 1.0:
                from tqdm.auto import tqdm

                self.bar = tqdm(total=self.total, unit="step", unit_scale=True)
                self.bar.update(self.done)
        elif self.bar is not None:
            self.bar.update(steps)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()


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
