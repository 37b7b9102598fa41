"""Runs in fictive time: of fixed steps there, of many lengths in physical time, which is carried along and
met exactly.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import numpy as np

from ...compiler.driver import read
from ...errors import IntegrationFailure, InvalidInput, InvalidTimeScale, StepTooSmall, StepWarning, warn
from ...formulas.classes.layouts import build, leaves
from ...simulation import arguments
from ...simulation.between.dense import unpacked
from ...simulation.compiled.control import ANEW, GOAL, LAST_TIME, LIMIT, MARK, STUCK, TAKEN, TIME, Fictive, sample
from ...simulation.compiled.prepared import shown_step
from ...simulation.compiled.systems import OfBodies, Systems
from ...simulation.keep import AtTimes, Dense, Every, PieceOfBodies
from ...simulation.result import InPhysicalTime
from ...simulation.runs.carry import Carry
from ...simulation.runs.equal import NEAR, EqualRun, StraightRun
from ...simulation.trajectory import TransformedTrajectory
from ...systems.system import state_of
from .arrival import FictiveMotion
from .origin import FictiveCarry, Origin, origin_of


class OfClocked(EqualRun):
    """A run of a system whose state carries physical time along, shown as one of the system itself;
    abstract.

    origin : where the motion began; of bodies that go each their own way a tuple.  wholes : the systems
    with their clocks, of each body or one for all.
    """

    run_of: ClassVar[Any] = TransformedTrajectory
    streams = False
    origin: Any
    wholes: list[Any]

    @functools.cached_property
    def view(self) -> InPhysicalTime:
        return InPhysicalTime(self.lanes.example, self.wholes[0], self._kind)

    @property
    def _kind(self) -> Any:
        """The class of states of the system without its clock."""
        first = self.origin[0] if isinstance(self.origin, tuple) else self.origin
        return type(first.start)

    def _system(self) -> Any:
        if not self.bodies or not isinstance(self.plan.system, OfBodies):
            return self.wholes[0].system
        return Systems(tuple([whole.system for whole in self.wholes]))

    def first_sample(self) -> dict[str, Any]:
        fields: dict[str, Any] = super().first_sample()
        physical, states, z = self.wholes[0].apart(fields["states"])
        origin = self.origin if self.bodies else self.alone
        own_fields = {"system": self._system(), "t": physical, "states": states}
        return fields | own_fields | {"tau": np.zeros(1), "z": z, "origin": origin}

    def known(self, i: int | None) -> dict[str, Any]:
        if i is None:
            return {"h": shown_step(self.way.h), "system": self._system(), "origin": self.origin}
        origin = origin_of(self.origin, i) if self.bodies else self.alone
        fields = {"h": self.h.item(i), "system": origin.whole.system, "origin": origin}
        if not self.bodies:
            t, numbers = self.ends_of_steps()
            first_state = self.inside_at_start(0) if len(t) and t[0] == self.t0[0] else None
            fields["dense"] = FictiveMotion(
                self.way.way_of(0), self.wholes[0], self._kind, self.lanes.example, self.h.item(0),
                np.column_stack([t, numbers]), self.compiled_asked, first_state,
            )  # fmt: skip
        return fields

    @property
    def alone(self) -> Origin:
        """The origin of a run of one body."""
        return self.origin[0] if isinstance(self.origin, tuple) else self.origin

    def ends_of_steps(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and numbers of the samples of one body, between which `Trajectory.at` finds its motion."""
        return self.samples(0)

    def inside_at_start(self, i: int) -> np.ndarray | None:
        """For a body that goes on from inside of a step: the numbers where that step begins, and the
        fictive time from there; None for others.
        """
        return None

    def _doubts(self, now: Any) -> None:
        """Warn of a step from here that may have no solution."""
        doubt = self.system_and_method(0)[1].step_warning(self.wholes[0], now, float(self.h[0]))
        if doubt:
            warn(doubt, StepWarning)

    def trajectory(self) -> Any:
        """Take all bodies to their goals.  Raises InvalidTimeScale if physical time went back."""
        trajectory = super().trajectory()
        t = trajectory.t if self.h[0] > 0.0 else trajectory.t[::-1]
        if (t[1:] < t[:-1]).any():
            error = InvalidTimeScale(
                f"integrate: physical time went back; {self.wholes[0].sigma!r} is not positive all the way"
            )
            error.trajectory = trajectory
            raise error
        return trajectory


