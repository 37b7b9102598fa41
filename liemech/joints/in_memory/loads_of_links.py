"""Kicks by loads on bodies and joints in memory: Newton's method for the velocities that kicks by them lead to.

    xi+ = J^-1 (mu + h F(xi+) - G* l),   G xi+ = 0

Source: Marsden and West, Acta Numerica 10 (2001), section 3.2 (forces at both ends of a step); Leyendecker, Marsden and
Ortiz, ZAMM 88 (2008), section 3.
"""

from __future__ import annotations

from typing import Any

from ...compiler.sites.planes import each
from ...errors import NoConvergence
from ...formulas import Mat, Vec, dot, jacobian, mat, plain, transpose, vec, vectors, where
from ...integrators.kicks.explicit_kicks import negative_pivots
from ...rooms.constraints.lie_rattle import eliminated
from ...solvers import CUT, NOISE, TOLERANCE, least_part, slope_beside
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from .elimination import assembled, eliminated_again, factored, free_answers, rates_off, save_answers, scattered, solved
from .links import REST6, answered, both, poses_of, pull_on, speeds, wrenches
from .on_all_bodies import UNITS, damping_of_all, pushed_together

LINEAR = 2.0**-50
"""A correction below this part, of an iteration that converges linearly, is the last one."""

BENT = 2.0**-10
"""A change of the derivative of a load by the rate, relative, that leaves the equations as they are."""

AT_LOADS = 50
"""Corrections of the velocities that loads depend on, at the end of a step."""

THROWN = -2.0
"""In the place of the joint at which a step has failed: loads throw back; `reached` is then the length of the step."""


def loads(
    system: Any, t: float, turn: int, h: float, sites: Any, old: Any, new: Any, work: Any, kicks: bool = False
) -> None:
    """In turn 1 loads as they are at the beginning, which go to the field.  In turn 2 the kick by
    them at the velocity that it leads to, on the constraint: Newton's method for the rates of the
    joints, together with the impulses that take away what leads off the constraint, of which the
    last correction has those that count; while the loads bend no more than before, with the
    derivative as it was.  Under loads on bodies it is for their velocities as well, and those
    impulses are found at the end, as without loads.
    Of a load on all bodies by one formula the derivative has the blocks of single bodies only.

    kicks : are the loads of turn 1 those of an explicit kick?  A step in which it throws back is refused, as
    by `LieRATTLE`: first it is asked what the loads could do to bodies that no joint holds, then, in `looking`,
    the matrix of Newton's method has the damping of the kick in it, and its pivots are counted.
    """
    equations = work.equations.fields
    t, k = (t + h, 0.5 * h) if turn == 2 else (t, 1.0)
    each(sites, velocities_here, system, old, work)
    if system.freedoms > 0:
        each(sites, rates_here, system, work, equations)
    tried, last, change, scale = 0, turn == 1, 1.0, 0.0
    off, size = 0.0, 0.0
    enough = TOLERANCE if system.on_all is None else LINEAR  # without the whole derivative
    looking, kicks = 0.0, kicks and (system.freedoms > 0 or system.pushed)
    while True:
        if looking > 0.0:
            if system.pushes_all:
                damping_of_all(system, t, old, work)
            each(sites, damped_here, system, t, 0.5 * abs(h), old, work)
            last, tried = False, 0
        else:
            if system.freedoms > 0:
                if tried == 1 and not last:
                    each(sites, efforts_at, system.at_time(t), t, k, 0.0, 0.0, old, work, equations)
                again = where(tried > 0, where(k == 0.0, 0.0, 1.0), 0.0)  # without a kick nothing was foreseen
                each(sites, efforts_there, system.at_time(t), t, k, again, old, work, equations)
                scattered(system, work)
            if system.pushes_all:
                pushed_together(system, t, k, old, work)
            if system.pushed:
                each(sites, pushed_there, system, t, k, old, work)
            if last:
                each(sites, loaded_body, system, float(turn), old, new, work)
                if turn == 1:
                    if not kicks or h < 0.0 or spares(system, h, sites, work, equations):
                        break
                    looking = 1.0
                    continue
                k, last = 0.0, False
                continue
            if tried == AT_LOADS:
                work.at_joint.put(0, -1.0)
                raise NoConvergence("no velocity found that fits the loads at the end of a step")
            each(sites, loaded_velocity, system, old, work)
        if system.pushed or tried == 0 or (system.freedoms > 0 and bends(system, work)):
            each(sites, excess_of_rates, system, work, equations)
            assembled(system, sites, equations.sides, 1.0, 1.0, work, equations)
            found = factored(system, 1.0, equations, looking)
        else:
            each(sites, excess_again, system, work, equations)
            eliminated_again(system, equations)
            found = 0.0
        if looking > 0.0:
            require_gentle(system, h, found, work)
            break
        solved(system, equations)
        each(sites, wrench_of_corrections, system, work, equations)
        scattered(system, work)
        if k == 0.0 and kicks and h < 0.0:
            looking = 1.0
            continue
        if k == 0.0:
            break
        before, apart = change, off
        change, whole, falls = corrected_rates(system, work, equations) if system.freedoms > 0 else (0.0, 0.0, 0.0)
        scale = max(scale, whole)  # of what is lost as well: a step may end at rest
        small = change <= TOLERANCE * TOLERANCE * scale
        noisy = change >= before and change <= NOISE * NOISE * scale
        last, tried = small or noisy or change == 0.0, tried + 1
        if system.pushed:
            each(sites, corrected_velocity, work)
            off, whole = 0.0, 0.0
            for b in range(int(system.bodies)):
                off, whole = off + work.length.at(b), whole + work.whole.at(b)
            size = max(size, whole)
            small = off <= enough * enough * size
            noisy = tried > 1 and off >= apart and off <= NOISE * NOISE * size
            last = last and (small or noisy or off == 0.0)
        elif last:
            if system.freedoms > 0:
                each(sites, kicked_by_loads, old, work)
            if not kicks or h > 0.0:
                break
            looking = 1.0
        elif tried > CUT:
            cut_short(system, t, k, falls, sites, old, work, equations)


