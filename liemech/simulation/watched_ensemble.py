"""Ensembles with events and steps of one length: all bodies step side by side, and their events are
looked at together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from ..compiler import kernel
from ..errors import IntegrationFailure, IntegrationInterrupted, is_mistake
from ..formulas.pytree import build
from .carry import Carries, Carry, each
from .dense import ShortSteps, unpacked
from .events import NativeEvents, Unseen, Watch, Watches, unseen
from .fixed_run import FixedRun
from .one_by_one import OneByOne
from .progress import Bar
from .systems import OfBodies
from .trajectory import Trajectory

LARGEST, NUMBERS = 512, 2**21
"""Steps between two looks at the events, and numbers of all samples of these, at most."""


class Cut(NamedTuple):
    """Where a terminal event ended the run of a body: after so many whole steps, when, in which
    state, and was that the end of a step?
    """

    steps: int
    t: float
    numbers: np.ndarray
    whole: bool


class Part(FixedRun):
    """A part of a run, which warns of nothing."""

    def _result(self, steps: int) -> Trajectory:
        return self._so_far(steps)


@contextmanager
def left_to_python() -> Iterator[None]:
    """Around steps and events: of those that fail, plain Python says why, and of which body."""
    try:
        yield
    except Exception as error:
        if isinstance(error, IntegrationFailure) or is_mistake(error):
            raise Unseen from error
        raise


class WatchedEnsemble(OneByOne):
    """A run of an ensemble with events: one body after another until native code of the events is
    there, then all at once.

    done : steps of all bodies so far.  kept_rows : times, numbers of the steps, and of the states
    (n, bodies, width), of the samples that are kept.  cuts : of bodies that an event has ended.
    own : the runs of those that failed, alone.
    """

    first: int | None = None
    alone = False
    """Must every body run alone, because native code cannot look at the events?"""

    @staticmethod
    def fits(plan: Any, start: Any, t_end: Any, t_eval: Any) -> bool:
        """Do all bodies take the same number of steps, and may there be native code?"""
        apart = t_eval is not None or isinstance(start, Carries)
        apart = apart or (t_end is not None and ("h" in plan.of_each or np.ndim(t_end) > 0))
        native = plan._given["compiled"] is not False and kernel.available() is None
        return bool(plan.events) and not apart and native

    def _side_by_side(self, first: int, bar: Bar) -> bool:
        if self.alone:
            return False
        try:
            with left_to_python():
                native = self._native_events()
                if not native.ready():
                    return False
                self._begin(native, first)
            self._march(bar)
        except KeyboardInterrupt:
            if self.first is None:
                raise self._interrupted(first) from None
            for i, watch in self.watches.each.items():
                watch.forget(self.reached[i], self.h[i], i in self.cuts)
            told = f"integrate: interrupted after {self.done} of {self.whole} steps of all bodies"
            stopped = IntegrationInterrupted(f"{told}; the samples are in `.trajectory`")
            stopped.trajectory = self.joined()
            raise stopped from None
        except Unseen:
            self.first, self.alone = None, True
            return False
        return True

    def _native_events(self) -> NativeEvents:
        """The events, for states like the first sample of the first body."""
        plan, begun = self.plan_of(0)._steps, self.begun(0)
        run = Part(plan, begun if isinstance(begun, Carry) else begun.state, 0, begun.t)
        example, point = run.shape.example, run.out[:1, :, 0]
        motion = ShortSteps(plan.of(0), plan.way_of(0), example, np.zeros(1), point, plan.compiled)
        return NativeEvents(self.plan.events, motion)

    def _begin(self, native: NativeEvents, first: int) -> None:
        """Watch all bodies from where they stand."""
        start, steps = self._start, self.plan._steps
        self.inner = dataclasses.replace(steps, every=1, progress=False)
        run = Part(self.inner, start, 0, self._t0)
        self.shape, self.now, self.before = run.shape, start, run.before
        self.whole = self.plan._count(self._steps, self._end, run.t0, run.before)
        self.done, self.members = 0, None
        self.h = np.broadcast_to(np.array(steps.h), self.count)
        self.reached = run.t0 + run.before * self.h
        self.watches = Watches(native, self.count)
        self.alive = run.taken[: self.count] == run.before
        points = np.moveaxis(run.out[:1, :, : self.count], 1, -1).copy()
        self.kept_rows = [(run.times(1, 0), np.array([run.before]), points)]
        self.cuts: dict[int, Cut] = {}
        self.own: dict[int, Trajectory] = {}
        met = getattr(start, "met", None)
        for i in np.flatnonzero(self.alive).tolist():
            state, t = build(self.shape.shown, iter(points[0, i].tolist())), float(self.reached[i])
            self.watches.add(i, Watch(self.plan.events, unseen, t, state, met))
        self._fail(np.flatnonzero(~self.alive))
        self.first = first

    def _march(self, bar: Bar) -> None:
        """Steps of all bodies, in pieces between which their events are looked at."""
        kept, shown = self.kept, self.first
        size = self.count * self.shape.shown.width
        while self.done < self.whole and self.alive.any():
            n = max(1, min(LARGEST, self.whole - self.done, NUMBERS // size))
            if kept is not None:
                n = max(1, min(n, kept.within(n * self.count) // self.count))
            with left_to_python():
                self._piece(n)
            reached = self.first + (self.count - self.first) * self.done // self.whole
            bar.advance(reached - shown)
            shown = reached
            if kept is not None and kept.due(n * self.count):
                kept.save(self.joined())

    def _piece(self, n: int) -> None:
        """So many steps of all bodies, with their events."""
        run = Part(self.inner, self.now, n, self._t0)
        part = run.trajectory()
        t = run.times(n + 1, n)
        cuts = self._look(run, n, t if t.ndim == 2 else np.repeat(t[:, None], self.count, axis=1))
        failed = self.alive & (run.taken[: self.count] < run.before + n)
        failed[[*cuts]] = False
        self._keep(run, n, t)
        self.done, self.now, self.reached = self.done + n, part.carry, self.h * 0.0 + t[-1]
        self.cuts |= cuts
        self.alive[[*cuts]] = False
        self.alive &= ~failed
        self._fail(np.flatnonzero(failed))

    def _look(self, run: FixedRun, n: int, t: np.ndarray) -> dict[int, Cut]:
        """Look for events in these steps; what terminal ones ended.  t : (n + 1, bodies)."""
        taken = run.taken[: self.count] - run.before
        column, turn = np.nonzero((np.arange(n) < taken[:, None]) & self.alive[:, None])
        if not len(turn):
            return {}
        a, b, out = t[turn, column], t[turn + 1, column], run.out

        def where(step: np.ndarray, times: np.ndarray) -> np.ndarray:
            found = out[turn[step] + 1, :, column[step]]
            before = times == a[step]
            found[before] = out[turn[step[before]], :, column[step[before]]]
            inside = np.flatnonzero((times != b[step]) & ~before)
            some = step[inside]
            points = out[turn[some], :, column[some]]
            found[inside] = self._moved(column[some], a[some], points, times[inside])
            return found

        hits = self.watches.look(column, out[turn + 1, :, column], a, b, where)
        return {
            i: Cut(self.done + int(turn[step]), at, numbers.copy(), at == b[step])
            for i, (step, at, numbers) in hits.items()
        }

    def _moved(
        self, body: np.ndarray, begun: np.ndarray, points: np.ndarray, times: np.ndarray
    ) -> np.ndarray:
        """The states at these times, a shorter step after others."""
        plan, found = self.plan._steps, np.empty(points.shape)
        several = isinstance(plan.system, OfBodies) or isinstance(plan.method, OfBodies)
        for i in np.unique(body).tolist() if several else [0][: len(body)]:
            of = body == i if several else np.full(len(body), True)
            given = plan.of(i), plan.way_of(i), self.shape.example, begun[of], points[of]
            found[of] = ShortSteps(*given, plan.compiled).moved(np.arange(of.sum()), times[of])
        return found

    def _keep(self, run: FixedRun, n: int, t: np.ndarray) -> None:
        """Keep of these steps the samples that were asked for."""
        number, last = run.before + 1 + np.arange(n), self.before + self.whole
        kept = np.flatnonzero((number % self.plan._steps.every == 0) | (number == last))
        if len(kept):
            points = np.moveaxis(run.out[1:][kept][..., : self.count], 1, -1)
            self.kept_rows.append((t[1:][kept], number[kept], points))

    def _fail(self, bodies: np.ndarray) -> None:
        """Bodies that failed once more, alone: then they say why."""
        for i in bodies.tolist():
            try:
                self.own[i] = self._alone(i, self.begun(i), None)
            except IntegrationFailure as error:
                self.errors[i], self.own[i] = error, error.trajectory

    # ---------------------------------------------------------------- the run of every body

    def _all_runs(self, unfinished: Trajectory | None) -> list[Trajectory]:
        if self.first is None:
            return super()._all_runs(unfinished)
        rows = tuple(np.concatenate(some) for some in zip(*self.kept_rows, strict=True))
        members = (None,) * self.count  # none goes on, or none has begun
        if self.done and self.now is not None:
            members = each(self.now)
        first = range(self.first, self.count)
        return [*self.runs, *(self._run_of(i, rows, members[i]) for i in first)]

    def _run_of(self, i: int, rows: Any, member: Any) -> Trajectory:
        """The run of one body, as it would be alone."""
        if i in self.own or not self.done:
            return self.own[i] if i in self.own else self._not_begun(i)
        t, number, points = rows
        plan, cut, watch, steps = (
            self.plan_of(i)._steps,
            self.cuts.get(i),
            self.watches.each[i],
            self.done,
        )
        t, points = t if t.ndim == 1 else t[:, i], points[:, i]
        some = number <= self.before + (steps if cut is None else cut.steps)
        t, points = t[some], points[some]
        if cut is not None:
            steps = cut.steps + 1
            reached = self.before + steps
            if not cut.whole or reached % plan.every == 0 or reached == self.before + self.whole:
                t, points = np.append(t, cut.t), np.concatenate([points, cut.numbers[None]])
        carry = None
        if cut is None and isinstance(member, Carry):
            carry = dataclasses.replace(member, met=watch.met)
            vars(carry)["state"] = member.state
        return Trajectory(
            plan.system, plan.method, plan.h, t, unpacked(self.shape.shown, points), None, steps,
            True, events=watch.shown(self.shape.example, self.shape.shown), carry=carry,
        )  # fmt: skip
