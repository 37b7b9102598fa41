"""Private functions: a formula that is called again and again is emitted once and called, instead of being written out each time.

Small kernels are written out whole.  Once a native function has grown long, a formula that has cost much in it, called again with
arguments of the same form, becomes a function of its own: what is known while translating (classes, integers, texts, tableaus) is
built into it, numbers are passed.  Both ways give the same bits.
"""

from __future__ import annotations

import dataclasses
import struct
import types
from collections.abc import Iterator
from typing import Any

import numpy as np
from llvmlite import ir

from ..errors import NotCompilable
from ..formulas.pytree import PAIRS, Layout, build, fill, is_any_number, layout_of, leaves
from ..formulas.records import Record
from ..formulas.vectors import Mat, Vec
from .ir_numbers import F64, I64, TYPES, Num
from .joins import Open
from .scopes import Frame

LONG = 4000
"""Instructions up to which everything is written out, in each native function."""

WORTH = 1200
"""Instructions that a formula must have cost in a native function before it becomes one of its own."""

LARGE = 120
"""Formulas of fewer instructions are always written out."""

LIMIT = 60_000
"""Instructions of a kernel that LLVM compiles in about ten seconds: more are refused."""

EFFORT = 10
"""How many times the limit may be translated, where a loop is tried in several ways."""


class Builder(ir.IRBuilder):
    """Counts the instructions of a kernel while they are made."""

    emitted = 0  # in the present native function, without what was taken back
    finished = 0  # in the other ones
    made = 0  # in all, with what was taken back

    def _insert(self, instruction: Any) -> None:
        self.emitted += 1
        self.made += 1
        if self.emitted + self.finished > LIMIT or self.made > EFFORT * LIMIT:
            size = f"more than {LIMIT} instructions" if self.made <= EFFORT * LIMIT else f"{self.made} instructions in several tries"
            raise TooLong(
                f"the native code would be too long, {size}, and take more than about ten seconds to make. Take a method of fewer "
                "stages or a lower order, a smaller group, closed forms for what is now derived (`dtau`, `gradient`), or compiled=False"
            )
        super()._insert(instruction)


class TooLong(NotCompilable):
    """There is no other way to translate that would be shorter."""


class Unknown(Exception):
    """An argument whose form cannot be told: the call is written out."""


@dataclasses.dataclass(eq=False)
class Outlined:
    """A native function made of a formula."""

    function: ir.Function
    layout: Layout  # of the result
    places: list[tuple[str, Any]]  # of its numbers: in the returned structure, among the arguments, or a constant
    kinds: list[tuple[str, bool]]  # of the returned numbers
    failed: bool  # does it return which lanes have failed
    escapes: bool  # and whether all have
    raises: int
    calls: int


@dataclasses.dataclass(eq=False)
class Call:
    """The arguments of a call: what is known now, and numbers."""

    known: tuple[Any, ...]
    general: tuple[Any, ...]  # the same without the constants inside vectors, matrices and pairs
    numbers: list[Num]  # without those that occur before and those of the kernel's arguments
    constants: list[Num]  # of the general form, also to be passed


