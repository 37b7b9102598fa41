"""Functions of `math` in formulas that are differentiated, `return` inside of loops whose length the
run decides, and dicts built step by step.
"""

from __future__ import annotations

import math
import warnings
from math import exp as exponential
from typing import Any

import numpy as np
import pytest
from compiler.worlds import same_in_all_worlds

import liemech as lm
from liemech import formulas as f
from liemech.formulas import derivative, vec

pytestmark = pytest.mark.compiled
ROWS = [[0.7, -0.3, 0.55], [0.2, 0.9, -0.4], [-3.0, 2.0, 1.0], [0.0, 0.0, 0.0]]


def wave(q: Any) -> Any:
    return math.sqrt(1.0 + q * q) * math.sin(q) + exponential(0.1 * q) * math.log(3.0 + q * q, 2)


def wave_of_formulas(q: Any) -> Any:
    return f.sqrt(1.0 + q * q) * f.sin(q) + f.exp(0.1 * q) * (f.log(3.0 + q * q) / f.log(2.0))


def test_slopes_of_math_are_those_of_formulas() -> None:
    def formula(x: float, y: float, z: float, n: int) -> Any:
        twice = derivative(lambda s: derivative(lambda t: math.atan2(t, 2.0) * wave(s * t), y), z)
        return vec(derivative(wave, x), twice, math.pi * z)

    for x, *_ in ROWS:
        assert derivative(wave, x) == derivative(wave_of_formulas, x)
    same_in_all_worlds(formula, ROWS)


def test_math_raises_where_python_raises() -> None:
    def formula(x: float, y: float, n: int) -> Any:
        return vec(derivative(lambda s: math.sqrt(s), x), y)

    with pytest.raises(ValueError, match="math domain error"):
        formula(-1.0, 0.0, 2)
    same_in_all_worlds(formula, [[0.5, 1.0], [-1.0, 1.0]])


@lm.record
class _Wavy(lm.Hamiltonian):
    k: float = 2.0

    def energy(self, mu: Any) -> Any:
        return 0.5 * lm.dot(mu, mu) + 0.1 * math.sin(self.k * mu[0]) + wave(mu[1])


@pytest.mark.slow
def test_an_energy_with_math_runs_plain_and_native() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), _Wavy())
    start = system.state(mu=[0.1, 0.2, 0.3])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runs = [lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=12, compiled=c).mu for c in (False, True)]
    assert np.array_equal(*runs)


def root(x: Any) -> Any:
    y = 1.0
    while True:
        z = 0.5 * (y + x / y)
        if abs(z - y) <= 1e-14 * abs(z):
            return z
        y = z


def searched(x: Any, n: int) -> Any:
    for k in range(20 * n):
        x = 0.75 * x - 0.1
        if k == 1:
            continue
        if x < -0.3:
            return x, k
        if x > 100.0:
            break
    else:
        return 0.0, 1000
    return -1.0, -1


@pytest.mark.slow
def test_returns_inside_of_loops() -> None:
    def formula(x: float, y: float, z: float, n: int) -> Any:
        total = 0.0
        for i in range(20 * n):
            j = 0
            while j < 50:
                y = 0.5 * y + 0.01
                j = j + 1
                if abs(y) < 0.3:
                    break
            total = total + y
            if total > 0.5:
                return vec(total, i, root(1.0 + x * x), *searched(z, n))
        return vec(x, -1.0, derivative(root, 2.0 + z), *searched(x, n))

    assert root(2.0) == pytest.approx(math.sqrt(2.0), rel=1e-15)
    same_in_all_worlds(formula, [*ROWS, [1e4, -1e4, 5e3]])


def test_dicts_built_step_by_step() -> None:
    def formula(x: float, y: float, z: float, n: int) -> Any:
        found: dict[Any, Any] = {}
        for key in ("a", "b", "c"):
            found[key] = x * len(found) + y
        found["a"] += z
        doubled = {key: 2.0 * value for key, value in found.items()}
        return vec(found["a"], *doubled.values(), found.get("z", x))

    same_in_all_worlds(formula, ROWS)
