"""Poses and velocities of bodies from the coordinates and rates of their joints; conditions that
follow from others.

Source: Featherstone, Rigid Body Dynamics Algorithms (2008), sections 4.1 and 8.1 (spanning trees,
loops); Golub and Van Loan, Matrix Computations, 4th ed., section 5.4 (rank).
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import Any

import numpy as np

from ..errors import InvalidInput, NoConvergence
from ..formulas import mat, vec
from ..formulas.vectors import small
from .elimination_order import has_loops
from .joints import both
from .points_and_axes import GROUND

PATIENCE = 50
"""Corrections after which the poses of a loop are not looked for any more."""

CLOSED = 1e-12
"""A correction below this part of the sizes is rounding."""

MISSED = 1e-9
"""The part of its terms by which a condition, an angle or a rate may be missed."""

DEPENDENT = 1e-9
"""Rows of which no more than this part is their own follow from the rows before them."""


def hung_from_each_other(linkage: Any, coordinates: dict[int, np.ndarray], begin: Any = None) -> np.ndarray:
    """Poses along a spanning tree of joints, each body placed by a joint from one that has its pose, (N, 4, 4); the
    other joints close loops.

    Of bodies that are not joined to the ground the first is in the origin, or at its pose in `begin`, (N, 4, 4).
    coordinates : by the numbers of joints; others are zero.
    """
    poses: dict[int | None, Any] = {None: GROUND}
    group, at = linkage.configurations.factors[0], joints_by_body(linkage)
    roots: list[int | None] = [None, *range(len(linkage.links))]
    for root in roots:
        if root is not None and root in poses:
            continue
        poses[root] = GROUND if root is None or begin is None else mat(*[vec(*row) for row in begin[root].tolist()])
        near = list(at.get(root, []))
        heapify(near)
        while near:
            joint = linkage.joints[number := heappop(near)]
            placed = joint.first in poses, joint.second in poses
            if all(placed) or not joint.places:
                continue
            q = vec(*coordinates.get(number, np.zeros(joint.freedoms)).tolist())
            relative = joint.relative(q)
            if placed[1]:
                poses[other := joint.first] = poses[joint.second] @ relative
            else:
                poses[other := joint.second] = poses[joint.first] @ group.inverse(relative)
            for neighbour in at[other]:
                heappush(near, neighbour)
    return np.array([poses[b] for b in range(len(linkage.links))])


def joints_by_body(linkage: Any) -> dict[int | None, list[int]]:
    """The numbers of the joints at each body, and at the ground, None."""
    at: dict[int | None, list[int]] = {}
    for number, joint in enumerate(linkage.joints):
        for body in (joint.first, joint.second):
            at.setdefault(body, []).append(number)
    return at


def hangs(linkage: Any) -> bool:
    """Whether the bodies form a tree from the ground, with joints whose coordinates determine their poses."""
    joints = [joint for joint in linkage.joints if joint.places or joint.conditions]
    ends = [(joint.first, -1 if joint.second is None else joint.second) for joint in joints]
    return len(ends) == len(linkage.links) and not has_loops(ends) and all(joint.places for joint in joints)


def hung_velocities(linkage: Any, g: Any, rates: dict[int, np.ndarray]) -> np.ndarray:
    """The velocities of bodies that hang from the ground, (6 N,), each from the one that it hangs from:
    G xi = -dc/dt, and the motions of the joint at these rates.
    """
    velocities: dict[int | None, np.ndarray] = {None: np.zeros(6)}
    at = joints_by_body(linkage)
    todo: list[int | None] = [None]
    while todo:
        body = todo.pop()
        for number in at[body]:
            joint = linkage.joints[number]
            other = joint.first if body == joint.second else joint.second
            if other in velocities or not joint.places:
                continue
            poses = both(joint, g)
            pairs = [*joint.rows(*poses)]
            goal = [-x for x in joint.paces(*poses) or [0.0] * joint.conditions]
            if number in rates:
                pairs += joint.motions(*poses)
                paces = joint.paces_of_motions(*poses) or [0.0] * joint.freedoms
                goal += [x - y for x, y in zip(rates[number], paces)]
            by_first, by_second = (np.array([pair[side] for pair in pairs]) for side in range(2))
            by_other, by_body = (by_first, by_second) if other == joint.first else (by_second, by_first)
            velocities[other] = np.linalg.solve(by_other, np.array(goal) - by_body @ velocities[body])
            todo.append(other)
    return np.concatenate([velocities[b] for b in range(len(linkage.links))])


def rows_of_motions(linkage: Any, g: Any, numbers: list[int]) -> np.ndarray:
    """The rows of the motions of joints, one after another, (k, 6 N)."""
    rows = []
    for number in numbers:
        joint = linkage.joints[number]
        for first, second in joint.motions(*both(joint, g)):
            row = np.zeros(6 * len(linkage.links))
            row[6 * joint.first : 6 * joint.first + 6] += np.array(first)
            if joint.second is not None:
                row[6 * joint.second : 6 * joint.second + 6] += np.array(second)
            rows.append(row)
    return np.array(rows).reshape(len(rows), 6 * len(linkage.links))


def closed(linkage: Any, poses: np.ndarray, coordinates: dict[int, np.ndarray]) -> np.ndarray:
    """The poses nearest to these, by small corrections, at which loops are closed and joints have
    the coordinates that are wanted, (N, 4, 4).
    """
    group, g, units = linkage.configurations, small(poses.ravel()), linkage.displacements
    root = np.sqrt(np.abs(linkage._inverse.diagonal()))
    numbers, before = sorted(coordinates), np.inf
    for _ in range(PATIENCE):
        off = [*np.array(linkage.constraint.value(g))]
        for number in numbers:
            joint = linkage.joints[number]
            apart = np.array(joint.coordinates(*both(joint, g))) - coordinates[number]
            turning = [*joint.angles]
            apart[turning] = np.remainder(apart[turning] + np.pi, 2 * np.pi) - np.pi
            off += [*apart]
        rows = np.concatenate([np.array(linkage.jacobian(g)), rows_of_motions(linkage, g, numbers)])
        reach = np.linalg.norm(rows * units, axis=1)
        x = -root * _least_squares(rows * root, np.array(off))
        change = float(np.abs(x / units).max())
        g = group.compose_exp(g, vec(*x.tolist()))
        far = max(1.0, float(np.abs(linkage.poses(g)[:, :3, 3] / units[3::6, None]).max()))
        if change <= CLOSED * far or not change < np.inf:
            break
        if change >= before and before < 1e-6:
            break
        before = change
    missed = np.abs(off)
    complaint = f"they miss by {missed.max():.2g}"
    if (missed <= (MISSED + CLOSED * far) * reach).all():
        complaint = linkage.turned_over(g)
    if complaint:
        raise NoConvergence(
            "Linkage: no poses found close by at which the loops are closed and the joints have "
            f"these coordinates ({complaint}); give poses that are closer, near=poses"
        )
    return np.array(g).reshape(-1, 4, 4)


def _least_squares(rows: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The shortest x with rows x = b, whatever the unit of each row: those that follow from others do so
    beside their lengths.
    """
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(rows / lengths[:, None], b / lengths, rcond=DEPENDENT)[0])


