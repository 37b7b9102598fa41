"""The motion to which a method is compared, made in more and more steps until it stays the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

State = TypeVar("State")

HALF = 2.0**-26
"""A distance of two results that agree in half of their digits."""

STALLED = 8.0
"""Twice as many steps of order 8 bring two results at least so much closer; where results agree in
half of their digits and this fails, what is left is rounding.
"""

MOST_STEPS = 512

CLEAR = 30.0
"""How many times as large as the doubt about the motion an error is that tells of the method."""


def settled(
    follow: Callable[[int], State], steps: int, distances: Callable[[State, State], dict[str, float]], enough: float
) -> tuple[State, dict[str, float]]:
    """The state at the end of a motion, and how far each of its parts may be off: by as much as it
    differs from the one that was made in half as many steps.

    follow : the state at the end, made in a number of steps by a method of order 8.  steps : to
    begin with.  distances : of the parts of two states.  enough : a distance at which to stop.
    """
    state, last = follow(steps), float("inf")
    while True:
        steps = 2 * steps
        before, state = state, follow(steps)
        doubts = distances(before, state)
        doubt = max(doubts.values())
        stalled = doubt <= HALF and doubt * STALLED > last
        if doubt <= enough or stalled or steps > MOST_STEPS:
            return state, doubts
        last = doubt
