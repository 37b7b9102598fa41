"""The checks: which laws concern what."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType
from ..formulas import check_finite
from ..formulas.broadcasting import small
from ..groups.lie_algebra import LieAlgebra
from ..groups.lie_group import LieGroup
from ..integrators.method import Method
from ..retractions import Cayley, Exponential, Retraction
from ..systems.constrained import ConstrainedSystem
from ..systems.system import State, System
from .action_laws import ACTION
from .algebra_laws import ALGEBRA
from .constrained_claims import constrained_claims
from .group_laws import GROUP, NATIVE, PLACE
from .law import replaced, verdicts
from .map_laws import CAYLEY, EXPONENTIAL, Map
from .method_claims import Trial, claims
from .report import Finding, Report
from .sample_points import At, sample_points
from .sample_states import members, pace, sample_states
from .special_points import SPECIAL
from .system_laws import RUNS, laws_of

LONGEST = 12.0
"""The longest time over which an order is observed, in times in which the start changes by its
size.
"""


def check_group(
    group: LieGroup, *, native: bool = False, raises: bool = True, seed: int = 0
) -> Report:
    """Does a group obey its laws, and do its closed forms agree with what follows from the laws?

    native : make a short run of native code too, and compare it bit by bit with plain Python.
    raises : False returns the report on a broken group as well.
    seed : of the random points.

    Returns a Report, which prints as a table.  Raises LawViolation: the first law that is broken,
    where, by how much, what was expected and, where that can be told, the slip.
    """
    _require("check_group: group", group, LieGroup)
    return _finished(repr(group), _of_group(group, native, seed), raises)


def check_retraction(
    retraction: Retraction, group: LieGroup, *, raises: bool = True, seed: int = 0
) -> Report:
    """Is a map from the algebra to a group a retraction, and are its differential, inverses and
    duals what they claim to be?

    As `check_group`, which the group should have passed before.
    """
    _require("check_retraction: retraction", retraction, Retraction)
    _require("check_retraction: group", group, LieGroup)
    return _finished(
        f"{retraction!r} on {group!r}", _of_retraction(retraction, group, seed), raises
    )


def check_action(action: Any, points: Any = None, *, raises: bool = True, seed: int = 0) -> Report:
    """Does a group act on a space, and is the infinitesimal action the derivative of the action?

    points : some points of the space, one per row; left out, the action is asked for random ones.
    The rest as in `check_group`.
    """
    if not isinstance(getattr(action, "group", None), LieGroup):
        raise InvalidType(f"check_action: action must be an action of a group; got {action!r}")
    where, rng = sample_points(action.group, seed), np.random.default_rng(seed)
    some = [action.random(rng) for _ in where] if points is None else list(points)
    if not some:
        raise InvalidInput("check_action: points is empty; give at least one point of the space")
    for point in some if points is not None else ():
        check_finite(np.asarray(point), "check_action: points")
    where = [
        dataclasses.replace(at, point=small(np.asarray(some[i % len(some)])))
        for i, at in enumerate(where)
    ]
    return _finished(repr(action), verdicts(ACTION, action, where, lambda name: True), raises)


def check_system(
    system: System,
    states: State | None = None,
    *,
    native: bool = False,
    raises: bool = True,
    seed: int = 0,
) -> Report:
    """Do the formulas of a system belong together?

    Gradients are compared with energies, Lagrangians with Hamiltonians (the Legendre transform
    there and back), forces with potentials, the power of a load with the change of energy; Casimirs
    must commute with all coordinates, and what `constants` names must not change along the motion.
    Formulas that follow from others are not looked at.  At zero, equal components and on the axes
    first and second derivatives are compared with differences: branches for such points often know
    a value and no slope.

    states : where to look, `system.state(...)`, one or an ensemble; left out, at random states of
    size one.
    native : make two steps in native code too, and compare them bit by bit with plain Python.
    raises : False returns the report on a broken system as well.
    seed : of the random states.

    Returns a Report, which prints as a table.  Raises LawViolation: the first law that is broken,
    where, by how much, what was expected and, where that can be told, the slip.
    """
    _require("check_system: system", system, System)
    if states is not None:
        _require("check_system: states", states, State)

    def findings() -> Iterator[Finding]:
        where = sample_states(system, states, seed)
        for laws, subject, own in laws_of(system):
            yield from verdicts(laws, subject, where, own)
        yield from verdicts(SPECIAL, system, where, lambda name: True)
        yield from verdicts(RUNS if native else [], system, where, lambda name: True)

    return _finished(repr(system), findings(), raises)


def check_method(
    method: Method,
    system: System,
    start: State,
    *,
    h: float | None = None,
    keeps: Iterable[str] = (),
    native: bool = False,
    compiled: bool | None = None,
    raises: bool = True,
) -> Report:
    """Is a method of the order that it claims, symmetric and symplectic if it says so, on this
    system from this start?

    Observed are: the order, against RKMK of order 8; the way back, with -h from where steps with h
    lead; Phi' B Phi'^T - B(Phi) of one step Phi, on momenta and on T*G, or on R^2n; the changes of
    what the system names as constant; and, for free bodies, that the motion does not depend on
    where the body is.  Claims are compared with `order`, `symmetric` and `symplectic`; a symplectic
    method must keep Casimirs too.  An observed order above the claim is no violation.

    h : a large step, in s; the order is observed over the time h, in more and more steps.  Left
    out, it is 3/2 of the time in which the start changes by its own size or turns by a radian.
    keeps : names of constants that the method claims to keep to rounding, such as "spatial
    momentum"; beginnings of names will do.
    native : make three steps in native code too, and compare them bit by bit with plain Python.
    compiled : as in `integrate`, for all runs of the check.
    raises : False returns the report on a method that breaks its claims as well.

    Returns a Report, which prints as a table.  Raises LawViolation: the first claim that does not
    hold, the observed number and the wanted one; IncompatibleSystem if the method does not accept
    the system.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.1 (order), V.1
    (symmetry), VII.4 (Poisson maps).
    """
    _require("check_method: method", method, Method)
    _require("check_method: system", system, System)
    _require("check_method: start", start, State)
    if method.fictive or system.fictive:
        raise InvalidInput(
            f"check_method: {method!r} on {system!r} steps in a fictive time; compare runs of "
            "integrate(..., t_end=...) instead, and check the method that is controlled"
        )
    method.require(system)
    if start.bodies is not None:
        raise InvalidInput(f"check_method: start is an ensemble of {start.bodies}; give one start")
    start = members(start)[0]
    speed = pace(system, 0.0, start)
    time = (1.5 / speed if speed > 0.0 else 0.0) if h is None else float(h)
    if speed * abs(time) > LONGEST:
        raise InvalidInput(
            f"check_method: h = {time:g} is too long for an order to show; at the start the motion "
            "changes by its size or turns by a radian in "
            f"{1.0 / speed:.3g}; give about that, or leave h out"
        )
    if not math.isfinite(time) or time == 0.0:
        raise InvalidInput(
            "check_method: the start is at rest, which tells "
            "nothing; give one that moves, or a step h"
        )
    trial = Trial(method, system, start, time, compiled)
    findings = constrained_claims if isinstance(system, ConstrainedSystem) else claims
    return _finished(f"{method!r} on {system!r}", findings(trial, tuple(keeps), native), raises)


def _require(name: str, value: Any, kind: type) -> None:
    if not isinstance(value, kind):
        cure = f"; write {value.__name__}(), with the brackets" if isinstance(value, type) else ""
        raise InvalidType(f"{name} must be a {kind.__name__}; got {value!r}{cure}")


def _finished(subject: str, findings: Iterator[Finding], raises: bool) -> Report:
    report = Report(subject, tuple(findings))
    if report.broken and raises:
        raise report.violation()
    return report


def _of_group(group: LieGroup, native: bool, seed: int) -> Iterator[Finding]:
    try:
        where = sample_points(group, seed)
    except NotImplementedError as missing:
        yield Finding("obligations", "a group has an algebra", "broken", remark=str(missing))
        return
    own, exp = partial(replaced, group, LieGroup), Map(Exponential(), group)
    yield from verdicts(ALGEBRA, group.algebra, where, partial(replaced, group.algebra, LieAlgebra))
    yield from verdicts(GROUP, group, where, own)
    yield from verdicts(exp.laws() + EXPONENTIAL, exp, where, exp.own)
    yield from _of_cayley(group, where)
    yield from verdicts(PLACE, group, where, own)
    yield from verdicts(NATIVE if native else [], group, where, own)


def _of_cayley(group: LieGroup, where: list[At]) -> Iterator[Finding]:
    cay, reason = Map(Cayley(), group), group.why_no_cayley()
    if reason:
        yield Finding("Cayley map", "(1 - xi/2)^-1 (1 + xi/2)", "not there", remark=reason)
    else:
        before_the_pole = [at for at in where if at.spectrum[1] < 1.0]  # a real eigenvalue 2
        yield from verdicts(CAYLEY + cay.laws(), cay, before_the_pole, cay.own)


def _of_retraction(retraction: Retraction, group: LieGroup, seed: int) -> Iterator[Finding]:
    tau, reason = Map(retraction, group), retraction.why_not(group)
    if reason:
        yield Finding("a retraction", "tau(0) = e, dtau_0 = 1", "refused", remark=reason)
    else:
        yield from verdicts(tau.laws(), tau, sample_points(group, seed), tau.own)
