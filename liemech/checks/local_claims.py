"""A method's claims, judged by short runs from many places: the order of a few steps, forwards and
backwards, the way back, the reversal of velocities, constants, brackets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..errors import LiemechError
from ..formulas import vec
from ..rooms.constraints.constrained_body import BoundBody, ConstrainedBody
from ..rooms.fictive_time.clocked import Clocked
from ..rooms.fictive_time.time_transformed import ExtendedSystem
from ..simulation.reports.drift import constants_and_terms
from ..systems.canonical import CanonicalState
from ..systems.lie_poisson import BodyState
from .method_claims import BRACKET, EXACT, exactly, kept_brackets, relative_defect
from .points.places import SOME, CheckPlace, places
from .points.sample_points import flat, size
from .reference import CLEAR
from .report import Observation

MOST = 24
"""How many steps are tried until the error of one is rounding."""

MISSING = 0.6
"""By how much the order of a few steps may seem less than it is, of methods up to order 4; for each
order more, of which fewer steps err visibly, as much again.
"""

ORDER = "error = O(h^(p+1)) of a few steps, from several starts"

SENSIBLE = 0.02
"""The relative error up to which a step is one at which the other claims are looked at."""

BRACKETS = 1, 2
"""The places at which brackets are looked at."""

BACKWARDS = 0, 1
"""The places at which steps are taken backwards too."""

UNSTABLE = (LiemechError, ArithmeticError, ValueError)
"""Errors of a step that is too long, or leads out of where a system is defined."""


Errors = list[tuple[float, dict[str, np.ndarray]]]
"""Steps h, each smaller than the one before, and the errors of the parts after a few of them, until they are rounding."""


@dataclass(frozen=True)
class Local:
    """Short runs of a method at a place."""

    weights: ClassVar[tuple[float, ...]] = 1 / 12, -2 / 3, 0.0, 2 / 3, -1 / 12

    place: CheckPlace

    @property
    def ratio(self) -> float:
        """The ratio of each step to the next: the error falls by about 32, and not by less than 8."""
        return float(max(2.0 ** (5.0 / (self.place.method.order + 1)), 2.0**0.5))

    @cached_property
    def errors(self) -> Errors:
        """The errors of steps forwards."""
        return self._errors(1.0)

    @cached_property
    def backwards(self) -> Errors:
        """The errors of steps with negative h."""
        return self._errors(-1.0)

    def _errors(self, sign: float) -> Errors:
        place, errors = self.place, []
        longest = 0.25 if place.method.order <= 4 else 0.5
        h = sign * longest * place.unit / place.scale
        for _ in range(MOST):
            try:
                end = place.after(place.begin, h, SOME)
                passed = place.clock(end, SOME * h)
                exact, doubts = place.exact_within(passed)
                error = place.differences(place.plainly(end), exact)
            except UNSTABLE:
                error, doubts = {}, {}
            sizes = {name: size(e) for name, e in error.items()}
            if sizes and all(e <= place.noise or CLEAR * doubts[name] < e < np.inf for name, e in sizes.items()):
                errors.append((h, error))
                if max(sizes.values()) <= place.noise:
                    break
            h = h / self.ratio
        return errors

    def ends(self, starts: list[dict[str, np.ndarray]]) -> list[dict[str, np.ndarray]]:
        """The states after a few steps from states that are given by their parts."""
        return [state.arrays for state in self.place.moved(starts, self.h, SOME)]

    @property
    def sensible(self) -> list[float]:
        """Steps that do not err by nonsense."""
        return [h for h, error in self.errors if max(map(size, error.values())) <= SENSIBLE]

    @property
    def h(self) -> float:
        """The largest of the sensible steps."""
        return self.sensible[0]

    @property
    def until(self) -> float:
        """The time after a few steps."""
        return self.place.t0 + SOME * self.h


def seen_errors(errors: Errors, name: str, noise: float) -> list[tuple[float, float]]:
    """Steps and errors between nonsense and rounding, of a part or of all, from where they point to one side: about a
    change of sign an error is small, and falls at first too fast and then too slowly.
    """
    clear_errors: list[tuple[float, float]] = []
    before = np.zeros(0)
    for h, parts in errors:
        error = np.concatenate([*parts.values()]) if name == "all" else parts[name]
        large = max(map(size, parts.values())) if name == "all" else size(error)
        if noise < large <= SENSIBLE:
            clear_errors = [*(clear_errors if clear_errors and before @ error > 0.0 else []), (h, large)]
            before = error
    return clear_errors


def power(larger: tuple[float, float], smaller: tuple[float, float]) -> float:
    """The power of the step by which the error falls from one to the other."""
    (g, f), (h, e) = larger, smaller
    return float(np.log(f / e) / np.log(g / h))


def local_order(local: Local, errors: Errors) -> Observation | None:
    """The power of h by which the error of a few steps falls at last, unless it grows still; None
    if it is as claimed.

    An error that changes its sign is small between: it must fall too slowly from each of the two
    steps before.
    """
    p = local.place.method.order
    worst: tuple[float, str, float] | None = None
    for name in ["all", *errors[-1][1]] if errors else []:
        visible = seen_errors(errors, name, local.place.noise)
        if len(visible) < 4:
            continue
        q = max(power(before, visible[-1]) for before in visible[-3:-1])
        growing = power(visible[-3], visible[-1]) > power(visible[-4], visible[-2]) + 0.25
        allowed = MISSING * max(1.0, p - 3.0)
        least_order = p + 1.0 - (allowed if name == "all" else 1.0 + allowed)
        lacking = least_order - q
        if lacking > 0.0 and not growing and (worst is None or lacking > worst[2]):
            worst = q - 1.0, f"{name} with h = {visible[-1][0]:.2g}", lacking
    if worst is None:
        return None
    return Observation(
        "order", ORDER, "broken", str(local.place), observed=f"{worst[0]:.2f}, of {worst[1]}", wanted=f"{p}"
    )


def local_way_back(local: Local) -> float:
    """A few steps with h, as many with -h from where they lead: how far from the start."""
    place, h = local.place, local.h
    end = place.after(place.begin, h, SOME)
    home = place.after(end, -h, SOME, SOME * h)
    return max(place.distances(place.plainly(home), place.start).values())


# ---------------------------------------------------------------- reversal


Reversal = Callable[[Any], Any]


def turned_back(state: Any) -> Any:
    """The state with momenta reversed, where it has any."""
    if isinstance(state, CanonicalState):
        return CanonicalState(state.q, -state.p)
    if isinstance(state, BodyState):
        return BodyState(-state.mu, state.g)
    return None


def is_reversible(place: CheckPlace, rho: Reversal) -> float:
    """The distance of rho f(y) from -f(rho y), along a short motion: rho(y(t)) is where rho(y(0)) leads in the time -t."""
    time = 0.25 * place.unit
    other = replace(place, start=rho(place.start))
    return max(place.distances(other.exact(-time), rho(place.exact(time))).values())


def local_reversal(local: Local, rho: Reversal) -> float:
    """A few steps, rho, as many steps, rho: how far from the start."""
    place, h = local.place, local.h
    end = place.after(place.begin, h, SOME)
    again = place.after(_reversed(place, end, rho), h, SOME, SOME * h)
    return max(place.distances(rho(place.plainly(again)), place.start).values())


def _reversed(place: CheckPlace, state: Any, rho: Reversal) -> Any:
    """rho of the state, whose clock stays."""
    back = rho(place.plainly(state))
    if isinstance(place.whole, Clocked):
        return type(state)(*back.parts.values(), state.time, state.z)
    if isinstance(place.whole, ExtendedSystem):
        n = len(back.q)
        return type(state)(vec(*back.q, state.q[n]), vec(*back.p, state.p[n]))
    return back


def scale_reversal(place: CheckPlace, rho: Reversal) -> float:
    """sigma(rho y) beside sigma(y), equation (3.4)."""
    sigma = place.whole.sigma
    scale, reversed_scale = (sigma.value(place.base, y) for y in (place.start, rho(place.start)))
    return float(abs(reversed_scale - scale) / (abs(scale) or 1.0))


# ---------------------------------------------------------------- constants


def changes(local: Local) -> Iterator[tuple[str, float]]:
    """The largest relative change of each constant along a few steps."""
    place, h = local.place, local.h
    states = [place.start]
    for steps in range(1, SOME + 1):
        states.append(place.plainly(place.after(place.begin, h, steps)))
    arrays = {
        name: np.stack([np.asarray(state.parts[name]) for state in states])
        for name, x in place.start.parts.items()
        if x is not None
    }
    if isinstance(place.base, BoundBody):
        yield from off_constraint(place.base, states, [place.t0 + k * h for k in range(len(states))])
    values, terms = constants_and_terms(place.base, arrays, len(states))
    for name, value in values.items():
        scale = size(np.abs(terms[name]).max(axis=0))
        yield name, size(np.abs(value - value[0]).max(axis=0)) / (scale or 1.0)


def off_constraint(bound: Any, states: list[Any], times: list[float]) -> Iterator[tuple[str, float]]:
    """The defects of conditions at states and their times, relative to their terms; of conditions on velocities,
    relative to those of typical velocities.
    """
    largest = {"constraint": 0.0, "hidden constraint": 0.0}
    for t, state in zip(times, states, strict=True):
        system = bound.at_time(t)
        G, paces = np.array(system.jacobian(state.g), dtype=float), system._paces(state.g)
        reach = system._reach_of(G, state.mu, state.g) + np.abs(paces)
        speed = np.abs(G @ flat(system.velocity(state.mu)) + paces) / np.where(reach > 0.0, reach, 1.0)
        largest["hidden constraint"] = max(largest["hidden constraint"], float(speed.max()))
        if isinstance(system, ConstrainedBody):
            rows = np.abs(G).max(axis=1)
            terms = system._terms(state.g) + np.where(rows > 0.0, rows, 1.0)
            defect = np.abs(flat(system.constraint.value(state.g))) / terms
            largest["constraint"] = max(largest["constraint"], float(defect.max()))
    if not isinstance(bound, ConstrainedBody):
        del largest["constraint"]
    yield from largest.items()


# ---------------------------------------------------------------- all places


class Seen:
    """The observation of each law, the worst of all places."""

    def __init__(self, method: Any) -> None:
        self.method = method
        self.defects: dict[str, tuple[str, bool, float, float, str]] = {}
        self.order: Observation | None = None
        self.slope: float | None = None

    def enter(
        self, law: str, formula: str, claimed: bool, defect: float, where: CheckPlace, bound: float = EXACT
    ) -> None:
        """A defect, in roundings, at a place."""
        defect = defect if defect == defect else np.inf
        if law not in self.defects or defect > self.defects[law][2]:
            self.defects[law] = formula, claimed, defect, bound, str(where)

    def brackets(self, local: Local) -> None:
        """The Poisson brackets that the steps may keep."""
        place = local.place
        for law, formula, claimed, charts in kept_brackets(place.whole, place.begin, self.method):
            defect = relative_defect(local, charts, claimed)
            self.enter(law, formula, claimed, defect, place, BRACKET)

    def observations(self) -> Iterator[Observation]:
        """An observation for each law, the order first."""
        p = self.method.order
        if self.order is not None:
            yield self.order
        elif self.slope is None:
            too_few = "too few errors of a few steps between 0.02 and rounding"
            yield Observation("order", ORDER, "not seen", wanted=f"{p}", remark=too_few)
        else:
            observed = f"{self.slope:.2f}, of a few steps"
            yield Observation("order", ORDER, "holds", observed=observed, wanted=f"{p}")
        for law, defect in self.defects.items():
            yield exactly(law, *defect)


def look_around(first: CheckPlace, keeps: tuple[str, ...], rho: Reversal | None) -> Iterator[Observation]:
    """Claims at the start and at other places: for each law the worst finding."""
    summary = Seen(first.method)
    for i, place in enumerate(places(first)):
        local = Local(place)
        for errors in (local.errors, local.backwards) if i in BACKWARDS else (local.errors,):
            summary.order = summary.order or local_order(local, errors)
            visible = seen_errors(errors, "all", place.noise)
            if summary.slope is None and len(visible) > 2:
                summary.slope = power(visible[-3], visible[-1]) - 1.0
        if not local.sensible:
            continue
        try:
            _look(summary, local, keeps, rho)
            if i in ((0,) if place.fictive else BRACKETS):  # which has no other claims
                summary.brackets(local)
        except UNSTABLE:  # a step leads out of where the system is defined
            continue
    yield from summary.observations()


def _look(seen: Seen, local: Local, keeps: tuple[str, ...], rho: Reversal | None) -> None:
    """Enter into `seen` the claims that are exact or not, at one place."""
    place, method = local.place, local.place.method
    back = local_way_back(local)
    seen.enter("symmetric", "Phi_-h = Phi_h^-1: the way back", method.symmetric, back, place)
    constants = (*keeps, "Casimir") if method.symplectic else keeps
    bound_body = isinstance(place.base, ConstrainedBody) and method.symplectic
    for name, change in changes(local):
        claimed = any(name.startswith(claim) for claim in constants)
        claimed = claimed or (bound_body and name in ("constraint", "hidden constraint"))
        formula = "zero at every step" if "constraint" in name else "constant along the steps"
        seen.enter(name, formula, claimed, change, place)
    reverse = rho or turned_back
    if reverse(place.start) is None or not is_reversible(place, reverse) <= EXACT:
        return
    claimed = method.symmetric
    if isinstance(place.whole, Clocked):
        unequal = scale_reversal(place, reverse)
        law, formula = "time scale and reversal", "sigma(rho y) = sigma(y)"
        seen.enter(law, formula, rho is not None, unequal, place)
        claimed = claimed and unequal <= EXACT
    formula = "rho Phi_h rho = Phi_h^-1" + ("" if rho else ", rho turns momenta back")
    seen.enter("reversible", formula, claimed, local_reversal(local, reverse), place)
