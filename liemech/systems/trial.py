"""Formulas of a user's, evaluated once where a system of their class is first made, so that one
that gives no number or no vector is refused there.
"""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

import numpy as np

from ..formulas.classes.overriding import WrongResult, theirs
from ..formulas.classes.records import Record, fields_of
from ..formulas.classes.signatures import bare
from ..formulas.vectors import small

if TYPE_CHECKING:
    from .system import System

TRIED = "energy", "kinetic", "potential", "constraint", "velocity", "force"
"""The formulas of a system that users write."""

LARGEST = 64
"""Of more components nothing is tried."""

_fine: weakref.WeakSet[type] = weakref.WeakSet()


def require_results(system: System) -> None:
    """Raise InvalidType for a formula that gives something else than its base in the library says.

    What has no value at the state that is tried, whatever the reason, is not judged.
    """
    parts = (system, *[x for x in fields_of(system).values() if isinstance(x, Record)])
    new = [cls for cls in map(type, parts) if theirs(cls) and cls not in _fine]
    if not new:
        return
    for name in TRIED:
        method = getattr(system, name, None)
        if method is None:
            continue
        try:
            method(*_some_arguments(system, bare(method.__func__)))
        except WrongResult:
            raise
        # a formula of somebody else's may fail anywhere but where it is meant to be used
        except Exception:
            continue
    _fine.update(new)


def _some_arguments(system: System, formula: Any) -> list[Any]:
    """A time, an element of a group, generic vectors."""
    arguments: list[Any] = []
    for k, name in enumerate(formula.__code__.co_varnames[1 : formula.__code__.co_argcount]):
        kind = "Element" if name == "g" else "Vec"
        shape: Any = () if name == "t" else system._shape(name, kind)
        if shape == ():
            arguments.append(0.3)
        elif len(shape) == 2:
            arguments.append(small(np.eye(*shape)))
        elif shape[0] > LARGEST:
            raise ValueError
        elif kind == "Element":
            arguments.append(small(np.eye(shape[0])[0]))
        else:
            rng = np.random.default_rng(k)
            arguments.append(small(rng.uniform(0.5, 1.0, shape)))
    return arguments
