"""No search for garbage while a kernel is translated: nothing that a translation makes can go
before its end, and the search takes a tenth of its time.
"""

from __future__ import annotations

import contextlib
import gc
import os
import threading
from collections.abc import Iterator

_lock = threading.Lock()
_inside = 0
"""Translations under way, in all threads."""

_before = gc.get_threshold()
"""The thresholds that the first of them found."""


@contextlib.contextmanager
def gc_paused() -> Iterator[None]:
    """The first to enter takes away the threshold, the last to leave puts it back.  A threshold
    that somebody else has set meanwhile stays, and so does what `gc.disable` and `gc.enable` say.
    """
    global _inside, _before
    with _lock:
        if not _inside:
            _before = gc.get_threshold()
            gc.set_threshold(0)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if not _inside:
                _restore()


def _restore() -> None:
    if gc.get_threshold()[0] == 0:
        gc.set_threshold(*_before)


def _after_fork() -> None:
    """The threads that were translating are not in the child."""
    global _inside, _lock
    if _inside:
        _restore()
    _inside, _lock = 0, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
