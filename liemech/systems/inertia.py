"""Inertia, checked: symmetric and positive."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import Mat, Vec, check_finite, real_array
from ..formulas.arrays import at_a_glance

SYMMETRY = 1e-12
"""An inertia whose entries and their mirror images differ by more than this part of their size is a mistake, no rounding."""

ROUNDING = 6 * np.finfo(float).eps
"""Below this, relative to the size of a matrix, rounding decides the sign of a principal moment."""

WORDS = {3: "three", 6: "six"}


def checked_inertia(value: Any, name: str, dim: int, mixed: bool = False) -> tuple[Vec | Mat, Vec | np.ndarray]:
    """The inertia, as a diagonal, (dim,), or a matrix, (dim, dim), and its principal moments,
    (dim,).

    mixed : are its rows in different units, such as kg m^2 and kg?  Scaled to a diagonal of ones,
    rows and columns alike, they can be compared; that changes no sign of a principal moment, only
    the moments.
    Raises InvalidInput, which says what is wrong.

    Source: Horn and Johnson, Matrix Analysis, 2nd ed., theorem 4.5.8 (Sylvester's law of inertia).
    """
    moments = at_a_glance(value, (dim,))
    if moments is not None and min(moments) > 0.0:
        return moments, moments
    array = real_array(value, name)
    if array.shape not in ((dim,), (dim, dim)):
        raise InvalidInput(
            f"{name} has shape {array.shape}; give {WORDS[dim]} principal moments or a {dim}x{dim} matrix"
        )
    check_finite(array, name)
    moments, rounding, scaled = array, 0.0, ""
    if array.ndim == 2:
        scale = float(np.abs(array).max()) or 1.0
        skew = float(np.abs(array - array.T).max())
        if skew > SYMMETRY * scale:
            raise InvalidInput(f"{name} is not symmetric: it and its transpose differ by {skew:.1e}")
        array = 0.5 * array + 0.5 * array.T
        if mixed:
            unit = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(array)), np.finfo(float).tiny))
            moments, rounding = np.linalg.eigvalsh(unit[:, None] * array * unit), ROUNDING
            scaled = " if rows and columns are scaled to a diagonal of ones"
        else:
            moments, rounding = scale * np.linalg.eigvalsh(array / scale), ROUNDING * scale
    least = float(moments.min())
    if least <= rounding:
        zero = ", which is zero up to rounding" if abs(least) <= rounding > 0.0 else ""
        raise InvalidInput(f"{name} has the principal moment {least:g}{scaled}{zero}; all must be positive")
    return (Vec.of(array.tolist()) if array.ndim == 1 else Mat.of(array.tolist())), moments
