"""Choices between power series that carry derivatives: generating functions of piecewise energies."""

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm


@lm.record
class Wall(lm.SeparableSystem):
    """A mass on a spring that leans against a soft wall at q = 0.3."""

    degrees: ClassVar[int] = 1
    stiffness: float

    def kinetic(self, p: Any) -> Any:
        return 0.5 * p[0] ** 2

    def potential(self, q: Any) -> Any:
        return 0.5 * q[0] ** 2 + self.stiffness * max(0.0, q[0] - 0.3) ** 2


@pytest.mark.compiled
def test_they_are_those_of_plain_python() -> None:
    system = Wall(5.0)
    start = system.state(q=[0.1], p=[0.4])
    runs = [
        lm.integrate(system, lm.HamiltonJacobi(order=3), start, h=0.1, steps=20, compiled=c)
        for c in (False, True)
    ]
    assert runs[0].q.max() > 0.31
    assert np.array_equal(runs[0].q, runs[1].q)
