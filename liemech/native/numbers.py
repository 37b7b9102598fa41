"""Run-time numbers of the compiler: a `Num` stands for a value that native code will compute.

Formulas compute with `Num` through the ordinary operators, so `Vec` and `Mat` of `Num` work as they stand and every constant is
folded by Python itself.  In an ensemble a number has one value per lane, an LLVM vector; a number that is the same for all
lanes stays scalar until it meets a varying one.  No operation carries a fast-math flag: native code rounds as Python does.
"""

from __future__ import annotations

from typing import Any, NoReturn

from llvmlite import ir

from ..errors import NotCompilable

F64, I64, I1 = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
TYPES = {"f": F64, "i": I64, "b": I1}
ASIDE = "preserve_allcc"


class Emitter:
    """Where instructions go, and how many lanes a varying number has (1: a single trajectory)."""

    def __init__(self, builder: ir.IRBuilder, lanes: int) -> None:
        self.builder = builder
        self.lanes = lanes
        self.calls = 0  # of the C library so far: a branch that has some is the rare one

    def type(self, kind: str, varying: bool) -> ir.Type:
        return ir.VectorType(TYPES[kind], self.lanes) if varying else TYPES[kind]

    def num(self, value: ir.Value) -> Num:
        scalar = value.type.element if isinstance(value.type, ir.VectorType) else value.type
        return Num(self, value, next(kind for kind, t in TYPES.items() if t == scalar))

    def constant(self, value: Any, kind: str | None = None, varying: bool = False) -> Num:
        kind = kind or ("b" if isinstance(value, bool) else "i" if isinstance(value, int) else "f")
        python = {"f": float, "i": int, "b": int}[kind](value)
        type_ = self.type(kind, varying)
        return Num(self, ir.Constant(type_, [python] * self.lanes if varying else python), kind)

    def lift(self, value: Any) -> Num:
        if isinstance(value, Num):
            return value
        if isinstance(value, (bool, int, float)):
            return self.constant(value)
        raise NotCompilable(f"{type(value).__name__} is not a number")

    def cast(self, value: Any, kind: str, varying: bool) -> ir.Value:
        """The IR value of a number in the wanted kind, spread over the lanes if it varies."""
        if not isinstance(value, Num):
            return self.constant(value, kind, varying).value
        result, b = value.value, self.builder
        if value.kind != kind:
            if (value.kind, kind) == ("i", "f"):
                result = b.sitofp(result, self.type("f", value.varying))
            elif value.kind == "b":
                result = b.zext(result, self.type("i", value.varying))
                return self.cast(Num(self, result, "i"), kind, varying)
            else:
                raise NotCompilable("a run-time float cannot become an integer")
        if varying and not value.varying:
            if isinstance(result, ir.Constant):
                return ir.Constant(self.type(kind, True), [result.constant] * self.lanes)
            undefined = ir.Constant(self.type(kind, True), ir.Undefined)
            first = b.insert_element(undefined, result, ir.Constant(ir.IntType(32), 0))
            zeros = ir.Constant(ir.VectorType(ir.IntType(32), self.lanes), [0] * self.lanes)
            result = b.shuffle_vector(first, undefined, zeros)
        return result

    def pair(self, a: Any, b: Any, kind: str = "b") -> tuple[ir.Value, ir.Value, str]:
        """Two numbers made alike: at least of the given kind, floats before integers before truth values."""
        x, y = self.lift(a), self.lift(b)
        kind = max(kind, x.kind, y.kind, key="bif".index)
        varying = x.varying or y.varying
        return self.cast(x, kind, varying), self.cast(y, kind, varying), kind

    def arithmetic(self, op: str, a: Any, b: Any) -> Num:
        x, y, kind = self.pair(a, b, "f" if op == "div" else "i")
        return self.num(getattr(self.builder, ("f" if kind == "f" else "") + op)(x, y))

    def compare(self, op: str, a: Any, b: Any) -> Num:
        x, y, kind = self.pair(a, b)
        if kind == "f":
            compare = self.builder.fcmp_unordered if op == "!=" else self.builder.fcmp_ordered
        else:
            compare = self.builder.icmp_signed
        return self.num(compare(op, x, y))

    def logic(self, op: str, a: Any, b: Any) -> Any:
        """`and_` or `or_` of two truth values; constants disappear."""
        for constant, other in ((a, b), (b, a)):
            if isinstance(constant, bool):
                return other if constant is (op == "and_") else constant
        x, y, _ = self.pair(a, b)
        return self.num(getattr(self.builder, op)(x, y))

    def negation(self, a: Any) -> Any:
        return not a if isinstance(a, bool) else self.num(self.builder.not_(a.value))

    def select(self, condition: Num, yes: Any, no: Any) -> Num:
        x, y = self.lift(yes), self.lift(no)
        kind = max(x.kind, y.kind, key="bif".index)
        varying = condition.varying or x.varying or y.varying
        values = [self.cast(v, kind, varying) for v in (x, y)]
        return self.num(self.builder.select(condition.value, *values))

    def any(self, condition: Any) -> Any:
        """Does the condition hold in any lane?"""
        if not isinstance(condition, Num) or not condition.varying:
            return condition
        word = ir.IntType(self.lanes)
        bits = self.builder.bitcast(condition.value, word)
        return self.num(self.builder.icmp_unsigned("!=", bits, ir.Constant(word, 0)))

    def call(self, name: str, *args: Any) -> Num:
        """A function of floats: an LLVM intrinsic (`llvm.sqrt`) or one of the C library, lane by lane."""
        b, numbers = self.builder, [self.lift(a) for a in args]
        varying = any(n.varying for n in numbers)
        values = [self.cast(n, "f", varying) for n in numbers]
        intrinsic = name.startswith("llvm.")
        if intrinsic:
            type_ = self.type("f", varying)
            symbol = name + (f".v{self.lanes}f64" if varying else ".f64")
            return self.num(b.call(self._declared(symbol, type_, len(args)), values))
        self.calls += 1
        function = self._aside(name, len(args))
        if not varying:
            return self.num(b.call(function, values, cconv=ASIDE))
        result = ir.Constant(self.type("f", True), ir.Undefined)
        for lane in range(self.lanes):
            at = ir.Constant(ir.IntType(32), lane)
            one = b.call(function, [b.extract_element(v, at) for v in values], cconv=ASIDE)
            result = b.insert_element(result, one, at)
        return self.num(result)

    def _declared(self, symbol: str, type_: ir.Type, arguments: int) -> ir.Function:
        module = self.builder.module
        function = module.globals.get(symbol)
        if function is None:
            function = ir.Function(module, ir.FunctionType(type_, [type_] * arguments), symbol)
            function.attributes.add("nounwind")
        return function

    def _aside(self, name: str, arguments: int) -> ir.Function:
        """The C function, wrapped so that a call leaves the caller's registers alone: what happens rarely must not cost always."""
        module = self.builder.module
        function = module.globals.get(f"aside_{name}")
        if function is None:
            function = ir.Function(module, ir.FunctionType(F64, [F64] * arguments), f"aside_{name}")
            function.calling_convention, function.linkage = ASIDE, "internal"
            for attribute in ("noinline", "nounwind"):
                function.attributes.add(attribute)
            inside = ir.IRBuilder(function.append_basic_block())
            inside.ret(inside.call(self._declared(f"liemech_{name}", F64, arguments), function.args))
        return function


