"""Tables of inputs by whose values a motion is differentiated."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas.classes.layouts import build, layout_of, leaves
from ...formulas.classes.records import with_records
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

    def by(self, slopes: np.ndarray, values: bool) -> np.ndarray:
        """The derivative by the coefficients in their shape, or by the values.

        slopes : (bodies, intervals, coefficients), the derivative by the coefficients.
        """
        table = self.table
        shape = table.degree + 1, *([table.size] if table.size else [])
        slopes = slopes.reshape(*slopes.shape[:2], *shape)
        if not values:
            return slopes
        if table.degree == 0:
            return slopes[:, :, 0]
        width = np.diff(np.asarray(table.knots)).reshape(-1, *[1] * (len(shape) - 1))
        ends = np.zeros((slopes.shape[0], slopes.shape[1] + 1, *shape[1:]))
        ends[:, :-1] += slopes[:, :, 0] - slopes[:, :, 1] / width
        ends[:, 1:] += slopes[:, :, 1] / width
        return ends

    def in_system(self, system: Any) -> Any:
        """The system with this table as a VariedTable."""
        tables = inputs(system)
        tables[self.number] = varied(tables[self.number])
        return with_records(system, PiecewisePolynomial, tables)

    def find(self, system: Any) -> None:
        """Set `places`, of the numbers of the VariedTable among those of the system."""
        table = inputs(system)[self.number]
        layout, at = layout_of(table), self._begin(layout_of(system), [self.number])
        for name, part in zip(layout.detail[1], layout.parts, strict=True):
            self.places[name] = np.arange(at, at + part.width)
            at += part.width

    def moves(self, system: Any) -> list[tuple[Any, int]]:
        """For every coefficient of every interval the system in which this interval is varied, and the place of the
        perturbation of this coefficient.
        """
        layout, systems_and_places = layout_of(system), []
        for interval in range(int(self.table.intervals)):
            numbers = leaves(system, layout)
            numbers[self.places["where_moved"][0]] = float(interval)
            moved = build(layout, iter(numbers))
            systems_and_places += [(moved, int(place)) for place in self.places["moved"]]
        return systems_and_places

    def _begin(self, layout: Any, left: list[int]) -> int:
        """The offset of the numbers of the table in this part of a layout.  left : a list of the number of tables
        before it, -1 once it was met.
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
        """Write the varied coefficients into columns of systems.

        component : (n, side), the numbers of the coefficients; -1 for none.  interval : (n,), theirs.  part : (2, n),
        the first and the last interval over the steps.  tables : of all systems.
        """
        rows = {name: systems.place[places] for name, places in self.places.items()}
        column, slot = np.nonzero(component >= 0)
        columns[rows["moved"][component[column, slot]] + 1 + slot, column] = 1.0
        columns[rows["where_moved"]] = interval
        if self.table.outside == "repeat":
            return
        columns[rows["where_moved"]] -= part[0]
        for i, table in enumerate(tables):
            columns_of_table = slice(None) if len(tables) == 1 else np.flatnonzero(body == i)
            first, last = part[:, columns_of_table]
            knots, jumps = np.asarray(table.knots), np.asarray(table.jumps)[: int(table.jumping)]
            before = np.searchsorted(jumps, knots[first], "left")
            jumping = np.searchsorted(jumps, knots[last + 1], "right") - before
            places = {
                "knots": table.knots.place + first,
                "coefficients": table.coefficients.place + first * self.width,
                "jumps": table.jumps.place + np.where(jumping > 0, before, 0),
                "jumping": jumping, "intervals": last - first + 1, "last": last - first + 1,
                "at_begin": first == 0, "at_end": last == int(table.intervals) - 1,
            }  # fmt: skip
            for name, numbers in places.items():
                columns[rows[name][0], columns_of_table] = numbers


class Tables:
    """The tables by which a motion is differentiated.

    by_name : of "torque.values" or "torque.coefficients", the table and whether it is by its values.  each : each table
    once.  Raises InvalidInput for values of a table that has coefficients alone.  caller : for messages.
    """

    def __init__(self, system: Any, names: Iterable[str], caller: str) -> None:
        self.by_name: dict[str, tuple[VariedInput, bool]] = {}
        self.each: list[VariedInput] = []
        for name in names:
            before, _, last = name.rpartition(".")
            if last not in ("values", "coefficients") or not before:
                continue
            table = parameter(system, full_name(system, before, caller))
            if not isinstance(table, PiecewisePolynomial):
                continue
            if last == "values" and not table.has_values:
                raise InvalidInput(
                    f"{caller}: {name}: values are those of steps (PiecewisePolynomial.constant) and of "
                    f"straight lines (.linear); of {table!r} ask for {before}.coefficients, from which those "
                    "of values follow by the chain rule"
                )
            number = next(k for k, x in enumerate(inputs(system)) if x is table)
            if number not in [x.number for x in self.each]:
                self.each.append(VariedInput(number, table))
            self.by_name[name] = next(x for x in self.each if x.number == number), last == "values"

    def in_system(self, system: Any) -> Any:
        """The system with VariedTables in their place."""
        for table in self.each:
            system = table.in_system(system)
        return system

    def find(self, system: Any) -> None:
        """Set the places of the numbers of all among those of the system."""
        for table in self.each:
            table.find(system)
