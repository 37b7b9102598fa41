"""Canonical systems: positions and momenta in R^n, and an energy that depends on both."""

from __future__ import annotations

from typing import Any, ClassVar, final

import numpy as np

from ..errors import InvalidInput, undefined
from ..formulas import Vec, gradient, record, vec
from ..formulas.classes.derived import derived
from ..formulas.classes.remembered import shared_property
from ..groups.retractions import Retraction
from ..groups.vector_space import VectorSpace
from .input_checks import as_field, points
from .system import State, System


@record
class CanonicalState(State):
    """Where a canonical system is: positions `q` and momenta `p`, (n,) each or, for an ensemble, (members, n)."""

    q: Any
    p: Any


def degrees_of(record: Any) -> int:
    """The number of degrees of freedom that the class of a record says.  Raises InvalidInput if it says none."""
    n = getattr(record, "degrees", None)
    if type(n) is not int or n < 1:
        raise InvalidInput(
            f"{type(record).__name__} must say its degrees of freedom, degrees: ClassVar[int] = 2; got {n!r}"
        )
    return n


@record
class PhaseSpace(System):
    """Positions q and momenta p in R^n, as points that R^2n moves by addition; abstract."""

    coordinates: ClassVar[tuple[str, ...]] = "q", "p"
    degrees: ClassVar[int]

    def __post_init__(self) -> None:
        super().__post_init__()
        degrees_of(self)

    # ---------------------------------------------------------------- how it moves

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """Positions and momenta: (n, n)."""
        return self.degrees, self.degrees

    @shared_property
    def group(self) -> VectorSpace:
        """The group of displacements, R^2n under addition."""
        return VectorSpace(2 * self.degrees)

    @final
    def displaced(self, retraction: Retraction, state: CanonicalState, omega: Vec) -> CanonicalState:
        """The state at (q, p) + omega."""
        y = retraction.compose_tau(self.group, vec(*state.q, *state.p), omega)
        n = len(state.q)
        return CanonicalState(y[:n], y[n : 2 * n])

    @final
    def variation(self, state: CanonicalState, omega: Vec) -> tuple[Vec, Vec]:
        """The displacement, beside |q| and |p|."""
        return omega, vec(*[abs(x) for x in state.q], *[abs(x) for x in state.p])

    @final
    def _points(self, q: Any, p: Any) -> tuple[list[np.ndarray], int | None]:
        """Positions and momenta as arrays, checked, and how many members an ensemble of them has."""
        where, shape = f"{type(self).__name__}.state", (self.degrees,)
        arrays = [
            points(_vector(value, self.degrees), f"{where}: {name}", shape, f"a {noun} of {self!r}")
            for name, noun, value in (("q", "position", q), ("p", "momentum", p))
        ]
        counts = [len(a) for a in arrays if a.shape != shape]
        if len(set(counts)) > 1:
            raise InvalidInput(f"{where}: {counts[0]} positions and {counts[1]} momenta")
        return arrays, counts[0] if counts else None

    @final
    def _canonical_state(self, both: list[np.ndarray], members: int | None) -> CanonicalState:
        """The state of checked positions and momenta."""
        return self.vouched(CanonicalState(*[as_field(a, (self.degrees,), members) for a in both]))

    @final
    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return self.group._shape(argument, kind) if argument == "omega" or kind != "Vec" else (self.degrees,)


@record
class CanonicalSystem(PhaseSpace):
    """Positions q and momenta p in R^n, and an energy H(q, p): what free and constrained systems
    share; abstract.

    A subclass says how they move, `rate`, and which states there are, `state`.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.1.2 and VII.1.
    """

    # ---------------------------------------------------------------- 1. a subclass writes

    def energy(self, q: Vec, p: Vec) -> float:
        """H(q, p).  q, p : (n,)."""
        raise undefined(self, "energy")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @derived
    def velocity(self, q: Vec, p: Vec) -> Vec:
        """The velocity q' = dH/dp, (n,).  q, p : (n,)."""
        return gradient(lambda x: self.energy(q, x), p)

    @derived
    def force(self, q: Vec, p: Vec) -> Vec:
        """The force p' = -dH/dq, (n,).  q, p : (n,)."""
        return -gradient(lambda x: self.energy(x, p), q)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The energy along the motion, {"energy": (...)}."""
        return {"energy": np.asarray(self.energy(states["q"], states["p"]))}


@record
class HamiltonianSystem(CanonicalSystem):
    """Hamilton's equations in R^2n, q' = dH/dp, p' = -dH/dq, for any energy H(q, p).

    1. A subclass writes `energy(q, p)`, as a formula, and says its number of `degrees` of freedom, n.  Its
    fields are the parameters.
    2. It may write `velocity`, dH/dp, and `force`, -dH/dq, in closed form; left out, they follow by
    differentiation, exact to rounding.
    3. It may name what stays constant beside the energy (`constants`).

    The group that moves (q, p) is R^2n under addition, so that methods for Lie groups are here the
    ordinary ones: RKMK is the Runge-Kutta method of its tableau, Taylor the Taylor method.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.1.2.
    """

    @final
    def rate(self, t: float, state: CanonicalState) -> Vec:
        """The rates of change (q', p') = (dH/dp, -dH/dq)."""
        return vec(*self.velocity(state.q, state.p), *self.force(state.q, state.p))

    @final
    def state(self, q: Any, p: Any) -> CanonicalState:
        """A start for `integrate`: positions q and momenta p, (n,) each, or (members, n) for an
        ensemble; numbers if n = 1.

        Raises InvalidInput for wrong shapes and entries that are not finite, and for positions where
        there is no force.
        """
        arrays, members = self._points(q, p)
        self._require_places(f"{type(self).__name__}.state", arrays[0])
        return self._canonical_state(arrays, members)

    def _require_places(self, name: str, q: np.ndarray) -> None:
        """Raise InvalidInput for positions where there is no force, which a system may know.  q : (n,),
        or (members, n).
        """


def _vector(value: Any, degrees: int) -> Any:
    """A number becomes a vector of one component, where there is one degree of freedom."""
    return [value] if degrees == 1 and isinstance(value, (int, float, np.number)) else value
