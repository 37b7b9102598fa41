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

from ...compiler.numbers.square_blocks import save_block
from ...compiler.sites.planes import columns, each
from ...errors import NoConvergence
from ...formulas import Mat, Vec, dot, identity_matrix, jacobian, mat, plain, record, vec, where
from ...formulas.classes.layouts import Layout, matrix, vector
from ...formulas.columns import named
from ...formulas.sites import own, padded
from ...formulas.tables import entry
from ...groups.lie_group import LieGroup
from ...groups.retractions import Exponential
from ...integrators.memory import Memory, extrapolated, followed, repeated
from ...integrators.solvability import CONTRACTION, INFINITY, LEAST, MOST, ROUNDING
from ...integrators.variational import with_inertia
from ...solvers import NOISE
from ...systems.lie_poisson import BodyState
from .block_elimination import BLOCKS, Elimination, factor, fill, substitute
from .steps_together import StepsTogether, copied, grown_together, summed_over
from .terms.terms_at_site import at_this_site


def work_of(n: int) -> Layout:
    """The layout of what each site has beside what the method carries along, for a group of n dimensions."""
    row, block = vector(n), matrix(n, n)
    alone = Layout("tuple", (row,))
    return named(
        unknown=alone,  # the displacement x
        slope=alone,  # along which the solution grows
        force=row,  # of the bond to the next site, and of what the site has on its own
        push=row,  # of that bond on the next site
        residual=row,  # -(2/h) r
        diagonal=row,  # zero: no size is asked of a pivot
        solution=row,  # zeta
        squares=vector(3),  # squares of the correction, of the displacement, of what is large where the site is
        own=block,  # -df/dzeta of the site itself
        right=block,  # by the next site
        back=block,  # of the push by the site itself
        ahead=block,  # of the push by the next site
        blocks=Layout("tuple", ()),
    )


@record
class GalerkinOfChain(StepsTogether):
    """GalerkinVariational(order=2), or a composition of it, of sites that are tied each to the next."""

    edges: Any  # the terms of two sites, as roles of the first of them
    alone: Any  # the terms of one site
    before: Any  # of each site the one before it
    tied: Any  # of each site 1 if there is one before it, else 0
    sites: float  # the number of sites
    order: Elimination  # of sites
    work: Layout  # of the numbers that a site has in memory
    shares: Any  # of the substeps, each with its node
    substeps: float  # the number of substeps
    stages: int  # that number, for the claims

    symmetric: ClassVar[bool] = True

    @property
    def room(self) -> int:
        return self.work.width + self.order.rows(self.work.parts[0].width, int(self.sites))

    def start(self, system: Any, state: Any, h: float) -> Memory:
        """A state, and pasts of displacements at its velocity."""
        xi = system.velocity(plain(state.mu))
        pasts = [repeated((h * entry(self.shares, 2 * s)) * xi) for s in range(self.stages)]
        return Memory(state, None, tuple(pasts))

    def observe(self, memory: Memory) -> Any:
        """The state of the site in the memory."""
        return memory.state

    def step_together(
        self, system: Any, t: float, h: float, sites: Any, source: int, target: int, memory: Layout
    ) -> None:
        """A step of all sites, from one copy of the memory to the other."""
        places = columns(sites, copies=(memory, memory), work=self.work)
        work, new_memory = places.work.fields, places.copies.nth(target)
        each(sites, copied, places.copies.nth(source), new_memory)
        old, pasts = new_memory.fields.state, new_memory.fields.past
        for s in range(int(self.substeps)):
            share, node = entry(self.shares, 2 * s), entry(self.shares, 2 * s + 1)
            self.substep(system, t + node * h, share * h, sites, old, pasts.nth(s), work)

    def substep(self, system: Any, t: float, h: float, sites: Any, old: Any, past: Any, work: Any) -> None:
        """One step: Newton's method from the displacements that continue those before, with the
        derivative of the last correction while that is good enough.  Where that leads nowhere the
        solution is grown out of h = 0, in parts of the step.
        """
        each(sites, guessed, system, h, old, past, work)
        reached, _ = grown_together(sites, work, self.newton, system, t, h, old)
        if reached < 1.0:
            raise NoConvergence("no displacements found that fit the momenta and the forces")
        each(sites, ended, self, system, t, h, old, past, work)

    def newton(
        self, part: float, count: float, sites: Any, work: Any, system: Any, t: float, h: float, old: Any
    ) -> tuple[bool, float, float]:
        """Newton's method at a part of the step: has it found displacements, after how many corrections; and no remark."""
        h = part * h
        before, anew, settled = INFINITY, True, False
        while True:
            each(sites, forces_here, self, system, old, work)
            if settled:
                break
            each(sites, misfit_here, self, system, t, h, old, work)
            if anew:
                each(sites, slopes_here, self, system, old, work)
                each(sites, block_here, self, system, t, h, old, work)
                fill(self.order, work)
                factor(self.order, 1.0, work)
            substitute(self.order, work)
            each(sites, corrected, system, old, work)
            length, whole, size = summed_over(work.squares, self.sites)
            count = count + 1.0
            shrinks = length <= CONTRACTION * before
            small = length <= NOISE * NOISE * (whole + size)
            if not (length < INFINITY and (shrinks or small or anew) and count < MOST):
                break
            if not (shrinks or small) and length > before:
                break
            settled = length <= ROUNDING * size or (before < INFINITY and length * (length / before) <= LEAST * whole)
            settled = settled or (small and not shrinks)
            anew = not (shrinks or before == INFINITY) or (anew and length > FAR * whole)
            before = length
        return settled, count, 0.0


