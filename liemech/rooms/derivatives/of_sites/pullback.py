"""Gradients of runs of many sites, and products of cotangents with their derivatives, as a user asks for
them.
"""

from __future__ import annotations

import inspect
from dataclasses import replace
from typing import Any

import numpy as np

from ....errors import IncompatibleSystem
from ....formulas.classes.of_each import Each
from ....simulation import arguments
from ....simulation.compiled.parameters import full_name, parameter
from ....systems.system import state_of
from ...sites.runs.states import by_site, first_of, kind_of, site_rows
from ..frames import basis_of
from ..losses import Loss
from .adaptive import steps_of, with_samples
from .adjoint import BackwardRun
from .parameters import terms_of_sites
from .tangent import Frames


def gradient_by_sites(
    plan: Any, what: str, start: Any, steps: Any, t_end: Any, t0: float, names: tuple[str, ...],
    every: int | None, loss: Any, along: Any, cotangent: Any,
) -> tuple[float | None, dict[str, np.ndarray], Any, float | None]:  # fmt: skip
    """A loss, its derivatives by "start" and by parameters of terms, the run, and |J^T w|/|w| where w is felt
    at the end alone; or of a cotangent.

    every : between the samples that count; None for the last state only.  loss, along : sums over the
    sites of functions of one, `lambda site: ...`.  cotangent : (N,) in the components of tangent maps, or by
    the parts of the state, {"mu": (sites, dim), "g": (sites, n, n)}; with an axis of samples in front
    where there is an `every`.  Raises InvalidInput for other shapes.
    """
    if start.bodies is not None:
        raise IncompatibleSystem(f"Plan.{what}: many sites go member by member: give one start at a time")
    state, ends = plan._sites.started(plan, start), None
    asked = {"steps": steps, "t_end": t_end, "t0": t0}
    adaptive = plan if plan.adaptive else None
    if plan.adaptive:
        plan, ends, _ = steps_of(plan._sites, state, steps, t_end, t0)
        steps, t0 = len(ends) - 1, 0.0
    else:
        steps = plan._count(steps, t_end, t0)
    between = every or max(1, steps)
    shown = with_samples(plan, between)
    others = tuple(n for n in names if n != "start")
    try:
        back: Any = BackwardRun(shown._sites, state, steps, t0, others)
    except IncompatibleSystem:
        if others:
            raise
        back = None
    for name, given in (("loss", loss), ("along", along)):
        if given is not None and not of_site(given):
            raise IncompatibleSystem(
                f"Plan.{what}: the {name} of many sites is the sum of a function of one, {name}=lambda site: "
                "..., or lambda t, site: ...; of all together plan.pullback takes the derivative"
            )
    sites = shown._sites
    run = sites.kind(shown, sites.site, state, t0, steps, None, None, None).trajectory()
    numbers = np.minimum(np.arange(len(run.t)) * between, steps).tolist()
    if ends is not None:
        run = replace(run, t=ends[numbers])
    value, felt = None, {}
    if cotangent is not None:
        some = len(numbers) if every else 1
        rows = _cotangent(shown, state, run, cotangent, some, every is not None)
        felt = dict(zip(numbers[-some:], rows, strict=True))
    else:
        value, felt[steps] = _of_sites(loss, "loss", shown, run, -1)
        for k, n in enumerate(numbers if along is not None else []):
            more, slope = _of_sites(along, "along", shown, run, k)
            value, felt[n] = value + more, felt.get(n, 0.0) + slope
    if back is None:
        by = {"start": _by_directions(plan, adaptive, start, asked, felt)}
    else:
        found, by = back.back(felt)
        by["start"] = found
    sizes = [float(np.linalg.norm(w)) for w in felt.values()]
    growth = float(np.linalg.norm(by["start"])) / sizes[0] if len(sizes) == 1 and sizes[0] else None
    return value, {name: by[name] for name in names}, run, growth


