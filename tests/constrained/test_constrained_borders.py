"""Where constrained systems end: masses that are none, folds, methods reduced twice, joints that shear, lost energies."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InconsistentState, InvalidInput, InvalidType, NoConvergence
from liemech.formulas import record, vec


@record
class Heavy(lm.ConstrainedLagrangianSystem):
    """Two coordinates on a line, with masses to be given."""

    degrees: ClassVar[int] = 2

    masses: lm.Mat

    def mass(self, q: lm.Vec) -> lm.Mat:
        return self.masses

    def potential(self, q: lm.Vec) -> float:
        return q[0] * q[0]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(q[0] - q[1])


@pytest.mark.parametrize(
    ("masses", "message"),
    [
        ([[2.0, 0.7], [0.0, 1.0]], r"not symmetric: entry \[0, 1\] is 0.7, but \[1, 0\] is 0 "),
        ([[2.0, 0.0], [0.0, -1.0]], r"not positive: entry \[1, 1\] is -1 "),
        ([[1.0, 2.0], [2.0, 1.0]], r"not positive: .* eigenvalue -1 .*\[0, 0\], \[1, 1\]"),
        ([[1e12, 2.0], [2.0, 1e-12]], r"not positive"),
    ],
)
def test_masses_are_symmetric_and_positive(masses: list[list[float]], message: str) -> None:
    system = Heavy(masses)
    for start in (system.state, system.consistent):
        with pytest.raises(InvalidInput, match=message):
            start([1.0, 1.0], [0.0, 0.0])
        with pytest.raises(InvalidInput, match=message):
            start([[1.0, 1.0], [2.0, 2.0]], [0.0, 0.0])
    Heavy([[1e12, 0.5], [0.5, 1e-12]]).state([1.0, 1.0], [0.0, 0.0])


def test_a_step_to_the_fold_is_refused() -> None:
    """With |p| h = l the free mass flies along the tangent to where g(q + x G) = 0 has its double
    root: there no digit is safe.
    """
    ball = lm.SphericalPendulum(gravity=0.0)
    start = ball.state([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    with pytest.raises((NoConvergence, InconsistentState)):
        lm.integrate(ball, lm.RATTLE(), start, h=1.0, steps=1, compiled=False)
    for h in (0.5, 0.9, 0.99, 0.9999):
        done = lm.integrate(ball, lm.RATTLE(), start, h=h, steps=1, compiled=False)
        assert abs(np.linalg.norm(done.q[-1]) - 1.0) < 1e-12
        assert done.q[-1, 1] == pytest.approx(h)


@record
class OnATable(lm.SeparableConstrainedSystem):
    """A mass that rests on a plane through the origin."""

    degrees: ClassVar[int] = 2

    def kinetic(self, p: lm.Vec) -> float:
        return lm.dot(p, p) / 1.4

    def potential(self, q: lm.Vec) -> float:
        return 9.81 * q[0] + 0.3 * q[1] * q[1]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(q[0])


def test_rest_at_the_origin_is_no_fold() -> None:
    """There all that g(q) could be compared with is zero."""
    table = OnATable()
    run = lm.integrate(table, lm.RATTLE(), table.state([0.0, 0.0], [0.0, 0.0]), h=0.1, steps=50, compiled=False)
    assert np.abs(run.q).max() < 1e-14


def test_only_methods_for_any_equation_are_reduced() -> None:
    for method in (lm.RATTLE(), lm.LobattoPair(4), lm.ConstrainedEuler(), lm.Composition(lm.RATTLE())):
        with pytest.raises(InvalidInput, match="keeps the constraints"):
            lm.IndexReduction(method)
    with pytest.raises(InvalidType, match="project must be True or False; got 'no'"):
        lm.IndexReduction(lm.RKMK(order=4), project="no")  # type: ignore[arg-type]


def test_a_slider_is_mounted_by_a_rotation() -> None:
    for attitude in (np.diag([1.0, 1.0, 2.0]), np.diag([1.0, 1.0, -1.0]), np.eye(2)):
        with pytest.raises(InvalidInput, match="attitude must be a rotation"):
            lm.joints.PrismaticJoint(0, 1, attitude=attitude)
    lm.joints.PrismaticJoint(0, 1, attitude=lm.SO3().exp([0.4, -1.0, 0.3]))


@record
class Free(Heavy):
    """No constraint at all."""

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec()


def test_there_is_at_least_one_constraint() -> None:
    with pytest.raises(InvalidInput, match="at least one constraint"):
        Free(np.eye(2)).state([1.0, 1.0], [0.0, 0.0])


def test_a_chain_has_a_list_of_masses() -> None:
    for wrong in ({"masses": 0}, {"lengths": 1.0}):
        with pytest.raises(InvalidInput, match="must be a list"):
            lm.models.ChainPendulum(**wrong)


def test_an_exploded_energy_is_lost() -> None:
    galaxy = lm.models.HenonHeiles()
    start = galaxy.state(q=[0.0, 0.1], p=[0.49, 0.0])
    with pytest.raises(lm.errors.IntegrationFailure) as failure:
        lm.integrate(galaxy, lm.Splitting(order=4), start, h=3.0, steps=20, compiled=False)
    kept = failure.value.trajectory.drift()["energy"]
    assert kept.largest > 1e3 and kept.verdict == "lost"
    calm = lm.integrate(galaxy, lm.Splitting(order=4), start, h=0.1, steps=200, compiled=False)
    assert calm.drift()["energy"].verdict == "bounded"
