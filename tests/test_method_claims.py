"""Every shipped method keeps its claims, on a representative of every kind of system that it accepts: one table.

`check_method` observes order, symmetry, brackets, and what is kept.  It finds a wrong claim and says the number.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import Driven, DrivenFromSpace, Steered, asymmetric_body, heavy_top, kirchhoff_body, orbiting_body
from test_separable import Relativistic

import liemech as lm
from liemech.checks import Report, check_method
from liemech.integrators.class_functions import CayleySquare, TraceOfAd
from liemech.tableaus import KAHAN_LI6, SplittingTableau, gauss

EXP, CAYLEY = lm.Exponential(), lm.Cayley()


# ---------------------------------------------------------------- systems


@lm.record
class Precession(lm.HomogeneousEquation):
    """A direction that turns about an axis which depends on it."""

    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return lm.vec(0.3 + x[1], 1.0 - x[0] * x[2], 0.7 * x[0])


@functools.cache
def systems() -> dict[str, tuple[Any, Any]]:
    """One of each kind, with a start that is aligned with nothing."""
    turning = lm.SO3().exp([0.4, -0.3, 0.5])
    fluid, adrift, _ = kirchhoff_body()
    four = lm.LiePoissonSystem(lm.SO(4), lm.KineticEnergy([1.0, 1.4, 1.9, 1.2, 2.3, 1.6]))
    linear = lm.LiePoissonSystem(lm.MatrixLieGroup.of(lm.SL(2).generators), lm.KineticEnergy([1.0, 1.6, 2.3]))
    quaternions = lm.LiePoissonSystem(lm.UnitQuaternions(), lm.KineticEnergy([1.0, 1.6, 2.3]))
    galaxy, double, relativistic = lm.HenonHeiles(), lm.DoublePendulum(gravity=1.0), Relativistic()
    sphere = Precession(lm.SphereAction(3))
    return {
        "free body": asymmetric_body(),
        "quaternions": (quaternions, quaternions.state([0.9, 0.7, -0.6], lm.UnitQuaternions().exp([0.4, -0.3, 0.5]))),
        "fluid": (fluid, adrift),
        "SO(4)": (four, four.state([0.6, -0.5, 0.4, 0.7, 0.3, -0.2], lm.SO(4).random(1))),
        "SL(2)": (linear, linear.state([0.5, 0.4, -0.3], np.array([[1.1, 0.2], [0.3, 1.06 / 1.1]]))),
        "heavy top": heavy_top(),
        "satellite": orbiting_body(),
        "galaxy": (galaxy, galaxy.state([0.1, 0.2], [0.3, -0.2])),
        "double pendulum": (double, double.state([0.9, -0.4], [0.7, 0.2])),
        "relativistic": (relativistic, relativistic.state([1.0, 0.2], [0.3, 1.0])),
        "driven": (driven := Driven(lm.SO3()), driven.state(turning)),
        "driven from space": (driven := DrivenFromSpace(lm.SO3()), driven.state(turning)),
        "steered": (steered := Steered(lm.SO3()), steered.state(turning)),
        "sphere": (sphere, sphere.state([0.6, 0.0, 0.8])),
    }


# ---------------------------------------------------------------- methods

QUICK = "free body", "heavy top", "galaxy"
"""Systems on which a check takes a fraction of a second in plain Python."""


def methods() -> Iterator[tuple[lm.Method, bool]]:
    """All kinds of methods, and whether they are quick."""
    for p in (1, 2, 3, 4, 5, 6, 7, 8):
        yield lm.RKMK(order=p), p in (1, 4, 8)
    yield from ((lm.RKMK(order=4, retraction=CAYLEY), True), (lm.RKMK(tableau=gauss(2)), False))
    yield from ((lm.CommutatorFree(order=4), True), (lm.CrouchGrossman(order=4), True), (lm.Taylor(order=6), True))
    yield from ((lm.Magnus(order=p), p == 4) for p in (2, 4, 6))
    for retraction in (EXP, CAYLEY):
        yield lm.CovariantVariational(retraction), True
        yield lm.LieVerlet(retraction), True
        yield from ((lm.GalerkinVariational(order=p, retraction=retraction), False) for p in (2, 4, 6, 8))
        yield lm.LiePoissonHamiltonJacobi(2, retraction), True
        yield lm.Composition(lm.CovariantVariational(retraction), order=4), retraction == CAYLEY
        yield from ((lm.FirstKindHamiltonJacobi(order=p, retraction=retraction), False) for p in (1, 2, 3, 4))
    yield lm.CovariantVariational(lm.CayleyAdjoint()), False
    yield from ((lm.LiePoissonHamiltonJacobi(p, EXP), p == 4) for p in (4, 6, 8))
    yield from ((lm.FirstKindHamiltonJacobi(order=2, s0=s0, retraction=CAYLEY), False) for s0 in (TraceOfAd(), CayleySquare()))
    yield from ((lm.HamiltonJacobi(p, adjoint), p == 2) for p in (1, 2, 4, 6) for adjoint in (False, True))
    yield from ((lm.Composition(base, order=p), False) for base in (lm.LieVerlet(), lm.CovariantVariational()) for p in (6, 8))
    yield from ((lm.KickDrift(order=p), p < 6) for p in (2, 4, 6, 8))
    yield from ((lm.KickDrift(lm.ThreeRotations()), False), (lm.Composition(lm.KickDrift(), order=4), False))
    yield from ((m, True) for m in (lm.MoserVeselov(), lm.ThreeRotations(), lm.ImplicitMidpoint(), lm.SphericalMidpoint()))
    yield from ((m, True) for m in (lm.ExactFreeBody(), fitted()))
    yield from ((lm.Isospectral(p), p == 2) for p in (2, 4, 6, 8, 10))
    for first in ("kick", "drift"):
        yield from ((lm.StormerVerlet(first), True), (lm.SymplecticEuler(first), True))
    yield from ((lm.Splitting(order=p), True) for p in (3, 4, 6, 8))
    yield from ((lm.Splitting(order=p, quadratic=False), True) for p in (4, 6, 8))
    yield lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI6)), True


def fitted() -> lm.Method:
    """Moser-Veselov, made exact for the body's start and one step."""
    body, start = asymmetric_body()
    return lm.ExactMoserVeselov.of(body, start, 0.3)


