"""Estimates of errors and curves between steps, computed once more with NumPy: on a vector space
RKMK is the method of its tableau.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import vec
from liemech.integrators import taylor

SHIPPED = [getattr(lm.tableaus, name) for name in lm.tableaus.__all__]
PAIRS = [t for t in SHIPPED if isinstance(t, lm.tableaus.ButcherTableau) and t.b_hat and t.explicit]
SYSTEM, Y, H = lm.models.LotkaVolterra(), np.array([1.3, 0.6]), 0.3


def rate(y: np.ndarray) -> np.ndarray:
    """u' and v'."""
    return np.array(SYSTEM.velocity(vec(*y)))


def slopes(tableau: Any) -> np.ndarray:
    """k_1, ..., k_s of a step, and those that only the curve takes."""
    k: list[np.ndarray] = []
    for row in (*tableau.A, *tableau.A_extra):
        k.append(rate(Y + H * sum((a * x for a, x in zip(row, k)), np.zeros(2))))
    return np.array(k)


def trial(method: Any, rtol: float, atol: float) -> Any:
    start = SYSTEM.state(Y)
    return method.trial(SYSTEM, 0.0, start, SYSTEM.rate(0.0, start), H, rtol, atol, True)


@pytest.mark.parametrize("tableau", PAIRS, ids=lambda t: t.name)
@pytest.mark.parametrize(("rtol", "atol"), [(1e-3, 1e-6), (0.0, 1e-2), (1e-2, 0.0)])
def test_estimates_of_runge_kutta_pairs(tableau: Any, rtol: float, atol: float) -> None:
    """The root mean square of h (b - b^) k over the tolerance; DOP853 stretches it by a third
    method, e^2/(e^2 + e_3^2/100)^(1/2).
    """
    found, k = trial(lm.RKMK(tableau=tableau), rtol, atol), slopes(tableau)
    s = len(tableau.b)
    new = Y + H * np.array(tableau.b) @ k[:s]
    allowed = atol + rtol * np.maximum(np.abs(Y), np.abs(new))

    def size(weights: Any) -> float:
        off = H * (np.array(tableau.b) - weights) @ k[:s]
        return float(np.sqrt(np.mean((off / allowed) ** 2)))

    error = size(tableau.b_hat)
    if tableau.b_low:
        error = error**2 / np.sqrt(error**2 + 0.01 * size(tableau.b_low) ** 2)
    assert found.error == pytest.approx(error, rel=1e-9)
    assert np.allclose(found.state.y, new, rtol=1e-15)
    assert np.allclose(found.velocity, rate(new), rtol=1e-14)


@pytest.mark.parametrize("tableau", PAIRS, ids=lambda t: t.name)
def test_curves_of_runge_kutta_pairs(tableau: Any) -> None:
    """Both ends, with their velocities, and the order in between; as many terms as are said."""
    method = lm.RKMK(tableau=tableau)
    found, k = trial(method, 1e-3, 1e-6), slopes(tableau)
    assert len(found.curve) == method.curve_terms
    new = np.array(found.state.y)
    terms = np.array([np.array(p) for p in found.curve])
    assert np.allclose(terms.sum(axis=0), new - Y, rtol=1e-12)
    assert np.allclose(terms[0], H * k[0], rtol=1e-12)
    assert np.allclose(terms.T @ np.arange(1.0, len(terms) + 1.0), H * rate(new), rtol=2e-2)
    if not tableau.interpolant:
        assert method.curve_terms == 3 and method.dense_order == min(tableau.order, 3)
        assert np.allclose(terms.T @ [1.0, 2.0, 3.0], H * rate(new), rtol=1e-12)


@pytest.mark.parametrize("order", [2, 5, 12])
def test_estimates_of_taylor_methods(order: int) -> None:
    """max(e_p, e_(p-1)), of the last two terms of the series of the whole step; the step is the share
    of it that r = max(e_p^(1/p), e_(p-1)^(1/(p-1))) allows, to a hundredth.
    """
    for rtol in (1e-2, 1e-9):
        found = trial(lm.Taylor(order), rtol, 1e-4)
        way = np.array([np.array(p) for p in found.curve])
        assert len(way) == order == lm.Taylor(order).curve_terms == lm.Taylor(order).error_order
        terms = way / found.share ** np.arange(1, order + 1)[:, None]
        allowed = 1e-4 + rtol * np.maximum(np.abs(Y), taylor.NEAR * np.abs(terms[0]))
        last, before = (np.sqrt(np.mean((terms[i] / allowed) ** 2)) for i in (-1, -2))
        r = max(last ** (1 / order), before ** (1 / (order - 1)))
        assert found.error == pytest.approx(max(last, before), rel=1e-9)
        wanted = taylor.SAFETY / r
        assert found.share == (pytest.approx(wanted, rel=0.01) if wanted < taylor.WHOLE else 1.0)
        # each term is the derivative of those before
        exact = lm.integrate(
            SYSTEM, lm.RKMK(order=8), SYSTEM.state(Y), h=found.share * H / 20, steps=20, compiled=False
        ).y[-1]
        assert np.abs(Y + way.sum(axis=0) - exact).max() < {2: 3e-2, 5: 3e-4, 12: 1e-8}[order]
        assert np.allclose(found.state.y, Y + way.sum(axis=0), rtol=1e-15)


def test_methods_without_estimate_say_so() -> None:
    assert lm.ImplicitMidpoint().error_order == 0 and lm.Boris().error_order == 0
    assert lm.RKMK(order=1).error_order == 0
