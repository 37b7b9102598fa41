"""Runs of chains and rings of sites whose steps are solved for together."""

from __future__ import annotations

from types import NoneType
from typing import Any

import numpy as np

from ....compiler.sites.planes import Planes, columns
from ....errors import NoConvergence, OutsideChart
from ....formulas.classes.layouts import vector
from ....formulas.classes.records import with_fields
from ....formulas.sites import SiteArray, SiteTable
from ....formulas.tables import Table
from ....groups.retractions import Exponential
from ....integrators.composition import Composition
from ....integrators.ending_at_jumps import EndingAtJumps, cuts
from ....integrators.galerkin import GalerkinVariational
from ....integrators.method import steps_as
from ....systems.mechanical import MechanicalSystem
from ..galerkin_of_chain import GalerkinOfChain, order_along, work_of
from ..terms.sums_of_terms import PlaceTerms
from ..terms.terms_at_site import ForceOfSite, PotentialOfSite, RoleAtSite
from .run import SiteRun

MOST = 6
"""Components of the velocity of a site, at most."""


def chained_method(plan: Any) -> GalerkinOfChain | None:
    """The method of a plan as that of a chain or a ring of sites; None if there is none, or if the
    sites are tied otherwise.
    """
    system, site = plan._one, plan._one.site_form
    if not isinstance(site, MechanicalSystem) or plan.adaptive or plan.fictive:
        return None
    if not isinstance(site.potential, PotentialOfSite) or site.potential.species is not None:
        return None
    method = plan._steps.way_of(0)
    if isinstance(method, EndingAtJumps):
        if cuts(method, system):
            return None
        method = method.method
    rows, base = [(1.0, 0.0)], method
    if steps_as(method, Composition):
        base, rows = method.base, [*zip(method.tableau.gamma, method.tableau.nodes)]
    if not steps_as(base, GalerkinVariational) or base.order != 2:
        return None
    load: Any = site.load
    if isinstance(load, ForceOfSite) and not all(role.alone for role in load.roles):
        return None
    n, dim = system.potential.group.copies, site.configurations.dim
    bonds = bonds_along(system.potential, n)
    if bonds is None or dim > MOST or not isinstance(base.retraction, Exponential):
        return None
    first = np.zeros(n)
    for part in bonds:
        first[part.graph.edges[:, 0]] = 1.0
    if n < 3 and first[-1]:
        return None  # two bonds between two sites
    edges = [RoleAtSite.of_incidence(with_fields(part, merged=False), 0, part.graph.incidence(0)) for part in bonds]
    alone = [role for role in site.potential.roles if role.alone]
    return GalerkinOfChain(
        repr(method),
        tuple(edges),
        tuple(alone),
        SiteTable.of(np.roll(np.arange(n), 1)[None]),
        SiteArray.of(np.roll(first, 1)),
        float(n),
        order_along(n, bool(first[-1])),
        work_of(dim),
        Table(np.ravel(rows)),
        float(len(rows)),
        len(rows),
    )


def bonds_along(potential: PlaceTerms, n: int) -> list[Any] | None:
    """The terms of two sites, if all of them tie a site to the next one, the last one perhaps to the
    first; else None.
    """
    bonds = []
    for part in potential.parts:
        if part.graph.arity == 1:
            continue
        if part.graph.arity != 2 or part.in_rounds or not hasattr(part.graph, "edges"):
            return None
        ends = part.graph.edges
        if len(ends) > n or not (ends[:, 1] == (ends[:, 0] + 1) % n).all():
            return None
        bonds.append(part)
    return bonds or None


class ChainRun(SiteRun):
    """One run of a chain of sites."""

    names_place = True

    def _room_for(self, width: int) -> Planes:
        """Two copies of what the method carries along, and what a step works with.  Elimination goes
        from site to site, so that one thread makes a step.
        """
        self.workers = 1
        method = self.shape.method
        planes = Planes.of_rows(2 * width + method.room, self.count)
        squares = columns(planes, copies=vector(2 * width), work=method.work).work.fields.squares
        self.squares = planes.array[squares.rows[0]]
        return planes

    def _why(self, failures: list[Any], first: int, again: Any) -> Any:
        failure = failures[-1] if failures else None
        if not isinstance(failure, (NoConvergence, OutsideChart, NoneType)):
            return failure
        error = NoConvergence(
            f"{self.plan.method!r}: Newton's method found no displacements that fit momenta and forces. "
            f"The step h = {self.h:g} is too long there; try {0.25 * self.h:g}"
        )
        squares = np.nan_to_num(self.squares[: self.count], nan=np.inf)
        error.site = getattr(failure, "site", int(squares.argmax()))  # type: ignore[attr-defined]
        return error
