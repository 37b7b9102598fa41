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
import warnings
from typing import Any

import numpy as np

from ...errors import InvalidInput, NotCompilable
from ...formulas import record
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import layout_of
from ...formulas.classes.records import with_fields
from ...integrators.ending_at_jumps import ending_at_jumps, overshoot
from ...integrators.method import Wrapping
from ...simulation.compiled.execution import like
from ...simulation.compiled.parameters import full_name, parameter, shape_of
from ...simulation.compiled.prepared import Steps
from ...simulation.compiled.systems import OfBodies
from ...simulation.reports.progress import Bar
from ...simulation.trajectory import Trajectory
from ...systems.in_time.knots import NEAR
from ...systems.in_time.tabulated import PiecewisePolynomial
from ...systems.system import State, member
from .blocks import Blocks, require_same
from .frames import Frames, StatesInFrames, dual_basis
from .tangent import parameter_moves, slope, with_step
from .varied import Varied
from .varied_input import table_of

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


@frozen
class LossParameter:
    """A parameter by which a loss is differentiated.

    name : as it was given.  place : the first direction, of a table None.  shape : of its value.
    of_method : is it one of the method?
    varied : a table.  values : are the values of a table asked for, or its coefficients?
    """

    name: str
    place: Any
    shape: tuple[int, ...]
    of_method: bool = False
    varied: Any = None
    values: bool = False


@record
class NumberedByTime(Wrapping):
    """Noisy steps whose numbers follow from the time, wherever they begin.

    t0 : when step 0 begins.
    """

    t0: float

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        """The step of this time."""
        number = float(round((t - self.t0) / h))
        return self.method.step(system, t, with_fields(memory, number=0.0 * memory.number + number), h)


class ParameterDirections:
    """The parameters by which all bodies are differentiated.

    plan : with fixed steps.  of_state : directions of the state.  count : those of parameters of which each
    block has all.  numbers : of a state.  side : along how many directions a number carries derivatives; 0 to
    choose.
    """

    def __init__(
        self, plan: Any, bodies: int | None, names: tuple[str, ...], t0: float, of_state: int,
        numbers: int, side: int = 0,
    ) -> None:  # fmt: skip
        way: Steps = plan._steps
        self.own = isinstance(way.system, OfBodies)
        self.own_methods = own_methods = isinstance(way.method, OfBodies)
        several = [way.system_of(i) for i in range(bodies or 1)] if self.own else [way.one]
        methods = [way.method_of(i) for i in range(bodies or 1)] if own_methods else [way.method_of(0)]
        if "h" in names:
            if isinstance(way.h, tuple):
                raise InvalidInput("Plan.gradient: by h is for one h of all bodies")
            methods = [with_step(method, way.h, t0)(method) for method in methods]
        self.parameters: list[LossParameter] = []
        self.count = 0
        by_system: list[Any] = []
        by_method: list[Any] = []
        for name in dict.fromkeys(names):
            if name == "start":
                continue
            if name == "h" or name.startswith("method."):
                inner = name if "h" in names else name.removeprefix("method.")
                moves = [parameter_moves(method, inner) for method in methods]
                value = parameter(methods[0], inner)
                by_method += zip(*moves, strict=True)
                by_system += [None] * len(moves[0])
            else:
                known = [p.varied for p in self.parameters if p.varied]
                table = table_of(several[0], name, "Plan.gradient", known)
                if table is not None:
                    self.parameters.append(LossParameter(name, None, (), False, *table))
                    continue
                full = full_name(several[0], name, "Plan.gradient")
                moves = [parameter_moves(system, full) for system in several]
                value = parameter(several[0], full)
                by_system += zip(*moves, strict=True)
                by_method += [None] * len(moves[0])
            shape = shape_of(layout_of(value))
            shape = (len(moves[0]),) if shape is None else shape
            self.parameters.append(LossParameter(name, self.count, shape, by_system[-1] is None))
            self.count += len(moves[0])
        self.side = side = side or side_by_side(of_state + self.count, numbers)
        self.tables = [*{id(p.varied): p.varied for p in self.parameters if p.varied}.values()]
        one = self._dressed(several[0])
        for table in self.tables:
            table.find(one)
        moved = [place for table in self.tables for place in table.places["moved"].tolist()]
        dressed = [self._dressed(system) for system in several]
        slopes = self._slopes(dressed, by_system, self._dressed)
        self.systems = Varied(dressed, slopes, moved, side)
        self.raw = methods
        self.of_things = [[table.of(thing) for thing in several] for table in self.tables]
        wrapped = methods if way.clock != "t" else [ending_at_jumps(method, one, way.breaks) for method in methods]
        wrapped = [NumberedByTime(method, t0) if method.noisy else method for method in wrapped]
        slopes = self._slopes(methods, by_method, lambda method: method)
        more = layout_of(wrapped[0]).width - slopes.shape[2]
        self.methods = Varied(wrapped, np.pad(slopes, ((0, 0), (0, 0), (0, more))), (), side)

    def _dressed(self, system: Any) -> Any:
        """A system with the tables as they carry derivatives."""
        for table in self.tables:
            system = table.in_system(system)
        return system

    def _slopes(self, things: Any, moves: list[Any], dressed: Any) -> np.ndarray:
        """How the numbers of things change, (things, directions, numbers)."""
        layout = layout_of(things[0])
        found = np.zeros((len(things), self.count, layout.width))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of parameters beside those that were given
            for d, each in enumerate(moves):
                for i, (to, step) in enumerate(each or ()):
                    found[i, d] = slope(lambda x, to=to: dressed(to(x)), step, layout, "value")
        found[..., [kind != "number" for kind in layout.kinds]] = 0.0
        return found


