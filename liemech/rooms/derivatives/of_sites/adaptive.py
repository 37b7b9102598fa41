"""Runs of many sites by an error estimate as runs of the fixed steps that were accepted."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....simulation.compiled.control import TIME
from ....simulation.compiled.execution import like
from ...sites.runs.plan import SitesOfPlan
from ...sites.runs.run import SiteRun
from ..tangent import in_steps


class EndsKept(SiteRun):
    """A run that knows when its steps ended."""

    def aim(self, *given: Any) -> Any:
        self.step_ends = [self.t_start]
        return super().aim(*given)

    def _next_pace(self, pace: int, used: float) -> int:
        return 1  # step by step

    def _attend(self) -> None:
        super()._attend()
        t = self.clocks.item(TIME, 0)
        if t != self.step_ends[-1]:
            self.step_ends.append(t)


def steps_of(sites: Any, start: Any, steps: Any, t_end: Any, t0: float) -> tuple[Any, np.ndarray, Any]:
    """The plan of fixed steps that makes those of a run by an error estimate, the ends of the steps, (n + 1,),
    and the run.
    """
    plan = sites.plan
    run = EndsKept(plan, sites.site, start, t0, steps, t_end, None)
    made = run.trajectory()
    ends = np.array(run.step_ends)
    fixed = like(in_steps(plan, ends), adaptive=False)
    return with_samples(fixed, max(1, len(ends) - 1)), ends, made


def with_samples(plan: Any, every: int) -> Any:
    """A plan with samples after so many steps each."""
    if plan._steps.clock != "step":
        return plan.replace(every=every)
    shown = like(plan, options=plan.options._replace(every=every))
    shown._sites = SitesOfPlan(shown, plan._sites.site)
    return shown
