"""Equations that are not Hamiltonian in a fictive time, y' = sigma f, t' = sigma: vector fields,
bodies, driven systems.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidTimeScale
from liemech.formulas import cos, sin, sqrt

KEPLER = lm.Kepler()
ORBIT = KEPLER.pericentre(0.6)
TOP = lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.5, length=1.0)
FALLING = TOP.state(mu=[0.3, 0.0, 1.5], g=np.eye(3))


@lm.record
class Spiral(lm.VectorField):
    """A limit cycle, reached faster and faster far out: r' = r (1 - r^2), phi' = r^2."""

    dim: ClassVar[int] = 2

    def velocity(self, y: lm.Vec) -> lm.Vec:
        r2 = lm.dot(y, y)
        return lm.vec((1.0 - r2) * y[0] - r2 * y[1], (1.0 - r2) * y[1] + r2 * y[0])


@lm.record
class Driven(lm.DrivenHamiltonianSystem):
    """x'' = cos(3 t): the time in the force is the physical one."""

    degrees: ClassVar[int] = 1

    def energy(self, t: float, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0] - cos(3.0 * t) * q[0]


def speed(y: lm.Vec) -> float:
    return 1.0 / (0.1 + lm.dot(y, y))


SCENES: dict[str, tuple[Any, Any, Any, tuple[str, ...]]] = {
    "orbit": (KEPLER, lm.time_scales.DistancePower(1.5), ORBIT, ("q", "p")),
    "field": (Spiral(), speed, Spiral().state([2.0, 0.5]), ("y",)),
    "driven": (Driven(), lambda p: 1.0 / (1.0 + p[0] * p[0]), Driven().state([0.3], [0.5]), ("q", "p")),
    "top": (TOP, lambda mu: 1.0 / (1.0 + lm.dot(mu, mu)), FALLING, ("mu", "g")),
}  # fmt: skip


def end(run: lm.Trajectory, parts: tuple[str, ...]) -> np.ndarray:
    return np.concatenate([np.ravel(getattr(run, name)[-1]) for name in parts])


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("order", [2, 4])
def test_order_at_a_physical_time(scene: str, order: int) -> None:
    """Beside the equation itself, by fixed steps."""
    system, sigma, start, parts = SCENES[scene]
    exact = end(
        lm.integrate(system, lm.RKMK(order=8), start, h=1.3 / 64, steps=64, compiled=False, progress=False), parts
    )
    errors = []
    for n in (8, 16):
        run = lm.integrate(
            lm.SundmanTransformed(system, sigma),
            lm.RKMK(order=order),
            start,
            h=2.0 / n,
            t_end=1.3,
            compiled=False,
            progress=False,
        )
        assert run.t[-1] == 1.3
        errors.append(np.abs(end(run, parts) - exact).max())
    assert math.log2(errors[0] / errors[1]) > order - 0.5


def test_a_constant_sigma_is_no_transformation() -> None:
    """A power of two changes no bit."""
    system, start = Spiral(), Spiral().state([2.0, 0.5])
    for method in (lm.RKMK(order=4), lm.RKMK(tableau=lm.tableaus.gauss(2))):
        one = lm.integrate(
            lm.SundmanTransformed(system, lambda y: 0.25),
            method,
            start,
            h=0.2,
            steps=20,
            compiled=False,
            compensated=False,
            progress=False,
        )
        other = lm.integrate(system, method, start, h=0.05, steps=20, compiled=False, compensated=False, progress=False)
        if method.order == 4 and not method.symmetric:
            assert (one.y == other.y).all() and np.allclose(one.t, other.t, rtol=1e-15)
        assert np.abs(one.y - other.y).max() < 1e-14


def test_steps_follow_sigma_and_the_path_is_the_same() -> None:
    system = lm.SundmanTransformed(KEPLER, lm.time_scales.DistancePower(1.5))
    run = lm.integrate(system, lm.RKMK(order=8), ORBIT, h=0.05, steps=100, progress=False)
    lengths = np.diff(run.t)
    assert lengths.max() / lengths.min() > 4.0
    middle = 0.5 * (run.scale[1:] + run.scale[:-1])
    assert np.abs(lengths / (0.05 * middle) - 1.0).max() < 0.01
    assert np.abs(run.q - KEPLER.exact(ORBIT, run.t).q).max() < 1e-9


def test_equal_arcs_of_a_driven_system_know_the_time() -> None:
    """Steps of equal length on the path, also where the force changes with time."""
    system = Driven()
    run = lm.integrate(
        lm.SundmanTransformed(system, lm.time_scales.EqualArc()),
        lm.RKMK(order=4),
        system.state([0.3], [2.0]),
        h=0.05,
        steps=40,
        compiled=False,
        progress=False,
    )
    arcs = np.hypot(np.diff(run.q[:, 0]), np.diff(run.p[:, 0]))
    assert np.abs(arcs / 0.05 - 1.0).max() < 2e-3


def test_reversible_where_sigma_does_not_tell_the_direction() -> None:
    """A symmetric method on the transformed equation: forth, turned, forth, turned."""
    h, method = 0.1, lm.RKMK(tableau=lm.tableaus.gauss(2))
    for sigma, exact in (
        (lm.time_scales.EqualArc(), True),
        (lambda p: 1.0 / (2.0 + lm.formulas.tanh(p[0] + p[1])), False),
    ):
        system = lm.SundmanTransformed(KEPLER, sigma)
        state = ORBIT
        for _ in range(2):
            run = lm.integrate(system, method, state, h=h, steps=20, compiled=False, progress=False)
            state = KEPLER.state(run.q[-1], -run.p[-1])
        away = np.abs(np.array(state.q) - np.array(ORBIT.q)).max()
        assert away < 1e-12 if exact else away > 1e-3


def test_runs_go_on_and_are_kept_in_files(tmp_path: Path) -> None:
    plan = lm.Plan(lm.SundmanTransformed(KEPLER, lm.time_scales.EqualArc()), lm.RKMK(order=4), h=0.1, progress=False)
    whole = plan.run(ORBIT, steps=30)
    first = plan.run(ORBIT, steps=12)
    both = first.then(plan.resume(first, steps=18))
    assert (both.q == whole.q).all() and (both.t == whole.t).all()
    whole.save(tmp_path / "run.npz")
    again = lm.Trajectory.load(tmp_path / "run.npz")
    assert (again.q == whole.q).all() and (again.tau == whole.tau).all()


def test_tangents() -> None:
    """By the start, at the same fictive time, beside differences of two runs."""
    plan = lm.Plan(lm.SundmanTransformed(Spiral(), speed), lm.RKMK(order=4), h=0.1, progress=False)
    found = plan.tangent(Spiral().state([1.2, 0.5]), steps=10).tangent["start"][-1]
    e = 1e-6
    for j in range(2):
        runs = [plan.run(Spiral().state(np.array([1.2, 0.5]) + s * e * np.eye(2)[j]), steps=10) for s in (1.0, -1.0)]
        column = [*(runs[0].y[-1] - runs[1].y[-1]) / (2 * e), (runs[0].t[-1] - runs[1].t[-1]) / (2 * e)]
        assert found[:, j] == pytest.approx(column, rel=1e-8)


@pytest.mark.parametrize("group", [lm.UnitQuaternions(), pytest.param(lm.SO3(), marks=pytest.mark.slow)], ids=repr)
def test_tangents_on_groups(group: lm.LieGroup) -> None:
    """Of bodies, whose elements are those of their own group, not of its product with the time."""
    body = lm.RigidBody([1.0, 1.5, 2.0], group=group)
    slowed = lm.SundmanTransformed(body, lambda mu: 1.0 / (1.0 + mu[0] ** 2))
    plan = lm.Plan(slowed, lm.RKMK(order=4), h=0.1, compiled=False)
    mu, g, e = np.array([0.5, 0.1, 0.8]), group.exp([0.3, -0.2, 0.5]), 1e-5
    found, middle = plan.tangent(body.state(mu, g), steps=5).tangent["start"][-1], plan.run(body.state(mu, g), steps=5)
    for j, unit in enumerate(np.eye(6)):
        starts = [body.state(mu + s * e * unit[:3], group.compose_exp(g, s * e * unit[3:])) for s in (1.0, -1.0)]
        there, back = [plan.run(start, steps=5) for start in starts]
        turned = group.body_velocity(middle.g[-1], (there.g[-1] - back.g[-1]) / (2 * e))
        column = [*(there.mu[-1] - back.mu[-1]) / (2 * e), *turned, (there.t[-1] - back.t[-1]) / (2 * e)]
        assert found[:, j] == pytest.approx(column, rel=1e-7, abs=1e-9)


def test_what_is_refused() -> None:
    slow = lm.SundmanTransformed(Spiral(), speed)
    with pytest.raises(IncompatibleSystem, match="not in a fictive time yet"):
        lm.SundmanTransformed(slow, speed)
    with pytest.raises(IncompatibleSystem, match="not in a fictive time yet"):
        lm.SundmanTransformed(3.0, speed)  # type: ignore[arg-type]
    with pytest.raises(IncompatibleSystem, match="RKMK accepts every system"):
        lm.integrate(
            lm.SundmanTransformed(KEPLER, lm.time_scales.DistancePower(1.5)), lm.StormerVerlet(), ORBIT, h=0.1, steps=1
        )
    start = Spiral().state([1.2, 0.5])
    with pytest.raises(InvalidTimeScale, match="positive"):
        lm.integrate(lm.SundmanTransformed(Spiral(), lambda y: -1.0), lm.RKMK(order=4), start, h=0.1, steps=1)
    with pytest.raises(InvalidInput, match="must be parts of the state"):
        lm.integrate(lm.SundmanTransformed(Spiral(), lambda q: 1.0), lm.RKMK(order=4), start, h=0.1, steps=1)
    with pytest.raises(IncompatibleSystem, match="SundmanTransformed"):
        lm.TimeTransformed(Spiral(), speed)  # type: ignore[arg-type]


def test_the_controller_is_for_any_symmetric_method_on_any_system() -> None:
    """Around splittings of fields, of their order."""

    @lm.record
    class Wave(lm.VectorField):
        dim: ClassVar[int] = 2
        axis: int

        def velocity(self, y: lm.Vec) -> lm.Vec:
            f = sin(y[1 - self.axis]) + 0.3
            return lm.vec(f, 0.0) if self.axis == 0 else lm.vec(0.0, f)

    waves = lm.SplitField((Wave(0), Wave(1)))
    start = waves.state([0.3, 0.8])

    def sigma(y: lm.Vec) -> float:
        return 1.0 / sqrt(1.0 + y[0] * y[0])

    exact = lm.integrate(waves, lm.RKMK(order=8), start, h=1.5 / 100, steps=100, compiled=False, progress=False).y[-1]
    for base in (lm.Splitting(order=2), lm.Splitting(order=4, quadratic=False)):
        errors = []
        for h in (0.2, 0.1):
            run = lm.integrate(
                waves, lm.ReversibleController(base, sigma), start, h=h, t_end=1.5, compiled=False, progress=False
            )
            errors.append(np.abs(run.y[-1] - exact).max())
        assert math.log2(errors[0] / errors[1]) == pytest.approx(base.order, abs=0.35)
