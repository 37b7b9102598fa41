"""Memory that begins where a line of the processor's cache does: a vector that native code writes at once
lies in one line there, and in two where arrays of NumPy begin, in three of four processes.
"""

from __future__ import annotations

import numpy as np

from ..kernel import address

LINE = 8
"""Numbers in a line of the cache."""

WORTH = 2**14
"""Numbers of an array that are worth the microsecond which it takes to find the line."""


def in_lines(*shape: int) -> np.ndarray:
    """An array of floats, as np.empty makes it; a large one begins a line."""
    size = 1
    for n in shape:
        size *= n
    if size < WORTH:
        return np.empty(shape)
    room = np.empty(size + LINE)
    begin = -(address(room) // 8) % LINE
    return room[begin : begin + size].reshape(shape)
