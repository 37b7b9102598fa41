"""Spaces that groups move: the group itself, vector spaces, spheres."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput, require
from ..formulas import Ambient, Element, Vec, derivative, dot, identity_matrix, record, vec
from .group_action import GroupAction as GroupAction
from .lie_group import LieGroup
from .matrices.classical import SO
from .representations import LinearAction as LinearAction
from .representations import Representation, standard_action
from .rigid.so3 import SO3
from .vector_space import VectorSpace


@record
class LeftMultiplication(GroupAction):
    """A group acting on itself, g . x = g x: simply transitive.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.3.
    """

    def act(self, g: Element, x: Element) -> Element:
        """g x.  g, x : elements."""
        return self.group.compose(g, x)

    @property
    def point_shape(self) -> tuple[int, ...]:
        return self.group.element_shape

    def infinitesimal(self, xi: Vec, x: Element) -> Element:
        """The rate xi x of an element with the spatial velocity xi, shaped like x.  xi : (dim,),
        x : an element.
        """
        if self.group.is_complex:  # a group of matrices
            return self.group.algebra.hat(xi) @ x
        return derivative(lambda v: self.group.compose(self.group.exp(v), x), vec(*[0.0] * self.group.dim), xi)

    def exp_act(self, xi: Vec, x: Element) -> Element:
        """exp(xi) x.  xi : (dim,), x : an element."""
        return self.group.compose(self.group.exp(xi), x)

    def defect(self, x: Ambient) -> float:
        return self.group.defect(x)

    def contains(self, x: Ambient) -> bool:
        """Whether an array is an element of the group.  x : shaped like an element."""
        return self.group.contains(x)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        return self.group.random(rng, size)


@record
class TranslationAction(GroupAction):
    """Vectors moving the points of R^n, g . x = x + g: `TranslationAction(n)`.

    It makes an ordinary differential equation one on a homogeneous space, and a method there the
    ordinary method, bit for bit.

    group : a VectorSpace, or its dimension.  Source: Iserles et al., Lie-group methods, Acta
    Numerica 9 (2000), section 2.2.
    """

    def __post_init__(self) -> None:
        group: Any = self.group
        if not isinstance(group, LieGroup):
            object.__setattr__(self, "group", VectorSpace(group))
        require("TranslationAction: group", self.group, VectorSpace, "a VectorSpace or its dimension")

    @property
    def point_shape(self) -> tuple[int, ...]:
        """The shape of points of R^n, (n,)."""
        return (self.group.dim,)

    def act(self, g: Element, x: Vec) -> Vec:
        """x + g.  g, x : (n,)."""
        return x + g

    def infinitesimal(self, xi: Vec, x: Vec) -> Vec:
        """xi.  xi, x : (n,)."""
        return xi

    def exp_act(self, xi: Vec, x: Vec) -> Vec:
        """x + xi.  xi, x : (n,)."""
        return x + xi


@record
class SphereAction(GroupAction):
    """Rotations moving the points of the unit sphere S^(n-1) in R^n: `SphereAction(3)`, or
    `SphereAction(group)`.

    group : n, which stands for SO3() if it is 3 and for SO(n) else, or any group of real matrices
    that keeps lengths, or unit quaternions.  Raises InvalidInput for a group that does not.

    Source: Iserles et al., Lie-group methods, Acta Numerica 9 (2000), section 2.3.
    """

    def __post_init__(self) -> None:
        group: Any = self.group
        if not isinstance(group, LieGroup):
            object.__setattr__(self, "group", _rotations(group))
        linear = self._linear
        units = list(identity_matrix(linear.space_dim))
        for xi in identity_matrix(self.group.dim):
            x = np.array([linear.infinitesimal(xi, unit) for unit in units])
            if np.abs(x + x.T).max() > 1e-12 * np.abs(x).max():
                raise InvalidInput(f"SphereAction: {self.group!r} does not keep the lengths of vectors")

    @property
    def _linear(self) -> Representation:
        """The rotations of all of R^n."""
        return standard_action(self.group)

    @property
    def point_shape(self) -> tuple[int, ...]:
        """The shape of points as unit vectors of R^n, (n,)."""
        return self._linear.point_shape

    def act(self, g: Element, x: Vec) -> Vec:
        """g x.  g : an element, x : (n,), a unit vector."""
        return self._linear.act(g, x)

    def infinitesimal(self, xi: Vec, x: Vec) -> Vec:
        """hat(xi) x; for n = 3, xi x x.  xi : (dim,), x : (n,), a unit vector."""
        return self._linear.infinitesimal(xi, x)

    def exp_act(self, xi: Vec, x: Vec) -> Vec:
        """exp(hat(xi)) x.  xi : (dim,), x : (n,), a unit vector."""
        return self._linear.exp_act(xi, x)

    def defect(self, x: Vec) -> float:
        """| |x|^2 - 1 |.  x : (n,)."""
        return abs(dot(x, x) - 1.0)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Points that are uniformly distributed on the sphere."""
        x = super().random(rng, size)
        return x / np.linalg.norm(x, axis=-1, keepdims=True)


def _rotations(n: Any) -> LieGroup:
    """The rotation group SO(n) of R^n."""
    return SO3() if n == 3 else SO(n)
