"""One formula of many arguments at once: native code of a single body has them in the lanes of its
registers, as an ensemble has its members.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any


def in_lanes(formula: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
    """[formula(a, b, ...), ...] of the first, the second, ... of every column; all are alike in what they
    are made of.

    The lanes are worth it where the formula takes much longer than to move its numbers: it has square
    roots, divisions or a loop of its own.
    """
    return [formula(*row) for row in zip(*columns, strict=True)]
