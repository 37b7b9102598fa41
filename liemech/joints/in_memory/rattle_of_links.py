"""RATTLE on a group for any number of bodies and joints: loops over both, in memory.

The equations are those of `LieRATTLE`, and so are Newton's corrections, by their Schur complement:
one block of conditions for each joint, eliminated in an order that was found before the run.  What
belongs to one body or one joint is a formula, run for all of them side by side; elimination goes from
joint to joint.

Source: Leyendecker, Marsden and Ortiz, ZAMM 88 (2008), section 3 (the equations); Duff, Erisman and
Reid, Direct Methods for Sparse Matrices, 2nd ed., chapter 9 (elimination).
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...compiler.numbers.square_blocks import block_at, lead_block, lessen_block, put_block, save_block
from ...compiler.sites.planes import at, below, each, load, put, save
from ...errors import NoConvergence
from ...formulas import (
    Mat,
    Record,
    Vec,
    cross,
    derivative,
    dot,
    jacobian,
    mat,
    plain,
    record,
    transpose,
    vec,
    vectors,
    where,
)
from ...formulas.classes.layouts import Layout, carried_layout, layout_of, matrix, vector
from ...formulas.classes.records import with_fields
from ...formulas.elimination import inverted, of_quarters, quarters
from ...formulas.numbers.conversions import fitted
from ...formulas.tables import entry, whole
from ...groups.lie_group import LieGroup
from ...groups.retractions import Exponential
from ...integrators.kicks.explicit_kicks import negative_pivots
from ...integrators.memory import continued
from ...integrators.solvability import CONTRACTION, INFINITY, LEAST, ROUNDING, SHORTEST
from ...integrators.variational import momentum_slope, with_inertia
from ...rooms.constraints.lie_rattle import MOST, eliminated
from ...solvers import CUT, NOISE, TOLERANCE, least_part, slope_beside
from ...systems.in_time.inputs import during, inputs
from ...systems.in_time.knots import jump_ahead
from ...systems.kinetic_energy import times
from ...systems.lie_poisson import BodyState
from ...systems.system import System

SIX = layout_of(vec(*[0.0] * 6))
POSE = layout_of(mat(*[vec(*[0.0] * 4)] * 4))
BLOCK = layout_of(mat(*[vec(*[0.0] * 6)] * 6))
NUMBER = layout_of(0.0)

REST6 = vec(*[0.0] * 6)

NEAR = 2.0**-20
"""A correction below this part of the displacement, both squared, leaves the derivative as it is."""

FINE = 2.0**-110
"""As ROUNDING, an eighth of a unit in the last place: a first correction is enough where its own square, over the
displacement, which is what Newton's method leaves, is below.
"""

LINEAR = 2.0**-50
"""A correction below this part, of an iteration that converges linearly, is the last one."""

BENT = 2.0**-10
"""A change of the derivative of a load by the rate, relative, that leaves the equations as they are."""

AT_LOADS = 50
"""Corrections of the velocities that loads depend on, at the end of a step."""


@record
class Rows(Record):
    """Where numbers lie among those that every place in memory has beside what the method carries
    along: the row with which they begin.

    Fixed are: inertia and its inverse, weight, `ends` of a joint (first and second body, is there a
    second one, the kind), `alive` (which conditions count), `yields` (1/A of its rotor), `beside` (are the
    first and the second body no hubs?), `touch` (of a body a joint of which it is the
    first one, a joint of which it is the second one, each with 1, or 0 if there is none), `tie` (of a joint
    another one that a body ties it to, the sides on which the two have the body, and 1, or 0 if there
    is none), `own` (the parameters of a joint of each
    kind: the joint itself, or the first of a kind that it is not, so that formulas have numbers),
    `acting` and `on` (the kind of what acts on a body, and its parameters, likewise).
    """

    inertia: int
    inverse: int
    weight: int
    ends: int
    alive: int
    yields: int
    beside: int
    touch: int
    tie: int
    own: int
    acting: int
    on: int
    note: int
    force: int
    pull: int
    held: int
    velocity: int
    unknown: int
    slope: int
    answer: int
    moved: int
    free: int
    led: int
    pose: int
    told: int
    first: int
    second: int
    first_there: int
    second_there: int
    first_pushed: int
    second_pushed: int
    diagonal: int
    rest: int
    impulse: int
    wrench: int
    rate: int
    gain: int
    slant: int
    idle: int
    foreseen: int
    before: int
    drawn: int
    ahead: int
    field: int
    push: int
    wanted: int
    given: int
    bent: int
    paces: int
    dial: int
    block: int

    @classmethod
    def of(
        cls, full: bool, most: int, freedoms: int, own: int, on: int, pushed: bool, bent: bool,
        moving: bool, hubs: bool, geared: bool = False,
    ) -> Rows:  # fmt: skip
        """Those of inertias that are matrices, or not; so many conditions and coordinates of a
        joint, and numbers of its own; of what acts on a body, whether there are loads on bodies, and
        one on all of them by one formula; of joints in a given motion; of hubs; of rotors.
        """
        n, J, w = most + freedoms, 36 if full else 6, 6 if pushed else 0
        widths = dict(
            inertia=J, inverse=J, weight=1, ends=4, alive=most, yields=int(geared),
            beside=2 if hubs else 0, touch=4, tie=4, own=own, acting=1,
            on=on, note=3, force=6, pull=6,
            held=6, velocity=6, unknown=6 + most, slope=6 + most, answer=36, moved=36, free=6, led=6,
            pose=16, told=5, first=6 * n, second=6 * n, first_there=6 * n,
            second_there=6 * n, first_pushed=6 * n, second_pushed=6 * n, diagonal=n, rest=n, impulse=n,
            wrench=12, rate=freedoms, gain=freedoms * freedoms, slant=freedoms * freedoms,
            idle=freedoms, foreseen=freedoms, before=freedoms, drawn=freedoms,
            ahead=freedoms, field=6,
            push=w, wanted=w, given=6 * w, bent=36 if bent else 0,
            paces=n if moving else 0, dial=3 if geared else 0, block=0,
        )  # fmt: skip
        places, row = {}, 0
        for name, width in widths.items():
            places[name], row = row, row + width
        return cls(**places)


@record
class Links(System):
    """Bodies on SE(3) held together by joints, as loops over memory need them: a place in memory has
    a body and a joint.

    kinds : layouts of the kinds of joints.  fields : of what acts on bodies beside joints, if
    anything does; on_all : what acts on all of them by one formula, or None.  window : time and
    length of the step that tables see, if they jump.  clock : the time that joints in a given motion see; rheonomic : are
    there any?  geared : do rotors turn with joints?  most, freedoms : conditions of a joint, at most, and
    coordinates that loads act along.  full : are inertias matrices?
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
    run_by: ClassVar[str] = "joints.in_memory.plan:LinksOfPlan"

    group: LieGroup
    kinds: tuple[Any, ...]
    fields: tuple[Any, ...]
    on_all: Any
    window: tuple[Any, ...]
    clock: tuple[Any, ...]
    rheonomic: bool
    geared: bool
    rows: Rows
    most: int
    freedoms: int
    full: bool
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

    def displaced(self, retraction: Any, state: BodyState, omega: Vec) -> BodyState:
        """The state of a free body, displaced."""
        mu = retraction.tau_Ad_star(self.group, omega, state.mu)
        return BodyState(mu, retraction.compose_tau(self.group, state.g, omega))

    def inertia(self, work: Any) -> Any:
        """J of a body."""
        return load(below(work, self.rows.inertia), 0, BLOCK if self.full else SIX)

    def inverse(self, work: Any) -> Any:
        """J^-1 of a body."""
        return load(below(work, self.rows.inverse), 0, BLOCK if self.full else SIX)

    def inverse_of(self, work: Any, body: int) -> Any:
        """That of another one."""
        return at(below(work, self.rows.inverse), body, 0, BLOCK if self.full else SIX)

    def answers_of(self, work: Any, body: int, pushes: Any) -> list[Vec]:
        """The changes of the velocity of a body by momenta at the end of a step, where its load
        depends on it.
        """
        if self.pushed:
            given = at(below(work, self.rows.given), body, 0, BLOCK)
            return [answered(given, push) for push in pushes]
        inverse = self.inverse_of(work, body)
        return [times(inverse, push) for push in pushes]

    def of_kind(self, work: Any, formula: Any, k: int = 0) -> Any:
        """A formula of the joint, as a record of its kind."""
        before = sum([kind.width for kind in self.kinds[:k]])
        one = self.seen(load(below(work, self.rows.own + before), 0, self.kinds[k]))
        if self.rheonomic:
            one = one.at_time(*self.clock)
        if k == len(self.kinds) - 1:
            return formula(one)
        if load(below(work, self.rows.ends), 0, ENDS)[3] == k:
            return formula(one)
        return self.of_kind(work, formula, k + 1)

    def on_body(self, work: Any, formula: Any, k: int = 0) -> Any:
        """A formula of what acts on the body, as a record of its kind."""
        before = sum([kind.width for kind in self.fields[:k]])
        one = self.seen(load(below(work, self.rows.on + before), 0, self.fields[k]))
        if k == len(self.fields) - 1:
            return formula(one)
        if load(below(work, self.rows.acting), 0, KIND) == k:
            return formula(one)
        return self.on_body(work, formula, k + 1)

    def next_jump(self, work: Any, t: float, end: float, ending: Any) -> float:
        """The first jump of an input after t on the way to `end`."""
        to = jump_ahead(ending.breaks, 0, int(ending.count), t, end)
        if self.on_all is not None:
            to = first_jump(self.on_all, t, to, ending.every)
        for j in range(int(self.joints)):
            which = at(below(work, self.rows.ends), j, 0, ENDS)[3]
            to = self.jump_at(work, self.rows.own, self.kinds, j, which, t, to, ending.every)
        if len(self.fields) > 0:
            for b in range(int(self.bodies)):
                kind = at(below(work, self.rows.acting), b, 0, KIND)
                to = self.jump_at(work, self.rows.on, self.fields, b, kind, t, to, ending.every)
        return to

    def jump_at(self, work: Any, row: int, kinds: Any, i: int, which: int, t: float, to: float, every: bool) -> float:
        """The first jump among inputs of what acts in one place, of one of these kinds."""
        for k in range(len(kinds)):
            if which == k:
                to = first_jump(at(below(work, row), i, 0, kinds[k]), t, to, every)
            row = row + kinds[k].width
        return to

    def at_time(self, t: float) -> Any:
        """The bodies and joints at time t."""
        return with_fields(self, clock=(t,)) if self.rheonomic else self

    def paces_of(self, work: Any) -> Any:
        """The rates of a joint's conditions, and of motions along which loads act, by its given motion."""
        return load(below(work, self.rows.paces), 0, vector(self.most + self.freedoms))

    def seen(self, one: Any) -> Any:
        """A value, with tables as the step sees them."""
        return during(one, *self.window) if len(self.window) > 0 else one


