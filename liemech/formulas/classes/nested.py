"""The inside of values: their parts, and the records of a kind among these."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from ..numbers.pairs import PAIRS, paired
from ..tables import Table
from ..vectors import Mat, Vec
from .records import Record, fields_of, fill, names_of


def parts_of(value: Any) -> Any:
    """The items of a vector, a tuple, a list, the rows of a matrix, the fields of a record, the two numbers of a pair."""
    if isinstance(value, (tuple, list)):
        return value
    if isinstance(value, Mat):
        return value.rows
    if isinstance(value, Record):
        return fields_of(value).values()
    return value.parts if isinstance(value, PAIRS) else [value.place]


def of_parts(value: Any, parts: list[Any]) -> Any:
    """A value of the kind of another, with other parts; a record is filled in unchecked."""
    cls: Any = type(value)
    if isinstance(value, (Vec, Mat)):
        return cls(*parts)
    if isinstance(value, Record):
        return fill(cls, dict(zip(names_of(cls), parts, strict=True)))
    if isinstance(value, PAIRS):
        return paired(value.form, parts)
    return Table.at(*parts) if cls is Table else cls(parts)


def records_in(value: Any, kind: type) -> list[Any]:
    """The records of a kind that a value holds, in order."""
    if isinstance(value, kind):
        return [value]
    if isinstance(value, Record):
        return [x for part in fields_of(value).values() for x in records_in(part, kind)]
    if type(value) in (tuple, list):
        return [x for part in value for x in records_in(part, kind)]
    return []


def with_records(
    value: Any, kind: type, others: Iterable[Any], on_exchange: Callable[[Any, Any], None] | None = None
) -> Any:
    """The value with the records of a kind, those of `records_in`, replaced by others, in order.  Attributes beside the
    fields of a record are copied unless they hold a record of the kind.

    on_exchange : called with every new record and the one that it replaces.
    """
    replacements = iter(others)

    def changed(x: Any) -> Any:
        if isinstance(x, kind):
            return next(replacements)
        if not records_in(x, kind):
            return x
        if not isinstance(x, Record):
            return type(x)([changed(part) for part in x])
        fields = fields_of(x)
        beside = {n: y for n, y in vars(x).items() if n not in fields and not records_in(y, kind)}
        record = fill(type(x), beside | {n: changed(part) for n, part in fields.items()})
        if on_exchange is not None:
            on_exchange(record, x)
        return record

    return changed(value)
