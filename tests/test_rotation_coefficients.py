"""The coefficients of rotations against arithmetic of many digits, and against the laws they come from."""

from __future__ import annotations

import math
import random
import runpy
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import pytest
from mpmath import mp, mpf

from liemech.groups import rotation_coefficients as code

EPS = 2.0**-52
DERIVATION = Path(__file__).parents[1] / "docs" / "derivations" / "rotation_polynomials.py"
derivation = runpy.run_path(str(DERIVATION))
POLYNOMIALS = derivation["POLYNOMIALS"]
NAMES = ["sinc", "versine", "segment", "bernoulli", "bernoulli_slope"]
AT_ZERO = {"sinc": 1, "versine": 1 / 2, "segment": 1 / 6, "bernoulli": 1 / 12, "bernoulli_slope": 1 / 720}


def exact(name: str, x: float) -> mpf:
    """The function of the double x, from its definition; enough digits for the cancellation at small x and at 2 pi."""
    with mp.workdps(70 + max(0, int(-3 * math.log10(x)))):
        return +derivation[name](mpf(x))


def error(name: str, x: float) -> float:
    """Relative error in units of eps."""
    e = exact(name, x)
    with mp.workdps(40):
        return float(abs((mpf(getattr(code, name)(x)) - e) / e)) / EPS


def both_sides(x: float, steps: int = 20) -> Iterator[float]:
    """The doubles next to x, below and above."""
    below = above = x
    yield x
    for _ in range(steps):
        below, above = math.nextafter(below, 0.0), math.nextafter(above, math.inf)
        yield below
        yield above


def angles(low: float, high: float, count: int = 120) -> list[float]:
    """Values of theta^2 for angles between the bounds, evenly spread in size."""
    r = random.Random(f"{low} {high}")
    return [math.exp(r.uniform(math.log(low), math.log(high))) ** 2 for _ in range(count)]


def gaps(centre: float, low: float, high: float, sides: tuple[int, ...], count: int = 120) -> list[float]:
    """Values of theta^2 for angles at distances between the bounds from the centre."""
    r = random.Random(f"{centre} {low}")
    sizes = (10 ** r.uniform(math.log10(low), math.log10(high)) for _ in range(count))
    return [(centre + sides[i % len(sides)] * size) ** 2 for i, size in enumerate(sizes)]


SWITCH = math.sqrt(code.LIMIT)
ON_POLYNOMIAL = {
    "tiny": angles(1e-100, 1e-8),
    "1e-8 .. 1e-4": angles(1e-8, 1e-4),
    "1e-4 .. 0.1": angles(1e-4, 0.1),
    "0.1 .. 1": angles(0.1, 1.0),
    "1 .. switch": angles(1.0, SWITCH),
}
BEYOND = {
    "switch .. pi": angles(SWITCH, math.pi),
    "pi .. 5": angles(math.pi, 5.0),
    "5 .. 2 pi": angles(5.0, 2 * math.pi - 1e-2),
    "near the switches": [x for k in (1.0, 4.0, 16.0) for x in both_sides(k * code.LIMIT)],
    "near pi": gaps(math.pi, 1e-15, 1e-2, (-1, 1)),
    "below 2 pi": gaps(2 * math.pi, 1e-9, 1e-2, (-1,)),
    "next to pi^2 and 4 pi^2": [*both_sides(math.pi**2), *both_sides(4 * math.pi**2)],
    "a little above 2 pi": gaps(2 * math.pi, 1e-12, 1.0, (1,)),
}


# ---------------------------------------------------------------- the numbers in the code


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_the_coefficients_are_those_of_the_derivation(name: str) -> None:
    f, at_zero, c = POLYNOMIALS[name]
    assert c == derivation["coefficients"](f, at_zero, code.LIMIT)


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_the_polynomials_are_closer_than_rounding(name: str) -> None:
    f, _, c = POLYNOMIALS[name]
    assert derivation["relative_error"](f, c, code.LIMIT) < EPS / 2


def test_the_definitions_in_the_derivation() -> None:
    """Taylor coefficients: (-1)^k/(2k+m)! for the Stumpff functions, |B_2k|/(2k)! for the inverse differential."""
    with mp.workdps(60):
        x = mpf("0.37")
        for m, name in enumerate(("sinc", "versine", "segment"), start=1):
            series = mp.fsum((-x) ** k / mp.factorial(2 * k + m) for k in range(40))
            assert mp.almosteq(derivation[name](x), series, 1e-50)
        b = [abs(mp.bernoulli(2 * k)) / mp.factorial(2 * k) for k in range(1, 40)]
        assert mp.almosteq(derivation["bernoulli"](x), mp.fsum(bk * x**k for k, bk in enumerate(b)), 1e-50)
        slope = mp.fsum(k * bk * x ** (k - 1) for k, bk in enumerate(b) if k)
        assert mp.almosteq(derivation["bernoulli_slope"](x), slope, 1e-50)


