"""A number of a loop that gets a derivative in it only, in plain Python and in native code."""

from __future__ import annotations

from pathlib import Path

import pytest
import worlds

pytestmark = pytest.mark.compiled

TEXT = """
import liemech as lm

def newton(v):
    d, x = 1.0, v[0]
    while abs(d) > 1e-10:
        d = (x * x - v[1]) / (2 * x)
        x = x - d
        y = 2 * d
    return x

def doubled(v):
    x = v[1]
    while abs(x) < 50.0:
        x = 2 * x + abs(v[0])
    return x

def formula(a, b, n):
    (of_a, of_b), (c, d) = lm.jacobian(lambda v: lm.vec(newton(v), doubled(v)), lm.vec(a, b))
    return of_a, of_b, c, d
"""


def test_a_derivative_that_begins_in_a_loop(tmp_path: Path) -> None:
    """`2 * x` was refused, as the product of a number that may be an integer."""
    module = worlds.module_from(TEXT, tmp_path, "derivatives_that_begin")
    of_a, of_b, c, d = module.formula(2.0, 1.1, 3)
    # the root of b has no derivative by its guess; x is 2^n b + (2^n - 1) a
    assert abs(of_a) < 1e-9 and abs(of_b - 0.5 / 1.1**0.5) < 1e-12
    assert (c, d) == (31.0, 32.0) or (c, d) == (15.0, 16.0)
    worlds.same_in_all_worlds(module.formula, [(2.0, 1.1), (0.7, 0.3), (3.1, 2.0)], lanes=[1, 4])


CHOSEN = """
import liemech as lm

def formula(a, b, n):
    return lm.gradient(lambda v: -(v[1] if v[0] > 1.0 else 0.5 * v[0]), lm.vec(a, b))
"""


def test_a_derivative_of_one_way_only(tmp_path: Path) -> None:
    """In lanes it was refused, as the negative of a number that may be an integer."""
    module = worlds.module_from(CHOSEN, tmp_path, "derivatives_of_one_way")
    worlds.same_in_all_worlds(module.formula, [(2.0, 1.1), (0.7, 0.3), (3.1, 2.0)], lanes=[1, 4])
