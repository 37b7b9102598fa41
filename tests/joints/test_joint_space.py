"""The mass matrix, torques and accelerations of trees of joints, beside Pinocchio, energies and motions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.joints import (
    BallJoint,
    Damper,
    FixedJoint,
    FloatingJoint,
    Link,
    Linkage,
    Mimic,
    Motor,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    Shaking,
    Spring,
    UniversalJoint,
)

PUMA = Path(__file__).parent.parent.parent / "examples" / "puma560.urdf"
LOW, TOP, ACROSS, UP = [0.1, 0.0, -0.5], [0.0, 0.2, 0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]

Q, U, RATE = [0.3, -0.5, 0.7, 0.2, -0.4, 0.6], [0.5, -0.3, 0.8, 1.1, -0.7, 0.9], [1.0, -2.0, 0.5, 3.0, -1.5, 2.5]
PINOCCHIO: dict[str, Any] = {  # of Pinocchio 4.1.0: crba, rnea, the frame Jacobian LOCAL_WORLD_ALIGNED of "flange"
    "mass matrix": [
        2.693590026161337, 0.17331546274850929, -0.13678618977044985, 0.0019345648999728286, -0.0005553859992691851,
        3.914097676154675e-05, 1.6298591653869217, 0.12168384830811377, 4.863556871196005e-05, 0.0014219157736524621,
        -3.0946192586312583e-06, 0.36162253322930565, 0.00011061605834210238, 0.0017747111478262436, -3.0946192586312583e-06,
        0.0016706568858191884, 7.81526189025108e-20, 3.6842439760115405e-05, 0.0006421599999999999, 8.881784197001253e-21, 4e-05,
    ],
    "torques": [
        1.9035769404036302, 28.50524566439089, -1.5890224270241964, 0.006365272256457853, 0.0027700912941869063,
        0.00023009793479160455,
    ],
    "Jacobian": [
        [0.05083561446234029, -0.21037444588966409, -0.4081443344335247, 0.0, 0.0, 0.0],
        [0.3434109758636731, -0.06507644210521123, -0.12625383771308235, 0.0, 0.0, 0.0],
        [0.0, 0.3130500847171327, -0.06589006550713025, 0.0, 0.0, 0.0],
        [0.0, 0.29552020666133955, 0.29552020666133955, -0.18979606097868734, 0.4756422535966453, 0.15966507665025084],
        [0.0, -0.955336489125606, -0.955336489125606, -0.058710801693826524, -0.8787528690858148, 0.13037263763269366],
        [1.0, 0.0, 0.0, 0.9800665778412417, 0.03946950299855768, 0.9785244190386687],
    ],
}  # fmt: skip


def tree(*forces: Any, gravity: float = 9.0, **more: Any) -> Linkage:
    """Seven bodies: a hinge with a rotor, a slider, a Cardan joint, a ball, a weld that is given the other way round, a plane
    and a hinge on it.
    """
    joints = [
        RevoluteJoint(0, None, LOW, TOP, ACROSS, ACROSS, armature=0.3),
        PrismaticJoint(1, 0, LOW, TOP, UP),
        UniversalJoint(2, 1, LOW, TOP, ACROSS, [0.0, 1.0, 0.0]),
        BallJoint(0, 3, TOP, LOW),
        FixedJoint(3, 4, TOP, LOW),
        PlanarJoint(5, None, LOW, TOP, UP, UP),
        RevoluteJoint(5, 6, TOP, LOW, ACROSS, ACROSS),
    ]
    full = np.array([[0.2, 0.01, 0.02], [0.01, 0.22, 0.03], [0.02, 0.03, 0.24]])
    links = [Link(1.0 + 0.3 * k, full if k == 2 else [0.1, 0.12, 0.15]) for k in range(7)]
    return Linkage(links, joints, gravity, forces, **more)


def state_of(linkage: Linkage, q: Any, u: Any) -> tuple[np.ndarray, np.ndarray]:
    """Momenta and poses of coordinates and rates of all joints."""
    ends = np.cumsum([joint.freedoms for joint in linkage.joints])[:-1]
    parts = [{j: x for j, x in enumerate(np.split(np.asarray(y), ends)) if len(x)} for y in (q, u)]
    state = linkage.state(angles=parts[0], rates=parts[1])
    return np.array(state.mu), np.array(state.g)


def some(linkage: Linkage, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates and rates, and their momenta and poses."""
    q, u = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, linkage.joint_space.freedoms))
    return q, u, *state_of(linkage, q, u)


