"""Lie-Poisson Hamilton-Jacobi methods: symplectic steps of higher order from a generating function of the momentum."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import InvalidInput, InvalidType, NoConvergence, OutsideChart
from ..groups.lie_group import LieGroup
from ..native import Element, Record, Vec, derivative, dot, gradient, identity_matrix, jacobian, norm, record, sqrt, vec, vectors
from ..retractions import Exponential, Retraction
from ..solvers import LIMIT, TOLERANCE, beyond_fold, correction
from ..systems.lie_poisson import BodyState
from .method import Method

ORDERS = 2, 4
"""With the first term of the generating function, and with the second one."""


@record
class Memory(Record):
    """What the method carries from step to step: the state at the node and p - mu of the last three steps."""

    mu: Vec
    g: Element | None
    last: Vec
    last_1: Vec
    last_2: Vec


@record
class LiePoissonHamiltonJacobi(Method):
    """Steps whose generating function s(p), of the second kind, solves the Lie-Poisson Hamilton-Jacobi equation to an order in h.

        s = h H + (h^3/6) s_3,   x = ds/dp,   (dtau^-1_x)* p = mu_i     solved for p by Newton's method
        mu_i+1 = Ad*_tau(x) mu_i,   g_i+1 = g_i tau(x)

    The Hamilton-Jacobi equation ds/dt = H((dtau^-1_x)* p), left-trivialised, with s = 0 at t = 0 gives s_3 by derivatives of H.

    order : 2, without s_3, or 4.  retraction : Exponential() serves every group and is the more accurate one.
    For every group and every Hamiltonian, also one that has no Lagrangian.  Where there is one, order 2 is CovariantVariational.
    Symmetric; spatial momentum, Casimirs and the Lie-Poisson bracket are kept to rounding, the energy oscillates
    without drift.  Raises NoConvergence or OutsideChart if the step is too large for the equation to be solved.

    Source: Ge and Marsden, Phys. Lett. A 133 (1988), 134; Channell and Scovel, Physica D 50 (1991), 80; Ferraro, de Leon, Marrero,
    Martin de Diego and Vaquero, Arch. Rational Mech. Anal. 226 (2017), 243.
    """

    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("hamiltonian",)

    order: int = 4
    retraction: Retraction = Exponential()

    def __post_init__(self) -> None:
        given: Any = self.retraction
        if type(self.order) is not int or self.order not in ORDERS:
            raise InvalidInput(f"{type(self).__name__}: order is 2 or 4; got {self.order!r}")
        if not isinstance(given, Retraction):
            got = f"got {given!r}"
            raise InvalidType(f"{type(self).__name__}: retraction must be Exponential(), Cayley() or one of yours; {got}")

    @property
    def name(self) -> str:
        """The method, its order and the retraction."""
        return f"Hamilton-Jacobi {self.order} ({type(self.retraction).__name__})"

    def require(self, system: Any) -> None:
        """A system with a Hamiltonian of the momentum alone, on a group that has the retraction."""
        super().require(system)
        self.retraction.require(system.group)

    # ---------------------------------------------------------------- one step

    def start(self, system: Any, state: BodyState, h: float) -> Memory:
        """The first guess is p = mu."""
        none = 0.0 * state.mu
        return Memory(state.mu, state.g, none, none, none)

    def observe(self, memory: Memory) -> BodyState:
        """Momentum and attitude at the node."""
        return BodyState(memory.mu, memory.g)

    def past(self, memory: Memory) -> tuple[Vec, Vec, Vec]:
        """The last three differences p - mu."""
        return memory.last, memory.last_1, memory.last_2

    def resume(self, system: Any, state: BodyState, past: tuple[Vec, Vec, Vec], h: float) -> Memory:
        """Momentum and attitude from elsewhere, differences p - mu to extrapolate from the past."""
        return Memory(state.mu, state.g, *past)

    def step(self, system: Any, t: float, state: Memory, h: float) -> Memory:
        """Solve for p from an extrapolated guess, then move momentum and attitude by x(p)."""
        group, guess = system.group, state.mu + (3.0 * state.last + (state.last_2 - 3.0 * state.last_1))
        p, x = self.solution(system, h, state.mu, guess)
        mu = self.retraction.tau_Ad_star(group, x, state.mu)
        g = None if state.g is None else self.retraction.compose_tau(group, state.g, x)
        return Memory(mu, g, p - state.mu, state.last, state.last_1)

    def solution(self, system: Any, h: float, mu: Vec, guess: Vec) -> tuple[Vec, Vec]:
        """The p and x = ds/dp that fit mu: test the mismatch against the data, then apply its correction once more."""
        group, p = system.group, guess
        goal = TOLERANCE * TOLERANCE * dot(mu, mu)
        size = enough = goal
        folded = False
        for _ in range(LIMIT):
            r, by_p, by_x = self.retraction.mismatch(group, self.displacement(system, h, p), p, mu)
            is_mat = isinstance(by_p, vectors.Mat)
            slope = by_x @ jacobian(lambda q: self.displacement(system, h, q), p)
            slope = slope + (by_p if is_mat else by_p * identity_matrix(len(p)))
            p, folded = p - correction(slope, r), beyond_fold(slope, 1.0)
            size, enough = dot(r, r), (1.0 if is_mat else by_p * by_p) * goal
            if size <= enough:
                break
        x = self.displacement(system, h, p)
        if not size <= enough:
            raise NoConvergence(
                f"{self!r}: Newton's method did not converge in {LIMIT} iterations: "
                f"mismatch {sqrt(size):.1e}, wanted {sqrt(enough):.1e}, |x| = {norm(x):.2g}. "
                f"The step h = {h:g} is too large for this motion; try {0.25 * h:g}"
            )
        if folded or not self.retraction.is_chart(group, x):
            raise OutsideChart(
                f"{self!r}: the step left the chart, |x| = {norm(x):.2g}: what solves its equation there is no "
                f"continuation of the motion. The step h = {h:g} is too large; try {0.25 * h:g}"
            )
        return p, x

    # ---------------------------------------------------------------- the generating function

    def displacement(self, system: Any, h: float, p: Vec) -> Vec:
        """The displacement of a step, x = ds/dp."""
        x = h * system.velocity(p)
        if self.order == 4:
            x = x + (h * h * h / 6.0) * gradient(lambda q: self.third(system, q), p)
        return x

    def third(self, system: Any, p: Vec) -> float:
        """s_3 = D^2H(p)[w, w]/4 + <p, c>, w = ad*_v p, v = dH(p): the second time derivative of H((dtau^-1_tv)* p) at 0.

        It consists of w/2, what moves p to first order whatever the map, and of c, what bends the map away from the exponential.
        """
        v = system.velocity(p)
        w = system.group.ad_star(v, p)
        s3 = 0.25 * dot(w, derivative(lambda q: system.velocity(q), p, w))
        return s3 if isinstance(self.retraction, Exponential) else s3 + dot(p, self._bend(system.group, v))

    def _bend(self, group: LieGroup, v: Vec) -> Vec:
        """c = (d/dt)^2 dtau^-1_tv v at 0, left-trivialised; zero for exp, where dexp^-1_tv v = v."""
        start = vec(*[0.0 for _ in v], *v)
        return derivative(lambda y: derivative(lambda z: self._carried(group, z), y, _onward(y)), start, _onward(start))

    def _carried(self, group: LieGroup, y: Vec) -> Vec:
        """dtau^-1_x v of y = (x, v)."""
        n = group.dim
        return self.retraction.dtau_inv(group, vec(*[y[i] for i in range(n)]), vec(*[y[i + n] for i in range(n)]), "left")


def _onward(y: Vec) -> tuple[float, ...]:
    """The direction in which (x, v) moves: x' = v, v' = 0."""
    n = len(y) // 2
    return (*[y[i + n] for i in range(n)], *(0,) * n)
