"""RATTLE on a Lie group: the covariant variational method under holonomic constraints."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, NoConvergence
from ...formulas import Element, Mat, Vec, dot, identity_matrix, jacobian, mat, norm, plain, record, vec, vectors
from ...formulas.elimination import DEPENDENT, keep_sign, triangular
from ...formulas.numbers.sizes import EPSILON
from ...groups.retractions import Exponential, Retraction
from ...integrators.kicks.explicit_kicks import bound_refusal, negative_pivots
from ...integrators.memory import Memory, Remembering, extrapolated, followed, repeated
from ...integrators.method import alternatives
from ...integrators.solvability import CONTRACTION, INFINITY, LEAST, MOST, ROUNDING, grown
from ...integrators.variational import momentum_slope, with_inertia
from ...solvers import NOISE, newton, newton_of_kicks
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from .conditions import joint, led, pulled, solved_sparse, speeds
from .constrained_body import ConstrainedBody


@record
class LieRATTLE(Remembering):
    """RATTLE on a group: one step of Algorithm 1 between two kicks, by the field and by the
    constraint.

        m = mu_i + (h/2) f(g_i) - G(g_i)* l,   (dtau^-1_x)* J x/h = m,   g_i+1 = g_i tau(x),   c(g_i+1) = 0       for x and l
        mu_i+1 = Ad*_tau(x) m + (h/2) f(g_i+1) - G(g_i+1)* l',   G(g_i+1) J^-1 mu_i+1 = 0                       for l'

    dtau is the right-trivialised one.  These are the discrete Euler-Lagrange equations of the sum
    of h l(xi_i) - h (V(g_i) + V(g_i+1))/2 under c(g_i) = 0.
    retraction : Exponential() is the more accurate one.
    Order 2, symmetric; both constraints hold to rounding at every step; the two-form on the
    constrained phase space is kept, and so are momenta of common symmetries of potential and
    constraint; the energy oscillates without drift. 2 l/h and 2 l'/h are multipliers to first order
    only: `ConstrainedBody.multipliers` gives those of a state, of second order.
    A load F, by the principle of Lagrange and d'Alembert, adds (h/2) F to each kick: to the first
    as it is at the beginning, to the last as it is at the end, an equation for mu_i+1 and l'.  Still
    of order 2 and symmetric; there is no two-form to be kept then.
    Raises NoConvergence if the step is too large, also for a damping whose first kick would throw back, or
    where the conditions become dependent (a dead point): no solution grows out of h = 0 up to this step.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.3 (RATTLE);
    Leyendecker, Marsden and Ortiz, ZAMM 88 (2008), section 3; Marsden and West, Acta Numerica 10
    (2001), section 3.5 (constraints).
    """

    title: ClassVar[str] = "Lie-RATTLE ({chart})"
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True
    order: ClassVar[int] = 2

    retraction: Retraction = Exponential()

    def require(self, system: Any) -> None:
        """A ConstrainedBody, on a group that has the retraction."""
        if not isinstance(system, ConstrainedBody):
            raise IncompatibleSystem(
                f"{self!r} needs bodies under a constraint, a ConstrainedBody; got {system!r}. {alternatives(system)}"
            )
        self.retraction.require(system.configurations)

    def at_node(self, system: Any, state: BodyState, h: float) -> tuple[Vec, Any]:
        """The force, and the derivative of the constraint by rows."""
        if system.rheonomic or getattr(system, "geared", False):
            raise IncompatibleSystem(
                f"{self!r}: conditions that change with time, such as joints in a given motion, and rotors go with "
                "linkages and steps of fixed length, without tangents; RKMK(order=4) takes all conditions"
            )
        g = plain(state.g)
        return system.force(g), system.rows(g)

    def beginning(self, system: Any, state: BodyState, h: float) -> tuple[Vec, Vec, Vec]:
        """Displacement and impulses of the constraint one after another: a past in which every step
        had the velocity and the multipliers of the start, without the load, whose time is not known.
        """
        impulses = (0.5 * h) * system.multipliers_under(system.force(state.g), state.mu, state.g)
        return repeated(vec(*(h * system.velocity(state.mu)), *impulses))

    def step_warning(self, system: Any, start: BodyState, h: float) -> str | None:
        """Refuse a step that the configuration of a body would not notice, as RATTLE does."""
        mu, count = np.asarray(start.mu), start.bodies or 1
        speed = self._speeds(system, mu, count)
        least = EPSILON * np.sqrt(
            self._sizes(system, np.asarray(start.g) if start.bodies else np.asarray(start.g)[None])
        )
        if np.all(abs(h) * speed >= least):
            return None
        kicked = self._speeds(system, np.asarray(h * np.asarray(system.force(start.g))), count)
        moved = abs(h) * (speed + kicked / EPSILON)
        lost = np.flatnonzero((abs(h) * speed < least) & (moved > 0.0) & (moved < least))
        if len(lost):
            of_body = "" if start.bodies is None else f" (body {lost[0]})"
            raise InvalidInput(
                f"{self!r}: in a step of h = {h:g} the configuration moves by less than its "
                f"rounding{of_body}; give a larger h"
            )
        return None

    def _speeds(self, system: Any, mu: np.ndarray, count: int) -> np.ndarray:
        """sqrt(xi . J xi) of momenta, (count,)."""
        xi = np.asarray(system.velocity(mu))
        return np.sqrt(np.einsum("ij,ij->i", xi.reshape(count, -1), mu.reshape(count, -1)))

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Solve for displacement and impulses, move, kick, and take away what leads off the
        constraint.
        """
        state, (force, rows), free, load = (memory.state, memory.node, system.body.body, system.body.load)
        if load is not None:
            self._require_gentle(system, t, state, rows, h)
            force = force + load.covector(t, system.velocity(plain(state.mu)), plain(state.g))
            memory = Memory(state, (force, rows), memory.past)
        unknown = self._solved(system, h, memory, extrapolated(*memory.past))
        x, impulses = split(unknown, system.configurations.dim)
        kick = (0.5 * h) * force - pulled(system, rows, impulses)
        state = free.displaced(self.retraction, BodyState(state.mu + kick, state.g), x)
        force, rows = self.at_node(system, state, h)
        mu = state.mu + (0.5 * h) * force
        if load is not None:
            mu = mu + self._load_at_the_end(system, t + h, plain(mu), plain(state.g), rows, 0.5 * h)
        mu = self._projected(system, rows, mu)
        past, state = followed(memory.past, unknown), BodyState(mu, state.g)
        if load is not None:
            self._require_gentle(system, t + h, state, rows, -h)
        return Memory(state, (force, rows), past)

    # ---------------------------------------------------------------- the two systems of a step

    def _solved(self, system: Any, h: float, memory: Memory, guess: Vec) -> Vec:
        """Displacement and impulses: the solution that grows out of zero with h.

        A correction counts if it shrinks well, if the determinants have the signs that they have on the whole branch, and
        if the displacement that it settles at is in the inner half of the chart.
        """
        mu, g, size = (plain(memory.state.mu), plain(memory.state.g), self._size(system, memory.state.g))
        first_guess = vec(*(h * system.velocity(mu)), *guess[system.configurations.dim :])

        def trial(part: float, y: Vec, solution: Vec, before: float) -> tuple[Vec, float, bool, bool]:
            change, upright = self._correction(system, part * h, mu, g, memory, y)
            new = y - change
            x, dx = (split(new, system.configurations.dim)[0], split(change, system.configurations.dim)[0])
            length, whole = self._square(system, dx), self._square(system, x)
            shrinks, noisy = (length <= CONTRACTION * before, length <= NOISE * NOISE * (whole + size))
            settled = length <= ROUNDING * size or (before < INFINITY and length * (length / before) <= LEAST * whole)
            good, done = upright and (shrinks or noisy), settled or not shrinks
            return new, length, good and not (done and not self._is_inside(system, x)), done

        solution, reached = grown(trial, first_guess, guess, MOST)
        if reached < 1.0:
            x = split(solution, system.configurations.dim)[0]
            raise self._ended(system, h, reached * h, memory, x)
        return solution

    def _correction(self, system: Any, h: float, mu: Vec, g: Element, memory: Memory, unknown: Vec) -> tuple[Vec, bool]:
        """The correction of Newton's method, by Schur complement, block for block; and whether
        determinants have the sign of h = 0.

        With r the mismatch of Algorithm 1 in every block,  A dx + B dl = r,  C dx = c  gives  (C A^-1 B) dl = C A^-1 r - c.
        """
        x, impulses = split(unknown, system.configurations.dim)
        rate, upright = 1.0 / h, True
        force, along = memory.node
        momentum = mu + ((0.5 * h) * force - pulled(system, along, impulses))
        inertias, p = system.inertias, system.body.body.lagrangian.momentum(rate * x)
        c, C = self._condition(system, g, x)
        free, pushed = [], []  # type: list[Any], list[Any]  # A^-1 r and A^-1 B, block by block
        for (group, start, end), J, held in zip(system.blocks, inertias, system.held):
            y = x[start:end]
            r, by_p, by_x = self.retraction.residual(group, y, p[start:end], momentum[start:end])
            A = with_inertia(by_x, momentum_slope(by_p, rate * J))
            B = [carried(self.retraction, group, y, by_p, along[a][i]) for a, i in held]
            columns, good = eliminated(A, [r, *B], h)
            upright = upright and good
            free, pushed = [*free, columns[0]], [*pushed, columns[1:]]
        through = led(system, C)
        mismatch = [
            vectors.sum([dot(through[b][i], free[b]) for b, i in ties]) - value
            for ties, value in zip(system.touches, c)
        ]
        m = joint(system, through, pushed)
        dl, pivots = solved_sparse(system, m, mismatch)
        dx = [less(y, columns, [dl[a] for a, _ in held]) for y, columns, held in zip(free, pushed, system.held)]
        return vec(*[x for part in dx for x in part], *dl), upright and regular(system, m, pivots, h)

    def _condition(self, system: Any, g: Element, x: Vec) -> tuple[Vec, Any]:
        """c(g tau(x)), and its derivative by x, by rows and blocks."""
        g_end = self.retraction.compose_tau(system.configurations, g, x)
        rows, blocks, parts = (system.rows(g_end), system.blocks, [x[start:end] for start, end in system.places])
        bends = [
            [self.retraction.dtau_dual(blocks[b][0], parts[b], rows[a][i]) for i, (b, _) in enumerate(ties)]
            for a, ties in enumerate(system.touches)
        ]
        return system.constraint.value(g_end), bends

    def _projected(self, system: Any, rows: Any, mu: Vec) -> Vec:
        """The momentum without what leads off the constraint, mu - G* l' with (G J^-1 G*) l' = G J^-1 mu."""
        through = led(system, rows)
        pushed = [[times(inverse, row) for row in block] for inverse, block in zip(system.inverses, through)]
        off = speeds(system, rows, system.velocity(plain(mu)))
        return mu - pulled(system, rows, solved_sparse(system, joint(system, through, pushed), off)[0])

    def _require_gentle(self, system: Any, t: float, state: BodyState, rows: Any, h: float) -> None:
        """Refuse a step from a state whose first kick by a load throws back; backwards in time that is the last one."""
        mu, g = plain(state.mu), plain(state.g)
        if h > 0.0 and self._throws_back(system, t, mu, g, rows, 0.5 * h):
            raise bound_refusal(self, system, t, mu, g, h)

    def _throws_back(self, system: Any, t: float, mu: Vec, g: Element, rows: Any, h: float) -> bool:
        """Whether J - h C, or of loads at joints 1 - h A c, has a negative eigenvalue on the velocities that the
        constraint allows; A: the rates by their efforts, c: the damping of each.
        """
        load, xi = system.body.load, system.velocity(mu)

        if load.by_rate:
            w = load.rates(xi, g)
            damping = load.resistances(t, w, g)
            answers = jacobian(
                lambda k: load.rates(system.velocity(self._projected(system, rows, load.spread(t, k, g))), g), 0.0 * w
            )
            count = range(len(w))
            damped_rows = [
                vec(*[(1.0 if i == j else 0.0) - h * answers[i, j] * damping[j] for j in count]) for i in count
            ]
        else:
            damped_rows = []
            for unit in identity_matrix(len(mu)):
                p = system.body.body.lagrangian.momentum(unit)
                damping = load.resistance(t, xi, g, system.velocity(self._projected(system, rows, p)))
                damped_rows = [*damped_rows, p - h * self._projected(system, rows, damping)]
        return negative_pivots(mat(*damped_rows)) > 0.0

    def _load_at_the_end(self, system: Any, t: float, mu: Vec, g: Element, rows: Any, h: float) -> Vec:
        """The kick h F at the velocity that it leads to, on the constraint.

        Newton's method finds the velocities that the load depends on, `rates`:
        w = rates(J^-1 P (mu + h F(t, w, g))) with P the projection to momenta on the constraint.
        """
        load = system.body.load

        def led_to(k: Vec) -> tuple[Vec, float]:
            pushed = mu + load.spread(t, k, g)
            speeds = load.rates(system.velocity(self._projected(system, rows, pushed)), g)
            return speeds, dot(guess, guess) + dot(speeds, speeds)

        def equation(w: Vec) -> tuple[Vec, Mat, float]:
            def rates(y: Vec) -> Vec:
                return load.rates(system.velocity(self._projected(system, rows, mu + h * load.at_rates(t, y, g))), g)

            slope = identity_matrix(len(w)) - jacobian(rates, w)
            return w - rates(w), slope, dot(guess, guess) + dot(w, w)

        guess = load.rates(system.velocity(self._projected(system, rows, mu)), g)
        if load.by_rate:
            w, mismatch, enough = newton_of_kicks(lambda y: h * load.efforts(t, y, g), led_to, guess)
        else:
            w, mismatch, enough, _ = newton(equation, guess)
        if not mismatch <= enough:
            raise NoConvergence(f"{self!r}: no velocity found that fits the load at the end of a step; try h = {h:g}")
        return h * load.at_rates(t, w, g)

    # ---------------------------------------------------------------- sizes

    def _square(self, system: Any, x: Vec) -> float:
        """The square of the norm by the inertia, x . J x."""
        return dot(x, system.body.body.lagrangian.momentum(x))

    def _size(self, system: Any, g: Element) -> float:
        """The size of a configuration, for rounding: the sum of J_ii s_i^2 with the displacements s_i that count as
        large there, angles of 1 rad and, of positions, how far away they are.
        """
        J, scale = system.body.body.lagrangian.inertia, system.configurations.scale(plain(g))
        return vectors.sum([(J[i, i] if isinstance(J, vectors.Mat) else J[i]) * x * x for i, x in enumerate(scale)])

    def _sizes(self, system: Any, g: np.ndarray) -> np.ndarray:
        """Those of many configurations, (count,)."""
        J, scales = system.body.body.lagrangian.inertia, system.configurations._scales(g)
        moments = np.array([J[i, i] for i in range(len(J))] if isinstance(J, vectors.Mat) else [*J])
        return np.cumsum(moments * scales * scales, axis=-1)[:, -1]

    def _is_inside(self, system: Any, x: Vec) -> bool:
        inside = True
        for group, start, end in system.blocks:
            inside = inside and self.retraction.is_chart(group, 2.0 * x[start:end])
        return inside

    def _ended(self, system: Any, h: float, end: float, memory: Memory, x: Vec) -> NoConvergence:
        """The error of a step without a solution of its own."""
        why = near_a_dead_point(system, plain(memory.state.g)) or (
            f"The step h = {h:g} is too large for this motion; try {0.25 * h:g}"
        )
        return NoConvergence(
            f"{self!r}: the solution that grows out of h = 0 ends at h = {end:.3g}, |h xi| = "
            f"{norm(x):.2g}, in a fold or at the chart's edge. {why}"
        )


