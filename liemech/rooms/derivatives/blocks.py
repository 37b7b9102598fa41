"""Blocks of steps of one run as bodies of one ensemble, whose numbers carry derivatives."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ...compiler import kernel
from ...compiler.driver import Rejected, attempt, reason
from ...errors import IncompatibleSystem, NotCompilable, failure, is_mistake
from ...formulas import Vec
from ...formulas.classes.layouts import layout_of
from ...formulas.numbers.conversions import with_slopes
from ...integrators.ending_at_jumps import EndingAtJumps
from ...integrators.method import Method
from ...simulation.compiled.control import ASKED, LAST_TIME, LIMIT, MARK, ORIGIN, STEP, STRAIGHT, TAKEN, TIME, begun
from ...simulation.compiled.driver import advance, begin
from ...simulation.compiled.execution import like
from ...simulation.compiled.lanes import Lanes
from ...simulation.compiled.prepared import RunShape, Steps
from .directions import WithStep, dual_of
from .frames import LEVEL
from .tangent import StepsOfARun

PLAIN = 2**9
"""Steps of all blocks together that plain Python may make: they take it half a second."""

WORTH = 2**13
"""Steps of all blocks together that are worth a thread."""


SAME = 2.0**-24
"""Part of the largest number by which steps, begun anew in the middle, may end beside the run."""


def require_same(method: Any, ends: np.ndarray, of_run: np.ndarray) -> None:
    """Refuse methods whose steps depend on more than the state and the time.

    ends, of_run : the numbers of states at the end of steps that were begun anew, and of the run.
    """
    size, off = np.abs(of_run).max(), np.abs(ends - of_run).max()
    if not off <= SAME * size:
        raise IncompatibleSystem(
            f"Plan.gradient: {method!r} keeps in memory what does not follow from the state: begun anew in the middle it "
            f"comes elsewhere, by {off / size:.1e}. plan.tangent differentiates such runs"
        )


class Blocks:
    """The code that takes states with derivatives through blocks of steps.

    way : the Steps of the plan.  directions : with systems and methods whose numbers carry derivatives along `side`
    directions.  start : a state of one body.
    """

    def __init__(self, way: Steps, directions: Any, start: Any) -> None:
        systems, methods = directions.systems, directions.methods
        self.way, self.systems, self.methods, self.t0 = way, systems, methods, 0.0
        self.directions = directions
        still = Vec(*[0.0] * systems.side)
        dual = dual_of(start, still=still)
        # without what rounding took, which changes a derivative by as little
        trial: Any = attempt(begun, methods.example, systems.example, dual, way.h_of(0))
        if isinstance(trial, Rejected):
            refused: Any = reason(trial)
            raise refused
        # all that the method carries along may come to depend on the start, zeros of guesses too
        carry, example = with_slopes(trial[0], LEVEL, still), trial[1]
        # a register for each number: there are twice as many numbers as in a step
        steps, state = dataclasses.replace(way, method=innermost(directions.raw[0]), shapes={}), layout_of(dual)
        self.shape = RunShape(steps, state, state, carry, example, kernel.width())
        things = methods.argument, systems.argument
        self.lanes = Lanes(
            things, STRAIGHT, self.shape.layout, example, (), way.compiled, way.progress, self.shape.side
        )
        self.side = self.lanes.stepping.lanes
        if self.shape.order is None:
            self.beginning = self.shape.beginning(way, self.lanes)

    def of_a_run(self, t0: float, work: int) -> Blocks:
        """A copy for one run, whose step 0 is at t0, with native code of the formulas as they are now.

        work : the number of steps of all blocks and directions.  Raises NotCompilable for several directions in a number
        where the code is too long: there is a shorter one.
        """
        else_shorter = self.directions.side > 1
        of_run: Blocks = like(self, t0=t0, lanes=self.lanes.of_a_run())
        stepping = of_run.lanes.stepping
        stepping.silent = else_shorter
        if work > PLAIN:
            stepping.compile()
        if else_shorter and stepping.wanted is False and stepping.asked is not False:
            raise NotCompilable("Plan.gradient: too long with several directions in a number")
        if self.shape.order is None:
            of_run.beginning = like(self.beginning, native=self.beginning.used(self.way.compiled))
        return of_run

    def run(
        self, starts: np.ndarray, body: np.ndarray, first: np.ndarray, last: np.ndarray,
        systems: np.ndarray, methods: np.ndarray, done: float,
    ) -> np.ndarray:  # fmt: skip
        """The states at the ends of blocks, numbers with their slopes, (numbers, blocks).

        starts : the states at their beginnings, (numbers, blocks).  body : the number of the body of each.
        first, last : the numbers of steps at which blocks begin and end.  systems, methods : columns of their numbers.
        done : the part of all blocks that was done before.
        """
        lanes, count = self.lanes, starts.shape[1]
        whole = -(-count // self.side) * self.side
        block = np.minimum(np.arange(whole), count - 1)  # lanes that are left over repeat the last
        starts = np.ascontiguousarray(starts[:, block])
        body, first, last = body[block], first[block], last[block]
        table = np.zeros((lanes.height, whole))
        numbers, clocks, goals, *parameters = lanes.parts(table)
        varying = [
            columns
            for thing, columns in zip(lanes.arguments[:2], (methods, systems))
            if isinstance(thing, kernel.Several)
        ]
        for rows, columns in zip(parameters, varying, strict=True):
            rows[:] = columns[:, block]
        h = np.array([self.way.h_of(i) for i in range(body.max() + 1)])[body]
        clocks[TIME], clocks[STEP], clocks[TAKEN] = self.t0 + first * h, h, first
        goals[LAST_TIME], goals[LIMIT], goals[ORIGIN] = np.inf, last, self.t0
        out = np.zeros((1, self.shape.shown.width, whole))
        steps = int((last - first).max())
        column = 0
        while column < whole and not self._ready(done, column / whole):
            for i in range(column, min(column + self.side, count)):
                self._plainly(starts[:, i], table[:, i], out[:, :, i], steps)
            column += self.side
        if column < whole:
            if self.shape.order is not None:
                order = np.array(self.shape.order)
                numbers[:, column:] = np.where(order[:, None] < 0, 0.0, starts[order, column:])
            else:
                buffers = *parameters, starts, clocks, numbers, out[0]
                self.beginning.run(lanes.constants, (), buffers, whole, column, whole)
            failed = np.flatnonzero(clocks[MARK, column:] != 0.0) + column
            lanes.natively(table, out, 1, self.way.workers, steps, range(column, whole), worth=WORTH)
            not_native = np.flatnonzero(clocks[MARK] == ASKED)
            for i in np.unique(np.concatenate([failed, not_native])).tolist():
                if i >= count:
                    break
                clocks[:, i] = self.t0 + first[i] * h[i], h[i], 0.0, first[i], 0.0, 0.0, 0.0
                self._plainly(starts[:, i], table[:, i], out[:, :, i], steps)
        return out[0, :, :count]

    def _ready(self, done: float, part: float) -> bool:
        """Whether there is native code for the other blocks."""
        stepping = self.lanes.stepping
        if not stepping.ready(max(done, part)):
            return False
        if self.shape.order is None and self.beginning.native is None:
            if self.beginning.wanted is False:
                return False
            self.beginning.compile()
        return self.shape.order is not None or self.beginning.native is not None

    def _plainly(self, start: np.ndarray, column: np.ndarray, out: np.ndarray, steps: int) -> None:
        """Take one state through its block in plain Python."""
        numbers, clock, goal, *parameters = [x.copy() for x in self.lanes.parts(column)]
        things = [
            varied.thing(parameters.pop(0)) if isinstance(thing, kernel.Several) else thing
            for thing, varied in zip(self.lanes.arguments[:2], (self.methods, self.systems))
        ]
        raised: list[Any] = []
        row = np.zeros(self.shape.shown.width)
        with self.lanes.stepping.plain():
            driver: Any = begin
            driver(*self.shape.beginner(things), start.copy(), clock, numbers, row, raised)
            if not raised:
                driver = advance
                driver(*things, *self.lanes.arguments[2:], 1, steps, goal, numbers, clock, row, raised)
        if raised:
            error = raised[-1]
            if is_mistake(error):
                raise error
            t = clock[TIME]
            raise failure(error, f"Plan.gradient: {things[0]!r}", f"in the derivative of the step at t = {t:g}")
        out[0] = row


def innermost(method: Any) -> Any:
    """The method of steps that end where inputs jump, or whose length is a parameter or that of an adaptive run."""
    return innermost(method.method) if isinstance(method, (EndingAtJumps, WithStep, StepsOfARun)) else method


def remembers(method: Any) -> bool:
    """Whether a method carries more along than the state."""
    return any(getattr(type(innermost(method)), f) is not getattr(Method, f) for f in ("start", "observe"))
