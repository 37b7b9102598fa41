"""Andrews' squeezing mechanism: accelerations, multipliers, masses; its angles are in tests/published."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.models.swinging import andrews

MECHANISM = lm.models.AndrewsMechanism()


def test_accelerations_and_multipliers_at_the_start() -> None:
    start = MECHANISM.from_rest()
    acceleration, multipliers = MECHANISM.acceleration(start.q, 0.0 * start.q)
    assert np.array(acceleration) == pytest.approx([14222.4439199541, -10666.8329399656, 0, 0, 0, 0, 0], abs=1e-7)
    assert np.array(multipliers) == pytest.approx([98.5668703962411, -6.12268834425567, 0, 0, 0, 0], abs=1e-9)
    assert np.allclose(MECHANISM.multipliers(start.q, start.p), multipliers, rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_energy_and_constraints_are_constants_of_the_reduced_equation() -> None:
    start = MECHANISM.from_rest()
    run = lm.integrate(MECHANISM, lm.RKMK(order=4), start, h=1e-4, steps=4, compiled=False, progress=False)
    assert np.abs(run.q[-1] - run.q[0]).max() > 1e-3
    assert run.drift()["energy"].largest < 1e-6 and run.drift()["constraint"].largest < 1e-6


@pytest.mark.slow
def test_multipliers_after_three_hundredths_of_a_second() -> None:
    run = lm.integrate(MECHANISM, lm.RKMK(order=8), MECHANISM.from_rest(), t_end=0.03, rtol=1e-10, compiled=False)
    multipliers = [199.17533, -29.755312, 23.066541, 31.452714, 22.642492, 11.617407]
    assert np.array(MECHANISM.multipliers(run.q[-1], run.p[-1])) == pytest.approx(multipliers, abs=2e-5)


def test_the_mass_matrix_is_that_of_seven_bodies_in_the_plane() -> None:
    """Twice the energy of their centres and turns, from where they are: q'.M q'."""
    a, h = andrews, 1e-30
    q, w = np.array(MECHANISM.from_rest().q) + 0.1, np.random.default_rng(1).normal(size=7)

    def places(q: np.ndarray) -> np.ndarray:
        beta, theta, gamma, phi, delta, omega, epsilon = q
        turn = lambda angle: np.array(  # noqa: E731
            [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        )
        return np.array(
            [
                turn(beta) @ [a.RA, 0.0],
                turn(beta) @ [a.RR, 0.0] - turn(beta + theta) @ [a.DA, 0.0],
                turn(gamma) @ [a.SB, -a.SA],
                turn(delta) @ [a.ZT, 0.0] + turn(phi + delta) @ [0.0, a.EA - a.E],
                turn(delta) @ [-a.TB, a.TA],
                turn(epsilon) @ [0.0, -a.U] + turn(omega + epsilon) @ [a.ZF - a.FA, 0.0],
                turn(epsilon) @ [a.UB, -a.UA],
            ]
        )

    speeds = places(q + 1j * h * w).imag / h
    turns = [w[0], w[0] + w[1], w[2], w[3] + w[4], w[4], w[5] + w[6], w[6]]
    masses = [a.M1, a.M2, a.M3, a.M4, a.M5, a.M6, a.M7]
    moments = [a.I1, a.I2, a.I3, a.I4, a.I5, a.I6, a.I7]
    energy = np.dot(masses, (speeds**2).sum(axis=1)) + np.dot(moments, np.square(turns))
    assert w @ np.array(MECHANISM.mass(lm.vec(*q))) @ w == pytest.approx(energy, rel=1e-13)
