"""Directions in which the parts of a state can move: the components of tangent maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...compiler.driver import attempt, read
from ...formulas import Vec, derivative
from ...formulas.classes.layouts import layout_of
from ...formulas.derivatives import BELOW
from ...formulas.numbers.transposes import turned
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
        arguments = group, point, layout_of(turned(group, part))

        def directions(points: np.ndarray) -> np.ndarray:
            rows = flat({name: points}, len(points))
            return evaluated(translations, arguments, rows, group.dim * size, None).reshape(
                len(points), group.dim, size
            )

        return directions
    algebra = np.array([derivative(group.exp, Vec(*[0.0] * group.dim), list(unit)) for unit in np.eye(group.dim)])
    return lambda points: points[:, None] @ algebra


def real_numbers(array: np.ndarray) -> np.ndarray:
    """The numbers of an array in turn, a complex one as two."""
    flat = np.ascontiguousarray(array)
    return (flat.view(float) if np.iscomplexobj(flat) else flat).ravel()


def basis_of(frames: dict[str, Any], states: dict[str, np.ndarray]) -> np.ndarray:
    """The directions in which states can move, as changes of all their numbers, (n, components, width).

    frames : by part of the state.  states : the parts of n states.
    """
    parts = []
    for name, directions in frames.items():
        changes = directions(np.asarray(states[name]))
        parts.append(real_numbers(changes).reshape(*changes.shape[:2], -1))
    basis = np.zeros((len(parts[0]), *np.sum([x.shape[1:] for x in parts], axis=0)))
    i = j = 0
    for part in parts:
        basis[:, i : i + part.shape[1], j : j + part.shape[2]] = part
        i, j = i + part.shape[1], j + part.shape[2]
    return basis


def group_of(system: Any) -> Any:
    """The group of the elements in the states of a system, which may have a clock."""
    inner = system.system if isinstance(system, Clocked) else system
    return inner.configurations if hasattr(inner, "configurations") else inner.group


def translations(group: Any, point: Any, result: Any, given: Any, out: Any, failures: Any) -> None:
    """The driver: the directions in which an element moves."""
    report(attempt(turned, group, read(given, 0, point)), result, out, failures)
