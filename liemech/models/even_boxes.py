"""Even boxes that have the inertia of a body."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..formulas.arrays import Array
from ..joints.link import Link
from ..rooms.constraints.constrained_body import BoundBody
from ..systems.mechanical import MechanicalSystem

THINNEST = 0.004
"""The square of the least edge of a box, of that of the largest."""


def inertia_of(system: Any) -> Array:
    """The inertia of rotation of a body, (3, 3); the unit matrix of a system that has none."""
    inertia = getattr(system, "inertia", getattr(getattr(system, "hamiltonian", None), "inertia", None))
    if inertia is None and isinstance(system, (MechanicalSystem, BoundBody)):
        return inertia_of(system.body)
    J = np.eye(3) if inertia is None else np.array(inertia, dtype=float)
    if J.shape not in ((3,), (6,), (3, 3), (6, 6)) or not (np.diagonal(J, 0) if J.ndim == 2 else J)[:3].min() > 0.0:
        return np.eye(3)
    return np.diag(J[:3]) if J.ndim == 1 else J[:3, :3]


def box_of_inertia(J: Array) -> Array:
    """The edges (3,) of a box that has the inertia J, up to its size: half its diagonal is 0.85.

    Of a J that is not diagonal the diagonal counts.
    """
    edges = edges_of_inertia(np.diagonal(J), 1.0)
    return 1.7 * edges / np.linalg.norm(edges)


def principal_box(link: Link) -> tuple[Array, Array]:
    """The principal axes of a link as the columns of a rotation, and the edges of the even box with
    its inertia and mass, in m.
    """
    J = np.array(link.inertia, dtype=float)
    if J.ndim == 1:
        return np.eye(3), edges_of_inertia(J, link.mass)
    moments, axes = np.linalg.eigh(J)
    return axes * np.array([1.0, 1.0, np.linalg.det(axes)]), edges_of_inertia(moments, link.mass)


def edges_of_inertia(moments: Array, mass: float) -> Array:
    """The edges (3,) of an even box along the axes of a body with these principal moments,
    a_i^2 = 6 (J_j + J_k - J_i)/m.

    Where that is not positive, for an inertia that no body has, the edge is thin.
    Source: Landau and Lifshitz, Mechanics, 3rd ed., section 32, problem 2.
    """
    squares = moments.sum() - 2.0 * moments
    return np.sqrt(6.0 / mass * np.maximum(squares, THINNEST * squares.max()))
