"""The text of formulas: finding a function's syntax tree, and a fingerprint of all code that can be reached from a value."""

from __future__ import annotations

import ast
import dataclasses
import functools
import hashlib
import inspect
import linecache
import types
from collections.abc import Iterator
from typing import Any

from ..errors import NotCompilable
from .records import Record
from .values import Layout


@dataclasses.dataclass(frozen=True)
class Source:
    """A function with its syntax tree and the names it can see."""

    function: types.FunctionType
    node: ast.FunctionDef | ast.Lambda
    file: str

    @property
    def name(self) -> str:
        return self.function.__qualname__.replace("<locals>.", "")

    def outer(self, name: str) -> Any:
        """The value of a name that is not local: from the enclosing function, the module or Python."""
        if name in self.function.__code__.co_freevars and self.function.__closure__:
            return self.function.__closure__[self.function.__code__.co_freevars.index(name)].cell_contents
        if name in self.function.__globals__:
            return self.function.__globals__[name]
        return self.function.__builtins__[name]  # type: ignore[attr-defined]


@functools.cache
def source_of(function: types.FunctionType) -> Source:
    """The syntax tree of a function, checked to be the one that Python runs."""
    code = function.__code__
    found = [n for n, c in _functions(code.co_filename) if c.co_firstlineno == code.co_firstlineno and c.co_name == code.co_name]
    if not found:
        if code.co_name == "<lambda>":
            raise NotCompilable(f"the lambda in {function.__qualname__} shares its line with another: give it a name")
        raise NotCompilable(f"the source of {function.__qualname__} cannot be read: define it in a file or a notebook")
    same = [n for n, c in _functions(code.co_filename) if _same_code(c, code)]
    if len(same) != 1:
        why = "it is defined twice" if same else f"{code.co_filename} has changed since it was imported"
        raise NotCompilable(f"the source of {function.__qualname__} cannot be told: {why}")
    return Source(function, same[0], code.co_filename)


def _same_code(a: types.CodeType, b: types.CodeType) -> bool:
    def nested(code: types.CodeType) -> list[Any]:
        return [c for c in code.co_consts if not isinstance(c, types.CodeType)]

    return (a.co_code, a.co_names, a.co_firstlineno, nested(a)) == (b.co_code, b.co_names, b.co_firstlineno, nested(b))


@functools.cache
def _functions(file: str) -> list[tuple[ast.FunctionDef | ast.Lambda, types.CodeType]]:
    """All functions of a file, with the code that Python makes of them."""
    text = "".join(linecache.getlines(file))
    if not text:
        return []
    tree = ast.parse(text)
    nodes: dict[tuple[int, str], list[Any]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            nodes.setdefault((first, node.name), []).append(node)
        elif isinstance(node, ast.Lambda):
            nodes.setdefault((node.lineno, "<lambda>"), []).append(node)

    def codes(code: types.CodeType) -> Iterator[types.CodeType]:
        for c in code.co_consts:
            if isinstance(c, types.CodeType):
                yield c
                yield from codes(c)

    pairs = []
    for code in codes(compile(text, file, "exec", dont_inherit=True)):
        candidates = nodes.get((code.co_firstlineno, code.co_name), [])
        if len(candidates) == 1:  # two lambdas on one line cannot be told apart
            pairs.append((candidates[0], code))
    return pairs


# ------------------------------------------------------------------ fingerprints


def fingerprint(*things: Any) -> str:
    """A hash of these functions and layouts and of everything their code can reach: what the disk cache is keyed on.

    It follows names through modules, classes, closures and static values, so that an edit in any file that matters makes
    a new key, and comments and line numbers do not.
    """
    digest = hashlib.sha256()
    seen: set[int] = set()
    keep: list[Any] = []  # so that no id is used twice

    def eat(x: Any) -> None:
        if isinstance(x, (types.FunctionType, type, tuple, list, dict)):
            if id(x) in seen:
                return
            seen.add(id(x))
            keep.append(x)
        if isinstance(x, Layout):
            digest.update(x.kind.encode())
            eat(x.detail)
            for part in x.parts:
                eat(part)
        elif isinstance(x, types.FunctionType):
            eat_function(inspect.unwrap(x))
        elif isinstance(x, types.CodeType):
            digest.update(x.co_code + repr((x.co_names, x.co_varnames[: x.co_argcount])).encode())
            for constant in x.co_consts:
                eat(constant)
        elif isinstance(x, type):
            digest.update(x.__qualname__.encode())
            if issubclass(x, Record):
                for cls in x.__mro__[:-1]:
                    for name, member in sorted(vars(cls).items()):
                        if not name.startswith("__"):
                            digest.update(name.encode())
                            eat(member)
        elif isinstance(x, (property, staticmethod, classmethod)):
            eat(getattr(x, "fget", None) or x.__func__)  # type: ignore[union-attr]
        elif isinstance(x, (tuple, list)):
            for item in x:
                eat(item)
        elif isinstance(x, types.MethodType):
            eat(x.__func__)
            eat(x.__self__)
        elif isinstance(x, Record):
            eat(type(x))
            digest.update(repr(x).encode())
        elif x is None or isinstance(x, (bool, int, float, complex, str, bytes)):
            digest.update(repr(x).encode())
        else:  # an object whose text holds its address is known by its type alone
            text = repr(x)
            digest.update((type(x).__qualname__ + ("" if " at 0x" in text else text)).encode())

    def eat_function(f: types.FunctionType) -> None:
        if f is not keep[-1] and id(f) in seen:
            return
        seen.add(id(f))
        keep.append(f)
        eat(f.__code__)
        eat(f.__defaults__)
        for cell in f.__closure__ or ():
            eat(cell.cell_contents)
        for name in _names(f.__code__):
            if name in f.__globals__:
                value = f.__globals__[name]
                if isinstance(value, types.ModuleType):
                    for attribute in _names(f.__code__):
                        member = getattr(value, attribute, None)
                        if isinstance(member, (types.FunctionType, type, int, float, tuple, Record)):
                            eat(member)
                else:
                    eat(value)

    for thing in things:
        eat(thing)
    return digest.hexdigest()


def _names(code: types.CodeType) -> list[str]:
    inner = [n for c in code.co_consts if isinstance(c, types.CodeType) for n in _names(c)]
    return [*code.co_names, *inner]
