"""A formula means what Python says: closures, iterators, integers, divisions, functions of Python, in every world.

Each function below is run by CPython on floats, by native code for one body, and in the lanes of an ensemble.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import fuzz
import numpy as np
import pytest
import worlds
from compiler.worlds import NotCompilable, native, plain

from liemech.formulas import vec

pytestmark = pytest.mark.compiled

ROWS = [
    [1.0, 2.0, 3.0, 4.0],
    [-1.5, 0.25, 3.0, -4.0],
    [0.0, -0.0, 1.0, 2.0],
    [3.0, 1.0, -2.0, 0.5],
    *fuzz.arguments(11, 20, worlds.SPECIAL),
]
K = 3.0
MANY = [0.5, 1.5, 2.5]
TABLE = np.array([[1.0, 2.0], [3.0, 4.0]])
WHOLE = np.int64(7)
HUGE = 2**70

FORMULAS: list[Callable[..., Any]] = []


def meaning(f: Callable[..., Any]) -> Callable[..., Any]:
    FORMULAS.append(f)
    return f


# --- functions see variables, not their values at birth
# --------------------------------------------------------------


@meaning
def a_variable_changed_after_the_lambda(a, b, c, d, n):
    k = 1.0
    f = lambda x: k * x  # noqa: E731
    k = 2.0
    return vec(f(a), f(b))


@meaning
def a_variable_changed_on_one_way(a, b, c, d, n):
    k = 1.0
    f = lambda x: k * x  # noqa: E731
    if a > b:
        k = c
    return vec(f(a), k)


@meaning
def a_variable_changed_in_a_loop(a, b, c, d, n):
    k = 1.0
    f = lambda x: k * x  # noqa: E731
    total = 0.0
    for i in range(n):
        k = k + i * a
        total = total + f(b)
    return vec(total, f(1.0))


@meaning
def defaults_are_values_at_birth(a, b, c, d, n):
    k = a
    f = lambda x, k=k, *, j=k: k * x + j  # noqa: E731
    k = b
    return vec(f(c), f(c, k), f(c, j=k))


@meaning
def lambdas_of_a_comprehension(a, b, c, d, n):
    late = [lambda x: i * x for i in (1.0, 2.0, 3.0)]  # noqa: B023
    early = [lambda x, i=i: i * x for i in (1.0, 2.0, 3.0)]
    return vec(*[f(a) for f in late], *[f(a) for f in early])


@meaning
def lambdas_of_a_loop(a, b, c, d, n):
    found = []
    for i in range(3):
        found.append(lambda x: x + i)  # noqa: B023
    return vec(*[f(a) for f in found])


@meaning
def two_lambdas_on_a_line(a, b, c, d, n):
    f, g = lambda x: x + 1.0, lambda x: x * 2.0
    return vec(f(a), g(a))


@meaning
def functions_in_functions(a, b, c, d, n):
    def outer(x, *rest, scale=2.0):
        def inner(y):
            return y * x + len(rest)

        x = x * scale
        return inner

    f = outer(a, b, c)
    g = outer(b, scale=d)
    return vec(f(c), g(c))


@meaning
def recursion(a, b, c, d, n):
    def power(x, k):
        return x * power(x, k - 1) if k else 1.0

    return vec(power(a, 5), power(b, 3))


@meaning
def a_captured_list(a, b, c, d, n):
    items = [a, b]
    f = lambda: items[0]  # noqa: E731
    items = [c, d]
    return vec(f(), items[1])


@meaning
def variables_of_a_function_that_has_returned(a, b, c, d, n):
    def counter(x):
        y = x
        if x > b:
            y = x * 2.0
        return lambda z: y + z

    return vec(counter(a)(c), counter(d)(c))


# --- iterators
# -------------------------------------------------------------------------------------------------------


@meaning
def iterators_are_used_up(a, b, c, d, n):
    i = iter((a, b, c, d))
    x = next(i)
    total = 0.0
    for y in i:
        total = total + y * x
    return vec(x, total, next(i, 5.0))


@meaning
def pairs_of_one_iterator(a, b, c, d, n):
    i = iter([a, b, c, d])
    return vec(*[x * y for x, y in zip(i, i)])


@meaning
def iterators_of_all_kinds(a, b, c, d, n):
    numbers = [k * x for k, x in enumerate(reversed((a, b, c)), 1)]
    chosen = list(filter(lambda x: x[0] != 1, enumerate((a, b, c))))
    doubled = map(lambda x, y: 2.0 * x + y, (a, b), (c, d))
    first, *others = numbers
    return vec(first, *others, *[x for _, x in chosen], *doubled)


@meaning
def a_list_of_its_own_within_iterators_of_iterators(a, b, c, d, n):
    total = 0.0
    for k, (x, y) in enumerate(zip([a, b], (c, d))):
        pair = [x, y]
        pair[0] = 3.0 * pair[k]
        total = total + pair[0] * pair[1]
    return vec(total)


@meaning
def a_generator_computes_late(a, b, c, d, n):
    k = 1.0
    items = (k * x for x in (a, b))
    k = 3.0
    return vec(*items)


@meaning
def an_iterator_in_the_rest_after_a_return(a, b, c, d, n):
    i = iter((a, b, c))
    x = next(i)
    if a > b:
        return vec(x, d)
    return vec(x, next(i))


@meaning
def loops_with_else(a, b, c, d, n):
    for x in (a, b, c):
        if x > 2.0:
            y = x
            break
    else:
        y = -1.0
    k = 0
    while k < n:
        k = k + 1
        if k * a > b:
            break
    else:
        y = y * 2.0
    return vec(y, k)


@meaning
def the_first_that_decides(a, b, c, d, n):
    some = any(1.0 / x > 0.5 for x in (a, b, c) if x != 0.0)
    every = all(x < y for x in (a, b) for y in (c, d))
    return vec(1.0 if some else 0.0, 1.0 if every else 0.0, 1.0 if any([a > 0.0, b > 0.0]) else 0.0)


# --- numbers
# ---------------------------------------------------------------------------------------------------------


@meaning
def large_integers(a, b, c, d, n):
    return vec(HUGE * a, 39 * 10**18 * b, (2**63 + 1) * c, a / 2**64)


@meaning
def integers_beside_floats(a, b, c, d, n):
    x = a * 0.0 + 2.0**53
    k = 2**53
    return vec(*[1.0 if t else 0.0 for t in (x == k + 1, x < k + 1, x <= k + 1, x > k - 1, x >= k + 1, n < HUGE)])


@meaning
def factorial(a, b, c, d, n):
    f = 1
    for i in range(1, n + 12):
        f = f * i
    return vec(1.0 * f, f % 7, f // 11, -f // 13, -f % 13)


@meaning
def remainders(a, b, c, d, n):
    if b == 0.0 or d == 0.0:
        return vec(a, b, c, d)
    q, r = divmod(a, d)
    return vec(a % b, a // b, q, r)


@meaning
def powers(a, b, c, d, n):
    x = abs(a) + 0.5
    if not x < 1e50:
        return vec(a, b, c, d, n)
    return vec(x**2, x**-1.0, x**0.5, 2**x if x < 50.0 else x, n**3)


@meaning
def division_by_zero_raises(a, b, c, d, n):
    return vec(1.0 / (1.0 / a), 1.0)


@meaning
def roundings_to_integers(a, b, c, d, n):
    if not abs(a) < 1e18:
        return vec(a, b, c, d)
    return vec(int(a), math.floor(a), math.ceil(a), round(a))


@meaning
def what_people_write(a, b, c, d, n):
    total = a + b + c + d
    low, *_, high = sorted([a, b, c, d]) if a == a and b == b and c == c and d == d else [a, b, c, d]
    if (y := total + 1.0) > 2.0:
        total = y
    return vec(total, low, high, WHOLE * a, vec(a, b) @ vec(TABLE[0, 1], TABLE[1, 0]))


@meaning
def sums(a, b, c, d, n):
    """Beside no entry of an array: from Python 3.12 on `sum` asks which numbers are NumPy's."""
    return vec(sum([a, b, c, d]), sum(x * x for x in (a, b)), sum((a, b), 0.5))