def cut_short(
    system: Any, t: float, k: float, falls: float, sites: Any, old: Any, work: Any, equations: Any
) -> None:  # fmt: skip
    """A correction of rates ends where an energy is least, as in `newton_of_kicks`.  falls : the square of what it
    changes, by which slopes are judged.
    """
    now = system.at_time(t)

    def slope(part: float) -> float:
        each(sites, efforts_at, now, t, k, 1.0, part - 1.0, old, work, equations)
        return slope_along(system, part - 1.0, work, equations)

    part = least_part(slope, falls)
    if part < 1.0:
        shortened(system, part, work, equations)
    each(sites, efforts_at, now, t, k, 0.0, 0.0, old, work, equations)


# ------------------------------------------------------------------ formulas of one body


def velocities_here(system: Any, old: Any, work: Any) -> None:
    """xi = J^-1 mu, at which loads are looked for first."""
    xi = times(work.inverse.load(), plain(old.load().mu))
    work.velocity.save(xi)
    if system.pushed:
        work.wanted.save(xi)


def pushed_there(system: Any, t: float, h: float, old: Any, work: Any) -> None:
    """The kick h F of loads on a body, and the answer of the body to momentum, (J - h F')^-1, by columns."""
    g, w = plain(old.load().g), work.wanted.load()
    kick, slopes = REST6, [REST6 for _ in range(6)]
    if system.pushes_all:
        kick, slopes = work.push.load(), [*work.bent.load()]
    if len(system.fields) > 0:
        kick = kick + h * system.on_body(work, lambda one: one.push(t, w, g))
        more = h * transpose(system.on_body(work, lambda one: slopes_of(one, t, w, g)))
        slopes = [a + b for a, b in zip(slopes, more)]
    work.strength.save(sum([abs(x) for slope in slopes for x in times(work.inverse.load(), slope)], 0.0))
    work.push.save(kick)
    work.given.save(answers_to_momentum(inertia_less(slopes, work)))


