"""Generating functions of (q, Q) and (p, P), the symmetric method, and energies that change with time."""

from __future__ import annotations

import functools
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, NoConvergence, OutsideChart
from liemech.formulas import Vec, cos, record, sin
from liemech.rooms.hamilton_jacobi.hamilton_jacobi import HamiltonJacobi, SymmetricHamiltonJacobi


@record
class Curved(lm.HamiltonianSystem):
    """One degree of freedom, not separable, not even in p."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return 0.5 * p[0] ** 2 * (1.0 + 0.3 * sin(q[0]) ** 2) - cos(q[0]) + p[0] ** 3 / 20.0


@record
class Driven(lm.DrivenHamiltonianSystem):
    """The same, driven."""

    degrees: ClassVar[int] = 1

    def energy(self, t: float, q: Vec, p: Vec) -> float:
        return (
            0.5 * p[0] ** 2 * (1.0 + 0.3 * sin(q[0] + t) ** 2)
            - (1.0 + 0.5 * sin(2.0 * t)) * cos(q[0])
            + p[0] ** 3 / 20.0
        )


@record
class Extended(lm.HamiltonianSystem):
    """The driven one with time as a coordinate: q = (q, t), p = (p, e), H + e."""

    degrees: ClassVar[int] = 2

    def energy(self, q: Vec, p: Vec) -> float:
        return Driven().energy(q[1], lm.vec(q[0]), lm.vec(p[0])) + p[1]


KINDS = pytest.mark.parametrize("kind", ["qP", "qQ", "pP"])
SYSTEMS = pytest.mark.parametrize(
    "system", [pytest.param(Curved(), marks=pytest.mark.slow), Driven()], ids=["Curved", "Driven"]
)
T0 = 0.3


def stepped(system: Any, method: lm.Method, h: float, q: Any = 0.4, p: Any = 0.5, t: float = T0) -> np.ndarray:
    """(q, p) after one step in plain Python."""
    state = method.step(system, t, system.state(q, p), h)
    return np.array([*state.q, *state.p])


def local_order(system: Any, method: lm.Method, h: float = 0.06) -> float:
    """The power of h of what a step does that the motion does not, less one: the motion by a Taylor method of order 12."""
    errors = [np.abs(stepped(system, method, x) - stepped(system, lm.Taylor(12), x)).max() for x in (h, 0.5 * h)]
    return float(np.log2(errors[0] / errors[1])) - 1.0


# ------------------------------------------------------------------ order and structure


@pytest.mark.sample(2)
@SYSTEMS
@KINDS
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_order(system: Any, kind: str, order: int) -> None:
    for adjoint in False, True:
        assert abs(local_order(system, HamiltonJacobi(order, adjoint, kind)) - order) < 0.35


@pytest.mark.sample(3)
@SYSTEMS
@KINDS
@pytest.mark.parametrize("order", [2, 4])
def test_order_of_the_symmetric_method(system: Any, kind: str, order: int) -> None:
    assert abs(local_order(system, SymmetricHamiltonJacobi(order, kind)) - order) < 0.35


@pytest.mark.slow
@SYSTEMS
@KINDS
def test_steps_are_symplectic_and_undone_by_the_adjoint(system: Any, kind: str) -> None:
    for method in HamiltonJacobi(2, kind=kind), HamiltonJacobi(3, True, kind):
        assert abs(area(system, method) - 1.0) < 1e-11
    for method, back in (
        (HamiltonJacobi(3, kind=kind), HamiltonJacobi(3, True, kind)),
        (SymmetricHamiltonJacobi(4, kind), SymmetricHamiltonJacobi(4, kind)),
    ):
        there = stepped(system, method, 0.2)
        assert np.abs(stepped(system, back, -0.2, there[0], there[1], T0 + 0.2) - (0.4, 0.5)).max() < 4e-15


def area(system: Any, method: lm.Method, h: float = 0.2, e: float = 1e-3) -> float:
    """The determinant of the derivative of a step, by differences of order four."""
    columns = []
    for a, b in (e, 0.0), (0.0, e):
        ends = {k: stepped(system, method, h, 0.4 + k * a, 0.5 + k * b) for k in (-2, -1, 1, 2)}
        one, two = ((ends[k] - ends[-k]) / (2 * k * e) for k in (1, 2))
        columns.append((4.0 * one - two) / 3.0)
    return float(np.linalg.det(columns))


def test_the_taylor_method_is_not_symplectic() -> None:
    """What the check finds where there is something to find."""
    assert abs(area(Curved(), lm.Taylor(3)) - 1.0) > 1e-6


# ------------------------------------------------------------------ the functions themselves


@record
class Spring(lm.HamiltonianSystem):
    """p^2/2 + q^2/2."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return 0.5 * (p[0] * p[0] + q[0] * q[0])


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_action_of_a_spring(order: int) -> None:
    """S = ((q^2 + Q^2) cos h - 2 q Q)/(2 sin h): S/h at q and v = (q - Q)/h, cut before h^order, makes the step."""
    import sympy

    q, v, h, Q = sympy.symbols("q v h Q")
    S = ((q**2 + (q - h * v) ** 2) * sympy.cos(h) - 2 * q * (q - h * v)) / (2 * sympy.sin(h))
    cut = sympy.series(sympy.expand(S / h), h, 0, order).removeO()
    S = (h * cut).subs(v, (q - Q) / h)
    made = sympy.lambdify((q, Q, h), [-sympy.diff(S, Q), sympy.diff(S, q)])
    for size in 0.3, -0.2:
        new = stepped(Spring(), HamiltonJacobi(order, kind="qQ"), size, 0.7, -0.4)
        assert np.abs(np.array(made(new[0], 0.7, size)) - (-0.4, new[1])).max() < 4e-15


