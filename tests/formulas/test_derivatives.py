"""Derivatives inside derivatives against SymPy, in plain Python, in native code and in lanes."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any, ClassVar

import mpmath
import numpy as np
import pytest
from compiler.worlds import same_in_all_worlds

import liemech as lm
from liemech import formulas as f
from liemech.errors import InvalidInput, InvalidType
from liemech.formulas import (
    Complex,
    Dual,
    Mat,
    Vec,
    derivative,
    dot,
    gradient,
    jacobian,
    mat,
    record,
    transpose,
    vec,
    where,
)

ROWS = [(0.3, 0.7), (1.1, 0.4), (2.3, 1.9), (0.2, 1.3)]

# ------------------------------------------------------------------ formulas of two numbers, and what they should be


def confusion(x, y, turns):
    """x d/dy (x + y), by x."""
    return derivative(lambda a: a * derivative(lambda b: a + b, y), x)


def mixed(x, y, turns):
    return derivative(lambda a: derivative(lambda b: f.sin(a * b) + a**3 / b, y), x)


def other_way(x, y, turns):
    return derivative(lambda b: derivative(lambda a: f.sin(a * b) + a**3 / b, x), y)


def third(x, y, turns):
    """d^3/dx^2 dy."""
    return derivative(lambda b: derivative(lambda a: derivative(lambda c: f.exp(c * b) * f.log(c + b), a), x), y)


def thrice(x, y, turns):
    """d^3/dx^3."""
    return derivative(lambda a: derivative(lambda b: derivative(lambda c: f.sqrt(c) * f.atan(y * c), b), a), x)


def of_a_product_of_derivatives(x, y, turns):
    """d/dx (f_x f_y), f = x^2 y^3 + sin x."""
    energy = lambda a, b: a**2 * b**3 + f.sin(a)  # noqa: E731
    return derivative(lambda a: derivative(lambda u: energy(u, y), a) * derivative(lambda u: energy(a, u), y), x)


def at_what_was_derived(x, y, turns):
    """d/dx g(g'(x)), g = exp(y t^2)."""
    g = lambda t: f.exp(y * t * t)  # noqa: E731
    return derivative(lambda a: g(derivative(lambda t: g(t), a)), x)


def along_what_moves(x, y, turns):
    """d/dx of the derivative of u v^2 at (x, y) along (x^2, x y)."""
    return derivative(lambda a: derivative(lambda z: z[0] * z[1] ** 2, vec(a, y), vec(a * a, a * y)), x)


def powers(x, y, turns):
    """Exponents that move, that are moved by another derivative, and both."""
    return vec(
        derivative(lambda a: 2.0**a, x),
        derivative(lambda a: a**a, x),
        derivative(lambda a: derivative(lambda b: a**b, y), x),
        derivative(lambda a: derivative(lambda b: b**a, y), x),
        derivative(lambda a: derivative(lambda b: b ** (a * b), a), x),
        derivative(lambda a: a**2.5 + a**-3 + a**7 - a**-2.0, x),
    )


def elementary(x, y, turns):
    return vec(
        derivative(lambda a: f.hypot(a, y) * f.cbrt(a) + f.exp2(a) * f.log2(a) - f.log10(a * y), x),
        derivative(lambda a: derivative(lambda b: f.asinh(a * b) + f.acosh(1.0 + a * b) + f.atanh(a * b / 9.0), y), x),
        derivative(
            lambda a: derivative(lambda b: f.atan2(a, b) + f.tanh(a - b) + f.log1p(a / b) + f.expm1(a * b), y), x
        ),
        derivative(lambda a: derivative(lambda b: f.pow(a, b) * f.radians(b) + f.degrees(a) / f.fabs(b), y), x),
    )


def hessian(x, y, turns):
    """All second derivatives."""
    energy = lambda z: f.cosh(z[0] * z[1]) / (1.0 + z[0] * z[0])  # noqa: E731
    second = jacobian(lambda z: gradient(energy, z), vec(x, y))
    return vec(*second[0], *second[1])


NESTED = (
    *(confusion, mixed, other_way, third, thrice, of_a_product_of_derivatives),
    *(at_what_was_derived, along_what_moves, powers, elementary, hessian),
)


def by_sympy(formula: Callable[..., Any], symbols: Any) -> Any:
    """What a formula of NESTED is, by computer algebra."""
    import sympy
    from sympy import diff, sqrt

    x, y, a, b = symbols
    energy, growth = a**2 * b**3 + sympy.sin(a), sympy.exp(y * a**2)
    if formula is powers:
        return [
            diff(2**x, x), diff(x**x, x), diff(a**b, a, b), diff(b**a, a, b).subs({a: x, b: y}),
            diff(diff(b ** (a * b), b).subs(b, a), a).subs(a, x),
            diff(x**sympy.Rational(5, 2) + x**-3 + x**7 - x**-2, x),
        ]  # fmt: skip
    if formula is elementary:
        one = sqrt(x**2 + y**2) * sympy.cbrt(x) + 2**x * sympy.log(x, 2) - sympy.log(x * y, 10)
        two = sympy.asinh(x * y) + sympy.acosh(1 + x * y) + sympy.atanh(x * y / 9)
        three = sympy.atan2(x, y) + sympy.tanh(x - y) + sympy.log(1 + x / y) + sympy.exp(x * y)
        four = x**y * y * sympy.pi / 180 + x * 180 / sympy.pi / y
        return [diff(one, x), *[diff(e, x, y) for e in (two, three, four)]]
    return {
        confusion: lambda: 1,
        mixed: lambda: diff(sympy.sin(a * b) + a**3 / b, a, b),
        other_way: lambda: diff(sympy.sin(a * b) + a**3 / b, a, b),
        third: lambda: diff(sympy.exp(a * b) * sympy.log(a + b), a, a, b),
        thrice: lambda: diff(sqrt(a) * sympy.atan(b * a), a, a, a),
        of_a_product_of_derivatives: lambda: diff(diff(energy, a) * diff(energy, b), a),
        at_what_was_derived: lambda: diff(growth.subs(a, diff(growth, a)), a),
        along_what_moves: lambda: diff(x**2 * y**2 + 2 * x * y * x * y, x),
        hessian: lambda: sympy.hessian(sympy.cosh(a * b) / (1 + a * a), (a, b)),
    }[formula]()


@pytest.mark.parametrize("formula", NESTED, ids=lambda formula: formula.__name__)
def test_nested_derivatives_are_those_of_sympy(formula: Callable[..., Any]) -> None:
    import sympy

    symbols = sympy.symbols("x y a b", positive=True)
    exact = by_sympy(formula, symbols)
    for x, y in ROWS:
        values = dict(zip(symbols, (x, y, x, y), strict=True))
        entries = exact if isinstance(exact, (list, sympy.MatrixBase)) else [exact]
        expected = [float(sympy.sympify(e).subs(values).evalf(30)) for e in entries]
        np.testing.assert_allclose(np.array(formula(x, y, 3)).ravel(), expected, rtol=2e-13, atol=1e-14)


@pytest.mark.sample(3)
@pytest.mark.compiled
@pytest.mark.parametrize("formula", NESTED, ids=lambda formula: formula.__name__)
def test_nested_derivatives_have_the_same_bits_in_native_code(formula: Callable[..., Any]) -> None:
    same_in_all_worlds(formula, ROWS)


# ------------------------------------------------------------------ branches


def branching(a, b):
    c = where(a < b, a * b, 2.0)
    if a > 1.0:
        c = c * b
    elif b > 1.0:
        c = 3.0
    return c + min(a, b, 1.5) * max(a * a, b) + abs(a - b)


def on_branches(x, y, turns):
    """Numbers of three levels and constants, chosen by comparisons between levels."""
    inner = branching
    second = derivative(lambda a: derivative(lambda b: inner(a, b), y), x)
    return vec(second, derivative(lambda a: inner(a, y), x), derivative(lambda b: inner(x, b), y))


def constants_on_one_way(x, y, turns):
    """A derivative of zero has no sign, whether nothing moves or it moves with slope zero."""
    return vec(
        derivative(lambda a: -(1.0 if a > 1.0 else a), x),
        derivative(lambda a: derivative(lambda b: -(b if a > 1.0 else a), y), x),
        derivative(lambda a: 0.0 * a if a > 1.0 else -0.0 * a, x),
    )


def root(a):
    """The t with t^3 = a, by Newton's method."""
    t, k = 1.0 + a * a, 0
    while k < 20 and abs(t * t * t - a) > 1e-3:
        t, k = t - (t * t * t - a) / derivative(lambda u: u * u * u, t), k + 1
    return t


def in_loops(x, y, turns):
    """A root differentiated by one number and by two: the loop carries numbers of two levels."""
    return vec(derivative(root, x), derivative(lambda a: derivative(root, a * y), x))


@pytest.mark.compiled
@pytest.mark.parametrize("formula", [on_branches, constants_on_one_way, in_loops], ids=lambda formula: formula.__name__)
def test_branches_and_loops_in_native_code(formula: Callable[..., Any]) -> None:
    same_in_all_worlds(formula, ROWS)


def test_branches_have_the_derivative_of_the_side_taken() -> None:
    assert tuple(on_branches(0.3, 0.7, 3)) == pytest.approx((2.0, 0.7 + 0.7 - 1.0, 0.3 + 0.3 + 1.0))
    assert derivative(lambda x: abs(x), 0.0) == 1.0
    assert derivative(lambda x: where(x > 0.0, x * x, -x), 2.0) == 4.0
    assert derivative(lambda x: x % 3.0 + x // 3.0, 7.5) == 1.0
    assert derivative(lambda x: 7.5 % x, 2.0) == -3.0


# ------------------------------------------------------------------ systems


@record
class Products(lm.HamiltonianSystem):
    """H = q_1 p_1^2 + cos(q_2) p_1 p_2: nothing but the energy is written."""

    degrees: ClassVar[int] = 2
    factor: float

    def energy(self, q, p):
        return self.factor * q[0] * p[0] ** 2 + f.cos(q[1]) * p[0] * p[1]

    def velocity_slope(self, q, p):
        """d(velocity)/dq, a method that derives one that derives."""
        return jacobian(lambda x: self.velocity(x, p), q)


def test_a_derived_velocity_is_derived_again() -> None:
    system, q, p = Products(1.0), vec(2.0, 0.5), vec(3.0, 0.7)
    sin = np.sin(0.5)
    np.testing.assert_allclose(system.velocity_slope(q, p), [[6.0, -0.7 * sin], [0.0, -3.0 * sin]], rtol=1e-15)
    # d^2 H/dq dp in the other order
    transposed = transpose(jacobian(lambda x: -system.force(q, x), p))
    np.testing.assert_allclose(system.velocity_slope(q, p), np.array(transposed).T.T, rtol=1e-15)


def slope_of_products(a, b, turns):
    """The second derivatives of a system's energy by positions and momenta, and by its parameter."""
    by_state = Products(1.0 + a).velocity_slope(vec(a, b), vec(b, 1.0))
    by_factor = derivative(lambda k: Products(k).velocity_slope(vec(a, b), vec(b, 1.0)), a)
    return vec(*by_state[0], *by_state[1]), vec(*by_factor[0], *by_factor[1])


@pytest.mark.compiled
def test_methods_that_derive_in_native_code() -> None:
    same_in_all_worlds(slope_of_products, ROWS)


@record
class Potential(lm.Potential):
    """An energy of attitudes, whose torque and stiffness follow."""

    def energy(self, g):
        return g[2][0] * g[2][1] + f.sin(g[0][2])


def stiffness(a, b, turns):
    """The derivative of the torque along the group, d/dt torque(g exp(t eta)): the torque is itself such a derivative."""
    group, eta = lm.SO3(), vec(a, b, 0.5)
    g = group.exp(vec(b, a, 0.25))
    return derivative(lambda t: Potential().force(group, group.compose_exp(g, t * eta)), 0.0)


def test_derivatives_along_a_group_are_those_of_differences() -> None:
    group, a, b, h = lm.SO3(), 0.3, 0.7, 1e-5
    g, eta = group.exp(vec(b, a, 0.25)), vec(a, b, 0.5)
    there, here = (Potential().force(group, group.compose_exp(g, t * eta)) for t in (h, -h))
    np.testing.assert_allclose(stiffness(a, b, 3), (np.array(there) - np.array(here)) / (2 * h), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.compiled
def test_derivatives_along_a_group_in_native_code() -> None:
    same_in_all_worlds(stiffness, ROWS)


# ------------------------------------------------------------------ what formulas take and return


def test_derivatives_by_a_number_and_of_anything() -> None:
    assert derivative(lambda t: t**3, 2) == 12.0
    assert derivative(lambda t: t**3, 2.0, 0.5) == 6.0
    assert derivative(lambda t: 7, 2.0) == 0.0
    assert type(derivative(lambda t: 7, 2.0)) is float
    assert derivative(lambda t: (t, 3, [t * t]), 2.0) == (1.0, 0.0, [4.0])
    assert derivative(lambda t: t * mat(vec(1.0, t)), 2.0) == mat(vec(1.0, 4.0))
    assert derivative(lambda t: Complex(t, t * t), 2.0) == Complex(1.0, 4.0)
    assert derivative(lambda m: (m @ m)[0, 1], mat(vec(1.0, 2.0), vec(3.0, 4.0)), np.eye(2)) == 4.0
    state = lm.RigidBody([1.0, 2.0, 3.0]).state(mu=[1.0, 2.0, 3.0])
    moved = derivative(lambda t: type(state)(t * state.mu, None), 1.0)
    assert moved.mu == state.mu and moved.g is None


@pytest.mark.parametrize("x", [[1.0, 2.0], (1.0, 2.0), np.array([1.0, 2.0]), np.array([1, 2]), vec(1, 2)])
def test_vectors_come_in_every_shape(x: Any) -> None:
    assert gradient(lambda y: y[0] ** 2 * y[1], x) == vec(4.0, 1.0)
    assert derivative(lambda y: dot(y, y), x, [1, 0]) == 2.0
    assert derivative(lambda y: dot(y, y), x, np.array([0, 2])) == 8.0
    assert jacobian(lambda y: y * y, x) == mat(vec(2.0, 0.0), vec(0.0, 4.0))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda: derivative(lambda x: x[0], vec(1.0, 2.0, 3.0), vec(1.0, 2.0)), "3 components .* 2 components"),
        (lambda: derivative(lambda x: x[0], vec(1.0, 2.0, 3.0)), "3 components .* got 1.0"),
        (lambda: derivative(lambda x: x, 1.0, vec(1.0, 2.0)), "is a number; got Vec"),
        (lambda: gradient(lambda x: x, 1.0), "must be a vector; got float"),
        (lambda: derivative(lambda x: lambda y: x * y, 1.0), "got function"),
    ],
)
def test_what_has_no_derivative_is_refused(wrong: Callable[[], Any], named: str) -> None:
    with pytest.raises(InvalidType, match=named):
        wrong()


