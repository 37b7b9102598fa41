"""Reading, writing and attempting for drivers, the loops that Python starts, in plain Python and, by
the compiler, in native code.

A driver is a plain function of values, integers and buffers, arrays of float64 that hold rows, as
many numbers each as a layout says.  It reads a state out of one, marches and writes results into
others.  Compiled for an ensemble it does so for several bodies at once, each with its own column of
every buffer, but of those that all share.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidType
from ..formulas.classes.layouts import Layout, build, carried_layout, difference, fits, layout_of, leaves
from ..formulas.large import sum_of
from ..formulas.numbers.bases import is_any_number
from ..formulas.vectors import Vec

Kind = Layout | str | tuple[str, Layout]
"""The kind of an argument: the layout of a value, ("several", layout) if every body has its own, "integer",
"columns", "shared", "rows" or "planes".
"""


def layout_of_kind(kind: Kind) -> Any:
    """The layout of an argument that has one."""
    return kind[1] if isinstance(kind, tuple) else kind


def part_of_driver(function: Callable[..., Any]) -> Callable[..., Any]:
    """Declare a function to be a part of the driver that calls it: bodies that run together leave its
    loops together.
    """
    function.part_of_driver = True  # type: ignore[attr-defined]
    return function


def is_part_of_driver(function: Callable[..., Any]) -> bool:
    """Whether a function is declared a part of drivers, by `part_of_driver`."""
    return getattr(function, "part_of_driver", False)


class Rejected:
    """The result, in plain Python, of an attempted step that raised `error`."""

    def __init__(self, error: Exception) -> None:
        self.error = error


def read(buffer: np.ndarray, k: int, layout: Layout) -> Any:
    """Row number k of a buffer, whose rows have this layout."""
    array, start = buffer, k * layout.width
    numbers = array[start : start + layout.width].tolist()
    if layout.has_integers:
        integers = array.view(np.int64)
        for i, kind in enumerate(layout.kinds):
            if kind in ("integer", "truth"):
                numbers[i] = (int if kind == "integer" else bool)(integers[start + i])
    return build(layout, iter(numbers))


def write(buffer: np.ndarray, k: int, value: Any, layout: Layout) -> None:
    """Set row number k of a buffer to the numbers of a value, which has this layout: an integer or a
    truth value is one of 64 bits.  Raises InvalidType.
    """
    unchanged(value, layout)
    array, start = buffer, k * layout.width
    if layout.in_memory and not layout.has_integers:
        array[start : start + layout.width] = list(leaves(value, layout))
        return
    integers = array.view(np.int64) if layout.has_integers else array
    for i, (x, kind) in enumerate(zip(leaves(value, layout), layout.kinds, strict=True)):
        (integers if kind in ("integer", "truth") else array)[start + i] = x


def unchanged(value: Any, layout: Layout) -> None:
    """Refuse a value that does not fit the layout: it has no place in the memory that was made for
    it.  (The compiler sees so while it translates.)  Raises InvalidType, OverflowError.
    """
    actual = carried_layout(value)
    if not fits(actual, layout):
        raise InvalidType(refusal(actual, layout))
    if layout.has_integers:
        for x, kind in zip(leaves(value, layout), layout.kinds, strict=True):
            if kind == "integer" and isinstance(x, int) and not -HUGE <= x < HUGE:
                raise OverflowError(
                    f"{x} is carried along from step to step, where integers have 64 bits: keep it "
                    "below 2**63, or make it a float"
                )


HUGE = 2**63
"""Integers of 64 bits are at least -HUGE and less than HUGE."""


def refusal(actual: Layout, layout: Layout) -> str:
    """Why a value does not fit a layout."""
    name = layout.detail[0].__name__ if layout.kind == "record" else "the value"
    return (
        f"integrate: {difference(actual, layout, name)}. What is carried along from step to step "
        "keeps its structure: numbers, liemech.vec(...), liemech.mat(...), tuples and records, not "
        "arrays; a number that is absent at first begins as 0.0, a float, not as None or 0"
    )


def numbers(value: Any) -> Vec:
    """The vector of all numbers of a value, integers too, in order."""
    return Vec.of(leaves(value, layout_of(value, is_any_number)))


def attempt(function: Callable[..., Any], *args: Any) -> Any:
    """`function(*args)`, where formulas may raise; ask `accepted` before using the result.

    Powers of negative numbers are complex in Python and nan in native code: what cannot go on with
    them has left its domain.
    """
    try:
        return function(*args)
    except Exception as error:  # whoever started the driver decides what becomes of it
        if isinstance(error, TypeError) and "complex" in str(error) and not _writes_complex(error):
            return Rejected(ArithmeticError(f"a power of a negative number is complex: {error}"))
        if isinstance(error, ValueError) and str(error).startswith("The truth value of an array"):
            mistake = InvalidType(f"a formula gives a NumPy array where a number belongs, write liemech.vec: {error}")
            return Rejected(mistake.with_traceback(error.__traceback__))
        return Rejected(error)


def _writes_complex(error: Exception) -> bool:
    """Whether the function that raised has a complex constant."""
    at = error.__traceback__
    while at is not None and at.tb_next is not None:
        at = at.tb_next
    return at is not None and any(type(x) is complex for x in at.tb_frame.f_code.co_consts)


def accepted(value: Any, shown: Callable[[Any], Any], layout: Layout | None = None) -> bool:
    """Whether an attempt went through, and what it shows is finite: by the sum of its numbers, as in native code."""
    if isinstance(value, Rejected):
        return False
    part = shown(value)
    total = pairwise_sum(terms(part, layout or layout_of(part)))
    return not isinstance(total, complex) and math.isfinite(total)


def reason(value: Any) -> Exception | None:
    """The error of an attempt that was not accepted, in plain Python; None if its numbers were not finite."""
    return value.error if isinstance(value, Rejected) else None


def terms(value: Any, layout: Layout) -> list[Any]:
    """The numbers of a value; of what lies in memory the sum of its numbers."""
    if not layout.in_memory:
        return leaves(value, layout)
    if layout.kind == "large":
        return [sum_of(value)]
    parts = value.parts if layout.kind == "pair" else value
    if layout.kind == "record":
        parts = [getattr(value, name) for name in layout.detail[1]]
    return [
        x for item, part in zip(parts, layout.parts, strict=True) if part.width
        for x in terms(item, part)
    ]  # fmt: skip


def pairwise_sum(terms: list[Any]) -> Any:
    """The sum of neighbours, of their sums and so on: no long chain of additions that wait for each other."""
    if not terms:
        return 0.0
    while len(terms) > 1:
        terms = [a + b for a, b in zip(terms[::2], terms[1::2], strict=False)] + terms[len(terms) & ~1 :]
    return terms[0]


def itself(value: Any) -> Any:
    """The whole value, for `accepted`."""
    return value


def any_body(condition: bool) -> bool:
    """Whether a condition holds for any of the bodies that run together."""
    return condition
