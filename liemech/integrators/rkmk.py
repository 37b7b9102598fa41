"""Runge-Kutta-Munthe-Kaas methods: a Runge-Kutta method for the velocity in the algebra."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import InvalidInput, OrderWarning, warn
from ..formulas import Record, Vec, dot, gradient, plain, record, sqrt, vec, where
from ..formulas.numbers.bases import InMemory
from ..formulas.numbers.sizes import one_norms
from ..formulas.numbers.transposes import ruled
from ..groups.bernoulli import BERNOULLI, TERMS
from ..groups.lie_algebra import sided
from ..groups.retractions import Exponential, Retraction
from ..groups.vector_space import VectorSpace
from ..solvers import fixed_point
from ..systems.system import System
from ..tableaus.butcher import BY_ORDER
from ..tableaus.tableau import ButcherTableau
from ..tableaus.trees import Row
from .method import LEAST, Method, larger, mean_square_of_parts
from .orders import set_tableau


@record
class TrialStep(Record):
    """A step on probation: the new state and the velocity there, the error over the tolerance,
    and `curve`, the coefficients of the polynomial between both ends (dense output).

    share : the part of the step that was made, less than 1 only of methods that shorten theirs.
    """

    state: Any
    velocity: Vec
    error: float
    curve: tuple[Vec, ...]
    share: float = 1.0


@record
class RKMK(Method):
    """A Runge-Kutta-Munthe-Kaas method: momenta stay on their coadjoint orbit and attitudes on the
    group, whatever the step.

    With g = g_n tau(Omega), mu = Ad*_tau(Omega) mu_n the motion is  Omega' = dtau^-1_Omega xi(t, mu)  (left-trivialised), and the
    tableau solves it from Omega = 0:

        Omega_i = h sum_j a_ij k_j,   k_i = dtau^-1_Omega_i xi(t + c_i h, Ad*_tau(Omega_i) mu_n),
        mu_n+1 = Ad*_tau(Omega) mu_n,   g_n+1 = g_n tau(Omega),   Omega = h sum_j b_j k_j.

    order : of the tableau chosen, 1 to 8; or give a `tableau`, explicit or implicit, of
    `liemech.tableaus` or your own.
    truncation : cut the series of dexp^-1 after ad^truncation; "closed" for its closed form.  The
    default, order - 2, is enough; less lowers the order, which an OrderWarning says.
    retraction : coordinates of the chart, Exponential() or, with its closed differential, Cayley()
    or your own.  Mu and g move by the same increment, so the spatial momentum and the Casimirs are
    kept to rounding.  The energy drifts.

    Source: Munthe-Kaas, Appl. Numer. Math. 29 (1999); Hairer, Lubich, Wanner, IV.8.2, algorithm
    8.4.
    """

    timed: ClassVar[bool] = True

    order: int = 4
    tableau: ButcherTableau = None  # type: ignore[assignment]  # None: the one of this order
    truncation: int | str = None  # type: ignore[assignment]  # None: order - 2, or closed if there is no series
    retraction: Retraction = Exponential()

    def __post_init__(self) -> None:
        super().__post_init__()
        set_tableau(self, ButcherTableau, BY_ORDER)
        truncation: Any = self.truncation
        if truncation is None:
            series = isinstance(self.retraction, Exponential)
            object.__setattr__(self, "truncation", max(self.order - 2, 0) if series else "closed")
        self._check_truncation(self.truncation)

    def _check_truncation(self, q: int | str) -> None:
        if q == "closed":
            return
        if not (type(q) is int and 0 <= q <= TERMS):
            raise InvalidInput(f'RKMK: truncation is a number of terms from 0 to {TERMS} or "closed"; got {q!r}')
        if not isinstance(self.retraction, Exponential):
            raise InvalidInput(
                f"RKMK: {self.retraction!r} has a closed differential and no series to cut; leave truncation out"
            )
        missing = next((k for k in range(q + 1, len(BERNOULLI)) if BERNOULLI[k] != 0.0), len(BERNOULLI))
        if missing + 1 < self.order:  # ad_Omega^k is of order h^k
            warn(
                f"RKMK: with truncation {q} the method is of order {missing + 1}, not "
                f"{self.order}; that takes {self.order - 2}",
                OrderWarning,
            )

    def symmetric_on(self, system: Any) -> bool:
        """Where everything commutes, on vector spaces, if the tableau is symmetric; the midpoint rule is everywhere."""
        if not self.tableau.symmetric:
            return False
        if system is None or isinstance(system.group, VectorSpace):
            return True
        return self.tableau.stages == 1 and isinstance(self.retraction, Exponential)

    @property
    def name(self) -> str:
        """RKMK and the order, and where it is another one than that of `RKMK(order)`: its tableau,
        its retraction, and where the series is cut.
        """
        chosen = self.tableau == BY_ORDER.get(self.order)
        series = isinstance(self.retraction, Exponential)
        deviations = [] if chosen else [self.tableau.name]
        if not series:
            deviations.append(type(self.retraction).__name__)
        elif self.truncation == "closed":
            deviations.append("closed")
        elif self.truncation != max(self.order - 2, 0):
            deviations.append(f"ad^{self.truncation}")
        name = f"RKMK{self.order}" if chosen else "RKMK"
        return f"{name} ({', '.join(deviations)})" if deviations else name

    def step(self, system: System, t: float, state: Any, h: float) -> Any:
        """One step in the chart at the state."""
        start, tableau = plain(system.essential_part(state)), self.tableau.bare
        slopes = self._slopes(tableau, system, t, start, system.rate(t, start), h)
        return system.displaced(self.retraction, state, combination(tableau.b, slopes, h))

    def _slopes(self, tableau: ButcherTableau, system: System, t: float, start: Any, first: Vec, h: float) -> list[Vec]:
        """The slopes k_i of Omega at the stages; `first` is the velocity at the start.

        Implicit stages are iterated to rounding.  Raises NoConvergence.
        """
        if tableau.explicit:
            return self._more(tableau.A, tableau.c, [], system, t, start, first, h)
        guess = [first for _ in tableau.b]
        return fixed_point(lambda slopes: self._sweep(tableau, system, t, start, first, h, slopes), guess, self, h)

    def _sweep(
        self, tableau: ButcherTableau, system: System, t: float, start: Any, first: Vec, h: float, slopes: list[Vec]
    ) -> tuple[list[Vec], Vec, Vec]:
        """Every slope anew, each from the new ones before it; their change and their size, in each unit apart."""
        blocks = system.unit_blocks
        change = size = vec(*[0.0 for _ in blocks])
        for i, (row, c) in enumerate(zip(tableau.A, tableau.c)):
            omega, old = combination(row, slopes, h), slopes[i]
            new = first if omega is None else self.slope(system, t + c * h, start, omega)
            slopes = [*slopes[:i], new, *slopes[i + 1 :]]
            change, size = change + one_norms(new - old, blocks), size + one_norms(new, blocks)
        return slopes, change, size

    def _more(
        self,
        A: tuple[Row, ...],
        nodes: Row,
        slopes: list[Vec],
        system: System,
        t: float,
        start: Any,
        first: Vec,
        h: float,
    ) -> list[Vec]:
        """The slopes, and those that explicit rows of coefficients make of them."""
        for row, c in zip(A, nodes):
            omega = combination(row, slopes, h)
            slopes = [*slopes, first if omega is None else self.slope(system, t + c * h, start, omega)]
        return slopes

    # ---------------------------------------------------------------- adaptive steps

    @property
    def error_order(self) -> int:
        """The power of h with which the error estimate of a step goes to zero; 0 if there is none."""
        return self.tableau.error_order

    @property
    def dense_order(self) -> int:
        """The order of accuracy between the steps."""
        return self.tableau.interpolant_order or min(self.order, 3)

    @property
    def curve_terms(self) -> int:
        """How many coefficients the polynomial Omega(theta) of a step has."""
        return len(self.tableau.interpolant[0]) if self.tableau.interpolant else 3

    def trial(
        self, system: System, t: float, state: Any, first: Vec, h: float, rtol: float, atol: float, dense: bool
    ) -> TrialStep:
        """One step with an estimate of its error, h sum_j (b_j - b^_j) k_j in the algebra, and with
        the way there if it is `dense`.

        The error is the root mean square of what such a displacement changes, over atol + rtol
        |what it changes|.
        """
        tableau, start = self.tableau, system.essential_part(state)
        slopes = self._slopes(tableau, system, t, start, first, h)
        omega = combination(tableau.b, slopes, h)
        new = system.displaced(self.retraction, state, omega)
        velocity = system.rate(t + h, system.essential_part(new))
        squares = [system.mean_over_sites(x) for x in self.squares(system, state, new, slopes, h, rtol, atol)]
        if dense and tableau.interpolant:
            slopes = self._more(tableau.A_extra, tableau.c_extra, slopes, system, t, start, first, h)
        curve = self.curve(system, slopes, first, omega, velocity, h) if dense else ()
        return TrialStep(new, velocity, self.error_by(squares), curve)

    def squares(
        self, system: System, state: Any, new: Any, slopes: Any, h: float, rtol: float, atol: float
    ) -> list[float]:
        """The mean squares of the differences from the embedded solutions of the tableau, over the tolerance."""
        tableau = self.tableau
        embedded = [tableau.b_hat, tableau.b_low] if tableau.b_low else [tableau.b_hat]
        return [mean_square(system, state, new, _difference(tableau.b, b, slopes, h), rtol, atol) for b in embedded]

    def error_by(self, squares: Any) -> float:
        """The error over the tolerance, by these mean squares."""
        error = squares[0]
        if self.tableau.b_low:
            error = where(error > 0.0, error * error / (error + 0.01 * squares[1]), 0.0)
        return sqrt(error)

    def curve(
        self, system: System, slopes: list[Vec], first: Vec, omega: Vec, velocity: Vec, h: float
    ) -> tuple[Vec, ...]:
        """Omega(theta) = theta p_1 + theta^2 p_2 + ... along the step: of the tableau, or a cubic through both ends."""
        tableau = self.tableau
        if tableau.interpolant:
            return tuple([combination(weights, slopes, h) for weights in zip(*tableau.interpolant)])
        end = h * self.retraction.dtau_inv(system.group, sided(omega, system.side), velocity)
        return h * first, 3.0 * omega - (2.0 * h * first + end), (h * first + end) - 2.0 * omega

    def slope(self, system: System, t: float, start: Any, omega: Vec) -> Vec:
        """dtau^-1_Omega xi(t, the start displaced by tau(Omega)), trivialised like the velocity."""
        xi = system.rate(t, system.displaced(self.retraction, start, omega))
        return self.in_chart(system, omega, xi)

    def in_chart(self, system: System, omega: Vec, xi: Vec) -> Vec:
        """dtau^-1_Omega xi, in closed form or by its series."""
        return ruled(self._in_chart, self._in_chart_back, None, (system,), omega, xi)

    def _in_chart(self, system: System, omega: Vec, xi: Vec) -> Vec:
        place = sided(omega, system.side)
        if isinstance(self.truncation, str):
            return self.retraction.dtau_inv(system.group, place, xi)
        return system.group.algebra.dexp_inv_series(place, xi, self.truncation)

    def _in_chart_back(self, system: System, omega: Vec, xi: Vec, w: Vec) -> Any:
        slope = self._in_chart
        by_omega = gradient(lambda x: dot(w, slope(system, x, xi)), omega)
        return (by_omega, gradient(lambda x: dot(w, slope(system, omega, x)), xi)), []

    def __repr__(self) -> str:
        parts = [f"order={self.order}"]
        if self.tableau != BY_ORDER.get(self.order):
            parts = [f"tableau={self.tableau!r}"]
        if self.truncation != max(self.order - 2, 0):
            parts.append(f"truncation={self.truncation!r}")
        if self.retraction != Exponential():
            parts.append(f"retraction={self.retraction!r}")
        return f"RKMK({', '.join(parts)})"


def combination(weights: Row, slopes: Any, h: float = 1.0) -> Any:
    """h sum_j weights_j slopes_j over the weights that are not zero, of vectors or matrices; None if all are."""
    total: Any = None
    for w, k in zip(weights, slopes):
        if w != 0.0:
            total = (h * w) * k if total is None else total + (h * w) * k
    return total


def _difference(b: Row, b_hat: Row, slopes: list[Vec], h: float) -> Vec:
    """h sum_j (b_j - b^_j) k_j."""
    return combination(tuple([x - y for x, y in zip(b, b_hat)]), slopes, h)


def mean_square(system: System, state: Any, new: Any, off: Vec, rtol: float, atol: float) -> float:
    """The mean square of what a displacement changes, over the tolerance; of many sites that of one."""
    (change, before), (_, after) = system.variation(state, off), system.variation(new, off)
    if isinstance(change[0], InMemory):
        largest = tuple([larger(a, b) for a, b in zip(before, after)])
        return mean_square_of_parts(change, largest, rtol, atol)
    total = 0.0
    for c, a, b in zip(change, before, after):
        ratio = c / (atol + rtol * max(a, b) + LEAST)
        total = total + ratio * ratio
    return total / len(change)
