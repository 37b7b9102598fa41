"""Long runs in safety: what there is so far, written to a file from time to time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

SHARE = 0.05
"""Part of the time of a run that writing may take."""


class Checkpoint:
    """Where and how often a run is written: every so many seconds, and less often if writing takes
    long.

    shown : of a run as it is made the one that is written.
    """

    def __init__(self, path: str | os.PathLike[str], seconds: float) -> None:
        self.path, self.seconds = path, seconds
        self.shown: Callable[[Any], Any] = lambda run: run
        self.next = time.perf_counter() + seconds

    def due(self) -> bool:
        """Is it time?"""
        return time.perf_counter() >= self.next

    def save(self, run: Any) -> None:
        """Write the run as far as it came."""
        begun = time.perf_counter()
        self.shown(run).save(self.path)
        ended = time.perf_counter()
        self.next = ended + max(self.seconds, (ended - begun) / SHARE)
