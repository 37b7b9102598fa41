"""Systems and methods from text: `RKMK(order=4)`,
`HeavyTop([1.0, 1.5, 0.7], 1.3, centre=[0.6, 0.0, 0.8])`.

Only public classes of the library are called, with numbers, lists and each other, and records of a
module of the user's, if it may be named: in what the user types, and in files that the user trusts.
No function is called, and nothing else is evaluated.
"""

from __future__ import annotations

import ast
import inspect
import math
import sys
import traceback
from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from typing import Any

import numpy as np

import liemech as lm

from ..formulas.classes.records import records_in
from ..groups.matrices.matrix_group import MatrixLieGroup
from ..names import everything, meant
from ..rooms.files.encoding import LARGEST, require_sizes


def read(text: str, kind: type, where: str, own: bool = True) -> Any:
    """The object that a text describes, of some kind: `RKMK(order=4)`, `Cayley`,
    `my_module:Gyrostat(0.3)`.

    own : may it name a module of the user's, which is imported?
    Raises InvalidInput, which says where, what is wrong, and what is allowed.
    """
    module, _, expression = text.rpartition(":") if ":" in text.partition("(")[0] else ("", "", text)
    modules = _module_of_user(module, text, where, own)
    try:
        tree = ast.parse(expression.strip(), mode="eval").body
        instance = _value(tree, kind, where, modules)
    except lm.errors.LiemechError:
        raise
    except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError) as wrong:
        reason = getattr(wrong, "msg", wrong)
        raise lm.errors.InvalidInput(
            f"{where}: {_short(text)} cannot be read, {reason}; write it as RKMK(order=4)"
        ) from None
    if isinstance(instance, type):
        instance = _call(instance, (), {}, where)
    if not isinstance(instance, kind):
        raise lm.errors.InvalidInput(f"{where}: {text!r} is no {_in_words(kind)}{_instead(text, kind)}")
    return instance


def build(name: Any, arguments: Mapping[str, Any], kind: type, where: str, own: bool = True) -> Any:
    """An object of a class by its name, with arguments by theirs; text among them is read in its
    turn.  own : as in `read`.
    """
    if not isinstance(name, str):
        raise lm.errors.InvalidInput(f"{where}: name must be a text such as {names(kind)[0]!r}; got {name!r}")
    module, _, class_name = name.rpartition(":")
    target = _public(class_name, kind, where, _module_of_user(module, name, where, own))
    options = {key: _argument(value, f"{where}: {key}", own) for key, value in arguments.items()}
    if not isinstance(target, type):  # an object of a module of the user's
        if options:
            raise lm.errors.InvalidInput(f"{where}: {name!r} is an object and takes no {', '.join(options)}")
        return target
    return _call(target, (), options, where)


def _module_of_user(module: str, text: str, where: str, own: bool) -> list[Any]:
    """The module of the user's that a text names, if it names one."""
    if not module:
        return []
    if not own:
        raise lm.errors.InvalidInput(
            f"{where}: {_short(text)} names a module of yours, {module}, and a file can name classes "
            "of the library only; if you trust it, --trusted imports the modules that it names, "
            "which runs their code"
        )
    return [imported(module, where)]


def _short(text: str) -> str:
    shown = repr(text)
    return shown if len(shown) < 100 else f"{shown[:97]}..."


def modules_of_the_folder() -> None:
    """Let Python find modules in the folder where the command runs."""
    if "" not in sys.path:
        sys.path.insert(0, "")


def imported(module: str, where: str) -> Any:
    """A module of the user's, from the folder where the command runs or from wherever Python finds it."""
    modules_of_the_folder()
    try:
        return import_module(module)
    except ModuleNotFoundError as missing:
        if missing.name == module.partition(".")[0] or missing.name == module:
            raise lm.errors.InvalidInput(f"{where}: there is no module {module!r} here") from None
        raise lm.errors.InvalidInput(f"{where}: module {module!r} cannot be imported: {missing}") from missing
    except Exception as wrong:  # whatever the module does when it is loaded
        place = wrong if isinstance(wrong, SyntaxError) else traceback.extract_tb(wrong.__traceback__)[-1]
        at = f"{place.filename}, line {place.lineno}"
        message = f"{type(wrong).__name__}: {getattr(wrong, 'msg', wrong)}".partition("\n")[0]
        raise lm.errors.InvalidInput(f"{where}: module {module!r} cannot be imported: {message} ({at})") from wrong


def names(kind: type) -> list[str]:
    """The public classes of a kind."""
    return [
        name
        for name, thing in sorted(everything().items())
        if isinstance(thing, type) and issubclass(thing, kind) and thing is not kind
    ]


def _argument(value: Any, where: str, own: bool) -> Any:
    """A value of a file: numbers and lists as they are, text and tables as objects."""
    if isinstance(value, str):
        return read(value, lm.Record, where, own)
    return from_table(value, lm.Record, where, own) if isinstance(value, Mapping) else value


