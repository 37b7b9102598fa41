"""Skew-symmetric matrices whose rows have different units: pairs of conjugate rows, and the null
space.
"""

from __future__ import annotations

import numpy as np

from ...formulas import Vec

ROUNDINGS = 64.0
"""An entry below as many roundings of the terms that it is the sum of, per row, is zero."""

GOOD = 2.0**-4
"""Rows that are conjugate to this part of the best ones, in units of their own, are as good; the
largest entry as it is given then decides.
"""

TURNS = 100
"""The most rounds of the search for units; each halves the orders of magnitude that are left."""


def pairs(array: np.ndarray, terms: np.ndarray | None = None) -> list[tuple[int, int]]:
    """Pairs of rows, by elimination: each is conjugate, b_ij != 0, in what the pairs before it
    leave.  There are half as many as the rank.

    An entry is zero if it is rounding of the terms that were added up to it.  So the pairs do not
    depend on units: they are the same for d_i b_ij d_j, d powers of two.
    array : (n, n).  terms : (n, n), what the rounding of each entry is relative to; the entries
    themselves if left out.

    Source: Bunch, A note on the stable decomposition of skew-symmetric matrices, Math. Comp. 38
    (1982), 475; Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 3.3 (running error
    analysis).
    """
    units, n = like_sizes(array), len(array)
    remaining = units[:, None] * array * units
    size = np.abs(remaining) if terms is None else units[:, None] * terms * units
    left = np.arange(n)
    pivots: list[tuple[int, int]] = []
    while True:
        remaining[np.abs(remaining) <= ROUNDINGS * n * np.finfo(float).eps * size] = 0.0
        if not remaining.any():
            return pivots
        scale = like_sizes(remaining)
        like = np.abs(scale[:, None] * remaining * scale)
        entries = np.abs(remaining) / units[left][:, None] / units[left]
        i, j = divmod(int(np.where(like >= GOOD * like.max(), entries, 0.0).argmax()), len(left))
        pivots.append((int(left[i]), int(left[j])))
        product = np.outer(remaining[:, i], remaining[:, j] / remaining[i, j])
        others = np.ix_(*2 * [[k for k in range(len(left)) if k not in (i, j)]])
        size = (size + np.abs(product) + np.abs(product.T))[others]
        remaining, left = (remaining - product + product.T)[others], np.delete(left, (i, j))


def null_vectors(array: np.ndarray) -> tuple[Vec, ...]:
    """A basis of the null space of a skew-symmetric matrix; the largest component of each is one."""
    paired = [i for pair in pairs(array) for i in pair]
    free = [i for i in range(len(array)) if i not in paired]
    vectors = np.zeros((len(free), len(array)))
    vectors[:, free] = np.eye(len(free))
    units = like_sizes(array)
    scaled = units[:, None] * array * units
    vectors[:, paired] = -np.linalg.solve(scaled[np.ix_(paired, paired)], scaled[np.ix_(paired, free)]).T
    vectors = units * vectors
    return tuple(Vec.of((v / v[np.abs(v).argmax()]).tolist()) for v in vectors)


def like_sizes(array: np.ndarray) -> np.ndarray:
    """Powers of two d for which the largest entries of all rows of d_i b_ij d_j are near one; 1 for
    rows of zeros.

    Source: Ruiz, A scaling algorithm to equilibrate both rows and columns norms in matrices,
    RAL-TR-2001-034.
    """
    units = np.ones(len(array))
    for _ in range(TURNS):
        largest = np.abs(units[:, None] * array * units).max(axis=1, initial=0.0)
        largest[largest == 0.0] = 1.0
        change = np.exp2(-np.round(0.5 * np.log2(largest)))
        if (change == 1.0).all():
            break
        units = units * change
    return units
