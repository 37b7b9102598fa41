"""Choice between plain Python and native code for a driver: native as soon as it is there or pays.
Both give the same bits.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...compiler import kernel
from ...errors import NotCompilable, NotCompiledWarning, warn
from ...formulas.classes.flattening import gatherer
from ...formulas.classes.layouts import layout_of
from ..reports.progress import notice

LOOK = 0.02
"""Seconds of plain Python after which native code is looked for on disk."""

WAIT = 0.3
"""Seconds of plain Python after which native code is made, if as many more are to be expected."""

MANY = 1000
"""Kinds of runs that are remembered."""


class History:
    """Experience of this process with one driver and the layouts of its arguments.

    seconds : spent on it in plain Python.  uses : of drivers before or after the steps.
    looked : on disk.  refused : it cannot be compiled.
    """

    def __init__(self) -> None:
        self.seconds, self.uses, self.looked, self.refused = 0.0, 0, False, False


OFTEN = 3
"""Uses after the first one that are worth native code: it takes 0.1 to 0.2 s to make, and saves 0.2 to 0.8 ms each."""

_histories: dict[Any, History] = {}
_shown: set[str] = set()  # refusals


COLUMNS, SHARED = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
"""Examples of the buffers of a driver: with a column for each body, and one that all share."""


class Execution:
    """How one run executes one driver.  What runs of a plan have in common, in whatever thread, is a pattern,
    which only says what native code there is: a run takes a copy, `of_a_run`, that nobody else changes.

    wanted : True for native code, at once or NotCompilable; False for plain Python; None to choose
    by the time plain Python takes.
    call : the driver and arguments like those to come; arrays and integers may be any.
    native : the kernel; None for plain Python.  silent : is a refusal not told, because little
    depends on it?  guard : the reads of a kernel, and what compares them with the objects of this call,
    where it has parts of its own.
    """

    def __init__(
        self, wanted: bool | None, progress: bool | None, *call: Any, lanes: int = 1, silent: bool = False
    ) -> None:
        self.asked, self.progress, self.call, self.lanes, self.silent = (wanted, progress, call, lanes, silent)
        self.given: Sequence[Any] = kernel.examples(call[1:])
        self.native: kernel.Kernel | None = None
        self.guard: Any = None, None
        self.refresh()

    def of_system(self, system: Any) -> Execution:
        """The Execution for another system of the same layout; the system is the second argument of
        every driver of steps.
        """
        call = *self.call[:2], system, *self.call[3:]
        other: Execution = like(self, call=call, given=call[1:], guard=(None, None))
        return other

    def of_a_run(self) -> Any:
        """A copy for one run, with native code that says what the formulas say now, for as long as it lasts."""
        return like(self, native=self.refresh())

    def refresh(self) -> kernel.Kernel | None:
        """Prepare for another run: returns native code that says what the formulas say now, None if there is none."""
        self.seconds = 0.0
        native = self.native
        if native is None or not self._unchanged(native.reads):
            self.wanted = self.asked
            native = kernel.known(*self.call, lanes=self.lanes) if self.asked is not False else None
            if native is None:
                self.history = History() if self.asked is False else _history(self.call, self.lanes)
                if self.asked:
                    native = self._compiled()
                elif self.history.refused:
                    self.wanted = False
            self.native = native
        return native

    def used(self, demanded: bool | None) -> kernel.Kernel | None:
        """Native code for a driver that runs before or after the steps, or None; those who demand it have it here
        from the third use after the first one on.
        """
        native = self.refresh()
        if native is None:
            self.history.uses += 1
            if demanded and self.history.uses > OFTEN and self.wanted is not False:
                native = self.native = self._compiled()
        return native

    def _unchanged(self, reads: Any) -> bool:
        """Whether everything that the kernel has read is unchanged. Calls that differ in their objects share native
        code, and each has a guard.
        """
        of, mine = self.guard
        guard = mine if of is reads and mine is not None else reads.guard
        verdict = guard.verdict(self.given)
        if verdict is None:
            mine = reads.guard_of(self.given)
            self.guard = reads, mine
            verdict = mine is not None
        return bool(verdict)

    @contextmanager
    def plain(self) -> Iterator[None]:
        """Around what runs in plain Python: its time counts, as long as there is no native code."""
        start = time.perf_counter()
        try:
            yield
        finally:
            if self.native is None:
                used = time.perf_counter() - start
                self.seconds += used
                self.history.seconds += used

    def ready(self, done: float) -> kernel.Kernel | None:
        """The native code to go on with, if there is some.  When plain Python, `done` with this part of the
        run, has taken long enough, it is looked for on disk, and later made.
        """
        native = self.native
        if native is None and self.wanted is None:
            spent, left = self.history.seconds, self.seconds * (1.0 - done) / done if done else 0.0
            if spent >= LOOK and not self.history.looked and kernel.available() is None:
                self.history.looked = True
                native = kernel.stored(*self.call, lanes=self.lanes)
            if native is None and spent >= WAIT and spent + left >= 2.0 * WAIT:
                native = self._compiled()
            self.native = native
        return native

    def compile(self) -> None:
        """Make native code, if it is not there.  Raises NotCompilable if it was demanded; else
        warns that plain Python goes on.
        """
        if self.native is None and self.wanted is not False:
            self.native = self._compiled()

    def _compiled(self) -> kernel.Kernel | None:
        why_not = kernel.available()
        try:
            if why_not is not None:
                raise NotCompilable(f"integrate: compiled=True, but {why_not}")
            with notice(self.progress, f"liemech: compiling {self.given[0]!r}"):
                return kernel.kernel(*self.call, lanes=self.lanes)
        except NotCompilable as error:
            if self.wanted:
                raise
            self.wanted = False
            if why_not is None:
                self.history.refused = True
                if not self.silent and str(error) not in _shown:
                    _shown.add(str(error))
                    warn(f"{error}. Running in plain Python instead, much slower", NotCompiledWarning)
            return None

    def run(
        self,
        numbers: bytes,
        integers: Sequence[int],
        arrays: Sequence[np.ndarray],
        columns: int = 1,
        begin: int = 0,
        end: int = 1,
    ) -> None:
        """Run native code for the columns from begin to end, whole lanes, of all that arrays have.

        numbers : of all values in turn.
        """
        self.native.run(numbers, integers, arrays, columns, begin, end)  # type: ignore[union-attr]


def numbers_of(*values: Any) -> bytes:
    """The numbers of values in turn, as native code gets them; those of which every body has its own lie elsewhere."""
    shared = [value for value in values if not isinstance(value, kernel.Several)]
    return b"".join([array("d", gatherer(layout_of(value))(value)).tobytes() for value in shared])


def like(thing: Any, **changed: Any) -> Any:
    """A copy with other attributes: `copy.copy` takes ten times as long."""
    copy = object.__new__(type(thing))
    copy.__dict__.update(thing.__dict__ | changed)
    return copy


def _history(call: tuple[Any, ...], lanes: int) -> History:
    """The History of a driver and the layouts of its arguments."""
    key = lanes, call[0], *map(kernel.kind_of, call[1:])
    if key not in _histories and len(_histories) >= MANY:
        _histories.clear()
    return _histories.setdefault(key, History())
