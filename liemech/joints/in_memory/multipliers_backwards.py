"""The way back through multipliers: J^T w by a second elimination with the blocks of the first one.

With G A + d/ds G(g exp(s xi)) xi = 0 of the acceleration A = J^-1 (ad*_xi mu + p - G* lam), p = f + F, a function
<u, xi> + <w, p - G* lam> of the velocity on T*SE(3) has the derivatives of

    <u, xi> + <V, p> + <V - w, ad*_xi mu> - <lam, G V> - <nu, d/ds G(g exp(s xi)) (xi + s A)>,
    V = w - J^-1 G* nu,   (G J^-1 G*) nu = G w,

with lam, nu, V and A held: V is w without what leads off the conditions.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 15.2 (implicit functions, by their adjoint
equation).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compiler.sites.planes import columns, each
from ...formulas import Vec, derivative, dot, mat, plain, vec, vectors
from ...formulas.classes.layouts import Layout, floats_in, vector, with_floats
from ...formulas.classes.records import with_fields
from ...formulas.columns import named
from ...formulas.numbers.transposes import pulled_back
from ...rooms.sites.steps_together import copied
from ...systems.kinetic_energy import times
from .elimination import pulled_by_solution, scattered
from .links import NUMBER, PAIR, REST6, SIX, LinkedBodies, both, poses_of, pull_on, speeds
from .multipliers import find_multipliers, moved_along, rated, work_in


def with_way_back(system: LinkedBodies, varied: bool) -> LinkedBodies:
    """The system with room for what is felt on the way back.  varied : by its numbers too?"""
    columns = dict(zip(system.work.detail[1], system.work.parts))
    equations = columns.pop("equations")  # behind which blocks lie
    columns |= dict(
        asked=Layout("tuple", (columns["state"], vector(12), NUMBER)),  # (u, w), and 1 on the way back
        felt=vector(12),
        multipliers=vector(system.most),
        acceleration=SIX,
        covelocity=SIX,  # V
        felt_by_velocities=PAIR,  # of the bodies of a joint
        felt_by_poses=PAIR,
        felt_by_velocity=SIX,  # of a body
    )
    if varied:
        columns |= dict(
            by_inertia=columns["inertia"],
            by_inverse=columns["inverse"],
            by_weight=NUMBER,
            by_joints=Layout("tuple", tuple([vector(kind.kinds.count("number")) for kind in system.kinds])),
            by_forces=Layout("tuple", tuple([vector(kind.kinds.count("number")) for kind in system.fields])),
        )
    return with_fields(system, varied=varied, work=named(**columns, equations=equations))


def felt_by_numbers(system: LinkedBodies, planes: Any, fixed: np.ndarray) -> np.ndarray:
    """The derivatives by the numbers of a linkage that do not change, (rows, places), which the way back has left."""
    of, felt = columns(planes, work=system.work).work.fields, np.zeros(fixed.shape)
    by_bodies = (of.inertia, of.by_inertia), (of.inverse, of.by_inverse), (of.weight, of.by_weight)
    pairs = [(*pair, system.bodies) for pair in by_bodies]
    pairs += [(of.joint_parameters.nth(k), of.by_joints.nth(k), system.joints) for k in range(len(system.kinds))]
    pairs += [(of.force_parameters.nth(k), of.by_forces.nth(k), system.bodies) for k in range(len(system.fields))]
    for column, by_column, count in pairs:
        rows = [row for row, kind in zip(column.rows, column.layout.kinds) if kind == "number"]
        felt[rows, : int(count)] = planes.array[by_column.rows, : int(count)]
    return felt


def both_ways(system: Any, t: float, sites: Any, memory: Layout) -> None:
    """The velocities of all bodies on T*SE(3), as `multipliers`; on the way back the derivatives by the states of a function
    of them.  Native code has what they share once.
    """
    work = work_in(sites, memory, system)
    find_multipliers(system, t, sites, work.asked.nth(0), work)
    if work.asked.nth(2).at(0) > 0.0:
        multipliers_back(system, t, sites, work.asked.nth(0), work, work.equations.heads(system.most))
    else:
        each(sites, rated, system, work)
        each(sites, copied, work.rate_on_cotangent, work.felt)


def multipliers_back(system: Any, t: float, sites: Any, state: Any, work: Any, equations: Any) -> None:
    """The derivatives by the states of all bodies of a function of their velocities on T*SE(3)."""
    each(sites, kept, work, equations)
    each(sites, rates_of_cotangent, work, equations)
    pulled_by_solution(system, sites, work, equations)
    each(sites, led_back, work)
    each(sites, felt_by_joint, system, t, state, work, equations)
    each(sites, copied, work.felt_by_velocities, work.wrench)
    scattered(system, work)
    each(sites, summed_velocities, work)
    each(sites, copied, work.felt_by_poses, work.wrench)
    scattered(system, work)
    each(sites, felt_by_body, system, t, state, work)


# ------------------------------------------------------------------ formulas of one joint


def kept(work: Any, equations: Any) -> None:
    """The multipliers of a joint, the acceleration of a body, and w as velocity."""
    work.acceleration.save(work.velocity.load() - times(work.inverse.load(), pull_on(work)))
    work.multipliers.save(equations.solution.load())
    work.velocity.save(work.asked.nth(1).load()[6:])


def rates_of_cotangent(work: Any, equations: Any) -> None:
    """G w, in the place of what conditions miss."""
    equations.residual.save(vec(*speeds(equations.sides.load(), both(work.velocity, work))))


def felt_by_joint(system: Any, t: float, state: Any, work: Any, equations: Any) -> None:
    """The derivatives of what a joint adds, by the velocities and by the poses of both bodies."""
    (g, k), (xi, eta), has_second = poses_of(state, work), both(work.free_at_end, work), work.ends.load()[2]
    held = [both(column, work) for column in (work.acceleration, work.covelocity)]
    held = [(a, has_second * b) for a, b in held]
    lam, nu = work.multipliers.load(), equations.solution.load()

    kind, now = work.ends.load()[3], records_of(work.joint_parameters, system.kinds)

    def added(x: Any) -> float:
        return of_kind(
            varied(now, system.kinds, x[4:]), kind,
            lambda joint: of_joint(joint, system, t, lam, nu, held, *shifted(x, g, k), *x[2:4]),
        )  # fmt: skip

    numbers = numbers_of(now, system.kinds) if system.varied else []
    felt, _ = pulled_back(added, None, (), (REST6, REST6, xi, has_second * eta, *numbers), 1.0)
    work.felt_by_velocities.save((felt[2], has_second * felt[3]))
    work.felt_by_poses.save((felt[0], has_second * felt[1]))
    if system.varied:
        for k, by in enumerate(felt[4:]):
            work.by_joints.nth(k).save(work.by_joints.nth(k).load() + by)


def by_entries(inverse: Any, *pairs: tuple[Vec, Vec]) -> Any:
    """The derivative of the sum of <a, J^-1 b> by the moments or the matrix J^-1."""
    if isinstance(inverse, vectors.Mat):
        return mat(*[vec(*[vectors.sum([a[i] * b[j] for a, b in pairs]) for j in range(6)]) for i in range(6)])
    return vec(*[vectors.sum([a[i] * b[i] for a, b in pairs]) for i in range(6)])


def shifted(x: Any, g: Any, k: Any) -> tuple[Any, Any]:
    """Two poses, displaced by the first two of several vectors, which are zero: what depends on these has the derivatives by
    the poses.
    """
    return moved_along(g, x[0], 1.0), moved_along(k, x[1], 1.0)


def records_of(column: Any, kinds: tuple[Layout, ...]) -> list[Any]:
    """The records of all kinds at a place."""
    return [column.nth(k).load() for k in range(len(kinds))]


def numbers_of(records: list[Any], kinds: tuple[Layout, ...]) -> list[Vec]:
    """The numbers of records by which is differentiated."""
    return [floats_in(record, kind) for record, kind in zip(records, kinds)]


def varied(records: list[Any], kinds: tuple[Layout, ...], numbers: Any) -> list[Any]:
    """Records with these numbers; as they are if none are given."""
    if len(numbers) == 0:
        return records
    return [with_floats(record, kind, x) for record, kind, x in zip(records, kinds, numbers)]


def of_kind(records: list[Any], which: int, formula: Any, k: int = 0) -> Any:
    """A formula of one of several records."""
    if k == len(records) - 1 or which == k:
        return formula(records[k])
    return of_kind(records, which, formula, k + 1)


def of_joint(
    joint: Any, system: Any, t: float, lam: Vec, nu: Vec, held: Any, g: Any, k: Any, xi: Vec, eta: Vec
) -> float:  # fmt: skip
    """<V, F> - <lam, G V> - <nu, d/ds G(g exp(s xi)) (xi + s A)>, of the forces F at a joint and its conditions."""
    (A, V), m, n = held, system.most, system.freedoms

    def held_rate(s: float) -> float:
        rows = joint.rows(moved_along(g, xi, s), moved_along(k, eta, s), m, 0)
        return dot(nu, vec(*speeds(rows, (xi + s * A[0], eta + s * A[1]))))

    rows = joint.rows(g, k, m, n)
    by_rows = speeds(rows, V)
    value = -(dot(lam, vec(*by_rows[:m])) + derivative(held_rate, 0.0))
    if system.springs:
        value = value + dot(joint.springs_push(g, k), vec(*V[0], *V[1]))
    if n > 0:
        rates = vec(*speeds(rows, (xi, eta))[m:])
        value = value + dot(joint.efforts(t, joint.seen(t, g, k), rates, n), vec(*by_rows[m:]))
    return value


# ------------------------------------------------------------------ formulas of one body


def led_back(work: Any) -> None:
    """V = w - J^-1 G* nu, which joints allow."""
    work.covelocity.save(work.velocity.load() - times(work.inverse.load(), pull_on(work)))


def summed_velocities(work: Any) -> None:
    """The derivative by the velocity of a body of what its joints add."""
    work.felt_by_velocity.save(pull_on(work))


def felt_by_body(system: Any, t: float, state: Any, work: Any) -> None:
    """The derivatives by momentum and pose of a body."""
    begin, uw, V = state.load(), work.asked.nth(1).load(), work.covelocity.load()
    mu, q, xi = plain(begin.mu), V - uw[6:], work.free_at_end.load()
    weight, inverse, now = work.weight.load(), work.inverse.load(), records_of(work.force_parameters, system.fields)

    kind, g = work.acting.load() if len(system.fields) > 0 else 0, plain(begin.g)

    def added(x: Any) -> float:
        return power_on_body(
            system, t, varied(now, system.fields, x[2:]), kind, weight, V, moved_along(g, x[0], 1.0), x[1]
        )

    numbers = numbers_of(now, system.fields) if system.varied else []
    felt, _ = pulled_back(added, None, (), (REST6, xi, *numbers), 1.0)
    by_velocity = uw[:6] + work.felt_by_velocity.load() + felt[1] - system.group.ad_star(q, mu)
    by_mu = times(inverse, by_velocity) + system.group.ad(xi, q)
    if system.varied:
        J = work.inertia.load()
        pairs = (by_velocity, mu), (times(J, q), times(J, work.acceleration.load()))
        work.by_inverse.save(work.by_inverse.load() + by_entries(inverse, *pairs))
        work.by_weight.save(work.by_weight.load() - dot(g[2][:3], V[3:]))
        for k, by in enumerate(felt[2:]):
            work.by_forces.nth(k).save(work.by_forces.nth(k).load() + by)
    work.felt.save(vec(*by_mu, *(felt[0] + pull_on(work))))


def power_on_body(
    system: Any, t: float, acting: list[Any], kind: int, weight: float, V: Vec, g: Any, xi: Vec
) -> float:  # fmt: skip
    """<V, p> of the weight of a body and what acts on it alone."""
    value = -weight * dot(g[2][:3], V[3:])
    if len(acting) > 0 and system.pulled:
        value = value + of_kind(acting, kind, lambda it: dot(V, it.pull(g)))
    if len(acting) > 0 and system.pushed:
        value = value + of_kind(acting, kind, lambda it: dot(V, it.push(t, xi, g)))
    return value
