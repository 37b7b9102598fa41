"""Series of operators answer soon, however large their argument is."""

from __future__ import annotations

import math

import pytest

from liemech.groups.representations import averaged


@pytest.mark.parametrize("size", [1e19, 1e160, 1e308])
def test_a_sum_of_which_no_digit_is_known_is_nan_after_few_products(size: float) -> None:
    """Squares of 1e160 are infinite: halving went on 1100 times, and a call took half a minute."""
    products = 0

    def turned(xi: float, x: float) -> float:
        nonlocal products
        products += 1
        return math.cos(xi) * x

    assert math.isnan(averaged(lambda xi, x: 0.0 * x, turned, size * size, size, 1.0))
    assert products == 0
    assert averaged(lambda xi, x: xi * x, lambda xi, x: math.exp(xi) * x, 9.0, 3.0, 1.0) == (
        pytest.approx((math.exp(3.0) - 1.0) / 3.0, rel=1e-14)
    )
    assert products == 0
