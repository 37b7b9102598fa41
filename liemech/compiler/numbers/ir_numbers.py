"""Run-time numbers of the compiler: a `Num` stands for a value that native code will compute.

Formulas compute with `Num` through the ordinary operators, so `Vec` and `Mat` of `Num` work as they
stand and every constant is folded by Python itself.  In an ensemble a number has one value per
lane, an LLVM vector; a number that is the same for all lanes stays scalar until it meets a varying
one.  No operation carries a fast-math flag: native code rounds as Python does.
"""

from __future__ import annotations

import contextlib
import functools
import math
import numbers
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NoReturn

import numpy as np
from llvmlite import ir

from ...errors import NotCompilable
from ...formulas.functions import INSTRUCTIONS
from ...formulas.numbers import philox
from ...formulas.numbers.bases import StandIn
from ..driver import HUGE

F64, I64, I32, I1 = ir.DoubleType(), ir.IntType(64), ir.IntType(32), ir.IntType(1)
TYPES = {"f": F64, "i": I64, "b": I1}
Values = tuple[ir.Value, ...]
EXACT = 2**53
"""Integers up to this are floats without rounding."""


class Emitter:
    """A writer of LLVM instructions for numbers: one instruction each for a number that all lanes share, as many as
    there are registers for one that varies by lane.

    The `lanes` (1: a single trajectory) lie in vector registers of `width` doubles; several registers work while
    one waits for a result.
    """

    def __init__(self, builder: ir.IRBuilder, lanes: int, width: int) -> None:
        self.builder = builder
        self.lanes = lanes
        self.few = False  # are there so few sites that one turn of a loop takes all?
        self.width = width if lanes % width == 0 else lanes
        self.vectors = {kind: ir.VectorType(t, self.width) for kind, t in TYPES.items()}
        self.packs = True  # do numbers of one body lie side by side in one register?
        self.calls = 0  # of the C library and for signals so far: a branch that has some is the rare one
        self.of_numpy = False  # may a number be one of NumPy's?
        self.python_only: list[str] = []  # the operations so far that NumPy's numbers do differently
        self.rows: dict[int, Emitter] = {}  # by length of a row of numbers of one body, the emitter for rows
        self.large: Any = None  # the emitter for vectors and matrices in memory
        self.single = self  # the emitter for one number of a row
        # writes the branch that is taken where Python raises
        self.fail_if: Callable[[Any], None] = lambda condition: None

    @contextlib.contextmanager
    def side_by_side(self, lanes: int, width: int) -> Iterator[None]:
        """Numbers that vary have lanes: those of sites that run side by side."""
        before = vars(self).copy()
        self.lanes, self.width, self.packs = lanes, min(width, lanes), False
        self.vectors = {kind: ir.VectorType(t, self.width) for kind, t in TYPES.items()}
        try:
            yield
        finally:
            for name in ("lanes", "width", "packs", "vectors"):
                setattr(self, name, before[name])

    def meet_numpy(self) -> None:
        """Let any number be one of NumPy's from here on; refused where Python's numbers were taken for granted."""
        if self.python_only:
            raise NotCompilable(self.python_only[0])
        self.of_numpy = True

    def unless_numpy(self, what: str) -> None:
        """Refuse an operation that NumPy's numbers do differently, if a formula has them, now or (through a loop) later."""
        self.python_only.append(
            f"{what}, in a formula with NumPy's numbers: there Python asks which of them are NumPy's; "
            "write int(x > a) of a truth value, float(x) and int(k) of numbers"
        )
        if self.of_numpy:
            self.meet_numpy()

    def type(self, kind: str, varying: bool) -> ir.Type:
        return self.vectors[kind] if varying else TYPES[kind]

    def registers(self, varying: bool) -> int:
        """The number of registers that make up a number."""
        return self.lanes // self.width if varying else 1

    def num(self, values: Iterable[ir.Value]) -> Num:
        """The number in these registers."""
        values = tuple(values)
        type_ = values[0].type
        scalar = type_.element if isinstance(type_, ir.VectorType) else type_
        return Num(self, values, "f" if scalar is F64 else next(kind for kind, t in TYPES.items() if t == scalar))

    def each(self, instruction: Callable[..., ir.Value], *numbers: Values) -> Num:
        """The number whose registers are those of one instruction each."""
        return self.num(map(instruction, *numbers))

    def constant(self, value: Any, kind: str | None = None, varying: bool = False) -> Num:
        kind = kind or kind_of(value)
        python = {"f": float, "i": int, "b": int}[kind](value)
        if kind == "i" and not -HUGE <= python < HUGE:
            raise NotCompilable(f"{python} is beyond the integers of native code, 2**63: make it a float")
        register = ir.Constant(self.type(kind, varying), [python] * self.width if varying else python)
        return Num(self, (register,) * self.registers(varying), kind)

    def lift(self, value: Any) -> Num:
        """A number as a `Num`."""
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
        return (self.spread(value.value, self.width),) * self.registers(True)

    def spread(self, value: ir.Value, width: int) -> ir.Value:
        """A vector of `width` times a value; the value itself if the width is 1."""
        if width == 1:
            return value
        undefined = ir.Constant(ir.VectorType(value.type, width), ir.Undefined)
        first = self.builder.insert_element(undefined, value, ir.Constant(I32, 0))
        zeros = ir.Constant(ir.VectorType(I32, width), [0] * width)
        return self.builder.shuffle_vector(first, undefined, zeros)

    def alike(self, *items: Any, kind: str = "b", varying: bool = False) -> tuple[str, list[Values]]:
        """The kind that numbers have in common, at least the given one of truth values, integers, floats; and their
        registers in it.
        """
        kind = max([kind, *map(kind_of, items)], key="bif".index)
        varying = varying or any(isinstance(x, Num) and x.varying for x in items)
        return kind, [self.cast(x, kind, varying) for x in items]

    def beside(self, numbers: Sequence[Any]) -> Num | None:
        """Floats as the lanes of one number, if they do not have lanes themselves."""
        if (
            self.lanes > 1
            or not self.packs
            or not all(type(x) is float or (type(x) is Num and x.kind == "f" and not x.mixed) for x in numbers)
        ):
            return None
        n = len(numbers)
        if n not in self.rows:
            self.rows[n] = Emitter(self.builder, n, n)
            self.rows[n].single = self
        row = self.rows[n]
        value: ir.Value = ir.Constant(row.vectors["f"], ir.Undefined)
        for i, x in enumerate(numbers):
            value = self.builder.insert_element(value, self.lift(x).value, ir.Constant(I32, i))
        return row.num([value])

    def apart(self, row: Num) -> list[Num]:
        """The numbers that are the lanes of a row."""
        extract = self.builder.extract_element
        places = [ir.Constant(I32, i) for i in range(row.emitter.lanes)]
        return [self.num([extract(row.value, place)]) for place in places]

    def arithmetic(self, op: str, a: Any, b: Any) -> Num:
        """a + b, a - b, a * b, a / b, as Python has them: integers are exact, and nothing is divided by zero."""
        floats = self._floats(a, b)
        if floats:
            if op == "div":
                self.fail_if(self.zero(b))
            return Num(self, tuple([self.builder.floats(f"f{op}", x, y) for x, y in zip(*floats)]), "f")
        kind, pair = self.alike(a, b, kind="f" if op == "div" else "i")
        if op in ("add", "sub") and kind_of(a) == kind_of(b) == "b":
            self.unless_numpy("a sum of truth values")
        if kind == "i":
            return self.integer(op, *map(self.num, pair))
        mixed = op in ("add", "sub") and all(kind_of(x) != "f" or is_mixed(x) for x in (a, b))
        if op == "mul":
            self.unmixed("a product", a, b)
        if op == "div":
            self.fail_if(self.zero(b))
            # Python rounds the quotient of integers once; a mixed number so large is a float
            if all(kind_of(x) != "f" or is_mixed(x) for x in (a, b)):
                for x in (a, b):
                    if kind_of(x) != "f":
                        self.fail_if(self.inexact(x))
        result = self.each(getattr(self.builder, "f" + op), *pair)
        if mixed:  # of integers, which are no larger than EXACT, Python's is exact
            result.mixed, of_integers = True, self.inexact(result)
            for x in (a, b):
                if is_mixed(x):
                    of_integers = self.logic("and_", of_integers, self.negation(self.inexact(x)))
                else:
                    self.fail_if(self.inexact(x))
            self.fail_if(of_integers)
        return result

    def inexact(self, x: Any) -> Any:
        """Whether an integer is so large that no float may equal it."""
        constant = getattr(x.value, "constant", None) if isinstance(x, Num) else x
        if isinstance(constant, (int, float)):
            return not -EXACT <= constant <= EXACT
        return self.logic("or_", self.compare("<", x, -EXACT), self.compare(">", x, EXACT))

    def _floats(self, a: Any, b: Any) -> tuple[Values, Values] | None:
        """The registers of two floats of one type, of which one may be a constant; None for other numbers."""
        for x, other in ((a, b), (b, a)):
            if type(x) is not Num:
                if type(x) is not float or type(other) is not Num:
                    return None
            elif x.kind != "f" or x.mixed:
                return None
        if type(a) is float:
            return self.constant(a, "f", b.varying).values, b.values
        if type(b) is float:
            return a.values, self.constant(b, "f", a.varying).values
        return (a.values, b.values) if a.values[0].type is b.values[0].type else None

    def unmixed(self, what: str, *items: Any) -> None:
        """Refuse what integers and floats do differently: -0 is 0, -0.0 is not."""
        if any(isinstance(x, Num) and x.mixed for x in items) and all(kind_of(x) != "f" or is_mixed(x) for x in items):
            raise NotCompilable(
                f"{what} of a number that is an integer on one way and a "
                "float on another: write its integers as floats, 0.0 instead of 0"
            )

    def zero(self, x: Any) -> Any:
        return self.compare("==", x, 0) if isinstance(x, Num) else bool(x == 0)

    def integer(self, op: str, a: Num, b: Num) -> Num:
        """A sum, difference or product of integers; one beyond 2^63 (a product: 2^62) is a failure."""
        result = self.each(getattr(self.builder, op), a.values, b.values)
        if op == "mul":
            size = abs(self.num(self.cast(a, "f", a.varying)) * self.num(self.cast(b, "f", b.varying)))
            self.fail_if(size >= float(HUGE // 2))
        # the sign of the result is that of neither (of a sum), of b and not of a (of a difference)
        else:
            e = self.builder.xor
            other = b if op == "add" else a
            first = self.each(e, a.values, (result if op == "add" else b).values)
            second = self.each(e, other.values, result.values)
            self.fail_if(self.each(self.builder.and_, first.values, second.values) < 0)
        return result

    def successor(self, n: Any) -> Num:
        """n + 1, of a counter that stays below another number."""
        return self.each(self.builder.add, *self.alike(n, 1, kind="i")[1])

    def divided(self, a: Any, b: Any) -> tuple[Num, Num]:
        """a // b and a % b, as Python has them.

        Source: CPython, Objects/floatobject.c, _float_div_mod.
        """
        self.unmixed("a quotient or remainder", a, b)
        kind, (x, y) = self.alike(a, b, kind="i")
        p, q = self.num(x), self.num(y)
        self.fail_if(q == 0)
        if kind == "i":
            overflow = (q == -1) & (p == -HUGE)
            self.fail_if(overflow)
            q = self.select(overflow | (q == 0), 1, q)
            quotient, mod = (self.each(f, p.values, q.values) for f in (self.builder.sdiv, self.builder.srem))
            down = (mod != 0) & ((mod < 0) != (q < 0))
            return (self.select(down, self.each(self.builder.sub, quotient.values, self.alike(1, quotient)[1][0]), quotient),
                    self.select(down, self.each(self.builder.add, mod.values, q.values), mod))  # fmt: skip
        mod = self.each(self.builder.frem, p.values, q.values)
        whole = self.each(self.builder.fdiv, (p - mod).values, q.values)
        down = (mod != 0.0) & ((q < 0.0) != (mod < 0.0))
        floor = self.call("llvm.floor", self.select(down, whole - 1.0, whole))
        whole = self.select(down, whole - 1.0, whole)
        floor = self.select(whole - floor > 0.5, floor + 1.0, floor)
        sign = self.each(self.builder.fdiv, p.values, q.values)
        return (self.select(whole != 0.0, floor, self.call("llvm.copysign", 0.0, sign)),
                self.select(mod != 0.0, self.select(down, mod + q, mod), self.call("llvm.copysign", 0.0, q)))  # fmt: skip

    def power(self, a: Any, b: Any) -> Any:
        """a ** b, as Python has it: of integers an integer, of floats that of the C library."""
        self.unmixed("a power", a, b)
        if kind_of(a) != "f" and kind_of(b) != "f":
            if not isinstance(b, int):
                raise NotCompilable("an integer to the power of one known only at run time: make one of them a float")
            if b >= 0:
                return math.prod([a] * b) if b else 1
        result = self.call("pow", a, b)
        self.fail_if(self.overflowed(result, a, b))
        return result

    def overflowed(self, result: Num, *x: Any) -> Num:
        """Whether the result of a function is nan or infinite although its arguments are finite."""
        finite = [self.compare("==", a - a, 0.0) for a in x if isinstance(a, Num) and a.kind == "f"]
        return functools.reduce(lambda a, b: self.logic("and_", a, b), finite, result - result != 0.0)

    def compare(self, op: str, a: Any, b: Any) -> Any:
        """A comparison, exact like Python's of integers with floats."""
        if not isinstance(a, Num):
            a, b, op = b, a, {"<": ">", ">": "<", "<=": ">=", ">=": "<="}.get(op, op)
        if a.kind != "f" and isinstance(b, float) and not isinstance(b, np.generic):
            b = int(b) if EXACT <= abs(b) < math.inf else b
        if isinstance(b, int) and not -EXACT <= b <= EXACT:
            if a.kind != "f":
                if not -HUGE <= b < HUGE:
                    return {"==": False, "!=": True}.get(op, (op in ("<", "<=")) is (b > 0))
            elif _float_below(b) != b:
                self.unless_numpy("a comparison with an integer that is no float")
                if op in ("==", "!="):
                    return self.constant(op == "!=", "b", a.varying)
                op, b = "<=" if op in ("<", "<=") else ">", _float_below(b)
        elif isinstance(b, Num) and {a.kind, b.kind} == {"i", "f"}:
            self.fail_if(self.inexact(a if a.kind == "i" else b))
        kind, pair = self.alike(a, b)
        if kind == "f":
            compare = self.builder.fcmp_unordered if op == "!=" else self.builder.fcmp_ordered
        else:
            # True is 1, not -1
            compare = self.builder.icmp_signed if kind == "i" else self.builder.icmp_unsigned
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
        """`yes` where a condition of the run holds, `no` elsewhere."""
        kind, (x, y) = self.alike(yes, no, varying=condition.varying)
        for n in (yes, no):
            self.fail_if(self.rounded(n, kind))
        conditions = condition.values * (len(x) // len(condition.values))
        result = self.each(self.builder.select, conditions, x, y)
        result.mixed = result.kind == "f" and any(kind_of(x) != "f" or is_mixed(x) for x in (yes, no))
        return result

    def rounded(self, n: Any, kind: str) -> Any:
        """Whether a number is an integer that is rounded where it becomes one of this kind."""
        return kind == "f" and kind_of(n) == "i" and self.inexact(n)

    def any(self, condition: Any) -> Any:
        """Whether a condition holds in any lane."""
        if not isinstance(condition, Num) or not condition.varying:
            return condition
        word = ir.IntType(self.width)
        union, *others = condition.values
        for other in others:
            union = self.builder.or_(union, other)
        return self.num([self.builder.icmp_unsigned("!=", self.builder.bitcast(union, word), ir.Constant(word, 0))])

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
            function = self._declared(
                name + (f".v{self.width}f64" if varying else ".f64"), self.type("f", varying), len(args)
            )
            return self.each(lambda *v: b.call(function, v), *values)
        self.calls += 1
        function = self._declared(f"liemech_{name}", F64, len(args))
        if not varying:
            return self.each(lambda *v: b.call(function, v), *values)

        def by_lane(*registers: ir.Value) -> ir.Value:
            result = ir.Constant(self.type("f", True), ir.Undefined)
            for lane in range(self.width):
                at = ir.Constant(I32, lane)
                number = b.call(function, [b.extract_element(v, at) for v in registers])
                result = b.insert_element(result, number, at)
            return result

        return self.each(by_lane, *values)

    def uniforms(self, seed: Any, path: Any, number: Any, block: int) -> tuple[Any, Any]:
        """`philox.uniforms`, in integers of 64 bits of which 32 are used."""
        b, counters = self.builder, (seed, path, number)
        if not any(isinstance(x, Num) for x in counters):
            return philox.uniforms(seed, path, number, block)
        varying = any(isinstance(x, Num) and x.varying for x in counters)
        type_ = self.type("i", varying)

        def constant(n: int) -> ir.Constant:
            return ir.Constant(type_, [n] * self.width if varying else n)

        def generate(*floats: ir.Value) -> tuple[ir.Value, ir.Value]:
            s, p, n = (b.fptosi(x, type_) for x in floats)
            shift, word = constant(32), constant(philox.WORD)
            a, c, e, d = (b.and_(n, word), b.or_(b.lshr(n, shift), constant(block << 21)),
                          b.and_(p, word), b.lshr(p, shift))  # fmt: skip
            k, m = b.and_(s, word), b.lshr(s, shift)
            for i in range(philox.ROUNDS):
                if i > 0:
                    k, m = (b.and_(b.add(x, constant(w)), word) for x, w in zip((k, m), philox.WEYL))
                first, second = (b.mul(constant(w), x) for w, x in zip(philox.MULTIPLIERS, (a, e)))
                a, e = (b.xor(b.xor(b.lshr(x, shift), y), z)
                        for x, y, z in ((second, c, k), (first, d, m)))  # fmt: skip
                c, d = b.and_(second, word), b.and_(first, word)
            pairs = (b.or_(b.shl(x, constant(20)), b.lshr(y, constant(12))) for x, y in ((a, c), (e, d)))
            u, v = (b.sitofp(x, self.type("f", varying)) for x in pairs)
            return u, v

        registers = [self.cast(x, "f", varying) for x in counters]
        outputs = [generate(*floats) for floats in zip(*registers)]
        u, v = (self.num(x) for x in zip(*outputs))
        return (u + 0.5) * 2.0**-52, (v + 0.5) * 2.0**-52

    def _declared(self, symbol: str, type_: ir.Type, arguments: int) -> ir.Function:
        module = self.builder.module
        function = module.globals.get(symbol)
        if function is None:
            function = ir.Function(module, ir.FunctionType(type_, [type_] * arguments), symbol)
            # unused and repeated calls disappear
            for fact in ("nounwind", "readnone", "willreturn"):
                # llvmlite's own check does not know the last one
                set.add(function.attributes, fact)
        return function


def kind_of(x: Any) -> str:
    """The kind of a number in Python: a float, an integer or a truth value."""
    if isinstance(x, Num):
        return x.kind
    if isinstance(x, (bool, int, float)):
        return "b" if isinstance(x, bool) else "i" if isinstance(x, int) else "f"
    raise NotCompilable(f"{type(x).__name__} is not a number")


def is_mixed(x: Any) -> bool:
    """Whether a number is an integer on one way and a float on another."""
    return isinstance(x, Num) and x.mixed


def _float_below(n: int) -> float:
    """The largest float that is not larger than an integer."""
    try:
        x = float(n)
    except OverflowError:
        return sys.float_info.max if n > 0 else -math.inf
    return x if x <= n else math.nextafter(x, -math.inf)


def _operator(function: Callable[[Emitter], Callable[..., Any]]) -> tuple[Any, Any]:
    """The two methods of an operator, with the number to its left and to its right."""
    return (
        lambda self, other: self._of(function(self.emitter), self, other),
        lambda self, other: self._of(function(self.emitter), other, self),
    )


def _arithmetic(op: str) -> tuple[Any, Any]:
    """The two methods of `+ - * /`, without a look at the type of an operand that is a `Num`."""
    left, right = _operator(lambda e: functools.partial(e.arithmetic, op))

    def method(self: Num, other: Any) -> Any:
        if type(other) is Num:
            return self.emitter.arithmetic(op, self, other)
        return left(self, other)

    return method, right


def _comparison(op: str) -> Any:
    return _operator(lambda e: functools.partial(e.compare, op))[0]


class Num(StandIn):
    """A number known at run time only: float (`f`), integer (`i`) or truth value (`b`).

    One that is an integer on one way and a float on another is a `mixed` float: what Python makes
    of it may depend on the way.
    """

    __slots__ = ("emitter", "kind", "mixed", "values")
    __array_ufunc__ = None

    def __init__(self, emitter: Emitter, values: Values, kind: str, mixed: bool = False) -> None:
        self.emitter, self.values, self.kind, self.mixed = emitter, values, kind, mixed

    def __repr__(self) -> str:
        return "a number known only at run time"

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

    @property
    def is_truth(self) -> bool:
        return self.kind == "b"

    def settled(self, what: str) -> Num:
        if self.mixed:
            raise NotCompilable(what)
        return self

    def fails(self) -> None:
        self.emitter.fail_if(self)

    def elementary(self, name: str, *x: Any) -> Num:
        return self.emitter.call(f"llvm.{name}" if name in (*INSTRUCTIONS, "fma") else name, *x)

    def beside(self, numbers: Sequence[Any]) -> Num | None:
        return self.emitter.beside(numbers)

    def apart(self) -> list[Num]:
        """The numbers that lie side by side in this one."""
        return self.emitter.single.apart(self)

    def _of(self, function: Callable[..., Any], *items: Any) -> Any:
        """A function of numbers; NotImplemented if one of them is no number.  NumPy's integers of 64 bits are integers."""
        for x in items:
            if isinstance(x, np.generic):
                self.emitter.meet_numpy()
            if not isinstance(x, (Num, int, float)):
                if not isinstance(x, (np.integer, np.bool_)):
                    return NotImplemented
                if self.kind != "f" and not isinstance(x, np.int64):
                    raise NotCompilable(
                        f"NumPy computes with {type(x).__name__} and whole numbers in a way of its "
                        f"own: write int({x!r}) or a float"
                    )
                items = tuple([int(y) if isinstance(y, (np.integer, np.bool_)) else y for y in items])
        return function(*items)

    def _equality(self, op: str, other: Any) -> Any:
        """`==` or `!=`.  What cannot be compared is something else; other numbers and arrays could."""
        truth = self._of(functools.partial(self.emitter.compare, op), self, other)
        if truth is NotImplemented and isinstance(other, (np.generic, np.ndarray, numbers.Number)):
            raise NotCompilable(
                f"`{op}` of a number known only at run time and {type(other).__name__}: compare "
                "floats, array entries one by one"
            )
        return truth

    def __pow__(self, other: Any) -> Any:
        if isinstance(other, np.integer) and other < 0 and self.kind != "f":
            raise NotCompilable("NumPy has no negative powers of integers: write float(k) ** -1.0")
        return self._of(self.emitter.power, self, other)

    __add__, __radd__ = _arithmetic("add")
    __sub__, __rsub__ = _arithmetic("sub")
    __mul__, __rmul__ = _arithmetic("mul")
    __truediv__, __rtruediv__ = _arithmetic("div")
    __divmod__, __rdivmod__ = _operator(lambda e: e.divided)
    __floordiv__, __rfloordiv__ = _operator(lambda e: lambda *x: e.divided(*x)[0])
    __mod__, __rmod__ = _operator(lambda e: lambda *x: e.divided(*x)[1])
    _, __rpow__ = _operator(lambda e: e.power)

    def __neg__(self) -> Num:
        e = self.emitter
        e.unmixed("the negative", self)
        if self.kind == "b":
            e.unless_numpy("the negative of a truth value")
        return e.each(e.builder.fneg, self.values) if self.kind == "f" else e.arithmetic("sub", 0, self)

    def __pos__(self) -> Num:
        return 1 * self if self.kind == "b" else self

    def __abs__(self) -> Num:
        if self.kind != "f":
            return self.emitter.select(self < 0, -self, 1 * self)
        size = self.emitter.call("llvm.fabs", self)
        size.mixed = self.mixed
        return size

    __lt__, __le__, __gt__, __ge__ = map(_comparison, ("<", "<=", ">", ">="))

    def __eq__(self, other: object) -> Any:
        return self._equality("==", other)

    def __ne__(self, other: object) -> Any:
        return self._equality("!=", other)

    def _bits(self, op: str, other: Any) -> Any:
        if isinstance(other, np.bool_):
            other = bool(other)
        if {self.kind, kind_of(other)} == {"b"}:
            return self.emitter.logic(op, self, other)
        kind, pair = self.emitter.alike(self, other)
        if kind == "f":
            raise NotCompilable("`&` or `|` of floats: use `and`, `or`")
        return self.emitter.each(getattr(self.emitter.builder, op), *pair)

    __and__ = __rand__ = functools.partialmethod(_bits, "and_")
    __or__ = __ror__ = functools.partialmethod(_bits, "or_")

    def __hash__(self) -> int:
        raise NotCompilable(
            "a number known only at run time in a key of a set or a dict: compare it with the keys "
            "one by one, or look up a tuple of numbers"
        )

    def _refuse(self, *_: Any) -> NoReturn:
        raise NotCompilable(
            "a number known only at run time is used where Python needs its value now: compare "
            "vectors, lists and tuples number by number"
        )

    __bool__ = __float__ = __int__ = __index__ = __array__ = __len__ = __iter__ = _refuse
