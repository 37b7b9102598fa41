"""Sparse sums over conditions and the bodies that they touch, and the elimination of their multipliers.

In a chain a condition shares bodies with those of the joints beside it only, so that work and memory grow as the number
of bodies.

Source: Golub and Van Loan, Matrix Computations, 4th ed., sections 4.1 and 4.3 (banded systems);
Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2nd ed., chapter 9 (symbolic
elimination).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...formulas import Vec, dot, vec, vectors


def connections(touches: Sequence[Sequence[int]], blocks: int) -> dict[str, Any]:
    """The sparsity pattern of conditions and its symbolic elimination, as fields by name.

    touches : by condition, the blocks of the algebra that it depends on.  Returns

    touches : by condition, its blocks, each with the place of the condition in `held` of the block.
    held : by block, its conditions, each with the place of the block in `touches` of the condition.
    shared : by condition, the conditions in its row after fill-in, each by the common blocks and the places there.
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
    """The rows of G by block, in the order of `held`."""
    return [[rows[a][i] for a, i in held] for held in system.held]


def speeds(system: Any, rows: Any, xi: Vec) -> list[Any]:
    """G xi, condition by condition.  xi : (dim,)."""
    parts = [xi[start:end] for start, end in system.places]
    return [
        vectors.sum([dot(row[i], parts[b]) for i, (b, _) in enumerate(ties)]) for row, ties in zip(rows, system.touches)
    ]


def joint(system: Any, led: list[Any], pushed: list[Any]) -> list[list[Any]]:
    """The structurally nonzero entries of C A^-1 B, by rows.

    led : the rows of C by block.  pushed : the columns of A^-1 B by block.
    """
    return [
        [
            vectors.sum([dot(led[b][i], pushed[b][j]) for b, i, j in common]) if len(common) > 0 else 0.0
            for common in row
        ]
        for row in system.shared
    ]


def yielding(system: Any, m: list[list[Any]]) -> list[list[Any]]:
    """m plus the diagonal of `yields`, the rates that conditions give way by to their multipliers."""
    matrix, yields = m, system.constraint.yields
    for k, (x, (diagonal, _, _, _)) in enumerate(zip(yields, system.elimination)):
        row = [y + x if i == diagonal else y for i, y in enumerate(m[k])]
        matrix = [row if i == k else other for i, other in enumerate(matrix)]
    return matrix


def solved_sparse(system: Any, m: list[list[Any]], rhs: list[Any]) -> tuple[Vec, list[Any]]:
    """m^-1 rhs by elimination in the given order, without pivoting, and the pivots.

    m : as of `joint`, near to a positive definite matrix.
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
