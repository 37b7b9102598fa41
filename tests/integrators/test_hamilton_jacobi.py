"""Hamilton-Jacobi methods in R^2n: the generating function itself, the order of the steps, and what they keep."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest
from scenes import named, same_bits, slope

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, NoConvergence, NotFinite
from liemech.formulas import Vec, cos, record, sin, sqrt
from liemech.models.planets.henon_heiles import HenonHeiles
from liemech.models.planets.kepler import Kepler
from liemech.models.swinging.pendulums import DoublePendulum, Pendulum
from liemech.rooms.hamilton_jacobi.hamilton_jacobi import HamiltonJacobi
from liemech.systems.canonical import HamiltonianSystem

if TYPE_CHECKING:
    import sympy


@record
class Curved(HamiltonianSystem):
    """One degree of freedom, not separable, not even in p: an energy, whose derivatives are derived."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return 0.5 * p[0] ** 2 * (1.0 + 0.3 * sin(q[0]) ** 2) - cos(q[0]) + p[0] ** 3 / 20.0


PENDULUM = Pendulum(gravity=1.0)
CURVED = Curved()
DOUBLE = DoublePendulum([1.0, 0.5], [1.0, 0.8], 9.81)
GALAXY = HenonHeiles()
STARTS = {
    PENDULUM: PENDULUM.state(1.0, 0.5),
    CURVED: CURVED.state(1.0, 0.5),
    DOUBLE: DOUBLE.state([0.9, -0.4], DOUBLE.momentum([0.9, -0.4], [0.3, 1.1])),
    GALAXY: GALAXY.state([0.1, 0.3], [0.3, -0.1]),
    Kepler(): Kepler().pericentre(0.3),
}
STEPS = {PENDULUM: 0.1, CURVED: 0.1, DOUBLE: 0.03, GALAXY: 0.2, Kepler(): 0.05}
SYSTEMS = pytest.mark.parametrize("system", STARTS, ids=lambda system: type(system).__name__)
SOME = pytest.mark.parametrize(
    "method",
    [HamiltonJacobi(k, adjoint=a) for k, a in ((1, False), (2, True), (3, False), (4, False), (5, True))],
    ids=named,
)


def step(system: HamiltonianSystem, method: lm.Method, h: float, q: Any, p: Any) -> tuple[np.ndarray, np.ndarray]:
    """One step, or one for each row, in plain Python."""
    run = lm.integrate(system, method, system.state(q, p), h=h, steps=1, compiled=False)
    return run.q[-1], run.p[-1]


