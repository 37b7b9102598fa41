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
from ...rooms.sites.steps_together import summed_over
from ...solvers import CUT, NOISE, TOLERANCE, least_part, slope_beside
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from .elimination import assembled, factored, free_answers, rates_off, save_answers, scattered, solved
from .links import REST6, answered, both, poses_of, pull_on, speeds, wrenches
from .on_all_bodies import UNITS, damping_of_all, pushed_together

LINEAR = 2.0**-50
"""A correction below this part, of an iteration that converges linearly, is the last one."""

BENT = 2.0**-10
"""A change of the derivative of a load by the rate, relative, that leaves the equations as they are."""

FINDING, KICKING, HOLDING, JUDGING = range(4)
"""Phases of a kick: velocities are looked for, loads act, impulses alone hold what has moved, pivots judge the kick."""

AT_LOADS = 50
"""Corrections of the velocities that loads depend on, at the end of a step."""

THROWN = -2.0
"""In the place of the joint at which a step has failed: loads throw back; `reached` is then the length of the step."""


def loads(
    system: Any, t: float, turn: int, h: float, sites: Any, old: Any, new: Any, work: Any, kicks: bool = False
) -> None:
    """In turn 1 loads at the start of a step, which go to the field; in turn 2 the kick by them at its end.

    Newton's method finds the rates of joints, and for loads on bodies the velocities of these, to which the kick leads,
    with the impulses that take away what leads off the constraint.  Native code has the formulas of all phases once.

    kicks : are the loads of turn 1 those of an explicit kick?  A step in which it throws back is refused, as
    by `LieRATTLE`: first by how strong the loads are beside bodies that no joint holds, then by the pivots of the
    matrix of Newton's method, with the damping of the kick in it.  A step back asks at its end.
    """
    equations, judged = work.equations.fields, kicks and (system.freedoms > 0 or system.pushed)
    phase, t, k = (FINDING, t + h, 0.5 * h) if turn == 2 else (KICKING, t, 1.0)
    corrections, rate_change, rate_scale, load_change, load_scale = 0, 1.0, 0.0, 0.0, 0.0
    each(sites, velocities_here, system, old, work)
    if system.freedoms > 0:
        each(sites, rates_here, system, work, equations)
    while True:
        if phase == JUDGING:
            damped_kick(system, t, h, sites, old, work)
            corrections = 0
        else:
            kicks_by_loads(system, t, k, corrections, phase == KICKING, sites, old, work, equations)
        if phase == KICKING:
            each(sites, loaded_body, system, float(turn), old, new, work)
            if turn == 2:
                phase, k = HOLDING, 0.0
            elif not judged or h < 0.0 or spares(system, h, sites, work, equations):
                break
            else:
                phase = JUDGING
            continue
        if phase != JUDGING:
            require_turns(corrections, work)
            each(sites, loaded_velocity, system, old, work)
        negative = newton_matrix(system, corrections, where(phase == JUDGING, 1.0, 0.0), sites, work, equations)
        if phase == JUDGING:
            require_gentle(system, h, negative, work)
            break
        solved(system, equations)
        each(sites, wrench_of_corrections, system, work, equations)
        scattered(system, work)
        last = phase == HOLDING
        if phase == FINDING:
            rate_change, rate_scale, falls, last = corrected_rates(system, rate_change, rate_scale, work, equations)
            corrections = corrections + 1
            if system.pushed:
                load_change, load_scale, settled = corrected_velocities(
                    system, corrections, load_change, load_scale, sites, work
                )
                phase, last = KICKING if last and settled else FINDING, False
            elif last and system.freedoms > 0:
                each(sites, kicked_by_loads, old, work)
            elif corrections > CUT:
                cut_short(system, t, k, falls, sites, old, work, equations)
        if last:
            if not judged or h > 0.0:
                break
            phase = JUDGING


