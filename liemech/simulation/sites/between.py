"""The motion of many sites between the steps that a run has kept."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...systems.system import state_of
from ..between.dense import one_or_many, within_run


class SitesBetween:
    """The motion of the sites of a run: from the last end of a step a shorter one of the method, as for
    `t_eval`.

    run : one that has kept the ends of all steps.  kind : of its states.  planner : `Plan`, which says so
    itself, as it stands above the runs that it makes.
    """

    planner: ClassVar[Any] = None

    def __init__(self, run: Any, kind: Any) -> None:
        self.run, self.kind = run, kind
        self.plans: dict[float, Any] = {}

    def plan(self, h: float) -> Any:
        """The plan of a step of this length."""
        if h not in self.plans:
            run = self.run
            if self.planner is None:
                raise InvalidInput(
                    "Trajectory.at: states between the steps of many sites are made by a plan; import "
                    "liemech.Plan first"
                )
            own = {"h": h, "breaks": run.breaks, "progress": False}
            self.plans = {h: self.planner(run.system, run.method, **own)}
        return self.plans[h]

    def _inside(self, k: int, times: np.ndarray) -> dict[str, np.ndarray]:
        """The states at some rising times in step k."""
        run, begun = self.run, float(self.run.t[k])
        fixed = run.rejected is None
        plan = self.plan(run.h if fixed else float(run.t[k + 1]) - begun)
        start = self.kind(**{name: x[k] for name, x in run.states.items()})
        seen = plan.run(start, steps=1, t0=begun, t_eval=times)
        return dict(seen.states)

    def __call__(self, times: Any) -> Any:
        """The state at one time, or at many, (m,), whose arrays then have a leading axis.  Raises InvalidInput
        for times outside the run.
        """
        run, given = self.run, one_or_many(times)
        at, t = within_run(np.atleast_1d(given).astype(float), run.t), run.t
        sign = 1.0 if t[-1] >= t[0] else -1.0
        step = np.searchsorted(sign * t, sign * at, "right") - 1
        found = {name: x[step] for name, x in run.states.items()}  # a copy
        between = at != t[step]
        for k in np.unique(step[between]):
            some = np.flatnonzero(between & (step == k))
            inner, back = np.unique(sign * at[some], return_inverse=True)
            for name, x in self._inside(int(k), sign * inner).items():
                found[name][some] = x[back]
        one: Any = 0 if given.ndim == 0 else slice(None)
        return state_of(self.kind, {name: x[one] for name, x in found.items()})
