"""Runs with fixed steps whose bodies go each its own way: with ends, times or events of their
own.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..compiler import kernel
from ..errors import failure, is_mistake
from ..formulas.pytree import layout_of
from .carry import Carries, Carry, stacked
from .control import CLOCK, LIMIT, MARK, STEP, STUCK, TAKEN, TIME, Equal
from .dense import evaluated, short_step
from .fixed_run import FixedRun
from .keep import At, Piece
from .lanes import Lanes
from .prepared import shown_step
from .run import Run

NEAR = 4 * np.finfo(float).eps
"""Times that differ by this part of them are one."""


class EqualRun(Run):
    """A run of fixed steps."""

    control: Any = Equal()
    shape: Any
    extra: Any = ()

    def aim(self, ends: list[Any], steps: Any) -> None:
        plan, way, members = self.plan, self.way, [self.begun(i) for i in range(self.count)]
        self.h = np.array([way.h_of(i) for i in range(self.count)])
        self.zero = np.array([getattr(one, "t0", one.t) for one in members])
        self.first = np.array([float(getattr(one, "step", 0)) for one in members])
        self.aims = np.zeros((6, self.count))
        self.aims[0], self.aims[5] = np.copysign(np.inf, self.h), self.zero
        self.aims[LIMIT] = self.first
        for i in np.flatnonzero(~self.over).tolist():
            own = float(self.zero[i]), int(self.first[i])
            try:
                self.aims[LIMIT, i] += plan.count(steps, ends[i], *own, self.h.item(i))
            except Exception as error:
                if self.bodies:
                    error.add_note(f"[integrate: body {i}]")
                raise
        self.t_end, self.sign = self.aims[0], np.copysign(1.0, self.h)

    def last_times(self) -> np.ndarray:
        return self.zero + self.aims[LIMIT] * self.h

    def begin(self) -> None:
        start, count, failures = self._from(), self.count, {}  # type: Any, int, dict[int, Any]
        alone = self.fresh and not self.bodies
        known: Any = self.way.shapes.get((layout_of(start), False)) if alone else None
        memory = None if known is None else np.empty((known.carried + known.sampled, 1))
        if memory is not None and known.begin(start, memory[:, 0]):
            shape, taken = known, np.zeros(1)
            numbers, heads = memory[: shape.carried - 1], memory[shape.carried :]
        else:
            begun = self._first_run(start)
            shape, failures = begun.shape, begun.failures
            numbers, heads = begun.states[:-1, :count].copy(), begun.out[0, :, :count].copy()
            taken = begun.taken[:count] if self.fresh else np.zeros(count)
            self._place(numbers, heads)
        self.shape = shape
        self.lanes = lanes = self._lanes(shape, self.way.way, self.way.system)
        clocks = np.zeros((CLOCK.width, count))
        clocks[TIME] = self.zero + self.first * self.h
        clocks[STEP], clocks[TAKEN] = self.h, self.first
        for i in np.flatnonzero((taken < 0) & ~self.over).tolist():
            clocks[MARK, i], self.failures[i] = STUCK, [failures.get(i)]
        self.table = np.concatenate([numbers, clocks, self.aims, *lanes.own])
        self.here = np.concatenate([clocks[TIME][None], heads])
        self.here[0, self.over] = self.t0[self.over]

    def _from(self) -> Any:
        """The start as one state or carry."""
        if isinstance(self.start, Carries):
            return stacked([one.state for one in self.start.members])
        return self.start

    def _first_run(self, start: Any) -> FixedRun:
        """The run of no step, with what the method begins with."""
        way = dataclasses.replace(self.way, every=1, progress=False)
        return FixedRun(way, start, 0, self.t0.item(0))

    def _place(self, numbers: np.ndarray, heads: np.ndarray) -> None:
        """Put down where bodies stand that go on."""
        for i in range(self.count if not self.fresh else 0):
            one = self.begun(i)
            if isinstance(one, Carry):
                numbers[:, i], heads[:, i] = one.numbers.ravel()[:-1], one.last.ravel()

    def _lanes(self, shape: Any, method: Any, system: Any) -> Lanes:
        """Layouts and native code, kept by the shape."""
        many = bool(self.bodies)
        lanes = shape.others.get(many)
        if lanes is None:
            native = self.asked_for is not False and kernel.available() is None
            lanes = shape.others[many] = Lanes(
                method, system, self.control, shape.layout, shape.example, self.extra,
                self.asked_for, self.plan.options.progress,
                kernel.width() if many and native else 1,
            )  # fmt: skip
        else:
            lanes.stepping.refresh()
        return lanes

    def observe(self) -> list[Any]:
        if self.asked is None or self.plan.events:
            return super().observe()
        after = np.rint((self.asked - self.zero) / self.h)
        there = self.zero + after * self.h
        near = NEAR * np.maximum(np.abs(self.asked), np.abs(self.zero))
        asked = np.where(np.abs(self.asked - there) <= near, there, self.asked)
        return [At(self, asked, self.asked)]

    # ---------------------------------------------------------------- between steps

    def given(self, piece: Piece, step: np.ndarray, times: np.ndarray) -> np.ndarray:
        points, a = piece.rows(step, before=True)[:, 1:], piece.a[step]
        return np.concatenate([points, a[:, None], (times - a)[:, None]], axis=1)

    def moved(self, given: np.ndarray, times: np.ndarray, body: np.ndarray) -> np.ndarray:
        point = self.lanes.state
        what = (
            repr(self.of(0)[1]),
            lambda k: f"the shorter step from t = {given[k, -2]:g} to t = {times[k]:g}",
        )
        arguments = *self.lanes.arguments[:2], point
        return evaluated(short_step, arguments, given, point.width, self.asked_for, what, body)

    # ---------------------------------------------------------------- what came of it

    def known(self, i: int | None) -> dict[str, Any]:
        breaks = {"breaks": self.way.breaks}
        return {"h": shown_step(self.way.h)} if i is None else {"h": self.h.item(i)} | breaks

    def carry(self, i: int, met: Any) -> Any:
        steps, h = self.clocks[TAKEN, i], self.h.item(i)
        numbers = np.append(self.numbers[:, i], steps)
        last = self.here[1:, i].copy()
        given = self.shape, self.zero.item(i), h, int(steps), None, numbers, last
        made = Carry(*given, met=met)
        vars(made)["state"] = self.small(last)
        return made

    def error(self, i: int) -> Any:
        error = (self.failures.get(i) or [None])[-1]
        at = self.place(i)
        if is_mistake(error):
            error.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
        else:
            at += f"; {len(self.samples(i))} samples are in `.trajectory`"
            error = failure(error, repr(self.of(i)[1]), at)
        return self.explained(error, i, goes_on=False)

    def place(self, i: int) -> str:
        """The step that a body did not make, and the time from which."""
        step = int(self.clocks[TAKEN, i])
        return f"step {step + 1} of {int(self.limit[i])}, t = {self.here[0, i]:g}"
