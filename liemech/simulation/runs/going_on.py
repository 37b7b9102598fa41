"""May a plan go on where a run has come to?  It may if system, method and steps are the same."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np

from ...compiler.kernel import Several
from ...errors import InvalidInput, InvalidType
from ...formulas import Record
from ...formulas.classes.exact_keys import exact_key
from ...formulas.classes.records import fields_of
from ..compiled.systems import OfBodies, Systems, each_of
from ..trajectory import TangentTrajectory, Trajectory
from .carry import SiteCarry


def carry_of(plan: Any, given: Any, what: str) -> Any:
    """The carry from which a plan is to go on, of a run, of a stepper, or by itself.

    what : the method of the plan that was called.
    Raises InvalidInput for what was made in another way, which it names.
    """
    run = given if isinstance(given, Trajectory) else None
    if isinstance(run, TangentTrajectory):
        raise InvalidInput(
            f"Plan.{what}: a run with its tangent map carries nothing on; go on with "
            "plan.tangent(run.last, ...) and multiply the maps"
        )
    if what == "resume" and run is None and not hasattr(given, "carry"):
        raise InvalidType(f"Plan.resume goes on with a Trajectory; got {type(given).__name__}")
    carry = getattr(given, "carry", given)  # of a run or a stepper
    if run is not None and carry is None:
        raise InvalidInput(
            f"Plan.{what}: this run was interrupted, has failed or was ended "
            "by an event, and carries nothing on; start from run.last"
        )
    if run is None:
        require_fixed(plan, given, carry, what)
    for name, of_plan, of_run in pairs(plan, run, carry, what):
        if of_plan is of_run or exact_key(of_plan) == exact_key(of_run):
            continue
        others = ", ".join(differing(of_plan, of_run))
        if run is not None:
            raise InvalidInput(
                f"Plan.{what}: the run was made with another {name}: {others}; start a new one from "
                "run.last, or make a plan of what it was made with"
            )
        raise InvalidInput(
            f"Plan.{what}: the carry is of another system or method, {name}: {others}; begin anew "
            "there, with plan.begin(carry.state, carry.t), or plan.stepper for begin"
        )
    if run is not None:
        require_record(plan, run, what)
        require_steps(plan, carry, what)
    return carry


def require_record(plan: Any, run: Trajectory, what: str) -> None:
    """Refuse a run that has kept something else."""
    record = (plan.record,) if isinstance(plan.record, str) else plan.record
    if plan.recorder is not None:
        record = plan.recorder.names
    other = record is not None and sorted(run.states) != sorted(record)
    if other or (run.observed and plan.recorder is None):
        raise InvalidInput(f"Plan.{what}: the run recorded {', '.join(run.states)}, the plan records {plan.record}")


def require_fixed(plan: Any, given: Any, carry: Any, what: str) -> None:
    """Raise InvalidInput for a carry that is not of fixed steps like those of the plan."""
    plan._one_length(what)
    fits = getattr(carry, "fictive", None) == plan.fictive and not (isinstance(carry, SiteCarry) and not plan._sites)
    if fits and not isinstance(carry, SiteCarry) and carry.bodies is not None:  # side by side
        fits = carry.inner.together and not isinstance(getattr(carry, "origin", None), tuple)
    if not fits:
        raise InvalidType(
            f"Plan.{what} goes on from what `begin` or `step` gave, or from the `carry` of a run "
            f"or a stepper; got {given!r}"
        )
    h = carry.inner.h
    if not alike(h, plan._steps.h):
        raise InvalidInput(f"Plan.{what}: the carry is of steps of h = {h!r}, the plan has {plan._steps.h!r}")


def require_steps(plan: Any, carry: Any, what: str) -> None:
    """Refuse a run with steps of another kind, or of another length."""
    inner = carry.inner
    adaptive = inner.clock is not None if isinstance(inner, SiteCarry) else inner.t0 is None
    if carry.fictive != plan.fictive or adaptive != plan.adaptive:
        raise InvalidInput(f"Plan.{what}: the run was made with other steps; {new_run(plan)}")
    if not adaptive and not alike(inner.h, plan._steps.h):
        raise InvalidInput(
            f"Plan.{what}: the run was made with h = {inner.h!r} instead of {plan._steps.h!r}; {new_run(plan)}"
        )


def new_run(plan: Any) -> str:
    """The advice to start a new run; one under noise needs another seed, for noise is counted by steps of its run."""
    noisy = any(system.noisy for system in each_of(plan.system))
    return "start a new one from run.last" + ", with another seed: with this one its noise repeats" * noisy


def alike(one: Any, other: Any) -> bool:
    """Whether two steps are equal, each a number or one for each body."""
    if type(one) is type(other) is float:
        return one == other
    shapes = {np.shape(x) for x in (one, other)} - {()}
    return len(shapes) <= 1 and bool(np.all(np.equal(one, other)))


def pairs(plan: Any, run: Any, carry: Any, what: str) -> list[tuple[str, Any, Any]]:
    """Systems and methods, with their names: those of the plan beside those of which a run was made, if
    it is known.
    """
    origin = getattr(carry, "origin", None)
    method, system, methods = None, None, plan.method  # type: Any, Any, Any
    if run is not None:
        system, method = run.system, run.method
    elif getattr(carry, "shape", None) is not None:
        method, system, *_ = next(iter(carry.shape.lanes.values())).arguments
        methods = plan._steps.way
    if origin is not None and not isinstance(origin, tuple):
        system, method = origin.given, method or origin.method
    elif origin and plan._one.fictive:  # of each body
        systems = tuple([origin_of_body.given for origin_of_body in origin])
        system = Systems(systems) if isinstance(plan.system, OfBodies) else systems[0]
    found_pairs: list[tuple[str, Any, Any]] = []
    for name, of_plan, of_run in (("system", plan.system, system), ("method", methods, method)):
        if of_run is None:
            continue
        members, members_of_run = (each_of(of_plan), of_run.values if isinstance(of_run, Several) else each_of(of_run))
        if len(members) != len(members_of_run):
            raise InvalidInput(
                f"Plan.{what}: the run was made with {len(members_of_run)} {name}s, the plan with {len(members)}"
            )
        found_pairs += [(name, *pair) for pair in zip(members, members_of_run, strict=True)]
    return found_pairs


def differing(mine: Any, theirs: Any, name: str = "") -> list[str]:
    """The first fields in which two records differ, with both values: those that a user gave, or
    else derived ones.
    """
    if type(mine) is not type(theirs) or not isinstance(mine, Record) or not fields_of(mine):
        return (
            []
            if exact_key(mine) == exact_key(theirs)
            else [f"{name or type(theirs).__name__} = {theirs!r} instead of {mine!r}"]
        )
    signature = inspect.signature(type(mine)).parameters
    fields = sorted(fields_of(mine), key=lambda field: field not in signature)
    parts = {n: differing(getattr(mine, n), getattr(theirs, n), f"{name}.{n}".lstrip(".")) for n in fields}
    texts = [text for n, part in parts.items() if n in signature for text in part] or [
        text for part in parts.values() for text in part
    ]
    return texts[:3]
