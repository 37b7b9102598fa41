"""Lists that have two names: Python changes them under both, so native code does too or refuses."""

from collections.abc import Callable
from typing import Any

import pytest
from compiler.worlds import NotCompilable, native, plain

pytestmark = pytest.mark.compiled

OUTSIDE = [1.0, 2.0]
TABLE = {"gains": [1.0, 2.0]}


def history(x: Any, seen: Any = []) -> Any:  # noqa: B006
    seen.append(x)
    return sum(seen)


def module_default(x: Any, y: Any, n: Any) -> Any:
    return history(x)


def global_list(x: Any, y: Any, n: Any) -> Any:
    gains = OUTSIDE
    gains[0] = x
    return sum(OUTSIDE)


def global_dict(x: Any, y: Any, n: Any) -> Any:
    gains = TABLE["gains"]
    gains += [x]
    return sum(TABLE["gains"])


def inner_default(x: Any, y: Any, n: Any) -> Any:
    def seen(value: Any, so_far: Any = []) -> Any:  # noqa: B006
        so_far.append(value)
        return sum(so_far)

    return seen(x) + 2.0 * seen(y)


def default_of_a_lambda(x: Any, y: Any, n: Any) -> Any:
    items = [x]
    first = lambda kept=items: kept[0]  # noqa: E731
    items[0] = y
    return first()


def chosen_by_a_branch(x: Any, y: Any, n: Any) -> Any:
    a, b = [x], [y]
    if x > 0.0:
        chosen = a
    else:
        chosen = b
    chosen[0] = 7.0
    return a[0] + 2.0 * b[0]


def taken_over_by_a_branch(x: Any, y: Any, n: Any) -> Any:
    a, chosen = [x], [0.0]
    if x > 0.0:
        chosen = a
    chosen[0] = y
    return a[0]


def first_list_changed_later(x: Any, y: Any, n: Any) -> Any:
    a = [x]
    chosen = a if x > 0.0 else [0.0]
    a[0] = y
    return chosen[0]


def chosen_by_a_function(x: Any, y: Any, n: Any) -> Any:
    a, b = [x], [y]

    def pick(p: Any, q: Any) -> Any:
        return p if x > 0.0 else q

    chosen = pick(a, b)
    chosen[0] = 7.0
    return a[0] + 2.0 * b[0]


def taken_over_in_a_loop(x: Any, y: Any, n: Any) -> Any:
    a, last = [x], [0.0]
    for _ in range(n):
        last = a
    last[0] = y
    return a[0]


def changed_in_the_next_turn(x: Any, y: Any, n: Any) -> Any:
    a, last = [x], [0.0]
    for i in range(n):
        last[0] = y + i
        last = a
    return a[0]


def changed_in_the_first_turn(x: Any, y: Any, n: Any) -> Any:
    a = [x]
    last = a
    for i in range(n):
        last[0] = y + i
        last = [0.0]
    return a[0]


def kept_in_a_dict(x: Any, y: Any, n: Any) -> Any:
    a = [x]
    kept = {"a": a}
    a[0] = y
    return kept["a"][0]


TWO_NAMES = [
    module_default, global_list, global_dict, inner_default, default_of_a_lambda,
    chosen_by_a_branch, taken_over_by_a_branch, first_list_changed_later, chosen_by_a_function,
    taken_over_in_a_loop, changed_in_the_next_turn, changed_in_the_first_turn, kept_in_a_dict,
]  # fmt: skip


@pytest.mark.parametrize(
    ("formula", "lanes"), [*[(f, 1) for f in TWO_NAMES], (chosen_by_a_branch, 4), (taken_over_by_a_branch, 4)]
)
def test_changing_one_is_refused_with_what_to_write(formula: Callable[..., Any], lanes: int) -> None:
    with pytest.raises(NotCompilable, match=r"let it be a copy|change a copy, `\[\*\w+\]`"):
        native(formula, [[1.0, 2.0], [-1.0, 2.0]], 1, 3, lanes)


def own_lists(x: Any, y: Any, n: Any) -> Any:
    """Lists of one name may be changed, also on one way of a branch, and in loops."""
    a, before = [x, y], [0.0, 0.0]
    for i in range(n):
        if a[0] > i:
            a[0] = a[0] * 0.5
        else:
            a[1] += a[0]
        before = [*a]
        before[0] = i
    row = [*(a if x > 0.0 else before)]
    row[0] = 3.0
    return a[0] + 2.0 * a[1] + 4.0 * before[0] + 8.0 * row[0] + 16.0 * row[1]


@pytest.mark.parametrize("lanes", [1, 4])
def test_lists_of_one_name_are_changed_as_in_python(lanes: int) -> None:
    rows = [[1.0, 2.0], [-1.0, 0.3], [5.0, -2.0]]
    assert native(own_lists, rows, 1, 3, lanes) == [plain(own_lists, row, 3) for row in rows]
