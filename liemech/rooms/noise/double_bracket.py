"""Damping that lowers the energy of a momentum and leaves it on its coadjoint orbit."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, final

import numpy as np

from ...errors import InvalidInput, InvalidType
from ...formulas import Mat, Vec, record, solve
from ...formulas.vectors import small
from ...groups.composed.power import PowerGroup
from ...groups.composed.species import SpeciesGroup
from ...groups.lie_group import LieGroup
from ...systems.hamiltonian import Hamiltonian
from ...systems.lie_poisson import BodyState, LiePoissonMotion, LiePoissonSystem
from ...systems.many.energies import moving


@record
class DoubleBracket(LiePoissonMotion):
    """A Lie-Poisson system with double-bracket damping: the energy falls, the Casimirs stay.

        mu' = ad*_(xi + eta) mu,   xi = dH/dmu,   eta = damping M^-1 ad*_xi mu,   dH/dt = -damping (ad*_xi mu) . M^-1 (ad*_xi mu)

    On so(3)*, with M = 1, this is mu' = mu x xi + damping mu x (mu x xi), the damping of Landau and Lifshitz.
    The momentum comes to rest where H is least on its orbit.  An attitude moves by the same velocity,
    g' = g (xi + eta), so that the spatial momentum is constant.

    system : the motion without damping.  damping : not negative; its unit makes damping ad*_xi mu a velocity.
    metric : M, a scalar product on the algebra, (dim, dim) symmetric and positive; None: that of the basis.

    Raises InvalidInput for a negative damping, and for a metric that is not symmetric and positive.
    Source: Bloch, Krishnaprasad, Marsden, Ratiu, The Euler-Poincare equations and double bracket dissipation,
    Commun. Math. Phys. 175 (1996), section 3.
    """

    alternatives: ClassVar[str] = "RKMK, CommutatorFree and Magnus keep its orbits, ImplicitMidpoint those of rotations"

    along_orbits: ClassVar[bool] = True

    system: LiePoissonSystem
    damping: float
    metric: Mat | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.system, LiePoissonSystem):
            raise InvalidType(
                f"DoubleBracket: system must be a LiePoissonSystem such as RigidBody([1.0, 1.5, 2.0]); got {self.system!r}"
            )
        if not self.damping >= 0.0:
            raise InvalidInput(f"DoubleBracket: damping is not negative, for energy falls; got {self.damping!r}")
        if self.metric is not None:
            require_metric("DoubleBracket", self.metric, self.system.group.dim)
            if isinstance(self.system.group, (PowerGroup, SpeciesGroup)):
                raise InvalidInput("DoubleBracket: leave metric out for many sites; each has that of its basis")
        super().__post_init__()

    @property
    def group(self) -> LieGroup:
        return self.system.group

    @property
    def hamiltonian(self) -> Hamiltonian:
        """The energy H, which falls along the motion."""
        return self.system.hamiltonian

    @cached_property
    def site_form(self) -> DoubleBracket | None:
        """The damping of one of many sites, by what the others make of its energy; None for one body."""
        site = self.system.site_form
        return None if site is None else DoubleBracket(site, self.damping)

    @final
    def velocity(self, mu: Vec) -> Vec:
        """xi + eta, by which momentum and attitude move.  mu : (dim,)."""
        xi = self.system.velocity(mu)
        change = self.group.ad_star(xi, mu)
        eta = change if self.metric is None else solve(self.metric, change)
        return xi + self.damping * moving(self.hamiltonian, eta)

    @final
    def energy(self, mu: Vec) -> float:
        """The energy H(mu), which falls along the motion.  mu : (dim,)."""
        return self.system.energy(mu)

    @final
    def rate(self, t: float, state: BodyState) -> Vec:
        """The body velocity with the damping, xi + eta, (dim,)."""
        return self.velocity(state.mu)

    @final
    def state(self, mu: Any = None, g: Any = None, *, xi: Any = None) -> BodyState:
        """A start for `integrate`, as `LiePoissonSystem.state` has it.

        mu, xi : (dim,), or (bodies, dim) for an ensemble;  g : an element, or one for each body.
        Raises InvalidInput as that does.
        """
        return self._vouched(self.system.state(mu, g, xi=xi))


def require_metric(name: str, metric: Any, dim: int) -> None:
    """Raise InvalidInput unless this is a scalar product on an algebra of this dimension."""
    array = np.array(metric)
    if array.shape != (dim, dim):
        raise InvalidInput(f"{name}: metric has shape {array.shape}; here it is ({dim}, {dim})")
    if not np.array_equal(array, array.T):
        raise InvalidInput(f"{name}: metric must be symmetric; got {small(array)!r}")
    least = np.linalg.eigvalsh(array)[0]
    if not least > 0.0:
        raise InvalidInput(f"{name}: metric must be positive; its smallest eigenvalue is {least:g}")
