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
from ..errors import IncompatibleSystem, IntegrationFailure
from ..formulas import vec
from ..formulas.of_each import Each, each
from ..formulas.pytree import Layout, carried_layout, exchanged, inside, layout_of, with_fields
from ..formulas.sites import SiteArray, SiteTable, padded, rows_of
from ..groups.species import SpeciesGroup
from ..integrators.backward import Asked, Turn, parts_of, refused, released
from ..integrators.sublattices import SublatticeSplitting, terms_of
from ..systems.among import is_near
from ..systems.bound_terms import BoundTerm
from ..systems.graphs import AllPairs
from ..systems.site_state import SiteValues
from ..systems.sublattices import Sublattices
from ..systems.sums_of_terms import MomentumTerms, OfTerms, PlaceTerms
from ..systems.terms import Term, site_class
from ..systems.terms_at_site import EachOfSites
from .dense import unpacked
from .parameters import full_name, named, parameter, shape_of
from .reversal import go_back
from .sites_backward import (
    PART,
    EdgesAsked,
    Varied,
    WayBack,
    backward_parts,
    edges_back,
    forward_parts,
)
from .sites_execution import SiteExecution
from .sites_lists import Lists
from .sites_states import first_of, site_rows

ROOM = 2**23
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
        number = isinstance(value, Each) or shape_of(layout_of(value)) is not None
        if not (number and known and self.path and not inner):
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
            values = np.broadcast_to(
                np.asarray(self.value, dtype=float).ravel(), (count, max(1, np.size(self.value)))
            )
        return Varied(SiteArray.of(values if self.shape else values[:, 0]), self.shape)

    def put(self, term: Any, varied: Varied, path: tuple[str, ...]) -> Any:
        """The term with it."""
        first, *rest = path
        inner = self.put(getattr(term, first), varied, tuple(rest)) if rest else varied
        return with_fields(term, **{first: inner})


class OfPart:
    """The sums over steps of the derivatives by parameters of one term, for every edge."""

    def __init__(
        self, energy: OfTerms, part: BoundTerm, wanted: list[Parameter], places: np.ndarray,
        asked: Layout, steps: Any,
    ) -> None:  # fmt: skip
        self.wanted = wanted
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
                EachOfSites.of_each(each(x.values[edges[:, k]])) if isinstance(x, Each) else x
                for x in energy.own
            )
            for k in range(self.arity)
        )
        ends = SiteTable.of(places[edges.T])
        site = site_class(energy.names)()
        self.edges = EdgesAsked(
            term, group.base, site, own, ends, isinstance(energy, MomentumTerms)
        )
        self.asked = asked
        width = sum(max(1, int(np.prod(one.shape))) for one in wanted)
        self.total = carried_layout(_zeros(width))
        self.sums = Planes.of_rows(width, self.count)
        planes = Planes.of_rows(1, 1)
        self.execution = SiteExecution(
            steps.compiled, steps.progress, edges_back, self.edges, asked, self.total, 1, planes,
            planes,
        )  # fmt: skip

    def add(self, count: int, used: Planes) -> None:
        """Those of what was asked so often."""
        given = self.edges, self.asked, self.total, count, used, self.sums
        if self.execution.ready_for(self.count * count):
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


def _zeros(width: int) -> Any:
    return vec(*[0.0] * width)


