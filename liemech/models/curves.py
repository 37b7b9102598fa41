"""Curves through points in space: whether they look like curves, and whence they are best seen."""

from __future__ import annotations

import numpy as np

from ..formulas.arrays import Array

SHARP = np.cos(np.radians(25.0))
"""A trail whose segments mostly turn by more than this is shown by its points: a curve through them
would be invented.
"""


ASIDE = (35.0, 22.0)
"""The eye, as azimuth and elevation in degrees, for what has no side of its own."""
FRONT = (-78.0, 10.0)
"""The eye in front of a picture that stands upright: the first axis to the right, the third up."""


def is_smooth(points: Array) -> bool:
    """Whether most segments of a curve turn little from one to the next."""
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    # in units of the panel: shorter ones have no direction that could be seen
    steps = steps[length > 1e-6]
    if len(steps) < 2:
        return True
    cosines = (steps[1:] * steps[:-1]).sum(axis=1) / (
        np.linalg.norm(steps[1:], axis=1) * np.linalg.norm(steps[:-1], axis=1)
    )
    return bool(np.median(cosines) >= SHARP)


def across(points: Array) -> tuple[float, float]:
    """The eye, in degrees, that sees most of points (k, 3): across their principal plane, but
    neither quite level nor from straight above, so that the picture has depth.

    Source: Jolliffe, Principal Component Analysis, 2nd ed., section 1.1.
    """
    _, sizes, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if len(sizes) < 3 or sizes[2] >= 0.6 * sizes[0]:
        return ASIDE
    line, up = sizes[1] < 0.15 * sizes[0], min(abs(float(axes[2, 2])), 1.0)
    x, y = (axes[0, 1], -axes[0, 0]) if line or up > 0.8 else axes[2, :2]
    if up > 0.8 and sizes[1] > 0.9 * sizes[0]:  # as wide as it is long: no side is the longer one
        x, y = 0.0, -1.0
    if y > 0.0:  # from the front, with x to the right
        x, y = -x, -y
    elevation = ASIDE[1] if line else np.clip(np.degrees(np.arcsin(up)), FRONT[1], 55.0)
    return round(float(np.degrees(np.arctan2(y, x))) + 12.0, 1), round(float(elevation), 1)
