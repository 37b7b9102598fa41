"""The coefficients of rotations against arithmetic of many digits, and against the laws they come from."""

from __future__ import annotations

import math
import random
import runpy
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import pytest
from mpmath import mp, mpf

from liemech.errors import OutsideChart
from liemech.formulas import Vec, dot
from liemech.groups.rigid import rotation_coefficients as code

EPS = 2.0**-52
DERIVATION = Path(__file__).parents[2] / "docs" / "derivations" / "rotation_polynomials.py"
derivation = runpy.run_path(str(DERIVATION))
POLYNOMIALS = derivation["POLYNOMIALS"]
TERMS = derivation["TERMS"]
NAMES = ["sinc", "versine", "segment", "bernoulli"]
SLOPES = ["sinc_slope", "versine_slope", "segment_slope"]
INVERSE = ["bernoulli", "bernoulli_slope"]
CURVATURES = ["versine_curvature", "segment_curvature"]
AT_ZERO = {
    "sinc": 1,
    "versine": 1 / 2,
    "segment": 1 / 6,
    "bernoulli": 1 / 12,
    "sinc_slope": -1 / 6,
    "versine_slope": -1 / 24,
    "segment_slope": -1 / 120,
    "bernoulli_slope": 1 / 720,
    "versine_curvature": 1 / 360,
    "segment_curvature": 1 / 2520,
}


def value(name: str, x: float) -> float:
    """The function as the code has it."""
    if name in SLOPES:
        return code.all_coefficients(x)[3 + SLOPES.index(name)]
    if name in CURVATURES:
        return code.dexp_curvatures(x)[CURVATURES.index(name)]
    if name == "bernoulli_slope":
        return code.bernoulli_coefficients(x)[1]
    return getattr(code, name)(x)


def exact(name: str, x: float) -> mpf:
    """The function of the double x, from its definition; enough digits for the cancellation at small x and at 2 pi.

    sinc' = (segment - versine)/2, versine' = (sinc - 2 versine)/(2 x) and segment' = (versine - 3 segment)/(2 x).
    """
    with mp.workdps(70 + max(0, int(-7 * math.log10(x)))):
        y = mpf(x)
        if name == "sinc_slope":
            return (derivation["segment"](y) - derivation["versine"](y)) / 2
        if name == "versine_slope":
            return (derivation["sinc"](y) - 2 * derivation["versine"](y)) / (2 * y)
        if name == "segment_slope":
            return (derivation["versine"](y) - 3 * derivation["segment"](y)) / (2 * y)
        return +derivation[name](y)


def error(name: str, x: float) -> float:
    """Error in units of eps: relative to the value; of a slope, which has zeros, to the two terms
    whose difference it is.
    """
    e = exact(name, x)
    with mp.workdps(70 + max(0, int(-7 * math.log10(x)))):
        y = mpf(x)
        size = abs(e)
        if name == "sinc_slope":
            size = (abs(derivation["segment"](y)) + abs(derivation["versine"](y))) / 2
        if name == "versine_slope":
            size = derivation["stumpff4"](y) + abs(derivation["segment"](y)) / 2
        if name == "segment_slope":
            size = 1.5 * derivation["stumpff5"](y) + derivation["stumpff4"](y) / 2
        return float(abs(mpf(value(name, x)) - e) / size) / EPS


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
    "0.1 .. switch": angles(0.1, SWITCH),
}
BEYOND = {
    "switch .. twice": angles(SWITCH, 2 * SWITCH),
    "twice .. pi": angles(2 * SWITCH, math.pi),
    "pi .. 5": angles(math.pi, 5.0),
    "5 .. 2 pi": angles(5.0, 2 * math.pi - 1e-2),
    "near the switches": [x for k in (1.0, 4.0, 16.0) for x in both_sides(k * code.LIMIT)],
    "near pi": gaps(math.pi, 1e-15, 1e-2, (-1, 1)),
    "below 2 pi": gaps(2 * math.pi, 1e-9, 1e-2, (-1,)),
    "next to pi^2": [*both_sides(math.pi**2)],
    "up to the end of the chart": [x for x in both_sides(code.WHOLE_TURN) if x < code.WHOLE_TURN],
}
LARGE = {
    "next to 4 pi^2": [*both_sides(4 * math.pi**2)],
    "a little above 2 pi": gaps(2 * math.pi, 1e-12, 1.0, (1,)),
    "2 pi .. 1e3": angles(2 * math.pi, 1e3),
    "1e3 .. 1e8": angles(1e3, 1e8),
}


# ---------------------------------------------------------------- the numbers in the code


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_the_coefficients_are_those_of_the_derivation(name: str) -> None:
    f, at_zero, c = POLYNOMIALS[name]
    assert c == derivation["coefficients"](f, at_zero, code.LIMIT)


