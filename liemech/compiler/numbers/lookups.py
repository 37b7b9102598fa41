"""Lookups: an entry of constants or of a table in memory, by an index that the run knows."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from llvmlite import ir

from ...formulas import tables
from ...formulas.classes.layouts import Layout, build, carried_layout, leaves
from ...formulas.tables import Table
from ...formulas.vectors import Vec
from ..driver import HUGE
from .ir_numbers import F64, I32, I64, TYPES, Emitter, Num

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
    columnar = _columns(entries)
    if columnar is None:
        return None
    layout, columns = columnar
    types = [{*map(type, column)} for column in columns]
    if not all(len(t) == 1 and t <= {bool, int, float} for t in types):
        return None
    if not all(min(c) >= -HUGE and max(c) < HUGE for c, t in zip(columns, types) if t == {int}):
        return None
    place = e.select(index < 0, index + count, index)
    place = e.select(e.logic("and_", place >= 0, place < count), place, 0)
    numbers = []
    for column, of in zip(columns, types):
        kind = "f" if of == {float} else "i"
        x = _loaded(e, constants(e, column, TYPES[kind]), 0.0, place, kind)
        numbers.append(x != 0 if of == {bool} else x)
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


def _kinds(layout: Layout) -> set[str]:
    return {layout.kind}.union(*[_kinds(part) for part in layout.parts])


def constants(e: Emitter, numbers: Any, type_: ir.Type) -> ir.Value:
    """The address of the first of these floats or integers, as read-only memory of the module:
    bytes, which LLVM reads in no time.
    """
    module = e.builder.module
    data = np.array(numbers, dtype=np.float64 if type_ is F64 else np.int64).tobytes()
    name = f"constants.{hashlib.sha256(data).hexdigest()[:24]}"
    memory = ir.ArrayType(ir.IntType(8), len(data))
    table = module.globals.get(name)
    if table is None:
        table = ir.GlobalVariable(module, memory, name)
        text = 'c"\\' + data.hex("\\") + '"'
        table.global_constant, table.linkage = True, "internal"
        table.initializer, table.align = ir.FormattedConstant(memory, text), 8
    zero = ir.Constant(I64, 0)
    first = e.builder.gep(table, [zero, zero], inbounds=True, source_etype=memory)
    return e.builder.bitcast(first, type_.as_pointer())


def entry(e: Emitter, table: Table, i: Any) -> Any:
    """A number of a table, which lies where the run says; of one that is known now, in the code itself."""
    if not isinstance(i, Num) and table.content is not None:
        return tables.entry(table, i)
    place = table.place
    if not isinstance(place, Num):
        return _loaded(e, constants(e, table.array, F64), 0.0, i, "f")
    return _loaded(e, None, place, i, "f")


def whole(e: Emitter, table: Table, i: Any) -> Any:
    """A whole number of a table in memory."""
    return _loaded(e, None, table.place, i, "i")


def _loaded(e: Emitter, first: ir.Value | None, place: Any, i: Any, kind: str) -> Num:
    """The number that comes i after the first, for every lane.  The first is the same for all
    lanes, or (None) lies at a place, in words of eight bytes.
    """
    b, type_ = e.builder, TYPES[kind]
    varying = any(isinstance(x, Num) and x.varying for x in (place, i))

    def load(at: ir.Value, index: ir.Value) -> ir.Value:
        begin = first or b.inttoptr(b.mul(b.fptosi(at, I64), ir.Constant(I64, 8)), type_.as_pointer())
        return b.load(b.gep(begin, [index], source_etype=type_), align=8, typ=type_)

    places, indices = e.cast(place, "f", varying), e.cast(i, "i", varying)
    if not varying:
        return e.num([load(places[0], indices[0])])
    registers = []
    for at, index in zip(places, indices):
        register: ir.Value = ir.Constant(e.type(kind, True), ir.Undefined)
        for lane in range(e.width):
            k = ir.Constant(I32, lane)
            register = b.insert_element(register, load(b.extract_element(at, k), b.extract_element(index, k)), k)
        registers.append(register)
    return e.num(registers)
