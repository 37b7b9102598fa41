"""Formulas that follow from others: what a class may overrule by a closed form, and which closed
forms a class has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from .signatures import bare

Formula = TypeVar("Formula", bound=Callable[..., Any])


def derived(formula: Formula) -> Formula:
    """Mark a method that follows from what a subclass must write: an own version of it is a closed
    form, which has to give the same numbers.
    """
    formula.__derived__ = True  # type: ignore[attr-defined]
    return formula


def closed_forms(cls: type) -> Iterator[tuple[str, Any, Any]]:
    """The derived methods that a class has its own version of: the name, that version, and the
    derived method that it stands for.
    """
    names = {name for base in cls.__mro__ for name in vars(base)}
    for name in sorted(names):
        versions = [bare(vars(base)[name]) for base in cls.__mro__ if name in vars(base)]
        if not is_derived(versions[0]):
            follows = next((version for version in versions if is_derived(version)), None)
            if follows is not None:
                yield name, versions[0], follows


def is_derived(formula: Any) -> bool:
    """Was it marked?"""
    return getattr(formula, "__derived__", False)
