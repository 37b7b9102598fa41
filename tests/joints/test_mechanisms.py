"""Arms with motors, springs and dampers against minimal coordinates, and what joints tell of runs."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shipped
from scipy.integrate import solve_ivp
from shipped import A, B

import liemech as lm
from liemech.joints import (
    BallJoint,
    Damper,
    DryFriction,
    JointForce,
    JointPotential,
    Limited,
    Link,
    Linkage,
    Mimic,
    Motor,
    PrismaticJoint,
    RevoluteJoint,
    RigidRod,
    Spring,
    Stops,
    UniversalJoint,
)

GRAVITY, TURN = 9.80665, [0.0, 1.0, 0.0]


@lm.record
class PD(JointForce):
    """A controller that follows a table, with friction of its own."""

    stiffness: float
    damping: float
    target: lm.PiecewisePolynomial

    def effort(self, t: float, q: float, rate: float) -> float:
        return self.stiffness * (self.target(t) - q) - self.damping * rate

    def about(self, t: float) -> float:
        return self.target(t)


TABLE = lm.PiecewisePolynomial.cubic([0.0, 0.5, 1.0, 2.0], [0.1, 0.7, -0.4, 0.3])


class Arm:
    """A planar arm of rods, each on a hinge at the end of the one before, in minimal coordinates.

    The absolute angles phi obey sum_j a_ij (cos(phi_i - phi_j) phi_j'' + sin(phi_i - phi_j) phi_j'^2)
    = tau_i - tau_i+1 - g_i sin phi_i.
    """

    def __init__(self, masses: Any, lengths: Any, forces: list[Any], radius: float = 0.05) -> None:
        self.masses, self.lengths, self.forces = np.array(masses), np.array(lengths), forces
        n = len(masses)
        reach = np.tril(np.tile(self.lengths, (n, 1)), -1) + np.diag(0.5 * self.lengths)
        about = self.masses * (3.0 * radius**2 + self.lengths**2) / 12.0
        self.a = reach.T @ (self.masses[:, None] * reach) + np.diag(about)
        self.weights = GRAVITY * self.masses @ reach
        links = [Link.rod(m, x, radius) for m, x in zip(masses, lengths, strict=True)]
        top, low = [[0.0, 0.0, 0.5 * x] for x in lengths], [[0.0, 0.0, -0.5 * x] for x in lengths]
        joints = [
            RevoluteJoint(k, k - 1 if k else None, top[k], low[k - 1] if k else [0.0] * 3, TURN, TURN,
                name=f"hinge {k}")
            for k in range(n)
        ]  # fmt: skip
        self.linkage = Linkage(links, joints, GRAVITY, forces)

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        n = len(self.a)
        q, v = y[:n], y[n:]
        phi, w = np.cumsum(q), np.cumsum(v)
        tau = np.zeros(n + 1)
        for force in self.forces:
            k = self.linkage.number(force.joint)
            tau[k] += force.effort(t, float(q[k]), float(v[k]))
        apart = phi[:, None] - phi
        push = tau[:n] - tau[1:] - self.weights * np.sin(phi) - (self.a * np.sin(apart)) @ w**2
        alpha = np.linalg.solve(self.a * np.cos(apart), push)
        return np.concatenate([v, np.diff(alpha, prepend=0.0)])

    def at(self, t: float, q: Any, v: Any) -> np.ndarray:
        found = solve_ivp(self.rate, (0.0, t), np.concatenate([q, v]), "DOP853", rtol=1e-13, atol=1e-13)
        return found.y[:, -1]

    def start(self, q: Any, v: Any) -> Any:
        names = [joint.name for joint in self.linkage.joints]
        return self.linkage.state(angles=dict(zip(names, q, strict=True)), rates=dict(zip(names, v, strict=True)))


@functools.cache
def arm(links: int = 2) -> Arm:
    """Two or three links with a force of every kind."""
    forces = [
        Spring("hinge 0", 2.0, 0.3),
        Damper("hinge 0", 0.2),
        Motor("hinge 1", 0.7),
        Motor(0, TABLE),
        DryFriction("hinge 1", 0.1, 0.5),
        PD("hinge 1", 1.0, 0.1, TABLE),
        Stops("hinge 0", -2.0, 0.1, 30.0),
    ]
    more = [Damper("hinge 2", 0.05), Spring(2, 1.0, -0.2)] if links == 3 else []
    return Arm([1.0, 0.6, 0.4][:links], [1.0, 0.7, 0.5][:links], forces + more)


START = {2: ([0.4, -0.3], [1.0, 0.5]), 3: ([0.4, -0.3, 0.2], [1.0, 0.5, -0.7])}


def run(system: Any, method: Any, start: Any, h: float, steps: int, **more: Any) -> Any:
    return lm.integrate(system, method, start, h=h, steps=steps, compiled=False, progress=False, **more)


def coordinates(moved: Any) -> np.ndarray:
    """The angles and rates of all joints at the last sample."""
    joints = [moved.joint(k) for k in range(len(moved.system.joints))]
    return np.array([x[-1] for x in [j.angle for j in joints] + [j.rate for j in joints]])


# ------------------------------------------------------------------ against minimal coordinates


@pytest.mark.slow
@pytest.mark.parametrize("links", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_reduced_equation_is_that_of_minimal_coordinates(links: int) -> None:
    it = arm(links)
    moved = run(it.linkage, lm.RKMK(order=6), it.start(*START[links]), 0.0025, 20)
    assert coordinates(moved) == pytest.approx(it.at(0.05, *START[links]), rel=0.0, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("links", [2, 3])
def test_the_variational_motion_is_that_of_minimal_coordinates(links: int) -> None:
    it = arm(links)
    moved = run(it.linkage, lm.Composition(lm.LieRATTLE(), order=6), it.start(*START[links]), 0.15 / 80, 80)
    assert coordinates(moved) == pytest.approx(it.at(0.15, *START[links]), rel=0.0, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_orders_with_forces_at_joints(order: int) -> None:
    it = arm()
    method = lm.LieRATTLE() if order == 2 else lm.Composition(lm.LieRATTLE(), order=4)
    exact, start, errors = it.at(0.3, *START[2]), it.start(*START[2]), []
    for n in (10, 20) if order == 2 else (20, 40):
        errors.append(np.abs(coordinates(run(it.linkage, method, start, 0.3 / n, n)) - exact).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


@pytest.mark.slow
def test_energy_is_the_work_of_motors_and_dampers() -> None:
    """What springs and stops do is in the energy; the balance is of the order of the method."""
    it, missed = arm(), []
    for n in (10, 20):
        moved = run(it.linkage, lm.LieRATTLE(), it.start(*START[2]), 0.3 / n, n)
        work = sum(moved.joint(k).work - moved.joint(k).only(JointPotential).work for k in range(2))
        assert np.abs(work).max() > 0.1
        missed.append(np.abs(moved.energy - moved.energy[0] - work).max())
    assert missed[1] < 5e-3 and np.log2(missed[0] / missed[1]) == pytest.approx(2.0, abs=0.3)
    stored = [f for f in it.forces if isinstance(f, JointPotential)]
    spring = moved.joint(0).only(Spring)
    taken = 0.5 * 2.0 * (np.array(moved.joint(0).angle) - 0.3) ** 2
    # the rate at a node is q' up to O(h^2)
    assert len(stored) == 2 and np.allclose(spring.work, taken[0] - taken, rtol=0.0, atol=1e-3)


@pytest.mark.slow
def test_springs_alone_keep_the_energy() -> None:
    it = Arm([1.0, 0.6], [1.0, 0.7], [Spring("hinge 0", 20.0, 0.3), Stops("hinge 1", -0.1, 0.1, 50.0)])
    moved = run(it.linkage, lm.LieRATTLE(), it.start(*START[2]), 0.02, 40)
    assert moved.drift()["energy"].largest < 4e-3
    assert it.linkage.body.load is None


# ------------------------------------------------------------------ what joints tell


@lm.record
class Constant(JointForce):
    torque: float

    def effort(self, t: float, q: float, rate: float) -> float:
        return self.torque


@pytest.mark.slow
def test_angles_go_on_over_several_turns_in_long_steps() -> None:
    """A disk that is driven from rest: angle = torque t^2/(2 J), 14 rad between samples at the end."""
    disk = Linkage([Link(1.0, [0.1, 0.1, 0.2])], [RevoluteJoint(0, None, name="shaft")], 0.0, [Constant("shaft", 0.8)])
    moved = run(disk, lm.LieRATTLE(), disk.state(angles={}), 0.02, 500, every=50)
    assert np.allclose(moved.joint("shaft").angle, 2.0 * moved.t**2, rtol=1e-12, atol=1e-12)
    assert moved.joint("shaft").angle[-1] > 30.0 * 2.0 * np.pi
    assert np.allclose(moved.joint("shaft").work, 0.8 * moved.joint("shaft").angle, rtol=1e-12)
    assert np.allclose(moved.energy, moved.joint("shaft").work, rtol=1e-12)


@pytest.mark.parametrize("bodies", [1, 2])
def test_work_goes_on_behind_a_jump(bodies: int) -> None:
    """A disk that is driven by 0.8 N m, and whose rate is doubled at 0.1 rad: work = torque times angle, of two disks too."""
    disk = Linkage([Link(1.0, [0.1, 0.1, 0.2])], [RevoluteJoint(0, None, name="shaft")], 0.0, [Constant("shaft", 0.8)])
    kick = lm.Jump(disk.angle("shaft", 0.1), lambda t, state: disk.state(mu=2.0 * np.array(state.mu), g=state.g))
    start = disk.state(angles={"shaft": 0.0}, rates={"shaft": 0.3})
    if bodies > 1:
        start = disk.state(mu=np.outer([1.0, 2.0], start.mu), g=np.tile(start.g, (2, 1)))
    moved = lm.integrate(disk, lm.LieRATTLE(), start, h=0.02, steps=20, events=kick, compiled=False)
    shaft = moved.joint("shaft")
    assert shaft.angle[-1].min() > 0.2 and (np.diff(moved.t, axis=0) == 0.0).any()
    assert shaft.work == pytest.approx(0.8 * shaft.angle, rel=1e-9, abs=1e-15)


def test_a_joint_carries_what_hangs_on_it() -> None:
    still = lm.joints.chain(3, mass=0.5, length=0.4, axis=TURN)
    moved = run(still, lm.LieRATTLE(), still.state(angles={}), 0.1, 2)
    for k in range(3):
        assert moved.joint(k).reaction[-1] == pytest.approx([0.0, 0.0, (3 - k) * 0.5 * GRAVITY])
        assert moved.joint(k).moment[-1] == pytest.approx([0.0] * 3)
    held = Linkage(
        [Link(2.0, [0.1, 0.1, 0.1])],
        [PrismaticJoint(0, None, axis=[1.0, 0.0, 0.0], at_first=[-0.5, 0.0, 0.0], name="rail")],
        forces=[Motor("rail", 3.0)],
    )
    pushed = run(held, lm.LieRATTLE(), held.state(rates={"rail": 0.5}), 0.1, 4)
    rail = pushed.joint("rail")
    assert rail.angle == pytest.approx(0.5 * pushed.t + 0.75 * pushed.t**2)
    assert np.allclose(rail.reaction, [0.0, 0.0, 2.0 * GRAVITY], rtol=1e-12, atol=1e-12)
    assert np.allclose(rail.moment, [0.0, -0.5 * 2.0 * GRAVITY, 0.0], rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_members_of_an_ensemble_have_joints_too() -> None:
    it = arm()
    one, other = it.start(*START[2]), it.start([0.1, 0.2], [0.0, 0.0])
    both = it.linkage.state(np.stack([one.mu, other.mu]), np.stack([one.g, other.g]))
    moved, alone = (run(it.linkage, lm.LieRATTLE(), s, 0.02, 5) for s in (both, one))
    for name in ("angle", "rate", "torque", "power", "work", "reaction"):
        assert np.allclose(getattr(moved.joint(1), name)[:, 0], getattr(alone.joint(1), name), rtol=1e-13, atol=1e-13)


JOINTS = {name: joint for name, (joint, _) in shipped.JOINTS.items() if joint.freedoms and joint.conditions}


@pytest.mark.parametrize("name", JOINTS)
def test_states_have_the_coordinates_and_rates_that_were_asked_for(name: str) -> None:
    joint = JOINTS[name]
    both = Linkage([Link(1.0, [0.1, 0.2, 0.15]), Link(2.0, [0.3, 0.2, 0.25])], [joint])
    q, v = np.random.default_rng(4).normal(size=(2, joint.freedoms)) * 0.7
    start = both.state(angles={0: q}, rates={0: v})
    at = both.motion_at(None, 0).at
    assert np.array(at.angles(0.0, start.g)) == pytest.approx(q, abs=1e-14)
    assert np.array(at.rates(0.0, start.g, both.velocity(start.mu))) == pytest.approx(v, abs=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("name", JOINTS)
def test_springs_and_dampers_fit_every_joint(name: str) -> None:
    """Forces are gradients of energies, power is what load does; between two bodies momenta are kept."""
    joint = JOINTS[name]
    forces = [Spring(0, 2.0), Damper(0, 0.3)]
    both = Linkage([Link(1.0, [0.1, 0.2, 0.15]), Link(2.0, [0.3, 0.2, 0.25])], [joint], 0.0, forces)
    q, v = 0.5 * np.random.default_rng(4).normal(size=(2, joint.freedoms))
    start = both.state(angles={0: q}, rates={0: v})
    laws = lm.check_system(both, start)
    assert {laws[law].verdict for law in ("force", "load", "constraints stay")} == {"holds"}
    moved = run(both, lm.LieRATTLE(), start, 0.02, 5)
    if joint.second is not None:
        assert moved.drift()["spatial momentum"].largest < 1e-13
    assert moved.energy[-1] < moved.energy[0]
    assert (moved.joint(0).only(Damper).power <= 0.0).all()


@pytest.mark.slow
def test_a_bushing_is_springs_and_dampers_between_two_bodies() -> None:
    """A FloatingJoint has no conditions and six motions."""
    joints = [UniversalJoint(0, None, A, B), lm.joints.FloatingJoint(1, 0, B, A, name="bushing")]
    forces = [Spring("bushing", 2.0), Damper("bushing", 0.3), Damper("bushing", 1.0, freedom=4)]
    links = [Link(1.0, [0.1, 0.2, 0.15]), Link(2.0, [0.3, 0.2, 0.25])]
    both = Linkage(links, joints, 0.0, forces)
    q, v = 0.5 * np.random.default_rng(4).normal(size=(2, 6))
    start = both.state(angles={"bushing": q}, rates={"bushing": v, 0: [0.3, -0.4]})
    at = both.motion_at(None, 1).at
    assert np.array(at.angles(0.0, start.g)) == pytest.approx(q, abs=1e-14)
    assert np.array(at.rates(0.0, start.g, both.velocity(start.mu))) == pytest.approx(v, abs=1e-13)
    laws = lm.check_system(both, start)
    assert {laws[law].verdict for law in ("force", "load", "constraints stay")} == {"holds"}
    with pytest.raises(lm.errors.InvalidInput, match="no joint takes away a freedom"):
        Linkage(links, [lm.joints.FloatingJoint(0, 1)])


# ------------------------------------------------------------------ loops


LENGTHS = np.array([0.3, 0.9, 0.7])
ENDS = np.array([[0.0, 0.0, 0.0], [0.15, 0.0, 0.26], [0.94, 0.0, 0.70], [1.0, 0.0, 0.0]])


def four_bar(normal: Any = None, ground: float = 1.0) -> tuple[Linkage, np.ndarray]:
    """Crank, coupler and rocker, with hinges in space at all four joints; the plane may be turned."""
    low, high = np.outer(LENGTHS, [0.0, 0.0, -0.5]), np.outer(LENGTHS, [0.0, 0.0, 0.5])
    R = np.array(lm.SO3().exp([0.0, 0.0, 0.0] if normal is None else normal))
    ends = ENDS * [ground, 1.0, 1.0] @ R.T
    turn = R @ TURN
    linkage = Linkage(
        [Link.rod(x, x, 0.02) for x in LENGTHS],
        [
            RevoluteJoint(0, None, low[0], ends[0], TURN, turn, name="crank"),
            RevoluteJoint(1, 0, low[1], high[0], TURN, TURN, name="pin"),
            RevoluteJoint(2, 1, high[2], high[1], TURN, TURN, name="rocker pin"),
            RevoluteJoint(2, None, low[2], ends[3], TURN, turn, name="rocker"),
        ],
        forces=[Motor("crank", 0.5), Damper("rocker", 0.1)],
    )
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, 3] = (ends[1:] + ends[:-1]) / 2
    for k, pose in enumerate(poses):
        d = (ends[k + 1] - ends[k]) * (-1.0 if k == 2 else 1.0)
        d /= np.linalg.norm(d)
        pose[:3, :3] = np.transpose([np.cross(turn, d), turn, d])
    return linkage, poses


@pytest.mark.slow
@pytest.mark.parametrize("normal", [None, [0.7, -0.4, 0.2]])
def test_a_four_bar_of_spatial_hinges_runs(normal: Any) -> None:
    whole, poses = four_bar(normal)
    with pytest.raises(lm.errors.InvalidInput, match="rank 17 here; those of joint 'crank', joint"):
        whole.assembled(poses)
    linkage = whole.independent(poses)
    assert len(linkage.dropped) == 3
    assert all(name.startswith("joint 'rocker': condition ") for name in linkage.dropped)
    start = linkage.state(angles={"crank": 0.5}, rates={"crank": 2.0}, near=poses)
    assert np.array(linkage.motion_at(None, "crank").at.angles(0.0, start.g)) == pytest.approx(
        [np.remainder(0.5 + np.pi, 2 * np.pi) - np.pi]
    )
    moved = run(linkage, lm.LieRATTLE(), start, 0.01, 20)
    missed = [np.array(whole.constraint.value(lm.vec(*g.tolist()))) for g in moved.g]
    assert np.abs(missed).max() < 1e-14  # those that were left out hold too
    work = moved.joint("crank").work + moved.joint("rocker").work
    # O(h^2) of a crank that turns at 7 rad/s
    assert np.abs(moved.energy - moved.energy[0] - work).max() < 5e-3
    # the loop: the angles of a closed chain add up
    q = {j: moved.joint(j).angle for j in ("crank", "pin", "rocker pin", "rocker")}
    around = q["crank"] + q["pin"] + q["rocker pin"] - q["rocker"]
    assert np.allclose(around, around[0], rtol=0.0, atol=1e-13)


@pytest.mark.slow
def test_a_dead_point_is_told_by_its_joints() -> None:
    """A parallelogram can fold flat, where it may go on in two ways."""
    low, high = [0.0, 0.0, -0.5], [0.0, 0.0, 0.5]
    links = [Link.rod(1.0, 1.0, 0.02)] * 3
    joints = [
        RevoluteJoint(0, None, low, [0.0, 0.0, 0.0], TURN, TURN, name="left"),
        RevoluteJoint(1, 0, low, high, TURN, TURN, name="top left"),
        RevoluteJoint(2, 1, high, high, TURN, TURN, name="top right"),
        RevoluteJoint(2, None, low, [1.0, 0.0, 0.0], TURN, TURN, name="right"),
    ]
    flat = Linkage(links, joints, 0.0)
    poses = np.tile(np.eye(4), (3, 1, 1))
    along = np.transpose([[0.0, 0.0, -1.0], TURN, [1.0, 0.0, 0.0]])
    poses[:, :3, :3] = along
    poses[:, 0, 3] = [0.5, 1.5, 1.5]
    with pytest.raises(lm.errors.InvalidInput, match="dead point"):
        flat.independent(poses)
    # a little before, on the way to it
    angle = 0.3
    d = np.array([np.sin(angle), 0.0, np.cos(angle)])
    poses[0, :3, :3] = poses[2, :3, :3] = np.transpose([np.cross(TURN, d), TURN, d])
    poses[:, :3, 3] = [0.5 * d, d + [0.5, 0.0, 0.0], 0.5 * d + [1.0, 0.0, 0.0]]
    linkage = flat.independent(poses)
    start = linkage.state(angles={"left": angle}, rates={"left": 1.0}, near=poses)
    with pytest.raises(lm.errors.IntegrationFailure, match=r"joint '.*depend on each other") as told:
        run(linkage, lm.LieRATTLE(), start, (np.pi / 2 - angle) / 12.5, 25)
    assert 10 <= len(told.value.trajectory.t) <= 14


# ------------------------------------------------------------------ borders


def test_what_does_not_fit_a_joint_is_refused() -> None:
    links, joints = [Link(1.0, [0.1, 0.1, 0.1])], [RevoluteJoint(0, None, name="door")]
    for force, message in (
        (Damper("gate", 0.1), "there is no joint 'gate'; there are 1, numbered from 0, with the names 'door'"),
        (Damper("door", 0.1, freedom=1), "freedom 1 of joint 'door'; a RevoluteJoint has 1"),
    ):  # fmt: skip
        with pytest.raises(lm.errors.InvalidInput, match=message):
            Linkage(links, joints, forces=[force])
    with pytest.raises(lm.errors.InvalidInput, match="RigidRod, which has no coordinates"):
        Linkage(links, [RigidRod(0, None)], forces=[Spring(0, 1.0)])
    with pytest.raises(lm.errors.InvalidType, match="a Force on the bodies is load="):
        Linkage(links, joints, forces=[lm.Force()])
    with pytest.raises(lm.errors.InvalidType, match="load must be a Force"):
        Linkage(links, joints, load=3.0)
    with pytest.raises(lm.errors.InvalidInput, match="two of the joints have the name 'door'"):
        Linkage(links, joints * 2)
    with pytest.raises(lm.errors.InvalidInput, match="low must be below high"):
        Stops("door", 1.0, 0.5, 1.0)
    with pytest.raises(lm.errors.InvalidInput, match="at joint 'door': its limits are a whole turn and more apart"):
        Linkage(links, joints, forces=[Stops("door", -4.0, 4.0, 1.0)])
    with pytest.raises(
        lm.errors.InvalidInput, match="a BallJoint: the torque of a Spring is no function of one coordinate"
    ):
        Linkage(links, [BallJoint(0, None)], forces=[Limited(0, Spring(0, 1.0), 1.0)])
    with pytest.raises(lm.errors.InvalidInput, match="speed must be positive"):
        DryFriction("door", 1.0, 0.0)
    with pytest.raises(lm.errors.InvalidInput, match="torque is a number or a PiecewisePolynomial"):
        Motor("door", np.inf)
    door = Linkage(links, joints)
    with pytest.raises(lm.errors.InvalidInput, match=r"angles\['door'\] has shape \(2,\); a Rev"):
        door.state(angles={"door": [1.0, 2.0]})
    with pytest.raises(lm.errors.InvalidInput, match="not both"):
        door.state(np.zeros(6), np.eye(4).ravel(), angles={"door": 1.0})
    moved = run(door, lm.LieRATTLE(), door.state(angles={"door": 1.0}), 0.1, 2)
    with pytest.raises(lm.errors.InvalidInput, match="there is no joint 'gate'"):
        moved.joint("gate")
    body = lm.RigidBody([1.0, 1.5, 2.0])
    free = lm.integrate(body, lm.RKMK(order=4), body.state([0.1, 0.2, 0.3], np.eye(3)), h=0.1, steps=2)
    with pytest.raises(lm.errors.InvalidInput, match="has no joints"):
        free.joint("door")


@lm.record
class Wind(lm.Force):
    """A push on the first body that grows with time, with drag on both."""

    push: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(0.0, 0.0, 0.0, self.push * t, *[0.0 for _ in range(8)]) - 0.1 * xi


@pytest.mark.slow
def test_loads_on_bodies_and_forces_at_joints_together() -> None:
    it = arm()
    windy = Linkage(it.linkage.links, it.linkage.joints, GRAVITY, it.forces, load=Wind(2.0))
    start = it.start(*START[2])
    exact = run(windy, lm.RKMK(order=6), start, 0.02, 5).g[-1]
    errors = [np.abs(run(windy, lm.LieRATTLE(), start, 0.1 / n, n).g[-1] - exact).max() for n in (4, 8)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.slow
@pytest.mark.compiled
def test_forces_at_joints_compile() -> None:
    it = arm()
    start = it.start(*START[2])
    plain, native = (
        lm.integrate(it.linkage, lm.LieRATTLE(), start, h=0.02, steps=10, compiled=c, progress=False)
        for c in (False, True)
    )
    assert np.array_equal(plain.mu, native.mu) and np.array_equal(plain.g, native.g)


@lm.record
class Pushed(lm.Force):
    push: lm.PiecewisePolynomial

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(self.push(t), *[0.0 for _ in range(5)])


@pytest.mark.slow
@pytest.mark.compiled
def test_tables_compile_where_elements_have_constant_entries() -> None:
    """Poses have a last row (0, 0, 0, 1), which carries no rest in compensated sums."""
    table = lm.PiecewisePolynomial.constant([0.0, 0.45, 1.0], [1.0, -1.0])
    free = lm.models.KirchhoffBody([1.0, 1.5, 0.7, 2.0, 2.0, 2.0])
    body = lm.MechanicalSystem(free, lm.NoPotential(), load=Pushed(table))
    plain, native = (
        lm.integrate(body, lm.LieVerlet(), body.state(np.ones(6), np.eye(4)), h=0.1, steps=8, compiled=c)
        for c in (False, True)
    )
    assert native.compiled
    assert np.array_equal(plain.mu, native.mu) and np.array_equal(plain.g, native.g)


# ------------------------------------------------------------------ dry friction


def rubbing(count: int, speed: float) -> Linkage:
    """Hinges in a row under dry friction of 1 and 2 N m in turn."""
    rods = lm.joints.chain(count, axis=[0.0, 1.0, 0.0])
    return Linkage(rods.links, rods.joints, forces=[DryFriction(k, 1.0 + k % 2, speed) for k in range(count)])


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1e-2, 1e-4, 1e-8])
def test_friction_stops_at_any_speed(speed: float) -> None:
    # Newton's corrections jump over the bend; 0.01 rad/s with h = 0.01 was refused once. Friction
    # takes energy away at every sample, and never gives any.
    linkage = rubbing(5, speed)
    start = linkage.state(angles=dict.fromkeys(range(5), 0.6))
    run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.01, steps=60, compiled=True)
    for k in range(5):
        motion = run.joint(k)
        assert np.all(motion.power <= 0.0)
        assert np.allclose(motion.torque, -(1.0 + k % 2) * np.tanh(motion.rate / speed))
    assert run.energy[-1] < run.energy[0] - 1.0
    plain = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.01, steps=6, compiled=False)
    assert np.array_equal(plain.mu, run.mu[:7]) and np.array_equal(plain.g, run.g[:7])


@pytest.mark.slow
def test_friction_of_few_joints_is_that_of_loops() -> None:
    # Two bodies are written out, and have the same equations: a third one hangs beside them.
    linkage = rubbing(2, 1e-6)
    alone = lm.integrate(
        linkage, lm.LieRATTLE(), linkage.state(angles={0: 0.6, 1: 0.6}), h=0.01, steps=30,
        compiled=False,
    )  # fmt: skip
    third = lm.joints.RevoluteJoint(2, None, [0, 0, 0.5], [5, 0, 0], TURN, TURN)
    more = Linkage([*linkage.links, linkage.links[0]], [*linkage.joints, third],
                   forces=linkage.forces)  # fmt: skip
    start = more.state(angles={0: 0.6, 1: 0.6})
    beside = lm.integrate(more, lm.LieRATTLE(), start, h=0.01, steps=30, compiled=False)
    for k in range(2):
        assert np.abs(alone.joint(k).angle - beside.joint(k).angle).max() < 1e-9
        assert np.abs(alone.joint(k).rate - beside.joint(k).rate).max() < 1e-7


@pytest.mark.slow
def test_friction_at_no_speed_is_that_of_coulomb() -> None:
    # A wheel under M < T that begins with w is braked by T - M and stands still from J w/(T - M) on, at
    # J w^2/(2 (T - M)): exactly while it slips, to h^2 from where it sticks on.
    J, torque, w = 0.5, 2.0, 3.0
    up, end = [0.0, 0.0, 1.0], J * w / (torque - 0.5)
    missed = {}
    for speed, h in ((1e-2, 0.01), (1e-4, 0.01), (1e-6, 0.01), (1e-6, 0.005)):
        wheel = Linkage(
            [Link(1.0, [J, J, J])],
            [lm.joints.RevoluteJoint(0, None, axis_first=up, axis_second=up)],
            forces=[DryFriction(0, torque, speed), Motor(0, 0.5)],
        )
        start = wheel.state(angles={0: 0.0}, rates={0: w})
        run = lm.integrate(wheel, lm.LieRATTLE(), start, h=h, steps=round(2.0 / h), compiled=True)
        t, q = run.t, run.joint(0).angle
        slips = w * t - (torque - 0.5) / (2.0 * J) * t * t
        off = np.abs(q - np.where(t < end, slips, 0.5 * w * end))
        assert speed > 1e-3 or off[t < end - h].max() < 1e-14
        assert np.abs(run.joint(0).rate[t > end + 0.1]).max() < 5.0 * speed
        missed[speed, h] = off.max()
    assert missed[1e-4, 0.01] < 0.1 * missed[1e-2, 0.01]
    assert abs(np.log2(missed[1e-6, 0.01] / missed[1e-6, 0.005]) - 2.0) < 0.05


def test_a_wound_spring_is_refused() -> None:
    rod = lm.joints.chain(1, axis=TURN)
    hung = Linkage(rod.links, rod.joints, forces=[Spring(0, 3.0, rest=1.0), Damper(0, 0.1)])
    with pytest.raises(lm.errors.InvalidInput, match="so that nothing is wound"):
        hung.state(angles={0: 9.0})
    assert hung.state(angles={0: 4.0}) is not None and hung.state(angles={}) is not None


# ------------------------------------------------------------------ rotors of motors


def turret(armatures: Any, forces: Any = ()) -> Linkage:
    """Three bodies on hinges across each other, with the armatures of their motors."""
    axes = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.6, 0.8]]
    moments = [[0.1, 0.12, 0.02], [0.05, 0.06, 0.03], [0.04, 0.03, 0.05]]
    ends = [([0, 0, 0.5], [0, 0, 0]), ([0, 0, 0.4], [0, 0, -0.5]), ([0.1, 0, 0.3], [0, 0, -0.4])]
    joints = [
        RevoluteJoint(k, k - 1 if k else None, *ends[k], axes[k], axes[k], armature=armatures[k]) for k in range(3)
    ]
    links = [Link(1.0 - 0.2 * k, J) for k, J in enumerate(moments)]
    return Linkage(links, joints, forces=forces)


@pytest.mark.slow
def test_armature_of_one_hinge_is_inertia_about_its_axis() -> None:
    ends = [0, 0, 0.5], [0, 0, 0], TURN, TURN
    geared = Linkage([Link(1.0, [0.1, 0.1, 0.02])], [RevoluteJoint(0, None, *ends, armature=0.3)])
    heavy = Linkage([Link(1.0, [0.1, 0.4, 0.02])], [RevoluteJoint(0, None, *ends)])
    runs = [
        lm.integrate(one, lm.LieRATTLE(), one.state(angles={0: 1.0}, rates={0: 2.0}), h=0.01,
                     steps=50, compiled=False)
        for one in (geared, heavy)
    ]  # fmt: skip
    one, two = (run.joint(0) for run in runs)
    assert np.abs(one.angle - two.angle).max() < 1e-14
    assert np.abs(one.rate - two.rate).max() < 1e-13
    assert np.abs(one.reaction - two.reaction).max() < 1e-12
    assert np.abs(runs[0].energy - runs[1].energy).max() < 1e-13


@pytest.mark.slow
def test_armature_has_its_orders_and_keeps_the_energy() -> None:
    loads = [Damper(1, 0.1), DryFriction(2, 0.1, 0.3), Spring(0, 2.0)]
    for method, h, forces in ((lm.LieRATTLE(), 0.01, loads), (lm.Composition(lm.LieRATTLE(), order=4), 0.02, ())):
        arm = turret([0.1, 0.0, 0.4], forces)
        start = arm.state(angles={0: 0.5, 1: -0.7, 2: 1.0}, rates={0: 1.0, 1: 2.0, 2: -3.0})
        ends = []
        for k in range(3):
            steps = round(0.5 / h) * 2**k
            run = lm.integrate(arm, method, start, h=h / 2**k, steps=steps, every=steps // 25)
            ends.append([run.joint(j).angle[-1] for j in range(3)])
        change = np.abs(np.diff(ends, axis=0)).max(axis=1)
        assert abs(np.log2(change[0] / change[1]) - method.order) < 0.02
    assert np.ptp(run.energy) < 1e-6 * np.abs(run.energy).max()


def accelerations(arm: Linkage, start: Any) -> np.ndarray:
    """q'' of hinges in a row, by index reduction."""
    rate, mu = np.array(arm.rate(0.0, start)), lm.vec(*start.mu)
    pull = np.array(arm.configurations.ad_star(arm.velocity(mu), mu)) + rate[len(rate) // 2 :]
    speed = np.array(arm.velocity(lm.vec(*pull)))
    return np.array([
        sum(
            np.dot(row, speed[6 * b : 6 * b + 6])
            for row, b in zip(joint.motions(np.eye(4), np.eye(4))[0], (k, k - 1))
            if b >= 0
        )
        for k, joint in enumerate(arm.joints)
    ])  # fmt: skip


@pytest.mark.slow
def test_arm_with_armature_moves_as_in_mujoco() -> None:
    # MuJoCo 4.0: qacc at the start, and qpos after 0.5 s by RK4, which is the same for steps of 1, 0.5
    # and 0.25 ms to all digits.
    arm = turret([0.1, 0.0, 0.4])
    start = arm.state(angles={0: 0.5, 1: -0.7, 2: 1.0}, rates={0: 1.0, 1: 2.0, 2: -3.0})
    wanted = [-4.496765043454654, 6.618789454998185, -1.03467372398506]
    assert np.abs(accelerations(arm, start) - wanted).max() < 1e-12
    run = lm.integrate(arm, lm.Composition(lm.LieRATTLE(), order=4), start, h=1e-3, steps=500, every=500)
    ends = [run.joint(k).angle[-1] for k in range(3)]
    there = [0.515340383662783, 0.5884677592061478, -0.649759561598089]
    assert np.abs(np.array(ends) - there).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(
    "mimics, start, wanted, there",
    [
        (
            [Mimic(2, 0, -0.7, 0.3)],
            {"angles": {0: 0.5, 1: -0.7}, "rates": {0: 1.0, 1: 2.0}},
            [-4.256129609317897, 6.6640986949694625, 0.7 * 4.256129609317897],
            [0.5151042014044096, 0.6156631327711216],
        ),
        (
            [Mimic(2, 0, -0.7, 0.3), Mimic(1, 0, 0.5, 0.1)],
            {"angles": {0: 0.5}, "rates": {0: 1.0}},
            [-3.0249557423998126, -0.5 * 3.0249557423998126, 0.7 * 3.0249557423998126],
            [0.5546222961879044, 0.5 * 0.5546222961879044 + 0.1],
        ),
    ],
)
def test_joints_that_follow_others_move_as_in_minimal_coordinates(
    mimics: Any, start: Any, wanted: Any, there: Any
) -> None:
    # MuJoCo's mass matrix M with armature, and bias, reduced to the free coordinates, q = G y + g:
    # G^T M G y'' = -G^T bias, by SciPy's DOP853 at 1e-13.
    arm = turret([0.1, 0.0, 0.4])
    arm = Linkage(arm.links, arm.joints, mimics=mimics)
    begun = arm.state(**start)
    assert np.abs(accelerations(arm, begun) - wanted).max() < 1e-12
    run = lm.integrate(arm, lm.Composition(lm.LieRATTLE(), order=4), begun, h=2e-3, steps=250, every=10)
    q = [run.joint(k).angle for k in range(3)]
    assert np.abs(np.array([q[k][-1] for k in range(len(there))]) - there).max() < 1e-11
    assert np.abs(q[2] - (0.3 - 0.7 * q[0])).max() < 1e-13
    assert np.ptp(run.energy) < 1e-9 * np.abs(run.energy).max()
    once = lm.integrate(arm, lm.Composition(lm.LieRATTLE(), order=4), begun, h=2e-3, steps=2, compiled=False)
    twice = lm.integrate(arm, lm.Composition(lm.LieRATTLE(), order=4), begun, h=2e-3, steps=2)
    assert np.array_equal(once.mu, twice.mu) and np.array_equal(once.g, twice.g)


@pytest.mark.parametrize("count", [2, 3])
def test_starts_at_which_gears_would_slip_are_refused_and_mended(count: int) -> None:
    """The nearest start moves by the ratio, and gears of it do not slip along a run."""
    rods = lm.joints.chain(count, axis=TURN)
    joints = [replace(rods.joints[0], armature=0.1, name="a"), replace(rods.joints[1], name="b"), *rods.joints[2:]]
    free, geared = Linkage(rods.links, joints), Linkage(rods.links, joints, mimics=[Mimic("b", "a", 2.0)])
    slips = free.state(angles={"a": 0.3, "b": 0.6}, rates={"a": 1.0, "b": -3.0})
    with pytest.raises(lm.errors.InconsistentState, match=r"joint 'b' moves 2 times as fast as joint 'a'.* by -5"):
        geared.state(slips.mu, slips.g)
    moved = geared.assembled(free.poses(slips.g), np.reshape(free.velocity(slips.mu), (count, 6)))
    inverse, change = free._inverse, np.array(moved.mu) - np.array(slips.mu)
    if hasattr(inverse, "toarray"):
        inverse = inverse.toarray()
    for rates in ({"a": 0.4}, *[{2: 0.7}] * (count - 2)):  # the nearest in kinetic energy: across all that is left
        other = np.array(geared.state(angles={"a": 0.3}, rates=rates).mu)
        assert abs(other @ inverse @ change) < 1e-12 * np.sqrt((other @ inverse @ other) * (change @ inverse @ change))
    run = lm.integrate(geared, lm.LieRATTLE(), moved, h=1e-3, steps=4, compiled=False)
    assert run.joint("b").rate == pytest.approx(2.0 * run.joint("a").rate, rel=1e-12)
    again = geared.state(run.mu[-1], run.g[-1])
    assert np.array_equal(again.mu, run.mu[-1])


def test_joints_that_cannot_follow_are_refused() -> None:
    arm = turret([0.0, 0.0, 0.0])
    with pytest.raises(lm.errors.InvalidInput, match="joint 2 follows joint 0 by gears, and their"):
        Linkage(arm.links, arm.joints, mimics=[Mimic(2, 0)])
    arm = turret([0.1, 0.0, 0.0])
    for mimic, one in (
        (Mimic("wrst", 0), "'wrst'"),
        (Mimic(2, "elbw"), "'elbw'"),
        (Mimic(7, 0), "7"),
        (Mimic(0, 7), "7"),
    ):
        with pytest.raises(lm.errors.InvalidInput, match=f"there is no joint {one}; there are 3, numbered from 0"):
            Linkage(arm.links, arm.joints, mimics=[mimic])
    for given in ({"ratio": np.nan}, {"ratio": np.inf}, {"offset": np.nan}):
        with pytest.raises(lm.errors.InvalidInput, match="finite"):
            Mimic(2, 0, **given)
    moved = {2: lm.joints.Shaking([0.0, 0.0, 0.1], 3.0)}
    with pytest.raises(lm.errors.InvalidInput, match="joint 2 is in a given motion"):
        Linkage(arm.links, arm.joints, mimics=[Mimic(2, 0)], motions=moved)
    for mimics in ([Mimic(0, 0)], [Mimic(1, 0), Mimic(2, 1)], [Mimic(1, 0), Mimic(1, 2)]):
        with pytest.raises(lm.errors.InvalidInput, match="let all follow one that leads"):
            Linkage(arm.links, arm.joints, mimics=mimics)
    follows = Linkage(arm.links, arm.joints, mimics=[Mimic(2, 0)])
    with pytest.raises(lm.errors.InvalidInput, match="joint 2 follows another joint; leave it out"):
        follows.state(angles={2: 1.0})


def test_motors_within_their_limits() -> None:
    # Without gravity: 5 N m up to nine tenths of the speed, then a rate that creeps up to it.
    motor = Limited(0, Motor(0, 20.0), 5.0, 0.5)
    ends = [0, 0, 0.5], [0, 0, 0], TURN, TURN
    arm = Linkage([Link(1.0, [0.1, 0.75, 0.02])], [RevoluteJoint(0, None, *ends)], 0.0, [motor])
    run = lm.integrate(arm, lm.LieRATTLE(), arm.state(angles={}), h=0.01, steps=60, compiled=False)
    joint, t = run.joint(0), run.t
    assert np.abs(joint.rate - 5.0 * t)[t < 0.09 - 1e-9].max() < 1e-14
    assert np.all(joint.torque <= 5.0) and np.all(joint.rate < 0.5 + 1e-14)
    assert joint.rate[-1] > 0.499
    braking = Limited(0, Motor(0, -20.0), 5.0, 0.5)
    assert braking.effort(0.0, 0.0, 0.49) == -5.0 and braking.effort(0.0, 0.0, -0.6) == 0.0
    for given, said in (((0, Motor(0, 1.0), 0.0), "limit must be"), ((0, 3.0, 1.0), "given is a")):
        with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=said):
            Limited(*given)  # type: ignore[arg-type]


def test_armature_that_does_not_fit_is_refused() -> None:
    with pytest.raises(lm.errors.InvalidInput, match="armature must be 0 or more"):
        RevoluteJoint(0, None, armature=-1.0)
    arm = turret([0.1, 0.0, 0.4])
    with pytest.raises(lm.errors.InvalidInput, match="joint 0 has an armature and is in a given"):
        Linkage(arm.links, arm.joints, motions={0: TABLE})


@pytest.mark.slow
def test_the_momentum_of_a_free_pair_has_that_of_its_rotor() -> None:
    # On a turntable the rotor takes part: J w + A q' about the axis is kept, J w alone is not.
    up = [0.0, 0.0, 1.0]
    joints = [
        RevoluteJoint(0, None, [0, 0, 0], [0, 0, 0], up, up, armature=0.4),
        RevoluteJoint(1, 0, [0.3, 0, 0], [0.2, 0, 0], [0, 1, 0], [0, 1, 0], armature=0.1),
        RevoluteJoint(2, 1, [0, 0, 0.2], [-0.1, 0, 0], up, up, armature=0.2),
    ]
    links = [Link(1.0, [0.1, 0.2, 0.3]), Link(0.5, [0.1, 0.12, 0.1]), Link(0.3, [0.02, 0.03, 0.01])]
    table = Linkage(links, joints, 0.0)
    start = table.state(angles={1: 0.5, 2: 0.3}, rates={0: 2.0, 1: 1.0, 2: -3.0})
    run = lm.integrate(table, lm.LieRATTLE(), start, h=0.01, steps=40, compiled=False)
    whole = table.total_momentum(run.mu, run.g)[:, 2]
    assert np.ptp(whole) < 1e-13 * np.abs(whole).max()
    bodies = Linkage(links, [replace(one, armature=0.0) for one in joints], 0.0)
    alone = bodies.total_momentum(run.mu, run.g)[:, 2]
    assert np.abs(whole - alone - 0.4 * run.joint(0).rate).max() < 1e-13
    assert np.ptp(alone) > 1e-3
    assert str(run.drift()).split("spatial momentum")[1].split()[0] == "exact"


@pytest.mark.slow
def test_rotors_beside_a_joint_in_a_given_motion() -> None:
    arm = turret([0.0, 0.2, 0.3])
    shaken = Linkage(arm.links, arm.joints, motions={0: lm.joints.Shaking([0.0, 0.0, 0.05], 20.0)})
    start, ends = shaken.state(angles={0: 0.5}, rates={1: 2.0, 2: -3.0}), []
    for k in range(3):
        steps = 10 * 2**k
        run = lm.integrate(shaken, lm.LieRATTLE(), start, h=0.1 / steps, steps=steps, compiled=False)
        ends.append([run.joint(j).angle[-1] for j in range(3)])
    change = np.abs(np.diff(ends, axis=0)).max(axis=1)
    assert abs(np.log2(change[0] / change[1]) - 2.0) < 0.05
