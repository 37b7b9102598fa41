"""The reversible controller on groups: an eccentric satellite, a top near the vertical, a free body."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm

SATELLITE = lm.models.OrbitingBody([1e-4, 1.5e-4, 2e-4], mass=1.0, attraction=1.0)
"""Its orbit has the axis 1, e = 0.7: it feels the gradient of gravity at the pericentre, 0.3."""


def falling_in(spin: tuple[float, float, float] = (0.3, 4.0, 0.5)) -> Any:
    circle = SATELLITE.circular_orbit(0.3)
    mu = np.array(circle.mu)
    mu[:3] = np.array(SATELLITE.inertia) * spin
    mu[4] *= np.sqrt(1.7)
    return SATELLITE.state(mu, circle.g)


def distance(g: Any) -> float:
    return (g[9] * g[9] + g[10] * g[10] + g[11] * g[11]) ** 0.75


def changes(system: Any, method: lm.Method, sigma: Any, start: Any, h: float, t_end: float) -> tuple[Any, float, float]:
    """A controlled run, and the largest changes of the energy, controlled and in as many equal steps."""
    run = lm.integrate(system, lm.ReversibleController(method, sigma), start, h=h, t_end=t_end, progress=False)
    equal = lm.integrate(system, method, start, h=t_end / run.steps, steps=run.steps, progress=False)
    return run, *(float(np.abs(r.energy - r.energy[0]).max()) for r in (run, equal))


LONG = [pytest.mark.slow, pytest.mark.compiled]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "gain"),
    [
        (lm.KickDrift(order=2), 8.0),
        pytest.param(lm.LieVerlet(), 8.0, marks=LONG),
        pytest.param(lm.KickDrift(order=4), 30.0, marks=LONG),
    ],
)
def test_an_eccentric_satellite(method: lm.Method, gain: float) -> None:
    run, varied, equal = changes(SATELLITE, method, distance, falling_in(), 0.1, 2.0 * np.pi)
    assert equal > gain * varied
    assert run.t[-1] == 2.0 * np.pi and np.diff(run.t).max() > 5.0 * np.diff(run.t)[:-1].min()
    assert run.drift()["angular momentum"].verdict == "exact"
    assert np.abs(run.z * run.scale - 1.0).max() < 2e-2
    rotation = np.array(run.g[-1, :9]).reshape(3, 3)
    assert np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-13
    sooner = lm.integrate(SATELLITE, run.method, falling_in(), h=0.1, t_end=2.0, progress=False)
    assert np.abs(run.at(2.0).g - sooner.g[-1]).max() < 1e-13


@pytest.mark.compiled
@pytest.mark.slow
def test_an_eccentric_satellite_that_spins_does_not_drift() -> None:
    """Its motion is regular, in steps that are short enough.  That of a tumbling one is not, and its energy wanders: a
    reversible map need not keep it there.
    """
    method = lm.ReversibleController(lm.KickDrift(order=2), distance)
    run = lm.integrate(
        SATELLITE, method, falling_in((0.1, 0.2, 20.0)), h=0.025, steps=600_000, every=10, progress=False
    )
    error, tenth = np.abs(run.energy - run.energy[0]), len(run) // 10
    assert run.t[-1] > 500 * 2.0 * np.pi
    assert error[-tenth:].max() < 1.02 * error[:tenth].max() < 5e-4
    tumbling = lm.integrate(SATELLITE, method, falling_in(), h=0.05, steps=300_000, every=10, progress=False)
    wandering, tenth = np.abs(tumbling.energy - tumbling.energy[0]), len(tumbling) // 10
    assert wandering.max() > 1.2 * wandering[:tenth].max()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "gain"), [(lm.KickDrift(order=2), 1.7), pytest.param(lm.KickDrift(order=4), 3.0, marks=LONG)]
)
def test_a_top_near_the_vertical(method: lm.Method, gain: float) -> None:
    """It spins too slowly to sleep: it lingers upright, falls fast, and rises again; the steps follow its turning."""
    top = lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.3, length=1.0)
    assert top.sleeping_momentum > 1.2
    start = top.state(mu=[0.0, 0.0, 1.2], g=lm.SO3().exp([1e-2, 0.0, 0.0]))
    run, varied, equal = changes(top, method, lambda mu: (0.05 + mu[0] ** 2 + mu[1] ** 2) ** -0.5, start, 0.05, 30.0)
    assert equal > gain * varied and run.g[:, 2, 2].min() < -0.2
    assert run.drift()["vertical momentum"].verdict == run.drift()["spin"].verdict == "exact"


@pytest.mark.slow
def test_a_free_body_by_an_implicit_method() -> None:
    """Steps that follow the flip of a body spinning about its middle axis: momentum on its sphere,
    spatial momentum exact.
    """
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[1e-3, 1.0, 0.0], g=np.eye(3))
    method = lm.ReversibleController(lm.CovariantVariational(lm.Exponential()), lambda mu: 1.0 + mu[1] ** 2)
    run = lm.integrate(body, method, start, h=0.2, t_end=60.0, compiled=False)
    report = run.drift()
    assert report["Casimir 1"].verdict == report["spatial momentum"].verdict == "exact"
    assert np.diff(run.t)[:-1].max() > 1.9 * np.diff(run.t)[:-1].min()
    exact = body.exact(start, 60.0)
    finer = lm.integrate(body, method, start, h=0.05, t_end=60.0, compiled=False)
    errors = [np.abs(np.array(r.mu[-1]) - np.array(exact.mu)).max() for r in (run, finer)]
    assert errors[0] > 12.0 * errors[1]
