"""Parts of an energy of many spins whose motions are known: sublattices in the field of the others,
bonds, and energies of single sites.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...formulas import Record, Vec, plain, record, vec
from ...formulas.classes.fields import frozen_array
from ...formulas.classes.records import records_in, with_fields, with_records
from ...formulas.numbers.ways import APART
from ...formulas.sites import SiteArray, SiteTable, own, padded, rows_of
from ...formulas.tables import Table
from ...groups.lie_group import LieGroup
from ...systems.lie_poisson import BodyState
from ...systems.system import as_precise
from .colouring import PlacesByColour
from .graphs import AllPairs, Edges, Incidence
from .terms.bound_terms import BoundTerm, term_of_edge
from .terms.sums_of_terms import MomentumTerms
from .terms.terms import AtTime, at_time
from .terms.terms_at_site import RoleAtSite, TermsOfSite, at_this_site, masked

_UNSTEADY = "the velocity that it gives changes as the site moves"


@record
class BondsOfSite(TermsOfSite):
    """The bonds of one term at a site, by their colours.

    roles : the term with the site as the first of its ends, and, where these are not alike, as the
    second; the tables have a row for each colour.  there : (colours, sites) for each of the roles,
    1 where the site has such a bond.

    Source: Steinigeweg and Schmidt, Comput. Phys. Commun. 174 (2006).
    """

    there: tuple[SiteArray, ...] = ()

    @classmethod
    def of_term(cls, part: BoundTerm, colours: np.ndarray, names: Any, parameters: Any) -> BondsOfSite:
        """The bonds of a term whose edges have these colours, from 0."""
        roles, existing = [], []
        for role in part.roles:
            others, numbers, counts = part.incidence(role)
            shape = int(colours.max(initial=-1)) + 1, others.shape[-1]
            mates, edges = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
            exists = np.zeros(shape)
            d, site = np.nonzero(np.arange(len(numbers))[:, None] < counts)
            edge = numbers[d, site]
            mates[colours[edge], site], edges[colours[edge], site] = others[0, d, site], edge
            exists[colours[edge], site] = 1.0
            incidence = Incidence(mates[None], edges, np.full(shape[1], shape[0]))
            roles.append(RoleAtSite.of_incidence(part, role, incidence, fixed=False))
            existing.append(SiteArray.of(exists, edges=True))
        return cls(tuple(roles), names, parameters, there=tuple(existing))

    def turns(self, colour: int, mu: Vec, time: float) -> tuple[Vec, Vec]:
        """The velocities that the bond of a colour gives the other end and this site, times a time;
        zero where there is none.  mu : (dim,), the momentum of this site.
        """
        me, meeting, view = self.site_and_others(mu)
        turn_of_others = own_turn = 0.0 * mu
        for role, existing in zip(self.roles, self.there):
            mate, term = view(meeting.of(role.others[0], colour)), role.at_edge(colour)
            ends, exists = role.ends(me, [mate]), own(existing, colour) > 0.5
            own_turn = own_turn + masked(exists, time * term.slope(role.role, *ends))
            turn_of_others = turn_of_others + masked(exists, time * term.slope(1 - role.role, *ends))
        return turn_of_others, own_turn


def turned(group: LieGroup, state: BodyState, *omegas: Vec) -> BodyState:
    """The state (Ad*_exp(omega) mu, g exp(...) exp(omega)) after displacements, the last of which, omega, moves the
    momentum.
    """
    precise, g = [as_precise(omega, state.mu) for omega in omegas], state.g
    moved = group.algebra.exp_Ad_star(precise[-1], state.mu)
    if g is not None:
        for omega in precise:
            g = group.compose_exp(g, omega)
    return BodyState(moved, g)


def turned_by(energy: Any, group: LieGroup, colour: int, t: float, time: float, state: BodyState) -> BodyState:
    """The state of a site after a time, turned by its bond of a colour, or by its own energy.

    energy : `BondsOfSite`, or the Hamiltonian of a single site, at time t if it changes.
    """
    energy, mu = at_time(energy, t), plain(state.mu)
    if isinstance(energy, BondsOfSite):
        turn_of_others, own_turn = energy.turns(colour, mu, time)
        return turned(group, state, -turn_of_others, own_turn + turn_of_others)
    return turned(group, state, time * at_this_site(energy).gradient(mu))


@record
class MotionsOfTerms(Record):
    """A decomposition of an energy of many sites into parts whose motions are known; abstract.

    terms : the energy.  A subclass writes `count`, `refused`, `lonely` and `moved`, and for runs by
    sites `places` and `of_site`.
    """

    terms: MomentumTerms

    @property
    def count(self) -> int:
        """The number of parts; a subclass defines it."""
        raise NotImplementedError

    @property
    def refused(self) -> str:
        """The reason why the motion of a term is not known; empty if all are known."""
        raise NotImplementedError

    def moved(self, part: int, h: float, bodies: list[Any]) -> list[Any]:
        """The states of the sites after a part has moved them for a time."""
        raise NotImplementedError

    @property
    def timed(self) -> bool:
        """Whether there are terms that change with time."""
        return bool(records_in(self.terms, AtTime))

    def in_turn(self, state: BodyState, turns: Any) -> BodyState:
        """The state after the motions `turns`, each the number of a part, a time step and the time at which terms are
        taken.
        """
        group, n, g = self.terms.group, self.terms.group.base.dim, state.g
        bodies: list[Any] = [
            BodyState(state.mu[n * i : n * (i + 1)], None if g is None else group.site(g, i))
            for i in range(group.copies)
        ]
        for part, h, t in turns:
            bodies = at_time(self, t).moved(part, h, bodies)
        mu = vec(*[x for body in bodies for x in body.mu])
        return BodyState(mu, None if g is None else group.join(*[body.g for body in bodies]))

    # ---------------------------------------------------------------- single sites

    @property
    def lonely(self) -> tuple[BoundTerm, ...]:
        """The terms of one site that are parts of their own."""
        raise NotImplementedError

    def _sites(self, bodies: list[Any]) -> list[Any]:
        return [self.terms.site_with(i, plain(body.mu), None) for i, body in enumerate(bodies)]

    def _along(self, terms: Any, some: Any, h: float, bodies: list[Any]) -> list[Any]:
        """The states of the sites after the sites in `some` have moved, for a time, along the constant velocities of
        terms.
        """
        base, sites = self.terms.group.base, self._sites(bodies)
        moved = [*bodies]
        for i in [i for i in some if i not in self.terms.held]:
            form = self.terms.at_site(i, sites, terms)
            moved[i] = turned(base, bodies[i], h * form.gradient(sites[i].mu))
        return moved


# ------------------------------------------------------------------ sublattices


@record
class Sublattices(MotionsOfTerms):
    """Sites by colours, such that no term has two of one colour: the sites of a colour move in the
    field of the others, which rest.

    Terms are affine in the momentum of each site, so that the field is one.  Terms of one site that
    are not make parts of their own, if they leave the velocity as it is that they give.

    Source: Frank, Huang and Leimkuhler, J. Comput. Phys. 133 (1997).
    """

    @property
    def refused(self) -> str:
        """The first term that is not affine and has no known motion, in words; empty if there is none."""
        for part in self.terms.parts:
            if part.kind.affine or (part.graph.arity == 1 and part.kind.steady):
                continue
            if part.graph.arity > 1:
                return f"{part!r} is not affine in the momentum of each of its sites"
            return f"{part!r} is not affine in the momentum of its site, and {_UNSTEADY}"
        return ""

    @property
    def affine(self) -> tuple[BoundTerm, ...]:
        """Terms that are affine in the momentum of each site."""
        return tuple([part for part in self.terms.parts if part.kind.affine])

    @property
    def lonely(self) -> tuple[BoundTerm, ...]:
        return tuple([part for part in self.terms.parts if not part.kind.affine])

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """The sites of each colour."""
        return self.terms.affine.groups

    @property
    def count(self) -> int:
        return self.terms.affine.count + len(self.lonely)

    @property
    def places(self) -> PlacesByColour:
        """The places of sites in memory, sorted by colour."""
        return PlacesByColour.of_colouring(self.terms.affine.colouring)

    def of_site(self, places: PlacesByColour) -> tuple[tuple[Any, ...], list[tuple[int, ...]]]:
        """The site forms of the energies that turn a site, with sites at their places: of all affine terms, and of each
        other term; and by part, the number of its form and the range of its places.
        """
        parts = [tuple(map(by_edges, self.affine)), *[(part,) for part in self.lonely]]
        forms = [at_places(with_fields(self.terms, parts=terms).of_site(), places) for terms in parts]
        alone = [(k + 1, 0, len(places.sites)) for k in range(len(self.lonely))]
        return tuple(forms), [*[(0, *ends) for ends in places.ranges if self.affine], *alone]

    def moved(self, part: int, h: float, bodies: list[Any]) -> list[Any]:
        """The states after the sites of a colour have turned about the field of the others, or all sites by a term of
        their own.
        """
        if part < len(self.groups):
            return self._along(self.affine, self.groups[part], h, bodies)
        term = self.lonely[part - len(self.groups)]
        return self._along((term,), range(len(bodies)), h, bodies)


def by_edges(part: BoundTerm) -> BoundTerm:
    """A term over all pairs as a term over a list of edges, for loops in which some sites rest."""
    graph = part.graph
    if not isinstance(graph, AllPairs):
        return part
    edges = Edges(frozen_array(graph.edges, repr(graph)), graph.count or 0, False)
    return with_fields(part, graph=edges)


def at_places(form: Any, places: PlacesByColour) -> Any:
    """The site form of an energy where every site stands at its place."""
    count = len(places.places)

    def moved(rows: np.ndarray) -> np.ndarray:
        return rows.reshape(-1, padded(count))[:, places.sites]

    def array(x: SiteArray) -> SiteArray:
        rows = rows_of(moved(x.entries.array))
        return with_fields(x, entries=Table(rows.ravel()), places=float(rows.shape[1]))

    tables = [SiteTable.of(places.places[moved(table.numbers)]) for table in records_in(form, SiteTable)]
    arrays = [array(x) for x in records_in(form, SiteArray)]
    return with_records(with_records(form, SiteTable, tables), SiteArray, arrays)


# ------------------------------------------------------------------ bonds


@record
class Bonds(MotionsOfTerms):
    """Bonds by colours, such that no two of one colour share a site: f(a . b) turns both of its
    sites about their sum, and leaves a . b and with it the velocity as it is.

        a' = ad*_(c b) a = ad*_(c (a + b)) a,  b' = ad*_(c (a + b)) b,  c = f'(a . b),
        g_a -> g_a exp(-h c a) exp(h c (a + b))

    The coordinates are such that [a, b] = -ad*_a b, as on SO(3).  Terms of one site make parts of
    their own, if they leave the velocity as it is that they give.

    Source: Steinigeweg and Schmidt, Comput. Phys. Commun. 174 (2006).
    """

    @property
    def refused(self) -> str:
        """The first term that has no known motion as a bond or as a term of one site, in words; empty if there is none."""
        base = self.terms.group.base
        c = np.array(base.algebra.structure_constants)
        if self.terms.held:
            return f"site {self.terms.held[0]} is held, and its bonds do not turn about a sum"
        odd = [c + np.swapaxes(c, i, j) for i, j in ((0, 1), (1, 2))]
        if not np.abs(odd).max() <= APART * np.abs(c).max():
            return f"{base!r} has no coordinates in which the sum of two momenta turns both"
        for part in self.terms.parts:
            if part.graph.arity > 1 and not part.kind.isotropic:
                return f"{part!r} is no function of the product of two momenta, dot(a.mu, b.mu)"
            if part.graph.arity == 1 and not part.kind.steady:
                return f"{part!r} is one of a single site, and {_UNSTEADY}"
        return ""

    @property
    def lonely(self) -> tuple[BoundTerm, ...]:
        """The terms of one site, each a part."""
        return tuple([part for part in self.terms.parts if part.graph.arity == 1])

    @property
    def groups(self) -> tuple[tuple[tuple[int, int, int, int], ...], ...]:
        """The bonds of each colour: the term, the edge, and its two sites."""
        return self.terms.pairs.bonds

    @property
    def count(self) -> int:
        return sum(self.terms.pairs.counts) + len(self.lonely)

    @property
    def places(self) -> PlacesByColour:
        """The places of sites in memory, such that the ends of neighbouring bonds lie side by side."""
        return PlacesByColour.of_colouring(self.terms.pairs.colouring)

    def of_site(self, places: PlacesByColour) -> tuple[tuple[Any, ...], list[tuple[int, ...]]]:
        """The site forms of all terms, bonds first; and by part, the number of its form and its colour."""
        forms: list[Any] = []
        numbers: list[tuple[int, ...]] = []
        whole: Any = self.terms.of_site()
        bonds, pairs = self.terms.pairs, [x for x in self.terms.parts if x.graph.arity == 2]
        for part, colours, count in zip(pairs, bonds.of_bonds, bonds.counts):
            numbers += [(len(forms), k, 0) for k in range(count)]
            forms.append(BondsOfSite.of_term(part, colours, whole.names, whole.own))
        for part in self.lonely:
            numbers.append((len(forms), 0, 0))
            forms.append(with_fields(self.terms, parts=(part,)).of_site())
        return tuple([at_places(form, places) for form in forms]), numbers

    def moved(self, part: int, h: float, bodies: list[Any]) -> list[Any]:
        """The states after the bonds of a colour have turned their sites about the sums a + b, or all sites by a term
        of their own.
        """
        if part >= len(self.groups):
            term = self.lonely[part - len(self.groups)]
            return self._along((term,), range(len(bodies)), h, bodies)
        base, sites = self.terms.group.base, self._sites(bodies)
        pairs = [term for term in self.terms.parts if term.graph.arity == 2]
        moved = [*bodies]
        for k, edge, i, j in self.groups[part]:
            bond = term_of_edge(pairs[k].term, edge)
            of_i, of_j = [h * bond.slope(end, sites[i], sites[j]) for end in (0, 1)]
            moved[i] = turned(base, bodies[i], -of_j, of_i + of_j)
            moved[j] = turned(base, bodies[j], -of_i, of_i + of_j)
        return moved
