"""Why a step of many sites could not be made, at which site, and the error of the run that it ends."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from ....compiler import kernel
from ....errors import NoConvergence, NotFinite, is_mistake
from ....formulas.sites import FEW, TooManySites, one_site
from ....simulation.compiled.control import ANEW, EPSILON, MARK, STEP, STUCK, TIME, to_try
from ....simulation.compiled.driver import advance
from ....simulation.result import of_run
from ....simulation.runs.course import Course, told
from ....simulation.runs.tolerance import too_small
from ....systems.in_time.inputs import during
from .driver import ROW, OverSites, one_rate, one_remake, one_step

AROUND = 20
"""Sites on both sides of one that failed, among which that is looked for of which it failed."""


class RunWithReasons(Course):
    """A run of many sites with the reasons of its failures, from steps of single sites in plain Python; abstract."""

    names_place = False  # does the error of a step say at which site, or joint, it failed?

    @property
    def _everyone(self: Any) -> OverSites:
        """The method of one site as that of all."""
        return OverSites(self.shape.method, self.sites, self.shape.memory, self.march)

    def _fail(self: Any) -> None:
        """A step that could not be made: plain Python says why, of the site that native code has noted.
        It ends a run of fixed steps; adaptive ones become shorter.
        """
        clock, goal = self.clocks[:, 0], self.goals[:, 0]
        steps, t, here = self.taken, float(clock[TIME]), self._copy
        failures = [e for e in self.failures if e is not None]
        at = f"step {steps + 1} of {self.first + self.steps}, t = {t:g}"
        site = self.site
        if self.shape.ending is not None:
            site = during(site, t, self.h, self.shape.ending.beyond)
        arguments: Any = self._everyone, site, t, self.h, here, 1 - here
        if not self.adaptive:
            error = self._why(failures, self.notes, lambda i: one_site(self.count, i, one_step, *arguments))
            error = self._origin(error, t)
            if self.overflowed is not None and isinstance(error, NoConvergence) and not hasattr(error, "site"):
                error.site = self.overflowed  # type: ignore[attr-defined]
            raise self._ended(error, at)
        if clock[MARK] == STUCK and clock[ANEW] == 0.0:
            error = failures[-1] if failures else None
            raise (self._ended(error, f"step {steps + 1}, t = {t:g}") if is_mistake(error) else self._too_small(error))
        h = 0.0 if clock[ANEW] else to_try(t, clock.item(STEP), goal.item(0), goal.item(3))[0]
        again: Any = *arguments[:3], h, here
        error = self._why(failures, self.notes, lambda i: one_site(self.count, i, one_remake, *again))
        if h == 0.0 or is_mistake(error):
            where = f"step {steps + 1}, t = {t:g}" if steps else f"at the start, t = {t:g}"
            raise self._ended(error, where)
        clock[MARK], self.failures = 0.0, [error]

        def failing(*given: Any) -> Any:
            raise error

        method = self.shape.method
        stub: Any = SimpleNamespace(error_order=method.error_order, shortens=method.shortens, trial=failing)
        columns = [x.reshape(-1) for x in (self.goals, self.place, self.clocks, self.out)]
        driver, procedure = advance, self.shape.procedure  # type: Any, Any
        driver(stub, self.site, procedure.control, procedure.place, ROW, 1, 1, *columns, self.failures)
        if clock[MARK] == STUCK or self._hopeless:
            raise self._too_small(error)

    @property
    def _hopeless(self: Any) -> bool:
        """Did steps fail that were no longer than rounding of the whole time?"""
        return bool(abs(self.clocks[STEP, 0]) <= EPSILON * abs(self.t_end - self.t_start))

    def _why(self: Any, failures: list[Any], first: int, again: Any) -> Any:
        """The error that the formula of a site raises.  first : of those among which it is; -1 if all have
        failed together, or nobody knows.
        """
        if failures:
            return failures[-1]
        near = range(max(0, first), min(self.count, max(0, first) + kernel.lanes()))
        for i in near if first >= 0 or self.count <= FEW else ():
            try:
                again(i)
            except TooManySites:
                first = -1
                break
            except Exception as error:
                return error
        if first < 0:
            return NoConvergence(
                f"{self.plan.method!r}: what all sites have in common failed, such as an iteration that "
                f"does not settle. The step h = {self.h:g} may be too large; try {0.25 * self.h:g}"
            )
        return None

    def _origin(self: Any, error: Any, t: float) -> Any:
        """The error of the first site whose own velocity is not finite before the step that failed: in
        the stages of a step that goes over to its neighbours.
        """
        if self.names_place or not isinstance(error, (NotFinite, NoConvergence)):
            return error
        near = getattr(error, "site", None)
        some = range(self.count)
        if self.count > FEW:
            some = range(0) if near is None else some[max(0, near - AROUND) : near + AROUND]
        arguments: Any = self._everyone, self.site, t, self._copy
        for i in some:
            try:
                one_site(self.count, i, one_rate, *arguments)
            except TooManySites:
                break
            except Exception as error_of_site:
                return error_of_site
        return error

    def _too_small(self: Any, error: Any) -> Any:
        """The error of a run whose steps became too small."""
        clock, goal = self.clocks[:, 0].tolist(), self.goals[:, 0].tolist()
        estimate = self.march.item(0)
        site = getattr(error, "site", None)
        what = repr(self.plan.method) if site is None else f"{self.plan.method!r}: site {site}"
        failure_of_step = too_small(what, clock[TIME], clock[STEP], goal[1], goal[2], self.taken, error, estimate)
        return self._with_run(failure_of_step, site)

    def _ended(self: Any, error: Any, at: str) -> Any:
        """The error of a run whose step failed, with what there is of it."""
        site = getattr(error, "site", None)
        system = self.plan._one
        named = getattr(getattr(system, "configurations", system.group), "named", str)
        beside = getattr(error, "beside", None)
        if site is not None:
            which = f"site {named(site)}" if beside is None else f"sites {named(site)} and {named(beside)}"
            at = f"{which}, {at}"
        return self._with_run(told(error, self.plan.method, at, lambda: self.samples.made), site)

    def _with_run(self: Any, error: Any, site: int | None) -> Any:
        """An error with the run up to it."""
        error.site = site
        if self.samples.made:
            error.trajectory = of_run(self)
        return error
