"""Adaptive steps: as long as the error estimate allows, with dense output and events on the group."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..compiler.driver import Rejected, accepted, attempt, itself, read, reason, write
from ..errors import IntegrationInterrupted, StepTooSmall, failure, is_mistake
from ..formulas import Record, record
from ..formulas.pytree import build, layout_of, leaves
from ..systems.system import State, System
from .dense import DenseOutput, packed, unpacked
from .execution import LOOK, Execution
from .progress import Bar
from .trajectory import Trajectory

SAFETY, SLOWEST, FASTEST = 0.9, 0.2, 10.0
"""The controller aims at 0.9 of the step that would just be accepted, and changes steps by factors between these two."""

ROOM = 512
"""Steps between two looks at the keyboard and the events."""

@record
class Clock(Record):
    """What the controller carries along: time, the step to try, the error of the last one, and counts."""

    t: float
    h: float
    error: float
    steps: float
    rejected: float
    stuck: float


CLOCK = layout_of(Clock(0.0, 0.0, 1.0, 0.0, 0.0, 0.0))


def adaptive_steps(
    method: Any,
    system: Any,
    layout: Any,
    row: Any,
    t_end: float,
    rtol: float,
    atol: float,
    dense: bool,
    room: int,
    states: Any,
    clocks: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver: accepted steps, a row of numbers for each, until t_end is reached, the room is full or the step underflows.

    failures : None in native code; in plain Python a list for what rejected steps raised, which a mistake in a formula ends.

    A proportional-integral controller, h <- 0.9 h err_n^(-0.7/q) err_(n-1)^(0.4/q) with err the error over the tolerance.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.2, equation (2.43c).
    """
    state, xi = read(states, 0, layout)
    clock = read(clocks, 0, CLOCK)
    t, h, before, rejected, stuck = clock.t, clock.h, clock.error, clock.rejected, 0.0
    power = 1.0 / method.error_order
    n = 0
    while n < room and t != t_end:
        last = abs(h) >= 0.999 * abs(t_end - t)
        step = t_end - t if last else h
        if t + 0.125 * step == t:
            stuck = 1.0
            break
        trial = attempt(method.trial, system, t, state, xi, step, rtol, atol, dense)
        if failures is not None and noted(failures, trial):
            stuck = 1.0
            break
        error = 1e3
        if accepted(trial, itself):
            error = max(trial.error, 1e-4)
        if error <= 1.0:
            t = t_end if last else t + step
            state, xi = trial.state, trial.velocity
            write(out, n * row.width, (t, state, trial.curve), row)
            n = n + 1
            h = step * min(FASTEST, max(SLOWEST, SAFETY * error ** (-0.7 * power) * before ** (0.4 * power)))
            before = error
        else:
            rejected = rejected + 1.0
            h = step * max(SLOWEST, SAFETY * error**-power)
    write(states, 0, (state, xi), layout)
    write(clocks, 0, Clock(t, h, before, clock.steps + n, rejected, stuck), CLOCK)


def noted(failures: list[Exception], trial: Any) -> bool:
    """Keep what a rejected step raised, the last one of them; is it a mistake in a formula?"""
    if isinstance(trial, Rejected):
        failures[:] = [trial.error]
    return isinstance(trial, Rejected) and is_mistake(trial.error)


