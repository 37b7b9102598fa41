"""The orders that isospectral methods offer are those of Gauss methods, 2 to 10, and no others."""

from __future__ import annotations

import pytest

import liemech as lm


def test_isospectral_methods_have_the_even_orders_to_ten() -> None:
    offered = []
    for order in range(1, 13):
        try:
            offered.append(lm.Isospectral(order=order).order)
        except lm.errors.InvalidInput:
            continue
    assert offered == [2, 4, 6, 8, 10]


@pytest.mark.parametrize("order", [2.0, True, "4", None])
def test_an_order_is_a_whole_number(order: object) -> None:
    with pytest.raises(lm.errors.InvalidInput, match="order must be one of"):
        lm.Isospectral(order=order)
