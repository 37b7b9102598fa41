"""Runs of one system of many sites: steps with the number of the site left open, samples where they
are wanted.
"""

from __future__ import annotations

import functools
import inspect
import time
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..compiler import kernel
from ..compiler.planes import Planes, load
from ..errors import (
    IntegrationInterrupted,
    InvalidInput,
    NoConvergence,
    failure,
    is_mistake,
)
from ..formulas.pytree import build, carried_layout, inside, layout_of, leaves, rounded
from ..formulas.sites import (
    FEW,
    SiteArray,
    SiteTable,
    TooManySites,
    one_site,
    padded,
    rows_of,
)
from ..systems.site_state import StateOfSites
from ..systems.terms_at_site import at_this_site
from .control import ASKED, FRESH, LIMIT, MARK, STUCK, TAKEN, Equal
from .dense import unpacked
from .equal import affordable
from .progress import Bar
from .sites_carry import SiteCarry
from .sites_driver import (
    OfSite,
    Share,
    Shown,
    advance_sites,
    begin_sites,
    first_memory,
    one_start,
    one_step,
)
from .sites_execution import SiteExecution
from .sites_lists import STEP, Lists
from .sites_states import as_users_see, by_site, first_of, site_rows, state_of_rows
from .stopped import NONE
from .trajectory import Trajectory

SOME = 3
"""Sites among which a formula is tried whose layout alone is asked for."""

PATIENCE = 0.1
"""Seconds between two looks at the keyboard."""


class Prepared:
    """The layouts and the native code of runs of a plan whose starts are alike.

    given, started : layouts of one site at the start, as it comes and in the numbers of the run.
    memory, state : of what the method carries along for it, and of what is shown.  turning : how a
    splitting by colours steps.
    """

    turning: Any = None

    def __init__(self, plan: Any, site: Any, start: StateOfSites, starts: Planes) -> None:
        steps = plan._steps
        self.plan, self.site, self.method, self.h = plan, site, steps.way_of(0), steps.h
        first = first_of(start)
        self.given = layout_of(first)
        self.started = layout_of(steps.remembering_of(site, first))
        self.beginner = self.method, site, self.given, self.started
        some = min(start.sites, SOME)
        carry = one_site(some, 0, first_memory, *self.beginner, self.h, starts)
        example = rounded(self.method.observe(carry))
        self.memory, self.state = carried_layout(carry), layout_of(example)
        self.shown = self._shown(example, some, starts)
        none, planes = kernel.Columns(np.empty(0)), Planes.of_rows(1, 1)
        self.beginning = SiteExecution(
            steps.compiled, steps.progress, begin_sites, *self.beginner, self.memory, self.h, planes,
            planes, none, None,
        )  # fmt: skip

    @functools.cached_property
    def stepping(self) -> SiteExecution:
        """Who runs the driver of steps."""
        steps, planes = self.plan._steps, Planes.of_rows(1, 1)
        none, shared = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
        return SiteExecution(
            steps.compiled, steps.progress, advance_sites, *self.stepper, 1, 1, planes, planes, shared,
            none, none, none, none, None,
        )  # fmt: skip

    @functools.cached_property
    def order(self) -> list[int] | None:
        """For every number of a sample, which one it is of what the method carries along; None if it
        is computed of several.
        """
        numbers = [1.0 + i for i in range(self.memory.width)]
        shown = rounded(self.method.observe(build(self.memory, iter(numbers))))
        found = leaves(shown, self.state)
        return [int(x) - 1 for x in found] if all(x in numbers for x in found) else None

    def shown_rows(self, memory: np.ndarray) -> np.ndarray:
        """The states of all sites, (width, sites), in what the method carries along."""
        if self.order is not None:
            return memory[self.order]
        columns = (build(self.memory, iter(column)) for column in memory.T.tolist())
        states = (rounded(self.method.observe(carry)) for carry in columns)
        return np.array([leaves(state, self.state) for state in states]).T

    @property
    def stepper(self) -> tuple[Any, ...]:
        """The arguments of `advance_sites` that are no arrays and no counts."""
        return self.method, self.site, Equal(True), self.memory, self.shown

    def _shown(self, example: Any, count: int, starts: Planes) -> Shown:
        """What samples have."""
        recorder = self.plan.recorder
        kept = recorder is None or bool(recorder.parts)
        quantities = [] if recorder is None else [*recorder.quantities.values()]
        found = tuple([quantity_of(self.site, wanted, example) for wanted in quantities])
        numbers: list[Any] = []
        for quantity in found:
            arguments = quantity, self.site, self.given, starts
            numbers.append(one_site(count, 0, _one_value, *arguments))
        return Shown(kept, self.state, found, carried_layout(tuple(numbers)))


