"""The compiler's front half: it walks a formula's syntax tree with run-time numbers in place of
floats.

What Python knows now it does now: constants fold, static loops are written out, branches on static
values disappear, methods resolve through the class (inheritance, overriding and `super` included)
and are inlined.  Only what depends on run-time numbers becomes native code.  The same source serves
a single body and an ensemble in lanes, and gives every lane the bits of a single run.
"""

from __future__ import annotations

import ast
import builtins
import dataclasses
import decimal
import fractions
import inspect
import types
from collections.abc import Callable, Hashable
from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType, NotCompilable
from ...formulas import functions, large, sums, tables, vectors
from ...formulas.classes.fields import converters
from ...formulas.classes.layouts import floats_in, layout_of, leaves, with_floats
from ...formulas.classes.overriding import kept
from ...formulas.classes.records import Record, fill, records_in, with_fields, with_records
from ...formulas.classes.signatures import bare
from ...formulas.derivatives import axes, carried, tangent
from ...formulas.large_maps import DiagonalSolver, LinearMap
from ...formulas.numbers import philox, products, series, transposes
from ...formulas.numbers.bases import is_any_number
from ...formulas.numbers.conversions import as_others_see, compensated, double_double, fitted, plain, resting, rounded
from ...formulas.numbers.dual import Dual, at_rest
from ...formulas.numbers.forms import LinearForm, chosen
from ...formulas.numbers.pairs import PAIRS, paired
from ...formulas.numbers.series import Series, SeriesInMemory
from ...formulas.vectors import Mat, Vec
from .. import driver
from ..changes import content_hashes
from ..changes.content_hashes import of_python
from ..changes.dependencies import Reads, varies
from ..numbers import lookups, memory_loops
from ..numbers.arrays import Array, refuse, vector
from ..numbers.ir_numbers import Emitter, Num
from ..numbers.python_functions import COMPUTING, OUTSIDE, STRUCTURE, PythonFunctions
from .advice import instead_of, instead_of_syntax
from .expressions import in_words
from .inlining import Outliner
from .joins import Open, leveled
from .scopes import RETURN, CallFrame, Closure, Env, Undefined, acts_unexecuted, bound
from .source import Source
from .statements import Statements

DEPTH = 44  # nested calls, of a formula 40: a driver is four deep

# modules of classes whose methods run as they stand
_ARITHMETIC = vectors.__name__, series.__name__, products.__name__
_OUTSIDE = {vars(builtins)[name] for name in OUTSIDE.split()}
_PYTHON = {f for f in vars(builtins).values() if callable(f) and f not in _OUTSIDE}
_TEXTS = str, repr, ascii, format
_UNSEEN = "fromfile save savez savez_compressed savetxt empty empty_like copyto put putmask place fill_diagonal"
"""NumPy's functions that act outside or look there."""
_READING = (
    "index count get keys values items copy sum dot min max mean any all astype reshape transpose "
    "flatten ravel tolist item bit_length conjugate as_integer_ratio is_integer hex join split "
    "startswith endswith format upper lower strip replace"
)
"""Methods of lists, dicts, texts, arrays and numbers that change nothing."""


_OF_DICTS = "dict.keys", "dict.values", "dict.items", "dict.get"


