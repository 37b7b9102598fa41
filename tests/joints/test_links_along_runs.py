"""Bodies of a linkage along a run: the load on each, its power and work."""

from dataclasses import replace

import numpy as np
import pytest

import liemech as lm


@lm.record
class Drag(lm.Force):
    """Air that gets thicker."""

    c: float

    def covector(self, t, xi, g):
        """-c (1 + t) xi."""
        return -self.c * (1.0 + t) * xi


@lm.record
class Winds(lm.Force):
    """The same on all bodies by one formula."""

    c: float

    def covector(self, t, xi, g):
        """-c (1 + t) xi."""
        return -self.c * (1.0 + t) * xi


@pytest.mark.parametrize("load", [{1: Drag(0.05), 0: Drag(0.05)}, Winds(0.05)])
def test_energy_changes_by_the_work_of_loads(load):
    rods = lm.joints.chain(2, radius=0.2)
    drag = lm.joints.Linkage(rods.links, rods.joints, load=load)
    start = drag.state(angles={0: [0.5, 0.1, 0.0]}, rates={1: [0.0, 2.0, 0.0]})
    off = []
    for steps in (10, 20):
        run = lm.integrate(drag, lm.LieRATTLE(), start, h=0.2 / steps, steps=steps, compiled=False)
        lost = run.link(0).work[-1] + run.link(1).work[-1]
        off.append(run.energy[-1] - run.energy[0] - lost)
    assert lost < -1e-3 and abs(off[1]) < 1e-3 * abs(lost)
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.2)
    assert np.array_equal(run.link(1).pose[:, 3], [[0.0, 0.0, 0.0, 1.0]] * len(run))
    with pytest.raises(lm.errors.InvalidInput, match="no link 'arm'"):
        run.link("arm")


def test_angles_and_rates_are_those_of_which_a_state_is_made():
    up, across = [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]
    low, top = [0.0, 0.0, -0.5], [0.0, 0.0, 0.5]
    joints = [
        lm.joints.RevoluteJoint(0, None, low, [0.0] * 3, across, across),
        lm.joints.PrismaticJoint(1, 0, low, top, up, np.eye(3)),
        lm.joints.UniversalJoint(2, 1, low, top, across, [0.0, 1.0, 0.0]),
        lm.joints.BallJoint(3, 0, low, top),
        lm.joints.FixedJoint(4, 3, low, top),
    ]
    tree = lm.joints.Linkage([lm.joints.Link(1.0 + k, [0.1, 0.12, 0.15]) for k in range(5)], joints)
    rng = np.random.default_rng(3)
    counts = [joint.freedoms for joint in joints]
    q, rates = [[rng.uniform(-1.2, 1.2, n) for n in counts if n] for _ in range(2)]
    state = tree.state(angles=dict(enumerate(q)), rates=dict(enumerate(rates)))
    mu, g = np.array(state.mu), np.array(state.g)
    np.testing.assert_allclose(tree.angles_of(g), np.concatenate(q), atol=1e-14)
    np.testing.assert_allclose(tree.rates_of(mu, g), np.concatenate(rates), atol=1e-13)
    assert tree.angles_of([g, g]).shape == tree.rates_of([mu, mu], [g, g]).shape == (2, sum(counts))


@pytest.mark.parametrize("method", [lm.LieRATTLE(), lm.RKMK(order=4)], ids=repr)
def test_a_stepper_tells_of_joints_and_links_what_a_run_does(method):
    rods = lm.joints.chain(2, axis=[0.0, 1.0, 0.0])
    joint = [replace(rods.joints[0], name="shoulder"), rods.joints[1]]

    def arm(torque):
        forces = [lm.joints.Motor("shoulder", torque), lm.joints.Damper(1, 0.1)]
        return lm.joints.Linkage(rods.links, joint, forces=forces, load={1: Drag(0.05)})

    plan = lm.Plan(arm(0.5), method, h=0.01, compiled=False)
    start = plan.system.state(angles={0: 0.3}, rates={1: 0.7})
    loop = plan.stepper(start)
    loop.step(2)
    loop.step(1, **{"shoulder.torque": 2.0})
    before = plan.run(start, steps=2)
    run = plan.replace(system=arm(2.0)).run(before.last, t0=before.t[-1], steps=1)
    for name in ("angle", "rate", "torque", "reaction", "moment", "power"):
        for j in ("shoulder", 1):
            np.testing.assert_allclose(
                getattr(loop.joint(j), name), getattr(run.joint(j), name)[-1], rtol=1e-13, atol=1e-13
            )
    assert loop.joint("shoulder").torque == 2.0 and np.ndim(loop.joint(1).rate) == 0
    for name in ("pose", "velocity", "load", "power"):
        np.testing.assert_allclose(getattr(loop.link(1), name), getattr(run.link(1), name)[-1], rtol=1e-13, atol=1e-13)
    assert repr(loop.joint("shoulder")) == f"JointMotion(joint 'shoulder', t = {loop.t})"
    for motion in (loop.joint(0), loop.link(1)):
        with pytest.raises(lm.errors.InvalidInput, match="at one time there is a power and no work"):
            motion.work  # noqa: B018
    with pytest.raises(lm.errors.InvalidInput, match="no joint 'elbow'"):
        loop.joint("elbow")


