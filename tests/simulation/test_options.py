"""One table says which option is for which control."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput
from liemech.simulation.options import EQUAL, FICTIVE, REFUSED, TOLERANCE, Options

GIVEN: dict[str, Any] = {
    "rtol": 1e-6, "atol": 1e-6, "max_step": 0.1, "dense": False, "every": 2, "compensated": True,
    "precision": "double-double", "breaks": [0.5],
}  # fmt: skip
METHODS = {
    EQUAL: lm.RKMK(order=4),
    TOLERANCE: lm.RKMK(order=5),
    FICTIVE: lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5)),
}


@pytest.mark.parametrize(
    ("control", "name"), [(control, name) for control in REFUSED for name in REFUSED[control]]
)
def test_what_is_not_for_a_control_is_refused_by_its_name(control: str, name: str) -> None:
    options = Options(h=None if control == TOLERANCE else 0.1, **{name: GIVEN[name]}).checked()
    with pytest.raises(InvalidInput, match=f"integrate: {name} is "):
        options.require(control, METHODS[control])


@pytest.mark.parametrize("control", REFUSED)
def test_all_else_is_allowed(control: str) -> None:
    names = set(GIVEN) - set(REFUSED[control]) - {"compensated"}
    options = Options(h=0.1, **{name: GIVEN[name] for name in names})
    if control == FICTIVE:
        options = options._replace(breaks=())
    options.checked().require(control, METHODS[control])


def test_a_plan_keeps_its_options() -> None:
    plan = lm.Plan(lm.RigidBody([1.0, 1.5, 2.0]), METHODS[EQUAL], 0.1, every=3, breaks=[2.0, 1.0])
    assert plan.options == Options(h=0.1, every=3, breaks=(1.0, 2.0))
    assert plan.replace(every=1).options.every == 1


@pytest.mark.compiled
def test_bodies_in_fictive_time_meet_events_side_by_side() -> None:
    """Each as it does alone, in plain Python."""

    def across(t: float, state: Any) -> float:
        return state.q[1]

    kepler = lm.Kepler()
    q = np.array([[1.0 + 0.1 * i, 0.2] for i in range(5)])
    p = np.array([[0.0, 0.9 - 0.05 * i] for i in range(5)])
    given: Any = {"h": 0.05, "events": [across], "progress": False}
    lanes = lm.Plan(kepler, METHODS[FICTIVE], compiled=True, **given)
    plain = lm.Plan(kepler, METHODS[FICTIVE], compiled=False, **given)
    runs = lanes.run(kepler.state(q, p), t_end=9.0, t_eval=[0.0, 3.3, 9.0])
    assert runs.compiled
    for i in range(5):
        alone = plain.run(kepler.state(q[i], p[i]), t_end=9.0, t_eval=[0.0, 3.3, 9.0])
        assert np.array_equal(runs.q[:, i], alone.q)
        assert np.array_equal(runs.events[0][i][0], alone.events[0][0])
        assert len(alone.events[0][0]) > 0
