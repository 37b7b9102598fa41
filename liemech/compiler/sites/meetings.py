"""Meetings of sites in native code: exchanges of published values, and sums over all sites."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Callable
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas import sites as words
from ...formulas.classes.layouts import Layout, build, carried_layout, layout_of, leaves
from ...formulas.numbers import series_of_sites
from ...formulas.numbers.bases import is_any_number
from ...formulas.numbers.conversions import as_others_see
from ...formulas.numbers.series_of_sites import SeriesMeeting, company, has_series
from ...formulas.sites import TOGETHER, Meeting, SiteTable
from ...formulas.sums import halves
from ..buffers import SiteRows, unchanged
from ..numbers.arrays import vector
from ..numbers.counted import counted
from ..numbers.ir_numbers import F64, I32, I64, Num
from ..translation.joins import come_from
from .fission import CHEAP

OF_SERIES = (SeriesMeeting.of, SeriesMeeting.at, SeriesMeeting.sum, SeriesMeeting.some, SeriesMeeting.pairs)
"""Methods that run as they stand."""

ROWS = 7
"""The place among the words of a crew where the number of rows of scratch memory is."""


@dataclasses.dataclass(eq=False)
class Published:
    """The rows where the numbers of a published value lie."""

    layout: Layout
    rows: list[tuple[SiteRows, Any]]
    meeting: int | None  # the number of the meeting; None if the rows do not change
    passes: int = 0  # the number of passes before it
    numbers: list[Any] = dataclasses.field(default_factory=list)
    # by table and entry, values of neighbours that were loaded already
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


class SiteMeetings:
    """The words of meetings in native code."""

    def __init__(self, loops: Any) -> None:
        self.loops, self.memory, self.t, self.e, self.b = loops, loops.memory, loops.t, loops.e, loops.b
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            words.meet: self.meet,
            words.sum_over_sites: self.total,
            words.mean: self.mean,
            words.met_through: lambda k: None,
            words.repeated: self.repeated,
            Meeting.of: self.of_neighbour,
            Meeting.at: self.at,
            **{f: f for f in OF_SERIES},
        }

    def meet(self, value: Any) -> Any:
        """Publish a value, in scratch rows unless it lies in rows that do not change, or was published last."""
        if has_series(value):
            partners = company(self.loops.at_meeting("meet"))
            return SeriesMeeting(value, self.meet, self._formula_of_series, Meeting, partners)
        loop, value = self.loops.at_meeting("meet"), vector(as_others_see(value))
        layout = carried_layout(value)
        numbers = leaves(value, layout)
        last = loop.last_published
        if (
            last is not None
            and (last.passes, last.layout) == (len(loop.passes), layout)
            and alike(last.numbers, numbers)
        ):
            return Meeting(last, None)
        origins: list[Any] = [loop.row_of.get(x.values) if isinstance(x, Num) else None for x in numbers]
        if numbers and all(origins):
            return Meeting(Published(layout, origins, None), None)
        if loop.range is not None:
            raise NotCompilable("sites of which some rest meet with numbers that lie in memory")
        rows = self._publish(loop, [self.loops.scratch.as_bits(x, k) for x, k in zip(numbers, layout.kinds)])
        self.loops.pass_on()
        self.loops.begin_pass()
        loop.last_published = Published(layout, rows, loop.meetings, len(loop.passes), numbers)
        return Meeting(loop.last_published, None)

    def _formula_of_series(self, formula: Any, *args: Any) -> Any:
        """The value of a call whose arguments may be Python's closures of power series."""
        closures = {x: x for x in args if isinstance(x, types.FunctionType) and x.__closure__}
        self.t.intrinsics |= {x: x for x in closures if x.__module__ == series_of_sites.__name__}
        return self.t.call(formula, *args)

    def _publish(self, loop: Any, numbers: list[Any]) -> list[tuple[SiteRows, Any]]:
        """The rows where numbers are stored for other sites; two successive meetings have different rows."""
        loop.meetings += 1
        turn, self.loops.scratch.body = loop.meetings % 2, loop.passes[-1].index
        loop.published = max(loop.published, len(numbers))
        for k, x in enumerate(numbers):
            self.loops.scratch.store(self.loops.scratch.first(2 * k + turn), 0, x)
        return [(self.loops.scratch, 2 * k + turn) for k in range(len(numbers))]

    def of_neighbour(self, meeting: Meeting, table: SiteTable, d: Any) -> Any:
        """The value published by a neighbour, entry d of a table; loaded once."""
        gathered, t = meeting.published.gathered, self.t
        lasts = type(d) is int and t.state.region == self.loops.present_loop("Meeting").region
        key = t.emitter.cast(table.entries.place, "f", False)[0], d
        if not (lasts and key in gathered):
            neighbours, reach = self.memory.entries(table, d, "i"), self.memory.reach(table, d)
            neighbour = self.published(meeting, lambda rows: self.memory.gathered(rows, neighbours, reach))
            if not lasts:
                return neighbour
            gathered[key] = neighbour
        return gathered[key]

    def at(self, meeting: Meeting, j: Any) -> Any:
        """The value published by site j, which may differ by lane."""

        def numbers(rows: list[tuple[SiteRows, Any]]) -> list[Num]:
            if isinstance(j, Num) and j.varying:
                return self.memory.gathered(rows, j)
            place = self.e.cast(j, "i", False)[0]
            places = [among.after(among.at(row), place) for among, row in rows]
            return [self.e.num([self.b.load(x, align=8, typ=F64)]) for x in places]

        return self.published(meeting, numbers)

    def published(self, meeting: Meeting, numbers_of: Callable[..., list[Num]]) -> Any:
        """A published value, whose numbers `numbers_of` loads from their rows."""
        loop, published = self.t.state.site_loop, meeting.published
        if loop is None:
            raise NotCompilable("what sites have published in a native function")
        if published.meeting not in (None, loop.meetings):
            raise NotCompilable("what sites have published is asked for before they meet again")
        numbers = numbers_of(published.rows)
        values = (self.loops.scratch.of_bits(x, k) for x, k in zip(numbers, published.layout.kinds))
        return build(published.layout, values)

    def repeated(self, sweep: Any, unknown: Any, judge: Any, state: Any, turns: int) -> Any:
        """`formulas.sites.repeated`: a loop around passes; the unknown of every site lies in rows of its own, and the
        judge sees sums over all sites only.
        """
        t, e, b = self.t, self.e, self.b
        if t.state.site_loop is None:
            return t.inline(words.repeated, (sweep, unknown, judge, state, turns), {})
        loop = self.loops.at_meeting("repeated")
        layout, form = carried_layout(unknown), layout_of(state, is_any_number)
        if {*layout.kinds} - {"number"}:
            raise NotCompilable("an unknown that is not made of floats")
        rows = self.lasting_rows(self.loops.lasting, layout.width)
        self.loops.lasting += layout.width
        self.keep(rows, leaves(unknown, layout))
        self.loops.end_pass()
        before, head, end = b.block, b.append_basic_block(), b.append_basic_block()
        b.branch(head)
        b.position_at_end(head)
        initial = [e.lift(x) for x in leaves(state, form)]
        phis = [t.phi(x.kind, False) for x in initial]
        count = b.phi(I64)
        self.loops.begin_pass()
        first = len(loop.passes) - 1
        old = self.kept(rows)
        loop.reloadable |= {register for x in old for register in x.values}  # which stay up to the end of a turn
        new, summands = t.call(sweep, build(layout, iter(old)))
        unchanged(new, layout)
        self.keep(rows, leaves(new, layout))
        sums = self.total(summands, again=False)
        self.loops.wait(I64(0))  # until all have taken these sums
        new_state, enough = t.call(judge, build(form, iter(phis)), sums)
        updated = leaves(new_state, form)
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
        loop.loops.append((first, len(loop.passes) - 1))
        self.loops.begin_pass()
        return build(layout, iter(self.kept(rows))), new_state

    def lasting_rows(self, first: int, count: int) -> list[Num]:
        """Rows of scratch memory that meetings do not use, counted backwards from the last one."""
        b = self.b
        place = b.gep(self.loops.crew, [I64(ROWS)], source_etype=I64)
        last = b.load(place, typ=I64)
        self.t.state.site_loop.reloadable.add(last)
        return [self.e.num([b.sub(last, I64(1 + k))]) for k in range(first, first + count)]

    def keep(self, rows: list[Num], numbers: list[Any]) -> None:
        """Store numbers of the sites of a turn in rows."""
        self.loops.scratch.body = self.t.state.site_loop.passes[-1].index
        for row, x in zip(rows, numbers, strict=True):
            self.loops.scratch.store(self.loops.scratch.first(row), 0, x)

    def kept(self, rows: list[Num]) -> list[Num]:
        """The numbers of the sites of a turn, loaded from rows."""
        self.loops.scratch.body = self.t.state.site_loop.passes[-1].index
        return [self.loops.scratch.load(self.loops.scratch.first(row), 0) for row in rows]

    # -------------------------------------------------------------- sums

    def total(self, value: Any, again: bool = True) -> Any:
        """The sum over all sites; of one body the value itself.  again : does another pass begin?"""
        if self.t.state.site_loop is None:
            return value
        loop, value = self.loops.at_meeting("total"), vector(value)
        layout = carried_layout(value)
        if {*layout.kinds} - {"number"}:
            raise NotCompilable("`total` of what is no float, or made of floats")
        rows = self._publish(loop, leaves(value, layout))
        self.loops.pass_on()
        sums = [self._sum(loop, rows, row) for rows, row in rows]
        if again:
            self.loops.begin_pass()
        return build(layout, iter(sums))

    def mean(self, value: Any) -> Any:
        """The mean over all sites; of one body the value itself."""
        loop = self.t.state.site_loop
        if loop is None:
            return value
        return self.t.call(words.total, value) / self.e.num(self.e.cast(loop.sites.count, "f", False))

    def _sum(self, loop: Any, rows: SiteRows, row: Any) -> Num:
        """The sum of a row: sixteen sums side by side, of every sixteenth site, then by halves."""
        e, b = self.e, self.b
        width, type_ = e.width, e.type("f", e.lanes > 1)
        count, start = loop.sites.count.value, rows.at(row)
        blank = e.constant(0.0, "f", e.lanes > 1).values[0]
        with counted(b, I64(0), count, TOGETHER, [blank] * (TOGETHER // width)) as turn:
            for k, s in enumerate(turn.values):
                first = b.add(turn.index, I64(k * width))
                place = b.bitcast(rows.after(start, first), type_.as_pointer())
                x = b.load(place, align=8, typ=type_)
                turn.values[k] = b.fadd(s, b.select(self.loops.existing(first), x, blank))
        lanes = [
            e.num([s if e.lanes == 1 else b.extract_element(s, ir.Constant(I32, k))])
            for s in turn.values
            for k in range(width)
        ]
        return halves(lanes)
