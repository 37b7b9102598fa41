"""The contents of a scene unless they are named: those that tell most about a system."""

from __future__ import annotations

from typing import Any

from ..errors import InvalidInput
from ..models.cosserat_rod import CosseratRod
from ..models.heavy_top import HeavyTop, ReducedHeavyTop
from ..models.linkage import Linkage
from ..models.poses import configurations, is_pose, turns
from ..models.sites import is_place, is_spin, of_sites
from ..models.zeitlin_sphere import ZeitlinSphere
from ..systems.canonical import CanonicalSystem
from ..systems.poisson import PoissonSystem
from .body import Body
from .content import Content, chosen, require
from .field import Field
from .links import Links
from .points import Points
from .rods import Rod
from .sites import Sites, Spins
from .vectors import Momentum, SpatialMomentum, Vertical

KNOWN: dict[str, type[Content]] = {
    "body": Body,
    "momentum": Momentum,
    "spatial momentum": SpatialMomentum,
    "vertical": Vertical,
    "points": Points,
    "links": Links,
    "spins": Spins,
    "sites": Sites,
    "rod": Rod,
    "field": Field,
}
"""Contents by name."""


def contents_of(
    system: Any, parts: frozenset[str], ensemble: bool, show: Any = None
) -> tuple[Content, ...]:
    """What is asked for, or else what suits a system of which these parts of the state are known.
    Raises InvalidInput if it has not got it.
    """
    contents = suited(system, parts, ensemble) if show is None else chosen(show, KNOWN)
    require(contents, system, parts)
    return contents


def suited(system: Any, parts: frozenset[str], ensemble: bool) -> tuple[Content, ...]:
    """The contents that suit a system of which these parts of the state are known."""
    if isinstance(system, CanonicalSystem):
        return (Points(),)
    if isinstance(system, PoissonSystem):
        raise InvalidInput(
            f"there is no moving picture of {system!r}, whose state is no place; `run.plot()`, or "
            "--plot, draws it"
        )
    group, one = configurations(system), "g" in parts and not ensemble
    if group is None:
        raise InvalidInput(
            f"there is no picture of {system!r} yet; say what to "
            "show, such as show=Points(places=...)"
        )
    many = of_sites(system)
    wanted: list[Content] = []
    if isinstance(system, ZeitlinSphere):
        wanted = [] if ensemble else [Field()]
    elif isinstance(system, CosseratRod):
        wanted = [Rod()] if one else []
    elif many is not None:
        if one and (is_pose(many.base) or is_place(many.base)):
            wanted = [Sites()]
        elif "mu" in parts and is_spin(many.base):
            wanted = [Spins()]
    elif isinstance(system, Linkage):
        wanted = [Links()] if one else []
    elif isinstance(system, (HeavyTop, ReducedHeavyTop)):
        wanted = [Body(), Vertical()] if one else [Vertical()] if not ensemble else []
    elif is_pose(group):
        wanted += [Body()] if "g" in parts else []
        if "mu" in parts and turns(group):
            wanted += [SpatialMomentum()] if one else []
            wanted += [Momentum()]
    fitting = tuple(content for content in wanted if set(content.needs(system)) <= parts)
    if not fitting:
        raise InvalidInput(
            f"there is no picture of {system!r} with "
            f"{', '.join(sorted(parts))} alone; show is one of {', '.join(KNOWN)}"
        )
    return fitting
