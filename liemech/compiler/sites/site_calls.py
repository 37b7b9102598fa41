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
    """Runs a kernel for the sites of one system, one call at a time: its scratch memory is used again by every
    call, none of which reads there what another has written.

    count : of sites.  workers : threads that share the sites, of whole groups of sixteen.
    notes : of the last call, the first of those side by side among which one has failed; -1 if none
    has, or where it did is not known.
    """

    def __init__(self, kernel: Kernel, count: int, workers: int = 1) -> None:
        self.kernel, self.count = kernel, count
        rows, pairs = needs(kernel)
        self.scratch = room(max(1, rows), padded(count))
        end = -(-count // kernel.lanes) * kernel.lanes
        # copies between guard words are each thread's own
        worth = max(count // SHARE, pairs * count**2 // PAIRS)
        threads = 1 if guard_words.ON else max(1, min(workers, worth))
        self.shares = shares(count, end, threads)
        self._notes = np.full((len(self.shares), 1), -1)

    @property
    def notes(self) -> int:
        """The first site that has failed; -1 if none has."""
        failed = self._notes[self._notes >= 0]
        return int(failed.min()) if len(failed) else -1

    def overflowed(self) -> int | None:
        """The first site of which a number that the last call worked with is not finite; it is forgotten."""
        bad = ~np.isfinite(self.scratch[:, : self.count]).all(axis=0)
        self.scratch[:] = 0.0
        return int(np.argmax(bad)) if bad.any() else None

    def __call__(self, *args: Any) -> None:
        """Call the kernel once on these arguments, on all threads."""
        laid_out: Any = self.kernel.on(*args)
        numbers, integers, arrays, _ = laid_out.args
        self.run(numbers, integers, arrays)

    def run(self, numbers: bytes, integers: Sequence[int], arrays: Sequence[Any]) -> None:
        """Call the kernel once, on arguments that are laid out already, on all threads."""
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
    """The first site of every thread and the one behind its last: whole groups of sixteen, of which none has more than
    one group more than another.  end : of the last group of lanes.
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
    """Threads that stay, for one crew at a time: each of several might have some of them and wait for
    more.  A forked process has none of its parent's.
    """
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads - 1, "liemech sites"), threading.Lock()


def needs(kernel: Kernel) -> tuple[int, bool]:
    """The rows of scratch memory that a kernel needs, and whether all pairs of sites meet: it tells when
    it is called for no body.
    """
    block = ctypes.create_string_buffer(struct.pack("q", 0), 2**16)
    kernel.call(ctypes.cast(block, ctypes.c_char_p))
    rows, pairs = struct.unpack_from("qq", block)
    return rows, bool(pairs)
