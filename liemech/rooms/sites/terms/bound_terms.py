"""Terms on the sites of a system: their graphs with a number of sites, the edges at each site, the parameters of sites."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ....errors import InvalidInput
from ....formulas import Record, record
from ....formulas.classes.fields import OfEach
from ....formulas.classes.of_each import Each, each
from ....formulas.classes.records import records_in, with_records
from ....formulas.sites import chains_of_partners
from ....formulas.vectors import small
from ....groups.composed.power import PowerGroup
from ....groups.composed.species import SpeciesGroup
from ..graphs import AllPairs, EachSite, Graph, Incidence, place
from .among import Among, Species, is_near
from .point_terms import near_pairs
from .terms import AtTime, Over, Term, Terms, timed


@record
class Kind(Record):
    """The properties of a term that are proved for all its edges."""

    affine: bool = False  # is it affine in the momentum of each site?
    steady: bool = False  # does the velocity that it gives a single site stay as it is while the site moves along?
    isotropic: bool = False  # is it a function of the product of two momenta, with derivatives c b and c a?


# ------------------------------------------------------------------ on the sites of a system


@record
class BoundTerm(Record):
    """A term on the edges of a graph whose number of sites is known."""

    term: Term
    graph: Graph
    merged: bool = False  # are the two ends of an edge alike, so that nobody need know which is the first?
    first: bool = False  # does it count for the first of the ends only, as a force?
    kind: Kind = Kind()  # what is proved of a term in momenta

    def __post_init__(self) -> None:
        """Raises InvalidInput for a parameter with another number of values than there are edges."""
        super().__post_init__()
        count = len(self.graph.edges) if _each_of(self.term) else 0
        for parameter in _each_of(self.term):
            if len(parameter) != count:
                places = "sites" if self.graph.arity == 1 else "edges"
                term = self.term.term if isinstance(self.term, AtTime) else self.term
                raise InvalidInput(
                    f"{type(term).__name__}: a parameter has {len(parameter)} values, and {self.graph!r} has {count} {places}"
                )

    def require_on(self, group: PowerGroup | SpeciesGroup) -> None:
        """Raise InvalidInput unless its graph is one on the sites of this group."""
        graph, name = self.graph, type(self.term).__name__
        if isinstance(graph, Among) and isinstance(group, SpeciesGroup):
            graph = Among.on_species(name, graph.graph, graph.of, group)
        if graph != self.graph or graph.sites != group.copies:
            raise InvalidInput(
                f"{name}: {self.graph!r} is on {self.graph.sites} sites, and {group!r} has {group.copies}"
            )

    def __repr__(self) -> str:
        if not isinstance(self.graph, Among):
            return repr(Over(self.term, self.graph))
        return repr(Over(self.term, self.graph.graph, self.graph.of))

    @property
    def of(self) -> tuple[int, ...]:
        """The species of the ends of an edge; (): there is one only."""
        return self.graph.of if isinstance(self.graph, Among) else ()

    @property
    def in_rounds(self) -> bool:
        """Whether every site meets all others, with one formula, in the order of `chains_of_partners`."""
        return isinstance(self.graph, AllPairs) and self.merged and not _each_of(self.term)

    @property
    def roles(self) -> tuple[int, ...]:
        """The numbers of the arguments of the energy that a site may be."""
        return (0,) if self.merged or self.first else tuple(range(self.graph.arity))

    def incidence(self, role: int) -> Incidence:
        """The edges at each site in this role."""
        return self.graph.incidence(None if self.merged else role)

    @cached_property
    def chains(self) -> tuple[tuple[tuple[Any, ...], ...], ...]:
        """By role and site, its edges, in chains whose sums are added by halves: each the role of the site, the number
        of the edge, and all its sites.
        """
        count = self.graph.sites or 0
        if self.in_rounds:
            return (tuple(_in_rounds(i, count) for i in range(count)),)
        return tuple(self._chains_of(role) for role in self.roles)

    def _chains_of(self, role: int) -> tuple[Any, ...]:
        """By site, one chain of its edges in this role."""
        others, numbers, counts = self.incidence(role)
        chains: list[Any] = []
        for i, count in enumerate(counts):
            mates, edges = others[:, :count, i].T.tolist(), numbers[:count, i].tolist()
            chains.append(((tuple((role, e, (*ends[:role], i, *ends[role:])) for e, ends in zip(edges, mates)),),))
        return tuple(chains)


def _in_rounds(i: int, count: int) -> tuple[Any, ...]:
    """The edges of site i to all others, in the chains in which it meets them."""
    return tuple(
        tuple(tuple((0, 0, (i, j)) if first else (1, 0, (j, i)) for j, first in chain) for chain in chains)
        for chains in chains_of_partners(i, count)
    )


def term_of_edge(term: Term, number: Any) -> Term:
    """The term with the parameters of one edge."""
    return with_records(term, OfEach, [parameter.of(number) for parameter in records_in(term, OfEach)])


def bound(terms: Terms, group: PowerGroup | SpeciesGroup) -> tuple[BoundTerm, ...]:
    """Terms on the sites of a power, or of a product of them.  Raises InvalidInput for graphs of other
    sites, and for parameters that are not as many as edges.
    """
    return tuple([_bound(over, group) for over in terms.terms])


def parameters(terms: Terms, group: PowerGroup | SpeciesGroup) -> tuple[Any, ...]:
    """The parameters of the sites of a power or a product of them: their names, their values for all
    sites, the sites that are held, and the species.  Raises InvalidInput for those of other sites.
    """
    if not isinstance(group, SpeciesGroup):
        for name, value in terms.own.items():
            _require_many(name, value, group.copies, repr(group))
        return terms.names, tuple(terms.own.values()), numbers_of(terms, "held", group), None
    values = [_of_species(name, x, group) for name, x in terms.own.items()]
    has = [
        tuple([name for name, x in terms.own.items() if not isinstance(x, dict) or k in x])
        for k in range(len(group.powers))
    ]
    return (terms.names, tuple(values), numbers_of(terms, "held", group), Species.of_group(group, tuple(has)))


def _require_many(name: str, value: Any, sites: int, whose: str) -> None:
    if isinstance(value, dict):
        raise InvalidInput(f"Terms: {name} is told by species, and the sites of {whose} are of one species")
    if isinstance(value, Each) and len(value) != sites:
        raise InvalidInput(f"Terms: {name} has {len(value)} values for {sites} sites")


def _of_species(name: str, value: Any, group: SpeciesGroup) -> Any:
    """A parameter as one of all sites: zero where a species has none."""
    if not isinstance(value, dict):
        _require_many(name, value, group.copies, repr(group))
        return value
    parts: dict[int, np.ndarray] = {}
    for k, x in value.items():
        if not k < len(group.powers):
            raise InvalidInput(f"Terms: {name} names species {k}; those of {group!r} are 0 to {len(group.powers) - 1}")
        sites = group.powers[k].copies
        _require_many(f"{name} of species {k}", x, sites, repr(group.powers[k]))
        rows = x.values if isinstance(x, Each) else np.array(x, dtype=float)[None]
        parts[k] = np.broadcast_to(rows, (sites, *rows.shape[1:]))
    shapes = {part.shape[1:] for part in parts.values()}
    if len(shapes) > 1:
        raise InvalidInput(f"Terms: {name} is of one shape for all species; got {sorted(shapes)}")
    none = shapes.pop() if shapes else ()
    blank = [np.zeros((sites, *none)) for sites in group.counts]
    return each(np.concatenate([parts.get(k, x) for k, x in enumerate(blank)]))


def numbers_of(terms: Terms, name: str, group: PowerGroup | SpeciesGroup) -> tuple[int, ...]:
    """The sites that are held, or pinned, among all.  name : which."""
    numbers = []
    for entry in getattr(terms, name):
        by_species = isinstance(entry, tuple)
        if by_species != isinstance(group, SpeciesGroup):
            cure = f"{name}={{0: [0, 5]}}" if not by_species else f"{name}=[0, 5]"
            raise InvalidInput(f"Terms: {name} is told of the sites of {group!r} as {cure}")
        k, i = entry if by_species else (0, entry)
        counts = group.counts if isinstance(group, SpeciesGroup) else [group.copies]
        firsts = group.firsts if isinstance(group, SpeciesGroup) else (0,)
        if not (0 <= k < len(counts) and 0 <= i < counts[k]):
            whose = f" of species {k}" if by_species else ""
            last = f"; they are 0 to {counts[k] - 1}" if 0 <= k < len(counts) else ""
            raise InvalidInput(f"Terms: {name} names site {i}{whose}, which is not there{last}")
        numbers.append(firsts[k] + i)
    return tuple(sorted(numbers))


def _bound(over: Over, group: PowerGroup | SpeciesGroup) -> BoundTerm:
    name, term = type(over.term).__name__, timed(over.term)
    graph: Any
    if isinstance(group, SpeciesGroup):
        if not over.of:
            first = "" if isinstance(over.graph, EachSite) else f"{over.graph!r}, "
            raise InvalidInput(
                f"{name}: say of which species its sites are, {name}(...).over({first}of=0), or of=(0, "
                f"1) for edges between two; {group!r} has {len(group.powers)}"
            )
        graph = Among.on_species(name, over.graph, over.of, group)
        bases = [group.powers[k].base for k in over.of]
    else:
        if over.of:
            raise InvalidInput(
                f"{name}.over: of={over.of} names species, and the sites of {group!r} are of one; write "
                "SO3() ** 100 * SE3() ** 8 for two"
            )
        graph, bases = over.graph.on(group.copies), [group.base] * over.graph.arity
    if is_near(graph):
        places = [place(base, small(np.asarray(base.identity()))) for base in bases]
        for base, at in zip(bases, places):
            if len(at) != len(places[0]) or (graph.box is not None and len(graph.box) != len(at)):
                dimension = len(places[0]) if graph.box is None else len(graph.box)
                raise InvalidInput(
                    f"{graph!r}: {'the box has' if graph.box is not None else 'there are'} {dimension} "
                    f"lengths, and {base!r} moves in a space of {len(at)} dimensions"
                )
        if _each_of(over.term):
            raise InvalidInput(
                f"{name}: pairs within a cutoff come and go: a parameter of theirs is "
                "one for all; give sites their own, Terms(..., name=each(values))"
            )
        within: Any = graph.graph if isinstance(graph, Among) else graph
        near = near_pairs(term, bases[0], bases[1], within.cutoff, within.inner, within.box)
        return BoundTerm(near, graph)
    return BoundTerm(term, graph)


def _each_of(value: Any) -> list[Any]:
    return records_in(value, Each)
