"""What native code cannot do, plain Python does: its word counts, and the run goes on with the same bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

import liemech as lm

pytestmark = pytest.mark.compiled


@lm.record
class Factorials(lm.Hamiltonian):
    """Its gradient needs integers beyond 2^63 where mu_1 is positive."""

    inertia: lm.Vec

    def energy(self, mu):
        return 0.5 * lm.dot(mu, self.gradient(mu))

    def gradient(self, mu):
        last = 40 if mu[0] > 0.0 else 10
        factorial = 1
        for i in range(1, last):
            factorial = factorial * i
        return (factorial * mu) / (factorial * self.inertia)


def equal(a: lm.Trajectory, b: lm.Trajectory) -> bool:
    return np.array_equal(a.mu, b.mu) and np.array_equal(a.t, b.t)


def test_steps_with_integers_beyond_native_code_are_those_of_python() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Factorials([1.0, 1.5, 2.0]))
    start = system.state(mu=[0.5, 0.3, 0.75**0.5])
    plain = lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=150, every=7, compiled=False)
    native = lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=150, every=7, compiled=True)
    assert np.min(plain.mu[:, 0]) < 0.0 < np.max(plain.mu[:, 0])
    assert equal(plain, native) and native.compiled
    assert math.factorial(39) > 2**63


@pytest.mark.slow
def test_bodies_that_leave_native_code_come_back() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Factorials([1.0, 1.5, 2.0]))
    starts = system.state(mu=[[0.5 * math.cos(k), 0.3, math.sin(k)] for k in range(9)])
    plain = lm.integrate(system, lm.RKMK(order=2), starts, h=0.1, steps=60, every=8, compiled=False)
    native = lm.integrate(system, lm.RKMK(order=2), starts, h=0.1, steps=60, every=8, compiled=True)
    assert equal(plain, native) and not native.stopped
