"""Advice: a replacement for each function and statement that native code refuses."""

from __future__ import annotations

import ast
from typing import Any

_OTHERWISE = (
    "compute it before the run (in a field or a functools.cached_property), or write it out with "
    "the functions of liemech.formulas"
)

_FUNCTIONS = {
    "norm": "use liemech.norm",
    "solve inv": "use liemech.formulas.solve",
    "clip": "write min(max(x, a), b)",
    "isclose allclose": "write abs(a - b) <= tolerance",
    "interp": "go through the table in a loop, with `if`",
    "polyval": "write Horner's scheme as a loop",
    "reduce accumulate combinations permutations product pairwise chain": "write a loop",
    "partial": "write a lambda",
    "complex exp sin cos sqrt phase rect polar": "use liemech.formulas.Complex(re, im)",
    "float64 float32 float16 longdouble": "write float(x)",
    "int64 int32 int16 int8 uint64 uint32 uint16 uint8": "write int(x)",
    "dict": "write {...} with its keys",
    "dict.get dict.setdefault": "write d[key] if key in d else default",
    "list.index list.count list.remove": "write a loop with `if`",
    "list.pop": "write items[-1] and items[:-1]",
    "list.insert": "write [*items[:i], x, *items[i:]]",
    "list.sort": "write sorted(items)",
    "list.reverse": "write items[::-1]",
    "list.append list.extend": "give the list a name of its own in this formula, or write [*items, x]",
    "set frozenset": "write a tuple",
    "round around": "write round(x)",
    "multiply add subtract divide true_divide negative mul sub truediv pow neg": "write the operator",
    "itemgetter attrgetter": "write x[i] or x.name",
    "_lru_cache_wrapper": "leave the cache out: native code computes what is known once",
    "range": "write a loop, `for i in range(n):`",
    "sum": "use sum(...) of a list, or liemech.sum",
    "print input open": "leave it out of formulas; record the run and look at it afterwards",
}
_OF = {name: advice for names, advice in _FUNCTIONS.items() for name in names.split()}

_SYNTAX: dict[type, str] = {
    ast.Try: "test for the case with `if` before",
    ast.With: "leave it out of formulas",
    ast.Match: "write `if` and `elif`",
    ast.Delete: "leave it out",
    ast.Global: "return the value, or put it into a field",
    ast.Nonlocal: "return the value, and assign it where the function is called",
    ast.Import: "import at the top of the module",
    ast.ImportFrom: "import at the top of the module",
    ast.ClassDef: "define the class at the top of the module",
    ast.AsyncFunctionDef: "write a plain `def`",
    ast.FunctionDef: "leave out the decorator, or define the function at the top of the module",
    ast.Set: "write a tuple",
    ast.SetComp: "write a list, `[... for ...]`",
    ast.DictComp: "write the dict with its keys, or a list, `[... for ...]`",
    ast.Yield: "return a list",
    ast.YieldFrom: "return a list",
}


def instead_of(function: Any) -> str:
    """A replacement for a call that native code cannot make."""
    if isinstance(function, type) and function.__module__ not in ("builtins", "numpy", "functools"):
        return "make a tuple, or a record (@liemech.record)"
    name = getattr(function, "__qualname__", None) or type(function).__name__
    of_kind = _OF.get(type(function).__name__)  # partial, ...
    return of_kind or _OF.get(name) or _OF.get(name.rpartition(".")[2]) or _OTHERWISE


def instead_of_syntax(node: ast.AST) -> str:
    """A replacement for a statement or expression that has no place in a formula."""
    return _SYNTAX.get(type(node), "write it with plain statements")


_ALIKE = {
    ("np.",): "write float(x) of NumPy's numbers",
    ("power series",): "write liemech.formulas.where",
    ("Complex(",): "write liemech.formulas.Complex(x, 0.0) on every way",
    ("None", "'"): "let it be a number on every way, such as 0 or 1",
}
"""By what is in its layouts, how a variable is alike on all ways to one place."""


def differing(layouts: list[str]) -> str:
    """The layouts of a variable on different ways to one place, and how to make them one."""
    shown = " and ".join(dict.fromkeys(layouts))
    cures = [cure for signs, cure in _ALIKE.items() if any(sign in shown for sign in signs)]
    if len({layout.count(",") for layout in layouts if "list(" in layout}) > 1:
        cures.append("choose the item, and `append` it after the branch")
    return ": ".join([shown, *cures])
