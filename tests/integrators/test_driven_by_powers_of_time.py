"""x' = powers of t: what a quadrature does exactly, and how an estimate of the error is made."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import vec
from liemech.tableaus import gauss, radau_iia


@lm.record
class Powers(lm.LinearGroupEquation):
    """x' = t^n on the line."""

    power: int

    def drive(self, t):
        return vec(t**self.power)


@pytest.mark.parametrize(
    ("tableau", "degree"), [(gauss(2), 3), (gauss(3), 5), (radau_iia(2), 2), (radau_iia(3), 4)]
)
def test_stages_of_implicit_methods_stand_at_their_times(
    tableau: lm.ButcherTableau, degree: int
) -> None:
    """Gauss' nodes integrate powers up to 2s - 1 exactly, those of Radau up to 2s - 2."""
    for power in range(degree + 2):
        line = Powers(lm.VectorSpace(1), power)
        method, start = lm.RKMK(tableau=tableau), line.state([0.0])
        end = lm.integrate(line, method, start, h=0.8, steps=1, t0=0.5, compiled=False).g[-1, 0]
        exact = (1.3 ** (power + 1) - 0.5 ** (power + 1)) / (power + 1)
        assert (abs(end - exact) < 1e-15 * 8) == (power <= degree)


def test_taylor_takes_the_last_term_but_one_where_the_last_is_missing() -> None:
    """Of x' = t^2 the term of h^4 is zero: the error is e_3^(4/3), e_3 in units of the tolerance."""
    line = Powers(lm.VectorSpace(1), 2)
    method, start = lm.Taylor(order=4), line.state([0.0])

    def error(atol: float) -> float:
        return method.trial(line, 0.5, start, line.drive(0.5), 0.8, 0.0, atol, False).error

    e3 = 0.8**3 / 3.0
    assert error(1.0) == pytest.approx(e3 ** (4.0 / 3.0), rel=1e-14)
    assert error(1e-6) == pytest.approx((1e6 * e3) ** (4.0 / 3.0), rel=1e-14)
    assert np.isclose(error(0.5), 2.0 ** (4.0 / 3.0) * error(1.0), rtol=1e-14)
