"""Groups that move the points of a space: homogeneous spaces, and how to move on them without
leaving them.
"""

from __future__ import annotations

from operator import attrgetter
from typing import final

import numpy as np

from ..errors import NotDefined, require, undefined
from ..formulas import Element, Mat, Record, Vec, derivative, identity_matrix, mat, record, vec
from ..formulas.calls.batches import MEMBERSHIP
from ..formulas.classes.derived import derived
from ..formulas.reductions import flat
from .lie_group import LieGroup


@record
class GroupAction(Record):
    """A left action of a Lie group on a space: every element g moves the points x, e . x = x and
    (g h) . x = g . (h . x).

    Points are vectors (arrays of another shape where a subclass annotates them so), and the
    argument is named `x`.

    1. A subclass writes `act`.
    2. It may add `point_shape`, closed forms for `infinitesimal` and `exp_act`, `defect` and
    `random`.
    3. The rest follows.

    A differential equation on the space is given by a velocity A(t, x) in the Lie algebra,
    x' = infinitesimal(A(t, x), x).  Its solution near x_n is x(t) = exp(Omega(t)) . x_n with
    Omega' = dexp_Omega^-1 A(t, x), Omega(t_n) = 0, right-trivialised.  That is an equation in a
    vector space: whatever method solves it, the point stays on its orbit.

    Source: Munthe-Kaas, Appl. Numer. Math. 29 (1999), section 2; Marsden and Ratiu, section 9.3.
    """

    group: LieGroup

    def __post_init__(self) -> None:
        super().__post_init__()
        require(f"{type(self).__name__}: group", self.group, LieGroup)

    # ---------------------------------------------------------------- 1. a subclass writes

    def act(self, g: Element, x: Vec) -> Vec:
        """The point g . x.  g : an element, x : a point."""
        raise undefined(self, "act")

    # ---------------------------------------------------------------- 2. closed forms are welcome

    @property
    def point_shape(self) -> tuple[int, ...] | None:
        """The shape of a point; None lets all vectors pass."""
        return None

    @derived
    def infinitesimal(self, xi: Vec, x: Vec) -> Vec:
        """The velocity of a point, d/ds exp(s xi) . x at s = 0.  xi : (dim,), x : a point."""
        return derivative(lambda v: self.act(self.group.exp(v), x), vec(*[0.0] * self.group.dim), xi)

    @derived
    def exp_act(self, xi: Vec, x: Vec) -> Vec:
        """exp(xi) . x.  xi : (dim,), x : a point."""
        return self.act(self.group.exp(xi), x)

    def defect(self, x: Vec) -> float:
        """How far an array is from being a point of the space, relative to a point's size; 0 on
        it.  x : shaped like a point.
        """
        return 0.0

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Random points, where nothing better is said vectors of normally distributed components.

        rng : a generator or a seed.  size : leading axes.
        """
        if self.point_shape is None:
            raise NotDefined(f"{type(self).__name__} must define `point_shape` or `random`")
        shape = (size,) if isinstance(size, int) else tuple(size)
        return np.random.default_rng(rng).normal(size=shape + self.point_shape)

    # ---------------------------------------------------------------- 3. what follows

    @final
    def generators(self, x: Vec) -> Mat:
        """The velocities of a point under the basis of the algebra, as columns: they span the
        tangent space of its orbit.

        x : a point (k,);  returns (k, dim).  Its rank is the dimension of the orbit, its kernel the
        algebra of the isotropy group.  Of points that are matrices the entries are in a row.
        """
        units = identity_matrix(self.group.dim)
        return mat(*[flat(self.infinitesimal(unit, x)) for unit in units]).T

    def contains(self, x: Vec) -> bool:
        """Whether an array is a point of the space, up to rounding.  Its `defect` is at most 1e-6.
        x : shaped like a point.
        """
        return self.defect(x) <= MEMBERSHIP

    _space = property(attrgetter("group"))

    def _shape(self, argument: str, kind: str) -> tuple[int, ...] | None:
        return self.point_shape if argument == "x" else super()._shape(argument, kind)
