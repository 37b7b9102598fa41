"""Splittings by colours of energies that change with time."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from terms_of_spins import Exchange

import liemech as lm
from liemech.rooms.sites.runs import run as run_of_sites

N, FIELD = 6, [0.3, -0.7, 0.4]


@lm.record
class Wave(lm.Term):
    """A field that oscillates."""

    B: lm.Vec
    w: float

    def energy(self, a: Any, t: float) -> float:
        return -lm.formulas.sin(self.w * t + 0.3) * lm.dot(self.B, a.mu)


@lm.record
class Breathing(lm.Term):
    """An exchange whose strength does."""

    J: float

    def energy(self, a: Any, b: Any, t: float) -> float:
        return -self.J * (1.0 + 0.3 * lm.formulas.cos(2.0 * t)) * lm.dot(a.mu, b.mu)


@lm.record
class Pulse(lm.Term):
    """An anisotropy that is there late only."""

    k: float

    def energy(self, a: Any, t: float) -> float:
        return self.k * lm.formulas.where(t > 200.0, 1.0, 0.0) * a.mu[2] * a.mu[2] * a.mu[0]


@lm.record
class Strong(lm.Term):
    """A field that becomes strong at t = 0.25."""

    B: float

    def energy(self, a: Any, t: float) -> float:
        return lm.formulas.where(t > 0.25, self.B, 1.0) * a.mu[2]


def driven(*more: Any) -> Any:
    terms = Breathing(1.0).over(lm.neighbours.ring(N)), Wave(FIELD, 1.7), *more
    return lm.DrivenLiePoissonSystem(lm.SO3() ** N, lm.Terms(*terms))


def start() -> np.ndarray:
    mu = np.random.default_rng(4).normal(size=(N, 3))
    return mu / np.linalg.norm(mu, axis=1)[:, None]


@cache
def reference() -> np.ndarray:
    def rate(t: float, y: np.ndarray) -> np.ndarray:
        m = y.reshape(N, 3)
        xi = -(1.0 + 0.3 * np.cos(2.0 * t)) * (np.roll(m, 1, axis=0) + np.roll(m, -1, axis=0))
        return np.cross(m, xi - np.sin(1.7 * t + 0.3) * np.array(FIELD)).ravel()

    return solve_ivp(rate, (0.0, 2.0), start().ravel(), "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [lm.SublatticeSplitting(), lm.SublatticeSplitting(order=4), lm.BondSplitting(order=4)], ids=repr
)
def test_order_and_way_back(method: Any) -> None:
    first, errors = driven().state(mu=start()), []
    for steps in (20, 40):
        run = lm.integrate(driven(), method, first, h=2.0 / steps, steps=steps, every=steps)
        errors.append(np.abs(run.mu[-1].ravel() - reference()).max())
    assert abs(np.log2(errors[0] / errors[1]) - method.order) < 0.1
    plan = lm.Plan(driven(), method, h=-2.0 / 40, every=40)
    back = plan.run(driven().state(mu=run.mu[-1]), steps=40, t0=2.0)
    assert np.abs(back.mu[-1] - start()).max() < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.SublatticeSplitting(), lm.BondSplitting()], ids=repr)
def test_as_written_out(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """In plain Python and natively; the time at the end of a step is rounded in two ways."""
    found = []
    for small, compiled in ((1000, False), (0, False), (0, None)):
        monkeypatch.setattr(lm.System, "small", small)
        plan = lm.Plan(driven(), method, h=0.05, every=3, compiled=compiled)
        run = plan.run(driven().state(mu=start()), steps=13)
        begun = plan.run(driven().state(mu=start()), steps=7)
        assert np.array_equal(plan.resume(begun, steps=6).mu[1:], run.mu[3:])
        found.append(run.mu.reshape(-1, N, 3))
    assert np.array_equal(found[1], found[2])
    assert np.abs(found[0] - found[1]).max() < 1e-15


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 8])
def test_the_step_that_overflows_is_told(every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_of_sites, "PATIENCE", 1e3)  # so that one call makes many steps
    with pytest.raises(lm.errors.NotFinite, match=r"overflowed.*site \d, after step 2, t = 0.2") as caught:
        lm.integrate(
            driven(Strong(1e200)), lm.SublatticeSplitting(), driven().state(mu=start()), h=0.1, steps=8,
            every=every, compiled=False,
        )  # fmt: skip
    assert caught.value.trajectory.t[-1] == (0.2 if every == 1 else 0.0)


def test_what_cannot_be_told_is_refused() -> None:
    """A term that is zero whenever it is tried may be anything later."""
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"Pulse\(k=1.0\) is not affine"):
        lm.Plan(driven(Pulse(1.0)), lm.SublatticeSplitting(), h=0.1)
    constant = lm.Terms(Exchange(0.0).over(lm.neighbours.ring(N)), Wave(FIELD, 1.7))
    lm.Plan(lm.DrivenLiePoissonSystem(lm.SO3() ** N, constant), lm.BondSplitting(), h=0.1)
