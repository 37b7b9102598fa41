"""Power series against the derivatives that mpmath takes in many digits, and against the laws of power series."""

from __future__ import annotations

import operator
from typing import Any, ClassVar

import mpmath
import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput
from liemech.formulas import Complex, Dual, functions, vec
from liemech.formulas.classes.taken_back import back, journal
from liemech.formulas.numbers.bases import StandIn
from liemech.formulas.numbers.products import FIRST, LEAST, PAIR, Products
from liemech.formulas.numbers.series import Series
from liemech.formulas.vectors import Vec

X = (0.3, -0.7, 0.4, 0.25, -0.1)
Y = (1.2, 0.5, -0.3, 0.2)
TERMS = 12


def polynomial(coefficients: tuple[float, ...], s: mpmath.mpf) -> mpmath.mpf:
    return mpmath.polyval([mpmath.mpf(c) for c in reversed(coefficients)], s)


def terms(x: Series, n: int = TERMS) -> np.ndarray:
    return np.array([x[k] for k in range(n)])


def agree(found: Series, formula: object, tolerance: float = 1e-14) -> None:
    with mpmath.workdps(60):
        exact = np.array([float(c) for c in mpmath.taylor(formula, 0, TERMS - 1)])
    scale = np.maximum.accumulate(np.abs(exact))  # products of terms before are what is rounded
    assert (np.abs(terms(found) - exact) <= tolerance * np.maximum(scale, 1.0)).all(), (terms(found) - exact) / scale


OF_TWO = "atan2", "pow"
ELSEWHERE = {
    "log2": lambda x: mpmath.log(x, 2),
    "log10": lambda x: mpmath.log(x, 10),
    "exp2": lambda x: mpmath.mpf(2) ** x,
}


@pytest.mark.parametrize("name", [f.__name__ for f in (functions.sqrt, *functions.LIBM) if f.__name__ not in OF_TWO])
def test_elementary_functions_expand_as_mpmath_says(name: str) -> None:
    exact = ELSEWHERE.get(name) or getattr(mpmath, name)
    x = (1.7, *X[1:]) if name == "acosh" else X  # in its domain
    agree(getattr(functions, name)(Series(*x)), lambda s: exact(polynomial(x, s)), 1e-11 if name == "acosh" else 1e-12)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, -1, -2, 2.0, -3.0, 0.5, -0.5, 1 / 3, 2.7])
def test_powers(n: float) -> None:
    agree(Series(*Y) ** n, lambda s: polynomial(Y, s) ** mpmath.mpf(n), 1e-12)


def test_whole_powers_need_no_logarithm() -> None:
    negative = tuple(-c for c in Y)
    agree(Series(*negative) ** 3, lambda s: polynomial(negative, s) ** 3)
    assert (terms(Series(None, 2.0) ** 3) == [0, 0, 0, 8, *[0] * (TERMS - 4)]).all()


def test_powers_with_series_as_exponents() -> None:
    x, y = Series(*X), Series(*Y)
    agree(2.0**x, lambda s: mpmath.mpf(2) ** polynomial(X, s), 1e-12)
    agree(y**x, lambda s: polynomial(Y, s) ** polynomial(X, s), 1e-12)
    agree(functions.pow(y, x), lambda s: polynomial(Y, s) ** polynomial(X, s), 1e-12)


def test_the_sign_of_another() -> None:
    agree(functions.copysign(Series(*X), -2.0), lambda s: -polynomial(X, s))
    agree(functions.copysign(-Series(*X), Series(*Y)), lambda s: polynomial(X, s))


def test_arithmetic() -> None:
    x, y = Series(*X), Series(*Y)
    p, q = (lambda s: polynomial(X, s)), (lambda s: polynomial(Y, s))
    agree(x + y, lambda s: p(s) + q(s))
    agree(x - y, lambda s: p(s) - q(s))
    agree(x * y, lambda s: p(s) * q(s))
    agree(x * x, lambda s: p(s) ** 2)
    agree(x / y, lambda s: p(s) / q(s))
    agree(2.0 / y, lambda s: 2 / q(s))
    agree(1.5 * x - 2.0 + (3.0 - y) / 4.0 + 1.0, lambda s: p(s) * 3 / 2 - 1 + (3 - q(s)) / 4)
    agree(-x * +y, lambda s: -p(s) * q(s))
    agree(abs(-y), q)


def test_angle() -> None:
    x, y = Series(*X), Series(*Y)
    agree(functions.atan2(y, x), lambda s: mpmath.atan2(polynomial(Y, s), polynomial(X, s)), 1e-12)
    agree(functions.atan2(y, 2.0), lambda s: mpmath.atan2(polynomial(Y, s), 2), 1e-12)
    agree(functions.atan2(2.0, x), lambda s: mpmath.atan2(2, polynomial(X, s)), 1e-12)


