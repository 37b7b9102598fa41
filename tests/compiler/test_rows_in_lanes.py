"""One formula of many arguments at once, in the lanes of a single body's registers: the same bits as row
by row, whatever the formula does, and whichever row fails.
"""

from __future__ import annotations

import fuzz
import numpy as np
import pytest
import worlds

import liemech as lm
from liemech.formulas import dot, norm, sqrt, vec, where
from liemech.formulas.calls.lanes import in_lanes

pytestmark = pytest.mark.compiled

ROWS = fuzz.arguments(7, 12, worlds.SPECIAL)


def root(x, k):
    """Heron's iteration, as long as x takes: rows leave the loop one after the other."""
    if x < 0.0:
        raise ValueError("no root")
    s, turns = 0.5 * (1.0 + x), 0
    while abs(s * s - x) > 1e-12 * x and turns < 60:
        s, turns = 0.5 * (s + x / s), turns + 1
    return k * s, vec(s, 1.0, where(x > 1.0, k, x))


def roots(a, b, c, d, n):
    """21 rows: more than any processor has lanes."""
    x = [abs(a) + 0.1 * i * abs(b) + 1.0 for i in range(21)]
    found = in_lanes(root, x, [float(i) for i in range(21)])
    return vec(*[s for s, _ in found], *[y for _, v in found[:3] for y in v])


def one_fails(a, b, c, d, n):
    """Where one of the numbers is negative, all is given up."""
    return vec(*[s for s, _ in in_lanes(root, [1.0, a, 2.0, b], [c, c, c, d])])


def in_a_branch(a, b, c, d, n):
    """In one way of two, and in a loop; the formula sees what is around it."""
    found = vec(0.0, 0.0, 0.0)
    for k in range(n):
        if a > b:
            found = found + vec(*in_lanes(lambda x: x * c + sqrt(abs(d)), [a, b, float(k)]))
        else:
            found = found - vec(*in_lanes(lambda x: x / (1.0 + c * c), [b, a, d]))
    return found


def known_ones(a, b, c, d, n):
    """Rows that are known while translating, the same in all rows, alone, and none."""
    same = in_lanes(lambda x, y: x * y + a, [2.0, 3.0], [b, b])
    known = in_lanes(lambda x: 2.0 * x, [1.0, 2.0, 3.0])
    fixed = in_lanes(lambda x: 7.0, [a, b])
    whole = in_lanes(lambda x, k: k * x, [a, b, c], [1, 2, 3])
    alone = in_lanes(lambda x: x - d, [c])
    return vec(*same, *known, *fixed, *whole, *alone, *in_lanes(root, [], []))


@pytest.mark.slow
@pytest.mark.parametrize("formula", [roots, one_fails, in_a_branch, known_ones])
def test_rows_in_lanes_have_the_bits_of_single_ones(formula):
    """In plain Python, one body, and bodies in lanes, where the rows go one after the other."""
    worlds.same_in_all_worlds(formula, ROWS)


def given_up(a, b, c, d, n):
    """Given up for all rows at once, by a condition that is none of theirs."""

    def quotient(x):
        if c < 0.0:
            raise ValueError("no such c")
        return x / (x * x + 1.0)

    return vec(*in_lanes(quotient, [a, b]))


def test_what_all_rows_leave_is_given_up():
    worlds.same_in_all_worlds(given_up, ROWS)


def test_pairs_in_lanes_are_vector_instructions():
    """Roots and quotients of eight pairs are those of registers, not single ones."""
    from test_lanes import instructions

    def pulls(a, b, c, d, n):
        x = [vec(a + 1.0 * k, b, c - 1.0 * k) for k in range(1, 9)]
        found = in_lanes(lambda y: (1.0 / (dot(y, y) * norm(y))) * y, x)
        return vec(*[z for y in found for z in y])

    calls = [line for line in instructions(pulls) if "call" in line and "double" in line]
    assert calls and all("x double>" in line for line in calls)


@pytest.mark.slow
@pytest.mark.parametrize("planets", [1, 9])
def test_planets_move_with_the_bits_of_plain_python(planets):
    """One planet, and nine: more than a register holds, and 52 pulls, more than two do."""
    rng = np.random.default_rng(planets)
    system = lm.models.PlanetarySystem([1.0, *(1e-3 * rng.uniform(size=planets))])
    Q = np.zeros((planets, 3))
    Q[:, 0] = 1.3 ** np.arange(planets)
    V = np.zeros_like(Q)
    V[:, 1], V[:, 2] = Q[:, 0] ** -0.5, 0.05 * rng.normal(size=planets)
    m = np.array(system.masses)
    reduced = m[1:] * np.cumsum(m)[:-1] / np.cumsum(m)[1:]
    start = system.state(np.concatenate([Q.ravel(), (reduced[:, None] * V).ravel()]))
    plain, native = (
        lm.integrate(system, lm.Splitting(order=2), start, h=0.3, steps=5, compiled=c) for c in (False, True)
    )
    assert plain.y.tobytes() == native.y.tobytes()
