"""Memory that begins where a line of the processor's cache does: a vector that native code writes at once
lies in one line there, and in two where arrays of NumPy begin, in three of four processes.
"""

from __future__ import annotations

import math

import numpy as np

from ...formulas.sites import room

WORTH = 2**14
"""Numbers of an array that are worth the microsecond which it takes to find the line."""


def in_lines(*shape: int) -> np.ndarray:
    """An array of floats to be filled; a large one begins a line."""
    return np.empty(shape) if math.prod(shape) < WORTH else room(*shape)
