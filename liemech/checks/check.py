"""The checks: which laws concern what."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np

from ..errors import InvalidInput, InvalidType, require
from ..formulas import check_finite
from ..formulas.arrays import real_array
from ..formulas.classes.signatures import spelt
from ..formulas.vectors import small
from ..groups.lie_algebra import LieAlgebra
from ..groups.lie_group import LieGroup
from ..groups.retractions import Cayley, Exponential, Retraction
from ..integrators.method import Method
from ..rooms.noise.stochastic_steps import NoisySteps
from ..simulation.arguments import matching
from ..systems.many.energies import released
from ..systems.system import State, System
from .laws.action_laws import ACTION, arguments, named
from .laws.algebra_laws import ALGEBRA
from .laws.closed_forms import laws_of_closed_forms
from .laws.group_laws import GROUP, NATIVE, PLACE
from .laws.law import replaced, verdicts
from .laws.map_laws import CAYLEY, EXPONENTIAL, Map
from .laws.system_laws import RUNS, laws_of
from .local_claims import is_reversible, look_around
from .method_claims import MethodTrial, claims
from .noisy_claims import noisy_claims
from .points.like_units import equilibrated
from .points.places import CheckPlace
from .points.sample_points import At, sample_points
from .points.sample_states import at_times, members, pace, sample_states
from .points.special_points import SPECIAL
from .report import Finding, Observation, Report, finished

SURELY = 1e-9
"""The relative difference up to which short motions count as equal."""

LONGEST = 12.0
"""The longest time over which an order is observed, in times in which the start changes by its
size.
"""


@spelt
def check_group(group: LieGroup, *, native: bool = False, raises: bool = True, seed: int = 0) -> Report:
    """Does a group obey its laws, and do its closed forms agree with what follows from the laws?

    native : make a short run of native code too, and compare it bit by bit with plain Python.
    raises : False returns the report on a broken group as well.
    seed : of the random points.

    Returns a Report, which prints as a table.  Raises LawViolation: the first law that is broken,
    where, by how much, what was expected and, where that can be told, the slip.
    """
    require("check_group: group", group, LieGroup)
    return finished(repr(group), _of_group(group, native, seed), raises)


@spelt
def check_retraction(retraction: Retraction, group: LieGroup, *, raises: bool = True, seed: int = 0) -> Report:
    """Is a map from the algebra to a group a retraction, with the differential, inverses and duals that it claims?

    As `check_group`, which the group should have passed before.
    """
    require("check_retraction: retraction", retraction, Retraction)
    require("check_retraction: group", group, LieGroup)
    return finished(f"{retraction!r} on {group!r}", _of_retraction(retraction, group, seed), raises)


@spelt
def check_action(action: Any, points: Any = None, *, raises: bool = True, seed: int = 0) -> Report:
    """Does a group act on a space, and is the infinitesimal action the derivative of the action?

    points : some points of the space, one per row; left out, the action is asked for random ones.
    The rest as in `check_group`.
    """
    if not isinstance(getattr(action, "group", None), LieGroup):
        raise InvalidType(f"check_action: action must be an action of a group; got {action!r}")
    where, rng = sample_points(action.group, seed), np.random.default_rng(seed)
    if points is None:
        samples = [np.asarray(action.random(rng)) for _ in where]
    else:
        samples = [*real_array(points, "check_action: points")]
    if not samples:
        raise InvalidInput("check_action: points is empty; give at least one point of the space")
    for i, x in enumerate(samples):
        name = f"check_action: points[{i}]" if points is not None else "check_action: action.random"
        shape = getattr(action, "point_shape", None)
        if shape is not None and x.shape != shape:
            raise InvalidInput(f"{name} has shape {x.shape}; a point of {action!r} has shape {shape}")
        check_finite(x, name)
    where = [dataclasses.replace(at, point=small(samples[i % len(samples)])) for i, at in enumerate(where)]
    laws = [*ACTION, *laws_of_closed_forms(action, arguments, named)]
    return finished(repr(action), verdicts(laws, action, where, lambda name: True), raises)


@spelt
def check_system(
    system: System, states: State | None = None, *, native: bool = False, raises: bool = True, seed: int = 0
) -> Report:
    """Do the formulas of a system belong together?

    Gradients are compared with energies, Lagrangians with Hamiltonians (the Legendre transform
    there and back), forces with potentials, the power of a load with the change of energy; Casimirs
    must commute with all coordinates and be independent, constraints must stay, and what
    `constants` names must not change along the motion.  Every closed form of the system, and of the
    records that it holds, is compared with the formula that it stands for.  Formulas that follow
    from others are not looked at.  At zero, equal components and on the axes first and second
    derivatives are compared with differences: branches for such points often know a value and no
    slope.

    states : where to look, `system.state(...)`, one or an ensemble; left out, at random states of
    sizes from 0.2 to 8.  Systems that know the time are looked at from t = -1.3 to 640.
    native : make two steps in native code too, and compare them bit by bit with plain Python.
    raises : False returns the report on a broken system as well.
    seed : of the random states.

    Returns a Report, which prints as a table.  Raises LawViolation: the first law that is broken,
    where, by how much, what was expected and, where that can be told, the slip.
    """
    require("check_system: system", system, System)
    if states is not None:
        require("check_system: states", states, State)
        states = system._written_out(states)
    shown, system = repr(system), released(system)

    def findings() -> Iterator[Finding]:
        where = sample_states(system, states, seed)
        for laws, subject, written in laws_of(system):
            yield from verdicts(laws, subject, where, written)
        yield from verdicts(SPECIAL, system, where, lambda name: True)
        yield from verdicts(RUNS if native else [], system, where, lambda name: True)

    return finished(shown, findings(), raises)


@spelt
def check_method(
    method: Method,
    system: System,
    start: State,
    *,
    h: float | None = None,
    keeps: Iterable[str] = (),
    native: bool = False,
    compiled: bool | None = None,
    rho: Callable[[Any], Any] | None = None,
    raises: bool = True,
) -> Report:
    """Is a method of the order that it claims, symmetric and symplectic if it says so, on this
    system from this start?

    Observed are: the order, against RKMK of order 8; the way back, with -h from where steps with h
    lead; Phi' B Phi'^T - B(Phi) of one step Phi, on momenta and on T*G, on R^2n, or on the manifold
    of constraints; the changes of what the system names as constant, and of constraints; for free
    bodies, that the motion does not depend on where the body is; and rho Phi_h rho = Phi_h^-1.
    Claims are compared with `order`, `symmetric` and `symplectic`; a symplectic method must keep
    Casimirs and constraints too, a symmetric one turn back where the motion does.  An observed
    order above the claim is no violation.

    Beside the start, runs of three steps are made from others, turned back, 5 and 40 times as large
    and 5 times smaller, at times up to 640, some of them backwards.  Of steps in a fictive time
    these runs tell all; physical times are compared, and sigma(rho y) = sigma(y) too.

    Of noisy steps the strong order is that of 400 paths against finer steps along the same ones; the weak order that of
    the mean momentum, by all outcomes of bounded increments, without statistics.

    rho : a function of a state that turns the motion back, rho f(y) = -f(rho y), such as
    `lambda s: system.state(s.q, -s.p)`; left out, momenta are reversed, where that is one.
    h : a large step, in s; the order is observed over the time h, in more and more steps.  Left
    out, it is 3/2 of the time in which the start changes by its own size or turns by a radian, or
    half of it and so on where the motion ends before.
    The start is at t = 0, or where a table has no value then, within it.
    keeps : names of constants that the method claims to keep to rounding, such as "spatial
    momentum"; beginnings of names will do.
    native : make three steps in native code too, and compare them bit by bit with plain Python.
    compiled : as in `integrate`, for all runs of the check.
    raises : False returns the report on a method that breaks its claims as well.

    Returns a Report, which prints as a table.  Raises LawViolation: the first claim that does not
    hold, the observed number and the wanted one; IncompatibleSystem if the method does not accept
    the system.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., II.1 (order), V.1
    (symmetry), V.1 (rho-reversible maps), VII.4 (Poisson maps), VIII.3.2 (sigma(rho y) = sigma(y)).
    """
    require("check_method: method", method, Method)
    require("check_method: system", system, System)
    require("check_method: start", start, State)
    if rho is not None and not callable(rho):
        raise InvalidType(
            f"check_method: rho must be a function of a state, such as lambda s: system.state(s.q, -s.p); got {rho!r}"
        )
    if start.bodies is not None:
        raise InvalidInput(f"check_method: start is an ensemble of {start.bodies}; give one start")
    start = members(system._written_out(start))[0]
    if isinstance(method, NoisySteps):
        method.require(system)
        noisy = noisy_claims(method, system, start, h, compiled)  # type: ignore[arg-type]
        return finished(f"{method!r} on {system!r}", noisy, raises)
    place = CheckPlace("the start", method, system, start, 0.0, compiled)
    if place.fictive:
        method.require(place.whole)
    else:
        matching(place.whole, method)
    base = place.base
    place = dataclasses.replace(place, t0=at_times("", base, start, (0.0,))[0].t)
    speed = pace(base, place.t0, start)
    if not math.isfinite(speed) or (speed == 0.0 and h is None):
        raise InvalidInput("check_method: the start is at rest, which tells nothing; give one that moves, or a step h")
    if rho is not None and speed > 0.0:
        _require_reversal(place, rho)
    findings = _claims(place, h, speed, tuple(keeps), native, rho)
    return finished(f"{method!r} on {system!r}", findings, raises)


def _claims(
    place: CheckPlace, h: float | None, speed: float, keeps: tuple[str, ...], native: bool, rho: Any
) -> Iterator[Finding]:
    """The findings on claims from the start, or from another place if a claim is broken only there; then those of short
    runs.
    """
    method, system, start = place.method, place.system, place.start
    observations: list[Observation] = []
    if place.fictive:
        if h is not None:
            raise InvalidInput("check_method: h is a step in fictive time here, and several are tried; leave it out")
    else:
        time = (1.5 / speed if speed > 0.0 else 0.0) if h is None else float(h)
        if speed * abs(time) > LONGEST:
            raise InvalidInput(
                f"check_method: h = {time:g} is too long for an order to show; at the start the "
                "motion changes by its size or turns by a radian in "
                f"{1.0 / speed:.3g}; give about that, or leave h out"
            )
        if not math.isfinite(time) or time == 0.0:
            raise InvalidInput(f"check_method: h must be finite and not zero; got {time:g}")
        trial = MethodTrial(method, system, start, time, place.compiled, place.t0)
        observations = [*claims(trial if h is not None else trial.within, keeps, native)]
    around = {observation.law: observation for observation in look_around(place, keeps, rho)}
    for observation in observations:
        other = around.pop(observation.law, observation)
        better = observation.verdict == "not seen" and observation.law == "order" and other.verdict == "holds"
        worse = observation.verdict != "broken" and other.verdict == "broken"
        yield other if better or worse else observation
    yield from around.values()


def _require_reversal(place: CheckPlace, rho: Any) -> None:
    """Refuse a rho that does not turn the motion back."""
    if not isinstance(rho(place.start), type(place.start)):
        raise InvalidType(f"check_method: rho must return a {type(place.start).__name__}; got {rho(place.start)!r}")
    reversal_error = is_reversible(place, rho)
    if not reversal_error <= SURELY:
        raise InvalidInput(
            f"check_method: rho does not turn the motion of {place.base!r} back: rho f(y) differs "
            f"from -f(rho y), along a short motion by {reversal_error:.1e}"
        )


def _of_group(group: LieGroup, native: bool, seed: int) -> Iterator[Finding]:
    try:
        in_units = equilibrated(group)
        where = sample_points(in_units, seed)
    except NotImplementedError as missing:
        yield Finding("obligations", "a group has an algebra", "broken", remark=str(missing))
        return
    written, exp = partial(replaced, group, LieGroup), Map(Exponential(), in_units, group)
    yield from verdicts(ALGEBRA, in_units.algebra, where, partial(replaced, group.algebra, LieAlgebra))
    yield from verdicts(GROUP, in_units, where, written)
    yield from verdicts(exp.laws() + EXPONENTIAL, exp, where, exp.own)
    yield from _of_cayley(Map(Cayley(), in_units, group), where)
    yield from verdicts(PLACE, in_units, where, written)
    if native:
        yield from verdicts(NATIVE, group, sample_points(group, seed), written)


def _of_cayley(cay: Map, where: list[At]) -> Iterator[Finding]:
    reason = cay.group.why_no_cayley()
    if reason:
        yield Finding("Cayley map", "(1 - xi/2)^-1 (1 + xi/2)", "not there", remark=reason)
    else:
        before_the_pole = [at for at in where if at.spectrum[1] < 1.0]  # a real eigenvalue 2
        yield from verdicts(CAYLEY + cay.laws(), cay, before_the_pole, cay.own)


def _of_retraction(retraction: Retraction, group: LieGroup, seed: int) -> Iterator[Finding]:
    tau, reason = Map(retraction, group, group), retraction.why_not(group)
    if reason:
        yield Finding("a retraction", "tau(0) = e, dtau_0 = 1", "refused", remark=reason)
    else:
        yield from verdicts(tau.laws(), tau, sample_points(group, seed), tau.own)
