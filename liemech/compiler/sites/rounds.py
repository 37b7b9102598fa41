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
    """A sum over all pairs.

    meeting : what sites have published.  rows : of memory, with what every site has got so far.
    layout : of that.
    """

    meeting: Meeting
    rows: list[Any]
    layout: Layout


def of_eight(pairs: Rounds, formula: Any, i: int, first: int, last: int, count: int, turns: int) -> None:
    """The pairs of eight sites from i on with those from first to last, of so many sites."""
    a, mine = seen(pairs, i), sums(pairs, i)
    for j in range(first, last, EIGHT):
        b, theirs, period = seen(pairs, j), sums(pairs, j), turns
        if 2 * (count - j) <= EIGHT:
            period = period_of(count - j)
            b, theirs = repeated(b, period), only(theirs, period)
        for turn in range(period):
            if apart(i, j, turn, period):
                of_a, of_b = formula(a, b)
                mine, theirs = mine + of_a, theirs + of_b
            b, theirs = turned(b), turned(theirs)
        if period < EIGHT:
            theirs = folded(theirs, period)
        if i < j:
            keep(pairs, j, theirs)
    keep(pairs, i, mine)


def seen(pairs: Rounds, j: int) -> Any:
    """Numbers that eight sites have published, from site j on."""
    _native()


def sums(pairs: Rounds, j: int) -> Any:
    """The sums so far of eight sites, from site j on."""
    _native()


def keep(pairs: Rounds, j: int, value: Any) -> None:
    """Set the sums of eight sites, from site j on."""
    _native()


def turned(value: Any) -> Any:
    """Numbers of eight sites, each in the place before its own, the first one in the last."""
    _native()


def apart(i: int, j: int, turn: int, period: int) -> bool:
    """Whether sites i and j, the latter turned `turn` times, are two different sites, both of which exist."""
    _native()


def repeated(value: Any, period: int) -> Any:
    """Numbers of the first sites of eight, again and again."""
    _native()


def only(value: Any, period: int) -> Any:
    """Numbers of the first sites of eight, and zeros."""
    _native()


def folded(value: Any, period: int) -> Any:
    """The sums of the numbers of eight places that are whole periods apart, by halves."""
    _native()


def _native() -> NoReturn:
    raise NotImplementedError("a word of native code")
