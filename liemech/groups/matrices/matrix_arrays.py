"""The maps of a group of large matrices on arrays, through NumPy and SciPy: what formulas would be
too long for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InvalidInput
from ...formulas.calls.batches import MEMBERSHIP
from .matrix_basis import MatrixBasis
from .matrix_invariants import objections

if TYPE_CHECKING:
    from .matrix_algebra import MatrixLieAlgebra
    from .matrix_group import MatrixLieGroup


def of_group(group: MatrixLieGroup, method: str, arguments: dict[str, Any]) -> Any:
    """The value of a group's method, for arrays whose first axis is the batch; None if it is not
    here.
    """
    basis, unit = group.generated, np.eye(group.generated.n)
    match method, *arguments.values():
        case "compose", g, h:
            return g @ h
        case "inverse", g:
            return _inverse(group, g)
        case "Ad", g, xi:
            return basis.vee(g @ basis.hat(xi) @ _inverse(group, g))
        case "Ad_star", g, mu:
            return _coadjoint(basis, g, _inverse(group, g), mu)
        case "K", g, mu:
            return _coadjoint(basis, _inverse(group, g), g, mu)
        case (("ad" | "ad_star" | "dexp" | "dexp_inv" | "exp_Ad_star"), *_):
            return of_algebra(group.algebra, method, arguments)
        case "exp", xi:
            return _exp(basis, xi)
        case "compose_exp", g, xi:
            return g @ _exp(basis, xi)
        case "log", g:
            return log(basis, g)
        case "distance", g, h:
            return np.linalg.norm(log(basis, _inverse(group, g) @ h), axis=-1)
        case "cayley", xi if basis.without_cayley is None:
            return _cayley(basis, xi)
        case "compose_cayley", g, xi if basis.without_cayley is None:
            return g @ _cayley(basis, xi)
        case "cayley_inv", g if basis.without_cayley is None:
            return basis.vee(2.0 * np.linalg.solve(g + unit, g - unit))
        case "casimirs", mu:
            return casimirs(group, mu)
        case "defect", g:
            return _defects(group, g)
        case "contains", g:
            return _defects(group, g) <= MEMBERSHIP
    return None


def of_algebra(algebra: MatrixLieAlgebra, method: str, arguments: dict[str, Any]) -> Any:
    """The value of an algebra's method, for arrays whose first axis is the batch; None if it is not
    here.

    Source: Higham, Functions of Matrices (2008), theorem 3.6 (the differential of exp from a block
    matrix).
    """
    basis, unit = algebra.generated, np.eye(algebra.generated.n)
    operands = list(arguments.values())
    if method.startswith(("dexp", "dcayley")) and arguments.get("side") != "right":
        operands[0] = -operands[0]  # below stand the right-trivialised ones
    match method, *operands:
        case "hat", xi:
            return basis.hat(xi)
        case "vee", matrix:
            return basis.vee(matrix)
        case "covector", mu:
            return basis.covector(mu)
        case "pairing", matrix:
            return basis.pairing(matrix)
        case (("bracket" | "ad"), xi, eta):
            x, y = basis.hat(xi), basis.hat(eta)
            return basis.vee(x @ y - y @ x)
        case "ad_star", xi, mu:
            x, m = _star(basis.hat(xi)), basis.covector(mu)
            return basis.pairing(x @ m - m @ x)
        case "exp_Ad_star", xi, mu:
            return _coadjoint(basis, _exp(basis, xi), _exp(basis, -xi), mu)
        case "dexp", xi, eta, *_:
            return basis.vee(_phi(basis.hat(xi), basis.hat(eta)))
        case "dexp_dual", xi, mu, *_:
            return basis.pairing(_phi(_star(basis.hat(xi)), basis.covector(mu)))
        case "dexp_inv", xi, eta, *_:
            return basis.vee(_phi_inverse(basis.hat(xi), basis.hat(eta)))
        case "dexp_inv_dual", xi, mu, *_:
            return basis.pairing(_phi_inverse(_star(basis.hat(xi)), basis.covector(mu)))
    if basis.without_cayley is not None:
        return None
    match method, *operands:
        case "dcayley", xi, eta, *_:
            half = 0.5 * basis.hat(xi)
            back = np.linalg.inv(unit + half)
            return basis.vee(np.linalg.solve(unit - half, basis.hat(eta)) @ back)
        case "dcayley_inv", xi, eta, *_:
            half = 0.5 * basis.hat(xi)
            return basis.vee((unit - half) @ basis.hat(eta) @ (unit + half))
        case "dcayley_inv_dual", xi, mu, *_:
            half = 0.5 * _star(basis.hat(xi))
            return basis.pairing((unit - half) @ basis.covector(mu) @ (unit + half))
        case "dcayley_dual", xi, mu, *_:
            half = 0.5 * _star(basis.hat(xi))
            back = np.linalg.inv(unit + half)
            return basis.pairing(np.linalg.solve(unit - half, basis.covector(mu)) @ back)
        case "cayley_Ad_star", xi, mu:
            return _coadjoint(basis, _cayley(basis, xi), _cayley(basis, -xi), mu)
    return None


def casimirs(group: MatrixLieGroup, mu: np.ndarray) -> np.ndarray:
    """The Casimir functions of momenta, (samples, dim); of groups that are given by generators alone
    none are looked for.
    """
    if not hasattr(group, "_casimirs_of"):
        return np.zeros((len(mu), 0))
    return group._casimirs_of(group.generated.covector(mu))


def _cayley(basis: MatrixBasis, xi: np.ndarray) -> np.ndarray:
    half, unit = 0.5 * basis.hat(xi), np.eye(basis.n)
    return np.linalg.solve(unit - half, unit + half)


def _star(m: np.ndarray) -> np.ndarray:
    return np.conj(m).swapaxes(-1, -2)


def _inverse(group: MatrixLieGroup, g: np.ndarray) -> np.ndarray:
    if group._form is None:
        return np.linalg.inv(g)
    signs = np.array(group._form)
    return signs[:, None] * _star(g) * signs


def _coadjoint(basis: MatrixBasis, g: np.ndarray, back: np.ndarray, mu: np.ndarray) -> np.ndarray:
    return basis.pairing(_star(g) @ basis.covector(mu) @ _star(back))


def _exp(basis: MatrixBasis, xi: np.ndarray) -> np.ndarray:
    from scipy.linalg import expm

    return expm(basis.hat(xi))


def _phi(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """phi_1(ad_x) y: the upper right block of exp [[x, y], [0, x]], times exp(-x)."""
    from scipy.linalg import expm

    n = x.shape[-1]
    block = np.zeros((*x.shape[:-2], 2 * n, 2 * n), dtype=x.dtype)
    block[..., :n, :n] = block[..., n:, n:] = x
    block[..., :n, n:] = y
    return expm(block)[..., :n, n:] @ expm(-x)


def _phi_inverse(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """ad_x/(exp(ad_x) - 1) y, by the eigenvalues of x, differences of which are those of ad_x."""
    values, vectors = np.linalg.eig(x)
    z = values[..., :, None] - values[..., None, :]
    if np.linalg.cond(vectors).max() > 1e8:
        return _phi_inverse_series(x, y)
    with np.errstate(all="ignore"):
        factor = np.where(z == 0.0, 1.0, z / np.expm1(z))
    z_of_y = vectors @ (factor * np.linalg.solve(vectors, y @ vectors)) @ np.linalg.inv(vectors)
    return z_of_y if np.iscomplexobj(x) else z_of_y.real


def _phi_inverse_series(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """`_phi_inverse` of a matrix without a basis of eigenvectors, by the solution of phi_1(ad_x) z = y
    from z = y on.
    """
    z = y
    for _ in range(200):
        residual = y - _phi(x, z)
        z = z + residual
        if np.linalg.norm(residual) <= 1e-15 * np.linalg.norm(y):
            return z
    raise InvalidInput("dexp_inv: xi is too large for a matrix without a basis of eigenvectors")


def log(basis: MatrixBasis, g: np.ndarray) -> np.ndarray:
    """The principal logarithm of each matrix, in the algebra.  g : (bodies, n, n).  Raises
    InvalidInput.
    """
    from scipy.linalg import logm

    logs = np.array([logm(m) for m in g])
    xi = basis.vee(logs if basis.complex else logs.real)
    off = np.linalg.norm(logs - basis.hat(xi), axis=(1, 2)) > 1e-6 * (1.0 + np.linalg.norm(logs, axis=(1, 2)))
    if off.any() or not np.isfinite(logs).all():
        raise InvalidInput(f"{basis.name}.log: the element has no principal logarithm in the algebra")
    return xi


def _defects(group: MatrixLieGroup, g: np.ndarray) -> np.ndarray:
    basis = group.generated
    return np.array(
        [max(d for d, _ in [(0.0, ""), *objections(group.invariants, basis.core, m)]) for m in basis.to_core(g)]
    )
