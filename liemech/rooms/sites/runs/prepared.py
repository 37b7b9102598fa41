"""Layouts and native code that runs of many sites have in common which begin alike."""

from __future__ import annotations

import functools
import inspect
from typing import Any

import numpy as np

from ....compiler import kernel
from ....compiler.sites.planes import Planes, load
from ....errors import InvalidInput
from ....formulas import Record, record
from ....formulas.classes.flattening import build, leaves
from ....formulas.classes.layouts import carried_layout, layout_of
from ....formulas.classes.records import names_of, with_fields
from ....formulas.numbers.conversions import rounded, with_slopes
from ....formulas.sites import EIGHT, one_site
from ....integrators.ending_at_jumps import uncut
from ....simulation.compiled.control import Equal, Tolerance
from ....systems.system import State
from ..terms.terms_at_site import at_this_site
from .driver import (
    BESIDE,
    PLACE,
    Embedded,
    OfSite,
    Share,
    Shown,
    Sighted,
    Whole,
    advance_sites,
    begin_sites,
    first_memory,
    look_inside,
)
from .execution import LONG, SiteExecution

SOME = 3
"""Sites among which a formula is tried whose layout alone is asked for."""


class Prepared:
    """The layouts and the native code of runs of a plan whose starts are alike.

    control : of the steps.  method : of one site, as the control needs it.  way : the state inside of
    a step.  given, started : layouts of one site at the start, as it comes and in the numbers of the
    run.  memory, state : of what the method carries along for it, and of what is shown.  place : of
    what the control carries along.  turning : how a splitting by colours steps.  ending : where steps are cut;
    None: nowhere.  paces : of runs of so many sites, how many steps a call has come to make.
    """

    turning: Any = None
    ending: Any = None
    control: Any
    way: Any
    method: Any

    def __init__(self, plan: Any, site: Any, first: State, starts: Planes, curves: bool, level: float | None) -> None:
        steps = plan._steps
        self.plan, self.site, self.control, self.place = plan, site, Equal(True), PLACE
        self.paces: dict[int, int] = {}
        self.given = self.started = layout_of(first)
        if plan.adaptive:
            self.control, self.place = Tolerance(curves, False), BESIDE
            self.method = self.way = Embedded(steps.method, curves)
            self.h = 0.0
        else:
            way: Any = plan._sites.method
            self.h = steps.h
            self.method, self.ending = uncut(way), None if uncut(way) is way else way
            self.way = Whole(self.method, self.ending)
            self.started = layout_of(steps.remembering_of(site, first))
        self.beginner = self.method, site, self.given, self.started
        some = min(starts.count, SOME)
        carry = one_site(some, 0, first_memory, *self.beginner, self.h, starts)
        if level is not None:  # all that it carries along may come to depend on the start
            carry = with_slopes(carry, level)
        example = rounded(self.method.observe(carry))
        self.memory, self.state = carried_layout(carry), layout_of(example)
        self.shown = self._shown(example, some, starts)
        events = () if site.jointed else plan.events  # they look at samples
        for event in events:
            require_totals(event, self._named())
        self.sighted = Sighted(self.shown, events, carried_layout((0.0,) * len(events)), self._named())
        none, planes = kernel.Columns(np.empty(0)), Planes.of_rows(1, 1)
        self.most = min(EIGHT, starts.count) if site.jointed else EIGHT
        self.beginning = SiteExecution(
            steps.compiled, steps.progress, begin_sites, *self.beginner, self.memory, self.h, planes,
            planes, none, None, most=self.most,
        )  # fmt: skip

    @functools.cached_property
    def stepping(self) -> SiteExecution:
        """Who runs the driver of steps."""
        steps, planes = self.plan._steps, Planes.of_rows(1, 1)
        none, shared = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
        return SiteExecution(
            steps.compiled, steps.progress, advance_sites, *self.stepper, 1, planes, planes, *[shared] * 3,
            *[none] * 4, *[shared] * 3, None, most=self.most,
        )  # fmt: skip

    @functools.cached_property
    def looking(self) -> SiteExecution:
        """Who looks inside of a step."""
        steps, planes = self.plan._steps, Planes.of_rows(1, 1)
        none, shared = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
        return SiteExecution(
            steps.compiled, steps.progress, look_inside, *self.looker, 0.0, 0.0, 0.0, planes, planes,
            shared, shared, none, none, None, most=self.most,
        )  # fmt: skip

    def look(
        self, looking: SiteExecution, site: Any, begun: float, at: float, end: float, sites: Planes, here: int, workers: int = 1,
        totals: Any = None, values: Any = None,
    ) -> tuple[Planes, list[Any] | None, int]:  # fmt: skip
        """The states of all sites inside of the last step, and if they are not found the failures, else None,
        and the first of the sites among which one failed.

        looking : who looks, for this run.  here : which copy of the memory has the end of the step.  totals, values : to be filled.
        """
        seen = Planes.of_rows(self.state.width, sites.count)
        done, place = np.zeros((1, 1)), np.zeros((2, 1))
        place.view(np.int64)[0, 0] = here
        totals = np.zeros(max(1, self.shown.totals.width)) if totals is None else totals
        values = np.zeros(1) if values is None else values
        failures, notes = [], 0  # type: list[Any], int
        given: Any = self.way, site, *self.looker[2:], begun, at, end, sites, seen
        with looking.on_sites(LONG * sites.count, sites.count, workers) as calls:
            if calls is not None:
                calls(*given, kernel.Shared(totals), kernel.Shared(values), place, done, None)
                notes = calls.notes
            else:
                columns = totals, values, place.ravel(), done.reshape(-1)
                driver: Any = look_inside
                driver(*given, *columns, failures)
        return seen, None if done[0, 0] else failures, notes

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
        form = self.memory, self.place, self.sighted
        return self.method, self.site, self.control, *form, self.ending

    @property
    def looker(self) -> tuple[Any, ...]:
        """Those of `look_inside`."""
        return self.way, self.site, self.memory, self.inner

    @property
    def inner(self) -> Sighted:
        """Everything looked at inside of a step: the states, even if samples have none."""
        whole: Sighted = with_fields(self.sighted, shown=with_fields(self.shown, kept=True))
        return whole

    @property
    def lasting(self) -> int:
        """Of the numbers that a site carries along those that are handed on: not the way of a step."""
        return self.memory.width - (self.memory.parts[2].width if self.plan.adaptive else 0)

    def taken_up(self, numbers: np.ndarray, sites: int) -> np.ndarray:
        """Numbers that so many sites carry along, of those that were handed on."""
        way = self.memory.width - self.lasting
        if numbers.shape != (self.lasting, sites) or numbers.dtype != np.dtype(float):
            raise InvalidInput(
                f"Plan.resume: the run carries {numbers.shape} numbers of {numbers.dtype} along; this plan has "
                f"{self.lasting} for each of {sites} sites"
            )
        return np.concatenate([numbers, np.zeros((way, sites))])

    def _named(self) -> Any:
        """An example of the totals, with their names."""
        names = tuple(self.plan._sites.summed) if self.shown.quantities else ()
        layout = self.shown.totals
        return totals_class(names)(*build(layout, iter([0.0] * layout.width)))

    def _shown(self, example: Any, count: int, starts: Planes) -> Shown:
        """The content of samples."""
        recorder = self.plan.recorder
        if self.site.jointed:
            return Shown(True, self.state, (), carried_layout(()))
        sites = self.plan._sites
        kept = recorder is None or bool(recorder.parts or recorder.chosen or sites.of_all)
        quantities = sites.summed.values()
        found = tuple([quantity_of(self.site, wanted, example) for wanted in quantities])
        numbers: list[Any] = []
        for quantity in found:
            arguments = quantity, self.site, self.given, starts
            numbers.append(one_site(count, 0, _one_value, *arguments))
        return Shown(kept, self.state, found, carried_layout(tuple(numbers)))


def require_totals(event: Any, named: Any) -> None:
    """Raise InvalidInput for an event that asks for a total that `record` does not name."""
    try:
        event(0.0, named)
    except AttributeError as error:
        if error.obj is named:
            kind: Any = type(named)
            raise InvalidInput(
                f"integrate: an event asks for total.{error.name}; record= names {', '.join(names_of(kind))}"
            ) from None
    except Exception:  # of zeros it may fail
        return


@functools.cache
def totals_class(names: tuple[str, ...]) -> Any:
    """The class of totals with these names."""
    fields = {"__annotations__": dict.fromkeys(names, Any), "__module__": __name__}
    return record(type(f"Totals_{'_'.join(names)}", (Record,), fields))


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
