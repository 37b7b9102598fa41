"""The one loop: check, allocate, march, record, report."""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from .errors import InvalidInput, InvalidType, IntegrationFailure, NotCompilable, NotCompiledWarning, NotFinite
from .integrators.method import Method
from .native import Mat, Vec, kernel
from .native.driver import accepted, any_body, attempt, read, write
from .native.values import Layout, build, layout_of, leaves
from .systems.lie_poisson import BodyState, LiePoissonSystem
from .trajectory import Trajectory

COMPILE_FROM = 3000
"""Steps times bodies from which native code pays although it may have to be compiled first; the result is the same to the bit."""

PATIENCE = 0.25
"""Seconds of native code between two looks at the progress bar and the keyboard."""


def march(
    method: Any,
    system: Any,
    layout: Any,
    t0: float,
    h: float,
    first: int,
    every: int,
    samples: int,
    states: Any,
    out: Any,
    taken: Any,
) -> None:
    """The driver: `samples` times `every` steps from step number `first`, in plain Python or compiled, for one body or many.

    states holds what the method carries along, before and after; out the samples; taken the number of steps that went through.
    A body whose step fails stays where it is.
    """
    memory = read(states, 0, layout)
    count = 0.0
    running = True
    for k in range(samples):
        for j in range(every):
            new = attempt(method.step, system, t0 + (first + (k * every + j)) * h, memory, h)
            if not (running and accepted(new)):
                running = False
                break
            memory = new
            count = count + 1.0
        shown = method.observe(memory)
        write(out, k * layout_of(shown).width, shown)
        if not any_body(running):
            break
    write(states, 0, memory)
    write(taken, 0, count)


def begin(method: Any, system: Any, given: Any, h: float, starts: Any, states: Any, out: Any) -> None:
    """The driver before the first step: what the method carries along, and the first sample, from the start."""
    memory = method.start(system, read(starts, 0, given), h)
    write(states, 0, memory)
    write(out, 0, method.observe(memory))


def integrate(
    system: LiePoissonSystem,
    method: Method,
    start: BodyState,
    *,
    h: float,
    steps: int,
    every: int = 1,
    record: Iterable[str] | None = None,
    t0: float = 0.0,
    compiled: bool | None = None,
    progress: bool | None = None,
    workers: int = 1,
) -> Trajectory:
    """Follow a motion for `steps` steps of length h and keep every `every`-th state.

    start : `system.state(mu, g)`; with a leading axis an ensemble, which runs in SIMD lanes.
    h : the step, in s; negative runs backwards.  Times are t0 + n h.
    record : ("mu",) or ("mu", "g"); what is not recorded is not computed.  Default: what the start has.
    compiled : True for native code, False for plain Python, None to choose by the amount of work; the result is the same to the bit.
    progress : True or False; None shows a bar when a run takes longer than a second.
    workers : threads among which the bodies of an ensemble are divided.

    Returns a Trajectory.  Raises InvalidInput, IncompatibleSystem, or an IntegrationFailure whose `.trajectory` has every sample
    recorded before the step that failed.  In an ensemble a body that fails stays at its last state, is named in
    `Trajectory.stopped` and in a warning, and disturbs no other.
    """
    if not isinstance(method, Method):
        raise InvalidType(f"integrate: method must be a method such as RKMK(order=4); got {method!r}")
    method.require(system)
    h, t0 = _real(h, "h"), _real(t0, "t0")
    steps, every = _count(steps, "steps", 0), _count(every, "every", 1)
    workers = _count(workers, "workers", 1)
    if h == 0.0:
        raise InvalidInput("integrate: h must not be zero")
    end = t0 + steps * h
    if not math.isfinite(end):
        raise InvalidInput(f"integrate: {steps} steps of h = {h:g} lead to t = {end}")
    if steps and max(abs(t0), abs(end)) + abs(h) == max(abs(t0), abs(end)):
        smallest = np.spacing(max(abs(t0), abs(end)))
        raise InvalidInput(f"integrate: h = {h:g} is lost beside t = {end:g}; the smallest useful step there is {smallest:.1e}")
    start = _started(system, start, record)
    return _Run(system, method, start, h, steps, every, t0, compiled, progress, workers).trajectory()


