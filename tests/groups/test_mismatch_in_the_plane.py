"""The equation of a step on SE(2), at ordinary velocities."""

from __future__ import annotations

import numpy as np

import liemech as lm
from liemech.formulas import jacobian


def test_the_mismatch_vanishes_where_it_should_and_its_slope_is_its_derivative() -> None:
    algebra = lm.SE2().algebra
    for xi in ([0.7, 0.4, -1.1], [-1.9, 0.2, 0.5], [1e-9, 0.3, 0.8]):
        xi, mu = lm.vec(*xi), lm.vec(0.9, -0.6, 0.5)
        r, _, slope = algebra.exp_residual(xi, algebra.dexp_dual(xi, mu), mu)
        assert np.abs(np.array(r)).max() < 1e-15 * 4
        derived = jacobian(lambda x, mu=mu: algebra.exp_residual(x, mu, mu)[0], xi)
        assert np.abs(np.array(slope) - np.array(derived)).max() < 1e-9
