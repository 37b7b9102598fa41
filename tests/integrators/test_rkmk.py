"""RKMK: the method itself to 13 digits, its orders, and what it keeps and does not keep."""

from __future__ import annotations

import functools
import json
import math
import operator
from pathlib import Path

import numpy as np
import pytest
from scenes import (
    RKMK4,
    Driven,
    DrivenInverse,
    Powers,
    Steered,
    SteeredInverse,
    asymmetric_body,
    poisson_defect,
    rotation,
    same_bits,
    seed_body,
    slope,
)

import liemech as lm
from liemech.formulas import cos, sin, vec
from liemech.tableaus import gauss, radau_iia
from liemech.tableaus.tableau import ButcherTableau

REFERENCE = json.loads((Path(__file__).parent.parent / "reference" / "integrator_steps_so3.json").read_text())
HEUN3 = ButcherTableau("Heun 3", 3, ((), (1 / 3,), (0, 2 / 3)), (1 / 4, 0, 3 / 4), (0, 1 / 3, 2 / 3))
COUNTS = {1: (200, 400, 800), 2: (80, 160, 320), 3: (40, 80, 160), 4: (20, 40, 80)}


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_steps_of_the_method_itself(compiled: bool) -> None:
    body, start = seed_body()
    run = lm.integrate(body, RKMK4, start, h=0.5, steps=200, compiled=compiled)
    for at in REFERENCE["methods"]["RKMK4"]["trajectory"]:
        assert np.abs(run.mu[at["n"]] - at["mu"]).max() < 1e-13
        assert np.abs(run.g[at["n"]] - at["g"]).max() < 1e-13
        assert run.energy[at["n"]] == pytest.approx(at["energy"], abs=1e-13)


def test_error_after_two_hundred_steps() -> None:
    """4.4e-2 in the momentum, -1.7e-3 in the energy: the article's own step is that coarse."""
    body, start = seed_body()
    run = lm.integrate(body, RKMK4, start, h=0.5, steps=200)
    assert np.abs(run.mu[-1] - body.exact(start, 100.0).mu).max() == pytest.approx(4.4e-2, abs=5e-4)
    assert run.energy[-1] - 3 / 8 == pytest.approx(-1.7e-3, abs=5e-5)


# ---------------------------------------------------------------- order


METHODS = [
    *(lm.RKMK(order=p) for p in (1, 2, 3, 4)),
    *(lm.RKMK(order=p, truncation="closed") for p in (2, 3, 4)),
    lm.RKMK(order=4, truncation=5),
    lm.RKMK(tableau=HEUN3),
    *(lm.RKMK(order=p, retraction=lm.Cayley()) for p in (1, 2, 3, 4)),
]
IMPLICIT = [lm.RKMK(tableau=t) for t in (gauss(1), gauss(2), radau_iia(2))]


def test_a_linear_hamiltonian_is_followed_exactly() -> None:
    """H = w . mu has the constant velocity w: the motion is g = exp(t w), at any step and any order."""

    @lm.record
    class Linear(lm.Hamiltonian):
        """w . mu."""

        w: lm.Vec

        def energy(self, mu: lm.Vec) -> float:
            return lm.dot(self.w, mu)

        def gradient(self, mu: lm.Vec) -> lm.Vec:
            return self.w

    w, mu = np.array([0.3, -0.7, 0.5]), np.array([1.0, 2.0, -0.5])
    system = lm.LiePoissonSystem(lm.SO3(), Linear(w))
    for order in (1, 2, 3, 4):
        run = lm.integrate(system, lm.RKMK(order=order), system.state(mu, np.eye(3)), h=0.7, steps=10)
        wanted = lm.SO3().exp(run.t[:, None] * w)
        assert np.abs(run.g - wanted).max() < 1e-14
        assert np.abs(run.mu - np.swapaxes(wanted, 1, 2) @ mu).max() < 1e-14


# ---------------------------------------------------------------- other spaces


@lm.record
class Pendulum(lm.GroupEquation):
    """A driven nonlinear equation in the plane, where everything commutes."""

    def velocity(self, t: float, g: lm.Element) -> lm.Vec:
        return vec(g[1] * cos(t), -sin(g[0]) + 0.1 * t)