def kicks_by_loads(
    system: Any, t: float, k: float, corrections: int, last: bool, sites: Any, old: Any, work: Any, equations: Any
) -> None:  # fmt: skip
    """The kicks k F of all loads at the rates and velocities that corrections have reached, and their derivatives."""
    if system.freedoms > 0:
        if corrections == 1 and not last:
            each(sites, efforts_at, system.at_time(t), t, k, 0.0, 0.0, old, work, equations)
        corrected = where(corrections > 0, where(k == 0.0, 0.0, 1.0), 0.0)  # without a kick nothing was foreseen
        each(sites, efforts_there, system.at_time(t), t, k, corrected, old, work, equations)
        scattered(system, work)
    if system.pushes_all:
        pushed_together(system, t, k, old, work)
    if system.pushed:
        each(sites, pushed_there, system, t, k, old, work)


def damped_kick(system: Any, t: float, h: float, sites: Any, old: Any, work: Any) -> None:
    """The damping of half a kick, of joints and of bodies."""
    if system.pushes_all:
        damping_of_all(system, t, old, work)
    each(sites, damped_here, system, t, 0.5 * abs(h), old, work)


def newton_matrix(system: Any, corrections: int, pivots: float, sites: Any, work: Any, equations: Any) -> float:
    """Elimination in Newton's method: anew where the derivatives of loads have changed; the number of negative pivots,
    if `pivots` is 1.
    """
    if system.pushed or corrections == 0 or (system.freedoms > 0 and bends(system, work)):
        each(sites, excess_of_rates, system, work, equations)
        assembled(system, sites, equations.sides, 1.0, 1.0, work, equations)
        return factored(system, 1.0, equations, pivots)
    each(sites, excess_again, system, work, equations)
    return 0.0


def corrected_velocities(
    system: Any, corrections: int, before: float, size: float, sites: Any, work: Any
) -> tuple[float, float, bool]:  # fmt: skip
    """The velocities at which loads on bodies are looked for, corrected: the square of the correction, the largest one of
    the velocities, and whether it was the last one.  Of a load on all bodies by one formula the derivative has the
    blocks of single bodies only, so that corrections shrink linearly.
    """
    each(sites, corrected_velocity, work)
    off, whole = [summed_over(column, system.bodies) for column in (work.change_square, work.value_square)]
    size = max(size, whole)
    enough = TOLERANCE if system.on_all is None else LINEAR
    small = off <= enough * enough * size
    noisy = corrections > 1 and off >= before and off <= NOISE * NOISE * size
    return off, size, small or noisy or off == 0.0


def require_turns(corrections: int, work: Any) -> None:
    """Raises NoConvergence after too many corrections."""
    if corrections == AT_LOADS:
        work.failed_joint.put(0, -1.0)
        raise NoConvergence("no velocity found that fits the loads at the end of a step")


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
        work.load_velocity.save(xi)


def pushed_there(system: Any, t: float, h: float, old: Any, work: Any) -> None:
    """The kick h F of loads on a body, and the answer of the body to momentum, (J - h F')^-1, by columns."""
    g, w = plain(old.load().g), work.load_velocity.load()
    kick, slopes = REST6, [REST6 for _ in range(6)]
    if system.pushes_all:
        kick, slopes = work.load_kick.load(), [*work.slope_of_all.load()]
    if len(system.fields) > 0:
        kick = kick + h * system.on_body(work, lambda member: member.push(t, w, g))
        own_slopes = h * transpose(system.on_body(work, lambda member: slopes_of(member, t, w, g)))
        slopes = [a + b for a, b in zip(slopes, own_slopes)]
    work.body_slope_ratio.save(sum([abs(x) for slope in slopes for x in times(work.inverse.load(), slope)], 0.0))
    work.load_kick.save(kick)
    work.loaded_answer.save(answers_to_momentum(inertia_less(slopes, work)))


def slopes_of(member: Any, t: float, w: Vec, g: Mat) -> Mat:
    """The derivative of a load on a body by the velocity."""
    return jacobian(lambda y: member.push(t, y, g), w)


def inertia_less(slopes: Any, work: Any) -> Mat:
    """J less a derivative that is given by its columns."""
    J, n = work.inertia.load(), range(6)
    return mat(*[
        vec(*[(J[i, j] if isinstance(J, vectors.Mat) else J[i] if i == j else 0.0) - slopes[j][i] for j in n]) for i in n
    ])  # fmt: skip


