"""A published number beside ours."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any, NamedTuple

from ...errors import InvalidInput
from . import RESULTS


class Compared(NamedTuple):
    """A published number and the one computed now.

    within : how far the computed one may be from it, by the digits that the source prints; None where the published number is an
    error, which the computed one must not exceed.
    """

    quantity: str
    published: float
    computed: float
    within: float | None = None

    @property
    def part(self) -> float:
        """The distance between both beside what it may be, or the error beside the published one."""
        if self.within is None:
            return abs(self.computed) / self.published
        return abs(self.computed - self.published) / self.within

    @property
    def holds(self) -> bool:
        """Whether it is the published number, or an error no larger."""
        return self.part <= 1.0


class Reproduced(NamedTuple):
    """A result: its source, the rows, and the seconds they took."""

    source: str
    rows: tuple[Compared, ...]
    seconds: float

    @property
    def holds(self) -> bool:
        """Whether all of its rows hold."""
        return all(row.holds for row in self.rows)

    def __str__(self) -> str:
        width = max(len(row.quantity) for row in self.rows)
        lines = [f"Source: {self.source}", "", f"  {'':<{width}}  {'published':>18}  {'ours':>18}"]
        for row in self.rows:
            sign = "" if row.holds else "   NOT REPRODUCED"
            limit = "at most " if row.within is None else ""
            lines.append(
                f"  {row.quantity:<{width}}  {limit + f'{row.published:.12g}':>18}  {row.computed:>18.12g}{sign}"
            )
        return "\n".join([*lines, "", f"{'reproduced' if self.holds else 'NOT REPRODUCED'} in {self.seconds:.2g} s"])


def file_of(name: str) -> Any:
    """The file of a result.  Raises InvalidInput for a name that is none."""
    if name not in RESULTS:
        raise InvalidInput(f"there is no published result {name!r}; there are {', '.join(RESULTS)}")
    return import_module(f".{RESULTS[name]}", __package__)


def title_of(name: str) -> str:
    """The title of a result, a sentence."""
    return str(file_of(name).__doc__).partition("\n")[0]


def limit(values: Sequence[Any]) -> Any:
    """The limit of values from steps that are halved, whose errors are even powers of them: Romberg's."""
    for k in range(1, len(values)):
        values = [b + (b - a) / (4**k - 1) for a, b in itertools.pairwise(values)]
    return values[0]


def reproduced(name: str, full: bool = False) -> Reproduced:
    """A published result, computed now.  full : with the rows that take minutes."""
    file, started = file_of(name), time.perf_counter()
    rows: Iterable[Compared] = file.compared(full)
    return Reproduced(file.SOURCE, tuple(rows), time.perf_counter() - started)
