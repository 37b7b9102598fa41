"""Products with the transposed tangent map of a run of many sites, and derivatives by parameters of
terms, at a cost that does not depend on how many sites and parameters there are: the run is gone
through backwards once.

States on the way are made again from few that are kept (`reversal`), a block of steps at a time.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapters 3 and 12.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..compiler import kernel
from ..compiler.planes import Planes
from ..errors import IncompatibleSystem, IntegrationFailure, InvalidInput
from ..formulas import Record
from ..formulas.of_each import Each
from ..formulas.pytree import Layout, carried_layout, exchanged, inside, layout_of, with_fields
from ..formulas.sites import SiteArray, SiteTable, one_site, padded, rows_of
from ..groups.species import SpeciesGroup
from ..integrators.backward import refused, released, step_back
from ..systems.among import is_near
from ..systems.bound_terms import BoundTerm
from ..systems.graphs import AllPairs
from ..systems.site_state import SiteValues
from ..systems.sums_of_terms import MomentumTerms, OfTerms, PlaceTerms
from ..systems.terms import AtTime, Term, site_class
from ..systems.terms_at_site import EachOfSites, TermsOfSite, at_this_site
from .dense import unpacked
from .parameters import full_name, named, parameter
from .reversal import go_back
from .sites_backward import EdgesAsked, Varied, WayBack, backward_sites, edges_back, forward_sites
from .sites_execution import SiteExecution
from .sites_lists import Lists
from .sites_states import first_of, site_rows

ROOM = 2**21
"""Numbers of states, or of what is kept for parameters, that are at hand together."""

KEPT = 16
"""States that are kept on the way."""

WRAPPERS = "term"
"""The field of terms that make something else of a term."""


def why_not(sites: Any, start: Any) -> str:
    """Why a run by sites cannot be gone through backwards; empty if it can."""
    plan, one = sites.plan, sites.plan._one
    group = getattr(one, "configurations", one.group)
    if isinstance(start, SiteValues) or isinstance(group, SpeciesGroup):
        return f"of {type(one).__name__} on {group!r}"
    if plan.adaptive:
        return "with adaptive steps"
    return refused(plan._steps.way_of(0), sites.site)


class Parameter:
    """A parameter of a term by which is differentiated.

    name : as it was asked for.  energy : the terms among which it is, `which` of them; path : of the
    fields that lead to it.
    """

    def __init__(self, system: Any, name: str) -> None:
        caller = "Plan.gradient"
        self.name, self.full = name, full_name(system, name, caller)
        parts = self.full.split(".")
        value: Any = system
        self.energy: Any = None
        for i, part in enumerate(parts):
            if isinstance(value, OfTerms):
                self.energy, rest = value, parts[i:]
            value = value[int(part)] if part.isdigit() else getattr(value, part)
        self.value = value
        known = self.energy is not None and rest[0] == "parts" and rest[2] == "term"
        self.path = tuple(rest[3:]) if known else ()
        inner = {*self.path[:-1]} - {WRAPPERS}
        if not (known and self.path and not inner) or isinstance(value, Record | tuple) and not isinstance(value, Each):
            raise IncompatibleSystem(
                f"{caller}: {name} is no field of a term; derivatives by other parameters of many sites "
                "are found by `along=` of runs with other values, or where the system is written out"
            )
        self.which = int(rest[1])
        self._require_independent(parameter(system, ".".join(parts[:-1])), parts[-1])

    def _require_independent(self, term: Term, field: str) -> None:
        """Raise IncompatibleSystem where other fields of the term follow from the parameter."""
        value = getattr(term, field)
        if isinstance(value, Each):
            return
        given = {name: getattr(term, name) for name in named(type(term))}
        array = 1.25 * np.asarray(value) + 0.125
        moved = type(term)(**{**given, field: float(array) if array.ndim == 0 else array})
        others = [x for x in vars(moved) if x != field and getattr(moved, x) != getattr(term, x)]
        if others or getattr(moved, field) == value:
            raise IncompatibleSystem(
                f"Plan.gradient: {self.name} of {type(term).__name__} is not used as it is given; give the "
                "term the numbers that its energy uses"
            )

    @property
    def shape(self) -> tuple[int, ...]:
        """That of one value."""
        return self.value.shape if isinstance(self.value, Each) else np.shape(self.value)

    def at_edges(self, count: int) -> Varied:
        """Its values at so many edges."""
        if isinstance(self.value, Each):
            values = self.value.values.reshape(count, -1)
        else:
            values = np.broadcast_to(np.asarray(self.value, dtype=float).ravel(), (count, max(1, np.size(self.value))))
        return Varied(SiteArray.of(values if self.shape else values[:, 0]), self.shape)

    def put(self, term: Any, varied: Varied, path: tuple[str, ...]) -> Any:
        """The term with it."""
        first, *rest = path
        inner = self.put(getattr(term, first), varied, tuple(rest)) if rest else varied
        return with_fields(term, **{first: inner})


class OfPart:
    """The sums over steps of the derivatives by parameters of one term, for every edge."""

    def __init__(self, energy: OfTerms, part: BoundTerm, wanted: list[Parameter], asked: Layout,
                 slots: int, steps: Any) -> None:  # fmt: skip
        self.wanted, self.slots = wanted, slots
        graph, group = part.graph, energy.group
        edges = AllPairs(group.copies).edges if is_near(graph) else graph.edges
        self.count, self.arity = len(edges), edges.shape[1]
        term: Any = part.term
        for one in wanted:
            term = one.put(term, one.at_edges(self.count), one.path)
        others = inside(term, Each)
        term = exchanged(term, Each, [EachOfSites.of_each(x) for x in others])
        own = tuple(
            tuple(
                EachOfSites.of_each(_of(x, edges[:, k])) if isinstance(x, Each) else x
                for x in energy.own
            )
            for k in range(self.arity)
        )
        ends = SiteTable.of(edges.T)
        site = site_class(energy.names)()
        self.edges = EdgesAsked(term, group.base, site, own, ends, isinstance(energy, MomentumTerms))
        self.asked = asked
        width = sum(max(1, int(np.prod(one.shape))) for one in wanted)
        self.total = carried_layout(_zeros(width))
        self.sums = Planes.of_rows(width, self.count)
        planes = Planes.of_rows(1, 1)
        self.execution = SiteExecution(
            steps.compiled, steps.progress, edges_back, self.edges, asked, self.total, slots, 1, planes,
            planes,
        )  # fmt: skip

    def add(self, steps: int, used: Planes) -> None:
        """Those of some steps."""
        given = self.edges, self.asked, self.total, self.slots, steps, used, self.sums
        if self.execution.ready_for(self.count * steps):
            self.execution.on_sites(self.count)(*given)
        else:
            edges_back(*given)

    @property
    def found(self) -> dict[str, np.ndarray]:
        """The derivatives by name: of a parameter that all edges share their sum."""
        result, begin = {}, 0
        for one in self.wanted:
            width = max(1, int(np.prod(one.shape)))
            rows = self.sums.array[begin : begin + width, : self.count].T.reshape(-1, *one.shape)
            begin += width
            result[one.name] = rows.copy() if isinstance(one.value, Each) else rows.sum(axis=0)
        return result


def _of(each: Each, numbers: np.ndarray) -> Each:
    from ..formulas.of_each import each as made

    return made(each.values[numbers])


def _zeros(width: int) -> Any:
    from ..formulas import vec

    return vec(*[0.0] * width)


class BackwardRun:
    """The way back through one run of fixed steps of many sites.

    names : of parameters of terms by which is differentiated, too.  kept : states on the way.
    """

    def __init__(
        self, sites: Any, start: Any, steps: int, t0: float, names: tuple[str, ...] = (),
        kept: int = KEPT,
    ) -> None:  # fmt: skip
        why = why_not(sites, start)
        plan = sites.plan
        if why:
            raise IncompatibleSystem(
                f"Plan.tangent: {plan.method!r} {why} has no way back for many sites; RKMK with an explicit "
                "tableau, KickDrift, LieVerlet, Splitting and compositions of them have one without loads"
            )
        self.plan, self.start, self.t0, self.kept = plan, start, t0, kept
        self.method, self.h, self.steps, self.count = (
            plan._steps.way_of(0), plan._steps.h, steps, start.sites,
        )  # fmt: skip
        first = first_of(start)
        self.names = tuple(start.arrays)
        self.lists = Lists.of(plan._one, sites.site)
        self.site = sites.site
        if self.lists is not None:
            self.site = self.lists.at(np.asarray(start.parts["g"]))
        self.rows = site_rows(start)
        wanted = [Parameter(plan._one, name) for name in names]
        self.way = self._layouts(first, bool(wanted))
        width = max(self.way.state.width, 1)
        numbers = padded(self.count)
        self.block = max(1, min(steps, ROOM // (width * numbers)))
        if self.lists is not None:
            self.block = 1
        used = max(1, self.way.momenta * self.way.momentum.width + self.way.elements * self.way.element.width)
        self.some = max(1, min(self.block, ROOM // (used * numbers))) if wanted else self.block
        self.states = Planes.of_rows(width * (self.block + 1), self.count)
        kept_rows = self.some if wanted else 0
        self.momenta = Planes.of_rows(
            max(1, kept_rows * self.way.momenta * self.way.momentum.width), self.count
        )
        self.elements = Planes.of_rows(
            max(1, kept_rows * self.way.elements * self.way.element.width), self.count
        )
        self.felt = Planes.of_rows(self.way.felt.width, self.count)
        self.parts = self._parts(wanted)
        key = "backward", self.way
        if key not in sites.known:
            sites.known[key] = self._executions()
        self.forward, self.backward = sites.known[key]

    # ---------------------------------------------------------------- what it is made of

    def _layouts(self, first: Any, kept: bool) -> WayBack:
        """Layouts of the way back, as that of a site which feels no other has them."""
        alone = exchanged(
            self.site, TermsOfSite, [with_fields(x, roles=()) for x in inside(self.site, TermsOfSite)]
        )
        dims = self._components(first)
        blank = type(first)(*[_zeros(dims[name]) if name in dims else None for name in first.parts])

        def example() -> Any:
            one = at_this_site(alone)
            return step_back(self.method, one, one, self.t0, first, blank, self.h)

        back = one_site(1, 0, example)
        layouts = [carried_layout(x[0] if x else ()) for x in (back.momenta, back.elements)]
        return WayBack(
            layout_of(first), carried_layout(blank), *layouts, len(back.momenta), len(back.elements),
            kept,
        )  # fmt: skip

    def _components(self, first: Any) -> dict[str, int]:
        """How many components a site has, by the parts of its state."""
        one = self.plan._one
        group = getattr(one, "configurations", one.group)
        dim = getattr(group, "base", group).dim
        return {
            name: dim if name == "g" else len(first.parts[name])
            for name in self.names
        }  # fmt: skip

    def _executions(self) -> tuple[SiteExecution, SiteExecution]:
        steps, planes = self.plan._steps, Planes.of_rows(1, 1)
        none, shared = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
        free = released(self.site)
        return (
            SiteExecution(
                steps.compiled, steps.progress, forward_sites, self.method, self.site, self.way.state,
                self.h, 0.0, 1, 1, planes, none, None,
            ),
            SiteExecution(
                steps.compiled, steps.progress, backward_sites, self.method, self.site, free, self.way,
                self.h, 0.0, 1, 1, planes, planes, planes, shared, planes, planes,
            ),
        )  # fmt: skip

    def _parts(self, wanted: list[Parameter]) -> list[OfPart]:
        found, steps, way = [], self.plan._steps, self.way
        keys = dict.fromkeys((id(x.energy), x.which) for x in wanted)
        for key in keys:
            some = [x for x in wanted if (id(x.energy), x.which) == key]
            energy = some[0].energy
            in_momenta = isinstance(energy, MomentumTerms)
            if not isinstance(energy, (MomentumTerms, PlaceTerms)) or not (
                way.momenta if in_momenta else way.elements
            ):
                raise IncompatibleSystem(
                    f"Plan.gradient: steps of {self.plan.method!r} have no derivative by "
                    f"{some[0].name} for many sites; RKMK has one by the energies of momenta too"
                )
            layout, slots = (way.momentum, way.momenta) if in_momenta else (way.element, way.elements)
            found.append(OfPart(energy, energy.parts[some[0].which], some, layout, slots, steps))
        return found

    # ---------------------------------------------------------------- the way

    def felt_rows(self, components: np.ndarray) -> np.ndarray:
        """Components, (N,), as numbers of sites, (width, sites)."""
        found, at = [], 0
        for size in self._components(first_of(self.start)).values():
            some = components[at : at + size * self.count].reshape(self.count, size)
            found.append(some.T)
            at += some.size
        return np.concatenate(found)

    def components(self, rows: np.ndarray) -> np.ndarray:
        """The inverse."""
        found, at = [], 0
        for size in self._components(first_of(self.start)).values():
            found.append(rows[at : at + size].T.ravel())
            at += size
        return np.concatenate(found)

    def back(self, given: Mapping[int, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The derivative by the start, (N,), and by the parameters, of a function that has these
        derivatives by the states after so many steps.
        """
        self.given = {n: self.felt_rows(np.asarray(w, dtype=float)) for n, w in given.items()}
        self.felt.array[:] = 0.0
        for part in self.parts:
            part.sums.array[:] = 0.0
        last = max(self.given, default=0)
        if last in self.given:
            self.felt.array[:] = rows_of(self.given[last])
        if last:
            blocks = -(-last // self.block)
            go_back(0, blocks, self.kept, self.rows, self._advance(last), self._back(last))
        found: dict[str, np.ndarray] = {}
        for part in self.parts:
            found |= part.found
        return self.components(self.felt.array[:, : self.count]), found

    def _advance(self, last: int) -> Any:
        def advance(rows: np.ndarray, first: int, end: int) -> np.ndarray:
            for block in range(first, end):
                rows = self._made(rows, block * self.block, min(last, (block + 1) * self.block))
            return rows

        return advance

    def _made(self, rows: np.ndarray, first: int, end: int) -> np.ndarray:
        """The state before step `end`, and in memory those from step `first` on."""
        width, steps = self.way.state.width, end - first
        self.states.array[:width] = rows_of(rows)
        if self.lists is not None:
            self.site = self.lists.at(self._elements(rows))
        done, failures = np.zeros(1), []  # type: Any, list[Any]
        arguments: Any = (
            self.method, self.site, self.way.state, self.h, self.t0, first, steps, self.states, done,
        )  # fmt: skip
        if self.forward.ready_for(self.count * steps):
            self.forward.on_sites(self.count, self.plan.options.workers)(*arguments, None)
        else:
            forward_sites(*arguments, failures)
        if done[0] != steps:
            step = first + int(done[0]) + 1
            raise IntegrationFailure(
                f"Plan.tangent: step {step}, t = {self.t0 + (step - 1) * self.h:g}, could not be made again"
            ) from (failures[-1] if failures else None)
        found: np.ndarray = self.states.array[width * steps : width * (steps + 1), : self.count].copy()
        return found

    def _elements(self, rows: np.ndarray) -> np.ndarray:
        return unpacked(self.way.state, rows.T)["g"]

    def _back(self, last: int) -> Any:
        def back(rows: np.ndarray, block: int) -> None:
            first, end = block * self.block, min(last, (block + 1) * self.block)
            if end - first > 1:
                self._made(rows, first, end - 1)
            else:
                self.states.array[: self.way.state.width] = rows_of(rows)
                if self.lists is not None:
                    self.site = self.lists.at(self._elements(rows))
            for begin in range(first + (end - 1 - first) // self.some * self.some, first - 1, -self.some):
                self._through(begin, min(end, begin + self.some), first)

        return back

    def _through(self, first: int, end: int, held: int) -> None:
        """Back through the steps from `first` to `end`, whose states lie behind that of step `held`."""
        way, steps = self.way, end - first
        states = Planes(self.states.array[way.state.width * (first - held) :], self.count)
        here = [n for n in range(end - 1, first - 1, -1) if n in self.given]
        counts = np.zeros(steps)
        counts[[n - first for n in here]] = 1.0
        given = Planes.of_rows(max(1, len(here)) * way.felt.width, self.count)
        for k, n in enumerate(here):
            given.array[k * way.felt.width : (k + 1) * way.felt.width] = rows_of(self.given[n])
        arguments: Any = (
            self.method, self.site, released(self.site), way, self.h, self.t0, first, steps, states,
            self.felt, given,
        )  # fmt: skip
        rest = self.momenta, self.elements
        if self.backward.ready_for(self.count * steps):
            calls = self.backward.on_sites(self.count, self.plan.options.workers)
            calls(*arguments, kernel.Shared(counts), *rest)
        else:
            backward_sites(*arguments, counts, *rest)
        for part in self.parts:
            part.add(steps, self.momenta if part.edges.in_momenta else self.elements)