def _by_directions(plan: Any, adaptive: Any, start: Any, asked: dict[str, Any], felt: dict[int, Any]) -> np.ndarray:
    """The sum of J^T w, for which every direction of the start makes a run.

    plan : of fixed steps.  adaptive : the plan whose run they repeat, if there is one; asked : of that run.
    """
    if adaptive is not None and len(felt) > 1:
        raise IncompatibleSystem(
            f"Plan.gradient: of adaptive steps of {plan.method!r} the derivative is that of the end alone"
        )
    found: Any = 0.0
    for n, w in felt.items():
        known = plan.replace(every=max(1, n)) if adaptive is None else adaptive
        length = {"steps": n, "t0": asked["t0"]} if adaptive is None else asked
        found = found + known.tangent(start, **length, against=w).tangent["against"][-1]
    return np.asarray(found)


def goes_by_sites(plan: Any, start: Any, names: tuple[str, ...], *functions: Any) -> bool:
    """Is a gradient found site by site: of many sites, of functions of one, by a parameter of edges?"""
    sites = plan._sites
    if sites is None or not sites.knows(start) or sites.site.jointed or plan.fictive:
        return False
    if sites.takes(start) or any(map(of_site, functions)):
        return True
    known = [name for name in names if name not in ("start", "h") and "method." not in name]
    if any(terms_of_sites(plan._one, name) for name in known):
        return True
    full = [full_name(plan._one, name, "Plan.gradient") for name in known]
    return any(isinstance(parameter(plan._one, name), Each) for name in full)


def of_site(function: Any) -> bool:
    """Is it a function of a site, or of time and a site, by the name of its last argument?"""
    if function is None:
        return False
    try:
        names = [*inspect.signature(function).parameters]
    except (TypeError, ValueError):
        return False
    return 1 <= len(names) <= 2 and names[-1] == "site"


def _of_sites(loss: Any, name: str, plan: Any, run: Any, k: int) -> tuple[float, np.ndarray]:
    """The sum of a function over the sites at a sample, and its derivative, (N,)."""
    arrays = plan._one.by_site({n: x[k] for n, x in run.states.items()})
    state = by_site(plan._one, state_of(kind_of(arrays), arrays))
    frames = Frames(plan._sites.site, state)
    rows, basis = site_rows(state).T, basis_of(frames.frames, state.arrays)
    t = np.full(len(rows), run.t[k])
    values, slopes = Loss(loss, name, None).slopes(
        first_of(state), t, rows[:, None], basis[:, None], plan.options.compiled
    )
    ends = np.cumsum([x.shape[1] for x in frames.start.values()])[:-1]
    parts = [own.ravel() for own in np.split(slopes[:, 0], ends, axis=1)]
    return float(values.sum()), np.concatenate(parts)


def _cotangent(plan: Any, state: Any, run: Any, given: Any, some: int, along: bool) -> np.ndarray:
    """Cotangents as components, (samples, N)."""
    frames = Frames(plan._sites.site, state)
    if not isinstance(given, dict):
        return _shaped(given, "", (frames.components,), some, along)
    arguments.known_parts(given, frames.start)
    found = []
    for name, basis in frames.start.items():
        there = run.states[name][-some:]
        if name not in given:
            found.append(np.zeros((some, basis.shape[0] * basis.shape[1])))
            continue
        own = _shaped(given[name], name, there.shape[1:], some, along)
        if name == "g":
            basis = frames._basis("g", there.reshape(-1, *there.shape[2:]))
            own = np.einsum("sn,scn->sc", own.reshape(len(basis), -1), basis)
        found.append(own.reshape(some, -1))
    return np.concatenate(found, axis=1)


def _shaped(given: Any, name: str, shape: tuple[int, ...], some: int, along: bool) -> np.ndarray:
    """A cotangent by the components of a part, (samples, ...)."""
    array = arguments.cotangent(given, name, (some,) * along + shape, "fiu")
    return array.reshape(some, *shape).astype(float)
