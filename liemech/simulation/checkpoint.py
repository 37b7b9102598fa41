"""Long runs in safety: what there is so far, written to a file from time to time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

SHARE = 0.05
"""Part of the time of a run that writing may take, unless it was said after how many steps."""


class Checkpoint:
    """Where and how often a run is written: every so many seconds, and less often if writing takes
    long, or every so many steps.

    steps : None for seconds.  shown : of a run as it is made the one that is written.
    """

    def __init__(
        self, path: str | os.PathLike[str], seconds: float, steps: int | None = None
    ) -> None:
        self.path, self.seconds, self.steps = path, seconds, steps
        self.shown: Callable[[Any], Any] = lambda run: run
        self.next, self.taken = time.perf_counter() + seconds, 0

    def within(self, steps: int) -> int:
        """So many steps, or those that are left until it is written."""
        return steps if self.steps is None else min(steps, self.steps - self.taken)

    def due(self, steps: int = 0) -> bool:
        """Is it time, now that so many steps more were taken?"""
        if self.steps is None:
            return time.perf_counter() >= self.next
        self.taken += steps
        return self.taken >= self.steps

    def save(self, run: Any) -> None:
        """Write the run as far as it came."""
        begun, self.taken = time.perf_counter(), 0
        self.shown(run).save(self.path)
        ended = time.perf_counter()
        self.next = ended + max(self.seconds, (ended - begun) / SHARE)
