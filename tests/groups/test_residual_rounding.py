"""The equation of a Cayley step rounds by the size of the displacement, not by that of the
momentum.
"""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import Vec
from liemech.formulas.pytree import double_double, rounded

EPS = 2.0**-52
CASES = {
    "SO3": (lm.SO3(), lm.Cayley()),
    "quaternions": (lm.UnitQuaternions(), lm.Cayley()),
    "SE2": (lm.SE2(), lm.Cayley()),
    "SE3": (lm.SE3(), lm.Cayley()),
    "SE3, adjoint": (lm.SE3(), lm.CayleyAdjoint()),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", CASES)
def test_residuals_near_the_root_round_by_the_size_of_the_displacement(name: str) -> None:
    """With terms of the size of mu the residual is a multiple of 4 ulp(p), and steps are wrong to
    one side: 5e-20 a step.
    """
    group, tau = CASES[name]
    rng = np.random.default_rng(5)
    for size in (1e-1, 1e-3, 1e-6):
        for _ in range(20):
            mu = Vec.of(rng.uniform(-1.0, 1.0, group.dim).tolist())
            xi = Vec.of((size * rng.uniform(-1.0, 1.0, group.dim)).tolist())
            p = mu + size * Vec.of(rng.uniform(-0.1, 0.1, group.dim).tolist())
            r = tau.residual(group, xi, p, mu)[0]
            exact = rounded(tau.residual(group, *map(double_double, (xi, p, mu)))[0])
            assert max(abs(a - b) for a, b in zip(r, exact)) <= 8.0 * EPS * size
