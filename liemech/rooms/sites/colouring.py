"""Colours of sites, such that no edge ties two of one colour: sites that can move at the same time.

Two colours are found wherever they do; lattices, and sites in an order with a period, have the
fewest; for all others colours are given one after the other, and taken back where they can be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...formulas import Record, record
from ...formulas.classes.frozen import frozen
from ...formulas.classes.records import fill
from ...formulas.sites import TOGETHER
from .graphs import Edges, Graph, Lattice

SWEEPS = 10
"""How often colours are given again in another order, which never takes more of them."""

PERIODS = 12
"""Sites i and i + k of one colour are tried up to this period k."""


@frozen(eq=False)
class Colouring:
    """Sites in groups, no two of a group tied by an edge.

    colours : (sites,), the group of each, from 0.
    """

    colours: np.ndarray

    @property
    def count(self) -> int:
        """The number of groups, one for each colour."""
        return int(self.colours.max(initial=-1)) + 1

    @property
    def groups(self) -> tuple[np.ndarray, ...]:
        """The sites of each colour, in rising order."""
        order = np.argsort(self.colours, kind="stable")
        ends = np.cumsum(np.bincount(self.colours, minlength=self.count))
        return tuple(np.split(order, ends[:-1]))

    def fits(self, edges: np.ndarray) -> bool:
        """Whether no edge ties two sites of one colour.  edges : (edges, 2) or (edges, arity)."""
        return all(bool((self.colours[a] != self.colours[b]).all()) for a, b in _pairs_of(edges.T))


class PlacesByColour(NamedTuple):
    """Sites in the order of their colours, those of one colour side by side: where loops find them.

    Every colour fills whole groups of sixteen places; the last site of it stands in those beyond.
    """

    sites: np.ndarray  # (places,), the site at each
    places: np.ndarray  # (sites,), the place of each
    ranges: tuple[tuple[int, int], ...]  # where each colour begins and ends

    @classmethod
    def of_colouring(cls, colouring: Colouring) -> PlacesByColour:
        """The places of the sites of a colouring."""
        rows, ranges, end = [], [], 0
        for group in colouring.groups:
            size = -(-len(group) // TOGETHER) * TOGETHER
            rows.append(group[np.minimum(np.arange(size), len(group) - 1)])
            ranges.append((end, end + size))
            end += size
        sites = np.concatenate(rows)
        places = np.empty(len(colouring.colours), dtype=np.int64)
        places[sites[::-1]] = np.arange(end - 1, -1, -1)  # the first place of each
        return cls(sites, places, tuple(ranges))


@record
class Coloured(Record):
    """Sites that are tied by the edges of graphs, and these edges, in groups by their colours."""

    graphs: tuple[Graph, ...]
    sites: int  # the number of sites

    @cached_property
    def colouring(self) -> Colouring:
        """The colours of the sites."""
        return colours_of(self.graphs, self.sites)

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """The sites of each colour; none if there are no graphs."""
        return tuple([tuple(g.tolist()) for g in self.colouring.groups]) if self.graphs else ()

    @property
    def count(self) -> int:
        """The number of colours of the sites; none without graphs."""
        return self.colouring.count if self.graphs else 0

    @cached_property
    def of_bonds(self) -> tuple[np.ndarray, ...]:
        """For each graph the colours of its edges of two sites."""
        return tuple([colours_of_bonds(graph) for graph in self.graphs])

    @property
    def counts(self) -> tuple[int, ...]:
        """The number of colours of the edges, for each graph."""
        return tuple([int(colours.max(initial=-1)) + 1 for colours in self.of_bonds])

    @cached_property
    def bonds(self) -> tuple[tuple[tuple[int, int, int, int], ...], ...]:
        """For each colour of edges of two sites: the graph, the edge, and its sites."""
        bonds: list[Any] = []
        for k, (graph, colours) in enumerate(zip(self.graphs, self.of_bonds)):
            edges = graph.edges
            for colour in range(self.counts[k]):
                numbers = np.flatnonzero(colours == colour).tolist()
                bonds.append(tuple([(k, e, *edges[e].tolist()) for e in numbers]))
        return tuple(bonds)


def colours_of(graphs: Sequence[Graph], sites: int) -> Colouring:
    """The colours of sites that are tied by the edges of graphs; one if none are."""
    ties = [np.stack(pair, axis=1) for g in graphs for pair in _pairs_of(g.edges.T)]
    edges = np.concatenate(ties) if ties else np.empty((0, 2), dtype=np.int64)
    if not len(edges):
        return Colouring(np.zeros(sites, dtype=np.int64))
    lattices = [Colouring(_of_lattice(g)) for g in graphs if isinstance(g, Lattice)]
    best = Colouring(np.arange(sites))
    for candidate in lattices:
        if candidate.count < best.count and candidate.fits(edges):
            best = candidate
    two = None if best.count <= 2 else _two(edges, sites)
    if two is not None:
        return two
    least = max(3, *[g.edges.shape[1] for g in graphs])
    for candidate in _candidates(edges, sites, least):
        if best.count <= least:
            break
        if candidate.count < best.count and candidate.fits(edges):
            best = candidate
    return best


def colours_of_edges(edges: np.ndarray) -> np.ndarray:
    """A colour for each edge, such that no two of one colour share a site.  edges : (edges, arity)."""
    count, arity = edges.shape
    ends = edges.ravel()
    order = np.argsort(ends, kind="stable")
    numbers, sites = order // arity, ends[order]
    ties = []
    for step in range(1, int(np.bincount(ends, minlength=1).max(initial=0))):
        meets = sites[step:] == sites[:-step]
        ties.append(np.stack([numbers[:-step][meets], numbers[step:][meets]], axis=1))
    shared = np.concatenate(ties) if ties else np.empty((0, 2), dtype=np.int64)
    ties_of_edges = fill(Edges, {"given": shared, "count": count, "order": None})  # one may be there twice
    return colours_of([ties_of_edges], count).colours


def colours_of_bonds(graph: Graph) -> np.ndarray:
    """A colour for each edge of a graph, such that no two of one colour share a site: two for each
    axis of a lattice, three for one that is closed and odd.
    """
    if not isinstance(graph, Lattice):
        return colours_of_edges(graph.edges)
    place = np.indices(graph.shape)
    rows, first = [], 0
    for axis, (n, periodic) in enumerate(zip(graph.shape, graph.periodic)):
        if n > 1:
            along = place[axis] if periodic else np.delete(place[axis], -1, axis)
            rows.append((first + _around(n, periodic)[along]).ravel())
            first = 1 + int(rows[-1].max())
    return np.concatenate(rows) if rows else np.empty(0, dtype=np.int64)


# ------------------------------------------------------------------ ways to find colours


def _pairs_of(ends: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The first and the second ends of all pairs of sites that edges tie.  ends : (arity, edges)."""
    for i in range(len(ends)):
        for j in range(i + 1, len(ends)):
            yield ends[i], ends[j]


