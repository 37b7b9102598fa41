"""The same mechanism in other units of length moves the same way, and keeps its conditions to rounding of its lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.joints import BallJoint, Link, Linkage, Spring


def moved(count: int, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses with positions in units of the length, and conditions beside it."""
    links = [Link(1.0 + 0.2 * k, [length * length * x for x in (0.1, 0.12, 0.15)]) for k in range(count)]
    joints: list[Any] = [BallJoint(0, None, [0, 0.1 * length, 0.5 * length], [0, 0, 0])]
    joints += [BallJoint(k, k - 1, [0, 0, 0.4 * length], [0, 0, -0.5 * length]) for k in range(1, count)]
    linkage = Linkage(links, joints, 9.8 * length, forces=[Spring(0, 3.0 * length**2)])
    start = linkage.state(angles={k: [0.3, -0.5, 0.1] for k in range(count)}, rates={0: [1.0, 0.2, 0.3]})
    run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.01, steps=5, compiled=False)
    g = run.g[-1].reshape(count, 4, 4).copy()
    g[:, :3, 3] /= length
    return g, np.abs(linkage.conditions_at(run.mu[-1], run.g[-1])[0]) / length


@pytest.mark.sample(1)
@pytest.mark.parametrize("count", [2, 3])
def test_any_unit_of_length(count: int) -> None:
    wanted, _ = moved(count, 1.0)
    for length in (1e-12, 1e-9, 1e-6, 1e3, 1e12):
        g, conditions = moved(count, length)
        assert np.abs(g - wanted).max() < 2e-15
        assert conditions.max() < 1e-15
