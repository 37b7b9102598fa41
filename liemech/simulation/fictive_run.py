"""Runs in fictive time: of fixed steps there, of many lengths in physical time, which is carried along and
met exactly.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, ClassVar

import numpy as np

from ..compiler.driver import read
from ..errors import (
    IntegrationFailure,
    InvalidInput,
    InvalidTimeScale,
    StepTooSmall,
    StepWarning,
    warn,
)
from ..formulas.pytree import build, layout_of, leaves
from ..systems.system import member, small_state, state_of
from . import arguments
from .arrival import FictiveMotion
from .carry import Carry, Ended, stacked
from .control import ANEW, LIMIT, MARK, STUCK, TAKEN, TIME, Fictive, sample
from .dense import flat, unpacked
from .equal import NEAR, EqualRun, StraightRun, lay_down
from .fictive import FictiveCarry, Origin
from .keep import At, Dense, Every, Piece
from .prepared import shown_step
from .systems import OfBodies, Systems
from .trajectory import Trajectory, TransformedTrajectory


class OfClocked(EqualRun):
    """A run of a system whose state carries physical time along, shown as one of the system itself;
    abstract.

    Of samples t is the physical time, and the fictive one stands behind the numbers of the state.

    origins : where the motions of the bodies began, or one for all.  wholes : of these the systems with
    their clocks.
    """

    kind: ClassVar[Any] = TransformedTrajectory
    origins: list[Origin]
    wholes: list[Any]

    @property
    def origin(self) -> Any:
        """Where the motion began, of bodies on their own each of them."""
        raise NotImplementedError

    def origin_of(self, i: int) -> Origin:
        """Where the motion of a body began."""
        raise NotImplementedError

    def here_of(self, i: int) -> np.ndarray:
        """Physical time, numbers of the state with its clock, and fictive time, where a body stands."""
        raise NotImplementedError

    def _doubts(self, now: Any) -> None:
        """Warn of a step from here that may have no solution."""
        doubt = self.of(0)[1].step_warning(self.wholes[0], now, float(self.h[0]))
        if doubt:
            warn(doubt, StepWarning)

    def _only_start(self) -> Trajectory:
        now = self._from()
        now = now.state if isinstance(now, Carry) else now
        parts = {name: np.array(x)[None] for name, x in now.parts.items() if x is not None}
        t, states, z = self.wholes[0].apart(parts)
        given = self._inner(), self.plan.method, self.h.item(0), t, states, self.bodies, 0
        return TransformedTrajectory(*given, tau=np.zeros(1), z=z, origin=self.origins[0])

    # ---------------------------------------------------------------- states

    def _apart(self, numbers: np.ndarray) -> Any:
        width = self.lanes.state.width
        return self.wholes[0].apart(unpacked(self.lanes.state, numbers[..., :width]))

    def arrays(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        found: dict[str, np.ndarray] = self._apart(numbers)[1]
        return found

    @property
    def _kind(self) -> Any:
        return type(self.origins[0].start)

    def small(self, numbers: np.ndarray) -> Any:
        arrays = self.arrays(numbers[None])
        return small_state(self._kind, {name: x[0] for name, x in arrays.items()})

    def states_of(self, numbers: np.ndarray) -> Any:
        return state_of(self._kind, self.arrays(numbers))

    def seen(self, numbers: np.ndarray) -> tuple[Any, np.ndarray]:
        return layout_of(self.small(numbers[0])), flat(self.arrays(numbers), len(numbers))

    def clocks_of(self, numbers: np.ndarray) -> dict[str, Any]:
        tau, z = numbers[..., -1], self._apart(numbers)[2]
        if tau.ndim == 2 and (tau == tau[:, :1]).all():
            tau = tau[:, 0].copy()
        return {"tau": tau, "z": z}

    # ---------------------------------------------------------------- what came of it

    def _inner(self) -> Any:
        if not self.bodies or not isinstance(self.plan.system, OfBodies):
            return self.wholes[0].system
        return Systems(tuple([whole.system for whole in self.wholes]))

    def known(self, i: int | None) -> dict[str, Any]:
        if i is None:
            h = shown_step(self.way.h)
            return {"h": h, "system": self._inner(), "origin": self.origin}
        origin = self.origin_of(i)
        found = {"h": self.h.item(i), "system": origin.whole.system, "origin": origin}
        if not self.bodies:
            found["dense"] = self._motion(*self.ends_of_steps())
        return found

    def ends_of_steps(self) -> tuple[np.ndarray, np.ndarray]:
        """Of one body the times and numbers between which its motion can be told."""
        return self.samples(0)

    def _motion(self, t: np.ndarray, numbers: np.ndarray) -> FictiveMotion:
        begun = self._inside(0) if len(t) and t[0] == self.begun(0).t else None
        return FictiveMotion(
            self.way.way_of(0), self.wholes[0], self._kind, self.lanes.example, self.h.item(0),
            np.column_stack([t, numbers]), self.asked_for, begun,
        )  # fmt: skip

    def _inside(self, i: int) -> np.ndarray | None:
        """Of a body that goes on from inside of a step where that begins, and the fictive time from
        there; None of others.
        """
        one = self.begun(i)
        if not isinstance(one, FictiveCarry) or one.ahead is None:
            return None
        return np.append(one.inner.last, one.tau - one.inner.t)

    def carry(self, i: int, met: Any) -> Any:
        whole, h = int(self.clocks[TAKEN, i]), self.h.item(i)
        state = read(self.numbers[:, i].copy(), 0, self.lanes.layout)
        last = sample(self.way.way_of(i), state)
        numbers = self.numbers[:, i].copy()
        shape = None if self.bodies else self.shape
        inner = Carry(shape, 0.0, h, whole, None, numbers, np.array(leaves(last, self.lanes.state)))
        vars(inner)["state"] = last
        _, *here, tau = self.here_of(i).tolist()
        if (tau - whole * h) * h <= 0.0:
            return FictiveCarry(self.origin_of(i), inner, met=met)
        return FictiveCarry(self.origin_of(i), inner, build(self.lanes.state, iter(here)), tau, met)

    def explained(self, error: Any, i: int, goes_on: bool = True) -> Any:
        error = super().explained(error, i, goes_on)
        if isinstance(error, IntegrationFailure):
            t, _, z = self._clock_of(i)
            error.clock = t, float(self.clocks[TAKEN, i] * self.h[i]), z
        return error

    def _clock_of(self, i: int) -> tuple[float, float, float | None]:
        """Physical time, fictive time, and z, where a body stands."""
        here = self.here_of(i)
        z = self._apart(here[None, 1:])[2]
        return here.item(0), here.item(-1), None if z is None else float(z[0])

    def ended(self, i: int, error: Any) -> Ended:
        (t, tau, z), steps = self._clock_of(i), int(self.first[i] + self.made[i])
        return Ended(self.states_here(i), t, steps, error, tau, z, self.origin_of(i))

    def result(self, goes_on: bool = True) -> Any:
        made = super().result(goes_on)
        t = made.t
        later, before = (t[1:], t[:-1]) if self.h[0] > 0.0 else (t[:-1], t[1:])
        if (later < before).any():
            error = InvalidTimeScale(
                "integrate: physical time went back; "
                f"{self.wholes[0].sigma!r} is not positive all the way"
            )
            error.trajectory = made
            raise error
        return made


class FictiveRun(OfClocked):
    """A run of fixed steps in fictive time to given physical times, with events, or of bodies with
    clocks of their own.
    """

    control: Any = Fictive()
    extra: Any = 0.0

    @property
    def origin(self) -> Any:
        return tuple(self.origins)

    def origin_of(self, i: int) -> Origin:
        return self.origins[i]

    def here_of(self, i: int) -> np.ndarray:
        found: np.ndarray = self.here[:, i]
        return found

    def aim(self, ends: list[Any], steps: Any) -> None:
        way, count = self.way, self.count
        members = [self.begun(i) for i in range(count)]
        least = 0 if ends[0] is None else 1
        limit = arguments.MOST // 2 if steps is None else arguments.count(steps, "steps", least)
        self.h = h = np.array([way.h_of(i) for i in range(count)])
        self.first = np.array([float(getattr(one, "step", 0)) for one in members])
        self.zero = np.zeros(count)
        self.aims = np.zeros((6, count))
        self.aims[LIMIT] = self.first + limit
        self.sign = np.copysign(1.0, self.h)
        self.t_end = np.array(
            [s * np.inf if end is None else end for s, end in zip(self.sign, ends, strict=True)]
        )
        for i, one in enumerate(members):
            t, end = one.t, self.t_end.item(i)
            if (
                ends[i] is not None
                and isinstance(one, FictiveCarry)
                and abs(end - t) <= NEAR * max(abs(end), abs(t))
            ):
                end = self.t_end[i] = t  # it stands there, but for rounding
            if (end - t) * h[i] < 0.0 and not self.over[i]:
                raise InvalidInput(
                    f"integrate: t_end = {end:g} is not where steps of h = {h[i]:g} lead from "
                    f"{t:g}; turn the sign of h"
                )
        self.aims[0] = self.t_end
        self.origins = [
            one.origin
            if getattr(one, "origin", None) is not None
            else Origin(*self.of(i), one.state)
            for i, one in enumerate(members)
        ]
        self.wholes = [origin.whole for origin in self.origins]

    def last_times(self) -> np.ndarray:
        return self.t_end

    def begin(self) -> None:
        super().begin()
        clocks = self.lanes.parts(self.table[:, : self.count])[1]
        column = self._column()
        here = self.here
        clocks[TIME] = here[1 + column]
        taus = self.first * self.h
        self.here = np.concatenate([clocks[TIME][None], here[1:], taus[None]])
        for i in range(self.count):
            one = self.begun(i)
            if isinstance(one, FictiveCarry) and one.ahead is not None:
                self.here[1:-1, i] = leaves(one.ahead, self.lanes.state)
                self.here[0, i], self.here[-1, i] = one.t, one.tau
            elif isinstance(one, Ended):
                self.here[0, i], self.here[-1, i] = one.t, one.tau
        there = self.here[0] == self.t_end
        clocks[TIME, there] = self.t_end[there]
        for i, error in self.timeless.items():
            clocks[MARK, i], self.failures[i] = STUCK, [error]

    def _column(self) -> int:
        """Where in the numbers of a sample its physical time is."""
        if self.shape.column is None:
            width = self.shape.shown.width
            found = unpacked(self.shape.shown, np.arange(width, dtype=float)[None])
            self.shape.column = int(self.wholes[0].apart(found)[0][0])
        return self.shape.column

    def _from(self) -> Any:
        self.timeless: dict[int, Any] = {}
        now = [self._now(i) for i in range(self.count)]
        one = self.begun(0)
        if not self.bodies:
            self.way = self.origins[0].steps(self.plan._steps)
            if not isinstance(one, FictiveCarry):
                self._doubts(now[0])
            return one.inner if isinstance(one, FictiveCarry) else now[0]
        system = Systems(tuple(self.wholes))
        self.way = dataclasses.replace(self.plan._steps, system=system, shapes={}, clock="tau")
        return stacked(now)

    def _now(self, i: int) -> Any:
        """The state of a body, with its clock."""
        one, origin = self.begun(i), self.origins[i]
        if isinstance(one, FictiveCarry):
            return one.inner.state
        if isinstance(one, Ended):
            return origin.whole.extended(one.state, one.t)
        try:
            return origin.begun(one.t)
        except IntegrationFailure as error:
            if not self.bodies:
                raise
            self.timeless[i] = error
            return origin.whole.extended(one.state, one.t)

    def _place(self, numbers: np.ndarray, heads: np.ndarray, clocks: np.ndarray) -> None:
        for i in range(self.count):
            one = self.begun(i)
            if isinstance(one, FictiveCarry):
                lay_down(one.inner, numbers[:, i], heads[:, i])
                clocks[MARK, i] = 0.0

    def observe(self) -> list[Any]:
        if self.asked is None:
            return [Every(self, self.plan._steps.every)]
        at = At(self, self.asked)
        at.samples[..., -1] += 0.0  # no negative zero
        return [at, *([] if self.bodies else [Dense(self)])]

    # ---------------------------------------------------------------- between steps

    @functools.cached_property
    def between(self) -> FictiveMotion:
        method, system = self.lanes.arguments[:2]
        h = shown_step(self.way.h)
        given = self._kind, self.lanes.example, h, None, self.asked_for
        return FictiveMotion(method, system, *given)

    def given(self, piece: Piece, step: np.ndarray, times: np.ndarray) -> np.ndarray:
        given, body = super().given(piece, step, times), piece.body[step]
        for k in np.flatnonzero(piece.a[step] == self.t0[body]).tolist():
            begun = self._inside(int(body[k]))
            if begun is not None:
                given[k, :-3], given[k, -1] = begun[:-1], begun[-1]
        return given

    # ---------------------------------------------------------------- what came of it

    def ends_of_steps(self) -> tuple[np.ndarray, np.ndarray]:
        if self.asked is None:
            return super().ends_of_steps()
        rows = self.observers[-1].rows
        return rows[:, 0], rows[:, 1:]

    def samples(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        t, numbers = super().samples(i)
        here = self.here[:, i]
        if self.asked is None and len(t) and numbers[-1, -1] != here[-1]:  # where it stands
            return np.append(t, here[0]), np.concatenate([numbers, here[None, 1:]])
        return t, numbers

    @property
    def made(self) -> np.ndarray:
        return super().made + np.where(self.over, 0.0, self.clocks[ANEW])

    @property
    def failed(self) -> np.ndarray:
        short = np.isfinite(self.t_end) & (self.clocks[TIME] != self.goals[0])
        short &= self.clocks[TAKEN] >= self.limit
        return ~self.over & ((self.clocks[MARK] == STUCK) | short)

    def error(self, i: int) -> Any:
        if i in self.timeless:
            return self.explained(self.timeless[i], i, goes_on=False)
        if self.clocks[MARK, i] != STUCK:
            told = (
                f"{int(self.limit[i] - self.first[i])} steps led to t = {self.here[0, i]:g} only, not "
                f"to {self.t_end[i]:g}"
            )
            made = StepTooSmall(f"integrate: {told}; give a larger h or allow more `steps`")
            return self.explained(made, i)
        return super().error(i)

    def place(self, i: int) -> str:
        return f"step {int(self.clocks[TAKEN, i]) + 1}, t = {self.here[0, i]:g}"


class StraightFictiveRun(OfClocked, StraightRun):
    """A run of so many steps in fictive time, which all bodies make side by side."""

    lazy = False

    @property
    def origin(self) -> Any:
        return self.origins[0]

    def origin_of(self, i: int) -> Origin:
        origin = self.origins[0]
        if not self.bodies:
            return origin
        return Origin(origin.given, origin.method, member(origin.start, i))

    def aim(self, ends: list[Any], steps: Any) -> None:
        plan, start, t0 = self.plan, self.start, self.t0.item(0)
        origin = Origin(plan.system, plan.method, start) if self.fresh else start.origin
        self.origins, self.wholes, self.way = [origin], [origin.whole], origin.steps(plan._steps)
        self.start = origin.begun(t0) if self.fresh else start.inner
        self.t0 = np.zeros(self.count) if self.fresh else np.full(self.count, start.inner.t)
        super().aim(ends, steps)
        if self.fresh and not self.bodies:
            self._doubts(self.start)

    def here_of(self, i: int) -> np.ndarray:
        self._stand_here()
        numbers, tau = self.here[1:, i], self.clocks[TAKEN, i] * self.h[i]
        if self._ahead and self.clocks[TAKEN, i] == self.first[i]:
            numbers, tau = self._ahead
        return np.concatenate([self._apart(numbers[None])[0], numbers, [tau]])

    @functools.cached_property
    def _ahead(self) -> Any:
        """Of one body that goes on from inside of a step the numbers there, and the fictive time."""
        one: Any = None if self.fresh or self.bodies else self.begun(0)
        if one is None or one.ahead is None:
            return None
        return np.array(leaves(one.ahead, self.lanes.state)), one.tau

    def _gathered(self) -> tuple[np.ndarray, np.ndarray, int]:
        tau, numbers, many = super()._gathered()
        tau = np.broadcast_to(tau.reshape(len(tau), -1), numbers.shape[:2])
        rows = np.concatenate([numbers.swapaxes(1, 2), tau[:, None]], axis=1).swapaxes(1, 2)
        if self._ahead:
            rows[0, 0, :-1], rows[0, 0, -1] = self._ahead
        return self._apart(rows)[0], rows, many

    def samples(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        t, numbers = super().samples(i)
        first = int(len(t) > 1 and numbers[0, -1] == numbers[1, -1])  # ahead of a whole step
        return t[first:], numbers[first:]

    def carries(self) -> Any:
        made = super().carries()
        if not isinstance(made, Carry):
            return made
        del vars(made)["state"]  # which is that of the system without its clock
        return FictiveCarry(self.origins[0], made)
