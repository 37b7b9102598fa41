"""Series of operators answer soon, however large their argument is."""

from __future__ import annotations

import math

import pytest

from liemech.formulas import Vec, vec
from liemech.groups.representations import averaged


@pytest.mark.parametrize("size", [1e19, 1e160, 1e308])
def test_a_sum_of_which_no_digit_is_known_is_nan_after_few_products(size: float) -> None:
    """Squares of 1e160 are infinite: halving went on 1100 times, and a call took half a minute."""
    products = 0

    def grown(xi: float, x: Vec) -> Vec:
        nonlocal products
        products += 1
        return math.exp(min(xi, 9.0)) * x

    def by(xi: float, x: Vec) -> Vec:
        return xi * x

    assert math.isnan(averaged(by, grown, size * size, size, vec(1.0))[0])
    assert products == 0
    mean = averaged(by, grown, 9.0, 3.0, vec(1.0))[0]
    assert mean == pytest.approx((math.exp(3.0) - 1.0) / 3.0, rel=1e-14)
    assert products == 2  # from 3/4
