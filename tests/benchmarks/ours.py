"""The free rigid body and the heavy top by the methods of this library."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import peers
from peers import TIGHTEST, Contender, Problem, Result, Run, doubled, tolerances
from problems import REFERENCE, numbers

import liemech as lm
from liemech.tableaus import explicit, flows, pairs

TABLEAUS = {
    "RK4": explicit.RK4,
    "DP5": pairs.DORMAND_PRINCE5,
    "Tsit5": pairs.TSITOURAS5,
    "Butcher6": explicit.BUTCHER6,
    "Verner6": pairs.VERNER6,
    "Verner7": pairs.VERNER7,
    "DOP853": pairs.DOP853,
}
"""Of the Munthe-Kaas methods with fixed steps; those with an embedded method run with adaptive steps too."""


@dataclass(frozen=True)
class Place:
    """A system of this library for a problem, and where it starts."""

    system: Any
    start: Any


def place(problem: Problem) -> Place:
    """A rigid body, or a heavy top on SO(3)."""
    with warnings.catch_warnings(action="ignore", category=lm.errors.InertiaWarning):
        body = (
            lm.models.HeavyTop(problem.inertia, 1.0, problem.load) if problem.heavy else lm.RigidBody(problem.inertia)
        )
    return Place(body, body.state(mu=problem.mu, g=peers.result(problem.start)[1]))


def turning(problem: Problem) -> Place:
    """The rigid body with a quaternion for its attitude."""
    with warnings.catch_warnings(action="ignore", category=lm.errors.InertiaWarning):
        body = lm.RigidBody(problem.inertia, group=lm.UnitQuaternions())
    return Place(body, body.state(mu=problem.mu, g=np.roll(problem.quaternion, -1)))


def reduced(problem: Problem) -> Place:
    """The top on se(3)*, as a Lie-Poisson system."""
    top = place(problem)
    return Place(top.system.reduced, top.system.reduced.from_top(top.start))


def reference(problem: Problem) -> Result:
    """Momentum and attitude at the last time: the exact motion of a free body, for the top digits from elsewhere."""
    end = problem.times[-1]
    if not problem.heavy:
        body = place(problem)
        exact = body.system.exact(body.start, end)
        return np.array(exact.mu), np.array(exact.g)
    sample = next(s for s in REFERENCE["samples"] if float(s["t"]) == end)
    return numbers("pi", sample), numbers("R", sample)


def ours(problem: Problem) -> list[Contender]:
    """The methods of this library that are for a problem."""
    return [*symplectic(problem), *classical(problem)]


# ------------------------------------------------------------------ which methods, with which numbers of steps


def symplectic(problem: Problem) -> list[Contender]:
    """Methods that keep the Poisson bracket, and the energy without drift."""
    found = []

    def add(name: str, method: Any, settings: tuple[float, ...], at: Callable[[Problem], Place] = place) -> None:
        found.append(Contender("liemech, symplectic", name, settings, partial(_steps, method=method, at=at)))

    first, kind = ("Lie-Verlet", lm.LieVerlet) if problem.heavy else ("Algorithm 1", lm.CovariantVariational)
    dual = reduced if problem.heavy else place
    for label, retraction, orders in (("exp", lm.Exponential(), (4, 6, 8)), ("Cayley", lm.Cayley(), (4, 6))):
        add(f"{first}, {label}", kind(retraction), doubled(256, 12))
        for order in orders:
            add(
                f"{first}, {label}, composed to {order}", lm.Composition(kind(retraction), order=order), doubled(16, 12)
            )
        add(
            f"Hamilton-Jacobi 4, {label}",
            lm.LiePoissonHamiltonJacobi(order=4, retraction=retraction),
            doubled(32, 12),
            dual,
        )
    for order in (6, 8):
        add(f"Hamilton-Jacobi {order}, exp", lm.LiePoissonHamiltonJacobi(order=order), doubled(32, 9), dual)
    add(
        "Hamilton-Jacobi 4, exp, composed to 6",
        lm.Composition(lm.LiePoissonHamiltonJacobi(), order=6),
        doubled(16, 10),
        dual,
    )
    for order in (4, 6, 8):
        add(f"Galerkin {order}", lm.GalerkinVariational(order), doubled(32, 12 - order // 2))
    if problem.heavy:
        for order in (2, 4, 6, 8):
            add(f"kicks and exact drifts, order {order}", lm.KickDrift(order=order), doubled(512 >> order, 14 - order))
    else:
        add("exact", lm.ExactFreeBody(), doubled(16, 4))
        add("three rotations", lm.ThreeRotations(), doubled(256, 12))
        add("three rotations, composed to 8", lm.Composition(lm.ThreeRotations(), order=8), doubled(16, 12))
        found.append(Contender("liemech, symplectic", "Moser-Veselov, fitted", doubled(16, 6), _fitted))
    return found


def classical(problem: Problem) -> list[Contender]:
    """Methods that keep group and coadjoint orbit, and the rest to their order."""
    found = []

    def add(
        name: str, method: Any, settings: tuple[float, ...], at: Callable[[Problem], Place], adaptive: bool
    ) -> None:
        found.append(Contender("liemech", name, settings, partial(_steps, method=method, at=at)))
        if adaptive:
            within = (*tolerances(-2, -13), TIGHTEST)
            found.append(Contender("liemech", f"{name}, adaptive", within, partial(_adaptive, method=method, at=at)))

    for on, at in {"": place, ", se(3)*": reduced}.items():
        if at is reduced and not problem.heavy:
            continue
        for name, tableau in TABLEAUS.items():
            steps = doubled(2048 >> tableau.order, 17 - tableau.order)
            add(f"RKMK {name}{on}", lm.RKMK(tableau=tableau), steps, at, bool(tableau.b_hat) and at is place)
        if at is reduced or not problem.heavy:
            add(f"Taylor 12{on}", lm.Taylor(12), doubled(16, 8), at, True)
            add(f"Taylor 18{on}", lm.Taylor(18), doubled(16, 8), at, True)
        if not problem.heavy:
            add("Taylor 12, quaternion", lm.Taylor(12), doubled(16, 8), turning, True)
            add("Taylor 18, quaternion", lm.Taylor(18), doubled(16, 8), turning, True)
            add("RKMK DOP853, quaternion", lm.RKMK(tableau=TABLEAUS["DOP853"]), doubled(16, 9), turning, True)
    add("commutator-free 4", lm.CommutatorFree(order=4), doubled(128, 13), place, False)
    add("commutator-free CK4", lm.CommutatorFree(tableau=flows.CARPENTER_KENNEDY4), doubled(128, 13), place, False)
    return found


# ------------------------------------------------------------------ runs


def _steps(problem: Problem, setting: float, method: Any, at: Callable[[Problem], Place]) -> Run:
    return _run(
        problem, at(problem), method, lambda span: dict.fromkeys(("steps", "every"), problem.steps(setting, span))
    )


def _adaptive(problem: Problem, tolerance: float, method: Any, at: Callable[[Problem], Place]) -> Run:
    return _run(problem, at(problem), method, lambda span: {"rtol": tolerance, "atol": tolerance, "dense": False})


def _fitted(problem: Problem, setting: float) -> Run:
    h, body = problem.times[-1] / problem.steps(setting, problem.times[-1]), place(problem)
    return _steps(problem, setting, lm.ExactMoserVeselov.of(body.system, body.start, h), place)


def _run(problem: Problem, at: Place, method: Any, options_for: Callable[[float], dict[str, Any]]) -> Run:
    """Plans are prepared once, for each length of time, as an integrator of heyoka is."""
    prepared: list[tuple[float, lm.Plan, dict[str, Any]]] = []
    for begin, end in problem.spans:
        span, options = end - begin, options_for(end - begin)
        steps = options.pop("steps", None)
        length = {"steps": steps} if steps else {"t_end": span}
        step = {"h": span / steps} if steps else {}
        prepared.append((end, lm.Plan(at.system, method, **step, **options, compiled=True, progress=False), length))

    def run() -> list[Result]:
        start, found = at.start, []
        for end, plan, length in prepared:
            motion: Any = plan.run(start, **length)
            mu, g = motion.mu[-1], motion.g[-1]
            found.append((mu[:3], g[:3, :3] if g.ndim == 2 else _matrix(g)))
            if end < problem.times[-1]:
                start = at.system.state(mu=mu, g=g)
        return found

    return run


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    """The rotation matrix; here the scalar part is the last, with other packages the first."""
    return peers.result(np.array([0.0, 0.0, 0.0, *np.roll(quaternion, 1)]))[1]