class AdaptiveRun:
    """One call of `integrate` with a tolerance: its rows and its progress."""

    def __init__(
        self,
        system: System,
        method: Any,
        start: State,
        t0: float,
        t_end: float,
        rtol: float,
        atol: float,
        h: float | None,
        limit: int,
        t_eval: np.ndarray | None,
        events: tuple[Callable[..., Any], ...],
        dense: bool,
        compiled: bool | None,
        progress: bool | None,
    ) -> None:
        self.system, self.method, self.start, self.t0, self.t_end = system, method, start, t0, t_end
        self.rtol, self.atol, self.limit, self.t_eval, self.events = rtol, atol, limit, t_eval, events
        self.failures: list[Exception] = []
        self.progress, self.wanted = progress, compiled
        self.rows: list[np.ndarray] = []
        self.ends = [packed((t0, start))]
        self.found: list[list[float]] = [[] for _ in events]
        self.dense, self.compiled, self.width = False, False, layout_of(start).width
        self.clock = np.array([t0, 0.0, 1.0, 0.0, 0.0, 0.0])
        self.row = layout_of((t0, start, ()))
        xi = attempt(system.rate, t0, system.essential(start))
        if not accepted(xi, itself):
            error: Any = reason(xi)
            raise self._ended(error if is_mistake(error) else failure(error, repr(method), f"at the start, t = {t0:g}"))
        carry = start, xi
        self.layout = layout_of(carry)
        self.states = np.array([*leaves(carry, self.layout)])
        step = first_step(system, method, start, xi, t0, t_end, rtol, atol) if h is None else math.copysign(h, t_end - t0)
        self.clock[1] = step
        self.dense = dense or bool(events) or (t_eval is not None and bool(np.any(t_eval != t_end)))
        coefficients = (xi,) * method.curve_terms if self.dense else ()
        self.row = layout_of((t0, start, coefficients))
        self.terminal = [int(getattr(event, "terminal", None) or 0) for event in events]
        self.values = [self._value(event, t0, start) for event in events]
        self.arguments = method, system, self.layout, self.row, t_end, rtol, atol, self.dense
        array = np.empty(0)
        self.execution = Execution(compiled, progress, adaptive_steps, *self.arguments, 1, array, array, array, None)

    def trajectory(self) -> Trajectory:
        """Step to the end, or to a terminal event, in pieces short enough to show progress and to be interrupted."""
        room = 8
        try:
            with Bar(self.progress, 1000) as bar:
                while self.clock[0] != self.t_end:
                    begun = time.perf_counter()
                    taken = self._more(ROOM if self.compiled else room)
                    if time.perf_counter() - begun < 0.5 * LOOK:
                        room = min(2 * room, ROOM)
                    bar.advance(int(1000 * self._part()) - bar.done)
                    if self.events and self._stopped(taken):
                        break
                    if self.clock[0] == self.t_end:
                        break
                    if self.clock[5]:
                        raise self._failure()
                    if self.clock[3] >= self.limit:
                        reached = f"{self.limit} steps led to t = {self.clock[0]:g} only, not to {self.t_end:g}"
                        raise self._ended(StepTooSmall(f"integrate: {reached}; loosen rtol and atol or allow more `steps`"))
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(f"integrate: interrupted at t = {self.clock[0]:g}; the samples are in `.trajectory`")
            raise self._ended(stopped) from None
        return self._result()

    # ---------------------------------------------------------------- stepping

    def _part(self) -> float:
        """How much of the run is done."""
        return float((self.clock[0] - self.t0) / (self.t_end - self.t0))

    def _more(self, room: int) -> int:
        """Up to this many more steps."""
        room = min(room, int(self.limit - self.clock[3]))
        before, out = int(self.clock[3]), np.empty(room * self.row.width)
        if self.execution.ready(self._part()):
            run: Any = self.execution.native
            self.compiled = True
            run(*self.arguments, room, self.states, self.clock, out, None)
        else:
            with self.execution.plain():
                adaptive_steps(*self.arguments, room, self.states, self.clock, out, self.failures)
        taken = int(self.clock[3]) - before
        self.rows.append(out[: taken * self.row.width].reshape(taken, self.row.width))
        self.ends.append(self.rows[-1][-1, : 1 + self.width] if taken else self.ends[-1])
        return taken

    # ---------------------------------------------------------------- events

    def _stopped(self, taken: int) -> bool:
        """Look for events in the last steps, and end the run at the first terminal one."""
        rows = self.rows[-1]
        dense = self._dense(rows, self.ends[-2])
        for k in range(taken):
            a, b = dense.t[k], dense.t[k + 1]
            hits = []
            for i, (event, old) in enumerate(zip(self.events, self.values, strict=True)):
                new = self.values[i] = self._value(event, b, dense.state(b))
                direction = getattr(event, "direction", 0.0)
                if min(old, new) <= 0.0 <= max(old, new) and old != 0.0 and direction * (new - old) >= 0.0:
                    hits.append((self._root(event, dense, a, b), i))
            for at, i in sorted(hits, reverse=bool(b < a)):
                self.found[i].append(at)
                if len(self.found[i]) == self.terminal[i]:
                    theta = (at - a) / (b - a)
                    curve = rows[k, 1 + self.width :].reshape(-1, self.system.group.dim)
                    curve = curve * theta ** np.arange(1, len(curve) + 1)[:, None]
                    self.rows[-1] = np.concatenate([rows[:k], np.concatenate([[at], packed(dense.state(at)), curve.ravel()])[None]])
                    return True
        return False

    def _value(self, event: Callable[..., Any], t: float, state: Any) -> float:
        """The value of an event.  What it raises goes to the caller, with the run up to here."""
        try:
            return float(event(t, state))
        except Exception as error:
            error.add_note(f"[integrate: in an event at t = {t:g}; the samples before it are in `.trajectory`]")
            raise self._ended(error) from None

    def _root(self, event: Callable[..., Any], dense: DenseOutput, a: float, b: float) -> float:
        from scipy.optimize import brentq

        tiny = 4 * np.finfo(float).eps
        return float(brentq(lambda t: self._value(event, t, dense.state(t)), a, b, xtol=tiny * max(abs(a), abs(b)), rtol=tiny))

    # ---------------------------------------------------------------- results

    def _dense(self, rows: np.ndarray, first: np.ndarray) -> DenseOutput:
        """The continuous motion along these rows, from the end of the step before them."""
        ends = np.concatenate([first[None], rows[:, : 1 + self.width]])
        shape = self.system, self.method.retraction, self.start, ends[:, 0], ends[:, 1:], rows[:, 1 + self.width :]
        return DenseOutput(*shape, self.method.dense_order, self.wanted)

    def _result(self) -> Trajectory:
        dense = self._dense(np.concatenate([np.empty((0, self.row.width)), *self.rows]), self.ends[0])
        times, numbers = dense.t, dense.points
        if self.t_eval is not None:
            times = self.t_eval[np.abs(self.t_eval - self.t0) <= abs(dense.t[-1] - self.t0)]
            numbers = dense.numbers(times)
        return Trajectory(
            self.system,
            self.method,
            float(dense.t[-1] - self.t0) / max(1, len(dense.t) - 1),
            times,
            unpacked(self.start, layout_of(self.start), numbers),
            None,
            len(dense.t) - 1,
            self.compiled,
            rejected=int(self.clock[4]),
            dense=dense if self.dense else None,
            events=tuple((np.array(times), dense(times)) for times in self.found),
        )

    def _failure(self) -> Exception:
        """Why the steps became too small to go on: what the last trial had to say.  A mistake in a formula is raised itself."""
        t, h = float(self.clock[0]), float(self.clock[1])
        state, xi = build(self.layout, iter(self.states.tolist()))
        raised: list[Exception] = []  # by the steps that led here: each was at most five times as long as the next
        for longer in (1.0, 5.0, 25.0, 125.0):
            trial = attempt(self.method.trial, self.system, t, state, xi, longer * h, self.rtol, self.atol, False)
            noted(raised, trial)
            if raised or not trial.error <= 1.0:
                break
        told = [*raised, *self.failures]
        error: Any = next((e for e in told if is_mistake(e)), told[0] if told else None)
        if is_mistake(error):
            error.add_note(f"[integrate: in a step from t = {t:g}; the samples before it are in `.trajectory`]")
            return self._ended(error)
        why = str(error)
        if error is None:
            why = f"the error estimate is {trial.error:.1e} of the tolerance even so"
            if not math.isfinite(trial.error):
                why = "the motion has no finite velocity there"
        elif not isinstance(error, ArithmeticError):
            why = f"{type(error).__name__}: {error}"
        made = StepTooSmall(
            f"{self.method!r}: at t = {t:g} the step fell to {abs(h):.1e}, too small to advance the time: {why}. "
            f"The motion may have a singularity there, or rtol = {self.rtol:g}, atol = {self.atol:g} ask for more than "
            f"rounding allows; {int(self.clock[3])} steps are in `.trajectory`"
        )
        made.__cause__ = error
        return self._ended(made)

    def _ended(self, error: Any) -> Any:
        error.trajectory = self._result()
        return error


