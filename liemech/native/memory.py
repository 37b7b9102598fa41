"""Arrays and arguments as native code sees them."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from .numbers import F64, I64, Emitter
from .values import Layout, build, layout_of, leaves


class Array:
    """An array of float64 with a column for each body: element k of body i lies at k * bodies + i."""

    def __init__(self, emitter: Emitter, pointer: ir.Value, bodies: ir.Value) -> None:
        self.emitter, self.pointer, self.bodies = emitter, pointer, bodies
        self.column: Any = None

    def address(self, at: Any, register: int = 0) -> ir.Value:
        e, b = self.emitter, self.emitter.builder
        row = b.mul(e.cast(at, "i", False)[0], self.bodies)
        column = b.add(self.column, ir.Constant(I64, register * e.width))
        place = b.gep(self.pointer, [b.add(row, column)], source_etype=F64)
        return place if e.lanes == 1 else b.bitcast(place, e.type("f", True).as_pointer())

    def read(self, start: Any, layout: Layout) -> Any:
        e, varying = self.emitter, self.emitter.lanes > 1

        def numbers() -> Any:
            for i in range(layout.width):
                places = [self.address(start + i, r) for r in range(e.registers(varying))]
                yield e.num([e.builder.load(place, align=8, typ=e.type("f", varying)) for place in places])

        return build(layout, numbers())

    def write(self, start: Any, value: Any) -> None:
        e, varying = self.emitter, self.emitter.lanes > 1
        for i, x in enumerate(leaves(value, layout_of(value))):
            for r, v in enumerate(e.cast(x, "f", varying)):
                e.builder.store(v, self.address(start + i, r), align=8)


def arguments(emitter: Emitter, kinds: Any, function: ir.Function) -> list[Any]:
    """The driver's arguments: numbers loaded from their buffer, arrays with their columns."""
    b = emitter.builder
    numbers, integers, arrays, bodies, _, _ = function.args
    if emitter.lanes == 1:
        bodies = ir.Constant(I64, 1)
    counts = {"number": 0, "integer": 0, "array": 0}

    def load(buffer: ir.Value, kind: str, type_: ir.Type) -> ir.Value:
        place = b.gep(buffer, [ir.Constant(I64, counts[kind])], source_etype=type_)
        counts[kind] += 1
        return b.load(place, typ=type_)

    def floats() -> Any:
        while True:
            yield emitter.num([load(numbers, "number", F64)])

    args: list[Any] = []
    for kind in kinds:
        if isinstance(kind, Layout):
            args.append(build(kind, floats()))
        elif kind == "integer":
            args.append(emitter.num([load(integers, "integer", I64)]))
        else:
            args.append(Array(emitter, load(arrays, "array", F64.as_pointer()), bodies))
    return args