@meaning
def functions_of_math(a, b, c, d, n):
    if not (abs(a) < 100.0 and abs(b) < 100.0):
        return vec(a, b, c, d, 1.0, 2.0)
    x = abs(a) + 0.1
    return vec(
        math.hypot(a, b), math.copysign(a, b), math.log10(x), math.radians(a), math.pow(x, 1.5), math.log(x, 3.0)
    )


@meaning
def functions_of_numpy(a, b, c, d, n):
    if not (abs(a) < 100.0 and abs(b) < 100.0):
        return vec(a, b, c, d)
    return vec(np.exp(a), np.sin(b), np.tanh(a), np.sqrt(abs(b)))


@meaning
def math_raises_outside_its_domain(a, b, c, d, n):
    return vec(math.sqrt(a), math.exp(b))


@meaning
def a_variable_of_some_turns_only(a, b, c, d, n):
    for k in range(3):
        if a > b + k:
            v = c
        for i in range(n):
            if i * a > d:
                v = a * i
                break
        else:
            v = b
    return vec(v, d)


@meaning
def identity_of_truth_values(a, b, c, d, n):
    x, y = a < b, c < d
    return vec(
        1.0 if x is True else 0.0, 1.0 if x is not True else 0.0, 1.0 if y is False else 0.0, 1.0 if x is None else 0.0
    )


