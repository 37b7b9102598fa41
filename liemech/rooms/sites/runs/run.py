"""Runs of one system of many sites: steps with the number of the site left open, samples where they are wanted."""

from __future__ import annotations

import copy
import time
from typing import Any

import numpy as np

from ....compiler.sites.planes import Planes
from ....errors import InvalidInput, NoConvergence
from ....formulas.classes.layouts import layout_of
from ....formulas.classes.records import records_in
from ....formulas.sites import SiteArray, SiteTable, one_site, padded, rows_of
from ....simulation import arguments
from ....simulation.between.dense import unpacked
from ....simulation.compiled.control import FRESH, GOAL, LAST_TIME, LIMIT, MARK, REJECTED, STEP, TAKEN, TIME
from ....simulation.recorded import of_method
from ....simulation.runs.carry import SiteCarry
from ....simulation.runs.course import Course
from ....simulation.runs.equal import affordable, at_steps
from ....simulation.runs.jumps import Ways, beyond_jump, stretches, until_jumps
from ....simulation.runs.tolerance import limit_of, too_many
from ....systems.many.site_state import StateOfSites
from .driver import COPIES, MET, STEP_BEGIN, WRITTEN, Moment, one_inside, one_start
from .events import StepsOfSites
from .execution import LONG, MOST, SiteExecution
from .failures import ended, fail, first_reason, hopeless, too_small_steps
from .lists import STEP as SHORT
from .lists import Lists
from .samples import EndsOfSteps, SamplesOfSites
from .states import as_users_see, by_site, first_of, site_rows, state_of_rows

PATIENCE = 0.1
"""Seconds between two looks at the keyboard."""


