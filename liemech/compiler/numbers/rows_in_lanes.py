"""One formula of several rows of arguments in the code of a single body: the rows lie in the lanes of
its registers, two registers at a time, so that one works while the other waits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.calls import lanes as words
from ...formulas.classes.layouts import build, layout_of, leaves
from ...formulas.numbers.bases import is_any_number
from ..translation.joins import Open
from .ir_numbers import F64, I32, Num

REGISTERS = 2
"""Registers of a number."""


class RowsInLanes:
    """The word `in_lanes` in native code.  width : doubles in a register."""

    def __init__(self, translator: Any, width: int) -> None:
        self.t, self.e, self.b = translator, translator.emitter, translator.builder
        self.width, self.lanes = width, REGISTERS * width
        self.intrinsics: dict[Any, Callable[..., Any]] = {words.in_lanes: self.in_lanes}

    def in_lanes(self, formula: Any, *columns: Sequence[Any]) -> list[Any]:
        """The formula of every row.  Bodies or sites that have the lanes already go row by row."""
        rows = [[*row] for row in zip(*columns, strict=True)]
        if len(rows) < 2 or self.e.lanes > 1 or not self.e.packs or not _alike(rows):
            return [self.t.call(formula, *row) for row in rows]
        values: list[Any] = []
        for i in range(0, len(rows), self.lanes):
            values += self._group(formula, rows[i : i + self.lanes])
        return values

    def _group(self, formula: Any, rows: list[list[Any]]) -> list[Any]:
        """Up to as many rows as there are lanes; the last one fills those that are left."""
        e, b, state = self.e, self.b, self.t.state
        layouts = [layout_of(x, is_any_number) for x in rows[0]]
        flat = [
            [x for y, form in zip(row, layouts) for x in leaves(y, form)]
            for row in [*rows, *[rows[-1]] * (self.lanes - len(rows))]
        ]
        outer = {name: getattr(state, name) for name in ("failed", "raises", "marks")}
        b.function.attributes.alignstack = 8 * self.width
        with e.side_by_side(self.lanes, self.width):
            if state.escapes:
                state.failed, state.raises, state.marks = e.slot(), 0, 0
                e.store(False, state.failed)
                state.escapes.append([])
            packed = iter([self._packed(numbers) for numbers in zip(*flat)])
            arguments = [build(form, packed) for form in layouts]
            result = self.t.call(formula, *arguments)
            failed: Any = False
            if state.escapes:
                failed = e.any(e.load(state.failed)) if state.raises else False
                escapes = state.escapes.pop()
            layout = layout_of(result, is_any_number)
            parts = [self._apart(x, len(rows)) for x in leaves(result, layout)]
        vars(state).update(outer)
        if state.escapes:
            self._leave(escapes)
        self.t.fail_if(failed)
        return [build(layout, iter(row)) for row in zip(*parts, strict=True)]

    def _leave(self, escapes: list[Open]) -> None:
        """Give up the attempt around the formula where the formula was given up for all rows."""
        block = self.b.block
        for o in escapes:
            self.b.position_at_end(o.block)
            self.t.fail_if(True)
            self.t.state.escapes[-1].append(Open(self.b.block, {}))
        self.b.position_at_end(block)

    def _packed(self, numbers: tuple[Any, ...]) -> Any:
        """The number whose lanes are these numbers, one each; the number itself if all are one."""
        first = numbers[0]
        if all(x is first for x in numbers):
            return first
        values = [self.e.cast(x, "f", False)[0] for x in numbers]
        registers = []
        for begin in range(0, self.lanes, self.width):
            register: ir.Value = ir.Constant(ir.VectorType(F64, self.width), ir.Undefined)
            for k, v in enumerate(values[begin : begin + self.width]):
                register = self.b.insert_element(register, v, ir.Constant(I32, k))
            registers.append(register)
        return self.e.num(registers)

    def _apart(self, x: Any, rows: int) -> list[Any]:
        """The numbers that a number is in the rows, one after the other."""
        if not isinstance(x, Num) or not x.varying:
            return [x] * rows
        if x.mixed:
            raise NotCompilable("`in_lanes`: a result that is an integer in some rows only")
        places = [divmod(k, self.width) for k in range(rows)]
        return [self.e.num([self.b.extract_element(x.values[r], ir.Constant(I32, k))]) for r, k in places]


def _alike(rows: list[list[Any]]) -> bool:
    """Whether all rows are of one form and their numbers floats, so that they fit into lanes."""
    forms = [[layout_of(x, is_any_number) for x in row] for row in rows]
    return all(form == forms[0] for form in forms[1:]) and all(
        type(x) is float or (type(x) is Num and x.kind == "f" and not x.mixed)
        for row, form in zip(rows, forms)
        for y, layout in zip(row, form)
        for x in leaves(y, layout)
    )