@record
class Exchanged(lm.HamiltonianSystem):
    """The energy of Curved with positions and momenta exchanged, (x, y) = (p, -q)."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return Curved().energy(-p, q)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 3])
def test_the_kinds_qq_and_pp_are_one_with_positions_and_momenta_exchanged(order: int) -> None:
    for adjoint in False, True:
        x, y = stepped(Exchanged(), HamiltonJacobi(order, adjoint, "qQ"), 0.2, 0.5, -0.4)
        assert np.abs(stepped(Curved(), HamiltonJacobi(order, adjoint, "pP"), 0.2) - (-y, x)).max() < 1e-15


def test_order_two_of_every_kind_is_the_stormer_verlet_method_where_the_energy_separates() -> None:
    system = lm.models.HenonHeiles()
    run = lm.integrate(
        system, lm.StormerVerlet(), system.state([0.1, 0.3], [0.3, -0.1]), h=0.1, steps=1, compiled=False
    )
    verlet = np.array([*run.q[1], *run.p[1]])
    other = [
        stepped(system, SymmetricHamiltonJacobi(2, kind), 0.1, [0.1, 0.3], [0.3, -0.1]) for kind in ("qP", "qQ", "pP")
    ]
    drift_first = stepped(system, HamiltonJacobi(1), 0.05, [0.1, 0.3], [0.3, -0.1])
    drift_first = stepped(system, HamiltonJacobi(1, adjoint=True), 0.05, drift_first[:2], drift_first[2:])
    for found in other[:2]:
        assert np.abs(found - drift_first).max() < 1e-15
    assert np.abs(other[2] - verlet).max() < 1e-15


# ------------------------------------------------------------------ time


@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_direct_recursion_is_that_of_extended_phase_space(order: int) -> None:
    for adjoint in False, True:
        method = HamiltonJacobi(order, adjoint)
        whole = stepped(Extended(), method, 0.2, [0.4, T0], [0.5, 0.0])
        assert abs(whole[1] - (T0 + 0.2)) < 1e-15
        assert np.abs(whole[[0, 2]] - stepped(Driven(), method, 0.2)).max() < 1e-15


def test_the_energy_of_a_driven_run_is_that_of_its_times() -> None:
    system = Driven()
    run = lm.integrate(system, HamiltonJacobi(2), system.state(0.4, 0.5), h=0.1, steps=3, t0=T0, compiled=False)
    wanted = [system.energy(float(t), q, p) for t, q, p in zip(run.t, run.q, run.p)]
    assert np.array_equal(run.energy, wanted)
    many = system.state(np.full((2, 1), 0.4), np.full((2, 1), 0.5))
    runs = lm.integrate(system, HamiltonJacobi(2), many, h=0.1, steps=3, t0=T0, compiled=False)
    assert np.array_equal(runs.energy, np.stack([wanted, wanted], axis=1))
    assert not run.drift().kept


# ------------------------------------------------------------------ on the dual of a Lie algebra


@record
class Wheel(lm.DrivenHamiltonian):
    """A body with a wheel whose momentum is driven, and a term of third degree."""

    def energy(self, t: float, mu: Vec) -> float:
        wheel = 0.4 * sin(2.0 * t)
        free = mu[0] ** 2 * (1.0 + 0.3 * cos(t)) + mu[1] ** 2 / 1.6 + (mu[2] - wheel) ** 2 / 2.3
        return 0.5 * free + 0.1 * mu[0] * mu[1] ** 2


SATELLITE = lm.DrivenLiePoissonSystem(lm.SO3(), Wheel())
FAMILIES = pytest.mark.parametrize(
    "method",
    [
        lm.LiePoissonHamiltonJacobi(2),
        lm.LiePoissonHamiltonJacobi(4),
        lm.LiePoissonHamiltonJacobi(4, lm.Cayley()),
        pytest.param(lm.LiePoissonHamiltonJacobi(6), marks=pytest.mark.slow),
        lm.FirstKindHamiltonJacobi(1),
        lm.FirstKindHamiltonJacobi(2),
        pytest.param(lm.FirstKindHamiltonJacobi(4), marks=pytest.mark.slow),
    ],
    ids=lambda method: method.name,
)


def turned(method: lm.Method, h: float, steps: int = 1) -> lm.BodyState:
    start = SATELLITE.state([0.3, 0.8, -0.5], np.eye(3))
    return lm.integrate(SATELLITE, method, start, h=h, steps=steps, t0=T0, compiled=False, progress=False).last


@functools.cache
def flow(h: float) -> lm.BodyState:
    """Where the satellite is after h, by a series of order 12."""
    return turned(lm.Taylor(12, lm.Exponential()), h)


@FAMILIES
def test_order_and_structure_of_driven_bodies(method: Any) -> None:
    errors = []
    for h in 0.1, 0.05:
        found, wanted = turned(method, h), flow(h)
        errors.append(
            max(np.abs(np.array(a) - np.array(b)).max() for a, b in ((found.mu, wanted.mu), (found.g, wanted.g)))
        )
        spatial = np.array(found.g) @ np.array(found.mu)
        assert np.abs(spatial - (0.3, 0.8, -0.5)).max() < 1e-15
    assert abs(np.log2(errors[0] / errors[1]) - 1.0 - method.order) < 0.35


def test_driven_bodies_move_by_poisson_maps() -> None:
    state = SATELLITE.state([0.3, 0.8, -0.5])
    assert lm.poisson_defect(lm.LiePoissonHamiltonJacobi(2), SATELLITE, state, 0.3) < 1e-10
    assert lm.poisson_defect(lm.RKMK(order=4), SATELLITE, state, 0.3) > 1e-7


def test_a_drive_that_stands_still_changes_nothing() -> None:
    """K(t, mu) = H(mu) gives the steps of H to rounding, in both families."""
    still = SATELLITE.at(T0)

    @record
    class Still(lm.DrivenHamiltonian):
        def energy(self, t: float, mu: Vec) -> float:
            return still.energy(mu)

    start = [0.3, 0.8, -0.5]
    system = lm.DrivenLiePoissonSystem(lm.SO3(), Still())
    for method in lm.LiePoissonHamiltonJacobi(4), lm.FirstKindHamiltonJacobi(2):
        runs = [lm.integrate(s, method, s.state(start), h=0.2, steps=1, compiled=False) for s in (system, still)]
        assert np.abs(runs[0].mu - runs[1].mu).max() < 1e-15


# ------------------------------------------------------------------ refusals


@record
class Free(lm.HamiltonianSystem):
    """No force."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return 0.5 * p[0] ** 2


