"""Layouts: how a value made of numbers (a float, a `Vec`, a `Mat`, a record, a tuple of these) lies
flat in memory.

The layout of an argument decides which native code is used: two arguments of one layout share it.
A part that is no number at run time (an int, a string, a tableau, None) belongs to the layout
itself.
"""

from __future__ import annotations

import enum
import functools
import itertools
import struct
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from ..large import Large, from_numbers, size_of
from ..numbers.bases import StandIn
from ..numbers.compensated import Compensated, value_of
from ..numbers.complex_numbers import Complex
from ..numbers.double_double import DoubleDouble, rounded_number
from ..numbers.dual import ALONE, Dual, at_rest
from ..tables import Table
from ..vectors import Mat, Vec
from .fields import FrozenDict
from .frozen import frozen
from .records import Record
from .records import names_of as names_of

PAIRS = (Complex, Dual, Compensated, DoubleDouble)
"""Numbers made of two."""

_COMPENSATED, _DOUBLE_DOUBLE = (Compensated,), (DoubleDouble,)  # the forms of such numbers


@frozen
class Layout:
    """The structure of a value.

    kind : number, integer, truth, pair, vec, mat, tuple, list, record, table, large (numbers in memory), place (of such
    numbers, which is all that native code has) or static (a constant).  Integers and truth values are static, too, but
    for those that a method carries along.
    """

    kind: str
    parts: tuple[Layout, ...] = ()
    # the form of a pair or of what is large, the class and field names of a record, the object of a
    # static part
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
    def exact(self) -> bool:
        """Whether there are integers or truth values among the numbers."""
        return not {"integer", "truth"}.isdisjoint(self.kinds)

    @functools.cached_property
    def plain(self) -> bool:
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
    def long(self) -> bool:
        """Whether there are numbers of two doubles."""
        return (self.kind == "pair" and self.detail[0] is DoubleDouble) or any(part.long for part in self.parts)

    @functools.cached_property
    def in_memory(self) -> bool:
        """Whether a part of the value is too large to be written out."""
        return self.kind == "large" or any(part.in_memory for part in self.parts)

    @functools.cached_property
    def _identity(self) -> Any:
        """The detail as layouts are compared: for a static part by type and value, to the bit."""
        return exact(self.detail) if self.kind == "static" else self.detail

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
        return (
            f"{self.kind}({self.detail})"
            if self.kind in ("large", "place")
            else repr(self.detail)
            if self.kind == "static"
            else f"{self.kind}({inside})"
            if inside
            else self.kind
        )


NUMBER, INTEGER, TRUTH, TABLE = map(Layout, ("number", "integer", "truth", "table"))
_SINGLE = "number", "integer", "truth"
_ONE = *_SINGLE, "table", "place"


class _Itself:
    """An object by identity: equal to itself alone."""

    __slots__ = ("thing",)

    def __init__(self, thing: Any) -> None:
        self.thing = thing

    def __hash__(self) -> int:
        return id(self.thing)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Itself) and self.thing is other.thing


def exact(value: Any) -> Any:
    """A key that is equal for values of one type that are the same in every bit, and only for
    those.

    1 is not True nor 1.0, 0.0 is not -0.0, and nan is itself.  Functions, classes, modules, members
    of enums and whatever is not known here are the same if they are one object.
    """
    kind = type(value)
    if kind in _COMPARABLE:
        return kind, value
    if kind is float:
        return kind, struct.pack("<d", value)
    if kind is complex:
        return kind, struct.pack("<2d", value.real, value.imag)
    if isinstance(value, enum.Enum):
        return _Itself(value)
    if isinstance(value, tuple):
        return kind, tuple(map(exact, value))
    if kind is frozenset:
        return kind, frozenset(map(exact, value))
    if isinstance(value, FrozenDict):
        return kind, tuple([(exact(k), exact(v)) for k, v in value.items()])
    if isinstance(value, (np.generic, np.ndarray)) and not value.dtype.hasobject:
        return kind, value.dtype.str, value.shape, value.tobytes()
    if kind is Large and value.numbers is not None:
        return kind, value.form, value.numbers.tobytes()
    if kind in _BY_PARTS:
        return kind, tuple([exact(part) for part in _BY_PARTS[kind](value)])
    if isinstance(value, Record):
        return kind, tuple([exact(x) for x in fields_of(value).values()])
    # not imported for their sake
    if (kind.__module__, kind.__name__) in (("fractions", "Fraction"), ("decimal", "Decimal")):
        return kind, value.as_integer_ratio() if kind.__name__ == "Fraction" else value.as_tuple()
    return _Itself(value)


