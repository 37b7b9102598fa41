"""The heavy top, a rigid body about a fixed point under gravity: on SO(3) in a field, and on se(3)* without one."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, dot, record, sqrt, vec
from ...formulas.classes.fields import frozen_array
from ...groups.rigid.se3 import SE3, halves, join
from ...systems.hamiltonian import Hamiltonian
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ...systems.mechanical import MechanicalSystem
from ..input_checks import alone, exact_motion, exact_times
from .gravity import FixedPointGravity
from .rigid_body import RigidBody


@record
class HeavyTop(MechanicalSystem):
    """A heavy top on SO(3): mu' = mu x xi + w Gamma x c,  g' = g hat(xi),  xi = J^-1 mu,  Gamma = g^T e3.

    inertia : about the fixed point, the principal moments, (3,), or the matrix J, (3, 3), in kg
    m^2.
    weight : w = m g, in N.  centre : c, the centre of mass seen from the fixed point in body axes,
    (3,), in m.  mu is the angular momentum in the body about the fixed point, in kg m^2/s; g the
    rotation from body to space, e3 upwards.

    Conserved: the energy H = mu . J^-1 mu/2 + w Gamma . c and the vertical momentum mu . Gamma.
    `reduced` is the same top on se(3)*.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.4 and
    15.10; Holm, Geometric Mechanics, part II, chapter 8.
    """

    body: RigidBody = field(init=False, repr=False)
    potential: FixedPointGravity = field(init=False, repr=False)
    inertia: Vec | Mat
    weight: float
    centre: Vec

    def __post_init__(self) -> None:
        object.__setattr__(self, "body", RigidBody(self.inertia))
        object.__setattr__(self, "inertia", self.body.inertia)
        object.__setattr__(self, "potential", FixedPointGravity(self.weight, self.centre))
        super().__post_init__()

    @property
    def reduced(self) -> ReducedHeavyTop:
        """The reduced top on se(3)*, without turns about the vertical."""
        return ReducedHeavyTop(self.inertia, self.weight, self.centre)


@record
class LagrangeTop(HeavyTop):
    """A symmetric heavy top with its centre of mass on its axis, e3 of the body: the spin mu_3 is
    kept too.

    transverse, axial : the moments A (twice) and C about the fixed point, in kg m^2.
    weight : w = m g, in N.  length : l, from the fixed point to the centre of mass along the axis,
    in m.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 15.10;
    Goldstein, Classical Mechanics, 3rd ed., section 5.7.
    """

    inertia: Vec = field(init=False, repr=False)
    weight: float
    centre: Vec = field(init=False, repr=False)
    transverse: float
    axial: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "inertia", vec(self.transverse, self.transverse, self.axial))
        object.__setattr__(self, "centre", vec(0.0, 0.0, self.length))
        super().__post_init__()

    @property
    def sleeping_momentum(self) -> float:
        """The spin |mu_3| = 2 sqrt(A w l) above which the upright top sleeps: it is stable; below it falls."""
        return 2.0 * sqrt(self.transverse * abs(self.weight * self.length))

    def exact(self, start: BodyState, t: Any) -> BodyState:
        """The exact motion, by elliptic functions: nodding, steady, sleeping, falling from the
        vertical, through either pole.

        t : () or (n,), in s, from the start.  Returns mu : (..., 3), g : (..., 3, 3).
        Error about 1e-15 (1 + |omega| t), of motions next to the separatrix as much more as they
        enlarge an error of the start.
        Raises InvalidInput under a load.

        Source: Whittaker, Analytical Dynamics, 4th ed., sections 71-73.
        """
        from .exact_top import lagrange_top, quaternion

        alone(start, "LagrangeTop.exact", "top")
        if self.load is not None:
            raise InvalidInput("LagrangeTop.exact knows no motion under a load; integrate it")
        times = exact_times(t, "LagrangeTop.exact")
        moment, begin = self.weight * self.length, quaternion(np.array(start.g))

        def motion(t: np.ndarray) -> tuple[Any, ...]:
            q, mu = lagrange_top(self.transverse, self.axial, moment, tuple(start.mu), begin, t)
            return mu, _matrix(*q)

        mu, g = exact_motion(motion, times.reshape(-1), "LagrangeTop.exact")
        return BodyState(
            frozen_array(mu.reshape(*times.shape, 3), "mu"), frozen_array(g.reshape(*times.shape, 3, 3), "g")
        )

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, vertical momentum and spin."""
        return super().constants(states) | ({} if self.load else {"spin": states["mu"][..., 2]})


