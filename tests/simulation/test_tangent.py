"""Tangent maps are the derivatives of the discrete motion: against differences, exact flows, and
the two-form they must keep.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from scenes import WORLDS, slow

import liemech as lm
from liemech import errors
from liemech.tableaus import gauss

SO3 = lm.SO3()
BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state(mu=[0.5, -0.3, 0.75], g=SO3.exp([0.1, 0.2, 0.3]))
TOP = lm.models.HeavyTop(inertia=[1.0, 1.5, 0.7], weight=1.3, centre=[0.6, 0.0, 0.8])
TOP_START = TOP.state(mu=[0.3, 0.2, 2.0], g=SO3.exp([0.1, 0.2, 0.3]))


def off(a: lm.Trajectory, b: lm.Trajectory, middle: lm.Trajectory) -> np.ndarray:
    """The difference of two ends: of momenta, and of attitudes as eta in g hat(eta) at the end of a third run."""
    turned = [SO3.log(middle.g[-1].T @ run.g[-1]) for run in (a, b)]
    return np.concatenate([a.mu[-1] - b.mu[-1], turned[0] - turned[1]])


def differences(plan: lm.Plan, start: Any, steps: int) -> np.ndarray:
    """The tangent map at the end by central differences of order four."""
    middle, columns = plan.run(start, steps=steps), []
    for unit in np.eye(6):
        column = np.zeros(6)
        for k, weight in ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
            sides = []
            for x in (k * 1e-3 * unit, -k * 1e-3 * unit):
                moved = plan.system.state(mu=np.array(start.mu) + x[:3], g=np.array(start.g) @ SO3.exp(x[3:]))
                sides.append(plan.run(moved, steps=steps))
            column += weight * off(*sides, middle) / 1e-3
        columns.append(column)
    return np.array(columns).T


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("method", "system", "start"),
    [
        (lm.RKMK(order=4), BODY, START),
        (lm.CovariantVariational(lm.Exponential()), BODY, START),
        (lm.Composition(lm.CovariantVariational(lm.Cayley()), order=4), BODY, START),
        (lm.LiePoissonHamiltonJacobi(order=4), BODY, START),
        (lm.LieVerlet(), TOP, TOP_START),
        (lm.KickDrift(order=4), TOP, TOP_START),
    ],
    ids=lambda x: getattr(x, "name", ""),
)
def test_a_tangent_map_is_the_derivative(method: Any, system: Any, start: Any) -> None:
    """Explicit and implicit steps, with first guesses from the past and with stages; values to the bit."""
    plan = lm.Plan(system, method, 0.1, compiled=False)
    run, whole = plan.tangent(start, steps=6), plan.run(start, steps=6)
    assert np.array_equal(run.mu, whole.mu)
    assert np.array_equal(run.g, whole.g)
    assert run.tangent["start"].shape == (7, 6, 6)
    assert np.abs(run.tangent["start"][0] - np.eye(6)).max() < 1e-15
    assert np.abs(run.tangent["start"][-1] - differences(plan, start, 6)).max() < 1e-9


@pytest.mark.slow
@pytest.mark.sample(2)
@WORLDS
@pytest.mark.parametrize("mu", [(0.0, 0.0, 0.0), (0.0, 0.8, 0.0)], ids=["rest", "axis"])
@pytest.mark.parametrize(
    "method",
    [
        *(lm.Isospectral(2), lm.Isospectral(4), lm.SphericalMidpoint(), lm.ImplicitMidpoint(), lm.ExactFreeBody()),
        *(lm.RKMK(tableau=gauss(2)), lm.GalerkinVariational(order=4), lm.CovariantVariational(lm.Exponential())),
        lm.LiePoissonHamiltonJacobi(order=4),
    ],
    ids=lambda x: x.name,
)
def test_where_values_settle_at_once_derivatives_do_too(method: Any, mu: Any, compiled: bool) -> None:
    """At rest and in turns about an axis the first guesses are the stages, but their derivatives are not."""
    plan, start = lm.Plan(BODY, method, 0.2, compiled=compiled), BODY.state(mu=mu, g=START.g)
    found = plan.tangent(start, steps=6).tangent["start"][-1]
    assert np.abs(found - differences(plan, start, 6)).max() < 1e-9


@pytest.mark.parametrize(
    "method",
    [lm.KickDrift(order=2), lm.KickDrift(lm.SphericalMidpoint()), lm.LieVerlet(), lm.GalerkinVariational(order=2)],
    ids=lambda x: x.name,
)
def test_tops_that_are_let_go_have_derivatives(method: Any) -> None:
    """At their start the length of the momentum has none."""
    plan, start = lm.Plan(TOP, method, 0.1, compiled=False), TOP.state(mu=[0.0, 0.0, 0.0], g=START.g)
    found = plan.tangent(start, steps=3).tangent["start"][-1]
    assert np.abs(found - differences(plan, start, 3)).max() < 1e-9


@pytest.mark.parametrize(
    "method", [lm.CovariantVariational(lm.Cayley()), lm.GalerkinVariational(order=2)], ids=lambda x: x.name
)
def test_entries_of_equations_that_vanish_at_a_turn_in_one_plane_move(method: Any) -> None:
    four = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([1.0, 1.4, 1.9, 1.2, 2.3, 1.6]))
    plan, mu = lm.Plan(four, method, 0.2, compiled=False), 0.7 * np.eye(6)[0]
    found = plan.tangent(four.state(mu), steps=2).tangent["start"][-1]
    ends = [
        [plan.run(four.state(mu + k * 2.0**-8 * unit), steps=2).mu[-1] for k in (1, -1, 2, -2)] for unit in np.eye(6)
    ]
    slopes = [2.0**8 * ((2.0 / 3.0) * (a - b) - (1.0 / 12.0) * (c - d)) for a, b, c, d in ends]
    assert np.abs(found.T - slopes).max() < 1e-9


def test_at_the_lowest_point_the_lobatto_pair_of_order_two_has_the_derivative_of_rattle() -> None:
    """They are one map."""
    pendulum = lm.SphericalPendulum()
    plans = [lm.Plan(pendulum, method, 0.2, compiled=False) for method in (lm.LobattoPair(order=2), lm.RATTLE())]
    maps = [plan.tangent(pendulum.state([0.0, 0.0, -1.0], [0.0, 0.0, 0.0]), steps=6).tangent["start"] for plan in plans]
    assert np.abs(maps[0] - maps[1]).max() < 1e-13


@pytest.mark.parametrize("compiled", [False, slow(True)], ids=["plain", "compiled"])
def test_derivatives_by_the_inertia(compiled: bool) -> None:
    """From which the body computes its inverse."""
    plan = lm.Plan(BODY, lm.CovariantVariational(lm.Cayley()), 0.1, compiled=compiled)
    run = plan.tangent(START, steps=10, by=["inertia", "start"])
    middle, moments = plan.run(START, steps=10), np.array(BODY.inertia)
    for i, unit in enumerate(np.eye(3)):
        change = np.zeros(6)
        for k, weight in ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
            sides = [
                plan.replace(system=lm.RigidBody(moments + s * k * 1e-3 * unit)).run(START, steps=10) for s in (1, -1)
            ]
            change += weight * off(*sides, middle) / 1e-3
        assert np.abs(run.tangent["inertia"][-1][:, i] - change).max() < 1e-9
    assert np.abs(run.tangent["start"] - plan.tangent(START, steps=10).tangent["start"]).max() < 1e-15


def test_derivatives_by_an_inertia_that_is_that_of_the_lagrangian_too() -> None:
    """Of a body told as energy on a group, of which the Hamiltonian is the Lagrangian: that of RigidBody."""
    told = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy(BODY.inertia))
    plans = [lm.Plan(body, lm.CovariantVariational(lm.Cayley()), 0.1, compiled=False) for body in (told, BODY)]
    runs = [plan.tangent(START, steps=5, by=[by]) for plan, by in zip(plans, ("hamiltonian.inertia", "inertia"))]
    by_inertia = [run.tangent[by][-1] for run, by in zip(runs, ("hamiltonian.inertia", "inertia"))]
    assert np.abs(by_inertia[0] - by_inertia[1]).max() < 1e-14 < np.abs(by_inertia[0]).max()
    with pytest.raises(lm.errors.InvalidInput, match="lagrangian is no parameter"):
        plans[0].tangent(START, steps=5, by=["lagrangian.inertia"])


@pytest.mark.slow
@WORLDS
def test_derivatives_by_a_number_inside_of_the_hamiltonian(compiled: bool) -> None:
    gyrostat = lm.LiePoissonSystem(lm.SO3(), Gyrostat([1.0, 2.0, 3.0], 0.7))
    plan = lm.Plan(gyrostat, lm.RKMK(order=4), 0.1, compiled=compiled)
    start = gyrostat.state(mu=[0.5, -0.3, 0.75])
    found = plan.tangent(start, steps=5, by="hamiltonian.rotor").tangent["hamiltonian.rotor"][-1][:, 0]
    ends = [
        plan.replace(system=lm.LiePoissonSystem(lm.SO3(), Gyrostat([1.0, 2.0, 3.0], r))).run(start, steps=5).mu[-1]
        for r in (0.7 + 1e-5, 0.7 - 1e-5)
    ]
    assert np.abs(found - (ends[0] - ends[1]) / 2e-5).max() < 1e-9


@lm.record
class Leaning(lm.Potential):
    """A field whose direction is worked out once, from its angle."""

    angle: float
    direction: lm.Vec = lm.Vec(0.0, 0.0)

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "direction", lm.vec(np.cos(self.angle), np.sin(self.angle)))

    def energy(self, g):
        return 0.7 * lm.dot(self.direction, g[:2, 2])


@pytest.mark.parametrize("turns", [3, 300, 30_000])
def test_derivatives_by_an_angle_know_no_whole_turns(turns: int) -> None:
    """Differences of a part of the angle spanned a turn and more."""

    def derivative(angle: float) -> Any:
        system = lm.MechanicalSystem(BODY, Leaning(angle))
        start = system.state(mu=[0.5, 0.1, 0.8], g=np.eye(3))
        run = lm.Plan(system, lm.KickDrift(), 0.05, compiled=False).tangent(start, steps=3, by="potential.angle")
        return run.tangent["potential.angle"][-1]

    once, more = derivative(0.3), derivative(0.3 + 2.0 * np.pi * turns)
    # the narrowest difference, 2^-22 of the angle, has lost as many digits by rounding
    assert np.abs(once - more).max() < 1e-8 * np.abs(once).max()


@lm.record
class Held(lm.Potential):
    """A spring, and a moment."""

    k: float
    c: float

    def energy(self, g):
        q = g[:3, 3]
        return 0.5 * self.k * lm.dot(q, q) + self.c * g[0, 3] * g[2, 2]


@pytest.mark.slow
@pytest.mark.parametrize("length", [1e-12, 1e-6, 1e9])
def test_two_units_settle_apart_whatever_they_are(length: float) -> None:
    """Derivatives of another unit than their values made a first change of 1e16 times the data, after which any change
    seemed to fall fast: 5e-9 of the map and of the motion were left where lengths are 1e-12.
    """

    def map_and_motions(length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        moments = length**2 * np.array([1.0, 1.2, 0.5])
        body = lm.models.KirchhoffBody([*moments, 2.0, 2.0, 2.0])
        system = lm.MechanicalSystem(body, Held(1.1, 0.4 * length))
        g = np.eye(4)
        g[:3, :3], g[:3, 3] = SO3.exp([0.4, -0.3, 0.9]), length * np.array([0.3, -0.2, 0.5])
        start = system.state(mu=[*moments * [0.5, 0.2, 0.8], 0.3 * length, 0.1 * length, -0.4 * length], g=g)
        plan = lm.Plan(system, lm.GalerkinVariational(order=4), h=0.05, compiled=False)
        found = plan.tangent(start, steps=2)
        units = np.repeat([length**2, length, 1.0, length], 3)
        return found.tangent["start"][-1] * units / units[:, None], found.mu, plan.run(start, steps=2).mu

    found, moved, alone = map_and_motions(length)
    assert np.abs(found - map_and_motions(1.0)[0]).max() < 1e-13
    assert np.array_equal(moved, alone)


@lm.record
class Gyrostat(lm.Hamiltonian):
    inertia: lm.Vec
    rotor: float

    def energy(self, mu: lm.Vec) -> float:
        x = mu - lm.vec(0.0, 0.0, self.rotor)
        return 0.5 * lm.dot(x, x / self.inertia)


@pytest.mark.parametrize("method", [lm.StormerVerlet(), lm.Splitting(order=6)], ids=repr)
def test_symplectic_methods_keep_the_two_form(method: Any) -> None:
    """D^T J D = J to rounding, along a hundred steps; of an explicit Runge-Kutta method not."""
    kepler, J = (lm.Kepler(), np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]]))
    start = kepler.state(q=[0.6, 0.0], p=[0.0, 1.4])

    def defect(method: Any) -> float:
        D = lm.Plan(kepler, method, 0.05, compiled=False).tangent(start, steps=100).tangent["start"]
        return float(np.abs(D.transpose(0, 2, 1) @ J @ D - J).max() / np.abs(D[-1]).max() ** 2)

    assert defect(method) < 1e-14
    assert defect(lm.RKMK(order=4)) > 1e-9


@pytest.mark.slow
def test_algorithm_1_is_symplectic_on_the_group() -> None:
    """D^T W(mu') D = W(mu), with the two-form of T*SO(3), left-trivialised: dmu.eta' - dmu'.eta - mu.(eta x eta')."""

    def form(mu: np.ndarray) -> np.ndarray:
        return np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), SO3.algebra.hat(mu)]])

    symplectic = lm.CovariantVariational(lm.Cayley()), lm.LiePoissonHamiltonJacobi(order=4)
    for method, kept in (*((m, True) for m in symplectic), (lm.RKMK(order=4), False)):
        run = lm.Plan(BODY, method, 0.3, compiled=False).tangent(START, steps=20)
        D = run.tangent["start"][-1]
        defect = np.abs(D.T @ form(run.mu[-1]) @ D - form(run.mu[0])).max()
        assert (defect < 1e-13) == kept, (method, defect)


def test_the_tangent_map_of_a_centre() -> None:
    """Steady rotation about the first axis: the linearised Euler equations, to the order of the method."""
    body = lm.RigidBody([1.0, 1.6, 2.3])
    run = lm.Plan(body, lm.RKMK(order=8), 0.05, compiled=False).tangent(body.state(mu=[1.0, 0.0, 0.0]), steps=20)
    # of (mu_2, mu_3) in mu' = mu x J^-1 mu near e_1
    rate = np.array([[0.0, 1.0 - 1.0 / 2.3], [1.0 / 1.6 - 1.0, 0.0]])
    w, v = np.linalg.eig(rate)
    exact = (v @ np.diag(np.exp(w)) @ np.linalg.inv(v)).real
    assert np.abs(run.tangent["start"][-1][1:, 1:] - exact).max() < 1e-12


def test_what_has_no_tangent_map() -> None:
    plan = lm.Plan(BODY, lm.RKMK(order=4), 0.1, compiled=False)
    with pytest.raises(
        lm.errors.InvalidInput, match=r"mass is no parameter of .*; there are inertia, group, and the start"
    ):
        plan.tangent(START, steps=2, by="mass")


@pytest.mark.slow
def test_poisson_integrators_keep_the_bracket_and_rattle_the_two_form() -> None:
    """D B(y) D^T = B(y') for a splitting and symplectic Euler on Lotka and Volterra's species; on
    the sphere v D^T J D w = v J w for directions v, w along the constraints.
    """
    species = lm.models.LotkaVolterra()
    for method in (lm.Splitting(order=4), lm.PoissonEuler()):
        run = lm.Plan(species, method, 0.1, compiled=False).tangent(species.state([1.5, 1.0]), steps=50)
        first, last = (np.array(species.structure.matrix(lm.vec(*y))) for y in run.y[[0, -1]])
        D = run.tangent["start"][-1]
        assert np.abs(D @ first @ D.T - last).max() < 1e-13 * np.abs(D).max() ** 2
    pendulum = lm.SphericalPendulum()
    start = pendulum.consistent(q=[0.8, 0.0, -0.6], p=[0.0, 1.2, 0.0])
    run = lm.Plan(pendulum, lm.RATTLE(), 0.02, compiled=False).tangent(start, steps=50)
    J = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    q, p, D = np.array(start.q), np.array(start.p), run.tangent["start"][-1]
    # of q.q = 1 and q.p = 0
    along = np.linalg.svd(np.array([[*q, 0.0, 0.0, 0.0], [*p, *q]]))[2][2:].T
    assert np.abs(along.T @ (D.T @ J @ D - J) @ along).max() < 1e-13 * np.abs(D).max() ** 2


SE3 = lm.SE3()


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=[pytest.mark.compiled, pytest.mark.slow])])
def test_unit_quaternions_have_the_tangent_map_of_matrices(compiled: bool) -> None:
    quaternions = lm.UnitQuaternions()
    maps = []
    for group in (SO3, quaternions):
        body = lm.RigidBody([1.0, 1.6, 2.3], group=group)
        start = body.state([0.5, -0.3, 0.75], group.exp([0.1, 0.2, 0.3]))
        run = lm.Plan(body, lm.RKMK(order=4), 0.1, compiled=compiled).tangent(start, steps=8, by=["start", "inertia"])
        maps.append(run.tangent)
    assert maps[1]["start"].shape == (9, 6, 6) and maps[1]["inertia"].shape == (9, 6, 3)
    for by in ("start", "inertia"):
        assert np.abs(maps[0][by] - maps[1][by]).max() < 1e-13
    assert np.abs(maps[1]["start"][0] - np.eye(6)).max() < 1e-15


def test_places_and_attitudes_of_se3() -> None:
    """Against central differences of order four of log(g^-1 g')."""
    body = lm.models.KirchhoffBody([1.0, 1.5, 0.7, 1.0, 1.4, 2.0])
    g = SE3.exp([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    mu = np.array([0.2, -0.1, 0.4, 0.3, 0.5, -0.2])
    plan = lm.Plan(body, lm.RKMK(order=4), 0.1, compiled=False)
    run = plan.tangent(body.state(mu, g), steps=3)
    assert run.tangent["start"].shape == (4, 12, 12)
    last = plan.run(body.state(mu, g), steps=3).g[-1]
    for i in (0, 4, 7, 11):
        change = np.zeros(12)
        for k, weight in ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
            for sign in (k, -k):
                x = sign * 1e-3 * np.eye(12)[i]
                moved = plan.run(body.state(mu + x[:6], SE3.compose(g, SE3.exp(x[6:]))), steps=3)
                eta = SE3.log(SE3.compose(SE3.inverse(last), moved.g[-1]))
                change += np.sign(sign) * weight / 1e-3 * np.concatenate([moved.mu[-1], eta])
        assert np.abs(run.tangent["start"][-1][:, i] - change).max() < 1e-9


@lm.record
class Spring(lm.Force):
    """A torque known for one second."""

    torque: lm.PiecewisePolynomial

    def covector(self, t, xi, g):
        return lm.vec(self.torque(t), 0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, None])
def test_a_step_that_fails_ends_the_run_and_its_map(compiled):
    times = np.linspace(0.0, 1.0, 11)
    torque = lm.PiecewisePolynomial.cubic(times, np.sin(times))
    body = lm.MechanicalSystem(lm.RigidBody([1.0, 2.0, 3.0]), lm.NoPotential(), load=Spring(torque))
    plan = lm.Plan(body, lm.RKMK(order=4), h=0.03, every=5, compiled=compiled)
    start = body.state([0.1, 0.2, 0.3], np.eye(3))
    with pytest.raises(errors.IntegrationFailure, match="has no value") as alone:
        plan.run(start, steps=100)
    with (
        warnings.catch_warnings(action="error"),
        pytest.raises(errors.IntegrationFailure, match="has no value") as caught,
    ):
        plan.tangent(start, steps=100)
    run = caught.value.trajectory
    assert np.array_equal(run.mu, alone.value.trajectory.mu) and np.array_equal(run.t, alone.value.trajectory.t)
    assert np.array_equal(run.tangent["start"], plan.tangent(start, steps=33).tangent["start"][: len(run.t)])
    with pytest.raises(errors.IntegrationFailure, match="has no value"):
        plan.tangent(body.state([[0.1, 0.2, 0.3]] * 2, [np.eye(3)] * 2), steps=100)


@lm.record
class Growing(lm.LieAlgebra):
    """[E_1, E_2] = k E_2."""

    k: float
    dim = 2

    def bracket(self, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        return lm.vec(0.0, self.k * (xi[0] * eta[1] - xi[1] * eta[0]))


@lm.record
class Line(lm.LieGroup):
    """The maps x -> e^(k a) x + b of the line, as (a, b)."""

    k: float

    @property
    def algebra(self) -> Growing:
        return Growing(self.k)

    def identity(self) -> lm.Vec:
        return lm.vec(0.0, 0.0)

    def compose(self, g: lm.Element, h: lm.Element) -> lm.Vec:
        return lm.vec(g[0] + h[0], lm.formulas.exp(self.k * g[0]) * h[1] + g[1])

    def inverse(self, g: lm.Element) -> lm.Vec:
        return lm.vec(-g[0], -lm.formulas.exp(-self.k * g[0]) * g[1])

    def exp(self, xi: lm.Vec) -> lm.Vec:
        return lm.vec(xi[0], xi[1] * lm.formulas.expm1_over(self.k * xi[0]))


@WORLDS
def test_a_parameter_of_a_group_has_derivatives(compiled: bool) -> None:
    """mu' is k times what it is for k = 1: momenta depend on k h alone, so that k d/dk = h d/dh."""
    k, h = 0.8, 0.1
    system = lm.LiePoissonSystem(Line(k), lm.KineticEnergy([1.0, 1.5]))
    plan = lm.Plan(system, lm.RKMK(order=4), h=h, compiled=compiled)
    by = plan.tangent(system.state(mu=[0.4, 0.5], g=[0.1, 0.2]), steps=5, by=["group.k", "h"]).tangent
    by_k, by_h = (np.ravel(by[name][-1])[:2] for name in ("group.k", "h"))
    assert np.abs(by_h).min() > 0.05
    assert np.abs(k * by_k - h * by_h).max() < 1e-15
