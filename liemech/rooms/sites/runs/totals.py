"""Totals over the sites of a system of quantities of samples that are there: energies, what a motion
keeps.
"""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np

from ....compiler import kernel
from ....compiler.sites.planes import Planes
from ....formulas.classes.layouts import carried_layout, layout_of
from ....formulas.classes.records import names_of
from ....formulas.sites import padded
from ....groups.composed.species import SpeciesGroup
from ....systems.system import state_of
from .driver import Share, Shown, totals_of_samples
from .execution import SiteExecution
from .states import first_of, kind_of

ROWS = 2**22
"""Numbers of samples that are laid out at once."""


def of_sites(system: Any, states: dict[str, np.ndarray]) -> Any:
    """The site form of the system, if samples have an axis of sites and are too large for formulas
    that are written out; else None.
    """
    leading = next(iter(states.values()), np.empty(0))
    if leading.ndim < 2 or not {"mu", "q", "y"} & {*states}:
        return None
    site: Any = system.site_form
    if site is None or site.jointed:  # whose formulas are those of all bodies
        return None
    leading = next(iter(system.by_site(states).values()))
    large = leading.ndim == 3 and leading.shape[1] * leading.shape[2] > system.small
    return site if large else None


def energy(system: Any, t: np.ndarray, states: dict[str, np.ndarray]) -> np.ndarray:
    """The energy at every sample, (n,): the sum of the shares of the sites."""
    if not len(t):
        return np.empty(0)
    site = system.site_form
    formula = Share("energy", tuple(inspect.signature(site.energy).parameters))
    kind, states = kind_of(states), system.by_site(states)
    states = {p: states[p] for p in names_of(kind) if p in states}
    layout = layout_of(first_of(state_of(kind, {p: x[0] for p, x in states.items()})))
    shown = Shown(True, False, layout, (formula,), carried_layout((0.0,)))
    totals, count, width = np.empty((len(t), 1)), states[next(iter(states))].shape[1], layout.width
    samples_at_once = max(1, ROWS // (width * padded(count)))
    for begin in range(0, len(t), samples_at_once):
        samples = min(samples_at_once, len(t) - begin)
        rows = np.concatenate([_flat(x[begin : begin + samples]) for x in states.values()], axis=1)
        planes = np.empty((samples * width, padded(count)))
        planes[:, :count] = rows.reshape(samples * width, count)
        planes[:, count:] = planes[:, count - 1 : count]
        some_times = t[begin : begin + samples]
        totals_in(totals[begin : begin + samples], site, shown, Planes(planes, count), some_times)
    return totals[:, 0]


def totals_in(totals: np.ndarray, site: Any, shown: Any, seen: Planes, t: np.ndarray) -> None:
    """Write the totals of samples into an array, (samples, totals).  seen : the samples, one behind
    the other.
    """
    planes, shared = Planes.of_rows(1, 1), kernel.Shared(np.empty(0))
    execution = SiteExecution(None, None, totals_of_samples, site, shown, 0, 1, planes, shared, shared)
    arguments = site, shown, 0, len(t), seen
    times = np.ascontiguousarray(t, dtype=float)
    execution.drive((len(t) * seen.count, seen.count, 1), arguments, [totals, times])


def _flat(x: np.ndarray) -> np.ndarray:
    """Samples of sites, (n, sites, ...), as (n, width, sites)."""
    rows = np.ascontiguousarray(x).reshape(*x.shape[:2], -1)
    rows = rows.view(float) if np.iscomplexobj(rows) else rows
    return np.moveaxis(rows, 1, 2)


def constants(system: Any, t: np.ndarray, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The quantities that the motion keeps, by name: the energy, (n,), unless it changes with time, and on the dual of an
    algebra the Casimir functions of every site, (n, sites).
    """
    constants_of_motion = {} if system.driven else {"energy": energy(system, t, states)}
    if "mu" in states and hasattr(system, "casimirs"):
        for of_species, group, mu in _by_species(system.group, states["mu"]):
            each = np.asarray(group.casimirs(mu))
            constants_of_motion |= {f"Casimir {k + 1}{of_species}": each[..., k] for k in range(each.shape[-1])}
    return constants_of_motion | system.momenta_of_sites(states)


def _by_species(group: Any, mu: np.ndarray) -> list[tuple[str, Any, np.ndarray]]:
    """Of each species how it is called, the group of a site, and its momenta with an axis of sites."""
    if not isinstance(group, SpeciesGroup):
        return [("", group.base, mu)]
    parts = zip(group.powers, group.by_species(mu, "Vec"))
    return [(f" of species {k}", power.base, part) for k, (power, part) in enumerate(parts)]
