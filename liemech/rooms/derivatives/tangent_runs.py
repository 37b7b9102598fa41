"""`Plan.tangent`: runs with their tangent maps, of one body, of the members of an ensemble, of many sites."""

from __future__ import annotations

from typing import Any

from ...errors import InvalidInput
from ...groups.composed.species import SpeciesGroup
from ...simulation import arguments
from ...simulation.trajectory import TangentTrajectory
from ...systems.many.site_state import SiteValues
from ...systems.system import member
from ..sites.runs.plan import LARGE
from .frames import LEVEL
from .of_sites.tangent import tangent_by_sites
from .tangent import multiplied, of_bodies, of_one
from .through_events import tangent_with_events


def tangent_of(plan: Any, start: Any, steps: Any, t_end: Any, t0: Any, by: Any, **products: Any) -> TangentTrajectory:
    """The run of `Plan.tangent`, made body by body.  Raises InvalidInput for arguments that do not go together."""
    if plan.recorder is not None:
        raise InvalidInput("Plan.tangent is of the state; make a plan that records no functions of it")
    t0 = arguments.real(t0, "t0")
    names = arguments.parameters(by, "Plan.tangent")
    named = [name for name, x in products.items() if x is not None]
    if len(named) > 1 or (named and names != ("start",)):
        raise InvalidInput(f'Plan.tangent: give one of along and against, and by="start"; got by={by!r}')
    product = (named[0], products[named[0]]) if named else None
    if plan._sites is not None and plan._sites.takes(start):
        if plan.events:
            raise InvalidInput("Plan.tangent of many sites looks for no events; make a plan without them")
        by_sites = plan._sites.started(plan, start, t0)
        run_by_sites = _of_sites(plan._sites, by_sites, steps, t_end, t0, names, product)
        if run_by_sites is not None:
            return run_by_sites
    start = plan._started(start, t0)
    with plan._beginning(start, t0):
        of_body: Any = tangent_with_events if plan.events else of_one
        if start.bodies is None:
            run = of_body(plan, start, steps, t_end, t0, names)
        else:
            ends = arguments.ends(t_end, start.bodies)
            runs = [of_body(plan._of_body(i), member(start, i), steps, ends[i], t0, names) for i in range(start.bodies)]
            run = of_bodies(plan.method, runs)
    return run if product is None else multiplied(run, *product)


def _of_sites(sites: Any, start: Any, steps: Any, t_end: Any, t0: float, names: Any, product: Any) -> Any:
    """The run by sites with its tangent map; None if the system is to be written out instead.  Raises
    IncompatibleSystem for one that is too large for that.
    """
    plan, system = sites.plan, sites.plan._one
    if sites.site.jointed:
        if names == ("start",) and sites.has_tangents(start):
            return tangent_by_sites(sites.with_derivatives(LEVEL), start, steps, t_end, t0, product)
        return None
    if start.bodies is not None:
        members = [sites.member(start, i) for i in range(start.bodies)]
        runs = [_of_sites(sites, member, steps, t_end, t0, names, product) for member in members]
        return None if None in runs else of_bodies(plan.method, runs)
    wanted = [f"derivative by {name}" for name in names if name != "start"]
    if sites.chain is not None:
        wanted.append(f"tangent map of {plan.method!r} along a chain")
    group = getattr(system, "configurations", system.group)
    if isinstance(start, SiteValues) or isinstance(group, SpeciesGroup):
        wanted.append(f"tangent map of {type(system).__name__} on {group!r}")
    why = wanted[0] if wanted else sites.missing(None, None, False)
    if why is None:
        return tangent_by_sites(sites, start, steps, t_end, t0, product)
    if start.width <= LARGE and sites.as_one_body:
        return None
    raise sites.too_many(why, start)
