"""Tangent maps by parameters of the method and by the step, beside differences of order 8."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech import errors

KEPLER = lm.Kepler()
PLANET = KEPLER.state(q=[0.6, 0.0], p=[0.0, 1.4])
BODY = lm.RigidBody([1.0, 1.5, 2.0])
TURNING = BODY.state(mu=[0.5, 0.1, 0.8])


@lm.record
class Shares(lm.Method):
    """Kicks before and after a drift, in shares that are parameters; the force grows with time."""

    order: ClassVar[int] = 1

    first: float = 0.5
    others: lm.Vec = lm.vec(0.3, 0.7)

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        p = state.p + (self.first * h * (1.0 + 0.1 * t)) * system.force(state.q, state.p)
        q = state.q + ((self.others[0] + self.others[1] ** 2) * h) * system.velocity(state.q, p)
        return lm.CanonicalState(q, p + ((1.0 - self.first) * h) * system.force(q, p))


def slope(function: Callable[[float], np.ndarray], x: float, d: float) -> np.ndarray:
    weights = enumerate((4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0), 1)
    return sum(w * (function(x + k * d) - function(x - k * d)) for k, w in weights) / d


def end(plan: lm.Plan, start: Any, **how: Any) -> np.ndarray:
    """The numbers of the last sample, with its physical time in fictive time."""
    run: Any = plan.run(start, **how)
    numbers = [np.ravel(x[-1]) for x in run.states.values()]
    return np.concatenate([*numbers, run.t[-1:]] if hasattr(run, "tau") else numbers)


def test_parameters_of_a_method_and_its_step():
    plan = lm.Plan(KEPLER, Shares(), h=0.05, compiled=False)
    how: Any = dict(steps=6, t0=0.3)
    found = plan.tangent(PLANET, by=["start", "attraction", "method.first", "method.others", "h"], **how).tangent
    alone = plan.tangent(PLANET, **how).tangent["start"]
    assert np.abs(found["start"] - alone).max() < 1e-14
    of = {
        "method.first": lambda x: plan.replace(method=Shares(x)),
        "method.others": lambda x: plan.replace(method=Shares(0.5, lm.vec(0.3, x))),
        "h": lambda h: plan.replace(h=h),
        "attraction": lambda k: plan.replace(system=lm.Kepler(k)),
    }
    at = {"method.first": 0.5, "method.others": 0.7, "h": 0.05, "attraction": 1.0}
    for name, x in at.items():
        wanted = slope(lambda x, name=name: end(of[name](x), PLANET, **how), x, x / 64)
        assert np.abs(found[name][-1][:, -1] - wanted).max() < 1e-11 * (1.0 + 1.0 / x), name


def test_an_implicit_step_by_its_length_is_the_velocity_in_the_end():
    """By h at n steps: n times the velocity, up to the error of the method."""
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), h=0.02, compiled=False)
    found = plan.tangent(TURNING, steps=10, by="h").tangent["h"]
    wanted = slope(lambda h: end(plan.replace(h=h), TURNING, steps=10), 0.02, 1e-3)
    assert np.abs(found[-1][:, 0] - wanted).max() < 1e-11
    last = plan.run(TURNING, steps=10).mu[-1]
    rate = np.cross(last, last / np.array([1.0, 1.5, 2.0]))
    assert np.abs(found[-1][:, 0] / 10.0 - rate).max() < 1e-3


def test_parameters_of_a_clock():
    def method(power: float) -> lm.Method:
        return lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(power))

    plan = lm.Plan(KEPLER, method(1.5), h=0.05, compiled=False)
    found = plan.tangent(PLANET, steps=5, by=["method.sigma.power", "h"]).tangent
    of = {
        "method.sigma.power": (1.5, lambda x: plan.replace(method=method(x))),
        "h": (0.05, lambda h: plan.replace(h=h)),
    }
    for name, (x, made) in of.items():
        wanted = slope(lambda x, made=made: end(made(x), PLANET, steps=5), x, x / 64)
        assert np.abs(found[name][-1][:, 0] - wanted).max() < 1e-11


def test_adaptive_steps_by_a_parameter_of_the_method():
    """With steps held fixed: where all have one length, the map of steps of this length."""

    @lm.record
    class Scaled(lm.RKMK):
        scale: float = 1.0

        def step(self, system: Any, t: float, state: Any, h: float) -> Any:
            return super().step(system, t, state, self.scale * h)

        def trial(self, system: Any, t: float, state: Any, first: Any, h: float, *tolerances: Any) -> Any:
            return super().trial(system, t, state, first, self.scale * h, *tolerances)

    method = Scaled(order=5)
    plan = lm.Plan(BODY, method, rtol=1e-3, max_step=0.125, h=0.125, compiled=False)
    found: Any = plan.tangent(TURNING, t_end=0.5, by="method.scale")
    assert np.array_equal(np.diff(found.t), [0.125] * 4)
    same = lm.Plan(BODY, method, h=0.125, compiled=False).tangent(TURNING, steps=4, by="h")
    assert np.abs(found.tangent["method.scale"] - 0.125 * same.tangent["h"]).max() < 1e-14


def test_what_is_no_parameter():
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), h=0.1, compiled=False)
    for by, words in (
        ("theta", "theta is no parameter of RigidBody.*of the method method.name"),
        ("method.theta", "theta is no parameter of CovariantVariational"),
        ("method.retraction", "retraction of CovariantVariational.* is no number"),
    ):
        with pytest.raises(errors.InvalidInput, match=words):
            plan.tangent(TURNING, steps=1, by=by)
    with pytest.raises(errors.InvalidInput, match="adaptive ones are held fixed"):
        lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6).tangent(TURNING, t_end=1.0, by="h")
    with pytest.raises(errors.IncompatibleSystem, match="power series"):
        lm.Plan(BODY, lm.Taylor(order=6), h=0.1).tangent(TURNING, steps=1, by="h")


OF_POWERS = [
    lm.LiePoissonHamiltonJacobi(6),
    lm.HamiltonJacobi(3),
    lm.Composition(lm.LiePoissonHamiltonJacobi(4, lm.Cayley()), order=6),
    lm.FirstKindHamiltonJacobi(3, scale=1.0),
    *(lm.SymmetricHamiltonJacobi(4, kind) for kind in ("qQ", "pP")),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "compiled"), [*((m, True) for m in OF_POWERS), *((m, False) for m in OF_POWERS[:2])], ids=repr
)
def test_methods_of_power_series_by_everything(method: Any, compiled: bool) -> None:
    """Beside differences of order 8; once they carried derivatives by the start alone, or none."""
    canonical = isinstance(method, (lm.HamiltonJacobi, lm.SymmetricHamiltonJacobi))
    system, start, name = (KEPLER, PLANET, "attraction") if canonical else (BODY, TURNING, "inertia")
    plan = lm.Plan(system, method, h=0.1, compiled=compiled)
    found = plan.tangent(start, steps=2, by=["start", name, "h"]).tangent

    def with_parameter(x: float) -> Any:
        return plan.replace(system=lm.Kepler(x) if canonical else lm.RigidBody([1.0, x, 2.0]))

    by_step = slope(lambda h: end(plan.replace(h=h), start, steps=2), 0.1, 1e-3)
    by_parameter = slope(lambda x: end(with_parameter(x), start, steps=2), 1.0 if canonical else 1.5, 1e-2)
    assert np.abs(found["h"][-1][:, 0] - by_step).max() < 1e-9
    assert np.abs(found[name][-1][:, 0 if canonical else 1] - by_parameter).max() < 1e-9
    if canonical:
        J, D = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(2)), found["start"][-1]
        assert np.abs(D.T @ J @ D - J).max() < 1e-13
    w = np.sin(1.0 + np.arange(len(found["h"][-1])))
    back = plan.pullback(w, start, steps=2, by=["start", name])
    assert np.abs(back["start"] - w @ found["start"][-1]).max() < 1e-12
    assert np.abs(back[name] - w @ found[name][-1]).max() < 1e-12
