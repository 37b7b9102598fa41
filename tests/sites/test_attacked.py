"""Faults that random systems beside DOP853 have found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange

import liemech as lm
from liemech.compiler import kernel

N = 5


def moved(t: float, held: list[int], neighbours: Any) -> tuple[np.ndarray, np.ndarray]:
    """Spins, and where they are at a time: a' = -(sum of the neighbours) x a turned about."""
    s = np.random.default_rng(3).normal(size=(N, 3))
    s /= np.linalg.norm(s, axis=1)[:, None]

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(N, 3)
        slope = -neighbours(m)
        slope[held] = 0.0
        return np.cross(m, slope).ravel()

    end = solve_ivp(motion, (0.0, t), s.ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return s, end.reshape(N, 3)


@pytest.mark.parametrize("compiled", [False, True])
def test_sublattices_where_every_two_are_tied(compiled: bool) -> None:
    """Places that are filled by the last site of a colour are no partners."""
    if compiled and kernel.available() is not None:
        pytest.skip("needs llvmlite")
    system = lm.LiePoissonSystem(
        lm.SO3() ** N, lm.Terms(Exchange(1.0).over(lm.neighbours.all_pairs()))
    )
    s, wanted = moved(0.4, [], lambda m: m.sum(axis=0) - m)
    errors = []
    for steps in (4, 8):
        run = lm.integrate(
            system, lm.SublatticeSplitting(), system.state(mu=s), h=0.4 / steps, steps=steps,
            compiled=compiled,
        )  # fmt: skip
        errors.append(np.abs(run.mu[-1] - wanted).max())
    assert errors[0] < 0.05 and 3.5 < errors[0] / errors[1] < 4.5


def test_hamilton_jacobi_where_a_site_is_held() -> None:
    """The gradient of an energy is zero at sites that are held; its other parts are those of it."""
    system = lm.LiePoissonSystem(
        lm.SO3() ** N, lm.Terms(Exchange(1.0).over(lm.neighbours.ring(N)), held=[1])
    )
    s, wanted = moved(0.4, [1], lambda m: np.roll(m, 1, 0) + np.roll(m, -1, 0))
    errors = []
    for steps in (4, 8):
        run = lm.integrate(
            system, lm.LiePoissonHamiltonJacobi(order=2), system.state(mu=s), h=0.4 / steps,
            steps=steps,
        )  # fmt: skip
        errors.append(np.abs(run.mu[-1] - wanted).max())
        assert np.array_equal(run.mu[-1, 1], s[1])
    assert errors[0] < 0.05 and 3.5 < errors[0] / errors[1] < 4.5
