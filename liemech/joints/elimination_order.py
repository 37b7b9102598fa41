"""The order in which the joints of a linkage are eliminated, and the blocks of its equations in memory: an LDU
factorisation with little fill-in.

Source: Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2nd ed., chapter 9; Featherstone, Rigid Body
Dynamics Algorithms (2008), section 6.5 (trees).
"""

from __future__ import annotations

import heapq
from collections import Counter
from typing import Any

import numpy as np

from ..formulas.sites import padded
from ..formulas.tables import Table, of_whole
from ..rooms.sites.block_elimination import BLOCKS, Elimination


def eliminated_in(ends: list[tuple[int, int]]) -> tuple[tuple[int, ...], list[list[int]]]:
    """An order of elimination, and for each joint in it the later joints that it is tied to by then, its row of the
    factor.

    Joints come first that cause no fill-in since only one of their bodies has other joints left: all ends of a tree in
    turn, so that neighbours in the order do not wait for each other.  Then, in loops, always a joint of least degree.

    ends : by joint, its bodies; -1 is the ground.
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
    """Whether joints close loops, also by the ground."""
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
"""Joints from which a body is a hub; blocks for all pairs of fewer joints take less time."""


def hubs_in(ends: list[tuple[int, int]]) -> list[int]:
    """The bodies with so many joints that their motion is an unknown beside the impulses, which saves fill-in."""
    count = Counter(b for bodies in ends for b in bodies if b >= 0)
    return sorted(b for b, joints in count.items() if joints >= HUB)


def eliminated_with_hubs(
    ends: list[tuple[int, int]], hubs: list[int], parts: int
) -> tuple[tuple[int, ...], list[list[int]]]:
    """As `eliminated_in`, of nodes: first joints, as if hubs were the ground, then the motions of hubs, whose numbers
    follow those of joints, then joints between hubs; of both one of least degree first.
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
) -> tuple[list[Table], Elimination, dict[int, Tie], dict[tuple[int, int], int]]:
    """The tables of borders and couplings; the elimination; by joint, its tie to another joint, whose blocks lie at the
    place of the joint; by pair of nodes, the number of its block.

    ends : by joint, its bodies and behind them the rotor that it shares with others, if there is one.

    borders : the number of joints at hubs, and of each the joint, its side at the hub, and for each part of the motion
    of the hub the blocks (joint, part) and (part, joint). couplings : their number, and of each the joints j and k,
    their sides at a body that they share, the block, and 0; 1 if the product is added to the block.
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
    filled: list[int] = []
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
        tie_j, tie_k = ties.get(j, NO_TIE), ties.get(k, NO_TIE)
        if k == tie_j[0] or j == tie_k[0]:
            tied = [*map(int, tie_j[1:3] if k == tie_j[0] else tie_k[2:0:-1])]
            couplings += [[j, k, *s, block, 1] for s in common if [*s] != tied]
            continue
        filled += [] if common else [block]
        couplings += [[j, k, *sides, block, min(turn, 1)] for turn, sides in enumerate(common)]
    tables = [of_whole([len(rows), *np.ravel(rows), 0]) for rows in (borders, couplings)]
    return tables, Elimination.in_order(order, filling, blocks, filled), ties, blocks


Tie = tuple[int, float, float, float]
"""Another joint, the sides of both at a body that they share, and 1."""

NO_TIE: Tie = (-1, 0.0, 0.0, 0.0)


def ties_of(ends: list[tuple[int, int]], pairs: list[tuple[int, int]]) -> dict[int, Tie]:
    """For each joint at most one of its pairs, whose blocks then lie at its place.  In chains and trees, where every
    body is the first of one joint of a pair and the second of the other, all ties are on one side.
    """
    tied = [(*pair, sides) for pair in pairs for sides in _sides(ends[pair[0]], ends[pair[1]])[:1]]
    choices: list[dict[int, Tie]] = []
    for sides_of_ties in ((0, 1), (1, 0), None):
        ties: dict[int, Tie] = {}
        for k, i, sides in tied:
            for owner, other, (s, t) in ((k, i, sides), (i, k, sides[::-1])):
                if sides_of_ties in (None, (s, t)) and owner not in ties:
                    ties[owner] = other, float(s), float(t), 1.0
                    break
        choices.append(ties)
    return max(choices, key=len)


def sides_of(ties: dict[int, Tie]) -> tuple[int, int]:
    """The two sides at which joints and their ties have their body, if all agree; else -1."""
    numbers = [{int(tie[side]) for tie in ties.values()} for side in (1, 2)]
    first, second = (of_side.pop() if len(of_side) == 1 else -1 for of_side in numbers)
    return first, second


def _sides(one: tuple[int, int], other: tuple[int, int]) -> list[tuple[int, int]]:
    """The sides of two joints on which they have a body in common."""
    return [(s, t) for s, b in enumerate(one[:2]) for t, c in enumerate(other[:2]) if b == c and b >= 0]
