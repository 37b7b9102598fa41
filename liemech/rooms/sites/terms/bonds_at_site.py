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
    def of(cls, part: BoundTerm, colours: np.ndarray, names: Any, parameters: Any) -> BondsOfSite:
        """Those of a term whose edges have these colours, from 0."""
        roles, there = [], []
        for role in part.roles:
            others, numbers, counts = part.incidence(role)
            shape = int(colours.max(initial=-1)) + 1, others.shape[-1]
            mates, edges = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
            here = np.zeros(shape)
            d, site = np.nonzero(np.arange(len(numbers))[:, None] < counts)
            edge = numbers[d, site]
            mates[colours[edge], site], edges[colours[edge], site] = others[0, d, site], edge
            here[colours[edge], site] = 1.0
            incidence = Incidence(mates[None], edges, np.full(shape[1], shape[0]))
            roles.append(RoleAtSite.of_incidence(part, role, incidence, fixed=False))
            there.append(SiteArray.of(here, edges=True))
        return cls(tuple(roles), names, parameters, None, None, tuple(there))

    def turns(self, colour: int, mu: Vec, time: float) -> tuple[Vec, Vec]:
        """The velocities that the bond of a colour gives the other end and this site, times a time;
        zero where there is none.  mu : (dim,), the momentum of this site.
        """
        me, meeting, seen = self.met(mu)
        theirs = mine = 0.0 * mu
        for one, there in zip(self.roles, self.there):
            mate, term = seen(meeting.of(one.others[0], colour)), one.at_edge(colour)
            ends, here = one.ends(me, [mate]), own(there, colour) > 0.5
            mine = mine + masked(here, time * term.slope(one.role, *ends))
            theirs = theirs + masked(here, time * term.slope(1 - one.role, *ends))
        return theirs, mine
