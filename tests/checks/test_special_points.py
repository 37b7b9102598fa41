"""`check_system` looks where formulas branch: a derivative that is right almost everywhere is found."""

from __future__ import annotations

from typing import Any

import pytest

import liemech as lm
from liemech.checks import check_system
from liemech.formulas import cos, expm1, norm, sin, sinc, sqrt, stumpff

LAW = "derivatives at special points"


@lm.record
class Particle(lm.SeparableSystem):
    """A particle in a potential."""

    degrees: int = 1

    def kinetic(self, p: Any) -> Any:
        return 0.5 * lm.dot(p, p)


class Exact(Particle):
    def potential(self, q: Any) -> Any:
        return expm1(q[0]) / q[0] if q[0] != 0.0 else 1.0


class Threshold(Particle):
    def potential(self, q: Any) -> Any:
        return expm1(q[0]) / q[0] if abs(q[0]) > 1e-8 else 1.0


class Even(Particle):
    """The force is right at rest, its derivative is not."""

    def potential(self, q: Any) -> Any:
        return -(sin(q[0]) / q[0] if abs(q[0]) > 1e-8 else 1.0)


class Diagonal(Particle):
    """A formula with a case of its own for equal components."""

    def potential(self, q: Any) -> Any:
        apart = q[0] - q[1]
        return sin(apart) / apart + apart if apart > 1e-9 or apart < -1e-9 else 1.0


class OnAnAxis(Particle):
    def potential(self, q: Any) -> Any:
        return q[0] * (1.0 + q[1]) if abs(q[1]) > 1e-9 else q[0]


@pytest.mark.parametrize(
    "system", [Exact(), Threshold(), Even(), Diagonal(2), OnAnAxis(2)], ids=lambda s: type(s).__name__
)
def test_branches_for_a_point_are_found(system: Any) -> None:
    with pytest.raises(lm.errors.LawViolation, match=LAW):
        check_system(system)


class Smooth(Particle):
    def potential(self, q: Any) -> Any:
        return -sinc(q[0]) + stumpff(1, lm.dot(q, q))


class Kinked(Particle):
    """It has no derivative where it has a kink, and none is asked for."""

    def potential(self, q: Any) -> Any:
        return abs(q[0]) + max(q[0], 0.0)


class Cone(Particle):
    def potential(self, q: Any) -> Any:
        return norm(q) + sqrt(lm.dot(q, q))


class Singular(Particle):
    def potential(self, q: Any) -> Any:
        return 1.0 / lm.dot(q, q) + cos(q[0])


@pytest.mark.parametrize("system", [Smooth(2), Kinked(1), Cone(2), Singular(2)], ids=lambda s: type(s).__name__)
def test_what_is_smooth_or_has_no_derivative_there_passes(system: Any) -> None:
    report = check_system(system)
    assert any(finding.law == LAW and finding.verdict == "holds" for finding in report.findings)
