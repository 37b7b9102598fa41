"""Square blocks in native code: a row of one is a vector.  The sum over k of a_ik B_k is added up for all
entries of row i at once, each in the order that formulas have, so the bits are the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from ...formulas.vectors import Mat, Vec
from .ir_numbers import F64, I32, I64
from .square_blocks import block_at, lead_block, lessen_block, put_block, save_block, wide


class SquareBlocks:
    """The words of `square_blocks` in native code."""

    def __init__(self, loops: Any) -> None:
        self.loops, self.e, self.b = loops, loops.e, loops.b
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            block_at: self.at,
            put_block: self.put,
            save_block: self.save,
            lead_block: self.lead,
            lessen_block: self.lessen,
        }

    def _place(self, blocks: Any, i: Any, n: int) -> ir.Value:
        """The address of block number i, n x n."""
        size = self.b.mul(self.e.cast(i, "i", False)[0], I64(n * wide(n)))
        return self.b.gep(blocks.array.at(blocks.rows.start), [size], source_etype=F64)

    def _row(self, place: ir.Value, i: int, n: int) -> tuple[ir.Value, Any]:
        """The address of a row of a block, and the vector type of the row."""
        type_ = ir.VectorType(F64, wide(n))
        row = self.b.gep(place, [I64(i * wide(n))], source_etype=F64)
        return self.b.bitcast(row, type_.as_pointer()), type_

    def _load_row(self, place: ir.Value, i: int, n: int) -> ir.Value:
        row, type_ = self._row(place, i, n)
        return self.b.load(row, align=8, typ=type_)

    def _number(self, place: ir.Value, i: int, j: int, n: int) -> ir.Value:
        at = self.b.gep(place, [I64(i * wide(n) + j)], source_etype=F64)
        return self.b.load(at, align=8, typ=F64)

    def at(self, blocks: Any, i: Any, n: int) -> Mat:
        """The matrix in block number i, n x n."""
        place = self._place(blocks, i, n)
        return Mat(*[Vec(*[self.e.num([self._number(place, k, j, n)]) for j in range(n)]) for k in range(n)])

    def put(self, blocks: Any, i: Any, block: Mat) -> None:
        """Store a matrix as block number i, number by number."""
        n, place = len(block), self._place(blocks, i, len(block))
        for k, row in enumerate(block):
            for j, x in enumerate(row):
                at = self.b.gep(place, [I64(k * wide(n) + j)], source_etype=F64)
                self.b.store(self.e.cast(x, "f", False)[0], at, align=8)

    def save(self, blocks: Any, count: int, k: int, block: Mat) -> None:
        """Store block number k of every site of the lanes.  A register has one number of all of them, a row of a block the
        numbers of one: they are transposed.
        """
        b, e, n = self.b, self.e, len(block)
        loop = self.loops.present_loop("save_block")
        loop.saved, width = True, wide(n)
        first = b.add(b.mul(loop.passes[-1].index, I64(count)), I64(k))
        begins = blocks.array.at(blocks.rows.start)
        several = e.lanes > 1
        zero = e.cast(0.0, "f", several)
        for i, row in enumerate(block):
            numbers = [e.cast(x, "f", several) for x in row]
            numbers += [zero] * (width - n)
            for r in range(len(zero)):
                vectors = [x[r] for x in numbers]
                lanes = e.width if several else 1
                if not several:
                    vectors = [self.e.spread(x, 2) for x in vectors]
                while len(vectors) > 1:  # two halves are interleaved, until the numbers of a lane lie together
                    half = len(vectors) // 2
                    size = vectors[0].type.count
                    turn = [x for l in range(size) for x in (l, size + l)]
                    mask = ir.Constant(ir.VectorType(I32, 2 * size), turn)
                    vectors = [b.shuffle_vector(x, y, mask) for x, y in zip(vectors[:half], vectors[half:])]
                for lane in range(lanes):
                    of_lane = [lane * width + j for j in range(width)]
                    mask = ir.Constant(ir.VectorType(I32, width), of_lane)
                    site = b.add(first, I64((r * lanes + lane) * count))
                    begin = b.gep(begins, [b.mul(site, I64(n * width))], source_etype=F64)
                    lane_row = b.shuffle_vector(vectors[0], vectors[0], mask)
                    b.store(lane_row, self._row(begin, i, n)[0], align=8)

    def _combined(self, a: list[ir.Value], rows: list[ir.Value]) -> ir.Value:
        """The sum of a_k B_k."""
        width, total = rows[0].type.count, None
        for x, row in zip(a, rows):
            term = self.b.fmul(self.e.spread(x, width), row)
            total = term if total is None else self.b.fadd(total, term)
        return total

    def lead(self, blocks: Any, i: Any, a: Mat) -> None:
        """B_i <- A B_i, row by row."""
        n, place = len(a), self._place(blocks, i, len(a))
        rows = [self._load_row(place, k, n) for k in range(n)]
        products = [self._combined([self.e.cast(x, "f", False)[0] for x in row], rows) for row in a]
        for k, row in enumerate(products):
            self.b.store(row, self._row(place, k, n)[0], align=8)

    def lessen(self, blocks: Any, i: Any, j: Any, k: Any, n: int) -> None:
        """B_i <- B_i - B_j B_k, row by row."""
        place, left, right = [self._place(blocks, x, n) for x in (i, j, k)]
        rows = [self._load_row(right, m, n) for m in range(n)]
        for m in range(n):
            a = [self._number(left, m, l, n) for l in range(n)]
            row = self.b.fsub(self._load_row(place, m, n), self._combined(a, rows))
            self.b.store(row, self._row(place, m, n)[0], align=8)
