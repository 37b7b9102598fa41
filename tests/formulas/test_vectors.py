"""Small vectors and matrices: what stands beside them, what is refused, and the same bits in every world."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from compiler.worlds import same_in_all_worlds

import liemech as lm
from liemech.errors import InvalidType
from liemech.formulas import Mat, Vec, cross, dot, mat, outer, solve, solve3, vec

V = vec(1.0, -2.0, 3.0)
M = mat(vec(1.0, 2.0, 3.0), vec(0.5, 0.25, 1.5), vec(1.0, 1.0, 7.0))
TALL = mat(vec(1.0, 2.0), vec(3.0, 4.0), vec(5.0, 6.0))
ROWS = [(0.3, 0.7), (-1.1, 0.4), (2.3, -1.9), (0.0, 1.3)]


def test_powers_and_sizes_act_component_by_component() -> None:
    w = V**V
    assert vec(1.0, 4.0, 9.0) == V**2
    assert vec(2.0, 0.25, 8.0) == 2.0**V
    assert w == vec(1.0, 0.25, 27.0)
    assert abs(V) == vec(1.0, 2.0, 3.0)
    assert abs(-M) == M
    assert +V == V


def test_sums_go_from_left_to_right() -> None:
    terms = [1e16, 1.0, -1e16, 1.0]
    assert lm.sum(terms) == Vec(*terms).sum() == ((1e16 + 1.0) - 1e16) + 1.0 == 1.0
    assert lm.sum([V, V, 2.0 * V]) == 4.0 * V
    assert lm.sum(M) == vec(2.5, 3.25, 11.5)
    assert lm.sum(x * x for x in V) == 14.0
    assert lm.sum([]) == 0.0


@pytest.mark.parametrize("other", [[1, 2, 3], (1.0, 2.0, 3.0), np.array([1.0, 2.0, 3.0]), np.array([1, 2, 3])])
def test_lists_tuples_and_arrays_stand_beside_vectors(other: Any) -> None:
    w = vec(1.0, 2.0, 3.0)
    for found, expected in (
        (V + other, V + w), (other + V, w + V), (V - other, V - w), (other - V, w - V), (V * other, V * w), (other * V, w * V),
        (V / other, V / w), (other / V, w / V), (M @ other, M @ w), (V @ other, V @ w), (other @ V, w @ V), (other @ M, w @ M),
        (V**other, V**w), (M * other, M * w), (other * M, M * w),
    ):  # fmt: skip
        assert type(found) is type(expected)
        assert found == expected
        assert all(type(x) is float for x in (found if isinstance(found, Vec) else []))


def test_arrays_stand_beside_matrices() -> None:
    a = np.array(M)
    np.testing.assert_array_equal(a @ V, np.array(M @ V))
    for found, expected in (
        (a @ M, M @ M),
        (M @ a, M @ M),
        (a + M, M + M),
        (M - a, M - M),
        (a - M, M - M),
        (V @ a, V @ M),
    ):
        assert type(found) is type(expected)
        assert found == expected
    assert V @ a @ V == V @ M @ V
    assert V * M == M * V == mat(*[V * row for row in M])  # as with arrays, the columns


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda: V + vec(1.0, 2.0), "3 components .* 2 components"),
        (lambda: vec(1.0, 2.0) * V, "2 components .* 3 components"),
        (lambda: V - [1.0, 2.0], "3 components .* 2 components"),
        (lambda: V ** vec(1.0, 2.0), "3 components .* 2 components"),
        (lambda: V + None, "3 components cannot be combined with NoneType"),
        (lambda: "a" - V, "3 components cannot be combined with str"),
        (lambda: V + M, "3 components cannot be combined with Mat"),
        (lambda: dot(V, vec(1.0, 2.0, 3.0, 4.0)), "3 and 4 components"),
        (lambda: dot(vec(1.0, 2.0, 3.0, 4.0), V), "4 and 3 components"),
        (lambda: cross(vec(1.0, 2.0), V), "2 and 3 components"),
        (lambda: cross(V, vec(1.0, 2.0, 3.0, 4.0)), "3 and 4 components"),
        (lambda: M @ vec(1.0, 2.0), r"\(3, 3\) cannot multiply one with 2 rows"),
        (lambda: M @ 2.0, r"\(3, 3\) cannot multiply float"),
        (lambda: V @ mat(vec(1.0, 2.0), vec(3.0, 4.0)), r"3 components cannot multiply a matrix of shape \(2, 2\)"),
        (lambda: TALL @ M, r"\(3, 2\) cannot multiply one with 3 rows"),
        (lambda: M + TALL, r"\(3, 3\) and \(3, 2\)"),
        (lambda: mat(vec(1.0, 2.0), vec(3.0)), "rows of 2, 1"),
        (lambda: solve(M, vec(1.0, 2.0)), "3 rows and 3 columns, and a right side of 2"),
        (lambda: solve(TALL, V), "3 rows and 2 columns"),
        (lambda: solve3(TALL, V), "3 rows and 2 columns"),
    ],
)
def test_lengths_that_differ_are_refused(wrong: Callable[[], Any], named: str) -> None:
    with pytest.raises(InvalidType, match=named):
        wrong()


def test_products_of_vectors() -> None:
    assert outer(V, vec(1.0, 2.0)) == Mat((1.0, 2.0), (-2.0, -4.0), (3.0, 6.0))
    assert outer([1.0, 2.0], [3.0]) == Mat((3.0,), (6.0,))


WEIGHTS = (0.5, 0.25, 3.0)


def all_of_it(a, b, turns):
    v = vec(a, b, 1.5)
    sums = v.sum(), lm.sum([v, 2.0 * v, v]), lm.sum(v)
    return (v**2, v**2.0, abs(v), (v * v + [1, 2, 3]) ** v, WEIGHTS * v - (1.0, a, b), v @ M @ v, sums)


@pytest.mark.compiled
def test_the_same_bits_in_native_code() -> None:
    same_in_all_worlds(all_of_it, ROWS)


def test_slices_of_vectors_are_vectors() -> None:
    v = vec(1.0, 2.0, 3.0, 4.0)
    assert type(v[:2]) is Vec and v[:2] + v[2:] == vec(4.0, 6.0) and 2 * v[1:3] == vec(4.0, 6.0)
    assert v[::-1] == vec(4.0, 3.0, 2.0, 1.0) and v[-1] == 4.0


def test_rows_columns_and_blocks_of_matrices_are_those_of_arrays() -> None:
    array = np.asarray(TALL)
    for index in (1, -1, (2, 0), (2, slice(None)), (slice(None), 1), (slice(1, None), 0)):
        assert [*np.ravel(TALL[index])] == [*np.ravel(array[index])]
        assert type(TALL[index]) is (Vec if np.ndim(array[index]) else float)
    for index in (slice(1, None), (slice(None, 2), slice(1, 2)), (slice(None, None, -1), slice(2))):
        assert type(TALL[index]) is Mat and np.array_equal(np.asarray(TALL[index]), array[index])


def test_what_arrays_have_too() -> None:
    assert V.T @ M @ V == V.dot(M.dot(V)) == dot(V, M @ V)
    assert V.shape == (3,) and TALL.shape == (3, 2)
    assert sum([V, V, V]) == 3.0 * V and sum([M, M]) == 2.0 * M
    assert (mat(vec(1.0, 2.0)) == np.array([[1.0, 3.0]])).tolist() == [[True, False]]
    assert 1 + V == V + 1.0 == vec(*[x + 1.0 for x in V]) and 1.0 - V == -(V - 1.0)
    assert (M**2).rows == (M * M).rows and (1.0 / M + 2.0).rows == (2.0 + (1.0 / M)).rows


@pytest.mark.compiled
def test_columns_blocks_and_sums_in_all_worlds() -> None:
    def formula(a: float, b: float, n: int) -> Any:
        m = mat(vec(a, b, 1.0), vec(b, 2.0 * a, -1.0), vec(0.5, a * b, b))
        v = m[:, 1]
        return v, m[1:, :2][0], m[0:2][1], sum([v, m[:, 2]]), v.T @ m @ v, m.dot(v), v[1:] + v[:2]

    same_in_all_worlds(formula, ROWS)


@pytest.mark.parametrize("wrong", ["1.0", None, b"1", {}, {1.0}, float])
def test_what_is_no_number_is_refused_in_a_vector(wrong: Any) -> None:
    with pytest.raises(InvalidType, match=r"a Vec holds numbers; got .* among them"):
        lm.vec(1.0, wrong)


@pytest.mark.parametrize("annotation", [3, "lm.Vec(1.0, 2.0)", lm.vec(1.0), [float]])
def test_an_annotation_that_is_a_value_is_refused(annotation: Any) -> None:
    space = {"__annotations__": {"x": annotation}, "__module__": __name__}
    made = lm.record(type("Wrong", (lm.Record,), space))
    with pytest.raises(InvalidType, match=r"Wrong\.x is annotated by the value .* by a type, float"):
        made(1.0)


def test_a_length_in_an_annotation_is_refused() -> None:
    space = {"__annotations__": {"x": "lm.Vec[3]"}, "__module__": __name__}
    made = lm.record(type("Long", (lm.Record,), space))
    with pytest.raises(InvalidType, match=r"Long\.x is annotated 'lm\.Vec\[3\]': write lm\.Vec alone"):
        made([1.0, 2.0, 3.0])
