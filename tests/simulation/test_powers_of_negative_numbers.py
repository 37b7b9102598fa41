"""A power of a negative number, complex in Python and nan in native code, is a step that left the
domain of a formula.
"""

from __future__ import annotations

from typing import Any

import pytest

import liemech as lm
from liemech.errors import NotFinite


@lm.record
class Edge(lm.Hamiltonian):
    """(mu_1 + 0.2)^1.5 exists where mu_1 > -0.2."""

    def energy(self, mu: lm.Vec) -> float:
        return (
            0.5 * (mu[0] * mu[0] + 2.0 * mu[1] * mu[1] + 3.0 * mu[2] * mu[2])
            + 0.01 * (mu[0] + 0.2) ** 1.5
        )


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_it_ends_the_body_that_left_and_no_other(compiled: Any) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Edge())
    start = system.state([[0.3, 0.8, -0.5], [2.0, 0.01, 0.0]])
    plan = lm.Plan(system, lm.RKMK(order=2), 0.05, compiled=compiled)
    with pytest.warns(RuntimeWarning, match="1 of 2 bodies"):
        run = plan.run(start, steps=40)
    assert [*run.stopped] == [0]
    with pytest.raises(NotFinite):
        plan.replace(compiled=False).run(system.state(start.mu[0]), steps=40)
