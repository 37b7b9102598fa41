"""Derivatives of numbers that follow from a parameter in Python, by differences of order 8."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

EIGHTH = (1, 4.0 / 5.0), (2, -1.0 / 5.0), (3, 4.0 / 105.0), (4, -1.0 / 280.0)
"""Weights of differences."""

WIDTHS = 6
"""How many widths are tried at most."""


def slope_of(numbers: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """The derivative at zero of some numbers of one.

    step : of the widest differences.  Eight times narrower ones follow until a number changes by rounding alone; one
    that always changes more, as the sine of an angle of many turns does, has the narrower of the two that differ least.
    """
    slopes: list[np.ndarray] = []
    changes: list[np.ndarray] = []
    for _ in range(WIDTHS):
        total = size = np.zeros(())
        for k, weight in EIGHTH:
            there, back = numbers(k * step), numbers(-k * step)
            # what is equal on both sides does not depend on the parameter: infinite ends of tables
            differs = there != back
            total = total + weight * np.subtract(there, back, out=np.zeros(there.shape), where=differs)
            size = np.maximum(size, np.where(differs, np.abs(there), 0.0))
        slopes.append(total / step)
        if len(slopes) > 1:
            change = np.abs(slopes[-1] - slopes[-2])
            changes.append(np.where(change <= 4.0 * np.spacing(size) / step, 0.0, change))
            if not np.min(changes, axis=0).any():
                break
        step *= 0.125
    best = np.argmin(changes, axis=0) + (np.min(changes, axis=0) > 0.0)
    return np.take_along_axis(np.array(slopes), best[None], axis=0)[0]


def part_of(size: float) -> float:
    """A difference to take beside numbers of a size: 2^-7 of it, a power of two."""
    return float(np.ldexp(1.0, int(np.frexp(size)[1]) - 7))
