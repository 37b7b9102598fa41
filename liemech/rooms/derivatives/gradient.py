"""Gradients of runs: how a loss, or a cotangent, depends on the start of a run and on parameters; of bodies by
`through_blocks`, of many sites by `of_sites`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...errors import GradientWarning, IncompatibleSystem, InvalidInput, warn
from ...formulas.classes.frozen import frozen
from ...formulas.classes.layouts import layout_of
from ...formulas.numbers.sizes import EPSILON
from ...simulation import arguments
from ...simulation.compiled.parameters import full_name
from ...simulation.result import of_some
from ...simulation.trajectory import Trajectory
from ...systems.system import State, member
from .directions import Directions
from .losses import Asked, Loss, Objective
from .of_sites.pullback import goes_by_sites, gradient_by_sites
from .tangent import derived, in_steps
from .through_blocks import Backward, prepared
from .through_events import RunWithEvents
from .varied_input import Tables


@frozen(eq=False)
class Gradient:
    """A loss, and its derivatives.

    value : the loss, of an ensemble the sum of all bodies; None where a cotangent was given.
    gradient : by name, in the shape of the parameter; with several systems the first axis is that of
    bodies.  "start" is (N,), or (bodies, N), in the frames of tangent maps: of a group element dg = g
    hat(eta).
    run : of the samples that were kept, or of start and end.
    growth : the norm of the tangent map J from the start to the end, of the worst body: by so much a
    disturbance grows, and the rounding of the run with it; through jumps the product of those between them, which is at
    least |J|.  Of many sites, where |J| would take a run for
    each direction, it is |J^T w|/|w|, w the derivative by the last state, which is at most |J|; with
    running costs None.
    """

    value: Any
    gradient: dict[str, np.ndarray]
    run: Trajectory
    growth: float | None

    def __getitem__(self, name: str) -> np.ndarray:
        return self.gradient[name]


# ------------------------------------------------------------------ what is asked for


def backwards(plan: Any, what: str, start: Any, steps: Any, t_end: Any, t0: Any, by: Any, asked: Asked) -> Gradient:
    """The gradient of a loss, or by a cotangent, of `Plan.gradient` and `Plan.pullback`: what is asked
    for is checked, and the kind of the run found.
    """
    if plan.recorder is not None:
        raise InvalidInput(
            f"Plan.{what} is of states at the ends of steps; make a plan that records no functions of them"
        )
    if plan.events and (asked.every is not None or asked.along is not None):
        raise InvalidInput(f"Plan.{what}: with events it is by the last state alone; leave out every and along")
    t0, names = arguments.real(t0, "t0"), arguments.parameters(by, f"Plan.{what}")
    if asked.every is not None:
        asked = asked._replace(every=arguments.count(asked.every, "every", 1))
    elif asked.along is not None:
        asked = asked._replace(every=plan.options.every)
    if plan._sites is not None and goes_by_sites(plan, start, names, asked.loss, asked.along):
        if plan.events:
            raise InvalidInput(f"Plan.{what} of many sites looks for no events; make a plan without them")
        value, by_name, run, growth = gradient_by_sites(plan, what, start, steps, t_end, t0, names, asked)
        if growth is not None:
            tell(growth)
        return Gradient(value, by_name, run, growth)
    start = plan._started(start, t0)
    if plan.fictive:
        raise IncompatibleSystem(
            f"Plan.{what}: steps in fictive time depend on how the run began; plan.tangent differentiates them"
        )
    if layout_of(member(start, 0)).in_memory:
        raise IncompatibleSystem(
            f"Plan.{what}: {plan._one!r} has large matrices, whose numbers in memory carry no "
            "derivative; differences of runs tell it"
        )
    with plan._beginning(start, t0):
        if not (plan.adaptive or plan.events):
            return gradient_of(plan, start, plan._count(steps, t_end, t0), t0, names, asked)
        if start.bodies is not None:
            return of_each_body(plan, what, start, steps, t_end, t0, names, asked)
        return gradient_of_body(plan._of_body(0), start, steps, t_end, t0, names, asked)


def gradient_of(
    plan: Any, start: State, steps: int, t0: float, names: tuple[str, ...], asked: Asked, run: Any = None
) -> Gradient:
    """The derivative of a loss, or of the product of a cotangent with the run, by the named parameters.

    start : with the parts that the run needs.  run : by an error estimate; of fixed steps it is made here.
    """
    with derived(plan, "gradient"):
        prepared_gradient = prepared(plan, start.bodies, member(start, 0), names, t0, run is None)
    forward = prepared_gradient.forward(plan, start, steps, t0, asked.every, run)
    samples = (forward.edges % (asked.every or 1) == 0) | (forward.edges == steps)
    objective = Objective(forward.run, forward.states, forward.example, samples if asked.every else None)
    objective.find(asked, plan.options.compiled)
    back = Backward(forward, prepared_gradient, objective.by_states)
    with derived(plan, "gradient"):
        back.go()
    tell(back.relative_growth())
    by_name = {name: back.by(name) for name in names}
    if start.bodies is None and "start" in names:
        by_name["start"] = by_name["start"][0]
    return Gradient(objective.value, by_name, forward.run, float(np.linalg.norm(back.growth, 2, axis=(1, 2)).max()))


DOUBTFUL = 1e-6
"""Part of a gradient that rounding may take before somebody is warned."""


def tell(growth: float) -> None:
    """Warn of a growth that leaves few digits."""
    if not growth * EPSILON < DOUBTFUL:
        warn(
            f"Plan.gradient: a disturbance of the start grows by {growth:.1e} up to the end, and the "
            f"rounding of the run with it: the gradient has about {digits(growth)} digits. A shorter run, or "
            "a loss of averages, has more",
            GradientWarning,
        )


def digits(growth: float) -> int:
    """The decimal digits that a growth leaves."""
    return max(0, math.floor(-math.log10(growth * EPSILON))) if math.isfinite(growth) else 0


def gradient_of_body(
    plan: Any, start: State, steps: Any, t_end: Any, t0: float, names: tuple[str, ...], asked: Asked
) -> Gradient:
    """The gradient of a run of one body with events, or by an error estimate, the lengths of its steps held fixed."""
    if "h" in names and plan.adaptive:
        raise InvalidInput("Plan.gradient: h is for fixed steps; the lengths of adaptive ones are held fixed")
    if plan.events:
        return gradient_with_events(plan, start, steps, t_end, t0, names, asked)
    run = plan._in_pieces(start, t0, steps, t_end, None, None)
    return gradient_of(in_steps(plan, run.t), start, len(run.t) - 1, 0.0, names, asked, run)


def gradient_with_events(
    plan: Any, start: State, steps: Any, t_end: Any, t0: float, names: tuple[str, ...], asked: Asked
) -> Gradient:
    """The gradient of a run of one body that meets events: backwards through its crossings and what lies between."""
    of_events = RunWithEvents(plan, start, steps, t_end, t0, names)
    run, crossings, growth, cotangent = of_events.run, [*of_events.changed], 1.0, asked
    value, sums = None, {}  # type: Any, dict[str, Any]
    in_full = {
        name: name if name.startswith("method.") or name in Tables(of_events.system, names, "Plan.gradient").by_name
        else full_name(of_events.system, name, "Plan.gradient")
        for name in names if name != "start"
    }  # fmt: skip
    directions = Directions(of_events.system, plan.method, start, ("start", *in_full.values()))
    count = directions.frames.count
    for first, last in reversed(of_events.stretches()):
        between = of_events.bare, of_events.state(first), last - first
        all_names = ("start", *in_full)
        if plan.adaptive:
            part = of_events.part(first, last)
            of_part = gradient_of(in_steps(between[0], part.t), *between[1:], 0.0, all_names, cotangent, part)
        else:
            of_part = gradient_of(*between, run.t.item(first), all_names, cotangent)
        value, pulled = of_part.value if cotangent is asked else value, of_part["start"]
        sums = {name: of_part[name] + sums.get(name, 0.0) for name in in_full}
        growth *= of_part.growth or 1.0
        if crossings:
            jacobian, _ = of_events.through(crossings.pop(), directions, np.eye(count, len(directions.slopes)))
            growth *= float(np.linalg.norm(jacobian[:, :count], 2))
            by_name = directions.named((pulled @ jacobian)[None])
            sums = {name: x + by_name[in_full[name]].reshape(np.shape(x)) for name, x in sums.items()}
            pulled = by_name["start"][0]
        cotangent = Asked(None, cotangent=pulled)
    tell(growth)
    sums["start"] = pulled
    ends = of_events.part(0, len(run.t) - 1, len(run.t) - 1)
    return Gradient(value, {name: sums[name] for name in names}, ends, growth)


def of_each_body(
    plan: Any, what: str, start: State, steps: Any, t_end: Any, t0: float, names: tuple[str, ...], asked: Asked
) -> Gradient:
    """The gradient of an ensemble by an error estimate, whose bodies have steps of their own: one after
    another.
    """
    bodies, (every, loss, along, cotangent) = start.bodies or 1, asked
    if cotangent is not None and every is not None:
        raise IncompatibleSystem(
            f"Plan.{what}: with adaptive steps each body has samples of its own: leave out every, "
            "or give one body at a time"
        )
    losses = [x if x is None else Loss(x, name, bodies) for x, name in ((loss, "loss"), (along, "along"))]
    rows: dict[Any, Any] = cotangent if isinstance(cotangent, dict) else {"": cotangent}
    for name, x in rows.items():
        if x is not None and np.shape(x)[:1] != (bodies,):
            raise InvalidInput(
                f"Plan.{what}: cotangent{[name] if name else ''} has a leading axis of {bodies} bodies; "
                f"got shape {np.shape(x)}"
            )
    gradients = []
    for i, end in enumerate(arguments.ends(t_end, bodies)):
        parts: Any = {n: x if x is None else np.asarray(x)[i] for n, x in rows.items()}
        of_body = *(x if x is None else x.of(i) for x in losses), parts if isinstance(cotangent, dict) else parts[""]
        gradients.append(
            gradient_of_body(plan._of_body(i), member(start, i), steps, end, t0, names, Asked(every, *of_body))
        )
    gradient = {}
    for name in names:
        each = np.stack([x[name] for x in gradients])
        of_each = ("method" if name.startswith("method.") else "system") in plan.of_each
        gradient[name] = each if name == "start" or of_each else each.sum(axis=0)
    value = None if cotangent is not None else math.fsum(x.value for x in gradients)
    run = of_some([x.run for x in gradients], system=plan.system, method=plan.method)
    return Gradient(value, gradient, run, max(x.growth or 0.0 for x in gradients))
