"""Numbers of sites in rows of memory, in native code: values that drivers load and save, columns, parameters and
tables, and gathers of numbers of other sites.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Iterable
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas import sites as words
from ...formulas.classes.layouts import Layout, build, leaves
from ...formulas.columns import Column, columns_of
from ...formulas.numbers.conversions import fitted
from ...formulas.sites import EIGHT, FAR, SiteArray, SiteTable
from ...formulas.vectors import Vec
from ..buffers import SiteRows, unchanged
from ..numbers.arrays import vector
from ..numbers.ir_numbers import F64, I32, I64, Num
from . import planes


def _behind(column: Column) -> tuple[int, list[int]]:
    """The first row of a column, and the offsets of all of its rows from it."""
    first = column.rows[0] if column.rows else 0
    return first, [row - first for row in column.rows]


class SiteMemory:
    """The words in native code by which formulas read and write numbers of sites."""

    def __init__(self, loops: Any) -> None:
        self.loops, self.t, self.e, self.b = loops, loops.t, loops.e, loops.b
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            planes.load: self.load,
            planes.save: self.save,
            planes.at: self.value_at,
            planes.columns: lambda sites, **parts: columns_of(sites, parts),
            Column.load: self.load_column,
            Column.save: self.save_column,
            Column.at: self.column_at,
            Column.put: self.put_column,
            Column.nth: self.nth,
            Column.heads: Column.heads,
            words.own: self.own,
            words.rows_in: self.rows_in,
        }

    def load(self, sites: SiteRows, k: Any, layout: Layout) -> Any:
        """Value number k of a site."""
        return self._loaded(sites, sites.start(k, layout), range(layout.width), layout)

    def _loaded(self, sites: SiteRows, start: Any, behind: Iterable[int], layout: Layout) -> Any:
        """The value of a site whose numbers are in the rows `behind` a first one."""
        loop = self.loops.present_loop("load")
        sites.body = loop.passes[-1].index
        first, row, numbers = sites.first(start), self.e.cast(start, "i", False)[0], []
        for i, kind in zip(behind, layout.kinds, strict=True):
            x = sites.load(first, i)
            loop.reloadable |= {*x.values}
            loop.row_of[x.values] = sites, self.e.num([self.b.add(row, I64(i))])
            numbers.append(sites.of_bits(x, kind))
        return build(layout, iter(numbers))

    def save(self, sites: SiteRows, k: Any, value: Any, layout: Layout) -> None:
        """Set value number k of a site."""
        loop = self.loops.present_loop("save")
        loop.saved, sites.body = True, loop.passes[-1].index
        sites.write(k, value, layout)

    def value_at(self, sites: SiteRows, i: Any, k: Any, layout: Layout) -> Any:
        """Value number k of site i, which may differ by lane."""
        return self._of_site(sites, i, sites.start(k, layout), range(layout.width), layout)

    def _of_site(self, sites: SiteRows, i: Any, start: Any, behind: Iterable[int], layout: Layout) -> Any:
        """The value of site i whose numbers are in the rows `behind` a first one."""
        b, first, loop = self.b, self.e.cast(start, "i", False)[0], self.t.state.site_loop
        if b.function not in self.loops.functions:
            raise NotCompilable("rows of sites in a native function")
        if loop is not None and isinstance(i, Num) and i.varying:
            numbers = self.gathered([(sites, self.e.num([b.add(first, I64(j))])) for j in behind], i)
        else:
            numbers = [self.e.num([b.load(x, align=8, typ=F64)]) for x in self._addresses(sites, i, first, behind)]
        values = (sites.of_bits(x, kind) for x, kind in zip(numbers, layout.kinds, strict=True))
        return build(layout, values)

    def _addresses(self, sites: SiteRows, i: Any, start: ir.Value, behind: Iterable[int]) -> list[ir.Value]:
        """The addresses of the numbers of site i in the rows `behind` a first one."""
        b = self.b
        place = b.gep(sites.at(self.e.num([start])), [self.e.cast(i, "i", False)[0]], source_etype=F64)
        return [sites.after(place, b.mul(sites.step, I64(j))) for j in behind]

    # -------------------------------------------------------------- columns

    def load_column(self, column: Column) -> Any:
        """The value of a site."""
        return self._loaded(column.array, *_behind(column), column.layout)

    def loaded(self, column: Column) -> Any:
        """The value of a site, which may be set again: it is loaded here."""
        sites, (start, behind) = column.array, _behind(column)
        sites.body = self.t.state.site_loop.passes[-1].index
        first = sites.first(start)
        numbers = [
            sites.of_bits(sites.load(first, i), kind) for i, kind in zip(behind, column.layout.kinds, strict=True)
        ]
        return build(column.layout, iter(numbers))

    def column_at(self, column: Column, i: Any) -> Any:
        """The value of site i."""
        return self._of_site(column.array, i, *_behind(column), column.layout)

    def save_column(self, column: Column, value: Any) -> None:
        """Set the value of a site."""
        self.loops.present_loop("save").saved = True
        self.store(column, value)

    def store(self, column: Column, value: Any) -> None:
        """Set the value of a site, which may be set again."""
        sites = column.array
        sites.body = self.t.state.site_loop.passes[-1].index
        start, behind = _behind(column)
        first = sites.first(start)
        for x, kind, i in zip(self._leaves(column, value), column.layout.kinds, behind, strict=True):
            sites.store(first, i, sites.as_bits(x, kind))

    def put_column(self, column: Column, i: Any, value: Any) -> None:
        """Set the value of site i."""
        loop, sites, b, e = self.t.state.site_loop, column.array, self.b, self.e
        if loop is not None:
            raise NotCompilable("`put` inside of a loop over sites")
        start, behind = _behind(column)
        addresses = self._addresses(sites, i, I64(start), behind)
        for x, kind, where in zip(self._leaves(column, value), column.layout.kinds, addresses, strict=True):
            b.store(e.cast(sites.as_bits(x, kind), "f", False)[0], where, align=8)

    def _leaves(self, column: Column, value: Any) -> list[Any]:
        """The numbers of a value that is to be set."""
        value = fitted(value, column.layout) if column.layout.remembers else vector(value)
        unchanged(value, column.layout)
        return leaves(value, column.layout)

    def nth(self, column: Column, k: Any) -> Column:
        """The column of part k, which may be known at run time only if all parts are alike."""
        if isinstance(k, int):
            return column.nth(k)
        first, sites = column.nth(0), copy.copy(column.array)
        stride = column.rows[first.width] - column.rows[0] if len(column.layout.parts) > 1 else 0
        sites.pointer = sites.at(self.e.num([self.b.mul(self.e.cast(k, "i", False)[0], I64(stride))]))
        return Column(sites, first.rows, first.layout)

    def rows_in(self, table: SiteTable) -> Any:
        """The number of entries that a site has in a table."""
        return self._integer(table.rows) if table.degree is None else table.degree

    def _integer(self, x: Any) -> Num:
        """An integer from a float."""
        e = self.e
        return e.each(lambda v: self.b.fptosi(v, I64), e.cast(x, "f", False))

    def reach(self, table: SiteTable, d: Any) -> list[ir.Value] | None:
        """The `reach_of` the entries of each eight sites, loaded from memory; None if registers do not hold eight
        sites.
        """
        e, b, loop = self.e, self.b, self.t.state.site_loop
        if e.lanes == 1 or e.width != EIGHT:
            return None
        place, places, row = (
            b.fptosi(e.cast(x, kind, False)[0], I64) if kind == "f" else e.cast(x, kind, False)[0]
            for x, kind in ((table.reach.place, "f"), (table.places, "f"), (d, "i"))
        )
        first = b.inttoptr(b.mul(place, I64(8)), I32.as_pointer())
        eight = b.ashr(b.add(b.mul(row, places), loop.passes[-1].index), I64(3))
        reaches = []
        for r in range(e.registers(True)):
            at = b.gep(first, [b.add(eight, I64(r))], source_etype=I32)
            reaches.append(b.load(at, align=4, typ=I32))
            loop.reloadable.add(reaches[-1])
        return [b.sext(x, I64) for x in reaches]

    def gathered(self, rows: list[tuple[SiteRows, Any]], which: Num, reach: list[ir.Value] | None = None) -> list[Num]:
        """The numbers of rows at the places `which` of the lanes: a gather.  The code chooses among loads of registers,
        where places are consecutive, as of neighbours on a lattice; permutations of two registers; and loads lane by
        lane.

        reach : the `reach_of` the places, which decides; None to compare the places.
        """
        e, b = self.e, self.b
        firsts = [row.at(k) for row, k in rows]

        def number(k: int, place: ir.Value) -> ir.Value:
            return b.load(rows[k][0].after(firsts[k], place), align=8, typ=F64)

        if e.lanes == 1:
            return [e.num([number(k, which.values[0])]) for k in range(len(rows))]
        type_, registers = e.type("f", True), range(e.registers(True))
        lanes = [ir.Constant(I32, i) for i in range(e.width)]

        def consecutive(k: int, place: ir.Value) -> ir.Value:
            where = rows[k][0].after(firsts[k], place)
            return b.load(b.bitcast(where, type_.as_pointer()), align=8, typ=type_)

        def all_of(conditions: Iterable[ir.Value]) -> ir.Value:
            return functools.reduce(b.and_, conditions)

        branches: list[tuple[list[list[ir.Value]], ir.Block]] = []
        done = b.append_basic_block()

        def branch(load: Callable[[int, int], ir.Value]) -> None:
            branches.append(([[load(k, r) for r in registers] for k in range(len(rows))], b.block))
            b.branch(done)

        def if_so(condition: ir.Value, load: Callable[[int, int], ir.Value]) -> None:
            taken, other = b.append_basic_block(), b.append_basic_block()
            b.cbranch(condition, taken, other)
            b.position_at_end(taken)
            branch(load)
            b.position_at_end(other)

        if reach is None:
            begins = [b.extract_element(places, lanes[0]) for places in which.values]
            steps = ir.Constant(ir.VectorType(I64, e.width), [*range(e.width)])
            bits = ir.IntType(e.width)
            matches = [
                b.icmp_signed("==", places, b.add(e.spread(first, e.width), steps))
                for places, first in zip(which.values, begins)
            ]
            consecutive_everywhere = all_of(
                b.icmp_signed("==", b.bitcast(x, bits), ir.Constant(bits, -1)) for x in matches
            )
            if_so(consecutive_everywhere, lambda k, r: consecutive(k, begins[r]))
        else:
            begins = reach
            if_so(all_of(b.icmp_signed(">=", x, I64(0)) for x in reach), lambda k, r: consecutive(k, begins[r]))
            least = [b.select(b.icmp_signed("<", x, I64(0)), b.not_(x), x) for x in reach]
            among = [b.sub(p, e.spread(x, EIGHT)) for p, x in zip(which.values, least)]
            if_so(
                all_of(b.icmp_signed("!=", x, I64(FAR)) for x in reach),
                lambda k, r: b.call(
                    self._of_sixteen(),
                    [consecutive(k, least[r]), among[r], consecutive(k, b.add(least[r], I64(EIGHT)))],
                ),
            )
        singly = [[b.extract_element(places, lane) for lane in lanes] for places in which.values]

        def register(k: int, r: int) -> ir.Value:
            packed: ir.Value = ir.Constant(type_, ir.Undefined)
            for lane, place in zip(lanes, singly[r], strict=True):
                packed = b.insert_element(packed, number(k, place), lane)
            return packed

        branch(register)
        b.position_at_end(done)
        numbers = []
        for k in range(len(rows)):
            values = [b.phi(type_) for _ in registers]
            for loaded, end in branches:
                for value, x in zip(values, loaded[k], strict=True):
                    value.add_incoming(x, end)
            numbers.append(e.num(values))
        return numbers

    def _of_sixteen(self) -> ir.Function:
        """LLVM's function for a permutation of the sixteen numbers of two registers, of which eight are taken."""
        module, name = self.b.module, "llvm.x86.avx512.vpermi2var.pd.512"
        if name not in module.globals:
            numbers, places = (ir.VectorType(t, EIGHT) for t in (F64, I64))
            ir.Function(module, ir.FunctionType(numbers, [numbers, places, numbers]), name)
        return module.globals[name]

    def own(self, array: Any, d: Any = None) -> Any:
        """A parameter of this site: a number or vector of an array, or a neighbour's index in row d of a table."""
        self.loops.present_loop("own")
        if isinstance(array, SiteTable):
            return self.entries(array, 0 if d is None else d, "i")
        if not isinstance(array, SiteArray):
            raise NotCompilable("`own` of what is no SiteArray and no SiteTable")
        dim, d = array.dim or 1, 0 if d is None else d
        numbers = [self.entries(array, d * dim + k, "f") for k in range(dim)]
        return numbers[0] if array.dim is None else Vec(*numbers)

    def entries(self, array: SiteArray | SiteTable, row: Any, kind: str) -> Num:
        """The numbers of this site in a row of parameters, which never change."""
        e, b, loop = self.e, self.b, self.loops.present_loop("own")
        place = e.cast(array.entries.place, "f", False)[0]
        first = b.inttoptr(b.mul(b.fptosi(place, I64), I64(8)), F64.as_pointer())
        rows, type_ = copy.copy(loop.sites), e.type(kind, e.lanes > 1)
        rows.pointer, rows.body = first, loop.passes[-1].index
        if kind == "i":  # of four bytes each
            begin = b.add(b.mul(e.cast(row, "i", False)[0], rows.step), rows.body)
            narrow = ir.VectorType(I32, e.width) if e.lanes > 1 else I32
            values = []
            for r in range(e.registers(e.lanes > 1)):
                at = b.gep(first, [b.add(begin, I64(r * e.width))], source_etype=I32)
                four_bytes = b.load(b.bitcast(at, narrow.as_pointer()), align=4, typ=narrow)
                loop.reloadable.add(four_bytes)
                values.append(b.sext(four_bytes, type_))
            return e.num(values)
        places = rows.addresses(rows.first(row), 0)
        values = [b.load(b.bitcast(p, type_.as_pointer()), align=8, typ=type_) for p in places]
        loop.reloadable |= {*values}
        loop.row_of[tuple(values)] = rows, row
        return e.num(values)