def cases() -> Iterator[Any]:
    """Each method with each system that it accepts."""
    for method, quick in methods():
        for name, (system, _) in systems().items():
            try:
                method.require(system)
            except lm.errors.IncompatibleSystem:
                continue
            marks = [] if quick and name in QUICK else [pytest.mark.slow]
            yield pytest.param(method, name, marks=marks, id=f"{method!r}-{name}")


KEPT = {"free body": "spatial momentum", "heavy top": "vertical momentum"}


@pytest.mark.parametrize(("method", "name"), cases())
def test_claims(method: lm.Method, name: str) -> None:
    """Order, symmetry, symplecticity as claimed; momenta of symmetries kept by whatever is made to keep them."""
    system, start = systems()[name]
    slow = isinstance(method, (lm.LiePoissonHamiltonJacobi, lm.FirstKindHamiltonJacobi, lm.HamiltonJacobi, lm.GalerkinVariational))
    keeps = [KEPT[name]] if name in KEPT and (name == "free body" or method.symplectic) else []
    h = 0.3 if isinstance(method, lm.ExactMoserVeselov) else None
    check_method(method, system, start, h=h, keeps=keeps, compiled=None if slow and name not in QUICK else False)


def test_every_method_is_in_the_table() -> None:
    shipped = {getattr(lm, name) for name in lm.__all__}
    shipped = {x for x in shipped if isinstance(x, type) and issubclass(x, lm.Method) and x is not lm.Method}
    assert shipped == {type(method) for method, _ in methods()}


def test_every_method_is_checked_on_something_quick_or_slow() -> None:
    seen = {type(case.values[0]) for case in cases()}
    assert seen == {type(method) for method, _ in methods()}
