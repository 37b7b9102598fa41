"""How often a step must be looked at inside, so that nothing turns by more than a quarter of a turn between two looks."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from ...errors import InvalidInput, NotDefined
from ...formulas.numbers.sizes import EPSILON

QUARTER = 0.5 * math.pi
"""A quarter of a turn."""

MOST = 2**22
"""Looks into one step."""

SMALL = 30
"""Dimensions up to which ad_xi is looked at: of larger groups of matrices its frequencies are differences of those of
xi.
"""


class TurningRates:
    """The largest angular frequency with which elements and momenta of a group move under a constant velocity xi: that of
    the eigenvalues of ad_xi, and of the matrix of xi.

    parts : for each kind of matrices the components of xi that they depend on, (copies, dim), and a basis,
    (dim, m, m).
    """

    def __init__(self, group: Any) -> None:
        starts: dict[Any, list[int]] = {}
        _collect(group, 0, starts)
        self.parts = [
            (np.add.outer(first, np.arange(len(basis))), basis)
            for factor, first in starts.items()
            for basis in _blocks(factor)
        ]

    def __call__(self, xi: np.ndarray) -> np.ndarray:
        """The frequencies of velocities, (n, dim): those up to a quarter of a turn as upper bounds."""
        fastest = np.zeros(len(xi))
        for places, basis in self.parts:
            components = xi[:, places].reshape(-1, len(basis))
            # eigenvalues of real matrices come in pairs: twice the square of one is at most the norm's
            pairs = 1.0 if np.iscomplexobj(basis) else 0.5
            squares = np.einsum("iab,jab->ij", basis, basis.conj()).real
            with np.errstate(invalid="ignore", over="ignore"):
                bound = np.sqrt(np.abs(pairs * np.einsum("ni,ij,nj->n", components, squares, components)))
            rotation = len(basis[0]) <= 3 and np.array_equal(basis, -basis.transpose(0, 2, 1))
            fast = np.flatnonzero((bound > QUARTER) & (not rotation))
            if len(fast):
                matrices = np.einsum("ni,iab->nab", components[fast], basis)
                good = np.isfinite(matrices).all(axis=(1, 2))
                bound[fast[good]] = np.abs(np.linalg.eigvals(matrices[good]).imag).max(axis=1)
            np.maximum(fastest, bound.reshape(len(xi), -1).max(axis=1), out=fastest)
        return fastest


@functools.lru_cache(64)
def turning_of(group: Any) -> TurningRates:
    """The frequencies of a group, prepared once for equal groups."""
    return TurningRates(group)


def _collect(group: Any, start: int, starts: dict[Any, list[int]]) -> None:
    """The first components of velocities of every group that is not a product of others."""
    for factor in getattr(group, "factors", ()):
        _collect(factor, start, starts)
        start += factor.dim
    if not hasattr(group, "factors"):
        starts.setdefault(group, []).append(start)
        if hasattr(group, "acting"):
            _collect(group.acting, start, starts)


def _blocks(group: Any) -> list[np.ndarray]:
    """Bases of matrices with the eigenvalues of xi and of ad_xi: the irreducible diagonal blocks."""
    from scipy.sparse.csgraph import connected_components

    algebra, bases = group.algebra, []
    try:
        basis = algebra.basis
        bases.append(basis if group.dim <= SMALL else 2.0 * basis)
    except NotDefined:
        pass
    if group.dim <= SMALL:
        bases.append(algebra._ad_matrices)
    blocks: list[np.ndarray] = []
    for basis in bases:
        count, block = connected_components(np.abs(basis).sum(axis=0) != 0.0, connection="strong")
        for k in range(count):
            rows = np.flatnonzero(block == k)
            matrices = basis[:, rows[:, None], rows]
            if matrices.any() and not any(np.array_equal(matrices, other) for other in blocks):
                blocks.append(matrices)
    return blocks


def looks_by_velocity(turned: np.ndarray) -> np.ndarray:
    """Counts of looks, (n,), for steps that turn by these angles; more than the angle alone asks for where any is
    needed.
    """
    return _counted(np.where(turned > QUARTER, np.ceil(1.25 * turned / QUARTER), 1.0))


def looks_on_the_way(turning: TurningRates, ways: np.ndarray, blocks: tuple[int, ...]) -> np.ndarray:
    """How many looks steps need that go along Omega(s) = s p_1 + s^2 p_2 + ..., 0 <= s <= 1.

    Omega' lies in the convex hull of its Bernstein coefficients, and a component turns back at most as often as they
    change sign.

    ways : (n, terms, dim) the coefficients p.  blocks : how many components in a row share a unit.
    Source: Farouki, Computer Aided Geometric Design 29 (2012), 379, section 5.
    """
    steps, terms, dim = ways.shape
    slopes = np.einsum("kj,njd->nkd", _bernstein(terms), ways)
    with np.errstate(invalid="ignore"):
        turned = turning(slopes.reshape(-1, dim)).reshape(steps, terms).max(axis=1)
        largest = np.maximum.reduceat(np.abs(slopes).max(axis=1), np.cumsum([0, *blocks[:-1]]), axis=1)
        least = 64.0 * terms * EPSILON * np.repeat(largest, blocks, axis=1)
        signs = np.where(np.abs(slopes) > least[:, None], np.sign(slopes), 0.0)
    bends = np.zeros((steps, dim))
    last = signs[:, 0]
    for k in range(1, terms):
        new = signs[:, k]
        bends += new * last < 0.0
        last = np.where(new != 0.0, new, last)
    most = bends.max(axis=1, initial=0.0)
    return np.maximum(looks_by_velocity(turned), _counted(np.where(most > 0.0, 2.0 * (most + 1.0), 1.0)))


@functools.lru_cache(64)
def _bernstein(terms: int) -> np.ndarray:
    """The Bernstein coefficients of the derivative of sum_j s^(j+1), (terms, terms): a column for every j."""
    from scipy.special import comb

    k, j = np.meshgrid(np.arange(terms), np.arange(terms), indexing="ij")
    return np.asarray(comb(k, j) / comb(terms - 1, j) * (j + 1.0))


def _counted(looks: np.ndarray) -> np.ndarray:
    """Whole numbers of looks; one where a velocity is not finite.  Raises InvalidInput for a step that turns too often."""
    if (looks > MOST).any():
        raise InvalidInput(
            f"integrate: a step of {float(looks[looks > MOST][0]) / 5.0:.2g} turns is too long for `events`, which look at "
            "it five times a turn; take a smaller h, or max_step"
        )
    return np.nan_to_num(looks, nan=1.0).astype(int)
