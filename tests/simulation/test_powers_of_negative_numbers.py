"""A power of a negative number, complex in Python and nan in native code, is a step that left the
domain of a formula.
"""

from __future__ import annotations

from typing import Any

import pytest

import liemech as lm
from liemech.errors import InvalidInput, NotFinite


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


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_an_adaptive_run_does_not_begin_there(compiled: Any) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Edge())
    start = system.state([-1.0, 0.8, -0.5])
    with pytest.raises(NotFinite, match="at the start, t = 0"):
        lm.integrate(system, lm.RKMK(order=5), start, t_end=1.0, rtol=1e-6, compiled=compiled)


@pytest.mark.parametrize("name", ["energy", "gradient"])
def test_public_functions_have_no_value_there(name: str) -> None:
    with pytest.raises(InvalidInput, match=rf"Edge.{name} has no finite value at mu = \[-1.0"):
        getattr(Edge(), name)([[1.0, 0.0, 0.0], [-1.0, 0.8, -0.5]])
