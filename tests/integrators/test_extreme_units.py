"""Units of mass and time by a hundred powers of ten and more, and bodies that come to rest: as in
ordinary units, or refused.
"""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm

J, MU = np.array([1.0, 1.5, 2.0]), np.array([0.5, 0.3, 0.8])
EXP, CAY = lm.Exponential(), lm.Cayley()
HJ = lm.LiePoissonHamiltonJacobi


def moved(method: lm.Method, mass: float = 1.0, time: float = 1.0) -> np.ndarray:
    """Momentum and attitude after two steps, in ordinary units."""
    body = lm.RigidBody(mass * J)
    run = lm.integrate(body, method, body.state(mass / time * MU, np.eye(3)), h=0.2 * time, steps=2, compiled=False)
    return np.concatenate([run.mu[-1] / (mass / time), run.g[-1].ravel()])


METHODS = (HJ(2), HJ(4), HJ(4, CAY), HJ(6), HJ(8), lm.ExactFreeBody(), lm.RKMK(order=4), lm.CovariantVariational())


@pytest.mark.sample(3)
@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("k", [-100, 100])
def test_hundred_powers_of_ten(method: lm.Method, k: int) -> None:
    here = moved(method)
    assert np.abs(moved(method, mass=10.0**k) - here).max() <= 1e-14
    assert np.abs(moved(method, time=10.0**k) - here).max() <= 1e-14


@pytest.mark.parametrize("method", [m for m in METHODS if not isinstance(m, lm.CovariantVariational)], ids=repr)
@pytest.mark.parametrize("k", [-120, 120])
def test_more_of_them(method: lm.Method, k: int) -> None:
    """The order is that of the method, not less because a power of h is zero."""
    here = moved(method)
    assert np.abs(moved(method, mass=10.0**k) - here).max() <= 1e-14
    assert np.abs(moved(method, time=10.0**k) - here).max() <= 1e-14


@pytest.mark.parametrize("retraction", [EXP, CAY], ids=repr)
@pytest.mark.parametrize("units", [(1e-110, 1.0), (1e110, 1.0), (1.0, 1e-110), (1.0, 1e110)])
def test_algorithm_1_has_a_unit_of_time_of_its_own(retraction: lm.Retraction, units: tuple[float, float]) -> None:
    here = moved(method := lm.CovariantVariational(retraction))
    assert np.abs(moved(method, *units) - here).max() <= 1e-14


@pytest.mark.parametrize("size", [1e-150, 1e-155, 1e-200, 1e-320, 0.0])
def test_a_body_at_rest_in_a_field(size: float) -> None:
    """It drifts by h J^-1 mu as long as that is anything, and stays where it is."""
    field = lm.MechanicalSystem(lm.RigidBody(J), lm.models.FixedPointGravity(0.0, [0.0, 0.0, 1.0]))
    run = lm.integrate(field, lm.KickDrift(), field.state(size * MU, np.eye(3)), h=0.1, steps=3, compiled=False)
    assert np.array_equal(run.mu[-1], size * MU)
    turned = lm.SO3().log(run.g[-1])
    assert np.abs(turned - 0.3 * (size * MU) / J).max() <= max(1e-14 * size, 1e-300)


def test_a_top_that_swings_through_rest() -> None:
    """Let go at rest: the first kick makes the momentum, and the way back is the way there."""
    top = lm.models.HeavyTop(J, 1.0, [0.3, 0.0, 1.0])
    start = top.state(np.zeros(3), np.eye(3))
    run = lm.integrate(top, lm.KickDrift(), start, h=0.1, steps=20, compiled=False)
    back = lm.integrate(top, lm.KickDrift(), run.last, h=-0.1, steps=20, compiled=False)
    assert np.abs(back.mu[-1]).max() <= 1e-13
    assert np.abs(back.g[-1] - np.eye(3)).max() <= 1e-13
    assert np.abs(run.energy - run.energy[0]).max() <= 1e-2


@lm.record
class Shaken(lm.GroupEquation):
    """A mass on a spring, in a unit of length of one's own."""

    unit: float

    def velocity(self, t: float, y: lm.Vec) -> lm.Vec:
        return lm.vec(y[1], -y[0] + self.unit * lm.formulas.sin(5.0 * t))


@pytest.mark.parametrize("method", [lm.RKMK(order=5), lm.Taylor(order=12)], ids=lambda m: m.name)
@pytest.mark.parametrize("power", [-30, 10])
def test_adaptive_steps_in_a_vector_space_are_those_of_all_units(method: lm.Method, power: int) -> None:
    """Errors are compared with the components: in another unit the same steps, bit for bit."""
    runs = []
    for unit in 1.0, 2.0**power:
        spring = Shaken(lm.VectorSpace(2), unit)
        start = spring.state([unit, 0.0])
        run = lm.integrate(spring, method, start, t_end=3.0, rtol=1e-8, atol=1e-10 * unit, compiled=False)
        runs.append((run.t, run.g / unit))
    for one, other in zip(*runs, strict=True):
        assert np.array_equal(one, other)


@lm.record
class Flight(lm.GroupEquation):
    """A frame that turns and flies, in a unit of length of one's own."""

    unit: float

    def velocity(self, t: float, g: lm.Mat) -> lm.Vec:
        turn = lm.vec(0.3, lm.formulas.sin(t), 0.5 * g[2, 0])
        return lm.vec(*turn, self.unit * g[0, 0], g[0, 3] - g[1, 3], self.unit * lm.formulas.cos(3.0 * t))


@pytest.mark.parametrize("power", [-30, 10])
def test_adaptive_steps_of_motions_of_space_are_those_of_all_units(power: int) -> None:
    """Errors of positions are compared with the distance from the origin: in another unit of length
    the same steps, bit for bit.  (An absolute tolerance is one for angles, too.)
    """
    runs = []
    for unit in 1.0, 2.0**power:
        flight = Flight(lm.SE3(), unit)
        here = np.eye(4)
        here[:3, 3] = [unit, 0.5 * unit, 0.0]
        run = lm.integrate(flight, lm.RKMK(order=5), flight.state(here), t_end=3.0, rtol=1e-8, atol=0.0, compiled=False)
        assert len(run.t) > 10
        runs.append((run.t, run.g[:, :3, :3], run.g[:, :3, 3] / unit))
    for one, other in zip(*runs, strict=True):
        assert np.array_equal(one, other)


SMALL = (
    *(lm.ImplicitMidpoint(), HJ(2), HJ(4), lm.ExactFreeBody()),
    *(lm.Isospectral(2), lm.RKMK(order=4), lm.ThreeRotations()),
)


@pytest.mark.parametrize("method", SMALL, ids=repr)
@pytest.mark.parametrize("size", [1e-160, 1e-170, 1e-200, 1e-290, 1e160, 1e200])
def test_momenta_whose_squares_are_no_numbers(method: lm.Method, size: float) -> None:
    """In units of time in which the body turns as it does in ordinary ones."""
    assert np.abs(moved(method, time=1.0 / size) - moved(method)).max() <= 1e-14
    assert np.abs(moved(method, mass=size) - moved(method)).max() <= 1e-14


@pytest.mark.parametrize("size", [1e-170, 1e-200, 1e170])
def test_products_that_are_no_numbers_are_refused(size: float) -> None:
    for method in (lm.GalerkinVariational(4), lm.SphericalMidpoint()):
        with pytest.raises(lm.errors.InvalidInput, match="leaves the range of floats; take"):
            moved(method, time=1.0 / size)
