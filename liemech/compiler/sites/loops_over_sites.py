"""Loops over the sites of one system: a formula of one site is translated with the number of the
site left open, in lanes across sites.

Where the formula asks what other sites have (`meet`, `total`), the loop ends, and the next one
begins; `fission` then finds which numbers of the one the other needs.  The values that a site
publishes, and those numbers, lie in rows of scratch memory, one place for each site.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import types
from collections.abc import Callable, Iterable
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas import sites as words
from ...formulas.classes.flattening import build, leaves
from ...formulas.classes.layouts import Layout, carried_layout, layout_of
from ...formulas.numbers import series_of_sites
from ...formulas.numbers.bases import is_any_number
from ...formulas.numbers.conversions import as_others_see, fitted
from ...formulas.numbers.series_of_sites import SeriesMeeting, company, has_series
from ...formulas.sites import EIGHT, FAR, TOGETHER, Column, Meeting, SiteArray, SiteTable, columns_of
from ...formulas.vectors import Vec
from ..buffers import SiteRows, unchanged
from ..numbers.arrays import vector
from ..numbers.ir_numbers import F64, I32, I64, Num
from ..numbers.rows_of_blocks import SquareBlocks
from ..translation.joins import Open, come_from
from . import planes as driver
from .all_pairs import PairLoops
from .barriers import GIVEN_UP, barrier
from .fission import CHEAP, Pass, divided

OF_SERIES = (SeriesMeeting.of, SeriesMeeting.at, SeriesMeeting.sum, SeriesMeeting.some, SeriesMeeting.pairs)
"""Methods that run as they stand."""

ROWS = 7
"""The place among the words of a crew where the number of rows of scratch memory is."""


@dataclasses.dataclass(eq=False)
class LoopOverSites:
    """A loop over sites that is being translated.

    passes : the loops that it has become so far.  sites : the rows of the driver.  region : the
    branches and loops around it.  again : instructions that load what does not change, and may do
    so in any pass.  came : by the registers of a number, the row of the sites that it was loaded
    from.  published : numbers of the largest value published.  met : the last of these values.  attempts : around it.  where :
    a place for the first site that has failed.  range : of the sites that move while others rest;
    None: all of them move.  company : the last meetings of power series.
    loops : the first and the last pass of loops around passes.  meetings :
    how many there have been.  once : is a formula being translated that runs once, for all sites?
    """

    sites: SiteRows
    region: Any
    attempts: int
    range: tuple[ir.Value, ir.Value] | None = None
    loops: list[tuple[int, int]] = dataclasses.field(default_factory=list)
    passes: list[Pass] = dataclasses.field(default_factory=list)
    again: set[ir.Value] = dataclasses.field(default_factory=set)
    came: dict[Any, Any] = dataclasses.field(default_factory=dict)
    published: int = 0
    met: Published | None = None
    where: Any = None
    saved: bool = False
    once: bool = False
    meetings: int = 0
    company: list[SeriesMeeting] | None = None


@dataclasses.dataclass(eq=False)
class Published:
    """The rows where the numbers of a published value lie.

    meeting : its number; None if the rows stay as they are.  passes : how many there were then.
    numbers : what was published.  gathered : what this site has found already, by the table and the
    entry.
    """

    layout: Layout
    rows: list[tuple[SiteRows, Any]]
    meeting: int | None
    passes: int = 0
    numbers: list[Any] = dataclasses.field(default_factory=list)
    gathered: dict[Any, Any] = dataclasses.field(default_factory=dict)


def alike(numbers: list[Any], others: list[Any]) -> bool:
    """Whether numbers come from the same instructions."""
    equal: set[tuple[ir.Value, ir.Value]] = set()
    return all(
        x is y
        or (
            isinstance(x, Num)
            and isinstance(y, Num)
            and len(x.values) == len(y.values)
            and all(_alike(a, b, equal) for a, b in zip(x.values, y.values))
        )
        for x, y in zip(numbers, others, strict=True)
    )


def _alike(x: ir.Value, y: ir.Value, equal: set[tuple[ir.Value, ir.Value]]) -> bool:
    if x is y or (x, y) in equal:
        return True
    if not isinstance(x, ir.Instruction) or type(x) is not type(y):
        return isinstance(x, ir.Constant) and str(x) == str(y)
    pure = x.opname in (*CHEAP, "fdiv", "fcmp", "select") or (
        x.opname == "call" and x.callee is y.callee and x.callee.name.startswith("llvm.")
    )
    if not pure or any(getattr(x, n, None) != getattr(y, n, None) for n in ("opname", "op", "flags")):
        return False
    if not all(_alike(a, b, equal) for a, b in zip(x.operands, y.operands, strict=True)):
        return False
    equal.add((x, y))
    return True


def _behind(column: Column) -> tuple[int, list[int]]:
    """The first row of a column, and how far behind it all of its rows are."""
    first = column.rows[0] if column.rows else 0
    return first, [row - first for row in column.rows]


class SiteLoops:
    """The words of formulas of sites in native code.

    lanes : sites that run side by side.  scratch : its rows; `rows` of them are needed.  notes :
    where the number of a site that has failed is left.  crew : what threads share.
    """

    scratch: SiteRows
    notes: ir.Value
    crew: ir.Value

    def __init__(self, translator: Any, lanes: int, width: int) -> None:
        self.t, self.e, self.b = translator, translator.emitter, translator.builder
        self.lanes, self.width, self.rows, self.lasting = lanes, width, 0, 0
        self.paired: dict[int, int] = {}
        self.kernel = self.b.function
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            driver.each: self.each,
            driver.some: self.some,
            driver.load: self.load,
            driver.save: self.save,
            driver.at: self.value_at,
            driver.columns: lambda sites, **parts: columns_of(sites, parts),
            words.meet: self.meet,
            words.own: self.own,
            words.total: self.total,
            words.mean: self.mean,
            words.met_through: lambda k: None,
            words.repeated: self.repeated,
            words.once: self.once,
            Column.load: self.load_column,
            Column.save: self.save_column,
            Column.at: self.column_at,
            Column.put: self.put_column,
            Column.nth: self.nth,
            Column.heads: Column.heads,
            words.rows_in: self.rows_in,
            Meeting.of: self.of_neighbour,
            Meeting.at: self.at,
            **{f: f for f in OF_SERIES},
            **PairLoops(self).intrinsics,
            **SquareBlocks(self).intrinsics,
        }

    # -------------------------------------------------------------- the loop

    def each(self, sites: SiteRows, formula: Any, *args: Any) -> None:
        """Translate a formula for every site.  The attempt around it fails if a site's does."""
        self._loop(sites, None, formula, *args)

    def some(self, sites: SiteRows, begin: Any, end: Any, formula: Any, *args: Any) -> None:
        """Translate a formula for the sites from begin to end."""
        first, last = [self.e.cast(x, "i", False)[0] for x in (begin, end)]
        self._loop(sites, (first, last), formula, *args)

    def _loop(self, sites: SiteRows, range_: Any, formula: Any, *args: Any) -> None:
        t, e, b, state = self.t, self.e, self.b, self.t.state
        if state.over is not None:
            raise NotCompilable("a loop over sites inside of another one")
        if b.function is not self.kernel:  # which has the sites that are asked for
            raise NotCompilable("a loop over sites inside of a native function")
        t.outliner.divide()
        outer = vars(state).copy()
        with e.side_by_side(self.lanes, self.width):
            state.over = over = LoopOverSites(sites, state.region, len(state.escapes) + 1, range_)
            state.failed, state.patience, state.raises, state.marks = e.slot(), 1, 0, 0
            e.store(False, state.failed)
            state.escapes.append([])
            with b.goto_entry_block():
                over.where = b.alloca(I64)
            b.store(I64(-1), over.where)
            self._open()
            t.call(formula, *args)
            self._close()
            failed = self._together(over, state.escapes.pop())
            first_row = 2 * over.published
            self.rows = max(self.rows, first_row + divided(b, e, over, self.scratch, first_row))
        for name in ("over", "failed", "patience", "raises", "marks"):
            setattr(state, name, outer[name])
        t.fail_if(failed)

    def _open(self) -> None:
        """Begin a pass over the sites of this thread: of a range the same share as of all."""
        b, over = self.b, self.t.state.over
        begin, end = b.function.args[4:6]
        if over.range is not None:
            first, last = over.range
            groups = b.sdiv(b.sub(last, first), I64(TOGETHER))
            begin, end = (b.add(first, b.mul(self._share(groups, place), I64(TOGETHER))) for place in (begin, end))
        if self.e.few:
            begin, end = I64(0), I64(self.lanes)
        over.passes.append(Pass(b, begin, end))

    def _share(self, many: ir.Value, place: ir.Value) -> ir.Value:
        """Scale a thread's first or last site, `place`, to a count of `many`."""
        b, count = self.b, self.t.state.over.sites.count.value
        place = b.select(b.icmp_signed("<", place, count), place, count)  # the last end is rounded up
        return b.sdiv(b.add(b.mul(many, place), b.sdiv(count, I64(2))), count)

    def _close(self, lanes: int | None = None) -> None:
        """End a pass, and write down the first site that has failed in it."""
        b, state = self.b, self.t.state
        over, pass_ = state.over, state.over.passes[-1]
        if state.raises:
            before = b.load(over.where, typ=I64)
            failed = b.and_(self.e.any(self.e.load(state.failed)).value, b.icmp_signed("<", before, I64(0)))
            b.store(b.select(failed, pass_.index, before), over.where)
        pass_.close(b, lanes or self.lanes)

    def _wait(self, flags: ir.Value) -> ir.Value:
        """Wait at the barrier; returns the bitwise or of the flags of all threads."""
        return self.b.call(barrier(self.b.module), [self.crew, flags])

    def _pass_on(self, lanes: int | None = None) -> None:
        """End a pass where sites meet: the next one begins when all threads have come to it, unless one has given the
        step up.
        """
        self._close(lanes)
        self._wait_or_leave()

    def _wait_or_leave(self) -> None:
        """Wait at the barrier; behind it control goes on only if no thread has given the step up."""
        b, pass_ = self.b, self.t.state.over.passes[-1]
        flags, on = self._wait(I64(0)), b.append_basic_block()
        pass_.left = pass_.left or b.append_basic_block()
        b.cbranch(b.icmp_signed("!=", flags, I64(0)), pass_.left, on)
        b.position_at_end(on)

    def _together(self, over: LoopOverSites, escapes: list[Open]) -> Num:
        """Join the ways out of the loop; returns whether any site of any thread has failed."""
        t, e, b = self.t, self.e, self.b
        exits = []
        failed = e.any(e.load(t.state.failed)).value
        exits.append((self._wait(b.zext(failed, I64)), b.block))
        if escapes:
            t.join(escapes, {}, b.append_basic_block() if len(escapes) == 1 else None)
            exits.append((self._wait(I64(GIVEN_UP)), b.block))
        exits += [(I64(GIVEN_UP), p.left) for p in over.passes if p.left is not None]
        end = b.append_basic_block()
        for _, block in exits:
            b.position_at_end(block)
            b.branch(end)
        b.position_at_end(end)
        flags = b.phi(I64)
        for value, block in exits:
            flags.add_incoming(value, block)
        stopped = b.icmp_signed("!=", flags, I64(0))
        site = b.select(stopped, b.load(over.where, typ=I64), b.load(self.notes, typ=I64))
        b.store(site, self.notes)
        return e.num([stopped])

    def _meeting(self, word: str) -> LoopOverSites:
        """The loop over sites, at a place where all sites come together."""
        over, t = self._over(word), self.t
        if t.state.region != over.region or t.active(t.frames[-1].env) is not None or t.state.depth:
            raise NotCompilable(f"`{word}` inside a branch or a loop of unknown length: all sites come together there")
        if len(t.state.escapes) > over.attempts or self.b.function is not self.kernel:
            raise NotCompilable(f"`{word}` inside of an attempt or a native function")
        if over.saved:
            raise NotCompilable(f"`{word}` after the numbers of sites were saved")
        t.outliner.divide()
        return over

    # -------------------------------------------------------------- the driver's words

    def load(self, sites: SiteRows, k: Any, layout: Layout) -> Any:
        """Value number k of a site."""
        return self._loaded(sites, sites.start(k, layout), range(layout.width), layout)

    def _loaded(self, sites: SiteRows, start: Any, behind: Iterable[int], layout: Layout) -> Any:
        """The value of a site whose numbers are in the rows `behind` a first one."""
        over = self._over("load")
        sites.body = over.passes[-1].index
        first, row, numbers = sites.first(start), self.e.cast(start, "i", False)[0], []
        for i, kind in zip(behind, layout.kinds, strict=True):
            x = sites.load(first, i)
            over.again |= {*x.values}
            over.came[x.values] = sites, self.e.num([self.b.add(row, I64(i))])
            numbers.append(sites.of_bits(x, kind))
        return build(layout, iter(numbers))

    def save(self, sites: SiteRows, k: Any, value: Any, layout: Layout) -> None:
        """Set value number k of a site."""
        over = self._over("save")
        over.saved, sites.body = True, over.passes[-1].index
        sites.write(k, value, layout)

    def value_at(self, sites: SiteRows, i: Any, k: Any, layout: Layout) -> Any:
        """Value number k of site i, gathered lane by lane if the lanes ask for several."""
        return self._of_site(sites, i, sites.start(k, layout), range(layout.width), layout)

    def _of_site(self, sites: SiteRows, i: Any, start: Any, behind: Iterable[int], layout: Layout) -> Any:
        """The value of site i whose numbers are in the rows `behind` a first one."""
        b, first, over = self.b, self.e.cast(start, "i", False)[0], self.t.state.over
        if b.function is not self.kernel:
            raise NotCompilable("rows of sites in a native function")
        rows = [(sites, self.e.num([b.add(first, I64(j))])) for j in behind]
        if over is not None and isinstance(i, Num) and i.varying:
            numbers = self._gathered(rows, i)
        else:
            place = b.gep(sites.at(self.e.num([first])), [self.e.cast(i, "i", False)[0]], source_etype=F64)
            step = [b.mul(sites.step, I64(j)) for j in behind]
            numbers = [self.e.num([b.load(sites.after(place, x), align=8, typ=F64)]) for x in step]
        values = (sites.of_bits(x, kind) for x, kind in zip(numbers, layout.kinds, strict=True))
        return build(layout, values)

    # -------------------------------------------------------------- columns

    def load_column(self, column: Column) -> Any:
        """The value of a site."""
        return self._loaded(column.array, *_behind(column), column.layout)

    def column_at(self, column: Column, i: Any) -> Any:
        """The value of site i."""
        return self._of_site(column.array, i, *_behind(column), column.layout)

    def save_column(self, column: Column, value: Any) -> None:
        """Set the value of a site."""
        over, sites = self._over("save"), column.array
        over.saved, sites.body = True, over.passes[-1].index
        start, behind = _behind(column)
        first = sites.first(start)
        for x, kind, i in zip(self._leaves(column, value), column.layout.kinds, behind, strict=True):
            sites.store(first, i, sites.as_bits(x, kind))

    def put_column(self, column: Column, i: Any, value: Any) -> None:
        """Set the value of site i."""
        over, sites, b, e = self.t.state.over, column.array, self.b, self.e
        if over is not None and not over.once:
            raise NotCompilable("`put` inside of a loop over sites")
        start, behind = _behind(column)
        place = b.gep(sites.at(start), [e.cast(i, "i", False)[0]], source_etype=F64)
        for x, kind, j in zip(self._leaves(column, value), column.layout.kinds, behind, strict=True):
            where = sites.after(place, b.mul(sites.step, I64(j)))
            b.store(e.cast(sites.as_bits(x, kind), "f", False)[0], where, align=8)

    def _leaves(self, column: Column, value: Any) -> list[Any]:
        """The numbers of a value that is to be set."""
        value = fitted(value, column.layout) if column.layout.remembers else vector(value)
        unchanged(value, column.layout)
        return leaves(value, column.layout)

    def nth(self, column: Column, k: Any) -> Column:
        """The column of a part, of parts alike if it is known in the run only."""
        if isinstance(k, int):
            return column.nth(k)
        first, sites = column.nth(0), copy.copy(column.array)
        stride = column.rows[first.width] - column.rows[0] if len(column.layout.parts) > 1 else 0
        sites.pointer = sites.at(self.e.num([self.b.mul(self.e.cast(k, "i", False)[0], I64(stride))]))
        return Column(sites, first.rows, first.layout)

    # -------------------------------------------------------------- the words of formulas

    def meet(self, value: Any) -> Any:
        """Publish a value: in rows of its own, unless it lies in rows that stay as they are, or was published last."""
        if has_series(value):
            partners = company(self._meeting("meet"))
            return SeriesMeeting(value, self.meet, self._formula_of_series, Meeting, partners)
        over, value = self._meeting("meet"), vector(as_others_see(value))
        layout = carried_layout(value)
        numbers = leaves(value, layout)
        last = over.met
        if (
            last is not None
            and (last.passes, last.layout) == (len(over.passes), layout)
            and alike(last.numbers, numbers)
        ):
            return Meeting(last, None)
        came: list[Any] = [over.came.get(x.values) if isinstance(x, Num) else None for x in numbers]
        if numbers and all(came):
            return Meeting(Published(layout, came, None), None)
        if over.range is not None:
            raise NotCompilable("sites of which some rest meet with numbers that lie in memory")
        rows = self._publish(over, [self.scratch.as_bits(x, k) for x, k in zip(numbers, layout.kinds)])
        self._pass_on()
        self._open()
        over.met = Published(layout, rows, over.meetings, len(over.passes), numbers)
        return Meeting(over.met, None)

    def _formula_of_series(self, formula: Any, *args: Any) -> Any:
        """The value of a call, among whose arguments there may be formulas that are Python's."""
        closures = {x: x for x in args if isinstance(x, types.FunctionType) and x.__closure__}
        self.t.intrinsics |= {x: x for x in closures if x.__module__ == series_of_sites.__name__}
        return self.t.call(formula, *args)

    def _publish(self, over: LoopOverSites, numbers: list[Any]) -> list[tuple[SiteRows, Any]]:
        """Store numbers where others find them; the rows of two meetings in turn are others."""
        over.meetings += 1
        turn, self.scratch.body = over.meetings % 2, over.passes[-1].index
        over.published = max(over.published, len(numbers))
        for k, x in enumerate(numbers):
            self.scratch.store(self.scratch.first(2 * k + turn), 0, x)
        return [(self.scratch, 2 * k + turn) for k in range(len(numbers))]

    def of_neighbour(self, meeting: Meeting, table: SiteTable, d: Any) -> Any:
        """The numbers that a neighbour, entry d of a table, has published, gathered lane by lane, once."""
        gathered, t = meeting.published.gathered, self.t
        lasts = type(d) is int and t.state.region == self._over("Meeting").region
        key = t.emitter.cast(table.entries.place, "f", False)[0], d
        if not (lasts and key in gathered):
            which, reach = self._entries(table, d, "i"), self._reach(table, d)
            neighbour = self._published(meeting, lambda rows: self._gathered(rows, which, reach))
            if not lasts:
                return neighbour
            gathered[key] = neighbour
        return gathered[key]

    def at(self, meeting: Meeting, j: Any) -> Any:
        """Numbers that one site has published, for all that ask; gathered lane by lane if these ask for several."""

        def numbers(rows: list[tuple[SiteRows, Any]]) -> list[Num]:
            if isinstance(j, Num) and j.varying:
                return self._gathered(rows, j)
            place = self.e.cast(j, "i", False)[0]
            places = [among.after(among.at(row), place) for among, row in rows]
            return [self.e.num([self.b.load(x, align=8, typ=F64)]) for x in places]

        return self._published(meeting, numbers)

    def _published(self, meeting: Meeting, numbers_of: Callable[..., list[Num]]) -> Any:
        """A published value, its numbers from their rows."""
        over, published = self.t.state.over, meeting.published
        if over is None:
            raise NotCompilable("what sites have published in a native function")
        if published.meeting not in (None, over.meetings):
            raise NotCompilable("what sites have published is asked for before they meet again")
        numbers = numbers_of(published.rows)
        values = (self.scratch.of_bits(x, k) for x, k in zip(numbers, published.layout.kinds))
        return build(published.layout, values)

    # -------------------------------------------------------------- all sites together

    def once(self, formula: Any, values: tuple[Any, ...], *args: Any) -> tuple[Any, ...]:
        """Values of every site lie in rows, in the turn of the next meeting, so that what the last one has published
        stays; the thread with the first site runs the formula, and the others wait.
        """
        t, e, b, state = self.t, self.e, self.b, self.t.state
        over, values = self._meeting("once"), tuple([vector(x) for x in values])
        if over.range is not None:
            raise NotCompilable("`once` where some sites rest")
        if any(isinstance(x, Num) and x.varying for x in args):
            raise NotCompilable("`once` with a number of one site among its arguments: give it among the values")
        layout = carried_layout(values)
        rows = self._publish(over, [self.scratch.as_bits(x, k) for x, k in zip(leaves(values, layout), layout.kinds)])
        over.meetings -= 1
        self._pass_on()
        whole = Column(self.scratch, [row for _, row in rows], layout)
        columns = [whole.nth(k) for k in range(len(layout.parts))]
        run, done = b.append_basic_block(), b.append_basic_block()
        b.cbranch(b.icmp_signed("==", b.function.args[4], I64(0)), run, done)
        b.position_at_end(run)
        failed, raises = state.failed, state.raises
        with e.side_by_side(1, 1), t.apart():
            e.packs, state.failed, state.raises, over.once = True, e.slot(), 0, True
            e.store(False, state.failed)
            t.call(formula, *columns, *args)
            found, raised = e.load(state.failed), state.raises
            state.failed, state.raises, over.once = failed, raises + raised, False
        if raised:
            e.store(e.logic("or_", e.load(failed), found), failed)
        b.branch(done)
        b.position_at_end(done)
        self._wait_or_leave()
        self._open()
        self.scratch.body = over.passes[-1].index
        numbers = [self.scratch.load(self.scratch.first(row), 0) for _, row in rows]
        return build(layout, iter([self.scratch.of_bits(x, k) for x, k in zip(numbers, layout.kinds)]))

    # -------------------------------------------------------------- other sites

    def rows_in(self, table: SiteTable) -> Any:
        """The number of entries that a site has in a table."""
        return self._integer(table.rows) if table.degree is None else table.degree

    def _integer(self, x: Any) -> Num:
        """A whole number that came as a float."""
        e = self.e
        return e.each(lambda v: self.b.fptosi(v, I64), e.cast(x, "f", False))

    def _reach(self, table: SiteTable, d: Any) -> list[ir.Value] | None:
        """The `reach_of` the entries of eight sites each, loaded from memory; None where lanes are no eights."""
        e, b, over = self.e, self.b, self.t.state.over
        if e.lanes == 1 or e.width != EIGHT:
            return None
        place, places, row = (
            b.fptosi(e.cast(x, kind, False)[0], I64) if kind == "f" else e.cast(x, kind, False)[0]
            for x, kind in ((table.reach.place, "f"), (table.places, "f"), (d, "i"))
        )
        first = b.inttoptr(b.mul(place, I64(8)), I32.as_pointer())
        eight = b.ashr(b.add(b.mul(row, places), over.passes[-1].index), I64(3))
        reaches = []
        for r in range(e.registers(True)):
            at = b.gep(first, [b.add(eight, I64(r))], source_etype=I32)
            reaches.append(b.load(at, align=4, typ=I32))
            over.again.add(reaches[-1])
        return [b.sext(x, I64) for x in reaches]

    def _gathered(self, rows: list[tuple[SiteRows, Any]], which: Num, reach: list[ir.Value] | None = None) -> list[Num]:
        """The numbers of rows at the places of the lanes: side by side, as neighbours on a lattice
        mostly are; out of sixteen that are; or lane by lane.

        reach : of a table's entries, which of these it is; None if it is to be found.
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
            same = [
                b.icmp_signed("==", places, b.add(e.spread(first, e.width), steps))
                for places, first in zip(which.values, begins)
            ]
            together = all_of(b.icmp_signed("==", b.bitcast(x, bits), ir.Constant(bits, -1)) for x in same)
            if_so(together, lambda k, r: consecutive(k, begins[r]))
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
        """The instruction that takes eight numbers, at eight places, of two registers of eight."""
        module, name = self.b.module, "llvm.x86.avx512.vpermi2var.pd.512"
        if name not in module.globals:
            numbers, places = (ir.VectorType(t, EIGHT) for t in (F64, I64))
            ir.Function(module, ir.FunctionType(numbers, [numbers, places, numbers]), name)
        return module.globals[name]

    def own(self, array: Any, d: Any = None) -> Any:
        """The parameters of the sites at hand: a number or vector of an array, or a neighbour's index in row d of a
        table.
        """
        self._over("own")
        if isinstance(array, SiteTable):
            return self._entries(array, 0 if d is None else d, "i")
        if not isinstance(array, SiteArray):
            raise NotCompilable("`own` of what is no SiteArray and no SiteTable")
        dim, d = array.dim or 1, 0 if d is None else d
        numbers = [self._entries(array, d * dim + k, "f") for k in range(dim)]
        return numbers[0] if array.dim is None else Vec(*numbers)

    def _entries(self, array: SiteArray | SiteTable, row: Any, kind: str) -> Num:
        """The numbers of the sites at hand in a row of parameters, which never change."""
        e, b, over = self.e, self.b, self._over("own")
        place = e.cast(array.entries.place, "f", False)[0]
        first = b.inttoptr(b.mul(b.fptosi(place, I64), I64(8)), F64.as_pointer())
        rows, type_ = copy.copy(over.sites), e.type(kind, e.lanes > 1)
        rows.pointer, rows.body = first, over.passes[-1].index
        if kind == "i":  # of four bytes each
            begin = b.add(b.mul(e.cast(row, "i", False)[0], rows.step), rows.body)
            narrow = ir.VectorType(I32, e.width) if e.lanes > 1 else I32
            values = []
            for r in range(e.registers(e.lanes > 1)):
                at = b.gep(first, [b.add(begin, I64(r * e.width))], source_etype=I32)
                few = b.load(b.bitcast(at, narrow.as_pointer()), align=4, typ=narrow)
                over.again.add(few)
                values.append(b.sext(few, type_))
            return e.num(values)
        places = rows.addresses(rows.first(row), 0)
        values = [b.load(b.bitcast(p, type_.as_pointer()), align=8, typ=type_) for p in places]
        over.again |= {*values}
        over.came[tuple(values)] = rows, row
        return e.num(values)

    def _over(self, word: str) -> LoopOverSites:
        over = self.t.state.over
        if over is None:
            raise NotCompilable(f"`{word}` outside of a loop over sites")
        if over.passes[-1].paired:
            raise NotCompilable(f"`{word}` in a formula of pairs: it is for one site")
        if over.once:
            raise NotCompilable(f"`{word}` in a formula that runs once, for all sites: it is for one site")
        return over

    # -------------------------------------------------------------- sweeps

    def repeated(self, sweep: Any, unknown: Any, judge: Any, state: Any, turns: int) -> Any:
        """Sweeps over all sites until they are enough: a loop around passes, whose judge sees what is
        the same for all sites.  The unknown of every site lies in rows of its own.
        """
        t, e, b = self.t, self.e, self.b
        if t.state.over is None:
            return t.inline(words.repeated, (sweep, unknown, judge, state, turns), {})
        over = self._meeting("repeated")
        layout, form = carried_layout(unknown), layout_of(state, is_any_number)
        if {*layout.kinds} - {"number"}:
            raise NotCompilable("an unknown that is not made of floats")
        rows = self._last(self.lasting, layout.width)
        self.lasting += layout.width
        self._keep(rows, leaves(unknown, layout))
        self._close()
        before, head, end = b.block, b.append_basic_block(), b.append_basic_block()
        b.branch(head)
        b.position_at_end(head)
        initial = [e.lift(x) for x in leaves(state, form)]
        phis = [t.phi(x.kind, False) for x in initial]
        count = b.phi(I64)
        self._open()
        first = len(over.passes) - 1
        old = self._kept(rows)
        over.again |= {register for x in old for register in x.values}  # which stay up to the end of a turn
        new, summands = t.call(sweep, build(layout, iter(old)))
        unchanged(new, layout)
        self._keep(rows, leaves(new, layout))
        sums = self.total(summands, again=False)
        self._wait(I64(0))  # until all have taken these sums
        now, enough = t.call(judge, build(form, iter(phis)), sums)
        updated = leaves(now, form)
        if any(isinstance(x, Num) and x.varying for x in (*updated, enough)):
            raise NotCompilable("a judge of sweeps that asks single sites")
        following = b.add(count, I64(1))
        continues = b.and_(e.cast(e.negation(e.lift(enough)), "b", False)[0], b.icmp_signed("<", following, I64(turns)))
        for phi, x, y in zip(phis, initial, updated, strict=True):
            come_from(phi, e.cast(x, phi.kind, False), before)
            come_from(phi, e.cast(y, phi.kind, False), b.block)
        count.add_incoming(I64(0), before)
        count.add_incoming(following, b.block)
        b.cbranch(continues, head, end)
        b.position_at_end(end)
        over.loops.append((first, len(over.passes) - 1))
        self._open()
        return build(layout, iter(self._kept(rows))), now

    def _last(self, first: int, count: int) -> list[Num]:
        """Rows of scratch memory that keep what is in them, counted from the last one backwards."""
        b = self.b
        place = b.gep(self.crew, [I64(ROWS)], source_etype=I64)
        last = b.load(place, typ=I64)
        self.t.state.over.again.add(last)
        return [self.e.num([b.sub(last, I64(1 + k))]) for k in range(first, first + count)]

    def _keep(self, rows: list[Num], numbers: list[Any]) -> None:
        """Store numbers of the sites at hand."""
        self.scratch.body = self.t.state.over.passes[-1].index
        for row, x in zip(rows, numbers, strict=True):
            self.scratch.store(self.scratch.first(row), 0, x)

    def _kept(self, rows: list[Num]) -> list[Num]:
        """The numbers of the sites at hand that were stored."""
        self.scratch.body = self.t.state.over.passes[-1].index
        return [self.scratch.load(self.scratch.first(row), 0) for row in rows]

    # -------------------------------------------------------------- sums

    def total(self, value: Any, again: bool = True) -> Any:
        """The sum over all sites; of one body the value itself.  again : does another pass begin?"""
        if self.t.state.over is None:
            return value
        over, value = self._meeting("total"), vector(value)
        layout = carried_layout(value)
        if {*layout.kinds} - {"number"}:
            raise NotCompilable("`total` of what is no float, or made of floats")
        rows = self._publish(over, leaves(value, layout))
        self._pass_on()
        sums = [self._sum(over, rows, row) for rows, row in rows]
        if again:
            self._open()
        return build(layout, iter(sums))

    def mean(self, value: Any) -> Any:
        """The sum over all sites over their number; of one body the value itself."""
        over = self.t.state.over
        if over is None:
            return value
        return self.total(value) / self.e.num(self.e.cast(over.sites.count, "f", False))

    def _sum(self, over: LoopOverSites, rows: SiteRows, row: Any) -> Num:
        """The sum of a row: sixteen sums side by side, of every sixteenth site, then by halves."""
        e, b = self.e, self.b
        width, type_ = e.width, e.type("f", e.lanes > 1)
        count, start = over.sites.count.value, rows.at(row)
        before, head, body, done = b.block, *(b.append_basic_block() for _ in range(3))
        zero = I64(0)
        b.branch(head)
        b.position_at_end(head)
        at = b.phi(I64)
        sums = [b.phi(type_) for _ in range(TOGETHER // width)]
        blank = e.constant(0.0, "f", e.lanes > 1).values[0]
        at.add_incoming(zero, before)
        b.cbranch(b.icmp_signed("<", at, count), body, done)
        b.position_at_end(body)
        for k, s in enumerate(sums):
            s.add_incoming(blank, before)
            first = b.add(at, I64(k * width))
            place = b.bitcast(rows.after(start, first), type_.as_pointer())
            x = b.load(place, align=8, typ=type_)
            inside = self._there(first, count)
            s.add_incoming(b.fadd(s, b.select(inside, x, blank)), body)
        at.add_incoming(b.add(at, I64(TOGETHER)), body)
        b.branch(head)
        b.position_at_end(done)
        lanes = [
            e.num([s if e.lanes == 1 else b.extract_element(s, ir.Constant(I32, k))])
            for s in sums
            for k in range(width)
        ]
        sum_: Num = words.halves(lanes)
        return sum_

    def _there(self, first: ir.Value, count: ir.Value) -> ir.Value:
        """A mask: which of the lanes from site `first` on have a site."""
        e, b = self.e, self.b
        if e.lanes == 1:
            return b.icmp_signed("<", first, count)
        lanes = ir.Constant(ir.VectorType(I64, e.width), [*range(e.width)])
        return b.icmp_signed("<", b.add(e.spread(first, e.width), lanes), e.spread(count, e.width))
