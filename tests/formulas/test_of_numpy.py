"""NumPy's functions of vectors, matrices and numbers that carry more are the formulas of the same
meaning; what meets samples of a run, NumPy computes.
"""

from __future__ import annotations

import functools
import math
import operator
from typing import Any

import numpy as np
import pytest
from compiler.worlds import same_in_all_worlds

import liemech as lm
from liemech import formulas
from liemech.errors import InvalidType
from liemech.formulas import Dual, Mat, Vec, of_numpy, vec
from liemech.formulas.numbers.double_double import DoubleDouble

TABLE, FIELD = np.array([[2.0, -1.0, 0.5], [0.25, 3.0, 1.0]]), np.array([0.5, -2.0, 1.5])
X, STEP = 0.4, 1e-3


SMOOTH = [f for f in of_numpy.BY_COMPONENTS if f not in (np.clip, np.where, np.sign, np.floor_divide)]


@pytest.mark.parametrize("function", SMOOTH, ids=lambda f: f.__name__)
def test_functions_of_numbers_know_their_derivative(function: Any) -> None:
    """Against differences of order 6 of NumPy's own values."""
    shift = 1.0 if function is np.arccosh else 0.0
    others = [0.2 if function is np.maximum else 0.7] * (function.nin - 1)
    found = function(Dual(X + shift, 1.0), *others)
    around = [function(X + shift + k * STEP, *others) for k in (-3, -2, -1, 1, 2, 3)]
    slope = np.dot([-1, 9, -45, 45, -9, 1], around) / (60 * STEP)
    assert found.value == pytest.approx(function(X + shift, *others), rel=4e-16)
    assert found.slope == pytest.approx(slope, rel=1e-11)
    of_vector = function(Vec(0.7, Dual(X + shift, 1.0)), *others)
    assert (of_vector[1].value, of_vector[1].slope) == (found.value, found.slope)
    if others:
        slopes = {np.copysign: 0.0, np.maximum: None, np.minimum: 1.0}
        of_second = getattr(function(0.7, Dual(X, 1.0)), "slope", None)
        assert of_second == slopes[function] if function in slopes else of_second != 0.0


@pytest.mark.parametrize("function", of_numpy.OPERATORS, ids=lambda f: f.__name__)
def test_operators_with_what_numpy_has_on_the_left(function: Any) -> None:
    if function.nin == 1:
        assert function(Dual(X, 1.0)).slope in (1.0, -1.0)
        assert [*function(Vec(X, -X))] == [*function(np.array([X, -X]))]
        return
    number, array = Dual(X, 1.0), np.array([1.5, 2.5])
    found = function(np.float64(1.5), number)
    assert found.value == function(1.5, X)
    h = 1e-6
    slope = (function(1.5, X + h) - function(1.5, X - h)) / (2.0 * h)
    assert found.slope == pytest.approx(slope, abs=1e-8)
    assert [x.value for x in function(array, number)] == [*function(array, X)]
    both = function(array, Vec(X, 2.0))
    assert type(both) is Vec and [*both] == [*function(array, np.array([X, 2.0]))]


@pytest.mark.parametrize("function", of_numpy.COMPARISONS, ids=lambda f: f.__name__)
def test_comparisons_look_at_values(function: Any) -> None:
    for x in (0.25, 0.5, 0.75):
        moving = 1.0 if x != 0.5 or function not in (np.equal, np.not_equal) else 0
        assert function(np.float64(x), Dual(0.5, moving)) is bool(function(x, 0.5))
        assert function(Vec(x, 1.0), np.array([0.5, 1.0])).tolist() == [*function([x, 1.0], [0.5, 1.0])]


