"""The language of formulas, feature by feature: plain Python, one compiled body and every lane of
an ensemble agree to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field
from typing import Any, ClassVar

import fuzz
import pytest
import worlds

import liemech.formulas as native
from liemech.compiler import kernel
from liemech.formulas import (
    Mat,
    Record,
    Vec,
    acos,
    asin,
    atan,
    atan2,
    cos,
    cosh,
    cross,
    diagonal,
    dot,
    exp,
    expm1,
    identity_matrix,
    log,
    log1p,
    mat,
    norm,
    outer,
    record,
    sin,
    sinh,
    solve,
    solve3,
    sqrt,
    tan,
    tanh,
    transpose,
    vec,
    where,
)

pytestmark = pytest.mark.compiled

ROWS = [*fuzz.arguments(1, 40, worlds.SPECIAL), *([x, y, 1.0, -1.0] for x in worlds.SPECIAL for y in worlds.SPECIAL)]
"""Numbers of all sizes, and each special value beside each."""

FORMULAS: list[Callable[..., Any]] = []


def formula(f: Callable[..., Any]) -> Callable[..., Any]:
    FORMULAS.append(f)
    return f


class Stop(ArithmeticError):
    """What formulas under test raise."""


# --- arithmetic
# ------------------------------------------------------------------------------------------------------


@formula
def arithmetic(a, b, c, d, n):
    return vec(
        a + b * c - d, -a, +b, a / (1.0 + b * b), 2 * a, a - 1, 1 - a, 3 / (2.0 + abs(b)), abs(c), n * a, (n + 1) / 2
    )


@formula
def integers(a, b, c, d, n):
    k = 2 * n - 5
    return vec(k, -k, k * k, k / 4, k + a, k - True, n + (n > 2))


@formula
def powers(a, b, c, d, n):
    x = min(abs(a), 100.0) + 0.5
    return vec(x**2, x**3, x**0.5, x**-1, 2.0**b if abs(b) < 9.0 else 1.0, x**n)


@formula
def signs_of_zero(a, b, c, d, n):
    return vec(
        -0.0, 0.0, -(a - a), a * 0.0, -0.0 + a * 0.0, 0.0 - a, -1 * (a * 0.0), where(a == 0.0, a, 1.0), abs(-0.0 * b)
    )


@formula
def elementary_functions(a, b, c, d, n):
    x = min(max(a, -5.0), 5.0)
    return vec(
        *[f(a) for f in (sin, cos, tan, atan, asin, acos, tanh, sqrt, log, exp, expm1, log1p, sinh, cosh)],
        *[f(x) for f in (sin, cos, tan, atan, asin, acos, tanh, sqrt, log, exp, expm1, log1p, sinh, cosh)],
        atan2(a, b),
        atan2(b, x),
    )


@formula
def functions_of_the_math_module(a, b, c, d, n):
    x = min(max(a, -5.0), 5.0)
    return vec(math.sin(x), math.exp(x), math.sqrt(abs(x)), math.atan2(b, x), math.pi * x, math.fabs(x))


@formula
def least_and_greatest(a, b, c, d, n):
    return vec(min(a, b), max(a, b), min(a, b, c), max((a, b, c, d)), min(a, 0.0), max(0.0, a), min(n, 2), max(a, n))


@formula
def comparisons(a, b, c, d, n):
    tests = [a < b, a <= b, a > b, a >= b, a == b, a != b, a < b < c, a < b > c, 0 < n <= 3, a == b == c, not a < b]
    return vec(*[where(t, 1.0, 0.0) for t in tests])


@formula
def truth_of_numbers(a, b, c, d, n):
    total = 0.0
    if a:
        total = total + 1.0
    if not b:
        total = total + 2.0
    if n and c:
        total = total + 4.0
    return vec(total, a or b, a and b, a or b or c, a and b and c, (a > 0 and b) or c, bool(a) * 2.0)


@formula
def what_stands_behind_and_is_not_run(a, b, c, d, n):
    if a > 0.0 and fails_for_negative(a) > 1.0:
        return vec(1.0, b)
    if a >= 0.0 or fails_for_negative(-a) > 2.0:
        return vec(2.0, c)
    return vec(3.0, d)


def fails_for_negative(x):
    if not x > 0.0:
        raise Stop(f"{x} is not positive")
    return 2.0 * x


@formula
def selections(a, b, c, d, n):
    u, v = where(a < b, vec(a, b), vec(c, d)), where(n > 1, (a, vec(b)), (b, vec(c)))
    return vec(*u, v[0], *v[1], where(a < b, 1, 2), where(True, a, None), where(a < b < c, a, where(c < d, c, d)))


# --- vectors and matrices
# --------------------------------------------------------------------------------------------


@formula
def vectors(a, b, c, d, n):
    u, v = vec(a, b, c), vec(d, -a, 2.0)
    w = [*(u + v), *(u - v), *(2.0 * u), *(u * a), *(u * v), *(u / 3.0), *(-u)]
    return vec(*w, dot(u, v), norm(u), *cross(u, v), u @ v, len(u))


@formula
def matrices(a, b, c, d, n):
    m, k = mat(vec(a, b), vec(c, d)), Mat((1.0, a), (b, -2.0))
    x = vec(d, 1.0)
    rows = [
        m + k,
        m - k,
        m @ k,
        k.T,
        transpose(m),
        2.0 * m,
        m * 0.5,
        m / 2.0,
        -m,
        outer(x, x),
        diagonal(x),
        identity_matrix(2),
    ]
    return vec(*[x for r in rows for row in r for x in row], *(m @ x), *(x @ m), m[0, 1], m[1][0], m.shape[0], *m[1])


@formula
def pivoted_solutions(a, b, c, d, n):
    m = mat(vec(a, b, 1.0), vec(c, d, 0.5), vec(2.0, a, 4.0))
    regular = mat(vec(0.0, 2.0, 0.0), vec(3.0, 0.0, 1.0), vec(1.0, 1.0, 5.0))
    f = 1.0 / (1.0 + abs(a))
    return vec(*solve(regular, vec(f, b, c)), *solve3(regular, vec(f, b, 1.0))) if a == a else vec(*m[0], *m[1])


@formula
def large_solutions(a, b, c, d, n):
    x = vec(a, b, c, d)
    y = vec(*[v if -1e3 < v < 1e3 else 0.5 for v in x])
    m = identity_matrix(4) * 0.1 + outer(y, y) + diagonal(vec(1.0, -1.0, 2.0, -2.0) * norm(y))
    return solve(m, y)


@formula
def items_found_at_run_time(a, b, c, d, n):
    v, m, t = vec(a, b, c, d), mat(vec(a, b), vec(c, d)), (a, b, c)
    k = n - 2
    i = 0 if a < b else 1
    return vec(v[k], v[i], v[-i], m[i, 0], m[i][i], *m[i], t[i], [a, b][i], v[i + 1])


# --- control flow
# ----------------------------------------------------------------------------------------------------


@formula
def branches(a, b, c, d, n):
    if a < b:
        x = a
        if c < d:
            x = x + 1.0
            c = d
        elif c == d:
            b = 2.0
        else:
            x = 2.0 * x
    elif a == b:
        x = 5.0
    else:
        x = b
        d = sin(x) if abs(x) < 10.0 else 0.5
    return vec(x, a, b, c, d)


@formula
def early_returns(a, b, c, d, n):
    if a < 0.0:
        if b < 0.0:
            return vec(a, b)
        c = c + 1.0
        if c < d:
            return vec(c, d)
    elif b > 1.0:
        return vec(1.0, a)
    else:
        a = a - 1.0
    if n > 2 and a < c:
        return vec(a, c)
    return vec(a + b, c + d)


@formula
def returns_in_written_out_loops(a, b, c, d, n):
    for i in range(4):
        a = a * 0.5 + 1.0
        for x in (b, c, d):
            if x < a - i:
                return vec(a, x, i)
            b = b + 0.25
    return vec(a, b, -1.0)


@formula
def choices(a, b, c, d, n):
    x = a if a > b else b if b > c else c
    y = [v if v > 0.0 else -v for v in (a, b)]
    return vec(x, *y, (a if n > 2 else b), *((a, b) if c < d else (c, d)), 1.0 if 2 > 1 else None)


@formula
def written_out_loops(a, b, c, d, n):
    total, trail = 0, []
    for i in range(5):
        total = total + i * a
    for i, x in enumerate((a, b, c)):
        total = total + x / (i + 1)
    for x, y in zip((a, b), (1.0, 2.0)):
        trail = [*trail, x * y]
    for i in range(6, 0, -2):
        for j in reversed(range(i)):
            total = total - j * 0.125
    for row in mat(vec(a, b), vec(c, d)):
        for x in row:
            if x > 1.0:
                continue
            if x < -1.0:
                break
            total = total + x
    return vec(total, *trail, i, x)


@formula
def leaving_written_out_loops(a, b, c, d, n):
    total = 0.0
    for i in range(4):
        a = a * 0.5
        if a < b:
            total = total + 1.0
            if c > i:
                continue
            b = b - 1.0
            if d > i:
                break
        total = total + 10.0
        for x in (b, c):
            if x > total:
                break
            total = total + 0.5
            if x < i - 2:
                continue
            total = total * 1.25
        c = c + 0.5
    return vec(total, a, b, c, i)


@formula
def loops_of_run_time_length(a, b, c, d, n):
    total, i = 0, -7
    for i in range(n):
        total = total + i * a
    for j in range(1, n + 1):
        for k in range(j):
            if k > a:
                continue
            if k + j > b + 3:
                break
            total = total + 0.5 * k
    for _ in range(100):
        total = 0.75 * total + b
    for k in range(n, 2):
        i = k + 100
    return vec(total, i)


@formula
def while_loops(a, b, c, d, n):
    count, x = 0, min(abs(a), 1e6)
    while x > 1.0 and count < 40:
        x = x / 2.0
        count = count + 1
        if x < b:
            continue
        if x > 1e5 + d:
            c = x
            break
        y = min(abs(b), 4.0)
        while y > 0.5:
            y = y - 0.75
            if y < c:
                break
            x = x - 0.001
    else_ = 0
    while else_ < 3:
        else_ = else_ + 1
    return vec(count, x, c, else_)


@formula
def endless_loops_with_a_way_out(a, b, c, d, n):
    x, turns = min(abs(a), 100.0), 0
    while True:
        x = 0.5 * (x + 2.0 / (x + 0.1))
        turns = turns + 1
        if abs(x * x - 2.0) < 0.2 or turns > 20:
            break
    return vec(x, turns)


@formula
def numbers_that_change_their_kind(a, b, c, d, n):
    total, flag, product = 0, False, 1
    for i in range(n):
        total = total + (atan(a) if i > 0 else 1)  # beyond 2**53 an integer is no float
        flag = flag or total > b
        product = product * 2
    if a > b:
        product = 0.5
    return vec(total, flag, product)


@formula
def newton_for_each_body_its_own_number_of_turns(a, b, c, d, n):
    """x^3 + x = a: some lanes converge at once, others late."""
    target = a if -1e6 < a < 1e6 else 1.0
    x, turns = target, 0
    for turns in range(100):  # noqa: B007
        step = (x * x * x + x - target) / (3.0 * x * x + 1.0)
        x = x - step
        if abs(step) <= 1e-12 * (1.0 + abs(x)):
            break
    return vec(x, turns)


@formula
def raising(a, b, c, d, n):
    for i in range(3):
        if a > 2.0 + i:
            raise Stop(f"{a} is beyond {i}")
        a = a + 0.25
    while b < 0.0:
        b = b + 0.5
        if b < -3.0:
            raise Stop("far below")
    return vec(a, b, inner_raise(c))


def inner_raise(x):
    if x > 20.0:
        if x > 1e200:
            return 1.0
        raise Stop("too large")
    return x


@formula
def raising_in_comprehensions_after_returns(a, b, c, d, n):
    if a < 0.0:
        return vec(a, a)
    return vec(*[fails_for_negative(x) if x > -1.0 else x for x in (a + 0.5, a + 1.5)])


# --- functions
# -------------------------------------------------------------------------------------------------------

GAIN = 1.25
WEIGHTS = ((1.0, 2.0), (0.5, -0.25))


def weighted(x, y=2.0, *more, scale=1.0, rows=WEIGHTS):
    total = x * y * GAIN
    for m in more:
        total = total + m
    for row in rows:
        for w in row:
            total = total + w * scale
    return total


def several(x, y):
    if x > y:
        return x, (y, vec(x, y))
    return y, (x, vec(y, y))


def closure(slope: float) -> Callable[..., Any]:
    def line(x, offset=0.5):
        return slope * x + offset

    return line


STEEP, FLAT = closure(3.0), closure(0.125)
square = lambda x: x * x  # noqa: E731


@formula
def arguments_of_all_kinds(a, b, c, d, n):
    spread = (b, c)
    return vec(
        weighted(a),
        weighted(a, b),
        weighted(a, y=c),
        weighted(a, b, c, d),
        weighted(a, *spread, scale=d),
        weighted(x=a, scale=b, rows=((a, 1.0),)),
        STEEP(a),
        FLAT(b, offset=c),
        square(a),
        native.dot(vec(a, b), vec(c, d)),
    )


@formula
def several_results(a, b, c, d, n):
    x, (y, v) = several(a, b)
    first = several(c, d)[0]
    (p, q), r = (a, b), c
    return vec(x, y, *v, first, p, q, r)


def collatz(x, depth):
    if depth == 0:
        return x
    if x > 1.0:
        return collatz(x / 2.0, depth - 1)
    return collatz(3.0 * x + 1.0, depth - 1)


@formula
def recursion_of_known_depth(a, b, c, d, n):
    return vec(collatz(a, 5), collatz(b, 3))


@formula
def lists(a, b, c, d, n):
    items = [0.0] * 4
    items[1] = a
    items[-1] = b
    items[0], items[2] = c, items[1] + 1.0
    if a < b:
        items[1] = items[1] + c
    for i in range(3):
        items[i] += items[i + 1]
        if items[i] > d:
            items[0] = -d
    pairs = [(x, y) for x in items for y in (1.0, 2.0) if y > 1.0]
    first = [x for x, _ in pairs][::-1]
    more = items + [a]
    more += [b]
    return vec(*items, *first, *more[1:], len(pairs), *[i * j for i in range(2) for j in range(3) if i != j])


@formula
def names_known_at_translation(a, b, c, d, n):
    kind = f"{'gai'}n"
    label: str = "x"
    values = {"x": 1.0}["x"] if label != "x" else 2.0
    nothing = None
    total = a if nothing is None else b
    known = label in ("x", "y") and label != "z" and isinstance(a, float) and not isinstance(n, float)
    whole = [round(2.5), int(3.7), divmod(7, 2)[1], 7 // 2, 7 % 4, 2**3, type(a) is float]
    return vec(total, len(kind), values if known else 0.0, *whole)


# --- records
# ---------------------------------------------------------------------------------------------------------


@record
class Spring(Record):
    """A base class with everything that subclasses inherit, override and extend."""

    stiffness: float
    order: int = 2
    factor: ClassVar[float] = 0.5

    @property
    def doubled(self):
        return 2.0 * self.stiffness

    def shape(self, x):
        return x**self.order if self.order > 2 else x * x

    def energy(self, x):
        return self.factor * self.stiffness * self.shape(x)

    def force(self, x, *, sign=-1.0):
        return sign * self.doubled * x

    @staticmethod
    def clamp(x):
        return min(max(x, -100.0), 100.0)

    @classmethod
    def unit(cls):
        return cls.factor

    def __call__(self, x):
        return self.energy(x)


@record
class Cubic(Spring):
    factor: ClassVar[float] = 0.25
    offset: Vec = Vec(0.0, 1.0)

    @property
    def doubled(self):
        return super().doubled + (self.offset[1] if self.stiffness > 0.0 else 0.0)

    def shape(self, x):
        return super().shape(x) + x * self.offset[1]


@record
class Pair(Record):
    first: Spring
    second: Cubic
    weights: tuple[float, ...] = (0.5, 2.0)
    mode: str = "both"
    mixing: Mat = Mat((1.0, 0.5), (0.0, 1.0))
    extra: Any = None
    hidden: float = field(default=3.0)

    def energy(self, x):
        total = 0.0
        for w, part in zip(self.weights, (self.first, self.second)):
            total = total + w * part.energy(part.clamp(x))
        if self.mode == "both":
            total = total + self.mixing[0, 1]
        if self.extra is not None:
            total = total / 0
        return total + self.hidden


@record
class Point(Record):
    x: float
    v: Vec
    tag: Any = None

    def displaced(self, by):
        return Point(self.x + by, self.v * by, self.tag)


PAIR = Pair(Spring(2.0, 3), Cubic(-1.5, offset=[0.25, 0.75]))


@formula
def records_inherited_and_nested(a, b, c, d, n):
    s, q = Spring(a), Cubic(b, 3, vec(c, d))
    x = s.clamp(c)
    return vec(
        PAIR.energy(a),
        s.energy(x),
        q.energy(x),
        q.force(d),
        q.force(x, sign=2.0),
        q.doubled,
        q.unit(),
        q.factor,
        Spring.unit(),
        Spring.energy(q, x),
        *q.offset,
        getattr(q, "order"),  # noqa: B009
        isinstance(q, Spring),
    )


@formula
def records_made_and_returned(a, b, c, d, n):
    p = Point(a, vec(b, c))
    for _ in range(3):
        p = p.displaced(d if abs(d) < 2.0 else 0.5)
    q = p if a < b else Point(1, vec(2, 3))
    if c < d:
        q = Point(x=q.x / 2, v=q.v, tag=None)
    while_turns = 0
    while q.x > 1.0 and while_turns < 5:
        q = Point(q.x * 0.5, q.v + vec(1.0, q.x))
        while_turns = while_turns + 1
    return vec(q.x, *q.v, p.x, while_turns)


# --- rounding
# --------------------------------------------------------------------------------------------------------


@formula
def products_that_a_fused_operation_would_round_once(a, b, c, d, n):
    x, y = 1.0 + 2.0**-27 + a * 0.0, 1.0 - 2.0**-27 + b * 0.0
    return vec(x * y - 1.0, 1.0 - x * y, x * x - (1.0 + 2.0**-26), a * b + c * d, a * b - c * d)


@formula
def sums_with_compensation(a, b, c, d, n):
    """Kahan: a compiler that may re-associate makes the correction zero."""
    x = 0.1 + 0.0 * a
    total, lost = 0.0, 0.0
    for _ in range(1000):
        y = x - lost
        t = total + y
        lost = (t - total) - y
        total = t
    return vec(total, lost)


@formula
def nan_in_tests(a, b, c, d, n):
    nan, inf = a - a, abs(b) * 1e308 * 10.0
    return vec(
        *[
            where(t, 1.0, 0.0)
            for t in (a != a, a == a, not a < b, not a >= b, nan == 0.0, inf == inf, inf - inf == 0.0)
        ],
        *[0.0 if x != x else x for x in (a, nan, inf, a / (1.0 + b * b))],
        min(a, 1.0),
        min(1.0, a),
        max(nan, b),
    )


@pytest.mark.sample(6)
@pytest.mark.parametrize("function", FORMULAS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("turns", [3])
def test_same_bits_in_all_worlds(function, turns):
    worlds.same_in_all_worlds(function, ROWS, turns)


@pytest.mark.parametrize("turns", [0, 1, 7])
@pytest.mark.parametrize(
    "function", [loops_of_run_time_length, numbers_that_change_their_kind], ids=lambda f: f.__name__
)
def test_loops_of_every_length(function, turns):
    worlds.same_in_all_worlds(function, ROWS, turns)


def test_the_comparison_notices_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The harness itself: a formula that is not the same in both worlds is caught, and so is one bit."""
    assert worlds.bits(0.0) != worlds.bits(-0.0)
    assert worlds.bits(1.0) != worlds.bits(math.nextafter(1.0, 2.0))

    def right(a, b, c, d, n):
        return vec(a * 2.0, b)

    def wrong(a, b, c, d, n):
        return vec(a * 2.0000000000000004, b)

    worlds.same_in_all_worlds(right, ROWS)
    native = worlds.outcomes
    monkeypatch.setattr(worlds, "outcomes", lambda formula, *rest: native(wrong, *rest))
    with pytest.raises(AssertionError, match="instead of"):
        worlds.same_in_all_worlds(right, ROWS)


def test_kahan_is_exact_where_the_plain_sum_is_not():
    total = worlds.plain(sums_with_compensation, [0.0, 0.0, 0.0, 0.0], 3)[0]
    assert total == worlds.bits(100.0) != worlds.bits(_plain_sum(0.1, 1000))


def _plain_sum(x: float, n: int) -> float:
    total = 0.0
    for _ in range(n):
        total += x
    return total


def test_every_lane_takes_its_own_way():
    """The rows above send neighbouring lanes different ways; make sure they do."""
    kinds = {
        tuple(worlds.plain(early_returns, row, 3)) == tuple(worlds.plain(early_returns, ROWS[0], 3)) for row in ROWS
    }
    turns = {worlds.plain(newton_for_each_body_its_own_number_of_turns, row, 3)[1] for row in ROWS[: kernel.lanes()]}
    assert kinds == {True, False} and len(turns) > 2
