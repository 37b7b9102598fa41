"""Functions, remainders and whole parts of compensated numbers, which are those of their value, and
of numbers of two doubles, which are those of all 32 digits.
"""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from compiler.worlds import same_in_all_worlds

import liemech as lm
from liemech import formulas as f
from liemech.formulas import derivative, functions, vec
from liemech.formulas.numbers.compensated import Compensated
from liemech.formulas.numbers.conversions import compensated, double_double, rounded
from liemech.formulas.numbers.double_double import DoubleDouble

WHOLE = int, round, math.floor, math.ceil, math.trunc
OPERATIONS = operator.mod, operator.floordiv, divmod


@pytest.mark.parametrize("function", (*functions.LIBM, f.sqrt, f.copysign), ids=lambda f: f.__name__)
def test_functions_of_compensated_numbers_are_those_of_the_value(function: Any) -> None:
    x, y = Compensated(1.25, 1e-17), Compensated(0.75, -1e-17)
    two = function in (f.atan2, f.pow, f.copysign)
    found = (
        [function(x, y), function(x, 0.75), function(1.25, y)]
        if two
        else [function(x - 0.25 * (function is f.atanh) * 2)]
    )
    argument = 1.25 - 0.5 * (function is f.atanh)
    assert set(found) == {function(1.25, 0.75) if two else function(argument)} or math.isnan(found[0])
    if not two and not math.isnan(found[0]):
        slope = derivative(lambda s: function(x + s - 0.5 * (function is f.atanh)), 0.0)
        assert float(slope) == derivative(function, argument)


@pytest.mark.parametrize("function", WHOLE, ids=lambda f: f.__name__)
def test_whole_parts(function: Callable[..., int]) -> None:
    """Of two doubles: those of the exact number, which may lie next to a whole one."""
    exact = {int: int, round: lambda x: int(mp.nint(x)), math.floor: lambda x: int(mp.floor(x)),
             math.ceil: lambda x: int(mp.ceil(x)), math.trunc: int}[function]  # fmt: skip
    with mp.workprec(300):
        for value in (2.5, -2.5, 3.5, 3.0, -3.0, 1e15, -7.25, 2.0**60):
            assert function(Compensated(value, 1e-17)) == function(value)
            for low in (0.0, 1e-17 * value, -1e-17 * value):
                x = DoubleDouble(value, low)
                assert function(x) == exact(mp.mpf(value) + mp.mpf(low)), (value, low)


@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda o: o.__name__)
def test_remainders_and_quotients(operation: Callable[..., Any]) -> None:
    x, y = Compensated(7.25, 1e-17), Compensated(-1.5, 1e-17)
    assert operation(x, y) == operation(7.25, y) == operation(x, -1.5) == operation(7.25, -1.5)
    rng = np.random.default_rng(1)
    with mp.workprec(300):
        for a, b in (rng.normal(size=(200, 2)) * [1e6, 1.0]).tolist():
            for long, short in ((DoubleDouble(a, 1e-17 * a), b), (a, DoubleDouble(b, 1e-17 * b))):
                p, q = [mp.mpf(rounded(n)) + mp.mpf(getattr(n, "low", 0.0)) for n in (long, short)]
                quotient = mp.floor(p / q)
                wanted = {"mod": [p - quotient * q], "floordiv": [quotient]}.get(
                    operation.__name__, [quotient, p - quotient * q]
                )
                found = operation(long, short)
                for n, right in zip(found if isinstance(found, tuple) else [found], wanted, strict=True):
                    assert abs(mp.mpf(n.value) + mp.mpf(n.low) - right) <= 2**-98 * abs(p)


def _whole(x: float, y: float, z: float, n: int) -> Any:
    a, b = compensated(vec(x, y))
    c, d = double_double(vec(x * z, y)) + double_double(vec(1e-20 * z, 1e-20 * x))
    return (
        a % b, a // b, b % x, y // a, int(a), round(b), math.floor(a), math.ceil(a), math.trunc(b), *divmod(a, b), float(a),
        *map(rounded, (c % d, c // d, d % x, y // d, *divmod(d, c))), int(c), round(d), math.floor(c), math.ceil(d), math.trunc(d),
        f.sin(a), f.atan2(a, b), f.atan2(a, y), f.hypot(a, b), f.copysign(a, b), f.pow(abs(a), b), functions.fma(a, b, x),
        derivative(lambda s: f.sin(a * s) + f.exp(0.01 * s) % b, x), rounded(derivative(lambda s: (s * c) % d + f.tanh(s * d), x)),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.compiled
def test_the_same_bits_in_all_worlds() -> None:
    rows = [[-3.5, 2.5, 1.0], [3.0, -0.5, 1.0], [0.3, 0.7, -1.1], [2.5, 2.5, 1.0], [-8.0, 3.0, 0.7]]
    same_in_all_worlds(_whole, rows)


@lm.record
class _Field(lm.Potential):
    def energy(self, g: Any) -> float:
        return f.exp(g[2, 2]) + f.sin(g[0, 1]) * f.sqrt(2.0 + g[0, 2]) + f.tanh(g[2, 0]) % 0.3


@lm.record
class _Body(lm.Hamiltonian):
    def energy(self, mu: Any) -> float:
        return 0.5 * lm.dot(mu, mu) + f.log(3.0 + mu[1]) * f.atan2(mu[0], 2.0 + mu[2])


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", (lm.ImplicitMidpoint(), lm.LieVerlet()), ids=lambda m: m.name)
def test_energies_with_functions_run_natively_in_compensated_sums(method: Any) -> None:
    """By default, for symmetric methods, as with compensated=False; a warning would say otherwise."""
    system: Any = lm.LiePoissonSystem(lm.SO3(), _Body())
    start = system.state(mu=[0.3, -0.2, 0.5])
    if method.name.startswith("Lie-Verlet"):
        system = lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), _Field())
        start = system.state(mu=[0.3, -0.2, 0.5], g=np.eye(3))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runs = [lm.Plan(system, method, h=0.01, compensated=c).run(start, steps=300).mu[-1] for c in (None, False)]
    assert np.allclose(*runs, rtol=1e-11)
