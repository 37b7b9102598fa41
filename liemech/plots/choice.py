"""The picture that tells most about a run, for those who do not want to choose."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..joints.linkage import Linkage
from ..models.bodies.heavy_top import HeavyTop, ReducedHeavyTop
from ..models.lattices.zeitlin_sphere import ZeitlinSphere
from ..models.poses import configurations, flies, is_pose, turns
from ..systems.canonical import CanonicalSystem, HamiltonianSystem
from .attitude import quaternion
from .components import components
from .field import field
from .path import has_path, path
from .phase import phase_portrait, plane
from .spheres.cloud import cloud
from .spheres.sphere import momentum_sphere
from .spins import has_spins, spins
from .style import Axes, needs_run
from .vertical import vertical


def plot(run: Any, *, ax: Axes | None = None, title: str | None = None) -> Axes:
    """Draw what tells most about a run.

    A body that rotates freely: its momentum on the sphere, of an ensemble a cloud. A top: the
    vertical it sees. Spins on a square or cubic lattice: their directions at the end, on a ring or a
    chain over time. Ideal flow on the sphere: its vorticity at the end. A body that flies: its path,
    of a linkage that of every body, with its arms at the end. One degree of freedom: the phase
    plane, of two numbers y as well; two or three: the path. An equation on rotations: the
    quaternion; on a sphere: the point there.
    Everything else: its components over time.

    Returns the axes; `plots.save(ax.figure, "run.png")` writes them.
    """
    needs_run(run, "plots.plot")
    system, parts = run.system, run.states
    if isinstance(system, CanonicalSystem):
        if system.degrees == 1 or (isinstance(system, HamiltonianSystem) and not has_path(run)):
            return phase_portrait(run, ax=ax, title=title)
        return (path if has_path(run) else components)(run, ax=ax, title=title)
    if "x" in parts:
        x = parts["x"]
        if x.ndim == 2 and x.shape[1] == 3 and _constant(np.linalg.norm(x, axis=1)):
            return momentum_sphere(x, ax=ax, title=title, names=("$x_1$", "$x_2$", "$x_3$"))
        return components(run, ax=ax, title=title)
    if parts.get("y", np.empty(0)).shape[1:] == (2,):
        return plane(run, ax=ax, title=title)
    if isinstance(system, ZeitlinSphere) and run.bodies is None and "mu" in parts:
        return _vorticity(run, ax, title)
    group = configurations(system)
    if has_spins(run):
        return spins(run, ax=ax, title=title)
    if isinstance(system, Linkage) and has_path(run):
        return path(run, ax=ax, title=title)
    if not is_pose(group):
        return components(run, ax=ax, title=title)
    if isinstance(system, ReducedHeavyTop) or (isinstance(system, HeavyTop) and "g" in parts):
        return vertical(run, ax=ax, title=title)
    if flies(system) and "g" in parts:
        return path(run, ax=ax, title=title)
    if turns(group) and "mu" in parts:
        mu = parts["mu"]
        if run.bodies is not None:
            return cloud(run, ax=ax, title=title)
        if np.any(mu[0]):
            return momentum_sphere(mu, system=system, ax=ax, title=title)
    if "mu" not in parts and turns(group):
        return quaternion(run, ax=ax, title=title)
    return components(run, ax=ax, title=title)


def shown_parts(system: Any, known: Iterable[str]) -> set[str]:
    """The parts of the state, of those that are known, that `plot` shows of a system."""
    have = set(known)
    group = configurations(system)
    if "mu" not in have or "g" not in have or group is None:
        return have
    if isinstance(system, Linkage):
        return {"g"}
    if isinstance(system, ReducedHeavyTop) or not is_pose(group):
        return {"mu"}
    return {"g"} if isinstance(system, HeavyTop) or flies(system) else {"mu"}


def _vorticity(run: Any, ax: Axes | None, title: str | None) -> Axes:
    """The vorticity of ideal flow on the sphere at the end."""
    latitude, longitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 121), np.linspace(-np.pi, np.pi, 241)
    values = run.system.vorticity(run.mu[-1], latitude, longitude)
    return field(values, latitude, longitude, ax=ax, title=title or f"vorticity at $t$ = {run.t[-1]:.4g}")


def _constant(sizes: np.ndarray) -> bool:
    return bool(sizes[0] > 0.0 and np.ptp(sizes) <= 1e-6 * sizes[0])
