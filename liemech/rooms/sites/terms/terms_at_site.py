"""The site form of sums of terms: the energies, velocities and forces of one site among others.

Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 4.4, 7.7 and 15.2; Marsden and West,
Acta Numerica 10 (2001), section 3.1 (loads); Griewank and Walther, Evaluating Derivatives, 2nd ed., section 3.2 (slopes).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ....formulas import Element, Record, Vec, dot, gradient, mat, record, vec, vectors, where
from ....formulas.classes.fields import OfEach
from ....formulas.classes.of_each import Each
from ....formulas.classes.records import records_in, with_fields, with_records
from ....formulas.classes.signatures import bare
from ....formulas.numbers.conversions import as_others_see
from ....formulas.sites import SiteArray, SiteTable, meet, own
from ....formulas.sums import halves
from ....groups.composed.one_of import filled
from ....groups.lie_group import LieGroup
from ....systems.hamiltonian import Hamiltonian
from ....systems.many.energies import WithHeldSites
from ....systems.potential import Force, Potential
from ..graphs import Incidence, Lattice, Within
from .among import Among, Species, is_all_pairs, is_near
from .bound_terms import BoundTerm, term_of_edge
from .point_terms import acts_through_points
from .terms import Term, site_class


@record
class ValuesOfSites(Record, OfEach):
    """A number, a vector or a matrix for each site, of which a formula of a site asks its own;
    abstract.
    """

    array: SiteArray
    shape: tuple[int, ...] = ()

    @classmethod
    def of_each(cls, each: Each) -> Any:
        """The values of a parameter of which there is one for each site."""
        values = each.values.reshape(len(each), -1)
        return cls(SiteArray.of(values if each.shape else values[:, 0]), each.shape)

    @property
    def values(self) -> np.ndarray:
        """The values of all sites, (n, ...), the last one perhaps more than once."""
        rows = np.asarray(self.array.entries.array).reshape(self.array.dim or 1, -1)
        return rows.T.reshape(-1, *self.shape)

    def here(self) -> Any:
        """The value of this site."""
        return in_shape(own(self.array), self.shape)


@record
class EachOfSites(ValuesOfSites):
    """Values of a parameter in the energy of one body; `at_this_site` exchanges it for the value of the site."""


@record
class OwnOfSites(ValuesOfSites):
    """Values of a parameter of the sites, which a site publishes."""


@record
class EachOfEdges(Record, OfEach):
    """A number, a vector or a matrix for each edge of each site."""

    array: SiteArray
    shape: tuple[int, ...] = ()

    def of(self, d: int) -> Any:
        """The value of edge d of this site."""
        return in_shape(own(self.array, d), self.shape)

    def __repr__(self) -> str:
        return "each(values)"


def in_shape(numbers: Any, shape: tuple[int, ...]) -> Any:
    """The matrix of this shape whose entries, row by row, are these numbers; numbers of other shapes unchanged."""
    if len(shape) < 2:
        return numbers
    n = shape[1]
    return mat(*[numbers[n * k : n * (k + 1)] for k in range(shape[0])])


def at_this_site(value: Any, sites: Any = None, memory: Any = None) -> Any:
    """A record, such as a system, in which the energies of single sites have the parameters of this site; of bodies held
    together by joints the equation of one of them, who are in `sites`, with the layout of what a method carries along.
    """
    if getattr(value, "jointed", False):
        return value.at_place(sites, memory)
    return with_records(value, EachOfSites, [x.here() for x in records_in(value, EachOfSites)])


@record
class RoleAtSite(Record):
    """A term at a site that is argument number `role` of its energy: a part of the site form."""

    term: Term  # with `EachOfEdges` for parameters of edges
    role: int
    merged: bool
    alone: bool
    # by other argument of the energy, the sites that are this argument; empty if a site is tied to all others
    others: tuple[SiteTable, ...] = ()
    counts: SiteArray | None = None  # the number of edges of each site; None: as many as the tables have rows
    near: Within | Among | None = None  # the graph of pairs within a cutoff, of which a run may make lists
    of: tuple[int, ...] = ()  # the species of the ends; (): there is one only
    # if a site is tied to all sites of a species: the number of the first of these, and the number after the last
    reach: Vec | None = None
    once: bool = False  # along a chain, does the first site of an edge compute the forces on both of them?
    chains: Any = None  # of a site that is known, its edges, `BoundTerm.chains`

    @classmethod
    def made(cls, part: BoundTerm, role: int) -> RoleAtSite:
        """The role at a site of a term on a graph."""
        alone = part.graph.arity == 1
        graph: Any = part.graph
        if part.in_rounds:
            return cls(part.term, role, True, False, near=graph.open() if is_near(graph) else None)
        several = part.merged or len({*part.of}) > 1
        if part.of and is_all_pairs(graph) and several and not records_in(part.term, Each):
            near, reach = graph.open() if is_near(graph) else None, graph.range_of(1 - role)
            return cls(part.term, role, part.merged, False, near=near, of=part.of, reach=reach)
        once = in_a_row(part)
        fixed = once or isinstance(part.graph, Lattice)
        at_site = cls.of_incidence(part, role, part.incidence(role), alone, fixed)
        return with_fields(at_site, once=once)

    @classmethod
    def of_incidence(
        cls, part: BoundTerm, role: int, incidence: Incidence, alone: bool = False, fixed: bool = True
    ) -> RoleAtSite:
        """The role of a term with these edges at each site.  fixed : is their number known to formulas?"""
        edges = incidence.edges

        def of_edges(each: Each) -> EachOfEdges:
            values = each.values.reshape(len(each), -1)[edges]
            return EachOfEdges(SiteArray.of(values if each.shape else values[..., 0], edges=True), each.shape)

        term = with_records(part.term, Each, [of_edges(parameter) for parameter in records_in(part.term, Each)])
        at_site = cls(term, role, part.merged, alone, of=part.of)
        return at_site if alone else at_site.with_tables(incidence, fixed)

    def with_tables(self, incidence: Incidence, fixed: bool = False) -> RoleAtSite:
        """This energy with other neighbours.  fixed : is their number known to formulas?"""
        counts = incidence.counts
        tables = tuple([SiteTable.of(table, fixed=fixed) for table in incidence.others])
        all_alike = fixed and bool((counts == len(incidence.edges)).all())
        degrees = None if all_alike else SiteArray.of(counts.astype(float))
        return with_fields(self, others=tables, counts=degrees)

    def plus_edges(self, total: Any, me: Any, meeting: Any, seen: Any, formula: Any, of_both: Any, mine: Any) -> Any:
        """`total`, a number or a vector, plus the values of formula(role, term, sites) for all edges at this site.

        of_both : (term, sites) to the values for both sites of a pair; None: the formula at both ends.  meeting : the
        other sites; all sites where edges are written out.  seen : from what a site publishes to the Site that terms
        see.  mine : the number of this site, if it is in the reach.
        """
        if self.chains is not None:
            return self._along_chains(total, meeting, formula)
        if self.alone:
            return total + formula(self, self.at_edge(0), [me])
        if len(self.others) == 0:
            if self.reach is not None:
                return meeting.some(
                    lambda b, j: formula(self, self.term, self.ends(me, [seen(b)])), total, self.reach, mine
                )
            of_pair = self.at_both_ends(formula) if of_both is None else of_both
            return meeting.pairs(lambda a, b: of_pair(self.term, [seen(a), seen(b)]), total)

        def of_edge(b: Any, d: Any) -> Any:
            mates = [seen(b), *[seen(meeting.of(table, d)) for table in self.others[1:]]]
            return formula(self, self.at_edge(d), self.ends(me, mates))

        return self.over_edges(total, meeting, of_edge)

    def over_edges(self, total: Any, meeting: Any, of_edge: Any) -> Any:
        """total + sum_d of_edge(b_d, d) over the edges d of this site; b_d is what their first other end publishes."""

        def value_there(b: Any, d: Any) -> Any:
            value = of_edge(b, d)
            return value if self.counts is None else masked(d < own(self.counts), value)

        table = self.others[0]
        if table.degree is None:
            return meeting.sum(table, value_there, total)
        for d in range(table.degree):
            total = total + value_there(meeting.of(table, d), d)
        return total

    def at_both_ends(self, formula: Any) -> Any:
        """The values of a formula(role, term, sites) for the first and for the second of two sites."""
        second = with_fields(self, role=1)
        return lambda term, sites: (formula(self, term, sites), formula(second, term, sites))

    def _along_chains(self, total: Any, sites: Any, formula: Any) -> Any:
        """`plus_edges` for edges that are written out."""
        for chains in self.chains:
            sums = [total, *[total - total for _ in chains[1:]]]
            for k, chain in enumerate(chains):
                for role, number, ends in chain:
                    at_role = self if role == self.role else with_fields(self, role=role)
                    sums[k] = sums[k] + formula(at_role, self.at_edge(number), [sites[j] for j in ends])
            total = halves(sums)
        return total

    @property
    def through_points(self) -> bool:
        """Whether sites act on each other through their points."""
        return self.chains is None and acts_through_points(self.term) and self.of == () and not self.once

    def through(self, group: Any, g: Any) -> Vec:
        """The force on this site, with what sites publish of their points."""
        term: Any = self.term
        points = term.points(g)
        meeting = meet(points)
        zero = vec(*[0.0 for point in points for _ in point])

        def of_edge(b: Any, d: Any) -> Any:
            at_edge: Any = self.at_edge(d)
            return at_edge.pushes(points, b)[0] if self.role == 0 else at_edge.pushes(b, points)[1]

        if len(self.others) == 0:
            return term.felt(group, g, meeting.pairs(term.pushes, zero))
        return term.felt(group, g, self.over_edges(zero, meeting, of_edge))

    def if_there(self, value: Any) -> Any:
        """A value of the first edge of this site; zero if it has none."""
        return value if self.counts is None else masked(own(self.counts) > 0.5, value)

    def at_edge(self, d: Any) -> Term:
        """The term with the parameters of edge d of this site."""
        return term_of_edge(self.term, d)

    def ends(self, me: Any, mates: list[Any]) -> list[Any]:
        """The sites of an edge in the order in which the energy takes them."""
        return [*mates[: self.role], me, *mates[self.role :]]


def in_a_row(part: BoundTerm) -> bool:
    """Whether every site is the first end of at most one edge and the second of at most one, as along a chain, and the
    term has a formula for the forces on both ends.
    """
    if part.merged or part.of or part.graph.arity != 2 or part.first or is_near(part.graph):
        return False
    writes_both = bare(type(part.term).forces) is not bare(Term.forces)
    return writes_both and all(len(part.incidence(role).edges) == 1 for role in (0, 1))


def masked(here: Any, value: Any) -> Any:
    """A number or a vector; zero where the truth value `here` is false."""
    if isinstance(value, vectors.Vec):
        return vec(*[where(here, x, 0.0) for x in value])
    return where(here, value, 0.0)


@record
class TermsOfSite(WithHeldSites):
    """The terms at one site; the other sites publish what they need; abstract."""

    roles: tuple[RoleAtSite, ...]
    names: tuple[str, ...] = ()  # of the parameters of the site
    own: tuple[Any, ...] = ()  # the values of these parameters
    # 1 for a site that moves, 0 for one that is held, or these for each component; None: all move
    moves: SiteArray | None = None
    species: Species | None = None  # of the sites, if there are several
    present: Any = None  # where all sites are known: this site, and all

    def __repr__(self) -> str:
        return f"Terms({', '.join([repr(role.term) for role in self.roles if role.role == 0])})"

    @cached_property
    def site(self) -> Any:
        """A site without momentum, element and velocity."""
        return site_class(self.names)()

    @property
    def coupled(self) -> bool:
        """Whether there is a term of several sites."""
        return not all([role.alone for role in self.roles])  # noqa: C419

    def site_and_others(self, mu: Any, g: Any = None, xi: Any = None, roles: Any = None) -> tuple[Any, Any, Any]:
        """This site, the meeting with the others (None if it is alone; all sites where they are known), and the
        function from what a site publishes there to the Site that terms see.  roles : of the terms that count; None for
        all.
        """
        if self.present is not None:
            return *self.present, None
        own_values = [x.here() if isinstance(x, OwnOfSites) else x for x in self.own]
        me = type(self.site)(mu, g, self._felt(xi), *own_values)
        alone = all(role.alone for role in (self.roles if roles is None else roles))
        varied = [x if isinstance(y, OwnOfSites) else None for x, y in zip(own_values, self.own)]
        published = as_others_see(type(self.site)(mu, g, xi, *varied))  # on the way back rules ask, and nobody else
        meeting = None if alone else meet(published)

        def view(published: Any) -> Any:
            values = [
                getattr(published, name) if isinstance(x, OwnOfSites) else x for name, x in zip(self.names, self.own)
            ]
            return type(self.site)(published.mu, published.g, published.xi, *values)

        return me, meeting, view

    def _felt(self, xi: Any) -> Any:
        """The velocity at which the forces on this site are taken.  Those on a site that is held do not count: they are
        taken in motion, for |xi| has no derivative at rest.
        """
        if xi is None or self.moves is None:
            return xi
        moves: Any = own(self.moves)
        return vec(*[where((moves if self.moves.dim is None else moves[0]) > 0.5, x, 1.0) for x in xi])

    def plus_terms(
        self, total: Any, mu: Any, g: Any, xi: Any, formula: Any, of_both: Any = None, roles: Any = None
    ) -> Any:
        """`total`, a number or a vector, plus the values of formula(role, term, sites) for the edges at this site, role
        by role.  of_both : (term, sites) to the values for both sites of a pair, if they share work.  roles : of the
        terms that count; None for all.
        """
        me, meeting, view = self.site_and_others(mu, g, xi, roles)
        species = self.species
        for role in self.roles if roles is None else roles:
            if species is None or own(species.which) == role.of[role.role]:
                number = own(species.numbers) if role.merged and species is not None else None
                total = role.plus_edges(total, me, meeting, view, self._formula(role, total, formula), of_both, number)
        return total

    def _formula(self, role: RoleAtSite, total: Any, formula: Any) -> Any:
        """A formula(role, term, sites) for terms that see sites of their species."""
        species = self.species
        if species is None:
            return formula

        def of_species(one: Any, term: Any, sites: list[Any]) -> Any:
            at_edge = formula(one, term, [species.seen(k, x) for k, x in zip(role.of, sites)])
            return filled(at_edge, len(total)) if isinstance(total, vectors.Vec) else at_edge

        return of_species

    def group_of(self, role: RoleAtSite, group: LieGroup) -> LieGroup:
        """The group of the site that stands in a role."""
        return group if self.species is None else self.species.groups[role.of[role.role]]

    def share(self, mu: Any, g: Any) -> float:
        """The share of this site in the energy; the sum over all sites is the energy.  An edge counts for the first of
        its ends; an edge whose ends are alike counts half for each.
        """

        def part(role: RoleAtSite, term: Any, sites: list[Any]) -> float:
            energy = term.energy(*sites)
            return 0.5 * energy if role.merged else energy

        def halves(term: Any, sites: list[Any]) -> tuple[float, float]:
            energy = 0.5 * term.energy(*sites)
            return energy, energy

        first = [role for role in self.roles if role.role == 0]
        return self.plus_terms(0.0, mu, g, None, part, halves, first)

    def moving(self, x: Vec) -> Vec:
        """A velocity or a force; zero at sites that are held."""
        if self.moves is None:
            return x
        moves: Any = own(self.moves)
        if self.moves.dim is None:
            return vec(*[where(moves > 0.5, c, 0.0) for c in x])
        return vec(*[where(m > 0.5, c, 0.0) for m, c in zip(moves, x)])


@record
class HamiltonianOfSite(TermsOfSite, Hamiltonian):  # type: ignore[override]
    """The Hamiltonian of a site among others, a function of its momentum and of theirs."""

    __repr__ = TermsOfSite.__repr__

    def energy(self, mu: Vec) -> float:
        """The share of this site.  mu : (dim,), its momentum."""
        return self.share(mu, None)

    def gradient(self, mu: Vec) -> Vec:
        """The velocity of this site.  mu : (dim,), its momentum."""
        return self.moving(self._free(mu))

    def _free(self, mu: Vec) -> Vec:
        def of_edge(role: RoleAtSite, term: Any, sites: list[Any]) -> Vec:
            return term.slope(role.role, *sites)

        def of_both(term: Any, sites: list[Any]) -> tuple[Vec, Vec]:
            return term.slopes(*sites)

        return self.plus_terms(vec(*[0.0 for _ in mu]), mu, None, None, of_edge, of_both)


@record
class PotentialOfSite(TermsOfSite, Potential):
    """The potential of a site among others, a function of its element and of theirs."""

    __repr__ = TermsOfSite.__repr__

    def energy(self, g: Element) -> float:
        return self.share(None, g)

    def force(self, group: LieGroup, g: Element) -> Vec:
        return self.moving(self._free(group, g))

    def _free(self, group: LieGroup, g: Element) -> Vec:
        return self._forces(group, g, None)

    def force_of(self, group: LieGroup, g: Element, k: int) -> Vec:
        """The force of term number k alone."""
        roles: list[RoleAtSite] = []
        number = -1
        for role in self.roles:
            number = number + (1 if role.role == 0 else 0)
            if number == k:
                roles = [*roles, role]
        return self.moving(self._forces(group, g, roles))

    def _forces(self, group: LieGroup, g: Element, roles: Any) -> Vec:
        def of_edge(role: RoleAtSite, term: Any, sites: list[Any]) -> Vec:
            return term.force(self.group_of(role, group), role.role, *sites)

        def of_both(term: Any, sites: list[Any]) -> tuple[Vec, Vec]:
            return term.forces(group, *sites)

        force = vec(*[0.0 for _ in range(group.dim)])
        chosen = self.roles if roles is None else roles
        through = [role for role in chosen if role.through_points]
        for role in through:
            force = force + role.through(group, g)
        edge_by_edge = [role for role in chosen if not role.once and not role.through_points]
        if len(edge_by_edge) > 0:
            force = self.plus_terms(force, None, g, None, of_edge, of_both, edge_by_edge)
        along_chains = [role for role in chosen if role.once]
        if len(along_chains) > 0:
            force = force + self._along(group, g, along_chains)
        return force

    def _along(self, group: LieGroup, g: Element, roles: Any) -> Vec:
        """The forces of terms along chains: each site finds those on itself and on the next, and hands
        the latter on.
        """
        me, meeting, view = self.site_and_others(None, g, None, roles)
        force = vec(*[0.0 for _ in range(group.dim)])
        pushes: list[Any] = []
        for role in roles:
            if role.role == 0:
                first, second = role.at_edge(0).forces(group, me, view(meeting.of(role.others[0], 0)))
                force, pushes = force + role.if_there(first), [*pushes, second]
        handed = meet(tuple(pushes))
        numbers = [role for role in roles if role.role == 1]
        for k, role in enumerate(numbers):
            force = force + role.if_there(handed.of(role.others[0], 0)[k])
        return force


@record
class EnergyOfSite(TermsOfSite):
    """The energy of a site among others, a function of its momentum and its element and of theirs."""

    def energy(self, mu: Vec, g: Element) -> float:
        """The share of this site.  mu : (dim,), its momentum, g : its element."""
        return self.share(mu, g)

    def rates(self, group: LieGroup, mu: Vec, g: Element) -> tuple[Vec, Vec]:
        """The velocity of this site and the force on it.  mu : (dim,), its momentum, g : its element."""
        n = len(mu)

        def of_edge(role: RoleAtSite, term: Any, sites: list[Any]) -> Vec:
            slope, force = term.slope(role.role, *sites), term.force(self.group_of(role, group), role.role, *sites)
            return vec(*filled(slope, n), *filled(force, n))

        def of_both(term: Any, sites: list[Any]) -> tuple[Vec, Vec]:
            (slope, last_slope), (force, last_force) = term.slopes(*sites), term.forces(group, *sites)
            return vec(*slope, *force), vec(*last_slope, *last_force)

        rates = self.plus_terms(vec(*[0.0 for _ in range(2 * n)]), mu, g, None, of_edge, of_both)
        return self.moving(rates[:n]), self.moving(rates[n:])


@record
class ForceOfSite(TermsOfSite, Force):  # type: ignore[override]
    """The load on a site among others, a function of where it is and how it moves, and of theirs.

    backwards : `SlopesOfLoad`, of a run that is gone through backwards.
    """

    backwards: Any = None

    __repr__ = TermsOfSite.__repr__

    def _slopes(self, group: LieGroup, t: float, xi: Vec, g: Any, along: Vec) -> tuple[Vec, Vec]:
        """The derivatives of the sum over all sites of <along, F> by the velocity and the element of this one."""
        return self.backwards.slopes(group, t, xi, g, along)

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        """The force on this site.  xi : (dim,), its velocity, g : its element."""
        zero = vec(*[0.0 for _ in xi])
        return self.moving(
            self.plus_terms(zero, None, g, xi, lambda one, term, sites: term.covector(t, *_from(one.role, sites)))
        )

    def resistance(self, t: float, xi: Vec, g: Any, along: Vec) -> Vec:
        """The damping of this site by its own velocity, where the others keep theirs, (dim,).  xi, along : (dim,), g : its
        element.
        """

        def of_edge(role: RoleAtSite, term: Any, sites: list[Any]) -> Vec:
            first = sites[role.role]
            return term.resistance(t, vec(*along[: len(first.xi)]), *_from(role.role, sites))

        return self.moving(self.plus_terms(vec(*[0.0 for _ in xi]), None, g, xi, of_edge))


def _from(k: int, sites: list[Any]) -> list[Any]:
    """The sites of an edge, number k first."""
    return [sites[k], *sites[:k], *sites[k + 1 :]]


@record
class SlopesOfLoad(TermsOfSite):
    """The derivatives of the sum over all sites of <lambda, F> by the velocity and the element of one, for
    the load F and any lambda of each site.
    """

    def slopes(self, group: LieGroup, t: float, xi: Vec, g: Any, along: Vec) -> tuple[Vec, Vec]:
        """d/dxi and d/deta with dg = g hat(eta), (dim,) each.  along : lambda of this site."""
        n, zero = group.dim, vec(*[0.0 for _ in range(2 * group.dim)])
        slope = self.plus_terms(zero, along, g, xi, lambda one, term, sites: _slope(group, t, one, term, sites))
        return vec(*slope[:n]), vec(*slope[n:])


def _slope(group: LieGroup, t: float, role: RoleAtSite, term: Term, sites: list[Any]) -> Vec:
    """The derivatives of <lambda, F> on one edge by the site in a role; `mu` of a site holds its lambda."""
    n, k = group.dim, role.role

    def power(y: Vec) -> float:
        g = group.compose_exp(sites[k].g, vec(*y[n:]))
        moved_site = with_fields(sites[k], xi=sites[k].xi + vec(*y[:n]), g=g)
        ends = [moved_site if j == k else s for j, s in enumerate(sites)]
        of_first = dot(ends[0].mu, term.covector(t, *ends))
        return of_first + dot(ends[1].mu, term.covector(t, *ends[::-1])) if role.merged else of_first

    return gradient(power, vec(*[0.0 for _ in range(2 * n)]))
