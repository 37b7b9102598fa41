"""Systems and methods whose numbers carry derivatives by parameters: one for each direction, as columns of
numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...compiler.kernel import Several
from ...formulas import Vec
from ...formulas.classes.layouts import build, layout_of, leaves
from ...formulas.numbers.dual import Dual
from ...formulas.tables import Table
from .frames import LEVEL


class Varied:
    """The systems, or the methods, of all bodies, with derivatives of their numbers along directions.

    things : one for all bodies, or one for each.  slopes : (things, directions, numbers), the derivatives; direction -1
    has none.  moved : the places of further numbers that have a slope.  side : the number of directions along which a
    number carries derivatives.  example : one of the things, whose numbers carry derivatives where they have some.
    """

    def __init__(self, things: Sequence[Any], slopes: np.ndarray, moved: Any = (), side: int = 1) -> None:
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
        self.side = side
        self.example = self._built(self.values[0], np.zeros((len(moves), side)))
        # the numbers of a thing in turn: a value, and behind it its slopes if it has some
        self.place = np.arange(len(moves)) + side * (np.cumsum(moves) - moves)
        self.height = len(moves) + side * len(self.moves)

    def _built(self, values: np.ndarray, slopes: np.ndarray) -> Any:
        """The thing with these numbers."""
        numbers: list[Any] = values.tolist()
        for j in self.moves.tolist():
            numbers[j] = Dual(numbers[j], Vec(*slopes[j].tolist()), LEVEL)
        parts = [self._part(numbers[j]) for j in self.tables]  # are alive as long as they are built in
        thing = build(self.layout, iter(numbers))
        del parts
        return thing

    def _part(self, place: float) -> Table:
        """The table, or the part of one, at this place in memory."""
        whole = max((t for t in self.known if t.place <= place), key=lambda t: t.place)
        return whole.part(int(place - whole.place)) if whole.place < place else whole

    @property
    def argument(self) -> Any:
        """The argument that drivers get: the thing itself if it is one and nothing of it changes."""
        if len(self.things) == 1 and not len(self.moves):
            return self.example
        return Several((self.example,), np.zeros((self.height, 1)))

    def columns(self, body: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The numbers of bodies, each in `side` directions, (n, side): (height, n)."""
        body = np.minimum(body, len(self.things) - 1)
        columns = np.empty((self.height, len(body)))
        columns[self.place] = self.values[body].T
        for s, along in enumerate(direction.T):
            columns[self.place[self.moves] + 1 + s] = self.slopes[body, along][:, self.moves].T
        return columns

    def thing(self, column: np.ndarray) -> Any:
        """The thing with the numbers of a column."""
        slopes = np.zeros((len(self.place), self.side))
        slopes[self.moves] = column[self.place[self.moves][:, None] + 1 + np.arange(self.side)]
        return self._built(column[self.place], slopes)
