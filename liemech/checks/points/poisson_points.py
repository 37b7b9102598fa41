"""The points at which a matrix B(y) is checked: the given ones, or random ones at which it is defined."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Vec, check_finite, real_array
from ...groups.poisson_structure import PoissonStructure, slopes_of
from ..report import shown
from .sample_points import flat

Named = list[tuple[str, Vec]]


@dataclass(frozen=True)
class AtPoint:
    """A point, with the matrix there."""

    name: str
    B: PoissonStructure
    y: Vec

    @property
    def dim(self) -> int:
        return len(self.y)

    @cached_property
    def matrix(self) -> np.ndarray:
        """The matrix B(y) as an array, (n, n)."""
        return np.array(self.B.matrix(self.y), dtype=float)

    @cached_property
    def slopes(self) -> np.ndarray:
        """d_l b_ij, with l first."""
        return slopes_of(self.B, self.y)

    def __str__(self) -> str:
        return f"{self.name}, {shown('y', self.y[:8])}"


def given_points(me: str, n: int, points: Any) -> Named:
    """The rows of an array (m, n), or one of (n,)."""
    array = np.atleast_2d(real_array(points, f"{me}: points"))
    if array.shape[1:] != (n,):
        raise InvalidInput(f"{me}: points must have shape (m, {n}); got {array.shape}")
    check_finite(array, f"{me}: points")
    return [(f"point {i}", Vec.of(y)) for i, y in enumerate(array.tolist())]


def random_points(
    me: str,
    what: str,
    names: Sequence[str],
    rows: Iterable[np.ndarray],
    sizes: Iterable[float],
    values: Callable[[Vec], Iterable[Any]],
) -> Named:
    """Rows at which all values are finite, made positive if one of them is not.  What raises an
    error of another kind there is for the laws to tell.

    what : that may not be defined, for a message.
    """

    def defined(y: Vec) -> bool:
        try:
            return all(np.isfinite(flat(x)).all() for x in values(y))
        except (ArithmeticError, ValueError):
            return False
        except Exception:
            return True

    rows = list(rows)
    points = [Vec.of(y.tolist()) for y in rows]
    if not all(map(defined, points)):
        positive = [0.5 * abs(k) + np.abs(y) for k, y in zip(sizes, rows, strict=True)]
        points = [Vec.of(y.tolist()) for y in positive]
    defined_points = [(name, y) for name, y in zip(names, points, strict=True) if defined(y)]
    if not defined_points:
        raise InvalidInput(f"{me}: {what} is not defined at random points; give some, points=[[...], ...]")
    return defined_points


def own_formulas(structure: PoissonStructure) -> Callable[[str], bool]:
    """Which formulas the class of a structure has written itself."""
    return lambda name: getattr(type(structure), name) is not getattr(PoissonStructure, name)
