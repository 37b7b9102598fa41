"""The form of a linkage in memory: its joints by kinds, with their forces, as numbers at places."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..compiler.sites.planes import Planes, columns
from ..formulas import Mat, Record, Vec, record, vec
from ..formulas.classes.derived import is_derived
from ..formulas.classes.layouts import layout_of, leaves
from ..formulas.classes.records import with_fields
from ..formulas.classes.signatures import bare
from ..formulas.sites import EIGHT, padded
from ..formulas.tables import Table, of_whole
from ..groups.rigid.se3 import SE3
from .body_forces import AtBody, ForcesOfBodies, OnAll, PotentialsOfBodies
from .elimination_order import has_loops, hubs_in, sides_of, tables_of
from .in_memory.links import LinkedBodies, work_of
from .in_memory.reduced_equation import BodyAmongJoints
from .joint_forces import AtJoint, effort_of, resistance_of, seen_about
from .points_and_axes import REST6

SHARED = 1 << 40
"""Numbers from here on are those of rotors that joints share, behind those of bodies."""

FEW = 4
"""Places in memory of the smallest linkages; those of others go by eights, as many as run side by side."""


@record
class LinkedJoint(Record):
    """A joint, with what acts at it, as a formula of the poses of its two bodies.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 3.5.
    """

    joint: Any
    springs: tuple[Any, ...]  # forces that have a potential
    loads: tuple[Any, ...]  # the other forces

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
        """The rows of conditions by the first and by the second body, and of motions along which loads act; both padded
        by zeros.
        """
        moving = self.joint.motions(g, k) if freedoms > 0 and len(self.loads) > 0 else ()
        return by_bodies([*filled([*self.joint.rows(g, k)], most, NO_ROW), *filled([*moving], freedoms, NO_ROW)])

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

    def efforts(self, t: float, coordinates: list[Vec], rates: Vec, freedoms: int, formula: Any = effort_of) -> Vec:
        """The torques of loads at these rates, (freedoms,), and zeros; or of another `formula`."""
        at, joint_rates = AtJoint(self.joint, self.loads), rates[: self.joint.freedoms]
        total = vec(*[0.0] * freedoms)
        for load, q in zip(self.loads, coordinates):
            total = total + vec(*filled([*at.effort_at(load, t, q, joint_rates, formula)], freedoms, 0.0))
        return total

    def resistances(self, t: float, coordinates: list[Vec], rates: Vec, freedoms: int) -> Vec:
        """The damping of each motion by loads, (freedoms,), and zeros."""
        return self.efforts(t, coordinates, rates, freedoms, resistance_of)


@record
class GearedJoint(LinkedJoint):
    """A joint of a linkage of which some have rotors: behind its conditions stands its coordinate.

    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 9.6.
    """

    def rows(self, g: Mat, k: Mat, most: int, freedoms: int) -> tuple[list[Vec], list[Vec]]:
        """The rows of conditions, of the coordinate, and of motions along which loads act."""
        rows: list[Any] = [*self.joint.rows(g, k)]
        moves = freedoms > 0 and len(self.loads) > 0
        motions = self.joint.motions(g, k) if self.joint.geared or moves else ()
        turning, moving = motions if self.joint.geared else (), motions if moves else ()
        return by_bodies(
            [*filled(rows, most - 1, NO_ROW), *filled([*turning], 1, NO_ROW), *filled([*moving], freedoms, NO_ROW)]
        )

    def turned(self, g: Mat, k: Mat, q: float) -> float:
        """How far the coordinate is from q, an angle within half a turn."""
        if not self.joint.geared:
            return 0.0
        far = self.joint.coordinates(g, k) - vec(q)
        return seen_about(far, 0.0, self.joint.angles)[0]


def filled(values: list[Any], count: int, blank: Any) -> list[Any]:
    """`count` values, of which those behind the given ones are blanks."""
    return [*values, *[blank for _ in range(count - len(values))]]


NO_ROW = REST6, REST6
"""A row of zeros, by the first and the second body."""


def by_bodies(rows: list[Any]) -> tuple[list[Vec], list[Vec]]:
    """The rows by the first and by the second body."""
    return [row[0] for row in rows], [row[1] for row in rows]


def both(g: Mat, k: Mat) -> Vec:
    """The entries of two poses, one after the other."""
    return vec(*[x for row in (*g, *k) for x in row])


@dataclass(frozen=True, eq=False)
class LinkedForm:
    """A linkage as numbers in memory, with the records that formulas read."""

    links: LinkedBodies  # the record that formulas read
    fixed: np.ndarray  # (rows, places), the numbers that do not change
    working_rows: int  # the number of rows of memory behind them
    joints: tuple[LinkedJoint, ...]  # by place, the joint
    has_loops: bool  # do joints close loops?

    @property
    def places(self) -> int:
        """The number of places in a row of `fixed`."""
        return int(self.fixed.shape[1])


def linked(linkage: Any) -> LinkedForm:
    """The form in memory of a linkage."""
    mechanism: Any = linkage
    acts, on_all = on_bodies(mechanism)
    counted, count = mechanism.constraint.counted, len(mechanism.links)
    ends = [(joint.first, -1 if joint.second is None else joint.second) for joint, _ in counted]
    geared: bool = getattr(mechanism, "geared", False)
    joints = joints_with_forces(mechanism, geared)
    meshes: dict[tuple[int, int], float] = mechanism.meshes if geared else {}
    hubs = hubs_in(ends)
    if any(all(b < 0 or b in hubs for b in ends[j]) for j, _ in meshes):
        hubs = []  # a joint of hubs alone has no block before them, and would be needed by what shares its rotor
    most = max(joint.joint.conditions for joint in joints) + int(geared)
    parts = -(-6 // most) if hubs else 0  # nodes of a hub
    places = max(count, len(joints) + parts * len(hubs))
    places = FEW if places <= FEW else EIGHT * -(-places // EIGHT)
    shared = {j: (SHARED + min(j, *[k for i, k in meshes if i == j]),) for j, _ in meshes}
    tables, order, ties, at_blocks = tables_of(
        [(*bodies_of, *shared.get(j, ())) for j, bodies_of in enumerate(ends)], hubs, parts, places
    )
    first_joint, further = joints_by_body(ends)
    acting = (
        tuple(dict.fromkeys(map(layout_of, acts))) if any(member.potentials or member.loads for member in acts) else ()
    )
    pushed = (on_all is not None and on_all.load is not None) or any(member.loads for member in acts)
    form: Any = LinkedBodies
    links = form(
        SE3(), tuple(dict.fromkeys(map(layout_of, joints))), acting, on_all, (), (), mechanism.constraint.rheonomic, geared,
        None, most, max([joint.joint.freedoms for joint in joints if joint.loads], default=0),
        any(joint.springs for joint in joints), pushed, True, float(count), float(len(joints)),
        parts, sides_of(ties), of_whole([len(further) // 3, *further]), *tables, order, len(meshes) > 0,
        of_whole([len(meshes), *[x for pair in meshes for x in (*pair, at_blocks[pair])]]),
        Table(np.array([*meshes.values(), 0.0])), float(most_neighbours(ends)),
    )  # fmt: skip
    full = any(np.ndim(np.array(link.inertia)) == 2 for link in mechanism.links)
    links = with_fields(links, work=work_of(links, full), one_body=BodyAmongJoints())
    numbers = np.zeros((links.work.width, places))
    of = columns(Planes(numbers, places), work=links.work).work.fields
    put_bodies(of, mechanism, first_joint, full)
    put_joints(of, mechanism, joints, ends, hubs, ties, links)
    put_kinds(of.joint_parameters, joints, links.kinds)
    put_kinds(of.force_parameters, acts, links.fields, of.acting)
    fixed = numbers[: of.failed_joint.rows.start]
    working_rows = links.work.width - len(fixed) + order.rows(most + links.freedoms, places)
    return LinkedForm(links, fixed, working_rows, tuple(joints), has_loops(ends))


def joints_by_body(ends: list[tuple[int, int]]) -> tuple[dict[tuple[int, int], tuple[int, float]], list[int]]:
    """By body and side its first joint there, and 1; and for every other one in a row the body, the joint, the side."""
    first_joint: dict[tuple[int, int], tuple[int, float]] = {}
    further: list[int] = []
    for j, bodies in enumerate(ends):
        for side, b in enumerate(bodies):
            if b >= 0 and (b, side) in first_joint:
                further += [b, j, side]
            elif b >= 0:
                first_joint[b, side] = j, 1.0
    return first_joint, further


def most_neighbours(ends: list[tuple[int, int]]) -> int:
    """The largest number of other joints that a joint has a body in common with."""
    joints_of: dict[int, set[int]] = {}
    for j, bodies in enumerate(ends):
        for b in bodies:
            joints_of.setdefault(b, set()).add(j)
    return max(len(set().union(*[joints_of[b] for b in bodies if b >= 0])) for bodies in ends) - 1


def put_bodies(of: Any, mechanism: Any, first_joint: dict[tuple[int, int], Any], full: bool) -> None:
    """Write what does not change of bodies; places behind them have the first one."""
    links, none = mechanism.links, (0, 0.0)
    for place in range(of.weight.array.shape[1]):
        J = inertia_of(links[place if place < len(links) else 0], full)
        write(of.inertia, place, J.ravel())
        write(of.inverse, place, (np.linalg.inv(J) if full else 1.0 / J).ravel())
        of.first_joints.put(place, (*first_joint.get((place, 0), none), *first_joint.get((place, 1), none)))
    write(of.weight, slice(len(links)), [link.mass * mechanism.gravity for link in links])
    write(of.counts, slice(len(links)), 1.0)


def put_joints(
    of: Any, mechanism: Any, joints: list[Any], ends: list[tuple[int, int]], hubs: list[int], ties: Any, system: Any
) -> None:
    """Write what does not change of joints; places behind them have the first one."""
    counted, ahead = mechanism.constraint.counted, 0
    places = of.ends.array.shape[1]
    for place in range(places):
        j = place if place < len(joints) else 0
        first, second = ends[j]
        alive = [float(i in counted[j][1]) for i in range(system.most)]
        if system.geared:
            light = mechanism.lightness.get(j, 0.0)
            alive = [*alive[:-1], float(light > 0.0)]
            write(of.lightness, place, light)
        of.ends.put(place, (first, max(second, 0), float(second >= 0), system.kinds.index(layout_of(joints[j]))))
        write(of.alive, place, alive)
        if hubs:
            write(of.off_hubs, place, [b not in hubs for b in ends[j]])
        tie = ties.get(place, (ahead if ahead < padded(places) else 0, 0.0, 0.0, 0.0))
        ahead = tie[0] + 1  # so that lanes without a tie ask for what lies beside that of others
        of.tie.put(place, tie)


def put_kinds(column: Any, records: list[Any], kinds: tuple[Any, ...], which: Any = None) -> None:
    """Write the parameters of records, in a part for each kind, where those of another kind have the first one of it.

    which : the column of the kinds, if there is one.
    """
    layouts = [layout_of(record) for record in records]
    for k, kind in enumerate(kinds):
        part, first = column.nth(k), layouts.index(kind)
        for place in range(part.array.shape[1]):
            i = place if place < len(records) else 0
            write(part, place, leaves(records[i if layouts[i] == kind else first], kind))
            if which is not None and layouts[i] == kind:
                which.put(place, k)


def joints_with_forces(mechanism: Any, geared: bool) -> list[Any]:
    """The joints of a linkage as LinkedJoints, each with its forces."""
    counted = mechanism.constraint.counted
    forces: list[list[tuple[Any, ...]]] = [[(), ()] for _ in counted]
    for which, group in enumerate(mechanism._at_joints()):
        for member in group:
            number = next(j for j, joint in enumerate(mechanism.joints) if joint is member.joint)
            forces[number][which] = tuple(replace(force, joint=0) for force in member.forces)
    kind: Any = GearedJoint if geared else LinkedJoint
    return [kind(replace(joint, first=0, second=1, name=None), *pair) for (joint, _), pair in zip(counted, forces)]


def write(column: Any, place: Any, numbers: Any) -> None:
    """Write numbers into the rows of a column, at a place or at several."""
    column.array[column.rows.start : column.rows.stop, place] = numbers


def on_bodies(linkage: Any) -> tuple[list[AtBody], OnAll | None]:
    """The fields and loads on single bodies, and the field and load on all of them by one formula."""
    parts: list[list[tuple[Any, ...]]] = [[(), ()] for _ in linkage.links]
    of_all: list[Any] = [None, None]
    for which, acting in enumerate((linkage.potential, linkage.load)):
        if isinstance(acting, (PotentialsOfBodies, ForcesOfBodies)):
            for b, force in zip(acting.bodies, acting.each):
                parts[b][which] = (force,)
        else:
            of_all[which] = acting
    acts = [AtBody(*part) for part in parts]
    if of_all == [None, None]:
        return acts, None
    derived = of_all[0] is not None and is_derived(bare(type(of_all[0]).force))
    return acts, OnAll(linkage.configurations, len(acts), of_all[0], of_all[1], derived)


def inertia_of(link: Any, full: bool) -> np.ndarray:
    """The moments of a body, (6,), or the matrix, (6, 6)."""
    J = np.array(link.inertia)
    if not full:
        return np.array([*J, *[link.mass] * 3])
    matrix = link.mass * np.eye(6)
    matrix[:3, :3] = J if J.ndim == 2 else np.diag(J)
    return matrix
