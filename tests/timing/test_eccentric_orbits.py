"""Kepler's ellipse with e = 0.9, the example of the slides: its table of errors, long runs, and
eccentricities up to 0.999.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.tableaus import KAHAN_LI8, SplittingTableau

KEPLER = lm.Kepler()
ORBIT = KEPLER.pericentre(0.9)
PERIOD = 2.0 * np.pi

SIGMAS = {
    "1": lm.time_scales.EqualArc(),
    "2, alpha = 2": lm.time_scales.DistancePower(2.0),
    "2, alpha = 3/2": lm.time_scales.DistancePower(1.5),
    "3": lm.time_scales.EqualChange(),
    "4": lm.time_scales.EqualPath(),
}
PERIODS = {"1": 16.0, "2, alpha = 2": 14.4, "2, alpha = 3/2": 8.4, "3": 15.2, "4": 3.3}
"""A period in fictive time, to three figures."""

SYMPLECTIC = {
    "2, alpha = 2": (3.0e-4, 7.6e-5),
    "2, alpha = 3/2": (1.9e-4, 4.6e-5),
    "3": (3.2e-4, 7.9e-5),
    "4": (3.8e-3, 9.4e-4),
}
REVERSIBLE = {
    "1": (8.4e-4, 2.1e-4),
    "2, alpha = 2": (1.1e-3, 2.6e-4),
    "2, alpha = 3/2": (5.2e-4, 1.3e-4),
    "3": (9.1e-4, 2.3e-4),
    "4": (6.6e-3, 1.6e-3),
}
"""max |H - H_0| over ten periods, in about 5000 and about 10000 steps.

Source: math of the slides (Hairer, Lubich, Wanner, VIII.2 and VIII.3), computed by an independent program.
"""


def fictive_period(sigma: lm.TimeScale) -> float:
    """The integral of dt/sigma over a revolution."""
    E = PERIOD * (np.arange(4096) + 0.5) / 4096
    t = E - 0.9 * np.sin(E)
    places = KEPLER.exact(ORBIT, t)
    bound = sigma.bound(KEPLER, ORBIT)
    values = [bound.value(KEPLER, KEPLER.state(q, p)) for q, p in zip(places.q, places.p)]
    return float(np.sum((1.0 - 0.9 * np.cos(E)) / values) * PERIOD / 4096)


def two_digits(wanted: float) -> Any:
    """The second digit is the same, or the next one where the third is a five."""
    return pytest.approx(wanted, abs=0.6 * 10.0 ** np.floor(np.log10(wanted) - 1.0))


def energy_error(system: Any, method: lm.Method, h: float, steps: int) -> float:
    run = lm.integrate(system, method, ORBIT, h=h, steps=steps)
    return float(np.abs(run.energy + 0.5).max())


@pytest.mark.parametrize("choice", SIGMAS)
def test_the_period_in_fictive_time(choice: str) -> None:
    assert fictive_period(SIGMAS[choice]) == pytest.approx(PERIODS[choice], rel=6e-3)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("choice", SYMPLECTIC)
def test_table_of_the_symplectic_method(choice: str) -> None:
    h = fictive_period(SIGMAS[choice]) / 500
    for k, wanted in enumerate(SYMPLECTIC[choice]):
        found = energy_error(lm.TimeTransformed(KEPLER, SIGMAS[choice]), lm.AdaptiveVerlet(), h / 2**k, 5000 * 2**k)
        assert found == two_digits(wanted)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("choice", REVERSIBLE)
def test_table_of_the_reversible_controller(choice: str) -> None:
    h, method = (fictive_period(SIGMAS[choice]) / 500, lm.ReversibleController(lm.StormerVerlet(), SIGMAS[choice]))
    for k, wanted in enumerate(REVERSIBLE[choice]):
        assert energy_error(KEPLER, method, h / 2**k, 5000 * 2**k) == two_digits(wanted)


@pytest.mark.compiled
def test_table_of_equal_steps() -> None:
    for steps, wanted in ((5000, 2.1e-1), (10000, 5.0e-2)):
        assert energy_error(KEPLER, lm.StormerVerlet(), 10.0 * PERIOD / steps, steps) == two_digits(wanted)


# ------------------------------------------------------------------ long runs, and narrower ellipses


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("e", [0.99, 0.999])
def test_steps_for_each_revolution_do_not_grow_with_the_eccentricity(e: float) -> None:
    """120 steps of order 8: fixed steps of Stormer and Verlet need about 120 for each (1 - e)^(3/2) of a period."""
    start = KEPLER.pericentre(e)
    method = lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI8).exchanged)
    run = lm.integrate(lm.LogarithmicHamiltonian(KEPLER), method, start, h=PERIOD / 120, t_end=10.0 * PERIOD)
    assert run.steps < 10 * 121
    assert run.drift()["Runge-Lenz vector"].verdict == "exact"
    assert np.abs(run.at(9.5 * PERIOD).q - KEPLER.exact(start, 9.5 * PERIOD).q).max() < 1e-10


@pytest.mark.compiled
@pytest.mark.slow
@pytest.mark.parametrize("e", [0.99, 0.999])
def test_narrow_ellipses_by_distance_powers(e: float) -> None:
    start = KEPLER.pericentre(e)
    far = KEPLER.exact(start, 9.5 * PERIOD)
    for method, system in (
        (lm.ReversibleController(lm.Splitting(order=6), lm.time_scales.DistancePower(1.5)), KEPLER),
        (lm.Composition(lm.AdaptiveVerlet(), order=6), lm.TimeTransformed(KEPLER, lm.time_scales.DistancePower(1.5))),
    ):
        run = lm.integrate(system, method, start, h=PERIOD / 200, t_end=9.5 * PERIOD)
        assert run.steps < 10 * 500 and np.abs(run.q[-1] - far.q).max() < 1e-3


@pytest.mark.compiled
@pytest.mark.slow
@pytest.mark.parametrize("choice", ["2, alpha = 3/2", "3"])
def test_no_drift_over_a_hundred_thousand_periods(choice: str) -> None:
    """Fifty million steps of each method: the largest energy error of the last tenth is that of the first."""
    h = fictive_period(SIGMAS[choice]) / 500
    for system, method in (
        (lm.TimeTransformed(KEPLER, SIGMAS[choice]), lm.AdaptiveVerlet()),
        (KEPLER, lm.ReversibleController(lm.StormerVerlet(), SIGMAS[choice])),
    ):
        run = lm.integrate(system, method, ORBIT, h=h, steps=50_000_000, every=997, progress=False)
        assert run.t[-1] > 9e4 * PERIOD
        error, tenth = np.abs(run.energy + 0.5), len(run) // 10
        first, last = error[:tenth].max(), error[-tenth:].max()
        assert last == pytest.approx(first, rel=1e-2)


@pytest.mark.compiled
@pytest.mark.slow
def test_orbits_stay_exact_over_a_hundred_thousand_periods() -> None:
    system, method = lm.LogarithmicHamiltonian(KEPLER), lm.StormerVerlet(first="drift")
    run = lm.integrate(system, method, ORBIT, h=0.1, steps=6_300_000, every=1009, progress=False)
    assert run.t[-1] > 9e4 * PERIOD
    assert np.abs(run.energy + 0.5).max() < 1e-13 * 29.0
    assert np.abs(KEPLER.runge_lenz(run.q, run.p) - [0.9, 0.0]).max() < 1e-10
