"""Beliefs about a state: an element and the covariance of its error."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import real_array, shown
from ..formulas.classes.frozen import frozen
from ..formulas.classes.remembered import Remembered
from ..groups.lie_group import LieGroup
from .block_tridiagonal import require_digits
from .errors_of_elements import check_side, error


@frozen(eq=False)
class Belief:
    """An estimate on a group: x = g exp(e), or x = exp(e) g with side="right", and e normally
    distributed with mean zero.

    g : an element.  covariance : (dim, dim) of e.  Ensembles have leading axes.
    nis : the squared innovation r . S^-1 r of the last update; None before one.
    accepted : did it pass the gate?

    Source: Barfoot, State Estimation for Robotics (2017), section 7.3.
    """

    group: LieGroup
    g: Any
    covariance: Any
    side: str = "left"
    nis: Any = None
    accepted: Any = None

    def seen_from(self, side: str) -> Belief:
        """This belief with its error on the given side: e_right = Ad_g e_left, P_right = Ad_g P Ad_g^T."""
        check_side("Belief.seen_from", side)
        if side == self.side:
            return self
        g = self.g if side == "right" else self.group.inverse(self.g)
        A = self.group.Ad_matrix(g)
        P = A @ self.covariance @ np.swapaxes(A, -1, -2)
        belief = Belief(self.group, self.g, P, side, self.nis, self.accepted)
        return vouched(belief) if is_vouched(self) else belief

    def error(self, x: Any) -> Any:
        """The error of this estimate, (..., dim), where x is the truth."""
        return error(self.group, self.side, self.g, x)

    def nees(self, x: Any) -> Any:
        """The squared error e . P^-1 e, where x is the truth: of a consistent filter it is distributed
        like chi-square with dim degrees of freedom.  Raises InvalidInput for a covariance that is singular.
        """
        e, P = np.asarray(self.error(x)), np.asarray(self.covariance)
        try:
            root = np.linalg.cholesky(P)
            require_digits(np.diagonal(root, axis1=-2, axis2=-1), self.deviations**2)
        except np.linalg.LinAlgError:
            raise InvalidInput(
                "Belief.nees: the covariance is singular: an error along a direction of no variance has no square in its "
                "units. Give the belief and the noise of the process some variance along each"
            ) from None
        solved = np.linalg.solve(root, e[..., None])[..., 0]
        squared = np.einsum("...i,...i->...", solved, solved)
        return squared if squared.ndim else float(squared)

    @property
    def deviations(self) -> np.ndarray:
        """The standard deviations of the components of e, (..., dim)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


def checked(where: str, group: LieGroup, g: Any, covariance: Any, side: str) -> Belief:
    """A belief, its arrays looked at: g is an element, the covariance symmetric and not negative.

    covariance : (dim, dim), or (dim,) standard deviations.  Raises InvalidInput.
    """
    check_side(where, side)
    element = np.array(real_array(g, f"{where}: g", group.is_complex))
    shape = group.element_shape
    lead = element.shape[: element.ndim - len(shape)]
    if element.shape != lead + shape:
        raise InvalidInput(f"{where}: g has shape {element.shape}; its last axes must be {shape}")
    outside = np.argwhere(np.logical_not(group.contains(element)))
    if len(outside):
        at = tuple(outside[0].tolist()) if lead else ()
        reason = group.objection(element[at])
        raise InvalidInput(f"{where}: g{[*at] or ''} is not in {group!r}: {reason}")
    P = real_array(covariance, f"{where}: covariance")
    if P.ndim == 1 and P.shape == (group.dim,):
        P = np.diag(P * P)
    if P.shape[-2:] != (group.dim, group.dim):
        raise InvalidInput(
            f"{where}: covariance has shape {P.shape}; it must be ({group.dim}, {group.dim}), or "
            f"({group.dim},) standard deviations"
        )
    if not np.isfinite(P).all():
        raise InvalidInput(f"{where}: covariance must be finite; got {shown(P)}")
    # in units in which the variances are 1
    scale = np.sqrt(np.abs(np.diagonal(P, axis1=-2, axis2=-1)))
    scale = np.where(scale > 0.0, scale, 1.0)
    Q = P / scale[..., :, None] / scale[..., None, :]
    if np.abs(Q - np.swapaxes(Q, -1, -2)).max() > ROUNDING:
        raise InvalidInput(f"{where}: covariance P must be symmetric, such as (P + P.T)/2; got {shown(P)}")
    least = np.linalg.eigvalsh(Q).min()
    if least < -ROUNDING:
        raise InvalidInput(
            f"{where}: covariance has the negative eigenvalue {least:.1e} (in units in which the variances are 1)"
        )
    return vouched(Belief(group, element, np.broadcast_to(P.copy(), (*lead, group.dim, group.dim)), side))


_vouched = Remembered()
"""Beliefs whose arrays have been checked, or are those of a filter."""


def vouched(belief: Belief) -> Belief:
    """The belief, noted as one whose arrays need no check."""
    _vouched.set(belief, True)
    return belief


def is_vouched(belief: Belief) -> bool:
    """Need its arrays no check?"""
    return _vouched.get(belief) is not None


ROUNDING = 1e-9
"""Asymmetry and negative eigenvalues of a correlation matrix that are rounding errors."""
