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
from ...formulas.classes.layouts import gatherer, layout_of
from ..reports.progress import notice

LOOK = 0.02
"""Seconds of plain Python after which native code is looked for on disk."""

WAIT = 0.3
"""Seconds of plain Python after which native code is made, if as many more are to be expected."""

MANY = 1000
"""Histories that are kept."""


class History:
    """Experience of this process with one driver and the layouts of its arguments."""

    def __init__(self) -> None:
        self.seconds = 0.0  # spent on it in plain Python
        self.uses = 0  # of a driver before or after the steps
        self.looked = False  # was native code looked for on disk?
        self.refused = False  # can it not be compiled?


OFTEN = 3
"""Uses after the first one that are worth native code: it takes 0.1 to 0.2 s to make, and saves 0.2 to 0.8 ms each."""

_histories: dict[Any, History] = {}
_shown: set[str] = set()  # refusals


COLUMNS, SHARED = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
"""Examples of the buffers of a driver: with a column for each body, and one that all share."""


class Execution:
    """The choice between plain Python and a kernel for one driver of one run.  A plan keeps a pattern, which all its
    threads share; every run takes a copy, `of_a_run`.
    """

    def __init__(
        self, wanted: bool | None, progress: bool | None, *call: Any, lanes: int = 1, silent: bool = False
    ) -> None:
        # True for native code, at once or NotCompilable; False for plain Python; None to choose by the time that plain
        # Python takes; `wanted` is the same but after a refusal
        self.asked, self.progress = wanted, progress
        self.call = call  # the driver, and arguments with the layouts of those to come
        self.given: Sequence[Any] = kernel.examples(call[1:])  # these arguments, as a kernel takes them
        self.lanes = lanes  # bodies side by side
        self.silent = silent  # without a warning of a refusal, on which little depends
        self.native: kernel.Kernel | None = None  # None: plain Python
        # the reads of a kernel, and their guard for the objects of this call; None: the guard of all calls
        self.guard: Any = None, None
        self.refresh()

    def of_system(self, system: Any) -> Execution:
        """The Execution for another system of the same layout; the system is the second argument of
        every driver of steps.
        """
        call = *self.call[:2], system, *self.call[3:]
        return like(self, call=call, given=call[1:], guard=(None, None))

    def of_a_run(self) -> Any:
        """A copy for one run, whose native code is that of the formulas as they are now."""
        return like(self, native=self.refresh())

    def refresh(self) -> kernel.Kernel | None:
        """Prepare for another run.  Returns native code of the formulas as they are now, None if there is none."""
        self.seconds = 0.0  # of this run in plain Python
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
        """Native code for a driver that runs before or after the steps, or None.  demanded : compile it, but not for
        the first `OFTEN` uses.
        """
        native = self.refresh()
        if native is None:
            self.history.uses += 1
            if demanded and self.history.uses > OFTEN and self.wanted is not False:
                native = self.native = self._compiled()
        return native

    def _unchanged(self, reads: Any) -> bool:
        """Whether everything that the kernel has read is unchanged.  Calls with other objects share native code, and
        have guards of their own.
        """
        guarded_reads, own_guard = self.guard
        guard = own_guard if guarded_reads is reads and own_guard is not None else reads.guard
        verdict = guard.verdict(self.given)
        if verdict is None:
            own_guard = reads.guard_of(self.given)
            self.guard = reads, own_guard
            verdict = own_guard is not None
        return bool(verdict)

    @contextmanager
    def plain(self) -> Iterator[None]:
        """A context whose time counts as plain Python's, unless there is native code."""
        start = time.perf_counter()
        try:
            yield
        finally:
            if self.native is None:
                elapsed = time.perf_counter() - start
                self.seconds += elapsed
                self.history.seconds += elapsed

    def ready(self, done: float) -> kernel.Kernel | None:
        """Native code for the rest of the run, or None.  When plain Python has taken long enough, it is looked for on
        disk, and later compiled.  done : the part of the run that is over.
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
        """Compile the driver, unless it is compiled.  Raises NotCompilable if native code was demanded; else warns that
        plain Python goes on.
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

    def run(self, *call: Any) -> None:
        """Run native code, as `Kernel.run`, for columns of the arrays in whole lanes."""
        self.native.run(*call)  # type: ignore[union-attr]


def numbers_of(*values: Any) -> bytes:
    """The bytes of the numbers of values in turn, as native code takes them, without `Several`, which lie in columns."""
    shared = [value for value in values if not isinstance(value, kernel.Several)]
    return b"".join([array("d", gatherer(layout_of(value))(value)).tobytes() for value in shared])


def like(thing: Any, **changed: Any) -> Any:
    """A shallow copy with some attributes changed, in a tenth of the time of `copy.copy`."""
    copy = object.__new__(type(thing))
    copy.__dict__.update(thing.__dict__ | changed)
    return copy


def _history(call: tuple[Any, ...], lanes: int) -> History:
    """The History of a driver and the layouts of its arguments."""
    key = lanes, call[0], *map(kernel.kind_of, call[1:])
    if key not in _histories and len(_histories) >= MANY:
        _histories.clear()
    return _histories.setdefault(key, History())