FAR = 2.0**-8
"""A correction beyond this part of the displacement, both squared, asks for a derivative where it
leads.
"""


# ------------------------------------------------------------------ formulas of one site


def guessed(system: Any, h: float, old: Any, past: Any, work: Any) -> None:
    """The displacement that continues those of the last steps, and the slope with which it begins."""
    xi = at_this_site(system).velocity(plain(old.load().mu))
    work.unknown.save((extrapolated(*past.load()),))
    work.slope.save((h * xi,))


def middle_of(system: Any, old: Any, work: Any) -> tuple[Any, Vec, Any]:
    """The state at the start of the step, x, and the element half-way."""
    start, (x,) = old.load(), work.unknown.load()
    return start, x, system.configurations.compose_exp(plain(start.g), 0.5 * x)


def forces_here(method: Any, system: Any, old: Any, work: Any) -> None:
    """The forces of the bond to the next site on both of its ends, and of what this site has on its own."""
    group, (_, _, g) = system.configurations, middle_of(system, old, work)
    me, meeting, view = system.potential.site_and_others(None, g, None, method.edges)
    force = push = vec(*[0.0 for _ in range(group.dim)])
    for role in method.edges:
        ends = [me, *[view(meeting.of(b, 0)) for b in role.others]]
        first, second = role.at_edge(0).forces(group, *ends)
        force, push = force + role.if_there(first), push + role.if_there(second)
    for role in method.alone:
        force = force + role.at_edge(0).forces(group, me)[0]
    work.force.save(force)
    work.push.save(push)


def slopes_here(method: Any, system: Any, old: Any, work: Any) -> None:
    """The derivatives of the forces of `forces_here` by the elements of both ends."""
    group, (_, _, g) = system.configurations, middle_of(system, old, work)
    n = group.dim
    me, meeting, view = system.potential.site_and_others(None, g, None, method.edges)
    blocks = [mat(*[vec(*[0.0 for _ in range(n)]) for _ in range(n)]) for _ in range(4)]
    for role in method.edges:
        ends = [me, *[view(meeting.of(b, 0)) for b in role.others]]
        (aa, ab), (ba, bb) = role.at_edge(0).stiffnesses(group, *ends)
        blocks = [a + mat(*[role.if_there(row) for row in b]) for a, b in zip(blocks, (aa, ab, ba, bb))]
    for role in method.alone:
        blocks = [blocks[0] + role.at_edge(0).stiffnesses(group, me)[0][0], *blocks[1:]]
    for column, block in zip((work.own, work.right, work.back, work.ahead), blocks):
        column.save(block)


def force_on(method: Any, work: Any) -> Vec:
    """The force of all bonds on a site."""
    pushed = own(method.tied) * work.push.at(own(method.before))
    return work.force.load() + pushed


def pulled(method: Any, system: Any, t: float, h: float, x: Vec, g: Any, work: Any) -> tuple[Any, Vec]:
    """The system of a site, and all forces on it."""
    site = at_this_site(system)
    f = force_on(method, work)
    if system.load is not None:
        f = f + site.load.covector(t + 0.5 * h, (1.0 / h) * x, g)
    return site, system.potential.moving(f)


def misfit(group: LieGroup, h: float, x: Vec, p: Vec, mu: Vec, f: Vec) -> tuple[Vec, Mat]:
    """p - (dexp_x)* mu - (h/2) (dexp_x/2)* f, right-trivialised, and its derivative by x."""
    tau = Exponential()
    whole, _, slope = tau.residual(group, x, p, mu)
    half, _, bend = tau.residual(group, 0.5 * x, 0.0 * p, f)
    return whole + (0.5 * h) * half, slope + (0.25 * h) * bend


