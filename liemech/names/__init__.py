"""The public names.  Each namespace lists its own in the stub beside it, by imports such as
`from .integrators.rkmk import RKMK as RKMK`, which type checkers and editors read too; a name is
imported when it is first asked for.
"""

import ast
import re
import sys
from collections.abc import Callable, Iterable
from functools import reduce
from importlib import import_module
from importlib.machinery import PathFinder
from inspect import getdoc, isclass
from typing import Any

from .places import package_of, stub_of

FORMER = {
    "FixedPoint": "lm.joints.BallJoint(body, None, at, point)",
    "Straight": "lm.parts.StraightLineFlow",
    "OfCoordinate": "lm.parts.FunctionOfCoordinate",
    "SE23Algebra": "the class of lm.SE23().algebra",
    "SGal3Algebra": "the class of lm.SGal3().algebra",
    "SO3Algebra": "the class of lm.SO3().algebra",
}
"""Names that are no longer there, and what stands for them."""

OF_SPACES = ".", ".names"
"""Where the stub of the library imports namespaces from."""


def listed(namespace: str) -> dict[str, str]:
    """The modules in which the public names of a namespace are defined, relative to the package that
    it is in, by its stub.
    """
    imports = (statement for statement in stub_of(namespace).body if isinstance(statement, ast.ImportFrom))
    return {name.name: "." * source.level + (source.module or "") for source in imports for name in source.names}


def public() -> dict[str, str]:
    """The full name of each public name, by the name alone: `lm.models.HeavyTop` by `HeavyTop`."""
    top = listed("liemech")
    spaces = [name for name, module in top.items() if module in OF_SPACES]
    inner = {name: f"lm.{space}.{name}" for space in reversed(spaces) for name in members(space)}  # the first counts
    return inner | {name: f"lm.{name}" for name in top}


def everything() -> dict[str, Any]:
    """The thing that each public name stands for, by the name alone."""
    library = sys.modules["liemech"]
    return {n: reduce(getattr, full.split(".")[1:], library) for n, full in public().items()}


def sentence(thing: Any) -> str:
    """The first sentence of a docstring, in one line; its full stop follows a letter or a sign, not
    a space as in g . x.
    """
    text = " ".join((getdoc(thing) or "").split("\n\n")[0].split())
    return re.split(r"(?<=[^ .])\.(?= |$)", text)[0].rstrip(".:")


def members(space: str) -> list[str]:
    """The public names of a namespace, such as `models`."""
    module = import_module(f"liemech.{space}")
    return getattr(module, "__all__", None) or [n for n, x in vars(module).items() if isclass(x)]


def lazily(namespace: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a namespace with a stub."""
    homes, module, package = listed(namespace), sys.modules[namespace], package_of(namespace)

    def getattribute(name: str) -> Any:
        if name not in homes:
            message, moved = _missing(namespace, name)
            if moved and sys._getframe(1).f_code.co_name == "_handle_fromlist":
                # `from liemech import HeavyTop`, which would make a text of its own of the other
                raise ImportError(message, name=name)
            raise AttributeError(message, name=name, obj=module)
        home = homes[name]
        value = (
            import_module(f"{namespace}.{name}") if home in OF_SPACES else getattr(import_module(home, package), name)
        )
        vars(module)[name] = value
        return value

    def names() -> list[str]:
        return sorted({*(name for name in vars(module) if name.startswith("__")), *homes})

    return getattribute, names, list(homes)


def _missing(namespace: str, name: str) -> tuple[str, bool]:
    """Why a namespace has no such name, in words, with the name or place that is meant; and whether a place has it."""
    message = f"module {namespace!r} has no attribute {name!r}"
    package = vars(sys.modules[namespace]).get("__path__")
    # asked for by tools, which want no answer, and by `from . import name` before it imports a file
    if name.startswith("_") or (package and PathFinder.find_spec(f"{namespace}.{name}", package)):
        return message, False
    shown, names = namespace.replace("liemech", "lm", 1), public()
    if place := names.get(name) or FORMER.get(name):
        return f"{message}: {shown}.{name} is {place}", True
    near = nearest(name, names)
    return f"{message}. Did you mean {names[near]}?" if near else message, False


def nearest(name: str, names: Iterable[str]) -> str | None:
    """The name that is written most like `name`, whatever the case; None if none is near."""
    from difflib import get_close_matches

    spellings = {candidate.lower().replace("_", ""): candidate for candidate in names}
    return next((spellings[n] for n in get_close_matches(name.lower().replace("_", ""), spellings, 1)), None)


def meant(name: str, names: Iterable[str]) -> str:
    """The end of a refusal of a name: ` (did you mean steps?)`, or nothing."""
    near = nearest(name, names)
    return f" (did you mean {near}?)" if near else ""
