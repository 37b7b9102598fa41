"""Runs with adaptive steps: every body chooses its own."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import Any

import numpy as np

from ...compiler import kernel
from ...compiler.driver import accepted, attempt, itself, reason
from ...errors import InvalidInput, InvalidType, StepTooSmall, failure, is_mistake
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import build, layout_of
from ...formulas.vectors import Vec
from ...integrators.ending_at_jumps import jumps_between
from ...systems.in_time.inputs import has_inputs
from .. import arguments
from ..between.dense import DenseOutput, DenseOutputs, flat, packed, part_of_way
from ..compiled.control import (
    ANEW,
    ATOL,
    CLOCK,
    FRESH,
    GOAL,
    LAST_TIME,
    LIMIT,
    LONGEST_STEP,
    MARK,
    REJECTED,
    RTOL,
    STEP,
    STUCK,
    TAKEN,
    TIME,
    Tolerance,
    go_on,
    noted,
)
from ..compiled.execution import like
from ..compiled.lanes import Lanes
from ..compiled.systems import OfBodies
from ..keep import AtTimes, Dense, Every
from .carry import Carry
from .jumps import stretches, until_jumps
from .run import Run


@frozen(eq=False)
class AdaptiveSteps:
    """Adaptive steps: what a plan was told of them.  h : the first step, None to find it; longest : the longest one."""

    system: Any
    method: Any
    h: float | None
    rtol: float
    atol: float
    longest: float
    breaks: tuple[float, ...]
    dense: bool | None
    compiled: bool | None
    progress: bool | None
    shapes: dict[Any, Any] = dataclasses.field(default_factory=dict, repr=False)

    def owns(self, shape: Any) -> bool:
        """Whether this plan has prepared this shape."""
        return shape in self.shapes.values()

    def of_system(self, system: Any) -> AdaptiveSteps:
        """These steps for a system of the same layout; layouts and native code are shared."""
        shapes: dict[Any, Any] = {}
        for key, prepared in [*self.shapes.items()]:  # places of short runs come after their lanes
            if isinstance(prepared, Lanes):
                shapes[key] = prepared.of_system(system)
            else:
                shapes[key] = prepared.of_lanes(shapes[*key[:2], False])
        return like(self, system=system, shapes=shapes)

    def first(self, t0: float, t_end: float) -> float:
        """The first step, signed; zero if it is to be found."""
        return 0.0 if self.h is None else math.copysign(self.h, t_end - t0)

    @functools.cached_property
    def smooth(self) -> bool:
        """Whether the velocity never jumps, so that no step must end early."""
        return not (self.breaks or has_inputs(self.system))

    def jumps(self, t0: float, t_end: float) -> tuple[float, ...]:
        """The times at which the velocity jumps: those that a user has named, and those of tables."""
        return jumps_between(self.method, self.system, self.breaks, t0, t_end)

    def begun(self, t: np.ndarray) -> np.ndarray:
        """The times at which the steps to t[1:] begin: where the velocity jumps, beyond that."""
        starts = t[:-1].copy()
        t0, t_end = float(t[0]), float(t[-1])
        start, ways = stretches(self.jumps(t0, t_end), t0, t_end)
        for end, beyond in ((t0, start), *ways):
            starts[starts == end] = beyond
        return starts


class ToleranceRun(Run):
    """A run whose steps are as long as an error estimate allows."""

    adaptive = True

    def aim(self, ends: list[Any], steps: Any) -> None:
        of_each, options = self.plan.of_each, self.plan.options
        limit = limit_of(steps, ends[0])
        if options.dense and self.recorded:
            raise InvalidInput("integrate: dense=True keeps the states; record no functions of them")
        plan_steps, numbers = self.way, {}  # type: Any, dict[str, Any]
        for name, all_bodies, check in (
            ("rtol", plan_steps.rtol, lambda x: arguments.tolerance(x, "rtol", arguments.RTOL)),
            ("atol", plan_steps.atol, lambda x: arguments.tolerance(x, "atol", arguments.ATOL)),
            ("max_step", plan_steps.longest, arguments.longest),
            ("h", plan_steps.h or 0.0, arguments.step_length),
        ):
            numbers[name] = of_bodies(check, of_each[name]) if name in of_each else all_bodies
        self.t_end = np.array(ends, dtype=float)
        self.sign = np.where(self.t_end >= self.t0, 1.0, -1.0)
        self.aims = np.zeros((GOAL.width, self.count))
        self.aims[LAST_TIME], self.aims[LIMIT] = self.t_end, limit
        for place, name in ((RTOL, "rtol"), (ATOL, "atol"), (LONGEST_STEP, "max_step")):
            self.aims[place] = numbers[name]
        self.first_steps = np.copysign(numbers["h"], self.t_end - self.t0)

    def _times(self, t_eval: Any) -> np.ndarray | None:
        if t_eval is None and self.bodies:
            return np.array([self.t0, self.t_end])
        return super()._times(t_eval)

    @property
    def dense(self) -> bool:
        """Whether the motion between all steps is kept."""
        dense = self.plan.options.dense
        by_itself = dense is None and not self.bodies and self.asked is None and not self.recorded
        return dense is True or by_itself

    @property
    def curves(self) -> bool:
        """Whether rows carry the coefficients of the polynomial between the steps."""
        times = self.asked
        if self.dense:
            return True
        inside = times is not None and ((times != self.t0) & (times != self.t_end)).any()
        return bool(inside or self.plan.events)

    def begin(self) -> None:
        self.lanes = self._lanes()
        lanes, count = self.lanes, self.count
        width = lanes.state.width
        parts = [np.zeros((lanes.layout.width, count)), np.zeros((CLOCK.width, count)), self.aims]
        self.table = np.concatenate([*parts, *lanes.own])
        numbers, clocks, goals, *_ = lanes.parts(self.table)
        clocks[:] = np.array([0.0, 0.0, *FRESH])[:, None]
        clocks[TIME], clocks[STEP] = self.t0, self.first_steps
        if self.before is None:
            arrays = self.start.arrays
            numbers[:width] = flat(arrays, count).T if self.bodies else packed(self.start)[:, None]
        else:
            self.before.put_down(numbers, numbers[:width].copy())
            clocks[:] = self.before.clock.reshape(clocks.shape)
            clocks[[REJECTED, MARK]] = 0.0
            clocks[TAKEN, ~self.over] = 0.0
            back = clocks[STEP] * (self.t_end - self.t0) < 0.0
            clocks[STEP, back] = -clocks[STEP, back]
        self.here = np.concatenate([self.t0[None], numbers[:width]])
        if not self.way.smooth:
            for i in range(count):
                system, method = self.system_and_method(i)
                t0, end = float(self.t0[i]), float(self.t_end[i])
                jumps = jumps_between(method, system, self.way.breaks, t0, end)
                branches = stretches(jumps, t0, end)
                self.jumps[i] = until_jumps(clocks[:, i], goals[:, i], t0, branches)
        for i in np.flatnonzero((self.t_end == self.t0) & ~self.over).tolist():
            if not accepted(velocity(self.system_and_method(i)[0], self.t0.item(i), self.start_of(i)), itself):
                clocks[MARK, i] = STUCK

    def _lanes(self) -> Lanes:
        """Layouts and native code, from other runs of the plan if their starts were alike."""
        plan, steps, curves = self.plan, self.way, self.curves
        self.rows = curves or not self.bodies
        example = self.start_of(0)
        key = layout_of(example), curves, bool(self.bodies)
        lanes = steps.shapes.get(key)
        if lanes is not None:
            return lanes.of_a_run()
        system, method = self.system_and_method(0)
        xi: Any = Vec(*[0.0] * system.group.dim)
        for i in range(self.count):
            state = self.start_of(i)
            rate = velocity(self.system_and_method(i)[0], self.t0.item(i), state)
            if accepted(rate, itself):
                example, xi = state, rate
                break
        lanes = Lanes(
            (plan.method, plan.system), Tolerance(curves, self.rows), layout_of((example, xi)), example,
            (xi,) * method.curve_terms if curves else (),
            self.compiled_asked, plan.options.progress,
            kernel.width() if self.bodies and self.compiled_asked is not False and kernel.available() is None else 1,
        )  # fmt: skip
        steps.shapes[key] = lanes
        return lanes.of_a_run()

    def observe(self) -> list[Any]:
        all_steps = self.dense or not (self.bodies or self.asked is not None or self.recorded)
        observers: list[Any] = [Dense(self)] if all_steps else []
        if self.asked is not None:
            return [AtTimes(self, self.asked), *observers]
        return observers or [Every(self, 1)]

    # ---------------------------------------------------------------- between steps

    @functools.cached_property
    def between(self) -> DenseOutput:
        several, method = self.lanes.arguments[1], self.system_and_method(0)[1]
        retraction = method.retraction
        if isinstance(self.plan.method, OfBodies) and layout_of(retraction).width:
            retractions = [method_of_body.retraction for method_of_body in self.plan.method]
            retraction = kernel.Several.of(retractions, len(retractions))
        motion = self.lanes.example, None, method.dense_order, self.compiled_asked
        return DenseOutput(several, retraction, *motion)

    def end_at(self, row: np.ndarray, begun: float, at: float, numbers: np.ndarray) -> None:
        width = self.lanes.state.width
        terms = (len(row) - 1 - width) // self.system_and_method(0)[0].group.dim
        row[1 + width :] = part_of_way(row[1 + width :], (at - begun) / (row[0] - begun), terms)
        super().end_at(row, begun, at, numbers)

    def cut(self, clock: np.ndarray, at: float) -> None:
        super().cut(clock, at)
        go_on(clock, at)

    def rest_of_step(self, body: int, column: np.ndarray, row: np.ndarray, end: float) -> None:
        column[: self.lanes.state.width] = row[1 : len(self.here)]
        go_on(column[self._clock :], row.item(0))

    # ---------------------------------------------------------------- what came of it

    def samples(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        t, numbers = super().samples(i)
        return t, numbers[:, : len(self.here) - 1]

    def known(self, i: int | None) -> dict[str, Any]:
        steps = np.where(self.over, 0.0, self.clocks[TAKEN])
        rejected = np.where(self.over, 0.0, self.clocks[REJECTED])
        reached = np.where(self.over, self.t0, self.clocks[TIME])
        h = (reached - self.t0) / np.maximum(1.0, steps)
        if i is None:
            dense = DenseOutputs(tuple(map(self._dense, range(self.count)))) if self.dense else None
            return {"h": float(np.mean(h)), "rejected": int(rejected.sum()), "dense": dense}
        fields: dict[str, Any] = {"h": float(h[i]), "rejected": int(rejected[i])}
        if self.dense:
            fields["dense"] = self._dense(i)
        return fields

    def _dense(self, i: int) -> DenseOutput:
        """The dense output of body i, over its own steps."""
        system, method = self.system_and_method(i)
        motion = self.lanes.example, self.observers[-1].rows_of(i), method.dense_order, self.compiled_asked
        return DenseOutput(system, method.retraction, *motion)

    def carry_of(self, i: int) -> Any:
        beside = self.clocks[TIME, i] != self.here[0, i] and not self.clocks[ANEW, i]
        return None if beside else super().carry_of(i)

    def standing(self, some: Any) -> Any:
        numbers, clock, last = (x[:, some].copy() for x in (self.numbers, self.clocks, self.here[1:]))
        numbers[: len(last)] = last
        if isinstance(some, int):
            cut = {0: self.cuts[some]} if some in self.cuts else {}
            carry = Carry(None, None, numbers, clock, last, None, {}, self.met(some), cut)
            vars(carry)["state"] = self.view.small(last)
            return carry
        carry = Carry(None, None, numbers, clock, last, self.count, {}, self.met(some), {**self.cuts})
        vars(carry)["state"] = self.view.states(last.T)
        return carry

    def error(self, i: int) -> Any:
        if self.clocks[TAKEN, i] >= self.limit[i]:
            limit, t = int(self.limit[i]), self.clocks.item(TIME, i)
            return self.explained(too_many(limit, t, self.t_end.item(i)), i)
        return self._too_small(i)

    @property
    def failed(self) -> np.ndarray:
        at_end = (self.clocks[TIME] == self.goals[LAST_TIME]) & (self.clocks[MARK] != STUCK)
        return ~self.over & ~at_end & ((self.clocks[MARK] == STUCK) | (self.clocks[TAKEN] >= self.limit))

    def _too_small(self, i: int) -> Any:
        """The error of steps that became too small to go on, with the error that the last trial raised.  A mistake in a
        formula is raised itself.
        """
        clock, (system, method) = self.clocks[:, i], self.system_and_method(i)
        t, h, steps = float(clock[TIME]), float(clock[STEP]), int(clock[TAKEN])
        rtol, atol = self.goals[RTOL, i].item(), self.goals[ATOL, i].item()
        state, xi = build(self.lanes.layout, iter(self.numbers[:, i].tolist()))
        if not steps:
            first = velocity(system, t, state)
            if not accepted(first, itself):
                error: Any = reason(first)
                if not is_mistake(error):
                    error = failure(error, repr(method), f"at the start, t = {self.t0[i]:g}")
                return self.explained(error, i, goes_on=False)
        # by the steps that led here: each was at most five times as long as the next
        raised: list[Any] = []
        for longer in (1.0, 5.0, 25.0, 125.0):
            trial = attempt(method.trial, system, t, state, xi, longer * h, rtol, atol, False)
            noted(raised, trial)
            if raised or not trial.error <= 1.0:
                break
        causes = [*raised, *self.failures.get(i, [])[-1:]]
        error = next((e for e in causes if is_mistake(e)), causes[0] if causes else None)
        if is_mistake(error):
            error.add_note(
                f"[integrate: in step {steps + 1}, from t = {t:g}; the samples before it are in `.trajectory`]"
            )
            return self.explained(error, i)
        too_short = too_small(repr(method), t, h, rtol, atol, steps, error, trial.error)
        return self.explained(too_short, i)


def too_small(
    what: str, t: float, h: float, rtol: float, atol: float, steps: int, error: Any, estimate: float
) -> StepTooSmall:
    """The error of a run whose steps fell so far that time stands still.

    error : what the last trial raised; None for an `estimate` that was too large.
    """
    why = str(error)
    if error is None:
        why = f"the error estimate is {estimate:.1e} of the tolerance even so"
        if not math.isfinite(estimate):
            why = "the motion has no finite velocity there"
    elif not isinstance(error, ArithmeticError):
        why = f"{type(error).__name__}: {error}"
    too_short = StepTooSmall(
        f"{what}: at t = {t:g} the step fell to {abs(h):.1e}, too small to advance the time: "
        f"{why}. The motion may have a singularity there, or rtol = {rtol:g}, atol = {atol:g} ask "
        f"for more than rounding allows; {steps} steps are in `.trajectory`"
    )
    too_short.__cause__ = error
    return too_short


def of_bodies(check: Any, values: Any) -> list[Any]:
    """Check a value of each body; a refusal names the body."""
    checked: list[Any] = []
    try:
        for value in values:
            checked.append(check(value))
    except (InvalidInput, InvalidType) as error:
        error.add_note(f"[integrate: body {len(checked)}]")
        raise
    return checked


def velocity(system: Any, t: float, state: Any) -> Any:
    """The velocity at a start, as `attempt` gives it: not a number if it is complex, as a power of
    a negative number is.
    """
    xi = attempt(system.rate, t, system.essential_part(state))
    return math.nan if accepted(xi, itself) and any(type(x) is complex for x in xi) else xi


def limit_of(steps: Any, t_end: Any) -> int:
    """The largest number of adaptive steps to t_end, checked; adaptive steps need a t_end."""
    if t_end is None:
        raise InvalidInput("integrate: adaptive steps need a t_end; for fixed steps give h and steps")
    return arguments.MOST if steps is None else arguments.count(steps, "steps", 1)


def too_many(limit: int, t: float, t_end: float) -> StepTooSmall:
    """The error of a run that is not allowed more steps."""
    return StepTooSmall(
        f"integrate: {limit} steps led to t = {t:g} only, not to {t_end:g}; loosen rtol and atol or allow more `steps`"
    )
