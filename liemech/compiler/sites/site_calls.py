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

from ...formulas.sites import TOGETHER, padded, room
from ..kernel import Kernel
from ..machine import guard_words, interrupts


class SiteCalls:
    """A kernel for the sites of one system, on the threads that share them; one call at a time, since calls share the
    scratch memory, in which none reads what another has written.

    count : the number of sites.  workers : the number of threads, of whole groups of sixteen sites; one, where a formula
    runs once for all of them.
    """

    def __init__(self, kernel: Kernel, count: int, workers: int = 1) -> None:
        self.kernel, self.count = kernel, count
        rows, pairs, alone = needs(kernel)
        self.scratch = room(max(1, rows), padded(count))
        end = -(-count // kernel.lanes) * kernel.lanes
        # copies between guard words are each thread's own
        worth = max(count // SHARE, pairs * count**2 // PAIRS)
        threads = 1 if guard_words.ON or alone else max(1, min(workers, worth))
        self.shares = shares(count, end, threads)
        self._notes = np.full((len(self.shares), 1), -1)

    @property
    def notes(self) -> int:
        """The number of the first site of the lanes in which one failed in the last call; -1 if none did, or it is
        unknown.
        """
        failed = self._notes[self._notes >= 0]
        return int(failed.min()) if len(failed) else -1

    def overflowed(self) -> int | None:
        """The first site that has a number in scratch memory that is not finite, or None.  Clears the memory."""
        bad = ~np.isfinite(self.scratch[:, : self.count]).all(axis=0)
        self.scratch[:] = 0.0
        return int(np.argmax(bad)) if bad.any() else None

    def __call__(self, *args: Any) -> None:
        """Call the kernel once on these arguments, on all threads."""
        laid_out: Any = self.kernel.on(*args)
        numbers, integers, arrays, _ = laid_out.args
        self.run(numbers, integers, arrays)

    def run(self, numbers: bytes, integers: Sequence[int], arrays: Sequence[Any]) -> None:
        """Call the kernel once, on arguments in its layout, on all threads."""
        self._notes[:] = -1
        crew = np.zeros(WORDS, dtype=np.int64)
        crew[0], crew[7] = len(self.shares), len(self.scratch)
        works = [
            functools.partial(self.kernel.run, numbers, integers, [*arrays, self.scratch, notes, crew], 1, *share)
            for share, notes in zip(self.shares, self._notes, strict=True)
        ]
        if len(works) == 1:
            works[0]()
            return
        pool, one_crew = _pool(len(works), os.getpid())
        with one_crew:
            interrupts.in_threads(works, pool)


def shares(count: int, end: int, threads: int) -> list[tuple[int, int]]:
    """The ranges of sites of threads: whole groups of sixteen, as many for each thread but for one.  end : of the last
    lanes.
    """
    groups = -(-count // TOGETHER)
    threads = min(threads, groups)
    bounds = [TOGETHER * (groups * k // threads) for k in range(threads)]
    return [*zip(bounds, [*bounds[1:], end])]


SHARE = 2**14
"""Sites that are worth a thread: some 20 us of a pass, where threads wait for each other for one or two."""

PAIRS = 2**18
"""Pairs of sites that are worth a thread, where all of them meet; many barriers divide them."""

WORDS = 9
"""Integers that threads share at their barriers; the eighth one says how many rows of scratch memory there are."""


@functools.cache
def _pool(threads: int, process: int) -> tuple[Any, threading.Lock]:
    """A pool of threads and its lock: of two crews at once each might wait for threads of the other.  A forked process
    has none of its parent's threads.
    """
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads - 1, "liemech sites"), threading.Lock()


def needs(kernel: Kernel) -> tuple[int, bool, bool]:
    """The number of rows of scratch memory that a kernel needs, whether all pairs of sites meet, and whether it is for one
    thread, as formulas are that run once for all sites; a call for no body returns them.
    """
    block = ctypes.create_string_buffer(struct.pack("q", 0), 2**16)
    kernel.call(ctypes.cast(block, ctypes.c_char_p))
    rows, pairs, alone = struct.unpack_from("qqq", block)
    return rows, bool(pairs), bool(alone)
