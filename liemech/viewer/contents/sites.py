"""Many sites of one system: spins as arrows, bodies and masses at their places.  However many there
are, they are one object of the page.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InvalidInput
from ...formulas import real_array
from ...formulas.arrays import Array
from ...models.many.sites import (
    atoms_of,
    attitudes_of,
    base_of,
    box_of,
    edges_of_sites,
    fixed_places,
    is_place,
    is_spin,
    lattice_of,
    places_of,
    spacing,
)
from ...models.poses import flies, is_pose, rotated
from ...plots import COLORS, DIRECTIONS
from ...systems.system import System
from ..drawing import Drawing
from ..motion import Motion
from ..shapes import box, needle, often, shares
from .body import axes_legend, boxes
from .content import Content, refuse

LONG = 0.85
"""Arrows and bodies fill this much of the distance between neighbours."""
SEEN = 0.06
"""Arrows of sites in a row are at least this long, of the length of the row; balls are at most as large."""
FEW = 12
"""So many masses or less have colours and trails of their own."""
OXYGEN, HYDROGEN = "#D55E00", "#c9ced8"


@dataclass(frozen=True)
class OnSites(Content):
    """Something to show of many sites; abstract.

    positions : where they are, (sites, 2) or (sites, 3).  Left out: the sites of a ring, a square or
    a cubic lattice know it, and what flies is where it is.
    """

    panel = "sites"
    positions: ArrayLike | None = field(default=None, compare=False)

    def own(self, system: System) -> bool:
        """Whether each run has its own panel: yes, lattices would overlap."""
        return True

    def reach(self, motion: Motion) -> Array:
        """The corners of the box in which they are, with room for what is drawn there."""
        room = 0.5 * self._size(motion).max()
        return np.array([*product(*(self._extent(motion) + [[-room], [room]]).T)])

    def _fixed(self, motion: Motion) -> Array:
        """The places of the shown sites that do not move, (m, 3)."""
        return fixed_places(motion.system, self.positions)[motion.sites]

    def _places(self, motion: Motion) -> Array:
        """The places of the shown sites, (n, m, 3); a single row of those at rest."""
        return self._fixed(motion)[None]

    def _extent(self, motion: Motion) -> Array:
        """Two corners of the box in which their places are."""
        box, places = box_of(motion.system), self._places(motion)
        if box is not None:
            return np.array([0.0 * box, box])
        return np.array([places.min(axis=(0, 1)), places.max(axis=(0, 1))])

    def _size(self, motion: Motion) -> Array:
        """The sizes in which sites are drawn, which a subclass says."""
        raise NotImplementedError


@dataclass(frozen=True)
class Spins(OnSites):
    """The momenta of many sites as arrows about their places, coloured by how far they point along
    an axis.

    axis : blue points against it, orange along it, and ink across it.
    """

    title = "spins"

    axis: ArrayLike = field(default=(0.0, 0.0, 1.0), compare=False)

    def needs(self, system: System) -> tuple[str, ...]:
        """The parts of the state drawn, the momenta; InvalidInput for other systems."""
        axis = real_array(self.axis, "Spins: axis")
        if axis.shape != (3,) or not 0.0 < np.linalg.norm(axis) < np.inf:
            raise InvalidInput(f"Spins: axis is a direction in space; got {self.axis!r}")
        if not is_spin(base_of(system)):
            raise refuse(self, system, "the spins of many sites")
        fixed_places(system, self.positions)
        return ("mu",)

    def legend(self, motion: Motion) -> list[dict[str, Any]]:
        """The scale of colours along the axis."""
        components = tuple(np.asarray(self.axis, dtype=float).tolist())
        axis = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}.get(components, components)
        ends = [f"\u2212{axis}", f"+{axis}"]
        return [{"name": "spins along", "colors": DIRECTIONS, "ends": ends}]

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """Draw a single arrow, repeated at each site."""
        places, mu = self._fixed(motion), motion["mu"]
        axis, length = np.array(self.axis, dtype=float), float(self._size(motion)[0])
        shape = often(
            needle(min(0.3, 0.5 * spacing(places) / length), 12 if len(places) < 2000 else 5),
            len(places),
            [[length / drawing.panel.unit]],
            colors=shares(DIRECTIONS),
            axis=(axis / np.linalg.norm(axis)).tolist(),
        )
        largest = np.linalg.norm(mu, axis=-1).max() or 1.0
        drawing.add("spins", shape, cloud=drawing.panel.inside(places), vectors=mu / largest)

    def _size(self, motion: Motion) -> Array:
        places, lattice = self._fixed(motion), lattice_of(motion.system)
        in_a_row = self.positions is None and lattice is not None and len(lattice.shape) == 1
        return np.array([max(LONG * spacing(places), SEEN * np.ptp(places, axis=0).max() if in_a_row else 0.0)])


@dataclass(frozen=True)
class Sites(OnSites):
    """Bodies and masses at their places: boxes with their inertia and attitude, molecules as their
    atoms, masses as balls as large as the cube root.

    atoms : places in the axes of a body, (k, 3), drawn as balls in its stead, the first one in orange
    and larger; left out, those of a term that knows them, as `SPC` does.
    sizes : diameters of balls and edges of boxes, (1, 1) for all, (sites, 1) or (sites, 3).  Left out,
    boxes are to scale where masses are known, unless they would be dots.
    A dozen masses or less have colours and paths of their own.
    """

    title = "in space"
    to_scale = True

    atoms: ArrayLike | None = field(default=None, compare=False)
    sizes: ArrayLike | None = field(default=None, compare=False)

    def needs(self, system: System) -> tuple[str, ...]:
        """The parts of the state drawn, places and attitudes; InvalidInput for systems without places."""
        group = base_of(system)
        if group is None or not (is_pose(group) or is_place(group)):
            raise refuse(self, system, "the places of many sites")
        if not flies(group) and (is_pose(group) or group.dim == 1):
            fixed_places(system, self.positions)
        return ("g",)

    def legend(self, motion: Motion) -> list[dict[str, Any]]:
        boxes = self._atoms(motion.system) is None and is_pose(base_of(motion.system))
        return axes_legend() if boxes else []

    def note(self, motion: Motion) -> str:
        """Masses are to be seen."""
        return "places to scale, sizes not" if is_place(base_of(motion.system)) else ""

    def draw(self, motion: Motion, drawing: Drawing) -> None:
        """Draw a body repeated at each site, the paths of a few, and the box."""
        system, unit, edges = motion.system, drawing.panel.unit, box_of(motion.system)
        places, sizes, atoms = self._places(motion), self._size(motion), self._atoms(system)
        count, masses = places.shape[1], is_place(base_of(system))
        as_bodies = masses and count <= FEW
        colors = [COLORS[k % len(COLORS)] if as_bodies else drawing.color for k in range(count)]
        where = places if edges is None else np.mod(places, edges)
        edges_of_box: dict[str, Any] = {} if edges is None else {"box": (edges / unit).tolist()}
        q = np.zeros(4) if masses else attitudes_of(system, motion["g"])
        if atoms is not None:  # a ball for each
            turned = [rotated(q.reshape(-1, 4), atom).reshape(where.shape) for atom in atoms]
            where = np.concatenate([where + arm for arm in turned], axis=1)
            sizes = np.repeat([1.5, *[1.0] * (len(atoms) - 1)], count)[:, None] * spacing(atoms)
            colors = [OXYGEN] * count + [HYDROGEN] * (count * (len(atoms) - 1))
        where = drawing.panel.inside(where)
        if masses or atoms is not None:
            drawing.balls("sites", where, sizes / unit, colors, **edges_of_box)
        else:
            drawing.add("sites", boxes(count, sizes / unit, **edges_of_box), cloud=where, turns=q)
        if edges is not None:
            middle = drawing.panel.inside(0.5 * edges)
            drawing.once("box", box(edges / unit, "#aab2c0", 0.0), position=middle)
        else:
            for k in range(count if as_bodies else 0):
                drawing.trail(f"trail {k + 1}", drawing.panel.inside(places[:, k]), colors[k])

    def _atoms(self, system: System) -> Array | None:
        """The atoms of a molecule, (k, 3)."""
        return atoms_of(system) if self.atoms is None else np.asarray(self.atoms, dtype=float)

    def _places(self, motion: Motion) -> Array:
        """The places of the shown sites, (n, m, 3)."""
        group = base_of(motion.system)
        moves = flies(group) or (is_place(group) and group.dim > 1)
        return places_of(motion.system, motion["g"], None if moves else self._fixed(motion))

    def _size(self, motion: Motion) -> Array:
        """Diameters of balls, edges of boxes, (1, 1), (m, 1) or (m, 3)."""
        if self.sizes is not None:
            sizes = real_array(self.sizes, "Sites: sizes")
            return sizes if len(sizes) == 1 else sizes[motion.sites]
        start, (edges, scaled) = self._places(motion)[0], edges_of_sites(motion.system)
        whole = np.ptp(self._extent(motion), axis=0).max() or 1.0
        fitting = LONG * (spacing(start) if len(start) > 1 else whole)
        if edges is None:
            return np.array([[0.6 * fitting]])
        edges = edges[motion.sites]
        if scaled and edges.max() > 0.02 * whole:
            return edges
        if is_place(base_of(motion.system)):
            return min(fitting, SEEN * whole) * np.maximum(edges / edges.max(), 0.3)
        return fitting * edges / np.linalg.norm(edges, axis=1).max()
