"""Values in numbers of another kind: with more digits, with derivatives, or plain."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from ...errors import IncompatibleSystem
from ..classes.layouts import Layout, build
from ..classes.records import Record, of_parts, parts_of
from ..vectors import Mat, Vec
from .bases import is_number
from .compensated import Compensated, value_of
from .complex_numbers import Complex
from .double_double import DoubleDouble, rounded_number
from .dual import ALONE, Dual, at_rest, constant
from .forms import PULLED, LinearForm

_COMPENSATED, _DOUBLE_DOUBLE = (Compensated,), (DoubleDouble,)  # the forms of such numbers


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


def resting(value: Any) -> Any:
    """The value without its derivatives."""
    return _mapped(value, constant, (Dual,))


def moving_as(value: Any, x: Any) -> Any:
    """The value in numbers that carry a derivative like that of x; the value itself if x has none."""
    return with_slopes(value, x.level, at_rest(x.slope)) if isinstance(x, Dual) else value


def as_others_see(value: Any) -> Any:
    """The value of a site without slopes of derivatives in which the other sites rest.  Raises IncompatibleSystem for
    one on the way back, on which sites do not meet but by rules.
    """
    if PULLED.get():
        _mapped(value, _require_no_form, (Dual,))
    alone = ALONE.get()
    return _mapped(value, lambda x: _at_rest(x, alone), (Dual,)) if alone else value


def _require_no_form(x: Any) -> Any:
    if isinstance(x, Dual):
        _require_no_form(x.value)
        _require_no_form(x.slope)
    elif isinstance(x, LinearForm):
        raise IncompatibleSystem(
            "there is no way back through what sites tell each other but through the velocity, force and rate of their "
            "system: ask the system for these, and not its energy"
        )
    return x


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
        return of_parts(value, [_mapped(x, change, whole) for x in parts_of(value)])
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
        zero = build(layout.parts[1], itertools.repeat(0.0))
        return Dual(fitted(value, layout.parts[0]), zero, layout.detail[1])
    if isinstance(value, _STRUCTURES) and len(parts := parts_of(value)) == len(layout.parts):
        return of_parts(value, [fitted(x, part) for x, part in zip(parts, layout.parts)])
    return value


_STRUCTURES = (Vec, Mat, tuple, list, Record, Complex, Dual)
