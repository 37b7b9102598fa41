"""Checks of input of models: parameters, and starts and times of exact motions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas import real_array


def check_positive(owner: Any, *names: str) -> None:
    """Raise InvalidInput for parameters, of these names, that are not positive and finite."""
    for name in names:
        value = real_array(getattr(owner, name), f"{type(owner).__name__}: {name}")
        if not (np.isfinite(value) & (value > 0.0)).all():
            raise InvalidInput(
                f"{type(owner).__name__}: {name} must be positive and finite; got {getattr(owner, name)}"
            )


def positive_number(name: str, value: Any) -> float:
    """A positive number, as a float.  Raises InvalidInput for anything else."""
    number = real_array(value, name)
    if number.ndim or not (np.isfinite(number) and number > 0.0):
        raise InvalidInput(f"{name} must be a positive number; got {value!r}")
    return float(number)


# ------------------------------------------------------------------ exact motions


def alone(start: Any, name: str, what: str = "body") -> None:
    """Raise InvalidInput for an ensemble.  name : of the method.  what : the kind of system, for the message."""
    if start.bodies is not None:
        raise InvalidInput(f"{name} takes one {what} at a time; loop over the ensemble")


def exact_times(t: Any, name: str) -> np.ndarray:
    """One finite time, (), or a row of them, (n,).  name : of the method."""
    times = real_array(t, f"{name}: t")
    if times.ndim > 1:
        raise InvalidInput(f"{name}: t must be a time or a row of times; got shape {times.shape}")
    finite = np.isfinite(times)
    if not finite.all():
        raise InvalidInput(f"{name}: t must be finite; got {times[~finite][0]}")
    return times


def exact_motion(motion: Callable[[np.ndarray], tuple[Any, ...]], times: np.ndarray, name: str) -> tuple[Any, ...]:
    """The values of a motion at arrays of times; refused where a phase is beyond the largest number."""
    with np.errstate(over="ignore", invalid="ignore"):
        parts = motion(times)
    if not all(np.isfinite(part).all() for part in parts):
        raise InvalidInput(f"{name}: t = {np.abs(times).max():.3g} is too late: the motion has no finite phase")
    return parts
