"""Steps in numbers of two doubles lose nothing on the way: inexact derivatives, powers of negative
numbers, native code of exp.
"""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scenes import asymmetric_body, named, same_bits, slow

import liemech as lm
from liemech.errors import InvalidType
from liemech.formulas import cosh, pow, tanh
from liemech.formulas.double_double import DoubleDouble
from liemech.formulas.pytree import double_double, layout_of, leaves


def exactly(x: DoubleDouble) -> mp.mpf:
    return mp.mpf(x.value) + mp.mpf(x.low)


@pytest.mark.parametrize(
    "base, n",
    [
        (-0.3, 2.0),
        (-0.3, 3.0),
        (-1.7, -2.0),
        (-1.1, 70),
        (-1.1, 65),
        (0.0, 2.0),
        (0.0, 0.5),
        (0.0, 0.0),
    ],
)
def test_powers_of_negative_numbers_and_of_zero(base: float, n: float) -> None:
    """What they are to ordinary numbers, x^2.0 = x x, and not nan by a logarithm."""
    x = DoubleDouble(base, 1e-18 * base)
    with mp.workdps(60):
        want = mp.power(exactly(x), n)
        for got in (x**n, pow(x, n)):
            assert abs(exactly(got) - want) <= mp.mpf(2) ** -95 * abs(want)


@pytest.mark.parametrize("x", [-800.0, -400.0, 400.0, 1e6])
def test_hyperbolic_functions_far_out(x: float) -> None:
    assert exactly(tanh(DoubleDouble(x, 0.0))) == np.sign(x)
    if abs(x) < 700.0:
        with mp.workdps(60):
            assert abs(exactly(cosh(DoubleDouble(x, 0.0))) / mp.cosh(x) - 1) < mp.mpf(2) ** -90


@pytest.mark.slow
@pytest.mark.parametrize("order", [6, slow(8)])
def test_an_inexact_derivative_leaves_no_digits_behind(order: int) -> None:
    """Orders 6 and 8 solve by the derivative of order 4, off by a percent at large steps: the way
    back ends where it began.
    """
    body, start = asymmetric_body()
    method: Any = lm.LiePoissonHamiltonJacobi(order, lm.Cayley())
    state = double_double(body.state(start.mu))
    begun = np.array(leaves(state, layout_of(state))).reshape(-1, 2)
    for h in (0.8, -0.8):
        memory = method.step(body, 0.0, double_double(method.start(body, state, h)), h)
        state = double_double(method.observe(memory))
    words = np.array(leaves(state, layout_of(state))).reshape(-1, 2)
    assert np.abs((words - begun).sum(axis=1)).max() < 1e-28


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    "method", [lm.RKMK(order=2), slow(lm.LiePoissonHamiltonJacobi(6, lm.Cayley()))], ids=named
)
def test_native_code_of_the_exponential_and_of_inexact_derivatives(method: lm.Method) -> None:
    """Both words have the same bits as in plain Python."""
    body, start = asymmetric_body()
    plan = lm.Plan(body, method, 0.4, precision="double-double")
    plain, native = (
        plan.replace(compiled=c).run(body.state(start.mu), steps=3) for c in (False, True)
    )
    assert same_bits(plain.carry.numbers, native.carry.numbers)


@pytest.mark.parametrize("method", [lm.HamiltonJacobi(4), lm.SymmetricHamiltonJacobi(4)], ids=named)
def test_generating_functions_by_power_series_are_refused_in_plain_words(method: lm.Method) -> None:
    system = lm.Pendulum()
    with pytest.raises(InvalidType, match="power series have numbers of one double"):
        lm.integrate(
            system,
            method,
            system.state(0.3, 0.1),
            h=0.1,
            steps=2,
            precision="double-double",
            compiled=False,
        )
