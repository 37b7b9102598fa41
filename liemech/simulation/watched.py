"""Steps of one length with samples at any times, and with events: the motion between the steps is
that of shorter ones.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..errors import IntegrationFailure, IntegrationInterrupted
from ..systems.system import State
from .carry import Carry
from .checkpoint import Checkpoint
from .dense import ShortSteps, unpacked
from .events import Event, Watch
from .fixed_run import FixedRun
from .prepared import Steps
from .progress import Bar
from .systems import OfBodies
from .trajectory import Trajectory

CHUNK, LARGEST = 8, 512
"""Steps between two looks at the events: at first, and at most."""

NEAR = 4 * np.finfo(float).eps
"""Times that differ by this part of them are those of one step."""


def sampled(
    plan: Steps,
    start: State | Carry,
    steps: int,
    t0: float,
    times: np.ndarray,
    checkpoint: Checkpoint | None = None,
) -> Trajectory:
    """A run whose samples are at these times: after the last whole step before each, a shorter one."""
    before = start.step if isinstance(start, Carry) else 0
    after, exact = _steps_before(times, t0, plan.h_of(0))
    row = after - before
    needed = row + ~exact
    marks = np.unique(np.append(row[row > 0], [steps] if steps else []).astype(np.int64))
    run = SampledRun(plan, start, steps, t0, marks, checkpoint)
    run.needed = needed
    at = np.searchsorted(np.concatenate([[0], marks]), row)

    def so_far(part: Trajectory) -> Trajectory:
        some = needed <= part.steps
        return _between(plan, run, part, times[some], after[some], at[some], exact[some])

    if checkpoint is not None:
        shown = checkpoint.shown
        checkpoint.shown = lambda part: shown(so_far(part))
    try:
        whole = run.trajectory()
    except (Exception, IntegrationInterrupted) as caught:
        error: Any = caught
        if hasattr(error, "trajectory"):
            error.trajectory = so_far(error.trajectory)
        raise
    return _between(plan, run, whole, times, after, at, exact)


class SampledRun(FixedRun):
    """The whole steps of such a run.  needed : how many of them every sample needs."""

    needed: np.ndarray

    def _kept(self, steps: int) -> int:
        return int((self.needed <= steps).sum())


def _between(
    plan: Steps,
    run: FixedRun,
    whole: Trajectory,
    times: np.ndarray,
    after: np.ndarray,
    at: np.ndarray,
    exact: np.ndarray,
) -> Trajectory:
    """The samples at these times, of a run that has kept the whole steps before them.

    after : how many steps there are before each.  at : the number of the sample after these.
    exact : does the last of these steps end at the time?
    """
    shape = run.shape
    numbers = np.moveaxis(run.out[at][..., : run.count], 1, -1).copy()  # (times, bodies, width)
    moving = np.repeat(~exact[:, None], run.count, axis=1)
    for body, stop in whole.stopped.items():
        moving[:, body] &= after < stop.steps
    if moving.any():
        begun, asked = (
            np.repeat(x[:, None], run.count, axis=1)[moving] for x in (whole.t[at], times)
        )
        found = numbers[moving]
        bodies = (
            np.nonzero(moving)[1]
            if isinstance(plan.system, OfBodies) or isinstance(plan.method, OfBodies)
            else np.zeros(len(begun), dtype=int)
        )
        for i in np.unique(bodies):
            of = bodies == i
            motion = ShortSteps(
                plan.of(int(i)),
                plan.way_of(int(i)),
                shape.example,
                begun[of],
                found[of],
                plan.compiled,
            )
            try:
                found[of] = motion.moved(np.arange(len(motion.t)), asked[of])
            except IntegrationFailure as error:
                n = int(
                    np.nonzero(moving)[0][of][getattr(error, "row", 0)]
                )  # the first that failed
                before = times[:n], after[:n], at[:n], exact[:n]
                error.trajectory = _between(plan, run, whole, *before)
                raise
        numbers[moving] = found
    states = unpacked(shape.shown, numbers[:, 0] if run.bodies is None else numbers)
    return dataclasses.replace(whole, t=times, states=states)


def _steps_before(times: np.ndarray, t0: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """How many whole steps lead to each time, and whether they lead there exactly, but for rounding
    of the time.
    """
    near = np.rint((times - t0) / h)
    exact = np.abs(times - (t0 + near * h)) <= NEAR * np.maximum(np.abs(times), abs(t0))
    return np.where(exact, near, np.floor((times - t0) / h)).astype(np.int64), exact


class WatchedRun:
    """A run of one body with events: step for step, in chunks, between which Python looks at them."""

    def __init__(
        self,
        plan: Steps,
        start: State | Carry,
        steps: int,
        t0: float,
        times: np.ndarray | None,
        events: tuple[Event, ...],
        checkpoint: Checkpoint | None = None,
    ) -> None:
        self.plan, self.steps, self.times, self.checkpoint = plan, steps, times, checkpoint
        self.fine = dataclasses.replace(plan, every=1, progress=False)
        begun = FixedRun(self.fine, start, 0, t0)
        self.carry: Carry = begun.trajectory().carry
        self.shape, self.before, self.t0 = begun.shape, self.carry.step, self.carry.t0
        self.done, self.reached = 0, self.carry.t
        self.looking: tuple[FixedRun, Trajectory] | None = None
        self.kept: list[tuple[np.ndarray, np.ndarray]] = []  # times and numbers of samples
        self._keep(np.array([self.carry.t]), self.carry.last.reshape(1, -1), None)
        self.watch: Any = None
        met = start.met if isinstance(start, Carry) else None
        self.watch = Watch(events, self._ended, self.carry.t, self.carry.state, met)

    def trajectory(self) -> Trajectory:
        """Step to the end, or to the first terminal event."""
        try:
            return self._trajectory()
        except IntegrationInterrupted:
            raise
        except KeyboardInterrupt:  # not in a step, nor in an event
            stopped = IntegrationInterrupted(
                f"integrate: interrupted after {self.before + self.done} of "
                f"{self.before + self.steps} steps, t = {self.reached:g}; the samples are in "
                "`.trajectory`"
            )
            raise self._ended(stopped) from None

    def _trajectory(self) -> Trajectory:
        chunk = CHUNK
        with Bar(self.plan.progress, self.steps) as bar:
            while self.done < self.steps:
                n = min(chunk, self.steps - self.done)
                if self.checkpoint is not None:
                    n = self.checkpoint.within(n)
                run = FixedRun(self.fine, self.carry, n)
                run.whole, run.earlier = self.steps - self.done, self.done
                try:
                    taken = run.trajectory()
                except (Exception, KeyboardInterrupt) as error:
                    if hasattr(error, "trajectory"):
                        self._look(run, error.trajectory)
                        raise self._ended(error) from error.__cause__
                    raise
                self.looking = run, taken
                if self._look(run, taken):
                    return self._result(None)
                self.carry = taken.carry
                bar.advance(n)
                if self.checkpoint is not None and self.checkpoint.due(n):
                    self.checkpoint.save(self._result(self.carry))
                chunk = min(2 * chunk, LARGEST)
        return self._result(self.carry)

    def _look(self, run: FixedRun, taken: Trajectory) -> bool:
        """Look for events in these steps, and keep what is to be kept of them; did a terminal event
        end the run?
        """
        points = run.out[: len(taken), :, 0]
        motion = ShortSteps(
            taken.system,
            self.plan.way_of(0),
            self.shape.example,
            taken.t,
            points,
            self.plan.compiled,
        )
        hit = self.watch.look(motion) if taken.steps else None
        self.looking = None
        t, numbers = taken.t[1:], points[1:]
        if hit is not None:
            k, at, last = hit
            t, numbers = np.append(t[:k], at), np.concatenate([numbers[:k], last[None]])
        self._keep(t, numbers, motion)
        self.done += len(t)
        return hit is not None

    def _keep(self, t: np.ndarray, numbers: np.ndarray, motion: ShortSteps | None) -> None:
        """Keep of these steps the samples that were asked for."""
        if not len(t):
            return
        before, self.reached = self.reached, float(t[-1])
        if self.times is None:
            number = self.before + self.done + 1 + np.arange(len(t))
            kept = (
                (number % self.plan.every == 0)
                | (number == self.before + self.steps)
                | (motion is None)
            )
            if motion is not None and t[-1] != motion.t[len(t)]:  # a terminal event
                kept[-1] = True
            self.kept.append((t[kept], numbers[kept]))
            return
        forward = self.plan.h_of(0) > 0.0
        past = self.times <= before if forward else self.times >= before
        ahead = self.times > self.reached if forward else self.times < self.reached
        times = self.times[~ahead] if motion is None else self.times[~past & ~ahead]
        if len(times):
            self.kept.append(
                (
                    times,
                    np.repeat(numbers, len(times), axis=0)
                    if motion is None
                    else motion.numbers(times),
                )
            )

    def _result(self, carry: Carry | None) -> Trajectory:
        if carry is not None:
            carry = dataclasses.replace(carry, met=self.watch.met)
        t, numbers = (
            np.concatenate([pair[i] for pair in self.kept]) if self.kept else np.empty(0)
            for i in (0, 1)
        )
        numbers = numbers.reshape(len(t), self.shape.shown.width)
        return Trajectory(
            self.plan.system,
            self.plan.method,
            self.plan.h,
            t,
            unpacked(self.shape.shown, numbers),
            None,
            self.done,
            self.shape.stepping.native is not None,
            events=self.watch.shown(self.shape.example, self.shape.shown) if self.watch else (),
            carry=carry,
            breaks=self.plan.breaks,
            ended=self.watch.ended if self.watch else None,
        )

    def _ended(self, error: Any) -> Any:
        if self.looking is not None:  # an event itself failed: keep the steps up to it
            (run, taken), n = self.looking, self.watch.looked
            points = run.out[: len(taken), :, 0]
            motion = ShortSteps(
                taken.system,
                self.plan.way_of(0),
                self.shape.example,
                taken.t,
                points,
                self.plan.compiled,
            )
            self._keep(taken.t[1 : n + 1], points[1 : n + 1], motion)
            self.done, self.looking = self.done + n, None
        error.trajectory = self._result(None)
        return error
