"""Private functions: a formula that is called again and again is emitted once and called, instead
of being written out each time.

Small kernels are written out whole.  Once a native function has grown long, a formula that has cost
much in it, called again with arguments of the same form, becomes a function of its own: what is
known while translating (classes, integers, texts, tableaus) is built into it, numbers are passed.
Both ways give the same bits.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import struct
import types
from collections.abc import Iterator
from typing import Any

import numpy as np
from llvmlite import ir

from ..errors import NotCompilable
from ..formulas.pytree import PAIRS, Layout, build, fill, is_any_number, layout_of, leaves
from ..formulas.records import Record
from ..formulas.tables import Table
from ..formulas.taken_back import back
from ..formulas.vectors import Mat, Vec
from .aliases import lists
from .ir_numbers import F64, I32, I64, TYPES, Num
from .joins import Open
from .scopes import Frame

LONG = 2500
"""Instructions up to which everything is written out, in each native function."""

WORTH = 600
"""Instructions that a formula must have cost in a native function before it becomes one of its own."""

LARGE = 120
"""Formulas of fewer instructions are always written out."""

HUGE = 3000
"""Formulas of more instructions are never written out in a native function that has been made of a
formula.
"""

SLACK, MOST = 1.25, 0.8
"""Writing out is given up when so many times HUGE have been emitted, some of which might have been
taken back later; the innermost formula that has this part of HUGE becomes a function.
"""

ALONE = 5
"""The kernel of a single body, not the functions that it calls, may write out so many times more:
there a call costs most.
"""

WHOLE = 3
"""The kernel of an ensemble may write out formulas that are so many times larger."""

COPIED = 60
"""Instructions from which a formula that is written out is translated once for all calls of one
form: LLVM copies it.
"""

PER_NUMBER = 4
"""So many more for each number that the formula is given."""

WIDE = 64
"""Numbers of a state from which this is no longer so: the formulas of large groups take much longer
than a call.
"""

WIDEST = 1000
"""Numbers of a state from which nothing is compiled: to carry so many in registers takes too long
to make.
"""

RETURNED = 64
"""Registers of results up to which a native function returns them; more it writes into memory."""

LIMIT = 100_000
"""Instructions of a kernel that LLVM compiles in about ten seconds: more are refused."""

SIDE_BY_SIDE = 9000
"""Instructions up to which each number of an ensemble takes two registers: one works while the
other waits for a result.
"""

SHORT = 5500
"""Instructions of a kernel of one register a number up to which it is also made with two."""

EFFORT = 2.5
"""How many times the limit may be translated, where formulas and loops are tried in several ways."""


class Builder(ir.IRBuilder):
    """Counts the instructions of a kernel while they are made."""

    emitted = 0  # in the present native function, without what was taken back
    room: float = math.inf  # up to which the formula that is being written out may make it grow
    finished = 0  # in the other ones
    made = 0  # in all, with what was taken back

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
        """So many instructions more.  Raises Growing, TooLong."""
        self.emitted += count
        if self.emitted > self.room:
            raise Growing
        if self.emitted + self.finished > self.limit:
            self.finished = _reachable(self.within) - self.emitted
        if self.emitted + self.finished > self.limit or self.made > EFFORT * LIMIT:
            tries = f"{self.made} instructions, all tries counted,"
            size = tries if self.made > EFFORT * LIMIT else f"more than {self.limit} instructions"
            raise TooLong(
                f"the native code would be too long: {size} take more than about ten seconds to "
                "make. Take fewer stages or a lower order, a smaller group, closed forms for what "
                "is derived, or compiled=False"
            )

    def floats(self, op: str, a: ir.Value, b: ir.Value) -> ir.Value:
        """Arithmetic of two floats of one type."""
        made = Arithmetic(self._block, op, a, b)
        self._insert(made)
        return made


class Arithmetic(ir.Instruction):
    """Two floats added, subtracted, multiplied or divided: most instructions are such, and this
    makes them in half the time.
    """

    def __init__(self, block: ir.Block, op: str, a: ir.Value, b: ir.Value) -> None:
        self.parent, self.type, self.opname, self.operands = block, a.type, op, (a, b)
        self._name = block.scope.register("")

    def _to_string(self) -> str:
        a, b = self.operands
        return f"{self.get_reference()} = {self.opname} {self.type} {a.get_reference()}, {b.get_reference()}"


class Names:
    """The names in a native function: numbers, quicker than those of llvmlite."""

    def __init__(self, function: ir.Function) -> None:
        self.count = len(function.args)

    def register(self, name: str, deduplicate: bool = False) -> str:
        """A name that no other value or block has."""
        self.count += 1
        return f"{name}.{self.count}"


def _called(function: ir.Function) -> set[ir.Function]:
    """The functions of the module that a function calls."""
    calls = (
        i.callee
        for block in function.blocks
        for i in block.instructions
        if isinstance(i, ir.CallInstr)
    )
    return {f for f in calls if isinstance(f, ir.Function) and f.blocks}


def _alive(functions: list[ir.Function]) -> set[ir.Function]:
    """These functions and those that are called by them, by these, ..."""
    found, open_ = set(functions), list(functions)
    while open_:
        new = _called(open_.pop()) - found
        found |= new
        open_ += new
    return found


def _reachable(functions: list[ir.Function]) -> int:
    """The instructions of functions and of what they call, copies counted as often as they are
    made.
    """
    whole = (f for f in _alive(functions) if f in functions or not hasattr(f, "size"))
    instructions = (i for f in whole for block in f.blocks for i in block.instructions)
    return sum(getattr(getattr(i, "callee", None), "size", 1) for i in instructions)


def drop_unused(module: ir.Module, kernel: ir.Function) -> int:
    """Remove the functions that nobody calls any more: their calls were taken back.  The number of
    instructions that are left.
    """
    alive = _alive([kernel])
    for name, value in [*module.globals.items()]:
        if isinstance(value, ir.Function) and value.blocks and value not in alive:
            del module.globals[name]
    return _reachable([kernel])


class TooLong(NotCompilable):
    """There is no other way to translate that would be shorter."""


class Growing(Exception):
    """A formula that is being written out is too large for it."""


class Unknown(Exception):
    """An argument whose form cannot be told: the call is written out."""


@dataclasses.dataclass(eq=False)
class Outlined:
    """A native function made of a formula."""

    function: ir.Function
    memory: ir.Type | None  # of the results, where they are too many for registers
    pattern: Any  # how the result is put together, of returned numbers, arguments and constants
    kinds: list[tuple[str, bool, bool]]  # of the returned numbers
    failed: bool  # does it return which lanes have failed
    escapes: bool  # and whether all have
    raises: int
    calls: int
    # of one that LLVM copies: its instructions, and what formulas in it have cost
    size: int
    spent: list[tuple[Any, int]]


@dataclasses.dataclass(eq=False)
class Call:
    """The arguments of a call: what is known now, and numbers."""

    known: tuple[Any, ...]
    # the same, the constants inside vectors, matrices and pairs passed like numbers
    general: tuple[Any, ...]
    numbers: list[Num]  # without those that occur before and those of the kernel's arguments
    all_numbers: list[Num]  # those of the general form
    constants: list[int]  # which of them are constants
    parts: list[Any]  # the vectors, records, ... among the arguments and in them

    def passed(self, general: bool) -> list[Num]:
        """What a function of this form is given."""
        return self.all_numbers if general else self.numbers


class Outliner:
    """Decides which calls become calls of native functions, and makes these."""

    def __init__(self, translator: Any) -> None:
        self.t, self.e = translator, translator.emitter
        # what formulas have cost in the present native function, by form of the call
        self.spent: list[tuple[Any, int]] = []
        self.large: set[Any] = set()  # formulas that have been large
        self.made: dict[Any, Outlined | None] = {}  # None: it has to be written out
        self.copied: set[Any] = set()  # formulas of which some call was worth a copy
        # by form of the call, what LLVM copies; None: there was one call; False: it has no copies
        self.copies: dict[Any, Outlined | bool | None] = {}
        # in lanes a formula has as many instructions more as its numbers take registers
        self.patience = ALONE if self.e.lanes == 1 else self.e.registers(True)
        self.huge = (ALONE if self.e.lanes == 1 else WHOLE) * HUGE
        # by its identity, a constant and what tells it from others
        self.kept: dict[int, tuple[Any, Any]] = {}
        self.grown: set[Any] = set()  # formulas that were too large to be written out
        self.structures: dict[Any, int] = {}  # of results, by their types
        # of native functions, for the results of those they call
        self.buffers: dict[ir.Function, dict[str, ir.Value]] = {}
        # where the formulas begin that are being written out in the present native function
        self.begun: list[int] = []

    def fitting(self, layout: Layout) -> Layout:
        """The layout of a state, refused if it is too wide.  Raises TooLong."""
        if layout.width > WIDEST:
            raise TooLong(
                f"the native code would be too long: a state of {layout.width} numbers, more than "
                f"{WIDEST}, takes more than about ten seconds to make. Take a smaller group, leave "
                "out what is not needed (the element g), or compiled=False"
            )
        if layout.width > WIDE:
            self.patience, self.huge = 1, HUGE
        return layout

    def enter(self, frame: Frame) -> Any:
        """The value of a call, made here or written out."""
        t, b = self.t, self.e.builder
        function, given = frame.source.function, dict(frame.env)
        if function in self.large and b.emitted >= LONG * self.patience:
            call = self.call(function, given)
            if call:
                key, general = self._chosen(call)
                made = self.made.get(key) or (
                    self.make(key, frame, given, general) if key else None
                )
                if made is not None:
                    return self.emit(made, call, general)
        elif function in self.grown and t.frames:
            call = self.call(function, given)
            if call:
                return self._grown(call, frame, given)
        before, spent = b.emitted, self.spent
        if not t.frames:
            return t.enter(frame)
        forget = t.mark()
        try:
            with self._limited(before):
                result = self._copy(frame, given)
            large = b.emitted - before >= self.huge
        except Growing:
            large = b.emitted - before >= MOST * self.huge
            if not large:
                raise
        cost = b.emitted - before
        if large:  # it becomes a function
            forget()
            self.grown.add(function)
            call = self.call(function, given)
            return self._grown(call, frame, given) if call else self._written_out(frame, given)
        if cost >= LARGE and spent is self.spent:
            self.large.add(function)
            call = self.call(function, given)
            if call:
                spent += (
                    [(call.known, cost), (call.general, cost)]
                    if call.general != call.known
                    else [(call.known, cost)]
                )
        return result

    def _grown(self, call: Call, frame: Frame, given: dict[str, Any]) -> Any:
        """The value of a call of a formula that has been too large to be written out."""
        for key, general in ((call.general, True), (call.known, False)):
            made = (
                self.made[key] if key in self.made else self.make(key, frame, given, general, WORTH)
            )
            if made is not None:
                return self.emit(made, call, general)
        return self._written_out(frame, given)

    def _copy(self, frame: Frame, given: dict[str, Any]) -> Any:
        """The value of a call that is written out; from the second call of one form on as a copy,
        which LLVM makes.
        """
        function, b = frame.source.function, self.e.builder
        call = self.call(function, given) if function in self.copied else None
        if call and call.known in self.copies:
            made = self.copies[call.known]
            if made is None:
                made = self.make(("copy", call.known), frame, given, False, 0, True) or False
                self.copies[call.known] = made
            if isinstance(made, Outlined):
                before, result = b.emitted, self.emit(made, call, False)
                b.emitted = before
                b.grow(made.size)
                self.spent += made.spent
                return result
        before = b.emitted
        result = self.t.enter(frame)
        cost = b.emitted - before
        if cost >= COPIED:
            call = call or self.call(function, given)
            if call and cost >= COPIED + PER_NUMBER * len(call.numbers):
                self.copied.add(function)
                self.copies.setdefault(call.known)
        return result

    def _written_out(self, frame: Frame, given: dict[str, Any]) -> Any:
        """The value of a call that has to be written out, however large: what is around it does not
        count that.
        """
        b, begun, room = self.e.builder, self.begun, self.e.builder.room
        self.begun, b.room, before = [], math.inf, b.emitted
        try:
            return self.t.enter(Frame(frame.source, frame.scope, given))
        finally:
            begun[:] = [x + b.emitted - before for x in begun]
            self.begun, b.room = begun, room + b.emitted - before

    @contextlib.contextmanager
    def _limited(self, begin: int) -> Iterator[None]:
        """What is being written out may not become huge."""
        begun, b = self.begun, self.e.builder
        begun.append(begin)
        b.room = begun[0] + SLACK * self.huge
        try:
            yield
        finally:
            begun.pop()
            b.room = begun[0] + SLACK * self.huge if begun else math.inf

    def _chosen(self, call: Call) -> tuple[Any, bool]:
        """The form in which a call becomes one of a function, and whether it is the general one;
        None for neither.
        """
        known, general = self._cost(call.known), self._cost(call.general)
        for key, is_general, worth in (
            (call.general, True, general > known),
            (call.known, False, True),
        ):
            if self.made.get(key) is not None:
                return key, is_general
            if worth and key not in self.made and (general if is_general else known) >= WORTH:
                return key, is_general
        return None, False

    def _cost(self, key: Any) -> int:
        return sum(cost for k, cost in self.spent if k == key)

    # -------------------------------------------------------------- the form of a call

    def call(self, function: Any, given: dict[str, Any]) -> Call | None:
        """None if there is an argument whose form cannot be told."""
        active = self.t.active(self.t.frames[-1].env) if self.t.frames else None
        seen: dict[Any, int] = {}
        numbers: list[Num] = []
        constants: list[int] = []
        parts: list[Any] = []
        places: dict[int, int] = {}

        def form(x: Any, inside: bool, general: bool) -> Any:
            if isinstance(x, Num):
                place = self._parameter(x)
                if place is not None:
                    return "parameter", place
                if x.values not in seen:
                    seen[x.values] = len(numbers)
                    numbers.append(x)
                return x.kind, x.varying, x.mixed, seen[x.values]
            if type(x) is float:
                if general and inside:
                    constants.append(len(numbers))
                    numbers.append(self.e.constant(x))
                    return "f", False, False, constants[-1]
                return self._told(x)
            if x is None or isinstance(x, (bool, int, str, bytes)) or self._whole(x):
                return self._told(x)
            if not isinstance(x, _STRUCTURES):
                raise Unknown
            if id(x) in places:
                return "again", places[id(x)]
            places[id(x)] = len(parts)
            parts.append(x)
            inside = inside or isinstance(x, (Vec, Mat, *PAIRS))
            kind = layout_of(x, is_any_number).detail if isinstance(x, PAIRS) else type(x)
            return kind, tuple([form(y, inside, general) for y in _parts(x)])

        try:
            items = [*given.items(), ("<mask>", active)]
            known = tuple([(name, form(x, False, False)) for name, x in items])
            of_known, all_parts = [*numbers], [*parts]
            for container in (numbers, seen, places, parts):
                container.clear()
            general = tuple([(name, form(x, False, True)) for name, x in items])
        except Unknown:
            return None
        here = function, bool(self.t.escapes)
        return Call((*here, known), (*here, general), of_known, numbers, constants, all_parts)

    def _told(self, x: Any) -> Any:
        """What tells a constant from others: of records and tuples that formulas made, the content;
        else the identity.
        """
        if x is None or isinstance(x, (bool, int, str, bytes)):
            return type(x), x
        if type(x) is float:
            return "float", struct.pack("<d", x)
        if id(x) not in self.kept:
            told: Any = "object", id(x)
            if (type(x) is tuple or isinstance(x, Record)) and self.t.reads.made(x):
                told = type(x), tuple([self._told(y) for y in _parts(x)])
            self.kept[id(x)] = x, told
        return self.kept[id(x)][1]

    def _whole(self, x: Any) -> bool:
        """A constant that has no parts for a run: a function, an array, a record or tuple of nothing
        but constants.
        """
        if (
            id(x) in self.kept
            or isinstance(x, _OBJECTS)
            or (isinstance(x, Table) and x.content is not None)
        ):
            return True
        if type(x) is tuple:
            return all(
                y is None
                or isinstance(y, (bool, int, float, str))
                or (type(y) is tuple and self._whole(y))
                for y in x
            )
        return isinstance(x, Record) and not layout_of(x).width

    def _parameter(self, x: Num) -> int | None:
        """Which of the kernel's arguments a number is: the functions read these themselves."""
        v = x.values[0]
        place = self._parameter_of(x)
        return (
            place
            if place is not None and v.operands[0].pointer is self.e.builder.function.args[0]
            else None
        )

    def _parameter_of(self, x: Num) -> int | None:
        v = x.values[0]
        if isinstance(v, ir.LoadInstr) and isinstance(v.operands[0], ir.GEPInstr) and v.type == F64:
            pointer = v.operands[0]
            if isinstance(pointer.pointer, ir.Argument) and isinstance(
                pointer.indices[0], ir.Constant
            ):
                return pointer.indices[0].constant
        return None

    def _loaded(self, place: int) -> Num:
        """This argument of the kernel, in the present function."""
        b = self.e.builder
        return self.e.num(
            [
                b.load(
                    b.gep(b.function.args[0], [ir.Constant(I64, place)], source_etype=F64), typ=F64
                )
            ]
        )

    # -------------------------------------------------------------- the function

    def make(
        self,
        key: Any,
        frame: Frame,
        given: dict[str, Any],
        general: bool,
        least: int = 0,
        copied: bool = False,
    ) -> Outlined | None:
        """The native function of a formula, for calls of this form; None if it must be written out,
        or has too few instructions.

        copied : LLVM puts a copy of it in the place of each call.  It counts as written out.
        """
        t, b = self.t, self.e.builder
        active = t.active(t.frames[-1].env)
        call = self.call(frame.source.function, given)
        assert call is not None
        state = t.base, t.depth, t.failed, t.outcome, t.escapes, t.raises, t.marks, t.region
        calls, spent = self.e.calls, self.spent
        patience, begun, room = (self.patience, self.huge), self.begun, b.room
        block, outer = b.block, b.emitted
        frames, module = len(t.frames), b.module
        passed = call.passed(general)
        types_ = [
            b.function.args[0].type,
            *(self.e.type(x.kind, x.varying) for x in passed for _ in x.values),
        ]
        slots = len(t.failed) if t.escapes else 0
        types_ += [self.e.type("b", self.e.lanes > 1)] * slots
        name = module.get_unique_name(f"{frame.source.function.__name__}.{len(self.made)}")
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), types_), name)
        function.linkage, function.calling_convention, function.scope = (
            "internal",
            "fastcc",
            Names(function),
        )
        for fact in ("alwaysinline" if copied else "noinline", "nounwind"):
            function.attributes.add(fact)
        self.spent = []
        if not copied:
            function.args[0].add_attribute("noalias")
            if self.e.lanes > 1:
                function.attributes.alignstack = 8 * self.e.width
            b.finished, b.emitted, self.patience, self.huge = b.finished + outer, 0, 1, HUGE
            self.begun, b.room = [], math.inf
        b.within.append(function)
        escapes: list[Open] = []
        made: Outlined | None = None
        take_back = back()
        try:
            b.position_at_end(function.append_basic_block("entry"))
            values = iter(function.args[1:])
            inner = [
                Num(self.e, tuple(next(values) for _ in x.values), x.kind, x.mixed) for x in passed
            ]
            arguments, parts = self._inside(given, active, call, inner, general, function)
            t.base, t.depth, t.raises, t.marks, self.e.calls = arguments.pop("<mask>"), 0, 0, 0, 0
            t.failed, t.outcome, t.escapes = None, None, []
            if slots:
                t.failed, t.escapes = self.e.slot(), [escapes]
                self.e.store(self.e.num(tuple(values)), t.failed)
            start = function.append_basic_block("start")
            b.branch(start)
            b.position_at_end(start)
            # between the variables of two native functions
            t.frames.append(Frame(frame.source, frame.scope, {}))
            before = b.emitted
            result = t.enter(Frame(frame.source, frame.scope, arguments))
            size = b.emitted - before
            if b.emitted >= least:
                made = self._returned(function, result, inner, parts, escapes, copied)
                if copied:
                    function.size, made.size, made.spent = size, size, self.spent
                else:
                    b.finished += b.emitted
            else:
                self.made.setdefault(call.known, None)
        except NotCompilable as error:
            if isinstance(error, TooLong):
                raise
        except Growing:
            outer = b.emitted  # the formula that becomes a function is found by that
            raise
        finally:
            take_back()
            if made is None:
                del module.globals[name]
            b.within.pop()
            del t.frames[frames:]
            t.base, t.depth, t.failed, t.outcome, t.escapes, t.raises, t.marks, t.region = state
            self.e.calls, self.spent = calls, spent
            (self.patience, self.huge), self.begun, b.room = patience, begun, room
            if not copied:
                b.finished -= outer
            b.emitted = outer
            b.position_at_end(block)
        self.made[key] = made
        return made

    def _inside(
        self,
        given: dict[str, Any],
        active: Any,
        call: Call,
        inner: list[Num],
        general: bool,
        function: ir.Function,
    ) -> tuple[dict[str, Any], list[Any]]:
        """The arguments as the function sees them, and their parts."""
        of = {x.values: y for x, y in zip(call.passed(general), inner)}
        constants = iter([inner[i] for i in call.constants] if general else [])
        loaded: dict[int, Num] = {}
        parts: list[Any] = []
        places: dict[int, int] = {}

        def seen(x: Any, inside: bool) -> Any:
            if isinstance(x, Num):
                if x.values in of:
                    return of[x.values]
                place = self._parameter_of(x)
                assert place is not None
                if place not in loaded:
                    loaded[place] = self._loaded(place)
                return loaded[place]
            if type(x) is float:
                return next(constants) if general and inside else x
            if self._whole(x) or not isinstance(x, _STRUCTURES):
                return x
            if id(x) in places:
                return parts[places[id(x)]]
            place = places[id(x)] = len(parts)
            parts.append(None)
            inside = inside or isinstance(x, (Vec, Mat, *PAIRS))
            parts[place] = _of_parts(x, [seen(y, inside) for y in _parts(x)])
            self.t.reads.copied(parts[place], x)
            if isinstance(x, list):  # the caller has it too
                self.t.aliases.share([parts[place]])
            return parts[place]

        return {name: seen(x, False) for name, x in [*given.items(), ("<mask>", active)]}, parts

    def _returned(
        self,
        function: ir.Function,
        result: Any,
        inner: list[Num],
        parts: list[Any],
        escapes: list[Open],
        copied: bool,
    ) -> Outlined:
        """Let the function return: its numbers, the lanes that have failed, and whether all have."""
        t, b, e = self.t, self.e.builder, self.e
        arguments, whole_arguments = (
            {x.values: i for i, x in enumerate(inner)},
            {id(x): i for i, x in enumerate(parts)},
        )
        numbers: list[Num] = []
        at: dict[Any, int] = {}
        made: list[list[Any]] = []  # lists in the result

        def pattern(x: Any) -> Any:
            """How a caller puts the result together."""
            if isinstance(x, Num):
                place = self._parameter(x)
                if place is not None:
                    return "parameter", place
                if x.values in arguments:
                    return "argument", arguments[x.values]
                if x.values not in at:
                    at[x.values] = len(numbers)
                    numbers.append(x)
                return "result", at[x.values]
            if x is None or isinstance(x, (bool, int, float, str, bytes)) or self._whole(x):
                return "constant", x
            if id(x) in whole_arguments:
                return "part", whole_arguments[id(x)]
            if isinstance(x, list):
                if self.t.reads.from_outside(x) or any(x is y for y in made):
                    raise NotCompilable("a list that has another name")
                made.append(x)
            if not isinstance(x, _STRUCTURES):
                raise NotCompilable(f"a result that holds {type(x).__name__}")
            return "structure", (x, [pattern(y) for y in _parts(x)])

        whole = pattern(result)
        registers = [v for x in numbers for v in x.values]
        failed = t.raises > 0
        kinds = [v.type for v in registers]
        if failed:
            kinds += [e.type("b", e.lanes > 1)] * len(t.failed)
        if escapes:
            kinds.append(TYPES["b"])
        type_ = self._structure(kinds)
        many = len(kinds) > RETURNED and not copied
        buffer = ir.Argument(function, type_.as_pointer()) if many else None
        if buffer is not None:
            buffer.add_attribute("noalias")

        def leave(escaped: bool) -> None:
            # of a call that all lanes have left nobody takes results
            values = dict(enumerate(() if escaped else registers))
            if failed:
                values |= dict(enumerate(e.load(t.failed).values, len(registers)))
            if escapes:
                values[len(kinds) - 1] = ir.Constant(TYPES["b"], escaped)
            if buffer is not None:
                for i, v in values.items():
                    b.store(v, _field(b, buffer, i))
                b.ret_void()
                return
            structure = ir.Constant(type_, ir.Undefined)
            for i, v in values.items():
                structure = b.insert_value(structure, v, i)
            b.ret(structure) if values else b.ret_void()

        leave(False)
        if escapes:
            gone = b.append_basic_block()
            for o in escapes:
                b.position_at_end(o.block)
                b.branch(gone)
            b.position_at_end(gone)
            leave(True)
        if buffer is not None:
            function.ftype = ir.FunctionType(ir.VoidType(), [*function.ftype.args, buffer.type])
            function.type = function.ftype.as_pointer()
            function.args = (*function.args, buffer)
        elif kinds:
            function.ftype = ir.FunctionType(type_, function.ftype.args)
            function.type = function.ftype.as_pointer()
            function.return_value = ir.values.ReturnValue(function, type_)
        memory = type_ if buffer is not None else None
        forms = [(x.kind, x.varying, x.mixed) for x in numbers]
        return Outlined(
            function, memory, whole, forms, failed, bool(escapes), t.raises, e.calls, 1, []
        )

    def _structure(self, kinds: list[ir.Type]) -> ir.Type:
        """The type of results of these types; it has a name, because its text would stand at every
        use.
        """
        name = f"results {self.structures.setdefault(tuple(map(str, kinds)), len(self.structures))}"
        type_ = self.e.builder.module.context.get_identified_type(name)
        if type_.is_opaque:
            type_.set_body(*kinds)
        return type_

    # -------------------------------------------------------------- the call

    def emit(self, made: Outlined, call: Call, general: bool) -> Any:
        """A call of the function, and its value."""
        t, b, e = self.t, self.e.builder, self.e
        passed = call.passed(general)
        arguments = [b.function.args[0], *(v for x in passed for v in x.values)]
        if t.escapes:
            arguments += e.load(t.failed).values
        if made.memory is not None:
            arguments.append(self._buffer(made.memory))
        structure = b.call(made.function, arguments, cconv="fastcc")
        at = 0

        def result(i: int) -> ir.Value:
            if made.memory is None:
                return b.extract_value(structure, i)
            return b.load(_field(b, arguments[-1], i), typ=made.memory.elements[i])

        def next_number(kind: str, varying: bool, mixed: bool = False) -> Num:
            nonlocal at
            count = e.registers(varying)
            at += count
            return Num(e, tuple([result(i) for i in range(at - count, at)]), kind, mixed)

        numbers = [next_number(*kind) for kind in made.kinds]
        if made.failed:
            e.store(next_number("b", e.lanes > 1), t.failed)
        if made.escapes:
            escaped = result(at)
            gone, on = b.append_basic_block(), b.append_basic_block()
            b.cbranch(escaped, gone, on)
            t.escapes[-1].append(Open(gone, {}))
            b.position_at_end(on)
        t.raises += made.raises
        e.calls += made.calls

        def restored(pattern: Any) -> Any:
            kind, x = pattern
            match kind:
                case "structure":
                    whole = _of_parts(x[0], [restored(y) for y in x[1]])
                    t.reads.made_again(whole, x[0])
                    if id(x[0]) in t.aliases.shared:
                        t.aliases.share([whole, *lists(call.parts)])
                    return whole
                case "parameter":
                    return self._loaded(x)
                case "argument":
                    return passed[x]
                case "part":
                    return call.parts[x]
                case "result":
                    return numbers[x]
            return x

        return restored(made.pattern)

    def _buffer(self, type_: ir.Type) -> ir.Value:
        """Where functions leave results of this form for the present one."""
        b = self.e.builder
        places = self.buffers.setdefault(b.function, {})
        if str(type_) not in places:
            with b.goto_entry_block():
                places[str(type_)] = b.alloca(type_)
        return places[str(type_)]


