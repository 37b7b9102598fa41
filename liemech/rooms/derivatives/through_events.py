"""Derivatives of runs that meet events: the steps in which the state jumps one by one, between them those of any run.

A jump y+ = then(t, y-) at the zero of an event w takes tangents to

    Xi = D then + (f+ - D then f- - then_t) grad w / (w_t + grad w . f-),

and the time of the zero changes by dt = -(grad w . dy-) / (w_t + grad w . f-).  Here the rates f are not those of the motion
but the derivatives of the two steps, to the zero and from it, by their lengths: it is the derivative of the steps as made.

Source: di Bernardo, Budd, Champneys and Kowalczyk, Piecewise-smooth Dynamical Systems (2008), section 2.5; Aizerman and
Gantmakher, Q. J. Mech. Appl. Math. 11 (1958), 225.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput
from ...formulas import Vec
from ...formulas.classes.layouts import build, layout_of, leaves, restricted
from ...formulas.numbers.conversions import resting
from ...formulas.numbers.dual import Dual
from ...formulas.numbers.sizes import EPSILON
from ...formulas.vectors import small
from ...groups.retractions import Exponential
from ...integrators.ending_at_jumps import ending_at_jumps
from ...simulation import arguments
from ...simulation.between.dense import packed
from ...simulation.between.events import name_of
from ...simulation.between.jump import Jump
from ...simulation.compiled.driver import on_the_way
from ...simulation.compiled.execution import like
from ...simulation.trajectory import TangentTrajectory, Trajectory
from ...systems.system import small_state
from .differences import EIGHTH
from .directions import Directions, dual_of
from .frames import LEVEL, group_of
from .tangent import carried_along, dressed_in, repeated

GRAZING = math.sqrt(EPSILON / 1e-6)
"""The rate of an event in its zero over its mean rate in the step there, below which rounding has a millionth of the
derivative of the time.
"""

SMALL = 2.0**-10
"""The part of a state, of a step and of parameters by which they differ where a jump is differentiated by differences."""


class Crossing:
    """A step, or some, of which the last parts come after jumps; or a step in which events are zero without a jump.

    first, last : the rows of the run where they begin and end.  zeros : of each the event, the time, and the end of the
    step in which it was looked for.
    """

    def __init__(self, first: int, last: int) -> None:
        self.first, self.last, self.zeros = first, last, []  # type: int, int, list[tuple[int, float, float]]


class RunWithEvents:
    """The run of one body, all of whose steps are kept, and the steps in which it meets events.

    bare : the plan without events.  crossings : in the order of the motion.  changed : those that change the motion.
    """

    def __init__(self, plan: Any, start: Any, steps: Any, t_end: Any, t0: float, names: tuple[str, ...]) -> None:
        noisy = plan._first_of("method").noisy
        if plan.fictive or noisy or "h" in names:
            what = "by h, with which the times of the steps move,"
            if plan.fictive or noisy:
                what = "in fictive time" if plan.fictive else "under noise"
            raise IncompatibleSystem(
                f"Plan.tangent: {what} there is no derivative with events; make a plan without them"
            )
        self.adaptive, self.events = plan.adaptive, plan.events
        every_step = plan if plan.adaptive else plan.replace(every=1)
        self.bare = every_step.replace(events=())
        kind = every_step.kind_of_run(start, t_end, None)
        in_pieces = kind(every_step, start, t0, steps, t_end, None, None)
        self.run: Trajectory = in_pieces.trajectory()
        self.system, self.method = plan._one, plan.method
        self.sign = float(in_pieces.sign[0])
        self.crossings = [*self._crossings(in_pieces.events.each[0].in_turn)]
        self.changed = [crossing for crossing in self.crossings if crossing.last > crossing.first]

    def _crossings(self, zeros: list[tuple[int, float, float]]) -> Iterator[Crossing]:
        """The crossings of a run that has met these zeros in turn."""
        t, row, open_ = self.run.t, 0, None  # type: np.ndarray, int, Crossing | None
        for n, zero in enumerate(zeros):
            begin = row
            while row + 1 < len(t) and self.sign * t[row + 1] < self.sign * zero[1]:
                row += 1
            if open_ is not None and row != begin:
                yield self._closed(open_, begin)
                open_ = None
            ended = self.run.ended is not None and n == len(zeros) - 1
            jumps = isinstance(self.events[zero[0]], Jump) and not ended
            if open_ is None:
                crossing = Crossing(row, row)
                crossing.zeros.append(zero)
                if not (jumps or ended):
                    yield crossing
                    continue
                open_ = crossing
            else:
                open_.zeros.append(zero)
            row += 2 if jumps else 0
        if open_ is not None:
            yield self._closed(open_, row)

    def _closed(self, crossing: Crossing, row: int) -> Crossing:
        """A crossing of which the last part begins at a row."""
        crossing.last = min(row + 1, len(self.run.t) - 1)
        return crossing

    def state(self, row: int) -> Any:
        """The state at a row, as formulas take it."""
        kind = type(self.run.last)
        return small_state(kind, {name: x[row] for name, x in self.run.states.items()})

    def stretches(self) -> list[tuple[int, int]]:
        """The first and the last rows between crossings that change the motion, before them and behind."""
        begins = [0, *[crossing.last for crossing in self.changed]]
        ends = [*[crossing.first for crossing in self.changed], len(self.run.t) - 1]
        return [*zip(begins, ends, strict=True)]

    def part(self, first: int, last: int, every: int = 1) -> Trajectory:
        """The run from a row to another one, of whose rows in between every n-th is kept."""
        rows, run = slice(first, last + 1, max(1, every)), self.run
        return dataclasses.replace(run, t=run.t[rows], states={name: x[rows] for name, x in run.states.items()})

    def stretch(self, first: int, last: int, names: tuple[str, ...]) -> np.ndarray:
        """The tangents from a row at it and at those behind it, up to the last one, (n, N, directions)."""
        start, bare, t = self.state(first), self.bare, self.run.t[first : last + 1]
        dressed = dressed_in(bare._steps.begun(t), t) if self.adaptive else None
        directions = Directions(self.system, bare._steps.method, start, names, dressed)
        if self.adaptive:
            bare = like(bare, _steps=repeated(bare, directions.method))
        run, _, _, tangent = carried_along(bare, start, last - first, 0.0 if self.adaptive else t.item(0), directions)
        if run.stopped:
            raise run.stopped[min(run.stopped)].error
        return tangent

    # ---------------------------------------------------------------- a crossing

    def leg(self, method: Any, system: Any, t: Any, state: Any, h: Any, end: Any = None) -> Any:
        """The state after a time h, inside of a step to the time `end`; of fixed steps after a step of the length h."""
        if end is None or not self.adaptive or method.shortens:
            return method.observe(method.step(system, t, method.start(system, state, h), h))
        of_plan, xi = self.bare._steps, system.rate(t, system.essential_part(state))
        trial = method.trial(system, t, state, xi, end - t, of_plan.rtol, of_plan.atol, True)
        return on_the_way(method.retraction, system, state, trial.curve, h / (end - t))

    def at_zero(self, event: Any, t: float, state: Any, at: float, end: float) -> tuple[float, Any, np.ndarray]:
        """At the zero of an event its rate, the state before it, and the rates of its numbers, all by the length of the step
        there.  Raises InvalidInput where the event grazes, or where the motion has jumped just then.
        """
        if at in (t, math.nextafter(t, end)):
            raise InvalidInput(
                f"Plan.tangent: {name_of(event)} is zero at t = {at:.10g}, where another event jumps: which comes first "
                "depends on rounding, and nothing there has a derivative. Begin elsewhere, or end the run before"
            )
        moved = self.leg(self._way(self.method), self.system, t, state, Dual(at - t, 1.0, LEVEL), end)
        value, numbers = event(Dual(at, 1.0, LEVEL), moved), leaves(moved, layout_of(state))
        rate, mean = slopes_of([value], 1).item(), abs(event(t, state) / (at - t))
        if not abs(rate) > GRAZING * mean:
            raise InvalidInput(
                f"Plan.tangent: {name_of(event)} grazes its zero at t = {at:.10g}, its rate there is {rate:.1e}, on the way "
                f"to it {mean:.1e}: the time of the zero has no derivative. Begin elsewhere, or end the run before"
            )
        return rate, resting(moved), slopes_of(numbers, 1)[0]

    def through(
        self, crossing: Crossing, directions: Directions, tangent: np.ndarray
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """The tangents behind a crossing, (N, directions), and the derivatives of the times of its zeros, (directions,)
        each.  tangent : (N, directions) where it begins.
        """
        moves = tangent.T @ directions.frames.basis(self.points(crossing.first))[0]
        # a number carries all directions; those by a table have systems of their own
        parts = [slice(k, k + 1) for k in range(len(moves))] if directions.varied else [slice(None)]
        changes, times = zip(*[self._along(crossing, directions, part, moves[part]) for part in parts])
        if crossing.last > crossing.first:
            ends = self.points(crossing.last)
            tangent = directions.frames.components(ends, np.concatenate(changes)[None])[0].T
        return tangent, [np.concatenate(of_zero) for of_zero in zip(*times)]

    def _along(
        self, crossing: Crossing, directions: Directions, some: slice, changes: np.ndarray
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """The changes of numbers of the state behind a crossing along some of the directions, (directions, numbers), and the
        derivatives of the times of its zeros.  changes : where it begins.
        """
        state, rows, width = self.state(crossing.first), directions.slopes[some], len(changes)
        of_method, of_system, _ = directions.places
        varied_system = directions.varied.get(some.start, directions.system)
        method = self._way(dual_of(directions.method, rows[:, of_method].T))
        system, layout = dual_of(varied_system, rows[:, of_system].T), layout_of(state)
        t, end, times = self.run.t.item(crossing.first), self.run.t.item(crossing.last), []  # type: Any, Any, list[np.ndarray]
        clock, moved = Dual(t, Vec(*[0.0] * width), LEVEL), dual_of(state, changes.T)
        at_end = None  # where the run ends inside of a step
        for number, at, whole in crossing.zeros:
            event = self.events[number]
            rate, before, rates = self.at_zero(event, t, state, at, whole)
            at_same_time = self.leg(method, system, clock, moved, at - clock, whole)
            dt = -slopes_of([event(at, at_same_time)], width)[:, 0] / rate
            times.append(dt)
            at_end = whole if self.run.ended == number and at == end else None
            if at_end is not None or not isinstance(event, Jump):
                continue
            changes = slopes_of(leaves(at_same_time, layout), width) + np.outer(dt, rates)
            clock, moved = Dual(at, Vec(*dt.tolist()), LEVEL), dual_of(before, changes.T)
            try:
                changes = slopes_of(leaves(event.jump_of(system).after(clock, moved), layout), width)
            except TypeError:  # one that numbers with derivatives do not go through, as `system.state`
                place = at, before, directions.frames
                changes = np.array([
                    self._jumped(event, varied_system, row[of_system], shift, *place, change)
                    for row, shift, change in zip(rows, dt.tolist(), changes)
                ])  # fmt: skip
            state, t = self.behind(event, self.system, at, before), at
            moved = dual_of(state, changes.T)
        if crossing.last == crossing.first:
            return changes, times
        if end != t:
            moved = self.leg(method, system, clock, moved, end - clock, at_end)
        else:  # where the run ends with a jump
            xi = self.system.rate(t, self.system.essential_part(state))
            moved = self.system.displaced(Exponential(), moved, (end - clock) * xi)
        return slopes_of(leaves(moved, layout), width), times

    def points(self, row: int) -> dict[str, np.ndarray]:
        """The parts of the state at a row, with a leading axis."""
        return {name: x[[row]] for name, x in self.run.states.items()}

    def _way(self, method: Any) -> Any:
        """The method as runs make its steps."""
        of_plan = self.bare._steps
        return method if self.adaptive else ending_at_jumps(method, self.system, of_plan.breaks)

    def behind(self, event: Any, system: Any, at: float, before: Any) -> Any:
        """The state behind a jump, in the layout of the one before it."""
        after = arguments.started(system, event.jump_of(system).after(at, before), None, at)
        return restricted(after, layout_of(before))

    def _jumped(
        self, event: Any, system: Any, of_system: np.ndarray, shift: float, at: float, before: Any, frames: Any,
        move: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """The derivative of the numbers behind a jump by differences: along a change of all numbers before it, of its time
        and of the numbers of the system.
        """
        points = {name: np.asarray(x)[None] for name, x in before.parts.items() if x is not None}
        along = frames.components(points, move[None, None])[0, 0]
        layout = layout_of(system)
        numbers = np.array(leaves(system, layout))

        def behind(x: float) -> np.ndarray:
            parts, k = dict(before.parts), 0
            for name, size in frames.sizes.items():
                part, change = parts[name], x * along[k : k + size]
                group, k = group_of(self.system) if name == "g" else None, k + size
                if group is not None:
                    parts[name] = group.compose_exp(part, Vec(*change.tolist()))
                else:
                    array = np.asarray(part)
                    parts[name] = small(array + np.tensordot(change, frames.of[name](array[None])[0], 1))
            moved = build(layout, iter((numbers + x * of_system).tolist())) if of_system.any() else system
            return packed(self.behind(event, moved, at + x * shift, type(before)(*parts.values())))

        size, nonzero = max([np.abs(x).max() for x in points.values()]), numbers != 0.0
        changes = (
            np.abs(along) / (size or 1.0),
            np.abs(of_system[nonzero] / numbers[nonzero]),
            [abs(shift) / self.near(at)],
        )
        largest = float(np.concatenate(changes).max())
        try:
            step = SMALL / (largest or 1.0)
            return sum(weight * (behind(k * step) - behind(-k * step)) for k, weight in EIGHTH) / step
        except Exception as error:
            raise IncompatibleSystem(
                f"Plan.tangent: then(t, state) of the jump at t = {at:g} is differentiated by differences, at states beside "
                f"the one where it is made; there it raised {type(error).__name__}: {error}"
            ) from error

    def near(self, at: float) -> float:
        """The length of the longest step near a time."""
        k = int(np.searchsorted(self.sign * self.run.t, self.sign * at))
        return float(np.abs(np.diff(self.run.t[max(0, k - 2) : k + 3])).max())


# ------------------------------------------------------------------ tangent maps


def tangent_with_events(
    plan: Any, start: Any, steps: Any, t_end: Any, t0: float, names: tuple[str, ...]
) -> TangentTrajectory:
    """The run of one body with its tangent map, and the derivatives of the times of its events; of its samples those at
    the ends of steps.
    """
    of_events = RunWithEvents(plan, start, steps, t_end, t0, names)
    run, all_names = of_events.run, ("start", *[name for name in names if name != "start"])
    whole = Directions(of_events.system, plan.method, start, all_names)
    count, crossings = whole.frames.count, [*of_events.crossings]
    tangent = np.eye(count, len(whole.slopes))
    rows: list[np.ndarray] = []
    tangents: list[np.ndarray] = []
    times: list[list[np.ndarray]] = [[] for _ in plan.events]
    for first, last in of_events.stretches():
        of_stretch = of_events.stretch(first, last, all_names)
        since_start = of_stretch[:, :, :count] @ tangent
        since_start[:, :, count:] += of_stretch[:, :, count:]
        rows.append(np.arange(first, last + 1))
        tangents.append(since_start)
        while crossings and crossings[0].first <= last:
            crossing = crossings.pop(0)
            tangent, of_zeros = of_events.through(crossing, whole, since_start[crossing.first - first])
            for (number, _, _), dt in zip(crossing.zeros, of_zeros):
                times[number].append(dt)
    at = np.concatenate(rows)
    if not plan.adaptive:  # of fixed steps every n-th, and the end
        h = plan._steps.h
        n = np.rint((run.t[at] - t0) / h)
        of_plan = (n % plan._steps.every == 0) | (at == at[-1])
        at, tangents = at[of_plan], [np.concatenate(tangents)[of_plan]]
    named = whole.named(np.concatenate(tangents))
    shapes = [np.array(dt).reshape(-1, 1, len(whole.slopes)) for dt in times]
    by_event = tuple([{name: x[:, 0] for name, x in whole.named(each).items() if name in names} for each in shapes])
    fields = {"system": of_events.system, "method": plan.method, "h": run.h, "bodies": None, "steps": run.steps}
    return TangentTrajectory(
        **fields, t=run.t[at], states={name: x[at] for name, x in run.states.items()}, rejected=run.rejected,
        compiled=run.compiled, events=run.events, ended=run.ended, time_tangents=by_event,
        tangent={name: named[name] for name in names},
    )  # fmt: skip


def slopes_of(numbers: list[Any], directions: int) -> np.ndarray:
    """The derivatives that numbers carry along so many directions, (directions, numbers)."""
    slopes = [x.slope if isinstance(x, Dual) else 0.0 for x in numbers]
    return np.array([np.broadcast_to(np.array(x, dtype=float), directions) for x in slopes]).T
