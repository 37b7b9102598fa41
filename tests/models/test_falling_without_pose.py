"""A falling body has to know which way is down."""

from __future__ import annotations

import pytest

import liemech as lm
from liemech.systems.lie_poisson import BodyState


def test_the_exact_fall_asks_for_a_pose() -> None:
    body = lm.FallingBody([1.0, 1.6, 2.3], mass=1.7)
    with pytest.raises(lm.errors.InvalidInput, match=r"FallingBody\.exact: start has no pose g"):
        body.exact(BodyState(lm.vec(1.0, 2.0, 3.0, 0.0, 0.0, 0.0)), 0.1)
