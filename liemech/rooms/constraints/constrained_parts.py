"""Constrained systems whose energy is a sum of parts, each with a motion on the constraints that is
known.
"""

from __future__ import annotations

from typing import Any, ClassVar, final

import numpy as np

from ...errors import InvalidInput, InvalidType, LiemechError, require, undefined
from ...formulas import Record, Vec, derivative, dot, gradient, plain, record, vec, vectors, where
from ...formulas.classes.derived import derived, derived_from
from ...formulas.numbers.anything import indices_in, traced
from ...formulas.vectors import Vec as SmallVec
from ...formulas.vectors import small
from ...systems.canonical import CanonicalState
from ...systems.parts import OfParts
from .constrained import CONSISTENT, ConstrainedSystem, cross_products, eliminated

ACROSS = 2.0**-20
"""A part moves across the constraints if more of its velocity than this does."""


@record
class ConstrainedPart(Record):
    """A part H_i(q, p) of the energy of a constrained system, with its motion on M.

        q' = dH_i/dp,   p' = -dH_i/dq - G^T lambda,   0 = G H_p       with the H of the whole system

    It must stay on M: G dH_i/dp = 0 there.  1. A subclass writes `energy(q, p)` and `flow`.
    2. It may write `velocity`, dH_i/dp, and `force`, -dH_i/dq, in closed form.
    A part that depends on q alone needs no `flow`: it kicks p, and leaves of the kick what is
    tangent.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.5; the slides,
    (1.14) and (1.15).
    """

    def energy(self, q: Vec, p: Vec) -> float:
        """H_i(q, p).  q, p : (n,)."""
        raise undefined(self, "energy")

    @derived
    def velocity(self, q: Vec, p: Vec) -> Vec:
        """dH_i/dp, (n,).  q, p : (n,)."""
        return gradient(lambda x: self.energy(q, x), p)

    @derived
    def force(self, q: Vec, p: Vec) -> Vec:
        """-dH_i/dq, (n,).  q, p : (n,)."""
        return -gradient(lambda x: self.energy(x, p), q)

    @derived_from("energy", "velocity", "force")
    def flow(self, system: Any, q: Vec, p: Vec, t: float) -> tuple[Vec, Vec]:
        """Where (q, p) is after the time t, if this part is all the energy.  system : the whole
        system.  q, p : (n,).

        By default that of a potential V(q): p + t f, made tangent.
        """
        return q, system.tangent(q, p + t * self.force(q, p))


