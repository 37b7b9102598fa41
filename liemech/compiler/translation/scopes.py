"""Scopes: which variables a function of a formula has, which it sees, and how a call fills its
parameters.

Names mean what they mean in Python.  A nested function sees the variables of the function around
it, not their values at its birth.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import inspect
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ...errors import NotCompilable
from ...formulas.classes.frozen import frozen
from .source import Source

if TYPE_CHECKING:
    from .joins import Loop, Open

Env = dict[str, Any]
FOUND, HAS_FOUND = "<found in the loop>", "<a loop has ended by return>"
"""The value of a `return` inside of a loop of the run, and whether one was met."""
RETURN = "<return>"  # the variable of what lanes that have left the call return

Function = ast.FunctionDef | ast.Lambda
Comprehension = ast.ListComp | ast.GeneratorExp
CHANGES = ("append", "extend")
"""Methods that change a list: assignments to its name, in a formula."""


@functools.cache
def has(name: str) -> str:
    """The flag that says whether a variable, which gets a value on some ways only, has one here."""
    return f"<has {name}>"


class Undefined:
    """A variable without a value at this point, and why."""

    def __init__(self, reason: str) -> None:
        self.reason = reason


@dataclasses.dataclass(eq=False)
class CallFrame:
    """The frame of a call, or of a comprehension: its variables.  around : the frame of the enclosing function."""

    source: Source
    scope: Function | Comprehension
    env: Env
    around: CallFrame | None = None
    returns: list[Open] = dataclasses.field(default_factory=list)
    loops: list[Loop] = dataclasses.field(default_factory=list)
    node: ast.AST | None = None  # the statement being translated

    def value(self, name: str) -> tuple[Any, Any]:
        """The value of a name, a local, enclosing, global or built-in one, and the condition under which it has a value."""
        frame: CallFrame | None = self
        while frame is not None:
            if name in frame.env:
                value = frame.env[name]
                if isinstance(value, Undefined):
                    raise NotCompilable(f"`{name}` has no one value here: {value.reason}")
                return value, frame.env.get(has(name), True)
            if name in local_names(frame.scope):
                raise NotCompilable(f"`{name}` may have no value here: give it one on every way to this line")
            frame = frame.around
        return self.source.outer(name), True

    def captured(self, env: Env) -> Env:
        """The variables that nested functions may read after this one has returned."""
        names = captured_names(self.scope)
        return {name: env[name] for name in (*names, *map(has, names)) if name in env}


@frozen(eq=False, repr=False)
class Closure:
    """A function inside a formula: a `lambda` or a `def`, and the frame whose variables it sees."""

    frame: CallFrame
    node: Function
    defaults: tuple[Any, ...]
    options: dict[str, Any]  # of parameters that are given by name only

    def __repr__(self) -> str:
        return f"the inner function `{self.name}`"

    @property
    def name(self) -> str:
        return self.node.name if isinstance(self.node, ast.FunctionDef) else "lambda"

    def arguments(self, args: tuple[Any, ...], options: dict[str, Any]) -> Env:
        """The parameters of a call, by Python's rules."""
        a = self.node.args
        places = [*a.posonlyargs, *a.args]
        without = len(places) - len(self.defaults)
        P, none = inspect.Parameter, inspect.Parameter.empty
        parameters = [
            P(p.arg, P.POSITIONAL_ONLY if i < len(a.posonlyargs) else P.POSITIONAL_OR_KEYWORD,
              default=none if i < without else self.defaults[i - without])
            for i, p in enumerate(places)
        ]  # fmt: skip
        if a.vararg:
            parameters.append(P(a.vararg.arg, P.VAR_POSITIONAL))
        parameters += [P(p.arg, P.KEYWORD_ONLY, default=self.options.get(p.arg, none)) for p in a.kwonlyargs]
        if a.kwarg:
            raise NotCompilable(f"`**{a.kwarg.arg}` among the parameters of `{self.name}`")
        return bound(inspect.Signature(parameters), self.name, args, options)


def bound(signature: inspect.Signature, name: str, args: tuple[Any, ...], options: dict[str, Any]) -> Env:
    """The parameters of a call with their values."""
    try:
        filled = signature.bind(*args, **options)
    except TypeError as error:
        raise NotCompilable(f"{name}{signature} is called with other arguments: {error}") from None
    filled.apply_defaults()
    return dict(filled.arguments)


