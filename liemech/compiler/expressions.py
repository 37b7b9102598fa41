"""Expressions of formulas: what Python knows now it computes now, the rest becomes instructions."""

from __future__ import annotations

import ast
import builtins
import dataclasses
import operator
from collections.abc import Callable, Iterator
from typing import Any

from ..errors import NotCompilable
from ..formulas.vectors import Mat
from .ir_numbers import Num
from .joins import LEFT, LIVE, Env, Undefined
from .loops import Loops
from .source import Source

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


@dataclasses.dataclass(frozen=True, eq=False)
class Closure:
    """A lambda inside a formula, with the variables it can see."""

    source: Source
    node: ast.Lambda
    env: Env


class Expressions(Loops):
    """The value of an expression, given the variables."""

    def call(self, function: Any, *args: Any, **options: Any) -> Any:
        raise NotImplementedError

    def assign(self, target: ast.expr, value: Any, env: Env) -> None:
        raise NotImplementedError

    def truth(self, value: Any) -> Any:
        if isinstance(value, Num):
            return value if value.kind == "b" else value != 0
        if hasattr(type(value), "__bool__") or hasattr(type(value), "__len__"):
            self.reads.settled(value)
        return bool(value)

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        condition = self.truth(condition)
        if isinstance(condition, bool):
            return yes if condition else no
        result = self.blend(condition, yes, no)
        if isinstance(result, Undefined):
            raise NotCompilable(f"`where`: {result.reason}")
        return result

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
            case ast.Lambda():
                return Closure(self.frames[-1].source, node, {k: v for k, v in env.items() if k not in (LIVE, *LEFT)})
            case ast.ListComp() | ast.GeneratorExp():
                return list(self.comprehension(node.elt, node.generators, env))
            case ast.JoinedStr():
                return "".join(self.expression(part, env) for part in node.values)
            case ast.FormattedValue():
                value = self.expression(node.value, env)
                if holds_number(value):
                    raise NotCompilable("a text of numbers known only at run time (`raise` may have one)")
                if node.conversion != -1:
                    value = getattr(builtins, {"s": "str", "r": "repr", "a": "ascii"}[chr(node.conversion)])(value)
                return format(value, self.expression(node.format_spec, env) if node.format_spec else "")
        raise NotCompilable(f"`{ast.unparse(node)}`: this expression has no place in a formula")

    def operate(self, node: Any, *operands: Any) -> Any:
        """An operator applied to numbers, vectors, whatever."""
        operator_ = OPERATORS.get(type(node.op))
        if operator_ is None or (isinstance(node.op, (ast.FloorDiv, ast.Mod)) and holds_number(operands)):
            raise NotCompilable(f"`{ast.unparse(node)}`: this operator is not known to native code")
        self.reads.settled(*operands)
        return operator_(*operands)

    def items(self, nodes: list[ast.expr], env: Env) -> list[Any]:
        found: list[Any] = []
        for n in nodes:
            found += self.iterate(self.expression(n.value, env)) if isinstance(n, ast.Starred) else [self.expression(n, env)]
        return found

    def iterate(self, value: Any) -> Iterator[Any]:
        self.reads.settled(value)
        return iter(value)

    def comprehension(self, element: ast.expr, generators: list[ast.comprehension], env: Env) -> Iterator[Any]:
        if not generators:
            yield self.expression(element, env)
            return
        first, *rest = generators
        for item in self.iterate(self.expression(first.iter, env)):
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
        return self.reads.attribute(value, name, self.call)

    def item(self, value: Any, index: Any) -> Any:
        if isinstance(index, tuple) and isinstance(value, Mat):
            return self.item(self.item(value, index[0]), index[1])
        if not isinstance(index, Num):
            self.reads.settled(value)
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
            if not isinstance(op, (ast.Is, ast.IsNot)):
                self.reads.settled(left, right, inside=True)
            result = self.emitter.logic("and_", result, self.truth(OPERATORS[type(op)](left, right)))
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


def holds_number(value: Any) -> bool:
    """Is a run-time number among these things?"""
    return isinstance(value, Num) or (isinstance(value, (tuple, list, Mat)) and any(map(holds_number, value)))
