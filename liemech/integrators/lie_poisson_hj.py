"""Lie-Poisson Hamilton-Jacobi methods: symplectic steps of higher order from a generating function of the momentum."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import InvalidInput
from ..groups.lie_group import LieGroup
from ..native import Mat, Vec, derivative, dot, gradient, identity_matrix, jacobian, norm, record, vec, vectors
from ..retractions import Exponential, Retraction
from ..solvers import newton
from ..systems.lie_poisson import BodyState
from .implicit import Implicit, Memory, extrapolated
from .variational import weight

ORDERS = 2, 4
"""With the first term of the generating function, and with the second one."""


@record
class LiePoissonHamiltonJacobi(Implicit):
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
        super().__post_init__()
        if type(self.order) is not int or self.order not in ORDERS:
            raise InvalidInput(f"{type(self).__name__}: order is 2 or 4; got {self.order!r}")

    @property
    def name(self) -> str:
        """The method, its order and the retraction."""
        return f"Hamilton-Jacobi {self.order} ({type(self.retraction).__name__})"

    # ---------------------------------------------------------------- one step

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """p - mu = 0."""
        return 0.0 * state.mu

    def step(self, system: Any, t: float, state: Memory, h: float) -> Memory:
        """Solve for p, whose difference to mu is extrapolated, then move momentum and attitude by x(p)."""
        p, x = self.solution(system, h, state.mu, state.mu + extrapolated(*self.past(state)))
        return self.after(state, system.moved(self.retraction, self.observe(state), x), p - state.mu)

    def solution(self, system: Any, h: float, mu: Vec, guess: Vec) -> tuple[Vec, Vec]:
        """The p and x = ds/dp that fit mu."""
        p, size, enough, folded = newton(lambda p: self.equation(system, h, mu, p), guess, dot(mu, mu))
        x = self.displacement(system, h, p)
        if not size <= enough:
            raise self.unsolved(h, size, enough, f", |x| = {norm(x):.2g}")
        if folded or not self.retraction.is_chart(system.group, x):
            raise self.out_of_chart(h, f"|x| = {norm(x):.2g}")
        return p, x

    def equation(self, system: Any, h: float, mu: Vec, p: Vec) -> tuple[Vec, Mat, float]:
        """The mismatch of p and mu, its derivative, and the factor of its square."""
        r, by_p, by_x = self.retraction.mismatch(system.group, self.displacement(system, h, p), p, mu)
        slope = by_x @ jacobian(lambda q: self.displacement(system, h, q), p)
        own = by_p if isinstance(by_p, vectors.Mat) else by_p * identity_matrix(len(p))
        return r, slope + own, weight(by_p)

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
