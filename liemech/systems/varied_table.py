"""Tables of which one interval carries a derivative: by the coefficients there a motion is
differentiated.
"""

from __future__ import annotations

from typing import Any

from ..errors import InvalidInput
from ..formulas import Vec, record, where
from ..formulas.pytree import fields_of, fill
from .tabulated import PiecewisePolynomial


@record
class VariedTable(PiecewisePolynomial):
    """A table whose coefficients in one interval are moved by something that is zero and has a slope.

    A part of a run knows from its times which intervals it meets; a formula that asks elsewhere, such as
    one of a delay or of a place, would have a derivative that nobody looks for, and is refused.

    moved : (degree + 1) * size numbers by which the coefficients are moved.  where_moved : the interval.
    from_interval, to_interval : the first and the last one that count.
    """

    moved: Any = None
    where_moved: float = 0.0
    from_interval: float = 0.0
    to_interval: float = 0.0

    def _terms_of(self, i: Any) -> list[Any]:
        if not (self.from_interval <= i <= self.to_interval):
            raise InvalidInput(
                "Plan.gradient: a formula asks a table at other times than those of its step, such as "
                "with a delay, and has no gradient by its values; plan.run of moved tables tells it"
            )
        here, width = where(i == self.where_moved, 1.0, 0.0), max(self.size, 1)
        rows = [self.moved[k * width : (k + 1) * width] for k in range(self.degree + 1)]
        return [
            term + here * (Vec(*row) if self.size else row[0])
            for term, row in zip(super()._terms_of(i), rows)
        ]


def varied(table: PiecewisePolynomial, moved: Any, *intervals: float) -> VariedTable:
    """The table with moved coefficients.  intervals : where they are moved, and from which to which one
    it counts.
    """
    names = "moved", "where_moved", "from_interval", "to_interval"
    return fill(VariedTable, fields_of(table) | dict(zip(names, (moved, *intervals))))
