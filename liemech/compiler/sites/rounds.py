"""All pairs of sites, each of them once: native code takes eights of sites, which meet in a ring.

The order is that of `formulas.sites.chains_of_partners`.  These words are for native code alone; plain Python
lets every site ask for all its partners.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NoReturn

from ...formulas.classes.layouts import Layout
from ...formulas.sites import EIGHT, Meeting, period_of


@dataclasses.dataclass(eq=False)
class Rounds:
    """A sum over all pairs."""

    meeting: Meeting  # with what sites have published
    rows: list[Any]  # of memory, with the partial sums of the sites
    layout: Layout  # of a sum


def of_eight(pairs: Rounds, formula: Any, i: int, first: int, last: int, count: int, turns: int) -> None:
    """Add the terms of all pairs of the eight sites from i on and the sites from `first` to `last`.  count : of all
    sites.
    """
    a, sums_of_a = seen(pairs, i), sums(pairs, i)
    for j in range(first, last, EIGHT):
        b, sums_of_b, period = seen(pairs, j), sums(pairs, j), turns
        if 2 * (count - j) <= EIGHT:
            period = period_of(count - j)
            b, sums_of_b = repeated(b, period), only(sums_of_b, period)
        for turn in range(period):
            if apart(i, j, turn, period):
                of_a, of_b = formula(a, b)
                sums_of_a, sums_of_b = sums_of_a + of_a, sums_of_b + of_b
            b, sums_of_b = turned(b), turned(sums_of_b)
        if period < EIGHT:
            sums_of_b = folded(sums_of_b, period)
        if i < j:
            keep(pairs, j, sums_of_b)
    keep(pairs, i, sums_of_a)


def seen(pairs: Rounds, j: int) -> Any:
    """The values published by the eight sites from site j on."""
    _native()


def sums(pairs: Rounds, j: int) -> Any:
    """The partial sums of the eight sites from site j on."""
    _native()


def keep(pairs: Rounds, j: int, value: Any) -> None:
    """Store the partial sums of the eight sites from site j on."""
    _native()


def turned(value: Any) -> Any:
    """The numbers of eight sites, rotated by one place: each goes to the place before its own, the first to the last."""
    _native()


def apart(i: int, j: int, turn: int, period: int) -> bool:
    """Whether the sites from i on, and those from j on rotated by `turn` places, are different and exist; by place."""
    _native()


def repeated(value: Any, period: int) -> Any:
    """The first `period` of eight numbers, repeated over eight places."""
    _native()


def only(value: Any, period: int) -> Any:
    """The first `period` of eight numbers, and zeros."""
    _native()


def folded(value: Any, period: int) -> Any:
    """The sums, by halves, of the numbers of eight places that are whole periods apart."""
    _native()


def _native() -> NoReturn:
    raise NotImplementedError("a word of native code")