_COMPARABLE = frozenset((int, bool, str, bytes, type(None), type(Ellipsis), Layout))
_BY_PARTS: dict[type, Callable[[Any], tuple[Any, ...]]] = {
    range: lambda x: (x.start, x.stop, x.step),
    slice: lambda x: (x.start, x.stop, x.step),
    functools.partial: lambda x: (x.func, x.args, *x.keywords.items()),
    types.MethodType: lambda x: (x.__func__, x.__self__),
    Mat: lambda x: x.rows,
    Table: lambda x: (x.content,),
    **{pair: lambda x: (x.level, *x.parts) for pair in PAIRS},
}


def is_number(value: Any) -> bool:
    """A float, or the compiler's stand-in for a number (ints and bools inside values are static)."""
    return isinstance(value, (float, StandIn))


def is_any_number(value: Any) -> bool:
    """A number of any kind: what may differ between the branches of a formula."""
    return isinstance(value, (bool, int, float, StandIn))


def layout_of(value: Any, number: Callable[[Any], bool] = is_number) -> Layout:
    """The layout of a value; tuples that hold no vector, matrix or record are static, like the rows
    of a tableau.
    """
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


_FLOAT = frozenset([float])

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


def leaves(value: Any, layout: Layout) -> list[Any]:
    """The numbers of a value, in order."""
    numbers: list[Any] = []
    _gather(value, layout, numbers)
    return numbers


def _gather(value: Any, layout: Layout, numbers: list[Any]) -> None:
    """Append the numbers of a value."""
    if layout.kind in _SINGLE:
        numbers.append(value)
    elif layout.kind in ("table", "place"):
        numbers.append(value.place)
    elif layout.kind == "large":
        numbers.extend(value.flat)
    elif layout.kind == "record":
        for name, part in zip(layout.detail[1], layout.parts, strict=True):
            if part.width:
                _gather(getattr(value, name), part, numbers)
    elif layout.plain and layout.kind != "pair":
        numbers.extend(value)
    elif layout.width:
        for item, part in zip(value.parts if layout.kind == "pair" else value, layout.parts, strict=True):
            _gather(item, part, numbers)


@functools.lru_cache(256)
def gatherer(layout: Layout) -> Callable[[Any], list[Any]]:
    """`leaves` of values that are known to have this layout: a list written out, such as [*x.mu,
    *x.g.rows[0], ...].
    """
    return eval(f"lambda x: [{', '.join(_places(layout, 'x'))}]", {})


def _places(layout: Layout, value: str) -> Iterator[str]:
    """Expressions, as texts, for the numbers of a value."""
    if layout.kind in _SINGLE:
        yield value
    elif layout.kind == "table":
        yield f"{value}.place"
    elif layout.kind == "large":
        yield f"*{value}.flat"
    elif layout.plain and layout.kind in ("vec", "tuple", "list"):
        yield f"*{value}"
    elif layout.width:
        names = layout.detail[1] if layout.kind == "record" else range(len(layout.parts))
        inside = {"record": ".{}", "mat": ".rows[{}]", "pair": ".parts[{}]"}.get(layout.kind, "[{}]")
        for name, part in zip(names, layout.parts, strict=True):
            if part.width:
                yield from _places(part, value + inside.format(name))


def build(layout: Layout, numbers: Iterator[Any]) -> Any:
    """The value of this layout with the given numbers; records are filled in without running their
    checks.
    """
    if layout.kind in _SINGLE:
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


def paired(form: tuple[Any, ...], parts: Iterable[Any]) -> Any:
    """The number of this form made of two parts."""
    cls, *options = form
    return cls(*parts, *options)


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


def fill(cls: type, fields: dict[str, Any]) -> Any:
    """An instance of a record class with these fields, unchecked."""
    record: Any = object.__new__(cls)
    for name, value in fields.items():
        object.__setattr__(record, name, value)
    return record


def inside(value: Any, kind: type) -> list[Any]:
    """The records of a kind that a value holds, in order."""
    if isinstance(value, kind):
        return [value]
    if isinstance(value, Record):
        return [x for part in fields_of(value).values() for x in inside(part, kind)]
    if type(value) in (tuple, list):
        return [x for part in value for x in inside(part, kind)]
    return []


def exchanged(
    value: Any, kind: type, others: Iterable[Any], on_exchange: Callable[[Any, Any], None] | None = None
) -> Any:
    """The value with the records of a kind, those of `inside`, replaced by others, in order.  Attributes beside the fields
    of a record are copied unless they hold a record of the kind.

    on_exchange : called with every new record and the one that it replaces.
    """
    replacements = iter(others)

    def changed(x: Any) -> Any:
        if isinstance(x, kind):
            return next(replacements)
        if not inside(x, kind):
            return x
        if not isinstance(x, Record):
            return type(x)([changed(part) for part in x])
        fields = fields_of(x)
        beside = {n: y for n, y in vars(x).items() if n not in fields and not inside(y, kind)}
        record = fill(type(x), beside | {n: changed(part) for n, part in fields.items()})
        if on_exchange is not None:
            on_exchange(record, x)
        return record

    return changed(value)


