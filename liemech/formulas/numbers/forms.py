"""Linear forms as slopes: what a formula makes of the numbers that it is given, told backwards.

A number whose slope is a form depends on others by factors, and these on others again.  One sweep from the
last form to the first one finds J^T w of a formula with the derivative J.  Where a transposed derivative is
known, forms are not followed through a formula but by that rule (`ruled`).

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2 (the reverse mode).
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from typing import Any

from .bases import StandIn

PULLED: ContextVar[bool | None] = ContextVar("whether forms are made: None where nothing has any", default=None)

_made = itertools.count()


class LinearForm(StandIn):
    """A linear form: a sum of others, each times a number.  Where none are made, sums and products have no slope.

    rule : of one that a rule has made, which has no terms.
    """

    __slots__ = ("made", "rule", "terms")

    def __init__(self, *terms: tuple[Any, LinearForm], rule: Rule | None = None) -> None:
        self.terms, self.rule, self.made = terms, rule, next(_made)

    @classmethod
    def zero(cls) -> LinearForm:
        """A form that is zero."""
        return cls((0.0, _REST))

    def __add__(self, other: Any) -> Any:
        return _form((1.0, self), (1.0, other)) if isinstance(other, LinearForm) else self

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return _form((1.0, self), (-1.0, other)) if isinstance(other, LinearForm) else self

    def __neg__(self) -> Any:
        return _form((-1.0, self))

    def __mul__(self, k: Any) -> Any:
        return _form((k, self))

    __rmul__ = __mul__

    def __truediv__(self, k: Any) -> Any:
        if PULLED.get() is False:
            return 0
        return Rule([self], 1, lambda felt: ([felt[0] / k], [])).forms[0]  # not before it counts: k may be zero

    def __abs__(self) -> float:
        return 1.0  # it moves, which `==` refuses


def _form(*terms: tuple[Any, LinearForm]) -> Any:
    return 0 if PULLED.get() is False else LinearForm(*terms)


class Rule:
    """The forms that a formula has made, by its transposed derivative.

    given : the forms that it depends on, 0 for what rests.  count : how many it makes.
    back : gives the derivatives by those, and notes, from the derivatives by these.
    """

    def __init__(self, given: list[Any], count: int, back: Callable[[list[Any]], tuple[list[Any], Any]]) -> None:
        self.given, self.back, self.made = given, back, next(_made)
        self.forms = [LinearForm(rule=self) for _ in range(count)]


_REST = LinearForm()


def factors_of(slope: Any) -> dict[LinearForm, Any]:
    """The factors of the forms of which a form is the sum; none of a number, which rests."""
    factors: dict[LinearForm, Any] = {}
    for k, form in slope.terms if isinstance(slope, LinearForm) else ():
        factors[form] = factors[form] + k if form in factors else k
    return factors


def now() -> int:
    """The time by which forms are told that were made before from those that are made later."""
    return next(_made)


def chosen(where: Callable[[Any, Any], Any], yes: Any, no: Any) -> LinearForm:
    """The one of two forms that `where` chooses; numbers rest."""
    return Rule([yes, no], 1, lambda felt: ([where(felt[0], 0.0), where(0.0, felt[0])], [])).forms[0]


def swept(
    ends: Iterable[tuple[Any, Any]], given: Callable[[LinearForm], bool] = lambda form: False
) -> tuple[dict[LinearForm, Any], list[Any]]:
    """The derivatives by all forms of the sum of the given ones, each times a number; and the notes of the rules.

    given : whether a form is not asked on what it depends.
    """
    felt: dict[LinearForm, Any] = {}
    notes: list[Any] = []
    todo: list[tuple[int, Any]] = []
    waiting: set[Any] = set()

    def add(item: Any, w: Any) -> None:
        if isinstance(item, LinearForm):
            felt[item] = felt[item] + w if item in felt else w
            if not given(item):
                wait(item)

    def wait(item: Any) -> None:
        if item not in waiting:
            waiting.add(item)
            heapq.heappush(todo, (-item.made, item))

    for form, w in ends:
        add(form, w)
    while todo:
        item = heapq.heappop(todo)[1]
        if isinstance(item, Rule):
            parts, remarks = item.back([felt.get(form, 0.0) for form in item.forms])
            notes += remarks
            for form, w in zip(item.given, parts, strict=True):
                add(form, w)
        elif item.rule is not None:
            wait(item.rule)
        for k, form in () if isinstance(item, Rule) else item.terms:
            add(form, k * felt[item])
    return felt, notes
