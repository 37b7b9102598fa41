"""Exponentials of 3 by 3 matrices with a trace; coefficients that are fractions, in any units."""

from __future__ import annotations

import numpy as np

from liemech.formulas import Mat
from liemech.groups.matrix_basis import clean
from liemech.groups.matrix_functions import expm1


def test_the_exponential_of_a_symmetric_matrix_has_its_axes() -> None:
    axes, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    for sizes in ([0.3, -0.2, 0.5], [0.05, 0.06, 0.07], [1.5, 2.0, -0.5]):
        x = axes @ np.diag(sizes) @ axes.T
        found = axes.T @ np.array(expm1(Mat.of(x.tolist()))) @ axes
        assert np.abs(found - np.diag(np.expm1(sizes))).max() < 1e-14 * np.expm1(max(sizes))


def test_rounding_is_taken_off_fractions_and_small_units_are_left_alone() -> None:
    third = 1.0 / 3.0 + 2.0**-52
    assert clean(np.array([third, 1e-17, 0.3 + 1e-9])).tolist() == [1.0 / 3.0, 0.0, 0.3 + 1e-9]
    small = 1e-20 * np.array([1.0, -0.7, 1e-17])
    assert clean(small).tolist() == [small[0], small[1], 0.0]
