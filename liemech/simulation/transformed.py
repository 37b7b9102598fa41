"""Runs in a fictive time: steps of one length there, of many lengths in physical time, which is
carried along and met exactly.
"""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..compiler.driver import accepted, attempt, itself, read, reason, write
from ..errors import (
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
from ..formulas.pytree import build, layout_of, leaves
from ..systems.system import State, small_state
from . import arguments
from .arrival import FictiveMotion, landed
from .carry import Carry
from .checkpoint import Checkpoint
from .dense import unpacked
from .events import NO_EVENTS, Event, Watch
from .execution import LOOK
from .fictive import FictiveCarry, Origin
from .fixed import observed, sample, stepped
from .fixed_run import FixedRun
from .prepared import Shape, Steps
from .progress import Bar
from .stopped import NONE
from .trajectory import Trajectory, TransformedTrajectory

SOME = 4096
"""Steps in the first piece of a run, in native code."""

STILL = 1000.0
"""Steps without a change of the physical time after which a run to a given time is ended."""

NEAR = 4 * np.finfo(float).eps
"""Times that differ by this part of them are one."""


# ------------------------------------------------------------------ the driver


@record
class Marched(Record):
    """How far a run came: steps, those since the last sample, samples in this call, the length of
    the last step, and the steps for which the physical time has stood still.

    ended : 0 not yet, 1 at the last time by a shorter step, 2 the next step failed, 3 at the last
    time by a whole step.
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
    """The driver: steps, a sample after each `every`, until there are `room` - 1 of them or so many
    steps, or t_end is reached.

    A step that would lead beyond t_end is replaced by one that ends there.  The sample at t_end is
    kept.
    failures : None in native code; in plain Python a list for what the failing step raised.
    """
    carry, mark = read(states, 0, layout), read(marked, 0, MARCHED)
    steps, since, last, n, ended = mark.steps, mark.since, h, 0, 0.0
    most, time, still = steps + most, system.clock(sample(method, carry)), mark.still
    while n < room - 1 and steps < most and ended == 0.0:
        trial = attempt(stepped, method, system, steps * h, carry, h, layout)
        if not accepted(trial, observed, shown):
            ended = 2.0
            if failures is not None:
                failures.append(reason(trial))
        elif (system.clock(trial[1]) - t_end) * h > 0.0:
            ended = 1.0
        elif still >= STILL:
            ended = 2.0
            if failures is not None:
                failures.append(
                    StepTooSmall(f"{STILL:g} steps went by and physical time stands still")
                )
        else:
            still = still + 1.0 if system.clock(trial[1]) == time else 0.0
            carry, steps, since, time = trial[0], steps + 1.0, since + 1.0, system.clock(trial[1])
            if time == t_end:
                ended = 3.0
            if since == every or ended == 3.0:
                write(out, n * shown.width, trial[1], shown)
                n = n + 1
            if since == every:
                since = 0.0
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


class TransformedRun:
    """One run in fictive time, from a start at a time or from where another one stands.

    whole : the system whose state carries time along.  now : where its motion begins.
    """

    def __init__(
        self, plan: Steps, start: State | FictiveCarry, t0: float, kept: Checkpoint | None = None
    ) -> None:
        self.now: Any
        self.carry: Any = None
        if isinstance(start, FictiveCarry):
            self.origin, self.carry, self.now, self.t0 = start.origin, start, start.inner, start.t
            self.bodies, self.before = start.bodies, start.step
        else:
            self.origin = Origin(plan.system, plan.method, start)
            self.t0, self.bodies, self.before = t0, start.bodies, 0
            self.now = self.origin.begun(t0)
        self.whole, self.plan, self.h, self.kept = (
            self.origin.whole,
            self.origin.steps(plan),
            plan.h,
            kept,
        )
        self.system, self.method = self.whole.system, plan.method
        self.way = self.plan.way_of(0)
        if self.carry is None and self.bodies is None:
            doubt = self.method.step_warning(self.whole, self.now, self.h)
            if doubt:
                warn(doubt, StepWarning)
        if kept is not None:
            shown = kept.shown
            kept.shown = lambda run: shown(self.presented(run))

    def steps(self, steps: int) -> Trajectory:
        """So many steps of one length in fictive time, for one body or an ensemble."""
        with self._failures():
            made = FixedRun(self.plan, self.now, steps, checkpoint=self.kept).trajectory()
        return self.presented(made)

    def begun(self) -> FixedRun:
        """The run before its first step."""
        with self._failures():
            return FixedRun(self.plan, self.now, 0)

    @contextmanager
    def _failures(self) -> Iterator[None]:
        """Around the loop of steps of one length: the samples of a failed run are shown as those
        of a run in fictive time.
        """
        try:
            yield
        except BaseException as error:
            if isinstance(getattr(error, "trajectory", None), Trajectory):
                run = error.trajectory = self.presented(error.trajectory)  # type: ignore[attr-defined]
                if isinstance(error, IntegrationFailure) and error.reached is not None:
                    self.stopped(error, error.reached, self.before + run.steps)
            raise

    def stopped(self, error: IntegrationFailure, there: Any, steps: int) -> None:
        """Tell of a failure where the last step that was accepted led: a state of the extended
        system, after so many steps.
        """
        t, states, z = self.whole.apart({name: x[None] for name, x in there.arrays.items()})
        kind = type(self.origin.start)
        error.reached = small_state(kind, {name: x[0] for name, x in states.items()})
        error.clock = float(t[0]), steps * self.h, None if z is None else float(z[0])

    def march(
        self, t_end: float | None, limit: int, t_eval: Any, events: tuple[Event, ...]
    ) -> Trajectory:
        """As many steps as lead to a time, or to the limit, for one body, with samples at the times
        t_eval, and events.
        """
        if t_end is not None and self.carry is not None:
            near = NEAR * max(abs(t_end), abs(self.t0))
            if abs(t_end - self.t0) <= near:  # it stands there, but for rounding
                t_end = self.t0
        if t_end is not None and (t_end - self.t0) * self.h < 0.0:
            raise InvalidInput(
                f"integrate: t_end = {t_end:g} is not where steps of h = {self.h:g} lead from "
                f"{self.t0:g}; turn the sign of h"
            )
        times = None if t_end is None else arguments.times(t_eval, self.t0, t_end)
        return March(self, t_end, limit, times, events).trajectory()

    def presented(self, run: Trajectory) -> TransformedTrajectory:
        """Samples of the extended system as those of the system."""
        if isinstance(run, TransformedTrajectory):
            return run
        carry = FictiveCarry(self.origin, run.carry) if isinstance(run.carry, Carry) else None
        more = {"steps": run.steps, "compiled": run.compiled, "carry": carry}
        if run.bodies is None:
            numbers = np.concatenate(
                [_floats(x).reshape(len(run), -1) for x in run.states.values()], axis=1
            )
            tau, ahead = run.t, None if self.carry is None else self.carry.ahead
            if ahead is not None:  # the first sample is the last one before
                numbers[0], tau[0] = leaves(ahead, layout_of(ahead)), self.carry.tau
                if len(tau) > 1 and tau[1] == tau[0]:
                    numbers, tau = numbers[1:], tau[1:]
            return self.result(
                self.whole.apart(unpacked(layout_of(self.example), numbers))[0],
                numbers,
                tau,
                **more,
            )
        t, states, z = self.whole.apart(run.states)
        return self._made(t, states, run.t, bodies=run.bodies, stopped=run.stopped, z=z, **more)

    @property
    def example(self) -> Any:
        """A state of the extended system."""
        return self.now.state if isinstance(self.now, Carry) else self.now

    def result(
        self, t: np.ndarray, numbers: np.ndarray, tau: np.ndarray, **more: Any
    ) -> TransformedTrajectory:
        """A trajectory of one body: times, numbers of the samples of the extended system, (n,
        width), and fictive times.
        """
        _, states, z = self.whole.apart(unpacked(layout_of(self.example), numbers))
        if "dense" not in more:
            more["dense"] = self.motion(t, numbers)
        return self._made(t, states, tau, bodies=None, z=z, **more)

    def motion(self, t: np.ndarray, numbers: np.ndarray) -> Any:
        """The motion between samples of one body."""
        kind, carry, begun = type(self.origin.start), self.carry, None
        if carry is not None and carry.ahead is not None and t[0] == self.t0:
            begun = np.append(carry.inner.last, carry.tau - carry.inner.t)
        return FictiveMotion(
            self.way,
            self.whole,
            kind,
            self.example,
            self.h,
            t,
            numbers,
            self.plan.compiled,
            begun,
        ).of_shape(self.plan.shapes.get((layout_of(self.example), False)))

    def _back(self, t: np.ndarray) -> bool:
        """Does physical time go back?"""
        later, before = (t[1:], t[:-1]) if self.h > 0.0 else (t[:-1], t[1:])
        return bool((later < before).any())

    def _made(
        self, t: np.ndarray, states: Any, tau: np.ndarray, **more: Any
    ) -> TransformedTrajectory:
        carry = more.pop("carry", None)
        known: dict[str, Any] = {"system": self.system, "method": self.method, "h": self.h}
        known |= {"t": t, "states": states, "tau": tau, "origin": self.origin, "stopped": NONE}
        rest = SimpleNamespace(carry=carry if callable(carry) else lambda: carry)
        made: Any = TransformedTrajectory.promised(rest, **known | more)
        if self._back(t):
            error = InvalidTimeScale(
                "integrate: physical time went back; "
                f"{self.whole.sigma!r} is not positive all the way"
            )
            error.trajectory = made
            raise error
        return made


class March:
    """One run of one body to a given time, or with events: its samples and its progress.

    fine : are all steps kept while it lasts, because samples at times or events are between them?
    """

    def __init__(
        self,
        run: TransformedRun,
        t_end: float | None,
        limit: int,
        times: np.ndarray | None,
        events: tuple[Event, ...],
    ) -> None:
        self.run, self.t_end, self.times = (
            run,
            math.copysign(math.inf, run.h) if t_end is None else t_end,
            times,
        )
        self.limit, self.fine = run.before + limit, times is not None or bool(events)
        self.every = 1 if self.fine else run.plan.every
        self.shape, self.states, first = self._begun()
        self.layout, self.shown = self.shape.layout, self.shape.shown
        if self.shape.column is None:
            self.shape.column = _column(run.whole.apart, self.shown)
        self.column = self.shape.column
        self.marked = np.zeros(MARCHED.width)
        self._mark: Any = None
        self.marked[:2] = run.before, run.before % self.every
        tau = run.before * run.h
        if run.carry is not None and run.carry.ahead is not None:
            first, tau = np.array(leaves(run.carry.ahead, self.shown)), run.carry.tau
        self.rows = [first.reshape(1, -1).copy()]
        self.taus = [np.array([tau])]
        self.failures: list[Any] = []
        none = np.empty(1)
        self.arguments = (
            run.way,
            run.whole,
            self.layout,
            self.shown,
            run.h,
            self.t_end,
            float(self.every),
        )
        self.execution = self.shape.other(march, *self.arguments, 1, 1.0, none, none, none, None)
        # where an event ended the run, a terminal one or one that failed
        self.at: float | None = None
        self.looking: FictiveMotion | None = None
        self.watch: Any = None
        if events:
            start = run.carry.state if run.carry is not None else run.origin.start
            self.first = small_state(type(start), start.arrays)
            met = None if run.carry is None else run.carry.met
            self.watch = Watch(events, self._ended, run.t0, self.first, met)

    def _begun(self) -> tuple[Shape, np.ndarray, np.ndarray]:
        """What is prepared, what the method carries along at the start, and the first sample."""
        run = self.run
        shape = run.plan.shapes.get((layout_of(run.now), False)) if run.carry is None else None
        if shape is not None:
            memory = np.empty(shape.carried + shape.sampled)
            if shape.begin(run.now, memory):
                return shape, memory[: shape.carried - 1], memory[shape.carried :]
        begun = run.begun()
        return begun.shape, begun.states[:-1, 0].copy(), begun.out[0, :, 0]

    @property
    def mark(self) -> Any:
        """How far it came."""
        if self._mark is None:
            self._mark = read(self.marked, 0, MARCHED)
        return self._mark

    def trajectory(self) -> TransformedTrajectory:
        """Step to t_end, in pieces short enough to be interrupted."""
        plan, kept = self.run.plan, self.run.kept
        steps = 16 if self.execution.native is None else SOME
        try:
            with Bar(plan.progress, 1000, "") as bar:
                while not self.mark.ended and self.at is None and self._time() != self.t_end:
                    if self.mark.steps >= self.limit:
                        if math.isinf(self.t_end):
                            break
                        reached = f"{self.limit - self.run.before} steps led to t = {self._time():g} only, not to {self.t_end:g}"
                        raise self._stopped(
                            StepTooSmall(
                                f"integrate: {reached}; give a larger h or allow more `steps`"
                            )
                        )
                    begun = time.perf_counter()
                    most, taken = min(steps, self.limit - int(self.mark.steps)), self.mark.steps
                    self._more(most if kept is None else kept.within(most))
                    used = time.perf_counter() - begun
                    steps = (
                        2 * steps
                        if used < 0.5 * LOOK
                        else max(1, steps // 2)
                        if used > 4.0 * LOOK
                        else steps
                    )
                    bar.advance(int(1000 * self._part()) - bar.done)
                    due = kept is not None and kept.due(int(self.mark.steps - taken))
                    if due and not self.mark.ended and self.at is None:
                        kept.save(self._result())  # type: ignore[union-attr]
        except KeyboardInterrupt:
            stopped = IntegrationInterrupted(
                f"integrate: interrupted at t = {self._time():g}; the samples are in `.trajectory`"
            )
            raise self._ended(stopped) from None
        if self.mark.ended == 2.0:
            raise self._failed()
        return self._result()

    def _more(self, most: int) -> None:
        """Up to so many more steps."""
        room = most // self.every + 2
        if not self.execution.ready(self._part()):
            with self.execution.plain():
                self._piece(march, room, most)
            return
        self._piece(self.execution.native, room, most)
        if self.mark.ended == 2.0:  # plain Python says why, or goes on where native code cannot
            self.marked[-1], self._mark = 0.0, None
            self._piece(march, room, most)

    def _piece(self, driver: Any, room: int, most: int) -> None:
        """A call of the driver; its samples are kept."""
        before, width, h = self.mark, self.shown.width, self.run.h
        out, states, marked = np.empty(room * width), self.states.copy(), self.marked.copy()
        if driver is march:
            march(*self.arguments, room, float(most), states, marked, out, self.failures)
        else:
            numbers = array("d", (*self.arguments[4:], float(most))).tobytes()
            driver.run(self.shape.constants + numbers, (room,), (states, marked, out))
        mark: Any = read(marked, 0, MARCHED)
        count = int(mark.samples)
        if count:
            tau = before.steps - before.since + self.every * np.arange(1.0, count + 1.0)
            tau = tau * h
            if mark.ended == 1.0:
                tau[-1] = (mark.steps - 1.0) * h + mark.last
            elif mark.ended == 3.0:
                tau[-1] = mark.steps * h
            rows, first = (
                out[: count * width].reshape(count, width),
                int(tau[0] == self.taus[-1][-1]),
            )
            if first < count:  # else the only sample is the one that the run before ended with
                self.rows.append(rows[first:])
                self.taus.append(tau[first:])
        self.states, self.marked, self._mark = states, marked, mark
        if self.watch is not None and count:
            self._look()

    def _look(self) -> None:
        """Look for events in the last piece; a terminal one ends the run."""
        if len(self.rows) < 2:
            return
        points = np.concatenate([self.rows[-2][-1:], self.rows[-1]])
        times = self._clock(points)
        if self.mark.ended == 1.0:
            times[-1] = self.t_end
        self.looking = motion = self.run.motion(times, points)
        hit = self.watch.look(motion)
        if hit is not None:
            self._cut(hit[0], hit[1])
        self.looking = None

    def _cut(self, k: int, at: float) -> None:
        """End the run in step k of the last piece, at a time."""
        motion: Any = self.looking
        found, taus = (
            motion.numbers(np.array([at])),
            np.concatenate([self.taus[-2][-1:], self.taus[-1]]),
        )
        last = int(at != motion.t[k])
        self.rows[-1] = np.concatenate([motion.points[1 : k + 1], found[:last, :-1]])
        self.taus[-1] = np.append(taus[1 : k + 1], taus[k] + found[:last, -1])
        self.at = at

    # ---------------------------------------------------------------- results

    def _clock(self, rows: np.ndarray) -> np.ndarray:
        return rows[:, self.column].copy()

    def _time(self) -> float:
        """Where the last sample is."""
        return float(self._clock(self.rows[-1][-1:])[0])

    def _part(self) -> float:
        """How much of the run is done."""
        if math.isinf(self.t_end):
            return (self.mark.steps - self.run.before) / max(1, self.limit - self.run.before)
        return (
            (self._time() - self.run.t0) / (self.t_end - self.run.t0)
            if self.t_end != self.run.t0
            else 1.0
        )

    def _carry(self) -> FictiveCarry | None:
        """Where it stands, unless a step failed or an event ended it."""
        mark = self.mark
        if mark.ended == 2.0 or self.at is not None:
            return None
        whole, h = int(mark.steps) - (mark.ended == 1.0), self.run.h
        last = sample(self.run.method, read(self.states, 0, self.layout))
        numbers = np.append(self.states, float(whole))
        inner = Carry(self.shape, 0.0, h, whole, None, numbers, np.array(leaves(last, self.shown)))
        tau, met = float(self.taus[-1][-1]), NO_EVENTS if self.watch is None else self.watch.met
        if (tau - whole * h) * h <= 0.0:
            return FictiveCarry(self.run.origin, inner, met=met)
        ahead = build(self.shown, iter(self.rows[-1][-1].tolist()))
        return FictiveCarry(self.run.origin, inner, ahead, tau, met)

    def _result(self) -> TransformedTrajectory:
        run, numbers, tau = self.run, np.concatenate(self.rows), np.concatenate(self.taus)
        times, carry = self._clock(numbers), self._carry
        if self.mark.ended == 1.0:
            times[-1] = self.t_end
        steps = int(self.mark.steps) - run.before
        if self.at is not None:
            times[-1], steps = self.at, len(tau) - 1
        more: dict[str, Any] = {"steps": steps, "compiled": self.execution.native is not None}
        if self.watch is not None:
            more["events"] = self.watch.shown(self.first, layout_of(self.first))
            more["ended"] = self.watch.ended
        if self.fine and self.times is None:
            whole = np.rint(tau / run.h)
            kept = (whole % run.plan.every == 0) & (whole * run.h == tau)
            kept[[0, -1]] = True
            times, numbers, tau = times[kept], numbers[kept], tau[kept]
        if self.times is None or run._back(times):
            return run.result(times, numbers, tau, carry=carry, **more)
        sign, motion = math.copysign(1.0, run.h), run.motion(times, numbers)
        asked = self.times[sign * self.times <= sign * times[-1]]
        found = motion.numbers(asked)
        tau = tau[np.searchsorted(sign * times, sign * asked, "right") - 1] + found[:, -1]
        return run.result(asked, found[:, :-1], tau, carry=carry, dense=motion, **more)

    def _failed(self) -> Any:
        """The error of a run that a step ended: a mistake in a formula, or a failure."""
        error = self.failures[0] if self.failures else None
        at = f"step {int(self.mark.steps) + 1}, t = {self._time():g}"
        if isinstance(error, Exception) and is_mistake(error):
            error.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
            return self._ended(error)
        at += f"; {sum(map(len, self.rows))} samples are in `.trajectory`"
        return self._stopped(failure(error, repr(self.run.method), at))

    def _stopped(self, error: IntegrationFailure) -> Any:
        there = sample(self.run.method, read(self.states, 0, self.layout))
        self.run.stopped(error, there, int(self.mark.steps))
        return self._ended(error)

    def _ended(self, error: Any) -> Any:
        if self.looking is not None:  # an event itself failed: keep the steps up to it
            k = self.watch.looked
            self._cut(k, self.looking.t[k])
            self.looking = None
        error.trajectory = self._result()
        return error


def _floats(array: np.ndarray) -> np.ndarray:
    """Numbers, a complex one as two."""
    array = np.ascontiguousarray(array)
    return array.view(float) if np.iscomplexobj(array) else array


def _column(apart: Any, shown: Any) -> int:
    """Where in the numbers of a sample its physical time is."""
    return int(apart(unpacked(shown, np.arange(shown.width, dtype=float)[None]))[0][0])
