"""A linkage as loops over memory need it: the joints by kinds, and the order in which they are
eliminated.
"""

from __future__ import annotations

import heapq
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..compiler.numbers.square_blocks import wide
from ..compiler.sites.planes import Planes, columns
from ..formulas import Mat, Record, Vec, record, vec
from ..formulas.classes.derived import is_derived
from ..formulas.classes.flattening import leaves
from ..formulas.classes.layouts import layout_of
from ..formulas.classes.records import with_fields
from ..formulas.classes.signatures import bare
from ..formulas.sites import EIGHT, padded
from ..formulas.tables import Table, of_whole
from ..groups.rigid.se3 import SE3
from .body_forces import AtBody, ForcesOfBodies, OnAll, PotentialsOfBodies
from .in_memory.links import BLOCKS, Links, work_of
from .joint_forces import AtJoint, effort_of, resistance_of, seen_about
from .joints import REST6

SHARED = 1 << 40
"""Numbers from here on are those of rotors that joints share, behind those of bodies."""

FEW = 4
"""Places in memory of the smallest linkages; those of others go by eights, as many as run side by side."""


@record
class LinkedJoint(Record):
    """A joint, with what acts at it, as a formula of the poses of its two bodies.

    springs : forces that have a potential.  loads : others.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
    """

    joint: Any
    springs: tuple[Any, ...]
    loads: tuple[Any, ...]

    def at_time(self, t: float) -> Any:
        """The joint at time t."""
        return with_fields(self, joint=self.joint.at_time(t))

    def paces(self, g: Mat, k: Mat, most: int, freedoms: int) -> Vec:
        """The rates of conditions, and of motions along which loads act, by a given motion alone."""
        moving = self.joint.paces_of_motions(g, k) if freedoms > 0 and len(self.loads) > 0 else []
        paces = filled(self.joint.paces(g, k), most, 0.0)
        return vec(*paces, *filled(moving, freedoms, 0.0))

    def value(self, g: Mat, k: Mat, most: int) -> list[Any]:
        """The conditions of the joint, with zeros behind them up to `most`."""
        return filled([*self.joint.value(g, k)], most, 0.0)

    def rows(self, g: Mat, k: Mat, most: int, freedoms: int) -> tuple[list[Vec], list[Vec]]:
        """Their rows by the first and by the second body, and those of motions along which loads
        act; both with zeros.
        """
        rows = self.joint.rows(g, k)
        moving = self.joint.motions(g, k) if freedoms > 0 and len(self.loads) > 0 else ()
        sides: list[Any] = []
        for side in range(2):
            conditions = filled([row[side] for row in rows], most, REST6)
            sides = [*sides, [*conditions, *filled([row[side] for row in moving], freedoms, REST6)]]
        return sides[0], sides[1]

    def springs_push(self, g: Mat, k: Mat) -> Vec:
        """The forces of springs on both bodies, (12,)."""
        if len(self.springs) == 0:
            return vec(*REST6, *REST6)
        _, motions, efforts = AtJoint(self.joint, self.springs).push(0.0, both(g, k), REST6)
        first, second = REST6, REST6
        for (by_first, by_second), effort in zip(motions, efforts):
            first, second = first + effort * by_first, second + effort * by_second
        return vec(*first, *second)

    def seen(self, t: float, g: Mat, k: Mat) -> list[Vec]:
        """The coordinates of the joint, as each of the loads sees them."""
        at, poses = AtJoint(self.joint, self.loads), both(g, k)
        return [at.coordinates(load, t, poses) for load in self.loads]

    def efforts(self, t: float, seen: list[Vec], rates: Vec, freedoms: int, formula: Any = effort_of) -> Vec:
        """The torques of loads at these rates, (freedoms,), and zeros; or of another `formula`."""
        at, joint_rates = AtJoint(self.joint, self.loads), rates[: self.joint.freedoms]
        total = vec(*[0.0] * freedoms)
        for load, q in zip(self.loads, seen):
            total = total + vec(*filled([*at.effort_at(load, t, q, joint_rates, formula)], freedoms, 0.0))
        return total

    def resistances(self, t: float, seen: list[Vec], rates: Vec, freedoms: int) -> Vec:
        """The damping of each motion by loads, (freedoms,), and zeros."""
        return self.efforts(t, seen, rates, freedoms, resistance_of)


