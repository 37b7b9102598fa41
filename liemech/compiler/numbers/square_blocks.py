"""Square blocks of numbers, each in one piece of memory with its rows one behind the other, for elimination
block by block: a loop over sites writes those of every site, and products are made row by row.

They begin where a column does, which has no numbers of its own.
"""

from __future__ import annotations

import numpy as np

from ...formulas.columns import Column
from ...formulas.sites import present_site
from ...formulas.vectors import Mat, Vec


def wide(n: int) -> int:
    """The numbers from one row of a block to the next: n, rounded up to 4 or a multiple of 8."""
    return 4 if n <= 4 else 8 * -(-n // 8)


def _rows(blocks: Column, i: int, n: int) -> np.ndarray:
    """The rows of block number i, (n, n)."""
    begin, width = i * n * wide(n), wide(n)
    numbers = blocks.array[blocks.rows.start :].reshape(-1)  # type: ignore[attr-defined]
    rows: np.ndarray = numbers[begin : begin + n * width].reshape(n, width)
    return rows[:, :n]


def block_at(blocks: Column, i: int, n: int) -> Mat:
    """Block number i, as an n x n matrix."""
    return Mat(*[Vec(*row) for row in _rows(blocks, i, n).tolist()])


def put_block(blocks: Column, i: int, block: Mat) -> None:
    """Set block number i, outside of loops over sites."""
    _rows(blocks, i, len(block))[:] = [[*row] for row in block]


def save_block(blocks: Column, count: int, k: int, block: Mat) -> None:
    """Set block number k of this site, of `count` blocks for each, after the last meeting."""
    put_block(blocks, count * present_site() + k, block)


def lead_block(blocks: Column, i: int, a: Mat) -> None:
    """Multiply block number i by a matrix from the left, outside of loops over sites."""
    put_block(blocks, i, a @ block_at(blocks, i, len(a)))


def lessen_block(blocks: Column, i: int, j: int, k: int, n: int) -> None:
    """Subtract from block number i the product of two others, outside of loops over sites."""
    product = block_at(blocks, j, n) @ block_at(blocks, k, n)
    put_block(blocks, i, block_at(blocks, i, n) - product)
