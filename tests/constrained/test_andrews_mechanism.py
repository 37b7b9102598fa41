"""Andrews' squeezing mechanism: the published numbers of the benchmark."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm

MECHANISM = lm.AndrewsMechanism()
END = [
    15.81077119629904,
    -15.75637105984298,
    0.04082224013073101,
    -0.5347301163226948,
    0.5244099658805304,
]
"""The first five angles at t = 0.03; the sixth is minus the fourth.  Source: Mazzia and Magherini,
II-10.
"""


def test_accelerations_and_multipliers_at_the_start() -> None:
    start = MECHANISM.from_rest()
    acceleration, multipliers = MECHANISM.acceleration(start.q, 0.0 * start.q)
    assert np.array(acceleration) == pytest.approx(
        [14222.4439199541, -10666.8329399656, 0, 0, 0, 0, 0], abs=1e-7
    )
    assert np.array(multipliers) == pytest.approx(
        [98.5668703962411, -6.12268834425567, 0, 0, 0, 0], abs=1e-9
    )
    assert np.allclose(MECHANISM.multipliers(start.q, start.p), multipliers, rtol=0.0, atol=1e-9)


def test_energy_and_constraints_are_constants_of_the_reduced_equation() -> None:
    start = MECHANISM.from_rest()
    run = lm.integrate(
        MECHANISM, lm.RKMK(order=4), start, h=1e-4, steps=4, compiled=False, progress=False
    )
    assert np.abs(run.q[-1] - run.q[0]).max() > 1e-3
    assert run.drift()["energy"].largest < 1e-6 and run.drift()["constraint"].largest < 1e-6


@pytest.mark.slow
def test_where_it_is_after_three_hundredths_of_a_second() -> None:
    run = lm.integrate(
        MECHANISM, lm.RKMK(order=8), MECHANISM.from_rest(), t_end=0.03, rtol=1e-10, compiled=False
    )
    assert run.q[-1, :5] == pytest.approx(END, abs=1e-7) and run.q[-1, 5] == pytest.approx(
        -END[3], abs=1e-7
    )
    multipliers = [199.17533, -29.755312, 23.066541, 31.452714, 22.642492, 11.617407]
    assert np.array(MECHANISM.multipliers(run.q[-1], run.p[-1])) == pytest.approx(
        multipliers, abs=2e-5
    )
