"""Tangent maps of power series, ensembles, adaptive steps and steps in fictive time, against
differences, against each other, and against the two-form they must keep.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes import slow

import liemech as lm
from liemech.errors import InvalidInput
from liemech.formulas import where

SO3 = lm.SO3()
BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=SO3.exp([0.1, 0.2, 0.3]))
KEPLER = lm.Kepler()
ORBIT = np.array([0.6, 0.0, 0.0, 1.4])
CONTROLLED = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.5))


def orbit(x: Any) -> Any:
    return KEPLER.state(q=x[:2], p=x[2:])


def slopes(function: Callable[[Any], Any], x: Any, h: float = 1e-2) -> np.ndarray:
    """The derivative of a function of a vector, by differences of order 8."""
    weights = (1, 4.0 / 5.0), (2, -1.0 / 5.0), (3, 4.0 / 105.0), (4, -1.0 / 280.0)
    return np.array(
        [sum(w * (function(x + k * h * e) - function(x - k * h * e)) for k, w in weights) / h for e in np.eye(len(x))]
    ).T


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, slow(True)], ids=["plain", "compiled"])
@pytest.mark.parametrize(
    "method",
    [lm.Taylor(order=6), slow(lm.Taylor(order=5, retraction=lm.Exponential())), lm.Isospectral(order=4)],
    ids=lambda method: method.name,
)
def test_momenta_of_power_series_and_stages(method: Any, compiled: bool) -> None:
    """By the start, and by the inertia; values to the bit."""
    plan = lm.Plan(BODY, method, 0.1, compiled=compiled)
    run = plan.tangent(START, steps=2, by=["start", "inertia"])
    assert np.array_equal(run.mu, plan.run(START, steps=2).mu)
    mu, moments = np.array(START.mu), np.array(BODY.inertia)
    by_start = slopes(lambda x: plan.run(BODY.state(x, START.g), steps=2).mu[-1], mu)
    by_inertia = slopes(lambda x: plan.replace(system=lm.RigidBody(x)).run(START, steps=2).mu[-1], moments)
    assert np.abs(run.tangent["start"][-1][:3, :3] - by_start).max() < 1e-12
    assert np.abs(run.tangent["inertia"][-1][:3] - by_inertia).max() < 1e-12


@pytest.mark.slow
def test_gauss_stages_keep_the_bracket() -> None:
    """D hat(mu) D^T = hat(mu'): isospectral steps are Poisson maps, those of Taylor are none."""
    for method, kept in ((lm.Isospectral(order=4), True), (lm.Taylor(order=4), False)):
        run = lm.Plan(BODY, method, 0.4, compiled=False).tangent(BODY.state(START.mu), steps=10)
        D, hat = run.tangent["start"][-1], SO3.algebra.hat
        assert (np.abs(D @ hat(run.mu[0]) @ D.T - hat(run.mu[-1])).max() < 1e-13) == kept


@pytest.mark.parametrize("how", [dict(h=0.1), dict(h=[0.1, 0.2]), dict(rtol=1e-5)], ids=str)
def test_ensembles_have_the_tangent_maps_of_their_bodies(how: dict[str, Any]) -> None:
    mu, span = [[0.5, -0.3, 0.75], [1.0, 0.1, 0.2]], {"steps": 3} if "h" in how else {"t_end": 1.0}
    bodies = [BODY, lm.RigidBody([1.0, 1.7, 2.3])]
    plan = lm.Plan(bodies, lm.RKMK(order=5), compiled=False, **how)
    runs = plan.tangent(BODY.state(mu), by=["start", "inertia"], **span)  # type: ignore[arg-type]
    for i, body in enumerate(bodies):
        own = {name: np.broadcast_to(x, 2)[i].item() for name, x in how.items()}
        alone = lm.Plan(body, lm.RKMK(order=5), compiled=False, **own).tangent(
            body.state(mu[i]),
            by=["start", "inertia"],
            **span,  # type: ignore[arg-type]
        )
        for name, D in alone.tangent.items():
            assert np.array_equal(runs.tangent[name][: len(D), i], D)


@pytest.mark.slow
def test_adaptive_steps_are_differentiated_as_they_were_taken() -> None:
    """Steps that all have the largest length are fixed ones; others lead to the derivative
    of the flow, to the order of the method; a jump of the torque is met between two steps.
    """
    by = ["start", "inertia"]
    even = lm.Plan(BODY, lm.RKMK(order=5), h=0.125, rtol=1.0, max_step=0.125, compiled=False)
    fixed = lm.Plan(BODY, lm.RKMK(order=5), h=0.125, compiled=False)
    run, same = even.tangent(START, t_end=1.0, by=by), fixed.tangent(START, steps=8, by=by)
    assert np.array_equal(run.t, same.t) and run.rejected == 0
    for name in by:
        assert np.abs(run.tangent[name] - same.tangent[name]).max() < 1e-14
    off = []
    exact = lm.Plan(BODY, lm.RKMK(order=8), h=0.05, compiled=False).tangent(START, steps=20)
    for rtol in (1e-4, 1e-7):
        plan = lm.Plan(BODY, lm.RKMK(order=5), rtol=rtol, atol=0.1 * rtol, compiled=False)
        found = plan.tangent(START, t_end=1.0)
        assert np.array_equal(found.mu, plan.run(START, t_end=1.0).mu)
        off.append(np.abs(found.tangent["start"][-1] - exact.tangent["start"][-1]).max())
    assert off[1] < 0.05 * off[0] < 1e-7


def test_a_rest_whose_steps_have_no_error() -> None:
    """About the first axis: the linearised motion is cos and sin, or cosh and sinh."""
    start = BODY.state([1.0, 0.0, 0.0])
    rate = np.array([[0.0, 1.0 - 1.0 / 2.3], [1.0 / 1.6 - 1.0, 0.0]])
    run = lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6, max_step=0.05, compiled=False).tangent(start, t_end=1.0)
    w, v = np.linalg.eig(rate)
    exact = (v @ np.diag(np.exp(w)) @ np.linalg.inv(v)).real
    assert np.abs(run.tangent["start"][-1][1:, 1:] - exact).max() < 1e-8


