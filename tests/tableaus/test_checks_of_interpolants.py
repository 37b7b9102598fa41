"""An interpolant that is off by a part in a hundred thousand is found."""

from __future__ import annotations

import dataclasses

import pytest

from liemech.errors import LawViolation
from liemech.tableaus.pairs import DORMAND_PRINCE5


@pytest.mark.parametrize("stage", range(7))
def test_an_interpolant_slightly_off_is_refused(stage: int) -> None:
    """theta - theta^2 is added to one weight, so that the end of the step stays."""
    tableau = DORMAND_PRINCE5
    rows = [list(row) for row in tableau.interpolant]
    rows[stage][0] += 1e-5
    rows[stage][1] -= 1e-5
    with pytest.raises(LawViolation, match="interpolant"):
        dataclasses.replace(tableau, interpolant=tuple(map(tuple, rows)))
