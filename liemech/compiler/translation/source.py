"""The text of formulas: the syntax tree of a function, checked to be that of the code which Python runs."""

from __future__ import annotations
import __future__

import ast
import functools
import linecache
import types
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ...errors import NotCompilable
from ..changes.content_hashes import code_token, names

if TYPE_CHECKING:
    from ..changes.dependencies import Reads


class Source:
    """A function with its syntax tree and the names it can see."""

    def __init__(self, function: types.FunctionType, reads: Reads) -> None:
        self.function, self.reads = function, reads
        self.node, self.file = _syntax_tree(function.__code__), function.__code__.co_filename

    @property
    def name(self) -> str:
        return self.function.__qualname__.replace("<locals>.", "")

    def outer(self, name: str) -> Any:
        """The value of a name that is not local: from the enclosing function, the module or Python."""
        code = self.function.__code__
        if name in code.co_varnames or (name in code.co_cellvars and name not in code.co_freevars):
            raise NotCompilable(f"`{name}` may have no value here: give it one on every way to this line")
        if name not in (*names(code), *code.co_freevars):
            raise NotCompilable(f"`{name}`: in a class Python gives private names with two underscores others; use one")
        return self.reads.outer(self.function, name)


@functools.lru_cache(4096)
def _syntax_tree(code: types.CodeType) -> ast.FunctionDef | ast.Lambda:
    """The syntax tree of a function; functions with one code have one meaning, and may share it."""
    file, name = code.co_filename, code.co_qualname
    linecache.checkcache(file)
    lines = linecache.getlines(file)
    alone = _from_its_lines(code, lines)
    if alone is not None:
        return alone
    text = "".join(lines)
    if not text:
        raise NotCompilable(f"the source of {name} cannot be read: define it in a file or a notebook")
    candidates = [
        (n, c) for n, c in _functions(file, text) if c.co_name == code.co_name and code_token(c) == code_token(code)
    ]
    if not candidates:
        raise NotCompilable(f"the source of {name} cannot be told: {file} has changed since it was imported")
    return min(candidates, key=lambda pair: abs(pair[1].co_firstlineno - code.co_firstlineno))[0]


def _from_its_lines(code: types.CodeType, lines: list[str]) -> ast.FunctionDef | None:
    """The syntax tree of a function of a module or of a class there, from its own lines: parsing all
    of its file would take longer than the translation of a small formula.  None if it must be.
    """
    *around, name = code.co_qualname.split(".")
    first = last = code.co_firstlineno - 1
    if len(around) > 1 or not name.isidentifier() or not first < len(lines):
        return None
    margin = _margin(lines[first])
    last = max([last + 1, *(end for _, end, *_ in code.co_positions() if end)])
    while last < len(lines) and (not lines[last].strip() or _margin(lines[last]) > margin):
        last += 1
    head = [f"class {around[0]}:\n" if around else "if True:\n"] if margin else []
    text = "".join(["\n" * (first - len(head)), *head, *lines[first:last]])
    try:
        flags = code.co_flags & __future__.annotations.compiler_flag
        module = compile(text, code.co_filename, "exec", flags, dont_inherit=True)
        nodes = ast.walk(ast.parse(text))
    except SyntaxError:
        return None
    place = code.co_name, code.co_firstlineno
    codes = [c for c in _nested(module) if (c.co_name, c.co_firstlineno) == place]
    if len(codes) != 1 or code_token(codes[0]) != code_token(code):
        return None
    return next(n for n in nodes if isinstance(n, ast.FunctionDef) and n.name == code.co_name)


def _margin(line: str) -> int:
    """The number of characters by which a line is indented."""
    return len(line) - len(line.lstrip())


@functools.lru_cache(128)
def _functions(file: str, text: str) -> list[tuple[ast.FunctionDef | ast.Lambda, types.CodeType]]:
    """All functions of a file with this text, and the code that Python makes of them."""
    try:
        tree, module = ast.parse(text), compile(text, file, "exec", dont_inherit=True)
    except SyntaxError:
        return []
    nodes: dict[tuple[int, str], list[Any]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            nodes.setdefault((first, node.name), []).append(node)
        elif isinstance(node, ast.Lambda):
            nodes.setdefault((node.lineno, "<lambda>"), []).append(node)
    pairs = []
    for code in _nested(module):
        candidates = nodes.get((code.co_firstlineno, code.co_name), [])
        if len(candidates) > 1:  # on one line: the innermost around all of the code
            places = _places(code)
            if places:
                around = [n for n in candidates if all(_within(p, _body(n)) for p in places)]
            else:  # it only returns a constant, which Python 3.12 has no place for
                around = [n for n in candidates if isinstance(n, ast.Lambda) and _alone(n, file) == code_token(code)]
            candidates = sorted(around, key=_extent)[:1]
        pairs += [(node, code) for node in candidates]
    return pairs


def _alone(node: ast.Lambda, file: str) -> str:
    """The token of a lambda outside of the function that it stands in."""
    whole = compile(ast.Expression(node), file, "eval", dont_inherit=True)
    return code_token([c for c in whole.co_consts if isinstance(c, types.CodeType)][-1])


def _nested(code: types.CodeType) -> Iterator[types.CodeType]:
    for c in code.co_consts:
        if isinstance(c, types.CodeType):
            yield c
            yield from _nested(c)


Place = tuple[tuple[int, int], tuple[int, int]]
"""Line and column where something begins, and where it ends."""


def _places(code: types.CodeType) -> list[Place]:
    """The places of a function's instructions in the text, those that begin and end at no place left out."""
    positions = [p for p in code.co_positions() if None not in p]
    return [((a, c), (b, d)) for a, b, c, d in positions if (a, c) != (b, d)]  # type: ignore[misc]


def _body(node: ast.FunctionDef | ast.Lambda) -> Place:
    first, last = (node.body, node.body) if isinstance(node, ast.Lambda) else (node.body[0], node.body[-1])
    return (first.lineno, first.col_offset), (last.end_lineno or 0, last.end_col_offset or 0)


def _within(inner: Place, outer: Place) -> bool:
    return outer[0] <= inner[0] and inner[1] <= outer[1]


def _extent(node: ast.FunctionDef | ast.Lambda) -> tuple[int, int]:
    (a, c), (b, d) = _body(node)
    return b - a, d - c
