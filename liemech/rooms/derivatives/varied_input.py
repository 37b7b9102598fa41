"""Tables of inputs by whose values a motion is differentiated."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas.classes.flattening import build, leaves
from ...formulas.classes.layouts import layout_of
from ...formulas.classes.nested import with_records
from ...simulation.compiled.parameters import full_name, parameter
from ...systems.in_time.inputs import inputs
from ...systems.in_time.tabulated import PiecewisePolynomial
from ...systems.in_time.varied_table import varied


class VariedInput:
    """A table in the systems, by whose coefficients the motion is differentiated.

    number : of the table among the inputs of a system.  width : how many coefficients an interval has.
    """

    def __init__(self, number: int, table: PiecewisePolynomial) -> None:
        self.number, self.table = number, table
        self.width = (table.degree + 1) * max(table.size, 1)
        self.places: dict[str, np.ndarray] = {}

    def of(self, system: Any) -> PiecewisePolynomial:
        """The table in a system."""
        return inputs(system)[self.number]

    def by(self, found: np.ndarray, values: bool) -> np.ndarray:
        """The derivative by the values, or by the coefficients, from that by the coefficients, (bodies,
        intervals, coefficients).
        """
        table = self.table
        shape = table.degree + 1, *([table.size] if table.size else [])
        found = found.reshape(*found.shape[:2], *shape)
        if not values:
            return found
        if table.degree == 0:
            return found[:, :, 0]
        width = np.diff(np.asarray(table.knots)).reshape(-1, *[1] * (len(shape) - 1))
        ends = np.zeros((found.shape[0], found.shape[1] + 1, *shape[1:]))
        ends[:, :-1] += found[:, :, 0] - found[:, :, 1] / width
        ends[:, 1:] += found[:, :, 1] / width
        return ends

    def in_system(self, system: Any) -> Any:
        """The system with the table as it carries a derivative."""
        tables = inputs(system)
        tables[self.number] = varied(tables[self.number])
        return with_records(system, PiecewisePolynomial, tables)

    def find(self, system: Any) -> None:
        """Find the places of its numbers in those of a system that has it so."""
        mine = inputs(system)[self.number]
        layout, at = layout_of(mine), self._begin(layout_of(system), [self.number])
        for name, part in zip(layout.detail[1], layout.parts, strict=True):
            self.places[name] = np.arange(at, at + part.width)
            at += part.width

    def moves(self, system: Any) -> list[tuple[Any, int]]:
        """For every coefficient of every interval the system in which that interval is moved, and the place
        of the number by which.
        """
        layout, found = layout_of(system), []
        for interval in range(int(self.table.intervals)):
            numbers = leaves(system, layout)
            numbers[self.places["where_moved"][0]] = float(interval)
            moved = build(layout, iter(numbers))
            found += [(moved, int(place)) for place in self.places["moved"]]
        return found

    def _begin(self, layout: Any, left: list[int]) -> int:
        """Where the numbers of the table begin, as far as this part of the layout has it.  left : how many
        tables come before.
        """
        at = 0
        for part in layout.parts:
            if part.kind == "record" and issubclass(part.detail[0], PiecewisePolynomial):
                if left[0] == 0:
                    left[0] = -1
                    return at
                left[0] -= 1
            elif left[0] >= 0:
                inner = self._begin(part, left)
                if left[0] < 0:
                    return at + inner
            at += part.width
        return at

    def write(
        self, systems: Any, columns: np.ndarray, component: np.ndarray, interval: np.ndarray,
        part: np.ndarray, body: np.ndarray, tables: list[Any],
    ) -> None:  # fmt: skip
        """Write into columns which components are moved, (n, side), -1 for none, in which interval, and the
        part of the table that counts: its first and last interval, (2, n).  tables : of all systems.
        """
        rows = {name: systems.place[places] for name, places in self.places.items()}
        some, slot = np.nonzero(component >= 0)
        columns[rows["moved"][component[some, slot]] + 1 + slot, some] = 1.0
        columns[rows["where_moved"]] = interval
        if self.table.outside == "repeat":
            return
        columns[rows["where_moved"]] -= part[0]
        for i, table in enumerate(tables):
            mine = slice(None) if len(tables) == 1 else np.flatnonzero(body == i)
            first, last = part[:, mine]
            knots, jumps = np.asarray(table.knots), np.asarray(table.jumps)[: int(table.jumping)]
            before = np.searchsorted(jumps, knots[first], "left")
            many = np.searchsorted(jumps, knots[last + 1], "right") - before
            places = {
                "knots": table.knots.place + first,
                "coefficients": table.coefficients.place + first * self.width,
                "jumps": table.jumps.place + np.where(many > 0, before, 0),
                "jumping": many, "intervals": last - first + 1, "last": last - first + 1,
                "at_begin": first == 0, "at_end": last == int(table.intervals) - 1,
            }  # fmt: skip
            for name, numbers in places.items():
                columns[rows[name][0], mine] = numbers


def table_of(system: Any, name: str, caller: str, known: Any = ()) -> tuple[VariedInput, bool] | None:
    """The table that a name means, "torque.values" or "torque.coefficients", and whether values are asked
    for; None for other parameters.  known : tables that were found before.  caller : who asks.
    Raises InvalidInput where a table has coefficients alone.
    """
    before, _, last = name.rpartition(".")
    if last not in ("values", "coefficients") or not before:
        return None
    table = parameter(system, full_name(system, before, caller))
    if not isinstance(table, PiecewisePolynomial):
        return None
    number = next(k for k, x in enumerate(inputs(system)) if x is table)
    found = next((x for x in known if x.number == number), None) or VariedInput(number, table)
    if last == "values" and not table.has_values:
        raise InvalidInput(
            f"{caller}: {name}: values are those of steps (PiecewisePolynomial.constant) and of "
            f"straight lines (.linear); of {table!r} ask for {before}.coefficients, from which those "
            "of values follow by the chain rule"
        )
    return found, last == "values"
