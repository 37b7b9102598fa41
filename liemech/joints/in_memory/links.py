"""Linkages in memory: a place there has a body and the joint of the same number, each value by its name.

Source: Leyendecker, Marsden and Ortiz, ZAMM 88 (2008), section 3 (rows G of conditions, their impulses -G* l).
"""

from __future__ import annotations

import itertools
from typing import Any, ClassVar

from ...formulas import Mat, Record, Vec, dot, mat, plain, record, vec, vectors, where
from ...formulas.classes.layouts import Layout, build, carried_layout, layout_of, matrix, vector
from ...formulas.classes.records import with_fields
from ...formulas.columns import named
from ...formulas.numbers.conversions import with_slopes
from ...groups.lie_group import LieGroup
from ...rooms.sites.block_elimination import Elimination
from ...rooms.sites.steps_together import StepsTogether
from ...systems.in_time.inputs import during, inputs
from ...systems.in_time.knots import jump_ahead
from ...systems.lie_poisson import BodyState
from ...systems.system import System

NUMBER, SIX, NOTHING = layout_of(0.0), vector(6), vector(0)
POSE, BLOCK = matrix(4, 4), matrix(6, 6)
PAIR = Layout("tuple", (SIX, SIX))
KIND = carried_layout(0)
ENDS, TOUCH, TIE = (carried_layout(x) for x in ((0, 0, 0.0, 0), (0, 0.0, 0, 0.0), (0, 0.0, 0.0, 0.0)))

REST6 = vec(*[0.0] * 6)

READY, BROKEN = 1.0, 2.0
"""Of `ready`: field, velocity and rows are those of the state; or of none, because a step was given up.  Zero
at the start of a run, when what is shown is the state itself.
"""


def work_of(system: LinkedBodies, full: bool) -> Layout:
    """The layout of what each place has beside what the method carries along.  full : are inertias matrices?"""
    return named(
        **constant_layouts(system, BLOCK if full else SIX),
        **STANDING,
        # at which the reduced equation is asked for
        state=carried_layout(BodyState(REST6, mat(*[vec(*[0.0] * 4)] * 4))),
        rate_on_cotangent=vector(12),  # the velocity there, (xi, f + F - G* lam)
        **motion_layouts(system),
        **load_layouts(system),
        equations=equations_of(system),
    )


def with_derivatives(system: LinkedBodies, level: float) -> LinkedBodies:
    """The system whose numbers carry a derivative, but for what does not change and for the blocks of elimination.

    level : of the derivative.
    """

    def moving(layout: Layout) -> Layout:
        if layout.kind != "record" or layout.detail[0] is not Record:
            return carried_layout(with_slopes(build(layout, itertools.repeat(0.0)), level))
        names, parts = layout.detail[1], layout.parts
        return named(**{name: part if name in RESTING else moving(part) for name, part in zip(names, parts)})

    fixed = constant_layouts(system, system.work.parts[0])
    parts = dict(zip(system.work.detail[1], system.work.parts))
    work = named(**{name: part if name in fixed or name in RESTING else moving(part) for name, part in parts.items()})
    return with_fields(system, level=level, work=work)


def constant_layouts(system: LinkedBodies, inertia: Layout) -> dict[str, Layout]:
    """Layouts of what does not change."""
    return dict(
        inertia=inertia,  # J of the body
        inverse=inertia,  # J^-1
        weight=NUMBER,
        counts=NUMBER,  # 1; 0 in places behind the bodies
        ends=ENDS,  # of the joint: first and second body, is there a second one, the kind
        alive=vector(system.most),  # which of its conditions count
        lightness=NUMBER if system.geared else NOTHING,  # 1/A of its rotor
        off_hubs=vector(2) if system.parts > 0 else NOTHING,  # are its bodies no hubs?
        first_joints=TOUCH,  # of the body a joint whose first one it is, and one whose second; with 1, or 0 if none is
        tie=TIE,  # of the joint another one that a body ties it to, the sides of both that it is on; and 1, or 0
        joint_parameters=Layout("tuple", system.kinds),  # of a joint of each kind: of another one, if need be
        acting=KIND if system.fields else NOTHING,  # the kind of what acts on the body
        force_parameters=Layout("tuple", system.fields),  # of one of each kind, likewise
    )


