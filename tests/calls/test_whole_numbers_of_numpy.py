"""Whole numbers of NumPy, lengths and elements of arrays, are whole numbers wherever one counts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from terms_of_spins import Exchange

import liemech as lm
from liemech import tableaus

PAIRS = lm.neighbours.between(np.array([[0, 1]]))
COUNTED: dict[str, Callable[[Any], Any]] = {
    "rods of a chain": lambda n: lm.joints.chain(n),
    "stages": lambda n: (tableaus.gauss(n), tableaus.radau_iia(n), tableaus.lobatto_iiic(n)),
    "a pair": lambda n: tableaus.pair(n + 1),
    "species of a term": lambda n: Exchange(1.0).over(PAIRS, of=(n - 2, n - 1)),
    "one species": lambda n: Exchange(1.0).over(PAIRS, of=n),
    "parameters by species": lambda n: lm.Terms(Exchange(1.0).over(PAIRS, of=(0, n - 1)), S={n - 2: 1.0, n - 1: 2.0}),
    "ratios": lambda n: lm.MultipleTimeSteps((n, n)),
}


@pytest.mark.parametrize("made", COUNTED.values(), ids=COUNTED)
def test_a_whole_number_of_numpy_counts(made):
    assert made(np.int64(2)) == made(np.uint8(2)) == made(2)


def test_truth_values_do_not_count():
    for made in (lm.joints.chain, tableaus.gauss, tableaus.pair):
        with pytest.raises(lm.errors.InvalidInput):
            made(np.bool_(True))
