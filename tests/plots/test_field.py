"""A function on the sphere as colours: where it is drawn, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm

LATITUDE, LONGITUDE = np.linspace(-np.pi / 2, np.pi / 2, 91), np.linspace(-np.pi, np.pi, 181)
NORTH, EAST = np.meshgrid(LATITUDE, LONGITUDE, indexing="ij")


@pytest.mark.parametrize(("view", "function"), [
    ((0.0, 0.0), lambda north, east: (np.cos(north) * np.sin(east), np.sin(north))),  # the eye at x
    ((90.0, 0.0), lambda north, east: (-np.cos(north) * np.cos(east), np.sin(north))),  # at y
    ((0.0, 90.0), lambda north, east: (np.cos(north) * np.sin(east), -np.cos(north) * np.cos(east))),
])  # fmt: skip
def test_a_coordinate_to_the_right_and_one_up(view: tuple[float, float], function: object) -> None:
    for values, axis in zip(function(NORTH, EAST), (1, 0), strict=True):  # type: ignore[operator]
        ax = lm.plots.field(values, LATITUDE, LONGITUDE, view=view)
        image = np.asarray(ax.images[0].get_array())
        x = np.linspace(-1.0, 1.0, len(image))
        right, up = np.meshgrid(x, x)
        inside = right**2 + up**2 < 0.9
        pale = 0.86 + 0.14 * np.sqrt(np.clip(1.0 - right**2 - up**2, 0.0, None))
        found = image / pale
        assert np.abs(found - (right if axis == 1 else up))[inside].max() < 2e-3


def test_wrong_input_is_named() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"\(91, 180\).*\(91, 181\)"):
        lm.plots.field(np.zeros((91, 180)), LATITUDE, LONGITUDE)
    with pytest.raises(lm.errors.InvalidInput, match="finite"):
        lm.plots.field(np.full((91, 181), np.nan), LATITUDE, LONGITUDE)