def answers_to_momentum(A: Mat) -> Mat:
    """The inverse A^-1, which takes momenta to velocities."""
    columns, _ = eliminated(A, [*UNITS], 1.0)
    return mat(*columns)


def loaded_velocity(system: Any, old: Any, work: Any) -> None:
    """The velocity with the kick by loads: J^-1 (mu + h F), of a load on the body that is linear in it
    about the velocity that is wanted, J xi = mu + h F + h F' (xi - w).
    """
    mu = plain(old.load().mu)
    if system.freedoms > 0:
        push = pull_on(work)
        work.joint_kick.save(push)
        mu = mu + push
    if system.pushed:
        w = work.load_velocity.load()
        off = times(work.inertia.load(), w) - mu - work.load_kick.load()
        xi = w - answered(work.loaded_answer.load(), off)
    else:
        xi = times(work.inverse.load(), mu)
    work.velocity.save(xi)


def kicked_by_loads(old: Any, work: Any) -> None:
    """The state after the kick by loads at joints with which its velocity was found."""
    begin = old.load()
    old.save(BodyState(begin.mu + work.joint_kick.load(), begin.g))


def corrected_velocity(work: Any) -> None:
    """The velocity at which loads are looked for next, and how far it is from the last one."""
    J, before = work.inertia.load(), work.load_velocity.load()
    w = work.velocity.load() - answered(work.loaded_answer.load(), pull_on(work))
    work.load_velocity.save(w)
    work.change_square.save(dot(w - before, times(J, w - before)))
    work.value_square.save(dot(w, times(J, w)))


def loaded_body(system: Any, turn: float, old: Any, new: Any, work: Any) -> None:
    """In turn 1 weight, springs and loads; in turn 2 the state after the kick by loads, and its velocity."""
    begin, push = old.load(), REST6
    if system.freedoms > 0:
        push = pull_on(work)
    if system.pushed:
        push = push + work.load_kick.load()
    mu = begin.mu + where(turn > 1.0, 1.0, 0.0) * push
    work.force.save(work.force.load() + where(turn > 1.0, 0.0, 1.0) * push)
    new.save(BodyState(mu, begin.g))
    work.velocity.save(times(work.inverse.load(), plain(mu)))


# ------------------------------------------------------------------ formulas of one joint


def motions_of(system: Any, equations: Any) -> tuple[Any, Any]:
    """The motions of a joint that loads act along, by its first and its second body."""
    first, second = equations.sides.load()
    return first[system.most :], second[system.most :]


def rates_here(system: Any, work: Any, equations: Any) -> None:
    """Write down the rates of a joint, G xi."""
    rates = speeds(motions_of(system, equations), both(work.velocity, work))
    if system.rheonomic:
        rates = [x + pace for x, pace in zip(rates, work.paces.load()[system.most :])]
    work.rate.save(vec(*rates))


def efforts_at(
    system: Any, t: float, h: float, moving: float, part: float, old: Any, work: Any, equations: Any
) -> None:  # fmt: skip
    """The kick h F that loads would give at rest; or, with 1 for `moving`, a part of the last correction farther on."""
    (g, k), n = poses_of(old, work), system.freedoms
    step = equations.solution.load()[system.most :]
    rates = vec(*[where(moving > 0.0, w + part * x, 0.0) for w, x in zip(work.rate.load(), step)])
    work.kick_at_rest.save(system.of_kind(work, lambda joint: h * joint.efforts(t, joint.seen(t, g, k), rates, n)))


def efforts_there(system: Any, t: float, h: float, corrected: float, old: Any, work: Any, equations: Any) -> None:
    """The kick h F of loads, its pull on both bodies, and the slope by the rates with which Newton's method goes on.
    corrected : 1 after a correction, which has foreseen a kick.
    """
    (g, k), rates, n = poses_of(old, work), work.rate.load(), range(system.freedoms)
    kicks, gain = system.of_kind(work, lambda joint: kick_of(joint, t, h, joint.seen(t, g, k), rates))
    idle, before = work.kick_at_rest.load(), work.kick_before.load()
    foreseen = [where(corrected > 0.0, a, b) for a, b in zip(work.kick_foreseen.load(), kicks)]
    steps = [where(corrected > 0.0, x, 0.0) for x in equations.solution.load()[system.most :]]
    slopes = [slope_beside(kicks[i], idle[i], before[i], foreseen[i], rates[i], steps[i], gain[i, i]) for i in n]
    work.kick_foreseen.save(kicks)
    work.kick_before.save(kicks)
    work.load_slope.save(mat(*[vec(*[slopes[i] if i == j else gain[i, j] for j in n]) for i in n]))
    work.wrench.save(wrenches(kicks, motions_of(system, equations)))


