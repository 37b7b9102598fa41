"""Functions of numbers of two doubles where it is hard: large angles, and logarithms of matrices."""

from __future__ import annotations

import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest

import liemech as lm
from liemech.formulas import Mat, cos, sin, tan
from liemech.formulas.numbers.double_double import DoubleDouble
from liemech.groups.matrices.matrix_functions import expm, logm, sqrtm


def exactly(x: Any) -> mp.mpf:
    return mp.mpf(x.value) + mp.mpf(x.low)


def wide(m: Any) -> Mat:
    """A matrix in numbers of two doubles."""
    return Mat.of([[DoubleDouble(x, 0.0) for x in row] for row in m])


def distance(a: Any, b: Any) -> mp.mpf:
    """The largest difference of two matrices of numbers of two doubles."""
    with mp.workdps(60):
        return max(abs(exactly(x) - exactly(y)) for p, q in zip(a, b, strict=True) for x, y in zip(p, q, strict=True))


@pytest.mark.sample(4)
@pytest.mark.parametrize("exponent", [0, 10, 30, 50, 51, 51.7, 52, 53, 57, 59.99])
def test_sines_of_angles_up_to_2_to_the_60(exponent: float) -> None:
    """To 2^-100 of one where the angle is one double, else to the last digit of the angle."""
    rng = np.random.default_rng(int(exponent * 10))
    with mp.workdps(90):
        for x in (rng.choice([-1.0, 1.0], 20) * 2.0**exponent * rng.uniform(0.5, 1.0, 20)).tolist():
            for angle in (DoubleDouble(x), DoubleDouble(x) + 1e-17 * x):
                bound = mp.mpf(2) ** -98 + (abs(x) * mp.mpf(2) ** -105 if angle.low else 0)
                for got, want in ((sin(angle), mp.sin), (cos(angle), mp.cos)):
                    assert abs(exactly(got) - want(exactly(angle))) < bound


@pytest.mark.parametrize("x", [2.0**61, -1e22, 1e300, math.inf])
def test_angles_beyond_have_no_sine(x: float) -> None:
    for function in (sin, cos, tan):
        assert math.isnan(function(DoubleDouble(x)).value)


@pytest.mark.slow
def test_logarithms_and_roots_of_matrices_have_28_digits() -> None:
    """exp(log a) = a and sqrt(a)^2 = a, wherever the iteration for the root ends."""
    for turn in np.linspace(0.3, 2.7, 13):
        a = wide(1.2 * np.asarray(lm.SO(2).exp([turn])))
        root = sqrtm(a)
        assert distance(root @ root, a) < 1e-28
        assert distance(expm(logm(a)), a) < 1e-28


@pytest.mark.compiled
def test_large_angles_have_the_same_bits_in_native_code_and_beyond_the_range_a_run_ends() -> None:
    system = lm.models.Pendulum()
    plans = [
        lm.Plan(system, lm.StormerVerlet(), 0.1, precision="double-double", compiled=compiled)
        for compiled in (True, False)
    ]
    for q in (0.5, 1e17, -7.3e15):
        native, plain = (plan.run(system.state(q, 0.3), steps=3) for plan in plans)
        assert np.array_equal(native.p, plain.p)
    for plan in plans:
        with pytest.raises(lm.errors.IntegrationFailure):
            plan.run(system.state(1e22, 0.3), steps=3)
