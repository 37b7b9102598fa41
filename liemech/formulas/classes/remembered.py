"""Facts about objects, kept beside them while they live: nothing is written into a frozen record."""

from __future__ import annotations

import functools
import weakref
from typing import Any

from .exact_keys import exact_key
from .records import Record, fields_of


class shared_property(functools.cached_property[Any]):
    """A cached property, a record, of which there is one object for all owners that compute equal ones.

    Of T*G, say, all systems on G then have one object, and native code that was prepared for one system
    finds in the next the object that it has read.  A record with attributes beside its fields is not shared.
    """

    def __get__(self, owner: Any, cls: type | None = None) -> Any:  # type: ignore[override]
        computed = super().__get__(owner, cls)
        if owner is not None and _is_its_fields(computed):
            computed = vars(owner)[self.attrname] = _in_use.setdefault(exact_key(computed), computed)
        return computed


_in_use: weakref.WeakValueDictionary[Any, Any] = weakref.WeakValueDictionary()


def _is_its_fields(value: Any) -> bool:
    """Whether the fields of a value say all about it."""
    if isinstance(value, Record):
        cls, fields = type(value), fields_of(value)
        beside = [getattr(cls, name, None) for name in vars(value) if name not in fields]
        cached = all(isinstance(x, functools.cached_property) for x in beside)
        return cached and all(map(_is_its_fields, fields.values()))
    if type(value) is tuple:
        return all(map(_is_its_fields, value))
    return type(value) in (bool, int, float, str, type(None))


class Remembered:
    """Values by the identity of objects, which need no hash.  An object that is gone takes its value along."""

    __slots__ = ("_entries",)

    def __init__(self) -> None:
        self._entries: dict[int, tuple[weakref.ref[Any], Any]] = {}

    def get(self, owner: Any) -> Any:
        """The value remembered for this object; None if there is none."""
        entry = self._entries.get(id(owner))
        return entry[1] if entry is not None and entry[0]() is owner else None

    def set(self, owner: Any, value: Any) -> None:
        """Remember a value for as long as its owner lives."""
        key, entries = id(owner), self._entries
        entries[key] = weakref.ref(owner, lambda _: entries.pop(key, None)), value
