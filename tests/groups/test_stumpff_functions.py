"""The Stumpff functions in numbers of two doubles against their series in 50 digits."""

from __future__ import annotations

import mpmath as mp
import pytest

from liemech.formulas.numbers.double_double import DoubleDouble
from liemech.groups.rigid.stumpff import stumpff


@pytest.mark.parametrize("x", [1e-20, 0.01, 0.5, 1.0, 1.5, 30.0])
def test_stumpff_functions_have_31_digits(x: float) -> None:
    with mp.workdps(50):
        for k, c in enumerate(stumpff(DoubleDouble(x, 0.0)), 1):
            exact = sum((-mp.mpf(x)) ** j / mp.factorial(2 * j + k) for j in range(60))
            found = mp.mpf(c.value) + mp.mpf(c.low)
            # beyond the series a coefficient is what is left of one of size 1/(k - 2)!
            assert abs(found - exact) < 4e-30 * max(abs(exact), 1 / (mp.factorial(k) * (1 + x)))
