"""Gradients of runs of many sites, and products of cotangents with their derivatives, as a user asks for
them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ....errors import IncompatibleSystem
from ....formulas.classes.of_each import Each
from ....simulation.compiled.parameters import full_name, parameter
from ...sites.runs.states import first_of
from ..frames import Frames, StatesInFrames
from ..losses import Asked, Objective, arguments_of
from ..varied_input import Tables
from .adaptive import steps_of, with_samples
from .adjoint import BackwardRun
from .parameters import terms_of_sites


def gradient_by_sites(
    plan: Any, what: str, start: Any, steps: Any, t_end: Any, t0: float, names: tuple[str, ...], asked: Asked
) -> tuple[float | None, dict[str, np.ndarray], Any, float | None]:
    """A loss, its derivatives by "start" and by parameters of terms, the run, and |J^T w|/|w| where w is felt
    at the end alone; or of a cotangent.

    asked : loss and cost are sums over the sites of functions of one, `lambda site: ...`, of linkages functions of the state
    of all bodies; the cotangent is (N,) in the
    components of tangent maps, or by the parts of the state, {"mu": (sites, dim), "g": (sites, n, n)}; with an axis
    of samples in front where there is an `every`.  Raises InvalidInput for other shapes.
    """
    if start.bodies is not None:
        raise IncompatibleSystem(f"Plan.{what}: many sites go member by member: give one start at a time")
    state, ends = plan._sites.started(plan, start, t0), None
    length = {"steps": steps, "t_end": t_end, "t0": t0}
    adaptive = plan if plan.adaptive else None
    if plan.adaptive:
        plan, ends, _ = steps_of(plan._sites, state, steps, t_end, t0)
        steps, t0 = len(ends) - 1, 0.0
    else:
        steps = plan._count(steps, t_end, t0)
    between = asked.every or max(1, steps)
    shown = with_samples(plan, between)
    others, sites = tuple(n for n in names if n != "start"), shown._sites
    as_one = sites.site.jointed
    try:
        back: Any = BackwardRun(sites.on_the_way_back(bool(others)), state, steps, t0, others)
    except IncompatibleSystem:
        if others:
            raise
        back = None
    for name, function in (("loss", asked.loss), ("along", asked.along)):
        if function is not None and not (as_one or of_site(function)):
            raise IncompatibleSystem(
                f"Plan.{what}: the {name} of many sites is the sum of a function of one, {name}=lambda site: "
                "..., or lambda t, site: ...; of all together plan.pullback takes the derivative"
            )
    run = sites.kind(shown, sites.site, state, t0, steps, None, None, None).trajectory()
    numbers = np.minimum(np.arange(len(run.t)) * between, steps).tolist()
    if ends is not None:
        run = replace(run, t=ends[numbers])
    first, count = first_of(state), sites.count_of(state)

    def by_site(parts: dict[str, Any]) -> dict[str, Any]:
        return {name: x[:, :count] for name, x in plan._one.by_site(parts).items()}

    states = StatesInFrames(Frames(sites.site, first), by_site(run.states))
    several = asked.every is not None and (asked.along is not None or asked.cotangent is not None)
    samples = np.ones(len(numbers), dtype=bool) if several else None
    objective = Objective(run, states, first, samples, by_site, as_one)
    objective.find(asked, plan.options.compiled)
    rows = states.frames.in_a_row(objective.by_states[objective.samples])
    cotangents = {numbers[k]: row for k, row in zip(objective.samples.tolist(), rows)}
    if back is None:
        by = {"start": _by_directions(plan, adaptive, start, length, cotangents)}
    else:
        by_start, by = back.back(cotangents)
        by["start"] = by_start
    sizes = [float(np.linalg.norm(w)) for w in cotangents.values()]
    growth = float(np.linalg.norm(by["start"])) / sizes[0] if len(sizes) == 1 and sizes[0] else None
    return objective.value, {name: by[name] for name in names}, run, growth


def _by_directions(
    plan: Any, adaptive: Any, start: Any, length: dict[str, Any], cotangents: dict[int, Any]
) -> np.ndarray:
    """The sum of J^T w, for which every direction of the start makes a run.

    plan : of fixed steps.  adaptive : the plan whose run they repeat, if there is one; length : of that run.
    """
    if adaptive is not None and len(cotangents) > 1:
        raise IncompatibleSystem(
            f"Plan.gradient: of adaptive steps of {plan.method!r} the derivative is that of the end alone"
        )
    by_start: Any = 0.0
    for n, w in cotangents.items():
        shown = plan.replace(every=max(1, n)) if adaptive is None else adaptive
        until = {"steps": n, "t0": length["t0"]} if adaptive is None else length
        by_start = by_start + shown.tangent(start, **until, against=w).tangent["against"][-1]
    return np.asarray(by_start)


def goes_by_sites(plan: Any, start: Any, names: tuple[str, ...], *functions: Any) -> bool:
    """Is a gradient found site by site: of many sites, of functions of one, by a parameter of edges?"""
    sites = plan._sites
    if sites is None or not sites.knows(start) or plan.fictive:
        return False
    if sites.site.jointed:
        return sites.has_way_back(start) and differentiable(plan, names)
    if sites.takes(start) or any(map(of_site, functions)):
        return True
    of_system = [name for name in names if name not in ("start", "h") and "method." not in name]
    if any(terms_of_sites(plan._one, name) for name in of_system):
        return True
    full = [full_name(plan._one, name, "Plan.gradient") for name in of_system]
    return any(isinstance(parameter(plan._one, name), Each) for name in full)


def differentiable(plan: Any, names: tuple[str, ...]) -> bool:
    """Are names those of the start and of numbers of a linkage, and not of its tables, its method, its step?"""
    of_system = all(name != "h" and not name.startswith("method.") for name in names)
    return of_system and not (plan.events or Tables(plan._one, names, "Plan.gradient").by_name)


def of_site(function: Any) -> bool:
    """Is it a function of a site, or of time and a site, by the name of its last argument?"""
    names = arguments_of(function)
    return len(names) in (1, 2) and names[-1] == "site"
