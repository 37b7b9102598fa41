"""Every operation and function of numbers of two doubles beside 60 digits, on both sides of every change of formula."""

from __future__ import annotations

import math
from typing import Any

import mpmath as mp
import pytest

from liemech import formulas as f
from liemech.formulas.numbers.double_double import COSINE, EXPONENTIAL, HALF_PI, LN_2, SINE, DoubleDouble, quotient

EVERYWHERE = -40.3, -2.7, -1.0, -0.61, -1e-3, -1e-9, 1e-9, 1e-3, 0.34, 0.35, 0.61, 1.0, 2.7, 40.3
ABOVE_ZERO = tuple([x for x in EVERYWHERE if x > 0.0] + [0.49, 0.51, 1e-30, 1e30])
WITHIN_ONE = tuple([x for x in EVERYWHERE if abs(x) < 1.0])
FUNCTIONS = {
    **dict.fromkeys(("sin", "cos", "tan", "sinh", "cosh", "tanh"), EVERYWHERE),
    **dict.fromkeys(("atan", "asinh", "exp", "exp2", "expm1", "fabs", "cbrt"), EVERYWHERE),
    **dict.fromkeys(("sqrt", "log", "log2", "log10", "log1p"), ABOVE_ZERO),
    **dict.fromkeys(("asin", "acos", "atanh"), WITHIN_ONE),
    "acosh": (1.0001, 1.5, 2.7, 1e6),
}
REFERENCES = {
    "exp2": lambda x: mp.mpf(2) ** x,
    "log2": lambda x: mp.log(x) / mp.log(2),
    "fabs": abs,
    "cbrt": lambda x: mp.sign(x) * mp.cbrt(abs(x)),
}


def exactly(x: Any) -> mp.mpf:
    return mp.mpf(x.value) + mp.mpf(x.low)


def near(found: Any, wanted: mp.mpf, bits: int) -> bool:
    return bool(abs(exactly(found) - wanted) <= abs(wanted) * mp.mpf(2) ** -bits)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions(name: str) -> None:
    """To 2^-94, cancelling ones (acos near 1, logarithms near 1) of what they begin with."""
    with mp.workdps(60):
        for x in FUNCTIONS[name]:
            number = DoubleDouble(x, 0.3 * 2.0**-53 * x)
            wanted = REFERENCES.get(name, getattr(mp, name, None))(exactly(number))
            found = getattr(f, name)(number)
            scale = max(abs(wanted), mp.mpf(name in ("sin", "cos", "tan", "log", "acosh")))
            assert abs(exactly(found) - wanted) <= scale * mp.mpf(2) ** -94, x


def test_functions_of_two_numbers() -> None:
    with mp.workdps(60):
        for y in (-2.5, -1e-3, 0.0, 0.7, 3.0):
            for x in (-3.1, -1e-9, 0.4, 2.0):
                a, b = DoubleDouble(y, 2.0**-60 * y), DoubleDouble(x, 2.0**-57 * x)
                assert near(f.atan2(a, b), mp.atan2(exactly(a), exactly(b)), 98)
                assert near(f.atan2(y, b), mp.atan2(y, exactly(b)), 98)
                assert near(f.atan2(a, x), mp.atan2(exactly(a), x), 98)
                if y:
                    sign = math.copysign(1.0, y)
                    assert near(f.copysign(b, a), sign * abs(exactly(b)), 104)
                    assert near(f.copysign(b, y), sign * abs(exactly(b)), 104)
                    power = mp.power(abs(exactly(a)), exactly(b))
                    assert near(abs(a) ** b, power, 92) and near(f.pow(abs(a), b), power, 92)
        assert exactly(DoubleDouble(0.0) ** 0.5) == 0
        assert near(DoubleDouble(-2.0) ** 3.0, mp.mpf(-8), 98)
        assert math.isnan((DoubleDouble(-2.0) ** 0.5).value)


def test_arithmetic_beside_numbers_of_all_kinds() -> None:
    with mp.workdps(60):
        a, b = DoubleDouble(1.0, 2.0**-54) / 3.0, DoubleDouble(-2.0, 2.0**-54) / 7.0
        x, y = exactly(a), exactly(b)
        for c, z in ((b, y), (0.3, mp.mpf(0.3)), (3, mp.mpf(3))):
            for found, wanted in ((a + c, x + z), (c + a, x + z), (a - c, x - z), (c - a, z - x)):
                assert near(found, wanted, 102)
            for found, wanted in ((a * c, x * z), (c * a, x * z), (a / c, x / z), (c / a, z / x)):
                assert near(found, wanted, 102)
        for n in (-7, -1, 0, 1, 2, 5):
            assert near(b**n, y**n, 98)


def test_constants() -> None:
    """Words of pi/2 and log 2 one after the other, and the coefficients of the series."""
    with mp.workdps(90):
        for words, constant in ((HALF_PI, mp.pi / 2), (LN_2, mp.log(2))):
            for k, word in enumerate(words):
                assert word == float(constant - mp.fsum(words[:k]))
        for k, (sine, cosine, growth) in enumerate(zip(SINE, COSINE, EXPONENTIAL)):
            for n, sign, found in ((2 * k + 1, (-1) ** k, sine), (2 * k, (-1) ** k, cosine), (k + 1, 1, growth)):
                exact = mp.mpf(sign) / mp.factorial(n)
                assert found == (float(exact), float(exact - float(exact)))
        third = mp.mpf(1) / 3
        assert quotient(1, 3) == (float(third), float(third - float(third)))