def _matrix(w: Any, x: Any, y: Any, z: Any) -> np.ndarray:
    """The rotations of unit quaternions, (n, 3, 3)."""
    rows = (
        (w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


# ------------------------------------------------------------------ on se(3)*


@record
class HeavyTopEnergy(Hamiltonian):
    """H(pi, Gamma) = pi . J^-1 pi/2 + w Gamma . c.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., section 1.4.
    """

    kinetic: KineticEnergy
    weight: float
    centre: Vec

    def energy(self, mu: Vec) -> float:
        """The kinetic and potential energy of (pi, gamma)."""
        pi, gamma = halves(mu)
        return self.kinetic.energy(pi) + self.weight * dot(gamma, self.centre)

    def gradient(self, mu: Vec) -> Vec:
        """The derivative of the energy, (J^-1 pi, w c)."""
        pi, _ = halves(mu)
        return join(self.kinetic.gradient(pi), self.weight * self.centre)

    def _shape(self, argument: str, kind: str) -> tuple[int, ...]:
        return (6,)


@record
class ReducedHeavyTop(LiePoissonSystem):
    """A heavy top on se(3)*: the momentum is (pi, Gamma), where Gamma, the vertical seen from the
    body, is carried along.

        pi' = pi x xi + w Gamma x c,   Gamma' = Gamma x xi,   xi = J^-1 pi

    are the Lie-Poisson equations of H(pi, Gamma); the Casimirs of SE(3) are |Gamma|^2 and the
    vertical momentum pi . Gamma.  The parameters are those of HeavyTop.  Of an element of SE(3) the
    rotation is the attitude, if it starts as one with g^T e3 = Gamma; its displacement means
    nothing.  H has no Lagrangian, being linear in Gamma.

    Source: Marsden and Ratiu, Introduction to Mechanics and Symmetry, 2nd ed., sections 1.4 and
    14.7; Holm, Marsden and Ratiu, The Euler-Poincare equations and semidirect products, Adv. Math.
    137 (1998).
    """

    group: SE3 = field(init=False, repr=False, default=SE3())
    hamiltonian: HeavyTopEnergy = field(init=False, repr=False)
    lagrangian: None = field(init=False, repr=False, default=None)
    inertia: Vec | Mat
    weight: float
    centre: Vec

    def __post_init__(self) -> None:
        body = RigidBody(self.inertia)
        object.__setattr__(self, "inertia", body.inertia)
        load = FixedPointGravity(self.weight, self.centre)
        object.__setattr__(self, "hamiltonian", HeavyTopEnergy(body.hamiltonian, load.weight, load.centre))

    @property
    def alternatives(self) -> str:  # type: ignore[override]
        """Advice for a method that refuses this form of the top."""
        top = f"HeavyTop({self.inertia!r}, {self.weight!r}, {self.centre!r})"
        return (
            f"{top} is the same top as a body in a field, for LieVerlet() and KickDrift(); in this "
            "form, on se(3)*, LiePoissonHamiltonJacobi(order=4) does without a Lagrangian, and "
            "RKMK accepts every system"
        )

    def from_top(self, start: BodyState) -> BodyState:
        """The state of a HeavyTop, its momentum and attitude, as one of this system: (pi, Gamma)
        and the attitude in place.
        """
        if start.g is None:
            raise InvalidInput(
                f"{type(self).__name__}.from_top: start has no attitude; take HeavyTop.state(mu=..., g=...)"
            )
        g = np.array(start.g)
        if g.shape[-2:] != (3, 3):
            raise InvalidInput(
                f"{type(self).__name__}.from_top: start has g of shape {g.shape}; it must be a state of a HeavyTop"
            )
        motion = np.zeros((*g.shape[:-2], 4, 4))
        motion[..., :3, :3], motion[..., 3, 3] = g, 1.0
        return self.state(mu=np.concatenate([np.array(start.mu), g[..., 2, :]], axis=-1), g=motion)
