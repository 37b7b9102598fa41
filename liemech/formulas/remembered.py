"""What is known about objects while they live, kept beside them: nothing is written into a frozen
record.
"""

from __future__ import annotations

import weakref
from typing import Any, TypeVar

from .pytree import exact
from .records import Record

R = TypeVar("R", bound=Record)

_in_common: weakref.WeakValueDictionary[Any, Any] = weakref.WeakValueDictionary()


def common(record: R) -> R:
    """This record, or the one of its class with the same fields, bit for bit, that is in use.

    What systems make of their parts, such as T*G, they then have in common, and native code that was
    prepared for one finds in the next the object that it has read.
    """
    found: R = _in_common.setdefault(exact(record), record)
    return found


class Remembered:
    """Values by the identity of objects, which need no hash.  An object that is gone takes its
    value along.
    """

    __slots__ = ("_entries",)

    def __init__(self) -> None:
        self._entries: dict[int, tuple[weakref.ref[Any], Any]] = {}

    def get(self, owner: Any) -> Any:
        """What is remembered of this object; None if nothing is."""
        entry = self._entries.get(id(owner))
        return entry[1] if entry is not None and entry[0]() is owner else None

    def set(self, owner: Any, value: Any) -> None:
        """Remember a value."""
        key, entries = id(owner), self._entries
        entries[key] = weakref.ref(owner, lambda _: entries.pop(key, None)), value