def test_a_stepper_of_many_linkages_has_a_row_for_each():
    arm = lm.joints.chain(2, axis=[0.0, 1.0, 0.0])
    starts = [arm.state(angles={0: q}, rates={1: 0.5 + q}) for q in (0.1, 0.2, 0.3)]
    g = np.array([s.g for s in starts])
    plan = lm.Plan(arm, lm.RKMK(order=4), h=0.01, compiled=False)
    loop = plan.stepper(arm.state(np.array([s.mu for s in starts]), g))
    np.testing.assert_allclose(loop.joint(0).angle, [0.1, 0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(loop.joint(1).rate, [0.6, 0.7, 0.8], atol=1e-14)
    assert loop.link(1).pose.shape == (*g.shape[:1], 4, 4)
    springs = [lm.joints.Linkage(arm.links, arm.joints, forces=[lm.joints.Spring(0, k)]) for k in (1.0, 2.0, 3.0)]
    loop = plan.replace(system=springs).stepper(arm.state(np.array([s.mu for s in starts]), g))
    np.testing.assert_allclose(loop.joint(0).torque, [-0.1, -0.4, -0.9], atol=1e-15)
    run = plan.replace(system=springs).run(arm.state(np.array([s.mu for s in starts]), g), steps=1)
    lam = run.system.multipliers(run.mu, g=run.g, t=run.t)
    np.testing.assert_allclose(lam[:, 2], springs[2].multipliers(run.mu[:, 2], run.g[:, 2]), rtol=1e-14)
    with pytest.raises(lm.errors.InvalidInput, match="each body has its own"):
        run.system.joint_space  # noqa: B018


def test_bodies_without_joints_say_so():
    plan = lm.Plan(lm.RigidBody([1.0, 2.0, 3.0]), lm.RKMK(order=4), h=0.1, compiled=False)
    loop = plan.stepper(plan.system.state(mu=[1.0, 0.0, 0.5], g=np.eye(3)))
    with pytest.raises(lm.errors.InvalidInput, match="has no joints"):
        loop.joint(0)


@pytest.mark.parametrize("count", [1, 3])
def test_joints_of_linkages_of_their_own_have_their_forces_and_velocities(count):
    """Members with rods, springs and drags of their own: w = mu/J of each, the torque -k q of each, the power of each load."""
    turn, members = [0.0, 1.0, 0.0], []
    for k in range(3):
        rods = lm.joints.chain(count, mass=0.5 + 0.2 * k, length=0.3 + 0.1 * k, axis=turn)
        spring = lm.joints.Spring(0, 1.0 + k)
        members.append(lm.joints.Linkage(rods.links, rods.joints, forces=[spring], load={0: Drag(0.1 + 0.1 * k)}))
    starts = [linkage.state(angles={0: 0.3}, rates={0: 1.0}) for linkage in members]
    both = lm.BodyState(*[np.array([np.array(getattr(start, name)) for start in starts]) for name in ("mu", "g")])
    run = lm.integrate(members, lm.LieRATTLE(), both, h=0.01, steps=3, compiled=False)
    hinge, rod = run.joint(0), run.link(0)
    moments = np.array([linkage.links[0].inertia[1] for linkage in members])
    masses = np.array([linkage.links[0].mass for linkage in members])
    assert hinge.rate == pytest.approx(run.mu[..., 1] / moments, rel=1e-12)
    assert hinge.torque == pytest.approx(-np.array([1.0, 2.0, 3.0]) * hinge.angle, rel=1e-12)
    assert hinge.power == pytest.approx(hinge.torque * hinge.rate, rel=1e-12)
    assert hinge.only(Drag).torque.shape == (4, 3) and not hinge.only(Drag).torque.any()
    squares = run.mu[..., 1] ** 2 / moments**2 + (run.mu[..., 3:6] ** 2).sum(axis=-1) / masses**2
    drags = -np.array([0.1, 0.2, 0.3]) * (1.0 + run.t[:, None]) * squares
    assert rod.power == pytest.approx(drags, rel=1e-10)
