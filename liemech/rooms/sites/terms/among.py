"""Graphs in a system of several species: their edges are between sites of one of them, or of two."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ....errors import InvalidInput
from ....formulas import Record, Vec, record, vec
from ....formulas.classes.pytree import with_fields
from ....formulas.sites import SiteArray
from ....groups.composed.one_of import width_of
from ....groups.composed.product import shaped
from ....groups.composed.species import SpeciesGroup
from ....groups.lie_group import LieGroup
from ....groups.rigid.se2 import SE2
from ....groups.rigid.se3 import SE3
from ....groups.vector_space import VectorSpace
from ..graphs import AllPairs, Graph, Incidence, Within, incidence_of, places_of
from .terms import site_class


@record
class Among(Graph):
    """A graph whose edges are between sites of some species, which are numbered among all.

    graph : as it was given.  of : the species of each end of an edge.  firsts, counts : of these
    species the number of the first site, and how many there are.  every : how many sites there are
    in all.  (Whole numbers; a vector of floats where formulas are not to know them, see `open`.)
    """

    graph: Graph
    of: tuple[int, ...]
    firsts: Any
    counts: Any
    every: Any

    @classmethod
    def on_species(cls, name: str, graph: Graph, of: tuple[int, ...], group: SpeciesGroup) -> Among:
        """The graph on these species.  name : of the term.  Raises InvalidInput for a species or a
        site that is not there.
        """
        for k in of:
            if not 0 <= k < len(group.powers):
                raise InvalidInput(
                    f"{name}.over: of={of} names species {k}; those of {group!r} are 0 to {len(group.powers) - 1}"
                )
        counts = [group.powers[k].copies for k in of]
        if len({*of}) == 1:
            graph = graph.on(counts[0])
        else:
            graph.between(f"{name}.over", of, counts)
        return cls(graph, of, tuple([group.firsts[k] for k in of]), tuple(counts), group.copies)

    @property
    def sites(self) -> int:
        """How many there are in all."""
        return int(self.every)

    @property
    def is_of_one(self) -> bool:
        """Are its edges between sites of one species?"""
        return len({*self.of}) == 1

    @property
    def ordered(self) -> bool | None:
        """That of the graph; between two species an edge says which is the first."""
        return self.graph.ordered if self.is_of_one else True

    @property
    def arity(self) -> int:
        """How many sites an edge has."""
        return self.graph.arity

    @cached_property
    def edges(self) -> np.ndarray:
        """Those of the graph."""
        first = np.array(self.firsts, dtype=np.int64)
        if isinstance(self.graph, AllPairs) and not self.is_of_one:
            n, m = map(int, self.counts)
            return np.indices((n, m)).reshape(2, -1).T.astype(np.int64) + first
        return self.graph.edges + first

    def range_of(self, role: int) -> Vec:
        """The first of the sites of an end, and the one behind the last: numbers of the run."""
        return vec(float(self.firsts[role]), float(self.firsts[role] + self.counts[role]))

    def open(self) -> Among:
        """That of any number of sites, for formulas."""
        numbers: dict[str, Any] = {"firsts": vec(*map(float, self.firsts)), "counts": vec(*map(float, self.counts))}
        inner = with_fields(self.graph, count=None)
        return with_fields(self, graph=inner, every=float(self.every), **numbers)

    # ---------------------------------------------------------------- of pairs within a cutoff

    @property
    def cutoff(self) -> float:
        """That of the graph."""
        near: Any = self.graph
        return float(near.cutoff)

    @property
    def box(self) -> Any:
        """That of the graph."""
        near: Any = self.graph
        return near.box

    def pairs(self, places: Any, reach: float) -> np.ndarray:
        """The pairs of sites up to a distance, (pairs, 2), in rising order.  places : (sites, n)."""
        near: Any = self.graph
        ranges = [range(*map(int, self.range_of(role))) for role in (0, 1)]
        some = ranges[:1] if self.is_of_one else sorted(ranges, key=lambda one: one.start)
        numbers = np.concatenate([np.asarray(one) for one in some])
        found = numbers[near.pairs(places[numbers], reach)]
        if self.is_of_one:
            return found
        apart = np.isin(found[:, 0], some[0]) & np.isin(found[:, 1], some[1])
        found = found[apart] if some[0] is ranges[0] else found[apart][:, ::-1]
        return found[np.lexsort((found[:, 1], found[:, 0]))]

    def near(self, places: Any, reach: float, role: int) -> Incidence:
        """The sites near each site, in rising order; of no places none."""
        role_of: Any = None if self.is_of_one else role
        if places is None:
            return incidence_of(np.empty((0, 2), dtype=np.int64), 1, role_of)
        return incidence_of(self.pairs(places, reach), self.sites, role_of)

    def __repr__(self) -> str:
        of = self.of[0] if self.is_of_one else self.of
        return f"{self.graph!r}, of={of}"


def is_near(graph: Graph) -> bool:
    """Is it one of pairs within a cutoff?"""
    return isinstance(graph.graph if isinstance(graph, Among) else graph, Within)


def is_all_pairs(graph: Graph) -> bool:
    """Is it one of all pairs, which need no list?"""
    return isinstance(graph.graph if isinstance(graph, Among) else graph, AllPairs)


@record
class Species(Record):
    """The species of a system, as terms see their sites.

    groups : of each the group of a site.  names : of each those of its parameters.  which : of every
    site its species.  numbers : of every site its number among all.  alike : have all the same group?
    """

    groups: tuple[LieGroup, ...]
    names: tuple[tuple[str, ...], ...]
    which: SiteArray
    numbers: SiteArray
    alike: bool

    @classmethod
    def of(cls, group: SpeciesGroup, names: tuple[tuple[str, ...], ...]) -> Species:
        """Those of a group, with parameters of these names."""
        which = SiteArray.of(np.repeat(np.arange(len(group.powers), dtype=float), group.counts))
        bases = tuple([power.base for power in group.powers])
        numbers = SiteArray.of(np.arange(group.copies, dtype=float))
        return cls(bases, names, which, numbers, len({*bases}) == 1)

    @cached_property
    def blank(self) -> tuple[Any, ...]:
        """Of each species a site of which nothing is known."""
        return tuple([site_class(names)() for names in self.names])

    def seen(self, k: int, site: Any) -> Any:
        """A site of species k, with the parameters that it has."""
        own = [getattr(site, name) for name in self.names[k]]
        return type(self.blank[k])(self.vector(k, site.mu), self.element(k, site.g), self.vector(k, site.xi), *own)

    def vector(self, k: int, mu: Any) -> Any:
        """A momentum or a velocity of species k."""
        return mu if mu is None or self.alike else mu[: self.groups[k].dim]

    def element(self, k: int, g: Any) -> Any:
        """An element of species k."""
        group = self.groups[k]
        return g if g is None or self.alike else shaped(group, g[: width_of(group)])


def places_of_sites(group: Any, g: Any) -> np.ndarray:
    """Where in space all sites are, (sites, n); those of species without places are in the origin.

    g : elements with an axis of sites.
    """
    if not isinstance(group, SpeciesGroup):
        return places_of(group.base, g)
    found: list[Any] = []
    for power, part in zip(group.powers, group.by_species(group.without_sites(g, "Element"), "Element")):
        there = has_places(power.base)
        found.append(places_of(power.base, part) if there else np.zeros((power.copies, 0)))
    width = max(x.shape[1] for x in found)
    return np.concatenate([np.pad(x, ((0, 0), (0, width - x.shape[1]))) for x in found])


def has_places(group: LieGroup) -> bool:
    """Do its elements have a place in space?"""
    return isinstance(group, (SE2, SE3, VectorSpace))
