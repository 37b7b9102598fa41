"""Coadjoint orbits in numbers: their dimensions, their tangent spaces, and whether two momenta lie
on the same one.

Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 14.2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..formulas import Vec, jacobian
from .lie_group import LieGroup

if TYPE_CHECKING:
    from .coadjoint import CoadjointAction

RANK = 1e-12
"""A singular value of the Poisson structure counts as zero below this, relative to the sizes of its
terms.
"""

STARTS, STEPS, TRANSPORTED = 12, 60, 1e-11
"""How often and how far an element with K_g mu = nu is sought, and how well, relative to the
momenta, it must be met.
"""


def tangent(group: LieGroup, mu: np.ndarray) -> np.ndarray:
    """A basis of {ad*_xi mu}.  mu : (dim,), returns (orbit dimension, dim)."""
    units, structure, rank = _decomposed(group, mu)
    left, _, _ = np.linalg.svd(structure)
    return _unit_rows(left.T[:rank] / units)


def isotropy(group: LieGroup, mu: np.ndarray) -> np.ndarray:
    """A basis of {xi, ad*_xi mu = 0}.  mu : (dim,), returns (dim - orbit dimension, dim)."""
    units, structure, rank = _decomposed(group, mu)
    _, _, right = np.linalg.svd(structure)
    return _unit_rows(right[rank:] * units)


def same(action: CoadjointAction, mu: np.ndarray, nu: np.ndarray, tolerance: float) -> bool | None:
    """Whether mu and nu lie on one orbit; None if not known.  mu, nu : (dim,)."""
    group = action.group
    if np.array_equal(mu, nu):
        return True
    size = max(float(np.abs(mu).max()), float(np.abs(nu).max()))
    if not np.isfinite(1.0 / size):  # the smallest numbers of all
        mu, nu, size = mu * 2.0**1000, nu * 2.0**1000, size * 2.0**1000
    mu, nu = mu / size, nu / size  # so that powers neither overflow nor vanish: K_g is linear
    if len(tangent(group, mu)) != len(tangent(group, nu)):
        return False
    (a, da), (b, db) = _casimirs(action, mu), _casimirs(action, nu)
    allowed = tolerance * np.maximum(da @ _block_sizes(group, mu), db @ _block_sizes(group, nu))
    if (np.abs(a - b) > allowed).any():
        return False
    further = group.further_invariants(mu), group.further_invariants(nu)
    if further[0] is not None and further[1] is not None:
        c, d = np.array(further[0]), np.array(further[1])
        return len(c) == len(d) and bool(np.linalg.norm(c - d) <= tolerance * max(np.linalg.norm(c), np.linalg.norm(d)))
    return True if _transported(action, mu, nu) else None


def _casimirs(action: CoadjointAction, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The Casimirs at mu and the sizes of their partial derivatives.  (k,), (k, dim)"""
    at = Vec.of(mu.tolist())
    values = np.array(action.casimirs(at), dtype=float)
    slopes = np.array(jacobian(action.casimirs, at), dtype=float) if len(values) else np.zeros((0, len(mu)))
    return values, np.abs(slopes)


def _transported(action: CoadjointAction, mu: np.ndarray, nu: np.ndarray) -> bool:
    """Whether there is an element with K_g mu = nu: Gauss-Newton steps from several starts, K_exp(xi)
    y = y - ad*_xi y + ...
    """
    group, rng = action.group, np.random.default_rng(1)
    sizes = np.maximum(_block_sizes(group, mu), _block_sizes(group, nu))
    weights = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    for start in range(STARTS):
        y = mu if start == 0 else np.asarray(action.exp_act(rng.normal(size=group.dim), mu))
        for _ in range(STEPS):
            off = weights * (nu - y)
            if np.linalg.norm(off) <= TRANSPORTED * np.linalg.norm(weights * nu):
                return True
            xi, *_ = np.linalg.lstsq(-weights[:, None] * np.asarray(action.poisson_structure(y)), off, rcond=1e-10)
            y = np.asarray(action.exp_act(xi * min(1.0, 1.0 / max(float(np.linalg.norm(xi)), 1e-300)), y))
            if not np.isfinite(y).all():
                break
    return False


def _decomposed(group: LieGroup, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Units u in which the terms of B(mu) are of size one, the matrix u_i B_ij u_j, and its rank."""
    largest = float(np.abs(mu).max(initial=0.0))
    mu = mu / largest if largest and np.isfinite(1.0 / largest) else mu
    structure = np.array(group.algebra.poisson_structure(mu), dtype=float)
    sizes = _block_sizes(group, mu)
    terms = np.zeros_like(structure)
    for block in range(len(group.unit_blocks)):
        part = np.where(_blocks(group) == block, sizes, 0.0)
        terms = np.maximum(terms, np.abs(np.array(group.algebra.poisson_structure(part), dtype=float)))
    blocks = _blocks(group)
    # the same for all components of a unit, whatever direction mu has
    for a in set(blocks.tolist()):
        for b in set(blocks.tolist()):
            at = np.ix_(blocks == a, blocks == b)
            terms[at] = terms[at].max()
    units = np.ones(group.dim)
    for _ in range(50):
        rows = (units * terms * units[:, None]).max(axis=1, initial=0.0)
        units = units / np.sqrt(np.where(rows > 0.0, rows, 1.0))
    structure = units[:, None] * structure * units
    singular = np.linalg.svd(structure, compute_uv=False)
    rank = int((singular > RANK).sum())
    return units, structure, rank - rank % 2  # of an antisymmetric matrix it is even


def _blocks(group: LieGroup) -> np.ndarray:
    """The number of the block of each component.  (dim,)"""
    return np.repeat(np.arange(len(group.unit_blocks)), group.unit_blocks)


def _block_sizes(group: LieGroup, mu: np.ndarray) -> np.ndarray:
    """For each component, the length of the part of mu with its unit.  (dim,)"""
    blocks = _blocks(group)
    sizes = [float(np.linalg.norm(mu[blocks == block])) for block in range(len(group.unit_blocks))]
    return np.array(sizes)[blocks]


def _unit_rows(rows: np.ndarray) -> np.ndarray:
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)