def near_a_dead_point(system: Any, g: Element) -> str | None:
    """Which conditions nearly depend on each other here; None if none do."""
    if not getattr(system, "has_loops", True):  # a tree has none
        return None
    weakest = system.independence(g)
    if not weakest < 0.1:
        return None
    return (
        f"Near here {system.weakest(g)} depend on each other (the least singular value of G "
        f"is {weakest:.1e} of what it is for unrelated conditions): the mechanism is close to a "
        "dead point, where it may go on in several ways, or in none"
    )


# ------------------------------------------------------------------ block by block


def carried(retraction: Retraction, group: Any, x: Vec, by_p: float | Mat, row: Vec) -> Vec:
    """The share of a unit impulse along a row of G in the mismatch r = by_p (p - dtau_x* m),
    right-trivialised.
    """
    dual = retraction.dtau_dual(group, -x, row)
    return by_p @ dual if isinstance(by_p, vectors.Mat) else by_p * dual


def less(y: Vec, columns: Any, shares: Any) -> Vec:
    """y without these shares of the columns."""
    for share, column in zip(shares, columns):
        y = y - share * column
    return y


def split(unknown: Vec, dim: int) -> tuple[Vec, Vec]:
    """Displacement, (dim,), and impulses, the pieces of the unknown."""
    return unknown[:dim], unknown[dim:]


