"""RATTLE on groups: what it is equivalent to, its order, what it keeps, and what it refuses."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scenes import PointFixed
from scenes_of_runs import Height

import liemech as lm

EPSILON = np.finfo(float).eps


@lm.record
class Sphere(lm.Constraint):
    """A point of R^3 on a sphere."""

    radius: float

    def value(self, g):
        return lm.vec(lm.dot(g, g) - self.radius * self.radius)


J, MASS, CENTRE, W = (np.array([1.0, 1.5, 0.7]), 2.0, np.array([0.3, 0.1, 0.4]), np.array([0.3, 0.6, 1.1]))
ABOUT_POINT = np.diag(J) + MASS * (CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE))


@functools.cache
def top() -> tuple[lm.ConstrainedBody, lm.State, lm.models.HeavyTop, lm.State]:
    """A body on SE(3) with a fixed point, the same as a heavy top on SO(3), and a start of both."""
    free = lm.MechanicalSystem(lm.models.KirchhoffBody([*J, MASS, MASS, MASS]), lm.models.UniformGravity(MASS * 9.81))
    body, R = (lm.ConstrainedBody(free, PointFixed(-CENTRE)), np.array(lm.SO3().exp([0.4, -0.3, 0.5])))
    g = np.eye(4)
    g[:3, :3], g[:3, 3] = R, R @ CENTRE
    start = body.state([*J * W, *MASS * np.cross(W, CENTRE)], g)
    heavy = lm.models.HeavyTop(ABOUT_POINT, MASS * 9.81, CENTRE)
    return body, start, heavy, heavy.state(ABOUT_POINT @ W, R)


@functools.cache
def pendulum() -> tuple[lm.ConstrainedBody, lm.State]:
    """The spherical pendulum in R^3."""
    free = lm.MechanicalSystem(lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0, 1.0, 1.0])), Height(1.0))
    body = lm.ConstrainedBody(free, Sphere(1.0))
    return body, body.state([0.0, 1.2, 0.0], [0.6, 0.0, -0.8])


def run(system, method, start, h, steps, **options):
    return lm.integrate(system, method, start, h=h, steps=steps, compiled=False, progress=False, **options)


def off(body, states) -> float:
    """The largest miss of both constraints."""
    return max(np.abs(np.array(body.conditions_at(mu, g))).max() for mu, g in zip(states.mu, states.g))


def about_point(mu: np.ndarray) -> np.ndarray:
    """The angular momentum about the fixed point, from that about the centre of mass."""
    return mu[..., :3] + np.cross(CENTRE, mu[..., 3:])


# ------------------------------------------------------------------ equivalences


@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley(), lm.CayleyAdjoint()])
def test_on_a_body_with_a_fixed_point_it_is_Lie_Verlet_of_the_heavy_top(retraction):
    # Rotations about the point are a subgroup, and these maps commute with moving the origin into
    # it.
    body, start, heavy, heavy_start = top()
    bound = run(body, lm.LieRATTLE(retraction), start, 0.05, 15)
    turning = run(heavy, lm.LieVerlet(retraction), heavy_start, 0.05, 15)
    assert np.allclose(bound.g[:, :3, :3], turning.g, rtol=0.0, atol=15 * 20 * EPSILON)
    assert np.allclose(about_point(bound.mu), turning.mu, rtol=0.0, atol=15 * 20 * EPSILON * np.abs(turning.mu).max())
    assert off(body, bound) < 8 * EPSILON


def test_in_a_vector_space_it_is_RATTLE():
    # Hairer, Lubich, Wanner, VII.1.3, equation (1.26), on the spherical pendulum, whose multiplier
    # solves a quadratic equation.
    body, start = pendulum()
    h, q, p, down = 0.1, np.array(start.g), np.array(start.mu), np.array([0.0, 0.0, -1.0])
    found = run(body, lm.LieRATTLE(), start, h, 30)
    for k in range(30):
        free = q + h * (p + 0.5 * h * down)
        a, b, c = 1.0, 2.0 * free @ q, free @ free - 1.0  # |free + s q|^2 = 1
        s = -2.0 * c / (b + np.sqrt(b * b - 4.0 * a * c))
        new = free + s * q
        p = (new - q) / h + 0.5 * h * down
        q, p = new, p - (p @ new) * new
        assert np.allclose(found.g[k + 1], q, rtol=0.0, atol=1e-13)
        assert np.allclose(found.mu[k + 1], p, rtol=0.0, atol=1e-12)


# ------------------------------------------------------------------ claims


@pytest.mark.slow
def test_common_symmetries_keep_their_momenta():
    # Free in space: all six.  Under gravity: about the vertical, and horizontal.  Hanging from a
    # point: about the vertical.
    links = [lm.joints.Link(1.0, [0.2, 0.3, 0.4]), lm.joints.Link(0.7, [0.1, 0.3, 0.25])]
    between = lm.joints.UniversalJoint(0, 1, [0.3, 0.1, -0.4], [0.0, 0.2, 0.5])
    hung = lm.joints.BallJoint(0, None, [0.0, 0.1, 0.5])
    rng = np.random.default_rng(4)
    for joints, gravity, number in (((between,), 0.0, 6), ((between,), 9.81, 3), ((hung, between), 9.81, 1)):
        linkage = lm.joints.Linkage(links, joints, gravity)
        poses = np.array([np.eye(4), np.eye(4)])
        poses[:, :3, 3] = [[0.0, -0.1, -0.5], [0.3, -0.2, -1.4]]
        start = linkage.assembled(poses, rng.normal(size=(2, 6)))
        bound = run(linkage, lm.LieRATTLE(), start, 0.01, 20)
        kept = linkage.constants(bound.states)["spatial momentum"]
        assert kept.shape == (21, number)
        assert np.abs(kept - kept[0]).max() < 1e-13 * np.abs(linkage.total_momentum(bound.mu, bound.g)).max() * 10
        assert off(linkage, bound) < 1e-14


def test_multipliers_are_forces():
    # A pendulum's rod pulls with m g cos(a) + m l w^2.
    linkage = lm.joints.Linkage([lm.joints.Link(2.0, [0.1, 0.1, 0.1])], [lm.joints.RigidRod(0, None, length=1.5)], 9.81)
    angle, rate = 0.7, 1.3
    pose = np.eye(4)
    pose[:3, 3] = 1.5 * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    start = linkage.assembled([pose], [[0.0, 0.0, 0.0, 1.5 * rate * np.cos(angle), 0.0, 1.5 * rate * np.sin(angle)]])
    tension = linkage.multipliers(start.mu, start.g)[0]
    assert tension == pytest.approx(2.0 * 9.81 * np.cos(angle) + 2.0 * 1.5 * rate**2, rel=1e-13)
    run_ = run(linkage, lm.LieRATTLE(), start, 0.01, 5)
    assert linkage.multipliers(run_.mu, run_.g).shape == (6, 1)


@pytest.mark.slow
def test_a_coupled_inertia_is_one_block():
    # A diagonal inertia written as a matrix, and one that couples rotation and translation: the
    # frame out of the centre of mass.
    body, start, *_ = top()
    whole = lm.MechanicalSystem(lm.models.KirchhoffBody(np.diag([*J, MASS, MASS, MASS])), body.body.potential)
    same = lm.ConstrainedBody(whole, body.constraint)
    assert np.allclose(
        run(same, lm.LieRATTLE(), start, 0.05, 5).mu, run(body, lm.LieRATTLE(), start, 0.05, 5).mu, rtol=0.0, atol=1e-14
    )
    arm = np.array([[0.0, -CENTRE[2], CENTRE[1]], [CENTRE[2], 0.0, -CENTRE[0]], [-CENTRE[1], CENTRE[0], 0.0]])
    # the frame in the fixed point
    moved = lm.models.KirchhoffBody.of_blocks(ABOUT_POINT, MASS, MASS * arm)
    about = lm.ConstrainedBody(
        lm.MechanicalSystem(moved, lm.models.UniformGravity(MASS * 9.81, CENTRE)), PointFixed([0.0, 0.0, 0.0])
    )
    g = np.eye(4)
    g[:3, :3] = np.array(start.g)[:3, :3]
    end = run(about, lm.LieRATTLE(), about.state([*ABOUT_POINT @ W, *MASS * np.cross(W, CENTRE)], g), 0.05, 20)
    assert np.allclose(
        end.g[-1][:3, :3], run(body, lm.LieRATTLE(), start, 0.05, 20).g[-1][:3, :3], rtol=0.0, atol=1e-13
    )


# ------------------------------------------------------------------ refusals


def test_a_step_to_another_branch_is_refused():
    body, _ = pendulum()
    fast = body.state([0.0, 40.0, 0.0], [0.6, 0.0, -0.8])
    with pytest.raises(lm.errors.NoConvergence, match=r"grows out of h = 0 ends .* try 0\.025"):
        run(body, lm.LieRATTLE(), fast, 0.1, 10)


def test_large_steps_are_followed_from_zero_on():
    # Half a radian and more a step: the extrapolated guess of the first step will not do, the
    # branch does.
    body, _ = pendulum()
    fast = body.state([0.0, 9.0, 0.0], [0.6, 0.0, -0.8])
    bound = run(body, lm.LieRATTLE(), fast, 0.1, 50)
    assert off(body, bound) < 1e-14 * 9.0
    steps = np.einsum("ij,ij->i", bound.g[1:], bound.g[:-1])
    assert (steps > 0.0).all()


@pytest.mark.slow
def test_at_its_dead_point_a_linkage_stops_and_says_so():
    from scipy.integrate import quad

    # A parallelogram of three rods: flat on the ground it may go on as an antiparallelogram.
    linkage, start = parallelogram(np.pi / 6, -1.0)
    with pytest.raises(lm.errors.NoConvergence, match="dead point") as stop:
        run(linkage, lm.LieRATTLE(), start, 0.01, 200)
    reached = stop.value.trajectory
    poses = linkage.poses(reached.g)
    angle = np.arctan2(poses[:, 0, 2, 0], poses[:, 0, 0, 0])
    assert 0.0 < angle[-1] < 0.05
    # One degree of freedom, both cranks and the coupler with them: I a'^2/2 + M g sin a is kept.
    pull = 2.0 * (2.0 * 0.5 + 1.0) * 9.81 / (2.0 / 3.0 + 1.0)
    time, _ = quad(lambda a: 1.0 / np.sqrt(1.0 + pull * (0.5 - np.sin(a))), angle[-1], np.pi / 6)
    assert reached.t[-1] == pytest.approx(time, abs=1e-3)


def parallelogram(angle: float, rate: float):
    """Two cranks of 1 m on the ground, 1 m apart, and a coupler between their ends: slender rods
    along their first axes, 1 kg.
    """
    rod = lm.joints.Link(1.0, [1e-3, 1.0 / 12.0, 1.0 / 12.0])
    left, right, turn = [-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]
    joints = [
        lm.joints.RevoluteJoint(0, None, left, [0.0, 0.0, 0.0], turn, turn),
        lm.joints.BallJoint(0, 1, right, left),
        lm.joints.UniversalJoint(1, 2, right, right, [0.0, 0.0, 1.0], turn),
        lm.joints.RevoluteJoint(2, None, left, [1.0, 0.0, 0.0], turn, turn),
    ]
    linkage = lm.joints.Linkage([rod] * 3, joints, 9.81)
    R, along = (np.array(lm.SO3().exp([0.0, -angle, 0.0])), np.array([np.cos(angle), 0.0, np.sin(angle)]))
    across = rate * np.array([-np.sin(angle), 0.0, np.cos(angle)])
    poses, rates = np.tile(np.eye(4), (3, 1, 1)), np.zeros((3, 6))
    poses[0, :3, :3] = poses[2, :3, :3] = R
    poses[:, :3, 3] = [0.5 * along, along + [0.5, 0.0, 0.0], [1.0, 0.0, 0.0] + 0.5 * along]
    rates[0, 1] = rates[2, 1] = -rate
    rates[0, 3:] = rates[2, 3:] = R.T @ (0.5 * across)
    rates[1, 3:] = across
    return linkage, linkage.assembled(poses, rates)


def test_what_is_no_start_is_refused():
    body, _ = pendulum()
    with pytest.raises(lm.errors.InconsistentState, match=r"c\(g\) must be zero; condition 0 is 0\.17"):
        body.state([0.0, 1.2, 0.0], [0.7, 0.0, -np.sqrt(0.68)])
    with pytest.raises(lm.errors.InconsistentState, match=r"G\(g\) J\^-1 mu must be zero"):
        body.state([0.1, 1.2, 0.0], [0.6, 0.0, -0.8])
    with pytest.raises(lm.errors.InvalidInput, match="g is missing"):
        body.state([0.0, 1.2, 0.0])
    with pytest.raises(lm.errors.InvalidInput, match="give mu, the momentum, or xi, the velocity, not"):
        body.state([0.0, 1.2, 0.0], [0.6, 0.0, -0.8], xi=[0.0, 1.2, 0.0])
    with pytest.raises(lm.errors.InvalidInput, match="its derivative is zero"):
        body.state([0.0, 1.2, 0.0], [0.0, 0.0, 0.0])
    many = body.state([[0.0, 1.2, 0.0], [0.0, -0.2, 0.0]], [0.6, 0.0, -0.8])
    assert run(body, lm.LieRATTLE(), many, 0.1, 3).g.shape == (4, 2, 3)


@lm.record
class Length(lm.Constraint):
    """The same sphere by a root, which has no derivative in its centre, where the identity of R^3 is."""

    def value(self, g):
        return lm.vec(lm.norm(g) - 1.0)


def test_a_constraint_with_a_kink():
    body, start = pendulum()
    rooted = lm.ConstrainedBody(body.body, Length())
    with pytest.raises(lm.errors.InvalidInput, match="Length has no derivative at g"):
        rooted.consistent([0.0, 1.0, 0.0], [0.0, 0.0, 0.0])
    same = run(rooted, lm.LieRATTLE(), rooted.state(start.mu, start.g), 0.1, 30)
    assert np.allclose(same.mu, run(body, lm.LieRATTLE(), start, 0.1, 30).mu, rtol=0.0, atol=1e-14)


def test_the_nearest_consistent_start():
    body, _ = pendulum()
    near = body.consistent([1.0, 1.2, 0.3], [0.7, 0.2, -0.9])
    q = np.array([0.7, 0.2, -0.9]) / np.linalg.norm([0.7, 0.2, -0.9])
    assert np.allclose(near.g, q, rtol=0.0, atol=1e-14)
    assert np.allclose(near.mu, [1.0, 1.2, 0.3] - (np.array([1.0, 1.2, 0.3]) @ q) * q, rtol=0.0, atol=1e-14)


def test_a_start_from_a_velocity():
    sleigh = lm.NonholonomicBody(
        lm.LiePoissonSystem(lm.SE2(), lm.KineticEnergy([0.7, 1.3, 1.3])), lm.joints.Blade(-0.4)
    )
    mu = np.array([0.77, -0.65, 0.5])
    near = sleigh.consistent(mu, np.eye(3))
    assert sleigh.consistent(xi=mu / [0.7, 1.3, 1.3], g=np.eye(3)) == near
    velocity = sleigh.velocity(near.mu)
    assert np.allclose(sleigh.state(xi=velocity, g=np.eye(3)).mu, near.mu, rtol=1e-14, atol=0.0)


def test_methods_and_systems_that_do_not_fit_say_so():
    body, start = pendulum()
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"LieRATTLE\(\) keeps the constraint"):
        run(body, lm.LieVerlet(), start, 0.1, 1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="needs bodies under a constraint"):
        run(
            lm.RigidBody([1.0, 2.0, 2.5]),
            lm.LieRATTLE(),
            lm.RigidBody([1.0, 2.0, 2.5]).state([1.0, 0.0, 0.0], np.eye(3)),
            0.1,
            1,
        )
    with pytest.raises(lm.errors.InvalidType, match="constraint must be a Constraint"):
        lm.ConstrainedBody(lm.RigidBody([1.0, 2.0, 2.5]), Height(1.0))
    with pytest.raises(lm.errors.InvalidType, match="body must be a body"):
        lm.ConstrainedBody(lm.SO3(), Sphere(1.0))


@pytest.mark.slow
@pytest.mark.compiled
def test_a_million_steps_on_the_constraint():
    body, start, *_ = top()
    long = lm.integrate(body, lm.LieRATTLE(), start, h=0.05, steps=1_000_000, every=1000, compiled=True, progress=False)
    assert off(body, long) < 1e-14
    assert long.drift()["energy"].verdict == "bounded"


@lm.record
class OfTheSecond(lm.Constraint):
    """The second of two turning bodies keeps its first axis across e3."""

    def value(self, g):
        return lm.vec(g[9 + 6])


@lm.record
class SaysWhich(OfTheSecond):
    """It says which of both it is about, and nothing else."""

    def touches(self, group, conditions):
        return ((1,),) * conditions


@lm.record
class OfTheFirst(SaysWhich):
    """Another condition, of the first body: what its base touches is not what it touches."""

    def value(self, g):
        return lm.vec(g[6])


def test_what_another_condition_touches_is_not_what_that_of_its_base_does():
    two, constraint = lm.ProductGroup(lm.SO3(), lm.SO3()), OfTheFirst()
    free = lm.LiePoissonSystem(two, lm.KineticEnergy([1.0, 1.5, 2.0, 1.0, 1.2, 2.0]))
    body = lm.ConstrainedBody(free, constraint)
    start = body.consistent([0.3, 0.5, 0.2, 0.4, 0.5, 0.6], np.tile(np.eye(3).ravel(), 2))
    run = lm.integrate(body, lm.LieRATTLE(), start, h=0.02, steps=5, compiled=False)
    assert np.abs(run.g[:, 6]).max() < 1e-15 and np.abs(run.g[-1, 15]) > 1e-3


def test_a_condition_that_says_which_factors_it_touches_has_the_rows_of_these():
    two, g = lm.ProductGroup(lm.SO3(), lm.SO3()), np.tile(np.eye(3).ravel(), 2)
    free = lm.LiePoissonSystem(two, lm.KineticEnergy([1.0, 1.5, 2.0, 1.0, 1.2, 2.0]))
    ends = []
    for constraint in OfTheSecond(), SaysWhich():
        body = lm.ConstrainedBody(free, constraint)
        start = body.consistent([0.3, 0.5, 0.2, 0.4, 0.5, 0.6], g)
        ends.append(lm.integrate(body, lm.LieRATTLE(), start, h=0.02, steps=5, compiled=False).mu[-1])
    assert np.array_equal(*ends)
