"""Arrays and arguments as native code sees them."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from .numbers import F64, I64, Emitter, Num
from .values import Layout, build, layout_of, leaves


class Array:
    """An array of float64 with a column for each body: element k of body i lies at k * bodies + i."""

    def __init__(self, emitter: Emitter, pointer: ir.Value, bodies: ir.Value) -> None:
        self.emitter, self.pointer, self.bodies = emitter, pointer, bodies
        self.column: Any = None

    def address(self, at: Any) -> ir.Value:
        e, b = self.emitter, self.emitter.builder
        row = b.mul(e.cast(at, "i", False), self.bodies)
        place = b.gep(self.pointer, [b.add(row, self.column)], source_etype=F64)
        return place if e.lanes == 1 else b.bitcast(place, e.type("f", True).as_pointer())

    def read(self, start: Any, layout: Layout) -> Any:
        def numbers() -> Any:
            for i in range(layout.width):
                e = self.emitter
                yield e.num(e.builder.load(self.address(start + i), align=8, typ=e.type("f", e.lanes > 1)))

        return build(layout, numbers())

    def write(self, start: Any, value: Any, interpreter: Any) -> None:
        for i, x in enumerate(leaves(value, layout_of(value))):
            e = self.emitter
            e.builder.store(e.cast(x, "f", e.lanes > 1), self.address(start + i), align=8)


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
            yield Num(emitter, load(numbers, "number", F64), "f")

    args: list[Any] = []
    for kind in kinds:
        if isinstance(kind, Layout):
            args.append(build(kind, floats()))
        elif kind == "integer":
            args.append(Num(emitter, load(integers, "integer", I64), "i"))
        else:
            args.append(Array(emitter, load(arrays, "array", F64.as_pointer()), bodies))
    return args
