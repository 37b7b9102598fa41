"""What all runs of a plan with fixed steps share, if their starts are alike: layouts, and
native code.
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import struct
from collections.abc import MutableMapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..compiler import kernel
from ..formulas.pytree import (
    Layout,
    build,
    carried_layout,
    compensated,
    double_double,
    fitted,
    gatherer,
    layout_of,
    leaves,
)
from ..integrators.ending_at_jumps import ending_at_jumps
from ..integrators.method import Method
from ..systems.system import State, System
from .driver import begin, fixed_steps
from .execution import Execution, like, numbers_of
from .systems import OfBodies, of_body

TIME = struct.Struct("d")

FAR, PAGE, APART = 2**13, 2**8, 2**6
"""Bodies whose numbers do not stay in the cache.  Where the numbers of a body lie multiples of so
many columns apart (2 KiB), few of them find room in the cache at once: so many columns are added.
"""


@dataclasses.dataclass(frozen=True, eq=False)
class Steps:
    """Fixed steps: what a plan was told of them.

    system, method : one for all bodies, or `Systems`, `Methods`.  h : one for all bodies, or one
    for each.
    compensated, precision, compiled, progress, workers : as for `integrate`.
    clock : the name of the time in which they are equal.  breaks : times at which steps end.
    of_origins, of_layouts : of steps in fictive time, those of the system with its clock, by where
    a run began, and some for each layout of such a system.
    """

    system: Any
    method: Any
    h: Any
    every: int
    compensated: bool | None
    precision: str
    compiled: bool | None
    progress: bool | None
    workers: int
    shapes: dict[Any, Shape] = dataclasses.field(default_factory=dict, repr=False)
    clock: str = "t"
    breaks: tuple[float, ...] = ()
    of_origins: MutableMapping[Any, Steps] = dataclasses.field(
        default_factory=WeakKeyDictionary, init=False, repr=False
    )
    of_layouts: dict[Layout, Steps] = dataclasses.field(
        default_factory=dict, init=False, repr=False
    )
    # what drivers get instead of a method, by its identity
    ways: dict[int, Any] = dataclasses.field(default_factory=dict, init=False, repr=False)

    def of_system(self, system: System) -> Steps:
        """The same for a system of the same layout; what is laid out and compiled is shared."""
        shapes = {key: shape.of_system(system) for key, shape in [*self.shapes.items()]}
        own = {"system": system, "shapes": shapes}
        other: Steps = like(self, of_origins=WeakKeyDictionary(), of_layouts={}, **own)
        return other

    @property
    def one(self) -> System:
        """The system, of several the first."""
        return of_body(self.system, 0)

    def of(self, body: int) -> Any:
        """The system of a body."""
        return of_body(self.system, body)

    def method_of(self, body: int) -> Any:
        """The method of a body."""
        return of_body(self.method, body)

    @property
    def way(self) -> Any:
        """The method as drivers get it, or those of all bodies."""
        if isinstance(self.method, OfBodies):
            return type(self.method)(tuple([self.way_of(i) for i in range(len(self.method))]))
        return self.way_of(0)

    def way_of(self, body: int) -> Any:
        """The same of one body."""
        method = self.method_of(body)
        if self.clock != "t" and not method.fictive:
            return method
        known = self.ways.get(id(method))
        if known is None:
            known = self.ways[id(method)] = ending_at_jumps(method, self.of(body), self.breaks)
        return known

    def h_of(self, body: int) -> float:
        """The step of a body."""
        h: float = self.h[body] if isinstance(self.h, tuple) else self.h
        return h

    def owns(self, shape: Shape | None) -> bool:
        """Is the shape one of this plan?"""
        return shape in self.shapes.values()

    def remembering(self, start: State) -> State:
        """The start of one body, in compensated numbers what is to be summed up so: all, nothing,
        or what the motion depends on.

        In double-double precision in numbers of two doubles.
        """
        if self.precision == "double-double":
            return double_double(start)
        if self.compensated is None and (self.method.symmetric or self.method.symplectic):
            motion = self.one.essential_part(start).parts
            return type(start)(
                *(
                    compensated(x) if motion[name] is not None else x
                    for name, x in start.parts.items()
                )
            )
        return compensated(start) if self.compensated else start


class Prepared:
    """What drivers of steps of all kinds need.

    arguments : method, system, two layouts.  constants : the numbers of method and system.
    stepping : who runs the driver.
    """

    arguments: tuple[Any, Any, Any, Any]
    constants: bytes
    stepping: Any

    def of_system(self, system: System) -> Any:
        """The same for another system of the same layout."""
        method, _, *layouts = self.arguments
        return like(
            self,
            arguments=(method, system, *layouts),
            constants=numbers_of(method, system),
            **{"stepping": self.stepping.of(system)} if "stepping" in vars(self) else {},
        )


class Shape(Prepared):
    """The layouts of a run, and the code that makes its steps.

    given : of a start of one body as it comes; started : in the numbers of the run.
    layout : of what the method carries along.  example, shown : a sample and its layout.
    lanes : bodies side by side.
    own : numbers of which every body has its own.
    carried, sampled : how many numbers are carried along, with that of the steps, and are in a
    sample.
    order : for a method without a memory, which number of the start each number is that is carried
    along; -1 for a rest, zero.
    column : of steps in fictive time, which number of a sample is the time, once it was asked for.
    """

    column: int | None = None

    def __init__(
        self, steps: Steps, given: Layout, started: Layout, first: Any, example: State, side: int
    ) -> None:
        method, system = steps.way, steps.system
        self.given, self.started, self.example = given, started, example
        self.layout, self.shown = carried_layout(first), layout_of(example)
        native = steps.compiled is not False and side and kernel.available() is None
        self.lanes = side if native else 1
        self.own: list[np.ndarray] = []
        self.constants, things = b"", []
        for thing in (method, system):
            if isinstance(thing, OfBodies):
                things.append(kernel.Several.of(thing.members, self.columns(len(thing))))
                self.own.append(things[-1].columns)
            else:
                things.append(thing)
                self.constants += numbers_of(thing)
        method, system = things
        self.h: Any = steps.h
        if isinstance(steps.h, tuple):
            self.h = kernel.Several.of(steps.h, self.columns(len(steps.h)))
            self.own.append(self.h.columns)
        self.carried, self.sampled, self.gather = (
            self.layout.width + 1,
            self.shown.width,
            gatherer(given),
        )
        self.arguments = method, system, self.layout, self.shown
        self.asked, self.progress = steps.compiled, steps.progress
        self._call = struct.Struct(f"8q{len(self.constants)}s2d").pack
        self._beginning: Execution | None = None
        self.others: dict[Any, Any] = {}
        self.order: list[int] | None = None
        if given == self.shown and all(
            getattr(type(steps.method_of(0)), f) is getattr(Method, f) for f in ("start", "observe")
        ):
            numbered = fitted(
                build(given, iter([1.0 + i for i in range(given.width)])), self.layout
            )
            self.order = [int(x) - 1 for x in leaves(numbered, self.layout)]
            self._first = struct.Struct(f"{self.carried + self.sampled}d")
            self._picked: Any = operator.itemgetter(*[*self.order, -1, *range(given.width)])

    def columns(self, bodies: int) -> int:
        """The columns that so many bodies take: whole lanes, and of large ensembles some more where
        all numbers of a body would want the same place in the cache.
        """
        whole = -(-bodies // self.lanes) * self.lanes
        return whole + APART if whole >= FAR and whole % PAGE == 0 else whole

    def of_system(self, system: System) -> Shape:
        other: Shape = super().of_system(system)
        if other._beginning is not None:
            other._beginning = other._beginning.of(system)
        other.others = {key: lanes.of_system(system) for key, lanes in self.others.items()}
        return other

    @functools.cached_property
    def stepping(self) -> Execution:
        """Who runs `fixed_steps`."""
        none = np.empty(0)
        call = fixed_steps, *self.arguments, 0.0, self.h, 0, 1, 1, none, none, None
        return Execution(self.asked, self.progress, *call, lanes=self.lanes)

    @property
    def beginner(self) -> tuple[Any, ...]:
        """The arguments of `begin` that are no arrays."""
        return *self.arguments[:2], self.given, self.started, self.layout, self.shown, self.h

    def begin(self, start: State, memory: Any) -> bool:
        """Write what one body carries along, and behind it the first sample; False if the method
        cannot begin so.
        """
        numbers = self.gather(start)
        if self.order is not None:
            numbers.append(0.0)
            self._first.pack_into(memory, 0, *self._picked(numbers))
            return True
        beginning = self._beginning
        if beginning is None:
            return False
        beginning.used(self.asked)
        states, out, starts = (
            memory[: self.carried],
            memory[self.carried :][: self.sampled],
            np.array(numbers),
        )
        out[:] = numbers if self.given == self.shown else 0.0
        if beginning.ready(0.0):
            native: Any = beginning.native
            native.run(self.constants + TIME.pack(self.h), (), (starts, states, out))
        else:
            arguments = [*self.beginner, starts, states, out, []]
            with beginning.plain():
                begin(*arguments)
        return bool(states[-1] == 0.0)

    def native_steps(
        self, native: Any, t0: float, h: float, first: int, every: int, samples: int, states: int,
        out: int,
    ) -> None:  # fmt: skip
        """`fixed_steps` of one body.  native : its code.  states, out : the addresses of the
        arrays.
        """
        block = self._call(1, 0, 1, first, every, samples, states, out, self.constants, t0, h)
        native.on_memory(block, ((states, self.carried), (out, samples * self.sampled)))

    def beginning(self, steps: Steps) -> Execution:
        """Who runs `begin`."""
        if self._beginning is None:
            none = np.empty(0)
            wanted = steps.compiled if self.lanes > 1 or steps.compiled is False else None
            call = begin, *self.beginner, none, none, none, None
            self._beginning = Execution(
                wanted, steps.progress, *call, lanes=self.lanes, silent=self.lanes == 1
            )
        return self._beginning


def times(t0: float, numbers: np.ndarray, h: float | tuple[float, ...]) -> np.ndarray:
    """The times after so many steps, (n,); of bodies with steps of their own (n, bodies)."""
    return t0 + numbers[:, None] * np.array(h) if isinstance(h, tuple) else t0 + numbers * h


def shown_step(h: float | tuple[float, ...]) -> Any:
    """The step as a run shows it: a number, or an array of one for each body."""
    return np.array(h) if isinstance(h, tuple) else h
