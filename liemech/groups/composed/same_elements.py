"""Groups on the elements of another one, of which the product or the generators are their own."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...formulas import Ambient, Element, Vec, record
from .parts import GroupOfParts


@record
class SameElements(GroupOfParts):
    """A group with the elements of another one, its neutral element and its inverses, and its maps unless it has its
    own; abstract.

    Source: Hall, Lie Groups, Lie Algebras, and Representations, 2nd ed., definition 1.1 and section 3.1.
    """

    group: Any

    def _element(self, name: str, elements: Any, vectors: Any) -> Element:
        return getattr(self.group, name)(*elements, *vectors)

    def _vector(self, name: str, elements: Any, vectors: Any) -> Vec:
        return getattr(self.group, name)(*elements, *vectors)

    def why_no_cayley(self) -> str | None:
        return self.group.why_no_cayley()

    def defect(self, g: Ambient) -> float:
        return self.group.defect(g)

    def objection(self, g: np.ndarray) -> str | None:
        return self.group.objection(g)

    def random(self, rng: np.random.Generator | int | None = None, size: int | tuple[int, ...] = ()) -> np.ndarray:
        return self.group.random(rng, size)
