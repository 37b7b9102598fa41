"""Bodies in fields of force: forces against their definition, Lie-Verlet's order and structure, and the motion on T*G."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scenes import (
    CAYLEY,
    EXP,
    LAGRANGE,
    TOP,
    falling_body,
    heavy_top,
    lagrange_top,
    named,
    numbers,
    orbiting_body,
    rotation,
    same_bits,
    slope,
)

import liemech as lm
from liemech.formulas import exp, sin
from liemech.groups.rigid.se3 import SE3
from liemech.integrators.kicks.kick_drift import KickDrift
from liemech.integrators.kicks.lie_verlet import LieVerlet
from liemech.models.bodies.gravity import CentralGravity, FixedPointGravity, UniformGravity
from liemech.models.bodies.heavy_top import HeavyTop
from liemech.systems.mechanical import MechanicalSystem
from liemech.systems.potential import Force, NoPotential, Potential

VERLET = LieVerlet()
VERLET_CAYLEY = LieVerlet(lm.Cayley())
METHODS = pytest.mark.parametrize("method", [VERLET, VERLET_CAYLEY, KickDrift()], ids=named)


@lm.record
class Magnet(Potential):
    """A body axis that likes to point along a direction in space, more and more so: V = -k exp(a . g b)."""

    strength: float
    axis: lm.Vec
    direction: lm.Vec

    def energy(self, g: Any) -> float:
        return -self.strength * exp(lm.dot(self.direction, g @ self.axis))


@lm.record
class EnergyOnly(Potential):
    """Another potential without its closed force."""

    other: Potential

    def energy(self, g: Any) -> float:
        return self.other.energy(g)


# ---------------------------------------------------------------- forces


SPACE = lm.ProductGroup(lm.SO3(), lm.VectorSpace(3))
POTENTIALS = [
    (lm.SO3(), FixedPointGravity(1.3, [0.6, 0.1, 0.8])),
    (lm.SO3(), Magnet(0.7, [0.0, 0.6, 0.8], [1.0, 0.0, 0.5])),
    (SE3(), UniformGravity(2.1, [0.3, -0.2, 0.5])),
    (SPACE, CentralGravity(1.2, 0.9, [0.3, 0.5, 0.6])),
    (SPACE, CentralGravity(1.2, 0.9, [[0.3, 0.1, 0.0], [0.1, 0.5, 0.0], [0.0, 0.0, 0.6]])),
    (lm.UnitQuaternions(), EnergyOnly(NoPotential())),
]


@pytest.mark.parametrize(("group", "potential"), POTENTIALS, ids=lambda x: type(x).__name__)
def test_forces_are_what_they_are_defined_to_be(group: lm.LieGroup, potential: Potential) -> None:
    """<f, eta> = -d/ds V(g exp(s eta)), by central differences extrapolated, and the derived one to rounding."""
    rng = np.random.default_rng(3)
    for _ in range(3):
        g = lm.Mat.of(array) if (array := group.random(rng)).ndim == 2 else lm.Vec.of(array)
        force = np.array(potential.force(group, g))

        def along(eta: np.ndarray, s: float, g: Any = g) -> float:
            return potential.energy(group.compose_exp(g, lm.Vec.of(s * eta)))

        for eta, f in zip(np.eye(group.dim), force, strict=True):
            coarse, fine = ((along(eta, s) - along(eta, -s)) / (2 * s) for s in (2e-3, 1e-3))
            assert -f == pytest.approx((4 * fine - coarse) / 3, abs=1e-10 * max(1.0, np.abs(force).max()))
        derived = np.array(EnergyOnly(potential).force(group, g))
        assert np.abs(derived - force).max() <= 1e-15 * max(1.0, np.abs(force).max()) * 4


def test_the_gravity_gradient_torque_is_the_textbook_one() -> None:
    body, start = orbiting_body()
    g, J = np.array(start.g), np.array(body.inertia)
    u = g[:9].reshape(3, 3).T @ g[9:] / 3.0
    assert np.abs(body.force(g)[:3] - 3.0 / 27.0 * np.cross(u, J @ u)).max() < 1e-16


def test_a_force_of_ones_own_on_unit_quaternions() -> None:
    """The height of a body axis, on SU(2) and on SO(3): the same force."""

    @lm.record
    class Height(Potential):
        def energy(self, g: Any) -> float:
            x, y, z, w = g[0], g[1], g[2], g[3]
            return 1.3 * (w * w + z * z - x * x - y * y)

    Q, R = lm.UnitQuaternions(), lm.SO3()
    xi = [0.3, -0.4, 0.8]
    on_q = np.array(Height().force(Q, Q.exp(lm.Vec.of(xi))))
    on_r = np.array(FixedPointGravity(1.3, [0.0, 0.0, 1.0]).force(R, R.exp(lm.Vec.of(xi))))
    assert np.abs(on_q - on_r).max() < 1e-15


# ---------------------------------------------------------------- order


@pytest.mark.slow
@METHODS
@pytest.mark.parametrize(
    ("scene", "numbers_at"), [(heavy_top, TOP), (lagrange_top, LAGRANGE)], ids=["heavy", "Lagrange"]
)
def test_order_two_against_the_reference(method: lm.Method, scene: Any, numbers_at: dict[str, Any]) -> None:
    """Momentum, vertical and attitude; also where the attitude itself is given."""
    top, start = scene()
    at = numbers_at["samples"][2]
    errors = []
    counts = (80, 160, 320, 640)
    for n in counts:
        run = lm.integrate(top, method, start, h=2.0 / n, steps=n)
        parts = [run.mu[-1] - numbers(at["pi"]), run.g[-1][2] - numbers(at["Gamma"])]
        errors.append([np.abs(p).max() for p in (*parts, *([run.g[-1] - numbers(at["R"])] if "R" in at else []))])
    for error in np.array(errors).T:
        assert slope([2.0 / n for n in counts], error) == pytest.approx(2.0, abs=0.1)


def test_adaptive_steps_in_a_field() -> None:
    top, start = heavy_top()
    run = lm.integrate(top, lm.RKMK(order=5), start, t_end=2.0, rtol=1e-7, atol=1e-8)
    assert np.abs(run.mu[-1] - numbers(TOP["samples"][2]["pi"])).max() < 1e-5
    assert np.abs(run.at(1.0).g[2] - numbers(TOP["samples"][1]["Gamma"])).max() < 1e-5


@pytest.mark.slow
def test_falling_bodies_fall_on_parabolas() -> None:
    body, start = falling_body()
    run = lm.integrate(body, VERLET, start, h=1 / 400, steps=400)
    exact = body.exact(start, run.t)
    assert np.abs(run.g - exact.g).max() < 1e-5
    fine = lm.integrate(body, lm.RKMK(order=6), start, h=1 / 100, steps=100)
    assert np.abs(fine.g[-1] - exact.g[-1]).max() < 1e-10
    assert np.abs(fine.mu[-1] - exact.mu[-1]).max() < 1e-10


# ---------------------------------------------------------------- structure


@pytest.mark.slow
@pytest.mark.compiled
@METHODS
def test_vertical_momentum_and_energy_of_tops(method: lm.Method) -> None:
    for scene, numbers_at in ((heavy_top, TOP), (lagrange_top, LAGRANGE)):
        top, start = scene()
        assert top.energy(start.mu, start.g) == pytest.approx(float(numbers_at["energy"]), rel=1e-15)
        run = lm.integrate(top, method, start, h=0.1, steps=5000)
        vertical = np.einsum("ni,ni->n", run.mu, run.g[:, 2, :])
        wanted = float(numbers_at["vertical_momentum_pi_dot_Gamma"])
        assert np.abs(vertical - wanted).max() < 1e-13
        assert np.abs(run.g.transpose(0, 2, 1) @ run.g - np.eye(3)).max() < 1e-13
        energy = np.abs(top.energy(run.mu, run.g) - float(numbers_at["energy"]))
        assert energy[2500:].max() <= 1.2 * energy[:2500].max() < 0.1
        report = run.drift()
        assert report["energy"].verdict == "bounded"
        assert report["vertical momentum"].verdict == "exact"


@pytest.mark.slow
def test_the_spin_of_the_lagrange_top_is_kept() -> None:
    top, start = lagrange_top()
    for method in (VERLET, VERLET_CAYLEY):
        assert lm.integrate(top, method, start, h=0.1, steps=2000).drift()["spin"].verdict == "exact"


@pytest.mark.slow
def test_symmetries_of_gravity_in_space() -> None:
    for scene, names, h in (
        (falling_body, ("vertical Pi", "horizontal P"), 0.02),
        (orbiting_body, ("angular momentum",), 0.2),
    ):
        system, start = scene()
        report = lm.integrate(system, VERLET, start, h=h, steps=250).drift()
        for name in names:
            assert report[name].largest < 3e-12


@lm.record
class Overlap(Potential):
    """V(g) = tr(a^T g), on any group of matrices."""

    a: lm.Mat

    def energy(self, g: Any) -> float:
        total = 0.0
        for i in range(len(g)):
            total = total + lm.dot(self.a[i], g[i])
        return total


@pytest.mark.slow
@pytest.mark.parametrize("group", [lm.SO(4), lm.Heisenberg(), lm.SL(2)], ids=repr)
def test_order_two_on_other_groups(group: lm.LieGroup) -> None:
    """With a force that is derived, by definition -tr(a^T g hat(e_i))."""
    rng = np.random.default_rng(8)
    a = rng.normal(size=group.element_shape)
    system = MechanicalSystem(
        lm.LiePoissonSystem(group, lm.KineticEnergy(np.linspace(1.0, 2.0, group.dim))), Overlap(a)
    )
    g = np.array(group.exp(0.3 * rng.normal(size=group.dim)))
    wanted = [-np.trace(a.T @ g @ np.array(group.algebra.hat(unit))) for unit in np.eye(group.dim)]
    assert np.abs(system.force(g) - wanted).max() < 1e-14
    start = system.state(0.5 * rng.normal(size=group.dim), g)
    exact = lm.integrate(system, lm.RKMK(order=6), start, h=1 / 30, steps=15, compiled=False)
    errors = []
    for n in (10, 20, 40):
        run = lm.integrate(system, VERLET, start, h=0.5 / n, steps=n, compiled=False)
        errors.append([np.abs(run.mu[-1] - exact.mu[-1]).max(), np.abs(run.g[-1] - exact.g[-1]).max()])
    for error in np.array(errors).T:
        assert slope([10, 5, 2.5], error) == pytest.approx(2.0, abs=0.1)


@pytest.mark.slow
def test_other_methods_for_equations_on_groups() -> None:
    top, start = heavy_top()
    for method in (lm.CommutatorFree(), lm.CrouchGrossman()):
        errors = []
        for n in (40, 80):
            run = lm.integrate(top, method, start, h=2.0 / n, steps=n)
            errors.append(np.abs(run.mu[-1] - numbers(TOP["samples"][2]["pi"])).max())
        assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "free"), [(VERLET, EXP), (VERLET_CAYLEY, CAYLEY)], ids=["exp", "Cayley"])
def test_without_a_field_it_is_algorithm_1(method: lm.Method, free: lm.CovariantVariational) -> None:
    rng = np.random.default_rng(5)
    for body, mu, g in (
        (lm.RigidBody([1.0, 1.6, 2.3]), [0.3, 0.8, -0.4], rotation(rng)),
        (
            lm.LiePoissonSystem(SE3(), lm.KineticEnergy([1.0, 1.6, 2.3, 1.0, 1.2, 1.5])),
            rng.normal(size=6),
            SE3().random(rng),
        ),
    ):
        field = MechanicalSystem(body, NoPotential())
        a = lm.integrate(field, method, field.state(mu, g), h=0.1, steps=200, compensated=False, compiled=False)
        b = lm.integrate(body, free, body.state(mu, g), h=0.1, steps=200, compensated=False, compiled=False)
        assert same_bits(a.mu, b.mu)
        assert same_bits(a.g, b.g)
        assert a.drift()["spatial momentum"].verdict == "exact"


# ---------------------------------------------------------------- loads


@lm.record
class Friction(Force):
    """-c xi, and a torque about a body axis that comes and goes."""

    friction: float
    drive: float

    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return lm.vec(0.0, self.drive * sin(2.0 * t), 0.0) - self.friction * xi


def loaded_top(friction: float = 0.2, drive: float = 0.3) -> tuple[MechanicalSystem, lm.BodyState]:
    top, start = heavy_top()
    return HeavyTop(top.inertia, top.weight, top.centre, load=Friction(friction, drive)), start


@pytest.mark.slow
@METHODS
def test_order_two_under_a_load(method: lm.Method) -> None:
    system, start = loaded_top()
    exact = lm.integrate(system, lm.RKMK(order=6), start, h=0.01, steps=100, t0=0.3)
    counts, errors = (40, 80, 160), []
    for n in counts:
        run = lm.integrate(system, method, start, h=1 / n, steps=n, t0=0.3)
        errors.append([np.abs(run.mu[-1] - exact.mu[-1]).max(), np.abs(run.g[-1] - exact.g[-1]).max()])
    for error in np.array(errors).T:
        assert slope([1 / n for n in counts], error) == pytest.approx(2.0, abs=0.1)


def test_a_way_back_undoes_a_way_under_a_load() -> None:
    system, start = loaded_top()
    away = lm.integrate(system, VERLET, start, h=0.05, steps=40)
    home = lm.integrate(system, VERLET, away.last, h=-0.05, steps=40, t0=2.0)
    assert np.abs(home.mu[-1] - np.array(start.mu)).max() < 1e-12
    assert np.abs(home.g[-1] - np.array(start.g)).max() < 1e-12


@pytest.mark.slow
def test_friction_takes_what_it_does_in_work() -> None:
    """dE/dt = <F, xi>; and the top comes to hang."""
    system, start = loaded_top(0.5, 0.0)
    run = lm.integrate(system, VERLET, start, h=0.01, steps=6000)
    energy, power = system.energy(run.mu, run.g), -0.5 * (system.velocity(run.mu) ** 2).sum(axis=1)
    work = np.concatenate([[0.0], np.cumsum(0.005 * (power[1:] + power[:-1]))])
    assert np.abs(energy - energy[0] - work).max() < 1e-3
    assert energy[-1] == pytest.approx(-1.3, abs=1e-3)
    assert run.drift().kept == ()
    assert "no constants" in str(run.drift())


# ---------------------------------------------------------------- plain, compiled, many


"""Every method and every scene; all pairs are slow."""


def test_many_members_may_share_a_configuration() -> None:
    top, start = heavy_top()
    many = top.state(np.random.default_rng(1).normal(size=(4, 3)), np.array(start.g))
    assert many.bodies == 4
    assert many.g.shape == (4, 3, 3)


def test_formulas_of_a_system_take_arrays() -> None:
    top, _ = heavy_top()
    rng = np.random.default_rng(2)
    for n in (3, 3000):
        mu, g = rng.normal(size=(n, 3)), lm.SO3().random(rng, n)
        assert np.allclose(top.force(g), 1.3 * np.cross(g[:, 2], [0.6, 0.0, 0.8]), atol=1e-15)
        wanted = 0.5 * (mu**2 / [1.0, 1.5, 0.7]).sum(1) + 1.3 * g[:, 2] @ [0.6, 0.0, 0.8]
        assert np.allclose(top.energy(mu, g), wanted, atol=1e-14)
        assert np.allclose(top.spatial_momentum(mu, g), np.einsum("nij,nj->ni", g, mu), atol=1e-14)
    with pytest.raises(lm.errors.InvalidInput, match="not in SO3"):
        top.force(2.0 * np.eye(3))
    assert top.force(np.empty((0, 3, 3))).shape == (0, 3)


# ---------------------------------------------------------------- refusals


def test_methods_that_do_not_know_fields_refuse_them() -> None:
    top, start = heavy_top()
    with pytest.raises(lm.errors.IncompatibleSystem, match="lagrangian"):
        lm.integrate(top, EXP, start, h=0.1, steps=1)
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"a body in a field.*CovariantVariational"):
        lm.integrate(top.body, VERLET, top.body.state(start.mu, start.g), h=0.1, steps=1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="cannot be used on"):
        lm.integrate(top, lm.RKMK(order=4, retraction=lm.Cayley()), start, h=0.1, steps=1)
    with pytest.raises(lm.errors.IncompatibleSystem, match="a body in a field"):
        VERLET.require(3)
    with pytest.raises(lm.errors.IncompatibleSystem, match="Give h and steps"):
        lm.integrate(top, VERLET, start, t_end=1.0)


def test_lie_verlet_asks_for_a_lagrangian_and_a_retraction() -> None:
    @lm.record
    class Free(lm.Hamiltonian):
        def energy(self, mu: lm.Vec) -> float:
            return 0.5 * lm.dot(mu, mu)

    system = MechanicalSystem(lm.LiePoissonSystem(lm.SO3(), Free()), NoPotential())
    with pytest.raises(lm.errors.IncompatibleSystem, match="lagrangian"):
        lm.integrate(system, VERLET, system.state([0.1, 0.2, 0.3], np.eye(3)), h=0.1, steps=1)
    linear = MechanicalSystem(lm.LiePoissonSystem(lm.SL(3), lm.KineticEnergy(np.ones(8))), NoPotential())
    with pytest.raises(lm.errors.IncompatibleSystem, match="Cayley"):
        lm.integrate(linear, VERLET_CAYLEY, linear.state(np.ones(8), np.eye(3)), h=0.1, steps=1)


@pytest.mark.parametrize(
    ("mu", "g", "words"),
    [
        ([0.1, 0.2, 0.3], None, "g is missing"),
        ([0.1, 0.2], np.eye(3), "shape"),
        ([0.1, 0.2, np.nan], np.eye(3), "nan"),
        ([0.1, 0.2, 0.3], np.diag([1.0, 1.0, -1.0]), "reflection"),
        (np.ones((3, 3)), np.stack([np.eye(3)] * 2), "3 momenta and 2"),
    ],
)
def test_starts_that_cannot_be_meant(mu: Any, g: Any, words: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=words):
        heavy_top()[0].state(mu, g)


def test_parts_that_cannot_be_meant() -> None:
    with pytest.raises(lm.errors.InvalidType, match="body must be a LiePoissonSystem"):
        MechanicalSystem(lm.SO3(), NoPotential())
    with pytest.raises(lm.errors.InvalidType, match="potential must be a Potential"):
        MechanicalSystem(lm.RigidBody([1.0, 1.5, 0.7]), lm.KineticEnergy([1.0, 1.0, 1.0]))
    with pytest.raises(lm.errors.InvalidType, match="retraction must be"):
        LieVerlet("exp")
    with pytest.raises(NotImplementedError, match="must define `energy`"):
        MechanicalSystem(lm.RigidBody([1.0, 1.5, 0.7]), Potential()).energy([0.1, 0.2, 0.3], np.eye(3))


def test_steps_that_are_too_large_say_so() -> None:
    top, start = heavy_top()
    with pytest.raises(lm.errors.IntegrationFailure, match=r"CovariantVariational.*too large") as caught:
        lm.integrate(top, VERLET, start, h=20.0, steps=100)
    assert len(caught.value.trajectory) >= 1


def test_face() -> None:
    assert repr(VERLET_CAYLEY) == "LieVerlet(retraction=Cayley())"
    assert VERLET_CAYLEY.name == "Lie-Verlet (Cayley)"
    assert VERLET.order == 2
    assert VERLET.symmetric
    assert VERLET.symplectic