def misfit_here(method: Any, system: Any, t: float, h: float, old: Any, work: Any) -> None:
    """The right side -(2/h) r, carried to the middle."""
    group = system.configurations
    start, x, g = middle_of(system, old, work)
    site, f = pulled(method, system, t, h, x, g, work)
    r, _ = misfit(group, h, x, site.body.lagrangian.momentum((1.0 / h) * x), plain(start.mu), f)
    right_side = (-2.0 / h) * Exponential().dtau_inv_dual(group, -0.5 * x, r)
    work.residual.save(system.potential.moving(right_side))


def block_here(method: Any, system: Any, t: float, h: float, old: Any, work: Any) -> None:
    """H + 4/h M in the block of the site itself, and H in those beside it."""
    group, tau = system.configurations, Exponential()
    n, moves = group.dim, system.potential.moving
    start, x, g = middle_of(system, old, work)
    site, f = pulled(method, system, t, h, x, g, work)
    mu, xi, units = plain(start.mu), (1.0 / h) * x, identity_matrix(n)
    tied, before = own(method.tied), own(method.before)
    _, slope = misfit(group, h, x, site.body.lagrangian.momentum(xi), mu, f)
    M = with_inertia(slope, (1.0 / h) * site.body.lagrangian.hessian(xi))
    back = mat(*[tau.dtau_inv(group, 0.5 * x, unit) for unit in units]).T
    forth = mat(*[tau.dtau_inv_dual(group, -0.5 * x, unit) for unit in units]).T
    D = work.own.load() + tied * work.ahead.at(before)
    D = D + (4.0 / h) * (forth @ (M @ back))
    if system.load is not None:

        def loaded(y: Vec) -> Vec:
            return site.load.covector(t + 0.5 * h, y[:n], group.compose_exp(g, y[n:]))

        slope = jacobian(loaded, vec(*xi, *[0.0 for _ in range(n)]))
        by_xi, by_g = (mat(*[row[k : k + n] for row in slope]) for k in (0, n))
        D = D - (by_g + (2.0 / h) * (by_xi @ back))
    left, right = tied * work.back.at(before), work.right.load()
    D, left, right = (rows_moving(moves, m) for m in (D, left, right))
    free = moves(vec(*[1.0 for _ in range(n)]))
    D = mat(*[D[i] + (1.0 - free[i]) * units[i] for i in range(n)])
    for slot, block in enumerate((D, right, left)):
        save_block(work.blocks, BLOCKS, slot, block)


def rows_moving(moves: Any, m: Mat) -> Mat:
    """A matrix whose rows of components that are held are zero."""
    return mat(*[moves(column) for column in m.T]).T


def corrected(system: Any, old: Any, work: Any) -> None:
    """The displacement after a correction, and what it tells: the squares of the correction, of the
    displacement, and of what is large where the site is.
    """
    group, momentum = system.configurations, at_this_site(system).body.lagrangian.momentum
    (x,), zeta = work.unknown.load(), work.solution.load()
    dx = 2.0 * Exponential().dtau_inv(group, 0.5 * x, zeta)
    x = x + dx
    size = group.scale(plain(old.load().g))
    length = where(Exponential().is_chart(group, 0.75 * x), dot(dx, momentum(dx)), INFINITY)
    work.unknown.save((x,))
    work.squares.save(vec(length, dot(x, momentum(x)), dot(size, momentum(size))))


def ended(method: Any, system: Any, t: float, h: float, old: Any, past: Any, work: Any) -> None:
    """The state at the end of the step, and the past with this step."""
    start, x, g = middle_of(system, old, work)
    _, f = pulled(method, system, t, h, x, g, work)
    kick = h * Exponential().tau_Ad_star(system.configurations, -0.5 * x, f)
    moved = system.body.displaced(Exponential(), BodyState(start.mu + kick, start.g), x)
    pasts = followed(past.load(), x)
    old.save(moved)
    past.save(pasts)


# ------------------------------------------------------------------ from site to site


def order_along(n: int, ring: bool) -> Elimination:
    """The elimination of n sites, one after the other.  Of a ring the last one is tied to all others by then, by blocks
    behind those of places.
    """
    end, behind = n - 1, BLOCKS * padded(n)
    blocks = {(k, k): BLOCKS * k for k in range(n)}
    blocks |= {(k, (k + turn) % n): BLOCKS * k + slot for k in range(n) for slot, turn in ((1, 1), (2, -1))}
    borders = [pair for k in range(1, end - 1) for pair in ((k, end), (end, k))] if ring else []
    blocks |= {pair: behind + i for i, pair in enumerate(borders)}
    later_of = [sorted({k + 1, end} if ring else {k + 1}) for k in range(end)]
    return Elimination.in_order(range(n), [*later_of, []], blocks, [blocks[pair] for pair in borders])
