"""Curves in space seen from one side: orthographic projection, cut exactly where a curve passes behind the sphere."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...formulas.arrays import Array

VIEW = (40.0, 25.0)
"""Azimuth and elevation of the eye in degrees: all three body axes and the crossing of the separatrix are seen."""


def view_frame(azimuth: float, elevation: float) -> Array:
    """The rotation that takes body axes to (right, up, towards the eye).

    The eye is at (cos e cos a, cos e sin a, sin e), with azimuth a and elevation e in degrees.
    Returns (3, 3).
    """
    a, e = np.radians([azimuth, elevation])
    return np.array(
        [
            [-np.sin(a), np.cos(a), 0.0],
            [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)],
            [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)],
        ]
    )


def split_at_horizon(curve: ArrayLike) -> tuple[Array, Array]:
    """Cut a curve (n, 3) in view coordinates where it passes from the front (z >= 0) to the back
    (z < 0).

    Each crossing is inserted as a point of both parts: there z = 0 exactly, and the point lies on
    the great circle through its two neighbours, at the distance interpolated between theirs.
    Returns the front and the back, both (n + crossings, 3), with NaN in place of the other's
    points, so that each draws as one broken line.
    """
    curve = np.asarray(curve, dtype=float)
    front = curve[:, 2] >= 0.0
    at = np.flatnonzero(front[1:] != front[:-1])
    p, q = curve[at], curve[at + 1]
    s = (p[:, 2] / (p[:, 2] - q[:, 2]))[:, None]
    cut = (1.0 - s) * p + s * q
    cut[:, 2] = 0.0
    length = np.linalg.norm(cut, axis=1, keepdims=True)
    radius = (1.0 - s) * np.linalg.norm(p, axis=1, keepdims=True) + s * np.linalg.norm(q, axis=1, keepdims=True)
    # a chord through the centre stays
    cut *= np.divide(radius, length, out=np.ones_like(length), where=length > 0.0)
    points = np.insert(curve, at + 1, cut, axis=0)
    shared = np.insert(np.zeros(len(curve), dtype=bool), at + 1, True)
    ahead = np.insert(front, at + 1, True)[:, None]
    return np.where(ahead, points, np.nan), np.where(ahead & ~shared[:, None], np.nan, points)
