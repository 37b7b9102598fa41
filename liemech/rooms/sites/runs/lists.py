"""Lists of the sites that are near each other, made anew while a run goes on.

A pair beyond the cutoff adds zero to a sum, so that runs have the same bits whichever lists they go
through: it does not matter when these are made, nor where a run was resumed.

Source: Allen and Tildesley, Computer Simulation of Liquids, 2nd ed., section 5.3.1 (Verlet's lists).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ....formulas.classes.records import records_in, with_records
from ..terms.among import Among, places_of_sites
from ..terms.terms_at_site import RoleAtSite

LEAST = 100
"""Up to so many sites all pairs are looked at."""

SKIN = 0.15
"""Lists reach beyond the cutoff by this part of it."""

BEFORE, STEP = 0.25, 0.125
"""Parts of the skin that a site may have moved since the lists were made, and may move in a step:
stages of a step lie within twice its length, so that two sites that were not in the lists are not
nearer than the cutoff.
"""

FULL = 0.5
"""If a ball of this radius fills more than this part of the box, lists spare nothing."""


def with_lists(system: Any, site: Any) -> Any:
    """The site form of a system with lists that are still empty, where they are worth it."""
    roles = records_in(site, RoleAtSite)
    if not any(_worth(system, role) for role in roles):
        return site
    return with_records(site, RoleAtSite, [_listed(role, None) if _worth(system, role) else role for role in roles])


def _worth(system: Any, role: RoleAtSite) -> bool:
    near = role.near
    if near is None:
        return False
    sites = _sites_of(system, near)
    reach = (1.0 + SKIN) * near.cutoff
    if sites <= LEAST:
        return False
    return near.box is None or reach ** len(near.box) * 4.0 < FULL * float(np.prod(near.box))


def _sites_of(system: Any, near: Any) -> int:
    """The sites among which pairs are near."""
    if isinstance(near, Among):
        return int(sum(dict(zip(near.of, near.counts)).values()))
    return getattr(system, "configurations", system.group).copies


def _listed(role: RoleAtSite, places: np.ndarray | None) -> RoleAtSite:
    near: Any = role.near
    return role.with_tables(near.near(places, (1.0 + SKIN) * near.cutoff, role.role))


class Lists:
    """The lists of neighbours of one run.

    site : the site form, with the lists that were made last.  places : of the sites then.
    """

    def __init__(self, system: Any, site: Any) -> None:
        self.group = getattr(system, "configurations", system.group)
        self.site = site
        self.roles = records_in(site, RoleAtSite)
        self.places: Any = None
        self.skin = SKIN * min(role.near.cutoff for role in self.roles if _has_lists(role))

    @classmethod
    def of(cls, system: Any, site: Any) -> Lists | None:
        """The lists of a system; None if it has no neighbours within a distance."""
        return cls(system, site) if any(map(_has_lists, records_in(site, RoleAtSite))) else None

    def at(self, g: np.ndarray) -> Any:
        """The site form with lists for these elements of the sites."""
        places = places_of_sites(self.group, g)
        if self.places is None or self.moved(places, self.places) > BEFORE * self.skin:
            self.places = places
            roles = [_listed(x, places) if _has_lists(x) else x for x in self.roles]
            self.site = with_records(self.site, RoleAtSite, roles)
        return self.site

    def held(self, before: np.ndarray, after: np.ndarray) -> bool:
        """Was a step from these elements to those short enough for the lists?"""
        a, b = (places_of_sites(self.group, g) for g in (before, after))
        return self.moved(a, b) <= STEP * self.skin

    @staticmethod
    def moved(a: np.ndarray, b: np.ndarray) -> float:
        """The longest displacement of a site from places a to places b, (sites, 3)."""
        return float(np.sqrt(((a - b) ** 2).sum(axis=1).max()))


def _has_lists(role: RoleAtSite) -> bool:
    return role.near is not None and len(role.others) > 0