def velocity_with(linkage: Any, g: Any, rates_of: dict[int, np.ndarray]) -> np.ndarray:
    """Of the velocities that the joints allow and that have these rates, that of the least kinetic
    energy, (6 N,).
    """
    numbers = sorted(rates_of)
    G, D = np.array(linkage.jacobian(g)), rows_of_motions(linkage, g, numbers)
    rates = np.concatenate([np.zeros(len(G)), *[rates_of[number] for number in numbers]])
    if linkage.rheonomic:  # by given motions alone
        rates[: len(G)] -= np.array(linkage.constraint.paces(g))
        begin = len(G)
        for number in numbers:
            joint = linkage.joints[number]
            paces = joint.paces_of_motions(*both(joint, g))
            rates[begin : begin + len(paces)] -= np.array(paces)
            begin += joint.freedoms
    inverse = np.asarray(linkage._inverse.todense() if linkage._sparse else linkage._inverse)
    root = np.linalg.cholesky(inverse)
    rows = np.concatenate([G, D])
    xi = root @ _least_squares(rows @ root, rates)
    missed = np.abs(rows @ xi - rates)
    units = linkage.displacements
    if (missed > MISSED * (np.abs(rates) + np.linalg.norm(rows * units, axis=1) * np.abs(xi / units).max())).any():
        raise InvalidInput(
            "Linkage.state: the joints do not allow these rates together (they miss by "
            f"{missed.max():.2g}); leave out those that follow from others"
        )
    return np.asarray(xi)


def independent_rows(linkage: Any, g: Any) -> tuple[tuple[int, ...], ...]:
    """For each joint the conditions that are independent of those of the joints before it, in the metric G J^-1 G*."""
    inverse = np.asarray(linkage._inverse.todense() if linkage._sparse else linkage._inverse)
    rows = np.array(linkage.jacobian(g)) @ np.linalg.cholesky(inverse)
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    independent: list[tuple[int, ...]] = []
    basis = np.zeros((0, rows.shape[1]))
    begin = 0
    for _, counted in linkage.constraint.counted:
        chosen, left = [], {i: rows[begin + place] for place, i in enumerate(counted)}
        begin += len(left)
        while left:
            for _ in range(2):  # the second time for rounding
                left = {i: row - basis.T @ (basis @ row) for i, row in left.items()}
            best = max(left, key=lambda i: float(np.linalg.norm(left[i])))
            length = float(np.linalg.norm(left[best]))
            if length <= DEPENDENT:
                break
            chosen.append(best)
            basis = np.concatenate([basis, left.pop(best)[None] / length])
        independent.append(tuple(sorted(chosen)))
    return tuple(independent)