def quantity_of(site: Any, wanted: Any, example: Any) -> Any:
    """What a name or a function of a user's gives for one site."""
    if not isinstance(wanted, str):
        return OfSite(wanted)
    parts = tuple(inspect.signature(getattr(site, wanted)).parameters)
    missing = [name for name in parts if getattr(example, name, None) is None]
    if missing:
        raise InvalidInput(
            f"integrate: record={wanted!r} needs {', '.join(missing)}; start from a state with it"
        )
    return Share(wanted, parts)


def _one_value(quantity: Any, site: Any, given: Any, starts: Planes) -> Any:
    return quantity(0.0, at_this_site(site), load(starts, 0, given))


class SiteRun:
    """One run of one system of many sites, of fixed steps."""

    def __init__(self, plan: Any, site: Any, start: Any, steps: int, t0: float, kept: Any) -> None:
        self.plan, self.site, self.kept, self.steps = plan, site, kept, steps
        fresh = isinstance(start, StateOfSites)
        state = by_site(plan._one, start if fresh else start.state)
        self.state, self.count = state, state.sites
        begun: tuple[float, int] = (t0, 0) if fresh else (start.t0, start.step)
        self.t0, self.before = begun
        self.lists: Any = Lists.of(plan._one, site)
        if self.lists is not None:
            self.site = site = self.lists.at(np.asarray(state.parts["g"]))
        require_fitting(site, self.count)
        self.h, self.workers = plan._steps.h, plan._steps.workers
        self.starts = Planes(rows_of(site_rows(state)), self.count)
        self.shape = shape = plan._sites.prepared(state, self.starts)
        every, last = plan._steps.every, self.before + steps
        inner = np.arange(self.before // every + 1, -(-last // every)) * every
        ends = [last] if steps else []
        self.numbers = np.concatenate([[self.before], inner, ends]).astype(np.int64)
        self.sites = Planes.of_rows(2 * shape.memory.width, self.count)
        kept_rows = shape.state.width if shape.shown.kept else 0
        samples = len(self.numbers)
        affordable(8 * samples * max(1, kept_rows) * padded(self.count), steps, every)
        self.seen = Planes.of_rows(max(1, samples * kept_rows), self.count)
        self.totals = np.zeros((samples, shape.shown.totals.width))
        self.clocks = np.array([[t0, self.h, *FRESH]]).T
        self.clocks[0], self.clocks[TAKEN] = self.t0 + self.before * self.h, self.before
        self.goals = np.array([[np.copysign(np.inf, self.h), 0.0, 0.0, 0.0, 0.0, self.t0]]).T
        self.goals[LIMIT] = last
        self.place = np.zeros((1, 1))
        self.made = 0  # samples
        self.compiled = False
        if fresh:
            self._begin()
        else:
            if start.numbers.shape != (shape.memory.width, self.count):
                raise InvalidInput(
                    f"Plan.resume: the run carries {start.numbers.shape} numbers along; this plan has "
                    f"({shape.memory.width}, {self.count})"
                )
            self.sites.array[: shape.memory.width] = rows_of(start.numbers)

    def _begin(self) -> None:
        """What the method carries along at the start."""
        shape, done = self.shape, np.zeros(1)
        failures: list[Any] = []
        beginner = shape.method, self.site, shape.given, shape.started
        arguments = *beginner, shape.memory, self.h, self.starts, self.sites, done
        notes = 0
        if shape.beginning.ready_for(self.count * max(1, self.steps)):
            calls = shape.beginning.on_sites(self.count, self.workers)
            calls(*arguments, None)
            notes = calls.notes
        else:
            begin_sites(*arguments, failures)
        if not done[0]:
            given = *beginner, shape.memory, self.h, self.starts, self.sites
            error = self._why(failures, notes, lambda i: one_site(self.count, i, one_start, *given))
            raise self._ended(error, f"at the start, t = {self.t0:g}")

    # ---------------------------------------------------------------- steps

    def trajectory(self) -> Trajectory:
        """Step to the end, sample by sample."""
        self._call(0, 1, 0)
        self.made = 1
        pace = 1  # steps of a call
        with Bar(self.plan._steps.progress, self.steps) as bar:
            try:
                while self.made < len(self.numbers):
                    done = self._taken
                    wanted = int(self.numbers[self.made]) - done
                    ahead = np.diff(self.numbers[self.made - 1 :])
                    same = (
                        int(np.argmax(ahead != wanted)) if (ahead != wanted).any() else len(ahead)
                    )
                    whole = done == self.numbers[self.made - 1]
                    samples = max(1, min(same, pace // wanted)) if whole else 1
                    turns = wanted if samples > 1 else min(wanted, pace)
                    if self.kept is not None:
                        turns = max(1, self.kept.within(turns))
                        samples = 1 if turns < wanted else samples
                    begun = time.perf_counter()
                    try:
                        self._call(turns, samples, self.made)
                    finally:
                        taken = self._taken
                        reached = np.searchsorted(self.numbers, taken, side="right")
                        self.made = max(self.made, int(reached))
                    if self.clocks[MARK, 0] != 0.0:
                        self._fail()
                    used = time.perf_counter() - begun
                    faster = min(64 * pace, int(pace * PATIENCE / max(used, 1e-9)))
                    pace = 1 if self.lists is not None else max(1, faster)
                    bar.advance(taken - done)
                    if (
                        self.kept is not None
                        and self.kept.due(taken - done)
                        and self.made < len(self.numbers)
                    ):
                        self.kept.save(self._so_far())
            except KeyboardInterrupt:
                stopped: Any = IntegrationInterrupted(
                    f"integrate: interrupted after {self._taken} of {self.before + self.steps} steps, "
                    f"t = {self.clocks[0, 0]:g}; {self.made} samples are in `.trajectory`"
                )
                stopped.trajectory = self._so_far()
                raise stopped from None
        return self._so_far()

    @property
    def _taken(self) -> int:
        return int(self.clocks[TAKEN, 0])

    def _call(self, turns: int, samples: int, first: int) -> None:
        """Some samples with so many steps before each, from sample number `first` on."""
        shape, stepping = self.shape, self.shape.stepping
        width = shape.state.width if shape.shown.kept else 0
        seen = Planes(self.seen.array[first * width :], self.count)
        totals, out = self.totals[first:], np.empty(max(1, turns))
        left = self.before + self.steps - self._taken
        before = self._elements() if self.lists is not None and turns else None
        if before is not None:
            self.site = self.lists.at(before)
        stepper = shape.method, self.site, *shape.stepper[2:]
        arguments = *stepper, turns, samples, self.sites, seen
        arrays = self.goals, self.place, self.clocks, out
        self.failures: list[Any] = []
        self.notes = 0
        if stepping.ready_for(self.count * max(1, left)):
            self.compiled = self.compiled or left > 0
            calls = stepping.on_sites(self.count, self.workers)
            try:
                calls(*arguments, kernel.Shared(totals), *arrays, None)
            finally:
                self.notes = calls.notes
        else:
            with stepping.plain():
                columns = [x.ravel() for x in arrays[:3]]
                driver: Any = advance_sites
                driver(*arguments, totals.ravel(), *columns, out, self.failures)
                for x, column in zip(arrays, columns):
                    x[:] = column[:, None]
        if before is not None and not self.lists.held(before, self._elements()):
            error = NoConvergence(
                f"a site moved further than {STEP:g} of the {self.lists.skin:.3g} by which lists of "
                "neighbours reach beyond the cutoff; take a smaller step"
            )
            raise self._ended(error, f"step {self._taken}, t = {self.clocks[0, 0]:g}")

    @property
    def _copy(self) -> int:
        """Which of the two copies of the memory holds the sites."""
        return int(self.place.view(np.int64)[0, 0])

    @property
    def _memory(self) -> np.ndarray:
        """What the method carries along for the sites, (width, sites)."""
        width = self.shape.memory.width
        found: np.ndarray = self.sites.array[width * self._copy :][:width, : self.count]
        return found

    def _elements(self) -> np.ndarray:
        """Where the sites are."""
        rows = self.shape.shown_rows(self._memory)
        return unpacked(self.shape.state, rows.T)["g"]

    # ---------------------------------------------------------------- what came of it

    def _fail(self) -> None:
        """A step that could not be made ends the run: plain Python says why, of the site that native
        code has noted.
        """
        assert self.clocks[MARK, 0] in (ASKED, STUCK)
        step = self._taken
        t, memory = self.t0 + step * self.h, self.shape.memory
        here = self._copy
        given = self.shape.method, self.site, t, self.h, self.sites, here, 1 - here, memory
        failures = [e for e in self.failures if e is not None]
        error = self._why(failures, self.notes, lambda i: one_site(self.count, i, one_step, *given))
        raise self._ended(error, f"step {step + 1} of {self.before + self.steps}, t = {t:g}")

    def _why(self, failures: list[Any], first: int, again: Any) -> Any:
        """What the formula of a site raises.  first : of those among which it is; -1 if all have
        failed together, or nobody knows.
        """
        if failures:
            return failures[0]
        some = range(max(0, first), min(self.count, max(0, first) + kernel.lanes()))
        for i in some if first >= 0 or self.count <= FEW else ():
            try:
                again(i)
            except TooManySites:
                break
            except Exception as error:
                return error
        if first < 0:
            return NoConvergence(
                f"{self.plan.method!r}: what all sites have in common failed, such as an iteration that "
                f"does not settle. The step h = {self.h:g} may be too large; try {0.25 * self.h:g}"
            )
        return None

    def _ended(self, error: Any, at: str) -> Any:
        """The error of a run whose step failed, with what there is of it."""
        site = getattr(error, "site", None)
        one = self.plan._one
        named = getattr(getattr(one, "configurations", one.group), "named", str)
        at = at if site is None else f"site {named(site)}, {at}"
        if is_mistake(error):
            error.add_note(f"[integrate: {at}; the samples before it are in `.trajectory`]")
            made = error
        else:
            made = failure(
                error, repr(self.plan.method), f"{at}; {self.made} samples are in `.trajectory`"
            )
        made.site = site
        if self.made:
            made.trajectory = self._so_far()
        return made

    def _so_far(self) -> Trajectory:
        """The run up to here."""
        shape, n, taken = self.shape, self.made, self._taken
        shown, numbers, memory = shape.shown, self.numbers[:n], self._memory.copy()
        recorder = self.plan.recorder
        observed = () if recorder is None else tuple(recorder.quantities)

        @functools.cache
        def states() -> dict[str, np.ndarray]:
            found = {}
            if shown.kept:
                rows = self.seen.array[: n * shape.state.width].reshape(n, shape.state.width, -1)
                arrays = unpacked(shape.state, np.moveaxis(rows[..., : self.count], 1, -1))
                wanted = arrays if recorder is None else recorder.parts
                found = self.plan._one.as_users_see({name: arrays[name] for name in wanted})
            if observed:
                parts = _columns(shown.totals, self.totals[:n])
                found |= dict(zip(observed, parts, strict=True))
            return found

        return Trajectory.promised(
            SimpleNamespace(t=lambda: self.t0 + numbers * self.h, states=states),
            system=self.plan.system,
            method=self.plan.method,
            h=self.h,
            bodies=None,
            steps=taken - self.before,
            compiled=self.compiled,
            stopped=NONE,
            carry=self._carry(memory, taken),
            observed=observed,
        )

    def _carry(self, memory: np.ndarray, taken: int) -> SiteCarry:
        state = state_of_rows(self.shape.state, self.shape.shown_rows(memory))
        state = as_users_see(self.plan._one, state)
        return SiteCarry(self.t0, self.h, taken, memory, state)


def _columns(layout: Any, rows: np.ndarray) -> list[np.ndarray]:
    """The parts of a tuple, each (n, ...)."""
    found, begin = [], 0
    for part in layout.parts:
        own = rows[:, begin : begin + part.width]
        begin += part.width
        found.append(own[:, 0] if part.kind == "number" else own)
    return found


def require_fitting(site: Any, count: int) -> None:
    """Raise InvalidInput for tables and parameters of other sites."""
    for x in [*inside(site, SiteTable), *inside(site, SiteArray)]:
        if not x.fits(count) or (isinstance(x, SiteTable) and x.largest >= count):
            raise InvalidInput(f"integrate: a table of {site!r} is not one of {count} sites")
