"""Time-transformed canonical systems: orders, symplectic steps, exact orbits, equivalences and refusals."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidTimeScale, NoConvergence
from liemech.rooms.fictive_time.time_transformed import ExtendedSystem
from liemech.tableaus import KAHAN_LI6, SplittingTableau

KEPLER = lm.Kepler()
ORBIT = KEPLER.pericentre(0.6)
TIME = 7.3
GAUSS4 = lm.RKMK(tableau=lm.tableaus.gauss(2))
LOGARITHMIC = lm.LogarithmicHamiltonian(KEPLER)


def transformed(sigma: Any = None) -> lm.TimeTransformed:
    return lm.TimeTransformed(KEPLER, lm.time_scales.DistancePower(1.5) if sigma is None else sigma)


def slopes(error: Callable[[float], float], h: float) -> list[float]:
    errors = [error(h / 2**k) for k in range(3)]
    return [math.log2(a / b) for a, b in itertools.pairwise(errors)]


@lm.record
class Constant(lm.TimeScale):
    """Fixed steps, in another unit."""

    parts: ClassVar[tuple[str, ...] | None] = ("q",)

    unit: float

    def value(self, system: Any, state: Any) -> float:
        return self.unit


@lm.record
class Pendula(lm.SeparableSystem):
    """Two planar pendula on a common spring, with unequal masses and a constant drive of the
    momenta: T is not homogeneous.
    """

    degrees: ClassVar[int] = 2

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] ** 2 + 0.25 * p[1] ** 2 + 0.3 * p[0] * p[1] + 0.1 * p[0] - 0.2

    def potential(self, q: lm.Vec) -> float:
        return -lm.formulas.cos(q[0]) - 2.0 * lm.formulas.cos(q[1]) + 0.5 * (q[0] - q[1]) ** 2


def sway(q: lm.Vec) -> float:
    return 1.0 / (1.0 + 0.5 * q[0] ** 2 + 0.2 * q[0] * q[1] + q[1] ** 2)


@pytest.mark.parametrize(
    ("system", "method", "order", "h"),
    [
        (transformed(), lm.AdaptiveVerlet(), 2, 0.08),
        pytest.param(transformed(lm.time_scales.EqualChange()), lm.AdaptiveVerlet(), 2, 0.08, marks=pytest.mark.slow),
        (transformed(lm.time_scales.EqualPath()), lm.AdaptiveVerlet(), 2, 0.04),
        (transformed(), lm.Composition(lm.AdaptiveVerlet(), order=4), 4, 0.16),
        pytest.param(transformed(), lm.Composition(lm.AdaptiveVerlet(), order=6), 6, 0.16, marks=pytest.mark.slow),
        pytest.param(transformed(lm.time_scales.EqualArc()), GAUSS4, 4, 0.32, marks=pytest.mark.slow),
        (LOGARITHMIC, lm.StormerVerlet(), 2, 0.08),
        (LOGARITHMIC, lm.Splitting(order=4, quadratic=False), 4, 0.16),
        (LOGARITHMIC, lm.Splitting(order=6, quadratic=False), 6, 0.16),
    ],
    ids=repr,
)
def test_order_at_a_physical_time(system: Any, method: lm.Method, order: int, h: float) -> None:
    exact = KEPLER.exact(ORBIT, TIME)

    def error(h: float) -> float:
        run = lm.integrate(system, method, ORBIT, h=h, t_end=TIME, compiled=False)
        assert run.t[-1] == TIME and run.system is KEPLER
        return float(np.abs(run.q[-1] - exact.q).max())

    assert min(slopes(error, h)) > order - 0.2


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [lm.time_scales.EqualArc(), lambda q, p: 1.0 / (1.0 + lm.dot(p, p))])
def test_order_of_hamilton_jacobi_methods(sigma: Any) -> None:
    """Implicit, for a sigma of positions and momenta."""
    exact = KEPLER.exact(ORBIT, 3.0)

    def error(h: float) -> float:
        run = lm.integrate(transformed(sigma), lm.HamiltonJacobi(order=4), ORBIT, h=h, t_end=3.0)
        return float(np.abs(run.q[-1] - exact.q).max())

    assert min(slopes(error, 0.08)) > 3.8


def test_order_for_a_general_kinetic_energy_of_second_degree() -> None:
    system, t = Pendula(), 2.0
    start = system.state(q=[1.0, -0.4], p=[0.3, 0.8])
    end = lm.integrate(system, lm.RKMK(order=8), start, h=0.02, steps=100, compiled=False).q[-1]

    def error(h: float) -> float:
        run = lm.integrate(lm.TimeTransformed(system, sway), lm.AdaptiveVerlet(), start, h=h, t_end=t, compiled=False)
        return float(np.abs(run.q[-1] - end).max())

    assert min(slopes(error, 0.2)) > 1.9


def tangent(system: Any, method: lm.Method, start: Any, h: float) -> np.ndarray:
    """The derivative of a step, by differences of the fourth order."""
    n = len(start.q)

    def step(y: np.ndarray) -> np.ndarray:
        memory = method.start(system, lm.CanonicalState(lm.vec(*y[:n]), lm.vec(*y[n:])), h)
        after = method.observe(method.step(system, 0.0, memory, h))
        return np.array([*after.q, *after.p])

    y, d = np.array([*start.q, *start.p]), 1e-3
    columns = []
    for e in np.eye(2 * n):
        a, b, c = ((step(y + k * d * e) - step(y - k * d * e)) / (2 * k * d) for k in (1, 2, 4))
        columns.append((64 * a - 20 * b + c) / 45)
    return np.transpose(columns)


@pytest.mark.parametrize(
    ("system", "method"),
    [
        (transformed(), lm.AdaptiveVerlet()),
        (transformed(lm.time_scales.EqualChange()), lm.AdaptiveVerlet()),
        pytest.param(transformed(lm.time_scales.EqualArc()), GAUSS4, marks=pytest.mark.slow),
        pytest.param(
            transformed(lambda q, p: 1.0 / (1.0 + lm.dot(p, p))), lm.HamiltonJacobi(order=2), marks=pytest.mark.slow
        ),
        (LOGARITHMIC, lm.StormerVerlet()),
        (LOGARITHMIC, lm.Splitting(order=4, quadratic=False)),
    ],
    ids=repr,
)
def test_a_step_is_symplectic_with_time_and_energy(system: Any, method: lm.Method) -> None:
    start = KEPLER.state(q=[0.5, 0.3], p=[-0.4, 1.0])
    whole = system.bound(start)
    point = whole.extended(start, 0.2)
    point = lm.CanonicalState(point.q, point.p + lm.vec(0.0, 0.0, 0.05))  # off the level K = 0 too
    M = tangent(whole, method, point, 0.1)
    J = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(3))
    assert np.abs(M.T @ J @ M - J).max() < 1e-8
    assert np.abs(M - np.eye(6)).max() > 0.05


def test_the_reversible_controller_is_not_symplectic() -> None:
    """The measure above sees it: as a map of (q, p) its step, whose length depends on the place, is not."""
    whole = transformed().bound(ORBIT)

    class Varied:
        def start(self, system: Any, state: Any, h: float) -> Any:
            return state

        def observe(self, state: Any) -> Any:
            return state

        def step(self, system: Any, t: float, state: Any, h: float) -> Any:
            verlet, dt = lm.StormerVerlet(), h * whole.sigma.value(KEPLER, state)
            return verlet.observe(verlet.step(KEPLER, 0.0, verlet.start(KEPLER, state, dt), dt))

    M = tangent(KEPLER, Varied(), KEPLER.state(q=[0.5, 0.3], p=[-0.4, 1.0]), 0.1)  # type: ignore[arg-type]
    J = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(2))
    assert np.abs(M.T @ J @ M - J).max() > 1e-3


@pytest.mark.parametrize("method", [lm.AdaptiveVerlet(), lm.Composition(lm.AdaptiveVerlet(), order=4)], ids=repr)
def test_symmetric(method: lm.Method) -> None:
    whole = transformed().bound(ORBIT)
    start = whole.extended(ORBIT, 0.0)

    def walk(state: Any, h: float) -> Any:
        memory = method.start(whole, state, h)
        for _ in range(30):
            memory = method.step(whole, 0.0, memory, h)
        return method.observe(memory)

    there = walk(start, 0.1)
    back = walk(there, -0.1)
    assert abs(there.q - start.q)[0] > 0.1
    assert max(*abs(back.q - start.q), *abs(back.p - start.p)) < 1e-13


def test_a_constant_sigma_is_no_transformation() -> None:
    run = lm.integrate(transformed(Constant(0.25)), lm.AdaptiveVerlet(), ORBIT, h=0.5, steps=60, compensated=False)
    plain = lm.integrate(KEPLER, lm.StormerVerlet(), ORBIT, h=0.125, steps=60, compensated=False)
    assert np.abs(run.q - plain.q).max() < 1e-13 and np.array_equal(run.t, plain.t)


def test_the_logarithmic_hamiltonian_is_its_formula() -> None:
    whole = LOGARITHMIC.bound(ORBIT)
    point = whole.extended(KEPLER.state(q=[0.5, 0.3], p=[-0.4, 1.0]), 0.2)
    assert abs(whole.energy(point.q, point.p)) < 1e-15  # zero on the motion
    by_p, by_q = lm.gradient(whole.kinetic, point.p), lm.gradient(whole.potential, point.q)
    assert max(abs(by_p - whole.velocity(point.q, point.p))) < 1e-14
    assert max(abs(by_q + whole.force(point.q, point.p))) < 1e-14
    derived = lm.SeparableSystem.relative_force(KEPLER, lm.vec(0.5, 0.3))
    assert max(abs(KEPLER.relative_force(lm.vec(0.5, 0.3)) - derived)) < 1e-15
    for sigma in (lm.time_scales.DistancePower(1.5), lm.time_scales.EqualArc(), lm.time_scales.EqualChange()):
        system = transformed(sigma).bound(ORBIT)
        p = point.p + lm.vec(0.0, 0.0, 0.1)
        for closed, derived in (
            (system.velocity(point.q, p), lm.gradient(lambda x: system.energy(point.q, x), p)),  # noqa: B023
            (system.force(point.q, p), -lm.gradient(lambda x: system.energy(x, p), point.q)),  # noqa: B023
        ):
            assert max(abs(closed - derived)) < 1e-13 * max(abs(derived))


@pytest.mark.parametrize(
    "method",
    [
        lm.StormerVerlet(first="drift"),
        lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI6).exchanged),
        lm.Composition(lm.StormerVerlet(first="drift"), order=4),
    ],
    ids=lambda m: m.name,
)
def test_orbits_of_the_logarithmic_hamiltonian_are_exact(method: lm.Method) -> None:
    """Drift first, every place is on the ellipse: only the time at which it is reached has an error."""
    run = lm.integrate(LOGARITHMIC, method, KEPLER.pericentre(0.9), h=0.3, steps=300)
    report = run.drift()
    assert [report[name].verdict for name in ("energy", "angular momentum", "Runge-Lenz vector")] == ["exact"] * 3
    other = lm.integrate(LOGARITHMIC, lm.StormerVerlet(), KEPLER.pericentre(0.9), h=0.3, steps=300)
    assert other.drift()["Runge-Lenz vector"].largest > 1e-3


def test_an_ensemble_has_an_energy_for_each_member() -> None:
    starts = KEPLER.state(np.outer([1.0, 1.05, 1.1], [0.4, 0.0]), np.repeat([[0.0, 2.0]], 3, axis=0))
    for system in (transformed(), LOGARITHMIC):
        method = lm.AdaptiveVerlet() if isinstance(system, lm.TimeTransformed) else lm.StormerVerlet()
        many = lm.integrate(system, method, starts, h=0.05, steps=40, compiled=False)
        for i in range(3):
            one = lm.integrate(system, method, KEPLER.state(starts.q[i], starts.p[i]), h=0.05, steps=40, compiled=False)
            assert np.array_equal(one.q, many.q[:, i]) and np.array_equal(one.t, many.t[:, i])


# ------------------------------------------------------------------ refusals


def test_what_is_refused() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    with pytest.raises(IncompatibleSystem, match="ReversibleController"):
        lm.TimeTransformed(body, lm.time_scales.EqualArc())
    with pytest.raises(IncompatibleSystem, match="SeparableSystem"):
        lm.LogarithmicHamiltonian(lm.models.DoublePendulum())
    with pytest.raises(IncompatibleSystem):
        lm.TimeTransformed(transformed(), lm.time_scales.EqualArc())
    with pytest.raises(IncompatibleSystem, match="AdaptiveVerlet"):  # a sum no longer
        lm.integrate(transformed(), lm.StormerVerlet(), ORBIT, h=0.1, steps=3)
    with pytest.raises(IncompatibleSystem, match="TimeTransformed"):
        lm.integrate(KEPLER, lm.AdaptiveVerlet(), ORBIT, h=0.1, steps=3)
    with pytest.raises(IncompatibleSystem, match="sigma of q alone"):
        lm.integrate(transformed(lm.time_scales.EqualArc()), lm.AdaptiveVerlet(), ORBIT, h=0.1, steps=3)
    with pytest.raises(IncompatibleSystem, match="second degree"):
        lm.integrate(LOGARITHMIC, lm.Splitting(order=4), ORBIT, h=0.1, steps=3)
    with pytest.raises(IncompatibleSystem, match="one of them will do"):
        controller = lm.ReversibleController(lm.AdaptiveVerlet(), lm.time_scales.EqualArc())
        lm.integrate(transformed(), controller, ORBIT, h=0.1, steps=3)
    with pytest.raises(InvalidInput, match="needs the energy"):
        lm.time_scales.EqualPath().value(KEPLER, ORBIT)
    galaxy = lm.models.HenonHeiles()
    with pytest.raises(InvalidTimeScale, match="Subtract a constant"):
        lm.integrate(
            lm.LogarithmicHamiltonian(galaxy), lm.StormerVerlet(), galaxy.state([0.0, 0.1], [0.5, 0.0]), h=0.1, steps=3
        )


def test_steps_that_are_too_large() -> None:
    with pytest.raises((NoConvergence, InvalidTimeScale), match=r"too large|positive"):
        lm.integrate(transformed(lm.time_scales.DistancePower(2.0)), lm.AdaptiveVerlet(), ORBIT, h=6.0, steps=30)
    pendulum = lm.models.Pendulum()
    swing = pendulum.state(1.0, 0.0)
    with pytest.raises(InvalidTimeScale):  # at rest at the start, where equal paths have no steps
        lm.integrate(
            lm.TimeTransformed(pendulum, lm.time_scales.EqualPath(-10.0)), lm.AdaptiveVerlet(), swing, h=0.1, steps=3
        )


def test_an_extended_system_is_an_ordinary_one() -> None:
    """Its energy K = 0 is kept, -H_0 to the bit."""
    whole = transformed().bound(ORBIT)
    assert isinstance(whole, ExtendedSystem) and whole.degrees == 3
    start = whole.extended(ORBIT, 0.0)
    assert whole.energy(start.q, start.p) == 0.0
    memory = lm.AdaptiveVerlet().start(whole, start, 0.1)
    for _ in range(20):
        memory = lm.AdaptiveVerlet().step(whole, 0.0, memory, 0.1)
    assert memory.state.p[2] == start.p[2]
    assert abs(whole.energy(memory.state.q, memory.state.p)) < 1e-2
