"""Partitioned Runge-Kutta-Munthe-Kaas methods in the chart at the middle of a step: symplectic and symmetric on T*G."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

from ..errors import IncompatibleSystem
from ..formulas import Mat, Record, Vec, derivative, identity_matrix, jacobian, norm, plain, record, vec
from ..formulas.numbers.sizes import one_norms
from ..groups.lie_group import LieGroup
from ..groups.retractions import Exponential
from ..solvers import correction, fixed_point, unit_of
from ..systems.cotangent import CotangentMotion
from ..systems.lie_poisson import BodyState
from ..tableaus.collocation import gauss
from ..tableaus.trees import Row
from .implicit import Implicit
from .memory import Memory, extrapolated
from .rkmk import combination
from .variational import momentum_slope

TAU = Exponential()
"""The coordinates of the chart."""


@record
class SymplecticRKMK(Implicit):
    """Gauss' methods in the chart at the middle of the step, g_m exp(Y) with g_m = g_n exp(x/2), on T*G.

    There the motion goes from Y = -x/2 to x/2, with momenta P = (dexp_Y)* mu  (left-trivialised).  With a, b, c of Gauss
    and the rates X_i of Y and D_i of P at the stages,

        Y_i = h sum_j (a_ij - b_j/2) X_j,   P_i = p + h sum_j (a_ij - b_j/2) D_j,   x = h sum_j b_j X_j
        p = (dexp_{-x})* mu_n + (dexp_{-x/2})* F/2,   F = h sum_j b_j Ad*_exp(-Y_j) f_j
        mu_n+1 = Ad*_exp(x) (mu_n + Ad*_exp(-x/2) F),   g_n+1 = g_n exp(x)

    p is not the momentum at the start plus half of what the stages add in this chart: the chart moves with the state, and
    such a step would not be symplectic.

    order : 2, 4, 6 or 8, twice the number of stages.  For every motion on T*G: of a CotangentSystem, whose energy may mix
    momentum and place, or a MechanicalSystem, also under a load.
    Symmetric and symplectic; momenta of symmetries, in space and in the body, are kept to rounding, the energy
    oscillates without drift.  Order 2 is the midpoint rule of variational integrators, of the action h l(g_m, x/h);
    where there is a Lagrangian, of a TangentSystem or a body in a field, it is solved for the velocity x/h.
    Raises NoConvergence or OutsideChart if the step is too large.

    Source: Bogfjellmo and Marthinsen, Found. Comput. Math. 16 (2016) (partitioned methods, in the chart at the start);
    Marsden and West, Acta Numerica 10 (2001), section 2.6; docs/bodies_in_fields.md (the chart at the middle).
    """

    title: ClassVar[str] = "Symplectic RKMK {0.order}"
    timed: ClassVar[bool] = True
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    writes_out: ClassVar[bool] = True

    orders: ClassVar[tuple[int, ...]] = 2, 4, 6, 8  # twice the number of stages
    order: int = 4

    def require(self, system: Any) -> None:
        """A motion on T*G."""
        super().require(system)
        if not isinstance(system, CotangentMotion):
            raise IncompatibleSystem(
                f"{self!r} needs a CotangentSystem, or a body in a field, a MechanicalSystem; got {system!r}. "
                f"{system.alternatives}"
            )

    @cached_property
    def tableau(self) -> tuple[tuple[Row, ...], Row, Row]:
        """a_ij - b_j/2, b and c of Gauss' method; the first as half the difference of opposite coefficients, so that
        steps are symmetric to all digits.
        """
        gaussian = gauss(self.order // 2)
        opposite = [row[::-1] for row in gaussian.A[::-1]]
        centred = [tuple([0.5 * (a - b) for a, b in zip(*rows)]) for rows in zip(gaussian.A, opposite)]
        return tuple(centred), gaussian.b, gaussian.c

    # ---------------------------------------------------------------- one step

    def first(self, system: Any, state: BodyState, h: float) -> tuple[Vec, ...]:
        """Velocity and force of the start at every stage, no change of the momentum and no impulse; with one stage and
        a Lagrangian the velocity alone.
        """
        xi, f = system.rates(0.0, plain(state.mu), plain(state.g))
        stages = len(self.tableau[1])
        if stages == 1 and system.has_lagrangian:
            return (xi,)
        return (*[xi for _ in range(stages)], *[f for _ in range(stages)], 0.0 * f, 0.0 * f)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for rates and momentum from the extrapolated ones, then add the kick, and move."""
        group, start = system.configurations, plain(memory.state)
        guess = tuple([extrapolated(*values) for values in zip(*memory.past)])
        if len(guess) == 1:
            slope = _slope(system, t, start, h, guess[0])
            unknown = fixed_point(lambda last: _corrected(system, t, start, h, slope, last[0]), guess, self, h)
            x, force = h * unknown[0], h * _in_the_middle(system, t, start, h, unknown[0])[1]
        else:
            near = _linearised(system, t, start, h, combination(self.tableau[1], guess), guess[len(guess) - 2])
            unknown = fixed_point(lambda last: self._sweep(system, t, start, h, near, last), guess, self, h)
            x, force = combination(self.tableau[1], unknown, h), unknown[len(unknown) - 1]
        if not TAU.is_chart(group, x):
            raise self._out_of_chart(h, f"|x| = {norm(x):.2g}")
        kick = TAU.tau_Ad_star(group, -0.5 * x, force) if system.has_force else force
        return self.after(memory, system.kicked(TAU, memory.state, kick, x), unknown)

    def _sweep(
        self, system: Any, t: float, start: BodyState, h: float, near: Linearisation, last: tuple[Vec, ...]
    ) -> tuple[tuple[Vec, ...], Vec, Vec]:
        """X_i, D_i, p - mu_n and F anew; how far velocities and p were off, and their sizes, in each unit apart.

        Rates where the last ones led, and what their change moves, to first order in h: a misfit shrinks by a factor of
        order h^(3/2), or h^2 where forces are weak.
        """
        (a, b, c), group, s = self.tableau, system.configurations, len(self.tableau[1])
        X, D, change = last[:s], last[s : 2 * s], last[2 * s]
        before, p, force = combination(b, X, h), start.mu + change, 0.0 * change
        middle, rates = group.compose_exp(start.g, 0.5 * before), []  # type: Any, list[tuple[Vec, Vec]]
        for i, (row, node) in enumerate(zip(a, c)):
            y = combination(row, X, h)
            if y is None:  # one stage is in the middle
                xi, f = system.rates(t + node * h, p, middle)
                rates, force = [(xi, D[i])], h * f
            else:
                mu = TAU.dtau_inv_dual(group, y, p + combination(row, D, h))
                xi, f = system.rates(t + node * h, mu, group.compose_exp(middle, y))
                v = TAU.dtau_inv(group, y, xi)
                rates = [*rates, (v, _rate_in_chart(group, y, mu, v, group.ad_star(xi, mu) + f))]
                force = force + (h * b[i]) * TAU.tau_Ad_star(group, -y, f)
        x = combination(b, [v for v, _ in rates], h)
        mean = TAU.dtau_dual(group, -x, start.mu) + 0.5 * TAU.dtau_dual(group, -0.5 * x, force)
        turn, shift = correction(near.slope, mean - p), 0.5 * (x - before)
        off_X, off_D = [v - X[i] for i, (v, _) in enumerate(rates)], [d - D[i] for i, (_, d) in enumerate(rates)]
        X, D = (), ()
        for row, (v, d) in zip(a, rates):
            y, bent = combination(row, off_X, h), combination(row, off_D, h)
            y, bent = (0.0 * turn, turn) if y is None else (y, turn + bent)
            v_off, d_off = near.moved(group, shift, y, bent)
            X, D = (*X, v + v_off), (*D, d + d_off)
        steps, sizes = vec(*(combination(b, X, h) - before), *turn), vec(*before, *start.mu)
        blocks = system.unit_blocks
        return (*X, *D, change + turn, force), one_norms(steps, blocks), one_norms(sizes, blocks)


