"""Numbers of the run beside NumPy's, in containers, and in loops by steps: as in Python, or refused."""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from compiler.worlds import NotCompilable, native, same_in_all_worlds

import liemech as lm
from liemech.formulas import vec

pytestmark = pytest.mark.compiled

ROWS = [[0.5, 2.0], [-1.5, 0.25], [0.0, -0.0], [3.0, 3.0]]
WHOLE, HALVES = np.array([1, 2, 3]), np.array([0.5, 1.0])
KNOTS, LEVELS = np.array([0.0, 0.5, 2.0]), np.array([1.0, 3.0, -2.0])
SHORT, UNSIGNED, SINGLE, TRUE = np.int8(100), np.uint64(5), np.float32(0.5), np.bool_(True)
ALLOWED, NAMED, HALF = frozenset({1, 3}), {1: "one", 3: "three"}, Fraction(1, 2)
MATRIX = np.array([[2.0, 1.0], [0.0, 3.0]])


def found_in_containers(x: Any, y: Any, n: Any) -> Any:
    held = n in ALLOWED, n in NAMED, n in WHOLE, n not in (2, 4), x in HALVES, x in [y, 3.0]
    return [1.0 if h else 0.0 for h in (*held, x in (math.nan, 0.5), n in range(3))]


def divided_by_entries_of_a_table(x: Any, y: Any, n: Any) -> Any:
    """Linear interpolation."""
    for (a, b), (u, v) in zip(zip(KNOTS, KNOTS[1:]), zip(LEVELS, LEVELS[1:])):  # noqa: RUF007
        if a <= x < b:
            return u + (v - u) * (x - a) / (b - a)
    return y / HALVES[0]


def properties_of_arrays(x: Any, y: Any, n: Any) -> Any:
    return [MATRIX.shape[0] * x, MATRIX[:, 1].sum() * y, MATRIX.T[0, 1] + x, MATRIX.max() * y]


def truth_of_numpy(x: Any, y: Any, n: Any) -> Any:
    return [1.0 if TRUE & (x > 0.0) else 0.0, 1.0 if (y > 0.0) | TRUE else 0.0]


def least_and_greatest_by_a_key(x: Any, y: Any, n: Any) -> Any:
    values = [x, y, -1.0]
    at = max(range(3), key=lambda i: values[i])
    return [min(values, key=lambda v: (v - 0.4) ** 2), max(x, y, key=abs), at, values[at]]


def sorted_by_a_key(x: Any, y: Any, n: Any) -> Any:
    pairs = sorted([(x, 1.0), (y, 2.0), (0.5, 3.0)], key=lambda pair: pair[0], reverse=True)
    return [z for pair in pairs for z in pair] + sorted([x, y, -x, 0.0], key=abs)


def loops_by_steps(x: Any, y: Any, n: Any) -> Any:
    total = 0.0
    for i in range(n, 0, -1):
        total = total * 2.0 + i
    for i in range(0, 100, 3):
        total = total * 0.5 + i * x
    for i in range(100, -100, -7):
        total = total * 0.5 + i * y
    for i in range(n, 9 * n, 2):
        if i * x > 5.0:
            break
        total += i
    for _ in range(n, n, -4):
        total = math.inf
    return total


def entries_by_numbers_of_the_run(x: Any, y: Any, n: Any) -> Any:
    k = n - 2
    picked = [KNOTS[k] * x, MATRIX[k, k - 1] * y, WHOLE[-n] * x, MATRIX[k] @ vec(x, y)]
    return [*picked, *(MATRIX[k] * y), MATRIX[k][0] + x]


def derivatives_of_choices(x: Any, y: Any, n: Any) -> Any:
    """Numbers that carry a derivative are sorted by their values, and are true unless 0."""

    def choice(v: Any) -> Any:
        low, high = sorted([v[0] * v[1], v[0] ** 2])
        return low + 3.0 * high + (v[0] or v[1]) * (v[1] if v[0] and v[1] else 2.0)

    return [*lm.gradient(choice, vec(x, y))]


@pytest.mark.parametrize(
    "formula",
    [
        entries_by_numbers_of_the_run, derivatives_of_choices, found_in_containers,
        divided_by_entries_of_a_table, properties_of_arrays, truth_of_numpy,
        least_and_greatest_by_a_key, sorted_by_a_key, loops_by_steps,
    ],
)  # fmt: skip
def test_what_python_says(formula: Callable[..., Any]) -> None:
    same_in_all_worlds(formula, ROWS)


@pytest.mark.parametrize(
    ("formula", "words"),
    [
        (lambda x, y, n: float(SHORT * n), r"int\(np.int8\(100\)\)"),  # wraps
        (lambda x, y, n: float(n - UNSIGNED), r"int\(np.uint64\(5\)\)"),  # wraps
        (lambda x, y, n: float(TRUE + (x > 0.0)), "or a float"),  # a disjunction
        (lambda x, y, n: 1.0 if x == HALF else 0.0, "compare floats"),
        (lambda x, y, n: 1.0 if x == SINGLE else 0.0, "compare floats"),
        (lambda x, y, n: 1.0 if (x == HALVES).any() else 0.0, "one by one"),
        (lambda x, y, n: 1.0 if (x, y) < (y, x) else 0.0, "number by number"),
        (lambda x, y, n: SINGLE * x, r"`SINGLE \* x`: .*write float\(x\)"),
        (lambda x, y, n: float(np.clip(n, 0, 1)), r"write float\(x\)"),
        (lambda x, y, n: math.isclose(x, y), r"abs\(a - b\)"),
        (lambda x, y, n: np.linalg.norm([x, y]), "liemech.norm"),
        (lambda x, y, n: round(x, 2), r"round\(x \* 100.0\)"),
        (lambda x, y, n: abs(complex(x, y)), "formulas.Complex"),
    ],
)  # fmt: skip
def test_what_numpy_says_otherwise_is_refused_with_the_way_out(formula: Callable[..., Any], words: str) -> None:
    with pytest.raises(NotCompilable, match=words):
        native(formula, ROWS, 1, 3, 1)
