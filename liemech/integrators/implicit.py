"""Methods whose step is an equation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import NoConvergence, OutsideChart, undefined
from ..formulas import Vec, dot, record, sqrt
from ..formulas.large import distance2
from ..solvers import LIMIT, fixed_point
from ..systems.lie_poisson import BodyState
from .memory import Memory, Remembering, followed, repeated


@record
class Implicit(Remembering):
    """A method for Lie-Poisson systems that solves an equation in every step; abstract.

    1. A subclass writes `first`, the guess at the start, and `step`, which begins with a guess that
    is `extrapolated` from the past and ends with `after`.
    2. The memory, and what compositions ask of it, follow.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VIII.6.1 (starting
    approximations).
    """

    def first(self, system: Any, state: BodyState, h: float) -> Any:
        """The guess for the first step."""
        raise undefined(self, "first")

    def beginning(self, system: Any, state: BodyState, h: float) -> tuple[Any, Any, Any]:
        """A past in which every step had the first guess as its unknown."""
        return repeated(self.first(system, state, h))

    def after(self, memory: Memory, state: Any, unknown: Any) -> Memory:
        """The memory after a step that led to this state and had this unknown."""
        return Memory(state, memory.node, followed(memory.past, unknown))

    def iterated(
        self,
        system: Any,
        retraction: Any,
        h: float,
        mu: Vec,
        guess: tuple[Vec, Vec],
        displacement: Callable[[Vec], Vec],
    ) -> tuple[Vec, Vec]:
        """The p with (dtau^-1_x)* p = mu of large matrices, right-trivialised, and its displacement
        x = x(p), both from a guess: p + mu - (dtau^-1_x)* p again and again, without a Jacobian.  Raises NoConvergence,
        OutsideChart.
        """

        def sweep(both: tuple[Vec, Vec]) -> tuple[tuple[Vec, Vec], float, float]:
            p, x = both
            new = p + (mu - retraction.dtau_inv_dual(system.group, -x, p))
            return (new, displacement(new)), sqrt(distance2(new, p)), sqrt(dot(new, new))

        p, x = fixed_point(sweep, guess, self, h)
        if not retraction.is_chart(system.group, x):
            raise self._out_of_chart(h, f"|x| = {sqrt(dot(x, x)):.2g}")
        return p, x

    def _unsolved(self, h: float, size: float, enough: float, detail: str = "") -> NoConvergence:
        """The error of a step whose equation Newton's method did not solve; `size` and `enough` are squares."""
        return NoConvergence(
            f"{self!r}: Newton's method did not converge in {LIMIT} iterations: mismatch "
            f"{sqrt(size):.1e}, wanted {sqrt(enough):.1e}{detail}. The step h = {h:g} is too large "
            f"for this motion; try {0.25 * h:g}"
        )

    def _out_of_chart(self, h: float, length: str) -> OutsideChart:
        """The error of a step whose solution belongs to no motion."""
        return OutsideChart(
            f"{self!r}: the step left the chart, {length}: what solves its equation there is no "
            f"continuation of the motion. The step h = {h:g} is too large; try {0.25 * h:g}"
        )

    def _unconnected(self, h: float, end: float, length: str, usable: float | None) -> NoConvergence:
        """The error of a step without a solution: the solution that grows out of h = 0 ends before h.

        usable : a step that every momentum of this size has, if known.
        """
        helps = usable is not None and abs(usable) < abs(h)
        cure = f"{usable:.3g}, which every direction of this momentum has" if helps else f"{0.25 * h:g}"
        return NoConvergence(
            f"{self!r}: the solution that grows out of h = 0 ends at h = {end:.3g}, {length}, in a "
            "fold or at the chart's edge, and another one would be no continuation of the motion. "
            f"The step h = {h:g} is too large for this motion; try {cure}"
        )
