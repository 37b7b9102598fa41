"""Progress of anything that takes longer than a second: a bar for a run, a line for a compilation."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

NOTICE = 1.0
"""Seconds after which a run or a compilation shows itself."""

LOOK = 0.1
"""Seconds between two looks at whether a run is still wanted."""


class Wanted(threading.local):
    """Whether anybody waits for the runs of this thread."""

    unless: str | None = (
        None  # a file that says, when it is there, that nobody does, as after Ctrl-C in another process
    )
    name: str | None = None  # the name of the run in its bar
    compiled: float = 0.0  # seconds of compiling so far


WANTED = Wanted()


class Bar:
    """A progress bar that appears when the run takes longer than a second and somebody looks: not
    in a log, unless it was asked for.

    unit : of what there are `total`; empty for parts of a time, whose number tells nothing.
    A run that is no longer wanted is ended as by Ctrl-C, where it tells of its progress.
    """

    def __init__(self, wanted: bool | None, total: int, unit: str = "step") -> None:
        self.wanted, self.total, self.done, self.begun = wanted, total, 0, time.perf_counter()
        self.unit = unit
        self.bar: Any = None
        self.unless, self.looked = WANTED.unless, self.begun

    def __enter__(self) -> Bar:
        return self

    def advance(self, steps: int) -> None:
        self.done += steps
        if self.unless is not None and time.perf_counter() - self.looked > LOOK:
            if os.path.exists(self.unless):
                raise KeyboardInterrupt
            self.looked = time.perf_counter()
        if self.bar is None and self.wanted is not False and self.done < self.total:
            if self.wanted or (time.perf_counter() - self.begun > NOTICE and watched()):
                from tqdm.auto import tqdm

                shape = None if self.unit else "{l_bar}{bar}| [{elapsed}<{remaining}]"
                self.bar = tqdm(desc=WANTED.name, total=self.total, unit=self.unit, unit_scale=True, bar_format=shape)
                self.bar.update(self.done)
        elif self.bar is not None:
            self.bar.update(steps)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()


def watched() -> bool:
    """Whether stderr is read as it is written: a terminal or a notebook."""
    return sys.stderr.isatty() or "ipykernel" in sys.modules


@contextmanager
def named(name: str) -> Iterator[None]:
    """Runs in this thread have a name, which their bars show."""
    before, WANTED.name = WANTED.name, name
    try:
        yield
    finally:
        WANTED.name = before


@contextmanager
def notice(wanted: bool | None, text: str) -> Iterator[None]:
    """A line for what takes longer than a second, as long as the terminal is wide."""
    shown, start = list[float](), time.perf_counter()

    def show() -> None:
        from shutil import get_terminal_size

        shown.append(time.perf_counter())
        room = get_terminal_size().columns - len(" ... 000.0 s")
        print(f"{text[:room]} ...", end="", file=sys.stderr, flush=True)

    timer = threading.Timer(NOTICE, show)
    timer.daemon = True
    if wanted is not False:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()
        WANTED.compiled += time.perf_counter() - start
        if shown:
            print(f" {NOTICE + time.perf_counter() - shown[0]:.1f} s", file=sys.stderr, flush=True)
