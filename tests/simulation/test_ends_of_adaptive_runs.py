"""Where adaptive runs end: by an event, by a failure, by Ctrl-C, or at their very start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IntegrationInterrupted
from liemech.simulation.adaptive_ensemble import AdaptiveEnsemble
from liemech.tableaus import BOGACKI_SHAMPINE3

METHOD = lm.RKMK(tableau=BOGACKI_SHAMPINE3)
KEPLER, BODY = lm.Kepler(), lm.RigidBody([1.0, 1.5, 2.0])
FALLING = KEPLER.state(q=[[0.6, 0.0], [0.5, 0.0], [0.7, 0.0]], p=[[0.0, 1.4], [0.0, 0.0], [0.0, 1.1]])
TURNING = BODY.state(mu=[[0.3, 0.4, 2.0], [1.0, -0.5, 0.2], [2.0, 0.1, 0.4]])
WORLDS = pytest.mark.parametrize("compiled", [pytest.param(True, marks=pytest.mark.compiled), False])


def plan(system: Any = KEPLER, compiled: bool | None = True, **how: Any) -> lm.Plan:
    return lm.Plan(system, METHOD, **{"rtol": 1e-4, "progress": False} | how, compiled=compiled)


@WORLDS
def test_a_body_that_fell_into_the_centre_stays_stopped(compiled: bool) -> None:
    """Also in a run that goes on and asks for its samples at other times."""
    falling = plan(compiled=compiled)
    with pytest.warns(RuntimeWarning, match="1 of 3 bodies"):
        before = falling.run(FALLING, t_end=1.0)
    with pytest.warns(RuntimeWarning, match="1 of 3 bodies"):
        after = falling.resume(before, t_end=1.5, t_eval=[1.25, 1.5])
    assert after.stopped.steps == before.stopped.steps and set(after.stopped) == {1}


@pytest.mark.compiled
def test_lanes_can_take_over_from_bodies_of_which_no_samples_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two bodies run in plain Python, then the others in lanes."""
    turning = plan(BODY)
    whole = turning.run(TURNING, t_end=1.0)
    some = AdaptiveEnsemble._side_by_side
    monkeypatch.setattr(
        AdaptiveEnsemble, "_side_by_side", lambda run, i, bar: i >= 2 and some(run, i, bar)
    )
    run = turning.run(TURNING, t_end=1.0, t_eval=[])
    assert run.mu.shape == (0, 3, 3)
    assert np.array_equal(turning.resume(run, t_end=2.0).mu, turning.resume(whole, t_end=2.0).mu)


@pytest.mark.compiled
@pytest.mark.parametrize("where", ["_moved", "_sample"])
def test_after_ctrl_c_every_sample_is_one_of_the_whole_run(
    where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever it comes; and from there the run goes on to the same end."""
    turning, times = plan(BODY), [0.0, 0.3, 0.6, 0.9, 1.0]
    whole = turning.run(TURNING, t_end=1.0, t_eval=times)
    true = getattr(AdaptiveEnsemble, where)

    def pressed(*_: Any) -> None:
        monkeypatch.setattr(AdaptiveEnsemble, where, true)
        raise KeyboardInterrupt

    monkeypatch.setattr(AdaptiveEnsemble, where, pressed)
    with pytest.raises(IntegrationInterrupted) as caught:
        turning.run(TURNING, t_end=1.0, t_eval=times)
    run: Any = caught.value.trajectory
    at = np.broadcast_to(run.t[:, None] if run.t.ndim == 1 else run.t, (5, 3))
    for i in range(3):
        place = np.searchsorted(times, at[:, i])
        assert np.array_equal(np.array(times)[place], at[:, i])
        assert np.array_equal(run.mu[:, i], whole.mu[place, i])
    assert np.array_equal(turning.resume(run, t_end=1.0).mu[-1], whole.mu[-1])