def test_kinds_without_a_generating_function_are_refused_by_name() -> None:
    with pytest.raises(IncompatibleSystem, match=r"\(p, P\) needs forces that tell positions apart"):
        HamiltonJacobi(2, kind="pP").require(Free())
    with pytest.raises(IncompatibleSystem, match=r"\(q, Q\) needs velocities that tell momenta apart"):
        HamiltonJacobi(2, kind="qQ").require(Extended())
    with pytest.raises(OutsideChart, match=r"the identity.*no generating function of q and Q"):
        stepped(Curved(), HamiltonJacobi(2, kind="qQ"), 0.0)
    with pytest.raises(NoConvergence, match=r"d2H/dq2|position found whose force"):
        stepped(Curved(), HamiltonJacobi(2, kind="pP"), 0.8, 1.3, 1.5)


def test_bad_kinds_and_orders() -> None:
    with pytest.raises(InvalidInput, match=r"adjoint=True"):
        HamiltonJacobi(2, kind="Qp")
    with pytest.raises(InvalidInput, match="kind is one of"):
        HamiltonJacobi(2, kind="pq")
    with pytest.raises(InvalidInput, match="from 1 to 4, of kind 'qQ'"):
        HamiltonJacobi(5, kind="qQ")
    with pytest.raises(InvalidInput, match="even number from 2 to 10"):
        SymmetricHamiltonJacobi(3)


def test_methods_that_cannot_refuse_driven_systems() -> None:
    for method in lm.CovariantVariational(), lm.GalerkinVariational(), lm.KickDrift():
        with pytest.raises(IncompatibleSystem):
            method.require(SATELLITE)
    for method in lm.StormerVerlet(), lm.Splitting(order=4):
        with pytest.raises(IncompatibleSystem):
            method.require(Driven())

    @record
    class Jumps(lm.DrivenHamiltonian):
        def energy(self, t: float, mu: Vec) -> float:
            return float(int(t)) * mu[0] ** 2

    with pytest.raises(IncompatibleSystem, match="powers of time"):
        lm.LiePoissonHamiltonJacobi(4).require(lm.DrivenLiePoissonSystem(lm.SO3(), Jumps()))