def test_functions_of_vectors_are_those_of_formulas() -> None:
    a, b = Vec(0.1, 0.7, -0.3), Vec(1.1, -0.2, 0.9)
    m = Mat((2.0, 0.3, 0.1), (0.2, 1.5, -0.4), (0.0, 0.6, 3.0))
    assert np.dot(a, b) == np.inner(a, b) == lm.dot(a, b)
    assert np.cross(a, b) == lm.cross(a, b) and np.outer(a, b) == lm.outer(a, b)
    assert np.linalg.norm(a) == lm.norm(a) and np.sum(a) == lm.sum(a)
    assert np.dot(TABLE, a) == np.matmul(TABLE, a) == TABLE @ a == Mat.of(TABLE) @ a
    assert np.transpose(m) == m.T and np.linalg.solve(m, a) == formulas.solve(m, a)
    assert np.cross(a, [1.0, 0.0, 0.0]) == lm.cross(a, vec(1.0, 0.0, 0.0))
    assert np.linalg.inv(m) == formulas.inverse(m) and np.linalg.det(m) == formulas.determinant(m)
    assert np.allclose(m @ np.linalg.solve(m, np.eye(3)), np.eye(3), atol=1e-15)
    assert np.linalg.det(m) == pytest.approx(np.linalg.det(np.asarray(m)), rel=1e-14)
    # what has no formula is NumPy's, of arrays
    assert np.linalg.norm(a, ord=1) == np.abs(np.asarray(a)).sum()
    assert [*np.linalg.eigvals(m)] == [*np.linalg.eigvals(np.asarray(m))]
    assert np.stack([a, b]).shape == (2, 3) and np.isfinite(m).all()
    total = np.zeros(3)
    total += a
    np.add(a, b, out=total)
    assert type(total) is np.ndarray and [*total] == [*(a + b)]


def test_samples_of_a_run_stand_beside_vectors() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state([1.0, 0.2, -0.1], np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=3)
    assert type(start.mu) is Vec and type(start.g) is Mat
    for op in operator.add, operator.sub, operator.mul, operator.truediv:
        for pair in ((run.mu, start.mu), (start.mu, run.mu + 3.0)):
            assert type(op(*pair)) is np.ndarray
            assert np.array_equal(op(*pair), op(*map(np.asarray, pair)))
    assert np.array_equal(run.g - start.g, run.g - np.eye(3))
    assert np.array_equal(run.g @ start.g, run.g) and np.array_equal(start.g @ run.g, run.g)
    assert np.linalg.norm(run.mu - start.mu, axis=1)[0] == 0.0
    assert np.cross(start.mu, run.mu).shape == (4, 3)
    assert (start.mu == run.mu[0]).all() and (run.mu[0] == start.mu).all()


FORMULAS = {
    "of vectors": lambda a, b, c, n: (
        np.dot(vec(a, b, c), FIELD),
        np.cross(FIELD, vec(a, b, c)),
        np.linalg.norm(vec(a, b)) + np.sum(vec(a, b, c)),
        np.inner(vec(a, b), vec(b, c)),
        np.outer(vec(a, b), vec(b, c))[0],
        np.dot(TABLE, vec(a, b, c)),
        np.transpose(lm.mat(vec(a, b), vec(b, c)))[1],
        np.linalg.solve(lm.mat(vec(2.0 + a * a, b), vec(b, -1.0 - c * c)), vec(a, c)),
    ),
    "of matrices": lambda a, b, c, n: (
        np.linalg.inv(lm.mat(vec(2.0 + a * a, b), vec(b, -1.0 - c * c)))[0],
        np.linalg.det(lm.mat(vec(a, b, c), vec(b, 2.0, a), vec(1.0, c, b))),
        np.linalg.solve(lm.mat(vec(2.0 + a * a, b), vec(b, -1.0)), TABLE[:, :2])[1],
    ),
    "component by component": lambda a, b, c, n: (
        np.sin(vec(a, b)),
        np.arctan2(vec(a, b), c),
        np.hypot(vec(a, b), vec(b, c)),
        np.exp(lm.mat(vec(a, b), vec(b, c)))[1],
        np.clip(vec(a, b, c), -0.5, FIELD) + np.maximum(vec(a, b, c), b) * np.sign(vec(c, a, b)),
        np.minimum(c, vec(a, b)) - np.array([0.25, 0.5]),
        np.abs(vec(a, b)) + np.square(vec(b, c)) + np.add(FIELD[:2], vec(a, b)),
    ),
    "of derivatives": lambda a, b, c, n: lm.gradient(
        lambda x: (
            np.sin(x[0]) * np.sqrt(2.0 + x[1] * x[1])
            + np.arctan2(x[1], 1.5)
            + np.power(x[0], 3)
            + np.linalg.norm(x - FIELD[:2])
            + np.dot(x, np.exp(x))
        ),
        vec(a, b),
    ),
}


OF_ONE = tuple(f for f in SMOOTH if f.nin == 1 and f is not np.arccosh)
OF_TWO = (*(f for f in SMOOTH if f.nin == 2), np.floor_divide)