def test_the_puma_is_that_of_pinocchio() -> None:
    arm = Linkage.from_urdf(PUMA)
    bare = Linkage(arm.links, arm.joints)
    mu, g = state_of(bare, Q, U)
    M = bare.joint_space.mass_matrix(g)
    np.testing.assert_allclose(M[np.triu_indices(6)], PINOCCHIO["mass matrix"], rtol=0.0, atol=1e-14)
    assert np.array_equal(M, M.T)
    torques = bare.joint_space.inverse_dynamics(mu, g, RATE)
    np.testing.assert_allclose(torques, PINOCCHIO["torques"], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(bare.joint_space.forward_dynamics(mu, g, torques), RATE, rtol=0.0, atol=1e-11)
    J = bare.joint_space.jacobian(g, 5, [0.0, 0.0, -0.032])  # its frame is 32 mm from the centre of mass
    np.testing.assert_allclose(np.roll(J, 3, axis=0), PINOCCHIO["Jacobian"], rtol=0.0, atol=1e-14)


def test_the_kinetic_energy_is_half_the_rates_times_the_mass_matrix() -> None:
    linkage = tree(gravity=0.0)
    for seed in range(5):
        _, u, mu, g = some(linkage, seed)
        M = linkage.joint_space.mass_matrix(g)
        assert 0.5 * u @ M @ u == pytest.approx(linkage.energy(mu, g), rel=1e-13)
        assert (np.linalg.eigvalsh(M) > 0.0).all()


@pytest.mark.slow
def test_joints_accelerate_as_the_motion_does() -> None:
    """Rates a step before and after, by a method of order 8, with motors of these torques at the hinges and the slider."""
    torques = {0: 1.5, 1: -2.0, 6: 0.7}
    forces = [Spring(0, 3.0, 0.1), Damper(1, 0.4)]
    linkage, driven = tree(*forces), tree(*forces, *[Motor(j, x) for j, x in torques.items()])
    _, _, mu, g = some(linkage, 1)
    tau = np.zeros(linkage.joint_space.freedoms)
    tau[[0, 1, 10]] = [*torques.values()]
    found = linkage.joint_space.forward_dynamics(mu, g, tau)
    np.testing.assert_allclose(
        linkage.joint_space.inverse_dynamics(mu, g, found), tau, atol=1e-12 * np.abs(found).max()
    )
    differences = []
    for h in (1e-2, 2e-2):
        ends = [
            lm.integrate(driven, lm.RKMK(order=8), driven.state(mu, g), h=way, steps=1, compiled=False).last
            for way in (h, -h)
        ]  # fmt: skip
        after, before = [driven.rates_of(np.array(end.mu), np.array(end.g)) for end in ends]
        differences.append((after - before) / (2.0 * h))
    errors = [np.abs(found - x).max() for x in differences]
    by_four = (4.0 * differences[0] - differences[1]) / 3.0
    assert errors[0] / errors[1] == pytest.approx(0.25, rel=0.05)
    np.testing.assert_allclose(by_four, found, rtol=0.0, atol=0.02 * errors[0])


def test_torques_that_hold_are_slopes_of_the_energy() -> None:
    linkage = tree(Spring(0, 3.0, 0.1), Spring(1, 20.0))
    q, u, _, _ = some(linkage, 2)
    mu, g = state_of(linkage, q, 0.0 * u)
    held, hinges = linkage.joint_space.gravity_torque(g), [0, 1, 2, 3, 7, 8, 9, 10]  # rates of the ball are no slopes
    np.testing.assert_allclose(held, linkage.joint_space.bias(mu, g), rtol=0.0, atol=1e-14 * np.abs(held).max())
    for i in hinges:
        step = np.zeros_like(q)
        step[i] = 1e-3
        V = [linkage.energy(*state_of(linkage, q + k * step, 0.0 * u)) for k in (-2, -1, 1, 2)]
        slope = (V[0] - 8.0 * V[1] + 8.0 * V[2] - V[3]) / 12e-3
        assert held[i] == pytest.approx(slope, abs=1e-9 * np.abs(held).max())


def test_points_of_links_move_by_their_jacobians() -> None:
    linkage, point = tree(), np.array([0.3, -0.1, 0.2])
    _, u, mu, g = some(linkage, 3)
    for link in range(7):
        R = linkage.poses(g)[link, :3, :3]
        w, v = np.split(linkage.velocity(mu)[6 * link : 6 * link + 6], 2)
        wanted = [*(R @ w), *(R @ (v + np.cross(w, point)))]
        np.testing.assert_allclose(linkage.joint_space.jacobian(g, link, point) @ u, wanted, atol=1e-14)
    J = linkage.joint_space.jacobian([g, g], 3, point)
    assert J.shape == (2, 6, len(u)) and np.array_equal(J[1], linkage.joint_space.jacobian(g, 3, point))
    for wrong in (point[:2], [0.0, np.nan, 0.0]):
        with pytest.raises(lm.errors.InvalidInput, match="point"):
            linkage.joint_space.jacobian(g, 3, wrong)
    for size in (1, 12):
        with pytest.raises(lm.errors.InvalidInput, match="accelerations has shape"):
            linkage.joint_space.inverse_dynamics(mu, g, np.ones(size))


def test_a_body_that_floats_is_the_root_of_a_tree() -> None:
    links = [Link(2.0, [0.1, 0.2, 0.25], name="trunk"), Link(1.0, [0.02, 0.02, 0.01])]
    flies = Linkage(links, [FloatingJoint(0, None), RevoluteJoint(1, 0, LOW, TOP, UP, UP)], 0.0)
    _, _, mu, g = some(flies, 4)
    tau = np.array([0.0] * 6 + [0.5])
    rates = flies.joint_space.forward_dynamics(mu, g, tau)
    J = [flies.joint_space.jacobian(g, b) for b in ("trunk", 1)]
    momentum = sum(link.mass * (J_b @ rates)[3:] for link, J_b in zip(links, J))
    shift = flies.joint_space.bias(mu, g)  # with no torque at the root the linear momentum stands still
    assert len(rates) == 7 and np.linalg.norm(momentum) > 1e-3 and np.linalg.norm(shift) > 1e-3
    poses, parts = flies.poses(g), np.asarray(mu).reshape(2, 6)
    spins, pushes = [
        np.array([pose[:3, :3] @ x[half] for pose, x in zip(poses, parts)]) for half in (slice(3), slice(3, 6))
    ]
    places, centre = poses[:, :3, 3], np.average(poses[:, :3, 3], axis=0, weights=[2.0, 1.0])
    about_centre = (spins + np.cross(places - centre, pushes)).sum(axis=0)
    np.testing.assert_allclose(flies.centroidal_momentum(mu, g), [*about_centre, *pushes.sum(axis=0)], atol=1e-15)


@pytest.mark.compiled
@pytest.mark.slow
def test_arrays_of_states_give_a_row_for_each() -> None:
    linkage, rng = tree(Damper(0, 0.2)), np.random.default_rng(5)
    n, (_, _, mu, g) = 300, some(linkage, 6)
    rates = rng.normal(size=(n, linkage.joint_space.freedoms))
    many = linkage.joint_space.inverse_dynamics(np.tile(mu, (n, 1)), np.tile(g, (n, 1)), rates)
    M, b = linkage.joint_space.mass_matrix(np.tile(g, (n, 1))), linkage.joint_space.bias(mu, g)
    np.testing.assert_allclose(many, rates @ M[0] + b, rtol=0.0, atol=1e-13 * np.abs(many).max())
    assert np.array_equal(M[-1], linkage.joint_space.mass_matrix(g))


@pytest.mark.parametrize(
    ("why", "linkage"),
    [
        ("a given motion", tree(motions={1: Shaking([0.0, 0.0, 0.1], 5.0)})),
        ("loops", Linkage([Link(1.0, [0.1] * 3)], [BallJoint(0, None, LOW, LOW), BallJoint(0, None, TOP, TOP)])),
        ("hang from nothing", Linkage([Link(1.0, [0.1] * 3)] * 2, [BallJoint(0, 1, LOW, TOP)])),
    ],
)
def test_where_rates_depend_on_each_other_there_is_no_joint_space(why: str, linkage: Linkage) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=why):
        linkage.joint_space  # noqa: B018


def test_mimics_have_no_joint_space_of_their_own() -> None:
    hinge = [RevoluteJoint(b, None, LOW, TOP, UP, UP, name=name, armature=0.1) for b, name in enumerate("ab")]
    gears = Linkage([Link(1.0, [0.1] * 3)] * 2, hinge, mimics=[Mimic("b", "a", -1.0)])
    with pytest.raises(lm.errors.InvalidInput, match="a Mimic"):
        gears.joint_space  # noqa: B018
