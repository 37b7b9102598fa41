"""Coefficients as data: records that check themselves, and the numbers of tables as they are printed."""

from __future__ import annotations

import dataclasses
from typing import Any, Self

from ..errors import NotDefined
from ..formulas import Record, record
from .trees import Row


@record
class Coefficients(Record):
    """Numbers with a name and a source, which know the laws that they obey; abstract.

    A subclass writes `_tidy`, which makes its fields what they should be, and `check`.
    """

    def __post_init__(self) -> None:
        self._tidy()
        self.check()

    def _tidy(self) -> None:
        """Make the fields tuples of numbers.  Raises InvalidType, InvalidInput."""

    def check(self) -> None:
        """Raise LawViolation, naming the law, unless the numbers are what they claim to be."""
        raise NotDefined(f"{type(self).__name__} must define `check`")

    @classmethod
    def shipped(cls, *values: Any, **more: Any) -> Self:
        """One of this library, with the fields in their order or by name: its laws are checked by the
        tests, so that an import does not wait for them.
        """
        made = object.__new__(cls)
        fields = dataclasses.fields(cls)
        given = dict(zip([f.name for f in fields], values, strict=False)) | more
        for field in fields:
            object.__setattr__(made, field.name, given.get(field.name, field.default))
        made._tidy()
        return made


def numbers(text: str) -> Row:
    """The numbers of a text, decimal ones and fractions such as 19372/6561."""
    return tuple(map(_number, text.split()))


def _number(text: str) -> float:
    above, _, below = text.partition("/")
    return int(above) / int(below) if below else float(above)
