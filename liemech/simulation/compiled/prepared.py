"""Layouts and native code that runs of a plan with fixed steps share if their starts are alike."""

from __future__ import annotations

import dataclasses
from collections.abc import MutableMapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...compiler import kernel
from ...errors import IncompatibleSystem
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import Layout, build, carried_layout, layout_of, leaves
from ...formulas.numbers.conversions import compensated, double_double, fitted
from ...integrators.ending_at_jumps import ending_at_jumps
from ...integrators.method import Method
from ...systems.system import State, System
from .driver import begin
from .execution import COLUMNS, Execution, like
from .lanes import Lanes
from .systems import OfBodies, of_body

PAGE, APART = 2**8, 2**3
"""Where the numbers of a body lie multiples of so many columns apart (2 KiB), few of them find room in
the cache at once: columns of a line of the cache are added.
"""


@frozen(eq=False)
class Steps:
    """Fixed steps, as the arguments of a plan say them, and what is prepared for their runs."""

    system: Any  # one for all bodies, or `Systems`
    method: Any  # one for all bodies, or `Methods`
    h: Any  # one for all bodies, or one for each
    every: int
    # from here to `workers` as for `integrate`
    compensated: bool | None
    precision: str
    compiled: bool | None
    progress: bool | None
    workers: int
    shapes: dict[Any, RunShape] = dataclasses.field(default_factory=dict, repr=False)
    clock: str = "t"  # the name of the time in which they are of one length
    breaks: tuple[float, ...] = ()  # times at which steps end
    # of steps in fictive time: the steps of the system with its clock, by the origin of a run and by layout
    of_origins: MutableMapping[Any, Steps] = dataclasses.field(
        default_factory=WeakKeyDictionary, init=False, repr=False
    )
    of_layouts: dict[Layout, Steps] = dataclasses.field(default_factory=dict, init=False, repr=False)
    # what drivers get instead of a method, by its identity
    ways: dict[int, Any] = dataclasses.field(default_factory=dict, init=False, repr=False)

    def of_system(self, system: System) -> Steps:
        """These steps for another system of the same layout; layouts and native code are shared."""
        shapes = {key: shape.of_system(system) for key, shape in [*self.shapes.items()]}
        fields = {"system": system, "shapes": shapes}
        return like(self, of_origins=WeakKeyDictionary(), of_layouts={}, **fields)

    @property
    def one(self) -> System:
        """The system, of several the first."""
        return of_body(self.system, 0)

    def system_of(self, body: int) -> Any:
        """The system of this body: the only one, or its own."""
        return of_body(self.system, body)

    def method_of(self, body: int) -> Any:
        """The method of this body: the only one, or its own."""
        return of_body(self.method, body)

    @property
    def way(self) -> Any:
        """The method as drivers get it, or those of all bodies."""
        if isinstance(self.method, OfBodies):
            return type(self.method)(tuple([self.way_of(i) for i in range(len(self.method))]))
        return self.way_of(0)

    def way_of(self, body: int) -> Any:
        """The method of one body as drivers get it."""
        method = self.method_of(body)
        if self.clock != "t" and not method.fictive:
            return method
        cut = self.ways.get(id(method))
        if cut is None:
            cut = self.ways[id(method)] = ending_at_jumps(method, self.system_of(body), self.breaks)
        return cut

    def h_of(self, body: int) -> float:
        """The step of this body, in s: the only one, or its own."""
        return self.h[body] if isinstance(self.h, tuple) else self.h

    def owns(self, shape: RunShape | None) -> bool:
        """Whether this plan has prepared this shape."""
        return shape in self.shapes.values()

    def remembering(self, start: State) -> State:
        """The start of one body, in compensated numbers what is to be summed up so: all, nothing,
        or what the motion depends on.

        In double-double precision in numbers of two doubles.
        """
        return self.remembering_of(self.one, start)

    def remembering_of(self, system: Any, start: State) -> State:
        """The start of a body of this system, in the numbers of the run."""
        if layout_of(start).in_memory:
            if self.precision == "double-double" or self.compensated:
                raise IncompatibleSystem(
                    f"{system!r}: large matrices are in double precision, without compensation: "
                    "leave out `precision` and `compensated`"
                )
            return start
        if self.precision == "double-double":
            return double_double(start)
        method = self.method
        if self.compensated is None and method.adds and (method.symmetric or method.symplectic):
            motion = system.essential_part(start).parts
            return type(start)(*(compensated(x) if motion[name] is not None else x for name, x in start.parts.items()))
        return compensated(start) if self.compensated else start


