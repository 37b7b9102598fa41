"""Calls of native code with loops over the sites of one system: the rows of scratch memory that it
needs, and the sites of every thread.
"""

from __future__ import annotations

import ctypes
import functools
import os
import struct
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..formulas.sites import TOGETHER, padded, room
from . import guard_words, interrupts
from .kernel import Kernel


class SiteCalls:
    """Runs a kernel for the sites of one system, and keeps its scratch memory from call to call.

    count : of sites.  workers : threads that share the sites, of whole groups of sixteen.
    notes : of the last call, the first of those side by side among which one has failed; -1 if none
    has, or where it did is not known.
    """

    def __init__(self, kernel: Kernel, count: int, workers: int = 1) -> None:
        self.kernel, self.count = kernel, count
        self.scratch = room(max(1, scratch_rows(kernel)), padded(count))
        end = -(-count // kernel.lanes) * kernel.lanes
        # copies between guard words are each thread's own
        threads = 1 if guard_words.ON else max(1, min(workers, count // SHARE))
        share = -(-count // (TOGETHER * threads)) * TOGETHER
        self.shares = [(i, min(i + share, end)) for i in range(0, end, share)]
        self._notes = np.full((len(self.shares), 1), -1)

    @property
    def notes(self) -> int:
        """Where the first site has failed."""
        found = self._notes[self._notes >= 0]
        return int(found.min()) if len(found) else -1

    def __call__(self, *args: Any) -> None:
        """One call, on these arguments."""
        laid_out: Any = self.kernel.on(*args)
        numbers, integers, arrays, _ = laid_out.args
        self.run(numbers, integers, arrays)

    def run(self, numbers: bytes, integers: Sequence[int], arrays: Sequence[Any]) -> None:
        """One call, on arguments that are laid out already."""
        self._notes[:] = -1
        crew = np.zeros(WORDS, dtype=np.int64)
        crew[0], crew[-1] = len(self.shares), len(self.scratch)
        works = [
            functools.partial(
                self.kernel.run, numbers, integers, [*arrays, self.scratch, notes, crew], 1, *share
            )
            for share, notes in zip(self.shares, self._notes, strict=True)
        ]
        if len(works) == 1:
            works[0]()
            return
        pool, one_crew = _pool(len(works), os.getpid())
        with one_crew:
            interrupts.in_threads(works, pool)


SHARE = 2**14
"""Sites that are worth a thread: some 20 us of a pass, where threads wait for each other for one or two."""

WORDS = 8
"""Integers that threads share at their barriers; the last one says how many rows of scratch memory
there are.
"""


@functools.cache
def _pool(threads: int, process: int) -> tuple[Any, threading.Lock]:
    """Threads that stay, for one crew at a time: each of several might have some of them and wait for
    more.  A forked process has none of its parent's.
    """
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads - 1, "liemech sites"), threading.Lock()


def scratch_rows(kernel: Kernel) -> int:
    """The rows of scratch memory that a kernel needs, which it tells when it is called for no body."""
    block = ctypes.create_string_buffer(struct.pack("q", 0), 2**16)
    kernel.call(ctypes.cast(block, ctypes.c_char_p))
    rows: int = struct.unpack_from("q", block)[0]
    return rows
