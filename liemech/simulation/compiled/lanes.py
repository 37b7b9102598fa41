"""Bodies side by side: how their numbers are laid out, and the native code that takes them forwards."""

from __future__ import annotations

import collections
import functools
import os
from typing import Any

import numpy as np

from ...compiler.kernel import Several
from ...compiler.machine.interrupts import in_threads
from ...formulas.classes.layouts import Layout, layout_of
from .control import ASKED, CLOCK, GOAL, MARK, STUCK, TAKEN, Equal, Fictive
from .driver import advance
from .execution import COLUMNS, Execution, like, numbers_of
from .systems import OfBodies

TRIALS = 2**10
"""Trials of all bodies together that are worth a thread."""

MOST = 2**62
"""Columns of a block, if all may be in one."""


class Lanes:
    """Columns of numbers: a body has one in every array.

    example, state : a state and its layout.  layout : of what is carried along.  row : of time,
    state, and what the control adds.  own : parameters of which every body has its own.
    mark : the number of a row that changes with every step.
    """

    def __init__(
        self, motion: tuple[Any, Any], control: Any, layout: Layout, example: Any, extra: Any,
        asked: bool | None, progress: bool | None, side: int,
    ) -> None:  # fmt: skip
        """motion : method and system, of all bodies or of each.  extra : an example of what rows have behind the state."""
        self.example, self.state, self.layout = example, layout_of(example), layout
        timed = not isinstance(control, Equal) or control.timed
        self.row = layout_of((0.0, example, extra)) if timed else self.state
        self.own: list[np.ndarray] = []
        arguments = []
        for argument in motion:
            if isinstance(argument, OfBodies):
                argument = Several.of(argument.members, len(argument))
            if isinstance(argument, Several):
                self.own.append(argument.columns)
            arguments.append(argument)
        self.constants = numbers_of(*arguments, control)
        if layout.in_memory:
            side = 1
        self.mark = self.row.width - 1 if isinstance(control, Fictive) else 0
        self.arguments: Any = (*arguments, control, layout, self.row)
        call = advance, *self.arguments, 1, 1, *[COLUMNS] * 4, None
        self.stepping = Execution(asked, progress, *call, lanes=side, silent=side > 1 and timed)

    def of_system(self, system: Any) -> Lanes:
        """A copy of these lanes for another system of the same layout."""
        method, _, *others = self.arguments
        return like(
            self,
            arguments=(method, system, *others),
            constants=numbers_of(method, system, others[0]),
            stepping=self.stepping.of_system(system),
        )

    def of_a_run(self) -> Lanes:
        """A copy of these lanes for one run, with an Execution of its own."""
        return like(self, stepping=self.stepping.of_a_run())

    def of_body(self, i: int) -> Any:
        """The arguments of a driver for one body."""
        return *(x.values[i] if isinstance(x, Several) else x for x in self.arguments[:2]), *(self.arguments[2:])

    @functools.cached_property
    def _parts(self) -> list[tuple[int, int]]:
        """First and last index in a column of numbers, clocks, goals and own parameters."""
        widths = self.layout.width, CLOCK.width, GOAL.width, *(len(x) for x in self.own)
        ends = [sum(widths[: i + 1]) for i in range(len(widths))]
        return [*zip([0, *ends[:-1]], ends, strict=True)]

    def parts(self, columns: np.ndarray) -> list[np.ndarray]:
        """Numbers, clocks, goals and parameters of their own, views of columns."""
        return [columns[begin:end] for begin, end in self._parts]

    @property
    def height(self) -> int:
        """Count of numbers of a column."""
        return self._parts[-1][1]

    def natively(
        self, columns: np.ndarray, out: np.ndarray, turns: int, workers: int, every: int = 1,
        bodies: range | None = None, size: int = MOST, worth: int = TRIALS,
    ) -> int:  # fmt: skip
        """Run native code for `turns` turns of some bodies, whole lanes of them, all by default; in blocks of some size,
        perhaps in threads.  Returns how many blocks there are in turn.

        worth : steps of all bodies together that are worth a thread.
        """
        bodies = range(columns.shape[1]) if bodies is None else bodies
        if self.layout.in_memory and columns.shape[1] > 1:
            for i in bodies:  # whose numbers lie in memory, one after another
                column, rows = columns[:, i : i + 1].copy(), out[..., i : i + 1].copy()
                self.natively(column, rows, turns, 1, every)
                columns[:, i : i + 1], out[..., i : i + 1] = column, rows
            return 1
        numbers, clocks, goals, *parameters = self.parts(columns)
        arguments = (turns, every), (*parameters, goals, numbers, clocks, out)
        call = functools.partial(self.stepping.run, self.constants, *arguments, columns.shape[1])
        return share_out(call, bodies, self.stepping.lanes, size, (turns * every, worth), workers)

    def plainly(
        self, body: int, column: np.ndarray, out: np.ndarray, turns: int, failures: list[Any],
        every: int = 1,
    ) -> None:  # fmt: skip
        """Run `turns` turns of a body in plain Python.  column : numbers, clock, goal.  out : rows, (turns, ...)."""
        numbers, clock, goal = [x.copy() for x in self.parts(column)[:3]]
        rows = out.ravel()
        with self.stepping.plain():
            driver: Any = advance
            driver(*self.of_body(body), turns, every, goal, numbers, clock, rows, failures)
        out[:] = rows.reshape(out.shape)
        column[: len(numbers)], column[len(numbers) :][: len(clock)] = numbers, clock

    def march(
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
                raised = failures.setdefault(body, [])
                self.plainly(body, columns[:, k], out[1:, :, k], turns, raised)
            return
        self.natively(columns, out[1:], turns, workers)
        for k in np.flatnonzero(columns[clock + MARK, : len(bodies)] == ASKED).tolist():
            body, taken = int(bodies[k]), columns[clock + TAKEN, k]
            raised = failures.setdefault(body, [])
            columns[clock + MARK, k] = 0.0
            while columns[clock + TAKEN, k] == taken and columns[clock + MARK, k] != STUCK:
                self.plainly(body, columns[:, k], out[-1:, :, k], 1, raised)


def share_out(call: Any, columns: range, side: int, size: int, work: tuple[int, int], workers: int) -> int:
    """Call native code, which does not hold the interpreter's lock, for some columns, in blocks of whole lanes, `side`
    columns each.  Each thread takes the next block as soon as it has done one.  Returns how many blocks there are in turn.

    work : what there is to do for a column, and what is worth a thread.
    """
    count, end = len(columns), columns.stop
    threads = max(1, min(workers, count * work[0] // work[1], count // side))
    share = -(-count // (threads * side)) * side
    size = min(share, max(side, size // side * side))
    if size >= count:
        call(columns.start, end)
        return 1
    blocks = columns[::size]
    waiting = iter(blocks)

    def take() -> None:
        try:
            for begin in waiting:
                call(begin, min(begin + size, end))
        finally:
            collections.deque(waiting, 0)  # interrupted, nobody begins another block

    in_threads([take] * threads, pool(workers, os.getpid()) if threads > 1 else None)
    return -(-len(blocks) // threads)


@functools.cache
def pool(workers: int, process: int) -> Any:
    """Threads that stay; a forked process has none of its parent's."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(workers - 1, "liemech")
