"""Pictures of runs backwards in time, on constraints, and of ensembles whose members have times of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech import plots, viewer

pytest.importorskip("matplotlib")
GALAXY = lm.models.HenonHeiles()


def follow(system: Any, method: Any, start: Any, **more: Any) -> Any:
    return lm.integrate(system, method, start, compiled=False, progress=False, **more)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_section_of_a_run_backwards_has_the_direction_of_time(direction: int) -> None:
    """Where q_1 = 0 is pierced with q_1 rising in time, p_1 = q_1' > 0; there and back pierces it in the same points."""
    start = GALAXY.state(q=[0.1, 0.1], p=[0.4, 0.1])
    there = follow(GALAXY, lm.RKMK(order=8), start, h=0.05, steps=300)
    end = GALAXY.state(q=there.q[-1], p=there.p[-1])
    back = follow(GALAXY, lm.RKMK(order=8), end, h=-0.05, steps=300)
    (q, p, _), (q1, p1, _) = (lm.plots.section(run, direction=direction) for run in (there, back))
    assert len(p1) > 1 and (direction * p1[:, 0] > 0.0).all()
    assert q1[::-1] == pytest.approx(q, abs=1e-6) and p1[::-1] == pytest.approx(p, abs=1e-6)


def test_sections_on_constraints_follow_the_sphere() -> None:
    """Between samples the motion is bent by the force of the constraint: on a great circle the
    section is a point of it.
    """
    ball = lm.SphericalPendulum(gravity=0.0)
    run = follow(ball, lm.RATTLE(), ball.state([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), h=0.05, steps=200)
    q, _, _ = lm.plots.section(run, direction=0)
    assert len(q) == 3
    assert np.abs(q[:, 1]) == pytest.approx(1.0, abs=1e-6)  # without that force 3e-4
    lm.plots.phase_portrait(run)


def test_an_ensemble_in_fictive_time_has_pictures_over_it() -> None:
    planets = lm.Kepler()
    start = planets.state(q=[[0.4, 0.0], [0.6, 0.0]], p=[[0.0, 2.0], [0.0, 1.5]])
    method = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))
    run = follow(planets, method, start, h=0.05, steps=150)
    assert run.t.shape == (151, 2)
    for picture in (lm.plots.invariants(run), lm.plots.drift(run)):
        assert "tau" in picture.get_xlabel()
        assert picture.lines[0].get_xdata()[-1] == pytest.approx(run.tau[-1])
    q, p, member = lm.plots.section(run, coordinate=1)
    for k in range(2):
        one = planets.state(q=start.arrays["q"][k], p=start.arrays["p"][k])
        alone = lm.plots.section(follow(planets, method, one, h=0.05, steps=150), coordinate=1)
        assert q[member == k] == pytest.approx(alone[0], abs=1e-9) and p[member == k] == pytest.approx(
            alone[1], abs=1e-9
        )


BODY = lm.RigidBody([1.0, 1.5, 2.0])
STARTS = BODY.state(mu=[[0.5, 0.1, 0.8], [0.5, 0.4, 0.8]], g=np.stack([np.eye(3)] * 2))
STEPS = [0.1, 0.3]
RUN = lm.integrate(BODY, lm.RKMK(order=2), STARTS, h=STEPS, steps=5, compiled=False)
FIRST, SECOND = (
    lm.integrate(BODY, lm.RKMK(order=2), BODY.state(mu=STARTS.mu[i], g=STARTS.g[i]), h=h, steps=5, compiled=False)
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
