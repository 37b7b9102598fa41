"""Loop fission: a loop over sites that was translated as several passes spills to rows of memory what a later pass
needs of an earlier one.

Loop invariants are hoisted before their pass.  Cheap sums, products and loads are recomputed (rematerialised) instead
of spilled.  Rows are shared by numbers whose live ranges do not overlap.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any

from llvmlite import ir
from llvmlite.ir import instructions as kinds

from ...errors import NotCompilable
from ..numbers.ir_numbers import F64, I64, Emitter

CHEAP = ("fadd", "fsub", "fmul", "fneg")
"""Instructions that are recomputed if only one of their operands is spilled."""


class Pass:
    """One loop over sites.

    index : the number of the first site of a turn.  body : the first block of a turn.  paired : is it over pairs?
    """

    left: ir.Block | None = None  # the block behind the pass if a thread has given the step up

    def __init__(self, b: ir.IRBuilder, begin: ir.Value, end: ir.Value, paired: bool = False) -> None:
        self.function, self.before, self.paired = b.function, b.block, paired
        self.start = len(b.function.blocks)
        self.head = b.append_basic_block()
        b.branch(self.head)
        b.position_at_end(self.head)
        self.index, self.begin = b.phi(I64), begin
        self.going, self.body = b.icmp_signed("<", self.index, end), b.append_basic_block()
        b.position_at_end(self.body)

    def close(self, b: ir.IRBuilder, lanes: int) -> None:
        """End the turn, and go on behind the loop; once more if the translation of the last turn was taken back."""
        following = b.add(self.index, ir.Constant(I64, lanes))
        b.branch(self.head)
        self.blocks = b.function.blocks[self.start :]
        after = b.append_basic_block()
        self.index.incomings = [(self.begin, self.before), (following, b.block)]
        self.head.terminator = None
        del self.head.instructions[2:]
        b.position_at_end(self.head)
        b.cbranch(self.going, self.body, after)
        b.position_at_end(after)


def divided(b: ir.IRBuilder, e: Emitter, loop: Any, scratch: Any, first: int) -> int:
    """Make every pass of a loop compute or load the values that it uses.  Returns the number of rows of `scratch`, from
    row `first` on, that this takes.
    """
    block = b.block
    rows = Fission(b, e, loop, scratch, first).divide()
    b.position_at_end(block)
    return rows


class Fission:
    """The passes of one loop over sites."""

    def __init__(self, b: ir.IRBuilder, e: Emitter, loop: Any, scratch: Any, first: int) -> None:
        self.b, self.e, self.scratch, self.first = b, e, scratch, first
        self.passes: list[Pass] = loop.passes
        self.loops: list[tuple[int, int]] = loop.loops
        self.reloadable: set[ir.Value] = loop.reloadable
        self.pass_of = {i: q for q, p in enumerate(self.passes) for block in p.blocks for i in block.instructions}
        self.indices = {p.index for p in self.passes}
        self.invariant: set[ir.Value] = set()  # values that all sites share
        self.recomputed: set[ir.Value] = set()  # values that every pass that needs them computes
        self.row_of: dict[ir.Value, int] = {}  # by spilled value
        self.row_addresses: dict[int, ir.Value] = {}  # by row
        self.local: dict[tuple[ir.Value, int], ir.Value] = {}  # by value and pass, the value as that pass has it

    def divide(self) -> int:
        """Divide the loop.  Returns the number of rows that it takes."""
        self._drop_unused()
        self._hoist_invariants()
        uses = self._uses()
        self._recompute_cheap(uses)
        count = self._spill(uses)
        self._use_local_values()
        return count

    def _drop_unused(self) -> None:
        """Remove instructions whose values are never used."""
        alive: set[ir.Value] = set()
        within = {block for p in self.passes for block in p.blocks}
        behind = self.passes[0].function.blocks[self.passes[0].start :]
        others = (block for block in behind if block not in within)
        between = (x for block in others for i in block.instructions for x in operands_of(i))
        todo = [*(i for i in self.pass_of if _has_effects(i)), *(x for x in between if x in self.pass_of)]
        while todo:
            i = todo.pop()
            if i in self.pass_of and i not in alive:
                alive.add(i)
                todo += operands_of(i)
        for p in self.passes:
            for block in p.blocks:
                block.instructions[:] = [i for i in block.instructions if i in alive]
        self.pass_of = {i: q for i, q in self.pass_of.items() if i in alive}

    def _hoist_invariants(self) -> None:
        """Move loop invariants before their pass, and mark as recomputed what follows from these and the site's number."""
        at: dict[Any, int] = self.pass_of
        hoisted: dict[Pass, list[Any]] = {p: [] for p in self.passes}
        self.recomputed |= self.indices
        for i, q in at.items():
            if isinstance(i, kinds.PhiInstr) or _has_effects(i):
                continue
            operands = [x for x in operands_of(i) if x in at]
            loads = isinstance(i, kinds.LoadInstr)
            fixed = all(x in self.invariant for x in operands)
            if fixed and (not loads or self._of_arguments(i)) and i.opname not in ("sdiv", "srem"):
                self.invariant.add(i)
                hoisted[self.passes[q]].append(i)
            elif isinstance(i, kinds.CallInstr) or (loads and i not in self.reloadable):
                continue
            elif all(x in self.invariant or x in self.recomputed for x in operands):
                self.recomputed.add(i)
        for p, instructions in hoisted.items():
            moved = set(instructions)
            for block in p.blocks:
                block.instructions[:] = [i for i in block.instructions if i not in moved]
            end = len(p.before.instructions) - 1
            p.before.instructions[end:end] = instructions
            for i in instructions:
                i.parent = p.before
                del at[i]

    def _of_arguments(self, i: ir.Value) -> bool:
        """Whether an instruction loads one of the kernel's numbers, which do not change."""
        place = i.operands[0]
        arguments = self.passes[0].function.args[:3]
        return isinstance(place, kinds.GEPInstr) and place.pointer in arguments

    def _uses(self) -> dict[ir.Value, set[int]]:
        """By value, the later passes that use it."""
        uses: dict[ir.Value, set[int]] = {}
        for i, q in self.pass_of.items():
            for x in operands_of(i):
                if self.pass_of.get(x, q) < q:
                    if self.passes[q].paired:
                        raise NotCompilable("a formula of pairs asks for numbers of one site alone")
                    uses.setdefault(x, set()).add(q)
        return uses

    def _recompute_cheap(self, uses: dict[ir.Value, set[int]]) -> None:
        """Mark as recomputed the sums and products of one value that is spilled anyway and of recomputed values."""
        for x, by in uses.items():
            if x.opname in CHEAP:
                operands = [o for o in operands_of(x) if o in self.pass_of]
                stored = [o for o in operands if o not in self.recomputed]
                if len(stored) == 1 and max(by) <= max(uses.get(stored[0], {0})):
                    self.recomputed.add(x)

    def _spill(self, uses: dict[ir.Value, set[int]]) -> int:
        """Store the values that later passes load, each in a row for its live range.  Returns the number of rows."""
        needs: dict[ir.Value, set[int]] = {}
        todo = [(x, q) for x, by in uses.items() for q in by]
        while todo:
            x, q = todo.pop()
            if self._available(x, q) or x in self.indices:
                continue
            if x in self.recomputed:
                todo += [(o, q) for o in operands_of(x)]
            else:
                needs.setdefault(x, set()).add(q)
        last: list[int] = []  # by row, the last pass that needs the value in it
        for x in sorted(needs, key=lambda x: self.pass_of[x]):
            q = self.pass_of[x]
            row = next((r for r, end in enumerate(last) if end < q), len(last))
            last[row : row + 1] = [self._last_need(q, needs[x])]
            self.row_of[x] = row
        stored: dict[ir.Block, list[ir.Value]] = {}
        for x in self.row_of:
            stored.setdefault(x.parent, []).append(x)
        for block, values in stored.items():
            self._store(block, values)
        return len(last)

    def _last_need(self, home: int, needs: set[int]) -> int:
        """The last pass that needs a value: of a loop around passes the last one, since every turn needs the value."""
        end = max(needs)
        for first, last in self.loops:
            if home < first and any(first <= q <= last for q in needs):
                end = max(end, last)
        return end

    def _store(self, block: ir.Block, values: list[ir.Value]) -> None:
        """Store values of a block, each behind its instruction."""
        for x in values:
            behind = block.instructions.index(x)
            while isinstance(x, kinds.PhiInstr) and isinstance(block.instructions[behind + 1], kinds.PhiInstr):
                behind += 1
            self.b._block, self.b._anchor = block, behind + 1
            self._access(self.pass_of[x], x, x)

    def _access(self, q: int, x: ir.Value, value: ir.Value | None = None) -> ir.Value:
        """The instruction of pass q that loads x from its row, or stores `value` there."""
        b = self.b
        if x.type not in (F64, self.e.type("f", self.e.lanes > 1)):
            raise NotCompilable(f"a value of the type {x.type} is needed after sites have met: compute it there anew")
        place = self.scratch.after(self._row_address(self.row_of[x]), self.passes[q].index)
        place = b.bitcast(place, x.type.as_pointer())
        if value is not None:
            return b.store(value, place, align=8)
        return b.load(place, align=8, typ=x.type)

    def _row_address(self, row: int) -> ir.Value:
        """The address of a row, computed once, before the first pass."""
        if row not in self.row_addresses:
            b, cursor = self.b, (self.b._block, self.b._anchor)
            b.position_before(self.passes[0].before.terminator)
            self.row_addresses[row] = self.scratch.at(self.e.num([ir.Constant(I64, self.first + row)]))
            b._block, b._anchor = cursor
        return self.row_addresses[row]

    def _available(self, x: ir.Value, q: int) -> bool:
        """Whether a value is computed in pass q, or outside of all passes."""
        return self.pass_of.get(x, q) == q

    def _use_local_values(self) -> None:
        """Replace operands from other passes by local values, after all local values are made from unchanged
        instructions.
        """
        exchanges = []
        for i, q in [*self.pass_of.items()]:
            body = self.passes[q].body
            before = i if i.parent is body and not isinstance(i, kinds.PhiInstr) else body.terminator
            for x in dict.fromkeys(operands_of(i)):
                if not self._available(x, q):
                    exchanges.append((i, x, self._value(x, q, before)))
        for i, x, value in exchanges:
            replace_operand(i, x, value)

    def _value(self, x: ir.Value, q: int, before: ir.Value) -> ir.Value:
        """The local value of x in pass q, made in its first block, before the instruction `before`."""
        if self._available(x, q):
            return x
        if x in self.indices:
            return self.passes[q].index
        if (x, q) not in self.local:
            body = self.passes[q].body
            if x in self.recomputed:
                operands = [(o, self._value(o, q, before)) for o in dict.fromkeys(operands_of(x))]
                new = clone(x, body)
                for o, local in operands:
                    replace_operand(new, o, local)
                body.instructions.insert(body.instructions.index(before), new)
            else:
                self.b._block, self.b._anchor = body, body.instructions.index(before)
                new = self._access(q, x)
            self.local[x, q] = new
        return self.local[x, q]


def _has_effects(i: ir.Value) -> bool:
    """Whether an instruction has an effect besides its value."""
    if isinstance(i, kinds.CallInstr):
        return "readnone" not in getattr(i.callee, "attributes", ()) and not str(i.callee.name).startswith("llvm.")
    return isinstance(i, (kinds.StoreInstr, kinds.Terminator))


def operands_of(i: ir.Value) -> Iterable[ir.Value]:
    """The operands of an instruction."""
    return [v for v, _ in i.incomings] if isinstance(i, kinds.PhiInstr) else [*i.operands]


def clone(i: ir.Value, block: ir.Block) -> Any:
    """A copy of an instruction, with a name of its own, for a block."""
    new: Any = copy.copy(i)
    new.parent, new._name = block, block.scope.register("")
    for key in [k for k in vars(new) if "cached" in k]:
        delattr(new, key)
    return new


def replace_operand(i: Any, old: ir.Value, new: ir.Value) -> None:
    """Replace one operand of an instruction by another."""
    i.replace_usage(old, new)
    if isinstance(i, kinds.GEPInstr):
        i.pointer, i.indices = i.operands[0], list(i.operands[1:])
    if isinstance(i, kinds.ExtractValue):
        i.aggregate = i.operands[0]
