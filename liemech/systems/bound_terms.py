"""Terms on the sites of a system: an edge with its numbers, and what all edges at a site add up to."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import Record, Vec, record
from ..formulas.of_each import Each
from ..formulas.pytree import exchanged, inside
from ..formulas.sites import partners
from ..formulas.vectors import small
from ..groups.power import PowerGroup
from .graphs import AllPairs, Graph, Incidence, Within, place
from .kinds_of_terms import Kind
from .near_pairs import NearPairs
from .terms import Over, Term, Terms, timed

# ------------------------------------------------------------------ on the sites of a system


@record
class BoundTerm(Record):
    """A term on the edges of a graph whose number of sites is known.

    merged : are the two ends of an edge alike, so that nobody need know which is the first?
    first : does it count for the first of the ends only, as a force?  kind : what is seen of a
    term in momenta.
    """

    term: Term
    graph: Graph
    merged: bool = False
    first: bool = False
    kind: Kind = Kind()

    def __repr__(self) -> str:
        return repr(Over(self.term, self.graph))

    @property
    def in_rounds(self) -> bool:
        """Does every site meet all others, alike, in the order of `partners`?"""
        return isinstance(self.graph, AllPairs) and self.merged and not _each_of(self.term)

    @property
    def roles(self) -> tuple[int, ...]:
        """The places in the energy in which a site may stand."""
        return (0,) if self.merged or self.first else tuple(range(self.graph.arity))

    def incidence(self, role: int) -> Incidence:
        """The edges at each site in this role."""
        return self.graph.incidence(None if self.merged else role)

    @cached_property
    def at_sites(self) -> tuple[Any, ...]:
        """For each site the edges that end there: the role, the number of the edge, and all sites in
        the order in which the energy takes them.
        """
        count = self.graph.sites or 0
        if self.in_rounds:
            met = [partners(i, count) for i in range(count)]
            return tuple(
                [
                    tuple([(0, 0, (i, j)) if first else (1, 0, (j, i)) for j, first in them])
                    for i, them in enumerate(met)
                ]
            )
        found: list[list[Any]] = [[] for _ in range(count)]
        for role in self.roles:
            others, numbers, counts = self.incidence(role)
            for i, mine in enumerate(found):
                for d in range(int(counts[i])):
                    ends = [int(x) for x in others[:, d, i]]
                    mine.append((role, int(numbers[d, i]), (*ends[:role], i, *ends[role:])))
        return tuple(map(tuple, found))

    def at_edge(self, number: int) -> Term:
        """The term with the parameters of one edge."""
        return exchanged(self.term, Each, [one.of(number) for one in inside(self.term, Each)])

    def edges_at(self, sites: list[Any], i: int) -> list[Any]:
        """The edges at site i: the role, the term, the sites."""
        return [
            (role, self.at_edge(number), [sites[j] for j in ends])
            for role, number, ends in self.at_sites[i]
        ]


def share(total: float, edges: list[Any], merged: bool) -> float:
    """A number, and the energies of the edges of which a site is the first, half of each where ends
    are alike.
    """
    for role, term, ends in edges:
        if role == 0 or merged:
            energy = term.energy(*ends)
            total = total + (0.5 * energy if merged else energy)
    return total


def slopes(total: Vec, edges: list[Any]) -> Vec:
    """A vector, and the derivatives of the energies of edges by the momentum of a site."""
    for role, term, ends in edges:
        total = total + term.slope(role, *ends)
    return total


def forces(total: Vec, group: Any, edges: list[Any]) -> Vec:
    """A vector, and the forces on a site."""
    for role, term, ends in edges:
        total = total + term.force(group, role, *ends)
    return total


def loads(total: Vec, t: float, edges: list[Any]) -> Vec:
    """A vector, and the forces that terms are on a site at time t."""
    for role, term, ends in edges:
        total = total + term.covector(t, ends[role], *ends[:role], *ends[role + 1 :])
    return total


def bound(terms: Terms, group: PowerGroup) -> tuple[BoundTerm, ...]:
    """Terms on the sites of a power.  Raises InvalidInput for graphs of other sites, and for
    parameters that are not as many as edges.
    """
    sites = group.copies
    for name, value in terms.own.items():
        if isinstance(value, Each) and len(value) != sites:
            raise InvalidInput(f"Terms: {name} has {len(value)} values for {sites} sites")
    wrong = [i for i in terms.held if not 0 <= i < sites]
    if wrong:
        raise InvalidInput(
            f"Terms: held names site {wrong[0]}, which is not there; they are 0 to {sites - 1}"
        )
    return tuple([_bound(over, group) for over in terms.terms])


def _bound(over: Over, group: PowerGroup) -> BoundTerm:
    graph, given = over.graph.on(group.copies), timed(over.term)
    if isinstance(graph, Within):
        base = group.base
        there = place(base, small(np.asarray(base.identity())))
        if graph.box is not None and len(graph.box) != len(there):
            raise InvalidInput(
                f"{graph!r}: the box has {len(graph.box)} lengths, and {base!r} moves in a space of "
                f"{len(there)} dimensions"
            )
        if _each_of(over.term):
            raise InvalidInput(
                f"{type(over.term).__name__}: pairs within a cutoff come and go: a parameter of theirs is "
                "one for all; give sites their own, Terms(..., name=each(values))"
            )
        near = NearPairs(given, base, graph.cutoff, graph.inner, graph.box)
        return BoundTerm(near, graph)
    count = len(graph.edges) if _each_of(over.term) else 0
    for each in _each_of(over.term):
        if len(each) != count:
            what = "sites" if graph.arity == 1 else "edges"
            raise InvalidInput(
                f"{type(over.term).__name__}: a parameter has {len(each)} values, and {graph!r} has "
                f"{count} {what}"
            )
    return BoundTerm(given, graph)


def _each_of(value: Any) -> list[Any]:
    return inside(value, Each)
