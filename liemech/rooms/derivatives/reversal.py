"""Checkpoints of the way back through a long run: which states to keep so that few steps are made
again.

With s states kept beside the one at hand, and every step made at most r + 1 times,

    beta(s, r) = (s + r)! / (s! r!)

steps can be gone back through, and not one more.

Source: Griewank and Walther, Algorithm 799: revolve, ACM Trans. Math. Softw. 26 (2000); Evaluating
Derivatives, 2nd ed., section 12.3.
"""

from __future__ import annotations

from collections.abc import Callable
from math import comb
from typing import Any


def repetitions(steps: int, kept: int) -> int:
    """The least r with beta(kept, r) >= steps."""
    r = 0
    while comb(kept + r, kept) < steps:
        r += 1
    return r


def go_back(
    steps: int, kept: int, state: Any, advance: Callable[[Any, int, int], Any], back: Callable[[Any, int], None]
) -> None:
    """Go back through the steps of a run, the last one first.

    kept : how many states may be kept beside this one, at least 1.  state : before the first step.
    advance(state, i, j) : gives the state before step j, of the one before step i.  back(state, i) : goes back
    through step i, from whose beginning the state is.
    """
    held, last = [(0, state)], steps  # the states, and before which step they are
    while held:
        first, state = held[-1]
        many = last - first
        if many > 1:
            left = kept - (len(held) - 1)
            r = repetitions(many, left)
            middle = last - min(comb(left - 1 + r, r), many - 1)
            held.append((middle, advance(state, first, middle)))
            continue
        if many:
            back(state, first)
        held.pop()
        last = first