def with_fields(value: Any, **fields: Any) -> Any:
    """A record with other values of some fields, unchecked."""
    return fill(type(value), fields_of(value) | fields)


# ------------------------------------------------------------------ numbers that remember


def compensated(value: Any) -> Any:
    """The value in compensated numbers, which remember what rounding takes from sums; `plain` is the inverse."""
    return _mapped(value, Compensated)


def plain(value: Any) -> Any:
    """The value with compensated numbers replaced by their values."""
    return _mapped(value, value_of)


def double_double(value: Any) -> Any:
    """The value in numbers of two doubles; `rounded` is the inverse."""
    return _mapped(value, lambda x: x if isinstance(x, DoubleDouble) else DoubleDouble(value_of(x), 0.0))


def with_slopes(value: Any, level: float, still: Any = 0.0) -> Any:
    """The value in numbers that all carry a derivative of this level, zero where they had none.

    still : the slope zero; along several directions a vector.
    """
    return _mapped(value, lambda x: x if isinstance(x, Dual) else Dual(x, still, level), (Dual,))


def moving_as(value: Any, x: Any) -> Any:
    """The value in numbers that carry a derivative like that of x; the value itself if x has none."""
    return with_slopes(value, x.level, at_rest(x.slope)) if isinstance(x, Dual) else value


def as_others_see(value: Any) -> Any:
    """The value of a site without slopes of derivatives in which the other sites rest."""
    alone = ALONE.get()
    return _mapped(value, lambda x: _at_rest(x, alone), (Dual,)) if alone else value


def _at_rest(x: Any, alone: tuple[int, ...]) -> Any:
    if not isinstance(x, Dual):
        return x
    value = _at_rest(x.value, alone)
    return value if x.level in alone else Dual(value, _at_rest(x.slope, alone), x.level)


def rounded(value: Any) -> Any:
    """The value in plain doubles."""
    return _mapped(value, lambda x: rounded_number(value_of(x)))


def _mapped(value: Any, change: Callable[[Any], Any], whole: tuple[type, ...] = ()) -> Any:
    """The value with every real number changed.  whole : kinds of numbers that count as one."""
    if isinstance(value, (float, Compensated, DoubleDouble, *whole)) or is_number(value):
        return change(value)
    if isinstance(value, _STRUCTURES):
        return _like(value, [_mapped(x, change, whole) for x in _parts(value)])
    if isinstance(value, Record):
        parts = fields_of(value).items()
        return fill(type(value), {n: _mapped(x, change, whole) for n, x in parts})
    return value


def fitted(value: Any, layout: Layout) -> Any:
    """The value with compensated numbers, numbers of two doubles and derivatives just where a layout has them."""
    if layout.kind == "number":
        return rounded_number(value_of(value))
    if layout.kind == "pair" and layout.detail == _COMPENSATED:
        return Compensated(value) if is_number(value) else value.settled()
    if layout.kind == "pair" and layout.detail == _DOUBLE_DOUBLE:
        return DoubleDouble(value, 0.0) if is_number(value) else value
    if layout.kind == "pair" and layout.detail[0] is Dual and not isinstance(value, Dual):
        still = build(layout.parts[1], itertools.repeat(0.0))
        return Dual(fitted(value, layout.parts[0]), still, layout.detail[1])
    if isinstance(value, Record) and len(layout.parts) == len(fields_of(value)):
        return fill(type(value), {n: fitted(x, part) for (n, x), part in zip(fields_of(value).items(), layout.parts)})
    if isinstance(value, _STRUCTURES) and len(_parts(value)) == len(layout.parts):
        return _like(value, [fitted(x, part) for x, part in zip(_parts(value), layout.parts)])
    return value


_STRUCTURES = (Vec, Mat, tuple, list, Complex, Dual)


def fields_of(value: Any) -> dict[str, Any]:
    """The values of the fields of a record, by name."""
    cls: Any = type(value)
    return {name: getattr(value, name) for name in names_of(cls)}


def _parts(value: Any) -> Any:
    return value.rows if isinstance(value, Mat) else value.parts if isinstance(value, PAIRS) else value


def _like(value: Any, parts: list[Any]) -> Any:
    """A vector, a matrix, a tuple, ... of these parts."""
    if isinstance(value, PAIRS):
        return paired(value.form, parts)
    return type(value)(parts) if type(value) in (tuple, list) else type(value)(*parts)


def vector(n: int) -> Layout:
    """The layout of a vector of n floats; native code asks for it."""
    return layout_of(Vec(*[0.0] * n))


def matrix(n: int, m: int) -> Layout:
    """The layout of a matrix of n rows and m columns; native code asks for it."""
    return layout_of(Mat(*[Vec(*[0.0] * m)] * n))
