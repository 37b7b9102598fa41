"""Curves of constant energy on a sphere of momenta, for every energy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...formulas.arrays import Array

LATITUDES, LONGITUDES = 40, 80


def contours(energy: Callable[[Array], Any], radius: float, count: int) -> Array:
    """The curves on which the energy is one of `count` values between its smallest and largest on a
    sphere, as segments (m, 2, 3).

    The sphere is cut into triangles; where the energy crosses a value in a triangle, it does so on
    two of its sides.
    """
    points, triangles = sphere()
    values = np.asarray(energy(radius * points), dtype=float)
    finite = np.isfinite(values)
    if not finite.any() or np.ptp(values[finite]) <= 1e-12 * np.abs(values[finite]).max():
        return np.empty((0, 2, 3))
    low, high = values[finite].min(), values[finite].max()
    triangles = triangles[finite[triangles].all(axis=1)]
    curves = []
    for level in low + (high - low) * (np.arange(count) + 0.5) / count:
        above = values[triangles] > level
        cut = above.any(axis=1) & ~above.all(axis=1)
        corners, above = triangles[cut], above[cut]
        # on its side of the curve
        alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
        apex, left, right = (corners[np.arange(len(corners)), (alone + k) % 3] for k in range(3))
        ends = []
        for other in left, right:
            share = ((level - values[apex]) / (values[other] - values[apex]))[:, None]
            end = points[apex] + share * (points[other] - points[apex])
            ends.append(end / np.linalg.norm(end, axis=1, keepdims=True))
        curves.append(np.stack(ends, axis=1))
    return radius * np.concatenate(curves)


def sphere() -> tuple[Array, NDArray[np.intp]]:
    """Points of the unit sphere, (n, 3), and the triangles between them, (t, 3); those at the poles have no area."""
    theta, phi = (np.linspace(0.0, np.pi, LATITUDES + 1)[:, None], np.linspace(0.0, 2.0 * np.pi, LONGITUDES + 1))
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0.0 * phi], axis=-1)
    first = (np.arange(LATITUDES)[:, None] * (LONGITUDES + 1) + np.arange(LONGITUDES)).ravel()
    below = first + LONGITUDES + 1
    triangles = np.concatenate([np.stack([first, below, first + 1], 1), np.stack([first + 1, below, below + 1], 1)])
    return points.reshape(-1, 3), triangles
