"""Instructions, counted while they are made: a kernel that would take LLVM too long is refused at once."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable

LIMIT = 80_000
"""Instructions of a kernel that LLVM compiles in about ten seconds: more are refused."""

WITH_SLOPES = 2
"""The factor of LIMIT where numbers carry a derivative along one direction, in tangent maps and gradients, and of drivers
that go back, `goes_back`: their steps have about three times as many instructions as plain ones.
"""

SIDE_BY_SIDE = 9000
"""Instructions up to which each number of an ensemble takes two registers: one works while the other waits."""

SHORT = 5500
"""Instructions of a kernel with one register a number, up to which one with two is made, too."""

EFFORT = 2.5
"""The factor of the limit for all instructions that are emitted, also those of attempts that are taken back: up to 2.3
times those that stay, in RKMK4 of 40 masses in a row.
"""


class TooLong(NotCompilable):
    """Raised where every translation would be too long."""


class Growing(Exception):
    """Raised where a formula is too large to be written out."""


class Builder(ir.IRBuilder):
    """Counts the instructions of a kernel while they are made."""

    emitted = 0  # in the present native function, without those taken back
    room: float = math.inf  # up to which the formula that is being written out may grow
    finished = 0  # in the other native functions
    made = 0  # in all, with those taken back

    def __init__(self, block: ir.Block, limit: int) -> None:
        super().__init__(block)
        self.limit = limit
        # the native functions that are not finished, each made while making the one before
        self.within = [block.function]

    def _insert(self, instruction: Any) -> None:
        self.made += 1
        self.grow(1)
        self._block.instructions.insert(self._anchor, instruction)
        self._anchor += 1

    def grow(self, count: int) -> None:
        """Count instructions.  Raises Growing, TooLong."""
        self.emitted += count
        if self.emitted > self.room:
            raise Growing
        if self.emitted + self.finished > self.limit:
            self.finished = _reachable(self.within) - self.emitted
        most = max(self.limit, LIMIT)
        if self.emitted + self.finished > self.limit or self.made > EFFORT * most:
            tries = f"{self.made} instructions, all tries counted,"
            size = tries if self.made > EFFORT * most else f"more than {self.limit} instructions"
            raise TooLong(
                f"the native code would be too long: {size} take more than about ten seconds to "
                "make. Take fewer stages or a lower order, a smaller group, closed forms for what "
                "is derived, or compiled=False"
            )

    @contextlib.contextmanager
    def inside(self, function: ir.Function, copied: bool) -> Iterator[None]:
        """Put instructions into another native function; one that LLVM copies counts as written out, within the limits
        of the formulas around.
        """
        block, outer, room = self.block, self.emitted, self.room
        if not copied:
            self.finished, self.emitted, self.room = self.finished + outer, 0, math.inf
        self.within.append(function)
        try:
            yield
        except Growing:
            outer = self.emitted  # the formula that becomes a function is found by that
            raise
        finally:
            self.within.pop()
            if not copied:
                self.finished -= outer
                self.room = room
            self.emitted = outer
            self.position_at_end(block)

    def floats(self, op: str, a: ir.Value, b: ir.Value) -> ir.Value:
        """Arithmetic of two floats of one type."""
        instruction = Arithmetic(self._block, op, a, b)
        self._insert(instruction)
        return instruction


class Arithmetic(ir.Instruction):
    """A sum, difference, product or quotient of floats, as most instructions are: made in half the time of llvmlite's."""

    def __init__(self, block: ir.Block, op: str, a: ir.Value, b: ir.Value) -> None:
        self.parent, self.type, self.opname, self.operands = block, a.type, op, (a, b)
        self._name = block.scope.register("")

    def _to_string(self) -> str:
        a, b = self.operands
        return f"{self.get_reference()} = {self.opname} {self.type} {a.get_reference()}, {b.get_reference()}"


class Names:
    """The names in a native function: numbers, made quicker than those of llvmlite."""

    def __init__(self, function: ir.Function) -> None:
        self.count = len(function.args)

    def register(self, name: str, deduplicate: bool = False) -> str:
        """A name that no other value or block has."""
        self.count += 1
        return f"{name}.{self.count}"


def _called(function: ir.Function) -> set[ir.Function]:
    """The functions of the module that a function calls."""
    calls = (i.callee for block in function.blocks for i in block.instructions if isinstance(i, ir.CallInstr))
    return {f for f in calls if isinstance(f, ir.Function) and f.blocks}


def _alive(functions: list[ir.Function]) -> set[ir.Function]:
    """All functions that these functions reach by calls, and these themselves."""
    reachable, open_ = set(functions), list(functions)
    while open_:
        new = _called(open_.pop()) - reachable
        reachable |= new
        open_ += new
    return reachable


def _reachable(functions: list[ir.Function]) -> int:
    """The number of instructions of functions and all functions that they call, each copy counted."""
    whole = (f for f in _alive(functions) if f in functions or not hasattr(f, "size"))
    instructions = (i for f in whole for block in f.blocks for i in block.instructions)
    return sum(getattr(getattr(i, "callee", None), "size", 1) for i in instructions)


def drop_unused(module: ir.Module, kernel: ir.Function) -> int:
    """Remove the functions whose calls were all taken back, and return the number of instructions left."""
    alive = _alive([kernel])
    for name, value in [*module.globals.items()]:
        if isinstance(value, ir.Function) and value.blocks and value not in alive:
            del module.globals[name]
    return _reachable([kernel])
