"""Where a body is and how it is turned, read from the elements of its group; where the points of
canonical systems are.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..groups.composed.product import ProductGroup
from ..groups.lie_group import LieGroup
from ..groups.matrices.classical import SO
from ..groups.rigid.se2 import SE2
from ..groups.rigid.se3 import SE3
from ..groups.rigid.so3 import SO3
from ..groups.rigid.unit_quaternions import UnitQuaternions
from ..groups.vector_space import VectorSpace
from .bodies.heavy_top import ReducedHeavyTop
from .planets.n_body import NBody
from .swinging.constrained_pendulums import ChainPendulum, FourBarLinkage, SphericalPendulum
from .swinging.pendulums import DoublePendulum, Pendulum


def configurations(system: Any) -> LieGroup | None:
    """The group whose elements tell where the body is, of a group itself; None for systems that move on no group."""
    if isinstance(system, LieGroup):
        return system
    return system.configurations if hasattr(system, "configurations") else getattr(system, "group", None)


def turns(group: LieGroup | None) -> bool:
    """Whether the group is that of rotations in space, so that a momentum is a vector and its coadjoint
    orbits are spheres.
    """
    return isinstance(group, (SO3, UnitQuaternions)) or (isinstance(group, SO) and group.dim == 3)


def is_pose(group: LieGroup | None) -> bool:
    """Whether an element can be drawn as a body in space."""
    if isinstance(group, ProductGroup):
        return _turning_and_moving(group)
    return turns(group) or isinstance(group, (SE3, SE2))


def flies(system: Any) -> bool:
    """Whether the body changes its place, not only its attitude."""
    group = configurations(system)
    return is_pose(group) and not turns(group) and not isinstance(system, ReducedHeavyTop)


def attitude(system: Any, g: Array) -> Array:
    """The attitudes of bodies as quaternions (x, y, z, w), (n, 4).  g : (n, ...), elements."""
    group = configurations(system)
    if isinstance(group, UnitQuaternions):
        return g
    if isinstance(group, ProductGroup):
        return quaternions(g[:, :9].reshape(-1, 3, 3))
    if isinstance(group, SE2):
        half = 0.5 * np.arctan2(g[:, 1, 0], g[:, 0, 0])
        return np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=-1)
    if not is_pose(group):
        raise InvalidInput(f"elements of {group!r} are no attitudes of a body in space")
    return quaternions(g[:, :3, :3])


def place(system: Any, g: Array) -> Array:
    """The places of bodies, (n, 3).  g : (n, ...), elements of a group of rotations and translations."""
    group = configurations(system)
    if isinstance(group, ProductGroup):
        return g[:, 9:12]
    return np.column_stack([g[:, :2, 2], np.zeros(len(g))]) if isinstance(group, SE2) else g[:, :3, 3]


def places(system: Any, q: Array, p: Array) -> Array:
    """The points of a canonical system, (..., m, 2) or (..., m, 3): pendulums hang, bodies are
    where they are, other positions are
    a point, and with one degree of freedom position and momentum are one.  q, p : (..., degrees).
    """
    if isinstance(system, Pendulum):
        return system.length * _hanging(q)
    if isinstance(system, DoublePendulum):
        return np.cumsum(np.array(system.lengths)[:, None] * _hanging(q), axis=-2)
    if isinstance(system, (ChainPendulum, NBody, FourBarLinkage)):
        return q.reshape(*q.shape[:-1], -1, 2 if isinstance(system, FourBarLinkage) else system.dimension)
    return np.stack([q, p], axis=-1) if q.shape[-1] == 1 else q[..., None, :]


def rods(system: Any) -> tuple[Array, list[tuple[int, int]]]:
    """The pivots, (k, 2 or 3), on which the points of a canonical system hang, and which points its
    rods join.

    The rods are pairs of numbers; those of the pivots follow those of the points.  Systems without
    rods have none of either.
    """
    if isinstance(system, FourBarLinkage):
        n = system.loops + 1
        pivots = np.array([[j * system.length, 0.0] for j in range(n)])
        return pivots, [(n + j, j) for j in range(n)] + [(j, j + 1) for j in range(n - 1)]
    if isinstance(system, (Pendulum, DoublePendulum, SphericalPendulum, ChainPendulum)):
        flat = isinstance(system, (Pendulum, DoublePendulum)) or (
            isinstance(system, ChainPendulum) and system.dimension == 2
        )
        n = len(system.masses) if isinstance(system, (DoublePendulum, ChainPendulum)) else 1
        return np.zeros((1, 2 if flat else 3)), [(n if j == 0 else j - 1, j) for j in range(n)]
    return np.zeros((0, 3)), []


def _hanging(angles: Array) -> Array:
    return np.stack([np.sin(angles), -np.cos(angles)], axis=-1)


def _turning_and_moving(group: ProductGroup) -> bool:
    kinds = [type(factor) for factor in group.factors]  # angles of wheels may follow
    return kinds in ([SO3, VectorSpace], [SO3, VectorSpace, VectorSpace]) and group.factors[1].dim == 3


def quaternions(R: Array) -> Array:
    """Rotation matrices (n, 3, 3) as quaternions (x, y, z, w), (n, 4).

    The matrix 4 q q^T has entries that are sums of those of R; the row with the largest diagonal
    gives q with the least rounding.
    Source: Shepperd, Quaternion from rotation matrix, J. Guidance and Control 1 (1978).
    """
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    products = np.empty((len(R), 4, 4))
    products[:, 0, 0], products[:, 1, 1] = 1.0 + xx - yy - zz, 1.0 - xx + yy - zz
    products[:, 2, 2], products[:, 3, 3] = 1.0 - xx - yy + zz, 1.0 + xx + yy + zz
    products[:, 0, 1] = products[:, 1, 0] = R[:, 0, 1] + R[:, 1, 0]
    products[:, 0, 2] = products[:, 2, 0] = R[:, 0, 2] + R[:, 2, 0]
    products[:, 1, 2] = products[:, 2, 1] = R[:, 1, 2] + R[:, 2, 1]
    products[:, 0, 3] = products[:, 3, 0] = R[:, 2, 1] - R[:, 1, 2]
    products[:, 1, 3] = products[:, 3, 1] = R[:, 0, 2] - R[:, 2, 0]
    products[:, 2, 3] = products[:, 3, 2] = R[:, 1, 0] - R[:, 0, 1]
    best = np.argmax(np.diagonal(products, axis1=1, axis2=2), axis=1)
    rows = products[np.arange(len(R)), best]
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def rotated(q: Array, v: Array) -> Array:
    """Vectors (n, 3), or one (3,), rotated by quaternions (n, 4)."""
    u, w = q[:, :3], q[:, 3:]
    across = 2.0 * np.cross(u, np.broadcast_to(v, u.shape))
    return v + w * across + np.cross(u, across)


def toward(d: Array) -> Array:
    """The quaternion of the shortest turn that takes the third axis to a direction."""
    x, y, z = d / np.linalg.norm(d)
    if z < -1.0 + 1e-9:
        return np.array([1.0, 0.0, 0.0, 0.0])
    q = np.array([-y, x, 0.0, 1.0 + z])
    return q / np.linalg.norm(q)


def rotation(q: Array) -> Array:
    """The matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