class Num:
    """A number known at run time only: float (`f`), integer (`i`) or truth value (`b`)."""

    __slots__ = ("emitter", "kind", "value")
    __array_ufunc__ = None

    def __init__(self, emitter: Emitter, value: ir.Value, kind: str) -> None:
        self.emitter, self.value, self.kind = emitter, value, kind

    @property
    def varying(self) -> bool:
        return isinstance(self.value.type, ir.VectorType)

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

    def __pow__(self, other: Any) -> Num:
        return self.emitter.call("pow", self, other)

    def __rpow__(self, other: Any) -> Num:
        return self.emitter.call("pow", other, self)

    def __neg__(self) -> Num:
        e = self.emitter
        return e.num(e.builder.fneg(self.value)) if self.kind == "f" else e.arithmetic("sub", 0, self)

    def __pos__(self) -> Num:
        return self

    def __abs__(self) -> Num:
        return self.emitter.call("llvm.fabs", self)

    def __lt__(self, other: Any) -> Any:
        return self.emitter.compare("<", self, other)

    def __le__(self, other: Any) -> Any:
        return self.emitter.compare("<=", self, other)

    def __gt__(self, other: Any) -> Any:
        return self.emitter.compare(">", self, other)

    def __ge__(self, other: Any) -> Any:
        return self.emitter.compare(">=", self, other)

    def __eq__(self, other: object) -> Any:
        return self.emitter.compare("==", self, other)

    def __ne__(self, other: object) -> Any:
        return self.emitter.compare("!=", self, other)

    def __and__(self, other: Any) -> Any:
        return self.emitter.logic("and_", self, other)

    __rand__ = __and__

    def __or__(self, other: Any) -> Any:
        return self.emitter.logic("or_", self, other)

    __ror__ = __or__
    __hash__ = object.__hash__

    def _refuse(self, *_: Any) -> NoReturn:
        raise NotCompilable("a number known only at run time is used where Python needs its value now")

    __bool__ = __float__ = __int__ = __index__ = __array__ = __len__ = __iter__ = _refuse  # type: ignore[assignment]
