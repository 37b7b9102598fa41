"""Taylor series methods: the motion as a power series in time, in a chart of the group."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..errors import InvalidInput
from ..formulas import Vec, derivative, exp, log, plain, record, sqrt, vec, vectors, where
from ..formulas.numbers.bases import InMemory
from ..formulas.numbers.products import Products
from ..formulas.numbers.series import Series, SeriesInMemory
from ..formulas.sites import mean, met_through
from ..groups.bernoulli import TERMS
from ..groups.lie_algebra import sided
from ..groups.retractions import Cayley, Exponential, Retraction
from ..systems.system import System, lies_in_memory
from .method import LEAST, Method, larger, mean_square_of_parts
from .motion_series import begun, series
from .rkmk import TrialStep

ORDERS = 2, 30
"""The lowest order and the highest one."""

SAFETY = 0.8
"""A step is so much of the one whose last terms would be as large as the tolerance."""
PARTS = 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625
LEAST_EXPECTED = 2.0 ** -sum(PARTS)
"""Binary logarithms of the shares that others are products of; and the product of them all."""
WHOLE = 0.999
"""A step that may be nearly as long as it was to be is made whole, lest a tiny one is left."""
NEAR = 0.1
"""A number that is zero counts with what it becomes in a tenth of the step to try; steps to try are
ten times the last one.
"""


@record
class Taylor(Method):
    """A Taylor series method: momenta stay on their coadjoint orbit and attitudes on the group,
    whatever the step and the order.

    Of the motion y(t), g = g_n tau(Omega(t)), it computes the power series in t up to t^order,
    exactly up to rounding,

        y' = xi(t, y) . y,   Omega' = dtau^-1_Omega xi(t, y)  (left-trivialised),   y(0) = y_n,  Omega(0) = 0,

    by running the formulas of system and group once with numbers that are series, and moves y_n and
    g_n by tau(Omega(h)).

    order : 2 to 30; on a rigid body 10 to 14 take about the same time for an error of 1e-12.
    retraction : coordinates of the chart, Cayley() or, on groups that have no Cayley map,
    Exponential() (up to order 14).  The polynomial Omega is the way of the step too: dense output
    has the order of the method.  Mu and g move by the same increment, so the spatial momentum and
    the Casimirs are kept to rounding.  The energy drifts.
    Formulas must be analytic along a step: a `where` on the state takes the side on which the step
    starts.

    Source: Jorba and Zou, A software package for the numerical integration of ODEs by means of
    high-order Taylor methods, Experimental Mathematics 14 (2005); Hairer, Lubich, Wanner, IV.8 (the
    equation for Omega).
    """

    shortens: ClassVar[bool] = True
    analytic: ClassVar[bool] = True

    order: int = 12
    retraction: Retraction = Cayley()

    def __post_init__(self) -> None:
        if type(self.order) is not int or not ORDERS[0] <= self.order <= ORDERS[1]:
            raise InvalidInput(f"Taylor: order is a whole number from {ORDERS[0]} to {ORDERS[1]}; got {self.order!r}")
        super().__post_init__()
        highest = TERMS + 2
        if isinstance(self.retraction, Exponential) and self.order > highest:
            raise InvalidInput(
                f"Taylor: with Exponential() the order is at most {highest}, with Cayley() "
                f"{ORDERS[1]}; got {self.order}"
            )

    @property
    def name(self) -> str:
        """Taylor, the order, and a retraction that is not Cayley()."""
        chart = "" if isinstance(self.retraction, Cayley) else f" ({type(self.retraction).__name__})"
        return f"Taylor{self.order}{chart}"

    def step(self, system: System, t: float, state: Any, h: float) -> Any:
        """One step in the chart at the state."""
        return system.displaced(self.retraction, state, total(self._terms(system, t, state, h)))

    def _terms(self, system: System, t: float, state: Any, h: float) -> tuple[Vec, ...]:
        """Omega_1, ..., Omega_order: along the step Omega = sum_k s^k Omega_k, 0 <= s <= 1."""
        start = plain(system.essential_part(state))
        if lies_in_memory(system.group):
            return self._terms_in_memory(system, t, start, h)
        products = Products()
        y = Series.unknown(start, products)
        time: Any = Series(t, h).among(products)
        xi = system.rate(time, y)
        omega = Series.unset(xi, products)
        at_zero = vec(*[Series() for _ in xi])
        # dtau_0 = 1: this is xi . y
        rates = derivative(lambda v: system.displaced(self.retraction, y, v), at_zero, xi)
        slope = self._slope(system, omega, xi)
        Series.follow(start, y, rates, h)
        for unknown, rate in zip(omega, slope):
            Series.grown(unknown, rate, h)
        orders = range(1, self.order + 1)
        coefficients = tuple([vec(*[Series.coefficient(x, k) for x in omega]) for k in orders])
        met_through(self.order - 1)
        return coefficients

    def _terms_in_memory(self, system: System, t: float, start: Any, h: float) -> tuple[Vec, ...]:
        """The terms where vectors and matrices are those of series."""
        y = SeriesInMemory.at(start)
        time: Any = Series(t, h)
        xi = series(system.rate(time, y))
        omega = begun(0.0 * xi.head)
        rates, slope = system.moving(y, xi), self._slope(system, omega, xi)
        SeriesInMemory.continued(y, rates, h)
        omega.grow(slope, h)
        return tuple([omega.coefficient_of(k) for k in range(1, self.order + 1)])

    def _slope(self, system: System, omega: Vec, xi: Vec) -> Vec:
        """dtau^-1_Omega xi; for the exponential its series, of which later terms have no part in the order."""
        place = sided(omega, system.side)
        if isinstance(self.retraction, Exponential):
            return system.group.algebra.dexp_inv_series(place, xi, self.order - 2)
        return self.retraction.dtau_inv(system.group, place, xi)

    # ---------------------------------------------------------------- adaptive steps

    @property
    def error_order(self) -> int:
        """The power of h with which the error estimate of a step goes to zero."""
        return self.order

    @property
    def dense_order(self) -> int:
        """The order of accuracy between the steps: that of the method."""
        return self.order

    @property
    def curve_terms(self) -> int:
        """The number of coefficients of the polynomial Omega(s) of a step."""
        return self.order

    def trial(
        self, system: System, t: float, state: Any, first: Vec, h: float, rtol: float, atol: float, dense: bool
    ) -> TrialStep:
        """One step as long as its last two terms allow, at most h, and with the way there if it is
        `dense`.

        With e_k the root mean square of what Omega_k changes, over atol + rtol |what it changes|,
        the step for an error of 1 is h/r, r = max(e_p^(1/p), e_(p-1)^(1/(p-1))), and the error of
        the step h is max(e_p, e_(p-1)).  The terms of a step s h are s^k Omega_k: they need not be
        computed again, so no step is rejected.  The velocity is passed on as it came; no step needs
        it.
        """
        p, terms = self.order, self._terms(system, t, state, h)
        moved, size = system.variation(state, terms[0])
        if isinstance(moved[0], InMemory):
            sizes = tuple([larger(s, abs(NEAR * c)) for c, s in zip(moved, size)])
            before, last = (
                mean_square_of_parts(system.variation(state, term)[0], sizes, rtol, atol) for term in terms[p - 2 :]
            )
            return self._shortened(system, state, first, terms, before, last, dense)
        weights = [1.0 / (atol + rtol * max(s, abs(NEAR * c)) + LEAST) for c, s in zip(moved, size)]
        before, last = (mean_square(weights, system.variation(state, term)[0]) for term in terms[p - 2 :])
        return self._shortened(system, state, first, terms, before, last, dense)

    def _shortened(
        self, system: System, state: Any, first: Vec, terms: tuple[Vec, ...], before: float, last: float, dense: bool
    ) -> TrialStep:
        """The step as long as the mean squares of its last two terms allow."""
        p = self.order
        share = shortened(last, before, p)
        share = where(share < WHOLE, share, 1.0)
        powers = [share]
        for k in range(2, p + 1):  # each of two of half its exponent: no long chain of products
            powers.append(powers[k // 2 - 1] * powers[k - k // 2 - 1])
        curve = tuple([power * term for power, term in zip(powers, terms)])
        new = system.displaced(self.retraction, state, total(curve))
        return TrialStep(new, first, sqrt(max(last, before)), curve if dense else (), share)


def shortened(last: float, before: float, p: int) -> float:
    """SAFETY over the larger of last^(1/2p) and before^(1/(2p-2)), of mean squares of terms, at most 1.

    To a hundredth, as no step needs more, and without logarithms; of a share much below the tenth
    that is expected with them.
    """
    share = min(_nearly(last, 2 * p), _nearly(before, 2 * p - 2), 1.0)
    if share < LEAST_EXPECTED:
        share = SAFETY * exp(-max((0.5 / p) * log(last), (0.5 / (p - 1.0)) * log(before)))
    return share


def _nearly(x: float, n: int) -> float:
    """SAFETY/x^(1/n): a product of 2^-2, 2^-1, ..., 2^-1/16, as far as x exceeds their powers, and
    between two neighbours the powers lie on a chord.
    """
    x, s = (1.0 / SAFETY) ** n * x, 1.0
    for part in PARTS:
        beyond = x > 2.0 ** (n * part)
        s, x = where(beyond, 2.0**-part * s, s), where(beyond, 2.0 ** (-n * part) * x, x)
    slope = (1.0 - 2.0 ** -PARTS[-1]) / (2.0 ** (n * PARTS[-1]) - 1.0)
    return s * ((1.0 + slope) - slope * x)


def mean_square(weights: Sequence[float], x: Vec) -> float:
    """The mean square of the components of a vector times their weights; of many sites of all."""
    return mean(vectors.sum([(w * a) * (w * a) for w, a in zip(weights, x)]) * (1.0 / len(x)))


def total(terms: Sequence[Vec]) -> Vec:
    """The sum of the terms: of the first half from its last to its first, and of the small rest as
    they come, so that nothing waits for the last one but two additions.
    """
    if len(terms) == 1:
        return terms[0]
    half = len(terms) // 2
    first_half, second_half = terms[half - 1], terms[half]
    for k in range(half - 2, -1, -1):
        first_half = first_half + terms[k]
    for k in range(half + 1, len(terms)):
        second_half = second_half + terms[k]
    return first_half + second_half
