"""Methods that are what they claim to be pass `check_method` from starts that are hard to judge from:
at rest, near an unstable point, and where one part of the state is much larger than the others.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.checks.reference import settled
from liemech.formulas import cos


@lm.record
class Swing(lm.SeparableSystem):
    """A pendulum whose length is pumped; q = (angle, t), p = (momentum, energy of the drive)."""

    degrees: ClassVar[int] = 2
    pumping: float

    def kinetic(self, p: Any) -> Any:
        return 0.5 * p[0] ** 2 + p[1]

    def potential(self, q: Any) -> Any:
        return -(1.0 + self.pumping * cos(2.0 * q[1])) * cos(q[0])


PENDULUM, PUMPED, TWO = lm.models.Pendulum(), Swing(0.2), lm.models.DoublePendulum(gravity=1.0)
CASES = {
    "at rest": (PENDULUM, [1.0], lm.RKMK(order=4)),
    "at rest, order 2": (PENDULUM, [1.0], lm.StormerVerlet()),
    "nearly at the top": (PUMPED, [3.0, 0.0], lm.Splitting(order=8)),
    "slow beside the drive": (PUMPED, [0.1, 0.0], lm.Splitting(order=6)),
    "slower": (PUMPED, [0.05, 0.0], lm.Splitting(order=6)),
    "an error that changes its sign": (PUMPED, [0.05, 0.0], lm.RKMK(order=7)),
    "a large step": (TWO, [2.5, -1.25], lm.SymmetricHamiltonJacobi(4)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_method_that_keeps_its_claims_is_not_blamed(name: str) -> None:
    system, q, method = CASES[name]
    report = lm.check_method(method, system, system.state(q, np.zeros_like(q)), raises=False)
    assert not [str(finding) for finding in report.findings if finding.verdict == "broken"]
    assert report["order"].verdict == "holds"


@pytest.mark.slow
def test_the_way_back_is_judged_by_what_moves() -> None:
    """Momenta of 1e-4 that begin at zero: an error of them is as large as they become."""

    @lm.record
    class Light(lm.SeparableSystem):
        degrees: ClassVar[int] = 1
        mass: float

        def kinetic(self, p: Any) -> Any:
            return 0.5 * p[0] ** 2 / self.mass

        def potential(self, q: Any) -> Any:
            return -self.mass * cos(q[0])

    seen = [
        lm.check_method(lm.Splitting(order=3), system, system.state([1.0], [0.0]), h=1.5, raises=False)[
            "symmetric"
        ].observed
        for system in (Light(1.0), Light(2.0**-14))
    ]
    assert float(seen[1]) == pytest.approx(float(seen[0]), rel=0.1)


def test_the_reference_is_as_exact_as_it_says() -> None:
    """Of x' = x by a series of order 8 the doubt is no less than the error, and near rounding."""

    def follow(steps: int) -> float:
        h, x = 3.0 / steps, 1.0
        for _ in range(steps):
            term = x
            for k in range(1, 9):
                term = term * h / k
                x = x + term
        return x

    found, doubts = settled(follow, 1, lambda a, b: {"x": abs(a - b) / b}, 64.0 * 2.0**-52)
    assert abs(found - np.exp(3.0)) / np.exp(3.0) <= max(doubts["x"], 2.0**-50)
    assert doubts["x"] <= 64.0 * 2.0**-52
