"""The compiler's front half: it walks a formula's syntax tree with run-time numbers in place of floats.

What Python knows now it does now: constants fold, static loops are written out, branches on static values disappear, methods
resolve through the class (inheritance, overriding and `super` included) and are inlined.  Only what depends on run-time numbers
becomes native code.  The same source serves a single body and an ensemble in lanes, and gives every lane the bits of a single run.
"""

from __future__ import annotations

import ast
import builtins
import dataclasses
import inspect
import math
import operator
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import NotCompilable
from ..formulas import functions, series, vectors
from ..formulas.broadcasting import annotation_text
from ..formulas.compensated import value_of
from ..formulas.dual import Dual
from ..formulas.pytree import PAIRS, compensated, fill, fitted, is_any_number, layout_of, leaves, plain
from ..formulas.records import Record
from ..formulas.series import Series
from ..formulas.vectors import Mat, Vec
from . import driver
from .expressions import Closure, Expressions, holds_number
from .ir_numbers import Emitter, Num
from .joins import RETURN, Env, Frame, Open, Undefined
from .reads import Reads
from .statements import Statements

DEPTH = 40  # nested calls

_REFUSED = {print, input, open, eval, exec, setattr, delattr, globals, locals, vars, dir, hash, id}
_TEXT = {str, repr, format, ascii, bin}
_ARITHMETIC = vectors.__name__, series.__name__  # modules of classes whose methods run as they stand
_OF_STRUCTURE = {zip, enumerate, reversed, len, iter, next, tuple, list, dict, range, slice}
_STATIC = {f for f in vars(builtins).values() if callable(f) and f not in _REFUSED}


