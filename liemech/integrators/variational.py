"""The covariant variational method: a discrete action principle on a Lie group."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import NoConvergence
from ..native import Mat, Vec, dot, mat, norm, plain, record, vec, vectors
from ..retractions import Exponential, Retraction
from ..solvers import newton
from ..systems.lie_poisson import BodyState
from .implicit import Implicit, Memory, extrapolated
from .solvability import followed, largest_impulse, smallest_limit, turns_freely


@record
class CovariantVariational(Implicit):
    """Algorithm 1: the discrete Euler-Poincare equations of the action sum h l(xi_i) with g_i+1 = g_i tau(h xi_i).

        (dtau^-1_{h xi_i})* dl/dxi(xi_i) = mu_i            solved for h xi_i by Newton's method
        mu_i+1 = Ad*_tau(h xi_i) mu_i,   g_i+1 = g_i tau(h xi_i)

    retraction : Cayley() has a solution for every step size, Exponential() is the more accurate one.
    mu belongs to the nodes, xi to the intervals between them: J xi is a midpoint momentum, an O(h) away from mu.
    Order 2, symmetric; spatial momentum, Casimirs and the Lie-Poisson bracket are kept to rounding, the energy oscillates
    without drift.  Raises NoConvergence if the step is too large for the equation to be solved.

    Source: Geometric Numerical Methods with Lie Groups, algorithm 1 (with the factor h of its first line corrected);
    Bou-Rabee and Marsden, Found. Comput. Math. 9 (2009); Marsden, Pekarsky, Shkoller, Nonlinearity 12 (1999).
    """

    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    order: ClassVar[int] = 2
    needs: ClassVar[tuple[str, ...]] = ("lagrangian",)

    retraction: Retraction = Exponential()

    @property
    def name(self) -> str:
        """Algorithm 1 and the retraction."""
        return f"Algorithm 1 ({type(self.retraction).__name__})"

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """The displacement at the velocity of the start, h J^-1 mu."""
        return h * system.velocity(state.mu)

    def step(self, system: Any, t: float, state: Memory, h: float) -> Memory:
        """Solve for the displacement of the interval from the extrapolated one, then move momentum and attitude by it."""
        x = self.displacement(system, h, plain(state.mu), extrapolated(*self.past(state)))
        return self.after(state, system.moved(self.retraction, self.observe(state), x), x)

    def displacement(self, system: Any, h: float, mu: Vec, guess: Vec) -> Vec:
        """The x = h xi whose momentum dl/dxi fits mu."""
        rate, square = 1.0 / h, dot(mu, mu)
        if turns_freely(system, self.retraction) and h * h * square > smallest_limit(system.lagrangian.inverse):
            limit = largest_impulse(system.lagrangian.inertia, self.retraction)
            if h * h * square > limit * limit:  # there may be several solutions, or none
                return self._followed(system, h, mu, limit)
        x, size, enough, folded = newton(lambda x: self.equation(system, rate, mu, x), guess, square, rate)
        if not size <= enough:
            raise self.unsolved(h, size, enough, f", h|xi| = {norm(x):.2g}")
        if folded or not self.retraction.is_chart(system.group, x):
            raise self.out_of_chart(h, f"h|xi| = {norm(x):.2g}")
        return x

    def _followed(self, system: Any, h: float, mu: Vec, limit: float) -> Vec:
        """The displacement that has grown out of zero with the step; it depends on h mu alone."""
        rate = 1.0 / h
        x, reached = followed(
            lambda s, x: self.equation(system, rate, s * mu, x), lambda x: self.retraction.is_chart(system.group, x), 0.0 * mu, rate
        )
        if reached < 1.0:
            raise NoConvergence(
                f"{self!r}: the step h = {h:g} is too large for this momentum, h|mu| = {abs(h) * norm(mu):.3g}: the solution that "
                f"grows out of h = 0 ends at h = {reached * h:.3g}, where h|xi| = {norm(x):.2g}; any other solution is no "
                f"continuation of the motion. Every direction has a solution up to h|mu| = {limit:.3g}: try {limit / norm(mu) * (1.0 if h > 0.0 else -1.0):.3g}"
            )
        return x

    def equation(self, system: Any, rate: float, mu: Vec, x: Vec) -> tuple[Vec, Mat, float]:
        """The mismatch of dl/dxi and mu, its derivative, and the factor of its square."""
        xi = rate * x
        r, by_p, by_x = self.retraction.mismatch(system.group, x, system.lagrangian.momentum(xi), mu)
        jacobian = with_inertia(by_x, _times(by_p, rate * system.lagrangian.hessian(xi)))
        return r, jacobian, weight(by_p)


def weight(by_p: float | Mat) -> float:
    """What the square of a mismatch is to be compared with, over that of the momentum: it may be a multiple of r."""
    return 1.0 if isinstance(by_p, vectors.Mat) else by_p * by_p


def _times(by_p: float | Mat, hessian: Mat | Vec) -> Mat | Vec:
    """dr/dp d2l: a Vec stands for a diagonal matrix, a number for a multiple of the unit matrix."""
    if not isinstance(by_p, vectors.Mat):
        return by_p * hessian
    return by_p @ hessian if isinstance(hessian, vectors.Mat) else mat(*[row * hessian for row in by_p])


def with_inertia(m: Mat, inertia: Mat | Vec) -> Mat:
    """m + inertia, a Vec standing for a diagonal matrix."""
    if isinstance(inertia, vectors.Mat):
        return m + inertia
    return mat(*[vec(*[m[i, j] + inertia[i] if i == j else m[i, j] for j in range(len(m))]) for i in range(len(m))])
