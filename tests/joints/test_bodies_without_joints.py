"""Bodies that no joint touches."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

import liemech as lm
from liemech.systems.conditions import connections, pulled, speeds


def test_pulls_are_the_transpose_of_speeds_and_leave_a_body_without_joints_alone() -> None:
    rng, touches = np.random.default_rng(3), [(0, 2), (2,), (2, 4)]
    rows = [[lm.vec(*rng.normal(size=6)) for _ in row] for row in touches]
    system: Any = SimpleNamespace(
        **connections(touches, 5), places=[(6 * b, 6 * b + 6) for b in range(5)]
    )
    impulses, xi = lm.vec(*rng.normal(size=3)), lm.vec(*rng.normal(size=30))
    pull = np.array(pulled(system, rows, impulses))
    assert pull.shape == (30,)
    assert not pull[6:12].any() and not pull[18:24].any()
    assert np.isclose(pull @ xi, np.dot(impulses, speeds(system, rows, xi)), rtol=1e-13)
