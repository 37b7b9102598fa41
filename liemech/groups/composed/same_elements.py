"""Groups on the elements of another one, of which the product or the generators are their own."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...formulas import Ambient, Element, record
from ..lie_group import LieGroup


@record
class SameElements(LieGroup):
    """A group with the elements of another one, its neutral element and its inverses; abstract.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.1 and section 3.1.
    """

    group: Any

    def identity(self) -> Element:
        """The neutral element of the group."""
        return self.group.identity()

    def inverse(self, g: Element) -> Element:
        """The inverse of the group."""
        return self.group.inverse(g)

    def why_no_cayley(self) -> str | None:
        """The reason why the group has no Cayley map, or None."""
        return self.group.why_no_cayley()

    def defect(self, g: Ambient) -> float:
        """The defect of the group."""
        return self.group.defect(g)

    def objection(self, g: np.ndarray) -> str | None:
        """The objection of the group."""
        return self.group.objection(g)

    def nearest(self, g: Ambient) -> Element:
        """The nearest elements of the group."""
        return self.group.nearest(g)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        """Random elements of the group."""
        return self.group.random(rng, size)