class _Run:
    """One call of `integrate`: its arrays and its progress."""

    def __init__(
        self,
        system: LiePoissonSystem,
        method: Method,
        start: BodyState,
        h: float,
        steps: int,
        every: int,
        t0: float,
        compiled: bool | None,
        progress: bool | None,
        workers: int,
    ) -> None:
        self.system, self.method, self.h, self.t0 = system, method, h, t0
        self.steps, self.every, self.progress, self.workers = steps, every, progress, workers
        self.bodies = start.bodies
        count = self.bodies or 1
        one = _member(start, 0)
        self.given, first = layout_of(one), method.start(system, one, h)
        self.layout, self.shown = layout_of(first), layout_of(method.observe(first))
        self.compiled = self._decide(compiled, count)
        self.lanes = kernel.lanes() if self.compiled and self.bodies is not None else 1
        self.columns = -(-count // self.lanes) * self.lanes
        self.samples = steps // every
        _affordable((self.samples + 1) * self.shown.width * self.columns * 8, steps, every)
        self.out = np.empty((self.samples + 1, self.shown.width, self.columns))
        self.states = np.empty((self.layout.width, self.columns))
        self.taken = np.zeros(self.columns)
        self._run(begin, (method, system, self.given, h), self._columns_of(start), self.states, self.out[0])

    def _columns_of(self, start: BodyState) -> np.ndarray:
        """The start with a column for each body; the last lanes, if there are too many, repeat the last body."""
        count = self.bodies or 1
        parts = [np.asarray(x, dtype=float).reshape(count, -1) for x in (start.mu, start.g) if x is not None]
        columns = np.concatenate(parts, axis=1).T
        return np.ascontiguousarray(columns[:, np.minimum(np.arange(self.columns), count - 1)])

    def _decide(self, compiled: bool | None, bodies: int) -> bool:
        if compiled is False:
            return False
        why_not = kernel.available()
        if why_not is None and (compiled or self.steps * bodies >= COMPILE_FROM):
            try:
                self._kernel(kernel.lanes() if self.bodies is not None else 1)
            except NotCompilable as error:
                if compiled:
                    raise
                warnings.warn(f"{error}. Running in plain Python instead, much slower", NotCompiledWarning, stacklevel=5)
                return False
            return True
        if compiled:
            raise NotCompilable(f"integrate: compiled=True, but {why_not}")
        return False

    def _arguments(self, first: int, every: int, samples: int) -> tuple[Any, ...]:
        return self.method, self.system, self.layout, self.t0, self.h, first, every, samples

    def _kernel(self, lanes: int) -> kernel.Kernel:
        array = np.empty(0)
        return kernel.kernel(march, *self._arguments(0, 1, 1), array, array, array, lanes=lanes)

    # ---------------------------------------------------------------- marching

    def trajectory(self) -> Trajectory:
        """March to the end, in pieces short enough to show progress and to be interrupted."""
        done = 0
        with _Bar(self.progress, self.steps * (self.bodies or 1)) as bar:
            per_call, used = max(1, min(self.steps, 256)), 0.0
            while done < self.samples * self.every or done < self.steps:
                begun = time.perf_counter()
                pending = min(self.every - done % self.every, self.steps - done)
                if pending < self.every or per_call < self.every:  # part of one sample
                    every, samples = min(pending, per_call), 1
                else:
                    every, samples = self.every, min(per_call // self.every, self.samples - done // self.every)
                row = done // self.every + 1
                keeps = samples > 1 or (done + every) % self.every == 0
                target = self.out[row : row + samples] if keeps else np.empty((1, *self.out.shape[1:]))
                before = self.taken.copy()
                self._run(march, self._arguments(done, every, samples), self.states, target, self.taken)
                done += every * samples
                self.taken += before
                used = time.perf_counter() - begun
                bar.advance(every * samples * (self.bodies or 1))
                if self.bodies is None and self.taken[0] < done:
                    self._fail(int(self.taken[0]))
                if used < PATIENCE / 2:
                    per_call *= 2
                elif used > 2 * PATIENCE:
                    per_call = max(1, per_call // 2)
        return self._result(self.samples + 1)

    def _run(self, driver: Any, values: tuple[Any, ...], *arrays: np.ndarray) -> None:
        """Run a driver on all bodies: one after the other in plain Python, or in native code and, if asked for, in threads."""
        if not self.compiled:
            for i in range(self.columns):
                columns = [np.ascontiguousarray(a[..., i]).ravel() for a in arrays]
                driver(*values, *columns)
                for a, column in zip(arrays, columns, strict=True):
                    a[..., i] = column.reshape(a.shape[:-1])
            return
        run = kernel.kernel(driver, *values, *arrays, lanes=self.lanes)
        share = -(-self.columns // (self.workers * self.lanes)) * self.lanes
        parts = [(i, min(i + share, self.columns)) for i in range(0, self.columns, share)]
        if len(parts) == 1:
            run(*values, *arrays, bodies=self.columns, end=self.columns)
            return
        with ThreadPoolExecutor(len(parts)) as pool:  # native code does not hold the interpreter's lock
            for part in [pool.submit(run, *values, *arrays, bodies=self.columns, begin=a, end=b) for a, b in parts]:
                part.result()

    # ---------------------------------------------------------------- results

    def _result(self, rows: int) -> Trajectory:
        count = self.bodies or 1
        parts = self.out[:rows, :, :count]
        if self.bodies is None:
            flat = parts[..., 0]
        else:
            flat = np.moveaxis(parts, 1, -1)
        dim = self.system.group.dim
        has_g = self.shown.width > dim
        shape = self.system.group.identity().shape if has_g else ()
        g = np.ascontiguousarray(flat[..., dim:]).reshape(*flat.shape[:-1], *shape) if has_g else None
        stopped = {int(i): int(self.taken[i]) for i in np.flatnonzero(self.taken[:count] < self.steps)} if self.bodies else {}
        if stopped and rows == self.samples + 1:
            some = ", ".join(f"body {i} after {n} steps" for i, n in list(stopped.items())[:5])
            warnings.warn(f"integrate: {len(stopped)} of {count} bodies stopped early: {some}", RuntimeWarning, stacklevel=5)
        t = self.t0 + np.arange(rows) * self.every * self.h
        return Trajectory(
            self.system, self.method, self.h, t, np.ascontiguousarray(flat[..., :dim]), g, self.steps, self.compiled, stopped
        )

    def _fail(self, step: int) -> None:
        """Run the failing step again in plain Python, for the error that says why."""
        memory = build(self.layout, iter(self.states[:, 0].tolist()))
        t = self.t0 + step * self.h
        try:
            new = self.method.step(self.system, t, memory, self.h)
            error: IntegrationFailure = NotFinite(f"{self.method!r}: the step gave {new!r}")
        except IntegrationFailure as raised:
            error = raised
        except ArithmeticError as raised:
            error = NotFinite(f"{self.method!r}: {raised}")
        rows = step // self.every + 1
        failure = type(error)(f"{error} [step {step + 1} of {self.steps}, t = {t:g}; {rows} samples are in `.trajectory`]")
        failure.trajectory = self._result(rows)
        raise failure from (error if error.__traceback__ else None)


class _Bar:
    """A progress bar that appears when the run takes longer than a second."""

    def __init__(self, wanted: bool | None, total: int) -> None:
        self.wanted, self.total, self.done, self.begun = wanted, total, 0, time.perf_counter()
        self.bar: Any = None

    def __enter__(self) -> _Bar:
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


# ------------------------------------------------------------------ the border


def _started(system: LiePoissonSystem, start: Any, record: Iterable[str] | None) -> BodyState:
    if not isinstance(start, BodyState):
        raise InvalidType(f"integrate: start must come from system.state(mu=..., g=...); got {type(start).__name__}")
    start = system.state(np.asarray(start.mu), None if start.g is None else np.asarray(start.g))
    if record is None:
        return start
    wanted = (record,) if isinstance(record, str) else tuple(record)
    if not set(wanted) <= {"mu", "g"} or "mu" not in wanted:
        raise InvalidInput(f'integrate: record is ("mu",) or ("mu", "g"); got {wanted!r}')
    if "g" in wanted and start.g is None:
        raise InvalidInput("integrate: record asks for g, but the start has none; give system.state a g")
    return start if "g" in wanted else BodyState(start.mu)


def _member(start: BodyState, i: int) -> BodyState:
    if start.bodies is None:
        return start
    return BodyState(Vec.of(start.mu[i].tolist()), None if start.g is None else Mat.of(start.g[i].tolist()))


def _real(value: Any, name: str) -> float:
    if isinstance(value, (bool, str)) or isinstance(value, complex):
        raise InvalidType(f"integrate: {name} must be a number; got {value!r}")
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidType(f"integrate: {name} must be a number; got {value!r}") from None
    if not math.isfinite(number):
        raise InvalidInput(f"integrate: {name} must be finite; got {number}")
    return number


def _count(value: Any, name: str, least: int) -> int:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise InvalidType(f"integrate: {name} must be a whole number; got {value!r}")
    if value < least:
        raise InvalidInput(f"integrate: {name} must be at least {least}; got {value}")
    return int(value)


def _affordable(size: int, steps: int, every: int) -> None:
    """Refuse before anything is allocated."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        memory = 2**36
    if size > 0.8 * memory:
        raise InvalidInput(
            f"integrate: {steps} steps, every {every}, need {size / 2**30:.3g} GiB for the samples and this machine has {memory / 2**30:.3g}; "
            "keep fewer with a larger `every`"
        )