def errors(system: HamiltonianSystem, method: lm.Method, t_end: float, counts: tuple[int, ...]) -> list[float]:
    """The largest error on the way to t_end for these numbers of steps, against a Taylor method of order 14."""
    first = min(counts)
    fine = lm.integrate(
        system, lm.Taylor(14), STARTS[system], h=t_end / first / 4, steps=4 * first, every=4, compiled=True
    )
    runs = [
        lm.integrate(system, method, STARTS[system], h=t_end / n, steps=n, every=n // first, compiled=True)
        for n in counts
    ]
    return [max(np.abs(run.q - fine.q).max(), np.abs(run.p - fine.p).max()) for run in runs]


# ------------------------------------------------------------------ the generating function


@functools.cache
def generating_terms(H: sympy.Expr, q: Any, P: Any, h: sympy.Symbol) -> list[sympy.Expr]:
    """G_1, ..., G_4 by the recurrence G_(m+1) = -(d/dt)^m H(q, P + sum_j t^j/j! dG_j/dq) at t = 0."""
    import sympy

    G: list[sympy.Expr] = []
    for m in range(4):
        gradients = [
            P[i] + sum(h**j / sympy.factorial(j) * sympy.diff(g, q[i]) for j, g in enumerate(G, 1))
            for i in range(len(q))
        ]
        moved = H.subs(dict(zip(P, gradients)), simultaneous=True)
        G.append(-sympy.diff(moved, h, m).subs(h, 0))
    return G


def curved(q: Any, p: Any) -> sympy.Expr:
    """The energy of Curved, once more."""
    import sympy

    return p[0] ** 2 * (1 + sympy.Rational(3, 10) * sympy.sin(q[0]) ** 2) / 2 - sympy.cos(q[0]) + p[0] ** 3 / 20


def galaxy(q: Any, p: Any) -> sympy.Expr:
    """That of HenonHeiles."""
    return (p[0] ** 2 + p[1] ** 2 + q[0] ** 2 + q[1] ** 2) / 2 + q[0] ** 2 * q[1] - q[1] ** 3 / 3


@pytest.mark.slow
@pytest.mark.parametrize(("system", "energy"), [(CURVED, curved), (GALAXY, galaxy)], ids=["Curved", "HenonHeiles"])
def test_steps_are_generated_by_the_truncated_series(system: HamiltonianSystem, energy: Any) -> None:
    """Q = dG/dP and p = dG/dq to rounding, with G_1 to G_4 from computer algebra."""
    import sympy

    n, h = system.degrees, sympy.Symbol("h")
    q, P = sympy.symbols(f"q:{n}"), sympy.symbols(f"P:{n}")
    G = sum(x * y for x, y in zip(q, P))
    for order, term in enumerate(generating_terms(energy(q, P), q, P, h), 1):
        G = G + h**order / math.factorial(order) * term
        derivatives = sympy.lambdify((h, *q, *P), [sympy.diff(G, x) for x in (*P, *q)])
        start, size = STARTS[system], 0.2
        new_q, new_p = step(system, HamiltonJacobi(order), size, start.q, start.p)
        found = np.array(derivatives(size, *new_q, *start.p))
        assert np.abs(found - np.concatenate([start.q, new_p])).max() <= 2e-15
        new_q, new_p = step(system, HamiltonJacobi(order, adjoint=True), size, start.q, start.p)
        found = np.array(derivatives(-size, *start.q, *new_p))
        assert np.abs(found - np.concatenate([new_q, start.p])).max() <= 2e-15


@pytest.mark.slow
def test_the_formulas_for_the_first_four_terms() -> None:
    """G_2, G_3, G_4 of one degree of freedom, written out, are those of the recurrence."""
    import sympy

    (q,), (p,), h = sympy.symbols("q:1"), sympy.symbols("P:1"), sympy.Symbol("h")
    H = curved((q,), (p,))
    Hp, Hpp, Hppp = (sympy.diff(H, p, k) for k in (1, 2, 3))
    G1 = -H
    G2 = -Hp * sympy.diff(G1, q)
    G3 = -Hp * sympy.diff(G2, q) - Hpp * sympy.diff(G1, q) ** 2
    G4 = -Hp * sympy.diff(G3, q) - 3 * Hpp * sympy.diff(G1, q) * sympy.diff(G2, q) - Hppp * sympy.diff(G1, q) ** 3
    for written, found in zip((G1, G2, G3, G4), generating_terms(H, (q,), (p,), h)):
        assert sympy.expand(written - found) == 0


# ------------------------------------------------------------------ order


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("order", range(1, 7))
@pytest.mark.parametrize(("system", "adjoint"), [(PENDULUM, False), (CURVED, False), (CURVED, True)])
def test_order_in_one_degree_of_freedom(system: HamiltonianSystem, order: int, adjoint: bool) -> None:
    counts = {1: (2000, 4000), 5: (400, 800)}.get(order, (200, 400))
    error = errors(system, HamiltonJacobi(order, adjoint=adjoint), 5.0, counts)
    assert abs(slope([1 / n for n in counts], error) - order) <= 0.1


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("order", [8, 10])
def test_high_orders(order: int) -> None:
    counts = (50, 100)
    error = errors(GALAXY, HamiltonJacobi(order), 10.0, counts)
    assert abs(slope([1 / n for n in counts], error) - order) <= 0.1


# ------------------------------------------------------------------ order 1


@pytest.mark.parametrize("system", [PENDULUM, GALAXY, Kepler()], ids=lambda system: type(system).__name__)
def test_order_one_is_symplectic_euler_to_the_bit(system: HamiltonianSystem) -> None:
    h, start = STEPS[system], STARTS[system]
    run = lm.integrate(system, HamiltonJacobi(1), start, h=h, steps=50, compensated=False)
    other = lm.integrate(system, HamiltonJacobi(1, adjoint=True), start, h=h, steps=50, compensated=False)
    q, p = Q, P = Vec.of(start.q), Vec.of(start.p)
    for i in range(50):
        q = q + h * system.velocity(q, p)  # separable: H_p depends on p alone
        p = p + h * system.force(q, p)
        assert same_bits(np.array([*q, *p]), np.concatenate([run.q[i + 1], run.p[i + 1]]))
        P = P + h * system.force(Q, P)
        Q = Q + h * system.velocity(Q, P)
        assert same_bits(np.array([*Q, *P]), np.concatenate([other.q[i + 1], other.p[i + 1]]))


@pytest.mark.slow
@pytest.mark.parametrize("system", [CURVED, DOUBLE], ids=["Curved", "DoublePendulum"])
def test_order_one_is_symplectic_euler_where_that_is_implicit(system: HamiltonianSystem) -> None:
    h, start = STEPS[system], STARTS[system]
    run = lm.integrate(system, HamiltonJacobi(1), start, h=h, steps=20, compensated=False)
    for (Q, P), (q, p) in zip(zip(run.q, run.p), zip(run.q[1:], run.p[1:])):
        assert np.abs(Q + h * system.velocity(q, P) - q).max() <= 1e-15 * (1.0 + np.abs(q).max())
        assert same_bits(np.array(P + h * system.force(q, P)), p)


# ------------------------------------------------------------------ structure


def jacobian(system: HamiltonianSystem, method: lm.Method, h: float, y: np.ndarray) -> np.ndarray:
    """The derivative of a step, by central differences extrapolated twice."""
    n = system.degrees

    def phi(points: np.ndarray) -> np.ndarray:
        return np.concatenate(step(system, method, h, points[:, :n], points[:, n:]), axis=1)

    def central(e: float) -> np.ndarray:
        return (phi(y + e * np.eye(2 * n)) - phi(y - e * np.eye(2 * n))).T / (2 * e)

    one, two, three = central(8e-3), central(4e-3), central(2e-3)
    return (64 * three - 20 * two + one) / 45


@SOME
@SYSTEMS
def test_steps_are_symplectic(system: HamiltonianSystem, method: HamiltonJacobi) -> None:
    n, start = system.degrees, STARTS[system]
    J = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    D = jacobian(system, method, STEPS[system], np.array([*start.q, *start.p]))
    assert np.abs(D.T @ J @ D - J).max() <= 1e-11


def test_the_taylor_method_is_not() -> None:
    """What the check of symplecticity finds in a method of the same order that is not symplectic."""
    D = jacobian(PENDULUM, lm.Taylor(4), 0.1, np.array([1.0, 0.5]))
    assert abs(np.linalg.det(D) - 1.0) >= 1e-8


@pytest.mark.sample(4)
@SOME
@SYSTEMS
def test_the_adjoint_undoes_the_step_backwards(system: HamiltonianSystem, method: HamiltonJacobi) -> None:
    start, h = STARTS[system], STEPS[system]
    there = step(system, method, h, start.q, start.p)
    back = step(system, HamiltonJacobi(method.order, adjoint=not method.adjoint), -h, *there)
    for new, old in zip(back, (start.q, start.p)):
        assert np.abs(new - np.array(old)).max() <= 2e-15 * (1.0 + np.abs(np.array(old)).max())


@pytest.mark.compiled
@pytest.mark.parametrize("order", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("system", [PENDULUM, CURVED, GALAXY], ids=lambda system: type(system).__name__)
def test_the_energy_stays_bounded(system: HamiltonianSystem, order: int) -> None:
    """10^4 steps: in the second half no further away than 1.1 times the first."""
    run = lm.integrate(system, HamiltonJacobi(order), STARTS[system], h=STEPS[system], steps=10_000, compiled=True)
    away = np.abs(run.energy - run.energy[0])
    assert away[5000:].max() <= 1.1 * away[:5000].max()
    assert away.max() <= STEPS[system] ** order


@pytest.mark.slow
@pytest.mark.compiled
def test_angular_momentum_is_kept() -> None:
    """G is invariant under rotations if H is: they act linearly, so that every truncation keeps
    their momentum to rounding.
    """
    system = Kepler()
    for order in 1, 3, 4:
        run = lm.integrate(system, HamiltonJacobi(order), STARTS[system], h=0.05, steps=5000, compiled=True)
        assert run.drift()["angular momentum"].largest <= 1e-12
        assert run.drift()["Runge-Lenz vector"].largest >= 1e-8


# ------------------------------------------------------------------ refusals


def test_bad_options() -> None:
    with pytest.raises(InvalidType, match="adjoint"):
        HamiltonJacobi(2, adjoint=1)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="not symmetric"):
        lm.Composition(HamiltonJacobi(2))


def test_other_systems_are_refused() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    with pytest.raises(IncompatibleSystem, match="LiePoissonHamiltonJacobi"):
        lm.integrate(body, HamiltonJacobi(), body.state([1.0, 0.0, 0.0]), h=0.1, steps=1)


@record
class OfTheMathModule(HamiltonianSystem):
    """An energy written with functions of numbers alone."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return 0.5 * p[0] ** 2 - math.erf(q[0])


@record
class WithForce(OfTheMathModule):
    """Its derivatives written too, which is enough for Runge-Kutta methods."""

    def velocity(self, q: Vec, p: Vec) -> Vec:
        return p

    def force(self, q: Vec, p: Vec) -> Vec:
        return Vec(math.exp(-q[0] * q[0]) * 2.0 / math.sqrt(math.pi))


@record
class Steps(HamiltonianSystem):
    """An energy that is no smooth function."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return 0.5 * p[0] ** 2 + math.floor(q[0])


@pytest.mark.parametrize("system", [OfTheMathModule(), Steps()], ids=lambda system: type(system).__name__)
def test_energies_without_a_power_series_are_refused(system: HamiltonianSystem) -> None:
    with pytest.raises(IncompatibleSystem, match=r"power series.*functions of liemech\.formulas.*RKMK"):
        lm.integrate(system, HamiltonJacobi(2), system.state(0.3, 0.2), h=0.1, steps=1)


def test_the_way_out() -> None:
    """Its derivatives have functions of `math` that are known for power series: both methods go on."""
    system = WithForce()
    start = system.state(0.3, 0.2)
    fine = lm.integrate(system, HamiltonJacobi(4), start, h=0.05, steps=40, compiled=False)
    exact = lm.integrate(system, lm.RKMK(order=8), start, h=0.05, steps=40, compiled=False)
    assert abs(fine.q[-1] - exact.q[-1]) < 1e-6
    run = lm.integrate(system, lm.RKMK(order=8), system.state(0.3, 0.2), h=0.1, steps=20, compiled=False)
    assert np.abs(run.energy - run.energy[0]).max() <= 1e-9


@record
class Kink(HamiltonianSystem):
    """|q|, without a derivative at the origin."""

    degrees: ClassVar[int] = 1

    def energy(self, q: Vec, p: Vec) -> float:
        return 0.5 * p[0] ** 2 + sqrt(q[0] * q[0])


def test_where_there_is_no_derivative_the_run_ends() -> None:
    system = Kink()
    lm.integrate(system, HamiltonJacobi(3), system.state(1.0, 0.0), h=0.1, steps=3)
    for compiled in False, None:
        with pytest.raises(NotFinite, match="step 1 of 3"):
            lm.integrate(system, HamiltonJacobi(3), system.state(0.0, 0.0), h=0.1, steps=3, compiled=compiled)


@SYSTEMS
def test_a_step_that_is_too_large_is_told(system: HamiltonianSystem) -> None:
    with pytest.raises(NoConvergence, match=r"The step h = 3 is too large for this motion; try 0\.75") as failure:
        lm.integrate(system, HamiltonJacobi(4), STARTS[system], h=3.0, steps=5)
    assert failure.value.trajectory is not None
    assert len(failure.value.trajectory) >= 1


@pytest.mark.slow
@pytest.mark.compiled
def test_a_million_steps() -> None:
    """The error of the energy has no slope: windows of 10^5 steps have the same largest error, to a hundredth."""
    for system, h in ((PENDULUM, 0.1), (GALAXY, 0.2)):
        run = lm.integrate(system, HamiltonJacobi(4), STARTS[system], h=h, steps=10**6, every=7)
        away = np.abs(run.energy - run.energy[0])[: 10 * (len(run) // 10)].reshape(10, -1).max(axis=1)
        assert np.ptp(away) <= 0.02 * away[0]
