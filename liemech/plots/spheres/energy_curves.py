"""Curves of constant energy of a free rigid body on its momentum sphere, and the separatrix, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InvalidInput
from ...formulas.arrays import Array


def principal_moments(inertia: ArrayLike) -> tuple[Array, Array]:
    """Ascending principal moments (3,), scaled to J_max = 1, and the principal axes as columns
    (3, 3).

    `inertia` holds three principal moments (3,) or a symmetric matrix (3, 3). Raises InvalidInput
    for anything else.
    """
    J = np.asarray(inertia, dtype=float)
    if J.shape not in ((3,), (3, 3)) or not np.isfinite(J).all():
        raise InvalidInput(f"inertia must be three finite moments or a finite 3x3 matrix; got {inertia!r}")
    J = J / (np.abs(J).max() or 1.0)  # first, so that no unit of inertia overflows
    J = np.diag(J) if J.ndim == 1 else J
    if np.abs(J - J.T).max() > 1e-6:
        raise InvalidInput(f"inertia must be symmetric; got {inertia!r}")
    moments, axes = np.linalg.eigh(J)
    if moments[0] <= 0.0:
        raise InvalidInput(f"inertia must have positive principal moments; got {inertia!r}")
    return moments / moments[-1], axes


def separatrix(inertia: ArrayLike, samples: int = 361) -> Array:
    """The two great circles of the unit sphere on which the energy is that of the middle axis.

    With J1 <= J2 <= J3 they are cos(s) e2 + sin(s) (+- p1 e1 + p3 e3), p1^2 = J1 (J3 - J2) / (J2
    (J3 - J1)) and p3^2 = J3 (J2 - J1) / (J2 (J3 - J1)). Returns (2, samples, 3); (0, samples, 3)
    for a spherical inertia. For an axisymmetric body both are the equator, a circle of equilibria.
    Source: Landau and Lifshitz, Mechanics, section 37 (the intersection of ellipsoid and sphere).
    """
    (J1, J2, J3), axes = principal_moments(inertia)
    if _spherical(J1, J3):
        return np.empty((0, samples, 3))
    p1 = np.sqrt(J1 * (J3 - J2) / (J2 * (J3 - J1)))
    p3 = np.sqrt(J3 * (J2 - J1) / (J2 * (J3 - J1)))
    s = np.linspace(0.0, 2.0 * np.pi, samples)
    circles = [np.stack([sign * p1 * np.sin(s), np.cos(s), p3 * np.sin(s)], axis=-1) for sign in (1.0, -1.0)]
    return np.array(circles) @ axes.T


def energy_levels(inertia: ArrayLike, count: int = 7, samples: int = 361) -> Array:
    """Closed curves of constant energy mu.J^-1 mu / 2 on the unit sphere, evenly spaced.

    Let k be the axis of an extreme moment, i the other extreme, j the middle one. The curve that
    meets the great circle from k to i at the angle a from k is

        x_i = A_i cos(s),  x_j = A_j sin(s),  x_k = +- sqrt((1 - A_i^2) cos^2(s) + (1 - A_j^2) sin^2(s)),
        A_i = sin(a),  A_j^2 = sin^2(a) J_j (J_k - J_i) / (J_i (J_k - J_j)),

    which is the exact intersection of ellipsoid and sphere. `count` angles are shared between the
    two families in proportion to their width. Returns (2 * count, samples, 3); (0, samples, 3) for
    a spherical inertia.
    """
    J, axes = principal_moments(inertia)
    curves: list[Array] = []
    s = np.linspace(0.0, 2.0 * np.pi, samples)
    if not _spherical(J[0], J[2]):
        # axis 3 to the separatrix
        widest = np.arctan2(np.sqrt(J[0] * (J[2] - J[1])), np.sqrt(J[2] * (J[1] - J[0])))
        about_3 = round(count * widest / (0.5 * np.pi))
        for k, i, width, n in ((2, 0, widest, about_3), (0, 2, 0.5 * np.pi - widest, count - about_3)):
            for a in width * np.arange(1, n + 1) / (n + 1):
                Ai = np.sin(a)
                Aj = min(1.0, Ai * np.sqrt(J[1] * (J[k] - J[i]) / (J[i] * (J[k] - J[1]))))
                x = np.empty((samples, 3))
                x[:, i], x[:, 1] = Ai * np.cos(s), Aj * np.sin(s)
                x[:, k] = np.sqrt((1.0 - Ai**2) * np.cos(s) ** 2 + (1.0 - Aj**2) * np.sin(s) ** 2)
                mirror = np.ones(3)
                mirror[k] = -1.0
                curves += [x, x * mirror]
    return np.array(curves).reshape(-1, samples, 3) @ axes.T


def _spherical(smallest: float, largest: float) -> bool:
    return bool(largest - smallest <= 64.0 * np.finfo(float).eps * largest)