class RunShape:
    """The layouts of runs whose starts are alike, and the code that begins them.

    given : of a start of one body as it comes; started : in the numbers of the run.
    layout : of what the method carries along.  example, shown : a sample and its layout.
    side : bodies side by side.  lanes : the code that makes steps, by control and `side`.
    order : where the numbers of the start are among those carried along, -1 for zeros, if the method
    begins with these alone.
    """

    def __init__(self, steps: Steps, given: Layout, started: Layout, first: Any, example: State, side: int) -> None:
        self.given, self.started, self.example = given, started, example
        self.layout, self.shown = carried_layout(first), layout_of(example)
        native = steps.compiled is not False and side and kernel.available() is None
        self.side = side if native and not self.layout.in_memory else 1
        self.lanes: dict[Any, Lanes] = {}
        self.column: int | None = None
        self.place: Any = None  # of short runs in memory
        self._beginning: Execution | None = None
        self.order: list[int] | None = None
        if given == self.shown and all(
            getattr(type(steps.method_of(0)), f) is getattr(Method, f) for f in ("start", "observe")
        ):
            numbered = fitted(build(given, iter([1.0 + i for i in range(given.width)])), self.layout)
            self.order = [int(x) - 1 for x in leaves(numbered, self.layout)]

    def whole(self, bodies: int) -> int:
        """The number of columns for a number of bodies: whole lanes."""
        return -(-bodies // self.side) * self.side

    def columns(self, bodies: int) -> int:
        """The columns of an array for so many bodies: some more where all numbers of a body would want
        the same place in the cache.
        """
        whole = self.whole(bodies)
        return whole + APART if whole % PAGE == 0 else whole

    def of_system(self, system: System) -> RunShape:
        """A copy of this shape for another system of the same layout."""
        place = self.place  # before the lanes, which are there as soon as it is
        beginning = None if self._beginning is None else self._beginning.of_system(system)
        lanes = {key: old.of_system(system) for key, old in [*self.lanes.items()]}
        other: RunShape = like(self, _beginning=beginning, lanes=lanes)
        other.place = None if place is None else place.of_system(other)
        return other

    def lanes_of(self, steps: Steps, control: Any, extra: Any, side: int) -> Lanes:
        """Lanes for one run, with the code that makes steps under this control."""
        key = control, side
        prepared = self.lanes.get(key)
        if prepared is None:
            prepared = self.lanes[key] = Lanes(
                (steps.way, steps.system), control, self.layout, self.example, extra,
                steps.compiled, steps.progress, side,
            )  # fmt: skip
        return prepared.of_a_run()

    def beginning(self, steps: Steps, lanes: Lanes) -> Execution:
        """The Execution of the driver `begin`, which all runs have in common."""
        if self._beginning is None:
            compiled = steps.compiled if self.side > 1 or steps.compiled is False else None
            call = begin, *self.beginner(lanes.arguments), *[COLUMNS] * 4, None
            self._beginning = Execution(compiled, steps.progress, *call, lanes=self.side, silent=self.side == 1)
        return self._beginning

    def beginner(self, arguments: Any) -> tuple[Any, ...]:
        """The arguments of `begin` that are no arrays, from those of steps."""
        return *arguments[:2], self.given, self.started, self.layout, self.shown


def times(t0: float, numbers: np.ndarray, h: float | tuple[float, ...]) -> np.ndarray:
    """The times after so many steps, (n,); of bodies with steps of their own (n, bodies)."""
    return t0 + numbers[:, None] * np.array(h) if isinstance(h, tuple) else t0 + numbers * h


def shown_step(h: float | tuple[float, ...]) -> Any:
    """The step as a run shows it: a number, or an array of one for each body."""
    return np.array(h) if isinstance(h, tuple) else h
