"""Lie-Poisson Hamilton-Jacobi methods: symplectic steps of higher order from a generating function
of the momentum.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...formulas import Mat, Vec, derivative, identity_matrix, jacobian, mat, norm, plain, record, vec, vectors
from ...formulas.sums import total
from ...groups.retractions import Exponential, Retraction
from ...groups.rigid.so3 import SO3Algebra
from ...integrators.implicit import Implicit
from ...integrators.memory import Memory, extrapolated
from ...integrators.motion_series import second_kind, velocity_at
from ...integrators.variational import weight
from ...solvers import TOLERANCE, newton
from ...systems.kinetic_energy import has_inertia
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.system import lies_in_memory
from .derivability import require_derivatives

FINER = 2.0**-42
"""The tolerance of Newton's method where its matrix is that of order 4: each correction is wrong by
O(h^5) of itself.
"""


@record
class LiePoissonHamiltonJacobi(Implicit):
    """Steps whose generating function s(p), of the second kind, solves the Lie-Poisson
    Hamilton-Jacobi equation to an order in h.

        s = h H + (h^3/6) s_3 + (h^5/120) s_5 + ...,   x = ds/dp,   (dtau^-1_x)* p = mu_i  (right-trivialised)
        mu_i+1 = Ad*_tau(x) mu_i,   g_i+1 = g_i tau(x)

    The Hamilton-Jacobi equation ds/dt = H((dtau^-1_x)* p), left-trivialised, with s = 0 at t = 0
    determines s.  Of it, x is all that is needed, and x is read off the motion.

    order : 2 (s = h H), 4, 6 or 8.  retraction : Exponential() serves every group and is the more
    accurate one.  For every group and every Hamiltonian, also one that has no Lagrangian, or one
    that changes with time, K(t, mu), of a DrivenLiePoissonSystem: s is then expanded about the
    middle of the step.  Where there is a Lagrangian, order 2 is CovariantVariational.
    Symmetric; spatial momentum, Casimirs and the Lie-Poisson bracket are kept to rounding, the
    energy oscillates without drift.  Raises NoConvergence or OutsideChart if the step is too large
    for the equation to be solved.

    Source: Ge and Marsden, Phys. Lett. A 133 (1988), 134; Channell and Scovel, Physica D 50 (1991),
    80; Ferraro, de Leon, Marrero, Martin de Diego and Vaquero, Arch. Rational Mech. Anal. 226
    (2017), 243.
    """

    title: ClassVar[str] = "Hamilton-Jacobi {0.order} ({chart})"
    timed: ClassVar[bool] = True
    symmetric: ClassVar[bool] = True
    analytic: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    needs: ClassVar[tuple[str, ...]] = ("hamiltonian",)

    orders: ClassVar[tuple[int, ...]] = 2, 4, 6, 8  # with one, two, three or four terms of the generating function
    order: int = 4
    retraction: Retraction = Exponential()

    def require(self, system: Any) -> None:
        """A Lie-Poisson system whose Hamiltonian can be differentiated."""
        super().require(system)
        require_derivatives(self, system)

    # ---------------------------------------------------------------- one step

    def first(self, system: Any, state: BodyState, h: float) -> Vec:
        """p - mu = 0."""
        return 0.0 * plain(state.mu)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for p, whose difference to mu is extrapolated, then move momentum and attitude by
        x(p).
        """
        mu = plain(memory.state.mu)
        p, x = self.solution(system, h, mu, mu + extrapolated(*memory.past), t + 0.5 * h)
        return self.after(memory, system.displaced(self.retraction, memory.state, x), p - mu)

    def solution(self, system: Any, h: float, mu: Vec, guess: Vec, middle: float = 0.0) -> tuple[Vec, Vec]:
        """The p and x = ds/dp that fit mu, of a step about the time `middle`."""
        if lies_in_memory(system.group):
            return self.iterated(
                system, self.retraction, h, mu, (guess, h * velocity_at(system, middle, guess)),
                lambda p: self.displacement(system, h, p, middle),
            )  # fmt: skip
        tolerance = TOLERANCE if self.order <= 4 else FINER
        p, size, enough, folded = newton(
            lambda p: self.equation(system, h, mu, p, middle),
            guess,
            mu,
            tolerance=tolerance,
            coupled=system.hamiltonian.coupled,
        )
        x = self.displacement(system, h, p, middle)
        if not size <= enough:
            raise self._unsolved(h, size, enough, f", |x| = {norm(x):.2g}; H must be smooth")
        if folded or not self.retraction.is_chart(system.group, x):
            raise self._out_of_chart(h, f"|x| = {norm(x):.2g}")
        return p, x

    def equation(self, system: Any, h: float, mu: Vec, p: Vec, middle: float = 0.0) -> tuple[Vec, Mat, float]:
        """The mismatch of p and mu, its derivative (in orders 6 and 8 that of order 4; of sites
        that are coupled that of order 2), and the factor of its square.
        """
        order = 2 if system.hamiltonian.coupled else min(self.order, 4)
        slope = self.slope(system, h, p, order, middle)
        x = self.displacement(system, h, p, middle)
        r, by_p, by_x = self.retraction.residual(system.group, x, p, mu)
        slope_by_p = by_p if isinstance(by_p, vectors.Mat) else by_p * identity_matrix(len(p))
        return r, by_x @ slope + slope_by_p, weight(by_p)

    # ---------------------------------------------------------------- the generating function

    def displacement(self, system: Any, h: float, p: Vec, middle: float = 0.0) -> Vec:
        """The displacement of a step about the time `middle`, x = ds/dp."""
        return self._displacement(system, h, p, self.order, middle)

    def slope(self, system: Any, h: float, p: Vec, order: int, middle: float = 0.0) -> Mat:
        """The derivative of the displacement of an order, d^2s/dp^2."""
        if order == 4 and has_axes(system, self.retraction):
            return along_axes(system.hamiltonian.inverse, h, p)[1]
        return jacobian(lambda q: self._displacement(system, h, q, order, middle), p)

    def _displacement(self, system: Any, h: float, p: Vec, order: int, middle: float) -> Vec:
        if order == 2:
            return h * velocity_at(system, middle, p)
        if order == 4 and has_axes(system, self.retraction):
            return along_axes(system.hamiltonian.inverse, h, p)[0]
        if (
            order == 4
            and isinstance(self.retraction, Exponential)
            and isinstance(system, LiePoissonSystem)
            and not lies_in_memory(system.group)
        ):
            return self.two_terms(system, h, p)
        return total(second_kind(system, self.retraction, p, order // 2, h, middle))

    def two_terms(self, system: Any, h: float, p: Vec) -> Vec:
        """h dH(p) + (h^3/6) ds_3/dp of the exponential on every group, s_3 = D^2H(p)[w, w]/4 with
        w = ad*_v p, v = dH(p):

        ds_3/dp/6 = ([v, a] - D^2H(p) ad*_a p)/12 + D^3H(p)[w, w]/24,   a = D^2H(p) w;  the h goes with H.
        """
        group, v = system.group, h * system.velocity(p)
        w = group.ad_star(v, p)
        a = _turned(system, h, p, w)
        start, onward = vec(*p, *w), (*w, *[0 for _ in w])
        curved = derivative(lambda y: _turned(system, h, _half(y, 0), _half(y, len(y) // 2)), start, onward)
        return v + (1.0 / 12.0) * ((group.ad(v, a) - _turned(system, h, p, group.ad_star(a, p))) + 0.5 * curved)


def has_axes(system: Any, retraction: Retraction) -> bool:
    """Whether the system is a free body with principal moments, moved by the exponential: then s_3 is a polynomial of
    three terms.
    """
    energy = system.hamiltonian
    diagonal = has_inertia(energy) and isinstance(energy.inverse, vectors.Vec)
    return diagonal and isinstance(system.group.algebra, SO3Algebra) and isinstance(retraction, Exponential)


def along_axes(K: Vec, h: float, p: Vec) -> tuple[Vec, Mat]:
    """x = h K p + (h^3/6) ds_3/dp of a free body with principal moments 1/K, and its derivative.
    K, p : (3,).

        s_3 = w . K w/4 = (e_1 p_2^2 p_3^2 + e_2 p_3^2 p_1^2 + e_3 p_1^2 p_2^2)/4,   w = p x K p,   e_1 = K_1 (K_2 - K_3)^2, ...
    """
    k = h * K  # every product is one of angles, h K p, before it is taken to a power
    third, (d0, d1, d2) = (1.0 / 12.0) * k, (k[1] - k[2], k[2] - k[0], k[0] - k[1])
    a01, a02, a10 = d0 * p[1], d0 * p[2], d1 * p[0]
    a12, a20, a21 = d1 * p[2], d2 * p[0], d2 * p[1]
    rate = k + vec(
        third[1] * (a12 * a12) + third[2] * (a21 * a21),
        third[2] * (a20 * a20) + third[0] * (a02 * a02),
        third[0] * (a01 * a01) + third[1] * (a10 * a10),
    )
    q = (2.0 * third) * vec(a01 * a02, a12 * a10, a20 * a21)
    return rate * p, mat(vec(rate[0], q[2], q[1]), vec(q[2], rate[1], q[0]), vec(q[1], q[0], rate[2]))


def _turned(system: Any, h: float, p: Vec, w: Vec) -> Vec:
    """The derivative of h dH along w, h D^2H(p) w, (dim,)."""
    return h * derivative(lambda q: system.velocity(q), p, w)


def _half(y: Vec, first: int) -> Vec:
    """The half of a vector that begins at the component `first`."""
    return y[first : first + len(y) // 2]
