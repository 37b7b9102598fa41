"""Functions of Python, `math` and NumPy: native code for each, where numbers of the run are among its arguments."""

from __future__ import annotations

import functools
import math
import operator
import sys
import types
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import NotCompilable
from ...formulas import functions
from ...formulas.numbers import double_double
from ...formulas.numbers.bases import OF_NUMPY, ByValue, Operand, is_any_number
from ...formulas.numbers.compensated import value_of
from ...formulas.numbers.double_double import DoubleDouble
from ...formulas.numbers.dual import Dual
from ...formulas.numbers.dual import value_of as without_slope
from ...formulas.numbers.series import Series
from ...formulas.of_math import OF_MATH, head
from ...formulas.of_numpy import OF_NUMBERS, by_components, inside
from ...formulas.vectors import small
from ..changes.content_hashes import is_own
from ..changes.dependencies import varies
from ..driver import HUGE
from ..machine.callbacks import FUNCTIONS
from ..translation.expressions import holds_number
from ..translation.iterators import ItemStream
from ..translation.scopes import Closure
from . import arrays, memory_loops
from .arrays import Array, array, refuse, vector
from .ir_numbers import Num, is_mixed, kind_of

if TYPE_CHECKING:
    from ..translation.translator import Interpreter

TABLED = 64
"""Tables of more numbers are not written out."""

COMPENSATED_SUMS = sys.version_info >= (3, 12)
"""From Python 3.12 on, `sum` of floats carries the rounding errors of the additions along."""

TYPES = {"f": float, "i": int, "b": bool}
NUMPYS: dict[str, type] = {"f": np.float64, "i": np.int64, "b": np.bool_}
OUTSIDE = (
    "print input open eval exec compile setattr delattr globals locals vars dir id hash memoryview breakpoint object"
)
"""Functions that have no place in a formula, whatever their arguments."""

STRUCTURE = {isinstance, type, callable, hasattr, getattr, super, next, map, filter}
"""Functions that look at the structure of their arguments only."""
COMPUTING = {min, max, sum, any, all, sorted}
"""Functions that compute with what is inside of their arguments."""


