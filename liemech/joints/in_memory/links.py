"""Linkages in memory: a place there has a body and the joint of the same number, each value by its name.

Source: Leyendecker, Marsden and Ortiz, ZAMM 88 (2008), section 3 (rows G of conditions, their impulses -G* l).
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...formulas import Mat, Record, Vec, dot, mat, plain, record, vec, vectors, where
from ...formulas.classes.layouts import Layout, carried_layout, layout_of, matrix, vector
from ...formulas.classes.records import with_fields
from ...formulas.columns import named
from ...groups.lie_group import LieGroup
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

BLOCKS = 3
"""Blocks of a place: that of its joint, and two of the tie to another one."""


def work_of(
    full: bool, most: int, freedoms: int, own: tuple[Layout, ...], on: tuple[Layout, ...], pushed: bool,
    bent: bool, moving: bool, hubs: bool, geared: bool,
) -> Layout:  # fmt: skip
    """The layout of what each place has beside what the method carries along; of no width is what a linkage does not need.

    full : are inertias matrices?  most, freedoms : conditions of a joint, and coordinates that loads act along.  own,
    on : the kinds of joints, and of what acts on a body.  pushed, bent : are there loads on bodies; one on all of them
    by one formula?  moving : are joints in a given motion?
    """
    n, loaded = most + freedoms, pushed or geared or freedoms > 0
    inertia, rows, rates, square = BLOCK if full else SIX, matrix(n, 6), vector(freedoms), matrix(freedoms, freedoms)
    sides = Layout("tuple", (rows, rows))
    return named(
        # what does not change
        inertia=inertia,  # J of the body
        inverse=inertia,  # J^-1
        weight=NUMBER,
        ends=ENDS,  # of the joint: first and second body, is there a second one, the kind
        alive=vector(most),  # which of its conditions count
        yields=NUMBER if geared else NOTHING,  # 1/A of its rotor
        beside=vector(2) if hubs else NOTHING,  # are its bodies no hubs?
        touch=TOUCH,  # of the body a joint whose first one it is, and one whose second; with 1, or 0 if there is none
        tie=TIE,  # of the joint another one that a body ties it to, the sides of both that it is on; and 1, or 0
        own=Layout("tuple", own),  # the parameters of a joint of each kind: of another one that has it, if need be
        acting=KIND if on else NOTHING,  # the kind of what acts on the body
        on=Layout("tuple", on),  # its parameters, likewise
        # where steps stand, in the first place: why one has failed, and whether the next one may begin
        at_joint=NUMBER,
        reached=NUMBER,  # the part of the step
        ready=NUMBER,
        # of the body
        force=SIX,  # field, weight, joints and springs
        pull=SIX,  # of joints beyond the first one of either side
        held=SIX,  # the sum of impulses
        velocity=SIX,
        unknown=Layout("tuple", (SIX, vector(most))),  # displacement x, and impulses l of the joint
        slope=Layout("tuple", (SIX, vector(most))),  # along which the solution grows
        free=SIX,  # A^-1 r, of the mismatch r and its derivative A
        answer=BLOCK,  # A^-1 B to impulses at the start, by columns
        led=SIX,  # both at the end of the step: dtau_x A^-1 r
        moved=BLOCK,  # and dtau_x A^-1 B
        pose=POSE,  # there
        length=NUMBER,  # of the correction, squared by J
        whole=NUMBER,  # of the displacement
        size=NUMBER,  # of what is rounding
        upright=NUMBER,  # has the determinant of A kept its sign?
        inside=NUMBER,  # is the displacement inside of the chart?
        field=SIX,  # of the potential of all bodies; of multiple time steps all slow forces
        # of the joint
        wrench=PAIR,  # its pull on both bodies
        paces=vector(n) if moving else NOTHING,  # rates by its given motion
        dial=vector(3) if geared else NOTHING,  # coordinate and rate of its rotor, and what others drive
        # loads: of the joint rates, torques and slopes of Newton's method
        rate=rates,
        foreseen=rates,  # the kick at the next rates
        before=rates,  # at the last ones
        idle=rates,  # at rest
        drawn=rates,  # foreseen, of the last correction
        ahead=rates,  # what that has added
        slant=square,  # the derivative by rates
        gain=square,  # that with which corrections were found
        reach=NUMBER if loaded else NOTHING,  # the derivative beside the inertia
        # loads: of the body
        wanted=SIX if pushed else NOTHING,  # the velocity at which they are looked for
        push=SIX if pushed else NOTHING,  # their kick
        given=BLOCK if pushed else NOTHING,  # the answer to momentum under them, by columns
        bent=BLOCK if bent else NOTHING,  # the derivative of a load on all bodies, by columns
        strength=NUMBER if pushed else NOTHING,  # the derivatives beside the inertia
        thrown=NUMBER if pushed else NOTHING,  # directions that are thrown back
        # the equations of impulses, and of rates; elimination needs a place for each node, and the blocks of all behind
        equations=named(
            sides=sides,  # G, of the first and the second body
            there=sides,  # at the end of the step
            answers=sides,  # of both bodies to impulses, J^-1 G*
            rest=vector(n),  # what conditions miss
            diagonal=vector(n),
            impulse=vector(n),
            blocks=NOTHING,
        ),
    )


@record
class Links(System):
    """Bodies on SE(3) held together by joints, as loops over memory need them.

    kinds : layouts of the kinds of joints.  fields : of what acts on bodies beside joints, if
    anything does; on_all : what acts on all of them by one formula, or None.  window : time and
    length of the step that tables see, if they jump.  clock : the time that joints in a given motion see; rheonomic : are
    there any?  geared : do rotors turn with joints?  work : `work_of` it.  most, freedoms : conditions of a joint, at
    most, and coordinates that loads act along.
    bodies, joints, nodes : how many; of nodes, that are eliminated, each joint is one, and behind them each
    of the `parts` of the motion of a hub.  sides : on which of the two sides of joints the body of a `tie` is,
    of the one and of the other joint, where it is the same for all of them; else -1.
    more : how many sides of joints there are beside `touch`; of each the body, the joint, the side.
    borders : joints at hubs, with the blocks.  couplings : pairs of joints that a body ties together,
    beside `tie`, with the sides on which it is, and the block.  pivots, belows, updates : what elimination
    does, see `tables_of`.  pulled : do potentials of bodies count among the forces?
    meshes : do joints share rotors?  mesh : how many pairs of such joints; of each both, and the block;
    meshing : the rate that the one gains by an impulse of the other.  near : with how many others a joint has a
    body in common, at most.
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
    nodes: float
    parts: int
    sides: tuple[int, int]
    more: Any
    borders: Any
    couplings: Any
    pivots: Any
    belows: Any
    updates: Any
    meshes: bool
    mesh: Any
    meshing: Any
    near: float

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
        """The state of a free body, displaced."""
        mu = retraction.tau_Ad_star(self.group, omega, state.mu)
        return BodyState(mu, retraction.compose_tau(self.group, state.g, omega))

    def of_kind(self, work: Any, formula: Any) -> Any:
        """A formula of the joint, as a record of its kind."""

        def now(one: Any) -> Any:
            return formula(one.at_time(*self.clock) if self.rheonomic else one)

        return self.chosen(work.own, len(self.kinds), work.ends.load()[3], now)

    def on_body(self, work: Any, formula: Any) -> Any:
        """A formula of what acts on the body, as a record of its kind."""
        return self.chosen(work.on, len(self.fields), work.acting.load(), formula)

    def chosen(self, ones: Any, count: int, which: int, formula: Any, k: int = 0) -> Any:
        """A formula of one of several records."""
        one = self.seen(ones.nth(k).load())
        if k == count - 1 or which == k:
            return formula(one)
        return self.chosen(ones, count, which, formula, k + 1)

    def next_jump(self, work: Any, t: float, end: float, ending: Any) -> float:
        """The first jump of an input after t on the way to `end`."""
        to = jump_ahead(ending.breaks, 0, int(ending.count), t, end)
        if self.on_all is not None:
            to = first_jump(self.on_all, t, to, ending.every)
        for j in range(int(self.joints)):
            to = jump_at(work.own, len(self.kinds), j, work.ends.at(j)[3], t, to, ending.every)
        if len(self.fields) > 0:
            for b in range(int(self.bodies)):
                to = jump_at(work.on, len(self.fields), b, work.acting.at(b), t, to, ending.every)
        return to

    def at_time(self, t: float) -> Any:
        """The bodies and joints at time t."""
        return with_fields(self, clock=(t,)) if self.rheonomic else self

    def seen(self, one: Any) -> Any:
        """A value, with tables as the step sees them."""
        return during(one, *self.window) if len(self.window) > 0 else one


