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

from ....compiler import kernel
from ....compiler.sites.planes import Planes
from ....errors import IncompatibleSystem, IntegrationFailure, NotFinite
from ....formulas.classes.layouts import carried_layout, layout_of
from ....formulas.classes.records import records_in, with_fields, with_records
from ....formulas.classes.remembered import Remembered
from ....formulas.sites import EIGHT, padded, rows_of
from ....groups.composed.species import SpeciesGroup
from ....integrators.ending_at_jumps import uncut
from ....integrators.method import steps_as
from ....simulation.between.dense import unpacked
from ....simulation.compiled.parameters import full_name, parameter, shape_of
from ....systems.in_time.inputs import inputs
from ....systems.many.site_state import SiteValues
from ...sites.parts_of_spins import Sublattices
from ...sites.runs.execution import WORTH, SiteExecution
from ...sites.runs.lists import Lists
from ...sites.runs.states import first_of, site_rows
from ...sites.spin_splittings import TermSplitting, terms_of
from ...sites.terms.sums_of_terms import MomentumTerms, PlaceTerms
from ...sites.terms.terms_at_site import ForceOfSite
from ..blocks import remembers, require_same
from ..differences import slope_of
from ..directions import parameter_moves
from ..frames import Frames
from ..reversal import go_back
from ..steps_backwards import BondTurn, FieldTurn, Question, asks_whole_energies, parts_of, questions
from ..tangent import StepsOfARun
from .adaptive import with_samples
from .backward import PART, WayBack, backward_parts, forward_parts
from .parameters import Parameter, SlopesOfPart, zeros

ROOM = 2**23
"""Numbers of states that are kept on the way, and of those of a block of steps, at most, if these are
several.
"""

NEAR = 2**19
"""Numbers of states of a block of steps, which stay near the processor."""

LEAST = 16
"""States that are kept at least."""


NO_WAY = "Plan.tangent: there is no way back through runs of many sites {}"

_counted = Remembered()
"""By the system at one site how often the parts of steps ask energies."""


def inner_method(plan: Any) -> Any:
    """The method of the steps, wherever they are cut, and whoever has found their lengths."""
    method = uncut(plan._steps.method if plan.adaptive else plan._steps.way_of(0))
    return method.method if isinstance(method, StepsOfARun) else method


