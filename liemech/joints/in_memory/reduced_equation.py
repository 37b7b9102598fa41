"""The reduced equation of any number of bodies and joints, as the equation of one of them: what holds the bodies together is
found once for all (`multipliers.py`), as is its way back.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VII.1.2 (index reduction).
"""

from __future__ import annotations

from typing import Any

from ...formulas import Vec, plain, record, vec
from ...formulas.classes.layouts import Layout
from ...formulas.numbers.transposes import is_pulled, ruled
from ...formulas.sites import once, total
from ...groups.rigid.se3 import SE3
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import NoPotential
from ...systems.system import System
from .multipliers import multipliers, work_in
from .multipliers_backwards import both_ways

FREE: Any = MechanicalSystem(LiePoissonSystem(SE3(), KineticEnergy([1.0] * 6)), NoPotential())
"""A body that moves alone, for its group; its inertia does not count."""


@record
class BodyAmongJoints(System):
    """The equation of one body of a linkage, which all methods step that ask for velocities.

    links : all bodies and joints.  sites : their memory.  memory : the layout of what a method carries along for a body.
    """

    links: Any = None
    sites: Any = None
    memory: Layout = None  # type: ignore[assignment]

    @property
    def group(self) -> Any:
        """The group T*SE(3), the pose and the momentum of one body."""
        return FREE.group

    @property
    def unit_blocks(self) -> tuple[int, ...]:
        return tuple(FREE.unit_blocks)

    def displaced(self, retraction: Any, state: BodyState, omega: Vec) -> BodyState:
        return FREE.displaced(retraction, state, omega)

    def variation(self, state: BodyState, omega: Vec) -> tuple[Vec, Vec]:
        return FREE.variation(state, omega)

    def mean_over_sites(self, value: Any) -> Any:
        """The mean over all bodies: places behind them do not count."""
        return total(work_in(self.sites, self.memory, self.links).counts.load() * value) / self.links.bodies

    @property
    def configurations(self) -> Any:
        """The group SE(3) of the poses of one body."""
        return FREE.configurations

    def rate(self, t: float, state: BodyState) -> Vec:
        """The velocity on T*SE(3), (xi, f + F - G* lam)."""
        return ruled(
            self._rate_at, self._rate_back, FREE.configurations, (t,), BodyState(plain(state.mu), plain(state.g))
        )

    def _rate_at(self, t: float, state: BodyState) -> Vec:
        if is_pulled():
            return self._either_way(t, state, vec(*[0.0] * 12), 0.0)
        work = work_in(self.sites, self.memory, self.links)
        velocity: Vec = once(
            multipliers, work.state, state, work.rate_on_cotangent, self.links, t, self.sites, self.memory
        )
        return velocity

    def _rate_back(self, t: float, state: BodyState, w: Vec) -> Any:
        felt = self._either_way(t, state, w, 1.0)
        return (BodyState(felt[:6], felt[6:]),), []

    def _either_way(self, t: float, state: BodyState, w: Vec, back: float) -> Vec:
        """The velocity, or, with 1 for `back`, the derivatives by the state of <w, velocity>."""
        work = work_in(self.sites, self.memory, self.links)
        answer: Vec = once(both_ways, work.asked, (state, w, back), work.felt, self.links, t, self.sites, self.memory)
        return answer
