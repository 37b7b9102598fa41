"""What models compute beside their motion, written down once more with NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import numbers
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.models import poses
from liemech.models.bodies import exact_top
from liemech.models.planets import planetary_system, universal_variables

RNG = np.random.default_rng(3)
PLACES = RNG.normal(size=(4, 3))
HALVES = [[0.1, 0.2, -0.1], [3.0, 0.2, 0.1], [0.2, 3.0, 0.3], [0.1, -0.2, 3.0]]
"""Turns whose quaternions are largest in each of the four components."""
TURNS = Rotation.random(4, random_state=4).as_matrix()


def poses_of(turns: np.ndarray, places: np.ndarray) -> np.ndarray:
    g = np.tile(np.eye(4), (len(turns), 1, 1))
    g[:, :3, :3], g[:, :3, 3] = turns, places
    return g


# ---------------------------------------------------------------- bodies


def test_a_rod_is_a_cylinder() -> None:
    """m (3 r^2 + l^2)/12 across and m r^2/2 along, by the mean squares of points inside."""
    mass, length, radius = 2.0, 3.0, 0.7
    J = np.array(lm.joints.Link.rod(mass, length, radius).inertia)
    z2, x2 = length**2 / 12.0, radius**2 / 4.0
    assert np.allclose(J, mass * np.array([x2 + z2, x2 + z2, 2.0 * x2]), rtol=1e-14)


def test_a_linkage_weighs_what_its_links_weigh() -> None:
    """Energy, total momentum, and the momenta that gravity and joints leave: those of three free
    bodies are about the vertical and across it, of a pendulum on a ball joint about the vertical.
    """
    masses, inertia = [1.0, 2.5, 0.7], [0.3, 0.4, 0.5]
    links = [lm.joints.Link(m, inertia) for m in masses]
    rods = [lm.joints.RigidRod(0, 1, length=1.0), lm.joints.RigidRod(1, 2, length=1.5)]
    linkage = lm.joints.Linkage(links, rods, gravity=9.0)
    places = np.array([[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [1.1, 1.7, 0.3]])
    start = linkage.assembled(poses_of(TURNS[:3], places), RNG.normal(size=(3, 6)))
    g, mu = numbers(start.g), numbers(start.mu).reshape(3, 6)
    R, x = g.reshape(3, 4, 4)[:, :3, :3], g.reshape(3, 4, 4)[:, :3, 3]
    xi = mu / [*inertia, 1.0, 1.0, 1.0]
    xi[:, 3:] /= np.array(masses)[:, None]
    energy = 0.5 * (mu * xi).sum() + 9.0 * np.array(masses) @ x[:, 2]
    assert linkage.energy(start.mu, start.g) == pytest.approx(energy, rel=1e-14)
    moved = np.einsum("bij,bj->bi", R, mu[:, 3:])
    turned = np.einsum("bij,bj->bi", R, mu[:, :3]) + np.cross(x, moved)
    total = np.r_[turned.sum(axis=0), moved.sum(axis=0)]
    assert np.allclose(linkage.total_momentum(mu.ravel(), g), total, rtol=1e-13, atol=1e-14)
    elsewhere = [poses_of(TURNS[k : k + 1], PLACES[k])[0] for k in range(2)]
    later = np.array([g.ravel(), *((move @ g.reshape(3, 4, 4)).ravel() for move in elsewhere)])
    kept = linkage.constants({"mu": np.tile(mu.ravel(), (3, 1)), "g": later})
    assert kept["spatial momentum"].shape == (3, 3)  # about the vertical, and both ways across it
    assert np.linalg.norm(kept["spatial momentum"][0]) == pytest.approx(np.linalg.norm(total[[2, 3, 4]]), rel=1e-12)
    hung = lm.joints.Linkage(links[:1], [lm.joints.BallJoint(0, None, lm.vec(0.0, 0.0, 0.5))])
    g = poses_of(TURNS[:1], -0.5 * TURNS[:1, :, 2])
    start = hung.assembled(g, [[0.3, 0.4, 0.5, 0.0, 0.0, 0.0]])
    turned = poses_of(TURNS[1:2], np.zeros(3))[0] @ numbers(start.g).reshape(4, 4)
    both = np.array([numbers(start.g), turned.ravel()])
    kept = hung.constants({"mu": np.tile(numbers(start.mu), (2, 1)), "g": both})
    vertical = hung.total_momentum(start.mu, start.g)[2]
    assert np.abs(kept["spatial momentum"][0]) == pytest.approx([abs(vertical)], rel=1e-12)


def test_where_weights_act() -> None:
    g, centre = poses_of(TURNS[:1], np.array([[0.3, 0.4, 0.5]]))[0], np.array([0.1, -0.2, 0.3])
    height = (TURNS[0] @ centre)[2] + 0.5
    assert lm.models.UniformGravity(2.0, centre).energy(g) == pytest.approx(2.0 * height, rel=1e-14)
    assert lm.models.UniformGravity(2.0).energy(g) == pytest.approx(1.0, rel=1e-14)
    top = lm.models.LagrangeTop(transverse=1.2, axial=0.5, weight=2.0, length=0.7)
    assert tuple(top.centre) == (0.0, 0.0, 0.7) and tuple(top.inertia) == (1.2, 1.2, 0.5)
    assert top.energy(lm.vec(0.0, 0.0, 0.0), TURNS[0]) == pytest.approx(1.4 * TURNS[0][2, 2])


@pytest.mark.parametrize("full", [False, True])
def test_the_attraction_of_four_masses(full: bool) -> None:
    """-k sum m/|x_i| of a small body made of points, to second order in its size."""
    points, masses = 1e-3 * RNG.normal(size=(4, 3)), np.array([1.0, 2.0, 1.5, 0.5])
    if not full:  # along the axes
        points = 1e-3 * np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 2.0, 0], [0, -2.0, 0]])
        masses = np.array([1.0, 1.0, 2.0, 2.0])
    points = points - masses @ points / masses.sum()
    J = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points))
    R, x, k = TURNS[1], np.array([0.4, -0.5, 0.3]), 3.0
    g = lm.vec(*R.ravel(), *x)
    field = lm.models.CentralGravity(k, masses.sum(), J if full else np.diag(J))
    wanted = -k * sum(m / np.linalg.norm(x + R @ p) for m, p in zip(masses, points))
    whole = -k * masses.sum() / np.linalg.norm(x)
    assert field.energy(g) - whole == pytest.approx(wanted - whole, rel=2e-2)
    assert abs(wanted - whole) > 1e-6


def test_a_thrown_body_falls() -> None:
    """p = m v from the body, v = v_0 - g t e3, on a parabola."""
    body = lm.models.FallingBody([1.0, 1.6, 2.3], 1.7, gravity=9.0)
    g = poses_of(TURNS[:1], np.array([[0.3, 0.4, 0.5]]))[0]
    start = body.state([0.4, 0.5, 0.6, 1.0, 2.0, 3.0], g)
    t = np.array([-0.3, 0.0, 0.8])
    end = body.exact(start, t)
    v0 = TURNS[0] @ [1.0, 2.0, 3.0] / 1.7
    v = v0 - 9.0 * t[:, None] * [0.0, 0.0, 1.0]
    x = [0.3, 0.4, 0.5] + v0 * t[:, None] - 4.5 * t[:, None] ** 2 * [0.0, 0.0, 1.0]
    assert np.allclose(end.g[:, :3, 3], x, rtol=1e-13)
    assert np.allclose(np.einsum("nij,nj->ni", end.g[:, :3, :3], end.mu[:, 3:]), 1.7 * v, rtol=1e-13)
    assert (end.g[:, 3] == [0.0, 0.0, 0.0, 1.0]).all()
    free = lm.RigidBody([1.0, 1.6, 2.3])
    turned = free.exact(free.state([0.4, 0.5, 0.6], TURNS[0]), t)
    assert np.allclose(end.g[:, :3, :3], turned.g) and np.allclose(end.mu[:, :3], turned.mu)


def test_a_body_on_orthogonal_columns_turns_like_one_on_rotations() -> None:
    body, columns = lm.RigidBody([1.0, 1.5, 2.0]), lm.models.OrthogonalBody([1.0, 1.5, 2.0])
    mu, g = np.array([0.4, -0.7, 0.9]), TURNS[2]
    start = columns.at(mu, g)
    assert columns.energy(start.q, start.p) == pytest.approx(body.energy(mu), rel=1e-14)
    assert np.allclose(columns.body_momentum(start.q, start.p), mu, rtol=1e-14)
    assert np.allclose(columns.spatial_momentum(start.q, start.p), g @ mu, rtol=1e-14)
    kept = columns.constants({"q": numbers(start.q)[None], "p": numbers(start.p)[None]})
    assert np.allclose(kept["spatial momentum"], g @ mu, rtol=1e-14)


def test_a_frame_without_field_keeps_its_angular_momentum() -> None:
    frame = lm.models.OrthonormalFrame(np.zeros((4, 2)), 1.3)
    Q, _ = np.linalg.qr(RNG.normal(size=(4, 2)))
    start = frame.consistent(Q.ravel(), RNG.normal(size=8))
    q, p = numbers(start.q), numbers(start.p)
    later = [numbers(x) for x in frame.geodesic(start.q, start.p, 0.7)]
    both = frame.constants({"q": np.array([q, later[0]]), "p": np.array([p, later[1]])})
    P = p.reshape(4, 2)
    wanted = (Q @ P.T - P @ Q.T)[np.triu_indices(4, 1)]
    assert both["angular momentum"].shape == (2, 6)
    assert np.allclose(both["angular momentum"], [wanted, wanted], rtol=1e-12, atol=1e-13)


def test_rods_of_a_chain_meet_at_their_ends() -> None:
    """Hanging straight down, they hold together, and half a length further they do not."""
    for axis in (None, [1.0, 0.0, 0.0]):
        linkage = lm.joints.chain(3, mass=2.0, length=0.8, axis=axis)
        for step, zero in ((0.8, True), (0.4, False)):
            places = np.array([[0.0, 0.0, -0.4 - step * b] for b in range(3)])
            poses_there = poses_of(np.tile(np.eye(3), (3, 1, 1)), places).reshape(48)
            value = numbers(linkage.constraint.value(lm.vec(*poses_there)))
            assert bool(np.abs(value).max() < 1e-15) is zero
        assert [link.mass for link in linkage.links] == [2.0] * 3


def test_a_circular_orbit_begins_on_the_first_axis() -> None:
    """x = r e1, p = m (k/r)^(1/2) e2 to leading order, and a spin that goes with it."""
    body = lm.models.OrbitingBody([0.5e-6, 0.8e-6, 1.1e-6], mass=2.0, attraction=5.0)
    start = body.circular_orbit(3.0, TURNS[0])
    mu, g = numbers(start.mu), numbers(start.g)
    assert np.array_equal(g[9:], [3.0, 0.0, 0.0]) and np.allclose(g[:9], TURNS[0].ravel())
    assert np.allclose(mu[3:], [0.0, 2.0 * np.sqrt(5.0 / 3.0), 0.0], rtol=1e-5)
    w = TURNS[0].T @ [0.0, 0.0, np.sqrt(5.0 / 27.0)]
    assert np.allclose(mu[:3], [0.5e-6, 0.8e-6, 1.1e-6] * w, rtol=1e-5)


# ---------------------------------------------------------------- points


def test_periods_of_a_pendulum() -> None:
    hung = lm.models.Pendulum(mass=2.0, length=0.5, gravity=0.0)
    turning = hung.state([0.3], [0.7])
    assert hung.period(turning) == pytest.approx(2.0 * np.pi * 2.0 * 0.25 / 0.7, rel=1e-14)
    assert hung.period(hung.state([0.3], [0.0])) == 0.0
    ends = hung.exact(turning, np.array([0.0, hung.period(turning)]))
    assert ends.q[1, 0] - ends.q[0, 0] == pytest.approx(2.0 * np.pi, rel=1e-14)
    with_weight = lm.models.Pendulum(mass=2.0, length=0.5)
    assert with_weight.period(with_weight.state([0.0], [0.0])) == 0.0


@pytest.mark.parametrize("axis", [0.3, 1.0, 40.0])
def test_an_orbit_from_any_point_of_an_ellipse(axis: float) -> None:
    """Seen from its pericentre and from elsewhere it is the same, whatever the unit of length."""
    kepler = lm.Kepler(attraction=2.5)
    start = kepler.pericentre(0.6, axis)
    period = kepler.period(start)
    t = period * np.array([0.1, 0.35, 0.8])
    first = kepler.exact(start, t)
    elsewhere = kepler.exact(kepler.state(first.q[0], first.p[0]), t - t[0])
    assert np.allclose(elsewhere.q, first.q, rtol=0.0, atol=1e-13 * axis)
    E = np.array(
        [brentq(lambda E, m=m: E - 0.6 * np.sin(E) - m, 0.0, 7.0, xtol=1e-15) for m in 2.0 * np.pi * t / period]
    )
    wanted = axis * np.stack([np.cos(E) - 0.6, 0.8 * np.sin(E)], axis=-1)
    assert np.allclose(first.q, wanted, rtol=0.0, atol=1e-13 * axis)
    rate = 2.0 * np.pi / period / (1.0 - 0.6 * np.cos(E))
    wanted = (axis * rate * np.stack([-np.sin(E), 0.8 * np.cos(E)])).T
    assert np.allclose(first.p, wanted, rtol=1e-12)
    assert np.allclose(elsewhere.p, first.p, rtol=1e-12)


def test_the_centre_of_gyration() -> None:
    """u^2/2 + m |B| + phi; a charged particle gyrates about x + v x b/|B| with m = v_across^2/2|B|;
    the equations are those of Littlejohn.
    """

    @lm.record
    class Well(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return 0.5 * mu[0] * mu[0] + 0.2 * mu[1] * mu[2]

    field, well = lm.models.AxialField(0.3), Well()
    particle = lm.models.ChargedParticle(field, well)
    x, v = np.array([0.7, -0.4, 0.2]), np.array([0.3, 0.5, -0.6])
    system, start = lm.models.GuidingCentre.of_particle(particle, np.r_[x, v])
    B = numbers(field.at(lm.vec(*x)))
    b, along = B / np.linalg.norm(B), v @ B / np.linalg.norm(B)
    across = v - along * b
    assert system.moment == pytest.approx(across @ across / (2.0 * np.linalg.norm(B)), rel=1e-14)
    assert np.allclose(start, [*(x + np.cross(v, B) / (B @ B)), along], rtol=1e-14)
    y = np.r_[x, 0.35]

    def whole(z: np.ndarray) -> float:
        there = numbers(field.at(lm.vec(*z[:3])))
        potential = 0.5 * z[0] ** 2 + 0.2 * z[1] * z[2]
        return 0.5 * z[3] ** 2 + system.moment * np.linalg.norm(there) + potential

    assert system.energy(lm.vec(*y)) == pytest.approx(whole(y), rel=1e-14)
    bare = lm.models.GuidingCentre(field, system.moment)
    assert bare.energy(lm.vec(*y)) == pytest.approx(whole(y) - well.energy(lm.vec(*x)), rel=1e-14)
    slopes = [(whole(y + 1e-5 * e) - whole(y - 1e-5 * e)) / 2e-5 for e in np.eye(4)]
    assert np.allclose(system.gradient(lm.vec(*y)), slopes, rtol=1e-8, atol=1e-9)
    turned = np.zeros((3, 3))
    for j, e in enumerate(np.eye(3)):
        ends = [numbers(field.at(lm.vec(*(x + s * e)))) for s in (1e-5, -1e-5)]
        turned[:, j] = (ends[0] / np.linalg.norm(ends[0]) - ends[1] / np.linalg.norm(ends[1])) / 2e-5
    curl = [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    star = B + y[3] * np.array(curl)
    pull = np.array(slopes[:3])
    wanted = np.r_[y[3] * star + np.cross(b, pull), -star @ pull] / (b @ star)
    moved = numbers(system.structure.sharp(lm.vec(*y), system.gradient(lm.vec(*y))))
    assert np.allclose(moved, wanted, rtol=1e-7, atol=1e-8)


def test_planets_in_coordinates_of_jacobi() -> None:
    """Energies and slopes of both parts, with four bodies: together those of points; places, and
    the way back of whole arrays.
    """
    masses = np.array([1.0, 0.3, 0.2, 0.4])
    system, points = lm.models.PlanetarySystem(masses, 1.7), lm.models.NBody(masses, 1.7)
    q = RNG.normal(size=(4, 3)) + 2.0 * np.arange(4)[:, None]
    p = RNG.normal(size=(4, 3))
    q, p = q - masses @ q / masses.sum(), p - masses[:, None] * p.sum(axis=0) / masses.sum()
    start = system.state_of(q.ravel(), p.ravel())
    y = numbers(start.y)
    energy = points.energy(lm.vec(*q.ravel()), lm.vec(*p.ravel()))
    assert system.energy(start.y) == pytest.approx(energy, rel=1e-13)
    for part in (system.hamiltonian, *system.hamiltonian.parts):
        energy_of = part.energy
        slopes = [(energy_of(lm.vec(*(y + 1e-5 * e))) - energy_of(lm.vec(*(y - 1e-5 * e)))) / 2e-5 for e in np.eye(18)]
        assert np.allclose(part.gradient(start.y), slopes, rtol=1e-6, atol=1e-8)
    assert np.abs(slopes[:3]).max() > 1e-3 and np.abs(slopes[3:9]).max() > 1e-3
    back = system.bodies(np.array([y, y]))
    assert np.allclose(back[0], [q.ravel()] * 2, atol=1e-14) and back[0].shape == (2, 12)
    assert np.allclose(back[1], [p.ravel()] * 2, atol=1e-14) and back[1].shape == (2, 12)


def test_few_turns_solve_keplers_equation_for_all_orbits(monkeypatch: Any) -> None:
    """Laguerre's iteration, of degree five, from a series of fourth order in t for short times and
    from t/r_0 for long ones; no turn is made only to see that there is nothing left to do.
    """
    seen = [0]
    stumpff = universal_variables.stumpff

    def counted(z: float) -> Any:
        seen[0] += 1
        return stumpff(z)

    monkeypatch.setattr(universal_variables, "stumpff", counted)
    counts = []
    for speed in (0.3, 0.9, 1.2, np.sqrt(2.0), 1.8):  # ellipses, a parabola, a hyperbola
        for t in (0.01, 0.1, -2.0, 6.0):
            seen[0] = 0
            planetary_system.kepler_step(lm.vec(1.0, 0.0, 0.2), lm.vec(0.1, speed, 0.0), 1.0, t)
            counts.append(seen[0])
    assert counts == [1, 2, 4, 6, 1, 1, 2, 3, 1, 1, 3, 4, 1, 2, 3, 3, 1, 2, 4, 6]


def test_a_top_by_its_vertical() -> None:
    """Energies and slopes of its parts; turns about the axes move both vectors."""
    J, w, c = np.array([1.2, 1.5, 0.7]), 2.0, np.array([0.3, -0.2, 0.5])
    top = lm.models.PoissonTop(J, w, c)
    y = np.array([0.4, -0.7, 0.9, 0.36, 0.48, 0.8])
    wanted = [0.5 * y[i] ** 2 / J[i] for i in range(3)] + [w * c @ y[3:]]
    slopes = [y[i] / J[i] * np.eye(6)[i] for i in range(3)] + [np.r_[0.0, 0.0, 0.0, w * c]]
    for part, energy, slope in zip(top.hamiltonian.parts, wanted, slopes, strict=True):
        assert part.energy(lm.vec(*y)) == pytest.approx(energy, rel=1e-14)
        assert np.allclose(part.gradient(lm.vec(*y)), slope, rtol=1e-14)
    assert top.energy(lm.vec(*y)) == pytest.approx(sum(wanted), rel=1e-14)
    kept = top.constants({"y": y[None]})
    assert sorted(kept) == ["Casimir 1", "Casimir 2", "energy"]
    for axis in range(3):
        turned = top.hamiltonian.parts[axis].flow(top.structure, lm.vec(*y), 0.6)
        R = Rotation.from_rotvec(-0.6 * y[axis] / J[axis] * np.eye(3)[axis]).as_matrix()
        assert np.allclose(turned, np.r_[R @ y[:3], R @ y[3:]], atol=1e-15)


def test_the_momentum_about_the_vertical() -> None:
    """sum x p_y - y p_x, of chains in space and in the plane of many samples."""
    for dimension in (3, 2):
        chain = lm.models.ChainPendulum([1.0, 0.5, 0.8], [1.0, 0.7, 0.4], 9.8, dimension)
        q, p = RNG.normal(size=(2, 5, 3, dimension))
        wanted = (q[..., 0] * p[..., 1] - q[..., 1] * p[..., 0]).sum(axis=-1)
        kept = chain.constants({"q": q.reshape(5, -1), "p": p.reshape(5, -1)})
        assert ("vertical momentum" in kept) is (dimension == 3)
        if dimension == 3:
            assert np.allclose(kept["vertical momentum"], wanted, rtol=1e-13)


def test_how_a_ball_rolls() -> None:
    """v = (R w) x r e3, seen from space."""
    g = np.r_[TURNS[1].ravel(), 0.3, 0.4, 0.5]
    rows = numbers(lm.joints.Rolling(0.7).matrix(lm.vec(*g)))
    w, v = RNG.normal(size=(2, 3))
    wanted = v - np.cross(TURNS[1] @ w, [0.0, 0.0, 0.7])
    assert np.allclose(rows @ np.r_[w, v], wanted, rtol=1e-14)
    w, v = RNG.normal(size=(2, 3))
    assert np.allclose(lm.joints.Suslov([0.0, 0.0, 2.0]).matrix(lm.Mat.of(TURNS[0].tolist())), [[0, 0, 2.0]])
    blade = numbers(lm.joints.Blade(0.4).matrix(lm.Mat.of(np.eye(3).tolist())))
    assert np.allclose(blade, [[-0.4, 0.0, 1.0]])


# ---------------------------------------------------------------- where they are drawn


def test_attitudes_as_quaternions() -> None:
    """Of all four rows: small turns, and half turns about each axis."""
    turns = Rotation.from_rotvec(HALVES)
    R = turns.as_matrix()
    found = poses.quaternions(R)
    assert np.allclose(np.abs((found * turns.as_quat()).sum(axis=1)), 1.0, atol=1e-15)
    others = np.array([exact_top.quaternion(one) for one in R])[:, [1, 2, 3, 0]]
    assert np.allclose(np.abs((others * turns.as_quat()).sum(axis=1)), 1.0, atol=1e-15)
    v = np.array([0.3, -0.5, 0.7])
    assert np.allclose(poses.rotated(found, v), R @ v, atol=1e-15)


@pytest.mark.parametrize("group", [lm.SO3(), lm.SE3(), lm.SE2(), "product", lm.UnitQuaternions()], ids=str)
def test_where_a_body_is_and_how_it_is_turned(group: Any) -> None:
    turns, x = TURNS, PLACES
    system: Any = None
    if isinstance(group, lm.SE2):
        angles = np.array([0.3, -2.0, 1.5, 3.0])
        turns = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()
        x = PLACES * [1.0, 1.0, 0.0]
        g = np.tile(np.eye(3), (4, 1, 1))
        g[:, :2, :2], g[:, :2, 2] = turns[:, :2, :2], x[:, :2]
        system = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 2.0, 2.0]))
    elif isinstance(group, lm.SE3):
        g, system = poses_of(turns, x), lm.models.KirchhoffBody([1.0, 1.5, 2.0, 1.0, 1.0, 1.0])
    elif group == "product":
        system = lm.models.OrbitingBody([1.0, 1.5, 2.0], 1.0, 1.0)
        g = np.concatenate([turns.reshape(4, 9), x], axis=1)
    else:
        system = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 1.5, 2.0]))
        g = Rotation.from_matrix(turns).as_quat() if group == lm.UnitQuaternions() else turns
    found = poses.attitude(system, g)
    wanted = Rotation.from_matrix(turns).as_quat()
    assert np.allclose(np.abs((found * wanted).sum(axis=1)), 1.0, atol=1e-14)
    there = group if group != "product" else system.configurations
    assert poses.is_pose(there) and poses.flies(system) == (group not in (lm.SO3(), lm.UnitQuaternions()))
    if poses.flies(system):
        assert np.array_equal(poses.place(system, g), x)


@pytest.mark.parametrize("last", [2, 4])
def test_products_that_are_no_poses(last: int) -> None:
    assert not poses.is_pose(lm.ProductGroup(lm.SO3(), lm.VectorSpace(last)))
    assert not poses.is_pose(lm.ProductGroup(lm.SO3(), lm.SO3()))
    assert not poses.is_pose(lm.VectorSpace(3))


def test_points_and_rods() -> None:
    """Where points are, the pivots, and which of both the rods join, by hand."""
    q = RNG.normal(size=(2, 6))
    for system, dimension in (
        (lm.models.ChainPendulum([1.0, 1.0], [1.0, 1.0], 9.8, 3), 3),
        (lm.models.ChainPendulum([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], 9.8, 2), 2),
        (lm.models.NBody([1.0, 2.0]), 3),
        (lm.models.FourBarLinkage(2), 2),
    ):
        found = poses.places(system, q, q)
        assert np.array_equal(found, q.reshape(2, -1, dimension))
    one = RNG.normal(size=(3, 1))
    assert np.array_equal(poses.places(lm.models.FermiPastaUlam(1), one, 2.0 * one)[:, 0], np.c_[one, 2.0 * one])
    assert poses.places(lm.Kepler(), q[:, :2], q[:, :2]).shape == (2, 1, 2)
    angle = np.array([[0.4]])
    drawn = poses.places(lm.models.Pendulum(length=0.6), angle, angle)[0]
    assert np.allclose(drawn, [0.6 * np.sin(0.4), -0.6 * np.cos(0.4)])
    pivots, rods = poses.rods(lm.models.FourBarLinkage(2, length=0.5))
    assert np.array_equal(pivots, [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    assert rods == [(3, 0), (4, 1), (5, 2), (0, 1), (1, 2)]
    for system, wanted, width in (
        (lm.models.ChainPendulum([1.0] * 3, [1.0] * 3, 9.8, 3), [(3, 0), (0, 1), (1, 2)], 3),
        (lm.models.ChainPendulum([1.0] * 2, [1.0] * 2, 9.8, 2), [(2, 0), (0, 1)], 2),
        (lm.models.Pendulum(), [(1, 0)], 2),
        (lm.models.DoublePendulum(), [(2, 0), (0, 1)], 2),
        (lm.SphericalPendulum(), [(1, 0)], 3),
    ):
        pivots, rods = poses.rods(system)
        assert np.array_equal(pivots, np.zeros((1, width))) and rods == wanted
    assert poses.rods(lm.Kepler())[1] == []
