"""What Casimirs must be beside constant: functions that change at all, none a function of others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from .law import Same
from .sample_points import flat, size

INDEPENDENT = 1e-8
"""Gradients of length one that are closer to dependent than this, by singular values, are so."""


class Independent(Same):
    """The number of Casimirs beside the number of directions that their gradients have."""

    def slips(self, allowed: float) -> str:
        """What such a number means."""
        return (
            f"of {flat(self.right)[0]:.0f} Casimirs only {flat(self.left)[0]:.0f} have gradients "
            "that are independent: one of them is a constant, or a function of others"
        )


def independence(
    values: Callable[[Any], Any], slopes: Callable[[Any], np.ndarray], points: Iterable[Any]
) -> Same:
    """The rank of the gradients at the best of some points, beside the number of Casimirs; no
    Casimirs are independent.

    values : the Casimirs at a point, (number,).  slopes : their gradients as rows, (number, n).
    """
    best, number = 0, 0
    for y in points:
        try:
            with np.errstate(all="ignore"):
                C = flat(values(y))
                G = np.asarray(slopes(y), dtype=float) if C.size else np.zeros((0, 1))
        except (ArithmeticError, ValueError):  # it is not defined here
            continue
        number = max(number, C.size)
        G = G.reshape(C.size, G.size // max(C.size, 1))
        lengths = np.linalg.norm(G, axis=1)
        # beside what a function of this size would change by
        moving = lengths * size(y) > INDEPENDENT * np.abs(C)
        rows = G[moving] / lengths[moving, None]
        sizes = np.linalg.svd(rows, compute_uv=False) if len(rows) else np.zeros(0)
        best = max(best, int((sizes > INDEPENDENT).sum()))
    return Independent(np.array([float(best)]), np.array([float(number)]))
