"""Inertia, checked: symmetric and positive."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..native import Mat, Vec, check_finite, real_array

SYMMETRY = 1e-12
"""An inertia matrix less symmetric than this, relative to its size, is a mistake and not a rounding error."""


def checked_inertia(value: Any, name: str, dim: int) -> Vec | Mat:
    """The diagonal, (dim,), or the matrix, (dim, dim), of a positive quadratic form; InvalidInput says what is wrong with it.

    Scaling rows and columns alike changes no sign of a principal value, and lets kg stand beside kg m^2.
    Source: Horn and Johnson, Matrix Analysis, 2nd ed., theorem 4.5.8 (Sylvester's law of inertia).
    """
    array = real_array(value, name)
    if array.shape not in ((dim,), (dim, dim)):
        raise InvalidInput(f"{name} has shape {array.shape}; give {dim} principal values or a {dim}x{dim} matrix")
    check_finite(array, name)
    scale = float(np.abs(array).max()) or 1.0
    values, known = array, 0.0
    if array.ndim == 2:
        skew = float(np.abs(array - array.T).max())
        if skew > SYMMETRY * scale:
            raise InvalidInput(f"{name} is not symmetric: it and its transpose differ by {skew:.1e}")
        array = 0.5 * array + 0.5 * array.T
        unit = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(array)), np.finfo(float).tiny))
        values = np.linalg.eigvalsh(unit[:, None] * array * unit)
        known = dim * np.finfo(float).eps
    if values.min() <= known:
        kind = "" if array.ndim == 1 else "scaled to a diagonal of ones, "
        raise InvalidInput(f"{name} is not positive definite: {kind}its least principal value is {values.min():g}")
    return Vec.of(array.tolist()) if array.ndim == 1 else Mat.of(array.tolist())
