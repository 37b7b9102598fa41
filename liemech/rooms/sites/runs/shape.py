"""The shape of runs of many sites: layouts and native code that those have in common which begin alike."""

from __future__ import annotations

import functools
import inspect
from typing import Any

import numpy as np

from ....compiler import kernel
from ....compiler.sites.planes import Planes, load
from ....errors import InvalidInput
from ....formulas.classes.layouts import build, carried_layout, layout_of, leaves
from ....formulas.classes.records import with_fields
from ....formulas.numbers.conversions import rounded, with_slopes
from ....formulas.sites import EIGHT, one_site
from ....integrators.ending_at_jumps import uncut
from ....simulation.compiled.control import Equal, Tolerance
from ....systems.system import State
from ..terms.terms_at_site import at_this_site
from .driver import (
    BESIDE,
    PLACE,
    Beginner,
    Embedded,
    Moment,
    OfSite,
    Procedure,
    Share,
    Shown,
    advance_sites,
    begin_sites,
    first_memory,
    look_inside,
)
from .events import compiles, totals_class
from .execution import LONG, SiteExecution
from .turns import Turns

NONE: Any = kernel.Columns(np.empty(0))

SOME = 3
"""Sites among which a formula is tried whose layout alone is asked for."""


class SiteShape:
    """The layouts and the native code of runs of a plan whose starts are alike.

    beginner : how sites begin.  procedure : how they are taken on.  state : the layout of what is shown of one
    site.  shown : the content of what the driver writes.  keeps : do samples have states?  named : an example of totals with
    their names.  watched : does the driver ask events?  paces : of runs of so many sites, how many steps a call has come to make.
    """

    def __init__(
        self, plan: Any, site: Any, first: State, starts: Planes, inside: bool, all_steps: bool, level: float | None
    ) -> None:
        steps, layout = plan._steps, layout_of(first)
        self.plan, self.site, control, place = plan, site, Equal(True), PLACE  # type: Any, Any, Any, Any
        self.paces: dict[int, int] = {}
        started, ending, self.h = layout, None, 0.0
        if plan.adaptive:
            control, place = Tolerance(inside, False), BESIDE
            method: Any = Embedded(steps.method, inside)
        else:
            cut_method: Any = plan._sites.method
            self.h, method = steps.h, uncut(cut_method)
            ending = None if method is cut_method else cut_method
            if plan._sites.places is not None:
                method, ending = Turns.of_splitting(cut_method, method, plan._one, inside), None
            started = layout_of(steps.remembering_of(site, first))
        sites_to_try = min(starts.count, SOME)
        carry = one_site(sites_to_try, 0, first_memory, Beginner(method, layout, started, layout), site, self.h, starts)
        if level is not None and plan._sites.places is None:
            carry = with_slopes(carry, level)  # all that is carried along may come to depend on the start
        example = rounded(method.observe(carry))
        self.memory, self.state = carried_layout(carry), layout_of(example)
        self.beginner, self.method = Beginner(method, layout, started, self.memory), method
        self.keeps, quantities, totals = self._shown(example, sites_to_try, starts)
        names = totals_class(tuple(plan._sites.summed) if quantities else ())
        self.named = names(*build(totals, iter([0.0] * totals.width)))
        self.watched = all_steps and plan._sites.of_totals and all(compiles(plan, x, self.named) for x in plan.events)
        all_steps = all_steps and not self.watched
        whole = all_steps and plan.adaptive
        of_samples = self.memory if whole else self.state
        self.shown = shown = Shown(all_steps or self.keeps, whole, of_samples, quantities, totals)
        question: Any = {}
        if self.watched:
            question = {"events": plan.events, "named": self.named, "counted": with_fields(shown, kept=False)}
            shown = with_fields(shown, quantities=())
        self.procedure = Procedure(method, control, self.memory, place, shown, all_steps, ending, **question)
        self.most = min(EIGHT, starts.count) if site.jointed else EIGHT

    def _execution(self, driver: Any, *call: Any) -> SiteExecution:
        """The execution of a driver for runs of this shape."""
        steps = self.plan._steps
        return SiteExecution(steps.compiled, steps.progress, driver, *call, None, most=self.most)

    @functools.cached_property
    def beginning(self) -> SiteExecution:
        """The execution of the driver before the first step."""
        planes = Planes.of_rows(1, 1)
        return self._execution(begin_sites, self.beginner, self.site, self.h, planes, planes, NONE)

    @functools.cached_property
    def stepping(self) -> SiteExecution:
        """The execution of the driver of steps."""
        planes, shared = Planes.of_rows(1, 1), kernel.Shared(np.empty(0))
        arrays = 1, planes, planes, *[shared] * 3, *[NONE] * 4
        return self._execution(advance_sites, self.procedure, self.site, *arrays)

    @functools.cached_property
    def within(self) -> Procedure:
        """The procedure as of looks inside of steps: at states, even if samples have none."""
        shown = with_fields(self.shown, kept=True, whole=False, layout=self.state)
        return with_fields(self.procedure, shown=shown, events=())

    @functools.cached_property
    def looking(self) -> SiteExecution:
        """Who looks inside of a step by an error estimate."""
        planes, shared = Planes.of_rows(1, 1), kernel.Shared(np.empty(0))
        arrays = Moment(0.0, 0.0, 0.0), planes, planes, shared, NONE
        return self._execution(look_inside, self.within, self.site, *arrays)

    def look(
        self, looking: SiteExecution, site: Any, moment: Moment, sites: Planes, workers: int = 1
    ) -> tuple[Planes, np.ndarray, list[Any] | None, int]:
        """The states of all sites inside of the last step, and the totals; if they are not found the failures, else None,
        and the first of the sites among which one failed.

        looking : who looks, for this run.
        """
        states, totals = Planes.of_rows(self.state.width, sites.count), np.zeros(max(1, self.shown.totals.width))
        done, failures = np.zeros(1), []  # type: Any, list[Any]
        arguments: Any = self.within, site, moment, sites, states
        notes = looking.drive((LONG * sites.count, sites.count, workers), arguments, [totals], [done], failures)
        return states, totals, None if done[0] else failures, notes or 0

    @functools.cached_property
    def order(self) -> list[int] | None:
        """For every number of a sample, which one it is of what the method carries along; None if it
        is computed of several.
        """
        numbers = [1.0 + i for i in range(self.memory.width)]
        shown = rounded(self.method.observe(build(self.memory, iter(numbers))))
        numbers_shown = leaves(shown, self.state)
        return [int(x) - 1 for x in numbers_shown] if all(x in numbers for x in numbers_shown) else None

    def shown_rows(self, memory: np.ndarray) -> np.ndarray:
        """The states of all sites, (width, sites), in what the method carries along."""
        if self.order is not None:
            return memory[self.order]
        columns = (build(self.memory, iter(column)) for column in memory.T.tolist())
        states = (rounded(self.method.observe(carry)) for carry in columns)
        return np.array([leaves(state, self.state) for state in states]).T

    @property
    def lasting(self) -> int:
        """Of the numbers that a site carries along those that are handed on: not the way of a step."""
        return self.memory.width - (self.memory.parts[2].width if self.plan.adaptive else 0)

    def taken_up(self, numbers: np.ndarray, sites: int) -> np.ndarray:
        """Numbers that so many sites carry along, of those that were handed on."""
        width_of_way = self.memory.width - self.lasting
        if numbers.shape != (self.lasting, sites) or numbers.dtype != np.dtype(float):
            raise InvalidInput(
                f"Plan.resume: the run carries {numbers.shape} numbers of {numbers.dtype} along; this plan has "
                f"{self.lasting} for each of {sites} sites. Begin anew: plan.run(run.last, t0=run.t[-1], ...)"
            )
        return np.concatenate([numbers, np.zeros((width_of_way, sites))])

    def _shown(self, example: Any, count: int, starts: Planes) -> tuple[bool, tuple[Any, ...], Any]:
        """Do samples have states; the quantities of which they have totals, and the layout of these."""
        recorder = self.plan.recorder
        if self.site.jointed:
            return True, (), carried_layout(())
        sites = self.plan._sites
        keeps_states = recorder is None or bool(recorder.parts or recorder.chosen or sites.of_all)
        quantities = sites.summed.values()
        quantities_of_site = tuple([quantity_of(self.site, wanted, example) for wanted in quantities])
        numbers: list[Any] = []
        for quantity in quantities_of_site:
            arguments = quantity, self.site, self.beginner.given, starts
            numbers.append(one_site(count, 0, _one_value, *arguments))
        return keeps_states, quantities_of_site, carried_layout(tuple(numbers))


def quantity_of(site: Any, wanted: Any, example: Any) -> Any:
    """The value for one site of a name or of a function of a user's."""
    if not isinstance(wanted, str):
        return OfSite(wanted)
    parts = tuple(inspect.signature(getattr(site, wanted)).parameters)
    missing = [name for name in parts if name != "t" and getattr(example, name, None) is None]
    if missing:
        raise InvalidInput(f"integrate: record={wanted!r} needs {', '.join(missing)}; start from a state with it")
    return Share(wanted, parts)


def _one_value(quantity: Any, site: Any, given: Any, starts: Planes) -> Any:
    return quantity(0.0, at_this_site(site), load(starts, 0, given))
