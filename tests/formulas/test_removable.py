"""Quotients that are 0/0 at zero: values and derivatives of all kinds, on both sides of the place
where sum and closed form meet.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from compiler.worlds import same_in_all_worlds

import liemech as lm
from liemech import formulas as f
from liemech.errors import InvalidInput
from liemech.formulas.numbers.double_double import DoubleDouble
from liemech.formulas.numbers.series import Series

mp = mpmath.mp.clone()
mp.dps = 50
ROUNDING = 2.0**-53


def _root(z: Any) -> Any:
    return mp.sqrt(mp.mpc(z))


EXACT: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any], tuple[float, ...]]] = {
    "sinc": (f.sinc, lambda x: mp.sin(x) / x, (2.0, -2.0, 9.5)),
    "versine_over": (f.versine_over, lambda x: (1 - mp.cos(x)) / x**2, (2.0, -2.0, 9.5)),
    "segment_over": (f.segment_over, lambda x: (x - mp.sin(x)) / x**3, (2.0, -2.0, 9.5)),
    "sinh_over": (f.sinh_over, lambda x: mp.sinh(x) / x, (2.0, -2.0, 9.5)),
    "coshm1_over": (f.coshm1_over, lambda x: (mp.cosh(x) - 1) / x**2, (2.0, -2.0, 9.5)),
    "expm1_over": (f.expm1_over, lambda x: mp.expm1(x) / x, (2.0, -2.0, 9.5)),
    "log1p_over": (f.log1p_over, lambda x: mp.log1p(x) / x, (2.0, -2.0 / 3.0, 9.5)),
    "atan_over": (f.atan_over, lambda x: mp.atan(x) / x, (0.5, -0.5, 9.5)),
    "stumpff 1": (lambda z: f.stumpff(1, z), lambda z: mp.sin(_root(z)) / _root(z), (4.0, -4.0, 20.0)),
    "stumpff 2": (lambda z: f.stumpff(2, z), lambda z: (1 - mp.cos(_root(z))) / z, (4.0, -4.0, 20.0)),
    "stumpff 3": (
        lambda z: f.stumpff(3, z), lambda z: (_root(z) - mp.sin(_root(z))) / _root(z) ** 3, (4.0, -4.0, 20.0)
    ),
}  # fmt: skip
NAMES = pytest.mark.parametrize("name", EXACT)


def places(switches: tuple[float, ...]) -> list[float]:
    beside = [x * s for x in switches for s in (1.0 - 1e-15, 1.0 + 1e-15, 0.97)]
    return [1e-300, -1e-20, 1e-9, -0.013, 0.31, *beside]


def nth(formula: Callable[[Any], Any], n: int) -> Callable[[Any], Any]:
    """The n-th derivative, by derivatives of derivatives."""
    for _ in range(n):
        formula = functools.partial(f.derivative, formula)
    return formula


def right_jet(exact: Callable[[Any], Any], x: float, n: int) -> list[Any]:
    """Derivatives 0 to n - 1, by the mean over a circle, which needs no value at zero."""
    radius, count = mp.mpf("0.02"), 36
    circle = [mp.expjpi(2 * mp.mpf(j) / count) for j in range(count)]
    values = [exact(mp.mpf(x) + radius * e) for e in circle]
    return [
        mp.factorial(k) * mp.re(mp.fsum(v / e**k for v, e in zip(values, circle, strict=True)))
        / count / radius**k
        for k in range(n)
    ]  # fmt: skip


@NAMES
def test_values_and_derivatives(name: str) -> None:
    formula, exact, switches = EXACT[name]
    allowed = (8.0, 40.0, 300.0, 1000.0)  # units in the last place of the first, second, ... derivative
    for x in places(switches):
        for k, right in enumerate(right_jet(exact, x, 4)):
            error = abs(nth(formula, k)(x) - right) / max(abs(right), mp.mpf("0.02"))
            assert error < allowed[k] * ROUNDING, (x, k, float(error / ROUNDING))


@NAMES
def test_at_zero_itself(name: str) -> None:
    formula, exact, _ = EXACT[name]
    jet = right_jet(exact, 0.0, 6)
    for k, right in enumerate(jet):
        assert abs(nth(formula, k)(0.0) - right) <= 4.0 * ROUNDING * abs(right) + 1e-30
    assert formula(0.0) == formula(-0.0) == formula(0)
    found = formula(Series(0.0, 1.0))
    terms = [found[k] for k in range(6)]
    exact_terms = [float(right / mp.factorial(k)) for k, right in enumerate(jet)]
    np.testing.assert_allclose(terms, exact_terms, rtol=1e-15, atol=1e-18)


@NAMES
def test_two_doubles(name: str) -> None:
    formula, exact, switches = EXACT[name]
    for x in places(switches):
        found = formula(DoubleDouble(x, x * 1e-17))
        there = mp.mpf(x) + mp.mpf(x * 1e-17)
        right = right_jet(exact, there, 1)[0]
        error = abs(mp.mpf(found.value) + mp.mpf(found.low) - right) / abs(right)
        assert error < 1e-29, (x, float(error))


def all_of_them(x, turns):
    return [f.sinc(x), f.versine_over(x), f.segment_over(x), f.sinh_over(x), f.coshm1_over(x), f.expm1_over(x), f.atan_over(x),
            f.log1p_over(0.25 * x), f.stumpff(1, x), f.stumpff(2, x), f.stumpff(3, x)]  # fmt: skip


def slopes_of_them(x, turns):
    return f.derivative(lambda y: lm.vec(*all_of_them(y, turns)), x)


def curvatures_of_them(x, turns):
    return f.derivative(lambda y: slopes_of_them(y, turns), x)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("formula", [all_of_them, slopes_of_them, curvatures_of_them])
def test_the_same_bits_in_all_worlds(formula: Any) -> None:
    rows = [(x,) for x in (0.0, -0.0, 1e-12, -0.3, 0.5, 0.51, 1.9, 2.1, -2.5, 3.999, 4.1, -4.5, 30.0)]
    same_in_all_worlds(formula, rows)


def test_arrays_and_wrong_numbers() -> None:
    x = np.linspace(-5.0, 5.0, 12).reshape(3, 4)
    np.testing.assert_allclose(f.sinc(x), np.sinc(x / np.pi), rtol=1e-14, atol=1e-15)
    with pytest.raises(InvalidInput, match="stumpff: k is 1, 2 or 3; got 4"):
        f.stumpff(4, 0.1)
