"""Casimir functions of a group of matrices, found once from its generators."""

from __future__ import annotations

import numpy as np

from ..lie_algebra import LieAlgebra
from .matrix_basis import MatrixBasis
from .matrix_invariants import null_space

WRITTEN_OUT = 12
"""Dimension up to which all quadratic Casimirs are sought: the equations have dim (dim + 1)/2
unknowns.
"""

INDEPENDENT = 1e-9
"""A gradient counts as new if it sticks out of those before by more than this, relative to the
sizes of its terms.
"""

Found = tuple[list[np.ndarray], list[np.ndarray], tuple[int, ...], np.ndarray]


def casimir_polynomials(basis: MatrixBasis, algebra: LieAlgebra) -> Found:
    """Independent Casimirs: z . mu for z in the centre; mu . Q mu; powers k of tr(hat(F mu)^k), and
    F.

    z is left alone by ad; Q by ad on both sides, ad_xi Q + Q ad_xi^T = 0; F is the inverse of an
    invariant form of the algebra, so that hat(F mu) moves by conjugation when mu moves on its
    orbit.  Of complex matrices the odd powers give an imaginary part.  There are at most dim - (the
    dimension of the largest orbits) of them.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 14.3; Hall,
    Lie Groups, Lie Algebras, and Representations, 2nd ed., section 10.2 (the quadratic one).
    """
    none: Found = ([], [], (), np.zeros((0, 0)))
    if not basis.tabled:
        return none
    dim, c = basis.dim, basis.structure_constants  # [E_i, E_j] = c[k, i, j] E_k
    ad = c.transpose(1, 0, 2)  # ad[i][k, j]
    at = np.random.default_rng(1).normal(size=dim)
    structure = np.einsum("kij,k->ij", c, at)
    missing = dim - int(np.linalg.matrix_rank(structure, tol=1e-9 * max(1.0, np.abs(c).max())))
    gradients = np.zeros((0, dim))

    def is_new(gradient: np.ndarray, size: float) -> bool:
        nonlocal gradients
        remainder = gradient - (gradient @ gradients.T) @ gradients
        if len(gradients) >= missing or np.linalg.norm(remainder) <= INDEPENDENT * size:
            return False
        gradients = np.vstack([gradients, remainder / np.linalg.norm(remainder)])
        return True

    linear = [z for z in null_space(ad.reshape(-1, dim)) if is_new(z, float(np.linalg.norm(z)))]
    form = algebra.invariant_form
    from_form = np.zeros((0, 0)) if form is None else np.linalg.inv(form)
    quadratic = [q for q in _quadratic(ad, from_form) if is_new(q @ at, float(np.linalg.norm(q)))]
    powers = []
    for k in range(3, basis.n + 1 if len(from_form) else 3):
        m, directions = basis.hat(from_form @ at), basis.hat(from_form.T)
        slopes = np.einsum("ab,iba->i", np.linalg.matrix_power(m, k - 1), directions)
        size = float(np.linalg.norm(m)) ** (k - 1) * float(np.linalg.norm(directions))
        if is_new(slopes.imag if basis.complex and k % 2 else slopes.real, size):
            powers.append(k)
    return linear, quadratic, tuple(powers), from_form


def _quadratic(ad: np.ndarray, from_form: np.ndarray) -> list[np.ndarray]:
    """The invariant symmetric forms on momenta; in high dimensions only the inverse of that on the
    algebra.
    """
    dim = len(ad)
    if dim > WRITTEN_OUT:
        return [from_form] if len(from_form) else []
    i, j = np.triu_indices(dim)
    forms = np.zeros((len(i), dim, dim))
    forms[np.arange(len(i)), i, j] = forms[np.arange(len(i)), j, i] = 1.0
    moved = np.einsum("xab,pbc->pxac", ad, forms)
    equations = (moved + moved.swapaxes(-1, -2))[:, :, i, j].reshape(len(forms), -1).T
    return [
        np.einsum("p,pab->ab", weights, forms) for weights in null_space(np.asarray(np.linalg.qr(equations, mode="r")))
    ]
