"""Representations: groups acting linearly on a vector space, and on its dual."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..errors import InvalidInput, require, undefined
from ..formulas import Element, Vec, cross, derivative, dot, identity_matrix, mat, record, solve, vec, vectors, where
from ..formulas.classes.derived import derived, derived_from
from ..formulas.numbers.dual import value_of
from ..formulas.numbers.sizes import one_norm
from .group_action import GroupAction
from .lie_group import LieGroup
from .matrices.matrix_functions import digits
from .rigid.so3 import SO3
from .rigid.unit_quaternions import UnitQuaternions

INFINITY, NAN = float("inf"), float("nan")

MOST = 60.0
"""How often a series is halved: no digit of an angle beyond 2^60 is known, and none of the sum."""


@record
class Representation(GroupAction):
    """A linear action of a group on R^k, g . (a x + b y) = a g . x + b g . y; covectors, of shape
    (k,) too, are named `p`.

    1. A subclass writes `space_dim` (k) and `act`.
    2. It may add closed forms for `infinitesimal`, `exp_act`, the average `phi1`, and their duals.
    3. The rest follows.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 9.3 and
    12.1; Cendra, Holm, Marsden and Ratiu, Lagrangian reduction, the Euler-Poincare equations, and
    semidirect products, AMS Transl. 186 (1998).
    """

    @property
    def space_dim(self) -> int:
        """The dimension k of the space."""
        raise undefined(self, "space_dim")

    @property
    def point_shape(self) -> tuple[int, ...]:
        """The shape of points of the vector space, (k,)."""
        return (self.space_dim,)

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @derived
    def act_dual(self, g: Element, p: Vec) -> Vec:
        """The dual map, <act_dual_g p, x> = <p, g . x>: a right action on covectors.  g : an
        element, p : (k,).
        """
        return vec(*[dot(p, self.act(g, unit)) for unit in identity_matrix(self.space_dim)])

    @derived
    def infinitesimal_dual(self, xi: Vec, p: Vec) -> Vec:
        """The dual of `infinitesimal`.  xi : (dim,), p : (k,)."""
        return vec(*[dot(p, self.infinitesimal(xi, unit)) for unit in identity_matrix(self.space_dim)])

    @derived
    def exp_act_dual(self, xi: Vec, p: Vec) -> Vec:
        """act_dual of exp(xi).  xi : (dim,), p : (k,)."""
        return self.act_dual(self.group.exp(xi), p)

    @derived
    def momentum(self, x: Vec, p: Vec) -> Vec:
        """The momentum map J(x, p) of the action: <J, xi> = <p, xi . x>.  For rotations the angular
        momentum x x p.

        x, p : (k,);  returns (dim,).
        """
        return vec(*[dot(p, self.infinitesimal(unit, x)) for unit in identity_matrix(self.group.dim)])

    @derived
    def phi1(self, xi: Vec, x: Vec) -> Vec:
        """The average of exp(s xi) . x over 0 <= s <= 1, sum_k xi^k . x/(k + 1)!.  xi : (dim,),
        x : (k,).

        For large xi from its half, phi1(xi) = (1 + exp(xi/2)) phi1(xi/2)/2.
        """
        return averaged(self.infinitesimal, self.exp_act, self._size2(xi), xi, x)

    @derived
    def phi1_dual(self, xi: Vec, p: Vec) -> Vec:
        """The dual of `phi1`.  xi : (dim,), p : (k,)."""
        return averaged(self.infinitesimal_dual, self.exp_act_dual, self._size2(xi), xi, p)

    @derived
    def phi1_inv(self, xi: Vec, x: Vec) -> Vec:
        """The inverse of `phi1`.  xi : (dim,), x : (k,)."""
        return solve(mat(*[self.phi1(xi, unit) for unit in identity_matrix(self.space_dim)]).T, x)

    @derived
    def phi1_inv_dual(self, xi: Vec, p: Vec) -> Vec:
        """The dual of `phi1_inv`.  xi : (dim,), p : (k,)."""
        return solve(mat(*[self.phi1(xi, unit) for unit in identity_matrix(self.space_dim)]), p)

    def why_no_cayley(self) -> str | None:
        """Why the Cayley map of the group is not that of the matrices of the representation; None
        if it is.
        """
        return self.group.why_no_cayley() or f"cay(xi) does not act as (1 - xi/2)^-1 (1 + xi/2) in {self!r}"

    @derived
    def half_inverse(self, xi: Vec, x: Vec) -> Vec:
        """(1 - xi/2)^-1 x, with the matrix of xi.  xi : (dim,), x : (k,)."""
        units = identity_matrix(self.space_dim)
        return solve(mat(*[unit - 0.5 * self.infinitesimal(xi, unit) for unit in units]).T, x)

    @derived
    def half_inverse_dual(self, xi: Vec, p: Vec) -> Vec:
        """The dual of `half_inverse`.  xi : (dim,), p : (k,)."""
        units = identity_matrix(self.space_dim)
        return solve(mat(*[unit - 0.5 * self.infinitesimal(xi, unit) for unit in units]), p)

    @derived_from("act")
    def invariants(self, mu: Vec, p: Vec) -> Vec:
        """Casimir functions of the semidirect product with the space; none known by default.
        mu : (dim,), p : (k,).
        """
        return vec()

    def _size2(self, xi: Vec) -> float:
        """The sum of the squared entries of the matrix of xi.  xi : (dim,)."""
        return squares([self.infinitesimal(xi, unit) for unit in identity_matrix(self.space_dim)])

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return self.point_shape if argument == "p" else super()._shape(argument, kind)


@record
class LinearAction(Representation):
    """A group of real matrices multiplying vectors, g . x = g x.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., section 4.2 (the standard
    representation).
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.group.element_shape) != 2 or self.group.is_complex:
            what = "complex" if self.group.is_complex else "vectors"
            raise InvalidInput(
                f"LinearAction: the elements of {self.group!r} are {what}, not real matrices; "
                "write a Representation of your own"
            )

    @property
    def space_dim(self) -> int:
        return self.group.element_shape[0]

    def act(self, g: Element, x: Vec) -> Vec:
        """g x.  g : an element (k, k), x : (k,)."""
        return g @ x

    def act_dual(self, g: Element, p: Vec) -> Vec:
        """g^T p.  g : an element (k, k), p : (k,)."""
        return p @ g

    def infinitesimal(self, xi: Vec, x: Vec) -> Vec:
        """hat(xi) x.  xi : (dim,), x : (k,)."""
        return self.group.algebra.hat(xi) @ x

    def infinitesimal_dual(self, xi: Vec, p: Vec) -> Vec:
        """hat(xi)^T p.  xi : (dim,), p : (k,)."""
        return p @ self.group.algebra.hat(xi)

    def why_no_cayley(self) -> str | None:
        return self.group.why_no_cayley()


