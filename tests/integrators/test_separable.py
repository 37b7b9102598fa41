"""Splittings of T(p) + V(q): orders, equivalences, what is kept, and how a system says that it is separable."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from scenes import Oscillator, Relativistic, same_bits

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, LawViolation
from liemech.formulas import cos, record, sin, vec
from liemech.names import everything
from liemech.tableaus import KAHAN_LI6, KAHAN_LI8, RUTH3, STRANG, SplittingTableau, suzuki

PENDULUM = json.loads((Path(__file__).parent.parent / "reference" / "pendulum.json").read_text())
GALAXY = lm.models.HenonHeiles()
STAR = GALAXY.state([0.1, 0.2], [0.3, -0.2])
Q, P = np.array(STAR.q), np.array(STAR.p)
PLANETS = lm.Kepler()


def plain(system: lm.System, method: lm.Method, start: lm.State, h: float, steps: int) -> lm.Trajectory:
    """A run in plain Python, without compensation: the bare formulas."""
    return lm.integrate(system, method, start, h=h, steps=steps, compiled=False, compensated=False)


# ---------------------------------------------------------------- orders

EULERS = lm.SymplecticEuler(), lm.SymplecticEuler(first="drift")
VERLETS = lm.StormerVerlet(), lm.StormerVerlet(first="drift")
GENERAL = (*EULERS, *VERLETS, lm.Splitting(order=3), *(lm.Splitting(order=p, quadratic=False) for p in (4, 6, 8)))
QUADRATIC = tuple(lm.Splitting(order=p) for p in (4, 6, 8))
STEPS = {1: 100, 2: 60, 3: 60, 4: 40, 6: 20, 8: 14}


@functools.cache
def relativistic_end() -> np.ndarray:
    """Where the relativistic particle is at t = 4, by a Runge-Kutta method of order 8."""
    system = Relativistic()
    return plain(system, lm.RKMK(order=8), system.state([1.0, 0.2], [0.3, 1.0]), 0.1, 40).q[-1]


@pytest.mark.sample(2)
@pytest.mark.parametrize("method", GENERAL, ids=repr)
def test_order_for_any_kinetic_energy(method: lm.Method) -> None:
    system, errors, n = Relativistic(), [], STEPS[method.order]
    for steps in (n, 2 * n):
        end = plain(system, method, system.state([1.0, 0.2], [0.3, 1.0]), 4.0 / steps, steps).q[-1]
        errors.append(np.abs(end - relativistic_end()).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.25)


@pytest.mark.parametrize("method", [*EULERS, *VERLETS, *QUADRATIC], ids=repr)
def test_order_on_an_ellipse(method: lm.Method) -> None:
    """Against Kepler's equation."""
    start, errors, n = PLANETS.pericentre(0.3), [], STEPS[method.order]
    for steps in (n, 2 * n):
        end = plain(PLANETS, method, start, 2.0 / steps, steps).q[-1]
        errors.append(np.abs(end - PLANETS.exact(start, 2.0).q).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.35)


def test_pendulum_against_elliptic_functions() -> None:
    system = lm.models.Pendulum(gravity=1.0)
    sample = next(s for s in PENDULUM["samples"] if float(s["t"]) == 1.0)
    run = plain(system, lm.Splitting(order=8), system.state(float(PENDULUM["q0"]), float(PENDULUM["p0"])), 0.1, 10)
    assert abs(run.q[-1, 0] - float(sample["q"])) <= 2e-13
    assert abs(run.p[-1, 0] - float(sample["p"])) <= 2e-13


def test_a_splitting_made_for_quadratic_energies_would_be_of_order_4_on_others() -> None:
    """What the refusal saves one from."""

    @record
    class Insistent(Relativistic):
        quadratic: ClassVar[bool] = True  # type: ignore[assignment]

    system, errors = Insistent(0.5), []
    start, method = system.state([1.0, 0.2], [0.3, 1.0]), lm.Splitting(order=8)
    exact = plain(system, lm.RKMK(order=8), start, 0.05, 40).q[-1]
    for steps in (8, 16):
        errors.append(np.abs(plain(system, method, start, 2.0 / steps, steps).q[-1] - exact).max())
    assert 3.5 < np.log2(errors[0] / errors[1]) < 6.0
    assert method.order == 8


