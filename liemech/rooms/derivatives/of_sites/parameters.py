"""Parameters of the terms of many sites, and of the sites, by which is differentiated on the way back, edge
by edge.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ....compiler.sites.planes import Planes
from ....errors import IncompatibleSystem, InvalidInput
from ....formulas import vec
from ....formulas.classes.frozen import frozen
from ....formulas.classes.layouts import Layout, carried_layout, layout_of
from ....formulas.classes.of_each import Each, each
from ....formulas.classes.records import names_of, records_in, with_fields, with_records
from ....formulas.sites import SiteArray, SiteTable
from ....simulation.compiled.parameters import full_name, named, parameter, parameters, shape_of
from ...sites.graphs import AllPairs
from ...sites.runs.execution import SiteExecution
from ...sites.terms.among import is_near
from ...sites.terms.bound_terms import BoundTerm
from ...sites.terms.sums_of_terms import MomentumTerms, OfTerms
from ...sites.terms.terms import site_class
from ...sites.terms.terms_at_site import EachOfSites
from ..differences import slope_of
from .backward import EdgesAsked, VariedParameter, edges_back

WRAPPERS = {"term", "energy_of_one"}
"""The fields of terms that make something else of a term, or a term of the energy of one body."""

APART = 2.0**-7
"""How far values lie from each other in the widest differences, beside their sizes."""


def sizes_of(values: np.ndarray) -> np.ndarray:
    """How far each number of some parameters, (n, ...), is moved for a difference, beside which those that follow from
    it change little: by its own size, of matrices by those on its row's and its column's diagonal.
    """
    sizes = np.abs(values)
    if values.ndim == 3 and values.shape[1] == values.shape[2]:
        diagonal = np.sqrt(np.diagonal(sizes, axis1=1, axis2=2))
        sizes = np.maximum(sizes, diagonal[:, :, None] * diagonal[:, None, :])
    largest = sizes.reshape(len(sizes), -1).max(axis=1).reshape(-1, *[1] * (values.ndim - 1))
    return np.where(sizes > 0.0, sizes, np.where(largest > 0.0, largest, 1.0))


@frozen(eq=False)
class Slot:
    """Numbers of a term by which its energy is differentiated: a parameter, or a field that follows from it.

    path : of the fields of the term that lead to it; of sites its number.  value : one, or one for each edge.
    by : (n, numbers of the parameter, own numbers) the derivative by the parameter at all edges, or one for all; None for
    the parameter itself.
    """

    parameter: Any
    path: Any
    value: Any
    by: np.ndarray | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the value at one edge."""
        return self.value.shape if isinstance(self.value, Each) else np.shape(self.value)

    @property
    def width(self) -> int:
        """How many numbers the value has at one edge."""
        return max(1, int(np.prod(self.shape)))

    def at_edges(self, count: int, ends: Any = None) -> VariedParameter:
        """Its values at so many edges.  ends : of one of sites, which they are."""
        if isinstance(self.value, Each):
            values = self.value.values if ends is None else self.value.values[ends]
            values = values.reshape(count, -1)
        else:
            values = np.broadcast_to(np.asarray(self.value, dtype=float).ravel(), (count, self.width))
        return VariedParameter(SiteArray.of(values if self.shape else values[:, 0]), self.shape)

    def by_parameter(self, rows: np.ndarray) -> np.ndarray:
        """The derivative by the parameter of that by the numbers of the slot, (edges, ...)."""
        if self.by is None:
            return rows
        flat = rows.reshape(len(rows), -1)
        by_parameter = np.einsum("nij,nj->ni", np.broadcast_to(self.by, (len(rows), *self.by.shape[1:])), flat)
        return by_parameter.reshape(len(rows), *self.parameter.shape)


