"""Claims of methods on driven systems: brackets are observed there too, on momenta, on groups and
in R^2n.
"""

from __future__ import annotations

from typing import Any, ClassVar

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
    found: Any = {
        f.law: f.verdict for f in lm.check_method(method, system, start, compiled=False).findings
    }
    assert laws <= set(found)
    assert found["Poisson" if name == "body" else "symplectic"] == "holds"


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", CASES)
def test_a_wrong_bracket_is_found_on_driven_systems(name: str) -> None:
    system, start, _, _ = CASES[name]
    report = lm.check_method(Boasting(order=4), system, start, compiled=False, raises=False)
    assert report["Poisson" if name == "body" else "symplectic"].verdict == "broken"
    assert report["order"].verdict == "holds"
