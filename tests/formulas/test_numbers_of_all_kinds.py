"""Operations of numbers that are no floats beside those of Python and mpmath: every operation, its
operands in both orders and of all kinds.
"""

from __future__ import annotations

import operator
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from liemech import formulas as f
from liemech.errors import InvalidInput
from liemech.formulas import Complex, Mat, Vec, derivative, record, vec
from liemech.formulas.classes.layouts import build, layout_of, leaves
from liemech.formulas.classes.records import Record
from liemech.formulas.derivatives import tangent
from liemech.formulas.functions import fma
from liemech.formulas.numbers.anything import Anything, degree, indices_in, why_not_one_expression
from liemech.formulas.numbers.compensated import Compensated
from liemech.formulas.numbers.conversions import double_double, fitted, rounded, with_slopes
from liemech.formulas.numbers.dual import Dual
from liemech.formulas.numbers.series import Series
from liemech.formulas.numbers.sizes import one_norm

ARITHMETIC = operator.add, operator.sub, operator.mul, operator.truediv
COMPARISONS = operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne


@pytest.mark.parametrize("operation", ARITHMETIC, ids=lambda o: o.__name__)
def test_complex_numbers(operation: Any) -> None:
    z, w = Complex(0.3, -0.7), Complex(1.1, 0.4)
    for a, b in ((z, w), (z, 1.1 + 0.4j), (1.1 + 0.4j, z), (z, 2.5), (2.5, z), (z, 3), (3, z)):
        wanted = operation(*(complex(x) if isinstance(x, Complex) else x for x in (a, b)))
        assert abs(complex(operation(a, b)) - wanted) <= 4e-16 * abs(wanted)
    assert abs(z) == abs(complex(z)) and complex(z.conjugate()) == complex(z).conjugate()
    assert (z.real, z.imag) == (complex(z).real, complex(z).imag)
    assert derivative(lambda x: (x * z * x).imag + (x * w).real, 2.0) == pytest.approx(
        2.0 * 2.0 * -0.7 + 1.1, rel=1e-15
    )
    same, other = Complex(0.3, -0.7), Complex(0.3, 0.7)
    for a, equal in ((same, True), (other, False), (Complex(0.4, -0.7), False), (0.3, False)):
        assert (operator.eq(z, a), operator.ne(z, a)) == (equal, not equal)
    assert Complex(2.0) == 2.0 and Complex(2.0) != 2.0 + 1e-9j


@pytest.mark.parametrize("operation", COMPARISONS, ids=lambda o: o.__name__)
def test_comparisons_look_at_the_value(operation: Any) -> None:
    """Of a series its first term, of a number with a derivative what it is."""
    for a in (-1.0, 0.5):
        for b in (-1.0, 0.5):
            x, y = Series(a, 3.0, -2.0), Series(b, -4.0, 5.0)
            wanted = operation(a, b)
            if a == b and operation in (operator.eq, operator.ne):
                for one, other in ((x, y), (x, b), (a, y), (Dual(a, 1.0), b)):
                    with pytest.raises(InvalidInput, match="not beside"):
                        operation(one, other)
                continue
            assert operation(x, y) is operation(x, b) is operation(a, y) is wanted
            seen = []
            derivative(lambda s, a=a, b=b, seen=seen: seen.append(operation(a + s, b - s)) or s, 0.0)
            assert seen == [wanted]


@pytest.mark.parametrize("a", [7.3, -7.3])
def test_remainders_of_numbers_with_derivatives(a: float) -> None:
    """x % y = x - floor(x/y) y, of one level and of two."""
    for b in (2.1, -2.1):
        turns = float(np.floor(a / b))
        assert derivative(lambda x, b=b: x % b, a) == 1.0
        assert derivative(lambda y: a % y, b) == -turns
        assert derivative(lambda s, b=b: (a + s) % (b + 3.0 * s), 0.0) == 1.0 - 3.0 * turns
        for formula in (
            lambda x, y: (x * x) % y, lambda x, y: x % (y * y), lambda x, y: x % y,
            lambda x, y: x - y, lambda x, y: x / y, lambda x, y: x * y, lambda x, y: x**y,
        ):  # fmt: skip
            if formula(2.0, 3.0) == 8.0 and a < 0.0:
                continue  # a power of a negative number
            g = lambda x, y, formula=formula: formula(x, y) * x  # noqa: E731
            both = derivative(lambda x, b=b, g=g: derivative(lambda y: g(x, y), b), a)
            other = derivative(lambda y, g=g: derivative(lambda x: g(x, y), a), b)
            assert both == pytest.approx(other, rel=1e-14, abs=1e-14)


