"""Where the sites of one system are and how they are turned, read from their elements and from the
graphs of their terms; what is known of their masses.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import check_finite, real_array
from ...formulas.arrays import Array
from ...formulas.classes.of_each import Each
from ...groups.composed.power import PowerGroup
from ...groups.lie_group import LieGroup
from ...groups.vector_space import VectorSpace
from ...joints.linkage import Linkage
from ...rooms.sites.graphs import Lattice, Within
from ...rooms.sites.terms.bound_terms import BoundTerm
from ...rooms.sites.terms.sums_of_terms import OfTerms
from ..even_boxes import edges_of_inertia
from ..poses import attitude, configurations, flies, is_pose, place, places, quaternions, turns

SAMPLED = 200
"""Sites from which the distance to the next one is measured."""


def of_sites(system: Any) -> PowerGroup | None:
    """The power of a group whose copies are the sites of a system; None of a system of one body."""
    group = configurations(system)
    return group if isinstance(group, PowerGroup) else None


def base_of(system: Any) -> Any:
    """The group of one site; None of a system of one body."""
    return getattr(of_sites(system), "base", None)


def by_site(system: Any, name: str, rows: Array) -> Array:
    """A part of the state of many sites, `mu` or `g`, with an axis of sites: (..., sites, dim)."""
    group = of_sites(system)
    return rows if group is None else group.by_site(rows, "Element" if name == "g" else "Vec")


def is_spin(group: LieGroup | None) -> bool:
    """Whether momenta are vectors in space, as those of rotations are."""
    return turns(group) or (group is not None and turns(group.by_adjoint))


def is_place(group: LieGroup | None) -> bool:
    """Whether the elements are places or displacements."""
    return isinstance(group, VectorSpace) and group.dim <= 3


def energies_of(system: Any) -> list[OfTerms]:
    """The sums of terms that are energies of a system."""
    candidates = [
        getattr(part, name, None)
        for part in (system, getattr(system, "body", None))
        for name in ("potential", "hamiltonian")
    ]
    return [energy for energy in candidates if isinstance(energy, OfTerms)]


def terms_of(system: Any) -> list[BoundTerm]:
    """The terms of which the energies of many sites are the sum."""
    return [part for energy in energies_of(system) for part in energy.parts]


def lattice_of(system: Any) -> Lattice | None:
    """The lattice on which the sites of a system are, of several the one with the most axes."""
    lattices = [part.graph for part in terms_of(system) if isinstance(part.graph, Lattice)]
    return max(lattices, key=lambda graph: len(graph.shape), default=None)


def fixed_places(system: Any, positions: Any = None) -> Array:
    """Where all the sites are that do not move, (sites, 3): where they are said to be, or where the
    lattice has them.  positions : (sites, 2) or (sites, 3).
    """
    group = of_sites(system)
    count = group.copies if group is not None else 1
    if positions is None:
        lattice = lattice_of(system)
        if lattice is None:
            raise InvalidInput(
                f"where are the sites of {system!r}?  Its graphs do not say; give positions=, as "
                f"({count}, 2) or ({count}, 3)"
            )
        return lattice.layout
    places = real_array(positions, "positions")
    check_finite(places, "positions")
    if places.shape not in ((count, 2), (count, 3)):
        raise InvalidInput(f"positions have shape {places.shape}; wanted are ({count}, 2) or ({count}, 3)")
    return np.pad(places, ((0, 0), (0, 3 - places.shape[1])))


def places_of(system: Any, g: Array, fixed: Array | None) -> Array:
    """Where sites are, (n, sites, 3); displacements in one dimension are drawn upwards.

    g : (n, sites, ...), their elements.  fixed : (sites, 3), for those that do not tell their place.
    """
    group = base_of(system)
    if is_place(group) and group.dim > 1:
        return np.pad(g, ((0, 0), (0, 0), (0, 3 - group.dim)))
    if flies(group):
        return place(group, g.reshape(-1, *g.shape[2:])).reshape(*g.shape[:2], 3)
    still = np.broadcast_to(np.asarray(fixed), (*g.shape[:2], 3))
    return still + g * np.array([0.0, 0.0, 1.0]) if is_place(group) else still


def attitudes_of(system: Any, g: Array) -> Array:
    """How sites are turned, as quaternions (x, y, z, w) (n, sites, 4), each with the sign that makes
    it nearest to the one before.  g : (n, sites, ...), their elements.

    q and -q are the same attitude.
    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 9.2.
    """
    q = attitude(base_of(system), g.reshape(-1, *g.shape[2:])).reshape(*g.shape[:2], 4)
    flips = np.where((q[1:] * q[:-1]).sum(axis=-1) < 0.0, -1.0, 1.0)
    return np.concatenate([q[:1], q[1:] * np.cumprod(flips, axis=0)[..., None]])


def inertia_of_sites(system: Any) -> Array | None:
    """The principal moments of inertia of all sites and then their masses, (sites, dim), or the
    masses alone, (sites, 1); None: not known.
    """
    group = of_sites(system)
    named = [
        dict(zip(energy.names, energy.own, strict=True)).get("mass")
        for energy in energies_of(system)
        if is_place(base_of(system))
    ]
    kinetic = [getattr(getattr(part.term, "energy_of_one", None), "inertia", None) for part in terms_of(system)]
    for value in (*named, *kinetic):
        if value is not None and group is not None:
            rows = value.values if isinstance(value, Each) else np.array([value], dtype=float)
            rows = np.diagonal(rows, axis1=1, axis2=2) if rows.ndim == 3 else rows
            if rows.min() >= 0.0 and rows.max() > 0.0:
                return np.broadcast_to(rows.reshape(len(rows), -1), (group.copies, rows[0].size or 1))
    return None


def edges_of_sites(system: Any) -> tuple[Array | None, bool]:
    """How large bodies are, and whether that is to scale: of masses the cube roots, (sites, 1), of
    bodies the edges of the boxes with their inertia, (sites, 3); None where it is not known.
    """
    inertia = inertia_of_sites(system)
    if inertia is None:
        return None, False
    if is_place(base_of(system)):
        return np.cbrt(inertia[:, :1]), False
    edges = np.array([edges_of_inertia(J, 1.0) for J in inertia[:, :3]])
    scaled = inertia.shape[1] > 3 and inertia[:, 3].min() > 0.0
    return (edges / np.sqrt(inertia[:, 3:4]), True) if scaled else (edges, False)


def atoms_of(system: Any) -> Array | None:
    """The atoms of the molecules that sites are, (k, 3) in their axes, of a term that knows them."""
    for part in terms_of(system):
        atoms = getattr(getattr(part.term, "term", part.term), "atoms", None)
        if atoms is not None:
            return np.array(atoms)
    return None


def box_of(system: Any) -> Array | None:
    """The edges of the periodic box, (3,); None: there is none."""
    graphs = [part.graph for part in terms_of(system) if isinstance(part.graph, Within)]
    boxes = [np.array(graph.box) for graph in graphs if graph.box is not None]
    return boxes[0] if boxes and len(boxes[0]) == 3 else None


def spacing(places: Array) -> float:
    """How far the next site is, in the middle of all; 1 where there is none."""
    sample = np.unique(np.linspace(0, len(places) - 1, SAMPLED).round().astype(np.intp))
    apart = [np.linalg.norm(places - places[i], axis=1) for i in sample]
    nearest = float(np.median([distances[distances > 0.0].min(initial=np.inf) for distances in apart]))
    return nearest if np.isfinite(nearest) else 1.0


def turn(system: Any, states: dict[str, Array], later: dict[str, Array]) -> float:
    """By how many degrees attitudes and momenta turn from some samples to later ones, and by how
    many positions and momenta do in their phase space, each about its mean in units of its spread;
    one in fifty may turn by more.
    """
    group, angles = base_of(system) or configurations(system), [np.zeros(1)]
    if "g" in states and group is not None and is_pose(group):
        q, p = (attitude(group, samples["g"].reshape(-1, *group.element_shape)) for samples in (states, later))
        angles.append(2.0 * np.minimum(_angles(q, p), _angles(q, -p)))
    if isinstance(system, Linkage) and "g" in states:
        q, p = (quaternions(system.poses(samples["g"])[..., :3, :3].reshape(-1, 3, 3)) for samples in (states, later))
        angles.append(2.0 * np.minimum(_angles(q, p), _angles(q, -p)))
    if {"q", "p"} <= states.keys() or (is_place(group) and {"g", "mu"} <= states.keys()):
        points = [_points(system, samples) for samples in (states, later)]
        mean, spread = points[0].mean(axis=0), points[0].std(axis=0)
        units = [(samples - mean) / np.where(spread > 0.0, spread, 1.0) for samples in points]
        angles.append(_angles(*units).ravel())
    if "mu" in states and is_spin(group) and states["mu"].shape[-1] == 3:
        angles.append(_angles(states["mu"], later["mu"]))
    return float(np.degrees(max(np.quantile(samples, 0.98) if samples.size else 0.0 for samples in angles)))


def _points(system: Any, states: dict[str, Array]) -> Array:
    """Where things are, and their momenta, the points of phase space that a picture shows."""
    if "q" not in states:
        return np.concatenate([states["g"], states["mu"]], axis=-1)
    q, p = states["q"], states["p"]
    positions = places(system, q, p)
    return np.concatenate([positions.reshape(*q.shape[:-1], -1), p], axis=-1)


def _angles(u: Array, v: Array) -> Array:
    """The angles between vectors; of those without a direction 0.

    Source: Kahan, How Futile are Mindless Assessments of Roundoff?, section 12.
    """
    sizes = np.linalg.norm(u, axis=-1, keepdims=True), np.linalg.norm(v, axis=-1, keepdims=True)
    a, b = u * sizes[1], v * sizes[0]
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