def kick_of(joint: Any, t: float, h: float, coordinates: Any, rates: Vec) -> tuple[Vec, Mat]:
    """The kick of the loads at a joint along its motions, and its derivative by the rates."""

    def kick(y: Vec) -> Vec:
        return h * joint.efforts(t, coordinates, y, len(rates))

    return kick(rates), jacobian(kick, rates)


def excess_of_rates(system: Any, work: Any, equations: Any) -> None:
    """The rate off the constraint, and how far rates are from those at which their kick was found;
    the answers of bodies to impulses, and to a change of rates with the kick by it.
    """
    m, n, sides = system.most, range(system.freedoms), equations.sides.load()
    answers: Any = []
    gain: Any = ()
    if system.freedoms > 0:
        gain = work.load_slope.load()
        work.newton_slope.save(gain)
    for side in pushed_answers(sides, work) if system.pushed else free_answers(sides, work):
        kicks = [-vectors.sum([gain[b, i] * side[m + b] for b in n]) for i in n]
        answers = [*answers, [*side[:m], *kicks]]
    equations.residual.save(rates_off(system, sides, both(work.velocity, work), work))
    save_answers(system, sides, answers, 1.0, 1.0, work, equations)


def pushed_answers(sides: Any, work: Any) -> list[list[Vec]]:
    """The answers of bodies whose loads depend on their velocities."""
    return [[answered(answer, row) for row in side] for answer, side in zip(both(work.loaded_answer, work), sides)]


def excess_again(system: Any, work: Any, equations: Any) -> None:
    """Write down the residual of the rates of a joint, without its block of the matrix."""
    equations.residual.save(rates_off(system, equations.sides.load(), both(work.velocity, work), work))


def wrench_of_corrections(system: Any, work: Any, equations: Any) -> None:
    """The pull on both bodies of impulses, and of the kick by a change of rates, which is no pull."""
    m, solution = system.most, equations.solution.load()
    pulls = [*solution[:m]]
    if system.freedoms > 0:
        pulls = [*pulls, *[-dot(row, solution[m:]) for row in work.newton_slope.load()]]
    work.wrench.save(wrenches(pulls, equations.sides.load()))


def bends(system: Any, work: Any) -> bool:
    """Has the derivative of loads by rates changed by more than Newton's method does not notice?"""
    changed = 0.0
    for j in range(int(system.joints)):
        for a, b in zip(work.load_slope.at(j), work.newton_slope.at(j)):
            for x, y in zip(a, b):
                changed = where(abs(x - y) > BENT * abs(y), 1.0, changed)
    return changed > 0.0


def corrected_rates(
    system: Any, before: float, scale: float, work: Any, equations: Any
) -> tuple[float, float, float, bool]:  # fmt: skip
    """Rates after Newton's correction, and the kicks that it foresees: the square of the correction, the largest one of rates
    and of what they were off, the sum of corrections times those of kicks, and whether it was the last one.  At rest what
    they were off says alone what rounding is: a step may lose all its motion.
    """
    change, whole, falls, m = 0.0, 0.0, 0.0, system.most
    if system.freedoms > 0:
        for j in range(int(system.joints)):
            step, off, old = equations.solution.at(j)[m:], equations.residual.at(j)[m:], work.rate.at(j)
            work.rate.put(j, old + step)
            kick = work.kick_foreseen.at(j) + vec(*[dot(row, step) for row in work.newton_slope.at(j)])
            added = kick - work.kick_on_line.at(j)
            work.kick_foreseen.put(j, kick)
            work.kick_on_line.put(j, kick)
            work.kick_added.put(j, added)
            change, whole = change + dot(step, step), whole + dot(old, old) + dot(off, off)
            falls = falls + dot(step, added)
    scale = max(scale, whole)
    small = change <= TOLERANCE * TOLERANCE * scale
    noisy = change >= before and change <= NOISE * NOISE * scale
    return change, scale, falls, small or noisy or change == 0.0


