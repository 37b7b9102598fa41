"""Loop fission: a loop over sites that has been translated as several passes, one after the other,
keeps what a later pass needs of an earlier one in rows of memory.

What is the same for all sites is computed before the pass, once.  What is a product, a sum or a
load that costs less than a row is made again.  A row serves several numbers in turn.
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
"""Instructions that are made again if only one of their operands is kept."""


class Pass:
    """One loop over sites.

    index : of the first site at hand.  body : the block with which a turn begins.  left : the one to
    which control goes behind it if the step is given up.  paired : do sites meet others in it?
    """

    left: ir.Block | None = None

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
        """The end of a turn; control goes on behind the loop.  (A translation that is taken back
        may end it once more.)
        """
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
    """Let every pass compute, load or be given what it needs; the number of rows that this takes,
    from row `first` on.
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
        self.again: set[ir.Value] = loop.again
        # by instruction, in which pass it is
        self.at = {i: q for q, p in enumerate(self.passes) for block in p.blocks for i in block.instructions}
        self.indices = {p.index for p in self.passes}
        self.fixed: set[ir.Value] = set()
        self.derived: set[ir.Value] = set()
        self.row: dict[ir.Value, int] = {}
        self.places: dict[int, ir.Value] = {}
        self.made: dict[tuple[ir.Value, int], ir.Value] = {}

    def divide(self) -> int:
        """Divide the loop; the number of rows that it takes."""
        self._drop_unused()
        self._classify()
        uses = self._uses()
        self._make_again(uses)
        count = self._keep(uses)
        self._exchange()
        return count

    def _drop_unused(self) -> None:
        """Forget instructions whose values nobody needs."""
        alive: set[ir.Value] = set()
        within = {block for p in self.passes for block in p.blocks}
        behind = self.passes[0].function.blocks[self.passes[0].start :]
        others = (block for block in behind if block not in within)
        between = (x for block in others for i in block.instructions for x in used(i))
        todo = [*(i for i in self.at if _acts(i)), *(x for x in between if x in self.at)]
        while todo:
            i = todo.pop()
            if i in self.at and i not in alive:
                alive.add(i)
                todo += used(i)
        for p in self.passes:
            for block in p.blocks:
                block.instructions[:] = [i for i in block.instructions if i in alive]
        self.at = {i: q for i, q in self.at.items() if i in alive}

    def _classify(self) -> None:
        """Find the values that are the same for all sites, which are computed before their pass, and those that follow
        from the number of the site.
        """
        at: dict[Any, int] = self.at
        hoisted: dict[Pass, list[Any]] = {p: [] for p in self.passes}
        self.derived |= self.indices
        for i, q in at.items():
            if isinstance(i, kinds.PhiInstr) or _acts(i):
                continue
            operands = [x for x in used(i) if x in at]
            loads = isinstance(i, kinds.LoadInstr)
            fixed = all(x in self.fixed for x in operands)
            if fixed and (not loads or self._of_arguments(i)) and i.opname not in ("sdiv", "srem"):
                self.fixed.add(i)
                hoisted[self.passes[q]].append(i)
            elif isinstance(i, kinds.CallInstr) or (loads and i not in self.again):
                continue
            elif all(x in self.fixed or x in self.derived for x in operands):
                self.derived.add(i)
        for p, instructions in hoisted.items():
            gone = set(instructions)
            for block in p.blocks:
                block.instructions[:] = [i for i in block.instructions if i not in gone]
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
        """The later passes that use each value, by value."""
        uses: dict[ir.Value, set[int]] = {}
        for i, q in self.at.items():
            for x in used(i):
                if self.at.get(x, q) < q:
                    if self.passes[q].paired:
                        raise NotCompilable("a formula of pairs asks for numbers of one site alone")
                    uses.setdefault(x, set()).add(q)
        return uses

    def _make_again(self, uses: dict[ir.Value, set[int]]) -> None:
        """A sum or product of something that is kept anyway and of what all have is made again."""
        for x, by in uses.items():
            if x.opname in CHEAP:
                operands = [o for o in used(x) if o in self.at]
                stored = [o for o in operands if o not in self.derived]
                if len(stored) == 1 and max(by) <= max(uses.get(stored[0], {0})):
                    self.derived.add(x)

    def _keep(self, uses: dict[ir.Value, set[int]]) -> int:
        """Store the numbers that later passes need, each in a row while it is needed; returns how many rows that takes."""
        needs: dict[ir.Value, set[int]] = {}
        todo = [(x, q) for x, by in uses.items() for q in by]
        while todo:
            x, q = todo.pop()
            if self._is_there(x, q) or x in self.indices:
                continue
            if x in self.derived:
                todo += [(o, q) for o in used(x)]
            else:
                needs.setdefault(x, set()).add(q)
        last: list[int] = []  # of each row, the last pass that needs what is in it
        for x in sorted(needs, key=lambda x: self.at[x]):
            q = self.at[x]
            row = next((r for r, end in enumerate(last) if end < q), len(last))
            last[row : row + 1] = [self._end(q, needs[x])]
            self.row[x] = row
        stored: dict[ir.Block, list[ir.Value]] = {}
        for x in self.row:
            stored.setdefault(x.parent, []).append(x)
        for block, values in stored.items():
            self._store(block, values)
        return len(last)

    def _end(self, home: int, needs: set[int]) -> int:
        """The last pass that needs a value: in a loop around passes every turn needs it again."""
        end = max(needs)
        for first, last in self.loops:
            if home < first and any(first <= q <= last for q in needs):
                end = max(end, last)
        return end

    def _store(self, block: ir.Block, values: list[ir.Value]) -> None:
        """Store values of a block, each behind the instruction that makes it."""
        for x in values:
            behind = block.instructions.index(x)
            while isinstance(x, kinds.PhiInstr) and isinstance(block.instructions[behind + 1], kinds.PhiInstr):
                behind += 1
            self.b._block, self.b._anchor = block, behind + 1
            self._access(self.at[x], x, x)

    def _access(self, q: int, x: ir.Value, value: ir.Value | None = None) -> ir.Value:
        """Store what x is, or load it, in a pass."""
        b = self.b
        if x.type not in (F64, self.e.type("f", self.e.lanes > 1)):
            return self._other(q, x, value)
        place = self.scratch.after(self._begins(self.row[x]), self.passes[q].index)
        place = b.bitcast(place, x.type.as_pointer())
        if value is not None:
            return b.store(value, place, align=8)
        return b.load(place, align=8, typ=x.type)

    def _begins(self, row: int) -> ir.Value:
        """The address of a row, computed once, before the first pass."""
        if row not in self.places:
            b, cursor = self.b, (self.b._block, self.b._anchor)
            b.position_before(self.passes[0].before.terminator)
            self.places[row] = self.scratch.at(self.e.num([ir.Constant(I64, self.first + row)]))
            b._block, b._anchor = cursor
        return self.places[row]

    def _other(self, q: int, x: ir.Value, value: ir.Value | None) -> ir.Value:
        raise NotCompilable(f"a value of the type {x.type} is needed after sites have met: compute it there anew")

    def _is_there(self, x: ir.Value, q: int) -> bool:
        """Whether a pass can use a value as it stands: computed in it, or outside of all passes."""
        return self.at.get(x, q) == q

    def _exchange(self) -> None:
        """Let the instructions of every pass use its own values: first these are made, from
        instructions as they were.
        """
        exchanges = []
        for i, q in [*self.at.items()]:
            body = self.passes[q].body
            before = i if i.parent is body and not isinstance(i, kinds.PhiInstr) else body.terminator
            for x in dict.fromkeys(used(i)):
                if not self._is_there(x, q):
                    exchanges.append((i, x, self._value(x, q, before)))
        for i, x, value in exchanges:
            exchange(i, x, value)

    def _value(self, x: ir.Value, q: int, before: ir.Value) -> ir.Value:
        """A value in a pass: made there, in the first block, before this instruction."""
        if self._is_there(x, q):
            return x
        if x in self.indices:
            return self.passes[q].index
        if (x, q) not in self.made:
            body = self.passes[q].body
            if x in self.derived:
                operands = [(o, self._value(o, q, before)) for o in dict.fromkeys(used(x))]
                new = copied(x, body)
                for o, local in operands:
                    exchange(new, o, local)
                body.instructions.insert(body.instructions.index(before), new)
            else:
                self.b._block, self.b._anchor = body, body.instructions.index(before)
                new = self._access(q, x)
            self.made[x, q] = new
        return self.made[x, q]


def _acts(i: ir.Value) -> bool:
    """Whether an instruction does more than to make a value."""
    if isinstance(i, kinds.CallInstr):
        return "readnone" not in getattr(i.callee, "attributes", ()) and not str(i.callee.name).startswith("llvm.")
    return isinstance(i, (kinds.StoreInstr, kinds.Terminator))


def used(i: ir.Value) -> Iterable[ir.Value]:
    """The operands of an instruction."""
    return [v for v, _ in i.incomings] if isinstance(i, kinds.PhiInstr) else [*i.operands]


def copied(i: ir.Value, block: ir.Block) -> Any:
    """An instruction under another name."""
    new: Any = copy.copy(i)
    new.parent, new._name = block, block.scope.register("")
    for key in [k for k in vars(new) if "cached" in k]:
        delattr(new, key)
    return new


def exchange(i: Any, old: ir.Value, new: ir.Value) -> None:
    """Let an instruction use another operand."""
    i.replace_usage(old, new)
    if isinstance(i, kinds.GEPInstr):
        i.pointer, i.indices = i.operands[0], list(i.operands[1:])
    if isinstance(i, kinds.ExtractValue):
        i.aggregate = i.operands[0]
