"""Taylor series of the motion of any number of bodies and joints: multipliers order by order, by one
elimination from joint to joint.

With coefficients of power series in the time over the step, a product being their Cauchy product,

    (k + 1) g_k+1 = h (g xi)_k,   (k + 1) mu_k+1 = h (ad*_xi mu + f - G* lam)_k,   xi_k = J^-1 mu_k,

and the conditions (G xi)_k+1 = 0 are equations for lam_k, of which the matrix is that of order zero:

    M_0 lam_k = G_0 J^-1 (ad*_xi mu + f - sum_j G_j* lam_k-j)_k + (k + 1)/h sum_j G_j xi_k+1-j,   M_0 = G_0 J^-1 G_0*,   j >= 1.

Source: Jorba and Zou, Experimental Mathematics 14 (2005) (the method); Hairer, Lubich, Wanner,
Geometric Numerical Integration, 2nd ed., VII.1.2 (index reduction).
"""

from __future__ import annotations

from typing import Any

from ...compiler.sites.planes import columns, each
from ...formulas import Mat, Vec, cross, dot, mat, plain, record, vec, where
from ...formulas.classes.layouts import Layout, matrix, vector
from ...formulas.classes.records import with_fields
from ...formulas.columns import named
from ...formulas.numbers.series import Series
from ...groups.rigid.se3 import SE3, join
from ...integrators.taylor import total
from ...systems.kinetic_energy import KineticEnergy, times
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from .elimination import assembled, free_answers, pulled_by_solution, require_multipliers, save_answers, scattered
from .links import PAIR, SIX, StepsOfLinks, both, pull_on, speeds

ALONE = LiePoissonSystem(SE3(), KineticEnergy([1.0] * 6))
"""A body that moves alone, for its chart; its inertia does not count."""

MOTION = matrix(3, 4)
"""The layout of [R, p]."""

END = vec(0.0, 0.0, 0.0, 1.0)


def terms_of(order: int, most: int) -> Layout:
    """The coefficients of a place by name, of a series of so many terms and of a joint with so many conditions."""
    rows = matrix(most, 6)
    each_term = dict(
        pose=MOTION,  # of g
        turned=MOTION,  # of g seen from the start of the step
        mu=SIX,  # of momentum
        xi=SIX,  # and velocity
        force=SIX,  # of all forces on the body
        push=SIX,  # of those, seen from the start of the step
        sides=Layout("tuple", (rows, rows)),  # of the rows G of the joint
        multiplier=vector(most),  # lam
        pushes=PAIR,  # of springs and loads of the joint, on both bodies
        field=SIX,  # of fields and loads on the body
    )
    return named(**{name: Layout("tuple", (layout,) * (order + 2)) for name, layout in each_term.items()})


@record
class TaylorOfLinks(StepsOfLinks):
    """A Taylor series method, of many bodies and joints.

    method : the Taylor.  orders, rounds : how many terms there are.  spans : the rows of
    joints are written out once for so many terms, and again for more of them.  terms : what lies in memory.
    """

    method: Any
    orders: int
    rounds: float
    spans: tuple[int, ...]
    terms: Layout

    @property
    def room(self) -> int:
        return self.terms.width

    def step_together(
        self, system: Any, t: float, h: float, sites: Any, source: int, target: int, memory: Layout
    ) -> None:
        """A step of all bodies: order by order the terms, and the state to which they lead."""
        places = columns(sites, copies=(memory, memory), terms=self.terms, work=system.work)
        old, new = places.copies.nth(source).fields.state, places.copies.nth(target).fields.state
        terms, work = places.terms.fields, places.work.fields
        equations = work.equations.heads(system.most)
        each(sites, first_terms, h, old, terms, work)
        for k in range(int(self.rounds)):
            ready = 0
            for count in self.spans:
                if ready < k + 2 and k + 2 <= count:
                    each(sites, rows_of_joint, system, ready, count, terms, work)
                ready = count
            if system.springs or system.freedoms > 0:
                if k + 1 <= self.orders // 2:
                    early = self.orders // 2
                    each(sites, pushes_of_joint, system, early, t, h, terms, work)
                else:
                    each(sites, pushes_of_joint, system, self.orders, t, h, terms, work)
            each(sites, held_back, system, k, terms, work)
            scattered(system, work)
            if len(system.fields) > 0:
                each(sites, fields_of_body, self.orders, system, t, h, terms, work)
            each(sites, freely, system, k, terms, work)
            each(sites, missed, h, k, terms, work, equations)
            if k == 0:
                each(sites, own_block, system, terms, work, equations)
                assembled(system, sites, equations.sides, 1.0, 1.0, work, equations)
                require_multipliers(system, work, equations)
            pulled_by_solution(system, sites, work, equations)
            each(sites, multiplied, k, terms, equations)
            each(sites, next_terms, h, k, terms, work)
        each(sites, summed_up, self, h, old, new, terms)


