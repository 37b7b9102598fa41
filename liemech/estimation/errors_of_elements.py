"""The error of an estimate on a group, and derivatives with respect to it.

With the estimate m of an element x, the error e is a velocity, (dim,):

    left:   x = m exp(e),    e = log(m^-1 x)      (seen from the body)
    right:  x = exp(e) m,    e = log(x m^-1)      (seen from space)

Both describe the same element, e_right = Ad_m e_left.  (Barrau and Bonnabel write the inverse, eta =
x^-1 m; its logarithm is -e.)

Source: Barrau and Bonnabel, IEEE Trans. Autom. Control 62 (2017), section II; Sola, Deray, Atchuthan,
A micro Lie theory for state estimation in robotics (2018), section II.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import InvalidInput
from ..formulas import Mat, Vec, derivative, identity_matrix, mat, transpose, vec
from ..formulas.derivatives import axes

SIDES = "left", "right"


def check_side(where: str, side: Any) -> None:
    """Refuse what is neither "left" nor "right"."""
    if side not in SIDES:
        raise InvalidInput(
            f'{where}: side is "left", the error seen from the body, or "right", seen from space; got {side!r}'
        )


def moved(group: Any, side: str, m: Any, e: Vec) -> Any:
    """The element with the error e from m.  e : (dim,)."""
    return group.compose_exp(m, e) if side == "left" else group.compose(group.exp(e), m)


def error(group: Any, side: str, m: Any, x: Any) -> Vec:
    """The error of m, where x is the truth."""
    if side == "left":
        return group.log(group.compose(group.inverse(m), x))
    return group.log(group.compose(x, group.inverse(m)))


def velocity(group: Any, side: str, g: Any, rate: Any) -> Vec:
    """The error that grows in unit time where g moves with a rate g'."""
    xi = group.body_velocity(g, rate)
    return xi if side == "left" else group.Ad(g, xi)


def by_error(group: Any, side: str, m: Any, formula: Callable[[Any], Any]) -> list[Any]:
    """The derivatives of a formula of an element by each component of the error at m."""
    zero = vec(*[0.0] * group.dim)
    return [derivative(lambda e: formula(moved(group, side, m, e)), zero, d) for d in axes(zero)]


def transition(group: Any, side: str, m: Any, f: Callable[[Any], Any], there: Any) -> Mat:
    """The matrix F with e' = F e to first order, of a map f of the group with f(m) = there: the
    differential of the map itself, trivialised on this side at both ends.
    """
    rates = by_error(group, side, m, f)
    return transpose(mat(*[velocity(group, side, there, rate) for rate in rates]))


def transported(group: Any, side: str, e: Vec, P: Mat) -> Mat:
    """The covariance of errors from the estimate moved by e: J P J^T with J = dexp_e, as
    exp(e + d) = exp(e) exp(J d) on the left, exp(J d) exp(e) on the right.
    """
    J = transpose(mat(*[group.dexp(e, unit, side) for unit in identity_matrix(group.dim)]))
    return symmetric(J @ P @ J.T)


def symmetric(P: Mat) -> Mat:
    """(P + P^T)/2: rounding does not make a covariance lopsided."""
    return 0.5 * (P + P.T)


def squares(a: Mat) -> Mat:
    """The symmetric product a a^T, (n, n)."""
    return a @ a.T
