"""One term of a potential of many."""

from __future__ import annotations

from typing import Any

from ...formulas import Element, Vec, record
from ...groups.lie_group import LieGroup
from ..potential import Potential


@record
class OneTerm(Potential):
    """The force of one of the terms of a potential, or of its site form.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 7.7.
    """

    terms: Any  # the potential
    k: int  # the number of the term

    def force(self, group: LieGroup, g: Element) -> Vec:
        """The force of term k alone.  g : an element."""
        return self.terms.force_of(group, g, self.k)
