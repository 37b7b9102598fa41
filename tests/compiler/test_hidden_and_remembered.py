"""Attributes of an object that hide those of its class, and what a loop remembers of another call."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import liemech as lm

pytestmark = pytest.mark.compiled


class Settings:
    """Defaults in the class, changed on the object."""

    wind = 0.0

    def gust(self, x: float) -> float:
        return self.wind * x


class Storm(Settings):
    """Another class with the same attributes."""

    wind = 0.7


KNOWN = SimpleNamespace(settings=Settings())


@lm.record
class Ball(lm.SeparableSystem):
    """A ball in the wind."""

    degrees = 1

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0]

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * q[0] * q[0] - KNOWN.settings.wind * q[0] - KNOWN.settings.gust(q[0])


def blown(compiled: bool) -> np.ndarray:
    ball = Ball()
    start = ball.state(q=1.0, p=0.0)
    return np.asarray(lm.integrate(ball, lm.StormerVerlet(), start, h=0.1, steps=30, compiled=compiled).q)


@pytest.mark.parametrize("change", ["wind", "gust", "class", "deleted"])
def test_an_attribute_of_the_object_hides_that_of_the_class(change: str) -> None:
    settings = KNOWN.settings = Settings()
    if change == "deleted":
        settings.wind = 0.7
    calm = blown(True)
    assert np.array_equal(calm, blown(False))
    if change == "wind":
        settings.wind = 0.7
    elif change == "gust":
        settings.gust = lambda x: 3.0 * x  # type: ignore[method-assign]
    elif change == "class":
        settings.__class__ = Storm
    else:
        del settings.wind
    windy = blown(True)
    assert not np.array_equal(windy, calm) and np.array_equal(windy, blown(False))


def turns(fine: bool, x: float) -> Any:
    k: Any = 0
    while k < x:
        k = k + 0.5 if fine else k + 1
    return k


@lm.record
class Turning(lm.SeparableSystem):
    """A force that asks for the kind of a number which a loop has counted."""

    degrees = 1

    def kinetic(self, p: lm.Vec) -> float:
        return 0.5 * p[0] * p[0]

    def potential(self, q: lm.Vec) -> float:
        return 0.5 * q[0] * q[0]

    def force(self, q: lm.Vec, p: lm.Vec) -> lm.Vec:
        a, b = turns(True, q[0]), turns(False, q[0])
        return lm.vec(-q[0] * (a + (1.0 if isinstance(b, int) else -1.0)))


def test_a_loop_does_not_take_the_kinds_of_numbers_from_another_call() -> None:
    system = Turning()
    runs = [
        lm.integrate(system, lm.StormerVerlet(), system.state(1.5, 0.0), h=0.02, steps=50, compiled=c)
        for c in (False, True)
    ]
    assert np.array_equal(runs[0].q, runs[1].q)
