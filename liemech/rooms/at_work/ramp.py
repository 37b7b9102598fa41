"""A command that changes evenly in time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Record, check_finite, real_array, record
from ...formulas.vectors import small


@record
class Ramp(Record):
    """A number or a vector that changes evenly in time, u(t) = value + (t - t0) slope.

    A field of a force, a system, ..., whose formulas call it, `self.torque(t)`; as the input of a
    stepper it is a command between two looks at the body.

    value : at the time t0, a number or (dim,).  slope : its rate, per s; zero if left out.
    Raises InvalidInput for shapes that differ, and entries that are not finite.

    Source: Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 5.2.
    """

    value: Any
    slope: Any = None
    t0: float = 0.0

    def __post_init__(self) -> None:
        value = real_array(self.value, "Ramp: value")
        slope = np.zeros(value.shape) if self.slope is None else real_array(self.slope, "Ramp: slope")
        for name, array in (("value", value), ("slope", slope)):
            check_finite(array, f"Ramp: {name}")
        if value.ndim > 1 or value.shape != slope.shape:
            raise InvalidInput(
                f"Ramp: value and slope are two numbers, or (dim,) both; got shapes {value.shape} and {slope.shape}"
            )
        for name, array in (("value", value), ("slope", slope)):
            object.__setattr__(self, name, small(array) if array.ndim else float(array))
        super().__post_init__()

    def __call__(self, t: Any) -> Any:
        """u(t).  t : in s."""
        return self.value + (t - self.t0) * self.slope
