"""Products of large matrices and large tables of sums: loops over buffers on the stack instead of
instructions for every entry.

Each entry is the sum of its products in the order that formulas have, so the bits are the same.  Of
a single body several columns of a product are worked on side by side; in lanes every entry is a
vector anyway.
"""

from __future__ import annotations

import functools
import hashlib
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir

from ..formulas import sums as formulas
from ..formulas import tables
from ..formulas.complex_numbers import Complex
from ..formulas.pytree import Layout, build, carried_layout, leaves
from ..formulas.tables import Table
from ..formulas.vectors import Mat, Vec
from .ir_numbers import F64, HUGE, I32, I64, TYPES, Emitter, Num

LARGE = 300
"""Products of numbers from which a product of matrices becomes a loop: 6 x 6 matrices are written
out, 7 x 7 are not.
"""

TERMS = 200
"""Terms from which a table of sums becomes loops over the table: the bracket of so(8) is written
out, that of so(9) is not.
"""


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
    whole = _product(emitter, left, right)
    if whole is None:
        return a @ b
    return Mat(*whole) if isinstance(a, Mat) and isinstance(b, Mat) else Vec(*whole[0])


def _product(e: Emitter, a: list[Any], b: list[Any]) -> list[list[Any]] | None:
    """The product of matrices given by rows; None if it is to be written out."""
    n, m, p = len(a), len(b), len(b[0])
    entries = [x for row in (*a, *b) for x in row]
    if n * m * p < LARGE or {len(row) for row in a} != {m} or not any(_unknown(x) for x in entries):
        return None
    complex_ = all(isinstance(x, Complex) for x in entries)
    numbers = [y for x in entries for y in (x.parts if complex_ else (x,))]
    if not all(type(y) is float or (isinstance(y, Num) and y.kind == "f") for y in numbers):
        return None
    varying = any(isinstance(y, Num) and y.varying for y in numbers)
    builder, planes = e.builder, 2 if complex_ else 1
    side = (
        1 if varying or e.lanes > 1 else next(w for w in (8, 4, 2, 1) if w <= e.width and w < 2 * p)
    )
    columns = -(-p // side) * side
    type_ = e.type("f", varying)
    registers = e.registers(varying)

    def buffer(rows: int, width: int) -> ir.Value:
        count = ir.Constant(I64, rows * width * registers * planes)
        with builder.goto_entry_block():
            place = builder.alloca(type_, size=count)
            place.align = 8 * e.width
        return place

    def at(
        place: ir.Value, index: Any, plane: int, register: int, rows: int, width: int
    ) -> ir.Value:
        """The address of a number, given the index of its entry."""
        offset = (plane * registers + register) * rows * width
        index = (
            ir.Constant(I64, index + offset)
            if isinstance(index, int)
            else builder.add(index, ir.Constant(I64, offset))
        )
        return builder.gep(place, [index], source_etype=type_)

    def fill(place: ir.Value, rows: list[Any], width: int) -> None:
        for i, row in enumerate(rows):
            for j in range(width):
                x: Any = row[j] if j < len(row) else 0.0 if not complex_ else Complex(0.0, 0.0)
                for plane, y in enumerate(x.parts if complex_ else (x,)):
                    for r, v in enumerate(e.cast(y, "f", varying)):
                        builder.store(v, at(place, i * width + j, plane, r, len(rows), width))

    wide = type_ if side == 1 else ir.VectorType(F64, side)

    def spread(v: ir.Value) -> ir.Value:
        if side == 1:
            return v
        undefined = ir.Constant(wide, ir.Undefined)
        first = builder.insert_element(undefined, v, ir.Constant(I32, 0))
        return builder.shuffle_vector(
            first, undefined, ir.Constant(ir.VectorType(I32, side), [0] * side)
        )

    A, B, C = buffer(n, m), buffer(m, columns), buffer(n, columns)
    fill(A, a, m)
    fill(B, b, columns)
    before, head, done = builder.block, builder.append_basic_block(), builder.append_basic_block()
    builder.branch(head)
    builder.position_at_end(head)
    i, j = builder.phi(I64), builder.phi(I64)  # the row, and the first of the columns worked on
    i.add_incoming(ir.Constant(I64, 0), before)
    j.add_incoming(ir.Constant(I64, 0), before)
    row = builder.mul(i, ir.Constant(I64, m))
    for r in range(registers):
        sums: list[ir.Value] = []
        for k in range(m):
            x = [
                spread(
                    builder.load(
                        at(A, builder.add(row, ir.Constant(I64, k)), plane, r, n, m), typ=type_
                    )
                )
                for plane in range(planes)
            ]
            y = [
                builder.load(
                    at(B, builder.add(j, ir.Constant(I64, k * columns)), plane, r, m, columns),
                    typ=wide,
                    align=8,
                )
                for plane in range(planes)
            ]
            if complex_:
                terms = [
                    builder.fsub(builder.fmul(x[0], y[0]), builder.fmul(x[1], y[1])),
                    builder.fadd(builder.fmul(x[0], y[1]), builder.fmul(x[1], y[0])),
                ]
            else:
                terms = [builder.fmul(x[0], y[0])]
            sums = [builder.fadd(s, t) for s, t in zip(sums, terms)] if k else terms
        place = builder.add(builder.mul(i, ir.Constant(I64, columns)), j)
        for plane, s in enumerate(sums):
            builder.store(s, at(C, place, plane, r, n, columns), align=8)
    next_j = builder.add(j, ir.Constant(I64, side))
    full = builder.icmp_signed("==", next_j, ir.Constant(I64, columns))
    next_i = builder.select(full, builder.add(i, ir.Constant(I64, 1)), i)
    i.add_incoming(next_i, builder.block)
    j.add_incoming(builder.select(full, ir.Constant(I64, 0), next_j), builder.block)
    builder.cbranch(builder.icmp_signed("==", next_i, ir.Constant(I64, n)), done, head)
    builder.position_at_end(done)

    def entry(i: int, j: int) -> Any:
        parts = [
            e.num(
                [
                    builder.load(at(C, i * columns + j, plane, r, n, columns), typ=type_)
                    for r in range(registers)
                ]
            )
            for plane in range(planes)
        ]
        return Complex(*parts) if complex_ else parts[0]

    return [[entry(i, j) for j in range(p)] for i in range(n)]


def sums(e: Emitter, function: Any, table: Any, x: Any, y: Any) -> Any:
    """The vector of sums of a table, of `bilinear_map` or `antisymmetric_map`: a loop for all sums
    of the same number of terms.
    """
    by_length: dict[int, list[int]] = {}
    for row, terms in enumerate(table):
        by_length.setdefault(len(terms), []).append(row)
    numbers = [*x, *y]
    known = all(type(v) is float or (isinstance(v, Num) and v.kind == "f") for v in numbers)
    if (
        sum(map(len, table)) < TERMS
        or 2 * len(by_length) > len(table)
        or not known
        or not any(map(_unknown, numbers))
    ):
        return function(table, x, y)
    builder, varying = e.builder, any(isinstance(v, Num) and v.varying for v in numbers)
    type_, registers = e.type("f", varying), e.registers(varying)
    result: list[Any] = [0.0] * len(table)

    def place(count: int) -> ir.Value:
        with builder.goto_entry_block():
            made = builder.alloca(type_, size=ir.Constant(I64, count * registers))
            made.align = 8 * e.width
        return made

    def at(buffer: ir.Value, index: ir.Value, register: int) -> ir.Value:
        """The address of a register of a number."""
        index = builder.add(
            builder.mul(index, ir.Constant(I64, registers)), ir.Constant(I64, register)
        )
        return builder.gep(buffer, [index], source_etype=type_)

    def buffer(v: Any) -> ir.Value:
        made = place(len(v))
        for i, number in enumerate(v):
            for r, value in enumerate(e.cast(number, "f", varying)):
                builder.store(
                    value,
                    builder.gep(made, [ir.Constant(I64, i * registers + r)], source_etype=type_),
                )
        return made

    def coefficient(v: ir.Value) -> ir.Value:
        """A number of the table, in every lane."""
        return e.cast(e.num([v]), "f", varying)[0]

    X, Y = buffer(x), buffer(y)
    for length, rows in by_length.items():
        if not length:
            continue
        terms = [term for row in rows for term in table[row]]
        factors = _table(e, F64, [float(c) for c, _, _ in terms])
        places = _table(e, I64, [k for _, i, j in terms for k in (i, j)])
        Z = place(len(rows))
        before, head, done = (
            builder.block,
            builder.append_basic_block(),
            builder.append_basic_block(),
        )
        builder.branch(head)
        builder.position_at_end(head)
        row = builder.phi(I64)
        row.add_incoming(ir.Constant(I64, 0), before)
        first = builder.mul(row, ir.Constant(I64, length))
        found: list[list[ir.Value]] = [[] for _ in range(registers)]
        for k in range(length):
            term = builder.add(first, ir.Constant(I64, k))
            c = coefficient(builder.load(builder.gep(factors, [term], source_etype=F64), typ=F64))
            twice = builder.mul(term, ir.Constant(I64, 2))
            i = builder.load(builder.gep(places, [twice], source_etype=I64), typ=I64)
            j = builder.load(
                builder.gep(places, [builder.add(twice, ir.Constant(I64, 1))], source_etype=I64),
                typ=I64,
            )
            for r in range(registers):
                left, right = (builder.load(at(b, n, r), typ=type_) for b, n in ((X, i), (Y, j)))
                product = builder.fmul(left, right)
                if function is formulas.antisymmetric_map:
                    left, right = (
                        builder.load(at(b, n, r), typ=type_) for b, n in ((X, j), (Y, i))
                    )
                    product = builder.fsub(product, builder.fmul(left, right))
                # by 1 and -1 too: these products are exact
                found[r].append(builder.fmul(c, product))
        for r in range(registers):
            total = formulas.total([e.num([v]) for v in found[r]])
            builder.store(total.value, at(Z, row, r))
        following = builder.add(row, ir.Constant(I64, 1))
        row.add_incoming(following, builder.block)
        builder.cbranch(
            builder.icmp_signed("==", following, ir.Constant(I64, len(rows))), done, head
        )
        builder.position_at_end(done)
        for n, k in enumerate(rows):
            offsets = [ir.Constant(I64, n * registers + r) for r in range(registers)]
            result[k] = e.num(
                [builder.load(builder.gep(Z, [o], source_etype=type_), typ=type_) for o in offsets]
            )
    return Vec(*result)


def _table(e: Emitter, type_: ir.Type, numbers: list[Any]) -> ir.Value:
    """The address of the first of these constants."""
    module = e.builder.module
    kind = ir.ArrayType(type_, len(numbers))
    constant = ir.Constant(kind, numbers)
    same = (
        g for g in module.globals.values() if isinstance(g, ir.GlobalVariable) and g.initializer
    )
    table = next(
        (g for g in same if g.type.pointee == kind and g.initializer.constant == numbers), None
    )
    if table is None:
        table = ir.GlobalVariable(module, kind, module.get_unique_name("table"))
        table.global_constant, table.linkage, table.initializer = True, "internal", constant
    zero = ir.Constant(I64, 0)
    return e.builder.gep(table, [zero, zero], inbounds=True, source_etype=kind)


LONG = 16
"""Entries from which constants, of which the run says which one is taken, are a table in memory."""


def picked(e: Emitter, entries: Any, index: Num) -> Any:
    """The entry of this index, of constants that all have one form: numbers of one kind, or tuples
    and vectors of these.  None if they have not, or are few.

    The index counts from the end if it is negative; one beyond both ends takes the first entry.
    """
    count = len(entries)
    if count < LONG:
        return None
    found = _columns(entries)
    if found is None:
        return None
    layout, columns = found
    types = [{*map(type, column)} for column in columns]
    if not all(len(t) == 1 and t <= {bool, int, float} for t in types):
        return None
    if not all(min(c) >= -HUGE and max(c) < HUGE for c, t in zip(columns, types) if t == {int}):
        return None
    place = e.select(index < 0, index + count, index)
    place = e.select(e.logic("and_", place >= 0, place < count), place, 0)
    numbers = []
    for column, of in zip(columns, types):
        kind = {bool: "b", int: "i", float: "f"}[of.pop()]
        pointer = _constants(e, column, kind)
        x = _loaded(e, functools.partial(_same, pointer), 0.0, place, "f" if kind == "f" else "i")
        numbers.append(x != 0 if kind == "b" else x)
    return build(layout, iter(numbers))


def _columns(entries: Any) -> tuple[Layout, list[Any]] | None:
    """The layout that all entries have, and for each number of it those of all entries; None if
    they have several, or one that is not for a table.
    """
    kinds = {*map(type, entries)}
    if len(kinds) == 1 and kinds <= {bool, int, float}:
        return carried_layout(entries[0]), [entries]
    flat = len(kinds) == 1 and kinds <= {tuple, Vec} and len({*map(len, entries)}) == 1
    columns = [*zip(*entries)] if flat else []
    if columns and all({*map(type, c)} in ({bool}, {int}, {float}) for c in columns):
        return carried_layout(entries[0]), columns
    layouts = {carried_layout(x) for x in entries}
    layout = layouts.pop()
    if layouts or "list" in _kinds(layout) or layout.kind == "record" or not layout.width:
        return None
    return layout, [*zip(*[leaves(x, layout) for x in entries])]


def _same(pointer: ir.Value, at: ir.Value) -> ir.Value:
    return pointer


def _kinds(layout: Layout) -> set[str]:
    return {layout.kind}.union(*[_kinds(part) for part in layout.parts])


def _constants(e: Emitter, numbers: list[Any], kind: str) -> ir.Value:
    """The address of the first of these constants, as read-only memory of the module: bytes, which
    LLVM reads in no time.
    """
    module, n = e.builder.module, len(numbers)
    data = np.array(numbers, dtype=np.float64 if kind == "f" else np.int64).tobytes()
    name = f"constants.{hashlib.sha256(data).hexdigest()[:24]}"
    type_ = ir.ArrayType(ir.IntType(8), 8 * n)
    table = module.globals.get(name)
    if table is None:
        table = ir.GlobalVariable(module, type_, name)
        text = 'c"\\' + data.hex("\\") + '"'
        table.global_constant, table.linkage = True, "internal"
        table.initializer, table.align = ir.FormattedConstant(type_, text), 8
    zero = ir.Constant(I64, 0)
    first = e.builder.gep(table, [zero, zero], inbounds=True, source_etype=type_)
    return e.builder.bitcast(first, (F64 if kind == "f" else I64).as_pointer())


def entry(e: Emitter, table: Table, i: Any) -> Any:
    """A number of a table, which lies where the run says; of one that is known now, in the code
    itself.
    """
    if not isinstance(i, Num) and table.content is not None:
        return tables.entry(table, i)
    b, place = e.builder, table.place
    pointer = None if isinstance(place, Num) else _table(e, F64, table.array.tolist())

    def first(at: ir.Value) -> ir.Value:
        return pointer or b.inttoptr(
            b.mul(b.fptosi(at, I64), ir.Constant(I64, 8)), F64.as_pointer()
        )

    return _loaded(e, first, place, i, "f")


def _loaded(
    e: Emitter, first: Callable[[ir.Value], ir.Value], place: Any, i: Any, kind: str
) -> Num:
    """The number that comes i after the first of those at a place, for every lane."""
    b, type_ = e.builder, TYPES[kind]
    varying = any(isinstance(x, Num) and x.varying for x in (place, i))

    def load(at: ir.Value, index: ir.Value) -> ir.Value:
        return b.load(b.gep(first(at), [index], source_etype=type_), align=8, typ=type_)

    places, indices = e.cast(place, "f", varying), e.cast(i, "i", varying)
    if not varying:
        return e.num([load(places[0], indices[0])])
    registers = []
    for at, index in zip(places, indices):
        register: ir.Value = ir.Constant(e.type(kind, True), ir.Undefined)
        for lane in range(e.width):
            k = ir.Constant(I32, lane)
            register = b.insert_element(
                register, load(b.extract_element(at, k), b.extract_element(index, k)), k
            )
        registers.append(register)
    return e.num(registers)


def _unknown(x: Any) -> bool:
    return isinstance(x, Num) or (
        isinstance(x, Complex) and any(isinstance(y, Num) for y in x.parts)
    )


def matmul(emitter: Emitter, function: Any, operands: tuple[Any, ...]) -> Any:
    """An operator applied to its operands, a product of matrices in a loop if they are large."""
    return product(emitter, *operands) if function is operator.matmul else function(*operands)
