"""Models: heavy tops in their two forms, Kirchhoff's body, falling and orbiting ones."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
import shipped
from scenes import TOP, heavy_top, numbers, reference, slope

import liemech as lm
from liemech.groups.rigid.se3 import SE3
from liemech.integrators.kicks.lie_verlet import LieVerlet
from liemech.models.bodies.gravity import FixedPointGravity, UniformGravity
from liemech.models.bodies.heavy_top import HeavyTop, LagrangeTop, ReducedHeavyTop
from liemech.models.bodies.kirchhoff import KirchhoffBody
from liemech.models.poses import attitude, places
from liemech.models.space.space_bodies import FallingBody, OrbitingBody
from liemech.names import everything
from liemech.systems.lie_poisson import BodyState

KIRCHHOFF = reference("kirchhoff_se3")


# ---------------------------------------------------------------- heavy tops


def test_the_equations_of_both_forms() -> None:
    """pi' = pi x xi + w Gamma x c and Gamma' = Gamma x xi, from each of them."""
    top, start = heavy_top()
    pi, gamma = np.array(start.mu), np.array(start.g)[2]
    xi, torque = pi / numbers(TOP["J"]), float(TOP["mgl"]) * np.cross(gamma, numbers(TOP["chi"]))
    assert (
        np.abs(np.cross(pi, xi) + torque - (top.body.group.ad_star(xi, pi) + top.force(np.array(start.g)))).max()
        < 1e-15
    )
    reduced = top.reduced
    mu = np.array(reduced.from_top(start).mu)
    rate = reduced.group.ad_star(reduced.velocity(mu), mu)
    assert np.abs(rate - np.r_[np.cross(pi, xi) + torque, np.cross(gamma, xi)]).max() < 1e-15
    assert reduced.energy(mu) == pytest.approx(top.energy(start.mu, start.g), rel=1e-15)
    assert np.allclose(reduced.casimirs(mu), [1.0, float(TOP["vertical_momentum_pi_dot_Gamma"])], rtol=1e-15)


@pytest.mark.slow
def test_both_forms_follow_the_reference() -> None:
    top, start = heavy_top()
    reduced = top.reduced
    run = lm.integrate(reduced, lm.RKMK(order=6), reduced.from_top(start), h=0.01, steps=1000)
    for at in TOP["samples"]:
        k = round(float(at["t"]) / 0.01)
        assert np.abs(run.mu[k] - np.r_[numbers(at["pi"]), numbers(at["Gamma"])]).max() < 1e-11
    assert np.abs(run.g[:, 2, :3] - run.mu[:, 3:]).max() < 1e-12  # the attitude keeps up with Gamma


@pytest.mark.slow
def test_lie_verlet_converges_to_the_reduced_motion() -> None:
    top, start = heavy_top()
    reduced = top.reduced
    fine = lm.integrate(reduced, lm.RKMK(order=4), reduced.from_top(start), h=1e-3, steps=3000)
    h, errors = [0.05, 0.025, 0.0125], []
    for step in h:
        run = lm.integrate(top, LieVerlet(), start, h=step, steps=round(3 / step))
        errors.append(max(np.abs(run.mu[-1] - fine.mu[-1, :3]).max(), np.abs(run.g[-1] - fine.g[-1, :3, :3]).max()))
    assert slope(h, errors) == pytest.approx(2.0, abs=0.1)


def test_the_reduced_top_has_no_lagrangian() -> None:
    top, start = heavy_top()
    with pytest.raises(lm.errors.IncompatibleSystem, match="lagrangian"):
        lm.integrate(top.reduced, lm.CovariantVariational(), top.reduced.from_top(start), h=0.1, steps=1)


def test_ensembles_of_reduced_tops() -> None:
    top, _ = heavy_top()
    rng = np.random.default_rng(1)
    many = top.state(rng.normal(size=(4, 3)), lm.SO3().random(rng, 4))
    assert top.reduced.from_top(many).mu.shape == (4, 6)


@pytest.mark.slow
def test_a_lagrange_top_precesses_steadily() -> None:
    """At the inclination theta the slow precession solves A cos(theta) W^2 - mu3 W + w l = 0.

    Source: Goldstein, Classical Mechanics, 3rd ed., equation (5.76).
    """
    top = LagrangeTop(transverse=1.2, axial=0.5, weight=2.0, length=0.7)
    theta, spin = 0.4, 5.0
    W = (spin - np.sqrt(spin**2 - 4 * 1.2 * np.cos(theta) * 1.4)) / (2 * 1.2 * np.cos(theta))
    g = lm.SO3().exp([theta, 0.0, 0.0])
    start = top.state(np.r_[1.2 * W * g[2, :2], spin], g)
    run = lm.integrate(top, lm.RKMK(order=6), start, h=0.01, steps=1000)
    assert np.abs(run.g[:, 2, 2] - np.cos(theta)).max() < 1e-11
    assert run.g[-1, 0, 2] == pytest.approx(np.sin(theta) * np.sin(W * 10.0), abs=1e-10)
    assert run.g[-1, 1, 2] == pytest.approx(-np.sin(theta) * np.cos(W * 10.0), abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "sleeps"), [(1.05, True), (0.9, False)])
def test_an_upright_top_sleeps_if_it_spins_fast_enough(factor: float, sleeps: bool) -> None:
    """Source: Marsden and Ratiu, theorem 15.10.1: mu_3^2 > 4 A w l."""
    top = LagrangeTop(transverse=1.2, axial=0.5, weight=2.0, length=0.7)
    spin = factor * top.sleeping_momentum
    assert top.sleeping_momentum**2 == pytest.approx(4 * 1.2 * 1.4, rel=1e-15)
    run = lm.integrate(
        top, LieVerlet(), top.state([0.0, 0.0, spin], lm.SO3().exp([1e-4, 0.0, 0.0])), h=0.02, steps=5000
    )
    tilt = np.arccos(np.clip(run.g[:, 2, 2], -1.0, 1.0)).max()
    assert bool(tilt < 1e-2) is sleeps


# ---------------------------------------------------------------- Kirchhoff's body


def kirchhoff() -> tuple[KirchhoffBody, lm.BodyState]:
    A, D, M = (numbers(KIRCHHOFF[k]) for k in "ADM")
    inertia = np.linalg.inv(np.block([[A, D], [D.T, M]]))
    body = KirchhoffBody(0.5 * (inertia + inertia.T))
    g = np.eye(4)
    g[:3, :3], g[:3, 3] = numbers(KIRCHHOFF["R0"]), numbers(KIRCHHOFF["x0"])
    return body, body.state(np.r_[numbers(KIRCHHOFF["Pi0"]), numbers(KIRCHHOFF["P0"])], g)


def test_kirchhoffs_body_follows_the_reference() -> None:
    body, start = kirchhoff()
    assert body.energy(start.mu) == pytest.approx(float(KIRCHHOFF["energy"]), rel=1e-14)
    keys = "casimir_P_dot_P", "casimir_Pi_dot_P"
    assert np.allclose(body.casimirs(start.mu), [float(KIRCHHOFF[k]) for k in keys], rtol=1e-14)
    spatial = np.r_[numbers(KIRCHHOFF["spatial_angular_momentum"]), numbers(KIRCHHOFF["spatial_linear_momentum"])]
    assert np.abs(np.array(body.spatial_momentum(start.mu, start.g)) - spatial).max() < 1e-14
    run = lm.integrate(body, lm.RKMK(order=8), start, h=0.05, steps=200)
    for at in KIRCHHOFF["samples"]:
        k = round(float(at["t"]) / 0.05)
        assert np.abs(run.mu[k] - np.r_[numbers(at["Pi"]), numbers(at["P"])]).max() < 1e-11
        assert np.abs(run.g[k, :3, :3] - numbers(at["R"])).max() < 1e-11
        assert np.abs(run.g[k, :3, 3] - numbers(at["x"])).max() < 1e-11


def test_blocks_of_the_inertia() -> None:
    D = np.array([[0.1, 0.0, 0.05], [0.0, -0.1, 0.0], [0.02, 0.0, 0.0]])
    body = KirchhoffBody.of_blocks([1.0, 1.6, 2.3], [1.0, 1.1, 1.2], D)
    w, v = np.array([0.3, 0.4, 0.5]), np.array([-0.2, 0.1, 0.6])
    wanted = 0.5 * w @ (np.array([1.0, 1.6, 2.3]) * w) + w @ D @ v + 0.5 * v @ (np.array([1.0, 1.1, 1.2]) * v)
    assert body.lagrangian.value(np.r_[w, v]) == pytest.approx(wanted, rel=1e-15)
    assert KirchhoffBody.of_blocks([1.0, 1.6, 2.3], 1.7) == KirchhoffBody([1.0, 1.6, 2.3, 1.7, 1.7, 1.7])


@pytest.mark.parametrize(
    ("inertia", "words"),
    [
        (np.ones(3), "shape"),
        ([1.0, 1.0, 1.0, 1.0, 1.0, -1.0], "principal moment -1; all must be positive"),
        (np.eye(6) + np.triu(np.ones((6, 6)), 1), "not symmetric"),
        (np.ones((6, 6)), "scaled to a diagonal of ones, which is zero up to rounding; all must be positive"),
        ([1.0, 1.0, np.inf, 1.0, 1.0, 1.0], "finite"),
    ],
)
def test_inertia_that_cannot_be_meant(inertia: Any, words: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=words):
        KirchhoffBody(inertia)


def test_inertia_in_mixed_units_is_fine() -> None:
    """A small heavy body: kg m^2 beside kg."""
    KirchhoffBody(np.diag([1e-12, 1e-12, 2e-12, 1.0, 1.0, 1.0]))


@pytest.mark.slow
def test_a_bottom_heavy_vehicle_swings_upright() -> None:
    """Neutrally buoyant, with the centre of mass below: a pendulum, of frequency sqrt(w l/J) for small angles."""
    from liemech.systems.mechanical import MechanicalSystem
    from liemech.systems.potential import Potential

    @lm.record
    class Righting(Potential):
        moment: float

        def energy(self, g: Any) -> float:
            return -self.moment * g[2, 2]

    vehicle = MechanicalSystem(KirchhoffBody([2.0, 2.0, 1.0, 10.0, 10.0, 12.0]), Righting(3.0))
    g = np.eye(4)
    g[:3, :3] = lm.SO3().exp([1e-3, 0.0, 0.0])
    run = lm.integrate(vehicle, LieVerlet(), vehicle.state(np.zeros(6), g), h=0.01, steps=500)
    assert np.abs(run.g[:, 2, 1] - 1e-3 * np.cos(np.sqrt(1.5) * run.t)).max() < 1e-7


# ---------------------------------------------------------------- in space


@pytest.mark.slow
def test_an_orbit_closes() -> None:
    body = OrbitingBody([1000.0, 1600.0, 2300.0], mass=500.0, attraction=3.986004418e14)
    start = body.circular_orbit(7e6)
    period = 2 * np.pi * np.sqrt(7e6**3 / 3.986004418e14)
    run = lm.integrate(body, lm.RKMK(order=6), start, h=period / 60, steps=60, compiled=False)
    assert np.abs(run.g[-1, 9:] - run.g[0, 9:]).max() < 10.0  # m
    radial = np.einsum("nij,ni->nj", run.g[:, :9].reshape(-1, 3, 3), run.g[:, 9:]) / 7e6
    # its axis of least inertia looks at the Earth
    assert np.abs(radial - [1.0, 0.0, 0.0]).max() < 1e-6


@pytest.mark.slow
def test_a_satellite_librates_about_the_vertical() -> None:
    """Small pitch angles oscillate with n sqrt(3 (J_2 - J_1)/J_3), n the rate of the orbit.

    Source: Hughes, Spacecraft Attitude Dynamics, chapter 9.
    """
    J, k, radius = [1000.0, 1600.0, 2300.0], 3.986004418e14, 7e6
    body, n = OrbitingBody(J, mass=500.0, attraction=k), np.sqrt(k / radius**3)
    start = body.circular_orbit(radius, lm.SO3().exp([0.0, 0.0, 0.02]))
    run = lm.integrate(body, LieVerlet(), start, h=2 * np.pi / n / 500, steps=600)
    radial = np.einsum("nij,ni->nj", run.g[:, :9].reshape(-1, 3, 3), run.g[:, 9:]) / radius
    wanted = 0.02 * np.cos(np.sqrt(3 * (J[1] - J[0]) / J[2]) * n * run.t)
    assert np.abs(np.arctan2(-radial[:, 1], radial[:, 0]) - wanted).max() < 0.02 * 0.02
    assert run.drift()["energy"].verdict != "drifting"
    assert run.drift()["angular momentum"].largest < 1e-12


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: HeavyTop([1.0, 1.5, 0.7], 1.0, [0.0, 1.0]), "centre"),
        (lambda: HeavyTop([1.0, 1.5, 0.7], np.nan, [0.0, 0.0, 1.0]), "weight must be finite"),
        (lambda: ReducedHeavyTop([1.0, 1.5, 0.7], 1.0, [0.0, 0.0, np.inf]), "centre must be finite"),
        (lambda: HeavyTop([1.0, 1.5, -0.7], 1.0, [0.0, 0.0, 1.0]), "positive"),
        (lambda: FixedPointGravity(1.0, [1.0]), "centre"),
        (lambda: UniformGravity(np.inf), "weight"),
        (lambda: FallingBody([1.0, 1.5, 0.7], 0.0), "mass must be a positive"),
        (lambda: OrbitingBody([1.0, 1.5, 0.7], np.nan, 1.0), "mass must be a positive"),
        (lambda: OrbitingBody([1.0, 1.5, 0.7], 1.0, 1.0).circular_orbit(-1.0), "radius must be a positive"),
        (lambda: OrbitingBody([1.0, 1.5, 0.7], 1.0, 0.0), "attraction must be a positive"),
        (lambda: OrbitingBody([1.0, 1.5, 0.7], 1.0, 1.0).circular_orbit(1.0, np.eye(4)), "g has shape"),
        (
            lambda: OrbitingBody([1.0, 1.5, 0.7], 1.0, 1.0).circular_orbit(1.0, np.stack([np.eye(3)] * 2)),
            "one attitude",
        ),
        (lambda: OrbitingBody([1.0, 1.5, 0.7], 1.0, 1.0).circular_orbit(1.0, spin=[1.0]), "spin has shape"),
        (
            lambda: ReducedHeavyTop([1.0, 1.5, 0.7], 1.0, [0.0, 0.0, 1.0]).from_top(
                lm.BodyState(lm.Vec(1.0, 1.0, 1.0))
            ),
            "from_top",
        ),
        (lambda: KirchhoffBody.of_blocks([1.0, 1.5, 0.7], 1.0, [1.0, 2.0, 3.0]), "coupling"),
        (lambda: KirchhoffBody.of_blocks([1.0, 1.5], 1.0), "angular"),
    ],
)
def test_models_that_cannot_be_meant(make: Any, words: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=words):
        make()


@pytest.mark.parametrize("model", shipped.MODELS, ids=lambda model: type(model).__name__)
def test_faces(model: Any) -> None:
    assert pickle.loads(pickle.dumps(model)) == model
    if not isinstance(model, (lm.models.CosseratRod, lm.models.VonNeumann)):  # which print matrices by their size
        assert eval(repr(model), everything()) == model


def test_faces_of_tops() -> None:
    assert repr(HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])) == (
        "HeavyTop(inertia=Vec(1.0, 1.5, 0.7), weight=1.3, centre=Vec(0.6, 0.0, 0.8))"
    )
    assert SE3() == FallingBody([1.0, 1.5, 0.7], 1.0).configurations


@pytest.mark.parametrize("times", [[[0.0, 1.0]], float("nan"), [0.0, float("inf")]], ids=str)
def test_exact_motions_refuse_times_alike(times: Any) -> None:
    turning, falling = lm.RigidBody([1.0, 1.5, 2.0]), lm.models.FallingBody([1.0, 1.5, 2.0], 1.0)
    for system, start in (
        (turning, turning.state([0.5, 0.1, 0.8])),
        (falling, falling.state([0.5, 0.1, 0.8, 0.0, 0.0, 1.0], np.eye(4))),
    ):
        with pytest.raises(lm.errors.InvalidInput, match=f"{type(system).__name__}.exact: t must"):
            system.exact(start, times)


def test_the_exact_fall_asks_for_a_pose() -> None:
    body = lm.models.FallingBody([1.0, 1.6, 2.3], mass=1.7)
    with pytest.raises(lm.errors.InvalidInput, match=r"FallingBody\.exact: start has no pose g"):
        body.exact(BodyState(lm.vec(1.0, 2.0, 3.0, 0.0, 0.0, 0.0)), 0.1)


def test_the_vertical_momentum_of_a_chain_is_that_of_its_points() -> None:
    chain, rng = lm.models.ChainPendulum([1.0, 0.5, 0.8], [1.0, 0.7, 0.4]), np.random.default_rng(2)
    q, p = rng.normal(size=(2, 3 * 3))
    wanted = np.cross(q.reshape(3, 3), p.reshape(3, 3))[:, 2].sum()
    assert chain.vertical_momentum(lm.vec(*q), lm.vec(*p)) == pytest.approx(wanted, rel=1e-14)


def test_where_the_bobs_of_a_double_pendulum_are_drawn() -> None:
    q = np.array([[0.3, -1.1], [2.0, 0.4]])
    arms = np.stack([np.sin(q), -np.cos(q)], axis=-1) * np.array([1.0, 0.6])[:, None]
    drawn = places(lm.models.DoublePendulum([1.0, 1.0], [1.0, 0.6], 9.81), q, 0.0 * q)
    assert np.allclose(drawn, np.cumsum(arms, axis=1), rtol=0.0, atol=1e-15)


def test_a_body_in_the_plane_turns_about_the_normal() -> None:
    plane = lm.SE2()
    body = lm.LiePoissonSystem(plane, lm.KineticEnergy([1.0, 2.0, 2.0]))
    g = np.array([plane.exp([angle, 0.3, 0.2]) for angle in (0.4, -2.0)])
    wanted = [[0.0, 0.0, np.sin(a / 2), np.cos(a / 2)] for a in (0.4, -2.0)]
    assert np.allclose(attitude(body, g), wanted, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("make", [
    lambda many: lm.models.OrthonormalFrame(lm.each([[[0.0], [1.0]]] * many)),
    lambda many: lm.models.VonNeumann([1.0, 2.0], hbar=lm.each([1.0] * many)),
    lambda many: lm.models.ZeitlinSphere(13, lm.each([1.0] * many)),
])  # fmt: skip
def test_values_of_each_body_are_refused_by_name(make):
    """A bare TypeError of Python or NumPy was raised."""
    with pytest.raises(
        lm.errors.InvalidType, match=r"(field|hbar|rotation) must be real numbers; got .* each\(2 values"
    ):
        make(2)
