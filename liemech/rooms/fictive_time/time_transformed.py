"""Time-transformed canonical systems: Hamilton's equations in a fictive time, with physical time as
one more position.
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidTimeScale
from ...formulas import Vec, gradient, log, record, vec
from ...systems.canonical import CanonicalState, HamiltonianSystem
from ...systems.separable import SeparableSystem
from .sundman import InFictiveTime
from .time_scales import POSITIVE, TimeScale, time_scale


@record
class ExtendedSystem(InFictiveTime, HamiltonianSystem):
    """A canonical system with two more coordinates: the time t, its last position, and -H_0, which
    belongs to it; abstract.

    A run begins from a state of the system itself; then H_0 is its energy.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VIII.2.
    """

    wanted: ClassVar[type[HamiltonianSystem]] = HamiltonianSystem

    system: HamiltonianSystem

    def __post_init__(self) -> None:
        if not isinstance(self.system, self.wanted) or self.system.fictive:
            raise IncompatibleSystem(
                f"{type(self).__name__} is for a {self.wanted.__name__} such as Kepler(); got "
                f"{self.system!r}. ReversibleController(method, sigma) varies the steps of a "
                "symmetric method on any system, SundmanTransformed(system, sigma) those of any "
                "other"
            )
        super().__post_init__()

    @property
    def degrees(self) -> int:  # type: ignore[override]
        """The degrees of freedom, one of them the time."""
        return self.system.degrees + 1

    def without(self, x: Vec) -> Vec:
        """Positions without the time, or momenta without -H_0, (n,).  x : (n + 1,)."""
        return x[: self.degrees - 1]

    def clock(self, state: Any) -> Any:
        return state.q[self.degrees - 1]

    # ---------------------------------------------------------------- starts and samples

    def extended(self, start: CanonicalState, t0: float) -> CanonicalState:
        """A start of the system, or an ensemble of them, with its time and energy."""
        energy = self.system.energy(start.q, start.p)
        if start.bodies is None:
            return CanonicalState(vec(*start.q, t0), vec(*start.p, -energy))
        minus = -np.asarray(energy)[:, None]
        return CanonicalState(
            np.concatenate([start.q, np.full(minus.shape, t0)], axis=1), np.concatenate([start.p, minus], axis=1)
        )

    def apart(self, states: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray], None]:
        """The samples taken apart: the times, and the parts of the states of the system itself."""
        return states["q"][..., -1], {name: x[..., :-1] for name, x in states.items()}, None

    def of_tangent(self, components: int) -> list[int]:
        """The time is the last of the positions, minus the energy of the momenta."""
        n = components // 2
        return [*range(n - 1), *range(n, 2 * n - 1), n - 1]


@record
class TimeTransformed(ExtendedSystem):
    """A canonical system in a fictive time tau, dt = sigma dtau, whose motion is Hamilton's again:

        K = sigma (H - H_0),   q' = sigma dH/dp + (H - H_0) dsigma/dp,   p' = -sigma dH/dq - (H - H_0) dsigma/dq,   t' = sigma

    H_0 is the energy of the start, so that K = 0 and the motion that of H, in another time.  A
    symplectic method with fixed steps in tau takes steps of about sigma h in t, and its energy does
    not drift.
    system : any HamiltonianSystem.  sigma : a TimeScale such as DistancePower(1.5), or a function
    of q, or of q and p.

    AdaptiveVerlet() and its compositions are for T(p) + V(q) and sigma(q), HamiltonJacobi(order=4)
    and the methods of Gauss, RKMK(tableau=tableaus.gauss(2)), for any of them.  `integrate` takes a
    start of the system itself and h in fictive time.
    Source: Hairer, Lubich, Wanner, VIII.2; the slides, (3.2) and (3.3); Hairer, Appl. Numer. Math.
    25 (1997), 219; Reich, SIAM J. Numer. Anal. 36 (1999), 1549.
    """

    alternatives: ClassVar[str] = (
        "AdaptiveVerlet() is for sigma(q), HamiltonJacobi(order=4) for any sigma; RKMK accepts every system"
    )

    sigma: TimeScale

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", time_scale(type(self).__name__, self.sigma))
        super().__post_init__()

    def bound(self, start: CanonicalState) -> TimeTransformed:
        return dataclasses.replace(self, sigma=self.sigma.bound(self.system, start))

    def scale(self, q: Vec, p: Vec) -> float:
        """sigma.  q, p : (n + 1,)."""
        return self.sigma.value(self.system, CanonicalState(self.without(q), self.without(p)))

    def excess(self, q: Vec, p: Vec) -> float:
        """H - H_0.  q, p : (n + 1,)."""
        return self.system.energy(self.without(q), self.without(p)) + p[self.degrees - 1]

    def energy(self, q: Vec, p: Vec) -> float:
        """K = sigma (H - H_0).  q, p : (n + 1,)."""
        return self.scale(q, p) * self.excess(q, p)

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """(q', t').  q, p : (n + 1,)."""
        sigma, x, y = self.scale(q, p), self.without(q), self.without(p)
        v = sigma * self.system.velocity(x, y)
        if not self.sigma.positions:
            v = v + self.excess(q, p) * gradient(lambda z: self.sigma.value(self.system, CanonicalState(x, z)), y)
        return vec(*v, sigma)

    def force(self, q: Vec, p: Vec) -> Vec:
        """(p', 0).  q, p : (n + 1,)."""
        x, y = self.without(q), self.without(p)
        slope = (
            self.sigma.slope(self.system, x)
            if self.sigma.positions
            else gradient(lambda z: self.sigma.value(self.system, CanonicalState(z, y)), x)
        )
        return vec(*(self.scale(q, p) * self.system.force(x, y) - self.excess(q, p) * slope), 0.0)


@record
class InversePotential(TimeScale):
    """sigma = -1/V(q), that of the logarithmic Hamiltonian.

    Source: Preto and Tremaine, Astron. J. 118 (1999), 2532.
    """

    parts: ClassVar[tuple[str, ...] | None] = ("q",)

    def value(self, system: Any, state: Any) -> float:
        """The time scale -1/V(q), positive for V < 0."""
        return -1.0 / system.potential(state.q)


@record
class LogarithmicHamiltonian(ExtendedSystem, SeparableSystem):
    """A system T(p) + V(q) with V < 0 in a fictive time, with an energy that is a sum again, so
    that splittings are explicit:

        Gamma = log(T(p) - H_0) - log(-V(q)),   q' = (dT/dp)/(T - H_0),   t' = 1/(T - H_0),   p' = -(dV/dq)/(-V)

    On the motion Gamma = 0, T - H_0 = -V, and dt = dtau/(-V).  Splitting(order=4, quadratic=False),
    6 or 8 step it; so does StormerVerlet(), which keeps an orbit of Kepler exactly and errs in time
    only.
    `integrate` takes a start of the system itself and h in fictive time.

    Source: Mikkola and Tanikawa, Celest. Mech. Dyn. Astron. 74 (1999), 287; Preto and Tremaine,
    Astron. J. 118 (1999), 2532.
    """

    wanted: ClassVar[type[HamiltonianSystem]] = SeparableSystem
    alternatives: ClassVar[str] = (
        "StormerVerlet() and Splitting(order=4, quadratic=False) are for it, RKMK accepts every system"
    )
    quadratic = False  # its kinetic part is a logarithm

    @property
    def sigma(self) -> TimeScale:
        """The time scale dt/dtau on the motion, -1/V."""
        return InversePotential()

    def bound(self, start: CanonicalState) -> LogarithmicHamiltonian:
        """The potential must be negative."""
        highest = np.max(self.system.potential(start.q))  # type: ignore[attr-defined]
        if not highest < 0.0:
            raise InvalidTimeScale(
                f"LogarithmicHamiltonian: the potential of {self.system!r} is {highest:g} at the "
                "start, and its logarithm needs a negative one. Subtract a constant from it that "
                "is larger than it ever becomes"
            )
        return self

    def kinetic(self, p: Vec) -> float:
        """log(T - H_0).  p : (n + 1,)."""
        return log(self._surplus(p))

    def potential(self, q: Vec) -> float:
        """-log(-V).  q : (n + 1,)."""
        return -log(-self.system.potential(self.without(q)))  # type: ignore[attr-defined]

    def velocity(self, q: Vec, p: Vec) -> Vec:
        """(q', t').  q, p : (n + 1,)."""
        scale = 1.0 / self._surplus(p)
        return vec(*(scale * self.system.velocity(self.without(q), self.without(p))), scale)

    def force(self, q: Vec, p: Vec) -> Vec:
        """(p', 0).  q, p : (n + 1,)."""
        return vec(*self.system.relative_force(self.without(q)), 0.0)  # type: ignore[attr-defined]

    def _surplus(self, p: Vec) -> float:
        """The surplus T - H_0, positive or InvalidTimeScale."""
        surplus = self.system.kinetic(self.without(p)) + p[self.degrees - 1]  # type: ignore[attr-defined]
        if not surplus > 0.0:
            raise InvalidTimeScale(f"LogarithmicHamiltonian: T - H_0 = {surplus:g}; {POSITIVE}. A smaller h may help")
        return surplus