DEAD_POINT = -1.0
"""`reached` where conditions of joints depend on each other, and there are no multipliers."""

RESTING = {
    *("failed_joint", "reached", "ready", "sign_kept", "in_chart", "scale", "change_square", "value_square"),
    *("answer", "answer_at_end", "answers", "end_sides", "diagonal", "blocks"),
}
"""What carries no derivative: where steps stand, and the matrices of corrections."""

STANDING = dict(failed_joint=NUMBER, reached=NUMBER, ready=NUMBER)
"""Layouts of where steps stand, in the first place: why one has failed, after which part of it; may the next one begin?"""


def motion_layouts(system: LinkedBodies) -> dict[str, Layout]:
    """Layouts of forces, velocity and step of a body, and of the wrench, the given motion and the rotor of a joint."""
    count = system.most + system.freedoms
    return dict(
        force=SIX,  # field, weight, joints and springs
        further_pull=SIX,  # of joints beyond the first one of either side
        impulse=SIX,  # G* l of its joints
        velocity=SIX,
        unknown=Layout("tuple", (SIX, vector(system.most))),  # displacement x, and impulses l of the joint
        slope=Layout("tuple", (SIX, vector(system.most))),  # along which the solution grows
        free_correction=SIX,  # A^-1 r, of the mismatch r and its derivative A
        answer=BLOCK,  # A^-1 B to impulses at the start, by columns
        free_at_end=SIX,  # dtau_x A^-1 r; of stages xi, of series the change of momentum without multipliers
        answer_at_end=BLOCK,  # dtau_x A^-1 B
        end_pose=POSE,
        change_square=NUMBER,  # of a correction, by J
        value_square=NUMBER,  # of what it corrects
        scale=NUMBER,  # of what is rounding
        sign_kept=NUMBER,  # by the determinant of A
        in_chart=NUMBER,  # is the displacement?
        field=SIX,  # of the potential of all bodies; of multiple time steps all slow forces
        wrench=PAIR,  # the pull of the joint on both bodies
        paces=vector(count) if system.rheonomic else NOTHING,  # rates of the joint by its given motion
        rotor=vector(3) if system.geared else NOTHING,  # coordinate, rate, and the rate that other joints add
    )


def load_layouts(system: LinkedBodies) -> dict[str, Layout]:
    """Layouts of Newton's method for rates of joints and velocities of bodies under loads."""
    rates, square, body = vector(system.freedoms), matrix(system.freedoms, system.freedoms), system.pushed
    return dict(
        rate=rates,
        kick_foreseen=rates,  # at the next rates
        kick_before=rates,  # at the last ones
        kick_at_rest=rates,
        kick_on_line=rates,  # foreseen by the last correction
        kick_added=rates,  # by that
        load_slope=square,  # the derivative by rates
        newton_slope=square,  # that with which corrections were found
        slope_ratio=NUMBER if system.loaded else NOTHING,  # the derivative beside the inertia
        joint_kick=SIX if system.freedoms > 0 else NOTHING,  # of loads at joints, on the body
        load_velocity=SIX if body else NOTHING,  # at which loads on bodies are looked for
        load_kick=SIX if body else NOTHING,
        loaded_answer=BLOCK if body else NOTHING,  # (J - h F')^-1, by columns
        slope_of_all=BLOCK if system.pushes_all else NOTHING,  # of a load on all bodies, by columns
        body_slope_ratio=NUMBER if body else NOTHING,  # derivatives beside the inertia
        directions_thrown=NUMBER if body else NOTHING,  # thrown back
    )


def equations_of(system: LinkedBodies) -> Layout:
    """The layout of a joint's equations for impulses and rates.  Elimination needs a place for each node, and blocks behind."""
    count = system.most + system.freedoms
    sides, numbers = Layout("tuple", (matrix(count, 6),) * 2), vector(count)
    return named(
        sides=sides,  # G, of the first and the second body
        end_sides=sides,  # at the end of the step
        answers=sides,  # of both bodies to impulses, J^-1 G*
        residual=numbers,  # what conditions miss
        diagonal=numbers,
        solution=numbers,  # impulses of conditions, and changes of rates
        blocks=NOTHING,
    )


