"""The opposite group: the same elements multiplied in the other order, for systems that look from
space.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...errors import require
from ...formulas import Ambient, Element, Mat, Vec, plain, record
from ..lie_group import LieGroup
from .parts import AlgebraOfParts
from .same_elements import SameElements


@record
class OppositeAlgebra(AlgebraOfParts):
    """The velocities of an algebra with the opposite bracket, [xi, eta]' = -[xi, eta]: every map is that of
    the algebra at -xi.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 9.1 and
    13.1.
    """

    algebra: Any

    @property
    def dim(self) -> int:
        return self.algebra.dim

    @property
    def invariant_form(self) -> np.ndarray | None:
        return self.algebra.invariant_form

    def _of_velocities(self, name: str, xi: Vec, eta: Vec, *more: Any) -> Vec:
        """The map of the algebra at -xi.  xi, eta : (dim,)."""
        return getattr(self.algebra, name)(-xi, eta, *more)

    def _of_equations(self, name: str, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """The equation of the algebra at -xi.  xi, p, mu : (dim,)."""
        r, by_p, by_xi = getattr(self.algebra, name)(-xi, p, mu)
        return r, by_p, -by_xi

    def is_exp_chart(self, xi: Vec) -> bool:
        return self.algebra.is_exp_chart(xi)


@record
class OppositeGroup(SameElements):
    """The elements of a group with the product in the other order, g * h = h g.

    A left-invariant system on it is a right-invariant one on the group, such as a fluid's:
    velocities and momenta are those seen from space,

        g' = xi g,    mu' = -ad*_xi mu,    xi = dH/dmu,

    with ad* of the group, and every method for the one serves the other.  What a run calls the
    spatial momentum, constant by Noether's theorem, is then the momentum in the body, Ad*_g mu.

    group : a LieGroup.  Raises InvalidType for anything else.
    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 13.1 (right
    Lie-Poisson reduction); Arnold, Ann. Inst. Fourier 16 (1966), 319.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require("OppositeGroup: group", self.group, LieGroup)

    def __repr__(self) -> str:
        return f"OppositeGroup({self.group!r})"

    @cached_property
    def algebra(self) -> OppositeAlgebra:
        return OppositeAlgebra(self.group.algebra)

    def compose(self, g: Element, h: Element) -> Element:
        return self.group.compose(h, g)

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """exp(xi) g of the group, as g exp(Ad_g^-1 xi): rounded by what the step adds."""
        return self.group.compose_exp(g, self.Ad(plain(g), xi))

    def Ad(self, g: Element, xi: Vec) -> Vec:
        """The adjoint action, Ad of g^-1 in the group."""
        return self.group.Ad(self.group.inverse(g), xi)

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The coadjoint action, Ad* of g^-1 in the group."""
        return self.group.Ad_star(self.group.inverse(g), mu)

    def body_velocity(self, g: Element, rate: Ambient) -> Vec:
        """The spatial velocity xi with g' = xi g."""
        return self.group.Ad(g, self.group.body_velocity(g, rate))

    # the Cayley map

    def compose_cayley(self, g: Element, xi: Vec) -> Element:
        """cay(xi) g of the group, as g cay(Ad_g^-1 xi)."""
        return self.group.compose_cayley(g, self.Ad(plain(g), xi))

    @property
    def by_adjoint(self) -> LieGroup | None:
        """The opposite of the group with the Cayley map of Ad_g; None if there is none."""
        group = self.group.by_adjoint
        return None if group is None else OppositeGroup(group)

    # momenta and arrays

    def casimirs(self, mu: Vec) -> Vec:
        """The Casimirs of the group: the orbits are the same."""
        return self.group.casimirs(mu)

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        return self.group.unit_blocks

    def further_invariants(self, mu: Any) -> tuple[float, ...] | None:
        return self.group.further_invariants(mu)

    def scale(self, g: Element | None) -> Vec:
        return self.group.scale(g)
