"""Tangent maps: the exact derivative of a discrete motion, by numbers that carry it through the
same steps.
"""

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
from .frames import LEVEL, frame, group_of
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
    """The directions in which a motion is differentiated.

    frames : of each part of the state the directions in which it moves.  moves : of the numbers of
    the start.  method : whose parameters vary.  systems, methods : in numbers that carry the
    derivative by a parameter; None for the system, or the method, as it is.  columns : which of
    them belong to a name.  system : as it is.  tables : by name those whose coefficients are moved,
    and whether values are asked for.
    """

    frames: dict[str, Any]
    moves: np.ndarray
    method: Any
    systems: list[Any]
    methods: list[Any]
    columns: dict[str, slice]
    system: Any
    tables: dict[str, Any]

    @classmethod
    def of(
        cls, system: Any, method: Any, start: State, names: tuple[str, ...], dressed: Any = None,
        begins: Any = None,
    ) -> Directions:  # fmt: skip
        """The directions of the start, and of parameters of system and method.

        dressed : makes of the method that by which steps are made; left out, it is the method itself.
        begins : of a run in fictive time, makes of system, method and start the system with its clock
        and its start, which depend on all three.
        """
        dressed = dressed or (lambda method: method)
        given = begins or (lambda system, method, start: (system, start))
        tables: dict[str, Any] = {}
        for name in names:
            found = table_of(system, name, "Plan.tangent", [x for x, _ in tables.values()])
            tables |= {} if found is None else {name: found}
        if tables and begins is not None:
            raise IncompatibleSystem(
                "Plan.tangent: in fictive time there is no derivative by the values of a table; in time there is"
            )
        for table in {id(x): x for x, _ in tables.values()}.values():
            system = table.in_system(system)
        for table, _ in tables.values():
            table.find(system)
        way, (whole, now) = dressed(method), given(system, method, start)
        layout, frames = layout_of((way, whole, now)), frames_of(whole, now)
        first, last = layout.parts[0].width, layout.width - layout.parts[2].width

        def ways(name: str) -> list[Any]:
            """For each direction the method, system and start along it, and a step for differences."""
            if name == "start":
                inner = getattr(system, "system", None) if system.fictive else system
                some = displacements(inner, frames_of(inner, start), start)
                return [(lambda x, to=to: (way, *given(system, method, to(x))), step)
                        for to, step in some]  # fmt: skip
            if name == "h":
                return [(lambda x, to=to: (to(x), whole, now), step)
                        for to, step in parameter_moves(way, name)]  # fmt: skip
            if name.startswith("method."):
                some = parameter_moves(method, name.removeprefix("method."))
                return [(lambda x, to=to: with_method(to(x)), step) for to, step in some]
            return [(lambda x, to=to: (way, *given(to(x), method, start)), step)
                    for to, step in parameter_moves(system, name)]  # fmt: skip

        def with_method(other: Any) -> Any:
            return dressed(other), *given(system, other, start)

        slopes: list[np.ndarray] = []
        columns: dict[str, slice] = {}
        moved: dict[int, Any] = {}  # systems with tables that another interval moves
        for name in names:
            begun = len(slopes)
            if name in tables:
                some = tables[name][0].moves(whole)
                moved |= {begun + k: thing for k, (thing, _) in enumerate(some)}
                for _, place in some:
                    slopes.append(np.eye(1, layout.width, first + place)[0])
            elif name == "start" and begins is None:
                slopes += [np.append(np.zeros(last), move) for move in start_moves(frames, start)]
            else:
                slopes += [slope(to, step, layout, name) for to, step in ways(name)]
            columns[name] = slice(begun, len(slopes))
        systems, methods = (
            [dual_of(others.get(k, thing), x[some]) if x[some].any() else None for k, x in enumerate(slopes)]
            for thing, some, others in ((whole, slice(first, last), moved), (way, slice(0, first), {}))
        )
        moves = np.array([x[last:] for x in slopes])
        return cls(frames, moves, way, systems, methods, columns, whole, tables)

    def components(self, example: Any, values: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Changes of the numbers of states, (n, directions, width), as components in the frames at
        the states, (n, components, directions).
        """
        states, rows, at = unpacked(layout_of(example), values), [], 0
        for name, directions in self.frames.items():
            size = layout_of(example.parts[name]).width
            # (n, components, numbers)
            basis = real_numbers(directions(states[name])).reshape(len(values), -1, size)
            changes = slopes[:, :, at : at + size]  # (n, directions, numbers)
            rows.append(np.linalg.pinv(basis).transpose(0, 2, 1) @ changes.transpose(0, 2, 1))
            at += size
        return np.concatenate(rows, axis=1)

    def named(self, tangent: np.ndarray) -> dict[str, np.ndarray]:
        """The derivatives by name."""
        found = {name: tangent[..., part] for name, part in self.columns.items()}
        for name, (table, values) in self.tables.items():
            rows = found[name].reshape(-1, int(table.table.intervals), table.width)
            found[name] = table.by(rows, values).reshape(*tangent.shape[:-1], -1)
        return found


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
    own = isinstance(method, Taylor) or (isinstance(method, kinds) and method.order > 2)
    inner = [x for x in fields_of(method).values() if isinstance(x, Method)]
    return own or any(map(expands, inner))


def frames_of(system: Any, start: Any) -> dict[str, Any]:
    """For each part of a state the directions in which it can move."""
    return {name: frame(system, name, part) for name, part in start.parts.items() if part is not None}


def start_moves(frames: dict[str, Any], start: Any) -> list[np.ndarray]:
    """How the numbers of a start change in each of its directions."""
    moves, at, width = [], 0, layout_of(start).width
    for part, directions in frames.items():
        size = layout_of(start.parts[part]).width
        for direction in directions(np.asarray(start.parts[part])[None])[0]:
            move = np.zeros(width)
            move[at : at + size] = real_numbers(direction)
            moves.append(move)
        at += size
    return moves


# ------------------------------------------------------------------ runs


def tangent_run(plan: Any, start: State, steps: int, t0: float, names: tuple[str, ...]) -> TangentTrajectory:
    """`steps` fixed steps from a start, with their derivative by the named parameters."""
    way: Steps = plan._steps
    method = way.method
    dressed = None
    if "h" in names:
        if way.way is not way.method and cuts(way.way, way.one):
            raise IncompatibleSystem(
                f"Plan.tangent: steps of {method!r} end where an input jumps, whatever h is, and "
                "have no derivative by it; by the start and by parameters of the system they have one"
            )
        dressed = with_step(method, way.h, t0)
    found = Directions.of(way.one, method, start, names, dressed)
    made, t, values, tangent = carried_along(plan, start, steps, t0, found)
    return of_tangent(
        made, steps, found.named(tangent), system=way.one, method=way.method, h=way.h, t=t,
        states=unpacked(layout_of(start), values),
    )  # fmt: skip


def carried_along(
    plan: Any, start: Any, steps: int, t0: float, found: Directions
) -> tuple[Trajectory, np.ndarray, np.ndarray, np.ndarray]:
    """The run whose numbers carry the derivatives, as far as all directions came: its times, the
    numbers of the states, (n, width), and their components, (n, components, directions).
    """
    with derived(plan, "tangent"):
        run = _Run(plan, start, found, steps, t0)
        made = run.trajectory()
    n, values, slopes = run.halves()
    return made, made.t[:n], values, found.components(start, values, slopes)


@contextlib.contextmanager
def derived(plan: Any, what: str) -> Iterator[None]:
    """Name the method of a plan where its numbers cannot carry a derivative."""
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

    What the start decides once for the whole run, the energy or the first 1/sigma, is
    differentiated too: as for parameters by differences of order 8.
    """
    plan: Steps = given_plan._steps
    origin = Origin(plan.one, plan.method, start)
    whole, now = origin.whole, origin.begun(t0)

    def begins(system: Any, method: Any, at: Any) -> tuple[Any, Any]:
        made = Origin(system, method, at).whole
        return made, made.extended(at, t0)

    dressed = with_step(plan.method, plan.h, 0.0) if "h" in names else None
    found = Directions.of(plan.one, plan.method, start, names, dressed, begins)
    made, tau, values, tangent = carried_along(given_plan.in_fictive_time(origin), now, steps, 0.0, found)
    t, states, _ = whole.apart(unpacked(layout_of(now), values))
    size = tangent.shape[1]
    # z is not shown
    rows = whole.of_tangent(size) if plan.one.fictive else [*range(size - 1)]
    return of_tangent(
        made, steps, found.named(tangent[:, rows]), system=whole.system, method=plan.method, h=plan.h,
        t=t, states=states, tau=tau,
    )  # fmt: skip


def slope(function: Any, step: float, layout: Layout, name: str) -> np.ndarray:
    """The derivative at zero of the numbers of what a function makes, by differences of order 8.

    layout : of what it makes.  name : of the parameter that moves.
    """
    total = np.zeros(layout.width)
    for k, weight in ((1, 4.0 / 5.0), (2, -1.0 / 5.0), (3, 4.0 / 105.0), (4, -1.0 / 280.0)):
        sides = []
        for x in (k * step, -k * step):
            made = function(x)
            if layout_of(made) != layout:
                raise InvalidInput(f"Plan.tangent: with another {name} the run is one of another kind")
            sides.append(np.array(leaves(made, layout)))
        there, back = sides
        # what is equal on both sides does not depend on the parameter: infinite ends of tables
        total += weight * np.subtract(there, back, out=np.zeros(len(total)), where=there != back)
    return total / step


def displacements(system: Any, frames: dict[str, Any], start: Any) -> list[Any]:
    """For each direction of a start the start at a distance along it, and a difference to take, in its units."""
    found = []
    for name, directions in frames.items():
        part = start.parts[name]
        group = group_of(system) if name == "g" else None
        for i, unit in enumerate(directions(np.asarray(part)[None])[0]):

            def moved(x: float, name: str = name, part: Any = part, group: Any = group,
                      i: int = i, unit: Any = unit) -> Any:  # fmt: skip
                if group is None:
                    there = small(np.asarray(part) + x * unit)
                else:
                    there = group.compose_exp(part, x * Vec(*np.eye(group.dim)[i].tolist()))
                return type(start)(*({**start.parts, name: there}.values()))

            here, there = (np.abs(np.asarray(x)) for x in (part, moved(1.0).parts[name]))
            size = float(here[here != there].max(initial=0.0) if name == "g" else here.max()) or 1.0
            found.append((moved, part_of(size)))
    return found


def part_of(size: float) -> float:
    """A difference to take beside numbers of a size: 2^-7 of it, a power of two."""
    return float(np.ldexp(1.0, int(np.frexp(size)[1]) - 7))


@record
class StepsOfARun(Wrapping):
    """The steps that a run has made by its error estimate, lengths and all: number n at the time n.

    begun, lengths : tables of the times at which they begin, and of their lengths.
    """

    begun: Any
    lengths: Any

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        """Step number t."""
        n = int(t)
        return self.method.step(system, entry(self.begun, n), memory, entry(self.lengths, n))


def in_steps(plan: Any, t: np.ndarray) -> Any:
    """The plan of fixed steps that makes those of a run by an error estimate, their lengths held fixed.

    t : the ends of the steps.
    """
    way, begun = plan._steps, plan._steps.begun(t)
    tables = Table([*begun, 0.0]), Table([*(t[1:] - begun), 0.0])
    steps = Steps(
        way.system, StepsOfARun(way.method, *tables), 1.0, 1, False, "double", way.compiled,
        way.progress, 1, clock="step",
    )  # fmt: skip
    return like(plan, _steps=steps, begun=begun)


def adaptive_tangent_run(plan: Any, run: Trajectory, start: State, names: tuple[str, ...]) -> TangentTrajectory:
    """A run with adaptive steps that has kept them all, with the derivative of its steps as they
    are, their lengths held fixed.
    """
    way, begun = plan._steps, plan._steps.begun(run.t)
    tables = Table([*begun, 0.0]), Table([*(run.t[1:] - begun), 0.0])
    found = Directions.of(way.system, way.method, start, names, lambda method: StepsOfARun(method, *tables))
    steps = Steps(way.system, found.method, 1.0, 1, False, "double", way.compiled, way.progress, 1, clock="step")
    made, n, _, tangent = carried_along(like(plan, _steps=steps), start, len(begun), 0.0, found)
    states = {name: x[: len(n)] for name, x in run.states.items()}
    return of_tangent(
        made, run.steps, found.named(tangent), system=way.system, method=way.method, h=run.h,
        t=run.t[: len(n)], states=states, rejected=run.rejected,
    )  # fmt: skip


def dual_of(thing: Any, slopes: Any = None, still: Any = 0.0) -> Any:
    """A system or a method in numbers that carry a derivative, which is zero if none is given.

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
    made: TangentTrajectory = of_some(runs, system=system, method=method)
    return made


def multiplied(run: TangentTrajectory, name: str, given: Any) -> TangentTrajectory:
    """The run with products of its map by the start, `along` or `against` directions, instead of it."""
    map_ = run.tangent["start"]
    map_ = map_ if name == "along" else np.swapaxes(map_, -1, -2)
    return replace(run, tangent={name: map_ @ arguments.directions(name, given, map_.shape[-1])})


def real_numbers(array: np.ndarray) -> np.ndarray:
    """The numbers of an array in turn, a complex one as two."""
    flat = np.ascontiguousarray(array)
    return (flat.view(float) if np.iscomplexobj(flat) else flat).ravel()


def parameter_moves(system: Any, name: str) -> list[Any]:
    """For every component of a parameter the systems, or methods, in which it differs by so much, and
    a difference to take.
    """
    value = parameter(system, name)
    layout = layout_of(value)
    numbers = leaves(value, layout)
    if not numbers or "table" in repr(layout):
        raise InvalidInput(f"Plan.tangent: {name} of {system!r} is no number, vector or matrix")
    found, largest = [], max(map(abs, numbers)) or 1.0
    for i, x in enumerate(numbers):

        def moved(by: float, i: int = i, x: float = x) -> Any:
            other = iter([*numbers[:i], x + by, *numbers[i + 1 :]])
            return with_parameter(system, name, build(layout, other))

        found.append((moved, part_of(abs(x) or largest)))
    return found


class Directionless(AsItIs):
    """Nothing is shown of numbers that carry a derivative: a direction is no motion."""

    def arrays(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        return {}

    def mark(self, error: Any, t: float, numbers: np.ndarray) -> None:
        """Nothing."""


class _Run(StraightRun):
    """A run of an ensemble whose members are the directions of the derivative, all with the same
    values.
    """

    def __init__(self, plan: Any, start: State, found: Directions, steps: int, t0: float) -> None:
        layout, way = layout_of(start), plan._steps
        numbers = leaves(start, layout)
        self.duals = [
            build(layout, iter([Dual(x, float(d), LEVEL) for x, d in zip(numbers, move, strict=True)]))
            for move in found.moves
        ]
        if any(found.systems):
            rest = dual_of(found.system)
            way = replace(way, system=Systems(tuple(s or rest for s in found.systems)), shapes={})
        if any(found.methods):
            rest = dual_of(found.method)
            way = replace(way, method=Methods(tuple(m or rest for m in found.methods)), shapes={})
        count = SimpleNamespace(bodies=len(found.moves))
        super().__init__(like(plan, _steps=way), count, t0, steps, None, None)

    def _member(self, i: int) -> Any:
        return self.duals[i]

    def _first(self, one: State, started: Layout) -> tuple[Any, Any]:
        """All numbers that the method carries along may come to depend on the start, zeros of its
        first guesses too.
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
        """Directions that stop are no bodies of which to warn."""

    def halves(self) -> tuple[int, np.ndarray, np.ndarray]:
        """The number of samples to which all directions came; the numbers of the states then, (n,
        width), and their derivatives in every direction, (n, directions, width).
        """
        samples = self.observers[0]
        n = max(1, int(samples.samples_after(self.clocks[TAKEN].min())))
        out = samples.array[:n]
        return n, out[:, 0::2, 0], out[:, 1::2, : self.count].transpose(0, 2, 1)