def first_step(system: System, method: Any, start: State, xi: Any, t0: float, t_end: float, rtol: float, atol: float) -> float:
    """A first step from the size of the velocity and of its change.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4, "Starting step size".
    """

    def sizes(omega: Any) -> tuple[float, float]:
        change, scale = system.deviation(start, omega)
        weights = [1.0 / (atol + rtol * s) if atol + rtol * s > 0.0 else 0.0 for s in scale]
        squares = [math.fsum((w * x) ** 2 for w, x in zip(weights, part, strict=True)) for part in (change, scale)]
        return math.sqrt(squares[0] / len(weights)), math.sqrt(squares[1] / len(weights))

    span = t_end - t0
    if span == 0.0:
        return 0.0
    speed, size = sizes(xi)
    least = 8 * np.spacing(max(abs(t0), abs(t_end)))
    h = math.copysign(min(max(0.01 * size / speed if speed > 0.0 else abs(span), least), abs(span)), span)
    moved = attempt(system.moved, method.retraction, system.essential(start), h * xi)
    later = moved if isinstance(moved, Rejected) else attempt(system.rate, t0 + h, moved)
    if not accepted(later, itself):
        return 1e-3 * h
    change = sizes(later - xi)[0] / abs(h)
    largest = max(speed, change)
    second = (0.01 / largest) ** (1.0 / method.error_order) if largest > 0.0 else abs(span)
    return math.copysign(max(min(100.0 * abs(h), second, abs(span)), least), span)