class FictiveRun(OfClocked):
    """A run of fixed steps in fictive time to given physical times, with events, or of bodies with
    clocks of their own.

    Behind the numbers of a state in `here`, and in samples, its fictive time stands.
    timeless : the errors of bodies whose time scale has no value at the start.
    """

    control: Any = Fictive()
    extra: Any = 0.0

    def aim(self, ends: list[Any], steps: Any) -> None:
        before, bodies = self.before, range(self.count)
        least = 0 if ends[0] is None else 1
        limit = arguments.MOST // 2 if steps is None else arguments.count(steps, "steps", least)
        self.h = h = np.array([self.way.h_of(i) for i in bodies])
        if before is not None:
            self.first = before.clock[TAKEN].reshape(-1).copy()
        self.zero, self.sign = np.zeros(self.count), np.copysign(1.0, h)
        self.aims = np.zeros((GOAL.width, self.count))
        self.aims[LIMIT] = self.first + limit
        self.t_end = np.array([s * np.inf if end is None else end for s, end in zip(self.sign, ends, strict=True)])
        for i in np.flatnonzero(~self.over).tolist():
            t, end = self.t0.item(i), self.t_end.item(i)
            has_goal = ends[i] is not None and before is not None
            if has_goal and abs(end - t) <= NEAR * max(abs(end), abs(t)):
                end = self.t_end[i] = t  # it stands there, but for rounding
            if (end - t) * h[i] < 0.0:
                raise InvalidInput(
                    f"integrate: t_end = {end:g} is not where steps of h = {h[i]:g} lead from {t:g}; turn the sign of h"
                )
        self.aims[LAST_TIME] = self.t_end
        if before is None:
            self.origin = tuple([Origin(*self.system_and_method(i), self.start_of(i)) for i in bodies])
        else:
            origins = self.start.origin
            self.origin = tuple([origin_of(origins, i) for i in bodies]) if self.bodies else (origins,)
        self.wholes = [origin.whole for origin in self.origin]

    def begin(self) -> None:
        self.timeless: dict[int, Any] = {}
        if not self.bodies:
            self.way = self.origin[0].steps(self.plan._steps)
            if self.before is None:
                self._doubts(self.stepped)
        else:
            fields = {"system": Systems(tuple(self.wholes)), "shapes": {}, "clock": "tau"}
            self.way = dataclasses.replace(self.plan._steps, **fields)
        super().begin()
        clocks = self.lanes.parts(self.table[:, : self.count])[1]
        clocks[TIME] = self.here[1 + self._column()]
        parts = clocks[TIME][None], self.here[1:], (self.first * self.h)[None]
        self.here = self.step_begins = self.here_at_start = np.concatenate(parts)
        if self.before is not None and self.start.here is not None:
            self.here_at_start = self.start.here.reshape(self.here.shape)
            self.here = self.here_at_start.copy()
        at_goal = self.here[0] == self.t_end
        clocks[TIME, at_goal] = self.t_end[at_goal]
        for i, error in self.timeless.items():
            clocks[MARK, i], self.failures[i] = STUCK, [error]

    def _column(self) -> int:
        """The column of physical time in the numbers of a sample."""
        if self.shape.column is None:
            width = self.shape.shown.width
            parts = unpacked(self.shape.shown, np.arange(width, dtype=float)[None])
            self.shape.column = int(self.wholes[0].apart(parts)[0][0])
        return self.shape.column

    @functools.cached_property
    def stepped(self) -> Any:
        if self.before is not None:
            return self.before.state
        states = [self._now(i) for i in range(self.count)]
        if not self.bodies:
            return states[0]
        arrays = {name: np.stack([s.arrays[name] for s in states]) for name in states[0].arrays}
        return state_of(type(states[0]), arrays)

    def _now(self, i: int) -> Any:
        """The start of a body, with its clock."""
        origin, t0 = self.origin[i], self.t0.item(i)
        try:
            return origin.begun(t0)
        except IntegrationFailure as error:
            if not self.bodies:
                raise
            self.timeless[i] = error
            return origin.whole.extended(origin.start, t0)

    def observe(self) -> list[Any]:
        if self.asked is None:
            return [Every(self, self.plan._steps.every)]
        at = AtTimes(self, self.asked)
        at.samples[..., -1] += 0.0  # no negative zero
        return [at, *([] if self.bodies else [Dense(self)])]

    def last_times(self) -> np.ndarray:
        return self.t_end

    # ---------------------------------------------------------------- between steps

    @functools.cached_property
    def between(self) -> FictiveMotion:
        method, system = self.lanes.arguments[:2]
        h = shown_step(self.way.h)
        fields = self._kind, self.lanes.example, h, None, self.compiled_asked
        return FictiveMotion(method, system, *fields)

    def inputs(self, piece: PieceOfBodies, step: np.ndarray, times: np.ndarray) -> np.ndarray:
        starts, body = super().inputs(piece, step, times), piece.body[step]
        for k in np.flatnonzero(piece.a[step] == self.t0[body]).tolist():
            inside = self.inside_at_start(int(body[k]))
            if inside is not None:
                starts[k, :-3], starts[k, -1] = inside[:-1], inside[-1]
        return starts

    # ---------------------------------------------------------------- what came of it

    def inside_at_start(self, i: int) -> np.ndarray | None:
        ahead = self.here_at_start[-1, i] - self.step_begins[-1, i]
        return np.append(self.step_begins[1:-1, i], ahead) if ahead != 0.0 else None

    def standing(self, some: Any) -> Any:
        single = isinstance(some, int)
        numbers, clock, samples = (x[:, some].copy() for x in (self.numbers, self.clocks, self.here))
        clock[TIME] = clock[TAKEN] * self.h[some]  # in fictive time
        last, ahead = samples[1:-1].copy(), (samples[-1] - clock[TIME]) * self.h[some] > 0.0
        for k in np.flatnonzero(ahead).tolist():
            column = numbers if single else numbers[:, k].copy()
            memory = read(column, 0, self.lanes.layout)
            shown = leaves(sample(self.way.way_of(some if single else k), memory), self.lanes.state)
            last[... if single else (slice(None), k)] = shown
        shape = None if self.bodies else self.shape
        inner = Carry.made(shape, 0.0, numbers, clock, last, None if single else self.count)
        if not single:
            vars(inner)["state"] = state_of(type(self.lanes.example), unpacked(self.lanes.state, last.T))
        elif shape is None:
            vars(inner)["state"] = build(self.lanes.state, iter(last.tolist()))
        origin = self.origin[some] if single else self.origin
        return FictiveCarry(origin, inner, None if single and not ahead else samples, self.met(some))

    def ends_of_steps(self) -> tuple[np.ndarray, np.ndarray]:
        if self.asked is None:
            return super().ends_of_steps()
        rows = self.observers[-1].rows_of(0)
        return rows[:, 0], rows[:, 1:]

    def samples(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        t, numbers = super().samples(i)
        last = self.here[:, i]
        if self.asked is None and len(t) and numbers[-1, -1] != last[-1]:  # where it stands
            return np.append(t, last[0]), np.concatenate([numbers, last[None, 1:]])
        return t, numbers

    @property
    def made(self) -> np.ndarray:
        return super().made + np.where(self.over, 0.0, self.clocks[ANEW])

    @property
    def failed(self) -> np.ndarray:
        short = np.isfinite(self.t_end) & (self.clocks[TIME] != self.goals[LAST_TIME])
        short &= self.clocks[TAKEN] >= self.limit
        return ~self.over & ((self.clocks[MARK] == STUCK) | short)

    def error(self, i: int) -> Any:
        if i in self.timeless:
            return self.explained(self.timeless[i], i, goes_on=False)
        if self.clocks[MARK, i] != STUCK:
            text = (
                f"{int(self.limit[i] - self.first[i])} steps led to t = {self.here[0, i]:g} only, not "
                f"to {self.t_end[i]:g}"
            )
            error = StepTooSmall(f"integrate: {text}; give a larger h or allow more `steps`")
            return self.explained(error, i)
        return super().error(i)

    def place(self, i: int) -> str:
        return f"step {int(self.clocks[TAKEN, i]) + 1}, t = {self.here[0, i]:g}"


class StraightFictiveRun(OfClocked, StraightRun):
    """A run of fixed steps in fictive time that all bodies make side by side."""

    def aim(self, ends: list[Any], steps: Any) -> None:
        plan, t0 = self.plan, self.t0.item(0)
        fresh = self.before is None
        self.origin = Origin(plan.system, plan.method, self.start) if fresh else self.start.origin
        self.wholes, self.way = [self.origin.whole], self.origin.steps(plan._steps)
        if fresh:
            self.stepped = self.origin.begun(t0)
        self.t0 = np.zeros(self.count) if fresh else np.full(self.count, self.start.inner.t)
        super().aim(ends, steps)
        if fresh and not self.bodies:
            self._doubts(self.stepped)

    def standing(self, some: Any) -> Any:
        inner = super().standing(some)
        vars(inner).pop("state", None)
        origin = self.origin if some == slice(None) or not self.bodies else origin_of(self.origin, some)
        if inner.shape is None:
            vars(inner)["state"] = build(self.lanes.state, iter(inner.last.tolist()))
        return FictiveCarry(origin, inner)

    def ends_of_steps(self) -> tuple[np.ndarray, np.ndarray]:
        tau, numbers = self.samples(0)
        return self.view.apart(numbers)[0], np.column_stack([numbers, tau])