def runge_kutta(tableau: lm.tableaus.ButcherTableau, t: float, y: np.ndarray, h: float) -> np.ndarray:
    """A step of the ordinary method, with sums in the order of the tableau."""
    slopes: list[np.ndarray] = []

    def sum_of(row: tuple[float, ...]) -> np.ndarray:
        terms = [(h * a) * k for a, k in zip(row, slopes) if a != 0.0]
        return functools.reduce(operator.add, terms) if terms else np.zeros(2)

    for row, c in zip(tableau.A, tableau.c):
        s, (x, v) = t + c * h, y + sum_of(row)
        slopes.append(np.array([v * math.cos(s), -math.sin(x) + 0.1 * s]))
    return y + sum_of(tableau.b)


@pytest.mark.sample(4)
@pytest.mark.parametrize("order", range(1, 9))
def test_on_a_vector_space_it_is_the_runge_kutta_method_bit_for_bit(order: int) -> None:
    system, method = Pendulum(lm.VectorSpace(2)), lm.RKMK(order=order)
    run = lm.integrate(system, method, system.state([0.5, -0.3]), h=0.125, steps=40, compiled=False)
    y = np.array([0.5, -0.3])
    for n in range(40):
        y = runge_kutta(method.tableau.bare, n * 0.125, y, 0.125)
        assert same_bits(run.g[n + 1], y)


ATTITUDE = rotation(np.random.default_rng(5))
FLOWS = [*(lm.CommutatorFree(order=p) for p in (1, 2, 3, 4)), *(lm.CrouchGrossman(order=p) for p in (3, 4))]
MAGNUS = [lm.Magnus(order=p) for p in (2, 4, 6)]


@pytest.mark.sample(8)
@pytest.mark.parametrize("method", [*METHODS, *IMPLICIT, *FLOWS, *MAGNUS], ids=lambda method: method.name)
def test_a_motion_and_its_inverse(method: lm.Method) -> None:
    """g' = g xi and the equation of g^-1, with its velocity in space: step by step inverse to each other."""
    body, space = (
        kind(lm.SO3()) for kind in ((Driven, DrivenInverse) if method in MAGNUS else (Steered, SteeredInverse))
    )
    there = lm.integrate(body, method, body.state(ATTITUDE), h=0.1, steps=12)
    inverse = lm.integrate(space, method, space.state(ATTITUDE.T), h=0.1, steps=12)
    assert np.abs(np.swapaxes(there.g, 1, 2) - inverse.g).max() < 1e-13


@lm.record
class Even(lm.GroupEquation):
    """A constant velocity, in the body or in space."""

    def velocity(self, t: float, g: lm.Element) -> lm.Vec:
        return vec(0.3, -0.2, 0.5)


@lm.record
class EvenFromSpace(Even):
    side = "right"


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("retraction", [lm.Exponential(), lm.Cayley()], ids=repr)
def test_steps_from_either_side_lose_equally_little(retraction: lm.Retraction, compensated: bool) -> None:
    """A step adds an increment to g.  The product of a rounded tau(omega) and g would lose the same
    half of a rounding in each of equal steps: 1000 in these.
    """
    for system in Even(lm.SO3()), EvenFromSpace(lm.SO3()), EvenFromSpace(lm.UnitQuaternions()):
        method = lm.RKMK(order=4, retraction=retraction)
        start = system.state(system.group.identity())
        run = lm.integrate(system, method, start, h=0.05, steps=8000, every=8000, compensated=compensated)
        assert system.group.defect(run.g[-1]) < 150 * 2.0**-52


@lm.record
class Compass(lm.HomogeneousEquation):
    """A unit vector in a field that depends on time and on where it points."""

    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return vec(x[1] * x[2] + cos(t), 1.0 + x[0], -0.5 * x[2] + sin(2.0 * t))


@functools.cache
def compass() -> np.ndarray:
    """Where the vector points at t = 2, by a method that knows nothing of spheres."""
    from scipy.integrate import solve_ivp

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return np.cross([x[1] * x[2] + np.cos(t), 1.0 + x[0], -0.5 * x[2] + np.sin(2.0 * t)], x)

    return solve_ivp(rate, (0.0, 2.0), [0.6, 0.0, 0.8], method="DOP853", rtol=3e-14, atol=1e-15).y[:, -1]


@pytest.mark.parametrize(
    "method", [lm.RKMK(order=2), RKMK4, *IMPLICIT, lm.RKMK(order=2, retraction=lm.Cayley())], ids=repr
)
def test_points_stay_on_the_sphere(method: lm.RKMK) -> None:
    system, counts = Compass(lm.actions.SphereAction(3)), [2 * n for n in COUNTS[method.order]]
    error = []
    for n in counts:
        run = lm.integrate(system, method, system.state([0.6, 0.0, 0.8]), h=2.0 / n, steps=n)
        assert np.abs(np.linalg.norm(run.x, axis=1) - 1.0).max() < 1e-14
        error.append(np.abs(run.x[-1] - compass()).max())
    assert min(error) > 1e-12
    assert slope([1 / n for n in counts], error) == pytest.approx(method.order, abs=0.1)


