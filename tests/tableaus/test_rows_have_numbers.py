"""A row that is no row of numbers is named by its number, from 1."""

from __future__ import annotations

import pytest

import liemech as lm


@pytest.mark.slow
def test_the_row_of_further_stages_that_is_wrong() -> None:
    with pytest.raises(lm.errors.LiemechError, match="row 2 of A_extra"):
        lm.tableaus.ButcherTableau(*("a", 1, ((),), (1.0,), (0.0,)), A_extra=((0.5,), ("x", 0.5)), c_extra=(0.5, 0.5))
