"""What all runs of a plan with steps of one length share, if their starts are alike: layouts, and native code."""

from __future__ import annotations

import dataclasses
from array import array
from typing import Any

import numpy as np

from ..compiler import kernel
from ..formulas.broadcasting import small
from ..formulas.pytree import Layout, build, compensated, double_double, fitted, layout_of, leaves
from ..integrators.method import Method
from ..systems.system import State, System
from .execution import Execution
from .fixed import begin, fixed_steps
from .systems import Systems


@dataclasses.dataclass(frozen=True, eq=False)
class Steps:
    """Steps of one length: what a plan was told of them.

    system : one for all bodies, or `Systems`.
    compensated, precision, compiled, progress, workers : as for `integrate`.
    """

    system: Any
    method: Method
    h: float
    every: int
    compensated: bool | None
    precision: str
    compiled: bool | None
    progress: bool | None
    workers: int
    shapes: dict[Any, Shape] = dataclasses.field(default_factory=dict, repr=False)

    @property
    def one(self) -> System:
        """The system, of several the first."""
        return self.system[0] if isinstance(self.system, Systems) else self.system

    def of(self, body: int) -> System:
        """The system of a body."""
        return self.system[body] if isinstance(self.system, Systems) else self.system

    @property
    def settings(self) -> tuple[Any, ...]:
        """All but the system, for a plan of another one."""
        return self.method, self.h, self.every, self.compensated, self.precision, self.compiled, self.progress, self.workers

    def own(self, shape: Shape) -> Shape | None:
        """The shape, if it is one of this plan."""
        return shape if self.shapes.get(shape.key) is shape else None

    def remembering(self, start: State) -> State:
        """The start of one body, in compensated numbers what is to be summed up so: all, nothing, or what the motion depends on.

        In double-double precision in numbers of two doubles.
        """
        if self.precision == "double-double":
            return double_double(start)
        if self.compensated is None and (self.method.symmetric or self.method.symplectic):
            motion = self.one.essential(start).parts
            return type(start)(*(compensated(x) if motion[name] is not None else x for name, x in start.parts.items()))
        return compensated(start) if self.compensated else start


class Shape:
    """The layouts of a run, and the code that makes its steps.

    key : by which the plan knows it.  given : of a start of one body as it comes; started : in the numbers of the run.
    layout : of what the method carries along.  example, shown : a sample and its layout.  lanes : bodies side by side.
    stepping : who runs `fixed_steps`.  constants : the numbers of method and system; own : those of which every body has its own.
    order : for a method without a memory, which number of the start each number of the memory is, -1 for a rest of zero.
    """

    def __init__(self, steps: Steps, given: Layout, started: Layout, first: Any, example: State, many: bool) -> None:
        method, system = steps.method, steps.system
        self.key = given, many
        self.given, self.started, self.example = given, started, example
        self.layout, self.shown = layout_of(first), layout_of(example)
        native = steps.compiled is not False and many and kernel.available() is None
        self.lanes = kernel.lanes() if native else 1
        constants, self.own = leaves(method, layout_of(method)), []
        if isinstance(system, Systems):
            system = kernel.Several.of(system.systems, -(-len(system) // self.lanes) * self.lanes)
            self.own.append(system.columns)
        else:
            constants += leaves(system, layout_of(system))
        self.constants = array("d", constants)
        none = np.empty(0)
        self.arguments = method, system, self.layout, self.shown
        call = fixed_steps, *self.arguments, 0.0, steps.h, 0, 1, 1, none, none, None
        self.stepping = Execution(steps.compiled, steps.progress, *call, lanes=self.lanes)
        self.beginner = method, system, given, started, self.layout, self.shown, steps.h
        self._beginning: Execution | None = None
        self.order: list[int] | None = None
        if not many and all(getattr(type(method), f) is getattr(Method, f) for f in ("start", "observe")):
            numbered = fitted(build(given, iter([1.0 + i for i in range(given.width)])), self.layout)
            self.order = [int(x) - 1 for x in leaves(numbered, self.layout)]

    def native_steps(self, t0: float, h: float, first: int, every: int, samples: int, states: np.ndarray, out: np.ndarray) -> None:
        """`fixed_steps` of one body, in native code that is there."""
        native: Any = self.stepping.native
        native.run(self.constants + array("d", (t0, h)), (first, every, samples), (states, out))

    def beginning(self, steps: Steps) -> Execution:
        """Who runs `begin`."""
        if self._beginning is None:
            none = np.empty(0)
            wanted = steps.compiled if self.lanes > 1 or steps.compiled is False else None
            call = begin, *self.beginner, none, none, none, None
            self._beginning = Execution(wanted, steps.progress, *call, lanes=self.lanes, silent=self.lanes == 1)
        return self._beginning


def member(start: State, i: int) -> State:
    """The start of one body."""
    if start.bodies is None:
        return start
    return type(start)(*(None if x is None else small(x[i]) for x in start.parts.values()))
