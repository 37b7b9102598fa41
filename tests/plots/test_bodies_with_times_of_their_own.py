"""Pictures of one body of an ensemble whose bodies have steps, and so times, of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech import plots, viewer

BODY = lm.RigidBody([1.0, 1.5, 2.0])
STARTS = BODY.state(mu=[[0.5, 0.1, 0.8], [0.5, 0.4, 0.8]], g=np.stack([np.eye(3)] * 2))
STEPS = [0.1, 0.3]
RUN = lm.integrate(BODY, lm.RKMK(order=2), STARTS, h=STEPS, steps=5, compiled=False)
FIRST, SECOND = (
    lm.integrate(
        BODY,
        lm.RKMK(order=2),
        BODY.state(mu=STARTS.mu[i], g=STARTS.g[i]),
        h=h,
        steps=5,
        compiled=False,
    )
    for i, h in enumerate(STEPS)
)


@pytest.mark.parametrize("draw", [plots.components, plots.euler_angles, plots.quaternion])
def test_a_body_is_drawn_over_its_own_times(draw: Any) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    axes = [draw(RUN, body=1), draw(SECOND)]
    curves = [[line.get_xydata() for line in ax.get_lines()] for ax in axes]
    pyplot.close("all")
    assert len(curves[0]) == len(curves[1])
    for of_ensemble, alone in zip(*curves, strict=True):
        np.testing.assert_array_equal(of_ensemble, alone)


def test_a_scene_shows_one_of_them() -> None:
    with pytest.raises(lm.errors.InvalidInput, match="shown one at a time; give body="):
        RUN.view()
    for body, alone in enumerate((FIRST, SECOND)):
        motion = viewer.Scene(RUN, body=body).shown[0].motion
        assert np.array_equal(motion.t, alone.t) and np.array_equal(motion["mu"], alone.mu)
