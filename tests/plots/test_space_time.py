"""Maps of space and time: where numbers of nodes and cells are drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

import liemech as lm
from liemech.errors import InvalidInput


def run() -> Any:
    """A string that swings, from t = 1."""
    one = lm.KineticEnergy([1.0])
    string = lm.Field(lm.VectorSpace(1), lm.FieldDensity(one, one), 2.0, 4, ends=("held", "held"))
    start = string.at_rest(np.sin(0.5 * np.pi * string.arc)[:, None])
    return lm.integrate(string, lm.KickDrift(), start, h=0.25, steps=6, t0=1.0, compiled=False)


def test_nodes_and_cells_are_drawn_at_their_places_and_times() -> None:
    swing = run()
    for values, first in ((swing.g[:, :, 0], 0.0), (swing.system.strains(swing.g)[..., 0], 0.25)):
        ax = lm.plots.space_time(swing, values, label="u")
        (mesh,) = [one for one in ax.collections if isinstance(one, QuadMesh)]
        corners = mesh.get_coordinates()
        assert np.allclose(corners[0, 0], [first - 0.25, 1.0 - 0.125])
        assert np.allclose(corners[-1, -1], [2.25 - first, 2.5 + 0.125])
        assert np.array_equal(np.asarray(mesh.get_array()).reshape(values.shape), values)
        low, high = mesh.get_clim()
        assert -low == high == np.abs(values).max()


def test_numbers_of_another_shape_are_refused() -> None:
    swing = run()
    with pytest.raises(InvalidInput, match=r"values are \(7, nodes\); got shape \(7, 5, 1\)"):
        lm.plots.space_time(swing, swing.g)
    with pytest.raises(InvalidInput, match="nan"):
        lm.plots.space_time(swing, np.full((7, 5), np.nan))
