"""Runs in a fictive time: steps of one length there, of many lengths in physical time, which is carried along and met exactly."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..compiler.driver import accepted, attempt, itself, read, reason, write
from ..errors import (
    IncompatibleSystem,
    IntegrationFailure,
    IntegrationInterrupted,
    InvalidInput,
    InvalidTimeScale,
    StepTooSmall,
    StepWarning,
    failure,
    is_mistake,
    warn,
)
from ..formulas import Record, record
from ..formulas.broadcasting import small
from ..formulas.pytree import compensated, layout_of, leaves
from ..integrators.composition import Composition
from ..systems.clocked import Clocked
from ..systems.time_transformed import ExtendedSystem
from .arrival import FictiveMotion, landed
from .dense import unpacked
from .drift import Drift
from .execution import LOOK, Execution
from .fixed import begun, observed, sample, stepped
from .fixed_run import FixedRun
from .prepared import Steps
from .progress import Bar
from .trajectory import Trajectory

STILL = 1000.0
"""Steps without a change of the physical time after which a run to a given time is ended."""


def extended(system: Any, method: Any, start: Any) -> Any:
    """The system whose state carries physical time along, bound to a start."""
    if isinstance(system, ExtendedSystem):
        if method.fictive:
            raise IncompatibleSystem(f"integrate: {method!r} varies its steps, and so does {system!r}; one of them will do")
        whole = system.bound(start)
        method.require(whole)
        return whole
    while isinstance(method, Composition):
        method = method.base
    return Clocked(system, method.sigma.bound(system, start))


# ------------------------------------------------------------------ the drivers


@record
class Marched(Record):
    """How far a run came: steps, those since the last sample, samples in this call, the length of the last step, and the steps for
    which the physical time has stood still.

    ended : 0 not yet, 1 at the last time, 2 the next step failed.
    """

    steps: float
    since: float
    samples: float
    last: float
    still: float
    ended: float


MARCHED = layout_of(Marched(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def march(
    method: Any,
    system: Any,
    layout: Any,
    shown: Any,
    h: float,
    t_end: float,
    every: float,
    room: int,
    most: float,
    states: Any,
    marked: Any,
    out: Any,
    failures: Any,
) -> None:
    """The driver: steps, a sample after each `every`, until there are `room` - 1 of them or so many steps, or t_end is reached.

    The step that would lead to t_end or beyond is replaced by one that ends there, and its sample kept.
    failures : None in native code; in plain Python a list for what the failing step raised.
    """
    carry, mark = read(states, 0, layout), read(marked, 0, MARCHED)
    steps, since, last, n, ended = mark.steps, mark.since, h, 0, 0.0
    most, time, still = steps + most, system.clock(sample(method, carry)), mark.still
    while n < room - 1 and steps < most and ended == 0.0:
        trial = attempt(stepped, method, system, steps * h, carry, h, layout, failures is not None and steps == 0.0)
        if not accepted(trial, observed, shown):
            ended = 2.0
            if failures is not None:
                failures.append(reason(trial))
        elif (system.clock(trial[1]) - t_end) * h >= 0.0:
            ended = 1.0
        elif still >= STILL:
            ended = 2.0
            if failures is not None:
                failures.append(StepTooSmall(f"{STILL:g} steps went by and physical time stands still"))
        else:
            still = still + 1.0 if system.clock(trial[1]) == time else 0.0
            carry, steps, since, time = trial[0], steps + 1.0, since + 1.0, system.clock(trial[1])
            if since == every:
                write(out, n * shown.width, trial[1], shown)
                n, since = n + 1, 0.0
    if ended == 1.0:
        end = attempt(landed, method, system, carry, h, t_end)
        if accepted(end, itself):
            write(out, n * shown.width, end[0], shown)
            last, n, steps = end[1], n + 1, steps + 1.0
        else:
            ended = 2.0
            if failures is not None:
                failures.append(reason(end))
    write(states, 0, carry, layout)
    write(marked, 0, Marched(steps, since, 1.0 * n, last, still, ended), MARCHED)


# ------------------------------------------------------------------ the run


@dataclass(frozen=True, eq=False, repr=False)
class TransformedTrajectory(Trajectory):
    """Samples of a run in fictive time.

    t : physical times, (n,), whose distances differ; of an ensemble of m members (n, m).  tau : (n,) fictive times.
    h : the step in fictive time.  sigma : the time scale, dt = sigma dtau, bound to the start.
    z : (n,) what a ReversibleController takes for 1/sigma; None for other methods.
    """

    tau: np.ndarray = None  # type: ignore[assignment]
    sigma: Any = None
    z: np.ndarray | None = None

    @cached_property
    def scale(self) -> np.ndarray:
        """sigma at every sample, (n,): physical time for a unit of fictive time."""
        if self.bodies is not None:
            raise InvalidInput("TransformedTrajectory.scale takes one body at a time")
        kind = type(self.last)
        return np.array(
            [
                self.sigma.value(self.system, small_state(kind, {n: x[k] for n, x in self.states.items()}))
                for k in range(len(self))
            ]
        )

    def drift(self) -> Drift:
        """How well the constants of the motion were kept; for an ensemble over fictive time, which its members share."""
        return Drift.of(self.system, self.t if self.bodies is None else self.tau, self.states, self.bodies)

    def __repr__(self) -> str:
        many = "" if self.bodies is None else f"{self.bodies} bodies, "
        end = f"to t = {np.ravel(self.t[-1])[0]:g}, " if len(self) and self.bodies is None else ""
        return (
            f"Trajectory({self.method!r}, {self.sigma!r}: {many}{len(self)} samples {end}"
            f"tau = {self.tau[-1]:g}, h = {self.h:g} in tau, "
            f"{'compiled' if self.compiled else 'plain'}; {', '.join(self.states)})"
        )


def small_state(kind: Any, arrays: dict[str, np.ndarray]) -> Any:
    """A state as formulas take it."""
    return kind(*[small(np.asarray(arrays[name])) if name in arrays else None for name in kind.__dataclass_fields__])


class TransformedRun:
    """One call of `integrate` in fictive time.

    whole : the system whose state carries time along.  given, start : where it begins, without and with its time.
    """

    def __init__(
        self,
        system: Any,
        method: Any,
        start: Any,
        h: float,
        t0: float,
        compensated: bool | None,
        compiled: bool | None,
        progress: bool | None,
    ) -> None:
        self.whole: Any = extended(system, method, start)
        self.system, self.method, self.given, self.start = self.whole.system, method, start, self.whole.extended(start, t0)
        doubt = method.step_warning(self.whole, self.start, h) if start.bodies is None else None
        if doubt:
            warn(doubt, StepWarning)
        self.h, self.t0, self.compensated, self.compiled, self.progress = h, t0, compensated, compiled, progress

    def steps(self, steps: int, every: int, workers: int) -> Trajectory:
        """So many steps of one length in fictive time, for one body or an ensemble."""
        stepping = self.h, every, self.compensated, "double", self.compiled, self.progress, workers
        run = FixedRun(Steps(self.whole, self.method, *stepping), self.start, steps)
        try:
            made = run.trajectory()
        except BaseException as error:
            if isinstance(getattr(error, "trajectory", None), Trajectory):
                error.trajectory = self._presented(error.trajectory)  # type: ignore[attr-defined]
            if isinstance(error, IntegrationFailure):
                error.args = (" tau = ".join(str(error).rsplit(" t = ", 1)),)  # of the step: the loop knows no other time
            raise
        return self._presented(made)

    def until(self, t_end: float, every: int, limit: int, times: np.ndarray | None) -> Trajectory:
        """As many steps as lead to a time, for one body; kept are every `every`-th state and the last one, or those at `times`."""
        if self.start.bodies is not None:
            raise InvalidInput("integrate: t_end is for one body at a time; give an ensemble h and steps")
        if (t_end - self.t0) * self.h < 0.0:
            raise InvalidInput(
                f"integrate: t_end = {t_end:g} is not where steps of h = {self.h:g} lead from {self.t0:g}; turn the sign of h"
            )
        return March(self, t_end, every, limit, times).trajectory()

    def _presented(self, run: Trajectory) -> TransformedTrajectory:
        """Samples of the extended system as those of the system."""
        if run.bodies is None:
            numbers = np.concatenate([_floats(x).reshape(len(run), -1) for x in run.states.values()], axis=1)
            return self.result(self.whole.apart(run.states)[0], numbers, run.t, self.start, run.steps, run.compiled)
        t, states, z = self.whole.apart(run.states)
        return self._made(t, states, run.t, run.bodies, run.steps, run.compiled, run.stopped, z=z)

    def result(
        self, t: np.ndarray, numbers: np.ndarray, tau: np.ndarray, example: Any, steps: int, compiled: bool
    ) -> TransformedTrajectory:
        """A trajectory of one body: times, numbers of the samples of the extended system, (n, width), and fictive times."""
        _, states, z = self.whole.apart(unpacked(layout_of(example), numbers))
        dense: Any = FictiveMotion(self.method, self.whole, type(self.given), example, self.h, t, numbers, self.compiled)
        return self._made(t, states, tau, None, steps, compiled, dense=dense, z=z)

    def _made(self, t: np.ndarray, states: Any, tau: np.ndarray, *rest: Any, **more: Any) -> TransformedTrajectory:
        more |= {"tau": tau, "sigma": self.whole.sigma}
        made = TransformedTrajectory(self.system, self.method, self.h, t, states, *rest, **more)
        if (np.diff(t, axis=0) * math.copysign(1.0, self.h) < 0.0).any():
            error = InvalidTimeScale(f"integrate: physical time went back; {self.whole.sigma!r} is not positive all the way")
            error.trajectory = made
            raise error
        return made


class March:
    """One run to a given time: its samples and its progress."""

    def __init__(self, run: TransformedRun, t_end: float, every: int, limit: int, times: np.ndarray | None) -> None:
        self.run, self.t_end, self.every, self.limit, self.times = run, t_end, every, limit, times
        start = run.start
        if run.compensated is not False:
            motion = run.whole.essential_part(start).parts
            start = type(start)(
                *(compensated(x) if run.compensated or motion[n] is not None else x for n, x in start.parts.items())
            )
        trial = attempt(begun, run.method, run.whole, start, run.h)
        if not accepted(trial, observed):
            error: Any = reason(trial)
            raise error if is_mistake(error) else failure(error, repr(run.method), f"at the start, t = {run.t0:g}")
        carry, self.example = trial
        self.layout, self.shown = layout_of(carry), layout_of(self.example)
        self.states = np.array([*leaves(carry, self.layout)])
        self.marked = np.zeros(MARCHED.width)
        self.mark: Marched = read(self.marked, 0, MARCHED)
        self.rows = [np.array([[*leaves(self.example, self.shown)]])]
        self.taus = [np.zeros(1)]
        self.failures: list[Any] = []
        array = np.empty(1)
        self.arguments = run.method, run.whole, self.layout, self.shown, run.h, t_end, float(every if times is None else 1)
        self.execution = Execution(run.compiled, run.progress, march, *self.arguments, 1, 1.0, array, array, array, None)

    def trajectory(self) -> TransformedTrajectory:
        """Step to t_end, in pieces short enough to be interrupted."""
        steps = 16
        try:
            with Bar(self.run.progress, 1000) as bar:
                while not self.mark.ended and self._time() != self.t_end:
                    begun = time.perf_counter()
                    self._more(min(steps, self.limit - int(self.mark.steps)))
                    used = time.perf_counter() - begun
                    steps = 2 * steps if used < 0.5 * LOOK else max(1, steps // 2) if used > 4.0 * LOOK else steps
                    bar.advance(int(1000 * self._part()) - bar.done)
                    if self.mark.steps >= self.limit and not self.mark.ended:
                        reached = f"{self.limit} steps led to t = {self._time():g} only, not to {self.t_end:g}"
                        raise self._ended(StepTooSmall(f"integrate: {reached}; give a larger h or allow more `steps`"))
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(f"integrate: interrupted at t = {self._time():g}; the samples are in `.trajectory`")
            raise self._ended(stopped) from None
        if self.mark.ended == 2.0:
            raise self._failed()
        return self._result()

    def _more(self, most: int) -> None:
        """Up to so many more steps."""
        every = int(self.arguments[-1])
        room = most // every + 2
        if not self.execution.ready(self._part()):
            with self.execution.plain():
                self._piece(march, room, most)
            return
        self._piece(self.execution.native, room, most)
        if self.mark.ended == 2.0:  # plain Python says why, or goes on where native code cannot
            self.marked[-1] = 0.0
            self._piece(march, room, most)

    def _piece(self, driver: Any, room: int, most: int) -> None:
        """A call of the driver; its samples are kept."""
        before, every, width = self.mark, int(self.arguments[-1]), self.shown.width
        out = np.empty(room * width)
        driver(*self.arguments, room, float(most), self.states, self.marked, out, self.failures if driver is march else None)
        self.mark = read(self.marked, 0, MARCHED)
        count = int(self.mark.samples)
        if count:
            tau = before.steps - before.since + every * np.arange(1.0, count + 1.0)
            tau = tau * self.run.h
            if self.mark.ended == 1.0:
                tau[-1] = (self.mark.steps - 1.0) * self.run.h + self.mark.last
            self.rows.append(out[: count * width].reshape(count, width))
            self.taus.append(tau)

    # ---------------------------------------------------------------- results

    def _clock(self, rows: np.ndarray) -> np.ndarray:
        return self.run.whole.apart(unpacked(self.shown, rows))[0]

    def _time(self) -> float:
        """Where the last sample is."""
        return float(self._clock(self.rows[-1][-1:])[0])

    def _part(self) -> float:
        """How much of the run is done."""
        return (self._time() - self.run.t0) / (self.t_end - self.run.t0) if self.t_end != self.run.t0 else 1.0

    def _result(self) -> TransformedTrajectory:
        numbers, tau = np.concatenate(self.rows), np.concatenate(self.taus)
        times, steps, native = self._clock(numbers), int(self.mark.steps), self.execution.native is not None
        if self.mark.ended == 1.0:
            times[-1] = self.t_end
        made = self.run.result(times, numbers, tau, self.example, steps, native)
        if self.times is None:
            return made
        sign = math.copysign(1.0, self.run.h)
        asked = self.times[sign * self.times <= sign * times[-1]]
        found = made.dense.numbers(asked)  # type: ignore[union-attr]
        tau = tau[np.searchsorted(sign * times, sign * asked, "right") - 1] + found[:, -1]
        few = self.run.result(asked, found[:, :-1], tau, self.example, steps, native)
        return replace(few, dense=made.dense)

    def _failed(self) -> Any:
        """The error of a run that a step ended: a mistake in a formula, or a failure."""
        error = self.failures[0] if self.failures else None
        at = f"step {int(self.mark.steps) + 1}, t = {self._time():g}; {sum(map(len, self.rows))} samples are in `.trajectory`"
        return self._ended(error if is_mistake(error) else failure(error, repr(self.run.method), at))

    def _ended(self, error: Any) -> Any:
        error.trajectory = self._result()
        return error


def _floats(array: np.ndarray) -> np.ndarray:
    """Numbers, a complex one as two."""
    array = np.ascontiguousarray(array)
    return array.view(float) if np.iscomplexobj(array) else array
