"""Arrays and arguments as native code sees them."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from ..errors import NotCompilable
from ..formulas.classes.layouts import Layout, build, carried_layout, fits, leaves
from ..formulas.large import size_of
from ..formulas.sites import TOGETHER
from .driver import refusal
from .numbers.ir_numbers import F64, I32, I64, Emitter, Num
from .numbers.large_arrays import in_places, spans

POINTER = F64.as_pointer()


class NativeArray:
    """An array of float64 with numbers for each body; subclasses know where they lie."""

    body: Any = None  # the first of those that run together

    def __init__(self, emitter: Emitter, pointer: ir.Value, step: ir.Value) -> None:
        self.emitter, self.pointer, self.step = emitter, pointer, step

    def first(self, start: Any) -> list[ir.Value]:
        """The addresses of number `start`, one for each load or store of the bodies that run together."""
        raise NotImplementedError

    def load(self, first: list[ir.Value], i: int) -> Any:
        """The number that comes i after the first, of the bodies that run together."""
        raise NotImplementedError

    def store(self, first: list[ir.Value], i: int, x: Any) -> None:
        """Set the number that comes i after the first, of the bodies that run together."""
        raise NotImplementedError

    def read(self, k: Any, layout: Layout) -> Any:
        """Row number k, whose layout this is."""
        first = self.first(self.start(k, layout))
        return build(in_places(layout), iter([self._part(first, *x) for x in spans(layout)]))

    def write(self, k: Any, value: Any, layout: Layout) -> None:
        """Set row number k.  Raises NotCompilable for a value of another layout."""
        first = self.first(self.start(k, layout))
        unchanged(value, layout)
        for x, (kind, i, form) in zip(leaves(value, in_places(layout)), spans(layout), strict=True):
            if kind == "large":
                large = self.emitter.large
                large.move(large.pointer(x), self.after(first[0], i), size_of(form))
            else:
                self.store(first, i, self.as_bits(x, kind))

    def _part(self, first: list[ir.Value], kind: str, i: int, form: Any) -> Any:
        """A number, or the place of a copy of a large part."""
        if kind != "large":
            return self.of_bits(self.load(first, i), kind)
        large = self.emitter.large
        place = large.allocate(size_of(form))
        large.move(self.after(first[0], i), large.pointer(place), size_of(form))
        return place

    def start(self, k: Any, layout: Layout) -> Any:
        """The number with which row k begins."""
        if isinstance(k, int):
            return k * layout.width
        e, width = self.emitter, ir.Constant(I64, layout.width)
        return e.num([e.builder.mul(e.cast(k, "i", False)[0], width)])

    def of_bits(self, x: Num, kind: str) -> Num:
        """A loaded number in its kind: the bits of a float are those of an integer or a truth value."""
        if kind not in ("integer", "truth"):
            return x
        e, b = self.emitter, self.emitter.builder
        whole = e.each(lambda v: b.bitcast(v, e.type("i", x.varying)), x.values)
        return whole if kind == "integer" else whole != 0

    def as_bits(self, x: Any, kind: str) -> Any:
        """A number to be stored: of an integer or truth value the float with its bits."""
        if kind not in ("integer", "truth"):
            return x
        e, b = self.emitter, self.emitter.builder
        varying = isinstance(x, Num) and x.varying
        return e.each(lambda v: b.bitcast(v, e.type("f", varying)), e.cast(x, "i", varying))

    def after(self, place: ir.Value, count: Any) -> ir.Value:
        """The address `count` numbers behind a place."""
        count = ir.Constant(I64, count) if isinstance(count, int) else count
        return self.emitter.builder.gep(place, [count], source_etype=F64)


def unchanged(value: Any, layout: Layout) -> None:
    """`driver.unchanged` while translating: raises NotCompilable for a value that does not fit the layout."""
    actual = carried_layout(value)
    if not fits(actual, layout):
        raise NotCompilable(refusal(actual, layout))


class NativeColumns(NativeArray):
    """A column for each body, neighbours side by side: number k of body i lies at k * bodies + i."""

    @property
    def alone(self) -> bool:
        """Whether there is one body, whose numbers lie side by side."""
        return self.emitter.lanes == 1

    def first(self, start: Any) -> list[ir.Value]:
        e, b = self.emitter, self.emitter.builder
        place = b.add(b.mul(e.cast(start, "i", False)[0], self.step), self.body)
        return [
            self.after(self.pointer, b.add(place, ir.Constant(I64, r * e.width)))
            for r in range(e.registers(e.lanes > 1))
        ]

    def addresses(self, first: list[ir.Value], i: int) -> list[ir.Value]:
        """The addresses of the registers of a number."""
        e, b = self.emitter, self.emitter.builder
        offset = i if self.alone else b.mul(ir.Constant(I64, i), self.step)
        places = [self.after(place, offset) for place in first]
        return places if e.lanes == 1 else [b.bitcast(place, e.type("f", True).as_pointer()) for place in places]

    def load(self, first: list[ir.Value], i: int) -> Any:
        e = self.emitter
        type_ = e.type("f", e.lanes > 1)
        return e.num([e.builder.load(place, align=8, typ=type_) for place in self.addresses(first, i)])

    def store(self, first: list[ir.Value], i: int, x: Any) -> None:
        e = self.emitter
        for v, place in zip(e.cast(x, "f", e.lanes > 1), self.addresses(first, i), strict=True):
            e.builder.store(v, place, align=8)


class SiteRows(NativeColumns):
    """Rows of numbers with a place for each site of one system; `body` is the present site."""

    alone = False

    def __init__(self, emitter: Emitter, array: int, integer: int) -> None:
        """The rows in the array of this number among those of the present function, of as many sites as an integer says."""
        b = emitter.builder
        self.numbers = array, integer
        _, integers, arrays, *_ = b.function.args
        pointer = b.load(b.gep(arrays, [I64(array)], source_etype=POINTER), typ=POINTER)
        count = b.load(b.gep(integers, [I64(integer)], source_etype=I64), typ=I64)
        groups = b.sdiv(b.add(count, I64(TOGETHER - 1)), I64(TOGETHER))
        step = b.mul(b.or_(groups, I64(1)), I64(TOGETHER))
        super().__init__(emitter, pointer, I64(TOGETHER) if emitter.few else step)
        self.count = emitter.num([count])

    def at(self, row: Any) -> ir.Value:
        """The address at which a row of the sites begins."""
        e = self.emitter
        return self.after(self.pointer, e.builder.mul(e.cast(row, "i", False)[0], self.step))


class NativeShared(NativeArray):
    """An array that all bodies share; values written to it must not vary between them."""

    def first(self, start: Any) -> list[ir.Value]:
        return [self.after(self.pointer, self.emitter.cast(start, "i", False)[0])]

    def load(self, first: list[ir.Value], i: int) -> Any:
        e = self.emitter
        return e.num([e.builder.load(self.after(first[0], i), align=8, typ=F64)])

    def store(self, first: list[ir.Value], i: int, x: Any) -> None:
        e = self.emitter
        if isinstance(x, Num) and x.varying:
            raise NotCompilable("what all bodies share cannot be set to another value by each")
        e.builder.store(e.cast(x, "f", False)[0], self.after(first[0], i), align=8)


class NativeRows(NativeArray):
    """A row for each body, as the caller has it: number k of body i lies at i * step + k."""

    def first(self, start: Any) -> list[ir.Value]:
        e, b = self.emitter, self.emitter.builder
        places = [b.add(b.mul(self.body, self.step), e.cast(start, "i", False)[0])]
        while len(places) < e.lanes:
            places.append(b.add(places[-1], self.step))
        return [self.after(self.pointer, place) for place in places]

    def load(self, first: list[ir.Value], i: int) -> Any:
        e, b = self.emitter, self.emitter.builder
        values = [b.load(self.after(place, i), align=8, typ=F64) for place in first]
        if e.lanes == 1:
            return e.num(values)
        registers = []
        for r in range(0, e.lanes, e.width):
            register: ir.Value = ir.Constant(e.type("f", True), ir.Undefined)
            for lane, value in enumerate(values[r : r + e.width]):
                register = b.insert_element(register, value, ir.Constant(I32, lane))
            registers.append(register)
        return e.num(registers)

    def store(self, first: list[ir.Value], i: int, x: Any) -> None:
        e, b = self.emitter, self.emitter.builder
        values = e.cast(x, "f", e.lanes > 1)
        for lane, place in enumerate(first):
            value = values[lane // e.width]
            value = b.extract_element(value, ir.Constant(I32, lane % e.width)) if e.lanes > 1 else value
            b.store(value, self.after(place, i), align=8)


def arguments(emitter: Emitter, kinds: Any, function: ir.Function) -> list[Any]:
    """The driver's arguments: numbers loaded from their buffer, arrays with their columns or rows."""
    b = emitter.builder
    numbers, integers, arrays, bodies, _, _ = function.args
    if emitter.lanes == 1:
        bodies = ir.Constant(I64, 1)
    counts = {"number": 0, "integer": 0, "array": 0}

    def load(buffer: ir.Value, kind: str, type_: ir.Type) -> ir.Value:
        place = b.gep(buffer, [ir.Constant(I64, counts[kind])], source_etype=type_)
        counts[kind] += 1
        return b.load(place, typ=type_)

    def parts(layout: Layout) -> Any:
        """The numbers of a layout, and the places of what lies in memory."""
        begin = counts["number"]
        for kind, at, form in spans(layout):
            if kind != "large":
                yield emitter.num([load(numbers, "number", F64)])
                continue
            place = b.gep(numbers, [ir.Constant(I64, begin + at)], source_etype=F64)
            yield emitter.num([b.ptrtoint(place, I64)])
            counts["number"] = begin + at + size_of(form)

    args: list[Any] = []
    for kind in kinds:
        if isinstance(kind, Layout):
            args.append(build(in_places(kind), parts(kind)))
        elif kind == "integer":
            args.append(emitter.num([load(integers, "integer", I64)]))
        elif kind == "rows":
            args.append(NativeRows(emitter, load(arrays, "array", F64.as_pointer()), load(integers, "integer", I64)))
        elif kind == "planes":
            args.append(SiteRows(emitter, counts["array"], counts["integer"]))
            counts["array"], counts["integer"] = counts["array"] + 1, counts["integer"] + 1
        elif kind == "shared":
            pointer = load(arrays, "array", F64.as_pointer())
            args.append(NativeShared(emitter, pointer, ir.Constant(I64, 1)))
        else:
            args.append(NativeColumns(emitter, load(arrays, "array", F64.as_pointer()), bodies))
    return args