@record
class AdjointAction(Representation):
    """A group acting on its algebra, g . x = Ad_g x: every map is one of the group.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.1.
    """

    @property
    def space_dim(self) -> int:
        return self.group.dim

    def act(self, g: Element, x: Vec) -> Vec:
        """Ad_g x.  g : an element, x : (dim,)."""
        return self.group.Ad(g, x)

    def act_dual(self, g: Element, p: Vec) -> Vec:
        """Ad*_g p.  g : an element, p : (dim,)."""
        return self.group.Ad_star(g, p)

    def infinitesimal(self, xi: Vec, x: Vec) -> Vec:
        """[xi, x].  xi, x : (dim,)."""
        return self.group.ad(xi, x)

    def infinitesimal_dual(self, xi: Vec, p: Vec) -> Vec:
        """ad*_xi p.  xi, p : (dim,)."""
        return self.group.ad_star(xi, p)

    def exp_act_dual(self, xi: Vec, p: Vec) -> Vec:
        """Ad*_exp(xi) p.  xi, p : (dim,)."""
        return self.group.exp_Ad_star(xi, p)

    def momentum(self, x: Vec, p: Vec) -> Vec:
        """-ad*_x p.  x, p : (dim,)."""
        return -self.group.ad_star(x, p)

    def phi1(self, xi: Vec, x: Vec) -> Vec:
        """dexp_xi x, right-trivialised.  xi, x : (dim,)."""
        return self.group.dexp(xi, x, side="right")

    def phi1_dual(self, xi: Vec, p: Vec) -> Vec:
        """dexp_xi* p, right-trivialised.  xi, p : (dim,)."""
        return self.group.algebra.dexp_dual(-xi, p)

    def phi1_inv(self, xi: Vec, x: Vec) -> Vec:
        """dexp_xi^-1 x, right-trivialised.  xi, x : (dim,)."""
        return self.group.dexp_inv(xi, x, side="right")

    def phi1_inv_dual(self, xi: Vec, p: Vec) -> Vec:
        """(dexp_xi^-1)* p, right-trivialised.  xi, p : (dim,)."""
        return self.group.algebra.dexp_inv_dual(-xi, p)

    def invariants(self, mu: Vec, p: Vec) -> Vec:
        """C(p) and dC(p) . mu for the Casimir functions C of the group: C(p + e mu) with e^2 = 0.
        mu, p : (dim,).

        Source: Takiff, Trans. Amer. Math. Soc. 160 (1971), 249: invariants of g + e g.
        """
        return vec(*self.group.casimirs(p), *derivative(self.group.casimirs, p, mu))


