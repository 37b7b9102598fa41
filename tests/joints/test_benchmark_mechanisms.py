"""Mechanisms of the literature come where published numbers, or independent solutions, have them, with
the order of the method.
"""

from __future__ import annotations

import benchmark_mechanisms
import numpy as np
import pytest

import liemech as lm

DROPPED = {"Andrews": 9, "slider-crank": 3, "spatial slider-crank": 0, "Bricard": 1, "governor": 0, "8 four-bars": 24}


@pytest.mark.slow
def test_bricard_s_loop_of_six_hinges_moves_and_is_where_its_one_freedom_says() -> None:
    mechanism = benchmark_mechanisms.bricard()
    assert len(mechanism.linkage.dropped) == 1
    errors = [mechanism.error(lm.LieRATTLE(), n, compiled=False) for n in (5, 10)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1) and errors[1] < 4e-4


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("name", benchmark_mechanisms.ALL)
def test_mechanisms_of_the_literature_are_where_they_must_be(name: str) -> None:
    mechanism = benchmark_mechanisms.ALL[name]()
    assert len(mechanism.linkage.dropped) == DROPPED[name]
    for method, order, fewer in ((lm.LieRATTLE(), 2, 1), (lm.Composition(lm.LieRATTLE(), order=4), 4, 4)):
        errors = [mechanism.error(method, mechanism.steps * n // fewer) for n in (1, 2)]
        size = np.abs(mechanism.wanted).max()
        assert errors[1] < (1e-4 if order == 2 else 1e-7) * size
        if errors[1] > 1e-9 * size:  # else rounding, and the digits of what is published
            assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)