def _in_the_middle(system: Any, t: float, start: BodyState, h: float, xi: Vec) -> tuple[Vec, Vec]:
    """Momentum and force in the middle of a step with this mean velocity."""
    return system.momentum_and_force(t + 0.5 * h, xi, system.configurations.compose_exp(start.g, (0.5 * h) * xi))


def _corrected(system: Any, t: float, start: BodyState, h: float, slope: Mat, xi: Vec) -> tuple[tuple[Vec], Vec, Vec]:
    """The velocity anew whose momentum dl/dxi is p; how far it was off, and its size.  slope : of `_slope`."""
    group, (momentum, f) = system.configurations, _in_the_middle(system, t, start, h, xi)
    if system.has_force:
        momentum = momentum - (0.5 * h) * TAU.dtau_dual(group, (-0.5 * h) * xi, f)
    unit = unit_of(slope[0])  # three entries are multiplied
    r, by_p, by_x = TAU.residual(group, h * xi, unit * momentum, unit * start.mu)
    step = correction(h * by_x + momentum_slope(by_p, unit * slope), r)
    return (xi - step,), one_norms(step, group.unit_blocks), one_norms(xi, group.unit_blocks)


def _slope(system: Any, t: float, start: BodyState, h: float, xi: Vec) -> Mat:
    """The derivative by xi of dl/dxi less the part of p that is of f, to first order in h."""
    group = system.configurations
    g = group.compose_exp(start.g, (0.5 * h) * xi)

    def momentum(change: Vec) -> Vec:
        p, f = system.momentum_and_force(t + 0.5 * h, xi + change, group.compose_exp(g, (0.5 * h) * change))
        return p - (0.5 * h) * (f + (0.25 * h) * group.ad_star(change, f)) if system.has_force else p

    return jacobian(momentum, vec(*[0.0 for _ in xi]))