def test_polynomial_sums_its_ten_terms() -> None:
    c = tuple(float(k) for k in range(3, 13))
    assert code.polynomial(c, 2.0) == sum(k * 2**i for i, k in enumerate(range(3, 13)))
    assert code.polynomial(c, -3.0) == sum(k * (-3) ** i for i, k in enumerate(range(3, 13)))


def test_the_polynomials_keep_lengths() -> None:
    """|exp(W) v| = |v| needs sinc^2 x + (1 - versine x)^2 = 1: the coefficients, without rounding, bring no drift."""

    def value(c: tuple[float, ...], x: Fraction) -> Fraction:
        return sum((Fraction(ci) * x**i for i, ci in enumerate(c)), Fraction(0))

    for x in (Fraction(code.LIMIT) * i / 40 for i in range(1, 41)):
        change = value(code.SINC, x) ** 2 * x + (1 - value(code.VERSINE, x) * x) ** 2 - 1
        assert abs(change) < 1.0e-19


# ---------------------------------------------------------------- accuracy


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", ON_POLYNOMIAL)
def test_accuracy_of_the_polynomials(name: str, where: str) -> None:
    assert max(error(name, x) for x in ON_POLYNOMIAL[where]) < 1.5


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", BEYOND)
def test_accuracy_beyond_the_polynomials(name: str, where: str) -> None:
    assert max(error(name, x) for x in BEYOND[where]) < (4.0 if name == "bernoulli_slope" else 3.0)


@pytest.mark.parametrize("name", ["sinc", "versine", "segment", "bernoulli_slope"])
@pytest.mark.parametrize("bounds", [(2 * math.pi, 1e3), (1e3, 1e8)])
def test_accuracy_at_large_angles(name: str, bounds: tuple[float, float]) -> None:
    assert max(error(name, x) for x in angles(*bounds)) < 4.0


def test_bernoulli_at_large_angles() -> None:
    """It has a zero between two poles, so its error is measured by the two terms of 1 - (theta/2) cot(theta/2)."""
    for x in angles(2 * math.pi, 1e8):
        with mp.workdps(60):
            half = mp.sqrt(mpf(x)) / 2
            size = (1 + abs(half * mp.cot(half))) / x
            assert abs(code.bernoulli(x) - exact("bernoulli", x)) < 3 * EPS * size


@pytest.mark.parametrize("name", NAMES)
def test_at_zero(name: str) -> None:
    assert getattr(code, name)(0.0) == AT_ZERO[name]
    assert getattr(code, name)(5e-324) == AT_ZERO[name]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", [math.inf, math.nan])
def test_no_hang_and_no_number_from_nothing(name: str, bad: float) -> None:
    assert math.isnan(getattr(code, name)(bad))


def test_sine_and_cosine_of_a_root() -> None:
    zeros = [x for k in (1, 2, 3, 1000) for x in both_sides((k * math.pi / 2) ** 2, 5)]
    for x in zeros + angles(1.0, 1e8):
        with mp.workdps(60):
            t = mp.sqrt(mpf(x))
            for ours, theirs in zip(code.sin_cos_root(x), (mp.sin(t), mp.cos(t)), strict=True):
                assert abs(ours / theirs - 1) < 1.5 * EPS


# ---------------------------------------------------------------- laws


@pytest.mark.parametrize("x", [1e-12, 0.3, 2.0, 2.6, 9.0, 11.0, 25.0, 39.0])
def test_dexp_times_its_inverse_is_one(x: float) -> None:
    """(1 + b W + c W^2)(1 - W/2 + d W^2) = 1 with W^3 = -x W: the terms in W and in W^2 vanish."""
    b, c, d = code.versine(x), code.segment(x), code.bernoulli(x)
    first = [b, -0.5, -x * b * d, 0.5 * x * c]
    second = [c, -0.5 * b, d, -x * c * d]
    for terms in (first, second):
        assert abs(math.fsum(terms)) < 4 * EPS * max(map(abs, terms))


@pytest.mark.parametrize("f, slope", [(code.bernoulli, code.bernoulli_slope)])
@pytest.mark.parametrize("x", [0.5, 2.4, 2.6, 6.0, 9.9, 10.1, 20.0, 39.0, 41.0])
def test_slope_by_differences(f: Callable[[float], float], slope: Callable[[float], float], x: float) -> None:
    h = 1e-3 * abs(x - 4 * math.pi**2) ** 0.5
    d1, d2 = (f(x + h) - f(x - h)) / (2 * h), (f(x + 2 * h) - f(x - 2 * h)) / (4 * h)
    assert (4 * d1 - d2) / 3 == pytest.approx(slope(x), rel=1e-8)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("factor", [1.0, 4.0, 16.0])
def test_both_sides_of_each_switch_agree(name: str, factor: float) -> None:
    """From one double to the next the value changes by the slope, which is small, and by rounding."""
    f = getattr(code, name)
    x = factor * code.LIMIT
    below, above = f(x), f(math.nextafter(x, math.inf))
    moved = abs(exact(name, math.nextafter(x, math.inf)) - exact(name, x))
    assert abs(above - below) <= moved + 6 * EPS * abs(below)