def slope_along(system: Any, part: float, work: Any, equations: Any) -> float:
    """The slope of the energy along the last correction, a part of it farther on, where the kicks are known."""
    total = 0.0
    for j in range(int(system.joints)):
        step = equations.solution.at(j)[system.most :]
        off = work.kick_on_line.at(j) + part * work.kick_added.at(j) - work.kick_at_rest.at(j)
        total = total + dot(step, off)
    return total


def shortened(system: Any, part: float, work: Any, equations: Any) -> None:
    """The last correction, cut to a part of it."""
    m = system.most
    for j in range(int(system.joints)):
        whole = equations.solution.at(j)
        kick = work.kick_on_line.at(j) + (part - 1.0) * work.kick_added.at(j)
        work.rate.put(j, work.rate.at(j) + (part - 1.0) * whole[m:])
        equations.solution.put(j, vec(*whole[:m], *(part * whole[m:])))
        work.kick_on_line.put(j, kick)
        work.kick_foreseen.put(j, kick)


# ------------------------------------------------------------------ kicks that throw back


def damped_here(system: Any, t: float, h: float, old: Any, work: Any) -> None:
    """h times the damping of a joint; the answer of the body to momentum under h times its own damping, and how
    many of its directions are thrown back.
    """
    n = system.freedoms
    if n > 0:
        (g, k), rates = poses_of(old, work), work.rate.load()
        damping = system.at_time(t).of_kind(work, lambda joint: joint.resistances(t, joint.seen(t, g, k), rates, n))
        work.load_slope.save(mat(*[vec(*[h * damping[i] if i == j else 0.0 for j in range(n)]) for i in range(n)]))
    if system.pushed:
        damped = [REST6 for _ in range(6)]
        if system.pushes_all:
            damped = [h * column for column in work.slope_of_all.load()]
        if len(system.fields) > 0:
            pose, xi = plain(old.load().g), work.load_velocity.load()
            own_damping = system.on_body(
                work, lambda member: mat(*[member.resistance(t, xi, pose, unit) for unit in UNITS])
            )
            damped = [a + h * b for a, b in zip(damped, own_damping)]
        A = inertia_less(damped, work)
        work.loaded_answer.save(answers_to_momentum(A))
        work.directions_thrown.save(negative_pivots(A))


def reach_of_slopes(system: Any, work: Any, equations: Any) -> None:
    """The derivatives of loads by rates, at the start of a step, beside the inertia of bodies that no joint holds."""
    n, ratio = system.freedoms, 0.0
    if n > 0:
        slopes = work.load_slope.load()
        for side, inverse in zip(motions_of(system, equations), both(work.inverse, work)):
            for i in range(n):
                ratio = ratio + abs(slopes[i, i]) * dot(side[i], times(inverse, side[i]))
    work.slope_ratio.save(ratio)


def spares(system: Any, h: float, sites: Any, work: Any, equations: Any) -> bool:
    """Is half a step of the loads' derivatives surely below the inertia that they act on?"""
    each(sites, reach_of_slopes, system, work, equations)
    joint, body = 0.0, 0.0
    for j in range(int(system.joints)):
        joint = max(joint, work.slope_ratio.at(j))
    if system.pushed:
        for b in range(int(system.bodies)):
            body = max(body, work.body_slope_ratio.at(b))
    return 0.5 * h * ((1.0 + system.near) * joint + body) < 1.0


def require_gentle(system: Any, h: float, negative: float, work: Any) -> None:
    """Refuse a step h whose kick turns velocities round.  negative : how many pivots of conditions and loads say so."""
    count = negative
    if system.pushed:
        count = count + summed_over(work.directions_thrown, system.bodies)
    if count > 0.0:
        work.failed_joint.put(0, THROWN)
        work.reached.put(0, abs(h))
        raise NoConvergence("the first kick by loads throws back")