def _candidates(edges: np.ndarray, sites: int, least: int) -> Iterator[Colouring]:
    """Colourings that may fit, and at last one that does; none has fewer than the least colours."""
    for period in range(least, min(PERIODS, sites) + 1):
        yield Colouring(np.arange(sites) % period)
    yield _one_by_one(edges, sites, least)


def _two(edges: np.ndarray, sites: int) -> Colouring | None:
    """Two colours, if they are enough: those of the graph with two copies of each site, whose edges
    tie a first copy to a second one.  In it the copies of a site hang together if and only if a
    circle through the site is odd.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = edges.T
    ties = np.concatenate([a, a + sites]), np.concatenate([b + sites, b])
    graph = coo_array((np.ones(len(ties[0]), dtype=np.int8), ties), shape=(2 * sites, 2 * sites))
    _, part = connected_components(graph.tocsr(), directed=False)
    if (part[:sites] == part[sites:]).any():
        return None
    return Colouring((part[:sites] > part[sites:]).astype(np.int64))


def _around(n: int, periodic: bool) -> np.ndarray:
    """0, 1, 0, 1, ... along an axis, with 2 at the end if it is closed and odd."""
    colours = np.arange(n) % 2
    if periodic and n % 2:
        colours[-1] = 2
    return colours


def _of_lattice(lattice: Lattice) -> np.ndarray:
    """The sum of colours along the axes, modulo as many as the axis needs that needs most."""
    rows = [_around(n, p) for n, p in zip(lattice.shape, lattice.periodic)]
    total = sum(np.ix_(*rows), np.zeros((1,) * len(rows), dtype=np.int64))
    return (total % (1 + max(int(row.max()) for row in rows))).ravel()


def _one_by_one(edges: np.ndarray, sites: int, least: int) -> Colouring:
    """The first free colour for one site after the other, those whose neighbours have theirs at the
    same time; then again, colour by colour, the last one first, until there are no more than the
    least.

    Source: Culberson, Iterated greedy graph coloring (1992); Jones and Plassmann, SIAM J. Sci.
    Comput. 14 (1993).
    """
    directed = np.concatenate([edges, edges[:, ::-1]])
    site, other = np.divmod(np.unique(directed[:, 0] * sites + directed[:, 1]), sites)
    begin = np.searchsorted(site, np.arange(sites + 1))
    rank = np.random.default_rng(5).permutation(sites) + sites * np.diff(begin)
    colours = np.full(sites, -1, dtype=np.int64)
    waiting = np.bincount(site[rank[other] > rank[site]], minlength=sites)
    ready = np.flatnonzero(waiting == 0)
    while len(ready):
        colours[ready] = _first_free(ready, colours, other, begin)
        i, _ = _entries(ready, begin)
        later = other[i]
        later = later[colours[later] < 0]
        np.subtract.at(waiting, later, 1)
        ready = np.unique(later[waiting[later] == 0])
    for sweep in range(SWEEPS):
        count = int(colours.max()) + 1
        if count <= least:
            break
        sizes = np.bincount(colours, minlength=count)
        order = np.argsort(sizes, kind="stable") if sweep % 2 else np.arange(count)
        again = np.full(sites, -1, dtype=np.int64)
        for c in order[::-1]:
            members = np.flatnonzero(colours == c)
            again[members] = _first_free(members, again, other, begin)
        colours = again
    return Colouring(colours)


def _entries(some: np.ndarray, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The places of the neighbours of some sites in the list of all, and which of these sites each belongs to."""
    sizes = begin[some + 1] - begin[some]
    whose = np.repeat(np.arange(len(some)), sizes)
    place = np.arange(len(whose)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return begin[some][whose] + place, whose


def _first_free(some: np.ndarray, colours: np.ndarray, other: np.ndarray, begin: np.ndarray) -> np.ndarray:
    """For each of some sites the first colour that no neighbour has."""
    at, whose = _entries(some, begin)
    taken = colours[other[at]]
    coloured = taken >= 0
    most = int(taken.max(initial=0)) + 1
    whose, taken = np.divmod(np.unique(whose[coloured] * most + taken[coloured]), most)
    first = np.searchsorted(whose, np.arange(len(some) + 1))
    place = np.arange(len(whose)) - first[whose]
    free = np.diff(first)  # all of them in a row: the next one
    gap = taken != place
    np.minimum.at(free, whose[gap], place[gap])
    return free
