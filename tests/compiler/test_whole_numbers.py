"""Whole numbers made of numbers that carry a derivative, and what cannot be differentiated."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import NotCompilable

STEPS: dict[str, Callable[[Any], Any]] = {
    "floor": math.floor,
    "ceil": math.ceil,
    "trunc": math.trunc,
    "int": int,
    "round": round,
    "divmod": lambda x: divmod(x, 0.3)[0],
}


@pytest.mark.parametrize("name", STEPS)
def test_their_derivative_is_zero_between_jumps(name: str) -> None:
    step = STEPS[name]
    for x in (-1.7, -0.2, 0.4, 2.6):
        assert lm.derivative(lambda y: step(y) * y + 0.0, x) == step(x)


def test_the_rest_of_a_division_has_the_slopes_of_its_parts() -> None:
    assert lm.derivative(lambda y: divmod(y, 0.7)[1], 3.0) == 1.0
    assert lm.derivative(lambda y: divmod(3.0, y)[1], 0.7) == -(3.0 // 0.7)


@lm.record
class Stairs(lm.HamiltonianSystem):
    """Steps of every kind in a potential."""

    degrees = 1

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        x = 3.0 * q[0]
        steps = math.floor(x) + math.ceil(x) + math.trunc(x) + int(x) + round(x)
        quotient, rest = divmod(q[0], 0.3)
        return 0.5 * p[0] ** 2 + steps * q[0] + quotient * q[0] + rest * rest


@pytest.mark.compiled
def test_they_have_the_same_bits_in_native_code() -> None:
    system = Stairs()
    runs = [
        lm.integrate(system, lm.RKMK(order=4), system.state(0.37, 0.61), h=0.05, steps=40, compiled=c)
        for c in (False, True)
    ]
    assert np.array_equal(runs[0].q, runs[1].q) and np.array_equal(runs[0].p, runs[1].p)


@lm.record
class ErrorFunction(lm.HamiltonianSystem):
    """A potential without a known derivative."""

    degrees = 1

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return p[0] ** 2 + math.erf(q[0])


@pytest.mark.compiled
def test_what_is_advised_exists() -> None:
    system = ErrorFunction()
    for compiled, error in ((True, NotCompilable), (False, TypeError)):
        with pytest.raises(error, match="write the gradient or force yourself"):
            lm.integrate(system, lm.RKMK(order=4), system.state(0.3, 0.6), h=0.1, steps=2, compiled=compiled)


@lm.record
class WrittenComplex(lm.HamiltonianSystem):
    """A mistake: complex numbers have classes of their own."""

    degrees = 1

    def energy(self, q: lm.Vec, p: lm.Vec) -> Any:
        return (q[0] * 1j * p[0]).real


def test_a_complex_constant_is_not_taken_for_a_power_of_a_negative_number() -> None:
    system = WrittenComplex()
    with pytest.raises(TypeError, match="complex"):
        lm.integrate(system, lm.RKMK(order=4), system.state(0.3, 0.6), h=0.1, steps=2, compiled=False)
