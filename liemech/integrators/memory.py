"""The memory of methods from step to step: the state, values known there, and the unknowns of the last
steps, from which the next guess is extrapolated.
"""

from __future__ import annotations

import math
from typing import Any

from ..formulas import Record, record
from .method import Method


@record
class Memory(Record):
    """The memory that a method carries from one node to the next.

    state : at the node.
    node : values there that the next step needs, such as the force; None if none.
    past : unknowns of the last steps; () if none.
    """

    state: Any
    node: Any
    past: Any


@record
class Remembering(Method):
    """A method that carries more than the state; abstract.

    1. A subclass writes `step`, which takes and returns a `Memory`.
    2. It says what it carries: `at_node`, `beginning`, or both.
    3. The memory, and what compositions ask of it, follow.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VIII.6.1 (starting
    approximations).
    """

    def at_node(self, system: Any, state: Any, h: float) -> Any:
        """The values at a state that a step of length h begins with; None by default."""
        return None

    def beginning(self, system: Any, state: Any, h: float) -> Any:
        """The past that the first step is given; none by default."""
        return ()

    def start(self, system: Any, state: Any, h: float) -> Memory:
        return self.resume(system, state, self.beginning(system, state, h), h)

    def observe(self, memory: Memory) -> Any:
        return memory.state

    def past(self, memory: Memory) -> Any:
        return memory.past

    def resume(self, system: Any, state: Any, past: Any, h: float) -> Memory:
        return Memory(state, self.at_node(system, state, h), past)


def repeated(guess: Any) -> tuple[Any, Any, Any]:
    """A past in which the last three steps had this unknown."""
    return guess, guess, guess


def followed(past: tuple[Any, Any, Any], unknown: Any) -> tuple[Any, Any, Any]:
    """The past after one more step, with this unknown."""
    last, last_1, _ = past
    return unknown, last, last_1


def extrapolated(last: Any, last_1: Any, last_2: Any) -> Any:
    """The value that continues three equidistant ones, by the parabola through them."""
    return 3.0 * last + (last_2 - 3.0 * last_1)


def continued(past: Any) -> Any:
    """The value that continues equidistant ones, the last one first, by the polynomial through them; of tuples part by
    part.
    """
    if isinstance(past[0], tuple):
        return tuple([continued(part) for part in zip(*past)])
    if len(past) == 3:
        return extrapolated(*past)
    total, n = past[0] * float(len(past)), len(past)
    for k in range(1, n):
        total = total + ((-1.0) ** k * math.comb(n, k + 1)) * past[k]
    return total
