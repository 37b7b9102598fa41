"""Elimination of impulses from joint to joint, in an order that was found before the run: a block of conditions for
each joint, and for each pair of joints that a body ties together.

Source: Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2nd ed., chapter 9.
"""

from __future__ import annotations

from typing import Any

from ...compiler.numbers.square_blocks import block_at, put_block, save_block
from ...compiler.sites.planes import each
from ...errors import NoConvergence
from ...formulas import Mat, Vec, constant, dot, mat, vec, where
from ...formulas.numbers.conversions import resting
from ...formulas.tables import entry, whole
from ...integrators.kicks.explicit_kicks import negative_pivots
from ...rooms.sites.block_elimination import BLOCKS, factor, fill, substitute
from ...systems.kinetic_energy import times
from .links import DEAD_POINT, REST6, both, pull_on, speeds, wrenches

# ------------------------------------------------------------------ formulas of one joint


def save_answers(system: Any, sides: Any, answers: Any, sign: float, h: float, work: Any, equations: Any) -> None:
    """The answers of bodies to a joint's impulses, and its own block: with h/A of its rotor, and on the diagonal 1 for
    conditions that do not count.  sign : of the matrix.
    """
    blank = [*[sign * (1.0 - x) for x in work.alive.load()], *[1.0] * (equations.diagonal.width - system.most)]
    if system.geared:
        blank[system.most - 1] = blank[system.most - 1] + h * work.lightness.load()
    if system.parts > 0:
        sides = [[x * row for row in side] for x, side in zip(work.off_hubs.load(), sides)]
    block = [
        vec(*[dot(a, p) + dot(b, q) + (blank[i] if i == j else 0.0) for j, (p, q) in enumerate(zip(*answers))])
        for i, (a, b) in enumerate(zip(*sides))
    ]
    equations.answers.save(tuple([mat(*resting(side)) for side in answers]))
    equations.diagonal.save(vec(*[abs(constant(row[i])) for i, row in enumerate(block)]))
    save_block(equations.blocks, BLOCKS, 0, mat(*resting(block)))


def free_answers(sides: Any, work: Any) -> list[list[Vec]]:
    """The answers of free bodies to the impulses of a joint, J^-1 G*."""
    return [[times(inverse, row) for row in side] for inverse, side in zip(both(work.inverse, work), sides)]


def tied(system: Any, sides: Any, work: Any, equations: Any) -> None:
    """The two blocks of a joint and another one that a body ties it to.  sides : the column of rows."""
    other, side, other_side, tied_to = work.tie.load()
    fixed_side, fixed_other = system.sides

    def of_joint(column: Any) -> Mat:
        return chosen(side, *column.load()) if fixed_side < 0 else column.nth(fixed_side).load()

    def beyond(column: Any) -> Mat:
        return (
            chosen(other_side, column.nth(0).at(other), column.nth(1).at(other))
            if fixed_other < 0
            else column.nth(fixed_other).at(other)
        )

    a, b = of_joint(sides), beyond(sides)
    p, q = of_joint(equations.answers), beyond(equations.answers)
    for slot, left, right in ((1, b, p), (2, a, q)):
        block = mat(*[vec(*[tied_to * dot(x, y) for y in right]) for x in resting(left)])
        save_block(equations.blocks, BLOCKS, slot, block)


def chosen(second: float, a: Mat, b: Mat) -> Mat:
    """One of two matrices: the second one, if `second` is 1."""
    return mat(*[vec(*[where(second > 0.0, y, x) for x, y in zip(u, v)]) for u, v in zip(a, b)])


def excess_of(system: Any, work: Any, equations: Any) -> None:
    """The rate off the constraint, G xi, and the answers of free bodies to impulses."""
    sides = equations.sides.load()
    save_answers(system, sides, free_answers(sides, work), 1.0, 1.0, work, equations)
    equations.residual.save(rates_off(system, sides, both(work.velocity, work), work))


def held_by_impulses(work: Any) -> None:
    """The pull of joints on a body, and its velocity under it."""
    pull = pull_on(work)
    work.impulse.save(pull)
    work.free_at_end.save(work.velocity.load() - times(work.inverse.load(), pull))


