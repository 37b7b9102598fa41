"""Sizes of numbers with derivatives, sums of arrays and matrices, powers, inverse sines and roots of two doubles."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

import liemech as lm
from liemech.formulas import asinh, sqrt
from liemech.formulas.functions import fma
from liemech.formulas.large import Large
from liemech.formulas.numbers.double_double import DoubleDouble
from liemech.formulas.numbers.dual import Dual, size_of
from liemech.formulas.numbers.series import SeriesInMemory


def exactly(x: DoubleDouble) -> mp.mpf:
    return mp.mpf(x.value) + mp.mpf(x.low)


def test_a_number_is_zero_with_its_derivative_only_if_both_are() -> None:
    assert size_of(Dual(-2.0, 2.0)) == 4.0 and size_of(Dual(0.0, -3.0)) == 3.0
    assert size_of(Dual(Dual(1.0, 2.0), Dual(-3.0, 4.0))) == 10.0


def test_an_array_and_a_matrix_add_up_in_both_orders() -> None:
    a, b = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0, 7.0], [11.0, 13.0]])
    assert np.array_equal(np.array(a + lm.Mat.of(b)), a + b) and np.array_equal(np.array(lm.Mat.of(b) + a), a + b)


@pytest.mark.parametrize("x", [-3.0, -1e-3, 1e-9, 0.4, 2.5])
def test_powers_and_inverse_sines_of_two_doubles(x: float) -> None:
    number = DoubleDouble(x, 0.1 * 2.0**-53 * x)
    with mp.workdps(60):
        wide = exactly(number)
        assert abs(exactly(asinh(number)) - mp.asinh(wide)) < mp.mpf(2) ** -98 * abs(mp.asinh(wide))
        assert abs(exactly(3.0**number) - mp.mpf(3) ** wide) < mp.mpf(2) ** -96 * mp.mpf(3) ** wide


def test_roots_of_two_doubles_at_zero_and_at_one() -> None:
    assert exactly(sqrt(DoubleDouble(0.0, 0.0))) == 0
    with mp.workdps(60):
        near_one = DoubleDouble(1.0, 2.0**-60)
        assert abs(exactly(sqrt(near_one)) - mp.sqrt(exactly(near_one))) < mp.mpf(2) ** -104


def test_products_and_sums_that_overflow_or_are_infinite() -> None:
    assert fma(1e200, 1e200, 1.0) == np.inf and fma(-1e200, 1e200, 1.0) == -np.inf
    assert fma(np.inf, -1.0, 2.0) == -np.inf and np.isnan(fma(np.inf, 0.0, 2.0))


def test_a_number_less_a_series_of_matrices_is_its_negative_and_the_number() -> None:
    a, b = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0, 7.0], [11.0, 13.0]])
    difference = 1.0 - SeriesInMemory(Large(a), Large(b))
    assert np.array_equal(np.array(difference.term(0)), 1.0 - a) and np.array_equal(np.array(difference.term(1)), -b)