class Interpreter(Statements):
    """Translates formulas into the instructions of one native function."""

    def __init__(self, emitter: Emitter, reads: Reads) -> None:
        super().__init__(emitter, reads)
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            functions.where: self.where,
            isinstance: _isinstance,
            min: lambda *x: self.extreme(operator.lt, *x),
            max: lambda *x: self.extreme(operator.gt, *x),
            float: self.float,
            bool: self.truth,
            super: self.super,
            type: _type,
            getattr: self.named,
            hasattr: reads.has,
            sum: self.sum,
            **{f: f for f in (layout_of, compensated, plain, fitted)},
            driver.numbers: lambda x: Vec(*leaves(x, layout_of(x, is_any_number))),
            math.fabs: abs,
            np.abs: abs,
            np.dot: lambda a, b: self.call(vectors.dot, a, b),
            np.cross: lambda a, b: self.call(vectors.cross, a, b),
        }
        for f in (functions.sqrt, *functions.LIBM):
            name = f.__name__
            intrinsic = self.elementary(f, "llvm.sqrt" if name == "sqrt" else name)
            numpy_name = name.replace("asin", "arcsin").replace("acos", "arccos").replace("atan", "arctan")
            self.intrinsics |= {f: intrinsic, getattr(math, name): intrinsic, getattr(np, numpy_name): intrinsic}

    # -------------------------------------------------------------- calls

    def call(self, function: Any, *args: Any, **options: Any) -> Any:
        """The value of a call: an intrinsic, a record, a formula to inline, or Python itself on what is known now."""
        if isinstance(function, types.MethodType):
            return self.call(function.__func__, function.__self__, *args, **options)
        if isinstance(function, Closure):
            return self.enter(Frame(function.source, function.env | _of_lambda(function.node, args)), function.node)
        intrinsic = self.intrinsics.get(function) if function.__hash__ else None
        if intrinsic is not None:
            return intrinsic(*args, **options)
        if isinstance(function, type) and issubclass(function, Record):
            return self.construct(function, args, options)
        if function in _TEXT and holds_number(args):
            raise NotCompilable(f"{function.__name__} of a number known only at run time")
        if function in (Vec, Mat, Series, *PAIRS) or function in _STATIC or getattr(function, "__module__", None) in _ARITHMETIC:
            if isinstance(function, types.FunctionType) and not function.__qualname__.startswith(("Vec.", "Mat.", "Series.")):
                return self.inline(function, args, options)
            if function in _STATIC and function is not callable:
                self.reads.settled(*args, *options.values(), inside=function not in _OF_STRUCTURE)
            return function(*args, **options)
        if isinstance(function, types.FunctionType):
            return self.inline(function, args, options)
        raise NotCompilable(f"{getattr(function, '__qualname__', repr(function))} is not known to native code")

    def inline(self, function: types.FunctionType, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
        if len(self.frames) > DEPTH:
            raise NotCompilable("formulas call each other without end")
        source = self.reads.source(function)
        return self.enter(Frame(source, _arguments(source.function, args, options)), source.node)

    def enter(self, frame: Frame, node: ast.FunctionDef | ast.Lambda) -> Any:
        """The value that a function returns, its body translated in a frame of its own."""
        base, depth = self.base, self.depth
        if self.frames:
            self.base = self.active(self.frames[-1].env)
        self.depth = 0
        self.frames.append(frame)
        if isinstance(node, ast.Lambda):
            result = self.expression(node.body, frame.env)
        else:
            if self.block(node.body, frame.env):
                frame.returns.append(Open(self.builder.block, {RETURN: None}))
            if not frame.returns:
                raise NotCompilable("every way through the formula raises")
            returned: Env = {}
            self.join(frame.returns, returned)
            result = returned[RETURN]
            if isinstance(result, Undefined):
                raise NotCompilable(f"the returned value has no one form: {result.reason}")
        self.frames.pop()
        self.base, self.depth = base, depth
        return result

    def construct(self, cls: type, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
        """A record made by a formula: its fields, without the checks of its border."""
        fields = self.reads.fields(cls)
        given = dict(zip([f.name for f in fields if f.init], args, strict=False)) | options
        for f in fields:
            if f.name not in given:
                if f.default is dataclasses.MISSING or not f.init:
                    raise NotCompilable(f"{cls.__name__} needs its field {f.name} (derived fields cannot be made by formulas)")
                given[f.name] = f.default
            if annotation_text(f.type) == "float" and is_any_number(given[f.name]):
                given[f.name] = self.intrinsics[float](given[f.name])
        if len(given) != len(fields) or len(args) > len(fields):
            raise NotCompilable(f"{cls.__name__} has the fields {[f.name for f in fields]}")
        return fill(cls, {f.name: given[f.name] for f in fields})

    def super(self, *args: Any) -> Any:
        if args:
            return super(*args)
        source = self.frames[-1].source
        code = source.function.__code__
        return super(source.outer("__class__"), self.frames[-1].env[code.co_varnames[0]])

    def elementary(self, function: Callable[..., Any], name: str) -> Callable[..., Any]:
        def value(*x: Any) -> Any:
            self.reads.settled(*x)
            if any(isinstance(a, Dual) for a in x):
                return self.call(functions.RULES[function.__name__], *x)
            for a in x:
                if isinstance(a, Series):
                    return a.elementary(function.__name__, *x)
            x = tuple(map(value_of, x))
            return self.emitter.call(name, *x) if any(isinstance(a, Num) for a in x) else function(*x)

        return value

    def float(self, value: Any = 0.0) -> Any:
        self.reads.settled(value)
        return self.emitter.num(self.emitter.cast(value, "f", value.varying)) if isinstance(value, Num) else builtins.float(value)

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        if isinstance(yes, Series) or isinstance(no, Series):
            return Series.chosen(lambda a, b: Expressions.where(self, condition, a, b), yes, no)
        return super().where(condition, yes, no)

    def extreme(self, better: Callable[[Any, Any], Any], *items: Any) -> Any:
        result, *others = items if len(items) > 1 else items[0]
        self.reads.settled(result, *others)
        for x in others:
            result = self.where(better(x, result), x, result)
        return result

    def sum(self, items: Any, start: Any = 0) -> Any:
        if holds_number((*items, start)):
            raise NotCompilable("`sum` rounds in a way of its own, which differs between versions of Python: use a loop or `dot`")
        self.reads.settled(items, inside=True)
        return sum(items, start)

    def named(self, value: Any, name: str, *default: Any) -> Any:
        return default[0] if default and not self.reads.has(value, name) else self.attribute(value, name)


    def attempt(self, function: Any, *args: Any) -> Any:
        """The value of a call in which formulas may raise; after it, `accepted` tells whether one did."""
        b, e = self.builder, self.emitter
        if self.failed is None:
            self.failed = e.slot()
        e.store(False, self.failed)
        self.escapes.append([])
        result = self.call(function, *args)
        escapes = self.escapes.pop()
        joined: Env = {}
        self.join([Open(b.block, {"": result}), *(Open(o.block, {"": self.blank(result)}) for o in escapes)], joined)
        return joined[""]

    def accepted(self, value: Any, shown: Any, layout: Any = None) -> Num:
        """Did the attempt go through, and is what it shows finite?  A sum is finite only if its terms are."""
        part = self.call(shown, value)
        total = driver.pairwise_sum(list(leaves(part, layout_of(part))))
        finite = total - total == 0.0
        failed = self.emitter.load(self.failed)
        return self.emitter.logic("and_", finite, self.emitter.negation(failed))


def _type(value: Any) -> type:
    return {"f": float, "i": int, "b": bool}[value.kind] if isinstance(value, Num) else type(value)


def _isinstance(value: Any, kind: Any) -> bool:
    if isinstance(value, Num):
        return {"f": float, "i": int, "b": bool}[value.kind] in (kind if isinstance(kind, tuple) else (kind,))
    return isinstance(value, kind)


def _of_lambda(node: ast.Lambda, args: tuple[Any, ...]) -> Env:
    names = [a.arg for a in node.args.args]
    if len(args) != len(names) or len(ast.unparse(node.args).split(",")) != len(names):
        raise NotCompilable(f"`{ast.unparse(node)}` is called with {len(args)} arguments (a lambda in a formula takes plain ones)")
    return dict(zip(names, args, strict=True))


def _arguments(function: types.FunctionType, args: tuple[Any, ...], options: dict[str, Any]) -> Env:
    bound = inspect.signature(function, follow_wrapped=False).bind(*args, **options)
    bound.apply_defaults()
    return dict(bound.arguments)