@record
class LinkedBodies(System):
    """Bodies on SE(3) held together by joints, as loops over memory need them.

    kinds : layouts of the kinds of joints.  fields : of what acts on bodies beside joints, if
    anything does; on_all : what acts on all of them by one formula, or None.  window : time and
    length of the step that tables see, if they jump.  clock : the time that joints in a given motion see; rheonomic : are
    there any?  geared : do rotors turn with joints?  work : `work_of` it.  most, freedoms : conditions of a joint, at
    most, and coordinates that loads act along.
    bodies, joints : how many.  parts : of the motion of a hub, each of which is a node of elimination behind those of
    joints.  sides : on which of the two sides of joints the body of a `tie` is, of the one and of the other joint, where
    it is the same for all of them; else -1.
    further_sides : how many sides of joints there are beside `first_joints`; of each the body, the joint, the side.
    borders : joints at hubs, with the blocks.  couplings : pairs of joints that a body ties together, beside `tie`, with
    the sides on which it is, and the block.  order : of elimination.  pulled : do potentials of bodies count among the
    forces?
    meshes : do joints share rotors?  mesh : how many pairs of such joints; of each both, and the block; meshing : the rate
    that the one gains by an impulse of the other.  near : with how many others a joint has a body in common, at most.
    one_body : the equation of one of the bodies.  level : of the derivative that numbers carry along; None for none.
    varied : are what does not change and what acts differentiated by on the way back?
    """

    jointed: ClassVar[bool] = True
    runs_in: ClassVar[str] = "joints.in_memory.plan:LinksOfPlan"

    group: LieGroup
    kinds: tuple[Any, ...]
    fields: tuple[Any, ...]
    on_all: Any
    window: tuple[Any, ...]
    clock: tuple[Any, ...]
    rheonomic: bool
    geared: bool
    work: Layout
    most: int
    freedoms: int
    springs: bool
    pushed: bool
    pulled: bool
    bodies: float
    joints: float
    parts: int
    sides: tuple[int, int]
    further_sides: Any
    borders: Any
    couplings: Any
    order: Elimination
    meshes: bool
    mesh: Any
    meshing: Any
    near: float
    one_body: Any = None
    level: float | None = None
    varied: bool = False

    @property
    def loaded(self) -> bool:
        """Are there loads, which depend on velocities, or rotors, which follow them?"""
        return self.pushed or self.freedoms > 0 or self.geared

    @property
    def pulls_all(self) -> bool:
        """Is there a potential of all bodies by one formula?"""
        return self.on_all is not None and self.on_all.potential is not None

    @property
    def pushes_all(self) -> bool:
        """Is there a load on all bodies by one formula?"""
        return self.on_all is not None and self.on_all.load is not None

    def displaced(self, retraction: Any, state: BodyState, omega: Vec) -> BodyState:
        mu = retraction.tau_Ad_star(self.group, omega, state.mu)
        return BodyState(mu, retraction.compose_tau(self.group, state.g, omega))

    def of_kind(self, work: Any, formula: Any) -> Any:
        """A formula of the joint, as a record of its kind."""

        def now(joint: Any) -> Any:
            return formula(joint.at_time(*self.clock) if self.rheonomic else joint)

        return self.chosen(work.joint_parameters, len(self.kinds), work.ends.load()[3], now)

    def on_body(self, work: Any, formula: Any) -> Any:
        """A formula of what acts on the body, as a record of its kind."""
        return self.chosen(work.force_parameters, len(self.fields), work.acting.load(), formula)

    def chosen(self, records: Any, count: int, which: int, formula: Any, k: int = 0) -> Any:
        """A formula of one of several records."""
        record = self.seen(records.nth(k).load())
        if k == count - 1 or which == k:
            return formula(record)
        return self.chosen(records, count, which, formula, k + 1)

    def next_jump(self, work: Any, t: float, end: float, ending: Any) -> float:
        """The first jump of an input after t on the way to `end`."""
        to = jump_ahead(ending.breaks, 0, int(ending.count), t, end)
        if self.on_all is not None:
            to = first_jump(self.on_all, t, to, ending.every)
        for j in range(int(self.joints)):
            to = jump_at(work.joint_parameters, len(self.kinds), j, work.ends.at(j)[3], t, to, ending.every)
        if len(self.fields) > 0:
            for b in range(int(self.bodies)):
                to = jump_at(work.force_parameters, len(self.fields), b, work.acting.at(b), t, to, ending.every)
        return to

    def at_place(self, sites: Any, memory: Any) -> Any:
        """The equation of one body."""
        return with_fields(self.one_body, links=self, sites=sites, memory=memory)

    def at_time(self, t: float) -> Any:
        """The bodies and joints at time t."""
        return with_fields(self, clock=(t,)) if self.rheonomic else self

    def seen(self, value: Any) -> Any:
        """A value, with tables as the step sees them."""
        return during(value, *self.window) if len(self.window) > 0 else value


