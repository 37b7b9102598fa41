"""Layouts: how a value made of numbers (a float, a `Vec`, a `Mat`, a record, a tuple of these) lies
flat in memory; the numbers of a value in a row, and values made of such numbers.

The layout of an argument decides which native code is used: two arguments of one layout share it.
A part that is no number at run time (an int, a string, a tableau, None) belongs to the layout
itself.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator
from typing import Any

from ..large import Large, from_numbers, size_of
from ..numbers.bases import StandIn, is_any_number, is_number
from ..numbers.compensated import Compensated
from ..numbers.double_double import DoubleDouble
from ..numbers.dual import Dual
from ..numbers.pairs import PAIRS, paired
from ..tables import Table
from ..vectors import Mat, Vec
from .exact_keys import COMPARABLE, exact_key
from .frozen import frozen
from .records import Record, fill, names_of


@frozen
class Layout:
    """The structure of a value."""

    # number, integer, truth, pair, vec, mat, tuple, list, record, table, large (numbers in memory), place (of such
    # numbers, which is all that native code has) or static (a constant). Integers and truth values are static, too, but
    # for those that a method carries along.
    kind: str
    parts: tuple[Layout, ...] = ()  # the layouts of entries, items or fields
    # the form of a pair or of what is large, the class and field names of a record, a constant itself
    detail: Any = None

    @functools.cached_property
    def width(self) -> int:
        """The number of numbers in the value."""
        if self.kind == "large":
            return size_of(self.detail)
        return 1 if self.kind in _ONE else sum(part.width for part in self.parts)

    @functools.cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of its numbers, in order: number, integer, truth or table."""
        if self.kind in _ONE:
            return (self.kind,)
        if self.kind == "large":
            return ("number",) * self.width
        return tuple([kind for part in self.parts for kind in part.kinds])

    @functools.cached_property
    def has_integers(self) -> bool:
        """Whether there are integers or truth values among the numbers."""
        return not {"integer", "truth"}.isdisjoint(self.kinds)

    @functools.cached_property
    def only_numbers(self) -> bool:
        """Whether there are parts, and all of them are numbers."""
        return bool(self.parts) and all(part.kind == "number" for part in self.parts)

    @functools.cached_property
    def remembers(self) -> bool:
        """Whether there are numbers that carry a rest or a derivative along."""
        inside = any(part.remembers for part in self.parts)
        return inside or (self.kind == "pair" and self.detail[0] in (Compensated, DoubleDouble, Dual))

    @functools.cached_property
    def levels(self) -> tuple[float, ...]:
        """The levels of the derivatives that its numbers carry along."""
        direct = (self.detail[1],) if self.kind == "pair" and self.detail[0] is Dual else ()
        return direct + tuple([level for part in self.parts for level in part.levels])

    @functools.cached_property
    def directions(self) -> int:
        """The largest number of directions along which its numbers carry derivatives."""
        direct = self.parts[1].width if self.kind == "pair" and self.detail[0] is Dual else 0
        return max([direct, *[part.directions for part in self.parts]])

    @functools.cached_property
    def has_double_doubles(self) -> bool:
        """Whether there are numbers of two doubles."""
        return (self.kind == "pair" and self.detail[0] is DoubleDouble) or any(
            part.has_double_doubles for part in self.parts
        )

    @functools.cached_property
    def in_memory(self) -> bool:
        """Whether a part of the value is too large to be written out."""
        return self.kind == "large" or any(part.in_memory for part in self.parts)

    @functools.cached_property
    def _identity(self) -> Any:
        """The detail as layouts are compared: for a static part by type and value, to the bit."""
        return exact_key(self.detail) if self.kind == "static" else self.detail

    @functools.cached_property
    def _hash(self) -> int:
        return hash((self.kind, self.parts, self._identity))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, Layout) or (self.kind, self.parts) != (other.kind, other.parts):
            return False
        return self.detail is other.detail or self._identity == other._identity

    def __repr__(self) -> str:
        inside = ", ".join(map(repr, self.parts))
        if self.kind == "record":
            cls, names = self.detail
            fields = ", ".join(f"{n}={p!r}" for n, p in zip(names, self.parts, strict=True))
            return f"{cls.__module__}.{cls.__qualname__}({fields})"
        if self.kind == "pair":
            cls, *options = self.detail
            return f"{cls.__name__}({', '.join([inside, *map(str, options)])})"
        if self.kind == "static":
            return repr(self.detail)
        if self.kind in ("large", "place"):
            return f"{self.kind}({self.detail})"
        return f"{self.kind}({inside})" if inside else self.kind


NUMBER, INTEGER, TRUTH, TABLE = map(Layout, ("number", "integer", "truth", "table"))
SINGLE = "number", "integer", "truth"
_ONE = *SINGLE, "table", "place"
_FLOAT = frozenset([float])

COMPARABLE.add(Layout)


