"""RATTLE on a group for any number of bodies and joints: loops over both, in memory.

A step of `LieRATTLE` asks for a displacement x of each body, from g to g tau(x), and impulses l of each joint,

    (dtau^-1_-x)* J x/h = m,   m = mu + (h/2) f - G* l     of a body,      c(g tau(x)) = 0     of a joint.

dtau is the left-trivialised one.  With r the mismatch of the first line, or a multiple of it, A its derivative by x and
-B that by m, and G' the rows at the end of the step, Newton's corrections x - dx and l - dl are

    (G' dtau_x A^-1 B G*) dl = G' dtau_x A^-1 r - c,   dx = A^-1 r - A^-1 B G* dl:

one block of conditions for each joint, eliminated from joint to joint (`elimination.py`).  In memory `unknown` is (x, l),
`impulse` G* l, `free_correction` A^-1 r, `answer` A^-1 B, and dtau_x leads these two to the `end` of the step.  Then
bodies move, are kicked by the field there, and the impulses l' take away what leads off the constraint.  What belongs
to one body or one joint is a formula, run for all of them side by side.

Source: Leyendecker, Marsden and Ortiz, ZAMM 88 (2008), section 3.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.sites.planes import columns, each
from ...errors import NoConvergence
from ...formulas import Mat, Vec, constant, dot, mat, plain, record, transpose, vec, vectors, where
from ...formulas.classes.layouts import Layout
from ...formulas.classes.records import with_fields
from ...formulas.elimination import inverted, of_quarters, quarters
from ...formulas.numbers.conversions import resting
from ...formulas.tables import entry, whole
from ...groups.retractions import Exponential
from ...integrators.memory import continued
from ...integrators.solvability import CONTRACTION, INFINITY, LEAST, MOST, ROUNDING
from ...integrators.variational import momentum_slope, with_inertia
from ...rooms.sites.steps_together import copied, grown_together, summed_over
from ...solvers import NOISE
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from .elimination import assembled, factored, impulses_off, pulled_by_solution, save_answers, scattered
from .links import BROKEN, READY, REST6, LinkMemory, StepsOfLinks, answered, both, poses_of, pull_on, speeds, wrenches
from .loads_of_links import loads
from .on_all_bodies import UNITS, pulled_together

NEAR = 2.0**-20
"""A correction below this part of the displacement, both squared, leaves the derivative as it is."""

FINE = 2.0**-110
"""As ROUNDING, an eighth of a unit in the last place: a first correction is enough where its own square, over the
displacement, which is what Newton's method leaves, is below.
"""

PASTS = 5
"""Steps before, from which a first guess is extrapolated: with 3 of them two corrections and a half are needed
where 5 let one or two do.
"""


@record
class RattleOfLinks(StepsOfLinks):
    """LieRATTLE, or a composition of it, of many bodies and joints.

    The impulse -G* l' that ends a step and the one that begins the next, -G* l, act at one place, and
    what follows depends on their sum alone.  So steps without loads go from mu_i + G* l' with l + l' as
    unknowns, and l' is found where a state is looked at.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.4 (SHAKE and RATTLE);
    Leimkuhler and Skeel, J. Comput. Phys. 112 (1994), 117.

    shares : of the substeps, each with its node.  substeps, stages : how many there are.  ending :
    where steps are cut at jumps of inputs, as an EndingAtJumps has it; None: nowhere.
    """

    retraction: Any
    shares: Any
    substeps: float
    stages: int
    most: int
    ending: Any = None

    settles: ClassVar[bool] = True
    symmetric: ClassVar[bool] = True

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        """A state, with pasts that are still to come: zeros."""
        none = vec(*[0.0] * (6 + self.most))
        return LinkMemory(state, ((none,) * PASTS,) * self.stages, state)

    def observe(self, memory: LinkMemory) -> Any:
        return memory.shown

    def settle(self, system: Any, t: float, sites: Any, copy: int, memory: Layout) -> None:
        """Find what is shown of the state to which steps have led: its momentum without what leads off
        the constraint, mu - G* l' with G J^-1 (mu - G* l') = 0.  Steps go on as if nobody had looked.
        At a dead point, where there is no l', all of the momentum is shown, and the run warns.
        """
        places = columns(sites, copies=(memory, memory), work=system.work)
        numbers, work = places.copies.nth(copy).fields, places.work.fields
        if system.loaded:
            each(sites, copied, numbers.state, numbers.shown)
        elif work.ready.at(0) == READY:
            if impulses_off(system, sites, work, work.equations.heads(system.most)):
                each(sites, on_the_constraint, system, numbers.state, numbers.shown, work)
            else:
                each(sites, copied, numbers.state, numbers.shown)

    def settle_anew(self, system: Any, t: float, sites: Any, copy: int, memory: Layout) -> None:
        """As `settle`, where a step was given up that had begun to write down the next field."""
        places = columns(sites, copies=(memory, memory), work=system.work)
        state, work = places.copies.nth(copy).fields.state, places.work.fields
        field(system, t, 0.0, sites, state, state, work)
        work.ready.put(0, READY)
        self.settle(system, t, sites, copy, memory)

    # ---------------------------------------------------------------- a step

    def step_together(
        self, system: Any, t: float, h: float, sites: Any, source: int, target: int, memory: Layout
    ) -> None:
        """A step of all bodies, from one copy of the memory to the other.  Where inputs jump it is
        one from there to the next jump, as in `EndingAtJumps.step`: what it remembers of steps of
        another length is forgotten.
        """
        places = columns(sites, copies=(memory, memory), work=system.work)
        if self.ending is None:
            self.substeps_of(system, t, h, sites, places, source, target)
            return
        work, new_memory = places.work.fields, places.copies.nth(target)
        each(sites, copied, places.copies.nth(source), new_memory)
        pasts = new_memory.fields.pasts
        now, end, lasting, going = t, t + h, h, True
        while going:
            to = system.next_jump(work, now, end, self.ending)
            begin, s = self.ending.kept_away(now, to, where(now == t and to == end, h, to - now))
            if s != lasting:
                each(sites, forgotten, pasts, self.stages)
            lasting = s
            cut_system = with_fields(system, window=(begin, s, self.ending.beyond))
            self.substeps_of(cut_system, begin, s, sites, places, target, target)
            now, going = to, where(h > 0.0, to < end, to > end)
        if lasting != h:
            each(sites, forgotten, pasts, self.stages)

    def substeps_of(self, system: Any, t: float, h: float, sites: Any, places: Any, source: int, target: int) -> None:
        """The substeps of a step, from one copy of the memory to the other."""
        for s in range(int(self.substeps)):
            share, node = entry(self.shares, 2 * s), entry(self.shares, 2 * s + 1)
            self.substep(system, t + node * h, share * h, sites, places, s, source, target)

    def substep(
        self, system: Any, t: float, h: float, sites: Any, places: Any, s: int, source: int, target: int
    ) -> None:
        """Substep number s, one step of LieRATTLE, in turns, so that code has the field and the loads once: in turn 0, at
        the start of a run, the field alone; in turn 1 loads as they begin, displacements and impulses, and the field at
        the end; in turn 2, under loads, their kick there with what leads off the constraint.

        source, target : the copies of the memory before the whole step, where the past of all substeps lies, and after it.
        """
        copies, work, start = places.copies, places.work.fields, source if s == 0 else target
        past, new_past = [copies.nth(k).fields.pasts.nth(s) for k in (source, target)]
        old, new = copies.nth(start).fields.state, copies.nth(target).fields.state
        conditions, ready = work.equations.heads(system.most), work.ready.at(0)
        turn = 1 if ready == READY else 0
        while turn < 3:
            if system.loaded and turn > 0:
                before = copies.nth(start if turn == 1 else target).fields.state
                loads(system, t, turn, h, sites, before, new, work, True)
            if turn == 1 and system.geared:
                each(sites, dial_here, system.at_time(t), old, work, conditions)
            if turn == 1:
                each(sites, guessed, h, old, past, work)
                self.solve(system, t, h, sites, old, work, conditions)
                if system.meshes:
                    meshed(system, work)
                if system.geared:
                    each(sites, dial_there, system, work)
                each(sites, moved_body, system, self.retraction, h, old, new, work)
                work.ready.put(0, where(ready == 0.0, 0.0, BROKEN))
            if turn < 2:
                state, k = copies.nth(start if turn == 0 else target).fields.state, h * float(turn)
                field(system, t + k, 0.5 * k, sites, state, new, work)
            turn = turn + 1
        each(sites, ended, system, past, new_past, new, work)
        work.ready.put(0, READY)

    def solve(self, system: Any, t: float, h: float, sites: Any, old: Any, work: Any, equations: Any) -> None:
        """Displacements and impulses: the solution that grows out of zero with h, as `LieRATTLE` finds it.  Raises
        NoConvergence.
        """
        reached, dependent = grown_together(sites, work, self.newton, system, t, h, old)
        if reached < 1.0:
            work.failed_joint.put(0, dependent if dependent >= 0.0 else worst(system, equations))
            work.reached.put(0, reached)
            raise NoConvergence("no solution grows out of h = 0 up to this step")

    def newton(
        self, part: float, count: float, sites: Any, work: Any, system: Any, t: float, h: float, old: Any
    ) -> tuple[bool, float, float]:
        """Newton's method at a part of the step: has it found a solution inside the chart, after how many corrections, and
        the joint whose conditions depend on others, or -1.  While corrections are small the derivative stays as it was.
        """
        each(sites, wrench_of_unknown, work, work.equations.heads(system.most))
        scattered(system, work)
        each(sites, held_by_unknown, work)
        h = part * h
        equations, now = work.equations.heads(system.most), system.at_time(t + h)
        before, anew, settled, inside, dependent, last = INFINITY, True, False, False, -1.0, False
        while True:
            if system.meshes:
                meshed(system, work)
            if anew:
                sign = 1.0 if h > 0.0 else -1.0
                each(sites, correction_of_body, system, self.retraction, h, old, work)
                each(sites, correction_of_joint, now, sign, h, work, equations)
                assembled(system, sites, equations.end_sides, sign, h, work, equations)
                dependent = factored(system, h, equations)
            else:
                each(sites, mismatch_of_body, system, self.retraction, h, old, work)
                each(sites, mismatch_of_joint, now, h, work, equations)
            pulled_by_solution(system, sites, work, equations)
            each(sites, corrected, system, self.retraction, where(last, 1.0, 0.0), work, equations)
            if last:
                break
            length, whole, size, upright, inside = summed(system, work)
            count = count + 1.0
            shrinks = length <= CONTRACTION * before
            noisy = length <= NOISE * NOISE * (whole + size)
            good = upright and dependent < 0.0 and (shrinks or noisy)
            small = length <= ROUNDING * size or (
                length * length <= FINE * size * whole
                if before == INFINITY
                else length * (length / before) <= LEAST * whole
            )
            settled = good and (small or not shrinks)
            before, anew = length, length > NEAR * whole
            if settled or not good or not count < MOST:
                if not settled or system.level is None:
                    break
                last, anew = True, True  # derivatives by one correction more
        return settled and inside, count, dependent


def field(system: Any, t: float, h: float, sites: Any, state: Any, new: Any, work: Any) -> None:
    """The field at a state, the one after a kick h by it, its velocity, and the rows of joints."""
    each(sites, joints_here, system.at_time(t), state, work, work.equations.fields)
    scattered(system, work)
    if system.pulls_all:
        pulled_together(system, state, work)
    each(sites, kicked, system, h, state, new, work)


# ------------------------------------------------------------------ formulas of one body


def forgotten(pasts: Any, stages: int) -> None:
    """Set the past of a body to zero, from which nothing is extrapolated."""
    for s in range(stages):
        past = pasts.nth(s)
        past.save(tuple([vec(*[0.0] * len(x)) for x in past.load()]))


def guessed(h: float, old: Any, past: Any, work: Any) -> None:
    """A first unknown, from the last steps, and the slope with which it begins."""
    pasts = past.load()
    guess = continued(pasts)
    xi = h * times(work.inverse.load(), plain(old.load().mu))
    x = [where(nothing([p[:6] for p in pasts]), a, b) for a, b in zip(xi, guess[:6])]
    l = vec(*guess[6:])
    work.unknown.save((vec(*x), l))
    work.slope.save((xi, l))


def nothing(pasts: Any) -> Any:
    """Are all numbers of all vectors zero, as before the first step?"""
    return vectors.sum([abs(constant(x)) for past in pasts for x in past]) == 0.0


def held_by_unknown(work: Any) -> None:
    """The sum of all impulses on a body."""
    work.impulse.save(pull_on(work))


def pushed_momentum(mu: Any, h: float, work: Any) -> Any:
    """mu + (h/2) f - G* l: the momentum after half a kick by the field and the impulses."""
    return mu + ((0.5 * h) * work.force.load() - work.impulse.load())


def correction_of_body(system: Any, retraction: Any, h: float, old: Any, work: Any) -> None:
    """With r the mismatch of Algorithm 1 and A its derivative, A^-1 r; the answer to impulses at
    the start, A^-1 B; both as displacements of the body at the end of the step as well.
    """
    group, begin, J = system.group, old.load(), work.inertia.load()
    x, g, rate = work.unknown.nth(0).load(), plain(begin.g), 1.0 / h
    r, by_p, by_x = retraction.residual(group, x, times(J, rate * x), pushed_momentum(plain(begin.mu), h, work))
    by_p, still = resting(by_p), resting(x)
    A = with_inertia(resting(by_x), momentum_slope(by_p, rate * J))
    inverse, same, _ = inverted(A, REST6, h)
    free, answer, moved = inverse @ r, *answers(retraction, group, still, by_p, inverse)
    work.free_correction.save(free)
    work.answer.save(answer)
    work.free_at_end.save(retraction.dtau(group, still, free))
    work.answer_at_end.save(moved)
    work.end_pose.save(retraction.compose_tau(group, g, x))
    work.sign_kept.save(same)
    away = vec(*[constant(g[i, 3]) for i in range(3)])
    size = vectors.sum(
        [(J[i, i] if isinstance(J, vectors.Mat) else J[i]) * (1.0 if i < 3 else dot(away, away)) for i in range(6)]
    )
    work.scale.save(size)


def answers(retraction: Any, group: Any, x: Vec, by_p: Any, inverse: Mat) -> tuple[Mat, Mat]:
    """A^-1 B with B = by_p (dtau_-x)*, and dtau_x A^-1 B, by columns, in blocks of three."""
    a, b, c = dtau_blocks(retraction, group, x)
    if type(retraction) is Exponential:
        d, e, f = a, b, c  # of hat(-x), whose transpose is hat(x)
    else:
        d, e, f = [transpose(block) for block in dtau_blocks(retraction, group, -x)]
    p, q, r, s = quarters(inverse @ by_p if isinstance(by_p, vectors.Mat) else by_p * inverse)
    top, corner = p @ d, p @ e + q @ f
    low, last = r @ d, r @ e + s @ f
    moved = a @ top, a @ corner, b @ top + c @ low, b @ corner + c @ last
    return transpose(of_quarters(top, corner, low, last)), transpose(of_quarters(*moved))


def dtau_blocks(retraction: Any, group: Any, x: Vec) -> tuple[Mat, Mat, Mat]:
    """The blocks a, b, c of dtau_x = [[a, 0], [b, c]] on SE(3): a displacement turns nothing."""
    if type(retraction) is Exponential:
        a, b = group.algebra.dexp_blocks(x)
        return a, b, a
    rows = [retraction.dtau(group, x, unit) for unit in UNITS]  # of the transpose
    a, b, c = [row[:3] for row in rows[:3]], [row[3:] for row in rows[:3]], [row[3:] for row in rows[3:]]
    return transpose(mat(*a)), transpose(mat(*b)), transpose(mat(*c))


def mismatch_of_body(system: Any, retraction: Any, h: float, old: Any, work: Any) -> None:
    """The mismatch alone, with A as it was."""
    group, begin, x = system.group, old.load(), work.unknown.nth(0).load()
    p = times(work.inertia.load(), (1.0 / h) * x)
    off = retraction.dtau_inv_dual(group, -x, p) - pushed_momentum(plain(begin.mu), h, work)
    work.free_correction.save(answered(work.answer.load(), off))
    work.free_at_end.save(answered(work.answer_at_end.load(), off))
    work.end_pose.save(retraction.compose_tau(group, plain(begin.g), x))


def corrected(system: Any, retraction: Any, last: float, work: Any, equations: Any) -> None:
    """The unknown after Newton's correction, and what it tells: how long the correction is, and the displacement.
    last : 1 for one of derivatives alone.
    """
    (x, l), J, push = work.unknown.load(), work.inertia.load(), pull_on(work)
    dx, dl = work.free_correction.load() - answered(work.answer.load(), push), equations.solution.load()
    if system.level is not None:
        dx, dl, push = [y - last * resting(y) for y in (dx, dl, push)]
    x, l = x - dx, l - dl
    work.unknown.save((x, l))
    work.impulse.save(work.impulse.load() - push)
    dx, x = resting(dx), resting(x)
    work.change_square.save(dot(dx, times(J, dx)))
    work.value_square.save(dot(x, times(J, x)))
    work.in_chart.save(where(retraction.is_chart(system.group, 2.0 * x), 1.0, 0.0))


def moved_body(system: Any, retraction: Any, h: float, old: Any, new: Any, work: Any) -> None:
    """The state after the first kick and the displacement."""
    begin = old.load()
    start = BodyState(pushed_momentum(begin.mu, h, work), begin.g)
    new.save(system.displaced(retraction, start, work.unknown.nth(0).load()))


def kicked(system: Any, h: float, old: Any, new: Any, work: Any) -> None:
    """The field, the state after a kick h by it, and its velocity."""
    body, weight = old.load(), work.weight.load()
    down = vec(0.0, 0.0, 0.0, *[-(weight * plain(body.g)[2, j]) for j in range(3)])  # (0, -w R^T e3)
    force = down + pull_on(work)
    if system.pulls_all:
        force = force + work.field.load()
    if len(system.fields) > 0 and system.pulled:
        force = force + system.on_body(work, lambda it: it.pull(plain(body.g)))
    mu = body.mu + h * force
    mu = vec(*[where(h == 0.0, a, b) for a, b in zip(body.mu, mu)])  # rests of rounding as well
    new.save(BodyState(mu, body.g))
    work.force.save(force)
    work.velocity.save(times(work.inverse.load(), plain(mu)))


def ended(system: Any, past: Any, next_past: Any, state: Any, work: Any) -> None:
    """The past with this step; under loads the momentum without what leads off the constraint."""
    x, l = work.unknown.load()
    pasts, unknown = past.load(), vec(*x, *l)
    fresh = nothing(pasts)
    if system.loaded:
        on_the_constraint(system, state, state, work)
    next_past.save(tuple([vec(*[where(fresh, a, b) for a, b in zip(unknown, y)]) for y in (unknown, *pasts[:-1])]))


def on_the_constraint(system: Any, state: Any, shown: Any, work: Any) -> None:
    """A body without the momentum that leads off the constraint."""
    body, pull = state.load(), pull_on(work)
    if system.level is not None:
        pull = work.impulse.load() + (pull - resting(pull))
    shown.save(BodyState(body.mu - pull, body.g))


def summed(system: Any, work: Any) -> tuple[float, float, float, bool, bool]:
    """The sums of what corrections tell: their square and that of displacements, the size of what is
    rounding, whether determinants have kept their sign, and whether all is inside the chart.
    """
    columns_of_bodies = work.change_square, work.value_square, work.scale, work.sign_kept, work.in_chart
    length, whole, size, upright, inside = [summed_over(column, system.bodies) for column in columns_of_bodies]
    return length, whole, size, upright == system.bodies, inside == system.bodies


def worst(system: Any, equations: Any) -> float:
    """The joint whose conditions miss most."""
    joint, most = 0.0, 0.0
    for j in range(int(system.joints)):
        x = equations.residual.at(j)
        square = dot(x, x)
        if square > most:
            joint, most = float(j), square
    return joint


# ------------------------------------------------------------------ formulas of one joint


def joints_here(system: Any, old: Any, work: Any, equations: Any) -> None:
    """The rows of a joint, of conditions and of motions that loads act along, and the wrench of its springs."""
    most = system.most
    (g, k), has_second, alive = poses_of(old, work), work.ends.load()[2], work.alive.load()
    first, second = system.of_kind(work, lambda it: it.rows(g, k, most, system.freedoms))
    G = [a * row for a, row in zip(alive, first)]
    H = [(a * has_second) * row for a, row in zip(alive, second)]
    equations.sides.save((mat(*G, *first[most:]), mat(*H, *[has_second * row for row in second[most:]])))
    if system.rheonomic:
        paces = system.of_kind(work, lambda it: it.paces(g, k, most, system.freedoms))
        work.paces.save(vec(*[a * x for a, x in zip(alive, paces)], *paces[most:]))
    push: Any = (*REST6, *REST6)
    if system.springs:
        push = system.of_kind(work, lambda it: it.springs_push(g, k))
    work.wrench.save((vec(*push[:6]), has_second * vec(*push[6:])))


def wrench_of_unknown(work: Any, equations: Any) -> None:
    """G* l, of the impulses in the unknown."""
    work.wrench.save(wrenches(work.unknown.nth(1).load(), equations.sides.load()))


def correction_of_joint(system: Any, sign: float, h: float, work: Any, equations: Any) -> None:
    """The conditions at the end of the step, their rows, what they miss, and the answers of the
    bodies to the impulses of the joint.  sign : of the step h.
    """
    n, has_second, alive = system.most, work.ends.load()[2], work.alive.load()
    g, k = poses_of(work.end_pose, work)
    first, second = system.of_kind(work, lambda it: it.rows(g, k, n, 0))
    rows = [a * row for a, row in zip(alive, first)], [(a * has_second) * row for a, row in zip(alive, second)]
    rows = resting(rows)
    equations.residual.save(missed(system, h, rows, g, k, work))
    moved = both(work.answer_at_end, work)
    joint_answers = [[answered(K, row) for row in side] for K, side in zip(moved, resting(equations.sides.load()))]
    equations.end_sides.save((mat(*rows[0]), mat(*rows[1])))
    save_answers(system, rows, joint_answers, sign, h, work, equations)


def mismatch_of_joint(system: Any, h: float, work: Any, equations: Any) -> None:
    """The mismatch of the conditions, with their rows as they were."""
    equations.residual.save(missed(system, h, equations.end_sides.load(), *poses_of(work.end_pose, work), work))


def missed(system: Any, h: float, rows: Any, g: Mat, k: Mat, work: Any) -> Vec:
    """The mismatch of the conditions at the end of the step, with the free motions of the bodies.  That of a rotor is that
    it turns as the joint does: by h (q' + l/A) along the step.
    """
    c = system.of_kind(work, lambda joint: joint.value(g, k, system.most))
    if system.geared:
        q, rate, added = work.rotor.load()
        turned = system.of_kind(work, lambda joint: joint.turned(g, k, q))
        y, l = work.lightness.load(), work.unknown.nth(1).load()[system.most - 1]
        c = [*c[: system.most - 1], turned - h * (rate + y * l + added)]
    free = speeds(rows, both(work.free_at_end, work))
    return vec(*[x - live * value for x, value, live in zip(free, c, work.alive.load())])


# ------------------------------------------------------------------ rotors


def meshed(system: Any, work: Any) -> None:
    """The rate that a rotor gains by the impulses of other joints that it drives."""
    table, added, l = system.mesh, work.rotor.nth(2), work.unknown.nth(1).nth(system.most - 1)
    for p in range(whole(table, 0)):
        added.put(whole(table, 1 + 3 * p), 0.0)
    for p in range(whole(table, 0)):
        j, k = whole(table, 1 + 3 * p), whole(table, 2 + 3 * p)
        added.put(j, added.at(j) + entry(system.meshing, p) * l.at(k))


def dial_here(system: Any, old: Any, work: Any, equations: Any) -> None:
    """The coordinate of a joint, by which its rotor turns, and its rate."""
    g, k = poses_of(old, work)
    q = system.of_kind(work, lambda joint: joint.turned(g, k, 0.0))
    rate = speeds(equations.sides.load(), both(work.velocity, work))[system.most - 1]
    work.rotor.save(vec(q, rate, 0.0))


def dial_there(system: Any, work: Any) -> None:
    """The rate of a rotor after the impulse on it, q' + l/A."""
    q, rate, added = work.rotor.load()
    l = work.unknown.nth(1).load()[system.most - 1]
    work.rotor.save(vec(q, rate + work.lightness.load() * l + added, 0.0))
