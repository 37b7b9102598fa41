"""Runs of systems of many sites all of whose steps are looked at: for zeros of events, which are functions of time and of
totals over all sites, or of the state of all, and for the whole way of adaptive steps.
"""

from __future__ import annotations

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np

from ....compiler import kernel
from ....errors import InvalidInput, NotCompilable
from ....formulas import Record, record
from ....formulas.classes.layouts import NUMBER, build, layout_of
from ....formulas.classes.records import names_of
from ....simulation.between.dense import observe, part_of_way, unpacked
from ....simulation.between.events import Events, Moving
from ....simulation.compiled.control import LIMIT, TAKEN, TIME, go_on
from ....simulation.compiled.execution import COLUMNS
from ....simulation.keep import PieceOfBodies
from ....systems.many.site_state import StateOfSites
from .driver import MET, STEP_BEGIN
from .execution import MOST
from .failures import ended
from .samples import EndsOfSteps
from .states import kind_of

TOTAL = "total"
"""The name of the second argument of an event of totals."""


@functools.cache
def totals_class(names: tuple[str, ...]) -> Any:
    """The class of totals with these names."""
    fields = {"__annotations__": dict.fromkeys(names, Any), "__module__": __name__}
    return record(type(f"Totals_{'_'.join(names)}", (Record,), fields))


def compiles(plan: Any, event: Any, named: Any) -> bool:
    """Can the driver of steps ask an event of totals, of which this is an example?"""
    if plan._steps.compiled is False or kernel.available() is not None:
        return True
    try:
        kernel.translated(observe, event, layout_of(named), NUMBER, COLUMNS, COLUMNS, None)
    except NotCompilable:
        return False
    return True