def test_powers_at_zero() -> None:
    for n, slope in ((0, 0.0), (0.0, 0.0), (1, 1.0), (1.0, 1.0), (2, 0.0), (2.0, 0.0), (1.5, 0.0)):
        assert derivative(lambda x, n=n: x**n, 0.0) == slope
    assert derivative(lambda x: x**0, 3.0) == 0.0
    assert derivative(lambda n: 0.0**n, 2.0) == 0.0


def with_moving_exponents(x, y, turns):
    """(y^n)' and (x^n)'' where the exponent n moves as well, n = 0 among others."""
    slopes = vec(0.0, 0.0, 0.0)
    for n in (0.0, 1.0, 2.0, -0.5):
        first = derivative(lambda s, n=n: (y + s) ** (n + 2.0 * s), 0.0)
        second = derivative(lambda s, n=n: derivative(lambda r: (x + r) ** (n + 2.0 * r), s), 0.0)
        mixed = derivative(lambda s, n=n: derivative(lambda b: b ** (n + s), x), 0.0)
        slopes = slopes + vec(first, second, mixed)
    return slopes


@pytest.mark.slow
@pytest.mark.compiled
def test_powers_with_an_exponent_that_moves_through_zero() -> None:
    for x, y in ROWS:
        wanted = np.zeros(3)
        for n in (0.0, 1.0, 2.0, -0.5):
            power = functools.partial(lambda b, n, s: (b + s) ** (n + 2 * s), n=n)
            slopes = (
                mpmath.diff(lambda s, f=power, b=y: f(b, s=s), 0),
                mpmath.diff(lambda s, f=power, b=x: f(b, s=s), 0, 2),
                mpmath.diff(lambda s, b, n=n: b ** (n + s), (0, x), (1, 1)),
            )
            wanted += np.array(slopes, float)
        assert np.allclose(with_moving_exponents(x, y, 3), wanted, rtol=1e-9, atol=1e-9)
    same_in_all_worlds(with_moving_exponents, ROWS)