def test_a_value_and_its_slope_of_formulas_that_return_several_things() -> None:
    @record
    class Pair(Record):
        first: Any
        second: Any = 0.0
        name: str = "pair"
        count: int = 3

    value, slope = tangent(lambda x: (Pair(x * x, vec(x, 2.0)), [x], 4.0, None), 3.0, 2.0)
    assert (value[0].first, slope[0].first) == (9.0, 12.0)
    assert list(value[0].second) == [3.0, 2.0] and list(slope[0].second) == [2.0, 0.0]
    assert (value[0].name, slope[0].count, value[0].count) == ("pair", 3, 3)
    assert value[1:] == ([3.0], 4.0, None) and slope[1:] == ([2.0], 0.0, None)
    value, slope = tangent(lambda z: z * z, Complex(1.0, 2.0), 1.0 + 0.5j)
    assert complex(value) == (1 + 2j) ** 2 and complex(slope) == 2 * (1 + 2j) * (1 + 0.5j)
    value, slope = tangent(lambda z: z * z, 1.0 + 2.0j, 2.0)
    assert complex(slope) == 2 * (1 + 2j) * 2.0


def test_what_is_sure_of_numbers_without_a_value() -> None:
    """Degrees of polynomials, what a result is made of, and whether a formula may choose."""
    x, y = Anything(1, frozenset([0])), Anything(0, frozenset([1]))
    cases = (
        (x + y, 1), (x * x * y, 2), (x**3, 3), (y / 2.0 - x, 1), (x / y, 1), (3.0 / y, 0), (-(x * x), 2),
        (y / x, np.inf), (x**-1, np.inf), (f.sin(x), np.inf), (f.sin(y), 0), (2.0**x, np.inf), (x * 0.0, 0), (x**0, 0),
        (f.sin(y) * x, 1), (2.0, 0),
    )  # fmt: skip
    for found, wanted in cases:
        assert degree(found) == wanted
    assert indices_in(x * y + 1.0) == {0, 1} and indices_in(f.atan2(y, x)) == {0, 1}
    assert indices_in(2.0) == set() and indices_in(f.sin(y)) == {1}
    assert "comparison" in why_not_one_expression(lambda v: v[0] if v[0] > v[1] else v[1], 2)
    assert why_not_one_expression(lambda v: f.sin(v[0]) * v[1] ** 2, 2) == ""


def test_sizes_and_fused_products() -> None:
    assert one_norm(vec(1.0, -2.0, 4.0, 8.0)) == 15.0
    assert fma(1.0, 2.0, np.inf) == np.inf and fma(1.0, 2.0, -np.inf) == -np.inf
    assert np.isnan(fma(np.inf, 1.0, -np.inf))
    rng = np.random.default_rng(1)
    for x, y, z in rng.normal(size=(50, 3)).tolist():
        z = -x * y * (1.0 + 1e-12 * z)
        with mp.workdps(60):
            assert fma(x, y, z) == float(mp.mpf(x) * mp.mpf(y) + mp.mpf(z))
    assert fma(0.0, -1.0, -0.0) == 0.0 and fma(1e-200, 1e-200, 1e-310) == 1e-310


def test_vectors_and_matrices_of_any_shape_as_fields_and_arguments() -> None:
    @record
    class Form(Record):
        matrix: Mat
        vector: Vec

        def value(self, m: Mat, v: Vec) -> float:
            """v . m v."""
            return f.dot(v, m @ v)

    rng = np.random.default_rng(2)
    m, v = rng.normal(size=(4, 2, 2)), rng.normal(size=(4, 2))
    form = Form(m[0], v[0].tolist())
    assert isinstance(form.matrix, Mat) and form.matrix.shape == (2, 2)
    assert isinstance(form.vector, Vec) and len(form.vector) == 2
    assert np.allclose(form.value(m, v), np.einsum("bi,bij,bj->b", v, m, v), rtol=1e-14)
    assert np.allclose(form.value(m[0], v), np.einsum("bi,ij,bj->b", v, m[0], v), rtol=1e-14)
    assert form.value(m[0], v[0]) == pytest.approx(v[0] @ m[0] @ v[0], rel=1e-14)
    for wrong in (v[0], m):
        with pytest.raises(InvalidInput, match="matrix is a matrix; got an array of shape"):
            Form(wrong, v[0])
    with pytest.raises(InvalidInput, match=r"m has shape \(2,\); its last axes must be \('n', 'n'\)"):
        form.value(v[0], v[0])


def test_values_in_other_numbers() -> None:
    """With a rest, with a derivative, in two doubles, wherever numbers stand; and back."""
    value = (vec(1.0, 2.0), [3.0, 4], Complex(5.0, 6.0), Mat.of([[7.0]]))
    sloped, wide = with_slopes(value, 1), double_double(value)
    remembering = (Compensated(1.5, 1e-17), vec(2.0, 3.0))
    for model, plain, more in (
        (sloped, value, 0.0), (wide, value, 0.0), (remembering, (1.5, vec(2.0, 3.0)), 0.0),
        (with_slopes(with_slopes(2.0, 1), 1), 2.0, 0.0), (Dual(Dual(1.0, 2.0, 1), Dual(3.0, 4.0, 1), 2), 1.0, 0.0),
    ):  # fmt: skip
        layout = layout_of(model)
        made = fitted(plain, layout)
        assert layout_of(made) == layout
        flat = leaves(made, layout)
        assert sum(map(float, flat)) == sum(map(float, leaves(plain, layout_of(plain)))) + more
        assert layout_of(build(layout, iter(flat))) == layout
    assert isinstance(sloped[0][1], Dual) and sloped[0][1].parts == (2.0, 0.0)
    assert rounded(wide) == rounded(value) == value
