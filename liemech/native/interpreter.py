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
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..errors import NotCompilable
from . import driver, functions, vectors
from .flow import LIVE, NOBODY, RETURN, UNROLL, Env, Flow, Frame, Open, Retype, Undefined
from .numbers import Emitter, Num
from .records import Record, annotation_text, bare
from .source import source_of
from .values import fill, is_any_number, layout_of, leaves
from .vectors import Mat, Vec

DEPTH = 40  # nested calls

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.MatMult: operator.matmul,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda a, b: a in b,
    ast.NotIn: lambda a, b: a not in b,
}
_REFUSED = {print, input, open, eval, exec, setattr, delattr, globals, locals}
_TEXT = {str, repr, format, ascii, bin, hash, id}
_STATIC = {f for f in vars(builtins).values() if callable(f) and f not in _REFUSED}


class Interpreter(Flow):
    """Translates formulas into the instructions of one native function."""

    def __init__(self, emitter: Emitter) -> None:
        super().__init__(emitter)
        self.intrinsics: dict[Any, Callable[..., Any]] = {
            functions.where: self.where,
            isinstance: _isinstance,
            min: lambda *x: self.extreme(operator.lt, *x),
            max: lambda *x: self.extreme(operator.gt, *x),
            float: lambda x: emitter.num(emitter.cast(x, "f", x.varying)) if isinstance(x, Num) else float(x),
            bool: self.truth,
            super: self.super,
            type: _type,
            getattr: self.named,
            sum: self.sum,
            layout_of: layout_of,
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
        intrinsic = self.intrinsics.get(function) if function.__hash__ else None
        if intrinsic is not None:
            return intrinsic(*args, **options)
        if isinstance(function, type) and issubclass(function, Record):
            return self.construct(function, args, options)
        if function in _TEXT and _holds_number(args):
            raise NotCompilable(f"{function.__name__} of a number known only at run time")
        if function in (Vec, Mat) or function in _STATIC or getattr(function, "__module__", None) == Vec.of.__module__:
            if isinstance(function, types.FunctionType) and not function.__qualname__.startswith(("Vec.", "Mat.")):
                return self.inline(function, args, options)
            return function(*args, **options)
        if isinstance(function, types.FunctionType):
            return self.inline(function, args, options)
        raise NotCompilable(f"{getattr(function, '__qualname__', repr(function))} is not known to native code")

    def inline(self, function: types.FunctionType, args: tuple[Any, ...], options: dict[str, Any]) -> Any:
        if len(self.frames) > DEPTH:
            raise NotCompilable("formulas call each other without end")
        source = source_of(bare(function))
        frame = Frame(source, _arguments(source.function, args, options))
        base, depth = self.base, self.depth
        if self.frames:
            self.base = self.active(self.frames[-1].env)
        self.depth = 0
        self.frames.append(frame)
        if isinstance(source.node, ast.Lambda):
            result = self.expression(source.node.body, frame.env)
        else:
            if self.block(source.node.body, frame.env):
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
        fields = dataclasses.fields(cls)
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
            return self.emitter.call(name, *x) if any(isinstance(a, Num) for a in x) else function(*x)

        return value

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        condition = self.truth(condition)
        if isinstance(condition, bool):
            return yes if condition else no
        result = self.blend(condition, yes, no)
        if isinstance(result, Undefined):
            raise NotCompilable(f"`where`: {result.reason}")
        return result

    def extreme(self, better: Callable[[Any, Any], Any], *items: Any) -> Any:
        result, *others = items if len(items) > 1 else items[0]
        for x in others:
            result = self.where(better(x, result), x, result)
        return result

    def sum(self, items: Any, start: Any = 0) -> Any:
        if _holds_number((*items, start)):
            raise NotCompilable("`sum` rounds in a way of its own, which differs between versions of Python: use a loop or `dot`")
        return sum(items, start)

    def named(self, value: Any, name: str, *default: Any) -> Any:
        return default[0] if default and not hasattr(value, name) else self.attribute(value, name)

    def truth(self, value: Any) -> Any:
        if isinstance(value, Num):
            return value if value.kind == "b" else value != 0
        return bool(value)

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
        total, *others = leaves(part, layout_of(part))
        for x in others:
            total = total + x
        finite = total - total == 0.0
        failed = self.emitter.load(self.failed)
        return self.emitter.logic("and_", finite, self.emitter.negation(failed))

    # -------------------------------------------------------------- statements

    def block(self, statements: list[ast.stmt], env: Env) -> bool:
        """Translate statements; False if control never comes to their end."""
        frame = self.frames[-1]
        for i, node in enumerate(statements):
            frame.node, frame.env = node, env
            rest = statements[i + 1 :]
            if isinstance(node, ast.If) and rest and not node.orelse and _leaves(node.body):
                test = self.truth(self.expression(node.test, env))
                if isinstance(test, Num):  # what follows runs only where the branch was not taken
                    return self.branch(test, node.body, rest, env) and self.running(env)
                if test:
                    return self.block(node.body, env)
                continue
            if not self.statement(node, env):
                return False
            if env.get(LIVE) is NOBODY:
                return self.running(env)
        return True

    def running(self, env: Env) -> bool:
        """True, unless every lane has returned from the call and it can end here."""
        frame = self.frames[-1]
        if env.get(LIVE) is not NOBODY or self.depth or frame.loops:
            return True
        frame.returns.append(Open(self.builder.block, {RETURN: env.get(RETURN)}))
        return False

    def statement(self, node: ast.stmt, env: Env) -> bool:
        match node:
            case ast.Return():
                return self.returned(self.expression(node.value, env) if node.value else None, env)
            case ast.Assign():
                value = self.expression(node.value, env)
                for target in node.targets:
                    self.assign(target, value, env)
            case ast.AnnAssign():
                if node.value:
                    self.assign(node.target, self.expression(node.value, env), env)
            case ast.AugAssign():
                old = self.expression(ast.parse(ast.unparse(node.target), mode="eval").body, env)
                if isinstance(old, list):
                    self.unshared(old, node.target, env)
                self.assign(node.target, self.operate(node, old, self.expression(node.value, env)), env)
            case ast.Expr():
                self.expression(node.value, env)
            case ast.If():
                test = self.truth(self.expression(node.test, env))
                if isinstance(test, Num):
                    return self.branch(test, node.body, node.orelse, env)
                return self.block(node.body if test else node.orelse, env)
            case ast.While():
                return self.while_loop(node, env)
            case ast.For():
                return self.for_loop(node, env)
            case ast.Break():
                return self.leave(self.frames[-1].loops[-1], "break", env)
            case ast.Continue():
                return self.leave(self.frames[-1].loops[-1], "continue", env)
            case ast.Raise():
                return self.raised(env)
            case ast.Pass():
                pass
            case _:
                raise NotCompilable(f"`{ast.unparse(node).splitlines()[0]}`: this statement has no place in a formula")
        return True

    def assign(self, target: ast.expr, value: Any, env: Env) -> None:
        match target:
            case ast.Name(id=name):
                if isinstance(env.get(LIVE), Num) and name in env:  # lanes that have left keep what they had
                    value = self.blend(env[LIVE], value, env[name])
                env[name] = value
            case ast.Tuple(elts=targets) | ast.List(elts=targets):
                items = list(value)
                if len(items) != len(targets):
                    raise NotCompilable(f"{len(items)} values are assigned to {len(targets)} names")
                for t, v in zip(targets, items, strict=True):
                    self.assign(t, v, env)
            case ast.Subscript(value=ast.Name(id=name)) if isinstance(env.get(name), list):
                self.unshared(env[name], target.value, env)
                changed = list(env[name])
                changed[self.expression(target.slice, env)] = value
                self.assign(target.value, changed, env)
            case _:
                raise NotCompilable(f"`{ast.unparse(target)} = ...`: formulas do not change objects in place")

    def unshared(self, items: list[Any], name: ast.expr, env: Env) -> None:
        """Python would change the list under its other names too; lists of the compiler are values."""
        elsewhere = [v for frame in self.frames[:-1] for v in frame.env.values()]
        elsewhere += [v for n, v in env.items() if not (isinstance(name, ast.Name) and n == name.id)]
        if any(_holds(v, items) for v in elsewhere):
            it = ast.unparse(name)
            raise NotCompilable(f"`{it}` is changed in place and has another name: change a copy, `[*{it}]`")

    def returned(self, value: Any, env: Env) -> bool:
        frame = self.frames[-1]
        if any(loop.dynamic for loop in frame.loops):
            raise NotCompilable("`return` inside a loop of unknown length: set a variable, `break`, and return after it")
        if RETURN in env:
            value = self.blend(self.everyone(self.active(env)), value, env[RETURN])
        if self.depth == 0:
            frame.returns.append(Open(self.builder.block, {RETURN: value}))
            return False
        env[RETURN], env[LIVE] = value, NOBODY
        return True

    def raised(self, env: Env) -> bool:
        """The step is marked as failed.  Plain Python, run again on it, raises the error with its message."""
        b, mask = self.builder, self.active(env)
        if self.failed is None:
            raise NotCompilable("`raise` outside an attempted step")
        self.raises += 1
        e = self.emitter
        e.store(True if mask is None else e.logic("or_", e.load(self.failed), mask), self.failed)
        if self.depth == 0 and mask is None:
            self.escapes[-1].append(Open(b.block, {}))
            return False
        loops = self.frames[-1].loops
        if loops and loops[-1].dynamic and loops[-1].masked:
            return self.leave(loops[-1], "break", env)
        env[LIVE] = NOBODY
        return True

    def while_loop(self, node: ast.While, env: Env) -> bool:
        if node.orelse:
            raise NotCompilable("`while ... else`")

        def test(variables: Env) -> Any:
            return self.truth(self.expression(node.test, variables))

        def turn(variables: Env) -> Any:
            value = test(variables)
            if isinstance(value, Num):
                raise Retype(None)
            return value

        def too_many(variables: Env) -> Any:
            raise Retype(None)

        if not isinstance(node.test, ast.Constant):
            forget, before = self.mark(), dict(env)
            try:
                return self.written_out([*[turn] * UNROLL, too_many], node.body, env)
            except Retype:
                forget()
                env.clear()
                env.update(before)
        return self.loop(test, lambda variables: None, node.body, env)

    def for_loop(self, node: ast.For, env: Env) -> bool:
        if node.orelse:
            raise NotCompilable("`for ... else`")
        iterable = node.iter
        if isinstance(iterable, ast.Call) and isinstance(iterable.func, ast.Name) and iterable.func.id == "range":
            bounds = [self.expression(a, env) for a in iterable.args]
            if any(isinstance(n, Num) and n.kind == "f" for n in bounds):
                raise NotCompilable(f"`{ast.unparse(iterable)}`: `range` of a float")
            if any(isinstance(n, Num) for n in bounds) or len(range(*bounds)) > UNROLL:
                start, stop = bounds if len(bounds) > 1 else (0, bounds[0])
                if len(bounds) > 2 or not isinstance(node.target, ast.Name):
                    raise NotCompilable("a loop over a long range has the form `for i in range(start, stop)`")
                counter = f"<{node.target.id} of line {node.lineno}>"
                env[counter] = start
                first = ast.copy_location(ast.Assign([node.target], ast.Name(counter, ast.Load())), node)

                def advance(variables: Env) -> None:
                    variables[counter] = variables[counter] + 1

                return self.loop(lambda variables: variables[counter] < stop, advance, [first, *node.body], env, (counter,))
            items = iter(range(*bounds))
        else:
            items = iter(self.expression(iterable, env))

        def turn(value: Any) -> Callable[[Env], None]:
            return lambda variables: self.assign(node.target, value, variables)

        return self.written_out([turn(item) for item in items], node.body, env)

    # -------------------------------------------------------------- expressions

    def expression(self, node: ast.expr, env: Env) -> Any:
        match node:
            case ast.Constant():
                return node.value
            case ast.Name(id=name):
                value = env[name] if name in env else self.frames[-1].source.outer(name)
                if isinstance(value, Undefined):
                    raise NotCompilable(f"`{name}` has no one value here: {value.reason}")
                return value
            case ast.Attribute():
                return self.attribute(self.expression(node.value, env), node.attr)
            case ast.BinOp():
                return self.operate(node, self.expression(node.left, env), self.expression(node.right, env))
            case ast.UnaryOp(op=ast.Not()):
                return self.emitter.negation(self.truth(self.expression(node.operand, env)))
            case ast.UnaryOp():
                return self.operate(node, self.expression(node.operand, env))
            case ast.BoolOp():
                return self.boolean(node, env)
            case ast.Compare():
                return self.comparison(node, env)
            case ast.IfExp():
                return self.choice(node, env)
            case ast.Subscript():
                return self.item(self.expression(node.value, env), self.expression(node.slice, env))
            case ast.Slice():
                return slice(*(self.expression(x, env) if x else None for x in (node.lower, node.upper, node.step)))
            case ast.Call():
                function = self.expression(node.func, env)
                options = {k.arg: self.expression(k.value, env) for k in node.keywords if k.arg}
                if len(options) < len(node.keywords):
                    raise NotCompilable("`**options` in a formula")
                return self.call(function, *self.items(node.args, env), **options)
            case ast.Tuple():
                return tuple(self.items(node.elts, env))
            case ast.List():
                return self.items(node.elts, env)
            case ast.ListComp() | ast.GeneratorExp():
                return list(self.comprehension(node.elt, node.generators, env))
            case ast.JoinedStr():
                return "".join(self.expression(part, env) for part in node.values)
            case ast.FormattedValue():
                value = self.expression(node.value, env)
                if _holds_number(value):
                    raise NotCompilable("a text of numbers known only at run time (`raise` may have one)")
                if node.conversion != -1:
                    value = getattr(builtins, {"s": "str", "r": "repr", "a": "ascii"}[chr(node.conversion)])(value)
                return format(value, self.expression(node.format_spec, env) if node.format_spec else "")
        raise NotCompilable(f"`{ast.unparse(node)}`: this expression has no place in a formula")

    def operate(self, node: Any, *operands: Any) -> Any:
        """An operator applied to numbers, vectors, whatever."""
        operator_ = _OPERATORS.get(type(node.op))
        if operator_ is None or (isinstance(node.op, (ast.FloorDiv, ast.Mod)) and _holds_number(operands)):
            raise NotCompilable(f"`{ast.unparse(node)}`: this operator is not known to native code")
        return operator_(*operands)

    def items(self, nodes: list[ast.expr], env: Env) -> list[Any]:
        found: list[Any] = []
        for n in nodes:
            found += list(self.expression(n.value, env)) if isinstance(n, ast.Starred) else [self.expression(n, env)]
        return found

    def comprehension(self, element: ast.expr, generators: list[ast.comprehension], env: Env) -> Iterator[Any]:
        if not generators:
            yield self.expression(element, env)
            return
        first, *rest = generators
        for item in self.expression(first.iter, env):
            own = {n.id for n in ast.walk(first.target) if isinstance(n, ast.Name)}
            inner = {name: value for name, value in env.items() if name not in own}
            self.assign(first.target, item, inner)
            tests = [self.truth(self.expression(test, inner)) for test in first.ifs]
            if any(isinstance(t, Num) for t in tests):
                raise NotCompilable("a comprehension whose length depends on run-time numbers")
            if all(tests):
                yield from self.comprehension(element, rest, inner)

    def attribute(self, value: Any, name: str) -> Any:
        if isinstance(value, Num):
            raise NotCompilable(f"a number has no attribute `{name}`")
        owner, classes = value, type(value).__mro__
        if isinstance(value, super):
            owner, after = value.__self__, value.__thisclass__  # type: ignore[attr-defined]
            classes = type(owner).__mro__[type(owner).__mro__.index(after) + 1 :]
        if isinstance(owner, Record):
            member = next((vars(c)[name] for c in classes if name in vars(c)), None)
            if isinstance(member, property) and member.fget is not None:
                return self.call(member.fget, owner)
        return getattr(value, name)

    def item(self, value: Any, index: Any) -> Any:
        if isinstance(index, tuple) and isinstance(value, Mat):
            return self.item(self.item(value, index[0]), index[1])
        if not isinstance(index, Num):
            return value[index]
        if index.kind == "f":
            raise NotCompilable("a float is used as an index")
        result, *others = value  # an index known at run time: pick by comparison
        for i, other in enumerate(others, 1):
            result = self.where((index == i) | (index == i - len(others) - 1), other, result)
        return result

    def boolean(self, node: ast.BoolOp, env: Env) -> Any:
        """`a and b`, `a or b`: the operand that decides.  The second is computed in any case if that needs no control flow."""
        first, *others = node.values
        value, either = self.expression(first, env), isinstance(node.op, ast.Or)
        test = self.truth(value)
        rest = ast.copy_location(ast.BoolOp(node.op, others), node) if len(others) > 1 else others[0]
        if not isinstance(test, Num):
            return value if test is either else self.expression(rest, env)
        forget, block = self.mark(), self.builder.block
        other = self.expression(rest, env)
        if self.builder.block is block:
            if all(isinstance(x, bool) or (isinstance(x, Num) and x.kind == "b") for x in (value, other)):
                return self.emitter.logic("or_" if either else "and_", test, other)
            return self.where(test, value, other) if either else self.where(test, other, value)
        forget()
        known = ast.Name("<first>", ast.Load())
        choice = ast.IfExp(known, known, rest) if either else ast.IfExp(known, rest, known)
        return self.choice(ast.copy_location(choice, node), env | {"<first>": value})

    def comparison(self, node: ast.Compare, env: Env) -> Any:
        result: Any = True
        left = self.expression(node.left, env)
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            right = self.expression(right_node, env)
            result = self.emitter.logic("and_", result, self.truth(_OPERATORS[type(op)](left, right)))
            left = right
        return result

    def choice(self, node: ast.IfExp, env: Env) -> Any:
        """`a if c else b`, by the same rules as the statement."""
        test = self.truth(self.expression(node.test, env))
        if not isinstance(test, Num):
            return self.expression(node.body if test else node.orelse, env)
        name = "<choice>"
        inner = dict(env)
        bodies = [[ast.copy_location(ast.Assign([ast.Name(name, ast.Store())], x), x)] for x in (node.body, node.orelse)]
        self.branch(test, bodies[0], bodies[1], inner)  # type: ignore[arg-type]
        self.frames[-1].env = env
        if isinstance(inner[name], Undefined):
            raise NotCompilable(f"`{ast.unparse(node)}`: {inner[name].reason}")
        return inner[name]


def _type(value: Any) -> type:
    return {"f": float, "i": int, "b": bool}[value.kind] if isinstance(value, Num) else type(value)


def _holds_number(value: Any) -> bool:
    """Is a run-time number among these things?"""
    return isinstance(value, Num) or (isinstance(value, (tuple, list, Mat)) and any(map(_holds_number, value)))


def _holds(value: Any, items: list[Any]) -> bool:
    return value is items or (isinstance(value, (tuple, list)) and any(_holds(v, items) for v in value))


def _isinstance(value: Any, kind: Any) -> bool:
    if isinstance(value, Num):
        return {"f": float, "i": int, "b": bool}[value.kind] in (kind if isinstance(kind, tuple) else (kind,))
    return isinstance(value, kind)


def _leaves(body: list[ast.stmt]) -> bool:
    """Does control never come to the end of these statements?"""
    last = body[-1]
    if isinstance(last, ast.If) and last.orelse:
        return _leaves(last.body) and _leaves(last.orelse)
    return isinstance(last, (ast.Return, ast.Break, ast.Continue, ast.Raise))


def _arguments(function: types.FunctionType, args: tuple[Any, ...], options: dict[str, Any]) -> Env:
    bound = inspect.signature(function, follow_wrapped=False).bind(*args, **options)
    bound.apply_defaults()
    return dict(bound.arguments)