def first_jump(one: Any, t: float, to: float, every: bool) -> float:
    """The first jump of the tables of a value after t, up to `to`."""
    for table in inputs(one):
        to = table.jump_ahead(t, to, every)
    return to


THROWN = -2.0
"""In `note`, in the place of the joint at which a step has failed: loads throw back; behind it the length of the step."""

READY, BROKEN = 1.0, 2.0
"""In `note`: field, velocity and rows are those of the state; or of none, because a step was given up.  Zero
at the start of a run, when what is shown is the state itself.
"""

PASTS = 5
"""Steps before, from which a first guess is extrapolated: with 3 of them two corrections and a half are needed
where 5 let one or two do.
"""

BLOCKS = 3
"""Blocks of a place: that of its joint, and two of the tie to another one."""

TIE = carried_layout((0, 0.0, 0.0, 0.0))
KIND = carried_layout(0)
ENDS, TOUCH = carried_layout((0, 0, 0.0, 0)), carried_layout((0, 0.0, 0, 0.0))


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
class RattleOfLinks(Record):
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
    name: str = ""
    ending: Any = None

    together: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    symmetric: ClassVar[bool] = True
    room: ClassVar[int] = 0  # rows of numbers before those that all methods work with

    def __repr__(self) -> str:
        return self.name

    def start(self, system: Any, state: Any, h: float) -> LinkMemory:
        """A state, with pasts that are still to come: zeros."""
        none = vec(*[0.0] * (6 + self.most))
        return LinkMemory(state, ((none,) * PASTS,) * self.stages, state)

    def observe(self, memory: LinkMemory) -> Any:
        """The state, once it is settled."""
        return memory.shown

    def settle(self, system: Any, t: float, sites: Any, here: int, memory: Layout) -> None:
        """Find what is shown of the state to which steps have led: its momentum without what leads off
        the constraint, mu - G* l' with G J^-1 (mu - G* l') = 0.  Steps go on as if nobody had looked.
        """
        (state, pasts, _), rows = memory.parts, system.rows
        work, place = below(sites, 2 * memory.width), below(sites, here * memory.width)
        shown = below(place, state.width + pasts.width)
        if system.loaded:
            each(sites, shown_as_it_is, place, shown, state)
        elif at(below(work, rows.note), 0, 2, NUMBER) == READY:
            found_off_the_constraint(system, sites, work)
            each(sites, shown_on_the_constraint, system, place, shown, work, state)

    def settle_anew(self, system: Any, t: float, sites: Any, here: int, memory: Layout) -> None:
        """As `settle`, where a step was given up that had begun to write down the next field."""
        work, place = below(sites, 2 * memory.width), below(sites, here * memory.width)
        self.field(system, t, 0.0, sites, place, place, work, memory.parts[0])
        put(below(work, system.rows.note), 0, 2, READY, NUMBER)
        self.settle(system, t, sites, here, memory)

    # ---------------------------------------------------------------- a step

    def step_together(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Layout) -> None:
        """A step of all bodies, from one copy of the memory to the other.  Where inputs jump it is
        one from there to the next jump, as in `EndingAtJumps.step`: what it remembers of steps of
        another length is forgotten.
        """
        places = sites, here, there, memory
        if self.ending is None:
            self.substeps_of(system, t, h, *places)
            return
        each(sites, copied, *places)
        places, work = (sites, there, there, memory), below(sites, 2 * memory.width)
        pasts = below(sites, there * memory.width + memory.parts[0].width)
        now, end, lasting, going = t, t + h, h, True
        while going:
            to = system.next_jump(work, now, end, self.ending)
            begin, s = self.ending.kept_away(now, to, where(now == t and to == end, h, to - now))
            if s != lasting:
                each(sites, forgotten, pasts, self.stages, self.most)
            lasting = s
            seen = with_fields(system, window=(begin, s, self.ending.beyond))
            self.substeps_of(seen, begin, s, *places)
            now, going = to, where(h > 0.0, to < end, to > end)
        if lasting != h:
            each(sites, forgotten, pasts, self.stages, self.most)

    def substeps_of(self, system: Any, t: float, h: float, sites: Any, here: int, there: int, memory: Layout) -> None:
        """The substeps of a step; what was before the first of them lies in the other copy."""
        state, width = memory.parts[0], memory.width
        work, past = below(sites, 2 * width), below(sites, here * width + state.width)
        for s in range(int(self.substeps)):
            share, node = entry(self.shares, 2 * s), entry(self.shares, 2 * s + 1)
            begun = here * width if s == 0 else there * width
            self.substep(system, t + node * h, share * h, sites, begun, there * width, past, s, work, state)

    def substep(
        self, system: Any, t: float, h: float, sites: Any, begun: int, there: int, past: Any, s: int,
        work: Any, state: Layout,
    ) -> None:  # fmt: skip
        """One step of LieRATTLE: in the first turn, at the start of a run, the field alone; in the
        second the displacement, in the third, under loads, what leads off the constraint.

        begun, there : the rows of the state before it, and of the one to which it leads.
        """
        ready, old, new = below(work, system.rows.note), below(sites, begun), below(sites, there)
        state_of_work = at(ready, 0, 2, NUMBER)
        turn = 1 if state_of_work == READY else 0
        while turn < 3:
            if system.loaded and turn > 0:
                before = below(sites, begun if turn == 1 else there)
                self.loads(system, t, turn, h, sites, before, new, work, state, True)
            if turn == 1 and system.geared:
                each(sites, dial_here, system.at_time(t), old, work, state)
            if turn == 1:
                each(sites, guessed, system, h, old, past, s, work, state)
                self.solve(system, t, h, sites, old, work, state)
                if system.meshes:
                    meshed(system, work)
                if system.geared:
                    each(sites, dial_there, system, work)
                each(sites, moved_body, system, self.retraction, h, old, new, work, state)
                put(ready, 0, 2, where(state_of_work == 0.0, 0.0, BROKEN), NUMBER)
            if turn < 2:
                seen, k = below(sites, begun if turn == 0 else there), h * float(turn)
                self.field(system, t + k, 0.5 * k, sites, seen, new, work, state)
            turn = turn + 1
        each(sites, ended, system, past, new, s, work, state)
        put(ready, 0, 2, READY, NUMBER)

    def field(self, system: Any, t: float, h: float, sites: Any, seen: Any, new: Any, work: Any, state: Layout) -> None:
        """The field at a state, the one after a kick h by it, its velocity, and the rows of joints."""
        each(sites, joints_here, system.at_time(t), seen, work, state)
        scattered(system, work)
        if system.on_all is not None and system.on_all.potential is not None:
            pulled_together(system, seen, work, state)
        each(sites, kicked, system, h, seen, new, work, state)

    def solve(self, system: Any, t: float, h: float, sites: Any, old: Any, work: Any, state: Layout) -> None:
        """Displacements and impulses: the solution that grows out of zero with h, as `LieRATTLE` finds it.
        While corrections are small the derivative is that of the first of them.
        """
        rows, retraction, n = system.rows, self.retraction, system.most
        reached, piece, part, tried, bad = 0.0, 1.0, 1.0, 0.0, -1.0
        while True:
            each(sites, wrench_of_unknown, system, work)
            scattered(system, work)
            each(sites, held_by_unknown, system, work)
            before, anew, done, inside = INFINITY, True, False, False
            while True:
                k = part * h
                now = system.at_time(t + k)
                if system.meshes:
                    meshed(system, work)
                if anew:
                    sign = 1.0 if h > 0.0 else -1.0
                    each(sites, correction_of_body, system, retraction, k, old, work, state)
                    each(sites, correction_of_joint, now, sign, k, work)
                    each(sites, tied, system, rows.first_there, n, work)
                    coupled(system, work, rows.first_there, sign, n)
                    if system.meshes:
                        mesh_blocks(system, k, work, n)
                    bad = factored(system, work, h, n)
                else:
                    each(sites, mismatch_of_body, system, retraction, k, old, work, state)
                    each(sites, mismatch_of_joint, now, k, work)
                    eliminated_again(system, work, n)
                solved(system, work, n)
                each(sites, wrench_of_impulses, system, work)
                scattered(system, work)
                each(sites, corrected, system, retraction, work)
                length, whole, size, upright, inside = summed(system, work)
                tried = tried + 1.0
                shrinks = length <= CONTRACTION * before
                noisy = length <= NOISE * NOISE * (whole + size)
                good = upright and bad < 0.0 and (shrinks or noisy)
                settled = length <= ROUNDING * size or (
                    length * length <= FINE * size * whole
                    if before == INFINITY
                    else length * (length / before) <= LEAST * whole
                )
                done = good and (settled or not shrinks)
                before, anew = length, length > NEAR * whole
                if done or not good or not tried < MOST:
                    break
            if done and inside:
                reached, piece = part, 2.0 * piece
                if reached < 1.0:
                    each(sites, sloped, system, 1.0 / part, work)
            else:
                piece = 0.5 * piece
            part = min(1.0, reached + piece)
            if not (reached < 1.0 and piece > SHORTEST and tried < MOST):
                break
            each(sites, along_slope, system, part, work)
        if reached < 1.0:
            put(below(work, rows.note), 0, 0, bad if bad >= 0.0 else worst(system, work), NUMBER)
            put(below(work, rows.note), 0, 1, reached, NUMBER)
            raise NoConvergence("no solution grows out of h = 0 up to this step")

    def loads(
        self, system: Any, t: float, turn: int, h: float, sites: Any, old: Any, new: Any, work: Any,
        state: Layout, kicks: bool = False,
    ) -> None:  # fmt: skip
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
        rows, n = system.rows, system.most + system.freedoms
        t, k = (t + h, 0.5 * h) if turn == 2 else (t, 1.0)
        each(sites, velocities_here, system, old, work, state)
        if system.freedoms > 0:
            each(sites, rates_here, system, work)
        tried, last, change, scale = 0, turn == 1, 1.0, 0.0
        off, size = 0.0, 0.0
        enough = TOLERANCE if system.on_all is None else LINEAR  # without the whole derivative
        looking, kicks = 0.0, kicks and (system.freedoms > 0 or system.pushed)
        while True:
            if looking > 0.0:
                if system.pushed:
                    damping_of_all(system, t, old, work, state)
                each(sites, damped_here, system, t, 0.5 * abs(h), old, work, state)
                last, tried = False, 0
            else:
                if system.freedoms > 0:
                    if tried == 1 and not last:
                        each(sites, efforts_at, system.at_time(t), t, k, 0.0, 0.0, old, work, state)
                    again = where(tried > 0, where(k == 0.0, 0.0, 1.0), 0.0)  # without a kick nothing was foreseen
                    each(sites, efforts_there, system.at_time(t), t, k, again, old, work, state)
                    scattered(system, work)
                if system.pushed:
                    self.load_of_all(system, t, k, old, work, state)
                    each(sites, pushed_there, system, t, k, old, work, state)
                if last:
                    each(sites, loaded_body, system, float(turn), old, new, work, state)
                    if turn == 1:
                        if not kicks or h < 0.0 or spares(system, h, sites, work):
                            break
                        looking = 1.0
                        continue
                    k, last = 0.0, False
                    continue
                if tried == AT_LOADS:
                    put(below(work, rows.note), 0, 0, -1.0, NUMBER)
                    raise NoConvergence("no velocity found that fits the loads at the end of a step")
                each(sites, loaded_velocity, system, old, work, state)
            if system.pushed or tried == 0 or (system.freedoms > 0 and bends(system, work)):
                each(sites, excess_of_rates, system, work)
                each(sites, tied, system, rows.first, n, work)
                coupled(system, work, rows.first, 1.0, n)
                if system.meshes:
                    mesh_blocks(system, 1.0, work, n)
                found = factored(system, work, 1.0, n, looking)
            else:
                each(sites, excess_again, system, work)
                eliminated_again(system, work, n)
                found = 0.0
            if looking > 0.0:
                require_gentle(system, h, found, work)
                break
            solved(system, work, n)
            each(sites, wrench_of_corrections, system, work)
            scattered(system, work)
            if k == 0.0 and kicks and h < 0.0:
                looking = 1.0
                continue
            if k == 0.0:
                break
            before, apart = change, off
            change, whole, falls = corrected_rates(system, work) if system.freedoms > 0 else (0.0, 0.0, 0.0)
            scale = max(scale, whole)  # of what is lost as well: a step may end at rest
            small = change <= TOLERANCE * TOLERANCE * scale
            noisy = change >= before and change <= NOISE * NOISE * scale
            last, tried = small or noisy or change == 0.0, tried + 1
            if system.pushed:
                each(sites, corrected_velocity, system, work)
                off, whole, _, _, _ = summed(system, work)
                size = max(size, whole)
                small = off <= enough * enough * size
                noisy = tried > 1 and off >= apart and off <= NOISE * NOISE * size
                last = last and (small or noisy or off == 0.0)
            elif last:
                if system.freedoms > 0:
                    each(sites, kicked_by_loads, system, old, work, state)
                if not kicks or h > 0.0:
                    break
                looking = 1.0
            elif tried > CUT:
                self.cut_short(system, t, k, falls, sites, old, work, state)

    def cut_short(
        self, system: Any, t: float, k: float, falls: float, sites: Any, old: Any, work: Any, state: Layout
    ) -> None:
        """A correction of rates ends where an energy is least, as in `newton_of_kicks`.  falls : the square of what it
        changes, by which slopes are judged.
        """
        now = system.at_time(t)

        def slope(part: float) -> float:
            each(sites, efforts_at, now, t, k, 1.0, part - 1.0, old, work, state)
            return slope_along(system, part - 1.0, work)

        part = least_part(slope, falls)
        if part < 1.0:
            shortened(system, part, work)
        each(sites, efforts_at, now, t, k, 0.0, 0.0, old, work, state)

    def load_of_all(self, system: Any, t: float, h: float, old: Any, work: Any, state: Layout) -> None:
        """The kick h F of a load on all bodies by one formula, for each of them; and, of each body
        alone, its derivative by the velocity, column by column.
        """
        if system.on_all is None or system.on_all.load is None:
            return
        rows, one = system.rows, system.seen(system.on_all)
        g = entries_of_all(system, old, state)
        xi = numbers_of_all(system, below(work, rows.wanted), SIX)

        def kick(w: Vec) -> Vec:
            return h * one.load.covector(t, w, g)

        put_parts(system, below(work, rows.push), 0, kick(xi))
        for i in range(6 * one.count):
            unit = vec(*[1.0 if k == i else 0.0 for k in range(6 * one.count)])
            column = derivative(kick, xi, unit)[i // 6 * 6 : i // 6 * 6 + 6]
            put(below(work, rows.bent), i // 6, i % 6, column, SIX)


# ------------------------------------------------------------------ formulas of one body


def copied(sites: Any, here: int, there: int, memory: Layout) -> None:
    """A place as it is."""
    save(sites, there, load(sites, here, memory), memory)


def forgotten(pasts: Any, stages: int, most: int) -> None:
    """Nothing is known of steps before."""
    for k in range(PASTS * stages):
        save(pasts, k, vec(*[0.0] * (6 + most)), vector(6 + most))


def velocities_here(system: Any, old: Any, work: Any, state: Layout) -> None:
    """xi = J^-1 mu, at which loads are looked for first."""
    rows = system.rows
    xi = times(system.inverse(work), plain(load(old, 0, state).mu))
    save(below(work, rows.velocity), 0, xi, SIX)
    if system.pushed:
        save(below(work, rows.wanted), 0, xi, SIX)


def pushed_there(system: Any, t: float, h: float, old: Any, work: Any, state: Layout) -> None:
    """The kick h F of loads on a body, and the answer of the body to momentum, (J - h F')^-1, by
    columns.
    """
    rows, g = system.rows, plain(load(old, 0, state).g)
    w, J = load(below(work, rows.wanted), 0, SIX), system.inertia(work)
    kick, slopes = REST6, [REST6 for _ in range(6)]
    if system.on_all is not None and system.on_all.load is not None:
        kick = load(below(work, rows.push), 0, SIX)
        slopes = [*load(below(work, rows.bent), 0, BLOCK)]
    if len(system.fields) > 0:
        kick = kick + h * system.on_body(work, lambda one: one.push(t, w, g))
        more = h * transpose(system.on_body(work, lambda one: slopes_of(one, t, w, g)))
        slopes = [a + b for a, b in zip(slopes, more)]
    A = [[(J[i, j] if system.full else J[i] if i == j else 0.0) - slopes[j][i] for j in range(6)] for i in range(6)]
    columns, _ = eliminated(mat(*[vec(*row) for row in A]), [*UNITS], 1.0)
    reach = sum([abs(x) for slope in slopes for x in times(system.inverse(work), slope)], 0.0)
    save(below(work, rows.told), 2, reach, NUMBER)
    save(below(work, rows.push), 0, kick, SIX)
    save(below(work, rows.given), 0, mat(*columns), BLOCK)


def slopes_of(one: Any, t: float, w: Vec, g: Mat) -> Mat:
    """The derivative of a load on a body by the velocity."""
    return jacobian(lambda y: one.push(t, y, g), w)


def loaded_velocity(system: Any, old: Any, work: Any, state: Layout) -> None:
    """The velocity with the kick by loads: J^-1 (mu + h F), of a load on the body that is linear in it
    about the velocity that is wanted, J xi = mu + h F + h F' (xi - w).
    """
    rows, mu = system.rows, plain(load(old, 0, state).mu)
    if system.freedoms > 0:
        push = pull_on(system, work)
        save(below(work, rows.free), 0, push, SIX)
        mu = mu + push
    if system.pushed:
        w, kick = load(below(work, rows.wanted), 0, SIX), load(below(work, rows.push), 0, SIX)
        off = times(system.inertia(work), w) - mu - kick
        xi = w - answered(load(below(work, rows.given), 0, BLOCK), off)
    else:
        xi = times(system.inverse(work), mu)
    save(below(work, rows.velocity), 0, xi, SIX)


def kicked_by_loads(system: Any, old: Any, work: Any, state: Layout) -> None:
    """The state after the kick by loads at joints with which its velocity was found."""
    one, push = load(old, 0, state), load(below(work, system.rows.free), 0, SIX)
    save(old, 0, fitted(BodyState(one.mu + push, one.g), state), state)


def corrected_velocity(system: Any, work: Any) -> None:
    """The velocity at which loads are looked for next, and how far it is from the last one."""
    rows, J = system.rows, system.inertia(work)
    push = answered(load(below(work, rows.given), 0, BLOCK), pull_on(system, work))
    before, told = load(below(work, rows.wanted), 0, SIX), below(work, rows.told)
    w = load(below(work, rows.velocity), 0, SIX) - push
    save(below(work, rows.wanted), 0, w, SIX)
    save(told, 0, dot(w - before, times(J, w - before)), NUMBER)
    save(told, 1, dot(w, times(J, w)), NUMBER)


def loaded_body(system: Any, turn: float, old: Any, new: Any, work: Any, state: Layout) -> None:
    """In turn 1 weight, springs and loads; in turn 2 the state after the kick by loads, and its
    velocity.
    """
    rows, one = system.rows, load(old, 0, state)
    place, push = below(work, rows.force), REST6
    if system.freedoms > 0:
        push = pull_on(system, work)
    if system.pushed:
        push = push + load(below(work, rows.push), 0, SIX)
    force, mu = load(place, 0, SIX), one.mu + where(turn > 1.0, 1.0, 0.0) * push
    save(place, 0, force + where(turn > 1.0, 0.0, 1.0) * push, SIX)
    save(new, 0, fitted(BodyState(mu, one.g), state), state)
    save(below(work, rows.velocity), 0, times(system.inverse(work), plain(mu)), SIX)


def guessed(system: Any, h: float, old: Any, pasts: Any, s: int, work: Any, state: Layout) -> None:
    """A first unknown, from the last steps, and the slope with which it begins."""
    n = system.most
    layout = vector(6 + n)
    past = [load(pasts, PASTS * s + i, layout) for i in range(PASTS)]
    guess = continued(past)
    xi = h * times(system.inverse(work), plain(load(old, 0, state).mu))
    x = [where(nothing([p[:6] for p in past]), a, b) for a, b in zip(xi, guess[:6])]
    save(below(work, system.rows.unknown), 0, vec(*x, *guess[6:]), layout)
    save(below(work, system.rows.slope), 0, vec(*xi, *guess[6:]), layout)


def nothing(some: Any) -> Any:
    """Are all numbers zero?"""
    total = 0.0
    for x in some:
        for y in x:
            total = total + abs(y)
    return total == 0.0


def held_by_unknown(system: Any, work: Any) -> None:
    """The sum of all impulses on a body."""
    rows = system.rows
    save(below(work, rows.held), 0, pull_on(system, work), SIX)


def correction_of_body(system: Any, retraction: Any, h: float, old: Any, work: Any, state: Layout) -> None:
    """With r the mismatch of Algorithm 1 and A its derivative, A^-1 r; the answer to impulses at
    the start, A^-1 B; both as displacements of the body at the end of the step as well.
    """
    rows, group = system.rows, system.group
    one = load(old, 0, state)
    force, held = load(below(work, rows.force), 0, SIX), load(below(work, rows.held), 0, SIX)
    g, momentum = plain(one.g), plain(one.mu) + ((0.5 * h) * force - held)
    x, J = load(below(work, rows.unknown), 0, SIX), system.inertia(work)
    rate = 1.0 / h
    r, by_p, by_x = retraction.residual(group, x, times(J, rate * x), momentum)
    A = with_inertia(by_x, momentum_slope(by_p, rate * J))
    inverse, same, _ = inverted(A, REST6, h)
    free, answer, moved = inverse @ r, *answers(retraction, group, x, by_p, inverse)
    told = below(work, rows.told)
    save(below(work, rows.free), 0, free, SIX)
    save(below(work, rows.answer), 0, answer, BLOCK)
    save(below(work, rows.led), 0, retraction.dtau(group, x, free), SIX)
    save(below(work, rows.moved), 0, moved, BLOCK)
    save(below(work, rows.pose), 0, retraction.compose_tau(group, g, x), POSE)
    save(told, 3, same, NUMBER)
    away = vec(g[0, 3], g[1, 3], g[2, 3])
    size = vectors.sum([(J[i, i] if system.full else J[i]) * (1.0 if i < 3 else dot(away, away)) for i in range(6)])
    save(told, 4, size, NUMBER)


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
    columns = [retraction.dtau(group, x, unit) for unit in UNITS]
    a, b, c = (
        [column[:3] for column in columns[:3]],
        [column[3:] for column in columns[:3]],
        [column[3:] for column in columns[3:]],
    )
    return transpose(mat(*a)), transpose(mat(*b)), transpose(mat(*c))


def mismatch_of_body(system: Any, retraction: Any, h: float, old: Any, work: Any, state: Layout) -> None:
    """The mismatch alone, with A as it was."""
    rows, group = system.rows, system.group
    one = load(old, 0, state)
    force, held = load(below(work, rows.force), 0, SIX), load(below(work, rows.held), 0, SIX)
    g, momentum = plain(one.g), plain(one.mu) + ((0.5 * h) * force - held)
    x = load(below(work, rows.unknown), 0, SIX)
    p = times(system.inertia(work), (1.0 / h) * x)
    off = retraction.dtau_inv_dual(group, -x, p) - momentum
    for place, answer in ((rows.free, rows.answer), (rows.led, rows.moved)):
        save(below(work, place), 0, answered(load(below(work, answer), 0, BLOCK), off), SIX)
    save(below(work, rows.pose), 0, retraction.compose_tau(group, g, x), POSE)


UNITS = tuple([vec(*[1.0 if i == k else 0.0 for i in range(6)]) for k in range(6)])


def corrected(system: Any, retraction: Any, work: Any) -> None:
    """The unknown after Newton's correction, and what it tells: how long the correction is, and the
    displacement.
    """
    rows, n = system.rows, system.most
    place, layout = below(work, rows.unknown), vector(6 + n)
    unknown, push = load(place, 0, layout), pull_on(system, work)
    W = load(below(work, rows.answer), 0, BLOCK)
    dx = load(below(work, rows.free), 0, SIX) - answered(W, push)
    x = unknown[:6] - dx
    l = unknown[6:] - load(below(work, rows.impulse), 0, vector(n))
    held, told, J = below(work, rows.held), below(work, rows.told), system.inertia(work)
    save(place, 0, vec(*x, *l), layout)
    save(held, 0, load(held, 0, SIX) - push, SIX)
    save(told, 0, dot(dx, times(J, dx)), NUMBER)
    save(told, 1, dot(x, times(J, x)), NUMBER)
    save(told, 2, where(retraction.is_chart(system.group, 2.0 * x), 1.0, 0.0), NUMBER)


def answered(columns: Mat, push: Vec) -> Vec:
    """A matrix, given by its columns, times a vector."""
    found = push[0] * columns[0]
    for i in range(1, 6):
        found = found + push[i] * columns[i]
    return found


def sloped(system: Any, factor: float, work: Any) -> None:
    """The unknown over the part of the step, along which it goes on."""
    layout = vector(6 + system.most)
    unknown = load(below(work, system.rows.unknown), 0, layout)
    save(below(work, system.rows.slope), 0, factor * unknown, layout)


def along_slope(system: Any, part: float, work: Any) -> None:
    """The unknown of a part of the step, along the slope."""
    layout = vector(6 + system.most)
    slope = load(below(work, system.rows.slope), 0, layout)
    save(below(work, system.rows.unknown), 0, part * slope, layout)


def moved_body(system: Any, retraction: Any, h: float, old: Any, new: Any, work: Any, state: Layout) -> None:
    """The state after the first kick and the displacement."""
    rows, one = system.rows, load(old, 0, state)
    force, held = load(below(work, rows.force), 0, SIX), load(below(work, rows.held), 0, SIX)
    x = load(below(work, rows.unknown), 0, SIX)
    kicked = BodyState(one.mu + ((0.5 * h) * force - held), one.g)
    save(new, 0, fitted(system.displaced(retraction, kicked, x), state), state)


def kicked(system: Any, h: float, old: Any, new: Any, work: Any, state: Layout) -> None:
    """The field, the state after a kick h by it, and its velocity."""
    rows, one = system.rows, load(old, 0, state)
    force = weight_of(system, work, one.g) + pull_on(system, work)
    if system.on_all is not None and system.on_all.potential is not None:
        force = force + load(below(work, rows.field), 0, SIX)
    if len(system.fields) > 0 and system.pulled:
        force = force + system.on_body(work, lambda it: it.pull(plain(one.g)))
    mu = one.mu + h * force
    mu = vec(*[where(h == 0.0, a, b) for a, b in zip(one.mu, mu)])  # rests of rounding as well
    save(new, 0, fitted(BodyState(mu, one.g), state), state)
    save(below(work, rows.force), 0, force, SIX)
    save(below(work, rows.velocity), 0, times(system.inverse(work), plain(mu)), SIX)


def pull_on(system: Any, work: Any) -> Vec:
    """The pull of joints on a body: one of which it is the first body, one of which it is the second,
    and all others together.
    """
    wrenches = below(work, system.rows.wrench)
    first, mine, second, theirs = load(below(work, system.rows.touch), 0, TOUCH)
    one = at(wrenches, first, 0, SIX)
    two = at(wrenches, second, 1, SIX)
    return (mine * one + theirs * two) + load(below(work, system.rows.pull), 0, SIX)


def weight_of(system: Any, work: Any, g: Any) -> Vec:
    """(0, -w R^T e3)."""
    weight = load(below(work, system.rows.weight), 0, NUMBER)
    return vec(0.0, 0.0, 0.0, *[-(weight * plain(g)[2, j]) for j in range(3)])


def ended(system: Any, pasts: Any, place: Any, s: int, work: Any, state: Layout) -> None:
    """The past with this step; under loads the momentum without what leads off the constraint."""
    rows, layout = system.rows, vector(6 + system.most)
    unknown = load(below(work, rows.unknown), 0, layout)
    past = [load(pasts, PASTS * s + i, layout) for i in range(PASTS)]
    fresh = nothing(past)
    new = [vec(*[where(fresh, a, b) for a, b in zip(unknown, y)]) for y in (unknown, *past[:-1])]
    if system.loaded:
        on = on_the_constraint(system, load(place, 0, state), work)
        save(place, 0, fitted(on, state), state)
    for i in range(PASTS):
        save(below(place, state.width), PASTS * s + i, new[i], layout)


def on_the_constraint(system: Any, one: BodyState, work: Any) -> BodyState:
    """The state of a body without the momentum that leads off the constraint."""
    return BodyState(one.mu - pull_on(system, work), one.g)


def shown_on_the_constraint(system: Any, place: Any, shown: Any, work: Any, state: Layout) -> None:
    """A body as it is shown."""
    on = on_the_constraint(system, load(place, 0, state), work)
    save(shown, 0, fitted(on, state), state)


def shown_as_it_is(place: Any, shown: Any, state: Layout) -> None:
    """A body whose momentum is on the constraint, as it is shown."""
    save(shown, 0, load(place, 0, state), state)


# ------------------------------------------------------------------ formulas of one joint


def poses_of(system: Any, poses: Any, work: Any, layout: Layout) -> tuple[Mat, Mat]:
    """The poses of a joint's bodies, of which the second may be the ground."""
    first, second, held, _ = load(below(work, system.rows.ends), 0, ENDS)
    g = pose_in(at(poses, first, 0, layout))
    k = pose_in(at(poses, second, 0, layout))
    other = [vec(*[where(held > 0.0, k[i, j], 1.0 if i == j else 0.0) for j in range(4)]) for i in range(4)]
    return g, mat(*other)


def pose_in(value: Any) -> Mat:
    """The pose in what lies in memory."""
    return plain(value.g) if isinstance(value, BodyState) else value


def joints_here(system: Any, old: Any, work: Any, state: Layout) -> None:
    """The rows of a joint, of its conditions and of motions that loads act along, and the wrench of
    its springs.
    """
    rows, n = system.rows, system.most + system.freedoms
    g, k = poses_of(system, old, work, state)
    held = load(below(work, rows.ends), 0, ENDS)[2]
    alive = load(below(work, rows.alive), 0, vector(system.most))
    sides = system.of_kind(work, lambda one: one.rows(g, k, system.most, system.freedoms))
    first = [a * row for a, row in zip(alive, sides[0])]
    second = [(a * held) * row for a, row in zip(alive, sides[1])]
    motions = [[*side[system.most :]] for side in sides]
    layout = matrix(n, 6)
    save(below(work, rows.first), 0, mat(*first, *motions[0]), layout)
    save(below(work, rows.second), 0, mat(*second, *[held * row for row in motions[1]]), layout)
    if system.rheonomic:
        paces = system.of_kind(work, lambda one: one.paces(g, k, system.most, system.freedoms))
        own = [a * x for a, x in zip(alive, paces)]
        save(below(work, rows.paces), 0, vec(*own, *paces[system.most :]), vector(n))
    push = vec(*[0.0] * 12)
    if system.springs:
        push = system.of_kind(work, lambda one: one.springs_push(g, k))
        push = vec(*push[:6], *(held * push[6:]))
    save(below(work, rows.wrench), 0, push, TWELVE)


TWELVE = vector(12)


def wrench_of_unknown(system: Any, work: Any) -> None:
    """G* l, of the impulses in the unknown."""
    unknown = load(below(work, system.rows.unknown), 0, vector(6 + system.most))
    save_wrench(system, work, unknown[6:])


def wrench_of_impulses(system: Any, work: Any) -> None:
    """The wrench of the impulses that elimination has found."""
    save_wrench(system, work, load(below(work, system.rows.impulse), 0, vector(system.most)))


def save_wrench(system: Any, work: Any, l: Vec) -> None:
    """The pull of a joint on its two bodies."""
    rows, layout = system.rows, matrix(system.most, 6)
    sides = [load(below(work, row), 0, layout) for row in (rows.first, rows.second)]
    pulls = [vectors.sum([a * row for a, row in zip(l, side)]) for side in sides]
    save(below(work, rows.wrench), 0, vec(*pulls[0], *pulls[1]), TWELVE)


def meshed(system: Any, work: Any) -> None:
    """The rate that a rotor gains by the impulses of other joints that it drives."""
    rows, table = system.rows, system.mesh
    dial, unknown = below(work, rows.dial), below(work, rows.unknown)
    for p in range(whole(table, 0)):
        put(dial, whole(table, 1 + 3 * p), 2, 0.0, NUMBER)
    for p in range(whole(table, 0)):
        j, k = whole(table, 1 + 3 * p), whole(table, 2 + 3 * p)
        l = at(unknown, k, 5 + system.most, NUMBER)
        put(dial, j, 2, at(dial, j, 2, NUMBER) + entry(system.meshing, p) * l, NUMBER)


def mesh_blocks(system: Any, h: float, work: Any, n: int) -> None:
    """Add h times that to the blocks of such joints."""
    blocks, table, last = below(work, system.rows.block), system.mesh, system.most - 1
    for p in range(whole(table, 0)):
        place, y = whole(table, 3 + 3 * p), h * entry(system.meshing, p)
        more = [vec(*[y if i == last and j == last else 0.0 for j in range(n)]) for i in range(n)]
        put_block(blocks, place, block_at(blocks, place, n) + mat(*more))


def dial_here(system: Any, old: Any, work: Any, state: Layout) -> None:
    """The coordinate of a joint, by which its rotor turns, and its rate."""
    rows, last = system.rows, system.most - 1
    first, second, _, _ = load(below(work, rows.ends), 0, ENDS)
    g, k = poses_of(system, old, work, state)
    q = system.of_kind(work, lambda one: one.turned(g, k, 0.0))
    layout = matrix(system.most + system.freedoms, 6)
    a, b = [load(below(work, place), 0, layout)[last] for place in (rows.first, rows.second)]
    one, two = [at(below(work, rows.velocity), body, 0, SIX) for body in (first, second)]
    save(below(work, rows.dial), 0, vec(q, dot(a, one) + dot(b, two), 0.0), vector(3))


def dial_there(system: Any, work: Any) -> None:
    """The rate of a rotor after the impulse on it, q' + l/A."""
    dial, y = below(work, system.rows.dial), load(below(work, system.rows.yields), 0, NUMBER)
    q, rate, more = load(dial, 0, vector(3))
    l = load(below(work, system.rows.unknown), 0, vector(6 + system.most))[5 + system.most]
    save(dial, 0, vec(q, rate + y * l + more, 0.0), vector(3))


def with_dial(system: Any, h: float, g: Mat, k: Mat, c: Any, work: Any) -> Any:
    """The conditions, with that of the rotor, which turns as the joint does: by h (q' + l/A) along the step."""
    if not system.geared:
        return c
    q, rate, more = load(below(work, system.rows.dial), 0, vector(3))
    y = load(below(work, system.rows.yields), 0, NUMBER)
    l = load(below(work, system.rows.unknown), 0, vector(6 + system.most))[5 + system.most]
    turned = system.of_kind(work, lambda one: one.turned(g, k, q))
    return [*c[: system.most - 1], turned - h * (rate + y * l + more)]


def yielding(system: Any, h: float, blank: Any, work: Any) -> Vec:
    """An addition to the diagonal of a block: the blanks, and h/A of the rotor."""
    if not system.geared:
        return vec(*blank)
    m, y = system.most, load(below(work, system.rows.yields), 0, NUMBER)
    return vec(*[x + h * y if i == m - 1 else x for i, x in enumerate(blank)])


def correction_of_joint(system: Any, sign: float, h: float, work: Any) -> None:
    """The conditions at the end of the step, their rows, what they miss, and the answers of the
    bodies to the impulses of the joint.  sign : of the step h.
    """
    rows, n = system.rows, system.most
    first, second, held, _ = load(below(work, rows.ends), 0, ENDS)
    g, k = poses_of(system, below(work, rows.pose), work, POSE)
    alive = load(below(work, rows.alive), 0, vector(n))
    sides = system.of_kind(work, lambda one: one.rows(g, k, n, 0))
    c = with_dial(system, h, g, k, system.of_kind(work, lambda one: one.value(g, k, n)), work)
    there = ([a * row for a, row in zip(alive, sides[0])], [(a * held) * row for a, row in zip(alive, sides[1])])
    pushed: list[Any] = []
    free: list[Any] = []
    for place, body in ((rows.first, first), (rows.second, second)):
        K = at(below(work, rows.moved), body, 0, BLOCK)
        here = load(below(work, place), 0, matrix(n, 6))
        pushed = [*pushed, [answered(K, row) for row in here]]
        free = [*free, at(below(work, rows.led), body, 0, SIX)]
    rest = [dot(a, free[0]) + dot(b, free[1]) - live * value for a, b, value, live in zip(*there, c, alive)]
    for place, side in zip((rows.first_there, rows.second_there), there):
        save(below(work, place), 0, mat(*side), matrix(n, 6))
    blank = yielding(system, h, [sign * (1.0 - x) for x in alive], work)
    save_pushed(system, work, pushed, there, blank, n)
    save(below(work, rows.rest), 0, vec(*rest), vector(n))


def mismatch_of_joint(system: Any, h: float, work: Any) -> None:
    """The mismatch of the conditions, with their rows as they were."""
    rows, n = system.rows, system.most
    first, second, _, _ = load(below(work, rows.ends), 0, ENDS)
    g, k = poses_of(system, below(work, rows.pose), work, POSE)
    alive = load(below(work, rows.alive), 0, vector(n))
    c = with_dial(system, h, g, k, system.of_kind(work, lambda one: one.value(g, k, n)), work)
    sides: list[Any] = []
    for place, body in ((rows.first_there, first), (rows.second_there, second)):
        free = at(below(work, rows.led), body, 0, SIX)
        sides = [*sides, [dot(row, free) for row in load(below(work, place), 0, matrix(n, 6))]]
    rest = [a + b - live * value for a, b, value, live in zip(*sides, c, alive)]
    save(below(work, rows.rest), 0, vec(*rest), vector(n))


def save_pushed(system: Any, work: Any, pushed: Any, there: Any, blank: Vec, n: int) -> None:
    """The answers to the impulses of a joint, and its own block; `blank` is added to its diagonal,
    for conditions that do not count.
    """
    rows, sides = system.rows, there
    if system.parts > 0:
        beside = load(below(work, rows.beside), 0, vector(2))
        sides = [[x * row for row in side] for x, side in zip(beside, there)]
    block = [
        vec(*[dot(a, p) + dot(b, q) + (blank[i] if i == j else 0.0)
              for j, (p, q) in enumerate(zip(*pushed))])
        for i, (a, b) in enumerate(zip(*sides))
    ]  # fmt: skip
    for place, side in zip((rows.first_pushed, rows.second_pushed), pushed):
        save(below(work, place), 0, mat(*side), matrix(n, 6))
    save(below(work, rows.diagonal), 0, vec(*[abs(row[i]) for i, row in enumerate(block)]), vector(n))
    save_block(below(work, rows.block), BLOCKS, 0, mat(*block))


def tied(system: Any, begins: int, n: int, work: Any) -> None:
    """The two blocks of a joint and another one that a body ties it to."""
    rows, layout = system.rows, matrix(n, 6)
    other, mine, theirs, there = load(below(work, rows.tie), 0, TIE)
    one, two = system.sides
    found: list[Any] = []
    for begin in (begins, rows.first_pushed):
        places = [below(work, begin + k * (rows.second - rows.first)) for k in range(2)]
        if one < 0:
            own = chosen(mine, *[load(place, 0, layout) for place in places])
        else:
            own = load(places[one], 0, layout)
        if two < 0:
            his = chosen(theirs, *[at(place, other, 0, layout) for place in places])
        else:
            his = at(places[two], other, 0, layout)
        found = [*found, own, his]
    a, b, p, q = found
    blocks = below(work, rows.block)
    for slot, left, right in ((1, b, p), (2, a, q)):
        block = mat(*[vec(*[there * dot(x, y) for y in right]) for x in left])
        save_block(blocks, BLOCKS, slot, block)


def chosen(second: float, a: Mat, b: Mat) -> Mat:
    """One of two matrices: the second one, if `second` is 1."""
    return mat(*[vec(*[where(second > 0.0, y, x) for x, y in zip(u, v)]) for u, v in zip(a, b)])


def found_off_the_constraint(system: Any, sites: Any, work: Any) -> None:
    """The impulses l' of what leads off the constraint, G J^-1 (mu - G* l') = 0, and their pull on bodies."""
    first, n = system.rows.first, system.most
    each(sites, excess_of, system, work)
    each(sites, tied, system, first, n, work)
    coupled(system, work, first, 1.0, n)
    factored(system, work, 1.0, n)
    solved(system, work, n)
    each(sites, wrench_of_impulses, system, work)
    scattered(system, work)


def excess_of(system: Any, work: Any) -> None:
    """The rate off the constraint, G xi, and the answers of the bodies to impulses, J^-1 G*."""
    rows, n = system.rows, system.most
    first, second, _, _ = load(below(work, rows.ends), 0, ENDS)
    alive = load(below(work, rows.alive), 0, vector(n))
    here: list[Any] = []
    pushed: list[Any] = []
    xi: list[Any] = []
    for place, body in ((rows.first, first), (rows.second, second)):
        own, inverse = load(below(work, place), 0, matrix(n, 6)), system.inverse_of(work, body)
        here, pushed = [*here, own], [*pushed, [times(inverse, row) for row in own]]
        xi = [*xi, at(below(work, rows.velocity), body, 0, SIX)]
    rest = [dot(a, xi[0]) + dot(b, xi[1]) for a, b in zip(*here)]
    if system.rheonomic:
        rest = [x + pace for x, pace in zip(rest, system.paces_of(work))]
    save_pushed(system, work, pushed, here, vec(*[1.0 - x for x in alive]), n)
    save(below(work, rows.rest), 0, vec(*rest), vector(n))


# ------------------------------------------------------------------ loads at joints


def motions_of(system: Any, work: Any) -> tuple[list[Vec], list[Vec]]:
    """The motions of a joint that loads act along, by its first and its second body."""
    rows, n = system.rows, system.most + system.freedoms
    first, second = [load(below(work, p), 0, matrix(n, 6)) for p in (rows.first, rows.second)]
    return [*first[system.most :]], [*second[system.most :]]


def rates_here(system: Any, work: Any) -> None:
    """The rates of a joint."""
    rows = system.rows
    first, second, _, _ = load(below(work, rows.ends), 0, ENDS)
    one, two = [at(below(work, rows.velocity), b, 0, SIX) for b in (first, second)]
    rates = [dot(a, one) + dot(b, two) for a, b in zip(*motions_of(system, work))]
    if system.rheonomic:
        rates = [x + pace for x, pace in zip(rates, system.paces_of(work)[system.most :])]
    save(below(work, rows.rate), 0, vec(*rates), vector(system.freedoms))


def save_push(system: Any, work: Any, efforts: Any) -> None:
    """The forces on both bodies of torques along the motions of a joint."""
    sides = motions_of(system, work)
    pushes = [vectors.sum([e * row for e, row in zip(efforts, side)]) for side in sides]
    save(below(work, system.rows.wrench), 0, vec(*pushes[0], *pushes[1]), TWELVE)


def efforts_at(
    system: Any, t: float, h: float, moving: float, part: float, old: Any, work: Any, state: Layout
) -> None:  # fmt: skip
    """The kick h F that loads would give at rest; or, with 1 for `moving`, a part of the last correction farther on."""
    (g, k), n = poses_of(system, old, work, state), system.freedoms
    rates = load(below(work, system.rows.rate), 0, vector(n))
    step = load(below(work, system.rows.impulse), 0, vector(system.most + n))[system.most :]
    there = vec(*[where(moving > 0.0, w + part * x, 0.0) for w, x in zip(rates, step)])
    kicks = system.of_kind(work, lambda one: h * one.efforts(t, one.seen(t, g, k), there, n))
    save(below(work, system.rows.idle), 0, kicks, vector(n))


def efforts_there(system: Any, t: float, h: float, again: float, old: Any, work: Any, state: Layout) -> None:
    """The kick h F of loads, and the slope by the rates with which Newton's method goes on.  again : 1 after
    a correction, which has foreseen a kick.
    """
    rows, n = system.rows, system.freedoms
    g, k = poses_of(system, old, work, state)
    rates, foreseen = load(below(work, rows.rate), 0, vector(n)), below(work, rows.foreseen)
    kicks, gain = system.of_kind(work, lambda one: kick_of(one, t, h, one.seen(t, g, k), rates))
    idle, wanted = load(below(work, rows.idle), 0, vector(n)), load(foreseen, 0, vector(n))
    before = load(below(work, rows.before), 0, vector(n))
    wanted = vec(*[where(again > 0.0, a, b) for a, b in zip(wanted, kicks)])
    steps = [
        where(again > 0.0, x, 0.0) for x in load(below(work, rows.impulse), 0, vector(system.most + n))[system.most :]
    ]
    slopes = [slope_beside(kicks[i], idle[i], before[i], wanted[i], rates[i], steps[i], gain[i, i]) for i in range(n)]
    gain = [vec(*[slopes[i] if i == j else gain[i, j] for j in range(n)]) for i in range(n)]
    save(foreseen, 0, kicks, vector(n))
    save(below(work, rows.before), 0, kicks, vector(n))
    save(below(work, rows.slant), 0, mat(*gain), matrix(n, n))
    save_push(system, work, kicks)


def kick_of(one: Any, t: float, h: float, seen: Any, rates: Vec) -> tuple[Vec, Mat]:
    """The kick of the loads at a joint along its motions, and its derivative by the rates."""

    def kick(y: Vec) -> Vec:
        return h * one.efforts(t, seen, y, len(rates))

    return kick(rates), jacobian(kick, rates)


def damped_here(system: Any, t: float, h: float, old: Any, work: Any, state: Layout) -> None:
    """h times the damping of a joint; the answer of the body to momentum under h times its own damping, and how
    many of its directions are thrown back.
    """
    rows, n = system.rows, system.freedoms
    if n > 0:
        g, k = poses_of(system, old, work, state)
        rates = load(below(work, rows.rate), 0, vector(n))
        damping = system.at_time(t).of_kind(work, lambda one: one.resistances(t, one.seen(t, g, k), rates, n))
        slopes = [vec(*[h * damping[i] if i == j else 0.0 for j in range(n)]) for i in range(n)]
        save(below(work, rows.slant), 0, mat(*slopes), matrix(n, n))
    if system.pushed:
        J = system.inertia(work)
        damped = [REST6 for _ in range(6)]
        if system.on_all is not None and system.on_all.load is not None:
            damped = [h * column for column in load(below(work, rows.bent), 0, BLOCK)]
        if len(system.fields) > 0:
            pose, xi = plain(load(old, 0, state).g), load(below(work, rows.wanted), 0, SIX)
            own = system.on_body(work, lambda one: mat(*[one.resistance(t, xi, pose, unit) for unit in UNITS]))
            damped = [a + h * b for a, b in zip(damped, own)]
        A = [[(J[i, j] if system.full else J[i] if i == j else 0.0) - damped[j][i] for j in range(6)] for i in range(6)]
        columns, _ = eliminated(mat(*[vec(*row) for row in A]), [*UNITS], 1.0)
        save(below(work, rows.given), 0, mat(*columns), BLOCK)
        save(below(work, rows.told), 1, negative_pivots(mat(*[vec(*row) for row in A])), NUMBER)


def reach_of_slopes(system: Any, work: Any) -> None:
    """The derivatives of loads by rates, at the start of a step, beside the inertia of bodies that no joint holds."""
    rows, n, ratio = system.rows, system.freedoms, 0.0
    if n > 0:
        first, second, _, _ = load(below(work, rows.ends), 0, ENDS)
        slopes = load(below(work, rows.slant), 0, matrix(n, n))
        for side, body in zip(motions_of(system, work), (first, second)):
            inverse = system.inverse_of(work, body)
            for i in range(n):
                ratio = ratio + abs(slopes[i, i]) * dot(side[i], times(inverse, side[i]))
    save(below(work, rows.told), 0, ratio, NUMBER)


def spares(system: Any, h: float, sites: Any, work: Any) -> bool:
    """Is half a step of the loads' derivatives surely below the inertia that they act on?"""
    each(sites, reach_of_slopes, system, work)
    told, joint, body = below(work, system.rows.told), 0.0, 0.0
    for j in range(int(system.joints)):
        joint = max(joint, at(told, j, 0, NUMBER))
    if system.pushed:
        for b in range(int(system.bodies)):
            body = max(body, at(told, b, 2, NUMBER))
    return 0.5 * h * ((1.0 + system.near) * joint + body) < 1.0


def require_gentle(system: Any, h: float, turned: float, work: Any) -> None:
    """Refuse a step h whose kick turns velocities round.  turned : how many pivots of conditions and loads say so."""
    rows, count = system.rows, turned
    if system.pushed:
        for b in range(int(system.bodies)):
            count = count + at(below(work, rows.told), b, 1, NUMBER)
    if count > 0.0:
        put(below(work, rows.note), 0, 0, THROWN, NUMBER)
        put(below(work, rows.note), 0, 1, abs(h), NUMBER)
        raise NoConvergence("the first kick by loads throws back")


def excess_of_rates(system: Any, work: Any) -> None:
    """The rate off the constraint, and how far rates are from those at which their kick was found;
    the answers of bodies to impulses, and to a change of rates with the kick by it.
    """
    rows, n, m = system.rows, system.most + system.freedoms, system.most
    first, second, _, _ = load(below(work, rows.ends), 0, ENDS)
    alive = load(below(work, rows.alive), 0, vector(m))
    here: list[Any] = []
    pushed: list[Any] = []
    gain: Any = ()
    if system.freedoms > 0:
        gain = load(below(work, rows.slant), 0, matrix(system.freedoms, system.freedoms))
        save(below(work, rows.gain), 0, gain, matrix(system.freedoms, system.freedoms))
    for place, body in ((rows.first, first), (rows.second, second)):
        own = load(below(work, place), 0, matrix(n, 6))
        moved = system.answers_of(work, body, own)
        kicks = [
            -vectors.sum([gain[b, i] * moved[m + b] for b in range(system.freedoms)]) for i in range(system.freedoms)
        ]
        here, pushed = [*here, own], [*pushed, [*moved[:m], *kicks]]
    save(below(work, rows.rest), 0, rates_off(system, work, here), vector(n))
    blank = [*[1.0 - x for x in alive], *[1.0 for _ in range(system.freedoms)]]
    blank = yielding(system, 1.0, blank, work)
    save_pushed(system, work, pushed, here, blank, n)


def excess_again(system: Any, work: Any) -> None:
    """How far rates are off, alone."""
    rows, n = system.rows, system.most + system.freedoms
    here = [load(below(work, place), 0, matrix(n, 6)) for place in (rows.first, rows.second)]
    save(below(work, rows.rest), 0, rates_off(system, work, here), vector(n))


def rates_off(system: Any, work: Any, here: Any) -> Vec:
    """The rate off the constraint, and how far rates are from those at which their kick was found."""
    rows, m = system.rows, system.most
    first, second, _, _ = load(below(work, rows.ends), 0, ENDS)
    xi = [at(below(work, rows.velocity), body, 0, SIX) for body in (first, second)]
    rest = [dot(a, xi[0]) + dot(b, xi[1]) for a, b in zip(*here)]
    if system.rheonomic:
        rest = [x + pace for x, pace in zip(rest, system.paces_of(work))]
    off: list[Any] = []
    if system.freedoms > 0:
        rates = load(below(work, rows.rate), 0, vector(system.freedoms))
        off = [x - w for x, w in zip(rest[m:], rates)]
    if system.geared:
        rest = [*rest[: m - 1], rest[m - 1] - load(below(work, rows.dial), 0, vector(3))[1]]
    return vec(*rest[:m], *off)


def bends(system: Any, work: Any) -> bool:
    """Has the derivative of loads by rates changed by more than a part that Newton's method does not
    notice?
    """
    layout, changed = matrix(system.freedoms, system.freedoms), 0.0
    new, used = below(work, system.rows.slant), below(work, system.rows.gain)
    for j in range(int(system.joints)):
        for a, b in zip(at(new, j, 0, layout), at(used, j, 0, layout)):
            for x, y in zip(a, b):
                changed = where(abs(x - y) > BENT * abs(y), 1.0, changed)
    return changed > 0.0


def wrench_of_corrections(system: Any, work: Any) -> None:
    """The pull on both bodies of impulses, and of the kick by a change of rates, which is no pull."""
    rows, n, m = system.rows, system.most + system.freedoms, system.most
    found = load(below(work, rows.impulse), 0, vector(n))
    pulls = [*found[:m]]
    if system.freedoms > 0:
        gain = load(below(work, rows.gain), 0, matrix(system.freedoms, system.freedoms))
        pulls = [*pulls, *[-dot(row, found[m:]) for row in gain]]
    sides = [load(below(work, row), 0, matrix(n, 6)) for row in (rows.first, rows.second)]
    sums = [vectors.sum([a * row for a, row in zip(pulls, side)]) for side in sides]
    save(below(work, rows.wrench), 0, vec(*sums[0], *sums[1]), TWELVE)


def corrected_rates(system: Any, work: Any) -> tuple[float, float, float]:
    """Rates after Newton's correction, and the kicks that it foresees; the sums of the squares of corrections, and of rates before
    them with how far off those were: at rest the kicks alone say what rounding is; and of corrections of rates times those
    of kicks.
    """
    n, m = system.most + system.freedoms, system.most
    change, whole, falls, layout = 0.0, 0.0, 0.0, vector(system.freedoms)
    rates, found = below(work, system.rows.rate), below(work, system.rows.impulse)
    rest, kicks = below(work, system.rows.rest), below(work, system.rows.foreseen)
    drawn, ahead = below(work, system.rows.drawn), below(work, system.rows.ahead)
    gains, square = below(work, system.rows.gain), matrix(system.freedoms, system.freedoms)
    for j in range(int(system.joints)):
        step = at(found, j, 0, vector(n))[m:]
        old, off = at(rates, j, 0, layout), at(rest, j, 0, vector(n))[m:]
        put(rates, j, 0, old + step, layout)
        led = vec(*[dot(row, step) for row in at(gains, j, 0, square)])
        kick = at(kicks, j, 0, layout) + led
        more = kick - at(drawn, j, 0, layout)
        put(kicks, j, 0, kick, layout)
        put(drawn, j, 0, kick, layout)
        put(ahead, j, 0, more, layout)
        change, whole, falls = change + dot(step, step), whole + dot(old, old) + dot(off, off), falls + dot(step, more)
    return change, whole, falls


def slope_along(system: Any, part: float, work: Any) -> float:
    """The slope of the energy along the last correction, a part of it farther on, where the kicks are known."""
    total, layout = 0.0, vector(system.freedoms)
    found, drawn = below(work, system.rows.impulse), below(work, system.rows.drawn)
    ahead, kicks = below(work, system.rows.ahead), below(work, system.rows.idle)
    for j in range(int(system.joints)):
        step = at(found, j, 0, vector(system.most + system.freedoms))[system.most :]
        off = at(drawn, j, 0, layout) + part * at(ahead, j, 0, layout) - at(kicks, j, 0, layout)
        total = total + dot(step, off)
    return total


def shortened(system: Any, part: float, work: Any) -> None:
    """The last correction, cut to a part of it."""
    n, m, layout = system.most + system.freedoms, system.most, vector(system.freedoms)
    rates, found = below(work, system.rows.rate), below(work, system.rows.impulse)
    drawn, ahead = below(work, system.rows.drawn), below(work, system.rows.ahead)
    for j in range(int(system.joints)):
        whole = at(found, j, 0, vector(n))
        kick = at(drawn, j, 0, layout) + (part - 1.0) * at(ahead, j, 0, layout)
        put(rates, j, 0, at(rates, j, 0, layout) + (part - 1.0) * whole[m:], layout)
        put(found, j, 0, vec(*whole[:m], *(part * whole[m:])), vector(n))
        put(drawn, j, 0, kick, layout)
        put(below(work, system.rows.foreseen), j, 0, kick, layout)


# ------------------------------------------------------------------ all bodies by one formula


def entries_of_all(system: Any, poses: Any, layout: Layout) -> Vec:
    """The entries of all poses, row by row, (16 N,)."""
    found = [pose_in(at(poses, b, 0, layout)) for b in range(system.on_all.count)]
    return vec(*[x for g in found for row in g for x in row])


def numbers_of_all(system: Any, place: Any, layout: Layout) -> Vec:
    """The numbers of all bodies, one after another."""
    return vec(*[x for b in range(system.on_all.count) for x in at(place, b, 0, layout)])


def put_parts(system: Any, place: Any, k: int, whole: Vec) -> None:
    """The parts of a covector on all bodies, (6 N,), each to its body."""
    for b in range(system.on_all.count):
        put(place, b, k, whole[6 * b : 6 * b + 6], SIX)


def damping_of_all(system: Any, t: float, old: Any, work: Any, state: Layout) -> None:
    """The damping of each body by a load on all of them by one formula, by columns."""
    if system.on_all is None or system.on_all.load is None:
        return
    one = system.seen(system.on_all)
    g = entries_of_all(system, old, state)
    xi = numbers_of_all(system, below(work, system.rows.wanted), SIX)
    for i in range(6 * one.count):
        unit = vec(*[1.0 if k == i else 0.0 for k in range(6 * one.count)])
        column = one.load.resistance(t, xi, g, unit)[i // 6 * 6 : i // 6 * 6 + 6]
        put(below(work, system.rows.bent), i // 6, i % 6, column, SIX)


def pulled_together(system: Any, old: Any, work: Any, state: Layout) -> None:
    """The force of a potential of all poses; of one that is derived one component after the other,
    -dV/ds along g exp(s e_i).
    """
    one, field = system.on_all, below(work, system.rows.field)
    g = entries_of_all(system, old, state)
    if not one.derived:
        put_parts(system, field, 0, one.potential.force(one.group, g))
        return
    for i in range(6 * one.count):
        unit = vec(*[1.0 if k == i else 0.0 for k in range(6 * one.count)])
        along: list[Any] = []
        for b in range(one.count):
            w, v = unit[6 * b : 6 * b + 3], unit[6 * b + 3 : 6 * b + 6]
            rows = [g[16 * b + 4 * j : 16 * b + 4 * j + 3] for j in range(3)]
            along = [*along, *[x for R in rows for x in (*cross(R, w), dot(R, v))], *REST4]
        slope = derivative(one.potential.energy, g, vec(*along))
        put(field, i // 6, i % 6, -slope, NUMBER)


REST4 = vec(*[0.0] * 4)


# ------------------------------------------------------------------ from joint to joint


def scattered(system: Any, work: Any) -> None:
    """The sums of what joints do to bodies that have more than one of either side."""
    pull, wrench, table = (below(work, system.rows.pull), below(work, system.rows.wrench), system.more)
    count = whole(table, 0)
    for p in range(count):
        put(pull, whole(table, 1 + 3 * p), 0, vec(*[0.0] * 6), SIX)
    for p in range(count):
        body, j, side = (whole(table, 1 + 3 * p + i) for i in range(3))
        put(pull, body, 0, at(pull, body, 0, SIX) + at(wrench, j, side, SIX), SIX)


def coupled(system: Any, work: Any, begins: int, sign: float, n: int) -> None:
    """The blocks of pairs of joints that a body ties together; those that elimination fills are
    zero.  sign : of the matrix.
    """
    rows, layout = system.rows, matrix(n, 6)
    blocks, table, side = below(work, rows.block), system.couplings, rows.second - rows.first
    for p in range(whole(table, 0)):
        j, k, mine, theirs, block, kind = (whole(table, 1 + 6 * p + i) for i in range(6))
        if kind < 0:
            put_block(blocks, block, mat(*[vec(*[0.0] * n)] * n))
        else:
            a = at(below(work, begins + side * mine), j, 0, layout)
            b = at(below(work, rows.first_pushed + side * theirs), k, 0, layout)
            found = mat(*[vec(*[dot(x, y) for y in b]) for x in a])
            if kind == 1:
                found = block_at(blocks, block, n) + found
            put_block(blocks, block, found)
    if system.parts > 0:
        bordered(system, work, begins, sign, n)


def bordered(system: Any, work: Any, begins: int, sign: float, n: int) -> None:
    """The blocks of the motions z of hubs.  Of S = S_0 + U K V* with the rows U and V of joints at a hub and
    its answer K to momenta, S l = r is

        S_0 l + U z = r,   z - K V* l = 0,

    and S_0 ties no joints by hubs, so that a hub of n joints takes n blocks, not n^2.

    sign : of S; the second line is multiplied by it.
    Source: Golub and Van Loan, Matrix Computations, 4th ed., section 2.1.4 (Woodbury).
    """
    rows, layout, m = system.rows, matrix(n, 6), system.most
    blocks, table, side = below(work, rows.block), system.borders, rows.second - rows.first
    width = 2 + 2 * system.parts
    for p in range(whole(table, 0)):
        j, mine = whole(table, 1 + width * p), whole(table, 2 + width * p)
        a = at(below(work, begins + side * mine), j, 0, layout)
        b = at(below(work, rows.first_pushed + side * mine), j, 0, layout)
        for k in range(system.parts):
            some = [*range(m * k, min(6, m * k + m))]
            rest = [0.0] * (n - len(some))
            places = [whole(table, 3 + width * p + 2 * k + i) for i in range(2)]
            put_block(blocks, places[0], mat(*[vec(*[x[i] for i in some], *rest) for x in a]))
            found = [vec(*[-sign * x[i] for x in b]) for i in some]
            put_block(blocks, places[1], mat(*found, *[vec(*[0.0] * n)] * len(rest)))
    for v in range(int(system.joints), int(system.nodes)):
        unit = [vec(*[sign if i == k else 0.0 for i in range(n)]) for k in range(n)]
        put_block(blocks, BLOCKS * v, mat(*unit))
        put(below(work, rows.diagonal), v, 0, vec(*[1.0] * n), vector(n))
    nothing_of_hubs(system, below(work, rows.rest), n)


def nothing_of_hubs(system: Any, place: Any, n: int) -> None:
    """Set numbers of the motions of hubs, which are no conditions and no impulses, to zero."""
    for v in range(int(system.joints), int(system.nodes)):
        put(place, v, 0, vec(*[0.0] * n), vector(n))


def factored(system: Any, work: Any, sign: float, n: int, counted: float = 0.0) -> float:
    """Elimination of the blocks, in place, and of what the conditions miss; the first joint whose conditions
    depend on those before it, or the last joint if the determinant has lost its sign; -1 if all is well.
    counted : 1 for the number of negative pivots instead, those of conditions as -1.
    """
    blocks, diagonals = below(work, system.rows.block), below(work, system.rows.diagonal)
    bad, same, count = -1.0, 1.0, 0.0
    for p in range(int(system.nodes)):
        k, begin, end = (whole(system.pivots, 3 * p + i) for i in range(3))
        before = at(diagonals, k, 0, vector(n))
        if counted > 0.0:
            conditions = where(float(k) < system.joints, 1.0 * system.most, 0.0)
            count = count + negative_pivots(block_at(blocks, BLOCKS * k, n), conditions)
        inverse, turned, far = inverted(block_at(blocks, BLOCKS * k, n), before, sign)
        same = same * turned
        if not far and bad < 0.0:
            bad = min(float(k), system.joints - 1.0)
        put_block(blocks, BLOCKS * k, inverse)
        forward(system, work, n, k, begin, end, inverse)
        for b in range(begin, end):
            lead_block(blocks, whole(system.belows, 5 * b + 2), inverse)
        for b in range(begin, end):
            left, first, last = (whole(system.belows, 5 * b + i) for i in (1, 3, 4))
            for u in range(first, last):
                right, place = whole(system.updates, 2 * u), whole(system.updates, 2 * u + 1)
                lessen_block(blocks, place, left, right, n)
    bad = system.joints - 1.0 if same < 0.0 and bad < 0.0 else bad
    return where(counted > 0.0, count, bad)


def eliminated_again(system: Any, work: Any, n: int) -> None:
    """Elimination of what the conditions miss, with the blocks as `factored` has left them."""
    blocks = below(work, system.rows.block)
    if system.parts > 0:
        nothing_of_hubs(system, below(work, system.rows.rest), n)
    for p in range(int(system.nodes)):
        k, begin, end = (whole(system.pivots, 3 * p + i) for i in range(3))
        forward(system, work, n, k, begin, end, block_at(blocks, BLOCKS * k, n))


def forward(system: Any, work: Any, n: int, k: int, begin: int, end: int, inverse: Mat) -> None:
    """A joint's share of the impulses, without those of later joints, which are told of it."""
    layout, blocks = vector(n), below(work, system.rows.block)
    rest, impulse = below(work, system.rows.rest), below(work, system.rows.impulse)
    x = inverse @ at(rest, k, 0, layout)
    put(impulse, k, 0, x, layout)
    for b in range(begin, end):
        i, left = whole(system.belows, 5 * b), whole(system.belows, 5 * b + 1)
        put(rest, i, 0, at(rest, i, 0, layout) - block_at(blocks, left, n) @ x, layout)


def solved(system: Any, work: Any, n: int) -> None:
    """The impulses, from the last joint to the first."""
    layout, count = vector(n), int(system.nodes)
    blocks, impulse = below(work, system.rows.block), below(work, system.rows.impulse)
    for back in range(count):
        k, begin, end = (whole(system.pivots, 3 * (count - 1 - back) + i) for i in range(3))
        for b in range(begin, end):
            i, right = whole(system.belows, 5 * b), whole(system.belows, 5 * b + 2)
            shared = block_at(blocks, right, n) @ at(impulse, i, 0, layout)
            put(impulse, k, 0, at(impulse, k, 0, layout) - shared, layout)
    if system.parts > 0:
        nothing_of_hubs(system, impulse, n)


def summed(system: Any, work: Any) -> tuple[float, float, float, bool, bool]:
    """The sums of what corrections tell: their square and that of displacements, the size of what is
    rounding, whether determinants have kept their sign, and whether all is inside the chart.
    """
    told = below(work, system.rows.told)
    length, whole, size, upright, inside = 0.0, 0.0, 0.0, 1.0, 1.0
    for b in range(int(system.bodies)):
        length, whole = length + at(told, b, 0, NUMBER), whole + at(told, b, 1, NUMBER)
        inside, upright = min(inside, at(told, b, 2, NUMBER)), min(upright, at(told, b, 3, NUMBER))
        size = size + at(told, b, 4, NUMBER)
    return length, whole, size, upright > 0.0, inside > 0.0


def worst(system: Any, work: Any) -> float:
    """The joint whose conditions miss most."""
    rest, found, most = below(work, system.rows.rest), 0.0, 0.0
    for j in range(int(system.joints)):
        x = at(rest, j, 0, vector(system.most))
        square = dot(x, x)
        if square > most:
            found, most = float(j), square
    return found
