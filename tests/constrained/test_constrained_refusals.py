"""Steps and starts that cannot be: which of the reasons is told."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from constrained_scenes import PENDULUM, plain

import liemech as lm
from liemech.errors import InconsistentState, InvalidInput, NoConvergence
from liemech.formulas import dot, record, vec


@record
class Gliding(lm.SeparableConstrainedSystem):
    """A particle of unit mass under unit gravity; a subclass says on what."""

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * dot(p, p)

    def potential(self, q: lm.Vec) -> float:
        return q[-1]


@record
class Cone(Gliding):
    """x^2 + y^2 = z^2: its derivative is zero at the apex."""

    degrees: ClassVar[int] = 3

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(0.5 * (q[0] ** 2 + q[1] ** 2 - q[2] ** 2))


@record
class Corner(Gliding):
    """y = |x|."""

    degrees: ClassVar[int] = 2

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(q[1] - abs(q[0]))


METHODS = [lm.RATTLE(), lm.ConstrainedEuler()]


@pytest.mark.parametrize("h", [0.04, 0.05])
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_one_constraint_whose_derivative_vanishes_on_the_way(method: lm.Method, h: float) -> None:
    """Down the line x = z, z = 1/16 - t^2/4: it is at the apex at t = 1/2, between two steps or after one."""
    start = Cone().state([0.0625, 0.0, 0.0625], [0.0, 0.0, 0.0])
    with pytest.raises(InconsistentState, match=r"nearly dependent at q = .*a dead point") as stopped:
        plain(Cone(), method, start, h, 40)
    run = stopped.value.trajectory
    assert 0.4 < run.t[-1] <= 0.5
    assert run.q[-1, 2] > -1e-4


@pytest.mark.parametrize("x", [-0.02, -0.024])
def test_a_corner_is_called_a_kink(x: float) -> None:
    """Also where a step meets it exactly and Newton's method would divide by zero."""
    for method in METHODS:
        with pytest.raises(NoConvergence, match=r"jumps at q = .*kink"):
            plain(Corner(), method, Corner().state([x, -x], [0.1, -0.1]), 0.02, 20)


def test_too_large_a_step_is_neither() -> None:
    fast = PENDULUM.state([0.0, 0.0, -1.0], [3.0, 0.0, 0.0])
    for h in (0.3, 0.5, 1.0, 10.0):
        with pytest.raises(NoConvergence, match=r"step h = .* is too large"):
            plain(PENDULUM, lm.RATTLE(), fast, h, 20)
    chain = lm.models.ChainPendulum([1.0, 1.0], [1.0, 1.0])
    hung = chain.consistent([1.0, 0.0, 0.0, 1.0, 0.0, -1.0], [0.0, 2.0, 0.0, 1.0, 0.0, 0.0])
    with pytest.raises(NoConvergence, match=r"step h = .* is too large"):
        plain(chain, lm.RATTLE(), hung, 0.8, 20)


@record
class HeavyCorner(Corner):
    """The same motion of any mass: energies and momenta in proportion."""

    mass: float = 1.0

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * dot(p, p) / self.mass

    def potential(self, q: lm.Vec) -> float:
        return self.mass * q[-1]


@pytest.mark.parametrize("mass", [1e-8, 1.0, 1e8])
def test_a_kink_does_not_depend_on_the_unit_of_mass(mass: float) -> None:
    corner = HeavyCorner(mass=mass)
    start = corner.state([-1.0, 1.0], [0.0, 0.0])
    with pytest.raises(NoConvergence, match=r"jumps at q = .*kink"):
        plain(corner, lm.RATTLE(), start, 0.07, 100)


@pytest.mark.parametrize(
    ("radius", "told"), [(1.0, "redundant"), (2.0, r"contradict each other: constraint\[1\] is 1.5")]
)
def test_redundant_and_contradictory_constraints_differ(radius: float, told: str) -> None:
    """Two spheres about one centre: twice the same, or of different size."""

    @record
    class Spheres(Gliding):
        degrees: ClassVar[int] = 3
        radius: float

        def constraint(self, q: lm.Vec) -> lm.Vec:
            return vec(0.5 * (dot(q, q) - 1.0), 0.5 * (self.radius**2 - dot(q, q)))

    system = Spheres(radius)
    for make in (system.state, system.consistent):
        with pytest.raises(InvalidInput, match=rf"rank 1 of 2.*constraint\[0\].*{told}"):
            make([1.0, 0.0, 0.0], np.zeros(3))
