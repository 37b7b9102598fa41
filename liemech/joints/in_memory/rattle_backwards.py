"""The way back through a step of LieRATTLE of any number of bodies and joints.

Of a function of the end of a step, with the derivatives w by the momenta shown there and eta by the poses, with impulses l
and l', and K x the displacement that A^-1 B leads to at the end of the step (`rattle_of_links.py`),

    V = w - J^-1 G'* nu,   (G' J^-1 G'*) nu = G' w                        what is shown,
    u = d/dm <V, Ad*_tau(x) m> + K* eta' + K_0* d/dx <V, Ad*_tau(x) m>    the step of a free body,
    z = u - K* G'* kappa,  (G K* G'*) kappa = G u                         what joints hold of it,

where eta' has what forces and rows at the end of the step add, with V, l' and nu held.  The derivative by the momentum is z,
and that by the pose has what forces and rows there add, with z and l held.

Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., section 15.2 (implicit functions, by their adjoint
equation); Leyendecker, Marsden and Ortiz, ZAMM 88 (2008), section 3.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.sites.planes import columns, each, load, save
from ...formulas import Record, Vec, dot, mat, plain, record, vec
from ...formulas.classes.layouts import Layout
from ...formulas.numbers.conversions import fitted
from ...formulas.numbers.transposes import pulled_back
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from .elimination import assembled, factored, pulled_by_solution, save_answers, scattered, solved
from .links import REST6, both, poses_of, pull_on, speeds, wrenches
from .multipliers import moved_along
from .multipliers_backwards import (
    by_entries,
    led_back,
    numbers_of,
    of_kind,
    power_on_body,
    rates_of_cotangent,
    records_of,
    shifted,
    varied,
)
from .rattle_of_links import (
    RattleOfLinks,
    correction_of_body,
    field,
    held_by_unknown,
    pushed_momentum,
    wrench_of_unknown,
)


@record
class RattleOnTheWayBack(Record):
    """A step of LieRATTLE as a part of a step that has a way back, of all bodies together.

    memory : the layout of what the method carries along for a body.
    """

    together: ClassVar[bool] = True
    joins: ClassVar[bool] = False

    method: RattleOfLinks
    memory: Layout

    def move(self, system: Any, part: Any, states: Any, n: int, layout: Layout, beside: Any) -> None:
        """The states after a step, behind those before it.  n : their number.  layout : of one."""
        places = columns(beside, copies=(self.memory, self.memory), work=system.work)
        each(states, begun, self.method, system, part.h, states, n, layout, places.copies.nth(0))
        self.step(system, part, beside, places)
        each(states, ended, places.copies.nth(1).fields.shown, states, n + 1, layout)

    def step(self, system: Any, part: Any, beside: Any, places: Any) -> None:
        """A step that knows of none before it."""
        places.work.fields.ready.put(0, 0.0)
        self.method.step_together(system, part.t, part.h, beside, 0, 1, self.memory)
        self.method.settle(system, part.t + part.h, beside, 1, self.memory)

    def go_back(
        self, system: Any, part: Any, states: Any, n: int, layout: Layout, beside: Any, felt: Any, of_felt: Layout
    ) -> None:  # fmt: skip
        """The derivatives by the states before a step from those by the states after it."""
        places, h = columns(beside, copies=(self.memory, self.memory), work=system.work), part.h
        work, equations = places.work.fields, places.work.fields.equations.heads(system.most)
        old, new = [places.copies.nth(k).fields.state for k in (0, 1)]
        each(states, begun, self.method, system, h, states, n, layout, places.copies.nth(0))
        self.step(system, part, beside, places)
        each(states, felt_at_end, felt, of_felt, work, equations)
        each(beside, rates_of_cotangent, work, equations)
        pulled_by_solution(system, beside, work, equations)
        if system.varied:
            each(beside, felt_by_inverse, work)
        each(beside, led_back, work)
        each(beside, felt_by_end, system, 0.5 * h, new, work, equations)
        scattered(system, work)
        each(beside, felt_by_body, system, 0.5 * h, new, work)
        field(system, part.t, 0.0, beside, old, old, work)
        each(beside, wrench_of_unknown, work, equations)
        scattered(system, work)
        each(beside, held_by_unknown, work)
        each(beside, correction_of_body, system, self.method.retraction, h, old, work)
        each(beside, freely_back, system, self.method.retraction, h, old, work)
        each(beside, answers_back, system, h, work, equations)
        assembled(system, beside, equations.sides, 1.0 if h > 0.0 else -1.0, h, work, equations)
        factored(system, h, equations)
        solved(system, equations)
        each(beside, wrench_at_end, work, equations)
        scattered(system, work)
        each(beside, held_back, system, self.method.retraction, h, work)
        each(beside, felt_by_start, system, 0.5 * h, old, work, equations)
        scattered(system, work)
        each(beside, felt_by_body, system, 0.5 * h, old, work)
        each(states, felt_at_start, felt, of_felt, work)


# ------------------------------------------------------------------ between memories


def begun(method: Any, system: Any, h: float, states: Any, n: int, layout: Layout, memory: Any) -> None:
    """Let the method begin at a state."""
    memory.save(method.start(system, load(states, n, layout), h))


def ended(shown: Any, states: Any, n: int, layout: Layout) -> None:
    """The state that is shown behind a step."""
    save(states, n, fitted(shown.load(), layout), layout)


def felt_at_end(felt: Any, layout: Layout, work: Any, equations: Any) -> None:
    """The impulses and the velocity that are shown; w as velocity, and eta."""
    w = load(felt, 0, layout)
    work.acceleration.save(work.velocity.load() - times(work.inverse.load(), pull_on(work)))
    work.multipliers.save(equations.solution.load())
    work.velocity.save(w.mu)
    work.felt_by_velocity.save(w.g)


def felt_at_start(felt: Any, layout: Layout, work: Any) -> None:
    """The derivatives by the state before a step."""
    save(felt, 0, fitted(BodyState(work.covelocity.load(), work.felt_by_velocity.load()), layout), layout)


# ------------------------------------------------------------------ formulas of one joint


def felt_by_end(system: Any, h: float, new: Any, work: Any, equations: Any) -> None:
    """The derivatives by both poses of what a joint adds at the end of a step, with V, l' and nu held."""
    held = [both(column, work) for column in (work.covelocity, work.acceleration)]
    save_felt(system, h, new, [work.multipliers.load(), equations.solution.load()], held, work)


