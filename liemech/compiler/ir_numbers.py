"""Run-time numbers of the compiler: a `Num` stands for a value that native code will compute.

Formulas compute with `Num` through the ordinary operators, so `Vec` and `Mat` of `Num` work as they stand and every constant is
folded by Python itself.  In an ensemble a number has one value per lane, an LLVM vector; a number that is the same for all
lanes stays scalar until it meets a varying one.  No operation carries a fast-math flag: native code rounds as Python does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NoReturn

from llvmlite import ir

from ..errors import NotCompilable
from ..formulas.numbers import StandIn

F64, I64, I32, I1 = ir.DoubleType(), ir.IntType(64), ir.IntType(32), ir.IntType(1)
TYPES = {"f": F64, "i": I64, "b": I1}
Values = tuple[ir.Value, ...]


class Emitter:
    """Where instructions go, and how many lanes a varying number has (1: a single trajectory).

    The lanes are spread over vector registers of `width` doubles; several registers work while one waits for a result.
    """

    def __init__(self, builder: ir.IRBuilder, lanes: int, width: int) -> None:
        self.builder = builder
        self.lanes = lanes
        self.width = width if lanes % width == 0 else lanes
        self.calls = 0  # of the C library so far: a branch that has some is the rare one

    def type(self, kind: str, varying: bool) -> ir.Type:
        return ir.VectorType(TYPES[kind], self.width) if varying else TYPES[kind]

    def registers(self, varying: bool) -> int:
        """How many values make up a number."""
        return self.lanes // self.width if varying else 1

    def num(self, values: Iterable[ir.Value]) -> Num:
        values = tuple(values)
        type_ = values[0].type
        scalar = type_.element if isinstance(type_, ir.VectorType) else type_
        return Num(self, values, next(kind for kind, t in TYPES.items() if t == scalar))

    def each(self, instruction: Callable[..., ir.Value], *numbers: Values) -> Num:
        """One instruction for every register."""
        return self.num(map(instruction, *numbers))

    def constant(self, value: Any, kind: str | None = None, varying: bool = False) -> Num:
        kind = kind or ("b" if isinstance(value, bool) else "i" if isinstance(value, int) else "f")
        python = {"f": float, "i": int, "b": int}[kind](value)
        one = ir.Constant(self.type(kind, varying), [python] * self.width if varying else python)
        return Num(self, (one,) * self.registers(varying), kind)

    def lift(self, value: Any) -> Num:
        if isinstance(value, Num):
            return value
        if isinstance(value, (bool, int, float)):
            return self.constant(value)
        raise NotCompilable(f"{type(value).__name__} is not a number")

    def cast(self, value: Any, kind: str, varying: bool) -> Values:
        """The registers of a number in the wanted kind, spread over the lanes if it varies."""
        if not isinstance(value, Num):
            return self.constant(value, kind, varying).values
        b = self.builder
        if value.kind != kind:
            if value.kind == "b":
                integer = self.each(lambda v: b.zext(v, self.type("i", value.varying)), value.values)
                return self.cast(integer, kind, varying)
            if (value.kind, kind) != ("i", "f"):
                raise NotCompilable("a run-time float cannot become an integer")
            value = self.each(lambda v: b.sitofp(v, self.type("f", value.varying)), value.values)
        if not varying or value.varying:
            return value.values
        if isinstance(value.value, ir.Constant):
            return self.constant(value.value.constant, kind, True).values
        undefined = ir.Constant(self.type(kind, True), ir.Undefined)
        first = b.insert_element(undefined, value.value, ir.Constant(I32, 0))
        zeros = ir.Constant(ir.VectorType(I32, self.width), [0] * self.width)
        return (b.shuffle_vector(first, undefined, zeros),) * self.registers(True)

    def alike(self, *items: Any, kind: str = "b", varying: bool = False) -> tuple[str, list[Values]]:
        """Numbers made alike: at least of the given kind, floats before integers before truth values."""
        numbers = [self.lift(x) for x in items]
        kind = max([kind, *(n.kind for n in numbers)], key="bif".index)
        varying = varying or any(n.varying for n in numbers)
        return kind, [self.cast(n, kind, varying) for n in numbers]

    def arithmetic(self, op: str, a: Any, b: Any) -> Num:
        kind, pair = self.alike(a, b, kind="f" if op == "div" else "i")
        return self.each(getattr(self.builder, ("f" if kind == "f" else "") + op), *pair)

    def compare(self, op: str, a: Any, b: Any) -> Num:
        kind, pair = self.alike(a, b)
        if kind == "f":
            compare = self.builder.fcmp_unordered if op == "!=" else self.builder.fcmp_ordered
        else:
            compare = self.builder.icmp_signed
        return self.each(lambda x, y: compare(op, x, y), *pair)

    def logic(self, op: str, a: Any, b: Any) -> Any:
        """`and_` or `or_` of two truth values; constants disappear."""
        for constant, other in ((a, b), (b, a)):
            if isinstance(constant, bool):
                return other if constant is (op == "and_") else constant
        return self.each(getattr(self.builder, op), *self.alike(a, b)[1])

    def negation(self, a: Any) -> Any:
        return not a if isinstance(a, bool) else self.each(self.builder.not_, a.values)

    def select(self, condition: Num, yes: Any, no: Any) -> Num:
        _, (x, y) = self.alike(yes, no, varying=condition.varying)
        conditions = condition.values * (len(x) // len(condition.values))
        return self.each(self.builder.select, conditions, x, y)

    def any(self, condition: Any) -> Any:
        """Does the condition hold in any lane?"""
        if not isinstance(condition, Num) or not condition.varying:
            return condition
        word = ir.IntType(self.width)
        some, *others = condition.values
        for other in others:
            some = self.builder.or_(some, other)
        return self.num([self.builder.icmp_unsigned("!=", self.builder.bitcast(some, word), ir.Constant(word, 0))])

    def slot(self) -> list[ir.Value]:
        """A place in memory for a truth value of every lane."""
        varying = self.lanes > 1
        with self.builder.goto_entry_block():
            return [self.builder.alloca(self.type("b", varying)) for _ in range(self.registers(varying))]

    def store(self, value: Any, slot: list[ir.Value]) -> None:
        for v, place in zip(self.cast(value, "b", self.lanes > 1), slot, strict=True):
            self.builder.store(v, place)

    def load(self, slot: list[ir.Value]) -> Num:
        return self.num([self.builder.load(place) for place in slot])

    def call(self, name: str, *args: Any) -> Num:
        """A function of floats: an LLVM intrinsic (`llvm.sqrt`) or one of the C library, lane by lane."""
        b = self.builder
        _, values = self.alike(*args, kind="f")
        varying = isinstance(values[0][0].type, ir.VectorType)
        if name.startswith("llvm."):
            function = self._declared(name + (f".v{self.width}f64" if varying else ".f64"), self.type("f", varying), len(args))
            return self.each(lambda *v: b.call(function, v), *values)
        self.calls += 1
        function = self._declared(f"liemech_{name}", F64, len(args))
        if not varying:
            return self.each(lambda *v: b.call(function, v), *values)

        def by_lane(*registers: ir.Value) -> ir.Value:
            result = ir.Constant(self.type("f", True), ir.Undefined)
            for lane in range(self.width):
                at = ir.Constant(I32, lane)
                one = b.call(function, [b.extract_element(v, at) for v in registers])
                result = b.insert_element(result, one, at)
            return result

        return self.each(by_lane, *values)

    def _declared(self, symbol: str, type_: ir.Type, arguments: int) -> ir.Function:
        module = self.builder.module
        function = module.globals.get(symbol)
        if function is None:
            function = ir.Function(module, ir.FunctionType(type_, [type_] * arguments), symbol)
            for fact in ("nounwind", "readnone", "willreturn"):  # unused and repeated calls disappear
                set.add(function.attributes, fact)  # llvmlite's own check does not know the last one
        return function


class Num(StandIn):
    """A number known at run time only: float (`f`), integer (`i`) or truth value (`b`)."""

    __slots__ = ("emitter", "kind", "values")
    __array_ufunc__ = None

    def __init__(self, emitter: Emitter, values: Values, kind: str) -> None:
        self.emitter, self.values, self.kind = emitter, values, kind

    @property
    def value(self) -> ir.Value:
        """The only register, of a number that is the same for all lanes."""
        return self.values[0]

    @property
    def varying(self) -> bool:
        return isinstance(self.values[0].type, ir.VectorType)

    @property
    def is_integer(self) -> bool:
        return self.kind == "i"

    def elementary(self, name: str, *x: Any) -> Num:
        return self.emitter.call("llvm.sqrt" if name == "sqrt" else name, *x)

    def __add__(self, other: Any) -> Any:
        return self._binary("add", self, other)

    def __radd__(self, other: Any) -> Any:
        return self._binary("add", other, self)

    def __sub__(self, other: Any) -> Any:
        return self._binary("sub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._binary("sub", other, self)

    def __mul__(self, other: Any) -> Any:
        return self._binary("mul", self, other)

    def __rmul__(self, other: Any) -> Any:
        return self._binary("mul", other, self)

    def __truediv__(self, other: Any) -> Any:
        return self._binary("div", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._binary("div", other, self)

    def _binary(self, op: str, a: Any, b: Any) -> Any:
        other = b if a is self else a
        if not isinstance(other, (Num, bool, int, float)):
            return NotImplemented
        return self.emitter.arithmetic(op, a, b)

    def __pow__(self, other: Any) -> Any:
        return self.emitter.call("pow", self, other) if isinstance(other, _NUMBERS) else NotImplemented

    def __rpow__(self, other: Any) -> Num:
        return self.emitter.call("pow", other, self)

    def __neg__(self) -> Num:
        e = self.emitter
        return e.each(e.builder.fneg, self.values) if self.kind == "f" else e.arithmetic("sub", 0, self)

    def __pos__(self) -> Num:
        return self

    def __abs__(self) -> Num:
        return self.emitter.call("llvm.fabs", self)

    def _compared(self, op: str, other: Any) -> Any:
        return self.emitter.compare(op, self, other) if isinstance(other, _NUMBERS) else NotImplemented

    def __lt__(self, other: Any) -> Any:
        return self._compared("<", other)

    def __le__(self, other: Any) -> Any:
        return self._compared("<=", other)

    def __gt__(self, other: Any) -> Any:
        return self._compared(">", other)

    def __ge__(self, other: Any) -> Any:
        return self._compared(">=", other)

    def __eq__(self, other: object) -> Any:
        return self._compared("==", other)

    def __ne__(self, other: object) -> Any:
        return self._compared("!=", other)

    def __and__(self, other: Any) -> Any:
        return self.emitter.logic("and_", self, other)

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return self.emitter.logic("or_", self, other)

    __ror__ = __or__
    __hash__ = object.__hash__

    def _refuse(self, *_: Any) -> NoReturn:
        raise NotCompilable("a number known only at run time is used where Python needs its value now")

    __bool__ = __float__ = __int__ = __index__ = __array__ = __len__ = __iter__ = _refuse


_NUMBERS = (Num, bool, int, float)
