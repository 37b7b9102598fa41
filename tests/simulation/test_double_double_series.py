"""Series in numbers of two doubles, in native code: the exponential sums them in loops, which `fma` must survive."""

from __future__ import annotations

import pytest
from scenes import asymmetric_body, same_bits

import liemech as lm


@pytest.mark.compiled
def test_the_exponential_in_31_digits_has_native_code() -> None:
    body, start = asymmetric_body()
    plan = lm.Plan(body, lm.CovariantVariational(lm.Exponential()), 0.1, precision="double-double", compiled=False)
    start = body.state(start.mu)
    plain, native = plan.run(start, steps=3), plan.replace(compiled=True).run(start, steps=3)
    assert same_bits(plain.carry.numbers, native.carry.numbers)