def slopes_of(one: Any, t: float, w: Vec, g: Mat) -> Mat:
    """The derivative of a load on a body by the velocity."""
    return jacobian(lambda y: one.push(t, y, g), w)


def inertia_less(slopes: Any, work: Any) -> Mat:
    """J less a derivative that is given by its columns."""
    J, n = work.inertia.load(), range(6)
    return mat(*[
        vec(*[(J[i, j] if isinstance(J, vectors.Mat) else J[i] if i == j else 0.0) - slopes[j][i] for j in n]) for i in n
    ])  # fmt: skip


def answers_to_momentum(A: Mat) -> Mat:
    """A^-1, by columns."""
    columns, _ = eliminated(A, [*UNITS], 1.0)
    return mat(*columns)


def loaded_velocity(system: Any, old: Any, work: Any) -> None:
    """The velocity with the kick by loads: J^-1 (mu + h F), of a load on the body that is linear in it
    about the velocity that is wanted, J xi = mu + h F + h F' (xi - w).
    """
    mu = plain(old.load().mu)
    if system.freedoms > 0:
        push = pull_on(work)
        work.free.save(push)
        mu = mu + push
    if system.pushed:
        w = work.wanted.load()
        off = times(work.inertia.load(), w) - mu - work.push.load()
        xi = w - answered(work.given.load(), off)
    else:
        xi = times(work.inverse.load(), mu)
    work.velocity.save(xi)


def kicked_by_loads(old: Any, work: Any) -> None:
    """The state after the kick by loads at joints with which its velocity was found."""
    one = old.load()
    old.save(BodyState(one.mu + work.free.load(), one.g))


def corrected_velocity(work: Any) -> None:
    """The velocity at which loads are looked for next, and how far it is from the last one."""
    J, before = work.inertia.load(), work.wanted.load()
    w = work.velocity.load() - answered(work.given.load(), pull_on(work))
    work.wanted.save(w)
    work.length.save(dot(w - before, times(J, w - before)))
    work.whole.save(dot(w, times(J, w)))


def loaded_body(system: Any, turn: float, old: Any, new: Any, work: Any) -> None:
    """In turn 1 weight, springs and loads; in turn 2 the state after the kick by loads, and its velocity."""
    one, push = old.load(), REST6
    if system.freedoms > 0:
        push = pull_on(work)
    if system.pushed:
        push = push + work.push.load()
    mu = one.mu + where(turn > 1.0, 1.0, 0.0) * push
    work.force.save(work.force.load() + where(turn > 1.0, 0.0, 1.0) * push)
    new.save(BodyState(mu, one.g))
    work.velocity.save(times(work.inverse.load(), plain(mu)))


# ------------------------------------------------------------------ formulas of one joint


def motions_of(system: Any, equations: Any) -> tuple[Any, Any]:
    """The motions of a joint that loads act along, by its first and its second body."""
    first, second = equations.sides.load()
    return first[system.most :], second[system.most :]


def rates_here(system: Any, work: Any, equations: Any) -> None:
    """The rates of a joint."""
    rates = speeds(motions_of(system, equations), both(work.velocity, work))
    if system.rheonomic:
        rates = [x + pace for x, pace in zip(rates, work.paces.load()[system.most :])]
    work.rate.save(vec(*rates))


def efforts_at(
    system: Any, t: float, h: float, moving: float, part: float, old: Any, work: Any, equations: Any
) -> None:  # fmt: skip
    """The kick h F that loads would give at rest; or, with 1 for `moving`, a part of the last correction farther on."""
    (g, k), n = poses_of(old, work), system.freedoms
    step = equations.impulse.load()[system.most :]
    there = vec(*[where(moving > 0.0, w + part * x, 0.0) for w, x in zip(work.rate.load(), step)])
    work.idle.save(system.of_kind(work, lambda one: h * one.efforts(t, one.seen(t, g, k), there, n)))


