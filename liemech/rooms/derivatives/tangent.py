"""Tangent maps: the exact derivative of a discrete motion, by steps whose numbers carry it along."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput
from ...formulas import Vec, record
from ...formulas.classes.flattening import build, leaves
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import Layout, layout_of
from ...formulas.classes.records import fields_of
from ...formulas.numbers.conversions import with_slopes
from ...formulas.numbers.dual import Dual
from ...formulas.tables import Table, entry
from ...formulas.vectors import small
from ...integrators.ending_at_jumps import cuts, sees_powers
from ...integrators.method import Method, Wrapping
from ...integrators.taylor import Taylor
from ...simulation import arguments
from ...simulation.between.dense import unpacked
from ...simulation.compiled.control import TAKEN
from ...simulation.compiled.execution import like
from ...simulation.compiled.parameters import parameter, with_parameter
from ...simulation.compiled.prepared import Steps
from ...simulation.compiled.systems import Methods, Systems
from ...simulation.result import AsItIs, of_some, of_tangent
from ...simulation.runs.equal import StraightRun
from ...simulation.trajectory import TangentTrajectory, Trajectory
from ...systems.system import State
from ..fictive_time.origin import Origin
from ..hamilton_jacobi.lie_poisson_first_kind import FirstKindHamiltonJacobi
from ..hamilton_jacobi.lie_poisson_hj import LiePoissonHamiltonJacobi
from .differences import part_of, slope_of
from .frames import LEVEL, Frames, group_of
from .varied_input import table_of

# ------------------------------------------------------------------ what is asked for


def of_one(plan: Any, start: State, steps: Any, t_end: Any, t0: float, names: tuple[str, ...]) -> TangentTrajectory:
    """The run of one body with its tangent map."""
    if plan.adaptive:
        if "h" in names:
            raise InvalidInput("Plan.tangent: h is for fixed steps; the lengths of adaptive ones are held fixed")
        run = plan._in_pieces(start, t0, steps, t_end, None, None)
        return adaptive_tangent_run(plan, run, start, names)
    if plan.fictive:
        if t_end is not None or steps is None:
            raise InvalidInput(
                "Plan.tangent: in fictive time give steps, and no t_end, which is met by a step of another length"
            )
        steps = arguments.count(steps, "steps", 0)
        return fictive_tangent_run(plan, start, steps, t0, names)
    return tangent_run(plan, start, plan._count(steps, t_end, t0), t0, names)


# ------------------------------------------------------------------ directions


@frozen(eq=False)
class Directions:
    """The directions in which a motion is differentiated."""

    frames: Frames  # of the start
    moves: np.ndarray  # (directions, width), the changes of the numbers of the start
    method: Any
    systems: list[Any]  # by direction, the system whose numbers carry the derivative; None if it does not vary
    methods: list[Any]  # by direction, the method likewise
    columns: dict[str, slice]  # by name, its directions
    system: Any
    tables: dict[str, Any]  # by name, the table whose coefficients vary, and whether the derivative is by values

    @classmethod
    def of(
        cls, system: Any, method: Any, start: State, names: tuple[str, ...], dressed: Any = None,
        begins: Any = None,
    ) -> Directions:  # fmt: skip
        """The directions of the start, and of parameters of system and method.

        dressed : from a method to the method of the steps; by default itself.  begins : in fictive time, from system,
        method and start to the system with its clock and its start; by default system and start themselves.
        """
        dressed = dressed or (lambda method: method)
        begins_at = begins or (lambda system, method, start: (system, start))
        tables: dict[str, Any] = {}
        for name in names:
            table_of_name = table_of(system, name, "Plan.tangent", [x for x, _ in tables.values()])
            tables |= {} if table_of_name is None else {name: table_of_name}
        if tables and begins is not None:
            raise IncompatibleSystem(
                "Plan.tangent: in fictive time there is no derivative by the values of a table; in time there is"
            )
        for table in {id(x): x for x, _ in tables.values()}.values():
            system = table.in_system(system)
        for table, _ in tables.values():
            table.find(system)
        of_steps, (whole, first_state) = dressed(method), begins_at(system, method, start)
        layout, frames = layout_of((of_steps, whole, first_state)), Frames(whole, first_state)
        first, last = layout.parts[0].width, layout.width - layout.parts[2].width

        def curves(name: str) -> list[Any]:
            """For each direction the curve x to (method, system, start) along it, and a step x for differences."""
            if name == "start":
                inner = getattr(system, "system", None) if system.fictive else system
                moves = displacements(inner, start)
                return [(lambda x, to=to: (of_steps, *begins_at(system, method, to(x))), step) for to, step in moves]
            if name == "h":
                moves = parameter_moves(of_steps, name)
                return [(lambda x, to=to: (to(x), whole, first_state), step) for to, step in moves]
            if name.startswith("method."):
                moves = parameter_moves(method, name.removeprefix("method."))
                return [(lambda x, to=to: with_method(to(x)), step) for to, step in moves]
            moves = parameter_moves(system, name)
            return [(lambda x, to=to: (of_steps, *begins_at(to(x), method, start)), step) for to, step in moves]

        def with_method(other: Any) -> Any:
            return dressed(other), *begins_at(system, other, start)

        slopes: list[np.ndarray] = []
        columns: dict[str, slice] = {}
        varied: dict[int, Any] = {}  # by direction along a coefficient of a table, the system whose table has it varied
        for name in names:
            begin = len(slopes)
            if name in tables:
                by_coefficient = tables[name][0].moves(whole)
                varied |= {begin + k: thing for k, (thing, _) in enumerate(by_coefficient)}
                for _, place in by_coefficient:
                    slopes.append(np.eye(1, layout.width, first + place)[0])
            elif name == "start" and begins is None:
                begun = {part: np.asarray(start.parts[part])[None] for part in frames.of}
                slopes += [np.append(np.zeros(last), move) for move in frames.basis(begun)[0]]
            else:
                slopes += [slope(to, step, layout, name) for to, step in curves(name)]
            columns[name] = slice(begin, len(slopes))
        systems, methods = (
            [dual_of(others.get(k, thing), x[part]) if x[part].any() else None for k, x in enumerate(slopes)]
            for thing, part, others in ((whole, slice(first, last), varied), (of_steps, slice(0, first), {}))
        )
        moves = np.array([x[last:] for x in slopes])
        return cls(frames, moves, of_steps, systems, methods, columns, whole, tables)

    def named(self, tangent: np.ndarray) -> dict[str, np.ndarray]:
        """The derivatives by the name of the parameter."""
        by_name = {name: tangent[..., part] for name, part in self.columns.items()}
        for name, (table, values) in self.tables.items():
            rows = by_name[name].reshape(-1, int(table.table.intervals), table.width)
            by_name[name] = table.by(rows, values).reshape(*tangent.shape[:-1], -1)
        return by_name


@record
class WithStep(Wrapping):
    """A method whose step h is a parameter, by which its motion is differentiated at the same
    number of steps.

    h, t0 : of the plan.
    """

    h: float
    t0: float

    def start(self, system: Any, state: Any, h: float) -> Any:
        """The first memory of the method."""
        return self.method.start(system, state, self.h)

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        """The step of the method; the time t0 + n h moves with h, too."""
        return self.method.step(system, t + (self.h / h - 1.0) * (t - self.t0), memory, self.h)


def with_step(method: Any, h: float, t0: float) -> Any:
    """A function that gives a method its step as a parameter; refused for methods that expand the motion
    in powers of h.
    """
    if expands(method):
        raise IncompatibleSystem(
            f"Plan.tangent: {method!r} expands the motion in powers of h, and has no derivative by "
            "it; by the start and by parameters of the system it has one"
        )
    return lambda method: WithStep(method, h, t0)


def expands(method: Any) -> bool:
    """Is a method, or one that it is made of, a power series in its step?"""
    kinds = FirstKindHamiltonJacobi, LiePoissonHamiltonJacobi
    is_series = isinstance(method, Taylor) or (isinstance(method, kinds) and method.order > 2)
    inner = [x for x in fields_of(method).values() if isinstance(x, Method)]
    return is_series or any(map(expands, inner))


# ------------------------------------------------------------------ runs


def tangent_run(plan: Any, start: State, steps: int, t0: float, names: tuple[str, ...]) -> TangentTrajectory:
    """`steps` fixed steps from a start, with their derivative by the named parameters."""
    prepared: Steps = plan._steps
    method = prepared.method
    dressed = None
    if "h" in names:
        if prepared.way is not prepared.method and cuts(prepared.way, prepared.one):
            raise IncompatibleSystem(
                f"Plan.tangent: steps of {method!r} end where an input jumps, whatever h is, and "
                "have no derivative by it; by the start and by parameters of the system they have one"
            )
        dressed = with_step(method, prepared.h, t0)
    directions = Directions.of(prepared.one, method, start, names, dressed)
    run, t, values, tangent = carried_along(plan, start, steps, t0, directions)
    return of_tangent(
        run, steps, directions.named(tangent), system=prepared.one, method=method, h=prepared.h, t=t,
        states=unpacked(layout_of(start), values),
    )  # fmt: skip


def carried_along(
    plan: Any, start: Any, steps: int, t0: float, directions: Directions
) -> tuple[Trajectory, np.ndarray, np.ndarray, np.ndarray]:
    """The run whose numbers carry the derivatives, and up to the first direction that stopped: its times, the
    numbers of the states, (n, width), and their components, (n, components, directions).
    """
    with derived(plan, "tangent"):
        run = _Run(plan, start, directions, steps, t0)
        trajectory = run.trajectory()
    n, values, slopes = run.halves()
    tangent = directions.frames.components(unpacked(layout_of(start), values), slopes).swapaxes(1, 2)
    return trajectory, trajectory.t[:n], values, tangent


@contextlib.contextmanager
def derived(plan: Any, what: str) -> Iterator[None]:
    """A context that raises IncompatibleSystem for a method whose numbers cannot carry a derivative."""
    try:
        yield
    except (TypeError, AttributeError) as error:
        if sees_powers(plan.method) or "series" in str(error) or "Dual" in str(error):
            raise IncompatibleSystem(
                f"Plan.{what}: {plan.method!r} computes with power series or keeps numbers that "
                "cannot carry a derivative; differences of runs tell it"
            ) from None
        raise


def fictive_tangent_run(
    given_plan: Any, start: State, steps: int, t0: float, names: tuple[str, ...]
) -> TangentTrajectory:
    """`steps` fixed steps in fictive time, with their derivative at the same fictive times.

    The energy and the first 1/sigma, which the start decides for the whole run, are differentiated too, by
    differences of order 8 as for parameters.
    """
    plan: Steps = given_plan._steps
    origin = Origin(plan.one, plan.method, start)
    whole, first_state = origin.whole, origin.begun(t0)

    def begins(system: Any, method: Any, at: Any) -> tuple[Any, Any]:
        with_clock = Origin(system, method, at).whole
        return with_clock, with_clock.extended(at, t0)

    dressed = with_step(plan.method, plan.h, 0.0) if "h" in names else None
    directions = Directions.of(plan.one, plan.method, start, names, dressed, begins)
    clocked_plan = given_plan.in_fictive_time(origin)
    run, tau, values, tangent = carried_along(clocked_plan, first_state, steps, 0.0, directions)
    t, states, _ = whole.apart(unpacked(layout_of(first_state), values))
    size = tangent.shape[1]
    # z is not shown
    rows = whole.of_tangent(size) if plan.one.fictive else [*range(size - 1)]
    return of_tangent(
        run, steps, directions.named(tangent[:, rows]), system=whole.system, method=plan.method, h=plan.h,
        t=t, states=states, tau=tau,
    )  # fmt: skip


def slope(function: Any, step: float, layout: Layout, name: str) -> np.ndarray:
    """The derivative at zero of the numbers of what a function makes.

    layout : of what it makes.  name : of the parameter that moves.
    """

    def numbers(x: float) -> np.ndarray:
        made = function(x)
        if layout_of(made) != layout:
            raise InvalidInput(f"Plan.tangent: with another {name} the run is one of another kind")
        return np.array(leaves(made, layout))

    return slope_of(numbers, step)


def displacements(system: Any, start: Any) -> list[Any]:
    """For each direction of a start the function from x to the start moved by x along it, and a step x for differences,
    in its units.
    """
    moves = []
    for name, directions in Frames(system, start).of.items():
        part = start.parts[name]
        group = group_of(system) if name == "g" else None
        for i, unit in enumerate(directions(np.asarray(part)[None])[0]):

            def moved(x: float, name: str = name, part: Any = part, group: Any = group,
                      i: int = i, unit: Any = unit) -> Any:  # fmt: skip
                if group is None:
                    moved_part = small(np.asarray(part) + x * unit)
                else:
                    moved_part = group.compose_exp(part, x * Vec(*np.eye(group.dim)[i].tolist()))
                return type(start)(*({**start.parts, name: moved_part}.values()))

            sizes, sizes_moved = (np.abs(np.asarray(x)) for x in (part, moved(1.0).parts[name]))
            size = float(sizes[sizes != sizes_moved].max(initial=0.0) if name == "g" else sizes.max()) or 1.0
            moves.append((moved, part_of(size)))
    return moves


@record
class StepsOfARun(Wrapping):
    """The steps of an adaptive run, their lengths held fixed: step number n at the time n."""

    begun: Any  # a table of the times at which steps begin
    lengths: Any  # a table of the lengths of steps

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        """Step number t of the run."""
        n = int(t)
        return self.method.step(system, entry(self.begun, n), memory, entry(self.lengths, n))


def in_steps(plan: Any, t: np.ndarray) -> Any:
    """The plan of fixed steps that repeats the steps of an adaptive run, which end at the times t."""
    begins = plan._steps.begun(t)
    return like(plan, _steps=_repeated(plan, _dressed_in(begins, t)(plan._steps.method)), begun=begins)


def _dressed_in(begins: np.ndarray, t: np.ndarray) -> Any:
    """The function from a method to its steps that begin and end at these times."""
    tables = Table([*begins, 0.0]), Table([*(t[1:] - begins), 0.0])
    return lambda method: StepsOfARun(method, *tables)


def _repeated(plan: Any, method: StepsOfARun) -> Steps:
    """The steps of an adaptive plan as fixed ones, whose time is their number."""
    adaptive = plan._steps
    return Steps(
        adaptive.system, method, 1.0, 1, False, "double", adaptive.compiled, adaptive.progress, 1, clock="step"
    )  # fmt: skip


def adaptive_tangent_run(plan: Any, run: Trajectory, start: State, names: tuple[str, ...]) -> TangentTrajectory:
    """An adaptive run, every step of which is kept, with the derivative of its steps, their lengths held fixed."""
    adaptive, begins = plan._steps, plan._steps.begun(run.t)
    directions = Directions.of(adaptive.system, adaptive.method, start, names, _dressed_in(begins, run.t))
    repeating = like(plan, _steps=_repeated(plan, directions.method))
    repeated, times, _, tangent = carried_along(repeating, start, len(begins), 0.0, directions)
    states = {name: x[: len(times)] for name, x in run.states.items()}
    return of_tangent(
        repeated, run.steps, directions.named(tangent), system=adaptive.system, method=adaptive.method, h=run.h,
        t=run.t[: len(times)], states=states, rejected=run.rejected,
    )  # fmt: skip


def dual_of(thing: Any, slopes: Any = None, still: Any = 0.0) -> Any:
    """A system or a method in numbers that carry these derivatives; by default zero.

    still : that zero; along several directions a vector.
    """
    layout = layout_of(thing)
    rates = [still] * layout.width if slopes is None else slopes.tolist()
    both = zip(leaves(thing, layout), rates, strict=True)
    return build(layout, iter([Dual(x, dx, LEVEL) for x, dx in both]))


def of_bodies(method: Any, runs: list[TangentTrajectory]) -> TangentTrajectory:
    """The runs of all bodies as one."""
    alone = all(run.system is runs[0].system for run in runs)
    system: Any = runs[0].system if alone else Systems(tuple([run.system for run in runs]))
    together: TangentTrajectory = of_some(runs, system=system, method=method)
    return together


def multiplied(run: TangentTrajectory, name: str, given: Any) -> TangentTrajectory:
    """The run with the products J v ("along") or J^T w ("against") of its tangent map with directions, in its place."""
    map_ = run.tangent["start"]
    map_ = map_ if name == "along" else np.swapaxes(map_, -1, -2)
    return replace(run, tangent={name: map_ @ arguments.directions(name, given, map_.shape[-1])})


def parameter_moves(system: Any, name: str) -> list[Any]:
    """For each component of a parameter the function from x to the system, or method, in which it is larger by x, and a
    step x for differences.
    """
    value = parameter(system, name)
    layout = layout_of(value)
    numbers = leaves(value, layout)
    if not numbers or "table" in repr(layout):
        raise InvalidInput(f"Plan.tangent: {name} of {system!r} is no number, vector or matrix")
    moves, largest = [], max(map(abs, numbers)) or 1.0
    for i, x in enumerate(numbers):

        def moved(by: float, i: int = i, x: float = x) -> Any:
            other = iter([*numbers[:i], x + by, *numbers[i + 1 :]])
            return with_parameter(system, name, build(layout, other))

        moves.append((moved, part_of(abs(x) or largest)))
    return moves


class Directionless(AsItIs):
    """The view of bodies that are directions of a derivative: no states, and no notes in errors."""

    def arrays(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        return {}

    def mark(self, error: Any, t: float, numbers: np.ndarray) -> None:
        """Leave the error as it is: a direction is no body."""


class _Run(StraightRun):
    """A run of an ensemble whose members are the directions of the derivative, all with one value."""

    def __init__(self, plan: Any, start: State, directions: Directions, steps: int, t0: float) -> None:
        self.duals = [dual_of(start, move) for move in directions.moves]
        prepared = plan._steps
        if any(directions.systems):
            constant = dual_of(directions.system)
            prepared = replace(prepared, system=Systems(tuple(s or constant for s in directions.systems)), shapes={})
        if any(directions.methods):
            constant = dual_of(directions.method)
            prepared = replace(prepared, method=Methods(tuple(m or constant for m in directions.methods)), shapes={})
        count = SimpleNamespace(bodies=len(directions.moves))
        super().__init__(like(plan, _steps=prepared), count, t0, steps, None, None)

    def _member(self, i: int) -> Any:
        return self.duals[i]

    def _first(self, one: State, started: Layout) -> tuple[Any, Any]:
        """The first carry and sample, every number of the carry with a slope: zeros of first guesses may come to depend
        on the start.
        """
        carry, example = super()._first(one, started)
        return with_slopes(carry, LEVEL), example

    def _lay_down(self, columns: np.ndarray) -> None:
        numbers = np.array([leaves(dual, self.shape.given) for dual in self.duals]).T
        columns[:] = numbers[:, np.minimum(np.arange(columns.shape[1]), self.count - 1)]

    @functools.cached_property
    def view(self) -> AsItIs:
        return Directionless(self.lanes.example)

    def first_sample(self) -> dict[str, Any]:
        none: dict[str, Any] = {"t": np.empty(0), "states": {}}
        return {"system": self.plan.system, "h": self.way.h} | none

    def tell(self, made: Trajectory) -> None:
        """Without a warning of directions that stopped, which are no bodies."""

    def halves(self) -> tuple[int, np.ndarray, np.ndarray]:
        """The number n of samples that all directions reached; of these the numbers of the states, (n, width), and
        their derivatives in every direction, (n, directions, width).
        """
        samples = self.observers[0]
        n = max(1, int(samples.samples_after(self.clocks[TAKEN].min())))
        out = samples.array[:n]
        return n, out[:, 0::2, 0], out[:, 1::2, : self.count].transpose(0, 2, 1)
