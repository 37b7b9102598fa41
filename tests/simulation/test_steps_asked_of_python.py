"""Adaptive steps of which native code cannot make a trial: plain Python makes them, and all runs have the same bits."""

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.simulation.compiled.lanes import Lanes
from liemech.simulation.runs import run
from liemech.tableaus import BOGACKI_SHAMPINE3

pytestmark = pytest.mark.compiled
METHOD = lm.RKMK(tableau=BOGACKI_SHAMPINE3)
MU = np.random.default_rng(3).normal(size=(11, 3))


@lm.record
class Graded(lm.Hamiltonian):
    """A free body whose energy has a part that is counted in integers, beyond 64 bits where mu_1 > 0.4."""

    def grade(self, mu: lm.Vec) -> float:
        return 1e-5 * (int(1e19 * (1.0 + mu[0])) % 3) if mu[0] > 0.4 else 0.0

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * (mu[0] ** 2 + mu[1] ** 2 / 1.5 + mu[2] ** 2 / 2.0) + self.grade(mu) * mu[0]

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return lm.vec(mu[0] + self.grade(mu), mu[1] / 1.5, mu[2] / 2.0)


def plan(**given: Any) -> lm.Plan:
    return lm.Plan(lm.LiePoissonSystem(lm.SO3(), Graded()), METHOD, rtol=1e-4, progress=False, **given)


def noted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The bodies of which plain Python makes a step, from now on."""
    python: list[int] = []
    step = Lanes.plainly

    def told(lanes: Any, body: int, *rest: Any) -> None:
        python.append(body)
        step(lanes, body, *rest)

    monkeypatch.setattr(Lanes, "plainly", told)
    return python


@pytest.mark.parametrize("times", [None, [0.0, 0.7, 1.1, 3.0], [0.0, 3.0]])
def test_one_body(times: list[float] | None, monkeypatch: pytest.MonkeyPatch) -> None:
    python = noted(monkeypatch)
    for mu in ([0.3, -3.0, 2.0], [0.6, 3.0, 2.0]):  # across the limit, from both sides
        start = plan().system.state(mu)
        plain = plan(compiled=False).run(start, t_end=3.0, t_eval=times)
        python.clear()
        native = plan(compiled=True).run(start, t_end=3.0, t_eval=times)
        assert native.compiled and 0 < len(python) < plain.steps
        assert np.array_equal(native.mu, plain.mu) and np.array_equal(native.t, plain.t)
        assert (native.steps, native.rejected) == (plain.steps, plain.rejected)


@pytest.mark.slow
def test_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LONGEST", 8)
    python = noted(monkeypatch)
    times = np.linspace(0.0, 3.0, 8)
    native = plan(compiled=True).run(plan().system.state(MU), t_end=3.0, t_eval=times)
    assert native.compiled and len({*python}) > 1 and not native.stopped
    for i in range(0, len(MU), 2):
        alone = plan(compiled=False).run(plan().system.state(MU[i]), t_end=3.0, t_eval=times)
        assert np.array_equal(native.mu[:, i], alone.mu)
    further = plan(compiled=True).resume(native, t_end=4.0)
    alone = plan(compiled=False).resume(alone, t_end=4.0)
    assert np.array_equal(further.mu[-1, i], alone.mu[-1])