@pytest.mark.parametrize("n, at_zero", [(0.0, None), (1.0, None), (1.5, 0.0), (2.0, 0.0), (3.0, 0.0)])
def test_a_power_of_zero_has_a_mixed_derivative_if_its_exponent_is_above_one(n: float, at_zero: float | None) -> None:
    """x^(n - 1) (1 + n log x), which is infinite for n <= 1."""
    ways = (
        lambda: derivative(lambda n: derivative(lambda x: x**n, 0.0), n),
        lambda: derivative(lambda x: derivative(lambda n: x**n, n), 0.0),
    )
    for way in ways:
        if at_zero is None:
            with pytest.raises(InvalidInput, match="infinite there"):
                way()
        else:
            assert way() == at_zero
    assert derivative(lambda x: x**n, 0.0) == {0.0: 0.0, 1.0: 1.0}.get(n, 0.0)


def slopes_of_powers(x, n, turns):
    inner = derivative(lambda n: derivative(lambda x: x**n, x), n)
    return vec(inner, derivative(lambda x: derivative(lambda n: x**n, n), x))


@pytest.mark.compiled
def test_mixed_derivatives_of_powers_of_zero_are_refused_in_all_worlds_alike() -> None:
    rows = [(0.0, 2.0), (0.0, 3.5), (2.0, 1.0), (0.0, 1.0), (0.0, 0.5), (0.0, 0.0), (0.3, -1.0)]
    same_in_all_worlds(slopes_of_powers, rows)


