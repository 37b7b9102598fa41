"""Transposed derivatives of formulas: J^T w by one sweep backwards over the forms that a formula has made.

Of a state the derivatives are components: of vectors those of their numbers, of an element `g` of a group those
of eta, dg = g hat(eta).

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2 (the reverse mode).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

from ...errors import IncompatibleSystem
from .. import vectors
from ..classes.records import Record, fields_of, fill, of_parts, parts_of, record
from ..derivatives import BELOW, axes, derivative
from ..vectors import Mat, Vec, vec
from .dual import Dual
from .forms import PULLED, LinearForm, Rule, swept
from .pairs import PAIRS
from .series_of_sites import has_series


@record
class AtElement(Record):
    """An element of a group, as a state that has no momentum."""

    g: Any


def _python(formula: Callable[..., Any], *x: Any) -> Any:
    return formula(*x)


def pulled_back(
    formula: Callable[..., Any], group: Any, fixed: tuple[Any, ...], x: Any, w: Any, call: Any = _python
) -> tuple[Any, list[Any]]:
    """J^T w of a formula(*fixed, x), and the notes of the rules that it has met.

    w : the derivative of something by the components of the result, in the structure of the result.
    """
    roots = [LinearForm() for _ in _slopes(group, x, call)]
    before = PULLED.set(True)
    try:
        result = call(formula, *fixed, _formed(group, x, iter(roots), call))
    finally:
        PULLED.reset(before)
    felt, notes = swept(zip(_slopes(group, result, call), _numbers(w), strict=True))
    return _shaped(group, x, iter([felt.get(form, 0.0) for form in roots])), notes


def ruled(
    formula: Callable[..., Any], back: Callable[..., Any], group: Any, fixed: tuple[Any, ...], *x: Any,
    call: Any = _python,
) -> Any:  # fmt: skip
    """formula(*fixed, *x), whose transposed derivative is known.

    back : of (*fixed, *x, w) gives a tuple with the derivatives by each of x, and a list of notes.
    """
    if PULLED.get() is None:
        return call(formula, *fixed, *x)
    bare = unformed(x)
    if not PULLED.get():
        return call(formula, *fixed, *bare)
    if is_nested(x):
        return _poisoned(call(formula, *fixed, *bare))
    if has_series(x):
        raise IncompatibleSystem("there is no way back through power series")
    forms = _slopes(group, x, call)
    value = call(formula, *fixed, *bare)
    if not any(isinstance(form, LinearForm) for form in forms):
        return value

    def pulled(felt: list[Any]) -> tuple[list[Any], Any]:
        parts, notes = call(back, *fixed, *bare, _shaped(group, value, iter(felt)))
        return _numbers(parts), notes

    rule = Rule(forms, len(_slopes(group, value, call)), pulled)
    return _formed(group, value, iter(rule.forms), call)


def is_pulled() -> bool:
    """Whether numbers carry forms here."""
    return bool(PULLED.get())


def quiet(formula: Callable[..., Any], *x: Any, call: Any = _python) -> Any:
    """formula(*x) without forms."""
    before = PULLED.set(False)
    try:
        return unformed(call(formula, *unformed(x)))
    finally:
        PULLED.reset(before)


class Residual:
    """The forms of the first value that a formula makes of an unknown: `ends`, and `roots`, those of the unknown `x`; and
    the other values.
    """

    def __init__(self, formula: Callable[..., Any], x: Any, call: Any = _python) -> None:
        self.x, self.roots = x, [LinearForm() for _ in _numbers(x)]
        first, *others = call(formula, _formed(None, x, iter(self.roots), call))
        self.ends, self.others = _slopes(None, first, call), [unformed(y) for y in others]

    def felt(self, w: Any) -> Any:
        """The derivative by the unknown of <w, result>, (n,).  w : (n,)."""
        slopes, _ = swept(zip(self.ends, w, strict=True), lambda form: form.made < self.roots[0].made)
        return vec(*[slopes.get(form, 0.0) for form in self.roots])


def determined(of: Residual, back: Callable[..., Any], *fixed: Any, call: Any = _python) -> Any:
    """The unknown that an equation determines.

    back : of (*fixed, w), w the derivative by the unknown, gives that by the result of its formula; (n,) both.
    """
    rule = Rule(of.ends, len(of.roots), lambda felt: ([*call(back, *fixed, vec(*felt))], []))
    return _formed(None, of.x, iter(rule.forms), call)


CALLING = pulled_back, ruled, quiet, Residual, determined
"""Those that call formulas, which the compiler runs in Python."""


def is_nested(x: Any) -> bool:
    """Whether forms are inside of derivatives that are being taken."""
    if isinstance(x, Dual):
        return x.level != BELOW or is_nested(x.value)
    return any(is_nested(part) for part in parts_of(x)) if isinstance(x, _STRUCTURES) else False


def _poisoned(x: Any) -> Any:
    """A value whose forms nobody may ask for."""

    def asked(felt: list[Any]) -> Any:
        raise IncompatibleSystem(
            "there is no way back through a derivative of an energy or a displacement that a step depends on"
        )

    return _formed(None, x, itertools.cycle(Rule([], 1, asked).forms), _python)


def unformed(x: Any) -> Any:
    """A value whose numbers have no forms."""
    if isinstance(x, Dual):
        return unformed(x.value) if x.level == BELOW else Dual(unformed(x.value), unformed(x.slope), x.level)
    return of_parts(x, [unformed(part) for part in parts_of(x)]) if isinstance(x, _STRUCTURES) else x


def _each(x: Any, number: Callable[[Any], Any], element: Callable[[Any], Any] | None = None) -> Any:
    """A value with something else for its numbers, and for the elements `g` in records."""
    if isinstance(x, Record):
        new = {}
        for name, part in fields_of(x).items():
            to_element = element if name == "g" and part is not None else None
            new[name] = to_element(part) if to_element else _each(part, number, element)
        return fill(type(x), new)
    if isinstance(x, (Vec, Mat, tuple, list)):
        return of_parts(x, [_each(part, number, element) for part in parts_of(x)])
    return x if x is None else number(x)


def _numbers(x: Any) -> list[Any]:
    """The numbers of a value, in order."""
    if isinstance(x, (Record, Vec, Mat, tuple, list)):
        return [y for part in parts_of(x) for y in _numbers(part)]
    return [] if x is None else [x]


def _slopes(group: Any, x: Any, call: Any) -> list[Any]:
    """The forms of the components of a value; 0 for one that rests."""
    return _numbers(_each(x, _slope, lambda g: _of_element(group, g, call)))


def _slope(x: Any) -> Any:
    return x.slope if isinstance(x, Dual) else 0


def _of_element(group: Any, g: Any, call: Any) -> list[Any]:
    """The forms of eta, of a moving element."""
    entries = [_slope(x) for x in _numbers(g)]
    rule = getattr(entries[0], "rule", None)
    if isinstance(rule, OfElement) and entries == rule.forms:
        return rule.given
    moving = {k: x for k, x in enumerate(entries) if isinstance(x, LinearForm)}
    if not moving:
        return [0] * group.dim
    bare = unformed(g)
    units = [iter([1.0 if j == k else 0.0 for j in range(len(entries))]) for k in moving]
    columns = [call(_eta, group, bare, _shaped(group, bare, unit)) for unit in units]
    return [LinearForm(*zip(row, moving.values())) for row in zip(*columns)]


def _eta(group: Any, g: Any, rate: Any) -> Any:
    """The body velocity, which is linear in the rate."""
    return group.body_velocity(g, rate)


class OfElement(Rule):
    """The forms of the entries of an element that moves by eta, whose forms are `given`."""

    def __init__(self, group: Any, g: Any, eta: list[Any], call: Any) -> None:
        def back(felt: list[Any]) -> tuple[list[Any], list[Any]]:
            columns = [_numbers(x) for x in call(turned, group, g)]
            return [vectors.sum([w * c for w, c in zip(felt, column)]) for column in columns], []

        super().__init__(eta, len(_numbers(g)), back)


def turned(group: Any, g: Any) -> list[Any]:
    """The directions g hat(e_i) in which an element moves."""
    still = vec(*[0.0 for _ in range(group.dim)])
    return [derivative(lambda xi: group.compose_exp(g, xi), still, unit) for unit in axes(still)]


def _formed(group: Any, x: Any, forms: Iterator[Any], call: Any) -> Any:
    """A value whose components have these forms."""

    def number(y: Any) -> Any:
        if isinstance(y, Dual):  # inside of a derivative
            return Dual(number(y.value), number(y.slope), y.level)
        return y if type(y) is int else Dual(y, next(forms), BELOW)

    def element(g: Any) -> Any:
        entries = iter(OfElement(group, g, [next(forms) for _ in range(group.dim)], call).forms)
        return _each(g, lambda y: Dual(y, next(entries), BELOW))

    return _each(x, number, element)


def _shaped(group: Any, x: Any, numbers: Iterator[Any]) -> Any:
    """Components in the structure of a value, of an element a vector."""
    return _each(x, lambda _: next(numbers), lambda g: vec(*[next(numbers) for _ in range(group.dim)]))


_STRUCTURES = (Vec, Mat, tuple, list, Record, *PAIRS)
