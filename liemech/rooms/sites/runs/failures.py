"""Why a step of many sites could not be made, at which site, and the error of the run that it ends."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from ....compiler import kernel
from ....errors import NoConvergence, NotFinite, is_mistake
from ....formulas.numbers.sizes import EPSILON
from ....formulas.sites import FEW, TooManySites, one_site
from ....simulation.compiled.control import ANEW, MARK, REJECTED, STEP, STUCK, TIME, to_try
from ....simulation.compiled.driver import advance
from ....simulation.runs.course import told
from ....simulation.runs.tolerance import too_small
from ....systems.in_time.inputs import during
from .driver import ESTIMATE, ROW, OverSites, one_rate, one_remake, one_step

AROUND = 20
"""Sites on both sides of one that failed, among which that is looked for of which it failed."""


def everyone(run: Any) -> OverSites:
    """The method of one site as that of all."""
    return OverSites(run.shape.method, run.sites, run.shape.memory, run.march)


def fail(run: Any) -> None:
    """A step that could not be made: plain Python says why, of the site that native code has noted.
    It ends a run of fixed steps; adaptive ones become shorter.
    """
    clock, goal = run.clocks[:, 0], run.goals[:, 0]
    steps, t, here = run.taken, float(clock[TIME]), run._copy
    failures = [e for e in run.failures if e is not None]
    at = f"step {steps + 1} of {run.first + run.steps}, t = {t:g}"
    site = run.site
    ending = run.shape.procedure.ending
    if ending is not None:
        site = during(site, t, run.h, ending.beyond)
    arguments: Any = everyone(run), site, t, run.h, here, 1 - here
    if not run.adaptive:
        error = run._why(failures, run.notes, lambda i: one_site(run.count, i, one_step, *arguments))
        error = origin_of(run, error, t)
        if run.overflowed is not None and isinstance(error, NoConvergence) and not hasattr(error, "site"):
            error.site = run.overflowed  # type: ignore[attr-defined]
        raise ended(run, error, at)
    where = f"step {steps + 1}, t = {t:g}" if steps else f"at the start, t = {t:g}"
    if clock[MARK] == STUCK and clock[ANEW] == 0.0:
        error = failures[-1] if failures else None
        no_velocity = error is not None and not (steps or clock[REJECTED])
        raise (ended(run, error, where) if no_velocity or is_mistake(error) else too_small_steps(run, error))
    h = 0.0 if clock[ANEW] else to_try(t, clock.item(STEP), goal.item(0), goal.item(3))[0]
    again: Any = *arguments[:3], h, here
    error = run._why(failures, run.notes, lambda i: one_site(run.count, i, one_remake, *again))
    if h == 0.0 or is_mistake(error):
        raise ended(run, error, where)
    clock[MARK], run.failures = 0.0, [error]

    def failing(*given: Any) -> Any:
        raise error

    method = run.shape.method
    stub: Any = SimpleNamespace(error_order=method.error_order, shortens=method.shortens, trial=failing)
    columns = [x.reshape(-1) for x in (run.goals, run.place, run.clocks, run.out)]
    driver, procedure = advance, run.shape.procedure  # type: Any, Any
    driver(stub, run.site, procedure.control, procedure.place, ROW, 1, 1, *columns, run.failures)
    if clock[MARK] == STUCK or hopeless(run):
        raise too_small_steps(run, error)


def hopeless(run: Any) -> bool:
    """Did steps fail that were no longer than rounding of the whole time?"""
    return bool(abs(run.clocks[STEP, 0]) <= EPSILON * abs(run.t_end - run.t_start))


def first_reason(run: Any, failures: list[Any], first: int, again: Any) -> Any:
    """The error that the formula of a site raises.  first : of those among which it is; -1 if all have
    failed together, or nobody knows.
    """
    if failures:
        return failures[-1]
    near = range(max(0, first), min(run.count, max(0, first) + kernel.lanes()))
    for i in near if first >= 0 or run.count <= FEW else ():
        try:
            again(i)
        except TooManySites:
            first = -1
            break
        except Exception as error:
            return error
    if first < 0:
        return NoConvergence(
            f"{run.plan.method!r}: what all sites have in common failed, such as an iteration that "
            f"does not settle. The step h = {run.h:g} may be too large; try {0.25 * run.h:g}"
        )
    return None


def origin_of(run: Any, error: Any, t: float) -> Any:
    """The error of the first site whose own velocity is not finite before the step that failed: in
    the stages of a step that goes over to its neighbours.
    """
    if run.names_place or not isinstance(error, (NotFinite, NoConvergence)):
        return error
    near = getattr(error, "site", None)
    sites = range(run.count)
    if run.count > FEW:
        sites = range(0) if near is None else sites[max(0, near - AROUND) : near + AROUND]
    arguments: Any = everyone(run), run.site, t, run._copy
    for i in sites:
        try:
            one_site(run.count, i, one_rate, *arguments)
        except TooManySites:
            break
        except Exception as error_of_site:
            return error_of_site
    return error


def too_small_steps(run: Any, error: Any) -> Any:
    """The error of a run whose steps became too small."""
    clock, goal = run.clocks[:, 0].tolist(), run.goals[:, 0].tolist()
    estimate = run.march.item(ESTIMATE)
    site = getattr(error, "site", None)
    what = repr(run.plan.method) if site is None else f"{run.plan.method!r}: site {site}"
    failure_of_step: Any = too_small(what, clock[TIME], clock[STEP], goal[1], goal[2], run.taken, error, estimate)
    failure_of_step.site = site
    return failure_of_step


def ended(run: Any, error: Any, at: str) -> Any:
    """The error of a run whose step failed, with what there is of it."""
    site = getattr(error, "site", None)
    system = run.plan._one
    named = getattr(getattr(system, "configurations", system.group), "named", str)
    beside = getattr(error, "beside", None)
    if site is not None:
        which = f"site {named(site)}" if beside is None else f"sites {named(site)} and {named(beside)}"
        at = f"{which}, {at}"
    error = told(error, run.plan.method, at, lambda: run.samples.made)
    error.site = site
    return error
