"""Graphs in a system of several species: their edges are between sites of one of them, or of two."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ....errors import InvalidInput
from ....formulas import Record, Vec, record, vec
from ....formulas.classes.records import with_fields
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
    """A graph whose edges are between sites of some species, which are numbered among all."""

    graph: Graph  # as it was given
    of: tuple[int, ...]  # the species of each end of an edge
    # whole numbers; vectors of floats where formulas are not to know them, see `open`
    firsts: Any  # of these species the number of the first site
    counts: Any  # of these species the number of sites
    every: Any  # the number of all sites

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
        return int(self.every)

    @property
    def is_of_one(self) -> bool:
        """Whether its edges are between sites of one species."""
        return len({*self.of}) == 1

    @property
    def ordered(self) -> bool | None:
        """The order of the graph's ends; between two species an edge says which is the first."""
        return self.graph.ordered if self.is_of_one else True

    @property
    def arity(self) -> int:
        return self.graph.arity

    @cached_property
    def edges(self) -> np.ndarray:
        """The edges of the graph, by the numbers of sites among all species."""
        first = np.array(self.firsts, dtype=np.int64)
        if isinstance(self.graph, AllPairs) and not self.is_of_one:
            n, m = map(int, self.counts)
            return np.indices((n, m)).reshape(2, -1).T.astype(np.int64) + first
        return self.graph.edges + first

    def range_of(self, role: int) -> Vec:
        """The first of the sites of an end, and the one behind the last: numbers of the run."""
        return vec(float(self.firsts[role]), float(self.firsts[role] + self.counts[role]))

    def open(self) -> Among:
        """The graph of any number of sites, for formulas."""
        numbers: dict[str, Any] = {"firsts": vec(*map(float, self.firsts)), "counts": vec(*map(float, self.counts))}
        inner = with_fields(self.graph, count=None)
        return with_fields(self, graph=inner, every=float(self.every), **numbers)

    # ---------------------------------------------------------------- of pairs within a cutoff

    @property
    def cutoff(self) -> float:
        """The cutoff of the graph of near pairs."""
        near: Any = self.graph
        return float(near.cutoff)

    @property
    def box(self) -> Any:
        """The periodic box of the graph of near pairs, or None."""
        near: Any = self.graph
        return near.box

    def pairs(self, places: Any, reach: float) -> np.ndarray:
        """The pairs of sites up to a distance, (pairs, 2), in rising order.  places : (sites, n)."""
        near: Any = self.graph
        ranges = [range(*map(int, self.range_of(role))) for role in (0, 1)]
        species = ranges[:1] if self.is_of_one else sorted(ranges, key=lambda one: one.start)
        numbers = np.concatenate([np.asarray(sites) for sites in species])
        pairs = numbers[near.pairs(places[numbers], reach)]
        if self.is_of_one:
            return pairs
        in_order = np.isin(pairs[:, 0], species[0]) & np.isin(pairs[:, 1], species[1])
        pairs = pairs[in_order] if species[0] is ranges[0] else pairs[in_order][:, ::-1]
        return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]

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
    """Whether a graph is of pairs within a cutoff."""
    return isinstance(graph.graph if isinstance(graph, Among) else graph, Within)


def is_all_pairs(graph: Graph) -> bool:
    """Whether a graph is of all pairs, which need no list."""
    return isinstance(graph.graph if isinstance(graph, Among) else graph, AllPairs)


@record
class Species(Record):
    """The species of a system, as terms see their sites."""

    groups: tuple[LieGroup, ...]  # by species, the group of a site
    names: tuple[tuple[str, ...], ...]  # by species, the names of the parameters of a site
    which: SiteArray  # by site, the number of its species
    numbers: SiteArray  # by site, its number among all
    alike: bool  # have all species one group?

    @classmethod
    def of_group(cls, group: SpeciesGroup, names: tuple[tuple[str, ...], ...]) -> Species:
        """The species of a group, with parameters of these names."""
        species_of_sites = SiteArray.of(np.repeat(np.arange(len(group.powers), dtype=float), group.counts))
        bases = tuple([power.base for power in group.powers])
        numbers = SiteArray.of(np.arange(group.copies, dtype=float))
        return cls(bases, names, species_of_sites, numbers, len({*bases}) == 1)

    @cached_property
    def blank(self) -> tuple[Any, ...]:
        """A site of each species, of which nothing is known."""
        return tuple([site_class(names)() for names in self.names])

    def seen(self, k: int, site: Any) -> Any:
        """A site of species k, with the parameters that it has."""
        parameters = [getattr(site, name) for name in self.names[k]]
        return type(self.blank[k])(
            self.vector(k, site.mu), self.element(k, site.g), self.vector(k, site.xi), *parameters
        )

    def vector(self, k: int, mu: Any) -> Any:
        """A momentum or a velocity of species k."""
        return mu if mu is None or self.alike else mu[: self.groups[k].dim]

    def element(self, k: int, g: Any) -> Any:
        """An element of species k."""
        group = self.groups[k]
        return g if g is None or self.alike else shaped(group, g[: width_of(group)])


def places_of_sites(group: Any, g: Any) -> np.ndarray:
    """The places in space of all sites, (sites, n); those of species without places are in the origin.

    g : elements with an axis of sites.
    """
    if not isinstance(group, SpeciesGroup):
        return places_of(group.base, g)
    places: list[Any] = []
    for power, part in zip(group.powers, group.by_species(group.without_sites(g, "Element"), "Element")):
        placed = has_places(power.base)
        places.append(places_of(power.base, part) if placed else np.zeros((power.copies, 0)))
    width = max(x.shape[1] for x in places)
    return np.concatenate([np.pad(x, ((0, 0), (0, width - x.shape[1]))) for x in places])


def has_places(group: LieGroup) -> bool:
    """Whether the elements of a group have a place in space."""
    return isinstance(group, (SE2, SE3, VectorSpace))