def efforts_there(system: Any, t: float, h: float, again: float, old: Any, work: Any, equations: Any) -> None:
    """The kick h F of loads, its pull on both bodies, and the slope by the rates with which Newton's method goes on.
    again : 1 after a correction, which has foreseen a kick.
    """
    (g, k), rates, n = poses_of(old, work), work.rate.load(), range(system.freedoms)
    kicks, gain = system.of_kind(work, lambda one: kick_of(one, t, h, one.seen(t, g, k), rates))
    idle, before = work.idle.load(), work.before.load()
    wanted = [where(again > 0.0, a, b) for a, b in zip(work.foreseen.load(), kicks)]
    steps = [where(again > 0.0, x, 0.0) for x in equations.impulse.load()[system.most :]]
    slopes = [slope_beside(kicks[i], idle[i], before[i], wanted[i], rates[i], steps[i], gain[i, i]) for i in n]
    work.foreseen.save(kicks)
    work.before.save(kicks)
    work.slant.save(mat(*[vec(*[slopes[i] if i == j else gain[i, j] for j in n]) for i in n]))
    work.wrench.save(wrenches(kicks, motions_of(system, equations)))


def kick_of(one: Any, t: float, h: float, seen: Any, rates: Vec) -> tuple[Vec, Mat]:
    """The kick of the loads at a joint along its motions, and its derivative by the rates."""

    def kick(y: Vec) -> Vec:
        return h * one.efforts(t, seen, y, len(rates))

    return kick(rates), jacobian(kick, rates)


def excess_of_rates(system: Any, work: Any, equations: Any) -> None:
    """The rate off the constraint, and how far rates are from those at which their kick was found;
    the answers of bodies to impulses, and to a change of rates with the kick by it.
    """
    m, n, sides = system.most, range(system.freedoms), equations.sides.load()
    answers: Any = []
    gain: Any = ()
    if system.freedoms > 0:
        gain = work.slant.load()
        work.gain.save(gain)
    for side in pushed_answers(sides, work) if system.pushed else free_answers(sides, work):
        kicks = [-vectors.sum([gain[b, i] * side[m + b] for b in n]) for i in n]
        answers = [*answers, [*side[:m], *kicks]]
    equations.rest.save(rates_off(system, sides, work))
    save_answers(system, sides, answers, 1.0, 1.0, work, equations)


def pushed_answers(sides: Any, work: Any) -> list[list[Vec]]:
    """The answers of bodies whose loads depend on their velocities."""
    return [[answered(given, row) for row in side] for given, side in zip(both(work.given, work), sides)]


def excess_again(system: Any, work: Any, equations: Any) -> None:
    """How far rates are off, alone."""
    equations.rest.save(rates_off(system, equations.sides.load(), work))


def wrench_of_corrections(system: Any, work: Any, equations: Any) -> None:
    """The pull on both bodies of impulses, and of the kick by a change of rates, which is no pull."""
    m, found = system.most, equations.impulse.load()
    pulls = [*found[:m]]
    if system.freedoms > 0:
        pulls = [*pulls, *[-dot(row, found[m:]) for row in work.gain.load()]]
    work.wrench.save(wrenches(pulls, equations.sides.load()))


def bends(system: Any, work: Any) -> bool:
    """Has the derivative of loads by rates changed by more than Newton's method does not notice?"""
    changed = 0.0
    for j in range(int(system.joints)):
        for a, b in zip(work.slant.at(j), work.gain.at(j)):
            for x, y in zip(a, b):
                changed = where(abs(x - y) > BENT * abs(y), 1.0, changed)
    return changed > 0.0


def corrected_rates(system: Any, work: Any, equations: Any) -> tuple[float, float, float]:
    """Rates after Newton's correction, and the kicks that it foresees; the sums of the squares of corrections, and of rates before
    them with how far off those were: at rest the kicks alone say what rounding is; and of corrections of rates times those
    of kicks.
    """
    change, whole, falls, m = 0.0, 0.0, 0.0, system.most
    for j in range(int(system.joints)):
        step, off, old = equations.impulse.at(j)[m:], equations.rest.at(j)[m:], work.rate.at(j)
        work.rate.put(j, old + step)
        kick = work.foreseen.at(j) + vec(*[dot(row, step) for row in work.gain.at(j)])
        more = kick - work.drawn.at(j)
        work.foreseen.put(j, kick)
        work.drawn.put(j, kick)
        work.ahead.put(j, more)
        change, whole, falls = change + dot(step, step), whole + dot(old, old) + dot(off, off), falls + dot(step, more)
    return change, whole, falls


