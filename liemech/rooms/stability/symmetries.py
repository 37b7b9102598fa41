"""The momenta that a motion keeps, found from its equations.

A momentum J_c = sum_k c_k J_k stands still if sum_k c_k J_k'(z) = 0 at all states z: at random ones these are linear
equations for c.  What they are derivatives along, J_k' = dJ_k(field), is the bracket {J_k, H}.

Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 11.4 (Noether's theorem).
"""

from __future__ import annotations

import numpy as np

from ...formulas import vec
from .near_a_state import NearState, largest_of_blocks

STATES = 6
"""At so many more random states than there are unknown coefficients the momenta are looked at."""

NEARER = 40.0
"""By up to so many powers of two these states are nearer to the origin, where small parts of forces are large, if there
are other factors than vectors.
"""

STILL = 1e-9
"""Beside how large its terms are, the rate of a momentum that is kept."""


def kept_momenta(near: NearState, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The coefficients, (m, k), of k independent momenta that stand still at all states, and how much these change on
    displacements of such sizes at the most, (k,).

    sizes : of displacements, (2 dim,): the random states are so far away.
    """
    blocks = (*near.group.unit_blocks, *near.group.unit_blocks)
    rng, values, rates, terms, slopes_of_all = np.random.default_rng(2), [], [], [], []
    for _ in range(len(near.momenta(near.here)) + STATES):
        z = sizes * rng.uniform(-0.5, 0.5, len(sizes))
        if not near.only_adds:  # on a far orbit the torque of a planet is lost beside the momentum
            nearer = 2.0 ** -rng.uniform(0.0, NEARER)
            for place, x in near.vectors(near.g):
                z[place] = nearer * z[place] - (1.0 - nearer) * x
        other = near.moved(z)
        field, slopes = np.asarray(other.field(near.here)), momentum_slopes(other)
        size = np.abs(slopes) @ np.repeat(largest_of_blocks(field, blocks), blocks)
        values.append(np.asarray(other.momenta(near.here)))
        slopes_of_all.append(slopes * sizes)
        rates.append(slopes @ field / (size.max() or 1.0))
        terms.append(size / (size.max() or 1.0))
    # of functions that are alike, such as left and right translations of an abelian factor, one
    by_size = nonzero(np.abs(values).max(axis=0))
    _, order, rank = pivoted(np.array(values) / by_size)
    different, unit = order[:rank], nonzero(np.max(terms, axis=0))
    _, singular, rows = np.linalg.svd((np.array(rates) / unit)[:, different])
    still = rows[int((singular > STILL).sum()) :].T
    coefficients = np.zeros((len(unit), still.shape[1]))
    coefficients[different] = still / unit[different, None]
    coefficients /= nonzero(np.abs(values @ coefficients).max(axis=0))
    return coefficients, np.abs(coefficients.T @ np.array(slopes_of_all)).max(axis=(0, 2), initial=0.0)


def changing(near: NearState, sizes: np.ndarray, conserved: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """The coefficients of kept momenta, zero of those that are stationary at the state, as angular momentum is where all
    is at rest at the origin: what is left of its slope is rounding.
    changes : of `kept_momenta`, for displacements of these sizes.
    """
    slopes = np.abs(conserved.T @ momentum_slopes(near) * sizes).max(axis=1, initial=0.0)
    return conserved * (slopes > STILL * changes)


def momentum_slopes(near: NearState) -> np.ndarray:
    """dJ_k at the state, (m, 2 dim): Omega^T of the motions that the momenta generate."""
    m = len(near.momenta(near.here))
    generated = [near.generated(vec(*unit), near.here) for unit in np.eye(m).tolist()]
    return np.array([np.asarray(z) for z in generated]) @ near.two_form()


def nonzero(sizes: np.ndarray) -> np.ndarray:
    """The sizes, 1 for those that are zero."""
    return np.where(sizes == 0.0, 1.0, sizes)


def null_space(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A basis of the null space, in columns, and the components that are free: a vector of the null space has these as
    its coordinates.  a : (m, n), rows of sizes near one.
    """
    from scipy.linalg import solve_triangular

    R, order, rank = pivoted(a)
    basis = np.zeros((len(order), len(order) - rank))
    basis[order[rank:]] = np.eye(len(order) - rank)
    basis[order[:rank]] = -solve_triangular(R[:rank, :rank], R[:rank, rank:])
    return basis, order[rank:]


def pivoted(a: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """R, the order of the columns, and the rank, of a matrix with entries near one."""
    from scipy.linalg import qr

    R, order = qr(a, mode="r", pivoting=True)
    return R, order, int((np.abs(np.diagonal(R)) > STILL).sum())