@record
class SplitConstrainedSystem(OfParts, ConstrainedSystem):
    """A constrained system with H = H_1 + H_2 + ..., parts that move on M one by one: `Splitting`
    makes these motions in turn.

    parts : ConstrainedParts.  A subclass writes `constraint(q)` and says its number of `degrees`.
    Where every part stays on M, G dH_i/dp = 0, its motion is symplectic there, and so is any
    composition; `state` refuses a start at which one does not, `check_system` looks elsewhere.
    quadratic : say so where the parts are two, (T, V), T of second degree in p and V a function of
    q: then splittings of Runge-Kutta-Nystroem kind are of their order.

    Raises InvalidType for parts that are no ConstrainedParts.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.5; the slides,
    (1.14) and (1.15).
    """

    alternatives: ClassVar[str] = (
        "Splitting(order=4) is for it, RATTLE() needs no motion of a part; RKMK accepts every "
        "system, but leaves the constraints"
    )
    quadratic: ClassVar[bool] = False  # type: ignore[misc]

    parts: tuple[ConstrainedPart, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        parts: Any = self.parts
        parts = tuple(parts) if isinstance(parts, list) else parts
        object.__setattr__(self, "parts", parts)
        if not isinstance(parts, tuple) or not parts:
            raise InvalidType(f"{type(self).__name__}: parts must be a tuple of ConstrainedParts; got {parts!r}")
        for part in parts:
            require(f"{type(self).__name__}: parts", part, ConstrainedPart, "ConstrainedParts")
        if type(self).quadratic and len(parts) != 2:
            raise InvalidInput(
                f"{type(self).__name__}: quadratic says that the parts are two, T and V; they are {len(parts)}"
            )

    @final
    def energy(self, q: Vec, p: Vec) -> float:
        """H_1 + H_2 + ...  q, p : (n,)."""
        return vectors.sum([part.energy(q, p) for part in self.parts])

    @final
    def velocity(self, q: Vec, p: Vec) -> Vec:
        """The velocities of the parts together.  q, p : (n,)."""
        return vectors.sum([part.velocity(q, p) for part in self.parts])

    @final
    def force(self, q: Vec, p: Vec) -> Vec:
        """The forces of the parts together.  q, p : (n,)."""
        return vectors.sum([part.force(q, p) for part in self.parts])

    @final
    def rate_of_part(self, number: int, q: Vec, p: Vec) -> Vec:
        """(q', p') of the motion of one part on M, (2n,).  number : from 0.  q, p : (n,).

            lambda = (G H_pp G^T)^-1 (d/dq(G H_p) dH_i/dp - G H_pp dH_i/dq)

        Source: the slides, (1.15).
        """
        part = self.parts[number]
        n, v, f = len(q), part.velocity(q, p), part.force(q, p)
        change = derivative(lambda y: self._hidden(y, n), vec(*q, *p), vec(*v, *f))
        G = self.constraint_jacobian(q)
        x, _ = eliminated(cross_products(G, self.normals(q, p)), change)
        return vec(*v, *(f - x @ G))

    @final
    def in_turn(self, state: CanonicalState, turns: list[tuple[int, float]]) -> CanonicalState:
        start = plain(state)
        q, p = start.q, start.p
        for number, t in turns:
            q, p = self.parts[number].flow(self, q, p, t)
        return CanonicalState(state.q + (q - start.q), state.p + (p - start.p))

    @final
    def unknown_motion(self) -> str:
        for part in self.parts:
            if type(part).flow is not ConstrainedPart.flow:
                continue
            n = self.degrees
            energy, reason = traced(
                lambda y, part=part, n=n: part.energy(  # type: ignore[misc]
                    y[:n], y[n : 2 * n]
                ),
                [1] * (2 * n),
            )
            if reason:
                return (
                    f"{part!r} has no `flow`, and its formula need not be the same at all points "
                    f"({reason}), so that nobody sees whether it depends on q alone. Write its `flow`"
                )
            if any(i >= n for i in indices_in(energy)):
                return (
                    f"{part!r} depends on p, and its motion on the constraints is not written. "
                    "Write its `flow`, or use RATTLE(), which needs none"
                )
        return ""

    @final
    def strays(self, q: Vec, p: Vec) -> Vec:
        """How much of the velocity of each part is across the constraints, G dH_i/dp, (parts m,),
        relative to its terms; zero on M.  q, p : (n,).
        """
        G, speeds = self.constraint_jacobian(q), self._terms(q, p)[1]
        shares: list[Any] = []
        for part in self.parts:
            v = part.velocity(q, p)
            for row, speed in zip(G, speeds):
                size = dot(abs(row), abs(v)) + (CONSISTENT / ACROSS) * speed
                shares = [*shares, abs(dot(row, v)) / where(size > 0.0, size, 1.0)]
        return vec(*shares)

    def _check_flows(self, q: Vec, p: Vec) -> None:
        """Raise InvalidType, InvalidInput unless each flow is a pair of vectors.  q, p : (n,)."""
        signature = "flow(self, system, q, p, t)"
        for part in self.parts:
            name = f"{type(part).__name__}.flow"
            try:
                value: Any = part.flow(self, q, p, 0.0)
            except (ArithmeticError, ValueError, LiemechError):  # the run will tell
                continue
            except TypeError as error:
                raise InvalidType(f"{name} cannot be evaluated: {error}. It is {signature}") from error
            if (
                not isinstance(value, tuple)
                or len(value) != 2
                or not all(isinstance(x, SmallVec) and len(x) == self.degrees for x in value)
            ):
                raise InvalidInput(
                    f"{name} returns {value!r}; {signature} must return positions and momenta, two "
                    f"vectors of {self.degrees} numbers"
                )

    def _check_motion(self, where: str, q: np.ndarray, p: np.ndarray, one: bool) -> None:
        self._check_flows(small(q[0]), small(p[0]))
        far = np.asarray(self.strays(q, p)).reshape(len(q), len(self.parts), -1)
        bad = np.argwhere(~(far <= ACROSS))
        if len(bad):
            i, k, j = map(int, bad[0])
            raise InvalidInput(
                f"{where}: the start{'' if one else f' of member {i}'} is moved off the constraints "
                f"by {self.parts[k]!r} alone: G dH_i/dp[{j}] is {far[i, k, j]:.1e} of its terms. "
                "Parts of a SplitConstrainedSystem must have G dH_i/dp = 0 where g = 0 and "
                "G H_p = 0; split the energy in another way, or use RATTLE()"
            )