@record
class GearedJoint(LinkedJoint):
    """A joint of a linkage of which some have rotors: behind its conditions stands its coordinate.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 9.6.
    """

    def rows(self, g: Mat, k: Mat, most: int, freedoms: int) -> tuple[list[Vec], list[Vec]]:
        """The rows of conditions, of the coordinate, and of motions along which loads act."""
        rows, motions = self.joint.rows(g, k), ()  # type: Any, Any
        if self.joint.geared or (freedoms > 0 and len(self.loads) > 0):
            motions = self.joint.motions(g, k)
        moving = motions if freedoms > 0 and len(self.loads) > 0 else ()
        turning = motions if self.joint.geared else ()
        sides: list[Any] = []
        for side in range(2):
            conditions = filled([row[side] for row in rows], most - 1, REST6)
            last = filled([row[side] for row in turning], 1, REST6)
            others = filled([row[side] for row in moving], freedoms, REST6)
            sides = [*sides, [*conditions, *last, *others]]
        return sides[0], sides[1]

    def turned(self, g: Mat, k: Mat, q: float) -> float:
        """How far the coordinate is from q, an angle within half a turn."""
        if not self.joint.geared:
            return 0.0
        far = self.joint.coordinates(g, k) - vec(q)
        return seen_about(far, 0.0, self.joint.angles)[0]


def filled(some: list[Any], count: int, blank: Any) -> list[Any]:
    """Some values, and blanks up to so many."""
    return [*some, *[blank for _ in range(count - len(some))]]


def both(g: Mat, k: Mat) -> Vec:
    """The entries of two poses, one after the other."""
    return vec(*[x for row in (*g, *k) for x in row])


@dataclass(frozen=True, eq=False)
class LinkedForm:
    """A linkage in memory.

    links : for the formulas.  fixed : the rows of numbers that do not change, (rows, places).  more :
    how many rows there are behind them.  joints : the formulas of the joint in each place.
    has_loops : do joints close loops?
    """

    links: Links
    fixed: np.ndarray
    more: int
    joints: tuple[LinkedJoint, ...]
    has_loops: bool

    @property
    def places(self) -> int:
        """The number of places in a row of `fixed`."""
        return int(self.fixed.shape[1])


