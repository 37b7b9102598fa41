"""Lie groups as objects; their elements are arrays."""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import cached_property
from importlib import import_module
from typing import Any, final

import numpy as np

from ..errors import IncompatibleSystem, InvalidInput, InvalidType, NotDefined, undefined
from ..formulas import Ambient, Element, Mat, Record, Vec, derivative, dot, identity_matrix, mat, record, sqrt, vec
from ..formulas.arrays import check_finite, real_array
from ..formulas.calls.batches import MEMBERSHIP as MEMBERSHIP
from ..formulas.classes.derived import derived
from ..formulas.reductions import flat
from ..formulas.vectors import small
from .lie_algebra import LieAlgebra, objection, sided

OF_THE_ALGEBRA = {
    *("bracket", "ad_star", "ad_matrix", "hat", "vee", "exp_Ad_star", "dexp", "dexp_dual", "dexp_inv"),
    *("dexp_inv_dual", "dexp_inv_series", "exp_residual", "is_exp_chart", "cayley_Ad_star", "dcayley"),
    *("dcayley_dual", "dcayley_inv", "dcayley_inv_dual", "cayley_residual"),
}
"""Maps of velocities and momenta alone: closed forms stand in the class of the algebra."""


def _of_one_momentum(formula: Callable[..., Any]) -> Callable[..., Any]:
    """A method of one momentum, which is looked at first."""

    @functools.wraps(formula)
    def method(self: LieGroup, mu: Any) -> Any:
        name = f"{type(self).__name__}.{formula.__name__}: mu"
        momentum = real_array(mu, name)
        if momentum.shape != (self.dim,):
            raise InvalidInput(f"{name} must be one momentum, of shape ({self.dim},); got shape {momentum.shape}")
        check_finite(momentum, name)
        return formula(self, momentum)

    return method


