"""What a method finds among its fields: retractions must be ones of the system's group, whatever their names."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidType


@lm.record
class Euler(lm.Method):
    """Euler's method in two charts; no field has a default."""

    order: ClassVar[int] = 1

    retraction: lm.Retraction
    second: lm.Retraction
    share: float

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        half = system.displaced(self.retraction, state, self.share * h * system.rate(t, state))
        return system.displaced(self.second, half, (1.0 - self.share) * h * system.rate(t, state))


def test_every_retraction_must_be_one_of_the_group() -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    Euler(lm.Exponential(), lm.Cayley(), 0.5).require(body)
    special = lm.LiePoissonSystem(lm.SL(3), lm.KineticEnergy(np.linspace(1.0, 2.0, 8)))
    with pytest.raises(IncompatibleSystem, match=r"Cayley\(\) cannot be used on SL\(3\)"):
        Euler(lm.Exponential(), lm.Cayley(), 0.5).require(special)
    Euler(lm.Exponential(), lm.Exponential(), 0.5).require(special)


def test_fields_without_defaults_stay_without() -> None:
    with pytest.raises(TypeError, match="missing 3 required"):
        Euler()  # type: ignore[call-arg]
    with pytest.raises(InvalidType, match="retraction must be Exponential"):
        Euler("cayley", lm.Cayley(), 0.5)  # type: ignore[arg-type]