@pytest.mark.sample(3)
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
        for m, name in enumerate(("stumpff4", "stumpff5"), start=4):
            series = mp.fsum((-x) ** k / mp.factorial(2 * k + m) for k in range(40))
            assert mp.almosteq(derivation[name](x), series, 1e-50)
        slope = mp.fsum(k * bk * x ** (k - 1) for k, bk in enumerate(b))
        assert mp.almosteq(derivation["bernoulli_slope"](x), slope, 1e-50)
        for m, name in enumerate(("versine_curvature", "segment_curvature"), start=2):
            series = mp.fsum((-1) ** k * k * (k - 1) * x ** (k - 2) / mp.factorial(2 * k + m) for k in range(2, 40))
            assert mp.almosteq(derivation[name](x), series, 1e-50)
        for name in ("sinc", "versine", "segment"):
            assert mp.almosteq(exact(f"{name}_slope", 0.37), mp.diff(derivation[name], mpf(0.37)), 1e-25)


def test_polynomial_sums_all_its_terms() -> None:
    c = tuple(float(k) for k in range(3, 3 + TERMS))
    assert code.polynomial(c, 2.0) == sum(k * 2**i for i, k in enumerate(range(3, 3 + TERMS)))
    assert code.polynomial(c, -3.0) == sum(k * (-3) ** i for i, k in enumerate(range(3, 3 + TERMS)))


def test_the_polynomials_keep_lengths() -> None:
    """|exp(W) v| = |v| needs sinc^2 x + (1 - versine x)^2 = 1: the coefficients, without rounding,
    bring no drift.
    """

    def summed(c: tuple[float, ...], x: Fraction) -> Fraction:
        return sum((Fraction(ci) * x**i for i, ci in enumerate(c)), Fraction(0))

    for x in (Fraction(code.LIMIT) * i / 40 for i in range(1, 41)):
        change = summed(code.SINC, x) ** 2 * x + (1 - summed(code.VERSINE, x) * x) ** 2 - 1
        assert abs(change) < 3.0e-19  # the least double next to 1 is 700 times farther


# ---------------------------------------------------------------- accuracy


def largest(names: list[str], xs: list[float]) -> dict[str, float]:
    """The largest errors of some functions."""
    return {name: max(error(name, x) for x in xs) for name in names}


@pytest.mark.parametrize("where", ON_POLYNOMIAL)
def test_accuracy_of_the_polynomials(where: str) -> None:
    found = largest([*NAMES, *SLOPES, "bernoulli_slope"], ON_POLYNOMIAL[where])
    assert max(found.values()) < 1.5, found


@pytest.mark.sample(2)
@pytest.mark.parametrize("where", BEYOND)
def test_accuracy_beyond_the_polynomials(where: str) -> None:
    found = largest([*NAMES, *SLOPES, "bernoulli_slope"], BEYOND[where])
    assert max(found.values()) < 3.0, found


@pytest.mark.sample(2)
@pytest.mark.parametrize("where", LARGE)
def test_accuracy_at_large_angles(where: str) -> None:
    found = largest(["sinc", "versine", "segment", *SLOPES], LARGE[where])
    assert max(found.values()) < 3.0, found


@pytest.mark.slow
@pytest.mark.parametrize("name", CURVATURES)
def test_second_derivatives_are_good_enough_for_newton(name: str) -> None:
    """To rounding on the polynomials; beyond, some thousand eps of the value at zero, divided by
    x^2 as the function is.
    """
    for xs in ON_POLYNOMIAL.values():
        assert max(error(name, x) for x in xs if x > 1e-60) < 3.0
    for x in [x for xs in BEYOND.values() for x in xs]:
        assert abs(value(name, x) - exact(name, x)) < 3000 * EPS * AT_ZERO[name] / (1.0 + x) ** 2


def test_the_inverse_differential_ends_at_a_whole_turn() -> None:
    """There is a pole; x = theta^2 within 8 units of it has no digit that means anything."""
    with mp.workdps(30):
        assert 0 < 4 * mp.pi**2 - code.WHOLE_TURN < 10 * math.ulp(code.WHOLE_TURN)
    for x in (code.WHOLE_TURN, (2 * math.pi) ** 2, 50.0, 1e300, math.inf):
        for f in (code.bernoulli, code.bernoulli_coefficients):
            with pytest.raises(OutsideChart, match="2 pi"):
                f(x)


def test_both_ways_to_the_inverse_differential_agree() -> None:
    for x in [x for where in (ON_POLYNOMIAL, BEYOND) for xs in where.values() for x in xs]:
        assert code.bernoulli_coefficients(x)[0] == pytest.approx(code.bernoulli(x), rel=4 * EPS, abs=0.0)