def test_comparisons_look_at_the_first_term() -> None:
    x = Series(1.0, -5.0)
    assert x > 0.5 and x >= 1.0 and x < 2.0 and x <= Series(1.0, 7.0) and x != Series(2.0)
    assert Series(1.0) == 1.0 and x and not Series(0.0)


@pytest.mark.parametrize(
    "asked", [lambda x: x == 1.0, lambda x: x != 1.0, lambda x: bool(x - 1.0), lambda x: x * x == Series(1.0)]
)
def test_an_equality_that_holds_only_where_a_series_begins_is_refused(asked: Any) -> None:
    with pytest.raises(InvalidInput, match=r"of a power series.* expm1_over"):
        asked(Series(1.0, -5.0))


def test_functions_that_ask_for_nan_take_series() -> None:
    """x != x is no equality that holds at one point only."""
    x = Series(0.4).by(lambda k: 1.0 / k)
    for function, other in ((np.maximum, -1.0), (np.minimum, 2.0), (np.clip, (-1.0, 2.0))):
        bounds = other if isinstance(other, tuple) else (other,)
        found = function(x, *bounds)
        assert [found[k] for k in range(4)] == [x[k] for k in range(4)]
    root = np.hypot(x, 0.0)
    assert [root[k] for k in range(4)] == pytest.approx([x[k] for k in range(4)], rel=1e-15)
    assert operator.eq(x, x) and not operator.ne(x, x)


def test_terms_that_are_not_there_take_no_part() -> None:
    line = Series(1.0, 2.0)
    assert (line * line).term(3) is None
    assert (line + Series()).term(2) is None
    assert (Series() * line).term(0) is None
    assert (4.0 / Series(2.0)).term(1) is None
    assert (functions.exp(Series(1.0))).term(1) is None


def test_a_series_can_solve_an_equation() -> None:
    y = Series(1.0)
    y.grow(y, 1.0)  # y' = y
    np.testing.assert_allclose(terms(y), [1 / float(mpmath.factorial(k)) for k in range(TERMS)], rtol=1e-15)
    z = Series(0.5)
    z.grow(z * z, 2.0)  # z' = 2 z^2: 1/(2 - 2 s)
    np.testing.assert_allclose(terms(z), 0.5, rtol=1e-15)


def test_a_pendulum_of_two_unknowns_against_the_equation_itself() -> None:
    angle, speed = Series(0.7), Series(-0.2)
    angle.grow(speed, 1.0)
    speed.grow(-functions.sin(angle), 1.0)
    agree(functions.sin(angle), lambda s: mpmath.sin(polynomial(tuple(terms(angle)), s)), 1e-12)
    k = np.arange(1, TERMS)
    np.testing.assert_allclose(terms(angle)[1:], terms(speed)[:-1] / k, rtol=1e-14)
    np.testing.assert_allclose(terms(speed)[1:], -terms(functions.sin(angle))[:-1] / k, rtol=1e-14)


def test_each_term_is_computed_once() -> None:
    count = []
    x = Series(1.0)
    x._rule = lambda k: count.append(k) or 1.0
    y = x * x + x / (2.0 + x)
    for _ in range(3):
        terms(y, 6)
    assert count == [1, 2, 3, 4, 5]


def test_in_vectors_in_derivatives_and_in_complex_numbers() -> None:
    x, y = Series(*X), Series(*Y)
    v = vec(x, y) * y
    assert isinstance(v, Vec)
    agree(v[0], lambda s: polynomial(X, s) * polynomial(Y, s))
    slope = functions.sin(Dual(x, 1.0) * x).slope  # d/de sin((x + e) x) = x cos(x^2)
    agree(slope, lambda s: polynomial(X, s) * mpmath.cos(polynomial(X, s) ** 2), 1e-13)
    product = x * Complex(y, x)
    agree(product.im, lambda s: polynomial(X, s) ** 2)
    assert isinstance(x * Dual(1.0, 2.0), Dual)
    with pytest.raises(TypeError):
        x + "1"  # type: ignore[operator]


@lm.record
class Wall(lm.SeparableSystem):
    """A mass on a spring that leans against a soft wall at q = 0.3."""

    degrees: ClassVar[int] = 1
    stiffness: float

    def kinetic(self, p: Any) -> Any:
        return 0.5 * p[0] ** 2

    def potential(self, q: Any) -> Any:
        return 0.5 * q[0] ** 2 + self.stiffness * max(0.0, q[0] - 0.3) ** 2


@pytest.mark.compiled
def test_they_are_those_of_plain_python() -> None:
    system = Wall(5.0)
    start = system.state(q=[0.1], p=[0.4])
    runs = [lm.integrate(system, lm.HamiltonJacobi(order=3), start, h=0.1, steps=20, compiled=c) for c in (False, True)]
    assert runs[0].q.max() > 0.31
    assert np.array_equal(runs[0].q, runs[1].q)


# ------------------------------------------------------------------ products side by side


