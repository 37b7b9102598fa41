"""The midpoint variational method for chains and rings of sites: all sites of a step are solved for
together, by Newton's method with a block for each site and each bond.

With exp, `GalerkinVariational(order=2)` is, for the displacement x of each site and the force f_m on
it where all sites are half-way, g_m = g exp(x/2),

    J x/h = (dexp_x)* mu + (h/2) (dexp_x/2)* f_m  (right-trivialised),   mu_i+1 = Ad*_exp(x) (mu + h Ad*_exp(-x/2) f_m).

A correction zeta = dexp_x/2 dx/2 of the middle, left-trivialised, is the solution of

    (H + 4/h M) zeta = -(2/h) r,   H_jk = -df_j/dzeta_k,

with the mismatch r and its derivative M at fixed forces, both carried to the middle: M is nearly J/h.  H ties
each site to the next alone, so that elimination goes once along the chain; of a ring the last site is
a border.

Source: Marsden and West, Acta Numerica 10 (2001), section 2.6 (the method); Golub and Van Loan,
Matrix Computations, 4th ed., section 4.5 (block tridiagonal systems).
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.sites.planes import at, below, each, load, put, save
from ...errors import NoConvergence
from ...formulas import Mat, Record, Vec, dot, identity_matrix, jacobian, mat, plain, record, vec, where
from ...formulas.classes.layouts import Layout, matrix, vector
from ...formulas.elimination import inverted
from ...formulas.numbers.conversions import fitted
from ...formulas.sites import own
from ...formulas.tables import entry
from ...groups.lie_group import LieGroup
from ...groups.retractions import Exponential
from ...integrators.memory import Memory, extrapolated, followed, repeated
from ...integrators.solvability import CONTRACTION, INFINITY, LEAST, ROUNDING, SHORTEST
from ...integrators.variational import with_inertia
from ...solvers import NOISE
from ...systems.lie_poisson import BodyState
from .terms.terms_at_site import at_this_site

MOST = 500.0
"""Corrections in a step after which it is given up."""


@record
class ChainRows(Record):
    """The rows with which the numbers begin that a step works with, piece by piece."""

    unknown: int
    slope: int
    force: int
    push: int
    rest: int
    answer: int
    told: int
    own: int
    right: int
    back: int
    ahead: int
    left: int
    column: int
    row: int
    end: int

    @classmethod
    def of(cls, n: int) -> ChainRows:
        """The rows for a group of n dimensions, one piece behind the other."""
        widths = [*[n] * 6, 3, *[n * n] * 7]
        places = [sum(widths[:k]) for k in range(len(widths) + 1)]
        return cls(*places)


@record
class GalerkinOfChain(Record):
    """GalerkinVariational(order=2), or a composition of it, of sites that are tied each to the next.

    edges : the terms of two sites as the first of them has them, in forms of a site.  alone : those
    of one site.  before : of each site the one before it.  tied : 1 if there is one.  ring : is the
    first site tied to the last?  sites : how many there are.  shares : of the substeps, each with
    its node.  substeps, stages : how many there are.
    """

    edges: Any
    alone: Any
    before: Any
    tied: Any
    ring: bool
    sites: float
    rows: ChainRows
    shares: Any
    substeps: float
    stages: int
    name: str = ""

    together: ClassVar[bool] = True
    settles: ClassVar[bool] = False
    symmetric: ClassVar[bool] = True

    def __repr__(self) -> str:
        return self.name

    @property
    def room(self) -> int:
        """Rows of numbers that a step works with."""
        return self.rows.end

    def start(self, system: Any, state: Any, h: float) -> Memory:
        """A state, and pasts of displacements at its velocity."""
        xi = system.velocity(plain(state.mu))
        pasts = [repeated((h * entry(self.shares, 2 * s)) * xi) for s in range(self.stages)]
        return Memory(state, None, tuple(pasts))

    def observe(self, memory: Memory) -> Any:
        """The state of the site in the memory."""
        return memory.state

    def step_together(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Layout) -> None:
        """A step of all sites, from one copy of the memory to the other."""
        work = below(sites, 2 * memory.width)
        each(sites, copied, sites, here, there, memory)
        state = memory.parts[0]
        old = below(sites, there * memory.width)
        pasts = below(old, state.width)
        for s in range(int(self.substeps)):
            share, node = entry(self.shares, 2 * s), entry(self.shares, 2 * s + 1)
            self.substep(system, t + node * h, share * h, sites, old, pasts, s, work, state)

    def substep(
        self, system: Any, t: float, h: float, sites: Any, old: Any, pasts: Any, s: int, work: Any,
        state: Layout,
    ) -> None:  # fmt: skip
        """One step: Newton's method from the displacements that continue those before, with the
        derivative of the last correction while that is good enough.  Where that leads nowhere the
        solution is grown out of h = 0, in parts of the step.
        """
        n = system.configurations.dim
        each(sites, guessed, self, system, h, old, pasts, s, work, state)
        reached, piece, part, tried = 0.0, 1.0, 1.0, 0.0
        while True:
            k = part * h
            before, anew, last = INFINITY, True, False
            while True:
                each(sites, forces_here, self, system, old, work, state)
                if last:
                    break
                each(sites, misfit_here, self, system, t, k, old, work, state)
                if anew:
                    each(sites, slopes_here, self, system, old, work, state)
                    each(sites, block_here, self, system, t, k, old, work, state)
                    factored(self, work, n)
                solved(self, work, n)
                each(sites, corrected, self, system, old, work, state)
                length, whole, size = summed(self, work)
                tried = tried + 1.0
                shrinks = length <= CONTRACTION * before
                small = length <= NOISE * NOISE * (whole + size)
                if not (length < INFINITY and (shrinks or small or anew) and tried < MOST):
                    break
                if not (shrinks or small) and length > before:
                    break
                last = length <= ROUNDING * size or (before < INFINITY and length * (length / before) <= LEAST * whole)
                last = last or (small and not shrinks)
                anew = not (shrinks or before == INFINITY) or (anew and length > FAR * whole)
                before = length
            if last:
                reached, piece = part, 2.0 * piece
                if reached < 1.0:
                    each(sites, sloped, self, 1.0 / part, work, n)
            else:
                piece = 0.5 * piece
            part = min(1.0, reached + piece)
            if not (reached < 1.0 and piece > SHORTEST and tried < MOST):
                break
            each(sites, along_slope, self, part, work, n)
        if reached < 1.0:
            raise NoConvergence("no displacements found that fit the momenta and the forces")
        each(sites, ended, self, system, t, h, old, pasts, s, work, state)


FAR = 2.0**-8
"""A correction beyond this part of the displacement, both squared, asks for a derivative where it
leads.
"""


# ------------------------------------------------------------------ formulas of one site


def copied(sites: Any, here: int, there: int, memory: Layout) -> None:
    """A place as it is."""
    save(sites, there, load(sites, here, memory), memory)


def guessed(method: Any, system: Any, h: float, old: Any, pasts: Any, s: int, work: Any, state: Layout) -> None:
    """The displacement that continues those of the last steps, and the slope with which it begins."""
    rows, n = method.rows, system.configurations.dim
    past = [load(pasts, 3 * s + i, vector(n)) for i in range(3)]
    xi = at_this_site(system).velocity(plain(load(old, 0, state).mu))
    save(below(work, rows.unknown), 0, extrapolated(*past), vector(n))
    save(below(work, rows.slope), 0, h * xi, vector(n))


def sloped(method: Any, factor: float, work: Any, n: int) -> None:
    """The displacement over the part of the step, along which it goes on."""
    x = load(below(work, method.rows.unknown), 0, vector(n))
    save(below(work, method.rows.slope), 0, factor * x, vector(n))


def along_slope(method: Any, part: float, work: Any, n: int) -> None:
    """The displacement of a part of the step."""
    slope = load(below(work, method.rows.slope), 0, vector(n))
    save(below(work, method.rows.unknown), 0, part * slope, vector(n))


def middle_of(method: Any, system: Any, old: Any, work: Any, state: Layout) -> tuple[Any, Vec, Any]:
    """The state at the start of the step, x, and the element half-way."""
    group = system.configurations
    start = load(old, 0, state)
    x = load(below(work, method.rows.unknown), 0, vector(group.dim))
    return start, x, group.compose_exp(plain(start.g), 0.5 * x)


def forces_here(method: Any, system: Any, old: Any, work: Any, state: Layout) -> None:
    """The forces of the bond to the next site on both of its ends, and of what this site has on its
    own.
    """
    rows, group = method.rows, system.configurations
    _, _, g = middle_of(method, system, old, work, state)
    me, meeting, view = system.potential.met(None, g, None, method.edges)
    force = push = vec(*[0.0 for _ in range(group.dim)])
    for role in method.edges:
        ends = [me, *[view(meeting.of(b, 0)) for b in role.others]]
        first, second = role.at_edge(0).forces(group, *ends)
        force, push = force + role.if_there(first), push + role.if_there(second)
    for role in method.alone:
        force = force + role.at_edge(0).forces(group, me)[0]
    save(below(work, rows.force), 0, force, vector(group.dim))
    save(below(work, rows.push), 0, push, vector(group.dim))


def slopes_here(method: Any, system: Any, old: Any, work: Any, state: Layout) -> None:
    """The derivatives of the forces of `forces_here` by the elements of both ends."""
    rows, group = method.rows, system.configurations
    n = group.dim
    _, _, g = middle_of(method, system, old, work, state)
    me, meeting, view = system.potential.met(None, g, None, method.edges)
    blocks = [mat(*[vec(*[0.0 for _ in range(n)]) for _ in range(n)]) for _ in range(4)]
    for role in method.edges:
        ends = [me, *[view(meeting.of(b, 0)) for b in role.others]]
        (aa, ab), (ba, bb) = role.at_edge(0).stiffnesses(group, *ends)
        blocks = [a + mat(*[role.if_there(row) for row in b]) for a, b in zip(blocks, (aa, ab, ba, bb))]
    for role in method.alone:
        blocks = [blocks[0] + role.at_edge(0).stiffnesses(group, me)[0][0], *blocks[1:]]
    for place, block in zip((rows.own, rows.right, rows.back, rows.ahead), blocks):
        save(below(work, place), 0, block, matrix(n, n))


def force_on(method: Any, work: Any, n: int) -> Vec:
    """The force of all bonds on a site."""
    place = below(work, method.rows.push)
    pushed = own(method.tied) * at(place, own(method.before), 0, vector(n))
    return load(below(work, method.rows.force), 0, vector(n)) + pushed


def pulled(method: Any, system: Any, t: float, h: float, x: Vec, g: Any, work: Any) -> tuple[Any, Vec]:
    """The system of a site, and all forces on it."""
    site = at_this_site(system)
    f = force_on(method, work, system.configurations.dim)
    if system.load is not None:
        f = f + site.load.covector(t + 0.5 * h, (1.0 / h) * x, g)
    return site, system.potential.moving(f)


def misfit(group: LieGroup, h: float, x: Vec, p: Vec, mu: Vec, f: Vec) -> tuple[Vec, Mat]:
    """p - (dexp_x)* mu - (h/2) (dexp_x/2)* f, right-trivialised, and its derivative by x."""
    tau = Exponential()
    whole, _, slope = tau.residual(group, x, p, mu)
    half, _, bend = tau.residual(group, 0.5 * x, 0.0 * p, f)
    return whole + (0.5 * h) * half, slope + (0.25 * h) * bend


def misfit_here(method: Any, system: Any, t: float, h: float, old: Any, work: Any, state: Layout) -> None:
    """The right side -(2/h) r, carried to the middle."""
    group = system.configurations
    start, x, g = middle_of(method, system, old, work, state)
    site, f = pulled(method, system, t, h, x, g, work)
    r, _ = misfit(group, h, x, site.body.lagrangian.momentum((1.0 / h) * x), plain(start.mu), f)
    right_side = (-2.0 / h) * Exponential().dtau_inv_dual(group, -0.5 * x, r)
    save(below(work, method.rows.rest), 0, system.potential.moving(right_side), vector(group.dim))


def block_here(method: Any, system: Any, t: float, h: float, old: Any, work: Any, state: Layout) -> None:
    """H + 4/h M in the block of the site itself, and H in those beside it."""
    rows, group, tau = method.rows, system.configurations, Exponential()
    n, moves = group.dim, system.potential.moving
    start, x, g = middle_of(method, system, old, work, state)
    site, f = pulled(method, system, t, h, x, g, work)
    mu, xi, units = plain(start.mu), (1.0 / h) * x, identity_matrix(n)
    tied, before = own(method.tied), own(method.before)
    _, slope = misfit(group, h, x, site.body.lagrangian.momentum(xi), mu, f)
    M = with_inertia(slope, (1.0 / h) * site.body.lagrangian.hessian(xi))
    back = mat(*[tau.dtau_inv(group, 0.5 * x, unit) for unit in units]).T
    forth = mat(*[tau.dtau_inv_dual(group, -0.5 * x, unit) for unit in units]).T
    D = load(below(work, rows.own), 0, matrix(n, n))
    D = D + tied * at(below(work, rows.ahead), before, 0, matrix(n, n))
    D = D + (4.0 / h) * (forth @ (M @ back))
    if system.load is not None:

        def loaded(y: Vec) -> Vec:
            return site.load.covector(t + 0.5 * h, y[:n], group.compose_exp(g, y[n:]))

        slope = jacobian(loaded, vec(*xi, *[0.0 for _ in range(n)]))
        by_xi, by_g = (mat(*[row[k : k + n] for row in slope]) for k in (0, n))
        D = D - (by_g + (2.0 / h) * (by_xi @ back))
    left = tied * at(below(work, rows.back), before, 0, matrix(n, n))
    right = load(below(work, rows.right), 0, matrix(n, n))
    D, left, right = (rows_moving(moves, m) for m in (D, left, right))
    free = moves(vec(*[1.0 for _ in range(n)]))
    D = mat(*[D[i] + (1.0 - free[i]) * units[i] for i in range(n)])
    for place, block in ((rows.own, D), (rows.left, left), (rows.right, right)):
        save(below(work, place), 0, block, matrix(n, n))


def rows_moving(moves: Any, m: Mat) -> Mat:
    """A matrix whose rows of components that are held are zero."""
    return mat(*[moves(column) for column in m.T]).T


def corrected(method: Any, system: Any, old: Any, work: Any, state: Layout) -> None:
    """The displacement after a correction, and what it tells: the squares of the correction, of the
    displacement, and of what is large where the site is.
    """
    rows, group, site = method.rows, system.configurations, at_this_site(system)
    place, layout = below(work, rows.unknown), vector(group.dim)
    x, zeta = load(place, 0, layout), load(below(work, rows.answer), 0, layout)
    momentum = site.body.lagrangian.momentum
    dx = 2.0 * Exponential().dtau_inv(group, 0.5 * x, zeta)
    x = x + dx
    size = group.scale(plain(load(old, 0, state).g))
    length = where(Exponential().is_chart(group, 0.75 * x), dot(dx, momentum(dx)), INFINITY)
    squares = vec(length, dot(x, momentum(x)), dot(size, momentum(size)))
    save(place, 0, x, layout)
    save(below(work, rows.told), 0, squares, vector(3))


def ended(
    method: Any, system: Any, t: float, h: float, old: Any, pasts: Any, s: int, work: Any,
    state: Layout,
) -> None:  # fmt: skip
    """The state at the end of the step, and the past with this step."""
    group = system.configurations
    n = group.dim
    start, x, g = middle_of(method, system, old, work, state)
    _, f = pulled(method, system, t, h, x, g, work)
    kick = h * Exponential().tau_Ad_star(group, -0.5 * x, f)
    moved = system.body.displaced(Exponential(), BodyState(start.mu + kick, start.g), x)
    past = [load(pasts, 3 * s + i, vector(n)) for i in range(3)]
    save(old, 0, fitted(moved, state), state)
    for i, y in enumerate(followed(tuple(past), x)):
        save(pasts, 3 * s + i, y, vector(n))


# ------------------------------------------------------------------ from site to site


def factored(method: Any, work: Any, n: int) -> None:
    """Elimination of the blocks, in place: of D its inverse stays, of the block left of it the factor
    of the row before.  Of a ring `column` ties a site to the last one, and `row` the last one to it.
    """
    rows, square, zero = method.rows, matrix(n, n), vec(*[0.0 for _ in range(n)])
    D, left, right = (below(work, k) for k in (rows.own, rows.left, rows.right))
    column, row = below(work, rows.column), below(work, rows.row)
    count = int(method.sites)
    end = count - 1
    if method.ring:
        put(column, 0, 0, at(left, 0, 0, square), square)
        put(row, 0, 0, at(right, end, 0, square), square)
    for k in range(count):
        inverse, _, _ = inverted(at(D, k, 0, square), zero, 1.0)
        put(D, k, 0, inverse, square)
        if k < end:
            above = at(right, k, 0, square)
            if method.ring:
                beside, low = at(column, k, 0, square), at(row, k, 0, square)
                factor = low @ inverse
                put(row, k, 0, factor, square)
                if k < end - 1:
                    put(row, k + 1, 0, -(factor @ above), square)
                    lower = at(left, k + 1, 0, square) @ inverse
                    put(column, k + 1, 0, -(lower @ beside), square)
                    put(left, k + 1, 0, lower, square)
                    put(D, k + 1, 0, at(D, k + 1, 0, square) - lower @ above, square)
                if k == end - 2:
                    put(column, k + 1, 0, at(column, k + 1, 0, square) + at(right, k + 1, 0, square), square)
                    put(row, k + 1, 0, at(row, k + 1, 0, square) + at(left, end, 0, square), square)
                put(D, end, 0, at(D, end, 0, square) - factor @ beside, square)
            else:
                lower = at(left, k + 1, 0, square) @ inverse
                put(left, k + 1, 0, lower, square)
                put(D, k + 1, 0, at(D, k + 1, 0, square) - lower @ above, square)


def solved(method: Any, work: Any, n: int) -> None:
    """The corrections, from the right sides and the blocks after elimination."""
    rows, square, layout = method.rows, matrix(n, n), vector(n)
    D, left, right = (below(work, k) for k in (rows.own, rows.left, rows.right))
    column, row = below(work, rows.column), below(work, rows.row)
    right_side, answer = below(work, rows.rest), below(work, rows.answer)
    count = int(method.sites)
    end = count - 1
    for k in range(end):
        y = at(right_side, k, 0, layout)
        if method.ring:
            put(right_side, end, 0, at(right_side, end, 0, layout) - at(row, k, 0, square) @ y, layout)
            if k < end - 1:
                put(right_side, k + 1, 0, at(right_side, k + 1, 0, layout) - at(left, k + 1, 0, square) @ y, layout)
        else:
            put(right_side, k + 1, 0, at(right_side, k + 1, 0, layout) - at(left, k + 1, 0, square) @ y, layout)
    put(answer, end, 0, at(D, end, 0, square) @ at(right_side, end, 0, layout), layout)
    for back in range(end):
        k = end - 1 - back
        y = at(right_side, k, 0, layout)
        if method.ring:
            y = y - at(column, k, 0, square) @ at(answer, end, 0, layout)
            if k < end - 1:
                y = y - at(right, k, 0, square) @ at(answer, k + 1, 0, layout)
        else:
            y = y - at(right, k, 0, square) @ at(answer, k + 1, 0, layout)
        put(answer, k, 0, at(D, k, 0, square) @ y, layout)


def summed(method: Any, work: Any) -> tuple[float, float, float]:
    """The sums over all sites of what a correction tells."""
    squares = below(work, method.rows.told)
    total = at(squares, 0, 0, vector(3))
    for k in range(1, int(method.sites)):
        total = total + at(squares, k, 0, vector(3))
    return total[0], total[1], total[2]
