"""Ordinary formulas that native code read differently from Python, or refused without a reason."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from compiler.worlds import NotCompilable, native, plain

pytestmark = pytest.mark.compiled

ROWS = [[1.5, 2.0], [-1.0, 0.3], [0.25, -2.0]]
MATRIX, LEVELS = np.arange(9.0).reshape(3, 3), np.array([0.0, 0.5, 1.0])
GAINS = [1.0, 2.0, 3.0]


def a_row_by_a_run_time_index(x: Any, y: Any, n: Any) -> Any:
    """Entries and rows."""
    i = 0
    if x > 0.0:
        i = 2
    row = MATRIX[i, :]
    return MATRIX[i, 1] * x + row[0] + row[2] * y + MATRIX.T[i][1]


def two_rows(x: Any, y: Any, n: Any) -> Any:
    """A scheme in time: the new row becomes the old one."""
    before = [x, y, 0.0]
    for k in range(n):
        now = [0.0, 0.0, 0.0]
        for j in range(3):
            now[j] = 0.5 * before[j] + 0.25 * before[j - 1] + k
        before = now
    before[1] += 1.0
    return before


def halved_until_small(x: Any, y: Any, n: Any) -> Any:
    a = [x, y]
    while abs(a[0]) > 0.3:
        b = [*a]
        b[0] *= 0.5
        b[1] += 1.0
        a = b
    a[1] = a[1] * 2.0
    return a


def clamped(items: Any) -> Any:
    if items[0] < 0.0:
        return [0.0, items[1]]
    return items


def changed_after_a_call(x: Any, y: Any, n: Any) -> Any:
    """What the call returns has the variable `a` only."""
    a = clamped([x, y])
    a[1] = 3.0
    return a


@pytest.mark.parametrize("lanes", [1, 4])
@pytest.mark.parametrize(
    "formula", [a_row_by_a_run_time_index, two_rows, halved_until_small, changed_after_a_call]
)
def test_as_in_python(formula: Callable[..., Any], lanes: int) -> None:
    width = 1 if formula is a_row_by_a_run_time_index else len(formula(1.0, 1.0, 1))
    assert native(formula, ROWS, width, 3, lanes) == [plain(formula, row, 3) for row in ROWS]


def a_column_by_a_run_time_index(x: Any, y: Any, n: Any) -> Any:
    i = 0
    if x > 0.0:
        i = 2
    return MATRIX[:, i][0] * x


def interval(x: Any, y: Any, n: Any) -> Any:
    """NumPy's truth values add as `or`."""
    return 1.0 * ((x > LEVELS[0]) + (x > LEVELS[1]) + (x > LEVELS[2]))


def a_list_that_the_caller_has_too(x: Any, y: Any, n: Any) -> Any:
    mine = [x, y]
    theirs = clamped(mine)
    theirs[1] = 3.0
    return mine[1]


def long_formula(x: Any, y: Any) -> Any:
    """Long enough for copies, which are made from its second call on."""
    s = x
    for k in range(70):
        s = s * y + k * x
    return (GAINS, s)


def a_list_from_outside_that_a_copy_returns(x: Any, y: Any, n: Any) -> Any:
    (a, s), (b, t), (c, u) = long_formula(x, y), long_formula(y, x), long_formula(x, x)
    c[0] = x
    return a[0] + s + b[1] + t + u


@pytest.mark.parametrize(
    ("formula", "lanes", "told"),
    [
        (a_column_by_a_run_time_index, 1, r"a\.T\[i\] for a\[:, i\]"),
        (interval, 1, r"a sum of truth values, in a formula with NumPy's .* write int\(x > a\)"),
        (a_list_that_the_caller_has_too, 1, r"change a copy"),
        (a_list_that_the_caller_has_too, 4, r"change a copy"),
        (a_list_from_outside_that_a_copy_returns, 1, r"change a copy"),
    ],
)
def test_refused_with_what_to_write(
    formula: Callable[..., Any], lanes: int, told: str
) -> None:
    with pytest.raises(NotCompilable, match=told):
        native(formula, ROWS, 1, 3, lanes)


def how_many_are_exceeded(x: Any, y: Any, n: Any) -> Any:
    """As the refusal advises, and in a sum that begins with an integer."""
    return int(x > LEVELS[0]) + int(x > LEVELS[1]) + 10.0 * sum(y > level for level in LEVELS)


def test_truth_values_count_as_integers() -> None:
    found = native(how_many_are_exceeded, ROWS, 1, 3, 4)
    assert found == [plain(how_many_are_exceeded, row, 3) for row in ROWS]
