"""Magnus methods: orders for driven equations seen from the body and from space, symmetry, and what is exact."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scenes import Driven, DrivenFromSpace, asymmetric_body, hat, rotation, same_bits, slope

import liemech as lm
from liemech.formulas import vec
from liemech.integrators.commutator_free import CommutatorFree
from liemech.integrators.magnus import Magnus
from liemech.systems.equations.group_equation import GroupEquation, LinearGroupEquation

METHODS = [Magnus(order=p) for p in (2, 4, 6)]
COUNTS = {2: (80, 160, 320), 4: (20, 40, 80), 6: (10, 20, 40)}
ATTITUDE = rotation(np.random.default_rng(5))
by_name = pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)


KINDS = pytest.mark.parametrize("kind", [Driven, DrivenFromSpace], ids=["body", "space"])


@functools.cache
def reference(kind: type[Driven], t_end: float) -> np.ndarray:
    """The rotation at t_end, by a method that knows nothing of groups."""
    from scipy.integrate import solve_ivp

    system = kind(lm.SO3())

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        g, spin = y.reshape(3, 3), hat(system.drive(t))
        return (g @ spin if system.side == "left" else spin @ g).ravel()

    return (
        solve_ivp(rate, (0.0, t_end), ATTITUDE.ravel(), method="DOP853", rtol=3e-14, atol=1e-15).y[:, -1].reshape(3, 3)
    )


# ---------------------------------------------------------------- orders


@pytest.mark.sample(2)
@by_name
@KINDS
@pytest.mark.parametrize("t_end", [2.0, -0.7])
def test_order_and_way_back(method: Magnus, kind: type[Driven], t_end: float) -> None:
    """With h and with -h a step asks at the same times."""
    system, counts, error = kind(lm.SO3()), COUNTS[method.order], []
    for n in counts:
        run = lm.integrate(system, method, system.state(ATTITUDE), h=t_end / n, steps=n)
        error.append(np.abs(run.g[-1] - reference(kind, t_end)).max())
    assert slope([1 / n for n in counts], error) == pytest.approx(method.order, abs=0.1)
    back = lm.integrate(system, method, run.last, h=-t_end / n, steps=n, t0=t_end)
    assert method.symmetric and np.abs(back.g[-1] - ATTITUDE).max() < 1e-13


# ---------------------------------------------------------------- what is exact


def test_velocities_that_commute_are_integrated_to_the_degree_of_gauss() -> None:
    """About one axis the brackets vanish, and what is left is a quadrature: exact for polynomials of degree order - 1."""

    @lm.record
    class OneAxis(LinearGroupEquation):
        degree: int

        def drive(self, t: float) -> lm.Vec:
            return (self.degree + 1.0) * t**self.degree * vec(0.3, -0.2, 0.6)

    for method in METHODS:
        for degree in range(method.order):
            system = OneAxis(lm.SO3(), degree)
            run = lm.integrate(system, method, system.state(np.eye(3)), h=0.75, steps=2)
            assert np.abs(run.g - lm.SO3().exp(run.t[:, None] ** (degree + 1) * [0.3, -0.2, 0.6])).max() < 1e-14
        system = OneAxis(lm.SO3(), method.order)
        run = lm.integrate(system, method, system.state(np.eye(3)), h=0.75, steps=2)
        assert np.abs(run.g[-1] - lm.SO3().exp(1.5 ** (method.order + 1) * np.array([0.3, -0.2, 0.6]))).max() > 1e-5


@pytest.mark.slow
@by_name
def test_order_two_is_the_midpoint_rule_and_all_stay_on_the_group(method: Magnus) -> None:
    system = Driven(lm.SO3())
    run = lm.integrate(system, method, system.state(ATTITUDE), h=0.3, steps=200, compensated=False)
    assert np.abs(np.swapaxes(run.g, 1, 2) @ run.g - np.eye(3)).max() < 3e-14
    if method.order == 2:
        midpoint = lm.integrate(system, CommutatorFree(order=2), system.state(ATTITUDE), h=0.3, steps=200)
        assert same_bits(run.g, midpoint.g)


# ---------------------------------------------------------------- the face


def test_refusals() -> None:
    @lm.record
    class Steered(GroupEquation):
        def velocity(self, t: float, g: lm.Element) -> lm.Vec:
            return vec(g[0, 1], t, 1.0)

    for order in (0, 1, 3, 8, 4.0, True, "4", None):
        with pytest.raises(lm.errors.InvalidInput, match=r"Magnus: order is one of \[2, 4, 6\]"):
            Magnus(order)  # type: ignore[arg-type]
    body, start = asymmetric_body()
    steered = Steered(lm.SO3())
    rod = lm.SphericalPendulum()  # its velocity is linear in the momentum, and no linear equation
    hanging = rod.state([0.0, 0.0, -1.0], [0.4, 1.5, 0.0])
    for system, state in ((body, start), (steered, steered.state(ATTITUDE)), (rod, hanging)):
        with pytest.raises(lm.errors.IncompatibleSystem, match=r"needs a linear equation.*use RKMK.*or CommutatorFree"):
            lm.integrate(system, Magnus(), state, h=0.1, steps=1)


def test_a_drive_without_end_is_an_error() -> None:
    @lm.record
    class Pole(LinearGroupEquation):
        def drive(self, t: float) -> lm.Vec:
            return vec(1.0 / (t - 0.5), 0.0, 1.0)

    system = Pole(lm.SO3())
    with pytest.raises(lm.errors.NotFinite):
        lm.integrate(system, Magnus(order=2), system.state(np.eye(3)), h=1.0, steps=2)