@record
class Exponent(lm.Record):
    """A power whose exponent is a number at run time, whole or not."""

    n: float

    def slopes(self, x):
        return vec(derivative(lambda a: a**self.n, x), derivative(lambda a: derivative(lambda b: b**self.n, a), x))


def with_exponents(a, b, turns):
    total = vec(0.0, 0.0)
    for n in (2.0, -1.0, 0.0, 1.0, 0.5):
        total = total + Exponent(n + 0.0 * a).slopes(b)
    return total


@pytest.mark.compiled
def test_exponents_known_at_run_time_only() -> None:
    same_in_all_worlds(with_exponents, ROWS)


# ------------------------------------------------------------------ levels


def test_a_number_made_by_hand_stands_above_what_is_being_derived_and_below_what_will_be() -> None:
    x = Dual(2.0, 1.0)
    assert derivative(lambda y: x * y, 3.0).parts == (2.0, 1.0)
    assert derivative(lambda y: (Dual(y, 1.0) * y).slope, 3.0) == 1.0
    assert (x * derivative(lambda y: x + y, 3.0)).parts == (2.0, 1.0)


def test_levels_are_restored_after_an_error() -> None:
    def raising(x: Any) -> Any:
        raise ArithmeticError

    level = Dual(1.0, 1.0).level
    for _ in range(3):
        with pytest.raises(ArithmeticError):
            derivative(lambda x: derivative(raising, x), 1.0)
    assert Dual(1.0, 1.0).level == level


