"""Algebras and groups made of others: every map follows from those of the parts by one rule."""

from __future__ import annotations

from typing import Any

from ...errors import undefined
from ...formulas import Ambient, Element, Mat, Vec, record
from ..lie_algebra import LieAlgebra
from ..lie_group import LieGroup


@record
class AlgebraOfParts(LieAlgebra):
    """An algebra whose maps are those of its parts: direct sums, the opposite algebra, extended
    poses.

    must:     `dim`, and what takes a map of the parts to the whole: `_of_velocities`, `_of_equations`,
              `is_exp_chart`, and `_of_momenta` where momenta are taken to it otherwise than velocities
    follows:  all maps, of both charts

    Each of these calls the method of a part by its name, `getattr(part, name)(x, y, ...)`.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 3.12 (direct
    sums).
    """

    def _of_velocities(self, name: str, xi: Vec, eta: Vec, *more: Any) -> Vec:
        """A map of the velocity eta at xi, such as "dexp".  xi, eta : (dim,)."""
        raise undefined(self, "_of_velocities")

    def _of_momenta(self, name: str, xi: Vec, mu: Vec) -> Vec:
        """A map of the momentum mu at xi, such as "ad_star".  xi, mu : (dim,)."""
        return self._of_velocities(name, xi, mu)

    def _of_equations(self, name: str, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """A residual and its derivatives, "exp_residual" or "cayley_residual".  xi, p, mu : (dim,)."""
        raise undefined(self, "_of_equations")

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        """The bracket [xi, eta] of velocities, part by part."""
        return self._of_velocities("bracket", xi, eta)

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The coadjoint operator ad*_xi mu, part by part."""
        return self._of_momenta("ad_star", xi, mu)

    # the exponential

    def exp_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The coadjoint map Ad*_exp(xi) mu, part by part."""
        return self._of_momenta("exp_Ad_star", xi, mu)

    def dexp(self, xi: Vec, eta: Vec) -> Vec:
        return self._of_velocities("dexp", xi, eta)

    def dexp_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The transposed differential (dexp_xi)* mu, part by part."""
        return self._of_momenta("dexp_dual", xi, mu)

    def dexp_inv(self, xi: Vec, eta: Vec) -> Vec:
        """dexp_xi^-1 eta.  Raises OutsideChart where a part does."""
        return self._of_velocities("dexp_inv", xi, eta)

    def dexp_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """(dexp_xi^-1)* mu.  Raises OutsideChart where a part does."""
        return self._of_momenta("dexp_inv_dual", xi, mu)

    def dexp_inv_series(self, xi: Vec, eta: Vec, terms: int) -> Vec:
        """The series of dexp_xi^-1 eta, cut after ad_xi^terms."""
        return self._of_velocities("dexp_inv_series", xi, eta, terms)

    def exp_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        return self._of_equations("exp_residual", xi, p, mu)

    # the Cayley map

    def cayley_Ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The coadjoint map Ad*_cay(xi) mu, part by part."""
        return self._of_momenta("cayley_Ad_star", xi, mu)

    def dcayley(self, xi: Vec, eta: Vec) -> Vec:
        return self._of_velocities("dcayley", xi, eta)

    def dcayley_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The transposed differential (dcay_xi)* mu, part by part."""
        return self._of_momenta("dcayley_dual", xi, mu)

    def dcayley_inv(self, xi: Vec, eta: Vec) -> Vec:
        """The inverse differential dcay_xi^-1 eta, part by part."""
        return self._of_velocities("dcayley_inv", xi, eta)

    def dcayley_inv_dual(self, xi: Vec, mu: Vec) -> Vec:
        """The transposed inverse differential (dcay_xi^-1)* mu, part by part."""
        return self._of_momenta("dcayley_inv_dual", xi, mu)

    def cayley_residual(self, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        return self._of_equations("cayley_residual", xi, p, mu)


@record
class GroupOfParts(LieGroup):
    """A group whose maps are those of its parts: direct products, one of several groups, a group in other units.

    must:     `algebra`, and what takes a map of the parts to the whole: `_element`, `_vector`
    follows:  all maps, of both charts

    Each of these calls the method of a part by its name, `getattr(part, name)(g, ..., xi, ...)`.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.12 (direct
    products).
    """

    def _element(self, name: str, elements: Any, vectors: Any) -> Element:
        """The element that a map gives, such as "compose_exp".  elements, vectors : its arguments."""
        raise undefined(self, "_element")

    def _vector(self, name: str, elements: Any, vectors: Any) -> Vec:
        """The velocity or momentum that a map gives, such as "Ad".  elements, vectors : its arguments."""
        raise undefined(self, "_vector")

    def identity(self) -> Element:
        return self._element("identity", (), ())

    def compose(self, g: Element, h: Element) -> Element:
        return self._element("compose", (g, h), ())

    def inverse(self, g: Element) -> Element:
        """The inverse g^-1, part by part."""
        return self._element("inverse", (g,), ())

    def Ad(self, g: Element, xi: Vec) -> Vec:
        return self._vector("Ad", (g,), (xi,))

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The coadjoint action Ad*_g mu, part by part."""
        return self._vector("Ad_star", (g,), (mu,))

    def body_velocity(self, g: Element, rate: Ambient) -> Vec:
        """The xi with g' = g xi, part by part."""
        return self._vector("body_velocity", (g, rate), ())

    def nearest(self, g: Ambient) -> Element:
        return self._element("nearest", (g,), ())

    # the exponential

    def exp(self, xi: Vec) -> Element:
        """The exponential map exp(xi), part by part."""
        return self._element("exp", (), (xi,))

    def log(self, g: Element) -> Vec:
        return self._vector("log", (g,), ())

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """The product g exp(xi), part by part."""
        return self._element("compose_exp", (g,), (xi,))

    # the Cayley map

    def cayley(self, xi: Vec) -> Element:
        """The Cayley map cay(xi), part by part."""
        return self._element("cayley", (), (xi,))

    def cayley_inv(self, g: Element) -> Vec:
        return self._vector("cayley_inv", (g,), ())

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """The product g cay(xi), part by part."""
        return self._element("compose_cayley", (g,), (xi,))
