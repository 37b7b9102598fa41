"""Iterators of formulas: what `iter`, `zip`, `map`, `enumerate`, `reversed`, `filter` and generator
expressions give.

How far an iterator has come is known while translating, so it must be the same on every way that
control may take: one that is advanced on one way of a branch, or in a loop of unknown length, is
refused after it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ...errors import NotCompilable

Region = tuple[tuple[int, bool], ...]
"""Where control is: the branches and loops of unknown length around, each with a number of its own
and whether it is a loop.
"""


class ItemStream:
    """An iterator: a list of items of which some are taken, or a generator, which cannot go back.

    sources : what the items are taken from; None if they may be computed from anything.
    """

    def __init__(self, items: list[Any] | Iterator[Any], region: Region, sources: tuple[Any, ...] | None) -> None:
        self.items, self.region, self.taken, self.sources = items, region, 0, sources
        self.refusal = ""

    def __repr__(self) -> str:
        return "an iterator"

    def take(self, region: Region) -> Any:
        """The next item; raises StopIteration."""
        between = region[len(self.region) :]
        if not self.refusal and region[: len(self.region)] != self.region:
            self.refusal = "is advanced on one way of a branch and again after it"
        if not self.refusal and any(loop for _, loop in between):
            self.refusal = "made outside of a loop of unknown length is advanced in it"
        if self.refusal:
            raise NotCompilable(f"an iterator that {self.refusal}: take its items with `list(...)` and an index")
        if isinstance(self.items, list):
            if self.taken >= len(self.items):
                raise StopIteration
            item = self.items[self.taken]
        else:
            item = next(self.items)
        self.region, self.taken = region, self.taken + 1
        return item

    def back_to(self, taken: int, region: Region) -> None:
        """Give back the items taken since a snapshot, from which the translation starts again."""
        if self.taken != taken:
            if not isinstance(self.items, list):
                self.refusal = "computes its items is advanced in a loop of unknown length"
            self.taken, self.region = taken, region

    def part_ways(self, taken: int) -> None:
        """Refuse further items where two ways meet of which only one has taken some."""
        if self.taken != taken and not self.refusal:
            self.refusal = "is advanced in a loop that may end early, and again after it"
