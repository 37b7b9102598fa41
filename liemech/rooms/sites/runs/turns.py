"""Runs of splittings of many sites by colours: the sites of one colour turn in place, in one loop over
memory, while the others rest, or all those with a bond of one colour turn at the same time.
"""

from __future__ import annotations

import bisect
import copy
from typing import Any, ClassVar

import numpy as np

from ....compiler.sites.planes import Planes, columns, each, some
from ....errors import NotFinite
from ....formulas import record, where
from ....formulas.classes.records import with_fields
from ....formulas.numbers.conversions import fitted
from ....formulas.sites import SiteTable, rows_of
from ....formulas.tables import Table, entry
from ....simulation.compiled.control import MARK, STUCK, TIME
from ....systems.in_time.inputs import during
from ..parts_of_spins import Bonds, turned_by
from ..spin_splittings import terms_of
from ..steps_together import StepsTogether, copied
from .driver import OVERFLOW
from .failures import ended
from .run import SiteRun

# ------------------------------------------------------------------ the steps


@record
class Turns(StepsTogether):
    """The steps of a splitting by colours, of all sites together: turns, the last of which waits for the first one of the
    next step.  In memory a site has the state at the node, found where it is asked for, the state before the last turn,
    and at place 0 the time that is left for that turn.

    splitting : the method of one body.  group : of one site.  form : the energies.  count : of the turns but the last one.
    numbers : five of each turn: of its energy; where the sites of its colour begin and end, or the colour of its bonds;
    its share of the step; at which share of the step terms are taken that change with time.  last : the share of the
    last turn.  along_bonds : do all sites turn, from one copy of the memory to the last one and back?  Else those of a
    colour turn in place.  ending : where steps are cut; None: nowhere.  looked_into : does the state before a step stay?
    place_of_site : a table.
    """

    splitting: Any
    group: Any
    form: tuple[Any, ...]
    count: float
    numbers: Any
    last: float
    along_bonds: bool
    ending: Any
    looked_into: bool = True
    place_of_site: Any = None

    settles: ClassVar[bool] = True

    __repr__ = StepsTogether.__repr__

    @classmethod
    def of_splitting(cls, way: Any, splitting: Any, system: Any, looked_into: bool) -> Turns:
        """The steps of a splitting.  way : it, or what cuts its steps."""
        motions = splitting._motions(terms_of(system))
        form, numbers = motions.of_site(motions.places)
        rows = [(*numbers[part], share, at) for part, share, at in splitting.turns(motions)]
        last = rows[-1]
        if len(rows) == 1:  # one turn is a step, and leaves nothing
            last = *last[:3], 0.0, 0.0
            rows = [*rows, last]
        count, along_bonds = len(rows) - 1, isinstance(motions, Bonds)
        return cls(
            repr(splitting), splitting, system.group.base, form, float(count), Table(np.array(rows, dtype=float).ravel()),
            last[3], along_bonds, None if way is splitting else way,
            looked_into, SiteTable.of(motions.places.places[None]),
        )  # fmt: skip

    @property
    def copies(self) -> int:
        """The number of copies of the memory: before a step, if that is asked for, behind it, and between turns of bonds."""
        return 1 + self.looked_into + self.along_bonds

    def start(self, system: Any, state: Any, h: float) -> Any:
        """The memory of the splitting, with no turn left to make."""
        return self.splitting.start(system, state, h)

    def observe(self, memory: Any) -> Any:
        """The state at the node."""
        return memory.state

    def step_together(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Any) -> None:
        """A step of all sites, from one copy of the memory to another, cut where an input jumps in it or at its ends."""
        copies = columns(sites, copies=(memory,) * self.copies).copies
        if self.looked_into:
            each(sites, copied, copies.nth(here), copies.nth(there))
        if self.ending is None:
            self.turn(t, h, sites, copies, there)
            return
        time, going = t, True
        cut = self.ending.is_cut(system, t, h)
        if cut:
            during(self, t - h, h, self.ending.beyond).begin_anew(t, sites, copies.nth(there))
        while going:
            time, begin, s, going = self.ending.next_part(system, t, h, time)
            part = during(self, begin, s, self.ending.beyond)
            part.turn(begin, s, sites, copies, there)
            if cut:
                part.begin_anew(begin + s, sites, copies.nth(there))

    def turn(self, t: float, h: float, sites: Any, copies: Any, k: int) -> None:
        """All turns of a step but for the last one, in copy number k of the memory."""
        node, spare = copies.nth(k).fields.node, copies.nth(self.copies - 1).fields.node.nth(0)
        state, left = node.nth(0), node.nth(1)
        for i in range(int(self.count)):
            time = self.share(i) * h
            if i == 0:
                time = left.at(0) + time
            at = t + self.at(i) * h
            if self.along_bonds:
                pair = copies.nth
                odd = i % 2
                source = pair(where(odd == 1, self.copies - 1, k)).fields.node.nth(0)
                target = pair(where(odd == 1, k, self.copies - 1)).fields.node.nth(0)
                self.make(i, at, time, sites, source, target)
            else:
                self.make(i, at, time, sites, state, state)
        for _ in range(int(self.count) % 2 if self.along_bonds else 0):
            each(sites, copied, spare, state)
        left.put(0, fitted(self.last * h, left.layout))

    def make(self, i: int, t: float, time: float, sites: Any, source: Any, target: Any) -> None:
        """Turn number i, at a time and for another, of the states of a column to those of another."""
        which, first, end = self.number(i, 0), self.number(i, 1), self.number(i, 2)
        for n in range(len(self.form)):
            for _ in range(int(which == n)):
                arguments = self, self.form[n], first, t, time, source, target
                if self.along_bonds:
                    each(sites, turned_site, *arguments)
                else:
                    some(sites, first, end, turned_site, *arguments)

    def settle(self, system: Any, t: float, sites: Any, here: int, memory: Any) -> None:
        """Make the last turn, from the states before it to those at the node."""
        self.show(t, sites, columns(sites, copies=(memory,) * self.copies).copies.nth(here))

    def show(self, t: float, sites: Any, memory: Any) -> None:
        """Make the last turn, in a column of the memory."""
        node, state = memory.fields.node, memory.fields.state
        if not self.along_bonds:
            each(sites, copied, node.nth(0), state)
        self.make(int(self.count), t, node.nth(1).at(0), sites, node.nth(0), state)

    def begin_anew(self, t: float, sites: Any, memory: Any) -> None:
        """Make the last turn, and leave none."""
        self.show(t, sites, memory)
        node = memory.fields.node
        each(sites, copied, memory.fields.state, node.nth(0))
        node.nth(1).put(0, fitted(0.0, node.nth(1).layout))

    def number(self, i: int, which: int) -> int:
        """One of the whole numbers of turn number i."""
        return int(entry(self.numbers, 5 * i + which))

    def share(self, i: int) -> float:
        """The share of turn number i."""
        return entry(self.numbers, 5 * i + 3)

    def at(self, i: int) -> float:
        """The share of the step at which turn number i sees terms that change."""
        return entry(self.numbers, 5 * i + 4)


