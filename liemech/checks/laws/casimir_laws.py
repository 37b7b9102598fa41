"""Independence of Casimirs: each changes somewhere, and none is a function of others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..points.sample_points import flat
from .law import Same, Told

INDEPENDENT = 1e-8
"""Gradients of length one that are closer to dependent than this, by singular values, are so."""


INDEPENDENCE = "independent Casimirs", "the gradients of the Casimirs are independent almost everywhere"
"""The law: its name, and its formula."""


def independence(values: Callable[[Any], Any], slopes: Callable[[Any], np.ndarray], points: Iterable[Any]) -> Same:
    """The rank of the gradients at the best of some points, beside the number of Casimirs; no
    Casimirs are independent.

    values : the Casimirs at a point, (number,).  slopes : their gradients as rows, (number, n).
    """
    best, number = 0, 0
    for y in points:
        try:
            with np.errstate(all="ignore"):
                C = flat(values(y))
                G = np.asarray(slopes(y), dtype=float) if C.size else None
        except (ArithmeticError, ValueError):  # it is not defined here
            continue
        if G is None:
            continue
        number = max(number, C.size)
        # each coordinate in units of its own size
        G = G.reshape(C.size, -1) * np.abs(flat(y))
        largest = np.abs(G).max(axis=1, initial=0.0)
        moving = largest > INDEPENDENT * np.abs(C)
        rows = G[moving] / largest[moving, None]
        rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        sizes = np.linalg.svd(rows, compute_uv=False) if len(rows) else np.zeros(0)
        best = max(best, int((sizes > INDEPENDENT).sum()))
    distinguished = (
        f"of {number} Casimirs only {best} have gradients that are independent: one of them is a constant, or a function "
        "of others"
    )
    return Told(float(best), float(number), told=distinguished)
