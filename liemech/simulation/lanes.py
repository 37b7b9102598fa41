"""Bodies side by side: how their numbers are laid out, and the native code that takes them forwards."""

from __future__ import annotations

import functools
import os
from typing import Any

import numpy as np

from ..compiler.interrupts import in_threads
from ..compiler.kernel import Several
from ..formulas.pytree import Layout, layout_of
from .control import ASKED, CLOCK, GOAL, MARK, STUCK, TAKEN, Fictive
from .driver import advance
from .execution import Execution, like, numbers_of
from .systems import OfBodies

TRIALS = 2**10
"""Trials of all bodies together that are worth a thread."""


class Lanes:
    """Columns of numbers: a body has one in every array.

    example, state : a state and its layout.  layout : of what is carried along.  row : of time,
    state, and what the control adds.  own : parameters of which every body has its own.
    mark : the number of a row that changes with every step.
    """

    def __init__(
        self, method: Any, system: Any, control: Any, layout: Layout, example: Any, extra: Any,
        asked: bool | None, progress: bool | None, side: int,
    ) -> None:  # fmt: skip
        self.example, self.state, self.layout = example, layout_of(example), layout
        self.row = layout_of((0.0, example, extra))
        self.own: list[np.ndarray] = []
        things = []
        for thing in (method, system):
            if isinstance(thing, OfBodies):
                thing = Several.of(thing.members, len(thing))
                self.own.append(thing.columns)
            things.append(thing)
        self.constants = numbers_of(*things, control)
        self.mark = self.row.width - 1 if isinstance(control, Fictive) else 0
        self.arguments: Any = (*things, control, layout, self.row)
        none = np.empty(0)
        call = advance, *self.arguments, 1, none, none, none, none, None
        self.stepping = Execution(asked, progress, *call, lanes=side, silent=side > 1)

    def of_system(self, system: Any) -> Lanes:
        """These lanes for another system of the same layout."""
        method, _, *rest = self.arguments
        made: Lanes = like(
            self,
            arguments=(method, system, *rest),
            constants=numbers_of(method, system, rest[0]),
            stepping=self.stepping.of(system),
        )
        return made

    def of_body(self, i: int) -> Any:
        """The arguments of a driver for one body."""
        return *(x.values[i] if isinstance(x, Several) else x for x in self.arguments[:2]), *(
            self.arguments[2:]
        )

    @functools.cached_property
    def _parts(self) -> list[tuple[int, int]]:
        """Where numbers, clocks, goals and parameters of their own are in a column."""
        widths = self.layout.width, CLOCK.width, GOAL.width, *(len(x) for x in self.own)
        ends = [sum(widths[: i + 1]) for i in range(len(widths))]
        return [*zip([0, *ends[:-1]], ends, strict=True)]

    def parts(self, columns: np.ndarray) -> list[np.ndarray]:
        """Numbers, clocks, goals and parameters of their own, views of columns."""
        return [columns[begin:end] for begin, end in self._parts]

    def natively(self, columns: np.ndarray, out: np.ndarray, turns: int, workers: int) -> None:
        """Run native code for `turns` trials of whole lanes of bodies, perhaps in threads."""
        numbers, clocks, goals, *own = self.parts(columns)
        padded, side = columns.shape[1], self.stepping.lanes
        native: Any = self.stepping.native
        arrays = *own, goals, numbers, clocks, out
        call = functools.partial(native.run, self.constants, (turns,), arrays, padded)
        threads = max(1, min(workers, padded * turns // TRIALS, padded // side))
        share = -(-padded // (threads * side)) * side
        works = [
            functools.partial(call, i, min(i + share, padded)) for i in range(0, padded, share)
        ]  # native code does not hold the interpreter's lock
        in_threads(works, pool(workers, os.getpid()) if len(works) > 1 else None)

    def plainly(
        self, body: int, column: np.ndarray, out: np.ndarray, turns: int, failures: list[Any]
    ) -> None:
        """Run `turns` trials of a body in plain Python.  column : numbers, clock, goal.  out : rows,
        (turns, ...).
        """
        numbers, clock, goal = [x.copy() for x in self.parts(column)[:3]]
        rows = out.ravel()
        with self.stepping.plain():
            driver: Any = advance
            driver(*self.of_body(body), turns, goal, numbers, clock, rows, failures)
        out[:] = rows.reshape(out.shape)
        column[: len(numbers)], column[len(numbers) :][: len(clock)] = numbers, clock

    def forwards(
        self, bodies: np.ndarray, columns: np.ndarray, out: np.ndarray, turns: int, workers: int,
        failures: dict[int, list[Any]], native: bool,
    ) -> None:  # fmt: skip
        """Run `turns` trials of some bodies; a step that native code cannot make is made in plain Python.

        columns : a column for each body, and for lanes that are left over.  out : (turns + 1, width,
        columns) rows, of which the first is there.
        """
        clock = self.layout.width
        if not native:
            for k, body in enumerate(bodies.tolist()):
                told = failures.setdefault(body, [])
                self.plainly(body, columns[:, k], out[1:, :, k], turns, told)
            return
        self.natively(columns, out[1:], turns, workers)
        for k in np.flatnonzero(columns[clock + MARK, : len(bodies)] == ASKED).tolist():
            body, taken = int(bodies[k]), columns[clock + TAKEN, k]
            told = failures.setdefault(body, [])
            columns[clock + MARK, k] = 0.0
            while columns[clock + TAKEN, k] == taken and columns[clock + MARK, k] != STUCK:
                self.plainly(body, columns[:, k], out[-1:, :, k], 1, told)


@functools.cache
def pool(workers: int, process: int) -> Any:
    """Threads that stay; a forked process has none of its parent's."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(workers - 1, "liemech")
