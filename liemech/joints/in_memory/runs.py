"""Runs of linkages of any size: steps of all bodies and joints together, in memory."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ...compiler.sites.planes import Planes, columns
from ...errors import IncompatibleSystem, InvalidInput, NoConvergence, NotFinite, StepWarning, warn
from ...formulas.classes.layouts import layout_of
from ...formulas.tables import Table
from ...groups.retractions import Exponential
from ...integrators.commutator_free import CommutatorFree
from ...integrators.composition import Composition
from ...integrators.ending_at_jumps import EndingAtJumps, cuts
from ...integrators.kicks.explicit_kicks import bound_refusal
from ...integrators.kicks.multiple_time_steps import MultipleTimeSteps
from ...integrators.method import steps_as
from ...integrators.rkmk import RKMK
from ...integrators.taylor import Taylor
from ...rooms.constraints.constrained_body import BoundBody
from ...rooms.constraints.lie_rattle import LieRATTLE, near_a_dead_point
from ...rooms.constraints.rattle import RATTLE
from ...rooms.sites.runs.driver import OVERFLOW
from ...rooms.sites.runs.events import StepsOfSites
from ...rooms.sites.runs.run import SiteRun
from ...rooms.sites.runs.samples import SamplesOfSites
from ...rooms.sites.runs.states import as_users_see, one_of, state_of_rows
from ...simulation.between.dense import flat, unpacked
from ...simulation.between.events import Moving
from ...simulation.between.turning import looks_by_velocity, turning_of
from ...simulation.compiled.control import MARK, TIME
from ...simulation.compiled.parameters import places_of
from ...simulation.keep import Quantities
from ...simulation.result import AsItIs
from ...systems.system import small_state
from .links import BROKEN, DEAD_POINT, LinkedBodies
from .loads_of_links import THROWN
from .multiple_time_steps_of_links import MultipleTimeStepsOfLinks
from .rattle_of_links import RattleOfLinks
from .taylor_of_links import TaylorOfLinks, terms_of

SHORT, LOW = 3, 4
"""Conditions of a joint, and orders, up to which the formulas of joints are written out once for each
order.
"""

FEW = 600
"""Conditions among which those are found that depend on each other, where a step has failed."""


def linked_method(plan: Any) -> Any:
    """The method of a plan as that of many bodies and joints; None if there is none, or the system has no such form."""
    system, site = plan._one, plan._one.site_form
    if not isinstance(site, LinkedBodies) or plan.fictive:
        return None
    if plan.adaptive:
        method = plan._steps.method
        return method if type(method) is RKMK else written_out(method, "adaptive steps")
    method, ending = plan._steps.way_of(0), None
    if isinstance(method, EndingAtJumps):
        ending, method = (method if cuts(method, system) else None), method.method
    if steps_as(method, Composition):
        return rattle_of(method, method.base, [*zip(method.tableau.gamma, method.tableau.nodes)], site, ending)
    explicit = type(method) is RKMK and method.tableau.explicit
    in_doubles = plan._steps.precision == "double"
    if explicit or (in_doubles and (type(method) is RKMK or isinstance(method, CommutatorFree))):
        return method if ending is None else None
    if type(method) is Taylor:
        for has, what in (
            (ending is not None, "steps that end where inputs jump"),
            (site.rheonomic, "joints in a given motion"),
            (site.geared, "rotors"),
            (site.on_all is not None, "potential or load of all bodies by one formula"),
        ):
            if has:
                return written_out(method, what)
        return taylor_of(method, site)
    if type(method) is MultipleTimeSteps and ending is None and not site.geared:
        fast: Any = rattle_of(method, LieRATTLE(Exponential()), [(1.0, 0.0)], site)
        return MultipleTimeStepsOfLinks(repr(method), fast, float(method.ratios[0]))
    return rattle_of(method, method, [(1.0, 0.0)], site, ending)


def rattle_of(method: Any, base: Any, shares: Any, site: LinkedBodies, ending: Any = None) -> RattleOfLinks | None:
    """A composition of LieRATTLE, or of RATTLE of points, as that of many bodies and joints; None of other methods.

    shares : of its substeps, each with its node.
    """
    if not steps_as(base, LieRATTLE, RATTLE):
        return None
    retraction = base.retraction if isinstance(base, LieRATTLE) else Exponential()  # of points
    count = len(shares)
    return RattleOfLinks(repr(method), retraction, Table(np.ravel(shares)), float(count), count, site.most, ending)


def written_out(method: Any, what: str) -> None:
    """Nothing: the equation is written out for all bodies.  Raises IncompatibleSystem for a Taylor method
    in a chart that this equation has not.
    """
    if type(method) is Taylor and not isinstance(method.retraction, Exponential):
        raise IncompatibleSystem(
            f"{method!r}: by loops over bodies and joints there are no {what}. RKMK(order=5) may have them; "
            f"Taylor(order={min(method.order, 14)}, retraction=Exponential()) writes the equation out for all bodies, slowly"
        )


def taylor_of(method: Taylor, site: LinkedBodies) -> TaylorOfLinks:
    """A Taylor series method as that of many bodies and joints."""
    order = method.order
    short = site.most <= SHORT or order <= LOW
    spans = range(2, order + 2) if short else (order // 2 + 1, order + 1)
    return TaylorOfLinks(repr(method), method, order, float(order), tuple(spans), terms_of(order, site.most))


def place_of(linkage: Any, parameter: Any) -> tuple[int, int] | None:
    """The first row, among the numbers that do not change, and the column of an input that is a
    parameter of a force at a joint; None for others.
    """
    head, _, path = parameter.name.partition(".")
    k, _, path = path.partition(".")
    if head != "forces" or not path:
        return None
    form, force = linkage.linked, linkage.forces[int(k)]
    number = linkage.number(force.joint)
    before = [
        x for x in linkage.forces[: int(k)]
        if linkage.number(x.joint) == number
        and linkage._has_potential(x) is linkage._has_potential(force)
    ]  # fmt: skip
    side = "springs" if linkage._has_potential(force) else "loads"
    joint = form.joints[number]
    rows = places_of(joint, f"{side}.{len(before)}.{path}", parameter.layout)
    if rows is None or len(rows) != 1:
        return None
    parameters = columns(Planes(form.fixed, form.places), work=form.links.work).work.fields.joint_parameters
    return parameters.nth(form.links.kinds.index(layout_of(joint))).rows[rows[0]], number


class StepsOfLinkage(StepsOfSites):
    """The steps of a linkage, as events ask for them: the numbers that these see are the state of all bodies."""

    ask, refused, seen_at, wide = Moving.ask, Moving.refused, Moving.seen_at, Moving.wide

    def __init__(self, run: LinksRun, start: Any) -> None:
        super().__init__(run, start)
        self.view = run.view

    def _numbers(self, rows: np.ndarray, totals: np.ndarray) -> np.ndarray:
        """The numbers of states of all bodies, of states of all places, (..., width, places)."""
        stack = rows.reshape(-1, *rows.shape[-2:])
        return flat(self.run.states(stack), len(stack)).reshape(*rows.shape[:-2], -1)

    def looks(self, piece: Any, step: np.ndarray) -> np.ndarray:
        """Counts of looks by the velocities at the ends of steps of which each goes on from the last."""
        run, system = self.run, self.run.plan._one
        before, after = piece.rows(step, before=True), piece.rows(step)
        mu = run.view.arrays(np.concatenate([before[:1, 1:], after[:, 1:]]))["mu"]
        velocities, spans = np.array(system.velocity(mu)).reshape(len(mu), -1), after[:, :1] - before[:, :1]
        turning = turning_of(system.group.acting)
        return looks_by_velocity(np.maximum(turning(spans * velocities[:-1]), turning(spans * velocities[1:])))

    def failed(self, error: Any) -> Any:
        return error

    def return_to(self, stand: tuple[np.ndarray, ...], steps: int) -> None:
        work = self.run.of
        for column in (work.failed_joint, work.reached, work.ready):
            column.put(0, 0.0)
        super().return_to(stand, steps)


class LinksRun(SiteRun):
    """One run of a linkage of many bodies.  What is asked of the state of all of them, events and
    functions that are recorded, looks at the states that steps lead to.
    """

    names_place = True
    streams = True  # functions are found at the end
    takes_inputs = True
    kind_of_observer = StepsOfLinkage

    def __init__(self, plan: Any, site: Any, start: Any, *given: Any) -> None:
        super().__init__(plan, site, start, *given)
        self.known_places: dict[str, Any] = {}  # of inputs
        self.compiled_asked = plan._steps.compiled
        if plan.recorder is not None and plan.recorder.quantities:
            self.quantities = Quantities(self, plan.recorder)

    def _room_for(self, width: int) -> Planes:
        """Two copies of what the method carries along, and what a step works with.  Elimination goes
        from joint to joint, so that one thread makes a step.
        """
        self.workers = 1
        form = self.plan._one.linked
        before = 2 * width + getattr(self.shape.method, "room", 0)
        working_rows = form.working_rows + self.site.work.width - form.links.work.width
        planes = Planes.of_rows(before + len(form.fixed) + working_rows, self.count)
        self.of = columns(Planes(planes.array[before:], self.count), work=self.site.work).work.fields
        self.work[: len(form.fixed), : self.count] = form.fixed
        return planes

    @property
    def work(self) -> np.ndarray:
        """The numbers that a step works with, of which `of` has columns by name."""
        return self.of.inertia.array

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

    def take(self, new: list[Any], held: Any) -> bool:
        """Write down new values of parameters of forces at joints; False for others."""
        places = [self._places(x.input) for x in new]
        if None in places:
            return False
        for (row, column), (_, numbers, _) in zip(places, new):
            self.work[row : row + len(numbers), column] = numbers
        self._begin_at(self.shape.shown_rows(self._memory))
        return True

    def _places(self, parameter: Any) -> Any:
        """The first row and the column of a parameter of a force at a joint; None for others."""
        if parameter.name not in self.known_places:
            self.known_places[parameter.name] = place_of(self.plan._one, parameter)
        return self.known_places[parameter.name]

    def _begin_at(self, rows: np.ndarray) -> None:
        self.work[len(self.plan._one.linked.fixed) :] = 0.0
        super()._begin_at(rows)

    def states(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """States as users see them, of the numbers of places, (n, width, places)."""
        arrays = unpacked(self.shape.state, np.moveaxis(rows, 1, -1))
        return self.plan._one.as_users_see(arrays)

    # ---------------------------------------------------------------- steps

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
        if self.clocks[MARK, 0] == 0.0 and self.of.reached.at(0) == DEAD_POINT:
            joint, t = self.plan._one.label(int(self.of.failed_joint.at(0))), self.clocks.item(TIME, 0)
            warn(
                f"{self.plan.method!r}: up to t = {t:g} a sample lies at a dead point, at {joint}, whose conditions depend "
                "there on those of others: its velocity is not led back to them. Steps of another length pass it",
                StepWarning,
            )
            self.of.reached.put(0, 0.0)

    def _ways_and_ends(self, asked: Any) -> tuple[bool, bool]:
        """As of a body: all steps are kept if no times are asked for, and their ways if no functions are recorded."""
        dense, all_steps = self.plan.options.dense, asked is None
        return dense is True or (dense is None and all_steps and self.plan.recorder is None), all_steps

    # ---------------------------------------------------------------- functions of the state

    @functools.cached_property
    def view(self) -> AsItIs:
        """The view that shows rows of numbers as states."""
        arrays = self.states(self.shape.shown_rows(self._memory)[None])
        return AsItIs(small_state(one_of(arrays), {name: x[0] for name, x in arrays.items()}))

    def require_ends(self) -> None:
        """Find the values of all functions that are recorded."""
        super().require_ends()
        if self.quantities is not None:
            self.quantities.flush()

    def flush(self) -> tuple[np.ndarray, np.ndarray]:
        """Times and numbers of all samples."""
        return self.samples.t, flat(self.states(self.samples.rows), self.samples.made)

    def _why(self, failures: list[Any], first: int, again: Any) -> Any:
        if failures and not isinstance(failures[-1], NoConvergence):
            return failures[-1]
        system: Any = self.plan._one
        joint, reached = self.of.failed_joint.at(0), self.of.reached.at(0)
        for column in (self.of.failed_joint, self.of.reached):
            column.put(0, 0.0)
        if not self.shape.method.together and joint == reached == 0.0:
            return failures[-1] if failures else NotFinite(OVERFLOW)
        method = repr(self.plan.method)
        if joint == THROWN:
            numbers, h = self.shape.shown_rows(self._memory), abs(reached)
            state = as_users_see(system, state_of_rows(self.shape.state, numbers))
            t = float(self.clocks[TIME, 0])
            share = self.plan.method.tableau.reach if isinstance(self.plan.method, Composition) else 1.0
            return bound_refusal(self.plan.method, system, t, state.mu, state.g, h, share)
        if joint < 0.0:
            return NoConvergence(
                f"{method}: no velocity found that fits the loads at the end of a step; try h = {0.25 * self.h:g}"
            )
        label = system.label(int(joint))
        if reached == DEAD_POINT:
            velocity = self.of.velocity
            if not np.isfinite(velocity.array[velocity.rows, : self.count]).all():
                return NotFinite(OVERFLOW)
            return NoConvergence(
                f"{method}: at {label} conditions depend on those of other joints, so that there are no "
                f"multipliers: a dead point{self._left}"
            )
        why = f"The step h = {self.h:g} is too long there; try {0.25 * self.h:g}"
        if isinstance(system, BoundBody) and system.conditions <= FEW:
            numbers = self.shape.shown_rows(self._memory)
            state = as_users_see(system, state_of_rows(self.shape.state, numbers))
            why = near_a_dead_point(system, state.g) or why
        return NoConvergence(
            f"{method}: the solution that grows out of h = 0 ends at h = {reached * self.h:.3g}, at {label}. {why}"
        )

    @property
    def _left(self) -> str:
        """Another reason for it, of methods that leave the conditions."""
        if isinstance(self.shape.method, (RattleOfLinks, MultipleTimeStepsOfLinks)):
            return ""
        smaller = f"rtol = {0.01 * self.way.rtol:g}" if self.adaptive else f"h = {0.25 * self.h:g}"
        return f", or steps too long to stay near them; try {smaller}"
