"""A group in coordinates of like sizes, for laws that compare vectors by one norm."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from ...errors import NotDefined
from ...formulas import Element, Mat, Vec, mat, record, vec
from ...groups.composed.parts import AlgebraOfParts
from ...groups.composed.same_elements import SameElements
from ...groups.lie_algebra import LieAlgebra, like_units
from ...groups.lie_group import LieGroup

ALIKE = 16.0
"""Generators whose units differ by less are left as they are."""


@record
class AlgebraInUnits(AlgebraOfParts):
    """An algebra with the generators u_i E_i.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., section 3.1 (a basis).
    """

    algebra: LieAlgebra
    units: Vec

    @property
    def dim(self) -> int:
        return self.algebra.dim

    def _of_velocities(self, name: str, xi: Vec, eta: Vec, *more: Any) -> Vec:
        """The map of the algebra.  xi, eta : (dim,)."""
        return getattr(self.algebra, name)(self.units * xi, self.units * eta, *more) / self.units

    def _of_momenta(self, name: str, xi: Vec, mu: Vec) -> Vec:
        """The map of the algebra.  xi, mu : (dim,)."""
        return getattr(self.algebra, name)(self.units * xi, mu / self.units) * self.units

    def _of_equations(self, name: str, xi: Vec, p: Vec, mu: Vec) -> tuple[Vec, float | Mat, Mat]:
        """The equation of the algebra.  xi, p, mu : (dim,)."""
        u = self.units
        r, by_p, by_xi = getattr(self.algebra, name)(u * xi, p / u, mu / u)
        if not isinstance(by_p, float):
            by_p = mat(*[x * (row / u) for x, row in zip(u, by_p)])
        return u * r, by_p, mat(*[x * (row * u) for x, row in zip(u, by_xi)])

    def is_exp_chart(self, xi: Vec) -> bool:
        """The chart of the algebra.  xi : (dim,)."""
        return self.algebra.is_exp_chart(self.units * xi)

    def hat(self, xi: Vec) -> Mat:
        """The matrix of the algebra.  xi : (dim,)."""
        return self.algebra.hat(self.units * xi)

    def vee(self, matrix: Mat) -> Vec:
        return self.algebra.vee(matrix) / self.units


@record
class GroupInUnits(SameElements):
    """A group whose algebra has the generators u_i E_i; the elements are the same."""

    units: Vec

    @cached_property
    def algebra(self) -> AlgebraInUnits:
        return AlgebraInUnits(self.group.algebra, self.units)

    def _element(self, name: str, elements: Any, vectors: Any) -> Element:
        return getattr(self.group, name)(*elements, *[self.units * xi for xi in vectors])

    def _vector(self, name: str, elements: Any, vectors: Any) -> Vec:
        """The velocity of the group, in these units."""
        return self._element(name, elements, vectors) / self.units

    def Ad_star(self, g: Element, mu: Vec) -> Vec:
        """The coadjoint map Ad*_g mu in these units."""
        return self.group.Ad_star(g, mu / self.units) * self.units

    def casimirs(self, mu: Vec) -> Vec:
        return self.group.casimirs(mu / self.units)

    def scale(self, g: Element | None) -> Vec:
        return self.group.scale(g) / self.units


def equilibrated(group: LieGroup) -> LieGroup:
    """The group with generators in units that make its structure constants of like sizes; itself if they are."""
    try:
        units = like_units(group.algebra._ad_matrices)
    except NotDefined:  # which a law will tell
        return group
    if not units.max(initial=1.0) >= ALIKE * units.min(initial=1.0):
        return group
    return GroupInUnits(group, vec(*units.tolist()))