def excess_left(system: Any, work: Any, equations: Any) -> None:
    """The rate off the constraint under the impulses that were found."""
    equations.residual.save(rates_off(system, equations.sides.load(), both(work.free_at_end, work), work))


def rates_off(system: Any, sides: Any, velocities: Any, work: Any) -> Vec:
    """The rate off the constraint, and how far rates are from those at which their kick was found."""
    m, rates = system.most, speeds(sides, velocities)
    if system.rheonomic:
        rates = [x + pace for x, pace in zip(rates, work.paces.load())]
    off: list[Any] = []
    if system.freedoms > 0:
        off = [x - w for x, w in zip(rates[m:], work.rate.load())]
    if system.geared:
        rates = [*rates[: m - 1], rates[m - 1] - work.rotor.load()[1]]
    return vec(*rates[:m], *off)


def wrench_of_impulses(work: Any, equations: Any) -> None:
    """The pull of a joint on its bodies by the impulses that elimination has found."""
    work.wrench.save(wrenches(equations.solution.load(), equations.sides.load()))


# ------------------------------------------------------------------ of all joints


def pulled_by_solution(system: Any, sites: Any, work: Any, equations: Any) -> None:
    """The impulses that eliminated equations lead to, and their pull on bodies."""
    solved(system, equations)
    each(sites, wrench_of_impulses, work, equations)
    scattered(system, work)


def scattered(system: Any, work: Any) -> None:
    """The sums of what joints do to bodies that have more than one of either side."""
    pull, table = work.further_pull, system.further_sides
    count = whole(table, 0)
    for p in range(count):
        pull.put(whole(table, 1 + 3 * p), REST6)
    for p in range(count):
        body, j, side = (whole(table, 1 + 3 * p + i) for i in range(3))
        pull.put(body, pull.at(body) + work.wrench.nth(side).at(j))


def assembled(system: Any, sites: Any, sides: Any, sign: float, h: float, work: Any, equations: Any) -> None:
    """The blocks beside those of joints alone.  sides : the column of rows.  sign : of the matrix.  h : times it
    rotors yield.
    """
    each(sites, tied, system, sides, work, equations)
    fill(system.order, equations)
    coupled(system, sides, sign, equations)
    if system.meshes:
        mesh_blocks(system, h, equations)


def coupled(system: Any, sides: Any, sign: float, equations: Any) -> None:
    """The blocks of pairs of joints that a body ties together."""
    blocks, table, n = equations.blocks, system.couplings, equations.diagonal.width
    for p in range(whole(table, 0)):
        j, k, side, other_side, block, added = (whole(table, 1 + 6 * p + i) for i in range(6))
        a, b = resting(sides.nth(side).at(j)), equations.answers.nth(other_side).at(k)
        product = mat(*[vec(*[dot(x, y) for y in b]) for x in a])
        if added == 1:
            product = block_at(blocks, block, n) + product
        put_block(blocks, block, product)
    if system.parts > 0:
        bordered(system, sides, sign, equations)


def bordered(system: Any, sides: Any, sign: float, equations: Any) -> None:
    """The blocks of the motions z of hubs.  Of S = S_0 + U K V* with the rows U and V of joints at a hub and
    its answer K to momenta, S l = r is

        S_0 l + U z = r,   z - K V* l = 0,

    and S_0 ties no joints by hubs, so that a hub of n joints takes n blocks, not n^2.

    sign : of S; the second line is multiplied by it.
    Source: Golub and Van Loan, Matrix Computations, 4th ed., section 2.1.4 (Woodbury).
    """
    blocks, table, n, m = equations.blocks, system.borders, equations.diagonal.width, system.most
    width = 2 + 2 * system.parts
    for p in range(whole(table, 0)):
        j, side = whole(table, 1 + width * p), whole(table, 2 + width * p)
        a, b = resting(sides.nth(side).at(j)), equations.answers.nth(side).at(j)
        for k in range(system.parts):
            axes = [*range(m * k, min(6, m * k + m))]
            blank = [0.0] * (n - len(axes))
            by_hub, of_hub = [whole(table, 3 + width * p + 2 * k + i) for i in range(2)]
            put_block(blocks, by_hub, mat(*[vec(*[x[i] for i in axes], *blank) for x in a]))
            answers = [vec(*[-sign * x[i] for x in b]) for i in axes]
            put_block(blocks, of_hub, mat(*answers, *[vec(*[0.0] * n)] * len(blank)))
    for v in range(int(system.joints), int(system.order.nodes)):
        unit = [vec(*[sign if i == k else 0.0 for i in range(n)]) for k in range(n)]
        put_block(blocks, BLOCKS * v, mat(*unit))
        equations.diagonal.put(v, vec(*[1.0] * n))


