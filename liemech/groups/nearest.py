"""The element of a group of matrices that is nearest to an array."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InvalidInput
from .matrix_basis import MatrixBasis

if TYPE_CHECKING:
    from .matrix_group import MatrixLieGroup

NEAR = 0.25
"""How far, relative to its size, an array may be from a group that is not orthogonal or unitary, to
have a nearest element.
"""


def nearest(group: MatrixLieGroup, g: np.ndarray) -> np.ndarray:
    """The h of least |h - g|.  g : (n, n).  Raises InvalidInput."""
    laws, basis = group.invariants, group.generated
    forms = laws.hermitian if basis.complex else laws.forms
    form = next((b for b in forms if np.linalg.cond(b) < 1e6), None)
    h: np.ndarray | None
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what overflows is refused below
        if basis.dim == basis.n**2 * (2 if basis.complex else 1):
            h = g  # all invertible matrices
        elif form is not None and np.array_equal(form, np.eye(basis.n)):
            h = nearest_unitary(g, laws.determinant == "1" and not basis.complex)
            if h is not None and laws.determinant == "1":
                h = h * np.linalg.det(h) ** (-1.0 / basis.n)
            # a subgroup of all unitary matrices
            if basis.complex or (h is not None and group.objection(h) is not None):
                h = _least_difference(basis, g, h)
        else:
            h = _least_difference(basis, g, _start(basis, form, g))
        if h is not None and np.isfinite(h).all() and group.objection(h) is None:
            return h
    raise InvalidInput(
        f"{basis.name}.nearest: the array is too far from the group to have a nearest element"
    )


def nearest_unitary(g: np.ndarray, oriented: bool) -> np.ndarray | None:
    """The unitary or orthogonal matrix of least |h - g|, of determinant 1 if oriented.  None if
    there are several.  g : (n, n).

    Source: Higham, Functions of Matrices (2008), theorem 8.4; Kabsch, Acta Crystallographica A32
    (1976), for the orientation.
    """
    size = float(np.abs(g).max())
    if not 0.0 < size < np.inf:
        return None
    u, sizes, v = np.linalg.svd(g / size)
    turned = oriented and np.linalg.det(u) * np.linalg.det(v) < 0.0
    least = (
        sizes[-1]
        if not oriented
        else sizes[-2] + (-sizes[-1] if turned else sizes[-1])
        if len(sizes) > 1
        else 1.0
    )
    if least <= len(g) * 2.0**-50 * sizes[0]:
        return None
    if turned:
        u[:, -1] *= -1.0
    return np.asarray(u @ v)


def _start(basis: MatrixBasis, form: np.ndarray | None, g: np.ndarray) -> np.ndarray | None:
    """An element near g: the polar factor of the form that the group keeps; without one exp(log g),
    the logarithm projected.
    """
    if not np.linalg.norm(g) < 1e100:
        return None
    if form is not None:
        return _polar_factor(form, g)
    from scipy.linalg import expm, logm

    log_g = np.asarray(logm(g))
    return np.asarray(expm(basis.hat(basis.vee(log_g if basis.complex else log_g.real))))


def _polar_factor(form: np.ndarray, g: np.ndarray) -> np.ndarray | None:
    """g (g* g)^-1/2 with the adjoint g* = B^-1 g^H B of the form B, by Newton's iteration x <-
    (x + (x*)^-1)/2.

    Source: Higham, Mackey, Mackey and Tisseur, SIAM J. Matrix Anal. Appl. 25 (2004), 1178.
    """
    x, back = g, np.linalg.inv(form)
    for _ in range(60):
        try:
            following = 0.5 * (x + np.linalg.inv(back @ np.conj(x).T @ form))
        except np.linalg.LinAlgError:
            return None
        moved = float(np.linalg.norm(following - x))
        x = following
        if moved <= 1e-9 * float(np.linalg.norm(x)):  # it converges quadratically
            return x
    return None


def _least_difference(basis: MatrixBasis, g: np.ndarray, h: np.ndarray | None) -> np.ndarray | None:
    """From h on, by Gauss-Newton steps h exp(d), |h (1 + d) - g| = min; None if that ends farther
    from g than |g|/4.

    Source: Absil, Mahony, Sepulchre, Optimization Algorithms on Matrix Manifolds (2008), section
    8.4.
    """
    from scipy.linalg import expm

    for _ in range(60):
        if h is None or not np.isfinite(h).all():
            return None
        xi, *_ = np.linalg.lstsq(
            _reals(h @ basis.generators).T, _reals((g - h)[None])[0], rcond=None
        )
        step = float(np.linalg.norm(basis.hat(xi)))
        h = h @ expm(basis.hat(xi * min(1.0, 1.0 / max(step, 1e-300))))
        if step <= 1e-13 * float(np.linalg.norm(h)):
            return np.asarray(h) if np.linalg.norm(h - g) <= NEAR * np.linalg.norm(g) else None
    return None


def _reals(matrices: np.ndarray) -> np.ndarray:
    flat = matrices.reshape(len(matrices), -1)
    return np.concatenate([flat.real, flat.imag], axis=1) if np.iscomplexobj(flat) else flat