def eliminated(m: Mat, columns: list[Vec], sign: float) -> tuple[list[Vec], bool]:
    """m^-1 of each column, for matrices such as those of a step that is not too large: their symmetric part is positive;
    and whether det m has the sign of that of a positive matrix times `sign`.
    """
    n = len(m)
    rows, pivots = triangular([vec(*m[i], *[column[i] for column in columns]) for i in range(n)])
    solution: list[Any] = []  # from the last row upwards, each of all columns
    for k in range(n - 1, -1, -1):
        remainder = vec(*rows[k][n:])
        for i, x in enumerate(solution):
            remainder = remainder - rows[k][n - 1 - i] * x
        solution = [*solution, remainder / rows[k][k]]
    return [vec(*[solution[n - 1 - i][j] for i in range(n)]) for j in range(len(columns))], keep_sign(pivots, sign)


def regular(system: Any, m: list[list[Any]], pivots: list[Any], sign: float) -> bool:
    """Whether det m has the sign of that of a positive matrix times `sign`, with no pivot below DEPENDENT times what it
    was before.
    """
    independent = True
    for row, pivot, ends in zip(m, pivots, system.elimination):
        independent = independent and abs(pivot) > DEPENDENT * abs(row[ends[0]])
    return independent and keep_sign(pivots, sign)
