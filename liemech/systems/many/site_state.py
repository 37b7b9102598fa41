"""States of many sites: an array with an axis of sites for each part."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import check_finite, real_array, record
from ...formulas.classes.fields import frozen_array
from ...formulas.vectors import small
from ...groups.composed.power import PowerGroup
from ...groups.composed.species import SpeciesGroup
from ..system import State


@record
class StateOfSites(State):
    """Where the sites of a system are and how they move: arrays with an axis of sites; abstract."""

    @property
    def width(self) -> int:
        """The number of components of all momenta, or positions."""
        return int(self._leading.size)

    @cached_property
    def _leading(self) -> np.ndarray:
        """A part in which every site has a vector."""
        return next(np.asarray(x) for x in self.parts.values() if x is not None)

    @property
    def bodies(self) -> int | None:
        first = self._leading
        return len(first) if first.ndim == 3 else None

    @property
    def sites(self) -> int:
        """The number of sites of the system."""
        return int(self._leading.shape[-2])


@record
class SitePoints(StateOfSites):
    """Positions `q` and momenta `p` of the sites of a canonical system, (sites, n) each or, for an
    ensemble, (members, sites, n).
    """

    q: Any
    p: Any


@record
class SiteValues(StateOfSites):
    """Points `y` of the sites of a Poisson system, (sites, n) or, for an ensemble, (members, sites, n)."""

    y: Any


@record
class SiteState(StateOfSites):
    """Where the sites of a system are and how they move: momenta `mu`, and the elements `g` from
    body to space (None: not asked for), a row for each site.

    mu : (sites, dim) or, for an ensemble, (members, sites, dim);  g : (sites, n, n), or with a
    leading axis of members.
    """

    mu: Any
    g: Any = None

    @cached_property
    def in_a_row(self) -> dict[str, Any]:
        """The numbers of all sites one after the other, as formulas take them that are written out:
        small vectors, of an ensemble (members, n).
        """
        lead = self.mu.shape[:-2]
        in_rows = {}
        for name, x in self.arrays.items():
            rows = np.ascontiguousarray(x)
            rows = rows.view(float) if np.iscomplexobj(rows) else rows
            row = rows.reshape(*lead, -1)
            in_rows[name] = small(row) if not lead else frozen_array(row, name)
        return in_rows


@record
class NoisySites(SiteState):
    """Sites with the number of the path that the noise of each takes, `path` : (sites,), or with a leading
    axis of members.
    """

    path: Any = None


def site_state(name: str, group: PowerGroup, mu: Any, g: Any) -> SiteState:
    """Momenta and, if given, elements of many sites, checked; one member of either may serve for many of the other."""
    momenta = _of_sites(f"{name}: mu", group, mu, "Vec", "momenta")
    elements = None
    if g is not None:
        elements = _of_sites(f"{name}: g", group, g, "Element", "elements")
        _require_elements(f"{name}: g", group, elements)
    axes = momenta.ndim - 2
    if elements is not None:
        axes_of_elements = elements.ndim - 1 - len(group.base.element_shape)
        if axes and axes_of_elements and len(momenta) != len(elements):
            raise InvalidInput(f"{name}: momenta of {len(momenta)} members and elements of {len(elements)}")
        if axes > axes_of_elements:
            elements = np.broadcast_to(elements, (len(momenta), *elements.shape))
        elif axes_of_elements > axes:
            momenta = np.broadcast_to(momenta, (len(elements), *momenta.shape))
    return SiteState(momenta, elements)


def _of_sites(name: str, group: PowerGroup, value: Any, kind: str, what: str) -> np.ndarray:
    """An array (sites, ...) or (members, sites, ...), finite."""
    site_shape = (group.base.dim,) if kind == "Vec" else group.base.element_shape
    is_complex = kind != "Vec" and group.base.is_complex
    array = real_array(value, name, is_complex)
    shape = (group.copies, *site_shape)
    if array.shape[-len(shape) :] != shape and kind == "Vec" and array.shape[-1:] == (group.dim,):
        array = group.by_site(array, kind)
    elif array.shape[-len(shape) :] != shape and array.shape[-1:] == group.element_shape:
        array = group.by_site(real_array(value, name), kind)
    if array.shape[-len(shape) :] != shape or array.ndim > len(shape) + 1:
        raise InvalidInput(
            f"{name} has shape {np.shape(value)}; {what} of the {group.copies} sites of {group!r} "
            f"have shape {shape}, those of many members {('members', *shape)}".replace("'", "")
        )
    if not array.size and shape[-1]:
        raise InvalidInput(f"{name} has shape {array.shape}; an ensemble needs a member at least")
    finite = np.isfinite(array)
    if not finite.all():
        check_finite(array, name)
    return array


def _require_elements(name: str, group: PowerGroup, g: np.ndarray) -> None:
    """Raise InvalidInput for an array that is not on the group, with the site."""
    inside = np.atleast_1d(group.base.contains(g))
    if not inside.all():
        at = tuple(map(int, np.argwhere(~inside)[0]))
        where = ", ".join(map(str, at))
        raise InvalidInput(f"{name}[{where}] {group.base._objection('g', g[at])}")


def velocities_of_sites(name: str, group: PowerGroup, xi: Any) -> np.ndarray:
    """Velocities (sites, dim) or (members, sites, dim), checked."""
    return _of_sites(name, group, xi, "Vec", "velocities")


def rows_of_species(name: str, group: SpeciesGroup, value: Any, kind: str) -> np.ndarray:
    """Momenta, velocities or elements of sites of several species in a row, (..., n), checked.

    value : an array for each species, (sites, ...) or (members, sites, ...); or all in a row.
    """
    noun = "momenta" if kind == "Vec" else "elements"
    if not isinstance(value, (list, tuple)) or len(value) != len(group.powers):
        row = (group.dim,) if kind == "Vec" else group.element_shape
        in_a_row = value if np.ndim(value) and np.shape(value)[-1:] == row else None
        if isinstance(value, (list, tuple)) and in_a_row is None:
            raise InvalidInput(
                f"{name} has {len(value)} parts; give the {noun} of each of the {len(group.powers)} "
                f"species of {group!r}"
            )
        if in_a_row is None:
            raise InvalidInput(
                f"{name}: give the {noun} of each of the {len(group.powers)} species of {group!r}, a "
                f"list of arrays; got {np.shape(value)}"
            )
        value = group.by_species(real_array(in_a_row, name), kind)
    parts, members = [], set()
    for k, (power, x) in enumerate(zip(group.powers, value)):
        array = _of_sites(f"{name}[{k}]", power, x, kind, noun)
        if kind != "Vec":
            _require_elements(f"{name}[{k}]", power, array)
        rows = np.asarray(power.in_a_row(array, kind))
        members |= {*rows.shape[:-1]}
        parts.append(rows)
    if len(members) > 1:
        raise InvalidInput(f"{name}: {noun} of {sorted(members)} members; species have as many")
    return np.concatenate([np.broadcast_to(x, (*members, x.shape[-1])) for x in parts], axis=-1)