# ---------------------------------------------------------------- equivalences


def test_stormer_verlet_is_the_leapfrog_bit_for_bit() -> None:
    q, p, h = Q, P, 0.1
    run = plain(GALAXY, lm.StormerVerlet(), STAR, h, 20)
    for _ in range(20):
        p = p + 0.5 * h * GALAXY.force(q, p)
        q = q + h * p
        p = p + 0.5 * h * GALAXY.force(q, p)
    assert same_bits(run.q[-1], q)
    assert same_bits(run.p[-1], p)


def test_positions_obey_stormers_recursion() -> None:
    """q_n+1 - 2 q_n + q_n-1 = h^2 f(q_n)."""
    run = plain(GALAXY, lm.StormerVerlet(), STAR, 0.1, 20)
    middle = run.q[1:-1]
    assert np.abs(run.q[2:] - 2 * middle + run.q[:-2] - 0.01 * GALAXY.force(middle, 0 * middle)).max() < 1e-15


@pytest.mark.slow
def test_symplectic_euler_is_the_hamilton_jacobi_method_of_order_1() -> None:
    for ours, theirs in zip(
        EULERS, (lm.HamiltonJacobi(order=1, adjoint=True), lm.HamiltonJacobi(order=1)), strict=True
    ):
        a, b = (plain(GALAXY, method, STAR, 0.1, 5) for method in (ours, theirs))
        assert np.abs(a.q[-1] - b.q[-1]).max() < 1e-15
        assert np.abs(a.p[-1] - b.p[-1]).max() < 1e-15


def test_the_euler_methods_undo_each_other_and_make_stormer_verlet() -> None:
    h = 0.2
    for first, second, whole in zip(EULERS, EULERS[::-1], VERLETS, strict=True):
        there = plain(GALAXY, first, STAR, h, 1).last
        assert np.abs(plain(GALAXY, second, there, -h, 1).q[-1] - Q).max() < 1e-16
        halves = plain(GALAXY, second, plain(GALAXY, first, STAR, h / 2, 1).last, h / 2, 1)
        assert np.abs(halves.q[-1] - plain(GALAXY, whole, STAR, h, 1).q[-1]).max() < 1e-16


def test_a_composition_of_stormer_verlet_is_its_splitting() -> None:
    """The half kicks of neighbours join; the numbers do not change."""
    composed = plain(GALAXY, lm.Composition(lm.StormerVerlet(), tableau=KAHAN_LI6), STAR, 0.3, 10)
    split = plain(GALAXY, lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI6)), STAR, 0.3, 10)
    assert np.abs(composed.q - split.q).max() < 1e-15
    assert np.abs(composed.p - split.p).max() < 1e-15


def test_lie_verlet_on_a_vector_space_is_stormer_verlet() -> None:
    @record
    class Field(lm.Potential):
        def energy(self, g: lm.Element) -> float:
            return GALAXY.potential(g)

    free = lm.LiePoissonSystem(lm.VectorSpace(2), lm.KineticEnergy([1.0, 1.0]))
    body = lm.MechanicalSystem(free, Field())
    theirs = plain(body, lm.LieVerlet(), body.state(P, Q), 0.2, 10)
    ours = plain(GALAXY, lm.StormerVerlet(), STAR, 0.2, 10)
    assert np.abs(theirs.g - ours.q).max() < 1e-15
    assert np.abs(theirs.mu - ours.p).max() < 1e-15


# ---------------------------------------------------------------- what is kept