class Interpreter(Statements):
    """Translates formulas into the instructions of one native function."""

    def __init__(self, emitter: Emitter, reads: Reads) -> None:
        super().__init__(emitter, reads)
        emitter.fail_if = self.fail_if
        self.outliner = Outliner(self)
        self.python = PythonFunctions(self).table
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            **self.python,
            functions.where: self.where,
            super: self.super,
            getattr: self.named,
            dataclasses.replace: self.replaced,
            **{
                f: f
                for f in (layout_of, as_others_see, compensated, double_double, plain, resting, rounded, fitted, axes)
            },
            **{f: f for f in (floats_in, with_floats)},
            **{f: f for f in (records_in, with_fields, at_rest)},
            with_records: lambda x, kind, new: with_records(x, kind, new, self.reads.exchanged),
            **{
                slopes: lambda formula, *x, slopes=slopes: slopes(
                    lambda y: vector(self.call(formula, y)), *map(vector, x)
                )
                for slopes in (tangent, carried)
            },
            **{f: f for f in (transposes.is_pulled, transposes.Residual.felt)},
            **{
                f: lambda *x, f=f: f(*x, call=lambda formula, *y: vector(self.call(formula, *y)))
                for f in transposes.CALLING
            },
            sums.bilinear_map: lambda *x: memory_loops.sums(emitter, sums.bilinear_map, *x),
            sums.antisymmetric_map: lambda *x: memory_loops.sums(emitter, sums.antisymmetric_map, *x),
            tables.entry: lambda *x: lookups.entry(emitter, *x),
            tables.whole: lambda *x: lookups.whole(emitter, *x),
            philox.uniforms: emitter.uniforms,
            driver.numbers: lambda x: Vec(*leaves(x, layout_of(x, is_any_number))),
        }

    # -------------------------------------------------------------- calls

    def call(self, function: Any, *args: Any, **options: Any) -> Any:
        """The value of a call: an intrinsic, a record, a formula to inline, or a call that Python makes at translation."""
        if isinstance(function, Record):
            return self.call(self.attribute(function, "__call__"), *args, **options)
        if isinstance(function, types.MethodType):
            return self.call(function.__func__, function.__self__, *args, **options)
        if isinstance(function, Closure):
            self.deeper()
            frame = CallFrame(function.frame.source, function.node, function.arguments(args, options), function.frame)
            return self.enter(frame)
        intrinsic = self.intrinsics.get(function) if isinstance(function, Hashable) else None
        if intrinsic is not None:
            if function in self.python and function not in STRUCTURE:
                self.reads.settled(*args, inside=function in COMPUTING)
            try:
                return intrinsic(*args, **options)
            except NotCompilable:
                raise
            except TypeError as error:
                raise NotCompilable(f"`{function.__name__}`: {in_words(error)}") from None
        if isinstance(function, type) and issubclass(function, Record):
            return self.construct(function, args, options)
        if function in (Vec, Mat):
            return function(*args, **options)
        if function in (Series, SeriesInMemory, *PAIRS) or getattr(function, "__module__", None) in _ARITHMETIC:
            if isinstance(function, types.FunctionType) and not function.__qualname__.startswith(
                ("Vec.", "Mat.", "Series.", "SeriesInMemory.")
            ):
                return self.inline(function, args, options)
            return function(*args, **options)
        if isinstance(function, (DiagonalSolver, LinearMap)):
            return function(*args)
        if isinstance(function, types.FunctionType) and not _of_numbers(function):
            if function.__module__ in (sums.__name__, large.__name__):  # Python runs these as they stand
                self.reads.settled(*args)
                return function(*args, **options)
            return self.inline(function, args, options)
        written = getattr(type(function), "__call__", None)  # noqa: B004
        if of_python(type(function)) and isinstance(written, types.FunctionType):
            if "__call__" in getattr(function, "__dict__", {}):
                raise NotCompilable("an object with a `__call__` beside that of its class")
            return self.call(self.attribute(function, "__call__"), *args, **options)
        return self.known(function, args, options)

    def known(self, function: Any, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
        """The value of a call that Python makes at translation, of arguments known then."""
        name = getattr(function, "__qualname__", repr(function))
        method = isinstance(function, types.BuiltinMethodType) and not isinstance(function.__self__, types.ModuleType)
        if not (
            name.rpartition(".")[2] in _READING.split()
            if method
            else (isinstance(function, Hashable) and function in _PYTHON) or _of_numbers(function)
        ):
            raise NotCompilable(f"`{name}` is not known to native code: {instead_of(function)}")
        if method and (not content_hashes.known(function.__self__, False) or self.reads.from_outside(function)):
            raise NotCompilable(
                f"`{name}` asks an object of {type(function.__self__).__qualname__}, whose content "
                "nobody has read: give its value to a name or a field before the run"
            )
        if name in _OF_DICTS and not varies([*args[:1]]):
            self.reads.settled(*args)
            entries = function(*args)
            return entries if name == "dict.get" else list(entries)
        if "out" in options or (isinstance(function, np.ufunc) and len(args) > function.nin):
            raise NotCompilable(f"`{name}` changes an array in place: assign its result to a name")
        if varies([*args, *options.values(), *([function.__self__] if method else [])]):
            raise NotCompilable(f"`{name}` of numbers known only at run time: {instead_of(function)}")
        self.reads.settled(*args, *options.values(), inside=function not in (dict, range, slice))
        if function in _TEXTS or (method and isinstance(function.__self__, str)):
            for x in (*args, *options.values()):
                self.textual(x)
        return function(*args, **options)

    def deeper(self) -> None:
        if len(self.frames) > DEPTH:
            raise NotCompilable("formulas call each other without end")

    def inline(self, function: types.FunctionType, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
        self.deeper()
        source = self.reads.source(function)
        if bare(function) is not function and any(isinstance(x, Array) for x in args):
            raise refuse(f"`{function.__qualname__}`")
        returned = self.outliner.enter(CallFrame(source, source.node, _parameters(source, args, options)))
        promised = getattr(function, "__promise__", None)
        return returned if promised is None else self.promised(promised, function, vector(returned))

    def promised(self, promised: Any, function: types.FunctionType, returned: Any) -> Any:
        """The value of a method, a list as a vector; refused if it is not what its base promises."""
        try:
            return kept(promised, function.__qualname__, returned)
        except InvalidType as error:
            raise NotCompilable(str(error)) from None

    def enter(self, frame: CallFrame) -> Any:
        """The value that a function returns, its body translated in a frame of its own."""

        never = acts_unexecuted(frame.scope)
        if never is not None:
            frame.node = never
            raise NotCompilable(
                f"`{ast.unparse(never)}`: this {'statement' if isinstance(never, ast.stmt) else 'expression'} "
                f"has no place in a formula: {instead_of_syntax(never)}"
            )

        def result() -> Any:
            if not isinstance(frame.scope, ast.FunctionDef):
                return self.expression(frame.scope.body, frame.env)  # type: ignore[union-attr]
            if self.block(frame.scope.body, frame.env):
                frame.returns.append(Open(self.builder.block, {RETURN: None} | frame.captured(frame.env)))
            if not any(RETURN in open_.env for open_ in frame.returns):
                raise NotCompilable("every way through the formula raises")
            frame.env = {}
            self.join(frame.returns, frame.env)
            value = frame.env.pop(RETURN, None)  # of lanes that have all raised, anything
            if isinstance(value, Undefined):
                raise NotCompilable(f"the returned value has no one form: {value.reason}")
            return value

        return self.within(frame, result)

    def construct(self, cls: type, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
        """A record made by a formula: its fields, converted, without liemech's checks of them."""
        fields = self.reads.fields(cls)
        in_order = [f.name for f in fields if f.init and not f.kw_only]
        if len(args) > len(in_order) or not options.keys().isdisjoint(in_order[: len(args)]):
            raise NotCompilable(f"{cls.__name__} is made of {in_order} in this order, each once; others by name")
        values = dict(zip(in_order, args, strict=False)) | options
        for f in fields:
            if f.name not in values:
                if f.default is dataclasses.MISSING or not f.init:
                    raise NotCompilable(
                        f"{cls.__name__} needs its field {f.name} (derived fields cannot be made by formulas)"
                    )
                values[f.name] = f.default
        if len(values) != len(fields):
            raise NotCompilable(f"{cls.__name__} has the fields {[f.name for f in fields]}")
        method = self.reads.construction(cls)
        if method:
            raise NotCompilable(
                f"{cls.__name__}.{method} would run where a formula makes one: make it before the run, "
                "or a record without it"
            )
        left = [f.name for f in fields if values[f.name] is None and f.default is None]
        if left and self.reads.sets_fields(cls):
            raise NotCompilable(
                f"{cls.__name__} finds its {' and '.join(left)} itself when it is made, which a "
                "formula cannot do: make it before the run, as a field or a global name"
            )
        record = fill(cls, {f.name: values[f.name] for f in fields})
        try:
            converted = {
                name: convert(record, name, values[name])
                for name, convert, easy, _ in converters(cls)
                if type(values[name]) not in easy
            }
        except (InvalidInput, InvalidType) as error:
            raise NotCompilable(str(error)) from None
        return fill(cls, vars(record) | converted)

    def replaced(self, record: Any, **changes: Any) -> Any:
        """The record with some of its fields changed."""
        if not isinstance(record, Record):
            raise NotCompilable("`dataclasses.replace` of what is no record")
        fields = self.reads.fields(type(record))
        held = {f.name: self.attribute(record, f.name) for f in fields if f.init}
        return self.construct(type(record), (), held | changes)

    def super(self, *args: Any) -> Any:
        if args:
            return super(*args)
        frame = self.frames[-1]
        if frame.scope is not frame.source.node:
            raise NotCompilable("`super()` in an inner function: call it in the method itself")
        self_name = frame.source.function.__code__.co_varnames[0]
        return super(frame.source.outer("__class__"), frame.env[self_name])

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        if isinstance(yes, Series) or isinstance(no, Series):
            return Series.chosen(lambda a, b: self.where(condition, a, b), yes, no)
        if isinstance(yes, LinearForm) or isinstance(no, LinearForm):
            which = self.where(condition, 1.0, 0.0)
            return chosen(lambda a, b: self.where(which > 0.5, a, b), yes, no)
        if isinstance(yes, Dual) or isinstance(no, Dual):
            first, second = leveled([yes, no])
            parts = zip(first.parts, second.parts, strict=True)
            return paired(first.form, [self.where(condition, a, b) for a, b in parts])
        return super().where(condition, yes, no)

    def named(self, value: Any, name: str, *default: Any) -> Any:
        return default[0] if default and not self.call(hasattr, value, name) else self.attribute(value, name)

    def attempt(self, function: Any, *args: Any) -> Any:
        """The value of a call in which formulas may raise; after it, `accepted` tells whether one did."""
        b, e = self.builder, self.emitter
        outer, self.state.failed = (self.state.failed, e.slot())  # one attempt may be a part of another
        e.store(False, self.state.failed)
        self.state.escapes.append([])
        before, self.state.raises, self.state.marks = (self.state.raises, self.state.marks), 0, 0
        result = self.call(function, *args)
        escapes, (self.state.raises, self.state.marks) = self.state.escapes.pop(), before
        self.state.failed, self.state.outcome = outer, self.state.failed
        joined: Env = {}
        self.join([Open(b.block, {"": result}), *(Open(o.block, {"": self.blank(result)}) for o in escapes)], joined)
        return joined[""]

    def accepted(self, value: Any, shown: Any, layout: Any = None) -> Num:
        """Whether an attempt went through, and what it shows is finite: a sum is finite only if its terms are."""
        part = self.call(shown, value)
        total = driver.pairwise_sum(driver.terms(part, layout_of(part)))
        finite = total - total == 0.0
        failed = self.emitter.load(self.state.outcome)
        return self.emitter.logic("and_", finite, self.emitter.negation(failed))


def _parameters(source: Source, args: tuple[Any, ...], options: dict[str, Any]) -> Env:
    """The parameters of a call, by Python's rules."""
    code = source.function.__code__
    names, special = (
        code.co_varnames[: code.co_argcount],
        code.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS),
    )
    if len(args) == len(names) and not options and not special and not code.co_kwonlyargcount:
        return dict(zip(names, args, strict=True))
    return bound(inspect.signature(source.function, follow_wrapped=False), source.name, args, options)


def _of_numbers(function: Any) -> bool:
    """A function of `math` or NumPy, or a type of numbers."""
    if isinstance(function, type):
        return not of_python(function) and issubclass(function, (np.generic, fractions.Fraction, decimal.Decimal))
    name = getattr(function, "__name__", "")
    if isinstance(function, np.ufunc):
        return getattr(np, name, None) is function
    home = str(getattr(function, "__module__", None)).partition(".")[0]
    return (
        isinstance(function, (types.BuiltinFunctionType, types.FunctionType, type(np.dot)))
        and home in ("math", "numpy")
        and name not in _UNSEEN.split()
    )
