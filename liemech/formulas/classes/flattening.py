"""Values as the numbers that they are made of, in a row, and values made of such numbers."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator
from typing import Any

from ..large import Large, from_numbers
from ..numbers.dual import Dual
from ..numbers.pairs import paired
from ..tables import Table
from ..vectors import Mat, Vec
from .layouts import SINGLE, Layout
from .records import fill


def leaves(value: Any, layout: Layout) -> list[Any]:
    """The numbers of a value, in order."""
    numbers: list[Any] = []
    _gather(value, layout, numbers)
    return numbers


def _gather(value: Any, layout: Layout, numbers: list[Any]) -> None:
    """Append the numbers of a value."""
    if layout.kind in SINGLE:
        numbers.append(value)
    elif layout.kind in ("table", "place"):
        numbers.append(value.place)
    elif layout.kind == "large":
        numbers.extend(value.flat)
    elif layout.kind == "record":
        for name, part in zip(layout.detail[1], layout.parts, strict=True):
            if part.width:
                _gather(getattr(value, name), part, numbers)
    elif layout.only_numbers and layout.kind != "pair":
        numbers.extend(value)
    elif layout.width:
        for item, part in zip(value.parts if layout.kind == "pair" else value, layout.parts, strict=True):
            _gather(item, part, numbers)


def floats_in(value: Any, layout: Layout) -> Vec:
    """The real numbers of a value, in order, without integers and places of tables."""
    return Vec(*[x for x, kind in zip(leaves(value, layout), layout.kinds, strict=True) if kind == "number"])


def with_floats(value: Any, layout: Layout, numbers: Any) -> Any:
    """The value with other real numbers, those of `floats_in`."""
    new = iter(numbers)
    old = zip(leaves(value, layout), layout.kinds, strict=True)
    return build(layout, iter([next(new) if kind == "number" else x for x, kind in old]))


@functools.lru_cache(256)
def gatherer(layout: Layout) -> Callable[[Any], list[Any]]:
    """`leaves` of values that are known to have this layout: a list written out, such as [*x.mu, *x.g.rows[0], ...]."""
    return eval(f"lambda x: [{', '.join(_places(layout, 'x'))}]", {})


def _places(layout: Layout, value: str) -> Iterator[str]:
    """Expressions, as texts, for the numbers of a value."""
    if layout.kind in SINGLE:
        yield value
    elif layout.kind == "table":
        yield f"{value}.place"
    elif layout.kind == "large":
        yield f"*{value}.flat"
    elif layout.only_numbers and layout.kind in ("vec", "tuple", "list"):
        yield f"*{value}"
    elif layout.width:
        names = layout.detail[1] if layout.kind == "record" else range(len(layout.parts))
        inside = {"record": ".{}", "mat": ".rows[{}]", "pair": ".parts[{}]"}.get(layout.kind, "[{}]")
        for name, part in zip(names, layout.parts, strict=True):
            if part.width:
                yield from _places(part, value + inside.format(name))


def build(layout: Layout, numbers: Iterator[Any]) -> Any:
    """The value of this layout with the given numbers; records are filled in without running their checks."""
    if layout.kind in SINGLE:
        return next(numbers)
    if layout.kind == "static":
        return layout.detail
    if layout.kind == "table":
        place = next(numbers)
        return Table.at(place.value if isinstance(place, Dual) else place)
    if layout.kind == "place":
        return Large.at(next(numbers), layout.detail)
    if layout.kind == "large":
        return from_numbers(layout.detail, list(itertools.islice(numbers, layout.width)))
    parts = [build(part, numbers) for part in layout.parts]
    if layout.kind == "pair":
        return paired(layout.detail, parts)
    if layout.kind == "record":
        cls, names = layout.detail
        return fill(cls, dict(zip(names, parts, strict=True)))
    if layout.kind in ("vec", "mat"):
        return Vec(*parts) if layout.kind == "vec" else Mat(*parts)
    return tuple(parts) if layout.kind == "tuple" else parts
