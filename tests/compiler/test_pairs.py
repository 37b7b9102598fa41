"""Numbers made of two: derivatives that formulas carry along, complex entries, and the lambdas that make use of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
import pytest

import liemech as lm
from liemech import formulas
from liemech.compiler import kernel
from liemech.compiler.driver import read, write
from liemech.formulas import (
    Complex,
    Dual,
    Mat,
    Vec,
    constant,
    derivative,
    dot,
    identity_matrix,
    jacobian,
    mat,
    record,
    sqrt,
    vec,
    where,
)
from liemech.formulas.classes.layouts import layout_of

ELEMENTARY = {
    "sqrt": 0.7, "sin": 0.7, "cos": 0.7, "tan": 0.7, "asin": 0.3, "acos": 0.3, "atan": 0.7, "sinh": 0.7, "cosh": 0.7, "tanh": 0.7,
    "exp": 0.7, "log": 0.7, "expm1": 0.7, "log1p": 0.7,
}  # fmt: skip
OPERATORS: dict[str, Callable[[Any], Any]] = {
    "sums": lambda x: 2.0 + x - (3.0 - x) + (x + x) - (x - 1.0) + (x - x),
    "products": lambda x: 2.0 * x * x * 3.0,
    "quotients": lambda x: x / (1.0 + x) + 2.0 / x + x / 3.0,
    "powers": lambda x: x**3 + x**-1 + (-x) ** 2 + x**0.5,
    "absolute value": lambda x: abs(x) * abs(-x - 1.0),
}


def slope(f: Callable[[Any], Any], x: float) -> float:
    return mp.diff(f, x)


@pytest.mark.parametrize("name", ELEMENTARY)
def test_derivatives_of_elementary_functions(name: str) -> None:
    x, f = ELEMENTARY[name], getattr(formulas, name)
    with mp.workdps(30):
        assert f(Dual(x, 2.0)).slope == pytest.approx(float(2 * slope(getattr(mp, name), mp.mpf(x))), rel=1e-15)
    assert f(Dual(x, 2.0)).value == f(x)


def test_derivative_of_atan2() -> None:
    for y, x in ((0.3, 0.4), (-0.3, -0.4), (0.3, -0.4)):
        with mp.workdps(30):
            dy, dx = (float(mp.diff(mp.atan2, (y, x), n)) for n in ((1, 0), (0, 1)))
        assert formulas.atan2(Dual(y, 1.0), x).slope == pytest.approx(dy, rel=1e-15)
        assert formulas.atan2(y, Dual(x, 1.0)).slope == pytest.approx(dx, rel=1e-15)


@pytest.mark.parametrize("name", OPERATORS)
@pytest.mark.parametrize("x", [0.7, 2.3])
def test_derivatives_of_operators(name: str, x: float) -> None:
    with mp.workdps(30):
        assert OPERATORS[name](Dual(x, 1.0)).slope == pytest.approx(float(slope(OPERATORS[name], mp.mpf(x))), rel=4e-15)


def test_comparisons_look_at_the_value() -> None:
    a, b = Dual(1.0, 5.0), Dual(2.0, -5.0)
    assert a < b
    assert a <= b
    assert b > a
    assert b >= 1.0
    assert Dual(1.0, 0) == 1.0
    assert a == Dual(1.0, 5.0)
    assert a != b
    assert where(a < 2.0, a, b) is a
    assert a and not Dual(0.0, 0)


@pytest.mark.parametrize(
    "asked",
    [
        lambda x: x == 1.0,
        lambda x: x != 1.0,
        lambda x: x == 1.0,
        lambda x: x in (0.5, 1.0),
        lambda x: not x - 1.0,
        lambda x: x == Dual(1.0, 2.0),
        lambda x: Dual(x, 0) == 1.0,
        lambda x: x == Dual(1.0, float("nan")),
    ],
)
def test_an_equality_that_holds_at_one_point_only_is_refused(asked: Any) -> None:
    with pytest.raises(lm.errors.InvalidInput, match="constant"):
        asked(Dual(1.0, 5.0, 1.0))


def test_what_does_not_move_is_compared() -> None:
    square = Dual(0.0, 0.0, 1.0)  # x^2 at x = 0
    assert square == 0.0 and not square and constant(Dual(Dual(2.0, 1.0, 1.0), 3.0, 2.0)) == 2.0
    with pytest.raises(lm.errors.InvalidInput):  # which moves to second order
        assert Dual(square, Dual(0.0, 2.0, 1.0), 2.0) == 0.0


def test_second_derivatives() -> None:
    """Duals of duals: the Hessian of a function of two variables."""

    def f(x: Any) -> Any:
        return formulas.sin(x[0] * x[1]) + x[0] ** 3 / x[1]

    def gradient(x: Any) -> Vec:
        return vec(*[derivative(f, x, unit) for unit in identity_matrix(2)])

    x, y = 0.7, 1.3
    s, c = np.sin(x * y), np.cos(x * y)
    expected = [[-y * y * s + 6 * x / y, c - x * y * s - 3 * x * x / y**2], [0, -x * x * s + 2 * x**3 / y**3]]
    expected[1][0] = expected[0][1]
    assert np.allclose(jacobian(gradient, vec(x, y)), expected, rtol=1e-15, atol=1e-15)


@record
class Anharmonic(lm.Hamiltonian):
    """An energy whose gradient nobody wrote: it is derived."""

    k: float

    def energy(self, mu):
        return self.k * sqrt(1.0 + dot(mu, mu)) + formulas.sin(mu[0]) * mu[1] / (2.0 + formulas.cos(mu[2]))

    def gradient(self, mu):
        return vec(*[derivative(lambda m: self.energy(m), mu, unit) for unit in identity_matrix(3)])


@pytest.mark.slow
@pytest.mark.compiled
def test_a_derived_gradient_in_native_code_and_in_lanes() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Anharmonic(2.0))
    momenta = np.random.default_rng(1).normal(size=(11, 3))
    run = lm.integrate(system, lm.RKMK(order=4), system.state(momenta), h=0.1, steps=50, compiled=True)
    for i in (0, 10):
        for compiled in (False, True):
            one = lm.integrate(system, lm.RKMK(order=4), system.state(momenta[i]), h=0.1, steps=50, compiled=compiled)
            assert np.array_equal(one.mu, run.mu[:, i])
    assert run.drift()["energy"].largest < 1e-3


@record
class Branching(lm.Hamiltonian):
    """Constants on one way, numbers that carry derivatives on the other."""

    def energy(self, mu):
        a, v = 1.0, vec(0.5, 1.0)
        if mu[0] > 0.2:
            a, v = 2.0 * mu[0], vec(mu[1], 1.0)
        return a * dot(mu, mu) + v[0] * (0.25 if mu[1] > 0.0 else mu[2]) + where(mu[2] > 0.0, mu[2] * mu[2], 0.0)


@pytest.mark.slow
@pytest.mark.compiled
def test_derivatives_on_one_way_only() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Branching())
    momenta = np.random.default_rng(6).normal(size=(20, 3))
    many = lm.integrate(system, lm.RKMK(order=2), system.state(momenta), h=0.01, steps=20, compiled=True)
    for i in range(20):
        one = lm.integrate(system, lm.RKMK(order=2), system.state(momenta[i]), h=0.01, steps=20, compiled=False)
        assert np.array_equal(one.mu, many.mu[:, i])


def test_pairs_multiply_vectors_and_matrices() -> None:
    """c(x) v and c(x) M for a number that carries a derivative, or is complex, on either side."""
    v, m = vec(1.0, 2.0), mat(vec(1.0, 2.0), vec(3.0, 4.0))
    for x in (Dual(3.0, 5.0), Complex(3.0, 5.0)):
        for product, factor in ((x * v, v), (v * x, v), (x * m, m), (m * x, m), (v / x * (x * x), v)):
            first = product[0] if factor is v else product[0, 0]
            assert first.parts == pytest.approx((3.0, 5.0))
            assert type(product) is type(factor)
    assert derivative(lambda x: dot(x, x) * (x[0] * v), vec(2.0, 1.0), vec(1.0, 0.0)) == vec(13.0, 26.0)


# ---------------------------------------------------------------- complex numbers


def test_complex_arithmetic() -> None:
    rng = np.random.default_rng(2)
    for a, b in rng.normal(size=(20, 2)) + 1j * rng.normal(size=(20, 2)):
        x, y = Complex(a.real, a.imag), Complex(b.real, b.imag)
        for ours, theirs in (
            (x + y, a + b), (x - y, a - b), (x * y, a * b), (x / y, a / b), (-x, -a), (x.conjugate(), a.conjugate()),
            (2.0 + x - 1.0, 1.0 + a), (1.0 - x, 1.0 - a), (3.0 * x * 0.5, 1.5 * a), (x / 2.0, a / 2), (1.0 / x, 1 / a),
        ):  # fmt: skip
            assert complex(ours) == pytest.approx(theirs, rel=1e-15)
        assert abs(x) == pytest.approx(abs(a), rel=1e-15)
    assert Complex(1.0) == Complex(1.0, 0.0) != Complex(1.0, 1.0)


def test_complex_matrices_as_arrays() -> None:
    a = np.random.default_rng(3).normal(size=(2, 3, 3))
    z = a[0] + 1j * a[1]
    m = Mat.of(z.tolist())
    assert np.array(m).dtype == complex
    assert np.array_equal(np.array(m), z)
    assert np.allclose(np.array(m @ m), z @ z, rtol=1e-14)
    assert np.allclose(np.array(m.T), z.T)
    assert np.array(mat(vec(1.0, 2.0))).dtype == float


def _squares(array: Any, layout: Any, out: Any) -> None:
    m = read(array, 0, layout)
    write(out, 0, m @ m - (2.0 * m).T, layout)


@pytest.mark.compiled
def test_complex_numbers_in_native_code() -> None:
    """The numbers of a complex matrix lie as re, im, as in an array of complex128; same bits as plain Python."""
    m = Mat.of((np.random.default_rng(4).normal(size=(2, 2, 2)) @ [1, 1j]).tolist())
    flat, outs = np.array(m).ravel().view(float), (np.zeros(8), np.zeros(8))
    _squares(flat, layout_of(m), outs[0])
    kernel.kernel(_squares, flat, layout_of(m), outs[1])(flat, layout_of(m), outs[1])
    assert np.array_equal(*outs)
    assert np.array_equal(outs[0].view(complex).reshape(2, 2), np.array(m @ m - (2.0 * m).T))


@record
class Counted(lm.Hamiltonian):
    """A static number stays one behind a loop of unknown length."""

    n: int

    def energy(self, mu):
        return 0.5 * dot(mu, mu)

    def gradient(self, mu):
        x = 2.0 + mu[0] * mu[0]
        while x > 1.0:
            x = 0.5 * x
        for _ in range(self.n):
            mu = (x / x) * mu
        return mu


@pytest.mark.compiled
def test_static_numbers_stay_static_behind_loops() -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Counted(3))
    for start in (system.state([0.1, 0.2, 0.3]), system.state(np.ones((5, 3)))):
        runs = [
            lm.integrate(system, lm.RKMK(order=2), start, h=0.1, steps=9, compiled=compiled)
            for compiled in (True, False)
        ]
        assert np.array_equal(runs[0].mu, runs[1].mu)
