"""Native functions made of formulas, and calls of them."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
from collections.abc import Iterator
from typing import Any

from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.classes.taken_back import back
from ..numbers.ir_numbers import I32, TYPES, Num
from .call_forms import Call, CallForms
from .instructions import Names, TooLong
from .joins import Open
from .scopes import CallFrame

ARGUMENTS = 6
"""Arguments of a kernel."""

RETURNED = 64
"""Registers of results up to which a native function returns them; more it writes into memory."""


class Small(Exception):
    """Raised for a formula of too few instructions to become a function."""


@dataclasses.dataclass(eq=False)
class NativeFunction:
    """A native function made of a formula."""

    function: ir.Function
    heads: int  # so many of the kernel's arguments come first
    memory: ir.Type | None  # the type of its results, where they are too many for registers
    recipe: tuple[str, Any]  # how the result is put together
    kinds: list[tuple[str, bool, bool]]  # of the returned numbers: kind, varying, mixed
    failed: bool  # does it return the mask of failed lanes?
    escapes: bool  # and whether all have failed?
    raises: int  # places that may raise
    calls: int  # places that call the C library
    size: int = 1  # instructions, if LLVM copies it
    spent: list[tuple[Any, int]] = dataclasses.field(default_factory=list)  # the costs of formulas in a copied one


class NativeFunctions:
    """Makes native functions of formulas, and calls them."""

    def __init__(self, translator: Any, forms: CallForms) -> None:
        self.translator, self.emitter, self.forms = translator, translator.emitter, forms
        self.structures: dict[Any, int] = {}  # of results, by their types
        # of the results of those that a function calls, by function and type
        self.buffers: dict[ir.Function, dict[str, ir.Value]] = {}

    # -------------------------------------------------------------- the function

    def make(
        self,
        name: str,
        call: Call,
        frame: CallFrame,
        env: dict[str, Any],
        general: bool,
        least: int,
        copied: bool,
        within: Any = None,
    ) -> NativeFunction | None:
        """The native function for calls of this form; None if the formula must be written out.
        Raises Small if it has fewer instructions than `least`.

        copied : LLVM puts a copy of it in the place of each call.  It counts as written out.
        within : of a function that has all sites, the context in which it is translated; it has the kernel's arguments.
        """
        t, e, b = self.translator, self.emitter, self.emitter.builder
        active, failed = t.active(t.frames[-1].env), t.state.failed if t.state.escapes else []
        passed = call.passed(general)
        heads = 1 if within is None else ARGUMENTS
        function = self._declared(b.module.get_unique_name(name), passed, len(failed), copied, heads)
        native = None
        try:
            with self._within(function, copied), contextlib.ExitStack() as stack:
                b.position_at_end(function.append_basic_block("entry"))
                if within is not None:
                    stack.enter_context(within())
                values = iter(function.args[heads:])
                inner = [Num(e, tuple(next(values) for _ in x.values), x.kind, x.mixed) for x in passed]
                arguments, parts = self.forms.parameters(env, active, call, inner, general, heads > 1)
                t.state.base = arguments.pop("<mask>")
                if failed:
                    t.state.failed, t.state.escapes = e.slot(), [[]]
                    e.store(e.num(tuple(values)), t.state.failed)
                start = function.append_basic_block("start")
                b.branch(start)
                b.position_at_end(start)
                # between the variables of two native functions
                t.frames.append(CallFrame(frame.source, frame.scope, {}))
                before = b.emitted
                result = t.enter(CallFrame(frame.source, frame.scope, arguments))
                size = b.emitted - before
                if b.emitted < least:
                    raise Small
                native = self._finished(function, heads, result, inner, parts, copied)
                if copied:
                    function.size, native.size, native.spent = size, size, t.state.spent
                else:
                    b.finished += b.emitted
        except TooLong:
            raise
        except NotCompilable:
            if within is not None:
                raise
        finally:
            if native is None:
                del b.module.globals[function.name]
        return native

    def _declared(self, name: str, passed: list[Num], failed: int, copied: bool, heads: int) -> ir.Function:
        """A function without a body: of the first arguments of the kernel, of these numbers, and of a mask of failed
        lanes in this number of registers.
        """
        b, e = self.emitter.builder, self.emitter
        types = [x.type for x in b.function.args[:heads]]
        types += [e.type(x.kind, x.varying) for x in passed for _ in x.values]
        types += [e.type("b", e.lanes > 1)] * failed
        function = ir.Function(b.module, ir.FunctionType(ir.VoidType(), types), name)
        function.linkage, function.calling_convention = "internal", "fastcc"
        function.scope = Names(function)
        for fact in ("alwaysinline" if copied else "noinline", "nounwind"):
            function.attributes.add(fact)
        if not copied:
            for pointer in function.args[: min(heads, 3)]:
                pointer.add_attribute("noalias")
            if e.lanes > 1:
                function.attributes.alignstack = 8 * e.width
        return function

    @contextlib.contextmanager
    def _within(self, function: ir.Function, copied: bool) -> Iterator[None]:
        """Translate into another native function inside of this context."""
        t, e = self.translator, self.emitter
        outer, calls, frames, take_back = t.state, e.calls, len(t.frames), back()
        t.state, e.calls = outer.of_function(copied), 0
        try:
            with e.builder.inside(function, copied):
                yield
        finally:
            take_back()
            del t.frames[frames:]
            t.state, e.calls = outer, calls

    def _finished(
        self, function: ir.Function, heads: int, result: Any, inner: list[Num], parts: list[Any], copied: bool
    ) -> NativeFunction:
        """Let the function return its numbers, the lanes that have failed, and whether all have."""
        e, state = self.emitter, self.translator.state
        recipe, numbers = self.forms.recipe(result, inner, parts)
        registers = [v for x in numbers for v in x.values]
        escapes = state.escapes[0] if state.escapes else []
        failed = state.raises > 0
        kinds = [v.type for v in registers]
        kinds += [e.type("b", e.lanes > 1)] * (len(state.failed) if failed else 0)
        kinds += [TYPES["b"]] * bool(escapes)
        type_ = self._structure(kinds)
        buffer = None
        if len(kinds) > RETURNED and not copied:
            buffer = ir.Argument(function, type_.as_pointer())
            buffer.add_attribute("noalias")
        self._returns(type_, buffer, registers, failed, [False] * bool(escapes))
        if escapes:
            self._gather(escapes)
            # of a call that all lanes have left nobody takes results
            self._returns(type_, buffer, registers, failed, [True], without=len(registers))
        self._retyped(function, type_ if kinds else None, buffer)
        return NativeFunction(
            function,
            heads,
            type_ if buffer is not None else None,
            recipe,
            [(x.kind, x.varying, x.mixed) for x in numbers],
            failed,
            bool(escapes),
            state.raises,
            e.calls,
        )

    def _returns(
        self,
        type_: ir.Type,
        buffer: ir.Value | None,
        registers: list[ir.Value],
        failed: bool,
        escaped: list[bool],
        without: int = 0,
    ) -> None:
        """Return these values, the first `without` of them left undefined."""
        b, e = self.emitter.builder, self.emitter
        lanes = e.load(self.translator.state.failed).values if failed else ()
        values = [*registers, *lanes, *[ir.Constant(TYPES["b"], x) for x in escaped]]
        returned = [*enumerate(values)][without:]
        if buffer is not None:
            for i, v in returned:
                b.store(v, _field(b, buffer, i))
            b.ret_void()
            return
        structure = ir.Constant(type_, ir.Undefined)
        for i, v in returned:
            structure = b.insert_value(structure, v, i)
        b.ret(structure) if returned else b.ret_void()

    def _gather(self, opens: list[Open]) -> None:
        """Lead control from all open places to one block."""
        b = self.emitter.builder
        failed = b.append_basic_block()
        for o in opens:
            b.position_at_end(o.block)
            b.branch(failed)
        b.position_at_end(failed)

    @staticmethod
    def _retyped(function: ir.Function, type_: ir.Type | None, buffer: ir.Value | None) -> None:
        """Give a function the type of its results, which is known once its body is."""
        result, extra = (ir.VoidType(), [buffer]) if buffer is not None else (type_, [])
        if result is None:
            return
        arguments = [*function.ftype.args, *(x.type for x in extra)]
        function.ftype = ir.FunctionType(result, arguments)
        function.type = function.ftype.as_pointer()
        function.args = (*function.args, *extra)
        if buffer is None:
            function.return_value = ir.values.ReturnValue(function, result)

    def _structure(self, kinds: list[ir.Type]) -> ir.Type:
        """The type of results of these types; it has a name, because its text would stand at every use."""
        name = f"results {self.structures.setdefault(tuple(map(str, kinds)), len(self.structures))}"
        type_ = self.emitter.builder.module.context.get_identified_type(name)
        if type_.is_opaque:
            type_.set_body(*kinds)
        return type_

    # -------------------------------------------------------------- the call

    def emit(self, native: NativeFunction, call: Call, general: bool) -> Any:
        """A call of the function, and its value."""
        t, b, e = self.translator, self.emitter.builder, self.emitter
        passed = call.passed(general)
        arguments = [*b.function.args[: native.heads], *(v for x in passed for v in x.values)]
        if t.state.escapes:
            arguments += e.load(t.state.failed).values
        if native.memory is not None:
            arguments.append(self._buffer(native.memory))
        results = self._results(native, b.call(native.function, arguments, cconv="fastcc"), arguments)

        def number(kind: str, varying: bool, mixed: bool = False) -> Num:
            values = tuple([next(results) for _ in range(e.registers(varying))])
            return Num(e, values, kind, mixed)

        numbers = [number(*kind) for kind in native.kinds]
        if native.failed:
            e.store(number("b", e.lanes > 1), t.state.failed)
        if native.escapes:
            escaped = next(results)
            failed, on = b.append_basic_block(), b.append_basic_block()
            b.cbranch(escaped, failed, on)
            t.state.escapes[-1].append(Open(failed, {}))
            b.position_at_end(on)
        t.state.raises += native.raises
        e.calls += native.calls
        return self.forms.restored(native.recipe, call, passed, numbers)

    def _results(self, native: NativeFunction, structure: ir.Value, arguments: list[ir.Value]) -> Iterator[ir.Value]:
        """The values that a call has returned, or written into memory, one after the other."""
        b = self.emitter.builder
        for i in itertools.count():
            if native.memory is None:
                yield b.extract_value(structure, i)
            else:
                place = _field(b, arguments[-1], i)
                yield b.load(place, typ=native.memory.elements[i])

    def _buffer(self, type_: ir.Type) -> ir.Value:
        """The memory of the present function where functions leave results of this form."""
        b = self.emitter.builder
        places = self.buffers.setdefault(b.function, {})
        if str(type_) not in places:
            with b.goto_entry_block():
                places[str(type_)] = b.alloca(type_)
        return places[str(type_)]


def _field(b: ir.IRBuilder, place: ir.Value, i: int) -> ir.Value:
    """The address of result number i in a buffer."""
    return b.gep(place, [ir.Constant(I32, 0), ir.Constant(I32, i)], inbounds=True)