def slope_along(system: Any, part: float, work: Any, equations: Any) -> float:
    """The slope of the energy along the last correction, a part of it farther on, where the kicks are known."""
    total = 0.0
    for j in range(int(system.joints)):
        step = equations.impulse.at(j)[system.most :]
        off = work.drawn.at(j) + part * work.ahead.at(j) - work.idle.at(j)
        total = total + dot(step, off)
    return total


def shortened(system: Any, part: float, work: Any, equations: Any) -> None:
    """The last correction, cut to a part of it."""
    m = system.most
    for j in range(int(system.joints)):
        whole = equations.impulse.at(j)
        kick = work.drawn.at(j) + (part - 1.0) * work.ahead.at(j)
        work.rate.put(j, work.rate.at(j) + (part - 1.0) * whole[m:])
        equations.impulse.put(j, vec(*whole[:m], *(part * whole[m:])))
        work.drawn.put(j, kick)
        work.foreseen.put(j, kick)


# ------------------------------------------------------------------ kicks that throw back


def damped_here(system: Any, t: float, h: float, old: Any, work: Any) -> None:
    """h times the damping of a joint; the answer of the body to momentum under h times its own damping, and how
    many of its directions are thrown back.
    """
    n = system.freedoms
    if n > 0:
        (g, k), rates = poses_of(old, work), work.rate.load()
        damping = system.at_time(t).of_kind(work, lambda one: one.resistances(t, one.seen(t, g, k), rates, n))
        work.slant.save(mat(*[vec(*[h * damping[i] if i == j else 0.0 for j in range(n)]) for i in range(n)]))
    if system.pushed:
        damped = [REST6 for _ in range(6)]
        if system.pushes_all:
            damped = [h * column for column in work.bent.load()]
        if len(system.fields) > 0:
            pose, xi = plain(old.load().g), work.wanted.load()
            own = system.on_body(work, lambda one: mat(*[one.resistance(t, xi, pose, unit) for unit in UNITS]))
            damped = [a + h * b for a, b in zip(damped, own)]
        A = inertia_less(damped, work)
        work.given.save(answers_to_momentum(A))
        work.thrown.save(negative_pivots(A))


def reach_of_slopes(system: Any, work: Any, equations: Any) -> None:
    """The derivatives of loads by rates, at the start of a step, beside the inertia of bodies that no joint holds."""
    n, ratio = system.freedoms, 0.0
    if n > 0:
        slopes = work.slant.load()
        for side, inverse in zip(motions_of(system, equations), both(work.inverse, work)):
            for i in range(n):
                ratio = ratio + abs(slopes[i, i]) * dot(side[i], times(inverse, side[i]))
    work.reach.save(ratio)


def spares(system: Any, h: float, sites: Any, work: Any, equations: Any) -> bool:
    """Is half a step of the loads' derivatives surely below the inertia that they act on?"""
    each(sites, reach_of_slopes, system, work, equations)
    joint, body = 0.0, 0.0
    for j in range(int(system.joints)):
        joint = max(joint, work.reach.at(j))
    if system.pushed:
        for b in range(int(system.bodies)):
            body = max(body, work.strength.at(b))
    return 0.5 * h * ((1.0 + system.near) * joint + body) < 1.0


def require_gentle(system: Any, h: float, turned: float, work: Any) -> None:
    """Refuse a step h whose kick turns velocities round.  turned : how many pivots of conditions and loads say so."""
    count = turned
    if system.pushed:
        for b in range(int(system.bodies)):
            count = count + work.thrown.at(b)
    if count > 0.0:
        work.at_joint.put(0, THROWN)
        work.reached.put(0, abs(h))
        raise NoConvergence("the first kick by loads throws back")