class Number(StandIn):
    """A float that can lie beside others; `made` counts the sums and products of rows."""

    made = 0

    def __init__(self, *x: float) -> None:
        self.x = x

    def beside(self, numbers: list[Number | float]) -> Number:
        return Number(*[x.x[0] if isinstance(x, Number) else x for x in numbers])

    def apart(self) -> list[Number]:
        return [Number(x) for x in self.x]

    def __add__(self, other: Number) -> Number:
        return self._each(float.__add__, other)

    def __mul__(self, other: Number) -> Number:
        return self._each(float.__mul__, other)

    __radd__, __rmul__ = __add__, __mul__

    def _each(self, operation: object, other: Number | float) -> Number:
        Number.made += len(self.x) > 1
        theirs = other.x if isinstance(other, Number) else (other,)
        return Number(*[operation(a, b) for a, b in zip(self.x, theirs, strict=True)])


def unknowns(x: list[float], products: Products | None) -> list[Series]:
    """Numbers that follow each other's products, some of two ranks, and of a series that ends
    in some, and in some of one that begins late.
    """
    y, n = [Series(Number(a)) for a in x], len(x)
    line, late = Series(Number(0.3), Number(0.1)), Series(None, Number(0.7))
    if products:
        for series in (*y, line, late):
            series.among(products)
    pairs = [y[i] * y[(i + 1) % n] for i in range(n)]
    squares = [a * a for a in y[:5]]
    late.grow(pairs[0], 0.5)
    for i in range(n):
        further = pairs[i] * y[i] + squares[i % len(squares)]
        y[i].grow((further + line * y[i] if i % 2 else further) + late * y[(i + 2) % n], 0.5)
    return y


@pytest.mark.parametrize("count", [2, 3, 5, 9])
def test_products_side_by_side_are_those_of_each_alone(count: int) -> None:
    x = [0.1 * k - 0.43 for k in range(count)]
    alone = unknowns(x, None)
    Number.made = 0
    expected = [[y[k].x[0] for k in range(PAIR + 3)] for y in alone]
    assert not Number.made
    found = [[y[k].x[0] for k in range(PAIR + 3)] for y in unknowns(x, Products())]
    assert Number.made and found == expected


def test_a_product_of_unlike_terms_is_computed_alone() -> None:
    """From the term on that only some of the products have."""
    products = Products()
    cubes = [Series(*map(Number, (1.5, 2.0, 0.5, 1.0)[:n])).among(products) for n in (3, 3, 4, 4)]
    wholes = [Series(*map(Number, X)).among(products) for _ in range(LEAST)]
    found = [a * b for a, b in zip(cubes, wholes, strict=True)]
    for k in range(FIRST + 2):
        for a, b, product in zip(cubes, wholes, found, strict=True):
            terms = [(a.term(j), b.term(k - j)) for j in range(k + 1)]
            exact = sum(p.x[0] * q.x[0] for p, q in terms if p is not None and q is not None)
            assert product[k].x[0] == pytest.approx(exact, rel=1e-15)


def test_factors_may_change_places() -> None:
    x, y = Series(*X), Series(*Y)
    assert (terms(x * y) == terms(y * x)).all()


def test_what_was_computed_since_is_taken_back() -> None:
    """Terms, and products in rows; they are computed anew when they are wanted again."""
    made: list[int] = []
    products = Products()
    x = Series(1.0).among(products)
    x.by(lambda k: made.append(k) or 1.0 / k)  # type: ignore[func-returns-value]
    with journal():
        assert x[2] == 0.5
        take_back = back()
        y = x * x
        assert (x[4], y[4], made) == (0.25, y[4], [1, 2, 3, 4])
        take_back()
        assert (x[4], made) == (0.25, [1, 2, 3, 4, 3, 4])
    assert x[5] == 0.2 and made[-1] == 5


@pytest.mark.slow
@pytest.mark.compiled
def test_terms_that_are_first_wanted_in_a_part_that_is_taken_back() -> None:
    """A term is computed where it is first wanted.  Where the compiler tries a loop or a formula and takes it back, or
    where that is a branch, it is computed anew elsewhere: before, the code was invalid.
    """
    a = np.random.default_rng(0).normal(size=(6, 6))
    body = lm.models.KirchhoffBody(a @ a.T + 6.0 * np.eye(6))
    start = body.state(mu=[0.5, 0.1, 0.8, 0.1, 0.2, 0.3])
    method = lm.LiePoissonHamiltonJacobi(order=8)
    runs = [lm.integrate(body, method, start, h=0.01, steps=2, compiled=c, progress=False).mu for c in (False, True)]
    assert np.array_equal(*runs)


@pytest.mark.compiled
def test_power_series_on_constraints() -> None:
    """A choice between a number and a series is one between series."""
    pendulum = lm.SphericalPendulum(length=1.0)
    start = pendulum.state(q=[0.6, 0.0, -0.8], p=[0.0, 0.5, 0.0])
    runs = [
        lm.integrate(pendulum, lm.Taylor(), start, h=0.05, steps=4, compiled=c, progress=False).q for c in (False, True)
    ]
    assert np.array_equal(*runs)