@pytest.mark.parametrize("size", [0.5, 0.7, 3.0, 1e2, 1e5, 1e8, 1e12, 2.0**53])
def test_sine_and_versine_of_a_vector_of_any_length(size: float) -> None:
    """|w|^2 is rounded, and so the angle by eps |w|; what was lost is put back."""
    r = random.Random(str(size))
    for _ in range(30):
        w = Vec(*(size * r.gauss(0.0, 1.0) * r.choice((1.0, 1.0, 1e-7)) for _ in range(3)))
        x = dot(w, w)
        if x < code.LIMIT:
            continue
        with mp.workdps(80):
            y = mp.fsum(mpf(c) ** 2 for c in w)
            assert abs(code.lost_in_square(w, x) - (y - x)) < 8 * EPS * EPS * y
            t = mp.sqrt(y)
            a, b = code.exp_coefficients(x, w)
            # sine and versine with their relative accuracy, but where the angle, known to 2^-100,
            # is next to a multiple of pi
            assert abs(a - mp.sin(t) / t) < 3 * EPS * abs(mp.sin(t) / t) + t * mpf(2) ** -100
            assert abs(b - (1 - mp.cos(t)) / y) < 3 * EPS * (1 - mp.cos(t)) / y + mpf(2) ** -100
            assert code.all_coefficients(x, w)[:2] == (a, b)


def test_an_angle_that_no_double_can_tell_is_an_angle_still() -> None:
    """Beyond 2^53 a double has no digit behind the point; what comes out is the sine and cosine of some angle, not nan."""
    for size in (1e17, 1e50, 1e150):
        x = size * size * 1.1
        s, c = code.sin_cos_root(x)
        assert s * s + c * c == pytest.approx(1.0, abs=4 * EPS)


@pytest.mark.parametrize("name", AT_ZERO)
def test_at_zero(name: str) -> None:
    assert value(name, 0.0) == pytest.approx(AT_ZERO[name], rel=EPS)
    assert value(name, 5e-324) == value(name, 0.0)


@pytest.mark.parametrize("bad", [math.inf, math.nan])
def test_no_hang_and_no_number_from_nothing(bad: float) -> None:
    for name in AT_ZERO:
        if name not in INVERSE or bad != math.inf:  # that is outside the chart, which is said
            assert math.isnan(value(name, bad)), name


def test_functions_that_come_together_come_alone_too() -> None:
    for x in (0.0, 0.3, 0.7, 2.0, 9.0, 50.0):
        assert code.exp_coefficients(x) == (code.sinc(x), code.versine(x))
        assert code.dexp_coefficients(x)[1] == code.segment(x)
        assert code.dexp_coefficients(x)[2:] == code.all_coefficients(x)[4:]
        assert code.dexp_coefficients(x)[0] == pytest.approx(code.versine(x), rel=2 * EPS)


def test_sine_and_cosine_of_a_root() -> None:
    zeros = [x for k in (1, 2, 3, 1000) for x in both_sides((k * math.pi / 2) ** 2, 5)]
    for x in zeros + angles(1.0, 1e8):
        with mp.workdps(60):
            t = mp.sqrt(mpf(x))
            for ours, theirs in zip(code.sin_cos_root(x), (mp.sin(t), mp.cos(t)), strict=True):
                assert abs(ours / theirs - 1) < 1.5 * EPS


# ---------------------------------------------------------------- laws


@pytest.mark.parametrize("x", [1e-12, 0.3, 0.6, 0.7, 2.4, 2.6, 9.9, 10.1, 25.0, 39.0])
def test_dexp_times_its_inverse_is_one(x: float) -> None:
    """(1 + b W + c W^2)(1 - W/2 + d W^2) = 1 with W^3 = -x W: the terms in W and in W^2 vanish."""
    b, c, d = code.versine(x), code.segment(x), code.bernoulli(x)
    first = [b, -0.5, -x * b * d, 0.5 * x * c]
    second = [c, -0.5 * b, d, -x * c * d]
    for terms in (first, second):
        assert abs(math.fsum(terms)) < 4 * EPS * max(map(abs, terms))


@pytest.mark.parametrize("name", ["sinc", "versine", "segment"])
def test_slope_by_differences(name: str) -> None:
    def d(x: float, h: float) -> float:
        return (value(name, x + h) - value(name, x - h)) / (2 * h)

    h = 1e-2
    for x in (0.3, 0.5, 0.62, 0.63, 2.4, 2.6, 9.9, 20.0, 39.0, 41.0):
        assert (4 * d(x, h) - d(x, 2 * h)) / 3 == pytest.approx(
            value(f"{name}_slope", x), abs=1e-9 * value(name, 0.0)
        ), x


@pytest.mark.parametrize("factor", [1.0, 4.0, 16.0])
def test_both_sides_of_each_switch_agree(factor: float) -> None:
    """From one double to the next the value changes by the slope, which is small, and by rounding."""
    for name in (*NAMES, *SLOPES, "bernoulli_slope"):
        x = factor * code.LIMIT
        below, above = value(name, x), value(name, math.nextafter(x, math.inf))
        moved = abs(exact(name, math.nextafter(x, math.inf)) - exact(name, x))
        assert abs(above - below) <= moved + 6 * EPS * abs(below), name


def test_the_arcsine_is_the_computed_one():
    """Of the logarithm near the identity, recomputed; and its error over its range."""
    f, limit = derivation["arcsine"], code.ARCSINE_LIMIT
    assert derivation["coefficients"](f, Fraction(1), limit) == code.ARCSINE
    assert derivation["relative_error"](f, code.ARCSINE, limit) < 1.3e-17
