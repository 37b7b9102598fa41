"""Runs of linkages of any size: steps of all bodies and joints together, in memory."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiler.planes import Planes
from ..errors import NoConvergence
from ..formulas.tables import Table
from ..integrators.composition import Composition
from ..integrators.ending_at_jumps import EndingAtJumps, cuts
from ..integrators.lie_rattle import LieRATTLE, near_a_dead_point
from ..integrators.rattle_of_links import Links, RattleOfLinks
from .sites_run import SiteRun
from .sites_states import as_users_see, state_of_rows

FEW = 600
"""Conditions among which those are found that depend on each other, where a step has failed."""


def linked_method(plan: Any) -> RattleOfLinks | None:
    """The method of a plan as that of many bodies and joints; None if there is none, the system has no
    such form, or the run asks for more than states at the ends of equal steps.
    """
    system, site = plan._one, plan._one.site_form
    if not isinstance(site, Links) or plan.adaptive or plan.fictive or plan.events:
        return None
    if plan.recorder is not None and plan.recorder.quantities:
        return None
    method = plan._steps.way_of(0)
    ending = None
    if isinstance(method, EndingAtJumps):
        ending = method if cuts(method, system) else None
        method = method.method
    shares: Any = [(1.0, 0.0)]
    base = method
    if isinstance(method, Composition):
        base, shares = method.base, zip(method.tableau.gamma, method.tableau.nodes)
    if not isinstance(base, LieRATTLE):
        return None
    rows = [(share, node) for share, node in shares]
    table = Table(np.ravel(rows))
    return RattleOfLinks(
        base.retraction, table, float(len(rows)), len(rows), site.most, repr(method), ending
    )


class LinksRun(SiteRun):
    """One run of a linkage of many bodies."""

    def _room_for(self, width: int) -> Planes:
        """Two copies of what the method carries along, and what a step works with."""
        form = self.plan._one.linked
        made = Planes.of_rows(2 * width + len(form.fixed) + form.more, self.count)
        self.work = made.array[2 * width :]
        self.work[: len(form.fixed), : self.count] = form.fixed
        return made

    def _why(self, failures: list[Any], first: int, again: Any) -> Any:
        """The reason for which a step failed, and at which joint."""
        if failures and not isinstance(failures[-1], NoConvergence):
            return failures[-1]
        rows, system = self.site.rows, self.plan._one
        joint, reached, _ = self.work[rows.note : rows.note + 3, 0].tolist()
        self.work[rows.note] = 0.0
        method = repr(self.plan.method)
        if joint < 0.0:
            return NoConvergence(
                f"{method}: no velocity found that fits the loads at the end of a step; try "
                f"h = {0.25 * self.h:g}"
            )
        label = system.label(system.linked.order[int(joint)])
        why = f"The step h = {self.h:g} is too long there; try {0.25 * self.h:g}"
        if system.linked.has_loops and system.conditions <= FEW:
            rows = self.shape.shown_rows(self._memory)
            state = as_users_see(system, state_of_rows(self.shape.state, rows))
            why = near_a_dead_point(system, state.g) or why
        return NoConvergence(
            f"{method}: the solution that grows out of h = 0 ends at h = {reached * self.h:.3g}, at "
            f"{label}. {why}"
        )

    def _origin(self, error: Any, t: float) -> Any:
        """The error itself, which knows the joint."""
        return error
