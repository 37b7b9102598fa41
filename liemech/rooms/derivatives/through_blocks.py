"""Gradients of long runs in bounded memory: how a function of where a run ends depends on its start and
on parameters.

The run is cut into blocks of steps.  It is made once, and keeps the states at which blocks begin.  Then
all blocks are bodies of one ensemble, each of them once for each direction, whose numbers carry the
derivative: the Jacobian J_k of block k by the state at its beginning, and B_k by the parameters that it
meets.  From the last block to the first one the derivative of the loss goes backwards,

    lambda_k = J_k^T lambda_(k+1),   dloss/dp = sum_k B_k^T lambda_(k+1).

A value of a table is met by few blocks, so that the cost does not grow with the number of values.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapters 3 (forward, within blocks) and 12
(checkpoints).
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ...errors import InvalidInput, NotCompilable
from ...formulas import record
from ...formulas.classes.layouts import layout_of
from ...formulas.classes.records import with_fields
from ...integrators.ending_at_jumps import ending_at_jumps, overshoot
from ...integrators.method import Wrapping
from ...simulation.compiled.execution import like
from ...simulation.compiled.parameters import full_name
from ...simulation.compiled.prepared import Steps
from ...simulation.compiled.systems import OfBodies
from ...simulation.reports.progress import Bar
from ...simulation.trajectory import Trajectory
from ...systems.in_time.knots import NEAR
from ...systems.in_time.tabulated import PiecewisePolynomial
from ...systems.system import State, member
from .blocks import Blocks, require_same
from .directions import Directions, with_step
from .frames import Frames, StatesInFrames, dual_basis
from .varied import Varied
from .varied_input import Tables

LANES = 384
"""Blocks and directions whose numbers are in memory at once."""

PIECE = 2**9
"""Blocks and directions that native code is given at once."""

LEAST, MOST = 32, 4096
"""Blocks of a long run of one body."""

LONGEST = 2**15
"""Steps of a block, as long as there are not too many blocks."""

FEW, SEVERAL, MANY = 3, 5, 12
"""Directions along which a number carries derivatives, at most; and of many directions."""

LONG = 32
"""Numbers of a state up to which they are several."""

OVERHEAD = 200
"""Steps of one direction that take as long as what there is to do for a block beside its steps."""


@record
class NumberedByTime(Wrapping):
    """Noisy steps whose numbers follow from the time, wherever they begin.

    t0 : when step 0 begins.
    """

    t0: float

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        number = float(round((t - self.t0) / h))
        return self.method.step(system, t, with_fields(memory, number=0.0 * memory.number + number), h)


class ParameterDirections:
    """The parameters by which all bodies are differentiated.

    plan : with fixed steps.  of_state : directions of the state.  count : those of parameters of which each
    block has all.  numbers : of a state.  side : along how many directions a number carries derivatives; 0 to
    choose.
    """

    def __init__(
        self, plan: Any, one: State, bodies: int | None, names: tuple[str, ...], t0: float, of_state: int, side: int = 0,
    ) -> None:  # fmt: skip
        fixed: Steps = plan._steps
        self.of_each = {"system": isinstance(fixed.system, OfBodies), "method": isinstance(fixed.method, OfBodies)}
        several = [fixed.system_of(i) for i in range(bodies or 1)] if self.of_each["system"] else [fixed.one]
        methods = [fixed.method_of(i) for i in range(bodies or 1)] if self.of_each["method"] else [fixed.method_of(0)]
        if "h" in names and isinstance(fixed.h, tuple):
            raise InvalidInput("Plan.gradient: by h is for one h of all bodies")
        dressed = with_step(fixed.h, t0) if "h" in names else None
        self.tables = tables = Tables(several[0], names, "Plan.gradient")
        self.of_things = [[table.of(thing) for thing in several] for table in tables.each]
        self.full = {
            name: name if name == "h" or name.startswith("method.") else full_name(several[0], name, "Plan.gradient")
            for name in names if name != "start" and name not in tables.by_name
        }  # fmt: skip
        several = [tables.in_system(system) for system in several]
        tables.find(several[0])
        others = one, tuple(self.full.values()), dressed
        each = [
            Directions(several[min(i, len(several) - 1)], methods[min(i, len(methods) - 1)], *others)
            for i in range(max(len(several), len(methods)))
        ]
        self.of_first = each[0]
        self.count = len(each[0].slopes)
        self.side = side = side or side_by_side(of_state + self.count, layout_of(one).width)
        moved = [place for table in tables.each for place in table.places["moved"].tolist()]
        slopes = np.array([directions.slopes for directions in each])
        of_method, of_system, _ = each[0].places
        self.systems = Varied(several, slopes[: len(several), :, of_system], moved, side)
        self.raw = [directions.method for directions in each[: len(methods)]]
        wrapped = self.raw if fixed.clock != "t" else [ending_at_jumps(x, several[0], fixed.breaks) for x in self.raw]
        wrapped = [NumberedByTime(method, t0) if method.noisy else method for method in wrapped]
        behind = layout_of(wrapped[0]).width - of_method.stop
        by_method = np.pad(slopes[: len(methods), :, of_method], ((0, 0), (0, 0), (0, behind)))
        self.methods = Varied(wrapped, by_method, (), side)

    def by(self, name: str, slopes: np.ndarray, of_tables: list[np.ndarray]) -> np.ndarray:
        """The derivative by a parameter: of each body, or the sum where it is the only one of all.

        slopes : (bodies, count), by the directions.  of_tables : by the intervals of each table.
        """
        if name in self.tables.by_name:
            table, values = self.tables.by_name[name]
            by_table = table.by(of_tables[self.tables.each.index(table)], values)
            return by_table if self.of_each["system"] else by_table[0]
        full, of_method = self.full[name], name == "h" or name.startswith("method.")
        by_body = slopes[:, self.of_first.columns[full]].reshape(-1, *self.of_first.shapes[full])
        return by_body if self.of_each["method" if of_method else "system"] else by_body.sum(axis=0)


# ------------------------------------------------------------------ the way forwards


class Forward:
    """A run, and the states at which its blocks begin.

    edges : (blocks + 1,) the numbers of the steps.  states : there.  example : a state as formulas take it, of many sites in
    a row.
    """

    def __init__(
        self, plan: Any, run: Trajectory, edges: np.ndarray, t0: float, frames: Frames, example: State
    ) -> None:
        self.plan, self.run, self.edges, self.t0, self.example = plan, run, edges, t0, example
        self.bodies = run.bodies or 1
        self.states = StatesInFrames(frames, {n: x if run.bodies else x[:, None] for n, x in run.states.items()})

    def times(self, body: int) -> tuple[np.ndarray, ...]:
        """Of all blocks the time and the length of the first step and of the last one."""
        first, last, steps = self.edges[:-1], self.edges[1:] - 1, self.plan._steps
        if steps.clock == "step":  # of a run by an error estimate
            begins, lengths = steps.method.begun.array, steps.method.lengths.array
            return begins[first], lengths[first], begins[last], lengths[last]
        h = steps.h_of(body)
        lengths = np.full(len(first), h)
        return self.t0 + first * h, lengths, self.t0 + last * h, lengths


def block_length(steps: int, lanes: int, directions: ParameterDirections, every: int) -> int:
    """How many steps a block has.  lanes : of a block, for all bodies.

    Values of a table are followed through all blocks that meet their interval.
    """
    blocks = max(LEAST // lanes, min(MOST, -(-steps // LONGEST)), -(-LEAST * 9 // lanes))
    length = max(1, -(-steps // blocks))
    tables = directions.tables.each
    if tables:
        intervals = sum(int(table.table.intervals) for table in tables)
        width = max(-(-table.width // directions.side) for table in tables)
        length = min(length, max(8, math.isqrt(int(steps * OVERHEAD / (intervals * width)))))
    return every // -(-every // length) if every % -(-every // length) == 0 else divisor(every, length)


def divisor(number: int, limit: int) -> int:
    """The largest divisor of a number up to a limit."""
    return max(d for k in range(1, math.isqrt(number) + 1) if number % k == 0 for d in (k, number // k) if d <= limit)


class MetIntervals:
    """The intervals of a table that blocks meet.

    first, count : (blocks, bodies) the first one, and how many.  intervals : of the table.
    """

    def __init__(self, forward: Forward, tables: list[PiecewisePolynomial]) -> None:
        plan_steps = forward.plan._steps
        self.intervals = int(tables[0].intervals)
        of_bodies = []
        for i in range(forward.bodies):
            table = tables[min(i, len(tables) - 1)]
            of_bodies.append(self._met(forward, table, i, overshoot(plan_steps.method_of(i))))
        self.first, self.count = (np.stack(x, axis=1) for x in zip(*of_bodies, strict=True))

    def _met(self, forward: Forward, table: Any, body: int, beyond: float) -> Any:
        """Those of one body, as its steps see them from inside."""
        begin, h, end, last = forward.times(body)
        inside = NEAR if forward.plan._steps.clock == "t" else -4.0 * NEAR  # beyond the ends, as in any of them
        ends = [
            (t, inside * np.maximum(np.abs(step), np.abs(step + length)), step + 0.5 * length)
            for t, step, length in ((begin, begin, h), (end + last, end, last))
        ]
        (low, slack_low, middle_low), (high, slack_high, middle_high) = ends if h[0] > 0.0 else ends[::-1]
        low = np.minimum(low + slack_low, middle_low) - beyond * np.abs(h)
        high = np.maximum(high - slack_high, middle_high) + beyond * np.abs(last)
        knots, n, turns = np.asarray(table.knots), int(table.intervals), 0
        if table.outside == "repeat":
            length = knots[-1] - knots[0]
            turn = (low - knots[0]) // length
            turns = ((high - turn * length - knots[0]) // length).astype(int)
            low, high = low - turn * length, high - turn * length - turns * length
        first = np.clip(np.searchsorted(knots, low, "right") - 1, 0, n - 1)
        count = np.clip(np.searchsorted(knots, high, "left") - 1, 0, n - 1) + n * turns - first + 1
        return first, np.clip(count, 1, n)

    def counting(self, block: np.ndarray, body: np.ndarray) -> np.ndarray:
        """The first and the last interval that may count in blocks of bodies, (2, n)."""
        first, last = self.first[block, body], self.first[block, body] + self.count[block, body] - 1
        again = last >= self.intervals  # it begins anew in the block
        return np.stack([np.where(again, 0, first), np.where(again, self.intervals - 1, last)])


# ------------------------------------------------------------------ the way backwards


def side_by_side(count: int, numbers: int) -> int:
    """Along how many of so many directions a number carries derivatives: they share its value, and the more
    there are, the fewer of them the processor has at hand.  numbers : of a state; with many of them
    the code of a step is long, and would be longer.
    """
    if numbers > LONG:
        return 1
    sides = range(1, 1 + (FEW if count <= MANY else SEVERAL))
    return min(sides, key=lambda n: (-(-count // n) * (1.0 + 0.6 * n + 0.05 * n * n), -n))


class PreparedGradient:
    """Layouts and native code that gradients of one system by the same names share."""

    def __init__(self, plan: Any, bodies: int | None, one: Any, names: Any, t0: float) -> None:
        self.system, self.frames = plan.system, Frames(plan._steps.one, one)
        self.arguments = plan, one, bodies, names, t0, self.frames.count
        self.directions = ParameterDirections(*self.arguments)
        self.blocks: Blocks | None = None

    def forward(self, plan: Any, start: State, steps: int, t0: float, every: int | None, run: Any) -> Forward:
        """A run in blocks: one that has kept all steps of an error estimate, or that of fixed steps.

        every : steps between states that are wanted; None for the end alone.
        """
        directions, first, end = self.directions, member(start, 0), max(1, steps)
        lanes = (start.bodies or 1) * -(-(self.frames.count + directions.count) // directions.side)
        length = block_length(end, lanes, directions, every or end)
        if run is None:
            one_body = like(plan, _sites=None, _steps=dataclasses.replace(plan._steps, every=length))
            whole = one_body._run(start, steps, None, t0, None, None)
            if whole.stopped:
                raise whole.stopped[min(whole.stopped)].error
            return Forward(plan, whole, np.minimum(np.arange(len(whole.t)) * length, steps), t0, self.frames, first)
        # step number n is made at the time n by a method that knows when it began and how long it was
        edges = np.minimum(np.arange(-(-steps // length) + 1) * length, steps)
        at_edges = dataclasses.replace(run, t=run.t[edges], states={name: x[edges] for name, x in run.states.items()})
        return Forward(plan, at_edges, edges, 0.0, self.frames, first)

    def blocks_of(self, forward: Forward, work: int) -> Blocks:
        """The code for the blocks of a run.  work : steps of all blocks and directions."""
        try:
            blocks = self.blocks or Blocks(forward.plan._steps, self.directions, forward.example)
            of_run = blocks.of_a_run(forward.t0, work)
        except NotCompilable:
            if self.directions.side == 1:
                raise
            self.directions, self.blocks = ParameterDirections(*self.arguments, side=1), None
            return self.blocks_of(forward, work)  # direction by direction the code is shorter
        self.blocks = blocks
        return of_run


def prepared(plan: Any, bodies: int | None, one: Any, names: Any, t0: float, lasting: bool) -> PreparedGradient:
    """The `PreparedGradient` of this plan, from before or made now.  lasting : do its steps not depend on a run?"""
    key = names, bodies, layout_of(one), t0 if "h" in names or plan._first_of("method").noisy else None
    shared: PreparedGradient | None = plan._backwards.get(key) if lasting else None
    if shared is None or shared.system is not plan.system:
        shared = PreparedGradient(plan, bodies, one, names, t0)
        if lasting:
            plan._backwards[key] = shared
    return shared


class Backward:
    """The derivative of a number by the start and by parameters, from the last block to the first one.

    felt : (edges, bodies, N) its derivatives by the states there.
    slope : (bodies, N) by the state at hand.  by_parameters : (bodies, parameters).  by_tables : of each table, (systems,
    intervals, coefficients).  growth : (bodies, N, N), the transposed tangent map from the state at hand to the end.
    """

    def __init__(self, forward: Forward, known: PreparedGradient, felt: np.ndarray) -> None:
        self.forward, self.felt, self.slope = forward, felt, felt[-1]
        self.bodies, self.count = bodies, count = felt.shape[1:]
        self.blocks = known.blocks_of(forward, int(forward.edges[-1]) * bodies * count)
        directions = self.directions = self.blocks.directions
        self.groups = -(-(count + directions.count) // directions.side)
        self.growth = np.broadcast_to(np.eye(count), (bodies, count, count))
        self.by_parameters = np.zeros((bodies, directions.count))
        systems = bodies if directions.of_each["system"] else 1
        self.by_tables = [np.zeros((systems, int(t.table.intervals), t.width)) for t in directions.tables.each]
        self.met = [MetIntervals(forward, tables) for tables in directions.of_things]

    def go(self) -> None:
        """Go backwards through all blocks."""
        blocks, edges = len(self.forward.edges) - 1, self.forward.edges
        chunk = max(1, LANES // (self.bodies * self.groups * self.directions.side))
        with Bar(self.forward.plan.options.progress, int(edges[-1])) as bar:
            for end in range(blocks, 0, -chunk):
                begin = max(0, end - chunk)
                self._chunk(begin, end, 1.0 - end / blocks)
                bar.advance(int(edges[end] - edges[begin]))

    def _chunk(self, begin: int, end: int, done: float) -> None:
        """Go backwards through some blocks."""
        basis, count = self.forward.states.basis(slice(begin, end + 1)), self.count
        through = begin, dual_basis(basis[1:]), done
        jacobians = self._jacobians(basis[:-1], through)
        cotangents = np.empty((end - begin, self.bodies, count))  # by the states at the ends of the blocks
        for k in range(end - begin - 1, -1, -1):
            cotangents[k] = self.slope
            pulled = (jacobians[k] @ self.slope[..., None])[..., 0]
            self.by_parameters += pulled[:, count:]
            self.slope = pulled[:, :count] + self.felt[begin + k]
            self.growth = jacobians[k, :, :count] @ self.growth
        for number in range(len(self.by_tables)):
            self._add_table(number, cotangents, through)

    def _jacobians(self, basis: np.ndarray, through: tuple[int, np.ndarray, float]) -> np.ndarray:
        """The transposed derivatives of the ends of blocks by their beginnings, with this basis, and by parameters, (blocks,
        bodies, N + parameters, N).
        """
        directions, side, count = self.directions, self.directions.side, self.count
        shape = *basis.shape[:2], self.groups
        block, body, group = (x.ravel() for x in np.indices(shape))
        moves = np.zeros((*shape[:2], self.groups * side, basis.shape[-1]))
        moves[:, :, :count] = basis
        parameter = group[:, None] * side + np.arange(side) - count
        parameter[(parameter < 0) | (parameter >= directions.count)] = -1
        ends = self._through(*through, block, body, moves.reshape(len(block), side, -1).transpose(2, 1, 0), parameter)
        return ends.reshape(*shape[:2], self.groups * side, count)[:, :, : count + directions.count]

    def _add_table(self, number: int, cotangents: np.ndarray, through: tuple[int, np.ndarray, float]) -> None:
        """Add the derivative by the coefficients of a table, each by the blocks that meet its interval."""
        met, side, begin = self.met[number], self.directions.side, through[0]
        table = self.directions.tables.each[number]
        block, body = (x.ravel() for x in np.indices(cotangents.shape[:2]))
        count = met.count[begin + block, body]
        each = np.repeat(np.arange(len(block)), count)
        after = np.arange(len(each)) - np.repeat(np.cumsum(count) - count, count)
        interval = (met.first[begin + block, body][each] + after) % met.intervals
        component = np.arange(-(-table.width // side) * side).reshape(-1, side)
        component[component >= table.width] = -1
        each, interval = np.repeat(each, len(component)), np.repeat(interval, len(component))
        component, block, body = np.tile(component, (int(count.sum()), 1)), block[each], body[each]
        ends = self._through(*through, block, body, table=(number, component, interval))
        pulled = (ends @ cotangents[block, body][..., None])[..., 0]
        lane, slot = np.nonzero(component >= 0)
        system = body[lane] if len(self.by_tables[number]) > 1 else np.zeros_like(lane)
        np.add.at(self.by_tables[number], (system, interval[lane], component[lane, slot]), pulled[lane, slot])

    def _through(
        self, begin: int, duals: np.ndarray, done: float, block: np.ndarray, body: np.ndarray,
        moves: Any = None, parameter: Any = None, table: Any = (None, None, None),
    ) -> np.ndarray:  # fmt: skip
        """The changes of the ends of blocks of bodies, (lanes, side, N), along changes of their beginnings, (width, side,
        lanes), of parameters, by their numbers, and of a table, its number, coefficients and intervals; -1 for none.
        """
        forward, directions, side = self.forward, self.directions, self.directions.side
        changes = np.empty((len(block), side, self.count))
        none = np.full((len(block), side), -1)
        for at in range(0, len(block), PIECE // side):
            some = slice(at, at + PIECE // side)
            k, i = begin + block[some], body[some]
            values = forward.states.numbers[k, i]
            starts = np.zeros((values.shape[1], 1 + side, len(values)))
            starts[:, 0] = values.T
            if moves is not None:
                starts[:, 1:] = moves[..., some]
            along = (none if parameter is None else parameter)[some]
            systems, methods = directions.systems.columns(i, along), directions.methods.columns(i, along)
            for n, each in enumerate(directions.tables.each):
                varied = (table[1][some], table[2][some]) if table[0] == n else (none[some], none[some, 0])
                counting, of_bodies = self.met[n].counting(k, i), directions.of_things[n]
                each.write(directions.systems, systems, *varied, counting, i, of_bodies)
            first, last = forward.edges[k].astype(float), forward.edges[k + 1].astype(float)
            ends = self.blocks.run(starts.reshape(-1, len(values)), i, first, last, systems, methods, done)
            ends = ends.reshape(starts.shape)
            require_same(forward.plan.method, ends[:, 0].T, forward.states.numbers[k + 1, i])
            changes[some] = ends[:, 1:].transpose(2, 1, 0) @ duals[k - begin, i]
        return changes

    def relative_growth(self) -> float:
        """The growth of the worst body beside the size of each part of the state, which units do not change."""
        frames, at, scales = self.forward.states.frames, 0, []
        for name, width in frames.widths.items():
            largest = np.abs(self.forward.states.numbers[..., at : at + width]).max(axis=(0, 2))
            at += width
            scale = np.where(largest > 0.0, largest, 1.0) if name != "g" else np.ones(self.bodies)
            scales.append(np.repeat(scale[:, None], frames.sizes[name], axis=1))
        scale = np.concatenate(scales, axis=1)
        return float(np.linalg.norm(self.growth * scale[:, :, None] / scale[:, None, :], 2, axis=(1, 2)).max())

    def by(self, name: str) -> np.ndarray:
        """The derivative by the start, or by a parameter."""
        return self.slope if name == "start" else self.directions.by(name, self.by_parameters, self.by_tables)