def test_threads_have_levels_of_their_own() -> None:
    inside, outside, found = threading.Event(), threading.Event(), []

    def waiting(x: Any) -> Any:
        inside.set()
        outside.wait(10.0)
        return x * derivative(lambda y: x + y, 1.0)

    thread = threading.Thread(target=lambda: found.append(derivative(waiting, 3.0)))
    thread.start()
    inside.wait(10.0)
    assert Dual(1.0, 1.0).level == 0.5
    assert derivative(lambda x: x * derivative(lambda y: x + y, 1.0), 3.0) == 1.0
    outside.set()
    thread.join(10.0)
    assert found == [1.0]


def test_complex_numbers_hold_derivatives_in_either_order() -> None:
    for product in (lambda x: x * Complex(1.0, 2.0), lambda x: Complex(1.0, 2.0) * x, lambda x: Complex(x, 2.0 * x)):
        assert derivative(product, 3.0) == Complex(1.0, 2.0)
    assert derivative(lambda x: (x + Complex(0.0, 1.0)) ** 2, 3.0) == Complex(6.0, 2.0)
    assert derivative(lambda x: 5.0 / (x * Complex(0.0, 1.0)), 2.0) == Complex(0.0, 1.25)
    mixed = derivative(lambda x: derivative(lambda y: x * Complex(0.0, y) * y, 2.0), 3.0)
    assert mixed == Complex(0.0, 4.0)
    assert derivative(lambda z: z[0] * z[0], [Complex(1.0, 2.0)], [Complex(0.0, 1.0)]) == Complex(-4.0, 2.0)


def with_complex_numbers(x, y, turns):
    z = derivative(lambda a: derivative(lambda b: (a + Complex(b, a)) * (b * Complex(0.0, 1.0)) / Complex(a, b), y), x)
    return z.re, z.im, abs(z)


@pytest.mark.compiled
def test_complex_numbers_with_derivatives_in_native_code() -> None:
    same_in_all_worlds(with_complex_numbers, ROWS)


def test_math_says_which_functions_to_take() -> None:
    import math

    with pytest.raises(TypeError, match=r"liemech.formulas .*, not from math"):
        derivative(lambda x: math.sin(x), 1.0)


def test_a_dual_is_true_where_its_value_is() -> None:
    assert derivative(lambda x: x * x if x else x, 2.0) == 4.0
    with pytest.raises(InvalidInput, match="no slope"):
        derivative(lambda x: x * x if x else x, 0.0)
    assert isinstance(gradient(lambda x: x[0], vec(1.0, 2.0)), Vec)
    assert isinstance(jacobian(lambda x: x, vec(1.0, 2.0)), Mat)
