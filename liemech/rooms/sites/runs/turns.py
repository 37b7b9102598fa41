"""Runs of splittings of many sites by colours: the sites of one colour turn in place, in one loop over
memory, while the others rest, or all those with a bond of one colour turn at the same time.
"""

from __future__ import annotations

import bisect
from typing import Any

import numpy as np

from ....compiler import kernel
from ....compiler.driver import read, write
from ....compiler.sites.planes import Planes, each, load, save, some
from ....errors import NotFinite
from ....formulas import Record, record
from ....formulas.classes.layouts import NUMBER
from ....formulas.classes.records import with_fields
from ....formulas.sites import padded, rows_of
from ....formulas.tables import Table, entry
from ....integrators.ending_at_jumps import jumps_between, uncut
from ....simulation.compiled.control import MARK, STUCK, TAKEN, TIME
from ....systems.in_time.inputs import during
from ....systems.in_time.knots import NEAR
from ..parts_of_spins import Bonds, turned_by
from ..spin_splittings import terms_of
from .driver import OVERFLOW
from .execution import SiteExecution
from .run import SiteRun
from .totals import totals_in

ROWS = 2**21
"""Numbers of states that are made before they are looked into."""

# ------------------------------------------------------------------ the drivers


@record
class Turns(Record):
    """The turns of a step: for each five numbers, of which the first is the energy that makes it, and the last two are
    its share of the step, and at which share of it terms are taken that change with time.

    The first one begins with what the step before has left, which is the share `last`.

    group, layout : of one site and of its state.  form : the energies.  count : of the turns.  in_place : do the sites of a
    colour turn while the others rest?  The numbers in between are where these begin and end; else all sites turn from one
    copy to the other, along bonds of one colour, the second number.  name : of the method.
    """

    group: Any
    layout: Any
    form: tuple[Any, ...]
    count: float
    numbers: Any
    last: float
    in_place: bool
    name: str = ""

    def __repr__(self) -> str:
        return self.name

    def make(self, k: int, t: float, time: float, sites: Any, here: int, there: Any, row: int) -> None:
        """Turn number k, at a time and for another, from one copy of the sites to a row of others."""
        which, first, end = self.number(k, 0), self.number(k, 1), self.number(k, 2)
        for i in range(len(self.form)):
            for _ in range(int(which == i)):
                given = self, self.form[i], first, t, time, sites
                if self.in_place:
                    some(sites, first, end, turned_site, *given, 0, there, row)
                else:
                    each(sites, turned_site, *given, here, there, row)

    def after(self, here: int) -> int:
        """The copy in which the sites are after a turn."""
        return here if self.in_place else 1 - here

    def number(self, k: int, which: int) -> int:
        """One of the whole numbers of turn number k."""
        return int(entry(self.numbers, 5 * k + which))

    def share(self, k: int) -> float:
        """The share of turn number k."""
        return entry(self.numbers, 5 * k + 3)

    def at(self, k: int) -> float:
        """The share of the step at which turn number k sees terms that change."""
        return entry(self.numbers, 5 * k + 4)


def turned_site(
    turns: Turns, energy: Any, colour: int, t: float, time: float, sites: Any, here: int, there: Any, row: int
) -> None:
    """The turn of one site along its bond of a colour, or along its own energy."""
    state = load(sites, here, turns.layout)
    save(there, row, turned_by(energy, turns.group, colour, t, time, state), turns.layout)


def copied_site(sites: Any, here: int, there: Any, row: int, layout: Any) -> None:
    """A site as it is."""
    save(there, row, load(sites, here, layout), layout)


def advance_turns(
    turns: Turns, h: float, t0: float, steps: int, samples: int, shown: int, sites: Any, seen: Any, clock: Any
) -> None:
    """The driver: `samples` times so many steps, and a sample if it is to be shown, 1; 0 if not.

    t0 : the time of step 0.  sites : before the last turn of a step.
    clock : the time that is left for it, the copy in which they are, the number of steps made.
    seen : the states, one sample behind the other.
    """
    for k in range(samples):
        left, here = read(clock, 0, NUMBER), int(read(clock, 1, NUMBER))
        taken = read(clock, 2, NUMBER)
        for n in range(steps):
            t = t0 + (taken + n) * h
            for i in range(int(turns.count)):
                time = turns.share(i) * h
                if i == 0:
                    time = left + time
                there = turns.after(here)
                turns.make(i, t + turns.at(i) * h, time, sites, here, sites, there)
                here = there
            left = turns.last * h
        taken = taken + steps
        write(clock, 0, left, NUMBER)
        write(clock, 1, float(here), NUMBER)
        write(clock, 2, taken, NUMBER)
        for _ in range(shown):
            each(sites, copied_site, sites, here, seen, k, turns.layout)
            turns.make(int(turns.count), t0 + taken * h, left, sites, here, seen, k)


