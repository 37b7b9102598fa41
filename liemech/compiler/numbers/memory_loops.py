"""Products of large matrices and large tables of sums: loops over memory on the stack instead of
instructions for every entry.

Each entry is the sum of its products in the order that formulas have, so the bits are the same.  Of
a single body several columns of a product are worked on side by side; in lanes every entry is a
vector anyway.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any

from llvmlite import ir

from ...formulas import sums as formulas
from ...formulas.numbers.complex_numbers import Complex
from ...formulas.vectors import Mat, Vec
from .counted import counted
from .ir_numbers import F64, I64, Emitter, Num
from .lookups import constants

LARGE = 300
"""Products of numbers from which a product of matrices becomes a loop: 6 x 6 matrices are written
out, 7 x 7 are not.
"""

TERMS = 200
"""Terms from which a table of sums becomes loops over the table: the bracket of so(8) is written
out, that of so(9) is not.
"""


class NumbersInMemory:
    """Floats on the stack: register r of number i lies at r * count + i."""

    def __init__(self, e: Emitter, count: int, varying: bool, numbers: Sequence[Any] = ()) -> None:
        self.e, self.b, self.count, self.varying = e, e.builder, count, varying
        self.type = e.type("f", varying)
        size = ir.Constant(I64, count * e.registers(varying))
        with self.b.goto_entry_block():
            self.first = self.b.alloca(self.type, size=size)
            self.first.align = 8 * e.width
        for i, x in enumerate(numbers):
            for register, value in enumerate(e.cast(x, "f", varying)):
                self.b.store(value, self._place(ir.Constant(I64, i), register))

    def _place(self, i: ir.Value, register: int) -> ir.Value:
        at = self.b.add(i, ir.Constant(I64, register * self.count)) if register else i
        return self.b.gep(self.first, [at], source_etype=self.type)

    def load(self, i: ir.Value, register: int, type_: ir.Type | None = None) -> ir.Value:
        """A register of a number.  type_ : of several numbers side by side."""
        place = self._place(i, register)
        return self.b.load(place, typ=type_ or self.type, align=8 if type_ else None)

    def store(self, value: ir.Value, i: ir.Value, register: int) -> None:
        self.b.store(value, self._place(i, register), align=8)

    def number(self, i: int) -> Num:
        registers = range(self.e.registers(self.varying))
        return self.e.num([self.load(ir.Constant(I64, i), r) for r in registers])


def _floats(numbers: Sequence[Any]) -> bool:
    """Whether numbers are floats, some of them of the run."""
    of_run = [isinstance(x, Num) for x in numbers]
    return any(of_run) and all(x.kind == "f" if run else type(x) is float for x, run in zip(numbers, of_run))


def _varying(numbers: Sequence[Any]) -> bool:
    return any(isinstance(x, Num) and x.varying for x in numbers)


# ------------------------------------------------------------------ products of matrices


def matmul(emitter: Emitter, function: Any, operands: tuple[Any, ...]) -> Any:
    """An operator applied to its operands, a product of matrices in a loop if they are large."""
    return product(emitter, *operands) if function is operator.matmul else function(*operands)


def product(emitter: Emitter, a: Any, b: Any) -> Any:
    """a @ b, of matrices and vectors."""
    left: list[Any]
    right: list[Any]
    if isinstance(b, Mat) and isinstance(a, (Mat, Vec)):
        left, right = [*a.rows] if isinstance(a, Mat) else [a], [*b.rows]
    elif isinstance(a, Mat) and isinstance(b, Vec):
        # the products of two numbers are the same either way
        left, right = [b], [*zip(*a.rows, strict=True)]
    else:
        return a @ b
    entries = [x for row in (*left, *right) for x in row]
    complex_ = all(isinstance(x, Complex) for x in entries)
    numbers = [y for x in entries for y in x.parts] if complex_ else entries
    n, m, p = len(left), len(right), len(right[0])
    if n * m * p < LARGE or {len(row) for row in left} != {m} or not _floats(numbers):
        return a @ b
    whole = _product(emitter, left, right, complex_, _varying(numbers))
    return Mat(*whole) if isinstance(a, Mat) and isinstance(b, Mat) else Vec(*whole[0])


def _product(e: Emitter, a: list[Any], b: list[Any], complex_: bool, varying: bool) -> list[list[Any]]:
    """The product of matrices given by rows."""
    builder, n, m, p = e.builder, len(a), len(b), len(b[0])
    alone = not varying and e.lanes == 1
    side = next(w for w in (8, 4, 2, 1) if w <= e.width and w < 2 * p) if alone else 1
    width = -(-p // side) * side
    blank = Complex(0.0, 0.0) if complex_ else 0.0
    wide_rows = [[*row, *[blank] * (width - p)] for row in b]
    A, B = _planes(e, a, complex_, varying), _planes(e, wide_rows, complex_, varying)
    C = [NumbersInMemory(e, n * width, varying) for _ in A]
    wide = ir.VectorType(F64, side) if side > 1 else e.type("f", varying)
    with counted(builder, I64(0), I64(n)) as i, counted(builder, I64(0), I64(width // side)) as block:
        row, j = builder.mul(i.index, ir.Constant(I64, m)), builder.mul(block.index, ir.Constant(I64, side))
        at = builder.add(builder.mul(i.index, ir.Constant(I64, width)), j)
        for r in range(e.registers(varying)):
            sums: list[ir.Value] = []
            for k in range(m):
                left = builder.add(row, ir.Constant(I64, k))
                right = builder.add(j, ir.Constant(I64, k * width))
                x = [e.spread(plane.load(left, r), side) for plane in A]
                y = [plane.load(right, r, wide) for plane in B]
                terms = _terms(builder, x, y)
                sums = [builder.fadd(s, t) for s, t in zip(sums, terms)] if k else terms
            for plane, s in zip(C, sums):
                plane.store(s, at, r)

    def entry(i: int, j: int) -> Any:
        parts = [plane.number(i * width + j) for plane in C]
        return Complex(*parts) if complex_ else parts[0]

    return [[entry(i, j) for j in range(p)] for i in range(n)]


def _planes(e: Emitter, rows: list[Any], complex_: bool, varying: bool) -> list[NumbersInMemory]:
    """The numbers of a matrix in memory; of a complex one the real parts and the imaginary parts."""
    entries = [x for row in rows for x in row]
    planes = zip(*[x.parts for x in entries]) if complex_ else [entries]
    return [NumbersInMemory(e, len(entries), varying, plane) for plane in planes]


def _terms(b: ir.IRBuilder, x: list[ir.Value], y: list[ir.Value]) -> list[ir.Value]:
    """The product of two numbers, real ones or complex ones by their parts."""
    if len(x) == 1:
        return [b.fmul(x[0], y[0])]
    real = b.fsub(b.fmul(x[0], y[0]), b.fmul(x[1], y[1]))
    return [real, b.fadd(b.fmul(x[0], y[1]), b.fmul(x[1], y[0]))]


# ------------------------------------------------------------------ tables of sums


def sums(e: Emitter, function: Any, table: Any, x: Any, y: Any) -> Any:
    """The vector of sums of a table, of `bilinear_map` or `antisymmetric_map`: a loop for all sums
    of the same number of terms.
    """
    by_length: dict[int, list[int]] = {}
    for row, terms in enumerate(table):
        by_length.setdefault(len(terms), []).append(row)
    written_out = sum(map(len, table)) < TERMS or 2 * len(by_length) > len(table)
    if written_out or not _floats([*x, *y]):
        return function(table, x, y)
    varying = _varying([*x, *y])
    X, Y = NumbersInMemory(e, len(x), varying, x), NumbersInMemory(e, len(y), varying, y)
    result: list[Any] = [0.0] * len(table)
    for length, rows in by_length.items():
        if length:
            terms = [term for row in rows for term in table[row]]
            totals = _sums(e, function is formulas.antisymmetric_map, terms, len(rows), X, Y)
            for n, k in enumerate(rows):
                result[k] = totals.number(n)
    return Vec(*result)


def _sums(
    e: Emitter, antisymmetric: bool, terms: list[Any], count: int, X: NumbersInMemory, Y: NumbersInMemory
) -> NumbersInMemory:
    """Sums, `count` of them, of equally many terms (c, i, j): of c x_i y_j, or of c (x_i y_j - x_j y_i)."""
    b, length = e.builder, len(terms) // count
    factors = constants(e, [float(c) for c, _, _ in terms], F64)
    places = constants(e, [k for _, i, j in terms for k in (i, j)], I64)
    Z = NumbersInMemory(e, count, X.varying)

    def loaded(table: ir.Value, at: ir.Value, type_: ir.Type) -> ir.Value:
        return b.load(b.gep(table, [at], source_etype=type_), typ=type_)

    with counted(b, I64(0), I64(count)) as turn:
        first = b.mul(turn.index, ir.Constant(I64, length))
        products: list[list[ir.Value]] = [[] for _ in range(e.registers(X.varying))]
        for k in range(length):
            term = b.add(first, ir.Constant(I64, k))
            c = e.cast(e.num([loaded(factors, term, F64)]), "f", X.varying)[0]
            twice = b.mul(term, ir.Constant(I64, 2))
            i = loaded(places, twice, I64)
            j = loaded(places, b.add(twice, ir.Constant(I64, 1)), I64)
            for r, registers in enumerate(products):
                product = b.fmul(X.load(i, r), Y.load(j, r))
                if antisymmetric:
                    product = b.fsub(product, b.fmul(X.load(j, r), Y.load(i, r)))
                # by 1 and -1 too: these products are exact
                registers.append(b.fmul(c, product))
        for r, registers in enumerate(products):
            total = formulas.total([e.num([v]) for v in registers])
            Z.store(total.value, turn.index, r)
    return Z
