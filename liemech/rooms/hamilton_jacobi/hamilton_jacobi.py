"""Hamilton-Jacobi methods in R^2n: symplectic steps of any order from a generating function."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

from ...errors import IncompatibleSystem, InvalidInput, InvalidType, NoConvergence, OutsideChart
from ...formulas import Mat, Vec, dot, jacobian, plain, record, sqrt, vec
from ...formulas.numbers.bases import CarriesMore
from ...formulas.numbers.double_double import is_long
from ...formulas.numbers.series import Series
from ...groups.representations import squares
from ...groups.retractions import Exponential
from ...integrators.method import Method
from ...integrators.motion_series import collected, settle, values
from ...integrators.taylor import total
from ...solvers import LIMIT, correction, newton
from ...systems.canonical import CanonicalState, HamiltonianSystem
from ...systems.in_time.driven import DrivenHamiltonianSystem

ORDERS = 1, 10
"""The lowest order and the highest one."""

KINDS = "qP", "qQ", "pP"
"""The variables of the generating function, of the new state (q, p) and the old one (Q, P)."""

ROUNDING, NOISE = 2.0**-53, 2.0**-46
"""The iteration ends when the next mismatch will be below the first of these, or when this one,
below the second, does not fall.
"""


@record
class HamiltonJacobi(Method):
    """Steps whose generating function solves the Hamilton-Jacobi equation up to h^order.

        dG/dt + H(t, q, dG/dq) = 0         (Q, P) at the start of a step, (q, p) at its end
        kind "qP":  Q = dG/dP,  p = dG/dq,   G = q.P at h = 0
        kind "qQ":  P = -dG/dQ, p = dG/dq,   G = h L((q - Q)/h) + ..., the discrete Lagrangian;   needs a regular d2H/dp2
        kind "pP":  Q = dG/dP,  q = -dG/dp,  the same with positions and momenta exchanged;       needs a regular d2H/dq2

    For any energy H(q, p) or H(t, q, p), separable or not, and any number of degrees of freedom.
    Order 1 of the kind "qP", G = q.P - h H(q, P), is the symplectic Euler method, with H_q and H_p
    at (q, P).

    order : 1 to 10; of the kinds "qQ" and "pP" 1 to 4.  kind : the variables of the generating
    function.
    adjoint : the inverse of the method with -h; of the kind "qP" it is the one of the old q and the
    new p.  "qQ" and "pP" have no generating function at h = 0, where new and old are the same and
    not independent.  G is expanded in h for a fixed mean velocity (q - Q)/h, or a fixed mean force.
    Symplectic, not symmetric (SymmetricHamiltonJacobi is): the energy oscillates without drift.  H
    must be analytic along a step.
    Raises NoConvergence if the step is too large for the equation to be solved.

    Source: Hairer, Lubich, Wanner, VI.5.4 (methods based on generating functions); Feng Kang, J.
    Comput. Math. 4 (1986), 279; Channell and Scovel, Nonlinearity 3 (1990), 231; Marsden and West,
    Acta Numerica 10 (2001), 1.6 (the kind "qQ").
    """

    symplectic: ClassVar[bool] = True
    analytic: ClassVar[bool] = True

    order: int = 4
    adjoint: bool = False
    kind: str = "qP"

    def __post_init__(self) -> None:
        super().__post_init__()
        require_kind("HamiltonJacobi", self.kind)
        highest = HIGHEST[self.kind]
        if type(self.order) is not int or not ORDERS[0] <= self.order <= highest:
            raise InvalidInput(
                f"HamiltonJacobi: order is a whole number from {ORDERS[0]} to {highest}, of kind "
                f"{self.kind!r}; got {self.order!r}"
            )
        if type(self.adjoint) is not bool:
            raise InvalidType(f"HamiltonJacobi: adjoint is True or False; got {self.adjoint!r}")

    @property
    def name(self) -> str:
        kind = "" if self.kind == "qP" else f" ({self.kind[0]}, {self.kind[1]})"
        return f"Hamilton-Jacobi {self.order}{kind}{', adjoint' if self.adjoint else ''}"

    def require(self, system: Any) -> None:
        """A canonical system whose formulas can be expanded in power series, and with which the
        generating function exists.
        """
        super().require(system)
        if not isinstance(system, (HamiltonianSystem, DrivenHamiltonianSystem)):
            raise IncompatibleSystem(
                f"{self!r} needs a HamiltonianSystem, an energy of positions and momenta; "
                f"{system!r} is none. LiePoissonHamiltonJacobi is for "
                "energies of body momenta, RKMK for every system."
            )
        try:
            somewhere = vec(*[0.5 + 0.125 * i for i in range(system.degrees)])
            self._motion(system, 0.0, 0.125, somewhere, somewhere)
            singular = self.kind != "qP" and not _regular(self._slope(system, 0.0, somewhere, somewhere))
        except (TypeError, AttributeError) as error:
            carries = isinstance(error, CarriesMore) or "Series" in str(error)
            if carries or "Dual" in str(error):  # anything else the run will tell
                raise IncompatibleSystem(
                    f"{self!r} expands the energy in power series, and the formulas of {system!r} "
                    f"do not allow it: {error}. Write them with + - * / ** and the functions of "
                    "liemech.formulas (sin, exp, sqrt, ...); or write velocity and force too, and "
                    "use a method that needs no more of them than values, such as RKMK."
                ) from error
        except (ArithmeticError, ValueError):  # not in their domain
            pass
        else:
            if singular:
                raise IncompatibleSystem(
                    f"{self!r}: {DEGENERATE[self.kind].format(system)}. HamiltonJacobi(kind='qP') always exists"
                )

    # ---------------------------------------------------------------- one step

    def step(self, system: Any, t: float, state: CanonicalState, h: float) -> CanonicalState:
        """Solve for the change of (q, p) and apply it."""
        start = plain(state)
        if self.kind == "pP":
            n = len(start.q)
            change = self.solution(system, t, h, start.p, -start.q)
            return system.displaced(
                Exponential(), state, vec(*[-change[n + i] for i in range(n)], *[change[i] for i in range(n)])
            )
        return system.displaced(Exponential(), state, self.solution(system, t, h, start.q, start.p))

    def solution(self, system: Any, t: float, h: float, x: Vec, y: Vec) -> Vec:
        """The change of (x, y) in a step: of (q, p), or, of the kind "pP", of (p, -q), which is a
        canonical pair too.

        The Taylor method T of this order undoes Q(q) = dG/dP(h, q, P) up to h^(order + 1).  So with
        q = T(Q + w) the iteration w <- w - (Q(T(Q + w)) - Q) gains about as many digits in each
        turn as the first guess, T(Q), has.
        """
        if self.kind != "qP" and h == 0.0:
            raise OutsideChart(
                f"{self!r}: the identity, the step with h = 0, has no generating function of "
                f"{self.kind[0]} and {self.kind[1]}: the two are the same "
                "then, not independent. That of kind 'qP' is q.P"
            )
        w = 0.0 * (x if self.kind == "qP" and not self.adjoint else y)
        change = vec(*w, *w)
        size, before, scale, last = 0.0, 0.0, 0.0, False
        for _ in range(LIMIT):
            change, mismatch, scale = self._tried(system, t, h, x, y, w)
            if last:
                break
            before, size = size, dot(mismatch, mismatch)
            # the next one is about size/before times this one
            foreseen = size * size <= ROUNDING * ROUNDING * scale * before
            last = foreseen or before <= size <= NOISE * NOISE * scale
            w = w - mismatch
        if not last:
            raise NoConvergence(
                f"{self!r}: the equation of the step was not solved in {LIMIT} iterations: "
                f"mismatch {sqrt(size):.1e}, wanted {NOISE * sqrt(scale):.1e}. The step h = {h:g} "
                f"is too large for this motion{FOLDS[self.kind]}; try {0.25 * h:g}"
            )
        return change

    def _tried(self, system: Any, t: float, h: float, x: Vec, y: Vec, w: Vec) -> tuple[Vec, Vec, float]:
        """The change of (x, y) with this w, the mismatch of the old state, and the square to
        compare its square with.
        """
        if self.kind != "qP":
            to_x, to_y = self._motion(system, t, h, x, y + w)
            forth, scale = total(to_x), dot(y, y) + squares(to_y)
            size = (dot(forth, forth) + squares(to_x)) / (h * h)
            if self.adjoint:  # expanded about the old state, the new one is elsewhere
                y_at_x, y_ahead, kick = self._between(system, t, h, x, forth / h, y, size)
                return vec(*forth, *-kick), y_at_x - y, scale
            y_at_x, y_ahead, kick = self._between(system, t + h, -h, x + forth, forth / h, y, size)
            return vec(*forth, *kick), y_ahead - y, scale
        if self.adjoint:
            terms = self._motion(system, t, h, x, y + w)[1]
            forth = w + total(terms)
            other, back = self._generated(system, t, -h, x, y + forth)
            return vec(*-other, *forth), forth + back, dot(y, y) + squares(terms)
        terms = self._motion(system, t, h, x + w, y)[0]
        forth = w + total(terms)
        back, other = self._generated(system, t + h, h, x + forth, y)
        return vec(*forth, *other), forth - back, dot(x, x) + squares(terms)

    # ---------------------------------------------------------------- series

    def _rates(self, system: Any, t: Any, x: Vec, y: Vec) -> tuple[Vec, Vec]:
        """The rates x' and y' of (q, p), or of (p, -q) in the kind "pP"."""
        n = len(x)
        turned = self.kind == "pP"
        rate = system.rate(t, CanonicalState(-y, x) if turned else CanonicalState(x, y))
        v, f = rate[:n], rate[n : 2 * n]
        return (f, -v) if turned else (v, f)

    def _motion(self, system: Any, t: float, h: float, x: Vec, y: Vec) -> tuple[list[Vec], list[Vec]]:
        """The Taylor method: the terms of h, ..., h^order in the change of x and in that of y along
        the motion from time t.
        """
        if is_long(x[0]):
            raise InvalidType(
                "precision: power series have numbers of one double; take precision='double' or another method"
            )
        u, v = (vec(*[Series(c) for c in z]) for z in (x, y))
        for z, rate in zip((*u, *v), [c for part in self._rates(system, Series(t, h), u, v) for c in part]):
            z.grow(rate, h)
        powers = range(1, self.order + 1)
        return [vec(*[z[k] for z in u]) for k in powers], [vec(*[z[k] for z in v]) for k in powers]

    def _generated(self, system: Any, t: float, h: float, q: Vec, P: Vec) -> tuple[Vec, Vec]:
        """q - dG/dP and dG/dq - P at (h, q, P), where t is the time of (q, p).

        The motion backwards from (q, p) leads to (Q, P).  With P fixed, p is a series in h: so are
        the terms of the motion, and p = P - (what it adds to p) determines one after the other.
        """
        p = vec(*[Series(c) for c in P])
        to_q, to_p = self._motion(system, t, -h, q, p)
        settle(p, [-term for term in to_p])
        powers = range(1, self.order + 1)
        return -total(values(to_q)), total([vec(*[x[k] for x in p]) for k in powers])

    def _between(
        self, system: Any, t: float, s: float, x: Vec, v: Vec, guess: Vec, size: float
    ) -> tuple[Vec, Vec, Vec]:
        """y where x is, at time t; y at the place x + s v, at time t + s; and the first less the
        second.

        G/s is the Lagrangian of v at x and a series in s; so y = m + s y_1 + ... with the m that
        belongs to v, x' = v.  The motion from (x, y) is to lead to x + s v, whatever s is: of what
        it adds to x the terms of s^2, s^3, ... vanish, which determines y_1, y_2, ...  G ends with
        s^order, dG/dv/s one term earlier.
        """
        m, slope = self._conjugate(system, t, x, v, guess, size)
        y = [m]
        for _ in range(1, self.order):
            to_x, _ = self._motion(system, t, s, x, _polynomial(y))
            y = [*y, -correction(slope, (1.0 / s) * _term(len(y), to_x))]
        to_y = self._motion(system, t, s, x, _polynomial(y))[1]
        kicks = [-term for term in values(to_y)]
        y_at_x = total([*y, kicks[self.order - 1]])
        return y_at_x, total([*y, *[-kick for kick in kicks[: self.order - 1]]]), total(kicks)

    def _conjugate(self, system: Any, t: float, x: Vec, v: Vec, guess: Vec, size: float) -> tuple[Vec, Mat]:
        """The y with x' = v, the Legendre transform, and dx'/dy there.  size : a square, of
        velocities.
        """

        def equation(y: Vec) -> tuple[Vec, Mat, float]:
            return self._rates(system, t, x, y)[0] - v, self._slope(system, t, x, y), 1.0

        y, off, enough, _ = newton(equation, guess, size)
        if not off <= enough:
            raise NoConvergence(
                f"{self!r}: no {MEANS[self.kind]}, off by {sqrt(off):.1e}, wanted "
                f"{sqrt(enough):.1e}. HamiltonJacobi(kind='qP') always exists"
            )
        return y, self._slope(system, t, x, y)

    def _slope(self, system: Any, t: float, x: Vec, y: Vec) -> Mat:
        """The derivative of the rate x' by y, (n, n)."""
        return jacobian(lambda z: self._rates(system, t, x, z)[0], y)