def nothing_of_hubs(system: Any, column: Any, n: int) -> None:
    """Set numbers of the motions of hubs, which are no conditions and no impulses, to zero."""
    for v in range(int(system.joints), int(system.order.nodes)):
        column.put(v, vec(*[0.0] * n))


def mesh_blocks(system: Any, h: float, equations: Any) -> None:
    """Add h times the rate that a rotor gains by another joint to the blocks of such joints."""
    blocks, table, n, last = equations.blocks, system.mesh, equations.diagonal.width, system.most - 1
    for p in range(whole(table, 0)):
        place, y = whole(table, 3 + 3 * p), h * entry(system.meshing, p)
        gain = [vec(*[y if i == last and j == last else 0.0 for j in range(n)]) for i in range(n)]
        put_block(blocks, place, block_at(blocks, place, n) + mat(*gain))


def factored(system: Any, sign: float, equations: Any, counted: float = 0.0) -> float:
    """Elimination of the blocks, in place; the first joint whose conditions depend on those before it, or the last joint
    if the determinant has lost its sign; -1 if all is well.
    counted : 1 for the number of negative pivots instead, those of conditions as -1.
    """

    def negative(k: int, pivot: Mat) -> float:
        if counted > 0.0:
            return negative_pivots(pivot, where(float(k) < system.joints, 1.0 * system.most, 0.0))
        return 0.0

    dependent, same_sign, count = factor(system.order, sign, equations, negative)
    dependent, last = min(dependent, system.joints - 1.0), system.joints - 1.0
    return where(counted > 0.0, count, where(same_sign < 0.0 and dependent < 0.0, last, dependent))


def solved(system: Any, equations: Any) -> None:
    """The impulses by what the conditions miss, with the blocks as `factored` has left them."""
    if system.parts > 0:
        nothing_of_hubs(system, equations.residual, equations.diagonal.width)
    substitute(system.order, equations)
    if system.parts > 0:
        nothing_of_hubs(system, equations.solution, equations.diagonal.width)


def impulses_off(system: Any, sites: Any, work: Any, equations: Any) -> bool:
    """Find the impulses l' of what leads off the constraint, G J^-1 (mu - G* l') = 0, and their pull on bodies.  Returns
    whether there are any: at a dead point conditions depend on each other.
    """
    each(sites, excess_of, system, work, equations)
    assembled(system, sites, equations.sides, 1.0, 0.0, work, equations)
    independent = has_multipliers(system, work, equations)
    pulled_by_solution(system, sites, work, equations)
    if system.level is not None:  # G has changed under l': a correction, with the blocks as they are
        each(sites, held_by_impulses, work)
        each(sites, excess_left, system, work, equations)
        pulled_by_solution(system, sites, work, equations)
    return independent


def has_multipliers(system: Any, work: Any, equations: Any) -> bool:
    """Eliminate the conditions; whether they do not depend on each other.  Else their joint is noted, as at a dead point."""
    dependent = factored(system, 1.0, equations)
    if dependent >= 0.0:
        work.failed_joint.put(0, dependent)
        work.reached.put(0, DEAD_POINT)
    return dependent < 0.0


def require_multipliers(system: Any, work: Any, equations: Any) -> None:
    """Elimination of the conditions, which do not depend on each other.  Raises NoConvergence."""
    if not has_multipliers(system, work, equations):
        raise NoConvergence("the conditions of joints depend on each other")
