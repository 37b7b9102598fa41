"""Ctrl-C while native code runs: a loop that may never end asks, from time to time, whether a signal
has come or whoever waits for it has given up.

Signals are handled by Python, in its main thread.  What a handler raises is kept until native code
has come back, and raised then.
"""

from __future__ import annotations

import ctypes
import functools
import threading
from collections.abc import Callable, Sequence
from concurrent import futures
from typing import Any

_raised = (ctypes.c_void_p * 3)()
"""What a handler raised: type, value and traceback, as Python's C functions have them."""

_given_up = (ctypes.c_int64 * 1)()
"""1 from the first time on that somebody gave up waiting for threads."""

_here = threading.local()
"""For whom a thread works: an event that is set when nobody waits for it any more."""

come = _raised, _given_up
"""Their first words are zero as long as there was nothing to stop for."""


@functools.cache
def addresses() -> dict[str, int]:
    """Where native code finds what `look` needs."""
    python = ctypes.pythonapi
    functions = {
        "liemech_ensure": python.PyGILState_Ensure,
        "liemech_release": python.PyGILState_Release,
        "liemech_signals": python.PyErr_CheckSignals,
        "liemech_fetch": python.PyErr_Fetch,
        "liemech_asked": _asked,
    }
    found = {name: ctypes.cast(f, ctypes.c_void_p).value or 0 for name, f in functions.items()}
    return found | {
        "liemech_raised": ctypes.addressof(_raised),
        "liemech_given_up": ctypes.addressof(_given_up),
    }


@ctypes.CFUNCTYPE(ctypes.c_int)
def _asked() -> int:
    """Is native code of this thread to stop?"""
    return int(bool(_raised[0] and _is_main()) or _is_given_up())


def _is_main() -> bool:
    return threading.get_ident() == threading.main_thread().ident


def _is_given_up() -> bool:
    event: Any = getattr(_here, "event", None)
    return event is not None and event.is_set()


def stop_if_asked() -> None:
    """Raise what a handler of a signal has raised while native code ran, in the main thread; in one
    for which nobody waits KeyboardInterrupt.
    """
    if _raised[0] and _is_main():
        restore = ctypes.pythonapi.PyErr_Restore
        restore.argtypes, restore.restype = [ctypes.c_void_p] * 3, None
        held = _raised[0], _raised[1], _raised[2]
        _raised[0] = _raised[1] = _raised[2] = None
        restore(*held)  # ctypes raises what is set
    if _is_given_up():
        raise KeyboardInterrupt


def working_for(event: threading.Event, work: Callable[..., Any], *args: Any) -> Any:
    """The work of a thread for somebody who gives up waiting by setting this event."""
    before, _here.event = getattr(_here, "event", None), event
    try:
        return work(*args)
    finally:
        _here.event = before


def give_up(event: threading.Event) -> None:
    """Let the threads that work for this event stop as soon as they can."""
    event.set()
    _given_up[0] = 1


def in_threads(works: Sequence[Callable[[], Any]], pool: Any) -> None:
    """The first of these in this thread, the others in those of a pool.  What ends it here ends it
    there.
    """
    event, others = threading.Event(), []
    try:
        for work in works[1:]:
            others.append(pool.submit(working_for, event, work))
        works[0]()
        for other in others:
            other.result()
    except BaseException:
        give_up(event)
        futures.wait(others)
        raise