# ---------------------------------------------------------------- implicit tableaus


def there_and_back(system: lm.System, method: lm.RKMK, start: lm.State, h: float) -> float:
    """How far a step of h and one of -h lead from the start; a driven equation is asked at the same times."""
    there = lm.integrate(system, method, start, h=h, steps=1, t0=0.3)
    back = lm.integrate(system, method, there.last, h=-h, steps=1, t0=0.3 + h).last
    return max(np.abs(np.array(a) - np.array(b)).max() for a, b in zip(back.parts.values(), start.parts.values()))


def test_where_gauss_methods_undo_their_steps() -> None:
    """The midpoint rule everywhere, all of them where everything commutes; a chart at the start of
    a step is not one at its end.
    """
    flat, steered, (body, start) = Pendulum(lm.VectorSpace(2)), Steered(lm.SO3()), asymmetric_body()
    for stages in (1, 2, 3):
        method = lm.RKMK(tableau=gauss(stages))
        for h in (0.1, 0.4):
            assert there_and_back(flat, method, flat.state([0.5, -0.3]), h) < 1e-14
            if stages == 1:
                assert there_and_back(body, method, start, h) < 1e-14
                assert there_and_back(steered, method, steered.state(ATTITUDE), h) < 1e-14
    for stages, steps in ((2, [0.2, 0.1, 0.05]), (3, [0.4, 0.2, 0.1])):
        missed = [there_and_back(steered, lm.RKMK(tableau=gauss(stages)), steered.state(ATTITUDE), h) for h in steps]
        assert slope(steps, missed) == pytest.approx(2 * stages + 2, abs=0.4)
    assert not lm.RKMK.symmetric


@pytest.mark.sample(2)
@pytest.mark.parametrize("method", IMPLICIT, ids=repr)
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.compiled)])
def test_stages_that_do_not_converge_are_an_error(method: lm.RKMK, compiled: bool) -> None:
    body, start = asymmetric_body()
    with pytest.raises(lm.errors.NoConvergence, match=r"stages did not converge.*step h = 10 is too large.*try 2.5"):
        lm.integrate(body, method, start, h=10.0, steps=3, compiled=compiled)


# ---------------------------------------------------------------- what is kept


def test_the_bracket_is_not_kept() -> None:
    """One step misses it by h^5, as every method of order 4 may: far above what differences can see."""
    body, start = asymmetric_body()
    h = [0.5, 0.25, 0.125]
    defects = [poisson_defect(body, RKMK4, np.array(start.mu), step) for step in h]
    assert defects[0] > 1e-5
    assert slope(h, defects) == pytest.approx(5.0, abs=0.3)
    seed, start = seed_body()
    assert poisson_defect(seed, RKMK4, np.array(start.mu), 0.5) > 1e-5


def test_the_energy_drifts() -> None:
    """A body that loses 0.4 per cent in 200 steps and ever more afterwards, with |mu| exact all the time."""
    body, start = seed_body()
    run = lm.integrate(body, RKMK4, start, h=0.5, steps=10_000, every=100)
    error = run.energy - run.energy[0]
    assert (np.diff(error) < 0).all()
    assert error[-1] < 10 * error[2] < 0
    assert np.abs(run.casimirs - 1.0).max() < 1e-13


# ---------------------------------------------------------------- the face


@pytest.mark.parametrize(("tableau", "degree"), [(gauss(2), 3), (gauss(3), 5), (radau_iia(2), 2), (radau_iia(3), 4)])
def test_stages_of_implicit_methods_stand_at_their_times(tableau: lm.tableaus.ButcherTableau, degree: int) -> None:
    """Gauss' nodes integrate powers up to 2s - 1 exactly, those of Radau up to 2s - 2."""
    for power in range(degree + 2):
        line = Powers(lm.VectorSpace(1), power)
        method, start = lm.RKMK(tableau=tableau), line.state([0.0])
        end = lm.integrate(line, method, start, h=0.8, steps=1, t0=0.5, compiled=False).g[-1, 0]
        exact = (1.3 ** (power + 1) - 0.5 ** (power + 1)) / (power + 1)
        assert (abs(end - exact) < 1e-15 * 8) == (power <= degree)
