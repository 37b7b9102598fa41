"""Elementary functions: those of Python's `math`, bit for bit, and what they are for vectors,
symbols and wrong arguments.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from compiler.worlds import same_in_all_worlds

from liemech import formulas as f
from liemech.formulas import derivative, functions, vec
from liemech.formulas.numbers.series import Series

NAMES = [*functions.INSTRUCTIONS, *[g.__name__ for g in functions.LIBM], "fabs", "radians", "degrees"]
OF_TWO = "copysign", "atan2", "pow"


@pytest.mark.parametrize("name", NAMES)
def test_floats_have_the_bits_of_math(name: str) -> None:
    ours, theirs = getattr(f, name), getattr(math, name)
    for x in np.random.default_rng(1).normal(size=(200, 2 if name in OF_TWO else 1)) * 3.0:
        args = [abs(x[0]), *x[1:]] if name == "pow" else x.tolist()
        try:
            expected = theirs(*args)
        except ValueError:
            expected = math.nan
        found = ours(*args)
        assert type(found) is float
        assert found == expected or (expected != expected and found != found)


def test_outside_their_domain_they_are_nan_or_infinite() -> None:
    assert f.log2(0.0) == f.log10(0.0) == -math.inf
    assert f.pow(0.0, -1.0) == f.exp2(1e4) == f.atanh(1.0) == math.inf
    assert math.isnan(f.acosh(0.5)) and math.isnan(f.pow(-8.0, 1.0 / 3.0))


def test_lengths() -> None:
    assert f.hypot(3.0, 4.0) == 5.0
    assert f.hypot(1.0, 2.0, 2.0) == 3.0
    assert derivative(lambda x: f.hypot(x, 4.0), 3.0) == 0.6


@pytest.mark.parametrize(
    ("name", "places"),
    [("tanh", (1e-9, 0.9, 5.0, 12.0, -18.0, 300.0)), ("asin", (1.0 - 1e-6, 1e-10 - 1.0)), ("acos", (1.0 - 1e-6,)),
     ("expm1", (1e-9, -12.0, -100.0))],
)  # fmt: skip
def test_derivatives_where_one_less_the_square_is_rounding(name: str, places: tuple[float, ...]) -> None:
    """To relative rounding, as those of powers of y = tanh x near y = 1 were 3e-7 off at 12, and zero at 20."""
    mpmath = pytest.importorskip("mpmath")
    function = getattr(f, name)
    for x in places:
        with mpmath.workdps(300):
            exact = [float(c) for c in mpmath.taylor(getattr(mpmath, name), mpmath.mpf(x), 4)]
        second = derivative(lambda y: derivative(function, y), x)
        series = function(Series(x, 1.0))
        assert [derivative(function, x), second / 2.0] == pytest.approx(exact[1:3], rel=1e-13, abs=0.0)
        assert [series[k] for k in range(1, 5)] == pytest.approx(exact[1:], rel=1e-13, abs=0.0)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives(name: str) -> None:
    import sympy

    x, t = (1.3 if name == "acosh" else 0.3), sympy.Symbol("t", positive=True)
    extra = (2.5,) if name in OF_TWO else ()
    if name in ("radians", "degrees", "fabs"):
        exact = {"radians": math.pi / 180, "degrees": 180 / math.pi, "fabs": 1.0}[name]
    else:
        exact = float(sympy.diff(getattr(f, name)(t, *extra), t).subs(t, x).evalf(30))
    assert derivative(lambda y: getattr(f, name)(y, *extra), x) == pytest.approx(exact, rel=1e-14)
    if name in ("atan2", "pow"):
        exact = float(sympy.diff(getattr(f, name)(*extra, t), t).subs(t, x).evalf(30))
        assert derivative(lambda y: getattr(f, name)(*extra, y), x) == pytest.approx(exact, rel=1e-14)


@pytest.mark.parametrize("name", [g.__name__ for g in (functions.sqrt, *functions.LIBM)])
def test_arrays(name: str) -> None:
    x = np.array([1.25, 1.5]) if name == "acosh" else np.array([0.25, 0.5])
    extra = (2.0,) if name in OF_TWO else ()
    np.testing.assert_allclose(getattr(f, name)(x, *extra), [getattr(f, name)(float(a), *extra) for a in x], rtol=1e-14)
    assert getattr(f, name)(x[:1], *extra).shape == (1,)


@pytest.mark.parametrize("wrong", [vec(1.0, 2.0), "1.0", None, f.Complex(1.0, 2.0), [1.0]])
def test_what_is_no_number_is_refused(wrong: Any) -> None:
    with pytest.raises(TypeError, match=f"sin is a function of numbers; got {type(wrong).__name__}"):
        f.sin(wrong)


def every_function(a, b, turns):
    one = [g(0.25 * a) for g in (f.cbrt, f.exp2, f.asinh, f.atanh, f.radians, f.degrees, f.fabs)]
    two = [g(1.0 + a * a) for g in (f.log2, f.log10, f.acosh)]
    return *one, *two, f.copysign(a, b), f.pow(1.0 + a * a, b), f.hypot(a, b), f.hypot(a, b, 1.0)


def their_slopes(a, b, turns):
    return (
        derivative(lambda x: lists_sum(every_function(x, b, turns)), a),
        derivative(lambda y: derivative(lambda x: lists_sum(every_function(x, y, turns)), a), b),
    )


def lists_sum(items):
    total = 0.0
    for x in items:
        total = total + x
    return total


@pytest.mark.compiled
@pytest.mark.parametrize("formula", [every_function, their_slopes], ids=lambda formula: formula.__name__)
def test_the_same_bits_in_native_code(formula: Any) -> None:
    same_in_all_worlds(formula, [(0.3, 0.7), (-1.1, 0.4), (2.3, -1.9), (0.01, 1.3)])