def felt_by_start(system: Any, h: float, old: Any, work: Any, equations: Any) -> None:
    """The derivatives by both poses of what a joint adds at the start of a step, with z and l held."""
    impulses, held = [work.unknown.nth(1).load()], [both(work.covelocity, work)]
    save_felt(system, h, old, impulses, held, work, equations.solution.load())


def save_felt(
    system: Any, h: float, state: Any, impulses: list[Vec], velocities: list[Any], work: Any, kappa: Any = None
) -> None:  # fmt: skip
    """The derivatives of h <V, F> - <l, G V> - ... - <kappa, c> by both poses, the condition c at the end of the step.
    h : half the step.  velocities : V of both bodies first.
    """
    (g, k), has_second, now = (
        poses_of(state, work),
        work.ends.load()[2],
        records_of(work.joint_parameters, system.kinds),
    )
    held, kind = [(a, has_second * b) for a, b in velocities], work.ends.load()[3]

    def added(x: Any) -> float:
        joints = varied(now, system.kinds, x[2:])
        value = of_kind(joints, kind, lambda joint: of_joint(joint, system, h, impulses, held, *shifted(x, g, k)))
        if system.varied and kappa is not None:
            ends = poses_of(work.end_pose, work)
            c = of_kind(joints, kind, lambda joint: joint.value(*ends, system.most))
            value = value - dot(kappa, vec(*c))
        return value

    numbers = numbers_of(now, system.kinds) if system.varied else []
    felt, _ = pulled_back(added, None, (), (REST6, REST6, *numbers), 1.0)
    work.wrench.save((felt[0], has_second * felt[1]))
    if system.varied:
        for k, by in enumerate(felt[2:]):
            work.by_joints.nth(k).save(work.by_joints.nth(k).load() + by)


def of_joint(joint: Any, system: Any, h: float, impulses: list[Vec], velocities: list[Any], g: Any, k: Any) -> float:
    """h <V, F> of springs less the sum of <l, G V>."""
    rows, value = joint.rows(g, k, system.most, 0), 0.0
    for l, V in zip(impulses, velocities):
        value = value - dot(l, vec(*speeds(rows, V)))
    if system.springs:
        value = value + h * dot(joint.springs_push(g, k), vec(*velocities[0][0], *velocities[0][1]))
    return value


