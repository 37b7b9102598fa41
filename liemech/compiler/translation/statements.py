"""Translation of the statements of formulas, one after the other."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from ...errors import NotCompilable
from ..machine.stop_checks import EVERY
from ..numbers.arrays import Array
from ..numbers.ir_numbers import Num
from .advice import instead_of_syntax
from .expressions import OPERATORS, Expressions, Later
from .iterators import ItemStream
from .joins import ACTIVE, NO_LANE, Open, Returns, Retype
from .loops import UNROLL, forms
from .scopes import CHANGES, FOUND, HAS_FOUND, RETURN, Env, breaks, has
from .state import Snapshot


class Statements(Expressions):
    """The translation of statements, which change the variables; False where control never comes behind one."""

    def block(self, statements: list[ast.stmt], env: Env) -> bool:
        """Translate statements; False if control never comes to their end."""
        frame = self.frames[-1]
        for i, node in enumerate(statements):
            frame.node, frame.env = node, env
            following = statements[i + 1 :]
            if isinstance(node, ast.If) and following and not node.orelse and _leaves(node.body):
                test = self.truth(self.expression(node.test, env))
                if isinstance(test, Num):  # what follows runs only where the branch was not taken
                    return self.branch(test, node.body, following, env) and self.running(env)
                if test:
                    return self.block(node.body, env)
                continue
            if not self.statement(node, env):
                return False
            if env.get(ACTIVE) is NO_LANE:
                return self.running(env)
        return True

    def running(self, env: Env) -> bool:
        """False if every lane has left the call, which ends here then: without a value if all have raised."""
        frame = self.frames[-1]
        if env.get(ACTIVE) is not NO_LANE or self.state.depth or frame.loops:
            return True
        returned = {RETURN: env[RETURN]} if RETURN in env else {}
        frame.returns.append(Open(self.builder.block, returned | frame.captured(env)))
        return False

    def statement(self, node: ast.stmt, env: Env) -> bool:
        """Translate one statement; False if control never comes behind it.  Raises NotCompilable."""
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
                self.augmented(node, env)
            case ast.Expr(ast.Call(ast.Attribute(ast.Name(id=name), method), [item], [])) if (
                method in CHANGES and isinstance(env.get(name), list)
            ):
                self.aliases.require_own(env[name], ast.Name(name), env)
                items = self.expression(item, env)
                self.assign(
                    ast.Name(name), [*env[name], *([items] if method == "append" else self.iterate(items))], env
                )
            case ast.Expr():
                self.expression(node.value, env)
            case ast.FunctionDef(name=name, decorator_list=[]):
                self.assign(ast.Name(name), self.nested(node, env), env)
            case ast.Assert():
                failure = ast.If(ast.UnaryOp(ast.Not(), node.test), [ast.copy_location(ast.Raise(), node)], [])
                return self.statement(ast.copy_location(failure, node), env)
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
                raise NotCompilable(
                    f"`{ast.unparse(node).splitlines()[0]}`: this statement has no place in a "
                    f"formula: {instead_of_syntax(node)}"
                )
        return True

    def augmented(self, node: ast.AugAssign, env: Env) -> None:
        """`x += y` and its like; the index of `x[i] += y` is computed once."""
        target = node.target
        if isinstance(target, ast.Subscript):
            index = self.expression(target.slice, env)
            target = ast.Subscript(target.value, Later(lambda: index), ast.Store())
        old = self.expression(target, env)
        if isinstance(old, list):
            self.aliases.require_own(old, target, env)
        elif _changes_in_place(np.ndarray if isinstance(old, Array) else type(old), node.op):
            kind = "ndarray" if isinstance(old, Array) else type(old).__name__
            raise NotCompilable(
                f"`{ast.unparse(node)}` changes an object of {kind} in place, under "
                "all of its names: write `x = x + ...`"
            )
        self.assign(target, self.operate(node, old, self.expression(node.value, env)), env)

    def assign(self, target: ast.expr, value: Any, env: Env) -> None:
        """Give a name, names or an item of a list a value, in the lanes that run."""
        match target:
            case ast.Name(id=name):
                # lanes that have left keep what they had
                if isinstance(env.get(ACTIVE), Num) and name in env:
                    value = self.blended(name, env[ACTIVE], (value, env), (env[name], env))
                env[name] = value
                if has(name) in env:
                    env[has(name)] = True
            case ast.Tuple(elts=targets) | ast.List(elts=targets):
                items = list(self.iterate(value))
                star = next((i for i, t in enumerate(targets) if isinstance(t, ast.Starred)), None)
                if star is not None and len(items) >= len(targets) - 1:
                    end = len(items) - (len(targets) - 1 - star)
                    items[star:end] = [items[star:end]]
                    targets = [t.value if isinstance(t, ast.Starred) else t for t in targets]
                if len(items) != len(targets):
                    raise NotCompilable(f"{len(items)} values are assigned to {len(targets)} names")
                for t, v in zip(targets, items, strict=True):
                    self.assign(t, v, env)
            case ast.Subscript(value=ast.Name(id=name)) if type(env.get(name)) is dict:
                self.aliases.require_own(env[name], target.value, env)
                self.assign(target.value, {**env[name], self.key(target.slice, env): value}, env)
            case ast.Subscript(value=ast.Name(id=name)) if isinstance(env.get(name), list):
                self.aliases.require_own(env[name], target.value, env)
                changed, index = list(env[name]), self.expression(target.slice, env)
                if isinstance(index, Num) and index.kind != "f":
                    places = range(len(changed))
                    self.item(list(places), index)  # which fails outside of the list
                    changed = [
                        self.where((index == i) | (index == i - len(changed)), value, changed[i]) for i in places
                    ]
                else:
                    changed[index] = list(self.iterate(value)) if isinstance(index, slice) else value
                self.assign(target.value, changed, env)
            case _:
                raise NotCompilable(
                    f"`{ast.unparse(target)} = ...`: formulas do not change objects in place; make "
                    "a new one, of a record by dataclasses.replace; instead of an array fill a list, "
                    "`out = [0.0] * n`, and return liemech.vec(*out)"
                )

    def returned(self, value: Any, env: Env) -> bool:
        """Translate `return`; False if control never comes behind it."""
        frame = self.frames[-1]
        if any(loop.dynamic for loop in frame.loops):
            if sum(loop.dynamic for loop in frame.loops) > 1 or not frame.loops[-1].dynamic:
                raise NotCompilable(
                    "`return` inside two loops, of which one is of unknown length: set a "
                    "variable, `break`, and return after it"
                )
            if FOUND not in env:
                raise Returns(self.zeros(value))
            self.assign(ast.Name(FOUND), value, env)
            self.assign(ast.Name(HAS_FOUND), True, env)
            return self.leave(frame.loops[-1], "break", env)
        if RETURN in env:
            mask = self.everyone(self.active(env))
            value = self.blended(RETURN, mask, (value, env), (env[RETURN], env))
        if self.state.depth == 0:
            frame.returns.append(Open(self.builder.block, {RETURN: value} | frame.captured(env)))
            return False
        env[RETURN], env[ACTIVE] = value, NO_LANE
        return True

    def raised(self, env: Env) -> bool:
        """Translate `raise`: mark the step as failed.  Plain Python, run on it again, raises the error."""
        b, mask = self.builder, self.active(env)
        if self.state.failed is None:
            raise NotCompilable("`raise` outside an attempted step")
        self.state.raises += 1
        e = self.emitter
        e.store(True if mask is None else e.logic("or_", e.load(self.state.failed), mask), self.state.failed)
        if self.state.depth == 0 and mask is None:
            self.state.escapes[-1].append(Open(b.block, {}))
            return False
        loops = self.frames[-1].loops
        if loops and loops[-1].dynamic and loops[-1].masked:
            return self.leave(loops[-1], "break", env)
        env[ACTIVE] = NO_LANE
        return True

    def while_loop(self, node: ast.While, env: Env) -> bool:
        if node.orelse:
            return self.with_else(node, env)

        def test(variables: Env) -> Any:
            return self.truth(self.expression(node.test, variables))

        def turn(variables: Env) -> Any:
            value = test(variables)
            if isinstance(value, Num):
                raise Retype(None)
            return value

        def too_many(variables: Env) -> Any:
            raise Retype(UNROLL)

        form = node, forms(env)
        if not isinstance(node.test, ast.Constant) and form not in self.lasting:
            snapshot = Snapshot(self, env)
            try:
                return self.written_out([*[turn] * UNROLL, too_many], node.body, env)
            except Retype as wanted:
                snapshot.restore()
                if wanted.number is None:
                    self.lasting.add(form)
        inside = FOUND in env
        self.loop(test, lambda variables: None, node.body, env)
        endless = isinstance(node.test, ast.Constant) and not breaks(node.body)
        return inside or self.after(env, endless)

    def after(self, env: Env, always: bool = False) -> bool:
        """Translate what follows a native loop: return the value of a `return` in it, in lanes that came to one.
        always : the loop has no other way out.
        """
        if FOUND not in env:
            return True
        returned, left = env.pop(FOUND), env.pop(HAS_FOUND)
        value = ast.Return(Later(lambda: returned))
        if always:
            return self.statement(value, env)
        return self.statement(ast.If(Later(lambda: left), [value], []), env)

    def for_loop(self, node: ast.For, env: Env) -> bool:
        if node.orelse:
            return self.with_else(node, env)
        iterable = node.iter
        if (
            isinstance(iterable, ast.Call)
            and isinstance(iterable.func, ast.Name)
            and not iterable.keywords
            and self.expression(iterable.func, env) is range
        ):
            bounds = self.items(iterable.args, env)
            if any(isinstance(n, Num) and n.kind == "f" for n in bounds):
                raise NotCompilable(f"`{ast.unparse(iterable)}`: `range` of a float")
            if any(isinstance(n, Num) for n in bounds) or len(range(*bounds)) > UNROLL:
                return self.long_range(node, bounds, env)
            items: Any = range(*bounds)
        else:
            items = self.expression(iterable, env)
        name = f"<items of line {node.lineno}>"  # a list among them must not be changed in the loop
        if isinstance(items, (list, ItemStream)):
            env[name] = items

        def turn(value: Any) -> Callable[[Env], None]:
            return lambda variables: self.assign(node.target, value, variables)

        going_on = self.written_out(map(turn, self.iterate(items)), node.body, env)
        env.pop(name, None)
        return going_on

    def long_range(self, node: ast.For, bounds: list[Any], env: Env) -> bool:
        """A loop over a range that is long, or whose length is known at run time only."""
        start, stop, step = (0, *bounds, 1) if len(bounds) == 1 else (*bounds, 1)[:3]
        if not isinstance(node.target, ast.Name) or not isinstance(step, int) or step == 0:
            raise NotCompilable(
                "a loop over a long range has the form `for i in range(start, stop, step)`, the "
                "step an integer known before the run and not 0"
            )
        counter = f"<{node.target.id} of line {node.lineno}>"
        item: ast.expr = ast.Name(counter, ast.Load())
        if step == 1:
            env[counter] = start
        else:  # the turns are counted
            name = Later(lambda: start)
            item = ast.BinOp(name, ast.Add(), ast.BinOp(ast.Constant(step), ast.Mult(), item))
            turns = stop - start + step - (1 if step > 0 else -1)
            env[counter], stop = 0, turns // step
        first = ast.copy_location(ast.Assign([node.target], item), node)

        def advance(variables: Env) -> None:
            variables[counter] = self.emitter.successor(variables[counter])

        inside = FOUND in env  # of a loop around this one
        self.loop(
            lambda variables: variables[counter] < stop,
            advance,
            [first, *node.body],
            env,
            (counter,),
            brief=isinstance(start, int) and isinstance(stop, int) and stop - start <= EVERY,
        )
        return inside or self.after(env)

    def with_else(self, node: ast.For | ast.While, env: Env) -> bool:
        """Translate a loop with `else`, a block that runs unless `break` left the loop."""
        broken = f"<left the loop of line {node.lineno}>"
        body = [_Breaks(broken).visit(copy.deepcopy(statement)) for statement in node.body]
        loop = ast.copy_location(type(node)(**{**dict(ast.iter_fields(node)), "body": body, "orelse": []}), node)
        otherwise = ast.If(ast.UnaryOp(ast.Not(), ast.Name(broken, ast.Load())), node.orelse, [])
        env[broken] = False
        return self.block([loop, ast.copy_location(otherwise, node)], env)


class _Breaks(ast.NodeTransformer):
    """Puts an assignment before every `break` of a loop."""

    def __init__(self, name: str) -> None:
        self.name = name

    def visit_Break(self, node: ast.Break) -> Any:
        return [ast.copy_location(ast.Assign([ast.Name(self.name, ast.Store())], ast.Constant(True)), node), node]

    def visit_For(self, node: Any) -> Any:
        node.orelse = [line for statement in node.orelse for line in _lines(self.visit(statement))]
        return node  # its own breaks are its own

    visit_While = visit_For

    def visit_FunctionDef(self, node: Any) -> Any:
        return node


def _changes_in_place(cls: type, operator: ast.operator) -> bool:
    """Whether a class defines the in-place operator, such as `__iadd__` for `x += y`."""
    name = getattr(OPERATORS.get(type(operator)), "__name__", "").strip("_")
    return hasattr(cls, f"__i{name}__")


def _lines(body: Any) -> list[Any]:
    return body if isinstance(body, list) else [body]


def _leaves(body: list[ast.stmt]) -> bool:
    """Whether control never comes to the end of these statements."""
    last = body[-1]
    if isinstance(last, ast.If) and last.orelse:
        return _leaves(last.body) and _leaves(last.orelse)
    return isinstance(last, (ast.Return, ast.Break, ast.Continue, ast.Raise))