@record
class Linearisation(Record):
    """Velocity and momentum in the middle of a step, at a guess, and their derivatives.

    by_mu, by_place : of the velocity; that of the force by the momentum is the transpose of -by_place, as second
    derivatives of an energy commute.  slope : of p less what it leads to, p - (dexp_{-x})* mu_n - (dexp_{-x/2})* F/2, in
    which the force is to first order in h.
    """

    xi: Vec
    p: Vec
    by_mu: Mat
    by_place: Mat
    slope: Mat

    def moved(self, group: LieGroup, shift: Vec, y: Vec, p: Vec) -> tuple[Vec, Vec]:
        """The changes of xi + [Y, xi]/2 and ad*_xi P/2 + f, the rates of Y and P near Y = 0, where g_m goes along
        exp(shift), Y by y and P by p; the change of the force with the place is left out.
        """
        v = self.by_mu @ (p + 0.5 * group.ad_star(y, self.p)) + self.by_place @ (shift + y)
        turned = 0.5 * (group.ad_star(v, self.p) + group.ad_star(self.xi, p))
        return v + 0.5 * group.ad(y, self.xi), turned - self.by_place.T @ p


def _linearised(system: Any, t: float, start: BodyState, h: float, xi: Vec, change: Vec) -> Linearisation:
    """The middle of a step at a guess of the mean velocity and of p - mu_n."""
    group, p = system.configurations, start.mu + change
    g = group.compose_exp(start.g, (0.5 * h) * xi)
    by_mu = jacobian(lambda m: system.rates(t + 0.5 * h, m, g)[0], p)
    by_place = jacobian(lambda y: system.rates(t + 0.5 * h, p, group.compose_exp(g, y))[0], 0.0 * p)
    _, _, by_x = TAU.residual(group, h * xi, p, start.mu)
    slope = identity_matrix(len(p)) + h * (by_x @ by_mu + 0.5 * by_place.T)
    return Linearisation(xi, p, by_mu, by_place, slope)


def _rate_in_chart(group: LieGroup, y: Vec, mu: Vec, along: Vec, rate: Vec) -> Vec:
    """The rate of (dexp_y)* mu where y and mu have these rates.  All (dim,)."""
    n = len(y)
    return derivative(lambda z: TAU.dtau_dual(group, z[:n], z[n:]), vec(*y, *mu), vec(*along, *rate))
