"""Lie-Poisson systems with a dissipation of their own, whose flow is known in closed form."""

from __future__ import annotations

from typing import Any, ClassVar

from ...errors import require, undefined
from ...formulas import Vec, record
from ...groups.lie_group import LieGroup
from ...systems.hamiltonian import Hamiltonian
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.system import System


@record
class Dissipative(System):
    """A Lie-Poisson system that loses what it moves, mu' = ad*_xi mu + D(mu), xi = dH/dmu; abstract.

    A subclass writes `damped`, the flow of mu' = D(mu) alone.  Momenta leave their coadjoint orbits, so
    that Casimirs change; elements of the group do not move along.
    `DissipativeSplitting(Isospectral(2))` moves it.

    system : the motion without dissipation.

    Source: McLachlan and Quispel, Splitting methods, Acta Numerica 11 (2002), section 3.13.
    """

    alternatives: ClassVar[str] = (
        "DissipativeSplitting(Isospectral(2)) moves it, and Isospectral(2) its `system`, which is not damped"
    )

    coordinates: ClassVar[tuple[str, ...]] = ("mu",)
    dissipative: ClassVar[bool] = True

    system: LiePoissonSystem

    def __post_init__(self) -> None:
        require(f"{type(self).__name__}: system", self.system, LiePoissonSystem)
        super().__post_init__()

    def damped(self, mu: Vec, t: float) -> Vec:
        """The momentum after a time t > 0 of damping alone.  mu : (dim,)."""
        raise undefined(self, "damped")

    @property
    def group(self) -> LieGroup:
        return self.system.group

    @property
    def hamiltonian(self) -> Hamiltonian:
        """The energy of the system."""
        return self.system.hamiltonian

    @property
    def is_large(self) -> bool:
        return self.system.is_large

    def energy(self, mu: Vec) -> float:
        """The energy H(mu), without regard to damping.  mu : (dim,)."""
        return self.system.energy(mu)

    def casimirs(self, mu: Vec) -> Vec:
        """The Casimirs of the group, which damping changes.  mu : (dim,)."""
        return self.system.casimirs(mu)

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        return self.system._in_numpy(method, arguments)

    def state(self, mu: Any = None, *, xi: Any = None) -> BodyState:
        """A start for `integrate`.  mu, xi : as `LiePoissonSystem.state` has them.  Raises InvalidInput."""
        return self._vouched(self.system._written_out(self.system.state(mu, xi=xi)))
