"""The element of a group of matrices that is nearest to an array."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InvalidInput
from .matrix_basis import MatrixBasis

if TYPE_CHECKING:
    from .matrix_group import MatrixLieGroup

NEAR = 0.25
"""How far, relative to its size, an array may be from a group that is not orthogonal or unitary, to
have a nearest element.
"""

CLOSE = 0.1
"""An element this near, relative to the size of the array, is taken for the nearest one without
looking elsewhere.
"""

STARTS, TURN = 20, 128
"""How many elements anywhere are tried where no start leads to an element near by; points of a turn
at which one is looked for.
"""


def nearest(group: MatrixLieGroup, g: np.ndarray) -> np.ndarray:
    """The h of least |h - g|, in units where entries are of like sizes.  g : (n, n).  Raises
    InvalidInput.
    """
    laws, basis = group.invariants, group.generated.core
    g = group.generated.to_core(g)
    forms = laws.hermitian if basis.complex else laws.forms
    form = next((b for b in forms if np.linalg.cond(b) < 1e6), None)
    h: np.ndarray | None
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what overflows is refused below
        if basis.dim == basis.n**2 * (2 if basis.complex else 1):
            h = g  # all invertible matrices
        elif form is None or not _all_that_keep(basis, form, laws.determinant):
            h = _from_somewhere(basis, form, g)
        elif np.array_equal(form, np.eye(basis.n)):
            h = nearest_unitary(g, laws.determinant == "1" and not basis.complex)
            if h is not None and laws.determinant == "1":
                h = h * np.linalg.det(h) ** (-1.0 / basis.n)
            if basis.complex:
                h = _least_difference(basis, g, h)
        else:
            h = _least_difference(basis, g, _polar_factor(form, g))
        if h is not None and np.isfinite(h).all():
            h = group.generated.from_core(h)
            if group.objection(h) is None:
                return h
    raise InvalidInput(f"{basis.name}.nearest: the array is too far from the group to have a nearest element")


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
    least = sizes[-1] if not oriented else sizes[-2] + (-sizes[-1] if turned else sizes[-1]) if len(sizes) > 1 else 1.0
    if least <= len(g) * 2.0**-50 * sizes[0]:
        return None
    if turned:
        u[:, -1] *= -1.0
    return np.asarray(u @ v)


def _all_that_keep(basis: MatrixBasis, form: np.ndarray, determinant: str) -> bool:
    """Whether the group is that of all matrices which keep the form, up to the determinant."""
    n = basis.n
    if basis.complex:
        return basis.dim == n * n - (determinant == "1")
    return basis.dim == (n * (n - 1) if np.allclose(form, form.T) else n * (n + 1)) // 2


def _projected(basis: MatrixBasis, g: np.ndarray) -> np.ndarray:
    """exp of the part of log g in the algebra: an element of the group."""
    from scipy.linalg import expm, logm

    log_g = np.asarray(logm(g))
    return np.asarray(expm(basis.hat(basis.vee(log_g if basis.complex else log_g.real))))


def _from_somewhere(basis: MatrixBasis, form: np.ndarray | None, g: np.ndarray) -> np.ndarray | None:
    """The nearest element of a group that is known by its exponentials only, from a start that
    leads to one.

    Every start is a product of exponentials, and so is every step from it.
    """
    if not np.linalg.norm(g) < 1e100:
        return None
    near = g if form is None else _polar_factor(form, g)
    if near is None:
        return None
    rng = np.random.default_rng(3)
    best, least = None, np.inf
    for start in _starts(basis, near):
        h = _least_difference(basis, g, start)
        distance = np.inf if h is None else float(np.linalg.norm(h - g) / np.linalg.norm(g))
        if distance < least:
            best, least = h, distance
        if least <= CLOSE:
            return best
    for _ in range(STARTS if best is None else 0):
        best = _least_difference(basis, g, _anywhere(basis, rng))
        if best is not None:
            break
    return best


def _starts(basis: MatrixBasis, g: np.ndarray) -> Iterator[np.ndarray]:
    """Elements that may be near g: of its logarithm; of how it turns the algebra, beside what turns
    nothing.

    The logarithm of a matrix has eigenvalues up to pi, that in the algebra may have larger ones.
    Those of ad are differences of them, and often smaller.
    """
    yield _projected(basis, g)
    rng = np.random.default_rng(3)
    for aside in (0.0, 0.1) if basis.tabled else ():  # at half turns the logarithm has no direction
        away = _anywhere(basis, rng, aside)
        turned = _turning(basis, g @ away)
        if turned is not None:
            turned = turned @ np.linalg.inv(away)
            yield turned
            yield _along(basis, turned, g)


def _anywhere(basis: MatrixBasis, rng: np.random.Generator, share: float = 1.0) -> np.ndarray:
    """An element in no special direction, a share of about half a turn away from 1."""
    from scipy.linalg import expm

    x = basis.hat(rng.normal(size=basis.dim) / np.linalg.norm(basis.generators, axis=(1, 2)))
    return np.asarray(expm(share * np.pi * np.sqrt(basis.n / basis.dim) * x))


def _turning(basis: MatrixBasis, g: np.ndarray) -> np.ndarray | None:
    """exp(x) that acts on the algebra as g does, exp(ad_x) y = g y g^-1; None if nothing does."""
    from scipy.linalg import expm, logm

    moved = basis.vee(g @ basis.generators @ np.linalg.inv(g)).T
    if not np.isfinite(moved).all():
        return None
    log_moved, ad = np.asarray(logm(moved)).real, basis.structure_constants.transpose(1, 0, 2)
    x, *_ = np.linalg.lstsq(ad.reshape(basis.dim, -1).T, log_moved.ravel(), rcond=None)
    turn = expm(basis.hat(x))
    return turn if np.isfinite(turn).all() else None


def _along(basis: MatrixBasis, h: np.ndarray, g: np.ndarray) -> np.ndarray:
    """The h exp(s E_i) closest to g, over all generators and one turn of the slowest part of each."""
    from scipy.linalg import expm

    best, least = h, np.inf
    for e in basis.generators:
        rates = np.abs(np.linalg.eigvals(e).imag)
        turning = rates[rates > np.finfo(float).eps ** 0.25 * rates.max(initial=0.0)]
        if not len(turning):
            continue
        part = expm(2.0 * np.pi / (turning.min() * TURN) * e)
        candidate = h
        for _ in range(TURN):
            candidate = candidate @ part
            distance = float(np.linalg.norm(candidate - g))
            if distance < least:
                best, least = candidate, distance
    return best


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
        xi, *_ = np.linalg.lstsq(_reals(h @ basis.generators).T, _reals((g - h)[None])[0], rcond=None)
        step = float(np.linalg.norm(basis.hat(xi)))
        h = h @ expm(basis.hat(xi * min(1.0, 1.0 / max(step, 1e-300))))
        if step <= 1e-13 * float(np.linalg.norm(h)):
            return np.asarray(h) if np.linalg.norm(h - g) <= NEAR * np.linalg.norm(g) else None
    return None


def _reals(matrices: np.ndarray) -> np.ndarray:
    flat = matrices.reshape(len(matrices), -1)
    return np.concatenate([flat.real, flat.imag], axis=1) if np.iscomplexobj(flat) else flat
