"""Elimination of equations whose square blocks lie in memory, in an order that was found before the run.

`equations` has columns by name: of each node `residual`, the right side, `diagonal`, sizes of its equations by which their
independence is judged, and `solution`; and where the `blocks` begin.

Source: Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2nd ed., chapter 9.
"""

from __future__ import annotations

from typing import Any

from ...compiler.numbers.square_blocks import block_at, lead_block, lessen_block, put_block, wide
from ...formulas import Record, mat, record, vec
from ...formulas.elimination import inverted
from ...formulas.sites import padded
from ...formulas.tables import Table, of_whole, whole

BLOCKS = 3
"""Blocks at the place of a node: its own, and two of its tie to another one.  Further blocks follow behind all places."""


@record
class Elimination(Record):
    """An order in which nodes are eliminated.

    nodes : how many are eliminated.  pivots : in order, the node k and the range of its belows.  belows : the later node
    i, the blocks (i, k) and (k, i), and the range of its updates.  updates : the blocks (k, j) and (i, j) of
    (i, j) <- (i, j) - (i, k) (k, j).  filled : how many blocks are zero before, and which.  blocks : how many there are,
    beside those of places that tie no nodes.
    """

    nodes: float
    pivots: Table
    belows: Table
    updates: Table
    filled: Table
    blocks: float

    @classmethod
    def in_order(cls, order: Any, later_of: Any, blocks: dict[tuple[int, int], int], filled: list[int]) -> Elimination:
        """The elimination of nodes in order.  later_of : of each the nodes behind it that it is tied to by then.  blocks :
        by pair of nodes, the number of their block.
        """
        pivots, belows, updates = [], [], []  # type: list[int], list[int], list[int]
        for k, later in zip(order, later_of, strict=True):
            begin = len(belows) // 5
            pivots += [k, begin, begin + len(later)]
            for i in later:
                first = len(updates) // 2
                updates += [block for j in later for block in (blocks[k, j], blocks[i, j])]
                belows += [i, blocks[i, k], blocks[k, i], first, len(updates) // 2]
        tables = [of_whole([*table, 0]) for table in (pivots, belows, updates, [len(filled), *filled])]
        return cls(len(pivots) / 3, tables[0], tables[1], tables[2], tables[3], float(max(blocks.values()) + 1))

    def rows(self, n: int, places: int) -> int:
        """The number of rows of memory that blocks, n x n, take."""
        return -(-max(int(self.blocks), BLOCKS * padded(places)) * n * wide(n) // padded(places))


def fill(order: Elimination, equations: Any) -> None:
    """Set the blocks to zero that are not there before elimination."""
    n = equations.diagonal.width
    for p in range(whole(order.filled, 0)):
        put_block(equations.blocks, whole(order.filled, 1 + p), mat(*[vec(*[0.0] * n)] * n))


def factor(order: Elimination, sign: float, equations: Any, measure: Any = None) -> tuple[float, float, float]:
    """Eliminate blocks, in place; the first node whose equations depend on those before it, or -1; 1, or -1 if the
    determinant has another sign than that of `sign` times a positive matrix; and the sum of a `measure` of pivots, if there
    is one.
    """
    blocks, n = equations.blocks, equations.diagonal.width
    dependent, same_sign, total = -1.0, 1.0, 0.0
    for p in range(int(order.nodes)):
        k, begin, end = (whole(order.pivots, 3 * p + i) for i in range(3))
        before = equations.diagonal.at(k)
        if measure is not None:
            total = total + measure(k, block_at(blocks, BLOCKS * k, n))
        inverse, sign_kept, independent = inverted(block_at(blocks, BLOCKS * k, n), before, sign)
        same_sign = same_sign * sign_kept
        if not independent and dependent < 0.0:
            dependent = float(k)
        put_block(blocks, BLOCKS * k, inverse)
        for b in range(begin, end):
            lead_block(blocks, whole(order.belows, 5 * b + 2), inverse)
        for b in range(begin, end):
            left, first, last = (whole(order.belows, 5 * b + i) for i in (1, 3, 4))
            for u in range(first, last):
                right, place = whole(order.updates, 2 * u), whole(order.updates, 2 * u + 1)
                lessen_block(blocks, place, left, right, n)
    return dependent, same_sign, total


def substitute(order: Elimination, equations: Any) -> None:
    """Find solutions, with the blocks as `factor` has left them: forwards without those of later nodes, whose right sides
    are lessened by them, and back from the last node to the first.
    """
    blocks, residual, solution = equations.blocks, equations.residual, equations.solution
    count, n = int(order.nodes), equations.diagonal.width
    for p in range(count):
        k, begin, end = (whole(order.pivots, 3 * p + i) for i in range(3))
        x = block_at(blocks, BLOCKS * k, n) @ residual.at(k)
        solution.put(k, x)
        for b in range(begin, end):
            i, left = whole(order.belows, 5 * b), whole(order.belows, 5 * b + 1)
            residual.put(i, residual.at(i) - block_at(blocks, left, n) @ x)
    for back in range(count):
        k, begin, end = (whole(order.pivots, 3 * (count - 1 - back) + i) for i in range(3))
        for b in range(begin, end):
            i, right = whole(order.belows, 5 * b), whole(order.belows, 5 * b + 2)
            solution.put(k, solution.at(k) - block_at(blocks, right, n) @ solution.at(i))