class BackwardRun:
    """The way back through one run of fixed steps of many sites.

    names : of parameters of terms by which is differentiated, too.  kept : states on the way.
    """

    def __init__(
        self, sites: Any, start: Any, steps: int, t0: float, names: tuple[str, ...] = (),
        kept: int = KEPT,
    ) -> None:  # fmt: skip
        plan, why = sites.plan, why_not(sites, start)
        if why:
            raise IncompatibleSystem(
                f"Plan.tangent: {plan.method!r} {why} has no way back for many sites; RKMK with an explicit "
                "tableau, KickDrift, LieVerlet, Splitting, compositions of them and SublatticeSplitting "
                "have one, without loads"
            )
        self.plan, self.start, self.t0, self.kept = plan, start, t0, kept
        self.h, self.sites = plan._steps.h, start.sites
        self.names, self.first = tuple(start.arrays), first_of(start)
        self.lists = Lists.of(plan._one, sites.site)
        wanted = [Parameter(plan._one, name) for name in names]
        self._made_of(plan._steps.way_of(0), sites.site, bool(wanted))
        self.count = len(self.order)
        self.rows = site_rows(start)[:, self.order]
        self._room(steps, bool(wanted))
        self.parts = self._parts(wanted)
        key = "backward", layout_of(self.way)
        if key not in sites.known:
            sites.known[key] = self._executions()
        self.forward, self.backward = sites.known[key]

    # ---------------------------------------------------------------- what it is made of

    def _made_of(self, method: Any, site: Any, kept: bool) -> None:
        """The motions of a step, and its parts: which motion, when it begins, how long it is, as shares;
        and where the sites are that turn.
        """
        self.order = self.places = np.arange(self.sites)
        if isinstance(method, SublatticeSplitting):
            found = Sublattices(terms_of(self.plan._one))
            if found.lonely and kept:
                raise IncompatibleSystem(
                    f"Plan.gradient: {method!r} has no derivative by parameters where terms of one site make "
                    "parts of their own; RKMK has one"
                )
            places = found.places
            self.order, self.places = places.sites, places.places
            field, numbers = found.of_site(places)
            motions: Any = (Turn(field, released(field)),)
            rows = [(0, at, share, *numbers[k]) for k, share, at in method.turns(found)]
        else:
            motions, some = parts_of(method, site)
            rows = [(*row, 0, 0, 0) for row in some]
        # kind, t, h, begin, end, term
        self.of_step = np.array(rows, dtype=float)
        first, last = self.of_step[0], self.of_step[-1]
        joins = motions[int(first[0])].joins and len(rows) > 1
        self.joined = joins and bool((first[[0, 3, 4, 5]] == last[[0, 3, 4, 5]]).all())
        blank = type(self.first)(
            *[_zeros(self.dims[name]) if name in self.dims else None for name in self.first.parts]
        )
        momentum, element = [
            carried_layout(Asked(0.0, place, _zeros(self.dims[name])) if name else ())
            for name, place in self._places_asked
        ]
        self.way = WayBack(
            motions, site, released(site), layout_of(self.first), carried_layout(blank), momentum,
            element, carried_layout(_zeros(next(iter(self.dims.values())))), kept,
        )  # fmt: skip

    @property
    def _places_asked(self) -> list[tuple[str, Any]]:
        """Of energies of momenta and of potentials the part of the state that they are asked with."""
        parts = self.first.parts
        found = [next((n for n in names if n in self.dims), "") for names in (("mu",), ("g", "q"))]
        return [(name, parts.get(name)) for name in found]

    @property
    def dims(self) -> dict[str, int]:
        """How many components a site has, by the parts of its state."""
        one = self.plan._one
        group = getattr(one, "configurations", one.group)
        dim = getattr(group, "base", group).dim
        parts = self.first.parts
        return {name: dim if name == "g" else len(parts[name]) for name in self.names}

    @property
    def components(self) -> int:
        """How many components all sites have together."""
        return self.sites * sum(self.dims.values())

    def _room(self, steps: int, kept: bool) -> None:
        """Memory: for states of a block of steps, and for what some parts of them ask."""
        way, places = self.way, padded(self.count)
        parts = len(self.of_step)
        self.block = max(1, min(steps, ROOM // (way.state.width * places * parts)))
        if self.lists is not None:
            self.block = 1
        asked = max(
            x.momenta * way.momentum.width + x.elements * way.element.width for x in way.motions
        )
        self.some = max(1, ROOM // (4 * max(1, asked) * places)) if kept else self.block * parts
        some = min(self.some, self.block * parts) if kept else 0
        most = [max(getattr(x, name) for x in way.motions) for name in ("momenta", "elements")]
        widths = way.state.width, way.felt.width, way.momentum.width, way.element.width
        counts = self.block * parts + 1, 1, some * most[0], some * most[1]
        self.states, self.felt, self.momenta, self.elements = [
            Planes.of_rows(max(way.along.width, width * count), self.count)
            for width, count in zip(widths, counts)
        ]

    def _executions(self) -> tuple[SiteExecution, SiteExecution]:
        steps, planes = self.plan._steps, Planes.of_rows(1, 1)
        none, shared = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
        given = steps.compiled, steps.progress
        return (
            SiteExecution(*given, forward_parts, self.way, 1, shared, planes, none, None),
            SiteExecution(*given, backward_parts, self.way, 1, shared, *[planes] * 5),
        )

    def _parts(self, wanted: list[Parameter]) -> list[OfPart]:
        found, steps, way = [], self.plan._steps, self.way
        for key in dict.fromkeys((id(x.energy), x.which) for x in wanted):
            some = [x for x in wanted if (id(x.energy), x.which) == key]
            energy = some[0].energy
            in_momenta = isinstance(energy, MomentumTerms)
            name = "momenta" if in_momenta else "elements"
            if not isinstance(energy, (MomentumTerms, PlaceTerms)) or not any(
                getattr(x, name) for x in way.motions
            ):
                raise IncompatibleSystem(
                    f"Plan.gradient: steps of {self.plan.method!r} have no derivative by "
                    f"{some[0].name} for many sites; RKMK has one by the energies of momenta too"
                )
            layout = way.momentum if in_momenta else way.element
            part = energy.parts[some[0].which]
            found.append(OfPart(energy, part, some, self.places, layout, steps))
        return found

    # ---------------------------------------------------------------- the way

    def _rows_of(self, components: np.ndarray) -> np.ndarray:
        """Components, (N,), as numbers of sites at their places, (width, places)."""
        found, at = np.zeros((self.way.felt.width, self.count)), 0
        row = 0
        for size in self.dims.values():
            some = components[at : at + size * self.sites].reshape(self.sites, size)
            found[row : row + size, self.places] = some.T
            row, at = row + size, at + some.size
        return found

    def _components(self) -> np.ndarray:
        """The derivative by the state at hand, (N,)."""
        rows, found, row = self.felt.array[:, self.places], [], 0
        for size in self.dims.values():
            found.append(rows[row : row + size].T.ravel())
            row += size
        return np.concatenate(found)

    def back(self, given: Mapping[int, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The derivative by the start, (N,), and by the parameters, of a function that has these
        derivatives by the states after so many steps, (N,) each.
        """
        self.given = {n: self._rows_of(np.asarray(w, dtype=float)) for n, w in given.items()}
        self.last = max(self.given, default=0)
        self.felt.array[:] = 0.0
        if self.last in self.given:
            self.felt.array[:] = rows_of(self.given[self.last])
        for part in self.parts:
            part.sums.array[:] = 0.0
        if self.last:
            blocks = -(-self.last // self.block)
            go_back(0, blocks, self.kept, self.rows, self._advance, self._back)
        found: dict[str, np.ndarray] = {}
        for part in self.parts:
            found |= part.found
        return self._components(), found

    def _of_block(self, block: int) -> np.ndarray:
        """The parts of a block of steps, as rows of `Part`: kicks and turns at a node are one, where no
        derivative is given in between.
        """
        first = block * self.block
        n = np.arange(first, min(self.last, first + self.block))
        kind, node, share, begin, end, term = self.of_step.T
        shape = len(n), len(kind)
        rows = np.zeros((*shape, PART.width))
        rows[..., 0] = kind
        rows[..., 1] = (self.t0 + n * self.h)[:, None] + node * self.h
        rows[..., 2] = share * self.h
        rows[..., 6], rows[..., 7], rows[..., 8], rows[..., 9] = begin, end, term, self.count
        rows[:, 0, 3] = [k in self.given for k in n]
        stay = np.ones(shape, dtype=bool)
        if self.joined:
            one = np.flatnonzero(rows[1:, 0, 3] == 0.0)
            rows[one + 1, 0, 2] += rows[one, -1, 2]
            stay[one, -1] = False
        found: np.ndarray = rows[stay]
        return found

    def _advance(self, rows: np.ndarray, first: int, end: int) -> np.ndarray:
        """The state before a block, of the one before another."""
        for block in range(first, end):
            rows = self._made(rows, self._of_block(block))
        return rows

    def _made(self, rows: np.ndarray, parts: np.ndarray) -> np.ndarray:
        """The state after some parts of steps, and in memory those in between."""
        width, count = self.way.state.width, len(parts)
        self.states.array[:width] = rows_of(rows)
        if self.lists is not None:
            site = self.lists.at(unpacked(self.way.state, rows.T)["g"])
            self.way = with_fields(self.way, system=site, free=released(site))
        done, failures = np.zeros(1), []  # type: Any, list[Any]
        if self.forward.ready_for(self.count * count):
            calls = self.forward.on_sites(self.count, self.plan.options.workers)
            calls(self.way, count, kernel.Shared(parts), self.states, done, None)
        else:
            forward_parts(self.way, count, parts.ravel(), self.states, done, failures)
        if done[0] != count:
            raise IntegrationFailure(
                f"Plan.tangent: the step at t = {parts[int(done[0]), 1]:g} could not be made again"
            ) from (failures[-1] if failures else None)
        found: np.ndarray = self.states.array[width * count : width * (count + 1), : self.count]
        return found.copy()

    def _back(self, rows: np.ndarray, block: int) -> None:
        """Back through a block, some parts at a time."""
        parts = self._of_block(block)
        self._made(rows, parts)
        first = block * self.block
        steps = iter(
            [
                n
                for n in range(min(self.last, first + self.block) - 1, first - 1, -1)
                if n in self.given
            ]
        )
        for end in range(len(parts), 0, -self.some):
            self._through(
                parts[max(0, end - self.some) : end].copy(), max(0, end - self.some), steps
            )

    def _through(self, parts: np.ndarray, first: int, steps: Any) -> None:
        """Back through some parts.  first : number of the first of them in the block.  steps : at which
        derivatives are given, last ones first.
        """
        way, count = self.way, len(parts)
        states = Planes(self.states.array[way.state.width * first :], self.count)
        here = [self.given[next(steps)] for _ in range(int(parts[:, 3].sum()))]
        given = Planes.of_rows(max(1, len(here)) * way.felt.width, self.count)
        for k, w in enumerate(here):
            given.array[k * way.felt.width : (k + 1) * way.felt.width] = rows_of(w)
        asked = [
            np.array([getattr(x, name) for x in way.motions])[parts[:, 0].astype(int)]
            for name in ("momenta", "elements")
        ]
        for column, many in zip((4, 5), asked):
            parts[:, column] = np.cumsum(many) - many
        arguments = states, self.felt, given, self.momenta, self.elements
        if self.backward.ready_for(self.count * count):
            calls = self.backward.on_sites(self.count, self.plan.options.workers)
            calls(way, count, kernel.Shared(parts), *arguments)
        else:
            backward_parts(way, count, parts.ravel(), *arguments)
        for part in self.parts:
            in_momenta = part.edges.in_momenta
            used = self.momenta if in_momenta else self.elements
            part.add(int(asked[0 if in_momenta else 1].sum()), used)
