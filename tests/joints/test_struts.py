"""Struts: forces along the line between two points of two bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.joints import BallJoint, Damper, Link, Linkage, PrismaticJoint, Spring, Strut, UniversalJoint

A, B = [0.1, 0.2, 0.3], [0.3, -0.1, 0.2]
LINKS = [Link(1.0, [0.1, 0.2, 0.15]), Link(2.0, [0.3, 0.2, 0.25])]


@pytest.mark.slow
def test_a_block_on_a_rail_and_a_strut_beside_it_move_by_their_equation() -> None:
    """m x'' = -(k (L - rest) + c L') x/L, L^2 = x^2 + b^2."""
    m, k, c, rest, b = 1.3, 40.0, 0.7, 0.5, 0.4
    joints: Any = [PrismaticJoint(0, None, axis=[1.0, 0.0, 0.0]), Strut(0, None, [0, 0, 0], [0, b, 0], name="strut")]
    forces = [Spring("strut", k, rest), Damper("strut", c)]
    block = Linkage([Link(m, [0.1, 0.1, 0.1])], joints, 9.81, forces)

    def rate(t: float, y: np.ndarray) -> list[float]:
        L = np.hypot(y[0], b)
        return [y[1], -(k * (L - rest) + c * y[0] * y[1] / L) * y[0] / L / m]

    wanted = solve_ivp(rate, (0.0, 1.0), [0.9, 0.0], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for steps in (40, 80):
        start = block.state(angles={0: 0.9})
        run = lm.integrate(block, lm.LieRATTLE(), start, h=1.0 / steps, steps=steps, compiled=False, progress=False)
        errors.append(np.abs([run.joint(0).angle[-1] - wanted[0], run.joint(0).rate[-1] - wanted[1]]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1) and errors[1] < 2e-3
    assert run.joint("strut").angle == pytest.approx(np.hypot(run.joint(0).angle, b), rel=1e-14)


@pytest.mark.slow
def test_a_strut_pushes_both_bodies_alike_and_its_work_is_the_change_of_the_energy() -> None:
    joints: Any = [BallJoint(1, 0, A, B), Strut(1, 0, [0.5, 0.0, -0.3], [-0.4, 0.3, 0.1], name="strut")]
    pair = Linkage(LINKS, joints, 0.0, [Spring("strut", 30.0, 0.4), Damper("strut", 0.9)])
    start = pair.state(angles={0: [0.3, 0.5, -0.2]}, rates={0: [1.0, -2.0, 0.5]})
    laws = lm.check_system(pair, start)
    assert {laws[law].verdict for law in ("force", "load", "constraints stay")} == {"holds"}
    misses = []
    for h in (0.01, 0.005):
        run = lm.integrate(pair, lm.LieRATTLE(), start, h=h, t_end=0.2, compiled=False, progress=False)
        assert run.drift()["spatial momentum"].largest < 1e-13
        damper = run.joint("strut").only(Damper)
        misses.append(np.abs(run.energy - run.energy[0] - damper.work).max())
    assert damper.work[-1] < -0.01 and np.log2(misses[0] / misses[1]) == pytest.approx(2.0, abs=0.2)
    spring = run.joint("strut").only(Spring)
    stretched = 0.5 * 30.0 * (spring.angle - 0.4) ** 2
    assert spring.work == pytest.approx(stretched[0] - stretched, abs=1e-2)


def test_a_start_is_of_joints_and_a_strut_has_the_length_that_is_asked_for() -> None:
    joints: Any = [UniversalJoint(0, None, A, B), Strut(0, None, B, [0.0, 0.0, 2.0], name="strut")]
    with_strut, without = Linkage(LINKS[:1], joints), Linkage(LINKS[:1], joints[:1])
    rates: Any = {0: [0.4, 0.0]}
    both = [linkage.state(angles={0: [0.3, -0.2]}, rates=rates) for linkage in (with_strut, without)]
    assert np.array(both[0].mu) == pytest.approx(np.array(both[1].mu), abs=1e-14)
    assert np.array(both[0].g) == pytest.approx(np.array(both[1].g), abs=1e-14)
    start = with_strut.state(angles={"strut": 1.7}, rates={"strut": 0.6})
    at = with_strut.motion_at(None, 1).at
    assert np.array(at.angles(0.0, start.g)) == pytest.approx([1.7], rel=1e-12)
    assert np.array(at.rates(0.0, start.g, with_strut.velocity(start.mu))) == pytest.approx([0.6], rel=1e-12)
    plan = lm.PiecewisePolynomial.cubic([0.0, 1.0], [1.7, 1.8])
    with pytest.raises(lm.errors.InvalidInput, match="a Strut, has no coordinates that could follow a path"):
        Linkage(LINKS[:1], joints, motions={"strut": plan})


def test_where_points_meet_nothing_pushes() -> None:
    joints: Any = [BallJoint(0, None, [0, 0, 0], [0, 0, 0]), Strut(0, None, [0, 0, 0], [0, 0, 0], name="strut")]
    body = Linkage(LINKS[:1], joints, 0.0, [Spring("strut", 30.0, 0.4), Damper("strut", 0.9)])
    start = body.state(angles={0: [0.1, 0.0, 0.3]}, rates={0: [1.0, 2.0, 3.0]})
    assert not np.array(body.force(start.g)).any()
    run = lm.integrate(body, lm.LieRATTLE(), start, h=0.01, steps=3, compiled=False, progress=False)
    assert not run.joint("strut").angle.any() and np.isfinite(run.mu).all()
