"""The same mechanism in other units of length moves the same way, and keeps its conditions to rounding of its lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, NoConvergence
from liemech.joints import BallJoint, Link, Linkage, RevoluteJoint, Spring, UniversalJoint


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


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3])
def test_any_unit_of_length(count: int) -> None:
    wanted, _ = moved(count, 1.0)
    for length in (1e-12, 1e-9, 1e-6, 1e3, 1e12):
        g, conditions = moved(count, length)
        assert np.abs(g - wanted).max() < 2e-15
        assert conditions.max() < 1e-15


def four_bar(length: float) -> tuple[Linkage, np.ndarray]:
    """A crank, a coupler and a rocker in a plane, and poses near by at which the crank stands upright."""
    turn, crank, coupler, rocker, ground = [0, 1, 0], 0.3 * length, 0.8 * length, 0.6 * length, 0.9 * length
    links = [Link.rod(mass, x, 0.1 * x) for mass, x in ((1.0, crank), (2.0, coupler), (1.5, rocker))]
    joints = [
        RevoluteJoint(0, None, [0, 0, -crank / 2], [0, 0, 0], turn, turn, name="crank"),
        BallJoint(1, 0, [0, 0, -coupler / 2], [0, 0, crank / 2]),
        RevoluteJoint(2, None, [0, 0, -rocker / 2], [ground, 0, 0], turn, turn, name="rocker"),
        UniversalJoint(1, 2, [0, 0, coupler / 2], [0, 0, rocker / 2], [1, 0, 0], turn),
    ]
    poses = np.stack([np.eye(4)] * 3)
    for pose, angle in zip(poses, (0.0, 1.25, 0.0)):
        pose[:3, :3] = lm.SO3().exp([0.0, angle, 0.0])
    poses[:, :3, 3] = length * np.array([[0.0, 0.0, 0.15], [0.4, 0.0, 0.4], [0.9, 0.0, 0.3]])
    return Linkage(links, joints), poses


@pytest.mark.parametrize("length", [1.0, 1e-6, 1e-9, 1e-12, 1e6, 1e9])
def test_a_loop_takes_the_rates_that_it_is_given(length: float) -> None:
    linkage, near = four_bar(length)
    start = linkage.state(angles={"crank": 0.1}, rates={"crank": 1.0}, near=near)
    poses, xi = linkage.poses(start.g), np.reshape(linkage.velocity(start.mu), (3, 6))
    crank, coupler, rocker = np.arctan2(poses[:, 0, 2], poses[:, 2, 2])
    # the ends of the coupler are equally fast along it
    wanted = 0.3 * np.sin(crank - coupler) / (0.6 * np.sin(rocker - coupler))
    assert np.abs(xi[[0, 2], 1] - [1.0, wanted]).max() < 1e-13
    with pytest.raises(InvalidInput, match="do not allow these rates"):
        linkage.state(angles={"crank": 0.1}, rates={"crank": 1.0, "rocker": wanted + 1e-6}, near=near)
    with pytest.raises(NoConvergence, match="miss by"):
        linkage.state(angles={"crank": 0.1, "rocker": rocker + 1e-4}, near=near)


@pytest.mark.parametrize("length", [1.0, 1e-9, 1e9])
def test_conditions_that_depend_are_told_from_dead_points(length: float) -> None:
    """Of four hinges in a plane three conditions follow from others, everywhere; where crank and coupler are in line with
    the rocker a fourth does, and not close by.
    """
    turn, crank, coupler, ground = [0, 1, 0], 0.3 * length, 0.8 * length, 0.9 * length
    rocker = crank + coupler - ground
    lying = np.stack([np.eye(4)] * 3)
    lying[:, :3, :3] = lm.SO3().exp([0.0, 0.5 * np.pi, 0.0])
    lying[:, 0, 3] = [0.5 * crank, crank + 0.5 * coupler, ground + 0.5 * rocker]
    links = [Link.rod(1.0, x, 0.1 * x) for x in (crank, coupler, rocker)]
    joints = [
        RevoluteJoint(0, None, [0, 0, -crank / 2], [0, 0, 0], turn, turn, armature=0.01 * length**2),
        RevoluteJoint(1, 0, [0, 0, -coupler / 2], [0, 0, crank / 2], turn, turn),
        RevoluteJoint(2, None, [0, 0, -rocker / 2], [ground, 0, 0], turn, turn),
        RevoluteJoint(1, 2, [0, 0, coupler / 2], [0, 0, rocker / 2], turn, turn),
    ]
    with pytest.raises(InvalidInput, match="these poses are a dead point"):
        Linkage(links, joints).independent(lying)
    whole, near = four_bar(length)
    hinge = RevoluteJoint(1, 0, [0, 0, -coupler / 2], [0, 0, crank / 2], turn, turn)
    last = RevoluteJoint(1, 2, [0, 0, coupler / 2], [0, 0, 0.3 * length], turn, turn)
    loop = Linkage(whole.links, [joints[0], hinge, whole.joints[2], last]).independent(near)
    assert len(loop.dropped) == 3 and loop.independent(near).dropped == loop.dropped
