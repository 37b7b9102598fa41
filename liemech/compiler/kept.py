"""Native code that a process keeps between calls: kernels, the work of batches, the seconds of plain Python that decide
whether native code pays, and what cannot be compiled.  `changes/cache.py` keeps kernels between processes.
"""

from __future__ import annotations

import collections
import contextlib
import os
import threading
from collections.abc import Sequence
from typing import Any

ALIVE = 256
"""Entries of a table of what was used last: kernels of some 100 kB each."""

VARIANTS = 8
"""Kernels kept for one driver and layout while globals, helpers, ... change."""


class LastUsed(collections.OrderedDict[Any, Any]):
    """A table of at most ALIVE entries; those that were not used for the longest time go first."""

    def use(self, key: Any) -> None:
        """Put an entry, which another thread may have thrown out, behind all others."""
        with contextlib.suppress(KeyError):
            self.move_to_end(key)
            while len(self) > ALIVE:
                self.popitem(last=False)


class Variants:
    """The kernels of one driver and layout, which differ in their reads, the last used first; with the lock of the
    thread that makes one.
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.kernels: list[Any] = []

    def find(self, args: Sequence[Any]) -> Any:
        """The kernel that says what formulas say now; None if there is none."""
        for kernel in self.kernels:
            if kernel.reads.unchanged(args):
                if kernel is not self.kernels[0]:
                    self.kernels = [kernel, *(other for other in self.kernels if other is not kernel)]
                return kernel
        return None

    def add(self, kernel: Any) -> None:
        """Keep one kernel more, as the last used."""
        self.kernels = [kernel, *self.kernels[: VARIANTS - 1]]


KERNELS = LastUsed()
"""`Variants` by driver, kinds of arguments and number of lanes."""

BATCHES = LastUsed()
"""By the form of a batch, its job and a weak reference to the kernel: the next one needs no row of plain Python."""

NATIVE: set[Any] = set()
"""Formulas of classes that have native code for batches of some layouts at least."""

REFUSED: set[Any] = set()
"""Jobs of batches that cannot be compiled: nobody tries again."""

SECONDS_OF_BATCHES: dict[Any, float] = {}
"""Seconds that the formulas of a class have taken in plain Python, in batches."""

SECONDS_OF_ROWS: dict[Any, float] = {}
"""Seconds that the formulas of a class have taken in plain Python, one row at a time."""


def _after_fork() -> None:
    """Give the child of a fork locks of its own: the threads that held them are not there."""
    for variants in KERNELS.values():
        variants.lock = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
