"""Double-bracket damping: the energy falls at the rate of its formula, and the orbit stays."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import liemech as lm

METRIC = [[2.0, 0.3, 0.0], [0.3, 1.0, -0.2], [0.0, -0.2, 1.5]]


@pytest.mark.parametrize("metric", [None, METRIC])
def test_the_energy_falls_at_the_rate_of_the_formula(metric: object) -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    damped = lm.DoubleBracket(body, 0.3, metric)
    mu = np.array([0.6, -0.2, 0.75])
    change = np.cross(mu, mu / [1.0, 1.5, 2.0])
    eta = np.linalg.solve(np.eye(3) if metric is None else np.array(METRIC), change)
    xi = damped.velocity(mu)
    assert np.allclose(xi, mu / [1.0, 1.5, 2.0] + 0.3 * eta, rtol=0, atol=1e-15)
    rate = np.dot(np.cross(mu, xi), mu / [1.0, 1.5, 2.0])
    assert rate == pytest.approx(-0.3 * change @ eta, rel=1e-13) and rate < 0.0


@pytest.mark.parametrize("group", [lm.SE3(), lm.SO(4), lm.SU(2)], ids=repr)
def test_casimirs_stay_and_the_energy_falls_on_any_group(group: lm.LieGroup) -> None:
    inertia = np.linspace(1.0, 2.0, group.dim)
    system = lm.DoubleBracket(lm.LiePoissonSystem(group, lm.KineticEnergy(inertia)), 0.2)
    start = system.state(np.linspace(-1.0, 0.8, group.dim), group.identity())
    run = lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=400)
    casimirs = group.casimirs(run.mu)
    assert np.abs(casimirs - casimirs[0]).max() < 1e-12 * np.abs(casimirs[0]).max()
    assert (np.diff(run.energy) < 0.0).all() and run.energy[-1] < 0.95 * run.energy[0]
    moved = run.spatial_momentum - run.spatial_momentum[0]
    assert np.abs(moved).max() < 1e-12


def test_relaxes_to_the_axis_of_least_energy_as_the_linearised_motion_does() -> None:
    moments, damping, small = np.array([1.0, 1.5, 2.0]), 0.4, 1e-6
    a, b = 1.0 / moments[:2] - 1.0 / moments[2]
    # x' = -b y - damping a x,  y' = a x - damping b y  beside the third axis
    linear = np.array([[-damping * a, -b], [a, -damping * b]])
    assert max(np.linalg.eigvals(linear).real) < 0.0
    system = lm.DoubleBracket(lm.RigidBody(moments), damping)
    start = np.array([small, -0.5 * small, 1.0])
    run = lm.integrate(system, lm.RKMK(order=6), system.state(start), h=0.05, steps=400)
    expected = np.array([scipy.linalg.expm(linear * t) @ start[:2] for t in run.t])
    assert np.abs(run.mu[:, :2] - expected).max() < 1e-3 * small * small + 1e-11 * small
    assert np.linalg.norm(run.mu[-1, :2]) < 0.2 * small


def test_without_damping_the_bits_are_those_of_the_system() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    still = lm.DoubleBracket(body, 0.0)
    mu = [0.6, -0.2, 0.75]
    runs = [
        lm.integrate(system, lm.RKMK(order=4), system.state(mu, np.eye(3)), h=0.1, steps=50) for system in (body, still)
    ]
    assert np.array_equal(runs[0].mu, runs[1].mu) and np.array_equal(runs[0].g, runs[1].g)


def test_the_midpoint_rule_and_adaptive_steps_follow_it() -> None:
    system = lm.DoubleBracket(lm.RigidBody([1.0, 1.5, 2.0]), 0.3)
    start = system.state([0.6, -0.2, 0.75])
    fine = lm.integrate(system, lm.RKMK(order=8), start, h=0.01, steps=200).mu[-1]
    errors = [
        np.abs(lm.integrate(system, lm.ImplicitMidpoint(), start, h=2.0 / n, steps=n).mu[-1] - fine).max()
        for n in (20, 40)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    adaptive = lm.integrate(system, lm.RKMK(order=5), start, t_end=2.0, rtol=1e-9, atol=1e-12)
    assert np.abs(adaptive.mu[-1] - fine).max() < 1e-8


@pytest.mark.parametrize(
    ("damping", "metric", "told"),
    [
        (-0.1, None, "not negative"),
        (float("nan"), None, "finite|not negative"),
        (0.1, [[1.0, 0.0], [0.0, 1.0]], "shape"),
        (0.1, [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "symmetric"),
        (0.1, [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], "positive"),
    ],
)
def test_what_is_no_damping_is_named(damping: float, metric: object, told: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=told):
        lm.DoubleBracket(lm.RigidBody([1.0, 1.5, 2.0]), damping, metric)
