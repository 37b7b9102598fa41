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

from typing import Any, ClassVar

from ...compiler.sites.planes import at, below, each, load, put, save
from ...errors import NoConvergence
from ...formulas import Mat, Record, Vec, cross, dot, mat, plain, record, vec, where
from ...formulas.classes.layouts import Layout, matrix, vector
from ...formulas.classes.records import with_fields
from ...formulas.numbers.conversions import fitted
from ...formulas.numbers.series import Series
from ...groups.rigid.se3 import SE3, join
from ...integrators.taylor import total
from ...systems.kinetic_energy import KineticEnergy, times
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from .rattle_of_links import (
    ENDS,
    NUMBER,
    SIX,
    LinkMemory,
    coupled,
    eliminated_again,
    factored,
    pull_on,
    save_pushed,
    save_wrench,
    scattered,
    solved,
    tied,
)

ALONE = LiePoissonSystem(SE3(), KineticEnergy([1.0] * 6))
"""A body that moves alone, for its chart; its inertia does not count."""

TWELVE, MOTION = vector(12), matrix(3, 4)
"""The layouts of a wrench on two bodies, and of [R, p]."""

END = vec(0.0, 0.0, 0.0, 1.0)


@record
class SeriesRows(Record):
    """Where coefficients lie, one behind the other: the row with which they begin.

    pose : of g.  turned : of g seen from the start of the step.  mu, xi : of momentum and velocity.
    force : of all forces on the body, and of those seen from the start of the step, `push`.
    first, second : of the rows G of a joint.  multiplier : lam.  pushes : of springs and loads of a
    joint, on both bodies.  field : of fields and loads on the body.
    """

    pose: int
    turned: int
    mu: int
    xi: int
    force: int
    push: int
    first: int
    second: int
    multiplier: int
    pushes: int
    field: int
    end: int

    @classmethod
    def of(cls, order: int, most: int) -> SeriesRows:
        """Those of so many terms, and conditions of a joint."""
        widths = 12, 12, 6, 6, 6, 6, 6 * most, 6 * most, most, 12, 6
        places = [(order + 2) * sum(widths[:k]) for k in range(len(widths) + 1)]
        return cls(*places)


@record
class TaylorOfLinks(Record):
    """A Taylor series method, of many bodies and joints.

    method : the Taylor.  orders, rounds : how many terms there are.  spans : the rows of
    joints are written out once for so many terms, and again for more of them.
    """

    method: Any
    orders: int
    rounds: float
    spans: tuple[int, ...]
    rows: SeriesRows
    name: str = ""

    together: ClassVar[bool] = True
    settles: ClassVar[bool] = False
    symmetric: ClassVar[bool] = False

    def __repr__(self) -> str:
        return self.name

    @property
    def room(self) -> int:
        """Rows of coefficients."""
        return self.rows.end

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        """A state."""
        return LinkMemory(state, ())

    def observe(self, memory: LinkMemory) -> Any:
        """The state."""
        return memory.state

    def step_together(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Layout) -> None:
        """A step of all bodies: order by order the terms, and the state to which they lead."""
        state, width, n = memory.parts[0], memory.width, system.most
        old, new = below(sites, here * width), below(sites, there * width)
        terms, work = below(sites, 2 * width), below(sites, 2 * width + self.rows.end)
        each(sites, first_terms, self, system, h, old, terms, work, state)
        for k in range(int(self.rounds)):
            known = 0
            for count in self.spans:
                if known < k + 2 and k + 2 <= count:
                    each(sites, rows_of_joint, self, system, known, count, terms, work)
                known = count
            if system.springs or system.freedoms > 0:
                if k + 1 <= self.orders // 2:
                    early = self.orders // 2
                    each(sites, pushes_of_joint, self, system, early, t, h, terms, work)
                else:
                    each(sites, pushes_of_joint, self, system, self.orders, t, h, terms, work)
            each(sites, held_back, self, system, k, terms, work)
            scattered(system, work)
            if len(system.fields) > 0:
                each(sites, fields_of_body, self, system, t, h, terms, work)
            each(sites, freely, self, system, k, terms, work)
            each(sites, missed, self, system, h, k, terms, work)
            if k == 0:
                each(sites, own_block, self, system, terms, work)
                each(sites, tied, system, system.rows.first, n, work)
                coupled(system, work, system.rows.first, 1.0, n)
                bad = factored(system, work, 1.0, n)
                if bad >= 0.0:
                    put(below(work, system.rows.note), 0, 0, bad, NUMBER)
                    put(below(work, system.rows.note), 0, 1, -1.0, NUMBER)
                    raise NoConvergence("the conditions of joints depend on each other")
            else:
                eliminated_again(system, work, n)
            solved(system, work, n)
            each(sites, multiplied, self, system, k, terms, work)
            scattered(system, work)
            each(sites, next_terms, self, system, h, k, terms, work)
        each(sites, summed_up, self, h, old, new, terms, state)