def test_the_modified_energy_of_an_oscillator_is_constant() -> None:
    """p^2 + w^2 q^2 (1 - h^2 w^2/4), for kicks first, exactly; its form is definite below h w = 2 only (HLW I.5.2)."""
    system = Oscillator(3.0)
    for h in (0.1, 0.6, 0.66):
        run = plain(system, lm.StormerVerlet(), system.state(1.0, 0.5), h, 200)
        kept = run.p**2 + 9.0 * run.q**2 * (1.0 - 2.25 * h * h)
        assert np.ptp(kept) < 1e-12 * np.abs(run.p).max() ** 2
    assert np.abs(run.q).max() < 100.0
    assert np.abs(plain(system, lm.StormerVerlet(), system.state(1.0, 0.5), 0.67, 200).q).max() > 1e6


@pytest.mark.parametrize("method", [*EULERS, *VERLETS, *QUADRATIC, lm.Splitting(order=3)], ids=repr)
def test_angular_momentum_is_kept_to_rounding(method: lm.Method) -> None:
    run = plain(PLANETS, method, PLANETS.pericentre(0.6), 0.15, 40)
    momentum = run.q[:, 0] * run.p[:, 1] - run.q[:, 1] * run.p[:, 0]
    assert np.abs(momentum - 0.8).max() < 1e-14
    assert np.ptp(run.energy) > 1e-9


@pytest.mark.slow
def test_compensated_sums_find_the_way_back() -> None:
    """A thousand steps and a thousand back: to the last bit with compensation, not without."""
    there = [
        lm.integrate(GALAXY, lm.StormerVerlet(), STAR, h=0.1, steps=1000, every=1000, compiled=False, compensated=c)
        for c in (False, True)
    ]
    missed = [
        np.abs(
            lm.integrate(GALAXY, lm.StormerVerlet(), run.last, h=-0.1, steps=1000, compiled=False, compensated=c).q[-1]
            - Q
        )
        for run, c in zip(there, (False, True), strict=True)
    ]
    assert missed[1].max() < 1e-15
    assert missed[0].max() > missed[1].max()


@pytest.mark.slow
def test_time_as_a_coordinate() -> None:
    """A driven pendulum: time advances by h, orders are those of autonomous motions, H + e is constant up to the error."""

    @record
    class Swing(lm.SeparableSystem):
        degrees: ClassVar[int] = 2

        def kinetic(self, p: lm.Vec) -> float:
            return 0.5 * p[0] ** 2 + p[1]

        def potential(self, q: lm.Vec) -> float:
            return -(1.0 + 0.4 * cos(2.0 * q[1])) * cos(q[0])

    @record
    class Driven(lm.GroupEquation):
        def velocity(self, t: float, g: lm.Element) -> lm.Vec:
            return vec(g[1], -(1.0 + 0.4 * cos(2.0 * t)) * sin(g[0]))

    swing, driven = Swing(), Driven(lm.VectorSpace(2))
    exact = plain(driven, lm.RKMK(order=8), driven.state([1.0, 0.5]), 0.05, 40).g[-1]
    assert swing.quadratic
    for method in (lm.Splitting(order=6), lm.HamiltonJacobi(order=4)):
        errors = []
        for steps in (10, 20):
            run = plain(swing, method, swing.state([1.0, 0.0], [0.5, 0.0]), 2.0 / steps, steps)
            assert np.abs(run.q[:, 1] - run.t).max() < 1e-14
            errors.append(np.hypot(run.q[-1, 0] - exact[0], run.p[-1, 0] - exact[1]))
            assert np.ptp(run.energy) < 1e-3
        assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.5)


# ---------------------------------------------------------------- how a system says that it is separable


def test_derivatives_that_nobody_wrote_are_those_in_closed_form(rng: np.random.Generator) -> None:
    for system in (GALAXY, PLANETS, lm.models.Pendulum(1.2, 0.8, 3.0)):
        q, p = (lm.Vec.of(x) for x in rng.normal(size=(2, system.degrees)).tolist())
        for name in ("velocity", "force"):
            derived = getattr(lm.SeparableSystem, name)(system, q, p)
            assert np.allclose(np.array(derived), np.array(getattr(system, name)(q, p)), rtol=1e-14, atol=1e-15)
        assert system.energy(q, p) == system.kinetic(p) + system.potential(q)


