"""Which forms, coordinates and charts a Poisson system is taken for, and which it is not."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, OutsideChart
from liemech.formulas import cos, exp, sin, sqrt, where

EULERS = [lm.PoissonEuler(), lm.PoissonVerlet()]


@lm.record
class Sum(lm.Hamiltonian):
    """K(u) + L(v)."""

    def energy(self, y: lm.Vec) -> float:
        return 0.5 * y[0] ** 2 + 0.25 * y[1] ** 4


@lm.record
class Far(lm.PoissonStructure):
    """b = (u - 2)^(1/2) v^2, where u > 2: not affine in u."""

    dim: ClassVar[int] = 2

    def matrix(self, y: lm.Vec) -> lm.Mat:
        b = sqrt(y[0] - 2.0) * y[1] ** 2
        return lm.mat([0.0, b], [-b, 0.0])


@lm.record
class Nowhere(lm.PoissonStructure):
    """Its b has values for u < -10^40 only."""

    dim: ClassVar[int] = 2

    def matrix(self, y: lm.Vec) -> lm.Mat:
        b = sqrt(-1e40 - y[0])
        return lm.mat([0.0, b], [-b, 0.0])


@lm.record
class Symmetric(lm.PoissonStructure):
    dim: ClassVar[int] = 2

    def matrix(self, y: lm.Vec) -> lm.Mat:
        return lm.mat([0.0, 1.0], [1.0, 0.0])


@lm.record
class Strip(lm.PoissonStructure):
    """Not affine in a strip where nobody would look: b = 1, and u^2 v^2 there."""

    dim: ClassVar[int] = 2

    def matrix(self, y: lm.Vec) -> lm.Mat:
        b = where(abs(y[0] - 7.77) < 1e-3, (y[0] * y[1]) ** 2, 1.0)
        return lm.mat([0.0, b], [-b, 0.0])


@pytest.mark.parametrize("method", EULERS)
@pytest.mark.parametrize(
    ("structure", "why"),
    [
        (Far(), "not affine in u"),
        (Strip(), "need not be affine everywhere"),
        (Nowhere(), "no value at any"),
        (Symmetric(), "skew"),
    ],
    ids=["far", "strip", "nowhere", "symmetric"],
)
def test_euler_steps_need_a_form_that_was_seen(method: Any, structure: Any, why: str) -> None:
    with pytest.raises(IncompatibleSystem, match=why):
        method.require(lm.PoissonSystem(structure, Sum()))


@lm.record
class Wide(lm.PoissonStructure):
    """b = 1 + (u/U)^2, or one that is affine though its formula does not look so."""

    dim: ClassVar[int] = 2
    size: float
    kind: str

    def matrix(self, y: lm.Vec) -> lm.Mat:
        u, v = y[0] / self.size, y[1]
        if self.kind == "square":
            b = 1.0 + u * u
        elif self.kind == "root":
            b = sqrt(1.0 + u * u)
        elif self.kind == "exponential":
            b = exp(u)
        else:
            b = (u + v) * (u + v) - u * u - v * v
        return lm.mat([0.0, b], [-b, 0.0])


@pytest.mark.parametrize("method", EULERS)
@pytest.mark.parametrize("size", [1e-25, 1e-7, 1.0, 1e7, 1e25])
@pytest.mark.parametrize("kind", ["square", "root", "exponential", "product"])
def test_affine_is_told_in_any_units(method: Any, size: float, kind: str) -> None:
    """A field that bends over U = 10^7 m is not affine; with u in units of U that is plain."""
    system = lm.PoissonSystem(Wide(size, kind), Sum())
    if kind == "product":
        method.require(system)
        return
    with pytest.raises(IncompatibleSystem, match="not affine in u"):
        method.require(system)


@lm.record
class Coupled(lm.Hamiltonian):
    """u^2 + v^2 + (u/U) v^2."""

    size: float

    def energy(self, y: lm.Vec) -> float:
        return y[0] * y[0] + y[1] * y[1] * (1.0 + y[0] / self.size)


@pytest.mark.parametrize("size", [1e-25, 1e-7, 1.0, 1e7, 1e25])
def test_a_coupling_is_seen_in_any_units(size: float) -> None:
    with pytest.raises(IncompatibleSystem, match="needs an energy K"):
        lm.PoissonEuler().require(lm.PoissonSystem(lm.structures.Canonical(1), Coupled(size)))


def test_casimirs_in_mixed_units() -> None:
    """The rank does not depend on the units of the coordinates."""
    rng = np.random.default_rng(4)
    X = rng.normal(size=(6, 4))
    B = X @ np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(2)) @ X.T
    B = B - B.T
    for units in (np.ones(6), 2.0 ** np.array([-100.0, 67.0, 0.0, -40.0, 17.0, 30.0])):
        there = units[:, None] * B * units
        structure = lm.structures.ConstantStructure(there)
        assert structure.rank == 4
        for k in np.array(structure.kernel):
            assert np.abs(there @ k).max() <= 1e-12 * (np.abs(there) @ np.abs(k)).max()
    tiny = np.zeros((4, 4))
    tiny[0, 1], tiny[1, 0], tiny[2, 3], tiny[3, 2] = 1e-20, -1e-20, 1.0, -1.0
    assert lm.structures.ConstantStructure(tiny).rank == 4


def test_andoyer_has_no_coordinates_on_the_third_axis() -> None:
    with pytest.raises(OutsideChart, match="third axis"):
        lm.charts.Andoyer().coordinates(lm.vec(0.0, 0.0, 2.0))


@lm.record
class Short(lm.charts.LocalChart):
    """Forgets one momentum."""

    dim: ClassVar[int] = 2

    def embedding(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(sin(y[0]), -cos(y[0]), y[1])


@lm.record
class Shorter(Short):
    """Forgets the third axis."""

    def embedding(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(sin(y[0]), -cos(y[0]), y[1], y[1])


@pytest.mark.parametrize("chart", [Short(), Shorter()])
def test_embeddings_of_the_wrong_length(chart: Any) -> None:
    with pytest.raises(InvalidInput, match="3 positions and 3 momenta"):
        lm.charts.in_coordinates(lm.SphericalPendulum(), chart)


@lm.record
class Wall(lm.Hamiltonian):
    """A spring, or a free particle, or V(q), with a soft wall at q = place."""

    kind: str
    place: float

    def energy(self, y: lm.Vec) -> float:
        off = y[0] - self.place
        wall = where(off > 0.0, 100.0 * off**4, 0.0)
        if self.kind == "spring":
            return 0.5 * (y[0] ** 2 + y[1] ** 2) + wall
        return 0.5 * y[1] ** 2 + wall


@lm.record
class Light(lm.Hamiltonian):
    """A light particle in a quartic well."""

    mass: float

    def energy(self, y: lm.Vec) -> float:
        return y[1] ** 2 / (2.0 * self.mass) + 0.25 * y[0] ** 4


@lm.record
class LightSpring(Light):
    """A light particle on a spring: an affine motion in any units."""

    def energy(self, y: lm.Vec) -> float:
        return y[1] ** 2 / (2.0 * self.mass) + 0.5 * y[0] ** 2


@pytest.mark.parametrize(
    "energy",
    [Wall("spring", 2.0), Wall("free", 2.0), Wall("spring", 50.0), Wall("free", 500.0), Light(1e-15), Light(1e15)],
    ids=repr,
)
def test_motions_are_not_recognised_by_a_look_at_one_place(energy: Any) -> None:
    assert "is not known" in lm.PoissonSystem(lm.structures.Canonical(1), energy).unknown_motion()


@pytest.mark.parametrize("mass", [1e-15, 1.0, 1e15])
def test_springs_are_recognised_in_any_units(mass: float) -> None:
    system = lm.PoissonSystem(lm.structures.Canonical(1), LightSpring(mass))
    assert not system.unknown_motion()
    h = 0.4 * np.sqrt(mass)
    run = lm.integrate(
        system, lm.Splitting(order=2), system.state([1.0, 0.0]), h=h, steps=1, compiled=False, progress=False
    )
    assert np.allclose(run.y[-1], [np.cos(0.4), -np.sqrt(mass) * np.sin(0.4)], rtol=1e-12)
