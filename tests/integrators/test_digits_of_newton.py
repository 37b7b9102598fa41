"""Algorithm 1 in 31 digits: Newton's method runs in 16, and one residual has 31."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.formulas.double_double import is_long
from liemech.formulas.pytree import double_double, rounded

BODY, MU = lm.RigidBody([1.0, 1.6, 2.3]), lm.vec(0.3, 0.8, -0.5)


@lm.record
class Watched(lm.Cayley):
    """The Cayley map, and how many of its residuals had 31 digits."""

    digits: ClassVar[list[bool]] = []

    def residual(self, group: Any, xi: Any, p: Any, mu: Any) -> Any:
        self.digits.append(any(is_long(x[0]) for x in (xi, p, mu)))
        return super().residual(group, xi, p, mu)


@pytest.mark.parametrize("thin", [False, True], ids=["body", "rod"])
def test_one_residual_of_a_step_has_31_digits(thin: bool) -> None:
    """Of a rod too, whose displacement is followed from h = 0 on; and it is solved to them."""
    system = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy([0.001, 1.0, 1.2])) if thin else BODY
    mu, h = lm.vec(0.001, 1.1, 0.4) if thin else MU, 0.3
    method = lm.CovariantVariational(Watched())
    Watched.digits.clear()
    x = method.displacement(system, h, double_double(mu), h * system.velocity(mu))
    assert Watched.digits.count(True) == 1
    assert len(Watched.digits) > 3
    rest = method.equation(system, 1.0 / h, double_double(mu), x)[0]
    assert np.abs(np.array(rounded(rest))).max() < 1e-27