class StepsOfSites(Moving):
    """The steps of a run, as events ask for them.  The numbers that these see are the totals, and behind them, if one is
    of the state of all sites, this state.

    times, rows, totals : of where the last steps began, and of their ends, the times, what is kept of all sites, (n, width,
    sites), and the totals.  kept : the ends of steps as the driver writes them; None where it asks events.
    here : (1 + numbers, 1) time and numbers where the run stands.  of_totals : the identities of events of totals.
    """

    bodies = None
    between = SimpleNamespace(closer=False)
    events: Any = None
    times: Any = None
    kept: Any = None
    fresh = True  # is the start still to be looked at?

    def __init__(self, run: Any, start: Any) -> None:
        self.run, self.plan, self.adaptive = run, run.plan, run.adaptive
        self.compiled_asked: Any = False if run.shape.watched else run.plan._steps.compiled  # of one step at a time
        self.over, self.cuts = np.array([False]), {}  # type: Any, Any
        self.sign = np.array([np.copysign(1.0, run.t_end - run.t_start)])
        self.met_before: Any = ({}, {})
        if not isinstance(start, StateOfSites):
            self.met_before = {0: start.met}, {} if start.event is None else {0: start.event}
        functions = () if run.site.jointed else run.plan._sites.functions
        self.of_totals = {id(f) for _, of, f in functions if of == TOTAL}
        self.whole = any(id(event) not in self.of_totals for event in run.plan.events)
        self.named, self.layout, self.view = run.shape.named, run.shape.shown.totals, self  # type: Any, Any, Any
        for event in run.plan.events:
            if id(event) in self.of_totals:
                self._require_totals(event)

    def _require_totals(self, event: Any) -> None:
        """Raise InvalidInput for an event that asks for a total that `record` does not name."""
        try:
            event(0.0, self.named)
        except AttributeError as error:
            if error.obj is self.named:
                kind: Any = type(self.named)
                names = ", ".join(names_of(kind))
                raise InvalidInput(f"integrate: an event asks for total.{error.name}; record= names {names}") from None
        except Exception:  # of zeros it may fail
            return

    # ---------------------------------------------------------------- what events see

    def _named(self, numbers: np.ndarray) -> Any:
        """The totals, by their names."""
        return type(self.named)(*build(self.layout, iter(numbers[: self.layout.width].tolist())))

    def small(self, numbers: np.ndarray) -> np.ndarray:
        """The numbers of one sample as they are: `ask` shows to each event what it is of."""
        return numbers

    def ask(self, event: Any, t: float, state: Any) -> Any:
        if id(event) in self.of_totals:
            return event(t, self._named(state))
        rows = state[self.layout.width :].reshape(-1, self.run.count)
        return event(t, self.plan._one._written_out(self.run.state_of_all(rows)))

    def seen(self, numbers: np.ndarray) -> tuple[Any, np.ndarray]:
        """The layout and the numbers of totals as formulas take them; no layout where an event is of all sites, which
        NumPy evaluates.
        """
        if self.whole:
            return None, numbers
        return layout_of(self._named(numbers[0])), numbers

    def states(self, numbers: np.ndarray) -> Any:
        """The states of kept sites, of their numbers, (n, numbers)."""
        layout = self.run.shape.state
        rows = numbers.reshape(len(numbers), layout.width, self.wide // layout.width)
        arrays = unpacked(layout, np.moveaxis(rows, 1, -1))
        return kind_of(arrays)(**arrays)

    @property
    def wide(self) -> int:
        return int(self.run.samples.kept_of(np.empty((self.run.shape.state.width, self.run.count))).size)

    def refused(self, error: Any, body: int, t: float, state: Any) -> Any:
        error.asked_at = t
        return error

    def failed(self, error: Any) -> Any:
        """The error of a run of which an event failed."""
        return ended(self.run, error, f"in an event at t = {error.asked_at:g}")

    # ---------------------------------------------------------------- inside of steps

    def at(self, k: int, t: float) -> tuple[np.ndarray, np.ndarray]:
        """The states of all sites, (width, sites), and the totals, at a time in step k."""
        for end in (k, k + 1):
            if t == self.times[end]:
                return self.shown(self.rows[end]), self.totals[end]
        begin, end = self.times[k : k + 2].tolist()
        pair = None if self.run.shape.watched else self.rows[k : k + 2]  # still where the step has put it
        return self.run.inside_step(begin, end, t, pair)

    def shown(self, rows: np.ndarray) -> np.ndarray:
        """The states of all sites, (..., width, sites), of what is kept of steps."""
        shape = self.run.shape
        if not shape.watched:
            return rows[..., : shape.state.width, :]
        states = [shape.shown_rows(x) for x in rows.reshape(-1, *rows.shape[-2:])]
        return np.reshape(states, (*rows.shape[:-2], -1, self.run.count))

    def _numbers(self, rows: np.ndarray, totals: np.ndarray) -> np.ndarray:
        """The numbers that events read, of states of all sites, (..., width, sites), and totals, (..., totals)."""
        return np.concatenate([totals, rows.reshape(*totals.shape[:-1], -1)], axis=-1) if self.whole else totals

    def looks(self, piece: Any, step: np.ndarray) -> Any:
        return np.ones(len(step), dtype=int)

    def inside(self, piece: Any, step: np.ndarray, times: np.ndarray) -> Any:
        begins = piece.before[step].tolist()
        return np.array([self._numbers(*self.at(k, t)) for k, t in zip(begins, times.tolist())])

    def seen_at(self, piece: Any, step: np.ndarray, times: np.ndarray) -> Any:
        begins, kept_of = piece.before[step].tolist(), self.run.samples.kept_of
        return np.array([kept_of(self.at(k, t)[0]).ravel() for k, t in zip(begins, times.tolist())])

    # ---------------------------------------------------------------- the steps

    def go(self, turns: int) -> None:
        """Some more steps, of which the samples are kept, up to the first event that ends the run.  Ctrl-C leaves the
        run where it was; where an event fails it stands before the step in which it does.
        """
        run, count = self.run, self.run.samples.made
        stand, taken = (run._copy_of_all.copy(), run.clocks.copy(), run.march.copy()), run.taken
        values = [*self.events.each[0].values] if self.events else []
        ends: Any = None
        try:
            ends = self.times, self.rows, self.totals = self.ends(1 if self.events and self.events.fresh else turns)
            taken = run.taken - (len(self.times) - 1)
            numbers = self._numbers(self.shown(self.rows), self.totals) if self.whole else self.totals
            out = np.column_stack([self.times, numbers])[:, :, None]
            hit = self._look(out, taken)
        except KeyboardInterrupt:
            self.return_to(stand, 0)
            run.samples.made = count
            if self.events:
                self.events.each[0].values = values
                self.events.forget()
            raise
        except Exception as error:
            if ends is None or not (hasattr(error, "step") or self.fresh):
                raise
            step = getattr(error, "step", 0)
            run.samples.return_to(self.times.item(step))
            self._keep_up_to(self.times.item(step), step)
            self.return_to(stand, taken + step)
            raise self.failed(error) from error.__cause__
        if hit is None:
            self._keep_up_to(self.times.item(-1), len(self.times) - 1)
        else:
            self._end(hit, stand, taken)
        self.here = out[-1]

    def ends(self, turns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Some more steps: of where they begin, and of their ends, the times, what is kept and the totals; where the driver
        asks events, all that is carried along, of the last step.
        """
        run, now = self.run, self.run.clocks.item(TIME, 0)
        if run.shape.watched:
            run._steps(turns, run.samples)
            times = np.array([run.march.item(STEP_BEGIN), run.clocks.item(TIME, 0)])
            copies = np.array([run._in_copy(k) for k in range(2)])
            onward, count = 2 * run._copy - 1, 1 if times[0] == times[1] else 2
            return times[-count:], copies[::onward][-count:], run.samples.at_ends[::onward][-count:]
        if self.kept is None:
            self.kept = EndsOfSteps(run.shape, run.count)
        ends = self.kept
        ends.go_on(now)
        run._steps(min(turns, ends.room), ends)
        return ends.times[: ends.made], ends.rows, ends.totals[: ends.made]

    def return_to(self, stand: tuple[np.ndarray, ...], steps: int) -> None:
        """Let the run stand where it stood, or behind step number `steps`.  stand : memory, clock and march."""
        run = self.run
        run._copy_of_all[:], run.clocks[:], run.march[:] = stand
        if steps > run.taken:
            written = run.samples if run.shape.watched else self.kept
            written.return_to(run.clocks.item(TIME, 0))
            limit, run.goals[LIMIT] = run.goals[LIMIT].copy(), steps
            run._steps(MOST, written)
            run.goals[LIMIT] = limit

    def _look(self, out: np.ndarray, taken: int) -> Any:
        """Look at some steps: the zero that ends the run, or None.  out : times, and numbers that events see."""
        if self.fresh:
            self.here = out[0]
            if self.plan.events:
                self.events = self.run.events = Events(self, self.plan.events)
            self.fresh = False
            self._keep_up_to(self.times.item(0), 0)
            if self.run.dense:
                self.run.ways.append((self.times.item(0), self.rows[0].copy()))
        if not self.events:
            return None
        if self.run.shape.watched and not self.events.fresh:  # the driver has asked at the steps before
            if not self.run.march[MET]:
                return None
            self.here = out[0]
            first = out.item(0), out[0, 1:, 0]
            self.events.each[0].values = [self.events._value(0, event, *first) for event in self.plan.events]
        piece = PieceOfBodies(self, np.array([0]), out, self.here[0], np.array([taken]))
        return self.events.see(piece).get(0)

    def _end(self, hit: Any, stand: Any, taken: int) -> None:
        """End the run where a terminal event has its zero."""
        run, (step, at, event, _) = self.run, hit
        run.ended_by, self.cuts[0] = event, event
        (rows, totals), (begin, end) = self.at(step, at), self.times[step : step + 2].tolist()
        rows, whole = rows.copy(), self.rows[step + 1].copy()
        run.samples.return_to(at)
        self._keep_up_to(at, step)
        if not run.fixed_times and run.samples.t[-1] != at:
            run.samples.end_at(at)
            run.samples.keep(rows, totals)
        if run.adaptive and not run.shape.watched:
            self.return_to(stand, taken + step + 1)
        run.clocks[TAKEN] = taken + step + 1
        run.t_end = at
        if run.adaptive:  # which go on from there
            run._begin_at(rows)
            go_on(run.clocks[:, 0], at)
        if run.dense:
            lasting = run.shape.lasting
            part = part_of_way(whole[lasting:], (at - begin) / (end - begin), len(run.shape.memory.parts[2].parts))
            run.ways.append((at, np.concatenate([run._memory[:lasting], part])))

    def _keep_up_to(self, end: float, last: int) -> None:
        """Keep the samples up to a time, and of the whole way the steps up to this one."""
        run, samples, sign = self.run, self.run.samples, self.sign.item()
        if run.dense:
            run.ways += [*zip(self.times[1 : last + 1].tolist(), self.rows[1 : last + 1].copy())]
        for t in self.times[1 : last + 1].tolist() if run.each_end else ():
            if t != samples.times[-1]:
                samples.more(t)
        due = samples.times[samples.made :]
        due = due[sign * due <= sign * end]
        ends, done = np.searchsorted(sign * self.times, sign * due), 0
        for k in np.flatnonzero(self.times[ends] != due).tolist():
            self._keep(ends[done:k])
            samples.keep(*self.at(max(ends.item(k) - 1, 0), due.item(k)))
            done = k + 1
        self._keep(ends[done:])

    def _keep(self, ends: np.ndarray) -> None:
        """Keep samples at some ends of steps."""
        if len(ends):
            self.run.samples.keep(self.shown(self.rows[ends]), self.totals[ends])
