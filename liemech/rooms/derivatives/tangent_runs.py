"""Runs with their tangent maps, as a plan is asked for them: of one body, of the members of an ensemble, of many sites."""

from __future__ import annotations

from typing import Any

from ...errors import InvalidInput
from ...groups.composed.species import SpeciesGroup
from ...simulation import arguments
from ...simulation.trajectory import TangentTrajectory
from ...systems.many.site_state import SiteValues
from ...systems.system import member
from ..sites.runs.plan import LARGE
from .of_sites.tangent import tangent_by_sites
from .tangent import multiplied, of_bodies, of_one


def tangent_of(plan: Any, start: Any, steps: Any, t_end: Any, t0: Any, by: Any, **products: Any) -> TangentTrajectory:
    """The run of `Plan.tangent`: what is asked for is checked, and made body by body."""
    if plan.recorder is not None:
        raise InvalidInput("Plan.tangent is of the state; make a plan that records no functions of it")
    if plan.events:
        raise InvalidInput("Plan.tangent looks for no events; make a plan without them")
    t0 = arguments.real(t0, "t0")
    names = arguments.parameters(by, "Plan.tangent")
    asked = [name for name, x in products.items() if x is not None]
    if len(asked) > 1 or (asked and names != ("start",)):
        raise InvalidInput(f'Plan.tangent: give one of along and against, and by="start"; got by={by!r}')
    given = (asked[0], products[asked[0]]) if asked else None
    if plan._sites is not None and plan._sites.takes(start):
        by_sites = plan._sites.started(plan, start)
        made = _of_sites(plan._sites, by_sites, steps, t_end, t0, names, given)
        if made is not None:
            return made
    start = plan._started(start)
    with plan._beginning(start, t0):
        if start.bodies is None:
            run = of_one(plan, start, steps, t_end, t0, names)
        else:
            ends = arguments.ends(t_end, start.bodies)
            runs = [of_one(plan._of_body(i), member(start, i), steps, ends[i], t0, names) for i in range(start.bodies)]
            run = of_bodies(plan.method, runs)
    return run if given is None else multiplied(run, *given)


def _of_sites(sites: Any, start: Any, steps: Any, t_end: Any, t0: float, names: Any, given: Any) -> Any:
    """The run by sites with its tangent map; None if the system is to be written out instead.  Raises
    IncompatibleSystem for one that is too large for that.
    """
    plan, one = sites.plan, sites.plan._one
    if sites.site.jointed:
        return None
    if start.bodies is not None:
        members = [sites.member(start, i) for i in range(start.bodies)]
        runs = [_of_sites(sites, member, steps, t_end, t0, names, given) for member in members]
        return None if None in runs else of_bodies(plan.method, runs)
    wanted = [f"derivative by {name}" for name in names if name != "start"]
    if sites.chain is not None:
        wanted.append(f"tangent map of {plan.method!r} along a chain")
    group = getattr(one, "configurations", one.group)
    if isinstance(start, SiteValues) or isinstance(group, SpeciesGroup):
        wanted.append(f"tangent map of {type(one).__name__} on {group!r}")
    why = wanted[0] if wanted else sites.missing(None, None, False)
    if why is None:
        return tangent_by_sites(sites, start, steps, t_end, t0, given)
    if start.width <= LARGE and sites.as_one_body:
        return None
    raise sites.too_many(why, start)
