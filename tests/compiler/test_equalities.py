"""An equality that holds for a number on the move is refused alike everywhere: plain, native, in lanes,
in loops, in derivatives of derivatives, in power series.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from compiler.worlds import REJECTED, plain, same_in_all_worlds

import liemech as lm
from liemech.errors import InvalidInput, NotCompilable
from liemech.formulas import constant, derivative, expm1, gradient, norm, sin, sinc, where


def in_a_loop(x, turns):
    def g(y):
        s = 0.0
        for _ in range(3):
            s = s + (sin(y) / y if y != 0.0 else 1.0)
            y = y - 0.5
        return s

    return derivative(g, x)


def beside_a_branch(x, turns):
    def g(y):
        if x > 1.0:
            return sinc(y)
        return expm1(y) / y if y != 0.0 else 1.0

    return derivative(g, x)


def in_a_long_loop(x, turns):
    def g(y):
        k = 0
        while k < turns:
            y = y + (0.0 if y == 0.25 else 0.125)
            k = k + 1
        return y * y

    return derivative(g, x)


def of_vectors(x, turns):
    return gradient(lambda q: 1.0 * (q == lm.vec(0.0, 0.5)).sum() + q[0], lm.vec(x, 0.3))


def by_where(x, turns):
    return derivative(lambda y: where(y == 0.0, 1.0, y), x)


def by_truth(x, turns):
    return derivative(lambda y: sin(y) / y if y else 1.0, x)


def of_a_root(x, turns):
    return gradient(lambda q: norm(q) if norm(q) != 0.0 else 0.0, lm.vec(x, 0.0))


def of_the_outer(x, turns):
    return derivative(lambda y: derivative(lambda z: z * y if y != 0.5 else z, 1.0), x)


def never_asked(x, turns):
    return derivative(lambda y: y * y if (y > 0.0 and y != 0.5) else 0.0 * y, x)


def of_constants(x, turns):
    return derivative(lambda y: derivative(lambda z: sinc(z) if constant(z) != 0.0 else 1.0 * z, y), x)


def of_what_rests(x, turns):
    return derivative(lambda y: y * y if x != 0.0 else y, x)


PLACES = 0.0, 0.125, 0.5, 1.5, -0.3
REFUSED = {
    in_a_loop: {0.0, 0.5}, beside_a_branch: {0.0}, in_a_long_loop: {0.0, 0.125}, of_vectors: {0.0}, by_where: {0.0},
    by_truth: {0.0}, of_a_root: {0.0}, of_the_outer: {0.5}, never_asked: {0.5}, of_constants: set(), of_what_rests: set(),
}  # fmt: skip


@pytest.mark.compiled
@pytest.mark.parametrize("formula", REFUSED, ids=lambda f: f.__name__)
def test_the_same_is_refused_in_all_worlds(formula: Any) -> None:
    refused = {x for x in PLACES if plain(formula, (x,), 3) == REJECTED}
    assert refused == REFUSED[formula]
    same_in_all_worlds(formula, [(x,) for x in PLACES])


@lm.record
class Guarded(lm.SeparableSystem):
    """A particle whose potential knows a value at zero, and no slope."""

    degrees: int = 1

    def kinetic(self, p: Any) -> Any:
        return 0.5 * lm.dot(p, p)

    def potential(self, q: Any) -> Any:
        return -(sin(q[0]) / q[0] if q[0] != 0.0 else 1.0)


class Smooth(Guarded):
    def potential(self, q: Any) -> Any:
        return -sinc(q[0])


@pytest.mark.compiled
@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("method", "steps"),
    [
        (lm.StormerVerlet(), {"h": 0.1, "steps": 3}),
        (lm.RKMK(order=4), {"h": 0.1, "steps": 3}),
        (lm.RKMK(order=5), {"t_end": 1.0, "rtol": 1e-8}),
        (lm.Taylor(), {"t_end": 1.0, "rtol": 1e-8}),
    ],
    ids=repr,
)
def test_runs_say_what_to_write(method: Any, steps: Any, compiled: bool) -> None:
    for q, p in ([0.0], [0.5]), ([[0.3], [0.0]], [[0.0], [0.5]]):
        with pytest.raises((InvalidInput, NotCompilable), match=r"liemech\.formulas"):
            system = Guarded()
            lm.integrate(system, method, system.state(q=q, p=p), **steps, compiled=compiled, progress=False)


@pytest.mark.parametrize("compiled", [pytest.param(True, marks=pytest.mark.compiled), False])
def test_the_tangent_from_rest(compiled: bool) -> None:
    """Of V = -sin(q)/q at q = p = 0, where V'' = 1/3: powers of the matrix of a step."""
    system, h, n = Smooth(), 0.1, 7
    plan = lm.Plan(system, lm.StormerVerlet(), h=h, compiled=compiled)
    found = plan.tangent(system.state(q=[0.0], p=[0.0]), steps=n)
    kick, drift = np.array([[1.0, 0.0], [-0.5 * h / 3.0, 1.0]]), np.array([[1.0, h], [0.0, 1.0]])
    step = kick @ drift @ kick
    np.testing.assert_allclose(found.tangent["start"][-1], np.linalg.matrix_power(step, n), rtol=1e-13, atol=1e-15)