# ------------------------------------------------------------------ formulas of one body


def first_terms(h: float, old: Any, terms: Any, work: Any) -> None:
    """Momentum and pose at the start, and the term of the pose that follows from the velocity."""
    begin = old.load()
    g, mu = plain(begin.g), plain(begin.mu)
    xi = times(work.inverse.load(), mu)
    still = mat(*[vec(*[1.0 if i == j else 0.0 for j in range(4)]) for i in range(3)])
    for poses, motion in ((terms.pose, mat(*g[:3])), (terms.turned, still)):
        poses.nth(0).save(motion)
        poses.nth(1).save(moving(h, motion, xi))
    terms.mu.nth(0).save(mu)
    terms.xi.nth(0).save(xi)


def moving(c: float, g: Mat, xi: Vec) -> Mat:
    """c g xi = c [R w^, R v]."""
    w, v = c * xi[:3], c * xi[3:]
    R = [row[:3] for row in g]
    return mat(*[vec(*cross(row, w), dot(row, v)) for row in R])


def freely(system: Any, k: int, terms: Any, work: Any) -> None:
    """The acceleration without lam_k, J^-1 (ad*_xi mu + f - ...)_k."""
    weight, down = work.weight.load(), terms.pose.nth(k).load()[2]
    force = pull_on(work) + vec(0.0, 0.0, 0.0, *[-(weight * down[j]) for j in range(3)])
    if len(system.fields) > 0:
        force = force + terms.field.nth(k).load()
    change = force
    for j in range(k + 1):
        change = change + system.group.ad_star(terms.xi.nth(j).load(), terms.mu.nth(k - j).load())
    work.force.save(force)
    work.free_at_end.save(change)
    work.velocity.save(times(work.inverse.load(), change))


def next_terms(h: float, k: int, terms: Any, work: Any) -> None:
    """With lam_k the forces, and the next terms of momentum, velocity and pose."""
    pull, order = pull_on(work), 1.0 * k + 1.0
    force = work.force.load() - pull
    mu = (h / order) * (work.free_at_end.load() - pull)
    xi = times(work.inverse.load(), mu)
    for poses in (terms.pose, terms.turned):
        motion = moving(1.0, poses.nth(0).load(), xi)
        for j in range(k + 1):
            motion = motion + moving(1.0, poses.nth(j + 1).load(), terms.xi.nth(k - j).load())
        poses.nth(k + 2).save((h / (order + 1.0)) * motion)
    push = force_from_start(k, terms, force)
    terms.force.nth(k).save(force)
    terms.push.nth(k).save(push)
    terms.mu.nth(k + 1).save(mu)
    terms.xi.nth(k + 1).save(xi)


