"""Loops over the sites of one system: the formula of one site is translated in lanes across sites.

Where the formula asks for values of other sites (`meet`, `total`: `meetings`), the loop ends and the next one
begins; `fission` then finds which numbers the second loop needs of the first.  These numbers, and the values that
sites publish, lie in rows of scratch memory, one place for each site (`memory`).
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.columns import Column
from ...formulas.numbers.series_of_sites import SeriesMeeting
from ...formulas.sites import TOGETHER, once
from ..buffers import SiteRows, hidden
from ..numbers.ir_numbers import I64, Num
from ..numbers.rows_of_blocks import SquareBlocks
from ..translation.joins import Open
from ..translation.state import TranslationState
from . import planes
from .all_pairs import PairLoops
from .barriers import GIVEN_UP, barrier
from .fission import Pass, divided
from .meetings import Published, SiteMeetings
from .memory import SiteMemory


@dataclasses.dataclass(eq=False)
class LoopOverSites:
    """A loop over sites that is being translated."""

    sites: SiteRows  # the rows of the driver
    region: Any  # the branches and loops around it
    attempts: int  # the number of attempts around it
    range: tuple[ir.Value, ir.Value] | None = None  # of the sites that move while others rest; None: all move
    failed_site: Any = None  # the address for the number of the first site that has failed
    passes: list[Pass] = dataclasses.field(default_factory=list)
    loops: list[tuple[int, int]] = dataclasses.field(default_factory=list)  # first and last pass of loops around passes
    reloadable: set[ir.Value] = dataclasses.field(default_factory=set)  # loads of what does not change
    row_of: dict[Any, Any] = dataclasses.field(default_factory=dict)  # by the registers of a number, its row
    published: int = 0  # the width of the largest value published
    below: int = 0  # rows of scratch memory that others need between passes
    meetings: int = 0  # the number of meetings so far
    last_published: Published | None = None
    company: list[SeriesMeeting] | None = None  # the last meetings of power series
    saved: bool = False  # have sites saved numbers?


class SiteLoops:
    """The loops over sites of a driver in native code, and all words of formulas of sites.

    lanes : sites that run side by side.
    """

    scratch: SiteRows  # rows of scratch memory: `rows` of them, and `lasting` more for the length of a loop
    notes: ir.Value  # the address for the number of a site that has failed
    crew: ir.Value  # the address of what threads share

    def __init__(self, translator: Any, lanes: int, width: int) -> None:
        self.t, self.e, self.b = translator, translator.emitter, translator.builder
        self.lanes, self.width, self.rows, self.lasting = lanes, width, 0, 0
        self.paired: dict[int, int] = {}
        self.functions: set[ir.Function] = set()  # that have the sites: the kernel, and what runs once for all sites
        self.rows_of_once = 0  # of scratch memory, which these need
        self.memory = SiteMemory(self)
        self.meetings = SiteMeetings(self)
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            planes.each: self.each,
            planes.some: self.some,
            once: self.once,
        }
        for words in (self.memory, self.meetings, PairLoops(self), SquareBlocks(self)):
            self.intrinsics |= words.intrinsics

    @property
    def needs(self) -> tuple[int, bool, bool]:
        """Rows of scratch memory; do all pairs of sites meet; does a formula run once for all sites, on one thread?"""
        return self.rows + self.lasting, bool(self.paired), len(self.functions) > 1

    def enter(self, array: int, integer: int) -> None:
        """Load the hidden arguments of loops over sites at the entry of a function, which has those of the kernel."""
        function = self.b.function
        self.functions.add(function)
        self.scratch, self.notes, self.crew = hidden(self.e, array, integer)
        if self.lanes > 1:
            function.attributes.alignstack = 8 * self.width

    def each(self, sites: SiteRows, formula: Any, *args: Any) -> None:
        """Translate a formula for every site; the attempt around the loop fails if a site fails."""
        self._loop(sites, None, formula, *args)

    def some(self, sites: SiteRows, begin: Any, end: Any, formula: Any, *args: Any) -> None:
        """Translate a formula for the sites from begin to end."""
        first, last = [self.e.cast(x, "i", False)[0] for x in (begin, end)]
        self._loop(sites, (first, last), formula, *args)

    def _loop(self, sites: SiteRows, range_: Any, formula: Any, *args: Any) -> None:
        t, e, b, state = self.t, self.e, self.b, self.t.state
        if state.site_loop is not None:
            raise NotCompilable("a loop over sites inside of another one")
        if b.function not in self.functions:
            raise NotCompilable("a loop over sites inside of a native function")
        t.outliner.divide()
        outer = vars(state).copy()
        with e.side_by_side(self.lanes, self.width):
            state.site_loop = loop = LoopOverSites(sites, state.region, len(state.escapes) + 1, range_)
            state.failed, state.patience, state.raises, state.marks = e.slot(), 1, 0, 0
            e.store(False, state.failed)
            state.escapes.append([])
            with b.goto_entry_block():
                loop.failed_site = b.alloca(I64)
            b.store(I64(-1), loop.failed_site)
            self.begin_pass()
            t.call(formula, *args)
            self.end_pass()
            failed = self._together(loop, state.escapes.pop())
            first_row = max(2 * loop.published, loop.below)
            self.rows = max(self.rows, first_row + divided(b, e, loop, self.scratch, first_row))
        for name in ("site_loop", "failed", "patience", "raises", "marks"):
            setattr(state, name, outer[name])
        t.fail_if(failed)

    def begin_pass(self) -> None:
        """Begin a pass over the sites of this thread, as far as its planes have any, or over its share of a range."""
        b, loop = self.b, self.t.state.site_loop
        begin, end = b.function.args[4:6]
        places = loop.sites.step
        end = b.select(b.icmp_signed("<", end, places), end, places)
        if loop.range is not None:
            first, last = loop.range
            groups = b.sdiv(b.sub(last, first), I64(TOGETHER))
            begin, end = (b.add(first, b.mul(self.share(groups, place), I64(TOGETHER))) for place in (begin, end))
        if self.e.few:
            begin, end = I64(0), I64(self.lanes)
        loop.passes.append(Pass(b, begin, end))

    def share(self, total: ir.Value, place: ir.Value) -> ir.Value:
        """A thread's first or last site, `place`, scaled from the number of sites to `total`."""
        b, count = self.b, self.t.state.site_loop.sites.count.value
        place = b.select(b.icmp_signed("<", place, count), place, count)  # the last end is rounded up
        return b.sdiv(b.add(b.mul(total, place), b.sdiv(count, I64(2))), count)

    def end_pass(self, lanes: int | None = None) -> None:
        """End a pass, and store the number of the first site that has failed in it; places behind the last site do not
        count.
        """
        b, e, state = self.b, self.e, self.t.state
        loop, pass_ = state.site_loop, state.site_loop.passes[-1]
        if state.raises:
            failed = e.load(state.failed)
            with b.if_then(e.any(failed).value, likely=False):
                if lanes is None:
                    firsts = [b.add(pass_.index, I64(k * e.width)) for k in range(e.registers(e.lanes > 1))]
                    failed = e.logic("and_", failed, e.num([self.existing(first) for first in firsts]))
                    e.store(False, state.failed)
                before = b.load(loop.failed_site, typ=I64)
                is_first = b.and_(e.any(failed).value, b.icmp_signed("<", before, I64(0)))
                b.store(b.select(is_first, pass_.index, before), loop.failed_site)
        pass_.close(b, lanes or self.lanes)

    def existing(self, first: ir.Value) -> ir.Value:
        """The mask of the lanes of a register, from site `first` on, that have a site."""
        e, b, count = self.e, self.b, self.t.state.site_loop.sites.count.value
        if e.lanes == 1:
            return b.icmp_signed("<", first, count)
        lanes = ir.Constant(ir.VectorType(I64, e.width), [*range(e.width)])
        return b.icmp_signed("<", b.add(e.spread(first, e.width), lanes), e.spread(count, e.width))

    def wait(self, flags: ir.Value) -> ir.Value:
        """Wait at the barrier; returns the bitwise or of the flags of all threads."""
        return self.b.call(barrier(self.b.module), [self.crew, flags])

    def pass_on(self, lanes: int | None = None) -> None:
        """End a pass where sites meet, at a barrier of all threads, which leave the loop if one has given the step up."""
        b, pass_ = self.b, self.t.state.site_loop.passes[-1]
        self.end_pass(lanes)
        flags = self.wait(I64(0))
        pass_.left, on = b.append_basic_block(), b.append_basic_block()
        b.cbranch(b.icmp_signed("!=", flags, I64(0)), pass_.left, on)
        b.position_at_end(on)

    def once(self, formula: Any, question: Column, value: Any, answer: Column, *args: Any) -> Any:
        """`formulas.sites.once`: between two passes the call of a native function, in which sites may be looped over."""
        t, e, b, loop = self.t, self.e, self.b, self.at_meeting("once")
        self.memory.store(question, value)
        self.pass_on()
        left, outer = loop.passes[-1].left, t.state
        with e.side_by_side(1, 1):
            t.state = inner = TranslationState(failed=e.slot(), escapes=[[]])
            e.store(False, inner.failed)
            t.outliner.of_all_sites(formula, args, self._as_of_all_sites)
            t.state, failed = outer, e.load(inner.failed).values[0]
        on = b.append_basic_block()
        b.cbranch(failed, left, on)
        for escape in inner.escapes[0]:
            b.position_at_end(escape.block)
            b.branch(left)
        b.position_at_end(on)
        loop.meetings, loop.below = loop.meetings + 1, max(loop.below, self.rows_of_once)
        self.begin_pass()
        return self.memory.loaded(answer)

    @contextlib.contextmanager
    def _as_of_all_sites(self) -> Iterator[None]:
        """Translate a function of all sites inside of this context, which begins at its entry."""
        outer = self.scratch, self.notes, self.crew
        rows, self.rows = self.rows, 0
        try:
            self.enter(*self.scratch.numbers)
            yield
        finally:
            self.scratch, self.notes, self.crew = outer
            self.rows_of_once = max(self.rows_of_once, self.rows)
            self.rows = max(rows, self.rows)

    def _together(self, loop: LoopOverSites, escapes: list[Open]) -> Num:
        """Join the exits of the loop.  Returns whether a site of any thread has failed."""
        t, e, b = self.t, self.e, self.b
        exits = []
        failed = b.icmp_signed(">=", b.load(loop.failed_site, typ=I64), I64(0))
        exits.append((self.wait(b.zext(failed, I64)), b.block))
        if escapes:
            t.join(escapes, {}, b.append_basic_block() if len(escapes) == 1 else None)
            exits.append((self.wait(I64(GIVEN_UP)), b.block))
        exits += [(I64(GIVEN_UP), p.left) for p in loop.passes if p.left is not None]
        end = b.append_basic_block()
        for _, block in exits:
            b.position_at_end(block)
            b.branch(end)
        b.position_at_end(end)
        flags = b.phi(I64)
        for value, block in exits:
            flags.add_incoming(value, block)
        stopped = b.icmp_signed("!=", flags, I64(0))
        site = b.select(stopped, b.load(loop.failed_site, typ=I64), b.load(self.notes, typ=I64))
        b.store(site, self.notes)
        return e.num([stopped])

    def at_meeting(self, word: str) -> LoopOverSites:
        """The loop over sites.  Raises NotCompilable where not all sites come to the word, or not at once."""
        loop, t = self.present_loop(word), self.t
        if t.state.region != loop.region or t.active(t.frames[-1].env) is not None or t.state.depth:
            raise NotCompilable(f"`{word}` inside a branch or a loop of unknown length: all sites come together there")
        if len(t.state.escapes) > loop.attempts or self.b.function is not loop.passes[-1].function:
            raise NotCompilable(f"`{word}` inside of an attempt or a native function")
        if loop.saved:
            raise NotCompilable(f"`{word}` after the numbers of sites were saved")
        t.outliner.divide()
        return loop

    def present_loop(self, word: str) -> LoopOverSites:
        """The loop over sites that is being translated.  Raises NotCompilable where a word for one site may not stand."""
        loop = self.t.state.site_loop
        if loop is None:
            raise NotCompilable(f"`{word}` outside of a loop over sites")
        if loop.passes[-1].paired:
            raise NotCompilable(f"`{word}` in a formula of pairs: it is for one site")
        return loop