@pytest.mark.sample(8)
@pytest.mark.parametrize("formula", FORMULAS, ids=lambda f: f.__name__)
def test_the_same_in_all_worlds(formula: Callable[..., Any]) -> None:
    worlds.same_in_all_worlds(formula, ROWS)


def test_constants_are_read_where_they_lie() -> None:
    for turns in (0, 1, 5):
        worlds.same_in_all_worlds(a_variable_changed_in_a_loop, ROWS[:4], turns)
        worlds.same_in_all_worlds(loops_with_else, ROWS[:4], turns)


def test_a_constant_becomes_a_number_with_a_derivative(tmp_path) -> None:
    text = """
from liemech.formulas import derivative, vec


def root(x):
    d, y, turns = 1.0, x[0] * 0.5 + 0.5, 0
    while abs(d) > 1e-14 and turns < 200:
        d = (y * y - x[0]) / (2.0 * y)
        y = y - d
        turns = turns + 1
    return y + 0.0 * d


def formula(a, b, c, d, n):
    return vec(root(vec(a)), derivative(root, vec(a), vec(1.0)))
"""
    formula = worlds.module_from(text, tmp_path, "promoted").formula
    rows = [[x, 0.0, 0.0, 0.0] for x in (2.0, 0.3, 17.0, 1.0)]
    worlds.same_in_all_worlds(formula, rows)
    assert formula(2.0, 0.0, 0.0, 0.0, 0)[1] == pytest.approx(0.5 / math.sqrt(2.0), rel=1e-14)


def test_assertions_and_variables_without_a_value_fail_as_in_python(tmp_path) -> None:
    text = """
from liemech.formulas import vec


def formula(a, b, c, d, n):
    if a > b:
        y = a * c
    assert c > 0.0, f"{c} is too small"
    return vec(y, d)
"""
    formula = worlds.module_from(text, tmp_path, "unbound").formula
    with pytest.raises(UnboundLocalError):
        formula(1.0, 2.0, 3.0, 4.0, 1)
    rows = [[3.0, 2.0, 1.0, 4.0], [5.0, 1.0, -1.0, 2.0], [1.0, 2.0, 3.0, 4.0], [2.0, 1.0, 0.5, 1.0]]
    for lanes in (1, 8):
        fine = [ok for _, ok in worlds.outcomes(formula, rows, 2, 1, lanes)]
        assert fine == [True, False, False, True]


def test_zero_as_integer_and_as_float_are_not_confused(tmp_path) -> None:
    text = """
from liemech.formulas import vec


def formula(a, b, c, d, n):
    total = 0
    for i in range(n):
        total = total + a
    return vec(-total, b)
"""
    formula = worlds.module_from(text, tmp_path, "zeros").formula
    assert math.copysign(1.0, formula(1.0, 1.0, 1.0, 1.0, 0)[0]) == 1.0
    with pytest.raises(worlds.NotCompilable, match=r"line 9\) cannot be compiled: the negative of a number that is"):
        worlds.native(formula, ROWS[:1], 2, 3, 1)
    good = worlds.module_from(text.replace("total = 0\n", "total = 0.0\n"), tmp_path, "floats").formula
    worlds.same_in_all_worlds(good, ROWS, 0)
    worlds.same_in_all_worlds(good, ROWS, 3)


PAIRS = [[1.5, 2.0], [-1.0, 0.3], [0.25, -2.0]]
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
@pytest.mark.parametrize("formula", [a_row_by_a_run_time_index, two_rows, halved_until_small, changed_after_a_call])
def test_as_in_python(formula: Callable[..., Any], lanes: int) -> None:
    width = 1 if formula is a_row_by_a_run_time_index else len(formula(1.0, 1.0, 1))
    assert native(formula, PAIRS, width, 3, lanes) == [plain(formula, row, 3) for row in PAIRS]


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
def test_refused_with_what_to_write(formula: Callable[..., Any], lanes: int, told: str) -> None:
    with pytest.raises(NotCompilable, match=told):
        native(formula, PAIRS, 1, 3, lanes)


def how_many_are_exceeded(x: Any, y: Any, n: Any) -> Any:
    """As the refusal advises, and in a sum that begins with an integer."""
    return int(x > LEVELS[0]) + int(x > LEVELS[1]) + 10.0 * sum(y > level for level in LEVELS)


def test_truth_values_count_as_integers() -> None:
    found = native(how_many_are_exceeded, PAIRS, 1, 3, 4)
    assert found == [plain(how_many_are_exceeded, row, 3) for row in PAIRS]
