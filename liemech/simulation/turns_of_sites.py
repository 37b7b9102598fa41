"""Runs of splittings of many sites by colours: the sites of one colour turn in place, in one loop over
memory, while the others rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiler import kernel
from ..compiler.driver import read, write
from ..compiler.planes import Planes, each, load, save, some
from ..errors import NotFinite
from ..formulas import Record, plain, record
from ..formulas.pytree import NUMBER
from ..formulas.sites import rows_of
from ..formulas.tables import Table, entry
from ..systems.colouring import Places
from ..systems.lie_poisson import BodyState
from ..systems.sublattices import turned
from .control import MARK, STUCK, TAKEN
from .sites_execution import SiteExecution
from .sites_run import SiteRun
from .sites_totals import totals_in

# ------------------------------------------------------------------ the drivers


@record
class Turns(Record):
    """The turns of a step: for each where its sites begin and end in memory, which part of the energy
    makes it (0 is the field of the others), and its share of the step.

    The first one begins with what the step before has left, which is the share `last`.

    group : of one site.  field : `FieldAtSite`.  name : of the method.
    """

    group: Any
    field: Any
    numbers: Any
    last: float
    name: str = ""

    def __repr__(self) -> str:
        return self.name

    def make(self, k: int, time: float, sites: Any, there: Any, row: int, layout: Any) -> None:
        """Turn number k, of this time."""
        begin, end = int(entry(self.numbers, 4 * k)), int(entry(self.numbers, 4 * k + 1))
        part = int(entry(self.numbers, 4 * k + 2))
        some(
            sites, begin, end, turned_site, self.group, self.field, part, time, sites, there, row,
            layout,
        )  # fmt: skip

    def share(self, k: int) -> float:
        """The share of turn number k."""
        return entry(self.numbers, 4 * k + 3)


def turned_site(
    group: Any, field: Any, part: int, time: float, here: Any, there: Any, row: int, layout: Any
) -> None:
    """The turn of one site."""
    state = load(here, 0, layout)
    xi = field.velocity(part, plain(state.mu))
    save(there, row, BodyState(*turned(group, state.mu, state.g, time * xi)), layout)


def copied_site(here: Any, there: Any, row: int, layout: Any) -> None:
    """A site as it is."""
    save(there, row, load(here, 0, layout), layout)


def advance_turns(
    turns: Turns,
    layout: Any,
    h: float,
    count: int,
    steps: int,
    samples: int,
    shown: int,
    sites: Any,
    seen: Any,
    clock: Any,
) -> None:
    """The driver: `samples` times so many steps of so many turns, and a sample if it is to be shown,
    1; 0 if not.

    layout : of the state of one site.  sites : before the last turn of a step, of which the time is
    left on the clock.  seen : the states, one sample behind the other.
    """
    for k in range(samples):
        left = read(clock, 0, NUMBER)
        for _ in range(steps):
            for i in range(count):
                time = turns.share(i) * h
                if i == 0:
                    time = left + time
                turns.make(i, time, sites, sites, 0, layout)
            left = turns.last * h
        write(clock, 0, left, NUMBER)
        for _ in range(shown):
            each(sites, copied_site, sites, seen, k, layout)
            turns.make(count, left, sites, seen, k, layout)


# ------------------------------------------------------------------ Python's side


class Turning:
    """How a splitting steps the sites of a system: their places, the turns of a step, and the code
    that makes them.
    """

    def __init__(self, plan: Any, layout: Any) -> None:
        steps, system = plan._steps, plan._one
        method = steps.way_of(0)
        motions = method._motions(system.hamiltonian)
        self.places = places = Places.of(system.hamiltonian.affine.colouring)
        everyone = 0, len(places.sites)
        ranges = [*places.ranges] if motions.affine else []
        rows = [
            (*ranges[part], 0, share)
            if part < len(ranges)
            else (*everyone, part - len(ranges) + 1, share)
            for part, share in method.turns(motions)
        ]
        last = rows[-1]
        if len(rows) == 1:  # one turn is a step, and leaves nothing
            last = *last[:3], 0.0
            rows = [*rows, last]
        table = Table(np.array(rows, dtype=float).ravel())
        turns = Turns(system.group.base, motions.of_site(places), table, last[3], repr(method))
        self.arguments = turns, layout, steps.h, len(rows) - 1
        planes, shared = Planes.of_rows(1, 1), kernel.Shared(np.empty(0))
        self.execution = SiteExecution(
            steps.compiled, steps.progress, advance_turns, *self.arguments, 1, 1, 1, planes, planes,
            shared,
        )  # fmt: skip

    def spread(self, rows: np.ndarray) -> Planes:
        """Rows of numbers of sites in the order of their places."""
        return Planes(rows_of(rows[..., self.places.sites]), len(self.places.sites))


class TurnsRun(SiteRun):
    """One run of a splitting by sublattices: what a site carries along, its state at the node and
    before the last turn, is laid out by colours for as long as native code runs.
    """

    turned: Planes | None = None  # all sites before the last turn of a step, by their places
    clock: np.ndarray
    last: np.ndarray | None = None  # all states at the node

    def _call(self, turns: int, samples: int, first: int) -> None:
        """Some samples with so many steps before each, from sample number `first` on."""
        if not turns:
            self._keep(first, self.shape.shown_rows(self._memory)[None])
            return
        whole = self._taken + turns * samples >= self.numbers[first]  # or it ends before the sample
        rows = self._turned(turns, samples, int(whole))
        finite = np.isfinite(rows).all(axis=(1, 2))
        good = samples if finite.all() else int(np.argmin(finite))
        self.clocks[TAKEN] += turns * good
        self.clocks[0] = self.t0 + self.clocks[TAKEN] * self.h
        if good < samples:
            self.clocks[MARK] = STUCK
        if whole:
            here = self.shape.turning.places.places
            self._keep(first, rows[:good, self.shape.order][..., here])

    def _keep(self, first: int, rows: np.ndarray) -> None:
        """Keep samples, (samples, width, sites), and what is wanted of them."""
        shown, samples = self.shape.shown, len(rows)
        if not samples:
            return
        begin = first * self.shape.state.width if shown.kept else 0
        planes = (
            Planes(self.seen.array[begin : begin + rows[:, :, 0].size], self.count)
            if shown.kept
            else Planes.of_rows(rows[:, :, 0].size, self.count)
        )
        planes.array[:, : self.count] = rows.reshape(-1, self.count)
        planes.array[:, self.count :] = planes.array[:, self.count - 1 : self.count]
        if shown.quantities:
            times = self.t0 + self.numbers[first : first + samples] * self.h
            totals_in(self.totals[first : first + samples], self.site, shown, planes, times)

    def _turned(self, turns: int, samples: int, shown: int) -> np.ndarray:
        """The states of all sites after so many steps each, (samples, width, places); if they are not
        to be shown, what the sites carry along.
        """
        shape, width = self.shape, self.shape.started.width
        if shape.turning is None:
            shape.turning = Turning(self.plan, shape.started)
        turning = shape.turning
        if self.turned is None:
            self.turned = turning.spread(self._memory[width : 2 * width])
            self.clock = self._memory[2 * width, :1].copy()
        count = self.turned.count
        seen = Planes.of_rows(width * samples * shown, count)
        arguments: Any = *turning.arguments, turns, samples, shown, self.turned, seen
        self.notes, self.failures = -1, []
        left = self.before + self.steps - self._taken
        if turning.execution.ready_for(self.count * max(1, left)):
            self.compiled = True
            turning.execution.on_sites(count)(*arguments, kernel.Shared(self.clock))
        else:
            given: list[Any] = [*arguments, self.clock]
            advance_turns(*given)
        rows = (seen if shown else self.turned).array.reshape(-1, width, seen.array.shape[1])
        self.last = rows[-1] if shown else None
        return rows[..., :count]

    def _so_far(self) -> Any:
        """The run up to here, with what every site carries along in its own place."""
        if self.turned is not None:
            here, width = self.shape.turning.places.places, self.shape.started.width
            memory = self._memory
            last = self._turned(0, 1, 1)[0] if self.last is None else self.last
            memory[:width] = last[:, here]
            memory[width : 2 * width] = self.turned.array[:, here]
            memory[2 * width] = self.clock[0]
        return super()._so_far()

    def _fail(self) -> None:
        """A state that is not finite ends the run."""
        step = self._taken
        error = NotFinite(
            "the step overflowed or left the domain of a formula; a smaller h may help"
        )
        raise self._ended(error, f"after step {step}, t = {self.t0 + step * self.h:g}")
