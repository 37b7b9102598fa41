"""Systems and methods whose numbers carry derivatives by parameters: one for each direction, as columns of
numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...compiler.kernel import Several
from ...formulas.dual import Dual
from ...formulas.pytree import build, exchanged, layout_of, leaves
from ...formulas.tables import Table
from ...systems.tabulated import PiecewisePolynomial, inputs
from ...systems.varied_table import varied
from .tangent import LEVEL


class Varied:
    """The systems, or the methods, of all bodies, in directions.

    things : one for all bodies, or one for each.
    slopes : (things, directions, numbers) how their numbers change; direction -1 is that of none.
    moved : the places of numbers that have a slope beside these.
    example : one of them, in numbers that carry a derivative where one changes.
    """

    def __init__(self, things: Sequence[Any], slopes: np.ndarray, moved: Any = ()) -> None:
        self.layout = layout_of(things[0])
        self.things = things
        self.values = np.array([leaves(thing, self.layout) for thing in things], dtype=float)
        none = np.zeros((len(things), 1, self.values.shape[1]))
        self.slopes = np.concatenate([slopes, none], axis=1)
        moves = (self.slopes != 0.0).sum(axis=(0, 1)) > 0
        moves[[*moved]] = True
        self.moves = np.flatnonzero(moves)
        self.tables = [j for j, kind in enumerate(self.layout.kinds) if kind == "table"]
        self.known = [Table.at(x) for x in {*self.values[:, self.tables].ravel().tolist()}]
        self.example = self._built(self.values[0], np.zeros(len(moves)))
        # the numbers of a thing in turn: a value, and behind it its slope if it has one
        self.place = np.arange(len(moves)) + np.cumsum(moves) - moves
        self.height = len(moves) + len(self.moves)

    def _built(self, values: np.ndarray, slopes: np.ndarray) -> Any:
        """The thing with these numbers."""
        numbers: list[Any] = values.tolist()
        for j in self.moves.tolist():
            numbers[j] = Dual(numbers[j], slopes.item(j), LEVEL)
        parts = [
            self._part(numbers[j]) for j in self.tables
        ]  # are alive as long as they are built in
        made = build(self.layout, iter(numbers))
        del parts
        return made

    def _part(self, place: float) -> Table:
        """The table, or the part of one, that lies here."""
        whole = max((t for t in self.known if t.place <= place), key=lambda t: t.place)
        return whole.part(int(place - whole.place)) if whole.place < place else whole

    @property
    def argument(self) -> Any:
        """The argument that drivers get: the thing itself if it is one and nothing of it changes."""
        if len(self.things) == 1 and not len(self.moves):
            return self.example
        return Several((self.example,), np.zeros((self.height, 1)))

    def columns(self, body: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The numbers of bodies in directions, (height, ...)."""
        body = np.minimum(body, len(self.things) - 1)
        found = np.empty((self.height, len(body)))
        found[self.place] = self.values[body].T
        found[self.place[self.moves] + 1] = self.slopes[body, direction][:, self.moves].T
        return found

    def thing(self, column: np.ndarray) -> Any:
        """The thing with the numbers of a column."""
        slopes = np.zeros(len(self.place))
        slopes[self.moves] = column[self.place[self.moves] + 1]
        return self._built(column[self.place], slopes)


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
        return exchanged(system, PiecewisePolynomial, tables)

    def find(self, system: Any) -> None:
        """Find the places of its numbers in those of a system that has it so."""
        mine = inputs(system)[self.number]
        layout, at = layout_of(mine), self._begin(layout_of(system), [self.number])
        for name, part in zip(layout.detail[1], layout.parts, strict=True):
            self.places[name] = np.arange(at, at + part.width)
            at += part.width

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
        self, systems: Varied, columns: np.ndarray, component: np.ndarray, interval: np.ndarray,
        part: np.ndarray, body: np.ndarray, tables: list[Any],
    ) -> None:  # fmt: skip
        """Write into columns which component is moved, -1 for none, in which interval, and the part of the
        table that counts: its first and last interval, (2, ...).  tables : of all systems.
        """
        rows = {name: systems.place[places] for name, places in self.places.items()}
        some = np.flatnonzero(component >= 0)
        columns[rows["moved"][component[some]] + 1, some] = 1.0
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
