"""States inside of the long steps of rods, which are made for all frames together."""

import numpy as np
import pytest

import liemech as lm

LEVEL = [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]
METHOD = lm.GalerkinVariational(order=2)


def swinging():
    """A stiff rod that begins to fall from level."""
    steel = lm.models.RodSection.round(radius=0.005, young=50e9, density=5000.0)
    rod = lm.models.CosseratRod(steel, 1.0, 3, gravity=9.81)
    return rod, rod.at_rest(rod.shape(start=LEVEL))


@pytest.mark.slow
@pytest.mark.parametrize("h", [2e-3, -2e-3])
def test_times_between_steps_are_shorter_steps(h):
    rod, start = swinging()
    run = lm.integrate(rod, METHOD, start, h=h, steps=5, compiled=False)
    times = np.array([0.0, 1.5, 2.0, 3.65, 5.0]) * h
    seen = lm.integrate(rod, METHOD, start, h=h, steps=5, t_eval=times, compiled=False)
    there = rod.state(mu=run.mu[3], g=run.g[3])
    short = lm.integrate(rod, METHOD, there, h=0.65 * h, steps=1, compiled=False)
    assert np.array_equal(seen.g[2], run.g[2]) and np.array_equal(seen.g[4], run.g[5])
    assert np.abs(seen.mu[3] - short.mu[-1]).max() < 1e-12 * np.abs(short.mu[-1]).max()
    assert np.array_equal(run.at(3.65 * h).g, seen.g[3])


@pytest.mark.slow
def test_an_event_is_met_where_a_shorter_step_has_it():
    rod, start = swinging()
    height = ("height", lambda t, site: site.g[2, 3])

    def low(t, total):
        return total.height + 1e-3

    run = lm.integrate(rod, METHOD, start, h=2e-3, steps=10, events=[low], record=["g", height], compiled=False)
    ((times, met),) = run.events
    assert len(times) == 1 and times[0] % 2e-3 > 1e-5
    assert abs(met.g[0, :, 2, 3].sum() + 1e-3) < 1e-12
    low.terminal = True
    ended = lm.integrate(rod, METHOD, start, h=2e-3, steps=10, events=[low], record=["g", height], compiled=False)
    assert ended.t[-1] == times[0] and ended.height[-1] == pytest.approx(-1e-3, abs=1e-12)


@pytest.mark.slow
def test_native_is_plain():
    rod, start = swinging()
    one, other = (
        lm.integrate(rod, METHOD, start, h=2e-3, steps=5, t_eval=[0.0, 3e-3, 7.3e-3], compiled=c) for c in (True, False)
    )
    assert np.array_equal(one.g, other.g) and np.array_equal(one.mu, other.mu)