@record
class SymmetricHamiltonJacobi(Method):
    """Half a step of a Hamilton-Jacobi method of odd order k and half a step of its adjoint:
    symmetric, of order k + 1.

        Phi_h = Phi*_(h/2) o Phi_(h/2),   Phi*_h = (Phi_-h)^-1

    order : 2, 4, 6, 8 or 10; of the kinds "qQ" and "pP" 2 or 4.  kind : "qP", "qQ" or "pP", as of
    HamiltonJacobi.  Order 2 of a separable energy is the Stormer-Verlet method.  Both halves are
    expanded about the middle of the step.  Symplectic; `Composition` takes it further.  Raises
    NoConvergence if the step is too large.

    Source: Hairer, Lubich, Wanner, II.4 (composition with the adjoint) and VI.5.4.
    """

    symmetric: ClassVar[bool] = True
    analytic: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    order: int = 4
    kind: str = "qP"

    def __post_init__(self) -> None:
        super().__post_init__()
        require_kind("SymmetricHamiltonJacobi", self.kind)
        highest = HIGHEST[self.kind]
        if type(self.order) is not int or self.order % 2 or not 2 <= self.order <= highest:
            raise InvalidInput(
                f"SymmetricHamiltonJacobi: order is an even number from 2 to {highest}, of kind "
                f"{self.kind!r}; got {self.order!r}"
            )

    @cached_property
    def halves(self) -> tuple[HamiltonJacobi, HamiltonJacobi]:
        """The method and its adjoint."""
        return HamiltonJacobi(self.order - 1, kind=self.kind), HamiltonJacobi(self.order - 1, True, self.kind)

    @property
    def name(self) -> str:
        return "Symmetric " + HamiltonJacobi(self.order, kind=self.kind).name

    def require(self, system: Any) -> None:
        self.halves[0].require(system)

    def step(self, system: Any, t: float, state: CanonicalState, h: float) -> CanonicalState:
        """Half a step by each of the halves, the second adjoint to the first."""
        first, second = self.halves
        middle = first.step(system, t, state, 0.5 * h)
        return second.step(system, t + 0.5 * h, middle, 0.5 * h)


