"""Joints: their derivatives, what they leave free, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag
from shipped import JOINTS, A, B

import liemech as lm
from liemech import errors
from liemech.joints.joints import Joints, across
from liemech.joints.link import Link
from liemech.joints.linkage import _inertia
from liemech.rooms.constraints.conditions import connections, pulled, speeds
from liemech.rooms.constraints.constrained_body import _separate
from liemech.rooms.constraints.constraint import Constraint


@pytest.mark.parametrize("name", JOINTS)
def test_written_derivatives_are_derived_ones(name):
    joint, freedom = JOINTS[name]
    group, joints = lm.ProductGroup(lm.SE3(), lm.SE3()), Joints((joint,))
    g = group.random(7)
    written, derived = (np.array(joints.jacobian(group, g)), np.array(Constraint.jacobian(joints, group, g)))
    assert np.allclose(written, derived, rtol=0.0, atol=1e-15 * np.abs(derived).max(initial=0.0) * 16)
    assert len(written) == joint.conditions == 6 - freedom


@pytest.mark.parametrize("name", [name for name, (joint, _) in JOINTS.items() if joint.freedoms and joint.places])
def test_a_long_shift_is_no_turn(name):
    """A coordinate of 7 is 7 m where it is a shift, and 7 - 2 pi where the joint says that it turns."""
    joint, _ = JOINTS[name]
    k = lm.SE3().random(3)
    for i in range(joint.freedoms):
        q = np.zeros(joint.freedoms)
        q[i] = 7.0
        turns = i in joint.angles or i in joint.rotation_vector
        seen = joint.coordinates(k @ joint.relative(q), k)
        assert np.allclose(seen, q - 2.0 * np.pi * (q != 0.0) * turns, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("joint", "velocity"),
    [
        # the second body turns about the hinge, slides along its axis, or does both turns of a
        # Cardan joint
        (lm.joints.RevoluteJoint(0, 1, [0, 0, 0], [0, 0, -1], [1, 0, 0], [1, 0, 0]), [1, 0, 0, 0, 1, 0]),
        (lm.joints.PrismaticJoint(0, 1, [0, 0, 0], [0, 0, -1], [0, 0, 1]), [0, 0, 0, 0, 0, 1]),
        (lm.joints.UniversalJoint(0, 1, [0, 0, 0], [0, 0, -1], [1, 0, 0], [0, 1, 0]), [0, 1, 0, -1, 0, 0]),
        (lm.joints.UniversalJoint(0, 1, [0, 0, 0], [0, 0, -1], [1, 0, 0], [0, 1, 0]), [1, 0, 0, 0, 1, 0]),
    ],
)
def test_what_a_joint_leaves_free(joint, velocity):
    # The second body 1 m above the first one, both parallel: v = w x r with r = e3.
    group, joints = lm.ProductGroup(lm.SE3(), lm.SE3()), Joints((joint,))
    g = np.array([np.eye(4), np.eye(4)])
    g[1, 2, 3] = 1.0
    w, v = np.array(velocity[:3], dtype=float), np.array(velocity[3:], dtype=float)
    if w.any():
        v = np.cross(w, [0.0, 0.0, 1.0])
    c, G = np.array(joints.value(g.ravel())), np.array(joints.jacobian(group, g.ravel()))
    assert not c.any()
    assert np.allclose(G @ [0, 0, 0, 0, 0, 0, *w, *v], 0.0, rtol=0.0, atol=1e-15)
    assert np.linalg.matrix_rank(G) == joint.conditions


@pytest.mark.parametrize(
    "axis", [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.0, 0.8], [-0.48, 0.64, -0.6], [0.0, 1.0, 0.0]]
)
def test_directions_across_an_axis(axis):
    frame = np.array([*across(lm.Vec(*axis)), axis])
    assert np.allclose(frame @ frame.T, np.eye(3), rtol=0.0, atol=1e-15)


def test_a_slider_falls_along_its_axis():
    # A block on an inclined rail without friction: half g sin(slope) t^2 along it, exactly for a
    # method of order 2.
    slope = 0.5
    rail = [np.cos(slope), 0.0, -np.sin(slope)]
    block = lm.joints.Linkage(
        [lm.joints.Link(3.0, [0.1, 0.2, 0.2])], [lm.joints.PrismaticJoint(0, None, axis=rail)], 9.81
    )
    start = block.assembled([np.eye(4)])
    run = lm.integrate(block, lm.LieRATTLE(), start, h=0.1, steps=10, compiled=False, progress=False)
    end = block.poses(run.g[-1])[0]
    assert np.allclose(end[:3, 3], 0.5 * 9.81 * np.sin(slope) * np.array(rail), rtol=0.0, atol=1e-13)
    assert np.allclose(end[:3, :3], np.eye(3), rtol=0.0, atol=1e-14)


def test_a_chain_of_three_hangs_still():
    hanging = lm.joints.chain(3, mass=0.5, length=0.4)
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 2, 3] = [-0.2, -0.6, -1.0]
    start = hanging.assembled(poses)
    run = lm.integrate(hanging, lm.LieRATTLE(), start, h=0.1, steps=5, compiled=False, progress=False)
    assert np.allclose(run.g[-1], np.array(start.g), rtol=0.0, atol=1e-15)
    pulls = np.array(hanging.multipliers(start.mu, start.g)).reshape(3, 3)
    weight = 0.5 * hanging.gravity
    assert np.allclose(pulls[:, 2], [-3 * weight, -2 * weight, -weight], rtol=1e-13)


def test_what_is_no_joint_is_refused():
    with pytest.raises(lm.errors.InvalidInput, match="first and second are both 1"):
        lm.joints.BallJoint(1, 1)
    with pytest.raises(lm.errors.InvalidType, match="first is the number of a body"):
        lm.joints.BallJoint(-1, 0)
    with pytest.raises(lm.errors.InvalidInput, match="axis_first must have a direction"):
        lm.joints.RevoluteJoint(0, 1, A, B, [0, 0, 0], [0, 0, 1])
    with pytest.raises(lm.errors.InvalidInput, match=r"at_first must be a vector in space, \(3,\)"):
        lm.joints.BallJoint(0, 1, [1.0, 2.0])
    with pytest.raises(lm.errors.InvalidInput, match="two points in one place are a BallJoint"):
        lm.joints.RigidRod(0, 1, A, B, 0.0)
    link = lm.joints.Link(1.0, [0.1, 0.1, 0.1])
    with pytest.raises(lm.errors.InvalidInput, match="holds body 1; there are 1, numbered from 0"):
        lm.joints.Linkage([link], [lm.joints.BallJoint(0, 1)])
    with pytest.raises(lm.errors.InvalidType, match="links is a list of one or more Links"):
        lm.joints.Linkage([1.0], [lm.joints.BallJoint(0, None)])
    with pytest.raises(lm.errors.InvalidType, match="joints is a list of one or more Joints"):
        lm.joints.Linkage([link], lm.joints.BallJoint(0, None))
    with pytest.raises(lm.errors.InvalidType, match="mass must be real numbers"):
        lm.joints.Link("heavy", [0.1, 0.1, 0.1])
    with pytest.raises(lm.errors.InvalidInput, match="mass must be a positive number"):
        lm.joints.Link(0.0, [0.1, 0.1, 0.1])
    with pytest.raises(lm.errors.InvalidInput, match=r"poses has shape \(4, 4\); 2 bodies have \(2, 4, 4\)"):
        lm.joints.chain(2).assembled(np.eye(4))


@pytest.mark.parametrize("kind", [np.int64, np.uint8, np.array])
def test_numbers_of_joints_are_whole_numbers_of_any_kind(kind: Any) -> None:
    def arm(of: Any) -> lm.joints.Linkage:
        links = [lm.joints.Link(1.0, [0.1, 0.2, 0.2])] * 2
        hinges = [lm.joints.RevoluteJoint(of(0), None, A, B, A, A), lm.joints.RevoluteJoint(of(1), of(0), A, B, A, A)]
        forces = [lm.joints.Spring(of(1), 2.0, freedom=of(0)), lm.joints.Damper(of(0), 0.1)]
        return lm.joints.Linkage(links, hinges, forces=forces)

    plain, of_numpy = arm(int), arm(int if kind is np.array else kind)
    assert of_numpy == plain and repr(of_numpy) == repr(plain)
    start = of_numpy.state(angles={np.int64(0): 0.3, np.int64(1): -0.2})
    assert start == plain.state(angles={0: 0.3, 1: -0.2})
    run = lm.integrate(of_numpy, lm.LieRATTLE(), start, h=0.01, steps=1, compiled=False)
    assert np.array_equal(run.joint(kind(1)).angle, run.joint(1).angle)
    assert np.array_equal(run.link(kind(1)).pose, run.link(1).pose)
    for number in (None, True, 1.0, np.float64(1.0), np.arange(2)):
        with pytest.raises(lm.errors.InvalidInput, match="there is no joint"):
            run.joint(number)
    with pytest.raises(lm.errors.InvalidInput, match="there is no joint None"):
        plain.state(angles={None: 0.3})


def test_a_body_at_rest_in_a_field_may_have_a_momentum_of_rounding():
    """Beside the speed that the weight gives it, in any units; a speed that is none of rounding is refused."""
    for mass, length in ((1.0, 1.0), (1e-3, 1e3)):  # kg and m, or g and mm
        unit = mass * length**2
        link = lm.joints.Link(mass, [unit, 1.2 * unit, 1.5 * unit])
        joint = lm.joints.RevoluteJoint(
            0, None, [0.0, 0.0, 0.5 * length], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]
        )
        pendulum = lm.joints.Linkage([link], [joint], 9.81 * length)
        g = np.eye(4)
        g[2, 3] = -0.5 * length
        for i in range(6):
            mu = np.zeros(6)
            mu[i] = 1e-17 * (unit if i < 3 else mass * length)
            assert pendulum.state(mu, g.ravel()).mu[i] == mu[i]
        with pytest.raises(errors.InconsistentState):
            pendulum.state(1e12 * mu, g.ravel())


def test_pulls_are_the_transpose_of_speeds_and_leave_a_body_without_joints_alone() -> None:
    rng, touches = np.random.default_rng(3), [(0, 2), (2,), (2, 4)]
    rows = [[lm.vec(*rng.normal(size=6)) for _ in row] for row in touches]
    system: Any = SimpleNamespace(**connections(touches, 5), places=[(6 * b, 6 * b + 6) for b in range(5)])
    impulses, xi = lm.vec(*rng.normal(size=3)), lm.vec(*rng.normal(size=30))
    pull = np.array(pulled(system, rows, impulses))
    assert pull.shape == (30,)
    assert not pull[6:12].any() and not pull[18:24].any()
    assert np.isclose(pull @ xi, np.dot(impulses, speeds(system, rows, xi)), rtol=1e-13)


def test_full_and_diagonal_inertias_of_links_stand_in_blocks() -> None:
    full = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, 0.2], [0.1, 0.2, 1.0]])
    flat = np.array([0.9, 1.1, 1.2])
    links = Link(inertia=full, mass=0.7), Link(inertia=flat, mass=1.3), Link(inertia=full, mass=2.0)
    wanted = block_diag(full, 0.7 * np.eye(3), np.diag(flat), 1.3 * np.eye(3), full, 2.0 * np.eye(3))
    assert np.array_equal(_inertia(links), wanted)
    assert np.array_equal(np.diag(_inertia(links[1:2])), wanted[6:12, 6:12])


def test_bodies_are_apart_unless_an_inertia_joins_two_of_them() -> None:
    group, inertia = (lm.ProductGroup(lm.SE3(), lm.SE3()), block_diag(np.eye(6) + 0.1, 2.0 * np.eye(6) + 0.1))
    assert _separate(group, inertia) and _separate(group, np.diag(inertia))
    inertia[2, 8] = inertia[8, 2] = 0.1
    assert not _separate(group, inertia)
