"""Parameters of the terms of many sites, and of the sites, by which is differentiated on the way back, edge
by edge.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ....compiler.planes import Planes
from ....errors import IncompatibleSystem, InvalidInput
from ....formulas import vec
from ....formulas.of_each import Each, each
from ....formulas.pytree import Layout, carried_layout, exchanged, inside, layout_of, with_fields
from ....formulas.sites import SiteArray, SiteTable
from ....systems.among import is_near
from ....systems.bound_terms import BoundTerm
from ....systems.graphs import AllPairs
from ....systems.sums_of_terms import MomentumTerms, OfTerms
from ....systems.terms import Term, site_class
from ....systems.terms_at_site import EachOfSites
from ...compiled.parameters import full_name, named, parameter, parameters, shape_of
from ...sites.execution import SiteExecution
from .backward import EdgesAsked, Varied, edges_back

WRAPPERS = "term"
"""The field of terms that make something else of a term."""


class Parameter:
    """A parameter by which is differentiated, of a term or of the sites.

    name : as it was asked for.  energy : the terms among which it is, `which` of them; None: it is one of
    the sites, which all terms may see.  path : of the fields that lead to it; of sites its number.
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
            self.path: Any = (self.energy.names.index(name),)
            self.value = self.energy.own[self.path[0]]
            return
        self.name, self.full = name, full_name(system, name, caller)
        parts = self.full.split(".")
        value: Any = system
        self.energy = None
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

    def at_edges(self, count: int, ends: Any = None) -> Varied:
        """Its values at so many edges.  ends : of one of sites, which they are."""
        if isinstance(self.value, Each):
            values = self.value.values if ends is None else self.value.values[ends]
            values = values.reshape(count, -1)
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
        graph, group = part.graph, energy.group
        edges = AllPairs(group.copies).edges if is_near(graph) else graph.edges
        self.count, self.arity = len(edges), edges.shape[1]
        term: Any = part.term
        held: list[tuple[Parameter, Any, Varied]] = []
        for one in [x for x in wanted if x.which is not None]:
            held.append((one, None, one.at_edges(self.count)))
            term = one.put(term, held[-1][2], one.path)
        others = inside(term, Each)
        term = exchanged(term, Each, [EachOfSites.of_each(x) for x in others])
        own: list[list[Any]] = []
        for there in edges.T:
            own.append(
                [
                    EachOfSites.of_each(each(x.values[there])) if isinstance(x, Each) else x
                    for x in energy.own
                ]
            )
            for one in [x for x in wanted if x.which is None]:
                held.append((one, there, one.at_edges(self.count, there)))
                own[-1][one.path[0]] = held[-1][2]
        ends = SiteTable.of(places[edges.T])
        site = site_class(energy.names)()
        self.edges = EdgesAsked(
            term, group.base, site, tuple(map(tuple, own)), ends, isinstance(energy, MomentumTerms)
        )
        order = [
            next(k for k, y in enumerate(held) if y[2] is x) for x in inside(self.edges, Varied)
        ]
        self.held = [held[k][:2] for k in order]  # as formulas find them
        self.sites = group.copies
        self.asked = asked
        width = sum(max(1, int(np.prod(one.shape))) for one, _ in self.held)
        self.total = carried_layout(zeros(width))
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
        """The derivatives by name: of a parameter that all edges or sites share their sum."""
        result: dict[str, Any] = {}
        begin = 0
        for one, ends in self.held:
            width = max(1, int(np.prod(one.shape)))
            rows = self.sums.array[begin : begin + width, : self.count].T.reshape(-1, *one.shape)
            begin += width
            if ends is not None:
                edges, rows = rows, np.zeros((self.sites, *one.shape))
                np.add.at(rows, ends, edges)
            own = rows.copy() if isinstance(one.value, Each) else rows.sum(axis=0)
            result[one.name] = result[one.name] + own if one.name in result else own
        return result


def terms_of_sites(system: Any, name: str) -> list[OfTerms]:
    """The terms whose sites have a parameter of this name."""
    return [x for x in inside(system, OfTerms) if name in x.names]


def zeros(width: int) -> Any:
    """A vector of zeros."""
    return vec(*[0.0] * width)
