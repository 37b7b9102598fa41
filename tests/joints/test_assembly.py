"""Mechanisms are put together as their joints say: bodies turned over, where conditions vanish too, are no start."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech import errors
from liemech.joints import (
    BallJoint,
    FixedJoint,
    Link,
    Linkage,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    UniversalJoint,
)

TOP, BOTTOM, Z = [0.0, 0.0, 0.5], [0.0, 0.0, -0.5], [0.0, 0.0, 1.0]
LINKS = [Link(1.0, [0.1, 0.12, 0.15])] * 2


def hanging(joint):
    """A body that hangs from the origin, and another one on it."""
    return Linkage(LINKS, [BallJoint(0, None, TOP, [0.0, 0.0, 0.0]), joint])


def placed(turn, at=(0.0, 0.0, -1.0)):
    """The first body upright below the origin, the second one turned, its top at a point of space."""
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[0, :3, 3] = BOTTOM
    poses[1, :3, :3] = turn
    poses[1, :3, 3] = np.array(at) - turn @ TOP
    return poses


def relative_turn(linkage, state):
    """The rotation of the second body, seen from the first."""
    first, second = linkage.poses(state.g)[:, :3, :3]
    return first.T @ second


WELDS = {
    "weld": lambda attitude: FixedJoint(1, 0, TOP, BOTTOM, attitude, name="weld"),
    "slider": lambda attitude: PrismaticJoint(1, 0, TOP, BOTTOM, Z, attitude, name="weld"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", WELDS)
@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_random_attitudes_are_assembled_and_never_turned_over(kind, count):
    """Bodies that stand upright and are to be held at any attitude: attitude^T, to rounding."""
    turns = Rotation.random(count, random_state=42).as_matrix()
    apart = []
    for turn in turns:
        linkage = hanging(WELDS[kind](turn.tolist()))
        start = linkage.assembled(placed(np.eye(3)))
        apart.append(np.abs(relative_turn(linkage, start) - turn.T).max())
    assert max(apart) < 1e-8


@pytest.mark.parametrize("kind", WELDS)
@pytest.mark.parametrize(
    ("turn", "degrees"),
    [(np.roll(np.eye(3), 1, axis=1), "120"), (np.diag([1.0, -1.0, -1.0]), "180"), (np.diag([-1.0, -1.0, 1.0]), "180")],
)
def test_a_weld_or_slider_turned_over_is_refused_by_name(kind, turn, degrees):
    linkage = hanging(WELDS[kind](np.eye(3).tolist()))
    g = placed(turn).ravel()
    with pytest.raises(errors.InconsistentState, match=rf"joint 'weld'.*{degrees} degrees"):
        linkage.state(mu=np.zeros(12), g=g)
    cure = linkage.assembled(placed(turn))  # which the message names
    assert np.allclose(relative_turn(linkage, cure), np.eye(3), rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("kind", WELDS)
def test_a_quarter_turn_where_conditions_are_dependent_is_assembled(kind):
    linkage = hanging(WELDS[kind](np.eye(3).tolist()))
    start = linkage.assembled(placed(Rotation.from_euler("x", 90.0, degrees=True).as_matrix()))
    assert np.allclose(relative_turn(linkage, start), np.eye(3), rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(
    "joint",
    [RevoluteJoint(1, 0, TOP, BOTTOM, Z, Z, name="axle"), PlanarJoint(1, 0, TOP, BOTTOM, Z, Z, name="axle")],
    ids=["hinge", "plane"],
)
def test_axes_that_are_opposite_are_refused_by_name(joint):
    linkage, over = hanging(joint), placed(np.diag([1.0, -1.0, -1.0]))
    with pytest.raises(errors.InconsistentState, match=r"joint 'axle'.*180 degrees"):
        linkage.state(mu=np.zeros(12), g=over.ravel())
    for tilt in (3.1, 2.5, 2.0):
        start = linkage.assembled(placed(Rotation.from_rotvec([tilt, 0.1, 0.0]).as_matrix()))
        assert np.isclose(relative_turn(linkage, start)[2, 2], 1.0, rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_joints_that_follow_a_path_begin_where_the_path_says():
    """A hinge on a path is held like a weld; whatever poses it is looked for from."""
    path = lm.PiecewisePolynomial([0.0, 1.0], [[0.5]])
    hinge = RevoluteJoint(1, 0, TOP, BOTTOM, Z, Z, name="axle")
    linkage = Linkage(LINKS, [BallJoint(0, None, TOP, [0.0, 0.0, 0.0]), hinge], motions={"axle": path})
    want = linkage.state(angles={}).g
    angle = Rotation.from_matrix(relative_turn(linkage, linkage.state(angles={}))).as_rotvec()
    for turn in Rotation.random(10, random_state=7).as_matrix():
        start = linkage.assembled(placed(turn))
        assert np.allclose(Rotation.from_matrix(relative_turn(linkage, start)).as_rotvec(), angle, rtol=0.0, atol=1e-8)
    over = np.array(want).reshape(2, 4, 4).copy()
    over[1, :3, :3] = over[1, :3, :3] @ np.diag([1.0, -1.0, -1.0])
    over[1, :3, 3] = [0.0, 0.0, -1.0] - over[1, :3, :3] @ TOP
    with pytest.raises(errors.InconsistentState, match=r"joint 'axle'.*180 degrees"):
        linkage.state(mu=np.zeros(12), g=over.ravel())


@pytest.mark.slow
def test_loops_are_never_closed_with_bodies_turned_over():
    """A triangle of a weld and two hinges, from random poses: closed as it should be, or NoConvergence."""
    side = [0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]
    turns = Rotation.from_rotvec(np.outer([0.0, 120.0, 240.0], Z), degrees=True).as_matrix()
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, :3] = turns
    corner = np.zeros(3)
    for pose in poses:
        pose[:3, 3] = corner + pose[:3, :3] @ side[0]
        corner = corner + pose[:3, :3] @ [1.0, 0.0, 0.0]
    joints = [
        RevoluteJoint(1, 0, side[1], side[0], Z, Z),
        FixedJoint(2, 1, side[1], side[0], (turns[2].T @ turns[1]).tolist()),
        RevoluteJoint(2, 0, side[0], side[1], Z, Z),
    ]
    loop = Linkage([LINKS[0]] * 3, joints).independent(poses)
    rng, closed = np.random.default_rng(3), 0
    for size in (0.1, 0.5, 1.0, 2.0, 3.0) * 2:
        near = poses.copy()
        near[:, :3, :3] = near[:, :3, :3] @ Rotation.from_rotvec(size * rng.normal(size=(3, 3)) / 3**0.5).as_matrix()
        for make in (lambda near=near: loop.assembled(near), lambda near=near: loop.state(angles={}, near=near)):
            try:
                R = loop.poses(make().g)[:, :3, :3]
            except errors.NoConvergence:
                continue
            closed += 1
            assert np.allclose(R[1].T @ R[2], turns[1].T @ turns[2], rtol=0.0, atol=1e-7)
            assert np.allclose(R[:, :, 2] @ R[0, :, 2], 1.0, rtol=0.0, atol=1e-7)
    assert closed >= 5


def between_heavy_ones(mass):
    """A rod of this mass in the middle of two of 1 kg."""
    rods = [Link(m, [0.1 * m, 0.1 * m, 0.05 * m]) for m in (1.0, mass, 1.0)]
    y = [0.0, 1.0, 0.0]
    joints = [
        RevoluteJoint(0, None, TOP, [0.0, 0.0, 0.0], y, y),
        UniversalJoint(1, 0, [0.0, 0.0, 0.25], BOTTOM, [1.0, 0.0, 0.0], y),
        BallJoint(2, 1, TOP, [0.0, 0.0, -0.25]),
    ]
    return Linkage(rods, joints)


def swung(linkage):
    """Where the heavy rods are after 0.1 s."""
    start = linkage.state(angles={0: 0.6, 1: [0.3, 0.0], 2: [0.0, -0.2, 0.0]}, rates={0: 1.0})
    run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.02, steps=5, compiled=False, progress=False)
    return linkage.poses(run.g[-1])[[0, 2], :3, 3]


@pytest.mark.slow
def test_a_link_far_lighter_than_what_it_holds_moves_as_the_limit_says():
    """Positions are linear in a mass that goes to zero: m = 1e-6 and 2e-6 give the limit, to m^2."""
    one, two = (swung(between_heavy_ones(mass)) for mass in (1e-6, 2e-6))
    limit = 2.0 * one - two
    assert np.allclose(swung(between_heavy_ones(1e-11)), limit, rtol=0.0, atol=2e-9)


def test_conditions_that_depend_on_each_other_are_told_from_those_of_light_links():
    linkage = between_heavy_ones(1e-11)
    twice = Linkage(linkage.links, [*linkage.joints, BallJoint(2, 1, TOP, [0.0, 0.0, -0.25], name="again")])
    with pytest.raises(errors.InvalidInput, match=r"15 conditions have rank 12 here; .*joint 'again'"):
        twice.state(angles={0: 0.6})
    poses = linkage.poses(linkage.state(angles={0: 0.6}).g)
    assert len(twice.independent(poses).dropped) == 3
