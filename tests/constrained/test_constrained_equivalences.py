"""What must be the same: RATTLE and SHAKE, Moser-Veselov, Lobatto; multipliers and Lagrange's equations; models."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from constrained_scenes import CHAIN, DOUBLE, HANGING, MASSES, MOVING, PENDULUM, STRETCHING, SWINGING, plain
from scenes import SEED_INERTIA, quiet_body, rotation, slow

import liemech as lm
from liemech.formulas import cos, record, sin, vec

EPS = float(np.finfo(float).eps)


@pytest.mark.parametrize("inertia", [(1.0, 1.5, 2.0), SEED_INERTIA], ids=["body", "seed"])
def test_rattle_on_nine_numbers_is_moser_veselov(inertia: tuple[float, ...]) -> None:
    """Also where the mass moments are not positive, as those of the seed body."""
    body, matrix = quiet_body(inertia), lm.models.OrthogonalBody(inertia)
    mu, g = [0.5, 0.0, 0.75**0.5], rotation(np.random.default_rng(2))
    ours = plain(matrix, lm.RATTLE(), matrix.at(mu, g), 0.1, 5)
    theirs = plain(body, lm.MoserVeselov(), body.state(mu, g), 0.1, 5)
    assert np.abs(ours.q.reshape(-1, 3, 3) - theirs.g).max() < 2e-15
    assert np.abs(matrix.body_momentum(ours.q, ours.p) - theirs.mu).max() < 2e-15
    assert np.abs(ours.energy - theirs.energy).max() < 2e-15


def test_the_pair_of_two_stages_is_rattle() -> None:
    for system, start in ((PENDULUM, SWINGING), (CHAIN, HANGING), (STRETCHING, MOVING)):
        a, b = (plain(system, m, start, 0.05, 5) for m in (lm.RATTLE(), lm.LobattoPair(order=2)))
        assert np.abs(a.q - b.q).max() < 4e-15
        assert np.abs(a.p - b.p).max() < 2e-14


def test_positions_of_rattle_are_those_of_shake() -> None:
    """q_n+1 - 2 q_n + q_n-1 = h^2 M^-1 (f - G(q_n)^T lambda) for some lambda: the rest is along the rods."""
    h = 0.02
    run = plain(CHAIN, lm.RATTLE(), HANGING, h, 20)
    for before, here, after in zip(run.q, run.q[1:], run.q[2:], strict=False):
        rest = MASSES * (after - 2 * here + before) / h**2 - np.array(CHAIN.force(vec(*here), vec(*here)))
        G = np.array(CHAIN.constraint_jacobian(vec(*here)))
        left = rest - G.T @ np.linalg.lstsq(G.T, rest, rcond=None)[0]
        assert np.abs(left).max() < 1e-11 * np.abs(rest).max()


def test_rattle_on_the_sphere_in_closed_form() -> None:
    """The multiplier is the smaller root of a quadratic equation; momenta are projected along the new position."""
    h, g = 0.05, np.array([0.0, 0.0, -PENDULUM.gravity])
    q, p = np.array(SWINGING.q), np.array(SWINGING.p)
    run = plain(PENDULUM, lm.RATTLE(), SWINGING, h, 20)
    for _ in range(20):
        free = q + h * (p + 0.5 * h * g)
        b = q @ free
        there = free - (b - np.sqrt(b * b - (free @ free - 1.0))) * q
        half = (there - q) / h + 0.5 * h * g
        q, p = there, half - (half @ there) * there
    assert np.abs(run.q[-1] - q).max() < 1e-14
    assert np.abs(run.p[-1] - p).max() < 1e-13


def test_the_chain_is_the_double_pendulum_in_angles() -> None:
    angles = lm.models.DoublePendulum([DOUBLE["m1"], DOUBLE["m2"]], [DOUBLE["l1"], DOUBLE["l2"]], DOUBLE["g"])
    start = angles.state(DOUBLE["angles0"], angles.momentum(DOUBLE["angles0"], DOUBLE["angular_velocities0"]))
    a, b = plain(angles, lm.RKMK(order=8), start, 0.02, 50).q[-1]
    ours = plain(CHAIN, lm.Composition(lm.RATTLE(), order=8), HANGING, 0.1, 10)
    first = DOUBLE["l1"] * np.array([np.sin(a), -np.cos(a)])
    second = first + DOUBLE["l2"] * np.array([np.sin(b), -np.cos(b)])
    assert np.abs(ours.q[-1] - [*first, *second]).max() < 1e-6
    sample = next(s for s in DOUBLE["samples"] if s["t"] == 1.0)
    assert np.abs([*first, *second] - np.array(sample["q"])).max() < 1e-11
    assert ours.energy[-1] == pytest.approx(DOUBLE["energy"], abs=1e-6)


def test_a_chain_of_one_is_the_spherical_pendulum() -> None:
    one = lm.models.ChainPendulum([1.0], [1.0], PENDULUM.gravity)
    a = plain(one, lm.RATTLE(), one.state(SWINGING.q, SWINGING.p), 0.05, 10)
    b = plain(PENDULUM, lm.RATTLE(), SWINGING, 0.05, 10)
    assert np.abs(a.q - b.q).max() < 1e-15
    assert np.abs(a.p - b.p).max() < 4e-15


def test_a_plane_cuts_the_chain_out_of_space() -> None:
    """The same chain in three dimensions, started in a plane, stays there and is the planar one."""
    masses, lengths = [1.0, 0.5, 0.7], [1.0, 0.8, 0.6]
    flat, space = (lm.models.ChainPendulum(masses, lengths, dimension=d) for d in (2, 3))
    v = np.array([0.3, 0.0, 0.1, 0.2, -0.2, 0.1])
    down = [0.6, -0.8, 0.0, -1.0, 0.28, -0.96]
    start = flat.consistent(flat.hanging(down), v)
    lifted = [np.insert(np.reshape(np.array(x), (3, 2)), 1, 0.0, axis=1).ravel() for x in (start.q, start.p)]
    a = plain(flat, lm.RATTLE(), start, 0.02, 10)
    b = plain(space, lm.RATTLE(), space.state(*lifted), 0.02, 10)
    assert np.abs(b.q.reshape(-1, 3, 3)[:, :, [0, 2]] - a.q.reshape(-1, 3, 2)).max() < 1e-15


def test_conical_motion_is_steady() -> None:
    """At the angle a the pendulum circles with w^2 = g/(l cos a), and the tension is m g/cos a: exact, at every time."""
    a, system = 0.7, lm.SphericalPendulum(mass=2.0, length=1.5)
    r, w = 1.5 * np.sin(a), np.sqrt(system.gravity / (1.5 * np.cos(a)))
    start = system.state([r, 0.0, -1.5 * np.cos(a)], [0.0, 2.0 * r * w, 0.0])
    run = plain(system, lm.Composition(lm.RATTLE(), order=8), start, 0.05, 20)
    wanted = np.stack([r * np.cos(w * run.t), r * np.sin(w * run.t), 0.0 * run.t - 1.5 * np.cos(a)], axis=1)
    assert np.abs(run.q - wanted).max() < 1e-9
    tension = np.asarray(system.multipliers(run.q, run.p))
    assert np.abs(tension - 2.0 * system.gravity / np.cos(a)).max() < 1e-8


# ---------------------------------------------------------------- Lagrange's equations


@record
class Slider(lm.ConstrainedLagrangianSystem):
    """A bead of a mass that depends on its place, on a helix about the third axis, under gravity."""

    degrees: ClassVar[int] = 3

    def mass(self, q: lm.Vec) -> lm.Mat:
        m = 1.0 + 0.2 * q[2] * q[2]
        return lm.mat(lm.vec(m, 0.1 * q[0], 0.0), lm.vec(0.1 * q[0], m, 0.05), lm.vec(0.0, 0.05, m))

    def potential(self, q: lm.Vec) -> float:
        return 9.81 * q[2]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return lm.vec(q[0] - cos(q[2]), q[1] - sin(q[2]))


def test_the_equations_of_euler_and_lagrange() -> None:
    """d/dt(dL/dv) - dL/dq = 0 for L = T - U - g . lambda, written out from L alone, with the
    accelerations and the multipliers of the system; and g''(v, v) + G v' = 0.
    """
    system = Slider()
    start = system.consistent([np.cos(0.4), np.sin(0.4), 0.4], [-0.3, 0.6, 0.9])
    q, v = start.q, system.velocity(start.q, start.p)
    turned, lam = system.acceleration(q, v)

    def along(s: float) -> tuple[lm.Vec, lm.Vec]:
        return q + s * v + (0.5 * s * s) * turned, v + s * turned

    def lagrangian(x: lm.Vec, u: lm.Vec) -> float:
        kinetic = 0.5 * lm.dot(u, system.mass(x) @ u)
        return kinetic - system.potential(x) - lm.dot(system.constraint(x), lam)

    def impulse(s: float) -> lm.Vec:
        x, u = along(s)
        return lm.gradient(lambda w: lagrangian(x, w), u)

    rate = np.array(lm.derivative(impulse, 0.0))
    slope = np.array(lm.gradient(lambda x: lagrangian(x, v), q))
    assert np.abs(rate).max() > 1.0
    assert np.abs(rate - slope).max() < 64 * EPS * np.abs(rate).max()
    speed = lm.derivative(lambda s: system.constraint(along(s)[0]), 0.0)
    bend = lm.derivative(lambda r: lm.derivative(lambda s: system.constraint(along(s)[0]), r), 0.0)
    assert np.abs(np.array([*speed, *bend])).max() < 64 * EPS * np.abs(np.array(v)).max() ** 2


def test_lagranges_equations_are_hamiltons() -> None:
    """(M G^T; G 0) gives the multipliers of the Hamiltonian side, and the acceleration of its motion."""
    system = Slider()
    start = system.consistent([np.cos(0.4), np.sin(0.4), 0.4], [-0.3, 0.6, 0.9])
    v = system.velocity(start.q, start.p)
    turned, lam = system.acceleration(start.q, v)
    assert np.array(lam) == pytest.approx(np.array(system.multipliers(start.q, start.p)), rel=1e-13)
    rate = np.array(system.rate(0.0, start))
    assert np.array(v) == pytest.approx(rate[:3], rel=1e-15)
    ahead = [
        np.array(system.velocity(vec(*(np.array(start.q) + e * rate[:3])), vec(*(np.array(start.p) + e * rate[3:]))))
        for e in (1e-5, -1e-5)
    ]
    assert (ahead[0] - ahead[1]) / 2e-5 == pytest.approx(np.array(turned), rel=1e-8)
    run = plain(system, lm.RATTLE(), start, 0.02, 20)
    assert np.ptp(run.energy) < 2e-3 * np.ptp(9.81 * run.q[:, 2])


@pytest.mark.slow
def test_a_bead_on_a_wire_is_its_own_coordinate() -> None:
    """On the circle x^2 + y^2 = 1 the planar system is the pendulum."""

    @record
    class Ring(lm.Surface):
        def value(self, q: lm.Vec) -> lm.Vec:
            return vec(0.5 * (lm.dot(q, q) - 1.0))

    @record
    class Falling(lm.SeparableSystem):
        degrees: ClassVar[int] = 2

        def kinetic(self, p: lm.Vec) -> float:
            return 0.5 * lm.dot(p, p)

        def potential(self, q: lm.Vec) -> float:
            return q[1]

    bead, pendulum = lm.Constrained(Falling(), Ring()), lm.models.Pendulum(gravity=1.0)
    assert bead.separable
    ours = plain(
        bead, lm.Composition(lm.RATTLE(), order=8), bead.state([np.sin(1.0), -np.cos(1.0)], [0.0, 0.0]), 0.2, 10
    )
    theirs = plain(pendulum, lm.Splitting(order=8), pendulum.state(1.0, 0.0), 0.05, 40)
    assert ours.q[-1] == pytest.approx([np.sin(theirs.q[-1, 0]), -np.cos(theirs.q[-1, 0])], abs=1e-9)


def test_wrapping_an_energy_that_does_not_separate() -> None:
    @record
    class Bar(lm.Surface):
        def value(self, q: lm.Vec) -> lm.Vec:
            return vec(q[0] - q[1])

    stiff = lm.Constrained(lm.models.DoublePendulum(gravity=1.0), Bar())
    assert not stiff.separable
    start = stiff.consistent([0.5, 0.5], [1.0, 0.2])
    run = plain(stiff, lm.RATTLE(), start, 0.01, 100)
    one = lm.Constrained(lm.models.DoublePendulum(gravity=1.0), Bar())
    assert one == stiff
    theta = lm.models.Pendulum(gravity=1.0)  # both rods as one: I = 5, weight 3, so that I w' = -3 sin
    w = float(stiff.velocity(start.q, start.p)[0])
    other = plain(theta, lm.Splitting(order=6), theta.state(0.5, w / np.sqrt(0.6)), 0.01 * np.sqrt(0.6), 100)
    assert run.q[-1] == pytest.approx([other.q[-1, 0]] * 2, abs=2e-5)


def test_the_linkage_is_a_pendulum() -> None:
    """I th'' = -M g cos th with I = (N + 1)/3 + N and M = (N + 1)/2 + N."""
    for loops in (1, 2):
        linkage = lm.models.FourBarLinkage(loops)
        q = np.array([[j, 1.0] for j in range(loops + 1)]).ravel()
        v = np.array([[1.0, 0.0] for _ in range(loops + 1)]).ravel()
        start = linkage.state(q, linkage.momentum(vec(*q), vec(*v)))
        assert linkage.energy(start.q, start.p) == pytest.approx({1: 20.4533333333, 2: 35.835}[loops], rel=1e-9)
        inertia, weight = (loops + 1) / 3 + loops, (loops + 1) / 2 + loops
        pendulum = lm.models.Pendulum(gravity=9.81 * weight / inertia)
        angle = plain(pendulum, lm.Splitting(order=8), pendulum.state(np.pi, -1.0), 0.02, 25).q[-1, 0] - 0.5 * np.pi
        run = plain(linkage, lm.Composition(lm.RATTLE(), order=4), start, 0.1, 5)
        assert run.q[-1].reshape(-1, 2)[0] == pytest.approx([np.cos(angle), np.sin(angle)], abs=2e-5)


@pytest.mark.slow
def test_geodesics_of_an_ellipsoid_keep_joachimsthals_integral() -> None:
    system = lm.models.ParticleOnEllipsoid([1.0, 1.5, 2.0], mass=0.7)
    start = system.consistent([0.6, 0.7, 1.0], [0.5, -0.3, 0.4])
    ranges = []
    for h in (0.1, 0.05):
        run = plain(system, lm.Composition(lm.RATTLE(), order=4), start, h, round(4 / h))
        kept = np.asarray(system.joachimsthal(run.q, run.p))
        ranges.append(np.ptp(kept) / kept[0])
    assert ranges[1] < 1e-5
    assert np.log2(ranges[0] / ranges[1]) == pytest.approx(4.0, abs=0.6)


@pytest.mark.slow
@pytest.mark.parametrize(("n", "k"), [slow(3, 1), (3, 2), slow(3, 3), slow(4, 2)])
def test_splittings_on_stiefel_manifolds(n: int, k: int) -> None:
    """Geodesics obey their laws, splittings have their order, and RATTLE comes to the same motion."""
    rng = np.random.default_rng(n + k)
    system = lm.models.OrthonormalFrame(rng.normal(size=(n, k)), mass=1.3)
    q = np.linalg.qr(rng.normal(size=(n, k)))[0].ravel()
    start = system.consistent(q, rng.normal(size=n * k))
    assert lm.check_system(system, system.state(start.q, start.p))["geodesic"].verdict == "holds"
    fine = plain(system, lm.GeodesicSplitting(order=6), start, 0.1, 8).q[-1]
    methods = lm.GeodesicSplitting(order=4), lm.RATTLE()
    ends = [plain(system, m, start, h, round(0.8 / h)).q[-1] for m in methods for h in (0.2, 0.1)]
    errors = [np.abs(end - fine).max() for end in ends]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)
    assert np.log2(errors[2] / errors[3]) == pytest.approx(2.0, abs=0.3)


def test_the_frame_of_one_vector_is_a_pendulum_and_that_of_three_a_rotation() -> None:
    one = lm.models.OrthonormalFrame([[0.0], [0.0], [PENDULUM.gravity]])
    a = plain(one, lm.RATTLE(), one.state(SWINGING.q, SWINGING.p), 0.05, 5)
    b = plain(PENDULUM, lm.RATTLE(), SWINGING, 0.05, 5)
    assert np.abs(a.q - b.q).max() < 1e-15
    three = lm.models.OrthonormalFrame(np.zeros((3, 3)))
    g, w = rotation(np.random.default_rng(3)), np.array([0.4, -0.7, 0.5])
    p = g @ lm.SO3().algebra.hat(w)
    moved, after = three.geodesic(vec(*g.ravel()), vec(*np.array(p).ravel()), 1.5)
    turned = g @ np.array(lm.SO3().exp(1.5 * w))
    assert np.array(moved) == pytest.approx(turned.ravel(), abs=1e-14)
    assert np.array(after) == pytest.approx((turned @ lm.SO3().algebra.hat(w)).ravel(), abs=1e-14)


def test_the_geodesic_of_the_pendulum_is_its_motion_without_gravity() -> None:
    free = lm.SphericalPendulum(mass=2.0, length=1.5, gravity=0.0)
    start = free.consistent([0.9, 0.3, -1.0], [0.4, 1.1, -0.6])
    q, p = free.geodesic(start.q, start.p, 2.0)
    run = plain(free, lm.RKMK(order=8), start, 0.05, 40)
    assert np.array(q) == pytest.approx(run.q[-1], abs=1e-12)
    assert np.array(p) == pytest.approx(run.p[-1], abs=1e-12)
    assert free.geodesic(start.q, 0.0 * start.p, 2.0)[0] == start.q
