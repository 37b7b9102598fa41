"""Coefficients as data: records that check themselves, and the printing of their numbers."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Any, Self

from ..errors import InvalidInput, InvalidType, LawViolation, NotDefined
from ..formulas import Record, record
from ..formulas.numbers.sizes import EPSILON
from .trees import Row

CLOSE = 64.0 * EPSILON
"""The part of its terms by which a condition of order may be missed."""


@record
class Coefficients(Record):
    """Numbers with a name and a source, which know the laws that they obey; abstract.

    A subclass has a `name` and an `order`; it writes `_tidy`, which makes its fields what they should
    be, and `check`.
    """

    if TYPE_CHECKING:
        name: str
        order: int

    def __post_init__(self) -> None:
        self._tidy()
        self.check()

    def _tidy(self) -> None:
        """Make the fields tuples of numbers.  Raises InvalidType, InvalidInput."""

    def check(self) -> None:
        """Raise LawViolation, naming the law, unless the numbers satisfy their claims."""
        raise NotDefined(f"{type(self).__name__} must define `check`")

    def _rows(self, *fields: str) -> None:
        """Make fields rows of floats.  Raises InvalidType."""
        for field in fields:
            sequence: Any = getattr(self, field)
            try:
                row = tuple(map(float, sequence))
            except (TypeError, ValueError):
                raise InvalidType(f"{self.name}: {field} is a sequence of numbers; got {sequence!r}") from None
            object.__setattr__(self, field, row)

    def _failing(self, order: int) -> str:
        """The condition of an order that does not hold, in words; empty if all do."""
        raise NotDefined(f"{type(self).__name__} must define `_failing`")

    def _reaches(self, most: int) -> None:
        """Raise an error unless the order claimed is a whole number, and reached."""
        order: Any = self.order
        if type(order) is not int or not 1 <= order <= most:
            raise InvalidInput(f"{self.name}: the order is a whole number from 1 to {most}; got {order!r}")
        for q in range(1, order + 1):
            if failing := self._failing(q):
                raise LawViolation(f"{self.name} is of order {q - 1}, not {order}: {failing}")

    @classmethod
    def shipped(cls, *values: Any, **more: Any) -> Self:
        """A tableau of this library, with the fields in their order or by name: its laws are checked by the
        tests, so that an import does not wait for them.
        """
        tableau = object.__new__(cls)
        fields = dataclasses.fields(cls)
        by_name = dict(zip([f.name for f in fields], values, strict=False)) | more
        for field in fields:
            object.__setattr__(tableau, field.name, by_name.get(field.name, field.default))
        tableau._tidy()
        return tableau


def head_and_rows(text: str) -> tuple[str, list[int], str, list[tuple[str, Row]]]:
    """The name, the orders and the source in the head of a table, "classical, order 4: Kutta 1901", and its rows, each
    with its label, `b | 1/2 1/2`.  Head and rows go on in lines without a bar; `*` in the middle of a row, or `* *`, stands
    for what makes its sum one, and the rest is the beginning backwards.
    """
    head, _, _ = text.partition("|")
    head = head.rpartition("\n")[0]
    match = re.fullmatch(r"(.*), order (\d+)(?:\((\d+)\))?(?:\((\d+)\))?: (.*)", " ".join(head.split()))
    assert match is not None
    name, *orders, source = match.groups()
    lines = re.findall(r"^ *(\S+) \|([^|]*)(?=\n|$)", text[len(head) :], re.MULTILINE)
    return name, [int(order) for order in orders if order], source, [(label, _whole(row)) for label, row in lines]


def _whole(text: str) -> Row:
    """The numbers of a row, with those that its stars stand for."""
    half, stars, _ = text.partition("*")
    begin = numbers(half)
    if not stars:
        return begin
    if "* *" in text:
        begin = (*begin, 0.5 - math.fsum(begin))
        return (*begin, *begin[::-1])
    return (*begin, 1.0 - 2.0 * math.fsum(begin), *begin[::-1])


def numbers(text: str) -> Row:
    """The numbers of a text, decimal ones and fractions such as 19372/6561."""
    return tuple(map(_number, text.split()))


def _number(text: str) -> float:
    above, _, below = text.partition("/")
    return int(above) / int(below) if below else float(above)
