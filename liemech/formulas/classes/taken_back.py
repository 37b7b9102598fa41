"""A journal of values that were kept when they were first wanted: they must go when the compiler
takes back the code that it has emitted since, or leaves the branch that holds it.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator

_here = threading.local()


def noted(undo: Callable[[], object]) -> None:
    """Note how to take away again what was just kept."""
    journal = getattr(_here, "journal", None)
    if journal is not None:
        journal.append(undo)


@contextlib.contextmanager
def journal() -> Iterator[None]:
    """A context that notes what a translation keeps, so that it can be taken back."""
    before, _here.journal = getattr(_here, "journal", None), []
    try:
        yield
    finally:
        _here.journal = before


def back() -> Callable[[], None]:
    """A function that takes away all that will have been kept from here on."""
    length = len(getattr(_here, "journal", None) or [])

    def undo() -> None:
        entries = getattr(_here, "journal", None) or []
        while len(entries) > length:
            entries.pop()()

    return undo
