"""compensated=True on bodies in fields: every method adds increments to momentum and attitude, and
what rounding takes is kept.
"""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.formulas.compensated import Compensated
from liemech.formulas.pytree import compensated

EPS = 2.0**-52
TOP = lm.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.0, 0.0, 1.0])
START = TOP.state([0.5, 0.3, 2.8], np.eye(3))
METHODS = (
    lm.RKMK(order=4),
    lm.CommutatorFree(order=4),
    lm.CrouchGrossman(order=3),
    lm.Taylor(4, lm.Exponential()),
    lm.LieVerlet(),
)


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_a_step_keeps_what_rounding_takes(method: lm.Method) -> None:
    """The low parts are there after a step, and the value they belong to is that of an ordinary
    step, to rounding.
    """
    start = compensated(START)
    after = method.observe(method.step(TOP, 0.0, method.start(TOP, start, 0.1), 0.1))
    plain = method.observe(method.step(TOP, 0.0, method.start(TOP, START, 0.1), 0.1))
    numbers = [*after.mu, *(x for row in after.g for x in row)]
    assert all(isinstance(x, Compensated) for x in numbers)
    assert any(x.rest != 0.0 for x in numbers)
    expected = [*plain.mu, *(x for row in plain.g for x in row)]
    assert [x.value for x in numbers] == pytest.approx(expected, abs=8 * EPS)


@pytest.mark.slow
@pytest.mark.compiled
def test_what_it_brings() -> None:
    """Orthogonality after 20,000 steps of RKMK 4: rounding walks without it."""
    off = []
    for choice in (False, True):
        run = lm.integrate(
            TOP,
            lm.RKMK(order=4),
            START,
            h=0.01,
            steps=20_000,
            every=20_000,
            compensated=choice,
            compiled=True,
        )
        off.append(np.abs(run.g[-1].T @ run.g[-1] - np.eye(3)).max())
    assert off[1] <= 6 * EPS
    assert off[0] >= 3 * off[1]
