"""A Lie group acting on the dual of its algebra: the home of momenta."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final

import numpy as np

from ..errors import InvalidInput, InvalidType, NotDefined
from ..formulas import Element, Vec, dot, record
from ..formulas.arrays import check_finite, real_array
from . import orbits
from .lie_group import LieGroup
from .poisson_structure import LiePoissonStructure
from .representations import Representation


@record
class CoadjointAction(Representation):
    """The coadjoint action of a group, its orbits, and the Poisson bracket whose symplectic leaves
    they are.

    Two actions go by this name.  `Ad_star(g, mu)`, the dual of Ad_g, is a right action;
    `K(g, mu) = Ad_star(g^-1, mu)` is a left action, and the one meant by `act`.  If g turns body
    into space, K takes a body momentum to space and Ad_star a spatial momentum to the body.

    1. A subclass writes nothing: `group` is enough.
    2. It may add `casimirs` where the group knows none.
    3. The rest follows.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 13.1, 14.1
    and 14.3.
    """

    # ---------------------------------------------------------------- 2. closed forms are welcome

    def casimirs(self, mu: Vec) -> Vec:
        """The Casimir functions at mu, constant on orbits.  mu : (dim,)."""
        return self.group.casimirs(mu)

    # ---------------------------------------------------------------- 3. what follows

    @final
    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The right action, <Ad*_g mu, xi> = <mu, Ad_g xi>.  g : an element, mu : (dim,)."""
        return self.group.Ad_star(g, mu)

    @final
    def K(self, g: Element, mu: Vec) -> Vec:
        """The left action K_g mu = Ad*_{g^-1} mu.  g : an element, mu : (dim,)."""
        return self.group.K(g, mu)

    @final
    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The infinitesimal right action, d/ds Ad*_exp(s xi) mu = ad*_xi mu at s = 0.  xi,
        mu : (dim,).
        """
        return self.group.ad_star(xi, mu)

    @property
    def poisson_structure(self) -> LiePoissonStructure:
        """The minus Lie-Poisson structure, `poisson_structure(mu)` its matrix B(mu): mu' = B(mu)
        grad H(mu).

        `poisson_structure.opposite` is the plus structure, of momenta in space.
        """
        return LiePoissonStructure(self.group)

    @final
    def symplectic_form(self, mu: Vec, xi: Vec, eta: Vec) -> float:
        """The Kirillov-Kostant-Souriau form of the orbit at mu, on the tangent vectors ad*_xi mu
        and ad*_eta mu: -<mu, [xi, eta]>.

        mu, xi, eta : (dim,).  Source: Marsden and Ratiu, theorem 14.4.1, minus sign.
        """
        return -dot(mu, self.group.ad(xi, eta))

    # ---------------------------------------------------------------- orbits

    @final
    def orbit_dimension(self, mu: Any) -> int:
        """The dimension of the orbit through mu, the rank of B(mu), always even.  mu : (dim,)."""
        return len(orbits.tangent(self.group, self._momentum(mu, "orbit_dimension")))

    @final
    def tangent(self, mu: Any) -> np.ndarray:
        """A basis of the directions ad*_xi mu in which the orbit through mu extends.  mu : (dim,),
        returns (orbit dimension, dim).

        Orthonormal where all components have the same unit.
        """
        return orbits.tangent(self.group, self._momentum(mu, "tangent"))

    @final
    def isotropy(self, mu: Any) -> np.ndarray:
        """A basis of the velocities that leave mu alone, ad*_xi mu = 0.  mu : (dim,), returns
        (dim - orbit dimension, dim).

        The differentials of the Casimirs are among them.  Source: Marsden and Ratiu, section 14.2.
        """
        return orbits.isotropy(self.group, self._momentum(mu, "isotropy"))

    @final
    def random_on_orbit(
        self, mu: Any, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()
    ) -> np.ndarray:
        """Momenta K_g mu with random elements g of the group.  mu : (dim,).  rng : a generator or a
        seed.  size : leading axes.
        """
        try:
            elements = self.group.random(rng, size)
        except (InvalidInput, InvalidType) as error:
            raise type(error)(f"{type(self).__name__}.random_on_orbit: {str(error).partition(': ')[2]}") from None
        momentum = self._momentum(mu, "random_on_orbit")
        try:
            return np.asarray(self.group.K(elements, momentum))
        except InvalidInput as error:
            raise InvalidInput(f"{type(self).__name__}.random_on_orbit: {error}") from None

    @final
    def poisson_bracket(self, F: Callable[[Any], Any], G: Callable[[Any], Any]) -> Callable[[Any], Any]:
        """The minus Lie-Poisson bracket, {F, G}(mu) = -<mu, [dF, dG]>, of two formulas of momenta:
        again such a formula.

        F, G : from mu, (dim,), to a number, for instance `hamiltonian.energy`.  Along a motion
        F' = {F, H}.
        Raises InvalidType for what cannot be called.  Source: Marsden and Ratiu, section 13.1.
        """
        for name, formula in (("F", F), ("G", G)):
            if not callable(formula):
                raise InvalidType(
                    f"{type(self).__name__}.poisson_bracket: {name} must be a formula of momenta, "
                    f"as `hamiltonian.energy` is; got {formula!r}"
                )
        return self.poisson_structure.bracket(F, G)

    @final
    def on_same_orbit(self, mu: Vec, nu: Vec, tolerance: float = 1e-12) -> bool:
        """Whether mu and nu lie on one orbit, up to rounding.  mu, nu : (dim,).

        No, if the dimensions of their orbits, their Casimirs or their `further_invariants` differ.
        Yes, if the group knows that these tell all orbits apart, or if an element with K_g mu = nu
        is found.  Otherwise nobody knows, and NotDefined is raised.

        tolerance : by how much Casimirs may differ, relative to the sizes of their terms.
        """
        on_one_orbit = orbits.same(self, np.array(mu, dtype=float), np.array(nu, dtype=float), float(tolerance))
        if on_one_orbit is None:
            raise NotDefined(
                f"on_same_orbit: whether these momenta of {self.group!r} lie on one orbit is not "
                "known: their Casimirs agree, but do not tell all orbits apart, and no g with K_g "
                "mu = nu was found. Define `further_invariants`"
            )
        return on_one_orbit

    def _momentum(self, mu: Any, method: str) -> np.ndarray:
        where = f"CoadjointAction.{method}: mu"
        array = real_array(mu, where)
        if array.shape != (self.group.dim,):
            raise InvalidInput(
                f"{where} must have shape ({self.group.dim},), a momentum of {self.group!r}; got {array.shape}"
            )
        check_finite(array, where)
        return array

    # ---------------------------------------------------------------- as a representation

    @property
    def space_dim(self) -> int:
        return self.group.dim

    def act(self, g: Element, x: Vec) -> Vec:
        """K_g x.  g : an element, x : (dim,), a momentum."""
        return self.group.K(g, x)

    def act_dual(self, g: Element, p: Vec) -> Vec:
        """Ad_{g^-1} p.  g : an element, p : (dim,), a velocity."""
        return self.group.Ad(self.group.inverse(g), p)

    def infinitesimal(self, xi: Vec, x: Vec) -> Vec:
        """-ad*_xi x.  xi, x : (dim,)."""
        return -self.group.ad_star(xi, x)

    def infinitesimal_dual(self, xi: Vec, p: Vec) -> Vec:
        """-[xi, p].  xi, p : (dim,)."""
        return -self.group.ad(xi, p)

    def exp_act(self, xi: Vec, x: Vec) -> Vec:
        """Ad*_exp(-xi) x.  xi, x : (dim,)."""
        return self.group.exp_Ad_star(-xi, x)

    def momentum(self, x: Vec, p: Vec) -> Vec:
        """ad*_p x.  x, p : (dim,)."""
        return self.group.ad_star(p, x)

    def phi1(self, xi: Vec, x: Vec) -> Vec:
        """dexp_xi* x.  xi, x : (dim,)."""
        return self.group.algebra.dexp_dual(xi, x)

    def phi1_dual(self, xi: Vec, p: Vec) -> Vec:
        """dexp_xi p.  xi, p : (dim,)."""
        return self.group.dexp(xi, p)

    def phi1_inv(self, xi: Vec, x: Vec) -> Vec:
        """(dexp_xi^-1)* x.  xi, x : (dim,)."""
        return self.group.algebra.dexp_inv_dual(xi, x)

    def phi1_inv_dual(self, xi: Vec, p: Vec) -> Vec:
        """dexp_xi^-1 p.  xi, p : (dim,)."""
        return self.group.dexp_inv(xi, p)


def coadjoint(group: LieGroup) -> CoadjointAction:
    """The coadjoint action of a group.  Source: Marsden and Ratiu, section 14.1."""
    return CoadjointAction(group)