def turned_site(turns: Turns, energy: Any, colour: int, t: float, time: float, source: Any, target: Any) -> None:
    """The turn of one site along its bond of a colour, or along its own energy."""
    target.save(turned_by(energy, turns.group, colour, t, time, source.load()))


# ------------------------------------------------------------------ Python's side


def in_order(rows: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Numbers of sites, (width, sites), in another order: row by row, four times as fast as at once."""
    ordered = np.empty((len(rows), len(places)))
    for row, numbers in zip(rows, ordered):
        np.take(row, places, out=numbers, mode="clip")  # without a copy; all are there
    return ordered


class TurnsRun(SiteRun):
    """One run of a splitting by colours, whose sites lie in memory by their colours."""

    def _planes(self, rows: np.ndarray) -> Planes:
        by_colour = in_order(rows, self.plan._sites.places.sites)
        return Planes(rows_of(by_colour), by_colour.shape[1])

    def _room_for(self, width: int) -> Planes:
        return Planes.of_rows(self.shape.method.copies * width, len(self.plan._sites.places.sites))

    def _in_copy(self, k: int) -> np.ndarray:
        rows = super()._in_copy(k)
        by_site = in_order(rows, self.plan._sites.places.places)
        by_site[-1] = rows[-1, 0]  # the time that is left
        return by_site

    # ---------------------------------------------------------------- states that are not finite

    def _steps(self, turns: int, samples: Any) -> None:
        """Some more steps, up to the last one after which all numbers are finite."""
        begin = self._beside()
        super()._steps(turns, samples)
        if self._not_finite() is None:
            return
        count = self.taken - begin.taken
        good = bisect.bisect_left(range(1, count + 1), True, key=lambda n: begin._after(n)._not_finite() is not None)
        last = begin._after(good)
        turns_of_step = np.arange(1.0, self.shape.method.count + 1.0).tolist()
        sites = (last._after(1, k)._not_finite(self.shape.state.width) for k in turns_of_step)
        self.overflowed = next((site for site in sites if site is not None), last._after(1)._not_finite())
        self.sites, self.place, self.clocks, self.march = last.sites, last.place, last.clocks, last.march
        self.clocks[MARK] = STUCK
        self.samples.return_to(self.clocks.item(TIME, 0))

    def _after(self, steps: int, count: float | None = None) -> Any:
        """A run beside this one, so many steps further on.  count : of the turns that a step makes; None for all."""
        beside = self._beside(steps)
        if count is not None:
            beside.shape = copy.copy(beside.shape)
            procedure = beside.shape.procedure
            beside.shape.procedure = with_fields(procedure, method=with_fields(procedure.method, count=count))
        SiteRun._steps(beside, steps, beside.samples)
        return beside

    def _not_finite(self, first: int = 0) -> int | None:
        """The first of the sites with a number that is not finite, from a row of the memory on."""
        bad = self.plan._sites.places.sites[~np.isfinite(super()._in_copy(self._copy)[first:]).all(axis=0)]
        return int(bad.min()) if len(bad) else None

    def _sound(self, samples: int, seen: np.ndarray) -> int:
        finite = np.isfinite(seen)
        return samples if finite.all() else int(np.argmin(finite.reshape(samples, -1).all(axis=1)))

    def _fail(self) -> None:
        """A state that is not finite ends the run."""
        error: Any = NotFinite(OVERFLOW)
        if self.overflowed is not None:
            error.site = self.overflowed
        raise ended(self, error, f"after step {self.taken}, t = {self.clocks.item(TIME, 0):g}")