def hidden(emitter: Emitter, array: int, integer: int) -> tuple[SiteRows, ir.Value, ir.Value]:
    """The hidden arguments of loops over sites, in the present function: scratch rows, in the first array behind those of
    the driver, the place for the number of a failed site, and the words that threads share.
    """
    b = emitter.builder
    places = (b.gep(b.function.args[2], [I64(array + k)], source_etype=POINTER) for k in (1, 2))
    notes, crew = [b.bitcast(b.load(place, typ=POINTER), I64.as_pointer()) for place in places]
    return SiteRows(emitter, array, integer), notes, crew


def arrays_of(kinds: Any) -> int:
    """The number of arrays among the arguments of a driver."""
    return sum(not isinstance(kind, Layout) and kind != "integer" for kind in kinds)


def entrance(module: ir.Module, function: ir.Function, kinds: Any, needs: tuple[int, bool, bool]) -> None:
    """Add the function that Python calls with the address of one block: bodies, begin, end, the integers, the
    addresses of arrays, the numbers.

    needs : of loops over sites, the rows of scratch memory; do all pairs of sites meet in them; does one thread run them?
    Called without such memory, for no bodies, the function leaves these in the first three places.
    """
    integers = sum(kind in ("integer", "rows", "planes") for kind in kinds)
    arrays = arrays_of(kinds) + 3 * ("planes" in kinds)
    kernel = ir.Function(module, ir.FunctionType(ir.VoidType(), [I64.as_pointer()]), "kernel")
    b, block = ir.IRBuilder(kernel.append_basic_block("entry")), kernel.args[0]
    places = [
        b.gep(block, [ir.Constant(I64, at)], source_etype=I64)
        for at in (0, 1, 2, 3, 3 + integers, 3 + integers + arrays)
    ]
    bodies, begin, end = (b.load(place, typ=I64) for place in places[:3])
    if "planes" in kinds:
        with b.if_then(b.icmp_signed("==", bodies, I64(0))):
            for x, place in zip(needs, places):
                b.store(I64(int(x)), place)
            b.ret_void()
    integer, array, number = (b.bitcast(p, function.args[i].type) for p, i in zip(places[3:], (1, 2, 0), strict=True))
    b.call(function, [number, integer, array, bodies, begin, end])
    b.ret_void()