def force_from_start(k: int, terms: Any, last: Vec) -> Vec:
    """The term of order k of the forces on a body, seen from its pose at the start of the step,
    (R m + p x R f, R f), of those in its own axes, (m, f), of which the last is not yet written.
    """
    moment, force = last[:3], last[3:]  # with R_0 = 1, p_0 = 0
    for j in range(k):
        motion, term = terms.turned.nth(j + 1).load(), terms.force.nth(k - 1 - j).load()
        moment = moment + vec(*[dot(row[:3], term[:3]) for row in motion])
        force = force + vec(*[dot(row[:3], term[3:]) for row in motion])
    for j in range(k):
        p = vec(*[row[3] for row in terms.turned.nth(j + 1).load()])
        moment = moment + cross(p, terms.push.nth(k - 1 - j).load()[3:])
    return join(moment, force)


def fields_of_body(orders: int, system: Any, t: float, h: float, terms: Any, work: Any) -> None:
    """The terms of fields and loads on the body alone, of all orders."""
    g = full([terms.pose.nth(j).load() for j in range(orders)])
    xi = in_order([terms.xi.nth(j).load() for j in range(orders)])

    def pulled(joint: Any) -> list[Vec]:
        force = joint.pull(g)
        if system.pushed:
            force = force + joint.push(Series(t, h), xi, g)
        return [vec(*[term_of(x, i) for x in force]) for i in range(orders)]

    for i, force in enumerate(system.on_body(work, pulled)):
        terms.field.nth(i).save(force)


def summed_up(method: Any, h: float, old: Any, new: Any, terms: Any) -> None:
    """The state at the end: Omega in the chart, and the momentum seen from the start, by their series."""
    p, begin = method.orders, old.load()
    xi = in_order([terms.xi.nth(k).load() for k in range(p)])
    omega = vec(*[Series(None) for _ in range(6)])
    slope = method.method._slope(ALONE, omega, xi)
    for x, rate in zip(omega, slope):
        x.grow(rate, h)
    terms_of_omega = [vec(*[x[k] for x in omega]) for k in range(1, p + 1)]
    kicks = [(h / (k + 1.0)) * terms.push.nth(k).load() for k in range(p)]
    pushed = BodyState(begin.mu + total(kicks), begin.g)
    new.save(ALONE.displaced(method.method.retraction, pushed, total(terms_of_omega)))


def in_order(coefficients: Any) -> Vec:
    """The vector of series with these coefficients."""
    return vec(*[Series(*[x[i] for x in coefficients]) for i in range(len(coefficients[0]))])


def full(coefficients: Any) -> Mat:
    """The pose with coefficients [R, p]."""
    return mat(*[vec(*[Series(*[x[i][j] for x in coefficients]) for j in range(4)]) for i in range(3)], END)


def term_of(x: Any, k: int) -> Any:
    """c_k of a series, or of a number that does not change."""
    if isinstance(x, Series):
        return x[k]
    return x if k == 0 else 0.0


# ------------------------------------------------------------------ formulas of one joint


def rows_of_joint(system: Any, begin: int, count: int, terms: Any, work: Any) -> None:
    """The rows of a joint of the orders from `begin` on; higher ones than are to be known count for nothing."""
    alive, (has_second, poses) = work.alive.load(), poses_in_order(count, terms, work)
    orders = range(begin, count)

    def found(joint: Any) -> list[Any]:
        sides = joint.rows(*poses, system.most, 0)
        return [[vec(*[term_of(x, i) for x in row]) for side in sides for row in side] for i in orders]

    for order, rows in zip(orders, of_joint(system, work, found)):
        first = [a * row for a, row in zip(alive, rows[: system.most])]
        second = [(a * has_second) * row for a, row in zip(alive, rows[system.most :])]
        terms.sides.nth(order).save((mat(*first), mat(*second)))


def of_joint(system: Any, work: Any, formula: Any, done: tuple[Any, ...] = ()) -> Any:
    """A formula of the joint alone: once for all kinds that differ by what acts at them.

    done : layouts of joints that it is not.
    """
    joint_kind = next(kind.parts[0] for kind in system.kinds if kind.parts[0] not in done)
    which, is_here, joint = work.ends.load()[3], 0.0, None
    for k, kind in enumerate(system.kinds):
        if kind.parts[0] == joint_kind:
            record = work.joint_parameters.nth(k).load()
            joint = record if joint is None else with_fields(joint, joint=record.joint if which == k else joint.joint)
            is_here = is_here + where(which == k, 1.0, 0.0)
    if all(kind.parts[0] in (*done, joint_kind) for kind in system.kinds):
        return formula(joint)
    if is_here > 0.0:
        return formula(joint)
    return of_joint(system, work, formula, (*done, joint_kind))


