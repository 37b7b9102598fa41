"""The exact flow of a free body, step by step: what rounds alike in every step changes the time, and not the energy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.formulas import Vec, dot
from liemech.integrators.free_body.exact_free_body import Orbit

J = np.array([1.0, 1.5, 2.0])
FLOW, BODY = lm.ExactFreeBody(), lm.RigidBody(J)
STARTS = ([0.5, 0.0, math.sqrt(0.75)], [0.2, 0.9, -0.4], [-0.7, 0.3, 0.1])


def change(mu: Vec, constant: str, error: float) -> float:
    """The relative change of the energy by a step of 0.1 with an error in a constant of the orbit."""
    orbit, _, unit = FLOW._cut(BODY.hamiltonian.inverse, mu, 0.1)
    values = {n: getattr(orbit, n) for n in Orbit.__dataclass_fields__}
    values[constant] = (1.0 + error) * values[constant]
    moved = lm.SO3().algebra.cayley_Ad_star(Orbit(**values).displacement(mu, unit), mu)
    d = moved - mu
    return dot(d, BODY.hamiltonian.gradient(mu + 0.5 * d)) / BODY.hamiltonian.energy(mu)


@pytest.mark.parametrize("start", STARTS, ids=str)
def test_errors_of_constants_change_the_time_and_not_the_energy(start: list[float]) -> None:
    mu = Vec(*start)
    for constant in ("along", "across", "scale", "unit", "turning", "reach", "middle"):
        angle = 0.1 * np.linalg.norm(np.array(start) / J)
        assert abs(change(mu, constant, 1e-6)) <= 1e-7 * angle**3, constant


def test_a_step_at_a_time_is_the_closed_form() -> None:
    """Also where the mean of the ends decides: beside a saddle, on an axis, and for large steps."""
    for start in (*STARTS, [1e-300, 1.0, 0.0], [0.0, 1.0, 1e-9], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]):
        state = BODY.state(mu=start, g=np.eye(3))
        for h in (1e-9, 0.1, 0.7, 3.0):
            run = lm.integrate(BODY, FLOW, state, h=h, steps=3, compiled=False)
            exact = BODY.exact(state, t=run.t)
            assert np.abs(run.mu - exact.mu).max() <= 2e-14 * (1.0 + h)
            assert np.abs(run.g - exact.g).max() <= 2e-14 * (1.0 + h)


@pytest.mark.slow
def test_energy_walks_and_does_not_drift() -> None:
    """Sixty-four bodies, a million steps: some grew like N, 1.5e-14 root mean square, when the
    rounding of an orbit's constants acted on the energy.
    """
    mu = np.array(STARTS[0]) + 0.2 * np.random.default_rng(1).normal(size=(64, 3))
    run = lm.integrate(BODY, FLOW, BODY.state(mu=mu), h=0.1, steps=10**6, every=10**4, progress=False)
    momenta = run.mu.astype(np.longdouble)
    energy = (momenta**2 / J).sum(axis=-1)
    found = (energy / energy[0] - 1.0).astype(float)
    assert np.sqrt((found[-1] ** 2).mean()) <= 5e-15
    parts = np.diff(found, axis=0)
    drift = parts.mean(axis=0) / (parts.std(axis=0) / math.sqrt(len(parts)))  # in standard errors
    assert np.std(drift) <= 1.5


@pytest.mark.parametrize("moments", [(1.0, 1.6, 2.3), (0.3, 1.0, 1.1), (1.0, 50.0, 50.5)])
@pytest.mark.parametrize("turn", [0.5, 1.2])
def test_every_term_of_the_series_is_there(moments: tuple[float, ...], turn: float) -> None:
    body, rng = lm.RigidBody(moments), np.random.default_rng(0)
    for mu in rng.normal(size=(12, 3)):
        start = body.state(mu, np.eye(3))
        h = turn / float(np.linalg.norm(body.velocity(mu)))
        run = lm.integrate(body, lm.ExactFreeBody(), start, h=h, steps=1, compiled=False)
        error = np.abs(run.mu[-1] - np.array(body.exact(start, h).mu)).max()
        assert error < 8 * np.finfo(float).eps * np.linalg.norm(mu)


NEEDLES = {
    "symmetric": ([1e-6, 1.0, 1.0], [1e-6, 0.3, 0.2], 0.1),
    "thinner": ([1e-10, 1.0, 1.0], [1e-10, 0.3, 0.2], 0.1),
    "at right angles": ([1e-6, 1.0, 1.1], [0.0, 0.3, 0.2], 0.1),
    "nearly symmetric": ([1.24828114e-6, 1.0, 1.00000011], [1.35523308e-7, 2.22123133, 0.207143891], 0.447726),
    "swinging": ([1.43282473e-6, 1.0, 1.00768023], [4.49651923e-6, -2.66411501, -0.907004908], 0.11865778),
    "turning about itself": ([1e-6, 1.0, 1.0003], [1e-4, 0.3, 0.2], 0.1),
}


@pytest.mark.filterwarnings("ignore::liemech.errors.InertiaWarning")
@pytest.mark.parametrize("name", NEEDLES)
def test_a_needle_costs_as_many_parts_as_it_turns(name: str) -> None:
    """Beside DOP853 for mu_1/J_1, mu_2, mu_3 and the attitude, and the closed form."""
    moments, mu, h = NEEDLES[name]
    body = lm.RigidBody(moments)
    start = body.state(mu, np.eye(3))
    assert FLOW._cut(body.hamiltonian.inverse, start.mu, h)[1] <= 64.0
    run = lm.integrate(body, FLOW, start, h=h, steps=1, compiled=False)
    J1, J2, J3 = moments

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        w = np.array([y[0], y[1] / J2, y[2] / J3])
        hat = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        turning = [
            (1.0 / J3 - 1.0 / J2) * y[1] * y[2] / J1,
            (1.0 - J1 / J3) * y[0] * y[2],
            (J1 / J2 - 1.0) * y[0] * y[1],
        ]
        return np.concatenate([turning, (y[3:].reshape(3, 3) @ hat).ravel()])

    there = np.concatenate([[mu[0] / J1], mu[1:], np.eye(3).ravel()])
    there = solve_ivp(rate, (0.0, h), there, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    exact = body.exact(start, h)
    for found, wanted in ((run.mu[-1], exact.mu), (run.g[-1], exact.g), (run.g[-1].ravel(), there[3:])):
        assert np.abs(found - wanted).max() <= 2e-11
    assert np.abs(run.mu[-1][1:] - there[1:3]).max() <= 2e-11


@pytest.mark.filterwarnings("ignore::liemech.errors.InertiaWarning")
def test_a_needle_that_turns_slowly_is_not_refused_and_one_that_spins_is() -> None:
    body = lm.RigidBody([1e-10, 1.0, 1.0])
    slow, fast = body.state([0.0, 0.3, 0.2], np.eye(3)), body.state([1e-3, 0.3, 0.2], np.eye(3))
    run = lm.integrate(body, FLOW, slow, h=0.1, steps=2, compiled=False)
    assert np.abs(run.mu[-1] - slow.mu).max() <= 1e-8  # a rounding of mu_1 is a velocity 1e10 times as large
    with pytest.raises(lm.errors.NoConvergence, match="turns more than a hundred thousand times"):
        lm.integrate(body, FLOW, fast, h=0.1, steps=1, compiled=False)
