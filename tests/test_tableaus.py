"""Tableaus are data: order conditions, what breaks them, and the order that a scalar equation sees."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scenes import slope

import liemech as lm
from liemech.tableaus import butcher
from liemech.tableaus.butcher import BY_ORDER, ButcherTableau

HEUN3 = dict(name="Heun 3", A=((), (1 / 3,), (0, 2 / 3)), b=(1 / 4, 0, 3 / 4), c=(0, 1 / 3, 2 / 3))


def test_number_and_density_of_trees() -> None:
    """1, 1, 2, 4, 9, 20, 48 rooted trees; sum over trees of n nodes of n!/(gamma sigma) is (n-1)!, checked for the tall one."""
    counts = [len(butcher._trees(n)) - len(butcher._trees(n - 1)) if n > 1 else 1 for n in range(1, 8)]
    assert counts == [1, 1, 2, 4, 9, 20, 48]
    tall: tuple = ()
    for n in range(1, 6):
        assert butcher._density(tall) == math.factorial(n)
        tall = (tall,)
    assert butcher._density(((),) * 4) == 5


@pytest.mark.parametrize("order", BY_ORDER)
def test_runge_kutta_of_this_order_on_a_nonlinear_equation(order: int) -> None:
    """y' = cos(t) - y^2 with the tableau by hand; the stage times count, too."""
    tableau = BY_ORDER[order]
    assert tableau.order == order
    assert tableau.source

    def solve(n: int) -> float:
        y, h = 0.3, 1.0 / n
        for i in range(n):
            k: list[float] = []
            for row, c in zip(tableau.A, tableau.c, strict=True):
                at = y + h * sum(a * s for a, s in zip(row, k, strict=True))
                k.append(math.cos((i + c) * h) - at * at)
            y += h * sum(b * s for b, s in zip(tableau.b, k, strict=True))
        return y

    counts = [8, 16, 32, 64]
    exact = (2**4 * solve(4096) - solve(2048)) / 15 if order == 4 else None
    if exact is None:
        from scipy.integrate import solve_ivp

        exact = solve_ivp(lambda t, y: np.cos(t) - y * y, (0, 1), [0.3], rtol=1e-13, atol=1e-13, method="DOP853").y[0, -1]
    assert slope([1 / n for n in counts], [abs(solve(n) - exact) for n in counts]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("order", BY_ORDER)
def test_no_tableau_is_of_a_higher_order_than_it_says(order: int) -> None:
    t = BY_ORDER[order]
    with pytest.raises(lm.errors.LawViolation, match=f"not of order {order + 1}"):
        ButcherTableau(t.name, order + 1, t.A, t.b, t.c)


@pytest.mark.parametrize("entry", range(4))
def test_a_changed_weight_is_found(entry: int) -> None:
    t = BY_ORDER[4]
    b = list(t.b)
    b[entry] += 1e-9
    with pytest.raises(lm.errors.LawViolation, match="not of order 4"):
        ButcherTableau("changed", 4, t.A, tuple(b), t.c)


def test_shapes_and_rows_are_checked() -> None:
    t = BY_ORDER[4]
    with pytest.raises(lm.errors.LawViolation, match="row 3"):
        ButcherTableau("row", 4, ((), (0.5,), (0.1, 0.5), (0.0, 0.0, 1.0)), t.b, t.c)
    with pytest.raises(lm.errors.LawViolation, match="4 weights"):
        ButcherTableau("short", 4, t.A[:3], t.b, t.c)
    with pytest.raises(lm.errors.LawViolation, match="4 weights"):
        ButcherTableau("square", 4, tuple((*row, 0.0) for row in t.A), t.b, t.c)
    with pytest.raises(lm.errors.LawViolation):
        ButcherTableau("nan", 1, ((),), (math.nan,), (0.0,))


def test_a_tableau_of_ones_own() -> None:
    """Integers, lists and arrays become numbers; its method is told from the built-in one by its repr."""
    tuples, lists = (
        ButcherTableau(order=3, **HEUN3),
        ButcherTableau("Heun 3", 3, [[], [1 / 3], [0, 2 / 3]], np.array([1 / 4, 0, 3 / 4]), [0, 1 / 3, 2 / 3]),
    )
    assert tuples == lists
    assert lists.stages == 3
    method = lm.RKMK(tableau=lists)
    assert (method.order, method.truncation) == (3, 1)
    assert "Heun 3" in repr(method)
    assert repr(lm.RKMK(order=3)) == "RKMK(order=3)"
