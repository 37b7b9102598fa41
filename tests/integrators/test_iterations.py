"""How many iterations a step needs: a wrong first guess, a wrong extrapolation and a wrong slope
change no result, but they cost.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import asymmetric_body, heavy_top, kirchhoff_body, quiet_body

import liemech as lm
from liemech import solvers
from liemech.errors import NoConvergence
from liemech.formulas import sqrt, vec
from liemech.integrators import variational
from liemech.rooms.constraints import lie_rattle
from liemech.rooms.hamilton_jacobi import hamilton_jacobi

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
    chain = lm.models.ChainPendulum([1.0, 0.5], [1.0, 0.7], 9.81)
    return chain, chain.consistent([0.6, 0.0, -0.8, 0.6, 0.6, -1.1], [0.4, 0.9, 0.3, 0.0, 0.2, 0.0])


def jointed() -> tuple[Any, Any]:
    """A body in space that hangs on a rod."""
    body = lm.joints.Linkage(
        [lm.joints.Link(mass=2.0, inertia=[1.0, 1.5, 0.7])],
        [lm.joints.RigidRod(0, None, vec(0.3, 0.1, 0.4), length=1.2)],
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


def in_fictive_time() -> tuple[Any, Any]:
    system = lm.TimeTransformed(lm.Kepler(), lm.time_scales.DistancePower(1.5))
    start = lm.Kepler().pericentre(0.6)
    return system.bound(start), system.extended(start, 0.0)


def rolling() -> tuple[Any, Any]:
    body = lm.NonholonomicBody(lm.RigidBody(WIDE), lm.joints.Suslov())
    return body, body.consistent([0.6, -0.9, 0.3], np.eye(3))


def flat(x: Any) -> np.ndarray:
    """All numbers of unknowns."""
    if x is None:
        return np.zeros(0)
    if isinstance(x, tuple | list):
        return np.concatenate([flat(part) for part in x])
    return np.array(x, dtype=float).ravel()


def watched(
    method: Any, made: Callable[[], tuple[Any, Any]], h: float, steps: int, monkeypatch: Any
) -> tuple[list[int], list[float], float]:
    """Of the first steps: evaluations; how far the guesses were from the roots, beside these; and
    how far, relatively, the slopes at the guesses are from those of the residuals.
    """
    seen, far, worst = [0], [0.0], [0.0]

    def counted(equation: Any) -> Any:
        def evaluated(*x: Any) -> Any:
            seen[-1] += 1
            return equation(*x)

        return evaluated

    def measured(guess: Any, root: Any) -> Any:
        x, y = flat(guess), flat(root)
        far[-1] += float(np.abs(x - y).max() / np.abs(y).max())

    def newton(equation: Any, guess: Any, *rest: Any, **options: Any) -> Any:
        way = vec(*np.random.default_rng(1).uniform(0.5, 1.0, len(guess)))
        e, slope = 1e-5, equation(guess)[1] @ way
        change = (equation(guess + e * way)[0] - equation(guess - e * way)[0]) / (2.0 * e)
        worst[0] = max(worst[0], abs(np.array(change - slope)).max() / abs(np.array(slope)).max())
        found = solvers.newton(counted(equation), guess, *rest, **options)
        measured(guess, found[0])
        return found

    def fixed_point(sweep: Any, guess: Any, *rest: Any) -> Any:
        found = solvers.fixed_point(counted(sweep), guess, *rest)
        measured(guess, found)
        return found

    def solved(self: Any, system: Any, h: float, memory: Any, guess: Any) -> Any:
        found = exactly(self, system, h, memory, guess)
        measured(guess, found)
        return found

    for name, module in tuple(sys.modules.items()):
        if name.startswith(("liemech.integrators", "liemech.systems", "liemech.rooms", "liemech.joints")):
            for function in (newton, fixed_point):
                if hasattr(module, function.__name__):
                    monkeypatch.setattr(module, function.__name__, function)
    followed, exactly = variational.grown, lie_rattle.LieRATTLE._solved
    monkeypatch.setattr(variational, "grown", lambda eq, *rest: followed(counted(eq), *rest))
    monkeypatch.setattr(lie_rattle.LieRATTLE, "_solved", solved)
    for owner, name in (
        (lie_rattle.LieRATTLE, "_correction"),
        (hamilton_jacobi.HamiltonJacobi, "_tried"),
        (lm.time_scales.DistancePower, "value"),
    ):
        monkeypatch.setattr(owner, name, counted(getattr(owner, name)))
    system, start = made()
    method.require(system)
    memory, counts, distances = method.start(system, start, h), [], []
    for k in range(steps):
        seen[-1], far[-1] = 0, 0.0
        memory = method.step(system, k * h, memory, h)
        counts.append(seen[-1])
        distances.append(far[-1])
    return counts, distances, worst[0]


EXP, CAY = lm.Exponential(), lm.Cayley()
BALL, SPLIT = lm.SphericalPendulum(), lm.KickDrift(lm.CovariantVariational(EXP))
COARSE = {(lm.LiePoissonHamiltonJacobi, 6): 2e-6, (lm.FirstKindHamiltonJacobi, 2): 0.06}
"""Methods whose slope is that of a lower order."""
CASES: list[Any] = [
    (lm.CovariantVariational(EXP), asymmetric_body, 0.3, [3, 3, 3, 3, 2], (0.021, 0.000519)),
    (lm.CovariantVariational(CAY), full, 0.3, [3, 3, 3, 2, 2], (0.018, 3.32e-05)),
    (lm.CovariantVariational(EXP), rod, 0.3, [31, 190, 294, 70, 132], (1.77, 0.45)),
    (lm.CovariantVariational(CAY), in_a_fluid, 0.2, [3, 3, 3, 3, 3], (0.0856, 0.00484)),
    (lm.CovariantVariational(EXP, lm.QuadratureLagrangian()), asymmetric_body, 0.3, [3, 3, 3], (0.0204, 0.0195)),
    (lm.MoserVeselov(), full, 0.3, [3, 3, 3, 2, 2], (0.0238, 3.55e-05)),
    (lm.ImplicitMidpoint(), full, 0.3, [3, 3, 3, 2, 2], (0.0114, 2.84e-05)),
    (lm.SphericalMidpoint(), full, 0.3, [3, 3, 3, 2, 2], (0.0114, 2.84e-05)),
    (lm.LiePoissonHamiltonJacobi(2, EXP), in_a_fluid, 0.2, [3, 3, 3, 2, 2], (0.0518, 0.000478)),
    (lm.LiePoissonHamiltonJacobi(4, EXP), asymmetric_body, 0.3, [3, 3, 3, 2, 2], (0.025, 4.82e-05)),
    (lm.LiePoissonHamiltonJacobi(4, EXP), full, 0.3, [3, 3, 3, 2, 2], (0.0113, 2.44e-06)),
    (lm.LiePoissonHamiltonJacobi(4, CAY), asymmetric_body, 0.3, [3, 4, 3], (0.0302, 0.0302)),
    (lm.LiePoissonHamiltonJacobi(6, EXP), asymmetric_body, 0.3, [4, 4, 4], (0.025, 0.0246)),
    (lm.FirstKindHamiltonJacobi(1), asymmetric_body, 0.1, [5, 5, 5], (0.0335, 0.0329)),
    (lm.FirstKindHamiltonJacobi(2), asymmetric_body, 0.1, [6, 7, 6], (0.0325, 0.0319)),
    (lm.FirstKindHamiltonJacobi(2, s0=lm.class_functions.TraceOfAd()), asymmetric_body, 0.1, [19], (0.228, 0.228)),
    (lm.HamiltonJacobi(4), particle, 0.2, [5, 4, 4, 5, 5], (0, 0)),
    (lm.HamiltonJacobi(4, adjoint=True), particle, 0.2, [5, 5, 4, 5, 5], (0, 0)),
    (lm.HamiltonJacobi(3, kind="qQ"), particle, 0.2, [18, 15, 15], (0.563, 0.575)),
    (lm.HamiltonJacobi(3, True, "pP"), particle, 0.2, [25, 20], (0.32, 0.241)),
    (lm.RATTLE(), on_a_sphere(BALL), 0.05, [3, 3, 3, 2, 3], (0.0142, 0.00167)),
    (lm.RATTLE(), on_a_sphere(Fast()), 0.1, [5, 5, 5, 5, 5], (0.012, 0.00306)),
    (lm.RATTLE(), on_a_sphere(Heavier()), 0.1, [4, 4, 4, 4, 4], (0.0119, 0.00631)),
    (lm.RATTLE(), hanging, 0.05, [3, 3, 3, 3, 3], (0.00895, 0.0292)),
    (lm.ConstrainedEuler(), on_a_sphere(Heavier()), 0.1, [4, 5, 4, 4, 4], (0.207, 0.0205)),
    (lm.ConstrainedEuler("drift"), on_a_sphere(Heavier()), 0.1, [4, 5, 4, 4, 4], (0.212, 0.0119)),
    (lm.LieRATTLE(), jointed, 0.05, [4, 3, 4, 3, 3], (0.0303, 0.00326)),
    (lm.LieRATTLE(CAY), jointed, 0.05, [4, 3, 4, 3, 3], (0.0303, 0.00325)),
    (lm.LieRATTLE(), jointed, 0.2, [5, 5, 11], (0.12, 0.318)),
    (SPLIT, heavy_top, 0.1, [3, 3, 3, 3, 3], (0.0282, 0.000599)),
    (lm.LagrangeDAlembert(), rolling, 0.1, [3, 2, 3, 2, 2], (0.00262, 2.59e-07)),
    (lm.KickDrift(), braked, 0.1, [3, 3, 3, 3, 3], (0.108, 0.0609)),
    (lm.Isospectral(4), full, 0.3, [15, 15, 15, 12, 11], (0.156, 3.93e-05)),
    (lm.Isospectral(8), asymmetric_body, 0.3, [15, 15, 15, 12, 12], (0.275, 0.000574)),
    (lm.LobattoPair(4), hanging, 0.05, [6, 6, 6, 6, 7], (1, 1)),
    (lm.LobattoPair(6), on_a_sphere(Heavier()), 0.1, [8, 8, 8, 8, 8], (1, 0.892)),
    (lm.GalerkinVariational(4), asymmetric_body, 0.3, [7, 7, 7, 7, 6], (0.0319, 0.000545)),
    (lm.GalerkinVariational(6), heavy_top, 0.05, [5, 5, 5, 5, 5], (0.0243, 0.0113)),
    (lm.GalerkinVariational(8), full, 0.3, [6, 7, 7, 5, 5], (0.0318, 3.67e-05)),
    (lm.GalerkinVariational(6), in_a_fluid, 0.3, [8, 9, 9, 9, 8], (0.224, 0.0172)),
    (lm.GalerkinVariational(4, CAY), braked, 0.2, [17, 15, 14, 12, 11], (0.181, 0.149)),
    (lm.AdaptiveVerlet(), in_fictive_time, 0.1, [4, 4, 4, 4, 4], (0, 0)),
    (lm.RKMK(tableau=lm.tableaus.CROUZEIX3), asymmetric_body, 0.3, [16, 15, 15, 15, 15], (0.0354, 0.0218)),
    (lm.RKMK(tableau=lm.tableaus.gauss(2)), asymmetric_body, 0.3, [11, 11, 11, 11, 11], (0.0319, 0.0223)),
]


@pytest.mark.parametrize(("method", "made", "h", "wanted", "far"), CASES, ids=[f"{c[0]!r}" for c in CASES])
def test_steps_need_few_iterations(
    method: Any, made: Any, h: float, wanted: list[int], far: tuple[float, float], monkeypatch: Any
) -> None:
    """As many evaluations in each of the first steps as a right guess and a right slope need; the
    first guess and the last, extrapolated one are as near to the root as right ones are; and at the
    guess the slope is that of the residual, but for those methods that take a cheaper one.
    """
    found, distances, off = watched(method, made, h, len(wanted), monkeypatch)
    assert found == wanted
    assert (distances[0], distances[-1]) == pytest.approx(far, rel=0.02)
    assert off < COARSE.get((type(method), getattr(method, "order", None)), 1e-9)


# ---------------------------------------------------------------- data in two units


class Swept:
    """Sweeps of a number of size 1 and one of size 1e-13 in another unit, which changes so."""

    def __init__(self, changes: Callable[[int], float]) -> None:
        self.changes, self.count = changes, 0

    def __call__(self, x: float) -> tuple[float, lm.Vec, lm.Vec]:
        self.count += 1
        return x, lm.vec(2.0**-53 * (self.count % 2), self.changes(self.count)), lm.vec(1.0, 1e-13)


def test_what_cancels_in_one_unit_ends_when_it_becomes_no_smaller() -> None:
    """A force that is zero but for rounding changes by its own size in every sweep."""
    noise = Swept(lambda n: 5e-15 * (1.0 + 0.3 * math.sin(17.0 * n)))
    assert solvers.fixed_point(noise, 1.0, lm.RKMK(order=4), 0.1) == 1.0
    assert noise.count <= 3 * solvers.STALLED


def test_what_is_small_beside_another_unit_is_iterated_to_its_own_rounding() -> None:
    """A change of 1e-13 beside 1 is no rounding as long as it shrinks."""
    slow = Swept(lambda n: 1e-14 * 0.4**n)
    solvers.fixed_point(slow, 1.0, lm.RKMK(order=4), 0.1)
    assert 0.4**slow.count < 2.0**-40


def test_a_small_unit_that_grows_is_no_rounding() -> None:
    growing = Swept(lambda n: 1e-14 * 1.3**n)
    with pytest.raises(NoConvergence):
        solvers.fixed_point(growing, 1.0, lm.RKMK(order=4), 0.1)