# ------------------------------------------------------------------ Python's side


def in_order(rows: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Numbers of sites, (..., sites), in another order: row by row, four times as fast as at once."""
    found = np.empty((*rows.shape[:-1], len(places)))
    for row in np.ndindex(rows.shape[:-1]):
        np.take(rows[row], places, out=found[row], mode="clip")  # without a copy; all are there
    return found


class TurnsOfSplitting:
    """The steps of a splitting of sites: the places, the turns of a step, and the native code that
    makes them.
    """

    def __init__(self, plan: Any, layout: Any) -> None:
        steps, system = plan._steps, plan._one
        method = uncut(steps.way_of(0))
        motions = method._motions(terms_of(system))
        self.places = motions.places
        form, numbers = motions.of_site(self.places)
        rows = [(*numbers[part], share, at) for part, share, at in method.turns(motions)]
        in_place = not isinstance(motions, Bonds)
        self.copies = 1 if in_place else 2
        last = rows[-1]
        if len(rows) == 1:  # one turn is a step, and leaves nothing
            last = *last[:3], 0.0, 0.0
            rows = [*rows, last]
        table = Table(np.array(rows, dtype=float).ravel())
        given = system.group.base, layout, form, len(rows) - 1.0, table
        turns = Turns(*given, last[3], in_place, repr(method))
        self.arguments = turns, steps.h
        planes, shared = Planes.of_rows(1, 1), kernel.Shared(np.empty(0))
        self.execution = SiteExecution(
            steps.compiled, steps.progress, advance_turns, *self.arguments, 0.0, 1, 1, 1, planes,
            planes, shared,
        )  # fmt: skip

    def spread(self, rows: np.ndarray) -> Planes:
        """Rows of numbers of sites in the order of their places, in the first of the copies."""
        return self.begun(in_order(rows, self.places.sites))

    def begun(self, rows: np.ndarray) -> Planes:
        """Rows of numbers of sites that are in this order already, in the first of the copies."""
        copies = rows if self.copies == 1 else np.tile(rows, (self.copies, 1))
        return Planes(rows_of(copies), rows.shape[-1])


class TurnsRun(SiteRun):
    """One run of a splitting by sublattices: what a site carries along, its state at the node and
    before the last turn, is laid out by colours for as long as native code runs.
    """

    watches = False
    turned: Planes | None = None  # all sites before the last turn of a step, by their places
    clock: np.ndarray
    last: Any = None  # all states at the node, by their places
    before: Any = None  # the sites and the clock before the last call, and how many steps it made
    torn = False  # are the sites further than the steps that were looked into?

    def _room_for(self, width: int) -> Planes:
        """Memory for all sites: one copy, as they turn in place."""
        return Planes.of_rows(width, self.count)

    @property
    def _looks(self) -> bool:
        """Are all steps looked at, for zeros of events, for times inside of them, or for cuts?"""
        return super()._looks or self.fixed_times or self.plan._sites.method is not uncut(self.plan._sites.method)

    def _call(self, turns: int) -> None:
        """Some more steps: those to the next sample or a part of them, or to some samples."""
        if self.steps_seen is not None:
            far = 0 if self.plan.events or not turns else self._free(turns)
            if far > 0:
                self._turned(far, 1, 1)
                self._count(self.last[None], far)
            else:
                super()._call(turns)
            return
        first, times = self.samples.made, self.samples.times
        if not turns:
            self._show(self.shape.shown_rows(self._memory)[None])
            return
        if first == len(times):  # nobody wants one
            wanted, samples, whole = turns, 1, False
        else:
            wanted = int(self.numbers[first]) - self.taken
            samples = 1
            if turns >= 2 * wanted and first + 1 < len(times):
                other = np.diff(self.numbers[first - 1 :]) != wanted
                same = int(np.argmax(other)) if other.any() else len(other)
                samples = max(1, min(same, turns // wanted))
            turns, whole = min(turns, wanted), turns >= wanted
        if self.checkpoint is not None:
            samples = min(samples, max(1, self.checkpoint.within(samples * turns) // turns))
        rows = self._turned(turns, samples if whole else 1, int(whole))
        good = self._count(rows, turns)
        if whole:
            self._show(self.seen(rows[:good]))

    def _show(self, rows: np.ndarray) -> None:
        """Keep the next samples, (samples, width, sites), and what is wanted of them."""
        if len(rows):
            first = self.samples.made
            self.samples.keep(rows, self._totals(rows, self.t0 + self.numbers[first : first + len(rows)] * self.h))

    def _totals(self, rows: np.ndarray, times: Any) -> np.ndarray:
        """Recorded totals over all sites, of states (samples, width, sites)."""
        shown = self.shape.shown
        found = np.zeros((len(rows), shown.totals.width))
        if shown.quantities:
            planes = Planes(rows_of(rows).reshape(-1, padded(self.count)), self.count)
            totals_in(found, self.site, shown, planes, times)
        return found

    def _count(self, rows: np.ndarray, turns: int) -> int:
        """Count steps, so many to each of these states of all sites, up to one that is not finite: how many are."""
        good = len(rows)
        if not np.isfinite(rows).all():
            good = int(np.argmin(np.isfinite(rows).all(axis=(1, 2))))
            self.clocks[MARK] = STUCK
        self.clocks[TAKEN] += turns * good
        self.clocks[TIME] = self.t0 + self.clocks[TAKEN] * self.h
        return good

    # ---------------------------------------------------------------- where all steps are looked at

    def _free(self, turns: int) -> int:
        """How many of the next steps nobody looks into, where there are no events: before the next time, and uncut."""
        turns = min(turns, self.first + self.steps - self.taken)
        wanted = (self.samples.due - self.clocks.item(TIME, 0)) / self.h
        return min(int(min(turns + 1.0, wanted)) - 1, self._uncut(turns))

    def ends(self, turns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if self.last is None:
            self._turned(0, 1, 1)
        first, taken = self.last[None], self.taken
        turns = min(turns if self.plan.events else 1, turns, self.first + self.steps - taken)
        rows = first[1:]
        if turns:
            self.torn = True
            free = min(self._uncut(turns), max(1, ROWS // first.size))
            rows = self._turned(1, free, 1) if free else self._cut()[None]
            rows = rows[: self._count(rows, 1)]
        rows = np.concatenate([first, rows])
        times = self.t0 + (taken + np.arange(len(rows))) * self.h
        return times, rows, self._totals(self.seen(rows), times)

    def seen(self, rows: np.ndarray) -> np.ndarray:
        """States by places as they are shown, (..., width, sites)."""
        order = self.shape.order
        if order != [*range(rows.shape[-2])]:
            rows = rows[..., order, :]
        return in_order(rows, self.shape.turning.places.places)

    def inside_step(self, pair: np.ndarray, begun: float, end: float, at: float) -> tuple[np.ndarray, np.ndarray]:
        order, fresh = self.shape.order, np.zeros_like(pair[0])
        fresh[order] = pair[0][order]
        rows = self.seen(self._moved(fresh, begun, at - begun))
        if not np.isfinite(rows).all():
            raise self._ended(NotFinite(OVERFLOW), f"inside of a step, t = {at:g}")
        return rows, self._totals(rows[None], [at])[0]

    def return_to(self, stand: tuple[np.ndarray, ...], steps: int) -> None:
        """It does not: a run that was interrupted where it was looked at does not go on."""

    def _attend(self) -> None:
        self.torn = False
        super()._attend()

    # ---------------------------------------------------------------- steps that are cut

    def _uncut(self, turns: int) -> int:
        """How many of the next steps are made as they are, as no input jumps in them or at their ends."""
        ending, t, h = self.shape.ending, self.clocks.item(TIME, 0), self.h
        if ending is None:
            return turns
        end = t + turns * h
        near = 2.0 * NEAR * max(abs(t), abs(end))
        low, high = min(t, end) - near, max(t, end) + near
        jumps = jumps_between(ending.method, self.site, self.way.breaks, low, high)
        ahead = [(jump - t) / h for jump in jumps if low <= jump <= high]
        return max(0, int(min([turns, *[n - near / abs(h) for n in ahead]])))

    def _cut(self) -> np.ndarray:
        """The states of all sites after a step that is cut, by their places."""
        self.last = self._moved(self.last, self.clocks.item(TIME, 0), self.h)
        self.turned = self.shape.turning.begun(self.last)
        self.clock = np.array([0.0, 0.0, self.taken + 1.0])
        found: np.ndarray = self.last
        return found

    def _moved(self, rows: np.ndarray, t: float, h: float) -> np.ndarray:
        """The states of all sites, by their places, after a step of any length from others."""
        turning, ending, site = self.shape.turning, self.shape.ending, self.site
        turns = turning.arguments[0]
        for begin, s in [(t, h)] if ending is None else ending.parts(site, t, h):
            seen = turns if ending is None else during(turns, begin, s, ending.beyond)
            start, after = turning.begun(rows), Planes.of_rows(len(rows), rows.shape[1])
            self._make((seen, s, begin, 1, 1, 1, start, after), np.zeros(3))
            rows = after.array[:, : start.count]
        return rows

    # ---------------------------------------------------------------- turns

    def _make(self, arguments: Any, clock: np.ndarray) -> None:
        """Run the driver."""
        execution = self.executing(self.shape.turning.execution)
        left = self.first + self.steps - self.taken
        sites = self.count * max(1, left), arguments[-1].count, self.workers
        self.compiled = execution.drive(sites, arguments, [clock]) is not None or self.compiled

    def _turned(self, turns: int, samples: int, shown: int) -> np.ndarray:
        """The states of all sites after so many steps each, (samples, width, places); if they are not
        to be shown, what the sites carry along.
        """
        shape, width = self.shape, self.shape.beginner.started.width
        if shape.turning is None:
            shape.turning = TurnsOfSplitting(self.plan, shape.beginner.started)
        turning = shape.turning
        if self.turned is None:
            self.turned = turning.spread(self._memory[width : 2 * width])
            self.clock = np.array([self._memory[2 * width, 0], 0.0, self.taken])
        count = self.turned.count
        seen = Planes.of_rows(width * samples * shown, count)
        arguments: Any = *turning.arguments, self.t0, turns, samples, shown, self.turned, seen
        self.notes, self.failures = -1, []
        self.before = self.turned.array.copy(), self.clock.copy(), turns * samples
        self._make(arguments, self.clock)
        if not shown:
            self.last = None
            return self._before_last[None]
        rows = seen.array.reshape(-1, width, seen.array.shape[1])[..., :count]
        self.last = rows[-1]
        return rows

    @property
    def _before_last(self) -> np.ndarray:
        """The states of all sites before the last turn of a step, (width, places)."""
        planes: Any = self.turned
        width = self.shape.beginner.started.width
        begin = int(self.clock[1]) * width
        found: np.ndarray = planes.array[begin : begin + width, : planes.count]
        return found

    def carry(self, *given: Any) -> Any:
        """With what a run goes on; nothing where it was interrupted between steps that are made and those
        that were looked into.
        """
        return None if self.torn else super().carry(*given)

    def lay_down(self) -> None:
        if self.turned is not None:
            here, width = self.shape.turning.places.places, self.shape.beginner.started.width
            memory = self._memory
            last = self._turned(0, 1, 1)[0] if self.last is None else self.last
            memory[:width] = in_order(last, here)
            memory[width : 2 * width] = in_order(self._before_last, here)
            memory[2 * width] = self.clock[0]

    def _fail(self) -> None:
        """A state that is not finite ends the run."""
        step, error = self.taken, NotFinite(OVERFLOW)
        site = self._first_not_finite()
        if site is not None:
            error.site = site  # type: ignore[attr-defined]
        raise self._ended(error, f"after step {step}, t = {self.t0 + step * self.h:g}")

    def _first_not_finite(self) -> int | None:
        """The first of the sites whose states are not finite after the first turn that leads to any: the
        last call is made anew, up to the first step that fails, and then that step turn by turn.
        """
        if self.before is None or self.turned is None:
            return None
        array, clock, total = self.before
        turning, width, count = self.shape.turning, self.shape.beginner.started.width, self.turned.count
        turns, h = turning.arguments

        def after(steps: int, number: float = turns.count, shown: int = 1) -> tuple[Any, Any, int | None]:
            """The sites, the clock, and the first site that is not finite, after so many turns of steps."""
            sites, told = Planes(array.copy(), count), clock.copy()
            seen = Planes.of_rows(width * shown, count)
            self._make((with_fields(turns, count=number), h, self.t0, steps, 1, shown, sites, seen), told)
            rows = np.concatenate([sites.array, seen.array])[:, :count]
            bad = turning.places.sites[~np.isfinite(rows).all(axis=0)]
            return sites.array, told, int(bad.min()) if len(bad) else None

        step = bisect.bisect_left(range(1, total + 1), True, key=lambda k: after(k)[2] is not None)
        array, clock, _ = after(step)
        found = (after(1, k, 0)[2] for k in np.arange(1.0, turns.count + 1.0).tolist())
        return next((site for site in found if site is not None), after(1)[2])
