"""Which runs go by sites: those of systems whose energies are sums over graphs, with fixed steps of a
method of one site.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ..compiler.planes import Planes
from ..errors import IncompatibleSystem, IntegrationFailure, NotCompilable
from ..formulas.pytree import layout_of
from ..integrators.sublattices import SublatticeSplitting, TermSplitting
from ..systems.site_state import StateOfSites
from ..systems.system import State
from .sites_carry import SiteCarry
from .sites_lists import with_lists
from .sites_states import by_site, first_of
from .trajectory import Trajectory

LARGE = 300
"""Numbers of momenta beyond which a system is not written out."""


class SitesOfPlan:
    """The runs by sites of one plan."""

    def __init__(self, plan: Any, site: Any) -> None:
        self.plan, self.site = plan, site
        self.known: dict[Any, Any] = {}

    @classmethod
    def of(cls, plan: Any) -> SitesOfPlan | None:
        """None if the system has no site form."""
        site = plan._one.site_form
        return None if site is None else cls(plan, with_lists(plan._one, site))

    def prepared(self, start: StateOfSites, starts: Planes) -> Any:
        """Layouts and native code for starts like this one."""
        from .sites_run import Prepared

        key = layout_of(first_of(start))
        if key not in self.known:
            self.known[key] = Prepared(self.plan, self.site, start, starts)
        return self.known[key]

    # ---------------------------------------------------------------- which runs

    @functools.cached_property
    def as_one_body(self) -> bool:
        """Does the method accept all sites as one body?"""
        try:
            self.plan.method.require(self.plan._one)
        except IncompatibleSystem:
            return False
        return True

    def missing(self, **asked: Any) -> str | None:
        """What is asked for that runs by sites do not have yet; None if nothing is."""
        plan = self.plan
        if plan.adaptive:
            return "adaptive steps (give h and steps)"
        if plan.fictive:
            return "steps in fictive time"
        if plan.events:
            return "events"
        if plan.of_each:
            return f"{next(iter(plan.of_each))} of each member"
        if plan._steps.breaks:
            return "breaks"
        method = plan._steps.way_of(0)
        if isinstance(method, TermSplitting) and not isinstance(method, SublatticeSplitting):
            return repr(method)
        return next((name for name, value in asked.items() if value is not None), None)

    def knows(self, start: Any) -> bool:
        """Is it a state of many sites, or one that has them in a row?"""
        if isinstance(start, StateOfSites) or not isinstance(start, State):
            return isinstance(start, StateOfSites)
        given = start.arrays
        return self.plan._one.by_site(given) is not given

    def takes(self, start: Any) -> bool:
        """Does a run from here go by sites?"""
        if isinstance(start, SiteCarry):
            return True
        if not self.knows(start):
            return False
        numbers = by_site(self.plan._one, start).width // (start.bodies or 1)
        return numbers > self.plan._one.small or not self.as_one_body

    def trajectory(
        self, start: Any, steps: int | None, t_end: Any, t0: float, kept: Any, **asked: Any
    ) -> Trajectory | None:
        """The run; None if the system is to be written out instead.  Raises IncompatibleSystem for
        one that is too large for that.
        """
        from .sites_run import SiteRun
        from .turns_of_sites import TurnsRun

        fresh = not isinstance(start, SiteCarry)
        if fresh and not self.knows(start):
            return None
        state = by_site(self.plan._one, start if fresh else start.state)
        numbers = state.width // (state.bodies or 1)
        if not self.takes(start):
            return None
        why: Any = self.missing(**asked)
        if why is None and state.bodies is not None and kept is not None:
            why = "checkpoint of members"
        if why is None and state.bodies is not None:
            return self._members(state, steps, t_end, t0)
        if why is None:
            before, zero = (start.step, start.t0) if isinstance(start, SiteCarry) else (0, t0)
            count = self.plan._count(steps, t_end, zero, before)
            by_colour = isinstance(self.plan._steps.way_of(0), SublatticeSplitting)
            kind = TurnsRun if by_colour else SiteRun
            try:
                return kind(self.plan, self.site, start, count, t0, kept).trajectory()
            except NotCompilable as error:
                why = f"{self.plan.method!r} for sites one by one ({error})"
        if numbers <= LARGE and self.as_one_body and not isinstance(start, SiteCarry):
            return None
        raise IncompatibleSystem(
            f"integrate: there is no {why}, for systems of many sites, here {state.sites}: RKMK and "
            f"KickDrift with h and steps take any number; up to {LARGE} numbers are written out as one "
            "body, which takes everything"
        )

    def _members(self, start: Any, steps: Any, t_end: Any, t0: float) -> Trajectory | None:
        """The runs of the members of an ensemble, one after the other."""
        runs: list[Any] = []
        for i in range(start.bodies):
            one = type(start)(*(None if x is None else x[i] for x in start.parts.values()))
            try:
                runs.append(self.trajectory(one, steps, t_end, t0, None))
            except IntegrationFailure as error:
                error.add_note(f"[integrate: member {i}]")
                raise
            if runs[-1] is None:
                return None
        first = runs[0]
        return Trajectory(
            system=first.system,
            method=first.method,
            h=first.h,
            t=first.t,
            states={
                name: np.stack([r.states[name] for r in runs], axis=1) for name in first.states
            },
            bodies=len(runs),
            steps=first.steps,
            compiled=all(r.compiled for r in runs),
            observed=first.observed,
        )
