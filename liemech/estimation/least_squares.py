"""Gauss-Newton and Levenberg-Marquardt where the unknowns are elements of groups: a step lies in the
algebra, and moves them by the exponential.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InvalidInput, NoConvergence

DAMPING, FACTOR, MOST = 1e-4, 10.0, 1e12
"""The damping at the start, relative to the diagonal, by what it changes, and where it is given up."""


def minimise(
    where: str,
    start: Any,
    linear: Callable[[Any, Any], tuple[float, float, Any]],
    step: Callable[[Any, float], tuple[np.ndarray, float]],
    move: Callable[[Any, np.ndarray], Any],
    tolerance: float,
    iterations: int,
) -> tuple[Any, Any, float, int]:
    """The unknowns of least cost, the linearised problem there, the cost, and the number of steps.

    linear : of unknowns, and of the problem before or None, the cost |r|^2/2 with the weights of that
    problem, the cost with those found at the unknowns, and the linearised problem.
    step : of the problem and a damping, the step and what the cost falls by if the problem is linear.
    move : of unknowns and a step.

    Steps are Gauss and Newton's, and damped as Levenberg and Marquardt's where the cost would rise.  It
    ends with a step that promises to lower the cost by less than tolerance (1 + cost): that moves the
    unknowns by sqrt(tolerance) of their deviations.  Raises NoConvergence.

    Source: Nocedal and Wright, Numerical Optimization, 2nd ed., section 10.3; Absil, Mahony, Sepulchre,
    Optimization Algorithms on Matrix Manifolds (2008), section 8.4.
    """
    if iterations < 1:
        raise InvalidInput(f"{where}: iterations is a whole number from 1 on; got {iterations!r}")
    x, damping, promised = start, 0.0, np.inf
    _, cost, problem = linear(x, None)
    for done in range(iterations):
        d, promised = step(problem, damping)
        small = promised <= tolerance * (1.0 + cost)
        tried = move(x, d)
        comparable, new_cost, new_problem = linear(tried, problem)
        falls = comparable <= cost
        if falls:
            x, cost, problem = tried, new_cost, new_problem
            damping = damping / FACTOR if damping > DAMPING else 0.0
        if small:
            return x, problem, cost, done + 1
        if not falls:
            damping = max(FACTOR * damping, DAMPING)
            if damping > MOST:
                break
    raise NoConvergence(
        f"{where}: the cost is {cost:.6g} after {done + 1} steps, and the next one promises to lower it "
        f"by {promised:.1e} (relative tolerance {tolerance:.0e}); give a better `initial`, or more "
        "`iterations`"
    )