# ------------------------------------------------------------------ formulas of one body


def first_terms(method: Any, system: Any, h: float, old: Any, terms: Any, work: Any, state: Layout) -> None:
    """Momentum and pose at the start, and the term of the pose that follows from the velocity."""
    rows, one = method.rows, load(old, 0, state)
    g, mu = plain(one.g), plain(one.mu)
    xi = times(system.inverse(work), mu)
    still = mat(*[vec(*[1.0 if i == j else 0.0 for j in range(4)]) for i in range(3)])
    for place, motion in ((rows.pose, mat(*g[:3])), (rows.turned, still)):
        save(below(terms, place), 0, motion, MOTION)
        save(below(terms, place), 1, moving(h, motion, xi), MOTION)
    save(below(terms, rows.mu), 0, mu, SIX)
    save(below(terms, rows.xi), 0, xi, SIX)


def moving(c: float, g: Mat, xi: Vec) -> Mat:
    """c g xi = c [R w^, R v]."""
    w, v = c * xi[:3], c * xi[3:]
    R = [row[:3] for row in g]
    return mat(*[vec(*cross(row, w), dot(row, v)) for row in R])


def freely(method: Any, system: Any, k: int, terms: Any, work: Any) -> None:
    """The acceleration without lam_k, J^-1 (ad*_xi mu + f - ...)_k."""
    rows, own = method.rows, system.rows
    weight = load(below(work, own.weight), 0, NUMBER)
    down = load(below(terms, rows.pose), k, MOTION)[2]
    force = pull_on(system, work) + vec(0.0, 0.0, 0.0, *[-(weight * down[j]) for j in range(3)])
    if len(system.fields) > 0:
        force = force + load(below(terms, rows.field), k, SIX)
    change = force
    for j in range(k + 1):
        xi, mu = load(below(terms, rows.xi), j, SIX), load(below(terms, rows.mu), k - j, SIX)
        change = change + system.group.ad_star(xi, mu)
    save(below(work, own.force), 0, force, SIX)
    save(below(work, own.led), 0, change, SIX)
    save(below(work, own.velocity), 0, times(system.inverse(work), change), SIX)


def next_terms(method: Any, system: Any, h: float, k: int, terms: Any, work: Any) -> None:
    """With lam_k the forces, and the next terms of momentum, velocity and pose."""
    rows, own, more = method.rows, system.rows, 1.0 * k + 1.0
    pull = pull_on(system, work)
    force = load(below(work, own.force), 0, SIX) - pull
    mu = (h / more) * (load(below(work, own.led), 0, SIX) - pull)
    xi = times(system.inverse(work), mu)
    for place in (rows.pose, rows.turned):
        pose = below(terms, place)
        found = moving(1.0, load(pose, 0, MOTION), xi)
        for j in range(k + 1):
            found = found + moving(1.0, load(pose, j + 1, MOTION), load(below(terms, rows.xi), k - j, SIX))
        save(pose, k + 2, (h / (more + 1.0)) * found, MOTION)
    push = force_from_start(method, k, terms, force)
    save(below(terms, rows.force), k, force, SIX)
    save(below(terms, rows.push), k, push, SIX)
    save(below(terms, rows.mu), k + 1, mu, SIX)
    save(below(terms, rows.xi), k + 1, xi, SIX)


def force_from_start(method: Any, k: int, terms: Any, last: Vec) -> Vec:
    """The term of order k of the forces on a body, seen from its pose at the start of the step,
    (R m + p x R f, R f), of those in its own axes, (m, f), of which the last is not yet written.
    """
    pose, forces = below(terms, method.rows.turned), below(terms, method.rows.force)
    pushes = below(terms, method.rows.push)
    moment, force = last[:3], last[3:]  # with R_0 = 1, p_0 = 0
    for j in range(k):
        motion, one = load(pose, j + 1, MOTION), load(forces, k - 1 - j, SIX)
        moment = moment + vec(*[dot(row[:3], one[:3]) for row in motion])
        force = force + vec(*[dot(row[:3], one[3:]) for row in motion])
    for j in range(k):
        motion = load(pose, j + 1, MOTION)
        p = vec(*[row[3] for row in motion])
        moment = moment + cross(p, load(pushes, k - 1 - j, SIX)[3:])
    return join(moment, force)


