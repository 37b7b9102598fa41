"""Parameters of the terms of many sites by which is differentiated on the way back, edge by edge."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiler.planes import Planes
from ..errors import IncompatibleSystem
from ..formulas import vec
from ..formulas.of_each import Each, each
from ..formulas.pytree import Layout, carried_layout, exchanged, inside, layout_of, with_fields
from ..formulas.sites import SiteArray, SiteTable
from ..systems.among import is_near
from ..systems.bound_terms import BoundTerm
from ..systems.graphs import AllPairs
from ..systems.sums_of_terms import MomentumTerms, OfTerms
from ..systems.terms import Term, site_class
from ..systems.terms_at_site import EachOfSites
from .parameters import full_name, named, parameter, shape_of
from .sites_backward import EdgesAsked, Varied, edges_back
from .sites_execution import SiteExecution

WRAPPERS = "term"
"""The field of terms that make something else of a term."""


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
        graph, group = part.graph, energy.group
        edges = AllPairs(group.copies).edges if is_near(graph) else graph.edges
        self.count, self.arity = len(edges), edges.shape[1]
        term: Any = part.term
        values = [one.at_edges(self.count) for one in wanted]
        for one, value in zip(wanted, values, strict=True):
            term = one.put(term, value, one.path)
        order = [next(k for k, y in enumerate(values) if y is x) for x in inside(term, Varied)]
        self.wanted = [wanted[k] for k in order]  # as formulas find them in the term
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
        """The derivatives by name: of a parameter that all edges share their sum."""
        result, begin = {}, 0
        for one in self.wanted:
            width = max(1, int(np.prod(one.shape)))
            rows = self.sums.array[begin : begin + width, : self.count].T.reshape(-1, *one.shape)
            begin += width
            result[one.name] = rows.copy() if isinstance(one.value, Each) else rows.sum(axis=0)
        return result


def zeros(width: int) -> Any:
    """A vector of zeros."""
    return vec(*[0.0] * width)
