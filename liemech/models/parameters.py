"""Parameters of models, checked: masses, lengths, radii, which must be positive."""

from __future__ import annotations

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