def from_table(table: Mapping[str, Any], kind: type, where: str, own: bool) -> Any:
    """The object that a table of a file describes, by the name of its class and its arguments."""
    if "name" not in table:
        raise lm.errors.InvalidInput(f"{where}: needs a name, the class of a {kind.__name__}")
    options = {key: value for key, value in table.items() if key != "name"}
    return build(table["name"], options, kind, where, own)


def _value(node: ast.AST, kind: type, where: str, modules: list[Any]) -> Any:
    """A node of the text, as the number, list or object it is."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float, str, bool, type(None))):
        return node.value
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        value = _value(node.operand, kind, where, modules)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Div, ast.Mult)):
        left, right = (_value(side, kind, where, modules) for side in (node.left, node.right))
        if all(isinstance(side, (int, float)) for side in (left, right)) and (right or isinstance(node.op, ast.Mult)):
            return left / right if isinstance(node.op, ast.Div) else left * right
    if isinstance(node, (ast.List, ast.Tuple)):
        return [_value(item, kind, where, modules) for item in node.elts]
    if isinstance(node, ast.Name):
        if node.id in ("inf", "pi"):
            return getattr(math, node.id)
        return _public(node.id, kind, where, modules)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        values = [_value(argument, lm.Record, where, modules) for argument in node.args]
        if node.func.id == "array":  # as NumPy prints one
            return _array(values, ast.unparse(node), where)
        if any(k.arg is None for k in node.keywords):
            raise lm.errors.InvalidInput(
                f"{where}: {ast.unparse(node)!r}: ** is not read; write the arguments out, name=value"
            )
        cls = _public(node.func.id, kind, where, modules)
        options = {k.arg: _value(k.value, lm.Record, where, modules) for k in node.keywords if k.arg}
        return _call(cls, [_item(v, where) for v in values], {k: _item(v, where) for k, v in options.items()}, where)
    raise lm.errors.InvalidInput(
        f"{where}: {ast.unparse(node)!r} is neither a number, a list, nor a class of the library"
    )


def _array(values: list[Any], text: str, where: str) -> np.ndarray:
    """The array of a list of numbers, or of rows of the same length."""
    try:
        (rows,) = values
        return np.array(rows, dtype=float)
    except (TypeError, ValueError):
        raise lm.errors.InvalidInput(
            f"{where}: {text!r} is no array; give one list, of numbers or of rows of the same length"
        ) from None


def _item(value: Any, where: str) -> Any:
    """An argument; of a class without brackets the object."""
    return _call(value, (), {}, where) if isinstance(value, type) else value


def _public(name: str, kind: type, where: str, modules: list[Any]) -> Any:
    """The class or object of a name, in modules of the user's or in the library."""
    candidates = [vars(module)[name] for module in modules if name in vars(module)]
    candidate = candidates[0] if candidates else everything().get(name)
    if isinstance(candidate, type) and issubclass(candidate, (kind, lm.Vec, lm.Mat)):
        return candidate
    if candidates and isinstance(candidate, kind):  # an object that the module has made
        return candidate
    place = f" in {modules[0].__name__}" if modules else ""
    raise lm.errors.InvalidInput(f"{where}: {name!r} is no {_in_words(kind)}{place}{_instead(name, kind)}")


def _in_words(kind: type) -> str:
    return "class of the library" if kind is lm.Record else kind.__name__


def _instead(name: str, kind: type) -> str:
    """The name that is written alike, and all of a kind."""
    allowed = names(kind)
    listing = "" if kind is lm.Record else f"; there are {', '.join(allowed)}"
    return f"{meant(name, allowed)}{listing}"


def _call(cls: Any, values: Any, options: Mapping[str, Any], where: str) -> Any:
    """An object; what its class says of wrong arguments begins with the place."""
    if not isinstance(cls, type):
        raise lm.errors.InvalidInput(f"{where}: {cls!r} is an object; write it without brackets")
    allowed = list(inspect.signature(cls).parameters)
    require_sizes(where, cls, {**dict(zip(allowed, values, strict=False)), **options}, LARGEST)
    for key in options:
        if key not in allowed and cls not in (lm.Vec, lm.Mat):
            raise lm.errors.InvalidInput(
                f"{where}: {cls.__name__} has no {key!r}{meant(key, allowed)}; allowed are {', '.join(allowed)}"
            )
    try:
        instance = cls(*values, **options)
        for group in records_in(instance, MatrixLieGroup):
            require_sizes(where, type(group), {f.name: getattr(group, f.name) for f in fields(group)}, LARGEST)
        return instance
    except lm.errors.LiemechError as wrong:
        raise lm.errors.InvalidInput(f"{where}: {wrong}") from None
    except Exception as wrong:  # whatever a class makes of arguments that nobody meant
        message = f"{wrong}" or type(wrong).__name__
        raise lm.errors.InvalidInput(f"{where}: {message}; {cls.__name__}{inspect.signature(cls)}") from wrong
