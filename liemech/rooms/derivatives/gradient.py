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

from ...errors import GradientWarning, IncompatibleSystem, InvalidInput, NotCompilable, warn
from ...formulas import record
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import layout_of
from ...formulas.classes.records import with_fields
from ...integrators.ending_at_jumps import ending_at_jumps, overshoot
from ...integrators.method import Wrapping
from ...simulation import arguments
from ...simulation.between.dense import flat
from ...simulation.compiled.execution import like
from ...simulation.compiled.parameters import full_name, parameter, shape_of
from ...simulation.compiled.prepared import Steps
from ...simulation.compiled.systems import OfBodies
from ...simulation.reports.progress import Bar
from ...simulation.result import of_some
from ...simulation.trajectory import Trajectory
from ...systems.in_time.knots import NEAR
from ...systems.in_time.tabulated import PiecewisePolynomial
from ...systems.system import State, member
from .blocks import Blocks, require_same
from .frames import basis_of, real_numbers
from .losses import Loss
from .of_sites.pullback import goes_by_sites, gradient_by_sites
from .tangent import derived, frames_of, in_steps, parameter_moves, slope, with_step
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


@frozen(eq=False)
class Gradient:
    """A loss, and its derivatives.

    value : the loss, of an ensemble the sum of all bodies; None where a cotangent was given.
    gradient : by name, in the shape of the parameter; with several systems the first axis is that of
    bodies.  "start" is (N,), or (bodies, N), in the frames of tangent maps: of a group element dg = g
    hat(eta).
    run : of the samples that were kept, or of start and end.
    growth : the norm of the tangent map J from the start to the end, of the worst body: by so much a
    disturbance grows, and the rounding of the run with it.  Of many sites, where |J| would take a run for
    each direction, it is |J^T w|/|w|, w the derivative by the last state, which is at most |J|; with
    running costs None.
    """

    value: Any
    gradient: dict[str, np.ndarray]
    run: Trajectory
    growth: float | None

    def __getitem__(self, name: str) -> np.ndarray:
        return self.gradient[name]


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

    edges : (blocks + 1,) the numbers of the steps.  numbers : (blocks + 1, bodies, width) the states there.
    example : a state as formulas take it, of many sites in a row.
    """

    def __init__(self, plan: Any, run: Trajectory, edges: np.ndarray, t0: float, frames: Any, example: State) -> None:
        self.plan, self.run, self.edges, self.t0 = plan, run, edges, t0
        self.bodies = run.bodies or 1
        states = {n: x if run.bodies else x[:, None] for n, x in run.states.items()}
        count = len(edges) * self.bodies
        rows = flat({n: x.reshape(count, *x.shape[2:]) for n, x in states.items()}, count)
        self.numbers = rows.reshape(len(edges), self.bodies, -1)
        self.example = example
        self.frames = frames
        self.sizes = {n: layout_of(self.example.parts[n]).width for n in self.frames}
        points = {n: np.asarray(self.example.parts[n])[None] for n in self.frames}
        self.directions = {n: len(of(points[n])[0]) for n, of in self.frames.items()}

    def times(self, body: int) -> tuple[np.ndarray, ...]:
        """Of all blocks the time and the length of the first step and of the last one."""
        first, last, h = self.edges[:-1], self.edges[1:] - 1, self.plan._steps.h_of(body)
        lengths = np.full(len(first), h)
        return self.t0 + first * h, lengths, self.t0 + last * h, lengths

    def at(self, some: slice) -> np.ndarray:
        """The times of some edges."""
        return self.run.t[some]

    def basis(self, some: slice) -> np.ndarray:
        """The directions in which the states at some edges can move, (edges, bodies, N, width)."""
        numbers, ahead = self.numbers[some], 2 if self.run.bodies else 1
        states = {n: x[some].reshape(-1, *x.shape[ahead:]) for n, x in self.run.states.items()}
        return basis_of(self.frames, states).reshape(*numbers.shape[:2], -1, numbers.shape[-1])


def components(basis: np.ndarray) -> np.ndarray:
    """P of the components c = dx P of changes dx = c E of numbers along the rows of bases E, (..., width, N)."""
    q, r = np.linalg.qr(np.swapaxes(basis, -1, -2))
    return q @ np.linalg.inv(np.swapaxes(r, -1, -2))


def forwards(plan: Any, start: State, steps: int, t0: float, length: int, frames: Any) -> Forward:
    """The run with fixed steps, in blocks of some length."""
    way = dataclasses.replace(plan._steps, every=length)
    run = like(plan, _steps=way)._run(start, steps, None, t0, None, None)
    if run.stopped:
        raise run.stopped[min(run.stopped)].error
    edges = np.minimum(np.arange(len(run.t)) * length, steps)
    return Forward(plan, run, edges, t0, frames, member(start, 0))


class ForwardAdaptive(Forward):
    """A run by an error estimate, which has kept all steps, in blocks of some of them; step number n is made
    at the time n by a method that knows when it began and how long it was.
    """

    def __init__(self, plan: Any, run: Trajectory, length: int, frames: Any, example: State) -> None:
        steps = len(run.t) - 1
        edges = np.minimum(np.arange(-(-steps // length) + 1) * length, steps)
        self.begun = plan.begun
        self.lengths = run.t[1:] - self.begun
        some = dataclasses.replace(run, t=run.t[edges], states={name: x[edges] for name, x in run.states.items()})
        super().__init__(plan, some, edges, 0.0, frames, example)

    def times(self, body: int) -> tuple[np.ndarray, ...]:
        first, last = self.edges[:-1], self.edges[1:] - 1
        begun, lengths = self.begun, self.lengths
        return begun[first], lengths[first], begun[last], lengths[last]


def block_length(steps: int, many: int, intervals: int, width: int, every: int) -> int:
    """How many steps a block has.

    many : directions of all bodies.  intervals : of tables that vary, in the whole run.  width : directions of
    each of them, which are followed through all blocks that meet the interval.
    """
    blocks = max(LEAST // many, min(MOST, -(-steps // LONGEST)), -(-LEAST * 9 // many))
    length = max(1, -(-steps // blocks))
    if intervals:
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
    """Layouts and native code that gradients of one system by the same names share.

    frames : of each part of a state the directions in which it moves.  count : of all parts.
    """

    def __init__(self, plan: Any, bodies: int | None, one: Any, names: Any, t0: float) -> None:
        self.system, self.frames = plan.system, frames_of(plan._steps.one, one)
        self.count = sum(len(of(np.asarray(one.parts[n])[None])[0]) for n, of in self.frames.items())
        self.given = plan, bodies, names, t0, self.count, layout_of(one).width
        self.directions = ParameterDirections(*self.given)
        self.blocks: Blocks | None = None

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

    at_end : (bodies, N) the derivative by the last state.  along : None, or a function of edges, (slice), that
    gives the derivatives by the states there, (edges, bodies, N).
    """

    def __init__(self, forward: Forward, known: PreparedGradient, at_end: np.ndarray, along: Any) -> None:
        self.forward, self.along = forward, along
        way = forward.plan._steps
        bodies, count = at_end.shape
        self.bodies, self.count = bodies, count
        work = int(forward.edges[-1]) * bodies * count
        self.blocks = known.blocks_of(way, forward, work)
        directions = self.directions = self.blocks.directions
        self.side = directions.side
        self.groups = -(-(count + directions.count) // self.side)
        self.lanes_of_block = bodies * self.groups
        self.slope = at_end
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
        basis = forward.basis(slice(begin, end + 1))
        parts = components(basis[1:])
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
        found = self._through(begin, lanes[0], parts, done)
        jacobians = found.reshape(many, bodies, groups * side, count)[:, :, :each]
        after = np.empty((many, bodies, count))
        by_sample = None if self.along is None else self.along(slice(begin, end), basis[:-1])
        for n in range(many - 1, -1, -1):
            after[n] = self.slope
            moved = (jacobians[n] @ self.slope[..., None])[..., 0]
            self.found += moved[:, count:]
            self.slope = moved[:, :count]
            if by_sample is not None:
                self.slope = self.slope + by_sample[n]
            self.growth = jacobians[n, :, :count] @ self.growth
        for number, own in enumerate(lanes[1:]):
            found = self._through(begin, own, parts, done)
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
        forward, at, scales = self.forward, 0, []
        for name, size in forward.sizes.items():
            largest = np.abs(forward.numbers[..., at : at + size]).max(axis=(0, 2))
            at += size
            many = forward.directions[name]
            scale = np.where(largest > 0.0, largest, 1.0) if name != "g" else np.ones(self.bodies)
            scales.append(np.repeat(scale[:, None], many, axis=1))
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

    def _through(self, begin: int, lanes: Any, parts: np.ndarray, done: float) -> np.ndarray:
        """Take directions through their blocks: the components of what becomes of them, (lanes, side, N)."""
        k, i, d, moves, table = lanes
        forward, directions = self.forward, self.directions
        side = self.side
        found = np.empty((len(k), side, self.count))
        piece = PIECE // side
        for at in range(0, len(k), piece):
            some = slice(at, at + piece)
            block, body = k[some], i[some]
            values = forward.numbers[begin + block, body]
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
            require_same(forward.plan.method, out[:, 0].T, forward.numbers[begin + block + 1, body])
            found[some] = out[:, 1:].transpose(2, 1, 0) @ parts[block, body]
        return found


# ------------------------------------------------------------------ what is asked for


def backwards(
    plan: Any, what: str, start: Any, steps: Any, t_end: Any, t0: Any, by: Any, every: Any,
    loss: Any = None, along: Any = None, cotangent: Any = None,
) -> Gradient:  # fmt: skip
    """The gradient of a loss, or by a cotangent, of `Plan.gradient` and `Plan.pullback`: what is asked
    for is checked, and the kind of the run found.
    """
    if plan.recorder is not None or plan.events:
        other = "records no functions of the state" if plan.recorder else "looks for no events"
        raise InvalidInput(f"Plan.{what} is of states at the ends of steps; make a plan that {other}")
    t0, names = arguments.real(t0, "t0"), arguments.parameters(by, f"Plan.{what}")
    if every is not None:
        every = arguments.count(every, "every", 1)
    elif along is not None:
        every = plan.options.every
    asked = every, loss, along, cotangent
    if plan._sites is not None and goes_by_sites(plan, start, names, loss, along):
        return _by_sites(plan, what, start, steps, t_end, t0, names, asked)
    start = plan._started(start)
    if plan.fictive:
        raise IncompatibleSystem(
            f"Plan.{what}: steps in fictive time depend on how the run began; plan.tangent differentiates them"
        )
    if layout_of(member(start, 0)).in_memory:
        raise IncompatibleSystem(
            f"Plan.{what}: {plan._one!r} has large matrices, whose numbers in memory carry no "
            "derivative; differences of runs tell it"
        )
    with plan._beginning(start, t0):
        if not plan.adaptive:
            return gradient_of(plan, start, plan._count(steps, t_end, t0), t0, names, *asked)
        if start.bodies is not None:
            return of_each_body(plan, what, start, steps, t_end, t0, names, *asked)
        return adaptive_gradient_of(plan._of_body(0), start, steps, t_end, t0, names, *asked)


def _by_sites(plan: Any, what: str, start: Any, steps: Any, t_end: Any, t0: float, names: Any, asked: Any) -> Gradient:
    """The gradient of a run of many sites, which is gone through backwards."""
    given = plan, what, start, steps, t_end, t0, names
    value, found, run, growth = gradient_by_sites(*given, *asked)
    if growth is not None:
        tell(growth)
    return Gradient(value, found, run, growth)


def gradient_of(
    plan: Any, start: State, steps: int, t0: float, names: tuple[str, ...], every: int | None,
    loss: Any, along: Any, cotangent: Any, run: Any = None,
) -> Gradient:  # fmt: skip
    """The derivative of a loss, or of the product of a cotangent with the run, by the named parameters.

    start : with the parts that the run needs.  every : between the samples that count; None for the last
    state only.  run : by an error estimate; of fixed steps it is made here.
    """
    many = start.bodies or 1
    one = member(start, 0)
    with derived(plan, "gradient"):
        known = prepared(plan, start.bodies, one, names, t0, run is None)
    directions, frames = known.directions, known.frames
    count, side = known.count, directions.side
    intervals = sum(int(table.table.intervals) for table in directions.tables)
    width = max([-(-table.width // side) for table in directions.tables], default=1)
    each = many * -(-(count + directions.count) // side)
    length = block_length(max(1, steps), each, intervals, width, every or max(1, steps))
    forward: Forward = (
        forwards(plan, start, steps, t0, length, frames)
        if run is None
        else ForwardAdaptive(plan, run, length, frames, one)
    )
    last = forward.basis(slice(-1, None))
    compiled = plan.options.compiled

    def of_loss(function: Loss, some: slice, basis: np.ndarray) -> Any:
        times = forward.at(some)
        return function.slopes(forward.example, times, forward.numbers[some], basis, compiled)

    def counts(some: slice) -> np.ndarray:
        """Which edges are samples."""
        at = forward.edges[some]
        return (at % (every or 1) == 0) | (at == steps)

    value = None
    if cotangent is not None:
        given = Cotangent(cotangent, forward, None if every is None else counts(slice(None)))
        at_end = given.at(slice(-1, None), last)[0]
        by_sample: Any = None if every is None else given.at
    else:
        values, slopes = of_loss(Loss(loss, "loss", start.bodies), slice(-1, None), last)
        value, at_end, by_sample = float(values.sum()), slopes[0], None
        if along is not None:
            running = Loss(along, "along", start.bodies)
            sums = [value]

            def by_sample(some: slice, basis: np.ndarray) -> np.ndarray:
                here = counts(some)
                found = np.zeros(basis.shape[:3])
                if here.any():
                    values, slopes = of_loss(running, some, basis)
                    sums.append(float(values[here].sum()))
                    found[here] = slopes[here]
                return found

            at_end = at_end + by_sample(slice(-1, None), last)[0]
    back = Backward(forward, known, at_end, by_sample)
    with derived(plan, "gradient"):
        back.go()
    if along is not None and value is not None:
        value = math.fsum(sums)
    growth = float(np.linalg.norm(back.growth, 2, axis=(1, 2)).max())
    tell(back.relative_growth())
    found = {name: back.by(name) for name in names}
    if start.bodies is None:
        found = {n: x[0] if n == "start" else x for n, x in found.items()}
    return Gradient(value, found, forward.run, growth)


EPSILON = float(np.finfo(float).eps)

DOUBTFUL = 1e-6
"""Part of a gradient that rounding may take before somebody is warned."""


def tell(growth: float) -> None:
    """Warn of a growth that leaves few digits."""
    if not growth * EPSILON < DOUBTFUL:
        warn(
            f"Plan.gradient: a disturbance of the start grows by {growth:.1e} up to the end, and the "
            f"rounding of the run with it: the gradient has about {digits(growth)} digits. A shorter run, or "
            "a loss of averages, has more",
            GradientWarning,
        )


def digits(growth: float) -> int:
    """The decimal digits that a growth leaves."""
    return max(0, math.floor(-math.log10(growth * EPSILON))) if math.isfinite(growth) else 0


def adaptive_gradient_of(
    plan: Any, start: State, steps: Any, t_end: Any, t0: float, names: tuple[str, ...], *asked: Any
) -> Gradient:
    """The gradient of a run of one body by an error estimate, the lengths of its steps held fixed."""
    if "h" in names:
        raise InvalidInput("Plan.gradient: h is for fixed steps; the lengths of adaptive ones are held fixed")
    run = plan._in_pieces(start, t0, steps, t_end, None, None)
    every, loss, along, cotangent = asked
    return gradient_of(in_steps(plan, run.t), start, len(run.t) - 1, 0.0, names, every, loss, along, cotangent, run)


def of_each_body(
    plan: Any, what: str, start: State, steps: Any, t_end: Any, t0: float, names: tuple[str, ...],
    every: Any, loss: Any, along: Any, cotangent: Any,
) -> Gradient:  # fmt: skip
    """The gradient of an ensemble by an error estimate, whose bodies have steps of their own: one after
    another.
    """
    many = start.bodies or 1
    if cotangent is not None and every is not None:
        raise IncompatibleSystem(
            f"Plan.{what}: with adaptive steps each body has samples of its own: leave out every, "
            "or give one body at a time"
        )
    given = [(x, name) for x, name in ((loss, "loss"), (along, "along"))]
    losses = [x if x is None else Loss(x, name, many) for x, name in given]
    rows: dict[Any, Any] = cotangent if isinstance(cotangent, dict) else {"": cotangent}
    for name, x in rows.items():
        if x is not None and np.shape(x)[:1] != (many,):
            raise InvalidInput(
                f"Plan.{what}: cotangent{[name] if name else ''} has a leading axis of {many} bodies; "
                f"got shape {np.shape(x)}"
            )
    found = []
    for i, end in enumerate(arguments.ends(t_end, many)):
        own = [x if x is None else x.of(i) for x in losses]
        parts: Any = {n: x if x is None else np.asarray(x)[i] for n, x in rows.items()}
        w = parts if isinstance(cotangent, dict) else parts[""]
        one = plan._of_body(i), member(start, i), steps, end, t0, names, every, *own, w
        found.append(adaptive_gradient_of(*one))
    gradient = {}
    for name in names:
        each = np.stack([one[name] for one in found])
        of_each = ("method" if name.startswith("method.") else "system") in plan.of_each
        gradient[name] = each if name == "start" or of_each else each.sum(axis=0)
    value = None if cotangent is not None else math.fsum(one.value for one in found)
    run = of_some([one.run for one in found], system=plan.system, method=plan.method)
    return Gradient(value, gradient, run, max(one.growth or 0.0 for one in found))


class Cotangent:
    """The derivatives of a function by the last state, or by every sample.

    given : of each part of the state an array of its shape, by name, or (N,) by the frames; with the axes of
    samples and of bodies before.  samples : which edges are some; None for the last state only.
    """

    def __init__(self, given: Any, forward: Forward, samples: np.ndarray | None) -> None:
        self.forward, self.samples = forward, samples
        run = forward.run
        lead = () if samples is None else (int(samples.sum()),)
        lead = lead if run.bodies is None else (*lead, run.bodies)
        shapes = {n: x.shape[2 if run.bodies else 1 :] for n, x in run.states.items()}
        self.framed = not isinstance(given, dict)
        if self.framed:
            count = forward.basis(slice(0, 1)).shape[2]
            given, shapes = {"": given}, {"": (count,)}
        else:
            arguments.known_parts(given, shapes)
        self.rows: Any = {}
        for name, shape in shapes.items():
            wanted = (*lead, *shape)
            own = given.get(name, np.zeros(wanted))
            by_site = run._by_site(name, run.states[name]) if name else None
            if by_site is not None and np.shape(own) == (*lead, *by_site.shape[2 if run.bodies else 1 :]):
                own = real_numbers(np.asarray(own, by_site.dtype)).reshape(wanted)
            array = arguments.cotangent(own, name, wanted, "fiuc")
            wide = array.reshape(*([1] if samples is None else []), *array.shape)
            self.rows[name] = wide if run.bodies else wide[:, None]
        if not self.framed:
            rows = [
                real_numbers(x).reshape(*x.shape[:2], -1) if x.dtype.kind == "c" or not
                np.iscomplexobj(run.states[n]) else real_numbers(x.astype(complex)).reshape(*x.shape[:2], -1)
                for n, x in self.rows.items()
            ]  # fmt: skip
            self.rows = np.concatenate(rows, axis=2)
        else:
            self.rows = self.rows[""]

    def at(self, some: slice, basis: np.ndarray) -> np.ndarray:
        """The derivatives along the frames at some edges, (edges, bodies, N)."""
        if self.samples is None:
            rows = self.rows
        else:
            here = self.samples[some]
            before = int(self.samples[: some.indices(len(self.samples))[0]].sum())
            rows = np.zeros((len(here), *self.rows.shape[1:]))
            rows[here] = self.rows[before : before + int(here.sum())]
        return rows.astype(float) if self.framed else (basis @ rows[..., None])[..., 0]
