"""Whether an inertia is singular does not depend on units."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm


@pytest.mark.parametrize("unit", [1e-150, 1e-3, 1.0, 1e150])
def test_an_indefinite_inertia_with_a_zero_on_its_diagonal(unit: float) -> None:
    assert lm.KineticEnergy(unit * np.array([[1.0, 0.1], [0.1, 0.0]]))
    with pytest.raises(lm.errors.InvalidInput, match="singular"):
        lm.KineticEnergy(unit * np.array([[1.0, 0.0], [0.0, 0.0]]))
