"""Tables of which one interval carries derivatives, by which motions are differentiated by its coefficients."""

from __future__ import annotations

from typing import Any

from ...errors import InvalidInput
from ...formulas import Vec, record, where
from ...formulas.classes.records import fields_of, fill
from ...formulas.tables import entry
from .tabulated import ROUNDING, PiecewisePolynomial


@record
class VariedTable(PiecewisePolynomial):
    """The part of a table over the times of some steps; the coefficients of one interval are perturbed by numbers that
    are zero and have a slope.

    Raises InvalidInput for times outside of this part, such as those of a delay: derivatives there would be lost.
    """

    moved: Any = None  # the (degree + 1) * size perturbations
    where_moved: float = 0.0  # the number, in this part, of the interval that they perturb
    at_begin: float = 1.0  # 1 if this part begins where the table does, else 0
    at_end: float = 1.0  # 1 if it ends where the table does, else 0

    def _inside(self, t: Any, low: Any, high: Any, period: Any) -> Any:
        first, last = entry(self.knots, 0), entry(self.knots, int(self.intervals))
        slack = ROUNDING * max(abs(first), abs(last))
        if (self.at_begin == 0.0 and t < first - slack) or (self.at_end == 0.0 and t > last + slack):
            raise InvalidInput(
                "Plan.gradient: a formula asks a table at other times than those of its step, such as "
                "with a delay, and has no gradient by its values; take differences of runs with other tables"
            )
        return super()._inside(t, low, high, period)

    def _terms_of(self, i: Any) -> list[Any]:
        switch, width = where(i == self.where_moved, 1.0, 0.0), max(self.size, 1)
        rows = [self.moved[k * width : (k + 1) * width] for k in range(self.degree + 1)]
        return [term + switch * (Vec(*row) if self.size else row[0]) for term, row in zip(super()._terms_of(i), rows)]


def varied(table: PiecewisePolynomial) -> VariedTable:
    """The whole table, perturbed in no interval."""
    width = (table.degree + 1) * max(table.size, 1)
    return fill(VariedTable, fields_of(table) | {"moved": Vec(*[0.0] * width), "where_moved": -1.0,
                                                 "at_begin": 1.0, "at_end": 1.0})  # fmt: skip
