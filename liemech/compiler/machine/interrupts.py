"""Ctrl-C while native code runs: a loop that may never end asks, from time to time, whether a signal
has come or nobody waits for its thread any more.

Python handles signals, in its main thread.  What a handler raises is held until native code has come
back, and raised then.  No Python code runs between native code and these checks: a signal that came
in it would raise where ctypes only prints.
"""

from __future__ import annotations

import ctypes
import functools
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any

THREAD = f"i{8 * ctypes.sizeof(ctypes.c_ulong)}"
"""LLVM's type for the identity of a thread."""

_raised = (ctypes.c_void_p * 4)()
"""The error that is held: type, value and traceback, as Python's C functions have them, and the thread that
raises it.
"""

_stopped: set[int] = set()
"""Threads whose work nobody waits for."""

_count = (ctypes.c_int64 * 1)()
"""The number of threads in `_stopped`."""

_lock = threading.Lock()

_working: dict[int, threading.Event] = {}
"""For each working thread the event that is set when nobody waits for it any more."""

_is_stopped = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_ulong)(_stopped.__contains__)

pending = _raised, _count
"""The last word of the first, and the second, are zero as long as there is nothing to stop for."""


@functools.cache
def addresses() -> dict[str, int]:
    """The addresses, by name, of what native code needs to ask Python."""
    python = ctypes.pythonapi
    functions = {
        "liemech_ensure": python.PyGILState_Ensure,
        "liemech_release": python.PyGILState_Release,
        "liemech_signals": python.PyErr_CheckSignals,
        "liemech_fetch": python.PyErr_Fetch,
        "liemech_thread": python.PyThread_get_thread_ident,
        "liemech_is_stopped": _is_stopped,
    }
    pointers = {name: ctypes.cast(f, ctypes.c_void_p).value or 0 for name, f in functions.items()}
    return pointers | {"liemech_raised": ctypes.addressof(_raised), "liemech_stopped": ctypes.addressof(_count)}


def stop_if_asked() -> None:
    """Raise the error that is held for this thread, or KeyboardInterrupt if nobody waits for it."""
    me = threading.get_ident()
    if _raised[3] == me:
        restore = ctypes.pythonapi.PyErr_Restore
        restore.argtypes, restore.restype = [ctypes.c_void_p] * 3, None
        held = _raised[0], _raised[1], _raised[2]
        _raised[:] = [None] * 4
        restore(*held)  # ctypes raises what is set
    if me in _stopped:
        raise KeyboardInterrupt


def working_for(event: threading.Event, work: Callable[..., Any], *args: Any) -> Any:
    """Do some work in a thread; who waits for it gives up by setting the event."""
    me = threading.get_ident()
    before = _working.get(me)
    _works_for(me, event)
    try:
        return work(*args)
    finally:
        _works_for(me, before)


def _works_for(thread: int, event: threading.Event | None) -> None:
    """Note the event that a thread works for; None if it works for nobody else."""
    with _lock:
        if event is None:
            _working.pop(thread, None)
        else:
            _working[thread] = event
        (_stopped.add if event is not None and event.is_set() else _stopped.discard)(thread)
        _count[0] = len(_stopped)


def give_up(event: threading.Event) -> None:
    """Let the threads that work for this event stop as soon as they can."""
    with _lock:
        event.set()
        _stopped.update(thread for thread, awaited in _working.items() if awaited is event)
        _count[0] = len(_stopped)


def _after_fork() -> None:
    """Forget, in the child of a fork, the threads that are not there and the errors held for them."""
    global _lock
    _lock = threading.Lock()
    me = threading.get_ident()
    for thread in [t for t in _working if t != me]:
        _works_for(thread, None)
    if _raised[3] != me:
        _raised[:] = [None] * 4


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def in_threads(works: Sequence[Callable[[], Any]], pool: Any) -> None:
    """Do the first work in this thread and the others in those of a pool; an error here stops the others."""
    event, others = threading.Event(), []
    try:
        for work in works[1:]:
            others.append(pool.submit(working_for, event, work))
        works[0]()
        for other in others:
            other.result()
    except BaseException:
        from concurrent import futures

        give_up(event)
        futures.wait(others)
        raise
