"""What a driver, the loop that Python starts, needs beyond formulas; in plain Python and, by the
compiler, in native code.

A driver is a plain function of values, integers and arrays of float64.  It reads a state out of an
array, marches and writes results into arrays.  Compiled for an ensemble it does so for several
bodies at once, each with its own column of every array.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidType
from ..formulas.pytree import Layout, build, is_any_number, layout_of, leaves
from ..formulas.vectors import Vec


class Rejected:
    """What an attempted step gives in plain Python when it raises.  error : what it raised."""

    def __init__(self, error: Exception) -> None:
        self.error = error


def read(array: np.ndarray, start: int, layout: Layout) -> Any:
    """The value of this layout that lies at `array[start:]`."""
    return build(layout, iter(array[start : start + layout.width].tolist()))


def write(array: np.ndarray, start: int, value: Any, layout: Layout | None = None) -> None:
    """Lay the numbers of a value, which may be known to have this layout, down at `array[start:]`."""
    for i, x in enumerate(leaves(value, layout or layout_of(value))):
        array[start + i] = x


def numbers(value: Any) -> Vec:
    """All numbers of a value, integers too, in order."""
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
            mistake = InvalidType(
                f"a formula gives a NumPy array where a number belongs, write liemech.vec: {error}"
            )
            return Rejected(mistake.with_traceback(error.__traceback__))
        return Rejected(error)


def _writes_complex(error: Exception) -> bool:
    """Is there a complex constant in the formula that raised?"""
    at = error.__traceback__
    while at is not None and at.tb_next is not None:
        at = at.tb_next
    return at is not None and any(type(x) is complex for x in at.tb_frame.f_code.co_consts)


def accepted(value: Any, shown: Callable[[Any], Any], layout: Layout | None = None) -> bool:
    """Did the attempt go through, and is what it shows finite?  Told, as in native code, from the
    sum of its numbers.
    """
    if isinstance(value, Rejected):
        return False
    part = shown(value)
    total = pairwise_sum(leaves(part, layout or layout_of(part)))
    return not isinstance(total, complex) and math.isfinite(total)


def reason(value: Any) -> Exception | None:
    """In plain Python, what an attempt that was not accepted raised; None if its numbers were not
    finite.
    """
    return value.error if isinstance(value, Rejected) else None


def pairwise_sum(terms: list[Any]) -> Any:
    """The sum of neighbours, of their sums and so on: no long chain of additions that wait for each
    other.
    """
    if not terms:
        return 0.0
    while len(terms) > 1:
        terms = [a + b for a, b in zip(terms[::2], terms[1::2], strict=False)] + terms[
            len(terms) & ~1 :
        ]
    return terms[0]


def itself(value: Any) -> Any:
    """The whole value, for `accepted`."""
    return value


def any_body(condition: bool) -> bool:
    """Does the condition hold for any of the bodies that run together?"""
    return condition