# ------------------------------------------------------------------ the way forwards


class Forward:
    """A run, and the states at which its blocks begin.

    edges : (blocks + 1,) the numbers of the steps.  states : there.  example : a state as formulas take it, of many sites in
    a row.  begins, lengths : of the steps of a run by an error estimate.
    """

    def __init__(self, plan: Any, run: Trajectory, edges: np.ndarray, t0: float, frames: Frames, example: State,
                 begins: Any = None, lengths: Any = None) -> None:  # fmt: skip
        self.plan, self.run, self.edges, self.t0, self.example = plan, run, edges, t0, example
        self.begins, self.lengths, self.bodies = begins, lengths, run.bodies or 1
        self.states = StatesInFrames(frames, {n: x if run.bodies else x[:, None] for n, x in run.states.items()})

    def times(self, body: int) -> tuple[np.ndarray, ...]:
        """Of all blocks the time and the length of the first step and of the last one."""
        first, last, h = self.edges[:-1], self.edges[1:] - 1, self.plan._steps.h_of(body)
        if self.begins is not None:
            return self.begins[first], self.lengths[first], self.begins[last], self.lengths[last]
        lengths = np.full(len(first), h)
        return self.t0 + first * h, lengths, self.t0 + last * h, lengths


def block_length(steps: int, lanes: int, directions: ParameterDirections, every: int) -> int:
    """How many steps a block has.  lanes : of a block, for all bodies.

    Values of a table are followed through all blocks that meet their interval.
    """
    blocks = max(LEAST // lanes, min(MOST, -(-steps // LONGEST)), -(-LEAST * 9 // lanes))
    length = max(1, -(-steps // blocks))
    if directions.tables:
        intervals = sum(int(table.table.intervals) for table in directions.tables)
        width = max(-(-table.width // directions.side) for table in directions.tables)
        length = min(length, max(8, math.isqrt(int(steps * OVERHEAD / (intervals * width)))))
    return every // -(-every // length) if every % -(-every // length) == 0 else divisor(every, length)


def divisor(number: int, limit: int) -> int:
    """The largest divisor of a number up to a limit."""
    found = [d for k in range(1, math.isqrt(number) + 1) if number % k == 0 for d in (k, number // k)]
    return max(d for d in found if d <= limit)


class MetIntervals:
    """The intervals of a table that blocks meet.

    first, count : (blocks, bodies) the first one, and how many.  intervals : of the table.
    """

    def __init__(self, forward: Forward, tables: list[PiecewisePolynomial]) -> None:
        way = forward.plan._steps
        self.intervals = int(tables[0].intervals)
        found = []
        for i in range(forward.bodies):
            own = tables[min(i, len(tables) - 1)]
            found.append(self._met(forward, own, i, overshoot(way.method_of(i))))
        self.first, self.count = (np.stack(x, axis=1) for x in zip(*found, strict=True))

    def _met(self, forward: Forward, table: Any, body: int, beyond: float) -> Any:
        """Those of one body, as its steps see them from inside."""
        begin, h, end, last = forward.times(body)
        ends = [np.stack([t, t + s]) for t, s in ((begin, h), (end, last))]
        inside = 1.0 if forward.plan._steps.clock == "t" else -4.0  # beyond the ends, as in any of them
        slack = [inside * NEAR * np.abs(x).max(axis=0) for x in ends]
        low = np.minimum(ends[0].min(axis=0) + slack[0], begin + 0.5 * h)
        high = np.maximum(ends[1].max(axis=0) - slack[1], end + 0.5 * last)
        if h[0] < 0.0:
            low = np.minimum(ends[1].min(axis=0) + slack[1], end + 0.5 * last)
            high = np.maximum(ends[0].max(axis=0) - slack[0], begin + 0.5 * h)
        low, high = low - beyond * np.abs(h), high + beyond * np.abs(last)
        knots, n = np.asarray(table.knots), int(table.intervals)
        if table.outside == "repeat":
            length = knots[-1] - knots[0]
            turn = (low - knots[0]) // length
            low, high = low - turn * length, high - turn * length
            turns = (high - knots[0]) // length
            first = np.clip(np.searchsorted(knots, low, "right") - 1, 0, n - 1)
            last_one = np.searchsorted(knots, high - turns * length, "left") - 1
            count = np.clip(last_one, 0, n - 1) + n * turns.astype(int) - first + 1
            return first, np.clip(count, 1, n)
        first = np.clip(np.searchsorted(knots, low, "right") - 1, 0, n - 1)
        return first, np.clip(np.searchsorted(knots, high, "left") - 1, 0, n - 1) - first + 1


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
        self.given = plan, bodies, names, t0, self.frames.count, layout_of(one).width
        self.directions = ParameterDirections(*self.given)
        self.blocks: Blocks | None = None

    def forward(self, plan: Any, start: State, steps: int, t0: float, every: int | None, run: Any) -> Forward:
        """A run in blocks: one that has kept all steps of an error estimate, or that of fixed steps.

        every : steps between states that are wanted; None for the end alone.
        """
        directions, one, end = self.directions, member(start, 0), max(1, steps)
        lanes = (start.bodies or 1) * -(-(self.frames.count + directions.count) // directions.side)
        length = block_length(end, lanes, directions, every or end)
        if run is None:
            made = like(plan, _steps=dataclasses.replace(plan._steps, every=length))._run(
                start, steps, None, t0, None, None
            )
            if made.stopped:
                raise made.stopped[min(made.stopped)].error
            return Forward(plan, made, np.minimum(np.arange(len(made.t)) * length, steps), t0, self.frames, one)
        # step number n is made at the time n by a method that knows when it began and how long it was
        edges = np.minimum(np.arange(-(-steps // length) + 1) * length, steps)
        some = dataclasses.replace(run, t=run.t[edges], states={name: x[edges] for name, x in run.states.items()})
        return Forward(plan, some, edges, 0.0, self.frames, one, plan.begun, run.t[1:] - plan.begun)

    def blocks_of(self, way: Steps, forward: Forward, work: int) -> Blocks:
        """The code for the blocks of a run.  work : steps of all blocks and directions."""
        several = self.directions.side > 1
        try:
            blocks = self.blocks or self._blocks(self.directions, way, forward)
            own = blocks.of_a_run(forward.t0, work, several)
        except NotCompilable:
            if not several:
                raise
            # direction by direction the code is shorter
            self.directions = ParameterDirections(*self.given, 1)
            blocks = self._blocks(self.directions, way, forward)
            own = blocks.of_a_run(forward.t0, work, False)
        self.blocks = blocks
        return own

    @staticmethod
    def _blocks(directions: ParameterDirections, way: Steps, forward: Forward) -> Blocks:
        given = dataclasses.replace(way, system=directions.systems.example, method=directions.raw[0], shapes={})
        return Blocks(given, directions, forward.example)


def prepared(plan: Any, bodies: int | None, one: Any, names: Any, t0: float, lasting: bool) -> PreparedGradient:
    """The `PreparedGradient` of this plan, from before or made now.  lasting : do its steps not depend on a run?"""
    key = names, bodies, layout_of(one), t0 if "h" in names or plan._first_of("method").noisy else None
    known: PreparedGradient | None = plan._backwards.get(key) if lasting else None
    if known is None or known.system is not plan.system:
        known = PreparedGradient(plan, bodies, one, names, t0)
        if lasting:
            plan._backwards[key] = known
    return known


class Backward:
    """The derivative of a loss, from the last block to the first one.

    felt : (edges, bodies, N) the derivatives by the states there.
    """

    def __init__(self, forward: Forward, known: PreparedGradient, felt: np.ndarray) -> None:
        self.forward, self.felt = forward, felt
        way = forward.plan._steps
        self.bodies, self.count = bodies, count = felt.shape[1:]
        work = int(forward.edges[-1]) * bodies * count
        self.blocks = known.blocks_of(way, forward, work)
        directions = self.directions = self.blocks.directions
        self.side = directions.side
        self.groups = -(-(count + directions.count) // self.side)
        self.lanes_of_block = bodies * self.groups
        self.slope = felt[-1]
        self.growth = np.broadcast_to(np.eye(count), (bodies, count, count))
        self.found = np.zeros((bodies, directions.count))
        self.of_tables = [
            np.zeros((bodies if directions.own else 1, int(t.table.intervals), t.width)) for t in directions.tables
        ]

        self.met = [MetIntervals(forward, tables) for tables in directions.of_things]

    def go(self) -> None:
        """Go backwards through all blocks."""
        blocks, edges = len(self.forward.edges) - 1, self.forward.edges
        chunk = max(1, LANES // (self.lanes_of_block * self.side))
        with Bar(self.forward.plan.options.progress, int(edges[-1])) as bar:
            for end in range(blocks, 0, -chunk):
                begin = max(0, end - chunk)
                self._chunk(begin, end, 1.0 - end / blocks)
                bar.advance(int(edges[end] - edges[begin]))

    def _chunk(self, begin: int, end: int, done: float) -> None:
        """Go backwards through some blocks."""
        forward, directions = self.forward, self.directions
        many, bodies, count = end - begin, self.bodies, self.count
        basis = forward.states.basis(slice(begin, end + 1))
        duals = dual_basis(basis[1:])
        each, side, groups = count + directions.count, self.side, self.groups
        k, i, group = (x.ravel() for x in np.indices((many, bodies, groups)))
        d = group[:, None] * side + np.arange(side)
        moves = np.zeros((many, bodies, groups * side, basis.shape[-1]))
        moves[:, :, :count] = basis[:-1]
        moves = moves.reshape(len(k), side, -1).transpose(2, 1, 0)
        d = np.where((d < count) | (d >= each), -1, d - count)
        lanes: list[Any] = [(k, i, d, moves, None)]
        for number, table in enumerate(directions.tables):
            lanes.append(self._lanes_of_table(number, table, begin, end))
        found = self._through(begin, lanes[0], duals, done)
        jacobians = found.reshape(many, bodies, groups * side, count)[:, :, :each]
        after = np.empty((many, bodies, count))
        for n in range(many - 1, -1, -1):
            after[n] = self.slope
            moved = (jacobians[n] @ self.slope[..., None])[..., 0]
            self.found += moved[:, count:]
            self.slope = moved[:, :count] + self.felt[begin + n]
            self.growth = jacobians[n, :, :count] @ self.growth
        for number, own in enumerate(lanes[1:]):
            found = self._through(begin, own, duals, done)
            moved = (found @ after[own[0], own[1]][..., None])[..., 0]
            into = self.of_tables[number]
            body = own[1] if len(into) > 1 else np.zeros_like(own[1])
            lane, slot = np.nonzero(own[4][1] >= 0)
            place = body[lane], own[4][2][lane], own[4][1][lane, slot]
            np.add.at(into, place, moved[lane, slot])

    def _lanes_of_table(self, number: int, table: Any, begin: int, end: int) -> Any:
        """The directions of a table in some blocks."""
        met = self.met[number]
        k, i = (x.ravel() for x in np.indices((end - begin, self.bodies)))
        count = met.count[begin + k, i]
        which = np.repeat(np.arange(len(k)), count)
        after = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        interval = (met.first[begin + k, i][which] + after) % int(table.table.intervals)
        component = np.arange(-(-table.width // self.side) * self.side).reshape(-1, self.side)
        component[component >= table.width] = -1
        rows = len(component)
        component = np.tile(component, (len(which), 1))
        which, interval = np.repeat(which, rows), np.repeat(interval, rows)
        k, i = k[which], i[which]
        return k, i, np.full(component.shape, -1), None, (number, component, interval)

    def _counting(self, number: int, block: np.ndarray, body: np.ndarray) -> Any:
        """The first and the last interval of a table that may count in blocks."""
        met = self.met[number]
        first, last = met.first[block, body], met.first[block, body] + met.count[block, body] - 1
        all_of_them = last >= met.intervals  # it begins anew in the block
        return np.where(all_of_them, 0, first), np.where(all_of_them, met.intervals - 1, last)

    def relative_growth(self) -> float:
        """The growth of the worst body beside the size of each part of the state, which units do not change."""
        frames, at, scales = self.forward.states.frames, 0, []
        for name, width in frames.widths.items():
            largest = np.abs(self.forward.states.numbers[..., at : at + width]).max(axis=(0, 2))
            at += width
            scale = np.where(largest > 0.0, largest, 1.0) if name != "g" else np.ones(self.bodies)
            scales.append(np.repeat(scale[:, None], frames.sizes[name], axis=1))
        scale = np.concatenate(scales, axis=1)
        found = self.growth * scale[:, :, None] / scale[:, None, :]
        return float(np.linalg.norm(found, 2, axis=(1, 2)).max())

    def by(self, name: str) -> np.ndarray:
        """The derivative by a parameter."""
        if name == "start":
            return self.slope
        mine = next(p for p in self.directions.parameters if p.name == name)
        if mine.varied is not None:
            number = next(n for n, t in enumerate(self.directions.tables) if t is mine.varied)
            found = mine.varied.by(self.of_tables[number], mine.values)
            return found if self.directions.own else found[0]
        size = math.prod(mine.shape)
        found = self.found[:, mine.place : mine.place + size].reshape(-1, *mine.shape)
        of_each = self.directions.own_methods if mine.of_method else self.directions.own
        return found if of_each else found.sum(axis=0)

    def _through(self, begin: int, lanes: Any, duals: np.ndarray, done: float) -> np.ndarray:
        """Take directions through their blocks: the components of what becomes of them, (lanes, side, N)."""
        k, i, d, moves, table = lanes
        forward, directions = self.forward, self.directions
        side = self.side
        found = np.empty((len(k), side, self.count))
        piece = PIECE // side
        for at in range(0, len(k), piece):
            some = slice(at, at + piece)
            block, body = k[some], i[some]
            values = forward.states.numbers[begin + block, body]
            starts = np.zeros((values.shape[1], 1 + side, len(values)))
            starts[:, 0] = values.T
            if moves is not None:
                starts[:, 1:] = moves[..., some]
            systems = directions.systems.columns(body, d[some])
            methods = directions.methods.columns(body, d[some])
            for n, own in enumerate(directions.tables):
                mine = table is not None and table[0] == n
                component = table[1][some] if mine else np.full((len(body), side), -1)
                interval = table[2][some] if mine else component[:, 0]
                part = np.stack(self._counting(n, begin + block, body))
                tables = directions.of_things[n]
                own.write(directions.systems, systems, component, interval, part, body, tables)
            first, last = forward.edges[begin + block], forward.edges[begin + block + 1]
            out = self.blocks.run(
                starts.reshape(-1, len(values)), body, first.astype(float), last.astype(float),
                systems, methods, done,
            ).reshape(starts.shape)  # fmt: skip
            require_same(forward.plan.method, out[:, 0].T, forward.states.numbers[begin + block + 1, body])
            found[some] = out[:, 1:].transpose(2, 1, 0) @ duals[block, body]
        return found
