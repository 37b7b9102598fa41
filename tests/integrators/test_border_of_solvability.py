"""The condition under which the Cayley equation of a body has one solution, at its border."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.integrators.solvability import is_always_solvable


def least_value(J: np.ndarray, across: np.ndarray) -> float:
    """The least value of the quadratic form with the coefficients k_i and k_ij, where no x_i^2 is
    negative and their sum is one.
    """
    a, b, c = J
    k = np.diag([J[i] * (4.0 * J[i] ** 2 + 3.0 * J[i - 1] * J[i - 2]) for i in range(3)])
    for i, j, m in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        k[i, j] = k[j, i] = (
            2.0 * J[i] * J[j] * (J[i] + J[j])
            + 4.0 * a * b * c
            - 0.5 * J[m] * (J[i] ** 2 + J[j] ** 2)
        )
    return float(np.einsum("ni,ij,nj->n", across, k, across).min())


@pytest.mark.sample(1)
@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_the_condition_is_that_a_quadratic_form_is_not_negative(share: float) -> None:
    """From thick to thin bodies it fails where the form does, on a grid that is fine along all
    ratios of the x_i^2.
    """
    logarithms = np.linspace(-6.0, 6.0, 241)
    u, v = (10.0**x.ravel() for x in np.meshgrid(logarithms, logarithms))
    across = np.stack([np.ones_like(u), u, v], axis=-1) / (1.0 + u + v)[:, None]
    seen = set()
    for ratio in np.geomspace(20.0, 400.0, 40):
        J = np.array([1.0, 1.0 - share / ratio, 1.0 / ratio])
        least = least_value(J, across)
        solvable = is_always_solvable(lm.Vec.of(J))
        seen.add(solvable)
        assert solvable == (least >= 0.0)
    assert seen == {True, False}
