"""Loads on bodies under constraints: orders, the way back, power, and what the checks say."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from scenes import PointFixed

import liemech as lm
from liemech.formulas import cos, sin


@lm.record
class Stirred(lm.Force):
    """A torque and a push that come and go, and drag that grows with the speed."""

    drag: float
    push: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        push = lm.vec(0.3 * sin(2.0 * t), 0.2, 0.1 * cos(t), 0.0, 0.3 * g[0, 0], 0.0)
        return self.push * push - (self.drag * (1.0 + lm.dot(xi, xi))) * xi


@lm.record
class Oar(lm.Force):
    """A sleigh that is pushed forwards and turned, with drag."""

    drag: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(sin(t), 1.0 + cos(2.0 * t), 0.2) - self.drag * xi


MOMENTS, MASS, CENTRE = np.array([1.0, 1.5, 0.7]), 2.0, np.array([0.3, 0.1, 0.4])


@functools.cache
def top(drag: float = 0.3, push: float = 1.0, speed: float = 1.0) -> tuple[lm.ConstrainedBody, lm.State]:
    free = lm.MechanicalSystem(
        lm.models.KirchhoffBody([*MOMENTS, MASS, MASS, MASS]),
        lm.models.UniformGravity(MASS * 9.81),
        load=Stirred(drag, push),
    )
    body = lm.ConstrainedBody(free, PointFixed(-CENTRE))
    g, w = np.eye(4), speed * np.array([0.3, 0.6, 1.1])
    g[:3, :3] = lm.SO3().exp([0.4, -0.3, 0.5])
    g[:3, 3] = g[:3, :3] @ CENTRE
    return body, body.state([*MOMENTS * w, *MASS * np.cross(w, CENTRE)], g)


@functools.cache
def sleigh(drag: float = 0.3) -> tuple[lm.NonholonomicBody, lm.State]:
    free = lm.LiePoissonSystem(lm.SE2(), lm.KineticEnergy([0.7, 1.3, 1.3]))
    body = lm.MechanicalSystem(free, lm.NoPotential(), load=Oar(drag))
    system = lm.NonholonomicBody(body, lm.joints.Blade(0.4))
    return system, system.consistent([0.77, -0.65, 0.5], np.eye(3))


SCENES = {"top": (top, lm.LieRATTLE()), "sleigh": (sleigh, lm.LagrangeDAlembert())}


def run(system, method, start, h, steps, **options):
    return lm.integrate(system, method, start, h=h, steps=steps, compiled=False, progress=False, **options)


@functools.cache
def reference(scene: str) -> Any:
    system, start = SCENES[scene][0]()
    return run(system, lm.RKMK(order=6), start, 0.04, 10, t0=0.3).last


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("order", [2, 4])
def test_orders_under_a_load(scene: str, order: int) -> None:
    """Against the reduced equation, with the multipliers in closed form."""
    (system, start), method = SCENES[scene][0](), SCENES[scene][1]
    exact = reference(scene)
    used, errors = (method if order == 2 else lm.Composition(method, order=4)), []
    for n in (4, 8):
        last = run(system, used, start, 0.4 / n, n, t0=0.3).last
        errors.append(max(np.abs(last.mu - exact.mu).max(), np.abs(last.g - exact.g).max()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("scene", SCENES)
def test_a_way_back_undoes_a_way_under_a_load(scene: str) -> None:
    (system, start), method = SCENES[scene][0](), SCENES[scene][1]
    away = run(system, method, start, 0.05, 6)
    home = run(system, method, away.last, -0.05, 6, t0=0.3)
    assert np.abs(home.mu[-1] - np.array(start.mu)).max() < 1e-13
    assert np.abs(home.g[-1] - np.array(start.g)).max() < 1e-13


def test_strong_drag_is_solved_for_at_the_end_and_refused_at_the_start() -> None:
    """h/2 times the drag is 0.97 of the inertia of the top that creeps, which stays at its point; a longer step
    would throw it back.
    """
    system, start = top(1000.0, 1.0, 0.0)
    moved = run(system, lm.LieRATTLE(), start, 0.0015, 5)
    assert np.abs(system.velocity(moved.mu)).max() < 0.02
    for mu, g in zip(moved.mu, moved.g, strict=True):
        c, v = system.conditions_at(mu, g)
        assert np.abs(np.array(c)).max() < 1e-14 and np.abs(np.array(v)).max() < 1e-13
    with pytest.raises(lm.errors.NoConvergence, match=r"drag=1000.*c h/\(2 I\) is 64.96.* 0.00154 long at most"):
        run(system, lm.LieRATTLE(), start, 0.1, 5)


@pytest.mark.slow
def test_the_power_of_a_load_is_the_change_of_energy() -> None:
    """dE/dt = <F, xi>: constraints do no work."""
    system, start = top()
    moved = run(system, lm.Composition(lm.LieRATTLE(), order=4), start, 0.02, 20)
    power = [
        np.dot(system.body.load.covector(t, system.velocity(mu), g), system.velocity(mu))
        for t, mu, g in zip(moved.t, moved.mu, moved.g, strict=True)
    ]
    from scipy.interpolate import CubicSpline

    work = CubicSpline(moved.t, power).integrate(0.0, 0.4)
    assert moved.energy[-1] - moved.energy[0] == pytest.approx(work, rel=2e-6)
    assert moved.drift().kept == ()


@pytest.mark.slow
@pytest.mark.parametrize("scene", [pytest.param("top", marks=pytest.mark.slow), "sleigh"])
def test_the_checks_know_loads(scene: str) -> None:
    (system, start), method = SCENES[scene][0](), SCENES[scene][1]
    laws = lm.check_system(system, start)
    assert laws["load"].verdict == "holds" and laws["constraints stay"].verdict == "holds"
    claims = lm.check_method(method, system, start, native=False)
    assert claims["order"].verdict == "holds" and claims["symmetric"].verdict == "holds"
    assert all(claim.verdict != "broken" for claim in claims.findings)


def test_multipliers_are_those_of_the_time() -> None:
    system, start = top()
    early, late = (np.array(system.multipliers(start.mu, start.g, t)) for t in (0.0, 0.7))
    assert np.abs(early - late).max() > 1e-3
    moved = run(system, lm.LieRATTLE(), start, 0.1, 3, t0=0.4)
    assert np.array_equal(moved.multipliers[-1], np.array(system.multipliers(moved.mu[-1], moved.g[-1], moved.t[-1])))


@pytest.mark.slow
@pytest.mark.compiled
def test_loads_compile() -> None:
    for scene, method in SCENES.values():
        system, start = scene()
        plain, native = (
            lm.integrate(system, method, start, h=0.1, steps=10, compiled=c, progress=False) for c in (False, True)
        )
        assert np.array_equal(plain.mu, native.mu) and np.array_equal(plain.g, native.g)