@pytest.mark.slow
@pytest.mark.compiled
def test_every_function_by_components_in_native_code() -> None:
    def formula(a: float, b: float, c: float, n: int) -> Any:
        x = vec(0.4 + 0.1 * a, 0.5 + 0.1 * b)
        return (
            [f(x) for f in OF_ONE],
            [f(x, 0.3 + c * c) for f in OF_TWO],
            np.arccosh(3.0 * x),
            np.sign(x - vec(0.5, c)),
            np.clip(x, None, c),
            np.clip(x, 0, 1),
        )

    same_in_all_worlds(formula, np.random.default_rng(3).uniform(0.8, 1.0, size=(8, 3)).tolist())


@pytest.mark.compiled
@pytest.mark.parametrize("what", FORMULAS)
def test_same_bits_in_all_worlds(what: str) -> None:
    rows = np.random.default_rng(5).normal(size=(40, 3)).tolist()
    same_in_all_worlds(FORMULAS[what], rows)


def test_steps_and_bounds_are_those_of_arrays() -> None:
    x = [-2.0, -0.0, 0.0, 0.5, 3.0, math.nan, math.inf]
    for formula in (
        lambda v: np.sign(v),
        lambda v: np.clip(v, -1.0, 2.0),
        lambda v: np.maximum(v, 0.25),
        lambda v: np.minimum(0.25, v),
        lambda v: np.maximum(v, np.array(x[::-1])),
    ):
        assert np.array_equal(formula(Vec(*x)), formula(np.array(x)), equal_nan=True)


def test_sizes_at_the_ends_of_the_numbers() -> None:
    for x, y in ((3e200, -4e200), (3e-200, 4e-200), (0.0, 0.0), (math.inf, 1.0), (5e-324, 0.0)):
        assert np.hypot(Vec(x), Vec(y))[0] == pytest.approx(math.hypot(x, y), rel=4e-16)
    far = np.hypot(Dual(3e200, 1.0), 4e200)
    assert (far.value, far.slope) == (pytest.approx(5e200, rel=4e-16), pytest.approx(0.6))


def test_numbers_and_shapes_that_numpy_has() -> None:
    v, m = Vec(0.3, 0.2), Mat((1.0, 2.0), (3.0, 4.0))
    assert np.longdouble(2.0) * v == np.array(2.0) * v == v * np.array(2.0) == Vec(0.6, 0.4)
    assert (np.longdouble(2.0) * Dual(0.5, 1.0)).slope == 2.0
    assert np.clip(v, None, 0.25) == Vec(0.25, 0.2) and np.clip(v, 0, 1) == v
    assert type(np.clip(v, 1, 2)[0]) is float
    for formula in (
        lambda: np.arctan2(v, Vec(1.0, 2.0, 3.0)),
        lambda: np.linalg.det(m[:1]),
        lambda: np.linalg.inv(m[:1].T),
        lambda: np.linalg.solve(m, Mat((1.0,), (2.0,), (3.0,))),
        lambda: np.linalg.solve(m[:1], v),
    ):
        with pytest.raises(InvalidType):
            formula()
    samples = np.random.default_rng(2).normal(size=(2000, 3))
    for found in (np.dot(samples, vec(1.0, 2.0, 3.0)), np.cross(samples, vec(1.0, 2.0, 3.0))):
        assert type(found) is np.ndarray


def test_numbers_of_two_doubles_keep_their_digits() -> None:
    x = DoubleDouble(0.5, 1e-18)
    found = np.sin(x)
    assert isinstance(found, DoubleDouble)
    assert (found.value, found.low) == (formulas.sin(x).value, formulas.sin(x).low)


@lm.record
class Rotor(lm.Hamiltonian):
    """Half the square of the momentum in the inverse inertia, which a property computes."""

    inertia: lm.Mat

    @functools.cached_property
    def inverse(self) -> Any:
        return np.linalg.inv(self.inertia)

    def energy(self, mu: Any) -> Any:
        return 0.5 * np.dot(mu, self.inverse @ mu)


@pytest.mark.compiled
def test_a_property_computes_the_inverse_of_a_parameter() -> None:
    inertia = [[2.0, 0.1, 0.0], [0.1, 1.0, 0.2], [0.0, 0.2, 2.5]]
    system = lm.LiePoissonSystem(lm.SO3(), Rotor(inertia))
    body = lm.RigidBody(inertia)
    options: Any = {"h": 0.1, "steps": 20}
    plain, native = (
        lm.integrate(system, lm.RKMK(order=4), system.state([1.0, 0.2, 0.4]), compiled=c, **options)
        for c in (False, True)
    )
    expected = lm.integrate(body, lm.RKMK(order=4), body.state([1.0, 0.2, 0.4]), **options)
    assert np.array_equal(plain.mu, native.mu)
    assert np.allclose(plain.mu, expected.mu, atol=1e-14)
