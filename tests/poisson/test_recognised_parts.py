"""Parts of an energy are recognised by what their formulas do at all points, not at those that somebody tried."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import copysign, cos, exp, sqrt, where
from liemech.formulas.numbers.anything import degree, indices_in, traced
from liemech.systems.parts import Affine, FunctionOfCoordinate, StraightLineFlow, recognised, second_degree

NARROW = 1e-9
"""The width of what no probe hits."""


@lm.record
class Potential(lm.Hamiltonian):
    """A spring, q^2/2, with something very narrow or far away: V(q) all the same."""

    kind: str

    def energy(self, y: lm.Vec) -> Any:
        q, p = y
        spring = 0.5 * q * q
        if self.kind == "where":
            return spring + where(abs(q - 0.7) < NARROW, p * q, 0.0)
        if self.kind == "if":
            return spring + p * q if 0.7 < q < 0.7 + NARROW else spring
        if self.kind == "max":
            return spring + p * max(0.0, q - 1e9)
        if self.kind == "abs":
            return spring + p * (abs(q - 1e9) - (1e9 - q))
        if self.kind == "sign":
            return spring + p * (1.0 + copysign(1.0, q - 1e9))
        if self.kind == "floor":
            return spring + p * (q // 1e9) * (q // -1e9)
        if self.kind == "equal":
            return spring + (p if q == 0.7 else 0.0)
        if self.kind == "loop":
            n = 0
            while q > 1e9 + n:
                n = n + 1
            return spring + n * p
        if self.kind == "NumPy's maximum":
            return spring + p * np.maximum(q - 1e9, 0.0)
        if self.kind == "NumPy's sign":
            return spring + p * (1.0 + np.copysign(1.0, q - 1e9))
        if self.kind == "NumPy's":
            return spring + 0.1 * np.cos(q) + np.log(np.sqrt(1.0 + np.square(q))) + np.exp(-np.square(q))
        return spring + self.smooth(q)

    def smooth(self, q: Any) -> Any:
        return 0.1 * cos(q) + exp(-q * q) + sqrt(1.0 + q**2) + q**4 / (2.0 + q**2.0)


def why(part: lm.Hamiltonian) -> str:
    return lm.PoissonSystem(lm.structures.Canonical(1), part).unknown_motion()


@pytest.mark.parametrize(
    "kind", ["where", "if", "max", "abs", "sign", "floor", "equal", "loop", "NumPy's maximum", "NumPy's sign"]
)
def test_what_a_formula_does_somewhere_else_is_not_missed(kind: str) -> None:
    assert "is not known: its formula need not be the same at all points (it depends on a comparison" in why(
        Potential(kind)
    )


@pytest.mark.parametrize("kind", ["smooth", "NumPy's"])
def test_smooth_formulas_are_recognised(kind: str) -> None:
    assert not why(Potential(kind))


def test_a_part_with_a_wall_says_what_it_is() -> None:
    """A ball between soft walls: half a turn of frequency 10 in the wall at 1, half a turn in that at -1."""

    @lm.record
    class Walls(lm.Hamiltonian):
        def energy(self, y: lm.Vec) -> Any:
            off = abs(y[0]) - 1.0
            return where(off > 0.0, 50.0 * off * off, 0.0)

    @lm.record
    class Kinetic(lm.Hamiltonian):
        def energy(self, y: lm.Vec) -> Any:
            return 0.5 * y[1] * y[1]

    def system(walls: lm.Hamiltonian) -> Any:
        return lm.PoissonSystem(lm.structures.Canonical(1), lm.SplitHamiltonian((Kinetic(), walls)))

    with pytest.raises(lm.errors.IncompatibleSystem, match="StraightLineFlow"):
        lm.Splitting(order=2).require(system(Walls()))
    for walls in (lm.parts.StraightLineFlow(Walls()), lm.parts.FunctionOfCoordinate(Walls(), 0)):
        ball = system(walls)
        run = lm.integrate(
            ball, lm.Splitting(order=2), ball.state([0.0, 1.0]), h=0.01, steps=400, compiled=False, progress=False
        )
        assert run.y[-1] == pytest.approx([-np.pi / 5.0, 1.0], abs=5e-3)


def test_splittings_of_nystroems_kind_need_formulas_that_are_the_same_everywhere() -> None:
    """T is of second degree at every probe and of the fourth in a narrow layer: order conditions of
    all parts are wanted.
    """

    @lm.record
    class Kinetic(lm.Hamiltonian):
        layer: float

        def energy(self, y: lm.Vec) -> Any:
            square = 0.5 * y[1] * y[1]
            return square + y[1] ** 4 if self.layer and 0.7 < y[1] < 0.7 + self.layer else square

    def quadratic(layer: float) -> bool:
        parts = lm.parts.StraightLineFlow(Kinetic(layer)), Potential("smooth")
        return lm.PoissonSystem(lm.structures.Canonical(1), lm.SplitHamiltonian(parts)).quadratic

    assert quadratic(0.0) and not quadratic(NARROW)


def test_a_separable_system_is_quadratic_at_all_momenta_or_not() -> None:
    @lm.record
    class Layered(lm.models.HenonHeiles):
        def kinetic(self, p: lm.Vec) -> Any:
            square = 0.5 * lm.dot(p, p)
            return square + p[0] ** 4 if 0.7 < p[0] < 0.7 + NARROW else square

    assert lm.models.HenonHeiles().quadratic and not Layered().quadratic


@lm.record
class Bump(lm.Hamiltonian):
    """A quadratic energy and a bump, whose every trace underflows a tenth away from it."""

    stiffness: float
    height: float
    beside: float = 0.0

    def energy(self, mu: lm.Vec) -> float:
        q, p = mu[0], mu[1]
        bump = exp(-2000.0 * ((q - 1.3) ** 2 + self.beside * (p - 0.7) ** 2))
        return 0.5 * p * p + self.stiffness * q * q + self.height * bump


@lm.record
class Spring(lm.Hamiltonian):
    """V(q) = q^2/2."""

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * mu[0] * mu[0]


def test_what_underflows_wherever_one_looks_is_seen() -> None:
    """Narrow features: an energy that looks quadratic, T(p), or of second degree at every point
    that is tried, and is not.
    """
    plane = lm.structures.Canonical(1)
    assert "not known" in str(recognised(plane, Bump(0.5, 1.0)))
    assert "not known" in str(recognised(plane, Bump(0.0, 1.0, 1.0)))
    assert not second_degree(plane, Bump(0.0, 1.0, 1.0), Spring())
    assert second_degree(plane, Bump(0.0, 0.0, 1.0), Spring())
    assert isinstance(recognised(plane, Bump(0.5, 0.0)), Affine)  # constants that are zero
    assert isinstance(recognised(plane, Bump(0.0, 0.0)), FunctionOfCoordinate | StraightLineFlow)


@lm.record
class Quartic(lm.Hamiltonian):
    """A kinetic energy of fourth degree, by products alone."""

    def energy(self, mu: lm.Vec) -> float:
        square = mu[1] * mu[1]
        return 0.5 * square + 0.25 * square * square


@lm.record
class Stiffening(lm.Hamiltonian):
    """An oscillator whose spring stiffens at the length U."""

    size: float

    def energy(self, y: lm.Vec) -> float:
        return 0.5 * y[1] * y[1] + 0.5 * y[0] * y[0] * (1.0 + (y[0] / self.size) ** 2)


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e14, 1e30])
def test_a_spring_that_stiffens_far_away_is_not_linear(size: float) -> None:
    assert isinstance(recognised(lm.structures.Canonical(1), Stiffening(size)), str)


def test_products_of_momenta_are_of_higher_degree() -> None:
    plane = lm.structures.Canonical(1)
    assert not second_degree(plane, Quartic(), Spring())
    assert isinstance(recognised(plane, Quartic()), StraightLineFlow | FunctionOfCoordinate)


@pytest.mark.parametrize(
    "formula, wanted, numbers",
    [
        (lambda x, y: x * y * x + y, 3, {0, 1}),
        (lambda x, y: (x - 2.0 * y) ** 4, 4, {0, 1}),
        (lambda x, y: x * x / 3.0 - 1.0, 2, {0}),
        (lambda x, y: 0.0 * x**5 + y, 1, {1}),
        (lambda x, y: x / (1.0 + y), np.inf, {0, 1}),
        (lambda x, y: 2.0 / x, np.inf, {0}),
        (lambda x, y: sqrt(x * x), np.inf, {0}),
        (lambda x, y: y**0.5, np.inf, {1}),
        (lambda x, y: x**-1 * x, np.inf, {0}),
        (lambda x, y: 7.0, 0, set()),
    ],
)
def test_a_formula_tells_its_degree_and_of_what_it_is_made(formula: Any, wanted: float, numbers: set[int]) -> None:
    found, reason = traced(lambda z: formula(*z), [1, 1])
    assert (degree(found), indices_in(found), reason) == (wanted, numbers, "")


def test_numbers_that_do_not_count_are_constants() -> None:
    """Of q, which stands still, any function may stand before p^2."""
    found, _ = traced(lambda z: z[1] * z[1] * exp(z[0]) / (2.0 + z[0]), [0, 1])
    assert (degree(found), indices_in(found)) == (2, {0, 1})
