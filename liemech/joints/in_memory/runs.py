"""Runs of linkages of any size: steps of all bodies and joints together, in memory."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ...compiler.sites.planes import Planes, columns
from ...errors import IncompatibleSystem, IntegrationInterrupted, InvalidInput, NoConvergence
from ...formulas.classes.layouts import layout_of
from ...formulas.tables import Table
from ...groups.retractions import Exponential
from ...integrators.composition import Composition
from ...integrators.ending_at_jumps import EndingAtJumps, cuts
from ...integrators.kicks.explicit_kicks import bound_refusal
from ...integrators.kicks.multiple_time_steps import MultipleTimeSteps
from ...integrators.rkmk import RKMK
from ...integrators.taylor import Taylor
from ...rooms.constraints.constrained_body import BoundBody
from ...rooms.constraints.lie_rattle import LieRATTLE, near_a_dead_point
from ...rooms.constraints.rattle import RATTLE
from ...rooms.sites.runs.run import SiteRun
from ...rooms.sites.runs.samples import SamplesOfSites
from ...rooms.sites.runs.states import as_users_see, by_site, one_of, site_rows, state_of_rows
from ...simulation.between.dense import MotionBetween, flat, unpacked
from ...simulation.between.events import Events, Moving
from ...simulation.between.turning import looks_by_velocity, turning_of
from ...simulation.compiled.control import TAKEN, TIME
from ...simulation.compiled.parameters import places_of
from ...simulation.keep import PieceOfBodies, Quantities
from ...simulation.result import AsItIs
from ...systems.many.site_state import StateOfSites
from ...systems.system import small_state
from .links import BROKEN, Links
from .loads_of_links import THROWN
from .multiple_time_steps_of_links import MultipleTimeStepsOfLinks
from .rattle_of_links import RattleOfLinks
from .rkmk_of_links import FREE, RkmkOfLinks
from .taylor_of_links import TaylorOfLinks, terms_of

NOTHING = np.zeros(0)
"""Totals over sites, of which there are none."""

SEEN = 256
"""Steps between two looks at events."""

SHORT, LOW = 3, 4
"""Conditions of a joint, and orders, up to which the formulas of joints are written out once for each
order.
"""

FEW = 600
"""Conditions among which those are found that depend on each other, where a step has failed."""


def linked_method(plan: Any) -> Any:
    """The method of a plan as that of many bodies and joints; None if there is none, or the system has no such form."""
    system, site = plan._one, plan._one.site_form
    if not isinstance(site, Links) or plan.fictive:
        return None
    if plan.adaptive:
        return written_out(plan._steps.method, "adaptive steps")
    method = plan._steps.way_of(0)
    ending = None
    if isinstance(method, EndingAtJumps):
        ending = method if cuts(method, system) else None
        method = method.method
    shares: Any = [(1.0, 0.0)]
    base = method
    if isinstance(method, Composition):
        base, shares = method.base, zip(method.tableau.gamma, method.tableau.nodes)
    if type(base) is RKMK and base is method and base.tableau.explicit:
        special = site.rheonomic or site.geared
        return rkmk_of(base) if ending is None and not special else None
    if type(base) is Taylor and base is method:
        for has, what in (
            (ending is not None, "steps that end where inputs jump"),
            (site.rheonomic, "joints in a given motion"),
            (site.geared, "rotors"),
            (site.on_all is not None, "potential or load of all bodies by one formula"),
        ):
            if has:
                return written_out(base, what)
        return taylor_of(base, site)
    if type(base) is MultipleTimeSteps and base is method and ending is None and not site.geared:
        table, ratio = Table(np.array([1.0, 0.0])), float(base.ratios[0])
        fast = RattleOfLinks(repr(base), Exponential(), table, 1.0, 1, site.most)
        return MultipleTimeStepsOfLinks(repr(method), fast, ratio)
    if not isinstance(base, (LieRATTLE, RATTLE)):
        return None
    retraction = base.retraction if isinstance(base, LieRATTLE) else Exponential()  # of points
    rows = [(share, node) for share, node in shares]
    table = Table(np.ravel(rows))
    return RattleOfLinks(repr(method), retraction, table, float(len(rows)), len(rows), site.most, ending)


def written_out(method: Any, what: str) -> None:
    """Nothing: the equation is written out for all bodies.  Raises IncompatibleSystem for a Taylor method
    in a chart that this equation has not.
    """
    if type(method) is Taylor and not isinstance(method.retraction, Exponential):
        raise IncompatibleSystem(
            f"{method!r}: by loops over bodies and joints there are no {what}. RKMK(order=5) may have them; "
            f"Taylor(order={min(method.order, 14)}, retraction=Exponential()) writes the equation out for all bodies, slowly"
        )


def rkmk_of(method: RKMK) -> RkmkOfLinks:
    """An explicit RKMK method as that of many bodies and joints."""
    tableau = method.tableau
    count = tableau.stages
    rows = [[*row, *[0.0] * (count - len(row))] for row in (*tableau.A, tableau.b)]
    nodes = Table(np.array(tableau.c))
    return RkmkOfLinks(repr(method), method, Table(np.ravel(rows)), nodes, count, float(count), FREE)


def taylor_of(method: Taylor, site: Links) -> TaylorOfLinks:
    """A Taylor series method as that of many bodies and joints."""
    order = method.order
    short = site.most <= SHORT or order <= LOW
    spans = range(2, order + 2) if short else (order // 2 + 1, order + 1)
    return TaylorOfLinks(repr(method), method, order, float(order), tuple(spans), terms_of(order, site.most))


def place_of(linkage: Any, one: Any) -> tuple[int, int] | None:
    """The first row, among the numbers that do not change, and the column of an input that is a
    parameter of a force at a joint; None for others.
    """
    head, _, rest = one.name.partition(".")
    k, _, rest = rest.partition(".")
    if head != "forces" or not rest:
        return None
    form, force = linkage.linked, linkage.forces[int(k)]
    number = linkage.number(force.joint)
    before = [
        x for x in linkage.forces[: int(k)]
        if linkage.number(x.joint) == number
        and linkage._has_potential(x) is linkage._has_potential(force)
    ]  # fmt: skip
    side = "springs" if linkage._has_potential(force) else "loads"
    column = number
    joint = form.joints[column]
    found = places_of(joint, f"{side}.{len(before)}.{rest}", one.layout)
    if found is None or len(found) != 1:
        return None
    own = columns(Planes(form.fixed, form.places), work=form.links.work).work.fields.own
    return own.nth(form.links.kinds.index(layout_of(joint))).rows[found[0]], column


class LinksBetween(MotionBetween):
    """The motion of a linkage inside of its steps: shorter ones, from the states where they begin."""

    def __init__(self, run: LinksRun) -> None:
        self.run = run

    def given(self, before: np.ndarray, after: np.ndarray, times: np.ndarray) -> np.ndarray:
        return before

    def moved(self, given: np.ndarray, times: np.ndarray, body: np.ndarray | None = None) -> np.ndarray:
        run, found = self.run, []
        for row, t in zip(given, times.tolist()):
            start = by_site(run.plan._one, run.view.states(row[1:]))
            found.append(run.shorter(site_rows(start), row.item(0), t))
        return flat(run.states(np.array(found)), len(found))

    def looks(self, before: np.ndarray, after: np.ndarray, body: np.ndarray) -> np.ndarray:
        """Counts of looks by the velocities at the ends of steps of which each goes on from the last."""
        run, system = self.run, self.run.plan._one
        mu = run.view.arrays(np.concatenate([before[:1, 1:], after[:, 1:]]))["mu"]
        turned = turning_of(system.group.acting)(run.h * np.array(system.velocity(mu)).reshape(len(mu), -1))
        return looks_by_velocity(np.maximum(turned[:-1], turned[1:]))


class LinksRun(SiteRun, Moving):
    """One run of a linkage of many bodies.  What is asked of the state of all of them, events and
    functions that are recorded, looks at the states that steps lead to.
    """

    streams = True  # functions are found at the end

    def __init__(self, plan: Any, site: Any, start: Any, *given: Any) -> None:
        super().__init__(plan, site, start, *given)
        self.known_places: dict[str, Any] = {}  # of inputs
        self.asked_for = plan._steps.compiled
        if plan.recorder is not None and plan.recorder.quantities:
            self.quantities = Quantities(self, plan.recorder)
        if plan.events:
            self.over, self.sign = np.array([False]), np.sign([self.h])
            self.met_before: Any = ({}, {}) if isinstance(start, StateOfSites) else ({0: start.met}, {})
            arrays = self.states(self.shape.shown_rows(self._memory)[None])
            self.here = np.append(self.begun, flat(arrays, 1)[0])[:, None]
            self.between, self.cuts = LinksBetween(self), {}  # type: Any, dict[int, int]
            self.events: Any = Events(self, plan.events)

    def _room_for(self, width: int) -> Planes:
        """Two copies of what the method carries along, and what a step works with.  Elimination goes
        from joint to joint, so that one thread makes a step.
        """
        self.workers = 1
        form = self.plan._one.linked
        before = 2 * width + self.shape.method.room
        made = Planes.of_rows(before + len(form.fixed) + form.more, self.count)
        self.of = columns(Planes(made.array[before:], self.count), work=form.links.work).work.fields
        self.work[: len(form.fixed), : self.count] = form.fixed
        return made

    @property
    def work(self) -> np.ndarray:
        """The numbers that a step works with, of which `of` has columns by name."""
        numbers: np.ndarray = self.of.inertia.array
        return numbers

    def become(self, plan: Any, anew: bool) -> None:
        """Go on with the plan of another linkage, of the same joints and kinds of forces.

        anew : the method begins with it at this state.
        """
        form = plan._one.linked
        if form.links.kinds != self.site.kinds or form.fixed.shape != self.plan._one.linked.fixed.shape:
            raise InvalidInput(
                "Stepper.step: an input of another kind, such as a table in the place of a number, "
                "makes another linkage; go on with plan.replace(system=...).stepper(loop.state, loop.t)"
            )
        self.plan, self.site = plan, form.links
        self.work[: len(form.fixed), : self.count] = form.fixed
        if anew:
            self._begin_at(self.shape.shown_rows(self._memory))

    def take(self, new: list[tuple[Any, list[float]]]) -> bool:
        """Write down new values of parameters of forces at joints; False for others."""
        places = [self._places(one) for one, _ in new]
        if None in places:
            return False
        for (row, column), (_, numbers) in zip(places, new):
            self.work[row : row + len(numbers), column] = numbers
        self._begin_at(self.shape.shown_rows(self._memory))
        return True

    def _places(self, one: Any) -> Any:
        """The first row and the column of a parameter of a force at a joint; None for others."""
        if one.name not in self.known_places:
            self.known_places[one.name] = place_of(self.plan._one, one)
        return self.known_places[one.name]

    def _begin_at(self, rows: np.ndarray) -> None:
        self.work[len(self.plan._one.linked.fixed) :] = 0.0
        super()._begin_at(rows)

    def states(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """States as users see them, of the numbers of places, (n, width, places)."""
        arrays = unpacked(self.shape.state, np.moveaxis(rows, 1, -1))
        seen: dict[str, np.ndarray] = self.plan._one.as_users_see(arrays)
        return seen

    # ---------------------------------------------------------------- events

    def _call(self, turns: int) -> None:
        """Some more steps; with events up to the first that ends the run.  Ctrl-C while they are looked
        at leaves the run where it was.
        """
        if self.events is None or not turns:
            super()._call(turns)
            return
        watch, made = self.events.each[0], self.samples.made
        arrays = self.sites.array[: 2 * self.shape.memory.width], self.place, self.clocks, self.march
        before, values = [x.copy() for x in arrays], [*watch.values]
        try:
            stopped = self._watched(turns)
        except KeyboardInterrupt:
            for x, old in zip(arrays, before):
                x[:] = old
            self.samples.made, watch.values = made, values
            for column in (self.of.at_joint, self.of.reached, self.of.ready):
                column.put(0, 0.0)
            self.events.forget()
            raise
        if stopped is not None:
            raise stopped

    def _steps(self, turns: int, samples: SamplesOfSites) -> None:
        """Some more steps; what is shown of the state to which they have led is found after Ctrl-C and
        after a step that has failed, too.
        """
        stopped = None
        try:
            super()._steps(turns, samples)
        except KeyboardInterrupt as caught:
            stopped = caught
            super()._steps(0, samples)
        if self.shape.method.settles and self.of.ready.at(0) == BROKEN:
            shape, (t, copy) = self.shape, (float(self.clocks[TIME, 0]), self._copy)
            with shape.stepping.plain():
                shape.method.settle_anew(self.site, t, self.sites, copy, shape.memory)
        if stopped is not None:
            raise stopped

    def _watched(self, turns: int) -> Any:
        """Some steps, and a look at them; Ctrl-C after some of them."""
        first, turns = self.taken, min(turns, SEEN, self.first + self.steps - self.taken)
        start, ends = self.shape.shown_rows(self._memory), self.t0 + np.arange(first + 1, first + turns + 1) * self.h
        every, stopped = SamplesOfSites(self.shape, self.count, ends, ends), None  # type: Any, Any
        try:
            self._steps(turns, every)
        except KeyboardInterrupt as caught:
            stopped = caught
        rows = np.concatenate([start[None], every.rows])
        out = np.column_stack([np.append(self.here[0], every.t), flat(self.states(rows), len(rows))])[:, :, None]
        piece = PieceOfBodies(self, np.array([0]), out, self.here[0], np.array([first]))
        try:
            hit = self.events.see(piece).get(0)
        except Exception as error:
            self._keep_up_to(piece.a.item(getattr(error, "step", 0)), piece, rows)
            raise self._with_run(error, None) from error.__cause__
        self._keep_up_to(out.item(-1, 0, 0) if hit is None else hit[1], piece, rows)
        if hit is not None:
            k, end, event, _ = hit
            if not self.fixed_times and self.samples.times[self.samples.made - 1] != end:
                self.samples.end_at(end)
                self.samples.keep(self._seen_at(end, k, piece, rows), NOTHING)
            self.t_end, self.ended, self.cuts[0], self.clocks[TAKEN] = end, event, event, first + k + 1
        self.here = out[-1]
        return stopped

    def _keep_up_to(self, end: float, piece: PieceOfBodies, rows: np.ndarray) -> None:
        """Keep the samples up to a time in some steps.  rows : the numbers of places at their ends."""
        samples, sign = self.samples, self.sign.item()
        due, done = samples.times[samples.made :], 0
        due = due[sign * due <= sign * end]
        steps = np.searchsorted(sign * piece.b, sign * due)
        for k in np.flatnonzero(piece.b[steps] != due).tolist():
            samples.keep(rows[steps[done:k] + 1], NOTHING)
            samples.keep(self._seen_at(due.item(k), steps[k], piece, rows), NOTHING)
            done = k + 1
        samples.keep(rows[steps[done:] + 1], NOTHING)

    def _seen_at(self, t: float, k: int, piece: PieceOfBodies, rows: np.ndarray) -> np.ndarray:
        """The numbers of places at a time in step k of a piece."""
        return rows[k + 1] if t == piece.b[k] else self.shorter(rows[k], piece.a.item(k), t)

    def _attend(self) -> None:
        """As without events; a run that one has ended has its samples."""
        if self.ended is None:
            super()._attend()

    def tell(self, made: Any) -> None:
        if self.events is not None:
            self.events.tell()

    def shorter(self, rows: np.ndarray, begun: float, at: float) -> np.ndarray:
        """The states to which a shorter step leads, from such at its beginning."""
        if at == begun:
            return rows
        found: np.ndarray = self.shape.shown_rows(self.stepped_from(rows, begun, at)._memory)
        return found

    # ---------------------------------------------------------------- functions of the state

    @functools.cached_property
    def view(self) -> AsItIs:
        """The view that shows rows of numbers as states."""
        arrays = self.states(self.shape.shown_rows(self._memory)[None])
        return AsItIs(small_state(one_of(arrays), {name: x[0] for name, x in arrays.items()}))

    def require_ends(self) -> None:
        """Find what is recorded."""
        super().require_ends()
        try:
            if self.quantities is not None:
                self.quantities.flush()
        except (Exception, IntegrationInterrupted) as error:
            raise self._with_run(error, None) from error.__cause__

    def flush(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and numbers of all samples."""
        return self.samples.t, flat(self.states(self.samples.rows), self.samples.made)

    def _why(self, failures: list[Any], first: int, again: Any) -> Any:
        """The reason for which a step failed, and at which joint."""
        if failures and not isinstance(failures[-1], NoConvergence):
            return failures[-1]
        system: Any = self.plan._one
        joint, reached = self.of.at_joint.at(0), self.of.reached.at(0)
        self.of.at_joint.put(0, 0.0)
        method = repr(self.plan.method)
        if joint == THROWN:
            seen, h = self.shape.shown_rows(self._memory), abs(reached)
            state = as_users_see(system, state_of_rows(self.shape.state, seen))
            t = float(self.clocks[TIME, 0])
            share = self.plan.method.tableau.reach if isinstance(self.plan.method, Composition) else 1.0
            return bound_refusal(self.plan.method, system, t, state.mu, state.g, h, share)
        if joint < 0.0:
            return NoConvergence(
                f"{method}: no velocity found that fits the loads at the end of a step; try h = {0.25 * self.h:g}"
            )
        label = system.label(int(joint))
        if reached < 0.0:
            return NoConvergence(
                f"{method}: at {label} conditions depend on those of other joints, so that there are no "
                f"multipliers: a dead point{self._left}"
            )
        why = f"The step h = {self.h:g} is too long there; try {0.25 * self.h:g}"
        if isinstance(system, BoundBody) and system.conditions <= FEW:
            seen = self.shape.shown_rows(self._memory)
            state = as_users_see(system, state_of_rows(self.shape.state, seen))
            why = near_a_dead_point(system, state.g) or why
        return NoConvergence(
            f"{method}: the solution that grows out of h = 0 ends at h = {reached * self.h:.3g}, at {label}. {why}"
        )

    @property
    def _left(self) -> str:
        """Another reason for it, of methods that leave the conditions."""
        keeps = isinstance(self.shape.method, (RattleOfLinks, MultipleTimeStepsOfLinks))
        return "" if keeps else f", or steps too long to stay near them; try h = {0.25 * self.h:g}"

    def _origin(self, error: Any, t: float) -> Any:
        """The error itself, which knows the joint."""
        return error