class Parameter:
    """A parameter by which is differentiated, of a term or of the sites.

    name : as it was asked for.  energy : the terms among which it is, `which` of them; None: it is one of
    the sites, which all terms may see.  slots : first its own, then the fields that follow from it.
    """

    energy: Any
    which: int | None

    def __init__(self, system: Any, name: str) -> None:
        caller = "Plan.gradient"
        of_sites = terms_of_sites(system, name)
        if of_sites:
            same = [x for x in parameters(system) if x.endswith(f".{name}")]
            if same:
                raise InvalidInput(
                    f"{caller}: {name} is a parameter of the sites, and {same[0]} one of a term; give the longer "
                    "name, or name them differently"
                )
            self.name, self.energy, self.which = name, of_sites[0], None
            number = self.energy.names.index(name)
            self.slots = [Slot(self, (number,), self.energy.own[number])]
            return
        self.name = name
        full = full_name(system, name, caller)
        value, at_term = parameter(system, full, caller), re.fullmatch(r"(?:(.*)\.)?parts\.(\d+)\.term\.(.+)", full)
        path = at_term[3].split(".") if at_term else []
        if not (at_term and _is_numeric(value) and {*path[:-1]} <= WRAPPERS):
            raise IncompatibleSystem(
                f"{caller}: {name} is no field of a term; derivatives by other parameters of many sites "
                "are found by `along=` of runs with other values, or where the system is written out"
            )
        self.energy, self.which = parameter(system, at_term[1], caller) if at_term[1] else system, int(at_term[2])
        self.slots = [Slot(self, tuple(path), value)]
        self.slots += self._following(parameter(system, full.rpartition(".")[0], caller), path[-1])

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the parameter at one edge."""
        return self.slots[0].shape

    def _following(self, owner: Any, field: str) -> list[Slot]:
        """The fields that follow from the parameter, such as the inverse of an inertia.  Raises
        IncompatibleSystem where the parameter is not used as it is given.
        """
        fields = {name: getattr(owner, name) for name in named(type(owner))}
        slot, width = self.slots[0], self.slots[0].width
        of_each = isinstance(slot.value, Each)
        start = slot.value.values if of_each else np.asarray(slot.value, float)
        count = len(start) if of_each else 1
        sizes = sizes_of(start.reshape(count, *self.shape))

        def moved(direction: np.ndarray, e: float) -> Any:
            array = start + e * sizes.reshape(start.shape) * direction.reshape(self.shape)
            new: Any = each(array) if of_each else array
            new = new if self.shape or of_each else float(new)
            return type(owner)(**{**fields, field: new})

        units = np.eye(width)
        if len(self.shape) == 2 and np.array_equal(start, np.swapaxes(start, -1, -2)):  # an inertia, which stays so
            tilted = units.reshape(width, *self.shape)
            units = 0.5 * (tilted + np.swapaxes(tilted, 1, 2)).reshape(width, width)
        near = moved(units.sum(axis=0) * 0.25, 0.5)
        kind: Any = type(near)
        others = [x for x in names_of(kind) if x != field and not _same(getattr(near, x), getattr(owner, x))]
        numeric = all(_is_numeric(getattr(owner, x)) for x in others)
        if _same(getattr(near, field), slot.value) or {*others} & {*fields} or not numeric:
            raise IncompatibleSystem(
                f"Plan.gradient: {self.name} of {type(owner).__name__} is not used as it is given; give the "
                "term the numbers that its energy uses"
            )
        slots = []
        for name in others:
            follower = getattr(owner, name)
            by = np.zeros((count, width, _numbers(follower).size // count))
            for k, unit in enumerate(units):

                def numbers(e: float, name: str = name, unit: Any = unit) -> np.ndarray:
                    return _numbers(getattr(moved(unit, e), name)).reshape(count, -1)

                by[:, k] = slope_of(numbers, APART) / sizes.reshape(count, width)[:, k, None]
            slots.append(Slot(self, (*slot.path[:-1], name), follower, by))
        return slots

    def put(self, term: Any, varied: VariedParameter, path: tuple[str, ...]) -> Any:
        """The term with the varied parameter at the end of a path of fields."""
        first, *rest = path
        inner = self.put(getattr(term, first), varied, tuple(rest)) if rest else varied
        return with_fields(term, **{first: inner})


class SlopesOfPart:
    """The sums over steps of the derivatives by parameters of one term, for every edge."""

    def __init__(
        self, energy: OfTerms, part: BoundTerm, wanted: list[Parameter], places: np.ndarray,
        asked: Layout, steps: Any,
    ) -> None:  # fmt: skip
        graph, group = part.graph, energy.group
        edges = AllPairs(group.copies).edges if is_near(graph) else graph.edges
        self.count, self.arity = len(edges), edges.shape[1]
        term: Any = part.term
        held: list[tuple[Slot, Any, VariedParameter]] = []
        for slot in [slot for x in wanted if x.which is not None for slot in x.slots]:
            held.append((slot, None, slot.at_edges(self.count)))
            term = slot.parameter.put(term, held[-1][2], slot.path)
        others = records_in(term, Each)
        term = with_records(term, Each, [EachOfSites.of_each(x) for x in others])
        of_ends: list[list[Any]] = []
        for end in edges.T:
            of_ends.append([EachOfSites.of_each(each(x.values[end])) if isinstance(x, Each) else x for x in energy.own])
            for slot in [slot for x in wanted if x.which is None for slot in x.slots]:
                held.append((slot, end, slot.at_edges(self.count, end)))
                of_ends[-1][slot.path[0]] = held[-1][2]
        ends = SiteTable.of(places[edges.T])
        site = site_class(energy.names)()
        self.edges = EdgesAsked(
            term, group.base, site, tuple(map(tuple, of_ends)), ends, isinstance(energy, MomentumTerms)
        )
        order = [next(k for k, y in enumerate(held) if y[2] is x) for x in records_in(self.edges, VariedParameter)]
        self.held = [held[k][:2] for k in order]  # as formulas find them
        self.sites = group.copies
        self.asked = asked
        width = sum(slot.width for slot, _ in self.held)
        self.total = carried_layout(zeros(width))
        self.sums = Planes.of_rows(width, self.count)
        planes = Planes.of_rows(1, 1)
        self.execution = SiteExecution(
            steps.compiled, steps.progress, edges_back, self.edges, asked, self.total, 1, planes,
            planes,
        )  # fmt: skip

    def add(self, count: int, used: Planes) -> None:
        """Add the derivatives of `count` values that the terms were asked for on the way back."""
        arguments = self.edges, self.asked, self.total, count, used, self.sums
        with self.execution.on_sites(self.count * count, self.count) as calls:
            driver: Any = edges_back if calls is None else calls
            driver(*arguments)

    @property
    def by_name(self) -> dict[str, np.ndarray]:
        """The derivatives by name: of a parameter that all edges or sites share their sum."""
        result: dict[str, Any] = {}
        begin = 0
        for slot, ends in self.held:
            rows = self.sums.array[begin : begin + slot.width, : self.count].T.reshape(-1, *slot.shape)
            begin += slot.width
            if ends is not None:
                edges, rows = rows, np.zeros((self.sites, *slot.shape))
                np.add.at(rows, ends, edges)
            slopes, name = slot.by_parameter(rows), slot.parameter.name
            slopes = slopes.copy() if isinstance(slot.value, Each) else slopes.sum(axis=0)
            result[name] = result[name] + slopes if name in result else slopes
        return result


def terms_of_sites(system: Any, name: str) -> list[OfTerms]:
    """The terms whose sites have a parameter of this name."""
    return [x for x in records_in(system, OfTerms) if name in x.names]


def _is_numeric(value: Any) -> bool:
    """Is a value a number, a vector or a matrix, or one for each edge?"""
    return isinstance(value, Each) or shape_of(layout_of(value)) is not None


def _numbers(value: Any) -> np.ndarray:
    """All numbers of a value, or of one for each edge."""
    return np.asarray(value.values if isinstance(value, Each) else value, dtype=float).ravel()


def _same(a: Any, b: Any) -> bool:
    """Are two fields of records the same?"""
    if isinstance(a, Each) and isinstance(b, Each):
        return np.array_equal(a.values, b.values)
    return bool(a is b or a == b)


def zeros(width: int) -> Any:
    """The zero vector of this width."""
    return vec(*[0.0] * width)
