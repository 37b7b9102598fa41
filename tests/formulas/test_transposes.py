"""Transposed derivatives of formulas: J^T w, against the Jacobian, closed forms of groups and differences of 50 digits."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem
from liemech.formulas import dot, jacobian, vec, where
from liemech.formulas.numbers.transposes import AtElement, pulled_back, ruled
from liemech.groups.retractions import Exponential
from liemech.solvers import fixed_point, newton

X, W = vec(0.3, -0.7, 1.1), vec(0.9, -0.4, 0.6)

FORMULAS: dict[str, Callable[[Any], Any]] = {
    "linear": lambda x: 2.0 * x - vec(x[1], x[2], 0.0) / 3.0,
    "products": lambda x: vec(x[0] * x[1], x[2] / (2.0 - x[0]), x[1] ** 3),
    "functions": lambda x: vec(lm.formulas.sin(x[0]), lm.formulas.exp(x[1] * x[2]), lm.formulas.atan2(x[0], x[2])),
    "a branch": lambda x: x * x[0] if x[1] < 0.0 else x,
    "where": lambda x: vec(where(x[0] > 0.0, x[1], x[2]), where(x[1] > 0.0, x[0], 2.0), abs(x[1])),
    "at rest": lambda x: vec(x[0], 1.0, 2.0),
    "twice": lambda x: dot(x, x) * x + dot(x, x) * vec(x[2], x[0], x[1]),
    "a rotation": lambda x: lm.SO3().exp_Ad_star(x, vec(1.0, 2.0, 3.0)),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_as_the_jacobian(name: str) -> None:
    formula = FORMULAS[name]
    wanted = np.asarray(jacobian(formula, X)).T @ np.asarray(W)
    found, notes = pulled_back(formula, None, (), X, W)
    assert np.abs(np.asarray(found) - wanted).max() < 4e-16 * max(1.0, np.abs(wanted).max())
    assert not notes


def test_fifty_digits() -> None:
    """The gradient of a nested formula, against differences in fifty digits."""
    found, _ = pulled_back(lambda x: lm.formulas.sin(x[0] * lm.formulas.exp(x[1])) / x[2], None, (), X, 1.0)
    with mpmath.workdps(50):
        h, x = mpmath.mpf(10) ** -20, [mpmath.mpf(a) for a in X]
        for i in range(3):
            ends = [[y + s * h * (i == j) for j, y in enumerate(x)] for s in (1, -1)]
            f = [mpmath.sin(a * mpmath.exp(b)) / c for a, b, c in ends]
            assert abs(found[i] - float((f[0] - f[1]) / (2 * h))) < 2e-16


@pytest.mark.parametrize("group", [lm.SO3(), lm.SE3(), lm.UnitQuaternions()], ids=repr)
def test_elements(group: Any) -> None:
    """Of k g exp(x), w on eta: by g it is Ad*_exp(-x) w, by x the dual of the differential, whether the product is
    written with one formula or with two.
    """
    rng = np.random.default_rng(3)
    k, g, x, w = [vec(*rng.normal(size=group.dim)) for _ in range(4)]
    k, g = group.exp(k), group.exp(g)
    both = lambda g, x: group.compose(g, group.exp(x))  # noqa: E731

    def moved(product: Any, p: AtElement, x: Any) -> Any:
        return AtElement(group.compose(k, product(p.g, x)))

    for product in (both, group.compose_exp):
        by_g, _ = pulled_back(functools.partial(moved, product, x=x), group, (), AtElement(g), AtElement(w))
        by_x, _ = pulled_back(functools.partial(moved, product, AtElement(g)), group, (), x, AtElement(w))
        assert np.abs(np.asarray(by_g.g) - np.asarray(group.K(group.exp(x), w))).max() < 1e-14
        assert np.abs(np.asarray(by_x) - np.asarray(Exponential().dtau_dual(group, x, w))).max() < 1e-14


def test_roots() -> None:
    """x(a) with x^3 + x = a has the slope 1/(3 x^2 + 1), by Newton's method and by sweeps."""

    def root(a: Any) -> Any:
        def equation(x: Any) -> Any:
            r = vec(*[y * y * y + y - b for y, b in zip(x, a)])
            return r, lm.mat(*[[3.0 * x[i] ** 2 + 1.0 if i == j else 0.0 for j in range(3)] for i in range(3)]), 1.0

        return newton(equation, vec(1.0, 1.0, 1.0), vec(*[1.0, 1.0, 1.0]))[0]

    def settled(a: Any) -> Any:
        def sweep(x: Any) -> Any:
            new = vec(*[(2.0 * y**3 + b) / (3.0 * y**2 + 1.0) for y, b in zip(x, a)])
            return new, lm.norm(new - x), 1.0  # whose slope at zero is infinite, and of no account

        return fixed_point(sweep, vec(1.0, 1.0, 1.0), "sweeps", 1.0)

    for formula in (root, settled):
        found, _ = pulled_back(formula, None, (), X, W)
        for a, w, by_a in zip(X, W, found):
            x = 2.0 / np.sqrt(3.0) * np.sinh(np.arcsinh(1.5 * np.sqrt(3.0) * a) / 3.0)  # Cardano's
            assert by_a == pytest.approx(w / (3.0 * x * x + 1.0), rel=1e-14)


def test_rules() -> None:
    """A rule is followed instead of the formula, once for all that depends on it, and its notes are kept; inside of a
    derivative it has no forms, and is refused where these are asked for.
    """

    def square(x: Any) -> Any:
        return vec(*[a * a for a in x])

    def back(x: Any, w: Any) -> Any:
        return (vec(*[20.0 * a * b for a, b in zip(x, w)]),), [("asked", *w)]

    def formula(x: Any) -> Any:
        y = ruled(square, back, None, (), x)
        return vec(y[0] + y[1], y[0] - y[1], y[2])

    found, notes = pulled_back(formula, None, (), X, W)
    felt = [W[0] + W[1], W[0] - W[1], W[2]]
    assert list(found) == pytest.approx([20.0 * a * b for a, b in zip(X, felt)], rel=1e-15)
    assert [kind for kind, *_ in notes] == ["asked"]
    assert list(notes[0][1:]) == pytest.approx(felt, rel=1e-15)
    assert list(formula(X)) == pytest.approx([X[0] ** 2 + X[1] ** 2, X[0] ** 2 - X[1] ** 2, X[2] ** 2])
    with pytest.raises(IncompatibleSystem, match="through a derivative"):
        pulled_back(lambda x: lm.derivative(lambda y: ruled(square, back, None, (), y), x, W), None, (), X, W)