class SiteRun(Course):
    """One run of one system of many sites: what bodies are in other runs is here one system, whose columns
    are its sites.

    shape : layouts and native code of runs like this.  site : the system of one site, with the `lists` of its neighbours.
    state : at the start, of `count` sites.  t0, first : the time of step 0, and the steps before this run, which begins at
    t_start.  fixed_times : are times of samples asked for?  numbers : of the fixed steps behind which there are samples.

    Where it stands: `sites` is the memory of the method at all sites, of which `place` says the copy where they are.
    clocks, goals : of the control, a column.  march : how far the driver has come.  ended_by : the event that ended it.
    jumps_ahead : of the velocity, last ones first.  failures, notes, overflowed : of a step that failed what plain Python
    saw, and the first sites where native code did, and where numbers are not finite.

    samples : what is kept; `of_all` of functions of the state, by name.  observer : of all steps; None if none is looked
    at.  ways : of the whole way of adaptive steps, of every end of a step the time and the memory.
    pace : the steps of the next call.  executions : who runs drivers.  bench : a run beside this one that makes single
    shorter steps.  level : of the derivative that numbers carry along.
    """

    by_sites = True
    at_once = arguments.MOST  # steps that are advanced by hand
    takes_inputs = False  # may parameters change between these?
    ended_by: int | None = None  # which event
    level: float | None = None
    dense = each_end = False  # is the way of all adaptive steps kept, and are there samples at their ends?
    quantities: Any = None  # functions of samples
    events: Any = None
    kind_of_observer: Any = StepsOfSites
    observer: Any = None
    bench: Any = None
    overflowed: int | None = None

    def __init__(
        self, plan: Any, site: Any, start: Any, t0: float, steps: Any, t_end: Any, t_eval: Any,
        checkpoint: Any = None,
    ) -> None:  # fmt: skip
        self.plan, self.site, self.checkpoint, self.way = plan, site, checkpoint, plan._steps
        self.adaptive, self.workers = plan.adaptive, plan.options.workers
        fresh = isinstance(start, StateOfSites)
        state = by_site(plan._one, start if fresh else start.state)
        self.state, self.count = state, state.sites
        origin: tuple[float, float, int] = (t0, t0, 0) if fresh else (start.t0, start.t, start.step)
        self.t0, self.t_start, self.first = origin
        self.lists: Any = Lists.of(plan._one, site) if plan._sites.listed else None
        if self.lists is not None:
            self.site = self.lists.at(np.asarray(state.parts["g"]))
        if self.lists is not None or self.count not in plan._sites.fitting:
            require_fitting(self.site, self.count)
            plan._sites.fitting.add(self.count)
        self.fixed_times = t_eval is not None
        asked, times = self.aim(steps, t_end, t_eval)
        inner = (asked != self.t_start) & (asked != self.t_end)
        all_steps = bool(plan.events or self.dense or self.each_end)
        inside = all_steps or (inner.any() if self.adaptive else self.fixed_times and plan._sites.places is not None)
        first, rows = self.laid_out(state)
        self.starts: Any = self._planes(rows)
        self.shape = shape = plan._sites.shape_of(first, self.starts, bool(inside), all_steps, self.level)
        self.h, self.pace = shape.h, shape.paces.get(self.count, 1)
        self.of_all: dict[str, list[Any]] = {name: [] for name in plan._sites.of_all}
        self.samples = self._samples_at(asked, times)
        self.sites = self._room_for(shape.memory.width)
        self.out = np.empty(1)
        self._blank()
        self.failures: list[Any] = []
        self.notes, self.compiled = 0, False
        self.executions: dict[SiteExecution, SiteExecution] = {}
        if fresh:
            self._begin()
        else:
            self._take_up(start)
        if all_steps:
            self.observer = self.kind_of_observer(self, start)

    def _samples_at(self, asked: Any, times: Any) -> SamplesOfSites:
        """Room for samples at times as they were asked for, and as the driver meets them."""
        recorder, shape = self.plan.recorder, self.shape
        chosen = None if recorder is None else recorder.sites
        if self.of_all and not recorder.parts and chosen is None:
            chosen = []  # states are looked at, and not kept
        wide = shape.state.width if shape.keeps else 0
        width_of_row = padded(self.count) if chosen is None else len(chosen)
        affordable(8 * len(asked) * max(1, wide) * width_of_row, self.steps, self.every)
        beside = self._look_at_all if self.of_all else None
        return SamplesOfSites(shape, self.count, asked, times, chosen, beside)

    def _room_for(self, width: int) -> Planes:
        """Memory for all sites: two copies of what the method carries along, more where steps are cut."""
        copies = 2 if self.shape.procedure.ending is None else COPIES
        return Planes.of_rows(copies * width, self.count)

    def _planes(self, rows: np.ndarray) -> Planes:
        """Numbers of all sites, (width, sites), as they lie in memory."""
        return Planes(rows_of(rows), self.count)

    def _in_copy(self, k: int) -> np.ndarray:
        """Numbers of all sites, (width, sites), in a copy of the memory."""
        width = self.shape.memory.width
        return self.sites.array[k * width : (k + 1) * width, : self.sites.count]

    def laid_out(self, state: Any) -> tuple[Any, np.ndarray]:
        """The state of the first site, and the numbers of all, (width, sites)."""
        return first_of(state), site_rows(state)

    # ---------------------------------------------------------------- what is asked for

    def aim(self, steps: Any, t_end: Any, t_eval: Any) -> tuple[Any, Any]:
        """Set clock and goal; the times of samples as they were asked for, and as the driver meets them."""
        self.jumps_ahead: Ways = []
        self.every = self.plan.options.every
        if not self.adaptive:
            self.steps = self.plan._count(steps, t_end, self.t0, self.first)
            last, h = self.first + self.steps, self.way.h
            inner = np.arange(self.first // self.every + 1, -(-last // self.every)) * self.every
            self.numbers = np.array([self.first, *inner, *([last] if self.steps else [])])
            self.t_end = self.t0 + last * h
            self._set_clock(self.t0, h, self.first, last)
            if t_eval is None:
                times = self.t0 + self.numbers * h
                return times, times
            times_asked = np.asarray(arguments.times(t_eval, self.t_start, self.t_end))
            return times_asked, at_steps(times_asked, self.t0, h)
        self.steps = limit_of(steps, t_end)
        self.t_end = end = arguments.real(t_end, "t_end")
        asked: Any = arguments.times(t_eval, self.t_start, end)
        ends = np.array([self.t_start, end] if end != self.t_start else [end])
        self.dense, self.each_end = self._ways_and_ends(asked)
        self.ways: list[tuple[float, np.ndarray]] = []
        self._set_clock(self.t_start, self.way.first(self.t_start, end), 0, self.steps)
        self.goals[:4, 0] = end, self.way.rtol, self.way.atol, self.way.longest
        jumps = () if self.way.smooth else self.way.jumps(self.t_start, end)
        pieces = stretches(jumps, self.t_start, end)
        self.jumps_ahead = until_jumps(self.clocks[:, 0], self.goals[:, 0], self.t_start, pieces)
        asked = (ends[:1] if self.each_end else ends) if asked is None else asked
        return asked, asked

    def _ways_and_ends(self, asked: Any) -> tuple[bool, bool]:
        """Whether the way of all adaptive steps is kept, and whether there are samples at their ends.  asked : times of
        samples, or None.
        """
        dense = self.plan.options.dense is True
        return dense, dense and asked is None

    def _set_clock(self, t0: float, h: float, taken: int, last: int) -> None:
        """Set clock and goal for steps of a length, from where the run begins to the last one; step 0 was at t0."""
        self.clocks, self.goals = np.array([[self.t_start, h, *FRESH]]).T, np.zeros((GOAL.width, 1))
        self.clocks[TAKEN] = taken
        self.goals[:, 0] = np.copysign(np.inf, h), 0.0, 0.0, 0.0, last, t0

    def _blank(self) -> None:
        """Set the driver to the beginning: the copy of the memory, and how far it has come."""
        self.place, self.march = np.zeros((2, 1)), np.array([0.0, 0.0, 0.0, np.nan, 0.0])

    def _begin(self) -> None:
        """Let the method begin at every site."""
        shape, done = self.shape, np.zeros(1)
        failures: list[Any] = []
        arguments = shape.beginner, self.site, self.h, self.starts, self.sites
        sites = self.count * min(LONG, max(1, self.steps)), self.sites.count, self.workers
        notes = self.executing(shape.beginning).drive(sites, arguments, (), [done], failures)
        if not done[0]:
            error = self._why(failures, notes or 0, lambda i: one_site(self.count, i, one_start, *arguments))
            raise ended(self, error, f"at the start, t = {self.t_start:g}")
        self.starts = None

    def _take_up(self, start: SiteCarry) -> None:
        """Go on with what a run has carried along."""
        if self.adaptive is (start.clock is None):
            raise InvalidInput("Plan.resume: the run was made with other steps; start a new one from run.last")
        width = self.shape.memory.width
        numbers = self.shape.taken_up(start.numbers, self.count)
        self.sites.array[:width] = self._planes(numbers).array
        clock = self.clocks[:, 0]
        if self.adaptive and clock[TIME] == self.t_start:  # and not beyond a jump there
            clock[:] = start.clock
            clock[[TAKEN, REJECTED, MARK]] = 0.0
            if clock[STEP] * (self.t_end - self.t_start) < 0.0:
                clock[STEP] = -clock[STEP]

    def executing(self, execution: SiteExecution) -> SiteExecution:
        """The execution of a driver in this run, a copy of that of all runs, which sees formulas as they are when it begins."""
        if execution not in self.executions:
            self.executions[execution] = execution.of_a_run()
        return self.executions[execution]

    # ---------------------------------------------------------------- steps

    @property
    def measure(self) -> tuple[int, str]:
        return (1000, "") if self.adaptive else (self.steps, "step")

    @property
    def shown(self) -> int:
        if not self.adaptive:
            return self.most
        span = self.t_end - self.t_start
        return int(1000 * (self.clocks[TIME, 0] - self.t_start) / span) if span else 1000

    @property
    def worth_saving(self) -> bool:
        return self._going

    def piece(self) -> int | None:
        """A call of some steps, or a look at where the run stands."""
        if not (self._going or self._pending):
            return None
        done, turns = self.taken, 0 if self._pending and self.observer is not None else self.pace
        if self.checkpoint is not None and turns:
            turns = max(1, self.checkpoint.within(turns))
        self._go(turns)
        return self.taken - done

    def _go(self, turns: int) -> None:
        """Some more steps, up to where something is to be looked at, and what they come to; the next ones are as many as
        end soon.
        """
        since = time.perf_counter()
        before = self._elements_now() if self.lists is not None and turns else None
        if before is not None:
            self.site = self.lists.at(before)
        if self.observer is None:
            self._steps(turns, self.samples)
        else:
            self.observer.go(turns)
        if before is not None and not self.lists.held(before, self._elements_now()):
            error = NoConvergence(
                f"a site moved further than {SHORT:g} of the {self.lists.skin:.3g} by which lists of "
                "neighbours reach beyond the cutoff; take a smaller step"
            )
            raise ended(self, error, f"step {self.taken}, t = {self.clocks[0, 0]:g}")
        self._attend()
        used = time.perf_counter() - since
        if turns:
            self.pace = self.shape.paces[self.count] = self._next_pace(self.pace, used)

    def require_ends(self) -> None:
        t = self.clocks.item(TIME, 0)
        if self.adaptive and t != self.t_end and self.ended_by is None:
            raise too_many(self.steps, t, self.t_end)

    def so_far(self) -> str:
        whole = "" if self.adaptive else f" of {self.first + self.steps}"
        at = f"after {self.taken}{whole} steps, t = {self.clocks[TIME, 0]:g}"
        return f"{at}; {self.samples.made} samples are in `.trajectory`"

    def _stopped(self, error: Any) -> Any:
        """As of every run; one without samples has not begun."""
        return super()._stopped(error) if self.samples.made or isinstance(error, KeyboardInterrupt) else error

    def _next_pace(self, pace: int, used: float) -> int:
        """How many steps the next call makes, by the seconds that this one has used."""
        if self.lists is not None:
            return 1
        return max(1, min(64 * pace, MOST, int(pace * PATIENCE / max(used, 1e-9))))

    # ---------------------------------------------------------------- by hand

    def advance(self, steps: int) -> int:
        """Go on by so many steps, without samples, and return them.  After Ctrl-C, and before a step that fails, it
        stands where it has come to.
        """
        self.steps = self.taken + steps - self.first
        self.goals[LIMIT], self.clocks[MARK] = self.first + self.steps, 0.0
        self.samples.made, self.samples.times = 0, self.samples.times[:0]
        while self._going:
            self._go(min(self.pace, self.first + self.steps - self.taken))
        return steps

    @property
    def taken(self) -> int:
        """How many steps were taken, from the start of the motion on."""
        return int(self.clocks[TAKEN, 0])

    @property
    def _copy(self) -> int:
        """In which of the two copies of memory the sites are."""
        return int(self.place.view(np.int64)[0, 0])

    @property
    def _going(self) -> bool:
        """Are there more steps to make?"""
        t, taken = self.clocks[TIME, 0], self.clocks[TAKEN, 0]
        at_end = (t == self.t_end) if self.adaptive else False
        return self.ended_by is None and not at_end and bool(taken < self.goals[LIMIT, 0])

    @property
    def _pending(self) -> bool:
        """Is something to be looked at where the run stands?"""
        fresh = self.samples.due == self.clocks[TIME, 0] if self.observer is None else self.observer.fresh
        return self.ended_by is None and bool(fresh)

    def _steps(self, turns: int, samples: Any) -> None:
        """Some more steps by the driver, which writes these samples."""
        shape, stepping = self.shape, self.executing(self.shape.stepping)
        seen, totals, times = samples.ahead(np.copysign(np.inf, self.t_start - self.t_end))
        left = LONG if self.adaptive else self.first + self.steps - self.taken
        arguments: Any = shape.procedure, self.site, turns, self.sites, seen
        shared, arrays = [totals, times, self.march], [self.goals, self.place, self.clocks, self.out]
        if not self.adaptive:
            self.failures = []
        self.notes, self.march[WRITTEN], self.march[MET] = 0, 0.0, 0.0
        try:
            sites = self.count * max(1, left), self.sites.count, self.workers
            stepping.drive(sites, arguments, shared, arrays, self.failures, self._take_notes)
        finally:
            written = int(self.march[WRITTEN])
            samples.take(self._sound(written, seen.array[: written * samples.wide]), seen, totals)

    def _sound(self, samples: int, seen: np.ndarray) -> int:
        """How many of the samples that the driver has written are kept, of rows of their numbers."""
        return samples

    def _take_notes(self, calls: Any) -> None:
        """Take down what native code has noted of its steps."""
        self.compiled = self.compiled or self.adaptive or self.steps > 0
        self.notes = calls.notes
        if not self.adaptive and self.clocks[MARK, 0] != 0.0:
            self.overflowed = calls.overflowed()

    @property
    def _copy_of_all(self) -> np.ndarray:
        """The copy of the memory in which the sites are, with the places behind the last one."""
        width = self.shape.memory.width
        return self.sites.array[width * self._copy :][:width]

    @property
    def _memory(self) -> np.ndarray:
        """Numbers that the method carries along for the sites, (width, sites)."""
        return self._in_copy(self._copy)

    def _beside(self, room: int | None = None) -> Any:
        """A run beside this one, with memory and clock of its own, and with samples if there is room for those of steps."""
        beside: Any = copy.copy(self)
        beside.sites = Planes(self.sites.array.copy(), self.sites.count)
        beside.place, beside.clocks, beside.march = self.place.copy(), self.clocks.copy(), self.march.copy()
        if room is not None:
            times = np.full(1 if self.shape.shown.quantities else 0, np.nan)
            beside.samples = SamplesOfSites(self.shape, self.count, times, times)
            if self.shape.procedure.all_steps:
                beside.samples = EndsOfSteps(self.shape, self.count, room)
        return beside

    def _stepped(self, rows: np.ndarray, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """The states of all sites, (width, sites), and the totals after one step from others, from one time to another: of
        a run beside this one.
        """
        if self.bench is None:
            self.bench = self._beside(1)
            self.bench.sites = self.bench._room_for(self.shape.memory.width)  # nothing is known of other steps
            self.bench.first, self.bench.steps = 0, 1
        bench, h = self.bench, end - begin
        bench.t_start, bench.h = begin, h
        bench.samples.times[:], bench.samples.made = begin + h, 0
        bench._set_clock(begin, h, 0, 1)
        bench._blank()
        bench._begin_at(rows)
        bench._steps(1, bench.samples)
        if bench.clocks[MARK, 0] != 0.0:
            bench._fail()
        return self.shape.shown_rows(bench._memory), bench.samples.totals[bench.samples.made - 1 :].ravel()

    def _begin_at(self, rows: np.ndarray) -> None:
        """Let the method begin at states of all sites."""
        self.starts, self.place = self._planes(rows), np.zeros((2, 1))
        self._begin()

    def _elements_now(self) -> np.ndarray:
        """The elements of the sites where the run stands."""
        return self.elements(self.shape.shown_rows(self._memory))

    def elements(self, rows: np.ndarray) -> np.ndarray:
        """The elements of sites, of the numbers of their states."""
        return unpacked(layout_of(first_of(self.state)), rows.T)["g"]

    # ---------------------------------------------------------------- between two calls

    names_place = False  # does the error of a step say at which site, or joint, it failed?

    def _fail(self) -> None:
        """Raise the error of a step that could not be made, or let adaptive steps become shorter."""
        fail(self)

    def _why(self, failures: list[Any], first: int, again: Any) -> Any:
        """The error for which a formula failed, as of `first_reason`."""
        return first_reason(self, failures, first, again)

    def _attend(self) -> None:
        """Act on why the driver has stopped: for a sample inside of a step, a failure, or a jump of the velocity."""
        clock, step_begin, samples = self.clocks[:, 0], self.march.item(STEP_BEGIN), self.samples
        t = float(clock[TIME])
        if self.ended_by is not None:
            return
        while self.observer is None and (samples.due - t) * (t - step_begin) < 0.0:
            samples.keep(*self.inside_step(step_begin, t, samples.due))
        if clock[MARK] != 0.0:
            self._fail()
        elif self.adaptive and self.failures and hopeless(self):
            raise too_small_steps(self, self.failures[-1])
        elif self.jumps_ahead and t == self.goals[LAST_TIME, 0] and t != self.t_end:
            beyond_jump(clock, self.goals[:, 0], self.jumps_ahead, self.t_end)

    def _look_at_all(self, first: int, rows: np.ndarray) -> None:
        """The functions of all sites together that are recorded, at some more samples, (samples, width, sites): in
        plain Python.
        """
        for k, numbers in enumerate(rows):
            t = self.samples.asked.item(first + k)
            as_given = self.state_of_all(numbers)
            state = self.plan._one._written_out(as_given)
            for name, function in self.plan._sites.of_all.items():
                try:
                    if isinstance(function, str):
                        value = of_method(self.plan._one, function, {"t": t, **as_given.arrays})
                    else:
                        value = np.asarray(function(t, state), dtype=float)
                except Exception as error:
                    self.samples.made = first + k
                    raise ended(self, error, f"in {name}(t, state) at t = {t:g}") from None
                del self.of_all[name][first + k :]
                self.of_all[name].append(value)

    def inside_step(self, begin: float, end: float, at: float, pair: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """The states of all sites, (width, sites), and the totals of what is recorded, at a time in a step.

        pair : what is kept of both ends, (2, width, sites); None for the last step, which is in the memory.
        """
        if not self.adaptive:
            before = self.shape.shown_rows(self._in_copy(1 - self._copy)) if pair is None else pair[0]
            return self._stepped(before, begin, at)
        shape, sites, copy_at_end = self.shape, self.sites, self._copy
        if pair is not None:
            sites, copy_at_end = Planes(rows_of(pair.reshape(-1, self.count)), self.count), 1
        moment = Moment(at, (at - begin) / (end - begin), float(copy_at_end))
        looking = self.executing(shape.looking)
        seen, totals, failures, notes = shape.look(looking, self.site, moment, sites, self.workers)
        if failures is not None:
            again = shape.within, self.site, moment, sites, seen, totals
            error = self._why(failures, notes, lambda i: one_site(self.count, i, one_inside, *again))
            raise ended(self, error, f"inside of a step, t = {at:g}")
        return seen.array[:, : self.count], totals[: self.samples.totals.shape[1]]

    def state_of_all(self, rows: np.ndarray) -> Any:
        """The state of all sites, of the numbers of each, (width, sites), as users see it."""
        return as_users_see(self.plan._one, state_of_rows(self.shape.state, rows))

    # ---------------------------------------------------------------- what came of it

    def tell(self, made: Any) -> None:
        if self.events is not None:
            self.events.tell()

    def recorded(self, n: int) -> dict[str, np.ndarray]:
        """Functions of all sites together that are recorded, at the first n samples."""
        return {name: np.array(values[:n]) for name, values in self.of_all.items()}

    def known(self, i: int | None = None) -> dict[str, Any]:
        """Fields of the trajectory that depend on the control."""
        h, rejected = self.h, None
        if self.adaptive:
            h = float((self.clocks[TIME, 0] - self.t_start) / max(1, self.most))
            rejected = int(self.clocks[REJECTED, 0])
        fields = {"h": h, "rejected": rejected, "breaks": self.way.breaks}
        if self.dense:
            from .between import SitesDense

            fields["dense"] = SitesDense.of(self)
        return fields

    @property
    def most(self) -> int:
        """How many steps the run took."""
        return self.taken - self.first

    @property
    def carry(self) -> Any:
        """The carry with which a run goes on from here; None where fixed steps were ended inside of one."""
        if self.ended_by is not None and not self.adaptive:
            return None
        memory, clock = self._memory.copy(), self.clocks[:, 0].copy()
        met = SiteCarry.met if self.events is None else self.events.each[0].met
        state, numbers = self.state_of_all(self.shape.shown_rows(memory)), memory[: self.shape.lasting]
        if not self.adaptive:
            return SiteCarry(self.t0, self.h, int(clock[TAKEN]), numbers, state, met=met)
        clock[MARK] = 0.0
        return SiteCarry(float(clock[TIME]), 0.0, 0, numbers, state, met, clock, self.ended_by)


def require_fitting(site: Any, count: int) -> None:
    """Raise InvalidInput for tables and parameters of other sites."""
    for x in [*records_in(site, SiteTable), *records_in(site, SiteArray)]:
        if not x.fits(count) or (isinstance(x, SiteTable) and x.largest >= count):
            raise InvalidInput(f"integrate: a table of {site!r} is not one of {count} sites")