# ------------------------------------------------------------------ names


@functools.cache
def local_names(node: Function | Comprehension) -> frozenset[str]:
    """The variables of a function or a comprehension: what it assigns, and its parameters."""
    if isinstance(node, Comprehension):
        return frozenset(n.id for g in node.generators for n in ast.walk(g.target) if isinstance(n, ast.Name))
    a = node.args
    parameters = [*a.posonlyargs, *a.args, *a.kwonlyargs, *filter(None, (a.vararg, a.kwarg))]
    return frozenset(p.arg for p in parameters) | frozenset(stored_names(_body(node)))


@functools.cache
def captured_names(node: Function | Comprehension) -> frozenset[str]:
    """The variables of a function that functions nested in it read."""
    inner = [n for n in ast.walk(node) if isinstance(n, Function) and n is not node]
    read = {n.id for f in inner for n in ast.walk(f) if isinstance(n, ast.Name)}
    return local_names(node) & read


def stored_names(body: list[Any]) -> set[str]:
    """The names that these statements assign in their own scope."""
    names: set[str] = set()
    for n in _of_scope(body):
        match n:
            case (
                ast.Name(id=name, ctx=ast.Store() | ast.Del())
                | ast.FunctionDef(name=name)
                | ast.ClassDef(name=name)
                | ast.ExceptHandler(name=str(name))
                | ast.MatchAs(name=str(name))
                | ast.MatchStar(name=str(name))
                | ast.MatchMapping(rest=str(name))
            ):
                names.add(name)
            case ast.alias():
                names.add((n.asname or n.name).partition(".")[0])
    return names


@functools.cache
def acts_unexecuted(node: Function) -> ast.AST | None:
    """The first yield, global or nonlocal, which counts even if control never comes to it."""
    kinds = ast.Global, ast.Nonlocal, ast.Yield, ast.YieldFrom, ast.Await
    return next((n for n in _of_scope(_body(node)) if isinstance(n, kinds)), None)


def changed_names(body: list[Any]) -> set[str]:
    """The names whose values these statements may change: by assignment, or in place."""
    names = stored_names(body)
    for n in _of_scope(body):
        match n:
            case ast.Subscript(value=ast.Name(id=name), ctx=ast.Store()):
                names.add(name)
            case ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr=method)) if method in CHANGES:
                names.add(name)
    return names


def changes_lists(body: list[Any], env: Env) -> bool:
    """Whether these statements change a list in place, where the variables have these values."""
    for n in _of_scope(body):
        match n:
            case ast.Subscript(ctx=ast.Store()):
                return True
            case ast.Call(func=ast.Attribute(attr=method)) if method in CHANGES:
                return True
            case ast.AugAssign(target=ast.Name(id=name)) if isinstance(env.get(name), list):
                return True
    return False


def returns(body: list[ast.stmt]) -> bool:
    """Whether these statements leave the function."""
    return any(isinstance(n, ast.Return) for n in _of_scope(body))


def breaks(body: list[ast.stmt]) -> bool:
    """Whether these statements leave the loop around them."""
    inner = [n for n in _of_scope(body) if isinstance(n, (ast.For, ast.While))]
    of_inner = {id(n) for loop in inner for n in _of_scope(loop.body)}
    return any(isinstance(n, ast.Break) and id(n) not in of_inner for n in _of_scope(body))


def _body(node: Function) -> list[Any]:
    return node.body if isinstance(node, ast.FunctionDef) else [node.body]


def _of_scope(nodes: list[Any]) -> Iterator[ast.AST]:
    """The nodes and those inside them, but not what is in the scope of a nested function or comprehension."""
    for node in nodes:
        yield node
        if isinstance(node, Function):  # its defaults are evaluated outside
            yield from _of_scope([*node.args.defaults, *filter(None, node.args.kw_defaults)])
        elif isinstance(node, (ast.ListComp, ast.GeneratorExp, ast.SetComp, ast.DictComp)):
            yield from _of_scope([node.generators[0].iter])
            for n in ast.walk(node):  # `:=` assigns outside of the comprehension
                if isinstance(n, ast.NamedExpr):
                    yield n.target
        else:
            yield from _of_scope(list(ast.iter_child_nodes(node)))
