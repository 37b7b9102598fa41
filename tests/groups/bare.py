"""SO(3) from what a group of one's own must write, to be completed by what a test needs; and maps of groups by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import expm

import liemech as lm


@lm.record
class BareAlgebra(lm.LieAlgebra):
    """so(3) from what an algebra of one's own must write, and nothing else."""

    @property
    def dim(self) -> int:
        return 3

    def bracket(self, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:
        return lm.cross(xi, eta)


@lm.record
class BareGroup(lm.LieGroup):
    """SO(3) from what a group of one's own must write, and nothing else."""

    @property
    def algebra(self) -> lm.LieAlgebra:
        return BareAlgebra()

    def identity(self) -> lm.Element:
        return lm.SO3().identity()

    def inverse(self, g: lm.Element) -> lm.Element:
        return lm.SO3().inverse(g)

    def exp(self, xi: lm.Vec) -> lm.Element:
        return lm.SO3().exp(xi)


def phi1(a: np.ndarray) -> np.ndarray:
    """1 + a/2 + a^2/6 + ..."""
    n = len(a)
    return np.asarray(expm(np.block([[a, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:])


def map_of(group: lm.LieGroup, name: str) -> Callable[..., Any]:
    """A map of a group, or of its algebra."""
    return getattr(group if hasattr(group, name) else group.algebra, name)