@lm.record
class Pulse(lm.DrivenHamiltonian):
    """A body that gets another inertia at t = 1/2."""

    def energy(self, t: float, mu: lm.Vec) -> float:
        third = where(t < 0.5, 2.0, 2.4)
        return 0.5 * (mu[0] ** 2 + mu[1] ** 2 / 1.5 + mu[2] ** 2 / third)


def test_steps_that_jumps_divide() -> None:
    """As two runs, before the jump and after it: the chain rule."""
    system = lm.DrivenLiePoissonSystem(SO3, Pulse())
    start = system.state(START.mu)
    plan = lm.Plan(system, lm.RKMK(order=5), rtol=1e-9, breaks=[0.5], compiled=False)
    whole = plan.tangent(start, t_end=1.0)
    D = np.eye(3)
    for third in (2.0, 2.4):
        body = lm.RigidBody([1.0, 1.5, third])
        half = lm.Plan(body, lm.RKMK(order=8), 0.05, compiled=False).tangent(body.state(start.mu), steps=10)
        D, start = half.tangent["start"][-1] @ D, half.last
    assert np.abs(whole.tangent["start"][-1] - D).max() < 1e-7


@pytest.mark.parametrize(
    ("system", "method"),
    [(KEPLER, CONTROLLED), (lm.TimeTransformed(KEPLER, lm.time_scales.DistancePower(1.5)), lm.AdaptiveVerlet())],
    ids=["controlled", "transformed"],
)
def test_steps_in_fictive_time(system: Any, method: Any) -> None:
    """By the start, on which energy and first 1/sigma depend, and by the attraction; with the row of the physical time."""

    def end(run: lm.Trajectory) -> np.ndarray:
        return np.concatenate([run.q[-1], run.p[-1], run.t[-1:]])

    plan = lm.Plan(system, method, 0.02, compiled=False)
    run, whole = plan.tangent(orbit(ORBIT), steps=6), plan.run(orbit(ORBIT), steps=6)
    assert np.array_equal(run.q, whole.q) and np.array_equal(run.t, whole.t)
    assert np.array_equal(run.tau, whole.tau)  # type: ignore[attr-defined]
    assert run.tangent["start"].shape == (7, 5, 4)
    found = slopes(lambda x: end(plan.run(orbit(x), steps=6)), ORBIT)
    assert np.abs(run.tangent["start"][-1] - found).max() < 1e-11
    if system is KEPLER:
        by = plan.tangent(orbit(ORBIT), steps=6, by="attraction").tangent["attraction"][-1]
        found = slopes(
            lambda x: end(lm.Plan(lm.Kepler(x[0]), method, 0.02, compiled=False).run(orbit(ORBIT), steps=6)), np.ones(1)
        )
        assert np.abs(by - found).max() < 1e-11


@pytest.mark.parametrize(("length", "time"), [(1.5e11, 5e6), (1e-9, 1e-12), (1e3, 1.0), (1e-3, 1.0)])
@pytest.mark.parametrize("kind", ["controlled", "transformed"])
def test_fictive_time_in_any_units(kind: str, length: float, time: float) -> None:
    """Energy and first 1/sigma were differentiated by steps of 2^-7 m and 2^-7 m/s: in metres planets lost five digits,
    and orbits of nanometres all.
    """

    def by_start(length: float, time: float) -> np.ndarray:
        system: Any = lm.Kepler(length**3 / time**2)
        start = lm.Kepler().state(q=length * ORBIT[:2], p=length / time * ORBIT[2:])
        method: Any = CONTROLLED
        if kind == "transformed":
            system, method = lm.TimeTransformed(system, lm.time_scales.DistancePower(1.5)), lm.AdaptiveVerlet()
        plan = lm.Plan(system, method, 0.02 * time / length**1.5, compiled=False)
        units = np.array([length, length, length / time, length / time, time])
        return plan.tangent(start, steps=6).tangent["start"][-1] * units[:4] / units[:, None]

    assert np.abs(by_start(length, time) - by_start(1.0, 1.0)).max() < 1e-12


@pytest.mark.slow
def test_a_controlled_body_with_an_attitude() -> None:
    top = lm.models.HeavyTop([1.0, 1.2, 0.6], 1.0, [0.0, 0.0, 1.0])
    method = lm.ReversibleController(lm.LieVerlet(), lambda g: 1.0 / (1.5 + 0.3 * g[2, 2]))
    plan, mu, g = (lm.Plan(top, method, h=0.05, compiled=False), [1.0, 0.5, 0.2], SO3.exp([0.3, 0.2, 0.1]))
    found = plan.tangent(top.state(mu=mu, g=g), steps=10).tangent["start"][-1]

    def end(x: Any) -> Any:
        start = top.state(mu=np.add(mu, x[:3]), g=SO3.compose(g, SO3.exp(x[3:])))
        return plan.run(start, steps=10).mu[-1]

    assert np.abs(found[:3] - slopes(end, np.zeros(6))).max() < 1e-8


def test_what_has_none() -> None:
    with pytest.raises(InvalidInput, match="in fictive time give steps, and no t_end"):
        lm.Plan(KEPLER, CONTROLLED, 0.05, compiled=False).tangent(orbit(ORBIT), t_end=1.0)
