"""Samples of runs of many sites, as the driver writes them: one behind the other."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....compiler.sites.planes import Planes
from ....simulation.keep import with_room
from .driver import ENDS

SEEN, ROOM = 256, 2**21
"""Steps, and numbers of all sites at their ends, that are made before somebody looks at them."""


MOST = 2**12
"""Samples of a call at most."""


class EndsOfSteps:
    """Where some steps begin, and their ends: times, what is kept of all sites, and totals, which the driver writes
    one behind the other.

    made : how many there are.  room : steps at most.
    """

    def __init__(self, shape: Any, count: int, room: int = SEEN) -> None:
        self.wide, self.count, self.made = shape.shown.layout.width if shape.shown.kept else 0, count, 0
        self.room = max(1, min(room, ROOM // (max(1, self.wide) * count)))
        self.planes = Planes.of_rows(max(1, (self.room + 1) * self.wide), count)
        self.times, self.totals = np.zeros(self.room + 1), np.zeros((self.room + 1, shape.shown.totals.width))

    @property
    def rows(self) -> np.ndarray:
        """The samples kept of all sites, (made, width, sites), a view."""
        array = self.planes.array
        return array[: self.made * self.wide].reshape(self.made, self.wide, array.shape[1])[..., : self.count]

    def go_on(self, t: float) -> None:
        """Let the last end be the beginning of further steps, at this time."""
        if self.made:
            last = self.made - 1
            self.planes.array[: self.wide] = self.planes.array[last * self.wide : self.made * self.wide]
            self.times[0], self.totals[0], self.made = t, self.totals[last], 1

    def return_to(self, t: float) -> None:
        """Forget the ends of steps beyond the first one."""
        self.made = 1

    def ahead(self, back: float) -> tuple[Planes, np.ndarray, np.ndarray]:
        """Where the driver writes the ends of the next steps, from the last one on: all sites, totals and times."""
        made = max(self.made - 1, 0)
        return Planes(self.planes.array[made * self.wide :], self.count), self.totals[made:], self.times[made:]

    def take(self, new: int, seen: Planes, totals: np.ndarray) -> None:
        """Take up so many that the driver has written, with the one that was there."""
        if new:
            self.made = max(self.made - 1, 0) + new


class SamplesOfSites:
    """States of all sites, or of some, and totals, at given times.

    asked, times : as they were asked for, and as the driver meets them.  made : how many there are.
    chosen : the sites of which states are kept; None for all.  wide : the numbers of a state that are kept.
    beside : None, or what looks at every sample, by the number of the first one and rows of numbers.
    at_ends : totals of both copies of the memory, where events are watched.
    """

    def __init__(self, shape: Any, count: int, asked: Any, times: Any, chosen: Any = None, beside: Any = None) -> None:
        self.asked, self.times, self.count, self.chosen, self.beside = asked, times, count, chosen, beside
        self.wide, self.made = shape.state.width if shape.keeps else 0, 0
        self.seen = Planes.of_rows(max(1, self.wide * (len(times) if chosen is None else 1)), count)
        self.own = np.empty((0 if chosen is None else len(times), self.wide, len(chosen or ())))
        self.totals = np.zeros((len(times), shape.shown.totals.width))
        self.at_ends = np.zeros((ENDS if shape.watched else 0, shape.shown.totals.width))

    @property
    def t(self) -> np.ndarray:
        """The times of those that are there."""
        return self.asked[: self.made].copy()

    @property
    def rows(self) -> np.ndarray:
        """The numbers of all sites in those that are there, (made, wide, sites)."""
        return self._first(self.made, self.seen)

    def _first(self, n: int, seen: Planes) -> np.ndarray:
        """The numbers of the first samples of some, a view."""
        return seen.array[: n * self.wide].reshape(n, self.wide, seen.array.shape[1])[..., : self.count]

    @property
    def due(self) -> float:
        """When the next one is; nan: never."""
        return self.times.item(self.made) if self.made < len(self.times) else np.nan

    def ahead(self, back: float) -> tuple[Planes, np.ndarray, np.ndarray]:
        """Where the driver writes the next ones, states and totals, and their times, with a nan behind them.

        back : a time that every step goes beyond.
        """
        made, seen = self.made, self.seen
        end = made + (MOST if self.chosen is None else 1)
        times = np.append(self.times[made:end], back if end < len(self.times) else np.nan)
        if self.chosen is None:
            seen = Planes(seen.array[made * self.wide :], self.count)
        return seen, np.zeros((len(self.at_ends) + len(times), self.totals.shape[1])), times

    def take(self, new: int, seen: Planes, totals: np.ndarray) -> None:
        """Take up so many that the driver has written."""
        ends = len(self.at_ends)
        self.at_ends[:] = totals[:ends]
        self._add(self._first(new, seen), totals[ends : ends + new])

    def keep(self, rows: np.ndarray, totals: np.ndarray) -> None:
        """Take some more, of which these are the numbers, (n, width, sites), and the totals; or one, (width, sites)."""
        rows = rows.reshape(-1, *rows.shape[-2:])
        if self.chosen is None and self.wide:
            planes_of_samples = self.seen.array[self.made * self.wide :][: len(rows) * self.wide]
            planes_of_samples = planes_of_samples.reshape(*rows.shape[:2], planes_of_samples.shape[1])
            planes_of_samples[..., : self.count], planes_of_samples[..., self.count :] = rows, rows[..., -1:]
        self._add(rows, totals)

    def _add(self, rows: np.ndarray, totals: np.ndarray) -> None:
        first, self.made = self.made, self.made + len(rows)
        self.totals[first : self.made] = totals
        if self.chosen is not None:
            self.own[first : self.made] = rows[..., self.chosen]
        if self.beside is not None:
            self.beside(first, rows)

    def return_to(self, t: float) -> None:
        """Forget the samples beyond a time."""
        first = self.times[:1]
        self.made = int((np.abs(self.times[: self.made] - first) <= np.abs(t - first)).sum())

    def end_at(self, t: float) -> None:
        """Let the next sample be the last, at this time."""
        self.asked = np.append(self.asked[: self.made], t)
        self._have_room(len(self.asked))

    def more(self, t: float) -> None:
        """Ask for a sample at one more time, behind the others."""
        self.asked = self.times = np.append(self.times, t)
        self._have_room(len(self.times))

    def _have_room(self, samples: int) -> None:
        """Make room for so many samples."""
        self.totals = with_room(self.totals, samples)
        if self.chosen is None:
            self.seen = Planes(with_room(self.seen.array, samples * self.wide), self.count)
        else:
            self.own = with_room(self.own, samples)

    def kept_of(self, rows: np.ndarray) -> np.ndarray:
        """The numbers of chosen sites, or of all, that samples keep of states."""
        if self.chosen is not None:
            return rows[:, self.chosen]
        return rows if self.wide else rows[:, :0]
