"""Hamilton-Jacobi methods in R^2n: symplectic steps of any order from a generating function."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import IncompatibleSystem, InvalidInput, InvalidType, NoConvergence
from ..formulas import Vec, dot, plain, record, sqrt, vec
from ..formulas.series import Series
from ..retractions import Exponential
from ..solvers import LIMIT
from ..systems.canonical import CanonicalState, HamiltonianSystem
from .method import Method
from .motion_series import settle, values
from .taylor import total

ORDERS = 1, 10
"""The lowest order and the highest one."""

ROUNDING, NOISE = 2.0**-53, 2.0**-46
"""The iteration ends when the next mismatch will be below the first of these, or when this one, below the second, does not fall."""


@record
class HamiltonJacobi(Method):
    """Steps whose generating function G(h, q, P), of the second kind, solves the Hamilton-Jacobi equation up to h^order.

        dG/dt + H(q, dG/dq) = 0,   G(0, q, P) = q.P         (Q, P) at the start of a step, (q, p) at its end
        Q = dG/dP(h, q, P)  solved for q,   p = dG/dq(h, q, P)

    For any energy H(q, p), separable or not, and any number of degrees of freedom.  Order 1, G = q.P - h H(q, P), is the symplectic
    Euler method, with H_q and H_p at (q, P).

    order : 1 to 10.  adjoint : the inverse of the method with -h, from a G that depends on the old q and the new p.
    Symplectic, not symmetric: the energy oscillates without drift.  H must be analytic along a step.
    Raises NoConvergence if the step is too large for the equation to be solved.

    Source: Hairer, Lubich, Wanner, VI.5.4 (methods based on generating functions); Feng Kang, J. Comput. Math. 4 (1986), 279;
    Channell and Scovel, Nonlinearity 3 (1990), 231.
    """

    symplectic: ClassVar[bool] = True

    order: int = 4
    adjoint: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self.order) is not int or not ORDERS[0] <= self.order <= ORDERS[1]:
            raise InvalidInput(f"HamiltonJacobi: order is a whole number from {ORDERS[0]} to {ORDERS[1]}; got {self.order!r}")
        if type(self.adjoint) is not bool:
            raise InvalidType(f"HamiltonJacobi: adjoint is True or False; got {self.adjoint!r}")

    @property
    def name(self) -> str:
        """The method and its order."""
        return f"Hamilton-Jacobi {self.order}{', adjoint' if self.adjoint else ''}"

    def require(self, system: Any) -> None:
        """A canonical system whose formulas can be expanded in power series."""
        super().require(system)
        if not isinstance(system, HamiltonianSystem):
            raise IncompatibleSystem(
                f"{self!r} needs a HamiltonianSystem, an energy of positions and momenta; {system!r} is none. "
                "LiePoissonHamiltonJacobi is for energies of body momenta, RKMK for every system."
            )
        try:
            somewhere = vec(*[0.5 + 0.125 * i for i in range(system.degrees)])
            self._motion(system, 0.125, somewhere, somewhere)
        except (TypeError, AttributeError) as error:
            if "Series" in str(error) or "Dual" in str(error):  # anything else the run will tell
                raise IncompatibleSystem(
                    f"{self!r} expands the energy in power series, and the formulas of {system!r} do not allow it: {error}. "
                    "Write them with + - * / ** and the functions of liemech.formulas (sin, exp, sqrt, ...); or write velocity and "
                    "force too, and use a method that needs no more of them than values, such as RKMK."
                ) from error
        except (ArithmeticError, ValueError):  # not in their domain
            pass

    # ---------------------------------------------------------------- one step

    def step(self, system: Any, t: float, state: CanonicalState, h: float) -> CanonicalState:
        """Solve for the change of (q, p) and apply it."""
        start = plain(state)
        return system.displaced(Exponential(), state, self.solution(system, h, start.q, start.p))

    def solution(self, system: Any, h: float, q: Vec, p: Vec) -> Vec:
        """The change of (q, p) in a step.

        The Taylor method T of this order undoes Q(q) = dG/dP(h, q, P) up to h^(order + 1).  So with q = T(Q + w) the iteration
        w <- w - (Q(T(Q + w)) - Q) gains about as many digits in each turn as the first guess, T(Q), has.
        """
        w = 0.0 * (p if self.adjoint else q)
        change = vec(*w, *w)
        size, before, scale, last = 0.0, 0.0, 0.0, False
        for _ in range(LIMIT):
            change, mismatch, scale = self._tried(system, h, q, p, w)
            if last:
                break
            before, size = size, dot(mismatch, mismatch)
            foreseen = size * size <= ROUNDING * ROUNDING * scale * before  # the next one is about size/before times this one
            last = foreseen or before <= size <= NOISE * NOISE * scale
            w = w - mismatch
        if not last:
            raise NoConvergence(
                f"{self!r}: the equation of the step was not solved in {LIMIT} iterations: mismatch {sqrt(size):.1e}, wanted "
                f"{NOISE * sqrt(scale):.1e}. The step h = {h:g} is too large for this motion; try {0.25 * h:g}"
            )
        return change

    def _tried(self, system: Any, h: float, q: Vec, p: Vec, w: Vec) -> tuple[Vec, Vec, float]:
        """With this w: the change of (q, p), the mismatch Q(q) - Q, and the square that its square is to be compared with."""
        if self.adjoint:
            terms = self._motion(system, h, q, p + w)[1]
            forth = w + total(terms)
            other, back = self._generated(system, -h, q, p + forth)
            return vec(*-other, *forth), forth + back, dot(p, p) + _squares(terms)
        terms = self._motion(system, h, q + w, p)[0]
        forth = w + total(terms)
        back, other = self._generated(system, h, q + forth, p)
        return vec(*forth, *other), forth - back, dot(q, q) + _squares(terms)

    # ---------------------------------------------------------------- series

    def _motion(self, system: Any, h: float, q: Vec, p: Vec) -> tuple[list[Vec], list[Vec]]:
        """The Taylor method: the terms of h, ..., h^order in the change of q and in that of p along the motion from (q, p)."""
        u, v = (vec(*[Series(c) for c in x]) for x in (q, p))
        for x, rate in zip((*u, *v), (*system.velocity(u, v), *system.force(u, v))):
            x.grow(rate, h)
        powers = range(1, self.order + 1)
        return [vec(*[x[k] for x in u]) for k in powers], [vec(*[x[k] for x in v]) for k in powers]

    def _generated(self, system: Any, h: float, q: Vec, P: Vec) -> tuple[Vec, Vec]:
        """q - dG/dP and dG/dq - P at (h, q, P).

        The motion backwards from (q, p) leads to (Q, P).  With P fixed, p is a series in h: so are the terms of the motion, and
        p = P - (what it adds to p) determines one after the other.
        """
        p = vec(*[Series(c) for c in P])
        to_q, to_p = self._motion(system, -h, q, p)
        settle(p, [-term for term in to_p])
        powers = range(1, self.order + 1)
        return -total(values(to_q)), total([vec(*[x[k] for x in p]) for k in powers])


def _squares(terms: list[Vec]) -> float:
    """The sum of the squares of the terms."""
    square = 0.0
    for term in terms:
        square = square + dot(term, term)
    return square
