"""Lists that have two names.  Python changes a list under all of its names; the compiler's lists are
values, so a list is changed in place only where nothing else can hold it.

Where ways of control meet, a list that differs between them becomes a new value.  If something else
held it on one of the ways, both are shared from there on.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from ...errors import NotCompilable
from ...formulas.vectors import Mat, Vec
from .iterators import ItemStream
from .scopes import RETURN, CallFrame, Closure, Env

if TYPE_CHECKING:
    from ..changes.dependencies import Reads


class Aliases:
    """The lists that may have several names; `frames` are the calls that are being inlined."""

    def __init__(self, frames: list[CallFrame], reads: Reads) -> None:
        self.frames, self.reads = frames, reads
        self.shared: dict[int, list[Any]] = {}  # by identity

    def require_own(self, items: Any, name: ast.expr, env: Env) -> None:
        """Refuse to change a list in place that is not this variable's alone."""
        it = ast.unparse(name)
        copy = f"`[*{it}]`" if isinstance(items, list) else "of its entries"
        if self.reads.from_outside(items):
            raise NotCompilable(
                f"`{it}` is changed in place and comes from outside of the formula, where it would "
                f"be another one in the next step: change a copy, {copy}"
            )
        variable = name.id if isinstance(name, ast.Name) else ""
        if id(items) in self.shared or self._held(items, [(variable, env)]):
            raise NotCompilable(f"`{it}` is changed in place and has another name: change a copy, {copy}")

    def meet(self, name: str, result: Any, ways: Iterable[tuple[Any, Env]]) -> bool:
        """Note that a variable has these values on the ways that meet, and becomes the result; returns whether a list
        among them is shared from now on.
        """
        ways = list(ways)
        all_lists = [x for value, _ in ways for x in lists(value)]
        # what a call returns outlives its variables
        around = [(name, env) for _, env in ways if name != RETURN]
        held = [x for x in all_lists if id(x) in self.shared or self.reads.from_outside(x) or self._held(x, around)]
        if held:
            self.share([*all_lists, *lists(result)])
        return bool(held)

    def share(self, items: Iterable[list[Any]]) -> None:
        """Mark lists as ones that have other names."""
        self.shared |= {id(x): x for x in items}

    def _held(self, items: Any, around: list[tuple[str, Env]]) -> bool:
        """Whether a list is in something else than the variable of this name, in this call or around it."""
        values = [v for name, env in around for n, v in env.items() if n != name]
        values += [v for frame in self.frames[:-1] for v in frame.env.values()]
        return self._within(values, items, {id(frame) for frame in self.frames})

    def _within(self, values: Iterable[Any], items: Any, visited: set[int]) -> bool:
        for value in values:
            if value is items:
                return True
            if isinstance(value, ItemStream):
                # its items may still have to be computed, from whatever
                if value.sources is None or self._within(value.sources, items, visited):
                    return True
            elif isinstance(value, Closure):
                inside = [*value.defaults, *value.options.values()]
                frame: CallFrame | None = value.frame
                while frame is not None and id(frame) not in visited:
                    visited.add(id(frame))
                    inside += frame.env.values()
                    frame = frame.around
                if id(value) not in visited:
                    visited.add(id(value))
                    if self._within(inside, items, visited):
                        return True
            elif self._within(_inside(value), items, visited):
                return True
        return False


def lists(value: Any) -> Iterator[list[Any]]:
    """The lists in a value."""
    if isinstance(value, list):
        yield value
    for x in _inside(value):
        yield from lists(x)


def _inside(value: Any) -> Iterable[Any]:
    """The items of a container that may be lists."""
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, (tuple, list)) and type(value) not in (Vec, Mat) else ()