def fields_of_body(method: Any, system: Any, t: float, h: float, terms: Any, work: Any) -> None:
    """The terms of fields and loads on the body alone, of all orders."""
    p, rows = method.orders, method.rows
    g = full([load(below(terms, rows.pose), j, MOTION) for j in range(p)])
    xi = in_order([load(below(terms, rows.xi), j, SIX) for j in range(p)])

    def pulled(one: Any) -> Vec:
        force = one.pull(g)
        if system.pushed:
            force = force + one.push(Series(t, h), xi, g)
        return vec(*[term_of(x, i) for i in range(p) for x in force])

    numbers = [*system.on_body(work, pulled)]
    for i in range(p):
        save(below(terms, rows.field), i, vec(*numbers[6 * i : 6 * i + 6]), SIX)


def summed_up(method: Any, h: float, old: Any, new: Any, terms: Any, state: Layout) -> None:
    """The state at the end: Omega in the chart, by its series; the momentum, seen from the start, by
    that of the forces seen from there.
    """
    rows, p, one = method.rows, method.orders, load(old, 0, state)
    xi = in_order([load(below(terms, rows.xi), k, SIX) for k in range(p)])
    omega = vec(*[Series(None) for _ in range(6)])
    slope = method.method._slope(ALONE, omega, xi)
    for x, rate in zip(omega, slope):
        x.grow(rate, h)
    way = [vec(*[x[k] for x in omega]) for k in range(1, p + 1)]
    kicks = [(h / (k + 1.0)) * load(below(terms, rows.push), k, SIX) for k in range(p)]
    pushed = BodyState(one.mu + total(kicks), one.g)
    found = ALONE.displaced(method.method.retraction, pushed, total(way))
    save(new, 0, fitted(found, state), state)


def in_order(some: Any) -> Vec:
    """The vector of series with these coefficients."""
    return vec(*[Series(*[x[i] for x in some]) for i in range(len(some[0]))])


def full(some: Any) -> Mat:
    """The pose with coefficients [R, p]."""
    return mat(*[vec(*[Series(*[x[i][j] for x in some]) for j in range(4)]) for i in range(3)], END)


def term_of(x: Any, k: int) -> Any:
    """c_k of a series, or of a number that does not change."""
    if isinstance(x, Series):
        return x[k]
    return x if k == 0 else 0.0


# ------------------------------------------------------------------ formulas of one joint


def rows_of_joint(method: Any, system: Any, known: int, count: int, terms: Any, work: Any) -> None:
    """The rows of a joint of so many orders beyond those that are known, of which those that are not
    yet to be known count for nothing.
    """
    rows, n = method.rows, system.most
    alive = load(below(work, system.rows.alive), 0, vector(n))
    held, poses = poses_in_order(method, system, count, terms, work)
    orders = range(known, count)

    def found(one: Any) -> Vec:
        sides = one.rows(*poses, n, 0)
        return vec(*[term_of(x, i) for i in orders for side in sides for row in side for x in row])

    numbers = [*of_joint(system, work, found)]
    for order in orders:
        for side, place in enumerate((rows.first, rows.second)):
            begin = (2 * (order - known) + side) * 6 * n
            alone = [
                (a * held if side else a) * vec(*numbers[begin + 6 * j : begin + 6 * j + 6])
                for j, a in enumerate(alive)
            ]
            save(below(terms, place), order, mat(*alone), matrix(n, 6))


def of_joint(system: Any, work: Any, formula: Any, done: tuple[Any, ...] = ()) -> Any:
    """A formula of the joint alone: once for all kinds that differ by what acts at them.

    done : layouts of joints that it is not.
    """
    place, which = below(work, system.rows.own), load(below(work, system.rows.ends), 0, ENDS)[3]
    own = next(kind.parts[0] for kind in system.kinds if kind.parts[0] not in done)
    row, here, it = 0, 0.0, None
    for k, kind in enumerate(system.kinds):
        if kind.parts[0] == own:
            one = load(below(place, row), 0, kind)
            it = one if it is None else with_fields(it, joint=one.joint if which == k else it.joint)
            here = here + where(which == k, 1.0, 0.0)
        row = row + kind.width
    if all(kind.parts[0] in (*done, own) for kind in system.kinds):
        return formula(it)
    if here > 0.0:
        return formula(it)
    return of_joint(system, work, formula, (*done, own))


def poses_in_order(method: Any, system: Any, count: int, terms: Any, work: Any) -> tuple[float, tuple[Mat, Mat]]:
    """Whether there is a second body, and the poses of a joint's bodies as series of so many terms;
    without a second body that of the ground.
    """
    first, second, held, _ = load(below(work, system.rows.ends), 0, ENDS)
    place = below(terms, method.rows.pose)
    g, k = [[at(place, body, j, MOTION) for j in range(count)] for body in (first, second)]
    other = [mat(*[held * row for row in motion]) for motion in k]
    still = mat(*[vec(*[1.0 - held if i == j else 0.0 for j in range(4)]) for i in range(3)])
    return held, (full(g), full([other[0] + still, *other[1:]]))


