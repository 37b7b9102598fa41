"""Splittings by colours that are looked into: states at times inside of steps, zeros of events."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_runs_by_sites import directions, native, spins

import liemech as lm
from liemech.rooms.sites.runs import run as run_of_sites

N = 7
SQUARES = ("squares", lambda t, site: site.mu[0] * site.mu[0])
START = np.random.default_rng(5).normal(size=(N, 3))
LEVEL = 1.0 * np.sum(START[:, 0] ** 2) - 0.5
METHODS = lm.SublatticeSplitting(order=4), lm.BondSplitting()


def level(t: float, total: Any) -> float:
    return total.squares - LEVEL


def whole(t: float, state: Any) -> float:
    """The same of the state of all sites."""
    return lm.sum([state.mu[3 * i] * state.mu[3 * i] for i in range(N)]) - LEVEL


def small_runs(monkeypatch: pytest.MonkeyPatch, numbers: int) -> None:
    monkeypatch.setattr(lm.System, "small", numbers)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "h"), [(METHODS[0], -0.1), (METHODS[1], 0.1)], ids=repr)
def test_times_inside(monkeypatch: pytest.MonkeyPatch, method: Any, h: float) -> None:
    """The states that the system written out has, in plain Python and natively."""
    g = np.stack([np.eye(3)] * N)
    monkeypatch.setattr(run_of_sites, "PATIENCE", 1e3)  # so that one call makes many steps
    times = np.copysign([0.0, 0.03, 0.28, 0.5, 0.61, 0.7], h)
    found = []
    for numbers, compiled in ((1000, False), (0, False), (0, None)):
        small_runs(monkeypatch, numbers)
        plan = lm.Plan(spins(N), method, h=h, compiled=compiled, progress=False)
        found.append(plan.run(spins(N).state(START, g), t_end=7 * h, t_eval=times))
    for run in found[1:]:
        assert np.array_equal(run.t, times)
        assert np.array_equal(run.mu, found[0].mu.reshape(run.mu.shape))
        assert np.array_equal(run.g, found[0].g.reshape(run.g.shape))


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_zeros(monkeypatch: pytest.MonkeyPatch, method: Any) -> None:
    """Those of the state of all sites, written out; the run goes on as one that looks for none."""
    start, way = spins(N).state(mu=START), {"h": 0.1, "every": 7, "progress": False}
    plan = lm.Plan(spins(N), method, record=["mu", SQUARES], events=[level], **way)
    run = plan.run(start, steps=60)
    small_runs(monkeypatch, 1000)
    written = lm.Plan(spins(N), method, events=[whole], **way).run(start, steps=60)
    assert len(run.events[0][0]) > 1
    assert np.abs(run.events[0][0] - written.events[0][0]).max() < 1e-13
    assert np.array_equal(run.mu, written.mu.reshape(run.mu.shape))
    small_runs(monkeypatch, 12)
    begun = plan.run(start, steps=23)
    rest = plan.resume(begun, steps=37)
    zeros = [x.events[0][0] for x in (begun, rest)]
    assert np.array_equal(np.concatenate(zeros), run.events[0][0])
    assert np.array_equal(rest.mu[1:], run.mu[4:])


@native
def test_the_second_zero_ends_the_run() -> None:
    def ends(t: float, total: Any) -> float:
        return level(t, total)

    ends.terminal = 2  # type: ignore[attr-defined]
    start = spins(N).state(mu=START)
    run = lm.integrate(spins(N), METHODS[0], start, h=0.1, steps=60, every=7, record=[SQUARES], events=[ends])
    assert run.ended == 0
    assert run.carry is None
    assert len(run.events[0][0]) == 2
    assert run.t[-1] == run.events[0][0][-1]
    assert abs(run.squares[-1] - LEVEL) < 1e-12


def test_what_functions_are_of() -> None:
    """By the name of their second argument: of one site, of totals, of the state of all."""
    start, way = spins(N).state(mu=START), {"h": 0.1, "steps": 3}
    of_site = lm.integrate(spins(N), lm.RKMK(), start, record=[("spin", lambda t, site: site.mu)], **way)
    of_all = lm.integrate(spins(N), lm.RKMK(), start, record=[("spin", lambda t, state: state.mu[:3])], **way)
    assert of_site.spin.shape == of_all.spin.shape == (4, 3)
    assert np.abs(of_site.spin[0] - START.sum(axis=0)).max() < 1e-15
    assert np.array_equal(of_all.spin[0], START[0])
    many = spins(200), lm.RKMK(), spins(200).state(mu=directions(200))
    found = lm.integrate(*many, record=[("spin", lambda t, state: state.mu[:3])], **way)
    assert np.array_equal(found.spin[0], directions(200)[0])
    with pytest.raises(lm.errors.InvalidInput, match="which record= names"):
        lm.integrate(*many, record=["mu"], events=[lambda t, total: total.spin[0]], **way)
    with pytest.raises(lm.errors.InvalidInput, match=r"asks for total.spin; record= names squares"):
        lm.integrate(*many, record=[SQUARES], events=[lambda t, total: total.spin[0]], **way)
    with pytest.raises(lm.errors.InvalidInput, match="is of one site, and events are of totals"):
        lm.integrate(*many, record=[SQUARES], events=[lambda t, site: site.mu[0]], **way)


def test_at_needs_all_steps() -> None:
    run = lm.integrate(spins(N), lm.RKMK(), spins(N).state(mu=START), h=0.1, steps=3, every=3)
    with pytest.raises(lm.errors.InvalidInput, match="kept all its steps"):
        run.at(0.05)