def layout_of(value: Any, number: Callable[[Any], bool] = is_number) -> Layout:
    """The layout of a value; tuples that hold no vector, matrix or record are static, like the rows of a tableau."""
    if isinstance(value, Record):
        if number is not is_number:
            return _of_record(value, number)
        try:
            return _known(value)
        except AttributeError:
            layout = _of_record(value, number)
            # a record never changes: a method is looked at once, not at every run
            _know(value, layout)
            return layout
    if number(value):
        return NUMBER if number is not _changing else _of_number(value)
    if isinstance(value, Vec):
        if _FLOAT.issuperset(map(type, value)) or all(map(is_any_number, value)):
            return vector_layout(len(value))
        return _one_layout("vec", tuple([layout_of(x, number) for x in value]))
    if isinstance(value, Large):
        of_place = number is is_any_number and value.numbers is None
        if of_place or number is not is_any_number:
            return _one_layout("place" if of_place else "large", (), value.form)
    if isinstance(value, Mat):
        return _one_layout("mat", tuple([layout_of(row, number) for row in value.rows]))
    if isinstance(value, PAIRS):
        return _one_layout("pair", tuple([layout_of(x, number) for x in value.parts]), value.form)
    # else a constant of native code
    if isinstance(value, Table) and (number is not is_any_number or value.content is None):
        return TABLE
    if isinstance(value, list) or (isinstance(value, tuple) and (number is not is_number or not is_static(value))):
        whole = _one_layout(type(value).__name__, tuple([layout_of(x, number) for x in value]))
        if whole.width or number is not _changing or not is_static(value):
            return whole
    return Layout("static", (), value)


def carried_layout(value: Any) -> Layout:
    """The layout of what a method carries along from step to step, in which integers, truth values
    and tuples of numbers are numbers too: they may change.  Entries of vectors are floats.
    """
    return layout_of(value, _changing)


def _changing(value: Any) -> bool:
    return is_any_number(value)


def _of_number(value: Any) -> Layout:
    """A float, an integer or a truth value, as Python has it."""
    if isinstance(value, StandIn):
        return TRUTH if value.is_truth else INTEGER if value.is_integer else NUMBER
    return TRUTH if isinstance(value, bool) else INTEGER if isinstance(value, int) else NUMBER


def fits(actual: Layout, layout: Layout) -> bool:
    """Whether a value of the layout `actual` can be written where `layout` is: they are equal, but for integers in place
    of floats.
    """
    if actual is layout or actual == layout:
        return True
    if layout.kind == "number":
        return actual.kind in ("integer", "truth")
    return (
        (actual.kind, len(actual.parts)) == (layout.kind, len(layout.parts))
        and layout.kind != "static"
        and actual.detail == layout.detail
        and all(map(fits, actual.parts, layout.parts))
    )


def difference(actual: Layout, layout: Layout, name: str) -> str:
    """The first part in which a value does not fit a layout, in words."""
    record = layout.kind == "record"
    if actual.kind == layout.kind and actual.detail == layout.detail and layout.kind != "static":
        if len(actual.parts) != len(layout.parts) and layout.kind in ("tuple", "list"):
            return f"{name} had {len(layout.parts)} parts and has {len(actual.parts)}"
        names = layout.detail[1] if record else [f"[{i}]" for i in range(len(layout.parts))]
        for part, old, new in zip(names, layout.parts, actual.parts, strict=False):
            if not fits(new, old):
                return difference(new, old, f"{name}.{part}" if record else f"{name}{part}")
    return f"{name} was {_in_words(layout)} and becomes {_in_words(actual)}"


def _in_words(layout: Layout) -> str:
    words = {
        "number": "a float",
        "integer": "an int",
        "truth": "a bool",
        "vec": f"a vector of {len(layout.parts)}",
        "mat": f"a matrix of {len(layout.parts)} rows",
        "large": f"numbers in memory, {layout.detail}",
        "pair": "a number that carries more",
    }
    if layout.kind == "record":
        cls: Any = layout.detail[0]
        return f"a {cls.__name__}"
    return words.get(layout.kind, repr(layout))


_known, _know = Record._layout.__get__, Record._layout.__set__  # type: ignore[attr-defined]


def known_layout(value: Any) -> Layout | None:
    """The layout of a record that was looked at before; None for all else."""
    try:
        return _known(value)
    except (AttributeError, TypeError):
        return None


def _of_record(value: Any, number: Callable[[Any], bool]) -> Layout:
    cls: Any = type(value)
    names = names_of(cls)
    return _one_layout("record", tuple([layout_of(getattr(value, n), number) for n in names]), (cls, names))


_MANY = 2**14

_one_layout = functools.lru_cache(_MANY)(Layout)
"""Makes layouts: most of one structure are one object, so that comparing two of them takes no time."""


@functools.lru_cache(_MANY)
def vector_layout(n: int) -> Layout:
    """The layout of a vector of n floats."""
    return _one_layout("vec", (NUMBER,) * n)


def is_static(value: Any) -> bool:
    """Whether a value is a constant, or nested tuples of constants."""
    if isinstance(value, tuple) and not isinstance(value, Vec):
        return all(map(is_static, value))
    return not isinstance(value, (Vec, Mat, Record, Table, Large, StandIn, *PAIRS))


def restricted(value: Any, layout: Layout) -> Any:
    """The record with the parts that are static in a layout replaced by its constants."""
    if known_layout(value) == layout:
        return value
    parts = zip(layout.detail[1], layout.parts, strict=True)
    record = fill(type(value), {n: getattr(value, n) if part.kind != "static" else part.detail for n, part in parts})
    _know(record, layout)
    return record


def laid_out(value: Any, key: Any) -> Any:
    """The record, with its layout noted: records of one class and key have one layout."""
    layout = _layouts.get((type(value), key))
    if layout is None:
        _layouts[type(value), key] = layout_of(value)
    else:
        _know(value, layout)
    return value


_layouts: dict[Any, Layout] = {}


def vector(n: int) -> Layout:
    """The layout of a vector of n floats; native code asks for it."""
    return layout_of(Vec(*[0.0] * n))


def matrix(n: int, m: int) -> Layout:
    """The layout of a matrix of n rows and m columns; native code asks for it."""
    return layout_of(Mat(*[Vec(*[0.0] * m)] * n))


# ------------------------------------------------------------------ values as their numbers


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