def _field(b: ir.IRBuilder, place: ir.Value, i: int) -> ir.Value:
    """The address of a result."""
    return b.gep(place, [ir.Constant(I32, 0), ir.Constant(I32, i)], inbounds=True)


_STRUCTURES = (Vec, Mat, *PAIRS, tuple, list, Record, Table)
_OBJECTS = (
    types.FunctionType,
    types.BuiltinFunctionType,
    type,
    np.ndarray,
    np.generic,
    range,
    Layout,
)


def _parts(x: Any) -> list[Any]:
    """What a vector, a record, ... is made of."""
    if isinstance(x, Record):
        return [getattr(x, f.name) for f in dataclasses.fields(x)]  # type: ignore[arg-type]
    if isinstance(x, Table):
        return [x.place]
    return list(x.parts if isinstance(x, PAIRS) else x)


def _of_parts(x: Any, parts: list[Any]) -> Any:
    """A thing like x, made of these parts."""
    if isinstance(x, PAIRS):
        layout = dataclasses.replace(
            layout_of(x, is_any_number), parts=tuple([layout_of(y, is_any_number) for y in parts])
        )
        return build(
            layout,
            iter([y for part in parts for y in leaves(part, layout_of(part, is_any_number))]),
        )
    if isinstance(x, Record):
        return fill(type(x), {f.name: y for f, y in zip(dataclasses.fields(x), parts)})  # type: ignore[arg-type]
    if isinstance(x, Table):
        return Table.at(*parts)
    return type(x)(parts) if type(x) in (tuple, list) else type(x)(*parts)
