"""Claims of methods on driven systems: brackets are observed there too, on momenta, on groups and in R^2n."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import cos, sin


@lm.record
class Swing(lm.DrivenHamiltonianSystem):
    """A pendulum whose support goes up and down."""

    degrees: ClassVar[int] = 1

    def energy(self, t: float, q: lm.Vec, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0] - (1.0 + 0.3 * cos(2.0 * t)) * cos(q[0])


@lm.record
class Breathing(lm.DrivenHamiltonian):
    """A body whose first moment changes."""

    def energy(self, t: float, mu: lm.Vec) -> float:
        return 0.5 * ((1.0 + 0.2 * sin(t)) * mu[0] ** 2 + mu[1] ** 2 / 1.6 + mu[2] ** 2 / 2.3)


@lm.record
class Boasting(lm.RKMK):
    """A method that claims what it is not."""

    symplectic: ClassVar[bool] = True


SWING = Swing()
BODY = lm.DrivenLiePoissonSystem(lm.SO3(), Breathing())
CASES = {
    "swing": (SWING, SWING.state([0.7], [0.4]), {"symplectic"}, lm.HamiltonJacobi(2)),
    "body": (
        BODY,
        BODY.state([0.9, 0.7, -0.6], lm.SO3().exp([0.4, -0.3, 0.5])),
        {"Poisson", "symplectic", "equivariance"},
        lm.LiePoissonHamiltonJacobi(2, lm.Cayley()),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_brackets_of_driven_systems_are_observed(name: str) -> None:
    system, start, laws, method = CASES[name]
    found: Any = {f.law: f.verdict for f in lm.check_method(method, system, start, compiled=False).findings}
    assert laws <= set(found)
    assert found["Poisson" if name == "body" else "symplectic"] == "holds"


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_wrong_bracket_is_found_on_driven_systems(name: str) -> None:
    system, start, _, _ = CASES[name]
    report = lm.check_method(Boasting(order=4), system, start, compiled=False, raises=False)
    assert report["Poisson" if name == "body" else "symplectic"].verdict == "broken"
    assert report["order"].verdict == "holds"


@lm.record
class Towed(lm.Force):
    """A torque that is known for a while, and friction."""

    torque: lm.PiecewisePolynomial
    friction: float

    def covector(self, t: float, xi: lm.Vec, g: lm.Mat) -> lm.Vec:
        return self.torque(t) - self.friction * xi


def towed(begin: float) -> lm.MechanicalSystem:
    t = np.linspace(begin, begin + 20.0, 21)
    torque = lm.PiecewisePolynomial.cubic(t, np.column_stack([np.sin(t), np.cos(t), 0.1 * t]))
    body = lm.RigidBody([1.0, 1.6, 2.3])
    return lm.MechanicalSystem(body, lm.NoPotential(), load=Towed(torque, 0.1))


@pytest.mark.parametrize(("begin", "given"), [(0.0, True), (990.0, False)])
def test_a_system_with_a_table_is_looked_at_when_the_table_has_values(begin: float, given: bool) -> None:
    system = towed(begin)
    start = system.state([0.9, 0.7, -0.6], np.eye(3)) if given else None
    assert lm.check_system(system, start)


@pytest.mark.slow
def test_a_load_keeps_no_bracket_and_no_method_is_blamed() -> None:
    """The motion itself is not symplectic; order and symmetry hold."""
    torque = lm.PiecewisePolynomial.constant([-1e3, 1e3], [[0.1, 0.2, 0.3]])
    system = replace(towed(0.0), load=Towed(torque, 0.1))
    start = system.state([0.9, 0.7, -0.6], np.eye(3))
    report = lm.check_method(lm.LieVerlet(), system, start, compiled=False)
    found = {f.law: f.verdict for f in report.findings}
    assert found == {"order": "holds", "symmetric": "holds", "symplectic": "not seen"}


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "length"), [(990.0, 20.0), (-30.0, 20.0), (0.0, 0.5)])
def test_claims_are_observed_while_a_table_has_values(begin: float, length: float) -> None:
    """Before, a table without a value at 0 was a bare ValueError, and a short one ended the check."""
    t = np.linspace(begin, begin + length, 21)
    torque = lm.PiecewisePolynomial.cubic(t, np.column_stack([np.sin(t), np.cos(t), 0.1 * t]))
    system = replace(towed(0.0), load=Towed(torque, 0.1))
    start = system.state([0.9, 0.7, -0.6], np.eye(3))
    report = lm.check_method(lm.LieVerlet(), system, start)
    assert report["order"].verdict == report["symmetric"].verdict == "holds"
