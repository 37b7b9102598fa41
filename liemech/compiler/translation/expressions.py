"""Expressions of formulas: what Python knows now it computes now, the rest becomes instructions."""

from __future__ import annotations

import ast
import builtins
import functools
import operator
from collections.abc import Callable, Hashable, Iterator
from typing import Any

import numpy as np

from ...errors import InvalidType, NotCompilable
from ...formulas.numbers.bases import ByValue, is_any_number
from ...formulas.numbers.dual import Dual
from ...formulas.numbers.series import Series
from ...formulas.vectors import Entries, EqualComponents, Mat, UnequalComponents, Vec
from ..changes.content_hashes import looks_itself
from ..changes.dependencies import varies
from ..numbers import arrays, lookups, memory_loops
from ..numbers.arrays import Array
from ..numbers.ir_numbers import Num
from .advice import instead_of_syntax
from .instructions import TooLong
from .iterators import ItemStream
from .loops import Loops
from .scopes import CallFrame, Closure, Env, Function, Undefined
from .state import Snapshot

OPERATORS: dict[type, Callable[..., Any]] = {
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


WORK = 1_000_000
"""Expressions that are translated at most: what is known now makes no instructions, and may never end."""


class Later(ast.expr):
    """An expression whose value is computed when control comes to it, by a function of the translator."""

    def __init__(self, value: Callable[[], Any]) -> None:
        super().__init__()
        self.compute = value


class Expressions(Loops):
    """The value of an expression, given the variables."""

    def call(self, function: Any, *args: Any, **options: Any) -> Any:
        raise NotImplementedError

    def assign(self, target: ast.expr, value: Any, env: Env) -> None:
        raise NotImplementedError

    def truth(self, value: Any) -> Any:
        """The truth of a value, as `if` takes it: a bool, or a truth value of the run."""
        if isinstance(value, Num):
            return value if value.kind == "b" else value != 0
        if isinstance(value, (Dual, Series)):
            return self.truth(value != 0.0)
        if isinstance(value, ByValue):
            return self.truth(value.value)
        if isinstance(value, Array):
            raise arrays.refuse("the truth")
        if isinstance(value, Entries):
            value = value.together
        if isinstance(value, (EqualComponents, UnequalComponents)):
            return self.call(all if isinstance(value, EqualComponents) else any, value)
        if any(self.reads.of_class(value, name) for name in ("__bool__", "__len__")):
            self.reads.settled(value)
        try:
            return bool(value)
        except InvalidType as error:  # of a vector
            raise NotCompilable(str(error)) from None

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        """The value of `formulas.where`, without a branch."""
        if isinstance(condition, (Vec, Mat, Entries)):
            raise NotCompilable(f"where: one condition; got a {type(condition).__name__}")
        condition = self.truth(condition)
        if isinstance(condition, bool):
            return yes if condition else no
        env = self.frames[-1].env if self.frames else {}
        result = self.blended("", condition, (yes, env), (no, env))
        if isinstance(result, Undefined):
            raise NotCompilable(f"`where`: {result.reason}")
        return result

    def expression(self, node: ast.expr, env: Env) -> Any:
        """The value of an expression.  Raises NotCompilable."""
        self.frames[-1].env = env  # what nested functions see
        self.worked += 1
        if self.worked > WORK:
            raise TooLong(
                f"its translation would take too long: more than {WORK} expressions take more than "
                "about ten seconds, even if all are known now. Take fewer turns or calls, compute "
                "constants before the run, or compiled=False"
            )
        match node:
            case ast.Name(id=name):
                value, certain = self.frames[-1].value(name)
                if certain is not True:
                    if not self.state.escapes:
                        raise NotCompilable(f"`{name}` may have no value here: give it one on every way to this line")
                    self.fail_if(self.emitter.negation(certain))
                return value
            case ast.Attribute():
                return self.attribute(self.expression(node.value, env), node.attr)
            case ast.Call():
                function = self.expression(node.func, env)
                if function in (any, all) and len(node.args) == 1 and isinstance(node.args[0], ast.GeneratorExp):
                    return self.some_or_every(function, node.args[0], env)
                args = self.items(node.args, env)
                return self.call(function, *args, **{k.arg: self.expression(k.value, env) for k in _named(node)})
            case ast.BinOp():
                left, right = self.nested_in(node.left, env), self.nested_in(node.right, env)
                return self.operate(node, left, right)
            case ast.Subscript():
                return self.item(self.expression(node.value, env), self.expression(node.slice, env))
            case ast.Constant():
                return node.value
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
            case ast.Slice():
                return slice(*(self.expression(x, env) if x else None for x in (node.lower, node.upper, node.step)))
            case ast.Tuple():
                return tuple(self.items(node.elts, env))
            case ast.List():
                return self.items(node.elts, env)
            case ast.Dict():
                if None in node.keys:
                    raise NotCompilable(f"`{ast.unparse(node)}`: a dict made of others")
                return {
                    self.key(k, env): self.expression(v, env) for k, v in zip(node.keys, node.values, strict=True) if k
                }
            case ast.DictComp():
                pair = ast.copy_location(ast.Tuple([node.key, node.value], ast.Load()), node)
                items = [*self.comprehension(ast.GeneratorExp(pair, node.generators), env)]
                return {self.known_key(key, node): value for key, value in items}
            case ast.Lambda():
                return self.nested(node, env)
            case ast.ListComp():
                return list(self.comprehension(node, env))
            case ast.GeneratorExp():
                return self.stream(self.comprehension(node, env))
            case ast.NamedExpr():
                if not isinstance(self.frames[-1].scope, Function):
                    raise NotCompilable(f"`{ast.unparse(node)}` inside of a comprehension: use a loop")
                value = self.expression(node.value, env)
                self.assign(node.target, value, env)
                return value
            case ast.JoinedStr():
                return "".join(self.expression(part, env) for part in node.values)
            case ast.FormattedValue():
                value = self.expression(node.value, env)
                self.textual(value)
                if node.conversion != -1:
                    value = getattr(builtins, {"s": "str", "r": "repr", "a": "ascii"}[chr(node.conversion)])(value)
                return format(value, self.expression(node.format_spec, env) if node.format_spec else "")
            case Later():
                return node.compute()
        raise NotCompilable(
            f"`{ast.unparse(node)}`: this expression has no place in a formula: {instead_of_syntax(node)}"
        )

    def nested_in(self, node: ast.expr, env: Env) -> Any:
        """The value of an operand; an operator on large arrays inside of another one is deferred, to be computed with it."""
        memory = self.emitter.large
        if memory is None:
            return self.expression(node, env)
        with memory.deferring(isinstance(node, (ast.BinOp, ast.UnaryOp))):
            return self.expression(node, env)

    def operate(self, node: Any, *operands: Any) -> Any:
        """The result of an operator on any operands."""
        operator_ = OPERATORS.get(type(node.op))
        if operator_ is None:
            raise NotCompilable(
                f"`{ast.unparse(node)}`: this operator is not known to native code: write products "
                "and quotients, `not x` for `~x`, `!=` for `^`"
            )
        self.reads.settled(*operands)
        if isinstance(node.op, ast.Mod) and isinstance(operands[0], (str, bytes)):
            self.textual(operands[1])
        try:
            combined = arrays.computed(self.emitter, operator_, operands)
            return memory_loops.matmul(self.emitter, operator_, operands) if combined is None else combined
        except NotCompilable:
            raise
        except TypeError as error:
            raise NotCompilable(f"`{ast.unparse(node)}`: {in_words(error)}") from None

    def textual(self, value: Any) -> None:
        """Raise NotCompilable before a text is made of numbers of the run, or by a `__repr__` of the user's."""
        if varies(value):
            raise NotCompilable("a text of numbers known only at run time (`raise` may have one)")
        self.reads.settled(value, inside=True)
        if looks_itself(value):
            raise NotCompilable(
                f"an object of {type(value).__qualname__} says itself how it looks as a text: name "
                "the text before the run"
            )

    def items(self, nodes: list[ast.expr], env: Env) -> list[Any]:
        """The values of expressions, of which some may be starred."""
        values: list[Any] = []
        for n in nodes:
            values += (
                self.iterate(self.expression(n.value, env)) if isinstance(n, ast.Starred) else [self.expression(n, env)]
            )
        return values

    def key(self, node: ast.expr, env: Env) -> Any:
        return self.known_key(self.expression(node, env), node)

    def known_key(self, key: Any, node: ast.expr) -> Any:
        """A key of a dict.  Raises NotCompilable if the run decides which."""
        if holds_number(key):
            raise NotCompilable(f"`{ast.unparse(node)}`: a key of a dict must be known now")
        return key

    # -------------------------------------------------------------- nested functions and iterators

    def nested(self, node: Function, env: Env) -> Closure:
        """A `lambda` or a `def` inside a formula."""
        a = node.args
        options = {
            p.arg: self.expression(v, env) for p, v in zip(a.kwonlyargs, a.kw_defaults, strict=True) if v is not None
        }
        return Closure(self.frames[-1], node, tuple(self.items(a.defaults, env)), options)

    def within(self, frame: CallFrame, work: Callable[[], Any]) -> Any:
        """The result of some work in a frame that is called from the present one."""
        base, depth = self.state.base, self.state.depth
        if self.frames:
            self.state.base = self.active(self.frames[-1].env)
        self.state.depth = 0
        self.frames.append(frame)
        result = work()
        self.frames.pop()
        self.state.base, self.state.depth = base, depth
        return result

    def comprehension(self, node: ast.ListComp | ast.GeneratorExp, env: Env) -> Iterator[Any]:
        """The items of a comprehension, computed one by one."""
        around = self.frames[-1]
        frame = CallFrame(around.source, node, {}, around, node=around.node)
        first = self.iterate(self.expression(node.generators[0].iter, env))

        def turns(generators: list[ast.comprehension], items: Iterator[Any]) -> Iterator[Any]:
            generator, *nested = generators
            for item in items:
                self.within(frame, lambda: self.assign(generator.target, item, frame.env))  # noqa: B023
                tests = (
                    self.within(frame, lambda: self.truth(self.expression(test, frame.env)))  # noqa: B023
                    for test in generator.ifs
                )
                if not all(map(_known, tests)):
                    continue
                if nested:
                    yield from turns(
                        nested, self.within(frame, lambda: self.iterate(self.expression(nested[0].iter, frame.env)))
                    )
                else:
                    yield self.within(frame, lambda: self.expression(node.elt, frame.env))

        return turns(node.generators, first)

    def some_or_every(self, function: Any, node: ast.GeneratorExp, env: Env) -> Any:
        """`any` and `all` of a generator expression: no item is computed after the one that decides."""
        around, is_any = self.frames[-1], function is any
        frame = CallFrame(around.source, node, {}, around, node=around.node)
        first = self.iterate(self.expression(node.generators[0].iter, env))

        def turns(generators: list[ast.comprehension], items: Iterator[Any]) -> Any:
            generator, *nested = generators

            def turn(item: Any) -> ast.expr:
                def inner() -> Any:
                    if nested:
                        return turns(nested, self.iterate(self.expression(nested[0].iter, frame.env)))
                    return self.truth(self.expression(node.elt, frame.env))

                def value() -> Any:
                    self.assign(generator.target, item, frame.env)
                    tests = generator.ifs if is_any else [ast.UnaryOp(ast.Not(), test) for test in generator.ifs]
                    return self.decided(is_any, [*tests, Later(inner)], frame.env)

                return Later(value)

            return self.decided(not is_any, [turn(item) for item in items], frame.env)

        return self.within(frame, lambda: turns(node.generators, first))

    def decided(self, every: bool, tests: list[ast.expr], env: Env) -> Any:
        """Whether all tests hold, or any; tests behind the one that decides are not computed."""
        if not tests:
            return every
        node = ast.BoolOp(ast.And() if every else ast.Or(), tests) if len(tests) > 1 else tests[0]
        return self.truth(self.expression(node, env))

    def stream(self, items: list[Any] | Iterator[Any], sources: tuple[Any, ...] | None = None) -> ItemStream:
        """A stream over items, made by the formula itself."""
        self.streams.append(ItemStream(items, self.state.region, sources))
        return self.streams[-1]

    def iterate(self, value: Any) -> Iterator[Any]:
        """The items of something that is iterated over."""
        if isinstance(value, ItemStream):
            return self._taken(value)
        if isinstance(value, Num):
            raise NotCompilable("a number is iterated over")
        if not isinstance(value, Array):
            self.reads.settled(value)
        return iter(list(value))

    def _taken(self, stream: ItemStream) -> Iterator[Any]:
        while True:
            try:
                yield stream.take(self.state.region)
            except StopIteration:
                return

    # -------------------------------------------------------------- attributes and items

    def attribute(self, value: Any, name: str) -> Any:
        """The attribute of a value; NotCompilable where native code has none."""
        if isinstance(value, Num):
            raise NotCompilable(f"`{name}` of a number known only at run time: use functions")
        if isinstance(value, (Closure, ItemStream)):
            raise NotCompilable(
                f"`{name}` of {'an inner function' if isinstance(value, Closure) else 'an iterator'}"
                ": leave it out, or define it at the top of the module"
            )
        if isinstance(value, Array):
            if name in ("T", "shape"):
                return arrays.array(getattr(value.entries, name))
            raise arrays.refuse(f"`{name}`")
        if name.startswith("__") and not name.endswith("__"):
            raise NotCompilable(f"`{name}`: a private name with two underscores; use one")
        return self.reads.attribute(value, name, self.call)

    def item(self, value: Any, index: Any) -> Any:
        """The item of a value, by an index known now or in the run."""
        if isinstance(value, Array):
            if not all(isinstance(i, (int, slice, Num)) for i in (index if type(index) is tuple else [index])):
                raise arrays.refuse("this index")
            return arrays.array(self.item(value.entries, index))
        if (
            isinstance(index, tuple)
            and len(index) == 2
            and isinstance(index[0], (int, np.integer, Num))
            and (isinstance(value, Mat) or (isinstance(value, np.ndarray) and holds_number(index)))
        ):
            return self.item(self.item(value, index[0]), index[1])
        if not holds_number(index):
            self.reads.settled(value, index)
            if hasattr(type(value), "__missing__") and index not in value:
                raise NotCompilable(
                    f"`{index!r}` is not in this {type(value).__name__}, which would make an entry: "
                    "use a dict that has it"
                )
            return value[index]
        if not isinstance(index, Num) or index.kind == "f":
            raise NotCompilable(
                "a float, a tuple or a slice known only at run time is used as an index: write "
                "int(x), a[i][j] for a[i, j], a.T[i] for a[:, i]"
            )
        self.reads.settled(value)
        if isinstance(value, dict):
            raise NotCompilable("a key of a dict must be known now: write `if` and `elif`, or a list")
        if index.kind == "b":
            if isinstance(value, np.ndarray):
                raise NotCompilable("a truth value as an index of an array is a mask: write int(x)")
            self.emitter.unless_numpy("a truth value as an index")
        if isinstance(value, np.ndarray):
            self.emitter.meet_numpy()
        entries = _entries(value)
        count = len(entries)
        self.fail_if(self.emitter.negation(self.emitter.logic("and_", index >= -count, index < count)))
        result = lookups.picked(self.emitter, entries, index)
        if result is not None:
            return result
        result, *others = entries  # pick by comparison
        for i, other in enumerate(others, 1):
            result = self.where((index == i) | (index == i - count), other, result)
        return result

    # -------------------------------------------------------------- choices

    def boolean(self, node: ast.BoolOp, env: Env) -> Any:
        """`a and b`, `a or b`: the operand that decides.  The second one is computed in any case, unless that may raise,
        branch or change a variable.
        """
        first = node.values[0]
        value, either = self.expression(first, env), isinstance(node.op, ast.Or)
        test = self.truth(value)
        others = self._others(node)
        if not isinstance(test, Num):
            return value if test is either else self.expression(others, env)
        if others not in self.branching:
            snapshot, block, raises = Snapshot(self, env), self.builder.block, self.state.raises
            other = self.expression(others, env)
            acts = any(isinstance(n, ast.NamedExpr) for n in ast.walk(others)) or any(
                stream.taken != before for stream, before, _ in snapshot.streams
            )
            if self.builder.block is block and self.state.raises == raises and not acts:
                if all(isinstance(x, bool) or (isinstance(x, Num) and x.kind == "b") for x in (value, other)):
                    return self.emitter.logic("or_" if either else "and_", test, other)
                return self.where(test, value, other) if either else self.where(test, other, value)
            snapshot.restore()
            self.branching.add(others)
        decided = Later(lambda: value)
        choice = (
            ast.IfExp(Later(lambda: test), decided, others)
            if either
            else ast.IfExp(Later(lambda: test), others, decided)
        )
        return self.choice(ast.copy_location(choice, node), env)

    def _others(self, node: ast.BoolOp) -> ast.expr:
        """The operands of `and` or `or` after the first, as one node, made once."""
        _, *others = node.values
        if len(others) == 1:
            return others[0]
        remaining = ast.copy_location(ast.BoolOp(node.op, others), node)
        return self.others.setdefault(node, remaining)

    def comparison(self, node: ast.Compare, env: Env) -> Any:
        """`a < b < c` is `a < b and b < c`, with b computed once."""
        left, right = self.expression(node.left, env), self.expression(node.comparators[0], env)
        if isinstance(node.ops[0], (ast.Is, ast.IsNot)):
            first = self.identity(left, right, isinstance(node.ops[0], ast.Is))
        else:
            self.reads.settled(left, right, inside=True)
            if isinstance(left, Array) or isinstance(right, Array):
                raise arrays.refuse(f"`{ast.unparse(node)}`")
            if isinstance(node.ops[0], (ast.In, ast.NotIn)) and (
                holds_number(left) or (is_any_number(left) and holds_number(right))
            ):
                first = self.among(left, right)
                if isinstance(node.ops[0], ast.NotIn):
                    first = self.emitter.negation(first)
            else:
                try:
                    first = OPERATORS[type(node.ops[0])](left, right)
                except NotCompilable:
                    raise
                except TypeError as error:
                    raise NotCompilable(f"`{ast.unparse(node)}`: {in_words(error)}") from None
        if len(node.ops) == 1:
            return first
        remaining = ast.Compare(Later(lambda: right), node.ops[1:], node.comparators[1:])
        return self.boolean(ast.copy_location(ast.BoolOp(ast.And(), [Later(lambda: first), remaining]), node), env)

    def among(self, x: Any, items: Any) -> Any:
        """`x in items`: is it equal to one of them?  (Of nan, identity would decide.)"""
        if isinstance(items, (str, bytes, ItemStream)):
            raise NotCompilable("`in` a text or an iterator, of a number known only at run time")
        if isinstance(items, (set, frozenset, dict)) and not _hashable(x):
            raise NotCompilable("`in` a set or a dict, of what is no key: use a tuple of floats")
        is_among: Any = False
        for item in list(items):
            is_among = self.emitter.logic("or_", is_among, self.equal(x, item))
        return is_among

    def equal(self, x: Any, item: Any) -> Any:
        """Whether a number, or a tuple of some, equals an item.  (Of nan, identity would decide.)"""
        if isinstance(x, tuple) and isinstance(item, tuple):
            if len(x) != len(item):
                return False
            return functools.reduce(
                lambda all_, pair: self.emitter.logic("and_", all_, self.equal(*pair)), zip(x, item, strict=True), True
            )
        for n in (x, item):
            if isinstance(n, Num) and n.kind == "f":
                self.fail_if(n != n)
        equal = x == item
        if not isinstance(equal, (Num, bool)):
            raise NotCompilable(f"`in` items that are {type(item).__name__}")
        return equal

    def identity(self, left: Any, right: Any, same: bool) -> Any:
        """`left is right` or `left is not right`: a truth value of the run is True or False, and no
        number has an identity.
        """
        if isinstance(right, Num):
            left, right = right, left
        if not isinstance(left, Num):
            return self.reads.identical(left, right) is same
        if not isinstance(right, (Num, bool, int, float)):
            return not same
        if left.kind == "b" and isinstance(right, bool):
            self.emitter.unless_numpy("`is` of a truth value")
            return left if right is same else self.emitter.negation(left)
        raise NotCompilable("`is` between numbers: use `==`")

    def choice(self, node: ast.IfExp, env: Env) -> Any:
        """`a if c else b`, by the same rules as the statement."""
        test = self.truth(self.expression(node.test, env))
        if not isinstance(test, Num):
            return self.expression(node.body if test else node.orelse, env)
        name = "<choice>"
        bodies = [
            [ast.copy_location(ast.Assign([ast.Name(name, ast.Store())], x), x)] for x in (node.body, node.orelse)
        ]
        at = self.frames[-1].node
        self.branch(test, bodies[0], bodies[1], env)  # type: ignore[arg-type]
        self.frames[-1].node, self.frames[-1].env = at, env
        value = env.pop(name)
        if isinstance(value, Undefined):
            raise NotCompilable(f"a choice: {value.reason}")
        return value


def _entries(value: Any) -> Any:
    """The items of a sequence; of an array of NumPy's as numbers or vectors."""
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype not in (np.float64, np.int64) or value.ndim > (value.dtype == np.float64) + 1:
        raise NotCompilable(
            f"an array of {value.dtype.name} of {value.ndim} axes is indexed by a number known only "
            "at run time: make it a tuple, or one of floats, of one or two axes"
        )
    return [Vec(*row) if isinstance(row, list) else row for row in value.tolist()]


def _hashable(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_hashable, value))
    return isinstance(value, Hashable)


