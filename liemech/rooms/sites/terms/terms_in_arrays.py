"""Energies, velocities and forces of many sites at the samples of a run: terms on whole arrays, edge
by edge, for systems that are too large to be written out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from ....formulas import Record, Vec, record, vec
from ....formulas.classes.of_each import Each
from ....formulas.classes.records import records_in, with_records
from ....groups.composed.one_of import filled, width_of
from ....groups.composed.product import shaped
from ....groups.lie_group import LieGroup
from ..graphs import AllPairs
from .among import Species, is_near, places_of_sites
from .bound_terms import BoundTerm
from .near_pairs import NearPairs
from .terms import Term, site_class
from .terms_at_site import in_shape

ROWS = 2**17
"""So many edges are looked at together."""


@record
class OfEdge(Record):
    """A term as a function of the numbers of one edge: of every end the momentum, the element or both, and
    its own parameters, then the parameters of the edge.
    """

    term: Term
    base: LieGroup  # the group of a site
    arity: int
    role: int  # the place in the energy by which derivatives are taken
    parts: tuple[str, ...]  # of the state of a site, on which it depends
    names: tuple[str, ...]
    own: tuple[Any, ...]
    species: Species | None = None  # the species of the sites, if there are several
    of: tuple[int, ...] = ()  # the species of the ends

    @classmethod
    def of_part(cls, terms: Any, part: BoundTerm, role: int = 0) -> OfEdge:
        """The function for an edge of one of the terms of a sum."""
        leading = part.term, terms.group.base, part.graph.arity, role, terms.of_a_site
        return cls(*leading, terms.names, terms.own, terms.species, part.of)

    @property
    def width(self) -> int:
        """The number of components of what the term sees of the state of a site."""
        return self.base.dim * ("mu" in self.parts) + width_of(self.base) * ("g" in self.parts)

    @cached_property
    def site(self) -> Any:
        """A site of which nothing is known."""
        return site_class(self.names)()

    def sites(self, numbers: Vec) -> tuple[Any, list[Any]]:
        """The term with the parameters of the edge, and its sites."""
        at, sites = 0, []  # type: int, list[Any]
        for _ in range(self.arity):
            entries = numbers[at : at + self.width]
            at = at + self.width
            parameters: list[Any] = []
            for x in self.own:
                if isinstance(x, Each):
                    parameters = [*parameters, _taken(numbers, at, x.shape)]
                    at = at + math.prod(x.shape)
                else:
                    parameters = [*parameters, x]
            momenta = self.base.dim if "mu" in self.parts else 0
            mu = entries[:momenta] if momenta > 0 else None
            g = shaped(self.base, entries[momenta:]) if "g" in self.parts else None
            sites = [*sites, type(self.site)(mu, g, None, *parameters)]
        if self.species is not None:
            sites = [self.species.seen(k, site) for k, site in zip(self.of, sites)]
        values: list[Any] = []
        for each in records_in(self.term, Each):
            values = [*values, _taken(numbers, at, each.shape)]
            at = at + math.prod(each.shape)
        return with_records(self.term, Each, values), sites

    def energy(self, numbers: Vec) -> float:
        """The energy of the edge.  numbers : (n,)."""
        term, sites = self.sites(numbers)
        return term.energy(*sites)

    def slope(self, numbers: Vec) -> Vec:
        """The derivative by the momentum of the site, the force on it, or both.  numbers : (n,)."""
        term, sites = self.sites(numbers)
        slope: list[Any] = []
        if "mu" in self.parts:
            slope = [*filled(term.slope(self.role, *sites), self.base.dim)]
        if "g" in self.parts:
            group = self.base if self.species is None else self.species.groups[self.of[self.role]]
            slope = [*slope, *filled(term.force(group, self.role, *sites), self.base.dim)]
        return vec(*slope)


def _taken(numbers: Any, at: int, shape: tuple[int, ...]) -> Any:
    """The number, the vector or the matrix that begins there."""
    return in_shape(numbers[at : at + math.prod(shape)] if shape else numbers[at], shape)


def energies(terms: Any, states: np.ndarray) -> np.ndarray:
    """The energy at every sample.  states : (samples, sites, width)."""
    totals = np.zeros(len(states))
    for part in terms.parts:
        of_edge = OfEdge.of_part(terms, part)
        for samples, ends, numbers in _blocks(terms, part, states):
            rows = _rows(of_edge, states[samples], ends, numbers)
            totals[samples] += np.asarray(of_edge.energy(rows)).reshape(-1, len(ends)).sum(axis=1)
    return totals


def slopes_of(terms: Any, states: np.ndarray) -> np.ndarray:
    """The derivatives by momenta, the forces, or one behind the other, at every sample, (samples, sites, n)."""
    dim = terms.group.base.dim
    slopes = np.zeros((*states.shape[:2], dim * len(terms.of_a_site)))
    for part in terms.parts:
        for role in range(part.graph.arity):
            of_edge = OfEdge.of_part(terms, part, role)
            for samples, ends, numbers in _blocks(terms, part, states):
                rows = _rows(of_edge, states[samples], ends, numbers)
                values = np.asarray(of_edge.slope(rows)).reshape(-1, len(ends), slopes.shape[2])
                for sample, at in enumerate(range(samples.start, samples.stop)):
                    np.add.at(slopes[at], ends[:, role], values[sample])
    slopes[:, list(terms.held)] = 0.0
    slopes[:, list(terms.pinned), 3:] = 0.0
    return slopes


def _rows(of_edge: OfEdge, states: np.ndarray, ends: np.ndarray, numbers: Any) -> np.ndarray:
    """The numbers of edges, one after the other."""
    shape = len(states), len(ends)
    columns = []
    for k in range(ends.shape[1]):
        columns.append(states[:, ends[:, k]])
        columns += [_shared(x.values[ends[:, k]], shape) for x in of_edge.own if isinstance(x, Each)]
    columns += [_shared(x.values[numbers], shape) for x in records_in(of_edge.term, Each)]
    return np.concatenate(columns, axis=2).reshape(shape[0] * shape[1], -1)


def _shared(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    rows = values.reshape(shape[1], -1)
    return np.broadcast_to(rows, (*shape, rows.shape[1]))


def _blocks(terms: Any, part: BoundTerm, states: np.ndarray) -> Iterator[tuple[slice, np.ndarray, Any]]:
    """Blocks of samples and edges: the samples, the ends of the edges, and their numbers."""
    graph, samples = part.graph, len(states)
    if is_near(graph) and isinstance(part.term, NearPairs):
        near: Any = graph
        for i, state in enumerate(states):
            g = state.reshape(len(state), *terms.group.base.element_shape)
            ends = near.pairs(places_of_sites(terms.group, g), near.cutoff)
            for first in range(0, len(ends), ROWS):
                yield slice(i, i + 1), ends[first : first + ROWS], None
        return
    if isinstance(graph, AllPairs) and not records_in(part.term, Each):
        sites, first = states.shape[1], 0
        while first < sites - 1:
            last = min(sites - 1, first + max(1, ROWS // sites))
            pairs = np.nonzero(np.arange(first, last)[:, None] < np.arange(sites))
            ends = np.stack([pairs[0] + first, pairs[1]], axis=1)
            for at in range(samples):
                yield slice(at, at + 1), ends, None
            first = last
        return
    edges, samples_at_once = graph.edges, max(1, ROWS // max(1, len(graph.edges)))
    for first in range(0, samples, samples_at_once):
        block = slice(first, min(samples, first + samples_at_once))
        for begin in range(0, len(edges), ROWS):
            numbers = slice(begin, begin + ROWS)
            yield block, edges[numbers], numbers
