"""The covariant variational method: a discrete action principle on a Lie group."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import InvalidType, NoConvergence, OutsideChart
from ..native import Element, Mat, Record, Vec, dot, mat, norm, record, sqrt, vec, vectors
from ..retractions import Exponential, Retraction
from ..solvers import LIMIT, TOLERANCE, beyond_fold, correction
from ..systems.lie_poisson import BodyState
from .method import Method


@record
class Memory(Record):
    """What the method carries from step to step: the state at the node and the displacements h xi of the last three intervals."""

    mu: Vec
    g: Element | None
    last: Vec
    last_1: Vec
    last_2: Vec


@record
class CovariantVariational(Method):
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

    def __post_init__(self) -> None:
        given: Any = self.retraction
        if not isinstance(given, Retraction):
            got = f"got {given!r}"
            raise InvalidType(f"{type(self).__name__}: retraction must be Exponential(), Cayley() or one of yours; {got}")

    @property
    def name(self) -> str:
        """Algorithm 1 and the retraction."""
        return f"Algorithm 1 ({type(self.retraction).__name__})"

    def require(self, system: Any) -> None:
        """A system with a Lagrangian, on a group that has the retraction."""
        super().require(system)
        self.retraction.require(system.group)

    def start(self, system: Any, state: BodyState, h: float) -> Memory:
        """The first guess is the velocity at the start, J^-1 mu."""
        displacement = h * system.velocity(state.mu)
        return Memory(state.mu, state.g, displacement, displacement, displacement)

    def observe(self, memory: Memory) -> BodyState:
        """Momentum and attitude at the node."""
        return BodyState(memory.mu, memory.g)

    def past(self, memory: Memory) -> tuple[Vec, Vec, Vec]:
        """The last three displacements."""
        return memory.last, memory.last_1, memory.last_2

    def resume(self, system: Any, state: BodyState, past: tuple[Vec, Vec, Vec], h: float) -> Memory:
        """Momentum and attitude from elsewhere, displacements to extrapolate from the past."""
        return Memory(state.mu, state.g, *past)

    def step(self, system: Any, t: float, state: Memory, h: float) -> Memory:
        """Solve for the displacement of the interval from the extrapolated one, then move momentum and attitude by it."""
        group, guess = system.group, 3.0 * state.last + (state.last_2 - 3.0 * state.last_1)
        new = self.displacement(system, h, state.mu, guess)
        mu = self.retraction.tau_Ad_star(group, new, state.mu)
        g = None if state.g is None else self.retraction.compose_tau(group, state.g, new)
        return Memory(mu, g, new, state.last, state.last_1)

    def displacement(self, system: Any, h: float, mu: Vec, guess: Vec) -> Vec:
        """The x = h xi whose momentum dl/dxi fits mu: test the mismatch against the data, then apply its correction once more."""
        x, rate = guess, 1.0 / h
        goal = TOLERANCE * TOLERANCE * dot(mu, mu)
        size = enough = goal
        folded = False
        for _ in range(LIMIT):
            xi = rate * x
            r, by_p, by_x = self.retraction.mismatch(system.group, x, system.lagrangian.momentum(xi), mu)
            jacobian = with_inertia(by_x, _times(by_p, rate * system.lagrangian.hessian(xi)))
            x, folded = x - correction(jacobian, r), beyond_fold(jacobian, rate)
            size, enough = dot(r, r), (1.0 if isinstance(by_p, vectors.Mat) else by_p * by_p) * goal
            if size <= enough:
                break
        if not size <= enough:
            raise NoConvergence(
                f"{self!r}: Newton's method did not converge in {LIMIT} iterations: "
                f"mismatch {sqrt(size):.1e}, wanted {sqrt(enough):.1e}, h|xi| = {norm(x):.2g}. "
                f"The step h = {h:g} is too large for this motion; try {0.25 * h:g}"
            )
        if folded or not self.retraction.is_chart(system.group, x):
            raise OutsideChart(
                f"{self!r}: the step left the chart, h|xi| = {norm(x):.2g}: what solves its equation there is no "
                f"continuation of the motion. The step h = {h:g} is too large; try {0.25 * h:g}"
            )
        return x


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
