"""Bodies that cannot be: refused where they are made, with the number that is wrong."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import sqrt

SO3, SE3 = lm.SO3(), lm.SE3()
J = np.array([[2.0, 0.3, -0.1], [0.3, 2.5, 0.2], [-0.1, 0.2, 3.0]])


@lm.record
class Own(lm.Hamiltonian):
    """mu . mu/(2 J) with a gradient that is right, wrong, or of another length."""

    inertia: lm.Vec
    slip: float = 0.0

    def energy(self, mu):  # type: ignore[no-untyped-def]
        return 0.5 * lm.dot(mu, mu / self.inertia)

    def gradient(self, mu):  # type: ignore[no-untyped-def]
        return (1.0 + self.slip) * mu / self.inertia


@lm.record
class SixComponents(lm.Hamiltonian):
    def energy(self, mu):  # type: ignore[no-untyped-def]
        return mu[0] * mu[5]


@lm.record
class Root(lm.Hamiltonian):
    """Defined for mu_3 > 7 only."""

    def energy(self, mu):  # type: ignore[no-untyped-def]
        return sqrt(mu[2] - 7.0) + mu[0] * mu[1]

    def gradient(self, mu):  # type: ignore[no-untyped-def]
        return lm.vec(mu[1], mu[0], 0.5 / sqrt(mu[2] - 7.0))


@lm.record
class Relativistic(lm.Lagrangian):
    """l = -m sqrt(1 - |xi|^2), of which H = sqrt(m^2 + |mu|^2) is the Legendre transform."""

    mass: float

    def value(self, xi):  # type: ignore[no-untyped-def]
        return -self.mass * sqrt(1.0 - lm.dot(xi, xi))


@lm.record
class Fast(lm.Hamiltonian):
    mass: float

    def energy(self, mu):  # type: ignore[no-untyped-def]
        return sqrt(self.mass**2 + lm.dot(mu, mu))


@pytest.mark.parametrize(
    "inertia, words",
    [
        (J + np.array([[0, 1e-6, 0], [0, 0, 0], [0, 0, 0]]), r"not symmetric: \[0, 1\] is 0.300001, \[1, 0\] is 0.3"),
        (np.diag([1.0, 0.0, 2.0]), "singular up to rounding"),
        (np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), "singular up to rounding"),
        (np.zeros((3, 3)), "singular up to rounding"),
        ([1.0, 0.0, 2.0], r"inertia\[1\] is 0; a moment without a finite inverse"),
        ([1.0, 1e-310, 2.0], "without a finite inverse"),
        ([1.0, np.nan, 2.0], "every entry must be finite"),
        (np.ones((2, 3)), "square matrix"),
    ],
)
def test_inertia(inertia: np.ndarray, words: str) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=words):
        lm.KineticEnergy(inertia)


def test_inertia_in_any_units_and_with_any_sign() -> None:
    """Neither kg m^2 beside kg nor an indefinite form is a mistake; nor is the rounding of R J R^T."""
    units = np.repeat([1e-9, 1e6], 3)
    whole = np.block([[J, 0.1 * J], [0.1 * J.T, J]])
    energy = lm.KineticEnergy(units[:, None] * whole * units)
    assert np.array(energy.momentum(energy.gradient(units * 0.3))) == pytest.approx(units * 0.3, rel=1e-12)
    lm.KineticEnergy([[0.0, 1.0], [1.0, 0.0]])
    lm.KineticEnergy([1.0, -2.0, 1.0])
    R = SO3.random(1)
    lm.KineticEnergy(R @ np.diag([1.0, 2.0, 3.0]) @ R.T)
    with pytest.raises(lm.errors.InvalidInput, match="not symmetric"):
        lm.KineticEnergy(units[:, None] * (whole + np.diag([1e-3] * 3, 3)) * units)


@pytest.mark.parametrize("lagrangian", [lm.KineticEnergy([1.0, 2.0, 3.0001]), lm.KineticEnergy(J)])
def test_lagrangian_of_another_body(lagrangian: lm.Lagrangian) -> None:
    with pytest.raises(lm.errors.InvalidInput, match="the Lagrangian is that of another body"):
        lm.LiePoissonSystem(SO3, lm.KineticEnergy([1.0, 2.0, 3.0]), lagrangian)


def test_lagrangians_of_the_same_body() -> None:
    lm.LiePoissonSystem(SO3, Own([1.0, 2.0, 3.0]), lm.KineticEnergy([1.0, 2.0, 3.0]))
    lm.LiePoissonSystem(SO3, Fast(2.0), Relativistic(2.0))
    with pytest.raises(lm.errors.InvalidInput, match="the Lagrangian is that of another body"):
        lm.LiePoissonSystem(SO3, Fast(2.0), Relativistic(2.1))


@lm.record
class Heavy(lm.Hamiltonian):
    """A body whose mass is small beside its moments of inertia, in one unit and in the other."""

    slip: float

    def energy(self, mu: lm.Vec) -> float:
        turning = mu[0] ** 2 + mu[1] ** 2 + mu[2] ** 2
        return 0.5e9 * turning + 0.5 * (mu[3] ** 2 + mu[4] ** 2 + mu[5] ** 2)

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        s = self.slip
        return lm.vec(1e9 * mu[0], 1e9 * mu[1], 1e9 * mu[2], s * mu[3], s * mu[4], s * mu[5])


def test_a_gradient_that_is_wrong_in_one_unit() -> None:
    """A velocity is as wrong beside an angular velocity of 1e9 as alone."""
    lm.LiePoissonSystem(SE3, Heavy(1.0))
    for slip in (1.001, -1.0):
        with pytest.raises(lm.errors.InvalidInput, match="is not the gradient of its energy"):
            lm.LiePoissonSystem(SE3, Heavy(slip))


def test_gradient_that_is_none() -> None:
    lm.LiePoissonSystem(SO3, Own([1.0, 2.0, 3.0]))
    for slip in (1e-4, -2.0):
        with pytest.raises(lm.errors.InvalidInput, match=r"Own\.gradient is not the gradient of its energy"):
            lm.LiePoissonSystem(SO3, Own([1.0, 2.0, 3.0], slip))


@pytest.mark.parametrize(
    "group, hamiltonian",
    [
        (SO3, lm.KineticEnergy([1.0, 2.0])),
        (SE3, lm.KineticEnergy([1.0, 2.0, 3.0])),
        (SO3, SixComponents()),
        (SE3, Own([1.0, 2.0, 3.0])),
    ],
)
def test_wrong_dimensions(group: lm.LieGroup, hamiltonian: lm.Hamiltonian) -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"LiePoissonSystem: .*(components|dimension)"):
        lm.LiePoissonSystem(group, hamiltonian)
    with pytest.raises(lm.errors.InvalidInput, match=r"LiePoissonSystem: .*components"):
        lm.LiePoissonSystem(SO3, lm.KineticEnergy([1.0, 2.0, 3.0]), lm.KineticEnergy([1.0, 2.0]))


@lm.record
class Doubled(lm.LiePoissonSystem):
    """A velocity that is not the derivative of its energy."""

    def velocity(self, mu):  # type: ignore[misc, no-untyped-def]
        return 2.0 * self.hamiltonian.gradient(mu)


def test_what_follows_from_the_rest_is_not_replaced() -> None:
    """Half of the methods would go by the one, half by the other."""
    with pytest.raises(lm.errors.InvalidType, match=r"Doubled replaces LiePoissonSystem.velocity"):
        Doubled(SO3, lm.KineticEnergy([1.0, 2.0, 3.0]))


@lm.record
class Turning(lm.LinearGroupEquation):
    """A velocity under the name of what follows from it, and with fewer arguments."""

    def velocity(self, t):  # type: ignore[misc, no-untyped-def, override]
        return lm.vec(t, 0.0, 1.0)


def test_a_replaced_method_is_not_asked_for_other_arguments() -> None:
    """It was to take (t, g), and was refused then."""
    with pytest.raises(lm.errors.InvalidType, match=r"Turning replaces LinearGroupEquation.velocity"):
        Turning(SO3)


def test_formulas_without_a_value_are_not_judged() -> None:
    body = lm.LiePoissonSystem(SO3, Root())
    assert body.velocity([1.0, 2.0, 8.0]) == pytest.approx([2.0, 1.0, 0.5], rel=1e-15)


@pytest.mark.parametrize("unit", [1e-150, 1e-3, 1.0, 1e150])
def test_an_indefinite_inertia_with_a_zero_on_its_diagonal(unit: float) -> None:
    assert lm.KineticEnergy(unit * np.array([[1.0, 0.1], [0.1, 0.0]]))
    with pytest.raises(lm.errors.InvalidInput, match="singular"):
        lm.KineticEnergy(unit * np.array([[1.0, 0.0], [0.0, 0.0]]))