def linked(linkage: Any) -> LinkedForm:
    """The form of a linkage."""
    mechanism: Any = linkage
    acts, on_all = on_bodies(mechanism)
    fields = tuple(dict.fromkeys(map(layout_of, acts)))
    if not any(member.potentials or member.loads for member in acts):
        fields = ()
    counted = mechanism.constraint.counted
    springs, loads = mechanism._at_joints()
    acting: list[list[tuple[Any, ...]]] = [[(), ()] for _ in counted]
    for which, group in enumerate((springs, loads)):
        for member in group:
            number = next(j for j, joint in enumerate(mechanism.joints) if joint is member.joint)
            acting[number][which] = tuple(replace(force, joint=0) for force in member.forces)
    ends = [(joint.first, -1 if joint.second is None else joint.second) for joint, _ in counted]
    geared: bool = getattr(mechanism, "geared", False)
    make: Any = GearedJoint if geared else LinkedJoint
    joints = [make(replace(joint, first=0, second=1, name=None), *group) for (joint, _), group in zip(counted, acting)]
    layouts = [layout_of(joint) for joint in joints]
    kinds = tuple(dict.fromkeys(layouts))
    most = max(joint.joint.conditions for joint in joints) + int(geared)
    freedoms = max([joint.joint.freedoms for joint in joints if joint.loads], default=0)
    full = any(np.ndim(np.array(link.inertia)) == 2 for link in mechanism.links)
    bent = on_all is not None and on_all.load is not None
    pushed = bent or any(member.loads for member in acts)
    moving = mechanism.constraint.rheonomic
    meshes: dict[tuple[int, int], float] = mechanism.meshes if geared else {}
    hubs = hubs_in(ends)
    if any(all(b < 0 or b in hubs for b in ends[j]) for j, _ in meshes):
        hubs = []  # a joint of hubs alone has no block before them, and would be needed by what shares its rotor
    parts = -(-6 // most) if hubs else 0  # nodes of a hub
    work = work_of(full, most, freedoms, kinds, fields, pushed, bent, moving, parts > 0, geared)
    most_places = max(len(mechanism.links), len(joints) + parts * len(hubs))
    places = FEW if most_places <= FEW else EIGHT * -(-most_places // EIGHT)
    numbers = np.zeros((work.width, places))
    of = columns(Planes(numbers, places), work=work).work.fields
    own, on = ([ones.nth(k) for k in range(len(ones.layout.parts))] for ones in (of.own, of.on))
    for b in range(places):
        link = mechanism.links[b if b < len(mechanism.links) else 0]
        J = inertia_of(link, full)
        write(of.inertia, b, J.ravel())
        write(of.inverse, b, (np.linalg.inv(J) if full else 1.0 / J).ravel())
    write(of.weight, slice(len(mechanism.links)), [link.mass * mechanism.gravity for link in mechanism.links])
    shared = {j: (SHARED + min(j, *[k for i, k in meshes if i == j]),) for j, _ in meshes}
    tables, blocks, ties, at_blocks = tables_of(
        [(*bodies_of, *shared.get(j, ())) for j, bodies_of in enumerate(ends)], hubs, parts, places
    )
    mine: dict[tuple[int, int], tuple[int, float]] = {}  # the first joint on each side of a body
    further: list[int] = []
    at_body: dict[int, set[int]] = {}  # its joints
    for j, bodies_of in enumerate(ends):
        for side, b in enumerate(bodies_of):
            at_body.setdefault(b, set()).add(j)
            if b >= 0 and (b, side) in mine:
                further += [b, j, side]
            elif b >= 0:
                mine[b, side] = j, 1.0
    ahead = 0
    for place in range(places):
        j = place if place < len(joints) else 0
        first, second = ends[j]
        alive = [float(i in counted[j][1]) for i in range(most)]
        if geared:
            light = mechanism.lightness.get(j, 0.0)
            alive = [*alive[:-1], float(light > 0.0)]
            write(of.yields, place, light)
        of.ends.put(place, (first, max(second, 0), float(second >= 0), kinds.index(layouts[j])))
        write(of.alive, place, alive)
        if hubs:
            write(of.beside, place, [b not in hubs for b in ends[j]])
        of.touch.put(place, (*mine.get((place, 0), (0, 0.0)), *mine.get((place, 1), (0, 0.0))))
        tie = ties.get(place, (ahead if ahead < padded(places) else 0, 0.0, 0.0, 0.0))
        ahead = tie[0] + 1  # so that lanes without a tie ask for what lies beside that of others
        of.tie.put(place, tie)
        for kind, column in zip(kinds, own):
            write(column, place, leaves(joints[j if layouts[j] == kind else layouts.index(kind)], kind))
        field = acts[place if place < len(acts) else 0]
        if fields:
            of.acting.put(place, fields.index(layout_of(field)))
        for kind, column in zip(fields, on):
            one = field if layout_of(field) == kind else next(member for member in acts if layout_of(member) == kind)
            write(column, place, leaves(one, kind))
    size = most + freedoms
    form: Any = Links
    links = form(
        SE3(), kinds, fields, on_all, (), (), moving, geared, work, most, freedoms,
        any(joint.springs for joint in joints), pushed, True, float(len(mechanism.links)), float(len(joints)),
        float(len(joints) + parts * len(hubs)), parts, sides_of(ties),
        of_whole([len(further) // 3, *further]), *tables, len(meshes) > 0,
        of_whole([len(meshes), *[x for pair in meshes for x in (*pair, at_blocks[pair])]]),
        Table(np.array([*meshes.values(), 0.0])),
        float(max(len(set().union(*[at_body[b] for b in bodies_of if b >= 0])) for bodies_of in ends) - 1),
    )  # fmt: skip
    fixed = numbers[: of.at_joint.rows.start]
    more = work.width - len(fixed) - (-blocks * size * wide(size) // padded(places))
    return LinkedForm(links, fixed, more, tuple(joints), has_loops(ends))


def write(column: Any, place: Any, numbers: Any) -> None:
    """Write numbers into a column."""
    column.array[column.rows.start : column.rows.stop, place] = numbers


def on_bodies(linkage: Any) -> tuple[list[AtBody], OnAll | None]:
    """Fields and loads on each body alone, and those on all of them by one formula."""
    parts: list[list[tuple[Any, ...]]] = [[(), ()] for _ in linkage.links]
    whole: list[Any] = [None, None]
    for which, acting in enumerate((linkage.potential, linkage.load)):
        if isinstance(acting, (PotentialsOfBodies, ForcesOfBodies)):
            for b, force in zip(acting.bodies, acting.each):
                parts[b][which] = (force,)
        else:
            whole[which] = acting
    acts = [AtBody(*part) for part in parts]
    if whole == [None, None]:
        return acts, None
    derived = whole[0] is not None and is_derived(bare(type(whole[0]).force))
    return acts, OnAll(linkage.configurations, len(acts), whole[0], whole[1], derived)


def inertia_of(link: Any, full: bool) -> np.ndarray:
    """The moments of a body, (6,), or the matrix, (6, 6)."""
    J = np.array(link.inertia)
    if not full:
        return np.array([*J, *[link.mass] * 3])
    whole = link.mass * np.eye(6)
    whole[:3, :3] = J if J.ndim == 2 else np.diag(J)
    return whole


# ------------------------------------------------------------------ the order of elimination


def eliminated_in(ends: list[tuple[int, int]]) -> tuple[tuple[int, ...], list[list[int]]]:
    """An order in which joints are eliminated: first, again and again, one of which one body alone has
    other joints left, which ties no others together, those at all ends of a tree in turn, for what
    follows from one end waits for nothing at the others; of loops one that is tied to the fewest others.
    And for each place in it the later joints that it is tied to then.

    ends : of each joint its bodies; -1 is the ground.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 6.5 (trees); Duff, Erisman
    and Reid, Direct Methods for Sparse Matrices, 2nd ed., section 9.2 (minimum degree).
    """
    at: dict[int, set[int]] = {}
    for j, bodies in enumerate(ends):
        for b in bodies:
            if b >= 0:
                at.setdefault(b, set()).add(j)
    order: list[int] = []
    left: list[set[int]] = []
    free = [(0, j) for j, bodies in enumerate(ends) if _is_free(bodies, at)]
    queued = {j for _, j in free}
    while free:
        turn, j = heapq.heappop(free)
        near = set().union(*[at[b] for b in ends[j] if b >= 0]) - {j}
        order.append(j)
        left.append(near)
        for b in ends[j]:
            if b >= 0:
                at[b].discard(j)
        # a joint becomes free when it is the last one of a body
        for k in near:
            if k not in queued and any(len(at[b]) == 1 for b in ends[k] if b >= 0) and _is_free(ends[k], at):
                queued.add(k)
                heapq.heappush(free, (turn + 1, k))
    loops = {j: set().union(*[at[b] for b in ends[j] if b >= 0]) - {j}
             for j in range(len(ends)) if j not in queued}  # fmt: skip
    heap = [(len(neighbours), j) for j, neighbours in loops.items()]
    heapq.heapify(heap)
    while heap:
        degree, j = heapq.heappop(heap)
        if j not in loops or degree != len(loops[j]):
            continue
        near = loops.pop(j)
        order.append(j)
        left.append(near)
        for k in near:
            loops[k] |= near
            loops[k] -= {j, k}
            heapq.heappush(heap, (len(loops[k]), k))
    place = {j: p for p, j in enumerate(order)}
    return tuple(order), [sorted(neighbours, key=place.__getitem__) for neighbours in left]


def _is_free(bodies: tuple[int, int], at: dict[int, set[int]]) -> bool:
    """Whether at most one of the bodies of a joint has other joints left."""
    return sum(b >= 0 and len(at[b]) > 1 for b in bodies) <= 1


def has_loops(ends: list[tuple[int, int]]) -> bool:
    """Whether joints, the ground among what they hold, close loops."""
    root: dict[int, int] = {}

    def top(b: int) -> int:
        while root.setdefault(b, b) != b:
            b = root[b]
        return b

    for first, second in ends:
        top_first, top_second = top(first), top(second)
        if top_first == top_second:
            return True
        root[top_first] = top_second
    return False


HUB = 8
"""Joints from which a body counts as a hub.  Of fewer ones it is quicker that they tie each other."""


def hubs_in(ends: list[tuple[int, int]]) -> list[int]:
    """The bodies with so many joints that their motion is an unknown, beside the impulses."""
    count = Counter(b for bodies in ends for b in bodies if b >= 0)
    return sorted(b for b, joints in count.items() if joints >= HUB)


def eliminated_with_hubs(
    ends: list[tuple[int, int]], hubs: list[int], parts: int
) -> tuple[tuple[int, ...], list[list[int]]]:
    """As `eliminated_in`: first joints, as if hubs were the ground, then the motions of hubs, the nodes
    behind those of joints, then joints that hold hubs alone; of both one that is tied to the fewest.
    """
    count = len(ends)
    nodes = {b: {count + parts * i + k for k in range(parts)} for i, b in enumerate(hubs)}
    near = [set().union(*[nodes.get(b, set()) for b in bodies]) for bodies in ends]
    tied: dict[int, set[int]] = {v: set(of) - {v} for of in nodes.values() for v in of}
    order, left = eliminated_in(apart_from(ends, hubs))
    later_of: dict[int, set[int]] = {}
    last = {j for j in order if not any(b >= 0 and b not in nodes for b in ends[j])}
    for j, later in zip(order, left):
        if j not in last:
            later_of[j] = {*later, *near[j]}
            for k in later:
                near[k] |= near[j]
            for v in near[j]:
                tied[v] |= near[j] - {v}
    tied |= {j: near[j] for j in last}
    for j in last:
        for v in near[j]:
            tied[v].add(j)
    for remaining in ({v for v in tied if v >= count}, last):
        while remaining:
            k = min(remaining, key=lambda v: (len(tied[v]), v))
            remaining.discard(k)
            later_of[k] = tied.pop(k)
            for v in later_of[k]:
                tied[v] |= later_of[k]
                tied[v] -= {k, v}
    place = {k: p for p, k in enumerate(later_of)}
    return tuple(later_of), [sorted(remaining, key=place.__getitem__) for remaining in later_of.values()]


def apart_from(ends: list[Any], hubs: list[int]) -> list[Any]:
    """The ends of joints with hubs in the place of the ground."""
    return [(*[-1 if b in hubs else b for b in bodies[:2]], *bodies[2:]) for bodies in ends]


def tables_of(
    ends: list[Any], hubs: list[int], parts: int, places: int
) -> tuple[list[Table], int, dict[int, Tie], dict[tuple[int, int], int]]:
    """The plan of elimination, as lists of numbers: borders, couplings, pivots, belows and updates of
    `Links`; how many blocks there are; of each joint the tie to another one, of which the place has
    the blocks; and where the blocks are.

    ends : of each joint its bodies, and behind them the rotor that it shares with others, if there is one.

    borders : how many joints there are at hubs; of each the joint, the side on which it has the hub, and
    for each part of the motion of the hub the places of the blocks, of the joint by it, and of it by the
    joint.
    couplings : how many; of each the joints j and k, the sides of j and k on which they have a body
    in common, where the block is, and 0, 1 if it is added to what is there, -1 if it is zero.
    pivots : the joints in turn, each with where its belows begin, and where they end.
    belows : of each the later joint i, where the blocks (i, k) and (k, i) are, and where its updates
    begin and end.  updates : of each where the block (k, j) is, and (i, j), which loses (i, k) (k, j).
    """
    all_ends = ends
    order, filling = eliminated_with_hubs(ends, hubs, parts) if hubs else eliminated_in(ends)
    ends = [*(apart_from(ends, hubs) if hubs else ends), *[(-1, -1)] * (parts * len(hubs))]
    blocks = {(k, k): BLOCKS * k for k in range(len(ends))}
    pairs = [(k, i) for k, later in zip(order, filling) for i in later]
    ties = ties_of(ends, pairs)
    count = BLOCKS * padded(places)
    for k, i in pairs:
        owner, other = (k, i) if ties.get(k, NO_TIE)[0] == i else (i, k)
        if ties.get(owner, NO_TIE)[0] == other:
            blocks[other, owner], blocks[owner, other] = BLOCKS * owner + 1, BLOCKS * owner + 2
            continue
        blocks[i, k], blocks[k, i], count = count, count + 1, count + 2
    couplings: list[list[int]] = []
    borders: list[list[int]] = []
    direct: set[tuple[int, int]] = set()
    for j, bodies in enumerate(all_ends):
        for side, b in enumerate(bodies[:2]):
            if b in hubs:
                nodes = [len(all_ends) + parts * hubs.index(b) + k for k in range(parts)]
                direct |= {(j, v) for v in nodes} | {(v, j) for v in nodes}
                borders.append([j, side, *[blocks[at] for v in nodes for at in ((j, v), (v, j))]])
    for (j, k), block in blocks.items():
        if j == k or (j, k) in direct:
            continue
        common = _sides(ends[j], ends[k])
        mine, theirs = ties.get(j, NO_TIE), ties.get(k, NO_TIE)
        if k == mine[0] or j == theirs[0]:
            tied = [*map(int, mine[1:3] if k == mine[0] else theirs[2:0:-1])]
            couplings += [[j, k, *s, block, 1] for s in common if [*s] != tied]
            continue
        for turn, sides in enumerate(common or [(0, 0)]):
            couplings.append([j, k, *sides, block, min(turn, 1) if common else -1])
    pivots, belows, updates = [], [], []  # type: list[int], list[list[int]], list[list[int]]
    for k, later in zip(order, filling):
        pivots += [k, len(belows), len(belows) + len(later)]
        for i in later:
            begin = len(updates)
            updates += [[blocks[k, j], blocks[i, j]] for j in later]
            belows.append([i, blocks[i, k], blocks[k, i], begin, len(updates)])
    tables = (
        [len(borders), *np.ravel(borders)],
        [len(couplings), *np.ravel(couplings)],
        pivots,
        np.ravel(belows),
        np.ravel(updates),
    )
    return [of_whole([*table, 0]) for table in tables], count, ties, blocks


Tie = tuple[int, float, float, float]
"""Another joint, the sides of both on which they have a body in common, and 1."""

NO_TIE: Tie = (-1, 0.0, 0.0, 0.0)


def ties_of(ends: list[tuple[int, int]], pairs: list[tuple[int, int]]) -> dict[int, Tie]:
    """For each joint at most one of the pairs that it is in.  Where all pairs of joints that a body
    ties together have the body as the first of one and the second of the other, as in chains and
    trees, either all of the ones or all of the others have the ties.
    """
    tied = [(*pair, sides) for pair in pairs for sides in _sides(ends[pair[0]], ends[pair[1]])[:1]]
    choices: list[dict[int, Tie]] = []
    for wanted in ((0, 1), (1, 0), None):
        ties: dict[int, Tie] = {}
        for k, i, sides in tied:
            for owner, other, (s, t) in ((k, i, sides), (i, k, sides[::-1])):
                if wanted in (None, (s, t)) and owner not in ties:
                    ties[owner] = other, float(s), float(t), 1.0
                    break
        choices.append(ties)
    return max(choices, key=len)


def sides_of(ties: dict[int, Tie]) -> tuple[int, int]:
    """The sides on which ties have their body, where they are the same for all; else -1."""
    numbers = [{int(tie[side]) for tie in ties.values()} for side in (1, 2)]
    first, second = (of_side.pop() if len(of_side) == 1 else -1 for of_side in numbers)
    return first, second


def _sides(one: tuple[int, int], other: tuple[int, int]) -> list[tuple[int, int]]:
    """The sides of two joints on which they have a body in common."""
    return [(s, t) for s, b in enumerate(one[:2]) for t, c in enumerate(other[:2]) if b == c and b >= 0]
