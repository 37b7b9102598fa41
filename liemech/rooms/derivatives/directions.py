"""Directions in which a motion is differentiated: of the start, and along parameters of the system and the method."""

from __future__ import annotations

import functools
import warnings
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput
from ...formulas import Vec, record
from ...formulas.classes.layouts import Layout, build, layout_of, leaves
from ...formulas.numbers.dual import Dual
from ...formulas.vectors import small
from ...integrators.method import Wrapping
from ...simulation.compiled.parameters import parameter, shape_of, with_parameter
from ...systems.system import State
from .differences import part_of, slope_of
from .frames import LEVEL, Frames, group_of
from .varied_input import Tables


class Directions:
    """The directions in which the steps of a motion, their system and their start change.

    slopes : (directions, numbers), of the numbers of `method`, `system` and `first`, which are at `places`.
    columns : by name, its directions.  shapes : by name of a parameter, that of its value.
    tables : those by whose coefficients the motion is differentiated, of which `varied` has, by direction, a system with
    one interval varied.
    """

    def __init__(
        self, system: Any, method: Any, start: State, names: tuple[str, ...], dressed: Any = None, begins: Any = None,
    ) -> None:  # fmt: skip
        """dressed : from a method to the method of the steps; by default itself.  begins : in fictive time, from system,
        method and start to the system with its clock and its start; by default system and start themselves.
        """
        self.tables = tables = Tables(system, names, "Plan.tangent")
        if tables.by_name and begins is not None:
            raise IncompatibleSystem(
                "Plan.tangent: in fictive time there is no derivative by the values of a table; in time there is"
            )
        system = tables.in_system(system)

        def motion(
            system: Any = system, method: Any = method, start: Any = start, of_steps: Any = None
        ) -> tuple[Any, ...]:
            with_clock, first = begins(system, method, start) if begins else (system, start)
            return of_steps or (dressed(method) if dressed else method), with_clock, first

        self.method, self.system, self.first = motion()
        tables.find(self.system)
        layout = layout_of(motion())
        ends = np.cumsum([part.width for part in layout.parts]).tolist()
        self.places = [slice(begin, end) for begin, end in zip([0, *ends], ends)]
        self.columns: dict[str, slice] = {}
        self.shapes: dict[str, tuple[int, ...]] = {}
        self.varied: dict[int, Any] = {}
        rows: list[np.ndarray] = []

        def curves(name: str) -> list[Any]:
            """For each direction the curve from x to (method, system, start) along it, and a step x for differences."""
            if name == "start":
                kind = name
                moves = displacements(getattr(system, "system", None) if system.fictive else system, start)
            else:
                kind = "of_steps" if name == "h" else "method" if name.startswith("method.") else "system"
                path = name.removeprefix("method.")
                thing = {"of_steps": self.method, "method": method, "system": system}[kind]
                moves = parameter_moves(thing, path)
                shape = shape_of(layout_of(parameter(thing, path)))
                self.shapes[name] = (len(moves),) if shape is None else shape
            return [(lambda x, to=to: motion(**{kind: to(x)}), step) for to, step in moves]

        for name in names:
            begin = len(rows)
            if name in tables.by_name:
                by_coefficient = tables.by_name[name][0].moves(self.system)
                self.varied |= {begin + k: thing for k, (thing, _) in enumerate(by_coefficient)}
                rows += [np.eye(1, layout.width, ends[0] + place)[0] for _, place in by_coefficient]
            elif name == "start" and begins is None:
                points = {part: np.asarray(start.parts[part])[None] for part in self.frames.of}
                rows += [np.append(np.zeros(ends[1]), move) for move in self.frames.basis(points)[0]]
            else:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # of parameters beside those that were given
                    rows += [slope(curve, step, layout, name) for curve, step in curves(name)]
            self.columns[name] = slice(begin, len(rows))
        self.slopes = np.array(rows).reshape(-1, layout.width)
        self.slopes[:, [kind != "number" for kind in layout.kinds]] = 0.0

    @functools.cached_property
    def frames(self) -> Frames:
        """The frames of the start."""
        return Frames(self.system, self.first)

    def named(self, tangent: np.ndarray) -> dict[str, np.ndarray]:
        """The derivatives by the name of the parameter."""
        by_name = {name: tangent[..., part] for name, part in self.columns.items()}
        for name, (table, values) in self.tables.by_name.items():
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
        return self.method.start(system, state, self.h)

    def step(self, system: Any, t: float, memory: Any, h: float) -> Any:
        """The step of the method; the time t0 + n h moves with h, too."""
        return self.method.step(system, t + (self.h / h - 1.0) * (t - self.t0), memory, self.h)


def with_step(h: float, t0: float) -> Any:
    """A function that gives a method its step as a parameter."""
    return lambda method: WithStep(method, h, t0)


def slope(function: Any, step: float, layout: Layout, name: str) -> np.ndarray:
    """The derivative at zero of the numbers of what a function makes.

    layout : of what it makes.  name : of the parameter that moves.
    """

    def numbers(x: float) -> np.ndarray:
        point = function(x)
        if layout_of(point) != layout:
            raise InvalidInput(f"Plan.tangent: with another {name} the run is one of another kind")
        return np.array(leaves(point, layout))

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


def dual_of(thing: Any, slopes: Any = None, still: Any = 0.0) -> Any:
    """A system or a method in numbers that carry these derivatives, (numbers,) or of several directions (numbers,
    directions); by default zero.

    still : that zero; along several directions a vector.
    """
    layout = layout_of(thing)
    rates = [still] * layout.width if slopes is None else slopes.tolist()
    rates = [Vec(*x) if isinstance(x, list) else x for x in rates]
    both = zip(leaves(thing, layout), rates, strict=True)
    return build(layout, iter([Dual(x, dx, LEVEL) for x, dx in both]))
