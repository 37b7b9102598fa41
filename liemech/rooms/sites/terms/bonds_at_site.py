"""Bonds as one site has them: one of each colour at the most."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....formulas import Vec, record
from ....formulas.sites import SiteArray, own
from ..graphs import Incidence
from .bound_terms import BoundTerm
from .terms_at_site import RoleAtSite, TermsOfSite, masked


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
