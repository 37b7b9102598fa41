"""Where time scales and multiple time steps end: constraints, loads, poles, scales without a value."""

from __future__ import annotations

import warnings
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Rolling

import liemech as lm
from liemech.errors import InvalidTimeScale, InvalidType, StepWarning

PENDULUM = lm.SphericalPendulum()
SWINGING = PENDULUM.consistent([0.6, 0.0, -0.8], [0.4, 1.5, 0.3])


def off(system: Any, method: Any, sigma: Any, start: Any, h: float) -> float:
    """How far z sigma is from one: of second order in h where G is the rate of sigma along the motion."""
    controlled = lm.ReversibleController(method, sigma)
    run = lm.integrate(system, controlled, start, h=h, steps=round(1.0 / h), compiled=False, progress=False)
    return float(np.abs(run.z * run.scale - 1.0).max())


def test_momenta_under_constraints() -> None:
    """The forces of the constraint change sigma(p) too."""

    def sigma(p: Any) -> Any:
        return 1.0 / (1.0 + p[0] ** 2)

    coarse, fine = (off(PENDULUM, lm.RATTLE(), sigma, SWINGING, h) for h in (0.05, 0.025))
    assert fine < 0.3 * coarse < 0.003


@lm.record
class Height(lm.Potential):
    """A ball in R^3 over the ground."""

    def energy(self, g: lm.Vec) -> float:
        return 9.81 * g[2]


@lm.record
class Sphere(lm.Constraint):
    """A thread of length one."""

    def value(self, g: lm.Vec) -> lm.Vec:
        return lm.vec(lm.dot(g, g) - 1.0)


def hanging() -> Any:
    """A particle on a thread, as a body in R^3."""
    free = lm.MechanicalSystem(lm.LiePoissonSystem(lm.VectorSpace(3), lm.KineticEnergy([1.0, 1.0, 1.0])), Height())
    body = lm.ConstrainedBody(free, Sphere())
    return body, body.consistent([0.4, 1.5, 0.3], [0.6, 0.0, -0.8]), lm.LieRATTLE()


def rolling() -> Any:
    """A ball, off its centre, which rolls on a plane."""
    group = lm.ProductGroup(lm.SO3(), lm.VectorSpace(2))
    free = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 1.3, 1.6, 2.0, 2.0]))
    ball = lm.NonholonomicBody(free, Rolling(0.5))
    return (ball, ball.consistent([0.4, 1.5, 0.3, 0.0, 0.0], group.identity()), lm.LagrangeDAlembert())


@pytest.mark.slow
@pytest.mark.parametrize("make", [hanging, rolling])
def test_bodies_under_constraints(make: Any) -> None:
    """The controller takes bodies with joints and bodies that roll, and knows the forces of their constraints."""
    body, start, method = make()

    def sigma(mu: Any, g: Any) -> Any:
        return 1.0 / (1.0 + mu[0] ** 2 + 0.5 * g[0] ** 2)

    coarse, fine = (off(body, method, sigma, start, h) for h in (0.05, 0.025))
    assert 0.0 < fine < 0.3 * coarse < 0.01


@lm.record
class Spring(lm.SeparableSystem):
    degrees: ClassVar[int] = 1

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * lm.dot(q, q)


SPRING = Spring()
BODY = lm.RigidBody([1.0, 1.5, 2.0])


@pytest.mark.parametrize(
    ("system", "sigma", "start", "error", "why"),
    [
        (
            SPRING,
            lm.time_scales.EqualPath(),
            SPRING.state(1.0, 0.0),
            InvalidTimeScale,
            "EqualPath.* has no value at the start",
        ),
        (
            SPRING,
            lm.time_scales.EqualPath(0.1),
            SPRING.state(1.0, 0.0),
            InvalidTimeScale,
            "EqualPath.* = nan at the start",
        ),
        (
            BODY,
            lm.time_scales.EqualArc(),
            BODY.state([0.0, 0.0, 0.0]),
            InvalidTimeScale,
            "EqualArc.* has no value at the start",
        ),
        (SPRING, lambda q: q, SPRING.state(1.0, 0.0), InvalidType, "must be one number"),
        (SPRING, lambda q: 1.0 / q[0], SPRING.state([[1.0], [0.0]], [[0.0], [0.0]]), InvalidTimeScale, "of body 1"),
    ],
    ids=["turning point", "too little energy", "body at rest", "vector", "ensemble"],
)
def test_scales_without_a_value_are_refused_by_name(system: Any, sigma: Any, start: Any, error: Any, why: str) -> None:
    method = lm.CovariantVariational(lm.Exponential()) if system is BODY else lm.StormerVerlet()
    with pytest.raises(error, match=why):
        lm.integrate(
            system, lm.ReversibleController(method, sigma), start, h=0.1, steps=2, compiled=False, progress=False
        )


def test_distances_of_constrained_systems() -> None:
    """On the unit sphere |q| = 1: equal steps."""
    varied, equal = (
        lm.integrate(PENDULUM, method, SWINGING, h=0.05, steps=10, compiled=False, progress=False)
        for method in (lm.ReversibleController(lm.RATTLE(), lm.time_scales.DistancePower(1.5)), lm.RATTLE())
    )
    assert np.abs(varied.q - equal.q).max() < 1e-12


@lm.record
class Stiff(lm.MultirateSystem):
    """A fast force, with a pole at q = 0, and a slow one."""

    degrees: ClassVar[int] = 1
    parts: ClassVar[tuple[str, ...]] = ("fast", "slow")

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * lm.dot(p, p)

    def fast(self, q: lm.Vec) -> float:
        return 50.0 * q[0] ** 2 + 0.0 / q[0]

    def slow(self, q: lm.Vec) -> float:
        return 0.25 * q[0] ** 4


def test_ensembles_in_resonance_are_warned_of() -> None:
    """With w = 10 and h = pi/10, and a start on the pole is not judged."""
    system, method = Stiff(), lm.MultipleTimeSteps((10,))
    many = system.state([[0.0], [1.0]], [[0.0], [0.0]])
    assert "resonance" in str(method.step_warning(system, many, np.pi / 10.0))
    assert method.step_warning(system, many, 0.2) is None
    assert method.step_warning(system, system.state(0.0, 0.0), np.pi / 10.0) is None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        start = system.state([[1.0], [1.1]], [[0.0], [0.0]])
        lm.integrate(system, method, start, h=np.pi / 10.0, steps=2, compiled=False, progress=False)
    assert [w for w in caught if issubclass(w.category, StepWarning)]


def test_ratios_are_a_tuple() -> None:
    with pytest.raises(InvalidType, match="ratios is a tuple"):
        lm.MultipleTimeSteps(ratios=5)  # type: ignore[arg-type]
