"""`check_system`: every shipped system obeys its laws, and each of many slips is found and called
by its name.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest
from scenes import (
    Driven,
    Oscillator,
    Relativistic,
    SteeredFromSpace,
    asymmetric_body,
    falling_body,
    heavy_top,
    kirchhoff_body,
    lagrange_top,
    orbiting_body,
)

import liemech as lm
from liemech import errors
from liemech.checks import check_system
from liemech.formulas import log, vec

J = lm.vec(1.0, 1.6, 2.3)
BODY = lm.RigidBody([1.0, 1.6, 2.3])


# ---------------------------------------------------------------- what is right passes


@lm.record
class Friction(lm.Force):
    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return -0.1 * (1.0 + t * t) * xi


SHIPPED = (
    *(asymmetric_body()[0], lm.RigidBody([[2.0, 0.1, 0.2], [0.1, 2.2, 0.3], [0.2, 0.3, 2.5]]), kirchhoff_body()[0]),
    *(
        heavy_top()[0],
        heavy_top()[0].reduced,
        heavy_top(Friction())[0],
        lagrange_top()[0],
        falling_body()[0],
        orbiting_body()[0],
    ),
    *(
        lm.models.Pendulum(),
        lm.models.DoublePendulum(),
        lm.models.HenonHeiles(),
        lm.Kepler(),
        Relativistic(),
        Driven(lm.SO3()),
        SteeredFromSpace(lm.SO3()),
    ),
    *(
        lm.LiePoissonSystem(group, lm.KineticEnergy(1.0 + np.arange(group.dim)))
        for group in (lm.SO(4), lm.UnitQuaternions())
    ),
)


@pytest.mark.slow
@pytest.mark.parametrize("system", SHIPPED, ids=lambda system: type(system).__name__)
def test_shipped_systems_obey_their_laws(system: lm.System) -> None:
    """By a wide margin: the bounds are for slips, not for rounding."""
    report = check_system(system)
    assert report
    assert all(finding.defect <= finding.bound / 64 for finding in report.held), report


@pytest.mark.slow
def test_formulas_that_are_left_out_follow() -> None:
    report = check_system(Relativistic())
    assert report["force of energy"].verdict == report["velocity of energy"].verdict == "follows"
    assert check_system(heavy_top()[0])["load"].verdict == "not there"
    assert check_system(heavy_top(Friction())[0])["load"].verdict == "holds"


@pytest.mark.compiled
def test_native_code_is_compared_on_request() -> None:
    assert check_system(lm.models.HenonHeiles(), native=True)["native code"].verdict == "holds"


# ---------------------------------------------------------------- slips


@lm.record
class Gyrostat(lm.Hamiltonian):
    inertia: lm.Vec
    rotor: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu - self.rotor, (mu - self.rotor) / self.inertia)

    def gradient(self, mu: lm.Vec) -> lm.Vec:  # right where systems look when they are made
        return (mu - self.rotor if mu[0] > 0.0 else mu + self.rotor) / self.inertia


@lm.record
class Twice(lm.KineticEnergy):
    """l = xi . J xi/2, but its momentum is 2 J xi, where systems do not look when they are made."""

    def momentum(self, xi: lm.Vec) -> lm.Vec:
        return (1.0 if xi[0] > 0.0 else 2.0) * self.inertia * xi

    def value(self, xi: lm.Vec) -> float:
        return 0.5 * lm.dot(xi, self.inertia * xi)


@lm.record
class Weight(lm.Potential):
    moment: lm.Vec

    def energy(self, g: Any) -> float:
        return lm.dot(g[2], self.moment)

    def force(self, group: lm.LieGroup, g: Any) -> lm.Vec:
        return lm.cross(self.moment, g[2])


@lm.record
class Sideways(lm.Potential):
    moment: lm.Vec

    def energy(self, g: Any) -> float:
        return lm.dot(g[2], self.moment)

    def symmetry(self, group: lm.LieGroup, mu: Any, g: Any) -> dict[str, Any]:
        return {"momentum about x": group.K(g, mu)[..., 0]}


@lm.record
class Short(lm.Force):
    def covector(self, t: float, xi: lm.Vec, g: Any) -> lm.Vec:
        return vec(xi[0], xi[1])


@lm.record
class Skewed(lm.models.HenonHeiles):
    def force(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
        x, y = q
        return -vec(x + 2.0 * x * y, y + x * x + y * y)


@lm.record
class Dragged(lm.models.HenonHeiles):
    """Its force knows the momentum, though the system is separable."""

    def force(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
        return super().force(q, p) - 1e-6 * p


@lm.record
class Insistent(Relativistic):
    quadratic: ClassVar[bool] = True  # type: ignore[assignment]


@lm.record
class Forgetful(Oscillator):
    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {"p": states["p"]}


@lm.record
class WrongCasimir(lm.SO3):
    def casimirs(self, mu: lm.Vec) -> lm.Vec:
        return vec(mu[0] * mu[0] + mu[1] * mu[1] - mu[2] * mu[2])


WEIGHT = lm.vec(0.1, 0.2, 0.3)
SLIPS: dict[str, tuple[Any, str, str]] = {
    "gradient": (lm.LiePoissonSystem(lm.SO3(), Gyrostat(J, vec(0.1, 0.2, 0.7))), "gradient", ""),
    "another body": (lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy(J), Twice(J)), "momentum", "a factor 2 too many"),
    "sign of a force": (lm.MechanicalSystem(BODY, Weight(WEIGHT)), "force", "a wrong sign"),
    "no symmetry": (lm.MechanicalSystem(BODY, Sideways(WEIGHT)), "constants", ""),
    "a term of a force": (Skewed(), "force of energy", ""),
    "a force of both": (Dragged(), "force of energy", ""),
    "not quadratic": (Insistent(), "quadratic kinetic energy", ""),
    "no constant": (Forgetful(2.0), "constants", ""),
    "a Casimir": (lm.LiePoissonSystem(WrongCasimir(), lm.KineticEnergy(J)), "Casimirs", ""),
    "a short load": (lm.MechanicalSystem(BODY, Sideways(WEIGHT), load=Short()), "velocity", "3 components"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_is_found(name: str) -> None:
    system, law, hint = SLIPS[name]
    with pytest.raises(lm.errors.LawViolation, match=f"breaks the law of {law}:") as found:
        check_system(system)
    assert hint in str(found.value)
    assert check_system(system, raises=False).broken[0].law == law


def test_a_lagrangian_of_another_body_is_found() -> None:
    class Apart(lm.LiePoissonSystem):
        """Made around what the constructor may refuse."""

        def __post_init__(self) -> None:
            pass

    system = lm.record(Apart)(lm.SO3(), lm.KineticEnergy(J), lm.KineticEnergy(vec(1.0, 1.6, 2.4)))
    assert check_system(system, raises=False)["Legendre transform"].verdict == "broken"


def test_formulas_that_do_not_bear_derivative_numbers_are_compared_with_differences() -> None:
    import math

    class Stubborn(Oscillator):
        def potential(self, q: lm.Vec) -> float:
            return math.cosh(float(q[0]))

        def force(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
            return vec(-math.sinh(float(q[0])))

    class Wrong(Stubborn):
        def force(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
            return vec(-1.000001 * math.sinh(float(q[0])))

    assert check_system(lm.record(Stubborn)(1.0))["force of energy"].verdict == "holds"
    assert check_system(lm.record(Wrong)(1.0), raises=False)["force of energy"].verdict == "broken"


# ---------------------------------------------------------------- where it looks


@lm.record
class HalfPlane(lm.SeparableSystem):
    """Defined on one side only."""

    degrees: ClassVar[int] = 2
    edge: float

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * (p @ p)

    def potential(self, q: lm.Vec) -> float:
        return q[1] * q[1] - log(q[0] - self.edge)

    def force(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
        return vec(1.0 / (q[0] - self.edge), -2.0 * q[1])


def test_random_states_are_where_the_formulas_are_defined() -> None:
    assert check_system(HalfPlane(0.0))
    far = HalfPlane(100.0)
    with pytest.raises(lm.errors.InvalidInput, match=r"not defined at random states \(.*\); give some, states="):
        check_system(far)
    report = check_system(far, far.state([[101.0, 2.0], [103.0, -1.0]], [0.1, 0.2]))
    assert "state " in report["force of energy"].where


@pytest.mark.parametrize(
    ("arguments", "words"), [((lm.RigidBody,), r"must be a System.*write RigidBody\(\.\.\.\)"), ((BODY, 3), "a State")]
)
def test_what_cannot_be_checked_is_said(arguments: tuple[Any, ...], words: str) -> None:
    with pytest.raises(lm.errors.InvalidType, match=words):
        check_system(*arguments)


def test_a_total_momentum_of_zero_is_a_constant_like_any_other():
    """Its terms are those of the bodies: the rounding of their sum is none of a number that is zero."""
    bodies = lm.models.NBody([1.0, 2.0, 3.0])
    q = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.3, -0.7, 0.2]
    p = [0.3, 0.2, 0.1, -0.1, 0.5, 0.2, -0.2, -0.7, -0.3]
    assert lm.check_system(bodies, states=bodies.state(q, p))
    assert lm.check_system(bodies, states=bodies.state(q, np.zeros(9)))

    class Leaking(lm.models.NBody):
        def momentum(self, p):
            return super().momentum(p) + 1e-6 * p[0]

    with pytest.raises(errors.LawViolation, match="constants"):
        lm.check_system(Leaking([1.0, 2.0, 3.0]), states=bodies.state(q, p))
