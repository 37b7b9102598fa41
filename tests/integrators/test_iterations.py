"""How many iterations a step needs: a wrong first guess, a wrong extrapolation and a wrong slope
change no result, but they cost.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body, heavy_top, kirchhoff_body, quiet_body

import liemech as lm
from liemech import solvers
from liemech.formulas import sqrt, vec
from liemech.integrators import hamilton_jacobi, lie_rattle, variational

WIDE = np.array([[2.0, 0.3, 0.1], [0.3, 2.5, -0.2], [0.1, -0.2, 1.8]])


@lm.record
class Swung(lm.SeparableSystem):
    """A particle in the plane, in an anharmonic well."""

    degrees = 2

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * (p[0] * p[0] + 0.5 * p[1] * p[1])

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * (q @ q) + 0.2 * q[0] ** 4 + 0.3 * q[0] * q[1]


@lm.record
class Heavier(lm.ConstrainedSystem):
    """A particle on a sphere whose mass depends on where it is."""

    degrees = 3

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return (1.0 + 0.5 * q[0] * q[0]) * lm.dot(p, p) / 2.0 + q[2]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(lm.dot(q, q) - 1.0)


@lm.record
class Fast(Heavier):
    """A relativistic particle on a sphere: its velocity is not linear in the momentum."""

    split = True

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return sqrt(1.0 + p @ p) + q[2]


def particle() -> tuple[Any, Any]:
    system = Swung()
    return system, system.state([0.6, -0.2], [0.3, 0.8])


def full() -> tuple[Any, Any]:
    body = lm.RigidBody(WIDE)
    return body, body.state([0.4, -0.9, 0.7], np.eye(3))


def rod() -> tuple[Any, Any]:
    body = quiet_body([0.001, 1.0, 1.2])
    return body, body.state([0.001, 1.1, 0.4], np.eye(3))


def in_a_fluid() -> tuple[Any, Any]:
    return kirchhoff_body()[:2]


def on_a_sphere(system: Any) -> Callable[[], tuple[Any, Any]]:
    return lambda: (system, system.state([0.6, 0.0, -0.8], [0.4, 0.9, 0.3]))


def hanging() -> tuple[Any, Any]:
    chain = lm.ChainPendulum([1.0, 0.5], [1.0, 0.7], 9.81)
    return chain, chain.consistent([0.6, 0.0, -0.8, 0.6, 0.6, -1.1], [0.4, 0.9, 0.3, 0.0, 0.2, 0.0])


def jointed() -> tuple[Any, Any]:
    """A body in space that hangs on a rod."""
    body = lm.Linkage(
        [lm.Link(mass=2.0, inertia=[1.0, 1.5, 0.7])], [lm.RigidRod(0, None, vec(0.3, 0.1, 0.4), length=1.2)]
    )
    g = np.eye(4)
    g[:3, 3] = 0.5, 0.3, -1.3
    return body, body.assembled(g[None], [[0.3, 0.6, 1.1, 0.5, 0.2, 0.1]])


@lm.record
class Braked(lm.Force):
    """A torque against the velocity, of second degree."""

    def covector(self, t: float, xi: lm.Vec, g: lm.Element) -> lm.Vec:
        return -0.2 * (1.0 + xi @ xi) * xi


def braked() -> tuple[Any, Any]:
    return heavy_top(Braked())


def rolling() -> tuple[Any, Any]:
    body = lm.NonholonomicBody(lm.RigidBody(WIDE), lm.Suslov())
    return body, body.consistent([0.6, -0.9, 0.3], np.eye(3))


def counts(
    method: Any, made: Callable[[], tuple[Any, Any]], h: float, steps: int, monkeypatch: Any
) -> tuple[list[int], float]:
    """Evaluations in each of the first steps, and how far, relatively, the slopes at the guesses
    are from those of the residuals.
    """
    seen, worst = [0], [0.0]

    def watched(equation: Any) -> Any:
        def evaluated(*x: Any) -> Any:
            seen[-1] += 1
            return equation(*x)

        return evaluated

    def newton(equation: Any, guess: Any, *rest: Any, **options: Any) -> Any:
        way = vec(*np.random.default_rng(1).uniform(0.5, 1.0, len(guess)))
        e, slope = 1e-5, equation(guess)[1] @ way
        change = (equation(guess + e * way)[0] - equation(guess - e * way)[0]) / (2.0 * e)
        worst[0] = max(worst[0], abs(np.array(change - slope)).max() / abs(np.array(slope)).max())
        return solvers.newton(watched(equation), guess, *rest, **options)

    def fixed_point(sweep: Any, *rest: Any) -> Any:
        return solvers.fixed_point(watched(sweep), *rest)

    for name, module in tuple(sys.modules.items()):
        if name.startswith(("liemech.integrators", "liemech.systems")):
            for function in (newton, fixed_point):
                if hasattr(module, function.__name__):
                    monkeypatch.setattr(module, function.__name__, function)
    followed = variational.grown
    monkeypatch.setattr(variational, "grown", lambda eq, *rest: followed(watched(eq), *rest))
    for owner, name in (
        (lie_rattle.LieRATTLE, "_correction"),
        (hamilton_jacobi.HamiltonJacobi, "_tried"),
    ):
        monkeypatch.setattr(owner, name, watched(getattr(owner, name)))
    system, start = made()
    method.require(system)
    memory, found = method.start(system, start, h), []
    for k in range(steps):
        seen[-1] = 0
        memory = method.step(system, k * h, memory, h)
        found.append(seen[-1])
    return found, worst[0]


EXP, CAY = lm.Exponential(), lm.Cayley()
BALL = lm.SphericalPendulum()
COARSE = {
    (lm.LiePoissonHamiltonJacobi, 6): 2e-6,
    (lm.FirstKindHamiltonJacobi, 2): 0.06,
}
"""Methods whose slope is that of a lower order."""
CASES: list[Any] = [
    (lm.CovariantVariational(EXP), asymmetric_body, 0.3, [3, 3, 3, 3, 2]),
    (lm.CovariantVariational(CAY), full, 0.3, [3, 3, 3, 2, 2]),
    (lm.CovariantVariational(EXP), rod, 0.3, [31, 190, 294, 70, 132]),
    (lm.CovariantVariational(CAY), in_a_fluid, 0.2, [3, 3, 3, 3, 3]),
    (lm.CovariantVariational(EXP, lm.QuadratureLagrangian()), asymmetric_body, 0.3, [3, 3, 3]),
    (lm.MoserVeselov(), full, 0.3, [3, 3, 3, 2, 2]),
    (lm.ImplicitMidpoint(), full, 0.3, [3, 3, 3, 2, 2]),
    (lm.SphericalMidpoint(), full, 0.3, [3, 3, 3, 2, 2]),
    (lm.LiePoissonHamiltonJacobi(2, EXP), in_a_fluid, 0.2, [3, 3, 3, 2, 2]),
    (lm.LiePoissonHamiltonJacobi(4, EXP), asymmetric_body, 0.3, [3, 3, 3, 2, 2]),
    (lm.LiePoissonHamiltonJacobi(4, EXP), full, 0.3, [3, 3, 3, 2, 2]),
    (lm.LiePoissonHamiltonJacobi(4, CAY), asymmetric_body, 0.3, [3, 4, 3]),
    (lm.LiePoissonHamiltonJacobi(6, EXP), asymmetric_body, 0.3, [4, 4, 4]),
    (lm.FirstKindHamiltonJacobi(1), asymmetric_body, 0.1, [5, 5, 5]),
    (lm.FirstKindHamiltonJacobi(2), asymmetric_body, 0.1, [6, 7, 6]),
    (lm.FirstKindHamiltonJacobi(2, s0=lm.TraceOfAd()), asymmetric_body, 0.1, [19]),
    (lm.HamiltonJacobi(4), particle, 0.2, [5, 4, 4, 5, 5]),
    (lm.HamiltonJacobi(4, adjoint=True), particle, 0.2, [5, 5, 4, 5, 5]),
    (lm.HamiltonJacobi(3, kind="qQ"), particle, 0.2, [18, 15, 15]),
    (lm.HamiltonJacobi(3, True, "pP"), particle, 0.2, [25, 20]),
    (lm.RATTLE(), on_a_sphere(BALL), 0.05, [3, 3, 3, 2, 3]),
    (lm.RATTLE(), on_a_sphere(Fast()), 0.1, [5, 5, 5, 5, 5]),
    (lm.RATTLE(), on_a_sphere(Heavier()), 0.1, [4, 4, 4, 4, 4]),
    (lm.RATTLE(), hanging, 0.05, [3, 3, 3, 3, 3]),
    (lm.ConstrainedEuler(), on_a_sphere(Heavier()), 0.1, [4, 5, 4, 4, 4]),
    (lm.ConstrainedEuler("drift"), on_a_sphere(Heavier()), 0.1, [4, 5, 4, 4, 4]),
    (lm.LieRATTLE(), jointed, 0.05, [4, 3, 4, 3, 3]),
    (lm.LieRATTLE(CAY), jointed, 0.05, [4, 3, 4, 3, 3]),
    (lm.LagrangeDAlembert(), rolling, 0.1, [3, 2, 3, 2, 2]),
    (lm.KickDrift(), braked, 0.1, [3, 3, 3, 3, 3]),
    (lm.Isospectral(4), full, 0.3, [15, 15, 15, 12, 11]),
    (lm.Isospectral(8), asymmetric_body, 0.3, [15, 15, 15, 12, 12]),
    (lm.LobattoPair(4), hanging, 0.05, [6, 6, 6, 6, 7]),
    (lm.LobattoPair(6), on_a_sphere(Heavier()), 0.1, [8, 8, 8, 8, 8]),
    (lm.GalerkinVariational(4), asymmetric_body, 0.3, [7, 7, 7, 7, 6]),
    (lm.GalerkinVariational(6), heavy_top, 0.05, [5, 5, 5, 5, 5]),
    (lm.RKMK(tableau=lm.tableaus.gauss(2)), asymmetric_body, 0.3, [11, 11, 11, 11, 11]),
]


@pytest.mark.parametrize(("method", "made", "h", "wanted"), CASES, ids=[f"{c[0]!r}" for c in CASES])
def test_steps_need_few_iterations(
    method: Any, made: Any, h: float, wanted: list[int], monkeypatch: Any
) -> None:
    """As many evaluations in each of the first steps as a right guess and a right slope need; and
    at the guess the slope is that of the residual, but for those methods that take a cheaper one.
    """
    found, off = counts(method, made, h, len(wanted), monkeypatch)
    assert found == wanted
    assert off < COARSE.get((type(method), method.order), 1e-9)
