"""Sums over conditions and the bodies they touch, and elimination that knows which of them have no
body in common.

In a chain every condition meets those of the joints beside it alone, so that work and memory grow
as the number of bodies.

Source: Golub and Van Loan, Matrix Computations, 4th ed., sections 4.1 and 4.3 (banded systems);
Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2nd ed., chapter 9 (symbolic
elimination).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...formulas import Vec, dot, vec, vectors


def connections(touches: Sequence[Sequence[int]], blocks: int) -> dict[str, Any]:
    """The blocks and conditions that depend on each other.  touches : of each condition the blocks of the algebra that it depends
    on.

    touches : the same, each block with the place of the condition among those that hold it.
    held : of each block the conditions, each with the place of the block among those it touches.
    shared : of each condition those that elimination brings into its row, by their common blocks
    and their places there.
    elimination : of each condition the place of its pivot; below it the rows that change, with the
    place of the pivot's column in them and, for each of their entries, the place of the entry above
    it (-1: none); the places of what comes after the pivot, and what they are multiplied with when
    the system is solved backwards.
    """
    count = len(touches)
    held: list[list[int]] = [[] for _ in range(blocks)]
    for a, row in enumerate(touches):
        for b in row:
            held[b].append(a)
    places = [{a: i for i, a in enumerate(block)} for block in held]
    columns: list[set[int]] = [set().union(*[held[b] for b in row]) for row in touches]
    for k in range(count):
        later = {i for i in columns[k] if i > k}
        for i in later:
            columns[i] |= later
    rows = [sorted(row) for row in columns]
    at = [{k: q for q, k in enumerate(row)} for row in rows]
    shared, elimination = [], []
    for a, row in enumerate(rows):
        meets = [[b for b in touches[a] if b in touches[k]] for k in row]
        shared.append(
            tuple(tuple((b, places[b][a], places[b][k]) for b in common) for k, common in zip(row, meets, strict=True))
        )
        below = tuple(
            (i, at[i][a], tuple(at[a][j] if j > a and j in at[a] else -1 for j in rows[i])) for i in row if i > a
        )
        elimination.append((at[a][a], len(row), below, tuple((at[a][j], j) for j in row if j > a)))
    return {
        "touches": tuple(tuple((b, places[b][a]) for b in row) for a, row in enumerate(touches)),
        "held": tuple(tuple((a, tuple(touches[a]).index(b)) for a in block) for b, block in enumerate(held)),
        "shared": tuple(shared),
        "elimination": tuple(elimination),
    }


def pulled(system: Any, rows: Any, impulses: Vec) -> Vec:
    """G* l.  impulses : (m,);  returns (dim,)."""
    pulls = [[impulses[a] * rows[a][i] for a, i in held] for held in system.held]
    parts = [
        vectors.sum(pull) if len(pull) > 0 else [0.0] * (end - start)
        for pull, (start, end) in zip(pulls, system.places)
    ]
    return vec(*[x for part in parts for x in part])


def led(system: Any, rows: Any) -> list[Any]:
    """The rows of G block by block, as `held` says."""
    return [[rows[a][i] for a, i in held] for held in system.held]


def speeds(system: Any, rows: Any, xi: Vec) -> list[Any]:
    """G xi, condition by condition.  xi : (dim,)."""
    parts = [xi[start:end] for start, end in system.places]
    return [
        vectors.sum([dot(row[i], parts[b]) for i, (b, _) in enumerate(ties)]) for row, ties in zip(rows, system.touches)
    ]


def joint(system: Any, led: list[Any], pushed: list[Any]) -> list[list[Any]]:
    """C A^-1 B by rows, what is zero for good left out; from the rows of C and the columns of A^-1
    B block by block.
    """
    return [
        [
            vectors.sum([dot(led[b][i], pushed[b][j]) for b, i, j in common]) if len(common) > 0 else 0.0
            for common in row
        ]
        for row in system.shared
    ]


def yielding(system: Any, m: list[list[Any]]) -> list[list[Any]]:
    """m with what conditions yield to their own multipliers on its diagonal."""
    matrix, yields = m, system.constraint.yields
    for k, (x, (diagonal, _, _, _)) in enumerate(zip(yields, system.elimination)):
        row = [y + x if i == diagonal else y for i, y in enumerate(m[k])]
        matrix = [row if i == k else other for i, other in enumerate(matrix)]
    return matrix


def solved_sparse(system: Any, m: list[list[Any]], rhs: list[Any]) -> tuple[Vec, list[Any]]:
    """m^-1 rhs by elimination in the given order, and the pivots; m as `joint` makes it, and near
    to a positive matrix.
    """
    rows = [[*row, x] for row, x in zip(m, rhs)]
    for k, (diagonal, last, below, _) in enumerate(system.elimination):
        for i, place, above in below:
            factor = rows[i][place] / rows[k][diagonal]
            changed = [x if q < 0 else x - factor * rows[k][q] for x, q in zip(rows[i], above)]
            rows[i] = [*changed, rows[i][len(changed)] - factor * rows[k][last]]
    x: list[Any] = [0.0 for _ in rhs]
    for k in range(len(rhs) - 1, -1, -1):
        diagonal, last, _, beyond = system.elimination[k]
        remainder = rows[k][last]
        for place, j in beyond:
            remainder = remainder - rows[k][place] * x[j]
        x[k] = remainder / rows[k][diagonal]
    return vec(*x), [row[ends[0]] for row, ends in zip(rows, system.elimination)]
