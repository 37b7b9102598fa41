"""The text of formulas: finding a function's syntax tree, and a fingerprint of all code that can be reached from a value."""

from __future__ import annotations

import ast
import builtins
import contextlib
import dataclasses
import functools
import hashlib
import linecache
import sys
import types
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import NotCompilable
from ..formulas.broadcasting import bare
from ..formulas.pytree import Layout
from ..formulas.records import Record


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
        f, code = self.function, self.function.__code__
        if name in code.co_freevars and f.__closure__:
            return f.__closure__[code.co_freevars.index(name)].cell_contents
        if name in code.co_varnames or name in code.co_cellvars:
            raise NotCompilable(f"`{name}` may have no value here: give it one on every way to this line")
        for names in (f.__globals__, vars(builtins)):
            if name in names:
                return names[name]
        raise NotCompilable(f"the name `{name}` is not defined")


@functools.cache
def source_of(function: types.FunctionType) -> Source:
    """The syntax tree of a function, checked to be the one that Python runs."""
    code = function.__code__
    linecache.checkcache(code.co_filename)
    functions = _functions(code.co_filename, "".join(linecache.getlines(code.co_filename)))
    if not functions or (code.co_name == "<lambda>" and not any(_alike(c, code) for _, c in functions)):
        if code.co_name == "<lambda>":
            raise NotCompilable(f"the lambda in {function.__qualname__} shares its line with another: give it a name")
        raise NotCompilable(f"the source of {function.__qualname__} cannot be read: define it in a file or a notebook")
    same = [n for n, c in functions if _same_code(c, code)]
    if len(same) != 1:
        why = "it is defined twice" if same else f"{code.co_filename} has changed since it was imported"
        raise NotCompilable(f"the source of {function.__qualname__} cannot be told: {why}")
    return Source(function, same[0], code.co_filename)


def _alike(a: types.CodeType, b: types.CodeType) -> bool:
    return (a.co_firstlineno, a.co_name) == (b.co_firstlineno, b.co_name)


def _same_code(a: types.CodeType, b: types.CodeType) -> bool:
    def nested(code: types.CodeType) -> list[Any]:
        return [c for c in code.co_consts if not isinstance(c, types.CodeType)]

    return (a.co_code, a.co_names, a.co_firstlineno, nested(a)) == (b.co_code, b.co_names, b.co_firstlineno, nested(b))


@functools.cache
def _functions(file: str, text: str) -> list[tuple[ast.FunctionDef | ast.Lambda, types.CodeType]]:
    """All functions of a file with this text, and the code that Python makes of them."""
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

BORDER = {"__init__", "__new__", "__post_init__", "__init_subclass__", "__repr__", "__str__", "__eq__", "__hash__", "__reduce__"}
"""Methods that never become native code."""


def fingerprint(*things: Any) -> str:
    """A hash of these functions and layouts and of everything their code can reach: what the disk cache is keyed on.

    It follows names through modules, classes, closures and static values, so that an edit in any file that matters makes
    a new key, and comments, docstrings and line numbers do not.
    """
    digest = hashlib.sha256()
    seen: dict[int, int] = {}
    keep: list[Any] = []  # so that no id is used twice

    def put(*texts: str) -> None:
        for text in texts:  # the length first: no two lists of texts look the same
            digest.update(f"{len(text)}:{text}".encode())

    def eat(x: Any) -> None:
        if x is None or isinstance(x, (bool, int, float, complex, str, bytes)):
            put(type(x).__name__, repr(x))
            return
        if isinstance(x, tuple):
            put(type(x).__name__, str(len(x)))
            for item in x:
                eat(item)
            return
        if id(x) in seen:
            put("seen", str(seen[id(x)]))
            return
        seen[id(x)] = len(seen)
        keep.append(x)
        put(type(x).__qualname__)
        if isinstance(x, functools.cached_property):
            eat(x.func)
        elif _foreign(x):
            put(x.__module__, getattr(x, "__qualname__", ""))
        elif isinstance(x, types.FunctionType):
            function(bare(x))
        elif isinstance(x, types.CodeType):
            code(x, None)
        elif isinstance(x, type):
            class_(x)
        elif isinstance(x, types.MethodType):
            eat((x.__func__, x.__self__))
        elif isinstance(x, property):
            eat(x.fget)
        elif isinstance(x, (staticmethod, classmethod)):
            eat(x.__func__)
        elif isinstance(x, Layout):
            eat((x.kind, x.detail, x.parts))
        elif isinstance(x, Record):  # its fields, not what it may have stored beside them
            eat((type(x), tuple((f.name, getattr(x, f.name)) for f in dataclasses.fields(x))))  # type: ignore[arg-type]
        elif isinstance(x, np.ndarray):
            put(str(x.dtype), str(x.shape), x.tobytes().hex())
        elif isinstance(x, dict):
            eat(tuple(x.items()))
        elif isinstance(x, list):
            eat(tuple(x))
        elif isinstance(x, (set, frozenset)):
            put(*sorted(map(repr, x)))
        elif not isinstance(x, types.ModuleType) and getattr(x, "__dict__", None):
            eat((type(x), vars(x)))
        elif " at 0x" not in repr(x):  # a text with an address tells nothing to the next process
            put(repr(x))

    def class_(cls: type) -> None:
        for base in cls.__mro__:
            put(base.__module__, base.__qualname__)
            if not _foreign(base):
                for name, member in sorted(vars(base).items()):
                    dunder = name.startswith("__") and name.endswith("__")
                    if not dunder or (isinstance(member, types.FunctionType) and name not in BORDER):
                        put(name)
                        eat(member)

    def function(f: types.FunctionType) -> None:
        code(f.__code__, f.__doc__)
        eat((f.__defaults__, f.__kwdefaults__))
        for name, cell in zip(f.__code__.co_freevars, f.__closure__ or (), strict=False):
            put(name)
            with contextlib.suppress(ValueError):  # not filled yet
                eat(cell.cell_contents)
        names = _names(f.__code__)
        for name in names:
            if name in f.__globals__:
                put(name)
                reach(f.__globals__[name], names, set())

    def reach(value: Any, names: list[str], modules: set[int]) -> None:
        """A global; of a module, whatever its code may ask it for."""
        if not isinstance(value, types.ModuleType):
            eat(value)
        elif id(value) not in modules and not _known(value.__name__):
            modules.add(id(value))
            for name in names:
                if hasattr(value, name):
                    put(value.__name__, name)
                    reach(getattr(value, name), names, modules)

    def code(c: types.CodeType, doc: str | None) -> None:
        arguments = c.co_varnames[: c.co_argcount + c.co_kwonlyargcount]
        put(c.co_code.hex())
        eat((c.co_names, arguments, c.co_freevars))
        eat(c.co_consts[1:] if doc is not None and c.co_consts[:1] == (doc,) else c.co_consts)

    eat((sys.implementation.cache_tag, np.__version__, *things))
    return digest.hexdigest()


def _foreign(x: Any) -> bool:
    """Of Python itself or NumPy: known by name and version."""
    module = getattr(x, "__module__", None)
    return isinstance(module, str) and _known(module)


def _known(module: str) -> bool:
    return module.partition(".")[0] in sys.stdlib_module_names | {"numpy"}


def _names(code: types.CodeType) -> list[str]:
    """The names of globals and attributes in a function and those nested in it."""
    inner = [n for c in code.co_consts if isinstance(c, types.CodeType) for n in _names(c)]
    return list(dict.fromkeys([*code.co_names, *inner]))