def jump_at(ones: Any, count: int, i: int, which: int, t: float, to: float, every: bool) -> float:
    """The first jump among inputs of what acts in one place, of one of so many kinds."""
    for k in range(count):
        if which == k:
            to = first_jump(ones.nth(k).at(i), t, to, every)
    return to


def first_jump(one: Any, t: float, to: float, every: bool) -> float:
    """The first jump of the tables of a value after t, up to `to`."""
    for table in inputs(one):
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
    held = work.ends.load()[2]
    g, k = (pose_in(value) for value in both(column, work))
    other = [vec(*[where(held > 0.0, k[i, j], 1.0 if i == j else 0.0) for j in range(4)]) for i in range(4)]
    return g, mat(*other)


def pull_on(work: Any) -> Vec:
    """The pull of joints on a body: of its first joint on either side, and of all others together."""
    first, mine, second, theirs = work.touch.load()
    one, two = work.wrench.nth(0).at(first), work.wrench.nth(1).at(second)
    return (mine * one + theirs * two) + work.pull.load()


def speeds(sides: Any, velocities: Any) -> list[Any]:
    """G xi, of rows G on both sides of a joint and the velocities of its bodies."""
    return [dot(a, velocities[0]) + dot(b, velocities[1]) for a, b in zip(*sides)]


def wrenches(l: Any, sides: Any) -> tuple[Vec, Vec]:
    """G* l, on the first and on the second body."""
    one, two = [vectors.sum([a * row for a, row in zip(l, side)]) for side in sides]
    return one, two


def answered(columns: Mat, push: Vec) -> Vec:
    """A matrix, given by its columns, times a vector."""
    found = push[0] * columns[0]
    for i in range(1, 6):
        found = found + push[i] * columns[i]
    return found
