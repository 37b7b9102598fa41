"""Vector spaces as Lie groups: the elements are vectors, the product is the sum, and nothing needs
a correction.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ..formulas import Ambient, Element, Mat, Vec, mat, record, vec
from .composed.parts import AlgebraOfParts
from .lie_algebra import Constants
from .lie_group import CayleyByExponential, LieGroup
from .matrices.matrix_group import named_by_size, whole_number


@record
class AbelianAlgebra(AlgebraOfParts):
    """R^n with the bracket zero.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.1.
    """

    n: int

    __repr__ = named_by_size

    def __post_init__(self) -> None:
        object.__setattr__(self, "n", whole_number(type(self).__name__, self.n, 1))

    @property
    def dim(self) -> int:
        return self.n

    @property
    def structure_constants(self) -> Constants:
        return (((0.0,) * self.n,) * self.n,) * self.n

    def bracket(self, xi: Vec, eta: Vec) -> Vec:
        return vec(*[0.0] * self.n)

    def ad_star(self, xi: Vec, mu: Vec) -> Vec:
        """The coadjoint operator, which is zero: momenta are constant."""
        return vec(*[0.0] * self.n)

    def _of_velocities(self, name: str, xi: Vec, eta: Vec, *more: Any) -> Vec:
        """eta: every map is the identity.  xi, eta : (dim,)."""
        return eta

    def _of_equations(self, name: str, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float, Mat]:
        """r = p - mu, dr/dp = 1, dr/dxi = 0.  xi, p, mu : (dim,)."""
        return p - mu, 1.0, mat(*[vec(*[0.0] * self.n) for _ in range(self.n)])


@record
class VectorSpace(CayleyByExponential):
    """R^n under addition: elements, velocities and momenta are vectors (n,), and every map between
    them is the identity.

    So a method for Lie groups is here the ordinary method that it generalises: no operation is
    added, and no bit differs.

    Source: Iserles et al., Lie-group methods, Acta Numerica 9 (2000), section 2.2.
    """

    n: int

    __repr__ = named_by_size

    def __post_init__(self) -> None:
        object.__setattr__(self, "n", whole_number(type(self).__name__, self.n, 1))

    @cached_property
    def algebra(self) -> AbelianAlgebra:
        """R^n with the bracket zero."""
        return AbelianAlgebra(self.n)

    def identity(self) -> Element:
        return vec(*[0.0] * self.n)

    def compose(self, g: Element, h: Element) -> Element:
        return g + h

    def inverse(self, g: Element) -> Element:
        return -g

    def Ad(self, g: Element, xi: Vec) -> Vec:
        return xi

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        return mu

    def body_velocity(self, g: Element, rate: Ambient) -> Vec:
        return rate

    def casimirs(self, mu: Vec) -> Vec:
        """Every component: nothing moves a momentum."""
        return mu

    def further_invariants(self, mu: Any) -> tuple[float, ...]:
        """None: every orbit is a point."""
        return ()

    def scale(self, g: Element | None) -> Vec:
        """The sizes of the components (None: 1)."""
        return super().scale(None) if g is None else vec(*[abs(x) for x in g])

    def nearest(self, g: Ambient) -> Element:
        """g: every vector is an element."""
        return g

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        shape = (size,) if isinstance(size, int) else tuple(size)
        return np.random.default_rng(rng).normal(size=(*shape, self.n))

    # ---------------------------------------------------------------- exponential

    def exp(self, xi: Vec) -> Element:
        return xi

    def log(self, g: Element) -> Vec:
        return g

    def compose_exp(self, g: Element, xi: Vec) -> Element:
        """The product g exp(xi) = g + xi."""
        return g + xi

    @property
    def by_adjoint(self) -> LieGroup:
        """Itself: the Cayley map of ad is Ad of the Cayley map."""
        return self
