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


@pytest.mark.parametrize(("control", "name"), [(control, name) for control in REFUSED for name in REFUSED[control]])
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


@pytest.mark.slow
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


BODY = lm.RigidBody([1.0, 1.5, 2.0])
START = BODY.state(mu=[0.5, 0.2, 0.8])
WORDS_OF_VALUES: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({"control": lm.FixedSteps(0.1, (0.15,), True), "steps": 8, "save": lm.Save(4, record="energy")},
     {"h": 0.1, "breaks": [0.15], "compensated": True, "steps": 8, "every": 4, "record": "energy"}),
    ({"control": lm.ErrorControl(1e-8, 1e-10, 0.01, 0.2), "t_end": 2.0, "save": lm.Save(at=[1.0, 2.0])},
     {"rtol": 1e-8, "atol": 1e-10, "h": 0.01, "max_step": 0.2, "t_end": 2.0, "t_eval": [1.0, 2.0]}),
    ({"control": lm.ErrorControl(h=0.3), "t_end": 2.0, "save": lm.Save(dense=False)},
     {"h": 0.3, "rtol": 1e-6, "t_end": 2.0, "dense": False}),
]  # fmt: skip


@pytest.mark.parametrize(("values", "words"), WORDS_OF_VALUES)
def test_values_say_what_words_say(values: dict[str, Any], words: dict[str, Any]) -> None:
    """To the bit, in `integrate` and in a plan, and in one that was made of another."""
    method, how = lm.RKMK(order=5), {"compiled": False}
    run = lm.integrate(BODY, method, START, **values, **how)
    assert run == lm.integrate(BODY, method, START, **words, **how)
    span = {n: x for n, x in words.items() if n in ("steps", "t_end", "t_eval")}
    control, at = values["control"], values["save"].at
    save = None if at else values["save"]
    plan = lm.Plan(BODY, method, control=control, save=save, **how)
    other = lm.Plan(BODY, method, 0.7, every=3, **how)
    assert plan.run(START, **span) == run
    assert other.replace(control=control, save=save or lm.Save()).run(START, **span) == run


def test_fixed_steps_are_fixed_up_to_an_end_whatever_the_method() -> None:
    run = lm.integrate(BODY, lm.RKMK(order=5), START, control=lm.FixedSteps(0.1), t_end=1.0)
    assert run.rejected is None and run.h == 0.1 and len(run) == 11
    words = lm.integrate(BODY, lm.RKMK(order=5), START, h=0.1, t_end=1.0)
    assert words.rejected is not None and words.steps < 10  # there h is the first step


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"control": lm.FixedSteps(0.1), "h": 0.2}, "h = 0.2 is given beside FixedSteps"),
        ({"save": lm.Save(2), "every": 3, "h": 0.1}, "every = 3 is given beside Save"),
        ({"save": lm.Save(at=[0.1]), "t_eval": [0.1], "h": 0.1}, "t_eval is given beside Save"),
        ({"control": lm.FixedSteps(0.1), "rtol": 1e-3}, "rtol = 0.001 is given beside FixedSteps"),
        ({"control": lm.FixedSteps}, r"such as FixedSteps\(h\)"),
        ({"control": lm.ErrorControl()}, "rtol is for adaptive steps; give t_end"),
        ({"save": 10, "h": 0.1}, r"such as Save\(every=10\); got 10"),
    ],
)
def test_words_are_given_in_one_place(given: dict[str, Any], message: str) -> None:
    with pytest.raises((InvalidInput, lm.errors.InvalidType), match=message):
        lm.integrate(BODY, lm.RKMK(order=5), START, steps=2, **given)


def test_the_times_of_a_run_are_none_of_a_plan() -> None:
    with pytest.raises(InvalidInput, match="t_eval="):
        lm.Plan(BODY, lm.RKMK(order=5), 0.1, save=lm.Save(at=[0.1]))


def test_no_events_may_be_none() -> None:
    """As in SciPy, where steps may be infinite; and no sites are held."""
    runs = [lm.integrate(BODY, lm.RKMK(order=4), START, h=0.1, steps=3, compiled=False, events=x) for x in (None, ())]
    assert runs[0] == runs[1] and runs[0].events == ()
    ways = dict(t_end=1.0, compiled=False)
    longest = [lm.integrate(BODY, lm.RKMK(order=5), START, max_step=x, **ways) for x in (None, np.inf)]
    assert longest[0] == longest[1]
    bodies = lm.PerSite(lm.KineticEnergy([1.0, 1.5, 2.0]))
    assert lm.Terms(bodies, held=None, pinned=None) == lm.Terms(bodies)