def poses_in_order(count: int, terms: Any, work: Any) -> tuple[float, tuple[Mat, Mat]]:
    """Is there a second body?  And the poses of both as series of so many terms, the ground's without one."""
    first, second, has_second, _ = work.ends.load()
    g, k = [[terms.pose.nth(j).at(body) for j in range(count)] for body in (first, second)]
    other = [mat(*[has_second * row for row in motion]) for motion in k]
    still = mat(*[vec(*[1.0 - has_second if i == j else 0.0 for j in range(4)]) for i in range(3)])
    return has_second, (full(g), full([other[0] + still, *other[1:]]))


def pushes_of_joint(system: Any, p: int, t: float, h: float, terms: Any, work: Any) -> None:
    """The terms of springs and loads of a joint, of which higher ones than are to be known count for nothing."""
    n, m = system.most, system.freedoms
    first, second, _, _ = work.ends.load()
    has_second, poses = poses_in_order(p, terms, work)
    xi, eta = [in_order([terms.xi.nth(j).at(body) for j in range(p)]) for body in (first, second)]
    time: Any = Series(t, h)

    def found(joint: Any) -> list[Vec]:
        push = joint.springs_push(*poses) if system.springs else vec(*[0.0] * 12)
        if m > 0:
            turning, by = joint.rows(*poses, n, m)
            turning, by = turning[n:], by[n:]
            rates = vec(*[dot(a, xi) + has_second * dot(b, eta) for a, b in zip(turning, by)])
            efforts = joint.efforts(time, joint.seen(time, *poses), rates, m)
            for e, a, b in zip(efforts, turning, by):
                push = push + vec(*[e * x for x in (*a, *b)])
        return [vec(*[term_of(x, i) for x in push]) for i in range(p)]

    for i, push in enumerate(system.of_kind(work, found)):
        terms.pushes.nth(i).save((vec(*push[:6]), has_second * vec(*push[6:])))


def held_back(system: Any, k: int, terms: Any, work: Any) -> None:
    """Less the pull of multipliers that are known, sum_j G_j* lam_k-j."""
    on_first = on_second = vec(*[0.0] * 6)
    if system.springs or system.freedoms > 0:
        on_first, on_second = terms.pushes.nth(k).load()
    for j in range(k):
        lam, (G, H) = terms.multiplier.nth(k - 1 - j).load(), terms.sides.nth(j + 1).load()
        for i in range(system.most):
            on_first, on_second = on_first - lam[i] * G[i], on_second - lam[i] * H[i]
    work.wrench.save((on_first, on_second))


def missed(h: float, k: int, terms: Any, work: Any, equations: Any) -> None:
    """The right side of the equation for lam_k."""
    factor, bent = (1.0 * k + 1.0) / h, vec(*[0.0] * equations.residual.width)
    for j in range(k + 1):
        bent = bent + vec(*speeds(terms.sides.nth(j + 1).load(), both(terms.xi.nth(k - j), work)))
    free = speeds(terms.sides.nth(0).load(), both(work.velocity, work))
    equations.residual.save(vec(*[x + factor * c for x, c in zip(free, bent)]))


def own_block(system: Any, terms: Any, work: Any, equations: Any) -> None:
    """The rows of order zero, the answers of the bodies to impulses, J^-1 G*, and the block of the joint itself."""
    sides = terms.sides.nth(0).load()
    equations.sides.save(sides)
    save_answers(system, sides, free_answers(sides, work), 1.0, 1.0, work, equations)


def multiplied(k: int, terms: Any, equations: Any) -> None:
    """Write down the multiplier lam_k of the order k."""
    terms.multiplier.nth(k).save(equations.solution.load())
