"""The contents of a scene unless they are named: those that tell most about a system."""

from __future__ import annotations

from typing import Any

from ..errors import InvalidInput
from ..joints.linkage import Linkage
from ..joints.rolling import Blade, Rolling
from ..models.bodies.gravity import FixedPointGravity, UniformGravity
from ..models.bodies.heavy_top import HeavyTop, ReducedHeavyTop
from ..models.lattices.magnetic_sphere import MagneticSphere
from ..models.lattices.zeitlin_sphere import ZeitlinSphere
from ..models.many.cosserat_rod import CosseratRod
from ..models.many.sites import base_of, is_place, is_spin
from ..models.poses import configurations, is_pose, turns
from ..models.swinging.constrained_pendulums import ChainPendulum, FourBarLinkage, SphericalPendulum
from ..models.swinging.pendulums import DoublePendulum, Pendulum
from ..systems.canonical import CanonicalSystem
from ..systems.system import System
from .contents.body import Body
from .contents.content import Content, chosen, require
from .contents.field import Field
from .contents.links import Links
from .contents.points import Points
from .contents.rods import Rod
from .contents.sites import Sites, Spins
from .contents.vectors import Momentum, SpatialMomentum, Vertical

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

SUITED: dict[type[System], tuple[type[Content], ...]] = {
    ZeitlinSphere: (Field,),
    MagneticSphere: (Field,),
    CosseratRod: (Rod,),
    Linkage: (Links,),
    HeavyTop: (Body, Vertical),
    ReducedHeavyTop: (Body, Vertical),
}
"""Contents that suit systems with a picture of their own."""

IN_UNIFORM_GRAVITY = (
    ReducedHeavyTop,
    Linkage,
    CosseratRod,
    Pendulum,
    DoublePendulum,
    SphericalPendulum,
    ChainPendulum,
    FourBarLinkage,
)
"""Systems with a direction downwards, although they have no potential that says so."""


def has_floor(system: Any) -> bool:
    """Whether a system is shown above a floor: it is in a uniform field of gravity, or rolls or glides on a plane."""
    falls = isinstance(getattr(system, "potential", None), UniformGravity | FixedPointGravity)
    falls = falls or (isinstance(system, IN_UNIFORM_GRAVITY) and getattr(system, "gravity", 1.0) != 0.0)
    on_plane = isinstance(getattr(system, "constraint", None), (Rolling, Blade))
    return falls or on_plane


def contents_of(system: Any, parts: frozenset[str], ensemble: bool, show: Any = None) -> tuple[Content, ...]:
    """The contents that are asked for, or that suit a system of which these parts of the state are known.
    Raises InvalidInput if it has not got it.
    """
    contents = suited(system, parts, ensemble) if show is None else chosen(show, KNOWN)
    require(contents, system, parts)
    return contents


def suited(system: Any, parts: frozenset[str], ensemble: bool) -> tuple[Content, ...]:
    """The contents that suit a system of which these parts of the state are known."""
    if isinstance(system, CanonicalSystem):
        return (Points(),)
    group, base = configurations(system), base_of(system)
    of_kind = [contents for kind, contents in SUITED.items() if isinstance(system, kind)]
    contents: tuple[type[Content], ...] = ()
    if of_kind:
        contents = of_kind[0]
    elif base is not None:
        placed = "g" in parts and (is_pose(base) or is_place(base))
        contents = (Sites,) if placed else (Spins,) if is_spin(base) else ()
    elif turns(group):
        contents = Body, SpatialMomentum, Momentum
    elif is_pose(group):
        contents = (Body,)
    if not contents:
        raise InvalidInput(
            f"there is no moving picture of {system!r}, whose state is no place; `run.plot()`, or --plot, draws it"
        )
    if ensemble:
        contents = () if of_kind else tuple(kind for kind in contents if kind in (Body, Momentum))
    fitting = tuple(kind() for kind in contents if set(kind().needs(system)) <= parts)
    if not fitting:
        raise InvalidInput(
            f"there is no picture of {system!r} with "
            f"{', '.join(sorted(parts))} alone; show is one of {', '.join(KNOWN)}"
        )
    return fitting
