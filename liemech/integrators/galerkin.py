"""Galerkin variational methods: an action principle for polynomials in a chart, of order 2, 4, 6 or 8."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..errors import IncompatibleSystem, InvalidInput
from ..formulas import Mat, Record, Vec, derivative, dot, identity_matrix, mat, norm, plain, record, sqrt, vec
from ..formulas.derivatives import tangent
from ..formulas.numbers.sizes import one_norms
from ..groups.retractions import Exponential, Retraction
from ..solvers import correction, fixed_point, unit_of
from ..systems.kinetic_energy import times
from ..systems.lie_poisson import BodyState
from ..systems.mechanical import MechanicalSystem
from ..tableaus.collocation import gauss
from ..tableaus.trees import Row
from .implicit import Implicit
from .memory import Memory, extrapolated
from .rkmk import combination
from .variational import with_inertia

TINY = 2.0**-1020
"""Products of velocity and momentum below this, or beyond its inverse, lose digits."""


@record
class GalerkinVariational(Implicit):
    """The action principle for motions g_i tau(X(t)) whose X is a polynomial, with the integral
    taken by Gauss' quadrature.

    With the velocities V_j of X at the s nodes of Gauss, his tableau a, b, c, and body velocities
    xi_j (left-trivialised),

        X_j = h sum_k a_jk V_k,   x = h sum_k b_k V_k,   xi_j = dtau_X_j V_j,

    the action h sum_j b_j (l(xi_j) - V(g_i tau(X_j))) is stationary for fixed ends.  Let
    P_j = (dtau_X_j)* dl/dxi(xi_j) be the momentum that belongs to X, F_j its rate by Lagrange's
    equations, and k what the field adds to mu.  Then

        P_j + h sum_k (b_k - a_jk) F_k = (dtau_x)* (mu_i + k)  (right-trivialised),   k = h sum_j b_j Ad*_tau(-X_j) f(g_i tau(X_j))
        mu_i+1 = Ad*_tau(x) (mu_i + k),   g_i+1 = g_i tau(x)

    order : 2, 4, 6 or 8, twice the number of nodes.  retraction : Exponential() is more accurate
    and allows larger steps.  For bodies with a Lagrangian, free or in a field; a load acts at the
    nodes, by the principle of Lagrange and d'Alembert.  Symplectic; spatial momentum and Casimirs
    of a free body are kept to rounding, in a field the momentum that belongs to a symmetry of the
    potential; the energy oscillates without drift.  The chart is that at the start of the step, so
    that only order 2 with exp is symmetric; without a field this is CovariantVariational.
    Raises NoConvergence or OutsideChart if the step is too large.

    Source: Marsden and West, Acta Numerica 10 (2001), sections 2.6 and 3.2; Bogfjellmo and
    Marthinsen, Found. Comput. Math. 16 (2016); Hall and Leok, Found. Comput. Math. 17 (2017).
    """

    title: ClassVar[str] = "Galerkin {0.order} ({chart})"
    writes_out: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    orders: ClassVar[tuple[int, ...]] = 2, 4, 6, 8  # twice the number of nodes
    order: int = 4
    retraction: Retraction = Exponential()

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """Symmetric with one node, which lies in the middle of the path exp(t x)."""
        return self.order == 2 and isinstance(self.retraction, Exponential)

    def require(self, system: Any) -> None:
        """A body with a Lagrangian, free or in a field, on a group that has the retraction."""
        body: Any = _body(system)
        if getattr(body, "lie_poisson", None) is None:
            raise IncompatibleSystem(
                f"{self!r} needs a body, free as RigidBody([1.0, 1.5, 2.0]) or in a field, a "
                f"MechanicalSystem; got {system!r}. RKMK accepts every system"
            )
        if body.lagrangian is None:
            raise IncompatibleSystem(
                f"{self!r} needs a body with a lagrangian; {body!r} has none. "
                "LiePoissonHamiltonJacobi(order=4) does without one, RKMK accepts every system"
            )
        self.require_written_out(body.group)
        self.retraction.require(body.group)

    # ---------------------------------------------------------------- constants

    @cached_property
    def tableau(self) -> tuple[tuple[Row, ...], Row, Row, tuple[Row, ...]]:
        """a, b and c of Gauss' method, and b_k - a_jk, the weights of what comes after a node."""
        gaussian = gauss(self.order // 2)
        return (
            gaussian.A,
            gaussian.b,
            gaussian.c,
            tuple([tuple([w - a for w, a in zip(gaussian.b, row)]) for row in gaussian.A]),
        )

    @cached_property
    def legendre(self) -> tuple[tuple[Row, ...], tuple[Row, ...], Row]:
        """From values at the nodes to coefficients of orthonormal Legendre polynomials, the way
        back, and what integration of one has of the next.

        Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., IV.5 (the
        W-transformation).
        """
        _, b, c, _ = self.tableau
        values = np.polynomial.legendre.legvander(2.0 * np.array(c) - 1.0, len(b) - 1) * np.sqrt(
            2.0 * np.arange(len(b)) + 1.0
        )
        forth, back = (values.T * b).tolist(), values.tolist()
        couplings = tuple([0.5 / (4.0 * k * k - 1.0) ** 0.5 for k in range(1, len(b))])
        return tuple(map(tuple, forth)), tuple(map(tuple, back)), couplings

    # ---------------------------------------------------------------- one step

    def first(self, system: Any, state: BodyState, h: float) -> tuple[Vec, ...]:
        """The velocity of the start at every node.  Raises InvalidInput where the product of velocity and
        momentum is not a number.
        """
        mu = plain(state.mu)
        xi = system.velocity(mu)
        of_mu, of_xi = unit_of(mu), unit_of(xi)
        square = dot(of_mu * mu, of_mu * mu) * dot(of_xi * xi, of_xi * xi)
        if square > 0.0 and not TINY < (sqrt(square) / of_mu) / of_xi < 1.0 / TINY:
            raise InvalidInput(
                f"{self!r}: |mu| = {norm(of_mu * mu) / of_mu:.1e} times |xi| = {norm(of_xi * xi) / of_xi:.1e} leaves the "
                "range of floats; take other units of mass and time"
            )
        return tuple([xi for _ in self.tableau[1]])

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for the velocities at the nodes from the extrapolated ones, then add what the field does, and move."""
        body, b, start = _body(system, t + 0.5 * h), self.tableau[1], plain(memory.state)
        guess = tuple([extrapolated(*node) for node in zip(*memory.past)])
        middle = _middle(body, combination(b, guess), start.mu, h)
        kick = None if body is system else 0.0 * start.mu
        velocities, kick = fixed_point(
            lambda last: self._sweep(system, t, start, h, middle, last[0]), (guess, kick), self, h
        )
        x, state = combination(b, velocities, h), memory.state
        mu = state.mu if kick is None else state.mu + kick
        if not self.retraction.is_chart(body.group, x):
            raise self._out_of_chart(h, f"|x| = {norm(x):.2g}")
        moved = body.displaced(self.retraction, BodyState(mu, state.g), x)
        return self.after(memory, moved, velocities)

    def _sweep(
        self, system: Any, t: float, start: BodyState, h: float, middle: Middle, velocities: tuple[Vec, ...]
    ) -> tuple[Any, Vec, Vec]:
        """Better velocities, and what the field adds to the momentum; how far momenta were off, and
        their size, in each unit apart.
        """
        body, places = (_body(system, t + 0.5 * h), [combination(row, velocities, h) for row in self.tableau[0]])
        misfits, kick, size = self._misfits(system, t, start, h, velocities, places)
        steps = self._corrections(body, middle, h, misfits)
        velocities = tuple([v - (e + 0.5 * body.group.ad(x, e)) for v, e, x in zip(velocities, steps, places)])
        off = vec(*[0.0 for _ in body.group.unit_blocks])
        for r in misfits:
            off = off + one_norms(r, body.group.unit_blocks)
        return (velocities, kick), off, size

    def _misfits(
        self, system: Any, t: float, start: BodyState, h: float, velocities: tuple[Vec, ...], places: list[Vec]
    ) -> tuple[list[Vec], Vec | None, Vec]:
        """How far the equations are from holding, as body momenta at the nodes; what the field adds
        to mu; the size of momenta in each unit.
        """
        (_, b, c, later), tau, body = self.tableau, self.retraction, _body(system)
        group, kick, size = (
            body.group,
            None if body is system else 0.0 * start.mu,
            one_norms(start.mu, body.group.unit_blocks),
        )
        momenta, rates, misfits = [], [], []  # type: list[Vec], list[Vec], list[Vec]
        for i, (x, v) in enumerate(zip(places, velocities)):
            xi = tau.dtau(group, x, v)
            p = _body(system, t + c[i] * h).lagrangian.momentum(xi)
            rate, size = group.ad_star(xi, p), size + one_norms(p, group.unit_blocks)
            if kick is not None:
                force = system.applied(t + c[i] * h, xi, tau.compose_tau(group, start.g, x))
                rate, kick = rate + force, kick + (h * b[i]) * tau.tau_Ad_star(group, -x, force)
            P, F = tangent(lambda y: tau.dtau_dual(group, _half(y, 0), _half(y, 1)), vec(*x, *p), vec(*v, *rate))
            momenta, rates = [*momenta, P], [*rates, F]
        end = tau.dtau_dual(  # right-trivialised
            group, -combination(b, velocities, h), start.mu if kick is None else start.mu + kick
        )
        for x, p, row in zip(places, momenta, later):
            r = (p + combination(row, rates, h)) - end
            # the inverse of dtau_x is 1 + ad_x/2 + ...
            misfits = [*misfits, r + 0.5 * group.ad_star(x, r)]
        return misfits, kick, size

    def _corrections(self, body: Any, middle: Middle, h: float, misfits: list[Vec]) -> list[Vec]:
        """The e_j whose momenta fit, to first order in h:  J e_j + h sum_k a_jk W e_k + h U sum_k
        b_k e_k = r_j.

        W = (J ad_xi - ad*_xi J)/2 - ad*_. p,  U = (ad*_xi J + ad*_. (p - mu))/2, as they are in the middle of the step.  For the
        coefficients of Legendre polynomials the matrix is tridiagonal.  A misfit shrinks by a
        factor of order h^2.
        """
        forth, back, coupling = self.legendre
        e = [combination(row, misfits) for row in forth]
        for k in range(len(e) - 1, 0, -1):
            e[k - 1] = e[k - 1] + (h * coupling[k - 1]) * _turned(body, middle, _velocity(body, middle, e[k]))
        e[0] = correction(middle.slope, e[0])
        for k in range(1, len(e)):
            e[k] = _velocity(body, middle, e[k] - (h * coupling[k - 1]) * _turned(body, middle, e[k - 1]))
        return [combination(row, e) for row in back]


# ---------------------------------------------------------------------- the middle of a step, for corrections


@record
class Middle(Record):
    """Velocity, momentum and inertia in the middle of a step, and the derivative of the equations
    for the mean velocity.
    """

    xi: Vec
    p: Vec
    inertia: Mat | Vec
    slope: Mat


def _middle(body: Any, xi: Vec, mu: Vec, h: float) -> Middle:
    """Velocity, momentum and inertia in the middle of a step, and J + h ((J ad_xi + ad*_xi J)/4 - ad*_. mu/2)."""
    group, inertia = body.group, body.lagrangian.hessian(xi)
    columns: list[Vec] = []
    for e in identity_matrix(group.dim):
        turned = times(inertia, group.ad(xi, e)) + group.ad_star(xi, times(inertia, e))
        columns = [*columns, (0.25 * h) * turned - (0.5 * h) * group.ad_star(e, mu)]
    return Middle(xi, body.lagrangian.momentum(xi), inertia, with_inertia(mat(*columns).T, inertia))


def _turned(body: Any, middle: Middle, v: Vec) -> Vec:
    """The coupling W v of a velocity v, in the middle of the step."""
    group, xi, J = body.group, middle.xi, middle.inertia
    return 0.5 * (times(J, group.ad(xi, v)) - group.ad_star(xi, times(J, v))) - group.ad_star(v, middle.p)


def _velocity(body: Any, middle: Middle, p: Vec) -> Vec:
    """The velocity J^-1 p, with J in the middle of the step."""
    return derivative(lambda m: body.velocity(m), middle.p, p)


# ---------------------------------------------------------------------- small parts


def _body(system: Any, t: float = 0.0) -> Any:
    """The body without the field, with the energy that it has at time t."""
    return system._body_at(t) if isinstance(system, MechanicalSystem) else system


def _half(y: Vec, which: int) -> Vec:
    """The first half of a vector, or the second."""
    n = len(y) // 2
    return y[which * n : which * n + n]
