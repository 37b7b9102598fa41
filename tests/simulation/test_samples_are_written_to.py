"""Samples are the user's: what is done to them, such as another unit in place, is not felt by what
goes on from the run.
"""

from __future__ import annotations

from typing import Any

import pytest
from scenes import CAYLEY, asymmetric_body, same_bits

import liemech as lm


@pytest.mark.parametrize("compiled", [False, pytest.param(None, marks=pytest.mark.compiled)])
def test_a_run_goes_on_from_where_it_stood(compiled: Any) -> None:
    body, start = asymmetric_body()
    plan = lm.Plan(body, CAYLEY, 0.1, compiled=compiled)
    for _ in range(2):  # prepared, and then at once
        whole, half = plan.run(start, steps=8), plan.run(start, steps=4)
        half.mu[:] *= 1000.0
        rest = plan.resume(half, steps=4)
        rest.g[:] *= 1000.0
        assert same_bits(rest.mu, whole.mu[4:])
        assert same_bits(plan.resume(half, steps=4).g, whole.g[4:])