class PythonFunctions:
    """The native forms of Python functions; `translator` evaluates their arguments."""

    def __init__(self, translator: Interpreter) -> None:
        self.t, self.e = translator, translator.emitter
        self.table: dict[Any, Callable[..., Any]] = {
            isinstance: self.isinstance,
            type: self.type,
            hasattr: self.hasattr,
            callable: lambda x: isinstance(x, Closure) or self.t.reads.of_class(x, "__call__"),
            bool: lambda x=False: self.t.truth(x),
            float: self.float,
            int: self.cut,
            round: self.round,
            abs: abs,
            divmod: divmod,
            pow: lambda x, n: x**n,
            min: functools.partial(self.extreme, operator.lt),
            max: functools.partial(self.extreme, operator.gt),
            sum: self.sum,
            any: lambda items: self.together("or_", False, items),
            all: lambda items: self.together("and_", True, items),
            sorted: self.sorted,
            len: self.len,
            list: lambda items=(): list(self.t.iterate(items)),
            tuple: lambda items=(): tuple(self.t.iterate(items)),
            iter: lambda items: items if isinstance(items, ItemStream) else self.t.stream(list(items), (items,)),
            next: self.next,
            zip: self.zip,
            map: self.map,
            filter: self.filter,
            enumerate: lambda items, start=0: self.lazily(enumerate, items, start=start),
            reversed: lambda items: self.t.stream(list(reversed(items)), (items,)),
            math.fabs: self.plain_number(lambda x: self.e.call("llvm.fabs", x), math.fabs),
            math.copysign: self.plain_number(lambda x, y: self.e.call("llvm.copysign", x, y), math.copysign),
            math.floor: self.stepwise("llvm.floor", math.floor, double_double.floor),
            math.ceil: self.stepwise("llvm.ceil", math.ceil, lambda x, floor: -double_double.floor(-x, floor)),
            math.trunc: self.stepwise("llvm.trunc", math.trunc, double_double.truncated),
            math.isnan: self.plain_number(lambda x: x != x, math.isnan),
            math.isfinite: self.plain_number(lambda x: x - x == 0.0, math.isfinite),
            math.isinf: self.plain_number(lambda x: abs(x) == math.inf, math.isinf),
            math.radians: self.plain_number(functions.radians, math.radians),
            math.degrees: self.plain_number(functions.degrees, math.degrees),
            math.sqrt: self.of_math(math.sqrt, "llvm.sqrt"),
            math.log: self.log,
            math.fsum: self.refused(math.fsum, "liemech.sum"),
            math.prod: lambda items, start=1: functools.reduce(operator.mul, self.t.iterate(items), start),
            np.sqrt: self.of_numpy(lambda x: self.e.call("llvm.sqrt", x), np.sqrt),
            np.abs: self.of_numpy(lambda x: self.e.call("llvm.fabs", x), np.abs),
            np.fabs: self.of_numpy(lambda x: self.e.call("llvm.fabs", x), np.fabs),
            np.array: functools.partial(self.array, np.array),
            np.asarray: functools.partial(self.array, np.asarray),
        }
        for function, formula in OF_NUMBERS.items():
            self.table[function] = self.of_floats(function, formula)
        if hasattr(math, "sumprod"):  # from Python 3.12 on
            self.table[math.sumprod] = self.refused(math.sumprod, "liemech.dot")
        for f in (getattr(functions, name) for name in functions.INSTRUCTIONS):
            self.table[f] = f
        self.table[functions.fma] = functions.fma
        for f in functions.LIBM:
            self.table[f] = f
            original = getattr(math, f.__name__)
            if original.__name__ == f.__name__:  # not another one, put there by the user
                self.table.setdefault(original, self.of_math(original, f.__name__))
        for python, symbol in FUNCTIONS.items():
            self.table.setdefault(python, self.called_back(python, symbol))
        for python in OF_MATH.keys() & self.table.keys():
            self.table[python] = self.taking_all(self.table[python], python)
        for function in OF_NUMPY:
            self.table[function] = self.or_formula(function, self.table.get(function))
        for f in [f for f in self.table if isinstance(f, types.FunctionType) and not is_own(f)]:
            del self.table[f]  # put into `math` or NumPy by the user

    # -------------------------------------------------------------- kinds

    def array(self, function: Any, x: Any, **options: Any) -> Any:
        if not varies(x):
            return self.t.known(function, (x,), options)
        return arrays.made(self.e, x, options)

    def type(self, value: Any) -> Any:
        return self.asked("type", value, lambda cls: cls, self.t.reads.class_of)

    def isinstance(self, value: Any, kind: Any) -> Any:
        reads = self.t.reads
        question = lambda cls: issubclass(cls, kind)  # noqa: E731
        return self.asked("isinstance", value, question, lambda x: reads.instance(x, kind))

    def hasattr(self, value: Any, name: str) -> Any:
        reads = self.t.reads
        question = lambda cls: hasattr(cls, name)  # noqa: E731
        return self.asked("hasattr", value, question, lambda x: reads.has(x, name))

    def asked(self, name: str, value: Any, of_class: Callable[..., Any], of_object: Callable[..., Any]) -> Any:
        """The answer to a question about an object, for what the compiler computes with about its class."""
        if isinstance(value, Array):
            return of_class(np.ndarray)
        if isinstance(value, (Num, Closure, ItemStream)):
            return self.of_class(name, value, of_class)
        return of_object(value)

    def of_class(self, name: str, value: Any, question: Callable[..., Any]) -> Any:
        """The answer to a question about the class of what the compiler computes with, if it is one
        for all classes that it may have in Python.
        """
        if isinstance(value, ItemStream):
            raise NotCompilable(f"`{name}` of an iterator")
        if isinstance(value, Closure):
            return question(types.FunctionType)
        python_type, of_numpy = TYPES[value.kind], NUMPYS[value.kind]
        answer = question(python_type)
        # an integer may be a truth value on another way
        if value.kind == "i" or value.mixed:
            for other in (int, bool) if value.mixed else (bool,):
                if question(other) is not answer:
                    raise NotCompilable(
                        f"`{name}` of a number that may be {python_type.__name__} or {other.__name__}: give "
                        "it one kind on every way, by float(x) or int(x), and ask before the run"
                    )
        if question(of_numpy) is not answer:
            self.e.unless_numpy(f"`{name}` of a number known only at run time")
        return answer

    def float(self, x: Any = 0.0) -> Any:
        x = value_of(x)
        if isinstance(x, Num):
            return self.e.num(self.e.cast(x, "f", x.varying))
        if isinstance(x, (Dual, Series)):
            raise NotCompilable("`float` of a number that carries a derivative")
        return float(x)

    def whole(self, x: Num, rounding: str) -> Any:
        """A float rounded to an integer; one beyond 2^63 is a failure."""
        if x.kind != "f":
            return self.e.num(self.e.cast(x, "i", x.varying))
        inside = abs(x) < float(HUGE)
        self.t.fail_if(self.e.negation(inside))
        whole = self.e.call(rounding, self.e.select(inside, x, 0.0))
        return self.e.each(lambda v: self.e.builder.fptosi(v, self.e.type("i", x.varying)), whole.values)

    def cut(self, x: Any = 0, *base: Any) -> Any:
        if isinstance(x, (Num, ByValue)):
            return self.table[math.trunc](x)
        return int(x, *base)

    def round(self, x: Any, digits: Any = None) -> Any:
        x = value_of(without_slope(x))
        if isinstance(x, DoubleDouble) and digits is None:
            return double_double.nearest(x, self.floor)
        if not holds_number((x, digits)) and not isinstance(x, DoubleDouble):
            return round(x, digits)
        if digits is not None or not isinstance(x, Num):
            raise NotCompilable("`round` to a number of digits: write round(x * 100.0) / 100.0")
        return self.whole(x, "llvm.roundeven")

    # -------------------------------------------------------------- many items

    def extreme(self, better: Callable[[Any, Any], Any], *items: Any, **options: Any) -> Any:
        if len(items) == 1:
            items = tuple(self.t.iterate(items[0]))
        key = options.pop("key", None)
        if key is None and not holds_number(items) and all(map(is_any_number, items)):
            return (min if better is operator.lt else max)(items, **options)
        if options or not items:
            raise NotCompilable("`min` and `max` of run-time numbers take no `default`, and at least one number")
        result, *others = items
        best = result if key is None else self.t.call(key, result)
        for x in others:
            of_x = x if key is None else self.t.call(key, x)
            closer = better(of_x, best)
            result, best = self.t.where(closer, x, result), self.t.where(closer, of_x, best)
        return result

    def sum(self, items: Any, start: Any = 0) -> Any:
        """Python's sum, from left to right; from Python 3.12 on with the rounding errors of floats carried along.

        Source: CPython, Python/bltinmodule.c, builtin_sum_impl.
        """
        total, *remaining = start, *self.t.iterate(items)
        while remaining:
            if COMPENSATED_SUMS and _kind(total) == "f" and isinstance(total, (float, Num)):
                self.e.unless_numpy("`sum`")  # which carries errors along of Python's floats only
                lost, taken = 0.0, 0
                for x in remaining:
                    if _kind(x) not in ("f", "i", "b"):
                        break
                    if _kind(x) == "f":
                        larger = total + x
                        lost = lost + self.t.where(abs(total) >= abs(x), (total - larger) + x, (x - larger) + total)
                        total = larger
                    else:
                        total = total + x
                    taken += 1
                if taken:
                    total = self.t.where(self.e.logic("and_", lost != 0.0, lost - lost == 0.0), total + lost, total)
                    remaining = remaining[taken:]
                    continue
            total, remaining = total + remaining[0], remaining[1:]
        return total

    def sorted(self, items: Any, **options: Any) -> list[Any]:
        ordered, key, reverse = (list(self.t.iterate(items)), options.get("key"), options.get("reverse"))
        if key is None and not any(isinstance(x, ByValue) or holds_number(x) for x in ordered):
            return sorted(ordered, **options)
        keys = [*ordered] if key is None else [self.t.call(key, x) for x in ordered]
        if isinstance(reverse, Num) or not all(isinstance(x, ByValue) or is_any_number(x) for x in keys):
            raise NotCompilable(
                "`sorted` of run-time numbers sorts by plain numbers, its direction known before "
                "the run: give a `key` that is one number"
            )
        for x in map(value_of, map(without_slope, keys)):
            if isinstance(x, Num):
                self.t.fail_if(x != x)  # the place of a nan depends on how Python sorts
        if reverse:  # what is equal keeps its order
            ordered, keys = ordered[::-1], keys[::-1]
        for i in range(1, len(ordered)):
            for k in range(i, 0, -1):
                swap = keys[k] < keys[k - 1]
                for row in (ordered, keys):
                    a, b = row[k - 1 : k + 1]
                    row[k - 1], row[k] = self.t.where(swap, b, a), self.t.where(swap, a, b)
        return ordered[::-1] if reverse else ordered

    def together(self, operation: str, start: bool, items: Any) -> Any:
        return functools.reduce(lambda a, x: self.e.logic(operation, a, self.t.truth(x)), self.t.iterate(items), start)

    def len(self, items: Any) -> int:
        if isinstance(items, (ItemStream, Num)):
            raise NotCompilable("`len` of an iterator or a number")
        return len(items)

    # -------------------------------------------------------------- iterators

    def lazily(self, function: Callable[..., Any], *items: Any, **options: Any) -> ItemStream:
        """A function of iterables that gives an iterator: of lists known now a list, of iterators
        one that asks them.
        """
        iterator = function(*map(self.t.iterate, items), **options)
        lazy = any(isinstance(x, ItemStream) for x in items)
        return self.t.stream(iterator if lazy else list(iterator), items)

    def zip(self, *items: Any, **options: Any) -> ItemStream:
        return self.lazily(zip, *items, **options)

    def map(self, function: Any, *items: Any) -> ItemStream:
        return self.t.stream(self.t.call(function, *x) for x in zip(*map(self.t.iterate, items)))

    def filter(self, function: Any, items: Any) -> ItemStream:
        def chosen() -> Iterator[Any]:
            for x in self.t.iterate(items):
                test = self.t.truth(x if function is None else self.t.call(function, x))
                if isinstance(test, Num):
                    raise NotCompilable("`filter` by a condition known only at run time")
                if test:
                    yield x

        return self.t.stream(chosen())

    def next(self, stream: Any, *default: Any) -> Any:
        if not isinstance(stream, ItemStream):
            raise NotCompilable(f"`next` of what is no iterator, but {type(stream).__name__}")
        try:
            return stream.take(self.t.state.region)
        except StopIteration:
            if default:
                return default[0]
            raise NotCompilable("`next` of an iterator that has no more items") from None

    # -------------------------------------------------------------- functions of floats

    def plain_number(self, native: Callable[..., Any], function: Callable[..., Any]) -> Callable[..., Any]:
        """A function of plain numbers: Python's own for numbers that are known at translation."""

        def value(*x: Any) -> Any:
            x = tuple(map(value_of, x))
            if any(isinstance(a, (Dual, Series)) for a in x):
                name = f"{'np' if isinstance(function, np.ufunc) else 'math'}.{function.__name__}"
                advice = f"use liemech.formulas.{function.__name__}"
                unknown = "its derivative is not known here; write the gradient or force yourself"
                raise NotCompilable(
                    f"`{name}` of a number that carries a derivative: "
                    f"{advice if hasattr(functions, function.__name__) else unknown}"
                )
            if not any(isinstance(a, Num) for a in x):
                return function(*x)
            if not all(map(is_any_number, x)):
                raise NotCompilable(f"`{function.__name__}` of what is no number")
            return native(*x)

        return value

    def of_numpy(self, native: Callable[..., Any], function: Callable[..., Any]) -> Callable[..., Any]:
        """A function of NumPy's, of floats alone: of truth values NumPy computes in half precision, of integers often in
        another way.
        """
        of_integers = any(form.startswith("l") for form in function.types)  # type: ignore[attr-defined]

        def value(*x: Any) -> Any:
            floats = [kind_of(a) == "f" and not is_mixed(a) for a in x]
            if any(kind_of(a) == "b" for a in x) or (of_integers and not any(floats)):
                raise NotCompilable(
                    f"`np.{function.__name__}` of integers or truth values: write float(x), or use "
                    "Python's own functions"
                )
            self.e.meet_numpy()
            return native(*x)

        return self.plain_number(value, function)

    def of_floats(self, function: Any, formula: Callable[..., Any]) -> Callable[..., Any]:
        """A function of NumPy, of floats and tables: the formula, which has its bits."""

        def value(*x: Any, **options: Any) -> Any:
            if not holds_number((x, options)):
                return self.t.known(function, x, options)
            numbers = [a for a in x[1 if function is np.where else 0 :] if is_any_number(a)]
            if not any(kind_of(a) == "f" for a in numbers) or any(
                isinstance(a, Num) and (a.kind != "f" or a.mixed) for a in numbers
            ):
                raise NotCompilable(
                    f"`np.{function.__name__}` of integers or truth values: write float(x), or liemech.formulas.where"
                )
            if any(len(a) > TABLED for a in x if isinstance(a, (np.ndarray, tuple, list))):
                raise NotCompilable(
                    f"`np.{function.__name__}` in a table of more than {TABLED} numbers: use a "
                    "liemech.PiecewisePolynomial"
                )
            self.e.meet_numpy()
            operands = [float(a) if type(a) is int else small(a) for a in x]
            return self.t.call(formula, *operands, **options)

        return value

    def stepwise(
        self, rounding: str, function: Callable[..., Any], of_two_doubles: Callable[..., Any]
    ) -> Callable[..., Any]:
        """A function of `math` whose values are whole, so that its derivative is zero."""
        native = self.plain_number(lambda x: self.whole(x, rounding), function)

        def value(x: Any) -> Any:
            x = value_of(without_slope(x))
            return of_two_doubles(x, self.floor) if isinstance(x, DoubleDouble) else native(x)

        return value

    def floor(self, x: Any) -> Any:
        """The largest integer not above a float."""
        return self.whole(x, "llvm.floor") if isinstance(x, Num) else math.floor(x)

    def of_math(self, function: Callable[..., Any], name: str) -> Callable[..., Any]:
        """A function of `math`: the C library's, which fails where Python raises."""
        return self.plain_number(lambda *x: self.raising(self.e.call(name, *x), *x), function)

    def taking_all(self, native: Callable[..., Any], function: Any) -> Callable[..., Any]:
        """A function of `math`, of numbers that carry more the formula; it fails where Python's raises."""
        formula = OF_MATH[function]

        def value(*x: Any) -> Any:
            if not any(isinstance(a, (Dual, Series, DoubleDouble)) for a in x):
                return native(*x)
            try:
                native(*map(head, x))
            except (ArithmeticError, ValueError) as error:
                raise NotCompilable(f"`math.{function.__name__}` raises here: {error}") from None
            return self.t.call(formula, *x)

        return value

    def log(self, x: Any, *base: Any) -> Any:
        log = self.of_math(math.log, "log")
        return log(x) / log(*base) if base and holds_number((x, *base)) else math.log(x, *base) if base else log(x)

    def or_formula(self, function: Any, of_numbers: Any) -> Callable[..., Any]:
        """A function of NumPy: the formula of the same meaning, of vectors, matrices and numbers that carry more."""

        def value(*x: Any, **options: Any) -> Any:
            varying = any(isinstance(a, Operand) for a in inside(x))
            if any(isinstance(a, Array) for a in inside(x)):
                x = vector(x)
                if not varying and isinstance(function, np.ufunc) and of_numbers and not options:
                    return array(by_components(of_numbers, *map(small, x)))
                if not varying and function is not np.cross:
                    raise refuse(f"`np.{function.__name__}`")
                result = value(*x, **options)
                return result if varying else array(result)
            if not varying:
                if of_numbers is None:
                    return self.t.known(function, x, options)
                return of_numbers(*x, **options)
            chosen = OF_NUMPY[function](x, options)
            if chosen is None:
                return self.t.known(function, x, options)
            formula, operands, options = chosen
            if isinstance(formula, functools.partial):  # component by component
                return by_components(functools.partial(applied, *formula.args), *operands)
            return applied(formula, *operands, **options)

        def applied(formula: Any, *x: Any, **options: Any) -> Any:
            if isinstance(formula, types.FunctionType):
                return self.t.call(formula, *x, **options)
            return memory_loops.matmul(self.e, formula, x)

        return value

    def called_back(self, function: Callable[..., Any], symbol: str) -> Callable[..., Any]:
        """A function that native code asks Python for."""

        def native(*x: Any) -> Any:
            if len(x) > 2:
                raise NotCompilable(
                    f"`{function.__name__}` of more than two numbers: use liemech.norm, or call it twice"
                )
            result = self.e.call(f"{symbol.removeprefix('liemech_')}_{len(x)}", *x)
            return result if isinstance(function, np.ufunc) else self.raising(result, *x)

        return (self.of_numpy if isinstance(function, np.ufunc) else self.plain_number)(native, function)

    def raising(self, result: Num, *x: Any) -> Num:
        """The result of a function of `math`: it raises where there is none, nan or infinite, and
        the arguments were finite.
        """
        wrong = result != result
        for a in x:
            if isinstance(a, Num) and a.kind == "f":
                wrong = self.e.logic("and_", wrong, a == a)
        self.t.fail_if(self.e.logic("or_", wrong, self.e.overflowed(result, *x)))
        return result

    def refused(self, function: Any, instead: str) -> Callable[..., Any]:
        """A function of values known at translation; numbers of the run are refused."""

        def value(*x: Any, **options: Any) -> Any:
            if holds_number((x, options)) or any(isinstance(a, Operand) for a in inside(x)):
                home = "math" if function.__module__ == "math" else "np"
                raise NotCompilable(
                    f"`{home}.{function.__name__}` rounds or returns arrays in ways of its own: use {instead}"
                )
            return self.t.known(function, x, options)

        return value


def _kind(x: Any) -> str | None:
    """The kind of a plain number, None for anything else."""
    return kind_of(x) if isinstance(x, (Num, int, float)) else None
