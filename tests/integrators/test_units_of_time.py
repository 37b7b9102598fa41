"""Algorithm 1 in other units of mass and time, powers of two apart: the same bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

import liemech as lm
from liemech.integrators.variational import first_size, leading_power

MOMENTS, MU = np.array([1.0, 1.6, 2.3]), np.array([0.3, 0.8, -0.5])
FULL = np.array([[1.0, 0.1, 0.05], [0.1, 1.6, 0.2], [0.05, 0.2, 2.3]])
UNITS = [(-196, 124), (-103, 196), (280, -40)]  # residuals of J/h would be denormal, or huge


def moved(
    method: lm.Method, inertia: np.ndarray, mass: float = 1.0, second: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Momentum, in ordinary units, and attitude after some steps."""
    body = lm.RigidBody(mass * inertia)
    start = body.state(mass / second * MU, np.eye(3))
    run = lm.integrate(body, method, start, h=0.3 * second, steps=25, compiled=False)
    return run.mu / (mass / second), run.g


@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()], ids=repr)
@pytest.mark.parametrize("inertia", [MOMENTS, FULL], ids=["diagonal", "full"])
def test_powers_of_two_change_no_bit(retraction: lm.Retraction, inertia: np.ndarray) -> None:
    method = lm.CovariantVariational(retraction)
    mu, g = moved(method, inertia)
    for mass, second in UNITS:
        other = moved(method, inertia, 2.0**mass, 2.0**second)
        assert np.array_equal(other[0], mu)
        assert np.array_equal(other[1], g)


def test_steps_back_and_a_root_that_grows_out_of_zero() -> None:
    """Both ways to a displacement, with steps of either sign, for a thin rod beyond its fold."""
    method, rod = lm.CovariantVariational(lm.Cayley()), np.array([1.0 / 1000, 1.0, 1.0])
    for h in 0.7, -0.7:
        found = []
        for mass, second in (0, 0), (-103, 196):
            system = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy(2.0**mass * rod))
            mu = lm.Vec.of(2.0 ** (mass - second) * np.array([0.001, 1.1, 0.4]))
            found.append(method.velocity(system, mu, h * 2.0**second) * 2.0**second)
        assert np.array_equal(np.array(found[0]), np.array(found[1]))


def test_leading_powers() -> None:
    rng = np.random.default_rng(0)
    exponents = rng.integers(-900, 900, 300)
    sizes = [1.0, -1.5, 2.0, math.nextafter(2.0, 0.0), *(rng.uniform(1, 2, 300) * 2.0**exponents)]
    for x in sizes:
        assert leading_power(float(x)) == 2.0 ** (math.frexp(abs(x))[1] - 1)
    assert first_size(lm.mat(lm.vec(0.0, -2.0), lm.vec(-2.0, 1.0))) == 2.0


def test_the_largest_step_of_an_ensemble_is_that_of_its_fastest_body() -> None:
    method, body = lm.CovariantVariational(lm.Exponential()), lm.RigidBody(MOMENTS)
    mu = np.random.default_rng(1).normal(size=(50, 3))
    alone = [method.largest_step(body, body.state(m)) for m in mu]
    for power in -1000, 0, 1000:  # squares of it are no floats
        found = method.largest_step(body, body.state(2.0**power * mu))
        assert found == pytest.approx(2.0**-power * min(alone), rel=1e-15)