def test_a_quadratic_kinetic_energy_is_told_by_its_formula() -> None:
    @record
    class Massive(Oscillator):
        masses: lm.Mat

        def kinetic(self, p: lm.Vec) -> float:
            return 0.5 * (p @ (self.masses @ p)) + 0.3 * p[0] - 1.0

    @record
    class Quartic(Oscillator):
        def kinetic(self, p: lm.Vec) -> float:
            return 0.5 * p[0] ** 2 + 1e-30 * p[0] ** 4

    @record
    class Free(Oscillator):
        def kinetic(self, p: lm.Vec) -> float:
            return 0.0

    assert all(
        s.quadratic for s in (GALAXY, PLANETS, lm.models.Pendulum(), Oscillator(1.0), Free(1.0), Massive(1.0, [[2.0]]))
    )
    assert not any(s.quadratic for s in (Relativistic(), Relativistic(3e8), Quartic(1.0)))


def test_refusals_say_what_to_do() -> None:
    double = lm.models.DoublePendulum()
    for method in (lm.StormerVerlet(), lm.SymplecticEuler(), lm.Splitting(order=4)):
        with pytest.raises(IncompatibleSystem, match=r"needs a SeparableSystem.*write kinetic\(p\).*HamiltonJacobi"):
            lm.integrate(double, method, double.state([1.0, 1.0], [0.0, 0.0]), h=0.1, steps=1)
        with pytest.raises(IncompatibleSystem, match=r"needs a SeparableSystem.*RKMK accepts every system"):
            method.require(lm.RigidBody([1.0, 1.5, 2.0]))
    with pytest.raises(IncompatibleSystem, match=r"second degree.*Splitting\(order=6, quadratic=False\)"):
        lm.Splitting(order=6).require(Relativistic())
    with pytest.raises(IncompatibleSystem, match=r"in a field.*StormerVerlet"):
        lm.KickDrift().require(PLANETS)
    with pytest.raises(lm.errors.NotDefined, match="Empty must define `kinetic`"):

        @record
        class Empty(lm.SeparableSystem):
            degrees: ClassVar[int] = 1

        Empty().kinetic(vec(1.0))


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: lm.Splitting(order=5), InvalidInput, r"order is one of \[1, 2, 3, 4, 6, 8\]"),
        (lambda: lm.Splitting(order=2.0), InvalidInput, "order is one of"),
        (lambda: lm.Splitting(tableau=KAHAN_LI8), InvalidType, "must be a SplittingTableau"),
        (lambda: lm.Splitting(quadratic=1), InvalidType, "True or False"),
        (lambda: lm.StormerVerlet(first="drifts"), InvalidInput, '"kick" or "drift"'),
        (lambda: lm.SymplecticEuler(first=None), InvalidInput, '"kick" or "drift"'),
        (lambda: lm.KickDrift(tableau=RUTH3), InvalidInput, "must be symmetric"),
        (lambda: SplittingTableau.of(suzuki(4)), InvalidInput, "is for order 4"),
        (lambda: lm.Splitting(order=4).tableau.exchanged, InvalidInput, "cannot be exchanged"),
        (
            lambda: SplittingTableau("spoilt", 4, RUTH3.kicks, RUTH3.drifts, symmetric=False),
            LawViolation,
            "is of order 3",
        ),
    ],
)
def test_what_cannot_be_meant(make: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        make()  # type: ignore[operator]


def test_faces() -> None:
    for method in (*EULERS, *VERLETS, *QUADRATIC, *GENERAL):
        assert eval(repr(method), everything()) == method
        assert method.symplectic
        assert method.symmetric == (method.order not in (1, 3))
    assert STRANG.exchanged.exchanged.kicks == STRANG.kicks
    assert STRANG.exchanged.exchanged.drifts == STRANG.drifts
    assert [lm.Splitting(order=p).tableau.stages for p in (1, 2, 3, 4, 6, 8)] == [1, 1, 3, 6, 11, 19]
    assert [lm.Splitting(order=p, quadratic=False).tableau.stages for p in (4, 6, 8)] == [6, 10, 17]
