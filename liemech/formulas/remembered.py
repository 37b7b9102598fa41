"""What is known about objects while they live, kept beside them: nothing is written into a frozen
record.
"""

from __future__ import annotations

import weakref
from typing import Any


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