# ---------------------------------------------------------------------- kinds

HIGHEST = {"qP": ORDERS[1], "qQ": 4, "pP": 4}
"""The highest order of a kind: those that start from a Legendre transform take longer to compile."""

FOLDS = {
    "qP": "",
    "qQ": ", or old and new position are conjugate points, which no generating function of (q, Q) joins",
    "pP": ", or the force does not tell positions apart here, as where d2H/dq2 changes its sign",
}

MEANS = {
    "qQ": "momentum found whose velocity is the mean velocity of the step, (q - Q)/h",
    "pP": "position found whose force is the mean force of the step, (p - P)/h",
}

DEGENERATE = {
    "qQ": "a generating function of (q, Q) needs velocities that tell momenta apart, and d2H/dp2 of {!r} is singular",
    "pP": "a generating function of (p, P) needs forces that tell positions apart, and d2H/dq2 of {!r} is singular",
}


def require_kind(name: str, kind: Any) -> None:
    """Refuse a kind that there is not."""
    if kind == "Qp":
        raise InvalidInput(
            f"{name}: kind 'Qp', of the old q and the new p, is the adjoint of 'qP': HamiltonJacobi(adjoint=True)"
        )
    if kind not in KINDS:
        raise InvalidInput(
            f"{name}: kind is one of {', '.join(map(repr, KINDS))}, capitals for the old state; got {kind!r}"
        )


def _regular(slope: Mat) -> bool:
    """Whether the matrix has an inverse, in units in which its rows can be compared."""
    import numpy as np

    m = np.array(slope, dtype=float)
    sizes = np.linalg.svd(m, compute_uv=False)
    return bool(np.isfinite(sizes).all() and sizes[-1] > 1e-13 * sizes[0])


def _polynomial(terms: list[Vec]) -> Vec:
    """The vector of series that end with the last of the terms."""
    return vec(*[Series(*[term[i] for term in terms]) for i in range(len(terms[0]))])


def _term(k: int, terms: list[Vec]) -> Vec:
    """The coefficient of e^k in a + e b + e^2 c + ..."""
    return vec(*[c[k] for c in collected(terms[: k + 1])])