@record
class LieGroup(Record):
    """A Lie group acting on itself from the left: velocities are left-trivialised, xi = g^-1 g',
    momenta those of the body.

    Elements `g` are arrays, for most groups matrices of shape (n, n); velocities `xi` and momenta
    `mu` are coordinate vectors of shape (dim,).

    must:     `algebra`, `identity`, `inverse`, `exp`; `compose` unless it is the matrix product
    may:      closed forms of everything in part 2; the Cayley map; what is known of elements and orbits
    follows:  part 3, and what the algebra finds: dexp and its kin

    A group of matrices is easier made from generators alone: `MatrixLieGroup`.  `check_group`
    verifies all that a subclass writes.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., chapter 9;
    Iserles et al., Acta Numerica 9 (2000).
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for name in vars(cls).keys() & OF_THE_ALGEBRA:
            raise InvalidType(
                f"{cls.__name__}.{name}: a closed form of {name} belongs into the class of the "
                "algebra, where methods look for it"
            )
        if "further_invariants" in vars(cls):
            cls.further_invariants = _of_one_momentum(vars(cls)["further_invariants"])  # type: ignore[method-assign]

    # ---------------------------------------------------------------- 1. a subclass writes

    @property
    def algebra(self) -> LieAlgebra:
        """The Lie algebra of the group."""
        raise undefined(self, "algebra")

    def identity(self) -> Element:
        """The neutral element e, with e g = g."""
        raise undefined(self, "identity")

    def compose(self, g: Element, h: Element) -> Element:
        """The product g h.  g, h : elements."""
        return g @ h

    def inverse(self, g: Element) -> Element:
        """The inverse g^-1.  g : an element."""
        raise undefined(self, "inverse")

    def exp(self, xi: Vec) -> Element:
        """The exponential: where the constant velocity xi leads from e in unit time.  xi : (dim,)."""
        raise undefined(self, "exp")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @derived
    def Ad(self, g: Element, xi: Vec) -> Vec:
        """The adjoint action Ad_g xi = g xi g^-1: a body velocity seen from space.

        From hat and vee where the algebra has them, else by differentiation of g exp(s xi) g^-1.
        g : an element, xi : (dim,).
        """
        algebra, back = self.algebra, self.inverse(g)
        if self._by_matrices:
            return algebra.vee(g @ algebra.hat(xi) @ back)
        curve = derivative(lambda s: self.compose(self.compose(g, self.exp(s * xi)), back), 0.0)
        return self._coframe @ flat(curve)

    @derived
    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The dual of Ad, <Ad*_g mu, xi> = <mu, Ad_g xi>: a right action, Ad*_gh = Ad*_h Ad*_g.

        g : an element, mu : (dim,).
        """
        return vec(*[dot(mu, self.Ad(g, unit)) for unit in identity_matrix(self.dim)])

    def log(self, g: Element) -> Vec:
        """The velocity xi with exp(xi) = g nearest to zero.  g : an element."""
        raise NotDefined(f"{type(self).__name__} has no logarithm")

    @derived
    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """g exp(xi): g moved by a step with velocity xi, best written as g plus something small.

        g : an element, xi : (dim,).
        """
        return self.compose(g, self.exp(xi))

    @derived
    def body_velocity(self, g: Element, rate: Ambient) -> Vec:
        """The velocity xi with g' = g xi, from the rate g' of a moving element.

        g : an element, rate : of the same shape.
        """
        if self._by_matrices:
            return self.algebra.vee(self.inverse(g) @ rate)
        back = self.inverse(g)
        return self._coframe @ flat(derivative(lambda s: self.compose(back, g + s * rate), 0.0))

    # the Cayley map (1 - x/2)^-1 (1 + x/2) of the matrices x = hat(xi) of the algebra

    def why_no_cayley(self) -> str | None:
        """Why the group has no Cayley map; None if it has one."""
        if type(self).cayley is LieGroup.cayley:
            return f"{type(self).__name__} does not define one"
        return None

    def cayley(self, xi: Vec) -> Element:
        """The Cayley map (1 - xi/2)^-1 (1 + xi/2), where the algebra is closed under x y x.
        xi : (dim,).
        """
        raise IncompatibleSystem(f"{type(self).__name__} has no Cayley map: {self.why_no_cayley()}")

    def cayley_inv(self, g: Element) -> Vec:
        """The velocity xi with cayley(xi) = g.  g : an element."""
        raise IncompatibleSystem(f"{type(self).__name__} has no Cayley map: {self.why_no_cayley()}")

    @derived
    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """g cayley(xi), best written as g plus something small.  g : an element, xi : (dim,)."""
        return self.compose(g, self.cayley(xi))

    @property
    def by_adjoint(self) -> LieGroup | None:
        """The group with the Cayley map of its matrices Ad_g, Ad_cay(xi) = (1 - ad_xi/2)^-1
        (1 + ad_xi/2).

        The group itself where that is its own Cayley map; None, the default, if it is not known.
        """
        return None

    # momenta and arrays

    def casimirs(self, mu: Vec) -> Vec:
        """Functions of the momentum that every motion keeps, whatever the Hamiltonian; none known
        by default.  mu : (dim,).
        """
        return vec()

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        """How many components in a row share a physical unit: (3, 3) on SE(3), angular and linear
        momenta.
        """
        return (self.dim,)

    @_of_one_momentum
    def further_invariants(self, mu: Any) -> tuple[float, ...] | None:
        """Numbers that tell the coadjoint orbit through mu from others of its dimension with the same
        Casimirs; () if there are none.

        None, the default: the group does not know.  mu : (dim,).
        """
        return None

    def defect(self, g: Ambient) -> float:
        """How far an array is from being an element, relative to an element's size; 0 on the
        group.  g : shaped like an element.

        A group that does not know takes every array for an element.
        """
        return 0.0

    def objection(self, g: np.ndarray) -> str | None:
        """Why an array is not an element, in words; None if it is.  g : one array, shaped like an
        element.
        """
        defect = self.defect(small(g))
        return None if defect <= MEMBERSHIP else f"it is off the group by {defect:.1e}, more than {MEMBERSHIP:.0e}"

    def scale(self, g: Element | None) -> Vec:
        """The displacements that count as large at g (None: anywhere), for the error control of
        adaptive steps: 1 by default, as for angles.  A group with positions gives their sizes, so
        that rtol means the same in every unit.

        g : an element.  Returns (dim,).
        """
        return vec(*[1.0 for _ in range(self.dim)])

    def _scales(self, g: np.ndarray) -> np.ndarray:
        """The scales of many elements, (n, dim)."""
        return np.array([self.scale(small(element)) for element in g])

    def nearest(self, g: Ambient) -> Element:
        """An element close to an array that has drifted off the group.  Never called by an
        integrator.  g : like an element.
        """
        raise NotDefined(f"{type(self).__name__} does not know the element nearest to an array")

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Random elements: exp of normally distributed velocities; by Haar measure where a group overrides it.

        rng : a generator or a seed.  size : leading axes.
        """
        shape = (size,) if isinstance(size, int) else tuple(size)
        return np.array(self.exp(np.random.default_rng(rng).normal(size=(*shape, self.dim))))

    # ---------------------------------------------------------------- 3. what follows

    @final
    @property
    def dim(self) -> int:
        """The dimension of the group."""
        return self.algebra.dim

    @final
    def __pow__(self, copies: int) -> Any:
        """The product of copies of the group: the configurations of as many sites."""
        # which is built on this class
        power: Any = import_module(".composed.power", __package__)
        return power.PowerGroup(self, copies)

    @final
    def __mul__(self, other: Any) -> Any:
        """The direct product; of powers, `SO3() ** 100 * SE3() ** 8`, the configurations of sites of
        two species.
        """
        if not isinstance(other, LieGroup):
            return NotImplemented
        species: Any = import_module(".composed.species", __package__)
        return species.times(self, other)

    @final
    def ad(self, xi: Vec, eta: Vec) -> Vec:
        """ad_xi eta = [xi, eta].  xi, eta : (dim,)."""
        return self.algebra.bracket(xi, eta)

    @final
    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The dual of ad, <ad*_xi mu, eta> = <mu, [xi, eta]>.  xi, mu : (dim,)."""
        return self.algebra.ad_star(xi, mu)

    @final
    def Ad_matrix(self, g: Element) -> Mat:
        """The matrix of Ad_g: g exp(d) = exp(Ad_matrix(g) @ d) g.  Momenta move by its transpose.

        g : an element;  returns (dim, dim).
        """
        return mat(*[self.Ad(g, unit) for unit in identity_matrix(self.dim)]).T

    @final
    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """Ad*_exp(xi) mu: the coadjoint orbit through mu, followed with velocity xi for unit time.

        xi, mu : (dim,).
        """
        return self.algebra.exp_Ad_star(xi, mu)

    @final
    def dexp(self, xi: Vec, eta: Vec, side: str = "left") -> Vec:
        """The trivialised differential of exp, d/de exp(xi + e eta) = exp(xi) (dexp_xi eta).

        With side="right", the one of the book, d/de exp(xi + e eta) = (dexp_xi eta) exp(xi),
        sum_k ad_xi^k eta/(k + 1)!, which is the left one at -xi.  xi, eta : (dim,).
        """
        return self.algebra.dexp(sided(xi, side), eta)

    @final
    def dexp_inv(self, xi: Vec, eta: Vec, side: str = "left") -> Vec:
        """Its inverse; with side="right" sum_k B_k/k! ad_xi^k eta.  xi, eta : (dim,)."""
        return self.algebra.dexp_inv(sided(xi, side), eta)

    @final
    def K(self, g: Element, mu: Vec) -> Vec:
        """The left coadjoint action K_g = Ad*_{g^-1}: a body momentum seen from space.  g : an
        element, mu : (dim,).
        """
        return self.Ad_star(self.inverse(g), mu)

    @final
    def contains(self, g: Ambient) -> bool:
        """Whether an array is an element, up to rounding.  Its `defect` is at most 1e-6.  g : shaped like
        an element.
        """
        return self.defect(g) <= MEMBERSHIP

    @final
    def distance(self, g: Element, h: Element) -> float:
        """|log(g^-1 h)|: the length of the velocity that leads from g to h in unit time.  g,
        h : elements.
        """
        xi = self.log(self.compose(self.inverse(g), h))
        return sqrt(dot(xi, xi))

    @cached_property
    def element_shape(self) -> tuple[int, ...]:
        """The shape of the arrays that are elements."""
        return np.array(self.identity()).shape

    @cached_property
    def _sizes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The shapes of a velocity and of an element."""
        return (self.dim,), self.element_shape

    @cached_property
    def is_complex(self) -> bool:
        """Whether elements have complex entries."""
        return np.iscomplexobj(np.array(self.identity()))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return (self.dim,) if kind == "Vec" else self.element_shape

    def _complex(self, kind: str) -> bool:
        return kind in ("Mat", "Element", "Ambient") and self.is_complex

    @cached_property
    def _by_matrices(self) -> bool:
        """Whether elements are matrices of the size that `hat` gives."""
        return self.element_shape == self.algebra._matrix_shape

    @cached_property
    def _coframe(self) -> Mat:
        """The linear map from rates of an element at the identity to velocities, (d exp at 0)^-1."""
        zero = vec(*[0.0 for _ in range(self.dim)])
        units = identity_matrix(self.dim)
        frame = [flat(derivative(self.exp, zero, unit)) for unit in units]
        return Mat.of(np.linalg.pinv(np.array(frame, dtype=float).T).tolist())

    def _objection(self, argument: str, value: Any) -> str | None:
        if isinstance(value, np.ndarray):  # asked of elements
            with np.errstate(all="ignore"):
                reason = self.objection(value)
            return reason and f"is not in {self!r}: {reason}"
        return objection(argument, value)


@record
class CayleyByExponential(LieGroup):
    """A group whose Cayley map is the exponential one, as x^3 = 0 in its matrix algebra; abstract."""

    def cayley(self, xi: Vec) -> Element:
        """The Cayley map, which is the exponential one."""
        return self.exp(xi)

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """The product g cayley(xi)."""
        return self.compose_exp(g, xi)

    def cayley_inv(self, g: Element) -> Vec:
        return self.log(g)