def answers_back(system: Any, h: float, work: Any, equations: Any) -> None:
    """The answers K* G'* to impulses, the rows G' at the end of a step, and G u."""
    g, k = poses_of(work.end_pose, work)
    has_second, alive, sides = work.ends.load()[2], work.alive.load(), equations.sides.load()
    first, second = system.of_kind(work, lambda it: it.rows(g, k, system.most, 0))
    rows = [a * row for a, row in zip(alive, first)], [(a * has_second) * row for a, row in zip(alive, second)]
    moved = both(work.answer_at_end, work)
    joint_answers = [[led(K, row) for row in side] for K, side in zip(moved, rows)]
    sign = 1.0 if h > 0.0 else -1.0
    equations.residual.save(vec(*speeds(sides, both(work.velocity, work))))
    save_answers(system, sides, joint_answers, sign, h, work, equations)
    equations.end_sides.save((mat(*rows[0]), mat(*rows[1])))


def wrench_at_end(work: Any, equations: Any) -> None:
    """G'* kappa, of the impulses that elimination has found."""
    work.wrench.save(wrenches(equations.solution.load(), equations.end_sides.load()))


# ------------------------------------------------------------------ formulas of one body


def led(columns_of_matrix: Any, covector: Vec) -> Vec:
    """The transpose of a matrix, given by its columns, times a covector."""
    return vec(*[dot(column, covector) for column in columns_of_matrix])


def felt_by_body(system: Any, h: float, state: Any, work: Any) -> None:
    """The derivative by the pose of a body, with what its joints and the forces on it add."""
    g, V, weight = plain(state.load().g), work.covelocity.load(), work.weight.load()
    now = records_of(work.force_parameters, system.fields)
    kind = work.acting.load() if len(now) > 0 else 0

    def added(x: Any) -> float:
        acting = varied(now, system.fields, x[2:])
        return h * power_on_body(system, 0.0, acting, kind, x[1], V, moved_along(g, x[0], 1.0), V)

    numbers = numbers_of(now, system.fields) if system.varied else []
    felt, _ = pulled_back(added, None, (), (REST6, weight, *numbers), 1.0)
    work.felt_by_velocity.save(work.felt_by_velocity.load() + (felt[0] + pull_on(work)))
    if system.varied:
        work.by_weight.save(work.by_weight.load() + felt[1])
        for k, by in enumerate(felt[2:]):
            work.by_forces.nth(k).save(work.by_forces.nth(k).load() + by)


def felt_by_inverse(work: Any) -> None:
    """The derivative by the inverse inertia of a body, -<G'* nu, J^-1 mu>."""
    mu = times(work.inertia.load(), work.acceleration.load())
    work.by_inverse.save(work.by_inverse.load() + by_entries(work.inverse.load(), (-pull_on(work), mu)))


def freely_back(system: Any, retraction: Any, h: float, old: Any, work: Any) -> None:
    """u, in the place of the velocity."""
    x, m = work.unknown.nth(0).load(), pushed_momentum(plain(old.load().mu), h, work)
    V, eta = work.covelocity.load(), work.felt_by_velocity.load()

    def paired(y: Any) -> float:
        return dot(V, retraction.tau_Ad_star(system.group, y[0], y[1]))

    (by_x, by_m), _ = pulled_back(paired, None, (), (x, m), 1.0)
    work.acceleration.save(by_m)
    work.velocity.save(by_m + (led(work.answer_at_end.load(), eta) + led(work.answer.load(), by_x)))


def held_back(system: Any, retraction: Any, h: float, work: Any) -> None:
    """z in the place of V, and the derivative by the pose of how far the body comes."""
    pull, x, group = pull_on(work), work.unknown.nth(0).load(), system.group
    z = work.velocity.load() - led(work.answer_at_end.load(), pull)
    work.covelocity.save(z)
    if system.varied:
        q = retraction.dtau_inv(group, -x, work.acceleration.load() - z)
        work.by_inertia.save(work.by_inertia.load() + by_entries(work.inertia.load(), (q, (1.0 / h) * x)))
    work.felt_by_velocity.save(retraction.tau_Ad_star(group, -x, work.felt_by_velocity.load() - pull))
