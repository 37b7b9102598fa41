"""Methods of power series meet formulas with branches inside: quotients that are 0/0 at zero, and
linear equations, whose rows change places.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech import formulas as f

QUOTIENTS = (f.sinc, f.versine_over, f.segment_over, f.sinh_over, f.coshm1_over, f.expm1_over, f.atan_over)


@lm.record
class Springs(lm.HamiltonianSystem):
    """Forces out of quotients, of all or of the first ones, of numbers on both sides of where sum and closed form meet."""

    degrees: int = 2
    quotients: int = len(QUOTIENTS)

    def energy(self, q: Any, p: Any) -> Any:
        held = f.log1p_over(q[0] * q[0] + 0.1 * q[1] * q[1]) + f.stumpff(2, 3.0 * q[0] + q[1])
        for quotient in QUOTIENTS[: self.quotients]:
            held = held + quotient(q[0] + 0.3 * q[1])
        return 0.5 * lm.dot(p, p) + 0.1 * held


@lm.record
class Arm(lm.HamiltonianSystem):
    """p^T M(q)^-1 p/2 in three ways, of a mass whose larger entry is here in one row, there in the other."""

    degrees: int = 2

    def energy(self, q: Any, p: Any) -> Any:
        mass = lm.mat([0.2 + q[0] * q[0], 0.4], [0.4, 2.0 + q[1] * q[1]])
        several = lm.dot(p, np.linalg.inv(mass) @ p) + lm.dot(p, np.linalg.solve(mass, p))
        return 0.25 * several + 0.1 * np.linalg.det(mass)


def starts(system: Any) -> Any:
    q = [[0.1, 0.05], [0.4, -0.3], [2.5, 1.0], [-1.9, 2.0], [1.1, -3.0]]
    return system.state(q=q, p=np.tile([0.8, -0.2], (5, 1)))


@pytest.mark.parametrize(
    "system", [pytest.param(Springs(), marks=pytest.mark.slow), Arm()], ids=lambda system: type(system).__name__
)
def test_series_pass_both_ways_of_a_branch(system: Any) -> None:
    """The motion by power series is that of a Runge-Kutta method, which sees numbers only."""
    start = starts(system)
    series = lm.integrate(system, lm.Taylor(order=8), start, h=0.002, steps=3, compiled=False)
    other = lm.integrate(system, lm.RKMK(order=8), start, h=0.002, steps=3, compiled=False)
    assert np.allclose(series.q[-1], other.q[-1], rtol=1e-12, atol=0)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    "system, method",
    [
        (Springs(), lm.Taylor(order=2)),
        (Arm(), lm.Taylor(order=3)),
        pytest.param(Arm(), lm.HamiltonJacobi(order=3), marks=pytest.mark.slow),
        pytest.param(Springs(quotients=1), lm.HamiltonJacobi(order=3), marks=pytest.mark.slow),
    ],
    ids=lambda x: type(x).__name__,
)
def test_series_give_the_same_bits_in_native_code(system: Any, method: Any) -> None:
    for start in (starts(system), system.state(q=[2.5, 1.0], p=[0.8, -0.2])):
        plain, native = (lm.integrate(system, method, start, h=0.002, steps=2, compiled=how) for how in (False, True))
        assert np.array_equal(plain.q, native.q) and np.array_equal(plain.p, native.p)
