"""Sums over all pairs of sites in native code: the words of `rounds`, for eights of sites side by side."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.classes.layouts import build, carried_layout, leaves
from ...formulas.numbers.conversions import with_slopes
from ...formulas.sites import EIGHT, Meeting
from ..numbers.arrays import vector
from ..numbers.counted import counted
from ..numbers.ir_numbers import I32, I64, Num
from . import rounds
from .fission import Pass
from .rounds import Rounds

BLOCKS = 32
"""Blocks of sites for each thread: a fortieth of the time is waiting."""

FEWEST = 3
"""Eights of a block, at least: its pairs are worth some barriers."""


class PairLoops:
    """The words of sums over all pairs of sites in native code."""

    def __init__(self, loops: Any) -> None:
        self.loops, self.t, self.e, self.b = loops, loops.t, loops.e, loops.b
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            rounds.seen: self.seen,
            rounds.apart: self.apart,
            rounds.turned: self.turned,
            rounds.sums: self.sums,
            rounds.keep: self.keep,
            rounds.repeated: self.again_and_again,
            rounds.only: self.only,
            rounds.folded: self.folded,
            Meeting.pairs: self.pairs,
        }

    def pairs(self, meeting: Meeting, formula: Any, start: Any) -> Any:
        """Sums over all pairs, each of which is taken once: a pass of its own over eights of sites, of
        which each meets itself and those behind it.  The sums lie in memory.

        Threads take blocks of sites with blocks of sites, in rounds: those of a round share no site, and
        every site meets the blocks in the order in which one thread alone would take them, so that
        all sums have the bits that they have there.
        """
        t, e, b, state = self.t, self.e, self.b, self.t.state
        loop, start = self.loops.at_meeting("pairs"), vector(start)
        for level in meeting.published.layout.levels[:1]:  # which the terms will have
            start = with_slopes(start, level)
        layout = carried_layout(start)
        if loop.range is not None or {*layout.kinds} - {"number"}:
            raise NotCompilable("sums over all pairs of what is no float, or of some sites only")
        first = self.loops.paired.setdefault(layout.width, self.loops.lasting)
        self.loops.lasting = max(self.loops.lasting, first + layout.width)
        self.loops.meetings.keep(self.loops.meetings.lasting_rows(first, layout.width), leaves(start, layout))
        self.loops.pass_on()
        count, block, blocks = self._blocks()
        failed, raises = state.failed, state.raises
        with e.side_by_side(EIGHT, self.loops.width):
            state.failed, state.raises = e.slot(), 0
            e.store(False, state.failed)
            rounds_of_blocks = b.sub(b.mul(blocks, I64(2)), I64(1))
            with counted(b, I64(0), rounds_of_blocks) as turn:  # block i meets block j in round i + j, if i <= j
                low = b.sub(turn.index, b.sub(blocks, I64(1)))
                low = b.select(b.icmp_signed(">", low, I64(0)), low, I64(0))
                blocks_of_round = b.sub(b.add(b.sdiv(turn.index, I64(2)), I64(1)), low)
                begin, stop = (
                    b.mul(b.add(low, self.loops.share(blocks_of_round, place)), block) for place in b.function.args[4:6]
                )
                stop = b.select(b.icmp_signed("<", stop, count), stop, count)
                loop.passes.append(Pass(b, begin, stop, paired=True))
                i = loop.passes[-1].index
                other_block = b.mul(b.sub(turn.index, b.sdiv(i, block)), block)
                from_ = b.select(b.icmp_signed("<", i, other_block), other_block, i)
                to = b.add(other_block, block)
                to = b.select(b.icmp_signed("<", to, count), to, count)
                bounds = [e.num([v]) for v in (i, from_, to, count, I64(EIGHT))]
                sums = Rounds(meeting, self.loops.meetings.lasting_rows(first, layout.width), layout)
                t.inline(rounds.of_eight, (sums, formula, *bounds), {})
                self.loops.pass_on(EIGHT)
            failing, raised = e.any(e.load(state.failed)), state.raises
            state.failed, state.raises = failed, raises + raised
        if raised:
            e.store(e.logic("or_", e.load(failed), failing), failed)
        self.loops.begin_pass()
        return build(layout, iter(self.loops.meetings.kept(self.loops.meetings.lasting_rows(first, layout.width))))

    def _blocks(self) -> tuple[ir.Value, ir.Value, ir.Value]:
        """The number of sites, the size of a block of sites that meets other blocks, in whole eights, and the number of
        blocks: one for one thread, or so many that threads seldom wait.
        """
        b, count = self.b, self.t.state.site_loop.sites.count.value
        threads = b.load(self.loops.crew, typ=I64)
        eights = b.sdiv(b.add(count, I64(EIGHT - 1)), I64(EIGHT))
        eights_of_block = b.sdiv(eights, b.mul(threads, I64(BLOCKS)))
        eights_of_block = b.select(b.icmp_signed(">", eights_of_block, I64(FEWEST)), eights_of_block, I64(FEWEST))
        alone = b.icmp_signed("<=", threads, I64(1))
        block = b.mul(b.select(alone, eights, eights_of_block), I64(EIGHT))
        return count, block, b.sdiv(b.add(count, b.sub(block, I64(1))), block)

    def seen(self, pairs: Rounds, j: Any) -> Any:
        """The values published by the eight sites from site j on."""
        place = self.e.cast(j, "i", False)[0]
        return self.loops.meetings.published(
            pairs.meeting, lambda rows: [self.e.num(self._eight(r.after(r.at(k), place))) for r, k in rows]
        )

    def sums(self, pairs: Rounds, j: Any) -> Any:
        """The partial sums of the eight sites from site j on."""
        numbers = [self.e.num(self._eight(place)) for place in self._sums(pairs, j)]
        return build(pairs.layout, iter(numbers))

    def keep(self, pairs: Rounds, j: Any, value: Any) -> None:
        """Store the partial sums of the eight sites from site j on."""
        for place, x in zip(self._sums(pairs, j), leaves(value, pairs.layout), strict=True):
            self._eight(place, self.e.cast(x, "f", True))

    def _sums(self, pairs: Rounds, j: Any) -> list[ir.Value]:
        """The addresses of the sums of a site."""
        at = self.e.cast(j, "i", False)[0]
        return [self.loops.scratch.after(self.loops.scratch.at(row), at) for row in pairs.rows]

    def _eight(self, place: ir.Value, values: Any = None) -> list[ir.Value]:
        """The registers of the eight numbers from an address on; with `values` they are stored there."""
        e, b = self.e, self.b
        type_, registers = e.type("f", True), []
        for r in range(e.registers(True)):
            at = b.bitcast(self.loops.scratch.after(place, r * e.width), type_.as_pointer())
            if values is None:
                registers.append(b.load(at, align=8, typ=type_))
            else:
                b.store(values[r], at, align=8)
        return registers

    def turned(self, value: Any) -> Any:
        """The numbers of eight sites, rotated by one place."""
        return self._of_eight(value, lambda x: self._moved(x, 1))

    def _of_eight(self, value: Any, formula: Callable[[Num], Num]) -> Any:
        """A value with a formula applied to each of its numbers that differ by site."""
        layout = carried_layout(value)
        numbers = [formula(x) if isinstance(x, Num) and x.varying else x for x in leaves(value, layout)]
        return build(layout, iter(numbers))

    def _moved(self, x: Num, by: int, period: int = EIGHT) -> Num:
        """The eight numbers rotated by `by` places, modulo `period`: place k holds the number of place k + by."""
        v, registers = x.values, []
        for r in range(len(v)):
            places = [(r * self.e.width + k + by) % period for k in range(self.e.width)]
            first = places[0] // self.e.width
            within = [(p - first * self.e.width) % EIGHT for p in places]
            among = ir.Constant(ir.VectorType(I32, self.e.width), within)
            registers.append(self.b.shuffle_vector(v[first], v[(first + 1) % len(v)], among))
        return self.e.num(registers)

    def _by_period(self, period: Any, by_period: dict[int, Num]) -> Num:
        """Numbers of eight sites, one for each period that there may be."""
        e, b = self.e, self.b
        (value,) = e.cast(period, "i", False)
        *others, last = by_period.items()
        chosen = [*last[1].values]
        for length, x in others:
            is_length = b.icmp_signed("==", value, I64(length))
            chosen = [b.select(is_length, p, q) for p, q in zip(x.values, chosen)]
        return e.num(chosen)

    def again_and_again(self, value: Any, period: Any) -> Any:
        """Numbers of the first sites of eight, repeated."""
        return self._of_eight(value, lambda x: self._by_period(period, {p: self._moved(x, 0, p) for p in (1, 2, 4)}))

    def only(self, value: Any, period: Any) -> Any:
        """Numbers of the first sites of eight, and zeros."""
        e, b = self.e, self.b
        (count,) = e.cast(period, "i", False)
        zero = e.constant(0.0, "f", True).values[0]

        def cut(x: Num) -> Num:
            type_ = ir.VectorType(I64, e.width)
            places = [ir.Constant(type_, [*range(r, r + e.width)]) for r in range(0, EIGHT, e.width)]
            within = [b.icmp_signed("<", p, e.spread(count, e.width)) for p in places]
            return e.num([b.select(t, v, zero) for t, v in zip(within, x.values, strict=True)])

        return self._of_eight(value, cut)

    def folded(self, value: Any, period: Any) -> Any:
        """Sums of the numbers of eight places that are whole periods apart."""

        def sums(x: Num) -> Num:
            folds = {}
            for p in (4, 2, 1):
                x = self.e.each(self.b.fadd, x.values, self._moved(x, p).values)
                folds[p] = x
            return self._by_period(period, folds)

        return self._of_eight(value, sums)

    def apart(self, i: Any, j: Any, turn: Any, period: Any) -> Num:
        """A mask: which of eight sites from i on meet another site, of eight from j on turned `turn` times."""
        e, b, count = self.e, self.b, self.t.state.site_loop.sites.count.value
        first, second, turns, whole = (e.cast(x, "i", False)[0] for x in (i, j, turn, period))
        other = b.icmp_signed("!=", b.or_(b.xor(first, second), turns), I64(0))
        ring, masks = e.spread(b.sub(whole, I64(1)), e.width), []
        for r in range(0, EIGHT, e.width):
            lanes = ir.Constant(ir.VectorType(I64, e.width), [*range(r, r + e.width)])
            place = b.and_(b.add(lanes, e.spread(turns, e.width)), ring)
            present = [
                b.icmp_signed("<", x, e.spread(b.sub(count, y), e.width)) for x, y in ((lanes, first), (place, second))
            ]
            masks.append(b.and_(b.and_(*present), e.spread(other, e.width)))
        return e.num(masks)
