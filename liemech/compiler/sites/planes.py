"""Loops over sites for drivers, in plain Python and, by the compiler, in native code: every site of
one system has a place in every row of numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import Layout
from ...formulas.columns import columns_of
from ...formulas.sites import each_site, padded, present_site, room, some_sites
from ..driver import read, write


@frozen(eq=False)
class Planes:
    """Numbers of all sites of one system: number k of site i is array[k, i].

    count : of sites; the rows are `padded` by numbers of the last one.
    """

    array: np.ndarray
    count: int

    @classmethod
    def of_rows(cls, rows: int, count: int) -> Planes:
        """Planes of zeros, as many as `rows`."""
        return cls(room(rows, padded(count)), count)


def each(planes: Planes, formula: Callable[..., None], *args: Any) -> None:
    """Run a formula for every site.  In it sites meet, and `load` and `save` are for the site."""
    each_site(planes.count, formula, *args)


def some(planes: Planes, begin: int, end: int, formula: Callable[..., None], *args: Any) -> None:
    """Run a formula for the sites from begin to end, whole groups of sixteen, while the others rest.
    They meet once, with values that lie in planes, and may save in place what no other of them asks
    for.
    """
    some_sites(planes.count, begin, end, formula, *args)


def load(planes: Planes, k: int, layout: Layout) -> Any:
    """Value number k of this site: values of one layout lie one behind the other.

    Native code may load it again: nothing is saved before the sites have met for the last time.
    """
    rows = slice(k * layout.width, (k + 1) * layout.width)
    return read(np.ascontiguousarray(planes.array[rows, present_site()]), 0, layout)


def save(planes: Planes, k: int, value: Any, layout: Layout) -> None:
    """Set value number k of this site, after the last meeting."""
    numbers = np.empty(layout.width)
    write(numbers, 0, value, layout)
    planes.array[k * layout.width : (k + 1) * layout.width, present_site()] = numbers


def columns(planes: Planes, **parts: Any) -> Any:
    """The columns of values by name, `Column`, that lie one behind the other.

    parts : their layouts; of several values alike a tuple, of which `nth` is a column.
    """
    return columns_of(planes.array, parts)


def at(planes: Planes, i: int, k: int, layout: Layout) -> Any:
    """Value number k of site i.  In a loop over sites it is one that the loop does not save."""
    rows = slice(k * layout.width, (k + 1) * layout.width)
    return read(np.ascontiguousarray(planes.array[rows, i]), 0, layout)