@record
class RotationAction(AdjointAction):
    """Rotations of space, as matrices (SO3) or as unit quaternions, turning vectors of R^3: the
    adjoint action, in closed forms.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.2.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require("RotationAction: group", self.group, (SO3, UnitQuaternions), "SO3() or UnitQuaternions()")

    def exp_act(self, xi: Vec, x: Vec) -> Vec:
        """x turned about xi by the angle |xi|, without forming the rotation.  xi, x : (3,)."""
        return self.group.exp_Ad_star(-xi, x)

    def momentum(self, x: Vec, p: Vec) -> Vec:
        """x x p, the angular momentum.  x, p : (3,)."""
        return cross(x, p)

    def why_no_cayley(self) -> None:
        """There is one: the Cayley map of ad is Ad of the Cayley map."""
        return None

    def half_inverse(self, xi: Vec, x: Vec) -> Vec:
        """4/(4 + |xi|^2) (x + xi x x/2 + xi (xi . x)/4).  xi, x : (3,)."""
        return (4.0 / (4.0 + dot(xi, xi))) * (x + (0.5 * cross(xi, x) + (0.25 * dot(xi, x)) * xi))

    def half_inverse_dual(self, xi: Vec, p: Vec) -> Vec:
        """The dual of the inverse of -xi.  xi, p : (3,)."""
        return self.half_inverse(-xi, p)

    def invariants(self, mu: Vec, p: Vec) -> Vec:
        """p.p and mu.p, as for a heavy top and for rigid motions.  mu, p : (3,)."""
        return vec(dot(p, p), dot(mu, p))


def standard_action(group: LieGroup) -> Representation:
    """How a group acts on vectors by its own matrices, unit quaternions by the rotations they stand
    for.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., section 4.2.
    """
    return RotationAction(group) if isinstance(group, (SO3, UnitQuaternions)) else LinearAction(group)


# ------------------------------------------------------------------ series of operators


def squares(columns: list[Vec]) -> float:
    """The sum of the squared entries of a matrix."""
    return vectors.sum([dot(column, column) for column in columns])


def averaged(by: Callable[..., Any], exp_by: Callable[..., Any], size2: float, xi: Vec, x: Any) -> Any:
    """The sum of A^k x/(k + 1)! with A = by(xi, .) and e^A = exp_by(xi, .).

    |A|^2 <= size2, a nilpotent part of any size left out.  |A| is halved until it is at most one,
    and doubled again by phi1(2A) = (1 + e^A) phi1(A)/2; beyond 2^60 the sum is nan.
    """
    size2, halvings = value_of(size2), 0.0
    while size2 > 1.0 and halvings < MOST:
        xi, size2, halvings = 0.5 * xi, 0.25 * size2, halvings + 1.0
    x = where(size2 > 1.0, NAN, 1.0) * x
    tiny, unit = digits(size2)
    term, k = by(0.5 * xi, x), 2.0
    total = x + term
    # squares; a nilpotent part can keep the next term as large as this one
    before, bound = 1.0, 0.25 * size2
    while before > tiny and k < 64.0:
        k = k + 1.0
        term = by((unit / k) * xi, term)
        total = total + term
        before, bound = bound, bound * (size2 / (k * k))
    while halvings > 0.0 and one_norm(total) < INFINITY:
        total = 0.5 * (total + exp_by(xi, total))
        xi, halvings = 2.0 * xi, halvings - 1.0
    return total
