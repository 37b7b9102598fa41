"""The times at which an exact motion is asked for, and where they end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import real_array


def exact_times(t: Any, name: str) -> np.ndarray:
    """One time, (), or a row of them, (n,), finite.  name : of the method that is asked."""
    times = real_array(t, f"{name}: t")
    if times.ndim > 1 or not np.isfinite(times).all():
        raise InvalidInput(f"{name}: t must be a finite time or a row of them; got {t!r}")
    return times


def exact_motion(
    motion: Callable[[np.ndarray], tuple[Any, ...]], times: np.ndarray, name: str
) -> tuple[Any, ...]:
    """What a motion, arrays of the times, gives; refused where a phase is beyond the largest
    number.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        found = motion(times)
    if not all(np.isfinite(part).all() for part in found):
        raise InvalidInput(
            f"{name}: t = {np.abs(times).max():.3g} is too late: the motion has no finite phase"
        )
    return found