def pushes_of_joint(method: Any, system: Any, p: int, t: float, h: float, terms: Any, work: Any) -> None:
    """The terms of springs and loads of a joint, of so many orders, of which those that are not yet to
    be known count for nothing.
    """
    n, m = system.most, system.freedoms
    first, second, _, _ = load(below(work, system.rows.ends), 0, ENDS)
    held, poses = poses_in_order(method, system, p, terms, work)
    xis = below(terms, method.rows.xi)
    xi, eta = [in_order([at(xis, body, j, SIX) for j in range(p)]) for body in (first, second)]
    time: Any = Series(t, h)

    def found(one: Any) -> Vec:
        push = one.springs_push(*poses) if system.springs else vec(*[0.0] * 12)
        if m > 0:
            turning, by = one.rows(*poses, n, m)
            turning, by = turning[n:], by[n:]
            rates = vec(*[dot(a, xi) + held * dot(b, eta) for a, b in zip(turning, by)])
            efforts = one.efforts(time, one.seen(time, *poses), rates, m)
            for e, a, b in zip(efforts, turning, by):
                push = push + vec(*[e * x for x in (*a, *b)])
        return vec(*[term_of(x, i) for i in range(p) for x in push])

    numbers = [*system.of_kind(work, found)]
    for i in range(p):
        one, two = numbers[12 * i : 12 * i + 6], numbers[12 * i + 6 : 12 * i + 12]
        save(below(terms, method.rows.pushes), i, vec(*one, *[held * x for x in two]), TWELVE)


def held_back(method: Any, system: Any, k: int, terms: Any, work: Any) -> None:
    """Less the pull of multipliers that are known, sum_j G_j* lam_k-j."""
    rows, n = method.rows, system.most
    push = vec(*[0.0] * 12)
    if system.springs or system.freedoms > 0:
        push = load(below(terms, rows.pushes), k, TWELVE)
    for j in range(k):
        lam = load(below(terms, rows.multiplier), k - 1 - j, vector(n))
        one = load(below(terms, rows.first), j + 1, matrix(n, 6))
        two = load(below(terms, rows.second), j + 1, matrix(n, 6))
        for i in range(n):
            push = push - lam[i] * vec(*one[i], *two[i])
    save(below(work, system.rows.wrench), 0, push, TWELVE)


def missed(method: Any, system: Any, h: float, k: int, terms: Any, work: Any) -> None:
    """The right side of the equation for lam_k."""
    rows, own, n = method.rows, system.rows, system.most
    first, second, _, _ = load(below(work, own.ends), 0, ENDS)
    xis, more, layout = below(terms, rows.xi), (1.0 * k + 1.0) / h, matrix(n, 6)
    bent = vec(*[0.0] * n)
    for j in range(k + 1):
        xi, eta = at(xis, first, k - j, SIX), at(xis, second, k - j, SIX)
        one, two = [load(below(terms, place), j + 1, layout) for place in (rows.first, rows.second)]
        bent = bent + vec(*[dot(a, xi) + dot(b, eta) for a, b in zip(one, two)])
    xi, eta = [at(below(work, own.velocity), body, 0, SIX) for body in (first, second)]
    one, two = [load(below(terms, place), 0, layout) for place in (rows.first, rows.second)]
    rest = [dot(a, xi) + dot(b, eta) + more * c for a, b, c in zip(one, two, bent)]
    save(below(work, own.rest), 0, vec(*rest), vector(n))


def own_block(method: Any, system: Any, terms: Any, work: Any) -> None:
    """The rows of order zero in their places, the answers of the bodies to impulses, J^-1 G*, and
    the block of the joint itself.
    """
    rows, own, n = method.rows, system.rows, system.most
    first, second, _, _ = load(below(work, own.ends), 0, ENDS)
    alive = load(below(work, own.alive), 0, vector(n))
    here: list[Any] = []
    pushed: list[Any] = []
    for place, body in ((rows.first, first), (rows.second, second)):
        one, inverse = load(below(terms, place), 0, matrix(n, 6)), system.inverse_of(work, body)
        here, pushed = [*here, one], [*pushed, [times(inverse, row) for row in one]]
    for place, one in zip((own.first, own.second), here):
        save(below(work, place), 0, one, matrix(n, 6))
    save_pushed(system, work, pushed, here, vec(*[1.0 - x for x in alive]), n)


def multiplied(method: Any, system: Any, k: int, terms: Any, work: Any) -> None:
    """lam_k, and its pull on both bodies."""
    lam = load(below(work, system.rows.impulse), 0, vector(system.most))
    save(below(terms, method.rows.multiplier), k, lam, vector(system.most))
    save_wrench(system, work, lam)