class Outliner:
    """Decides which calls become calls of native functions, and makes these."""

    def __init__(self, translator: Any) -> None:
        self.t, self.e = translator, translator.emitter
        self.spent: list[tuple[Any, int]] = []  # what formulas have cost in the present native function, by form of the call
        self.large: set[Any] = set()  # formulas that have been large
        self.made: dict[Any, Outlined | None] = {}  # None: it has to be written out
        self.kept: dict[int, Any] = {}  # objects that are told apart by their identity

    def enter(self, frame: Frame) -> Any:
        """The value of a call, made here or written out."""
        t, b = self.t, self.e.builder
        function, given = frame.source.function, dict(frame.env)
        if function in self.large and b.emitted >= LONG:
            call = self.call(function, given)
            for general, key in ((False, call.known), (True, call.general)) if call else ():
                if self.made.get(key, key) is not None and (key in self.made or self._cost(key) >= WORTH * (1 + general)):
                    made = self.made[key] if key in self.made else self.make(key, frame, given, general)
                    if made is not None:
                        return self.emit(made, call, general)
        before, spent = b.emitted, self.spent
        result = t.enter(frame)
        cost = b.emitted - before
        if cost >= LARGE and spent is self.spent:
            self.large.add(function)
            call = self.call(function, given)
            if call:
                spent += [(call.known, cost), (call.general, cost)] if call.general != call.known else [(call.known, cost)]
        return result

    def _cost(self, key: Any) -> int:
        return sum(cost for k, cost in self.spent if k == key)

    # -------------------------------------------------------------- the form of a call

    def call(self, function: Any, given: dict[str, Any]) -> Call | None:
        """None if there is an argument whose form cannot be told."""
        active = self.t.active(self.t.frames[-1].env) if self.t.frames else None
        seen: dict[Any, int] = {}
        numbers: list[Num] = []
        constants: list[Num] = []

        def form(x: Any, inside: bool, general: bool) -> Any:
            if isinstance(x, Num):
                place = self._parameter(x)
                if place is not None:
                    return "parameter", place
                if x.values not in seen:
                    seen[x.values] = len(seen)
                    numbers.append(x)
                return x.kind, x.varying, seen[x.values]
            if type(x) is float:
                if general and inside:
                    constants.append(self.e.constant(x))
                    return "constant"
                return "float", struct.pack("<d", x)
            if x is None or isinstance(x, (bool, int, str, bytes)):
                return type(x), x
            if isinstance(x, (Vec, *PAIRS, Mat)):
                parts = x.parts if isinstance(x, PAIRS) else x
                kind = layout_of(x, is_any_number).detail if isinstance(x, PAIRS) else type(x)
                return kind, tuple([form(y, True, general) for y in parts])
            if type(x) in (tuple, list):
                if type(x) is tuple and self._constant(x):
                    return self._identity(x)
                return type(x), tuple([form(y, inside, general) for y in x])
            if isinstance(x, Record):
                if not layout_of(x).width:
                    return self._identity(x)
                return type(x), tuple([form(getattr(x, f.name), inside, general) for f in dataclasses.fields(x)])  # type: ignore[arg-type]
            if isinstance(x, (types.FunctionType, types.BuiltinFunctionType, type, np.ndarray, np.generic, range, Layout)):
                return self._identity(x)
            raise Unknown

        try:
            items = [*given.items(), ("<mask>", active)]
            known = tuple([(name, form(x, False, False)) for name, x in items])
            count = len(numbers)
            general = tuple([(name, form(x, False, True)) for name, x in items])
        except Unknown:
            return None
        assert len(numbers) == count
        here = function, bool(self.t.escapes)
        return Call((*here, known), (*here, general), numbers, constants)

    def _identity(self, x: Any) -> Any:
        self.kept[id(x)] = x
        return "object", id(x)

    def _constant(self, x: Any) -> bool:
        """A tuple of nothing but constants, such as the rows of a tableau."""
        if id(x) in self.kept:
            return True
        if type(x) is not tuple or not x:
            return x is None or isinstance(x, (bool, int, float, str))
        return all(map(self._constant, x))

    def _parameter(self, x: Num) -> int | None:
        """Which of the kernel's arguments a number is: the functions read these themselves."""
        v = x.values[0]
        if isinstance(v, ir.LoadInstr) and isinstance(v.operands[0], ir.GEPInstr):
            pointer = v.operands[0]
            if pointer.pointer is self.e.builder.function.args[0]:
                return pointer.indices[0].constant
        return None

    # -------------------------------------------------------------- the function

    def make(self, key: Any, frame: Frame, given: dict[str, Any], general: bool) -> Outlined | None:
        """The native function of a formula, for calls of this form; None if it has to be written out."""
        t, b = self.t, self.e.builder
        active = t.active(t.frames[-1].env)
        call = self.call(frame.source.function, given)
        assert call is not None
        state = t.base, t.depth, t.failed, t.escapes, t.raises, t.region, self.e.calls, self.spent
        block, outer = b.block, b.emitted
        frames, module = len(t.frames), b.module
        passed = [*call.numbers, *(call.constants if general else [])]
        types_ = [b.function.args[0].type, *(self.e.type(x.kind, x.varying) for x in passed for _ in x.values)]
        slots = len(t.failed) if t.escapes else 0
        types_ += [self.e.type("b", self.e.lanes > 1)] * slots
        name = module.get_unique_name(f"{frame.source.function.__name__}.{len(self.made)}")
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), types_), name)
        function.linkage, function.calling_convention = "internal", "fastcc"
        for fact in ("noinline", "nounwind"):
            function.attributes.add(fact)
        function.args[0].add_attribute("noalias")
        if self.e.lanes > 1:
            function.attributes.alignstack = 8 * self.e.width
        b.finished, b.emitted, self.spent = b.finished + outer, 0, []
        escapes: list[Open] = []
        made: Outlined | None = None
        try:
            b.position_at_end(function.append_basic_block("entry"))
            values = iter(function.args[1:])
            inner = [Num(self.e, tuple(next(values) for _ in x.values), x.kind) for x in passed]
            arguments = self._inside(given, active, call, inner, general, function)
            t.base, t.depth, t.raises, self.e.calls = arguments.pop("<mask>"), 0, 0, 0
            t.failed, t.escapes = None, []
            if slots:
                t.failed, t.escapes = self.e.slot(), [escapes]
                self.e.store(self.e.num(tuple(values)), t.failed)
            start = function.append_basic_block("start")
            b.branch(start)
            b.position_at_end(start)
            t.frames.append(Frame(frame.source, frame.scope, {}))  # between the variables of two native functions
            result = t.enter(Frame(frame.source, frame.scope, arguments))
            made = self._returned(function, result, inner, escapes, given)
            b.finished += b.emitted
        except NotCompilable as error:
            if isinstance(error, TooLong):
                raise
            del module.globals[name]
        del t.frames[frames:]
        t.base, t.depth, t.failed, t.escapes, t.raises, t.region, self.e.calls, self.spent = state
        b.finished, b.emitted = b.finished - outer, outer
        b.position_at_end(block)
        self.made[key] = made
        return made

    def _inside(
        self, given: dict[str, Any], active: Any, call: Call, inner: list[Num], general: bool, function: ir.Function
    ) -> dict[str, Any]:
        """The arguments as the function sees them."""
        of = {x.values: y for x, y in zip(call.numbers, inner)}
        constants = iter(inner[len(call.numbers) :])
        loaded: dict[int, Num] = {}
        b = self.e.builder

        def seen(x: Any, inside: bool) -> Any:
            if isinstance(x, Num):
                if x.values in of:
                    return of[x.values]
                load: Any = x.values[0]
                index = load.operands[0].indices[0]
                if index.constant not in loaded:
                    loaded[index.constant] = self.e.num([b.load(b.gep(function.args[0], [index], source_etype=F64), typ=F64)])
                return loaded[index.constant]
            if type(x) is float:
                return next(constants) if general and inside else x
            if isinstance(x, (Vec, *PAIRS, Mat)):
                layout = layout_of(x, is_any_number)
                if isinstance(x, PAIRS):
                    flat = [leaf for part in x.parts for leaf in leaves(seen(part, True), layout_of(part, is_any_number))]
                    return build(layout, iter(flat))
                return type(x)(*[seen(y, True) for y in x])
            if type(x) in (tuple, list) and not (type(x) is tuple and self._constant(x)):
                return type(x)([seen(y, inside) for y in x])
            if isinstance(x, Record) and layout_of(x).width:
                return fill(type(x), {f.name: seen(getattr(x, f.name), inside) for f in dataclasses.fields(x)})  # type: ignore[arg-type]
            return x

        return {name: seen(x, False) for name, x in [*given.items(), ("<mask>", active)]}

    def _returned(
        self, function: ir.Function, result: Any, inner: list[Num], escapes: list[Open], given: dict[str, Any]
    ) -> Outlined:
        """Let the function return: its numbers, the lanes that have failed, and whether all have."""
        t, b, e = self.t, self.e.builder, self.e
        self._check(result, given)
        layout = layout_of(result, is_any_number)
        arguments = {x.values: i for i, x in enumerate(inner)}
        places: list[tuple[str, Any]] = []
        numbers: list[Num] = []
        at: dict[Any, int] = {}
        for x in leaves(result, layout):
            if not isinstance(x, Num):
                places.append(("constant", x))
            elif x.values in arguments:
                places.append(("argument", arguments[x.values]))
            else:
                place = self._parameter(x)
                if place is not None:
                    places.append(("parameter", place))
                    continue
                if x.values not in at:
                    at[x.values] = len(numbers)
                    numbers.append(x)
                places.append(("result", at[x.values]))
        registers = [v for x in numbers for v in x.values]
        failed = t.raises > 0
        kinds = [v.type for v in registers]
        if failed:
            kinds += [e.type("b", e.lanes > 1)] * len(t.failed)
        if escapes:
            kinds.append(TYPES["b"])
        type_ = ir.LiteralStructType(kinds)

        def leave(escaped: bool) -> None:
            values = [ir.Constant(v.type, ir.Undefined) for v in registers] if escaped else registers
            if failed:
                values = [*values, *e.load(t.failed).values]
            if escapes:
                values = [*values, ir.Constant(TYPES["b"], escaped)]
            whole = ir.Constant(type_, ir.Undefined)
            for i, v in enumerate(values):
                whole = b.insert_value(whole, v, i)
            b.ret(whole) if values else b.ret_void()

        leave(False)
        for o in escapes:
            b.position_at_end(o.block)
            leave(True)
        if kinds:
            function.ftype = ir.FunctionType(type_, function.ftype.args)
            function.type = function.ftype.as_pointer()
            function.return_value = ir.values.ReturnValue(function, type_)
        return Outlined(
            function, layout, places, [(x.kind, x.varying) for x in numbers], failed, bool(escapes), t.raises, e.calls
        )

    def _check(self, result: Any, given: dict[str, Any]) -> None:
        """A result that can be put together again by every caller."""
        lists = list(_lists(result))
        if lists and (any(True for x in given.values() for _ in _lists(x)) or len({*map(id, lists)}) < len(lists)):
            raise NotCompilable("a list that may have another name")

        def check(layout: Layout) -> None:
            x = layout.detail
            if layout.kind == "static" and not (
                x is None or isinstance(x, (bool, int, str, tuple, Record, types.FunctionType, type)) and not isinstance(x, Num)
            ):
                raise NotCompilable(f"a result that holds {type(x).__name__}")
            for part in layout.parts:
                check(part)

        check(layout_of(result, is_any_number))

    # -------------------------------------------------------------- the call

    def emit(self, made: Outlined, call: Call, general: bool) -> Any:
        """A call of the function, and its value."""
        t, b, e = self.t, self.e.builder, self.e
        passed = [*call.numbers, *(call.constants if general else [])]
        arguments = [b.function.args[0], *(v for x in passed for v in x.values)]
        if t.escapes:
            arguments += e.load(t.failed).values
        structure = b.call(made.function, arguments, cconv="fastcc")
        at = 0

        def next_number(kind: str, varying: bool) -> Num:
            nonlocal at
            count = e.registers(varying)
            at += count
            return Num(e, tuple(b.extract_value(structure, i) for i in range(at - count, at)), kind)

        numbers = [next_number(*kind) for kind in made.kinds]
        if made.failed:
            e.store(next_number("b", e.lanes > 1), t.failed)
        if made.escapes:
            escaped = b.extract_value(structure, at)
            gone, on = b.append_basic_block(), b.append_basic_block()
            b.cbranch(escaped, gone, on)
            t.escapes[-1].append(Open(gone, {}))
            b.position_at_end(on)
        t.raises += made.raises
        e.calls += made.calls

        def parameter(index: int) -> Num:
            return e.num([b.load(b.gep(b.function.args[0], [ir.Constant(I64, index)], source_etype=F64), typ=F64)])

        of = {"constant": lambda x: x, "parameter": parameter, "argument": lambda i: passed[i], "result": lambda i: numbers[i]}
        return build(made.layout, iter([of[kind](x) for kind, x in made.places]))


def _lists(value: Any) -> Iterator[list[Any]]:
    if isinstance(value, list):
        yield value
    if isinstance(value, Record):
        value = [getattr(value, f.name) for f in dataclasses.fields(value)]  # type: ignore[arg-type]
    if isinstance(value, (tuple, list)):
        for x in value:
            yield from _lists(x)
