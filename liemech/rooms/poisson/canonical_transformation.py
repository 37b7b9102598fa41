"""Canonical transformations by a generating function, and systems in the new variables."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real
from typing import Any, ClassVar, final

from ...errors import InvalidInput, InvalidType, NotDefined, OutsideChart, require, undefined
from ...formulas import Record, Vec, derivative, dot, gradient, jacobian, record, solve, sqrt, vec
from ...formulas.numbers.dual import Dual, value_of
from ...formulas.numbers.series import Series
from ...solvers import newton
from ...systems.canonical import HamiltonianSystem, degrees_of
from ...systems.in_time.driven import DrivenHamiltonianSystem

DERIVATIVES = 3
"""Corrections of a root by numbers that carry derivatives: after three those of order up to seven
are exact, for each doubles what is right.
"""


@record
class CanonicalTransformation(Record):
    """New positions and momenta (Q, P), by a generating function G(t, q, P) of old positions and
    new momenta:

        Q = dG/dP,   p = dG/dq,   K = H + dG/dt

    The two-form is kept, dq dp = dQ dP, and the motion of H is that of K in the new variables.

    1. A subclass writes `generating(t, q, P)`, as a formula, and says its `degrees`, n.  Its fields
    are the parameters.
    2. It may write `new(t, q, p)` and `old(t, Q, P)` in closed form; left out, the equations are
    solved by Newton's method, from P = p and from q = Q.

    `system(H)` is the system of K.  If G solves the Hamilton-Jacobi equation K is zero, and Q and P
    are constant; HamiltonJacobi makes steps of such a G.
    Raises OutsideChart where the equations have no solution near by.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VI.5; Arnold,
    Mathematical Methods of Classical Mechanics, 2nd ed., sections 47 and 48; the article, (8).
    """

    degrees: ClassVar[int]

    def __post_init__(self) -> None:
        super().__post_init__()
        n, what = degrees_of(self), type(self).__name__
        somewhere = vec(*[0.5 + 0.125 * i for i in range(n)])
        try:
            value: Any = self.generating(0.25, somewhere, 1.5 * somewhere)
        except (ArithmeticError, ValueError, NotDefined):  # no value there, or told later
            return
        except TypeError as error:
            raise InvalidType(
                f"{what}.generating cannot be evaluated: {error}. It is a formula generating(self, t, q, P)"
            ) from error
        if not isinstance(value, Real):
            raise InvalidType(f"{what}.generating must return a number; got {value!r}")

    # ---------------------------------------------------------------- 1. a subclass writes

    def generating(self, t: float, q: Vec, P: Vec) -> float:
        """G(t, q, P).  q, P : (n,)."""
        raise undefined(self, "generating")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    def new(self, t: float, q: Vec, p: Vec) -> tuple[Vec, Vec]:
        """(Q, P), (n,) each.  q, p : (n,)."""
        n = len(q)

        def off(P: Vec, known: Vec) -> Vec:
            at = known[1 : n + 1]
            momenta = known[n + 1 :]
            return self.of_positions(known[0], at, P) - momenta

        P = self._root(off, vec(t, *q, *p), p, "momentum P with dG/dq(q, P) = p")
        return self.of_momenta(t, q, P), P

    def old(self, t: float, Q: Vec, P: Vec) -> tuple[Vec, Vec]:
        """(q, p), (n,) each.  Q, P : (n,)."""
        n = len(Q)

        def off(q: Vec, known: Vec) -> Vec:
            wanted = known[1 : n + 1]
            at = known[n + 1 :]
            return self.of_momenta(known[0], q, at) - wanted

        q = self._root(off, vec(t, *Q, *P), Q, "position q with dG/dP(q, P) = Q")
        return q, self.of_positions(t, q, P)

    # ---------------------------------------------------------------- what follows

    @final
    def of_positions(self, t: float, q: Vec, P: Vec) -> Vec:
        """dG/dq, the old momentum p, (n,).  q, P : (n,)."""
        return gradient(lambda x: self.generating(t, x, P), q)

    @final
    def of_momenta(self, t: float, q: Vec, P: Vec) -> Vec:
        """dG/dP, the new position Q, (n,).  q, P : (n,)."""
        return gradient(lambda x: self.generating(t, q, x), P)

    @final
    def system(self, system: Any) -> InNewVariables:
        """A canonical system in the new variables, with the energy K.

        system : a HamiltonianSystem or a DrivenHamiltonianSystem of as many degrees of freedom.
        Raises InvalidInput for another one.
        """
        return InNewVariables(transformation=self, original=system)

    def _root(self, off: Callable[[Vec, Vec], Vec], known: Vec, guess: Vec, what: str) -> Vec:
        """The x with off(x, known) = 0 near a guess, with the derivatives that known carries."""
        carried = False
        for number in known:
            if isinstance(number, Series):
                raise InvalidType(
                    f"a Series does not pass {type(self).__name__}, whose equations are solved by "
                    "Newton's method; write `new` and `old` in closed form"
                )
            carried = carried or isinstance(number, Dual)
        values = vec(*[value_of(number) for number in known])
        x = vec(*[value_of(number) for number in guess])
        first = off(x, values)
        data = dot(first, first) + dot(x, x)

        def equation(z: Vec) -> tuple[Vec, Any, float]:
            return off(z, values), jacobian(lambda y: off(y, values), z), 1.0

        x, size, enough, _ = newton(equation, x, data)
        if not size <= enough:
            raise OutsideChart(
                f"{type(self).__name__}: no {what} was found, off by {sqrt(size):.1e}, wanted "
                f"{sqrt(enough):.1e}; old and new variables may not be independent there"
            )
        if carried:
            for _ in range(DERIVATIVES):
                x = x - solve(jacobian(lambda y: off(y, known), x), off(x, known))
        return x

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.degrees,) if kind == "Vec" else None


@record
class InNewVariables(DrivenHamiltonianSystem):
    """A canonical system after a canonical transformation: Hamilton's equations for
    K(t, Q, P) = H + dG/dt at the old q, p.

    transformation : a CanonicalTransformation.  original : the system.
    Its q and p are Q and P: `transformation.new(t, q, p)` leads there, `transformation.old(t, Q,
    P)` back.

    Source: the article, (8).
    """

    transformation: CanonicalTransformation
    original: Any

    def __post_init__(self) -> None:
        transformation: Any = self.transformation
        require(f"{type(self).__name__}: transformation", transformation, CanonicalTransformation)
        if (
            not isinstance(self.original, (HamiltonianSystem, DrivenHamiltonianSystem))
            or self.original.fictive
            or self.original.degrees != transformation.degrees
        ):
            raise InvalidInput(
                f"{type(transformation).__name__}.system: a HamiltonianSystem or a DrivenHamiltonianSystem "
                f"with {transformation.degrees} degrees of freedom is needed; got {self.original!r}"
            )
        super().__post_init__()

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The degrees of freedom of the system."""
        return self.transformation.degrees

    def energy(self, t: float, q: Vec, p: Vec) -> float:
        """K = H + dG/dt.  q, p : (n,), the new variables."""
        change = self.transformation
        x, y = change.old(t, q, p)
        before = (t, x, y) if self.original.driven else (x, y)
        return self.original.energy(*before) + derivative(lambda s: change.generating(s, x, p), t)

    def velocity(self, t: float, q: Vec, p: Vec) -> Vec:
        """Q', (n,): what dG/dP changes along the motion.  q, p : (n,), the new variables."""
        return self._rates(t, q, p)[0]

    def force(self, t: float, q: Vec, p: Vec) -> Vec:
        """P', (n,): that with which dG/dq changes as p does.  q, p : (n,), the new variables."""
        return self._rates(t, q, p)[1]

    def _rates(self, t: float, q: Vec, p: Vec) -> tuple[Vec, Vec]:
        """Q' and P' of the motion of H, from p' = d/dt dG/dq and Q' = d/dt dG/dP."""
        change = self.transformation
        x, y = change.old(t, q, p)
        before = (t, x, y) if self.original.driven else (x, y)
        v, f = self.original.velocity(*before), self.original.force(*before)
        mixed = jacobian(lambda z: change.of_positions(t, x, z), p)
        explicit_rate = derivative(lambda s: change.of_positions(t + s, x + s * v, p), 0.0)
        kick = solve(mixed, f - explicit_rate)
        return derivative(lambda s: change.of_momenta(t + s, x + s * v, p + s * kick), 0.0), kick