def jump_at(records: Any, count: int, i: int, which: int, t: float, to: float, every: bool) -> float:
    """The first jump among inputs of what acts in one place, of one of so many kinds."""
    for k in range(count):
        if which == k:
            to = first_jump(records.nth(k).at(i), t, to, every)
    return to


def first_jump(value: Any, t: float, to: float, every: bool) -> float:
    """The first jump of the tables of a value after t, up to `to`."""
    for table in inputs(value):
        to = table.jump_ahead(t, to, every)
    return to


@record
class LinkMemory(Record):
    """Numbers that steps carry along for the body and the joint of one place: the state, for every
    substep the last `PASTS` displacements and impulses, and the state that is shown, whose momentum is
    on the constraint, if it is another one.
    """

    state: Any
    pasts: tuple[Any, ...]
    shown: Any = ()


@record
class StepsOfLinks(StepsTogether):
    """A method of many bodies and joints."""

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        """The state, which is all that steps carry along."""
        return LinkMemory(state, ())

    def observe(self, memory: LinkMemory) -> Any:
        """The state that steps carry along."""
        return memory.state


# ------------------------------------------------------------------ what formulas ask of a place


def both(column: Any, work: Any) -> tuple[Any, Any]:
    """The values of the two bodies of a joint; in the place of the ground that of some body."""
    first, second, _, _ = work.ends.load()
    return column.at(first), column.at(second)


def pose_in(value: Any) -> Mat:
    """The pose in what lies in memory."""
    return plain(value.g) if isinstance(value, BodyState) else value


def poses_of(column: Any, work: Any) -> tuple[Mat, Mat]:
    """The poses of a joint's bodies, of which the second may be the ground."""
    has_second = work.ends.load()[2]
    g, k = (pose_in(value) for value in both(column, work))
    other = [vec(*[where(has_second > 0.0, k[i, j], 1.0 if i == j else 0.0) for j in range(4)]) for i in range(4)]
    return g, mat(*other)


def pull_on(work: Any) -> Vec:
    """The pull of joints on a body: of its first joint on either side, and of all others together."""
    first, has_first, second, has_second = work.first_joints.load()
    by_first, by_second = work.wrench.nth(0).at(first), work.wrench.nth(1).at(second)
    return (has_first * by_first + has_second * by_second) + work.further_pull.load()


def speeds(sides: Any, velocities: Any) -> list[Any]:
    """G xi, of rows G on both sides of a joint and the velocities of its bodies."""
    return [dot(a, velocities[0]) + dot(b, velocities[1]) for a, b in zip(*sides)]


def wrenches(l: Any, sides: Any) -> tuple[Vec, Vec]:
    """G* l, on the first and on the second body."""
    on_first, on_second = [vectors.sum([a * row for a, row in zip(l, side)]) for side in sides]
    return on_first, on_second


def answered(columns: Mat, push: Vec) -> Vec:
    """A matrix, given by its columns, times a vector."""
    return vectors.sum([push[i] * columns[i] for i in range(6)])