def _named(node: ast.Call) -> list[Any]:
    """The arguments of a call that are given by name."""
    if any(k.arg is None for k in node.keywords):
        raise NotCompilable(f"`{ast.unparse(node)}`: `**options` in a formula: name them")
    return node.keywords


def _known(test: Any) -> bool:
    """The truth of a test in a comprehension.  Raises NotCompilable if the run decides it."""
    if isinstance(test, Num):
        raise NotCompilable(
            "a comprehension whose length depends on run-time numbers: write a loop, or "
            "`x if condition else 0.0` for its items"
        )
    return bool(test)


def in_words(error: TypeError) -> str:
    """Python's message about operands of which one is a number of the run, and a cure."""
    if isinstance(error, InvalidType):
        return str(error)
    text = str(error).replace("'Num'", "a number known only at run time")
    return (
        f"{text}; native code has floats, integers, liemech.Vec, Mat and formulas.Complex: write "
        "float(x) of other numbers, liemech.vec(*x) of arrays"
    )


def holds_number(value: Any) -> bool:
    """Whether a value, or a part of it, is a number of the run."""
    if isinstance(value, slice):
        return holds_number((value.start, value.stop, value.step))
    if isinstance(value, dict):
        return holds_number([*value.values()])
    return isinstance(value, Num) or (isinstance(value, (tuple, list, Mat)) and any(map(holds_number, value)))