class BackwardRun:
    """The way back through one run of fixed steps of many sites.

    names : of parameters of terms by which is differentiated, too.
    """

    def __init__(self, sites: Any, start: Any, steps: int, t0: float, names: tuple[str, ...] = ()) -> None:
        plan, system = sites.plan, sites.plan._one
        group = getattr(system, "configurations", system.group)
        if isinstance(start, SiteValues) or isinstance(group, SpeciesGroup) or system.noisy:
            raise IncompatibleSystem(NO_WAY.format(f"of {type(system).__name__} on {group!r}"))
        self.plan, self.start, self.t0 = plan, start, t0
        self.h, self.sites = plan._steps.h, sites.count_of(start)
        method = plan._steps.way_of(0)
        self.grid: Any = None  # when steps begin, and how long they are, where they are of many lengths
        if isinstance(method, StepsOfARun):
            self.grid = method.begun.array[:-1], method.lengths.array[:-1]
        self.first = first_of(start)
        self.frames = Frames(sites.site, self.first)
        self.dims = self.frames.sizes
        self.lists = Lists.of(plan._one, sites.site)
        self.of_sites, self.names = sites, names if sites.site.jointed else ()
        parameters = [Parameter(plan._one, name) for name in names[: 0 if self.names else None]]
        self.cut = None if uncut(method) is method else method
        if parameters and self.cut is not None and inputs(plan._one):
            raise IncompatibleSystem(
                "Plan.gradient: there are no derivatives by parameters of many sites where an input is a table; "
                "there is one by the start"
            )
        self._set_motions(inner_method(plan), sites.site, bool(parameters))
        self.count = len(self.order)
        self.rows = site_rows(start)[:, self.order]
        self._make_room(steps, bool(parameters))
        self.beside = sites.room_beside(self.count)  # what formulas of joints work with
        self.parts = self._parts(parameters)
        key = "backward", layout_of(self.way)
        if key not in sites.known:
            sites.known[key] = self._executions()
        self.forward, self.backward = [execution.of_a_run() for execution in sites.known[key]]
        if self.of_sites.site.jointed and self.count * steps >= WORTH:
            for execution in (self.forward, self.backward):  # or in plain Python, with a warning
                execution.compile()
                execution.asked = execution.wanted
        if steps > 1 and remembers(inner_method(plan)):
            self._require_anew(sites)

    def _require_anew(self, sites: Any) -> None:
        """Refuse methods that come elsewhere if the second step begins anew."""
        run = sites.kind(with_samples(self.plan, 2), sites.site, self.start, self.t0, 2, None, None, None).trajectory()
        self.cotangents, self.last = dict[int, np.ndarray](), 2
        ends = unpacked(self.way.state, self._advance(self.rows, 0, -(-2 // self.block)).T)
        for name, of_run in self.plan._one.by_site({name: x[-1] for name, x in run.states.items()}).items():
            require_same(self.plan.method, ends[name][self.places], of_run[: self.sites])

    # ---------------------------------------------------------------- what it is made of

    def _set_motions(self, method: Any, site: Any, kept: bool) -> None:
        """Find the motions of a step, and its parts: which motion, when it begins, how long it is, as shares;
        and where the sites are that turn.
        """
        self.order, self.places = np.arange(self.start.sites), np.arange(self.sites)
        if steps_as(method, TermSplitting):
            turning: Any = method._motions(terms_of(self.plan._one))
            in_place = isinstance(turning, Sublattices)
            if in_place and turning.lonely and kept:
                raise IncompatibleSystem(
                    f"Plan.gradient: {method!r} has no derivative by parameters where terms of one site make "
                    "parts of their own; RKMK has one"
                )
            places = turning.places
            self.order, self.places = places.sites, places.places
            forms, numbers = turning.of_site(places)
            motions: Any = tuple([FieldTurn(x) if in_place else BondTurn(x) for x in forms])
            rows = [(numbers[k][0], at, share, *numbers[k][1:]) for k, share, at in method.turns(turning)]
        else:
            motions, shares = self.of_sites.parts_together() or parts_of(method, site)
            rows = [(*row, 0, 0) for row in shares]
        # kind, t, h, begin, end
        self.of_step = np.array(rows, dtype=float)
        first, last = self.of_step[0], self.of_step[-1]
        joins = motions[int(first[0])].joins and len(rows) > 1
        self.joined = joins and self.cut is None and bool((first[[0, 3, 4]] == last[[0, 3, 4]]).all())
        blank = type(self.first)(*[zeros(self.dims[name]) if name in self.dims else None for name in self.first.parts])
        momentum, element = [
            carried_layout(Question(0.0, place, zeros(self.dims[name])) if name else ())
            for name, place in self._places_asked
        ]
        self.way = WayBack(
            motions, self._with_slopes(site), layout_of(self.first), carried_layout(blank), momentum,
            element, carried_layout(zeros(next(iter(self.dims.values())))), kept,
            self.cut is not None, self.cut and self.cut.beyond,
        )  # fmt: skip
        counts = _counted.get(site) or {}
        key = layout_of(self.way), kept
        if site.jointed:
            counts[key] = [(0, 0)]
        if key not in counts:
            h = self.h if self.grid is None else self.grid[1].item(0)
            try:
                counts[key] = [questions(x, self.way.system, self.first, h) for x in motions]
            except (IncompatibleSystem, TypeError, AttributeError) as error:
                raise IncompatibleSystem(NO_WAY.format(f"by {method!r}: {error}")) from error
            except (ArithmeticError, IntegrationFailure) as error:  # of a site that feels no other one
                if kept:
                    raise IncompatibleSystem(NO_WAY.format(f"by {method!r} and parameters: {error}")) from error
                counts[key] = [(0, 0)] * len(motions)
            _counted.set(site, counts)
        self.questions: list[tuple[int, int]] = counts[key]

    def _with_slopes(self, site: Any) -> Any:
        """The system at one site, whose load knows its derivatives."""
        loads = records_in(site, ForceOfSite)
        with_slopes = [with_fields(x, backwards=self.plan._one.load.slopes_of_site()) for x in loads]
        return with_records(site, ForceOfSite, with_slopes) if loads else site

    @property
    def _places_asked(self) -> list[tuple[str, Any]]:
        """Of energies of momenta and of potentials the part of the state that they are asked with."""
        parts = self.first.parts
        names = [next((n for n in either if n in self.dims), "") for either in (("mu",), ("g", "q"))]
        return [(name, parts.get(name)) for name in names]

    @property
    def components(self) -> int:
        """How many components all sites have together."""
        return self.sites * self.frames.count

    def _make_room(self, steps: int, kept: bool) -> None:
        """Make memory: for states of a block of steps, and for what some parts of them ask."""
        way, places = self.way, padded(self.count)
        parts = len(self.of_step)
        size = way.state.width * places
        self.kept = max(LEAST, ROOM // size)
        near = ROOM if self.of_sites.site.jointed else NEAR  # steps of linkages take longer than memory
        block = max(near // (size * parts), -(-steps // self.kept))
        self.block = max(1, min(steps, block, ROOM // (size * parts)))
        if self.lists is not None:
            self.block = 1
        blocks = range(0, steps, self.block) if self.cut is not None else ()
        most_parts = max(
            [self.block, *[len(self._pieces(np.arange(n, min(steps, n + self.block)))[0]) for n in blocks]]
        )
        width = max(m * way.momentum.width + e * way.element.width for m, e in self.questions)
        self.at_once = max(1, ROOM // (8 * max(1, width) * places)) if kept else most_parts * parts
        at_once = min(self.at_once, most_parts * parts) if kept else 0
        most = [max(counts) for counts in zip(*self.questions)]
        widths = way.state.width, way.felt.width, way.momentum.width, way.element.width
        counts = most_parts * parts + 1, 1, at_once * most[0], at_once * most[1]
        self.states, self.felt, self.momenta, self.elements = [
            Planes.of_rows(max(way.along.width, width * count), self.count) for width, count in zip(widths, counts)
        ]

    def _executions(self) -> tuple[SiteExecution, SiteExecution]:
        steps, planes = self.plan._steps, Planes.of_rows(1, 1)
        none, shared = kernel.Columns(np.empty(0)), kernel.Shared(np.empty(0))
        of_run, most = (steps.compiled, steps.progress), min(EIGHT, self.count) if self.of_sites.site.jointed else EIGHT
        return (
            SiteExecution(*of_run, forward_parts, self.way, 1, shared, planes, planes, none, None, most=most),
            SiteExecution(*of_run, backward_parts, self.way, 1, shared, *[planes] * 6, most=most),
        )

    def _parts(self, parameters: list[Parameter]) -> list[SlopesOfPart]:
        slopes, steps, way = [], self.plan._steps, self.way
        if parameters and not asks_whole_energies(inner_method(self.plan)):
            raise IncompatibleSystem(
                f"Plan.gradient: {self.plan.method!r} may depend on {parameters[0].name} by more than the velocity and the "
                "force of the system: there is no derivative by it for many sites; RKMK and KickDrift have one"
            )
        terms = [
            (x.energy, k) for x in parameters for k in (range(len(x.energy.parts)) if x.which is None else [x.which])
        ]
        for energy, which in {(id(e), k): (e, k) for e, k in terms}.values():
            of_term = [x for x in parameters if x.energy is energy and x.which in (None, which)]
            in_momenta = isinstance(energy, MomentumTerms)
            has_terms = isinstance(energy, (MomentumTerms, PlaceTerms))
            if not (has_terms and any(counts[0 if in_momenta else 1] for counts in self.questions)):
                raise IncompatibleSystem(
                    f"Plan.gradient: steps of {self.plan.method!r} have no derivative by "
                    f"{of_term[0].name} for many sites; RKMK has one by the energies of momenta too"
                )
            layout = way.momentum if in_momenta else way.element
            slopes.append(SlopesOfPart(energy, energy.parts[which], of_term, self.places, layout, steps))
        return slopes

    # ---------------------------------------------------------------- the way

    def _rows_of(self, components: np.ndarray) -> np.ndarray:
        """Components, (N,), as numbers of sites at their places, (width, places)."""
        rows = np.zeros((self.way.felt.width, self.count))
        rows[:, self.places] = self.frames.of_each(components[None])[0].T
        return rows

    def _components(self) -> np.ndarray:
        """The derivative by the state at hand, (N,)."""
        return self.frames.in_a_row(self.felt.array[:, self.places].T[None])[0]

    def back(self, cotangents: Mapping[int, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The derivative by the start, (N,), and by the parameters, of a function that has these
        derivatives by the states after so many steps, (N,) each.
        """
        self.cotangents = {n: self._rows_of(np.asarray(w, dtype=float)) for n, w in cotangents.items()}
        self.last = max(self.cotangents, default=0)
        self.felt.array[:] = 0.0
        if self.last in self.cotangents:
            self.felt.array[:] = rows_of(self.cotangents[self.last])
        for part in self.parts:
            part.sums.array[:] = 0.0
        self.beside = self.of_sites.room_beside(self.count)
        if self.last:
            blocks = -(-self.last // self.block)
            go_back(blocks, self.kept, self.rows, self._advance, self._back)
        by_name: dict[str, Any] = self._by_numbers() if self.names else {}
        for part in self.parts:
            for name, slopes in part.by_name.items():
                by_name[name] = by_name[name] + slopes if name in by_name else slopes
        slope = self._components()
        if not np.isfinite(slope).all():
            raise NotFinite(
                f"Plan.tangent: J^T w overflowed on the way back through {self.last} steps: neighbouring motions "
                "part too fast; take a shorter run"
            )
        return slope, by_name

    def _by_numbers(self) -> dict[str, np.ndarray]:
        """The derivatives by parameters of a linkage, through its numbers in memory that follow from them."""
        felt, system, by_name = self.of_sites.felt_by_numbers(self.beside), self.plan._one, {}  # type: Any, Any, Any
        where = np.nonzero(felt)
        for name in self.names:
            full = full_name(system, name, "Plan.gradient")
            changes = [
                slope_of(lambda x, moved=moved: self.of_sites.numbers_of(moved(x))[where], step)  # type: ignore[misc]
                for moved, step in parameter_moves(system, full)
            ]
            by_name[name] = np.reshape(changes @ felt[where], shape_of(layout_of(parameter(system, full))) or ())
        return by_name

    def _pieces(self, n: np.ndarray) -> tuple[np.ndarray, ...]:
        """Of steps, or of the pieces into which they are cut, the number of the step, when they begin, how
        long they are, and which are first in their step.
        """
        if self.grid is not None:
            return n, self.grid[0][n], self.grid[1][n], np.ones(len(n), dtype=bool)
        times = self.t0 + n * self.h
        if self.cut is None:
            return n, times, np.full(len(n), self.h), np.ones(len(n), dtype=bool)
        pieces = [
            (k, begin, length, i == 0)
            for k, t in zip(n.tolist(), times.tolist())
            for i, (begin, length) in enumerate(self.cut.parts(self.plan._one, t, self.h))
        ]
        return tuple(map(np.array, zip(*pieces)))

    def _of_block(self, block: int) -> np.ndarray:
        """The parts of a block of steps, as rows of `StepPart`: kicks and turns at a node are one, where no
        derivative is given in between.
        """
        first = block * self.block
        n = np.arange(first, min(self.last, first + self.block))
        kind, node, share, begin, end = self.of_step.T
        n, begins, lengths, begins_step = self._pieces(n)
        shape = len(n), len(kind)
        rows = np.zeros((*shape, PART.width))
        rows[..., 0] = kind
        rows[..., 1] = begins[:, None] + node * lengths[:, None]
        rows[..., 2] = share * lengths[:, None]
        rows[..., 6], rows[..., 7], rows[..., 8] = begin, end, self.count
        rows[..., 9], rows[..., 10] = begins[:, None], lengths[:, None]
        rows[:, 0, 3] = [k in self.cotangents and begins for k, begins in zip(n.tolist(), begins_step)]
        stay = np.ones(shape, dtype=bool)
        if self.joined:
            joined = np.flatnonzero(rows[1:, 0, 3] == 0.0)
            rows[joined + 1, 0, 2] += rows[joined, -1, 2]
            stay[joined, -1] = False
        return rows[stay]

    def _advance(self, rows: np.ndarray, first: int, end: int) -> np.ndarray:
        """The state before a block, of the one before another."""
        for block in range(first, end):
            rows = self._after(rows, self._of_block(block))
        return rows

    def _after(self, rows: np.ndarray, parts: np.ndarray) -> np.ndarray:
        """The state after some parts of steps, and in memory those in between."""
        width, count = self.way.state.width, len(parts)
        self.states.array[:width] = rows_of(rows)
        if self.lists is not None:
            site = self.lists.at(unpacked(self.way.state, rows.T)["g"])
            self.way = with_fields(self.way, system=self._with_slopes(site))
        done, failures = np.zeros(1), []  # type: Any, list[Any]
        with self.forward.on_sites(self.count * count, self.count, self.plan.options.workers) as calls:
            if calls is not None:
                calls(self.way, count, kernel.Shared(parts), self.states, self.beside, done, None)
            else:
                forward_parts(self.way, count, parts.ravel(), self.states, self.beside, done, failures)
        if done[0] != count:
            raise IntegrationFailure(
                f"Plan.tangent: the step at t = {parts[int(done[0]), 1]:g} could not be made again"
            ) from (failures[-1] if failures else None)
        end: np.ndarray = self.states.array[width * count : width * (count + 1), : self.count]
        return end.copy()

    def _back(self, rows: np.ndarray, block: int) -> None:
        """Back through a block, some parts at a time."""
        parts = self._of_block(block)
        self._after(rows, parts)
        first = block * self.block
        steps = iter([n for n in range(min(self.last, first + self.block) - 1, first - 1, -1) if n in self.cotangents])
        for end in range(len(parts), 0, -self.at_once):
            begin = max(0, end - self.at_once)
            self._through(parts[begin:end].copy(), begin, steps)

    def _through(self, parts: np.ndarray, first: int, steps: Any) -> None:
        """Back through some parts.  first : number of the first of them in the block.  steps : at which
        derivatives are given, last ones first.
        """
        way, count = self.way, len(parts)
        states = Planes(self.states.array[way.state.width * first :], self.count)
        cotangents = [self.cotangents[next(steps)] for _ in range(int(parts[:, 3].sum()))]
        planes = Planes.of_rows(max(1, len(cotangents)) * way.felt.width, self.count)
        for k, w in enumerate(cotangents):
            planes.array[k * way.felt.width : (k + 1) * way.felt.width] = rows_of(w)
        counts_of_parts = [np.array(counts)[parts[:, 0].astype(int)] for counts in zip(*self.questions)]
        for column, counts in zip((4, 5), counts_of_parts):
            parts[:, column] = np.cumsum(counts) - counts
        arguments = states, self.beside, self.felt, planes, self.momenta, self.elements
        with self.backward.on_sites(self.count * count, self.count, self.plan.options.workers) as calls:
            if calls is not None:
                calls(way, count, kernel.Shared(parts), *arguments)
            else:
                backward_parts(way, count, parts.ravel(), *arguments)
        for part in self.parts:
            in_momenta = part.edges.in_momenta
            places = self.momenta if in_momenta else self.elements
            part.add(int(counts_of_parts[0 if in_momenta else 1].sum()), places)
