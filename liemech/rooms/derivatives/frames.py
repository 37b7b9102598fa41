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
from ..fictive_time.sundman import InFictiveTime

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
    if not group._by_matrices:  # unit quaternions, and opposite products
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


class Frames:
    """The directions in which states like an example can move, and the components of changes along them.

    of : by part of the state, the function of points that `frame` gives.  sizes : by part, how many directions.
    widths : by part, how many numbers.
    """

    def __init__(self, system: Any, example: Any) -> None:
        parts = {name: part for name, part in example.parts.items() if part is not None}
        self.of = {name: frame(system, name, part) for name, part in parts.items()}
        self.sizes = {name: self.of[name](np.asarray(part)[None]).shape[1] for name, part in parts.items()}
        self.widths = {name: layout_of(part).width for name, part in parts.items()}
        self.count = sum(self.sizes.values())

    def basis(self, states: dict[str, np.ndarray]) -> np.ndarray:
        """The directions as changes of all numbers of states, (n, count, width).  states : the parts of n states."""
        points = {name: np.asarray(states[name]) for name in self.of}
        basis = np.zeros((len(next(iter(points.values()))), self.count, sum(self.widths.values())))
        i = j = 0
        for name, directions in self.of.items():
            size, width = self.sizes[name], self.widths[name]
            changes = flat({name: directions(points[name])}, size * len(basis))
            basis[:, i : i + size, j : j + width] = changes.reshape(-1, size, width)
            i, j = i + size, j + width
        return basis

    def components(self, states: dict[str, np.ndarray], changes: np.ndarray) -> np.ndarray:
        """The components, (n, k, count), of changes of all numbers of states, (n, k, width)."""
        return changes @ dual_basis(self.basis(states))

    def in_a_row(self, components: np.ndarray) -> np.ndarray:
        """The components of many sites, (n, sites, count), as those of one state: of all by their first part, then by
        the next; (n, sites * count).
        """
        ends = np.cumsum([*self.sizes.values()])[:-1]
        return np.concatenate([x.reshape(len(x), -1) for x in np.split(components, ends, axis=2)], axis=1)

    def of_each(self, row: np.ndarray) -> np.ndarray:
        """The inverse of `in_a_row`."""
        sites = row.shape[1] // self.count
        parts = np.split(row, sites * np.cumsum([*self.sizes.values()])[:-1], axis=1)
        return np.concatenate([x.reshape(len(row), sites, -1) for x in parts], axis=2)


class StatesInFrames:
    """States of a run, of its bodies or of its sites, and the directions in which they can move.

    arrays : the parts of the states by name, (n, many, ...).  numbers : of all parts, (n, many, width).
    """

    def __init__(self, frames: Frames, arrays: dict[str, np.ndarray]) -> None:
        self.frames, self.arrays = frames, arrays
        n, self.many = next(iter(arrays.values())).shape[:2]
        rows = flat({name: x.reshape(n * self.many, *x.shape[2:]) for name, x in arrays.items()}, n * self.many)
        self.numbers = rows.reshape(n, self.many, -1)

    def basis(self, some: Any = slice(None)) -> np.ndarray:
        """The directions at some of the states, (n, many, count, width)."""
        points = {name: self.arrays[name][some] for name in self.frames.of}
        basis = self.frames.basis({name: x.reshape(-1, *x.shape[2:]) for name, x in points.items()})
        return basis.reshape(-1, self.many, *basis.shape[1:])


def dual_basis(basis: np.ndarray) -> np.ndarray:
    """P of the components c = dx P of changes dx = c E of numbers along the rows of bases E, (..., width, N)."""
    q, r = np.linalg.qr(np.swapaxes(basis, -1, -2))
    return q @ np.linalg.inv(np.swapaxes(r, -1, -2))


def group_of(system: Any) -> Any:
    """The group of the elements in the states of a system, which may have a clock."""
    inner = system.system if isinstance(system, (Clocked, InFictiveTime)) else system
    return inner.configurations if hasattr(inner, "configurations") else inner.group


def translations(group: Any, point: Any, result: Any, given: Any, out: Any, failures: Any) -> None:
    """The driver: the directions in which an element moves."""
    report(attempt(turned, group, read(given, 0, point)), result, out, failures)
