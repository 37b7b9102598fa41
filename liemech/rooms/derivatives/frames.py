"""Directions in which the parts of a state can move: the components of tangent maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compiler.driver import attempt, read
from ...formulas import Vec, derivative
from ...formulas.classes.layouts import layout_of
from ...formulas.derivatives import BELOW
from ...simulation.between.dense import evaluated, flat, report
from ..fictive_time.clocked import Clocked

LEVEL = BELOW
"""Level of the numbers that carry the derivative."""


def frame(system: Any, name: str, part: Any) -> Any:
    """The directions in which a part of the state can move, as a function of the part, (n, ...) to
    (n, components, ...).
    """
    group = group_of(system) if name == "g" else None
    size = layout_of(part).width
    if group is None:
        basis = np.eye(size).reshape(size, *np.shape(part))
        return lambda points: np.broadcast_to(basis, (len(points), *basis.shape))
    if len(np.shape(part)) != 2:  # elements that are not matrices, such as unit quaternions
        point = layout_of(part)
        arguments = group, point, layout_of(translated(group, part))

        def directions(points: np.ndarray) -> np.ndarray:
            rows = flat({name: points}, len(points))
            return evaluated(translations, arguments, rows, group.dim * size, None).reshape(
                len(points), group.dim, size
            )

        return directions
    algebra = np.array([derivative(group.exp, Vec(*[0.0] * group.dim), list(unit)) for unit in np.eye(group.dim)])
    return lambda points: points[:, None] @ algebra


def group_of(system: Any) -> Any:
    """The group of the elements in the states of a system, which may have a clock."""
    inner = system.system if isinstance(system, Clocked) else system
    return inner.configurations if hasattr(inner, "configurations") else inner.group


def translated(group: Any, g: Any) -> list[Any]:
    """The directions g hat(e_i) in which an element moves."""
    still = Vec(*[0.0] * group.dim)
    units = [Vec(*[float(i == j) for j in range(group.dim)]) for i in range(group.dim)]
    return [derivative(lambda xi: group.compose_exp(g, xi), still, unit) for unit in units]


def translations(group: Any, point: Any, result: Any, given: Any, out: Any, failures: Any) -> None:
    """The driver: the directions in which an element moves."""
    report(attempt(translated, group, read(given, 0, point)), result, out, failures)
