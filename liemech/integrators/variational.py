"""The covariant variational method: a discrete action principle on a Lie group."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import InvalidInput, NoConvergence
from ..native import Mat, Record, Vec, norm, record
from ..retractions import Exponential, Retraction
from ..solvers import LIMIT, TOLERANCE, correction
from ..systems.lie_poisson import BodyState
from .method import Method


@record
class Memory(Record):
    """What the method carries from step to step: the state at the node and the velocities of the last three intervals."""

    mu: Vec
    g: Mat | None
    xi: Vec
    xi_1: Vec
    xi_2: Vec


@record
class CovariantVariational(Method):
    """Algorithm 1: the discrete Euler-Poincare equations of the action sum h l(xi_i) with g_i+1 = g_i tau(h xi_i).

        (dtau^-1_{h xi_i})* dl/dxi(xi_i) = mu_i            solved for xi_i by Newton's method
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
    needs: ClassVar[tuple[str, ...]] = ("group", "lagrangian")

    retraction: Retraction = Exponential()

    def __post_init__(self) -> None:
        if not isinstance(self.retraction, Retraction):
            raise InvalidInput(f"CovariantVariational: retraction must be Exponential(), Cayley() or one of yours; got {self.retraction!r}")

    @property
    def name(self) -> str:
        """Algorithm 1 and the retraction."""
        return f"Algorithm 1 ({type(self.retraction).__name__})"

    def start(self, system: Any, state: BodyState, h: float) -> Memory:
        """The first guess is the velocity at the start, J^-1 mu."""
        xi = system.velocity(state.mu)
        return Memory(state.mu, state.g, xi, xi, xi)

    def observe(self, memory: Memory) -> BodyState:
        """Momentum and attitude at the node."""
        return BodyState(memory.mu, memory.g)

    def step(self, system: Any, t: float, state: Memory, h: float) -> Memory:
        """Solve for the velocity of the interval from the extrapolated one, then move momentum and attitude by the same increment."""
        guess = 3.0 * (state.xi - state.xi_1) + state.xi_2
        xi = self.solve(system, h, state.mu, guess)
        group, increment = system.group, h * xi
        mu = self.retraction.tau_Ad_star(group, increment, state.mu)
        g = None if state.g is None else group.compose(state.g, self.retraction.tau(group, increment))
        return Memory(mu, g, xi, state.xi, state.xi_1)

    def residual(self, system: Any, h: float, mu: Vec, xi: Vec) -> Vec:
        """(dtau^-1_{h xi})* dl/dxi - mu.  xi, mu : (dim,)."""
        return self.retraction.dtau_inv_dual(system.group, h * xi, system.lagrangian.momentum(xi)) - mu

    def jacobian(self, system: Any, h: float, xi: Vec) -> Mat:
        """Its derivative with respect to xi.  xi : (dim,), result : (dim, dim)."""
        p = system.lagrangian.momentum(xi)
        by_p, by_xi = self.retraction.dtau_inv_dual_derivatives(system.group, h * xi, p)
        inertia = system.lagrangian.hessian(xi)
        return (by_p * inertia if isinstance(inertia, Vec) else by_p @ inertia) + h * by_xi

    def solve(self, system: Any, h: float, mu: Vec, xi: Vec) -> Vec:
        """The velocity with residual zero: test the residual against the data, then apply its correction once more."""
        enough = TOLERANCE * norm(mu)
        size = enough
        iterations = 0
        while True:
            r = self.residual(system, h, mu, xi)
            xi = xi - correction(self.jacobian(system, h, xi), r)
            size = norm(r)
            iterations = iterations + 1
            if size <= enough or iterations >= LIMIT:
                break
        if not size <= enough:
            raise NoConvergence(
                f"{self!r}: Newton's method did not converge in {LIMIT} iterations: residual {size:.1e}, wanted {enough:.1e}, "
                f"h|xi| = {abs(h) * norm(xi):.2g}. The step h = {h:g} is too large for this motion; try {h / 4:g}"
            )
        return xi
